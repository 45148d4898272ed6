"""``abbe doctor``: what runs here, and what is missing."""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import Any

from ..doctor import examine


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "doctor", help="tell which libraries are used, and what is missing", allow_abbrev=False
    )
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; 1 if something is broken (something optional that is absent is not)."""
    findings = examine()
    if args.json:
        print(json.dumps([dataclasses.asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            print(f"{finding.state:8} {finding.what}: {finding.text}")
    return 1 if any(finding.state == "broken" for finding in findings) else 0
