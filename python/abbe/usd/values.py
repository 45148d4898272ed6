"""From USD's values to what the description holds: plain JSON values, and arrays without copies."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ._pxr import Gf, Sdf, Usd
from .description import Array

__all__ = [
    "IDENTITY",
    "authored",
    "authored_namespace",
    "float_array",
    "int_array",
    "is_finite",
    "matrix",
    "place",
    "plain",
    "read",
]

# 2**31 and beyond do not fit the core's 32-bit indices.
_INT32 = np.iinfo(np.int32)


def place(thing: Any) -> str:
    """Return a prim or property as messages show it: ``</World/Glass>``, ``</World/Glass>.inputs:ior``."""
    path = thing if isinstance(thing, Sdf.Path) else thing.GetPath()
    if path.IsPropertyPath():
        return f"<{path.GetPrimPath()}>.{path.name}"
    return f"<{path}>"


def read(prim: Any, name: str, time: Any) -> Any:
    """Return the value of an attribute at ``time``, fallbacks included; None where there is none."""
    attribute = prim.GetAttribute(name)
    if not attribute:
        return None
    try:
        return attribute.Get(time)
    except (RuntimeError, TypeError, ValueError):
        # Values of a type that this USD does not know, or of another type than declared.
        return None


def _number(value: float) -> float | str:
    """Return a finite number as it is and others by name: JSON has no word for them, and the core refuses strings."""
    return value if math.isfinite(value) else repr(value)


def _numbers(values: Any) -> Any:
    """Apply :func:`_number` through nested lists."""
    if isinstance(values, list):
        return [_numbers(value) for value in values]
    return _number(values) if isinstance(values, float) else values


def plain(value: Any) -> Any:
    """Return a USD value as JSON has it, None where that cannot be.

    Numbers, strings and booleans stay; asset paths become strings as authored; vectors, matrices and arrays become
    (nested) lists; quaternions [real, i, j, k]. float32 becomes the double of the same value.
    """
    if isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Sdf.AssetPath):
        return value.path
    if isinstance(value, (Sdf.TimeCode, Usd.TimeCode)):
        return _number(float(value.GetValue()))
    if hasattr(value, "GetReal") and hasattr(value, "GetImaginary"):
        return _numbers([float(value.GetReal()), *(float(part) for part in value.GetImaginary())])
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind == "f":
        return _numbers(array.astype(np.float64).tolist())
    if array.dtype.kind in "iub" and array.ndim > 0:
        return array.tolist()
    if isinstance(value, Iterable):
        items = [plain(item) for item in value]
        return None if any(item is None for item in items) else items
    return None


def authored(attribute: Any, time: Any) -> dict[str, Any] | None:
    """Return ``{"type": …, "value": …}`` of an attribute with an authored value, else None."""
    if not attribute.HasAuthoredValue():
        return None
    try:
        value = plain(attribute.Get(time))
    except (RuntimeError, TypeError):
        return None
    return None if value is None else {"type": str(attribute.GetTypeName()), "value": value}


def authored_namespace(prim: Any, namespace: str, time: Any, *, strip: bool = False) -> dict[str, Any]:
    """Return all authored attributes of ``prim`` under ``namespace``, by full name or with the namespace stripped."""
    found = {}
    for item in prim.GetAuthoredPropertiesInNamespace(namespace):
        if not isinstance(item, Usd.Attribute):
            continue
        value = authored(item, time)
        if value is not None:
            name = item.GetName()
            found[name[len(namespace) + 1 :] if strip else name] = value
    return found


def float_array(value: Any, columns: int) -> tuple[Array | None, bool]:
    """Return a USD array as float32 of shape (n, columns), and whether it had to be converted.

    None where ``value`` is not an array of that many numbers per element. USD's own memory where it is float32 already.
    """
    array = _array(value, "fiu")
    if array is None or array.ndim != (1 if columns == 1 else 2) or (columns > 1 and array.shape[1] != columns):
        return None, False
    if array.dtype == np.float32 and array.flags.c_contiguous:
        return array, False
    with np.errstate(over="ignore"):  # a double beyond float32 becomes inf, which the core refuses by name
        return np.ascontiguousarray(array, dtype=np.float32), True


def int_array(value: Any) -> tuple[Array | None, bool]:
    """Return a USD array as int32 of shape (n,), and whether it had to be converted; None where it is none."""
    array = _array(value, "iu")
    if array is None or array.ndim != 1:
        return None, False
    if array.dtype == np.int32 and array.flags.c_contiguous:
        return array, False
    if array.size and (array.min() < _INT32.min or array.max() > _INT32.max):
        return None, False
    return np.ascontiguousarray(array, dtype=np.int32), True


def _array(value: Any, kinds: str) -> Array | None:
    """Return a numeric ``Vt`` array as NumPy sees it; None for anything else, single vectors included."""
    if value is None or isinstance(value, (str, int, float)) or type(value).__module__ != _VT_MODULE:
        return None
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    return array if array.dtype.kind in kinds else None


_VT_MODULE = "pxr.Vt"


def is_finite(values: list[float]) -> bool:
    """Return whether every number is finite."""
    # A finite sum has finite terms; that of finite terms may still overflow.
    return math.isfinite(sum(values)) or all(math.isfinite(value) for value in values)


def matrix(value: Any) -> list[float]:
    """Return a ``Gf.Matrix4d`` as 16 doubles, row by row."""
    numbers: list[float] = np.asarray(value).ravel().tolist()
    return numbers


IDENTITY = matrix(Gf.Matrix4d(1.0))
