"""The way through the stage: every prim once, in order, to the description.

Visibility, purpose and ``upAxis`` are settled here, so that nothing below has to ask. What is not supported is named
in a warning with its prim path; what was not asked for is counted.
"""

from __future__ import annotations

import enum
import itertools
import os
from collections.abc import Sequence
from typing import Any

from ..errors import StageError, UsageError
from . import tokens
from ._pxr import Gf, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils
from .cameras import find_camera, framed_camera, read_camera
from .description import Description, Diagnostics
from .geometry import ShapeReader
from .materials import MaterialReader
from .render import find_settings, read_settings
from .stage import (
    OpenedStage,
    Overrides,
    composition_warnings,
    open_stage,
    quiet_usd,
    source_name,
    stage_metadata,
    stage_time,
    usd_reason,
)
from .values import IDENTITY, is_finite, matrix, place, read

__all__ = ["default_camera", "read_stage"]

FORMAT = "abbe-scene"
VERSION = 1


class _Kind(enum.Enum):
    """What the bridge does with prims of a type."""

    MESH = enum.auto()
    SPHERE = enum.auto()
    CAMERA = enum.auto()
    LIGHT = enum.auto()
    UNSUPPORTED = enum.auto()
    INSTANCER = enum.auto()
    SKELETAL = enum.auto()
    UNKNOWN = enum.auto()
    PASS_THROUGH = enum.auto()
    LEAF = enum.auto()


def _classify(prim: Any) -> _Kind:
    """Return what to do with prims of this one's type; LEAF where nothing below can be rendered."""
    if prim.IsA(UsdGeom.Mesh):
        return _Kind.MESH
    if prim.IsA(UsdGeom.Sphere):
        return _Kind.SPHERE
    if prim.IsA(UsdGeom.Camera):
        return _Kind.CAMERA
    if prim.HasAPI(UsdLux.LightAPI) or any(prim.IsA(base) for base in _light_schemas()):
        return _Kind.LIGHT
    if prim.IsA(UsdGeom.PointInstancer):
        return _Kind.INSTANCER
    if prim.GetTypeName() in ("SkelRoot", "Skeleton"):
        return _Kind.SKELETAL if prim.GetTypeName() == "SkelRoot" else _Kind.PASS_THROUGH
    if prim.IsA(UsdGeom.Boundable):
        return _Kind.UNSUPPORTED
    if prim.IsA(UsdShade.NodeGraph) or prim.IsA(UsdShade.Shader):  # a Material is a NodeGraph
        return _Kind.LEAF
    if prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaType():
        return _Kind.UNKNOWN
    return _Kind.PASS_THROUGH


def _light_schemas() -> list[Any]:
    names = ("BoundableLightBase", "NonboundableLightBase", "LightFilter")
    return [getattr(UsdLux, name) for name in names if hasattr(UsdLux, name)]


class _State:
    """What children inherit."""

    __slots__ = ("instance", "purpose", "visible")

    def __init__(self, visible: bool, purpose: str | None, instance: str | None) -> None:
        self.visible = visible
        self.purpose = purpose  # None: nothing authored so far
        self.instance = instance


