"""Lights against USD's own answers: values and fallbacks of every attribute, places, links; and what cannot shine."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Gf, Usd, UsdGeom, UsdLux

import abbe
from abbe.errors import AbbeError
from abbe.usd import describe

ROOT = Path(__file__).resolve().parents[2]
STAGES = Path(__file__).parent / "stages"
LIGHTS = STAGES / "lights.usda"
ASSETS = ROOT.parent / "shared" / "assets"

# The fields of the description by the inputs of the schemas.
COMMON = {
    "intensity": "intensity",
    "exposure": "exposure",
    "normalize": "normalize",
    "color": "color",
    "enableColorTemperature": "enable_color_temperature",
    "colorTemperature": "color_temperature",
    "diffuse": "diffuse",
    "specular": "specular",
}
SHAPES = {
    "DistantLight": ("distant", {"inputs:angle": "angle"}),
    "RectLight": ("rect", {"inputs:width": "width", "inputs:height": "height"}),
    "DiskLight": ("disk", {"inputs:radius": "radius"}),
    "SphereLight": ("sphere", {"inputs:radius": "radius", "treatAsPoint": "treat_as_point"}),
    "CylinderLight": (
        "cylinder",
        {"inputs:length": "length", "inputs:radius": "radius", "treatAsLine": "treat_as_line"},
    ),
    "DomeLight": ("dome", {"inputs:texture:format": "format", "guideRadius": "guide_radius"}),
    "DomeLight_1": ("dome", {"inputs:texture:format": "format", "guideRadius": "guide_radius"}),
    "PortalLight": ("portal", {"inputs:width": "width", "inputs:height": "height"}),
    "GeometryLight": ("geometry", {"light:materialSyncMode": "material_sync_mode"}),
}
SHAPING = {
    "focus": "focus",
    "focusTint": "focus_tint",
    "cone:angle": "cone_angle",
    "cone:softness": "cone_softness",
    "ies:angleScale": "ies_angle_scale",
    "ies:normalize": "ies_normalize",
}
SHADOW = {
    "enable": "enable",
    "color": "color",
    "distance": "distance",
    "falloff": "falloff",
    "falloffGamma": "falloff_gamma",
}


def read(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    return description


def lights_of(description):
    return {light["path"]: light for group in description.document["groups"] for light in group.get("lights", [])}


def warned(description, kind):
    return [warning for warning in description.warnings if warning["kind"] == kind]


def in_memory(text):
    stage = Usd.Stage.CreateInMemory()
    # A statement a line, which not every USD asks for.
    stage.GetRootLayer().ImportFromString("#usda 1.0\n" + text.replace("{", "{\n").replace("}", "\n}\n"))
    return stage


def value(attribute, time=None):
    found = attribute.Get() if time is None else attribute.Get(time)
    return list(found) if isinstance(found, Gf.Vec3f) else found


def compiled(stage, **options):
    return {light["path"]: light for light in abbe.Scene.from_stage(stage, **options).lights()}


# Attributes


@pytest.mark.parametrize("type_name", SHAPES)
def test_fallbacks_are_those_of_the_schema(type_name):
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/Light", type_name)
    prim.ApplyAPI(UsdLux.ShapingAPI)
    prim.ApplyAPI(UsdLux.ShadowAPI)
    light = lights_of(read(stage))["/Light"]
    for name, field in COMMON.items():
        assert light[field] == value(prim.GetAttribute(f"inputs:{name}")), name
    for name, field in SHAPING.items():
        assert light["shaping"][field] == value(prim.GetAttribute(f"inputs:shaping:{name}")), name
    for name, field in SHADOW.items():
        assert light["shadow"][field] == value(prim.GetAttribute(f"inputs:shadow:{name}")), name
    kind, fields = SHAPES[type_name]
    for name, field in fields.items():
        assert light["shape"][kind][field] == value(prim.GetAttribute(name)), name
    assert "ies" not in light["shaping"] and light["shape"][kind].get("texture") is None


def test_every_input_of_every_light_is_read():
    """What the schemas declare is what the tests here name: a newer USD with more would be noticed."""
    known = {f"inputs:{name}" for name in COMMON}
    for type_name, (_, fields) in SHAPES.items():
        definition = Usd.SchemaRegistry().FindConcretePrimDefinition(type_name)
        inputs = {name for name in definition.GetPropertyNames() if name.startswith("inputs:")}
        assert inputs == known | {n for n in fields if n.startswith("inputs:")} | (
            {"inputs:texture:file"} if type_name.startswith(("Rect", "Dome")) else set()
        ), type_name
    for name, fields, own in (("ShapingAPI", SHAPING, "shaping"), ("ShadowAPI", SHADOW, "shadow")):
        declared = set(Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(name).GetPropertyNames())
        extra = {"inputs:shaping:ies:file"} if own == "shaping" else set()
        assert declared == {f"inputs:{own}:{field}" for field in fields} | extra


def test_what_is_authored_is_read_at_its_time():
    for frame in (1, 1.5, 2):
        stage = Usd.Stage.Open(str(LIGHTS))
        lights = lights_of(read(LIGHTS, frame=frame))
        cache = UsdGeom.XformCache(frame)
        for path, light in lights.items():
            prim = stage.GetPrimAtPath(path)
            if path != "/World/Old":
                for name, field in COMMON.items():
                    assert light[field] == value(prim.GetAttribute(f"inputs:{name}"), frame), (path, name)
            world = np.array(light.get("transform", np.eye(4))).reshape(4, 4)
            if "geometry" not in light["shape"]:
                assert np.array_equal(world, np.array(cache.GetLocalToWorldTransform(prim))), path
    assert lights["/World/NewDome"]["intensity"] == 4


def test_older_names_count_where_the_newer_are_not_authored():
    old = lights_of(read(LIGHTS))["/World/Old"]
    assert (old["intensity"], old["color"], old["normalize"]) == (7, [0, 1, 0], True)
    assert old["shape"] == {"sphere": {"radius": 2, "treat_as_point": False}}
    # Not applied, so that only what is authored counts, and fallbacks of the rest.
    assert old["shaping"]["cone_angle"] == 60 and old["shaping"]["focus"] == 0
    both = in_memory('def SphereLight "L" { float inputs:intensity = 2\n float intensity = 3 }')
    assert lights_of(read(both))["/L"]["intensity"] == 2


def test_without_the_schema_there_is_no_cone():
    stage = in_memory('def SphereLight "L" { float inputs:shaping:focus = 2 }')
    assert lights_of(read(stage))["/L"]["shaping"]["cone_angle"] == 180
    assert "shaping" not in lights_of(read(in_memory('def SphereLight "L" {}')))["/L"]


def test_an_input_is_followed_to_a_constant_and_no_further():
    stage = in_memory("""
