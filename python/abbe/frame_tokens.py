"""Frames and products in file names, as four families of programs write them."""

from __future__ import annotations

import math
import re

__all__ = ["expand_frame_tokens", "has_frame_token", "has_product_token"]

_TOKEN = re.compile(
    r"""
      <(?P<angle>FF|F|N|OS)(?P<angle_width>\d*)>          # RenderMan, Arnold: <F4>, <FF>, <N>, <OS>
    | \$\{(?P<brace>FF|F)(?P<brace_width>\d*)\}           # ${F4}
    | \$(?P<dollar>FF|F)(?:(?P<dollar_width>\d+)|(?![A-Za-z])) # Houdini, Arnold: $F4, $FF
    | %(?P<zero>0?)(?P<percent_width>\d*)(?P<percent>[dg]) # C: %04d, %g
    | (?P<hashes>\#+)(?P<fraction>\.\#+)?                  # usdrecord: ####, ###.##
    """,
    re.VERBOSE,
)


def _is_of_product(match: re.Match[str]) -> bool:
    return match["angle"] in ("N", "OS")


def has_frame_token(name: str) -> bool:
    """Tell whether a name has a place for the frame."""
    return any(not _is_of_product(match) for match in _TOKEN.finditer(name))


def has_product_token(name: str) -> bool:
    """Tell whether a name has a place for the product's name or ordinal."""
    return any(_is_of_product(match) for match in _TOKEN.finditer(name))


def expand_frame_tokens(name: str, frame: float, product: str = "", ordinal: int = 0) -> str:
    """Return ``name`` with frame tokens replaced.

    Understood are those of usdrecord (``####``, ``###.##``), RenderMan (``<F4>``, ``<N>`` the product's ordinal,
    ``<OS>`` its prim name), Houdini and Arnold (``$F4``, ``${F4}``, ``$FF``) and C (``%04d``, ``%g``). Those with a
    fraction (``FF``, ``%g``, ``#.#``) write it; the others write the frame's whole part.
    """
    whole = math.floor(frame)
    exact = str(whole) if frame == whole else repr(frame)

    def replace(match: re.Match[str]) -> str:
        kind = match["angle"] or match["brace"] or match["dollar"]
        width = match["angle_width"] or match["brace_width"] or match["dollar_width"] or match["percent_width"]
        if kind == "N":
            return f"{ordinal:0{int(width or 0)}d}"
        if kind == "OS":
            return product
        if kind == "FF" or match["percent"] == "g":
            return exact.zfill(int(width or 0)) if kind or match["zero"] else exact.rjust(int(width or 0))
        if match["hashes"]:
            digits = len(match["fraction"] or ".") - 1
            return f"{frame:0{len(match[0])}.{digits}f}" if digits else f"{whole:0{len(match[0])}d}"
        if match["percent"] and not match["zero"]:
            return f"{whole:{int(width or 0)}d}"
        return f"{whole:0{int(width or 0)}d}"

    return _TOKEN.sub(replace, name)
