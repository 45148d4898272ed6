"""The USD plug-in folder in this package: where it is, and making it known to a USD that is there.

Reading a stage never needs it: the bridge reads attributes by name. Authoring with ``prim.ApplyAPI("AbbeDispersionAPI")``
does.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import warnings
from pathlib import Path

__all__ = ["plugin_path", "register"]

# Any one of our schemas tells whether USD knows them.
_A_SCHEMA = "AbbeDispersionAPI"


def plugin_path() -> Path:
    """Return the folder to name in ``PXR_PLUGINPATH_NAME`` for usdview, Houdini and others.

    Returns
    -------
    Path
        Absolute; holds ``plugInfo.json`` and ``generatedSchema.usda``.
    """
    return Path(__file__).resolve().parent / "plugin"


def register() -> bool:
    """Make the schemas known to USD, if a ``pxr`` can be imported.

    USD reads schemas once, when the first stage needs them. Where that has happened already, they stay unknown to this
    process, which is warned of.

    Returns
    -------
    bool
        Whether USD knows the schemas now (or will, once it reads any).
    """
    if "pxr" not in sys.modules and importlib.util.find_spec("pxr") is None:
        return False
    try:
        plug = importlib.import_module("pxr.Plug")
    except ImportError:
        # A broken USD is reported where one is needed, with its reason; the rest of the package works without.
        return False
    plug.Registry().RegisterPlugins(str(plugin_path()))
    usd = sys.modules.get("pxr.Usd")
    if usd is None:
        return True
    if usd.SchemaRegistry().FindAppliedAPIPrimDefinition(_A_SCHEMA) is None:
        warnings.warn(
            "abbe's schemas came too late for USD, which had read its own: import abbe before opening a stage, or set "
            f"PXR_PLUGINPATH_NAME={plugin_path()}; rendering does not need them",
            stacklevel=2,
        )
        return False
    return True
