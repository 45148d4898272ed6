"""MaterialX documents that a stage refers to: the same materials as where USD reads them itself, or a clear word."""

import sys
import time

import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd

from abbe.errors import StageError
from abbe.usd import describe, list_cameras
from abbe.usd.description import Diagnostics

if Sdf.FileFormat.FindByExtension("mtlx"):
    pytest.skip("this USD reads MaterialX itself", allow_module_level=True)
pytest.importorskip("MaterialX", reason="documents are read through the package that abbe[mtlx] brings")

from abbe.usd.documents import DocumentError
from abbe.usd.mtlx import read_document

GLASS = """  <open_pbr_surface name="Surface" type="surfaceshader">
    <input name="specular_ior" type="float" value="1.625" />
    <input name="transmission_weight" type="float" value="1" />
    <input name="transmission_color" type="color3" value="0.5, 0.25, 1" colorspace="srgb_texture" />
    <input name="geometry_thin_walled" type="boolean" value="true" />
  </open_pbr_surface>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="Surface" />
  </surfacematerial>
"""
BOUND = """def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = <%s>
}
"""


def document(body, version="1.39"):
    return (
        f'<?xml version="1.0"?>\n<materialx version="{version}" xmlns:xi="http://www.w3.org/2001/XInclude" '
        f'colorspace="lin_rec709">\n{body}</materialx>\n'
    )


@pytest.fixture
def write(tmp_path):
    """Write files by name, .mtlx and .usda bodies completed; return the folder."""

    def call(**files):
        for name, text in files.items():
            stem, _, extension = name.rpartition("_")
            path = tmp_path / f"{stem}.{extension}"
            if extension == "mtlx":
                text = text if text.startswith("<?xml") else document(text)
            elif not text.startswith("#usda"):
                text = "#usda 1.0\n" + text
            path.write_text(text)
        return tmp_path

    return call


def read(stage, **options):
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    description.to_json()
    return description


def warned(description, kind):
    return [warning for warning in description.warnings if warning["kind"] == kind]


def values(shader):
    return {name: item["value"] for name, item in shader["inputs"].items()}


def surface_of(folder, body, material="Glass", **options):
    """The surface of one material of a document, and the description."""
    (folder / "a.mtlx").write_text(document(body))
    (folder / "s.usda").write_text(
        f'#usda 1.0\ndef "X" (\n references = @./a.mtlx@</MaterialX>\n)\n{{\n}}\n{BOUND % f"/X/Materials/{material}"}'
    )
    description = read(folder / "s.usda", **options)
    (found,) = description.document["materials"]
    return found.get("surface"), description


# Arcs


def test_a_referenced_document_gives_its_materials(tmp_path):
    surface, description = surface_of(tmp_path, GLASS)
    assert surface == {
        "path": "/X/Materials/Glass/Surface",
        "id": "ND_open_pbr_surface_surfaceshader",
        "terminal": "outputs:mtlx:surface",
        "inputs": {
            "specular_ior": {"type": "float", "value": 1.625},
            "transmission_weight": {"type": "float", "value": 1.0},
            "transmission_color": {"type": "color3f", "value": [0.5, 0.25, 1.0]},
            "geometry_thin_walled": {"type": "bool", "value": True},
        },
        "connected": {},
        "abbe": {},
    }
    assert [warning["kind"] for warning in description.warnings] == ["framed-camera"]
    assert description.document["stage"]["source"] == str(tmp_path / "s.usda")


ARCS = {
    "reference": 'def "L" (\n references = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n',
    "payload": 'def "L" (\n payload = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n',
    "inner": 'def "L" (\n references = @./inner.usda@</I>\n)\n{\n}\n',
    "variant": 'def "L" (\n variants = {\n string v = "a"\n}\n prepend variantSets = "v"\n)\n{\n variantSet "v" = {\n'
    ' "a" (\n references = @./glass.mtlx@</MaterialX/Materials>\n) {\n}\n "b" (\n'
    " references = @./other.mtlx@</MaterialX/Materials>\n) {\n}\n}\n}\n",
    "inherited": 'class "C" (\n references = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n'
    'def "L" (\n inherits = </C>\n)\n{\n}\n',
}
INNER = 'def "I" (\n references = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n'


