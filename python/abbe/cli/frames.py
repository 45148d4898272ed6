"""Frame lists and file names with a frame in them.

Understood are usdrecord's FrameSpec (``1``, ``1:4``, ``1:10x2``, lists with commas) and OpenJD's ranges (``1-4``,
``1-10:2``). USD's own parser crashes on some malformed text, so that neither is left to it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal

from ..errors import UsageError
from ..frame_tokens import expand_frame_tokens, has_frame_token

__all__ = ["MOST_FRAMES", "has_placeholder", "name_for", "parse"]

# More frames than any film has; a limit on what a typing error can ask for.
MOST_FRAMES = 1_000_000
# Decimal fractions are off by about 1e-16 of themselves, and so are their multiples: this is far above that even with a
# million frames, and far below any stride.
_ROUNDING = 1e-9

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)"
_SPEC = re.compile(rf"(?P<first>{_NUMBER})(?::(?P<last>{_NUMBER})(?:x(?P<stride>{_NUMBER}))?)?")
_OPENJD = re.compile(r"(?P<first>-?\d+)-(?P<last>-?\d+)(?::(?P<stride>-?\d+))?")


def parse(text: str) -> list[float]:
    """Return the frames that a list names, in its order, each once.

    Parameters
    ----------
    text : such as ``1:4``, ``1:10x2``, ``105:101``, ``1-4``, ``1-10:2``, or several with commas

    Returns
    -------
    list of float
        At least one.

    Raises
    ------
    UsageError
        The text is no such list, or asks for too many.
    """
    frames: dict[float, None] = {}
    for part in text.split(","):
        for frame in _part(part.strip()):
            frames[frame] = None
        if len(frames) > MOST_FRAMES:
            raise UsageError(f"--frames {text}: more than {MOST_FRAMES} frames: correct the range")
    return list(frames)


def _part(part: str) -> list[float]:
    match = _SPEC.fullmatch(part) or _OPENJD.fullmatch(part)
    if not match:
        raise UsageError(f"--frames '{part}': is no frame or range: write 5, 1:4, 1:10x2, 1-4 or 1-10:2")
    first = float(match["first"])
    if match["last"] is None:
        return [first]
    last = float(match["last"])
    stride = math.copysign(1.0, last - first) if match["stride"] is None else float(match["stride"])
    if stride == 0.0 or (last - first) * stride < 0.0:
        raise UsageError(f"--frames '{part}': a stride of {stride:g} does not lead from {first:g} to {last:g}")
    # Closed on both ends: a stride such as 0.1 is no binary fraction, and must not lose the last frame to rounding.
    count = math.floor((last - first) / stride + _ROUNDING) + 1
    if count > MOST_FRAMES:
        raise UsageError(f"--frames '{part}': {count} frames are more than {MOST_FRAMES}: correct the range")
    return [first + i * stride for i in range(count)]


# One group of hashes, with one more group behind a dot for the fraction, as usdrecord has it.
_PLACEHOLDER = re.compile(r"(?P<whole>#+)(?P<fraction>\.#+)?")


def has_placeholder(name: str) -> bool:
    """Tell whether a file name has a place for the frame."""
    return has_frame_token(name)


def name_for(
    name: str, frame: float | Literal["default"] | None, option: str, product: str = "", ordinal: int = 0
) -> str:
    """Return the file name with the frame and the product in their places.

    Parameters
    ----------
    name : such as ``out.####.exr``, ``out.$F4.exr`` or ``<OS>.<F4>.exr``
    frame : the time code that is rendered
    option : whose name it is, for errors
    product, ordinal : name of the product's prim, and its place among the products

    Raises
    ------
    UsageError
        There are several places, or no frame to put there, or the frame does not fit.
    """
    places = list(_PLACEHOLDER.finditer(name))
    if len(places) > 1:
        raise UsageError(f"{option} {name}: has several places for the frame (#): leave one")
    if has_placeholder(name) and not isinstance(frame, float):
        raise UsageError(
            f"{option} {name}: has a place for the frame, but there is none: give --frames, or a plain name"
        )
    if not places or not isinstance(frame, float):
        return expand_frame_tokens(name, frame if isinstance(frame, float) else 0.0, product, ordinal)
    match = places[0]
    digits = len(match["fraction"] or ".") - 1
    if abs(round(frame, digits) - frame) > _ROUNDING * max(1.0, abs(frame)):
        raise UsageError(f"{option} {name}: frame {frame:g} does not fit: add .# after the hashes for its fraction")
    text = f"{frame:0{len(match[0])}.{digits}f}"
    before, after = name[: match.start()], name[match.end() :]
    return "".join(expand_frame_tokens(part, frame, product, ordinal) for part in (before, text, after))


def need_placeholder(name: str, frames: Sequence[object], option: str) -> None:
    """Refuse a plain name for several frames, which would overwrite each other."""
    if len(frames) > 1 and not has_placeholder(name):
        raise UsageError(f"{option} {name}: {len(frames)} frames would overwrite each other: put #### into the name")
