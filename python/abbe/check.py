"""Checks of a written EXR: that other software opens it, that it says what it is, and that its numbers can be true.

The file is opened with OpenImageIO, a library that shares no code with the renderer. Every failure names the file, the
channel and the first pixel concerned (full-raster pixels, x right, y down), and how many there are.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ._image import PARTIAL, ExrImage, NotAnExrError, UnreadableImageError, channel_name, read_exr
from .manifest import Manifest

__all__ = ["CheckReport", "Difference", "Failure", "LayerSummary", "check"]

# A row of the AOV table as `abbe._core.aovs()` gives it: name, channels, sample, unit, merge, has_validity.
AovRow = Mapping[str, Any]

# The chain ends after so many events (DESIGN: "64 events, then absent").
_MOST_EVENTS = 64

# Three float32 components of a unit vector, each rounded to half a unit in the last place, move its length by less
# than 2**-24 * sqrt(3); a length below 1 by rounding of a mean adds no more. Four times that is no unit vector.
_UNIT_TOLERANCE = 4 * math.sqrt(3) * 2.0**-24
# The same for halves.
_HALF_UNIT_TOLERANCE = 4 * math.sqrt(3) * 2.0**-11

# Required header attributes and the types they may have.
_NUMBER = (int, float)
_REQUIRED: tuple[tuple[str, tuple[type, ...]], ...] = (
    ("abbe:version", (str,)),
    ("abbe:stage", (str,)),
    ("abbe:integrator", (str,)),
    ("abbe:referenceWavelength", _NUMBER),
    ("abbe:referenceWavelengthText", (str,)),
    ("abbe:band", (str,)),
    ("abbe:channelWavelengths", (str,)),
    ("abbe:axes", (str,)),
    ("abbe:sign", (str,)),
    ("abbe:metersPerUnit", (*_NUMBER, str)),
    ("abbe:upAxis", (str,)),
    ("abbe:samples", (*_NUMBER, str)),
    ("abbe:seed", (*_NUMBER, str)),
    ("abbe:settingsHash", (str,)),
    ("abbe:sampleRange", (str,)),
)

_MANIFESTS = {
    "prim_id": "abbe:primManifest",
    "instance_id": "abbe:instanceManifest",
    "material_id": "abbe:materialManifest",
}

# AOVs whose values have a sign: name -> (least value, whether it may be reached).
_LEAST: Mapping[str, tuple[float, bool]] = {
    "ior": (0.0, False),
    "dispersion_footprint": (0.0, True),
    "footprint_half_width": (0.0, True),
    "depth": (0.0, True),
    "sample_count": (1.0, True),
    "variance": (0.0, True),
}

# The channel of a spectral bin, beside other layers and in a file of its own.
_BIN = re.compile(r"w\d+(p\d+)?|\d+,\d+nm")

_UNIT_VECTORS = frozenset({"normal", "normal_geometric", "refracted_normal", "refracted_normal_geometric"})


@dataclass(frozen=True)
class Failure:
    """One thing that is wrong.

    Attributes
    ----------
    message : what is wrong
    channel : the channel concerned, or ``None`` for the header or the file
    pixel : first pixel concerned in full-raster coordinates, or ``None``
    count : how many pixels are concerned
    concerns : what the failure is about where there is no channel: ``header``, or ``file`` for all of it
    """

    message: str
    channel: str | None = None
    pixel: tuple[int, int] | None = None
    count: int = 0
    concerns: str = "header"

    def __str__(self) -> str:
        if self.concerns == "file":
            return self.message
        place = f"channel {self.channel}" if self.channel else self.concerns
        if self.pixel is not None:
            place += f", pixel {self.pixel[0]},{self.pixel[1]}"
        more = f" ({self.count} pixels)" if self.count > 1 else ""
        return f"{place}: {self.message}{more}"


@dataclass(frozen=True)
class LayerSummary:
    """What a layer holds.

    Attributes
    ----------
    name : EXR layer
    aov : its AOV
    channels : channel suffixes
    sample : ``float`` or ``uint``
    unit : unit of the values
    minimum, maximum : over all channels, where valid; ``None`` where nothing is
    valid : mean of the validity channel, 1 where there is none
    """

    name: str
    aov: str
    channels: tuple[str, ...]
    sample: str
    unit: str
    minimum: float | None
    maximum: float | None
    valid: float


@dataclass(frozen=True)
class Difference:
    """How a layer differs from the reference's.

    Attributes
    ----------
    layer : EXR layer; exact sums of a part are ``abbe_partial.<layer>``
    maximum, rms, mean : of the absolute difference over all channels and pixels; NaN where a value is not a number
    differing : pixels of which a channel differs by more than the tolerance
    pixels : pixels compared
    worst : pixel with the largest difference, in full-raster coordinates; ``None`` if none differs
    passed : whether no pixel differs by more than the tolerance
    """

    layer: str
    maximum: float
    rms: float
    mean: float
    differing: int
    pixels: int
    worst: tuple[int, int] | None
    passed: bool


@dataclass
class CheckReport:
    """Result of :func:`check`.

    ``str(report)`` is the text for people, :meth:`to_dict` what JSON takes.

    Attributes
    ----------
    path : the file
    against : the reference, if there was one
    failures : everything that is wrong; empty if the file is sound
    layers : what the layers hold
    differences : per layer, with a reference
    width, height : the display window
    window : x0, y0, x1, y1 of the data window, half-open
    compression : its OpenEXR name
    """

    path: Path
    against: Path | None = None
    failures: list[Failure] = field(default_factory=list)
    layers: list[LayerSummary] = field(default_factory=list)
    differences: list[Difference] = field(default_factory=list)
    width: int = 0
    height: int = 0
    window: tuple[int, int, int, int] = (0, 0, 0, 0)
    compression: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong and nothing differs."""
        return not self.failures and all(difference.passed for difference in self.differences)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON takes it; numbers that are not finite become text."""
        plain = asdict(self) | {"passed": self.passed, "path": str(self.path)}
        plain["against"] = None if self.against is None else str(self.against)
        return _json(plain)  # type: ignore[no-any-return]

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        verdict = "ok" if self.passed else "FAILED"
        if not self.layers and not self.differences and any(f.concerns == "file" for f in self.failures):
            # A fault of the whole file says it all.
            yield from (f"{self.path}: {failure}" for failure in self.failures)
            return
        if not self.layers and not self.width:
            yield f"{self.path}: {verdict}"
        else:
            x0, y0, x1, y1 = self.window
            yield (
                f"{self.path}: {verdict}, {self.width} x {self.height}, data window {x0},{y0} to {x1},{y1}, "
                f"{len(self.layers)} layers, {self.compression}"
            )
        if self.layers:
            rows = [("layer", "channels", "type", "unit", "valid", "least", "greatest")]
            for s in self.layers:
                label = s.name or "(bare)"
                label = label if s.name == s.aov else f"{label} = {s.aov}"
                extremes = (_short(s.minimum), _short(s.maximum))
                rows.append((label, " ".join(s.channels), s.sample, s.unit, f"{100 * s.valid:.4g} %", *extremes))
            yield from _table(rows)
        if self.against is not None and self.differences:
            yield f"against {self.against}:"
            rows = [("layer", "max abs", "rms", "mean", "pixels differing", "worst at", "")]
            for d in self.differences:
                at = "" if d.worst is None else f"{d.worst[0]},{d.worst[1]}"
                counted = f"{d.differing} of {d.pixels}"
                outcome = "ok" if d.passed else "DIFFERS"
                rows.append(
                    (d.layer or "(bare)", _short(d.maximum), _short(d.rms), _short(d.mean), counted, at, outcome)
                )
            yield from _table(rows)
        for failure in self.failures:
            yield f"{self.path}: {failure}"


def check(
    path: str | os.PathLike[str],
    *,
    against: str | os.PathLike[str] | None = None,
    tolerance: float = 0.0,
    relative_tolerance: float = 0.0,
    aovs: Iterable[AovRow] | None = None,
) -> CheckReport:
    """Check an EXR that abbe wrote, and compare it with another.

    Parameters
    ----------
    path : the file
    against : reference file to compare with, layer by layer
    tolerance : greatest absolute difference that passes; 0 with ``relative_tolerance`` 0: the same bits
    relative_tolerance : added to it, times the reference's absolute value
    aovs : the AOV table; the renderer's own if None

    Returns
    -------
    CheckReport
        ``report.passed`` tells whether all is well.

    Raises
    ------
    FileNotFoundError
        One of the files does not exist.
    AbbeError
        OpenImageIO is not installed, one of the files is no EXR, or the reference cannot be opened.
    """
    report = CheckReport(path=Path(path), against=None if against is None else Path(against))
    for limit in (tolerance, relative_tolerance):
        if not (math.isfinite(limit) and limit >= 0):
            raise ValueError(f"tolerance {limit}: must be finite and not negative")
    table = {str(row["name"]): row for row in (_core_aovs() if aovs is None else aovs)}
    reference = None if against is None else read_exr(against)
    try:
        image = read_exr(path)
    except NotAnExrError:
        raise
    except UnreadableImageError as error:
        report.failures.append(Failure(str(error).removeprefix(f"{path}: "), concerns="file"))
        return report
    report.width, report.height = image.raster[2:]
    (x, y), (width, height) = image.origin, image.size
    report.window = (x, y, x + width, y + height)
    report.compression = image.text("compression") or "unknown compression"
    if image.is_ours():
        _Checker(image, table, report).run()
    else:
        # One fault, not all that follow from it.
        software = image.text("Software")
        writer = f"by {software}" if software else "by other software"
        text = f"is not an EXR that abbe wrote: it is {writer}, and its header has no attributes abbe:…"
        report.failures.append(Failure(text, concerns="file"))
    if reference is not None:
        _compare(image, reference, tolerance, relative_tolerance, report)
    return report


def _core_aovs() -> Iterable[AovRow]:
    from abbe import _core

    rows: Iterable[AovRow] = _core.aovs()
    return rows


class _Checker:
    """The checks of one file; each appends to the report's failures."""

    def __init__(self, image: ExrImage, table: Mapping[str, AovRow], report: CheckReport) -> None:
        self.image = image
        self.table = table
        self.report = report
        self.samples: int | None = None

    def fail(self, message: str, channel: str | None = None, where: np.ndarray | None = None) -> None:
        """Record a failure; ``where`` is a mask of the pixels concerned."""
        if where is None:
            self.report.failures.append(Failure(message, channel))
            return
        row, column = np.unravel_index(int(np.argmax(where)), where.shape)
        pixel = (int(column) + self.image.origin[0], int(row) + self.image.origin[1])
        self.report.failures.append(Failure(message, channel, pixel, int(np.count_nonzero(where))))

    def fail_where(self, where: np.ndarray, message: str, channel: str, values: np.ndarray | None = None) -> None:
        """Record a failure if any pixel of the mask is set, quoting the first value."""
        if where.any():
            if values is not None:
                message = f"{message}, but is {values[where].flat[0]:.9g}"
            self.fail(message, channel, where)

    def run(self) -> None:
        self.frame()
        self.header()
        self.finite()
        self.channels_of_layers()
        self.partial_sums()

    def frame(self) -> None:
        """Windows, parts, storage."""
        image = self.image
        (x, y), (width, height) = image.origin, image.size
        full_x, full_y, full_width, full_height = image.raster
        if image.parts != 1:
            self.fail(f"has {image.parts} parts; abbe writes one")
        if image.tiled:
            self.fail("is tiled; abbe writes scan lines")
        if (full_x, full_y) != (0, 0) or full_width < 1 or full_height < 1:
            self.fail(f"the display window {full_x},{full_y} {full_width} x {full_height} does not begin at 0,0")
        if width < 1 or height < 1:
            self.fail("the data window is empty")
        if x >= full_x + full_width or y >= full_y + full_height or x + width <= full_x or y + height <= full_y:
            self.fail("the data window lies outside the display window")
        aspect = image.attributes.get("PixelAspectRatio", 1.0)
        if not (isinstance(aspect, _NUMBER) and math.isfinite(aspect) and aspect > 0):
            self.fail(f"pixelAspectRatio is {aspect}, must be positive")

    def header(self) -> None:
        """Attributes that a reader of the file needs."""
        attributes = self.image.attributes
        for name, types in _REQUIRED:
            if name not in attributes:
                self.fail(f"no attribute {name}")
            elif not isinstance(attributes[name], types):
                self.fail(f"attribute {name} is {attributes[name]!r}, not {' or '.join(t.__name__ for t in types)}")
        wavelength = attributes.get("abbe:referenceWavelength")
        if isinstance(wavelength, _NUMBER) and not 360 <= wavelength <= 830:
            self.fail(f"attribute abbe:referenceWavelength is {wavelength} nm, outside 360 to 830 nm")
        text = self.image.text("abbe:referenceWavelengthText")
        if text is not None and isinstance(wavelength, _NUMBER) and _leading_number(text) != float(wavelength):
            self.fail(f"attribute abbe:referenceWavelengthText `{text}` is not abbe:referenceWavelength {wavelength}")
        band = self.image.text("abbe:band")
        if band is not None and self.band() is None:
            self.fail(f"attribute abbe:band is `{band}`, not `low:high nm` with low < high")
        scale = attributes.get("abbe:metersPerUnit")
        if scale is not None and not ((number := _number(scale)) is not None and number > 0):
            self.fail(f"attribute abbe:metersPerUnit is {scale!r}, must be a positive number")
        if (axis := self.image.text("abbe:upAxis")) is not None and axis not in ("Y", "Z"):
            self.fail(f"attribute abbe:upAxis is `{axis}`, must be Y or Z")
        text = self.image.text("abbe:sampleRange")
        if text is not None:
            parts = [int(part) for part in text.split(":") if part.isdecimal()]
            if len(parts) == 3 and text.count(":") == 2 and parts[0] < parts[1] <= parts[2]:
                self.samples = parts[1] - parts[0]
            else:
                self.fail(f"attribute abbe:sampleRange is `{text}`, not `begin:end:total`")
        if (materials := self.image.text("abbe:materials")) is not None:
            try:
                json.loads(materials)
            except json.JSONDecodeError as error:
                self.fail(f"attribute abbe:materials is no JSON: {error}")
        for name, value in attributes.items():
            numbers = value if isinstance(value, tuple) else (value,)
            if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
                self.fail(f"attribute {name} has a value that is not finite")

    def band(self) -> tuple[float, float] | None:
        """The band of the footprint in nm."""
        numbers = (self.image.text("abbe:band") or "").removesuffix("nm").split(":")
        if len(numbers) != 2:
            return None
        low, high = (_number(number) for number in numbers)
        return None if low is None or high is None or not low < high else (low, high)

    def finite(self) -> None:
        """No NaN and no infinity anywhere."""
        for name, values in self.image.channels.items():
            if values.dtype.kind == "f":
                self.fail_where(np.isnan(values), "is NaN", name)
                self.fail_where(np.isinf(values), "is infinite", name)

    def channels_of_layers(self) -> None:
        """Each layer has the channels of its AOV, with values that can be."""
        known: set[str] = set()
        try:
            layers = self.image.layers()
        except ValueError as error:
            self.fail(str(error))
            names = {name.rpartition(".")[0] for name in self.image.channels}
            layers = [(name, name) for name in self.table if name in names]
        for name, aov in layers:
            row = self.table.get(aov)
            if row is None:
                self.fail(f"layer `{name}` has the unknown AOV `{aov}`")
                known.update(channel for channel in self.image.channels if channel.rpartition(".")[0] == name)
                continue
            known.update(self.layer(name, row))
        if all(channel != "Z" for channel in known) and "Z" in self.image.channels:
            known.add("Z")
            depth = next((self.image.channel(name, "Z") for name, aov in layers if aov == "depth"), None)
            bare = self.image.channels["Z"]
            if depth is None:
                self.fail("there is no depth layer that it could repeat", "Z")
            else:
                self.fail_where(depth != bare, "differs from the depth layer", "Z")
        for channel in self.image.channels:
            if channel not in known and not channel.startswith(PARTIAL):
                self.fail("belongs to no layer of the header", channel)
        self.relations(dict((aov, name) for name, aov in reversed(layers)))

    def layer(self, name: str, row: AovRow) -> list[str]:
        """Check one layer; returns the channels it has a claim to."""
        suffixes = [str(suffix) for suffix in row["channels"]]
        if row["name"] == "spectral":
            # A channel per bin, as many as there are.
            found = [
                channel.removeprefix(f"{name}.") for channel in self.image.channels if channel.startswith(f"{name}.")
            ]
            suffixes = [suffix for suffix in found if _BIN.fullmatch(suffix)] or suffixes
        is_half = self.image.is_half(name) and row["sample"] != "uint"
        wanted = np.uint32 if row["sample"] == "uint" else np.float16 if is_half else np.float32
        names = [channel_name(name, suffix) for suffix in suffixes]
        valid: np.ndarray | None = None
        if row["has_validity"]:
            names.append(channel_name(name, "valid"))
            valid = self.image.channels.get(names[-1])
        complete = True
        for channel in names:
            values = self.image.channels.get(channel)
            expected = np.float32 if channel.endswith("valid") and channel == names[-1] else wanted
            if values is None:
                self.fail(f"is missing; layer `{name}` ({row['name']}) has {', '.join(suffixes)}", channel)
                complete = False
            elif values.dtype != expected:
                self.fail(f"is stored as {values.dtype}, must be {np.dtype(expected)}", channel)
                complete = False
        unit = self.image.text(f"abbe:unit:{name or row['name']}")
        if unit != row["unit"]:
            self.fail(
                f"attribute abbe:unit:{name or row['name']} is {unit!r}, the unit of {row['name']} is {row['unit']!r}"
            )
        if not complete:
            return names
        values = np.stack([self.image.channels[channel] for channel in names[: len(suffixes)]], axis=-1)
        if is_half:
            values = values.astype(np.float32)
        if valid is not None:
            outside = ~((valid >= 0) & (valid <= 1))
            self.fail_where(outside & np.isfinite(valid), "must be in 0..1", names[-1], valid)
            for i, channel in enumerate(names[:-1]):
                present = (valid == 0) & (values[:, :, i] != 0)
                self.fail_where(present, "must be 0 where valid is 0", channel, values[:, :, i])
        some = np.ones(values.shape[:2], bool) if valid is None else valid > 0
        self.ranges(names, str(row["name"]), values, some, valid, _HALF_UNIT_TOLERANCE if is_half else _UNIT_TOLERANCE)
        inside = values[some]
        inside = inside[np.isfinite(inside)] if inside.dtype.kind == "f" else inside
        self.report.layers.append(
            LayerSummary(
                name=name,
                aov=str(row["name"]),
                channels=tuple(suffixes),
                sample=str(row["sample"]),
                unit=str(row["unit"]),
                minimum=float(inside.min()) if inside.size else None,
                maximum=float(inside.max()) if inside.size else None,
                valid=1.0 if valid is None else float(np.mean(valid, dtype=np.float64)),
            )
        )
        return names

    def ranges(
        self,
        names: Sequence[str],
        aov: str,
        values: np.ndarray,
        some: np.ndarray,
        valid: np.ndarray | None,
        tolerance: float,
    ) -> None:
        """Values that the AOV cannot have."""
        first = values[:, :, 0]
        if aov in _LEAST:
            least, reached = _LEAST[aov]
            low = (first < least) if reached else (first <= least)
            word = "not be below" if reached else "be above"
            self.fail_where(low & some & np.isfinite(first), f"must {word} {least:g}", names[0], first)
        if aov == "footprint_half_width" and (band := self.band()) is not None:
            half = np.float32(0.5 * (band[1] - band[0]))
            self.fail_where(
                (first > half) & np.isfinite(first), f"must not exceed half the band, {half:g} nm", names[0], first
            )
        if aov in _UNIT_VECTORS:
            length = np.sqrt(np.sum(np.square(values, dtype=np.float64), axis=-1))
            length = np.where(np.isfinite(length), length, 1.0)
            where = "the mean of unit vectors cannot be longer than 1"
            self.fail_where(some & (length > 1 + tolerance), where, names[0], length)
            if self.samples == 1 and valid is not None:
                off = (valid == 1) & (np.abs(length - 1) > tolerance)
                self.fail_where(
                    off & (length < 1), "the vector of a single sample must have length 1", names[0], length
                )
        if aov == "color":
            alpha = values[:, :, 3]
            outside = np.isfinite(alpha) & ~((alpha >= 0) & (alpha <= 1 + tolerance))
            self.fail_where(outside, "must be in 0..1", names[3], alpha)
        if aov == "sample_count" and self.samples is not None:
            self.fail_where(first > self.samples, f"must not exceed the {self.samples} samples", names[0], first)
        if aov in ("interfaces", "rough_interfaces", "total_reflections"):
            message = f"a chain has at most {_MOST_EVENTS} events"
            self.fail_where(first > _MOST_EVENTS, message, names[0], first)
        base = aov.removeprefix("refracted_")
        if base in _MANIFESTS:
            attribute = _MANIFESTS[base]
            text = self.image.text(attribute)
            try:
                paths = None if text is None else Manifest(text)
            except ValueError:
                paths = None
            if paths is None:
                self.fail(f"attribute {attribute}, which the ids of {aov} point into, is no manifest of paths")
            else:
                message = f"must not exceed the {len(paths)} paths of {attribute}"
                self.fail_where(first > len(paths), message, names[0], first)

    def relations(self, layer_of: Mapping[str, str]) -> None:
        """Counts that contain others."""
        whole = self.image.channel(layer_of["interfaces"], "I") if "interfaces" in layer_of else None
        for aov in ("rough_interfaces", "total_reflections"):
            part = self.image.channel(layer_of[aov], "I") if aov in layer_of else None
            if whole is not None and part is not None:
                channel = channel_name(layer_of[aov], "I")
                self.fail_where(part > whole, "must not exceed the number of interfaces", channel, part)

    def partial_sums(self) -> None:
        """The exact sums of a part can be computed with."""
        for name, values in self.image.channels.items():
            if not name.startswith(PARTIAL):
                continue
            if values.dtype != np.uint32:
                self.fail(f"is stored as {values.dtype}, must be uint32", name)
            elif name.endswith("_hi"):
                # Exponent bits all set: not a number.
                self.fail_where(values >> 20 & 0x7FF == 0x7FF, "the sum is not finite", name)
            elif name.endswith(".count") and self.samples is not None:
                self.fail_where(values > self.samples, f"must not exceed the {self.samples} samples", name, values)


