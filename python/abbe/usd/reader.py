"""The way through the stage: every prim once, in order, to the description.

Visibility, purpose and ``upAxis`` are settled here, so that nothing below has to ask. What is not supported is named
in a warning with its prim path; what was not asked for is counted.
"""

from __future__ import annotations

import enum
import itertools
import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import StageError, UsageError
from . import tokens
from ._pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdUtils
from .cameras import find_camera, framed_camera, read_camera
from .description import Description, Diagnostics
from .geometry import ShapeReader
from .lenses import is_lens
from .materials import MaterialReader
from .render import find_settings, read_settings, token_list
from .solids import solid_kind
from .stage import (
    OpenedStage,
    Overrides,
    composition_warnings,
    open_stage,
    quiet_usd,
    source_name,
    stage_metadata,
    stage_time,
)
from .values import IDENTITY, is_finite, matrix, place, read

__all__ = ["default_camera", "read_stage"]

FORMAT = "abbe-scene"
VERSION = 1


class _Kind(enum.Enum):
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


def _classify(prim: Any) -> _Kind:
    """Return what to do with prims of this one's type; LEAF where nothing below can be rendered."""
    if prim.IsA(UsdGeom.Mesh):
        return _Kind.MESH
    if prim.IsA(UsdGeom.Sphere):
        return _Kind.SPHERE
    if solid_kind(prim) is not None:
        return _Kind.SOLID
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


class _Facts(NamedTuple):
    """What a prim says of itself; the same for a prim of a prototype under every instance."""

    kind: _Kind
    invisible: bool
    purpose: str | None
    """None where none is authored."""


class _State(NamedTuple):
    """What children inherit."""

    visible: bool
    purpose: str | None
    instance: str | None
    """The outermost native instance."""


class _Placed(NamedTuple):
    """A placement on its way into the description."""

    prim: Any
    shape: int
    item: dict[str, Any]


