"""docs/plugin.md says what is so: its programs run, its stages are sound, its tables are the plug-in's."""

import importlib.util
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("pxr.Usd", reason="the page is about USD")

from pxr import Usd

import abbe
from abbe.validators import validate

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "plugin.md").read_text(encoding="utf-8")
BALL = """
def Camera "Camera" {
}
def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = <%s>
}
"""


def blocks(language: str) -> list[str]:
    """Return the fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def test_programs_run_in_order(tmp_path: Path) -> None:
    programs = blocks("python")
    if Usd.GetVersion()[1:] < (26, 5):
        programs = [program for program in programs if "UsdValidation" not in program]
    assert programs
    for program in programs:
        command = [sys.executable, "-W", "error", "-c", program]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0 and not done.stderr, f"{program}\n{done.stderr}"
    text = (tmp_path / "glass.usda").read_text(encoding="utf-8")
    assert 'prepend apiSchemas = ["AbbeDispersionAPI"]' in text
    assert_sound(tmp_path / "ball.usda", text, "/Looks/Glass")


def material_of(text: str) -> str:
    """Return the name of the material that a block defines."""
    return re.findall(r'Material "(\w+)"', text)[0]


@pytest.mark.parametrize("text", blocks("usda"), ids=material_of)
def test_stages_are_sound(text: str, tmp_path: Path) -> None:
    assert_sound(tmp_path / "ball.usda", text, f"/{material_of(text)}")


def assert_sound(path: Path, text: str, material: str) -> None:
    """A ball of the material is glass, and nothing is wrong with it."""
    path.write_text(text + BALL % material, encoding="utf-8")
    assert validate(path) == []
    (plan,) = abbe.Scene.from_stage(path).plans(width=8)
    (decided,) = plan.fields["materials"]
    assert decided["what"] == material and decided["why"].startswith("dielectric"), decided


def test_tables_are_those_of_the_plug_in() -> None:
    specification = importlib.util.spec_from_file_location("abbe_tables_plugin", ROOT / "docs" / "tables_plugin.py")
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    assert module.page() == PAGE, "run python docs/tables_plugin.py"


def test_commands_are_there(run: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    for line in "".join(blocks("sh")).splitlines():
        match = re.search(r"\babbe ([a-z-]+)", line)
        assert match and run(match[1], "--help").returncode == 0, line
