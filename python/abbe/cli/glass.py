"""``abbe glass``: the catalogue of glasses and other optical materials."""

from __future__ import annotations

import argparse
import json
import math
import re
from collections.abc import Sequence
from typing import Any

from .. import catalog, glass_match
from ..catalog import CATEGORIES, LINES, STATUSES, Glass
from ..errors import AbbeError, UsageError
from . import messages

# Printed of the makers' lines where the source covers them.
_SHOWN_LINES = ("i", "h", "g", "F'", "F", "e", "d", "C'", "C", "r", "s")


def _range(text: str) -> tuple[float | None, float | None]:
    """Parse LO:HI, either side of which may be left out."""
    low, colon, high = text.partition(":")
    try:
        values = (float(low) if low else None, float(high) if high else None)
    except ValueError:
        values, colon = (None, None), ""
    if not colon or values == (None, None) or any(v is not None and not math.isfinite(v) for v in values):
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form LO:HI, LO: or :HI")
    return values


def _wavelengths(text: str) -> list[float]:
    """Parse 400,500,600 or 400:700:50."""
    try:
        if ":" in text:
            low, high, step = map(float, text.split(":"))
            if not (0 < low <= high and step > 0 and (high - low) / step <= 10000 and math.isfinite(high)):
                raise ValueError
            return [low + i * step for i in range(math.floor((high - low) / step * (1 + 1e-12)) + 1)]
        values = [float(part) for part in text.split(",")]
        if not all(0 < value < math.inf for value in values):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form NM,NM… or FROM:TO:STEP") from None
    return values


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"'{text}' is no positive number")
    return value


def _count(text: str) -> int:
    if not re.fullmatch(r"[1-9]\d{0,6}", text):
        raise argparse.ArgumentTypeError(f"'{text}' is no positive count")
    return int(text)


