"""A strict validator of scene descriptions, made from the Rust schema itself: unknown and missing fields are errors.

It reads the ``pub struct`` and ``pub enum`` blocks of ``src/scene/description.rs``, so that it cannot drift from what
serde (``deny_unknown_fields``) accepts.
"""

import math
import re
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).resolve().parents[2] / "src" / "scene" / "description.rs"

_BLOCK = re.compile(r"(?:pub )(struct|enum) (\w+) \{\n(.*?)\n\}", re.DOTALL)
_FIELD = re.compile(r"(#\[serde\((?P<serde>[^\]]*)\)\]\s*)?pub (?P<name>\w+): (?P<type>[^\n]+),\n")
_VARIANT = re.compile(r"(\w+) \{(.*?)\n    \},|(\w+)\((\w+)\),", re.DOTALL)
_WARNING = {"kind": "String", "message": "String", "places": "Vec<String>", "count": "u64"}


def _load():
    text = re.sub(r"[ \t]*///?[^\n]*\n", "", SOURCE.read_text())
    structs, enums = {"Warning": {name: (name, type_name, False) for name, type_name in _WARNING.items()}}, {}
    for kind, name, body in _BLOCK.findall(text):
        if kind == "struct":
            fields = {}
            for match in _FIELD.finditer(body + "\n"):
                serde = match["serde"] or ""
                renamed = re.search(r'rename = "(\w+)"', serde)
                key = renamed[1] if renamed else match["name"]
                fields[key] = (key, match["type"], "default" in serde or match["type"].startswith("Option<"))
            structs[name] = fields
        elif name in ("Shape", "Target", "LightShape"):
            enums[name] = {}
            for variant, fields, tuple_variant, content in _VARIANT.findall(body):
                key = (variant or tuple_variant).lower()
                named = {field: kind for field, kind in re.findall(r"(\w+): ([^\n]+),", fields)}
                enums[name][key] = content or named
    return structs, enums


_STRUCTS, _ENUMS = _load()


def validate(document, arrays):
    """Raise AssertionError where the document is none that the core reads, or names arrays that are not as it says."""
    assert _STRUCTS["Document"], "the schema was not found"
    _check(document, "Document", "document")
    assert (document["format"], document["version"]) == ("abbe-scene", 1)
    used = _check_arrays(document, arrays)
    assert used == set(arrays), f"arrays that nothing names: {set(arrays) - used}"
    _check_references(document)


def _check(value, type_name, where):
    type_name = type_name.strip()
    generic = re.fullmatch(r"(\w+)<(.*)>", type_name)
    fixed = re.fullmatch(r"\[(\w+); (\d+)\]", type_name)
    if generic and generic[1] == "Option":
        if value is not None:
            _check(value, generic[2], where)
    elif generic and generic[1] == "Vec":
        assert isinstance(value, list), f"{where}: {value!r} is no list"
        for index, item in enumerate(value):
            _check(item, generic[2], f"{where}[{index}]")
    elif generic and generic[1] == "BTreeMap":
        assert isinstance(value, dict), f"{where}: {value!r} is no map"
        for key, item in value.items():
            assert isinstance(key, str)
            _check(item, generic[2].partition(",")[2], f"{where}.{key}")
    elif fixed:
        assert isinstance(value, list) and len(value) == int(fixed[2]), f"{where}: {value!r} is not {type_name}"
        for item in value:
            _check(item, fixed[1], where)
    elif type_name == "AuthoredMap":
        _check(value, "BTreeMap<String, Authored>", where)
    elif type_name == "Diagnostics":
        _check(value, "Vec<Warning>", where)
    elif type_name == "serde_json::Value":
        _check_json(value, where)
    elif type_name in ("Shape", "LightShape"):
        assert isinstance(value, dict) and len(value) == 1, f"{where}: {value!r} is no shape"
        ((kind, content),) = value.items()
        assert kind in _ENUMS[type_name], f"{where}: {value!r}"
        fields = _ENUMS[type_name][kind]
        if isinstance(fields, str):
            _check(content, fields, f"{where}.{kind}")
        else:
            assert set(content) == set(fields), f"{where}: {value!r}"
            for name, field_type in fields.items():
                _check(content[name], field_type, f"{where}.{kind}.{name}")
    elif type_name == "Target":
        assert isinstance(value, dict) and len(value) == 1 and set(value) <= {"shape", "group"}, f"{where}: {value!r}"
        _check(next(iter(value.values())), "usize", where)
    elif type_name in _STRUCTS:
        assert isinstance(value, dict), f"{where}: {value!r} is no {type_name}"
        fields = _STRUCTS[type_name]
        assert set(value) <= set(fields), f"{where}: unknown fields {set(value) - set(fields)}"
        for name, field_type, optional in fields.values():
            if name in value:
                _check(value[name], field_type, f"{where}.{name}")
            else:
                assert optional, f"{where}: {name} is missing"
    elif type_name == "String":
        assert type(value) is str, f"{where}: {value!r} is no string"
    elif type_name == "bool":
        assert type(value) is bool, f"{where}: {value!r} is no bool"
    elif type_name in ("u64", "usize", "u32", "i64"):
        assert type(value) is int, f"{where}: {value!r} is no integer"
        assert value >= 0 or type_name == "i64", f"{where}: {value!r} is negative"
    elif type_name == "f64":
        assert type(value) in (int, float) and math.isfinite(value), f"{where}: {value!r} is no finite number"
    else:
        raise AssertionError(f"{where}: the validator does not know the type {type_name}")


