"""What abbe finds on this machine: its own parts, and the libraries that it uses where they are."""

from __future__ import annotations

import importlib
import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from . import __version__, _core
from .schemas import SHADER, plugin_path, register_shader, schemas_are_known
from .validators import VALIDATORS, registered_validators

__all__ = ["Finding", "examine"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    what: str
    state: Literal["ok", "absent", "broken"]
    text: str
    """Version and place, or what to do."""


def _core_finding() -> Finding:
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:
        cores = os.cpu_count() or 1
    names = ", ".join(entry["name"] for entry in _core.integrators())
    return Finding("abbe", "ok", f"{__version__}, integrators {names}, {cores} cores, {_core.__file__}")


def _usd_finding() -> Finding:
    """Look at the ``pxr`` that is importable: usd-core, an application's or a studio's."""
    try:
        usd = importlib.import_module("pxr.Usd")
        ar = importlib.import_module("pxr.Ar")
    except ModuleNotFoundError as error:
        if error.name == "pxr":
            return Finding("USD", "absent", "needed to read stages: pip install 'abbe[usd]'")
        return Finding("USD", "broken", f"pxr is there but cannot be imported: {error}")
    except ImportError as error:
        return Finding("USD", "broken", f"pxr is there but cannot be imported: {error}")
    _, year, month = usd.GetVersion()
    resolver = type(ar.GetUnderlyingResolver()).__name__
    return Finding("USD", "ok", f"{year}.{month:02}, resolver {resolver}, {Path(str(usd.__file__)).parent}")


def _plugin_findings() -> list[Finding]:
    """Look at the plug-in: its files, and what of it USD knows."""
    folder = plugin_path()
    files = ("plugInfo.json", "generatedSchema.usda", f"{SHADER}.usda")
    missing = [name for name in files if not (folder / name).is_file()]
    if missing:
        return [Finding("schemas", "broken", f"{folder} lacks {', '.join(missing)}: install abbe again")]
    try:
        importlib.import_module("pxr.Usd")
    except ImportError:
        return [Finding("schemas", "ok", f"{folder}, no USD to register it with")]
    known = schemas_are_known()
    text = f"known to USD, {folder}" if known else f"not known to USD: set PXR_PLUGINPATH_NAME={folder}"
    return [
        Finding("schemas", "ok" if known else "broken", text),
        _shader_finding(),
        _validators_finding(),
    ]


def _shader_finding() -> Finding:
    reason = register_shader()
    if reason:
        return Finding(
            SHADER, "absent", f"not in USD's shader registry ({reason}); stages that use it render all the same"
        )
    return Finding(SHADER, "ok", "in USD's shader registry")


def _validators_finding() -> Finding:
    count = registered_validators()
    if count is None:
        reason = "this USD takes no validators from Python, 26.05 and later do"
        return Finding("validators", "absent", f"not in UsdValidation ({reason}); abbe validate runs them all the same")
    whole = count == len(VALIDATORS)
    return Finding("validators", "ok" if whole else "broken", f"{count} of {len(VALIDATORS)} in UsdValidation")


def _optional(what: str, module: str, extra: str, use: str, version: Callable[[Any], str]) -> Finding:
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError:
        return Finding(what, "absent", f"needed {use}: pip install 'abbe[{extra}]'")
    except ImportError as error:
        return Finding(what, "broken", f"{module} is there but cannot be imported: {error}")
    return Finding(what, "ok", f"{version(found)}, {Path(str(found.__file__)).parent}")


def examine() -> list[Finding]:
    """Look at everything that abbe uses.

    Returns
    -------
    list of Finding
        Each ``ok``, ``absent`` (optional, with the way to get it) or ``broken``.
    """
    return [
        _core_finding(),
        Finding("Python", "ok", f"{platform.python_version()}, {sys.executable}"),
        Finding("NumPy", "ok", f"{np.__version__}, {Path(np.__file__).parent}"),
        _usd_finding(),
        *_plugin_findings(),
        _optional("MaterialX", "MaterialX", "mtlx", "for .mtlx references", lambda mx: str(mx.getVersionString())),
        _optional("OpenImageIO", "OpenImageIO", "check", "for abbe check", lambda oiio: str(oiio.VERSION_STRING)),
        _optional("Pillow", "PIL", "preview", "for --preview", lambda pil: str(pil.__version__)),
        _optional(
            "matplotlib", "matplotlib", "plot", "for abbe bench --plot", lambda matplotlib: str(matplotlib.__version__)
        ),
    ]
