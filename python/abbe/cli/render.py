"""``abbe render``: stages to EXR files."""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from .. import __version__, tev
from .._api import Options, Scene, counted
from .._core import Film
from .._files import replacing
from .._memory import peak_memory
from ..errors import AbbeError, UsageError
from ..frame_tokens import has_product_token
from . import frames, messages, options
from .progress import Reporter

PARTIAL = 3

Time = float | Literal["default"] | None


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("render", help="render a stage to EXR", allow_abbrev=False)
    options.add_stage(parser, time=False)
    parser.add_argument(
        "out",
        nargs="?",
        metavar="OUT",
        help="the .exr to write, instead of the stage's one product; #### (or $F4, <F4>, %%04d) is the frame, and with "
        "<OS> or <N>, a product's name or number, it names several products",
    )
    parser.add_argument("--output", "-o", dest="out_option", metavar="OUT", help="the same as OUT")
    group = parser.add_argument_group("frames")
    group.add_argument(
        "--frames",
        "-f",
        metavar="SPEC",
        help="such as 1, 1:4, 1:10x2, 1-4, 1-10:2, lists with commas; the stage's start unless given",
    )
    group.add_argument(
        "--defaultTime", "-d", dest="default_time", action="store_true", help="read default values, not time samples"
    )
    options.add_request(parser)
    group = parser.add_argument_group("accepted from scripts that call usdrecord")
    group.add_argument("--disableGpu", action="store_true", help="there is no other way: abbe renders on the CPU")
    group.add_argument("--disableCameraLight", action="store_true", help="there is no such light")
    group = parser.add_argument_group("reports")
    group.add_argument("--stats", metavar="FILE.json", help="write what was counted, chosen and warned of")
    group.add_argument(
        "--preview", metavar="FILE.png", help="write a picture of the layers, again and again while the image grows"
    )
    group.add_argument(
        "--tev",
        nargs="?",
        const=tev.DEFAULT,
        metavar="HOST:PORT",
        help=f"show the image in the viewer tev; {tev.DEFAULT}",
    )
    options.add_quiet(parser)
    parser.set_defaults(run=run)


@dataclass
class _Outcome:
    """What has been written so far."""

    files: list[str] = field(default_factory=list)
    renders: list[dict[str, Any]] = field(default_factory=list)


def _times(args: argparse.Namespace) -> list[Time]:
    if args.default_time and args.frames:
        raise UsageError("--defaultTime: contradicts --frames: give one of them")
    if args.default_time:
        return ["default"]
    return list(frames.parse(args.frames)) if args.frames else [None]


def _check_output(path: str, option: str, suffix: str) -> None:
    """Refuse what could not be written, before any time is spent."""
    target = Path(path)
    if target.suffix.lower() != suffix:
        hint = "; --preview FILE.png makes a picture" if suffix == ".exr" else ""
        raise UsageError(f"{option} {path}: must end with {suffix}{hint}")
    if target.is_dir():
        raise UsageError(f"{option} {path}: is a folder: name a file in it")
    folder = target.parent
    if not folder.is_dir():
        raise AbbeError(f"{path}: the folder {folder} does not exist: create it")
    if not os.access(folder, os.W_OK):
        raise AbbeError(f"{path}: the folder {folder} cannot be written to: choose another")


def _outputs(scene: Scene, args: argparse.Namespace, time_code: Time, request: Options) -> list[str]:
    """Return the file of each plan."""
    plans = scene.plans(**request)
    if args.out is not None:
        if len(plans) > 1 and not has_product_token(args.out):
            names = ", ".join(plan.product for plan in plans)
            raise UsageError(f"OUT {args.out}: the stage has {len(plans)} products: choose one with --product: {names}")
        stage_time = scene.document["stage"].get("time_code")
        frame = stage_time if time_code is None else time_code
        outputs = [
            frames.name_for(args.out, frame, "OUT", plan.product.rpartition("/")[2], ordinal)
            for ordinal, plan in enumerate(plans)
        ]
    else:
        outputs = [plan.output for plan in plans]
        for plan in plans:
            if not plan.output:
                where = f"{plan.product}.productName names" if plan.product else f"{args.stage} has"
                raise UsageError(f"OUT: is missing, and {where} no usable output: give a file such as out.exr")
    for output in outputs:
        _check_output(output, "OUT", ".exr")
    return outputs


# Pictures of a growing image come at most in this time (s), and cost at most this share of the time.
_PICTURE_EVERY = 2.0
_PICTURE_SHARE = 0.1


