"""Cameras: found by name or path, read as authored, or framed where a stage has none."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import StageError
from . import tokens
from ._pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils
from .values import is_finite, matrix, place, read

__all__ = ["all_cameras", "default_camera", "find_camera", "framed_camera", "read_camera"]

# How many cameras an error names before it stops.
_LISTED = 8

# The camera that usdrecord frames with: GfCamera's defaults, in tenths of a stage unit.
_HORIZONTAL_APERTURE = 20.955
_VERTICAL_APERTURE = 15.2908
_FOCAL_LENGTH = 50.0
# A box lower than this part of its depth is seen too nearly edge on to show what lies on it.
_FLAT = 0.2


def all_cameras(stage: Any) -> list[Any]:
    """Return every Camera prim in the order of traversal, those inside native instances included."""
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in prims if prim.IsA(UsdGeom.Camera)]


def find_camera(stage: Any, wanted: str, source: str) -> Any:
    """Return the Camera prim that ``wanted`` names: a path, or the name of the first such prim.

    Raises
    ------
    StageError
        There is none; the message lists what there is.
    """
    if Sdf.Path.IsValidPathString(wanted):
        path = Sdf.Path(wanted)
        if path.IsAbsolutePath() or path.pathElementCount > 1:
            prim = stage.GetPrimAtPath(path.MakeAbsolutePath(Sdf.Path.absoluteRootPath))
            if prim and prim.IsA(UsdGeom.Camera):
                return prim
            if prim:
                what = prim.GetTypeName() or "prim without a type"
                raise StageError(f"{place(prim)}: is a {what}, not a Camera: {_remedy(stage)}")
        else:
            for prim in all_cameras(stage):
                if prim.GetName() == wanted:
                    return prim
    raise StageError(f"{source}: has no camera '{wanted}': {_remedy(stage)}")


def _remedy(stage: Any) -> str:
    paths = [str(prim.GetPath()) for prim in all_cameras(stage)]
    if not paths:
        return "the stage has no camera at all; leave the camera out to have the scene framed"
    more = f" and {len(paths) - _LISTED} more" if len(paths) > _LISTED else ""
    return f"choose one of {', '.join(paths[:_LISTED])}{more}"


def read_camera(prim: Any, time: Any, transforms: Any) -> dict[str, Any]:
    """Return a Camera prim as the description has it."""
    camera = UsdGeom.Camera(prim)

    def number(attribute: Any, fallback: float) -> float:
        value = read(prim, attribute.GetName(), time)
        if value is None:
            return fallback
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise StageError(f"{place(prim)}.{attribute.GetName()} = {value}: is no finite number: give it one")
        return float(value)

    transform = matrix(transforms.GetLocalToWorldTransform(prim))
    if not is_finite(transform):
        raise StageError(f"{place(prim)}: its transform is not finite: correct its xformOps and those of its parents")
    result: dict[str, Any] = {
        "path": str(prim.GetPath()),
        "transform": transform,
        "projection": str(read(prim, camera.GetProjectionAttr().GetName(), time) or tokens.PERSPECTIVE),
        "horizontal_aperture": number(camera.GetHorizontalApertureAttr(), _HORIZONTAL_APERTURE),
        "vertical_aperture": number(camera.GetVerticalApertureAttr(), _VERTICAL_APERTURE),
        "horizontal_aperture_offset": number(camera.GetHorizontalApertureOffsetAttr(), 0.0),
        "vertical_aperture_offset": number(camera.GetVerticalApertureOffsetAttr(), 0.0),
        "focal_length": number(camera.GetFocalLengthAttr(), _FOCAL_LENGTH),
        "f_stop": number(camera.GetFStopAttr(), 0.0),
        "focus_distance": number(camera.GetFocusDistanceAttr(), 0.0),
        "shutter_open": number(camera.GetShutterOpenAttr(), 0.0),
        "shutter_close": number(camera.GetShutterCloseAttr(), 0.0),
    }
    clipping = read(prim, camera.GetClippingRangeAttr().GetName(), time)
    if clipping is not None:
        numbers = np.asarray(clipping)
        if (
            numbers.shape != (2,)
            or numbers.dtype.kind not in "fiu"
            or not np.isfinite(numbers[0])
            or not numbers[1] > -np.inf
        ):
            name = camera.GetClippingRangeAttr().GetName()
            raise StageError(f"{place(prim)}.{name} = {clipping}: is no range: give it a near and a far distance")
        # An infinite far plane is as good as the farthest that the attribute can hold.
        result["clipping_range"] = [float(numbers[0]), min(float(numbers[1]), _FARTHEST)]
        result["clipping_authored"] = bool(camera.GetClippingRangeAttr().HasAuthoredValue())
    planes = _clipping_planes(prim, camera, time)
    if planes:
        result["clipping_planes"] = planes
    exposure = _exposure(prim, number)
    if exposure:
        result["exposure"] = exposure
    return result


def _clipping_planes(prim: Any, camera: Any, time: Any) -> list[list[float]]:
    """Return the planes (a, b, c, d) that cut off what has a x + b y + c z + d < 0 in camera space."""
    name = camera.GetClippingPlanesAttr().GetName()
    value = read(prim, name, time)
    planes = np.asarray([] if value is None else value, dtype=np.float64)
    if planes.size == 0:
        return []
    if planes.ndim != 2 or planes.shape[1] != 4 or not np.isfinite(planes).all():
        raise StageError(f"{place(prim)}.{name}: are no planes of four finite numbers: correct the value")
    result: list[list[float]] = planes.tolist()
    return result


def _exposure(prim: Any, number: Callable[[Any, float], float]) -> dict[str, float]:
    """Return what is authored of a camera's exposure."""
    attributes = ((name, prim.GetAttribute(attribute)) for attribute, name in tokens.EXPOSURE.items())
    return {name: number(a, 0.0) for name, a in attributes if a and a.HasAuthoredValue()}