class _Walk:
    """One reading of one stage at one time."""

    def __init__(self, opened: OpenedStage, time: Any, purposes: frozenset[str], diagnostics: Diagnostics) -> None:
        self.stage = opened.stage
        self.time = time
        self.purposes = purposes
        self.diagnostics = diagnostics
        self.transforms = UsdGeom.XformCache(time)
        self.shapes = ShapeReader(time, diagnostics)
        self.placed: list[_Placed] = []
        self.cameras: list[Any] = []
        self._kinds: dict[str, _Kind] = {}
        self._facts_by_prim: dict[Any, _Facts] = {}

    def run(self) -> None:
        """Visit every prim that the stage defines, those inside native instances included."""
        states = [_State(True, None, None)]
        prims = iter(Usd.PrimRange(self.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        for prim in itertools.islice(prims, 1, None):
            path = prim.GetPath()
            del states[path.pathElementCount :]
            parent = states[-1]
            # Below an instance all is shared; the instance itself may differ from its prototype's root.
            source = prim.GetPrimInPrototype() if parent.instance is not None else None
            facts = self._facts_by_prim.get(source) if source else None
            if facts is None:
                facts = self._facts(prim)
                if source:
                    self._facts_by_prim[source] = facts
            kind = facts.kind
            if kind is _Kind.LEAF:
                prims.PruneChildren()
                continue
            state = self._inherit(prim, facts, parent)
            states.append(state)
            if kind is _Kind.LENS:
                # What stands below is what other software draws in its place.
                prims.PruneChildren()
            if kind is _Kind.INSTANCER:
                # Its prototypes usually stand below it and are not drawn where they stand.
                prims.PruneChildren()
            if kind is not _Kind.PASS_THROUGH:
                self._visit(prim, source or prim, str(path), kind, state)
            elif prim.IsModel():
                self._check_draw_mode(prim, state)

    def _facts(self, prim: Any) -> _Facts:
        type_name = prim.GetTypeName()
        kind = self._kinds.get(type_name)
        if kind is None:
            kind = self._kinds[type_name] = _classify(prim)
        if kind in (_Kind.MESH, _Kind.PASS_THROUGH) and is_lens(prim):
            kind = _Kind.LENS
        attribute = prim.GetAttribute(tokens.PURPOSE)
        authored = bool(attribute) and attribute.HasAuthoredValue()
        return _Facts(
            kind,
            read(prim, tokens.VISIBILITY, self.time) == tokens.INVISIBLE,
            str(read(prim, tokens.PURPOSE, self.time) or tokens.DEFAULT) if authored else None,
        )

    @staticmethod
    def _inherit(prim: Any, facts: _Facts, parent: _State) -> _State:
        enters_instance = parent.instance is None and prim.IsInstance()
        if not facts.invisible and facts.purpose is None and not enters_instance:
            return parent
        return _State(
            parent.visible and not facts.invisible,
            parent.purpose if facts.purpose is None else facts.purpose,
            str(prim.GetPath()) if enters_instance else parent.instance,
        )

    def _visit(self, prim: Any, source: Any, path: str, kind: _Kind, state: _State) -> None:
        """Do with a prim what its kind asks for; ``source`` is what it shares with other instances, or itself."""
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
            self._place(prim, path, self.shapes.mesh(prim, source), state)
        elif kind is _Kind.SPHERE:
            self._place(prim, path, self.shapes.sphere(prim, source), state)
        elif kind is _Kind.LENS:
            self._place(prim, path, self.shapes.lens(prim, source), state)
        elif kind is _Kind.SOLID:
            self._place(prim, path, self.shapes.solid(prim, source), state)
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

    def _place(self, prim: Any, path: str, shape: int | None, state: _State) -> None:
        if shape is None:
            return
        item: dict[str, Any] = {"path": path, "target": {"shape": shape}}
        transform = matrix(self.transforms.GetLocalToWorldTransform(prim))
        if not is_finite(transform):
            raise StageError(f"{place(prim)}: its transform is not finite: correct its xformOps or its parents'")
        if transform != IDENTITY:
            item["transform"] = transform
        if state.instance is not None:
            item["instance"] = state.instance
        if self.shapes.double_sided[shape]:
            item["double_sided"] = True
        self.placed.append(_Placed(prim, shape, item))

    def bind(self, materials: MaterialReader) -> list[dict[str, Any]]:
        """Add materials to the placements and return them."""
        prims: list[Any] = []
        for placed in self.placed:
            prims.append(placed.prim)
            prims.extend(placed.prim.GetChild(name) for name in self.shapes.subset_names[placed.shape])
        bound = iter(materials.bound(prims))
        for placed in self.placed:
            material = next(bound)
            if material is not None:
                placed.item["material"] = material
            names = self.shapes.subset_names[placed.shape]
            if names:
                placed.item["subset_materials"] = [next(bound) for _ in names]
        return [placed.item for placed in self.placed]

    def bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of everything placed, by the corners of object-space boxes; None if there is none."""
        corners: dict[int, Any] = {}
        for shape in {placed.shape for placed in self.placed}:
            extent = self.shapes.bounds(shape)
            if extent is not None:
                # Homogeneous rows, as USD multiplies them.
                corners[shape] = np.array([(*corner, 1.0) for corner in itertools.product(*zip(*extent, strict=True))])
        placed = [p for p in self.placed if p.shape in corners]
        if not placed:
            return None
        matrices = np.array([p.item.get("transform", IDENTITY) for p in placed]).reshape(-1, 4, 4)
        with np.errstate(over="ignore", invalid="ignore"):  # a box that is not finite is no box
            world = np.matmul(np.array([corners[p.shape] for p in placed]), matrices).reshape(-1, 4)[:, :3]
        return _finite_box(world.min(axis=0).tolist(), world.max(axis=0).tolist())

    def stage_bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of the stage as USD computes it, prims included that are not rendered."""
        cache = UsdGeom.BBoxCache(self.time, sorted(self.purposes), True)
        box = cache.ComputeWorldBound(self.stage.GetPseudoRoot()).ComputeAlignedRange()
        return None if box.IsEmpty() else _finite_box(list(box.GetMin()), list(box.GetMax()))


def _finite_box(low: list[float], high: list[float]) -> tuple[list[float], list[float]] | None:
    return (low, high) if is_finite([*low, *high]) else None


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
        return _read(opened, diagnostics, frame, camera, render_settings, product, purposes, missing, strict)


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
        diagnostics.warn("nothing-to-render", source, "the stage has no geometry to render: every ray misses")

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
        authored = None if settings is None else token_list(settings, tokens.INCLUDED_PURPOSES)
        return frozenset([tokens.DEFAULT, *(tokens.DEFAULT_PURPOSES if authored is None else authored)])
    if isinstance(wanted, str):
        wanted = wanted.replace(",", " ").split()
    for purpose in wanted:
        if purpose not in tokens.PURPOSES:
            raise UsageError(f"purposes: '{purpose}' is none: choose from {', '.join(tokens.PURPOSES)}")
    return frozenset([tokens.DEFAULT, *wanted])


def _binding_purpose(settings: Any) -> str:
    """Return the material purpose: the first of the settings' that is not the all-purpose one."""
    authored = None if settings is None else token_list(settings, tokens.MATERIAL_BINDING_PURPOSES)
    if authored is None:
        return tokens.FULL_PURPOSE
    return next(filter(None, authored), str(UsdShade.Tokens.allPurpose))


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