@pytest.mark.parametrize("arc", ARCS)
def test_documents_come_by_every_arc(write, arc):
    folder = write(glass_mtlx=GLASS, inner_usda=INNER, stage_usda=ARCS[arc] + BOUND % "/L/Glass")
    (material,) = read(folder / "stage.usda").document["materials"]
    assert material["path"] == "/L/Glass"
    assert values(material["surface"])["specular_ior"] == 1.625


def test_documents_come_as_sublayers(write):
    layers = "(\n subLayers = [@./glass.mtlx@]\n)\n"
    folder = write(glass_mtlx=GLASS, stage_usda=layers + BOUND % "/MaterialX/Materials/Glass")
    (material,) = read(folder / "stage.usda").document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625


def test_variants_and_overrides_asked_for_reach_documents(write):
    other = GLASS.replace("1.625", "1.75")
    folder = write(glass_mtlx=GLASS, other_mtlx=other, stage_usda=ARCS["variant"] + BOUND % "/L/Glass")

    def ior(**options):
        (material,) = read(folder / "stage.usda", **options).document["materials"]
        return values(material["surface"])["specular_ior"]

    assert ior(variants=["/L{v=b}"]) == 1.75
    assert ior(overrides=["/L/Glass.inputs:specular_ior=1.5"]) == 1.5
    assert ior(variants=["/L{v=b}"], overrides={"/L/Glass.inputs:specular_ior": 1.25}) == 1.25
    assert list_cameras(folder / "stage.usda", variants=["/L{v=b}"]) == []


def test_opinions_stronger_and_weaker_than_the_document_keep_their_strength(write):
    # The inner layer says something over the document, and the outer one over that.
    inner = (
        'def "I"\n{\n def "L" (\n references = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n over "Glass"\n{\n'
        " float inputs:specular_ior = 1.5\n float inputs:transmission_weight = 0.75\n}\n}\n}\n"
    )
    outer = (
        'def "W" (\n references = @./inner.usda@</I>\n)\n{\n over "L"\n{\n over "Glass"\n{\n'
        " float inputs:transmission_weight = 0.5\n}\n}\n}\n"
    )
    folder = write(glass_mtlx=GLASS, inner_usda=inner, stage_usda=outer + BOUND % "/W/L/Glass")
    (material,) = read(folder / "stage.usda").document["materials"]
    found = values(material["surface"])
    assert (found["specular_ior"], found["transmission_weight"]) == (1.5, 0.5)
    assert found["transmission_color"] == [0.5, 0.25, 1.0]


def test_instances_share_what_a_document_gives_their_prototype(write):
    asset = (
        'def "Asset"\n{\n def "L" (\n references = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n'
        + BOUND % "/Asset/L/Glass"
        + "}\n"
    )
    stage = "".join(
        f'def "{name}" (\n instanceable = true\n references = @./asset.usda@</Asset>\n)\n{{\n}}\n' for name in "AB"
    )
    folder = write(glass_mtlx=GLASS, asset_usda=asset, stage_usda=stage)
    description = read(folder / "stage.usda")
    (material,) = description.document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625
    assert [item["material"] for item in description.document["groups"][0]["items"]] == [0, 0]


def test_layers_that_refer_to_each_other_are_no_trouble(write):
    a = (
        'def "L" (\n references = [@./glass.mtlx@</MaterialX/Materials>, @./b.usda@</Other>]\n)\n{\n}\n'
        'def "Part"\n{\n}\n' + BOUND % "/L/Glass"
    )
    folder = write(glass_mtlx=GLASS, a_usda=a, b_usda='def "Other" (\n references = @./a.usda@</Part>\n)\n{\n}\n')
    (material,) = read(folder / "a.usda").document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625


