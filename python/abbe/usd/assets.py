"""Files that a stage names, images and profiles of lights: found here, read by the core when something looks them up.

USD resolves asset paths: relative to the layer that names them, by the stage's resolver context, inside of packages.
What is a file of the file system crosses as its absolute path. What is not (``scene.usdz[wood.png]``, assets of a
studio's own resolver) crosses as what is in it, so that renders without USD have it too.
"""

from __future__ import annotations

import os
import zipfile
from typing import Any

import numpy as np

from . import tokens
from ._pxr import Ar, Sdf, Usd, UsdShade
from .description import Array, ArrayTable
from .values import place

__all__ = ["AssetReader"]


class AssetReader:
    """Finds files, each once."""

    def __init__(self, stage: Any, time: Any) -> None:
        self._context = stage.GetPathResolverContext()
        self._time = time
        self._table = ArrayTable()
        self._contents: dict[str, str] = {}
        self._index: dict[tuple[str, str, str], int] = {}
        self.arrays = self._table.arrays
        self.textures: list[dict[str, Any]] = []
        """As the description has them."""

    def asset(self, attribute: Any) -> dict[str, Any] | None:
        """Return the file that an attribute names, as the description has it; None where it names none.

        A file that is not there has neither ``file`` nor ``content``.
        """
        path = self._path(attribute)
        return None if path is None else self._found(path.path, path.resolvedPath)

    def texture(self, attribute: Any) -> int | None:
        """Return the index of the image, or of the tiles, that an attribute names; None where it names none."""
        path = self._path(attribute)
        if path is None:
            return None
        color_space = _color_space(attribute)
        is_tiled = any(pattern in path.path for pattern in tokens.TILE_PATTERNS)
        # A pattern has no resolved path; what it means depends on the layer.
        layer = _layer(attribute) if is_tiled else None
        key = (path.path, layer.identifier if layer else path.resolvedPath or place(attribute), color_space)
        if key not in self._index:
            self._index[key] = len(self.textures)
            texture: dict[str, Any] = {"place": place(attribute)}
            if is_tiled:
                texture["asset"] = {"path": path.path}
                texture["tiles"] = self._tiles(path.path, layer)
            else:
                texture["asset"] = self._found(path.path, path.resolvedPath)
            if color_space:
                texture["color_space"] = color_space
            self.textures.append(texture)
        return self._index[key]

    def _path(self, attribute: Any) -> Any:
        try:
            value = attribute.Get(self._time)
        except (RuntimeError, TypeError):
            return None
        return value if isinstance(value, Sdf.AssetPath) and value.path else None

    def _found(self, authored: str, resolved: str) -> dict[str, Any]:
        asset: dict[str, Any] = {"path": authored}
        if not resolved:
            return asset
        if os.path.isfile(resolved):
            asset["file"] = os.path.abspath(resolved)
            return asset
        content = self._content(resolved)
        if content is not None:
            asset["content"] = content
        return asset

    def _content(self, resolved: str) -> str | None:
        """Return the name of the array with what is in an asset, None where it cannot be opened."""
        if resolved not in self._contents:
            with Ar.ResolverContextBinder(self._context):
                content = _opened(resolved)
            if content is None:
                return None
            self._contents[resolved] = self._table.add(f"asset{len(self._contents)}.content", content)
        return self._contents[resolved]

    def _tiles(self, pattern: str, layer: Any) -> list[dict[str, Any]]:
        """Return the tiles of a texture that are there."""
        tiles = []
        with Ar.ResolverContextBinder(self._context):
            for resolved, number in UsdShade.UdimUtils.ResolveUdimTilePaths(pattern, layer):
                authored = pattern.replace(tokens.TILE_PATTERNS[0], number)
                tiles.append({"number": int(number), "asset": self._found(authored, str(resolved))})
        return tiles


def _opened(resolved: str) -> Array | None:
    """Return what is in an asset, None where it cannot be opened."""
    resolver = Ar.GetResolver()
    if hasattr(resolver, "OpenAsset"):
        opened = resolver.OpenAsset(Ar.ResolvedPath(resolved))
        return None if opened is None else np.frombuffer(opened.GetBuffer(), np.uint8)
    # Older versions of USD open assets from C++ alone; a package of theirs is a zip archive all the same.
    package, member = Ar.SplitPackageRelativePathOuter(resolved)
    try:
        with zipfile.ZipFile(package) as archive:
            return np.frombuffer(archive.read(member), np.uint8)
    except (OSError, KeyError, zipfile.BadZipFile):
        return None


def _layer(attribute: Any) -> Any:
    """Return the layer whose value counts; a relative path in it is relative to it."""
    for spec in attribute.GetPropertyStack(Usd.TimeCode.Default()):
        if spec.HasInfo("default") or spec.HasInfo("timeSamples"):
            return spec.layer
    return attribute.GetStage().GetRootLayer()


def _color_space(attribute: Any) -> str:
    """Return the color space that is stated for an attribute or, where this USD has it, for a prim around it."""
    if attribute.HasColorSpace():
        return str(attribute.GetColorSpace())
    api = getattr(Usd, "ColorSpaceAPI", None)
    if api is None:
        return ""
    return str(api.ComputeColorSpaceName(attribute, None) or "")
