"""Subdivision surfaces: what crosses from USD, and that what is seen is the limit surface."""

import re

import numpy as np
import pytest

pytest.importorskip("pxr")
from description_schema import validate
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

import abbe
from abbe.errors import UsageError
from abbe.usd import describe

# A paraboloid z = C r²/2 about the axis, the face of a plano-convex lens whose back is the plane z = THICKNESS.
C, THICKNESS, HALF = 0.16, 1.5, 2.0


def in_memory(text):
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


def quads(n, first, flipped):
    """Faces of a grid of n × n quads whose points are numbered from ``first``."""
    faces = []
    for j in range(n):
        for i in range(n):
            at = first + j * (n + 1) + i
            face = [at, at + 1, at + n + 2, at + n + 1]
            faces.append(face[::-1] if flipped else face)
    return faces


def lens_cage(stage, n):
    """A closed control mesh whose limit is the paraboloid, but for the outermost faces of the grid; its back is plane.

    The uniform cubic B-spline with control values x² − h²/3 at the knots is x².
    """
    h = 2 * HALF / n
    knots = np.linspace(-HALF, HALF, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(knots, knots))
    front = np.stack([x, y, C / 2 * (x * x + y * y - 2 * h * h / 3)], axis=1)
    back = np.stack([x, y, np.full_like(x, THICKNESS)], axis=1)
    faces = quads(n, 0, True) + quads(n, (n + 1) ** 2, False)
    rim = [i for i in range(n)] + [n + (n + 1) * j for j in range(n)]
    rim += [(n + 1) ** 2 - 1 - i for i in range(n)] + [n * (n + 1) - (n + 1) * j for j in range(n)]
    other = (n + 1) ** 2
    for a, b in zip(rim, rim[1:] + rim[:1], strict=True):
        faces.append([a, b, b + other, a + other])
    mesh = UsdGeom.Mesh.Define(stage, "/Lens")
    mesh.CreatePointsAttr(np.concatenate([front, back]).astype(np.float32))
    mesh.CreateFaceVertexCountsAttr([4] * len(faces))
    mesh.CreateFaceVertexIndicesAttr([i for face in faces for i in face])
    loops = [*rim, rim[0], *(i + other for i in rim), rim[0] + other]
    mesh.CreateCreaseIndicesAttr(loops)
    mesh.CreateCreaseLengthsAttr([len(rim) + 1] * 2)
    mesh.CreateCreaseSharpnessesAttr([10.0, 10.0])
    return mesh.GetPrim()


def prescription(stage):
    prim = UsdGeom.Xform.Define(stage, "/Lens").GetPrim()
    for name, value in (
        ("thickness", THICKNESS),
        ("front:curvature", C),
        ("front:conic", -1.0),
        ("front:semiDiameter", 1.5),
        ("back:semiDiameter", 1.5),
    ):
        prim.CreateAttribute(f"abbe:lens:{name}", Sdf.ValueTypeNames.Double).Set(value)
    return prim


