"""Makes the sample stages beside this script; the same script gives the same bytes.

    python stages/generate.py [FOLDER]

Plain Python. Every shape is built from its definition: the prism from the angle of minimum deviation, the doublet from
its prescription, the brilliant from the planes of its facets. Points are rounded to what float32 holds.
"""

import itertools
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent

Vector = tuple[float, float, float]
Face = tuple[int, ...]

# Sellmeier coefficients B and C (µm²). N-BK7, SF5, SF11: data sheets of SCHOTT. Diamond: Peter 1923, whose poles are
# printed as wavelengths (0.1750, 0.1060 µm) and squared here.
GLASSES: dict[str, tuple[list[float], list[float]]] = {
    "N-BK7": ([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653]),
    "SF5": ([1.46141885, 0.247713019, 0.949995832], [0.0111826126, 0.0508594669, 112.041888]),
    "SF11": ([1.73848403, 0.311168974, 1.17490871], [0.0136068604, 0.0615960463, 121.922711]),
    "Diamond": ([0.3306, 4.3356], [0.030625, 0.011236]),
}
D_LINE, F_LINE, C_LINE = 0.5875618, 0.4861327, 0.6562725

# The variables of every stage: AOV, dataType, driver:parameters:aov:format.
VARIABLES = [
    ("ddirection_dlambda", "vector3f", "float3"),
    ("dposition_dlambda", "vector3f", "float3"),
    ("dispersion_footprint", "float", "float"),
    ("footprint_half_width", "float", "float"),
    ("dispersion", "float2", "float2"),
    ("dispersion2", "float2", "float2"),
    ("dispersion_r", "float2", "float2"),
    ("dispersion_g", "float2", "float2"),
    ("dispersion_b", "float2", "float2"),
    ("ior", "float", "float"),
    ("dior_dlambda", "float", "float"),
    ("abbe_number", "float", "float"),
    ("interfaces", "int", "int"),
    ("total_reflections", "int", "int"),
    ("depth", "float", "float"),
    ("position", "point3f", "float3"),
    ("normal", "normal3f", "float3"),
    ("prim_id", "int", "int"),
    ("material_id", "int", "int"),
    ("refracted_depth", "float", "float"),
    ("refracted_position", "point3f", "float3"),
    ("refracted_normal", "normal3f", "float3"),
    ("refracted_uv", "float2", "float2"),
    ("refracted_prim_id", "int", "int"),
    ("refracted_material_id", "int", "int"),
]


def ior(glass: str, micrometers: float) -> float:
    """Index of a glass by Sellmeier's law n² = 1 + Σ B λ²/(λ² − C)."""
    square = micrometers * micrometers
    return math.sqrt(1 + sum(b * square / (square - c) for b, c in zip(*GLASSES[glass], strict=True)))


# --- vectors ----------------------------------------------------------------------------------------------------------


def add(a: Vector, b: Vector, scale: float = 1.0) -> Vector:
    """a + scale · b"""
    return (a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2])


def dot(a: Vector, b: Vector) -> float:
    """a · b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a × b"""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a: Vector) -> Vector:
    """a / |a|"""
    length = math.sqrt(dot(a, a))
    return (a[0] / length, a[1] / length, a[2] / length)


# --- USD as text ------------------------------------------------------------------------------------------------------


def number(value: float, decimals: int) -> str:
    """Shortest text of a value rounded to so many decimals; never a negative zero."""
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def tuples(values: Iterable[Sequence[float]], decimals: int) -> str:
    """[(1,2,3),(4,5,6)]"""
    return "[" + ",".join("(" + ",".join(number(x, decimals) for x in value) + ")" for value in values) + "]"


def integers(values: Iterable[int]) -> str:
    """[1,2,3]"""
    return "[" + ",".join(map(str, values)) + "]"


def doubles(values: Iterable[float]) -> str:
    """Doubles to the last digit."""
    return "[" + ", ".join(map(repr, values)) + "]"


def block(head: str, lines: Iterable[str], metadata: Iterable[str] = ()) -> list[str]:
    """A prim: its head, metadata in parentheses, indented content in braces."""
    metadata = list(metadata)
    first = [f"{head} (", *("    " + line for line in metadata), ")"] if metadata else [head]
    return [*first, "{", *("    " + line if line else "" for line in lines), "}"]


def joined(blocks: Iterable[list[str]]) -> list[str]:
    """Prims one after the other with an empty line between."""
    result: list[str] = []
    for index, lines in enumerate(blocks):
        result += ["", *lines] if index else lines
    return result


# --- prims ------------------------------------------------------------------------------------------------------------


