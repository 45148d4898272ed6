"""A contact sheet of AOVs as PNG, in colours that can be read without a manual.

Magnitudes are shown in viridis, whose lightness grows evenly with the value; pixel vectors by hue (direction) and
lightness (magnitude) of OKLCh, in which hues are equally bright; identifiers by distinct colours. Every tile says its
unit and scale. Scales are robust: a few extreme pixels (caustics, grazing rays) do not darken the rest, and the legend
says at which percentile colours saturate. Where an AOV has no value a grey checker shows through.

Sources: viridis by S. van der Walt, N. Smith and E. Firing (matplotlib, CC0), 33 of its 256 entries, linear in between;
OKLab by B. Ottosson, "A perceptual color space for image processing", 2020 (public domain).
"""

from __future__ import annotations

import colorsys
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ._colours import hue_and_lightness, srgb, viridis
from ._files import replacing
from ._image import channel_name, read_exr
from .errors import AbbeError, UsageError
from .manifest import Manifest

__all__ = ["Tile", "contact_sheet", "tiles_of", "write_preview"]

# Colours saturate beyond this percentile of the magnitude, or below its complement where a scale does not begin at 0.
_PERCENTILE = 99.0

# The sheet: colours in sRGB bytes, lengths in pixels.
_PAPER, _INK, _FAINT = (24, 25, 28), (236, 236, 236), (168, 170, 176)
_CHECKER = ((74, 74, 78), (92, 92, 96))
_CHECK = 8
_MARGIN, _GAP = 24, 22
_TILE_WIDTH, _TILE_HEIGHT = 400, 300
_LEGEND_HEIGHT = 84
_TITLE, _TEXT, _SMALL = 18, 14, 12
# From one line of small text, and of the title, to the next.
_SMALL_STEP, _TITLE_STEP = 16, 26

# What the font that Pillow brings along cannot show.
_ASCII = str.maketrans(
    {"²": "^2", "³": "^3", "×": "x", "∂": "d", "λ": "lambda", "µ": "u", "°": " deg", "…": "...", "–": "-"}
)

_NORMALS = frozenset({"normal", "normal_geometric", "refracted_normal", "refracted_normal_geometric"})
_MANIFESTS = {"prim": "abbe:primManifest", "instance": "abbe:instanceManifest", "material": "abbe:materialManifest"}


@dataclass
class Tile:
    """One AOV to show.

    Attributes
    ----------
    name : what the tile is called
    aov : the AOV, which decides how it is shown
    values : array of shape (height, width, channels), float or unsigned integer
    valid : fraction of samples with a value, shape (height, width); None if all have one
    unit : unit of the values
    names : what identifiers mean: entry n - 1 for the number n
    """

    name: str
    aov: str
    values: np.ndarray
    valid: np.ndarray | None = None
    unit: str = ""
    names: Sequence[str] = field(default_factory=tuple)


@dataclass
class _Canvas:
    """The sheet, and Pillow's pen for it."""

    sheet: Any
    draw: Any


@dataclass
class _Picture:
    """A tile in colours, and what its legend says."""

    colours: np.ndarray
    """sRGB in 0..1, shape (height, width, 3)."""
    legend: Callable[[_Canvas, tuple[int, int, int, int]], None]
    """Draws the legend into a box."""
    blends: bool = True
    """Whether neighbouring pixels may be averaged when the picture is made smaller."""


def write_preview(
    source: Any,
    path: str | os.PathLike[str],
    *,
    layers: Iterable[str] | None = None,
    aovs: Iterable[Mapping[str, Any]] | None = None,
) -> None:
    """Write a contact sheet of a film or of an EXR file.

    Parameters
    ----------
    source : a film (a mapping from AOV to arrays of shape (height, width, channels), with ``film.valid(name)``), a
        mapping of such arrays alone, or the path of an EXR that abbe wrote
    path : the PNG file; it is replaced as a whole
    layers : which layers or AOVs to show, in this order; all if None
    aovs : the AOV table, which has the units; the renderer's own if None

    Raises
    ------
    FileNotFoundError
        The EXR does not exist, or the folder of ``path`` does not.
    UsageError
        A layer is not there.
    AbbeError
        The EXR cannot be read, or Pillow is not installed.
    """
    tiles, title = tiles_of(source, layers=layers, aovs=aovs)
    sheet = contact_sheet(tiles, title=title)
    with replacing(path) as temporary:
        sheet.save(temporary, format="PNG")


