"""Values in the EXR against a computation of the same pixels that shares no code with the product (`mp_oracle`)."""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pxr.Usd", reason="reads stages with usd-core")
pytest.importorskip("mpmath", reason="computes at 50 digits with mpmath")
pytest.importorskip("OpenImageIO", reason="reads the EXR with OpenImageIO")

import mp_oracle as oracle
import OpenImageIO as oiio
from mp_oracle import MP, Pixel, Scene

import abbe

WIDTH, HEIGHT = 320, 180

# Column, row, and the events the pixel is there for: R refraction, T total reflection; where the chain ends.
PIXELS = {
    "ball": [
        (163, 50, "RR", "/World/Floor"),
        (140, 130, "RR", "/World/Backdrop"),
        (175, 60, "RR", "/World/Floor"),
        (133, 148, "RR", None),
    ],
    "prism": [
        (150, 135, "RR", "/World/Floor"),
        (128, 89, "RR", "/World/Target"),
        (186, 118, "RTR", "/World/Target"),
        (199, 113, "RR", None),
    ],
    "gem": [
        (208, 100, "RTTTR", "/World/Ground"),
        (189, 89, "RTTR", "/World/Tent"),
        (139, 148, "RTTTTR", "/World/Tent"),
        (195, 68, "RTTTTTTR", "/World/Tent"),
        # Here a critical angle is what limits the footprint.
        (113, 37, "RTTTTR", "/World/Tent"),
        (98, 57, "R" + 49 * "T" + "R", "/World/Tent"),
    ],
    # Interpolated normals decide the interactions, facets where they happen.
    "lens": [
        (116, 60, "RRR", "/World/Paper"),
        (121, 80, "RRR", "/World/Paper"),
        (160, 90, "RRR", "/World/Grid"),
        (180, 60, "RRR", "/World/Paper"),
    ],
}

AOVS = [
    *("ddirection_dlambda", "dposition_dlambda", "dispersion_footprint", "footprint_half_width"),
    *("dispersion", "dispersion2", "dispersion_r", "dispersion_g", "dispersion_b"),
    *("ior", "dior_dlambda", "abbe_number", "interfaces", "total_reflections"),
    *("depth", "position", "refracted_depth", "refracted_position", "refracted_prim_id"),
]

# Of f32 values relative to the vector's norm: ten times better than promised, and still no test of rounding.
TOLERANCE = 1e-6

CASES = [(name, *pixel) for name, pixels in PIXELS.items() for pixel in pixels]


class Image:
    """An EXR as OpenImageIO reads it: `image(layer, column, row)` is a list of channels."""

    def __init__(self, path: Path) -> None:
        file = oiio.ImageInput.open(str(path))
        self.spec = file.spec()
        self.pixels = file.read_image(0, 0, 0, self.spec.nchannels, "float")
        # As floats, OpenImageIO scales integers to 0..1.
        for at, name in enumerate(self.spec.channelnames):
            if name.endswith(".I"):
                self.pixels[..., at] = file.read_image(0, 0, at, at + 1, "uint")[..., 0]
        file.close()

    def __call__(self, layer: str, column: int, row: int) -> list[float]:
        names = [f"{layer}.{channel}" for channel in "XYZUVI"]
        values = self.pixels[row - self.spec.y, column - self.spec.x]
        return [float(values[self.spec.channelindex(name)]) for name in names if name in self.spec.channelnames]

    def valid(self, layer: str, column: int, row: int) -> float:
        at = self.spec.channelindex(f"{layer}.valid")
        return float(self.pixels[row - self.spec.y, column - self.spec.x, at])


@pytest.fixture(scope="module")
def image(stages: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Image]]:
    """The rendered file of a stage: the rectangle around its pixels."""
    images: dict[str, Image] = {}

    def get(name: str) -> Image:
        if name not in images:
            columns, rows = ([pixel[axis] for pixel in PIXELS[name]] for axis in (0, 1))
            crop = (min(columns), min(rows), max(columns) + 1, max(rows) + 1)
            path = tmp_path_factory.mktemp("independent") / f"{name}.exr"
            film = abbe.render(stages / f"{name}.usda", width=WIDTH, height=HEIGHT, samples=1, aovs=AOVS, crop=crop)
            film.write(path)
            images[name] = Image(path)
        return images[name]

    yield get


