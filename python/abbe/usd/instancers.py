"""Point instancers: which elements show which prototype, and where, as arrays.

Transforms are those that USD computes (``ComputeInstanceTransformsAtTime``), prototypes' own transforms included; what
is masked by ``invisibleIds`` and ``inactiveIds`` does not cross. Arrays that do not fit are named and left out as USD
leaves them out. An instancer that several native instances share is read once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from . import tokens
from ._pxr import Tf, UsdGeom
from .composition import usd_reason
from .description import Array, ArrayTable, BrokenError, Diagnostics
from .values import int_array, is_finite, matrix, place, read

__all__ = ["Elements", "InstancerReader"]


# Older versions of USD have `orientations` alone.
_LACKS_ORIENTATIONS_F = not hasattr(UsdGeom.PointInstancer, "GetOrientationsfAttr")


class Elements(NamedTuple):
    """The elements of one instancer that show one prototype."""

    prototype: Any
    """Path of the prototype's root prim."""
    transforms: str
    """Name of the float64 array of shape (n, 12): the instancer's space from the prototype root's parent's."""
    indices: str | None
    """Name of the int32 array that says which elements they are; None where they are all."""
    total: int
    """Elements of the instancer."""


class _Shown(NamedTuple):
    """What the arrays of an instancer say, but for transforms."""

    total: int
    elements: dict[int, Array | None]
    """Per prototype in use: its elements; None for all."""


