"""Materials: which one each prim is bound to, and what stands on it; what it means for optics the core decides.

Only bound materials are read. A value counts as authored where a layer holds it; declared inputs without a value mean
the shader's own default and are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from . import tokens
from ._pxr import Usd, UsdShade
from .description import Diagnostics
from .values import authored, authored_namespace, place

__all__ = ["MaterialReader", "warn_unknown_names"]


def warn_unknown_names(
    path: str, names: Iterable[str], known: Mapping[str, str], diagnostics: Diagnostics, *, prefix: str = ""
) -> None:
    """Warn of ``abbe:`` attributes that no schema of ours declares: they are most often misspelt."""
    for name in names:
        if name not in known:
            diagnostics.warn(
                "unknown-attribute", f"<{path}>.{prefix}{name}", "abbe has no such attribute: check its name"
            )


class MaterialReader:
    """Reads bound materials, each prototype's once."""

    def __init__(self, time: Any, diagnostics: Diagnostics, purpose: str) -> None:
        self._time = time
        self._diagnostics = diagnostics
        self._purpose = purpose
        self._index_by_prim: dict[Any, int] = {}
        self.materials: list[dict[str, Any]] = []

    def bound(self, prims: list[Any]) -> list[int | None]:
        """Return for each prim the index of its material: the binding's purpose first, then the all-purpose one."""
        if not prims:
            return []
        materials, relationships = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims, self._purpose)
        result: list[int | None] = []
        for prim, material, relationship in zip(prims, materials, relationships, strict=True):
            if material:
                result.append(self._index(material.GetPrim()))
                continue
            if relationship:
                targets = ", ".join(f"<{target}>" for target in relationship.GetTargets())
                self._diagnostics.warn(
                    "missing-material",
                    place(prim),
                    f"is bound to {targets or 'nothing'}, which is no material on the stage",
                )
            result.append(None)
        return result

    def index(self, prim: Any) -> int:
        """Return the index of a Material prim, which need not be bound."""
        return self._index(prim)

    def _index(self, prim: Any) -> int:
        key = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        index = self._index_by_prim.get(key)
        if index is None:
            index = self._index_by_prim[key] = len(self.materials)
            self.materials.append(self._read(prim))
        return index

    def _read(self, prim: Any) -> dict[str, Any]:
        material: dict[str, Any] = {
            "path": str(prim.GetPath()),
            "abbe": authored_namespace(prim, tokens.ABBE, self._time),
            "interface_abbe": {},
        }
        interface, _ = self._inputs(prim, tokens.INPUTS_PREFIX + tokens.ABBE_PREFIX)
        material["interface_abbe"] = interface
        surface = self._surface(prim)
        if surface is None:
            self._diagnostics.warn("material-without-surface", place(prim), "the material has no surface shader")
        else:
            material["surface"] = surface
            self._check_names(surface["path"], surface["abbe"], tokens.INPUTS_PREFIX)
        self._check_names(material["path"], material["abbe"])
        self._check_names(material["path"], interface, tokens.INPUTS_PREFIX)
        return material

    def _check_names(self, path: str, names: Iterable[str], prefix: str = "") -> None:
        warn_unknown_names(path, names, tokens.MATERIAL_NAMES, self._diagnostics, prefix=prefix)

    def _surface(self, prim: Any) -> dict[str, Any] | None:
        """Return the surface shader of the first render context that leads to one."""
        material = UsdShade.Material(prim)
        others = sorted(output.GetFullName() for output in material.GetSurfaceOutputs())
        for name in dict.fromkeys([*tokens.SURFACE_OUTPUTS, *others]):
            attribute = prim.GetAttribute(name)
            if not attribute or not attribute.HasAuthoredConnections():
                continue
            for source in UsdShade.Utils.GetValueProducingAttributes(UsdShade.Output(attribute), True):
                shader = UsdShade.Shader(source.GetPrim())
                if shader:
                    return self._shader(shader, name)
            self._diagnostics.warn(
                "dangling-connection", f"{place(prim)}.{name}", "the connection leads to no shader; it is ignored"
            )
        return None

    def _shader(self, shader: Any, terminal: str) -> dict[str, Any]:
        prim = shader.GetPrim()
        inputs, connected = self._inputs(prim, tokens.INPUTS_PREFIX)
        ours = {name: value for name, value in inputs.items() if name.startswith(tokens.ABBE_PREFIX)}
        return {
            "path": str(prim.GetPath()),
            "id": self._identifier(shader),
            "terminal": terminal,
            "inputs": {name: value for name, value in inputs.items() if name not in ours},
            "connected": connected,
            "abbe": ours,
        }

    def _identifier(self, shader: Any) -> str:
        """Return ``info:id``; for code kept in a file (MDL, OSL) the name of the node in it."""
        identifier = shader.GetShaderId()
        if identifier:
            return str(identifier)
        for item in shader.GetPrim().GetAuthoredPropertiesInNamespace("info"):
            if item.GetName().endswith(":sourceAsset:subIdentifier"):
                return str(item.Get() or "")
        return ""

    def _inputs(self, prim: Any, prefix: str) -> tuple[dict[str, Any], dict[str, str]]:
        """Return the constant inputs whose names begin with ``prefix``, and the outputs that drive the others."""
        constants: dict[str, Any] = {}
        connected: dict[str, str] = {}
        for item in prim.GetAuthoredPropertiesInNamespace(prefix.rstrip(":")):
            if not isinstance(item, Usd.Attribute):
                continue
            name = item.GetName()[len(tokens.INPUTS_PREFIX) :]
            source = item
            if item.HasAuthoredConnections():
                sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(item))
                if not sources:
                    self._diagnostics.warn(
                        "dangling-connection",
                        f"{place(prim)}.{item.GetName()}",
                        "the connection leads to no value; it is ignored",
                    )
                else:
                    source = self._constant_of(sources[0])
                    if source is None:
                        connected[name] = str(sources[0].GetPath())
                        continue
            value = authored(source, self._time)
            if value is not None:
                constants[name] = value
        return constants, connected

    def _constant_of(self, source: Any) -> Any:
        """Return the attribute that holds the value of ``source``; None if a shading node computes it."""
        if not source.GetName().startswith(tokens.OUTPUTS_PREFIX):
            return source
        node = UsdShade.Shader(source.GetPrim())
        if not node or not str(node.GetShaderId() or "").startswith(tokens.CONSTANT_NODE_PREFIX):
            return None
        value = node.GetInput(tokens.CONSTANT_NODE_INPUT)
        if not value:
            return None
        sources = UsdShade.Utils.GetValueProducingAttributes(value)
        return sources[0] if sources and not sources[0].GetName().startswith(tokens.OUTPUTS_PREFIX) else None
