"""Broken stages: what belongs to one prim is left out and named; what was asked for and cannot be had is an error.

The rule stands in docs/usd.md.
"""

import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from abbe.errors import StageError
from abbe.usd import describe

_core = pytest.importorskip("abbe._core")

GOOD = """#usda 1.0
def Sphere "Good"
{
}
def Camera "Shot"
{
 float2 clippingRange = (0.01, 1e30)
}
"""
TRIANGLE = {
    "points": "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
    "counts": "[3]",
    "indices": "[0, 1, 2]",
    "scheme": "none",
    "more": "",
}


def mesh(**changes):
    values = {**TRIANGLE, **changes}
    return f"""def Mesh "Bad"
{{
 uniform token subdivisionScheme = "{values["scheme"]}"
 point3f[] points = {values["points"]}
 int[] faceVertexCounts = {values["counts"]}
 int[] faceVertexIndices = {values["indices"]}
 {values["more"]}
}}
"""


def sphere(text, name="Bad"):
    return f'def Sphere "{name}"\n{{\n {text}\n}}\n'


def moved(value, op):
    return sphere(f'{value}\n uniform token[] xformOpOrder = ["{op}"]')


def instancer(more="", indices="[0, 0]", positions="[(2, 0, 0), (4, 0, 0)]", prototypes="</Bad/P>", name="Bad"):
    return f"""def PointInstancer "{name}"
{{
 int[] protoIndices = {indices}
 point3f[] positions = {positions}
 rel prototypes = {prototypes}
 {more}
 def Sphere "P"
 {{
 }}
}}
"""


def bound(network, target="/M"):
    return f"""def Sphere "Bad" (
 prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
 rel material:binding = <{target}>
}}
{network}"""


def primvar(name, type_name, value, interpolation="vertex", more=""):
    return f'{type_name} {name} = {value} (\n interpolation = "{interpolation}"\n)\n {more}'


BIG = 2**31 - 1
MATRIX = "matrix4d xformOp:transform = ((1, 0, 0, {}), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, {}))"
SUBSET = (
    'def GeomSubset "S"\n {\n  uniform token familyName = "materialBind"\n'
    '  uniform token elementType = "face"\n  int[] indices = [5]\n }'
)
CYCLIC_INPUT = """def Material "M"
{
 token outputs:surface.connect = </M/A.outputs:surface>
 def Shader "A"
 {
  uniform token info:id = "UsdPreviewSurface"
  float inputs:ior.connect = </M/B.outputs:o>
  token outputs:surface
 }
 def NodeGraph "B"
 {
  float inputs:i.connect = </M/B.outputs:o>
  float outputs:o.connect = </M/B.inputs:i>
 }
}
"""
CYCLIC_SURFACE = """def Material "M"
{
 token outputs:surface.connect = </M/B.outputs:o>
 def NodeGraph "B"
 {
  token outputs:o.connect = </M.outputs:surface>
 }
}
"""
CYCLIC_COLLECTIONS = """def Xform "Bad" (
 prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:a", "CollectionAPI:b"]
)
{
 rel collection:a:includes = </Bad.collection:b>
 rel collection:b:includes = </Bad.collection:a>
 rel material:binding:collection:x = [</Bad.collection:a>, </M>]
 def Sphere "S"
 {
 }
}
def Material "M"
{
}
"""

