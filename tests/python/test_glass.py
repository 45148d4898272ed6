"""The catalogue from Python and the command line: laws against multi-precision arithmetic, search, fits, bad input."""

import json
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf

import abbe
from abbe import glass_match
from abbe.catalog import LINES, Glass

Result = subprocess.CompletedProcess[str]
Run = Callable[..., Result]

# Of ∂n/∂λ and ∂²n/∂λ², relative.
TOLERANCE = 1e-10


# Laws


def permittivity(number: int, c: list[mpf], x: mpf) -> mpf:
    """n² by refractiveindex.info's formulas ("Dispersion formulas", M. N. Polyanskiy), written down again from there.

    Two of them give n instead and are squared here.
    """
    pairs = list(zip(c[1::2], c[2::2], strict=False))
    if number == 1:
        return 1 + c[0] + sum((b * x**2 / (x**2 - d**2) for b, d in pairs), mpf(0))
    if number == 2:
        return 1 + c[0] + sum((b * x**2 / (x**2 - d) for b, d in pairs), mpf(0))
    if number == 3:
        return c[0] + sum((b * x**e for b, e in pairs), mpf(0))
    if number == 4:
        resonances = [c[i] * x ** c[i + 1] / (x**2 - c[i + 2] ** c[i + 3]) for i in range(1, min(len(c), 9), 4)]
        powers = [b * x**e for b, e in zip(c[9::2], c[10::2], strict=False)]
        return c[0] + sum(resonances + powers, mpf(0))
    if number == 5:
        return (c[0] + sum((b * x**e for b, e in pairs), mpf(0))) ** 2
    if number == 6:
        return (1 + c[0] + sum((b / (d - x**-2) for b, d in pairs), mpf(0))) ** 2
    if number == 9:
        return c[0] + c[1] / (x**2 - c[2]) + c[3] * (x - c[4]) / ((x - c[4]) ** 2 + c[5])
    raise ValueError(f"an entry of the catalogue has formula {number}, which this oracle has to state too")


def exact(glass: Glass, nm: float) -> tuple[mpf, mpf, mpf]:
    """n, ∂n/∂λ and ∂²n/∂λ² per nm, by central differences in 60 digits: their error is 1e-30."""
    law = glass.source_law
    assert law.formula is not None
    c = [mpf(value) for value in law.coefficients]
    c += [mpf(0)] * (9 - len(c)) if law.formula == 4 else []

    def n(nm: mpf) -> mpf:
        return mp.sqrt(permittivity(law.formula or 0, c, nm / 1000))

    at, step = mpf(nm), mpf(10) ** -15
    left, middle, right = n(at - step), n(at), n(at + step)
    return middle, (right - left) / (2 * step), (right - 2 * middle + left) / step**2


def test_every_formula_has_its_derivatives() -> None:
    checked, formulas = 0, set()
    with mp.workdps(60):
        for glass in abbe.glasses():
            law = glass.source_law
            if law.formula is None:
                continue
            formulas.add(law.formula)
            low, high = glass.valid_range
            for line in "dFCeg":
                nm = LINES[line]
                if not low <= nm <= high:
                    continue
                for wanted, value in zip(
                    exact(glass, nm), (glass.ior(nm), glass.dior_dlambda(nm), glass.d2ior_dlambda2(nm)), strict=True
                ):
                    assert abs(value - wanted) <= TOLERANCE * abs(wanted), f"{glass.name} at {line}: {value}, {wanted}"
                checked += 1
    assert checked > 8000
    assert formulas >= {1, 2, 3, 4, 5, 6, 9}


