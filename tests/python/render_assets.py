"""Render each stage named on standard input, tiny; write one line of JSON when a stage begins and one when it ends.

A process of its own for `test_assets`: a crash or a hang then costs one stage, and is seen.
"""

import json
import sys
from typing import Any

import numpy as np

import abbe  # Before USD opens anything.

# ruff: isort: split
from pxr import Gf, Usd, UsdGeom

# Solids that are rendered; older versions of USD lack some.
_NAMES = ("Sphere", "Cube", "Plane", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1")
SOLIDS = tuple(getattr(UsdGeom, name) for name in _NAMES if hasattr(UsdGeom, name))


def _bound(path: str) -> Any:
    """The corners of a box around what is rendered, from points, sizes, transforms: authored extents may be wrong."""
    stage = Usd.Stage.Open(path)
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    time = Usd.TimeCode.EarliestTime() if start is None else Usd.TimeCode(start)
    boxes = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh):
            # Some files have something else there, which is warned of and left out.
            points = np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(time))
            if points.ndim != 2 or not len(points):
                continue
            extent = [points.min(axis=0), points.max(axis=0)]
        elif any(prim.IsA(schema) for schema in SOLIDS):
            extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)
        else:
            continue
        world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time)
        box = Gf.BBox3d(Gf.Range3d(*(Gf.Vec3d(*map(float, corner)) for corner in extent)), world)
        boxes.append([box.ComputeAlignedRange().GetMin(), box.ComputeAlignedRange().GetMax()])
    corners = np.array(boxes)
    return corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)


def _outside(film: Any, path: str) -> float:
    """How far first hits are outside of the stage's bound, relative to its size and place."""
    seen = film["position"][film["prim_id"][..., 0] > 0]
    if not len(seen):
        return 0.0
    low, high = _bound(path)
    scale = np.abs([low, high]).max()
    return float(max((low - seen.min(axis=0)).max(), (seen.max(axis=0) - high).max()) / scale)


def _framing(film: Any, camera: dict[str, Any], path: str) -> float | None:
    """How far first hits are from the pixels that see them, as USD's own frustum projects them, at most, in pixels.

    None where the stage has no camera, or its settings ask for another shape of image than the camera's.
    """
    stage = Usd.Stage.Open(path)
    prim = UsdGeom.Camera(stage.GetPrimAtPath(camera["path"])) if camera["path"] else None
    if not prim:
        return None
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    theirs = prim.GetCamera(Usd.TimeCode.EarliestTime() if start is None else Usd.TimeCode(start))
    width, height = film.resolution
    # A height in whole pixels is as near to the camera's aspect as it can be.
    if abs(width / theirs.aspectRatio - height) > 1.0:
        return None
    frustum = theirs.frustum
    rows, columns = np.nonzero(film["prim_id"][..., 0] > 0)
    if not len(rows):
        return None
    points = np.concatenate([film["position"][rows, columns].astype(float), np.ones((len(rows), 1))], axis=1)
    clip = points @ np.array(frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix())
    ndc = clip[:, :2] / clip[:, 3:]
    # The aperture is expanded to the image's shape.
    aspect = width / height
    ndc *= [min(1.0, theirs.aspectRatio / aspect), min(1.0, aspect / theirs.aspectRatio)]
    seen = np.stack([(ndc[:, 0] + 1.0) * 0.5 * width, (1.0 - ndc[:, 1]) * 0.5 * height], axis=1)
    # Pixel centres are at + 0.5.
    return float(np.abs(seen - np.stack([columns + 0.5, rows + 0.5], axis=1)).max())


def _render(path: str) -> dict[str, Any]:
    try:
        scene = abbe.Scene.from_stage(path)
        film = scene.render(width=32, samples=1, aovs=["position", "prim_id"])
    except abbe.StageError as error:
        return {"error": str(error)}
    except BaseException as error:
        return {"fault": f"{type(error).__name__}: {error}"}
    warnings = sorted({warning["kind"] for warning in film.statistics["warnings"]})
    seen = float((film["prim_id"] > 0).mean())
    framing = _framing(film, scene.document["cameras"][film.statistics["plan"]["camera"]], path)
    return {
        "resolution": film.resolution,
        "seen": seen,
        "outside": _outside(film, path),
        "framing": framing,
        "warnings": warnings,
    }


for line in sys.stdin:
    print(json.dumps({"begin": line.rstrip("\n")}), flush=True)
    print(json.dumps(_render(line.rstrip("\n"))), flush=True)
