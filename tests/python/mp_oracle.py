"""One pixel, computed again from the stage file alone: 50 digits, scalar refraction, finite differences.

Nothing here comes from the product. A pixel's chain of surfaces is found in double precision by trying every triangle;
the chain is then traced at 50 digits, at any place of the raster and any wavelength, and everything else follows from
such traces: derivatives are central differences, motions on screen are found by Newton's method. Refraction is Snell's
law with the two sines, not the momentum form of the renderer.

Lengths are in stage units, wavelengths in nm. Raster coordinates are those of pixel vectors: x right, y up, in pixels.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade

MP = mpmath.MPContext()
MP.dps = 50

# Of central differences, in nm or pixels: their errors are some h² and 10^-50/h^k, far below a double's digits.
STEP = MP.mpf(10) ** -14

REFERENCE = MP.mpf("587.5618")
LINE_F, LINE_C = MP.mpf("486.1327"), MP.mpf("656.2725")

# Closer hits than this, relative to the distance travelled, belong to one place: cemented surfaces.
SAME_PLACE = 1e-9

# Sellmeier's coefficients as the maker prints them, of glasses that stages name.
DATA_SHEETS = {
    "SCHOTT:N-BK7": ((1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)),
}

Vector = list[Any]


def vector(values: Any) -> Vector:
    return [MP.mpf(float(value)) for value in values]


def add(a: Vector, b: Vector, scale: Any = 1) -> Vector:
    return [x + scale * y for x, y in zip(a, b, strict=True)]


def minus(a: Vector, b: Vector) -> Vector:
    return add(a, b, -1)


def times(a: Vector, scale: Any) -> Vector:
    return [x * scale for x in a]


def dot(a: Vector, b: Vector) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), MP.mpf(0))


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def length(a: Vector) -> Any:
    return MP.sqrt(dot(a, a))


def unit(a: Vector) -> Vector:
    return times(a, 1 / length(a))


# What is in the stage


@dataclass(frozen=True)
class Glass:
    """Sellmeier's law, n² = 1 + Σ B λ²/(λ² − C) with λ in µm."""

    name: str
    b: tuple[float, ...]
    c: tuple[float, ...]
    priority: int

    def ior(self, wavelength: Any) -> Any:
        square = (wavelength / 1000) ** 2
        terms = (MP.mpf(b) * square / (square - MP.mpf(c)) for b, c in zip(self.b, self.c, strict=True))
        return MP.sqrt(1 + sum(terms, MP.mpf(0)))

    @property
    def abbe_number(self) -> Any:
        return (self.ior(REFERENCE) - 1) / (self.ior(LINE_F) - self.ior(LINE_C))


@dataclass(frozen=True)
class Triangle:
    """A part of a facet; `normals` of its corners if it is shaded smoothly."""

    prim: str
    face: int
    corners: tuple[Vector, Vector, Vector]
    normals: tuple[Vector, Vector, Vector] | None

    def geometric_normal(self, _point: Vector) -> Vector:
        a, b, c = self.corners
        return unit(cross(minus(b, a), minus(c, a)))

    def barycentric(self, point: Vector) -> tuple[Any, Any, Any]:
        a, b, c = self.corners
        area = cross(minus(b, a), minus(c, a))
        weight_b = dot(cross(minus(point, a), minus(c, a)), area) / dot(area, area)
        weight_c = dot(cross(minus(b, a), minus(point, a)), area) / dot(area, area)
        return 1 - weight_b - weight_c, weight_b, weight_c

    def shading_normal(self, point: Vector) -> Vector:
        if self.normals is None:
            return self.geometric_normal(point)
        weights = self.barycentric(point)
        total = [MP.mpf(0)] * 3
        for weight, normal in zip(weights, self.normals, strict=True):
            total = add(total, normal, weight)
        return unit(total)

    def distance(self, origin: Vector, direction: Vector, _far: bool) -> Any:
        normal = self.geometric_normal(origin)
        return dot(minus(self.corners[0], origin), normal) / dot(direction, normal)


