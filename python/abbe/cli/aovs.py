"""``abbe aovs``: what can be rendered."""

from __future__ import annotations

import argparse
import json
import textwrap
from typing import Any

from .. import _core


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("aovs", help="list the AOVs and integrators", allow_abbrev=False)
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    rows, aliases, integrators = _core.aovs(), _core.aov_aliases(), _core.integrators()
    if args.json:
        for row in rows:
            row["aliases"] = [alias for alias, name in aliases.items() if name == row["name"]]
            row["integrators"] = [entry["name"] for entry in integrators if row["name"] in entry["aovs"]]
        print(json.dumps({"aovs": rows, "integrators": integrators}, indent=2, ensure_ascii=False))
        return 0
    for row in rows:
        also = [alias for alias, name in aliases.items() if name == row["name"]]
        channels = f"{'.'.join(row['channels'])} {row['sample']}"
        print(f"{row['name']:28} {channels:14} {row['unit']:16} {row['merge']}")
        text = row["doc"] + (f" (also {', '.join(also)})" if also else "")
        print(textwrap.fill(text, 110, initial_indent="    ", subsequent_indent="    "))
    print("\nintegrators")
    for entry in integrators:
        print(f"    {entry['name']}: {entry['summary']}")
    return 0
