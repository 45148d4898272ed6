"""Features of USD one by one, each on a small stage, against USD's own answers where it has one."""

import numpy as np
import pytest
from description_schema import validate
from instances_oracle import unrolled

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Tf, Usd, UsdGeom

from abbe.usd import describe

HEAD = "#usda 1.0\n"


def in_memory(text):
    layer = Sdf.Layer.CreateAnonymous("features.usda")
    assert layer.ImportFromString(HEAD + text)
    return Usd.Stage.Open(layer)


def checked(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    return description


def placed(description):
    """World matrix of every placed prim."""
    return {path: world for path, _, world, _ in unrolled(description)}


def by_usd(stage, time=None, purposes=("default", "render")):
    """What USD says is shown, and where: spheres, those inside native instances included."""
    time = Usd.TimeCode.EarliestTime() if time is None else time
    cache = UsdGeom.XformCache(time)
    found = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        imageable = UsdGeom.Imageable(prim)
        if not prim.IsA(UsdGeom.Sphere) or imageable.ComputeVisibility(time) == UsdGeom.Tokens.invisible:
            continue
        if imageable.ComputePurpose() in purposes:
            found[str(prim.GetPath())] = np.array(cache.GetLocalToWorldTransform(prim))
    return found


def assert_agrees(stage, expected=None, **options):
    """Check that the bridge places what USD shows, and that this is ``expected``."""
    theirs = by_usd(stage)
    ours = placed(checked(stage, **options))
    assert set(ours) == set(theirs)
    for path, world in theirs.items():
        assert np.array_equal(ours[path], world), path
    if expected is not None:
        assert set(ours) == set(expected)
    return ours


def op(value, order):
    return f" {value}\n uniform token[] xformOpOrder = [{', '.join(map(repr, order))}]\n".replace("'", '"')


# Composition


def test_nested_native_instances_with_variants():
    text = """class Xform "_Leaf"
{
 def Sphere "S"
 {
 }
}
class Xform "_Tree" (
 prepend variantSets = "season"
 variants = {
  string season = "summer"
 }
)
{
 variantSet "season" = {
  "summer" {
   def Xform "L1" (
    instanceable = true
    inherits = </_Leaf>
   )
   {
    double3 xformOp:translate = (1, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
   }
   def Xform "L2" (
    instanceable = true
    inherits = </_Leaf>
   )
   {
   }
  }
  "winter" {
   def Sphere "Snow"
   {
   }
  }
 }
}
def Xform "World"
{
 double3 xformOp:scale = (1, 2, 3)
 uniform token[] xformOpOrder = ["xformOp:scale"]
 def Xform "A" (
  instanceable = true
  inherits = </_Tree>
 )
 {
  double3 xformOp:translate = (5, 0, 0)
  uniform token[] xformOpOrder = ["xformOp:translate"]
 }
 def Xform "B" (
  instanceable = true
  inherits = </_Tree>
 )
 {
 }
 def Xform "C" (
  instanceable = true
  inherits = </_Tree>
  variants = {
   string season = "winter"
  }
 )
 {
 }
}
"""
    stage = in_memory(text)
    summer = {f"/World/{tree}/{leaf}/S" for tree in "AB" for leaf in ("L1", "L2")}
    assert_agrees(stage, {*summer, "/World/C/Snow"})
    description = checked(stage)
    # Every leaf shares one shape, and carries the name of its outermost instance.
    assert len(description.document["shapes"]) == 2
    assert {item["instance"] for item in description.document["groups"][0]["items"]} == {
        "/World/A",
        "/World/B",
        "/World/C",
    }
    chosen = checked(stage, variants=["/World/A{season=winter}"])
    assert set(placed(chosen)) == {"/World/A/Snow", "/World/B/L1/S", "/World/B/L2/S", "/World/C/Snow"}


def test_references_relocates_and_specializes_compose(tmp_path):
    (tmp_path / "part.usda").write_text(
        HEAD
        + '(\n defaultPrim = "P"\n)\ndef Xform "P"\n{\n def Xform "Old"\n {\n  def Sphere "S"\n  {\n   double radius'
        " = 3\n  }\n }\n}\n"
    )
    relocates = "" if Usd.GetVersion() < (0, 24, 5) else "(\n relocates = {\n  </A/Old> : </A/New>\n }\n)\n"
    (tmp_path / "stage.usda").write_text(
        HEAD
        + relocates
        + 'def Xform "A" (\n references = @part.usda@\n)\n{\n}\n'
        + 'class Sphere "_Base"\n{\n double radius = 2\n}\n'
        + 'def Sphere "Special" (\n specializes = </_Base>\n)\n{\n}\n'
    )
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    assert_agrees(stage, {"/A/New/S" if relocates else "/A/Old/S", "/Special"})
    radii = [shape["sphere"]["radius"] for shape in checked(tmp_path / "stage.usda").document["shapes"]]
    assert sorted(radii) == [2.0, 3.0]


def test_units_and_axes_of_referenced_layers_are_not_corrected(tmp_path):
    """USD does not, and a pipeline that does says so in a transform."""
    (tmp_path / "metres.usda").write_text(
        HEAD + '(\n defaultPrim = "P"\n metersPerUnit = 1\n upAxis = "Z"\n)\ndef Sphere "P"\n{\n}\n'
    )
    (tmp_path / "stage.usda").write_text(
        HEAD + '(\n metersPerUnit = 0.01\n upAxis = "Y"\n)\ndef "A" (\n references = @metres.usda@\n)\n{\n}\n'
    )
    description = checked(tmp_path / "stage.usda")
    assert description.document["stage"]["meters_per_unit"] == 0.01
    assert description.document["stage"]["up_axis"] == "Y"
    assert np.array_equal(placed(description)["/A"], np.eye(4))


def test_inactive_undefined_and_abstract_prims_are_not_there():
    text = """class Sphere "Abstract"
{
}
over Sphere "Over"
{
}
def Xform "Off" (
 active = false
)
{
 def Sphere "S"
 {
 }
}
def "NoType"
{
 def Sphere "S"
 {
 }
}
def Scope "Scope"
{
 def Sphere "S"
 {
 }
}
"""
    assert_agrees(in_memory(text), {"/NoType/S", "/Scope/S"})


# Transforms


@pytest.mark.parametrize(
    ("value", "order"),
    [
        (
            "double3 xformOp:translate:pivot = (1, 2, 3)\n float3 xformOp:rotateZYX = (10, 20, 30)",
            ["xformOp:translate:pivot", "xformOp:rotateZYX", "!invert!xformOp:translate:pivot"],
        ),
        (
            "matrix4d xformOp:transform = ((1, 0.5, 0, 0), (0.25, 1, 0, 0), (0, -3, 2, 0), (7, 8, 9, 1))",
            ["xformOp:transform"],
        ),
        (
            "matrix4d xformOp:transform:a = ((1, 0.5, 0, 0), (0.25, 1, 0, 0), (0, -3, 2, 0), (7, 8, 9, 1))\n"
            " double xformOp:rotateX = 33",
            ["!invert!xformOp:transform:a", "xformOp:rotateX", "xformOp:transform:a"],
        ),
        (
            "quatd xformOp:orient = (0.6, 0, 0.8, 0)\n half3 xformOp:scale = (1, -2, 3)",
            ["xformOp:orient", "xformOp:scale"],
        ),
        ("double xformOp:translateX = 3\n double xformOp:scaleY = 4", ["xformOp:translateX", "xformOp:scaleY"]),
        ("double3 xformOp:translate = (1, 2, 3)", ["!resetXformStack!", "xformOp:translate"]),
        ("double3 xformOp:translate = (1, 2, 3)", []),
    ],
)
def test_every_kind_of_op_is_as_usd_computes_it(value, order):
    if any("translateX" in name for name in order) and not hasattr(UsdGeom.XformOp, "TypeTranslateX"):
        pytest.skip("single-axis translations are newer than this USD")
    text = 'def Xform "X"\n{\n' + op("double3 xformOp:scale = (2, 3, 4)", ["xformOp:scale"])
    text += ' def Sphere "S"\n {\n' + op(value, order) + " }\n}\n"
    assert_agrees(in_memory(text), {"/X/S"})


# Visibility


def test_visibility_of_purposes():
    """The nearest authored opinion decides, as in USD; guides that were asked for need none."""
    api = '(\n prepend apiSchemas = ["VisibilityAPI"]\n)\n{\n'
    kinds = "".join(
        f'def Sphere "{purpose}"\n{{\n uniform token purpose = "{purpose}"\n}}\n'
        for purpose in ("default", "render", "proxy", "guide")
    )
    text = f"""def Xform "Plain"
{{
{kinds}}}
def Xform "Hidden" {api} uniform token renderVisibility = "invisible"
 uniform token proxyVisibility = "invisible"
 uniform token guideVisibility = "invisible"
{kinds} def Xform "Shown" {api}  uniform token renderVisibility = "visible"
  uniform token guideVisibility = "inherited"
{kinds} }}
}}
def Xform "Unsaid" {api}{kinds}}}
"""
    stage = in_memory(text)
    shown = set(placed(checked(stage, purposes=["render", "proxy", "guide"])))
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Sphere):
            continue
        imageable = UsdGeom.Imageable(prim)
        purpose = imageable.ComputePurpose()
        effective = imageable.ComputeEffectiveVisibility(purpose)
        authored = any(
            prim.GetStage().GetAttributeAtPath(path.AppendProperty(f"{purpose}Visibility")).HasAuthoredValue()
            for path in prim.GetPath().GetPrefixes()
            if prim.GetStage().GetPrimAtPath(path).HasAPI(UsdGeom.VisibilityAPI) and purpose != "default"
        )
        # Where nothing is authored USD has a fallback for guides.
        expected = effective != "invisible" or not authored
        assert (str(prim.GetPath()) in shown) == expected, prim
    assert {path for path in shown if path.startswith("/Hidden")} == {
        "/Hidden/default",
        "/Hidden/Shown/default",
        "/Hidden/Shown/render",
        "/Hidden/Shown/guide",
    }