@dataclass(frozen=True)
class Ball:
    prim: str
    face = 0
    centre: Vector
    radius: Any

    def geometric_normal(self, point: Vector) -> Vector:
        return unit(minus(point, self.centre))

    shading_normal = geometric_normal

    def distance(self, origin: Vector, direction: Vector, far: bool) -> Any:
        to_centre = minus(self.centre, origin)
        middle = dot(to_centre, direction)
        half = MP.sqrt(self.radius**2 - dot(to_centre, to_centre) + middle**2)
        return middle + half if far else middle - half


@dataclass(frozen=True)
class Step:
    """An event of a chain: on `surface`, from medium `inside` to `outside` (None: vacuum)."""

    surface: Triangle | Ball
    far: bool
    reflects: bool
    before: Glass | None
    after: Glass | None


@dataclass(frozen=True)
class Chain:
    steps: tuple[Step, ...]
    # Where it ends, and whether that is the far side of a ball; None in the environment.
    end: Triangle | Ball | None
    far: bool


@dataclass(frozen=True)
class Trace:
    """A chain traced: where each segment ends, the last direction, and (n_t cosθ_t)² of each event."""

    points: list[Vector]
    direction: Vector
    normal_squares: list[Any]


def ior(glass: Glass | None, wavelength: Any) -> Any:
    return MP.mpf(1) if glass is None else glass.ior(wavelength)


class OtherChain(Exception):
    """Some way off, the ray meets other surfaces: a comparison there would compare different things."""


