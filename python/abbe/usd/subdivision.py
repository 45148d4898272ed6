"""Subdivision surfaces: what UsdGeomMesh says of them, and the refinement that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import UsageError
from . import tokens
from .description import ArrayTable, Diagnostics
from .values import place, read

__all__ = ["SubdivisionReader", "refinement_level"]


def refinement_level(complexity: str | None) -> int | None:
    """Return the level that one of usdrecord's complexities stands for; None where none is given.

    Raises
    ------
    UsageError
        It is none of them.
    """
    if complexity is None:
        return None
    if complexity not in tokens.COMPLEXITIES:
        raise UsageError(f"complexity '{complexity}': use one of {', '.join(tokens.COMPLEXITIES)}")
    return tokens.COMPLEXITIES.index(complexity)


class SubdivisionReader:
    """Reads how meshes are subdivided; ``level`` is that of meshes which have none of their own."""

    def __init__(
        self,
        ints: Callable[[Any, str], Any],
        floats: Callable[[Any, str, int], Any],
        table: ArrayTable,
        diagnostics: Diagnostics,
        time: Any,
        level: int | None,
    ) -> None:
        self._ints = ints
        self._floats = floats
        self._table = table
        self._diagnostics = diagnostics
        self._time = time
        self._level = level

    def read(self, prim: Any, array_name: str) -> dict[str, Any] | None:
        """Return the description's ``subdivision`` of a mesh; None for polygons."""
        scheme = read(prim, tokens.SUBDIVISION_SCHEME, self._time)
        if scheme == tokens.NO_SUBDIVISION:
            return None
        if scheme not in tokens.SUBDIVISION_SCHEMES:
            self._warn(prim, tokens.SUBDIVISION_SCHEME, f"'{scheme}' is no scheme of USD; polygons are rendered")
            return None
        result: dict[str, Any] = {"scheme": str(scheme)}
        level = self._own_level(prim)
        if level is not None:
            result["level"] = level
        for key, (name, allowed) in (
            ("interpolate_boundary", tokens.INTERPOLATE_BOUNDARY),
            ("face_varying_linear_interpolation", tokens.FACE_VARYING_INTERPOLATION),
            ("triangle_subdivision_rule", tokens.TRIANGLE_RULE),
        ):
            value = read(prim, name, self._time)
            if value in allowed:
                result[key] = str(value)
            elif value is not None:
                self._warn(prim, name, f"'{value}' is none of {', '.join(allowed)}; {allowed[-1]} is used")
        for key, name in (
            ("crease_indices", tokens.CREASE_INDICES),
            ("crease_lengths", tokens.CREASE_LENGTHS),
            ("corner_indices", tokens.CORNER_INDICES),
        ):
            self._add(result, key, array_name, self._ints(prim, name))
        for key, name in (
            ("crease_sharpnesses", tokens.CREASE_SHARPNESSES),
            ("corner_sharpnesses", tokens.CORNER_SHARPNESSES),
        ):
            self._add(result, key, array_name, self._floats(prim, name, 1))
        return result

    def _own_level(self, prim: Any) -> int | None:
        """Return the level of a mesh: its own if authored, else what was asked for everything."""
        attribute = prim.GetAttribute(tokens.SUBDIVISION_LEVEL)
        if not attribute or not attribute.HasAuthoredValue():
            return self._level
        level = read(prim, tokens.SUBDIVISION_LEVEL, self._time)
        if isinstance(level, bool) or not isinstance(level, int):
            self._warn(prim, tokens.SUBDIVISION_LEVEL, f"{level} is no number of levels; it is left out")
            return self._level
        return self._level if level < 0 else level

    def _add(self, result: dict[str, Any], key: str, array_name: str, values: Any) -> None:
        if values is not None and len(values):
            result[key] = self._table.add(f"{array_name}.{key}", values)

    def _warn(self, prim: Any, name: str, problem: str) -> None:
        self._diagnostics.warn("unreadable-attribute", f"{place(prim)}.{name}", problem)