class _Watcher:
    """Shows the films of a growing render: as a picture in a file, in a viewer."""

    def __init__(self, preview: str | None, viewer: tev.Viewer | None) -> None:
        self._preview, self._viewer = preview, viewer
        self._next = 0.0

    def __call__(self, film: Film) -> None:
        begin = time.monotonic()
        if begin < self._next:
            return
        self.show(film)
        cost = time.monotonic() - begin
        self._next = begin + max(_PICTURE_EVERY, cost / _PICTURE_SHARE)

    def show(self, film: Film) -> None:
        """Show it now."""
        if self._preview is not None:
            from ..preview import write_preview

            write_preview(film, self._preview)
        if self._viewer is not None:
            try:
                self._viewer.show(film)
            except AbbeError as error:
                # A viewer that was closed is no reason to lose a render.
                messages.note(str(error))
                self._viewer = None


def _render_one(
    scene: Scene, index: int, output: str, args: argparse.Namespace, request: Options, watcher: _Watcher | None
) -> Film:
    """Render one plan to one file; interrupted, write what is finished and go on with the interruption."""
    reporter = None if args.quiet else Reporter(output)
    try:
        film = scene.render_plan(index, progress=reporter, passed=watcher, **request)
    except BaseException as interruption:
        partial: Film | None = getattr(interruption, "film", None)
        if partial is not None and partial.statistics["pixels"] > 0:
            if reporter:
                reporter.close()
            partial.write(output)
            done, total = partial.statistics["pixels"], _area(partial)
            messages.note(f"{output}: {done} of {total} pixels are finished, marked as partial")
        raise
    finally:
        if reporter:
            reporter.close()
    film.write(output)
    return film


def _area(film: Film) -> int:
    x0, y0, x1, y1 = film.window
    return (x1 - x0) * (y1 - y0)


def _seconds(seconds: float) -> str:
    """Three significant digits, never as a power of ten; all digits of whole seconds."""
    if seconds <= 0:
        return "0 s"
    # Rounded first: 0.9996 is 1.00, one decimal fewer than its own magnitude says.
    magnitude = math.floor(math.log10(float(f"{seconds:.2e}")))
    return f"{seconds:.{max(0, 2 - magnitude)}f} s"


def _write_statistics(path: str, outcome: _Outcome) -> None:
    document: dict[str, Any] = {"abbe": __version__, "renders": outcome.renders}
    peak = peak_memory()
    if peak is not None:
        document["peak_memory_bytes"] = peak
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    times = _times(args)
    if args.out_option is not None:
        if args.out is not None:
            raise UsageError(f"--output {args.out_option}: OUT {args.out} is given too: give one of them")
        args.out = args.out_option
    outcome = _Outcome()
    if args.out is not None:
        frames.need_placeholder(args.out, times, "OUT")
    if args.preview is not None:
        frames.need_placeholder(args.preview, times, "--preview")
        _check_output(args.preview, "--preview", ".png")
    if args.stats is not None:
        _check_output(args.stats, "--stats", ".json")
    try:
        # The stage stays open between frames.
        kept = None if len(times) == 1 or options.is_scene_file(args) else options.keep_open(args)
        for time_code in times:
            _render_frame(args, time_code, outcome, kept)
    except (AbbeError, OSError) as error:
        # With some frames written and others not, the output is partial, whatever went wrong.
        if not outcome.files:
            raise
        messages.error(str(error))
        messages.note(f"written before that: {', '.join(outcome.files)}")
        return PARTIAL
    finally:
        if args.stats is not None and outcome.renders:
            _write_statistics(args.stats, outcome)
    return 0


def _render_frame(args: argparse.Namespace, time_code: Time, outcome: _Outcome, kept: Any) -> None:
    scene = options.open_scene(args, time_code, kept)
    request = options.request(args, from_stage=not options.is_scene_file(args))
    outputs = _outputs(scene, args, time_code, request)
    for output in outputs:
        if output in outcome.files or outputs.count(output) > 1:
            raise UsageError(f"{output}: several products or frames would write it: give them different names")
    if args.preview is not None and len(outputs) > 1:
        raise UsageError("--preview: there are several products: choose one with --product")
    stage_time = scene.document["stage"].get("time_code")
    for index, output in enumerate(outputs):
        preview = None if args.preview is None else frames.name_for(args.preview, stage_time, "--preview")
        viewer = None if args.tev is None else tev.Viewer(args.tev, output)
        watcher = _Watcher(preview, viewer) if preview is not None or viewer is not None else None
        film = _render_one(scene, index, output, args, request, watcher)
        outcome.files.append(output)
        outcome.renders.append({"output": output, "frame": stage_time, **film.statistics})
        if not args.quiet:
            counts = f"{counted(len(film), 'AOV')}, {counted(_area(film), 'pixel')}"
            print(f"{output}: {counts}, {_seconds(film.statistics['trace_seconds'])}")
        if watcher is not None:
            watcher.show(film)
        if viewer is not None:
            viewer.close()