class Scene:
    """The camera, spheres, meshes and glasses of a stage file."""

    def __init__(self, path: Path, width: int, height: int) -> None:
        self.stage = Usd.Stage.Open(str(path))
        self.width, self.height = width, height
        self.glasses: dict[str, Glass] = {}
        self.triangles: list[Triangle] = []
        self.balls: list[Ball] = []
        for prim in self.stage.Traverse():
            if prim.IsA(UsdGeom.Camera):
                self._camera(UsdGeom.Camera(prim))
            elif prim.IsA(UsdGeom.Mesh):
                self._mesh(UsdGeom.Mesh(prim))
            elif prim.IsA(UsdGeom.Sphere):
                self._sphere(UsdGeom.Sphere(prim))
        self._corners = np.array([[[float(x) for x in v] for v in t.corners] for t in self.triangles])

    def _camera(self, camera: UsdGeom.Camera) -> None:
        matrix = UsdGeom.Xformable(camera).ComputeLocalToWorldTransform(0)
        self.eye = vector(matrix.ExtractTranslation())
        self.right, self.up, back = (vector(Gf.Vec3d(*matrix.GetRow(row)[0:3])) for row in range(3))
        self.axis = unit(times(back, -1))
        focal = MP.mpf(camera.GetFocalLengthAttr().Get())
        aperture = [MP.mpf(a.Get()) for a in (camera.GetHorizontalApertureAttr(), camera.GetVerticalApertureAttr())]
        # Then the aperture needs no fitting, and pixels are square.
        assert abs(aperture[0] * self.height - aperture[1] * self.width) < 1e-6 * self.width
        self.pixel = aperture[0] / self.width / focal

    def _material(self, prim: Usd.Prim) -> None:
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPrim()
        ours = UsdShade.Material(material).ComputeSurfaceSource("abbe")[0].GetPrim()
        where, prefix = (ours, "inputs:") if ours.GetAttribute("info:id").Get() == "AbbeGlass" else (material, "")

        def authored(name: str) -> Any:
            return where.GetAttribute(f"{prefix}abbe:{name}").Get()

        named = authored("glass")
        if not named and not authored("dispersion:law"):
            return
        if named:
            b, c = DATA_SHEETS[named]
        else:
            assert authored("dispersion:law") == "sellmeier"
            b, c = (tuple(authored(f"dispersion:sellmeier:{name}")) for name in "bc")
        priority = authored("dielectricPriority")
        self.glasses[str(prim.GetPath())] = Glass(material.GetName(), b, c, priority)

    def _mesh(self, mesh: UsdGeom.Mesh) -> None:
        self._material(mesh.GetPrim())
        assert mesh.GetOrientationAttr().Get() == "rightHanded"
        matrix = UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(0)
        assert matrix.GetDeterminant() > 0
        rows = [vector(matrix.GetRow(row)[0:3]) for row in range(4)]

        def world(point: Any) -> Vector:
            x, y, z = vector(point)
            return add(add(add(rows[3], rows[0], x), rows[1], y), rows[2], z)

        points = [world(point) for point in mesh.GetPointsAttr().Get()]
        normals = [vector(normal) for normal in mesh.GetNormalsAttr().Get() or []]
        assert not normals or (mesh.GetNormalsInterpolation() == "vertex" and matrix == Gf.Matrix4d(1))
        indices, first = mesh.GetFaceVertexIndicesAttr().Get(), 0
        for number, count in enumerate(mesh.GetFaceVertexCountsAttr().Get()):
            face = list(indices[first : first + count])
            first += count
            for corner in range(1, count - 1):
                ids = (face[0], face[corner], face[corner + 1])
                a, b, c = (points[i] for i in ids)
                smooth = tuple(normals[i] for i in ids) if normals else None
                self.triangles.append(Triangle(str(mesh.GetPath()), number, (a, b, c), smooth))  # type: ignore[arg-type]

    def _sphere(self, sphere: UsdGeom.Sphere) -> None:
        self._material(sphere.GetPrim())
        matrix = UsdGeom.Xformable(sphere).ComputeLocalToWorldTransform(0)
        assert matrix == Gf.Matrix4d().SetTranslate(matrix.ExtractTranslation())
        centre, radius = vector(matrix.ExtractTranslation()), MP.mpf(sphere.GetRadiusAttr().Get())
        self.balls.append(Ball(str(sphere.GetPath()), centre, radius))

    # Tracing

    def camera_direction(self, x: Any, y: Any) -> Vector:
        """Of the ray through raster coordinates from the image's lower left corner."""
        across = (x - MP.mpf(self.width) / 2) * self.pixel
        upward = (y - MP.mpf(self.height) / 2) * self.pixel
        return unit(add(add(self.axis, self.right, across), self.up, upward))

    def depth(self, point: Vector) -> Any:
        return dot(minus(point, self.eye), self.axis)

    def _hits(self, origin: Vector, direction: Vector, left: list[Any]) -> list[tuple[float, Any, bool]]:
        """Nearest hits in double precision, all that are at one place; never those on the surfaces `left`."""
        o, d = (np.array([float(x) for x in v]) for v in (origin, direction))
        a = self._corners[:, 0]
        e1, e2 = self._corners[:, 1] - a, self._corners[:, 2] - a
        across = np.cross(d, e2)
        det = np.einsum("ij,ij->i", e1, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", o - a, across) / det
            turned = np.cross(o - a, e1)
            v = turned @ d / det
            t = np.einsum("ij,ij->i", e2, turned) / det
            # Rays in a triangle's plane have no t: comparisons with NaN are false.
            met = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0))
        found = [
            (float(t[i]), self.triangles[i], False)
            for i in met
            if not any(self.triangles[i] is surface for surface in left)
        ]
        for ball in self.balls:
            to_centre = o - np.array([float(x) for x in ball.centre])
            middle = -to_centre @ d
            square = middle**2 - to_centre @ to_centre + float(ball.radius) ** 2
            if square > 0:
                near, far = middle - square**0.5, middle + square**0.5
                if near > 0 and ball not in left:
                    found.append((near, ball, False))
                # From a point on the ball itself the near root is 0.
                if far > SAME_PLACE:
                    found.append((far, ball, True))
        found.sort(key=lambda hit: hit[0])
        return [hit for hit in found if hit[0] - found[0][0] <= SAME_PLACE * max(1.0, found[0][0])]

    def chain(self, x: Any, y: Any, wavelength: Any = REFERENCE) -> Chain:
        """What the ray there meets."""
        origin, direction = self.eye, self.camera_direction(x, y)
        inside: dict[str, Glass] = {}
        steps: list[Step] = []
        left: list[Any] = []

        def current(media: dict[str, Glass]) -> Glass | None:
            return min(media.values(), key=lambda glass: glass.priority, default=None)

        while len(steps) < 64:
            hits = self._hits(origin, direction, left)
            if not hits:
                return Chain(tuple(steps), None, False)
            left = []
            point = origin
            # Where surfaces are cemented, the next medium is entered before the last is left.
            hits.sort(key=lambda hit: float(dot(hit[1].geometric_normal(self._at(origin, direction, hit)), direction)))
            start, start_direction = origin, direction
            for hit in hits:
                _, surface, far = hit
                left.append(surface)
                point = self._at(start, start_direction, hit)
                if surface.prim not in self.glasses:
                    return Chain(tuple(steps), surface, far)
                entering = dot(surface.geometric_normal(point), start_direction) < 0
                then = dict(inside)
                if entering:
                    then[surface.prim] = self.glasses[surface.prim]
                else:
                    del then[surface.prim]
                before, after = current(inside), current(then)
                if before is after:
                    inside = then
                    continue
                direction, square = snell(direction, surface.shading_normal(point), before, after, wavelength)
                steps.append(Step(surface, far, square <= 0, before, after))
                if square <= 0:
                    break
                inside = then
            origin = point
        raise AssertionError("a chain of more than 64 events")

    @staticmethod
    def _at(origin: Vector, direction: Vector, hit: tuple[float, Any, bool]) -> Vector:
        return add(origin, direction, hit[1].distance(origin, direction, hit[2]))

    def follow(self, chain: Chain, x: Any, y: Any, wavelength: Any) -> Trace:
        """Trace a known chain, its planes without borders."""
        point, direction = self.eye, self.camera_direction(x, y)
        points, squares = [], []
        for step in chain.steps:
            point = add(point, direction, step.surface.distance(point, direction, step.far))
            points.append(point)
            normal = step.surface.shading_normal(point)
            direction, square = snell(direction, normal, step.before, step.after, wavelength)
            if (square <= 0) != step.reflects:
                raise OtherChain
            squares.append(square)
        if chain.end is not None:
            point = add(point, direction, chain.end.distance(point, direction, chain.far))
            points.append(point)
        return Trace(points, direction, squares)


