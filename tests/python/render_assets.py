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


def _render(path: str) -> dict[str, Any]:
    try:
        film = abbe.render(path, width=32, samples=1, aovs=["position", "prim_id"])
    except abbe.StageError as error:
        return {"error": str(error)}
    except BaseException as error:
        return {"fault": f"{type(error).__name__}: {error}"}
    warnings = sorted({warning["kind"] for warning in film.statistics["warnings"]})
    seen = float((film["prim_id"] > 0).mean())
    return {"resolution": film.resolution, "seen": seen, "outside": _outside(film, path), "warnings": warnings}


for line in sys.stdin:
    print(json.dumps({"begin": line.rstrip("\n")}), flush=True)
    print(json.dumps(_render(line.rstrip("\n"))), flush=True)
