"""Cameras, render settings and passes as the description has them: what is authored, by the rules of UsdRender."""

import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd, UsdGeom, UsdRender

from abbe.errors import StageError, UsageError
from abbe.usd import describe, list_settings


def in_memory(text):
    """A stage in memory from .usda text."""
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


def read(text, **options):
    """Describe a stage, checked against the schema."""
    description = describe(in_memory(text), **options)
    validate(description.document, description.arrays)
    return description


def warned(description, kind):
    """The messages of a kind of warnings."""
    return [warning["message"] for warning in description.warnings if warning["kind"] == kind]


# Cameras


def test_clipping_crosses_and_says_whether_it_is_authored():
    cameras = read(
        """
        def Camera "Plain"
        {
        }
        def Camera "Cut"
        {
            float2 clippingRange = (0.5, 50)
            float4[] clippingPlanes = [(1, 0, 0, 0), (0, 0.5, -0.5, 2)]
        }
        def RenderSettings "Settings"
        {
            rel camera = </Cut>
            rel products = </P>
        }
        def RenderProduct "P"
        {
            rel camera = </Plain>
        }
        """
    ).document["cameras"]
    cut, plain = cameras
    assert (cut["clipping_range"], cut["clipping_authored"]) == ([0.5, 50.0], True)
    assert cut["clipping_planes"] == [[1, 0, 0, 0], [0, 0.5, -0.5, 2]]
    stage = Usd.Stage.CreateInMemory()
    fallback = list(UsdGeom.Camera.Define(stage, "/C").GetClippingRangeAttr().Get())
    assert (plain["clipping_range"], plain["clipping_authored"]) == (fallback, False)
    assert "clipping_planes" not in plain and "exposure" not in plain
    with pytest.raises(StageError, match="clippingPlanes"):
        read('def Camera "C"\n{\n    float4[] clippingPlanes = [(1, 0, inf, 0)]\n}')


def test_what_is_authored_of_the_exposure_crosses():
    text = """def Camera "C" {
        float exposure = -1.5
        float exposure:iso = 400
        float exposure:fStop = 4
    }"""
    assert read(text).document["cameras"][0]["exposure"] == {"stops": -1.5, "iso": 400.0, "f_stop": 4.0}


# Settings: UsdRenderComputeSpec, whose rules are those of its source.

SETTINGS = """
def Camera "Main"
{
}
def Camera "Side"
{
}
def RenderSettings "Settings"
{
    rel camera = </Main>
    rel products = [</A>, </B>]
    uniform int2 resolution = (64, 48)
    uniform float pixelAspectRatio = 2
    uniform token aspectRatioConformPolicy = "cropAperture"
    uniform bool disableDepthOfField = 1
    uniform int abbe:samples = 4
    uniform int abbe:seed = 1
    uniform int abbe:seed.connect = </Source.seed>
}
def Scope "Source"
{
    int seed = 42
    int loop
    int loop.connect = </Source.loop>
}
def RenderProduct "A"
{
    token productName = "a.exr"
}
def RenderProduct "B"
{
    token productName = "b.exr"
    rel camera = </Side>
    uniform float4 dataWindowNDC = (-0.25, 0, 1.25, 1)
    uniform token aspectRatioConformPolicy = "adjustApertureWidth"
    uniform bool disableDepthOfField = 0
    uniform int abbe:samples = 8
    custom string outputs:driver:parameters:artist = "not ours"
    string driver:parameters:comment.connect = </Source.loop>
}
"""


def test_products_are_the_settings_with_what_they_author_themselves():
    document = read(SETTINGS).document
    a, b = document["settings"]["products"]
    shared = {"resolution": [64, 48], "pixel_aspect_ratio": 2.0}
    for product, expected in (
        (a, {"aspect_ratio_conform_policy": "cropAperture", "disable_depth_of_field": True, "camera": 0, "abbe": {}}),
        (b, {"aspect_ratio_conform_policy": "adjustApertureWidth", "disable_depth_of_field": False, "camera": 1}),
    ):
        assert {name: product[name] for name in (shared | expected)} == shared | expected
    assert (a["data_window_ndc"], b["data_window_ndc"]) == ([0, 0, 1, 1], [-0.25, 0, 1.25, 1])
    assert [camera["path"] for camera in document["cameras"]] == ["/Main", "/Side"]
    assert b["abbe"] == {"abbe:samples": {"type": "int", "value": 8}}


def test_connections_beat_values_and_lead_to_theirs():
    description = read(SETTINGS)
    assert description.document["settings"]["abbe"]["abbe:seed"] == {"type": "int", "value": 42}
    # A circle leads to no value, and is named.
    assert description.document["settings"]["products"][1]["driver"] == {}
    places = [w["places"] for w in description.warnings if w["kind"] == "unresolved-connection"]
    assert places == [["</B>.driver:parameters:comment"]]


def test_a_camera_that_is_asked_for_replaces_those_of_products():
    document = read(SETTINGS, camera="/Side").document
    assert [camera["path"] for camera in document["cameras"]] == ["/Side"]
    assert ["camera" in product for product in document["settings"]["products"]] == [False, False]


