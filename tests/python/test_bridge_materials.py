"""What the bridge makes of materials: terminals, names of shaders, constants through connections, composition."""

import pytest

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from material_stages import BALL, folded, material_of, node, read, stage_of, surface_of, warned
from pxr import Sdf, Usd, UsdGeom, UsdShade

# Terminals

TERMINALS = {
    "outputs:surface": "UsdPreviewSurface",
    "outputs:abbe:surface": "AbbeGlass",
    "outputs:mtlx:surface": "ND_open_pbr_surface_surfaceshader",
    "outputs:vray:surface": "VRayMtl",
    "outputs:arnold:surface": "arnold:standard_surface",
    "outputs:moonray:surface": "DielectricMaterial",
    "outputs:ri:surface": "PxrSurface",
}


def with_terminals(terminals):
    """A material whose terminals, authored in the order given, lead to shaders of their own."""
    shaders = "".join(
        node(identifier, name=name.replace(":", "_"), output="token outputs:out")
        for name, identifier in terminals.items()
    )
    outputs = "".join(f" token {name}.connect = </M/{name.replace(':', '_')}.outputs:out>\n" for name in terminals)
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString(f'#usda 1.0\n{BALL % ""}\ndef Material "M"\n{{\n{outputs}{shaders}\n}}\n')
    return Usd.Stage.Open(layer)


def test_every_terminal_hands_over_its_shader_in_order():
    material = material_of(with_terminals(TERMINALS))
    assert [shader["terminal"] for shader in (material["surface"], *material["alternatives"])] == [
        "outputs:abbe:surface",
        "outputs:mtlx:surface",
        "outputs:surface",
        "outputs:arnold:surface",
        "outputs:moonray:surface",
        "outputs:ri:surface",
        "outputs:vray:surface",
    ]
    assert all(TERMINALS[s["terminal"]] == s["id"] for s in (material["surface"], *material["alternatives"]))


def test_a_shader_of_two_terminals_is_handed_over_once():
    stage = stage_of(
        "float inputs:ior = 1.6", material=" token outputs:mtlx:surface.connect = </M/S.outputs:surface>\n"
    )
    material = material_of(stage)
    assert material["alternatives"] == []
    assert material["surface"]["terminal"] == "outputs:mtlx:surface"


def test_a_terminal_that_leads_nowhere_is_named_and_passed_over():
    stage = stage_of("float inputs:ior = 1.6", material=" token outputs:abbe:surface.connect = </M/Gone.outputs:out>\n")
    description = read(stage)
    (material,) = description.document["materials"]
    assert material["surface"]["terminal"] == "outputs:surface"
    assert warned(description, "dangling-connection")[0]["places"] == ["</M>.outputs:abbe:surface"]


def test_terminals_lead_through_graphs_and_wrappers():
    wrapped = (
        'def NodeGraph "G"\n{\n token outputs:s.connect = </M/G/H.outputs:s>\n'
        ' def NodeGraph "H"\n{\n token outputs:s.connect = </M/G/H/D.outputs:out>\n'
        + node("ND_dot_surfaceshader", " token inputs:in.connect = </M/S.outputs:surface>", "token outputs:out", "D")
        + "}\n}\n"
    )
    stage = stage_of(
        "float inputs:ior = 1.6", material=" token outputs:mtlx:surface.connect = </M/G.outputs:s>\n" + wrapped
    )
    material = material_of(stage)
    assert material["surface"]["path"] == "/M/S"
    assert material["surface"]["terminal"] == "outputs:mtlx:surface"


# Names of shaders


@pytest.mark.parametrize(
    ("info", "terminal", "expected"),
    [
        ('uniform token info:id = "arnold:standard_surface"', "arnold", "arnold:standard_surface"),
        (
            'uniform token info:implementationSource = "sourceAsset"\n'
            "uniform asset info:mdl:sourceAsset = @OmniGlass.mdl@\n"
            'uniform token info:mdl:sourceAsset:subIdentifier = "OmniGlass"',
            "mdl",
            "OmniGlass",
        ),
        # Without a sub-identifier a module has the one material that it is named after.
        (
            'uniform token info:implementationSource = "sourceAsset"\n'
            "uniform asset info:mdl:sourceAsset = @../mdl/OmniSurface.mdl@",
            "mdl",
            "OmniSurface",
        ),
        # MDL tells overloads apart by the types of their parameters.
        (
            'uniform token info:implementationSource = "sourceAsset"\n'
            "uniform asset info:mdl:sourceAsset = @nvidia/core_definitions.mdl@\n"
            "uniform token info:mdl:sourceAsset:subIdentifier = "
            '"mdl::nvidia::core_definitions::thick_glass_v2(color,float)"',
            "mdl",
            "thick_glass_v2",
        ),
        # Of two languages, that of the terminal.
        (
            'uniform token info:implementationSource = "sourceAsset"\n'
            "uniform asset info:mdl:sourceAsset = @A.mdl@\nuniform asset info:osl:sourceAsset = @B.oso@",
            "osl",
            "B",
        ),
        ('uniform token info:implementationSource = "sourceCode"\nuniform string info:sourceCode = "x"', "osl", ""),
    ],
)
def test_a_shader_has_the_name_of_its_code(info, terminal, expected):
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString(
        f'#usda 1.0\n{BALL % ""}\ndef Material "M"\n{{\n'
        f" token outputs:{terminal}:surface.connect = </M/S.outputs:out>\n"
        f'def Shader "S"\n{{\n{info}\n token outputs:out\n}}\n}}\n'
    )
    assert material_of(Usd.Stage.Open(layer))["surface"]["id"] == expected


