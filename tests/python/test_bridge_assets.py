"""The bridge over every stage of the shared assets: each gives a valid description, and USD agrees with it."""

import os
from pathlib import Path

import numpy as np
import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Usd, UsdGeom, UsdShade

from abbe.errors import StageError
from abbe.usd import describe, list_cameras, list_settings

ROOT = Path(__file__).resolve().parents[2]
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")


def _folder():
    """The folder of the assets: ABBE_ASSETS, or shared/assets in or beside the checkout."""
    named = os.environ.get("ABBE_ASSETS")
    if named:
        return Path(named)
    candidates = [ROOT / "shared" / "assets", *(parent / "shared" / "assets" for parent in list(ROOT.parents)[:2])]
    return next((folder for folder in candidates if folder.is_dir()), None)


FOLDER = _folder()
# What is rendered; older versions of USD lack some.
_NAMES = ("Mesh", "Sphere", "Cube", "Plane", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1")
LEFT_OUT = ("empty-mesh", "broken-prim")
SCHEMAS = tuple(getattr(UsdGeom, name) for name in _NAMES if hasattr(UsdGeom, name))
FILES = sorted(path for path in FOLDER.rglob("*") if path.suffix in EXTENSIONS) if FOLDER else []


def test_the_assets_are_there():
    if not FILES:
        pytest.skip("NO SHARED ASSETS: 287 stages are not tested; set ABBE_ASSETS to their folder")
    assert len(FILES) > 250


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(FOLDER)))
def test_every_asset_gives_a_valid_description_that_agrees_with_usd(path, capfd):
    try:
        description = describe(path)
        list_cameras(path)
        list_settings(path)
    except StageError as error:
        # "Stop with an error that names a prim path or the file": none of the known assets has to.
        pytest.fail(str(error))
    validate(description.document, description.arrays)
    description.to_json()
    assert capfd.readouterr().err == ""
    _agrees_with_usd(description, Usd.Stage.Open(str(path)))


def _agrees_in_extent(description, item, prim, time):
    """Compare the box of a shape in its own space: floats of points are USD's own, sizes are doubles."""
    (kind, shape) = next(iter(description.document["shapes"][item["target"]["shape"]].items()))
    if kind == "lens":
        return
    theirs = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time), dtype=np.float32)
    if theirs.shape != (2, 3):
        # Points of another type than USD's own plug-in takes; the bridge converts them.
        assert any(warning["kind"] == "converted-attribute" for warning in description.warnings)
        return
    if kind == "mesh":
        points = description.arrays[shape["points"]]
        assert np.array_equal(theirs, [points.min(axis=0), points.max(axis=0)])
        return
    index = "XYZ".index(shape.get("axis", "Z"))
    if kind == "sphere":
        half = np.full(3, shape["radius"])
    elif kind == "cube":
        half = np.full(3, 0.5 * shape["size"])
    elif kind == "plane":
        # Width runs along x, or y for a plane about x; length along the other one.
        half = 0.5 * np.insert([shape["width"], shape["length"]][:: -1 if index == 0 else 1], index, 0.0)
    else:
        radius = max(shape.get("radius_bottom", 0.0), shape.get("radius_top", 0.0), shape.get("radius", 0.0))
        half = np.full(3, radius)
        half[index] = 0.5 * shape["height"] + (radius if kind == "capsule" else 0.0)
    assert np.allclose(theirs, [-half, half], rtol=1e-6)


def _agrees_with_usd(description, stage):
    """Compare with USD's own answer, prim by prim: which ones are shown, where, with which material."""
    time_code = description.document["stage"].get("time_code")
    time = Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code)
    placed = {item["path"]: item for item in description.document["groups"][0]["items"]}
    included = {"default", "render"}
    expected = {}
    iterator = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in iterator:
        if prim.IsA(UsdGeom.PointInstancer):
            iterator.PruneChildren()
        if any(prim.IsA(schema) for schema in SCHEMAS):
            imageable = UsdGeom.Imageable(prim)
            shown = imageable.ComputeVisibility(time) != "invisible" and imageable.ComputePurpose() in included
            if shown:
                expected[str(prim.GetPath())] = prim
    # What has nothing to render, or no place, is warned of; anything else is placed.
    left_out = sum(warning["count"] for warning in description.warnings if warning["kind"] in LEFT_OUT)
    assert set(placed) <= set(expected)
    assert len(expected) - len(placed) == left_out
    for path, item in placed.items():
        world = UsdGeom.Xformable(expected[path]).ComputeLocalToWorldTransform(time)
        assert np.allclose(item.get("transform", np.eye(4).ravel()), np.asarray(world).ravel(), rtol=1e-14, atol=0)
        _agrees_in_extent(description, item, expected[path], time)
        material, binding = UsdShade.MaterialBindingAPI(expected[path]).ComputeBoundMaterial("full")
        if "material" in item and not material:
            # Where USD reads no MaterialX, the bridge does.
            assert description.document["materials"][item["material"]]["path"] in map(str, binding.GetTargets())
        else:
            assert ("material" in item) == bool(material)
