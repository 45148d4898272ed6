"""The scene graph against USD's own answers: transforms, visibility, purpose, bindings; and how stages are opened."""

from pathlib import Path

import numpy as np
import pytest
from description_schema import validate
from instances_oracle import unrolled

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd, UsdGeom, UsdShade

from abbe.errors import StageError, UsageError
from abbe.usd import describe, list_cameras

STAGES = Path(__file__).parent / "stages"
GRAPH = STAGES / "graph.usda"


def checked(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    return description


def placed(description):
    return {path: (world, material) for path, _, world, material in unrolled(description)}


def spheres(stage):
    """Every Sphere prim, those inside native instances included."""
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in prims if prim.IsA(UsdGeom.Sphere)]


@pytest.mark.parametrize("frame", [1, 1.25, 2, 2.5, 4])
@pytest.mark.parametrize("purposes", [["render"], ["proxy", "guide"]])
def test_what_is_placed_is_what_usd_says_is_visible_and_where(frame, purposes):
    stage = Usd.Stage.Open(str(GRAPH))
    cache = UsdGeom.XformCache(frame)
    expected = {}
    for prim in spheres(stage):
        sphere = UsdGeom.Sphere(prim)
        is_visible = sphere.ComputeVisibility(frame) != UsdGeom.Tokens.invisible
        if is_visible and sphere.ComputePurpose() in ("default", *purposes):
            expected[str(prim.GetPath())] = np.array(cache.GetLocalToWorldTransform(prim))
    found = placed(checked(GRAPH, frame=frame, purposes=purposes))
    assert set(found) == set(expected)
    for path, world in expected.items():
        assert np.array_equal(found[path][0], world), path


def test_the_box_of_what_is_placed_is_usds():
    stage = Usd.Stage.Open(str(GRAPH))
    bounds = UsdGeom.BBoxCache(1, ["default", "render"])
    for path, (world, _) in placed(checked(GRAPH, frame=1, purposes=["render"])).items():
        expected = bounds.ComputeWorldBound(stage.GetPrimAtPath(path)).ComputeAlignedRange()
        radius = UsdGeom.Sphere(stage.GetPrimAtPath(path)).GetRadiusAttr().Get(1)
        corners = np.array(np.meshgrid(*[[-radius, radius]] * 3)).reshape(3, -1).T @ world[:3, :3] + world[3, :3]
        assert np.allclose(corners.min(axis=0), expected.GetMin(), rtol=1e-13, atol=1e-13), path
        assert np.allclose(corners.max(axis=0), expected.GetMax(), rtol=1e-13, atol=1e-13), path


@pytest.mark.parametrize(
    ("binding", "purpose", "names"),
    [
        ('["full", ""]', "full", ["Base", "Full", "Metal"]),
        ('["preview"]', "preview", ["Preview", "OwnPreview"]),
        ('[""]', "", ["Base", "Own", "Metal"]),
    ],
)
def test_bound_materials_are_those_that_usd_resolves(binding, purpose, names, tmp_path):
    settings = f'def RenderSettings "R"\n{{\n uniform token[] materialBindingPurposes = {binding}\n}}\n'
    path = tmp_path / "graph.usda"
    path.write_text(GRAPH.read_text() + settings)
    stage = Usd.Stage.Open(str(path))
    found = placed(checked(path, frame=1))
    seen = set()
    for prim_path, (_, material) in found.items():
        prim = stage.GetPrimAtPath(prim_path)
        bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
        expected = str(bound.GetPath()) if bound else None
        if expected and bound.GetPrim().IsInstanceProxy():
            # One material of a prototype, under the name of the instance that was read first.
            assert stage.GetPrimAtPath(material).GetPrimInPrototype() == bound.GetPrim().GetPrimInPrototype()
        else:
            assert material == expected, prim_path
        seen.add(material)
    assert seen == {f"/World/Looks/{name}" for name in names}, "the stage exercises the rules"


def test_only_bound_materials_are_read():
    paths = [material["path"] for material in checked(GRAPH, frame=1).document["materials"]]
    assert "/World/Looks/Unused" not in paths and len(paths) == len(set(paths))


def test_draw_modes_are_ignored_with_a_note():
    description = checked(GRAPH)
    (warning,) = [w for w in description.warnings if w["kind"] == "unsupported-draw-mode"]
    assert warning["places"] == ["</World/Cards>"] and "/World/Cards/Ball" in placed(description)


