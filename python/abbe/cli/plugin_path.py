"""``abbe plugin-path``: the folder for ``PXR_PLUGINPATH_NAME``."""

from __future__ import annotations

import argparse
from typing import Any

from ..schemas import plugin_path


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "plugin-path", help="print the folder of the USD schemas, for PXR_PLUGINPATH_NAME", allow_abbrev=False
    )
    parser.set_defaults(run=run)


def run(_args: argparse.Namespace) -> int:
    """Run the command."""
    print(plugin_path())
    return 0