def _check_json(value, where):
    if isinstance(value, list):
        for item in value:
            _check_json(item, where)
    elif isinstance(value, float):
        assert math.isfinite(value), f"{where}: JSON has no {value}"
    else:
        assert type(value) in (bool, int, str), f"{where}: {value!r} is no JSON value"


def _check_arrays(document, arrays):
    used = set()

    def array(name, dtype, columns, where):
        assert name in arrays, f"{where}: names no array: {name}"
        assert name not in used, f"{where}: array {name} is named twice"
        used.add(name)
        value = arrays[name]
        assert value.dtype == dtype and value.flags.c_contiguous, f"{where}: {value.dtype}"
        shape = (len(value),) if columns == 1 else (len(value), columns)
        assert value.shape == shape, f"{where}: {value.shape}"

    for index, shape in enumerate(document["shapes"]):
        mesh, where = shape.get("mesh"), f"shapes[{index}]"
        if mesh is None:
            continue
        array(mesh["points"], np.float32, 3, where)
        for name in ("face_vertex_counts", "face_vertex_indices", "hole_indices"):
            if mesh.get(name) is not None:
                array(mesh[name], np.int32, 1, where)
        for name, columns in (("normals", 3), ("uv", 2)):
            primvar = mesh.get(name)
            if primvar is not None:
                array(primvar["values"], np.float32, columns, where)
                if primvar.get("indices") is not None:
                    array(primvar["indices"], np.int32, 1, where)
                assert primvar["interpolation"] in ("constant", "uniform", "varying", "vertex", "faceVarying")
        motion = mesh.get("motion") or {"times": [], "points": []}
        assert len(motion["points"]) == len(motion["times"]), where
        assert motion["times"] == sorted(set(motion["times"])), f"{where}: {motion['times']}"
        for names, like in ((motion["points"], mesh["points"]), (motion.get("normals", []), None)):
            for name in names:
                array(name, np.float32, 3, where)
                assert like is None or arrays[name].shape == arrays[like].shape, where
        for name, primvar in mesh.get("primvars", {}).items():
            values = arrays[primvar["values"]]
            columns = 1 if values.ndim == 1 else values.shape[1]
            assert columns <= 4 and name != mesh.get("uv_name"), f"{where}: {name}"
            array(primvar["values"], np.float32, columns, where)
            if primvar.get("indices") is not None:
                array(primvar["indices"], np.int32, 1, where)
        subdivision = mesh.get("subdivision") or {}
        for name in ("crease_indices", "crease_lengths", "corner_indices"):
            if name in subdivision:
                array(subdivision[name], np.int32, 1, where)
        for name in ("crease_sharpnesses", "corner_sharpnesses"):
            if name in subdivision:
                array(subdivision[name], np.float32, 1, where)
        for subset in mesh.get("subsets", []):
            array(subset["faces"], np.int32, 1, where)
    for index, texture in enumerate(document.get("textures", [])):
        for asset in [texture["asset"], *(tile["asset"] for tile in texture.get("tiles", []))]:
            name = asset.get("content")
            assert name is None or asset.get("file") is None, f"textures[{index}]: both file and content"
            # Textures of one file share what is in it.
            if name is not None and name not in used:
                array(name, np.uint8, 1, f"textures[{index}]")
    shared = set()
    for index, group in enumerate(document["groups"]):
        for instances in group.get("instances", []):
            where = f"groups[{index}]"
            name = instances["transforms"]
            # Native instances share an instancer's arrays.
            if name in shared:
                continue
            shared.add(name)
            array(name, np.float64, 12, where)
            places = len(arrays[name])
            for moved in (instances.get("places_motion") or {"transforms": []})["transforms"]:
                array(moved, np.float64, 12, where)
                assert len(arrays[moved]) == places, where
            if instances.get("indices") is None:
                assert places == instances["count"], f"{where}: {places} transforms of {instances['count']} elements"
                continue
            array(instances["indices"], np.int32, 1, where)
            indices = arrays[instances["indices"]]
            assert len(indices) == places, f"{where}: {len(indices)} indices of {places} transforms"
            assert (np.diff(indices) > 0).all() and indices[0] >= 0 and indices[-1] < instances["count"], where
    return used


def _check_references(document):
    assert document["root"] < len(document["groups"])
    for group in document["groups"]:
        for item in group["items"]:
            ((kind, index),) = item["target"].items()
            assert index < len(document["shapes" if kind == "shape" else "groups"])
            for material in [item.get("material"), *item.get("subset_materials", [])]:
                assert material is None or material < len(document["materials"])
        for instances in group.get("instances", []):
            assert instances["group"] < len(document["groups"])
    assert document["cameras"], "there is always a camera"
    settings = document["settings"]
    for product in [*settings.get("products", []), *filter(None, [settings.get("base")])]:
        assert product.get("camera") is None or product["camera"] < len(document["cameras"])
