"""Previews: every kind of AOV is shown as its legend says, absent values as a checker, the file whole or not at all."""

import json

import numpy as np
import pytest

from abbe import preview
from abbe.errors import AbbeError, UsageError
from abbe.preview import Tile, contact_sheet, write_preview

Image = pytest.importorskip("PIL.Image", reason="previews are drawn with Pillow")

UNITS = [
    {"name": "dispersion", "unit": "pixel/nm"},
    {"name": "prim_id", "unit": "index"},
    {"name": "interfaces", "unit": "count"},
]


def vectors(height=30, width=40):
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x - width / 2 + 0.5, height / 2 - 0.5 - y], axis=-1).astype(np.float32)


class Film(dict):
    """As much of a film as a preview uses."""

    def __init__(self, **arrays):
        super().__init__(arrays)
        self.metadata = {
            "abbe:stage": "/stages/ball.usda",
            "abbe:primManifest": json.dumps(["/World/Ball", "/World/Floor"]),
        }
        self.absent = np.ones((30, 40), np.float32)
        self.absent[:, :20] = 0

    def valid(self, name):
        return None if self[name].dtype == np.uint32 else self.absent


def film():
    return Film(
        dispersion=vectors(),
        depth=vectors()[:, :, :1] + 100,
        normal=np.dstack([vectors() / 40, np.full((30, 40), 0.5, np.float32)]),
        prim_id=np.repeat(np.arange(3, dtype=np.uint32), 400).reshape(30, 40, 1),
        interfaces=np.repeat(np.arange(3, dtype=np.uint32), 400).reshape(30, 40, 1),
    )


def test_a_film_becomes_a_sheet(tmp_path):
    path = tmp_path / "sheet.png"
    write_preview(film(), path, aovs=UNITS)
    with Image.open(path) as sheet:
        assert sheet.mode == "RGB"
        assert min(sheet.size) > 300
    assert [entry.name for entry in tmp_path.iterdir()] == ["sheet.png"]
    first = path.read_bytes()
    write_preview(film(), path, aovs=UNITS)
    assert path.read_bytes() == first


def test_only_the_layers_asked_for_are_shown(tmp_path):
    tiles, title = preview.tiles_of(film(), layers=["prim_id", "dispersion"], aovs=UNITS)
    assert [tile.name for tile in tiles] == ["prim_id", "dispersion"]
    assert tiles[1].unit == "pixel/nm"
    assert list(tiles[0].names) == ["/World/Ball", "/World/Floor"]
    assert "ball.usda" in title
    with pytest.raises(UsageError, match=r"dispersoin.*dispersion"):
        write_preview(film(), tmp_path / "sheet.png", layers=["dispersoin"], aovs=UNITS)
    assert not list(tmp_path.iterdir())


def test_a_file_shows_what_the_film_shows(tmp_path):
    pytest.importorskip("OpenImageIO")
    import sample_exr

    channels, header = sample_exr.sound()
    sample_exr.write(tmp_path / "in.exr", channels, header)
    tiles, title = preview.tiles_of(tmp_path / "in.exr")
    assert [tile.name for tile in tiles] == [row["name"] for row in sample_exr.TABLE]
    by_name = {tile.name: tile for tile in tiles}
    assert by_name["position"].values.shape == (24, 40, 3)
    assert np.array_equal(by_name["position"].values[:, :, 2], channels["position.Z"])
    assert by_name["prim_id"].values.dtype == np.uint32
    assert by_name["dispersion"].unit == "pixel/nm"
    assert "587.5618 nm" in title
    write_preview(tmp_path / "in.exr", tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.size[0] > 600


def test_directions_are_hues_and_lengths_lightness():
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    rim = preview._hue_and_lightness(angle, np.ones(100))
    # Inside sRGB: nothing is clipped, so hues differ and are equally light.
    assert rim.min() >= 0
    assert rim.max() <= 1
    distances = np.linalg.norm(rim - np.roll(rim, 50, axis=0), axis=-1)
    assert distances.min() > 0.3
    lightness = preview._hue_and_lightness(np.full(20, 1.0), np.linspace(0, 1, 20)).sum(axis=-1)
    assert np.all(np.diff(lightness) > 0)
    assert np.all(preview._hue_and_lightness(np.zeros(1), np.zeros(1)) == 0)


def test_viridis_goes_from_dark_to_light():
    colours = preview._viridis(np.linspace(-1, 2, 300))
    assert np.array_equal(colours[0], preview._VIRIDIS[0])
    assert np.array_equal(colours[-1], preview._VIRIDIS[-1])
    luminance = colours**2.2 @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(luminance) >= 0)


def test_a_few_extreme_pixels_do_not_set_the_scale():
    values = np.ones((100, 100, 1), np.float32)
    values[:90] = 0
    values[99, :5] = 1e6
    picture = preview._picture(Tile("dispersion_footprint", "dispersion_footprint", values))
    assert np.allclose(picture.colours[95, 50], preview._VIRIDIS[-1])
    assert np.allclose(picture.colours[0, 0], preview._VIRIDIS[0])


