"""Options that several commands share: which stage, read how; what to render. Names of usdrecord are understood too."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from typing import Any, Literal

from .._api import Options, Scene, asks_for_motion
from ..errors import NotUsdError, UsageError
from . import messages

__all__ = [
    "add_quiet",
    "add_request",
    "add_scalar_ior",
    "add_settings",
    "add_stage",
    "numbers",
    "open_scene",
    "request",
    "stage_options",
]

SCENE_SUFFIX = ".safetensors"
_SCENE_FILE = f"an exported {SCENE_SUFFIX} scene"


def numbers(
    kind: Callable[[str], Any], count: int, form: str, separators: str = ","
) -> Callable[[str], tuple[Any, ...]]:
    """Return a parser of ``count`` numbers, for argparse.

    Parameters
    ----------
    kind : int or float
    count : how many are wanted
    form : how they are written, for the error
    separators : characters between them
    """

    def parse(text: str) -> tuple[Any, ...]:
        parts = re.split(f"[{re.escape(separators)}]", text)
        try:
            values = tuple(kind(part) for part in parts)
        except ValueError:
            values = ()
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"'{text}' is not of the form {form}")
        return values

    return parse


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add ``--quiet``."""
    parser.add_argument("--quiet", action="store_true", help="no progress and no warnings")


def _names(text: str) -> list[str]:
    return [name for name in re.split(r"[,\s]+", text) if name]


def add_stage(parser: argparse.ArgumentParser, time: bool = True, scene_file: bool = True) -> None:
    """Add the stage and how it is read.

    Parameters
    ----------
    parser : to add to
    time : offer ``--frame`` and ``--defaultTime``; commands with ``--frames`` have their own
    scene_file : an exported scene will do instead
    """
    kinds = "a .usd, .usda, .usdc or .usdz file"
    parser.add_argument("stage", metavar="STAGE", help=f"{kinds}, or {_SCENE_FILE}" if scene_file else kinds)
    group = parser.add_argument_group("the stage")
    if time:
        group.add_argument("--frame", type=float, metavar="T", help="time code; the stage's start unless given")
        group.add_argument(
            "--defaultTime",
            "-d",
            dest="default_time",
            action="store_true",
            help="read default values, not time samples",
        )
    group.add_argument(
        "--purposes",
        type=_names,
        action="extend",
        metavar="P[,P...]",
        help="of default, render, proxy, guide; default and render unless the settings say otherwise",
    )
    group.add_argument(
        "--variant",
        action="append",
        default=[],
        metavar="PRIM{SET=NAME}",
        help="select a variant, such as /World/Ball{material=glass}",
    )
    group.add_argument(
        "--set",
        action="append",
        default=[],
        dest="overrides",
        metavar="PRIM.ATTR=VALUE",
        help="set an attribute, such as /World/Glass.inputs:ior=1.6",
    )
    group.add_argument(
        "--search-path",
        action="append",
        default=[],
        metavar="DIR",
        help="where to look for assets after the stage's own folders",
    )
    group.add_argument(
        "--session-layer", "--sessionLayer", metavar="FILE", help="a layer stronger than all layers of the stage"
    )
    group.add_argument(
        "--mask",
        type=_names,
        action="extend",
        default=[],
        metavar="PRIM[,PRIM...]",
        help="load these prims and what they need, nothing else",
    )
    group.add_argument(
        "--payloads", choices=("all", "none"), default="all", help="which payloads to load; all unless given"
    )
    group.add_argument(
        "--missing",
        choices=("warn", "error"),
        default="warn",
        help="what a missing layer, reference or texture is; warn unless given",
    )
    group.add_argument(
        "--complexity",
        "-c",
        choices=("low", "medium", "high", "veryhigh"),
        help="divide subdivision surfaces 0, 1, 2 or 3 times; unless given by their size, 2 for most",
    )


def add_scalar_ior(group: argparse._ArgumentGroup) -> None:
    """Add ``--scalar-ior``, which an exported scene keeps."""
    group.add_argument(
        "--scalar-ior",
        choices=("constant", "nearest-glass"),
        help="what becomes of an index without dispersion; constant",
    )


