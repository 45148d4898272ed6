"""Validators: each is silent on what is sound, and names prim, property and remedy of what is not."""

import itertools
import json
import os
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

pytest.importorskip("pxr.Usd", reason="validators look at USD stages")

from pxr import Usd

import abbe
from abbe.errors import StageError, UsageError
from abbe.validators import VALIDATORS, Finding, validate

ROOT = Path(__file__).resolve().parents[2]
NAMES = [validator.name for validator in VALIDATORS]

CAMERA = 'def Camera "Camera" {\nfloat focalLength = 35\n}\n'
CORNERS = list(itertools.product((-1.0, 1.0), repeat=3))
# Of the unit cube, seen from outside, against the clock.
CUBE = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def mesh(
    name: str, faces=CUBE, points=CORNERS, look: str = "Glass", size=1.0, at=(0.0, 0.0, 0.0), more: str = ""
) -> str:
    """A polygon mesh, scaled and moved by its points."""
    size = (size,) * 3 if isinstance(size, float) else size
    moved = [tuple(s * x + t for s, x, t in zip(size, point, at, strict=True)) for point in points]
    return f"""def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = {[len(face) for face in faces]}
        int[] faceVertexIndices = {[index for face in faces for index in face]}
        point3f[] points = {moved}
        rel material:binding = </World/{look}>
        {more}
    }}
    """


def sphere(name: str, radius: float, at=(0.0, 0.0, 0.0), look: str = "Glass") -> str:
    return f"""def Sphere "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        double radius = {radius}
        rel material:binding = </World/{look}>
        double3 xformOp:translate = {at}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    """


def material(name: str = "Glass", ours: str = "", shader: str = "", opacity: float = 0) -> str:
    return f"""def Material "{name}" (prepend apiSchemas = ["AbbeDispersionAPI"])
    {{
        {ours}
        token outputs:surface.connect = </World/{name}/Surface.outputs:surface>
        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            float inputs:opacity = {opacity}
            float inputs:roughness = 0
            {shader}
            token outputs:surface
        }}
    }}
    """


@pytest.fixture
def stage(tmp_path: Path) -> Callable[..., Path]:
    """Write a stage: what stands in /World, after it, and in the metadata; a camera unless told otherwise."""

    def write(*world: str, after: str = "", metadata: str = "metersPerUnit = 1", camera: bool = True) -> Path:
        path = tmp_path / "stage.usda"
        body = "".join((CAMERA if camera else "", *world))
        path.write_text(
            f'#usda 1.0\n(\n    defaultPrim = "World"\n    {metadata}\n    upAxis = "Y"\n)\n'
            f'def Xform "World"\n{{\n{body}}}\n{after}',
            encoding="utf-8",
        )
        return path

    return write


def only(path: Path, validator: str) -> Finding:
    """The one finding of the stage, checked to come from that validator."""
    findings = validate(path)
    assert [finding.validator for finding in findings] == [validator], list(map(str, findings))
    return findings[0]


def check(finding: Finding, severity: str, path: str, *words: str) -> None:
    assert (finding.severity, finding.path) == (severity, path), finding
    assert str(finding).startswith(f"{finding.place}: ")
    for word in words:
        assert word in finding.message, finding


def test_names_are_those_of_usd_and_docs_are_sentences() -> None:
    assert len(set(NAMES)) == len(NAMES)
    for validator in VALIDATORS:
        assert validator.name.startswith("abbe:") and validator.doc.endswith(".")


@pytest.mark.parametrize("path", sorted((ROOT / "stages").glob("*.usda")), ids=lambda path: path.stem)
def test_sample_stages_are_clean(path: Path) -> None:
    assert validate(path) == []


def test_a_sound_stage_is_silent(stage: Callable[..., Path]) -> None:
    assert validate(stage(mesh("Cube"), material())) == []


# Materials


