"""Images: every format against who wrote it, orientation, wrap modes, tiles, colour spaces, networks, the cache."""

import shutil

import numpy as np
import OpenImageIO as oiio
import PIL.Image
import pytest
from texture_stages import albedo, looked_up, node, texture, write

import abbe

RNG = np.random.default_rng(4)
ROWS, COLUMNS = 6, 8


def srgb(x):
    """IEC 61966-2-1 to linear light."""
    x = np.asarray(x, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def write_image(path, values, kind, **attributes):
    """Write an image with OpenImageIO; values as stored, (rows, columns, channels)."""
    rows, columns, channels = values.shape
    spec = oiio.ImageSpec(columns, rows, channels, kind)
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), oiio.geterror()
    assert out.write_image(np.ascontiguousarray(values)), out.geterror()
    out.close()
    return path


def pixels(channels, kind):
    if kind in ("uint8", "uint16"):
        return RNG.integers(0, np.iinfo(kind).max, (ROWS, COLUMNS, channels), endpoint=True).astype(kind)
    return RNG.uniform(0, 3, (ROWS, COLUMNS, channels)).astype(np.float16 if kind == "half" else np.float32)


def colors(values):
    """Three channels of an image of one to four, as numbers."""
    scale = {"u": np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1}.get(values.dtype.kind, 1)
    numbers = values.astype(np.float64) / scale
    return numbers[..., :3] if numbers.shape[2] >= 3 else np.repeat(numbers[..., :1], 3, axis=2)


FORMATS = [
    *[("png", kind, n) for kind in ("uint8", "uint16") for n in (1, 2, 3, 4)],
    *[("tif", kind, n) for kind in ("uint8", "uint16", "float") for n in (1, 3, 4) if (kind, n) != ("float", 1)],
    *[("exr", kind, n) for kind in ("half", "float") for n in (1, 3, 4)],
    ("tga", "uint8", 3),
    ("tga", "uint8", 4),
]


@pytest.mark.parametrize(("extension", "kind", "channels"), FORMATS)
def test_a_texel_is_what_was_written(tmp_path, extension, kind, channels):
    values = pixels(channels, kind)
    # Readers of TGA and PNG with alpha multiply: not what is stored.
    write_image(tmp_path / f"t.{extension}", values, kind, oiio__UnassociatedAlpha=1)
    seen = looked_up(tmp_path, texture(f"t.{extension}", 'token inputs:sourceColorSpace = "raw"'), (COLUMNS, ROWS))
    assert seen == pytest.approx(colors(values), rel=1e-6, abs=3e-6)


def test_radiance_files_are_read(tmp_path):
    values = pixels(3, "float")
    write_image(tmp_path / "t.hdr", values, "float")
    stored = oiio.ImageBuf(str(tmp_path / "t.hdr")).get_pixels(oiio.FLOAT)
    seen = looked_up(tmp_path, texture("t.hdr"), (COLUMNS, ROWS))
    assert seen == pytest.approx(stored, rel=1e-6, abs=3e-6)


@pytest.mark.parametrize("channels", [1, 3])
def test_jpeg_is_what_other_decoders_make_of_it(tmp_path, channels):
    values = np.tile(np.linspace(0, 255, COLUMNS, dtype=np.uint8)[None, :, None], (ROWS, 1, channels))
    write_image(tmp_path / "t.jpg", values, "uint8", CompressionQuality=95)
    stored = oiio.ImageBuf(str(tmp_path / "t.jpg")).get_pixels(oiio.UINT8)
    seen = looked_up(tmp_path, texture("t.jpg", 'token inputs:sourceColorSpace = "raw"'), (COLUMNS, ROWS))
    # Decoders may round the inverse transform differently.
    assert np.abs(seen * 255 - stored.astype(float)).max() <= 1.01


@pytest.mark.parametrize(
    ("kind", "channels", "expected"),
    [("uint8", 3, srgb), ("uint8", 4, srgb), ("uint8", 1, None), ("uint8", 2, None), ("uint16", 3, None)],
)
def test_auto_is_srgb_for_three_or_four_channels_of_eight_bits(tmp_path, kind, channels, expected):
    values = pixels(channels, kind)
    if channels == 2:
        PIL.Image.fromarray(values, "LA").save(tmp_path / "t.png")
    else:
        write_image(tmp_path / "t.tif", values, kind, oiio__UnassociatedAlpha=1)
    numbers = colors(values)
    seen = looked_up(tmp_path, texture("t.png" if channels == 2 else "t.tif"), (COLUMNS, ROWS))
    assert seen == pytest.approx(expected(numbers) if expected else numbers, rel=1e-6, abs=3e-6)


def test_a_png_says_itself_that_it_is_srgb_or_linear(tmp_path):
    values = pixels(3, "uint16")
    write_image(tmp_path / "t.png", values, "uint16", oiio__ColorSpace="srgb_rec709_scene")
    content = (tmp_path / "t.png").read_bytes()
    assert b"sRGB" in content or b"gAMA" in content
    seen = looked_up(tmp_path, texture("t.png"), (COLUMNS, ROWS))
    assert seen == pytest.approx(srgb(colors(values)), rel=1e-6, abs=3e-6)


