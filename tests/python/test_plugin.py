"""The plug-in's files: schemas found in both ways, exactly as documented; the shader as the schema; reproduced."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pxr.Usd", reason="the plug-in is USD's")

from pxr import Sdf

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "plugin"

# Each property with its type, variability, fallback and allowed tokens, as users rely on them.
UNIFORM, VARYING = "uniform", "varying"
SCHEMAS = {
    "AbbeDispersionAPI": (
        "Material",
        {
            "abbe:glass": ("string", UNIFORM, "", None),
            "abbe:dispersion:law": (
                "token",
                UNIFORM,
                "",
                ["", "glass", "constant", "abbeNumber", "cauchy", "sellmeier", "formula", "table"],
            ),
            "abbe:dispersion:nd": ("double", VARYING, 0.0, None),
            "abbe:dispersion:vd": ("double", VARYING, 0.0, None),
            "abbe:dispersion:cauchy": ("double[]", UNIFORM, [], None),
            "abbe:dispersion:sellmeier:b": ("double[]", UNIFORM, [], None),
            "abbe:dispersion:sellmeier:c": ("double[]", UNIFORM, [], None),
            "abbe:dispersion:formula": ("int", UNIFORM, 0, None),
            "abbe:dispersion:coefficients": ("double[]", UNIFORM, [], None),
            "abbe:dispersion:table": ("double2[]", UNIFORM, [], None),
            "abbe:extinction:table": ("double2[]", UNIFORM, [], None),
            "abbe:dispersion:validRange": ("double2", UNIFORM, [0.0, 0.0], None),
            "abbe:dispersion:outOfRange": ("token", UNIFORM, "clamp", ["clamp", "error", "extrapolate"]),
            "abbe:dispersion:scale": ("double", VARYING, 1.0, None),
            "abbe:internalTransmittance:table": ("double2[]", UNIFORM, [], None),
            "abbe:internalTransmittance:thickness": ("double", UNIFORM, 10.0, None),
            "abbe:dielectricPriority": ("int", UNIFORM, 0, None),
        },
    ),
    "AbbeReflectanceAPI": ("Material", {"abbe:reflectance:table": ("double2[]", UNIFORM, [], None)}),
    "AbbeLensAPI": (
        "Mesh",
        {
            "abbe:lens:thickness": ("double", VARYING, 0.0, None),
            "abbe:lens:edgeRadius": ("double", VARYING, 0.0, None),
            "abbe:lens:front:curvature": ("double", VARYING, 0.0, None),
            "abbe:lens:front:conic": ("double", VARYING, 0.0, None),
            "abbe:lens:front:aspheres": ("double[]", UNIFORM, [], None),
            "abbe:lens:front:semiDiameter": ("double", VARYING, 0.0, None),
            "abbe:lens:back:curvature": ("double", VARYING, 0.0, None),
            "abbe:lens:back:conic": ("double", VARYING, 0.0, None),
            "abbe:lens:back:aspheres": ("double[]", UNIFORM, [], None),
            "abbe:lens:back:semiDiameter": ("double", VARYING, 0.0, None),
        },
    ),
    "AbbeSubdivisionAPI": ("Mesh", {"abbe:subdivision:level": ("int", UNIFORM, -1, None)}),
    "AbbeLightAPI": (
        "DomeLight",
        {
            "abbe:illuminant": (
                "token",
                UNIFORM,
                "",
                ["", "D65", "D50", "D55", "D75", "A", "E", "FL2", "FL7", "FL11", "blackbody", "table"],
            ),
            "abbe:spectrum:table": ("double2[]", UNIFORM, [], None),
            "abbe:lightGroup": ("string", UNIFORM, "", None),
        },
    ),
    "AbbeRenderSettingsAPI": (
        "RenderSettings",
        {
            "abbe:integrator": ("token", UNIFORM, "", None),
            "abbe:samples": ("int", UNIFORM, 64, None),
            "abbe:errorTarget": ("double", UNIFORM, 0.0, None),
            "abbe:timeLimit": ("double", UNIFORM, 0.0, None),
            "abbe:referenceWavelength": ("double", UNIFORM, 587.5618, None),
            "abbe:band": ("double2", UNIFORM, [400.0, 700.0], None),
            "abbe:dispersionScale": ("double", VARYING, 1.0, None),
            "abbe:seed": ("int", UNIFORM, 0, None),
            "abbe:seedPerFrame": ("bool", UNIFORM, True, None),
            "abbe:scalarIor": ("token", UNIFORM, "constant", ["constant", "nearestGlass"]),
            "abbe:pixelFilter": ("token", UNIFORM, "blackmanHarris", None),
            "abbe:pixelFilterWidth": ("float", UNIFORM, 3.0, None),
            "abbe:channelWavelengths": ("double3", UNIFORM, [0.0, 0.0, 0.0], None),
        },
    ),
    "AbbeRenderVarAPI": (
        "RenderVar",
        {
            "abbe:filter": ("token", UNIFORM, "auto", ["auto", "average", "closest"]),
            "abbe:wavelength": ("double", UNIFORM, 0.0, None),
            "abbe:spectral:band": ("double2", UNIFORM, [0.0, 0.0], None),
            "abbe:spectral:binWidth": ("double", UNIFORM, 10.0, None),
        },
    ),
}

# Prints the registered schemas as JSON. The schema registry is filled once per process, so each way gets its own.
PROBE = """
import json, sys
from pxr import Plug, Sdf, Usd
if len(sys.argv) > 1:
    Plug.Registry().RegisterPlugins(sys.argv[1])
