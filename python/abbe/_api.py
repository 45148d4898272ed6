"""Scenes and renders: the Python face of the core, with options as keywords and films as arrays."""

from __future__ import annotations

import json
import logging
import os
import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypedDict, Unpack

from . import _core
from .errors import UsageError

__all__ = [
    "Options",
    "Plan",
    "Progress",
    "Scene",
    "asks_for_motion",
    "counted",
    "integrators",
    "merge",
    "progressive",
    "render",
    "warning_text",
]

_log = logging.getLogger("abbe")


class Progress(NamedTuple):
    """How far a render is."""

    done: int
    """Finished pixels."""
    total: int
    """All pixels."""
    seconds: float
    """Wall time since the render began."""

    @property
    def fraction(self) -> float:
        """The finished part, 0 to 1."""
        return self.done / self.total if self.total else 1.0

    @property
    def remaining(self) -> float | None:
        """Seconds left at the rate so far; None before there is a rate."""
        return self.seconds * (self.total - self.done) / self.done if self.done else None

    def __str__(self) -> str:
        left = "" if self.remaining is None else f", {self.remaining:.0f} s left"
        return f"{100 * self.fraction:.0f} %{left}"


class Options(TypedDict, total=False):
    """What a render can be asked for; :func:`render` tells what each means. What is left out, the stage decides."""

    camera: str | None
    product: str | None
    width: int | None
    height: int | None
    samples: int | None
    error_target: float | None
    time_limit: float | None
    clamp: float | None
    pixel_filter: str | None
    pixel_filter_width: float | None
    depth_of_field: bool | None
    integrator: str | None
    aovs: Sequence[str] | None
    wavelength: float | None
    band: tuple[float, float] | None
    dispersion_scale: float | None
    max_depth: int | None
    max_diffuse_depth: int | None
    max_reflection_depth: int | None
    max_transmission_depth: int | None
    plate: str | None
    motion_blur: bool | None
    seed: int | None
    threads: int | None
    texture_memory: int | None
    crop: tuple[int, int, int, int] | None
    sample_range: tuple[int, int] | None
    strict: bool


@dataclass(frozen=True)
class Plan:
    """What a render will carry and compute, and why; ``str(plan)`` is readable."""

    text: str
    fields: Mapping[str, Any]
    """All of it as plain values: ``product``, ``output``, ``resolution``, ``layers``, ``carried``, ``skipped`` …"""

    @property
    def product(self) -> str:
        """Path of the RenderProduct; empty if the stage has none."""
        return str(self.fields["product"])

    @property
    def output(self) -> str:
        """File that the product names; empty if it names none."""
        return str(self.fields["output"])

    def __str__(self) -> str:
        return self.text


def _request(options: Options) -> str:
    """Return ``options`` as the core's JSON; numbers of NumPy are numbers."""
    given = {name: value for name, value in options.items() if value is not None}
    if isinstance(given.get("aovs"), str):
        raise UsageError(f"aovs: is the text '{given['aovs']}', a list is wanted: put brackets around it")

    def plain(value: Any) -> Any:
        for method in ("tolist", "__fspath__"):
            if hasattr(value, method):
                return getattr(value, method)()
        raise TypeError(f"is a {type(value).__name__}")

    texts = []
    for name, value in given.items():
        try:
            texts.append(f"{json.dumps(name)}:{json.dumps(value, allow_nan=False, default=plain)}")
        except (TypeError, ValueError) as error:
            raise UsageError(f"{name}: {error}: give plain finite numbers, text or lists of them") from None
    return "{" + ",".join(texts) + "}"


def asks_for_motion(aovs: Sequence[str] | None) -> bool | None:
    """Tell whether some of ``aovs`` are vectors of motion; None, for the stage to decide, if there are none."""
    from .usd.tokens import MOTION_SOURCES

    return None if aovs is None else not {*aovs}.isdisjoint(MOTION_SOURCES)