@pytest.mark.parametrize(
    ("ours", "shader", "severity", "path", "words"),
    [
        ("double abbe:dispersion:nd = 1.5\ndouble abbe:dispersion:vd = -3", "", "error", ".abbe:dispersion:vd", "-3"),
        ("", "float inputs:ior = 0", "error", "/Surface.inputs:ior", "0"),
        ("double abbe:dispersion:nd = inf", "", "error", ".abbe:dispersion:nd", "inf"),
        # A pole at 0.5 µm, in the middle of the visible.
        (
            "uniform double[] abbe:dispersion:sellmeier:b = [1]\nuniform double[] abbe:dispersion:sellmeier:c = [0.25]",
            "",
            "error",
            ".abbe:dispersion:sellmeier",
            "pole",
        ),
        (
            "uniform double[] abbe:dispersion:cauchy = [1.5, 0.004]\ndouble abbe:dispersion:vd = 60",
            "",
            "warning",
            ".abbe:dispersion:law",
            "author the law",
        ),
    ],
)
def test_impossible_dispersion(
    stage: Callable[..., Path], ours: str, shader: str, severity: str, path: str, words: str
) -> None:
    finding = only(stage(mesh("Cube"), material(ours=ours, shader=shader)), "abbe:Dispersion")
    assert finding.path.startswith(f"/World/Glass{path}"), finding
    check(finding, severity, finding.path, words)


def test_possible_dispersion_is_silent(stage: Callable[..., Path]) -> None:
    ours = "uniform double[] abbe:dispersion:cauchy = [1.5, 0.004]"
    assert validate(stage(mesh("Cube"), material(ours=ours))) == []


def test_textures_matter_on_glass_alone(stage: Callable[..., Path]) -> None:
    texture = """def Material "Paint" {
        token outputs:surface.connect = </World/Paint/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:%s.connect = </World/Paint/T.outputs:r>
            float inputs:opacity = %d
            token outputs:surface
        }
        def Shader "T" {
            uniform token info:id = "UsdUVTexture"
            float outputs:r
        }
    }
    """
    assert validate(stage(mesh("Cube", look="Paint"), texture % ("roughness", 1))) == []
    finding = only(stage(mesh("Cube", look="Paint"), texture % ("ior", 0)), "abbe:Dispersion")
    check(finding, "warning", "/World/Paint/S.inputs:ior", "driven by a network")


def test_unknown_glass(stage: Callable[..., Path]) -> None:
    finding = only(stage(mesh("Cube"), material(ours='uniform string abbe:glass = "SCHOTT:N-BK77"')), "abbe:GlassName")
    check(finding, "error", "/World/Glass.abbe:glass", "N-BK77")
    if hasattr(abbe, "glass"):
        assert "N-BK7" in finding.message.replace("N-BK77", "")
        assert validate(stage(mesh("Cube"), material(ours='uniform string abbe:glass = "SCHOTT:N-BK7"'))) == []


@pytest.mark.parametrize(
    ("where", "attribute", "path", "words"),
    [
        (
            "material",
            "double abbe:dispersion:dv = 40",
            "/World/Glass.abbe:dispersion:dv",
            "is abbe:dispersion:vd meant?",
        ),
        ("material", "double abbe:colour = 40", "/World/Glass.abbe:colour", "no such attribute"),
        ("material", "int abbe:samples = 4", "/World/Glass.abbe:samples", "author it on a RenderSettings"),
        ("shader", "double inputs:abbe:vd = 4", "/World/Glass/Surface.inputs:abbe:vd", "no such attribute"),
        (
            "shader",
            "double abbe:dispersion:vd = 40",
            "/World/Glass/Surface.abbe:dispersion:vd",
            "author it as inputs:abbe:dispersion:vd",
        ),
        ("mesh", 'uniform string abbe:glass = "ice"', "/World/Cube.abbe:glass", "author it on a Material"),
        ("mesh", "double abbe:lens:thicknes = 1", "/World/Cube.abbe:lens:thicknes", "is abbe:lens:thickness meant?"),
        ("settings", "int abbe:sample = 4", "/Settings.abbe:sample", "is abbe:samples meant?"),
        ("settings", "double abbe:wavelength = 500", "/Settings.abbe:wavelength", "author it on a RenderVar"),
    ],
)
def test_unknown_attributes(stage: Callable[..., Path], where: str, attribute: str, path: str, words: str) -> None:
    there = {name: attribute if name == where else "" for name in ("material", "shader", "mesh", "settings")}
    path_ = stage(
        mesh("Cube", more=there["mesh"]),
        material(ours=there["material"], shader=there["shader"]),
        after=f'def RenderSettings "Settings" {{\n{there["settings"]}\n}}\n',
    )
    check(only(path_, "abbe:AttributeNames"), "warning", path, words)


