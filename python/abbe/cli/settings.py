"""``abbe settings``: the render settings, products and variables of a stage."""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from . import messages, options

if TYPE_CHECKING:
    from ..usd.listing import ProductInfo


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("settings", help="list the render settings of a stage", allow_abbrev=False)
    options.add_stage(parser, scene_file=False)
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def _size(resolution: tuple[int, int] | None) -> str:
    return "resolution not authored" if resolution is None else f"{resolution[0]} x {resolution[1]}"


def _oddities(product: ProductInfo) -> list[str]:
    """Return what is not as it is unless somebody says so."""
    lines = []
    if product.pixel_aspect_ratio != 1.0:
        lines.append(f"pixel aspect ratio {product.pixel_aspect_ratio:g}")
    if product.aspect_ratio_conform_policy != _USUAL_POLICY:
        lines.append(f"aperture: {product.aspect_ratio_conform_policy}")
    if product.data_window_ndc != _WHOLE_IMAGE:
        lines.append(f"window {', '.join(f'{v:g}' for v in product.data_window_ndc)} (y up)")
    if product.disable_depth_of_field:
        lines.append("no depth of field")
    if product.disable_motion_blur:
        lines.append("no motion blur")
    return lines


_USUAL_POLICY = "expandAperture"
_WHOLE_IMAGE = (0.0, 0.0, 1.0, 1.0)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if options.is_scene_file(args):
        raise UsageError(f"{args.stage}: is an exported scene: list the settings of its stage, or use abbe plan")
    from ..usd import list_settings

    found = list_settings(args.stage, **options.stage_options(args))
    if args.json:
        print(json.dumps([dataclasses.asdict(settings) for settings in found], indent=2))
        return 0
    for settings in found:
        print(f"{settings.path}{'  (default)' if settings.is_default else ''}")
        print(f"  {_size(settings.resolution)}, camera {settings.camera or 'not authored'}")
        print(f"  purposes {', '.join(settings.purposes)}")
        for product in settings.products:
            print(f"  product {product.path}: {product.name or 'no usable productName'}")
            print(f"    {product.product_type}, {_size(product.resolution)}, camera {product.camera or 'not authored'}")
            for line in _oddities(product):
                print(f"    {line}")
            for name, value in product.driver:
                print(f"    driver {name}: {value}")
            for var in product.vars:
                stored = f", as {var.format}" if var.format else ""
                layer = f", layer {var.layer}" if var.layer != var.name else ""
                print(f"    {var.name}: {var.source_name} ({var.source_type}, {var.data_type}{stored}{layer})")
        for path in settings.passes:
            print(f"  pass {path}")
    if not found:
        messages.note(f"{args.stage}: has no RenderSettings; defaults apply")
    return 0
