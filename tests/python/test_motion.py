"""The motions on screen against what they claim, by images: points of surfaces are followed between them.

`refracted_position` tells which point of the world a pixel sees. Rendered at another wavelength, the same point is
found elsewhere, by inverse interpolation. Small windows of a large image are rendered, where maps between raster and
surface are all but linear, and the world is moved so that the point seen has coordinates near zero: single-precision
positions then resolve motions of a millionth of a pixel.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pxr.Usd", reason="moves stages with usd-core")

from pxr import Gf, Usd, UsdGeom

import abbe

REFERENCE = 587.5618
WIDTH, HEIGHT = 6400, 3600
# Pixels on each side of the middle of a window.
REACH = 6

# Middles of windows, in pixels of an image 320 wide; away from edges of facets, of glass and of what is behind it.
PLACES = {
    "ball": [(163, 50), (140, 130), (175, 60), (120, 95)],
    "prism": [(150, 135), (128, 89), (158, 96)],
    # After two to seven total reflections.
    "gem": [(123, 117), (95, 133), (102, 62), (163, 24)],
    # Cemented, with interpolated normals.
    "lens": [(150, 63), (155, 79), (180, 60), (155, 91)],
}
# Which channels' points are seen at the reference too, in a window without an edge.
CHANNELS = {
    ("prism", 158, 96): "rg",
    ("gem", 123, 117): "rg",
    ("gem", 95, 133): "r",
    ("gem", 102, 62): "",
    ("gem", 163, 24): "",
}
CASES = [(name, *place) for name, places in PLACES.items() for place in places]

# The promise is 1e-4 pixels; windows like these resolve much less.
ABSOLUTE = 2e-6

Array = np.ndarray[Any, np.dtype[np.float64]]


class View:
    """A stage with the point that one pixel sees at the origin, and windows of its image."""

    def __init__(self, path: Path, column: int, row: int) -> None:
        self.column, self.row = 20 * column + 10, 20 * row + 10
        stage = Usd.Stage.Open(str(path))
        scene = abbe.Scene.from_stage(stage)
        seen = self._window(scene, REFERENCE, ["refracted_position"], self.column, self.row)["refracted_position"]
        layer = stage.GetSessionLayer()
        with Usd.EditContext(stage, layer):
            shift = Gf.Vec3d(*(-float(x) for x in seen[REACH, REACH]))
            UsdGeom.Xformable(stage.GetDefaultPrim()).AddTranslateOp(opSuffix="window").Set(shift)
        self.scene = abbe.Scene.from_stage(stage)

    @staticmethod
    def _window(scene: abbe.Scene, wavelength: float, aovs: list[str], column: int, row: int) -> dict[str, Array]:
        crop = (column - REACH, row - REACH, column + REACH + 1, row + REACH + 1)
        film = scene.render(width=WIDTH, height=HEIGHT, crop=crop, samples=1, wavelength=wavelength, aovs=aovs)
        for name in aovs:
            assert film.valid(name) is None or np.all(film.valid(name) == 1), f"{name} at {column}, {row}"
        return {name: np.array(film[name], dtype=np.float64) for name in aovs}

    def window(self, wavelength: float, *aovs: str, column: int = 0, row: int = 0) -> dict[str, Array]:
        """Layers of the window whose middle is so many pixels from that of the view, y up."""
        return self._window(self.scene, wavelength, list(aovs), self.column + column, self.row - row)


def raster() -> Array:
    """Coordinates of a window's pixels from its middle, x right and y up; rows run down."""
    side = np.arange(-REACH, REACH + 1, dtype=np.float64)
    return np.stack(np.meshgrid(side, -side), axis=-1)


def polynomial(at: Array) -> Array:
    """All products of powers up to the third."""
    x, y = at[..., 0], at[..., 1]
    return np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=-1)


