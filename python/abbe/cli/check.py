"""``abbe check``: an EXR opened by another library and verified."""

from __future__ import annotations

import argparse
import json
from typing import Any

FAULTY = 4


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("check", help="verify an EXR with OpenImageIO", allow_abbrev=False)
    parser.add_argument("file", metavar="FILE.exr")
    parser.add_argument("--against", metavar="REF.exr", help="also compare each layer with this file's")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.0,
        metavar="X",
        help="greatest absolute difference; the same bits unless given",
    )
    parser.add_argument(
        "--relative-tolerance", type=float, default=0.0, metavar="X", help="added to it, times the reference's value"
    )
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; 4 if the EXR is at fault, is another program's, or differs."""
    from ..check import check
    from ..errors import UsageError

    try:
        report = check(
            args.file, against=args.against, tolerance=args.tolerance, relative_tolerance=args.relative_tolerance
        )
    except ValueError as error:
        raise UsageError(f"--{error}") from None
    print(json.dumps(report.to_dict(), indent=2) if args.json else report)
    return 0 if report.passed else FAULTY
