"""Which glass, or which law, has a given index: by n_d and V_d, or by measured n(λ)."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .catalog import LINES, Glass, glasses
from .errors import AbbeError, UsageError
from .optics import Dispersion

__all__ = ["Fit", "Match", "fit_cauchy", "fit_sellmeier", "match_numbers", "match_points", "read_points"]

FloatArray = npt.NDArray[np.float64]

# What something transparent may be made of.
_TRANSPARENT = ("glass", "crystal", "plastic", "liquid")

# nm; shorter ones are micrometres that somebody forgot to convert, longer ones Ångströms.
_SHORTEST, _LONGEST = 100.0, 20000.0

# Digits of coefficients: they are printed to be pasted, and the residual is that of what is printed.
_DIGITS = 10


@dataclass(frozen=True)
class Match:
    """A glass of the catalogue, and how near it comes."""

    glass: Glass
    distance: float
    """In n: √(Δn_d² + Δ(n_F − n_C)²), or the root mean square of Δn over the points given."""
    largest: float
    """The largest of these differences."""


@dataclass(frozen=True)
class Fit:
    """A law fitted to points by least squares."""

    law: str
    """cauchy or sellmeier."""
    coefficients: dict[str, tuple[float, ...]]
    """By the attribute they belong to, without its prefix abbe:dispersion:."""
    rms: float
    """Root mean square of the residual in n."""
    largest: float
    """Its largest value."""
    dispersion: Dispersion
    """The law, proved to be usable in 360–830 nm."""

    def attributes(self) -> list[str]:
        """Return the lines to paste into a Material in a .usda file."""
        lines = [f'uniform token abbe:dispersion:law = "{self.law}"']
        for name, values in self.coefficients.items():
            lines.append(f"uniform double[] abbe:dispersion:{name} = [{', '.join(map(repr, values))}]")
        return lines


def _candidates(maker: str | None, category: str | None, status: str | None) -> Iterable[Glass]:
    found = glasses(maker=maker, category=category, status=status)
    return found if category is not None else (glass for glass in found if glass.category in _TRANSPARENT)


def _nearest(matches: Iterable[Match], count: int) -> list[Match]:
    found = sorted(matches, key=lambda match: (match.distance, match.glass.name))
    if not found:
        raise UsageError("match: nothing in the catalogue is of the kind asked for and covers these wavelengths")
    return found[:count]


def match_numbers(
    nd: float,
    vd: float | None = None,
    *,
    count: int = 10,
    maker: str | None = None,
    category: str | None = None,
    status: str | None = None,
) -> list[Match]:
    """Return the glasses nearest to an index and an Abbe number.

    Parameters
    ----------
    nd : index at the d line
    vd : Abbe number; if None, n_d alone counts
    count : how many are wanted
    maker, category, status : as in :func:`abbe.glasses`; without a category, what is transparent

    Returns
    -------
    list of Match
        The nearest first: Δn_d and Δ(n_F − n_C), with n_F − n_C = (n_d − 1)/V_d, count alike.

    Raises
    ------
    UsageError
        There is no such medium, or nothing of what is asked for.
    """
    wanted = Dispersion.constant(nd) if vd is None else Dispersion.abbe(nd, vd)
    nm = np.array([LINES[line] for line in ("d", "F", "C")])

    def numbers(medium: Glass | Dispersion) -> FloatArray:
        n_d, n_f, n_c = medium.ior(nm)
        return np.array([n_d] if vd is None else [n_d, n_f - n_c])

    def matches() -> Iterable[Match]:
        for glass in _candidates(maker, category, status):
            difference = numbers(glass) - numbers(wanted)
            yield Match(glass, float(np.linalg.norm(difference)), float(np.max(np.abs(difference))))

    return _nearest(matches(), count)


def match_points(
    nm: npt.ArrayLike,
    n: npt.ArrayLike,
    *,
    count: int = 10,
    maker: str | None = None,
    category: str | None = None,
    status: str | None = None,
) -> list[Match]:
    """Return the glasses nearest to measured indices.

    Parameters
    ----------
    nm, n : wavelengths and indices, as many
    count, maker, category, status : as in :func:`match_numbers`

    Returns
    -------
    list of Match
        The nearest first, by the root mean square of the difference in n over the points.

    Raises
    ------
    UsageError
        The points cannot be used, or nothing of what is asked for covers them.
    """
    x, y = _points(nm, n)

    def matches() -> Iterable[Match]:
        for glass in _candidates(maker, category, status):
            low, high = glass.valid_range
            if low <= x[0] and x[-1] <= high:
                rms, largest = _residual(glass.ior(x) - y)
                yield Match(glass, rms, largest)

    return _nearest(matches(), count)


def _residual(error: FloatArray) -> tuple[float, float]:
    """Return root mean square and largest value."""
    return float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error)))


def _points(nm: npt.ArrayLike, n: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    x, y = np.asarray(nm, dtype=np.float64), np.asarray(n, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape or x.size == 0:
        raise UsageError("points: as many wavelengths as indices are wanted, one or more")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise UsageError("points: must be finite")
    if np.any((x < _SHORTEST) | (x > _LONGEST)):
        bad = x[(x < _SHORTEST) | (x > _LONGEST)][0]
        unit = "µm: multiply by 1000" if bad < _SHORTEST else "Å: divide by 10"
        raise UsageError(f"points: wavelengths are in nm; {bad:g} looks like {unit}")
    if np.any(y <= 0.0):
        raise UsageError(f"points: an index is {y[y <= 0.0][0]:g}, it must be positive")
    order = np.argsort(x)
    x, y = x[order], y[order]
    if np.any(np.diff(x) == 0.0):
        raise UsageError(f"points: {x[:-1][np.diff(x) == 0.0][0]:g} nm stands twice")
    return x, y


def _rounded(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


def _fit(
    law: str, coefficients: dict[str, tuple[float, ...]], dispersion: Dispersion, nm: FloatArray, n: FloatArray
) -> Fit:
    return Fit(law, coefficients, *_residual(dispersion.ior(nm) - n), dispersion)


def fit_cauchy(nm: npt.ArrayLike, n: npt.ArrayLike, terms: int = 3) -> Fit:
    """Fit Cauchy's law n = A + B/λ² + C/λ⁴ by linear least squares.

    Parameters
    ----------
    nm, n : wavelengths and indices, as many
    terms : 1 to 3; no more than there are points

    Returns
    -------
    Fit

    Raises
    ------
    UsageError
        The points cannot be used, are fewer than the terms, or the law that fits them cannot be used in 360–830 nm.
    """
    x, y = _points(nm, n)
    if not 1 <= terms <= 3:
        raise UsageError(f"terms: a Cauchy law here has 1 to 3, not {terms}")
    if terms > x.size:
        raise UsageError(f"points: {x.size} cannot determine {terms} coefficients: give more points or fewer terms")
    powers = (x[:, None] / 1000.0) ** (-2.0 * np.arange(terms))
    solution = _rounded(np.linalg.lstsq(powers, y, rcond=None)[0])
    a, b, c = (*solution, 0.0, 0.0)[:3]
    return _fit("cauchy", {"cauchy": solution}, Dispersion.cauchy(a, b, c), x, y)


# Where resonances may lie, µm²: beyond both ends of 360–830 nm, so that there is no pole in between, and within what a
# resonance of a glass has been found at (0.05 to 0.3 µm and 5 to 20 µm) with a wide margin.
_ULTRAVIOLET = (0.03**2, 0.34**2)
_INFRARED = (1.2**2, 40.0**2)

# Resonances to begin with, µm²: those of N-BK7 and of a dense flint, with and without an infrared one.
_BEGINNINGS: dict[int, tuple[tuple[float, ...], ...]] = {
    1: ((0.0105,), (0.03,)),
    2: ((0.0105, 100.0), (0.006, 0.025), (0.02, 0.06)),
    3: ((0.006, 0.02, 100.0), (0.013, 0.06, 110.0)),
}


def fit_sellmeier(nm: npt.ArrayLike, n: npt.ArrayLike, terms: int = 2) -> Fit:
    """Fit Sellmeier's law n² = 1 + Σ Bᵢ λ²/(λ² − Cᵢ) by nonlinear least squares (SciPy).

    The resonances Cᵢ are searched for outside of the visible; the strengths Bᵢ follow linearly from them.

    Parameters
    ----------
    nm, n : wavelengths and indices, as many
    terms : 1 to 3; two coefficients each, no more than there are points

    Returns
    -------
    Fit

    Raises
    ------
    AbbeError
        SciPy is missing.
    UsageError
        The points cannot be used, are too few, or the law that fits them cannot be used in 360–830 nm.
    """
    x, y = _points(nm, n)
    if terms not in _BEGINNINGS:
        raise UsageError(f"terms: a Sellmeier law here has 1 to 3, not {terms}")
    if 2 * terms > x.size:
        raise UsageError(f"points: {x.size} cannot determine {2 * terms} coefficients: give more points or fewer terms")
    try:
        from scipy.optimize import least_squares
    except ImportError as error:
        raise AbbeError("match: Sellmeier fits need SciPy: pip install 'abbe[glass]'") from error
    squared = (x / 1000.0) ** 2

    def strengths(log_c: FloatArray) -> tuple[FloatArray, FloatArray]:
        basis: FloatArray = squared[:, None] / (squared[:, None] - np.exp(log_c))
        b = np.asarray(np.linalg.lstsq(basis, y * y - 1.0, rcond=None)[0], dtype=np.float64)
        return b, basis @ b + 1.0

    def residual(log_c: FloatArray) -> FloatArray:
        # n² may come out negative on the way; then √ of its size with its sign still says how far off it is.
        square = strengths(log_c)[1]
        error: FloatArray = np.sign(square) * np.sqrt(np.abs(square)) - y
        return error

    best: Any = None
    for beginning in _BEGINNINGS[terms]:
        c = np.array(beginning)
        limits = np.array([_ULTRAVIOLET if value < 0.5 else _INFRARED for value in c])
        found = least_squares(residual, np.log(c), bounds=np.log(limits).T, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if best is None or found.cost < best.cost:
            best = found
    c_um2 = _rounded(np.exp(best.x))
    b = _rounded(strengths(np.log(c_um2))[0])
    dispersion = Dispersion.sellmeier(b, c_um2)
    return _fit("sellmeier", {"sellmeier:b": b, "sellmeier:c": c_um2}, dispersion, x, y)


def read_points(path: str | os.PathLike[str]) -> tuple[FloatArray, FloatArray]:
    """Read pairs of wavelength and index from a text file.

    Parameters
    ----------
    path : lines of nm and n, separated by a comma, semicolon, tab or blanks; a first line of names, empty lines and
        what follows ``#`` are skipped

    Returns
    -------
    wavelengths in nm, increasing, and indices

    Raises
    ------
    FileNotFoundError
        There is no such file.
    UsageError
        A line is not understood, or the numbers cannot be used.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except (UnicodeDecodeError, IsADirectoryError) as error:
        raise UsageError(f"{path}: is no text file: lines of nm,n are wanted") from error
    rows: list[tuple[float, float]] = []
    first = True
    for number, line in enumerate(lines, 1):
        text = line.split("#")[0].strip()
        if not text:
            continue
        pair = _pair(_cells(text))
        if pair is None and not first:
            raise UsageError(f"{path}: line {number}, '{text[:40]}', is not nm,n")
        first = False
        if pair is not None:
            rows.append(pair)
    if not rows:
        raise UsageError(f"{path}: has no line of nm,n")
    try:
        return _points([row[0] for row in rows], [row[1] for row in rows])
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None


def _cells(text: str) -> Sequence[str]:
    for delimiter in ",;\t":
        if delimiter in text:
            return next(csv.reader([text], delimiter=delimiter))
    return text.split()


def _pair(cells: Sequence[str]) -> tuple[float, float] | None:
    try:
        nm, n = map(float, cells)
    except ValueError:
        return None
    return nm, n
