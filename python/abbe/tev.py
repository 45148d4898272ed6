"""A render in the viewer tev (https://github.com/Tom94/tev) while it grows: pixels go to its port, no file is written.

The protocol is tev's own (its ``src/Ipc.cpp``): packets of a length that counts itself (uint32), a kind (uint8)
and fields, all little-endian, texts ended by a zero byte. No package is needed for it.
"""

from __future__ import annotations

import socket
import struct
from typing import Any

import numpy as np

from ._core import Film
from .errors import AbbeError, UsageError

__all__ = ["DEFAULT", "Viewer"]

DEFAULT = "127.0.0.1:14158"
"""Where tev listens unless told otherwise."""

_UPDATE_IMAGE, _CREATE_IMAGE = 6, 4
# Long enough for a viewer that is busy with an image, short enough not to hold a render.
_TIMEOUT = 5.0
# A packet's length is 32 bits: large images go in bands of rows.
_MOST_BYTES = 64 << 20


class Viewer:
    """A connection to tev that shows the layers of films as one image."""

    def __init__(self, address: str = DEFAULT, name: str = "abbe") -> None:
        """Connect.

        Parameters
        ----------
        address : HOST:PORT
        name : what the image is called in tev; an image of that name is replaced

        Raises
        ------
        UsageError
            The address is not of that form.
        AbbeError
            Nobody listens there.
        """
        host, colon, port = address.rpartition(":")
        if not colon or not port.isdecimal() or not 0 < int(port) < 65536:
            raise UsageError(f"--tev {address}: is not of the form HOST:PORT, such as {DEFAULT}")
        self._address, self._name = address, name
        self._shape: tuple[int, int, tuple[str, ...]] | None = None
        try:
            self._socket = socket.create_connection((host.strip("[]"), int(port)), timeout=_TIMEOUT)
        except OSError as error:
            raise AbbeError(f"--tev {address}: tev does not answer ({error}): start it first") from None

    def show(self, film: Film) -> None:
        """Show a film in place of the one before.

        Parameters
        ----------
        film : of any layers; those of integers are shown as floats

        Raises
        ------
        AbbeError
            The connection has broken.
        """
        x0, y0, _, _ = film.window
        width, height = film.resolution
        layers = []
        for key in film:
            prefix = "" if key == "color" else f"{key}."
            layers.append(([f"{prefix}{channel}" for channel in film.channels(key)], film[key]))
        names = tuple(name for channels, _ in layers for name in channels)
        try:
            if self._shape != (width, height, names):
                self._send(_CREATE_IMAGE, struct.pack("<iii", width, height, len(names)), *map(_text, names))
                self._shape = (width, height, names)
            for channels, values in layers:
                self._update(channels, np.asarray(values, "<f4"), x0, y0)
        except OSError as error:
            raise AbbeError(f"--tev {self._address}: the connection has broken ({error})") from None

    def _update(self, channels: list[str], values: np.ndarray[Any, Any], x0: int, y0: int) -> None:
        height, width, count = values.shape
        # What lies outside of the display window tev has no place for.
        assert self._shape is not None
        left, right = max(0, -x0), min(width, self._shape[0] - x0)
        top, bottom = max(0, -y0), min(height, self._shape[1] - y0)
        if left >= right:
            return
        rows = max(1, _MOST_BYTES // (4 * count * (right - left)))
        for begin in range(top, bottom, rows):
            part = np.ascontiguousarray(values[begin : min(begin + rows, bottom), left:right])
            place = struct.pack("<iiii", x0 + left, y0 + begin, right - left, part.shape[0])
            # Pixels are interleaved: channel i begins at i and goes on in steps of their number.
            offsets = struct.pack(f"<{count}q", *range(count)) + struct.pack(f"<{count}q", *[count] * count)
            head = struct.pack("<i", count) + b"".join(map(_text, channels))
            self._send(_UPDATE_IMAGE, head, place, offsets, part.tobytes())

    def _send(self, kind: int, *fields: bytes) -> None:
        # No focus is taken from what the user looks at.
        body = struct.pack("<B?", kind, False) + _text(self._name) + b"".join(fields)
        self._socket.sendall(struct.pack("<I", len(body) + 4) + body)

    def close(self) -> None:
        """End the connection; the image stays."""
        self._socket.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _text(text: str) -> bytes:
    return text.encode() + b"\0"