def Material "M" {
    color3f inputs:tint = (0, 0.5, 1)
    float outputs:out.connect = </M/S.outputs:out>
    def Shader "S" { uniform token info:id = "noise"
 float outputs:out }
}
def RectLight "L" {
    color3f inputs:color = (1, 1, 1)
    color3f inputs:color.connect = </M.inputs:tint>
    float inputs:intensity = 3
    float inputs:intensity.connect = </M/S.outputs:out>
}
""")
    description = read(stage)
    light = lights_of(description)["/L"]
    assert light["color"] == [0, 0.5, 1] and light["intensity"] == 3
    (warning,) = warned(description, "light-network")
    assert warning["places"] == ["</L>.inputs:intensity"] or warning["places"] == ["</L.inputs:intensity>"]


def test_domes_know_where_their_pole_is():
    lights = lights_of(read(LIGHTS))
    poles = {path: light["shape"]["dome"]["pole_axis"] for path, light in lights.items() if "dome" in light["shape"]}
    # The stage is Z up; the older schema says +Y all the same.
    assert poles == {"/World/Dome": "Y", "/World/NewDome": "Z", "/World/UprightDome": "Y"}


# What shines, and on what


def test_what_is_invisible_or_of_another_purpose_does_not_shine():
    description = read(LIGHTS)
    assert {"/World/Off", "/World/Proxy"}.isdisjoint(lights_of(description))
    assert description.document["skipped"] == {"invisible": 1, "purpose proxy": 1}
    assert "/World/Proxy" in lights_of(read(LIGHTS, purposes=["proxy"]))


def test_geometry_shines():
    lights = lights_of(read(LIGHTS))
    panel, glow = lights["/World/Set/Panel"], lights["/World/Glow"]
    assert panel["shape"]["geometry"] == {
        "prims": ["/World/Set/Panel"],
        "material_sync_mode": "materialGlowTintsLight",
    }
    assert panel["intensity"] == 3
    assert glow["shape"]["geometry"]["prims"] == ["/World/Set/Cube"]


def members(description, light, field):
    """Paths of the placements that a light is linked to."""
    index = light.get(field)
    items = [item for group in description.document["groups"] for item in group["items"]]
    if index is None:
        return {item["path"] for item in items}
    excludes = description.document["link_sets"][index]["excludes"]
    return {item["path"] for item in items if (index in item.get("link_sets", [])) != excludes}


LINKS = """
def Xform "Lamps" {
    def SphereLight "All" {}
    def SphereLight "Explicit" {
        uniform token collection:lightLink:expansionRule = "explicitOnly"
        uniform bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = [</World/A>, </World/B/Ball>]
    }
    def SphereLight "Expands" {
        uniform bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = </World/B>
        rel collection:lightLink:excludes = </World/B/Deep/Ball>
    }
    def SphereLight "Same" {
        uniform bool collection:shadowLink:includeRoot = 0
        rel collection:shadowLink:includes = [</World/B/Ball>, </World/B/Deep/Other>]
    }
    def SphereLight "Other" {
        uniform bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = </World.collection:some>
    }
    def SphereLight "Whole" {
        uniform bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = [</World>, </Elsewhere>]
    }
    def SphereLight "Nothing" {
        uniform bool collection:lightLink:includeRoot = 0
    }
    def SphereLight "NoInstance" {
        rel collection:lightLink:excludes = </World/Copy1>
    }
}
def Xform "World" (
    prepend apiSchemas = ["CollectionAPI:some"]
) {
    uniform token collection:some:expansionRule = "expandPrims"
    rel collection:some:includes = [</World/A>, </World/Copy2>]
    def Sphere "A" {}
    def Xform "B" {
        def Sphere "Ball" {}
        def Xform "Deep" {
            def Sphere "Ball" {}
            def Sphere "Other" {}
        }
    }
    def Xform "Copy1" (
        instanceable = true
        references = </Proto>
    ) {}
    def Xform "Copy2" (
        instanceable = true
        references = </Proto>
    ) {}
}
def Sphere "Elsewhere" {}
class Xform "Proto" {
    def Sphere "Inner" {}
}
"""


def test_links_are_usds_memberships():
    stage = in_memory(LINKS)
    description = read(stage)
    lights = lights_of(description)
    placed = {item["path"] for group in description.document["groups"] for item in group["items"]}
    assert len(placed) == 7 and len(lights) == 8
    for path, light in lights.items():
        for name, field in (("lightLink", "light_link"), ("shadowLink", "shadow_link")):
            query = Usd.CollectionAPI(stage.GetPrimAtPath(path), name).ComputeMembershipQuery()
            expected = {item for item in placed if query.IsPathIncluded(item)}
            assert members(description, light, field) == expected, (path, name)
    # Nothing is stored for what links everything, and equal memberships are stored once.
    assert not {"light_link", "shadow_link"} & set(lights["/Lamps/All"])
    assert "light_link" not in lights["/Lamps/Whole"]
    assert lights["/Lamps/Expands"]["light_link"] == lights["/Lamps/Same"]["shadow_link"]
    assert len(description.document["link_sets"]) == 5


def test_nothing_is_stored_where_every_light_links_everything():
    document = read(STAGES / "selection.usda").document
    assert document["link_sets"] == []
    assert not any("link_sets" in item for group in document["groups"] for item in group["items"])


def test_instances_are_linked_as_their_prototype_or_their_instancer():
    stage = in_memory("""