@pytest.mark.parametrize(
    ("name", "rgb", "expected"),
    [
        ("raw", (0.2, 0.5, 0.8), (0.2, 0.5, 0.8)),
        ("sRGB", (0.2, 0.5, 0.8), tuple(srgb((0.2, 0.5, 0.8)))),
        ("srgb_texture", (0.2, 0.5, 0.8), tuple(srgb((0.2, 0.5, 0.8)))),
        ("lin_rec709_scene", (0.2, 0.5, 0.8), (0.2, 0.5, 0.8)),
        ("g22_rec709", (0.2, 0.5, 0.8), tuple(np.power((0.2, 0.5, 0.8), 2.2))),
        # The matrices that the ACES configurations of OpenColorIO publish (Bradford).
        ("acescg", (1.0, 0.0, 0.0), (1.7050510, -0.1302564, -0.0240033)),
        ("lin_ap1_scene", (0.0, 1.0, 0.0), (-0.6217921, 1.1408047, -0.1289689)),
        ("lin_ap0", (0.0, 0.0, 1.0), (-0.3875552, -0.0962392, 1.1683534)),
        # ITU-R BT.2087: BT.2020 to BT.709.
        ("lin_rec2020_scene", (1.0, 0.0, 0.0), (1.6605, -0.1246, -0.0182)),
    ],
)
@pytest.mark.parametrize("stated", ["input", "metadata"])
def test_colour_spaces_have_their_definition(tmp_path, name, rgb, expected, stated):
    if stated == "input" and name not in ("raw", "sRGB"):
        pytest.skip("UsdUVTexture's own input knows three words")
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), rgb, np.float32), "float")
    nodes = texture("t.exr", f'token inputs:sourceColorSpace = "{name}"' if stated == "input" else "")
    if stated == "metadata":
        nodes = nodes.replace("@t.exr@", f'@t.exr@ (colorSpace = "{name}")')
    seen = looked_up(tmp_path, nodes, (2, 2))
    assert seen[0, 0] == pytest.approx(expected, abs=6e-5 if "2020" in name else 2e-6)


def test_a_space_of_a_prim_holds_for_what_is_below_it(tmp_path):
    from pxr import Usd

    if not hasattr(Usd, "ColorSpaceAPI"):
        pytest.skip("this USD has no ColorSpaceAPI")
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), (1, 0, 0), np.float32), "float")
    path = write(tmp_path, texture("t.exr"))
    stage = Usd.Stage.Open(str(path))
    api = Usd.ColorSpaceAPI.Apply(stage.GetPrimAtPath("/World/M"))
    api.CreateColorSpaceNameAttr("lin_ap1_scene")
    seen = np.array(abbe.render(stage, aovs=["albedo"], width=2, height=2)["albedo"])
    assert seen[0, 0] == pytest.approx((1.7050510, -0.1302564, -0.0240033), abs=2e-6)


def test_a_space_that_is_unknown_is_named(tmp_path):
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), 0.5, np.float32), "float")
    path = write(tmp_path, texture("t.exr").replace("@t.exr@", '@t.exr@ (colorSpace = "arri_logc4")'))
    film = abbe.render(path, aovs=["albedo"], width=2, height=2)
    (warning,) = [w for w in film.statistics["warnings"] if w["kind"] == "unread-network"]
    assert "(the colour space 'arri_logc4'): its default is used" in warning["message"]
    assert np.array(film["albedo"])[0, 0] == pytest.approx([0.18] * 3)


def test_the_first_row_is_on_top_and_v_goes_up(tmp_path):
    values = np.zeros((4, 4, 3), np.float32)
    values[0, 3] = 1
    write_image(tmp_path / "t.exr", values, "float")
    seen = looked_up(tmp_path, texture("t.exr"), (4, 4))
    assert seen[0, 3].min() == 1 and seen.sum() == 3


