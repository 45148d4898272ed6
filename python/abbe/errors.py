"""What can go wrong, as Python sees it: one base class, each message with its place first and the remedy last."""

from __future__ import annotations

__all__ = ["AbbeError", "StageError", "UsageError", "UsdMissingError"]


class AbbeError(Exception):
    """Base class of every error that abbe raises by itself; a missing file is a ``FileNotFoundError``."""


class StageError(AbbeError):
    """A stage cannot be read or cannot be used; the message begins with the prim path or file."""


class NotUsdError(StageError):
    """The file is none that USD has a reader for."""


class UsageError(AbbeError, ValueError):
    """A request that contradicts itself or is not understood; the message begins with the option."""


class UsdMissingError(AbbeError, ImportError):
    """The USD libraries (``pxr``) cannot be imported."""