def test_known_attributes_are_silent(stage: Callable[..., Path]) -> None:
    product = 'def RenderProduct "P" {\nint abbe:samples = 4\n}\n'
    ours = "double inputs:abbe:dispersion:vd = 40"
    assert validate(stage(mesh("Cube"), material(shader=ours), after=product)) == []
    assert validate(stage(mesh("Cube"), material(ours=ours), after=product)) == []


def test_dispersion_that_nothing_uses(stage: Callable[..., Path]) -> None:
    law = "double abbe:dispersion:vd = 40"
    finding = only(stage(mesh("Cube"), material(ours=law, opacity=1)), "abbe:UnusedDispersion")
    check(finding, "warning", "/World/Glass", "no glass to use it")
    finding = only(stage(mesh("Cube"), material(), material("Spare", ours=law)), "abbe:UnusedDispersion")
    check(finding, "info", "/World/Spare", "bind it")
    # Bound through a collection, and for another purpose, is bound.
    collection = """def Scope "Parts" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:all"]) {
        rel collection:all:includes = </World/Cube>
        rel material:binding:collection:preview:all = [</World/Parts.collection:all>, </World/Spare>]
    }
    """
    assert validate(stage(mesh("Cube"), material(), material("Spare", ours=law), collection)) == []


def test_absorption_needs_to_know_the_unit(stage: Callable[..., Path]) -> None:
    table = "uniform double2[] abbe:internalTransmittance:table = [(400, 0.9), (700, 0.99)]"
    scene = mesh("Cube"), material(ours=f"double abbe:dispersion:vd = 40\n{table}")
    finding = next(f for f in validate(stage(*scene, metadata="")) if f.validator == "abbe:Units")
    check(finding, "warning", "/World/Glass.abbe:internalTransmittance:table", "author metersPerUnit")
    assert not any(finding.validator == "abbe:Units" for finding in validate(stage(*scene)))
    assert validate(stage(mesh("Cube"), material(ours="double abbe:dispersion:vd = 40"), metadata="")) == []


# Bodies


def test_open_glass(stage: Callable[..., Path]) -> None:
    finding = only(stage(mesh("Cube", CUBE[1:]), material()), "abbe:ClosedGlass")
    check(finding, "warning", "/World/Cube", "not closed", "close the mesh")
    turned = [CUBE[0][::-1], *CUBE[1:]]
    assert only(stage(mesh("Cube", turned), material()), "abbe:ClosedGlass").path == "/World/Cube"
    # Paint may be open.
    assert validate(stage(mesh("Cube", CUBE[1:]), material(opacity=1))) == []


def test_glass_that_is_split_along_its_edges_is_closed(stage: Callable[..., Path]) -> None:
    points = [CORNERS[index] for face in CUBE for index in face]
    faces = [tuple(range(4 * k, 4 * k + 4)) for k in range(6)]
    assert validate(stage(mesh("Cube", faces, points), material())) == []


@pytest.mark.parametrize("faces", [[(0, 1, 3, 2)], [(0, 1, 3, 2), (2, 3, 1, 0)]], ids=["one side", "both sides"])
@pytest.mark.parametrize("size", [1.0, (1e-4, 3e-5, 2e-4), (1e6, 1e6, 1e6)])
def test_glass_without_thickness(stage: Callable[..., Path], faces: list[tuple[int, ...]], size: float) -> None:
    # Tilted, so that the coordinates are rounded.
    points = [(x + 0.3 * z, y - 0.1 * x, z + 0.7 * y) for x, y, z in CORNERS]
    finding = only(stage(mesh("Sheet", faces, points, size=size), material()), "abbe:GlassThickness")
    check(finding, "warning", "/World/Sheet", "thickness", "thin-walled")


@pytest.mark.parametrize("thickness", [1e-3, 1e-5])
def test_thin_glass_has_a_thickness(stage: Callable[..., Path], thickness: float) -> None:
    assert validate(stage(mesh("Pane", size=(1.0, 1.0, thickness)), material())) == []