def test_absent_and_broken_values_show_the_checker():
    values = np.ones((40, 40, 1), np.float32)
    values[0, 0] = np.nan
    valid = np.ones((40, 40), np.float32)
    valid[:, :20] = 0
    tile = Tile("ior", "ior", values * valid[:, :, np.newaxis], valid)
    picture = preview._picture(tile)
    shown = np.asarray(preview._scaled(Image, picture, preview._weight(tile), (40, 40)))
    greys = {tuple(colour) for colour in shown[:, :20].reshape(-1, 3)}
    assert greys == set(preview._CHECKER)
    assert not {tuple(colour) for colour in shown[:, 20:].reshape(-1, 3)} & greys


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (700, 2), (30, 40)])
@pytest.mark.parametrize("fill", [0.0, 1.0, np.nan])
def test_any_size_and_content_can_be_shown(shape, fill):
    tiles = [
        Tile(name, name, np.full((*shape, n), fill, np.float32), np.ones(shape, np.float32), "nm")
        for name, n in [
            ("dispersion", 2),
            ("normal", 3),
            ("depth", 1),
            ("ior", 1),
            ("position", 3),
            ("uv", 2),
            ("x", 3),
        ]
    ]
    tiles += [Tile("prim_id", "prim_id", np.full((*shape, 1), 4_000_000_000, np.uint32), None, "index")]
    tiles += [Tile("interfaces", "interfaces", np.full((*shape, 1), 4_000_000_000, np.uint32), None, "count")]
    contact_sheet(tiles, title="title λ")


def test_rows_are_full_where_they_can_be():
    # Cells of a 16:9 image.
    grids = {count: preview._columns(count, 422, 375) for count in range(1, 26)}
    assert [grids[count] for count in (1, 2, 3)] == [1, 2, 3]
    assert grids[4] in (2, 4)
    assert (grids[6], grids[12], grids[20]) == (3, 4, 5)
    for count, columns in grids.items():
        assert -count % columns <= 2, f"{count} tiles in {columns} columns"


def test_legends_are_wrapped_not_cut():
    text = "length of the vector; saturates at percentile 99; greatest value 7.465e-07"
    lines = preview._wrapped(text, preview._SMALL, 330)
    assert len(lines) == 2
    assert " ".join(lines) == text
    assert all(preview._length(line, preview._SMALL) <= 330 for line in lines)
    # One word that is too long stays one.
    assert preview._wrapped("a" * 200, preview._SMALL, 330) == ["a" * 200]


@pytest.mark.parametrize("name", ["dispersion", "ddirection_dlambda", "depth", "ior", "uv", "position"])
def test_no_text_of_a_narrow_sheet_is_shortened(name, monkeypatch):
    channels = {"dispersion": 2, "uv": 2, "depth": 1, "ior": 1}.get(name, 3)
    values = np.random.default_rng(1).lognormal(-20, 5, (60, 20, channels)).astype(np.float32)
    bottoms = []
    write = preview._write

    def watched(canvas, at, text, size, colour, room=None, anchor="la"):
        assert room is None or preview._length(text, size) <= room, text
        bottoms.append(at[1] + size)
        return write(canvas, at, text, size, colour, room, anchor)

    monkeypatch.setattr(preview, "_write", watched)
    title = "prism.usda   20 x 60   reference 587.5618 nm   band 400:700 nm"
    sheet = contact_sheet([Tile(name, name, values, np.full((60, 20), 0.5, np.float32), "stage unit/nm")], title=title)
    assert max(bottoms) <= sheet.size[1] - 8


def test_a_legend_of_counts_tells_that_there_are_greater_ones():
    assert preview._count_labels([0, 2, 5], 5, 24, 6) == [(0, "0"), (2, "2"), (5, "5")]
    many = preview._count_labels(list(range(65)), 64, 24, 6)
    assert many[-1] == (64, "… up to 64")
    assert len(many) <= 24
    assert many[:3] == [(0, "0"), (1, "1"), (2, "2")]
    # Above the palette.
    assert preview._count_labels([0, 64], 900, 24, 6) == [(0, "0"), (64, "… up to 900")]


def test_identifiers_have_distinct_colours():
    colours = {preview._identifier_colour(i) for i in range(1, 200)}
    assert len(colours) == 199
    assert preview._identifier_colour(0) == (0, 0, 0)


def test_files_that_cannot_be_shown_or_written_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_preview(film(), tmp_path / "nowhere" / "sheet.png", aovs=UNITS)
    with pytest.raises(FileNotFoundError, match=r"none\.exr"):
        write_preview(tmp_path / "none.exr", tmp_path / "sheet.png")
    (tmp_path / "text.exr").write_text("no image")
    with pytest.raises(AbbeError, match=r"text\.exr"):
        write_preview(tmp_path / "text.exr", tmp_path / "sheet.png")
    with pytest.raises(UsageError, match="no layer"):
        write_preview({}, tmp_path / "sheet.png", aovs=UNITS)
