"""The sample stages: reproduced by their script, valid USD without the plug-in, and the optics they claim."""

import functools
import importlib.util
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdRender, UsdShade, UsdValidation

import abbe

ROOT = Path(__file__).resolve().parents[2]
STAGES = ROOT / "stages"
NAMES = ["prism", "ball", "lens", "gem"]
D, F, C = 0.5875618, 0.4861327, 0.6562725


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    specification = importlib.util.spec_from_file_location("abbe_stages_generate", STAGES / "generate.py")
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@functools.cache
def opened(name: str) -> Any:
    # Kept, since prims do not keep their stage alive.
    return Usd.Stage.Open(str(STAGES / f"{name}.usda"))


def faces_of(mesh: Any) -> list[tuple[int, ...]]:
    counts, indices = mesh.GetFaceVertexCountsAttr().Get(), list(mesh.GetFaceVertexIndicesAttr().Get())
    ends = np.cumsum(counts)
    return [tuple(indices[end - count : end]) for end, count in zip(ends, counts, strict=True)]


def world_points(mesh: Any) -> np.ndarray:
    points = np.asarray(mesh.GetPointsAttr().Get(), dtype=np.float64)
    matrix = np.asarray(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return points @ matrix[:3, :3] + matrix[3, :3]


def glass_meshes(stage: Any) -> list[Any]:
    found = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            where, prefix = places(material.GetPrim())
            if where.HasAttribute(f"{prefix}abbe:dielectricPriority"):
                found.append(UsdGeom.Mesh(prim))
    return found


def places(material: Any) -> tuple[Any, str]:
    """The prim on which a material's law stands, and what precedes the names there."""
    ours = UsdShade.Material(material).ComputeSurfaceSource("abbe")[0].GetPrim()
    return (ours, "inputs:") if ours.GetAttribute("info:id").Get() == "AbbeGlass" else (material, "")


def ior_of(material: Any, micrometers: float) -> float:
    prim, prefix = places(material)
    named = prim.GetAttribute(f"{prefix}abbe:glass").Get()
    if named:
        return float(abbe.glass(named).ior(1000 * micrometers))
    b, c = (np.asarray(prim.GetAttribute(f"{prefix}abbe:dispersion:sellmeier:{name}").Get()) for name in "bc")
    return math.sqrt(1 + float(np.sum(b * micrometers**2 / (micrometers**2 - c))))


def refract(direction: np.ndarray, normal: np.ndarray, ior_i: float, ior_t: float) -> np.ndarray | None:
    """Snell's law for a unit direction and a unit normal against it; None where reflection is total."""
    cosine = float(direction @ normal)
    square = ior_t**2 - ior_i**2 + (ior_i * cosine) ** 2
    if square <= 0:
        return None
    return np.asarray((ior_i * direction - (ior_i * cosine + math.sqrt(square)) * normal) / ior_t)


def through_convex(
    planes: list[tuple[np.ndarray, float]], origin: np.ndarray, direction: np.ndarray, ior: float
) -> Any:
    """Where a ray leaves a convex glass body, and its total reflections; None where it misses or stays inside."""
    near, far, entered = -math.inf, math.inf, None
    for normal, distance in planes:
        slope, height = float(normal @ direction), distance - float(normal @ origin)
        if slope < 0 and height / slope > near:
            near, entered = height / slope, normal
        elif slope > 0:
            far = min(far, height / slope)
    if entered is None or near >= far:
        return None
    origin = origin + near * direction
    direction = refract(direction, entered, 1.0, ior)
    for reflections in range(63):
        steps = [
            ((distance - normal @ origin) / (normal @ direction), normal)
            for normal, distance in planes
            if normal @ direction > 1e-12 * ior and normal is not entered
        ]
        step, entered = min(steps, key=lambda item: item[0])
        origin = origin + step * direction
        leaving = refract(direction, -entered, ior, 1.0)
        if leaving is not None:
            return origin, leaving, reflections
        direction = direction - 2 * (direction @ entered) * entered
    return None


def planes_of(mesh: Any) -> list[tuple[np.ndarray, float]]:
    points = world_points(mesh)
    planes = []
    for face in faces_of(mesh):
        corners = points[list(face)]
        # Newell's normal: the best one for a polygon of rounded corners.
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal)
        planes.append((normal, float(np.mean(corners @ normal))))
    return planes