def test_glass_inside_out(stage: Callable[..., Path]) -> None:
    inwards = [face[::-1] for face in CUBE]
    finding = only(stage(mesh("Cube", inwards), material()), "abbe:GlassOrientation")
    check(finding, "warning", "/World/Cube", "inwards", "orientation")
    left = 'uniform token orientation = "leftHanded"'
    assert validate(stage(mesh("Cube", inwards, more=left), material())) == []
    assert only(stage(mesh("Cube", more=left), material()), "abbe:GlassOrientation").path == "/World/Cube"
    # A bubble.
    assert validate(stage(mesh("Cube", inwards), mesh("Block", size=2.0), material())) == []


BOTTLE = [*CUBE, *(tuple(8 + index for index in face[::-1]) for face in CUBE)]
BOTTLE_POINTS = [*CORNERS, *((0.8 * x, 0.8 * y, 0.8 * z) for x, y, z in CORNERS)]


@pytest.mark.parametrize(
    "parts",
    [
        (mesh("A"), mesh("B", at=(0.7, 0.8, 0.9), look="Water")),
        (mesh("A"), sphere("B", 1.2, look="Water")),
        (sphere("A", 1.0), sphere("B", 1.0, (1.5, 0.0, 0.0), "Water")),
        # Crossed bars: no vertex of one lies in the other.
        (mesh("A", size=(9.0, 1.0, 1.0)), mesh("B", size=(1.0, 9.0, 1.0), look="Water", at=(0.1, 0.0, 0.0))),
        # Water that reaches into the wall of its bottle.
        (mesh("A", BOTTLE, BOTTLE_POINTS), mesh("B", size=0.9, look="Water")),
    ],
    ids=["cubes", "cube and sphere", "spheres", "bars", "bottle"],
)
def test_overlapping_glass(stage: Callable[..., Path], parts: tuple[str, str]) -> None:
    water = material("Water", shader="float inputs:ior = 1.33")
    finding = only(stage(*parts, material(), water), "abbe:OverlappingGlass")
    check(finding, "warning", "/World/A", "</World/B>", "</World/Glass>", "</World/Water>", "abbe:dielectricPriority")
    # The same glass twice has no border that could refract.
    assert validate(stage(*(part.replace("Water", "Glass") for part in parts), material())) == []
    priorities = ["uniform int abbe:dielectricPriority = 1", "uniform int abbe:dielectricPriority = 2"]
    decided = stage(*parts, material(ours=priorities[0]), material("Water", ours=priorities[1]))
    assert validate(decided) == []
    undecided = stage(*parts, material(ours=priorities[0]), material("Water", ours=priorities[0]))
    assert only(undecided, "abbe:OverlappingGlass").path == "/World/A"


@pytest.mark.parametrize(
    "parts",
    [
        (mesh("A"), mesh("B", size=0.5, look="Water")),
        (mesh("A"), mesh("B", at=(2.0, 0.0, 0.0), look="Water")),
        (mesh("A"), mesh("B", at=(0.0, 1.5, 0.0), size=(3.0, 0.5, 3.0), look="Water")),
        (mesh("A"), mesh("B", at=(5.0, 0.0, 0.0), look="Water")),
        # The boxes overlap, the bodies do not.
        (sphere("A", 1.0), sphere("B", 1.0, (1.3, 1.3, 1.3), "Water")),
        (mesh("A", BOTTLE, BOTTLE_POINTS), mesh("B", size=0.7, look="Water")),
    ],
    ids=["nested", "side by side", "on a table", "apart", "diagonal", "in a bottle"],
)
def test_glass_beside_and_within_glass_is_silent(stage: Callable[..., Path], parts: tuple[str, str]) -> None:
    assert validate(stage(*parts, material(), material("Water"))) == []


def test_what_is_flat_overlaps_nothing(stage: Callable[..., Path]) -> None:
    sheet = mesh("Sheet", [(0, 1, 3, 2)], size=(0.0, 3.0, 3.0), look="Water")
    assert only(stage(mesh("A"), sheet, material(), material("Water")), "abbe:GlassThickness").path == "/World/Sheet"
    scale = 'double3 xformOp:scale = (1, 0, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    flattened = mesh("B", size=0.7, at=(0.7, 0.7, 0.7), look="Water", more=scale)
    assert validate(stage(mesh("A"), flattened, material(), material("Water"))) == []


