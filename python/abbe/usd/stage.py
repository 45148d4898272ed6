"""Opening stages: files and stages in memory, masks and payloads, and MaterialX where USD does not read it.

Overrides go to a session layer of our own; neither the files nor the caller's stage are changed.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from ..errors import NotUsdError, StageError, UsageError
from . import tokens
from ._pxr import Ar, Sdf, Usd, UsdUtils
from .composition import unread_documents, usd_reason
from .description import Diagnostics
from .documents import DocumentError
from .mtlx import read_document
from .overrides import Overrides, select_variant, set_value, split_override
from .substitution import substitute

__all__ = ["KeptStage", "OpenedStage", "Opening", "open_stage", "source_name"]


@dataclass
class OpenedStage:
    """A stage and what must live as long as it."""

    stage: Any
    source: str
    """The root layer as the user named it."""
    session: Any = None
    """Our session layer; None while the stage is the caller's own."""
    keep: list[Any] = field(default_factory=list)
    documents: dict[str, Any] = field(default_factory=dict)
    """MaterialX documents by asset identifier: the layer that stands for it, or why there is none."""


class Opening(TypedDict, total=False):
    """How a stage is opened; see :func:`abbe.usd.describe`."""

    variants: Sequence[str]
    overrides: Overrides
    search_paths: Sequence[str | os.PathLike[str]]
    session_layer: str | os.PathLike[str] | None
    mask: Sequence[str]
    payloads: str


