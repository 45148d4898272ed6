"""Every USD name stands in one place, and ours are those of the schema plug-in."""

from pathlib import Path

import pytest

from abbe.usd import tokens

ROOT = Path(__file__).resolve().parents[2]
BRIDGE = ROOT / "python" / "abbe" / "usd"


def test_our_names_and_types_are_those_of_the_plug_in():
    Sdf = pytest.importorskip("pxr.Sdf")
    layer = Sdf.Layer.FindOrOpen(str(ROOT / "plugin" / "generatedSchema.usda"))
    assert layer, "plugin/generatedSchema.usda is missing"
    declared = {}
    for prim in layer.rootPrims:
        for name, attribute in prim.attributes.items():
            declared.setdefault(prim.name, {})[name] = str(attribute.typeName)
    ours = {
        "AbbeDispersionAPI": tokens.MATERIAL_NAMES,
        "AbbeReflectanceAPI": tokens.REFLECTANCE_NAMES,
        "AbbeLensAPI": tokens.LENS_NAMES,
        "AbbeLightAPI": tokens.LIGHT_NAMES,
        "AbbeSubdivisionAPI": tokens.MESH_NAMES,
        "AbbeRenderSettingsAPI": tokens.SETTINGS_NAMES,
        "AbbeRenderVarAPI": tokens.VAR_NAMES,
    }
    assert {name: names for name, names in declared.items() if name in ours} == ours


def test_usd_names_are_written_once():
    written = {
        value
        for name, value in vars(tokens).items()
        if name.isupper() and isinstance(value, str) and (":" in value or value != value.lower())
    }
    for path in BRIDGE.glob("*.py"):
        if path.name == "tokens.py":
            continue
        source = path.read_text()
        repeated = [value for value in written if f'"{value}"' in source]
        assert not repeated, f"{path.name} repeats {repeated}"