def snell(
    direction: Vector, normal: Vector, before: Glass | None, after: Glass | None, wavelength: Any
) -> tuple[Vector, Any]:
    """The direction behind an interface, and (n_t cosθ_t)²; not above 0 where reflection is total."""
    if dot(direction, normal) > 0:
        normal = times(normal, -1)
    n_before, n_after = ior(before, wavelength), ior(after, wavelength)
    tangent = add(direction, normal, -dot(direction, normal))
    # n_i sinθ_i = n_t sinθ_t
    refracted = times(tangent, n_before / n_after)
    cosine_square = 1 - dot(refracted, refracted)
    if cosine_square <= 0:
        return add(direction, normal, -2 * dot(direction, normal)), n_after**2 * cosine_square
    return add(refracted, normal, -MP.sqrt(cosine_square)), n_after**2 * cosine_square


# What follows from traces


class Pixel:
    """All AOVs of one pixel's centre; `column` and `row` count from the upper left as in the file."""

    def __init__(self, scene: Scene, column: int, row: int) -> None:
        self.scene = scene
        self.x = MP.mpf(column) + MP.mpf(1) / 2
        self.y = scene.height - MP.mpf(row) - MP.mpf(1) / 2
        self.chain = scene.chain(self.x, self.y)
        self.at_reference = self.trace()

    def trace(self, dx: Any = 0, dy: Any = 0, wavelength: Any = REFERENCE, chain: Chain | None = None) -> Trace:
        return self.scene.follow(chain or self.chain, self.x + dx, self.y + dy, wavelength)

    def _elsewhere(self, dx: Any, dy: Any, wavelength: Any) -> Chain:
        """The chain some way off: it has to meet the same facets of glass and end on the same prim."""
        chain = self.scene.chain(self.x + dx, self.y + dy, wavelength)
        here, there = (
            ([(step.surface.prim, step.surface.face, step.reflects) for step in c.steps], c.end and c.end.prim)
            for c in (self.chain, chain)
        )
        if here != there:
            raise OtherChain
        return chain

    def seen(self, trace: Trace) -> Vector:
        """The end point, or the direction where the chain ends in the environment."""
        return trace.points[-1] if self.chain.end is not None else trace.direction

    @functools.cached_property
    def _beside(self) -> tuple[Trace, Trace]:
        return self.trace(wavelength=REFERENCE - STEP), self.trace(wavelength=REFERENCE + STEP)

    def _first(self, value: Any) -> Any:
        low, high = (value(trace) for trace in self._beside)
        return times(minus(high, low), 1 / (2 * STEP))

    def _second(self, value: Any) -> Any:
        low, high = (value(trace) for trace in self._beside)
        return times(add(add(high, low), value(self.at_reference), -2), 1 / STEP**2)

    @property
    def direction_by_wavelength(self) -> Vector:
        return self._first(lambda trace: trace.direction)

    @property
    def position_by_wavelength(self) -> Vector:
        return self._first(lambda trace: trace.points[-1])

    @property
    def half_width(self) -> Any:
        """The least of half the band, 2·0.05|p_λ|/|p_λλ|, and |W²/(W²)′| of every interface."""
        first, second = length(self._first(self.seen)), length(self._second(self.seen))
        widths = [MP.mpf(150), 2 * MP.mpf("0.05") * first / second]
        rates = self._first(lambda trace: trace.normal_squares)
        pairs = zip(self.at_reference.normal_squares, rates, strict=True)
        widths += [abs(square / rate) for square, rate in pairs if rate != 0]
        return min(widths)

    def find(self, target: Vector, wavelength: Any, chain: Chain | None = None) -> tuple[Any, Any]:
        """How far from this pixel `target` is seen at `wavelength`: Newton's method on the two equations that do not
        fix the surface itself."""
        dx = dy = MP.mpf(0)
        chain = chain or self.chain
        # Two directions across the one the surface leaves free: its normal, or the direction itself.
        free = target if chain.end is None else chain.end.geometric_normal(target)
        side = unit(
            cross(free, [MP.mpf(0), MP.mpf(1), MP.mpf(0)] if abs(free[0]) > 0.6 else [MP.mpf(1), MP.mpf(0), MP.mpf(0)])
        )
        axes = (side, cross(unit(free), side))

        def at(dx: Any, dy: Any) -> list[Any]:
            off = minus(self.seen(self.trace(dx, dy, wavelength, chain)), target)
            return [dot(off, axis) for axis in axes]

        for _ in range(60):
            off = at(dx, dy)
            by_x = times(minus(at(dx + STEP, dy), off), 1 / STEP)
            by_y = times(minus(at(dx, dy + STEP), off), 1 / STEP)
            det = by_x[0] * by_y[1] - by_x[1] * by_y[0]
            move_x = -(off[0] * by_y[1] - off[1] * by_y[0]) / det
            move_y = -(by_x[0] * off[1] - by_x[1] * off[0]) / det
            dx, dy = dx + move_x, dy + move_y
            # The slopes are known to 14 digits: the step after one this small is below 10^-44.
            if abs(move_x) + abs(move_y) < MP.mpf(10) ** -32:
                return dx, dy
        raise AssertionError("Newton's method did not converge")

    @functools.cached_property
    def _motion(self) -> tuple[Vector, Vector]:
        step = MP.mpf(10) ** -9
        target = self.seen(self.at_reference)
        low, high = (list(self.find(target, REFERENCE + sign * step)) for sign in (-1, 1))
        return times(minus(high, low), 1 / (2 * step)), times(add(high, low), 1 / step**2)

    @property
    def dispersion(self) -> Vector:
        return self._motion[0]

    @property
    def dispersion2(self) -> Vector:
        return self._motion[1]

    def fetch_offset(self, wavelength: Any) -> Vector:
        """Where the image at the reference shows what is seen here at `wavelength`."""
        there = self._elsewhere(MP.mpf(0), MP.mpf(0), wavelength)
        target = self.seen(self.trace(wavelength=wavelength, chain=there))
        # Once more by the triangles that are met there: a facet's are coplanar only to the digits of the stage file.
        near = self.find(target, REFERENCE)
        return list(self.find(target, REFERENCE, self._elsewhere(*near, REFERENCE)))