def test_between_texels_is_the_mean_of_linear_light(tmp_path):
    values = pixels(3, "uint8")
    write_image(tmp_path / "t.png", values, "uint8")
    linear = srgb(colors(values))
    # Twice as many pixels: their centres lie at a quarter and three quarters of the way between texels.
    seen = looked_up(tmp_path, texture("t.png"), (2 * COLUMNS, 2 * ROWS))

    def along(a, axis):
        first = np.moveaxis(a, axis, 0)
        low, high = first[:-1], first[1:]
        pairs = np.stack([0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high], axis=1)
        return np.moveaxis(pairs.reshape(-1, *first.shape[1:]), 0, axis)

    assert seen[1:-1, 1:-1] == pytest.approx(along(along(linear, 0), 1), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("mode", ["clamp", "repeat", "mirror", "black", "useMetadata"])
def test_wrap_modes_are_those_of_the_specification(tmp_path, mode):
    values = pixels(3, "float")
    write_image(tmp_path / "t.exr", values, "float")
    st = "[(-2, -2), (3, -2), (3, 3), (-2, 3)]"
    wrap = f'token inputs:wrapS = "{mode}"\n token inputs:wrapT = "{mode}"'
    seen = looked_up(tmp_path, texture("t.exr", wrap), (5 * COLUMNS, 5 * ROWS), st=st)
    pad = ((2 * ROWS, 2 * ROWS), (2 * COLUMNS, 2 * COLUMNS), (0, 0))
    if mode in ("black", "useMetadata"):
        expected = np.pad(values, pad)
    else:
        expected = np.pad(values, pad, mode={"clamp": "edge", "repeat": "wrap", "mirror": "symmetric"}[mode])
    assert seen == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_scale_bias_and_channels(tmp_path):
    values = pixels(4, "float")
    write_image(tmp_path / "t.exr", values, "float")
    inputs = "float4 inputs:scale = (2, 3, 4, 5)\n float4 inputs:bias = (-1, 0.5, 0.25, 0)"
    seen = looked_up(tmp_path, texture("t.exr", inputs), (COLUMNS, ROWS))
    assert seen == pytest.approx(values[..., :3] * [2, 3, 4] + np.array([-1, 0.5, 0.25]), rel=1e-6, abs=3e-6)
    for channel in range(4):
        surface = f"color3f inputs:diffuseColor.connect = </World/M/T.outputs:{'rgba'[channel]}>"
        path = write(tmp_path, texture("t.exr"), surface)
        assert albedo(path, (COLUMNS, ROWS)) == pytest.approx(np.repeat(values[..., channel, None], 3, 2), abs=3e-6)


def test_transform2d_scales_then_turns_then_moves(tmp_path):
    nodes = texture("t.exr").replace("</World/M/R.outputs:result>", "</World/M/X.outputs:result>") + node(
        "UsdTransform2d",
        "float2 inputs:in.connect = </World/M/R.outputs:result>\n float2 inputs:scale = (2, 0.5)\n"
        "float inputs:rotation = 30\n float2 inputs:translation = (0.1, 0.2)",
        "float2 outputs:result",
        "X",
    )
    # An image of its own coordinates: red is u, green is v.
    n = 64
    u, v = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    ramp = np.stack([u, v, 0 * u], axis=2).astype(np.float32)
    write_image(tmp_path / "t.exr", ramp, "float")
    inputs = 'token inputs:wrapS = "repeat"\n token inputs:wrapT = "repeat"\n'
    seen = looked_up(tmp_path, nodes.replace("asset inputs:file", inputs + "asset inputs:file"), (n, n))
    x, y = 2 * u, 0.5 * v
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    expected = np.stack([(c * x - s * y + 0.1) % 1, (s * x + c * y + 0.2) % 1], axis=2)
    inside = ((expected > 1 / n) & (expected < 1 - 1 / n)).all(axis=2)
    assert inside.mean() > 0.8
    assert seen[inside][:, :2] == pytest.approx(expected[inside], abs=1e-5)


def test_udim_tiles_are_found_and_missing_ones_are_the_fallback(tmp_path):
    for number, red in ((1001, 0.1), (1002, 0.2), (1011, 0.3)):
        write_image(tmp_path / f"t.{number}.exr", np.full((2, 2, 3), (red, 0, 0), np.float32), "float")
    nodes = texture("t.<UDIM>.exr", "float4 inputs:fallback = (0.9, 0.8, 0.7, 1)")
    seen = looked_up(tmp_path, nodes, (4, 4), st="[(0, 0), (2, 0), (2, 2), (0, 2)]")
    assert seen[3, 0] == pytest.approx([0.1, 0, 0])
    assert seen[3, 3] == pytest.approx([0.2, 0, 0])
    assert seen[0, 0] == pytest.approx([0.3, 0, 0])
    assert seen[0, 3] == pytest.approx([0.9, 0.8, 0.7])


def test_a_missing_image_is_the_fallback_or_an_error(tmp_path):
    path = write(
        tmp_path,
        texture("none.png", "float4 inputs:fallback = (0.4, 0.5, 0.6, 1)\n float4 inputs:scale = (9, 9, 9, 9)"),
    )
    film = abbe.render(path, aovs=["albedo"], width=4, height=4)
    assert np.array(film["albedo"])[0, 0] == pytest.approx([0.4, 0.5, 0.6])
    (warning,) = [w for w in film.statistics["warnings"] if w["kind"] == "missing-texture"]
    assert warning["places"] == ["</World/M/T>.inputs:file = 'none.png'"] and "is not found" in warning["message"]
    # Nothing looks it up: nobody misses it.
    assert not abbe.render(path, aovs=["depth"], width=4, height=4, missing="error").statistics["warnings"]
    with pytest.raises(abbe.StageError, match=r"^</World/M/T>\.inputs:file = 'none\.png': the image is not found"):
        abbe.render(path, aovs=["albedo"], width=4, height=4, missing="error")


def png_of_absurd_size(path):
    import struct
    import zlib

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 6, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" * 99)) + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("how", ["text", "empty", "cut", "absurd"])
def test_an_unreadable_image_is_named(tmp_path, how):
    file = tmp_path / "t.png"
    write_image(file, pixels(3, "uint8"), "uint8")
    if how == "absurd":
        png_of_absurd_size(file)
    else:
        file.write_bytes({"text": b"no image", "empty": b"", "cut": file.read_bytes()[:60]}[how])
    path = write(tmp_path, texture("t.png", "float4 inputs:fallback = (0.4, 0.5, 0.6, 1)"))
    film = abbe.render(path, aovs=["albedo"], width=4, height=4)
    assert np.array(film["albedo"])[1, 1] == pytest.approx([0.4, 0.5, 0.6])
    (warning,) = [w for w in film.statistics["warnings"] if w["kind"] == "unreadable-texture"]
    assert warning["places"] == ["</World/M/T>.inputs:file = 't.png'"] and warning["message"].startswith("the image ")
    if how == "absurd":
        assert "100000 x 100000" in warning["message"]
    with pytest.raises(abbe.StageError, match="--missing warn"):
        abbe.render(path, aovs=["albedo"], width=4, height=4, missing="error")


def test_images_are_read_when_something_looks_them_up(tmp_path):
    write_image(tmp_path / "t.exr", pixels(3, "float"), "float")
    path = write(tmp_path, texture("t.exr"))
    counts = abbe.render(path, aovs=["uv"], width=4, height=4).statistics["textures"]
    assert (counts["named"], counts["read"]) == (1, 0)
    counts = abbe.render(path, aovs=["albedo"], width=4, height=4).statistics["textures"]
    assert (counts["named"], counts["read"], counts["texel_bytes"]) == (1, 1, ROWS * COLUMNS * 12)
    assert counts["file_bytes"] == (tmp_path / "t.exr").stat().st_size


def test_what_does_not_fit_into_memory_has_the_same_bits(tmp_path):
    rng = np.random.default_rng(1)
    for k in range(3):
        write_image(tmp_path / f"t.{1001 + k}.png", rng.integers(0, 255, (300, 500, 3)).astype(np.uint8), "uint8")
    path = write(tmp_path, texture("t.<UDIM>.png"), st="[(0, 0), (3, 0), (3, 1), (0, 1)]")
    scene = {memory: abbe.Scene.from_stage(path) for memory in (100, 1)}
    films = {m: s.render(aovs=["albedo"], width=150, height=40, texture_memory=m, threads=3) for m, s in scene.items()}
    counts = films[1].statistics["textures"]
    assert counts["read"] == 3 and counts["spilled_bytes"] > 0
    assert films[100].statistics["textures"]["spilled_bytes"] == 0
    assert np.array_equal(films[1]["albedo"], films[100]["albedo"])
    assert len(np.unique(films[1]["albedo"])) > 1000


def test_an_exported_scene_has_its_images_or_names_them(tmp_path):
    values = pixels(3, "float")
    write_image(tmp_path / "t.exr", values, "float")
    scene = abbe.Scene.from_stage(write(tmp_path, texture("t.exr")))
    scene.save(tmp_path / "named.safetensors")
    scene.save(tmp_path / "whole.safetensors", embed=True)
    options = {"aovs": ["albedo"], "width": COLUMNS, "height": ROWS}
    expected = np.array(scene.render(**options)["albedo"])
    assert expected == pytest.approx(values, abs=3e-6)
    assert np.array_equal(abbe.Scene.load(tmp_path / "named.safetensors").render(**options)["albedo"], expected)
    (tmp_path / "t.exr").unlink()
    assert np.array_equal(abbe.Scene.load(tmp_path / "whole.safetensors").render(**options)["albedo"], expected)
    film = abbe.Scene.load(tmp_path / "named.safetensors").render(**options)
    assert [w["kind"] for w in film.statistics["warnings"]] == ["unreadable-texture"]


def test_images_inside_of_a_package_are_read_without_usd(tmp_path):
    from pxr import UsdUtils

    values = pixels(3, "uint8")
    write_image(tmp_path / "t.png", values, "uint8")
    path = write(tmp_path, texture("t.png"))
    package = tmp_path / "square.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(path), str(package))
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.move(package, alone / "square.usdz")
    scene = abbe.Scene.from_stage(alone / "square.usdz")
    scene.save(tmp_path / "scene.safetensors")
    film = abbe.Scene.load(tmp_path / "scene.safetensors").render(aovs=["albedo"], width=COLUMNS, height=ROWS)
    assert np.array(film["albedo"]) == pytest.approx(srgb(colors(values)), rel=1e-6, abs=3e-6)


# Networks


def image(file, inputs="", name="I", kind="color3"):
    identifier = f"ND_image_{kind}"
    return node(identifier, f"asset inputs:file = @{file}@\n {inputs}", f"{TYPES[kind]} outputs:out", name)


TYPES = {"color3": "color3f", "color4": "color4f", "float": "float", "vector2": "float2", "vector3": "float3"}
OUT = "color3f inputs:base_color.connect = </World/M/T.outputs:out>\n float inputs:base = 1"
STANDARD = {"surface": OUT, "shader": "ND_standard_surface_surfaceshader", "terminal": "mtlx:"}


def of_two(category, inputs, kind="color3", types="color3f"):
    """A node over the images A and B."""
    lines = "\n".join(
        f"{types} inputs:{name}.connect = </World/M/{source}.outputs:out>" for name, source in inputs.items()
    )
    return node(f"ND_{category}_{kind}", lines)


A, B = pixels(3, "float"), pixels(3, "float")
LUMA = np.array([0.2722287, 0.6740818, 0.0536895])
NODES = {
    "add": (of_two("add", {"in1": "A", "in2": "B"}), A + B),
    "subtract": (of_two("subtract", {"in1": "A", "in2": "B"}), A - B),
    "multiply": (of_two("multiply", {"in1": "A", "in2": "B"}), A * B),
    "divide": (of_two("divide", {"in1": "A", "in2": "B"}), A / B),
    "power": (of_two("power", {"in1": "A", "in2": "B"}), A**B),
    "min": (of_two("min", {"in1": "A", "in2": "B"}), np.minimum(A, B)),
    "max": (of_two("max", {"in1": "A", "in2": "B"}), np.maximum(A, B)),
    "modulo": (of_two("modulo", {"in1": "A", "in2": "B"}), np.mod(A, B)),
    "screen": (of_two("screen", {"fg": "A", "bg": "B"}), A + B - A * B),
    "invert": (node("ND_invert_color3", "color3f inputs:in.connect = </World/M/A.outputs:out>"), 1 - A),
    "mix": (
        node(
            "ND_mix_color3",
            "color3f inputs:fg.connect = </World/M/A.outputs:out>\n"
            "color3f inputs:bg.connect = </World/M/B.outputs:out>\n float inputs:mix = 0.25",
        ),
        0.25 * A + 0.75 * B,
    ),
    "clamp": (node("ND_clamp_color3FA", "color3f inputs:in.connect = </World/M/A.outputs:out>"), np.clip(A, 0, 1)),
    "remap": (
        node(
            "ND_remap_color3FA",
            "color3f inputs:in.connect = </World/M/A.outputs:out>\n"
            "float inputs:inlow = 0.5\n float inputs:inhigh = 2\n float inputs:outlow = 1\n float inputs:outhigh = 4",
        ),
        1 + (A - 0.5) * 3 / 1.5,
    ),
    "luminance": (
        node("ND_luminance_color3", "color3f inputs:in.connect = </World/M/A.outputs:out>"),
        np.repeat((A @ LUMA)[..., None], 3, 2),
    ),
    "saturate": (
        node("ND_saturate_color3", "color3f inputs:in.connect = </World/M/A.outputs:out>\n float inputs:amount = 0.5"),
        0.5 * A + 0.5 * (A @ LUMA)[..., None],
    ),
    "contrast": (
        node(
            "ND_contrast_color3",
            "color3f inputs:in.connect = </World/M/A.outputs:out>\n color3f inputs:amount = (2, 2, 2)",
        ),
        (A - 0.5) * 2 + 0.5,
    ),
    "swizzle": (
        node(
            "ND_swizzle_color3_color3",
            'color3f inputs:in.connect = </World/M/A.outputs:out>\n string inputs:channels = "bg1"',
        ),
        np.stack([A[..., 2], A[..., 1], np.ones_like(A[..., 0])], 2),
    ),
    "hsv": (
        node("ND_hsvtorgb_color3", "color3f inputs:in.connect = </World/M/H.outputs:out>")
        + node("ND_rgbtohsv_color3", "color3f inputs:in.connect = </World/M/A.outputs:out>", name="H"),
        A,
    ),
    "ifgreater": (
        node(
            "ND_ifgreater_color3",
            "float inputs:value1.connect = </World/M/E.outputs:out>\n float inputs:value2 = 1.5\n"
            "color3f inputs:in1.connect = </World/M/A.outputs:out>\n"
            "color3f inputs:in2.connect = </World/M/B.outputs:out>",
        )
        + node(
            "ND_extract_color3",
            "color3f inputs:in.connect = </World/M/A.outputs:out>\n int inputs:index = 1",
            "float outputs:out",
            "E",
        ),
        np.where(A[..., 1:2] > 1.5, A, B),
    ),
    "combine": (
        node(
            "ND_combine3_color3",
            "float inputs:in1.connect = </World/M/P.outputs:outb>\n float inputs:in2 = 0.5\n"
            "float inputs:in3.connect = </World/M/P.outputs:outr>",
        )
        + node(
            "ND_separate3_color3",
            "color3f inputs:in.connect = </World/M/A.outputs:out>",
            "float outputs:outr\n float outputs:outb",
            "P",
        ),
        np.stack([A[..., 2], np.full_like(A[..., 0], 0.5), A[..., 0]], 2),
    ),
}


@pytest.mark.parametrize("name", NODES)
def test_nodes_compute_what_materialx_says(tmp_path, name):
    write_image(tmp_path / "a.exr", A, "float")
    write_image(tmp_path / "b.exr", B, "float")
    nodes, expected = NODES[name]
    seen = looked_up(tmp_path, image("a.exr", name="A") + image("b.exr", name="B") + nodes, (COLUMNS, ROWS), **STANDARD)
    assert seen == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_materialx_image_repeats_and_its_constant_mode_sees_the_default(tmp_path):
    write_image(tmp_path / "a.exr", A, "float")
    st = "[(-1, -1), (2, -1), (2, 2), (-1, 2)]"
    pad = ((ROWS, ROWS), (COLUMNS, COLUMNS), (0, 0))
    size = (3 * COLUMNS, 3 * ROWS)
    seen = looked_up(tmp_path, image("a.exr", name="T"), size, st=st, **STANDARD)
    assert seen == pytest.approx(np.pad(A, pad, mode="wrap"), rel=1e-5, abs=1e-5)
    modes = 'string inputs:uaddressmode = "constant"\n string inputs:vaddressmode = "constant"\n'
    modes += "color3f inputs:default = (5, 6, 7)"
    seen = looked_up(tmp_path, image("a.exr", modes, name="T"), size, st=st, **STANDARD)
    expected = np.stack([np.pad(A[..., k], pad[:2], constant_values=5 + k) for k in range(3)], 2)
    assert seen == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_materialx_images_have_the_space_that_is_stated_for_them(tmp_path):
    values = pixels(3, "uint8")
    write_image(tmp_path / "a.png", values, "uint8")
    numbers = colors(values)
    seen = looked_up(tmp_path, image("a.png", name="T"), (COLUMNS, ROWS), **STANDARD)
    assert seen == pytest.approx(numbers, rel=1e-6, abs=3e-6)
    stated = image("a.png", name="T").replace("@a.png@", '@a.png@ (colorSpace = "srgb_texture")')
    seen = looked_up(tmp_path, stated, (COLUMNS, ROWS), **STANDARD)
    assert seen == pytest.approx(srgb(numbers), rel=1e-6, abs=3e-6)


def test_tiled_images_and_place2d(tmp_path):
    write_image(tmp_path / "a.exr", A, "float")
    tiled = node("ND_tiledimage_color3", "asset inputs:file = @a.exr@\n float2 inputs:uvtiling = (2, 3)")
    seen = looked_up(tmp_path, tiled, (2 * COLUMNS, 3 * ROWS), **STANDARD)
    assert seen == pytest.approx(np.tile(A, (3, 2, 1)), rel=1e-5, abs=1e-5)
    placed = (
        image("a.exr", "float2 inputs:texcoord.connect = </World/M/P.outputs:out>", "T")
        + node(
            "ND_place2d_vector2",
            "float2 inputs:texcoord.connect = </World/M/C.outputs:out>\n"
            "float2 inputs:pivot = (0.5, 0.5)\n float inputs:rotate = 180",
            "float2 outputs:out",
            "P",
        )
        + node("ND_texcoord_vector2", "", "float2 outputs:out", "C")
    )
    seen = looked_up(tmp_path, placed, (COLUMNS, ROWS), **STANDARD)
    assert seen == pytest.approx(A[::-1, ::-1], rel=1e-4, abs=1e-4)


def test_a_node_that_is_not_understood_is_named_and_the_default_stays(tmp_path):
    noise = node("ND_fractal3d_color3", "float inputs:amplitude = 1")
    film = abbe.render(write(tmp_path, noise, **STANDARD), aovs=["albedo"], width=2, height=2)
    (warning,) = [w for w in film.statistics["warnings"] if w["kind"] == "unread-network"]
    assert warning["places"] == ["</World/M/S>.inputs:base_color"]
    assert "(the node 'ND_fractal3d_color3'): its default is used" in warning["message"]
    assert np.array(film["albedo"])[0, 0] == pytest.approx([0.8] * 3)


def test_networks_without_an_end_and_too_deep_ones_are_cut(tmp_path):
    loop = node("ND_add_color3", "color3f inputs:in1.connect = </World/M/U.outputs:out>")
    loop += node("ND_add_color3", "color3f inputs:in1.connect = </World/M/T.outputs:out>", name="U")
    film = abbe.render(write(tmp_path, loop, **STANDARD), aovs=["albedo"], width=2, height=2)
    assert "shading-network" in [w["kind"] for w in film.statistics["warnings"]]
    deep = "".join(
        node(
            "ND_add_color3", f"color3f inputs:in1.connect = </World/M/N{k + 1}.outputs:out>", name=f"N{k}" if k else "T"
        )
        for k in range(300)
    )
    deep += image("a.exr", name="N300")
    film = abbe.render(write(tmp_path, deep, **STANDARD), aovs=["albedo"], width=2, height=2)
    assert "shading-network" in [w["kind"] for w in film.statistics["warnings"]]


# Primvars


@pytest.mark.parametrize(
    ("interpolation", "count"), [("constant", 1), ("uniform", 1), ("vertex", 4), ("varying", 4), ("faceVarying", 4)]
)
def test_primvars_are_looked_up_by_their_name(tmp_path, interpolation, count):
    corners = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)][:count]
    square = f'color3f[] primvars:paint = {corners} (interpolation = "{interpolation}")'
    reader = node("UsdPrimvarReader_float3", 'string inputs:varname = "paint"', "float3 outputs:result")
    surface = "color3f inputs:diffuseColor.connect = </World/M/T.outputs:result>"
    seen = looked_up(tmp_path, reader, (4, 4), surface=surface, square=square)
    # The corner that is cut off last: (0, 0), (1, 0), (1, 1), (0, 1).
    if count == 1:
        assert np.unique(seen.reshape(-1, 3), axis=0) == pytest.approx(np.array([[1, 0, 0]]))
    else:
        # Linear over each of the two triangles, so it is enough to look at pixels of one vertex each.
        assert seen[3, 0] == pytest.approx([0.75, 0.25, 0], abs=0.26)
        assert seen[3, 3].argmax() == 1 and seen[0, 3].argmax() == 2