# What is on the stage beside a good sphere; how many objects of it are kept (of an instancer that leaves some of its
# elements out the whole array, of a mesh without area the prim); kind and place of the warning, and a part of it.
LEFT_OUT = {
    "index above the points": (mesh(indices="[0, 1, 3]"), 0, "broken-shape", "/Bad.faceVertexIndices", "index 2 is 3"),
    "index below 0": (mesh(indices="[0, 1, -3]"), 0, "broken-shape", "/Bad.faceVertexIndices", "index 2 is -3"),
    "too few indices": (mesh(counts="[4]"), 0, "broken-shape", "/Bad.faceVertexCounts", "up to 4"),
    "a face of -3 corners": (mesh(counts="[-3]"), 0, "broken-shape", "/Bad.faceVertexCounts", "-3 corners"),
    "faces of 2^31 corners": (mesh(counts=f"[{BIG}, {BIG}, {BIG}]"), 0, "broken-shape", "/Bad.faceVertexCounts", "644"),
    "a point that is not finite": (
        mesh(points="[(0, 0, nan), (1, 0, 0), (0, 1, 0)]"), 0, "broken-shape", "/Bad.points", "point 0 is not finite"
    ),
    "no area": (mesh(points="[(0, 0, 0), (1, 0, 0), (2, 0, 0)]"), 1, "empty-mesh", "/Bad", "no face with an area"),
    "no points": (mesh(points="[]"), 0, "empty-mesh", "</Bad>", "no points or no faces"),
    "points that are a number": (
        mesh().replace("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]", "int points = 3"),
        0, "unreadable-attribute", "</Bad>.points", "not an array of 3 floats",
    ),
    "an unknown interpolation": (
        mesh(more=primvar("primvars:st", "texCoord2f[]", "[(0, 0)]", "sideways")),
        1, "unreadable-attribute", "</Bad>.primvars:st", "interpolation 'sideways' is unknown",
    ),
    "a radius that is not finite": (sphere("double radius = nan"), 0, "broken-prim", "</Bad>.radius", "is nan"),
    "a radius below 0": (sphere("double radius = -1"), 0, "broken-shape", "/Bad.radius", "is -1"),
    "a radius of 0": (sphere("double radius = 0"), 0, "empty-shape", "/Bad", "a size is 0"),
    "scaled to nothing": (
        moved("double3 xformOp:scale = (1, 0, 1)", "xformOp:scale"), 0, "singular-transform", "/Bad", "flattens"
    ),
    "scaled beyond all numbers": (
        moved("double3 xformOp:scale = (1e300, 1e300, 1e300)", "xformOp:scale"), 0, "singular-transform", "/Bad", ""
    ),
    "a sheet of 1e-300": (
        moved("double3 xformOp:scale = (1e-300, 1, 1)", "xformOp:scale"), 0, "singular-transform", "/Bad", "flattens"
    ),
    "a translation that is none": (
        moved("double3 xformOp:translate = (nan, 0, 0)", "xformOp:translate"), 0, "broken-prim", "</Bad>", "not finite"
    ),
    "the inverse of no scale": (
        moved("double3 xformOp:scale = (0, 1, 1)", "!invert!xformOp:scale"), 0, "broken-prim", "</Bad>", "not finite"
    ),
    "projective": (moved(MATRIX.format(1, 1), "xformOp:transform"), 0, "broken-prim", "</Bad>", "is projective"),
    "scaled by w": (moved(MATRIX.format(0, 2), "xformOp:transform"), 0, "broken-prim", "</Bad>", "is projective"),
    "an unknown op": (
        moved("double3 xformOp:spin = (1, 0, 0)", "xformOp:spin"), 0, "broken-prim", "</Bad>", "opType token 'spin'"
    ),
    "an op of the wrong type": (
        moved('string xformOp:translate = "x"', "xformOp:translate"), 0, "broken-prim", "</Bad>", "TypeTranslate"
    ),
    "a parent with an unknown op": (
        'def Xform "Bad"\n{\n double3 xformOp:spin = (1, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:spin"]\n'
        + sphere("", "A") + sphere("", "B") + "}\n",
        0, "broken-prim", "</Bad>", "all below stands nowhere",
    ),
    "too few positions": (
        instancer(indices="[0, 0, 0]"), 0, "instancer", "</Bad>.positions", "has 2 values for 3 elements"
    ),
    "prototype 9": (instancer(indices="[0, 9]"), 1, "instancer", "</Bad>.protoIndices", "1 of 2 elements name no"),
    "an instance nowhere": (
        instancer(positions="[(nan, 0, 0), (4, 0, 0)]"), 2, "singular-transform", "/Bad", "1 instances"
    ),
    "an instance without size": (
        instancer("float3[] scales = [(0, 0, 0), (1, 1, 1)]"), 2, "singular-transform", "/Bad", "1 instances"
    ),
    "too few ids": (instancer("int64[] ids = [1]"), 2, "instancer", "</Bad>.ids", "nothing is masked"),
    "a prototype that is the instancer": (
        instancer(prototypes="</Bad>"), 0, "instancer", "</Bad>", "its prototype </Bad> contains it"
    ),
    "prototypes of each other": (
        instancer(prototypes="</Other>") + instancer(prototypes="</Bad>", name="Other"), 0, "instancer", "</Bad>", "con"
    ),
    "no such prototype": (
        instancer(prototypes="</Nope>"), 0, "missing-prototype", "</Bad>.prototypes", "there is no prim </Nope>"
    ),
    "bound to itself": (bound("", "/Bad"), 1, "missing-material", "</Bad>", "which is no material"),
    "bound to nothing": (bound("", "/Nope"), 1, "missing-material", "</Bad>", "</Nope>, which is no material"),
    "an input that drives itself": (
        bound(CYCLIC_INPUT), 1, "dangling-connection", "</M/A>.inputs:ior", "lead back to themselves"
    ),
    "a surface that is itself": (bound(CYCLIC_SURFACE), 1, "dangling-connection", "</M>.outputs:surface", "no shader"),
    "collections of each other": (CYCLIC_COLLECTIONS, 1, None, "", ""),
    "references of each other": (
        'def Sphere "Bad" (\n references = </B>\n)\n{\n}\ndef Xform "B" (\n references = </Bad>\n)\n{\n}\n',
        1, "composition-error", "</Bad>", "Cycle detected",
    ),
    "a reference to nothing": (
        'def Sphere "Bad" (\n references = @no.usda@\n)\n{\n}\n', 1, "missing-reference", "</Bad>", "@no.usda@"
    ),
    "a payload of nothing": (
        'def Sphere "Bad" (\n payload = @no.usda@\n)\n{\n}\n', 1, "missing-reference", "</Bad>", "@no.usda@"
    ),
    "a reference to no prim": (
        'def Sphere "Bad" (\n references = </Nope>\n)\n{\n}\n', 1, "missing-reference", "</Bad>", "</Nope>"
    ),
    "a type that nobody knows": ('def Foo "Bad"\n{\n}\n', 0, "unknown-prim-type", "</Bad>", "declares Foo"),
    "100 prims in each other": ('def Xform "x"\n{\n' * 100 + sphere("") + "}\n" * 100, 1, None, "", ""),
    "1e300 in radius": (sphere("double radius = 1e300"), 1, None, "", ""),
    "1e300 away": (moved("double3 xformOp:translate = (1e300, 0, 0)", "xformOp:translate"), 1, None, "", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_belongs_to_one_prim_is_left_out_and_named(name, tmp_path, capfd):
    text, count, kind, place, words = LEFT_OUT[name]
    (tmp_path / "stage.usda").write_text(GOOD + text)
    description = describe(tmp_path / "stage.usda")
    validate(description.document, description.arrays)
    scene = _core.Scene(description.to_json(), description.arrays)
    film = scene.render('{"aovs": ["depth", "prim_id"], "width": 8, "height": 8}')
    assert film.statistics["scene"]["objects"] == count + 1
    warnings = film.statistics["warnings"]
    if kind is None:
        assert not warnings
        return
    (warning,) = [warning for warning in warnings if warning["kind"] == kind and place in warning["places"]]
    assert words in warning["message"]
    assert "\n" not in warning["message"]
    assert capfd.readouterr() == ("", "")
    # Nothing of it under --strict.
    with pytest.raises(StageError, match=r"--strict"):
        scene.plan('{"aovs": ["depth"], "strict": true}')


@pytest.mark.parametrize("distance", [1e15, 1e30, 1e300])
def test_a_camera_too_far_away_to_see_anything_sees_nothing(distance, tmp_path):
    camera = moved(f"double3 xformOp:translate = (0, 0, {distance:g})", "xformOp:translate").replace("Sphere", "Camera")
    (tmp_path / "stage.usda").write_text("#usda 1.0\n" + camera + mesh().replace("Bad", "Mesh"))
    description = describe(tmp_path / "stage.usda")
    scene = _core.Scene(description.to_json(), description.arrays)
    film = scene.render('{"aovs": ["depth", "dispersion"], "width": 8, "height": 8}')
    assert film.statistics["complete"] and film.statistics["non_finite_values"] == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("rel camera = </Render.camera>", r"^</Render>\.camera: leads back to itself: name a Camera"),
        ("rel camera = </Nope>", r"^</Render>\.camera: there is no </Nope>"),
        ("rel camera = </Good>", r"^</Render>\.camera: </Good> is a Sphere, not a Camera"),
        ("rel products = </Render>", r"^</Render>\.products: </Render> is a RenderSettings, not a RenderProduct"),
        ("uniform int2 resolution = (1000000000, 1000000000)", r"Render\.resolution: is \(1000000000, 1000000000\)"),
        ("uniform float pixelAspectRatio = nan", r"^</Render>\.pixelAspectRatio = .*: is not 1 finite number"),
    ],
)
def test_what_the_settings_ask_for_and_cannot_be_had_is_an_error(settings, message, tmp_path):
    (tmp_path / "stage.usda").write_text(GOOD + f'def RenderSettings "Render"\n{{\n {settings}\n}}\n')
    with pytest.raises(StageError, match=message):
        description = describe(tmp_path / "stage.usda")
        _core.Scene(description.to_json(), description.arrays).plan('{"aovs": ["depth"]}')
