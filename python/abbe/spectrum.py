"""Spectra and their colours, as the renderer computes them: colours of spectra, and spectra that colours become.

Wavelengths are in nm, powers and radiances per nm. The observer is CIE 1931 2°, 360 to 830 nm; no K_m: Y is ∫ L ȳ dλ.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core

__all__ = ["blackbody", "color", "illuminant", "reflectance"]

FloatArray = npt.NDArray[np.float64]


def _flat(values: npt.ArrayLike) -> FloatArray:
    return np.ascontiguousarray(np.asarray(values, np.float64).ravel())


def color(
    nanometers: npt.ArrayLike,
    power: npt.ArrayLike,
    *,
    space: str = "lin_rec709_scene",
    samples: int = 65536,
    lines: bool = False,
) -> FloatArray:
    """Return the colour that a pixel has if light of this spectrum comes to it.

    Components are not clipped: a spectral colour outside of the gamut has negative ones.

    Parameters
    ----------
    nanometers : increasing, shape (n,); between them powers are interpolated linearly, outside the nearer one is taken
    power : per nm, shape (n,)
    space : ``lin_rec709_scene`` (D65 with Y = 1 is (1, 1, 1)), ``lin_ap1_scene`` (ACEScg), ``lin_ciexyzd65_scene``
        (X, Y, Z themselves), or another name that ``renderingColorSpace`` may have
    samples : of the pixel, evenly over the wavelengths
    lines : draw wavelengths for the lines of this spectrum too

    Returns
    -------
    ndarray
        float64, shape (3,).

    Raises
    ------
    UsageError
        The spectrum is none, or the space is not known.
    """
    return np.array(_core.color_of_spectrum(_flat(nanometers), _flat(power), space, samples, lines))


def illuminant(name: str, nanometers: npt.ArrayLike) -> FloatArray:
    """Return the relative power of a standard illuminant.

    Parameters
    ----------
    name : E, A, D50, D55, D65, D75 (any D40 to D250), FL2, FL7, FL11; or ``white``: D65 scaled to Y = 1, which an
        emission of (1, 1, 1) has
    nanometers : wavelengths

    Returns
    -------
    ndarray
        float64, of the shape of ``nanometers``.

    Raises
    ------
    UsageError
        There is no such illuminant.
    """
    return _core.illuminant_power(name, _flat(nanometers)).reshape(np.shape(nanometers))


def blackbody(kelvin: float, nanometers: npt.ArrayLike) -> FloatArray:
    """Return the spectral radiance of a black body in W/(m² sr nm).

    Parameters
    ----------
    kelvin : > 0
    nanometers : wavelengths

    Returns
    -------
    ndarray
        float64, of the shape of ``nanometers``.

    Raises
    ------
    UsageError
        It is no temperature.
    """
    return _core.blackbody_radiance(kelvin, _flat(nanometers)).reshape(np.shape(nanometers))


def reflectance(rgb: Any, nanometers: npt.ArrayLike, *, exact: bool = True) -> npt.NDArray[np.float32]:
    """Return the smooth reflectance that the renderer makes of a colour (Jakob and Hanika 2019).

    Parameters
    ----------
    rgb : linear Rec. 709 under D65, 0 to 1
    nanometers : wavelengths
    exact : by a solution of its own, as constants have it; else by the table that textures are looked up in

    Returns
    -------
    ndarray
        float32 in 0 to 1, of the shape of ``nanometers``. Seen under D65 it has the colour ``rgb`` to 1e-5.
    """
    r, g, b = (float(channel) for channel in rgb)
    return _core.reflectance_of_color((r, g, b), _flat(nanometers), exact).reshape(np.shape(nanometers))
