"""Materials: which one each prim is bound to, and what stands on it; what it means for optics the core decides.

Only bound materials are read, and of each the surface shader of every render context. A value counts as authored where
a layer holds it; declared inputs without a value mean the shader's own default and are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import PurePosixPath
from typing import Any

from . import tokens
from ._pxr import Usd, UsdGeom, UsdShade
from .assets import AssetReader
from .description import Diagnostics
from .folding import Driver, Network
from .networks import NodeReader
from .values import authored_namespace, place, plain

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

    def __init__(self, time: Any, diagnostics: Diagnostics, purposes: Sequence[str], assets: AssetReader) -> None:
        """Read materials at ``time``; the first of ``purposes`` counts for which a prim has a binding."""
        self._time = time
        self._assets = assets
        self._diagnostics = diagnostics
        self._purposes = tuple(purposes)
        self._index_by_prim: dict[Any, int] = {}
        self._users: list[list[Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.primvars: list[frozenset[str]] = []
        """Per material: the names of the primvars that it may look up."""

    def bound(self, prims: list[Any]) -> list[int | None]:
        """Return for each prim the index of its material, by the purposes in their order.

        All prims of a stage come at once: what a material says may depend on all of its geometry.
        """
        if not prims:
            return []
        result: list[int | None] = []
        found: list[Any] = []
        for prim, (material, relationship) in zip(prims, self._bindings(prims), strict=True):
            if material:
                result.append(self._index(material.GetPrim(), prim, found))
                continue
            if relationship:
                targets = ", ".join(f"<{target}>" for target in relationship.GetTargets())
                self._diagnostics.warn(
                    "missing-material",
                    place(prim),
                    f"is bound to {targets or 'nothing'}, which is no material on the stage",
                )
            result.append(None)
        for prim, users in zip(found, self._users, strict=True):
            material, primvars = self._read(prim, users)
            self.materials.append(material)
            self.primvars.append(frozenset(primvars))
        return result

    def _bindings(self, prims: list[Any]) -> list[tuple[Any, Any]]:
        """Return for each prim its material, None if there is none, and the relationship that counts."""
        bindings: list[tuple[Any, Any]] = [(None, None)] * len(prims)
        open_places = list(range(len(prims)))
        for purpose in self._purposes:
            if not open_places:
                break
            # USD falls back on the all-purpose binding, whose turn may come later or never.
            of_purpose = UsdShade.MaterialBindingAPI.ComputeBoundMaterials([prims[i] for i in open_places], purpose)
            undecided = []
            for i, material, relationship in zip(open_places, *of_purpose, strict=True):
                if relationship and _binding_purpose(relationship) == purpose:
                    bindings[i] = (material, relationship)
                else:
                    undecided.append(i)
            open_places = undecided
        return bindings

    def unbound(self, prim: Any) -> dict[str, Any]:
        """Return a Material prim as the description has it, without regard to what is bound to it."""
        return self._read(prim, [])[0]

    def _index(self, prim: Any, user: Any, found: list[Any]) -> int:
        key = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        index = self._index_by_prim.get(key)
        if index is None:
            index = self._index_by_prim[key] = len(found)
            found.append(prim)
            self._users.append([])
        self._users[index].append(user)
        return index

    def _read(self, prim: Any, users: list[Any]) -> tuple[dict[str, Any], set[str]]:
        network = Network(self._time, self._diagnostics, cache(lambda name: _has_primvar(users, name)))
        nodes = NodeReader(network, self._assets, self._diagnostics)
        interface, _ = self._inputs(network, prim, tokens.INPUTS_PREFIX + tokens.ABBE_PREFIX)
        material: dict[str, Any] = {
            "path": str(prim.GetPath()),
            "abbe": authored_namespace(prim, tokens.ABBE, self._time),
            "interface_abbe": interface,
        }
        self._check_names(material["path"], material["abbe"])
        self._check_names(material["path"], interface, tokens.INPUTS_PREFIX)
        surfaces = self._surfaces(network, prim)
        shaders = [self._shader(network, nodes, shader, name) for shader, name in surfaces.items()]
        for shader in shaders:
            self._check_names(shader["path"], shader["abbe"], tokens.INPUTS_PREFIX)
        if shaders:
            material["surface"], *material["alternatives"] = shaders
        else:
            self._diagnostics.warn("material-without-surface", place(prim), "the material has no surface shader")
        if nodes.nodes:
            material["nodes"] = nodes.nodes
        return material, nodes.primvars

    def _check_names(self, path: str, names: Iterable[str], prefix: str = "") -> None:
        known = tokens.MATERIAL_NAMES if prefix else {**tokens.MATERIAL_NAMES, **tokens.REFLECTANCE_NAMES}
        warn_unknown_names(path, names, known, self._diagnostics, prefix=prefix)

    def _surfaces(self, network: Network, prim: Any) -> dict[Any, str]:
        """Return the surface shaders and the terminals they were found through, in the order of the terminals."""
        others = sorted(output.GetFullName() for output in UsdShade.Material(prim).GetSurfaceOutputs())
        shaders: dict[Any, str] = {}
        for name in dict.fromkeys([*tokens.SURFACE_OUTPUTS, *others]):
            attribute = prim.GetAttribute(name)
            if not attribute or not attribute.HasAuthoredConnections():
                continue
            shader = network.surface_shader(attribute)
            if shader:
                shaders.setdefault(shader, name)
            else:
                self._diagnostics.warn(
                    "dangling-connection", f"{place(prim)}.{name}", "the connection leads to no shader; it is ignored"
                )
        return shaders

    def _shader(self, network: Network, nodes: NodeReader, prim: Any, terminal: str) -> dict[str, Any]:
        inputs, drivers = self._inputs(network, prim, tokens.INPUTS_PREFIX)
        ours = {name: value for name, value in inputs.items() if name.startswith(tokens.ABBE_PREFIX)}
        outputs = {name: nodes.output(driver) for name, driver in drivers.items()}
        description = {
            "path": str(prim.GetPath()),
            "id": _identifier(prim, terminal),
            "terminal": terminal,
            "inputs": {name: value for name, value in inputs.items() if name not in ours},
            "connected": {name: driver.path for name, driver in drivers.items()},
            "abbe": ours,
        }
        networks = {name: output for name, output in outputs.items() if output is not None}
        if networks:
            description["networks"] = networks
        return description

    def _inputs(self, network: Network, prim: Any, prefix: str) -> tuple[dict[str, Any], dict[str, Driver]]:
        """Return the constant inputs whose names begin with ``prefix``, and the outputs that drive the others."""
        constants: dict[str, Any] = {}
        connected: dict[str, Driver] = {}
        for item in prim.GetAuthoredPropertiesInNamespace(prefix.rstrip(":")):
            if not isinstance(item, Usd.Attribute):
                continue
            value = network.value(item)
            if value is None:
                continue
            name = item.GetName()[len(tokens.INPUTS_PREFIX) :]
            if isinstance(value, Driver):
                connected[name] = value
                continue
            data = plain(value.data)
            if data is not None:
                constants[name] = {"type": value.type, "value": data}
        return constants, connected


def _binding_purpose(relationship: Any) -> str:
    """Return the purpose of a binding: ``material:binding[:full]``, ``material:binding:collection[:full]:name``."""
    parts = relationship.GetName().split(":")[2:]
    if parts[:1] == [tokens.COLLECTION]:
        return parts[1] if len(parts) > 2 else ""
    return parts[0] if parts else ""


def _has_primvar(prims: Iterable[Any], name: str) -> bool:
    """Return whether one of the prims, or the mesh that one is a subset of, has or inherits a primvar."""
    for prim in prims:
        geometry = prim.GetParent() if prim.GetTypeName() == tokens.GEOM_SUBSET else prim
        primvar = UsdGeom.PrimvarsAPI(geometry).FindPrimvarWithInheritance(name)
        if primvar and primvar.HasAuthoredValue():
            return True
    return False


def _identifier(prim: Any, terminal: str) -> str:
    """Return ``info:id``; for code kept in a file (MDL, OSL) the name of the node in it, or that of the file.

    Of several source types that of the terminal's render context counts.
    """
    identifier = UsdShade.Shader(prim).GetShaderId()
    if identifier:
        return str(identifier)
    names: dict[str, str] = {}
    for item in prim.GetAuthoredPropertiesInNamespace(tokens.INFO):
        _, source_type, *rest = item.GetName().split(":")
        value = item.Get() if isinstance(item, Usd.Attribute) else None
        if rest == [tokens.SOURCE_ASSET, tokens.SUB_IDENTIFIER] and value:
            # A function of MDL may come with its module and with the types of its parameters.
            names[source_type] = str(value).partition("(")[0].rpartition("::")[2]
        elif rest == [tokens.SOURCE_ASSET] and value and value.path:
            names.setdefault(source_type, PurePosixPath(value.path.replace("\\", "/")).stem)
    context = terminal.split(":")[1]
    return names.get(context) or next((names[key] for key in sorted(names)), "")
