"""What becomes of every material of the shared assets, row by row as it was looked over by a person.

`ABBE_WRITE_GOLDEN=1` writes the table anew; the change of each of its rows is then to be explained in the commit.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pxr.Usd", reason="stages need usd-core")

import abbe  # Before USD opens anything.

# ruff: isort: split
from pxr import Gf, Usd, UsdGeom, UsdShade
from test_assets import ERRORS, FOLDER, _stages

TABLE = Path(__file__).with_name("golden") / "materials.tsv"
HEADER = "# source\tmaterial\tkind\tn_d\tV_d\twhy"
SCRATCH = "/AbbeGoldenMaterials"


def _bind_all(stage: Any) -> None:
    """Bind every material outside of prototypes to a triangle of its own, in the session."""
    paths = [str(prim.GetPath()) for prim in stage.Traverse() if prim.IsA(UsdShade.Material)]
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for i, path in enumerate(paths):
            mesh = UsdGeom.Mesh.Define(stage, f"{SCRATCH}/Triangle{i}")
            mesh.CreatePointsAttr([Gf.Vec3f(0, 0, 0), Gf.Vec3f(1, 0, 0), Gf.Vec3f(0, 1, 0)])
            mesh.CreateFaceVertexCountsAttr([3])
            mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
            material = UsdShade.Material(stage.GetPrimAtPath(path))
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _rows(source: str, stage: Any) -> Iterator[str]:
    _bind_all(stage)
    for decided in abbe.Scene.from_stage(stage).plans(aovs=["depth"])[0].fields["materials"]:
        nd = "" if decided["nd"] is None else f"{decided['nd']:.5f}"
        vd = "" if decided["vd"] is None else f"{decided['vd']:.2f}"
        why = re.sub(r"\s+", " ", decided["why"])
        yield "\t".join([source, decided["what"], decided["kind"], nd, vd, why])


def _documents() -> list[Path]:
    return sorted(FOLDER.rglob("*.mtlx")) if FOLDER else []


def _of_document(path: Path) -> Any:
    """A stage with the materials of a MaterialX document."""
    from abbe.usd.description import Diagnostics
    from abbe.usd.mtlx import DocumentError, read_document

    try:
        return Usd.Stage.Open(read_document(str(path), Diagnostics()))
    except DocumentError:
        return None


@pytest.fixture(scope="module")
def rows() -> list[str]:
    """The table as it is now."""
    if FOLDER is None or not FOLDER.is_dir():
        pytest.skip("NO SHARED ASSETS: their materials are not looked at; set ABBE_ASSETS to their folder")
    pytest.importorskip("MaterialX", reason="MaterialX documents need materialx")
    found: list[str] = []
    for path in _stages():
        source = path.relative_to(FOLDER).as_posix()
        if source not in ERRORS:
            found += _rows(source, Usd.Stage.Open(str(path)))
    for path in _documents():
        stage = _of_document(path)
        if stage is not None:
            found += _rows(path.relative_to(FOLDER).as_posix(), stage)
    return found


def test_every_material_of_the_assets_is_what_the_golden_table_says(rows: list[str]) -> None:
    if os.environ.get("ABBE_WRITE_GOLDEN"):
        TABLE.parent.mkdir(exist_ok=True)
        TABLE.write_text("\n".join([HEADER, *rows]) + "\n")
    header, *golden = TABLE.read_text().splitlines()
    assert header == HEADER
    changed = sorted(set(rows) ^ set(golden))
    assert not changed, "\n".join(changed[:20])
    assert rows == golden


def test_the_golden_table_knows_glass_metal_and_paper() -> None:
    """Laws that no table can outvote: what is named glass is glass, what is named after a metal is none."""
    _, *golden = (line.split("\t") for line in TABLE.read_text().splitlines())
    kinds = {(source, material): kind for source, material, kind, *_ in golden}
    clear = ["glass", "diamond", "water", "ice", "quartz", "sapphire", "salt", "plastic_acrylic", "plastic_pc"]
    metals = ["gold", "silver", "copper", "iron", "titanium", "chromium", "nickel", "platinum", "mercury"]
    opaque = ["office_paper", "brick", "concrete", "charcoal", "chocolate", "velvet"]
    by_name = {
        source.removeprefix("OpenPBR_examples/open_pbr_").removesuffix(".mtlx"): kind
        for (source, _), kind in kinds.items()
        if source.startswith("OpenPBR_examples/")
    }
    assert {by_name[name] for name in clear if name in by_name} == {"dielectric"}
    assert {by_name[name] for name in metals if name in by_name} <= {"mirror", "opaque"}
    assert {by_name[name] for name in opaque if name in by_name} == {"opaque"}