def test_documents_in_packages_are_read(write):
    stage = 'def "L" (\n references = @glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n' + BOUND % "/L/Glass"
    folder = write(glass_mtlx='  <xi:include href="part.mtlx" />\n', part_mtlx=GLASS, stage_usda=stage)
    # USD moved it.
    writer = getattr(Sdf, "ZipFileWriter", None) or Usd.ZipFileWriter
    writer = writer.CreateNew(str(folder / "p.usdz"))
    for name in ("stage.usda", "glass.mtlx", "part.mtlx"):
        writer.AddFile(str(folder / name), name)
    assert writer.Save()
    (material,) = read(folder / "p.usdz").document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625


# What is not to be touched


def test_neither_files_nor_the_callers_stage_are_changed(write):
    folder = write(glass_mtlx=GLASS, inner_usda=INNER, stage_usda=ARCS["inner"] + BOUND % "/L/Glass")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    stage = Usd.Stage.Open(str(folder / "stage.usda"), Usd.Stage.LoadAll)
    stage.GetSessionLayer().ImportFromString('#usda 1.0\nover "Ball"\n{\n double radius = 3\n}\n')
    # What nobody saved counts.
    Sdf.Layer.Find(str(folder / "inner.usda")).GetPrimAtPath("/I").SetInfo("comment", "unsaved")
    over = stage.OverridePrim("/L/Glass").CreateAttribute("inputs:specular_ior", Sdf.ValueTypeNames.Float)
    over.Set(1.5)
    layers = {layer.identifier: layer.ExportToString() for layer in stage.GetUsedLayers()}
    prims = [str(prim.GetPath()) for prim in stage.TraverseAll()]
    description = read(stage)
    (material,) = description.document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.5
    assert values(material["surface"])["transmission_weight"] == 1.0
    assert description.document["shapes"][0]["sphere"]["radius"] == 3.0
    assert {layer.identifier: layer.ExportToString() for layer in stage.GetUsedLayers()} == layers
    assert [str(prim.GetPath()) for prim in stage.TraverseAll()] == prims
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_stage_in_memory_may_refer_to_documents(write):
    folder = write(glass_mtlx=GLASS)
    layer = Sdf.Layer.CreateAnonymous("memory.usda")
    arc = ARCS["reference"].replace("./glass.mtlx", f"{folder}/glass.mtlx")
    assert layer.ImportFromString(f"#usda 1.0\n{arc}{BOUND % '/L/Glass'}")
    stage = Usd.Stage.Open(layer)
    for _ in range(2):
        (material,) = read(stage).document["materials"]
        assert values(material["surface"])["specular_ior"] == 1.625
    assert not stage.GetPrimAtPath("/L/Glass")


def test_muted_layers_and_unloaded_payloads_stay_so(write):
    payload = 'def "L" (\n payload = @./glass.mtlx@</MaterialX/Materials>\n)\n{\n}\n'
    folder = write(glass_mtlx=GLASS, stage_usda=payload + BOUND % "/L/Glass")
    stage = Usd.Stage.Open(str(folder / "stage.usda"), Usd.Stage.LoadNone)
    assert read(stage).document["materials"] == []
    folder = write(other_usda="(\n subLayers = [@./stage.usda@]\n)\n" + 'def Sphere "Mine"\n{\n}\n')
    stage = Usd.Stage.Open(str(folder / "other.usda"))
    stage.MuteLayer(str(folder / "stage.usda"))
    assert read(stage).document["materials"] == []

    folder = write(third_usda=ARCS["reference"] + BOUND % "/L/Glass")
    stage = Usd.Stage.Open(str(folder / "third.usda"))
    assert len(read(stage).document["materials"]) == 1
    stage.MuteLayer(str(folder / "glass.mtlx"))
    assert read(stage).document["materials"] == []