def SphereLight "Lamp" { rel collection:lightLink:excludes = [</Inner/Protos/A>, </Outer>] }
def PointInstancer "Inner" {
    rel prototypes = [</Inner/Protos/A>, </Inner/Protos/B>]
    int[] protoIndices = [0, 1]
    point3f[] positions = [(0, 0, 0), (2, 0, 0)]
    def Scope "Protos" { def Sphere "A" {}
 def Sphere "B" {} }
}
def PointInstancer "Outer" {
    rel prototypes = </Elsewhere>
    int[] protoIndices = [0]
    point3f[] positions = [(4, 0, 0)]
}
def PointInstancer "Free" {
    rel prototypes = </Elsewhere>
    int[] protoIndices = [0]
    point3f[] positions = [(6, 0, 0)]
}
def Sphere "Elsewhere" {}
""")
    description = read(stage)
    groups = description.document["groups"]
    (chosen,) = description.document["link_sets"]
    linked = {}
    for instances in groups[0]["instances"]:
        for item in groups[instances["group"]]["items"]:
            listed = instances.get("link_sets", item.get("link_sets", []))
            linked[instances["path"], item["path"]] = (0 in listed) != chosen["excludes"]
    assert linked == {
        ("/Inner", "/Inner/Protos/A"): False,
        ("/Inner", "/Inner/Protos/B"): True,
        ("/Outer", "/Elsewhere"): False,
        ("/Free", "/Elsewhere"): True,
    }


# What lacks, and what is broken


def test_what_is_not_supported_is_named():
    description = read(LIGHTS)
    assert warned(description, "light")[0]["places"] == ["</World/Dome>.portals"]
    stage = in_memory("""
