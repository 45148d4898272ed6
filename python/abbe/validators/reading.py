"""One look at a stage that all validators share: what it describes, and what the core says of its parts."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Unpack

import numpy as np

from .. import _core
from ..errors import AbbeError, StageError
from ..usd import describe, tokens
from ..usd._pxr import Sdf, Usd, UsdShade
from ..usd.assets import AssetReader
from ..usd.composition import quiet_usd
from ..usd.description import Array, Description, Diagnostics
from ..usd.materials import MaterialReader
from ..usd.metadata import stage_metadata, stage_time
from ..usd.render import all_settings, read_settings
from ..usd.stage import OpenedStage, Opening, open_stage, source_name
from . import Finding, Severity

__all__ = ["CompiledMaterial", "Reading", "Remark", "read", "shared_source"]

# What the core says of an open mesh of a material that has an inside, and of no other.
OPEN_GLASS = "open-glass-mesh"

_PLACE = re.compile(r"<(?P<prim>[^>]*)>(?:\.(?P<name>\S+))?")


@dataclass(frozen=True)
class Remark:
    """An error or a warning of the core or the bridge, taken apart."""

    severity: Severity
    kind: str
    place: str
    message: str

    @property
    def property_name(self) -> str:
        """Name of the attribute that it is about, without ``inputs:``; empty if it is about a prim."""
        match = _PLACE.fullmatch(self.place)
        return (match["name"] or "").removeprefix(tokens.INPUTS_PREFIX) if match else ""


@dataclass(frozen=True)
class CompiledMaterial:
    """A material and what the core says when it compiles it alone."""

    document: Mapping[str, Any]
    """As it stands in the scene description."""
    remarks: tuple[Remark, ...]
    is_solid: bool
    """It is a dielectric with an inside: not thin-walled, no metal, not opaque; False if it cannot be compiled."""

    @property
    def path(self) -> str:
        """Path of the Material prim."""
        return str(self.document["path"])

    def authored(self, name: str) -> Any:
        """Return the value of an ``abbe:`` attribute, from the place where the core takes it; None if unauthored."""
        for place in self._places():
            if name in place:
                return place[name]["value"]
        return None

    @property
    def has_ours(self) -> bool:
        """Whether any ``abbe:`` attribute is authored on it or its shader."""
        return any(self._places())

    @property
    def surfaces(self) -> list[Mapping[str, Any]]:
        """The surface shaders of its terminals, the first first."""
        surface = self.document.get("surface")
        return [] if surface is None else [surface, *self.document.get("alternatives", [])]

    def _places(self) -> list[Mapping[str, Any]]:
        surfaces = [surface.get("abbe", {}) for surface in self.surfaces]
        return [self.document.get("abbe", {}), *surfaces, self.document.get("interface_abbe", {})]


# Kinds of warnings for prims that are left out since nobody can render what they say.
_BROKEN = ("broken-prim", "broken-shape", "broken-transform")


class Reading:
    """What validators ask of a stage; each answer is found once."""

    def __init__(
        self,
        opened: OpenedStage,
        frame: float | Literal["default"] | None,
        purposes: Sequence[str] | None,
        missing: str,
    ) -> None:
        self.stage = opened.stage
        self.source = opened.source
        self.time, self._time_code = stage_time(opened.stage, frame)
        self._options: dict[str, Any] = {"frame": frame, "purposes": purposes, "missing": missing}
        self._metadata = stage_metadata(opened, self._time_code, Diagnostics())
        self._kept: dict[str, Any] = {}
        self._textures: list[dict[str, Any]] = []

    def once(self, name: str, find: Callable[[], Any]) -> Any:
        """Return what ``find`` returns, called for the first who asks under this name."""
        if name not in self._kept:
            self._kept[name] = find()
        return self._kept[name]

    @cached_property
    def described(self) -> Description | StageError:
        """The scene description that a render would get, or why there is none."""
        try:
            return describe(self.stage, **self._options)
        except StageError as error:
            return error

    @cached_property
    def refusals(self) -> list[Remark]:
        """Why the stage cannot be read, or which prims a render leaves out; materials are looked at one by one."""
        if isinstance(self.described, StageError):
            return [self.error(self.described)]
        document = self.described.document
        groups = [{**group, "items": [_bare(item) for item in group["items"]]} for group in document["groups"]]
        bare = Description({**document, "groups": groups, "materials": []}, self.described.arrays)
        try:
            scene = _core.Scene(bare.to_json(), bare.arrays)
        except AbbeError as error:
            return [self.error(error)]
        broken = [warning for warning in scene.warnings() if warning["kind"] in _BROKEN]
        return [dataclasses.replace(remark, severity="error") for warning in broken for remark in _warnings(warning)]

    @cached_property
    def materials(self) -> dict[str, CompiledMaterial]:
        """Every Material prim by path, used or not; those of instances once."""
        described = self.described
        documents = {} if isinstance(described, StageError) else {m["path"]: m for m in described.document["materials"]}
        seen = {shared_source(self.stage.GetPrimAtPath(path)) for path in documents}
        assets = AssetReader(self.stage, self.time)
        if not isinstance(described, StageError):
            # Their materials refer to them by index.
            assets.textures.extend(described.document["textures"])
        reader = MaterialReader(self.time, Diagnostics(), tokens.BINDING_PURPOSES, assets)
        for prim in self.prims:
            if prim.IsA(UsdShade.Material) and shared_source(prim) not in seen:
                seen.add(shared_source(prim))
                documents[str(prim.GetPath())] = reader.unbound(prim)
        # Nothing is looked up: what is in the files does not matter.
        self._textures = [{"place": t["place"], "asset": {"path": t["asset"]["path"]}} for t in assets.textures]
        return {path: self._compile(document) for path, document in documents.items()}

    @cached_property
    def prims(self) -> list[Any]:
        """Every prim that the stage defines, those in instances included."""
        return list(Usd.PrimRange(self.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))

    @cached_property
    def render_remarks(self) -> list[Remark]:
        """What planning a render with each RenderSettings prim says."""
        remarks = []
        for settings in all_settings(self.stage):
            diagnostics = Diagnostics()
            try:
                document = read_settings(
                    self.stage,
                    settings,
                    self.time,
                    self._time_code or 0.0,
                    None,
                    lambda _prim: 0,
                    False,
                    self.source,
                    diagnostics,
                )
                scene = _core.Scene(*self._probe(settings=document))
                found = [warning for _, plan in scene.plan("{}") for warning in json.loads(plan)["warnings"]]
            except AbbeError as error:
                remarks.append(self.error(error, settings))
                continue
            for warning in (*diagnostics.warnings(), *found):
                for remark in _warnings(warning):
                    remarks.append(dataclasses.replace(remark, place=_settings_place(remark.place, settings)))
        return list(dict.fromkeys(remarks))

    def shape_remarks(self, shape: Mapping[str, Any], arrays: Mapping[str, Array]) -> list[Remark]:
        """Return what the core says of a shape made of glass."""
        try:
            scene = _core.Scene(*self._probe(shape=shape, arrays=arrays, material=_GLASS))
        except AbbeError as error:
            return [self.error(error)]
        return [remark for warning in scene.warnings() for remark in _warnings(warning)]

    def error(self, error: AbbeError, settings: Any = None) -> Remark:
        """Return an error's place and message; without a place it is that of the settings, else of the stage."""
        text = str(error) if settings is None else _settings_place(str(error), settings)
        if text.startswith(f"{self.source}: "):
            return Remark("error", "refused", self.source, text[len(self.source) + 2 :])
        place, _, message = text.partition(": ")
        if " " in place or not message:
            place, message = self.source if settings is None else f"<{settings.GetPath()}>", text
        return Remark("error", "refused", place, message)

    def finding(self, validator: str, remark: Remark) -> Finding:
        """Return a remark as a finding."""
        return self.found(validator, remark.kind, remark.severity, remark.place, remark.message)

    def found(self, validator: str, kind: str, severity: Severity, place: str, message: str) -> Finding:
        """Return a finding; ``place`` is a path of USD, or as messages show it, or anything else for the stage."""
        match = _PLACE.fullmatch(place)
        if match:
            path = Sdf.Path(match["prim"])
            path = path.AppendProperty(match["name"]) if match["name"] else path
        elif place != self.source and place.startswith("/") and Sdf.Path.IsValidPathString(place):
            path = Sdf.Path(place)
            prim = path.GetPrimPath()
            place = f"<{prim}>.{path.name}" if path.IsPropertyPath() else f"<{prim}>"
        else:
            path = Sdf.Path.absoluteRootPath
        return Finding(validator, kind, severity, str(path), place, message)

    def _compile(self, document: Mapping[str, Any]) -> CompiledMaterial:
        try:
            scene = _core.Scene(*self._probe(material=document))
        except AbbeError as error:
            return CompiledMaterial(document, (self.error(error),), False)
        remarks = [remark for warning in scene.warnings() for remark in _warnings(warning)]
        return CompiledMaterial(
            document,
            tuple(remark for remark in remarks if remark.kind != OPEN_GLASS),
            any(remark.kind == OPEN_GLASS for remark in remarks),
        )

    def _probe(
        self,
        *,
        shape: Mapping[str, Any] | None = None,
        arrays: Mapping[str, Array] | None = None,
        material: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> tuple[str, Mapping[str, Array]]:
        """Return the smallest scene with such parts: one open triangle unless a shape is given."""
        shape = _TRIANGLE if shape is None else shape
        (body,) = shape.values()
        item = {"path": body["path"], "target": {"shape": 0}}
        document = {
            "format": "abbe-scene",
            "version": 1,
            "stage": self._metadata,
            "shapes": [shape],
            "groups": [{"path": "/", "items": [item if material is None else {**item, "material": 0}]}],
            "root": 0,
            "materials": [] if material is None else [material],
            "textures": self._textures,
            "cameras": [_CAMERA],
            "settings": settings or {},
        }
        return json.dumps(document), _TRIANGLE_ARRAYS if arrays is None else arrays


_TRIANGLE: Mapping[str, Any] = {
    "mesh": {"path": "/", "points": "points", "face_vertex_counts": "counts", "face_vertex_indices": "indices"}
}
_TRIANGLE_ARRAYS: Mapping[str, Array] = {
    "points": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32),
    "counts": np.array([3], np.int32),
    "indices": np.array([0, 1, 2], np.int32),
}
_GLASS: Mapping[str, Any] = {
    "path": "/",
    "surface": {
        "path": "/",
        "id": "UsdPreviewSurface",
        "terminal": "outputs:surface",
        "inputs": {"opacity": {"type": "float", "value": 0.0}},
    },
}
_CAMERA: Mapping[str, Any] = {
    "path": "",
    "transform": np.eye(4).ravel().tolist(),
    "projection": "perspective",
    "horizontal_aperture": 20.955,
    "vertical_aperture": 15.2908,
    "focal_length": 50.0,
}


def _settings_place(text: str, settings: Any) -> str:
    """Return a text of the core, which has one prim of settings and does not name it, with its path."""
    return text.replace("render settings, ", f"<{settings.GetPath()}>.", 1)


def shared_source(prim: Any) -> Any:
    """Return what a prim shares with those of other instances, or itself."""
    return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim


def _bare(item: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in item.items() if name not in ("material", "subset_materials")}


def _warnings(warning: Mapping[str, Any]) -> Iterator[Remark]:
    for place in warning["places"]:
        yield Remark("warning", warning["kind"], place, warning["message"])


@contextmanager
def read(
    stage_or_path: Any,
    *,
    frame: float | Literal["default"] | None,
    purposes: Sequence[str] | None,
    missing: str,
    **opening: Unpack[Opening],
) -> Iterator[Reading]:
    """Open a stage for validators; the arguments are those of :func:`abbe.validators.validate`."""
    diagnostics = Diagnostics()
    with quiet_usd(source_name(stage_or_path), diagnostics):
        opened = open_stage(stage_or_path, diagnostics=diagnostics, **opening)
        yield Reading(opened, frame, purposes, missing)