@pytest.mark.parametrize("stage", ["stage.usda", "./stage.usda"])
def test_documents_are_found_from_where_the_stage_and_the_search_paths_are(tmp_path, monkeypatch, stage):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "GLASS.MTLX").write_text(document(GLASS))
    arc = ARCS["reference"].replace("./glass.mtlx", "GLASS.MTLX")
    (tmp_path / "stage.usda").write_text(f"#usda 1.0\n{arc}{BOUND % '/L/Glass'}")
    monkeypatch.chdir(tmp_path)
    assert read(stage).document["materials"] == []
    (material,) = read(stage, search_paths=["lib"]).document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625
    arc = ARCS["reference"].replace("./glass.mtlx", "./lib/GLASS.MTLX")
    (tmp_path / "stage.usda").write_text(f"#usda 1.0\n{arc}{BOUND % '/L/Glass'}")
    (material,) = read(stage).document["materials"]
    assert values(material["surface"])["specular_ior"] == 1.625


def test_a_usd_that_reads_documents_itself_is_left_alone(write, monkeypatch):
    folder = write(glass_mtlx=GLASS, stage_usda=ARCS["reference"] + BOUND % "/L/Glass")

    class Formats:
        @staticmethod
        def FindByExtension(extension):
            return extension == "mtlx" or Sdf.FileFormat.FindByExtension(extension)

    class Host:
        FileFormat = Formats

        def __getattr__(self, name):
            return getattr(Sdf, name)

    monkeypatch.setattr("abbe.usd.stage.Sdf", Host())
    monkeypatch.setattr("abbe.usd.stage.read_document", lambda *_: pytest.fail("is the host's to read"))
    describe(folder / "stage.usda")


# Documents


def test_the_layer_has_the_structure_that_usd_gives_a_document(write):
    """The prims, inputs and connections that the documentation and the source of UsdMtlx promise."""
    folder = write(
        glass_mtlx=GLASS
        + """  <nodegraph name="Graph">
    <input name="k" type="float" value="1.5" />
    <add name="Add" type="float">
      <input name="in1" type="float" interfacename="k" />
      <input name="in2" type="float" value="0.25" />
    </add>
    <image name="Image" type="color3">
      <input name="file" type="filename" value="x.png" colorspace="srgb_texture" />
    </image>
    <output name="sum" type="float" nodename="Add" />
  </nodegraph>
  <standard_surface name="SS" type="surfaceshader">
    <input name="specular_IOR" type="float" nodegraph="Graph" output="sum" />
  </standard_surface>
  <surfacematerial name="lib:Other" type="material" inherit="Glass">
    <input name="surfaceshader" type="surfaceshader" nodename="SS" />
  </surfacematerial>
"""
    )
    layer = read_document(str(folder / "glass.mtlx"), Diagnostics())
    stage = Usd.Stage.Open(layer)
    types = {str(prim.GetPath()): str(prim.GetTypeName()) for prim in stage.TraverseAll()}
    assert types == {
        "/MaterialX": "",
        "/MaterialX/Materials": "",
        "/MaterialX/Materials/Glass": "Material",
        "/MaterialX/Materials/Glass/Surface": "Shader",
        "/MaterialX/Materials/lib__Other": "Material",
        "/MaterialX/Materials/lib__Other/SS": "Shader",
        # What it specializes comes with it.
        "/MaterialX/Materials/lib__Other/Surface": "Shader",
        "/MaterialX/Materials/lib__Other/Graph": "NodeGraph",
        "/MaterialX/Materials/lib__Other/Graph/Add": "Shader",
        "/MaterialX/Materials/lib__Other/Graph/Image": "Shader",
        "/MaterialX/NodeGraphs": "NodeGraph",
        "/MaterialX/NodeGraphs/Graph": "NodeGraph",
        "/MaterialX/NodeGraphs/Graph/Add": "Shader",
        "/MaterialX/NodeGraphs/Graph/Image": "Shader",
        "/MaterialX/Shaders": "",
        "/MaterialX/Shaders/SS": "Shader",
        "/MaterialX/Shaders/Surface": "Shader",
    }
    glass = stage.GetPrimAtPath("/MaterialX/Materials/Glass")
    assert glass.GetAttribute("config:mtlx:version").Get() == "1.39"
    assert glass.GetMetadata("apiSchemas").GetAppliedItems() == ["MaterialXConfigAPI"]
    # The whole interface of the shader is the material's, with values where the document has them.
    shader = stage.GetPrimAtPath("/MaterialX/Materials/Glass/Surface")
    inputs = [item for item in shader.GetAttributes() if item.GetName().startswith("inputs:")]
    assert len(inputs) > 35
    for item in inputs:
        assert [str(path) for path in item.GetConnections()] == [f"/MaterialX/Materials/Glass.{item.GetName()}"]
        assert glass.GetAttribute(item.GetName()).GetTypeName() == item.GetTypeName()
    assert sum(glass.GetAttribute(item.GetName()).HasAuthoredValue() for item in inputs) == 4
    # Colour spaces are kept where they are not the document's.
    assert layer.customLayerData == {"colorSpace": "lin_rec709"}
    assert glass.GetAttribute("inputs:transmission_color").GetColorSpace() == "srgb_texture"
    image = stage.GetPrimAtPath("/MaterialX/NodeGraphs/Graph/Image").GetAttribute("inputs:file")
    assert image.GetColorSpace() == "srgb_texture"
    assert image.Get().path == str(folder / "x.png")
    driven = stage.GetPrimAtPath("/MaterialX/Materials/lib__Other/SS").GetAttribute("inputs:specular_IOR")
    assert [str(path) for path in driven.GetConnections()] == ["/MaterialX/Materials/lib__Other/Graph.outputs:sum"]