# Connections

NESTED = """
    float inputs:ior = 1.625
    float inputs:open
    def NodeGraph "A"
    {
        float inputs:k.connect = </M.inputs:ior>
        float inputs:own = 1.25
        float inputs:own.connect = </M.inputs:open>
        float outputs:k.connect = </M/A/B.outputs:k>
        float outputs:twice.connect = </M/A/B/Add.outputs:out>
        def NodeGraph "B"
        {
            float inputs:k.connect = </M/A.inputs:k>
            float outputs:k.connect = </M/A/B.inputs:k>
            def Shader "Add"
            {
                uniform token info:id = "ND_add_float"
                float inputs:in1.connect = </M/A/B.inputs:k>
                float inputs:in2.connect = </M/A.inputs:own>
                float outputs:out
            }
        }
    }
"""


def test_values_come_through_interfaces_and_nested_graphs():
    surface = surface_of(
        "float inputs:ior = 9\nfloat inputs:ior.connect = </M.inputs:ior>\n"
        "float inputs:through.connect = </M/A.outputs:k>\nfloat inputs:sum.connect = </M/A.outputs:twice>",
        material=NESTED,
    )
    assert surface["inputs"] == {
        "ior": {"type": "float", "value": 1.625},
        "through": {"type": "float", "value": 1.625},
        "sum": {"type": "float", "value": 2.875},
    }
    assert surface["connected"] == {}


def test_inputs_without_a_value_are_left_to_the_shader():
    stage = stage_of(
        "float inputs:a.connect = </M.inputs:open>\nfloat inputs:b = 1.5\nfloat inputs:b.connect = </M.inputs:open>\n"
        "float inputs:c\nfloat inputs:d = None",
        material=" float inputs:open\n",
    )
    description = read(stage)
    (material,) = description.document["materials"]
    assert material["surface"]["inputs"] == {"b": {"type": "float", "value": 1.5}}
    assert material["surface"]["connected"] == {}
    assert not warned(description, "dangling-connection")


def test_our_attributes_follow_connections_on_shader_and_interface():
    stage = stage_of(
        "double inputs:abbe:dispersion:vd.connect = </M/N.outputs:out>",
        material=" double inputs:abbe:dispersion:nd = 1.5\n"
        + node("ND_constant_float", "float inputs:value = 40", "float outputs:out"),
    )
    material = material_of(stage)
    assert material["surface"]["abbe"] == {"abbe:dispersion:vd": {"type": "float", "value": 40.0}}
    assert material["interface_abbe"] == {"abbe:dispersion:nd": {"type": "double", "value": 1.5}}


def test_connections_in_a_circle_end():
    stage = stage_of(
        "float inputs:a.connect = </M.inputs:x>\nfloat inputs:b = 1.5\nfloat inputs:b.connect = </M.inputs:x>\n"
        "float inputs:c.connect = </M/P.outputs:out>\nfloat inputs:d.connect = </M/S.inputs:d>",
        material=" float inputs:x.connect = </M.inputs:y>\n float inputs:y.connect = </M.inputs:x>\n"
        + node("ND_dot_float", "float inputs:in.connect = </M/Q.outputs:out>", name="P")
        + node("ND_dot_float", "float inputs:in.connect = </M/P.outputs:out>", name="Q"),
    )
    description = read(stage)
    surface = description.document["materials"][0]["surface"]
    assert surface["inputs"] == {"b": {"type": "float", "value": 1.5}}
    assert surface["connected"] == {"c": "/M/P.outputs:out"}
    places = [place for warning in warned(description, "dangling-connection") for place in warning["places"]]
    assert places == ["</M/S>.inputs:a", "</M/S>.inputs:d"]


