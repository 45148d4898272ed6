"""docs/usd.md: every row names a test that exists, and every schema of USD that a stage can carry has a row."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "usd.md").read_text(encoding="utf-8")
STATES = ("supported", "approximated", "ignored with a warning", "ignored")
LIBRARIES = ("usdGeom", "usdLux", "usdRender", "usdShade", "usdVol", "usdSkel")


def rows():
    """The cells of every row of the tables, headings left out."""
    found = []
    heading = None
    for line in TEXT.splitlines():
        if not line.startswith("|"):
            heading = None
        elif heading is None:
            heading = [cell.strip() for cell in line.strip("|").split("|")]
        elif not set(line) <= set("|-"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            found.append(dict(zip(heading, cells, strict=True)))
    return found


ROWS = rows()


def named_tests(row):
    return [tuple(name.split("::")) for name in re.findall(r"`([^`]*)`", row["test"])]


def test_the_tables_are_read():
    assert len(ROWS) > 40


@pytest.mark.parametrize("row", ROWS, ids=lambda row: next(iter(row.values()))[:60])
def test_every_row_is_backed_by_a_test(row):
    tests = named_tests(row)
    assert tests
    for file, name in tests:
        # A name alone is that of a file somewhere in tests/.
        paths = [ROOT / file] if "/" in file else [path for path in (ROOT / "tests").rglob(file) if path.is_file()]
        assert len(paths) == 1, f"there is no one file {file}"
        text = paths[0].read_text(encoding="utf-8")
        assert re.search(rf"\b(def|fn) {re.escape(name)}\b", text), f"{file} has no test {name}"
    if "state" in row:
        assert row["state"] in STATES


@pytest.mark.parametrize("library", LIBRARIES)
def test_every_schema_has_a_row(library):
    pytest.importorskip("pxr.Usd")
    from pxr import Plug, Tf, Usd

    named = {name for row in ROWS for name in re.findall(r"`([A-Za-z0-9_]+)`", row.get("feature", ""))}
    plugin = Plug.Registry().GetPluginWithName(library)
    kinds = (
        Usd.SchemaKind.ConcreteTyped,
        Usd.SchemaKind.SingleApplyAPI,
        Usd.SchemaKind.MultipleApplyAPI,
    )
    schemas = set()
    for type_name in plugin.metadata["Types"]:
        schema = Tf.Type.FindByName(type_name)
        if schema and Usd.SchemaRegistry.GetSchemaKind(schema) in kinds:
            schemas.add(Usd.SchemaRegistry.GetSchemaTypeName(schema))
    assert schemas
    assert schemas - named == set()