NETWORK = """  <nodedef name="ND_mean" node="mean">
    <input name="a" type="float" value="1" />
    <input name="b" type="float" value="2" />
    <output name="out" type="float" />
  </nodedef>
  <nodegraph name="NG_mean" nodedef="ND_mean">
    <add name="sum" type="float">
      <input name="in1" type="float" interfacename="a" />
      <input name="in2" type="float" interfacename="b" />
    </add>
    <multiply name="half" type="float">
      <input name="in1" type="float" nodename="sum" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="float" nodename="half" />
  </nodegraph>
  <constant name="top" type="float">
    <input name="value" type="float" value="1.75" />
  </constant>
  <nodegraph name="Graph">
    <input name="k" type="float" nodename="top" />
    <separate3 name="apart" type="multioutput">
      <input name="in" type="color3" value="0.5, 0.25, 1" />
    </separate3>
    <mean name="between" type="float">
      <input name="a" type="float" interfacename="k" />
      <input name="b" type="float" nodename="apart" output="outg" />
    </mean>
    <output name="mean" type="float" nodename="between" />
    <output name="green" type="float" nodename="apart" output="outg" />
  </nodegraph>
  <mean name="direct" type="float">
    <input name="b" type="float" nodename="top" />
  </mean>
  <image name="image" type="float">
    <input name="file" type="filename" value="x.png" />
  </image>
  <open_pbr_surface name="Surface" type="surfaceshader">
    <input name="specular_ior" type="float" nodegraph="Graph" output="mean" />
    <input name="transmission_weight" type="float" nodegraph="Graph" output="green" />
    <input name="coat_weight" type="float" nodename="direct" />
    <input name="specular_roughness" type="float" nodename="image" />
  </open_pbr_surface>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="Surface" />
  </surfacematerial>
"""


def test_constants_come_through_the_networks_of_a_document(tmp_path):
    surface, description = surface_of(tmp_path, NETWORK)
    # (7/4 + 1/4) / 2, 1/4, (1 + 7/4) / 2.
    assert values(surface) == {"specular_ior": 1.0, "transmission_weight": 0.25, "coat_weight": 1.375}
    assert surface["connected"] == {"specular_roughness": "/X/Materials/Glass/NodeGraphs/image.outputs:out"}
    assert not warned(description, "materialx")


