"""Materials: possible laws, known glasses, known names, and laws that something uses."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ..usd import tokens
from ..usd._pxr import UsdShade
from ..usd.values import place
from . import Finding
from .reading import CompiledMaterial, Reading, Remark, shared_source

__all__ = ["attribute_names", "closest", "dispersion", "glass_name", "units", "unused_dispersion"]

GLASS = "abbe:glass"
# Kinds of the core's warnings that other validators tell of.
_IDLE = "idle-dispersion"
_UNREAD = "unread-attribute"
# Nothing is wrong with a texture or another renderer's shader, unless somebody has glass in mind.
_HARMLESS = ("textured-input", "unsupported-shader")
# What is given for millimetres, or for a wavelength, whatever the stage's unit is.
_PHYSICAL = ("abbe:internalTransmittance:table", "abbe:extinction:table", GLASS)


def closest(name: str, known: Iterable[str]) -> str:
    """Return the end of a message that offers what was probably meant; empty if nothing is near."""
    near = difflib.get_close_matches(name, list(known), 1)
    return f": is {near[0]} meant?" if near else ""


def dispersion(reading: Reading) -> Iterator[Finding]:
    """Tell what the core says of each material that it compiles."""
    for material in reading.materials.values():
        for remark in material.remarks:
            is_elsewhere = remark.kind in (_IDLE, _UNREAD) or _is_about_glass(remark)
            is_harmless = remark.kind in _HARMLESS and not (material.is_solid or material.has_ours)
            if not (is_elsewhere or is_harmless):
                yield reading.finding("abbe:Dispersion", remark)


def glass_name(reading: Reading) -> Iterator[Finding]:
    """Tell of names that the core does not find in the catalogue; it says which ones are near."""
    for material in reading.materials.values():
        for remark in material.remarks:
            if _is_about_glass(remark):
                yield reading.finding("abbe:GlassName", remark)


def _is_about_glass(remark: Remark) -> bool:
    return remark.severity == "error" and remark.property_name == GLASS


def unused_dispersion(reading: Reading) -> Iterator[Finding]:
    """Tell of laws on materials that are no glass, and of those on materials that nothing is bound to."""
    bound = _bound_paths(reading)
    for path, material in reading.materials.items():
        for remark in material.remarks:
            if remark.kind == _IDLE:
                yield reading.finding("abbe:UnusedDispersion", remark)
        if material.has_ours and path not in bound:
            yield reading.found(
                "abbe:UnusedDispersion",
                "unbound-dispersion",
                "info",
                path,
                "nothing on the stage is bound to this glass: bind it (material:binding), or leave it as a library's",
            )


def _bound_paths(reading: Reading) -> set[str]:
    """Return the targets of every material binding, whatever its purpose, direct or through a collection."""
    paths: set[str] = set()
    for prim in reading.prims:
        for relationship in prim.GetAuthoredRelationships():
            if relationship.GetName().startswith(tokens.MATERIAL_BINDING):
                paths.update(str(target) for target in relationship.GetForwardedTargets())
    return paths


def units(reading: Reading) -> Iterator[Finding]:
    """Tell of absorption data whose thickness means nothing because the stage does not say how long its unit is."""
    if reading.stage.HasAuthoredMetadata(tokens.METERS_PER_UNIT):
        return
    for material in reading.materials.values():
        name = next((name for name in _PHYSICAL if material.authored(name)), None)
        if name is not None and material.is_solid:
            yield reading.found(
                "abbe:Units",
                "no-meters-per-unit",
                "warning",
                _property(reading, material, name),
                "its absorption is that of a thickness in millimetres, and the stage does not say how long its unit is "
                "(a centimetre is taken): author metersPerUnit on the stage",
            )


def _property(reading: Reading, material: CompiledMaterial, name: str) -> str:
    """Return the path of the attribute where it is authored on the Material, else that of the Material."""
    attribute = reading.stage.GetPrimAtPath(material.path).GetAttribute(name)
    return str(attribute.GetPath()) if attribute and attribute.HasAuthoredValue() else material.path


def attribute_names(reading: Reading) -> Iterator[Finding]:
    """Tell of attributes in our namespace that abbe does not read: misspelt, or on the wrong prim."""
    seen = set()
    for prim in reading.prims:
        source = shared_source(prim)
        if source in seen:
            continue
        for item in prim.GetAuthoredPropertiesInNamespace(tokens.ABBE):
            seen.add(source)
            yield from _check(reading, prim, item, item.GetName(), "")
        for item in prim.GetAuthoredPropertiesInNamespace(tokens.INPUTS_PREFIX + tokens.ABBE):
            seen.add(source)
            name = item.GetName().removeprefix(tokens.INPUTS_PREFIX)
            yield from _check(reading, prim, item, name, tokens.INPUTS_PREFIX)


def _check(reading: Reading, prim: Any, item: Any, name: str, prefix: str) -> Iterator[Finding]:
    known = _read_on(prim, prefix)
    if name in known:
        return
    other = _read_on(prim, "" if prefix else tokens.INPUTS_PREFIX)
    owner = next((owner for owner, names in tokens.OUR_SCHEMAS.items() if name in names), None)
    what = prim.GetTypeName() or "prim without a type"
    if name in other:
        spelt = name if prefix else f"{tokens.INPUTS_PREFIX}{name}"
        kind, problem = "misplaced-attribute", f"has no effect on a {what} under this name: author it as {spelt}"
    elif owner is not None:
        kind, problem = "misplaced-attribute", f"has no effect on a {what}: author it on a {owner}"
    else:
        everything = known or {**tokens.MATERIAL_NAMES, **tokens.SETTINGS_NAMES, **tokens.VAR_NAMES}
        near = closest(name, everything) or ": correct or remove it"
        kind, problem = "unknown-attribute", f"abbe has no such attribute, so that it has no effect{near}"
    yield reading.found("abbe:AttributeNames", kind, "warning", place(item), problem)


def _read_on(prim: Any, prefix: str) -> Mapping[str, str]:
    """Return the names that are read on a prim of this type, as they are or behind ``inputs:``."""
    if prim.IsA(UsdShade.Material):
        return tokens.MATERIAL_NAMES if prefix else {**tokens.MATERIAL_NAMES, **tokens.REFLECTANCE_NAMES}
    if prefix:
        # Interfaces of node graphs pass values on.
        return tokens.MATERIAL_NAMES if prim.IsA(UsdShade.Shader) or prim.IsA(UsdShade.NodeGraph) else {}
    type_name = str(prim.GetTypeName())
    # A product overrides the settings it belongs to.
    return tokens.OUR_SCHEMAS.get(tokens.RENDER_SETTINGS if type_name == tokens.RENDER_PRODUCT else type_name, {})