def test_constant_primvars_come_from_ancestors_and_analytic_shapes_have_them(tmp_path):
    square = "double radius = 0.5"
    reader = node("UsdPrimvarReader_float3", 'string inputs:varname = "paint"', "float3 outputs:result")
    surface = "color3f inputs:diffuseColor.connect = </World/M/T.outputs:result>"
    path = write(tmp_path, reader, surface, square=square)
    text = path.read_text().replace('def Mesh "Square"', 'def Sphere "Square"')
    text = text.replace('def Xform "World"\n{', 'def Xform "World"\n{\n    color3f primvars:paint = (0.25, 0.5, 0.75)')
    path.write_text(text)
    assert albedo(path, (5, 5))[4, 0] == pytest.approx([0.25, 0.5, 0.75])
    path.write_text(text.replace(square, square + "\n color3f[] primvars:paint = [(0.1, 0.2, 0.3)]"))
    assert albedo(path, (5, 5))[4, 0] == pytest.approx([0.1, 0.2, 0.3])


def test_what_has_no_material_shows_its_display_color(tmp_path):
    path = write(
        tmp_path, "", "", square='color3f[] primvars:displayColor = [(0.1, 0.6, 0.3)] (interpolation = "constant")'
    )
    text = path.read_text().replace("rel material:binding = </World/M>", "")
    path.write_text(text)
    assert albedo(path, (2, 2))[0, 0] == pytest.approx([0.1, 0.6, 0.3])
    path.write_text(text.replace("primvars:displayColor", "primvars:other"))
    assert albedo(path, (2, 2))[0, 0] == pytest.approx([0.18] * 3)


