"""What a stage says of itself: the time to read at, units and axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from . import tokens
from ._pxr import Usd
from .description import Diagnostics

if TYPE_CHECKING:
    from .stage import OpenedStage

__all__ = ["stage_metadata", "stage_time"]


def stage_time(stage: Any, frame: float | str | None) -> tuple[Any, float | None]:
    """Return the time code to read at, and its number (None where it has none).

    None means the stage's authored start; without one the earliest sample of each attribute, as usdrecord has it, so
    that attributes with time samples alone still have a value. ``"default"`` means the default values.
    """
    if isinstance(frame, str):
        if frame != "default":
            raise UsageError(f"frame '{frame}': is neither a number nor 'default'")
        return Usd.TimeCode.Default(), None
    if frame is None:
        if not stage.HasAuthoredMetadata(tokens.START_TIME_CODE):
            return Usd.TimeCode.EarliestTime(), None
        start = _metadata_number(stage, tokens.START_TIME_CODE)
        if start is None:
            return Usd.TimeCode.EarliestTime(), None
        frame = start
    frame = float(frame)
    if not math.isfinite(frame):
        raise UsageError(f"frame {frame}: is not finite: give a time code")
    return Usd.TimeCode(frame), frame


def _metadata_number(stage: Any, name: str) -> float | None:
    """Return a number of the stage's metadata, of whatever type it was authored: USD throws at a float for a double.

    The session layer is stronger than the root layer, as in UsdStage.
    """
    for layer in (stage.GetSessionLayer(), stage.GetRootLayer()):
        if layer and layer.pseudoRoot.HasInfo(name):
            value = layer.pseudoRoot.GetInfo(name)
            if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
                return float(value)
    return None


# UsdGeom's fallback: centimetres.
_CENTIMETRES = 0.01


def stage_metadata(opened: OpenedStage, time_code: float | None, diagnostics: Diagnostics) -> dict[str, Any]:
    """Return what the description says of the stage as a whole."""
    stage = opened.stage
    metres = _metadata_number(stage, tokens.METERS_PER_UNIT)
    if metres is not None and metres <= 0.0:
        diagnostics.warn(
            "unreadable-attribute",
            f"{opened.source}.{tokens.METERS_PER_UNIT}",
            f"{metres:g} metres per unit is no length; centimetres are taken",
        )
        metres = None
    up_axis = stage.GetMetadata(tokens.UP_AXIS)
    if up_axis not in ("Y", "Z"):
        diagnostics.warn(
            "unreadable-attribute", f"{opened.source}.{tokens.UP_AXIS}", f"'{up_axis}' is no up axis; Y is taken"
        )
        up_axis = "Y"
    result: dict[str, Any] = {
        "source": opened.source,
        "meters_per_unit": _CENTIMETRES if metres is None else metres,
        "up_axis": str(up_axis),
    }
    if time_code is not None:
        result["time_code"] = time_code
    for name in (tokens.FRAMES_PER_SECOND, tokens.TIME_CODES_PER_SECOND):
        rate = _metadata_number(stage, name)
        if rate is not None:
            result["frames_per_second"] = rate
            break
    # As UsdStage has it, fallback included: what the shutter is in.
    result["time_codes_per_second"] = float(stage.GetTimeCodesPerSecond())
    return result
