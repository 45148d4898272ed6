"""Constants through shading networks: what an input is, where its value stands elsewhere or follows from constants.

UsdShade's rules: a connection is stronger than a value; containers (Material, NodeGraph) hand on what they are
connected to, or their own value; a connection that leads to nothing leaves the input's own value. What shading nodes
compute from constants is in :mod:`.nodes`; all others, textures above all, drive what is connected to them.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from . import tokens
from ._pxr import Sdf, UsdShade
from .description import Diagnostics
from .nodes import Value, find_node
from .values import place

__all__ = ["Driver", "Network"]


@dataclass(frozen=True)
class Driver:
    """What computes a value at render time."""

    path: str
    """Path of the output."""
    shader: Any = field(default=None, compare=False)
    """The prim of the node."""

    @property
    def output(self) -> str:
        """The output's name without ``outputs:``."""
        return self.path.rpartition(".")[2].removeprefix(tokens.OUTPUTS_PREFIX)


class _DrivenError(Exception):
    """An input of a node is no constant."""


# Nodes that hand on a surface: the input that they hand on.
_SURFACE_WRAPPERS = {
    "ND_dot_surfaceshader": "in",
    "ND_surfacematerial": "surfaceshader",
    # What scatters light is a node of its own there.
    "LamaSurface": "materialFront",
    "ND_lama_surface": "materialFront",
    "MtlSingleBRDF": "brdf",
    "vray:MtlSingleBRDF": "brdf",
}
# Nodes one behind the other; real networks have tens. Deeper ones are not constants to anybody.
_DEEPEST = 64


class _Role(enum.Enum):
    """What a prim is to connections."""

    CONTAINER = enum.auto()
    NODE = enum.auto()
    NEITHER = enum.auto()


def _known(prim: Any) -> tuple[Any, _Role]:
    if not prim:
        return None, _Role.NEITHER
    if prim.IsA(UsdShade.NodeGraph):  # a Material is one
        return prim, _Role.CONTAINER
    return prim, _Role.NODE if UsdShade.ConnectableAPI(prim) else _Role.NEITHER


class Network:
    """Evaluates the inputs of one material's shaders, every node once."""

    def __init__(self, time: Any, diagnostics: Diagnostics, has_primvar: Callable[[str], bool]) -> None:
        """Evaluate at ``time``; ``has_primvar`` tells whether geometry with the material has a primvar of a name."""
        self._time = time
        self._diagnostics = diagnostics
        self._has_primvar = has_primvar
        self._outputs: dict[Any, Value | Driver] = {}
        self._prims: dict[Any, tuple[Any, _Role]] = {}
        self._depth = 0

    def value(self, attribute: Any) -> Value | Driver | None:
        """Return the constant that an input is, or what drives it; None where nobody gave it a value."""
        if not attribute.HasAuthoredConnections():
            return self._own(attribute)
        chain, source = self._follow(attribute)
        if source is not None:
            return self._output(*source)
        for link in reversed(chain):
            value = self._own(link)
            if value is not None:
                return value
        problem = _problem(chain)
        if problem:
            self._diagnostics.warn("dangling-connection", place(attribute), problem)
        return None

    def surface_shader(self, output: Any) -> Any:
        """Return the shader prim that a material's terminal leads to, through wrappers of surfaces; None if to none."""
        seen = set()
        while True:
            _, source = self._follow(output)
            if source is None:
                return None
            prim, _ = source
            shader = UsdShade.Shader(prim)
            wrapped = _SURFACE_WRAPPERS.get(str(shader.GetShaderId() or "")) if shader else None
            behind = prim.GetAttribute(tokens.INPUTS_PREFIX + wrapped) if wrapped else None
            if not behind or not behind.HasAuthoredConnections() or prim.GetPath() in seen:
                return prim if shader else None
            seen.add(prim.GetPath())
            output = behind

    def _own(self, attribute: Any) -> Value | None:
        try:
            data = attribute.Get(self._time)
        except (RuntimeError, TypeError):
            return None
        # A schema's fallback is not what somebody said.
        if data is None or not attribute.HasAuthoredValue():
            return None
        return Value(str(attribute.GetTypeName()), data, attribute)

    def _follow(self, attribute: Any) -> tuple[list[Any], tuple[Any, str] | None]:
        """Follow connections through containers, from ``attribute`` to a shader's output.

        Returns the attributes on the way, ``attribute`` first, and the shader with the name of its output; None where
        the way ends before one.
        """
        chain = [attribute]
        seen = {attribute.GetPath()}
        while True:
            # Most ways end in an input of the material; asking it for its connections is all they cost.
            for path in chain[-1].GetConnections():
                if path in seen:
                    continue
                prim_path = path.GetPrimPath()
                known = self._prims.get(prim_path)
                if known is None:
                    known = self._prims[prim_path] = _known(attribute.GetStage().GetPrimAtPath(prim_path))
                prim, role = known
                if role is _Role.CONTAINER:
                    found = prim.GetAttribute(path.name)
                    if found:
                        chain.append(found)
                        seen.add(path)
                        break
                elif role is _Role.NODE and path.name.startswith(tokens.OUTPUTS_PREFIX):
                    return chain, (prim, path.name)
            else:
                return chain, None

    def _output(self, shader: Any, name: str) -> Value | Driver:
        """Return what an output of a shader is."""
        path = shader.GetPath().AppendProperty(name)
        driver = Driver(str(path), shader)
        known = self._outputs.get(path)
        if known is not None:
            return known
        # A network that leads back here finds a driver, as does one too deep.
        self._outputs[path] = driver
        if self._depth < _DEEPEST:
            self._depth += 1
            try:
                self._outputs[path] = self._evaluate(shader, name) or driver
            except _DrivenError:
                pass
            finally:
                self._depth -= 1
        return self._outputs[path]

    def _evaluate(self, shader: Any, name: str) -> Value | None:
        """Return the value of a node's output, None where it has none."""

        def read(input_name: str) -> Value | None:
            attribute = shader.GetAttribute(tokens.INPUTS_PREFIX + input_name)
            value = self.value(attribute) if attribute else None
            if isinstance(value, Driver):
                raise _DrivenError
            return value

        identifier = str(UsdShade.Shader(shader).GetShaderId() or "")
        for prefix, (varname, fallback) in tokens.PRIMVAR_NODES.items():
            if identifier.startswith(prefix):
                wanted = read(varname)
                if wanted is not None and wanted.data and self._has_primvar(str(wanted.data)):
                    return None
                return read(fallback) or _zero(identifier[len(prefix) :])
        node = find_node(identifier, name.removeprefix(tokens.OUTPUTS_PREFIX))
        return node.evaluate(read) if node else None


def _zero(suffix: str) -> Value | None:
    """Return the fallback of a primvar reader that has none authored: zero of the type that its name ends with."""
    type_name = tokens.PRIMVAR_READER_TYPES.get(suffix) or tokens.MATERIALX_TYPES.get(suffix)
    sdf_type = Sdf.ValueTypeNames.Find(type_name) if type_name else None
    return Value(type_name, sdf_type.defaultValue) if type_name and sdf_type else None


def _problem(chain: list[Any]) -> str | None:
    """Return what is wrong with a way that ends in nothing; None where it ends in an input without a value."""
    last = chain[-1]
    if not last.HasAuthoredConnections():
        return None
    seen = {link.GetPath() for link in chain}
    if any(path in seen for path in last.GetConnections()):
        return "its connections lead back to themselves; they are ignored"
    return "the connection leads to no value; it is ignored"