def test_only_the_primvars_that_are_looked_up_cross(tmp_path):
    square = 'color3f[] primvars:paint = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)] (interpolation = "vertex")'
    path = write(tmp_path, "", "", square=square)
    (shape,) = abbe.Scene.from_stage(path).document["shapes"]
    assert shape["mesh"]["primvars"] == {} and shape["mesh"]["uv_name"] == "st"


# Materials


@pytest.mark.parametrize(
    ("shader", "inputs", "expected"),
    [
        ("UsdPreviewSurface", "", [0.18] * 3),
        ("UsdPreviewSurface", "color3f inputs:diffuseColor = (0.1, 0.2, 0.3)", [0.1, 0.2, 0.3]),
        ("UsdPreviewSurface", "color3f inputs:diffuseColor = (1, 0.8, 0.3)\n float inputs:metallic = 1", [1, 0.8, 0.3]),
        (
            "UsdPreviewSurface",
            "int inputs:useSpecularWorkflow = 1\n color3f inputs:diffuseColor = (1, 1, 0)\n"
            "color3f inputs:specularColor = (0.5, 0.25, 0)",
            [1.0, 0.75, 0],
        ),
        ("UsdPreviewSurface", "float inputs:opacity = 0\n color3f inputs:diffuseColor = (0.1, 0.2, 0.3)", [1, 1, 1]),
        ("ND_standard_surface_surfaceshader", "", [0.8] * 3),
        (
            "ND_standard_surface_surfaceshader",
            "float inputs:base = 0.5\n color3f inputs:base_color = (1, 0.5, 0)",
            [0.5, 0.25, 0],
        ),
        ("ND_standard_surface_surfaceshader", "float inputs:transmission = 1", [1, 1, 1]),
        (
            "ND_standard_surface_surfaceshader",
            "float inputs:transmission = 1\n color3f inputs:transmission_color = (1, 0.5, 0.2)",
            [1, 0.5, 0.2],
        ),
        (
            "ND_open_pbr_surface_surfaceshader",
            "float inputs:transmission_weight = 1\n color3f inputs:transmission_color = (1, 0.5, 0.2)\n"
            "float inputs:transmission_depth = 2",
            [1, 1, 1],
        ),
        ("ND_open_pbr_surface_surfaceshader", "float inputs:base_weight = 0.5", [0.4] * 3),
        ("ND_gltf_pbr_surfaceshader", "color3f inputs:base_color = (0.2, 0.4, 0.6)", [0.2, 0.4, 0.6]),
        ("AbbeGlass", "", [1, 1, 1]),
    ],
)
def test_albedo_is_what_denoisers_expect(tmp_path, shader, inputs, expected):
    assert looked_up(tmp_path, "", (2, 2), surface=inputs, shader=shader)[0, 0] == pytest.approx(expected)


