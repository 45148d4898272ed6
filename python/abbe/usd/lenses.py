"""Lens elements: the prescription on a prim (AbbeLensAPI) instead of its mesh.

The attributes are read by name, whether or not the schema is applied or registered. What makes a lens is decided by the
core; here values are finite numbers.
"""

from __future__ import annotations

import math
from typing import Any

from . import tokens
from ._pxr import UsdGeom
from .description import BrokenError
from .values import place, read

__all__ = ["is_lens", "lens_bounds", "read_lens"]


def is_lens(prim: Any) -> bool:
    """Return whether a prim is a Mesh or an Xform with a prescription: its thickness is authored."""
    attribute = prim.GetAttribute(tokens.LENS_THICKNESS)
    if not attribute or not attribute.HasAuthoredValue():
        return False
    return bool(prim.IsA(UsdGeom.Mesh) or prim.IsA(UsdGeom.Xform))


def read_lens(prim: Any, time: Any) -> dict[str, Any]:
    """Return the shape of a prim with a prescription.

    Raises
    ------
    BrokenError
        A value is no finite number.
    """
    lens: dict[str, Any] = {"path": str(prim.GetPath()), "thickness": _number(prim, tokens.LENS_THICKNESS, time)}
    edge = _number(prim, tokens.LENS_EDGE_RADIUS, time)
    if edge != 0.0:
        lens["edge_radius"] = edge
    for side in ("front", "back"):
        prefix = f"{tokens.LENS_PREFIX}{side}:"
        lens[side] = {
            "curvature": _number(prim, prefix + "curvature", time),
            "conic": _number(prim, prefix + "conic", time),
            "aspheres": _numbers(prim, prefix + "aspheres", time),
            "semi_diameter": _number(prim, prefix + "semiDiameter", time),
        }
    return {"lens": lens}


def _number(prim: Any, name: str, time: Any) -> float:
    value = read(prim, name, time)
    if value is None:
        # The schema's fallback.
        return 0.0
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise BrokenError(f"{place(prim)}.{name}", f"is {value}, which is no finite number")
    return float(value)


def _numbers(prim: Any, name: str, time: Any) -> list[float]:
    value = read(prim, name, time)
    if value is None:
        return []
    try:
        numbers = [float(item) for item in value]
    except (TypeError, ValueError):
        numbers = [math.nan]
    if not all(map(math.isfinite, numbers)):
        raise BrokenError(f"{place(prim)}.{name}", f"is {value}, which is no list of finite numbers")
    return numbers


def sag(face: dict[str, Any], radius: float) -> float:
    """Return the height of a face over its vertex at a distance from the axis; flat beyond its semi-diameter."""
    square = min(radius, face["semi_diameter"]) ** 2
    c, k = face["curvature"], face["conic"]
    root = math.sqrt(max(0.0, 1.0 - (1.0 + k) * c * c * square))
    terms = sum(a * square ** (n + 2) for n, a in enumerate(face["aspheres"]))
    return float(c * square / (1.0 + root) + terms)


def lens_bounds(
    shape: dict[str, Any],
) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
    """Return the corners of a lens' box in its own space, by samples of its faces; None for other shapes."""
    lens = shape.get("lens")
    if lens is None:
        return None
    edge = lens.get("edge_radius", max(lens["front"]["semi_diameter"], lens["back"]["semi_diameter"]))
    radii = [edge * i / 64 for i in range(65)]
    low = min(sag(lens["front"], r) for r in radii)
    high = lens["thickness"] + max(sag(lens["back"], r) for r in radii)
    return (-edge, -edge, low), (edge, edge, high)
