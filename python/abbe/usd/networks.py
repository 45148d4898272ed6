"""Shading networks that are no constants: the nodes behind an input as they were authored, and the primvars they read.

What the nodes compute is for the core to say. Here they become a list in which every node stands behind those that it
is connected to, each once, with the constants among its inputs, and its files found.
"""

from __future__ import annotations

from typing import Any

from . import tokens
from ._pxr import Sdf, Usd, UsdShade
from .assets import AssetReader
from .description import Diagnostics
from .folding import Driver, Network
from .values import place, plain

__all__ = ["NodeReader"]

# Nodes one behind the other, and nodes of one material; real networks have tens and hundreds.
_DEEPEST = 64
_MOST = 1024


class NodeReader:
    """Reads the nodes of one material."""

    def __init__(self, network: Network, assets: AssetReader, diagnostics: Diagnostics) -> None:
        self._network = network
        self._assets = assets
        self._diagnostics = diagnostics
        # None while the nodes behind one are being read.
        self._index: dict[Any, int | None] = {}
        self._depth = 0
        self.nodes: list[dict[str, Any]] = []
        """As the description has them."""
        self.primvars: set[str] = set()
        """The names of the primvars that the nodes may look up."""

    def output(self, driver: Driver) -> dict[str, Any] | None:
        """Return the output that drives an input, as the description has it; None, with a warning, if it is none."""
        index = self._node(driver.shader)
        return None if index is None else {"node": index, "output": driver.output}

    def _node(self, shader: Any) -> int | None:
        path = shader.GetPath()
        if path in self._index:
            index = self._index[path]
            if index is None:
                self._refuse(shader, "its connections lead back to it; they are ignored")
            return index
        if self._depth == _DEEPEST or len(self.nodes) >= _MOST:
            self._refuse(shader, f"the network has more than {_MOST} nodes, or {_DEEPEST} in a row; it is cut here")
            return None
        self._index[path] = None
        self._depth += 1
        node = self._read(shader)
        self._depth -= 1
        self._index[path] = len(self.nodes)
        self.nodes.append(node)
        return self._index[path]

    def _refuse(self, shader: Any, message: str) -> None:
        self._diagnostics.warn("shading-network", place(shader), message)

    def _read(self, shader: Any) -> dict[str, Any]:
        identifier = str(UsdShade.Shader(shader).GetShaderId() or "")
        inputs: dict[str, Any] = {}
        connected: dict[str, Any] = {}
        textures: dict[str, int] = {}
        for item in shader.GetAuthoredPropertiesInNamespace(tokens.INPUTS):
            if not isinstance(item, Usd.Attribute):
                continue
            name = item.GetName()[len(tokens.INPUTS_PREFIX) :]
            value = self._network.value(item)
            if isinstance(value, Driver):
                output = self.output(value)
                if output is not None:
                    connected[name] = output
            elif value is not None:
                if isinstance(value.data, Sdf.AssetPath) and value.attribute is not None:
                    texture = self._assets.texture(value.attribute)
                    if texture is not None:
                        textures[name] = texture
                data = plain(value.data)
                if data is not None:
                    inputs[name] = {"type": value.type, "value": data}
        self._note_primvars(identifier, inputs, bool(textures))
        node: dict[str, Any] = {"path": str(shader.GetPath()), "id": identifier}
        for key, content in (("inputs", inputs), ("connected", connected), ("textures", textures)):
            if content:
                node[key] = content
        return node

    def _note_primvars(self, identifier: str, inputs: dict[str, Any], has_texture: bool) -> None:
        for prefix, (name, _) in tokens.PRIMVAR_NODES.items():
            if identifier.startswith(prefix) and name in inputs:
                self.primvars.add(str(inputs[name]["value"]))
        if has_texture or identifier.startswith(tokens.TEXTURE_COORDINATE_NODES):
            # Where nothing says which coordinates are meant, and by number: the first, the second …
            index = inputs.get("index", {}).get("value", 0)
            self.primvars.update({tokens.ST, f"{tokens.ST}{index}" if index else tokens.ST})
        if identifier.startswith(tokens.GEOMETRY_COLOR_NODES):
            self.primvars.add(tokens.DISPLAY_COLOR)