def tiles_of(
    source: Any, *, layers: Iterable[str] | None = None, aovs: Iterable[Mapping[str, Any]] | None = None
) -> tuple[list[Tile], str]:
    """Return the tiles of a film or EXR file, and a title; see :func:`write_preview`."""
    if isinstance(source, (str, os.PathLike)):
        tiles, title = _tiles_of_file(source)
    else:
        tiles, title = _tiles_of_film(source, aovs)
    if layers is not None:
        chosen = []
        for wanted in layers:
            found = next((tile for tile in tiles if wanted in (tile.name, tile.aov)), None)
            if found is None:
                known = ", ".join(tile.name for tile in tiles)
                raise UsageError(f"preview: no layer `{wanted}`: choose among {known}")
            chosen.append(found)
        tiles = chosen
    if not tiles:
        raise UsageError("preview: there is no layer to show: ask for at least one AOV")
    return tiles, title


def _tiles_of_file(path: str | os.PathLike[str]) -> tuple[list[Tile], str]:
    image = read_exr(path)
    try:
        layers = image.layers()
    except ValueError as error:
        raise AbbeError(f"{path}: not written by abbe ({error}): name a file that abbe wrote") from None
    tiles = []
    for name, aov in layers:
        prefix = channel_name(name, "")
        # OpenImageIO sorts channels as it likes: components come in the order of the alphabet, as in all our AOVs.
        suffixes = sorted(
            channel[len(prefix) :]
            for channel in image.channels
            if channel.startswith(prefix) and "." not in channel[len(prefix) :] and channel[len(prefix) :] != "valid"
        )
        if name == "":
            suffixes = [suffix for suffix in suffixes if suffix != "Z"] or suffixes
        if not suffixes:
            raise AbbeError(f"{path}: layer `{name}` has no channels: render the file again")
        tiles.append(
            Tile(
                name=name or aov,
                aov=aov,
                values=np.stack([image.channels[channel_name(name, suffix)] for suffix in suffixes], axis=-1),
                valid=image.channel(name, "valid"),
                unit=image.text(f"abbe:unit:{name or aov}") or "",
                names=_manifest(aov, image.attributes),
            )
        )
    x, y, width, height = image.raster
    parts = [Path(path).name, f"{width} x {height}"]
    if (*image.origin, *image.size) != (x, y, width, height):
        parts.append(f"window {image.origin[0]},{image.origin[1]} {image.size[0]} x {image.size[1]}")
    return tiles, "   ".join([*parts, *_facts(image.attributes)])


def _tiles_of_film(film: Any, aovs: Iterable[Mapping[str, Any]] | None) -> tuple[list[Tile], str]:
    if aovs is None:
        try:
            from abbe import _core

            aovs = _core.aovs()
        except ImportError:
            aovs = ()
    units = {str(row["name"]): str(row["unit"]) for row in aovs}
    metadata = getattr(film, "metadata", None) or {}
    valid = getattr(film, "valid", lambda name: None)
    tiles = []
    for name in film.keys():  # noqa: SIM118 (a film is not a dict)
        values = np.asarray(film[name])
        if values.ndim == 2:
            values = values[:, :, np.newaxis]
        tiles.append(Tile(name, name, values, valid(name), units.get(name, ""), _manifest(name, metadata)))
    size = f"{tiles[0].values.shape[1]} x {tiles[0].values.shape[0]}" if tiles else ""
    stage = metadata.get("abbe:stage")
    return tiles, "   ".join([*([Path(str(stage)).name] if stage else []), size, *_facts(metadata)])


def _facts(attributes: Mapping[str, Any]) -> list[str]:
    """What the title says of the render, as far as the header has it."""
    facts = []
    wavelength = attributes.get("abbe:referenceWavelength")
    if isinstance(wavelength, (int, float)):
        facts.append(f"reference {wavelength:.7g} nm")
    if isinstance(band := attributes.get("abbe:band"), str):
        facts.append(f"band {band}")
    return facts


