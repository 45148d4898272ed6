"""Meshes, spheres and other solids: from prims to the shapes of the description, arrays as USD holds them.

What the arrays say is checked by the core; here only their types are, since USD lets a ``point3f[]`` attribute hold an
``int``. A shape that several instances share is read once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from . import tokens
from ._pxr import Usd, UsdGeom
from .description import Array, ArrayTable, BrokenError, Diagnostics
from .lenses import lens_bounds, read_lens
from .solids import read_solid, solid_bounds
from .subdivision import SubdivisionReader
from .values import float_array, int_array, place, read

__all__ = ["ShapeReader"]

Bounds = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lowest and highest corner in object space."""


def _extent(points: Array) -> Bounds:
    """Return lowest and highest corner; column by column, which NumPy does many times faster than ``axis=0``."""
    x, y, z = points.T
    return (
        (float(x.min()), float(y.min()), float(z.min())),
        (float(x.max()), float(y.max()), float(z.max())),
    )


class ShapeReader:
    """Reads shapes, each prototype's once."""

    def __init__(self, time: Any, diagnostics: Diagnostics, level: int | None = None) -> None:
        self._time = time
        self._diagnostics = diagnostics
        self._table = ArrayTable()
        self._subdivision = SubdivisionReader(self._ints, self._floats, self._table, diagnostics, time, level)
        self._index_by_prim: dict[Any, int | None] = {}
        # Per shape: the prim that it was read from.
        self._prims: list[Any] = []
        self.arrays = self._table.arrays
        self.shapes: list[dict[str, Any]] = []
        self.double_sided: list[bool] = []
        """Per shape: ``doubleSided`` of its prim."""
        self.subset_names: list[list[str]] = []
        """Per shape: the prim names of its subsets, in order: the same under every instance."""

    def add(self, name: str, array: Array) -> str:
        """Store an array and return its name."""
        return self._table.add(name, array)

    def meshes(self) -> list[tuple[Any, dict[str, Any]]]:
        """Return the first prim of each mesh with its description."""
        both = zip(self._prims, self.shapes, strict=True)
        return [(prim, shape["mesh"]) for prim, shape in both if "mesh" in shape]

    def sphere(self, prim: Any, source: Any) -> int | None:
        """Return the index of the shape of a ``Sphere`` prim; prims with one ``source`` share it."""
        return self._shared(prim, source, self._read_sphere)

    def solid(self, prim: Any, source: Any) -> int | None:
        """Return the index of the shape of a cube, plane, cylinder, cone or capsule."""
        return self._shared(prim, source, lambda prim: read_solid(prim, self._time))

    def lens(self, prim: Any, source: Any) -> int | None:
        """Return the index of the shape of a prim with a lens prescription."""
        return self._shared(prim, source, lambda prim: read_lens(prim, self._time))

    def mesh(self, prim: Any, source: Any) -> int | None:
        """Return the index of the shape of a ``Mesh`` prim; None (with a warning) if it has nothing to render."""
        return self._shared(prim, source, self._read_mesh)

    def bounds(self, shape: int) -> Bounds | None:
        """Return the extent of a shape in its object space; None if it has no finite point."""
        sphere = self.shapes[shape].get("sphere")
        if sphere is not None:
            radius = abs(sphere["radius"])
            return (-radius, -radius, -radius), (radius, radius, radius)
        solid = solid_bounds(self.shapes[shape]) or lens_bounds(self.shapes[shape])
        if solid is not None:
            return solid
        points = self.arrays[self.shapes[shape]["mesh"]["points"]]
        bounds = _extent(points)
        if not all(math.isfinite(value) for corner in bounds for value in corner):
            points = points[np.isfinite(points).all(axis=1)]
            return _extent(points) if len(points) else None
        return bounds

    def _shared(self, prim: Any, source: Any, read_shape: Callable[[Any], dict[str, Any] | None]) -> int | None:
        if source not in self._index_by_prim:
            shape = read_shape(prim)
            self._index_by_prim[source] = None if shape is None else len(self.shapes)
            if shape is not None:
                self.shapes.append(shape)
                self._prims.append(prim)
                self.double_sided.append(bool(read(prim, tokens.DOUBLE_SIDED, self._time)))
                subsets = shape["mesh"]["subsets"] if "mesh" in shape else []
                self.subset_names.append([subset["path"].rpartition("/")[2] for subset in subsets])
        return self._index_by_prim[source]

    def _read_sphere(self, prim: Any) -> dict[str, Any] | None:
        radius = read(prim, tokens.RADIUS, self._time)
        if isinstance(radius, bool) or not isinstance(radius, (int, float)) or not math.isfinite(radius):
            raise BrokenError(f"{place(prim)}.{tokens.RADIUS}", f"is {radius}, which is no finite number")
        return {"sphere": {"path": str(prim.GetPath()), "radius": float(radius)}}

    def _read_mesh(self, prim: Any) -> dict[str, Any] | None:
        name = f"shape{len(self.shapes)}"
        points = self._floats(prim, tokens.POINTS, 3)
        counts = self._ints(prim, tokens.FACE_VERTEX_COUNTS)
        indices = self._ints(prim, tokens.FACE_VERTEX_INDICES)
        if points is None or counts is None or indices is None or not (len(points) and len(counts) and len(indices)):
            self._diagnostics.warn("empty-mesh", place(prim), "the mesh has no points or no faces; it is left out")
            return None
        add = self._table.add
        mesh: dict[str, Any] = {
            "path": str(prim.GetPath()),
            "points": add(f"{name}.points", points),
            "face_vertex_counts": add(f"{name}.face_vertex_counts", counts),
            "face_vertex_indices": add(f"{name}.face_vertex_indices", indices),
            "left_handed": read(prim, tokens.ORIENTATION, self._time) == tokens.LEFT_HANDED,
        }
        holes = self._ints(prim, tokens.HOLE_INDICES)
        if holes is not None and len(holes):
            mesh["hole_indices"] = add(f"{name}.hole_indices", holes)
        subdivision = self._subdivision.read(prim, name)
        if subdivision is not None:
            mesh["subdivision"] = subdivision
        normals = self._normals(prim, name, subdivision is not None)
        if normals is not None:
            mesh["normals"] = normals
        uv = self._uv(prim)
        if uv is not None:
            values = self.primvar(prim, uv, f"{name}.uv", 2)
            if values is not None:
                mesh["uv"] = values
                mesh["uv_name"] = uv.GetName()[len(tokens.PRIMVARS_PREFIX) :]
        mesh["subsets"] = self._subsets(prim, name)
        return {"mesh": mesh}

    def _floats(self, prim: Any, name: str, columns: int) -> Any:
        """Return a float attribute as an array, converted or left out with a warning; None if there is none."""
        value = read(prim, name, self._time)
        if value is None:
            return None
        array, converted = float_array(value, columns)
        self._report(prim, name, array is None, converted, "float", columns)
        return array

    def _ints(self, prim: Any, name: str) -> Any:
        """Return an int attribute as an array, converted or left out with a warning; None if there is none."""
        value = read(prim, name, self._time)
        if value is None:
            return None
        array, converted = int_array(value)
        self._report(prim, name, array is None, converted, "int", 1)
        return array

    def _report(self, prim: Any, name: str, unusable: bool, converted: bool, element: str, columns: int) -> None:
        if not (unusable or converted):
            return
        where = f"{place(prim)}.{name}"
        authored = str(prim.GetAttribute(name).GetTypeName())
        wanted = f"an array of {element}" if columns == 1 else f"an array of {columns} {element}s each"
        if unusable:
            self._diagnostics.warn("unreadable-attribute", where, f"the value is not {wanted}; it is left out")
        else:
            self._diagnostics.warn(
                "converted-attribute",
                where,
                f"the value ({authored}) was converted to {wanted}",
            )

    def _normals(self, prim: Any, name: str, is_subdivided: bool) -> dict[str, Any] | None:
        """Return the authored normals of a polygonal mesh; USD gives those of a subdivision surface no meaning."""
        primvar, plain = prim.GetAttribute(tokens.PRIMVARS_NORMALS), prim.GetAttribute(tokens.NORMALS)
        attribute = primvar if primvar and primvar.HasAuthoredValue() else plain
        if not attribute or not attribute.HasAuthoredValue():
            return None
        if is_subdivided:
            self._diagnostics.warn(
                "ignored-normals",
                f"{place(prim)}.{attribute.GetName()}",
                "a subdivision surface has the normals of its limit, and USD gives authored ones no meaning: author "
                'subdivisionScheme = "none" where a polygon mesh is meant',
            )
            return None
        return self.primvar(prim, attribute, f"{name}.normals", 3)

    def _uv(self, prim: Any) -> Any:
        """Return the attribute ``primvars:st``, else the texture coordinates that an application named differently."""
        attribute = prim.GetAttribute(tokens.PRIMVARS_ST)
        if not (attribute and attribute.HasAuthoredValue()):
            attribute = self._other_uv(prim)
        return attribute

    def _other_uv(self, prim: Any) -> Any:
        candidates: list[tuple[int, str, Any]] = []
        for item in prim.GetAuthoredPropertiesInNamespace(tokens.PRIMVARS):
            if not isinstance(item, Usd.Attribute) or not item.HasAuthoredValue():
                continue
            base, type_name = item.GetName()[len(tokens.PRIMVARS_PREFIX) :], str(item.GetTypeName())
            if type_name in tokens.TEX_COORD_TYPES:
                candidates.append((0, base, item))
            elif type_name in tokens.FLOAT2_TYPES and base in tokens.UV_NAMES:
                candidates.append((1, base, item))
        # By role first, then by name: the order does not depend on the order of authoring.
        return min(candidates, key=lambda c: c[:2])[2] if candidates else None

    def primvar(self, prim: Any, attribute: Any, array_name: str, columns: int) -> dict[str, Any] | None:
        """Return values over a mesh as the description has them; None, with a warning, where they are unusable."""
        name = attribute.GetName()
        values = self._floats(prim, name, columns)
        if values is None:
            return None
        interpolation = attribute.GetMetadata(tokens.INTERPOLATION)
        if interpolation is None:
            # The plain attribute `normals` is per vertex where nothing is said, a primvar constant.
            interpolation = tokens.VERTEX if name == tokens.NORMALS else tokens.CONSTANT
        if interpolation not in tokens.INTERPOLATIONS:
            self._diagnostics.warn(
                "unreadable-attribute",
                f"{place(prim)}.{name}",
                f"interpolation '{interpolation}' is unknown; the values are left out",
            )
            return None
        result: dict[str, Any] = {"values": self._table.add(f"{array_name}.values", values)}
        if name != tokens.NORMALS:
            indices = self._ints(prim, name + tokens.PRIMVAR_INDICES)
            if indices is not None:
                result["indices"] = self._table.add(f"{array_name}.indices", indices)
        result["interpolation"] = str(interpolation)
        return result

    def _subsets(self, prim: Any, name: str) -> list[dict[str, Any]]:
        subsets: list[dict[str, Any]] = []
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies()):
            if child.GetTypeName() != tokens.GEOM_SUBSET and not child.IsA(UsdGeom.Subset):
                continue
            if read(child, tokens.FAMILY_NAME, self._time) != tokens.MATERIAL_BIND:
                continue
            element = read(child, tokens.ELEMENT_TYPE, self._time)
            if element != tokens.FACE:
                self._diagnostics.warn(
                    "unsupported-subset",
                    place(child),
                    f"a subset of {element} elements is left out: use faces",
                )
                continue
            faces = self._ints(child, tokens.INDICES)
            if faces is not None:
                array = self._table.add(f"{name}.subset{len(subsets)}.faces", faces)
                subsets.append({"path": str(child.GetPath()), "faces": array})
        return subsets