def counted(count: int, what: str) -> str:
    """Return ``1 camera``, ``2 cameras``."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def warning_text(warning: Mapping[str, Any]) -> str:
    """Return a warning record on one line: ``</World/Glass> and 3 more: the mesh is open …``."""
    place = warning["places"][0] if warning["places"] else ""
    more = f" and {warning['count'] - 1} more" if warning["count"] > 1 else ""
    return f"{place}{more}: {warning['message']}"


# Messages of one kind that are logged one by one; a production stage may have hundreds.
_SHOWN = 3


def warning_lines(warnings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return warning records as lines for people: of each kind the first few messages, and how many there are more.

    Parameters
    ----------
    warnings : records as in ``Scene.warnings``, where all of them stand

    Returns
    -------
    list of str
        By kind, in the order of first occurrence.
    """
    lines: list[str] = []
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for warning in warnings:
        kinds.setdefault(warning["kind"], []).append(warning)
    for kind, records in kinds.items():
        # One more line costs no more than the one that says so.
        shown = records if len(records) <= _SHOWN + 1 else records[:_SHOWN]
        lines += map(warning_text, shown)
        others = records[len(shown) :]
        if others:
            places = sum(record["count"] for record in others)
            first = others[0]["places"][0] if others[0]["places"] else ""
            lines.append(
                f"{first} and {places - 1} more: other warnings of the kind {kind}, {len(others)} in all: "
                "--stats FILE.json and Scene.warnings have them"
            )
    return lines


