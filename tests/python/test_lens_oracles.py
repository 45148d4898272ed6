"""Derivatives through whole lenses against traces that share nothing with the renderer: mpmath, an optics package."""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest

pytest.importorskip("pxr")
from abbe.cli import main
from abbe.prescription import read_prescription, stage_text

STAGES = Path(__file__).resolve().parents[2] / "stages"
TABLES = {
    "cooke": (STAGES / "cooke.csv").read_text(encoding="utf-8"),
    "double Gauss": (Path(__file__).parent / "stages" / "double_gauss.csv").read_text(encoding="utf-8"),
}
# The double Gauss with faces of every form that a prescription has; the numbers are ours.
TABLES["aspheric double Gauss"] = (
    TABLES["double Gauss"]
    .replace("stop\n", "stop, conic, a4, a6\n", 1)
    .replace("29,\n2", "29, , -0.4, 2e-8, -3e-12\n2")
    .replace("-28.37731, 3.8, SCHOTT:F5, 15,", "-28.37731, 3.8, SCHOTT:F5, 15, , -1, 1e-7,")
    .replace("-79.41143, 61.487536, , 23,", "-79.41143, 61.487536, , 23, , 2, -5e-8, 1e-11")
)
GLASS_SURFACES = {"cooke": 6, "double Gauss": 10, "aspheric double Gauss": 10}
REFERENCE = "587.5618"
# B and C (µm²), data sheets of SCHOTT.
SELLMEIER = {
    "SCHOTT:N-SK16": (("1.34317774", "0.241144399", "0.994317969"), ("0.00704687339", "0.0229005", "92.7508526")),
    "SCHOTT:F2": (("1.34533359", "0.209073176", "0.937357162"), ("0.00997743871", "0.0470450767", "111.886764")),
    "SCHOTT:N-SSK2": (("1.4306027", "0.153150554", "1.01390904"), ("0.00823982975", "0.0333736841", "106.870822")),
    "SCHOTT:N-SK2": (("1.28189012", "0.257738258", "0.96818604"), ("0.0072719164", "0.0242823527", "110.377773")),
    "SCHOTT:F5": (("1.3104463", "0.19603426", "0.96612977"), ("0.00958633048", "0.0457627627", "115.011883")),
}
PIXELS = [(320, 180), (330, 171), (311, 200), (345, 180), (318, 148), (300, 163)]


@pytest.fixture(scope="module")
def systems(tmp_path_factory):
    """Prescription and stage of every system, by name."""
    folder = tmp_path_factory.mktemp("lenses")
    found = {}
    for name, table in TABLES.items():
        (folder / f"{name}.csv").write_text(table, encoding="utf-8")
        prescription = read_prescription(folder / f"{name}.csv")
        (folder / f"{name}.usda").write_text(stage_text(prescription), encoding="utf-8")
        found[name] = (prescription, folder / f"{name}.usda")
    return found


def ior(glass, nanometers, real):
    """Sellmeier's law, in numbers of the type ``real``."""
    if glass is None:
        return real(1)
    square = (nanometers / real(1000)) ** 2
    b, c = SELLMEIER[glass]
    return (1 + sum(real(x) * square / (square - real(y)) for x, y in zip(b, c, strict=True))) ** real("0.5")