def Xform "X" (prepend apiSchemas = ["LightAPI"]) {}
def Volume "V" (prepend apiSchemas = ["VolumeLightAPI"]) {}
def LightFilter "F" {}
def SphereLight "L" { rel light:filters = </F>
 rel collection:lightLink:includes = [</Gone>, </M/Part>] }
def Mesh "M" { def GeomSubset "Part" {} }
""")
    description = read(stage)
    assert set(lights_of(description)) == {"/L"}
    assert {w["places"][0] for w in warned(description, "unsupported-light")} == {"</X>", "</V>"}
    assert warned(description, "light-filter")[0]["places"] == ["</L>.light:filters"]
    assert {w["message"].split(":")[0].split()[0] for w in warned(description, "light-link")} == {
        "</Gone>",
        "</M/Part>",
    }


@pytest.mark.parametrize(
    ("type_name", "line", "place"),
    [
        ("SphereLight", "float inputs:radius = nan", "</L>.inputs:radius"),
        ("SphereLight", "float inputs:intensity = inf", "</L>.inputs:intensity"),
        ("RectLight", "color3f inputs:color = (1, nan, 1)", "</L>.inputs:color"),
        ("DomeLight", 'string inputs:exposure = "a lot"', "</L>.inputs:exposure"),
        ("SphereLight", "float inputs:shaping:focus = nan", "</L>.inputs:shaping:focus"),
        ("SphereLight", "color3f inputs:shadow:color = (inf, 0, 0)", "</L>.inputs:shadow:color"),
    ],
)
def test_a_value_that_is_none_costs_that_light(type_name, line, place):
    stage = in_memory(f'def {type_name} "L" {{\n {line}\n}}\ndef SphereLight "Fine" {{}}\n')
    description = read(stage)
    assert set(lights_of(description)) == {"/Fine"}
    assert warned(description, "broken-prim")[0]["places"] == [place]


def test_lights_cost_no_file_until_something_asks(tmp_path):
    profile = tmp_path / "lamp.ies"
    profile.write_text("TILT=NONE\nno numbers\n")
    stage = tmp_path / "stage.usda"
    stage.write_text(f'#usda 1.0\ndef SphereLight "L" {{\nasset inputs:shaping:ies:file = @{profile}@\n}}\n')
    scene = abbe.Scene.from_stage(stage)
    assert not [warning for warning in scene.warnings if "profile" in warning["message"]]
    assert [light["path"] for light in scene.lights()] == ["/L"]
    with pytest.raises(AbbeError, match=r"^/L: its profile .* has 'no' where its number of lamps should be"):
        abbe.Scene.from_stage(stage, missing="error").lights()


# What they come to


def test_colour_temperatures_are_usds():
    for kelvin in (500, 1000, 1234.5, 2000, 3333, 6500, 9876, 10000, 20000):
        stage = Usd.Stage.CreateInMemory()
        light = UsdLux.SphereLight.Define(stage, "/L")
        light.CreateEnableColorTemperatureAttr(True)
        light.CreateColorTemperatureAttr(kelvin)
        expected = UsdLux.BlackbodyTemperatureAsRgb(kelvin)
        # USD's is in single precision.
        assert compiled(stage)["/L"]["emission"] == pytest.approx(list(expected), rel=2e-6, abs=1e-6), kelvin


def test_lights_come_to_what_the_formulas_say():
    lights = compiled(LIGHTS)
    names = ["Distant", "Dome", "NewDome", "UprightDome", "Rect", "Key", "Spot", "Point", "Tube", "Old", "Set/Panel"]
    assert set(lights) == {f"/World/{name}" for name in [*names, "Glow"]}
    half = math.radians(0.5)
    assert lights["/World/Distant"]["emission"][0] == pytest.approx(50000 / (math.pi * math.sin(half) ** 2), rel=1e-12)
    stage = Usd.Stage.Open(str(LIGHTS))
    turn = np.array(UsdGeom.XformCache(1).GetLocalToWorldTransform(stage.GetPrimAtPath("/World/Distant")))
    assert lights["/World/Distant"]["direction"] == pytest.approx(-turn[2, :3], abs=1e-12)
    rect = lights["/World/Rect"]
    assert rect["area"] == pytest.approx(2 * 2 * 4 * 3) and rect["emission"][0] == pytest.approx(1 / 48)
    assert rect["direction"] == [0, 0, -1] and rect["power"] == pytest.approx(math.pi)
    key = lights["/World/Key"]
    assert key["spectrum"] == "blackbody 3200 K" and key["group"] == "key" and key["shaped"]
    assert key["emission"] == pytest.approx([40, 20, 10]) and key["position"] == [0, 3, 4]
    point = lights["/World/Point"]
    assert point["kind"] == "point" and point["area"] is None and point["power"] == pytest.approx(math.pi)
    tube = lights["/World/Tube"]
    assert tube["power"] == pytest.approx(math.pi * 2 * math.pi * 0.1 * 3)
    spot = lights["/World/Spot"]
    assert spot["illuminates"] == "/World/Spot.collection:lightLink"
    assert spot["shadowed_by"] == "/World/Spot.collection:shadowLink"
    # The profile is within the fallback's cone of 90° and its mean over that hemisphere is 1: half of what it would be.
    assert spot["power"] == pytest.approx(math.pi * math.pi / 2, rel=5e-3)
    assert lights["/World/Dome"]["texture"] == "missing_sky.exr"
    assert lights["/World/NewDome"]["emission"] == [2, 2, 2]


def test_physical_illuminants_are_read():
    stage = in_memory("""
