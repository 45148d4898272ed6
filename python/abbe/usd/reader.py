"""The way through the stage: every prim once, in order, to the description.

Visibility, purpose and ``upAxis`` are settled here, so that nothing below has to ask. What is not supported is named
in a warning with its prim path; what was not asked for is counted.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Unpack

import numpy as np

from ..errors import StageError, UsageError
from . import tokens
from ._pxr import Sdf, Tf, Usd, UsdGeom
from .assets import AssetReader
from .cameras import default_camera, find_camera, framed_camera, read_camera
from .composition import composition_warnings, quiet_usd, usd_reason
from .description import Array, ArrayTable, BrokenError, Description, Diagnostics
from .geometry import ShapeReader
from .instancers import InstancerReader
from .kinds import GEOMETRY, Kind, classify
from .lenses import is_lens
from .lights import LightReader, is_light
from .links import link_lights
from .materials import MaterialReader
from .metadata import stage_metadata, stage_time
from .motion import MotionReader, motion_span
from .passes import ActivePass, Appearance, find_pass
from .places import Places
from .primvars import PrimvarReader
from .render import binding_purposes, find_settings, read_settings, rendered_purposes
from .stage import KeptStage, OpenedStage, Opening, open_stage, source_name
from .subdivision import refinement_level
from .values import IDENTITY, is_finite, place, read

__all__ = ["read_stage"]

FORMAT = "abbe-scene"
VERSION = 1


class _Facts(NamedTuple):
    """What a prim says of itself; the same for a prim of a prototype under every instance."""

    kind: Kind
    invisible: bool
    purpose: str | None
    """None where none is authored."""
    shines: bool
    """It is a light by type, or geometry that is one too."""


class _State(NamedTuple):
    """What children inherit."""

    visible: bool
    purpose: str | None
    instance: str | None
    """The outermost native instance."""
    appearance: Appearance
    """What a point instancer that is around makes of its prototypes."""


class _Placed(NamedTuple):
    """A placement on its way into the description."""

    prim: Any
    shape: int
    item: dict[str, Any]


class _Light(NamedTuple):
    """A light on its way into the description."""

    prim: Any
    transform: list[float] | None
    """None where it is placed as a shape."""


@dataclass
class _Group:
    """What is placed together: the stage, or a prototype of point instancers."""

    path: str
    root: Any = None
    """The prototype's root prim, whose own transform is that of the instances; None for the stage."""
    placed: list[_Placed] = field(default_factory=list)
    instances: list[dict[str, Any]] = field(default_factory=list)
    instancers: list[tuple[Any, Any]] = field(default_factory=list)
    """The prims that these are of, and what they share with other native instances."""
    lights: list[_Light] = field(default_factory=list)


# Deeper nesting of instancers than this nobody models, and Python's own stack would end soon after.
_MAX_NESTING = 64


