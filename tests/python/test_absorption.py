"""What a glass slab takes from the light, stage to layer, against Beer and Lambert's law for every pixel."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr.Usd", reason="reads stages with usd-core")

import abbe

WIDTH, HEIGHT = 40, 20
IOR, THICKNESS = 1.5, 1.25

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = {meters_per_unit}
    upAxis = "Y"
)
def Xform "World" {{
    def Camera "Main" {{
        float focalLength = 35
        float horizontalAperture = 20
        float verticalAperture = 10
        double3 xformOp:translate = (0, 0, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Mesh "Slab" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [2, 3, 1, 0, 5, 7, 6, 4, 1, 5, 4, 0, 6, 7, 3, 2, 4, 6, 2, 0, 3, 7, 5, 1]
        point3f[] points = [(-9, -9, 0), (9, -9, 0), (-9, 9, 0), (9, 9, 0),
            (-9, -9, 1.25), (9, -9, 1.25), (-9, 9, 1.25), (9, 9, 1.25)]
        rel material:binding = </World/Glass>
    }}
    def Material "Glass" (prepend apiSchemas = ["AbbeDispersionAPI"]) {{
        token outputs:surface.connect = </World/Glass/Surface.outputs:surface>
{material}
        def Shader "Surface" {{
{shader}
            token outputs:surface
        }}
    }}
}}
"""

OPEN_PBR = """
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            float inputs:transmission_weight = 1
            float inputs:specular_roughness = 0
            float inputs:specular_ior = 1.5
            color3f inputs:transmission_color = {color}
            float inputs:transmission_depth = {depth}
"""

GLTF = """
            uniform token info:id = "ND_gltf_pbr_surfaceshader"
            float inputs:transmission = 1
            float inputs:metallic = 0
            float inputs:roughness = 0
            float inputs:ior = 1.5
            float inputs:thickness = 1
            color3f inputs:attenuation_color = {color}
            float inputs:attenuation_distance = {depth}
"""


def transmittance(folder: Path, shader: str, *, material: str = "", meters_per_unit: float = 0.01) -> np.ndarray:
    """Render the slab; the layer has the shape (height, width, 3)."""
    path = folder / "slab.usda"
    path.write_text(STAGE.format(meters_per_unit=meters_per_unit, material=material, shader=shader))
    film = abbe.render(path, aovs=["internal_transmittance"], width=WIDTH, height=HEIGHT)
    return np.asarray(film["internal_transmittance"], dtype=np.float64)


def lengths() -> np.ndarray:
    """The way through the slab under each pixel, by Snell's law at its centre."""
    x = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 20 / 35
    y = ((np.arange(HEIGHT) + 0.5) / HEIGHT - 0.5) * 10 / 35
    tangent2 = x[None, :] ** 2 + y[:, None] ** 2
    sine2 = tangent2 / (1 + tangent2) / IOR**2
    return THICKNESS / np.sqrt(1 - sine2)


@pytest.mark.parametrize("shader", [OPEN_PBR, GLTF], ids=["OpenPBR", "glTF"])
@pytest.mark.parametrize("meters_per_unit", [0.01, 1.0])
def test_a_grey_at_a_depth_in_stage_units(tmp_path: Path, shader: str, meters_per_unit: float) -> None:
    text = shader.format(color="(0.25, 0.25, 0.25)", depth=2)
    layer = transmittance(tmp_path, text, meters_per_unit=meters_per_unit)
    expected = 0.25 ** (lengths() / 2)
    np.testing.assert_allclose(layer, np.repeat(expected[:, :, None], 3, axis=2), rtol=2e-7)


@pytest.mark.parametrize("shader", [OPEN_PBR, GLTF], ids=["OpenPBR", "glTF"])
def test_a_colour_deepens_with_the_way(tmp_path: Path, shader: str) -> None:
    layer = transmittance(tmp_path, shader.format(color="(0.9, 0.5, 0.1)", depth=THICKNESS))
    middle = layer[HEIGHT // 2, WIDTH // 2]
    # Each channel looks at one wavelength of a spectrum whose means over the responses are the colour.
    np.testing.assert_allclose(middle, [0.9, 0.5, 0.1], atol=0.2)
    ratio = lengths() / lengths()[HEIGHT // 2, WIDTH // 2]
    np.testing.assert_allclose(np.log(layer), np.log(middle) * ratio[:, :, None], rtol=2e-6)


@pytest.mark.parametrize("meters_per_unit", [0.01, 0.001])
def test_a_measured_plate_follows_the_unit_of_the_stage(tmp_path: Path, meters_per_unit: float) -> None:
    # Straight in -log τ between the entries; the channels look at 600, 550 and 450 nm.
    table = """
        uniform double2[] abbe:internalTransmittance:table = [(400, 0.2), (500, 0.8), (650, 0.95)]
        double abbe:internalTransmittance:thickness = 5
"""
    path = tmp_path / "slab.usda"
    shader = OPEN_PBR.format(color="(0.5, 0.5, 0.5)", depth=1)
    settings = """
def RenderSettings "Settings" (prepend apiSchemas = ["AbbeRenderSettingsAPI"]) {
    uniform double3 abbe:channelWavelengths = (600, 550, 450)
}
"""
    text = STAGE.format(meters_per_unit=meters_per_unit, material=table, shader=shader) + settings
    path.write_text(text.replace('upAxis = "Y"', 'upAxis = "Y"\n    renderSettingsPrimPath = "/Settings"'))
    film = abbe.render(path, aovs=["internal_transmittance"], width=WIDTH, height=HEIGHT)
    optical_depth = np.interp([600, 550, 450], [400, 500, 650], -np.log([0.2, 0.8, 0.95]))
    plates = lengths() * meters_per_unit / 5e-3
    expected = np.exp(-optical_depth * plates[:, :, None])
    np.testing.assert_allclose(film["internal_transmittance"], expected, rtol=5e-7)


def test_the_extinction_is_four_pi_k_over_lambda(tmp_path: Path) -> None:
    table = "uniform double2[] abbe:extinction:table = [(360, 2e-6), (830, 2e-6)]"
    layer = transmittance(tmp_path, OPEN_PBR.format(color="(1, 1, 1)", depth=0), material=table)
    # The channels' wavelengths unless settings say otherwise: the centroids of the responses.
    wavelengths = np.array([602.406142034, 540.492354904, 451.773696637]) * 1e-9
    expected = np.exp(-4 * np.pi * 2e-6 / wavelengths * 0.01 * lengths()[:, :, None])
    np.testing.assert_allclose(layer, expected, rtol=5e-7)


def test_white_and_no_depth_absorb_nothing(tmp_path: Path) -> None:
    for color, depth in [("(1, 1, 1)", 2), ("(0.5, 0.1, 0.1)", 0)]:
        layer = transmittance(tmp_path, OPEN_PBR.format(color=color, depth=depth))
        assert (layer == 1).all(), (color, depth)