class _Walk:
    """One reading of one stage at one time."""

    def __init__(self, opened: OpenedStage, time: Any, purposes: frozenset[str], diagnostics: Diagnostics) -> None:
        self.stage = opened.stage
        self.time = time
        self.purposes = purposes
        self.diagnostics = diagnostics
        self.transforms = UsdGeom.XformCache(time)
        self.shapes = ShapeReader(time, diagnostics)
        self.placed: list[tuple[Any, dict[str, Any]]] = []
        self.cameras: list[Any] = []
        self._kinds: dict[str, _Kind] = {}

    def run(self) -> None:
        """Visit every prim that the stage defines, those inside native instances included."""
        states = [_State(True, None, None)]
        prims = iter(Usd.PrimRange(self.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        for prim in itertools.islice(prims, 1, None):
            depth = prim.GetPath().pathElementCount
            del states[depth:]
            type_name = prim.GetTypeName()
            kind = self._kinds.get(type_name)
            if kind is None:
                kind = self._kinds[type_name] = _classify(prim)
            if kind is _Kind.LEAF:
                prims.PruneChildren()
                continue
            state = self._state(prim, states[-1])
            states.append(state)
            if kind is _Kind.INSTANCER:
                # Its prototypes usually stand below it and are not drawn where they stand.
                prims.PruneChildren()
            if kind is not _Kind.PASS_THROUGH:
                self._visit(prim, kind, state)
            elif prim.IsModel():
                self._check_draw_mode(prim, state)

    def _state(self, prim: Any, parent: _State) -> _State:
        visible = parent.visible
        if visible:
            attribute = prim.GetAttribute(tokens.VISIBILITY)
            visible = not attribute or attribute.Get(self.time) != tokens.INVISIBLE
        purpose = parent.purpose
        attribute = prim.GetAttribute(tokens.PURPOSE)
        if attribute and attribute.HasAuthoredValue():
            purpose = str(attribute.Get() or tokens.DEFAULT)
        instance = parent.instance
        if instance is None and prim.IsInstance():
            instance = str(prim.GetPath())
        if visible is parent.visible and purpose is parent.purpose and instance is parent.instance:
            return parent
        return _State(visible, purpose, instance)

    def _visit(self, prim: Any, kind: _Kind, state: _State) -> None:
        if kind is _Kind.CAMERA:
            self.cameras.append(prim)
            return
        if kind is _Kind.LIGHT:
            self.diagnostics.skip("lights: not asked for")
            return
        if not state.visible:
            self.diagnostics.skip("invisible")
            return
        purpose = state.purpose or tokens.DEFAULT
        if purpose not in self.purposes:
            self.diagnostics.skip(f"purpose {purpose}")
            return
        if kind is _Kind.MESH:
            self._place(prim, self.shapes.mesh(prim), state)
        elif kind is _Kind.SPHERE:
            self._place(prim, self.shapes.sphere(prim), state)
        elif kind is _Kind.SKELETAL:
            self.diagnostics.warn(
                "unsupported-prim", place(prim), "skinning is not supported; meshes below are rendered as authored"
            )
        elif kind is _Kind.UNKNOWN:
            self.diagnostics.warn(
                "unknown-prim-type",
                place(prim),
                f"no schema of this USD declares {prim.GetTypeName()}; it is ignored",
            )
        else:
            self.diagnostics.warn(
                "unsupported-prim", place(prim), f"{prim.GetTypeName()} prims are not supported; they are left out"
            )

    def _check_draw_mode(self, prim: Any, state: _State) -> None:
        mode = read(prim, tokens.DRAW_MODE, self.time)
        if mode and mode not in tokens.FULL_DRAW_MODES and state.visible:
            self.diagnostics.warn(
                "unsupported-draw-mode",
                place(prim),
                f"draw mode '{mode}' is not supported; all of it is rendered",
            )

    def _place(self, prim: Any, shape: int | None, state: _State) -> None:
        if shape is None:
            return
        placement: dict[str, Any] = {"path": str(prim.GetPath()), "target": {"shape": shape}}
        transform = matrix(self.transforms.GetLocalToWorldTransform(prim))
        if not is_finite(transform):
            raise StageError(f"{place(prim)}: its transform is not finite: correct its xformOps or its parents'")
        if transform != IDENTITY:
            placement["transform"] = transform
        if state.instance is not None:
            placement["instance"] = state.instance
        if read(prim, tokens.DOUBLE_SIDED, self.time):
            placement["double_sided"] = True
        self.placed.append((prim, placement))

    def bind(self, materials: MaterialReader) -> list[dict[str, Any]]:
        """Add materials to the placements and return them."""
        prims: list[Any] = []
        for prim, placement in self.placed:
            prims.append(prim)
            prims.extend(prim.GetChild(name) for name in self.shapes.subset_names(placement["target"]["shape"]))
        bound = iter(materials.bound(prims))
        for _, placement in self.placed:
            material = next(bound)
            if material is not None:
                placement["material"] = material
            names = self.shapes.subset_names(placement["target"]["shape"])
            if names:
                placement["subset_materials"] = [next(bound) for _ in names]
        return [placement for _, placement in self.placed]

    def bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of everything placed, by the corners of object-space boxes; None if there is none."""
        box = Gf.Range3d()
        for _, placement in self.placed:
            extent = self.shapes.bounds(placement["target"]["shape"])
            if extent is None:
                continue
            world = Gf.Matrix4d(*placement.get("transform", IDENTITY))
            box.UnionWith(
                Gf.BBox3d(Gf.Range3d(Gf.Vec3d(*extent[0]), Gf.Vec3d(*extent[1])), world).ComputeAlignedRange()
            )
        return _finite_box(box)

    def stage_bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of the stage as USD computes it, prims included that are not rendered."""
        cache = UsdGeom.BBoxCache(self.time, sorted(self.purposes), True)
        return _finite_box(cache.ComputeWorldBound(self.stage.GetPseudoRoot()).ComputeAlignedRange())


def _finite_box(box: Any) -> tuple[list[float], list[float]] | None:
    low, high = list(box.GetMin()), list(box.GetMax())
    return None if box.IsEmpty() or not is_finite([*low, *high]) else (low, high)


def read_stage(
    stage_or_path: Any,
    *,
    frame: float | str | None,
    camera: str | None,
    render_settings: str | None,
    product: str | None,
    purposes: Sequence[str] | None,
    variants: Sequence[str],
    overrides: Overrides,
    search_paths: Sequence[str | os.PathLike[str]],
    missing: str,
    strict: bool,
) -> Description:
    """Read a stage into a description; the arguments are those of :func:`abbe.usd.describe`."""
    if missing not in ("warn", "error"):
        raise UsageError(f"missing '{missing}': choose 'warn' or 'error'")
    diagnostics = Diagnostics()
    source = source_name(stage_or_path)
    with quiet_usd(source, diagnostics):
        opened = open_stage(
            stage_or_path, variants=variants, overrides=overrides, search_paths=search_paths, diagnostics=diagnostics
        )
        try:
            return _read(opened, diagnostics, frame, camera, render_settings, product, purposes, missing, strict)
        except Tf.ErrorException as error:
            # A call of USD that no one expects to fail: the stage is at fault, or we are; either way no traceback.
            raise StageError(f"{opened.source}: USD cannot read it: {usd_reason(error)}: correct the file") from error


def _read(
    opened: OpenedStage,
    diagnostics: Diagnostics,
    frame: float | str | None,
    camera: str | None,
    render_settings: str | None,
    product: str | None,
    purposes: Sequence[str] | None,
    missing: str,
    strict: bool,
) -> Description:
    stage, source = opened.stage, opened.source
    time, time_code = stage_time(stage, frame)
    composition_warnings(opened, missing, diagnostics)
    settings_prim = find_settings(stage, render_settings, source, diagnostics)
    walk = _Walk(opened, time, _purposes(purposes, settings_prim), diagnostics)
    walk.run()
    materials = MaterialReader(time, diagnostics, _binding_purpose(settings_prim))
    placements = walk.bind(materials)

    cameras: list[dict[str, Any]] = []
    index_by_camera: dict[Any, int] = {}

    def camera_index(prim: Any) -> int:
        if prim not in index_by_camera:
            index_by_camera[prim] = len(cameras)
            cameras.append(read_camera(prim, time, walk.transforms))
        return index_by_camera[prim]

    metadata = stage_metadata(opened, time_code, diagnostics)
    chosen = find_camera(stage, camera, source) if camera else default_camera(stage, settings_prim, walk.cameras)
    if chosen is not None:
        camera_index(chosen)
    else:
        cameras.append(_framed(walk, metadata["up_axis"], source, strict, diagnostics))
    settings = read_settings(
        stage, settings_prim, time, time_code or 0.0, product, camera_index, bool(camera), source, diagnostics
    )
    if not placements:
        diagnostics.warn("nothing-to-render", source, "the stage has no mesh or sphere to render: every ray misses")

    document = {
        "format": FORMAT,
        "version": VERSION,
        "stage": metadata,
        "shapes": walk.shapes.shapes,
        "groups": [{"path": "/", "items": placements}],
        "root": 0,
        "materials": materials.materials,
        "cameras": cameras,
        "settings": settings,
        "warnings": diagnostics.warnings(),
        "skipped": diagnostics.skipped,
    }
    return Description(document, walk.shapes.arrays)


def _purposes(wanted: Sequence[str] | None, settings: Any) -> frozenset[str]:
    """Return the purposes to render: those asked for, else the settings', else default and render; default always."""
    if wanted is None:
        authored = read(settings, tokens.INCLUDED_PURPOSES, Usd.TimeCode.Default()) if settings is not None else None
        wanted = tokens.DEFAULT_PURPOSES if authored is None else [str(purpose) for purpose in authored]
        return frozenset([tokens.DEFAULT, *wanted])
    if isinstance(wanted, str):
        wanted = wanted.replace(",", " ").split()
    for purpose in wanted:
        if purpose not in tokens.PURPOSES:
            raise UsageError(f"purposes: '{purpose}' is none: choose from {', '.join(tokens.PURPOSES)}")
    return frozenset([tokens.DEFAULT, *wanted])


def _binding_purpose(settings: Any) -> str:
    """Return the material purpose: the first of the settings' that is not the all-purpose one."""
    authored = None
    if settings is not None:
        authored = read(settings, tokens.MATERIAL_BINDING_PURPOSES, Usd.TimeCode.Default())
    if authored is None:
        return tokens.FULL_PURPOSE
    return next((str(purpose) for purpose in authored if purpose), UsdShade.Tokens.allPurpose)


def default_camera(stage: Any, settings: Any, cameras: list[Any]) -> Any:
    """Return the settings' camera, else the primary one by USD's convention, else the first; None if there is none."""
    if settings is not None:
        relationship = settings.GetRelationship(tokens.CAMERA)
        for path in relationship.GetForwardedTargets() if relationship else []:
            prim = stage.GetPrimAtPath(path)
            if prim and prim.IsA(UsdGeom.Camera):
                return prim
    primary = UsdUtils.GetPrimaryCameraName()
    named = (prim for prim in cameras if prim.GetName() == primary)
    return next(named, cameras[0] if cameras else None)


def _framed(walk: _Walk, up_axis: str, source: str, strict: bool, diagnostics: Diagnostics) -> dict[str, Any]:
    """Return a camera that frames what is rendered; a warning, or an error where nothing may be assumed."""
    if strict:
        raise StageError(f"{source}: has no camera, and --strict frames none: add a Camera prim")
    box = walk.bounds() or walk.stage_bounds()
    if box is None:
        message = "the stage has no camera and nothing to frame: a camera about the origin is used"
        box = ([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])
    else:
        message = "the stage has no camera: what is rendered is framed by a 50 mm lens"
    diagnostics.warn("framed-camera", source, message)
    return framed_camera(*box, up_axis)