# References, payloads, masks, session layers


@pytest.fixture
def library(tmp_path):
    """A stage whose parts are in other files: a reference, a payload, a nested payload."""
    part = '#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Xform "P"\n{{\n'
    part += ' def Sphere "S"\n {{\n  double radius = {}\n }}\n{}}}\n'
    (tmp_path / "inner.usda").write_text(part.format(1, ""))
    payload = ' def "In" (\n  payload = @inner.usda@\n )\n {\n }\n'
    (tmp_path / "part.usda").write_text(part.format(2, payload))
    stage = tmp_path / "stage.usda"
    stage.write_text(
        '#usda 1.0\n(\n defaultPrim = "World"\n)\ndef Xform "World"\n{\n'
        ' def "R" (\n  references = @part.usda@\n )\n {\n }\n def "L" (\n  payload = @part.usda@\n )\n {\n }\n'
        ' def Camera "Shot"\n {\n }\n'
        ' def Sphere "Own" (\n  prepend apiSchemas = ["MaterialBindingAPI"]\n )\n {\n'
        "  rel material:binding = </Looks/Glass>\n }\n}\n"
        'def Scope "Looks"\n{\n def Material "Glass"\n {\n'
        "  token outputs:surface.connect = </Shaders/Glass.outputs:surface>\n }\n}\n"
        'def Scope "Shaders"\n{\n def Shader "Glass"\n {\n  uniform token info:id = "UsdPreviewSurface"\n'
        "  token outputs:surface\n }\n}\n"
    )
    return stage


ALL = {"/World/R/S", "/World/R/In/S", "/World/L/S", "/World/L/In/S", "/World/Own"}


def test_payloads_are_loaded_unless_none_are_wanted(library):
    assert set(placed(checked(library))) == ALL
    without = checked(library, payloads="none")
    assert set(placed(without)) == {"/World/R/S", "/World/Own"}
    # The payload within an unloaded one is not known.
    assert without.document["skipped"]["payload not loaded"] == 2
    with pytest.raises(UsageError, match="payloads 'some': choose 'all' or 'none'"):
        describe(library, payloads="some")


def test_a_stage_in_memory_keeps_its_own_load_rules(library):
    stage = Usd.Stage.Open(str(library))
    stage.Unload("/World/L")
    description = checked(stage)
    assert set(placed(description)) == {"/World/R/S", "/World/R/In/S", "/World/Own"}
    assert description.document["skipped"]["payload not loaded"] == 1
    assert set(placed(checked(stage, payloads="none"))) == {"/World/R/S", "/World/Own"}
    assert stage.GetPrimAtPath("/World/R/In/S"), "the caller's stage is as it was"


def test_a_mask_loads_prims_with_what_they_need(library):
    description = checked(library, mask=["/World/Own"], camera="/World/Shot")
    assert set(placed(description)) == {"/World/Own"}
    (material,) = description.document["materials"]
    assert material["path"] == "/Looks/Glass" and material["surface"]["path"] == "/Shaders/Glass"
    assert description.document["cameras"][0]["path"] == "/World/Shot"
    stage = Usd.Stage.Open(str(library))
    assert set(placed(checked(stage, mask=["/World/R", "/World/L/S"]))) == ALL - {"/World/Own", "/World/L/In/S"}
    assert stage.GetPopulationMask() == Usd.StagePopulationMask.All()
    instanced = checked(STAGES / "instancers.usda", mask=["/World/Kits"])
    assert {path for path, *_ in unrolled(instanced)} == {
        "/World/KitA/Nut",
        "/World/KitA/Screws/Head",
        "/Shared/Bead",
    }
    for mask, error, message in (
        (["/World/Nope"], StageError, r"^</World/Nope>: there is no such prim .*correct mask"),
        (["World"], UsageError, r"^mask: 'World' is no prim path"),
        ("/World", UsageError, "is a list"),
    ):
        with pytest.raises(error, match=message):
            describe(library, mask=mask)


