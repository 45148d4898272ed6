"""Glass as bodies: closed, with a thickness, facing outwards, and not two of them in one place undecided."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import StageError
from ..usd.description import Description
from . import Finding
from .reading import OPEN_GLASS, CompiledMaterial, Reading

__all__ = ["closed", "orientation", "overlapping", "thickness"]

F64 = npt.NDArray[np.float64]

# Points are float32, so each coordinate is off by up to 2^-24 of its size; the distance to a plane that was fitted to
# such points sums three of them and the plane's own error.
_ROUNDING = 2.0**-22
# A body is inside another only if it still is when it is this much smaller: what merely touches does not overlap.
_SHRINK = 1e-4
# Points of a body that are tested, and how many pairs of points and triangles that may cost: about a second.
_SAMPLES = 256
_PAIRS = 2e7
# Bodies that are compared with each other: so many boxes take a second, and more are gravel.
_BODIES = 4096


@dataclass(frozen=True)
class _Body:
    """One placement of something made of glass with an inside."""

    path: str
    shape: dict[str, Any]
    arrays: dict[str, Any]
    transform: F64
    material: CompiledMaterial

    @property
    def is_mesh(self) -> bool:
        return "mesh" in self.shape

    @cached_property
    def points(self) -> F64:
        """Object-space points that faces use; of a sphere some on its surface, spread evenly (Fibonacci's spiral)."""
        if self.is_mesh:
            return np.unique(self.triangles.reshape(-1, 3), axis=0)
        turns = np.arange(_SAMPLES) + 0.5
        height, azimuth = 1 - 2 * turns / _SAMPLES, turns * np.pi * (3 - 5**0.5)
        reach = np.sqrt(1 - height**2)
        surface = np.stack([reach * np.cos(azimuth), reach * np.sin(azimuth), height], axis=1)
        return np.asarray(self.shape["sphere"]["radius"] * surface, np.float64)

    @cached_property
    def triangles(self) -> F64:
        """Corners (n, 3, 3) of a mesh's faces cut into fans, outwards as authored; none if arrays are unusable."""
        mesh = self.shape["mesh"]
        counts = np.asarray(self.arrays[mesh["face_vertex_counts"]], np.int64)
        indices = np.asarray(self.arrays[mesh["face_vertex_indices"]], np.int64)
        points = np.asarray(self.arrays[mesh["points"]], np.float64)
        if counts.min() < 0 or counts.sum() > len(indices) or indices.min() < 0 or indices.max() >= len(points):
            return np.empty((0, 3, 3))
        cut = np.maximum(counts - 2, 0)
        first = np.repeat(np.cumsum(counts) - counts, cut)
        step = np.arange(cut.sum()) - np.repeat(np.cumsum(cut) - cut, cut)
        corners = points[indices[np.stack([first, first + step + 1, first + step + 2], axis=1)]]
        return np.asarray(corners[:, ::-1] if mesh.get("left_handed") else corners, np.float64)

    @cached_property
    def volume(self) -> tuple[float, float]:
        """The enclosed volume by the divergence theorem, and how far float32 points leave it open."""
        corners = self.triangles
        if not len(corners):
            return 0.0, 0.0
        a, b, c = (corners - corners.mean(axis=(0, 1))).transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1).sum() / 2
        return float((a * normal).sum() / 6), float(_ROUNDING * np.abs(corners).max() * area)

    @cached_property
    def is_flat(self) -> bool:
        """Whether all points lie in one plane."""
        centred = self.points - self.points.mean(axis=0)
        normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
        return bool(np.abs(centred @ normal).max() <= _ROUNDING * np.abs(self.points).max())

    @property
    def is_sheet(self) -> bool:
        """Whether it has no inside: one flat layer of faces, or two that enclose nothing."""
        if not self.is_mesh:
            return False
        volume, uncertainty = self.volume
        return self.is_flat or abs(volume) <= uncertainty

    @cached_property
    def box(self) -> tuple[F64, F64]:
        """World-space corners."""
        if self.is_mesh:
            low, high = self.points.min(axis=0), self.points.max(axis=0)
        else:
            high = np.full(3, abs(float(self.shape["sphere"]["radius"])))
            low = -high
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        world = self.to_world(corners)
        return world.min(axis=0), world.max(axis=0)

    def to_world(self, points: F64) -> F64:
        """Object space to world; row vectors, as USD has them."""
        return np.asarray(points @ self.transform[:3, :3] + self.transform[3, :3], np.float64)

    def to_object(self, points: F64) -> F64:
        """World to object space."""
        inverse = np.linalg.inv(self.transform)
        return np.asarray(points @ inverse[:3, :3] + inverse[3, :3], np.float64)

    def drawn_in(self, points: F64) -> F64:
        """Object-space points of the surface in the world, as if the body were slightly smaller."""
        middle = self.points.mean(axis=0)
        return self.to_world(middle + (1 - _SHRINK) * (points - middle))

    def surface_within(self, low: F64, high: F64) -> tuple[F64, bool]:
        """Return world-space points of the surface that lie in a box, and whether all of it does.

        Vertices, the middles of triangles, and of each edge the middle of the part that lies in the box.
        """
        points = self.drawn_in(self.points)
        within = ((low < points) & (points < high)).all(axis=1)
        found = [points[within]]
        if self.is_mesh:
            triangles = self.drawn_in(self.triangles.reshape(-1, 3)).reshape(-1, 3, 3)
            begin, along = triangles, np.roll(triangles, -1, axis=1) - triangles
            # Edges along an axis cross a side of the box at ±inf, or nowhere in particular if they lie in it: NaN.
            with np.errstate(divide="ignore", invalid="ignore"):
                low_side, high_side = (low - begin) / along, (high - begin) / along
            enter = np.fmax(np.fmax.reduce(np.fmin(low_side, high_side), axis=-1), 0.0)
            leave = np.fmin(np.fmin.reduce(np.fmax(low_side, high_side), axis=-1), 1.0)
            met = enter < leave
            found += [begin[met] + ((enter[met] + leave[met]) / 2)[:, None] * along[met], triangles.mean(axis=1)]
        inner = np.concatenate(found)
        return inner[((low < inner) & (inner < high)).all(axis=1)], bool(within.all())

    def contains(self, world: F64) -> npt.NDArray[np.bool_]:
        """Tell which world-space points lie inside.

        Of a mesh by the solid angle under which all its triangles are seen, 4π inside and 0 outside (Van Oosterom &
        Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125); any winding, no direction that could meet an edge.
        """
        points = self.to_object(world)
        if not self.is_mesh:
            return np.asarray(np.linalg.norm(points, axis=1) < abs(self.shape["sphere"]["radius"]))
        result = np.zeros(len(points), np.bool_)
        for index, point in enumerate(points):
            a, b, c = (self.triangles - point).transpose(1, 0, 2)
            la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
            ab, bc, ca = ((u * v).sum(axis=1) for u, v in ((a, b), (b, c), (c, a)))
            triple = (a * np.cross(b, c)).sum(axis=1)
            angle = 2 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb).sum()
            result[index] = abs(angle) > 2 * np.pi
        return result