def glass(name: str, label: str, priority: int, form: str = "coefficients") -> list[str]:
    """A glass, and a preview surface that says it is clear.

    Its law stands in our attributes as "coefficients", or is named there as one of the "catalogue", or stands in a
    "shader" of our own, which only we look for.
    """
    path = f"/World/Looks/{name}"
    preview = block(
        'def Shader "Surface"',
        [
            'uniform token info:id = "UsdPreviewSurface"',
            "color3f inputs:diffuseColor = (0, 0, 0)",
            f"float inputs:ior = {number(ior(label, D_LINE), 6)}",
            "float inputs:opacity = 0",
            "float inputs:roughness = 0",
            "token outputs:surface",
        ],
    )
    connection = f"token outputs:surface.connect = <{path}/Surface.outputs:surface>"
    if form == "shader":
        law = [line.removeprefix("uniform ").replace(" abbe:", " inputs:abbe:") for line in stated(label, priority)]
        ours = block('def Shader "Glass"', ['uniform token info:id = "AbbeGlass"', *law, "token outputs:surface"])
        ours = [f"token outputs:abbe:surface.connect = <{path}/Glass.outputs:surface>", connection, "", *ours]
        return block(f'def Material "{name}"', [*ours, "", *preview])
    named = [f'uniform string abbe:glass = "SCHOTT:{label}"', f"uniform int abbe:dielectricPriority = {priority}"]
    law = named if form == "catalogue" else stated(label, priority)
    lines = [*law, connection, "", *preview]
    return block(f'def Material "{name}"', lines, ['prepend apiSchemas = ["AbbeDispersionAPI"]'])


def stated(label: str, priority: int) -> list[str]:
    """Sellmeier's law of a glass by its coefficients."""
    b, c = GLASSES[label]
    return [
        'uniform token abbe:dispersion:law = "sellmeier"',
        f"uniform double[] abbe:dispersion:sellmeier:b = {doubles(b)}",
        f"uniform double[] abbe:dispersion:sellmeier:c = {doubles(c)}",
        f"uniform int abbe:dielectricPriority = {priority}",
    ]


def paint(name: str, color: Vector, emission: float = 0.0) -> list[str]:
    """A matt colour; it may glow."""
    lines = [
        'uniform token info:id = "UsdPreviewSurface"',
        f"color3f inputs:diffuseColor = ({', '.join(number(x, 3) for x in color)})",
        "float inputs:roughness = 1",
        "token outputs:surface",
    ]
    if emission:
        lines.insert(2, f"color3f inputs:emissiveColor = ({', '.join(number(emission * x, 3) for x in color)})")
    connection = f"token outputs:surface.connect = </World/Looks/{name}/Surface.outputs:surface>"
    return block(f'def Material "{name}"', [connection, "", *block('def Shader "Surface"', lines)])


def mesh(
    name: str,
    points: Sequence[Vector],
    faces: Sequence[Face],
    look: str,
    *,
    decimals: int,
    normals: Sequence[Vector] | None = None,
    uv: Sequence[tuple[float, float]] | None = None,
    subsets: dict[str, tuple[str, list[int]]] | None = None,
    is_double_sided: bool = False,
    transform: Sequence[str] = (),
) -> list[str]:
    """A polygon mesh that is no subdivision surface, its subsets bound to looks of their own."""
    low = [min(p[i] for p in points) for i in range(3)]
    high = [max(p[i] for p in points) for i in range(3)]
    lines = [
        *(["uniform bool doubleSided = 1"] if is_double_sided else []),
        f"float3[] extent = {tuples([low, high], decimals)}",
        f"int[] faceVertexCounts = {integers(len(face) for face in faces)}",
        f"int[] faceVertexIndices = {integers(index for face in faces for index in face)}",
        f"rel material:binding = </World/Looks/{look}>",
    ]
    if normals:
        lines += [f"normal3f[] normals = {tuples(normals, 6)} (", '    interpolation = "vertex"', ")"]
    lines.append(f"point3f[] points = {tuples(points, decimals)}")
    if uv:
        lines += [f"texCoord2f[] primvars:st = {tuples(uv, 5)} (", '    interpolation = "vertex"', ")"]
    if subsets:
        lines.append('uniform token subsetFamily:materialBind:familyType = "nonOverlapping"')
    lines.append('uniform token subdivisionScheme = "none"')
    lines += transform
    for subset, (subset_look, indices) in (subsets or {}).items():
        content = [
            'uniform token elementType = "face"',
            'uniform token familyName = "materialBind"',
            f"int[] indices = {integers(indices)}",
            f"rel material:binding = </World/Looks/{subset_look}>",
        ]
        lines += ["", *block(f'def GeomSubset "{subset}"', content, ['prepend apiSchemas = ["MaterialBindingAPI"]'])]
    return block(f'def Mesh "{name}"', lines, ['prepend apiSchemas = ["MaterialBindingAPI"]'])


def board(
    name: str,
    center: Vector,
    right: Vector,
    up: Vector,
    columns: Sequence[float],
    rows: Sequence[float],
    looks: tuple[str, str],
    is_second: Callable[[int, int], bool],
) -> list[str]:
    """A flat board of rectangles between the given coordinates along `right` and `up`, in two looks.

    Texture coordinates run from 0 to 1 over the board; it faces right × up.
    """
    points = [add(add(center, right, x), up, y) for y in rows for x in columns]
    width, height = columns[-1] - columns[0], rows[-1] - rows[0]
    uv = [((x - columns[0]) / width, (y - rows[0]) / height) for y in rows for x in columns]
    faces: list[Face] = []
    second: list[int] = []
    for j, i in itertools.product(range(len(rows) - 1), range(len(columns) - 1)):
        corner = j * len(columns) + i
        if is_second(i, j):
            second.append(len(faces))
        faces.append((corner, corner + 1, corner + 1 + len(columns), corner + len(columns)))
    subsets = {looks[1]: (looks[1], second)} if second else None
    return mesh(name, points, faces, looks[0], decimals=5, uv=uv, subsets=subsets, is_double_sided=True)


