"""Real glasses, crystals, liquids, plastics, gases and metals, on NumPy arrays.

The data are those of the refractiveindex.info database (CC0 1.0), the laws the renderer's: what is computed here is
what is rendered. Wavelengths are in nm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import UsageError
from .optics import Dispersion

__all__ = ["CATEGORIES", "DATABASE", "LINES", "STATUSES", "Glass", "SourceLaw", "glass", "glasses", "nearest_glass"]

OutOfRange = Literal["error", "clamp", "extrapolate"]

#: Spectral lines at which glass makers state indices, nm in air (SCHOTT TIE-29, ISO 7944).
LINES: Mapping[str, float] = MappingProxyType(
    {
        "i": 365.0146,
        "h": 404.6561,
        "g": 435.8343,
        "F'": 479.9914,
        "F": 486.1327,
        "e": 546.0740,
        "d": 587.5618,
        "C'": 643.8469,
        "C": 656.2725,
        "r": 706.5188,
        "s": 852.11,
    }
)

#: What kinds of stuff there are.
CATEGORIES = ("glass", "filter", "crystal", "plastic", "liquid", "gas", "metal", "semiconductor", "film")

#: What makers say about the supply of a glass.
STATUSES = ("preferred", "standard", "special", "obsolete")

#: Name and release of the database.
DATABASE = f"refractiveindex.info {_core.glass_database()[0]}"


class SourceLaw(NamedTuple):
    """n(λ) as the source states it."""

    formula: int | None
    """Number of the formula in refractiveindex.info, 1 to 9, with λ in µm; None for a table."""
    coefficients: tuple[float, ...]
    """Its coefficients; of a table nm, n, nm, n …"""


class Glass:
    """A material of the catalogue; made by :func:`glass` and :func:`glasses`.

    Names come as ``SCHOTT:N-BK7`` for what a maker sells and ``diamond:Peter`` for a substance on a page of the
    database. Indices are as the source states them: makers' are against air, those of some papers against vacuum.
    """

    def __init__(self, core: _core.Glass, out_of_range: OutOfRange = "error") -> None:
        self._core = core
        self._out_of_range = out_of_range
        self._dispersion: Dispersion | None = None

    @property
    def name(self) -> str:
        """The name in full."""
        return self._core.name

    @property
    def bare_name(self) -> str:
        """The name without maker or page: ``N-BK7``, ``diamond``."""
        return self._core.bare_name

    @property
    def maker(self) -> str | None:
        """The maker; None for a substance."""
        return self._core.maker

    @property
    def category(self) -> str:
        """One of :data:`CATEGORIES`."""
        return self._core.category

    @property
    def is_metal(self) -> bool:
        """Whether it is a metal: n + ik."""
        return self.category == "metal"

    @property
    def status(self) -> str:
        """One of :data:`STATUSES`; empty where nobody says."""
        return self._core.status

    @property
    def title(self) -> str:
        """The family of a glass, or the source's heading."""
        return self._core.title

    @property
    def page(self) -> str:
        """Shelf, book and page of the database, ``specs/SCHOTT-optical/N-BK7``."""
        return self._core.page

    @property
    def url(self) -> str:
        """Where to see the source in a browser."""
        return self._core.url

    @property
    def reference(self) -> str:
        """Who measured or states it."""
        return self._core.reference

    @property
    def source(self) -> str:
        """Database with its release, page and reference, in one line."""
        return f"{DATABASE}, {self.page}: {self.reference}"

    @property
    def source_law(self) -> SourceLaw:
        """n(λ) as the source states it."""
        formula, coefficients = self._core.source_law
        return SourceLaw(formula, tuple(coefficients))

    @property
    def valid_range(self) -> tuple[float, float]:
        """Shortest and longest wavelength for which the source's n(λ) holds, nm."""
        return self._core.valid_range

    @property
    def stated(self) -> tuple[float, float] | None:
        """n_d and V_d that the source states, None if it does not; ``nd`` and ``abbe_number`` are those of the law."""
        return self._core.stated

    @property
    def dispersion(self) -> Dispersion:
        """n(λ) with its derivatives, the renderer's."""
        if self._dispersion is None:
            self._dispersion = Dispersion(self._core.dispersion(self._out_of_range))
        return self._dispersion

    def _checked(self, wavelength: npt.ArrayLike) -> npt.ArrayLike:
        if self._out_of_range == "error":
            nm, (low, high) = np.asarray(wavelength, dtype=np.float64), self.valid_range
            outside = (nm < low) | (nm > high)
            if np.any(outside):
                first = np.extract(outside, nm)[0]
                raise UsageError(
                    f"{self.name}: n(λ) is known from {low:g} to {high:g} nm, not at {first:g} nm: "
                    'ask inside, or take glass(…, out_of_range="clamp") or "extrapolate"'
                )
        return wavelength

    def ior(self, wavelength: npt.ArrayLike) -> Any:
        """Return the refractive index; of a metal, its real part.

        Parameters
        ----------
        wavelength : nm, any shape

        Returns
        -------
        float or float64 array of that shape

        Raises
        ------
        UsageError
            A wavelength is outside of the valid range (unless ``out_of_range`` says otherwise).
        """
        return self.dispersion.ior(self._checked(wavelength))

    def dior_dlambda(self, wavelength: npt.ArrayLike) -> Any:
        """Return ∂n/∂λ in 1/nm; see :meth:`ior`."""
        return self.dispersion.dior_dlambda(self._checked(wavelength))

    def d2ior_dlambda2(self, wavelength: npt.ArrayLike) -> Any:
        """Return ∂²n/∂λ² in 1/nm²; see :meth:`ior`."""
        return self.dispersion.d2ior_dlambda2(self._checked(wavelength))

    @property
    def nd(self) -> float:
        """Index at the d line, 587.5618 nm."""
        return float(self.ior(LINES["d"]))

    @property
    def abbe_number(self) -> float | None:
        """(n_d − 1)/(n_F − n_C); None where n_F = n_C."""
        return self.dispersion.abbe_number

    def partial_dispersion(self, a: str = "g", b: str = "F") -> float | None:
        """Return (n_a − n_b)/(n_F − n_C).

        Parameters
        ----------
        a, b : names of lines in :data:`LINES`

        Returns
        -------
        float or None
            None where n_F = n_C.
        """
        for line in (a, b):
            if line not in LINES:
                raise UsageError(f"line: there is no {line!r}, but {', '.join(LINES)}")
        n_a, n_b, n_f, n_c = self.ior([LINES[line] for line in (a, b, "F", "C")])
        return float((n_a - n_b) / (n_f - n_c)) if n_f != n_c else None

    @property
    def extinction_table(self) -> npt.NDArray[np.float64] | None:
        """k(λ) as rows of nm and k, increasing in wavelength; None where the source has none."""
        table = self._core.extinction()
        return None if table is None else np.stack(table, axis=-1)

    def extinction(self, wavelength: npt.ArrayLike) -> Any:
        """Return k of n + ik: straight lines between the entries of the source, its last values outside.

        Parameters
        ----------
        wavelength : nm, any shape

        Returns
        -------
        float or float64 array of that shape

        Raises
        ------
        UsageError
            The source has no k(λ): the renderer takes such a material as clear.
        """
        table = self._core.extinction()
        if table is None:
            raise UsageError(f"{self.name}: its source has no k(λ)")
        nm = np.asarray(wavelength, dtype=np.float64)
        if not np.all(np.isfinite(nm) & (nm > 0.0)):
            raise UsageError("wavelength: must be finite and positive, in nm")
        k = np.interp(nm, *table)
        return float(k) if nm.ndim == 0 else k

    def internal_transmittance(self, wavelength: npt.ArrayLike, thickness_mm: float = 10.0) -> Any:
        """Return exp(−4πk d/λ): what is left of light after a path inside, surfaces apart.

        Parameters
        ----------
        wavelength : nm, any shape
        thickness_mm : length of the path

        Returns
        -------
        float or float64 array of that shape

        Raises
        ------
        UsageError
            The source has no k(λ), or the thickness is negative.
        """
        if not (np.isfinite(thickness_mm) and thickness_mm >= 0.0):
            raise UsageError(f"thickness_mm: must be finite and not negative, not {thickness_mm}")
        nm = np.asarray(wavelength, dtype=np.float64)
        transmittance = np.exp(-4.0 * np.pi * self.extinction(nm) * (thickness_mm * 1e6) / nm)
        return float(transmittance) if nm.ndim == 0 else transmittance

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Glass) and self.name == other.name and self._out_of_range == other._out_of_range

    def __hash__(self) -> int:
        return hash((self.name, self._out_of_range))

    def __repr__(self) -> str:
        vd = self._core.vd
        return f"<abbe.Glass {self.name}: n_d {self._core.nd:.6g}, V_d {'none' if vd is None else f'{vd:.4g}'}>"


