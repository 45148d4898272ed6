"""Shaders of other renderers as they stand in USD files, through the bridge and the core."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("pxr.Usd", reason="stages need usd-core")

import abbe  # Before USD opens anything.

# ruff: isort: split
from pxr import Usd

STAGE = """#usda 1.0
def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </Glass>
}
def Material "Glass"
{
    TERMINALS
}
"""


def decided(terminals: str) -> dict[str, Any]:
    """What the one material of the stage comes to."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(STAGE.replace("TERMINALS", terminals))
    (material,) = abbe.Scene.from_stage(stage).plans(aovs=["ior"])[0].fields["materials"]
    found: dict[str, Any] = material
    return found


def wrapped(context: str, wrapper: str, name: str, inner: str, inputs: str) -> dict[str, Any]:
    return decided(f"""
    token outputs:{context}:surface.connect = </Glass/Wrapper.outputs:out>
    def Shader "Wrapper"
    {{
        uniform token info:id = "{wrapper}"
        token inputs:{name}.connect = </Glass/Inner.outputs:out>
        token outputs:out
    }}
    def Shader "Inner"
    {{
        uniform token info:id = "{inner}"
        {inputs}
        token outputs:out
    }}
    """)


@pytest.mark.parametrize(
    ("context", "wrapper", "inner"),
    [("ri", "LamaSurface", "LamaDielectric"), ("mtlx", "ND_lama_surface", "ND_lama_dielectric")],
)
def test_lama_dielectrics_are_found_behind_their_surface(context: str, wrapper: str, inner: str) -> None:
    glass = wrapped(context, wrapper, "materialFront", inner, "float inputs:reflectivity = 0.0625")
    assert glass["kind"] == "dielectric"
    # r = 1/16: (1 + 1/4) / (1 - 1/4)
    assert glass["nd"] == pytest.approx(5 / 3, rel=1e-12)


def test_v_ray_materials_are_found_behind_their_surface() -> None:
    inputs = "color3f inputs:refract = (1, 1, 1)\n        int inputs:dispersion_on = 1"
    glass = wrapped("vray", "vray:MtlSingleBRDF", "brdf", "vray:BRDFVRayMtl", inputs)
    assert glass["kind"] == "dielectric"
    assert (glass["nd"], glass["vd"]) == (1.6, pytest.approx(50.0, rel=1e-9))


@pytest.mark.parametrize(
    ("source", "identifier"),
    [
        ("OmniGlass.mdl", "OmniGlass"),
        ("nvidia/core_definitions.mdl", "thick_glass_v2(color,color,float,float,float,float3,float)"),
    ],
)
def test_mdl_glasses_are_named_by_their_sub_identifier(source: str, identifier: str) -> None:
    glass = decided(f"""
    token outputs:mdl:surface.connect = </Glass/Shader.outputs:out>
    def Shader "Shader"
    {{
        uniform token info:implementationSource = "sourceAsset"
        uniform asset info:mdl:sourceAsset = @{source}@
        uniform token info:mdl:sourceAsset:subIdentifier = "{identifier}"
        token outputs:out
    }}
    """)
    assert glass["kind"] == "dielectric"
    assert glass["nd"] == {"OmniGlass.mdl": 1.491}.get(source, 1.4)


def test_the_terminal_that_is_understood_is_used_and_named() -> None:
    glass = decided("""
    token outputs:mtlx:surface.connect = </Glass/Unknown.outputs:out>
    token outputs:surface.connect = </Glass/Preview.outputs:surface>
    def Shader "Unknown"
    {
        uniform token info:id = "ND_unheard_of"
        token outputs:out
    }
    def Shader "Preview"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = 0.1
        float inputs:ior = 1.7
        token outputs:surface
    }
    """)
    assert (glass["kind"], glass["nd"]) == ("dielectric", 1.7)
    assert "UsdPreviewSurface through outputs:surface, since ND_unheard_of is not understood" in glass["why"]
