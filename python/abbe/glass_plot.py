"""What a material of the catalogue does with light, as a drawing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ._files import replacing
from .catalog import LINES, Glass
from .errors import AbbeError

__all__ = ["write_plot"]

FORMATS = (".png", ".svg", ".pdf")

# nm; what the renderer computes with.
_BAND = (360.0, 830.0)
_MARKED = ("g", "F", "e", "d", "C")


def write_plot(path: str | os.PathLike[str], glass: Glass, thickness_mm: float = 10.0) -> None:
    """Draw n, ∂n/∂λ, ∂²n/∂λ² and the internal transmittance (of what is opaque, k) over 360–830 nm.

    Parameters
    ----------
    path : a .png, .svg or .pdf file
    glass : of the catalogue; drawn as far as its source is valid
    thickness_mm : for the transmittance

    Raises
    ------
    AbbeError
        matplotlib is missing, or the file cannot be written.
    """
    kind = Path(path).suffix.lower()
    if kind not in FORMATS:
        raise AbbeError(f"{path}: is none of {', '.join(FORMATS)}: choose one of these endings")
    try:
        import matplotlib
    except ImportError as error:
        raise AbbeError(f"{path}: plots need matplotlib: pip install 'abbe[plot]'") from error
    # Text as text, and no date: the same glass gives the same file.
    settings: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "abbe"}
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    with matplotlib.rc_context(settings):
        figure, axes = plt.subplots(2, 2, figsize=(10, 7), sharex=True)
        try:
            _draw(axes, glass, thickness_mm)
            vd = glass.abbe_number
            numbers = f"$n_d$ = {glass.nd:.5f}" + ("" if vd is None or not _is_clear(glass) else f", $V_d$ = {vd:.2f}")
            figure.suptitle(f"{glass.name}   {numbers}", fontsize=13)
            figure.text(0.01, 0.006, glass.source, fontsize=6, color="0.4")
            figure.tight_layout(rect=(0, 0.02, 1, 1))
            with replacing(path) as temporary:
                # The temporary name does not tell the format.
                metadata = {"Date": None} if kind == ".svg" else {"CreationDate": None} if kind == ".pdf" else None
                figure.savefig(temporary, dpi=110, format=kind[1:], metadata=metadata)
        except (OSError, ValueError) as problem:
            raise AbbeError(f"{path}: cannot be written: {problem}") from problem
        finally:
            plt.close(figure)


def _is_clear(glass: Glass) -> bool:
    return glass.category not in ("metal", "semiconductor")


def _draw(axes: Any, glass: Glass, thickness_mm: float) -> None:
    low, high = max(_BAND[0], glass.valid_range[0]), min(_BAND[1], glass.valid_range[1])
    nm = np.linspace(low, high, 941)
    lines = {line: LINES[line] for line in _MARKED if low <= LINES[line] <= high}
    source = glass.source_law
    (index, first), (second, last) = axes
    for axis, values, title in (
        (index, glass.ior, "n"),
        (first, glass.dior_dlambda, "∂n/∂λ, 1/nm"),
        (second, glass.d2ior_dlambda2, "∂²n/∂λ², 1/nm²"),
    ):
        axis.plot(nm, values(nm), color="C0", linewidth=1.4)
        axis.plot(list(lines.values()), values(list(lines.values())), "o", color="C0", markersize=3.5)
        axis.set_title(title, fontsize=10)
    for line, at in lines.items():
        index.annotate(line, (at, glass.ior(at)), (2, 5), textcoords="offset points", fontsize=8)
    if source.formula is None:
        table = np.array(source.coefficients).reshape(-1, 2)
        inside = table[(table[:, 0] >= low) & (table[:, 0] <= high)]
        index.plot(inside[:, 0], inside[:, 1], "x", color="C1", markersize=4, label="entry of the source's table")
        index.legend(fontsize=7)
    _draw_absorption(last, glass, nm, thickness_mm)
    for axis in axes.flat:
        axis.grid(visible=True, color="0.9")
        axis.set_xlim(_BAND)
        axis.tick_params(labelsize=8)
        axis.ticklabel_format(axis="y", scilimits=(-3, 4))
        for begin, end in ((_BAND[0], low), (high, _BAND[1])):
            if begin < end:
                axis.axvspan(begin, end, color="0.93", zorder=0)
    for axis in axes[1]:
        axis.set_xlabel("λ, nm")


def _draw_absorption(axis: Any, glass: Glass, nm: Any, thickness_mm: float) -> None:
    table = glass.extinction_table
    if table is None:
        axis.set_title("k", fontsize=10)
        axis.text(0.5, 0.5, "the source has no k(λ)", ha="center", va="center", transform=axis.transAxes, color="0.4")
        axis.tick_params(labelleft=False)
        return
    # As far as k is known: beyond, the renderer keeps its last value.
    known = nm[(nm >= table[0, 0]) & (nm <= table[-1, 0])]
    if not _is_clear(glass):
        axis.plot(known, glass.extinction(known), color="C3", linewidth=1.4)
        axis.set_title("k", fontsize=10)
        return
    axis.plot(known, glass.internal_transmittance(known, thickness_mm), color="C2", linewidth=1.4)
    axis.set_title(f"internal transmittance of {thickness_mm:g} mm", fontsize=10)
    axis.set_ylim(min(0.9, axis.get_ylim()[0]), 1.005)
