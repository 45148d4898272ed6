"""What a command says on stderr: errors, warnings, notes. Results go to stdout."""

from __future__ import annotations

import logging
import sys

__all__ = ["error", "note", "show_warnings"]


def _say(text: str) -> None:
    sys.stdout.flush()
    print(f"abbe: {text}", file=sys.stderr, flush=True)


def error(text: str) -> None:
    """Print an error on one line; the text begins with the place concerned."""
    _say(" ".join(text.split()))


def note(text: str) -> None:
    """Print something worth knowing."""
    _say(text)


class _Warnings(logging.Handler):
    """Prints each warning once, however many frames repeat it."""

    def __init__(self) -> None:
        super().__init__()
        self._told: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if text not in self._told:
            self._told.add(text)
            _say(f"warning: {' '.join(text.split())}")


def show_warnings(quiet: bool) -> None:
    """Print the warnings of the package from now on, or nothing of them."""
    logger = logging.getLogger("abbe")
    logger.propagate = False
    logger.handlers = [logging.NullHandler() if quiet else _Warnings()]