def _compare(image: ExrImage, reference: ExrImage, tolerance: float, relative: float, report: CheckReport) -> None:
    """Compare all layers of two files."""
    windows = [(*i.origin, *i.size, *i.raster[2:]) for i in (image, reference)]
    if windows[0] != windows[1]:
        shown = [f"{x},{y} {w} x {h} of {fw} x {fh}" for x, y, w, h, fw, fh in windows]
        report.failures.append(Failure(f"the data window is {shown[0]}, that of {reference.path} is {shown[1]}"))
        return
    ours, theirs = _grouped(image), _grouped(reference)
    for name in sorted(ours.keys() | theirs.keys()):
        missing = [i.path for i, groups in ((image, ours), (reference, theirs)) if name not in groups]
        title = f"layer `{name}`" if name else "the bare channels"
        if missing:
            report.failures.append(Failure(f"{title}: not in {missing[0]}"))
        elif set(ours[name]) != set(theirs[name]):
            lists = [", ".join(sorted(groups[name])) for groups in (ours, theirs)]
            report.failures.append(Failure(f"{title}: has {lists[0]}, in {reference.path} it has {lists[1]}"))
    for name in sorted(ours.keys() & theirs.keys()):
        suffixes = sorted(ours[name].keys() & theirs[name].keys())
        for suffix in suffixes:
            a, b = ours[name][suffix].dtype, theirs[name][suffix].dtype
            if a != b:
                report.failures.append(Failure(f"is {a}, in {reference.path} it is {b}", channel_name(name, suffix)))
        if suffixes:
            pairs = [(ours[name][suffix], theirs[name][suffix]) for suffix in suffixes]
            report.differences.append(_difference(name, pairs, tolerance, relative, image.origin))


