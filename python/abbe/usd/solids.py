"""Implicit solids: from prims to analytic shapes of the description.

UsdGeom gives them a size and an axis, and they are about the origin. What sizes are allowed is decided by the core;
here they are finite numbers.
"""

from __future__ import annotations

import math
from typing import Any

from . import tokens
from ._pxr import UsdGeom
from .description import BrokenError
from .values import place, read

__all__ = ["read_solid", "solid_bounds", "solid_kind"]

_SCHEMAS = {
    "Cube": "cube",
    "Plane": "plane",
    "Cylinder": "cylinder",
    "Cylinder_1": "cylinder",
    "Cone": "cone",
    "Capsule": "capsule",
    "Capsule_1": "capsule",
}
"""Shapes of the description by schema; older versions of USD lack some."""

_SIZES = {
    "Cube": {"size": tokens.SIZE},
    "Plane": {"width": tokens.WIDTH, "length": tokens.LENGTH},
    "Cylinder": {"height": tokens.HEIGHT, "radius_bottom": tokens.RADIUS, "radius_top": tokens.RADIUS},
    "Cylinder_1": {"height": tokens.HEIGHT, "radius_bottom": tokens.RADIUS_BOTTOM, "radius_top": tokens.RADIUS_TOP},
    "Cone": {"height": tokens.HEIGHT, "radius": tokens.RADIUS},
    "Capsule": {"height": tokens.HEIGHT, "radius_bottom": tokens.RADIUS, "radius_top": tokens.RADIUS},
    "Capsule_1": {"height": tokens.HEIGHT, "radius_bottom": tokens.RADIUS_BOTTOM, "radius_top": tokens.RADIUS_TOP},
}


def solid_kind(prim: Any) -> str | None:
    """Return the name of the schema of a solid; None for other prims."""
    for name in _SCHEMAS:
        schema = getattr(UsdGeom, name, None)
        if schema is not None and prim.IsA(schema):
            return name
    return None


def read_solid(prim: Any, time: Any) -> dict[str, Any]:
    """Return the shape of a solid.

    Raises
    ------
    BrokenError
        A size is no finite number, or the axis is none of X, Y and Z.
    """
    name = solid_kind(prim)
    assert name is not None
    shape: dict[str, Any] = {"path": str(prim.GetPath())}
    for key, attribute in _SIZES[name].items():
        shape[key] = _number(prim, attribute, time)
    if name != "Cube":
        axis = str(read(prim, tokens.AXIS, time))
        if axis not in tokens.AXES:
            raise BrokenError(f"{place(prim)}.{tokens.AXIS}", f"is {axis}, which is no axis: X, Y or Z")
        shape["axis"] = axis
    return {_SCHEMAS[name]: shape}


def _number(prim: Any, name: str, time: Any) -> float:
    value = read(prim, name, time)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise BrokenError(f"{place(prim)}.{name}", f"is {value}, which is no finite number")
    return float(value)


def solid_bounds(shape: dict[str, Any]) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
    """Return the corners of a solid's box in object space, as UsdGeom computes its extent; None for other shapes."""
    ((kind, values),) = shape.items()
    if kind == "cube":
        half = abs(values["size"]) / 2
        return (-half, -half, -half), (half, half, half)
    if kind == "plane":
        width, length = abs(values["width"]) / 2, abs(values["length"]) / 2
        x, y, z = {"X": (0.0, length, width), "Y": (width, 0.0, length), "Z": (width, length, 0.0)}[values["axis"]]
        return (-x, -y, -z), (x, y, z)
    if kind not in ("cylinder", "cone", "capsule"):
        return None
    bottom = abs(values.get("radius_bottom", values.get("radius", 0.0)))
    top = abs(values.get("radius_top", values.get("radius", 0.0)))
    end, around = abs(values["height"]) / 2, max(bottom, top)
    low, high = -end, end
    if kind == "capsule":
        # Spheres that touch the truncated cone at its ends.
        slope = (top - bottom) / (2 * end) if top != bottom and end > 0 else 0.0
        stretch = math.hypot(1.0, slope)
        low, high = -end + bottom * (slope - stretch), end + top * (slope + stretch)
        around *= stretch
    spine = tokens.AXES.index(values["axis"])
    lowest, highest = [-around] * 3, [around] * 3
    lowest[spine], highest[spine] = low, high
    return (lowest[0], lowest[1], lowest[2]), (highest[0], highest[1], highest[2])