def test_every_table_is_met_and_is_the_not_a_knot_spline() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    checked = 0
    for glass in abbe.glasses():
        law = glass.source_law
        if law.formula is not None:
            continue
        nm, n = np.array(law.coefficients).reshape(-1, 2).T
        assert np.max(np.abs(glass.ior(nm) - n)) <= 4e-16 * np.max(n), glass.name
        spline = interpolate.CubicSpline(nm, n)
        at = np.linspace(nm[0], nm[-1], 97)
        for order, values in enumerate((glass.ior(at), glass.dior_dlambda(at), glass.d2ior_dlambda2(at))):
            wanted = spline(at, order)
            # Both are double precision: the same digits, up to what cancels in differences of the entries.
            assert np.max(np.abs(values - wanted)) <= TOLERANCE * np.max(np.abs(spline(nm, order))), (glass.name, order)
        checked += 1
    assert checked > 150


# Objects


def test_a_glass_tells_what_it_is() -> None:
    glass = abbe.glass("schott: n-bk7")
    assert (glass.name, glass.bare_name, glass.maker) == ("SCHOTT:N-BK7", "N-BK7", "SCHOTT")
    assert (glass.category, glass.status, glass.is_metal) == ("glass", "preferred", False)
    assert glass.page == "specs/SCHOTT-optical/N-BK7"
    assert "SCHOTT Zemax catalog" in glass.source and "v2026-05-24" in glass.source
    assert glass.url == "https://refractiveindex.info/?shelf=specs&book=SCHOTT-optical&page=N-BK7"
    assert glass.valid_range == (300.0, 2500.0)
    assert glass.stated == (1.5168, 64.17)
    # SCHOTT's data sheet.
    assert glass.nd == pytest.approx(1.51680, abs=5e-6)
    assert glass.abbe_number == pytest.approx(64.17, abs=5e-3)
    assert glass.partial_dispersion("g", "F") == pytest.approx(0.5349, abs=5e-5)
    assert glass.internal_transmittance(365.0, 25.0) == pytest.approx(0.971, abs=5e-4)
    assert glass.internal_transmittance(400.0) == pytest.approx(0.997, abs=5e-4)
    assert glass.internal_transmittance(400.0, 0.0) == 1.0
    assert glass.dispersion.ior(600.0) == glass.ior(600.0)
    assert repr(glass) == "<abbe.Glass SCHOTT:N-BK7: n_d 1.5168, V_d 64.17>"
    assert glass == abbe.glass("N-BK7") and hash(glass) == hash(abbe.glass("N-BK7")) and glass != abbe.glass("N-BK10")


def test_the_page_of_a_formula_gives_the_same_index() -> None:
    glass = abbe.glass("SCHOTT:N-SF11")
    law = glass.source_law
    assert law.formula == 2 and law.coefficients[0] == 0.0
    nm = np.linspace(380.0, 2300.0, 50)
    same = abbe.Dispersion.sellmeier(law.coefficients[1::2], law.coefficients[2::2])
    np.testing.assert_array_equal(glass.ior(nm), same.ior(nm))


def test_arrays_keep_their_shape() -> None:
    glass = abbe.glass("gold")
    nm = np.array([[450.0, 500.0, 550.0], [600.0, 650.0, 700.0]])
    for method in (glass.ior, glass.dior_dlambda, glass.d2ior_dlambda2, glass.extinction, glass.internal_transmittance):
        assert method(nm).shape == nm.shape
        assert isinstance(method(500.0), float)
        np.testing.assert_array_equal(method(nm)[1, 2], method(700.0))


def test_metals_have_n_and_k() -> None:
    # Johnson and Christy 1972, as their table prints it.
    gold = abbe.glass("gold")
    assert gold.is_metal
    assert gold.ior(548.6) == pytest.approx(0.43, abs=1e-15) and gold.extinction(548.6) == 2.455
    # Straight lines between the entries, the last value outside.
    assert gold.extinction((548.6 + 582.1) / 2) == pytest.approx((2.455 + 2.863) / 2, rel=1e-14)
    table = gold.extinction_table
    assert table is not None and gold.extinction(5000.0) == table[-1, 1] and gold.extinction(50.0) == table[0, 1]