def test_a_session_layer_is_stronger_than_the_stage(library, tmp_path):
    session = tmp_path / "session.usda"
    session.write_text(
        '#usda 1.0\n(\n metersPerUnit = 5\n)\nover "World"\n{\n over "Own"\n {\n  double radius = 7\n }\n'
        ' def Sphere "New"\n {\n }\n}\n'
    )
    before = session.read_text(), library.read_text()
    for stage in (library, Usd.Stage.Open(str(library))):
        document = checked(stage, session_layer=session).document
        radii = {shape["sphere"]["path"]: shape["sphere"]["radius"] for shape in document["shapes"]}
        assert radii["/World/Own"] == 7.0 and "/World/New" in radii
        assert document["stage"]["meters_per_unit"] == 5.0
        stronger = checked(stage, session_layer=session, overrides=["/World/Own.radius=9"]).document
        assert 9.0 in [shape["sphere"]["radius"] for shape in stronger["shapes"]]
    assert (session.read_text(), library.read_text()) == before
    assert [camera.path for camera in list_cameras(library, session_layer=session)] == ["/World/Shot"]
    with pytest.raises(FileNotFoundError, match="there is no such file"):
        describe(library, session_layer=tmp_path / "nope.usda")
    with pytest.raises(UsageError, match="is the stage itself"):
        describe(library, session_layer=library)


def test_variants_within_references_are_selected(tmp_path):
    (tmp_path / "part.usda").write_text(
        '#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Xform "P" (\n variants = {\n  string size = "small"\n }\n'
        ' prepend variantSets = "size"\n)\n{\n variantSet "size" = {\n'
        '  "small" {\n   def Sphere "S"\n   {\n   }\n  }\n  "big" {\n   def Sphere "B"\n   {\n   }\n  }\n }\n}\n'
    )
    stage = tmp_path / "stage.usda"
    stage.write_text('#usda 1.0\ndef "A" (\n instanceable = true\n references = @part.usda@\n)\n{\n}\n')
    assert set(placed(checked(stage))) == {"/A/S"}
    assert set(placed(checked(stage, variants=["/A{size=big}"]))) == {"/A/B"}
    with pytest.raises(StageError, match=r"^</A>{size}: has no variant 'huge': choose one of big, small"):
        describe(stage, variants=["/A{size=huge}"])


def test_the_callers_resolver_context_finds_assets(tmp_path):
    from pxr import Ar

    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "part.usda").write_text('#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Sphere "P"\n{\n}\n')
    layer = Sdf.Layer.CreateAnonymous("scene.usda")
    assert layer.ImportFromString('#usda 1.0\ndef "A" (\n references = @part.usda@\n)\n{\n}\n')
    context = Ar.ResolverContext(Ar.DefaultResolverContext([str(tmp_path / "lib")]))
    stage = Usd.Stage.Open(layer, context)
    assert set(placed(checked(stage))) == {"/A"}
    # Composed anew for what is overridden, in the same context.
    radius = checked(stage, overrides=["/A.radius=3"]).document["shapes"][0]["sphere"]["radius"]
    assert radius == 3.0


# The command line


def test_the_command_line_opens_stages_the_same_way(run, library, tmp_path):
    session = tmp_path / "session.usda"
    session.write_text('#usda 1.0\nover "World"\n{\n def Camera "Added"\n {\n }\n}\n')
    result = run("list-cameras", library, "--sessionLayer", session)
    assert result.returncode == 0 and {line.split()[0] for line in result.stdout.splitlines()} == {
        "/World/Shot",
        "/World/Added",
    }
    result = run("list-cameras", library, "--session-layer", session, "--mask", "/World/Own,/World/Added")
    assert [line.split()[0] for line in result.stdout.splitlines()] == ["/World/Added"]
    result = run(
        "plan", library, "--payloads", "none", "--mask", "/World/L", "--aov", "depth", "--camera", "/World/Shot"
    )
    assert result.returncode == 0 and "payload not loaded: 1 left out by the bridge" in result.stdout
    result = run("plan", library, "--mask", "/World/Nope")
    assert result.returncode == 1 and "</World/Nope>: there is no such prim" in result.stderr
    assert run("export", library, "scene.safetensors", "--quiet").returncode == 0
    for option in (["--mask", "/World"], ["--payloads", "none"], ["--session-layer", str(session)]):
        result = run("plan", "scene.safetensors", *option)
        assert result.returncode == 2 and result.stderr.startswith(f"abbe: {option[0]}: "), result.stderr
