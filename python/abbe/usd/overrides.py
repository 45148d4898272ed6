"""Variants and values set for one render, in a session layer of our own: names that do not exist are errors."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import StageError, UsageError
from . import tokens
from ._pxr import Sdf
from .values import place

if TYPE_CHECKING:
    from .stage import OpenedStage

__all__ = ["Overrides", "select_variant", "set_value", "split_override"]

Overrides = Mapping[str, Any] | Sequence[str]
"""``{"/World/Glass.inputs:ior": 1.6}`` or ``["/World/Glass.inputs:ior=1.6"]``."""

_VARIANT = re.compile(r"^(?P<prim>[^{}]+)\{(?P<set>[^{}=]+)=(?P<name>[^{}=]*)\}$")


def select_variant(opened: OpenedStage, text: str) -> None:
    """Select a variant, given as ``/World/Ball{material=glass}``; USD itself would accept names that do not exist."""
    match = _VARIANT.match(text.strip())
    if not match:
        raise UsageError(
            f"variant '{text}': is not of the form PRIM{{SET=NAME}}, such as /World/Ball{{material=glass}}"
        )
    prim = _prim(opened, match["prim"], f"variant '{text}'")
    sets = prim.GetVariantSets()
    if match["set"] not in sets.GetNames():
        raise StageError(f"{place(prim)}: has no variant set '{match['set']}': {_choice('sets', sets.GetNames())}")
    variant_set = sets.GetVariantSet(match["set"])
    if match["name"] not in variant_set.GetVariantNames():
        choice = _choice("variants", variant_set.GetVariantNames())
        raise StageError(f"{place(prim)}{{{match['set']}}}: has no variant '{match['name']}': {choice}")
    variant_set.SetVariantSelection(match["name"])


def _choice(what: str, names: Sequence[str]) -> str:
    return f"choose one of {', '.join(sorted(names))}" if names else f"it has no {what}"


def _prim(opened: OpenedStage, path: str, option: str) -> Any:
    if not Sdf.Path.IsValidPathString(path) or not Sdf.Path(path).IsAbsoluteRootOrPrimPath():
        raise UsageError(f"{option}: '{path}' is no prim path: give one such as /World/Ball")
    prim = opened.stage.GetPrimAtPath(Sdf.Path(path).MakeAbsolutePath(Sdf.Path.absoluteRootPath))
    if not prim:
        raise StageError(f"<{path}>: there is no such prim in {opened.source}: correct {option}")
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        raise StageError(f"{place(prim)}: lies in an instance, which USD does not override: correct {option}")
    return prim


def split_override(text: str) -> tuple[str, str]:
    target, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"override '{text}': is not of the form PRIM.ATTR=VALUE, such as /World/Glass.inputs:ior=1.6")
    return target.strip(), value.strip()


def set_value(opened: OpenedStage, target: str, value: Any) -> None:
    """Set an attribute of the session layer; text is read as .usda has it, in the attribute's own type."""
    option = f"override '{target}'"
    prim_path, dot, name = target.partition(".")
    if not dot or not name:
        raise UsageError(f"{option}: is no attribute: give one such as /World/Glass.inputs:ior")
    prim = _prim(opened, prim_path, option)
    attribute = prim.GetAttribute(name)
    if not attribute:
        attribute = _our_attribute(prim, name)
    if not attribute:
        near = sorted(a.GetName() for a in prim.GetAuthoredAttributes())
        raise StageError(f"{place(prim)}: has no attribute '{name}': {_choice('authored attributes', near)}")
    if attribute.HasAuthoredConnections():
        driver = attribute.GetConnections()[0]
        raise StageError(f"{place(prim)}.{name}: is driven by {place(driver)}, so a value has no effect: set that one")
    type_name = attribute.GetTypeName()
    if isinstance(value, str):
        value = _parse(value, type_name, f"{place(prim)}.{name}")
    try:
        done = attribute.Set(value)
    except (TypeError, RuntimeError):
        done = False
    if not done:
        raise StageError(f"{place(prim)}.{name} = {value}: is no value of type {type_name}: correct {option}")


def _our_attribute(prim: Any, name: str) -> Any:
    """Return an attribute of our own schemas, declared where the prim's type may carry it; else None."""
    for schema, names in tokens.OUR_SCHEMAS.items():
        if prim.GetTypeName() == schema and name in names:
            return prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(names[name]), False)
    return None


def _parse(text: str, type_name: Any, where: str) -> Any:
    """Return the value that ``text`` means for a type, read by USD's own parser."""
    name = str(type_name)
    if name in ("string", "token"):
        return _unquoted(text)
    if name == "asset":
        return Sdf.AssetPath(_unquoted(text.strip("@")))
    problem = StageError(f"{where} = {text}: is no value of type {name}: write it as .usda does")
    if "\n" in text or "\r" in text:
        raise problem
    if name == "bool":
        text = {"true": "1", "false": "0"}.get(text.lower(), text)
    layer = Sdf.Layer.CreateAnonymous("abbe-value.usda")
    try:
        read = layer.ImportFromString(f'#usda 1.0\nover "x"\n{{\n    {name} value = {text}\n}}\n')
    except RuntimeError:
        read = False
    spec = layer.GetAttributeAtPath("/x.value") if read else None
    if spec is None or spec.default is None or len(layer.rootPrims) != 1 or len(layer.rootPrims[0].properties) != 1:
        raise problem
    if not set(spec.ListInfoKeys()) <= {"custom", "default", "typeName", "variability"}:
        raise problem
    return spec.default


def _unquoted(text: str) -> str:
    return text[1:-1] if len(text) >= 2 and text[0] == text[-1] and text[0] in "\"'" else text
