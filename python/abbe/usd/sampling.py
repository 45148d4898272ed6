"""Samples of motion: so many that what is linear between them is near enough to what USD says.

A motion is sampled at the ends of the interval, at the frame and at every authored sample in it. Between two of
these it may still be curved (angles are interpolated, not matrices): halves are added until a look at a half, a
quarter and an eighth finds every step straight, but no more than :data:`MOST_PIECES` for one motion.

*Straight* is: the turn from the start of a step to the time looked at, as a matrix in the world, differs from the
linear one by at most :data:`ROUNDNESS` in any number; a wheel's rim then stays within that part of its radius (a
step of 2.5°), however it is placed below what turns. And what stands at the origin leaves its straight path by at
most :data:`STRAIGHTNESS` of the way that it goes in all. Both are the same for things that are fixed to each other,
so that what touches keeps touching.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ._pxr import Gf, Usd
from .description import Array

__all__ = ["MOST_PIECES", "ROUNDNESS", "STRAIGHTNESS", "Span", "refine"]

ROUNDNESS = 1.0 / 4096.0
STRAIGHTNESS = 1.0 / 128.0
MOST_PIECES = 256
# Just before a held value changes: short against any shutter, long against the rounding of time codes.
_JUST_BEFORE = 2.0**-20


@dataclass(frozen=True)
class Span:
    """The interval about a frame in which motion is looked at."""

    frame: float
    """Time code of the frame."""
    marks: tuple[float, ...]
    """Times that must be samples, relative to the frame and increasing: the ends, the frame, and others."""
    held: bool
    """Whether the stage holds values between its samples."""

    @property
    def interval(self) -> Any:
        """The interval in time codes."""
        return Gf.Interval(self.frame + self.marks[0], self.frame + self.marks[-1])

    def code(self, time: float) -> Any:
        """Return the time code of a relative time."""
        return Usd.TimeCode(self.frame + time)

    def with_samples(self, authored: Sequence[float]) -> list[float]:
        """Return the marks and the authored samples (time codes) within the interval, relative to the frame."""
        times = {*self.marks}
        for code in authored:
            time = code - self.frame
            if self.marks[0] < time < self.marks[-1]:
                times.add(time)
                if self.held and time - _JUST_BEFORE > self.marks[0]:
                    times.add(time - _JUST_BEFORE)
        return sorted(times)


def refine(times: list[float], sample: Callable[[float], Array | None]) -> tuple[list[float], list[Array]] | None:
    """Return times and the values there, with as many times more between those given as the motion needs.

    Parameters
    ----------
    times : increasing
    sample : gives matrices (n, 4, 3) of row vectors at a time, translation last; always as many, or None

    Returns
    -------
    times and values; None if nothing moves, or there are not always as many finite matrices
    """
    known: dict[float, Array] = {}

    def at(time: float) -> Array | None:
        if time not in known:
            value = sample(time)
            if value is None or not np.isfinite(value).all():
                return None
            known[time] = value
        return known[time]

    values = [at(time) for time in times]
    if any(value is None or value.shape != values[0].shape for value in values):  # type: ignore[union-attr]
        return None
    way = _way([value for value in values if value is not None])
    deepest = max(0, (MOST_PIECES // max(1, len(times) - 1)).bit_length() - 1)
    refined = [times[0]]
    for begin, end in pairwise(times):
        steps = [(begin, end, 0)]
        while steps:
            a, b, depth = steps.pop()
            if depth < deepest and not _is_straight(a, b, at, way):
                middle = 0.5 * (a + b)
                steps += [(middle, b, depth + 1), (a, middle, depth + 1)]
            else:
                refined.append(b)
    found = [known[time] for time in refined]
    if all(np.array_equal(value, found[0]) for value in found):
        return None
    return refined, found


def _way(values: list[Array]) -> Array:
    """Return how far the origin of each matrix goes through all samples."""
    steps = [np.linalg.norm(b[:, 3] - a[:, 3], axis=-1) for a, b in pairwise(values)]
    way: Array = np.sum(steps, axis=0) if steps else np.zeros(len(values[0]))
    return way


def _is_straight(begin: float, end: float, at: Callable[[float], Array | None], way: Array) -> bool:
    a, b = at(begin), at(end)
    for fraction in (0.5, 0.25, 0.125):
        seen = at(begin + fraction * (end - begin))
        if a is None or b is None or seen is None or seen.shape != a.shape:
            return True  # nothing finite, nothing to follow
        off = seen - (a + fraction * (b - a))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                turn = np.linalg.solve(a[:, :3], off[:, :3])
            except np.linalg.LinAlgError:  # scaled from nothing
                turn = off[:, :3] / max(float(np.abs(b[:, :3]).max()), float(np.finfo(float).tiny))
            # A look may find more of the way than the samples told of: there and back again.
            far = np.maximum(way, np.linalg.norm(seen[:, 3] - a[:, 3], axis=-1))
            left = np.linalg.norm(off[:, 3], axis=-1)
        if float(np.abs(turn).max(initial=0.0)) > ROUNDNESS or bool((left > STRAIGHTNESS * far).any()):
            return False
    return True
