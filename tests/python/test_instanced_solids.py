"""Lenses and solids under point instancers and native instances are those that are placed plainly."""

import numpy as np
import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd

import abbe
from abbe.usd import describe

# Where the kits stand: a position, no turn or a half one about y or z as a quaternion, and a scale.
POSITIONS = [(-2, 0.25, 0), (0, -0.5, 0.5), (2, 0.5, -1)]
TURNS = [(1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
SCALES = [(1, 1, 1), (0.5, 0.5, 0.5), (2, 2, 2)]
# The same as matrices. Their numbers are exact, so that all ways to say them give the same doubles.
DIAGONALS = [(1, 1, 1), (-0.5, 0.5, -0.5), (-2, -2, 2)]

KIT = """
 def Xform "Lens" (prepend apiSchemas = ["MaterialBindingAPI"])
 {
  double abbe:lens:thickness = 0.5
  double abbe:lens:front:curvature = 0.5
  double abbe:lens:front:semiDiameter = 0.5
  double abbe:lens:back:curvature = -0.75
  double abbe:lens:back:conic = -1
  double abbe:lens:back:semiDiameter = 0.5
  rel material:binding = </Glass>
  double3 xformOp:translate = (0, 0.5, 0)
  uniform token[] xformOpOrder = ["xformOp:translate"]
  def Sphere "StandIn"
  {
  }
 }
 def Cylinder "Rod" (prepend apiSchemas = ["MaterialBindingAPI"])
 {
  uniform token axis = "X"
  double height = 1
  double radius = 0.25
  rel material:binding = </Glass>
  double3 xformOp:translate = (0, -0.5, 0.25)
  uniform token[] xformOpOrder = ["xformOp:translate"]
 }
"""
AROUND = """
def Plane "Wall"
{
 double width = 40
 double length = 40
 double3 xformOp:translate = (0, 0, -5)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Camera"
{
 float focalLength = 30
 double3 xformOp:translate = (0.125, 0.25, 12)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Material "Glass"
{
 uniform string abbe:glass = "SCHOTT:N-SF11"
 token outputs:surface.connect = </Glass/Surface.outputs:surface>
 def Shader "Surface"
 {
  uniform token info:id = "UsdPreviewSurface"
  float inputs:opacity = 0
  float inputs:ior = 1.5
  token outputs:surface
 }
}
"""
AOVS = ["position", "normal", "refracted_position", "dispersion", "dposition_dlambda", "material_id"]


def stage(text):
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString("#usda 1.0\n" + text + AROUND)
    return Usd.Stage.Open(layer)


def ops(index):
    x, y, z = DIAGONALS[index]
    rows = (x, 0, 0, 0), (0, y, 0, 0), (0, 0, z, 0), (*POSITIONS[index], 1)
    return f' matrix4d xformOp:transform = {rows}\n uniform token[] xformOpOrder = ["xformOp:transform"]\n'


def plain():
    return stage("".join(f'def Xform "K{i}"\n{{\n{ops(i)}{KIT}}}\n' for i in range(3)))


def native():
    metadata = "(\n instanceable = true\n references = </Kit>\n)"
    placed = (f'def Xform "K{i}" {metadata}\n{{\n{ops(i)}}}\n' for i in range(3))
    return stage(f'class "Kit"\n{{{KIT}}}\n' + "".join(placed))


def instanced():
    return stage(f"""def PointInstancer "P"
{{
 rel prototypes = </P/Kit>
 int[] protoIndices = [0, 0, 0]
 point3f[] positions = {POSITIONS}
 quath[] orientations = {TURNS}
 float3[] scales = {SCALES}
 def Xform "Kit"
 {{{KIT} }}
}}
""")


def seen(film, what, manifest):
    numbers = np.unique(film[what])
    paths = abbe.Manifest(film.metadata[f"abbe:{manifest}Manifest"])
    return {paths[int(number) - 1] for number in numbers if number}


@pytest.mark.parametrize("make", [native, instanced])
def test_instances_are_what_is_placed_plainly(make):
    description = describe(make())
    validate(description.document, description.arrays)
    kinds = sorted(kind for shape in description.document["shapes"] for kind in shape)
    assert kinds == ["cylinder", "lens", "plane"], "stand-ins are not read, prototypes once"
    options = {"width": 160, "samples": 4, "aovs": [*AOVS, "prim_id", "instance_id"]}
    film, reference = (abbe.render(text(), **options) for text in (make, plain))
    for name in AOVS:
        assert np.array_equal(film[name], reference[name], equal_nan=True), name
    assert np.count_nonzero(reference["dispersion"]) > 1000
    if make is instanced:
        assert seen(film, "instance_id", "instance") == {"/P[0]", "/P[1]", "/P[2]"}
        assert seen(film, "prim_id", "prim") == {"/Wall", "/P/Kit/Lens", "/P/Kit/Rod"}
    else:
        assert seen(film, "instance_id", "instance") == {"/K0", "/K1", "/K2"}
        assert seen(film, "prim_id", "prim") == seen(reference, "prim_id", "prim")
    assert len(seen(reference, "prim_id", "prim")) == 7


def test_the_framed_camera_sees_what_is_instanced():
    """Without a camera the boxes of the instanced lenses and solids decide."""
    found = []
    for make in (plain, instanced):
        opened = make()
        opened.RemovePrim("/Camera")
        opened.RemovePrim("/Wall")
        (camera,) = describe(opened).document["cameras"]
        found.append(camera["transform"])
    # The instancer's box is of turned boxes: half turns make them boxes again.
    assert found[0] == pytest.approx(found[1], abs=1e-12)