def steps(low: float, high: float, count: int) -> list[float]:
    """count + 1 equally spaced values."""
    return [low + (high - low) * i / count for i in range(count + 1)]


def grid(
    paper: str,
    lines: str,
    z: float,
    ranges: tuple[tuple[float, float], tuple[float, float]],
    pitch: float,
    thickness: float,
    looks: tuple[str, str],
) -> list[list[str]]:
    """Paper facing +z with thin rectangles before it, one about every multiple of the pitch.

    The rectangles lie a hundredth of their thickness apart, so that no two surfaces coincide.
    """
    (left, right), (bottom, top) = ranges
    sheet = board(paper, (0.0, 0.0, z), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), [left, right], [bottom, top], looks, never)
    points: list[Vector] = []
    for axis, (low, high) in enumerate(ranges):
        layer = z + (axis + 1) * thickness / 100
        for k in range(math.ceil(low / pitch), math.floor(high / pitch) + 1):
            a, b = k * pitch - thickness / 2, k * pitch + thickness / 2
            box = (
                ((a, bottom), (b, bottom), (b, top), (a, top))
                if axis == 0
                else ((left, a), (right, a), (right, b), (left, b))
            )
            points += [(x, y, layer) for x, y in box]
    uv = [((x - left) / (right - left), (y - bottom) / (top - bottom)) for x, y, _ in points]
    faces = [(k, k + 1, k + 2, k + 3) for k in range(0, len(points), 4)]
    return [sheet, mesh(lines, points, faces, looks[1], decimals=4, uv=uv, is_double_sided=True)]


def never(i: int, j: int) -> bool:
    """No rectangle."""
    return False


def chequered(i: int, j: int) -> bool:
    """Every second rectangle."""
    return (i + j) % 2 == 1


def placed(eye: Vector, target: Vector) -> list[str]:
    """The transform of something at `eye` that looks along −z at `target`, +y up."""
    z = unit(add(eye, target, -1.0))
    x = unit(cross((0.0, 1.0, 0.0), z))
    y = cross(z, x)
    rows = [f"({', '.join(number(c, 12) for c in (*row, w))})" for row, w in ((x, 0), (y, 0), (z, 0), (eye, 1))]
    return [
        f"matrix4d xformOp:transform = ( {', '.join(rows)} )",
        'uniform token[] xformOpOrder = ["xformOp:transform"]',
    ]


def camera(eye: Vector, target: Vector, focal_length: float, clipping: tuple[float, float]) -> list[str]:
    """A pinhole camera of 16:9."""
    distance = math.dist(eye, target)
    lines = [
        f"float2 clippingRange = ({number(clipping[0], 3)}, {number(clipping[1], 3)})",
        f"float focalLength = {number(focal_length, 3)}",
        f"float focusDistance = {number(distance, 4)}",
        "float fStop = 0",
        "float horizontalAperture = 36",
        "float verticalAperture = 20.25",
        *placed(eye, target),
    ]
    return block('def Camera "Camera"', lines)


def dome_light(intensity: float) -> list[str]:
    """Even light from everywhere."""
    return block('def DomeLight "Dome"', [f"float inputs:intensity = {number(intensity, 3)}"])


def rect_light(name: str, eye: Vector, target: Vector, size: float, intensity: float) -> list[str]:
    """A square light of a size that shines on `target`."""
    half = size / 2
    lines = [
        f"float3[] extent = {tuples([(-half, -half, 0), (half, half, 0)], 4)}",
        f"float inputs:height = {number(size, 3)}",
        f"float inputs:intensity = {number(intensity, 3)}",
        f"float inputs:width = {number(size, 3)}",
        *placed(eye, target),
    ]
    return block(f'def RectLight "{name}"', lines)


def settings(name: str) -> list[str]:
    """The scope </Render>: settings, one product, its variables."""
    variables = [
        block(
            f'def RenderVar "{aov}"',
            [
                'uniform token abbe:filter = "auto"',
                f'uniform token dataType = "{data_type}"',
                f'token driver:parameters:aov:format = "{data_format}"',
                f'string driver:parameters:aov:name = "{aov}"',
                f'uniform string sourceName = "{aov}"',
                'uniform token sourceType = "raw"',
            ],
            ['prepend apiSchemas = ["AbbeRenderVarAPI"]'],
        )
        for aov, data_type, data_format in VARIABLES
    ]
    product = block(
        'def RenderProduct "Product"',
        [
            "rel camera = </World/Camera>",
            "rel orderedVars = [",
            *(f"    </Render/Vars/{aov}>," for aov, _, _ in VARIABLES),
            "]",
            f'token productName = "{name}.exr"',
            'uniform token productType = "raster"',
        ],
    )
    main = block(
        'def RenderSettings "Settings"',
        [
            "uniform double2 abbe:band = (400, 700)",
            'uniform token abbe:integrator = "differentials"',
            "uniform double abbe:referenceWavelength = 587.5618",
            "uniform int abbe:samples = 1",
            "rel camera = </World/Camera>",
            "rel products = </Render/Product>",
            "uniform int2 resolution = (640, 360)",
        ],
        ['prepend apiSchemas = ["AbbeRenderSettingsAPI"]'],
    )
    return block('def Scope "Render"', joined([main, product, block('def Scope "Vars"', joined(variables))]))