def fitted(at: Array, values: Array) -> tuple[Callable[[Array], Array], float]:
    """A smooth function through the values of a window, and how far it misses them at most."""
    scale = np.abs(at).max()
    matrix = polynomial(at.reshape(-1, 2) / scale)
    flat = values.reshape(len(matrix), -1)
    solution = np.linalg.lstsq(matrix, flat, rcond=None)[0]
    return lambda x: polynomial(x / scale) @ solution, float(np.abs(matrix @ solution - flat).max())


def plane(position: Array) -> Array:
    """Two unit vectors along the surface that a window sees."""
    flat = position.reshape(-1, 3)
    vectors: Array = np.linalg.svd(flat - flat.mean(axis=0))[2][:2]
    return vectors


@pytest.mark.parametrize(("name", "column", "row"), CASES)
def test_dispersion_is_the_motion_of_what_is_seen(stages: Path, name: str, column: int, row: int) -> None:
    view = View(stages / f"{name}.usda", column, row)
    here = view.window(REFERENCE, "dispersion", "dispersion2", "refracted_position", "refracted_prim_id")
    assert np.unique(here["refracted_prim_id"]).size == 1
    along = plane(here["refracted_position"])

    # The inner pixels' points, found in the images on both sides.
    inner = np.s_[REACH - 2 : REACH + 3, REACH - 2 : REACH + 3]
    points = here["refracted_position"][inner] @ along.T

    def moved(wavelength: float) -> Array:
        position = view.window(wavelength, "refracted_position")["refracted_position"] @ along.T
        find, miss = fitted(position, raster())
        # Smooth, or this place says nothing.
        assert miss < 1e-4, f"the window is not smooth: {miss:.1e} px"
        return find(points) - raster()[inner]

    less, more = moved(REFERENCE - 1), moved(REFERENCE + 1)
    # The same at the reference takes out what the fits have in common.
    still = moved(REFERENCE)
    first, second = (more - less) / 2, more + less - 2 * still
    for layer, found in (("dispersion", first), ("dispersion2", second)):
        claimed = here[layer][inner]
        off = np.linalg.norm(found - claimed, axis=-1)
        size = np.linalg.norm(claimed, axis=-1)
        print(f"{name} {column},{row} {layer}: {size.max():.3g} px, off {off.max():.1e} px, {(off / size).max():.1e}")
        assert np.all(off <= 1e-3 * size + ABSOLUTE)


@pytest.mark.parametrize(
    ("name", "column", "row", "channels"),
    [(*case, CHANNELS.get(case, "rgb")) for case in CASES if CHANNELS.get(case, "rgb")],
)
def test_fetching_with_the_channel_offsets_gives_the_view_at_that_wavelength(
    stages: Path, name: str, column: int, row: int, channels: str
) -> None:
    view = View(stages / f"{name}.usda", column, row)
    film = view.scene.render(width=32, aovs=["dispersion_r"])
    texts = str(film.metadata["abbe:channelWavelengths"]).split(",")
    wavelengths = {text.split()[0].lower(): float(text.split()[1]) for text in texts}
    assert list(wavelengths) == ["r", "g", "b"]
    for channel in channels:
        wavelength, layer = wavelengths[channel], f"dispersion_{channel}"
        offset = view.window(REFERENCE, layer)[layer][REACH, REACH]
        target = view.window(wavelength, "refracted_position")["refracted_position"][REACH, REACH]
        whole = np.round(offset)
        at = view.window(REFERENCE, "refracted_position", column=int(whole[0]), row=int(whole[1]))["refracted_position"]
        along = plane(at)
        # Where the image at the reference shows the target: in pixels, so that scales need no care.
        find, miss = fitted((at - target) @ along.T, raster())
        assert miss < 1e-4, f"the window is not smooth: {miss:.1e} px"
        off = np.linalg.norm(whole + find(np.zeros(2)) - offset)
        size = np.linalg.norm(offset)
        print(f"{name} {column},{row} {layer}: {size:.3g} px, off {off:.1e} px, {off / size:.1e}")
        assert off <= 1e-3 * size + ABSOLUTE
        # Off the surface there is nothing to find.
        across = np.cross(along[0], along[1])
        assert abs((at[REACH, REACH] - target) @ across) < 1e-4 * np.ptp(at @ along.T)
