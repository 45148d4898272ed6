"""Light and shadow linking: which placements the collections of the lights contain, in as few words as possible.

Most lights link everything, and of them nothing is stored. Where one does not, its membership becomes a link set,
shared between all collections with the same members; placements name the sets they are in (or those they are not in,
where that is shorter), as Hydra's categories do.
"""

from __future__ import annotations

from typing import Any

from . import tokens
from ._pxr import Sdf, Usd
from .description import Diagnostics
from .values import place

__all__ = ["link_lights"]

# (light of the description, its prim)
Lights = list[tuple[dict[str, Any], Any]]


def link_lights(groups: list[dict[str, Any]], lights: Lights, diagnostics: Diagnostics) -> list[dict[str, Any]]:
    """Write link sets into lights and placements of the description's groups; return the sets."""
    wanted = [
        (light, field, prim, collection)
        for light, prim in lights
        for field, name in (("light_link", tokens.LIGHT_LINK), ("shadow_link", tokens.SHADOW_LINK))
        if (collection := _narrow(prim, name)) is not None
    ]
    if not wanted:
        return []
    items = [item for group in groups for item in group["items"]]
    paths = [Sdf.Path(item["path"]) for item in items]
    sets: list[dict[str, Any]] = []
    queries: list[Any] = []
    index_by_members: dict[bytes, int | None] = {}
    for light, field, prim, collection in wanted:
        _check_targets(prim, collection, diagnostics)
        query = collection.ComputeMembershipQuery()
        members = bytes(query.IsPathIncluded(path) for path in paths)
        instancers = bytes(query.IsPathIncluded(Sdf.Path(path)) for path in _elsewhere(groups))
        key = members + instancers
        if key not in index_by_members:
            # What contains everything needs no set.
            index_by_members[key] = len(sets) if 0 in key else None
            if 0 in key:
                excludes = 2 * sum(members) > len(members)
                path = f"{prim.GetPath()}.collection:{collection.GetName()}"
                queries.append(query)
                for item, is_member in zip(items, members, strict=True):
                    if bool(is_member) != excludes:
                        item.setdefault("link_sets", []).append(len(sets))
                sets.append({"path": path, "excludes": excludes})
        index = index_by_members[key]
        if index is not None:
            light[field] = index
    for path, instances in _elsewhere(groups, with_items=True).items():
        listed = [i for i, s in enumerate(sets) if queries[i].IsPathIncluded(Sdf.Path(path)) != s["excludes"]]
        for item in instances:
            item["link_sets"] = listed
    return sets


def _elsewhere(groups: list[dict[str, Any]], *, with_items: bool = False) -> dict[str, list[dict[str, Any]]]:
    """Return by path the instancers whose prototypes stand elsewhere: what they place is linked as they are.

    A prototype below its instancer is linked as its own prims are.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for group in groups:
        for item in group.get("instances", []):
            if not groups[item["group"]]["path"].startswith(f"{item['path']}/"):
                found.setdefault(item["path"], [])
                if with_items:
                    found[item["path"]].append(item)
    return found


def _narrow(prim: Any, name: str) -> Any:
    """Return a collection of a light that may leave something out, else None."""
    collection = Usd.CollectionAPI(prim, name)
    includes_root = collection.GetIncludeRootAttr()
    has_targets = any(
        relationship and relationship.HasAuthoredTargets()
        for relationship in (collection.GetIncludesRel(), collection.GetExcludesRel())
    )
    expression = collection.GetMembershipExpressionAttr()
    if has_targets or (expression and expression.HasAuthoredValue()):
        return collection
    # LightAPI says that the root is included.
    return collection if includes_root and includes_root.Get() is False else None


def _check_targets(prim: Any, collection: Any, diagnostics: Diagnostics) -> None:
    for relationship in (collection.GetIncludesRel(), collection.GetExcludesRel()):
        for path in relationship.GetTargets() if relationship else []:
            target = prim.GetStage().GetPrimAtPath(path.GetPrimPath())
            if not target:
                message = f"<{path}> is not there; it is ignored"
            elif target.GetTypeName() == tokens.GEOM_SUBSET:
                message = f"<{path}> is part of a mesh: only whole prims are linked; it is ignored"
            else:
                continue
            diagnostics.warn("light-link", f"{place(prim)}.{relationship.GetName()}", message)