class _Walk:
    """One reading of one stage at one time."""

    def __init__(
        self,
        opened: OpenedStage,
        time: Any,
        purposes: frozenset[str],
        render_pass: ActivePass | None,
        level: int | None,
        diagnostics: Diagnostics,
    ) -> None:
        self.stage = opened.stage
        self._pass = render_pass
        self.time = time
        self.purposes = purposes
        self.diagnostics = diagnostics
        self.places = Places(time)
        self.shapes = ShapeReader(time, diagnostics, level)
        self._table = ArrayTable()
        self.instancers = InstancerReader(time, diagnostics, self._table)
        self.groups: list[_Group] = [_Group("/")]
        self.cameras: list[Any] = []
        self._kinds: dict[str, Kind] = {}
        self._facts_by_prim: dict[Any, _Facts] = {}
        self._hidden: dict[tuple[Any, str], bool] = {}
        self._group_by_prototype: dict[tuple[Any, str | None, Appearance], int] = {}
        # The prototypes around what is visited, innermost last.
        self._open: list[Any] = []

    def run(self) -> None:
        """Visit every prim that the stage defines, those inside native instances included."""
        prims = iter(Usd.PrimRange(self.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        self._traverse(
            prims, itertools.islice(prims, 1, None), _State(True, None, None, Appearance()), 0, self.groups[0]
        )

    def _traverse(self, prims: Any, visited: Any, state: _State, depth: int, group: _Group) -> None:
        """Visit the prims of a range; ``depth`` is that of the first one's parent, ``state`` what it inherits."""
        states = [state]
        for prim in visited:
            path = prim.GetPath()
            del states[path.pathElementCount - depth :]
            parent = states[-1]
            # Below an instance all is shared; the instance itself may differ from its prototype's root.
            source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else None
            facts = self._facts_by_prim.get(source) if source else None
            if facts is None:
                facts = self._facts(prim)
                if source:
                    self._facts_by_prim[source] = facts
            kind = facts.kind
            # In a prototype, what stands above may be an `over`, but what is drawn is defined.
            undefined = group.root is not None and prim.GetSpecifier() == Sdf.SpecifierOver
            if kind is Kind.LEAF or undefined:
                prims.PruneChildren()
                continue
            if self._pass is not None and self._pass.prunes(path):
                self.diagnostics.skip("pruned by the render pass")
                prims.PruneChildren()
                continue
            state = self._inherit(prim, facts, parent)
            states.append(state)
            if kind is Kind.LENS:
                # What stands below is what other software draws in its place.
                prims.PruneChildren()
            if kind is Kind.INSTANCER:
                # Its prototypes usually stand below it and are not drawn where they stand.
                prims.PruneChildren()
            try:
                if kind is Kind.INSTANCER:
                    self._instance(prim, source or prim, str(path), state, group)
                elif kind is not Kind.PASS_THROUGH:
                    self._visit(prim, source or prim, str(path), facts, state, group)
                elif prim.IsModel():
                    self._check_draw_mode(prim, state)
            except BrokenError as broken:
                self.diagnostics.leave_out(broken)
            except Tf.ErrorException as error:
                self.diagnostics.leave_out(BrokenError(place(prim), f"USD cannot read it ({usd_reason(error)})"))

    def _instance(self, prim: Any, source: Any, path: str, state: _State, group: _Group) -> None:
        """Add what a point instancer shows to ``group``."""
        if not state.visible:
            self.diagnostics.skip("invisible")
            return
        if not self._is_rendered(prim):
            return
        state = state._replace(appearance=self._appearance(prim, state))

        def has_something(root: Any) -> bool:
            index = self._prototype(root, prim, state)
            if index is None:
                return False
            group = self.groups[index]
            return bool(group.placed or group.instances or group.lights)

        transform = self._transform(prim, group)
        for elements in self.instancers.elements(prim, source, has_something):
            item: dict[str, Any] = {
                "path": path,
                "group": self._prototype(self.stage.GetPrimAtPath(elements.prototype), prim, state),
                "transforms": elements.transforms,
                "count": elements.total,
            }
            if elements.indices is not None:
                item["indices"] = elements.indices
            if transform != IDENTITY:
                item["transform"] = transform
            group.instances.append(item)
            group.instancers.append((prim, source))

    def _prototype(self, root: Any, instancer: Any, state: _State) -> int | None:
        """Return the group of a prototype; None with a warning where it contains the instancer.

        As in Hydra, a prototype's visibility is decided from its root down and by the instancer: what hides it where it
        stands does not hide its instances. Purpose is inherited where it stands, else from the instancer.
        """
        purpose = self._purpose_above(root) or state.purpose
        key = (root, purpose, state.appearance)
        if root in self._open:
            self.diagnostics.warn(
                "instancer", place(instancer), f"its prototype <{root.GetPath()}> contains it; it is left out there"
            )
            return None
        index = self._group_by_prototype.get(key)
        if index is None:
            if len(self._open) == _MAX_NESTING:
                raise BrokenError(place(instancer), f"is nested in {_MAX_NESTING} others, which is too deep")
            index = self._group_by_prototype[key] = len(self.groups)
            group = _Group(str(root.GetPath()), root)
            self.groups.append(group)
            self._open.append(root)
            prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)))
            depth = root.GetPath().pathElementCount - 1
            try:
                self._traverse(prims, prims, _State(True, purpose, None, state.appearance), depth, group)
            finally:
                self._open.pop()
        return index

    def _purpose_above(self, prim: Any) -> str | None:
        """Return the purpose that a prim inherits where it stands; None where none is authored."""
        ancestor = prim.GetParent()
        while ancestor and not ancestor.IsPseudoRoot():
            purpose = self._facts(ancestor).purpose
            if purpose is not None:
                return purpose
            ancestor = ancestor.GetParent()
        return None

    def _transform(self, prim: Any, group: _Group) -> list[float]:
        """Return the matrix from a prim's space to its group's: the world's, or the prototype root's own."""
        return self.places.of(prim, group.root)

    def _facts(self, prim: Any) -> _Facts:
        type_name = prim.GetTypeName()
        kind = self._kinds.get(type_name)
        if kind is None:
            kind = self._kinds[type_name] = classify(prim)
        if kind in (Kind.MESH, Kind.PASS_THROUGH) and is_lens(prim):
            kind = Kind.LENS
        shines = kind is Kind.LIGHT or is_light(prim)
        if shines and kind is Kind.PASS_THROUGH:
            kind = Kind.LIGHT
        attribute = prim.GetAttribute(tokens.PURPOSE)
        authored = bool(attribute) and attribute.HasAuthoredValue()
        return _Facts(
            kind,
            read(prim, tokens.VISIBILITY, self.time) == tokens.INVISIBLE,
            str(read(prim, tokens.PURPOSE, self.time) or tokens.DEFAULT) if authored else None,
            shines,
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
            parent.appearance,
        )

    def _is_rendered(self, prim: Any) -> bool:
        """Whether the render pass shows a prim; counted where not."""
        if self._pass is None or self._pass.renders(prim.GetPath()):
            return True
        self.diagnostics.skip("not in the render pass")
        return False

    def _appearance(self, prim: Any, state: _State) -> Appearance:
        """Return how cameras see a prim."""
        if self._pass is None:
            return state.appearance
        own = self._pass.appearance(prim.GetPath())
        return Appearance(own.hidden or state.appearance.hidden, own.matte or state.appearance.matte)

    def _visit(self, prim: Any, source: Any, path: str, facts: _Facts, state: _State, group: _Group) -> None:
        """Do with a prim what its kind asks for; ``source`` is what it shares with other instances, or itself."""
        kind = facts.kind
        if kind is Kind.CAMERA:
            if group.root is None:
                self.cameras.append(prim)
            return
        if not self._is_rendered(prim):
            return
        if not state.visible:
            self.diagnostics.skip("invisible")
            return
        purpose = state.purpose or tokens.DEFAULT
        if purpose not in self.purposes:
            self.diagnostics.skip(f"purpose {purpose}")
            return
        if purpose != tokens.DEFAULT and self._hides(prim, purpose):
            self.diagnostics.skip("invisible")
            return
        if facts.shines:
            group.lights.append(_Light(prim, None if kind in GEOMETRY else self._transform(prim, group)))
        if kind is Kind.LIGHT:
            return
        if kind is Kind.MESH:
            self._place(prim, path, self.shapes.mesh(prim, source), state, group)
        elif kind is Kind.SPHERE:
            self._place(prim, path, self.shapes.sphere(prim, source), state, group)
        elif kind is Kind.LENS:
            self._place(prim, path, self.shapes.lens(prim, source), state, group)
        elif kind is Kind.SOLID:
            self._place(prim, path, self.shapes.solid(prim, source), state, group)
        elif kind is Kind.SKELETAL:
            self.diagnostics.warn(
                "unsupported-prim", place(prim), "skinning is not supported; meshes below are rendered as authored"
            )
        elif kind is Kind.UNKNOWN:
            self.diagnostics.warn(
                "unknown-prim-type",
                place(prim),
                f"no schema of this USD declares {prim.GetTypeName()}; it is ignored",
            )
        else:
            self.diagnostics.warn(
                "unsupported-prim", place(prim), f"{prim.GetTypeName()} prims are not supported; they are left out"
            )

    def _hides(self, prim: Any, purpose: str) -> bool:
        """Whether the nearest authored visibility of a purpose, the prim's own or one above it, is invisible.

        The fallback of guides is invisible too, but here they are shown only where somebody has asked for guides.
        """
        asked, is_hidden = [], False
        while prim:
            known = self._hidden.get((prim, purpose))
            if known is not None:
                is_hidden = known
                break
            asked.append((prim, purpose))
            if prim.HasAPI(UsdGeom.VisibilityAPI):
                attribute = prim.GetAttribute(purpose + tokens.PURPOSE_VISIBILITY)
                if attribute and attribute.HasAuthoredValue():
                    is_hidden = read(prim, attribute.GetName(), self.time) == tokens.INVISIBLE
                    break
            prim = prim.GetParent()
        self._hidden.update((key, is_hidden) for key in asked)
        return is_hidden

    def _check_draw_mode(self, prim: Any, state: _State) -> None:
        mode = read(prim, tokens.DRAW_MODE, self.time)
        if mode and mode not in tokens.FULL_DRAW_MODES and state.visible:
            self.diagnostics.warn(
                "unsupported-draw-mode",
                place(prim),
                f"draw mode '{mode}' is not supported; all of it is rendered",
            )

    def _place(self, prim: Any, path: str, shape: int | None, state: _State, group: _Group) -> None:
        if shape is None:
            return
        item: dict[str, Any] = {"path": path, "target": {"shape": shape}}
        transform = self._transform(prim, group)
        if transform != IDENTITY:
            item["transform"] = transform
        # The instances of a point instancer have names of their own.
        if state.instance is not None and group.root is None:
            item["instance"] = state.instance
        if self.shapes.double_sided[shape]:
            item["double_sided"] = True
        appearance = self._appearance(prim, state)
        if appearance.hidden:
            item["hidden_from_camera"] = True
        if appearance.matte:
            item["matte"] = True
        group.placed.append(_Placed(prim, shape, item))

    def bind(self, materials: MaterialReader) -> list[dict[str, Any]]:
        """Add materials to the placements and return the groups."""
        placements = [placed for group in self.groups for placed in group.placed]
        prims: list[Any] = []
        for placed in placements:
            prims.append(placed.prim)
            prims.extend(placed.prim.GetChild(name) for name in self.shapes.subset_names[placed.shape])
        bound = iter(materials.bound(prims))
        primvars = PrimvarReader(self.shapes, self.time, self.diagnostics)
        for placed in placements:
            material = next(bound)
            if material is not None:
                placed.item["material"] = material
            names = self.shapes.subset_names[placed.shape]
            if names:
                placed.item["subset_materials"] = [next(bound) for _ in names]
            used = {material, *placed.item.get("subset_materials", ())}
            looked_up = {name for index in used if index is not None for name in materials.primvars[index]}
            if None in used:
                looked_up.add(tokens.DISPLAY_COLOR)
            primvars.add(placed.prim, placed.shape, looked_up, placed.item)
        groups: list[dict[str, Any]] = []
        for group in self.groups:
            groups.append({"path": group.path, "items": [placed.item for placed in group.placed]})
            if group.instances:
                groups[-1]["instances"] = group.instances
        return groups

    def add_motion(self, reader: MotionReader, cameras: Iterable[tuple[Any, dict[str, Any]]]) -> None:
        """Add to everything that was read where it is at other times."""
        for prim, mesh in self.shapes.meshes():
            reader.points(prim, mesh, self.shapes)
        places: dict[Any, dict[str, dict[str, Any]]] = {}
        for group in self.groups:
            moving = [(placed.prim, placed.item) for placed in group.placed]
            moving += [(prim, item) for (prim, _), item in zip(group.instancers, group.instances, strict=True)]
            for prim, item in moving:
                _add(item, "motion", reader.transform(prim, group.root))
            for (_, source), item in zip(group.instancers, group.instances, strict=True):
                if source not in places:
                    places[source] = reader.instances(source, self.instancers)
                _add(item, "places_motion", places[source].get(item["transforms"]))
        for prim, camera in cameras:
            _add(camera, "motion", reader.transform(prim))

    def shine(self, reader: LightReader, groups: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Add lights to the groups, which are bound, and return the sets that they are linked to."""
        lights = []
        for group, described in zip(self.groups, groups, strict=True):
            for prim, transform in group.lights:
                try:
                    light = reader.read(prim, is_geometry=transform is None)
                except BrokenError as broken:
                    self.diagnostics.leave_out(broken)
                    continue
                if light is None:
                    continue
                if transform is not None and transform != IDENTITY:
                    light["transform"] = transform
                described.setdefault("lights", []).append(light)
                lights.append((light, prim))
        return link_lights(groups, lights, self.diagnostics)

    def arrays(self) -> dict[str, Array]:
        """Return all arrays by name."""
        return {**self.shapes.arrays, **self._table.arrays}

    def bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of everything placed, by the corners of object-space boxes; None if there is none."""
        corners: dict[int, Any] = {}
        for shape in {placed.shape for group in self.groups for placed in group.placed}:
            extent = self.shapes.bounds(shape)
            if extent is not None:
                # Homogeneous rows, as USD multiplies them.
                corners[shape] = np.array([(*corner, 1.0) for corner in itertools.product(*zip(*extent, strict=True))])
        box = self._box(0, corners, {})
        return None if box is None else _finite_box(box[0].tolist(), box[1].tolist())

    def _box(self, index: int, corners: dict[int, Any], boxes: dict[int, Any]) -> Any:
        """Return the box of a group in its own space from the corners of shapes; ``boxes`` keeps what is known."""
        if index in boxes:
            return boxes[index]
        found: list[Any] = []
        group = self.groups[index]
        placed = [p for p in group.placed if p.shape in corners]
        with np.errstate(over="ignore", invalid="ignore"):  # a box that is not finite is no box
            if placed:
                matrices = np.array([p.item.get("transform", IDENTITY) for p in placed]).reshape(-1, 4, 4)
                found.append(np.matmul(np.array([corners[p.shape] for p in placed]), matrices).reshape(-1, 4)[:, :3])
            for item in group.instances:
                box = self._box(item["group"], corners, boxes)
                if box is None:
                    continue
                own = np.array(item.get("transform", IDENTITY)).reshape(4, 4)[:, :3]
                rows = self._table.arrays[item["transforms"]].reshape(-1, 4, 3)
                linear, offset = rows[:, :3] @ own[:3], rows[:, 3] @ own[:3] + own[3]
                centre, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
                middle, reach = centre @ linear + offset, half @ np.abs(linear)
                usable = np.isfinite(middle).all(axis=1) & np.isfinite(reach).all(axis=1)
                found += [(middle - reach)[usable], (middle + reach)[usable]]
        points = np.concatenate(found) if found else np.empty((0, 3))
        boxes[index] = (points.min(axis=0), points.max(axis=0)) if len(points) else None
        return boxes[index]

    def stage_bounds(self) -> tuple[list[float], list[float]] | None:
        """Return the world box of the stage as USD computes it, prims included that are not rendered."""
        cache = UsdGeom.BBoxCache(self.time, sorted(self.purposes), True)
        box = cache.ComputeWorldBound(self.stage.GetPseudoRoot()).ComputeAlignedRange()
        return None if box.IsEmpty() else _finite_box(list(box.GetMin()), list(box.GetMax()))


def _add(item: dict[str, Any], name: str, value: Any) -> None:
    if value is not None:
        item[name] = value


def _finite_box(low: list[float], high: list[float]) -> tuple[list[float], list[float]] | None:
    return (low, high) if is_finite([*low, *high]) else None


def read_stage(
    stage_or_path: Any,
    *,
    frame: float | str | None,
    camera: str | None,
    render_settings: str | None,
    render_pass: str | None,
    product: str | None,
    purposes: Sequence[str] | None,
    missing: str,
    motion_blur: bool | None,
    motion_vectors: bool | None,
    complexity: str | None,
    strict: bool,
    **opening: Unpack[Opening],
) -> Description:
    """Read a stage into a description; the arguments are those of :func:`abbe.usd.describe`."""
    if missing not in ("warn", "error"):
        raise UsageError(f"missing '{missing}': choose 'warn' or 'error'")
    if render_pass and render_settings:
        raise UsageError("render pass: it says which render settings it renders: give one of the two")
    refinement_level(complexity)  # before the stage is opened
    diagnostics = Diagnostics()
    source = source_name(stage_or_path)
    with quiet_usd(source, diagnostics):
        # A mask keeps the camera and the settings that were asked for by path.
        also = [path for path in (camera, render_settings, render_pass, product) if path and path.startswith("/")]
        if isinstance(stage_or_path, KeptStage):
            opened = stage_or_path.open(also, diagnostics, opening)
        else:
            opened = open_stage(stage_or_path, also=also, diagnostics=diagnostics, **opening)
        return _read(
            opened,
            diagnostics,
            frame,
            camera,
            render_settings,
            render_pass,
            product,
            purposes,
            missing,
            motion_blur,
            motion_vectors,
            complexity,
            strict,
        )


def _read(
    opened: OpenedStage,
    diagnostics: Diagnostics,
    frame: float | str | None,
    camera: str | None,
    render_settings: str | None,
    render_pass: str | None,
    product: str | None,
    purposes: Sequence[str] | None,
    missing: str,
    motion_blur: bool | None,
    motion_vectors: bool | None,
    complexity: str | None,
    strict: bool,
) -> Description:
    stage, source = opened.stage, opened.source
    time, time_code = stage_time(stage, frame)
    composition_warnings(opened, missing, diagnostics)
    active_pass = find_pass(stage, render_pass, source, diagnostics) if render_pass else None
    if active_pass is not None:
        render_settings = active_pass.settings
    settings_prim = find_settings(stage, render_settings, source, diagnostics)
    shown = rendered_purposes(purposes, settings_prim)
    walk = _Walk(opened, time, shown, active_pass, refinement_level(complexity), diagnostics)
    walk.run()
    assets = AssetReader(stage, time)
    materials = MaterialReader(time, diagnostics, binding_purposes(settings_prim), assets)
    groups = walk.bind(materials)
    metadata = stage_metadata(opened, time_code, diagnostics)
    link_sets = walk.shine(LightReader(time, metadata["up_axis"], assets, diagnostics), groups)

    cameras: list[dict[str, Any]] = []
    index_by_camera: dict[Any, int] = {}

    def camera_index(prim: Any) -> int:
        if prim not in index_by_camera:
            index_by_camera[prim] = len(cameras)
            cameras.append(read_camera(prim, time, walk.places.cache))
        return index_by_camera[prim]

    chosen = find_camera(stage, camera, source) if camera else default_camera(stage, settings_prim, walk.cameras)
    if chosen is not None:
        camera_index(chosen)
    else:
        cameras.append(_framed(walk, metadata["up_axis"], source, strict, diagnostics))
    settings = read_settings(
        stage, settings_prim, time, time_code or 0.0, product, camera_index, bool(camera), source, diagnostics
    )
    span = motion_span(stage, time, cameras, settings, motion_blur, motion_vectors)
    if span is not None:
        metadata["motion"] = [span.marks[0], span.marks[-1]]
        walk.add_motion(MotionReader(span, diagnostics), zip(index_by_camera, cameras, strict=False))
    if not any(group["items"] for group in groups):
        diagnostics.warn("nothing-to-render", source, "the stage has no geometry to render: every ray misses")

    document = {
        "format": FORMAT,
        "version": VERSION,
        "stage": metadata,
        "shapes": walk.shapes.shapes,
        "groups": groups,
        "root": 0,
        "materials": materials.materials,
        "textures": assets.textures,
        "cameras": cameras,
        "link_sets": link_sets,
        "settings": settings,
        "warnings": diagnostics.warnings(),
        "skipped": diagnostics.skipped,
        "strict_assets": missing == "error",
    }
    return Description(document, {**walk.arrays(), **assets.arrays})


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