def test_older_documents_are_read_as_what_they_mean_today(write):
    # 1.38 had <swizzle>, channels on inputs, and versions of nodes.
    body = """  <constant name="c" type="color3">
    <input name="value" type="color3" value="1, 1.5, 2" />
  </constant>
  <swizzle name="g" type="float">
    <input name="in" type="color3" nodename="c" />
    <input name="channels" type="string" value="g" />
  </swizzle>
  <standard_surface name="S" type="surfaceshader" version="1.0.0">
    <input name="specular_IOR" type="float" nodename="g" />
    <input name="transmission" type="float" nodename="c" channels="r" />
  </standard_surface>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>
"""
    folder = write(glass_mtlx=document(body, "1.38"), stage_usda=ARCS["reference"] + BOUND % "/L/Glass")
    (material,) = read(folder / "stage.usda").document["materials"]
    assert material["surface"]["id"] == "ND_standard_surface_surfaceshader_100"
    assert values(material["surface"]) == {"specular_IOR": 1.5, "transmission": 1.0}


def test_a_surface_inside_a_graph_keeps_its_surroundings(tmp_path):
    body = """  <nodegraph name="Graph">
    <input name="k" type="float" value="1.75" />
    <constant name="c" type="float"><input name="value" type="float" value="0.5" /></constant>
    <open_pbr_surface name="Inner" type="surfaceshader">
      <input name="specular_ior" type="float" interfacename="k" />
      <input name="transmission_weight" type="float" nodename="c" />
      <input name="specular_weight" type="float" value="0.25" />
    </open_pbr_surface>
    <output name="out" type="surfaceshader" nodename="Inner" />
  </nodegraph>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodegraph="Graph" output="out" />
  </surfacematerial>
"""
    surface, _ = surface_of(tmp_path, body)
    assert values(surface) == {"specular_ior": 1.75, "transmission_weight": 0.5, "specular_weight": 0.25}


def test_a_surface_of_the_documents_own_is_the_graph_it_is(tmp_path):
    body = """  <nodedef name="ND_window" node="window">
    <input name="n" type="float" value="1.5" />
    <output name="out" type="surfaceshader" />
  </nodedef>
  <nodegraph name="NG_window" nodedef="ND_window">
    <open_pbr_surface name="Inner" type="surfaceshader">
      <input name="specular_ior" type="float" interfacename="n" />
      <input name="transmission_weight" type="float" value="1" />
    </open_pbr_surface>
    <output name="out" type="surfaceshader" nodename="Inner" />
  </nodegraph>
  <window name="Pane" type="surfaceshader">
    <input name="n" type="float" value="1.625" />
  </window>
  <surfacematerial name="Glass" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="Pane" />
  </surfacematerial>
"""
    surface, _ = surface_of(tmp_path, body)
    assert surface["id"] == "ND_open_pbr_surface_surfaceshader"
    assert values(surface) == {"specular_ior": 1.625, "transmission_weight": 1.0}


def test_included_documents_are_found_beside_the_one_that_includes_them(write, tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "glass.mtlx").write_text(document('  <xi:include href="surface.mtlx" />\n'))
    (tmp_path / "lib" / "surface.mtlx").write_text(document(GLASS))
    includes = '  <xi:include href="stdlib/stdlib_defs.mtlx" />\n  <xi:include href="lib/glass.mtlx" />\n'
    surface, description = surface_of(tmp_path, includes)
    assert values(surface)["specular_ior"] == 1.625
    assert not warned(description, "materialx")


# What is wrong