class InstancerReader:
    """Reads instancers, those that native instances share once."""

    def __init__(self, time: Any, diagnostics: Diagnostics, table: ArrayTable) -> None:
        self._time = time
        self._diagnostics = diagnostics
        self._table = table
        self._shown: dict[Any, _Shown | None] = {}
        self._arrays: dict[Any, dict[int, tuple[str, str | None]]] = {}
        self.prims: dict[Any, Any] = {}
        """The first prim of each source."""

    def elements(self, prim: Any, source: Any, has_something: Callable[[Any], bool]) -> list[Elements]:
        """Return what an instancer shows, by prototype in the order of its ``prototypes``.

        Parameters
        ----------
        prim : the PointInstancer
        source : what it shares with other native instances, or itself
        has_something : called with the prototype's root prim, whether anything of it is rendered; transforms of others
            are not computed
        """
        self.prims.setdefault(source, prim)
        shown = self._shown[source] if source in self._shown else self._shown.setdefault(source, self._read(prim))
        if shown is None:
            return []
        targets = prim.GetRelationship(tokens.PROTOTYPES).GetForwardedTargets()
        wanted = []
        for index in shown.elements:
            root = prim.GetStage().GetPrimAtPath(targets[index])
            if not root:
                self._diagnostics.warn(
                    "missing-prototype",
                    f"{place(prim)}.{tokens.PROTOTYPES}",
                    f"there is no prim <{targets[index]}>; its instances are left out",
                )
            elif has_something(root):
                wanted.append(index)
        arrays = self._arrays.setdefault(source, {})
        missing = [index for index in wanted if index not in arrays]
        if missing:
            self._compute(prim, shown, {index: targets[index] for index in missing}, arrays)
        return [Elements(targets[index], *arrays[index], shown.total) for index in wanted if index in arrays]

    def _read(self, prim: Any) -> _Shown | None:
        """Return which elements show which prototype; None with a warning where that cannot be known."""
        value = read(prim, tokens.PROTO_INDICES, self._time)
        prototypes, _ = int_array(value)
        if prototypes is None:
            self._warn(prim, tokens.PROTO_INDICES, "is no array of integers, or not authored; nothing is instanced")
            return None
        relationship = prim.GetRelationship(tokens.PROTOTYPES)
        known = len(relationship.GetForwardedTargets()) if relationship else 0
        if not known:
            self._warn(prim, tokens.PROTOTYPES, "names no prototype; nothing is instanced")
            return None
        count = len(prototypes)
        if not self._fits(prim, tokens.POSITIONS, count):
            return None
        for name in (tokens.SCALES, tokens.ORIENTATIONS_F, tokens.ORIENTATIONS):
            self._fits(prim, name, count)
        if _LACKS_ORIENTATIONS_F and prim.HasAttribute(tokens.ORIENTATIONS_F):
            self._warn(prim, tokens.ORIENTATIONS_F, "is newer than this USD, which ignores it: author orientations too")
        mask = self._mask(prim, count)
        valid = (prototypes >= 0) & (prototypes < known)
        if not valid.all():
            strays = f"{count - int(valid.sum())} of {count} elements"
            self._warn(prim, tokens.PROTO_INDICES, f"{strays} name no prototype (0 to {known - 1}); they are left out")
            mask = valid if mask is None else mask & valid
        shown = prototypes if mask is None else prototypes[mask]
        # Between 0 and `known`: counted, which is many times faster than sorted.
        used = np.flatnonzero(np.bincount(shown, minlength=known))
        unused = known - len(used)
        if unused:
            self._diagnostics.skip("prototypes without an instance", unused)
        if mask is None and len(used) == 1:
            return _Shown(count, {int(used[0]): None})
        elements: dict[int, Array | None] = {}
        for index in used:
            chosen = prototypes == index
            elements[int(index)] = np.flatnonzero(chosen if mask is None else chosen & mask).astype(np.int32)
        return _Shown(count, elements)

    def _warn(self, prim: Any, name: str, problem: str) -> None:
        self._diagnostics.warn("instancer", f"{place(prim)}.{name}", problem)

    def _fits(self, prim: Any, name: str, count: int) -> bool:
        """Whether an attribute has a value for each element; a warning where it has another number of them."""
        found = _length(read(prim, name, self._time))
        if found == count:
            return True
        if name == tokens.POSITIONS:
            self._warn(prim, name, f"has {found} values for {count} elements; nothing is instanced")
        elif found:
            self._warn(prim, name, f"has {found} values for {count} elements; they are ignored")
        return False

    def _mask(self, prim: Any, count: int) -> Array | None:
        """Return which elements are shown; None for all."""
        ids = _length(read(prim, tokens.IDS, self._time))
        if ids not in (0, count):
            self._warn(prim, tokens.IDS, f"has {ids} values for {count} elements; nothing is masked")
            return None
        shown = UsdGeom.PointInstancer(prim).ComputeMaskAtTime(self._time)
        if not shown:
            return None
        mask = np.array(shown, dtype=bool)
        hidden = count - int(mask.sum())
        if hidden:
            self._diagnostics.skip("instances invisible or inactive", hidden)
        return mask if hidden else None

    def _compute(
        self, prim: Any, shown: _Shown, targets: dict[int, Any], arrays: dict[int, tuple[str, str | None]]
    ) -> None:
        """Compute the transforms of the elements of some prototypes."""
        transforms = self._computed(prim, shown, self._time, self._time)
        if transforms is None:
            self._warn(prim, tokens.POSITIONS, "USD computes no transforms from its arrays; nothing is instanced")
            return
        for index, target in targets.items():
            chosen = shown.elements[index]
            rows = _affine(transforms, chosen)
            try:
                own = self._own_transform(prim.GetStage().GetPrimAtPath(target), self._time)
            except BrokenError as broken:
                self._diagnostics.leave_out(broken)
                continue
            rows = _within(own, rows)
            name = f"instances{len(self._table.arrays)}"
            names = self._table.add(f"{name}.transforms", _frozen(rows.reshape(-1, 12)))
            arrays[index] = (names, None if chosen is None else self._table.add(f"{name}.indices", _frozen(chosen)))

    @staticmethod
    def _computed(prim: Any, shown: _Shown, time: Any, base: Any) -> Array | None:
        """Return the matrices of all elements at a time, as those at the time ``base`` move; None if USD has none."""
        instancer = UsdGeom.PointInstancer
        # Prototypes' own transforms come in elsewhere: USD has no transform at all if one prototype is missing.
        value = instancer(prim).ComputeInstanceTransformsAtTime(
            time, base, instancer.ExcludeProtoXform, instancer.IgnoreMask
        )
        return np.asarray(value) if len(value) == shown.total else None

    def array_names(self, source: Any) -> list[str]:
        """Return the names of the arrays of transforms of an instancer that was read."""
        return [transforms for transforms, _ in self._arrays.get(source, {}).values()]

    def roots(self, source: Any) -> list[Any]:
        """Return the root prims of the prototypes that an instancer shows, in the order of their arrays."""
        prim = self.prims[source]
        targets = prim.GetRelationship(tokens.PROTOTYPES).GetForwardedTargets()
        return [prim.GetStage().GetPrimAtPath(targets[index]) for index in self._arrays.get(source, {})]

    def transforms_at(self, source: Any, time: Any, base: Any) -> dict[str, Array] | None:
        """Return the transforms at another time, by the name of the array at the frame; None if USD has none."""
        shown = self._shown.get(source)
        transforms = None if shown is None else self._computed(self.prims[source], shown, time, base)
        if shown is None or transforms is None:
            return None
        found: dict[str, Array] = {}
        for (index, (name, _)), root in zip(self._arrays[source].items(), self.roots(source), strict=True):
            try:
                own = self._own_transform(root, time)
            except BrokenError:
                return None
            found[name] = _within(own, _affine(transforms, shown.elements[index])).reshape(-1, 12)
        return found

    def array(self, name: str) -> Array:
        """Return an array that was read."""
        return self._table.arrays[name]

    def add(self, name: str, array: Array) -> str:
        """Store an array and return its name."""
        return self._table.add(name, _frozen(array))

    def _own_transform(self, root: Any, time: Any) -> Array | None:
        """Return the transform of a prototype's root prim; None for the identity."""
        xformable = UsdGeom.Xformable(root)
        if not xformable:
            return None
        try:
            numbers = matrix(xformable.GetLocalTransformation(time))
        except Tf.ErrorException as error:
            raise BrokenError(place(root), f"USD cannot read its transform ({usd_reason(error)})") from None
        own = np.array(numbers).reshape(4, 4)
        if not is_finite(numbers):
            raise BrokenError(place(root), "its transform is not finite, so that its instances stand nowhere")
        if (own[:, 3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise BrokenError(place(root), "its transform is projective: only affine transforms place geometry")
        return None if (own == np.eye(4)).all() else own


# Rows of matrices that are copied at a time: source and target stay in a core's cache.
_ROWS = 1 << 13


def _affine(transforms: Array, chosen: Array | None) -> Array:
    """Return the first three columns of 4 × 4 matrices as an array of its own; of the ``chosen`` ones, None for all."""
    if chosen is not None:
        return np.ascontiguousarray(transforms[chosen, :, :3])
    rows = transforms.reshape(-1, 4)
    copy = np.empty((len(rows), 3))
    for first in range(0, len(rows), _ROWS):
        copy[first : first + _ROWS] = rows[first : first + _ROWS, :3]
    return copy.reshape(-1, 4, 3)


def _within(own: Array | None, rows: Array) -> Array:
    """Return the transforms of what stands at ``own`` within places."""
    if own is None:
        return rows
    with np.errstate(over="ignore", invalid="ignore"):  # the core leaves out what is not finite
        placed: Array = own @ rows
    return placed


def _length(value: Any) -> int:
    """Return how many values an array has; 0 for no array."""
    try:
        return len(value)
    except TypeError:
        return 0


def _frozen(array: Array) -> Array:
    """Return an array that nobody writes to any more, so that the core shares it."""
    array.flags.writeable = False
    if isinstance(array.base, np.ndarray):
        array.base.flags.writeable = False
    return array
