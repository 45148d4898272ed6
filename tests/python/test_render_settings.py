"""Cameras and render settings from stage to file, against USD's own cameras and what OpenImageIO reads."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OpenImageIO", reason="the files are read by OpenImageIO")
pytest.importorskip("pxr.Usd", reason="stages need usd-core")

import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom

import abbe
import abbe.check

Run = Callable[..., Any]

SCENE = """#usda 1.0
(
    metersPerUnit = 0.01
    framesPerSecond = 24
    timeCodesPerSecond = 24
    startTimeCode = 1
)
def Plane "Wall"
{
    double width = 400
    double length = 400
    token axis = "Z"
    double3 xformOp:translate = (0, 0, -10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Main"
{
    float horizontalAperture = 30
    float verticalAperture = 20
    float focalLength = 40
    %(camera)s
    double3 xformOp:translate = (1, 2, 5)
    float3 xformOp:rotateXYZ = (3, -7, 11)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Camera "Side"
{
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Scope "Render"
{
    def RenderSettings "Settings"
    {
        rel camera = </Main>
        rel products = [</Render/Beauty>, </Render/Data>]
        uniform int2 resolution = (12, 8)
    }
    def RenderProduct "Beauty"
    {
        token productName = "<OS>.$F4.exr"
        rel orderedVars = [%(vars)s]
        %(product)s
    }
    def RenderProduct "Data"
    {
        token productName = "data.%%04d.exr"
        rel orderedVars = </Render/P>
        rel camera = </Side>
        uniform float4 dataWindowNDC = (-0.25, 0, 0.5, 1.25)
    }
    def RenderVar "P"
    {
        uniform string sourceName = "P"
    }
    %(prims)s
}
"""


def stage(camera: str = "", product: str = "", prims: str = "", extra_vars: str = "") -> Any:
    """The scene with these attributes of its camera and first product, and these prims."""
    names = ", ".join(["</Render/P>", *filter(None, [extra_vars])])
    text = SCENE % {"camera": camera, "product": product, "prims": prims, "vars": names}
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString(text)
    return Usd.Stage.Open(layer)


def beauty(opened: Any, **options: Any) -> Any:
    """The first product's film."""
    return abbe.render(opened, product="/Render/Beauty", **options)


def kinds(film: Any) -> dict[str, str]:
    """Messages of a film's warnings by kind."""
    return {warning["kind"]: warning["message"] for warning in film.statistics["warnings"]}


@pytest.mark.parametrize(
    "camera",
    [
        "float horizontalApertureOffset = 4\n    float verticalApertureOffset = -3",
        'token projection = "orthographic"\n    float horizontalApertureOffset = 4',
        'token projection = "orthographic"\n    float2 clippingRange = (-4, 1000)',
    ],
)
def test_pixels_see_what_usd_says_that_they_see(camera: str) -> None:
    opened = stage(camera)
    film = beauty(opened, aovs=["position"])
    frustum = UsdGeom.Camera.Get(opened, "/Main").GetCamera(Usd.TimeCode(1)).frustum
    through = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    matrix = np.array(film.metadata["worldToNDC"]).reshape(4, 4)
    for y in range(8):
        for x in range(12):
            seen = Gf.Vec3d(*map(float, film["position"][y, x]))
            x_ndc, y_ndc, _ = through.Transform(seen)
            assert abs(6 * (x_ndc + 1) - (x + 0.5)) < 1e-4 and abs(4 * (1 - y_ndc) - (y + 0.5)) < 1e-4
            ndc = np.append(film["position"][y, x], 1.0) @ matrix
            assert np.allclose(ndc[:2] / ndc[3] * [12, 8], [x + 0.5, y + 0.5], atol=1e-3)


def test_depth_of_field_is_as_the_stage_and_the_flag_say() -> None:
    lens = "float fStop = 1.4\n    float focusDistance = 6"
    pinhole = beauty(stage(), aovs=["position"], samples=16)["position"]
    spread = beauty(stage(lens), aovs=["position"], samples=16)["position"]
    assert not np.array_equal(pinhole, spread)
    # Centred samples of the lens see about what its centre sees.
    assert np.abs(pinhole - spread).max() < 0.2
    for options, product in (
        ({"depth_of_field": False}, ""),
        ({}, "uniform bool disableDepthOfField = 1"),
    ):
        assert np.array_equal(
            beauty(stage(lens, product), aovs=["position"], samples=16, **options)["position"], pinhole
        )
    off = stage(lens, "uniform bool disableDepthOfField = 1")
    assert np.array_equal(beauty(off, aovs=["position"], samples=16, depth_of_field=True)["position"], spread)
    assert "--samples 16" in kinds(beauty(stage(lens), aovs=["position"], samples=1))["depth-of-field"]


def test_exposure_is_what_usd_computes() -> None:
    attributes = """float exposure = 1.5
    float exposure:time = 0.125
    float exposure:iso = 320
    float exposure:fStop = 2.8
    float exposure:responsivity = 1.25"""
    opened = stage(attributes)
    camera = UsdGeom.Camera.Get(opened, "/Main")
    if not hasattr(camera, "ComputeLinearExposureScale"):
        pytest.skip("this USD computes no exposure scale")
    metadata = beauty(opened, aovs=["depth"]).metadata
    assert metadata["abbe:exposureScale"] == pytest.approx(camera.ComputeLinearExposureScale(), rel=1e-6)
    assert (metadata["expTime"], metadata["isoSpeed"]) == (0.125, 320.0)


def test_layers_and_headers_are_as_drivers_ask(tmp_path: Path) -> None:
    prims = """
    def RenderVar "N"
    {
        uniform string sourceName = "N"
        uniform token dataType = "normal3h"
        custom string driver:parameters:aov:channel_prefix = "cam."
    }
    def RenderVar "Far"
    {
        uniform string sourceName = "depth"
        custom string ri:driver:parameters:aov:name = "far"
        custom token driver:parameters:aov:format = "half"
    }
    def RenderVar "Near"
    {
        uniform string sourceName = "Z"
        custom int driver:parameters:aov:clearValue = 0
        custom bool driver:parameters:aov:multiSampled = 0
    }"""
    driver = """custom string driver:parameters:OpenEXR:compression = "piz"
        custom string driver:parameters:artist = "us"
        custom string ri:driver:parameters:comment = "a wall"
        custom string driver:parameters:OpenEXR:shot = "010"
        custom double driver:parameters:OpenEXR:take = 2.5"""
    lens = """float fStop = 4
    float focusDistance = 50
    double shutter:open = 0
    double shutter:close = 0.5"""
    opened = stage(lens, driver, prims, "</Render/N>, </Render/Far>, </Render/Near>")
    film = beauty(opened, depth_of_field=False)
    film.write(tmp_path / "out.exr")
    assert abbe.check.check(tmp_path / "out.exr").failures == []
    image = oiio.ImageInput.open(str(tmp_path / "out.exr"))
    spec = image.spec()
    types = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    assert {name: types[name] for name in ("P.X", "cam.N.X", "far.Z", "Near.Z")} == {
        "P.X": "float",
        "cam.N.X": "half",
        "far.Z": "float",
        "Near.Z": "float",
    }
    assert "half floats" in kinds(film)["half-format"] and "unused-aov-parameter" not in kinds(film)
    pixels = image.read_image("float").reshape(8, 12, -1)
    normals = pixels[:, :, spec.channelnames.index("cam.N.Z")]
    assert np.array_equal(normals, film["normal"][:, :, 2].astype(np.float16).astype(np.float32))
    values = {name: spec.get_string_attribute(name) for name in ("compression", "artist", "shot", "ImageDescription")}
    assert values == {"compression": "piz", "artist": "us", "shot": "010", "ImageDescription": "a wall"}
    assert spec.getattribute("take") == 2.5
    # OpenImageIO has names of its own for aperture and expTime.
    camera = {"FNumber": 4.0, "focus": 0.5, "nominalFocalLength": 40.0, "ExposureTime": 0.5 / 24}
    assert {name: spec.getattribute(name) for name in camera} == pytest.approx(camera)


def test_what_products_ask_for_in_vain_is_named() -> None:
    prims = """
    def RenderVar "Colour"
    {
        uniform string sourceName = "displayColor"
        uniform token sourceType = "primvar"
    }
    def RenderVar "Light"
    {
        uniform string sourceName = "C<RD>L"
        uniform token sourceType = "lpe"
    }"""
    deep = 'uniform token productType = "deepRaster"\n        custom int driver:parameters:asrgba = 1'
    film = beauty(stage("", deep, prims, "</Render/Colour>, </Render/Light>"))
    messages = [(w["places"], w["message"]) for w in film.statistics["warnings"]]
    # A light path expression is a layer under its variable's name.
    assert list(film) == ["position", "Light"]
    said = "\n".join(f"{places} {message}" for places, message in messages)
    for text in ("primvar 'displayColor'", "'deepRaster'", "asrgba"):
        assert text in said, said


# The command line


@pytest.fixture
def file(tmp_path: Path) -> Path:
    stage().GetRootLayer().Export(str(tmp_path / "scene.usda"))
    return tmp_path / "scene.usda"


def window(path: Path) -> SimpleNamespace:
    """Windows and camera of a file."""
    spec = oiio.ImageInput.open(str(path)).spec()
    return SimpleNamespace(
        data=(spec.x, spec.y, spec.width, spec.height),
        display=(spec.full_width, spec.full_height),
        camera=spec.get_string_attribute("abbe:camera"),
    )


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.exr"))


def test_every_product_has_its_camera_window_and_file_in_every_frame(run: Run, file: Path, tmp_path: Path) -> None:
    result = run("render", file, "--frames", "1:2", "--quiet")
    assert result.returncode == 0, result.stderr
    assert files(tmp_path) == ["Beauty.0001.exr", "Beauty.0002.exr", "data.0001.exr", "data.0002.exr"]
    first, data = window(tmp_path / "Beauty.0001.exr"), window(tmp_path / "data.0002.exr")
    assert (first.data, first.display, first.camera) == ((0, 0, 12, 8), (12, 8), "/Main")
    # A quarter beyond the left and a quarter beyond the top: y is up in NDC, down in the file.
    assert (data.data, data.display, data.camera) == ((-3, -2, 9, 10), (12, 8), "/Side")
    # A camera that is asked for is every product's.
    assert run("render", file, "--camera", "Side", "--quiet").returncode == 0
    assert window(tmp_path / "Beauty.0001.exr").camera == "/Side"


@pytest.mark.parametrize(
    ("out", "expected"),
    [
        ("<OS>.####.exr", ["Beauty.0001.exr", "Data.0001.exr"]),
        ("$F4.<N>.exr", ["0001.0.exr", "0001.1.exr"]),
        ("%03d_<OS>.exr", ["001_Beauty.exr", "001_Data.exr"]),
    ],
)
def test_out_names_several_products_with_their_tokens(
    run: Run, file: Path, tmp_path: Path, out: str, expected: list[str]
) -> None:
    result = run("render", file, "-o", out, "--frames", "1", "--quiet")
    assert result.returncode == 0, result.stderr
    assert files(tmp_path) == expected


def test_out_is_given_once(run: Run, file: Path) -> None:
    result = run("render", file, "a.exr", "-o", "b.exr")
    assert result.returncode == 2 and "--output b.exr" in result.stderr


def test_a_pass_and_settings_exclude_each_other(run: Run, file: Path) -> None:
    result = run("plan", file, "-rp", "/Render/Pass", "-rs", "/Render/Settings")
    assert result.returncode == 2 and "--render-pass" in result.stderr
    result = run("plan", file, "--renderPassPrimPath", "/Render/Pass")
    assert result.returncode == 1 and "not a RenderPass" in result.stderr


def test_settings_are_listed_with_what_is_not_usual(run: Run, file: Path) -> None:
    result = run("settings", file)
    assert result.returncode == 0, result.stderr
    assert "window -0.25, 0, 0.5, 1.25 (y up)" in result.stdout
    assert "P: P (raw, color3f)" in result.stdout


def test_flags_have_usdrecords_names(run: Run, file: Path, tmp_path: Path) -> None:
    (tmp_path / "over.usda").write_text('#usda 1.0\nover "Main"\n{\n    float focalLength = 80\n}\n')
    flags = ("--mask", "/Wall,/Main /Render", "--sessionLayer", "over.usda", "--purposes", "render,proxy")
    more = ("--imageWidth", "24", "-cam", "Main", "-rs", "/Render/Settings", "-f", "1", "--disableGpu")
    result = run("render", file, "<OS>.####.exr", *flags, *more, "--disableCameraLight", "--quiet")
    assert result.returncode == 0, result.stderr
    assert window(tmp_path / "Beauty.0001.exr").display == (24, 16)
    spec = oiio.ImageInput.open(str(tmp_path / "Beauty.0001.exr")).spec()
    assert spec.getattribute("nominalFocalLength") == pytest.approx(80)
