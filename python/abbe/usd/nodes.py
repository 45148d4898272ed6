"""What simple shading nodes make of constant inputs: MaterialX' standard nodes by their specification's formulas.

Names, defaults and formulas are those of the MaterialX Specification v1.39, "Standard Source Nodes", "Math Nodes",
"Conditional Nodes" and "Channel Nodes", with its standard library (``libraries/stdlib``) where the text leaves
something open. Arithmetic is that of a shader, in float32 and integers of 32 bits. A node that is not in the tables
has no value here, nor has one whose inputs are of other types than its definition says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import tokens

__all__ = ["Choice", "Formula", "Read", "Value", "find_node"]

_Numbers = npt.NDArray[Any]


@dataclass(frozen=True)
class Value:
    """A constant and its type."""

    type: str
    """Sdf type name."""
    data: Any
    """As USD has it, or numbers, strings and lists."""
    attribute: Any = field(default=None, compare=False)
    """The attribute that holds it; None for what a node computed."""


Read = Callable[[str], Value | None]
"""From the name of a node's input to its value, None where it has none; raises where something drives it."""


@dataclass(frozen=True)
class Choice:
    """A node whose output is one of its inputs; the others do not matter, textured or not."""

    compared: Mapping[str, float]
    """The inputs that decide, and their defaults."""
    pick: Callable[..., str | bool | None]
    """From their values to the name of the input, None for zero; where the node has no such inputs, the answer."""
    type: str
    """Sdf type of the output."""

    def evaluate(self, read: Read) -> Value | None:
        """Return the output; None where the inputs do not fit the node."""
        try:
            numbers = {name: _scalar(_data(read(name), default)) for name, default in self.compared.items()}
            picked = self.pick(**numbers)
            if isinstance(picked, bool):
                return Value(self.type, picked)
            chosen = read(picked) if picked else None
            return chosen or _value(self.type, np.float32(0))
        except (KeyError, TypeError, ValueError):
            return None


@dataclass(frozen=True)
class Formula:
    """A node that computes its output from all of its inputs."""

    inputs: Mapping[str, Any]
    """Input names and their defaults, a number standing for every component."""
    compute: Callable[..., Any]
    """From the inputs' values to the components of the output."""
    type: str
    """Sdf type of the output."""

    def evaluate(self, read: Read) -> Value | None:
        """Return the output; None where the inputs do not fit the node."""
        values = {name: read(name) for name in self.inputs}
        if self.compute is _same:
            (value,) = values.values()
            if value is not None:
                return value
        try:
            numbers = {name: _array(_data(value, self.inputs[name])) for name, value in values.items()}
            with np.errstate(all="ignore"):  # what is not finite is named where it arrives
                return _value(self.type, self.compute(**numbers))
        except (IndexError, KeyError, TypeError, ValueError):
            return None


def _data(value: Value | None, default: Any) -> Any:
    return default if value is None else value.data


_LENGTHS = {"float": 1, "int": 1, "bool": 1, "color3f": 3, "color4f": 4, "float2": 2, "float3": 3, "float4": 4}


def _array(data: Any) -> _Numbers:
    """Return numbers as the shader has them: float32, int32 or bool."""
    array = np.asarray(data)
    if array.ndim > 1 or array.dtype.kind not in "fiub":
        raise TypeError("is no number, colour or vector")
    return array.astype(np.float32) if array.dtype.kind == "f" else array.astype(np.int32)


def _scalar(data: Any) -> float:
    array = _array(data)
    if array.ndim:
        raise TypeError("is no number")
    return float(array)


def _value(type_name: str, numbers: Any) -> Value:
    """Return components as a value of the type; a single number stands for all of them."""
    array = np.broadcast_to(np.asarray(numbers), (_LENGTHS[type_name],)) if np.ndim(numbers) == 0 else np.array(numbers)
    if array.shape != (_LENGTHS[type_name],):
        raise ValueError("another number of components than the node's output has")
    kinds: dict[str, Any] = {"int": np.int32, "bool": np.bool_}
    plain: list[Any] = array.astype(kinds.get(type_name, np.float32)).tolist()
    return Value(type_name, plain[0] if len(plain) == 1 else plain)


def _same(**values: Any) -> Any:
    (value,) = values.values()
    return value


def _joined(**parts: _Numbers) -> _Numbers:
    return np.concatenate([np.atleast_1d(part) for part in parts.values()])