def add_settings(group: argparse._ArgumentGroup) -> None:
    """Add which camera and which render settings."""
    group.add_argument("--camera", "-cam", metavar="P", help="path of a camera, or its name")
    group.add_argument(
        "--render-settings", "--renderSettingsPrimPath", "-rs", metavar="P", help="path of a RenderSettings prim"
    )
    group.add_argument(
        "--render-pass",
        "--renderPassPrimPath",
        "-rp",
        metavar="P",
        help="path of a RenderPass prim: its render settings, and what it shows, hides and prunes",
    )


def add_request(parser: argparse.ArgumentParser) -> None:
    """Add what to render."""
    group = parser.add_argument_group("the image (what is not given, the stage's render settings decide)")
    add_settings(group)
    group.add_argument("--product", metavar="P", help="path of the one RenderProduct to render")
    group.add_argument(
        "--width", "--imageWidth", "-w", type=int, metavar="N", help="pixels; alone, it keeps the aspect"
    )
    group.add_argument("--height", type=int, metavar="N", help="pixels; alone, it keeps the aspect")
    group.add_argument(
        "--samples", type=int, metavar="N", help="samples per pixel; the most of them with an error target"
    )
    group.add_argument(
        "--error-target",
        "--error",
        type=float,
        metavar="X",
        help="relative error of a pixel, by its own samples, at which it gets no more of them",
    )
    group.add_argument(
        "--time-limit",
        type=float,
        metavar="S",
        help="seconds per image after which it is finished with the samples that it has",
    )
    group.add_argument(
        "--pixel-filter",
        metavar="NAME",
        help="how light is spread over pixels: box, triangle, gaussian, blackmanHarris",
    )
    group.add_argument("--pixel-filter-width", type=float, metavar="W", help="its full width in pixels")
    group.add_argument(
        "--clamp",
        type=float,
        metavar="X",
        help="the most that a sample of the beauty may have; off unless given, counted and reported",
    )
    group.add_argument(
        "--depth-of-field",
        choices=("on", "off"),
        help="spread samples over the camera's lens, or not; as the stage says unless given",
    )
    group.add_argument(
        "--motion-blur",
        choices=("on", "off"),
        help="spread samples over the time that the shutter is open, or not; as the stage says unless given",
    )
    group.add_argument("--integrator", metavar="NAME", help="what computes a pixel; `abbe aovs` lists them")
    group.add_argument(
        "--aov", action="append", metavar="NAME", help="an AOV to render, instead of the stage's; repeat for more"
    )
    group.add_argument("--wavelength", type=float, metavar="NM", help="reference wavelength; 587.5618 nm")
    group.add_argument(
        "--band",
        type=numbers(float, 2, "LO:HI", ":"),
        metavar="LO:HI",
        help="wavelength band of footprints; 400:700 nm",
    )
    group.add_argument(
        "--dispersion-scale", type=float, metavar="S", help="multiplies all dispersion: 0 none, 1 physical"
    )
    for name, what in (
        ("", "altogether: 0 leaves what shines by itself, 1 direct light"),
        ("-diffuse", "diffusely"),
        ("-reflection", "by reflection at interfaces"),
        ("-transmission", "by transmission at interfaces"),
    ):
        group.add_argument(
            f"--max{name}-depth",
            type=int,
            metavar="N",
            help=f"how often light may be scattered {what}; unlimited unless given",
        )
    group.add_argument("--plate", metavar="FILE", help="image that is seen through glass, behind everything")
    add_scalar_ior(group)
    group.add_argument("--seed", type=int, metavar="N", help="same seed, same bits")
    group.add_argument(
        "--threads", type=int, metavar="N", help="all of the machine's unless given; never changes a bit"
    )
    group.add_argument(
        "--texture-memory",
        type=int,
        metavar="MB",
        help="for texels, 4294 unless given; what does not fit goes to a temporary file; never changes a bit",
    )
    group.add_argument(
        "--crop",
        type=numbers(int, 4, "X0,Y0,X1,Y1"),
        metavar="X0,Y0,X1,Y1",
        help="pixels to render, half-open, y down (--crop=-8,0,… for negative ones)",
    )
    group.add_argument(
        "--sample-range",
        type=numbers(int, 2, "A:B", ":"),
        metavar="A:B",
        help="samples to render, half-open; `abbe merge` joins parts",
    )
    group.add_argument("--strict", action="store_true", help="any warning is an error, and nothing is written")


