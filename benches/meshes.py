"""Large meshes: time and memory from stage to tree, each stage in a process of its own.

    python benches/meshes.py [TRIANGLES]

One wavy sheet of so many triangles (ten million unless given) three ways: as authored, with normals and texture
coordinates at every corner, and as the subdivision surface of a control mesh sixteen times coarser. Memory is that of
the whole process, less what it was with `abbe` and USD imported: at its peak, and "kept" when the tree is built and the
stage is closed.
"""

from __future__ import annotations

import gc
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def write(folder: Path, triangles: int) -> list[Path]:
    """Write the three stages."""
    import numpy as np
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    def sheet(name: str, side: int) -> tuple[Usd.Stage, UsdGeom.Mesh, np.ndarray]:
        stage = Usd.Stage.CreateNew(str(folder / name))
        UsdGeom.Camera.Define(stage, "/Camera").AddTranslateOp().Set(Gf.Vec3d(0.5, 0.5, 3))
        mesh = UsdGeom.Mesh.Define(stage, "/Sheet")
        x, y = np.meshgrid(*2 * [np.linspace(0, 1, side + 1, dtype=np.float32)])
        points = np.stack([x, y, np.float32(0.05) * np.sin(20 * x) * np.cos(17 * y)], axis=2).reshape(-1, 3)
        corner = np.arange((side + 1) ** 2, dtype=np.int32).reshape(side + 1, side + 1)[:-1, :-1].ravel()
        faces = corner[:, None] + np.array([0, 1, side + 2, side + 1], np.int32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 4, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
        return stage, mesh, points[faces.ravel()]

    side = math.isqrt(triangles // 2)
    plain, mesh, corners = sheet("plain.usdc", side)
    mesh.CreateSubdivisionSchemeAttr("none")
    plain.Save()
    shaded, mesh, _ = sheet("shaded.usdc", side)
    mesh.CreateSubdivisionSchemeAttr("none")
    primvars = UsdGeom.PrimvarsAPI(mesh)
    types = Sdf.ValueTypeNames
    st = primvars.CreatePrimvar("st", types.TexCoord2fArray, "faceVarying")
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(corners[:, :2])))
    normals = np.stack([-np.cos(20 * corners[:, 0]), np.sin(17 * corners[:, 1]), np.ones(len(corners))], axis=1)
    normal = primvars.CreatePrimvar("normals", types.Normal3fArray, "faceVarying")
    normal.Set(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    shaded.Save()
    subdivided, mesh, _ = sheet("subdivided.usdc", side // 4)
    level = mesh.GetPrim().CreateAttribute("abbe:subdivision:level", types.Int)
    level.Set(2)
    subdivided.Save()
    return [folder / f"{name}.usdc" for name in ("plain", "shaded", "subdivided")]


def resident() -> float:
    """Return the resident memory of this process, MB; its peak where the system does not say."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(path: str) -> None:
    """Load and render one stage and print the table's row."""
    from pxr import Usd, UsdGeom

    import abbe
    from abbe.usd import describe

    def usd_alone() -> None:
        stage = Usd.Stage.Open(path)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Sheet"))
        primvars = [primvar.GetAttr() for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvars()]
        for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexIndicesAttr(), *primvars):
            attribute.Get()

    abbe.render(path, width=1, height=1, aovs=["depth"], frame=0, mask=["/Camera"])
    before = resident()
    times = {}
    for name, work in (("USD alone", usd_alone), ("description", lambda: describe(path, frame=0))):
        start = time.perf_counter()
        work()
        times[name] = time.perf_counter() - start
    start = time.perf_counter()
    scene = abbe.Scene.from_stage(path, frame=0)
    times["scene and tree"] = time.perf_counter() - start
    film = scene.render(width=1, height=1, aovs=["depth"])
    gc.collect()
    kept = resident() - before
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before
    triangles = film.statistics["scene"]["triangles"]
    row = "  ".join(f"{name} {seconds:6.2f} s" for name, seconds in times.items())
    size = "  ".join(
        f"{name} {memory:5.0f} MB = {memory * 2**20 / triangles:4.0f} bytes a triangle"
        for name, memory in (("kept", kept), ("peak", peak))
    )
    print(f"{Path(path).stem:11}{triangles:9} triangles  {row}   {size}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2])
    else:
        with tempfile.TemporaryDirectory() as folder:
            for stage_path in write(Path(folder), int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000):
                subprocess.run([sys.executable, __file__, "--measure", str(stage_path)], check=True)