class Scene:
    """A checked scene: loaded once, rendered often, from several threads if wanted. Nothing changes it."""

    def __init__(self, core: _core.Scene) -> None:
        self._core = core
        self._told: list[dict[str, Any]] = core.warnings()
        for line in warning_lines(self._told):
            _log.warning("%s", line)

    @classmethod
    def from_stage(
        cls,
        stage: Any,
        *,
        frame: float | Literal["default"] | None = None,
        camera: str | None = None,
        render_settings: str | None = None,
        render_pass: str | None = None,
        product: str | None = None,
        purposes: Sequence[str] | None = None,
        variants: Sequence[str] = (),
        overrides: Mapping[str, Any] | Sequence[str] = (),
        search_paths: Sequence[str | os.PathLike[str]] = (),
        session_layer: str | os.PathLike[str] | None = None,
        mask: Sequence[str] = (),
        payloads: str = "all",
        missing: str = "warn",
        motion_blur: bool | None = None,
        motion_vectors: bool | None = None,
        complexity: str | None = None,
        scalar_ior: str | None = None,
        strict: bool = False,
    ) -> Scene:
        """Load a USD stage.

        Parameters
        ----------
        stage : path of a .usd, .usda, .usdc or .usdz file, or a ``pxr.Usd.Stage``, which is not changed
        frame : time code; the stage's start if None; ``"default"`` reads default values instead of time samples
        camera : path of a Camera, or the name of the first such; it then replaces the cameras that products name
        render_settings : path of a RenderSettings prim; the stage's own if None
        render_pass : path of a RenderPass prim: its settings, and what it shows, hides and prunes
        product : path or name of the one RenderProduct to keep
        purposes : of default, render, proxy, guide; the settings', else default and render, if None
        variants : selections such as ``"/World/Ball{material=glass}"``
        overrides : values such as ``"/World/Glass.inputs:ior=1.6"``, or a mapping from attribute path to value
        search_paths : folders in which relative asset paths are looked up after the stage's own
        session_layer : a layer stronger than all of the stage, which is not changed
        mask : paths of the prims to load, with what they are bound to, connected to or show; everything if empty
        payloads : ``"all"`` or ``"none"``; a stage in memory keeps its own rules unless none are wanted
        missing : what to do where a layer, prim or texture that is referred to is missing: ``"warn"`` or ``"error"``
        motion_blur : whether to read motion while shutters are open; as the stage's products say if None
        motion_vectors : read motion up to the next frame; where the RenderVars ask for it if None
        complexity : ``"low"``, ``"medium"``, ``"high"``, ``"veryhigh"``: subdivision surfaces are divided 0 to 3 times;
            ``abbe:subdivision:level`` of a mesh counts first; by its size if None, 2 for most
        scalar_ior : of an index without dispersion: ``"constant"`` or ``"nearest-glass"``; the settings' if None
        strict : a stage without a camera is an error

        Returns
        -------
        Scene
            Holds USD's own arrays where they need no conversion.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        StageError
            The stage cannot be used; the message begins with the prim path.
        UsdMissingError
            No ``pxr`` can be imported.
        """
        from .usd import describe

        description = describe(
            stage,
            frame=frame,
            camera=camera,
            render_settings=render_settings,
            render_pass=render_pass,
            product=product,
            purposes=purposes,
            variants=variants,
            overrides=overrides,
            search_paths=search_paths,
            session_layer=session_layer,
            mask=mask,
            payloads=payloads,
            missing=missing,
            motion_blur=motion_blur,
            motion_vectors=motion_vectors,
            complexity=complexity,
            scalar_ior=scalar_ior,
            strict=strict,
        )
        return cls(_core.Scene(description.to_json(), description.arrays))

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, mapped: bool = False) -> Scene:
        """Load a scene file that :meth:`save` or ``abbe export`` wrote; USD is not needed.

        Parameters
        ----------
        path : a .safetensors file
        mapped : map the file into memory instead of reading it; it must then not change while the scene is in use

        Returns
        -------
        Scene
            Renders to the same bits as the scene that was saved.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        AbbeError
            The file is not a scene, or its content cannot be used.
        """
        return cls(_core.Scene.load(Path(path), mapped=mapped))

    def save(self, path: str | os.PathLike[str], *, embed: bool = False) -> None:
        """Write the scene to a file for :meth:`load` and the program ``abbe-render``.

        Parameters
        ----------
        path : where to; complete or not at all
        embed : put what is in the image files into it; else it names them by their absolute paths

        Raises
        ------
        AbbeError
            It cannot be written.
        """
        self._core.save(Path(path), embed=embed)

    def __repr__(self) -> str:
        document = self.document
        parts = [
            counted(len(document["cameras"]), "camera"),
            counted(len(document["shapes"]), "shape"),
            counted(len(document["materials"]), "material"),
        ]
        if (time_code := document["stage"].get("time_code")) is not None:
            parts.append(f"frame {time_code:g}")
        if self._told:
            parts.append(counted(len(self._told), "warning"))
        return f"<abbe.Scene of {Path(document['stage']['source']).name}: {', '.join(parts)}>"

    @property
    def document(self) -> dict[str, Any]:
        """The scene description without its arrays, as plain values (a copy)."""
        document: dict[str, Any] = json.loads(self._core.document())
        return document

    @property
    def cameras(self) -> list[str]:
        """Paths of the cameras in the scene, the default first; empty text for one framed automatically."""
        return [camera["path"] for camera in self.document["cameras"]]

    @property
    def warnings(self) -> list[dict[str, Any]]:
        """What was odd about the stage: dicts with ``kind``, ``message``, ``places`` and ``count``."""
        return self._core.warnings()

    def plans(self, **options: Unpack[Options]) -> list[Plan]:
        """Tell what would be rendered, without rendering.

        Parameters
        ----------
        options : as for :func:`render`

        Returns
        -------
        list of Plan
            One for each product of the stage that is asked for; one if the stage has none.

        Raises
        ------
        UsageError
            An option contradicts the scene or another option.
        """
        return [Plan(text, json.loads(fields)) for text, fields in self._core.plan(_request(options))]

    def lights(self) -> list[dict[str, Any]]:
        """Tell what shines: every light as an integrator that uses lights has it.

        Files of lights are read for it; what is odd about them is logged as a warning.

        Returns
        -------
        list of dict
            ``path``, ``kind``, ``position`` and ``direction`` in the stage's world, ``area``, ``emission`` (linear
            Rec. 709 by luminance), ``spectrum``, ``power``, ``shaped``, ``texture``, ``group``, and the collections
            ``illuminates`` and ``shadowed_by``; None for what a light does not have or restrict.

        Raises
        ------
        AbbeError
            A file of a light cannot be read and missing files are errors.
        """
        lights, warnings = self._core.lights()
        for warning in warnings:
            _log.warning("%s", warning_text(warning))
        return lights

    def trace(self, pixel: tuple[int, int], sample: int = 0, **options: Unpack[Options]) -> dict[str, Any]:
        """Follow one sample and tell every event of its chain.

        Parameters
        ----------
        pixel : x to the right, y down, (0, 0) the top left
        sample : index of the sample in the pixel
        options : as for :func:`render`; of several products the first counts

        Returns
        -------
        dict
            ``events``, each with ``event``, ``position``, ``normal``, ``ior``, ``columns`` …, and how the chain ends.

        Raises
        ------
        UsageError
            There is no such sample, or an option contradicts the scene.
        """
        return self._core.trace(_request(options), 0, pixel, sample)

    def compare(self, *, rounds: int = 5, **options: Unpack[Options]) -> dict[str, Any]:
        """Measure ways to get a derivative AOV against each other on this scene's own chains.

        Parameters
        ----------
        rounds : how often each is timed; ratios are medians over the rounds
        options : as for :func:`render`; of several products the first counts

        Returns
        -------
        dict
            ``costs`` of the columns (Mray/s, one thread), ``methods`` with time (ns per chain) and relative error of
            ∂p/∂λ, ``predictions`` of where the ray at λ + δ lands, ``reference_error``, ``chains``.

        Raises
        ------
        AbbeError
            No pixel sees a surface through dispersive glass.
        """
        return self._core.compare(_request(options), 0, rounds)

    def render(self, *, progress: Callable[[Progress], object] | None = None, **options: Unpack[Options]) -> _core.Film:
        """Render one image.

        Parameters
        ----------
        progress : called about ten times a second; an exception it raises stops the render
        options : as for :func:`render`

        Returns
        -------
        Film
            As of :func:`render`.

        Raises
        ------
        UsageError
            An option contradicts the scene or another option, or the stage has several products and none is chosen.
        KeyboardInterrupt
            Ctrl-C; the finished part is the exception's attribute ``film``, and its statistics say ``complete: False``.
        """
        self._need_one_plan(options)
        return self.render_plan(0, progress=progress, **options)

    def _need_one_plan(self, options: Options) -> None:
        plans = self.plans(**options)
        if len(plans) > 1:
            names = ", ".join(plan.product for plan in plans)
            raise UsageError(f"product: the stage has {len(plans)}: choose one of {names}")

    def progressive(self, **options: Unpack[Options]) -> Iterator[_core.Film]:
        """Render one image in growing numbers of samples: 1, 2, 4, 8 … of each pixel.

        Each film is, to the bit, what the first so many samples of the render give; the last is what :meth:`render`
        returns. Rendering goes on in a thread of its own only while the next film is waited for.

        Parameters
        ----------
        options : as for :func:`render`; ``samples`` is where it ends

        Yields
        ------
        Film
            ``film.samples`` tells how many samples it has.

        Raises
        ------
        UsageError
            As :meth:`render`, at once.
        KeyboardInterrupt
            Ctrl-C; the films so far are complete in themselves.
        """
        self._need_one_plan(options)
        return self._films(options)

    def _films(self, options: Options) -> Iterator[_core.Film]:
        # Films come from the rendering thread; it goes on when told to.
        films: queue.SimpleQueue[_core.Film | BaseException | None] = queue.SimpleQueue()
        go_on: queue.SimpleQueue[bool] = queue.SimpleQueue()
        stopped = threading.Event()

        def passed(film: _core.Film) -> None:
            films.put(film)
            if not go_on.get():
                raise _Stopped

        def watch(done: int, total: int) -> None:
            if stopped.is_set():
                raise _Stopped

        def work() -> None:
            try:
                self._tell(self._core.render(_request(options), 0, watch, passed))
                films.put(None)
            except _Stopped:
                films.put(None)
            except BaseException as error:
                films.put(error)

        thread = threading.Thread(target=work, name="abbe.progressive", daemon=True)
        thread.start()
        try:
            while (film := films.get()) is not None:
                if isinstance(film, BaseException):
                    raise film
                yield film
                go_on.put(True)
        finally:
            stopped.set()
            go_on.put(False)
            thread.join()

    def _tell(self, film: _core.Film) -> _core.Film:
        for line in warning_lines([w for w in film.statistics["warnings"] if w not in self._told]):
            _log.warning("%s", line)
        return film

    def render_plan(
        self,
        index: int,
        *,
        progress: Callable[[Progress], object] | None = None,
        passed: Callable[[_core.Film], object] | None = None,
        **options: Unpack[Options],
    ) -> _core.Film:
        """Render the image of ``plans(**options)[index]``; else as :meth:`render`.

        Parameters
        ----------
        index : which of the plans
        progress, options : as for :meth:`render`
        passed : called with the film of 1, 2, 4, 8 … samples and of all, while the render waits; changes no bit

        Returns
        -------
        Film
            As of :func:`render`.

        Raises
        ------
        UsageError
            There is no such plan.
        """
        begin = time.monotonic()

        def report(done: int, total: int) -> None:
            if progress is not None:
                progress(Progress(done, total, time.monotonic() - begin))

        return self._tell(self._core.render(_request(options), index, report if progress is not None else None, passed))


