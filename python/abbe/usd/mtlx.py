"""MaterialX documents as USD layers, for a USD that does not read them: usd-core is built without UsdMtlx.

The layer has the structure that UsdMtlx (OpenUSD ``pxr/usd/usdMtlx/reader.cpp``) gives a document, so that what refers
to ``@file.mtlx@</MaterialX/Materials/Glass>`` finds the same prims: ``Materials`` with their interfaces, ``Shaders``,
``NodeGraphs``. Two things differ, to the benefit of those who evaluate constants: a node that the document itself
defines by a graph becomes that graph, and an input that does not fit its definition is left out by itself, not with its
whole shader. Only surfaces are translated; looks, collections, variants and displacement are not.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from . import tokens
from ._pxr import Ar, Gf, Sdf, Tf
from .description import Diagnostics
from .documents import MAX_DEPTH, DocumentError, DocumentReader

__all__ = ["read_document"]


# Shaders that one node may unfold to where graphs are made of graphs, production graphs having hundreds; and what a
# document may become, all its materials together: nodes, and inputs of surfaces (OpenPBR has 41).
_MAX_UNFOLDED = 2_000
_MAX_UNFOLDED_ALL = 200_000


def read_document(identifier: str, diagnostics: Diagnostics) -> Any:
    """Return the anonymous layer of a MaterialX document.

    Parameters
    ----------
    identifier : of the document as an asset; resolved by the resolver context in force
    diagnostics : receives what is odd about the document

    Raises
    ------
    DocumentError
        The ``materialx`` package is missing, or the document cannot be read.
    """
    try:
        mx = importlib.import_module("MaterialX")
    except ImportError:
        raise DocumentError(
            "is a MaterialX document, which this USD does not read: its materials are empty; "
            "pip install 'abbe[mtlx]', or inline them in the USD file"
        ) from None
    if not hasattr(mx.Document, "setDataLibrary"):
        raise DocumentError(f"needs MaterialX 1.39 or later, this is {mx.getVersionString()}: pip install 'abbe[mtlx]'")
    document = mx.createDocument()
    try:
        DocumentReader(mx).read(document, identifier)
        mx.flattenFilenames(document)
        # Before the library is there to mix with.
        materials = document.getMaterialNodes()
        local = frozenset(definition.getName() for definition in document.getNodeDefs())
        document.setDataLibrary(_standard_library())
        translator = _Translator(mx, document, local, identifier, diagnostics)
        return translator.translate(materials)
    except DocumentError:
        raise
    except Exception as error:  # MaterialX' own exceptions have no common base
        reason = " ".join(str(error).split())
        raise DocumentError(f"cannot be read as MaterialX ({reason}): correct the document") from None


@cache
def _standard_library() -> Any:
    """Return the definitions that come with MaterialX; they take a tenth of a second, so only who needs them loads."""
    mx = importlib.import_module("MaterialX")
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    return library


@dataclass(frozen=True)
class _Scope:
    """Where nodes stand that know each other by name: the document, for one material, or a graph."""

    element: Any
    path: Any
    is_document: bool = False


class _Translator:
    """Writes one document to one layer."""

    def __init__(self, mx: Any, document: Any, local: frozenset[str], identifier: str, diagnostics: Diagnostics):
        self._mx = mx
        self._document = document
        self._local = local
        self._identifier = identifier
        self._diagnostics = diagnostics
        self._color_space = document.getActiveColorSpace()
        # Node graphs that stand in the layer, and how many shaders each unfolds to; None while it is being written.
        self._graphs: dict[str, int | None] = {}
        self._unfolded = 0
        # Nodes of the document itself that are still to be written below a material.
        self._waiting: list[Any] = []
        self.layer = Sdf.Layer.CreateAnonymous(f"{Path(identifier).name}.usda")
        self._root = Sdf.Path(tokens.MATERIALX_ROOT)

    def translate(self, materials: list[Any]) -> Any:
        """Return the layer with these materials of the document, and what they are made of."""
        with Sdf.ChangeBlock():
            Sdf.CreatePrimInLayer(self.layer, self._root).specifier = Sdf.SpecifierDef
            if self._color_space:
                self.layer.customLayerData = {"colorSpace": self._color_space}
            names = {material.getName() for material in materials}
            for material in materials:
                prim = self._material(material)
                base = material.getInheritString()
                if base in names:
                    prim.specializesList.prependedItems = [self._path("Materials", base)]
        return self.layer

    def _warn(self, element: Any, message: str) -> None:
        self._diagnostics.warn("materialx", f"{self._identifier}: {element.getNamePath()}", message)

    # Prims

    def _path(self, *names: str) -> Any:
        path = self._root
        for name in names:
            path = path.AppendChild(_valid(name))
        return path

    def _define(self, path: Any, type_name: str = "") -> Any:
        for prefix in path.GetPrefixes():
            prim = Sdf.CreatePrimInLayer(self.layer, prefix)
            prim.specifier = Sdf.SpecifierDef
            if prefix.name == tokens.NODE_GRAPHS and not prim.typeName:
                prim.typeName = "NodeGraph"
        if type_name:
            prim.typeName = type_name
        return prim

    def _refer(self, path: Any, target: Any, type_name: str = "") -> Any:
        prim = self._define(path, type_name)
        prim.referenceList.prependedItems = [Sdf.Reference(primPath=target)]
        return prim

    def _attribute(self, prim: Any, name: str, mtlx_type: str) -> Any:
        """Return the attribute of ``prim``, declared with the type that MaterialX' one is in USD."""
        attribute = prim.attributes.get(name)
        if attribute is None:
            type_name = tokens.MATERIALX_TYPES.get(mtlx_type)
            attribute = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(type_name or "token"))
            if type_name is None:
                attribute.SetInfo("renderType", mtlx_type)
        return attribute

    def _input(self, prim: Any, element: Any) -> Any:
        return self._attribute(prim, tokens.INPUTS_PREFIX + _valid(element.getName()), element.getType())

    @staticmethod
    def _connect(attribute: Any, source: Any) -> None:
        attribute.connectionPathList.explicitItems = [source]

    # Materials

    def _material(self, material: Any) -> Any:
        path = self._path("Materials", material.getName())
        prim = self._define(path, "Material")
        prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialXConfigAPI"]))
        version = Sdf.AttributeSpec(prim, tokens.MATERIALX_VERSION, Sdf.ValueTypeNames.String)
        version.default = self._document.getVersionString()
        shaders = self._mx.getShaderNodes(material, self._mx.SURFACE_SHADER_TYPE_STRING)
        for shader in shaders[:1]:
            self._surface(shader, prim)
        while self._waiting:
            self._node(*self._waiting.pop())
        if not shaders and material.getInput("surfaceshader") is not None:
            self._warn(material, "its surface shader is not in the document; the material is empty")
        return prim

    def _surface(self, node: Any, material: Any) -> None:
        """Write the surface shader: under the material, its inputs connected to the material's interface."""
        definition = self._definition(node)
        if definition is None:
            return
        if definition.getName() in self._local:
            graph = self._custom_graph(definition)
            if graph is not None:
                self._custom_surface(node, definition, graph, material)
                return
        implementation = self._path("Shaders", node.getName())
        if self.layer.GetPrimAtPath(implementation) is None:
            self._shader_prim(implementation, definition.getName())
            self._attribute(self.layer.GetPrimAtPath(implementation), tokens.SURFACE_OUTPUT, "surfaceshader")
        path = material.path.AppendChild(_valid(node.getName()))
        prim = self._refer(path, implementation, "Shader")
        self._interface(node, definition, prim, material)
        terminal = self._attribute(material, tokens.MATERIALX_SURFACE_OUTPUT, "surfaceshader")
        self._connect(terminal, path.AppendProperty(tokens.SURFACE_OUTPUT))

    def _custom_surface(self, node: Any, definition: Any, graph: Any, material: Any) -> None:
        """Write a surface shader that the document defines by a graph."""
        path = material.path.AppendChild(_valid(node.getName()))
        prim = self._refer(path, graph, "NodeGraph")
        self._interface(node, definition, prim, material)
        outputs = [o.getName() for o in definition.getActiveOutputs() if o.getType() == "surfaceshader"]
        if outputs:
            terminal = self._attribute(material, tokens.MATERIALX_SURFACE_OUTPUT, "surfaceshader")
            self._connect(terminal, path.AppendProperty(tokens.OUTPUTS_PREFIX + _valid(outputs[0])))

    def _interface(self, node: Any, definition: Any, prim: Any, material: Any) -> None:
        """Connect every input of the definition to the material, and write there, or connect, those of the node."""
        self._count(len(definition.getActiveInputs()))
        for declared in definition.getActiveInputs():
            public = self._input(material, declared)
            self._connect(self._input(prim, declared), public.path)
        # Comparing elements compares all that is in them.
        parent = node.getParent()
        if parent.isA(self._mx.NodeGraph):
            scope = _Scope(parent, self._graph_in(material, parent))
        else:
            scope = self._outside(material)
        for item in self._fitting_inputs(node, definition):
            self._set_value(self._input(material, item), item)
            source = self._source(item, scope, material)
            if source is not None:
                self._connect(self._input(prim, item), source)

    def _fitting_inputs(self, node: Any, definition: Any) -> list[Any]:
        """Return the inputs of a node that its definition has, of the type that it says."""
        fitting = []
        for item in node.getInputs():
            declared = definition.getActiveInput(item.getName())
            if declared is None:
                self._warn(item, f"{definition.getName()} has no such input; it is ignored")
            elif declared.getType() != item.getType():
                self._warn(
                    item, f"is of type {item.getType()} where {definition.getName()} has {declared.getType()}; ignored"
                )
            else:
                fitting.append(item)
        return fitting

    def _definition(self, node: Any) -> Any:
        """Return the definition of a node: that whose inputs fit, else the one for its category and type."""
        definition = node.getNodeDef() or node.getNodeDef("", True)
        if definition is None:
            self._warn(
                node,
                f"neither the document nor MaterialX' libraries define <{node.getCategory()}> of type "
                f"{node.getType()}; it has no value",
            )
        return definition

    # Nodes and graphs

    def _shader_prim(self, path: Any, identifier: str | None) -> Any:
        prim = self._define(path, "Shader")
        if identifier:
            info = Sdf.AttributeSpec(prim, tokens.INFO_ID, Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
            info.default = identifier
        return prim

    def _node(self, node: Any, scope: _Scope, material: Any) -> int:
        """Write a node below ``scope``; return how many shaders it unfolds to."""
        path = scope.path.AppendChild(_valid(node.getName()))
        definition = self._definition(node)
        graph = None
        if definition is not None and definition.getName() in self._local:
            graph = self._custom_graph(definition)
        if graph is not None:
            prim = self._refer(path, graph, "NodeGraph")
        else:
            prim = self._shader_prim(path, definition.getName() if definition is not None else None)
            for output in definition.getActiveOutputs() if definition is not None else ():
                self._attribute(prim, tokens.OUTPUTS_PREFIX + _valid(output.getName()), output.getType())
        items = self._fitting_inputs(node, definition) if definition is not None else node.getInputs()
        for item in items:
            attribute = self._input(prim, item)
            self._set_value(attribute, item)
            source = self._source(item, scope, material)
            if source is not None:
                self._connect(attribute, source)
        size = (self._graphs.get(definition.getName()) or 1) if graph is not None else 1
        self._count(size)
        return size

    def _count(self, size: int) -> None:
        self._unfolded += size
        if self._unfolded > _MAX_UNFOLDED_ALL:
            raise DocumentError(
                f"unfolds to more than {_MAX_UNFOLDED_ALL:,} nodes and inputs of surfaces: split the document"
            )

    def _custom_graph(self, definition: Any) -> Any:
        """Return the path of the graph that implements a definition of the document; None if there is none to use."""
        name = definition.getName()
        if name not in self._graphs:
            implementation = definition.getImplementation()
            if implementation is None or not implementation.isA(self._mx.NodeGraph):
                self._warn(definition, "is not defined by a node graph; what it computes is not known")
                self._graphs[name] = 0
            else:
                self._write_graph(name, implementation, definition)
        size = self._graphs[name]
        if size is None:
            self._warn(definition, "is made of itself; what it computes is not known")
            return None
        if size > _MAX_UNFOLDED:
            self._warn(definition, f"unfolds to more than {_MAX_UNFOLDED} nodes; what it computes is not known")
            return None
        return self._path(tokens.NODE_GRAPHS, name) if size else None

    def _write_graph(self, name: str, graph: Any, definition: Any = None) -> None:
        """Write a node graph under ``/MaterialX/NodeGraphs``, with the interface of its definition if it has one."""
        self._graphs[name] = None
        if sum(size is None for size in self._graphs.values()) > MAX_DEPTH:
            self._graphs[name] = _MAX_UNFOLDED + 1
            return
        path = self._path(tokens.NODE_GRAPHS, name)
        prim = self._define(path, "NodeGraph")
        for item in [*(definition.getActiveInputs() if definition is not None else ()), *graph.getInputs()]:
            self._set_value(self._input(prim, item), item)
        scope = _Scope(graph, path)
        size = sum(self._node(node, scope, None) for node in graph.getNodes())
        for output in graph.getOutputs():
            attribute = self._attribute(prim, tokens.OUTPUTS_PREFIX + _valid(output.getName()), output.getType())
            source = self._source(output, scope, None)
            if source is not None:
                self._connect(attribute, source)
        # An empty graph is one all the same.
        self._graphs[name] = max(size, 1)

    def _graph_in(self, material: Any, graph: Any) -> Any:
        """Return the path under the material of a graph of the document, brought there by a reference."""
        name = graph.getName()
        path = material.path.AppendChild(_valid(name))
        if self.layer.GetPrimAtPath(path) is None:
            if name not in self._graphs:
                self._write_graph(name, graph)
            self._count(self._graphs[name] or 1)
            prim = self._refer(path, self._path(tokens.NODE_GRAPHS, name))
            # What drives the graph's own inputs stands beside it in the document.
            for item in graph.getInputs():
                source = self._source(item, self._outside(material), material)
                if source is not None:
                    self._connect(self._input(prim, item), source)
        return path

    # Connections

    def _outside(self, material: Any) -> _Scope:
        """Return the document as its nodes are written for one material."""
        return _Scope(self._document, material.path.AppendChild(tokens.NODE_GRAPHS), True)

    def _source(self, port: Any, scope: _Scope, material: Any) -> Any:
        """Return the path of the property that an input or output of the document is connected to, None if none.

        ``material`` is the one that nodes of the document itself are written for; None inside a graph.
        """
        interface = port.getAttribute("interfacename")
        if interface:
            return scope.path.AppendProperty(tokens.INPUTS_PREFIX + _valid(interface))
        name, output = port.getAttribute("nodegraph"), port.getAttribute("output")
        node_name = port.getAttribute("nodename")
        if not name and not node_name and output and material is not None:
            # An output of the document itself.
            top = self._document.getOutput(output)
            node_name, output = (top.getAttribute("nodename"), top.getAttribute("output")) if top else ("", "")
        if name:
            graph = self._document.getNodeGraph(name)
            if graph is None or material is None:
                self._warn(port, f"refers to the node graph '{name}', which is not there; the connection is ignored")
                return None
            names = [item.getName() for item in graph.getOutputs()]
            chosen = output or (names[0] if names else "out")
            return self._graph_in(material, graph).AppendProperty(tokens.OUTPUTS_PREFIX + _valid(chosen))
        if not node_name:
            return None
        node = scope.element.getChild(node_name)
        if node is None or not node.isA(self._mx.Node):
            self._warn(port, f"refers to the node '{node_name}', which is not there; the connection is ignored")
            return None
        path = scope.path.AppendChild(_valid(node_name))
        if scope.is_document and self.layer.GetPrimAtPath(path) is None:
            self._define(path)
            self._waiting.append((node, scope, material))
        definition = node.getNodeDef() or node.getNodeDef("", True)
        names = [item.getName() for item in definition.getActiveOutputs()] if definition is not None else []
        chosen = output or (names[0] if names else "out")
        return path.AppendProperty(tokens.OUTPUTS_PREFIX + _valid(chosen))

    # Values

    def _set_value(self, attribute: Any, element: Any) -> None:
        """Write the value of an input, with its colour space where that is not the document's."""
        text = element.getValueString()
        if text:
            try:
                value = _converted(element.getValue(), element.getType())
            except (TypeError, ValueError):
                value = None
            if isinstance(value, Sdf.AssetPath):
                value = self._anchored(value.path)
            if value is None:
                self._warn(element, f"'{_short(text)}' is no value of type {element.getType()}; it is ignored")
            else:
                attribute.default = value
        color_space = element.getActiveColorSpace()
        if color_space and color_space != self._color_space and element.getType() in _COLORED:
            attribute.colorSpace = color_space

    def _anchored(self, path: str) -> Any:
        """Return a file that the document names as one that is found from anywhere."""
        if not path:
            return Sdf.AssetPath("")
        if not Path(path).is_absolute() and "://" not in path:
            # Without the dot it might be looked up elsewhere.
            path = f"./{path}"
        anchor = Ar.ResolvedPath(str(Ar.GetResolver().Resolve(self._identifier)))
        return Sdf.AssetPath(str(Ar.GetResolver().CreateIdentifier(path, anchor)))


_COLORED = ("color3", "color4", "filename")


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:40]}…"


