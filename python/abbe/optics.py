"""The optics and the calculus alone, on NumPy arrays: dispersion laws, refraction, reflection, transfer.

For scripts that trace rays of their own. The derivatives are by wavelength where the media have some, else by whatever
parameter the incoming derivatives are by. The code is the renderer's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import UsageError

__all__ = ["Dispersion", "Reflected", "Refracted", "Transferred", "reflect", "refract", "transfer"]

FloatArray = npt.NDArray[np.float64]
Range = tuple[float, float]
OutOfRange = Literal["clamp", "error", "extrapolate"]

# How far a vector's length may be from 1: float32 input is good to 6e-8 in each component; more is a vector that nobody
# normalised.
_UNIT_TOLERANCE = 1e-6


class Dispersion:
    """How the refractive index of a medium depends on wavelength; made by its class methods.

    Wavelengths are in nm here; coefficients are for µm, as catalogues print them.
    """

    def __init__(self, core: _core.Dispersion) -> None:
        self._core = core

    @classmethod
    def constant(cls, ior: float) -> Dispersion:
        """Return a medium without dispersion.

        Parameters
        ----------
        ior : refractive index

        Raises
        ------
        UsageError
            The index is outside of 0.01 to 100.
        """
        return cls(_core.Dispersion.constant(ior))

    @classmethod
    def cauchy(
        cls,
        a: float,
        b_um2: float,
        c_um4: float = 0.0,
        *higher: float,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return Cauchy's law n = a + b/λ² + c/λ⁴ + … with λ in µm.

        Parameters
        ----------
        a : index for long wavelengths
        b_um2 : µm²
        c_um4 : µm⁴
        higher : further coefficients, µm⁶, µm⁸ …
        valid_range, out_of_range : see :meth:`formula`

        Raises
        ------
        UsageError
            The index leaves 0.01 to 100 somewhere in 360 to 830 nm.
        """
        return cls(_core.Dispersion.cauchy([a, b_um2, c_um4, *higher], valid_range, out_of_range))

    @classmethod
    def sellmeier(
        cls,
        b: Sequence[float],
        c_um2: Sequence[float],
        *,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return Sellmeier's law n² = 1 + Σ bᵢ λ² / (λ² − cᵢ) with λ in µm.

        Parameters
        ----------
        b : strengths
        c_um2 : squares of the resonance wavelengths, µm² (not squared again), as many
        valid_range, out_of_range : see :meth:`formula`

        Raises
        ------
        UsageError
            There is a pole in 360 to 830 nm, or the lists differ in length.
        """
        return cls(_core.Dispersion.sellmeier(list(b), list(c_um2), valid_range, out_of_range))

    @classmethod
    def schott(
        cls,
        coefficients: Sequence[float],
        *,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return Schott's polynomial n² = a₀ + a₁λ² + a₂λ⁻² + a₃λ⁻⁴ + a₄λ⁻⁶ + a₅λ⁻⁸ with λ in µm.

        Parameters
        ----------
        coefficients : a₀, a₁ in µm⁻², a₂ in µm², a₃ in µm⁴ …; as many as there are
        valid_range, out_of_range : see :meth:`formula`

        Raises
        ------
        UsageError
            The index leaves 0.01 to 100 somewhere in 360 to 830 nm.
        """
        return cls(_core.Dispersion.schott(list(coefficients), valid_range, out_of_range))

    @classmethod
    def conrady(
        cls,
        a: float,
        b_um: float,
        c_um3_5: float = 0.0,
        *,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return Conrady's law n = a + b/λ + c/λ^3.5 with λ in µm.

        Parameters
        ----------
        a : index for long wavelengths
        b_um : µm
        c_um3_5 : µm to the power of 3.5
        valid_range, out_of_range : see :meth:`formula`

        Raises
        ------
        UsageError
            The index leaves 0.01 to 100 somewhere in 360 to 830 nm.
        """
        return cls(_core.Dispersion.conrady([a, b_um, c_um3_5], valid_range, out_of_range))

    @classmethod
    def formula(
        cls,
        number: int,
        coefficients: Sequence[float],
        *,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return a formula of refractiveindex.info with its coefficients in the order of that database, λ in µm.

        1 Sellmeier (poles squared), 2 Sellmeier-2 (poles in µm²), 3 polynomial, 4 RefractiveIndex.INFO, 5 Cauchy,
        6 gases, 7 Herzberger, 8 retro, 9 exotic; sums may have any number of terms.

        Parameters
        ----------
        number : 1 to 9
        coefficients : C1, C2 …
        valid_range : shortest and longest wavelength in nm for which the law holds; everywhere if None
        out_of_range : what becomes of other wavelengths: ``"clamp"`` takes the index of the nearest end and derivatives
            of 0, ``"error"`` refuses them, ``"extrapolate"`` uses the law as it stands

        Raises
        ------
        UsageError
            There is no such formula, the number of coefficients does not fit, there is a pole or an index outside of
            0.01 to 100 in the part of 360 to 830 nm where the law is used, or the valid range lacks 587.5618 nm, at
            which n_d is stated (but for ``"extrapolate"``).
        """
        return cls(_core.Dispersion.formula(number, list(coefficients), valid_range, out_of_range))

    @classmethod
    def table(
        cls,
        wavelength: npt.ArrayLike,
        ior: npt.ArrayLike,
        *,
        valid_range: Range | None = None,
        out_of_range: OutOfRange = "clamp",
    ) -> Dispersion:
        """Return the curve through measured indices: a cubic spline (not-a-knot), continuous to the second derivative.

        The second derivative is the spline's; :attr:`curvature_doubt` says how far it can be trusted.

        Parameters
        ----------
        wavelength : nm, increasing, two or more
        ior : as many indices
        valid_range : from end to end of the table if None, else within it; see :meth:`formula`
        out_of_range : see :meth:`formula`

        Raises
        ------
        UsageError
            The wavelengths do not increase or look like µm, the two differ in length, or the spline leaves 0.01 to 100.
        """
        columns = [np.asarray(values, dtype=np.float64) for values in (wavelength, ior)]
        if columns[0].ndim != 1 or columns[0].shape != columns[1].shape:
            shapes = " and ".join(str(column.shape) for column in columns)
            raise UsageError(
                f"Dispersion.table: wavelength and ior have shapes {shapes}: two equally long lists are wanted"
            )
        return cls(_core.Dispersion.table(np.stack(columns, axis=1).tolist(), valid_range, out_of_range))

    @classmethod
    def abbe(cls, nd: float, vd: float) -> Dispersion:
        """Return the two-term Cauchy law with this index and Abbe number.

        Parameters
        ----------
        nd : index at 587.5618 nm
        vd : Abbe number (n_d − 1)/(n_F − n_C), positive

        Raises
        ------
        UsageError
            There is no such medium.
        """
        return cls(_core.Dispersion.abbe(nd, vd))

    def scaled(self, scale: float) -> Dispersion:
        """Return the medium with n(λ) − n_d multiplied.

        Parameters
        ----------
        scale : 0 switches dispersion off, 1 is physical

        Raises
        ------
        UsageError
            The index then leaves 0.01 to 100.
        """
        return type(self)(self._core.scaled(scale))

    def _at(self, wavelength: npt.ArrayLike, order: int) -> Any:
        nm = np.asarray(wavelength, dtype=np.float64)
        if not np.all(np.isfinite(nm) & (nm > 0.0)):
            raise UsageError("wavelength: must be finite and positive, in nm")
        values = self._core.at(np.ascontiguousarray(nm.reshape(-1)))[order].reshape(nm.shape)
        return float(values) if nm.ndim == 0 else values

    def ior(self, wavelength: npt.ArrayLike) -> Any:
        """Return the refractive index.

        Parameters
        ----------
        wavelength : nm, any shape; outside of 360 to 830 nm the law is evaluated as it stands

        Returns
        -------
        float or float64 array of that shape

        Raises
        ------
        UsageError
            A wavelength is not positive, or outside of the valid range of a law made with ``out_of_range="error"``.
        """
        return self._at(wavelength, 0)

    def dior_dlambda(self, wavelength: npt.ArrayLike) -> Any:
        """Return ∂n/∂λ in 1/nm; see :meth:`ior`."""
        return self._at(wavelength, 1)

    def d2ior_dlambda2(self, wavelength: npt.ArrayLike) -> Any:
        """Return ∂²n/∂λ² in 1/nm²; see :meth:`ior`."""
        return self._at(wavelength, 2)

    @property
    def abbe_number(self) -> float | None:
        """(n_d − 1)/(n_F − n_C); None for a constant index, and if a line lies outside of the valid range."""
        return self._core.abbe_number

    @property
    def valid_range(self) -> Range | None:
        """Shortest and longest wavelength in nm for which the law holds; None if everywhere."""
        return self._core.valid_range

    @property
    def out_of_range(self) -> str:
        """What becomes of wavelengths outside of it: ``"clamp"``, ``"error"`` or ``"extrapolate"``."""
        return self._core.out_of_range

    @property
    def curvature_doubt(self) -> float | None:
        """Relative change of a table's ∂²n/∂λ² when every second entry is left out; None if that cannot be told.

        Root mean squares over 360 to 830 nm; 0.1 means that the second derivative is good to about a tenth.
        """
        return self._core.curvature_doubt

    @property
    def is_constant(self) -> bool:
        """Whether the index is the same at every wavelength."""
        return self._core.is_constant

    def __repr__(self) -> str:
        return f"<abbe.Dispersion: {self._core.describe()}>"


class Refracted(NamedTuple):
    """What :func:`refract` returns."""

    direction: FloatArray
    """Unit, shape (..., 3); reflected where ``total_reflection``."""
    ddirection: FloatArray
    """Its derivative, shape (..., 3)."""
    total_reflection: npt.NDArray[np.bool_]
    """Shape (...)."""


class Reflected(NamedTuple):
    """What :func:`reflect` returns."""

    direction: FloatArray
    """Unit, shape (..., 3)."""
    ddirection: FloatArray
    """Its derivative, shape (..., 3)."""


class Transferred(NamedTuple):
    """What :func:`transfer` returns."""

    point: FloatArray
    """Shape (..., 3); NaN where the ray runs along the surface."""
    dpoint: FloatArray
    """Its derivative, shape (..., 3); NaN likewise."""


def _vectors(name: str, value: npt.ArrayLike, unit: bool = False) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise UsageError(f"{name}: has shape {array.shape}: vectors of three components are wanted, (..., 3)")
    if not np.all(np.isfinite(array)):
        raise UsageError(f"{name}: is not finite everywhere")
    if unit:
        deviation = np.abs(np.sqrt(np.sum(array * array, axis=-1)) - 1.0)
        if np.any(deviation > _UNIT_TOLERANCE):
            raise UsageError(f"{name}: has a vector whose length is off 1 by {np.max(deviation):.2g}: normalise it")
    return array


def _numbers(name: str, value: npt.ArrayLike, positive: bool = False) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if not np.all(np.isfinite(array)) or (positive and np.any(array <= 0.0)):
        raise UsageError(f"{name}: must be finite{' and positive' if positive else ''}")
    return array


def _flat(vectors: Sequence[FloatArray], numbers: Sequence[FloatArray]) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Return the common shape, and everything broadcast to it as contiguous (n, 3) and (n,) arrays."""
    shapes = [array.shape[:-1] for array in vectors] + [array.shape for array in numbers]
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError:
        raise UsageError(f"arrays: the shapes {', '.join(map(str, shapes))} do not broadcast") from None
    flat = [np.ascontiguousarray(np.broadcast_to(array, (*shape, 3)).reshape(-1, 3)) for array in vectors]
    flat += [np.ascontiguousarray(np.broadcast_to(array, shape).reshape(-1)) for array in numbers]
    return shape, flat


def refract(
    direction: npt.ArrayLike,
    normal: npt.ArrayLike,
    ior_i: npt.ArrayLike,
    ior_t: npt.ArrayLike,
    *,
    dior_i: npt.ArrayLike = 0.0,
    dior_t: npt.ArrayLike = 0.0,
    ddirection: npt.ArrayLike = (0.0, 0.0, 0.0),
    dnormal: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Refracted:
    """Refract directions, and their derivatives with them; reflect where Snell's law has no answer.

    Arguments broadcast against each other as NumPy has it, vectors by their leading axes.

    Parameters
    ----------
    direction : (..., 3), unit, along travel
    normal : (..., 3), unit, to either side
    ior_i, ior_t : (...), index on the incident and on the other side, positive
    dior_i, dior_t : (...), their derivatives, 1/nm for wavelength
    ddirection, dnormal : (..., 3), derivatives of direction and normal, perpendicular to them

    Returns
    -------
    Refracted
        ``direction`` and ``ddirection`` (..., 3), ``total_reflection`` (...), float64 and bool.

    Raises
    ------
    UsageError
        A shape or value cannot be used: not finite, not of unit length, an index that is not positive.
    """
    shape, flat = _flat(
        [
            _vectors("direction", direction, unit=True),
            _vectors("normal", normal, unit=True),
            _vectors("ddirection", ddirection),
            _vectors("dnormal", dnormal),
        ],
        [
            _numbers("ior_i", ior_i, positive=True),
            _numbers("ior_t", ior_t, positive=True),
            _numbers("dior_i", dior_i),
            _numbers("dior_t", dior_t),
        ],
    )
    d, n, dd, dn, n_i, n_t, dn_i, dn_t = flat
    out, dout, total = _core.refract(d, n, n_i, n_t, dn_i, dn_t, dd, dn)
    return Refracted(out.reshape(*shape, 3), dout.reshape(*shape, 3), total.reshape(shape))


def reflect(
    direction: npt.ArrayLike,
    normal: npt.ArrayLike,
    *,
    ddirection: npt.ArrayLike = (0.0, 0.0, 0.0),
    dnormal: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Reflected:
    """Reflect directions, and their derivatives with them.

    Parameters
    ----------
    direction : (..., 3), unit, along travel
    normal : (..., 3), unit, to either side
    ddirection, dnormal : (..., 3), derivatives of direction and normal, perpendicular to them

    Returns
    -------
    Reflected
        ``direction`` and ``ddirection``, float64 with shape (..., 3).

    Raises
    ------
    UsageError
        A shape or value cannot be used.
    """
    shape, (d, n, dd, dn) = _flat(
        [
            _vectors("direction", direction, unit=True),
            _vectors("normal", normal, unit=True),
            _vectors("ddirection", ddirection),
            _vectors("dnormal", dnormal),
        ],
        [],
    )
    out, dout = _core.reflect(d, n, dd, dn)
    return Reflected(out.reshape(*shape, 3), dout.reshape(*shape, 3))


def transfer(
    point: npt.ArrayLike,
    direction: npt.ArrayLike,
    distance: npt.ArrayLike,
    normal: npt.ArrayLike,
    *,
    dpoint: npt.ArrayLike = (0.0, 0.0, 0.0),
    ddirection: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Transferred:
    """Move points along rays to a surface on which they stay when the parameter moves.

    Parameters
    ----------
    point : (..., 3), where the rays begin
    direction : (..., 3), unit, along travel
    distance : (...), to the surface
    normal : (..., 3), geometric normal of the surface there, to either side
    dpoint, ddirection : (..., 3), derivatives of point and direction

    Returns
    -------
    Transferred
        ``point`` and ``dpoint``, float64 with shape (..., 3); NaN where the ray runs along the surface.

    Raises
    ------
    UsageError
        A shape or value cannot be used.
    """
    shape, (p, dp, d, dd, n, t) = _flat(
        [
            _vectors("point", point),
            _vectors("dpoint", dpoint),
            _vectors("direction", direction, unit=True),
            _vectors("ddirection", ddirection),
            _vectors("normal", normal, unit=True),
        ],
        [_numbers("distance", distance)],
    )
    out, dout = _core.transfer(p, dp, d, dd, t, n)
    return Transferred(out.reshape(*shape, 3), dout.reshape(*shape, 3))