def seen_through(make, **options):
    """Render a wall through a lens along the axis, from the side of the paraboloid, and return a film."""
    stage = Usd.Stage.CreateInMemory()
    prim = make(stage)
    material = UsdShade.Material.Define(stage, "/Glass")
    material.GetPrim().CreateAttribute("abbe:glass", Sdf.ValueTypeNames.String).Set("SCHOTT:N-BK7")
    shader = UsdShade.Shader.Define(stage, "/Glass/Shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.0)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)
    wall = UsdGeom.Plane.Define(stage, "/Wall")
    wall.CreateWidthAttr(20.0)
    wall.CreateLengthAttr(20.0)
    UsdGeom.XformCommonAPI(wall).SetTranslate((0, 0, 9))
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.CreateFocalLengthAttr(50.0)
    camera.CreateHorizontalApertureAttr(12.0)
    camera.CreateVerticalApertureAttr(12.0)
    camera.AddTransformOp().Set(Gf.Matrix4d().SetRotate(Gf.Rotation((0, 1, 0), 180)).SetTranslateOnly((0.1, 0.05, -8)))
    aovs = ["dposition_dlambda", "ddirection_dlambda", "dispersion"]
    return abbe.render(stage, width=12, height=12, aovs=aovs, **options)


def test_dispersion_through_a_subdivided_lens_tends_to_that_of_its_surface():
    exact = seen_through(prescription)
    errors = {}
    for complexity in ("medium", "high", "veryhigh"):
        film = seen_through(lambda stage: lens_cage(stage, 10), complexity=complexity)
        assert film.valid("dposition_dlambda").min() == 1.0
        for name in ("dposition_dlambda", "ddirection_dlambda", "dispersion"):
            difference = np.linalg.norm(film[name] - exact[name], axis=2).max()
            errors.setdefault(name, []).append(difference / np.linalg.norm(exact[name], axis=2).max())
    for name, (first, second, third) in errors.items():
        # Linear interpolation of points and normals errs with the square of the size of the faces; its derivative,
        # which bends the pixel's own footprint and so enters the motion on screen, with the size itself.
        low, high = (1.5, 4.5) if name == "dispersion" else (3.0, 5.5)
        assert low < first / second < high and low < second / third < high, (name, errors)
        # At the level that nobody has to ask for, with ten faces across.
        assert second < (4e-3 if name == "dispersion" else 2e-4), (name, errors)


def triangles_of(stage, **options):
    film = abbe.render(stage, width=1, height=1, aovs=["depth"], **options)
    return film.statistics["scene"]["triangles"]


def test_the_level_is_that_of_the_mesh_then_what_is_asked_then_by_size():
    def triangles(complexity=None, level=None, n=4):
        stage = Usd.Stage.CreateInMemory()
        prim = lens_cage(stage, n)
        if level is not None:
            prim.CreateAttribute("abbe:subdivision:level", Sdf.ValueTypeNames.Int).Set(level)
        return triangles_of(stage, complexity=complexity)

    faces = 2 * 16 + 16
    # Coarse ones are refined more.
    assert triangles(n=1) == 2 * 4**4 * 6
    assert triangles() == triangles(level=-1) == 128 * faces
    assert triangles(n=8) == 32 * (2 * 64 + 32)
    assert triangles("low") == 2 * faces
    assert triangles("medium") == 8 * faces
    assert triangles("veryhigh") == 128 * faces
    assert triangles("low", level=3) == 128 * faces
    assert triangles("high", level=-1) == 32 * faces
    assert triangles("high", level=0) == 2 * faces
    with pytest.raises(UsageError, match="complexity 'extreme': use one of low, medium"):
        describe(in_memory(""), complexity="extreme")


EVERYTHING = """
def Mesh "Cube"
{
    point3f[] points = [(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1),
                        (-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
    token subdivisionScheme = "catmullClark"
    token interpolateBoundary = "edgeOnly"
    token faceVaryingLinearInterpolation = "boundaries"
    token triangleSubdivisionRule = "smooth"
    int[] creaseIndices = [4, 5, 7, 6, 4]
    int[] creaseLengths = [5]
    float[] creaseSharpnesses = [2.5]
    int[] cornerIndices = [0]
    float[] cornerSharpnesses = [10]
    int[] holeIndices = [0]
}
"""


def test_all_that_usd_says_of_a_subdivision_surface_crosses():
    description = describe(in_memory(EVERYTHING), complexity="veryhigh")
    validate(description.document, description.arrays)
    mesh = description.document["shapes"][0]["mesh"]
    authored = dict(mesh["subdivision"])
    arrays = {
        key: description.arrays[authored.pop(key)].tolist() for key in list(authored) if key[:3] in ("cre", "cor")
    }
    assert authored == {
        "scheme": "catmullClark",
        "level": 3,
        "interpolate_boundary": "edgeOnly",
        "face_varying_linear_interpolation": "boundaries",
        "triangle_subdivision_rule": "smooth",
    }
    assert arrays == {
        "crease_indices": [4, 5, 7, 6, 4],
        "crease_lengths": [5],
        "crease_sharpnesses": [2.5],
        "corner_indices": [0],
        "corner_sharpnesses": [10.0],
    }


@pytest.mark.parametrize(
    ("line", "kind", "message"),
    [
        ("int[] creaseLengths = [4]", "unusable-attribute", "creaseLengths .* add up to 4, but creaseIndices has 5"),
        ("float[] creaseSharpnesses = [1, 2]", "unusable-attribute", "creaseSharpnesses has 2 values for 1 creases"),
        ("int[] creaseIndices = [4, 7, 5, 6, 4]", "unusable-attribute", "2 pairs of creaseIndices are no edge"),
        ("int[] cornerIndices = [0, 1]", "unusable-attribute", "cornerSharpnesses has 1 values for 2 cornerIndices"),
        ("int[] cornerIndices = [9]", "unusable-attribute", "1 of the cornerIndices are no point"),
        ('token subdivisionScheme = "loop"', "unusable-attribute", "face 0 has 4 corners, and Loop's scheme"),
        ('token interpolateBoundary = "some"', "unreadable-attribute", "'some' is none of none, edgeOnly"),
        ('token subdivisionScheme = "soft"', "unreadable-attribute", "'soft' is no scheme of USD"),
        ("float abbe:subdivision:level = 1.5", "unreadable-attribute", "1.5 is no number of levels"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_left_out_and_named(line, kind, message):
    name = line.split(" = ")[0]
    lines = [old for old in EVERYTHING.splitlines() if not old.strip().startswith(name + " =")]
    lines.insert(-1, "    " + line)
    stage = in_memory("\n".join(lines))
    scene = abbe.Scene.from_stage(stage)
    found = [w for w in scene.warnings if w["kind"] == kind]
    assert [w for w in found if re.search(message, w["message"])], scene.warnings
    assert triangles_of(stage) > 0


def depth_along_z(text, x, y, **options):
    """The height of a surface above (x, y), seen from above."""
    camera = (
        'def Camera "Camera"\n{\n token projection = "orthographic"\n float horizontalAperture = 0.01\n'
        f" float verticalAperture = 0.01\n double3 xformOp:translate = ({x}, {y}, 10)\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    film = abbe.render(in_memory('(\n upAxis = "Z"\n)\n' + text + camera), width=1, height=1, aovs=["depth"], **options)
    return 10 - float(film["depth"][0, 0, 0]) if film.valid("depth")[0, 0] else None


CUBE = """
def Mesh "Cube"
{
    point3f[] points = [(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1),
                        (-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
%s
}
"""
# The limit of the middle of a cube's face: one step, then the mask of a regular vertex.
MIDDLE = (12 + 8 * 0.75 + 16 * (5 / 9 + 0.75 + 0.75 + 1) / 4) / 36


@pytest.mark.parametrize(
    ("lines", "height"),
    [
        # USD's fallback is Catmull-Clark.
        ("", MIDDLE),
        ('token subdivisionScheme = "none"', 1.0),
        ('token subdivisionScheme = "bilinear"', 1.0),
        ('token orientation = "leftHanded"', MIDDLE),
        # The rim of the top for ever sharp: its inside is plane.
        ("int[] creaseIndices = [4, 5, 7, 6, 4]\n int[] creaseLengths = [5]\n float[] creaseSharpnesses = [10]", 1.0),
        ("int[] creaseIndices = [4, 5, 7, 6, 4]\n int[] creaseLengths = [5]\n"
         " float[] creaseSharpnesses = [10, 10, 10, 10]", 1.0),
        # A hole supports what is around it: one looks through to the bottom.
        ("int[] holeIndices = [1]", -MIDDLE),
        ("int abbe:subdivision:level = 0", 1.0),
        ("int abbe:subdivision:level = -1", MIDDLE),
        ("int abbe:subdivision:level = 5", MIDDLE),
    ],
)  # fmt: skip
def test_the_middle_of_a_cube_is_where_its_limit_is(lines, height):
    # The ray meets a vertex; depths of 10 have six digits after the point in float32.
    assert depth_along_z(CUBE % lines, 0, 0) == pytest.approx(height, abs=2e-6)


def test_faces_of_a_subset_keep_their_material_when_refined():
    text = (
        CUBE
        % """
    rel material:binding = </A>
    def GeomSubset "Top" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </B>
    }
"""
        + 'def Material "A"\n{\n}\ndef Material "B"\n{\n}\n'
    )
    camera = (
        'def Camera "Camera"\n{\n token projection = "orthographic"\n float horizontalAperture = 20\n'
        " float verticalAperture = 20\n double3 xformOp:translate = (0, 0, 10)\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    film = abbe.render(in_memory(text + camera), width=41, height=41, aovs=["material_id", "depth"])
    ids, seen = film["material_id"][:, :, 0], film.valid("depth") > 0
    names = abbe.Manifest(film.metadata["abbe:materialManifest"])

    def material(x, y):
        column, row = (round((value + 1) / 2 * 41 - 0.5) for value in (x, -y))
        assert seen[row, column]
        return names[int(ids[row, column]) - 1]

    # The top ends at the limits of its corners, (1/2, 1/2), and of the middles of its edges.
    assert {material(x * 0.45, y * 0.45) for x in (-1, 1) for y in (-1, 1)} == {"/B"}
    assert {material(x * 0.54, y * 0.54) for x in (-1, 1) for y in (-1, 1)} == {"/A"}
    assert {material(0, 0), material(0.3, 0), material(0, -0.4)} == {"/B"}