def _manifest(aov: str, attributes: Mapping[str, Any]) -> Sequence[str]:
    attribute = _MANIFESTS.get(aov.removeprefix("refracted_").removesuffix("_id"))
    text = attributes.get(attribute) if attribute else None
    try:
        return Manifest(text) if isinstance(text, str) else ()
    except ValueError:
        return ()


def contact_sheet(tiles: Sequence[Tile], *, title: str = "") -> Any:
    """Draw the tiles in a grid.

    Parameters
    ----------
    tiles : what to show
    title : a line above them

    Returns
    -------
    PIL.Image.Image
        The sheet, RGB.
    """
    try:
        from PIL import Image, ImageDraw
    except ImportError:
        raise AbbeError("preview: Pillow cannot be imported: pip install 'abbe[preview]'") from None
    height, width = tiles[0].values.shape[:2]
    shown = _shown_size(width, height)
    # Wide tiles for wide images, but never narrower than a legend.
    cell_width = max(shown[0], 330)
    cell_height = _TEXT + 12 + shown[1] + 8 + _LEGEND_HEIGHT
    columns = _columns(len(tiles), cell_width + _GAP, cell_height + _GAP)
    rows = math.ceil(len(tiles) / columns)
    room = columns * cell_width + (columns - 1) * _GAP
    lines = _wrapped(title, _TITLE, room) if title else []
    note = "grey checker: no value" if any(_weight(tile) is not None for tile in tiles) else ""
    # Behind the title where there is room, else below it.
    note_x = _length(lines[-1], _TITLE) + 24 if lines else 0
    note_line = len(lines) - 1 if lines else 0
    if note and lines and note_x + _length(note, _SMALL) > room:
        note_x, note_line = 0, len(lines)
    top = _MARGIN + (max(len(lines), note_line + 1) * _TITLE_STEP + 10 if lines or note else 0)
    size = (2 * _MARGIN + room, top + rows * (cell_height + _GAP) - _GAP + _MARGIN)
    sheet = Image.new("RGB", size, _PAPER)
    canvas = _Canvas(sheet, ImageDraw.Draw(sheet))
    for i, line in enumerate(lines):
        _write(canvas, (_MARGIN, _MARGIN - 4 + i * _TITLE_STEP), line, _TITLE, _INK, room)
    if note:
        _write(canvas, (_MARGIN + note_x, _MARGIN + note_line * _TITLE_STEP), note, _SMALL, _FAINT, room)
    for index, tile in enumerate(tiles):
        x = _MARGIN + index % columns * (cell_width + _GAP)
        y = top + index // columns * (cell_height + _GAP)
        picture = _picture(tile)
        label = tile.name if tile.name == tile.aov else f"{tile.name} ({tile.aov})"
        used = _write(canvas, (x, y), label, _TEXT + 2, _INK, cell_width)
        if tile.unit and tile.unit != "1":
            _write(canvas, (x + used + 10, y + 3), f"[{tile.unit}]", _SMALL, _FAINT, cell_width - used - 10)
        y += _TEXT + 12
        sheet.paste(_scaled(Image, picture, _weight(tile), shown), (x, y))
        canvas.draw.rectangle((x - 1, y - 1, x + shown[0], y + shown[1]), outline=(60, 62, 68))
        y += shown[1] + 8
        picture.legend(canvas, (x, y, x + cell_width, y + _LEGEND_HEIGHT))
    return sheet


def _columns(count: int, width: int, height: int) -> int:
    """Columns that bring the sheet close to 16:10 and leave few places empty; none of a handful of tiles."""

    def badness(columns: int) -> float:
        rows = math.ceil(count / columns)
        # A tenth of the places empty is as bad as a sheet half again as wide.
        return abs(math.log(columns * width / (rows * height) / 1.6)) + 4 * (1 - count / (columns * rows))

    return min((n for n in range(1, count + 1) if count > 4 or count % n == 0), key=badness)


