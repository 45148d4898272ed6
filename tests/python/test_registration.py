"""What `import abbe` makes known to USD, when, and at what cost to others: each case in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pxr.Usd", reason="there is no USD to register with")

from pxr import Usd

from abbe.schemas import plugin_path
from abbe.validators import VALIDATORS

VERSION = Usd.GetVersion()[1:]
# What Python may add to depends on the version: USD's own changelog.
SDR_TAKES_DEFINITIONS = VERSION >= (25, 2)
USD_TAKES_VALIDATORS = VERSION >= (26, 5)

SCHEMA_IS_KNOWN = """
from pxr import Usd
def schema_is_known(name="AbbeDispersionAPI"):
    return Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(name) is not None
"""

STAGE = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Material "Glass" (prepend apiSchemas = ["AbbeDispersionAPI"])
{
    uniform string abbe:glass = "SCHOTT:N-BK7"
    double abbe:dispersion:scale = 2
    token outputs:abbe:surface.connect = </Glass/Surface.outputs:surface>
    def Shader "Surface"
    {
        uniform token info:id = "AbbeGlass"
        float inputs:ior = 1.6
        double inputs:abbe:dispersion:vd = 40
        token inputs:abbe:dispersion:law = "abbeNumber"
        double2[] inputs:abbe:dispersion:table = [(400, 1.6), (700, 1.5)]
        token outputs:surface
    }
}
"""


def call(program: str, *arguments: object, plugin: Path | None = None, flags: tuple[str, ...] = ("-W", "error")) -> str:
    """Run a program; returns what it prints, and fails if it says anything else or raises."""
    environment = {name: value for name, value in os.environ.items() if name != "PXR_PLUGINPATH_NAME"}
    if plugin is not None:
        environment["PXR_PLUGINPATH_NAME"] = str(plugin)
    command = [sys.executable, *flags, "-c", program, *map(str, arguments)]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    # usd-core 24 and 25 lack a file of usdHydra's, of which they complain when the shader registry is made.
    complaints = [line for line in result.stderr.splitlines() if line and "shaderDefs.usda" not in line]
    assert result.returncode == 0 and (flags != ("-W", "error") or not complaints), result.stderr
    return result.stdout + ("" if flags == ("-W", "error") else result.stderr)


def test_importing_abbe_does_not_import_usd() -> None:
    assert call("import sys, abbe; print([name for name in sys.modules if name.startswith('pxr')])") == "[]\n"


@pytest.mark.parametrize("first", ["import abbe", "from pxr import Usd, UsdShade, Sdr", "from pxr import Plug"])
def test_all_is_known_whatever_is_imported_first(first: str) -> None:
    program = f"""
{first}
import abbe
{SCHEMA_IS_KNOWN}
from pxr import UsdShade, Sdr, Tf
try:
    registry = Sdr.Registry()
except Tf.ErrorException as error:  # of usd-core 24, which lacks a file
    registry = Sdr.Registry()
node = registry.GetShaderNodeByIdentifier("AbbeGlass")
print(schema_is_known(), node is not None)
if node is not None:
    print(node.GetSourceType(), node.GetLabel(), node.GetRole())
    for name in ("abbe:dispersion:nd", "abbe:dispersion:sellmeier:b", "abbe:dispersion:validRange", "abbe:glass"):
        item = node.GetShaderInput(name)
        kind = item.GetTypeAsSdfType()
        print(name, kind.GetSdfType() if hasattr(kind, "GetSdfType") else kind[0], item.GetDefaultValueAsSdfType())
try:
    from pxr import UsdValidation
    metadata = UsdValidation.ValidationRegistry().GetValidatorMetadataForKeyword("abbe")
    print(sorted(item.name for item in metadata))
except ImportError:
    print([])
"""
    lines = call(program).splitlines()
    assert lines[0] == f"True {SDR_TAKES_DEFINITIONS}"
    if SDR_TAKES_DEFINITIONS:
        assert lines[1:-1] == [
            "abbe Abbe Glass surface",
            "abbe:dispersion:nd double 0.0",
            "abbe:dispersion:sellmeier:b double[] []",
            "abbe:dispersion:validRange double2 (0, 0)",
            "abbe:glass string ",
        ]
    assert lines[-1] == str(sorted(validator.name for validator in VALIDATORS) if USD_TAKES_VALIDATORS else [])


def test_others_may_register_their_schemas_after_abbe(tmp_path: Path) -> None:
    # Theirs: a copy of ours under other names. Importing abbe and every module it waits for must not read the schemas.
    for name in ("plugInfo.json", "generatedSchema.usda"):
        text = (plugin_path() / name).read_text(encoding="utf-8").replace("Abbe", "Other").replace("abbeS", "otherS")
        (tmp_path / name).write_text(text, encoding="utf-8")
    program = f"""
import sys, abbe
from pxr import Plug, Sdr, Tf, Usd, UsdShade
try:
    from pxr import UsdValidation
except ImportError:
    pass
Plug.Registry().RegisterPlugins(sys.argv[1])
{SCHEMA_IS_KNOWN}
print(schema_is_known("OtherDispersionAPI"), schema_is_known())
"""
    assert call(program, tmp_path) == "True True\n"


