"""Render settings, products and variables, flattened by the rules of UsdRenderComputeSpec.

``UsdRenderComputeSpec`` (pxr/usd/usdRender/spec.cpp) has no Python binding, so its rules stand here: a product begins
as a copy of the settings' base attributes, fallbacks included, and overrides them with what is authored on it;
variables are taken once each, in order; of attributes in namespaces, connections beat values. Three differences: a
resolution counts only if authored somewhere, ``instantaneousShutter`` (read from the wrong attribute upstream) is
honoured, and a connection gives the value of what it leads to instead of its path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..errors import StageError, UsageError
from ..frame_tokens import expand_frame_tokens
from . import tokens
from ._pxr import Sdf, Usd, UsdGeom, UsdRender
from .description import Diagnostics
from .materials import warn_unknown_names
from .values import authored, authored_namespace, place, plain, read

__all__ = [
    "all_settings",
    "binding_purposes",
    "find_settings",
    "read_settings",
    "rendered_purposes",
    "token_list",
    "typed_prim",
]


def all_settings(stage: Any) -> list[Any]:
    """Return every RenderSettings prim in the order of traversal."""
    return [prim for prim in stage.Traverse() if prim.IsA(UsdRender.Settings)]


def find_settings(stage: Any, wanted: str | None, source: str, diagnostics: Diagnostics | None = None) -> Any:
    """Return the RenderSettings prim to use, or None.

    The one asked for; else the one that the stage's metadata names; else the only one there is.

    Raises
    ------
    StageError
        The prim asked for (or named by the metadata) is not there or is something else.
    """
    if wanted:
        return typed_prim(stage, wanted, UsdRender.Settings, tokens.RENDER_SETTINGS, source)
    default = stage.GetMetadata(tokens.RENDER_SETTINGS_PRIM_PATH)
    if default:
        where = f"{source}.{tokens.RENDER_SETTINGS_PRIM_PATH}"
        return typed_prim(stage, str(default), UsdRender.Settings, tokens.RENDER_SETTINGS, where)
    found = all_settings(stage)
    if len(found) > 1 and diagnostics is not None:
        for prim in found:
            diagnostics.warn(
                "ambiguous-render-settings",
                place(prim),
                "the stage has several RenderSettings and names none as its own; none is used: choose one "
                "(--render-settings) or author the stage's renderSettingsPrimPath",
            )
    return found[0] if len(found) == 1 else None


def token_list(settings: Any, name: str) -> list[str] | None:
    """Return an attribute of tokens; None where there is no value.

    Raises
    ------
    StageError
        It holds something else.
    """
    value = plain(read(settings, name, Usd.TimeCode.Default()))
    if value is None:
        return None
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise StageError(f"{place(settings)}.{name} = {value}: is no list of tokens: correct the value")
    return value


def typed_prim(stage: Any, wanted: str, schema: Any, type_name: str, where: str) -> Any:
    """Return the prim at ``wanted`` if it is of ``schema``, else raise with what there is."""
    prim = None
    if Sdf.Path.IsValidPathString(wanted):
        prim = stage.GetPrimAtPath(Sdf.Path(wanted).MakeAbsolutePath(Sdf.Path.absoluteRootPath))
    if prim and prim.IsA(schema):
        return prim
    there = [str(p.GetPath()) for p in stage.Traverse() if p.IsA(schema)]
    remedy = f"choose one of {', '.join(there)}" if there else f"the stage has no {type_name}"
    problem = f"<{wanted}> is a {prim.GetTypeName() or 'prim without a type'}" if prim else f"there is no <{wanted}>"
    raise StageError(f"{where}: {problem}, not a {type_name}: {remedy}")


def read_settings(
    stage: Any,
    settings: Any,
    time: Any,
    frame: float,
    wanted_product: str | None,
    camera_index: Callable[[Any], int],
    camera_overridden: bool,
    source: str,
    diagnostics: Diagnostics,
) -> dict[str, Any]:
    """Return the settings of the description.

    Parameters
    ----------
    settings : RenderSettings prim, or None
    frame : for the tokens of product names
    wanted_product : path or name of the one product to keep, or None for all
    camera_index : gives the index of a Camera prim in the description
    camera_overridden : a camera was asked for explicitly, so that none is taken from the stage
    """
    reader = _Reader(stage, time, frame, camera_index, camera_overridden, diagnostics)
    result: dict[str, Any] = {"abbe": {}, "products": []}
    base = dict(_FALLBACKS)
    if settings is not None:
        result["path"] = str(settings.GetPath())
        result["abbe"] = reader.ours(settings, tokens.SETTINGS_NAMES)
        reader.override(base, settings)
        result["base"] = base
        prims = reader.targets(settings, tokens.PRODUCTS, UsdRender.Product, tokens.RENDER_PRODUCT)
        products = list(enumerate(prims))
    else:
        products = []
    if wanted_product is not None:
        products = [_wanted_product(stage, products, wanted_product, source)]
    result["products"] = [reader.product(prim, base, ordinal) for ordinal, prim in products]
    return result


def _wanted_product(stage: Any, products: list[tuple[int, Any]], wanted: str, source: str) -> tuple[int, Any]:
    """Return the product with that path or name: of the settings, else (by path) any on the stage."""
    for ordinal, prim in products:
        if wanted in (str(prim.GetPath()), prim.GetName()):
            return ordinal, prim
    if wanted.startswith("/") or not products:
        return 0, typed_prim(stage, wanted, UsdRender.Product, tokens.RENDER_PRODUCT, source)
    there = ", ".join(str(prim.GetPath()) for _, prim in products)
    raise StageError(f"{source}: the render settings have no product '{wanted}': choose one of {there}")


# The fallbacks of UsdRenderSettingsBase, as a product of the description.
_FALLBACKS: dict[str, Any] = {
    "path": "",
    "name": "",
    "product_type": tokens.RASTER,
    "pixel_aspect_ratio": 1.0,
    "aspect_ratio_conform_policy": tokens.EXPAND_APERTURE,
    "data_window_ndc": [0.0, 0.0, 1.0, 1.0],
    "disable_depth_of_field": False,
    "disable_motion_blur": False,
    "rendering_color_space": "",
    "abbe": {},
    "driver": {},
    "vars": [],
}


# From two samples on a value changes with time.
_VARYING = 2


class _Reader:
    """Reads the prims of one stage at one time."""

    def __init__(
        self,
        stage: Any,
        time: Any,
        frame: float,
        camera_index: Callable[[Any], int],
        camera_overridden: bool,
        diagnostics: Diagnostics,
    ) -> None:
        self._stage = stage
        self._time = time
        self._frame = frame
        self._camera_index = camera_index
        self._camera_overridden = camera_overridden
        self._diagnostics = diagnostics

    def override(self, base: dict[str, Any], prim: Any) -> None:
        """Set in ``base`` what is authored on ``prim``, a RenderSettings or RenderProduct."""
        base["path"] = str(prim.GetPath())
        resolution = self._authored(prim, tokens.RESOLUTION)
        if resolution is not None:
            base["resolution"] = self._numbers(prim, tokens.RESOLUTION, resolution, 2, int)
        ratio = self._authored(prim, tokens.PIXEL_ASPECT_RATIO)
        if ratio is not None:
            base["pixel_aspect_ratio"] = self._numbers(prim, tokens.PIXEL_ASPECT_RATIO, [ratio], 1, float)[0]
        policy = self._authored(prim, tokens.ASPECT_RATIO_CONFORM_POLICY)
        if policy is not None:
            base["aspect_ratio_conform_policy"] = str(policy)
        window = self._authored(prim, tokens.DATA_WINDOW_NDC)
        if window is not None:
            base["data_window_ndc"] = self._numbers(prim, tokens.DATA_WINDOW_NDC, window, 4, float)
        depth_of_field = self._authored(prim, tokens.DISABLE_DEPTH_OF_FIELD)
        if depth_of_field is not None:
            base["disable_depth_of_field"] = bool(depth_of_field)
        blur = [self._authored(prim, name) for name in (tokens.DISABLE_MOTION_BLUR, tokens.INSTANTANEOUS_SHUTTER)]
        if any(value is not None for value in blur):
            base["disable_motion_blur"] = any(blur)
        color_space = self._authored(prim, tokens.RENDERING_COLOR_SPACE)
        if color_space is not None:
            base["rendering_color_space"] = str(color_space)
        if not self._camera_overridden:
            cameras = self.targets(prim, tokens.CAMERA, UsdGeom.Camera, "Camera")
            if cameras:
                base["camera"] = self._camera_index(cameras[0])

    def product(self, prim: Any, base: dict[str, Any], ordinal: int) -> dict[str, Any]:
        """Return one product."""
        product = {**base, "abbe": self.ours(prim, tokens.SETTINGS_NAMES)}
        self.override(product, prim)
        product["product_type"] = str(read(prim, tokens.PRODUCT_TYPE, self._time) or tokens.RASTER)
        product["name"] = self._product_name(prim, ordinal)
        product["driver"] = self._driver(prim, tokens.DRIVER_NAMESPACES)
        prims = self.targets(prim, tokens.ORDERED_VARS, UsdRender.Var, tokens.RENDER_VAR)
        product["vars"] = [self._var(var) for var in dict.fromkeys(prims)]
        return product

    def _product_name(self, prim: Any, ordinal: int) -> str:
        name = str(read(prim, tokens.PRODUCT_NAME, self._time) or "")
        # Samples give each frame its name, as it is to be.
        if prim.GetAttribute(tokens.PRODUCT_NAME).GetNumTimeSamples() < _VARYING:
            name = expand_frame_tokens(name, self._frame, prim.GetName(), ordinal)
        if name in tokens.VIEWER_PRODUCT_NAMES:
            self._diagnostics.warn(
                "unusable-product-name",
                f"{place(prim)}.{tokens.PRODUCT_NAME}",
                f"'{name}' means a viewer window, not a file: give a file name (or OUT on the command line)",
            )
            return ""
        return name

    def _var(self, prim: Any) -> dict[str, Any]:
        return {
            "path": str(prim.GetPath()),
            "name": prim.GetName(),
            "source_name": str(read(prim, tokens.SOURCE_NAME, self._time) or ""),
            "source_type": str(read(prim, tokens.SOURCE_TYPE, self._time) or tokens.RAW),
            "data_type": str(read(prim, tokens.DATA_TYPE, self._time) or tokens.COLOR3F),
            "driver": self._driver(prim, tokens.AOV_DRIVER_NAMESPACES),
            "abbe": self.ours(prim, tokens.VAR_NAMES),
        }

    def _driver(self, prim: Any, namespaces: tuple[str, ...]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for namespace in namespaces:
            found.update(self._namespace(prim, namespace, strip=True))
        return found

    def _namespace(self, prim: Any, namespace: str, strip: bool = False) -> dict[str, Any]:
        """Return what is authored in a namespace; a connection counts before a value, and gives what it leads to."""
        found = authored_namespace(prim, namespace, self._time, strip=strip)
        for item in prim.GetAuthoredPropertiesInNamespace(namespace):
            if not isinstance(item, Usd.Attribute) or not item.HasAuthoredConnections():
                continue
            name = item.GetName()[len(namespace) + 1 :] if strip else item.GetName()
            value = self._connected(item)
            if value is not None:
                found[name] = value
        return found

    def _connected(self, attribute: Any) -> dict[str, Any] | None:
        """Return the value at the end of an attribute's connections; None, with a warning, where there is none."""
        seen = set()
        end = attribute
        while end and end.HasAuthoredConnections() and end.GetPath() not in seen:
            seen.add(end.GetPath())
            paths = end.GetConnections()
            end = self._stage.GetAttributeAtPath(paths[0]) if paths else None
        value = authored(end, self._time) if end and end.GetPath() not in seen else None
        if value is None:
            self._diagnostics.warn(
                "unresolved-connection",
                place(attribute),
                "its connection leads to no value; its own counts, if it has one",
            )
        return value

    def ours(self, prim: Any, known: Mapping[str, str]) -> dict[str, Any]:
        """Return the authored ``abbe:`` attributes; unknown ones are warned of."""
        found = self._namespace(prim, tokens.ABBE)
        warn_unknown_names(str(prim.GetPath()), found, known, self._diagnostics)
        return found

    def targets(self, prim: Any, name: str, schema: Any, type_name: str) -> list[Any]:
        """Return the prims that a relationship leads to, each of ``schema``.

        Raises
        ------
        StageError
            A target is not on the stage or of another type.
        """
        relationship = prim.GetRelationship(name)
        if not relationship:
            return []
        found = []
        for path in relationship.GetForwardedTargets():
            target = self._stage.GetPrimAtPath(path) if path.IsPrimPath() else None
            if not target:
                raise StageError(
                    f"{place(prim)}.{name}: there is no <{path}> on the stage: correct the relationship's target"
                )
            if not target.IsA(schema):
                what = target.GetTypeName() or "prim without a type"
                raise StageError(f"{place(prim)}.{name}: <{path}> is a {what}, not a {type_name}: correct the target")
            found.append(target)
        return found

    def _authored(self, prim: Any, name: str) -> Any:
        attribute = prim.GetAttribute(name)
        if not attribute or not attribute.HasAuthoredValue():
            return None
        return read(prim, name, self._time)

    def _numbers(self, prim: Any, name: str, value: Any, count: int, kind: Callable[[Any], Any]) -> list[Any]:
        """Return ``count`` finite numbers, or raise: a wrong window or size renders something else than was meant."""
        numbers = value if isinstance(value, list) else plain(value)
        if (
            not isinstance(numbers, list)
            or len(numbers) != count
            or not all(isinstance(n, (int, float)) and math.isfinite(n) for n in numbers)
        ):
            raise StageError(f"{place(prim)}.{name} = {value}: is not {count} finite number(s): correct the value")
        return [kind(number) for number in numbers]


def rendered_purposes(wanted: Sequence[str] | None, settings: Any) -> frozenset[str]:
    """Return the purposes to render: those asked for, else the settings', else default and render; default always."""
    if wanted is None:
        authored = None if settings is None else token_list(settings, tokens.INCLUDED_PURPOSES)
        return frozenset([tokens.DEFAULT, *(tokens.DEFAULT_PURPOSES if authored is None else authored)])
    if isinstance(wanted, str):
        wanted = wanted.replace(",", " ").split()
    for purpose in wanted:
        if purpose not in tokens.PURPOSES:
            raise UsageError(f"purposes: '{purpose}' is none: choose from {', '.join(tokens.PURPOSES)}")
    return frozenset([tokens.DEFAULT, *wanted])


def binding_purposes(settings: Any) -> Sequence[str]:
    """Return the material purposes in the order in which they count: the settings', else full and all-purpose."""
    authored = None if settings is None else token_list(settings, tokens.MATERIAL_BINDING_PURPOSES)
    if authored is None:
        return tokens.BINDING_PURPOSES
    return ["" if purpose == tokens.ALL_PURPOSE_ALIAS else purpose for purpose in authored]
