"""Which material each prim has: strength, collections, purposes, subsets, instances; USD's own answer beside ours."""

import pytest
from description_schema import validate
from pxr import Sdf, Usd, UsdShade

from abbe.usd import describe

STAGE = """#usda 1.0
def Scope "Looks"
{
%s
}
def Xform "World" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:red", "CollectionAPI:all"])
{
    rel material:binding = </Looks/World>
    rel material:binding:collection:red = [</World.collection:red>, </Looks/Red>]
    rel material:binding:collection:strong = [</World.collection:all>, </Looks/Strong>] (
        bindMaterialAs = "strongerThanDescendants"
    )
    rel collection:red:includes = [</World/InRed>, </World/InRedToo>]
    rel collection:all:includes = </World/Overruled>
    def Sphere "Inherits"
    {
    }
    def Sphere "Direct" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </Looks/Direct> }
    def Sphere "InRed"
    {
    }
    def Sphere "InRedToo" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </Looks/Direct> }
    def Sphere "Overruled" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </Looks/Direct> }
    def Sphere "Purposes" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </Looks/Direct>
        rel material:binding:full = </Looks/Full>
        rel material:binding:preview = </Looks/Preview>
    }
    def Mesh "Parts" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token subdivisionScheme = "none"
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        rel material:binding = </Looks/Direct>
        def GeomSubset "Part" (prepend apiSchemas = ["MaterialBindingAPI"])
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </Looks/Part>
        }
    }
    def Xform "Instance" (
        instanceable = true
        prepend references = </Prototype>
    )
    {
    }
}
class Xform "Prototype"
{
    def Sphere "Bound" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </Looks/Direct> }
    def Sphere "Free"
    {
    }
}
def Scope "Render"
{
    def RenderSettings "S" { uniform token[] materialBindingPurposes = %s }
}
"""
NAMES = ("World", "Red", "Strong", "Direct", "Full", "Preview", "Part", "Unused")
MATERIAL = """    def Material "%s"
    {
        token outputs:surface.connect = </Looks/%s/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
        }
    }
"""


def bound(purposes='["full", ""]'):
    text = STAGE % ("".join(MATERIAL % (name, name) for name in NAMES), purposes)
    text = text.replace("{ ", "{\n").replace(" }", "\n}")
    layer = Sdf.Layer.CreateAnonymous("bound.usda")
    assert layer.ImportFromString(text)
    stage = Usd.Stage.Open(layer)
    description = describe(stage, render_settings="/Render/S")
    validate(description.document, description.arrays)
    paths = [m["path"] for m in description.document["materials"]]
    found = {}
    for item in description.document["groups"][0]["items"]:
        name = item["path"].removeprefix("/World/")
        found[name] = paths[item["material"]].rpartition("/")[2] if "material" in item else None
        for k, material in enumerate(item.get("subset_materials", [])):
            found[f"{name}[{k}]"] = None if material is None else paths[material].rpartition("/")[2]
    return stage, found, {path.rpartition("/")[2] for path in paths}


def test_bindings_have_usd_s_strength_and_unused_materials_are_not_read():
    stage, found, materials = bound()
    assert found == {
        "Inherits": "World",
        "Direct": "Direct",
        "InRed": "Red",
        "InRedToo": "Direct",
        "Overruled": "Strong",
        "Purposes": "Full",
        "Parts": "Direct",
        "Parts[0]": "Part",
        "Instance/Bound": "Direct",
        "Instance/Free": "World",
    }
    assert materials == set(NAMES) - {"Preview", "Unused"}
    for path, material in found.items():
        if "[" not in path:
            prim = stage.GetPrimAtPath(f"/World/{path}")
            expected, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("full")
            assert expected.GetPrim().GetName() == material


@pytest.mark.parametrize(
    ("purposes", "expected", "inherits"),
    [
        ('["full", ""]', "Full", "World"),
        # As Houdini writes it.
        ('["full", "allPurpose"]', "Full", "World"),
        ('["preview", ""]', "Preview", "World"),
        ('["preview", "full", ""]', "Preview", "World"),
        ('["none", "full", "preview"]', "Full", None),
        ('[""]', "Direct", "World"),
        ('["", "full"]', "Direct", "World"),
        ('["none"]', None, None),
    ],
)
def test_purposes_count_in_the_order_of_the_settings(purposes, expected, inherits):
    _, found, _ = bound(purposes)
    assert found["Purposes"] == expected and found["Inherits"] == inherits
