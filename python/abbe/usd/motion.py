"""Motion about the frame: where things are while a shutter is open, and at the next frame.

Read after everything else, and only if some camera's shutter stays open or somebody asks for vectors of motion.
What does not move is not read again: USD tells of every transform and attribute whether it might vary. Transforms
are USD's own at each time, points and instances those that ``ComputePointsAtTimes`` and
``ComputeInstanceTransformsAtTimes`` give, velocities, accelerations and angular velocities included. Skinning,
radii of solids, topology and visibility are those of the frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from . import tokens
from ._pxr import Tf, Usd, UsdGeom
from .description import Array, Diagnostics
from .geometry import ShapeReader
from .instancers import InstancerReader
from .sampling import Span, refine
from .values import float_array, matrix, place

__all__ = ["MotionReader", "motion_span"]


def motion_span(
    stage: Any,
    time: Any,
    cameras: Sequence[dict[str, Any]],
    settings: dict[str, Any],
    blur: bool | None,
    vectors: bool | None,
) -> Span | None:
    """Return the interval in which motion is to be read; None for none.

    Parameters
    ----------
    time : time code of the frame; nothing moves about default values, and what is read at the earliest time is at 0
    cameras, settings : of the description
    blur : whether shutters count; where products do not disable it if None
    vectors : whether motion to the next frame is asked for; None if the render variables say so
    """
    base = settings.get("base")
    products = settings["products"] or [base or {}]
    marks = {0.0}
    for product in products:
        camera = cameras[product.get("camera", 0)]
        shutter = (camera.get("shutter_open", 0.0), camera.get("shutter_close", 0.0))
        is_wanted = not product.get("disable_motion_blur", False) if blur is None else blur
        if is_wanted and shutter[0] < shutter[1]:
            marks.update(shutter)
    if vectors is None:
        sources = {var["source_name"] for product in products for var in product.get("vars", [])}
        vectors = not sources.isdisjoint(tokens.MOTION_SOURCES)
    if vectors:
        marks.add(1.0)
    if time.IsDefault() or len(marks) == 1:
        return None
    held = stage.GetInterpolationType() == Usd.InterpolationTypeHeld
    frame = 0.0 if time.IsEarliestTime() else float(time.GetValue())
    return Span(frame, tuple(sorted(marks)), held)


class MotionReader:
    """Adds motion to a description that is read."""

    def __init__(self, span: Span, diagnostics: Diagnostics) -> None:
        self._span = span
        self._diagnostics = diagnostics
        self._caches: dict[float, Any] = {}
        # Per prim: the authored samples of its place in the world; None where it does not move.
        self._samples: dict[Any, frozenset[float] | None] = {}

    def transform(self, prim: Any, root: Any = None) -> dict[str, Any] | None:
        """Return the motion of a prim in the world, or in the space of ``root``; None if it does not move."""
        samples = self._moves(prim, root)
        if samples is None:
            return None

        def sample(time: float) -> Array | None:
            return _rows(self._matrix(prim, root, time))

        try:
            refined = refine(self._span.with_samples(sorted(samples)), sample)
        except Tf.ErrorException:
            return None  # named when the frame was read, or unreadable at another time alone
        if refined is None:
            return None
        times, _ = refined
        return {"times": times, "transforms": [matrix(self._matrix(prim, root, time)) for time in times]}

    def points(self, prim: Any, mesh: dict[str, Any], shapes: ShapeReader) -> None:
        """Add the motion of a mesh's points."""
        attribute = prim.GetAttribute(tokens.POINTS)
        velocities = prim.GetAttribute(tokens.VELOCITIES)
        follows_velocities = bool(velocities) and velocities.HasAuthoredValue()
        if not follows_velocities and not attribute.ValueMightBeTimeVarying():
            return
        times = self._span.with_samples(self._authored(attribute))
        accelerations = prim.GetAttribute(tokens.ACCELERATIONS)
        if follows_velocities and accelerations and accelerations.HasAuthoredValue():
            times = _quartered(times)
        at_frame = shapes.arrays[mesh["points"]]
        samples = _all_like(at_frame, (self._points_at(prim, time) for time in times))
        if samples is None:
            return
        # Extrapolated by velocities, the points at the frame may not be those authored before it.
        here = self._points_at(prim, 0.0)
        if here is not None and here.shape == at_frame.shape and not np.array_equal(here, at_frame):
            shapes.arrays[mesh["points"]] = here
        if all(np.array_equal(points, samples[0]) for points in samples):
            # USD holds the points of a mesh that becomes another one.
            counts = {len(attribute.Get(self._span.code(time)) or ()) for time in times}
            if len(counts) > 1 and not follows_velocities:
                self._diagnostics.warn(
                    "motion-of-changing-mesh",
                    place(prim),
                    "its number of points changes without velocities that follow it: it does not deform in the shutter",
                )
            return
        name = mesh["points"]
        motion: dict[str, Any] = {
            "times": times,
            "points": [shapes.add(f"{name}.motion{i}", points) for i, points in enumerate(samples)],
        }
        normals = self._normals(prim, mesh, shapes, times)
        if normals:
            motion["normals"] = normals
        mesh["motion"] = motion

    def _points_at(self, prim: Any, time: float) -> Array | None:
        span = self._span
        try:
            found = UsdGeom.PointBased(prim).ComputePointsAtTimes([span.code(time)], span.code(0.0))
        except Tf.ErrorException:
            return None
        return float_array(found[0], 3)[0] if found else None

    def _normals(self, prim: Any, mesh: dict[str, Any], shapes: ShapeReader, times: list[float]) -> list[str]:
        """Return arrays of normals at ``times``; none where they do not move or change in number."""
        if "normals" not in mesh:
            return []
        primvar, plain = prim.GetAttribute(tokens.PRIMVARS_NORMALS), prim.GetAttribute(tokens.NORMALS)
        attribute = primvar if primvar and primvar.HasAuthoredValue() else plain
        if not attribute or not attribute.ValueMightBeTimeVarying():
            return []
        name = mesh["normals"]["values"]
        values = (float_array(attribute.Get(self._span.code(time)), 3)[0] for time in times)
        found = _all_like(shapes.arrays[name], values)
        return [] if found is None else [shapes.add(f"{name}.motion{i}", normals) for i, normals in enumerate(found)]

    def instances(self, source: Any, instancers: InstancerReader) -> dict[str, dict[str, Any]]:
        """Return the motion of the elements of an instancer, by the name of the array that has their transforms."""
        prim = instancers.prims[source]
        attributes = [prim.GetAttribute(name) for name in tokens.INSTANCE_TRANSFORMS]
        varying = [a for a in attributes if a and a.ValueMightBeTimeVarying()]
        pushed = [prim.GetAttribute(name) for name in tokens.MOTION_NAMES]
        roots = instancers.roots(source)
        swaying = [r for r in map(UsdGeom.Xformable, roots) if r and r.TransformMightBeTimeVarying()]
        if not (varying or swaying or any(a and a.HasAuthoredValue() for a in pushed)):
            return {}
        authored = {t for a in varying for t in self._authored(a)}
        authored.update(t for root in swaying for t in root.GetTimeSamplesInInterval(self._span.interval))
        names = instancers.array_names(source)

        def sample(time: float) -> Array | None:
            span = self._span
            found = instancers.transforms_at(source, span.code(time), span.code(0.0))
            if found is None or [*found] != names:
                return None
            return np.concatenate([found[name] for name in names]).reshape(-1, 4, 3)

        refined = refine(self._span.with_samples(sorted(authored)), sample) if names else None
        if refined is None:
            return {}
        times, values = refined
        sizes = [len(instancers.array(name)) for name in names]
        parts = [np.split(value.reshape(-1, 12), np.cumsum(sizes)[:-1]) for value in values]
        motion: dict[str, dict[str, Any]] = {}
        for i, name in enumerate(names):
            arrays = [np.ascontiguousarray(part[i]) for part in parts]
            added = [instancers.add(f"{name}.motion{k}", array) for k, array in enumerate(arrays)]
            motion[name] = {"times": times, "transforms": added}
        return motion

    def _authored(self, attribute: Any) -> list[float]:
        return list(attribute.GetTimeSamplesInInterval(self._span.interval))

    def _moves(self, prim: Any, root: Any) -> frozenset[float] | None:
        """Return the authored samples of a prim's place, those above it included; None if it is still."""
        if not prim or prim.IsPseudoRoot() or prim == root:
            return None
        key = (prim, root)
        if key in self._samples:
            return self._samples[key]
        xformable = UsdGeom.Xformable(prim)
        above: frozenset[float] | None = None
        own: frozenset[float] | None = None
        resets = False
        if xformable:
            resets = xformable.GetResetXformStack()
            try:
                if xformable.TransformMightBeTimeVarying():
                    own = frozenset(xformable.GetTimeSamplesInInterval(self._span.interval))
            except Tf.ErrorException:
                own = None
        if not resets:
            above = self._moves(prim.GetParent(), root)
        samples = above if own is None else own if above is None else own | above
        self._samples[key] = samples
        return samples

    def _matrix(self, prim: Any, root: Any, time: float) -> Any:
        cache = self._caches.get(time)
        if cache is None:
            cache = self._caches[time] = UsdGeom.XformCache(self._span.code(time))
        if root is None:
            return cache.GetLocalToWorldTransform(prim)
        return cache.ComputeRelativeTransform(prim, root)[0]


def _all_like(like: Array, found: Iterable[Array | None]) -> list[Array] | None:
    """Return the arrays that were found; None if one is missing or of another shape than ``like``."""
    arrays = []
    for array in found:
        if array is None or array.shape != like.shape:
            return None
        arrays.append(array)
    return arrays


def _rows(value: Any) -> Array:
    return np.asarray(value)[None, :, :3]


def _quartered(times: Iterable[float]) -> list[float]:
    """Return the times with three more between any two: what accelerates runs along a parabola."""
    known = list(times)
    between = [a + s * (b - a) for a, b in pairwise(known) for s in (0.25, 0.5, 0.75)]
    return sorted([*known, *between])