def _bodies(reading: Reading) -> list[_Body]:
    described = reading.described
    if isinstance(described, StageError):
        return []
    document = described.document
    found = []
    for item, transform in _placed(document, document["root"], np.eye(4)):
        shape = document["shapes"][item["target"]["shape"]]
        material = _solid_material(reading, described, item)
        # What is flattened to nothing is not rendered.
        if material is not None and ("mesh" in shape or "sphere" in shape) and np.linalg.det(transform) != 0.0:
            found.append(_Body(item["path"], shape, described.arrays, transform, material))
    return [body for body in found if np.isfinite(body.points).all() and len(body.points)]


def _placed(document: dict[str, Any], group: int, transform: F64) -> Iterator[tuple[dict[str, Any], F64]]:
    """Return the placed shapes of a group and of those in it, each with its transform to the world."""
    for item in document["groups"][group]["items"]:
        own = np.array(item.get("transform", np.eye(4)), np.float64).reshape(4, 4)
        if "group" in item["target"]:
            yield from _placed(document, item["target"]["group"], own @ transform)
        else:
            yield item, own @ transform


def _solid_material(reading: Reading, described: Description, item: dict[str, Any]) -> CompiledMaterial | None:
    """Return the first material of a placement that has an inside."""
    for index in (item.get("material"), *item.get("subset_materials", ())):
        if index is not None:
            material = reading.materials.get(described.document["materials"][index]["path"])
            if material is not None and material.is_solid:
                return material
    return None


def _meshes(reading: Reading) -> Iterator[tuple[_Body, bool]]:
    """Return the first placement of each mesh of glass, and whether the core finds it closed."""
    seen = set()
    for body in reading.once("bodies", lambda: _bodies(reading)):
        if body.is_mesh and body.shape["mesh"]["path"] not in seen:
            seen.add(body.shape["mesh"]["path"])
            yield body, not any(remark.kind == OPEN_GLASS for remark in _remarks(reading, body))


