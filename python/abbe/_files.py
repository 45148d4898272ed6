"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["replacing"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary file beside ``path`` to write to; it takes the place of ``path`` if nothing goes wrong.

    A symbolic link is followed. The file has the rights that the user's umask gives. Devices and pipes cannot be
    replaced and are written to directly.

    Parameters
    ----------
    path : the file to write

    Raises
    ------
    FileNotFoundError
        The folder of ``path`` does not exist.
    OSError
        It cannot be written to.
    """
    named = Path(path)
    if named.exists() and not named.is_file() and not named.is_dir():
        yield named
        return
    target = named.resolve()
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {named.parent} does not exist: create it, or choose another place")
    # Not `tempfile`: its files are private, and asking for the umask means setting it, for all threads.
    temporary = target.parent / f".abbe-{secrets.token_hex(8)}.tmp"
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield temporary
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