# The largest float32, which is what UsdGeomCamera's clippingRange can hold.
_FARTHEST = 3.4028234663852886e38


def default_camera(stage: Any, settings: Any, cameras: list[Any]) -> Any:
    """Return the settings' camera, else the primary one by USD's convention, else the first; None if there is none."""
    if settings is not None:
        relationship = settings.GetRelationship(tokens.CAMERA)
        targets = relationship.GetForwardedTargets() if relationship else []
        if relationship and relationship.GetTargets() and not targets:
            raise StageError(f"{place(relationship)}: leads back to itself: name a Camera")
        for path in targets:
            prim = stage.GetPrimAtPath(path)
            if prim and prim.IsA(UsdGeom.Camera):
                return prim
    primary = UsdUtils.GetPrimaryCameraName()
    named = (prim for prim in cameras if prim.GetName() == primary)
    return next(named, cameras[0] if cameras else None)


def framed_camera(low: Any, high: Any, up_axis: str) -> dict[str, Any]:
    """Return a camera that sees the box from ``low`` to ``high`` as usdrecord's default one does.

    It looks along −z (along +y on a stage that is Z-up) from where the front face of the box fills the width of a 50 mm
    lens (usdAppUtils/frameRecorder.cpp). Near and far planes enclose the box with room. Where that would show a flat
    box edge on (a floor, a grid), it looks down at 45° instead, from where the whole box is in view.
    """
    low, high = Gf.Vec3d(*low), Gf.Vec3d(*high)
    centre, size = (low + high) / 2.0, high - low
    z_up = up_axis == "Z"
    across, height, deep = (size[0], size[2], size[1]) if z_up else (size[0], size[1], size[2])
    pitch = 90.0 if z_up else 0.0
    if height < _FLAT * deep:
        pitch -= 45.0
        deep = math.hypot(across, height, deep)
        distance = deep / 2.0 / (_VERTICAL_APERTURE / 2.0 / _FOCAL_LENGTH) + deep / 2.0
    else:
        radius = math.hypot(across, height) / 2.0
        if radius == 0.0:
            # A point or a line of sight: any distance frames it.
            radius = max(deep, 1.0) / 2.0
        distance = radius / (_HORIZONTAL_APERTURE / 2.0 / _FOCAL_LENGTH) + deep / 2.0
    transform = Gf.Matrix4d(1.0).SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), pitch))
    transform.SetTranslateOnly(centre + transform.TransformDir(Gf.Vec3d(0, 0, distance)))
    return {
        "path": "",
        "transform": matrix(transform),
        "projection": tokens.PERSPECTIVE,
        "horizontal_aperture": _HORIZONTAL_APERTURE,
        "vertical_aperture": _VERTICAL_APERTURE,
        "focal_length": _FOCAL_LENGTH,
        "clipping_range": [(distance - deep / 2.0) / 100.0, (distance + deep) * 10.0],
        "focus_distance": distance,
    }