def _remarks(reading: Reading, body: _Body) -> Any:
    key = f"remarks {body.shape['mesh']['path']}"
    return reading.once(key, lambda: reading.shape_remarks(body.shape, body.arrays))


def closed(reading: Reading) -> Iterator[Finding]:
    """Tell which meshes of glass the core finds open; flat ones are the matter of another validator."""
    for body, is_closed in _meshes(reading):
        if is_closed or body.is_flat:
            continue
        for remark in _remarks(reading, body):
            if remark.kind == OPEN_GLASS:
                yield reading.found("abbe:ClosedGlass", remark.kind, "warning", body.path, remark.message)


def thickness(reading: Reading) -> Iterator[Finding]:
    """Tell of sheets, which have no inside."""
    for body, is_closed in _meshes(reading):
        if body.is_flat or (is_closed and body.is_sheet):
            yield reading.found(
                "abbe:GlassThickness",
                "glass-sheet",
                "warning",
                body.path,
                "is a sheet of glass without thickness, so that light enters it and never leaves: model both sides, or "
                "make the material thin-walled",
            )


def orientation(reading: Reading) -> Iterator[Finding]:
    """Tell of bodies turned inside out, unless they lie in other glass: that is how a bubble is modelled."""
    bodies = reading.once("bodies", lambda: _bodies(reading))
    for body, is_closed in _meshes(reading):
        volume, uncertainty = body.volume
        if is_closed and volume < -uncertainty and not any(_encloses(other, body) for other in bodies):
            yield reading.found(
                "abbe:GlassOrientation",
                "glass-inside-out",
                "warning",
                body.path,
                "its faces look inwards, so that light enters the glass where it should leave it: reverse them, or "
                'author the other orientation ("leftHanded" or "rightHanded")',
            )


def _encloses(outer: _Body, inner: _Body) -> bool:
    (low, high), (inner_low, inner_high) = outer.box, inner.box
    return outer is not inner and bool((low <= inner_low).all() and (inner_high <= high).all())


def overlapping(reading: Reading) -> Iterator[Finding]:
    """Tell of two different glasses in one place with nothing to decide which is there.

    A body within another is fine: the last one entered counts. What is told of is a surface that lies partly inside the
    other body and partly outside. Each pair of shapes and materials is told of once, and of very many bodies only the
    first are looked at.
    """
    bodies = [body for body in reading.once("bodies", lambda: _bodies(reading))[:_BODIES] if not body.is_sheet]
    if len(bodies) < 2:
        return
    low, high = (np.array([body.box[side] for body in bodies]) for side in (0, 1))
    told = set()
    for index, body in enumerate(bodies):
        meets = (low[index] < high[index + 1 :]).all(axis=1) & (low[index + 1 :] < high[index]).all(axis=1)
        for other in (bodies[index + 1 + int(step)] for step in np.flatnonzero(meets)):
            key = frozenset([(id(body.shape), body.material.path), (id(other.shape), other.material.path)])
            if key in told or not _is_undecided(body.material, other.material):
                continue
            if _crosses(body, other) or _crosses(other, body):
                told.add(key)
                yield reading.found(
                    "abbe:OverlappingGlass",
                    "overlapping-glass",
                    "warning",
                    body.path,
                    f"overlaps <{other.path}>, and nothing decides which of <{body.material.path}> and "
                    f"<{other.material.path}> is there: author abbe:dielectricPriority on both (the lower number wins)",
                )


def _is_undecided(one: CompiledMaterial, other: CompiledMaterial) -> bool:
    return one.path != other.path and _priority(one) == _priority(other)


def _priority(material: CompiledMaterial) -> Any:
    """Return the authored priority, ours or that of whatever shader it is; None where there is none."""
    ours = material.authored("abbe:dielectricPriority")
    if ours:
        return ours
    inputs = [item for surface in material.surfaces for item in surface.get("inputs", {}).items()]
    return next((value["value"] for name, value in inputs if "priority" in name.lower() and value["value"]), None)


def _crosses(body: _Body, other: _Body) -> bool:
    """Tell whether some of a body's surface lies inside another and some outside."""
    triangles = len(other.triangles) if other.is_mesh else 1
    count = int(min(_SAMPLES, max(16, _PAIRS / max(triangles, 1))))
    near, is_all = body.surface_within(*other.box)
    inside = other.contains(near[:: max(1, len(near) // count)])
    return bool(inside.any() and not (inside.all() and is_all))