def _half_away(x: _Numbers) -> Any:
    return np.copysign(np.floor(np.abs(x) + np.float32(0.5)), x)


def _smoothstep(low: _Numbers, high: _Numbers, **others: _Numbers) -> Any:
    x = others["in"]
    t = np.clip((x - low) / (high - low), 0, 1)
    smooth = t * t * (3 - 2 * t)
    return np.where(x >= high, np.float32(1), np.where(x <= low, np.float32(0), smooth))


def _remap(inlow: Any, inhigh: Any, outlow: Any, outhigh: Any, **others: _Numbers) -> Any:
    return outlow + (others["in"] - inlow) * (outhigh - outlow) / (inhigh - inlow)


def _luminance(lumacoeffs: _Numbers, **others: _Numbers) -> Any:
    color = others["in"]
    grey = np.repeat(np.dot(color[:3], lumacoeffs), 3)
    return np.concatenate([grey, color[3:]])


def _of_in(function: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return ``function`` of the input that is called ``in``, which no Python parameter can be."""
    return lambda **values: function(values["in"])


def _pair(first: float, second: float) -> dict[str, Any]:
    return {"in1": first, "in2": second}


# Category -> inputs with defaults, formula. Booleans arrive as 0 and 1.
_MATH: dict[str, tuple[dict[str, Any], Callable[..., Any]]] = {
    "constant": ({"value": 0.0}, _same),
    "dot": ({"in": 0.0}, _same),
    "add": (_pair(0.0, 0.0), lambda in1, in2: in1 + in2),
    "subtract": (_pair(0.0, 0.0), lambda in1, in2: in1 - in2),
    "multiply": (_pair(0.0, 1.0), lambda in1, in2: in1 * in2),
    "divide": (_pair(0.0, 1.0), lambda in1, in2: in1 / in2),
    "modulo": (_pair(0.0, 1.0), lambda in1, in2: in1 - in2 * np.floor(in1 / in2)),
    "power": (_pair(0.0, 1.0), lambda in1, in2: np.power(in1, in2)),
    "safepower": (_pair(0.0, 1.0), lambda in1, in2: np.sign(in1) * np.power(np.abs(in1), in2)),
    "min": (_pair(0.0, 0.0), lambda in1, in2: np.minimum(in1, in2)),
    "max": (_pair(0.0, 0.0), lambda in1, in2: np.maximum(in1, in2)),
    "invert": ({"in": 0.0, "amount": 1.0}, lambda amount, **others: amount - others["in"]),
    "absval": ({"in": 0.0}, _of_in(np.abs)),
    "sign": ({"in": 0.0}, _of_in(np.sign)),
    "floor": ({"in": 0.0}, _of_in(np.floor)),
    "ceil": ({"in": 0.0}, _of_in(np.ceil)),
    "round": ({"in": 0.0}, _of_in(_half_away)),
    "fract": ({"in": 0.0}, _of_in(lambda x: x - np.floor(x))),
    "sqrt": ({"in": 0.0}, _of_in(np.sqrt)),
    "exp": ({"in": 0.0}, _of_in(np.exp)),
    "ln": ({"in": 1.0}, _of_in(np.log)),
    "clamp": (
        {"in": 0.0, "low": 0.0, "high": 1.0},
        lambda low, high, **others: np.minimum(np.maximum(others["in"], low), high),
    ),
    "mix": ({"fg": 0.0, "bg": 0.0, "mix": 0.0}, lambda fg, bg, mix: bg * (1 - mix) + fg * mix),
    "remap": ({"in": 0.0, "inlow": 0.0, "inhigh": 1.0, "outlow": 0.0, "outhigh": 1.0}, _remap),
    "smoothstep": ({"in": 0.0, "low": 0.0, "high": 1.0}, _smoothstep),
}
_LOGIC: dict[str, tuple[dict[str, Any], Callable[..., Any]]] = {
    "and": (_pair(0, 0), lambda in1, in2: (in1 != 0) & (in2 != 0)),
    "or": (_pair(0, 0), lambda in1, in2: (in1 != 0) | (in2 != 0)),
    "xor": (_pair(0, 0), lambda in1, in2: (in1 != 0) ^ (in2 != 0)),
    "not": ({"in": 0}, _of_in(lambda x: x == 0)),
}
_COMPARISONS: dict[str, tuple[dict[str, float], Callable[[float, float], bool]]] = {
    "ifgreater": ({"value1": 1.0, "value2": 0.0}, lambda value1, value2: value1 > value2),
    "ifgreatereq": ({"value1": 1.0, "value2": 0.0}, lambda value1, value2: value1 >= value2),
    "ifequal": ({"value1": 0.0, "value2": 0.0}, lambda value1, value2: value1 == value2),
}
_SWITCHED_INPUTS = 10
# ACES AP1, the default of `lumacoeffs`.
_AP1_LUMINANCE = (0.2722287, 0.6740818, 0.0536895)
_COMPONENTS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}


def find_node(identifier: str, output: str) -> Formula | Choice | None:
    """Return how ``output`` of the node follows from its inputs, None where the node is not known.

    Parameters
    ----------
    identifier : the shader's ``info:id``, such as ``ND_multiply_color3FA``
    output : name of the output without ``outputs:``
    """
    if not identifier.startswith(tokens.MATERIALX_NODE_PREFIX):
        return None
    category, _, variant = identifier[len(tokens.MATERIALX_NODE_PREFIX) :].partition("_")
    if category == "logical" and variant in _LOGIC:
        inputs, compute = _LOGIC[variant]
        return Formula(inputs, compute, "bool")
    # `mix_color3_color3`, `convert_float_color3`: the output's type stands last; `add_color3FA`: with a suffix for the
    # types of inputs.
    last = variant.rpartition("_")[2]
    mtlx_type = last.rstrip("ABCFIV")
    suffix = last[len(mtlx_type) :]
    type_name = tokens.MATERIALX_TYPES.get(mtlx_type)
    if type_name is None:
        return None
    if category in _MATH:
        inputs, compute = _MATH[category]
        return Formula(inputs, compute, type_name)
    if category in _COMPARISONS or category == "switch":
        return _choice(category, suffix, type_name)
    return _channels(category, suffix, type_name, output)


def _choice(category: str, suffix: str, type_name: str) -> Choice:
    if category == "switch":

        def branch(which: float) -> str | None:
            # ifgreater(1, which), ifgreater(2, which) …: the library's own graph.
            return next((f"in{k}" for k in range(1, _SWITCHED_INPUTS + 1) if which < k), None)

        return Choice({"which": 0.0}, branch, type_name)
    compared, holds = _COMPARISONS[category]
    if type_name == "bool":
        # The comparison itself. Where it is not of booleans, the library has 1 for the first number of all three.
        compared = compared if suffix == "B" else {"value1": 1.0, "value2": 0.0}
        return Choice(compared, lambda value1, value2: holds(value1, value2), type_name)
    return Choice(compared, lambda value1, value2: "in1" if holds(value1, value2) else "in2", type_name)


def _channels(category: str, suffix: str, type_name: str, output: str) -> Formula | None:
    """Return the nodes that rearrange components."""
    length = _LENGTHS.get(type_name, 0)
    if category == "luminance" and type_name in ("color3f", "color4f"):
        return Formula({"in": [0.0] * length, "lumacoeffs": list(_AP1_LUMINANCE)}, _luminance, type_name)
    if category in ("combine2", "combine3", "combine4"):
        # CF and VF are three components and a number, VV two and two.
        first, second = {"CF": (3, 1), "VF": (3, 1), "VV": (2, 2)}.get(suffix, (1, 1))
        if suffix:
            return Formula({"in1": [0.0] * first, "in2": [0.0] * second}, _joined, type_name)
        return Formula({f"in{k}": 0.0 for k in range(1, int(category[-1]) + 1)}, _joined, type_name)
    if category in ("separate2", "separate3", "separate4"):
        index = _COMPONENTS.get(output.removeprefix("out"))
        if index is None or index >= length:
            return None
        return Formula({"in": [0.0] * length}, _of_in(lambda x: x[index]), "float")
    if category == "extract":
        return Formula({"in": [0.0] * length, "index": 0}, _extract, "float")
    if category == "convert":
        return Formula({"in": 0.0}, _of_in(lambda x: _converted(x, length)), type_name)
    return None


def _extract(index: Any, **others: _Numbers) -> Any:
    if index < 0:
        raise IndexError("no such component")
    return others["in"][index]


def _converted(x: _Numbers, length: int) -> _Numbers:
    """Numbers fill, vectors are cut, or filled up with 0 and, in the fourth place, 1."""
    if x.ndim == 0:
        return x
    return np.concatenate([x, np.array([0, 0, 0, 1], np.float32)[len(x) : length]])[:length]