def refused(folder, text, **options):
    """Why a document is not read; the stage is."""
    (folder / "a.mtlx").write_text(text)
    (folder / "s.usda").write_text(
        f'#usda 1.0\ndef "X" (\n references = @./a.mtlx@</MaterialX>\n)\n{{\n}}\n{BOUND % "/X/Materials/Glass"}'
    )
    description = read(folder / "s.usda", **options)
    assert description.document["materials"] == []
    (warning,) = warned(description, "missing-reference")
    assert warning["places"] == ["</X>"]
    assert warning["message"].startswith(f"@{folder}/a.mtlx@ ")
    with pytest.raises(StageError, match=r"^</X>: @.*a\.mtlx@"):
        describe(folder / "s.usda", missing="error")
    return warning["message"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no element found"),
        ("<materialx", "unclosed token"),
        (document("<input"), "correct the document"),
        ("<?xml version='1.0'?><scene />", "No root MaterialX element"),
        (document("").encode("utf-16").decode("latin-1"), "is no XML in UTF-8"),
        (document('  <xi:include href="nowhere.mtlx" />\n'), "nowhere.mtlx: there is no such file"),
        (document('  <xi:include href="a.mtlx" />\n'), "a.mtlx: includes itself"),
        (
            '<?xml version="1.0"?><!DOCTYPE materialx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;">]>'
            '<materialx version="1.39" doc="&b;" />',
            "DOCTYPE",
        ),
        (document("<a>" * 100_000 + "</a>" * 100_000), "within each other"),
        (document("<a/>" * 300_000), "elements"),
        (document(f'  <input name="{"n" * 17_000_000}" />'), "larger than 16,000,000 bytes"),
    ],
    ids=["empty", "cut", "tag", "root", "utf16", "absent", "itself", "entities", "deep", "many", "large"],
)
def test_a_document_that_cannot_be_read_is_named_with_the_reason(tmp_path, text, reason):
    start = time.monotonic()
    assert reason in refused(tmp_path, text)
    # Found before anything is built; the limit is generous to a busy machine.
    assert time.monotonic() - start < 30


def test_documents_that_include_each_other_are_refused(tmp_path):
    (tmp_path / "b.mtlx").write_text(document('  <xi:include href="c.mtlx" />\n'))
    (tmp_path / "c.mtlx").write_text(document('  <xi:include href="b.mtlx" />\n'))
    assert "b.mtlx: includes itself" in refused(tmp_path, document('  <xi:include href="b.mtlx" />\n'))


def test_a_document_that_is_not_there_is_a_missing_reference(write):
    folder = write(stage_usda='def "X" (\n references = @./gone.mtlx@</MaterialX>\n)\n{\n}\ndef Sphere "S"\n{\n}\n')
    (warning,) = warned(read(folder / "stage.usda"), "missing-reference")
    assert warning["places"] == ["</X>"] and "gone.mtlx" in warning["message"]
    assert "materialx package" not in warning["message"] and "abbe[mtlx]" not in warning["message"]


def test_without_the_package_the_remedy_is_named(write, monkeypatch):
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    folder = write(glass_mtlx=GLASS, stage_usda=ARCS["reference"] + BOUND % "/L/Glass")
    (warning,) = warned(read(folder / "stage.usda"), "missing-reference")
    assert "pip install 'abbe[mtlx]'" in warning["message"]
    # Only where there is a document.
    folder = write(plain_usda='def Sphere "S"\n{\n}\n')
    assert [w["kind"] for w in read(folder / "plain.usda").warnings] == ["framed-camera"]


def test_a_material_that_is_not_in_the_document_is_named(write):
    folder = write(
        glass_mtlx=GLASS, stage_usda='def "X" (\n references = @./glass.mtlx@</MaterialX/Materials/Gone>\n)\n{\n}\n'
    )
    (warning,) = warned(read(folder / "stage.usda"), "missing-reference")
    assert warning["places"] == ["</X>"]
    assert "@glass.mtlx@</MaterialX/Materials/Gone>" in warning["message"]
    assert "0x" not in warning["message"] and "abbe=" not in warning["message"]


def test_inputs_that_do_not_fit_are_left_out_by_themselves(tmp_path):
    body = GLASS.replace(
        '<input name="transmission_weight" type="float" value="1" />',
        '<input name="transmission_weight" type="integer" value="1" />\n'
        '<input name="transmision_depth" type="float" value="1" />\n'
        '<input name="coat_ior" type="float" value="high" />\n'
        '<input name="base_color" type="color3" value="1, 2" />\n'
        '<input name="coat_weight" type="float" nodename="gone" />\n'
        '<input name="fuzz_weight" type="float" nodegraph="gone" output="out" />',
    )
    surface, description = surface_of(tmp_path, body)
    assert set(values(surface)) == {"specular_ior", "transmission_color", "geometry_thin_walled"}
    said = {warning["places"][0].rpartition("/")[2]: warning["message"] for warning in warned(description, "materialx")}
    assert said == {
        "transmission_weight": "is of type integer where ND_open_pbr_surface_surfaceshader has float; ignored",
        "transmision_depth": "ND_open_pbr_surface_surfaceshader has no such input; it is ignored",
        "coat_ior": "'high' is no value of type float; it is ignored",
        "base_color": "'1, 2' is no value of type color3; it is ignored",
        "coat_weight": "refers to the node 'gone', which is not there; the connection is ignored",
        "fuzz_weight": "refers to the node graph 'gone', which is not there; the connection is ignored",
    }
    assert all(
        warning["places"][0].startswith(f"{tmp_path}/a.mtlx: Surface/") for warning in warned(description, "materialx")
    )


