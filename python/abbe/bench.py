"""Run time against error: the ways to get a derivative AOV, as tables, CSV and a plot."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._files import replacing
from .errors import AbbeError

__all__ = ["table", "write_csv", "write_plot"]

Comparison = Mapping[str, Any]
"""What :meth:`abbe.Scene.compare` returns."""


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table whose first row is the head."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in rows
    ]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])


def _errors(errors: Mapping[str, float]) -> list[str]:
    return [f"{errors[name]:.1e}" for name in ("median", "p99", "max")]


def _method_name(method: Mapping[str, Any]) -> str:
    step = method["step_nm"]
    return method["name"] if step is None else f"{method['name']}, {step:g} nm"


def table(title: str, comparison: Comparison) -> str:
    """Return one stage's figures as Markdown.

    Parameters
    ----------
    title : the stage
    comparison : what was measured on it
    """
    costs = [["columns carried", "Mray/s", "overhead"]]
    costs += [
        [cost["columns"], f"{cost['mrays_per_second']:.2f}", f"{100 * cost['overhead']:+.1f} %"]
        for cost in comparison["costs"]
    ]
    methods = [["way to ∂p/∂λ", "ns per chain", "time / bare chain", "median error", "99 %", "worst"]]
    methods += [
        [_method_name(m), f"{m['ns_per_chain']:.0f}", f"{m['time_ratio']:.2f}", *_errors(m["error"])]
        for m in comparison["methods"]
    ]
    predictions = [["δ, nm", "order", "chains", "median error", "99 %", "worst"]]
    predictions += [
        [f"{p['delta_nm']:g}", str(p["order"]), str(p["chains"]), *_errors(p["error"])]
        for p in comparison["predictions"]
    ]
    known = ", ".join(_errors(comparison["reference_error"]))
    return "\n\n".join(
        [
            f"## {title}",
            "Cost of the columns on every ray of the image, one thread:",
            _aligned(costs),
            f"Relative error of ∂p/∂λ on {comparison['chains']} chains. The reference (extrapolated re-traces) is "
            f"itself known to {known} (median, 99 %, worst): smaller errors mean nothing.",
            _aligned(methods),
            "Where the ray at λ + δ lands, predicted from the derivatives at λ, relative to its displacement:",
            _aligned(predictions),
        ]
    )


def write_csv(path: str | os.PathLike[str], comparisons: Iterable[tuple[str, Comparison]]) -> None:
    """Write all figures, one row each.

    Parameters
    ----------
    path : where to
    comparisons : stages with what was measured on them
    """
    head = ["stage", "kind", "name", "parameter", "ns_per_chain", "ratio", "error_median", "error_p99", "error_max"]
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        for stage, comparison in comparisons:
            for cost in comparison["costs"]:
                rate, overhead = cost["mrays_per_second"], cost["overhead"]
                writer.writerow([stage, "columns (Mray/s)", cost["columns"], rate, "", 1 + overhead, "", "", ""])
            for m in comparison["methods"]:
                step = "" if m["step_nm"] is None else m["step_nm"]
                row = [stage, "derivative", m["name"], step, m["ns_per_chain"], m["time_ratio"]]
                writer.writerow([*row, *m["error"].values()])
            for p in comparison["predictions"]:
                writer.writerow(
                    [stage, "prediction", f"order {p['order']}", p["delta_nm"], "", "", *p["error"].values()]
                )


def write_plot(path: str | os.PathLike[str], comparisons: Sequence[tuple[str, Comparison]]) -> None:
    """Draw error against time, and error against distance, one row for each stage.

    Parameters
    ----------
    path : a .png, .svg or .pdf file
    comparisons : stages with what was measured on them

    Raises
    ------
    AbbeError
        matplotlib is missing, or the file cannot be written.
    """
    try:
        import matplotlib
    except ImportError as error:
        raise AbbeError(f"{path}: plots need matplotlib: pip install 'abbe[plot]'") from error
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(len(comparisons), 2, figsize=(11, 4.2 * len(comparisons)), squeeze=False)
    for (left, right), (stage, comparison) in zip(axes, comparisons, strict=True):
        known = comparison["reference_error"]["median"]
        left.axhspan(1e-18, known, color="0.92", label="below what the reference knows")
        by_name: dict[str, list[Mapping[str, Any]]] = {}
        for method in comparison["methods"]:
            by_name.setdefault(method["name"], []).append(method)
        for name, methods in by_name.items():
            times = [m["ns_per_chain"] for m in methods]
            errors = [max(m["error"]["median"], 1e-17) for m in methods]
            left.loglog(times, errors, "o" if len(methods) == 1 else "s", markersize=6, label=name)
            for m, x, y in zip(methods, times, errors, strict=True):
                if m["step_nm"] is not None:
                    left.annotate(f"{m['step_nm']:g} nm", (x, y), (5, 2), textcoords="offset points", fontsize=7)
        left.set(
            xlabel="ns per chain", ylabel="median relative error of ∂p/∂λ", title=f"{Path(stage).stem}: a derivative"
        )
        left.set_ylim(bottom=min(known / 30, 1e-13))
        left.legend(fontsize=7)
        for order, marker in ((1, "o"), (2, "s")):
            rows = [p for p in comparison["predictions"] if p["order"] == order]
            distance = [p["delta_nm"] for p in rows]
            right.loglog(distance, [p["error"]["median"] for p in rows], f"{marker}-", label=f"order {order}, median")
            right.loglog(
                distance, [p["error"]["p99"] for p in rows], f"{marker}:", color="0.6", label=f"order {order}, 99 %"
            )
        right.set(xlabel="δ, nm", ylabel="error / displacement", title=f"{Path(stage).stem}: predicting λ + δ")
        right.legend(fontsize=7)
        for axis in (left, right):
            axis.grid(visible=True, which="major", color="0.9")
    figure.tight_layout()
    try:
        with replacing(path) as temporary:
            # The temporary name does not tell the format.
            figure.savefig(temporary, dpi=110, format=Path(path).suffix.removeprefix(".").lower() or "png")
    except (OSError, ValueError) as problem:
        raise AbbeError(f"{path}: cannot be written: {problem}") from problem
    finally:
        plt.close(figure)
