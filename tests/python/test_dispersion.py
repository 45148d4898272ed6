"""Dispersion laws from Python, against the formulas of refractiveindex.info written down again at 50 digits."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mpmath", reason="computes at 50 digits with mpmath")

import mpmath

from abbe import Dispersion, UsageError

MP = mpmath.MPContext()
MP.dps = 50

# Of central differences, in µm: their errors are some h² and 10^-50/h², far below a double's digits.
STEP = MP.mpf(10) ** -14

BAND = np.linspace(360.0, 830.0, 48)


def pairs(c: list[Any], first: int = 1) -> list[tuple[Any, Any]]:
    return list(zip(c[first::2], c[first + 1 :: 2], strict=True))


def sellmeier(c: list[Any], x: Any) -> Any:
    return MP.sqrt(1 + c[0] + sum(b * x**2 / (x**2 - p**2) for b, p in pairs(c)))


def sellmeier_2(c: list[Any], x: Any) -> Any:
    return MP.sqrt(1 + c[0] + sum(b * x**2 / (x**2 - p) for b, p in pairs(c)))


def polynomial(c: list[Any], x: Any) -> Any:
    return MP.sqrt(c[0] + sum(a * x**p for a, p in pairs(c)))


def refractiveindex_info(c: list[Any], x: Any) -> Any:
    n2 = c[0] + c[1] * x ** c[2] / (x**2 - c[3] ** c[4])
    if len(c) > 5:
        n2 += c[5] * x ** c[6] / (x**2 - c[7] ** c[8])
    return MP.sqrt(n2 + sum(a * x**p for a, p in pairs(c, 9)))


def cauchy(c: list[Any], x: Any) -> Any:
    return c[0] + sum(a * x**p for a, p in pairs(c))


def gases(c: list[Any], x: Any) -> Any:
    return 1 + c[0] + sum(a / (b - x**-2) for a, b in pairs(c))


def herzberger(c: list[Any], x: Any) -> Any:
    resonance = 1 / (x**2 - MP.mpf(0.028))
    powers = sum(a * x ** (2 * k) for k, a in enumerate(c[3:], start=1))
    return c[0] + c[1] * resonance + c[2] * resonance**2 + powers


def retro(c: list[Any], x: Any) -> Any:
    ratio = c[0] + c[1] * x**2 / (x**2 - c[2]) + c[3] * x**2
    return MP.sqrt((1 + 2 * ratio) / (1 - ratio))


def exotic(c: list[Any], x: Any) -> Any:
    return MP.sqrt(c[0] + c[1] / (x**2 - c[2]) + c[3] * (x - c[4]) / ((x - c[4]) ** 2 + c[5]))


FORMULAS: dict[str, tuple[int, Callable[[list[Any], Any], Any], list[float]]] = {
    "SiO2 Malitson": (1, sellmeier, [0, 0.6961663, 0.0684043, 0.4079426, 0.1162414, 0.8974794, 9.896161]),
    "PMMA-like": (2, sellmeier_2, [0.5, 0.7, 0.01, 0.2, -0.3]),
    "dioxane Moutzouris": (
        3,
        polynomial,
        [1.996073056, -0.00163203, 2, 0.00665705, -2, 6.00055e-5, -4, 7.70185e-5, -6],
    ),
    "polynomial of any exponents": (3, polynomial, [2.1, 0.03, -1.5, -0.01, 0.7, 2e-4, -5.25]),
    "KHP Moutzouris": (
        4,
        refractiveindex_info,
        [2.670444937, 0.031617528, 0, 0.208293225, 2, 0, 0, 0, 1, -0.0040144, 2],
    ),
    "two fractions": (4, refractiveindex_info, [2, 0.05, 1.3, 0.11, 1.7, -0.02, -0.5, 9.0, 1.1, 0.01, -1.7]),
    "heptane Kerl": (5, cauchy, [1.38248838, -4.05375e-3, -1, 4.58433e-3, -2]),
    "air Ciddor": (6, gases, [0, 0.05792105, 238.0185, 0.00167917, 57.362]),
    "Herzberger": (7, herzberger, [1.5, 0.0061, 0.00032, -0.0029, 1.3e-5, -1.9e-6, 4e-8]),
    "AgBr Schroter": (8, retro, [0.452505, 0.09939, 0.070537, -0.000150]),
    "urea Rosker": (9, exotic, [2.51527, 0.0240, 0.0300, 0.020, 1.52, 0.8771]),
}


def assert_law(law: Dispersion, index: Callable[[Any], Any]) -> None:
    """n, n' and n'' over the band; the scale of each is its largest size there, since n' and n'' may pass through 0."""
    exact = np.empty((3, BAND.size))
    for i, nm in enumerate(BAND):
        # The wavelength in µm that the renderer computes with: it is the argument of the law, not a part of it.
        x = MP.mpf(float(nm) / 1000.0)
        low, middle, high = index(x - STEP), index(x), index(x + STEP)
        exact[:, i] = (
            float(middle),
            float((high - low) / (2 * STEP) / 1000),
            float((high - 2 * middle + low) / STEP**2 / 10**6),
        )
    found = np.stack([law.ior(BAND), law.dior_dlambda(BAND), law.d2ior_dlambda2(BAND)])
    error = np.max(np.abs(found - exact), axis=1) / np.max(np.abs(exact), axis=1)
    assert np.all(error < [1e-15, 1e-10, 1e-10]), error


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_and_their_derivatives(name: str) -> None:
    number, index, coefficients = FORMULAS[name]
    exact = [MP.mpf(float(c)) for c in coefficients]
    assert_law(Dispersion.formula(number, coefficients), lambda x: index(exact, x))


def test_named_laws_and_their_derivatives() -> None:
    schott = [2.2718929, -0.010108077, 0.010592509, 0.00020816965, -7.6472538e-06, 4.9240991e-07]
    a = [MP.mpf(c) for c in schott]
    law = Dispersion.schott(schott)
    assert_law(law, lambda x: MP.sqrt(sum(c * x**p for c, p in zip(a, (0, 2, -2, -4, -6, -8), strict=True))))
    assert law.ior(587.5618) == pytest.approx(1.51680, abs=5e-6)
    b = [MP.mpf(c) for c in (1.5, 0.0091, 0.000527)]
    assert_law(Dispersion.conrady(1.5, 0.0091, 0.000527), lambda x: b[0] + b[1] / x + b[2] / x ** MP.mpf("3.5"))
    k = [MP.mpf(c) for c in (1.5, 0.004, 1e-4, -2e-6, 1e-7)]
    assert_law(
        Dispersion.cauchy(1.5, 0.004, 1e-4, -2e-6, 1e-7), lambda x: sum(c / x ** (2 * i) for i, c in enumerate(k))
    )


def test_a_table_is_the_not_a_knot_spline() -> None:
    scipy = pytest.importorskip("scipy.interpolate", reason="compares with the spline of SciPy")
    wavelength = np.array([340.0, 365.0, 404.6561, 435.8343, 486.1327, 587.5618, 706.5188, 900.0])
    ior = np.array([1.5402, 1.5363, 1.53024, 1.52668, 1.52238, 1.5168, 1.51289, 1.5088])
    law = Dispersion.table(wavelength, ior)
    spline = scipy.CubicSpline(wavelength, ior, bc_type="not-a-knot")
    for found, order in ((law.ior, 0), (law.dior_dlambda, 1), (law.d2ior_dlambda2, 2)):
        exact = spline(BAND, order)
        # Both solve a system in doubles; differences of neighbouring entries have lost some three digits.
        assert np.max(np.abs(found(BAND) - exact)) < 1e-11 * np.max(np.abs(exact))
    assert law.valid_range == (340.0, 900.0)
    assert law.out_of_range == "clamp"
    assert law.curvature_doubt is not None
    assert Dispersion.table([400, 500, 600], [1.5, 1.49, 1.485]).curvature_doubt is None


def test_valid_ranges() -> None:
    plain = Dispersion.cauchy(1.5, 0.004)
    assert (plain.valid_range, plain.out_of_range) == (None, "clamp")
    clamped = Dispersion.cauchy(1.5, 0.004, valid_range=(450, 700))
    assert clamped.valid_range == (450.0, 700.0)
    inside, outside = BAND[(BAND >= 450) & (BAND <= 700)], BAND[(BAND < 450) | (BAND > 700)]
    assert np.array_equal(clamped.ior(inside), plain.ior(inside))
    assert np.array_equal(clamped.ior(outside), plain.ior(np.clip(outside, 450, 700)))
    assert np.all(clamped.dior_dlambda(outside) == 0.0)
    assert np.all(clamped.d2ior_dlambda2(outside) == 0.0)
    free = Dispersion.sellmeier([1.3], [0.01], valid_range=(450, 700), out_of_range="extrapolate")
    assert free.dior_dlambda(400.0) < 0.0
    strict = Dispersion.formula(5, [1.5, 0.004, -2], valid_range=(450, 700), out_of_range="error")
    assert strict.ior([450.0, 700.0]) == pytest.approx(plain.ior([450.0, 700.0]), abs=1e-15)
    with pytest.raises(UsageError, match=r"wavelength: 400 nm is outside of the law's valid range, 450 to 700 nm"):
        strict.ior([500.0, 400.0])
    # Scaling keeps the range.
    assert clamped.scaled(2.0).valid_range == (450.0, 700.0)
    assert strict.scaled(2.0).out_of_range == "error"
    assert "valid from 450 to 700 nm" in repr(clamped)
    assert Dispersion.cauchy(1.5, 0.004, valid_range=(500, 620)).abbe_number is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Dispersion.formula(10, [1.5]), "Dispersion.formula: there is no formula 10"),
        (lambda: Dispersion.formula(3, [2.0, 0.1]), "the last pair is cut short"),
        (lambda: Dispersion.formula(2, [0.0, 1.0, 0.3]), "has a pole at 547.723 nm"),
        (lambda: Dispersion.formula(2, []), "none are given"),
        (lambda: Dispersion.schott([]), "Dispersion.schott: Schott coefficients: none are given"),
        (lambda: Dispersion.conrady(-1.5, 0.0), "must lie between 0.01 and 100"),
        (lambda: Dispersion.cauchy(1.5, 4217.0), "look like coefficients for λ in nm"),
        (lambda: Dispersion.sellmeier([1.04], [6000.0]), "C were in nm²: divide them by 10\\^6"),
        (lambda: Dispersion.table([500], [1.5]), "one entry, two at least"),
        (lambda: Dispersion.table([0.4, 0.7], [1.5, 1.49]), "look like µm"),
        (lambda: Dispersion.table([700, 400], [1.49, 1.5]), "decreasing wavelengths"),
        (lambda: Dispersion.table([400, 700], [1.5]), r"shapes \(2,\) and \(1,\)"),
        (lambda: Dispersion.table(400, 1.5), r"shapes \(\) and \(\)"),
        (lambda: Dispersion.table([400, 700], [1.5, 1.49], valid_range=(300, 700)), "goes beyond the table"),
        (lambda: Dispersion.cauchy(1.5, 0.004, valid_range=(0.4, 0.7)), "look like µm"),
        (lambda: Dispersion.cauchy(1.5, 0.004, valid_range=(600, 700)), "without the d line"),
        (lambda: Dispersion.cauchy(1.5, 0.004, out_of_range="crash"), "use clamp, error or extrapolate"),  # type: ignore[arg-type]
    ],
)
def test_impossible_laws_say_what_to_do(make: Callable[[], Dispersion], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        make()
