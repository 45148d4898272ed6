"""The Cooke triplet's derivatives against traces that share nothing with the renderer: mpmath and an optics package."""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest

pytest.importorskip("pxr")
from abbe.cli import main
from abbe.prescription import read_prescription

STAGES = Path(__file__).resolve().parents[2] / "stages"
TRIPLET = read_prescription(STAGES / "cooke.csv")
REFERENCE = "587.5618"
# B and C (µm²), data sheets of SCHOTT.
SELLMEIER = {
    "SCHOTT:N-SK16": (("1.34317774", "0.241144399", "0.994317969"), ("0.00704687339", "0.0229005", "92.7508526")),
    "SCHOTT:F2": (("1.34533359", "0.209073176", "0.937357162"), ("0.00997743871", "0.0470450767", "111.886764")),
}
PIXELS = [(320, 180), (330, 171), (311, 200), (345, 180), (318, 148), (300, 163)]


def ior(glass, nanometers, real):
    """Sellmeier's law, in numbers of the type ``real``."""
    if glass is None:
        return real(1)
    square = (nanometers / real(1000)) ** 2
    b, c = SELLMEIER[glass]
    return (1 + sum(real(x) * square / (square - real(y)) for x, y in zip(b, c, strict=True))) ** real("0.5")


def traced(pixel, capsys):
    """Return what the renderer says of a pixel, all digits."""
    arguments = ["trace", str(STAGES / "cooke.usda"), "--pixel", f"{pixel[0]},{pixel[1]}", "--json"]
    assert main(arguments) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["interfaces"] == 6 and told["total_reflections"] == 0
    assert told["end"]["prim"] == "/World/Image" and told["wavelength_nm"] == float(REFERENCE)
    column = told["columns"]["lambda"]
    # In air K' = d'.
    return (
        np.array(told["camera"]),
        np.array(told["direction"]),
        np.array(column["point"]),
        np.array(column["momentum"]),
    )


def sequential(origin, direction, nanometers):
    """Follow the prescription surface by surface with mpmath; spheres in closed form, Snell's law for vectors."""
    mpf = mpmath.mpf
    p, d = mpmath.matrix([mpf(x) for x in origin]), mpmath.matrix([mpf(x) for x in direction])
    d /= mpmath.norm(d)
    vertex, before = mpf(0), mpf(1)
    for surface in TRIPLET.surfaces:
        centre = mpmath.matrix([0, 0, vertex + 1 / mpf(surface.curvature)])
        offset, radius = p - centre, 1 / mpf(surface.curvature)
        along = mpmath.fdot(offset, d)
        root = mpmath.sqrt(along**2 - mpmath.fdot(offset, offset) + radius**2)
        # The crossing next to the vertex.
        p += (-along - root if radius > 0 else -along + root) * d
        normal = (centre - p) / radius
        after = ior(surface.glass, nanometers, mpf)
        cosine = before * mpmath.fdot(d, normal)
        d = (before * d + (mpmath.sqrt(after**2 - before**2 + cosine**2) - cosine) * normal) / after
        vertex, before = vertex + mpf(surface.thickness), after
    return p + (mpf(TRIPLET.image) - p[2]) / d[2] * d, d


@pytest.mark.parametrize("pixel", PIXELS)
def test_the_triplet_agrees_with_a_trace_in_sixty_digits(pixel, capsys):
    origin, direction, point, turn = traced(pixel, capsys)
    with mpmath.workdps(60):
        step = mpmath.mpf(10) ** -20
        ends = [sequential(origin, direction, mpmath.mpf(REFERENCE) + sign * step) for sign in (1, -1)]
        exact = [
            np.array([float((a - b) / (2 * step)) for a, b in zip(*pair, strict=True)])
            for pair in zip(*ends, strict=True)
        ]
    for ours, theirs in zip((point, turn), exact, strict=True):
        assert np.linalg.norm(ours - theirs) < 1e-9 * np.linalg.norm(theirs)


@pytest.mark.parametrize("pixel", PIXELS)
def test_the_triplet_agrees_with_an_optics_package(pixel, capsys):
    raytrace = pytest.importorskip("rayoptics.raytr.raytrace", reason="rayoptics is not installed: no third opinion")
    from opticalglass.opticalmedium import Air
    from rayoptics.elem.profiles import Spherical
    from rayoptics.elem.surface import Surface
    from rayoptics.seq.gap import Gap

    origin, direction, point, turn = traced(pixel, capsys)

    def at(nanometers):
        def row(curvature, gap, index):
            transform = (np.identity(3), np.array([0.0, 0.0, gap]))
            return Surface(profile=Spherical(c=curvature)), Gap(gap, Air()), transform, index, 1.0

        path = [row(0.0, -origin[2], 1.0)]
        path += [row(s.curvature, s.thickness, ior(s.glass, nanometers, float)) for s in TRIPLET.surfaces]
        path.append((Surface(profile=Spherical(c=0.0)), None, None, 1.0, 1.0))
        start = np.array([origin[0], origin[1], 0.0])
        ray = raytrace.trace_raw(iter(path), start, direction, nanometers, eps=1e-15)[0]
        return np.array([ray[-1][0], ray[-2][1]])

    # Central differences of the eighth order: what doubles can tell.
    h, weights = 6.0, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    centre = float(REFERENCE)
    slopes = sum(w * (at(centre + k * h) - at(centre - k * h)) for k, w in enumerate(weights, 1)) / h
    for ours, theirs in zip((point, turn), slopes, strict=True):
        # Rounding of the difference: a few units in the last place of 60 mm, by the step.
        floor = 1e-14 * 60 / h if theirs is slopes[0] else 1e-15 / h
        assert np.linalg.norm(ours - theirs) < 1e-9 * np.linalg.norm(theirs) + floor
