"""Point instancers at scale: time from stage to scene to tree, and memory, each stage in a process of its own.

    python benches/instances.py [COUNT]

COUNT instances of one prototype (a million unless given), and the same number by nesting. Reading is compared with what
any reader has to do: opening the stage and asking USD for the transforms. Memory is that of the whole process at its
peak, less what it was with `abbe` and USD imported; "kept" is what is left when the tree is built.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def write(folder: Path, count: int) -> list[Path]:
    """Write a flat stage and a nested one with ``count`` instances each."""
    import numpy as np
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    random = np.random.default_rng(1)

    def instancer(stage: Usd.Stage, path: str, prototype: str, number: int, size: float) -> None:
        prim = UsdGeom.PointInstancer.Define(stage, path)
        prim.CreatePrototypesRel().SetTargets([Sdf.Path(prototype)])
        prim.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.zeros(number, np.int32)))
        positions = random.random((number, 3), dtype=np.float32) * np.float32(size)
        prim.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
        turns = random.normal(size=(number, 4)).astype(np.float16)
        prim.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns / np.linalg.norm(turns, axis=1)[:, None]))

    def stage(name: str) -> Usd.Stage:
        stage = Usd.Stage.CreateNew(str(folder / name))
        camera = UsdGeom.Camera.Define(stage, "/Camera")
        camera.AddTranslateOp().Set(Gf.Vec3d(200, 200, 900))
        UsdGeom.Sphere.Define(stage, "/P/Ball").CreateRadiusAttr(0.5)
        return stage

    flat = stage("flat.usdc")
    instancer(flat, "/Scatter", "/P/Ball", count, 400.0)
    side = math.isqrt(count)
    nested = stage("nested.usdc")
    instancer(nested, "/P/Inner", "/P/Ball", side, 40.0)
    instancer(nested, "/Outer", "/P/Inner", count // side, 360.0)
    for one in (flat, nested):
        # Prototypes under an `over` are not drawn where they stand.
        one.GetPrimAtPath("/P").SetSpecifier(Sdf.SpecifierOver)
        one.Save()
    return [folder / "flat.usdc", folder / "nested.usdc"]


def resident() -> float:
    """Return the resident memory of this process, MB; its peak where the system does not say."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(path: str) -> None:
    """Measure one stage and print the table's row."""
    from pxr import Usd, UsdGeom

    import abbe
    from abbe.usd import describe

    def usd_alone() -> None:
        stage = Usd.Stage.Open(path)
        for prim in stage.Traverse():
            if prim.IsA(UsdGeom.PointInstancer):
                instancer = UsdGeom.PointInstancer(prim)
                instancer.ComputeInstanceTransformsAtTime(0, 0, instancer.IncludeProtoXform, instancer.ApplyMask)

    abbe.render(path, width=1, height=1, aovs=["depth"], frame=0, mask=["/Camera"])
    before = resident()
    times = {}
    for name, work in (("USD alone", usd_alone), ("description", lambda: describe(path, frame=0))):
        start = time.perf_counter()
        work()
        times[name] = time.perf_counter() - start
    start = time.perf_counter()
    scene = abbe.Scene.from_stage(path, frame=0)
    times["scene"] = time.perf_counter() - start
    loaded = resident() - before
    start = time.perf_counter()
    scene.render(width=1, height=1, aovs=["depth"])
    times["tree"] = time.perf_counter() - start
    start = time.perf_counter()
    scene.render(width=640, height=360, aovs=["depth", "instance_id"])
    times["640 x 360"] = time.perf_counter() - start - times["tree"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before
    row = "  ".join(f"{name} {seconds:6.2f} s" for name, seconds in times.items())
    print(f"{Path(path).stem:8}{row}   scene {loaded:5.0f} MB, peak {peak:5.0f} MB")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        measure(sys.argv[2])
    else:
        with tempfile.TemporaryDirectory() as folder:
            for stage_path in write(Path(folder), int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000):
                subprocess.run([sys.executable, __file__, "--measure", str(stage_path)], check=True)
