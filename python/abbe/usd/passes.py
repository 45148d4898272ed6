"""Render passes: which settings a pass renders, and what its collections make of the scene.

``prune`` removes prims before they are read; what is not in ``renderVisibility`` is not rendered; what is not in
``cameraVisibility`` is hidden from the camera's own rays; what is in ``matte`` holds out what is behind it. Membership
is a matter of each prim's path: that on the stage, and for prototypes of point instancers where they stand.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..errors import StageError
from . import tokens
from ._pxr import Usd, UsdRender
from .description import Diagnostics
from .values import place, read

__all__ = ["ActivePass", "Appearance", "find_pass"]


class Appearance(NamedTuple):
    """How cameras see a prim."""

    hidden: bool = False
    matte: bool = False


class ActivePass:
    """What a RenderPass makes of the prims of its stage."""

    def __init__(self, prim: Any, settings: str | None) -> None:
        self.settings = settings
        """Path of the RenderSettings that the pass renders; None for the stage's own."""
        self._prune = _members(prim, tokens.PRUNE)
        self._rendered = _members(prim, tokens.RENDER_VISIBILITY)
        self._seen = _members(prim, tokens.CAMERA_VISIBILITY)
        self._matte = _members(prim, tokens.MATTE)

    def prunes(self, path: Any) -> bool:
        """Whether the prim at ``path`` and all below it is not there at all."""
        return self._prune is not None and bool(self._prune.IsPathIncluded(path))

    def renders(self, path: Any) -> bool:
        """Whether the prim at ``path`` is rendered."""
        return self._rendered is None or bool(self._rendered.IsPathIncluded(path))

    def appearance(self, path: Any) -> Appearance:
        """Return how cameras see the prim at ``path``."""
        return Appearance(
            self._seen is not None and not self._seen.IsPathIncluded(path),
            self._matte is not None and bool(self._matte.IsPathIncluded(path)),
        )


def _members(prim: Any, name: str) -> Any:
    """Return the members of a collection of a pass; None where they are what every pass has by itself.

    Two collections hold everything unless something else is authored, the others nothing.
    """
    if not prim.HasAPI(Usd.CollectionAPI, name):
        return None
    collection = Usd.CollectionAPI(prim, name)
    authored = prim.GetAuthoredPropertiesInNamespace(f"collection:{name}")
    return collection.ComputeMembershipQuery() if authored else None


def find_pass(stage: Any, wanted: str, source: str, diagnostics: Diagnostics) -> ActivePass:
    """Return the RenderPass at ``wanted``.

    Raises
    ------
    StageError
        There is none, or what it renders is not on the stage.
    """
    from .render import typed_prim

    prim = typed_prim(stage, wanted, UsdRender.Pass, tokens.RENDER_PASS, source)
    for name, message in (
        (tokens.COMMAND, "its command is not run: the pass is rendered here"),
        (tokens.INPUT_PASSES, "the passes that it depends on are not rendered with it: render them before"),
    ):
        item = prim.GetProperty(name)
        if item and item.IsAuthored():
            diagnostics.warn("render-pass", f"{place(prim)}.{name}", message)
    file_name = read(prim, tokens.FILE_NAME, Usd.TimeCode.Default())
    if file_name and getattr(file_name, "path", file_name):
        raise StageError(
            f"{place(prim)}.{tokens.FILE_NAME}: its render settings are in @{getattr(file_name, 'path', file_name)}@: "
            f"render that file"
        )
    relationship = prim.GetRelationship(tokens.RENDER_SOURCE)
    targets = relationship.GetForwardedTargets() if relationship else []
    if not targets:
        return ActivePass(prim, None)
    if len(targets) > 1:
        diagnostics.warn(
            "render-pass",
            f"{place(prim)}.{tokens.RENDER_SOURCE}",
            f"has {len(targets)} targets; the first, <{targets[0]}>, is rendered",
        )
    where = f"{place(prim)}.{tokens.RENDER_SOURCE}"
    return ActivePass(
        prim, str(typed_prim(stage, str(targets[0]), UsdRender.Settings, tokens.RENDER_SETTINGS, where).GetPath())
    )