def test_generator_reproduces_the_committed_stages(generate: ModuleType, tmp_path: Path) -> None:
    generate.main(tmp_path)
    for name in NAMES:
        made, committed = (folder / f"{name}.usda" for folder in (tmp_path, STAGES))
        assert made.read_bytes() == committed.read_bytes(), f"{name}: run python stages/generate.py"


@pytest.mark.parametrize("name", NAMES)
def test_stage_is_complete(name: str) -> None:
    stage = opened(name)
    layer = stage.GetRootLayer()
    assert stage.GetDefaultPrim() and layer.documentation
    assert UsdGeom.StageHasAuthoredMetersPerUnit(stage) and UsdGeom.GetStageUpAxis(stage) == "Y"
    assert (STAGES / f"{name}.usda").stat().st_size < 300_000
    assert any(prim.HasAPI("LightAPI") for prim in stage.Traverse())

    settings = UsdRender.Settings.GetStageRenderSettings(stage)
    assert settings.GetPrim().GetAttribute("abbe:integrator").Get() == "differentials"
    (camera,) = settings.GetCameraRel().GetForwardedTargets()
    assert stage.GetPrimAtPath(camera).IsA(UsdGeom.Camera)
    (target,) = settings.GetProductsRel().GetForwardedTargets()
    product = UsdRender.Product(stage.GetPrimAtPath(target))
    assert product.GetProductNameAttr().Get() == f"{name}.exr"

    table = (ROOT / "src" / "film" / "aov.rs").read_text(encoding="utf-8")
    known = set(re.findall(r'(?:mean|first)\(\s*"(\w+)"', table))
    variables = [UsdRender.Var(stage.GetPrimAtPath(path)) for path in product.GetOrderedVarsRel().GetForwardedTargets()]
    names = [variable.GetSourceNameAttr().Get() for variable in variables]
    assert len(set(names)) == len(names) and set(names) <= known
    derivatives = {aov for aov in known if "dispersion" in aov or "dlambda" in aov or "footprint" in aov}
    assert derivatives and derivatives <= set(names)
    for variable, aov in zip(variables, names, strict=True):
        prim = variable.GetPrim()
        assert prim.GetAttribute("driver:parameters:aov:name").Get() == aov
        assert prim.GetAttribute("driver:parameters:aov:format").Get()


def validation_errors(stage: Any) -> list[str]:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


@pytest.mark.parametrize("name", NAMES)
def test_every_validator_of_usd_is_content(name: str) -> None:
    assert len(UsdValidation.ValidationRegistry().GetOrLoadAllValidators()) >= 30
    assert validation_errors(opened(name)) == []


def test_stages_open_and_validate_with_and_without_the_plug_in() -> None:
    # What is applied is known only with the plug-in; nothing else may differ, and nothing may be printed.
    probe = (
        "import sys; from pxr import Usd, UsdValidation\n"
        "validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()\n"
        "for path in sys.argv[2:]:\n"
        "    stage = Usd.Stage.Open(path)\n"
        "    errors = UsdValidation.ValidationContext(validators).Validate(stage)\n"
        # A shader of one renderer is unknown to USD without that renderer, as everybody's is.
        "    assert all(\"shaderId 'AbbeGlass'\" in error.GetMessage() for error in errors), path\n"
        "    assert len(errors) == ('gem' in path), path\n"
        "    settings = stage.GetPrimAtPath('/Render/Settings')\n"
        "    assert ('AbbeRenderSettingsAPI' in settings.GetAppliedSchemas()) == (sys.argv[1] == 'with'), path\n"
        "    assert (settings.GetAttribute('abbe:scalarIor').Get() == 'constant') == (sys.argv[1] == 'with'), path\n"
    )
    for way in ("with", "without"):
        environment = {key: value for key, value in os.environ.items() if key != "PXR_PLUGINPATH_NAME"}
        if way == "with":
            environment["PXR_PLUGINPATH_NAME"] = str(ROOT / "plugin")
        paths = [str(STAGES / f"{name}.usda") for name in NAMES]
        command = [sys.executable, "-c", probe, way, *paths]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert result.returncode == 0 and not result.stdout and not result.stderr, result.stderr