# What is left out


# What abbe renders; all else that USD declares is named.
_RENDERED = ["Mesh", "Sphere", "Cube", "Plane", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"]


def unsupported():
    """Names of the concrete schemas that draw something and are not rendered."""
    names = []
    for schema in Tf.Type.FindByName("UsdGeomBoundable").GetAllDerivedTypes():
        name = Usd.SchemaRegistry.GetConcreteSchemaTypeName(schema)
        if name and name not in _RENDERED and not schema.IsA(Tf.Type.FindByName("UsdLuxBoundableLightBase")):
            names.append(name)
    return sorted(set(names) - {"PointInstancer", "Skeleton", "SkelRoot", "Procedural", "GenerativeProcedural"})


def test_there_are_kinds_that_are_not_rendered():
    assert {"BasisCurves", "NurbsCurves", "HermiteCurves", "NurbsPatch", "Points", "TetMesh", "Volume"} <= set(
        unsupported()
    )


@pytest.mark.parametrize("name", unsupported())
def test_what_is_not_rendered_is_named_once_with_places_and_a_count(name):
    text = "".join(f'def {name} "P{i}"\n{{\n}}\n' for i in range(7)) + 'def Sphere "S"\n{\n}\n'
    description = checked(in_memory(text))
    assert set(placed(description)) == {"/S"}
    (warning,) = [warning for warning in description.warnings if warning["kind"] == "unsupported-prim"]
    assert warning["count"] == 7
    assert warning["places"] == [f"</P{i}>" for i in range(5)]
    assert warning["message"] == f"{name} prims are not supported; they are left out"


def test_what_is_posed_is_rendered_as_authored():
    text = """def SkelRoot "Root" (
 prepend apiSchemas = ["SkelBindingAPI"]
)
{
 rel skel:skeleton = </Root/Skeleton>
 def Skeleton "Skeleton"
 {
  uniform token[] joints = ["A"]
 }
 def SkelAnimation "Animation"
 {
 }
 def Mesh "Skin"
 {
  uniform token subdivisionScheme = "none"
  point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
  int[] faceVertexCounts = [3]
  int[] faceVertexIndices = [0, 1, 2]
  def BlendShape "Smile"
  {
   vector3f[] offsets = [(0, 0, 1), (0, 0, 1), (0, 0, 1)]
  }
 }
}
"""
    description = checked(in_memory(text))
    assert set(placed(description)) == {"/Root/Skin"}
    warnings = [warning for warning in description.warnings if warning["kind"] == "unsupported-prim"]
    assert [(warning["places"], warning["count"]) for warning in warnings] == [(["</Root>"], 1)]
    assert "skinning is not supported" in warnings[0]["message"]


def test_what_has_no_effect_changes_nothing():
    plain = 'def Camera "C"\n{\n}\ndef Sphere "S"\n{\n}\n'
    decorated = """def Camera "C" (
 prepend apiSchemas = ["ListAPI", "LightListAPI", "CoordSysAPI:here"]
)
{
 rel lightList = </S>
 token lightList:cacheBehavior = "consumeAndContinue"
 rel coordSys:here:binding = </C>
}
def Sphere "S"
{
 float3[] extent = [(-9, -9, -9), (9, 9, 9)]
}
"""
    with_extent, without = checked(in_memory(decorated)), checked(in_memory(plain))
    assert with_extent.document == without.document


def test_what_is_skipped_is_never_read(monkeypatch):
    """Of what nobody asked for, only what says so is read: not an array, not a network."""
    mesh = """ point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
 int[] faceVertexCounts = [3]
 int[] faceVertexIndices = [0, 1, 2]
 uniform token subdivisionScheme = "none"
"""
    text = f"""def Mesh "Hidden"
{{
{mesh} token visibility = "invisible"
}}
def Xform "HiddenParent"
{{
 token visibility = "invisible"
 def Mesh "Child"
 {{
{mesh} }}
}}
def Mesh "Proxy"
{{
{mesh} uniform token purpose = "proxy"
}}
def Mesh "Off" (
 active = false
)
{{
{mesh}}}
def Material "Unused"
{{
 float inputs:x = 1
 token outputs:surface.connect = </Unused/S.outputs:surface>
 def Shader "S"
 {{
  uniform token info:id = "UsdPreviewSurface"
  color3f inputs:diffuseColor.connect = </Unused/T.outputs:rgb>
  token outputs:surface
 }}
 def Shader "T"
 {{
  uniform token info:id = "UsdUVTexture"
  asset inputs:file = @texture.png@
  color3f outputs:rgb
 }}
}}
def Mesh "Shown"
{{
{mesh}}}
def Camera "C"
{{
}}
"""
    read = {}
    original = Usd.Attribute.Get

    def counted(self, *arguments):
        read.setdefault(str(self.GetPrim().GetPath()), set()).add(self.GetName())
        return original(self, *arguments)

    monkeypatch.setattr(Usd.Attribute, "Get", counted)
    description = checked(in_memory(text))
    assert set(placed(description)) == {"/Shown"}
    assert {"points", "faceVertexCounts", "faceVertexIndices"} <= read["/Shown"]
    settling = {"visibility", "purpose"}
    for skipped in ("/Hidden", "/HiddenParent/Child", "/Proxy"):
        assert read[skipped] <= settling, skipped
    assert not any(path.startswith(("/Unused", "/Off")) for path in read)
    assert description.document["skipped"] == {"invisible": 2, "purpose proxy": 1}
    assert description.document["materials"] == [] and set(description.arrays) == {
        "shape0.points",
        "shape0.face_vertex_counts",
        "shape0.face_vertex_indices",
    }