def stage(name: str, doc: str, meters_per_unit: str, looks: list[list[str]], prims: list[list[str]]) -> str:
    """The whole layer."""
    world = block(
        'def Xform "World"', joined([*prims, block('def Scope "Looks"', joined(looks))]), ['kind = "component"']
    )
    head = [
        "#usda 1.0",
        "(",
        '    defaultPrim = "World"',
        f'    doc = """{doc}"""',
        f"    metersPerUnit = {meters_per_unit}",
        '    renderSettingsPrimPath = "/Render/Settings"',
        '    upAxis = "Y"',
        ")",
        "",
    ]
    return "\n".join([*head, *world, "", *settings(name), ""])


# --- prism ------------------------------------------------------------------------------------------------------------

PRISM_SIDE, PRISM_HEIGHT = 8.0, 8.0
PRISM_EYE: Vector = (0.0, 0.0, 40.0)


def minimum_deviation() -> float:
    """Angle between the rays before and after a prism of 60° at minimum deviation, radians, at the d line."""
    return 2 * math.asin(ior("SF11", D_LINE) * math.sin(math.radians(30))) - math.radians(60)


def prism() -> str:
    """A prism of 60° at minimum deviation."""
    deviation = minimum_deviation()
    # The camera looks along −z and the ray turns towards +x. Inside it runs half-way between, parallel to the base.
    inside: Vector = (math.sin(deviation / 2), 0.0, -math.cos(deviation / 2))
    base: Vector = (math.cos(deviation / 2), 0.0, math.sin(deviation / 2))
    out: Vector = (math.sin(deviation), 0.0, -math.cos(deviation))
    apothem, radius = PRISM_SIDE / math.sqrt(12), PRISM_SIDE / math.sqrt(3)
    # The middle of the internal ray, half-way up the sides, stands on the camera's axis there where it enters.
    entry = add(add((0.0, 0.0, 0.0), base, -(radius - apothem) / 2 * 0.5), inside, -PRISM_SIDE / 4)
    shift: Vector = (-entry[0], 0.0, 0.0)
    corners = [
        add(shift, base, -radius),
        add(add(shift, base, apothem), inside, PRISM_SIDE / 2),
        add(add(shift, base, apothem), inside, -PRISM_SIDE / 2),
    ]
    half = PRISM_HEIGHT / 2
    points: list[Vector] = [(x, y, z) for y in (-half, half) for x, _, z in corners]
    faces: list[Face] = [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
    faces = outward(points, faces)
    target = add((0.0, 0.0, 0.0), out, 40.0)
    side = cross((0.0, 1.0, 0.0), add((0.0, 0.0, 0.0), out, -1.0))
    prims = [
        camera(PRISM_EYE, (0.0, 0.0, 0.0), 80.0, (1.0, 1000.0)),
        dome_light(0.3),
        rect_light("Key", (25.0, 40.0, 20.0), (20.0, 0.0, -15.0), 20.0, 20.0),
        mesh("Prism", points, faces, "SF11", decimals=6),
        board(
            "Target",
            target,
            side,
            (0.0, 1.0, 0.0),
            steps(-24.0, 24.0, 48),
            steps(-12.0, 12.0, 8),
            ("White", "Ink"),
            chequered,
        ),
        board(
            "Backdrop",
            (0.0, 0.0, -30.0),
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
            steps(-18.0, 18.0, 24),
            steps(-12.0, 12.0, 8),
            ("White", "Blue"),
            chequered,
        ),
        board(
            "Floor",
            (20.0, -half - 0.01, -10.0),
            (1.0, 0.0, 0.0),
            (0.0, 0.0, -1.0),
            steps(-40.0, 60.0, 25),
            steps(-30.0, 40.0, 14),
            ("Grey", "Dark"),
            chequered,
        ),
    ]
    looks = [
        glass("SF11", "SF11", 1),
        paint("White", (0.8, 0.8, 0.8)),
        paint("Ink", (0.05, 0.05, 0.06)),
        paint("Blue", (0.1, 0.2, 0.5)),
        paint("Grey", (0.35, 0.35, 0.35)),
        paint("Dark", (0.12, 0.12, 0.12)),
    ]
    doc = f"""A prism of SF11, 60 degrees, at minimum deviation ({math.degrees(deviation):.2f} degrees at the d line).
    Its left face shows the target that stands to the right, outside the picture. Look for: `dispersion` horizontal and
    even over that face, about a quarter of a pixel per nanometre, while it is 0 beside the prism; `dispersion_r` and
    `dispersion_b` carry the stripes many pixels apart; total reflection in the right face."""
    return stage("prism", doc, "0.01", looks, prims)


def outward(points: Sequence[Vector], faces: Sequence[Face]) -> list[Face]:
    """The faces of a convex body, each wound so that it faces away from the body's middle."""
    middle: Vector = (0.0, 0.0, 0.0)
    for point in points:
        middle = add(middle, point, 1 / len(points))
    result = []
    for face in faces:
        a, b, c = (points[i] for i in face[:3])
        normal = cross(add(b, a, -1.0), add(c, a, -1.0))
        result.append(face if dot(normal, add(a, middle, -1.0)) > 0 else face[::-1])
    return result


# --- ball -------------------------------------------------------------------------------------------------------------


def ball() -> str:
    """A ball lens over stripes."""
    radius = 3.0
    sphere = block(
        'def Sphere "Ball"',
        [
            f"float3[] extent = {tuples([(-radius,) * 3, (radius,) * 3], 1)}",
            "rel material:binding = </World/Looks/NBK7>",
            f"double radius = {radius:g}",
            f"double3 xformOp:translate = (0, {radius:g}, 0)",
            'uniform token[] xformOpOrder = ["xformOp:translate"]',
        ],
        ['prepend apiSchemas = ["MaterialBindingAPI"]'],
    )
    prims = [
        camera((0.0, 5.0, 24.0), (0.0, 2.9, 0.0), 60.0, (1.0, 1000.0)),
        dome_light(0.3),
        rect_light("Key", (-14.0, 22.0, 12.0), (0.0, 0.0, 0.0), 10.0, 20.0),
        sphere,
        board(
            "Floor",
            (0.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            (0.0, 0.0, -1.0),
            steps(-20.0, 20.0, 40),
            [-24.0, 14.0],
            ("White", "Red"),
            chequered,
        ),
        board(
            "Backdrop",
            (0.0, 0.0, -14.0),
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
            steps(-20.0, 20.0, 20),
            steps(0.0, 24.0, 12),
            ("White", "Ink"),
            chequered,
        ),
    ]
    looks = [
        glass("NBK7", "N-BK7", 1, "catalogue"),
        paint("White", (0.8, 0.8, 0.8)),
        paint("Ink", (0.05, 0.05, 0.06)),
        paint("Red", (0.6, 0.08, 0.05)),
    ]
    doc = """A ball lens of N-BK7, an analytic sphere of 60 mm, over a striped floor before a chequered backdrop.
    Look for: the world upside down in the ball; `dispersion` small in the middle and growing towards the rim, pointing
    along the radius, where `dispersion2` and the exact `dispersion_r` and `dispersion_b` part from the first order.
    The glass is named, and comes from the catalogue."""
    return stage("ball", doc, "0.01", looks, prims)


# --- lens -------------------------------------------------------------------------------------------------------------

# The cemented doublet, from the side of the distant conjugate; mm. The prescription published for Thorlabs AC254-100-A.
LENS_RADII = (62.75, -45.71, -128.23)
LENS_THICKNESSES = (4.0, 2.5)
LENS_GLASSES = ("N-BK7", "SF5")
LENS_RIM, LENS_BEVEL = 12.7, 0.3
# Rings of the disc; ring k has 6k points, so triangles are even and the rim has 84 sides.
LENS_RINGS = 14
LENS_OBJECT = 60.0


def sag(radius: float, height: float) -> float:
    """Depth of a spherical surface at a height over the axis."""
    return height * height / (radius + math.copysign(math.sqrt(radius * radius - height * height), radius))


def disc(vertex: float, radius: float, clear: float) -> tuple[list[Vector], list[Vector], list[Face]]:
    """A spherical cap: points, unit normals towards +s, triangles counter-clockwise seen from +s.

    The axis is s, here the third coordinate. Ring k stands at the height clear · k / LENS_RINGS.
    """
    points: list[Vector] = []
    normals: list[Vector] = []
    for ring in range(LENS_RINGS + 1):
        height = clear * ring / LENS_RINGS
        for step in range(max(1, 6 * ring)):
            angle = 2 * math.pi * step / max(1, 6 * ring)
            x, y = height * math.cos(angle), height * math.sin(angle)
            points.append((x, y, vertex + sag(radius, height)))
            # The gradient of the sphere about vertex + radius.
            normals.append((-x / radius, -y / radius, math.sqrt(1 - (height / radius) ** 2)))
    faces: list[Face] = []
    for ring in range(1, LENS_RINGS + 1):
        inner, outer = ring_start(ring - 1), ring_start(ring)
        inner_count, outer_count = max(1, 6 * (ring - 1)), 6 * ring
        for sector in range(6):
            for step in range(ring):
                a = outer + (sector * ring + step) % outer_count
                b = outer + (sector * ring + step + 1) % outer_count
                c = inner + (sector * (ring - 1) + step) % inner_count
                faces.append((a, b, c))
                if step < ring - 1:
                    d = inner + (sector * (ring - 1) + step + 1) % inner_count
                    faces.append((b, d, c))
    return points, normals, faces


def ring_start(ring: int) -> int:
    """Index of the first point of a ring."""
    return 1 + 3 * ring * (ring - 1) if ring else 0


def element(front: tuple[float, float], back: tuple[float, float]) -> tuple[list[Vector], list[Vector], list[Face]]:
    """A closed lens between two surfaces given by vertex and radius.

    The clear apertures have the true normals. Between them and the edge cylinder lies a bevel of 45 degrees; normals
    turn over it, so that every point has one and the mesh needs no second set.
    """
    clear = LENS_RIM - LENS_BEVEL
    points, normals, faces = disc(*front, clear)
    # Seen from outside the front lies towards −s.
    faces = [face[::-1] for face in faces]
    normals = [(-x, -y, -z) for x, y, z in normals]
    count = len(points)
    back_points, back_normals, back_faces = disc(*back, clear)
    points, normals = points + back_points, normals + back_normals
    faces += [(a + count, b + count, c + count) for a, b, c in back_faces]
    sides, rim = 6 * LENS_RINGS, ring_start(LENS_RINGS)
    loops = [list(range(rim, rim + sides))]
    for s in (front[0] + sag(front[1], clear) + LENS_BEVEL, back[0] + sag(back[1], clear) - LENS_BEVEL):
        loops.append(list(range(len(points), len(points) + sides)))
        for step in range(sides):
            angle = 2 * math.pi * step / sides
            points.append((LENS_RIM * math.cos(angle), LENS_RIM * math.sin(angle), s))
            normals.append((math.cos(angle), math.sin(angle), 0.0))
    loops.append(list(range(count + rim, count + rim + sides)))
    for near, far in itertools.pairwise(loops):
        for step in range(sides):
            following = (step + 1) % sides
            faces += [(near[step], near[following], far[following]), (near[step], far[following], far[step])]
    return points, normals, faces


def turned(points: Iterable[Vector]) -> list[Vector]:
    """From the lens's axis s to the stage: s runs along −z, a half turn about y."""
    return [(-x, y, -s) for x, y, s in points]


def mount(low: float, high: float) -> tuple[list[Vector], list[Face]]:
    """A black ring around the lens with a lip over the bevels on both sides."""
    inner, outer, lip = LENS_RIM + 0.2, LENS_RIM + 4.0, LENS_RIM - LENS_BEVEL - 0.1
    profile = [(lip, low - 1), (outer, low - 1), (outer, high + 1), (lip, high + 1), (lip, high), (inner, high)]
    profile += [(inner, low), (lip, low)]
    sides = 48
    points: list[Vector] = []
    for height, s in profile:
        for step in range(sides):
            angle = 2 * math.pi * step / sides
            # Flat sides would cut into a round lens: their middles stand at the given height.
            reach = height / math.cos(math.pi / sides)
            points.append((reach * math.cos(angle), reach * math.sin(angle), s))
    faces: list[Face] = []
    for k in range(len(profile)):
        near, far = k * sides, (k + 1) % len(profile) * sides
        for step in range(sides):
            following = (step + 1) % sides
            faces.append((near + step, near + following, far + following, far + step))
    return points, faces


def lens() -> str:
    """A cemented achromat as a magnifier."""
    first, second = LENS_THICKNESSES
    surfaces = list(zip((0.0, first, first + second), LENS_RADII, strict=True))
    crown, flint = element(surfaces[0], surfaces[1]), element(surfaces[1], surfaces[2])
    ring = mount(0.2, first + second - 0.2)
    target = -(first + second + LENS_OBJECT)
    prims = [
        camera((0.0, 0.0, 250.0), (0.0, 0.0, 0.0), 140.0, (1.0, 10000.0)),
        dome_light(0.3),
        rect_light("Key", (-120.0, 160.0, 60.0), (0.0, 0.0, target), 80.0, 20.0),
        mesh("Crown", turned(crown[0]), crown[2], "NBK7", decimals=4, normals=turned(crown[1])),
        mesh("Flint", turned(flint[0]), flint[2], "SF5", decimals=4, normals=turned(flint[1])),
        mesh("Mount", turned(ring[0]), ring[1], "Black", decimals=4),
        *grid("Paper", "Grid", target, ((-61.0, 61.0), (-27.0, 61.0)), 4.0, 0.5, ("White", "Ink")),
        board(
            "Floor",
            (0.0, -27.0, 0.0),
            (1.0, 0.0, 0.0),
            (0.0, 0.0, -1.0),
            steps(-60.0, 60.0, 12),
            steps(-60.0, 70.0, 13),
            ("Grey", "Dark"),
            chequered,
        ),
    ]
    looks = [
        glass("NBK7", "N-BK7", 2),
        glass("SF5", "SF5", 1),
        paint("White", (0.8, 0.8, 0.8)),
        paint("Ink", (0.05, 0.05, 0.06)),
        paint("Black", (0.02, 0.02, 0.02)),
        paint("Grey", (0.35, 0.35, 0.35)),
        paint("Dark", (0.12, 0.12, 0.12)),
    ]
    radii = ", ".join(f"{r:g}" for r in LENS_RADII)
    doc = f"""A cemented achromat of N-BK7 and SF5, f = 100 mm (radii {radii} mm, thicknesses
    {first:g} and {second:g} mm, as published for Thorlabs AC254-100-A), as a magnifier over a grid of 4 mm. Look for:
    `dispersion` near zero over most of the lens, since red and blue focus together; `dispersion2`, the secondary
    spectrum, is what is left. Both elements have the cemented surface, point for point, and priorities that decide.
    abbe:dispersion:scale = 0 on SF5 shows what it corrects."""
    return stage("lens", doc, "0.001", looks, prims)


# --- gem --------------------------------------------------------------------------------------------------------------

GEM_DIAMETER = 6.5
GEM_TABLE = 0.57
GEM_CROWN_ANGLE, GEM_PAVILION_ANGLE = 34.5, 40.75
GEM_STAR_LENGTH, GEM_LOWER_HALF_LENGTH = 0.5, 0.77
# Thickness at the hills over the diameter; the valleys between them are thinner.
GEM_GIRDLE = 0.036
GEM_GIRDLE_SIDES = 64

Plane = tuple[Vector, float]


def through(a: Vector, b: Vector, c: Vector) -> Plane:
    """The plane of three points, its normal away from the origin."""
    normal = unit(cross(add(b, a, -1.0), add(c, a, -1.0)))
    distance = dot(normal, a)
    return (normal, distance) if distance > 0 else ((-normal[0], -normal[1], -normal[2]), -distance)


def around(radius: float, degrees: float, z: float) -> Vector:
    """A point by radius, azimuth and height."""
    return (radius * math.cos(math.radians(degrees)), radius * math.sin(math.radians(degrees)), z)


def brilliant() -> list[tuple[str, Plane]]:
    """The facets of a round brilliant of girdle radius 1 with a pointed culet: 57 and the girdle. The axis is z.

    Bezels and pavilion mains slope as given and touch the girdle at multiples of 45 degrees. Everything else follows:
    the table's corners lie on the bezels at its width; the stars' tips lie between the bezels, part of the way to the
    girdle; upper halves pass through a star's tip and two hills of the girdle; lower halves end part of the way to the
    culet.
    """
    crown, pavilion = math.radians(GEM_CROWN_ANGLE), math.radians(GEM_PAVILION_ANGLE)
    girdle, half_step = GEM_GIRDLE, math.cos(math.radians(22.5))
    table = girdle + (1 - GEM_TABLE) * math.tan(crown)
    middle = GEM_TABLE * half_step
    star = middle + GEM_STAR_LENGTH * (1 - middle)
    star_height = girdle + math.tan(crown) * (1 - star * half_step)
    lower = 1 - GEM_LOWER_HALF_LENGTH
    lower_height = -girdle - math.tan(pavilion) * (1 - lower * half_step)
    facets: list[tuple[str, Plane]] = [("table", ((0.0, 0.0, 1.0), table))]
    for k in range(8):
        azimuth = 45.0 * k
        bezel = around(math.sin(crown), azimuth, math.cos(crown))
        facets.append(("bezel", (bezel, math.sin(crown) + girdle * math.cos(crown))))
        main = around(math.sin(pavilion), azimuth, -math.cos(pavilion))
        facets.append(("main", (main, math.sin(pavilion) + girdle * math.cos(pavilion))))
        tip = around(star, azimuth + 22.5, star_height)
        corners = around(GEM_TABLE, azimuth, table), around(GEM_TABLE, azimuth + 45, table)
        facets.append(("star", through(*corners, tip)))
        root = around(lower, azimuth + 22.5, lower_height)
        for hill in (azimuth, azimuth + 45):
            upper_girdle = around(1.0, hill, girdle), around(1.0, azimuth + 22.5, girdle)
            lower_girdle = around(1.0, hill, -girdle), around(1.0, azimuth + 22.5, -girdle)
            facets.append(("upper half", through(tip, *upper_girdle)))
            facets.append(("lower half", through(root, *lower_girdle)))
    for k in range(GEM_GIRDLE_SIDES):
        azimuth = 360.0 * (k + 0.5) / GEM_GIRDLE_SIDES
        facets.append(("girdle", (around(1.0, azimuth, 0.0), math.cos(math.pi / GEM_GIRDLE_SIDES))))
    return facets


def polyhedron(planes: Sequence[Plane]) -> tuple[list[Vector], list[Face]]:
    """The convex body that lies behind all planes: its corners, and one polygon a plane, wound to face outwards.

    By clipping a large square of each plane with all the others. Corners nearer than `weld` are one: facets that meet
    in a point by construction do so up to rounding, some 1e-15 of the girdle's radius; no edge is shorter than 1e-3.
    """
    weld = 1e-9
    points: list[Vector] = []
    faces: list[Face] = []

    def index_of(point: Vector) -> int:
        for index, known in enumerate(points):
            if math.dist(point, known) < weld:
                return index
        points.append(point)
        return len(points) - 1

    for number_, (normal, distance) in enumerate(planes):
        helper: Vector = (1.0, 0.0, 0.0) if abs(normal[0]) < 0.5 else (0.0, 1.0, 0.0)
        u = unit(cross(helper, normal))
        v = cross(normal, u)
        foot = add((0.0, 0.0, 0.0), normal, distance)
        polygon = [add(add(foot, u, 4.0 * a), v, 4.0 * b) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for other, (cut, limit) in enumerate(planes):
            if other != number_:
                polygon = clipped(polygon, cut, limit, weld)
        corners = [index_of(point) for point in polygon]
        corners = [corner for k, corner in enumerate(corners) if corner != corners[k - 1]]
        faces.append(tuple(corners))
    return points, faces


def clipped(polygon: list[Vector], normal: Vector, limit: float, weld: float) -> list[Vector]:
    """The part of a convex polygon behind a plane; corners within `weld` of the plane stay."""
    result: list[Vector] = []
    for start, end in itertools.pairwise([*polygon, *polygon[:1]]):
        before, after = dot(normal, start) - limit, dot(normal, end) - limit
        if before <= weld:
            result.append(start)
        if (before < -weld and after > weld) or (before > weld and after < -weld):
            result.append(add(start, add(end, start, -1.0), before / (before - after)))
    return result


def tent(radius: float, bands: int, sectors: int) -> tuple[list[Vector], list[Face], list[tuple[int, int]]]:
    """A dome of panels over the origin, facing inwards: points, faces, and the (band, sector) of each."""
    points: list[Vector] = []
    for band in range(bands):
        elevation = math.pi / 2 * band / bands
        for sector in range(sectors):
            azimuth = 2 * math.pi * sector / sectors
            reach = radius * math.cos(elevation)
            points.append((reach * math.sin(azimuth), radius * math.sin(elevation), reach * math.cos(azimuth)))
    points.append((0.0, radius, 0.0))
    faces: list[Face] = []
    places: list[tuple[int, int]] = []
    for band, sector in itertools.product(range(bands), range(sectors)):
        a, b = band * sectors + sector, band * sectors + (sector + 1) % sectors
        faces.append((b, a, a + sectors, b + sectors) if band < bands - 1 else (b, a, len(points) - 1))
        places.append((band, sector))
    return points, faces, places


def gem() -> str:
    """A brilliant-cut diamond in a tent of panels."""
    points, faces = polyhedron([plane for _, plane in brilliant()])
    radius = GEM_DIAMETER / 2
    # The gem's axis z becomes the stage's y.
    points = [(radius * x, radius * z, -radius * y) for x, y, z in points]
    lift = -min(y for _, y, _ in points) + 1.5
    placing = [
        "float xformOp:rotateX = 25",
        f"double3 xformOp:translate = (0, {number(lift, 4)}, 0)",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]',
    ]
    tent_points, tent_faces, places = tent(90.0, 10, 32)
    panels: dict[str, tuple[str, list[int]]] = {"Bright": ("Bright", []), "Red": ("Red", []), "Blue": ("Blue", [])}
    for face, (band, sector) in enumerate(places):
        if (band + sector) % 2 == 0:
            panels["Bright"][1].append(face)
        elif (band // 2 + sector // 2) % 3:
            panels["Red" if (band // 2 + sector // 2) % 3 == 1 else "Blue"][1].append(face)
    prims = [
        camera((0.0, 26.0, 44.0), (0.0, lift + 0.2, 0.0), 160.0, (1.0, 1000.0)),
        rect_light("Key", (-35.0, 55.0, 30.0), (0.0, lift, 0.0), 15.0, 30.0),
        rect_light("Rim", (40.0, 40.0, -35.0), (0.0, lift, 0.0), 10.0, 30.0),
        mesh("Gem", points, faces, "Diamond", decimals=6, transform=placing),
        board(
            "Ground",
            (0.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            (0.0, 0.0, -1.0),
            steps(-90.0, 90.0, 36),
            steps(-90.0, 90.0, 36),
            ("Black", "Slate"),
            chequered,
        ),
        mesh("Tent", tent_points, tent_faces, "Grey", decimals=4, subsets=panels, is_double_sided=True),
    ]
    looks = [
        glass("Diamond", "Diamond", 1, "shader"),
        paint("Black", (0.02, 0.02, 0.02)),
        paint("Slate", (0.05, 0.05, 0.06)),
        paint("Grey", (0.2, 0.2, 0.2)),
        paint("Bright", (0.9, 0.9, 0.9), 1.5),
        paint("Red", (0.6, 0.05, 0.05)),
        paint("Blue", (0.05, 0.1, 0.6)),
    ]
    doc = f"""A diamond in round brilliant cut, 6.5 mm, 57 facets and a girdle of {GEM_GIRDLE_SIDES}: crown
    {GEM_CROWN_ANGLE:g} degrees, pavilion {GEM_PAVILION_ANGLE:g} degrees, table {100 * GEM_TABLE:g} %;
    it floats over a dark floor in a tent of panels. Look for: fire. After two or more total reflections `dispersion`
    and `dispersion_footprint` differ from facet to facet by orders of magnitude; `total_reflections` draws the facets
    of the pavilion, and `footprint_half_width` tells where the first order ends. The diamond is an AbbeGlass."""
    return stage("gem", doc, "0.001", looks, prims)


STAGES: dict[str, Callable[[], str]] = {"prism": prism, "ball": ball, "lens": lens, "gem": gem}


def main(folder: Path) -> None:
    """Write every stage into an existing folder."""
    for name, make in STAGES.items():
        (folder / f"{name}.usda").write_text(make(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
