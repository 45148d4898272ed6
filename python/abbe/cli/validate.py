"""``abbe validate``: what is wrong with a stage, before it is rendered."""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import Any

from ..errors import UsageError
from . import options

FAULTY = 4


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "validate",
        help="look for mistakes in a stage: impossible glass, open meshes, unknown names",
        allow_abbrev=False,
    )
    options.add_stage(parser, scene_file=False)
    parser.add_argument("--strict", action="store_true", help="a warning counts as an error")
    parser.add_argument("--json", action="store_true", help="as JSON, a list of findings")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; 4 if there is an error, or under ``--strict`` a warning."""
    from ..validators import validate

    if options.is_scene_file(args):
        raise UsageError(f"{args.stage}: is an exported scene, which is checked when it is loaded: name its stage")
    findings = validate(args.stage, purposes=args.purposes, missing=args.missing, **options.stage_options(args))
    if args.json:
        print(json.dumps([dataclasses.asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            print(f"{finding.severity:8} {finding}  [{finding.validator}]")
        counts = {name: sum(f.severity == name for f in findings) for name in ("error", "warning", "info")}
        told = ", ".join(
            f"{count} {name}{'s' * (count != 1 and name != 'info')}" for name, count in counts.items() if count
        )
        print(f"{args.stage}: {told or 'nothing found'}")
    fatal = ("error", "warning") if args.strict else ("error",)
    return FAULTY if any(finding.severity in fatal for finding in findings) else 0