def test_a_stage_that_was_opened_before_is_warned_of() -> None:
    program = f"""
from pxr import Usd
stage = Usd.Stage.CreateInMemory()
stage.DefinePrim("/Mesh", "Mesh").GetPrimDefinition()
import abbe
{SCHEMA_IS_KNOWN}
print(schema_is_known())
"""
    text = call(program, flags=())
    assert text.startswith("False\n")
    assert f"import abbe before opening a stage, or set PXR_PLUGINPATH_NAME={plugin_path()}" in text
    # It points at the line that has to move.
    assert "<string>:5: UserWarning" in text
    # With the variable the order does not matter.
    assert call(program, plugin=plugin_path()) == "True\n"


def test_a_stage_opened_before_python_imports_usd_is_warned_of() -> None:
    # As in an application that has USD without Python: the layers are there before `pxr.Usd` is imported.
    program = """
import abbe
from pxr import Plug, Sdf, Tf
layer = Sdf.Layer.CreateAnonymous()
abbe.schemas.schemas_are_known = lambda: False
from pxr import Usd
"""
    assert "import abbe before opening a stage" in call(program, flags=())


@pytest.mark.skipif(not SDR_TAKES_DEFINITIONS, reason=f"USD {VERSION} takes no definitions of shaders")
def test_a_broken_installation_breaks_nobody_else(tmp_path: Path) -> None:
    program = """
import sys, pathlib, abbe
abbe.schemas.plugin_path = lambda: pathlib.Path(sys.argv[1])
from pxr import Usd, UsdShade, Sdr
print(Sdr.Registry().GetShaderNodeByIdentifier("UsdPreviewSurface") is not None)
print(abbe.schemas.register_shader())
"""
    expected = f"True\n{tmp_path / 'AbbeGlass.usda'} cannot be read: install abbe again\n"
    assert call(program, tmp_path) == expected


def test_modules_are_loaded_as_ever() -> None:
    program = """
import sys, abbe
waiting = sys.meta_path[0]
from pxr import Usd, Sdr
for module in (Usd, Sdr):
    assert "exec_module" not in vars(module.__loader__)
abbe.schemas.register()
abbe.schemas.register()
print(sum(type(finder) is type(waiting) for finder in sys.meta_path))
new = vars(Sdr.Registry)["__new__"]
abbe.schemas.register()
print(vars(Sdr.Registry)["__new__"] is new)
try:
    import pxr.NoSuchModule
except ModuleNotFoundError as error:
    print(error)
"""
    lines = call(program).splitlines()
    assert int(lines[0]) <= 1 and lines[1:] == ["True", "No module named 'pxr.NoSuchModule'"]


def test_the_environment_variable_serves_a_process_without_abbe(tmp_path: Path) -> None:
    (tmp_path / "glass.usda").write_text(STAGE, encoding="utf-8")
    program = """
import sys
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
glass = stage.GetPrimAtPath("/Glass")
print(glass.GetAppliedSchemas(), glass.GetAttribute("abbe:dispersion:scale").Get())
print(glass.GetAttribute("abbe:dispersion:outOfRange").Get(), glass.GetAttribute("abbe:glass").GetDisplayName())
print("abbe" in sys.modules)
"""
    with_it = call(program, tmp_path / "glass.usda", plugin=plugin_path())
    assert with_it == "['AbbeDispersionAPI'] 2.0\nclamp Glass\nFalse\n"
    # Without the plug-in the stage opens all the same, and what is authored is there.
    assert call(program, tmp_path / "glass.usda") == "[] 2.0\nNone \nFalse\n"


@pytest.mark.skipif(not USD_TAKES_VALIDATORS, reason=f"USD {VERSION} has no validators of its own to ask")
def test_validators_of_usd_find_the_shader_as_it_is_declared(tmp_path: Path) -> None:
    (tmp_path / "glass.usda").write_text(STAGE, encoding="utf-8")
    (tmp_path / "wrong.usda").write_text(
        STAGE.replace("double inputs:abbe", "string inputs:abbe").replace("vd = 40", 'vd = "40"')
    )
    program = """
import sys, abbe
from pxr import Usd, UsdValidation
validator = UsdValidation.ValidationRegistry().GetOrLoadValidatorByName("usdShadeValidators:ShaderSdrCompliance")
for path in sys.argv[1:]:
    print(len(UsdValidation.ValidationContext([validator]).Validate(Usd.Stage.Open(path))))
"""
    assert call(program, tmp_path / "glass.usda", tmp_path / "wrong.usda") == "0\n1\n"