@pytest.fixture(scope="module")
def scene(stages: Path) -> Callable[[str], Scene]:
    scenes: dict[str, Scene] = {}

    def get(name: str) -> Scene:
        if name not in scenes:
            scenes[name] = Scene(stages / f"{name}.usda", WIDTH, HEIGHT)
        return scenes[name]

    return get


def relative_error(value: list[float], expected: Any) -> float:
    expected = expected if isinstance(expected, list) else [expected]
    assert len(value) == len(expected)
    off = oracle.length([MP.mpf(a) - b for a, b in zip(value, expected, strict=True)])
    return float(off / oracle.length(expected))


def channel_wavelengths() -> list[float]:
    """Centroids of the positive parts of the Rec.709 responses, by colour-science's observer and matrix."""
    with warnings.catch_warnings():
        # It tells which of its own optional parts are missing.
        warnings.simplefilter("ignore")
        import colour
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    x = np.arange(360, 830.01, 0.05)
    xyz = np.array([np.interp(x, observer.wavelengths, values) for values in observer.values.T])
    rgb = np.maximum(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ xyz, 0)
    return list(rgb @ x / rgb.sum(axis=1))


def written_wavelengths(image: Image) -> list[Any]:
    text = image.spec.getattribute("abbe:channelWavelengths")
    return [MP.mpf(part.split()[1]) for part in text.split(",")]


def test_channel_wavelengths_are_the_centroids_of_the_responses(image: Callable[[str], Image]) -> None:
    # Published matrices differ in their fifth digit, with the white point's.
    written = [float(wavelength) for wavelength in written_wavelengths(image("ball"))]
    np.testing.assert_allclose(written, channel_wavelengths(), atol=0.01)


@pytest.mark.parametrize(("name", "column", "row", "events", "end"), CASES)
def test_values_in_the_file_are_those_of_an_independent_computation(
    image: Callable[[str], Image],
    scene: Callable[[str], Scene],
    name: str,
    column: int,
    row: int,
    events: str,
    end: str | None,
) -> None:
    file, pixel = image(name), Pixel(scene(name), column, row)
    chain, trace = pixel.chain, pixel.at_reference
    assert "".join("T" if step.reflects else "R" for step in chain.steps) == events
    assert (chain.end and chain.end.prim) == end

    first = chain.steps[0].after
    assert first is not None
    indices = [first.ior(oracle.REFERENCE + sign * oracle.STEP) for sign in (-1, 1)]
    expected = {
        "ddirection_dlambda": pixel.direction_by_wavelength,
        "dispersion": pixel.dispersion,
        "dispersion2": pixel.dispersion2,
        "footprint_half_width": pixel.half_width,
        "ior": first.ior(oracle.REFERENCE),
        "dior_dlambda": (indices[1] - indices[0]) / (2 * oracle.STEP),
        "abbe_number": first.abbe_number,
        "position": trace.points[0],
    }
    if end is not None:
        expected["dposition_dlambda"] = pixel.position_by_wavelength
        expected["dispersion_footprint"] = 300 * oracle.length(pixel.position_by_wavelength)
        expected["refracted_position"] = trace.points[-1]
    for channel, wavelength in zip("rgb", written_wavelengths(file), strict=True):
        try:
            expected[f"dispersion_{channel}"] = pixel.fetch_offset(wavelength)
        except oracle.OtherChain:
            # There is no way there without an edge between.
            assert file.valid(f"dispersion_{channel}", column, row) == 0

    worst = {layer: relative_error(file(layer, column, row), value) for layer, value in expected.items()}
    depths = {"depth": trace.points[0]} | ({"refracted_depth": trace.points[-1]} if end is not None else {})
    for layer, point in depths.items():
        written = file.pixels[row - file.spec.y, column - file.spec.x, file.spec.channelindex(f"{layer}.Z")]
        worst[layer] = relative_error([float(written)], pixel.scene.depth(point))
    print(f"{name} {column},{row} {events}:", *(f"{layer} {error:.1e}" for layer, error in worst.items()))
    assert {layer: error for layer, error in worst.items() if not error <= TOLERANCE} == {}
    assert all(file.valid(layer, column, row) == 1 for layer in worst)
    assert file("interfaces", column, row) == [len(events)]
    assert file("total_reflections", column, row) == [events.count("T")]
    if end is None:
        for layer in ("dposition_dlambda", "dispersion_footprint", "refracted_position", "refracted_depth"):
            assert file.valid(layer, column, row) == 0
        assert file("refracted_prim_id", column, row) == [0]
