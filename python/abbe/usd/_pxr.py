"""The USD modules, imported when a stage is first read; whichever ``pxr`` is importable is used as it is."""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import UsdMissingError

__all__ = ["Ar", "Gf", "Pcp", "Sdf", "Tf", "Usd", "UsdGeom", "UsdLux", "UsdRender", "UsdShade", "UsdUtils", "Vt"]


def _module(name: str) -> Any:
    """Import ``pxr.<name>``; USD ships no type stubs, so it is ``Any`` from here on."""
    try:
        return importlib.import_module(f"pxr.{name}")
    except ImportError as error:
        raise UsdMissingError(
            f"pxr.{name}: cannot be imported ({error}): install usd-core with pip install 'abbe[usd]', "
            "or run inside an application that brings USD"
        ) from error


Tf = _module("Tf")
Gf = _module("Gf")
Vt = _module("Vt")
Ar = _module("Ar")
Sdf = _module("Sdf")
Pcp = _module("Pcp")
Usd = _module("Usd")
UsdGeom = _module("UsdGeom")
UsdLux = _module("UsdLux")
UsdShade = _module("UsdShade")
UsdRender = _module("UsdRender")
UsdUtils = _module("UsdUtils")
