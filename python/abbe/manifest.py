"""Manifests of identifiers: which path the numbers of ``prim_id``, ``instance_id`` and ``material_id`` mean.

The header has them as JSON arrays of strings. Number n is the n-th path. An entry with index lists stands for as many
paths as it has combinations of indices, the last list running fastest: ``/World/Scatter[0:1000]`` for
``/World/Scatter[0]`` to ``/World/Scatter[999]``, and ``/World/Outer[0:2,5]/Bush/Leaves[0:50]`` for 150 elements of an
instancer within a prototype. A million instances of a point instancer are one entry.
"""

from __future__ import annotations

import json
import math
import re
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import overload

__all__ = ["Manifest"]

_LIST = re.compile(r"\[([0-9:,]+)\]")

Runs = list[range]


def _runs(text: str) -> Runs:
    """Return the indices of a list such as ``0:2,5``."""
    runs = []
    for item in text.split(","):
        low, colon, high = item.partition(":")
        runs.append(range(int(low), int(high) if colon else int(low) + 1))
    return runs


def _count(runs: Runs) -> int:
    return sum(len(run) for run in runs)


class Manifest(Sequence[str]):
    """The paths of a manifest, ``manifest[n - 1]`` being that of identifier n; long ones take no memory.

    Parameters
    ----------
    entries : the header's JSON text, or its strings

    Raises
    ------
    ValueError
        The text is no JSON array of strings, or an entry is not of the form above.

    Examples
    --------
    >>> manifest = Manifest('["/World/Floor", "/World/Scatter[0:1000]"]')
    >>> len(manifest), manifest[0], manifest[1000]
    (1001, '/World/Floor', '/World/Scatter[999]')
    """

    def __init__(self, entries: str | Iterable[str]) -> None:
        if isinstance(entries, str):
            entries = json.loads(entries)
            if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
                raise ValueError("the manifest is no JSON array of strings")
        self.entries = tuple(entries)
        """The entries as the header has them."""
        # Text and lists in turns: "/World/Scatter", "0:1000", "".
        self._pieces = [_LIST.split(entry) for entry in self.entries]
        counts = (math.prod(_count(_runs(text)) for text in pieces[1::2]) for pieces in self._pieces)
        self._ends = list(accumulate(counts))

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> list[str]: ...
    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if index < 0:
            index += len(self)
        if not 0 <= index < len(self):
            raise IndexError(f"the manifest has {len(self)} paths, not {index + 1}")
        entry = bisect_right(self._ends, index)
        rest = index - (self._ends[entry - 1] if entry else 0)
        pieces = list(self._pieces[entry])
        # The last list runs fastest.
        for place in range(len(pieces) - 2, 0, -2):
            runs = _runs(pieces[place])
            rest, at = divmod(rest, _count(runs))
            for run in runs:
                if at < len(run):
                    pieces[place] = f"[{run[at]}]"
                    break
                at -= len(run)
        return "".join(pieces)

    def __repr__(self) -> str:
        return f"<abbe.Manifest of {len(self)} paths in {len(self.entries)} entries>"