def test_outside_of_the_valid_range() -> None:
    low, high = abbe.glass("SCHOTT:N-BK7").valid_range
    with pytest.raises(abbe.UsageError, match=r"SCHOTT:N-BK7: n\(λ\) is known from 300 to 2500 nm, not at 299 nm"):
        abbe.glass("SCHOTT:N-BK7").ior([400.0, 299.0])
    clamped = abbe.glass("SCHOTT:N-BK7", out_of_range="clamp")
    assert clamped.ior(200.0) == clamped.ior(low) and clamped.dior_dlambda(200.0) == 0.0
    assert clamped.ior(9000.0) == clamped.ior(high)
    free = abbe.glass("SCHOTT:N-BK7", out_of_range="extrapolate")
    assert free.ior(280.0) > free.ior(low) and free.dior_dlambda(280.0) < 0.0


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: abbe.glass("SCHOTT:N-BK77"), "did you mean SCHOTT:N-BK7"),
        (lambda: abbe.glass("F2"), "SCHOTT:F2"),
        (lambda: abbe.glass(""), "no name is given"),
        (lambda: abbe.glass("N-BK7", out_of_range="wrap"), "out_of_range: "),  # type: ignore[arg-type]
        (lambda: abbe.glass("diamond").extinction(500.0), r"diamond:Peter: its source has no k\(λ\)"),
        (lambda: abbe.glass("N-BK7").extinction(-1.0), "wavelength: "),
        (lambda: abbe.glass("N-BK7").extinction(math.nan), "wavelength: "),
        (lambda: abbe.glass("N-BK7").ior(math.nan), "wavelength: "),
        (lambda: abbe.glass("N-BK7").internal_transmittance(500.0, -1.0), "thickness_mm: "),
        (lambda: abbe.glass("N-BK7").partial_dispersion("q"), "line: "),
        (lambda: abbe.glasses(maker="Zeiss"), "maker: "),
        (lambda: abbe.glasses(category="wood"), "category: "),
        (lambda: abbe.glasses(status="sold out"), "status: "),
        (lambda: abbe.glasses(nd=(2.0, 1.0)), "nd: "),
        (lambda: abbe.nearest_glass(math.nan), "nd: "),
        (lambda: abbe.nearest_glass(0.0), "nd: "),
    ],
)
def test_bad_requests_are_usage_errors(call: Callable[[], object], text: str) -> None:
    with pytest.raises(abbe.UsageError, match=text):
        call()


def test_search() -> None:
    everything = abbe.glasses()
    assert len(everything) > 1900
    assert [glass.name for glass in everything] == sorted(glass.name for glass in everything)
    assert {glass.name for glass in abbe.glasses("n-bk7*")} >= {"SCHOTT:N-BK7", "SCHOTT:N-BK7HT"}
    assert [glass.name for glass in abbe.glasses("schott:n-bk7")][:1] == ["SCHOTT:N-BK7"]
    assert all(glass.maker == "OHARA" for glass in abbe.glasses(maker="ohara"))
    assert {glass.category for glass in abbe.glasses(category="metal")} == {"metal"}
    assert {glass.status for glass in abbe.glasses(status="obsolete")} == {"obsolete"}
    found = abbe.glasses(maker="SCHOTT", nd=(1.6, 1.7), vd=(None, 40.0))
    assert found and all(1.6 <= g.nd <= 1.7 and g.abbe_number is not None and g.abbe_number <= 40 for g in found)
    assert abbe.glasses("no such thing") == []


def test_nearest_glass_is_clear_and_near() -> None:
    for nd in (1.33, 1.45, 1.5, 1.5168, 1.6, 1.7, 1.85, 2.0, 2.4175):
        glass = abbe.nearest_glass(nd)
        assert abs(glass.nd - nd) < 0.005
        assert glass.category in ("glass", "crystal", "plastic", "liquid")
        if glass.extinction_table is not None:
            assert glass.internal_transmittance(LINES["d"]) > 0.5


# Fits