def _shown_size(width: int, height: int) -> tuple[int, int]:
    """The size at which an image of this size fits a tile: whole multiples where it is enlarged."""
    scale = min(_TILE_WIDTH / width, _TILE_HEIGHT / height)
    if scale >= 1:
        scale = math.floor(scale)
    return max(1, round(width * scale)), max(1, round(height * scale))


def _weight(tile: Tile) -> np.ndarray | None:
    """How much of each pixel has a value that can be shown; None if all of all."""
    weight = np.ones(tile.values.shape[:2], np.float32) if tile.valid is None else tile.valid
    if tile.values.dtype.kind == "f":
        weight = np.where(np.all(np.isfinite(tile.values), axis=-1), weight, 0)
    weight = np.clip(np.nan_to_num(weight), 0, 1).astype(np.float32)
    return None if np.all(weight == 1) else weight


def _scaled(image_module: Any, picture: _Picture, weight: np.ndarray | None, size: tuple[int, int]) -> Any:
    """The picture at its size on the sheet, over the checker where there is no value."""
    width = picture.colours.shape[1]
    colours = np.round(255 * np.clip(picture.colours, 0, 1)).astype(np.uint8)
    image = image_module.fromarray(colours)
    resampling = image_module.Resampling
    method = resampling.BOX if picture.blends and size[0] < width else resampling.NEAREST
    if weight is None:
        return image.resize(size, method)
    # Colours weighted by validity, so that absent pixels lend no colour to their neighbours.
    weights = image_module.fromarray(weight)
    alpha = np.asarray(weights.resize(size, method))[:, :, np.newaxis]
    planes = [np.asarray(image_module.fromarray(colours[:, :, i] * weight).resize(size, method)) for i in range(3)]
    row, column = np.indices(size[::-1]) // _CHECK
    dark, light = (np.array(grey, np.float32) for grey in _CHECKER)
    checker = np.where(((row + column) % 2)[:, :, np.newaxis], light, dark)
    return image_module.fromarray(np.round(np.stack(planes, axis=-1) + checker * (1 - alpha)).astype(np.uint8))


def _picture(tile: Tile) -> _Picture:
    """Choose how to show a tile."""
    values, channels = tile.values, tile.values.shape[2]
    weight = _weight(tile)
    some = np.ones(values.shape[:2], bool) if weight is None else weight > 0
    if not some.any():
        return _Picture(np.zeros((*values.shape[:2], 3)), _note("no pixel has a value"))
    if values.dtype.kind == "u":
        return _counts(values[:, :, 0]) if tile.unit == "count" else _identifiers(tile)
    # What is not a number is drawn as absent; `abbe check` finds it.
    values = np.where(some[:, :, np.newaxis], values, 0).astype(np.float64)
    if tile.aov in _NORMALS:
        return _Picture(0.5 + 0.5 * values, _note("red, green, blue = 0.5 + 0.5 * (x, y, z)"))
    if tile.aov.endswith("uv") and channels == 2:
        blue = np.zeros_like(values[:, :, :1])
        return _Picture(np.concatenate([np.mod(values, 1.0), blue], axis=-1), _note("red, green = fractions of u, v"))
    if tile.aov.endswith("position"):
        return _coordinates(values, some)
    if tile.aov == "internal_transmittance":
        return _filter(values, some)
    if tile.aov.endswith("albedo"):
        return _Picture(srgb(np.clip(values, 0.0, 1.0)), _note("linear Rec. 709, shown as sRGB"))
    if tile.aov == "variance":
        return _magnitude(np.sqrt(np.mean(values, axis=-1)), some, "standard error of the mean")
    if tile.unit == "radiance":
        return _Picture(srgb(np.clip(values[:, :, :3], 0.0, 1.0)), _note("linear light, shown as sRGB"))
    if channels == 2:
        return _vectors(values, some, tile.unit)
    if tile.aov == "spectral":
        return _magnitude(np.mean(values, axis=-1), some, "mean over the bins")
    if channels > 1:
        return _magnitude(np.linalg.norm(values, axis=-1), some, "length of the vector")
    if tile.aov.endswith("depth"):
        return _depth(values[:, :, 0], some)
    if tile.aov in ("dispersion_footprint", "footprint_half_width"):
        return _magnitude(values[:, :, 0], some, "")
    return _scalar(values[:, :, 0], some)