class KeptStage:
    """A stage file that is opened when it is first described, and stays open for the frames after it.

    Every description of it is asked for with the same options but for the frame.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self._opened: OpenedStage | None = None
        self._told = Diagnostics()

    def __str__(self) -> str:
        return str(self.path)

    def open(self, also: Sequence[str], diagnostics: Diagnostics, opening: Opening) -> OpenedStage:
        """Return the stage, and tell again what was told when it was opened."""
        if self._opened is None:
            self._opened = open_stage(self.path, also=also, diagnostics=self._told, **opening)
        diagnostics.extend(self._told)
        return self._opened


def source_name(stage_or_path: Any) -> str:
    """Return what messages call a stage: its path as given, or its root layer."""
    if not isinstance(stage_or_path, Usd.Stage):
        return str(stage_or_path)
    root = stage_or_path.GetRootLayer()
    # An anonymous layer's identifier is an address, which no two runs share.
    return str(root.GetDisplayName() or "stage in memory") if root.anonymous else str(root.realPath or root.identifier)


def open_stage(
    stage_or_path: Any,
    *,
    variants: Sequence[str] = (),
    overrides: Overrides = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
    also: Sequence[str] = (),
    diagnostics: Diagnostics,
) -> OpenedStage:
    """Open a file, or take a stage in memory, with the variants and values asked for.

    ``also`` are paths that a mask keeps if they are there; the other arguments are those of :func:`abbe.usd.describe`.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The file is no stage, or an override names what is not there.
    """
    if payloads not in ("all", "none"):
        raise UsageError(f"payloads '{payloads}': choose 'all' or 'none'")
    if isinstance(stage_or_path, Usd.Stage):
        opened = _from_memory(stage_or_path, search_paths)
        if payloads == "none":
            _own(opened)
            opened.stage.SetLoadRules(Usd.StageLoadRules.LoadNone())
    else:
        opened = _from_file(stage_or_path, search_paths, payloads == "all", diagnostics)
    if session_layer is not None:
        _add_session_layer(opened, os.fspath(session_layer))
    if mask:
        _mask(opened, mask, also)
    bring_in_documents(opened, diagnostics)
    _apply(opened, variants, overrides, diagnostics)
    if opened.stage.GetLoadRules() != Usd.StageLoadRules.LoadAll():
        unloaded = set(opened.stage.FindLoadable()) - set(opened.stage.GetLoadSet())
        if unloaded:
            diagnostics.skip("payload not loaded", len(unloaded))
    return opened


def _from_file(
    stage_or_path: Any, search_paths: Sequence[str | os.PathLike[str]], loads: bool, diagnostics: Diagnostics
) -> OpenedStage:
    try:
        path = os.fspath(stage_or_path)
    except TypeError:
        raise UsageError(
            f"stage: is a {type(stage_or_path).__name__}: give the path of a USD file or a pxr.Usd.Stage"
        ) from None
    if isinstance(path, bytes):
        path = os.fsdecode(path)
    context = _context(path, search_paths, diagnostics)
    root = _root_layer(path, context)
    session = _session_layer()
    load = Usd.Stage.LoadAll if loads else Usd.Stage.LoadNone
    stage = _compose(lambda: Usd.Stage.Open(root, session, context, load), path)
    return OpenedStage(stage, path, session, [root])


def _add_session_layer(opened: OpenedStage, path: str) -> None:
    """Put the layer ``path`` above all layers of the stage, below what else was asked for."""
    _own(opened)
    layer = _root_layer(path, opened.stage.GetPathResolverContext())
    if layer == opened.stage.GetRootLayer():
        raise UsageError(f"session layer {path}: is the stage itself: name another layer")
    # Stage metadata is read from the session's root layer alone.
    UsdUtils.CopyLayerMetadata(layer, opened.session, True)
    opened.session.subLayerPaths = [layer.identifier, *opened.session.subLayerPaths]
    opened.keep.append(layer)


# What a prim that a mask keeps needs beside its own: materials, prototypes, and what render settings name.
_NEEDED_TARGETS = (tokens.PROTOTYPES, tokens.PRODUCTS, tokens.ORDERED_VARS, tokens.CAMERA)


def _mask(opened: OpenedStage, paths: Sequence[str], also: Sequence[str]) -> None:
    """Leave out of the stage what is neither below ``paths`` nor needed by what is."""
    if isinstance(paths, str):
        raise UsageError("mask: is a list, not one string: put brackets around it")
    _own(opened)
    wanted = Usd.StagePopulationMask()
    for path in paths:
        if not path.startswith("/") or not Sdf.Path.IsValidPathString(path) or Sdf.Path(path).IsPropertyPath():
            raise UsageError(f"mask: '{path}' is no prim path: give one such as /World/Ball")
        wanted.Add(Sdf.Path(path))
    wanted = Usd.StagePopulationMask.Intersection(wanted, opened.stage.GetPopulationMask())
    settings = opened.stage.GetMetadata(tokens.RENDER_SETTINGS_PRIM_PATH)
    for path in (*also, *([settings] if settings else [])):
        if Sdf.Path.IsValidPathString(path) and Sdf.Path(path).IsPrimPath():
            wanted.Add(Sdf.Path(path))
    opened.stage.SetPopulationMask(wanted)
    for path in paths:
        if not opened.stage.GetPrimAtPath(path):
            raise StageError(f"<{path}>: there is no such prim in {opened.source}: correct mask '{path}'")
    while True:
        opened.stage.ExpandPopulationMask(relationshipPredicate=_is_needed)
        expanded = opened.stage.GetPopulationMask()
        # USD itself does not look into what instances share.
        for prototype in opened.stage.GetPrototypes():
            for prim in Usd.PrimRange(prototype):
                for relationship in filter(_is_needed, prim.GetAuthoredRelationships()):
                    for target in relationship.GetForwardedTargets():
                        if not Usd.Prim.IsPathInPrototype(target) and not expanded.Includes(target.GetPrimPath()):
                            expanded.Add(target.GetPrimPath())
        if expanded == opened.stage.GetPopulationMask():
            return
        opened.stage.SetPopulationMask(expanded)


def _is_needed(relationship: Any) -> bool:
    name = relationship.GetName()
    return name in _NEEDED_TARGETS or name.startswith(tokens.MATERIAL_BINDING)


def _session_layer() -> Any:
    return Sdf.Layer.CreateAnonymous("abbe-session.usda")


def _context(path: str, search_paths: Sequence[str | os.PathLike[str]], diagnostics: Diagnostics) -> Any:
    """Return the resolver context: the resolver's own for this file, with the search paths asked for behind it."""
    resolver = Ar.GetResolver()
    own = resolver.CreateDefaultContextForAsset(path)
    if not search_paths:
        return own
    folders = [Path(folder).absolute() for folder in search_paths]
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"search path {folder}: is no folder: correct or remove it")
    if not isinstance(Ar.GetUnderlyingResolver(), Ar.DefaultResolver):
        diagnostics.warn("search-path", path, "the site's own asset resolver is in use; search paths are ignored")
        return own
    beside = Path(path).absolute().parent
    return Ar.ResolverContext(Ar.DefaultResolverContext([str(folder) for folder in (beside, *folders)]))


