"""The bridge on small stages, one feature each: the description says what was authored, by the schema's rules."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd, UsdGeom

from abbe.errors import StageError, UsageError
from abbe.usd import describe, list_cameras, list_settings

STAGES = Path(__file__).parent / "stages"


def read(name, **options):
    """Describe a stage of the tests, checked against the schema."""
    description = describe(STAGES / name, **options)
    validate(description.document, description.arrays)
    description.to_json()
    return description


def in_memory(text):
    """A stage in memory from .usda text."""
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


def placements(description):
    """Placements by path."""
    document = description.document
    return {item["path"]: item for item in document["groups"][document["root"]]["items"]}


def shape(description, path):
    """The shape that is placed at a path."""
    return description.document["shapes"][placements(description)[path]["target"]["shape"]]


def warned(description, kind):
    """The warnings of a kind."""
    return [warning for warning in description.warnings if warning["kind"] == kind]


# Geometry


@pytest.fixture(scope="module")
def geometry():
    return read("geometry.usda")


def test_stage_metadata_is_as_authored(geometry):
    assert geometry.document["stage"] == {
        "source": str(STAGES / "geometry.usda"),
        "meters_per_unit": 0.1,
        "up_axis": "Z",
        "time_code": 3.0,
        "frames_per_second": 25.0,
        "time_codes_per_second": 25.0,
    }


def test_a_mesh_crosses_with_all_its_arrays(geometry):
    mesh = shape(geometry, "/World/Polygons")["mesh"]
    arrays = geometry.arrays
    assert mesh["path"] == "/World/Polygons"
    assert arrays[mesh["points"]].shape == (7, 3)
    assert arrays[mesh["face_vertex_counts"]].tolist() == [4, 4, 3]
    assert arrays[mesh["face_vertex_indices"]].tolist() == [0, 1, 2, 3, 1, 4, 5, 2, 4, 6, 5]
    assert arrays[mesh["hole_indices"]].tolist() == [1]
    assert mesh["left_handed"] is True
    assert placements(geometry)["/World/Polygons"]["double_sided"] is True


def test_primvars_normals_win_over_normals(geometry):
    normals = shape(geometry, "/World/Polygons")["mesh"]["normals"]
    assert normals["interpolation"] == "uniform"
    assert geometry.arrays[normals["values"]].tolist() == [[0, 0, 1], [0, 0, -1]]
    assert geometry.arrays[normals["indices"]].tolist() == [0, 1, 0]


def test_plain_normals_are_per_vertex(geometry):
    normals = shape(geometry, "/World/Plain")["mesh"]["normals"]
    assert normals["interpolation"] == "vertex"
    assert "indices" not in normals


def test_st_is_the_texture_coordinate_and_others_stand_in(geometry):
    uv = shape(geometry, "/World/Polygons")["mesh"]["uv"]
    assert uv["interpolation"] == "faceVarying"
    assert geometry.arrays[uv["values"]].shape == (4, 2)
    assert geometry.arrays[uv["indices"]].shape == (11,)
    other = shape(geometry, "/World/Plain")["mesh"]["uv"]
    assert geometry.arrays[other["values"]].tolist() == [[0, 0], [1, 0], [0, 1]]


def test_only_face_subsets_of_the_material_family_count(geometry):
    (subset,) = shape(geometry, "/World/Polygons")["mesh"]["subsets"]
    assert subset["path"] == "/World/Polygons/first"
    assert geometry.arrays[subset["faces"]].tolist() == [0, 1]
    assert warned(geometry, "unsupported-subset")[0]["places"] == ["</World/Polygons/points>"]


def test_a_subdivision_surface_has_no_authored_normals(geometry):
    mesh = shape(geometry, "/World/Subdivision")["mesh"]
    assert "normals" not in mesh
    # USD's own fallbacks, forwarded; the level is the renderer's to choose.
    assert mesh["subdivision"] == {
        "scheme": "catmullClark",
        "interpolate_boundary": "edgeAndCorner",
        "face_varying_linear_interpolation": "cornersPlus1",
        "triangle_subdivision_rule": "catmullClark",
    }
    (warning,) = warned(geometry, "ignored-normals")
    assert warning["places"] == ["</World/Subdivision>.normals"]
    assert "subdivision" not in shape(geometry, "/World/Plain")["mesh"]


def test_points_and_transforms_are_those_of_the_frame(geometry):
    for frame, z in ((3, 2.0), (1, 0.0), (5, 4.0)):
        description = read("geometry.usda", frame=frame)
        mesh = shape(description, "/World/Moving")["mesh"]
        assert description.arrays[mesh["points"]][0, 2] == z
    # Half way of a half turn, and the parent's translation was reset.
    rotation = placements(geometry)["/World/Moving"]["transform"]
    assert rotation == pytest.approx([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], abs=1e-15)


def test_transforms_are_row_vectors_with_mirrors(geometry):
    assert placements(geometry)["/World/Mirror/Ball"]["transform"] == [-1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 10, 0, 0, 1]
    assert shape(geometry, "/World/Mirror/Ball") == {"sphere": {"path": "/World/Mirror/Ball", "radius": 0.25}}


def test_arrays_of_other_types_are_converted_or_left_out(geometry):
    mesh = shape(geometry, "/World/Doubles")["mesh"]
    assert geometry.arrays[mesh["points"]].tolist() == [[0, 0, float(np.float32(0.1))], [1, 0, 0], [0, 1, 0]]
    places = [place for warning in warned(geometry, "converted-attribute") for place in warning["places"]]
    assert places == [
        "</World/Plain>.primvars:UVMap",
        "</World/Doubles>.points",
        "</World/Doubles>.faceVertexCounts",
    ]
    assert warned(geometry, "unreadable-attribute")[0]["places"] == ["</World/NotPoints>.points"]
    assert warned(geometry, "empty-mesh")[0]["places"] == ["</World/NotPoints>", "</World/NoFaces>"]
    assert not {"/World/NotPoints", "/World/NoFaces"} & set(placements(geometry))


def test_arrays_are_usds_own_memory_and_outlive_the_stage():
    points = [(index, 0.5, -index) for index in range(1000)]
    stage = Usd.Stage.CreateInMemory()
    mesh = UsdGeom.Mesh.Define(stage, "/M")
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    description = describe(stage)
    array = description.arrays["shape0.points"]
    assert array.base is not None and not array.flags.writeable
    del stage, mesh
    gc.collect()
    assert np.array_equal(array, np.array(points, dtype=np.float32))


@pytest.mark.parametrize(
    ("value", "where", "says"),
    [
        ("double radius = nan", "</S>.radius", "is nan, which is no finite number; it is left out"),
        ('string radius = "wide"', "</S>.radius", "is wide, which is no finite number; it is left out"),
        (
            'double3 xformOp:translate = (inf, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]',
            "</S>",
            "its transform is not finite, so that it stands nowhere; it is left out",
        ),
    ],
)
def test_a_prim_with_a_value_that_is_none_is_left_out_and_named(value, where, says):
    description = describe(in_memory(f'def Sphere "S"\n{{\n {value}\n}}\ndef Sphere "Other"\n{{\n}}\n'))
    validate(description.document, description.arrays)
    assert list(placements(description)) == ["/Other"]
    (warning,) = warned(description, "broken-prim")
    assert (warning["places"], warning["message"]) == ([where], says)


# Visibility, purpose, types


def test_what_is_left_out_is_counted_or_named():
    description = read("selection.usda")
    shown = {"/Shown", "/Guides/BackToRender", "/Guides/BackToDefault", "/Blinks", "/Cube", "/Cube2"}
    assert set(placements(description)) == shown
    assert description.document["skipped"] == {
        "invisible": 1,
        "purpose guide": 1,
        "purpose proxy": 1,
    }
    named = {warning["message"].split()[0]: warning for warning in warned(description, "unsupported-prim")}
    assert set(named) == {"BasisCurves"}
    assert warned(description, "instancer")[0]["places"] == ["</Scatter>.protoIndices"]
    assert warned(description, "unknown-prim-type")[0]["places"] == ["</Unknown>"]


def test_purposes_and_frames_decide_what_is_shown():
    assert "/Proxy" in placements(read("selection.usda", purposes=["proxy"]))
    assert "/Guides/BackToRender" not in placements(read("selection.usda", purposes=["proxy"]))
    assert "/Guides/Guide" in placements(read("selection.usda", purposes=["render", "guide"]))
    assert "/Blinks" not in placements(read("selection.usda", frame=2))
    with pytest.raises(UsageError, match=r"^purposes: 'beauty'"):
        describe(STAGES / "selection.usda", purposes=["beauty"])


# Materials


@pytest.fixture(scope="module")
def materials():
    description = read("materials.usda", frame=1)
    return description, {item["path"]: item for item in description.document["materials"]}


def test_only_bound_materials_are_read_in_order_of_use(materials):
    _, by_path = materials
    assert list(by_path) == ["/Looks/Glass", "/Looks/Ours", "/Looks/Foreign", "/Looks/Empty"]


def test_terminals_are_looked_for_in_order(materials):
    _, by_path = materials
    assert by_path["/Looks/Glass"]["surface"]["terminal"] == "outputs:mtlx:surface"
    assert by_path["/Looks/Glass"]["surface"]["id"] == "ND_open_pbr_surface_surfaceshader"
    assert by_path["/Looks/Ours"]["surface"]["terminal"] == "outputs:abbe:surface"
    assert by_path["/Looks/Ours"]["surface"]["inputs"] == {"ior": {"type": "float", "value": 1.25}}
    assert by_path["/Looks/Foreign"]["surface"]["terminal"] == "outputs:arnold:surface"
    assert "surface" not in by_path["/Looks/Empty"]


def test_inputs_are_constants_or_connected_or_left_to_the_shader(materials):
    description, by_path = materials
    surface = by_path["/Looks/Glass"]["surface"]
    assert surface["inputs"] == {
        "specular_ior": {"type": "float", "value": float(np.float32(1.6))},
        "transmission_weight": {"type": "float", "value": float(np.float32(0.1))},
        "transmission_color": {"type": "color3f", "value": [0.5, 0.25, 1.0]},
        "transmission_dispersion_abbe_number": {"type": "float", "value": 41.5},
        "map": {"type": "asset", "value": "textures/a.png"},
        "geometry_thin_walled": {"type": "bool", "value": True},
        "note": {"type": "string", "value": "clear"},
        "huge": {"type": "float", "value": "inf"},
    }
    assert surface["connected"] == {"specular_roughness": "/Looks/Glass/Noise.outputs:out"}
    assert warned(description, "dangling-connection")[0]["places"] == ["</Looks/Glass/Open>.inputs:coat_weight"]


def test_our_attributes_are_kept_apart_by_place(materials):
    description, by_path = materials
    glass = by_path["/Looks/Glass"]
    assert glass["abbe"] == {
        "abbe:dispersion:vd": {"type": "double", "value": 64.17},
        "abbe:dispersion:table": {"type": "double2[]", "value": [[400.0, 1.53], [700.0, 1.51]]},
        "abbe:dispersion:typo": {"type": "double", "value": 1.0},
    }
    assert glass["interface_abbe"] == {"abbe:dispersion:nd": {"type": "double", "value": 1.7}}
    assert glass["surface"]["abbe"] == {"abbe:dispersion:scale": {"type": "double", "value": 2.0}}
    assert warned(description, "unknown-attribute")[0]["places"] == ["</Looks/Glass>.abbe:dispersion:typo"]


def test_bindings_go_to_placements_and_subsets(materials):
    description, _ = materials
    placed = placements(description)
    assert placed["/Faces"]["material"] == 0
    assert placed["/Faces"]["subset_materials"] == [1, None]
    assert placed["/Purposes/Full"]["material"] == 2
    assert "material" not in placed["/Unbound"]
    (missing,) = warned(description, "missing-material")
    assert missing["places"] == ["</Faces/b>"] and "</Looks/Missing>" in missing["message"]
    assert warned(description, "material-without-surface")[0]["places"] == ["</Looks/Empty>"]


# Instances


def test_instances_share_shapes_and_bind_by_themselves():
    description = read("instances.usda", camera="/World/Nested/B/Eye")
    placed = placements(description)
    assert list(placed) == ["/World/First/Tri", "/World/Second/Tri", "/World/Nested/A/Tri", "/World/Nested/B/Tri"]
    assert len(description.document["shapes"]) == 1
    assert [item["instance"] for item in placed.values()] == [
        "/World/First",
        "/World/Second",
        "/World/Nested",
        "/World/Nested",
    ]
    paths = [material["path"] for material in description.document["materials"]]
    assert paths == ["/World/Looks/Red", "/World/First/Looks/Own", "/World/Looks/Blue"]
    assert [item.get("material") for item in placed.values()] == [0, 2, None, None]
    # The library's class is not rendered, its material is one for all instances.
    assert [item["subset_materials"] for item in placed.values()] == [[1]] * 4
    assert placed["/World/Nested/B/Tri"]["transform"][12:15] == [0, 7, 5]
    assert description.document["cameras"][0]["path"] == "/World/Nested/B/Eye"
    assert description.document["cameras"][0]["transform"][12:15] == [0, 7, 5]


# Cameras


def test_a_camera_crosses_as_authored():
    description = read("render.usda")
    camera = description.document["cameras"][0]
    assert camera == {
        "path": "/main_cam",
        "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 20, 1],
        "projection": "orthographic",
        "horizontal_aperture": float(np.float32(20.955)),
        "vertical_aperture": float(np.float32(15.2908)),
        "horizontal_aperture_offset": 1.5,
        "vertical_aperture_offset": 0.0,
        "focal_length": 20.0,
        "clipping_range": [0.5, 500.0],
        "clipping_authored": True,
        "f_stop": float(np.float32(2.8)),
        "focus_distance": 12.0,
        "shutter_open": -0.25,
        "shutter_close": 0.25,
    }
    assert read("render.usda", frame=8).document["cameras"][0]["focal_length"] == 30.0


def test_cameras_are_found_by_name_or_path():
    for name in ("Side", "/Side"):
        document = read("render.usda", camera=name).document
        assert [camera["path"] for camera in document["cameras"]] == ["/Side"]
        assert "camera" not in document["settings"]["products"][0]
    with pytest.raises(StageError, match=r"render\.usda: has no camera 'Nope': choose one of /First, /main_cam, /Side"):
        describe(STAGES / "render.usda", camera="Nope")
    with pytest.raises(StageError, match=r"^</Ball>: is a Sphere, not a Camera: choose one of /First"):
        describe(STAGES / "render.usda", camera="/Ball")
    with pytest.raises(StageError, match="has no camera"):
        describe(STAGES / "render.usda", camera="not a path!")


def test_the_default_camera_is_the_settings_then_main_cam_then_the_first():
    text = 'def Camera "A"\n{\n}\ndef Camera "main_cam"\n{\n}\n'
    assert describe(in_memory(text)).document["cameras"][0]["path"] == "/main_cam"
    assert describe(in_memory(text.replace("main_cam", "B"))).document["cameras"][0]["path"] == "/A"
    assert read("render.usda", render_settings="/Render/Preview").document["cameras"][0]["path"] == "/First"


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
def test_without_a_camera_what_is_rendered_is_framed(up_axis):
    stage = in_memory(
        f'(\n upAxis = "{up_axis}"\n)\n'
        'def Sphere "S"\n{\n double radius = 2\n double3 xformOp:translate = (5, 6, 7)\n'
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
        'def NurbsPatch "NotRendered"\n{\n float3[] extent = [(-500, -500, -500), (500, 500, 500)]\n}\n'
    )
    description = describe(stage)
    validate(description.document, description.arrays)
    (camera,) = description.document["cameras"]
    matrix = np.array(camera["transform"]).reshape(4, 4)
    eye, back = matrix[3, :3], matrix[2, :3]
    centre = np.array([5.0, 6.0, 7.0])
    # Opposite the view, level, and so far that the half diagonal of the front face fills half the width.
    assert back == pytest.approx([0, 0, 1] if up_axis == "Y" else [0, -1, 0], abs=1e-15)
    distance = np.dot(eye - centre, back)
    assert eye == pytest.approx(centre + distance * back)
    assert (distance - 2) * (camera["horizontal_aperture"] / 2 / camera["focal_length"]) == pytest.approx(
        np.hypot(2, 2)
    )
    near, far = camera["clipping_range"]
    assert 0 < near < distance - 2 and distance + 2 < far
    assert camera["path"] == "" and len(warned(description, "framed-camera")) == 1
    with pytest.raises(StageError, match=r"has no camera.*add a Camera prim"):
        describe(stage, strict=True)


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
def test_a_floor_is_framed_from_above(up_axis):
    corners = [(-3, -5), (3, -5), (3, 5), (-3, 5)]
    points = [(a, 0, -b) if up_axis == "Y" else (a, b, 0) for a, b in corners]
    text = ", ".join(str(point) for point in points)
    stage = in_memory(
        f'(\n upAxis = "{up_axis}"\n)\n'
        f'def Mesh "Floor"\n{{\n point3f[] points = [{text}]\n int[] faceVertexCounts = [4]\n'
        ' int[] faceVertexIndices = [0, 1, 2, 3]\n uniform token subdivisionScheme = "none"\n}\n'
    )
    (camera,) = describe(stage).document["cameras"]
    camera_from_world = np.linalg.inv(np.array(camera["transform"]).reshape(4, 4))
    seen = np.array([(*point, 1) for point in points]) @ camera_from_world
    assert np.array(camera["transform"])[8:11] == pytest.approx(
        np.array([0, 1, 1] if up_axis == "Y" else [0, -1, 1]) / 2**0.5
    )
    # All corners are in view, and not on a line.
    x, y = (seen[:, k] / -seen[:, 2] * camera["focal_length"] for k in (0, 1))
    assert np.all(np.abs(x) < camera["horizontal_aperture"] / 2) and np.all(np.abs(y) < camera["vertical_aperture"] / 2)
    assert np.ptp(y) > camera["vertical_aperture"] / 10


def test_an_empty_stage_still_has_a_camera():
    description = describe(in_memory(""))
    validate(description.document, description.arrays)
    assert [warning["kind"] for warning in description.warnings] == ["framed-camera", "nothing-to-render"]


# Render settings


def test_products_inherit_from_settings_what_they_do_not_author():
    settings = read("render.usda").document["settings"]
    beauty, data = settings["products"]
    assert settings["path"] == "/Render/Main"
    assert beauty["name"] == "out/beauty.0007.exr" and data["name"] == "seven.exr"
    assert beauty["resolution"] == [640, 480] and data["resolution"] == [320, 200]
    assert beauty["pixel_aspect_ratio"] == data["pixel_aspect_ratio"] == 2.0
    assert beauty["aspect_ratio_conform_policy"] == "expandAperture"
    assert data["aspect_ratio_conform_policy"] == "cropAperture"
    assert beauty["data_window_ndc"] == [0, 0, 1, 1] and data["data_window_ndc"] == [0.25, 0, 0.75, 1]
    assert beauty["disable_motion_blur"] is True and data["disable_motion_blur"] is False
    assert beauty["disable_depth_of_field"] is False and data["disable_depth_of_field"] is True
    assert beauty["product_type"] == "raster" and data["product_type"] == "deepRaster"
    assert beauty["rendering_color_space"] == data["rendering_color_space"] == "lin_rec709_scene"
    assert settings["base"]["resolution"] == [640, 480] and settings["base"]["vars"] == []


def test_an_unauthored_resolution_stays_open():
    settings = read("render.usda", render_settings="/Render/Preview").document["settings"]
    assert settings["products"] == [] and "resolution" not in settings["base"]


def test_products_name_cameras():
    document = read("render.usda").document
    assert [camera["path"] for camera in document["cameras"]] == ["/main_cam", "/Side"]
    assert [product["camera"] for product in document["settings"]["products"]] == [0, 1]


def test_our_attributes_and_driver_parameters_are_forwarded():
    description = read("render.usda")
    settings = description.document["settings"]
    beauty = settings["products"][0]
    assert settings["abbe"]["abbe:integrator"] == {"type": "token", "value": "differentials"}
    assert settings["abbe"]["abbe:samples"] == {"type": "int", "value": 16}
    assert beauty["abbe"] == {"abbe:seed": {"type": "int", "value": 4}}
    assert beauty["driver"] == {
        "OpenEXR:compression": {"type": "string", "value": "zips"},
        "artist": {"type": "string", "value": "us"},
    }
    assert beauty["vars"] == [
        {
            "path": "/Render/Color",
            "name": "Color",
            "source_name": "Ci",
            "source_type": "raw",
            "data_type": "color4f",
            "driver": {},
            "abbe": {},
        },
        {
            "path": "/Render/Dispersion",
            "name": "Dispersion",
            "source_name": "dispersion",
            "source_type": "raw",
            "data_type": "float2",
            "driver": {"name": {"type": "string", "value": "disp"}, "format": {"type": "token", "value": "float"}},
            "abbe": {"abbe:filter": {"type": "token", "value": "closest"}},
        },
    ]
    assert warned(description, "unknown-attribute")[0]["places"] == ["</Render/Main>.abbe:sampels"]


def test_the_settings_purposes_count_unless_others_are_asked_for():
    stage = in_memory(
        'def Sphere "P"\n{\n uniform token purpose = "proxy"\n}\n'
        'def RenderSettings "R"\n{\n uniform token[] includedPurposes = ["proxy"]\n}\n'
    )
    assert set(placements(describe(stage))) == {"/P"}
    assert set(placements(describe(stage, purposes=["render"]))) == set()


def test_one_product_can_be_chosen():
    for wanted in ("Data", "/Render/Data"):
        (product,) = read("render.usda", product=wanted).document["settings"]["products"]
        assert product["path"] == "/Render/Data"
    with pytest.raises(StageError, match="no product 'Dta': choose one of /Render/Beauty, /Render/Data"):
        describe(STAGES / "render.usda", product="Dta")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"render_settings": "/Nope"}, r"there is no </Nope>, not a RenderSettings: choose one of /Render/Main"),
        ({"render_settings": "/Ball"}, r"</Ball> is a Sphere, not a RenderSettings"),
        ({"render_settings": "/Render/Broken"}, r"^</Render/Broken>\.products: there is no </Render/Nowhere>"),
        ({"render_settings": "/Render/BrokenCamera"}, r"^</Render/BrokenCamera>\.camera: </Ball> is a Sphere"),
    ],
)
def test_render_prims_that_are_not_there_are_errors(options, message):
    with pytest.raises(StageError, match=message):
        describe(STAGES / "render.usda", **options)


def test_several_settings_without_a_choice_are_not_guessed():
    stage = in_memory('def RenderSettings "A"\n{\n}\ndef RenderSettings "B"\n{\n}\n')
    description = describe(stage)
    assert description.document["settings"] == {"abbe": {}, "products": []}
    assert warned(description, "ambiguous-render-settings")[0]["places"] == ["</A>", "</B>"]


# Variants and values


def test_variants_are_selected_by_name_and_unknown_ones_refused():
    assert set(placements(read("variants.usda"))) == {"/World/Ball"}
    assert set(placements(read("variants.usda", variants=["/World{shape=none}"]))) == set()
    for text, message in (
        ("/World{shape=cube}", r"^</World>{shape}: has no variant 'cube': choose one of ball, none"),
        ("/World{size=big}", r"^</World>: has no variant set 'size': choose one of shape"),
        ("/Nope{shape=ball}", r"^</Nope>: there is no such prim"),
    ):
        with pytest.raises(StageError, match=message):
            describe(STAGES / "variants.usda", variants=[text])
    for text in ("/World", "/World{shape}", "/World.x{a=b}", "{a=b}"):
        with pytest.raises(UsageError, match=r"^variant"):
            describe(STAGES / "variants.usda", variants=[text])


def test_values_are_set_in_the_attributes_type():
    description = read(
        "variants.usda",
        frame=1.5,
        overrides=["/World/Ball.radius=5", "/Glass.inputs:ior = 1.75", "/Glass.abbe:dispersion:vd=30"],
    )
    assert shape(description, "/World/Ball")["sphere"]["radius"] == 5.0
    mapped = read("variants.usda", overrides={"/World/Ball.radius": 6.0})
    assert shape(mapped, "/World/Ball")["sphere"]["radius"] == 6.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("/World/Ball.size=1", r"^</World/Ball>: has no attribute 'size': choose one of radius"),
        ("/World/Ball.radius=big", r"^</World/Ball>\.radius = big: is no value of type double"),
        ("/World/Ball.radius=1\n}", r"is no value of type double"),
        ('/World/Ball.radius=1 (doc = "x")', r"is no value of type double"),
        ("/Nope.radius=1", r"^</Nope>: there is no such prim"),
        ("/Glass/Shader.inputs:ior=2", r"^</Glass/Shader>\.inputs:ior: is driven by </Glass>\.inputs:ior"),
        ("/World/Ball.abbe:dispersion:vd=3", r"has no attribute"),
    ],
)
def test_values_that_cannot_be_set_are_errors(text, message):
    with pytest.raises(StageError, match=message):
        describe(STAGES / "variants.usda", overrides=[text])


def test_values_of_every_kind_of_type_are_read():
    from abbe.usd.description import Diagnostics
    from abbe.usd.stage import open_stage

    opened = open_stage(
        STAGES / "variants.usda",
        overrides=["/World.choice=b", "/World.flag=true", "/World.table=[(3, 4), (5, 6)]", "/World.file=@b.png@"],
        diagnostics=Diagnostics(),
    )
    prim = opened.stage.GetPrimAtPath("/World")
    assert prim.GetAttribute("choice").Get() == "b"
    assert prim.GetAttribute("flag").Get() is True
    assert list(prim.GetAttribute("table").Get()) == [(3, 4), (5, 6)]
    assert prim.GetAttribute("file").Get().path == "b.png"


def test_a_stage_in_memory_is_never_changed():
    stage = Usd.Stage.Open(str(STAGES / "variants.usda"))
    stage.GetPrimAtPath("/World/Ball").GetAttribute("radius").Set(9.0)
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.SetMetadata("metersPerUnit", 3.0)
        stage.GetPrimAtPath("/World/Ball").GetAttribute("radius").Set(8.0)
    before = [layer.ExportToString() for layer in stage.GetLayerStack()]
    plain = describe(stage)
    changed = describe(stage, overrides=["/Glass.inputs:ior=3"], variants=["/World{shape=ball}"])
    for description in (plain, changed):
        assert shape(description, "/World/Ball")["sphere"]["radius"] == 8.0
        assert description.document["stage"]["meters_per_unit"] == 3.0
    assert [layer.ExportToString() for layer in stage.GetLayerStack()] == before
    assert set(placements(describe(stage, variants=["/World{shape=none}"]))) == set()
    assert stage.GetPrimAtPath("/World/Ball")


# Composition


def test_what_does_not_compose_is_named_or_refused(capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    description = read("missing.usda")
    warnings = warned(description, "missing-reference")
    assert [warning["places"] for warning in warnings] == [["</Layer>"], ["</MaterialX>"], ["</Prim>"]]
    assert "not_here.usda" in warnings[0]["message"]
    assert "glass.mtlx@ is a MaterialX document" in warnings[1]["message"]
    assert "pip install 'abbe[mtlx]'" in warnings[1]["message"]
    assert capfd.readouterr().err == "", "USD's own warnings are ours to show"
    with pytest.raises(StageError, match=r"^</Layer>: .*not_here\.usda.*choose --missing warn"):
        describe(STAGES / "missing.usda", missing="error")
    with pytest.raises(UsageError, match=r"^missing 'maybe'"):
        describe(STAGES / "missing.usda", missing="maybe")


def test_search_paths_find_what_is_not_beside_the_stage(tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "stage").mkdir()
    (tmp_path / "lib" / "part.usda").write_text('#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Sphere "P"\n{\n}\n')
    (tmp_path / "stage" / "beside.usda").write_text('#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Sphere "P"\n{\n}\n')
    stage = tmp_path / "stage" / "s.usda"
    stage.write_text(
        '#usda 1.0\ndef "A" (\n references = @part.usda@\n)\n{\n}\ndef "B" (\n references = @beside.usda@\n)\n{\n}\n'
    )
    assert set(placements(describe(stage))) == {"/B"}
    assert set(placements(describe(stage, search_paths=[tmp_path / "lib"]))) == {"/A", "/B"}
    with pytest.raises(UsageError, match="is no folder"):
        describe(stage, search_paths=[tmp_path / "nope"])


# Bad input


def test_a_missing_file_is_a_file_not_found_error():
    with pytest.raises(FileNotFoundError, match=r"^/not/here\.usda: there is no such file"):
        describe("/not/here.usda")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.usda", b""),
        ("a.usda", b"#usda 1.0\ndef {{{"),
        ("a.usda", b"#usda 1.0\n\xff\xfe\x00"),
        ("a.usdc", b"PXR-USDC" + bytes(10)),
        ("a.usdc", b"PXR-USDC\0\x0c\0\0\0\0\0\0" + b"\xff" * 100),
        ("a.usdz", b"PK" + bytes(30)),
        ("a.usd", b"solid teapot"),
        ("a.txt", b"hello"),
        ("a", b"hello"),
    ],
)
def test_a_file_that_is_no_stage_is_one_line_with_place_and_remedy(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(StageError) as caught:
        describe(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and "\n" not in text and "pxrInternal" not in text


def test_a_folder_and_other_things_are_no_stages(tmp_path):
    with pytest.raises(StageError, match="is a folder"):
        describe(tmp_path)
    with pytest.raises(UsageError, match="is a int"):
        describe(5)
    with pytest.raises(UsageError, match="the path is empty"):
        describe("")
    with pytest.raises(UsageError, match="is not finite"):
        describe(STAGES / "render.usda", frame=float("nan"))


@pytest.mark.parametrize(
    ("type_name", "name", "value"),
    [
        ("Camera", "focalLength", 'string focalLength = "long"'),
        ("Camera", "fStop", "float2 fStop = (1, 2)"),
        ("Camera", "focusDistance", "float focusDistance = inf"),
        ("Camera", "clippingRange", "float clippingRange = 1"),
        ("Camera", "clippingRange", "float2 clippingRange = (nan, 1)"),
        ("Camera", "clippingRange", "float2 clippingRange = (0.5, -inf)"),
        ("RenderSettings", "resolution", 'string resolution = "HD"'),
        ("RenderSettings", "dataWindowNDC", "float4 dataWindowNDC = (0, 0, inf, 1)"),
        ("RenderSettings", "includedPurposes", "int includedPurposes = 3"),
        ("RenderSettings", "materialBindingPurposes", "int[] materialBindingPurposes = [3]"),
    ],
)
def test_values_that_decide_the_picture_are_never_guessed(type_name, name, value):
    with pytest.raises(StageError, match=rf"^</X>\.{name} = .*: is no"):
        describe(in_memory(f'def {type_name} "X"\n{{\n {value}\n}}\n'))


def test_values_of_odd_types_elsewhere_do_not_stop_the_reading():
    stage = in_memory(
        'def Mesh "M"\n{\n int visibility = 3\n float purpose = 2\n int orientation = 1\n int subdivisionScheme = 0\n'
        " point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n int[] faceVertexCounts = [3]\n"
        ' int[] faceVertexIndices = [0, 1, 2]\n string holeIndices = "x"\n token primvars:st = "s"\n int normals = 1\n'
        ' string doubleSided = ""\n}\n'
        'def Camera "C"\n{\n int projection = 4\n}\n'
        'def RenderProduct "P"\n{\n int productName = 3\n int productType = 3\n}\n'
        'def RenderVar "V"\n{\n int sourceName = 3\n}\n'
    )
    validate((description := describe(stage, product="/P")).document, description.arrays)


def test_odd_stage_metadata_is_repaired_with_a_warning():
    description = describe(in_memory('(\n metersPerUnit = -1\n upAxis = "X"\n)\n'))
    assert description.document["stage"]["meters_per_unit"] == 0.01
    assert description.document["stage"]["up_axis"] == "Y"
    assert len(warned(description, "unreadable-attribute")) == 2
    fallbacks = {"source": "test.usda", "meters_per_unit": 0.01, "up_axis": "Y", "time_codes_per_second": 24.0}
    assert describe(in_memory("")).document["stage"] == fallbacks


def test_without_usd_the_error_says_what_to_install():
    code = (
        "import sys; sys.modules['pxr'] = None\n"
        "from abbe.errors import AbbeError\n"
        "from abbe.usd import describe\n"
        "try: describe('x.usda')\n"
        "except ImportError as e: assert isinstance(e, AbbeError); print(e)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert "pip install 'abbe[usd]'" in result.stdout


# Time


def test_without_a_start_time_the_earliest_samples_are_read():
    text = 'def Sphere "S"\n{\n double radius.timeSamples = {\n 5: 2,\n 6: 3\n }\n}\n'
    description = describe(in_memory(text))
    assert "time_code" not in description.document["stage"]
    assert shape(description, "/S")["sphere"]["radius"] == 2.0
    default = describe(
        in_memory(text.replace("double radius.time", "double radius = 9\n double radius.time")), frame="default"
    )
    assert shape(default, "/S")["sphere"]["radius"] == 9.0


# Lists


def test_cameras_are_listed():
    cameras = list_cameras(STAGES / "render.usda")
    assert [(camera.path, camera.is_default) for camera in cameras] == [
        ("/First", False),
        ("/main_cam", True),
        ("/Side", False),
    ]
    assert cameras[1].focal_length == 20.0 and cameras[1].projection == "orthographic"
    assert list_cameras(STAGES / "variants.usda") == []


def test_settings_are_listed(tmp_path):
    text = (STAGES / "render.usda").read_text()
    text = text[: text.index('    def RenderSettings "Broken"')] + "}\n"
    path = tmp_path / "render.usda"
    path.write_text(text)
    main, preview = list_settings(path)
    assert (main.path, main.is_default, preview.path, preview.is_default) == (
        "/Render/Main",
        True,
        "/Render/Preview",
        False,
    )
    assert main.purposes == ("default", "proxy") and main.resolution == (640, 480) and main.camera == "/main_cam"
    assert [product.camera for product in main.products] == ["/main_cam", "/Side"]
    assert [var.source_name for var in main.products[0].vars] == ["Ci", "dispersion"]
    assert preview.resolution is None and preview.camera == "/First" and preview.products == ()
