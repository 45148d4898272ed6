"""Two ways to say where instances stand: unrolled from a description, and computed by USD's own functions."""

import numpy as np
from pxr import Sdf, Usd, UsdGeom


def unrolled(description):
    """Return every placed shape of a description: (prim path, instance path, world matrix, material path)."""
    document, arrays = description.document, description.arrays
    materials = [material["path"] for material in document["materials"]]
    found = []

    def transform(item):
        return np.array(item["transform"]).reshape(4, 4) if "transform" in item else np.eye(4)

    def visit(index, world, name):
        group = document["groups"][index]
        for item in group["items"]:
            material = item.get("material")
            material = None if material is None else materials[material]
            instance = name or item.get("instance")
            found.append((item["path"], instance, transform(item) @ world, material))
        for item in group.get("instances", []):
            rows = arrays[item["transforms"]].reshape(-1, 4, 3)
            indices = range(len(rows)) if "indices" not in item else arrays[item["indices"]].tolist()
            path = item["path"]
            if name:
                path = name + path[group["path"].rfind("/") :]
            for element, row in zip(indices, rows, strict=True):
                place = np.column_stack([row, [0, 0, 0, 1]])
                visit(item["group"], place @ transform(item) @ world, f"{path}[{element}]")

    visit(document["root"], np.eye(4), "")
    return found


def by_usd(stage, time):
    """Return every Sphere and Mesh that a point instancer of a stage shows: (prim path, world matrix).

    Transforms and masks are UsdGeomPointInstancer's, prototypes' own transforms included.
    """
    cache = UsdGeom.XformCache(time)
    everything = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
    found = []

    def shown(prim, world):
        instancer = UsdGeom.PointInstancer(prim)
        places = instancer.ComputeInstanceTransformsAtTime(time, time)
        mask = list(instancer.ComputeMaskAtTime(time))
        prototypes = [i for k, i in enumerate(instancer.GetProtoIndicesAttr().Get(time)) if not mask or mask[k]]
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        for index, place in zip(prototypes, places, strict=True):
            below(stage.GetPrimAtPath(targets[index]), np.array(place) @ world)

    def below(root, world):
        prims = iter(Usd.PrimRange(root, everything))
        for prim in prims:
            if prim != root and prim.GetSpecifier() == Sdf.SpecifierOver:
                prims.PruneChildren()
                continue
            own = np.array(cache.ComputeRelativeTransform(prim, root)[0])
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                shown(prim, own @ world)
            elif prim.IsA(UsdGeom.Sphere) or prim.IsA(UsdGeom.Mesh):
                found.append((str(prim.GetPath()), own @ world))

    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
            shown(prim, np.array(cache.GetLocalToWorldTransform(prim)))
    return found
