"""The USD plug-in in this package: where it is, and making it known to USD.

Three things are made known:

* the schemas, as soon as ``pxr.Plug`` is imported: before the first stage, since a process reads the schemas that
  there are once and for all;
* the shader ``AbbeGlass``, with the first ``Sdr.Registry()`` or ``UsdValidation.ValidationRegistry()``: making the
  registry of shaders reads the schemas, and must not happen before others have registered theirs;
* the validators, with the first ``UsdValidation.ValidationRegistry()``.

Where a stage is open already all of it happens at once. A program that does not use USD does not pay for it: ``pxr``
takes longer to import than all the rest. Reading a stage needs none of the three: the bridge reads attributes by name.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec
    from types import ModuleType

__all__ = ["SHADER", "plugin_path", "register", "register_shader", "schemas_are_known"]

SHADER = "AbbeGlass"
# Any one of our schemas tells whether USD knows them.
_A_SCHEMA = "AbbeDispersionAPI"


def plugin_path() -> Path:
    """Return the folder to name in ``PXR_PLUGINPATH_NAME`` for usdview, Houdini and others.

    Returns
    -------
    Path
        Absolute; holds ``plugInfo.json``, ``generatedSchema.usda`` and ``AbbeGlass.usda``.
    """
    return Path(__file__).resolve().parent / "plugin"


def register() -> None:
    """Make the plug-in known to those USD modules that are imported, and to the others once they are.

    Warns where a stage was opened before, so that the schemas came too late. Calling it again does no harm.
    """
    actions: dict[str, Callable[[], None]] = {
        "pxr.Plug": _register_schemas,
        "pxr.Usd": _check_order,
        "pxr.Sdr": _expect_shaders,
        "pxr.UsdValidation": _expect_validation,
    }
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, _Afterwards)]
    later = {name: action for name, action in actions.items() if name not in sys.modules}
    if later:
        sys.meta_path.insert(0, _Afterwards(later))
    for name, action in actions.items():
        if name not in later:
            action()


class _Afterwards:
    """Calls a function after a module was imported; how it is found and loaded is left to the other finders.

    A finder by what it does: importing the base class would take 10 ms.
    """

    def __init__(self, actions: dict[str, Callable[[], None]]) -> None:
        self._actions = actions

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        action = self._actions.get(fullname)
        if action is None:
            return None
        others = (finder for finder in sys.meta_path if finder is not self and hasattr(finder, "find_spec"))
        spec = next(filter(None, (finder.find_spec(fullname, path, target) for finder in others)), None)
        if spec is None or spec.loader is None:
            return None
        loader: Any = spec.loader
        execute = loader.exec_module

        def exec_module(module: ModuleType) -> None:
            del loader.exec_module
            execute(module)
            if self._actions.pop(fullname, None) is not None:
                action()

        # On this one object, which loads this one module: the class stays as it is.
        loader.exec_module = exec_module
        return spec


def _register_schemas() -> None:
    plug: Any = importlib.import_module("pxr.Plug")
    plug.Registry().RegisterPlugins(str(plugin_path()))


def _a_stage_may_be_open() -> bool:
    """Tell whether USD may have read its schemas. Asking it for them would make it read them, so its layers tell."""
    sdf: Any = importlib.import_module("pxr.Sdf")
    return bool(sdf.Layer.GetLoadedLayers())


def schemas_are_known() -> bool:
    """Return whether USD knows the schemas; it reads all there are now if it has not yet."""
    usd: Any = importlib.import_module("pxr.Usd")
    return usd.SchemaRegistry().FindAppliedAPIPrimDefinition(_A_SCHEMA) is not None


def _check_order() -> None:
    if _a_stage_may_be_open() and not schemas_are_known():
        warnings.warn(
            "abbe's schemas came too late for USD, which had read its own: import abbe before opening a stage, or set "
            f"PXR_PLUGINPATH_NAME={plugin_path()}; rendering does not need them",
            # Past register and the package, to whoever imports it.
            stacklevel=4,
        )


def _expect_shaders() -> None:
    sdr: Any = importlib.import_module("pxr.Sdr")
    if _takes_definitions(sdr):
        _at_first_use(sdr.Registry, register_shader)


def _expect_validation() -> None:
    from .validators import register_validators

    def act() -> None:
        register_validators()
        # USD's validators look shaders up without Python, which would not be noticed here.
        register_shader()

    validation: Any = importlib.import_module("pxr.UsdValidation")
    _at_first_use(validation.ValidationRegistry, act)


def _at_first_use(registry: Any, action: Callable[[], object]) -> None:
    """Call ``action`` when Python first asks for a registry of USD, or now if that cannot do harm any more.

    The class is as it was from then on.
    """
    if _a_stage_may_be_open():
        action()
        return
    original = vars(registry)["__new__"]
    if getattr(original.__func__, "__module__", None) == __name__:
        return

    def first(cls: Any, *arguments: Any) -> Any:
        registry.__new__ = original
        action()
        return registry.__new__(cls, *arguments)

    registry.__new__ = staticmethod(first)


def _takes_definitions(sdr: Any) -> bool:
    # Since USD 25.02.
    return hasattr(sdr.Registry, "AddDiscoveryResult")


def register_shader() -> str:
    """Make ``AbbeGlass`` known to Sdr now; USD reads its schemas for that if it has not yet.

    Returns
    -------
    str
        Why it could not be; empty if it is known.
    """
    usd: Any = importlib.import_module("pxr.Usd")
    sdr: Any = importlib.import_module("pxr.Sdr")
    shade: Any = importlib.import_module("pxr.UsdShade")
    tf: Any = importlib.import_module("pxr.Tf")
    if not _takes_definitions(sdr):
        year, month = usd.GetVersion()[1:]
        return f"Sdr of USD {year}.{month:02} takes no definitions from Python, 25.02 and later do"

    def insistent(call: Callable[[], Any]) -> Any:
        # What USD complains of once is done all the same: usd-core 24 and 25 lack a file of usdHydra's, which the
        # making of the registry reports, and reading our definition reports that Sdr has no name for doubles.
        try:
            return call()
        except tf.ErrorException:
            return call()

    registry = insistent(sdr.Registry)
    if insistent(lambda: registry.GetShaderNodeByIdentifier(SHADER)):
        return ""
    path = str(plugin_path() / f"{SHADER}.usda")
    try:
        stage = usd.Stage.Open(path)
    except tf.ErrorException:
        # Whoever asked for USD's registry must get it.
        return f"{path} cannot be read: install abbe again"
    results = getattr(shade.ShaderDefUtils, "GetDiscoveryResults", None) or shade.ShaderDefUtils.GetNodeDiscoveryResults
    for result in results(shade.Shader(stage.GetPrimAtPath(f"/{SHADER}")), path):
        registry.AddDiscoveryResult(result)
    # Read now, so that the host never sees those complaints.
    if not insistent(lambda: registry.GetShaderNodeByIdentifier(SHADER)):
        return f"Sdr did not take {path}"
    return ""
