"""``abbe export``: a stage as one file that ``abbe-render`` and farms render without USD."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..errors import UsageError
from . import options


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("export", help="write a stage as a scene file that needs no USD", allow_abbrev=False)
    options.add_stage(parser)
    parser.add_argument("out", metavar="SCENE.safetensors", help="the file to write")
    group = parser.add_argument_group("what goes into the scene")
    options.add_settings(group)
    group.add_argument("--product", metavar="P", help="path of the one RenderProduct to keep")
    options.add_scalar_ior(group)
    group.add_argument("--strict", action="store_true", help="a stage without a camera is an error")
    group.add_argument(
        "--embed",
        action="store_true",
        help="put what is in the texture files into the scene",
    )
    options.add_quiet(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if Path(args.out).suffix != options.SCENE_SUFFIX:
        raise UsageError(f"{args.out}: must end with {options.SCENE_SUFFIX}")
    options.open_scene(args, options.frame(args)).save(args.out, embed=args.embed)
    return 0
