"""Primvars that materials look up by name: values over a mesh beside its arrays, constant ones with the placement.

Only what some material of a prim names is read; of a prim without a material its ``displayColor``, which is what Hydra
shows it in.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from . import tokens
from ._pxr import UsdGeom
from .description import Diagnostics
from .geometry import ShapeReader
from .values import place

__all__ = ["PrimvarReader"]

_MOST_COMPONENTS = 4


class PrimvarReader:
    """Adds primvars to meshes and placements."""

    def __init__(self, shapes: ShapeReader, time: Any, diagnostics: Diagnostics) -> None:
        self._shapes = shapes
        self._time = time
        self._diagnostics = diagnostics
        self._done: set[tuple[int, str]] = set()

    def add(self, prim: Any, shape: int, names: Iterable[str], item: dict[str, Any]) -> None:
        """Add the primvars ``names`` of a prim to its shape, or where they are constant to its placement ``item``."""
        mesh = self._shapes.shapes[shape].get("mesh")
        for name in sorted(names):
            attribute = prim.GetAttribute(tokens.PRIMVARS_PREFIX + name)
            if attribute and attribute.HasAuthoredValue():
                varies = attribute.GetMetadata(tokens.INTERPOLATION) not in (None, tokens.CONSTANT)
                if mesh is not None and varies:
                    self._over_mesh(prim, shape, mesh, name, attribute)
                    continue
                primvar = UsdGeom.Primvar(attribute)
            else:
                primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
                if not primvar or not primvar.HasAuthoredValue():
                    continue
            value = self._constant(prim, primvar)
            if value is not None:
                item.setdefault("primvars", {})[name] = value

    def _over_mesh(self, prim: Any, shape: int, mesh: dict[str, Any], name: str, attribute: Any) -> None:
        if (shape, name) in self._done:
            return
        self._done.add((shape, name))
        if mesh.get("uv_name") == name:
            return
        columns = _columns(attribute.Get(self._time))
        if columns is None:
            self._refuse(prim, attribute.GetName())
            return
        primvar = self._shapes.primvar(prim, attribute, f"shape{shape}.primvars.{name}", columns)
        if primvar is not None:
            mesh.setdefault("primvars", {})[name] = primvar

    def _constant(self, prim: Any, primvar: Any) -> list[float] | None:
        """Return the one value of a primvar, or, where it stands for a whole shape without faces, its first."""
        try:
            value = primvar.ComputeFlattened(self._time)
            numbers = np.asarray(value, dtype=np.float64)
        except (RuntimeError, TypeError, ValueError):
            numbers = np.empty(0)
        if primvar.GetTypeName().isArray and numbers.size:
            numbers = numbers[0]
        numbers = np.atleast_1d(numbers)
        if numbers.ndim != 1 or not 1 <= numbers.size <= _MOST_COMPONENTS or not np.isfinite(numbers).all():
            self._refuse(prim, primvar.GetAttr().GetName())
            return None
        result: list[float] = numbers.tolist()
        return result

    def _refuse(self, prim: Any, name: str) -> None:
        self._diagnostics.warn(
            "unreadable-attribute",
            f"{place(prim)}.{name}",
            f"is not made of values of 1 to {_MOST_COMPONENTS} finite numbers; materials do not see it",
        )


def _columns(value: Any) -> int | None:
    """Return how many numbers a value of an array has, None where they are none or too many."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in "fiu" or array.ndim not in (1, 2):
        return None
    columns = 1 if array.ndim == 1 else int(array.shape[1])
    return columns if 1 <= columns <= _MOST_COMPONENTS else None