@pytest.mark.parametrize(("name", "count"), [("prism", 1), ("lens", 2), ("gem", 1)])
def test_glass_meshes_are_closed_and_face_outwards(name: str, count: int) -> None:
    meshes = glass_meshes(opened(name))
    assert len(meshes) == count
    for mesh in meshes:
        faces = faces_of(mesh)
        edges = [edge for face in faces for edge in zip(face, face[1:] + face[:1], strict=True)]
        directed = set(edges)
        assert len(directed) == len(edges) and all((b, a) in directed for a, b in edges)
        points = np.asarray(mesh.GetPointsAttr().Get(), dtype=np.float64)
        assert len(points) - len(edges) // 2 + len(faces) == 2
        volume = sum(
            float(points[face[0]] @ np.cross(points[face[k]], points[face[k + 1]]))
            for face in faces
            for k in range(1, len(face) - 1)
        )
        assert volume > 0
        assert mesh.GetSubdivisionSchemeAttr().Get() == "none"


@pytest.mark.parametrize(
    ("stage", "material", "nd", "vd"),
    [
        # Data sheets of SCHOTT; diamond: n_d and V_d of Peter's formula.
        ("prism", "SF11", 1.78472, 25.76),
        ("ball", "NBK7", 1.51680, 64.17),
        ("lens", "NBK7", 1.51680, 64.17),
        ("lens", "SF5", 1.67270, 32.21),
        ("gem", "Diamond", 2.41749, 55.30),
    ],
)
def test_glasses_have_their_catalogue_index_and_abbe_number(stage: str, material: str, nd: float, vd: float) -> None:
    prim = opened(stage).GetPrimAtPath(f"/World/Looks/{material}")
    index = {line: ior_of(prim, line) for line in (D, F, C)}
    assert index[D] == pytest.approx(nd, abs=5.1e-6)
    assert (index[D] - 1) / (index[F] - index[C]) == pytest.approx(vd, abs=5.1e-3)
    shader = UsdShade.Material(prim).ComputeSurfaceSource()[0]
    assert shader.GetInput("ior").Get() == pytest.approx(index[D], abs=1e-6)


def test_prism_stands_at_minimum_deviation_and_shows_the_target() -> None:
    stage = opened("prism")
    ior = ior_of(stage.GetPrimAtPath("/World/Looks/SF11"), D)
    planes = planes_of(UsdGeom.Mesh(stage.GetPrimAtPath("/World/Prism")))
    expected = 2 * math.asin(ior / 2) - math.radians(60)

    def leave(angle: float) -> tuple[np.ndarray, float, int]:
        direction = np.array([math.sin(angle), 0.0, -math.cos(angle)])
        found = through_convex(planes, -40.0 * direction, direction, ior)
        assert found is not None
        origin, leaving, reflections = found
        return origin, math.acos(float(leaving @ direction)), reflections

    # The same point of the entry face is aimed at from all angles: the origin.
    origin, deviation, reflections = leave(0.0)
    assert reflections == 0 and deviation == pytest.approx(expected, abs=1e-6)
    assert all(leave(angle)[1] > deviation for angle in (-0.02, -0.005, 0.005, 0.02))

    target = world_points(UsdGeom.Mesh(stage.GetPrimAtPath("/World/Target")))
    leaving = np.array([math.sin(deviation), 0.0, -math.cos(deviation)])
    center = target.mean(axis=0)
    assert np.linalg.norm(np.cross(center - origin, leaving)) < 3.0