def _difference(
    name: str,
    pairs: Sequence[tuple[np.ndarray, np.ndarray]],
    tolerance: float,
    relative: float,
    origin: tuple[int, int],
) -> Difference:
    """Statistics of the absolute difference of a layer.

    NumPy rather than ``ImageBufAlgo.compare``: that works in float32, which holds neither large ids nor f64 sums.
    """
    height, width = pairs[0][0].shape
    worst = np.zeros((height, width))
    differing = np.zeros((height, width), bool)
    total = squares = 0.0
    for a, b in pairs:
        exact = a.dtype == b.dtype and tolerance == 0 and relative == 0
        wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
        with np.errstate(invalid="ignore"):
            distance = np.abs(wide_a - wide_b)
            # The same infinity or NaN on both sides is no difference.
            distance[_bits(a) == _bits(b) if a.dtype == b.dtype else wide_a == wide_b] = 0.0
            # Written so that a distance that is not a number fails.
            differing |= (_bits(a) != _bits(b)) if exact else ~(distance <= tolerance + relative * np.abs(wide_b))
        worst = np.fmax(worst, np.where(np.isnan(distance), np.inf, distance))
        total += float(np.sum(distance))
        squares += float(np.sum(np.square(distance)))
    n = height * width * len(pairs)
    count = int(np.count_nonzero(differing))
    # Where bits differ and values do not (0 and -0), any differing pixel is the worst one.
    peak = np.where(differing, worst, -1.0) if count else worst
    row, column = np.unravel_index(int(np.argmax(peak)), peak.shape)
    at = (int(column) + origin[0], int(row) + origin[1]) if count else None
    return Difference(
        layer=name,
        maximum=float(worst.max()),
        rms=math.sqrt(squares / n) if math.isfinite(squares) else math.nan,
        mean=total / n,
        differing=count,
        pixels=height * width,
        worst=at,
        passed=count == 0,
    )


def _bits(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")


def _grouped(image: ExrImage) -> dict[str, dict[str, np.ndarray]]:
    """Channels by layer; the halves of exact sums are put together."""
    groups: dict[str, dict[str, np.ndarray]] = {}
    for channel, values in image.channels.items():
        layer, _, suffix = channel.rpartition(".")
        if layer.startswith(PARTIAL) and suffix.endswith("_lo") and f"{channel[:-3]}_hi" in image.channels:
            continue
        if layer.startswith(PARTIAL) and suffix.endswith("_hi") and f"{channel[:-3]}_lo" in image.channels:
            low = image.channels[f"{channel[:-3]}_lo"]
            values = (values.astype(np.uint64) << np.uint64(32) | low).view(np.float64)
            suffix = suffix[:-3]
        groups.setdefault(layer, {})[suffix] = values
    return groups


def _number(value: Any) -> float | None:
    """A finite number, also from text."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None


def _leading_number(text: str) -> float | None:
    return _number(text.split()[0]) if text.split() else None


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        yield ("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))).rstrip()


def _json(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
