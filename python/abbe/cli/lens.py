"""``abbe lens``: a prescription table as a stage."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..errors import UsageError
from ..prescription import read_prescription, stage_text
from . import options


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("lens", help="make a stage of a lens prescription", allow_abbrev=False)
    parser.add_argument("prescription", metavar="PRESCRIPTION", help="table of surfaces: .csv, .txt or .json")
    parser.add_argument("out", metavar="OUT.usda", help="the stage to write")
    options.add_quiet(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if Path(args.out).suffix != ".usda":
        raise UsageError(f"{args.out}: must end with .usda")
    Path(args.out).write_text(stage_text(read_prescription(args.prescription)), encoding="utf-8")
    return 0
