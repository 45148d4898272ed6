"""Writes the tables of docs/plugin.md from the plug-in's own files.

    python docs/tables_plugin.py

Needs usd-core and abbe.
"""

import re
from pathlib import Path

from pxr import Sdf

from abbe.validators import VALIDATORS

HERE = Path(__file__).resolve().parent
PLUGIN = HERE.parent / "plugin"
PAGE = HERE / "plugin.md"


def tables() -> dict[str, str]:
    """The tables by the line that they stand after."""
    glass = Sdf.Layer.FindOrOpen(str(PLUGIN / "AbbeGlass.usda"))
    schemas = Sdf.Layer.FindOrOpen(str(PLUGIN / "schema.usda"))
    found = {
        "| input | type | default | |": [
            _row(item, item.name.removeprefix("inputs:"))
            for item in glass.GetPrimAtPath("/AbbeGlass").attributes
            if item.name.startswith("inputs:") and not item.name.startswith("inputs:abbe:")
        ],
        "| validator | what it makes sure of |": [f"| `{v.name}` | {v.doc} |" for v in VALIDATORS],
    }
    for name in (
        "AbbeDispersionAPI",
        "AbbeReflectanceAPI",
        "AbbeSubdivisionAPI",
        "AbbeLightAPI",
        "AbbeRenderSettingsAPI",
        "AbbeRenderVarAPI",
    ):
        schema = schemas.GetPrimAtPath(f"/{name}")
        found[f"| `{name}` | type | default | |"] = [_row(item, item.name) for item in schema.attributes]
    return {head: "\n".join(rows) for head, rows in found.items()}


def _row(item: Sdf.AttributeSpec, name: str) -> str:
    value = item.default
    if isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, float):
        # As many digits as the type holds.
        text = f"{value:.7g}" if item.typeName == "float" else f"{value:.15g}"
    else:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    return f"| `{name}` | {item.typeName} | `{text}` | {item.documentation} |"


def page() -> str:
    """The page with its tables as they are now."""
    text = PAGE.read_text(encoding="utf-8")
    for head, rows in tables().items():
        pattern = rf"({re.escape(head)}\n\|[-|]+\|\n)((?:\|.*\n)*?)(?=\n|\| `abbe:…`)"
        text, count = re.subn(pattern, lambda match, rows=rows: f"{match[1]}{rows}\n", text)
        assert count == 1, head
    return text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
