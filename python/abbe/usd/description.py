"""The scene description as Python holds it: a JSON document beside named NumPy arrays, and the warnings on the way."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "ArrayTable", "BrokenError", "Description", "Diagnostics"]

Array = npt.NDArray[Any]
"""A float32, float64, int32 or uint8 array of shape (n,) or (n, k); usually USD's own memory, read-only."""


@dataclass(frozen=True)
class Description:
    """A scene as the core takes it; the schema is that of ``src/scene/description.rs``."""

    document: dict[str, Any]
    """The JSON document as plain dicts, lists, strings and numbers; all numbers finite."""
    arrays: dict[str, Array]
    """The arrays that the document names. They keep USD's memory alive: no copy was made where USD allows it."""

    def to_json(self) -> str:
        """Return the document as JSON text."""
        return json.dumps(self.document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))

    @property
    def warnings(self) -> list[dict[str, Any]]:
        """What was odd about the stage, each with ``kind``, ``message``, ``places`` and ``count``."""
        warnings: list[dict[str, Any]] = self.document["warnings"]
        return warnings


class BrokenError(Exception):
    """What one prim says and nobody can render: that prim is left out with a warning, and the rest is rendered.

    Never for what was asked for by an option or by the render settings: without that there is no picture to show.
    """

    def __init__(self, place: str, problem: str) -> None:
        super().__init__(f"{place}: {problem}")
        self.place = place
        self.problem = problem


@dataclass
class Diagnostics:
    """Warnings by first occurrence; the same kind and message are counted together, with their first few places."""

    EXAMPLES = 5

    _warnings: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)
    """What was left out for a reason that is no warning: reason -> count."""

    def warn(self, kind: str, place: str, message: str) -> None:
        """Record one occurrence of ``kind`` at ``place``."""
        warning = self._warnings.get((kind, message))
        if warning is None:
            warning = {"kind": kind, "message": message, "places": [], "count": 0}
            self._warnings[kind, message] = warning
        warning["count"] += 1
        if len(warning["places"]) < self.EXAMPLES and place not in warning["places"]:
            warning["places"].append(place)

    def extend(self, other: Diagnostics) -> None:
        """Record all that another has recorded."""
        for key, warning in other._warnings.items():
            own = self._warnings.setdefault(key, {**warning, "places": [], "count": 0})
            own["count"] += warning["count"]
            places = [place for place in warning["places"] if place not in own["places"]]
            own["places"] += places[: self.EXAMPLES - len(own["places"])]
        for reason, count in other.skipped.items():
            self.skip(reason, count)

    def leave_out(self, broken: BrokenError) -> None:
        """Record that a prim is left out for what it says."""
        self.warn("broken-prim", broken.place, f"{broken.problem}; it is left out")

    def skip(self, reason: str, count: int = 1) -> None:
        """Count prims or instances left out for ``reason``."""
        self.skipped[reason] = self.skipped.get(reason, 0) + count

    def warnings(self) -> list[dict[str, Any]]:
        """Return all warnings in the order of first occurrence."""
        return list(self._warnings.values())


class ArrayTable:
    """Arrays under unique names, each stored as the core wants it."""

    def __init__(self) -> None:
        self.arrays: dict[str, Array] = {}

    def add(self, name: str, array: Array) -> str:
        """Store ``array`` and return its name."""
        assert name not in self.arrays, f"array {name} is stored twice"
        assert array.dtype in (np.float32, np.float64, np.int32, np.uint8), f"array {name} is {array.dtype}"
        self.arrays[name] = array
        return name
