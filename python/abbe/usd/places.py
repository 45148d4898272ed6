"""Where prims stand: USD's own transforms, and which prims stand nowhere."""

from __future__ import annotations

from typing import Any

from ._pxr import Tf, UsdGeom
from .composition import usd_reason
from .description import BrokenError
from .values import is_finite, matrix, place

__all__ = ["Places"]

# The last column of an affine matrix.
_AFFINE = [0.0, 0.0, 0.0, 1.0]


class Places:
    """Transforms at one time, as matrices of row vectors."""

    def __init__(self, time: Any) -> None:
        self._time = time
        self.cache = UsdGeom.XformCache(time)
        self._broken: list[BrokenError] = []
        # Their paths: USD says once that it cannot read an op, then takes the identity in its place.
        self._broken_paths: list[Any] = []

    def of(self, prim: Any, root: Any = None) -> list[float]:
        """Return the matrix from a prim's space to the world, or to the space of ``root`` without its own transform.

        Raises
        ------
        BrokenError
            There is none, or it places no geometry.
        """
        path = prim.GetPath()
        for broken_path, broken in zip(self._broken_paths, self._broken, strict=True):
            if path.HasPrefix(broken_path):
                raise broken
        try:
            if root is None:
                transform = self.cache.GetLocalToWorldTransform(prim)
            else:
                transform, _ = self.cache.ComputeRelativeTransform(prim, root)
        except Tf.ErrorException as error:
            raise self._culprit(prim, error) from None
        numbers = matrix(transform)
        if not is_finite(numbers):
            raise BrokenError(place(prim), "its transform is not finite, so that it stands nowhere")
        if numbers[3::4] != _AFFINE:
            raise BrokenError(place(prim), "its transform is projective, and only affine ones place geometry")
        return numbers

    def _culprit(self, prim: Any, error: BaseException) -> BrokenError:
        """Return what is wrong with the prim, or the one above it, whose ops USD cannot read."""
        culprit = prim
        while culprit and not culprit.IsPseudoRoot():
            try:
                UsdGeom.Xformable(culprit).GetLocalTransformation(self._time)
            except Tf.ErrorException as reason:
                error = reason
                break
            culprit = culprit.GetParent()
        else:
            culprit = prim
        problem = f"USD cannot read its transform ({usd_reason(error).rstrip('.')}), so that all below stands nowhere"
        broken = BrokenError(place(culprit), problem)
        self._broken.append(broken)
        self._broken_paths.append(culprit.GetPath())
        return broken
