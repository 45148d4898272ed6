"""``abbe trace``: every event of one sample's chain, with its columns."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from . import options

# The columns as people write them.
_COLUMNS = {"x": "∂x", "y": "∂y", "lambda": "∂λ", "lambda2": "∂λλ"}


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser("trace", help="follow one sample and print every event", allow_abbrev=False)
    options.add_stage(parser)
    parser.add_argument(
        "--pixel",
        type=options.numbers(int, 2, "X,Y"),
        required=True,
        metavar="X,Y",
        help="x right, y down, from the top left",
    )
    parser.add_argument("--sample", type=int, default=0, metavar="I", help="index of the sample; 0")
    options.add_request(parser)
    parser.add_argument("--json", action="store_true", help="all digits, as JSON")
    options.add_quiet(parser)
    parser.set_defaults(run=run)


def _number(value: float) -> str:
    # Adding 0 takes the sign from -0, which says nothing to a reader.
    return f"{value + 0.0:.9g}"


def _vector(values: Sequence[float]) -> str:
    return "(" + ", ".join(map(_number, values)) + ")"


def _event_name(name: str) -> str:
    """Plain words: ``total reflection`` of ``total_reflection`` and of ``TotalReflection``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).replace("_", " ").lower()


def _print_columns(columns: Mapping[str, Any], indent: str) -> None:
    for name, symbol in _COLUMNS.items():
        column = columns.get(name)
        if column is not None:
            print(f"{indent}{symbol:3} p {_vector(column['point'])}  K {_vector(column['momentum'])}")


def _print_segment(segment: Mapping[str, Any]) -> None:
    """The way to an event: what it ran through, and what was left of the light at the reference wavelength."""
    length = "without end" if segment["length"] is None else _number(segment["length"])
    here, so_far = _number(segment["transmittance"]), _number(segment["transmittance_so_far"])
    print(f"      through {segment['medium'] or 'air'}, {length}: transmittance {here}, so far {so_far}")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    scene = options.open_scene(args, options.frame(args))
    request = options.request(args, from_stage=not options.is_scene_file(args))
    told = scene.trace(args.pixel, args.sample, **request)
    if args.json:
        print(json.dumps(told, indent=2))
        return 0
    pixel, raster = told["pixel"], told["raster"]
    print(f"pixel {pixel[0]}, {pixel[1]}, sample {args.sample}, at {_vector(raster)}, {told['wavelength_nm']} nm")
    print(f"camera {_vector(told['camera'])} direction {_vector(told['direction'])} ior {told['start_ior']:.9g}")
    for number, event in enumerate(told["events"], 1):
        before, after = event["ior"]
        name, distance = _event_name(event["event"]), _number(event["distance"])
        print(f"{number:3} {name} at {_vector(event['position'])} after {distance}")
        _print_segment(event["segment"])
        print(f"      normal {_vector(event['normal'])}{' (geometric)' if event['geometric_normal_used'] else ''}")
        print(f"      ior {before:.9g} to {after:.9g}, W² {_number(event['w_squared'])}")
        _print_columns(event["columns"]["leaving"], "      ")
    end = told["end"]
    if end["kind"] == "surface":
        where = f"{end['prim']} at {_vector(end['position'])}, material {end['material'] or 'none'}"
    else:
        where = end["kind"]
    print(f"end {where}")
    if told["last_segment"] is not None:
        _print_segment(told["last_segment"])
    print(f"      direction {_vector(told['last_direction'])}")
    _print_columns(told["columns"], "      ")
    print(f"      {told['interfaces']} interfaces, {told['total_reflections']} total reflections")
    return 0