def test_a_shader_that_nobody_defines_is_named(tmp_path):
    surface, description = surface_of(tmp_path, GLASS.replace("open_pbr_surface", "vendor_surface"))
    assert surface is None
    (warning,) = warned(description, "materialx")
    assert "define <vendor_surface> of type surfaceshader" in warning["message"]


def nested(count, copies, last):
    """Node definitions, each made of ``copies`` of the next, the last of what is given."""
    text = []
    for k in range(count):
        inner = f"n{k + 1}" if k + 1 < count else last
        nodes = "".join(f'<{inner} name="x{c}" type="float" />' for c in range(copies))
        text.append(
            f'<nodedef name="ND_n{k}" node="n{k}"><input name="i" type="float" value="1" />'
            f'<output name="out" type="float" /></nodedef><nodegraph name="NG_n{k}" nodedef="ND_n{k}">{nodes}'
            '<output name="out" type="float" nodename="x0" /></nodegraph>\n'
        )
    return "".join(text)


USES = GLASS.replace(
    '<input name="transmission_weight" type="float" value="1" />',
    '<input name="transmission_weight" type="float" nodename="outer" />',
)


@pytest.mark.parametrize(
    ("definitions", "reason"),
    [
        (nested(3, 1, "n0"), "is made of itself"),
        (nested(40, 2, "constant"), "unfolds to more than"),
        (nested(500, 1, "constant"), "unfolds to more than"),
        (
            '<nodedef name="ND_n0" node="n0"><output name="out" type="float" /></nodedef>\n',
            "not defined by a node graph",
        ),
    ],
    ids=["circle", "doubling", "chain", "abstract"],
)
def test_nodes_that_cannot_be_unfolded_stay_connected(tmp_path, definitions, reason):
    start = time.monotonic()
    surface, description = surface_of(tmp_path, definitions + '<n0 name="outer" type="float" />\n' + USES)
    assert set(surface["connected"]) == {"transmission_weight"}
    assert values(surface)["specular_ior"] == 1.625
    assert any(reason in warning["message"] for warning in warned(description, "materialx"))
    assert time.monotonic() - start < 30


def test_materials_that_derive_from_each_other_in_a_circle_are_refused(tmp_path):
    body = GLASS.replace('name="Glass" type="material"', 'name="Glass" type="material" inherit="Glass"')
    assert "Encountered cycle" in refused(tmp_path, document(body))


def test_a_chain_of_nodes_longer_than_the_stack_is_read(tmp_path):
    chain = '<constant name="n0" type="float"><input name="value" type="float" value="1" /></constant>\n' + "".join(
        f'<dot name="n{k}" type="float"><input name="in" type="float" nodename="n{k - 1}" /></dot>\n'
        for k in range(1, 2000)
    )
    surface, _ = surface_of(tmp_path, chain + USES.replace('"outer"', '"n1999"'))
    assert set(surface["connected"]) == {"transmission_weight"}


def test_errors_of_the_package_are_the_documents(write, monkeypatch):
    folder = write(glass_mtlx=GLASS)
    monkeypatch.setattr("abbe.usd.mtlx._standard_library", lambda: 1 / 0)
    with pytest.raises(DocumentError, match=r"cannot be read as MaterialX \(division by zero\)"):
        read_document(str(folder / "glass.mtlx"), Diagnostics())