def _valid(name: str) -> str:
    """Return a name of the document as USD takes it; UsdMtlx writes a namespace so."""
    name = name.replace(":", "__", 1)
    return name if Sdf.Path.IsValidIdentifier(name) else str(Tf.MakeValidIdentifier(name))


def _tuple(value: Any, count: int) -> tuple[float, ...]:
    return tuple(float(value[k]) for k in range(count))


def _matrix(value: Any, rows: int) -> list[list[float]]:
    return [[float(value[j, k]) for k in range(rows)] for j in range(rows)]


def _array_of(type_name: str) -> Callable[[Any], Any]:
    return lambda values: Sdf.ValueTypeNames.Find(type_name).type.pythonClass(list(values))


_CONVERTERS: dict[str, Callable[[Any], Any]] = {
    "boolean": bool,
    "integer": int,
    "float": float,
    "string": str,
    "geomname": str,
    "filename": lambda value: Sdf.AssetPath(value),
    "color3": lambda value: Gf.Vec3f(*_tuple(value, 3)),
    "color4": lambda value: Gf.Vec4f(*_tuple(value, 4)),
    "vector2": lambda value: Gf.Vec2f(*_tuple(value, 2)),
    "vector3": lambda value: Gf.Vec3f(*_tuple(value, 3)),
    "vector4": lambda value: Gf.Vec4f(*_tuple(value, 4)),
    "matrix33": lambda value: Gf.Matrix3d(_matrix(value, 3)),
    "matrix44": lambda value: Gf.Matrix4d(_matrix(value, 4)),
    "integerarray": _array_of("int[]"),
    "floatarray": _array_of("float[]"),
    "stringarray": _array_of("string[]"),
}


def _converted(value: Any, mtlx_type: str) -> Any:
    """Return a value of MaterialX as USD has it; None where the text was no value of the type."""
    convert = _CONVERTERS.get(mtlx_type)
    return None if value is None or convert is None else convert(value)
