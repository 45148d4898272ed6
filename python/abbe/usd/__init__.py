"""The bridge: the one part of abbe that knows USD. It forwards what was authored; what it means is decided in Rust.

``pxr`` is imported when the first stage is read, so that the rest of the package works without USD.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from . import tokens
from .description import Description

if TYPE_CHECKING:
    from .listing import CameraInfo, SettingsInfo

__all__ = ["Description", "describe", "keep_open", "list_cameras", "list_settings"]


def describe(
    stage_or_path: Any,
    *,
    frame: float | Literal["default"] | None = None,
    camera: str | None = None,
    render_settings: str | None = None,
    render_pass: str | None = None,
    product: str | None = None,
    purposes: Sequence[str] | None = None,
    variants: Sequence[str] = (),
    overrides: Mapping[str, Any] | Sequence[str] = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
    missing: str = "warn",
    motion_blur: bool | None = None,
    motion_vectors: bool | None = None,
    complexity: str | None = None,
    scalar_ior: str | None = None,
    strict: bool = False,
) -> Description:
    """Read a USD stage into a scene description.

    Parameters
    ----------
    stage_or_path : path of a .usd, .usda, .usdc or .usdz file, or a ``pxr.Usd.Stage``, which is not changed, or what
        :func:`keep_open` returned
    frame : time code; the stage's start if None; ``"default"`` reads default values instead of time samples
    camera : path of a Camera, or the name of the first; it then replaces the cameras that products name
    render_settings : path of a RenderSettings prim; the stage's own, or its only one, if None
    render_pass : path of a RenderPass prim: its settings, and what it shows, hides and prunes
    product : path or name of the one RenderProduct to keep
    purposes : of default, render, proxy, guide (default always counts); the settings', else default and render, if None
    variants : selections such as ``"/World/Ball{material=glass}"``
    overrides : values such as ``"/World/Glass.inputs:ior=1.6"``, as text or as a mapping to Python values
    search_paths : folders in which relative asset paths are looked up after the stage's own
    session_layer : a layer stronger than all of the stage, which is not changed
    mask : paths of the prims to load, with what they are bound to, connected to or show; everything if empty
    payloads : ``"all"`` or ``"none"``; a stage in memory keeps its own rules unless none are wanted
    missing : what to do where a layer, prim or texture that is referred to is missing: ``"warn"`` or ``"error"``
    motion_blur : whether to read motion while shutters are open; as the stage's products say if None
    motion_vectors : read motion up to the next frame; where the RenderVars ask for it if None
    complexity : ``"low"``, ``"medium"``, ``"high"`` or ``"veryhigh"``: subdivision surfaces are divided 0 to 3 times;
        ``abbe:subdivision:level`` of a mesh counts first; by its size if None, 2 for most
    scalar_ior : of an index without dispersion: ``"constant"`` or ``"nearest-glass"``; the settings' if None
    strict : a stage without a camera is an error

    Returns
    -------
    Description
        The document and its arrays; arrays are float32 or int32, read-only where they are USD's own memory.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The stage cannot be read or lacks what was asked for; the message begins with the prim path or file.
    UsageError
        An argument cannot be understood.
    UsdMissingError
        ``pxr`` cannot be imported.
    """
    from .reader import read_stage

    description = read_stage(
        stage_or_path,
        frame=frame,
        camera=camera,
        render_settings=render_settings,
        render_pass=render_pass,
        product=product,
        purposes=purposes,
        variants=variants,
        overrides=overrides,
        search_paths=search_paths,
        session_layer=session_layer,
        mask=mask,
        payloads=payloads,
        missing=missing,
        motion_blur=motion_blur,
        motion_vectors=motion_vectors,
        complexity=complexity,
        strict=strict,
    )
    if scalar_ior is not None:
        description.document["settings"]["abbe"][tokens.SCALAR_IOR] = {"type": "token", "value": scalar_ior}
    return description


def keep_open(path: str | os.PathLike[str]) -> Any:
    """Return a stage file to :func:`describe` at several frames: it is opened once, its layers are read once.

    Everything but the frame has to be asked for in the same way each time. The stage is closed when what was returned
    is no longer in use.

    Parameters
    ----------
    path : of a .usd, .usda, .usdc or .usdz file
    """
    from .stage import KeptStage

    return KeptStage(path)


def list_cameras(
    stage_or_path: Any,
    *,
    frame: float | Literal["default"] | None = None,
    variants: Sequence[str] = (),
    overrides: Mapping[str, Any] | Sequence[str] = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
) -> list[CameraInfo]:
    """List the cameras of a stage in the order of traversal.

    Parameters
    ----------
    stage_or_path, frame, variants, overrides, search_paths, session_layer, mask, payloads : as for :func:`describe`

    Returns
    -------
    list of CameraInfo
        One of them has ``is_default`` set: that which :func:`describe` takes if none is asked for.
    """
    from .listing import cameras

    return cameras(
        stage_or_path,
        frame=frame,
        variants=variants,
        overrides=overrides,
        search_paths=search_paths,
        session_layer=session_layer,
        mask=mask,
        payloads=payloads,
    )


def list_settings(
    stage_or_path: Any,
    *,
    frame: float | Literal["default"] | None = None,
    variants: Sequence[str] = (),
    overrides: Mapping[str, Any] | Sequence[str] = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
) -> list[SettingsInfo]:
    """List the render settings of a stage with their products and variables.

    Parameters
    ----------
    stage_or_path, frame, variants, overrides, search_paths, session_layer, mask, payloads : as for :func:`describe`

    Returns
    -------
    list of SettingsInfo
        One of them has ``is_default`` set if :func:`describe` would take it unasked. Empty if there are none.
    """
    from .listing import settings

    return settings(
        stage_or_path,
        frame=frame,
        variants=variants,
        overrides=overrides,
        search_paths=search_paths,
        session_layer=session_layer,
        mask=mask,
        payloads=payloads,
    )
