"""Lens prescriptions: from the table that designs are printed as to a stage with ``AbbeLensAPI`` elements.

A table has one row per surface, in the order in which light meets them:

====================  =============================================================================================
``radius``            of curvature at the vertex, positive if the centre lies behind; empty, 0 or ``inf``: a plane
``thickness``         to the next surface
``glass``             behind the surface, by its name in the catalogue; empty: air
``nd``, ``vd``        index and Abbe number of the glass where it has no name
``semi_diameter``     clear radius
``conic``             the conic constant k
``a4``, ``a6``, …     coefficients of r⁴, r⁶, …
``stop``              anything: the row is the aperture stop, a plane in air
====================  =============================================================================================

``.csv`` has the columns' names in its first row, ``.txt`` too with blanks between and ``-`` for nothing, ``.json`` is a
list of objects, or an object with ``name`` and ``surfaces``. Lengths are in millimetres.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from .errors import StageError

__all__ = ["Element", "Prescription", "Surface", "read_prescription", "stage_text"]

_TERM = re.compile(r"a(\d+)")
_COLUMNS = ("surface", "radius", "thickness", "glass", "nd", "vd", "semi_diameter", "conic", "stop", "comment")
_SEGMENTS, _RINGS = 48, 8
"""Of the stand-in meshes."""


@dataclass(frozen=True)
class Surface:
    """One row."""

    curvature: float
    thickness: float
    glass: str | tuple[float, float] | None
    """Name, or (nd, vd); None for air."""
    semi_diameter: float
    conic: float = 0.0
    aspheres: tuple[float, ...] = ()
    is_stop: bool = False

    def sag(self, radius: float) -> float:
        """Return the height over the vertex at a distance from the axis; flat beyond the semi-diameter."""
        square = min(radius, self.semi_diameter) ** 2
        c = self.curvature
        root = math.sqrt(max(0.0, 1.0 - (1.0 + self.conic) * c * c * square))
        return c * square / (1.0 + root) + sum(a * square ** (n + 2) for n, a in enumerate(self.aspheres))


@dataclass(frozen=True)
class Element:
    """A piece of glass: its front stands at ``z``."""

    front: Surface
    back: Surface
    z: float
    edge_radius: float

    @property
    def glass(self) -> str | tuple[float, float]:
        """What it is made of."""
        assert self.front.glass is not None
        return self.front.glass


@dataclass
class Prescription:
    """A lens system."""

    name: str
    surfaces: list[Surface] = field(default_factory=list)

    @property
    def image(self) -> float:
        """Where the last thickness ends."""
        return sum(surface.thickness for surface in self.surfaces)

    def elements(self) -> list[Element]:
        """Return the elements in order. Cemented ones have one edge radius, so that their flat rims coincide too."""
        found: list[Element] = []
        z, group = 0.0, 0
        for front, back in zip(self.surfaces, self.surfaces[1:], strict=False):
            if front.glass is None:
                group = len(found)
            else:
                edge = max([front.semi_diameter, back.semi_diameter, *(e.edge_radius for e in found[group:])])
                found[group:] = [Element(e.front, e.back, e.z, edge) for e in found[group:]]
                found.append(Element(front, back, z, edge))
            z += front.thickness
        return found


def read_prescription(path: str | PathLike[str]) -> Prescription:
    """Read a prescription table.

    Parameters
    ----------
    path : a ``.csv``, ``.txt`` or ``.json`` file

    Returns
    -------
    Prescription
        Checked as far as the table goes; whether the elements are solids is decided by the core.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The file is no prescription; the message names the row and the column.
    """
    file = Path(path)
    text = file.read_text(encoding="utf-8-sig")
    name = file.stem
    rows: Iterable[Mapping[str, Any]]
    if file.suffix == ".json":
        try:
            content = json.loads(text)
        except ValueError as error:
            raise StageError(f"{file}: is no JSON: {error}") from None
        if isinstance(content, dict):
            name = str(content.get("name", name))
            content = content.get("surfaces")
        if not isinstance(content, list) or not all(isinstance(row, dict) for row in content):
            raise StageError(f"{file}: has no list of surfaces: give one object per surface")
        rows = content
    elif file.suffix == ".csv":
        lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
        rows = list(csv.DictReader(lines, skipinitialspace=True))
    elif file.suffix == ".txt":
        words = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
        header = words[0] if words else []
        for number, row in enumerate(words[1:], 1):
            if len(row) != len(header):
                raise StageError(f"{file}: row {number} has {len(row)} of {len(header)} columns: write - for nothing")
        rows = [dict(zip(header, row, strict=True)) for row in words[1:]]
    else:
        raise StageError(f"{file}: is no prescription: give a .csv, .txt or .json file")
    surfaces = [_surface(f"{file}: row {number}", row) for number, row in enumerate(rows, 1)]
    prescription = Prescription(name, surfaces)
    if not prescription.elements():
        raise StageError(f"{file}: has no glass between two surfaces: name it in the column glass, or give nd and vd")
    if surfaces[-1].glass is not None:
        raise StageError(f"{file}: row {len(surfaces)}: the last surface has glass behind it: add the one that ends it")
    return prescription


def _surface(place: str, row: Mapping[str, Any]) -> Surface:
    values: dict[str, str] = {}
    for key, value in row.items():
        text = "" if value is None else str(value).strip()
        if key is None or (key.strip().lower() not in _COLUMNS and not _TERM.fullmatch(key.strip().lower())):
            raise StageError(f"{place}: unknown column '{key}': use {', '.join(_COLUMNS)}, a4, a6 …")
        values[key.strip().lower()] = "" if text in ("-", "None", "False") else text

    def number(column: str, fallback: float | None) -> float:
        text = values.get(column, "")
        if not text:
            if fallback is None:
                raise StageError(f"{place}: {column} is empty: give a number")
            return fallback
        try:
            value = float(text)
        except ValueError:
            raise StageError(f"{place}: {column} is '{text}': give a number") from None
        if not math.isfinite(value) and column != "radius":
            raise StageError(f"{place}: {column} is {text}: give a finite number")
        return value

    radius = number("radius", math.inf)
    if math.isnan(radius):
        raise StageError(f"{place}: radius is no number: give one, or leave it empty for a plane")
    glass: str | tuple[float, float] | None = None
    if values.get("glass", "").lower() not in ("", "air"):
        glass = values["glass"]
    elif values.get("nd"):
        glass = (number("nd", None), number("vd", 0.0))
    powers = sorted(int(found[1]) for found in map(_TERM.fullmatch, values) if found and values[found[0]])
    if any(power < 4 or power % 2 for power in powers):
        raise StageError(f"{place}: aspheric terms are a4, a6, a8 …: write others as none")
    aspheres = tuple(number(f"a{power}", 0.0) for power in range(4, powers[-1] + 1, 2)) if powers else ()
    semi_diameter = number("semi_diameter", None)
    if semi_diameter <= 0.0:
        raise StageError(f"{place}: semi_diameter is {semi_diameter:g}: it must be positive")
    return Surface(
        0.0 if radius == 0.0 or math.isinf(radius) else 1.0 / radius,
        number("thickness", 0.0),
        glass,
        semi_diameter,
        number("conic", 0.0),
        aspheres,
        bool(values.get("stop")),
    )


def _block(head: str, lines: Iterable[str], metadata: Sequence[str] = ()) -> list[str]:
    first = [f"{head} (", *("    " + line for line in metadata), ")"] if metadata else [head]
    return [*first, "{", *("    " + line if line else "" for line in lines), "}"]


def _number(value: float) -> str:
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _points(points: Iterable[Sequence[float]]) -> str:
    return "[" + ",".join("(" + ",".join(map(_number, point)) + ")" for point in points) + "]"


def _mesh(points: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> list[str]:
    corners = [f(point[axis] for point in points) for f in (min, max) for axis in range(3)]
    return [
        f"float3[] extent = {_points([corners[:3], corners[3:]])}",
        f"int[] faceVertexCounts = [{','.join(str(len(face)) for face in faces)}]",
        f"int[] faceVertexIndices = [{','.join(str(i) for face in faces for i in face)}]",
        f"point3f[] points = {_points(points)}",
        'uniform token subdivisionScheme = "none"',
    ]


def _stand_in(element: Element) -> list[str]:
    """The element as a closed mesh, for software that draws meshes."""

    def profile(surface: Surface, vertex: float) -> list[tuple[float, float]]:
        radii = [surface.semi_diameter * i / _RINGS for i in range(1, _RINGS + 1)]
        if surface.semi_diameter < element.edge_radius:
            radii.append(element.edge_radius)
        return [(r, vertex + surface.sag(r)) for r in radii]

    rings = profile(element.front, 0.0) + profile(element.back, element.front.thickness)[::-1]
    points: list[Sequence[float]] = [(0.0, 0.0, 0.0)]
    for r, z in rings:
        angles = [2 * math.pi * j / _SEGMENTS for j in range(_SEGMENTS)]
        points += [(r * math.cos(angle), r * math.sin(angle), z) for angle in angles]
    points.append((0.0, 0.0, element.front.thickness))
    last = len(points) - 1

    def at(ring: int, j: int) -> int:
        return 1 + ring * _SEGMENTS + j % _SEGMENTS

    faces: list[Sequence[int]] = []
    for j in range(_SEGMENTS):
        faces.append((0, at(0, j + 1), at(0, j)))
        for ring in range(len(rings) - 1):
            faces.append((at(ring, j), at(ring, j + 1), at(ring + 1, j + 1), at(ring + 1, j)))
        faces.append((last, at(len(rings) - 1, j), at(len(rings) - 1, j + 1)))
    return _mesh(points, faces)


def _element(name: str, element: Element, look: str) -> list[str]:
    lines = [
        f"double abbe:lens:thickness = {element.front.thickness!r}",
        f"double abbe:lens:edgeRadius = {element.edge_radius!r}",
    ]
    for side, surface in (("front", element.front), ("back", element.back)):
        lines += [
            f"double abbe:lens:{side}:curvature = {surface.curvature!r}",
            f"double abbe:lens:{side}:semiDiameter = {surface.semi_diameter!r}",
        ]
        if surface.conic != 0.0:
            lines.append(f"double abbe:lens:{side}:conic = {surface.conic!r}")
        if surface.aspheres:
            lines.append(f"uniform double[] abbe:lens:{side}:aspheres = [{', '.join(map(repr, surface.aspheres))}]")
    lines += [
        *_stand_in(element),
        f"rel material:binding = </World/Looks/{look}>",
        f"double3 xformOp:translate = (0, 0, {element.z!r})",
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    ]
    return _block(f'def Mesh "{name}"', lines, ['prepend apiSchemas = ["MaterialBindingAPI", "AbbeLensAPI"]'])


def _look(name: str, glass: str | tuple[float, float]) -> list[str]:
    if isinstance(glass, str):
        law = [f"uniform string abbe:glass = {json.dumps(glass)}"]
    else:
        law = [f"double abbe:dispersion:nd = {glass[0]!r}", f"double abbe:dispersion:vd = {glass[1]!r}"]
    shader = [
        'uniform token info:id = "UsdPreviewSurface"',
        "color3f inputs:diffuseColor = (0, 0, 0)",
        f"float inputs:ior = {_number(1.5 if isinstance(glass, str) else glass[0])}",
        "float inputs:opacity = 0",
        "float inputs:roughness = 0",
        "token outputs:surface",
    ]
    connection = f"token outputs:surface.connect = </World/Looks/{name}/Surface.outputs:surface>"
    lines = [*law, connection, "", *_block('def Shader "Surface"', shader)]
    return _block(f'def Material "{name}"', lines, ['prepend apiSchemas = ["AbbeDispersionAPI"]'])


def _ring(inner: float, outer: float) -> list[str]:
    angles = [2 * math.pi * j / _SEGMENTS for j in range(_SEGMENTS)]
    points = [(r * math.cos(angle), r * math.sin(angle), 0.0) for r in (inner, outer) for angle in angles]
    n = _SEGMENTS
    return _mesh(points, [(j, (j + 1) % n, n + (j + 1) % n, n + j) for j in range(n)])


_VARIABLES = {
    "ddirection_dlambda": "vector3f",
    "dposition_dlambda": "vector3f",
    "dispersion": "float2",
    "dispersion2": "float2",
    "interfaces": "int",
    "refracted_position": "point3f",
    "refracted_prim_id": "int",
}


def stage_text(prescription: Prescription, doc: str = "") -> str:
    """Return a complete stage (.usda): the elements, the stop, the image plane, a camera that looks through, settings.

    Light's direction is +z, the first vertex is the origin. Each element is a mesh with ``AbbeLensAPI``: abbe traces
    the prescription, other software draws the mesh.
    """
    elements = prescription.elements()
    looks: dict[str | tuple[float, float], str] = {}
    for element in elements:
        name = element.glass if isinstance(element.glass, str) else f"Glass_{element.glass[0]}_{element.glass[1]}"
        looks.setdefault(element.glass, re.sub(r"\W", "_", f"G_{name}" if name[0].isdigit() else name))
    widest = max(element.edge_radius for element in elements)
    lens: list[str] = []
    for number, element in enumerate(elements, 1):
        lens += [*_element(f"Element{number}", element, looks[element.glass]), ""]
    z = 0.0
    for surface in prescription.surfaces:
        if surface.is_stop:
            ring = [
                *_ring(surface.semi_diameter, 1.5 * widest),
                f"double3 xformOp:translate = (0, 0, {z!r})",
                'uniform token[] xformOpOrder = ["xformOp:translate"]',
            ]
            lens += [*_block('def Mesh "Stop"', ring), ""]
        z += surface.thickness
    half, distance = 40.0 * widest, 6.0 * max(widest, prescription.image)
    corners = [(-half, -half, 0.0), (-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0)]
    plane = [
        *_mesh(corners, [(0, 1, 2, 3)]),
        f"double3 xformOp:translate = (0, 0, {prescription.image!r})",
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    ]
    camera = [
        f"float2 clippingRange = (1, {_number(100 * distance)})",
        # The first element fills most of the height.
        f"float focalLength = {_number(20.25 * distance / (2.3 * widest))}",
        "float horizontalAperture = 36",
        "float verticalAperture = 20.25",
        f"matrix4d xformOp:transform = ( (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, {_number(-distance)}, 1) )",
        'uniform token[] xformOpOrder = ["xformOp:transform"]',
    ]
    world = [
        *_block('def Camera "Camera"', camera),
        "",
        *_block('def Xform "Lens"', lens[:-1]),
        "",
        *_block('def Mesh "Image"', plane),
        "",
        *_block('def Scope "Looks"', _separated(_look(name, glass) for glass, name in looks.items())),
    ]
    names = list(_VARIABLES)
    ordered = [f"    </Render/Vars/{name}>," for name in names]
    variables = _separated(
        _block(
            f'def RenderVar "{name}"',
            [f'uniform token dataType = "{_VARIABLES[name]}"', f'uniform string sourceName = "{name}"'],
        )
        for name in names
    )
    render = [
        *_block(
            'def RenderSettings "Settings"',
            [
                'uniform token abbe:integrator = "differentials"',
                "rel camera = </World/Camera>",
                "rel products = </Render/Product>",
                "uniform int2 resolution = (640, 360)",
            ],
            ['prepend apiSchemas = ["AbbeRenderSettingsAPI"]'],
        ),
        "",
        *_block(
            'def RenderProduct "Product"',
            [
                "rel camera = </World/Camera>",
                "rel orderedVars = [",
                *ordered,
                "]",
                f'token productName = "{re.sub(r"[^A-Za-z0-9_-]", "_", prescription.name)}.exr"',
            ],
        ),
        "",
        *_block('def Scope "Vars"', variables),
    ]
    text = doc or (
        f"{prescription.name}: {len(elements)} elements, traced as prescribed (AbbeLensAPI). Look for: "
        "`dposition_dlambda` on the image plane, the lateral and axial colour of the design."
    )
    layer = [
        "#usda 1.0",
        "(",
        '    defaultPrim = "World"',
        f"    doc = {json.dumps(text, ensure_ascii=False)}",
        "    metersPerUnit = 0.001",
        '    renderSettingsPrimPath = "/Render/Settings"',
        '    upAxis = "Y"',
        ")",
        "",
        *_block('def Xform "World"', world, ['kind = "component"']),
        "",
        *_block('def Scope "Render"', render),
    ]
    return "\n".join(layer) + "\n"


def _separated(blocks: Iterable[list[str]]) -> list[str]:
    lines: list[str] = []
    for number, block in enumerate(blocks):
        lines += ["", *block] if number else block
    return lines