stage = Usd.Stage.CreateInMemory()
registry = Usd.SchemaRegistry()
found = {}
for name, target in (("AbbeDispersionAPI", "Material"), ("AbbeReflectanceAPI", "Material"),
                     ("AbbeLensAPI", "Mesh"), ("AbbeLightAPI", "DomeLight"),
                     ("AbbeSubdivisionAPI", "Mesh"),
                     ("AbbeRenderSettingsAPI", "RenderSettings"), ("AbbeRenderVarAPI", "RenderVar")):
    definition = registry.FindAppliedAPIPrimDefinition(name)
    if definition is None:
        continue
    prim = stage.DefinePrim("/" + name, target)
    wrong = stage.DefinePrim("/Wrong" + name, "Camera")
    properties = {}
    for key in definition.GetPropertyNames():
        attribute = definition.GetAttributeDefinition(key)
        value = attribute.GetFallbackValue()
        tokens = attribute.GetMetadata("allowedTokens")
        uniform = attribute.GetVariability() == Sdf.VariabilityUniform
        properties[key] = (
            str(attribute.GetTypeName()), "uniform" if uniform else "varying",
            list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value,
            None if tokens is None else list(tokens))
        assert definition.GetPropertyDocumentation(key), key
        assert attribute.GetMetadata("displayName") and attribute.GetMetadata("displayGroup"), key
    assert definition.GetDocumentation()
    assert prim.CanApplyAPI(name) and prim.ApplyAPI(name) and prim.HasAPI(name)
    assert not wrong.CanApplyAPI(name)
    assert not any(prim.GetAttribute(key).IsCustom() for key in properties)
    found[name] = (target, properties)
print(json.dumps(found))
"""


def probe(*arguments: str, plugin_path: Path | None = None) -> dict[str, list[object]]:
    environment = {name: value for name, value in os.environ.items() if name != "PXR_PLUGINPATH_NAME"}
    if plugin_path is not None:
        environment["PXR_PLUGINPATH_NAME"] = str(plugin_path)
    result = subprocess.run(
        [sys.executable, "-c", PROBE, *arguments], env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0 and not result.stderr, result.stderr
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    return found


def expected() -> object:
    return json.loads(json.dumps(SCHEMAS))


def test_environment_variable_registers_the_documented_schemas() -> None:
    assert probe(plugin_path=PLUGIN) == expected()


def test_register_plugins_registers_the_documented_schemas() -> None:
    assert probe(str(PLUGIN)) == expected()


def test_nothing_is_registered_without_the_plug_in() -> None:
    assert probe() == {}


def test_a_copy_of_the_folder_works_from_anywhere(tmp_path: Path) -> None:
    for name in ("plugInfo.json", "generatedSchema.usda"):
        (tmp_path / name).write_bytes((PLUGIN / name).read_bytes())
    assert probe(plugin_path=tmp_path) == expected()


def test_generator_reproduces_the_committed_files(tmp_path: Path) -> None:
    pytest.importorskip("jinja2", reason="usdGenSchema needs jinja2")
    specification = importlib.util.spec_from_file_location("abbe_plugin_generate", PLUGIN / "generate.py")
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    module.generate(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(module.FILES)
    for name in module.FILES:
        assert (tmp_path / name).read_bytes() == (PLUGIN / name).read_bytes(), f"{name}: run python plugin/generate.py"


# What AbbeGlass has beside the attributes of AbbeDispersionAPI.
GLASS_INPUTS = {
    "inputs:ior": ("float", 1.5168),
    "inputs:abbe_number": ("float", 64.17),
    "inputs:roughness": ("float", 0.0),
    "inputs:thin_walled": ("bool", False),
    "inputs:transmission_color": ("color3f", [1.0, 1.0, 1.0]),
    "inputs:transmission_depth": ("float", 0.0),
}


def test_the_shader_has_the_attributes_of_the_schema() -> None:
    layer = Sdf.Layer.FindOrOpen(str(PLUGIN / "AbbeGlass.usda"))
    shader = layer.GetPrimAtPath("/AbbeGlass")
    inputs = {item.name: item for item in shader.properties if item.name.startswith("inputs:")}
    schema = SCHEMAS["AbbeDispersionAPI"][1]
    assert list(inputs) == [*GLASS_INPUTS, *(f"inputs:{name}" for name in schema)]
    for name, item in inputs.items():
        value = item.default
        value = list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
        tokens = item.GetInfo("allowedTokens")
        if name in GLASS_INPUTS:
            kind, fallback = GLASS_INPUTS[name]
            assert str(item.typeName) == kind and value == pytest.approx(fallback, rel=2.0**-24), name
        else:
            kind, _, fallback, allowed = schema[name.removeprefix("inputs:")]
            assert (str(item.typeName), value, list(tokens) if tokens else None) == (kind, fallback, allowed), name
        metadata = item.GetInfo("sdrMetadata")
        assert metadata["help"] == item.documentation and metadata["label"] == item.displayName
        assert metadata["page"] == item.displayGroup
        # Every token that Sdr can offer.
        assert metadata.get("options", "").split("|") == [token for token in tokens or [""] if token or not tokens]
    assert shader.attributes["info:id"].default == "AbbeGlass"
    assert [item.name for item in shader.properties if item.name.startswith("outputs:")] == ["outputs:surface"]
