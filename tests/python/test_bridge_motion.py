"""Time: what is read at a frame, and where things are about it; USD's own classes are the oracle."""

import numpy as np
import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Gf, Sdf, Usd, UsdGeom

from abbe.usd import describe, keep_open
from abbe.usd.sampling import MOST_PIECES, ROUNDNESS

HEAD = '#usda 1.0\n(\n startTimeCode = 1\n endTimeCode = 10\n timeCodesPerSecond = 24\n upAxis = "Y"\n)\n'
CAMERA = 'def Camera "C"\n{{\n double shutter:open = {}\n double shutter:close = {}\n {}\n}}\n'
SHUTTER = (-0.25, 0.5)


def in_memory(text, shutter=SHUTTER, camera=""):
    layer = Sdf.Layer.CreateAnonymous("motion.usda")
    assert layer.ImportFromString(HEAD + text + CAMERA.format(*shutter, camera))
    return Usd.Stage.Open(layer)


def checked(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    description.to_json()
    return description


def items(description):
    return {item["path"]: item for group in description.document["groups"] for item in group["items"]}


def between(motion, values, time):
    """What the renderer has at a time: linear between samples."""
    times = motion["times"]
    after = int(np.clip(np.searchsorted(times, time, side="right"), 1, len(times) - 1))
    part = (time - times[after - 1]) / (times[after] - times[after - 1])
    return values[after - 1] + part * (values[after] - values[after - 1])


WHEEL = """
def Xform "Cart"
{
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (3, 0, 0), 3: (3, 2, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Xform "Wheel"
    {
        float xformOp:rotateZ.timeSamples = { 0: -200, 4: 600 }
        uniform token[] xformOpOrder = ["xformOp:rotateZ"]
        def Cylinder "Rim"
        {
        }
        def Cube "Spoke"
        {
            float3 xformOp:scale = (0.1, 3, 0.2)
            double3 xformOp:translate = (2, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        }
        def Sphere "Free"
        {
            uniform token[] xformOpOrder = ["!resetXformStack!"]
        }
    }
    def Sphere "Load"
    {
    }
}
def Sphere "Still"
{
}
"""


@pytest.mark.parametrize("frame", [1, 2, 2.25, 9])
def test_a_place_is_that_of_usd_at_every_sample_and_near_it_between(frame):
    stage = in_memory(WHEEL)
    description = checked(stage, frame=frame)
    found = items(description)
    moving = {path for path, item in found.items() if "motion" in item}
    expected = {"/Cart/Wheel/Rim", "/Cart/Wheel/Spoke", "/Cart/Load"} if frame < 4 else set()
    assert moving == expected
    for path in moving:
        motion = found[path]["motion"]
        matrices = np.array(motion["transforms"]).reshape(-1, 4, 4)
        prim = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        assert motion["times"][0] == SHUTTER[0] and motion["times"][-1] == SHUTTER[1] and 0.0 in motion["times"]
        for time, own in zip(motion["times"], matrices, strict=True):
            assert (own == np.array(prim.ComputeLocalToWorldTransform(frame + time))).all()
        for time in np.linspace(*SHUTTER, 97):
            exact = np.array(prim.ComputeLocalToWorldTransform(frame + time))
            # As far as the wheel turns: relative to where it is.
            off = np.linalg.solve(exact[:3, :3], (between(motion, matrices, time) - exact)[:3, :3])
            assert np.abs(off).max() <= ROUNDNESS, (path, time)
    if moving:
        assert found["/Cart/Wheel/Rim"]["motion"]["times"] == found["/Cart/Wheel/Spoke"]["motion"]["times"]
        assert len(found["/Cart/Load"]["motion"]["times"]) < 6


def test_a_propeller_has_no_more_than_so_many_samples():
    text = WHEEL.replace("{ 0: -200, 4: 600 }", "{ 0: 0, 4: 40000 }")
    motion = items(checked(in_memory(text), frame=1))["/Cart/Wheel/Rim"]["motion"]
    assert 100 < len(motion["times"]) <= 2 * MOST_PIECES + 3


def test_what_does_not_move_is_not_read_again(monkeypatch):
    still = in_memory('def Sphere "S"\n{\n}\n')
    for stage, options in [
        (in_memory(WHEEL, shutter=(0, 0)), {}),
        (in_memory(WHEEL), {"motion_blur": False}),
        (in_memory(WHEEL), {"frame": "default"}),
        (in_memory(WHEEL + 'def RenderSettings "R"\n{\n bool disableMotionBlur = 1\n}\n'), {}),
        (in_memory(WHEEL + 'def RenderSettings "R"\n{\n bool instantaneousShutter = 1\n}\n'), {}),
    ]:
        description = checked(stage, **options)
        assert "motion" not in description.document["stage"]
        assert not any("motion" in item for item in items(description).values())
    description = checked(still)
    assert description.document["stage"]["motion"] == [*SHUTTER]
    assert not any("motion" in item for item in items(description).values())

    # Not even a transform is computed at another time where nothing varies.
    from abbe.usd import motion

    monkeypatch.setattr(motion.MotionReader, "_matrix", lambda *_: pytest.fail("a still transform was read again"))
    checked(still)


def test_vectors_read_up_to_the_next_frame():
    stage = in_memory(WHEEL, shutter=(0, 0))
    assert checked(stage, motion_vectors=True).document["stage"]["motion"] == [0.0, 1.0]
    render = (
        'def RenderSettings "R"\n{\n rel products = </R/P>\n'
        ' def RenderProduct "P"\n {\n  rel orderedVars = </R/V>\n }\n'
        ' def RenderVar "V"\n {\n  string sourceName = "motion"\n }\n}\n'
    )
    assert checked(in_memory(WHEEL + render, shutter=(0, 0))).document["stage"]["motion"] == [0.0, 1.0]
    assert checked(in_memory(WHEEL + render, shutter=(-0.5, 0.5))).document["stage"]["motion"] == [-0.5, 1.0]


def test_a_camera_moves_with_what_carries_it():
    samples = "double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (4, 0, 8) }"
    camera = f'{samples}\n uniform token[] xformOpOrder = ["xformOp:translate"]'
    motion = checked(in_memory(WHEEL, camera=camera), frame=1).document["cameras"][0]["motion"]
    assert motion["times"] == [-0.25, 0.0, 0.5]
    assert [m[12:15] for m in motion["transforms"]] == [[0, 0, 0], [0, 0, 0], [2, 0, 4]]


MESH = """
def Mesh "M"
{{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
    {}
}}
"""
SAMPLES = """
    point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], 2: [(0, 0, 1), (1, 0, 3), (0, 2, 0)] }
"""
VELOCITIES = """
    vector3f[] velocities.timeSamples = {
        1: [(24, 0, 0), (0, 48, 0), (0, 0, -24)], 2: [(0, 0, 0), (0, 0, 0), (0, 0, 0)]
    }
"""
ACCELERATIONS = """
    vector3f[] accelerations.timeSamples = {
        1: [(0, 576, 0), (0, 0, 0), (0, 0, 0)], 2: [(0, 0, 0), (0, 0, 0), (0, 0, 0)]
    }
"""


@pytest.mark.parametrize("authored", [SAMPLES, SAMPLES + VELOCITIES, SAMPLES + VELOCITIES + ACCELERATIONS])
@pytest.mark.parametrize("frame", [1, 1.25])
def test_points_are_those_that_usd_computes(authored, frame):
    stage = in_memory(MESH.format(authored))
    description = checked(stage, frame=frame)
    (shape,) = description.document["shapes"]
    mesh = shape["mesh"]
    motion = mesh["motion"]
    prim = UsdGeom.PointBased(stage.GetPrimAtPath("/M"))

    def computed(time):
        return np.array(prim.ComputePointsAtTimes([Usd.TimeCode(frame + time)], Usd.TimeCode(frame))[0])

    assert (description.arrays[mesh["points"]] == computed(0.0)).all()
    samples = [description.arrays[name] for name in motion["points"]]
    for time, own in zip(motion["times"], samples, strict=True):
        assert (own == computed(time)).all()
    # Between samples: on a straight line, or near the parabola.
    for time in np.linspace(*SHUTTER, 31):
        assert np.abs(between(motion, samples, time) - computed(time)).max() <= (
            0.01 if ACCELERATIONS in authored else 1e-5
        )


def test_a_mesh_of_changing_topology_stands_still_and_is_named():
    changing = SAMPLES.replace("(0, 2, 0)] }", "(0, 2, 0), (1, 1, 1)] }")
    description = checked(in_memory(MESH.format(changing)), frame=1.6)
    assert "motion" not in description.document["shapes"][0]["mesh"]
    assert [w["places"] for w in description.warnings if w["kind"] == "motion-of-changing-mesh"] == [["</M>"]]


INSTANCER = """
def PointInstancer "P"
{{
    rel prototypes = [</P/A>, </P/B>]
    int[] protoIndices = [0, 1, 0]
    {}
    def Sphere "A"
    {{
        double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 2: (0, 1, 0) }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Cube "B"
    {{
    }}
}}
"""
POSITIONS = (
    "point3f[] positions.timeSamples = { 1: [(0, 0, 0), (5, 0, 0), (0, 5, 0)], 2: [(1, 0, 0), (5, 5, 0), (0, 0, 5)] }\n"
)
PUSHED = (
    "vector3f[] velocities.timeSamples = { 1: [(24, 0, 0), (0, 0, 24), (0, 0, 0)] }\n"
    "vector3f[] angularVelocities.timeSamples = { 1: [(0, 0, 0), (0, 0, 2000), (0, 900, 0)] }\n"
    "quath[] orientations.timeSamples = { 1: [(1, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)] }\n"
)


@pytest.mark.parametrize(
    "authored", [POSITIONS, POSITIONS.replace(", 2: [(1, 0, 0), (5, 5, 0), (0, 0, 5)]", "") + PUSHED]
)
def test_instances_are_those_that_usd_computes(authored):
    stage = in_memory(INSTANCER.format(authored))
    description = checked(stage, frame=1)
    prim = UsdGeom.PointInstancer(stage.GetPrimAtPath("/P"))
    found = description.document["groups"][0]["instances"]
    assert len(found) == 2
    for item in found:
        motion = item["places_motion"]
        samples = [description.arrays[name].reshape(-1, 4, 3) for name in motion["transforms"]]
        indices = description.arrays[item["indices"]]
        for time in [*motion["times"], *np.linspace(*SHUTTER, 31)]:
            # The prototype's own transform is USD's at that time, within the instancer's computed one.
            code, base = Usd.TimeCode(1 + time), Usd.TimeCode(1)
            exact = np.array(prim.ComputeInstanceTransformsAtTime(code, base, prim.ExcludeProtoXform, prim.IgnoreMask))[
                indices
            ]
            root = stage.GetPrimAtPath(prim.GetPrototypesRel().GetTargets()[0 if 0 in indices else 1])
            exact = np.array(UsdGeom.Xformable(root).GetLocalTransformation(code)) @ exact
            own = between(motion, samples, time)
            tolerance = 1e-12 if time in motion["times"] else 4 * ROUNDNESS
            assert np.abs(own - exact[..., :3]).max() <= tolerance


def test_held_values_jump():
    stage = in_memory(
        'def Sphere "S"\n{\n double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 1.25: (7, 0, 0) }\n'
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    motion = items(checked(stage, frame=1))["/S"]["motion"]
    xs = np.array(motion["transforms"])[:, 12]
    for time, x in [(-0.2, 0), (0.1, 0), (0.2499, 0), (0.25, 7), (0.4, 7)]:
        assert between(motion, xs, time) == x, time


def test_visibility_is_that_of_the_frame():
    blinks = 'token visibility.timeSamples = { 1: "inherited", 3: "invisible" }'
    text = f'def Sphere "S"\n{{\n {blinks}\n}}\ndef Sphere "T"\n{{\n}}\n'
    assert set(items(checked(in_memory(text), frame=2))) == {"/S", "/T"}
    assert set(items(checked(in_memory(text), frame=3))) == {"/T"}


def test_layer_offsets_and_rates_are_usds(tmp_path):
    moving = (
        '#usda 1.0\n(\n timeCodesPerSecond = 48\n defaultPrim = "A"\n)\ndef Sphere "A"\n{\n'
        " double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 48: (48, 0, 0) }\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    (tmp_path / "moving.usda").write_text(moving)
    (tmp_path / "root.usda").write_text(
        HEAD + 'def "A" (\n references = @./moving.usda@ (offset = 10; scale = 2)\n)\n{\n}\n' + CAMERA.format(0, 1, "")
    )
    stage = Usd.Stage.Open(str(tmp_path / "root.usda"))
    item = items(checked(str(tmp_path / "root.usda"), frame=22))["/A"]
    cache = UsdGeom.XformCache(22)
    assert item["transform"] == list(np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath("/A"))).ravel())
    # 24 time codes of the root are 48 of the layer; the reference makes everything twice as slow.
    assert item["transform"][12] == pytest.approx((22 - 10) / 2 * 2)
    steps = np.array(item["motion"]["transforms"])[:, 12]
    assert steps[-1] - steps[0] == pytest.approx(1.0)


def test_value_clips_are_resolved(tmp_path):
    for i in (1, 2):
        (tmp_path / f"clip{i}.usda").write_text(
            '#usda 1.0\ndef Mesh "M"\n{\n point3f[] points.timeSamples = {'
            + ", ".join(f"{t}: [(0, 0, {t * i}), (1, 0, 0), (0, 1, 0)]" for t in (1, 2, 3))
            + "}\n}\n"
        )
    (tmp_path / "manifest.usda").write_text('#usda 1.0\ndef Mesh "M"\n{\n point3f[] points\n}\n')
    clips = (
        " (\n clips = {\n dictionary default = {\n asset[] assetPaths = [@./clip1.usda@, @./clip2.usda@]\n"
        ' asset manifestAssetPath = @./manifest.usda@\n string primPath = "/M"\n double2[] active = [(1, 0), (2, 1)]\n'
        " double2[] times = [(1, 1), (2, 2), (3, 3)]\n }\n }\n)"
    )
    text = MESH.format("").replace('def Mesh "M"', 'def Mesh "M"' + clips)
    (tmp_path / "root.usda").write_text(HEAD + text + CAMERA.format(0, 0.5, ""))
    for frame, z in [(1, 1), (1.5, None), (2, 4), (3, 6)]:
        description = checked(str(tmp_path / "root.usda"), frame=frame)
        stage = Usd.Stage.Open(str(tmp_path / "root.usda"))
        mesh = description.document["shapes"][0]["mesh"]
        points = description.arrays[mesh["points"]]
        assert (points == np.array(stage.GetPrimAtPath("/M").GetAttribute("points").Get(frame))).all()
        assert z is None or points[0, 2] == z


def test_native_instances_move_by_themselves():
    text = 'def Xform "Proto" (\n active = true\n)\n{\n def Sphere "S"\n {\n }\n}\n' + "".join(
        f'def "I{i}" (\n instanceable = true\n references = </Proto>\n)\n{{\n'
        f" double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 2: ({i}, 0, 0) }}\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
        for i in (1, 2)
    )
    found = items(checked(in_memory(text), frame=1))
    assert "motion" not in found["/Proto/S"]
    for i in (1, 2):
        motion = found[f"/I{i}/S"]["motion"]
        assert motion["transforms"][-1][12] == pytest.approx(0.5 * i)
    assert Gf.Matrix4d(*found["/I1/S"].get("transform", np.eye(4).ravel().tolist())) == Gf.Matrix4d(1)


def test_a_stage_that_is_kept_open_is_read_once_and_tells_the_same(tmp_path, monkeypatch):
    path = tmp_path / "wheel.usda"
    path.write_text(HEAD + WHEEL + CAMERA.format(*SHUTTER, "") + 'def "Lost" (\n references = @./lost.usda@\n)\n{\n}\n')
    opened = []
    compose = Usd.Stage.Open
    monkeypatch.setattr(Usd.Stage, "Open", lambda *args: opened.append(args) or compose(*args))
    kept = keep_open(path)
    for frame in (1, 2, 3):
        alone = checked(str(path), frame=frame)
        together = checked(kept, frame=frame)
        assert together.document == alone.document
        assert together.arrays.keys() == alone.arrays.keys()
    assert len(opened) == 3 + 1