CUT_OUTS = {
    "threshold": ("UsdPreviewSurface", "float inputs:opacityThreshold = 0.3", "opacity", 0.3, "hole"),
    "presence": ("UsdPreviewSurface", 'token inputs:opacityMode = "presence"', "opacity", 0.5, "hole"),
    "transparent": ("UsdPreviewSurface", "", "opacity", 0.5, "glass"),
    "standard": ("ND_standard_surface_surfaceshader", "", "opacity", 0.5, "hole"),
    "open_pbr": ("ND_open_pbr_surface_surfaceshader", "", "geometry_opacity", 0.5, "hole"),
    "gltf mask": (
        "ND_gltf_pbr_surfaceshader",
        "int inputs:alpha_mode = 1\n float inputs:alpha_cutoff = 0.7",
        "alpha",
        0.7,
        "hole",
    ),
    "gltf blend": ("ND_gltf_pbr_surfaceshader", "int inputs:alpha_mode = 2", "alpha", 0.5, "hole"),
    "gltf opaque": ("ND_gltf_pbr_surfaceshader", "", "alpha", 0.0, "hole"),
}
BEHIND = """    def Mesh "Behind"
    {
        uniform token subdivisionScheme = "none"
        point3f[] points = [(-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        color3f[] primvars:displayColor = [(0.9, 0.1, 0.5)]
    }
"""