def glass(name: str, *, out_of_range: OutOfRange = "error") -> Glass:
    """Return a material of the catalogue.

    Parameters
    ----------
    name : ``"SCHOTT:N-BK7"``, or ``"N-BK7"`` where one maker has it, ``"diamond"``, ``"diamond:Phillip"``; case,
        blanks, hyphens and underscores do not count
    out_of_range : what n(λ) does outside of the valid range: ``error``, ``clamp`` to its ends with zero derivatives, as
        a render does, or ``extrapolate``

    Returns
    -------
    Glass

    Raises
    ------
    UsageError
        There is no such name (close ones are suggested), or several makers have it (they are listed).
    """
    core = _core.glass(name)
    if out_of_range not in ("error", "clamp", "extrapolate"):
        raise UsageError(f"out_of_range: must be error, clamp or extrapolate, not {out_of_range!r}")
    return Glass(core, out_of_range)


def _key(name: str) -> str:
    """What counts of a name when it is searched for."""
    return "".join(c for c in name.lower() if c not in " -_")


def _bounds(name: str, bounds: tuple[float | None, float | None] | None) -> tuple[float, float]:
    low, high = bounds if bounds is not None else (None, None)
    low, high = -np.inf if low is None else float(low), np.inf if high is None else float(high)
    if not low <= high:
        raise UsageError(f"{name}: {low:g} to {high:g} is no range: give the smaller number first")
    return low, high