def _root_layer(path: str, context: Any) -> Any:
    if not path:
        raise UsageError("stage: the path is empty: give that of a USD file")
    if Path(path).is_dir():
        raise StageError(f"{path}: is a folder, not a USD file: name the file in it")
    with Ar.ResolverContextBinder(context):
        if not Path(path).exists() and not Ar.GetResolver().Resolve(path):
            raise FileNotFoundError(f"{path}: there is no such file: check the path")
        try:
            layer = Sdf.Layer.FindOrOpen(path)
        except RuntimeError as error:
            if not Sdf.FileFormat.FindByExtension(path):
                raise _not_usd(path) from None
            raise StageError(f"{path}: cannot be read as USD: {usd_reason(error)}: export it again") from None
    if not layer and not Sdf.FileFormat.FindByExtension(path):
        raise _not_usd(path)
    if not layer:
        raise StageError(f"{path}: is not a USD file (.usda, .usdc, .usd, .usdz), or it cannot be read: check the file")
    return layer


def _not_usd(path: str) -> NotUsdError:
    return NotUsdError(f"{path}: is not a USD file: name a .usd, .usda, .usdc or .usdz file")


def _compose(open_it: Any, source: str) -> Any:
    try:
        stage = open_it()
    except RuntimeError as error:
        raise StageError(f"{source}: cannot be composed: {usd_reason(error)}: correct the file") from None
    if not stage:
        raise StageError(f"{source}: cannot be composed: correct the file")
    return stage


def _from_memory(stage: Any, search_paths: Sequence[str | os.PathLike[str]]) -> OpenedStage:
    if search_paths:
        raise UsageError("search_paths: a stage in memory is composed already: open it with them, or give its path")
    return OpenedStage(stage, source_name(stage))


def _own(opened: OpenedStage) -> None:
    """Replace the caller's own stage by a second one on the same layers, with a session layer of ours."""
    if opened.session is not None:
        return
    theirs = opened.stage.GetSessionLayer()
    opened.session = _session_layer()
    if theirs:
        # Stage metadata is read from the session's root layer alone.
        UsdUtils.CopyLayerMetadata(theirs, opened.session, True)
        opened.session.subLayerPaths = [theirs.identifier]
    opened.keep += [opened.stage, opened.stage.GetRootLayer(), theirs]
    _recompose(opened, opened.stage.GetRootLayer())


def _recompose(opened: OpenedStage, root: Any) -> None:
    """Compose anew from ``root`` and our session layer, with all else as the stage has it."""
    old = opened.stage
    context = old.GetPathResolverContext()
    mask = old.GetPopulationMask()
    # Payloads are loaded only once the rules are those of the other stage.
    stage = _compose(
        lambda: Usd.Stage.OpenMasked(root, opened.session, context, mask, Usd.Stage.LoadNone), opened.source
    )
    stage.MuteAndUnmuteLayers(old.GetMutedLayers(), [])
    stage.SetLoadRules(old.GetLoadRules())
    stage.SetInterpolationType(old.GetInterpolationType())
    opened.stage = stage


def bring_in_documents(opened: OpenedStage, diagnostics: Diagnostics) -> None:
    """Bring the MaterialX documents that the stage refers to onto it, where USD itself does not read them."""
    if Sdf.FileFormat.FindByExtension(tokens.MATERIALX_EXTENSION):
        return
    while True:
        # What is muted somebody does not want.
        wanted = sorted(unread_documents(opened.stage) - {*opened.documents, *opened.stage.GetMutedLayers()})
        if not wanted:
            return
        with Ar.ResolverContextBinder(opened.stage.GetPathResolverContext()):
            for identifier in wanted:
                if not Ar.GetResolver().Resolve(identifier):
                    opened.documents[identifier] = None
                    continue
                try:
                    opened.documents[identifier] = read_document(identifier, diagnostics)
                except DocumentError as error:
                    opened.documents[identifier] = str(error)
            layers = {name: opened.documents[name] for name in wanted if isinstance(opened.documents[name], Sdf.Layer)}
            if not layers:
                return
            _own(opened)
            root, copies = substitute(opened.stage, opened.session, layers)
        opened.keep += copies
        _recompose(opened, root)


def _apply(opened: OpenedStage, variants: Sequence[str], overrides: Overrides, diagnostics: Diagnostics) -> None:
    if isinstance(variants, str) or isinstance(overrides, str):
        raise UsageError("variants, overrides: are lists, not one string: put brackets around it")
    if not variants and not overrides:
        return
    _own(opened)
    if variants:
        with Usd.EditContext(opened.stage, Usd.EditTarget(opened.session)):
            for text in variants:
                select_variant(opened, text)
        bring_in_documents(opened, diagnostics)
    with Usd.EditContext(opened.stage, Usd.EditTarget(opened.session)):
        items = overrides.items() if isinstance(overrides, Mapping) else [split_override(text) for text in overrides]
        for target, value in items:
            set_value(opened, target, value)
