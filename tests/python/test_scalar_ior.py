"""What becomes of an index without dispersion: the setting, the argument and the option say the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pxr.Usd", reason="stages need usd-core")

import abbe  # Before USD opens anything.
from abbe.cli import main

# ruff: isort: split
from pxr import Usd

STAGE = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
)
def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </Glass>
}
def Material "Glass"
{
    token outputs:surface.connect = </Glass/Surface.outputs:surface>
    def Shader "Surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = 0
        float inputs:ior = 1.5168
        token outputs:surface
    }
}
def Scope "Render"
{
    def RenderSettings "Settings"
    {
        POLICY
    }
}
"""


def stage(policy: str = "") -> Any:
    layer = STAGE.replace("POLICY", f'uniform token abbe:scalarIor = "{policy}"' if policy else "")
    opened = Usd.Stage.CreateInMemory()
    opened.GetRootLayer().ImportFromString(layer)
    return opened


def abbe_number(opened: Any, **options: Any) -> float | None:
    (material,) = abbe.Scene.from_stage(opened, **options).plans(aovs=["ior"])[0].fields["materials"]
    assert material["kind"] == "dielectric"
    # Crowns of this index are sold by every maker; the authored one is single precision.
    assert material["nd"] == pytest.approx(1.5168, abs=1e-4)
    number: float | None = material["vd"]
    return number


def test_an_index_alone_is_constant_unless_something_says_otherwise() -> None:
    assert abbe_number(stage()) is None
    assert abbe_number(stage("constant")) is None
    assert abbe_number(stage("nearestGlass")) == pytest.approx(64.2, abs=0.3)
    assert abbe_number(stage(), scalar_ior="nearest-glass") == pytest.approx(64.2, abs=0.3)
    assert abbe_number(stage("nearestGlass"), scalar_ior="constant") is None


def test_a_policy_that_does_not_exist_is_a_usage_error() -> None:
    with pytest.raises(abbe.UsageError, match="'rainbow' is unknown: use constant or nearestGlass"):
        abbe.Scene.from_stage(stage("rainbow"))
    with pytest.raises(abbe.UsageError, match="abbe:scalarIor"):
        abbe.Scene.from_stage(stage(), scalar_ior="rainbow")


def test_the_command_line_has_the_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "glass.usda"
    path.write_text(stage().ExportToString())
    assert main(["plan", str(path), "--json", "--quiet", "--scalar-ior", "nearest-glass"]) == 0
    (plan,) = json.loads(capsys.readouterr().out)
    assert plan["materials"][0]["vd"] is not None
