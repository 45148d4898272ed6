"""README.md says what is so: its commands and snippets run, its table is the renderer's, its files are there."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")

# Written by scripts that take minutes or change the repository: that they are there is enough.
SCRIPTS = {"docs/pictures.py", "docs/tables.py"}


def blocks() -> list[tuple[str, str]]:
    """Return language and text of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


def commands(block: str) -> Iterator[tuple[str, list[str]]]:
    """Return each command of a console block, with the lines of output that are shown."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, *output = part.splitlines()
        yield command, [line for line in output if line.strip()]


def assert_shown(command: str, shown: list[str], output: str) -> None:
    """Every line shown must come in this order; … stands for anything, blanks for any number of them."""
    lines = iter(" ".join(line.split()) for line in output.splitlines())
    for wanted in shown:
        pattern = ".*".join(re.escape(part) for part in " ".join(wanted.split()).split("…"))
        assert any(re.fullmatch(pattern, line) for line in lines), f"`{command}` prints no {wanted!r}:\n{output}"


def assert_can_run(words: list[str]) -> None:
    """What a tool of the developer is asked for must exist; it is not run here."""
    match words:
        case ["make", target]:
            makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
            assert re.search(rf"^{re.escape(target)}:", makefile, re.MULTILINE), f"make has no {target}"
        case ["cargo", "test", "--test", name]:
            assert (ROOT / "tests" / f"{name}.rs").is_file(), name
        case ["pip", "install", wanted]:
            extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
            assert re.fullmatch(r"\.\[(\w+)\]", wanted) and wanted[2:-1] in extras["optional-dependencies"]
        case ["python", script]:
            assert script in SCRIPTS and (ROOT / script).is_file(), script
        case _:
            pytest.fail(f"README.md has a command that nobody checks: {shlex.join(words)}")


@pytest.fixture
def work(tmp_path: Path) -> Path:
    """An empty folder with the sample stages, as README's reader sees them."""
    (tmp_path / "stages").symlink_to(ROOT / "stages")
    return tmp_path


def test_every_command_and_snippet_runs(work: Path) -> None:
    ran = 0
    for language, text in blocks():
        if language == "python":
            done = subprocess.run(
                [sys.executable, "-W", "error", "-c", text], cwd=work, capture_output=True, text=True, timeout=120
            )
            assert done.returncode == 0, f"{text}\n{done.stderr}"
            ran += 1
        if language != "console":
            continue
        for command, shown in commands(text):
            words = shlex.split(command)
            if words[0] == "abbe":
                call = [sys.executable, "-m", *words]
            elif words[0] == "abbe-render" and "ABBE_RENDER" in os.environ:
                call = [os.environ["ABBE_RENDER"], *words[1:]]
            elif words[0] == "abbe-render":
                assert (ROOT / "src/bin/abbe-render/main.rs").is_file()
                continue
            else:
                assert_can_run(words)
                continue
            done = subprocess.run(call, cwd=work, capture_output=True, text=True, timeout=120)
            assert done.returncode == 0, f"`{command}` exits with {done.returncode}:\n{done.stderr}"
            assert_shown(command, shown, done.stdout)
            ran += 1
    assert ran >= 20, f"only {ran} commands and snippets were found"
    assert (work / "dispersed.exr").is_file()


def test_the_table_of_aovs_is_the_renderers() -> None:
    path = ROOT / "docs" / "tables.py"
    specification = importlib.util.spec_from_file_location("abbe_docs_tables", path)
    assert specification is not None and specification.loader is not None
    tables = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(tables)
    assert tables.with_table(README) == README, "run `python docs/tables.py`"
    assert "| `dispersion` |" in README


def test_the_commands_listed_are_those_offered(work: Path) -> None:
    offered = subprocess.run([sys.executable, "-m", "abbe", "--help"], capture_output=True, text=True, check=True)
    names = set(re.findall(r"^    ([a-z-]+)(?:  |$)", offered.stdout, re.MULTILINE))
    listed = set()
    for cell in re.findall(r"^\| (`abbe [^|]*) \|", README, re.MULTILINE):
        listed.update(re.findall(r"`abbe ([a-z-]+)", cell))
    assert listed == names


def test_files_and_headings_that_are_referred_to_exist() -> None:
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (ROOT / picture).is_file(), picture
        assert (ROOT / picture).stat().st_size < 200_000, f"{picture} is too big for a clone"
    headings = {
        re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-")
        for heading in re.findall(r"^#+ (.+)$", README, re.MULTILINE)
    }
    for anchor in re.findall(r"\]\(#([^)]+)\)", README):
        assert anchor in headings, anchor
    for path in re.findall(r"`((?:src|tests|stages|docs|examples|python|plugin)/[\w./-]*)`", README):
        assert (ROOT / path).exists(), path


def test_attributes_that_are_shown_are_in_the_schema() -> None:
    schema = (ROOT / "plugin" / "schema.usda").read_text(encoding="utf-8")
    stated = set(re.findall(r"abbe:(?:dispersion|dielectricPriority|glass)[\w:]*", README))
    assert stated, "no attribute is shown"
    for name in stated:
        assert name in schema, name