def test_a_name_for_each_frame_is_taken_as_it_is():
    text = """
    def RenderSettings "Settings"
    {
        rel products = [</Sampled>, </Plain>]
    }
    def RenderProduct "Sampled"
    {
        token productName.timeSamples = {
            1: "one.$F4.exr",
            2: "two.exr",
        }
    }
    def RenderProduct "Plain"
    {
        token productName = "<OS>.<N>.$F4.exr"
    }
    """
    names = [product["name"] for product in read(text, frame=1.0).document["settings"]["products"]]
    assert names == ["one.$F4.exr", "Plain.1.0001.exr"]


# Passes

PASSES = """
def Xform "World"
{
    def Sphere "Ball"
    {
    }
    def Sphere "Hidden"
    {
    }
    def Xform "Set"
    {
        def Sphere "Wall"
        {
        }
        def Sphere "Floor"
        {
        }
    }
    def PointInstancer "Many"
    {
        rel prototypes = </World/Many/Proto>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (1, 0, 0)]
        def Sphere "Proto"
        {
        }
    }
    def Camera "C"
    {
    }
}
def Scope "Render"
{
    def RenderSettings "One"
    {
        uniform int2 resolution = (8, 8)
    }
    def RenderSettings "Two"
    {
        uniform int2 resolution = (16, 16)
    }
    def RenderPass "Pass"
    {
        rel renderSource = [</Render/Two>, </Render/One>]
        %s
    }
}
"""


def under_pass(collections):
    """The stage under its pass: the items of all groups by path, and the description."""
    description = read(PASSES % collections, render_pass="/Render/Pass")
    items = {item["path"]: item for group in description.document["groups"] for item in group["items"]}
    return items, description


def flags(items, name):
    """The paths of the items that have a flag."""
    return sorted(path for path, item in items.items() if item.get(name))


def test_a_pass_renders_its_settings_and_everything_unless_it_says_otherwise():
    items, description = under_pass("")
    assert description.document["settings"]["base"]["resolution"] == [16, 16]
    assert warned(description, "render-pass") == ["has 2 targets; the first, </Render/Two>, is rendered"]
    assert len(items) == 5 and not flags(items, "hidden_from_camera") and not flags(items, "matte")


@pytest.mark.skipif(not hasattr(UsdRender, "Pass"), reason="this USD has no RenderPass")
def test_collections_of_a_pass_prune_and_show():
    items, description = under_pass("rel collection:prune:includes = </World/Set>")
    assert sorted(items) == ["/World/Ball", "/World/Hidden", "/World/Many/Proto"]
    assert description.document["skipped"] == {"pruned by the render pass": 1}
    items, description = under_pass("rel collection:renderVisibility:excludes = [</World/Ball>, </World/Many>]")
    assert sorted(items) == ["/World/Hidden", "/World/Set/Floor", "/World/Set/Wall"]
    assert description.document["skipped"] == {"not in the render pass": 2}
    only = """uniform bool collection:renderVisibility:includeRoot = 0
        rel collection:renderVisibility:includes = </World/Set/Wall>"""
    assert sorted(under_pass(only)[0]) == ["/World/Set/Wall"]


def test_collections_of_a_pass_hide_from_the_camera_and_hold_out():
    items, _ = under_pass("rel collection:cameraVisibility:excludes = [</World/Hidden>, </World/Set>]")
    assert flags(items, "hidden_from_camera") == ["/World/Hidden", "/World/Set/Floor", "/World/Set/Wall"]
    items, _ = under_pass("rel collection:matte:includes = </World/Ball>")
    assert flags(items, "matte") == ["/World/Ball"]
    # An instancer that is hidden hides what it shows; its prototype is hidden with it, whatever it is by itself.
    items, _ = under_pass("rel collection:cameraVisibility:excludes = </World/Many>")
    assert flags(items, "hidden_from_camera") == ["/World/Many/Proto"]


def test_a_pass_that_cannot_be_rendered_says_why():
    with pytest.raises(StageError, match="there is no </Nowhere>, not a RenderPass: choose one of /Render/Pass"):
        read(PASSES % "", render_pass="/Nowhere")
    with pytest.raises(StageError, match="</Render/One> is a RenderSettings, not a RenderPass"):
        read(PASSES % "", render_pass="/Render/One")
    with pytest.raises(StageError, match=r"</Render/Pass>\.renderSource: .*</World/Ball> is a Sphere"):
        read((PASSES % "").replace("[</Render/Two>, </Render/One>]", "</World/Ball>"), render_pass="/Render/Pass")
    with pytest.raises(StageError, match=r"@other\.usda@: render that file"):
        read(PASSES % "uniform asset fileName = @other.usda@", render_pass="/Render/Pass")
    with pytest.raises(UsageError, match="give one of the two"):
        read(PASSES % "", render_pass="/Render/Pass", render_settings="/Render/One")
    _, description = under_pass('uniform string[] command = ["prman"]')
    assert "its command is not run: the pass is rendered here" in warned(description, "render-pass")


def test_settings_are_listed_with_their_windows_and_passes():
    one, two = list_settings(in_memory(PASSES % ""), frame=None)
    assert (one.passes, two.passes) == ((), ("/Render/Pass",))
    (settings,) = list_settings(in_memory(SETTINGS), frame=None)
    a, b = settings.products
    assert (a.aspect_ratio_conform_policy, b.data_window_ndc) == ("cropAperture", (-0.25, 0, 1.25, 1))
    assert (a.pixel_aspect_ratio, a.disable_depth_of_field, b.disable_depth_of_field) == (2.0, True, False)
