"""Side by side with Mitsuba 3 (`pip install mitsuba`): equal scenes, equal images, time to an error.

    python benches/against_mitsuba.py [--width 160] [--dispersion]

Every scene is made for both from one description. Without dispersion both render the same light: their means are
compared, and the error of each against a long render of ours. With `--dispersion`, where Mitsuba has none, its users
render one image per wavelength and sum them: 32 of them here, each a sharp wavelength through glass of its own index.

relMSE = mean((x − ref)² / (ref² + 1e-2)) of linear RGB; t(1e-2) = seconds × relMSE / 1e-2. Compilation is not counted:
Mitsuba renders once before the clock runs. Times are of one process after the other on an otherwise idle machine.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

WALL = 0.6
DEPTH = 12


def quad(a, b, c, d):
    """Two triangles, counter-clockwise from where they are seen."""
    return np.array([a, b, c, d], np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def room():
    """Three walls and a floor, open above and towards the camera."""
    return [
        quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)),
        quad((-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)),
        quad((-2, 0, 2), (-2, 0, -2), (-2, 3, -2), (-2, 3, 2)),
        quad((2, 0, -2), (2, 0, 2), (2, 3, 2), (2, 3, -2)),
    ]


def brilliant(sides=16):
    """A cut stone: table, crown, girdle, pavilion, with flat facets."""

    def ring(radius, y, turn=0.0):
        angles = 2 * np.pi * (np.arange(sides) + turn) / sides
        return [(radius * np.cos(angle), y, radius * np.sin(angle)) for angle in angles]

    points = [*ring(0.55, 1.75), *ring(1.0, 1.45, 0.5), *ring(1.0, 1.40, 0.5), (0, 0.55, 0), (0, 1.75, 0)]
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        a, b, c, d, e, f = i, j, sides + i, sides + j, 2 * sides + i, 2 * sides + j
        faces += [(3 * sides + 1, b, a), (a, b, c), (b, d, c), (c, d, e), (d, f, e), (e, f, 3 * sides)]
    return np.array(points, np.float32), np.array(faces, np.int32)


# No dome: a lamp of Mitsuba blocks it, one of ours blocks nothing.
SCENES = {
    "diffuse": {"glass": None, "dome": 0.0},
    "ball": {"glass": "sphere", "dome": 0.0},
    "gem": {"glass": "gem", "dome": 0.0},
}
EYE, TARGET, FOV = (0.3, 1.9, 6.5), (0.0, 1.1, 0.0), 35.0
LAMP = {"centre": (0.0, 4.0, 0.5), "size": (1.5, 1.5), "radiance": 12.0}


def usd(name, glass_law):
    """The scene as USD text: in millimetres, so that the catalogue's glass absorbs nothing to speak of."""
    scene = SCENES[name]
    forward = np.array(TARGET, float) - EYE
    z = -forward / np.linalg.norm(forward)
    x = np.cross((0, 1, 0), z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    rows = [(*x, 0), (*y, 0), (*z, 0), (*EYE, 1)]
    matrix = ", ".join("(" + ", ".join(repr(float(v)) for v in row) + ")" for row in rows)

    def mesh(path, points, faces, material):
        tuples = ", ".join(f"({p[0]}, {p[1]}, {p[2]})" for p in points.tolist())
        return f"""    def Mesh "{path}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        point3f[] points = [{tuples}]
        int[] faceVertexCounts = {[3] * len(faces)}
        int[] faceVertexIndices = {faces.ravel().tolist()}
        uniform token subdivisionScheme = "none"
        rel material:binding = </World/{material}>
    }}
"""

    def surface(path, inputs, extra=""):
        return f"""    def Material "{path}" (prepend apiSchemas = ["AbbeDispersionAPI"]) {{
        token outputs:mtlx:surface.connect = </World/{path}/Surface.outputs:out>
        {extra}
        def Shader "Surface" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            {inputs}
            token outputs:out
        }}
    }}
"""

    objects = [mesh(f"Wall{i}", *piece, "Grey") for i, piece in enumerate(room())]
    if scene["glass"] == "gem":
        objects.append(mesh("Gem", *brilliant(), "Glass"))
    if scene["glass"] == "sphere":
        objects.append("""    def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        double radius = 0.8
        double3 xformOp:translate = (0, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Glass>
    }
""")
    dome = f"""    def DomeLight "Dome"
    {{
        float inputs:intensity = {scene["dome"]}
    }}
"""
    cx, cy, cz = LAMP["centre"]
    newline = "\n            "
    grey = [f"color3f inputs:base_color = ({WALL}, {WALL}, {WALL})", "float inputs:specular_weight = 0"]
    clear = ["float inputs:transmission_weight = 1", "float inputs:specular_roughness = 0"]
    return f"""#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.001
    upAxis = "Y"
)
def Xform "World" {{
{"".join(objects)}{surface("Grey", newline.join(grey))}
{surface("Glass", newline.join(clear), glass_law)}
{dome if scene["dome"] else ""}    def RectLight "Lamp" {{
        float inputs:intensity = {LAMP["radiance"]}
        float inputs:width = {LAMP["size"][0]}
        float inputs:height = {LAMP["size"][1]}
        double3 xformOp:translate = ({cx}, {cy}, {cz})
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}
    def Camera "Camera" {{
        float focalLength = {0.5 * 36 / np.tan(np.radians(FOV / 2))}
        float horizontalAperture = 36
        float verticalAperture = 27
        float2 clippingRange = (0.01, 1000)
        matrix4d xformOp:transform = ({matrix})
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}
}}
"""


def mitsuba_scene(mi, name, ior, width, integrator="path"):
    """The same for Mitsuba."""
    scene = SCENES[name]
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": WALL}}
    glass = {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0}

    def mesh(label, points, faces, bsdf):
        made = mi.Mesh(label, len(points), len(faces), props=props(bsdf))
        parameters = mi.traverse(made)
        parameters["vertex_positions"] = np.ravel(points)
        parameters["faces"] = np.ravel(faces)
        parameters.update()
        return made

    def props(bsdf):
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(bsdf)
        properties["face_normals"] = True
        return properties

    to_world = mi.ScalarTransform4f
    cx, cy, cz = LAMP["centre"]
    light = {"type": "d65", "scale": LAMP["radiance"]}
    made = {
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": -1, "rr_depth": 5},
        "lamp": {
            "type": "rectangle",
            "to_world": to_world().translate([cx, cy, cz])
            @ to_world().rotate([1, 0, 0], 90)
            @ to_world().scale([LAMP["size"][0] / 2, LAMP["size"][1] / 2, 1]),
            "emitter": {"type": "area", "radiance": light},
        },
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "x",
            "to_world": to_world().look_at(list(EYE), list(TARGET), [0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": width * 3 // 4,
                "rfilter": {"type": "box"},
                "component_format": "float32",
            },
        },
    }
    for i, piece in enumerate(room()):
        made[f"wall{i}"] = mesh(f"wall{i}", *piece, grey)
    if scene["glass"] == "gem":
        made["gem"] = mesh("gem", *brilliant(), glass)
    if scene["glass"] == "sphere":
        made["ball"] = {"type": "sphere", "center": [0, 1, 0], "radius": 0.8, "bsdf": glass}
    if scene["dome"]:
        made["dome"] = {"type": "constant", "radiance": {"type": "d65", "scale": scene["dome"]}}
    return mi.load_dict(made)


def rel_mse(image, reference):
    return float(np.mean((image - reference) ** 2 / (reference**2 + 1e-2)))


def line(name, who, spp, seconds, error, paths):
    print(
        f"{name:8} {who:34} {spp:6} spp {seconds:8.2f} s {paths / seconds / 1e6:7.3f} Mpaths/s "
        f"relMSE {error:9.2e}  t(1e-2) {seconds * error / 1e-2:8.3f} s"
    )


def with_abbe(scene, width, samples, seed=0):
    begin = time.perf_counter()
    film = scene.render(
        width=width,
        samples=samples,
        seed=seed,
        integrator="path",
        aovs=["color"],
        pixel_filter="box",
        pixel_filter_width=1.0,
    )
    return np.array(film["color"][..., :3], np.float64), time.perf_counter() - begin


def with_mitsuba(mi, scene, samples, seed=0):
    begin = time.perf_counter()
    image = np.array(mi.render(scene, spp=samples, seed=seed))
    return image[..., :3].astype(np.float64), time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--reference", type=int, default=2048, help="samples of the long renders")
    parser.add_argument("--dispersion", action="store_true", help="SF11 instead of a constant index of 1.5")
    parser.add_argument("--variants", nargs="*", default=["scalar_spectral", "llvm_ad_spectral"])
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    options = parser.parse_args()
    import mitsuba as mi

    import abbe

    width, height = options.width, options.width * 3 // 4
    law = 'uniform string abbe:glass = "SCHOTT:SF11"' if options.dispersion else "double abbe:dispersion:nd = 1.5"
    for name in options.scenes:
        if options.dispersion and SCENES[name]["glass"] is None:
            continue
        with tempfile.TemporaryDirectory() as folder:
            stage = Path(folder) / f"{name}.usda"
            stage.write_text(usd(name, law))
            ours = abbe.Scene.from_stage(str(stage))
        reference, _ = with_abbe(ours, width, options.reference, seed=1)
        image, seconds = with_abbe(ours, width, options.samples)
        line(name, "abbe path", options.samples, seconds, rel_mse(image, reference), width * height * options.samples)
        for variant in options.variants:
            mi.set_variant(variant)
            if options.dispersion:
                mono(mi, name, variant, options, reference)
                continue
            scene = mitsuba_scene(mi, name, 1.5, width)
            with_mitsuba(mi, scene, 1)
            image, seconds = with_mitsuba(mi, scene, options.samples)
            mean = reference.mean((0, 1)) / image.mean((0, 1))
            error = rel_mse(image, reference)
            line(name, f"mitsuba {variant}", options.samples, seconds, error, width * height * options.samples)
            print(f"{'':8} mean of abbe / mean of mitsuba: {mean.round(4)}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"peak memory of this process {peak:.0f} MB", file=sys.stderr)


def mono(mi, name, variant, options, reference):
    """32 images, one a wavelength, through glass of its index, summed by what the eye makes of them."""
    import abbe

    mi.set_variant("llvm_ad_mono" if variant.startswith("llvm") else "scalar_rgb")
    glass = abbe.glass("SCHOTT:SF11", out_of_range="clamp")
    width, height, count = options.width, options.width * 3 // 4, 32
    edges = np.linspace(380, 720, count + 1)
    responses = [abbe_response(edges[i], edges[i + 1]) for i in range(count)]
    samples = max(1, options.samples // count)
    scenes = [mitsuba_scene(mi, name, float(glass.ior(0.5 * (edges[i] + edges[i + 1]))), width) for i in range(count)]
    for scene in scenes:
        with_mitsuba(mi, scene, 1)
    total, seconds = np.zeros((height, width, 3)), 0.0
    for i, scene in enumerate(scenes):
        image, took = with_mitsuba(mi, scene, samples, seed=i)
        total += image[..., :1] * responses[i]
        seconds += took
    print(f"{'':8} mean of abbe / mean of mitsuba: {(reference.mean((0, 1)) / total.mean((0, 1))).round(4)}")
    line(
        name,
        f"mitsuba {mi.variant()}, {count} × mono",
        samples * count,
        seconds,
        rel_mse(total, reference),
        width * height * samples * count,
    )


def abbe_response(low, high):
    """∫ of the R, G, B responses times D65 over a band: what a grey light of that band looks like."""
    import colour

    shape = colour.SpectralShape(360, 830, 1)
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    d65 = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values
    inside = (shape.wavelengths >= low) & (shape.wavelengths < high)
    xyz = (cmfs.values * d65[:, None] * inside[:, None]).sum(0) / (cmfs.values[:, 1] * d65).sum()
    return colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ xyz


if __name__ == "__main__":
    main()
