"""Colours of spectra against colour-science: illuminants, black bodies, lines, reflectances; XYZ, Rec. 709, ACEScg."""

import warnings

import numpy as np
import numpy.typing as npt
import pytest

import abbe

with warnings.catch_warnings():
    # It tells which of its own optional parts are missing.
    warnings.simplefilter("ignore")
    import colour

Array = npt.NDArray[np.float64]

NM = np.arange(360.0, 831.0)
OBSERVER: Array = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].values
TOLERANCE = 1e-4
# A path's wavelengths lie anywhere: what they converge to is the integral of what is linear between whole nanometres,
# not the sum over those. The two differ by a sixth of the product of both slopes per nm, which is 1.2e-4 for a black
# body of 1000 K and for the bands of FL11. So colour-science sums over eighths of nanometres here, a 64th of that off.
FINE = np.arange(360.0, 830.125, 0.125)
FINE_OBSERVER = colour.MultiSpectralDistributions(
    np.stack([np.interp(FINE, NM, OBSERVER[:, i]) for i in range(3)], axis=1), FINE
)
FINE_EQUAL = colour.sd_ones(colour.SpectralShape(360, 830, 0.125))


def table(distribution: colour.SpectralDistribution) -> Array:
    """Return its power at every nanometre; linear in between, 0 outside, as the CIE has its tables."""
    return np.interp(NM, distribution.wavelengths, distribution.values, left=0.0, right=0.0)


def tristimulus(power: Array) -> Array:
    distribution = colour.SpectralDistribution(np.interp(FINE, NM, power), FINE)
    # It counts in hundredths.
    return 100 * np.asarray(colour.sd_to_XYZ(distribution, FINE_OBSERVER, FINE_EQUAL, k=1, method="Integration"))


D65 = table(colour.SDS_ILLUMINANTS["D65"])
# Its table ends at 780 nm in some editions; white is what the renderer has.
WHITE = abbe.spectrum.illuminant("white", NM)


def rec709(xyz: Array) -> Array:
    """By the primaries of the standard, with the chromaticity of the D65 spectrum as white."""
    white = colour.XYZ_to_xy(tristimulus(WHITE))
    primaries = colour.RGB_COLOURSPACES["sRGB"].primaries
    return np.asarray(np.linalg.inv(colour.models.normalised_primary_matrix(primaries, white)) @ xyz)


def acescg(xyz: Array) -> Array:
    """From Rec. 709, whose white adapts by Bradford."""
    source, target = colour.RGB_COLOURSPACES["sRGB"].copy(), colour.RGB_COLOURSPACES["ACEScg"].copy()
    # Not the matrices that standards print with four digits.
    source.use_derived_transformation_matrices(True)
    target.use_derived_transformation_matrices(True)
    return np.asarray(colour.RGB_to_RGB(rec709(xyz), source, target, chromatic_adaptation_transform="Bradford"))


def compare(power: Array) -> None:
    """Compare all three spaces, the light scaled to Y = 1."""
    power = power / tristimulus(power)[1]
    xyz = tristimulus(power)
    for space, wanted in (
        ("lin_ciexyzd65_scene", xyz),
        ("lin_rec709_scene", rec709(xyz)),
        ("lin_ap1_scene", acescg(xyz)),
    ):
        found = abbe.spectrum.color(NM, power, space=space)
        np.testing.assert_allclose(
            found, wanted, rtol=0, atol=TOLERANCE * max(1.0, np.abs(wanted).max()), err_msg=space
        )


def test_white_is_one() -> None:
    for space in ("lin_rec709_scene", "lin_ap1_scene", "lin_rec2020_scene"):
        np.testing.assert_allclose(abbe.spectrum.color(NM, WHITE, space=space), 1, atol=1e-5)
    np.testing.assert_allclose(rec709(tristimulus(WHITE)), 1, atol=1e-5)


@pytest.mark.parametrize("name", ["A", "D50", "D55", "D65", "D75", "FL2", "FL7", "FL11", "E"])
def test_standard_illuminants(name: str) -> None:
    ours = abbe.spectrum.illuminant(name, NM)
    compare(ours)
    # The spectra themselves, where both have them.
    theirs = colour.SDS_ILLUMINANTS[name]
    inside = (theirs.shape.start <= NM) & (theirs.shape.end >= NM)
    ours, wanted = tristimulus(ours * inside), tristimulus(table(theirs) * inside)
    np.testing.assert_allclose(ours / ours[1], wanted / wanted[1], atol=TOLERANCE)


@pytest.mark.parametrize("kelvin", [1000, 2856, 6500, 20000])
def test_black_bodies(kelvin: float) -> None:
    power = abbe.spectrum.blackbody(kelvin, NM)
    compare(power)
    theirs = colour.sd_blackbody(kelvin, colour.SpectralShape(360, 830, 1))
    ours, wanted = tristimulus(power), tristimulus(theirs.values)
    np.testing.assert_allclose(ours / ours[1], wanted / wanted[1], atol=TOLERANCE)


@pytest.mark.parametrize("nm", [405.0, 436.0, 546.0, 588.0, 633.0, 700.0])
def test_lines_narrower_than_a_nanometre(nm: float) -> None:
    # A triangle of area 1 over a tenth of a nanometre.
    wavelengths, power = np.array([nm - 0.05, nm, nm + 0.05]), np.array([0.0, 20.0, 0.0])
    wanted = OBSERVER[int(nm - 360)]
    found = abbe.spectrum.color(wavelengths, power, space="XYZ", lines=True)
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE * wanted.max() + 2e-5)
    # Outside of the gamut: nothing is clipped.
    red, green, blue = abbe.spectrum.color(wavelengths, power, lines=True)
    np.testing.assert_allclose((red, green, blue), rec709(wanted), atol=4 * TOLERANCE * wanted.max() + 1e-4)
    assert min(red, green, blue) < 0


def test_color_checker() -> None:
    chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    assert len(chart) == 24
    for patch in chart.values():
        compare(np.interp(NM, patch.wavelengths, patch.values) * WHITE)


def test_colours_become_reflectances_that_have_them() -> None:
    chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    for patch in chart.values():
        rgb = rec709(tristimulus(np.interp(NM, patch.wavelengths, patch.values) * WHITE)).clip(0, 1)
        for exact in (True, False):
            spectrum = abbe.spectrum.reflectance(rgb, NM, exact=exact)
            assert ((spectrum >= 0) & (spectrum <= 1)).all()
            # 1e-5, and the difference of sum and integral.
            np.testing.assert_allclose(rec709(tristimulus(spectrum * WHITE)), rgb, atol=3e-5)


def test_what_is_no_spectrum_is_refused() -> None:
    for arguments, hint in (
        (([500.0, 400.0], [1.0, 1.0], {}), "increase"),
        (([500.0], [1.0, 1.0], {}), "as many"),
        (([500.0], [1.0], {"space": "sRGB"}), "lin_rec709_scene"),
    ):
        nanometers, power, options = arguments
        with pytest.raises(abbe.UsageError, match=hint):
            abbe.spectrum.color(nanometers, power, **options)
    with pytest.raises(abbe.UsageError, match="FL11"):
        abbe.spectrum.illuminant("F99", NM)
    with pytest.raises(abbe.UsageError, match="temperature"):
        abbe.spectrum.blackbody(-1, NM)
