"""Lights (UsdLux): read as authored, fallbacks of the schema filled in, whether or not anything will look at them.

A light costs a few numbers; its texture and its photometric profile are only named. Attributes are read under the names
of USD 21.02 and later (``inputs:intensity``) or, where those are not authored, the older ones (``intensity``). What a
number means is decided by the core; a light with a value that is none is left out, with a warning.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from . import tokens
from ._pxr import Usd, UsdLux, UsdShade
from .assets import AssetReader
from .description import BrokenError, Diagnostics
from .materials import warn_unknown_names
from .values import authored_namespace, place, plain, read

__all__ = ["LightReader", "is_light"]


def is_light(prim: Any) -> bool:
    """Return whether a prim shines: lights of UsdLux do, and geometry with LightAPI, as MeshLightAPI brings it."""
    return bool(prim.HasAPI(UsdLux.LightAPI))


class LightReader:
    """Reads lights for the description."""

    def __init__(self, time: Any, up_axis: str, assets: AssetReader, diagnostics: Diagnostics) -> None:
        self._time = time
        self._up_axis = up_axis
        self._assets = assets
        self._diagnostics = diagnostics
        self._shapes: list[tuple[Any, Callable[[Any], dict[str, Any]]]] = [
            (UsdLux.DistantLight, self._distant),
            (UsdLux.RectLight, self._rect),
            (UsdLux.DiskLight, self._disk),
            (UsdLux.SphereLight, self._sphere),
            (UsdLux.CylinderLight, self._cylinder),
            (UsdLux.DomeLight, self._dome),
            (UsdLux.DomeLight_1, self._dome),
            (UsdLux.PortalLight, self._portal),
            (UsdLux.GeometryLight, self._geometry),
        ]

    def read(self, prim: Any, *, is_geometry: bool) -> dict[str, Any] | None:
        """Return a light without its place and its links; None with a warning where there is no such light.

        ``is_geometry`` says that the prim is placed as a shape too.

        Raises
        ------
        BrokenError
            A value of it is none.
        """
        read_shape = next((reader for schema, reader in self._shapes if prim.IsA(schema)), None)
        if is_geometry:
            read_shape = self._shining
        if read_shape is None:
            self._diagnostics.warn(
                "unsupported-light", place(prim), f"{_type(prim)} prims are not supported as lights; it does not shine"
            )
            return None
        light = self._light(prim, read_shape)
        self._check_filters(prim)
        return light

    def _light(self, prim: Any, read_shape: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        light: dict[str, Any] = {
            "path": str(prim.GetPath()),
            "shape": read_shape(prim),
            "intensity": self._number(prim, tokens.INTENSITY),
            "exposure": self._number(prim, tokens.LIGHT_EXPOSURE),
            "normalize": self._flag(prim, tokens.NORMALIZE),
            "color": self._color(prim, tokens.COLOR),
            "enable_color_temperature": self._flag(prim, tokens.ENABLE_COLOR_TEMPERATURE),
            "color_temperature": self._number(prim, tokens.COLOR_TEMPERATURE),
            "diffuse": self._number(prim, tokens.DIFFUSE),
            "specular": self._number(prim, tokens.SPECULAR),
        }
        shaping, shadow = self._shaping(prim), self._shadow(prim)
        if shaping is not None:
            light["shaping"] = shaping
        if shadow is not None:
            light["shadow"] = shadow
        abbe = {
            f"{tokens.ABBE_PREFIX}{name}": value
            for name, value in authored_namespace(prim, tokens.ABBE, self._time, strip=True).items()
            # A lens may shine.
            if not f"{tokens.ABBE_PREFIX}{name}".startswith(tokens.LENS_PREFIX)
        }
        if abbe:
            light["abbe"] = abbe
            warn_unknown_names(light["path"], abbe, tokens.LIGHT_NAMES, self._diagnostics)
        physical = authored_namespace(prim, tokens.PHYSICAL, self._time, strip=True)
        if physical:
            light["physical"] = physical
        return light

    # Shapes

    def _distant(self, prim: Any) -> dict[str, Any]:
        return {"distant": {"angle": self._number(prim, tokens.ANGLE)}}

    def _rect(self, prim: Any) -> dict[str, Any]:
        return {"rect": {**self._sides(prim), "texture": self._texture(prim)}}

    def _portal(self, prim: Any) -> dict[str, Any]:
        return {"portal": self._sides(prim)}

    def _sides(self, prim: Any) -> dict[str, Any]:
        return {"width": self._number(prim, tokens.WIDTH), "height": self._number(prim, tokens.HEIGHT)}

    def _disk(self, prim: Any) -> dict[str, Any]:
        return {"disk": {"radius": self._number(prim, tokens.RADIUS)}}

    def _sphere(self, prim: Any) -> dict[str, Any]:
        hint = bool(read(prim, tokens.TREAT_AS_POINT, self._time))
        return {"sphere": {"radius": self._number(prim, tokens.RADIUS), "treat_as_point": hint}}

    def _cylinder(self, prim: Any) -> dict[str, Any]:
        hint = bool(read(prim, tokens.TREAT_AS_LINE, self._time))
        length, radius = self._number(prim, tokens.LENGTH), self._number(prim, tokens.RADIUS)
        return {"cylinder": {"length": length, "radius": radius, "treat_as_line": hint}}

    def _dome(self, prim: Any) -> dict[str, Any]:
        # The older schema says that the pole is on +Y, whatever the stage's up axis.
        pole = str(read(prim, tokens.POLE_AXIS, self._time)) if prim.IsA(UsdLux.DomeLight_1) else "Y"
        radius = read(prim, tokens.GUIDE_RADIUS, self._time)
        return {
            "dome": {
                "texture": self._texture(prim),
                "format": str(self._value(prim, tokens.TEXTURE_FORMAT) or tokens.AUTOMATIC),
                "pole_axis": self._up_axis if pole == tokens.SCENE else pole,
                "guide_radius": self._finite(prim, tokens.GUIDE_RADIUS, radius),
                "portals": self._targets(prim, tokens.PORTALS, UsdLux.PortalLight),
            }
        }

    def _geometry(self, prim: Any) -> dict[str, Any]:
        targets = self._targets(prim, tokens.GEOMETRY, None)
        return {"geometry": {"prims": targets, "material_sync_mode": self._sync_mode(prim)}}

    def _shining(self, prim: Any) -> dict[str, Any]:
        return {"geometry": {"prims": [str(prim.GetPath())], "material_sync_mode": self._sync_mode(prim)}}

    def _sync_mode(self, prim: Any) -> str:
        return str(read(prim, tokens.MATERIAL_SYNC_MODE, self._time) or tokens.NO_MATERIAL_RESPONSE)

    def _texture(self, prim: Any) -> int | None:
        attribute = self._attribute(prim, tokens.TEXTURE_FILE)
        return self._assets.texture(attribute) if attribute else None

    def _targets(self, prim: Any, name: str, schema: Any) -> list[str]:
        """Return the targets of a relationship; those that are no prims of ``schema`` are named in a warning."""
        relationship = prim.GetRelationship(name)
        found = []
        for path in relationship.GetForwardedTargets() if relationship else []:
            target = prim.GetStage().GetPrimAtPath(path)
            if target and (schema is None or target.IsA(schema)):
                found.append(str(path))
            else:
                what = f"is a {_type(target)}" if target else "is not there"
                self._diagnostics.warn("light", f"{place(prim)}.{name}", f"<{path}> {what}; it is ignored")
        return found

    # Applied schemas

    def _shaping(self, prim: Any) -> dict[str, Any] | None:
        get = self._applied(prim, UsdLux.ShapingAPI, tokens.SHAPING)
        if get is None:
            return None
        # Without the schema nothing says that there is a cone.
        whole = None if prim.HasAPI(UsdLux.ShapingAPI) else 180.0
        shaping = {
            "focus": self._finite(prim, *get(tokens.SHAPING_FOCUS)),
            "focus_tint": self._three(prim, *get(tokens.SHAPING_FOCUS_TINT)),
            "cone_angle": self._finite(prim, *get(tokens.SHAPING_CONE_ANGLE, whole)),
            "cone_softness": self._finite(prim, *get(tokens.SHAPING_CONE_SOFTNESS)),
            "ies_angle_scale": self._finite(prim, *get(tokens.SHAPING_IES_ANGLE_SCALE)),
            "ies_normalize": bool(get(tokens.SHAPING_IES_NORMALIZE)[1]),
        }
        attribute = self._attribute(prim, tokens.SHAPING_IES_FILE)
        profile = self._assets.asset(attribute) if attribute else None
        if profile is not None:
            shaping["ies"] = profile
        return shaping

    def _shadow(self, prim: Any) -> dict[str, Any] | None:
        get = self._applied(prim, UsdLux.ShadowAPI, tokens.SHADOW)
        if get is None:
            return None
        return {
            "enable": bool(get(tokens.SHADOW_ENABLE)[1]),
            "color": self._three(prim, *get(tokens.SHADOW_COLOR)),
            "distance": self._finite(prim, *get(tokens.SHADOW_DISTANCE)),
            "falloff": self._finite(prim, *get(tokens.SHADOW_FALLOFF)),
            "falloff_gamma": self._finite(prim, *get(tokens.SHADOW_FALLOFF_GAMMA)),
        }

    def _applied(self, prim: Any, schema: Any, namespace: str) -> Callable[..., tuple[str, Any]] | None:
        """Return a function from a name to attribute and value by a schema; None if it is not applied or authored."""
        names = (f"{tokens.INPUTS_PREFIX}{namespace}", namespace)
        is_authored = any(
            isinstance(item, Usd.Attribute) for name in names for item in prim.GetAuthoredPropertiesInNamespace(name)
        )
        if not prim.HasAPI(schema) and not is_authored:
            return None
        definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(schema.__name__)

        def get(name: str, otherwise: Any = None) -> tuple[str, Any]:
            value = self._value(prim, name)
            if value is None:
                value = otherwise
            if value is None:
                value = definition.GetAttributeFallbackValue(f"{tokens.INPUTS_PREFIX}{name}")
            return f"{tokens.INPUTS_PREFIX}{name}", value

        return get

    def _check_filters(self, prim: Any) -> None:
        for name in (tokens.LIGHT_FILTERS, tokens.OLD_LIGHT_FILTERS):
            relationship = prim.GetRelationship(name)
            if relationship and relationship.GetForwardedTargets():
                self._diagnostics.warn(
                    "light-filter", f"{place(prim)}.{name}", "light filters are not supported; it shines unfiltered"
                )

    # Values

    def _attribute(self, prim: Any, name: str) -> Any:
        """Return the attribute of an input, under its older name where that alone is authored; None without one."""
        attribute = prim.GetAttribute(f"{tokens.INPUTS_PREFIX}{name}")
        if attribute and (attribute.HasAuthoredValue() or attribute.HasAuthoredConnections()):
            return self._source(attribute)
        older = prim.GetAttribute(name)
        if older and older.HasAuthoredValue():
            return older
        return attribute or None

    def _source(self, attribute: Any) -> Any:
        """Return the attribute that gives an input its value: itself, or another that it is connected to."""
        if not attribute.HasAuthoredConnections():
            return attribute
        found = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
        if len(found) == 1 and not UsdShade.Output.IsOutput(found[0]):
            return found[0]
        self._diagnostics.warn(
            "light-network",
            place(attribute),
            "is driven by a shading network, which is not supported for lights; its own value is used",
        )
        return attribute

    def _value(self, prim: Any, name: str) -> Any:
        attribute = self._attribute(prim, name)
        if attribute is None:
            return None
        try:
            return attribute.Get(self._time)
        except (RuntimeError, TypeError, ValueError):
            return None

    def _number(self, prim: Any, name: str) -> float:
        return self._finite(prim, f"{tokens.INPUTS_PREFIX}{name}", self._value(prim, name))

    def _flag(self, prim: Any, name: str) -> bool:
        value = self._value(prim, name)
        if isinstance(value, (bool, int)):
            return bool(value)
        raise BrokenError(f"{place(prim)}.{tokens.INPUTS_PREFIX}{name}", f"is {value}, neither true nor false")

    def _color(self, prim: Any, name: str) -> list[float]:
        return self._three(prim, f"{tokens.INPUTS_PREFIX}{name}", self._value(prim, name))

    @staticmethod
    def _finite(prim: Any, name: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise BrokenError(f"{place(prim)}.{name}", f"is {value}, which is no finite number")
        return float(value)

    @staticmethod
    def _three(prim: Any, name: str, value: Any) -> list[float]:
        numbers = plain(value)
        if not isinstance(numbers, list) or len(numbers) != 3 or not all(type(n) in (int, float) for n in numbers):
            raise BrokenError(f"{place(prim)}.{name}", f"is {value}, which is no colour of three finite numbers")
        return [float(number) for number in numbers]


def _type(prim: Any) -> str:
    return prim.GetTypeName() or "prim without a type"