def test_a_fit_finds_the_law_that_made_the_points() -> None:
    nm = np.linspace(400.0, 700.0, 13)
    cauchy = glass_match.fit_cauchy(nm, abbe.Dispersion.cauchy(1.5046, 0.0042, 1e-5).ior(nm))
    # The coefficients are printed with ten digits.
    assert cauchy.coefficients["cauchy"] == pytest.approx((1.5046, 0.0042, 1e-5), rel=1e-6)
    assert cauchy.largest < 1e-9
    glass = abbe.glass("SCHOTT:N-BK7")
    for terms, most in ((1, 2e-3), (2, 1e-5), (3, 1e-6)):
        fit = glass_match.fit_sellmeier(nm, glass.ior(nm), terms)
        assert fit.largest < most, (terms, fit.largest)
        assert fit.rms <= fit.largest
        # The residual is that of the coefficients as printed.
        again = abbe.Dispersion.sellmeier(fit.coefficients["sellmeier:b"], fit.coefficients["sellmeier:c"])
        assert np.max(np.abs(again.ior(nm) - glass.ior(nm))) == pytest.approx(fit.largest, abs=1e-15)


@pytest.mark.parametrize("name", ["SCHOTT:N-SF66", "OHARA:S-FPL53", "diamond", "water", "PMMA", "sapphire"])
def test_fits_of_real_glasses_have_no_pole_in_the_visible(name: str) -> None:
    glass = abbe.glass(name)
    low, high = glass.valid_range
    nm = np.linspace(max(low, 400.0), min(high, 700.0), 16)
    noise = 1e-5 * np.cos(np.arange(16.0) * 2.3)
    for fit in (
        glass_match.fit_cauchy(nm, glass.ior(nm) + noise),
        glass_match.fit_sellmeier(nm, glass.ior(nm) + noise),
    ):
        assert np.all(np.isfinite(fit.dispersion.ior(np.linspace(360.0, 830.0, 471))))
        # Three terms of Cauchy's, and two of Sellmeier's, miss a dense flint's violet.
        assert fit.rms < (5e-4 if fit.law == "cauchy" else 5e-5)


def test_matching_finds_the_glass_itself() -> None:
    for name in ("SCHOTT:N-SF6", "OHARA:S-LAH79", "HOYA:TAFD55", "diamond:Peter"):
        glass = abbe.glass(name)
        nm = np.linspace(420.0, 680.0, 9)
        best = glass_match.match_points(nm, glass.ior(nm), count=3)
        assert best[0].distance == 0.0 and glass.name in [match.glass.name for match in best if match.distance == 0.0]
        best = glass_match.match_numbers(glass.nd, glass.abbe_number, count=3)
        # (n_d − 1)/V_d rounds.
        assert best[0].distance < 1e-14 and glass.name in [m.glass.name for m in best if m.distance < 1e-14]
        assert [match.distance for match in best] == sorted(match.distance for match in best)


# Command line


def said(result: Result, code: int, place: str) -> None:
    assert result.returncode == code, result.stderr
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"abbe: {place}"), result.stderr
    assert "Traceback" not in result.stderr


def test_list(run: Run) -> None:
    result = run("glass", "list", "--maker", "schott", "--nd", "1.51:1.52", "--vd", "60:")
    assert result.returncode == 0, result.stderr
    assert any(line.startswith("SCHOTT:N-BK7 ") and "1.516800" in line for line in result.stdout.splitlines())
    records = json.loads(run("glass", "list", "gold*", "--json").stdout)
    assert "gold:Johnson" in [record["name"] for record in records]
    assert {"name", "nd", "vd", "category", "status", "valid_range_nm", "reference", "url"} <= records[0].keys()
    result = run("glass", "list", "no such thing")
    assert result.returncode == 0 and result.stdout == "" and "nothing in the catalogue" in result.stderr