def test_networks_of_any_shape_are_read_in_time():
    # Every node adds the one before to itself: 2^40 ways lead to the first.
    nodes = [node("ND_constant_float", "float inputs:value = 1", name="N0")]
    for k in range(1, 41):
        before = f"</M/N{k - 1}.outputs:out>"
        inputs = f"float inputs:in1.connect = {before}\nfloat inputs:in2.connect = {before}"
        nodes.append(node("ND_add_float", inputs, name=f"N{k}"))
    surface = surface_of("float inputs:x.connect = </M/N40.outputs:out>", material="".join(nodes))
    assert surface["inputs"]["x"]["value"] == 2.0**40
    # A chain deeper than the interpreter's stack.
    nodes = [node("ND_constant_float", "float inputs:value = 1", name="N0")]
    for k in range(1, 3001):
        nodes.append(node("ND_dot_float", f"float inputs:in.connect = </M/N{k - 1}.outputs:out>", name=f"N{k}"))
    surface = surface_of("float inputs:x.connect = </M/N3000.outputs:out>", material="".join(nodes))
    assert surface["connected"] == {"x": "/M/N3000.outputs:out"}
    # As deep through containers alone.
    lines = ["float inputs:k0 = 1.5\n"]
    lines += [f"float inputs:k{k}.connect = </M.inputs:k{k - 1}>\n" for k in range(1, 3001)]
    surface = surface_of("float inputs:x.connect = </M.inputs:k3000>", material="".join(lines))
    assert surface["inputs"]["x"]["value"] == 1.5


def test_values_are_those_of_the_frame():
    inputs = "float inputs:in1.timeSamples = { 1: 1.25, 3: 1.75 }\nfloat inputs:in2 = 0.25"
    stage = stage_of("float inputs:ior.connect = </M/N.outputs:out>", material=node("ND_add_float", inputs))
    for frame, expected in ((1, 1.5), (2, 1.75), (3, 2.0)):
        assert material_of(stage, frame=frame)["surface"]["inputs"]["ior"]["value"] == expected


# Primvars

READER = 'string inputs:varname = "n"\nfloat inputs:fallback = 1.5'


@pytest.mark.parametrize(
    ("identifier", "inputs"),
    [
        ("UsdPrimvarReader_float", READER),
        ("ND_UsdPrimvarReader_float", READER),
        ("ND_geompropvalue_float", 'string inputs:geomprop = "n"\nfloat inputs:default = 1.5'),
    ],
)
def test_a_primvar_that_no_geometry_has_is_its_fallback(identifier, inputs):
    output = "float outputs:result" if identifier.startswith("Usd") else "float outputs:out"
    shader = node(identifier, inputs, output)
    body = f"float inputs:ior.connect = </M/N.{output.split()[1]}>"
    assert surface_of(body, material=shader)["inputs"]["ior"] == {"type": "float", "value": 1.5}
    surface = surface_of(body, material=shader, ball=" float primvars:n = 1.25")
    assert surface["connected"]["ior"].startswith("/M/N.")
    # Declared without a value it says nothing.
    assert "ior" in surface_of(body, material=shader, ball=" float primvars:n")["inputs"]


def test_a_primvar_of_any_user_counts_wherever_it_stands():
    shader = node("UsdPrimvarReader_float", READER, "float outputs:result")
    body = "float inputs:ior.connect = </M/N.outputs:result>"
    binding = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    # On another user of the material; on the parent of one; on the mesh of a subset.
    for extra in (
        f'def Sphere "Other" ({binding})\n{{\n rel material:binding = </M>\n float primvars:n = 1.25\n}}\n',
        f'def Xform "X"\n{{\n float primvars:n = 1.25\n def Sphere "Other" ({binding})\n{{\n'
        " rel material:binding = </M>\n}\n}\n",
        'def Mesh "Q"\n{\n uniform token subdivisionScheme = "none"\n int[] faceVertexCounts = [3]\n'
        " int[] faceVertexIndices = [0, 1, 2]\n point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n"
        ' float[] primvars:n = [1, 2, 3] (\n interpolation = "vertex"\n)\n'
        f' def GeomSubset "s" ({binding})\n{{\n uniform token elementType = "face"\n'
        ' uniform token familyName = "materialBind"\n int[] indices = [0]\n rel material:binding = </M>\n}\n}\n',
    ):
        surface = surface_of(body, material=shader, extra=extra)
        assert surface["connected"] == {"ior": "/M/N.outputs:result"}, extra
    # Not on a user of it.
    unrelated = 'def Sphere "Other"\n{\n float primvars:n = 1.25\n}\n'
    assert surface_of(body, material=shader, extra=unrelated)["inputs"]["ior"]["value"] == 1.5


