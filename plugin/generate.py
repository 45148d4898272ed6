"""Makes what USD reads from schema.usda: plugInfo.json and generatedSchema.usda with the usdGenSchema that usd-core
brings, and AbbeGlass.usda, whose inputs `inputs:abbe:…` are the attributes of AbbeDispersionAPI.

    python plugin/generate.py [FOLDER]

Needs usd-core and jinja2. FOLDER is where the files go, by default beside this script.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from pxr import Sdf

HERE = Path(__file__).resolve().parent
FILES = ("plugInfo.json", "generatedSchema.usda", "AbbeGlass.usda")

# The shader's own inputs: type, name, default, label, page, help. The defaults are those of N-BK7.
GLASS_INPUTS = [
    ("float", "ior", 1.5168, "IOR", "Glass", "Refractive index at the d line, 587.5618 nm."),
    (
        "float",
        "abbe_number",
        64.17,
        "Abbe Number",
        "Glass",
        "Abbe number (nd - 1) / (nF - nC): the lower, the stronger the dispersion; 0: none.",
    ),
    ("float", "roughness", 0.0, "Roughness", "Glass", "Roughness of the surface, 0 polished to 1."),
    (
        "bool",
        "thin_walled",
        False,
        "Thin Walled",
        "Glass",
        "The surface is a thin sheet without an inside: light goes straight through.",
    ),
    (
        "color3f",
        "transmission_color",
        (1.0, 1.0, 1.0),
        "Transmission Color",
        "Absorption",
        "Colour of white light after the transmission depth; white: no absorption.",
    ),
    (
        "float",
        "transmission_depth",
        0.0,
        "Transmission Depth",
        "Absorption",
        "Distance in stage units over which light takes the transmission colour; 0: no absorption.",
    ),
]

GLASS_HEAD = """#usda 1.0
(
    doc = "Definition of the shader AbbeGlass. Made by generate.py from schema.usda: change those."
)

def Shader "AbbeGlass" (
    doc = "Glass with dispersion, for outputs:abbe:surface or outputs:surface of a Material."
    sdrMetadata = {
        string help = "Glass with dispersion. An authored abbe: input decides the law; else IOR and Abbe number do."
        string label = "Abbe Glass"
        token role = "surface"
    }
)
{
    uniform token info:id = "AbbeGlass"
    uniform token info:implementationSource = "sourceAsset"
    uniform asset info:abbe:sourceAsset = @./AbbeGlass.usda@
    token outputs:surface (
        sdrMetadata = {
            string renderType = "terminal surface"
        }
    )
"""


def generate(folder: Path) -> None:
    """Write the generated files of the plug-in.

    Parameters
    ----------
    folder : existing folder for :data:`FILES`

    Raises
    ------
    subprocess.CalledProcessError
        usdGenSchema refused schema.usda; its output says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        # The generator must not find an older version of these very schemas.
        environment = {name: value for name, value in os.environ.items() if name != "PXR_PLUGINPATH_NAME"}
        subprocess.run(
            [sys.executable, "-m", "pxr.Usd.usdGenSchema", str(HERE / "schema.usda"), scratch],
            check=True,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        shutil.copyfile(Path(scratch, "generatedSchema.usda"), folder / "generatedSchema.usda")
        # The generator precedes its JSON with comments, which only USD's own reader accepts.
        lines = Path(scratch, "plugInfo.json").read_text(encoding="utf-8").splitlines()
    document = json.loads("\n".join(line for line in lines if not line.lstrip().startswith("#")))
    for plugin in document["Plugins"]:
        # One flat folder without a library, found through PXR_PLUGINPATH_NAME or Plug.Registry().RegisterPlugins.
        plugin.pop("LibraryPath", None)
        plugin.update(Type="resource", Root=".", ResourcePath=".")
    _write(folder / "plugInfo.json", json.dumps(document, indent=4, sort_keys=True) + "\n")
    _write(folder / "AbbeGlass.usda", glass_shader())


def glass_shader() -> str:
    """Return the definition of AbbeGlass as .usda text.

    Types and defaults of the `abbe:` inputs are the schema's to the last digit. Sdr has no name for doubles (they are
    `unknown` to it, with the right Sdf type), but the inputs of a shader must be what the schema says everywhere.
    """
    names = [name for _, name, *_ in GLASS_INPUTS]
    inputs = [_input(kind, name, value, label, page, help_) for kind, name, value, label, page, help_ in GLASS_INPUTS]
    # Not the generated schemas: those have lost order and documentation.
    layer = Sdf.Layer.FindOrOpen(str(HERE / "schema.usda"))
    for attribute in layer.GetPrimAtPath("/AbbeDispersionAPI").properties:
        names.append(attribute.name)
        inputs.append(
            _input(
                str(attribute.typeName),
                attribute.name,
                attribute.default,
                attribute.displayName,
                attribute.displayGroup,
                attribute.documentation,
                list(attribute.GetInfo("allowedTokens") or []),
            )
        )
    # Without it USD has them by the alphabet.
    order = ", ".join(f'"inputs:{name}"' for name in names)
    return f"{GLASS_HEAD}    reorder properties = [{order}]\n{''.join(inputs)}}}\n"


def _input(kind: str, name: str, value: Any, label: str, page: str, help_: str, tokens: list[str] | None = None) -> str:
    lines = [f"    {kind} inputs:{name} = {_value(value)} ("]
    if tokens:
        lines.append(f"        allowedTokens = [{', '.join(map(json.dumps, tokens))}]")
    lines += [
        f'        displayGroup = "{page}"',
        f'        displayName = "{label}"',
        f"        doc = {json.dumps(help_)}",
        "        sdrMetadata = {",
        f"            string help = {json.dumps(help_)}",
        f"            string label = {json.dumps(label)}",
    ]
    if tokens:
        # Sdr has no way to offer the empty token, whatever its label.
        lines.append(f"            string options = {json.dumps('|'.join(filter(None, tokens)))}")
    lines += [f"            string page = {json.dumps(page)}", "        }", "    )", ""]
    return "\n".join(lines)


def _value(value: Any) -> str:
    """A value as .usda has it; doubles by their shortest text."""
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, (bool, int)):
        return str(int(value))
    if isinstance(value, float):
        return repr(int(value) if value.is_integer() else value)
    items = ", ".join(_value(item) for item in value)
    return f"[{items}]" if type(value).__name__.endswith("Array") else f"({items})"


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    generate(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
