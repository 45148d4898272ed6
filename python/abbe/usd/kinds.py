"""What the bridge does with prims of each type of USD."""

from __future__ import annotations

import enum
from typing import Any

from ._pxr import UsdGeom, UsdLux, UsdShade
from .solids import solid_kind

__all__ = ["GEOMETRY", "Kind", "classify"]


class Kind(enum.Enum):
    """What the bridge does with prims of a type."""

    MESH = enum.auto()
    SPHERE = enum.auto()
    SOLID = enum.auto()
    LENS = enum.auto()
    CAMERA = enum.auto()
    LIGHT = enum.auto()
    UNSUPPORTED = enum.auto()
    INSTANCER = enum.auto()
    SKELETAL = enum.auto()
    UNKNOWN = enum.auto()
    PASS_THROUGH = enum.auto()
    LEAF = enum.auto()


GEOMETRY = (Kind.MESH, Kind.SPHERE, Kind.SOLID, Kind.LENS)


def classify(prim: Any) -> Kind:
    """Return what to do with prims of this one's type; LEAF where nothing below can be rendered."""
    if prim.IsA(UsdGeom.Mesh):
        return Kind.MESH
    if prim.IsA(UsdGeom.Sphere):
        return Kind.SPHERE
    if solid_kind(prim) is not None:
        return Kind.SOLID
    if prim.IsA(UsdGeom.Camera):
        return Kind.CAMERA
    if prim.IsA(UsdLux.BoundableLightBase) or prim.IsA(UsdLux.NonboundableLightBase):
        return Kind.LIGHT
    if prim.IsA(UsdLux.LightFilter):
        # Of those that a light asks for, the light's reader speaks.
        return Kind.LEAF
    if prim.IsA(UsdGeom.PointInstancer):
        return Kind.INSTANCER
    if prim.GetTypeName() in ("SkelRoot", "Skeleton"):
        return Kind.SKELETAL if prim.GetTypeName() == "SkelRoot" else Kind.PASS_THROUGH
    if prim.IsA(UsdGeom.Boundable):
        return Kind.UNSUPPORTED
    if prim.IsA(UsdShade.NodeGraph) or prim.IsA(UsdShade.Shader):  # a Material is a NodeGraph
        return Kind.LEAF
    if prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaType():
        return Kind.UNKNOWN
    return Kind.PASS_THROUGH