def test_ball_is_an_analytic_sphere_on_the_floor() -> None:
    sphere = UsdGeom.Sphere(opened("ball").GetPrimAtPath("/World/Ball"))
    assert sphere.GetRadiusAttr().Get() == 3.0
    assert UsdGeom.XformCommonAPI(sphere).GetXformVectors(Usd.TimeCode.Default())[0] == (0, 3, 0)


def paraxial_focus(generate: ModuleType, micrometers: float) -> tuple[float, float]:
    """Focal length and back focal length of the doublet, by y and n·u from surface to surface."""
    media = [*(generate.ior(glass, micrometers) for glass in generate.LENS_GLASSES), 1.0]
    height, momentum, before = 1.0, 0.0, 1.0
    for radius, after, thickness in zip(generate.LENS_RADII, media, (*generate.LENS_THICKNESSES, 0.0), strict=True):
        momentum -= height * (after - before) / radius
        height += momentum / after * thickness
        before = after
    return -1 / momentum, -height / momentum


def test_lens_is_an_achromat_of_a_hundred_millimetres(generate: ModuleType) -> None:
    focus = {line: paraxial_focus(generate, line)[0] for line in (D, F, C)}
    assert focus[D] == pytest.approx(100.0, abs=0.1)
    # A single lens of the crown glass would spread f / V = 1.56 mm between F and C; the doublet has a twelfth of it.
    assert abs(focus[F] - focus[C]) < focus[D] / 64.17 / 10
    # The maker's own back focal length at the d line is 97.1 mm.
    assert paraxial_focus(generate, D)[1] == pytest.approx(97.1, abs=0.1)


def test_lens_meshes_lie_on_the_prescription(generate: ModuleType) -> None:
    stage = opened("lens")
    vertices = np.cumsum((0.0, *generate.LENS_THICKNESSES))
    interface: list[set[bytes]] = []
    for name, first in (("Crown", 0), ("Flint", 1)):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}"))
        points = world_points(mesh)
        normals = np.asarray(mesh.GetNormalsAttr().Get(), dtype=np.float64)
        assert mesh.GetNormalsInterpolation() == "vertex"
        assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=2e-6)
        height = np.hypot(points[:, 0], points[:, 1])
        count = 1 + 3 * generate.LENS_RINGS * (generate.LENS_RINGS + 1)
        for surface, chosen, outward in ((first, slice(0, count), 1.0), (first + 1, slice(count, 2 * count), -1.0)):
            center = np.array([0.0, 0.0, -(vertices[surface] + generate.LENS_RADII[surface])])
            radial = points[chosen] - center
            # Points are printed to 1e-4 mm, normals to 1e-6.
            assert np.allclose(np.linalg.norm(radial, axis=1), abs(generate.LENS_RADII[surface]), atol=1e-4)
            radial /= np.linalg.norm(radial, axis=1)[:, None]
            radial *= np.sign(radial[:, 2])[:, None] * outward
            assert np.allclose(normals[chosen], radial, atol=5e-6)
            if surface == 1:
                interface.append({row.tobytes() for row in np.asarray(mesh.GetPointsAttr().Get())[chosen]})
        assert height.max() == pytest.approx(generate.LENS_RIM, abs=1e-4)
        # Every triangle is seen from the side of its normals.
        for face in faces_of(mesh):
            a, b, c = (points[i] for i in face)
            assert all(np.cross(b - a, c - a) @ normals[i] > 0 for i in face)
    assert interface[0] == interface[1]
    priorities = [
        stage.GetPrimAtPath(f"/World/Looks/{name}").GetAttribute("abbe:dielectricPriority").Get()
        for name in ("NBK7", "SF5")
    ]
    assert len(set(priorities)) == 2 and min(priorities) > 0


