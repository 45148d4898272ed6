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
    # A mesh that has nothing to render is warned of; anything else is placed.
    left_out = sum(warning["count"] for warning in description.warnings if warning["kind"] == "empty-mesh")
    assert set(placed) <= set(expected)
    assert len(expected) - len(placed) == left_out
    for path, item in placed.items():
        world = UsdGeom.Xformable(expected[path]).ComputeLocalToWorldTransform(time)
        assert np.allclose(item.get("transform", np.eye(4).ravel()), np.asarray(world).ravel(), rtol=1e-14, atol=0)
        material, binding = UsdShade.MaterialBindingAPI(expected[path]).ComputeBoundMaterial("full")
        if "material" in item and not material:
            # Where USD reads no MaterialX, the bridge does.
            assert description.document["materials"][item["material"]]["path"] in map(str, binding.GetTargets())
        else:
            assert ("material" in item) == bool(material)