class _Stopped(Exception):
    """Nobody waits for more films."""


def render(
    stage: Any,
    *,
    frame: float | Literal["default"] | None = None,
    camera: str | None = None,
    render_settings: str | None = None,
    render_pass: str | None = None,
    product: str | None = None,
    width: int | None = None,
    height: int | None = None,
    samples: int | None = None,
    error_target: float | None = None,
    time_limit: float | None = None,
    clamp: float | None = None,
    pixel_filter: str | None = None,
    pixel_filter_width: float | None = None,
    depth_of_field: bool | None = None,
    integrator: str | None = None,
    aovs: Sequence[str] | None = None,
    wavelength: float | None = None,
    band: tuple[float, float] | None = None,
    dispersion_scale: float | None = None,
    max_depth: int | None = None,
    max_diffuse_depth: int | None = None,
    max_reflection_depth: int | None = None,
    max_transmission_depth: int | None = None,
    plate: str | os.PathLike[str] | None = None,
    motion_blur: bool | None = None,
    seed: int | None = None,
    threads: int | None = None,
    texture_memory: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    sample_range: tuple[int, int] | None = None,
    purposes: Sequence[str] | None = None,
    variants: Sequence[str] = (),
    overrides: Mapping[str, Any] | Sequence[str] = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
    missing: str = "warn",
    complexity: str | None = None,
    scalar_ior: str | None = None,
    strict: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> _core.Film:
    """Render a USD stage.

    What is left at None, the stage's render settings decide. Warnings go to the logger ``abbe`` and stand in the film's
    statistics.

    Parameters
    ----------
    stage : path of a .usd, .usda, .usdc or .usdz file, or a ``pxr.Usd.Stage``, which is not changed
    frame : time code; the stage's start if None; ``"default"`` reads default values instead of time samples
    camera : path of a Camera, or the name of the first such
    render_settings : path of a RenderSettings prim
    render_pass : path of a RenderPass prim: its settings, and what it shows, hides and prunes
    product : path of a RenderProduct; needed where the stage has several
    width, height : pixels, >= 1; one alone keeps the aspect
    samples : samples per pixel, >= 1; with an error target the most of them
    error_target : relative error of a pixel, as its own samples tell it, at which it gets no more of them
    time_limit : seconds after which the image is finished with the samples that it has
    clamp : the most that a sample of the beauty may have in R, G, B; counted in the statistics and the header
    pixel_filter : how light is spread over pixels: box, triangle, gaussian, blackmanHarris
    pixel_filter_width : its full width in pixels
    depth_of_field : spread samples over the camera's lens; as the stage says if None
    integrator : a name of :func:`integrators`
    aovs : names of AOVs or aliases of them (``abbe aovs`` lists them); the stage's RenderVars if None
    wavelength : reference wavelength, nm
    band : ends of the wavelength band of footprints, nm
    dispersion_scale : multiplies all dispersion: 0 none, 1 physical
    max_depth, max_diffuse_depth, max_reflection_depth, max_transmission_depth : how often light may be scattered,
        altogether (0 leaves what shines by itself, 1 direct light) or in one way; unlimited if None
    plate : image file that is seen through glass, behind everything
    motion_blur : whether samples are spread over the time that the shutter is open
    seed : same seed, same bits, on any number of threads
    threads : all of the machine's if None
    texture_memory : for the texels of images, MB, 4294 if None; what does not fit goes to a temporary file
    crop : x0, y0, x1, y1 in pixels, half-open, y down
    sample_range : begin and end, half-open: a part that :func:`merge` joins with others
    purposes, variants, overrides, search_paths, session_layer, mask, payloads, missing, complexity, scalar_ior : as for
        :meth:`Scene.from_stage`
    strict : any warning, of the stage or the request, is an error
    progress : called about ten times a second; ``print`` will do

    Returns
    -------
    Film
        ``film["dispersion"]`` is float32 with shape (height, width, 2), identifiers are uint32; top row first,
        read-only, no copy. ``film.valid(name)`` tells where there is a value, ``film.write("out.exr")`` writes it all.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The stage cannot be read or used; the message begins with the prim path.
    UsageError
        An argument is not understood or contradicts the stage.
    KeyboardInterrupt
        Ctrl-C; the finished part is the exception's attribute ``film``.
    """
    scene = Scene.from_stage(
        stage,
        frame=frame,
        camera=camera,
        render_settings=render_settings,
        render_pass=render_pass,
        product=product,
        purposes=purposes,
        variants=variants,
        overrides=overrides,
        search_paths=search_paths,
        session_layer=session_layer,
        mask=mask,
        payloads=payloads,
        missing=missing,
        motion_blur=motion_blur,
        motion_vectors=asks_for_motion(aovs),
        complexity=complexity,
        scalar_ior=scalar_ior,
        strict=strict,
    )
    # The bridge has chosen camera and product already.
    return scene.render(
        progress=progress,
        width=width,
        height=height,
        samples=samples,
        error_target=error_target,
        time_limit=time_limit,
        clamp=clamp,
        pixel_filter=pixel_filter,
        pixel_filter_width=pixel_filter_width,
        depth_of_field=depth_of_field,
        integrator=integrator,
        aovs=aovs,
        wavelength=wavelength,
        band=band,
        dispersion_scale=dispersion_scale,
        max_depth=max_depth,
        max_diffuse_depth=max_diffuse_depth,
        max_reflection_depth=max_reflection_depth,
        max_transmission_depth=max_transmission_depth,
        plate=None if plate is None else str(plate),
        motion_blur=motion_blur,
        seed=seed,
        threads=threads,
        texture_memory=texture_memory,
        crop=crop,
        sample_range=sample_range,
        strict=strict,
    )


_OF_REQUESTS = frozenset(Options.__annotations__)
# What the bridge settles when the stage is loaded.
_OF_STAGES = frozenset({"camera", "product"})


def progressive(stage: Any, **options: Any) -> Iterator[_core.Film]:
    """Render a USD stage in growing numbers of samples; as :meth:`Scene.progressive`.

    >>> for film in abbe.progressive("prism.usda", samples=1024, aovs=["color"]):
    ...     show(film["color"])

    Parameters
    ----------
    stage : path of a .usd, .usda, .usdc or .usdz file, or a ``pxr.Usd.Stage``, which is not changed
    options : as for :func:`render`

    Yields
    ------
    Film
        With 1, 2, 4, 8 … samples, and at last all of them.

    Raises
    ------
    StageError, UsageError, KeyboardInterrupt
        As :func:`render`.
    """
    of_request = {name: options.pop(name) for name in list(options) if name in _OF_REQUESTS - _OF_STAGES}
    if "strict" in of_request:
        options["strict"] = of_request["strict"]
    scene = Scene.from_stage(stage, motion_vectors=asks_for_motion(of_request.get("aovs")), **options)
    return scene.progressive(**of_request)


def merge(inputs: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]) -> None:
    """Join crops and aligned sample ranges of one render into one EXR file.

    Parameters
    ----------
    inputs : EXR files that abbe wrote, in any order
    out : where to write; complete or not at all

    Raises
    ------
    AbbeError
        The files are not parts of one render, or cannot be read or written.
    """
    _core.merge([Path(path) for path in inputs], Path(out))


def integrators() -> list[dict[str, Any]]:
    """Return the integrators that can be chosen.

    Returns
    -------
    list of dict
        Each with ``name``, ``summary`` and the names of the ``aovs`` that it offers.
    """
    return _core.integrators()