def test_show(run: Run, tmp_path: Path) -> None:
    result = run("glass", "show", "n-bk7", "--wavelengths", "500:600:50", "--thickness", "5")
    assert result.returncode == 0, result.stderr
    for text in ("SCHOTT:N-BK7", "V_d 64.167", "P_gF 0.5349", "formula 2", "300 to 2500 nm", "Zemax catalog", "τ 5 mm"):
        assert text in result.stdout
    assert [line.split()[0] for line in result.stdout.splitlines()[-3:]] == ["500.0000", "550.0000", "600.0000"]
    record = json.loads(run("glass", "show", "gold", "--json").stdout)
    assert record["name"] == "gold:Johnson" and record["license"] == "CC0-1.0"
    assert {"nm", "ior", "dior_dlambda", "d2ior_dlambda2", "k"} == record["curve"][0].keys()
    glass = abbe.glass("gold")
    for row in record["curve"]:
        assert row["ior"] == glass.ior(row["nm"]) and row["k"] == glass.extinction(row["nm"])


@pytest.mark.parametrize(
    ("name", "file", "begins"),
    [("N-SF11", "a.png", b"\x89PNG"), ("silver", "a.svg", b"<?xml"), ("diamond", "a.pdf", b"%PDF")],
)
def test_plots(run: Run, tmp_path: Path, name: str, file: str, begins: bytes) -> None:
    pytest.importorskip("matplotlib")
    result = run("glass", "show", name, "--plot", file)
    assert result.returncode == 0, result.stderr
    first = (tmp_path / file).read_bytes()
    assert first.startswith(begins)
    if name == "silver":
        assert run("glass", "show", name, "--plot", file).returncode == 0
        assert (tmp_path / file).read_bytes() == first


def test_match_by_numbers(run: Run) -> None:
    result = run("glass", "match", "--nd", "1.5168", "--vd", "64.17", "--maker", "SCHOTT", "--count", "3")
    assert result.returncode == 0, result.stderr
    assert len(result.stdout.splitlines()) == 4
    assert result.stdout.splitlines()[1].startswith("SCHOTT:N-BK7")
    record = json.loads(run("glass", "match", "--nd", "2.4175", "--count", "1", "--json").stdout)
    assert record["fits"] == [] and record["glasses"][0]["name"] == "diamond:Peter"


def test_match_by_points(run: Run, tmp_path: Path) -> None:
    nm = np.linspace(400.0, 700.0, 7)
    rows = [f"{x},{n:.5f}" for x, n in zip(nm, abbe.glass("SCHOTT:N-SF11").ior(nm), strict=True)]
    (tmp_path / "n.csv").write_text("\n".join(["nm,n", "# measured", *rows, ""]))
    result = run("glass", "match", "--data", "n.csv", "--count", "3")
    assert result.returncode == 0, result.stderr
    for text in (
        "cauchy, 3 terms: residual rms",
        "sellmeier, 3 terms",
        "uniform double[] abbe:dispersion:sellmeier:c = [",
    ):
        assert text in result.stdout
    assert "SCHOTT:N-SF11" in result.stdout
    record = json.loads(run("glass", "match", "--data", "n.csv", "--terms", "2", "--json").stdout)
    assert [fit["law"] for fit in record["fits"]] == ["cauchy", "sellmeier"]
    assert record["fits"][1]["max"] < 2e-5 and record["fits"][1]["nd"] == pytest.approx(1.78472, abs=2e-5)


def test_fits_paste_into_a_stage(run: Run, tmp_path: Path) -> None:
    nm = np.linspace(400.0, 700.0, 7)
    rows = [f"{x} {n:.6f}" for x, n in zip(nm, abbe.glass("N-BK7").ior(nm), strict=True)]
    (tmp_path / "n.txt").write_text("\n".join(rows))
    record = json.loads(run("glass", "match", "--data", "n.txt", "--json").stdout)
    sdf = pytest.importorskip("pxr.Sdf")
    for fit in record["fits"]:
        layer = sdf.Layer.CreateAnonymous(".usda")
        body = "\n".join(f"    {line}" for line in fit["usda"])
        assert layer.ImportFromString(f'#usda 1.0\ndef Material "Glass"\n{{\n{body}\n}}\n')
        for name, values in fit["coefficients"].items():
            attribute = layer.GetAttributeAtPath(f"/Glass.abbe:dispersion:{name}")
            assert list(attribute.default) == values


