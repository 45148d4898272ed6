"""The wheel as users get it: installed in an empty environment, away from the repository."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

# USD finds the schemas in the folder that `abbe plugin-path` printed, in a process that never imports abbe.
PROBE = """
import sys
from pxr import Plug, Usd
Plug.Registry().RegisterPlugins(sys.argv[1])
stage = Usd.Stage.CreateInMemory()
prim = stage.DefinePrim("/M", "Material")
assert prim.ApplyAPI("AbbeDispersionAPI")
print(prim.GetAttribute("abbe:dispersion:vd").Get())
"""


@pytest.fixture(scope="module")
def wheel() -> Path:
    """The wheel that was built for this run."""
    if "ABBE_WHEEL" not in os.environ:
        pytest.skip("ABBE_WHEEL names no wheel; `make test` builds one")
    path = Path(os.environ["ABBE_WHEEL"])
    assert path.is_file()
    return path


def test_the_wheel_carries_what_it_must(wheel: Path) -> None:
    assert "-cp311-abi3-" in wheel.name
    names = set(zipfile.ZipFile(wheel).namelist())
    for name in (
        "plugin/plugInfo.json",
        "plugin/generatedSchema.usda",
        "plugin/AbbeGlass.usda",
        "py.typed",
        "_core.pyi",
        "cli/render.py",
        "usd/reader.py",
    ):
        assert f"abbe/{name}" in names
    assert any(name.endswith("licenses/LICENSE-MIT") for name in names)
    assert not any(name.startswith("tests/") or "__pycache__" in name for name in names)


def test_the_wheel_works_in_an_empty_environment(wheel: Path, tmp_path: Path, stages: Path) -> None:
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV", "PXR_"))
    }

    def call(*command: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            list(map(str, command)), cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )

    def must(*command: str | Path) -> str:
        result = call(*command)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout

    venv = tmp_path / "venv"
    must(sys.executable, "-m", "venv", venv)
    python, command = venv / "bin" / "python", venv / "bin" / "abbe"

    # Alone: everything but stages.
    must(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel)
    assert "dispersion" in must(command, "aovs")
    folder = Path(must(command, "plugin-path").strip())
    assert folder.is_relative_to(venv) and (folder / "plugInfo.json").is_file()
    result = call(command, "render", stages / "prism.usda", "prism.exr")
    assert result.returncode == 1 and "pip install 'abbe[usd]'" in result.stderr, result.stderr
    assert "absent" in must(command, "doctor")

    # With everything, as `pip install '.[all]'`.
    must(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"abbe[all] @ {wheel.as_uri()}")
    assert float(must(python, "-c", PROBE, folder)) == 0.0
    must(command, "render", stages / "prism.usda", "prism.exr", "--width", "64", "--preview", "prism.png")
    must(command, "check", "prism.exr")
    assert (tmp_path / "prism.png").is_file()
    assert "absent" not in must(command, "doctor")