@pytest.mark.parametrize("name", CUT_OUTS)
def test_textured_opacity_decides_from_texel_to_texel(tmp_path, name):
    shader, inputs, opacity, limit, kind = CUT_OUTS[name]
    values = RNG.uniform(0, 1, (ROWS, COLUMNS, 1)).astype(np.float32)
    write_image(tmp_path / "o.exr", values, "float")
    surface = f"{inputs}\n float inputs:{opacity}.connect = </World/M/T.outputs:r>"
    path = write(tmp_path, texture("o.exr"), surface, shader=shader, extra=BEHIND)
    aovs = ["prim_id", "refracted_prim_id", "interfaces", "dispersion"]
    film = abbe.render(path, aovs=aovs, width=COLUMNS, height=ROWS)
    below = values[..., 0] < limit
    first, end = (np.array(film[aov])[..., 0] for aov in aovs[:2])
    assert np.array_equal(end == 2, below)
    assert np.array_equal(first == 2, below & (kind == "hole"))
    assert np.array_equal(np.array(film["interfaces"])[..., 0] > 0, below & (kind == "glass"))
    assert not [w for w in film.statistics["warnings"] if w["kind"] == "textured-input"]
    assert film.statistics["textures"]["read"] == (name != "gltf opaque")


def test_refracted_albedo_is_that_of_what_is_seen_through_the_glass(tmp_path):
    path = write(tmp_path, "", "float inputs:opacity = 0\n float inputs:roughness = 0", extra=BEHIND)
    film = abbe.render(path, aovs=["albedo", "refracted_albedo"], width=2, height=2)
    assert np.array(film["albedo"])[0, 0] == pytest.approx([1, 1, 1])
    assert np.array(film["refracted_albedo"])[0, 0] == pytest.approx([0.9, 0.1, 0.5])


def test_every_number_of_threads_and_every_subset_has_the_same_bits(tmp_path):
    write_image(tmp_path / "t.png", RNG.integers(0, 255, (64, 64, 4)).astype(np.uint8), "uint8")
    surface = (
        "color3f inputs:diffuseColor.connect = </World/M/T.outputs:rgb>\n"
        "float inputs:opacity.connect = </World/M/T.outputs:a>\n float inputs:opacityThreshold = 0.5"
    )
    scene = abbe.Scene.from_stage(write(tmp_path, texture("t.png"), surface, extra=BEHIND))
    one = scene.render(aovs=["albedo"], width=90, height=70, samples=4, threads=1)
    many = scene.render(
        aovs=["dispersion", "refracted_albedo", "albedo", "uv"], width=90, height=70, samples=4, threads=4
    )
    assert np.array_equal(one["albedo"], many["albedo"])