def _filter(values: np.ndarray, some: np.ndarray) -> _Picture:
    """What is left of white light."""
    least = "  ".join(f"{v:.4g}" for v in values[some].min(axis=0))
    return _Picture(srgb(values), _note("what is left of white: red, green, blue = x, y, z", f"least values {least}"))


def _magnitude(values: np.ndarray, some: np.ndarray, what: str) -> _Picture:
    """Values that begin at 0."""
    inside = values[some]
    high = _robust(inside)
    if high == 0:
        return _Picture(viridis(np.zeros_like(values)), _note("0 wherever there is a value"))
    note = _saturation(high, float(inside.max()))
    return _Picture(viridis(values / high), _bar(viridis, 0.0, high, f"{what}; {note}" if what else note))


def _scalar(values: np.ndarray, some: np.ndarray) -> _Picture:
    """Values of either sign, between their own percentiles."""
    inside = values[some]
    low, high = _spread(inside)
    if low == high:
        return _Picture(viridis(np.full_like(values, 0.5)), _note(f"{low:.7g} wherever there is a value"))
    least, most = float(inside.min()), float(inside.max())
    note = f"all values, {least:.7g} to {most:.7g}"
    if low > least or high < most:
        note = f"percentiles {100 - _PERCENTILE:g} to {_PERCENTILE:g}; values reach {least:.4g} and {most:.4g}"
    return _Picture(viridis((values - low) / (high - low)), _bar(viridis, low, high, note))


def _depth(values: np.ndarray, some: np.ndarray) -> _Picture:
    """Near is bright."""
    inside = values[some]
    low, high = _spread(inside)
    if low == high:
        return _Picture(np.full((*values.shape, 3), 0.5), _note(f"{low:.7g} wherever there is a value"))

    def ramp(t: np.ndarray) -> np.ndarray:
        grey = 0.95 - 0.85 * np.clip(t, 0, 1)
        return np.repeat(grey[..., np.newaxis], 3, axis=-1)

    note = f"near is bright; values reach {inside.min():.5g} and {inside.max():.5g}"
    return _Picture(ramp((values - low) / (high - low)), _bar(ramp, low, high, note))


def _coordinates(values: np.ndarray, some: np.ndarray) -> _Picture:
    """Points, each axis over its own range."""
    spans = [_spread(values[:, :, i][some]) for i in range(3)]
    colours = np.stack([(values[:, :, i] - a) / (b - a or 1) for i, (a, b) in enumerate(spans)], axis=-1)
    lines = [
        f"{colour} = {axis}, {a:.4g} to {b:.4g}"
        for colour, axis, (a, b) in zip(("red", "green", "blue"), "xyz", spans, strict=True)
    ]
    return _Picture(colours, _note(*lines))


def _vectors(values: np.ndarray, some: np.ndarray, unit: str) -> _Picture:
    """Vectors on screen: hue is the direction, lightness the length."""
    length = np.linalg.norm(values, axis=-1)
    scale = _robust(length[some])
    most = float(length[some].max())
    if scale == 0:
        return _Picture(hue_and_lightness(0 * length, length), _note("0 wherever there is a value"))
    # The root shows directions of small motions too; the wheel of the legend has the same scale.
    colours = hue_and_lightness(np.arctan2(values[:, :, 1], values[:, :, 0]), np.sqrt(length / scale))

    def legend(canvas: _Canvas, box: tuple[int, int, int, int]) -> None:
        from PIL import Image

        # Drawn at four times its size: Pillow does not smooth edges.
        radius = 29
        at = (np.arange(8 * radius) + 0.5) / (4 * radius) - 1
        x, y = np.meshgrid(at, -at)
        distance = np.hypot(x, y)
        wheel = hue_and_lightness(np.arctan2(y, x), np.sqrt(distance))
        wheel = np.where((distance <= 1)[:, :, np.newaxis], wheel, np.array(_PAPER) / 255)
        disc = Image.fromarray(np.round(255 * wheel).astype(np.uint8))
        left, top = box[0], box[1] + 14
        canvas.sheet.paste(disc.resize((2 * radius, 2 * radius), Image.Resampling.BOX), (left, top))
        _write(canvas, (left + radius, top - 2), "+y", _SMALL, _FAINT, anchor="mb")
        _write(canvas, (left + 2 * radius + 4, top + radius), "+x", _SMALL, _FAINT, anchor="lm")
        text, room = left + 2 * radius + 34, box[2] - left - 2 * radius - 34
        _write(canvas, (text, box[1]), f"rim: {scale:.4g} {unit}", _TEXT, _INK, room)
        lines = ("hue: direction; lightness: root of the length; black: 0", _saturation(scale, most))
        _write_lines(canvas, (text, box[1] + 20), lines, room)

    return _Picture(colours, legend)


