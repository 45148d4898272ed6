"""From stage to ready scene, against what any reader has to do: open the stage and read the same attributes with USD.

    python benches/scene.py [ROUNDS]

Each stage in a process of its own, caches warm. The ways are taken in turn, so that a busy machine slows them alike;
the median of the rounds' ratios counts. "description" is the bridge, "scene" the checks and the compiled scene without
trees over triangles, which take the time that is said beside them. Peak memory is that of the whole process.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

COUNT = 1_000_000


def write(folder: Path) -> list[Path]:
    """Write a mesh of a million triangles, a million instances, 500 native instances of 90 meshes, 20,000 meshes."""
    import numpy as np
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    def begin(name: str) -> Any:
        stage = Usd.Stage.CreateNew(str(folder / f"{name}.usdc"))
        UsdGeom.Camera.Define(stage, "/Camera").AddTranslateOp().Set(Gf.Vec3d(0, 0, 1000))
        return stage

    def define_mesh(stage: Any, path: str, points: Any, corners: Any) -> Any:
        mesh = UsdGeom.Mesh.Define(stage, path)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(corners) // 3, 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
        mesh.CreateSubdivisionSchemeAttr("none")
        return mesh

    mesh = begin("mesh")
    side = 707
    u, v = np.meshgrid(np.linspace(0, 1, side + 1), np.linspace(0, 1, side + 1), indexing="ij")
    points = np.stack([u, v, 0.05 * np.sin(20 * u) * np.cos(17 * v)], -1).astype(np.float32).reshape(-1, 3)
    i = np.arange(side * side) // side * (side + 1) + np.arange(side * side) % side
    corners = np.stack([i, i + side + 1, i + side + 2, i, i + side + 2, i + 1], -1).astype(np.int32).ravel()
    define_mesh(mesh, "/Mesh", points, corners)

    scatter = begin("instances")
    random = np.random.default_rng(1)
    UsdGeom.Sphere.Define(scatter, "/P/Ball").CreateRadiusAttr(0.5)
    scatter.GetPrimAtPath("/P").SetSpecifier(Sdf.SpecifierOver)
    instancer = UsdGeom.PointInstancer.Define(scatter, "/Scatter")
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path("/P/Ball")])
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.zeros(COUNT, np.int32)))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(random.random((COUNT, 3), dtype=np.float32) * 400))
    turns = random.normal(size=(COUNT, 4)).astype(np.float16)
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns / np.linalg.norm(turns, axis=1)[:, None]))

    triangle = np.eye(3, dtype=np.float32), np.arange(3, dtype=np.int32)
    native = begin("native")
    for k in range(90):
        define_mesh(native, f"/Asset/Group{k // 9}/Mesh{k % 9}", *triangle).AddTranslateOp().Set(Gf.Vec3d(k, 0, 0))
    native.GetPrimAtPath("/Asset").SetSpecifier(Sdf.SpecifierOver)
    for k in range(500):
        prim = UsdGeom.Xform.Define(native, f"/World/Instance{k}")
        prim.AddTranslateOp().Set(Gf.Vec3d(0, k, 0))
        prim.GetPrim().GetReferences().AddInternalReference("/Asset")
        prim.GetPrim().SetInstanceable(True)

    plain = begin("plain")
    for k in range(20_000):
        define_mesh(plain, f"/World/Group{k // 100}/Mesh{k}", *triangle).AddTranslateOp().Set(Gf.Vec3d(k, 0, 0))

    for stage in (mesh, scatter, native, plain):
        stage.Save()
    return [folder / f"{name}.usdc" for name in ("mesh", "instances", "native", "plain")]


def usd_alone(path: str) -> int:
    """Open a stage, read the arrays of every mesh, compute every transform; return the number of prims."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(path)
    transforms = UsdGeom.XformCache(0)
    seen, count = set(), 0
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        count += 1
        if prim.IsA(UsdGeom.PointInstancer):
            instancer = UsdGeom.PointInstancer(prim)
            instancer.ComputeInstanceTransformsAtTime(0, 0, instancer.IncludeProtoXform, instancer.ApplyMask)
        if not prim.IsA(UsdGeom.Mesh):
            continue
        transforms.GetLocalToWorldTransform(prim)
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        if source not in seen:
            seen.add(source)
            mesh = UsdGeom.Mesh(prim)
            for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()):
                attribute.Get(0)
    return count


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return seconds and result."""
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def measure(path: str, rounds: int) -> None:
    """Measure one stage and print the table's row."""
    from abbe import _core
    from abbe.usd import describe

    def build(description: Any) -> Any:
        return _core.Scene(description.to_json(), description.arrays)

    usd_alone(path)
    build(describe(path, frame=0))
    rows = []
    for _ in range(rounds):
        alone, prims = timed(lambda: usd_alone(path))
        reading, description = timed(lambda: describe(path, frame=0))
        building, scene = timed(lambda description=description: build(description))
        trees = scene.tree_seconds()
        rows.append((alone, reading, building - trees, trees, (reading + building - trees) / alone, reading / prims))
        del description, scene
    alone, reading, building, trees, ratio, each = map(statistics.median, zip(*rows, strict=True))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cells = (f"{alone:.3f}", f"{reading:.3f}", f"{building:.3f}", f"{ratio:.2f}", f"{trees:.2f}", f"{peak:.0f}")
    cells += (f"{1e6 * each:.0f}" if prims > 100 else "",)
    print(f"| {Path(path).stem:9} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2], int(sys.argv[3]))
    else:
        names = ("stage", "USD, s", "description, s", "scene, s", "ratio", "trees, s", "peak, MB", "µs a prim")
        print("| " + " | ".join(names) + " |\n|" + "---|" * len(names), flush=True)
        with tempfile.TemporaryDirectory() as temporary:
            for stage_path in write(Path(temporary)):
                command = [sys.executable, __file__, "--measure", str(stage_path), *(sys.argv[1:] or ["11"])]
                subprocess.run(command, check=True)