def SphereLight "Table" { token physical:illuminant = "custom"
 float2[] physical:customIlluminant = [(400, 1), (700, 2)] }
def SphereLight "Body" { token physical:illuminant = "blackbody"
 float inputs:colorTemperature = 15000 }
def SphereLight "White" { token physical:illuminant = "white"
 bool inputs:enableColorTemperature = 1 }
def SphereLight "Ours" { token physical:illuminant = "white"
 uniform token abbe:illuminant = "table"
 uniform double2[] abbe:spectrum:table = [(500, 1), (600, 1)] }
def SphereLight "Wrong" { uniform token abbe:illuminant = "HP1" }
def SphereLight "Warm" { uniform token abbe:illuminant = "D50" }
def SphereLight "Empty" { uniform token abbe:illuminant = "table"
 uniform double2[] abbe:spectrum:table = [(500, nan), (600, 1)] }
""")
    scene = abbe.Scene.from_stage(stage)
    illuminants = {light["path"]: light["spectrum"] for light in scene.lights()}
    assert illuminants == {
        "/Table": "table",
        "/Body": "blackbody 15000 K",
        "/White": "D65",
        "/Ours": "table",
        "/Wrong": "D65",
        "/Warm": "daylight",
        "/Empty": "D65",
    }
    assert all(light["emission"] == [1, 1, 1] for light in scene.lights())
    places = {warning["places"][0] for warning in scene.warnings if warning["kind"] == "light"}
    assert places == {"/Wrong.abbe:illuminant", "/Empty.abbe:spectrum:table"}


def test_lights_of_prototypes_shine_at_every_place():
    stage = in_memory("""
