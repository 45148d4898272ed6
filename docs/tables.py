"""Writes the table of AOVs in README.md from the renderer's own: ``python docs/tables.py``."""

from __future__ import annotations

import re
from pathlib import Path

from abbe import _core

README = Path(__file__).resolve().parents[1] / "README.md"
_TABLE = re.compile(r"(<!-- aovs -->\n).*?(<!-- /aovs -->)", re.DOTALL)


def aov_table() -> str:
    """Return the table as Markdown."""
    aliases: dict[str, list[str]] = {}
    for alias, name in _core.aov_aliases().items():
        aliases.setdefault(name, []).append(alias)
    rows = ["| name | aliases | channels | type | unit | meaning |", "|---|---|---|---|---|---|"]
    for aov in _core.aovs():
        # A bar would end the cell.
        doc = aov["doc"].replace("|", "\\|")
        also = ", ".join(f"`{alias}`" for alias in sorted(aliases.get(aov["name"], [])))
        cells = [f"`{aov['name']}`", also, " ".join(aov["channels"]), aov["sample"], aov["unit"], doc]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def with_table(text: str) -> str:
    """Return the README's text with the table as it is now."""
    return _TABLE.sub(lambda match: match[1] + aov_table() + match[2], text)


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
