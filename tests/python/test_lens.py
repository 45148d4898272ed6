"""Lens elements: prescriptions on prims, and tables of them."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr")
from description_schema import validate
from pxr import Sdf, Usd, UsdGeom

from abbe import StageError
from abbe.prescription import read_prescription, stage_text
from abbe.usd import describe

STAGES = Path(__file__).resolve().parents[2] / "stages"
DOUBLET = """\
radius, thickness, glass, nd, vd, semi_diameter, conic, a4, a6, stop
62.75, 4, N-BK7, , , 12.7, , , ,
-45.71, 2.5, , 1.67271, 32.25, 12.7, -0.5, 1e-6, ,
-128.23, 10, , , , 12, , , -2e-9,
, 90, , , , 8, , , , stop
"""


def lens(stage, path, kind="Mesh", **values):
    prim = stage.DefinePrim(path, kind)
    for name, value in values.items():
        prim.CreateAttribute("abbe:lens:" + name.replace("__", ":"), _type(value)).Set(value)
    return prim


def _type(value):
    return Sdf.ValueTypeNames.DoubleArray if isinstance(value, list) else Sdf.ValueTypeNames.Double


BALL = {
    "thickness": 4.0,
    "front__curvature": 0.5,
    "front__semiDiameter": 1.5,
    "back__curvature": -0.5,
    "back__semiDiameter": 1.0,
}


def test_a_prescription_takes_the_place_of_the_mesh():
    stage = Usd.Stage.CreateInMemory()
    lens(stage, "/Lens", front__aspheres=[1e-3, -1e-4], **BALL)
    description = describe(stage)
    validate(description.document, description.arrays)
    assert description.document["shapes"] == [
        {
            "lens": {
                "path": "/Lens",
                "thickness": 4.0,
                "front": {"curvature": 0.5, "conic": 0.0, "aspheres": [1e-3, -1e-4], "semi_diameter": 1.5},
                "back": {"curvature": -0.5, "conic": 0.0, "aspheres": [], "semi_diameter": 1.0},
            }
        }
    ]
    assert not description.arrays


def test_what_stands_below_an_xform_with_a_prescription_is_its_stand_in():
    stage = Usd.Stage.CreateInMemory()
    lens(stage, "/Lens", "Xform", **BALL)
    stage.DefinePrim("/Lens/StandIn", "Sphere")
    description = describe(stage)
    assert [item["path"] for item in description.document["groups"][0]["items"]] == ["/Lens"]


def test_a_lens_with_a_value_that_is_not_finite_is_left_out_and_named():
    for name in ("thickness", "back__conic", "front__semiDiameter"):
        stage = Usd.Stage.CreateInMemory()
        lens(stage, "/Lens", **{**BALL, name: float("nan")})
        attribute = "abbe:lens:" + name.replace("__", ":")
        description = describe(stage)
        assert not description.document["shapes"]
        warning = next(warning for warning in description.warnings if warning["kind"] == "broken-prim")
        assert warning["places"] == [f"</Lens>.{attribute}"]
        assert warning["message"] == "is nan, which is no finite number; it is left out"


def test_a_table_becomes_a_stage_that_says_the_same(tmp_path):
    table = tmp_path / "doublet.csv"
    table.write_text(DOUBLET)
    prescription = read_prescription(table)
    assert prescription.image == 106.5 and prescription.surfaces[-1].is_stop
    path = tmp_path / "doublet.usda"
    path.write_text(stage_text(prescription))
    description = describe(path)
    validate(description.document, description.arrays)
    assert description.warnings == []
    first, second = (shape["lens"] for shape in description.document["shapes"] if "lens" in shape)
    # Cemented: the same numbers on both sides, and one edge.
    assert first["back"] == second["front"]
    assert first["back"] == {"curvature": 1 / -45.71, "conic": -0.5, "aspheres": [1e-6], "semi_diameter": 12.7}
    assert second["back"]["aspheres"] == [0.0, -2e-9]
    assert first["edge_radius"] == second["edge_radius"] == 12.7
    items = {item["path"]: item for item in description.document["groups"][0]["items"]}
    assert items["/World/Lens/Element2"]["transform"][14] == 4.0
    assert items["/World/Lens/Stop"]["transform"][14] == 16.5
    glass = [material["abbe"] for material in description.document["materials"]]
    assert glass[0]["abbe:glass"]["value"] == "N-BK7"
    assert glass[1]["abbe:dispersion:nd"]["value"] == 1.67271 and glass[1]["abbe:dispersion:vd"]["value"] == 32.25


def test_stand_ins_lie_on_the_surfaces_and_close(tmp_path):
    table = tmp_path / "doublet.csv"
    table.write_text(DOUBLET)
    prescription = read_prescription(table)
    path = tmp_path / "doublet.usda"
    path.write_text(stage_text(prescription))
    stage = Usd.Stage.Open(str(path))
    for number, element in enumerate(prescription.elements(), 1):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/Lens/Element{number}"))
        points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
        radius = np.hypot(points[:, 0], points[:, 1])
        front = np.array([element.front.sag(r) for r in radius])
        back = element.front.thickness + np.array([element.back.sag(r) for r in radius])
        assert np.minimum(abs(points[:, 2] - front), abs(points[:, 2] - back)).max() < 1e-5
        edges = {}
        indices, start = list(mesh.GetFaceVertexIndicesAttr().Get()), 0
        volume = 0.0
        for count in mesh.GetFaceVertexCountsAttr().Get():
            face = indices[start : start + count]
            start += count
            for a, b in zip(face, face[1:] + face[:1], strict=True):
                edges[a, b] = edges.get((a, b), 0) + 1
            for b, c in itertools.pairwise(face[1:]):
                volume += np.dot(points[face[0]], np.cross(points[b], points[c])) / 6
        assert all(edges.get((b, a)) == n == 1 for (a, b), n in edges.items())
        assert volume > 0.0, "the faces look outwards"


def test_text_and_json_say_the_same_as_csv(tmp_path):
    rows = [line.split(",") for line in DOUBLET.splitlines()]
    csv, txt, js = (tmp_path / f"doublet.{suffix}" for suffix in ("csv", "txt", "json"))
    csv.write_text(DOUBLET)
    txt.write_text("\n".join(" ".join(cell.strip() or "-" for cell in row) for row in rows))
    names = [cell.strip() for cell in rows[0]]
    js.write_text(json.dumps([dict(zip(names, [cell.strip() for cell in row], strict=True)) for row in rows[1:]]))
    assert read_prescription(csv) == read_prescription(txt) == read_prescription(js)


def test_the_cooke_triplet_is_its_table():
    made = stage_text(read_prescription(STAGES / "cooke.csv"))
    assert made == (STAGES / "cooke.usda").read_text(encoding="utf-8")
    assert [len(shape) for shape in describe(STAGES / "cooke.usda").document["shapes"]] == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("radius,thickness,glass,semi_diameter\n10,1,X,\n", r"row 1: semi_diameter is empty: give a number"),
        ("radius,thickness,glass,semi_diameter\n10,x,X,1\n", r"row 1: thickness is 'x': give a number"),
        ("radius,thickness,glass,semi_diameter\n10,1,X,-1\n", r"row 1: semi_diameter is -1: it must be positive"),
        ("radius,thickness,glass,semi_diameter,a5\n10,1,X,1,2\n", r"row 1: aspheric terms are a4, a6, a8"),
        ("radius,thickness,glass,semi_diameter,b\n10,1,X,1,2\n", r"row 1: unknown column 'b'"),
        ("radius,thickness,glass,semi_diameter\n10,1,,1\n", r"has no glass between two surfaces"),
        ("radius,thickness,glass,semi_diameter\n10,1,X,1\n10,1,X,1\n", r"row 2: the last surface has glass behind it"),
    ],
)
def test_tables_that_are_none_are_errors_with_the_row(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(StageError, match=message):
        read_prescription(path)
