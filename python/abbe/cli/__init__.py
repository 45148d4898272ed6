"""The command ``abbe``: one file per command, errors on one line, exit codes that scripts can trust.

| code | meaning |
|---|---|
| 0 | the whole output was written |
| 1 | failed |
| 2 | the command line is not understood, or contradicts the stage |
| 3 | a part of the output was written |
| 4 | ``abbe check`` or ``abbe validate`` found a fault |
| 130, 143 | interrupted by Ctrl-C or SIGTERM |
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

from .. import __version__
from ..errors import AbbeError, UsageError
from . import (
    aovs,
    bench,
    check,
    doctor,
    export,
    glass,
    lens,
    lights,
    list_cameras,
    merge,
    messages,
    plan,
    plugin_path,
    render,
    settings,
    trace,
    validate,
)

__all__ = ["main"]

FAILED, USAGE, INTERRUPTED, TERMINATED = 1, 2, 130, 143

_COMMANDS = (
    render,
    plan,
    export,
    lens,
    aovs,
    glass,
    list_cameras,
    lights,
    settings,
    trace,
    check,
    validate,
    merge,
    bench,
    doctor,
    plugin_path,
)


class _Parser(argparse.ArgumentParser):
    """Errors are one line in the form of all others."""

    def error(self, message: str) -> NoReturn:
        place, _, problem = message.removeprefix("argument ").partition(": ")
        text = f"{place}: {problem}" if problem else message
        messages.error(f"{text}; {self.prog} --help tells more")
        raise SystemExit(USAGE)


class _Terminated(BaseException):
    """SIGTERM arrived: as Ctrl-C, but with an exit code of its own."""


def _terminate(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise _Terminated


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="abbe",
        description="Renders USD stages with dispersive glass and tells how everything seen moves with wavelength.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"abbe {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in _COMMANDS:
        command.add(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : arguments without the program's name; those of the process if None

    Returns
    -------
    int
        The exit code.
    """
    signal.signal(signal.SIGTERM, _terminate)
    try:
        try:
            args = _parser().parse_args(argv)
            code: int = args.run(args)
            sys.stdout.flush()
            return code
        except SystemExit as exit_:
            return exit_.code if isinstance(exit_.code, int) else FAILED
        except UsageError as error:
            messages.error(str(error))
            return USAGE
        except BrokenPipeError:
            # Whoever read our output has closed it (`abbe aovs | head`); nothing is left to say, not even at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return FAILED
        except (AbbeError, OSError) as error:
            messages.error(str(error))
            return FAILED
        except MemoryError:
            messages.error("memory: there is not enough for this: render fewer pixels or AOVs at once (--crop, --aov)")
            return FAILED
    except KeyboardInterrupt:
        messages.error("interrupted")
        return INTERRUPTED
    except _Terminated:
        messages.error("terminated")
        return TERMINATED