def traced(name, stage, pixel, capsys):
    """Return what the renderer says of a pixel, all digits."""
    assert main(["trace", str(stage), "--pixel", f"{pixel[0]},{pixel[1]}", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["interfaces"] == GLASS_SURFACES[name] and told["total_reflections"] == 0
    assert told["end"]["prim"] == "/World/Image" and told["wavelength_nm"] == float(REFERENCE)
    column = told["columns"]["lambda"]
    # In air K' = d'.
    return (
        np.array(told["camera"]),
        np.array(told["direction"]),
        np.array(column["point"]),
        np.array(column["momentum"]),
    )


def sag(surface, square):
    """Height of a face over its vertex and its slope by r², at r² = ``square``."""
    mpf = mpmath.mpf
    c, k = mpf(surface.curvature), mpf(surface.conic)
    root = mpmath.sqrt(1 - (1 + k) * c**2 * square)
    height, slope = c * square / (1 + root), c / (2 * root)
    for power, a in enumerate(surface.aspheres, 2):
        height += mpf(a) * square**power
        slope += mpf(a) * power * square ** (power - 1)
    return height, slope


def sequential(prescription, origin, direction, nanometers):
    """Follow the prescription surface by surface with mpmath: Newton from the vertex plane, Snell's law for vectors."""
    mpf = mpmath.mpf
    p, d = mpmath.matrix([mpf(x) for x in origin]), mpmath.matrix([mpf(x) for x in direction])
    d /= mpmath.norm(d)
    vertex, before = mpf(0), mpf(1)
    for surface in prescription.surfaces:
        p += (vertex - p[2]) / d[2] * d
        for _ in range(12):
            height, slope = sag(surface, p[0] ** 2 + p[1] ** 2)
            gradient = mpmath.matrix([-2 * slope * p[0], -2 * slope * p[1], 1])
            p -= (p[2] - vertex - height) / mpmath.fdot(gradient, d) * d
        assert abs(p[2] - vertex - sag(surface, p[0] ** 2 + p[1] ** 2)[0]) < mpf(10) ** -50
        normal = gradient / mpmath.norm(gradient)
        after = ior(surface.glass, nanometers, mpf)
        cosine = before * mpmath.fdot(d, normal)
        d = (before * d + (mpmath.sqrt(after**2 - before**2 + cosine**2) - cosine) * normal) / after
        vertex, before = vertex + mpf(surface.thickness), after
    return p + (mpf(prescription.image) - p[2]) / d[2] * d, d


@pytest.mark.parametrize("pixel", PIXELS)
@pytest.mark.parametrize("name", TABLES)
def test_lenses_agree_with_a_trace_in_sixty_digits(name, pixel, systems, capsys):
    prescription, stage = systems[name]
    origin, direction, point, turn = traced(name, stage, pixel, capsys)
    with mpmath.workdps(60):
        step = mpmath.mpf(10) ** -20
        ends = [sequential(prescription, origin, direction, mpmath.mpf(REFERENCE) + sign * step) for sign in (1, -1)]
        exact = [
            np.array([float((a - b) / (2 * step)) for a, b in zip(*pair, strict=True)])
            for pair in zip(*ends, strict=True)
        ]
    for ours, theirs in zip((point, turn), exact, strict=True):
        assert np.linalg.norm(ours - theirs) < 1e-9 * np.linalg.norm(theirs)


@pytest.mark.parametrize("pixel", PIXELS)
@pytest.mark.parametrize("name", TABLES)
def test_lenses_agree_with_an_optics_package(name, pixel, systems, capsys):
    raytrace = pytest.importorskip("rayoptics.raytr.raytrace", reason="rayoptics is not installed: no third opinion")
    from opticalglass.opticalmedium import Air
    from rayoptics.elem.profiles import EvenPolynomial, Spherical
    from rayoptics.elem.surface import Surface
    from rayoptics.seq.gap import Gap

    prescription, stage = systems[name]
    origin, direction, point, turn = traced(name, stage, pixel, capsys)

    def at(nanometers):
        def profile(surface):
            if surface.conic == 0.0 and not surface.aspheres:
                return Spherical(c=surface.curvature)
            # Its first coefficient is that of r².
            return EvenPolynomial(c=surface.curvature, cc=surface.conic, coefs=[0.0, *surface.aspheres])

        def row(profile, gap, index):
            transform = (np.identity(3), np.array([0.0, 0.0, gap]))
            return Surface(profile=profile), Gap(gap, Air()), transform, index, 1.0

        path = [row(Spherical(c=0.0), -origin[2], 1.0)]
        path += [row(profile(s), s.thickness, ior(s.glass, nanometers, float)) for s in prescription.surfaces]
        path.append((Surface(profile=Spherical(c=0.0)), None, None, 1.0, 1.0))
        start = np.array([origin[0], origin[1], 0.0])
        ray = raytrace.trace_raw(iter(path), start, direction, nanometers, eps=1e-15)[0]
        return np.array([ray[-1][0], ray[-2][1]])

    # Central differences of the eighth order: what doubles can tell.
    h, weights = 6.0, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    centre = float(REFERENCE)
    slopes = sum(w * (at(centre + k * h) - at(centre - k * h)) for k, w in enumerate(weights, 1)) / h
    for ours, theirs in zip((point, turn), slopes, strict=True):
        # Rounding of the difference: a few units in the last place of the way through the lens, by the step.
        floor = 1e-14 * prescription.image / h if theirs is slopes[0] else 1e-15 / h
        assert np.linalg.norm(ours - theirs) < 1e-9 * np.linalg.norm(theirs) + floor
