"""``abbe lights``: what shines on a stage."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from typing import Any

from . import messages, options


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("lights", help="list the lights of a stage", allow_abbrev=False)
    options.add_stage(parser)
    options.add_settings(parser.add_argument_group("whose lights"))
    parser.add_argument("--json", action="store_true", help="all of it as JSON")
    options.add_quiet(parser)
    # What lights do not depend on.
    parser.set_defaults(run=run, product=None, scalar_ior=None, strict=False)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    lights = options.open_scene(args, options.frame(args)).lights()
    if args.json:
        print(json.dumps(lights, indent=2))
        return 0
    for light in lights:
        print(f"{light['path']}  {_line(light)}")
    if not lights:
        messages.note(f"{args.stage}: has no light")
    return 0


def _line(light: Mapping[str, Any]) -> str:
    """Return a light on one line, without its path."""
    parts = [light["kind"], f"emission {_numbers(light['emission'])}"]
    if light["spectrum"] != "D65":
        parts.append(light["spectrum"])
    for name in ("area", "power"):
        if light[name] is not None:
            parts.append(f"{name} {light[name]:.6g}")
    for name in ("position", "direction"):
        if light[name] is not None:
            parts.append(f"{'at' if name == 'position' else 'along'} {_numbers(light[name])}")
    if light["shaped"]:
        parts.append("shaped")
    for name, word in (("texture", "texture"), ("group", "group"), ("illuminates", "lights only")):
        if light[name] is not None:
            parts.append(f"{word} {light[name]}")
    if light["shadowed_by"] is not None:
        parts.append(f"shadows only from {light['shadowed_by']}")
    return ", ".join(parts)


def _numbers(values: list[float]) -> str:
    return f"({', '.join(f'{value + 0.0:.6g}' for value in values)})"
