"""An EXR in memory, read with OpenImageIO: channels by name in their own types, header, windows, layers."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import AbbeError

__all__ = ["ExrImage", "NotAnExrError", "UnreadableImageError", "read_exr"]

# Header attribute with the file's layers: a JSON array of {"name", "aov"}.
LAYERS = "abbe:layers"
# Layer above the exact sums that a part of a render carries.
PARTIAL = "abbe_partial."
# The four bytes that every EXR begins with ("Technical Introduction to OpenEXR", magic number).
_MAGIC = b"\x76\x2f\x31\x01"


class UnreadableImageError(AbbeError):
    """OpenImageIO cannot open or decode the file."""


class NotAnExrError(UnreadableImageError):
    """The file does not begin as an EXR does."""


@dataclass
class ExrImage:
    """The first part of an EXR file.

    Attributes
    ----------
    path : the file
    origin : x, y of the data window's first pixel in the full raster
    size : width, height of the data window
    raster : x, y, width, height of the display window
    channels : arrays of shape (height, width) by channel name, with the dtypes of the file
    attributes : header attributes by name, as OpenImageIO gives them
    parts : number of parts in the file
    tiled : whether the pixels are stored as tiles
    """

    path: Path
    origin: tuple[int, int]
    size: tuple[int, int]
    raster: tuple[int, int, int, int]
    channels: dict[str, np.ndarray]
    attributes: dict[str, Any]
    parts: int = 1
    tiled: bool = False
    _layers: list[tuple[str, str]] | None = field(default=None, repr=False)

    def text(self, name: str) -> str | None:
        """Return a header attribute if it is there and is text."""
        value = self.attributes.get(name)
        return value if isinstance(value, str) else None

    def is_ours(self) -> bool:
        """Tell whether the header has anything that abbe wrote."""
        return any(name.startswith("abbe:") for name in self.attributes)

    def layers(self) -> list[tuple[str, str]]:
        """Return (layer, AOV) pairs in the order they were asked for.

        Raises
        ------
        ValueError
            The header does not list them, or not as abbe does.
        """
        if self._layers is None:
            text = self.text(LAYERS)
            if text is None:
                raise ValueError(f"no attribute {LAYERS}")
            try:
                self._layers = [(str(entry["name"]), str(entry["aov"])) for entry in json.loads(text)]
            except (json.JSONDecodeError, KeyError, TypeError) as error:
                raise ValueError(f"attribute {LAYERS} is no list of layers: {error}") from None
        return self._layers

    def is_half(self, layer: str) -> bool:
        """Tell whether the header says that a layer is stored in half floats."""
        try:
            entries = json.loads(self.text(LAYERS) or "[]")
            return any(entry.get("name") == layer and entry.get("half") is True for entry in entries)
        except (json.JSONDecodeError, AttributeError, TypeError):
            return False

    def channel(self, layer: str, suffix: str) -> np.ndarray | None:
        """Return the channel ``layer.suffix``, or ``suffix`` for the empty layer name; None if there is none."""
        return self.channels.get(channel_name(layer, suffix))


def channel_name(layer: str, suffix: str) -> str:
    """Return the full name of a channel; a layer with an empty name has bare channels."""
    return f"{layer}.{suffix}" if layer else suffix


def read_exr(path: str | os.PathLike[str]) -> ExrImage:
    """Read the first part of an EXR file.

    Parameters
    ----------
    path : the file

    Raises
    ------
    FileNotFoundError
        There is no such file.
    AbbeError
        OpenImageIO is not installed, or the path is a folder.
    NotAnExrError
        The file is something else.
    UnreadableImageError
        OpenImageIO cannot open or decode the file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if path.is_dir():
        raise AbbeError(f"{path}: is a folder: name an EXR in it")
    try:
        import OpenImageIO as oiio
    except ImportError:
        raise AbbeError("OpenImageIO cannot be imported: pip install 'abbe[check]'") from None
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise NotAnExrError(f"{path}: is not an EXR that abbe wrote: it does not begin as an EXR does")
    opened = oiio.ImageInput.open(str(path))
    if opened is None:
        raise UnreadableImageError(f"{path}: OpenImageIO cannot open it: {_one_line(oiio.geterror())}")
    try:
        return _read(path, opened)
    finally:
        opened.close()


def _read(path: Path, opened: Any) -> ExrImage:
    spec = opened.spec()
    names = list(spec.channelnames)
    formats = [str(spec.channelformat(i)) for i in range(spec.nchannels)]
    channels: dict[str, np.ndarray] = {}
    # One read per type, each over the channels from the first to the last of that type: a read decodes every block of
    # the file, and a common float type would cost ids their digits.
    for kind in sorted(set(formats)):
        wanted = [i for i, found in enumerate(formats) if found == kind]
        begin, end = wanted[0], wanted[-1] + 1
        pixels = opened.read_image(0, 0, begin, end, kind)
        if pixels is None:
            raise UnreadableImageError(f"{path}: OpenImageIO cannot decode it: {_one_line(opened.geterror())}")
        pixels = np.asarray(pixels).reshape(spec.height, spec.width, end - begin)
        # Planes of their own: whoever looks at one channel should not stride over all others. Row by row, so that the
        # transposition stays in the cache.
        planes = np.empty((len(wanted), spec.height, spec.width), pixels.dtype)
        columns = [i - begin for i in wanted]
        for row in range(spec.height):
            planes[:, row] = pixels[row].T[columns]
        channels.update((names[i], plane) for i, plane in zip(wanted, planes, strict=True))
    channels = {name: channels[name] for name in names}
    attributes = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    return ExrImage(
        path=path,
        origin=(spec.x, spec.y),
        size=(spec.width, spec.height),
        raster=(spec.full_x, spec.full_y, spec.full_width, spec.full_height),
        channels=channels,
        attributes=attributes,
        parts=int(attributes.get("oiio:subimages", 1)),
        tiled=spec.tile_width > 0,
    )


def _one_line(text: str) -> str:
    return " ".join(text.split()) or "no reason given"