def test_a_reader_may_name_its_primvar_through_the_interface():
    inputs = "string inputs:varname.connect = </M.inputs:which>\nfloat inputs:fallback = 1.5"
    shader = ' string inputs:which = "n"\n' + node("UsdPrimvarReader_float", inputs, "float outputs:result")
    body = "float inputs:ior.connect = </M/N.outputs:result>"
    assert surface_of(body, material=shader, ball=" float primvars:n = 2")["connected"]
    assert surface_of(body, material=shader, ball=" float primvars:m = 2")["inputs"]["ior"]["value"] == 1.5


def test_a_fallback_that_nobody_gave_is_zero():
    for identifier, type_name, zero in (
        ("UsdPrimvarReader_float", "float", 0.0),
        ("UsdPrimvarReader_normal", "normal3f", [0.0, 0.0, 0.0]),
        ("ND_geompropvalue_color3", "color3f", [0.0, 0.0, 0.0]),
    ):
        assert folded(identifier, "", f"{type_name} outputs:out", type_name) == {"type": type_name, "value": zero}


# Composition


def compose(text):
    """A stage in memory from .usda text."""
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


GLASS = """class Material "Base"
{
    float inputs:ior = 1.5
    float inputs:roughness = 0.25
    token outputs:surface.connect = </Base/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:ior.connect = </Base.inputs:ior>
        float inputs:roughness.connect = </Base.inputs:roughness>
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize("arc", ["inherits", "specializes", "references"])
def test_materials_compose_over_what_they_derive_from(arc):
    stage = compose(
        GLASS + f'def Material "M" (\n {arc} = </Base>\n)\n{{\n float inputs:ior = 1.75\n}}\n' + BALL % "",
    )
    surface = material_of(stage)["surface"]
    assert surface["path"] == "/M/S"
    assert {name: item["value"] for name, item in surface["inputs"].items()} == {"ior": 1.75, "roughness": 0.25}


def test_a_base_material_is_composed():
    stage = compose(GLASS.replace("class", "def") + 'def Material "M"\n{\n}\n' + BALL % "")
    material = UsdShade.Material(stage.GetPrimAtPath("/M"))
    material.SetBaseMaterial(UsdShade.Material(stage.GetPrimAtPath("/Base")))
    material.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.0)
    surface = material_of(stage)["surface"]
    assert {name: item["value"] for name, item in surface["inputs"].items()} == {"ior": 1.5, "roughness": 0.0}


def test_materials_in_prototypes_and_outside_serve_instances():
    stage = compose(
        """
class Xform "Asset"
{
    def Material "Own"
    {
        float inputs:ior = 1.5
        token outputs:surface.connect = </Asset/Own/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:ior.connect = </Asset/Own.inputs:ior>
            float inputs:opacity.connect = </Asset/Own/R.outputs:result>
            token outputs:surface
        }
        def Shader "R"
        {
            uniform token info:id = "UsdPrimvarReader_float"
            string inputs:varname = "o"
            float inputs:fallback = 0.25
            float outputs:result
        }
    }
    def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </Asset/Own>
    }
}
def "A" (
    instanceable = true
    inherits = </Asset>
)
{
}
def "B" (
    instanceable = true
    inherits = </Asset>
)
{
}
"""
    )
    description = read(stage)
    (material,) = description.document["materials"]
    assert {name: item["value"] for name, item in material["surface"]["inputs"].items()} == {
        "ior": 1.5,
        "opacity": 0.25,
    }
    items = description.document["groups"][0]["items"]
    assert [(item["path"], item["material"]) for item in items] == [("/A/Ball", 0), ("/B/Ball", 0)]
    # An instance hands a primvar down into the prototype, where all share the material.
    UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/B")).CreatePrimvar("o", Sdf.ValueTypeNames.Float, "constant").Set(1.0)
    (material,) = read(stage).document["materials"]
    assert set(material["surface"]["connected"]) == {"opacity"}


def test_variants_of_a_material_are_values_like_others():
    stage = compose(
        'def Material "M" (\n variants = {\n string kind = "flint"\n}\n prepend variantSets = "kind"\n)\n{\n'
        " token outputs:surface.connect = </M/S.outputs:surface>\n float inputs:ior = 1.5\n"
        ' def Shader "S"\n{\n uniform token info:id = "UsdPreviewSurface"\n'
        " float inputs:ior.connect = </M.inputs:index>\n token outputs:surface\n}\n"
        ' variantSet "kind" = {\n "flint" {\n float inputs:index = 1.75\n}\n'
        ' "crown" {\n float inputs:index = 1.5\n}\n}\n}\n' + BALL % ""
    )
    assert material_of(stage)["surface"]["inputs"]["ior"]["value"] == 1.75
    assert material_of(stage, variants=["/M{kind=crown}"])["surface"]["inputs"]["ior"]["value"] == 1.5
    assert material_of(stage, overrides=["/M.inputs:index=1.25"])["surface"]["inputs"]["ior"]["value"] == 1.25