def PointInstancer "Street" {
    rel prototypes = </Street/Lamp>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (5, 0, 0), (9, 0, 0)]
    float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1)]
    int64[] invisibleIds = [2]
    def Xform "Lamp" {
        def Sphere "Post" {}
        def SphereLight "Bulb" { double3 xformOp:translate = (0, 3, 0)
 uniform token[] xformOpOrder = ["xformOp:translate"] }
    }
}
""")
    scene = abbe.Scene.from_stage(stage)
    lights = scene.lights()
    assert [light["position"] for light in lights] == [[0, 3, 0], [5, 6, 0]]
    assert [light["area"] for light in lights] == pytest.approx([math.pi, 4 * math.pi])
    UsdGeom.PointInstancer(stage.GetPrimAtPath("/Street")).GetProtoIndicesAttr().Set([0] * 70_000)
    UsdGeom.PointInstancer(stage.GetPrimAtPath("/Street")).GetPositionsAttr().Set([(i, 0, 0) for i in range(70_000)])
    stage.GetPrimAtPath("/Street").RemoveProperty("scales")
    stage.GetPrimAtPath("/Street").RemoveProperty("invisibleIds")
    assert abbe.Scene.from_stage(stage).lights() == []


def test_the_plan_says_that_lights_are_skipped():
    (plan,) = abbe.Scene.from_stage(LIGHTS).plans()
    (decision,) = [entry for entry in plan.fields["skipped"] if entry["what"].startswith("lights")]
    assert decision["what"] == "lights (1 cylinder, 1 disk, 1 distant, 3 dome, 2 geometry, 1 rect, 4 sphere)"
    assert "differentials" in decision["why"]


def test_the_command_lists_them():
    command = [sys.executable, "-m", "abbe", "lights", str(LIGHTS), "--quiet"]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = dict(line.split("  ", 1) for line in run.stdout.splitlines())
    assert lines["/World/Tube"] == "cylinder, emission (1, 1, 1), area 1.88496, power 5.92176, at (0, 0, 0)"
    page = (ROOT / "docs" / "lights.md").read_text(encoding="utf-8")
    assert f"/World/Key  {lines['/World/Key']}\n" in page
    assert len(lines) == 12


# Stages that nobody here wrote

EXPECTED = {
    "Arnold_render_lights/test_0139/data/test.usda": {"sphere": 1},
    "Arnold_render_lights/test_0140/data/test.usda": {"sphere": 1},
    "Arnold_render_lights/test_0193/data/scene.usda": {"sphere": 2},
    "Arnold_render_lights/test_0215/data/test.usda": {"dome": 1},
    "Arnold_render_lights/test_1405/data/test.usda": {"dome": 1},
    "Arnold_render_lights/test_2439.1/data/cylinder.usda": {"cylinder": 1},
    "Arnold_render_lights/test_2439.3/data/disk.usda": {"disk": 1},
    "Arnold_render_lights/test_2439.5/data/rect.usda": {"rect": 1},
    "Arnold_render_lights/test_2441/data/test.usda": {"distant": 1},
    "Arnold_render_lights/test_2549/data/test.usda": {"sphere": 2},
    "Pixar_MaterialXGlass/mxLights.usda": {"distant": 2, "disk": 1},
    "Pixar_MaterialXvsNative/nativeNormalMap.usda": {"sphere": 2},
    "Pixar_lights/testUsdImagingGLDomeLight/invisDome.usda": {},
    "Pixar_lights/testUsdImagingGLDomeLight/multiDomeLights.usda": {"dome": 2},
    "Pixar_lights/testUsdLuxLinkingAPI/linking_example.usda": {"sphere": 8},
    "Pixar_lights/testUsdviewLightVisibility/test.usda": {"sphere": 2},
    "StandardShaderBall/standard_shader_ball_scene.usda": {"rect": 5},
    "tinyusdz_models/models/texture-channel-001.usda": {"sphere": 1},
}


@pytest.mark.skipif(not ASSETS.exists(), reason="the shared assets are not here")
@pytest.mark.parametrize("name", EXPECTED)
def test_lights_of_others_have_the_values_that_usd_reads(name):
    path = ASSETS / name
    description = read(path)
    lights = lights_of(description)
    kinds = [next(iter(light["shape"])) for light in lights.values()]
    assert {kind: kinds.count(kind) for kind in kinds} == EXPECTED[name]
    time = description.document["stage"].get("time_code")
    time = Usd.TimeCode.EarliestTime() if time is None else time
    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.XformCache(time)
    for light_path, light in lights.items():
        prim = stage.GetPrimAtPath(light_path)
        for key, field in COMMON.items():
            older = prim.GetAttribute(key)
            attribute = prim.GetAttribute(f"inputs:{key}")
            if older and older.HasAuthoredValue() and not attribute.HasAuthoredValue():
                attribute = older
            assert light[field] == value(attribute, time), (light_path, key)
        world = np.array(light.get("transform", np.eye(4))).reshape(4, 4)
        assert np.array_equal(world, np.array(cache.GetLocalToWorldTransform(prim))), light_path
    assert not warned(description, "broken-prim")


@pytest.mark.skipif(not ASSETS.exists(), reason="the shared assets are not here")
def test_a_profile_of_1986_shapes_its_light():
    lights = compiled(ASSETS / "Arnold_render_lights/test_0140/data/test.usda")
    (light,) = lights.values()
    # 6526 cd along the axis, times the multiplier; nothing is left of the plain sphere's power.
    plain = math.pi * light["area"] * light["emission"][0]
    assert light["shaped"] and light["power"] > plain