def test_many_bodies_are_told_of_once(stage: Callable[..., Path]) -> None:
    gems = """def Xform "Gem%d" (instanceable = true
        prepend references = </Prototype>) {
        double3 xformOp:translate = (%f, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    """
    prototype = 'class Xform "Prototype" {\n' + mesh("Cube") + "}\n"
    world = [mesh("Bath", size=(50.0, 0.5, 2.0), look="Water"), material(), material("Water")]
    findings = validate(stage(*world, *(gems % (k, 3.0 * k) for k in range(9)), after=prototype))
    assert [finding.validator for finding in findings] == ["abbe:OverlappingGlass"]


# Renders

SETTINGS = """def RenderSettings "Settings" {
    rel products = </Settings/P>
    %s
    def RenderProduct "P" {
        token productName = "x.exr"
        rel orderedVars = [</Settings/P/a>, </Settings/P/b>]
        def RenderVar "a" {
            string sourceName = "%s"
        }
        def RenderVar "b" {
            string sourceName = "primId"
        }
    }
}
"""


def test_missing_camera(stage: Callable[..., Path]) -> None:
    scene = mesh("Cube"), material()
    path = stage(*scene, camera=False)
    finding = only(path, "abbe:Camera")
    check(finding, "info", "/", "add a Camera")
    assert finding.place == str(path)
    check(only(stage(*scene, camera=False, after=SETTINGS % ("", "depth")), "abbe:Camera"), "warning", "/", "framed")
    assert validate(stage(*scene, after=SETTINGS % ("", "depth"))) == []


def test_render_vars_without_a_known_source(stage: Callable[..., Path]) -> None:
    scene = mesh("Cube"), material()
    finding = only(stage(*scene, after=SETTINGS % ("", "dispersoin")), "abbe:RenderVars")
    check(finding, "warning", "/Settings/P/a", "dispersoin", "is dispersion meant?")
    same = (SETTINGS % ("", "depth")).replace('"primId"', '"primId"\nstring driver:parameters:aov:name = "a"')
    check(only(stage(*scene, after=same), "abbe:RenderVars"), "error", "/Settings/P/b", "driver:parameters:aov:name")


@pytest.mark.parametrize(
    ("line", "severity", "path", "words"),
    [
        ("int abbe:samples = -1", "error", "/Settings.abbe:samples", "-1"),
        ('token abbe:integrator = "paht"', "error", "/Settings", "paht"),
        ("double abbe:errorTarget = 0.1", "warning", "/Settings.abbe:errorTarget", "color, which is not rendered"),
        ("rel camera = </World/Cube>", "error", "/Settings.camera", "not a Camera"),
    ],
)
def test_impossible_settings(stage: Callable[..., Path], line: str, severity: str, path: str, words: str) -> None:
    finding = only(stage(mesh("Cube"), material(), after=SETTINGS % (line, "depth")), "abbe:RenderSettings")
    assert finding.severity == severity and words in str(finding), finding
    assert finding.path == path, finding


def test_geometry_that_a_render_leaves_out(stage: Callable[..., Path]) -> None:
    wrong = mesh("Cube", look="Paint").replace("faceVertexCounts = [4, 4, 4, 4, 4, 4]", "faceVertexCounts = [4, 4, 99]")
    path = stage(wrong, material("Paint", opacity=1))
    finding = only(path, "abbe:Stage")
    check(finding, "error", "/World/Cube.faceVertexCounts")
    with pytest.raises(StageError) as refused:
        abbe.render(path, width=8, strict=True)
    assert finding.message in str(refused.value)


# All of it


def test_validating_changes_nothing(stage: Callable[..., Path]) -> None:
    opened = Usd.Stage.Open(str(stage(mesh("A"), mesh("B", CUBE[1:], look="Water"), material(), material("Water"))))
    before = [layer.ExportToString() for layer in opened.GetUsedLayers()]
    first = validate(opened)
    assert first and validate(opened) == first
    assert [layer.ExportToString() for layer in opened.GetUsedLayers()] == before


def test_some_validators_can_be_chosen(stage: Callable[..., Path]) -> None:
    path = stage(mesh("Cube", CUBE[1:]), material(), camera=False)
    assert {finding.validator for finding in validate(path)} == {"abbe:Camera", "abbe:ClosedGlass"}
    assert [finding.validator for finding in validate(path, validators=["abbe:Camera"])] == ["abbe:Camera"]
    with pytest.raises(UsageError, match="there is no 'abbe:Cam'"):
        validate(path, validators=["abbe:Cam"])
    with pytest.raises(FileNotFoundError):
        validate(path.with_name("none.usda"))


