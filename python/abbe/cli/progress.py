"""Progress on stderr: one line that is rewritten on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys

from .._api import Progress

__all__ = ["Reporter"]

# Elsewhere than on a terminal: lines for a log, at most one in this time (s), and none for what is over sooner.
_LINE_EVERY = 10.0


def _duration(seconds: float) -> str:
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
    return f"{whole // 60}:{whole % 60:02}"


class Reporter:
    """Tells how far the render called ``name`` is, until closed."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._is_terminal = sys.stderr.isatty()
        self._last_line = 0.0
        self._shown = False

    def __call__(self, progress: Progress) -> None:
        left = "" if progress.remaining is None else f", {_duration(progress.remaining)} left"
        text = f"{self._name}: {100 * progress.fraction:.0f} %{left}"
        if self._is_terminal:
            print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
            self._shown = True
        elif progress.seconds - self._last_line >= _LINE_EVERY:
            self._last_line = progress.seconds
            print(f"abbe: {text}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._shown = False