def _add_selection(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--maker", metavar="NAME", help="SCHOTT, OHARA, HOYA, CDGM, HIKARI, SUMITA …")
    parser.add_argument("--category", choices=CATEGORIES, help="what it is")
    parser.add_argument("--status", choices=STATUSES, help="what the maker says about the supply")


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("glass", help="find glasses and other materials, and show them", allow_abbrev=False)
    actions = parser.add_subparsers(metavar="ACTION", required=True)

    listing = actions.add_parser("list", help="list the catalogue", allow_abbrev=False)
    listing.add_argument(
        "pattern", nargs="?", metavar="PATTERN", help="part of a name or title, or all of a name with * and ?"
    )
    _add_selection(listing)
    listing.add_argument("--nd", type=_range, metavar="LO:HI", help="index at the d line")
    listing.add_argument("--vd", type=_range, metavar="LO:HI", help="Abbe number")
    listing.add_argument("--json", action="store_true", help="as JSON")
    listing.set_defaults(run=run_list)

    showing = actions.add_parser("show", help="show one material", allow_abbrev=False)
    showing.add_argument("name", metavar="NAME", help="such as SCHOTT:N-BK7, N-BK7, diamond, gold")
    showing.add_argument(
        "--wavelengths",
        type=_wavelengths,
        metavar="NM,NM…|FROM:TO:STEP",
        help="where the curve is printed; the makers' lines unless given",
    )
    showing.add_argument("--thickness", type=_positive, default=10.0, metavar="MM", help="of transmittances; 10")
    showing.add_argument("--plot", metavar="FILE", help="draw it as .png, .svg or .pdf (needs matplotlib)")
    showing.add_argument("--json", action="store_true", help="all digits, as JSON")
    showing.set_defaults(run=run_show)

    matching = actions.add_parser("match", help="find the glass, or the law, of an index", allow_abbrev=False)
    matching.add_argument("--nd", type=_positive, metavar="N", help="index at the d line")
    matching.add_argument("--vd", type=_positive, metavar="V", help="Abbe number")
    matching.add_argument("--data", metavar="FILE.csv", help="measured indices, lines of nm,n: laws are fitted to them")
    matching.add_argument(
        "--terms", type=_count, metavar="N", help="of the fitted laws; what the points can determine unless given"
    )
    _add_selection(matching)
    matching.add_argument("--count", type=_count, default=10, metavar="N", help="how many glasses; 10")
    matching.add_argument("--json", action="store_true", help="as JSON")
    matching.set_defaults(run=run_match)


def _summary(glass: Glass) -> dict[str, Any]:
    """What is known of a glass without evaluating its law."""
    stated = glass.stated
    return {
        "name": glass.name,
        "category": glass.category,
        "status": glass.status,
        "nd": glass.nd,
        "vd": glass.abbe_number,
        "stated_nd": stated[0] if stated else None,
        "stated_vd": stated[1] if stated else None,
        "valid_range_nm": list(glass.valid_range),
        "title": glass.title,
        "page": glass.page,
        "url": glass.url,
        "reference": glass.reference,
    }


def _print_row(glass: Glass, more: str = "") -> None:
    vd = glass.abbe_number
    number = f"{vd:8.3f}" if vd is not None and not _is_opaque(glass) else "        "
    low, high = glass.valid_range
    kind = " ".join(filter(None, (glass.category, glass.status)))
    print(
        f"{glass.name:32} {glass.nd:9.6f} {number} {more} {f'{low:g}–{high:g} nm':20} {kind:16} {glass.title}".rstrip()
    )


def _is_opaque(glass: Glass) -> bool:
    return glass.category in ("metal", "semiconductor")


def run_list(args: argparse.Namespace) -> int:
    """Run ``abbe glass list``."""
    try:
        found = catalog.glasses(
            args.pattern, maker=args.maker, category=args.category, status=args.status, nd=args.nd, vd=args.vd
        )
    except UsageError as error:
        raise UsageError(f"--{error}") from None
    if args.json:
        print(json.dumps([_summary(glass) for glass in found], indent=2, ensure_ascii=False))
        return 0
    for glass in found:
        _print_row(glass)
    if not found:
        messages.note("glass list: nothing in the catalogue is like that; `abbe glass list` alone shows all of it")
    return 0


def _curve(glass: Glass, wavelengths: Sequence[float], thickness_mm: float) -> list[dict[str, Any]]:
    columns = [glass.ior(wavelengths), glass.dior_dlambda(wavelengths), glass.d2ior_dlambda2(wavelengths)]
    keys = ["nm", "ior", "dior_dlambda", "d2ior_dlambda2"]
    if glass.extinction_table is not None:
        columns.append(glass.extinction(wavelengths))
        keys.append("k")
        if not _is_opaque(glass):
            columns.append(glass.internal_transmittance(wavelengths, thickness_mm))
            keys.append("internal_transmittance")
    return [dict(zip(keys, map(float, row), strict=True)) for row in zip(wavelengths, *columns, strict=True)]


def _law_text(glass: Glass) -> str:
    law = glass.source_law
    if law.formula is None:
        return f"table of {len(law.coefficients) // 2} entries, cubic spline"
    return f"formula {law.formula} of refractiveindex.info: {' '.join(map(repr, law.coefficients))} (λ in µm)"


def _stated_text(glass: Glass) -> str:
    if glass.stated is None:
        return ""
    return f"   (source: {glass.stated[0]:g}, {glass.stated[1]:g})"


def run_show(args: argparse.Namespace) -> int:
    """Run ``abbe glass show``."""
    glass = catalog.glass(args.name)
    low, high = glass.valid_range
    names = {LINES[line]: line for line in _SHOWN_LINES}
    wavelengths = args.wavelengths or [nm for nm in names if low <= nm <= high]
    try:
        curve = _curve(glass, wavelengths, args.thickness)
    except UsageError as error:
        raise UsageError(f"--wavelengths: {error}") from None
    partial = glass.partial_dispersion("g", "F") if low <= LINES["g"] <= high else None
    if args.plot is not None:
        from ..glass_plot import write_plot

        write_plot(args.plot, glass, args.thickness)
    if args.json:
        law = glass.source_law
        record = _summary(glass) | {
            "partial_dispersion_gF": partial,
            "law": {"formula": law.formula, "coefficients": list(law.coefficients)},
            "database": catalog.DATABASE,
            "license": "CC0-1.0",
            "thickness_mm": args.thickness,
            "curve": curve,
        }
        print(json.dumps(record, indent=2, ensure_ascii=False))
        return 0
    vd = glass.abbe_number
    print(f"{glass.name}   {' '.join(filter(None, (glass.category, glass.status)))}   {glass.title}")
    if _is_opaque(glass):
        print(f"n_d {glass.nd:.6f}, k_d {glass.extinction(LINES['d']):.6f}")
    else:
        print(f"n_d {glass.nd:.6f}, V_d {'none' if vd is None else f'{vd:.4f}'}{_stated_text(glass)}")
    if partial is not None and not _is_opaque(glass):
        print(f"P_gF {partial:.6f}")
    print(f"law      {_law_text(glass)}")
    print(f"valid    {low:g} to {high:g} nm")
    print(f"source   {glass.reference}")
    print(f"         {glass.url}")
    print(f"         {catalog.DATABASE}, CC0 1.0")
    print(f'in USD   uniform string abbe:glass = "{glass.name}"')
    heads = {"k": "k", "internal_transmittance": f"τ {args.thickness:g} mm"}
    print(
        f"\n{'λ, nm':>12} {'n':>11} {'∂n/∂λ, 1/nm':>14} {'∂²n/∂λ², 1/nm²':>15}"
        + "".join(f" {heads[key]:>12}" for key in curve[0] if key in heads)
    )
    for row in curve:
        label = names.get(row["nm"], "")
        line = (
            f"{label:2}{row['nm']:10.4f} {row['ior']:11.7f} {row['dior_dlambda']:14.6e} {row['d2ior_dlambda2']:15.6e}"
        )
        line += "".join(f" {row[key]:12.4e}" if key == "k" else f" {row[key]:12.6f}" for key in row if key in heads)
        print(line)
    return 0


def _fits(nm: Any, n: Any, terms: int | None) -> tuple[list[glass_match.Fit], list[str]]:
    """Fit both laws; what cannot be fitted, and why, is told."""
    size = len(nm)
    fits, problems = [], []
    for law, fit, most, each in (
        ("cauchy", glass_match.fit_cauchy, 3, 1),
        ("sellmeier", glass_match.fit_sellmeier, 3, 2),
    ):
        # Without a say, one point more than coefficients, so that the residual says something.
        wanted = terms if terms is not None else max(1, min(most, (size - 1) // each))
        try:
            fits.append(fit(nm, n, wanted))
        except AbbeError as error:
            problems.append(f"{law}: {error}")
    return fits, problems


def _fit_record(fit: glass_match.Fit) -> dict[str, Any]:
    return {
        "law": fit.law,
        "coefficients": {name: list(values) for name, values in fit.coefficients.items()},
        "rms": fit.rms,
        "max": fit.largest,
        "nd": float(fit.dispersion.ior(LINES["d"])),
        "vd": fit.dispersion.abbe_number,
        "usda": fit.attributes(),
    }


def run_match(args: argparse.Namespace) -> int:
    """Run ``abbe glass match``."""
    if (args.nd is None) == (args.data is None):
        raise UsageError("--nd: give --nd (and --vd), or --data, one of the two")
    if args.nd is None and args.vd is not None:
        raise UsageError("--vd: needs --nd")
    if args.data is None and args.terms is not None:
        raise UsageError("--terms: needs --data")
    selection = {"count": args.count, "maker": args.maker, "category": args.category, "status": args.status}
    fits: list[glass_match.Fit] = []
    problems: list[str] = []
    try:
        if args.data is None:
            matches = glass_match.match_numbers(args.nd, args.vd, **selection)
        else:
            nm, n = glass_match.read_points(args.data)
            fits, problems = _fits(nm, n, args.terms)
            matches = glass_match.match_points(nm, n, **selection)
    except UsageError as error:
        place = "" if args.data is not None and str(error).startswith(str(args.data)) else "--"
        raise UsageError(f"{place}{error}") from None
    for problem in problems:
        messages.note(f"glass match: no fit by {problem}")
    if args.json:
        record = {
            "fits": [_fit_record(fit) for fit in fits],
            "glasses": [
                _summary(match.glass) | {"distance": match.distance, "max": match.largest} for match in matches
            ],
        }
        print(json.dumps(record, indent=2, ensure_ascii=False))
        return 0
    for fit in fits:
        terms = len(next(iter(fit.coefficients.values())))
        nd, vd = float(fit.dispersion.ior(LINES["d"])), fit.dispersion.abbe_number
        print(
            f"{fit.law}, {terms} {'term' if terms == 1 else 'terms'}: residual rms {fit.rms:.2e}, max {fit.largest:.2e}"
        )
        print(f"    n_d {nd:.6f}, V_d {'none' if vd is None else f'{vd:.3f}'}")
        for line in fit.attributes():
            print(f"    {line}")
    if fits:
        print()
    distance = "rms Δn" if args.data is not None else "distance"
    print(f"{'nearest':32} {'n_d':>9} {'V_d':>8} {distance:>10}")
    for match in matches:
        _print_row(match.glass, f"{match.distance:10.2e}")
    return 0