def _identifiers(tile: Tile) -> _Picture:
    """Distinct colours by number, named by the manifest."""
    numbers = tile.values[:, :, 0]
    found, where, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    palette = np.array([_identifier_colour(int(number)) for number in found])
    order = [int(i) for i in np.argsort(-counts, kind="stable") if found[i] != 0]
    absent = bool((found == 0).any())

    def legend(canvas: _Canvas, box: tuple[int, int, int, int]) -> None:
        shown = order[:6]
        labels = []
        for i in shown:
            number = int(found[i])
            path = tile.names[number - 1] if number <= len(tile.names) else ""
            labels.append(f"{number} {path.rpartition('/')[2]}")
        # Long names get the whole width if there are few.
        half = (box[2] - box[0]) // 2
        abreast = 1 if len(shown) <= 3 and any(_length(label, _SMALL) > half - 24 for label in labels) else 2
        width = (box[2] - box[0]) // abreast
        for slot, (i, label) in enumerate(zip(shown, labels, strict=True)):
            x, y = box[0] + slot % abreast * width, box[1] + slot // abreast * 18
            canvas.draw.rectangle((x, y + 2, x + 11, y + 13), fill=tuple(round(255 * float(c)) for c in palette[i]))
            _write(canvas, (x + 17, y), label, _SMALL, _FAINT, width - 24)
        more = len(order) - len(shown)
        notes = [f"and {more} more"] * (more > 0) + ["black: 0, nothing"] * absent
        below = box[1] + math.ceil(len(shown) / abreast) * 18
        _write(canvas, (box[0], below), ", ".join(notes), _SMALL, _FAINT, box[2] - box[0])

    return _Picture(palette[where.reshape(numbers.shape)], legend, blends=False)


def _identifier_colour(number: int) -> tuple[float, float, float]:
    """A colour of its own for every number: hues a golden angle apart differ even between neighbours."""
    if number == 0:
        return (0.0, 0.0, 0.0)
    hue = (number * 0.618033988749895) % 1.0
    ring = number // 8 % 3
    return colorsys.hls_to_rgb(hue, (0.55, 0.7, 0.4)[ring], (0.65, 0.5, 0.8)[ring])


