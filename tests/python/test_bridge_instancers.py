"""Point instancers: what the description places is what UsdGeomPointInstancer computes, and nothing hidden is read."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from description_schema import validate
from instances_oracle import by_usd, unrolled

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd, UsdGeom, Vt

import abbe
from abbe.usd import describe, instancers, reader

STAGE = Path(__file__).parent / "stages" / "instancers.usda"


def checked(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    description.to_json()
    return description


def in_memory(text):
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


def warned(description, kind):
    return [warning for warning in description.warnings if warning["kind"] == kind]


def instanced(description):
    """What point instancers show of a description: (prim path, world matrix)."""
    return [(path, world) for path, instance, world, _ in unrolled(description) if instance and "[" in instance]


def assert_same_places(found, expected):
    """The same prims at the same places, whatever the order."""

    def key(item):
        return item[0], *np.round(item[1], 6).ravel()

    found, expected = sorted(found, key=key), sorted(expected, key=key)
    assert [path for path, _ in found] == [path for path, _ in expected]
    for (path, a), (_, b) in zip(found, expected, strict=True):
        # A handful of products of 4 x 4 matrices in two orders.
        assert np.abs(a - b).max() <= 1e-13 * max(1.0, np.abs(b).max()), path


@pytest.mark.parametrize("frame", [1, 1.5, 2, 3, 10])
def test_places_are_those_that_usd_computes(frame):
    description = checked(STAGE, frame=frame)
    hidden = {"/World/Forest/Prototypes/Tree/StandIn", "/World/Forest/Prototypes/Tree/Ghost"}
    expected = [item for item in by_usd(Usd.Stage.Open(str(STAGE)), frame) if item[0] not in hidden]
    assert_same_places(instanced(description), expected)
    # Five or six trees with crown, trunk and two apples each; two stones; two kits and two kits as prototypes.
    trees = 4 if frame < 3 else 5
    assert len(expected) == 4 * trees + 2 + 2 * 4 + 2 * 4 + 2 * 1 + 2


def test_instances_are_named_by_their_element():
    names = Counter((instance, path) for path, instance, _, _ in unrolled(checked(STAGE, frame=3)))
    assert set(names.values()) == {1}
    prototypes = "/World/Forest/Prototypes"
    assert ("/World/Forest[5]", f"{prototypes}/Tree/Crown") in names
    assert ("/World/Forest[1]", f"{prototypes}/Stone") in names
    assert ("/World/Forest[6]/Tree/Fruit[2]", f"{prototypes}/Tree/Fruit/Apple") in names
    assert ("/World/KitB/Screws[3]", "/World/KitB/Screws/Head") in names
    assert ("/World/KitB/Screws[0]", "/Shared/Bead") in names
    assert ("/World/Kits[1]", "/World/KitA/Nut") in names
    assert ("/World/Kits[1]/KitA/Screws[2]", "/World/KitA/Nut") in names
    assert ("/World/KitA", "/World/KitA/Nut") in names


def test_materials_are_inherited_where_prototypes_stand():
    bound = {path: material for path, _, _, material in unrolled(checked(STAGE))}
    prototypes = "/World/Forest/Prototypes"
    assert bound[f"{prototypes}/Tree/Crown"] == bound[f"{prototypes}/Stone"] == "/World/Looks/Green"
    assert bound[f"{prototypes}/Tree/Trunk"] == "/World/Looks/Brown"
    assert bound[f"{prototypes}/Tree/Fruit/Apple"] == "/World/Looks/Red"
    assert bound["/Shared/Bead"] is None


def test_shapes_and_arrays_are_read_once_however_often_they_are_instanced(monkeypatch):
    read = Counter()
    compute = UsdGeom.PointInstancer.ComputeInstanceTransformsAtTime

    def counted(self, *arguments):
        read[str(self.GetPrim().GetPath())] += 1
        return compute(self, *arguments)

    monkeypatch.setattr(UsdGeom.PointInstancer, "ComputeInstanceTransformsAtTime", counted)
    description = checked(STAGE)
    shapes = [path for shape in description.document["shapes"] for path in [next(iter(shape.values()))["path"]]]
    assert sorted(shapes) == [
        "/Shared/Bead",
        "/World/Forest/Prototypes/Stone",
        "/World/Forest/Prototypes/Tree/Crown",
        "/World/Forest/Prototypes/Tree/Fruit/Apple",
        "/World/Forest/Prototypes/Tree/Trunk",
        "/World/KitA/Nut",
        "/World/KitA/Screws/Head",
    ]
    # The kits' screws are one instancer of one prototype.
    assert read == {
        "/World/Forest": 1,
        "/World/Forest/Prototypes/Tree/Fruit": 1,
        "/World/KitA/Screws": 1,
        "/World/Kits": 1,
        "/World/Sparks": 1,
    }


def test_what_is_hidden_or_unused_is_counted_and_not_read(monkeypatch):
    reads = Counter()
    original = reader.read

    def counted(prim, name, time):
        reads[str(prim.GetPath()), name] += 1
        return original(prim, name, time)

    monkeypatch.setattr(reader, "read", counted)
    monkeypatch.setattr(instancers, "read", counted)
    description = checked(STAGE)
    assert not any(path.endswith("Never") for path, _ in reads), "a prototype without instances is not visited"
    assert description.document["skipped"] == {
        # Crown and trunk are shown; the ghost once per tree's prototype, the bead where it stands.
        "invisible": 2,
        "purpose proxy": 1,
        "prototypes without an instance": 1,
        "instances invisible or inactive": 2,
    }
    assert [material["path"] for material in description.document["materials"]] == [
        "/World/Looks/Green",
        "/World/Looks/Brown",
        "/World/Looks/Red",
    ]
    reads.clear()
    hidden = checked(STAGE, overrides=["/World/Forest.visibility=invisible", "/World/Kits.visibility=invisible"])
    assert ("/World/Forest", "positions") not in reads and ("/World/Sparks", "positions") in reads
    assert not any(path.startswith("/World/Forest") for path, *_ in unrolled(hidden))


def test_the_instancers_purpose_counts_where_prototypes_have_none():
    text = (
        'def PointInstancer "P"\n{\n uniform token purpose = "proxy"\n rel prototypes = [</P/A>, </P/B>, </C>]\n'
        " int[] protoIndices = [0, 1, 2]\n point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]\n"
        ' def Sphere "A"\n {\n }\n def Sphere "B"\n {\n  uniform token purpose = "render"\n }\n}\n'
        'def Scope "G"\n{\n uniform token purpose = "guide"\n}\nclass Sphere "C"\n{\n}\n'
    )
    assert [path for path, *_ in unrolled(checked(in_memory(text)))] == ["/P/B"]
    assert {path for path, *_ in unrolled(checked(in_memory(text), purposes=["proxy"]))} == {"/P/A", "/C"}


def test_one_prototype_outside_serves_several_instancers():
    body = " rel prototypes = </Ball>\n int[] protoIndices = [0, 0]\n point3f[] positions = [(0, 0, 0), (1, 0, 0)]\n"
    text = f'class Sphere "Ball"\n{{\n}}\ndef PointInstancer "A"\n{{\n{body}}}\ndef PointInstancer "B"\n{{\n{body}}}\n'
    document = checked(in_memory(text)).document
    assert len(document["groups"]) == 2 and len(document["shapes"]) == 1
    assert [item["path"] for item in document["groups"][0]["instances"]] == ["/A", "/B"]


def test_inactive_ids_are_metadata_and_count():
    stage = Usd.Stage.Open(str(STAGE))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Forest"))
    # The root layer is shared with whoever else opens the file.
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        assert instancer.DeactivateIds(Vt.Int64Array([50, 70]))
    description = checked(stage)
    hidden = {"/World/Forest/Prototypes/Tree/StandIn", "/World/Forest/Prototypes/Tree/Ghost"}
    assert_same_places(instanced(description), [item for item in by_usd(stage, 1) if item[0] not in hidden])
    assert description.document["skipped"]["instances invisible or inactive"] == 4


def test_the_box_that_is_framed_holds_everything_that_is_instanced():
    description = checked(STAGE, frame=3)
    (camera,) = description.document["cameras"]
    assert camera["path"] == "", "the stage is framed"
    centres = np.array([world[3, :3] for *_, world, _ in unrolled(description)])
    # The camera looks at the centre of the box along -z, its front face as wide as the picture.
    x, y = camera["transform"][12:14]
    aperture = camera["horizontal_aperture"] / 2 / camera["focal_length"]
    for radius, axis, middle in (
        (camera["focus_distance"] * aperture, 0, x),
        (camera["focus_distance"] * aperture, 1, y),
    ):
        assert (np.abs(centres[:, axis] - middle) <= radius).all()
    # One row of balls: exactly its box.
    row = INSTANCER.replace("[0, 1, 0]", "[0, 0, 0]")
    (camera,) = checked(in_memory(row)).document["cameras"]
    assert camera["transform"][12:14] == [1, 0]
    assert camera["focus_distance"] == pytest.approx(np.hypot(2, 1) / aperture + 1)


def test_identifiers_of_a_render_name_the_instance_that_is_seen(tmp_path):
    options = {"frame": 3, "mask": ["/World/Forest"]}
    description = checked(STAGE, **options)
    places = {(path, instance or ""): world for path, instance, world, _ in unrolled(description)}
    radii = {
        shape["sphere"]["path"]: shape["sphere"]["radius"]
        for shape in description.document["shapes"]
        if "sphere" in shape
    }
    aovs = ["position", "prim_id", "instance_id"]
    scene = abbe.Scene.from_stage(STAGE, **options)
    film = scene.render(width=400, aovs=aovs)
    prims, instances = (abbe.Manifest(film.metadata[f"abbe:{what}Manifest"]) for what in ("prim", "instance"))
    assert len(instances.entries) < 5 < len(instances)
    seen = set()
    for position, prim, instance in zip(*(film[name].reshape(-1, film[name].shape[-1]) for name in aovs), strict=True):
        path = prims[int(prim[0]) - 1] if prim[0] else None
        if path in radii:
            key = path, instances[int(instance[0]) - 1] if instance[0] else ""
            point = np.append(position, 1.0) @ np.linalg.inv(places[key])
            # Positions are float32, some 100 units from the origin, and the smallest scale is 1/20 of a unit.
            assert np.linalg.norm(point[:3]) == pytest.approx(radii[path], abs=1e-3), key
            seen.add(key)
    assert len(seen) >= 15, "many instances are seen"
    scene.save(tmp_path / "scene.safetensors")
    for mapped in (False, True):
        loaded = abbe.Scene.load(tmp_path / "scene.safetensors", mapped=mapped).render(width=400, aovs=aovs)
        assert all(np.array_equal(loaded[name], film[name]) for name in aovs)
        assert loaded.metadata["abbe:instanceManifest"] == film.metadata["abbe:instanceManifest"]


def test_transforms_reach_the_core_without_being_copied():
    description = checked(STAGE)
    names = {item["transforms"] for group in description.document["groups"] for item in group.get("instances", [])}
    for name in names:
        array = description.arrays[name]
        while array is not None and isinstance(array, np.ndarray):
            assert not array.flags.writeable, "what could change would be copied"
            array = array.base


# What does not fit


INSTANCER = """def PointInstancer "P"
{
 rel prototypes = [</P/A>, </P/B>]
 int[] protoIndices = [0, 1, 0]
 point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
 def Sphere "A"
 {
 }
 def Sphere "B"
 {
 }
}
"""


@pytest.mark.parametrize(
    ("old", "new", "where", "says", "shown"),
    [
        ("[0, 1, 0]", "[0, 7, -1]", "</P>.protoIndices", "2 of 3 elements name no prototype (0 to 1)", 1),
        ("(2, 0, 0)]", "(2, 0, 0), (3, 0, 0)]", "</P>.positions", "4 values for 3 elements; nothing", 0),
        ("point3f[] positions", "point3f[] pos", "</P>.positions", "0 values for 3 elements; nothing", 0),
        ("int[] protoIndices", "int[] indices", "</P>.protoIndices", "not authored", 0),
        ("[</P/A>, </P/B>]", "None", "</P>.prototypes", "names no prototype", 0),
        ("[</P/A>, </P/B>]", "[</P/Nope>, </P/B>]", "</P>.prototypes", "no prim </P/Nope>", 1),
        (
            " def Sphere",
            " float3[] scales = [(2, 2, 2)]\n def Sphere",
            "</P>.scales",
            "1 values for 3 elements; they",
            3,
        ),
        (" def Sphere", " quath[] orientations = [(1, 0, 0, 0)]\n def Sphere", "</P>.orientations", "they are ign", 3),
        (
            " def Sphere",
            " int64[] ids = [1]\n int64[] invisibleIds = [1]\n def Sphere",
            "</P>.ids",
            "nothing is masked",
            3,
        ),
    ],
)
def test_arrays_that_do_not_fit_are_named(old, new, where, says, shown, capfd):
    assert old in INSTANCER
    description = checked(in_memory(INSTANCER.replace(old, new, 1)))
    (warning,) = warned(description, "instancer") + warned(description, "missing-prototype")
    assert warning["places"] == [where] and says in warning["message"]
    assert len(unrolled(description)) == shown
    assert not warned(description, "usd") and capfd.readouterr().err == ""


def test_an_instancer_within_its_own_prototype_is_left_out_there():
    text = INSTANCER.replace("[</P/A>, </P/B>]", "[</World>, </P/B>]") + 'def Xform "World"\n{\n'
    text += ' def Sphere "S"\n {\n }\n def PointInstancer "Q"\n {\n  rel prototypes = </World>\n'
    text += "  int[] protoIndices = [0]\n  point3f[] positions = [(0, 9, 0)]\n }\n}\n"
    description = checked(in_memory(text))
    (warning,) = warned(description, "instancer")
    assert "</World>" in warning["message"] and "contains it" in warning["message"]
    places = sorted(world[3, :3].tolist() for path, _, world, _ in unrolled(description) if path == "/World/S")
    assert places == [[0, 0, 0], [0, 0, 0], [0, 9, 0], [2, 0, 0]]


PROJECTIVE = "((1, 0, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"


@pytest.mark.parametrize(
    ("op", "value", "says"),
    [
        ("translate", "double3 xformOp:translate = (inf, 0, 0)", "its transform is not finite"),
        (
            "transform",
            "matrix4d xformOp:transform = ((1, 0, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))",
            "is projective",
        ),
    ],
)
def test_a_prototype_that_cannot_be_placed_is_left_out_with_its_instances(op, value, says):
    text = f' {value}\n uniform token[] xformOpOrder = ["xformOp:{op}"]\n'
    description = checked(in_memory(INSTANCER.replace('"A"\n {\n', '"A"\n {\n' + text)))
    (warning,) = warned(description, "broken-prim")
    assert warning["places"] == ["</P/A>"] and says in warning["message"]
    assert {path for path, *_ in unrolled(description)} == {"/P/B"}
