"""What the Python tests share: stages small enough to read, and the command line as users call it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

Result = subprocess.CompletedProcess[str]


@pytest.fixture(scope="session")
def stages() -> Path:
    """The folder of the sample stages."""
    return ROOT / "stages"


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., Result]:
    """Run `abbe` in an empty folder; the result has stdout, stderr and returncode."""

    def call(*arguments: str | Path) -> Result:
        command = [sys.executable, "-m", "abbe", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)

    return call


@pytest.fixture(scope="session")
def abbe_render() -> Path:
    """The program that needs no Python."""
    if "ABBE_RENDER" not in os.environ:
        pytest.skip("ABBE_RENDER names no abbe-render; `make test` builds one")
    program = Path(os.environ["ABBE_RENDER"])
    assert program.is_file(), f"{program} is not there"
    return program


GLASS_SLAB = """#usda 1.0
(
    defaultPrim = "World"
    startTimeCode = 7
    upAxis = "Y"
)
def Xform "World" {
    def Camera "Main" {
        float2 clippingRange = (0.1, 100)
        float focalLength = 35
        float horizontalAperture = 20
        float verticalAperture = 10
        double3 xformOp:translate = (0.3, 0.2, 6)
        double3 xformOp:translate.timeSamples = { 7: (0.3, 0.2, 6), 9: (0.5, 0.2, 6) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "Side" {
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "Prism" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3, 3, 4, 4, 4]
        int[] faceVertexIndices = [2, 1, 0, 3, 4, 5, 4, 3, 0, 1, 5, 4, 1, 2, 3, 5, 2, 0]
        point3f[] points = [(-1, -1, 1), (1, -1, 1), (0, -1, -0.7), (-1, 1, 1), (1, 1, 1), (0, 1, -0.7)]
        rel material:binding = </World/Glass>
    }
    def Mesh "Wall" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, -9, -4), (9, -9, -4), (9, 9, -4), (-9, 9, -4)]
    }
    def Material "Glass" (prepend apiSchemas = ["AbbeDispersionAPI"]) {
        token outputs:surface.connect = </World/Glass/Surface.outputs:surface>
        double abbe:dispersion:nd = 1.5168
        double abbe:dispersion:vd = 64.17
        def Shader "Surface" {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:opacity = 0
            float inputs:ior = 1.5
            float inputs:roughness = 0
            token outputs:surface
        }
    }
}
"""

SETTINGS = """
def Scope "Render" {
    def RenderSettings "Settings" {
        uniform int2 resolution = (40, 20)
        rel camera = </World/Main>
        rel products = [%s]
    }
%s}
"""

PRODUCT = """    def RenderProduct "%s" {
        token productName = "%s"
        rel orderedVars = [</Render/%s/dispersion>, </Render/%s/prim_id>]
        def RenderVar "dispersion" {
            string sourceName = "dispersion"
        }
        def RenderVar "prim_id" {
            string sourceName = "primId"
        }
    }
"""


@pytest.fixture
def slab(tmp_path: Path) -> Callable[..., Path]:
    """Write a stage: a glass prism before a wall, and the products asked for, name to file."""

    def write(name: str = "slab.usda", edit: tuple[str, str] | None = None, **products: str) -> Path:
        text = GLASS_SLAB
        if edit is not None:
            assert edit[0] in text
            text = text.replace(*edit)
        if products:
            targets = ", ".join(f"</Render/{product}>" for product in products)
            bodies = "".join(PRODUCT % (product, file, product, product) for product, file in products.items())
            text = text.replace('upAxis = "Y"', 'renderSettingsPrimPath = "/Render/Settings"\n    upAxis = "Y"')
            text += SETTINGS % (targets, bodies)
        path = tmp_path / name
        path.write_text(text)
        return path

    return write
