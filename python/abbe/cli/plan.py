"""``abbe plan``: what a render would carry and compute, and why."""

from __future__ import annotations

import argparse
import json
from typing import Any

from . import options


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("plan", help="tell what a render would compute, and why", allow_abbrev=False)
    options.add_stage(parser)
    options.add_request(parser)
    parser.add_argument("--json", action="store_true", help="all of it as JSON, a list with one plan for each product")
    options.add_quiet(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    scene = options.open_scene(args, options.frame(args))
    plans = scene.plans(**options.request(args, from_stage=not options.is_scene_file(args)))
    if args.json:
        print(json.dumps([plan.fields for plan in plans], indent=2))
    else:
        print("\n\n".join(str(plan).rstrip() for plan in plans))
    return 0
