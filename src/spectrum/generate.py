"""Writes ``tables.rs``: the standard observer and the spectra that illuminants are made of.

The numbers are the CIE's, as the PyPI package ``colour-science`` (BSD-3-Clause) tabulates them. To run::

    python -m pip install colour-science==0.4.7
    python src/spectrum/generate.py

* CIE 1931 2° colour-matching functions at steps of 1 nm (ISO/CIE 11664-1:2019, table 1), 360 to 830 nm.
* S0, S1, S2 of the CIE's daylight (CIE 15:2018, table 6) at steps of 10 nm, 360 to 830 nm.
* Fluorescent lamps FL2, FL7 and FL11 (CIE 15:2018, table 10.1) at steps of 5 nm, 380 to 780 nm.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

with warnings.catch_warnings():
    # It tells which of its own optional parts are missing.
    warnings.simplefilter("ignore")
    import colour
    from colour.colorimetry import SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES

PACKAGE_VERSION = "0.4.7"
LAMPS = ("FL2", "FL7", "FL11")


def number(value: float) -> str:
    """Return a number with the digits that the table has, as Rust writes it."""
    text = f"{value:.7g}" if abs(value) < 1e-3 else f"{value:.10g}"
    return text if any(c in text for c in ".e") else f"{text}.0"


def rows(values: Iterable[float], columns: int) -> str:
    texts = [number(float(value)) for value in values]
    lines = [", ".join(texts[i : i + columns]) for i in range(0, len(texts), columns)]
    return "".join(f"    {line},\n" for line in lines)


def main() -> None:
    if colour.__version__ != PACKAGE_VERSION:
        sys.exit(f"colour-science {colour.__version__} is installed: the tables are made from {PACKAGE_VERSION}")
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    assert (observer.shape.start, observer.shape.end, observer.shape.interval) == (360, 830, 1)
    basis = [SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES[name] for name in ("S0", "S1", "S2")]
    daylight = np.array([[sd[nm] for sd in basis] for nm in range(360, 831, 10)])
    text = (
        "//! Tables of the CIE, written by `generate.py` (which names the sources) from colour-science "
        f"{PACKAGE_VERSION}.\n\n"
        "/// x̄, ȳ, z̄ of the CIE 1931 2° observer from 360 to 830 nm at steps of 1 nm.\n"
        "#[rustfmt::skip]\n"
        f"pub(super) static CIE_1931: [[f64; 3]; {len(observer.values)}] = [\n"
        + "".join(f"    [{', '.join(map(number, row))}],\n" for row in observer.values.tolist())
        + "];\n\n"
        "/// S0, S1, S2 of daylight from 360 to 830 nm at steps of 10 nm.\n"
        "#[rustfmt::skip]\n"
        f"pub(super) static DAYLIGHT: [[f64; 3]; {len(daylight)}] = [\n"
        + "".join(f"    [{', '.join(map(number, row))}],\n" for row in daylight.tolist())
        + "];\n"
    )
    for name in LAMPS:
        lamp = colour.SDS_ILLUMINANTS[name]
        assert (lamp.shape.start, lamp.shape.end, lamp.shape.interval) == (380, 780, 5)
        text += (
            f"\n/// Relative spectral power of {name} from 380 to 780 nm at steps of 5 nm.\n"
            "#[rustfmt::skip]\n"
            f"pub(super) static {name}: [f64; {len(lamp.values)}] = [\n{rows(lamp.values, 9)}];\n"
        )
    (Path(__file__).parent / "tables.rs").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
