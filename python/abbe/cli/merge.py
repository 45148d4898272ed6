"""``abbe merge``: crops and sample ranges of one render, joined to the same bits."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .._api import merge
from ..errors import UsageError


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("merge", help="join crops and sample ranges of one render", allow_abbrev=False)
    parser.add_argument("parts", nargs="+", metavar="PART.exr", help="files that abbe wrote")
    parser.add_argument("-o", "--out", required=True, metavar="OUT.exr", help="the file to write")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if Path(args.out).suffix.lower() != ".exr":
        raise UsageError(f"--out {args.out}: must end with .exr")
    merge(args.parts, args.out)
    return 0
