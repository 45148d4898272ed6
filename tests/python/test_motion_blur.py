"""Motion blur as people ask for it: switches, frames, and vectors that lead to the next frame's image."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr.Usd", reason="moves stages with usd-core")

import abbe
from abbe.cli import main

STAGE = """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 4
    upAxis = "Y"
    metersPerUnit = 0.01
)
def Camera "C"
{
    float focalLength = 35
    float horizontalAperture = 36
    float verticalAperture = 24
    double shutter:open = -0.25
    double shutter:close = 0.25
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Cube "Box"
{
    double3 xformOp:translate.timeSamples = { 0: (-1, 0, 0), 4: (1, 0.5, 0.4) }
    float xformOp:rotateY.timeSamples = { 0: 0, 4: 60 }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "box.usda"
    path.write_text(STAGE)
    return path


def test_the_switch_is_above_what_the_stage_says(stage: Path) -> None:
    def shutter(path: Path, **options: object) -> object:
        film = abbe.render(path, width=24, samples=4, aovs=["depth"], **options)  # type: ignore[arg-type]
        return film.statistics["plan"]["shutter"]

    assert shutter(stage) == [-0.25, 0.25]
    assert shutter(stage, motion_blur=False) is None
    stage.write_text(STAGE + 'def RenderSettings "R"\n{\n    bool disableMotionBlur = true\n}\n')
    assert shutter(stage) is None
    assert shutter(stage, motion_blur=True) == [-0.25, 0.25]


def test_frames_of_one_stage_are_those_rendered_alone(
    stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--width", "24", "--samples", "4", "--aov", "position", "--aov", "motion", "--quiet"]
    assert main(["render", str(stage), "all.##.exr", "--frames", "3:1", *options]) == 0
    for frame in (1, 2, 3):
        assert main(["render", str(stage), "one.exr", "--frames", str(frame), *options]) == 0
        assert (tmp_path / f"all.{frame:02}.exr").read_bytes() == (tmp_path / "one.exr").read_bytes()


def test_vectors_lead_to_where_the_next_frame_shows_the_same_point(stage: Path) -> None:
    def film(frame: int) -> abbe.Film:
        options = {"motion_blur": False, "aovs": ["motion", "position", "prim_id"]}
        return abbe.render(stage, frame=frame, width=360, **options)  # type: ignore[arg-type]

    now, then = film(1), film(2)
    motion, position = now["motion"].astype(float), then["position"].astype(float)

    def in_box(points: np.ndarray, frame: int) -> np.ndarray:
        part = frame / 4
        turn = np.radians(60 * part)
        offset = points - np.array([-1 + 2 * part, 0.5 * part, 0.4 * part])
        back = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
        return offset @ back.T

    shown, shown_then = now["prim_id"].reshape(240, 360), then["prim_id"].reshape(240, 360)
    rows, columns = np.nonzero(shown == 1)
    checked = 0
    for row, column in list(zip(rows, columns, strict=True))[::97]:
        x, y = column + motion[row, column, 0], row - motion[row, column, 1]
        x0, y0 = int(np.floor(x)), int(np.floor(y))
        if not (0 <= x0 < 359 and 0 <= y0 < 239) or (shown_then[y0 : y0 + 2, x0 : x0 + 2] != 1).any():
            continue
        wx, wy = x - x0, y - y0
        corners = in_box(position[y0 : y0 + 2, x0 : x0 + 2].reshape(-1, 3), 2)
        seen = np.array([(1 - wx) * (1 - wy), wx * (1 - wy), (1 - wx) * wy, wx * wy]) @ corners
        own = in_box(now["position"][row, column].astype(float)[None], 1)[0]
        if np.ptp(np.abs(corners).max(axis=1)) > 1e-5:  # an edge of the box between these pixels
            continue
        assert np.abs(seen - own).max() < 1e-3, (row, column)
        checked += 1
    assert checked > 50