def glasses(
    pattern: str | None = None,
    *,
    maker: str | None = None,
    category: str | None = None,
    status: str | None = None,
    nd: tuple[float | None, float | None] | None = None,
    vd: tuple[float | None, float | None] | None = None,
) -> list[Glass]:
    """Return what is in the catalogue, sorted by name.

    Parameters
    ----------
    pattern : part of a name or title, or with ``*`` and ``?`` all of a name with or without its maker; as in
        :func:`glass` case, blanks and hyphens do not count
    maker : ``"SCHOTT"`` …
    category : one of :data:`CATEGORIES`
    status : one of :data:`STATUSES`
    nd, vd : smallest and largest n_d and V_d, None for no bound

    Returns
    -------
    list of Glass

    Raises
    ------
    UsageError
        A category, status or range is none; a maker is unknown.
    """
    for option, value, known in (("category", category, CATEGORIES), ("status", status, STATUSES)):
        if value is not None and value not in known:
            raise UsageError(f"{option}: there is no {value!r}, but {', '.join(known)}")
    cores = _core.glasses()
    makers = sorted({core.maker for core in cores if core.maker is not None})
    if maker is not None and maker.upper() not in makers:
        raise UsageError(f"maker: there is no {maker!r}, but {', '.join(makers)}")
    nd_low, nd_high = _bounds("nd", nd)
    vd_low, vd_high = _bounds("vd", vd)

    def wanted() -> Iterator[_core.Glass]:
        for core in cores:
            if maker is not None and core.maker != maker.upper():
                continue
            if (category is not None and core.category != category) or (status is not None and core.status != status):
                continue
            if not nd_low <= core.nd <= nd_high:
                continue
            if vd is not None and (core.vd is None or not vd_low <= core.vd <= vd_high):
                continue
            if pattern is None or _matches(pattern, core):
                yield core

    return [Glass(core) for core in sorted(wanted(), key=lambda core: core.name)]


def _matches(pattern: str, core: _core.Glass) -> bool:
    asked, names = _key(pattern), (_key(core.name), _key(core.bare_name))
    if any(c in asked for c in "*?["):
        return any(fnmatchcase(name, asked) for name in names)
    return asked in names[0] or asked in _key(core.title)


def nearest_glass(nd: float) -> Glass:
    """Return the clear everyday material nearest in n_d, as ``abbe:scalarIor = "nearestGlass"`` does.

    Parameters
    ----------
    nd : index at the d line

    Returns
    -------
    Glass

    Raises
    ------
    UsageError
        The index is not positive and finite.
    """
    if not (np.isfinite(nd) and nd > 0.0):
        raise UsageError(f"nd: must be positive and finite, not {nd}")
    return Glass(_core.nearest_glass(float(nd)))