def test_usd_runs_the_same_validators(stage: Callable[..., Path]) -> None:
    validation = pytest.importorskip("pxr.UsdValidation", reason="this USD has no validators")
    registry = validation.ValidationRegistry()
    if not hasattr(registry, "RegisterStageValidator"):
        pytest.skip("this USD takes no validators from Python")
    metadata = registry.GetValidatorMetadataForKeyword("abbe")
    assert {item.name: item.doc for item in metadata} == {validator.name: validator.doc for validator in VALIDATORS}
    opened = Usd.Stage.Open(
        str(
            stage(
                mesh("Cube", CUBE[1:]),
                material(ours="double abbe:dispersion:nd = 1.5\ndouble abbe:dispersion:vd = 60\ndouble abbe:vd = 1"),
                material("Bad", ours="double abbe:dispersion:nd = -1"),
                camera=False,
            )
        )
    )
    validators = registry.GetOrLoadValidatorsByName(NAMES)
    errors = validation.ValidationContext(validators).Validate(opened)
    types = {"error": "Error", "warning": "Warn", "info": "Info"}
    expected = sorted((types[f.severity], f.path, str(f)) for f in validate(opened))
    found = []
    for error in errors:
        (site,) = error.GetSites()
        target = site.GetProperty() if site.IsProperty() else site.GetPrim()
        assert site.IsValid() and target, error.GetErrorAsString()
        found.append((error.GetType().name, str(target.GetPath()), error.GetMessage()))
    assert sorted(found) == expected and {item[0] for item in found} == {"Error", "Warn", "Info"}


Run = Callable[..., CompletedProcess[str]]


def test_the_command_tells_and_exits_with_four_for_errors(run: Run, stage: Callable[..., Path]) -> None:
    path = stage(mesh("Cube"), material())
    result = run("validate", path)
    assert (result.returncode, result.stdout) == (0, f"{path}: nothing found\n")
    path = stage(mesh("Cube", CUBE[1:]), material())
    result = run("validate", path)
    assert result.returncode == 0 and result.stdout.startswith("warning  </World/Cube>: ")
    assert result.stdout.endswith(f"{path}: 1 warning\n")
    assert run("validate", path, "--strict").returncode == 4
    path = stage(mesh("Cube"), material(ours="double abbe:dispersion:nd = -1"))
    result = run("validate", path, "--json")
    assert result.returncode == 4
    (finding,) = json.loads(result.stdout)
    assert finding["path"] == "/World/Glass.abbe:dispersion:nd" and finding["severity"] == "error"
    # What is set for the command counts.
    assert run("validate", path, "--set", "/World/Glass.abbe:dispersion:nd=1.5").returncode == 0
    assert run("validate", "none.usda").returncode == 1
    assert run("validate", "scene.safetensors").returncode == 2


def _assets() -> Path | None:
    named = os.environ.get("ABBE_ASSETS")
    if named:
        return Path(named)
    candidates = [ROOT / "shared" / "assets", *(parent / "shared" / "assets" for parent in list(ROOT.parents)[:2])]
    return next((folder for folder in candidates if folder.is_dir()), None)


def test_assets_that_nobody_here_wrote_are_without_false_alarms() -> None:
    folder = _assets()
    if folder is None:
        pytest.skip("NO SHARED ASSETS: 287 stages are not tested; set ABBE_ASSETS to their folder")
    paths = sorted(path for path in folder.rglob("*") if path.suffix in (".usd", ".usda", ".usdc", ".usdz"))
    assert len(paths) > 250
    found: dict[str, set[str]] = {}
    for path in paths:
        for finding in validate(path):
            if finding.severity != "info":
                found.setdefault(finding.validator, set()).add(path.name)
    # A projective transform, which no render can use.
    assert found.pop("abbe:Stage") == {"weird_matrix_transform.usda"}
    # What else there is was looked at: indices below 1, and sheets that a texture or a small opacity makes glass.
    assert set(found) <= {"abbe:Dispersion", "abbe:GlassThickness", "abbe:ClosedGlass"}