def _counts(values: np.ndarray) -> _Picture:
    """Small whole numbers, one step of viridis each; 0 is black."""
    most = max(int(values.max()), 1)
    steps = min(most, 64)
    palette = np.vstack([np.zeros((1, 3)), viridis(np.linspace(0.15, 1.0, steps))])
    found = [int(number) for number in np.unique(np.minimum(values, steps))]

    def legend(canvas: _Canvas, box: tuple[int, int, int, int]) -> None:
        abreast = (box[2] - box[0]) // 52
        labels = _count_labels(found, int(values.max()), abreast * ((box[3] - box[1]) // 20), abreast)
        for slot, (number, label) in enumerate(labels):
            x, y = box[0] + slot % abreast * 52, box[1] + slot // abreast * 20
            fill = tuple(round(255 * float(c)) for c in palette[number])
            canvas.draw.rectangle((x, y + 1, x + 15, y + 14), fill=fill, outline=_FAINT)
            _write(canvas, (x + 21, y), label, _SMALL, _FAINT, box[2] - x - 21)

    return _Picture(palette[np.minimum(values, steps)], legend, blends=False)


def _count_labels(found: Sequence[int], most: int, places: int, abreast: int) -> list[tuple[int, str]]:
    """Steps of the palette and what to call them; the last one stands for all that have no place of their own.

    Parameters
    ----------
    found : steps that occur, ascending; the last also stands for all counts above it
    most : the greatest count
    places : how many there is room for
    abreast : how many of them stand in a row
    """
    labels = [(number, str(number)) for number in found]
    if len(found) <= places and found[-1] == most:
        return labels
    # That label is longer than others: it stands at the beginning of a row, or where three are left.
    kept = min(len(found) - 1, places - 1)
    while kept % abreast > max(abreast - 3, 0):
        kept -= 1
    return [*labels[:kept], (found[-1], f"… up to {most}")]


def _robust(magnitudes: np.ndarray) -> float:
    """The percentile, of those that are not 0, at which colours saturate: empty surroundings do not set the scale."""
    nonzero = magnitudes[magnitudes > 0]
    return float(np.percentile(nonzero, _PERCENTILE)) if nonzero.size else 0.0


def _spread(values: np.ndarray) -> tuple[float, float]:
    low, high = (float(v) for v in np.percentile(values, (100 - _PERCENTILE, _PERCENTILE)))
    return (low, high) if low < high else (float(values.min()), float(values.max()))


def _saturation(scale: float, most: float) -> str:
    if most <= scale:
        return f"greatest value {most:.4g}"
    return f"saturates at percentile {_PERCENTILE:g}; greatest value {most:.4g}"


def _bar(ramp: Callable[[np.ndarray], np.ndarray], low: float, high: float, note: str) -> Callable[..., None]:
    def legend(canvas: _Canvas, box: tuple[int, int, int, int]) -> None:
        left, right, top = box[0], box[2] - 1, box[1] + 2
        colours = ramp((np.arange(left, right + 1) - left) / (right - left))
        for x, colour in zip(range(left, right + 1), colours, strict=True):
            canvas.draw.line((x, top, x, top + 13), fill=tuple(round(255 * float(c)) for c in colour))
        middle = 0.5 * (low + high)
        for value, anchor, x in ((low, "la", left), (middle, "ma", (left + right) // 2), (high, "ra", right)):
            _write(canvas, (x, top + 19), f"{value:.4g}", _TEXT, _INK, anchor=anchor)
        _write_lines(canvas, (left, top + 41), [note], right - left)

    return legend


def _note(*lines: str) -> Callable[..., None]:
    def legend(canvas: _Canvas, box: tuple[int, int, int, int]) -> None:
        _write_lines(canvas, (box[0], box[1] + 2), lines, box[2] - box[0])

    return legend


def _printable(text: str) -> str:
    return text.translate(_ASCII).encode("ascii", "replace").decode()


def _length(text: str, size: int) -> int:
    """Width of a line in pixels."""
    from PIL import ImageFont

    return math.ceil(ImageFont.load_default(size).getlength(_printable(text)))


def _wrapped(text: str, size: int, room: int) -> list[str]:
    """The text on as many lines as it needs to be at most ``room`` pixels wide, broken at blanks."""
    lines: list[str] = []
    # Blanks that set facts apart stay as they are inside a line.
    for word in re.findall(r"\s*\S+", text):
        if lines and _length(lines[-1] + word, size) <= room:
            lines[-1] += word
        else:
            lines.append(word.lstrip())
    return lines


def _write_lines(canvas: _Canvas, at: tuple[int, int], texts: Iterable[str], room: int) -> None:
    """Write small text, each of ``texts`` on as many lines as it needs."""
    lines = [line for text in texts for line in _wrapped(text, _SMALL, room)]
    for i, line in enumerate(lines):
        _write(canvas, (at[0], at[1] + i * _SMALL_STEP), line, _SMALL, _FAINT, room)


def _write(
    canvas: _Canvas,
    at: tuple[int, int],
    text: str,
    size: int,
    colour: tuple[int, int, int],
    room: int | None = None,
    anchor: str = "la",
) -> int:
    """Write a line, shortened to ``room`` pixels; returns its width."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    text = _printable(text)
    if room is not None and font.getlength(text) > room:
        while text and font.getlength(text + "...") > room:
            text = text[:-1]
        text += "..."
    canvas.draw.text(at, text, font=font, fill=colour, anchor=anchor)
    return math.ceil(font.getlength(text))
