"""What a stage offers to choose from: cameras and render settings, as plain records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Unpack

from . import tokens
from ._pxr import UsdGeom, UsdRender
from .cameras import all_cameras, default_camera, read_camera
from .composition import quiet_usd
from .description import Diagnostics
from .metadata import stage_time
from .render import all_settings, find_settings, read_settings, token_list
from .stage import Opening, open_stage, source_name

__all__ = ["CameraInfo", "ProductInfo", "SettingsInfo", "VarInfo", "cameras", "settings"]


@dataclass(frozen=True)
class CameraInfo:
    """A camera of a stage; lengths in tenths of a stage unit, as UsdGeomCamera has them."""

    path: str
    projection: str
    focal_length: float
    horizontal_aperture: float
    vertical_aperture: float
    f_stop: float
    is_default: bool


@dataclass(frozen=True)
class VarInfo:
    """A RenderVar."""

    path: str
    name: str
    source_name: str
    source_type: str
    data_type: str
    layer: str
    """What the EXR layer is called: ``driver:parameters:aov:name``, else the prim's name."""
    format: str
    """``driver:parameters:aov:format``; empty where none is authored."""


@dataclass(frozen=True)
class ProductInfo:
    """A RenderProduct, flattened."""

    path: str
    name: str
    """File name, frame tokens replaced."""
    product_type: str
    resolution: tuple[int, int] | None
    """None where neither the product nor its settings author one."""
    camera: str | None
    vars: tuple[VarInfo, ...]
    pixel_aspect_ratio: float
    aspect_ratio_conform_policy: str
    data_window_ndc: tuple[float, float, float, float]
    """xmin, ymin, xmax, ymax, y up."""
    disable_depth_of_field: bool
    disable_motion_blur: bool
    driver: tuple[tuple[str, Any], ...]
    """Authored ``driver:parameters:…``, without that prefix."""


@dataclass(frozen=True)
class SettingsInfo:
    """A RenderSettings prim."""

    path: str
    is_default: bool
    resolution: tuple[int, int] | None
    camera: str | None
    purposes: tuple[str, ...]
    products: tuple[ProductInfo, ...]
    passes: tuple[str, ...]
    """Paths of the RenderPass prims that render these settings."""


def cameras(stage_or_path: Any, *, frame: float | str | None, **opening: Unpack[Opening]) -> list[CameraInfo]:
    """Return the cameras of a stage; see :func:`abbe.usd.list_cameras`."""
    diagnostics = Diagnostics()
    with quiet_usd(source_name(stage_or_path), diagnostics):
        opened = open_stage(stage_or_path, diagnostics=diagnostics, **opening)
        time, _ = stage_time(opened.stage, frame)
        prims = all_cameras(opened.stage)
        default = default_camera(opened.stage, find_settings(opened.stage, None, opened.source), prims)
        transforms = UsdGeom.XformCache(time)
        return [_camera_info(read_camera(prim, time, transforms), prim == default) for prim in prims]


def _camera_info(camera: dict[str, Any], is_default: bool) -> CameraInfo:
    names = ("path", "projection", "focal_length", "horizontal_aperture", "vertical_aperture", "f_stop")
    return CameraInfo(**{name: camera[name] for name in names}, is_default=is_default)


def settings(stage_or_path: Any, *, frame: float | str | None, **opening: Unpack[Opening]) -> list[SettingsInfo]:
    """Return the render settings of a stage; see :func:`abbe.usd.list_settings`."""
    diagnostics = Diagnostics()
    with quiet_usd(source_name(stage_or_path), diagnostics):
        opened = open_stage(stage_or_path, diagnostics=diagnostics, **opening)
        stage, source = opened.stage, opened.source
        time, time_code = stage_time(stage, frame)
        default = find_settings(stage, None, source)
        found = []
        passes = _passes(stage)
        for prim in all_settings(stage):
            seen: list[str] = []

            def index(camera: Any, seen: list[str] = seen) -> int:
                seen.append(str(camera.GetPath()))
                return len(seen) - 1

            document = read_settings(stage, prim, time, time_code or 0.0, None, index, False, source, diagnostics)
            passes_of_it = passes.get(str(prim.GetPath()), [])
            found.append(_settings_info(prim, document, seen, prim == default, passes_of_it))
        return found


_AS_THEY_ARE = (
    "pixel_aspect_ratio",
    "aspect_ratio_conform_policy",
    "disable_depth_of_field",
    "disable_motion_blur",
)


def _var_info(var: dict[str, Any]) -> VarInfo:
    names = ("path", "name", "source_name", "source_type", "data_type")

    def parameter(name: str) -> str:
        return str(var["driver"].get(name, {}).get("value", ""))

    return VarInfo(
        **{name: var[name] for name in names},
        layer=parameter("channel_prefix") + (parameter("name") or var["name"]),
        format=parameter("format"),
    )


def _passes(stage: Any) -> dict[str, list[str]]:
    """Return the RenderPass prims of a stage by the path of the settings that they render."""
    found: dict[str, list[str]] = {}
    for prim in stage.Traverse():
        relationship = prim.GetRelationship(tokens.RENDER_SOURCE) if prim.IsA(UsdRender.Pass) else None
        targets = relationship.GetForwardedTargets() if relationship else []
        if targets:
            found.setdefault(str(targets[0]), []).append(str(prim.GetPath()))
    return found


def _settings_info(
    prim: Any, document: dict[str, Any], cameras_seen: list[str], is_default: bool, passes: list[str]
) -> SettingsInfo:
    def camera_of(product: dict[str, Any]) -> str | None:
        return cameras_seen[product["camera"]] if "camera" in product else None

    def resolution_of(product: dict[str, Any]) -> tuple[int, int] | None:
        return tuple(product["resolution"]) if "resolution" in product else None

    products = tuple(
        ProductInfo(
            path=product["path"],
            name=product["name"],
            product_type=product["product_type"],
            resolution=resolution_of(product),
            camera=camera_of(product),
            vars=tuple(_var_info(var) for var in product["vars"]),
            data_window_ndc=tuple(product["data_window_ndc"]),
            driver=tuple((name, value["value"]) for name, value in sorted(product["driver"].items())),
            **{name: product[name] for name in _AS_THEY_ARE},
        )
        for product in document["products"]
    )
    base = document["base"]
    purposes = token_list(prim, tokens.INCLUDED_PURPOSES)
    return SettingsInfo(
        path=base["path"],
        is_default=is_default,
        resolution=resolution_of(base),
        camera=camera_of(base),
        purposes=tokens.DEFAULT_PURPOSES if purposes is None else tuple(purposes),
        products=products,
        passes=tuple(passes),
    )
