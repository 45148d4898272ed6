"""EXR files as abbe writes them, made by hand, and a few rows of the AOV table."""

import json
import struct

import numpy as np


def _row(name, channels, unit, sample="float", merge="mean"):
    return {
        "name": name,
        "channels": list(channels),
        "sample": sample,
        "unit": unit,
        "merge": merge,
        "has_validity": merge == "mean",
    }


TABLE = [
    _row("dispersion", "XY", "pixel/nm"),
    _row("ddirection_dlambda", "XYZ", "1/nm"),
    _row("dispersion_footprint", "X", "stage unit"),
    _row("footprint_half_width", "X", "nm"),
    _row("ior", "X", "1"),
    _row("normal", "XYZ", "1"),
    _row("position", "XYZ", "stage unit"),
    _row("uv", "UV", "1"),
    _row("depth", "Z", "stage unit"),
    _row("interfaces", "I", "count", "uint", "first"),
    _row("total_reflections", "I", "count", "uint", "first"),
    _row("prim_id", "I", "index", "uint", "first"),
]

HEADER = {
    "abbe:version": "0.1.0",
    "abbe:stage": "ball.usda",
    "abbe:integrator": "differentials",
    "abbe:referenceWavelength": 587.5618,
    "abbe:referenceWavelengthText": "587.5618 nm",
    "abbe:band": "400:700 nm",
    "abbe:channelWavelengths": "611.4 549.1 464.3 nm",
    "abbe:axes": "pixel vectors: +x right, +y up, full-raster pixels",
    "abbe:sign": "dispersion: motion of the feature per nm of increasing wavelength",
    "abbe:metersPerUnit": 0.01,
    "abbe:upAxis": "Y",
    "abbe:samples": 1,
    "abbe:seed": 0,
    "abbe:settingsHash": "5f2c",
    "abbe:sampleRange": "0:1:1",
    "abbe:primManifest": json.dumps(["/World/Ball", "/World/Floor"]),
    "abbe:materials": "[]",
}

WIDTH, HEIGHT = 40, 24


def sound():
    """Return (channels, header) of a file in which everything is as it must be: a ball before nothing."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    x, y = (x + 0.5 - WIDTH / 2) / 10, -(y + 0.5 - HEIGHT / 2) / 10
    ball = np.hypot(x, y) < 1
    z = np.sqrt(np.clip(1 - x * x - y * y, 0, None))
    vectors = {
        "dispersion": (0.1 * x, 0.1 * y),
        "ddirection_dlambda": (1e-5 * x, 1e-5 * y, 0 * x),
        "dispersion_footprint": (0.2 * np.hypot(x, y),),
        "footprint_half_width": (150 - 20 * np.hypot(x, y),),
        "ior": (1.5168 + 0 * x,),
        "normal": (x, y, z),
        "position": (x, y, z),
        "uv": (x, y),
        "depth": (5 - z,),
    }
    channels = {}
    for row in TABLE:
        name = row["name"]
        if row["has_validity"]:
            for suffix, values in zip(row["channels"], vectors[name], strict=True):
                channels[f"{name}.{suffix}"] = np.where(ball, values, 0).astype(np.float32)
            channels[f"{name}.valid"] = ball.astype(np.float32)
    channels["interfaces.I"] = np.where(ball, 2, 0).astype(np.uint32)
    channels["total_reflections.I"] = np.zeros_like(channels["interfaces.I"])
    channels["prim_id.I"] = ball.astype(np.uint32)
    channels["Z"] = channels["depth.Z"].copy()
    header = dict(HEADER)
    header["abbe:layers"] = json.dumps([{"name": row["name"], "aov": row["name"]} for row in TABLE])
    header.update({f"abbe:unit:{row['name']}": row["unit"] for row in TABLE})
    return channels, header


def write(path, channels, header, *, origin=(0, 0), raster=(WIDTH, HEIGHT)):
    """Write channels (2-D arrays by name, float32 or uint32) and header attributes as an uncompressed scan-line EXR.

    By the file layout itself: a library that writes would convert types and rename attributes on the way.
    """
    names = sorted(channels, key=str.encode)
    height, width = channels[names[0]].shape
    x, y = origin

    def attribute(name, kind, value):
        return b"%s\0%s\0%s%s" % (name.encode(), kind, struct.pack("<i", len(value)), value)

    kinds = {np.dtype(np.uint32): 0, np.dtype(np.float32): 2}
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<4i", kinds[channels[name].dtype], 0, 1, 1) for name in names
    )
    head = struct.pack("<II", 20000630, 2 | 1 << 10)
    head += attribute("channels", b"chlist", listed + b"\0")
    head += attribute("compression", b"compression", b"\0")
    head += attribute("dataWindow", b"box2i", struct.pack("<4i", x, y, x + width - 1, y + height - 1))
    head += attribute("displayWindow", b"box2i", struct.pack("<4i", 0, 0, raster[0] - 1, raster[1] - 1))
    head += attribute("lineOrder", b"lineOrder", b"\0")
    head += attribute("pixelAspectRatio", b"float", struct.pack("<f", 1.0))
    head += attribute("screenWindowCenter", b"v2f", struct.pack("<2f", 0.0, 0.0))
    head += attribute("screenWindowWidth", b"float", struct.pack("<f", 1.0))
    for name, value in header.items():
        kind, encode = {
            str: (b"string", str.encode),
            int: (b"int", struct.Struct("<i").pack),
            float: (b"double", struct.Struct("<d").pack),
        }[type(value)]
        head += attribute(name, kind, encode(value))
    head += b"\0"
    lines = [b"".join(channels[name][row].tobytes() for name in names) for row in range(height)]
    first = len(head) + 8 * height
    offsets = [first + row * (8 + len(lines[0])) for row in range(height)]
    blocks = [struct.pack("<ii", y + row, len(line)) + line for row, line in enumerate(lines)]
    path.write_bytes(head + struct.pack(f"<{height}Q", *offsets) + b"".join(blocks))
