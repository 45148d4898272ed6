"""What a render begins with: a stage that can be read, a camera, settings, variables."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from .. import _core
from ..usd import tokens
from ..usd._pxr import Sdf, UsdRender
from ..usd.cameras import all_cameras
from ..usd.render import all_settings
from . import Finding, Severity
from .materials import closest
from .reading import Reading, Remark

__all__ = ["camera", "render_settings", "render_vars", "stage"]


def stage(reading: Reading) -> Iterator[Finding]:
    """Tell why the stage cannot be read, or which prims cannot be rendered, if so."""
    for refusal in reading.refusals:
        # What the settings are refused for is told of there, for each of them.
        if refusal not in reading.render_remarks:
            yield reading.finding("abbe:Stage", refusal)


def camera(reading: Reading) -> Iterator[Finding]:
    """Tell of a stage without a camera; one without render settings is most likely an asset, which needs none."""
    if all_cameras(reading.stage):
        return
    severity: Severity = "warning" if all_settings(reading.stage) else "info"
    yield reading.found(
        "abbe:Camera",
        "missing-camera",
        severity,
        reading.source,
        "has no camera, so that what is rendered is framed by a 50 mm lens (refused under --strict): add a Camera",
    )


def render_vars(reading: Reading) -> Iterator[Finding]:
    """Tell of variables that the core has no AOV for, and of those that get into each other's way."""
    names = {row["name"] for row in _core.aovs()} | set(_core.aov_aliases())
    for remark in reading.render_remarks:
        prim = _render_var(reading, remark)
        if not prim or remark.kind == "unknown-attribute":
            continue
        finding = reading.finding("abbe:RenderVars", remark)
        if remark.kind == "unavailable-render-var":
            source = str(prim.GetAttribute(tokens.SOURCE_NAME).Get() or prim.GetName())
            if source in names:
                # Light transport, for instance, which another integrator may have.
                finding = dataclasses.replace(finding, severity="info")
            else:
                finding = dataclasses.replace(finding, message=f"{finding.message}{closest(source, names)}")
        yield finding


def render_settings(reading: Reading) -> Iterator[Finding]:
    """Tell what the core says of the settings and products."""
    for remark in reading.render_remarks:
        # Misspelt names are the matter of another validator.
        if remark.kind != "unknown-attribute" and not _render_var(reading, remark):
            yield reading.finding("abbe:RenderSettings", remark)


def _render_var(reading: Reading, remark: Remark) -> Any:
    """Return the RenderVar prim that a remark is about; None if it is about something else."""
    path = reading.finding("", remark).path
    prim = reading.stage.GetPrimAtPath(Sdf.Path(path).GetPrimPath())
    return prim if prim and prim.IsA(UsdRender.Var) else None
