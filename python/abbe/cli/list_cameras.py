"""``abbe list-cameras``: the cameras of a stage."""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import Any

from ..errors import UsageError
from . import messages, options


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("list-cameras", help="list the cameras of a stage", allow_abbrev=False)
    options.add_stage(parser, scene_file=False)
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if options.is_scene_file(args):
        raise UsageError(f"{args.stage}: is an exported scene: list the cameras of its stage")
    from ..usd import list_cameras

    cameras = list_cameras(args.stage, **options.stage_options(args))
    if args.json:
        print(json.dumps([dataclasses.asdict(camera) for camera in cameras], indent=2))
        return 0
    for camera in cameras:
        default = "  (default)" if camera.is_default else ""
        aperture = f"{camera.horizontal_aperture:g} x {camera.vertical_aperture:g}"
        print(f"{camera.path}  {camera.projection}, focal length {camera.focal_length:g}, aperture {aperture}{default}")
    if not cameras:
        messages.note(f"{args.stage}: has no camera; rendering frames its bounding box")
    return 0