@pytest.mark.parametrize(
    ("arguments", "place"),
    [
        (["show", "SCHOTT:N-BK77"], 'glass: "SCHOTT:N-BK77" is not in the catalogue: did you mean SCHOTT:N-BK7'),
        (["show", "F2"], 'glass: "F2" is the name of several: '),
        (["show", "N-BK7", "--wavelengths", "100"], "--wavelengths: SCHOTT:N-BK7: n(λ) is known from 300 to 2500 nm"),
        (["show", "N-BK7", "--wavelengths", "a,b"], "--wavelengths: "),
        (["show", "N-BK7", "--wavelengths", "700:400:10"], "--wavelengths: "),
        (["show", "N-BK7", "--wavelengths", "400:700:1e-9"], "--wavelengths: "),
        (["show", "N-BK7", "--thickness", "0"], "--thickness: "),
        (["list", "--nd", "1.5"], "--nd: "),
        (["list", "--nd", "1.7:1.5"], "--nd: "),
        (["list", "--vd", ":"], "--vd: "),
        (["list", "--maker", "Zeiss"], "--maker: there is no 'Zeiss', but "),
        (["list", "--category", "wood"], "--category: "),
        (["match"], "--nd: "),
        (["match", "--vd", "60"], "--nd: "),
        (["match", "--nd", "0"], "--nd: "),
        (["match", "--nd", "nan"], "--nd: "),
        (["match", "--nd", "1.5", "--vd", "-3"], "--vd: "),
        (["match", "--nd", "1.5", "--data", "n.csv"], "--nd: "),
        (["match", "--nd", "1.5", "--terms", "2"], "--terms: "),
        (["match", "--nd", "1.5", "--count", "0"], "--count: "),
        (["match", "--nd", "1.5", "--maker", "Zeiss"], "--maker: "),
        (["wipe"], "ACTION: "),
        ([], ""),
    ],
)
def test_what_is_not_understood_is_a_usage_error(run: Run, arguments: list[str], place: str) -> None:
    said(run("glass", *arguments), 2, place)


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (None, "n.csv: "),
        (b"", "n.csv: has no line of nm,n"),
        (b"nm,n\n", "n.csv: has no line of nm,n"),
        (b"500,1.5\n500,1.6\n", "n.csv: points: 500 nm stands twice"),
        (b"0.5,1.5\n0.6,1.4\n", "n.csv: points: wavelengths are in nm; 0.5 looks like µm"),
        (b"500,-1.5\n", "n.csv: points: an index is -1.5"),
        (b"500,nan\n", "n.csv: points: must be finite"),
        (b"500,1.5\n600,one\n", "n.csv: line 2, '600,one', is not nm,n"),
        (b"500,1.5,7\n600,1.5,7\n", "n.csv: line 2"),
        (b"\xff\xfe\x00\x01", "n.csv: is no text file"),
    ],
)
def test_bad_files(run: Run, tmp_path: Path, content: bytes | None, place: str) -> None:
    if content is not None:
        (tmp_path / "n.csv").write_bytes(content)
    result = run("glass", "match", "--data", "n.csv")
    said(result, 1 if content is None else 2, place if content is not None else "")
    assert "n.csv" in result.stderr


def test_what_cannot_be_written_is_an_error(run: Run, tmp_path: Path) -> None:
    said(run("glass", "show", "N-BK7", "--plot", "nowhere/a.png"), 1, "nowhere/a.png: ")
    said(run("glass", "show", "N-BK7", "--plot", "a.bmp"), 1, "a.bmp: ")
    assert list(tmp_path.iterdir()) == []


def test_one_point_is_matched_and_two_laws_say_why_not(run: Run, tmp_path: Path) -> None:
    (tmp_path / "n.csv").write_text("587.5618,1.5168\n")
    result = run("glass", "match", "--data", "n.csv", "--count", "2")
    assert result.returncode == 0, result.stderr
    assert "no fit by sellmeier" in result.stderr
    assert "cauchy, 1 term: residual rms" in result.stdout