def request(args: argparse.Namespace, from_stage: bool) -> Options:
    """Return what ``args`` ask the core for; of a stage, the bridge has chosen camera and product already."""
    options = Options(
        width=args.width,
        height=args.height,
        samples=args.samples,
        error_target=args.error_target,
        time_limit=args.time_limit,
        pixel_filter=args.pixel_filter,
        pixel_filter_width=args.pixel_filter_width,
        clamp=args.clamp,
        max_depth=args.max_depth,
        max_diffuse_depth=args.max_diffuse_depth,
        max_reflection_depth=args.max_reflection_depth,
        max_transmission_depth=args.max_transmission_depth,
        plate=args.plate,
        depth_of_field=_switch(args.depth_of_field),
        motion_blur=_switch(args.motion_blur),
        integrator=args.integrator,
        aovs=args.aov,
        wavelength=args.wavelength,
        band=args.band,
        dispersion_scale=args.dispersion_scale,
        seed=args.seed,
        threads=args.threads,
        texture_memory=args.texture_memory,
        crop=args.crop,
        sample_range=args.sample_range,
        strict=args.strict,
    )
    if not from_stage:
        options["camera"] = args.camera
        options["product"] = args.product
    return options


def _switch(text: str | None) -> bool | None:
    return None if text is None else text == "on"


def is_scene_file(args: argparse.Namespace) -> bool:
    """Tell whether the stage is a scene that was exported before."""
    return bool(args.stage.endswith(SCENE_SUFFIX))


def stage_options(args: argparse.Namespace) -> dict[str, Any]:
    """Return how ``args`` want the stage read, as keywords of the listings and of :meth:`abbe.Scene.from_stage`."""
    return {
        "variants": args.variant,
        "overrides": args.overrides,
        "search_paths": args.search_path,
        "session_layer": args.session_layer,
        "mask": args.mask,
        "payloads": args.payloads,
        "frame": frame(args),
    }


def frame(args: argparse.Namespace) -> float | Literal["default"] | None:
    """Return the one time code that ``args`` ask for."""
    if args.default_time and args.frame is not None:
        raise UsageError("--defaultTime: contradicts --frame: give one of them")
    if args.default_time:
        return "default"
    time: float | None = args.frame
    return time


def keep_open(args: argparse.Namespace) -> Any:
    """Return the stage to be opened once for several time codes."""
    from ..usd import keep_open

    return keep_open(args.stage)


def open_scene(args: argparse.Namespace, time: float | Literal["default"] | None, kept: Any = None) -> Scene:
    """Load the stage, or the scene file, at a time code; ``kept`` is the stage kept open for several."""
    messages.show_warnings(getattr(args, "quiet", False))
    if args.render_pass is not None and args.render_settings is not None:
        raise UsageError("--render-pass: it says which settings it renders: leave --render-settings out")
    if not is_scene_file(args):
        try:
            return Scene.from_stage(
                args.stage if kept is None else kept,
                frame=time,
                camera=args.camera,
                render_settings=args.render_settings,
                render_pass=args.render_pass,
                product=args.product,
                purposes=args.purposes,
                variants=args.variant,
                overrides=args.overrides,
                search_paths=args.search_path,
                session_layer=args.session_layer,
                mask=args.mask,
                payloads=args.payloads,
                missing=args.missing,
                motion_blur=_switch(getattr(args, "motion_blur", None)),
                motion_vectors=asks_for_motion(args.aov) if hasattr(args, "aov") else True,
                complexity=args.complexity,
                scalar_ior=args.scalar_ior,
                strict=args.strict,
            )
        except NotUsdError as error:
            raise NotUsdError(f"{error}, or {_SCENE_FILE}") from None
    given = {
        "--frame, --frames, --defaultTime": time is not None,
        "--render-settings": args.render_settings is not None,
        "--render-pass": args.render_pass is not None,
        "--purposes": args.purposes is not None,
        "--variant": bool(args.variant),
        "--set": bool(args.overrides),
        "--search-path": bool(args.search_path),
        "--session-layer": args.session_layer is not None,
        "--mask": bool(args.mask),
        "--payloads": args.payloads != "all",
        "--complexity": args.complexity is not None,
        "--scalar-ior": args.scalar_ior is not None,
    }
    for option, is_given in given.items():
        if is_given:
            raise UsageError(f"{option}: {args.stage} is an exported scene, in which this is settled: export it again")
    return Scene.load(args.stage)
