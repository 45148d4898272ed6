"""Other layers in the place of assets that USD cannot open, without touching a file or a layer of anybody's.

Composition depends on where an arc stands: in which layer, variant and prototype. So the arcs stay where they are.
Every layer that names such an asset is opened a second time, under an identifier of its own (its path with an argument
that no file format reads, so that relative paths mean what they meant), and so is every layer that leads to it. In
these private copies the arcs name the other layers.
"""

from __future__ import annotations

import re
import uuid
from collections.abc import Mapping
from typing import Any

from ._pxr import Sdf

__all__ = ["plain_names", "substitute"]

_ARGUMENT = "abbe"


def substitute(stage: Any, session: Any, layers: Mapping[str, Any]) -> tuple[Any, list[Any]]:
    """Return a root layer from which the stage composes with other layers in the place of some assets.

    To be called with the stage's resolver context bound.

    Parameters
    ----------
    stage : the stage as it is; not changed
    session : its session layer, which is ours and is edited
    layers : the layer for each asset, by the asset's identifier as composition errors have it

    Returns
    -------
    root layer, and the copies; they live as long as somebody holds them
    """
    key = uuid.uuid4().hex
    arcs = {layer: _arcs(layer) for layer in stage.GetUsedLayers(False)}
    leading = _leading_to(arcs, layers)
    copies = {layer: layer if layer == session else _copy(layer, key) for layer in arcs if layer in leading}
    for layer, copy in copies.items():
        for authored, (identifier, target) in arcs[layer].items():
            other = layers.get(identifier) or copies.get(target)
            if other is not None and other != target:
                # Copies that are no file's have lost what relative paths were relative to.
                _update(copy, authored, identifier if copy.anonymous else authored, other.identifier)
    root = stage.GetRootLayer()
    return copies.get(root, root), [*copies.values(), *layers.values()]


def _update(layer: Any, authored: str, absolute: str, identifier: str) -> None:
    for path in dict.fromkeys((authored, absolute)):
        layer.UpdateCompositionAssetDependency(path, identifier)


def _arcs(layer: Any) -> dict[str, tuple[str, Any]]:
    """Return the assets that a layer refers to: as authored, to the identifier and the layer if it is open."""
    arcs = {}
    for authored in filter(None, layer.GetCompositionAssetDependencies()):
        identifier = Sdf.ComputeAssetPathRelativeToLayer(layer, authored)
        arcs[authored] = (identifier, Sdf.Layer.Find(identifier))
    return arcs


def _leading_to(arcs: Mapping[Any, dict[str, tuple[str, Any]]], assets: Mapping[str, Any]) -> set[Any]:
    """Return the layers from which arcs lead to the assets, over any number of others."""
    users: dict[Any, list[Any]] = {}
    found = set()
    for layer, targets in arcs.items():
        for identifier, target in targets.values():
            if identifier in assets:
                found.add(layer)
            elif target:
                users.setdefault(target, []).append(layer)
    waiting = list(found)
    while waiting:
        for user in users.get(waiting.pop(), ()):
            if user not in found:
                found.add(user)
                waiting.append(user)
    return found


def _copy(layer: Any, key: str) -> Any:
    """Return a layer of our own with the same content and, if it is a file's, the same place."""
    path, arguments = Sdf.Layer.SplitIdentifier(layer.identifier)
    if _ARGUMENT in arguments:
        return layer
    copy = None
    if not layer.anonymous:
        copy = Sdf.Layer.FindOrOpen(layer.realPath or path, {**arguments, _ARGUMENT: key})
    if copy is not None:
        if layer.dirty:
            copy.TransferContent(layer)
        return copy
    copy = Sdf.Layer.CreateAnonymous(f"{layer.GetDisplayName() or 'layer'}.usda")
    copy.TransferContent(layer)
    if not layer.anonymous:
        for authored in filter(None, layer.GetCompositionAssetDependencies()):
            copy.UpdateCompositionAssetDependency(authored, Sdf.ComputeAssetPathRelativeToLayer(layer, authored))
    return copy


def plain_names(text: str) -> str:
    """Return a message of USD without what is ours in the identifiers of layers, and without addresses."""
    return _ANONYMOUS.sub(r"\1", _OURS.sub("", text))


_OURS = re.compile(rf":SDF_FORMAT_ARGS:{_ARGUMENT}=[0-9a-f]+(?=@)")
_ANONYMOUS = re.compile(r"anon:0x[0-9a-fA-F]+:(\S*?)(?:\.usda)?(?=@)")
