"""Every stage of the shared assets, which nobody here wrote: renders, or stops with an error that names a prim or file.

Never another exception, a crash or a hang: the stages are rendered by a process of their own under a limit for each.
"""

import json
import os
import queue
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pxr.Usd", reason="stages need usd-core")

ROOT = Path(__file__).resolve().parents[2]
WORKER = Path(__file__).with_name("render_assets.py")
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")
# The slowest takes half a second; this is for the machine that is busy with everything else.
SECONDS_PER_STAGE = 60

# Stages that cannot be rendered, and what is said of them.
ERRORS: dict[str, str] = {}


def _folder() -> Path | None:
    named = os.environ.get("ABBE_ASSETS")
    if named:
        return Path(named)
    candidates = [ROOT / "shared" / "assets", *(parent / "shared" / "assets" for parent in list(ROOT.parents)[:2])]
    return next((folder for folder in candidates if folder.is_dir()), None)


FOLDER = _folder()


def _stages() -> list[Path]:
    return sorted(path for path in FOLDER.rglob("*") if path.suffix in EXTENSIONS) if FOLDER else []


class Worker:
    """The rendering process; `render` gives what it says of a stage, and starts another where it fell silent."""

    def __init__(self) -> None:
        self._start()

    def _start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, args=(self.process, self.lines), daemon=True).start()

    @staticmethod
    def _listen(process: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)
        # The end: it crashed, or was told to.
        lines.put("")

    def render(self, stage: Path) -> dict[str, Any]:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{stage}\n")
        self.process.stdin.flush()
        try:
            for _ in range(2):
                line = self.lines.get(timeout=SECONDS_PER_STAGE)
                if not line:
                    code = self.process.wait()
                    self.stop()
                    self._start()
                    return {"fault": f"the process ended with {code}"}
        except queue.Empty:
            self.stop()
            self._start()
            return {"fault": f"nothing after {SECONDS_PER_STAGE} s"}
        result: dict[str, Any] = json.loads(line)
        return result

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()


@pytest.fixture(scope="module")
def results() -> Iterator[dict[str, dict[str, Any]]]:
    """What became of every stage, by its path in the folder."""
    stages = _stages()
    if not stages:
        pytest.skip("NO SHARED ASSETS: 287 stages are not rendered; set ABBE_ASSETS to their folder")
    assert FOLDER is not None
    worker = Worker()
    found = {path.relative_to(FOLDER).as_posix(): worker.render(path) for path in stages}
    worker.stop()
    yield found


def test_every_stage_renders_or_says_which_prim_it_cannot(results: dict[str, dict[str, Any]]) -> None:
    assert len(results) > 250
    assert {name: result["fault"] for name, result in results.items() if "fault" in result} == {}
    errors = {name: result["error"] for name, result in results.items() if "error" in result}
    assert errors.keys() == ERRORS.keys()
    for name, text in ERRORS.items():
        assert errors[name].startswith(text)
        assert "\n" not in errors[name]
    rendered = [result for result in results.values() if "resolution" in result]
    assert all(result["resolution"][0] == 32 for result in rendered)
    print(Counter(warning for result in rendered for warning in result["warnings"]))


def test_what_is_seen_lies_where_usd_places_it(results: dict[str, dict[str, Any]]) -> None:
    # Positions are single precision.
    outside = {name: result["outside"] for name, result in results.items() if result.get("outside", 0) > 1e-5}
    assert outside == {}
    assert sum(result.get("seen", 0) > 0 for result in results.values()) > 200


def test_every_hit_is_seen_where_usds_camera_projects_it(results: dict[str, dict[str, Any]]) -> None:
    framed = {name: result["framing"] for name, result in results.items() if result.get("framing") is not None}
    # Positions are single precision; some worlds are far from their origin.
    assert {name: off for name, off in framed.items() if off > 2e-3} == {}
    assert len(framed) > 30


def test_something_is_seen_where_there_is_something(results: dict[str, dict[str, Any]]) -> None:
    empty = {
        name
        for name, result in results.items()
        if result.get("seen") == 0 and "nothing-to-render" not in result["warnings"]
    }
    assert empty == set()