def test_lens_triangulates_the_cemented_surface_alike_on_both_sides() -> None:
    stage = opened("lens")
    corners = []
    for name in ("Crown", "Flint"):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}"))
        points = np.asarray(mesh.GetPointsAttr().Get())
        corners.append({frozenset(points[i].tobytes() for i in face) for face in faces_of(mesh)})
    rings = 14
    assert len(corners[0] & corners[1]) == 6 * rings**2


def test_gem_is_a_brilliant(generate: ModuleType) -> None:
    mesh = UsdGeom.Mesh(opened("gem").GetPrimAtPath("/World/Gem"))
    points = np.asarray(mesh.GetPointsAttr().Get(), dtype=np.float64)
    faces = faces_of(mesh)
    assert len(faces) == 57 + generate.GEM_GIRDLE_SIDES
    angles, kinds = [], [kind for kind, _ in generate.brilliant()]
    for face in faces:
        corners = points[list(face)]
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal)
        # Flat and convex up to the print of 1e-6 mm.
        assert np.ptp(corners @ normal) < 2e-6
        assert (points @ normal).max() < (corners @ normal).mean() + 2e-6
        angles.append(math.degrees(math.acos(min(1.0, abs(normal[1])))))
    by_kind = {
        kind: {round(angle, 2) for angle, name in zip(angles, kinds, strict=True) if name == kind} for kind in kinds
    }
    assert by_kind["table"] == {0.0} and by_kind["girdle"] == {90.0}
    assert by_kind["bezel"] == {34.5} and by_kind["main"] == {40.75}
    assert all(20 < angle < 23 for angle in by_kind["star"])
    assert all(40.5 < angle < 43 for angle in by_kind["upper half"] | by_kind["lower half"])
    # Proportions of the girdle's diameter.
    radius = np.hypot(points[:, 0], points[:, 2]).max()
    assert 2 * radius == pytest.approx(6.5, abs=1e-5)
    table = points[np.isclose(points[:, 1], points[:, 1].max(), atol=1e-6)]
    assert len(table) == 8 and np.allclose(np.hypot(table[:, 0], table[:, 2]) / radius, 0.57, atol=1e-5)
    assert np.ptp(points[:, 1]) / (2 * radius) == pytest.approx(0.6146, abs=1e-3)


def test_gem_returns_the_light_of_its_face_after_total_reflection() -> None:
    stage = opened("gem")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Gem"))
    ior = ior_of(stage.GetPrimAtPath("/World/Looks/Diamond"), D)
    planes, points = planes_of(mesh), world_points(mesh)
    camera = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Camera"))
    eye = np.asarray(camera.ComputeLocalToWorldTransform(Usd.TimeCode.Default()))[3, :3]
    random = np.random.default_rng(0)
    weights = random.dirichlet(np.ones(len(points)), 400)
    found = []
    for aim in weights @ points:
        direction = (aim - eye) / np.linalg.norm(aim - eye)
        found.append(through_convex(planes, eye, direction, ior))
    # Aims lie inside, so every ray enters; the tent and the floor stand all around, so what leaves hits something.
    left = [item for item in found if item is not None]
    assert len(left) >= 0.97 * len(found)
    assert sum(item[2] >= 2 for item in left) > 0.6 * len(left)


def test_the_cemented_doublet_has_three_interfaces_and_fetch_offsets_everywhere() -> None:
    names = ["interfaces", "dispersion_r", "dispersion_g", "dispersion_b"]
    film = abbe.render(STAGES / "lens.usda", width=160, aovs=names)
    glass = film["interfaces"][..., 0] > 0
    assert np.unique(film["interfaces"][glass]).tolist() == [3]
    for name in names[1:]:
        assert film.valid(name)[glass].mean() > 0.99, name
