"""``abbe bench``: run time against error of the ways to get a derivative AOV."""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any

from .._api import Scene
from ..errors import UsageError


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("bench", help="measure error against run time on stages", allow_abbrev=False)
    parser.add_argument("stages", nargs="+", metavar="STAGE", help="stages or scene files with dispersive glass")
    parser.add_argument("--width", type=int, default=320, metavar="N", help="pixels; 320")
    parser.add_argument("--rounds", type=int, default=9, metavar="N", help="how often everything is timed; 9")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write all figures as CSV")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw them as .png, .svg or .pdf (needs matplotlib)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if args.rounds < 1:
        raise UsageError(f"--rounds: must be 1 or more, not {args.rounds}")
    # Not `from .. import bench`: that name is this module's in the commands' namespace.
    report = importlib.import_module("abbe.bench")
    comparisons = []
    for stage in args.stages:
        scene = Scene.load(stage) if stage.endswith(".safetensors") else Scene.from_stage(stage)
        comparison = scene.compare(rounds=args.rounds, width=args.width)
        print(report.table(Path(stage).name, comparison), end="\n\n", flush=True)
        comparisons.append((stage, comparison))
    for path, write in ((args.csv, report.write_csv), (args.plot, report.write_plot)):
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path, comparisons)
    return 0
