"""What the bridge makes of shading networks: terminals, names of shaders, constants through connections and nodes.

Expected numbers are worked out by hand from the MaterialX specification's formulas, or by MaterialX' own graphs.
"""

import struct

import pytest
from description_schema import validate

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from pxr import Sdf, Usd, UsdGeom, UsdShade

from abbe.usd import describe
from abbe.usd.nodes import Choice, Formula, Value, find_node
from abbe.usd.tokens import MATERIALX_TYPES


def f32(x):
    """The float32 nearest to a number, as a double."""
    return struct.unpack("f", struct.pack("f", x))[0]


BALL = """def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </M>
%s
}
"""


def stage_of(body, ball="", material="", extra=""):
    """A stage in memory: a ball bound to </M>, whose surface is </M/S> with the body given."""
    text = f"""#usda 1.0
{BALL % ball}
def Material "M"
{{
    token outputs:surface.connect = </M/S.outputs:surface>
{material}
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
{body}
    }}
}}
{extra}
"""
    layer = Sdf.Layer.CreateAnonymous("test.usda")
    assert layer.ImportFromString(text)
    return Usd.Stage.Open(layer)


def read(stage, **options):
    """The description of a stage, checked against the schema."""
    description = describe(stage, **options)
    validate(description.document, description.arrays)
    description.to_json()
    return description


def material_of(stage, **options):
    """The only material of a stage."""
    (material,) = read(stage, **options).document["materials"]
    return material


def surface_of(*arguments, **options):
    """The surface of </M>."""
    return material_of(stage_of(*arguments, **options))["surface"]


def node(identifier, inputs="", output="float outputs:out", name="N"):
    """A shader beside the surface, as .usda."""
    return f'def Shader "{name}"\n{{\n uniform token info:id = "{identifier}"\n{inputs}\n {output}\n}}\n'


def folded(identifier, inputs, output="float outputs:out", input_type="float"):
    """What the input ``x`` is whose connection leads to a node: a value with its type, or the output that drives it."""
    name = output.split()[-1]
    surface = surface_of(f"{input_type} inputs:x.connect = </M/N.{name}>", material=node(identifier, inputs, output))
    assert ("x" in surface["inputs"]) != ("x" in surface["connected"])
    return surface["inputs"].get("x") or surface["connected"]["x"]


def warned(description, kind):
    return [warning for warning in description.warnings if warning["kind"] == kind]


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


# Nodes


@pytest.mark.parametrize(
    ("identifier", "inputs", "expected"),
    [
        ("ND_constant_float", "float inputs:value = 1.5", 1.5),
        ("ND_dot_float", "float inputs:in = 1.75", 1.75),
        ("ND_add_float", "float inputs:in1 = 1.25\nfloat inputs:in2 = 0.5", 1.75),
        ("ND_subtract_float", "float inputs:in1 = 1.25\nfloat inputs:in2 = 0.5", 0.75),
        ("ND_multiply_float", "float inputs:in1 = 1.25\nfloat inputs:in2 = 2", 2.5),
        # A multiplicand that nobody gave is 1, a summand 0.
        ("ND_multiply_float", "float inputs:in1 = 1.25\nfloat inputs:in2", 1.25),
        ("ND_add_float", "float inputs:in2 = 0.5", 0.5),
        ("ND_divide_float", "float inputs:in1 = 3\nfloat inputs:in2 = 2", 1.5),
        # GLSL's mod: the sign of the divisor.
        ("ND_modulo_float", "float inputs:in1 = -1.5\nfloat inputs:in2 = 1", 0.5),
        ("ND_power_float", "float inputs:in1 = 1.5\nfloat inputs:in2 = 2", 2.25),
        ("ND_safepower_float", "float inputs:in1 = -1.5\nfloat inputs:in2 = 2", -2.25),
        ("ND_invert_float", "float inputs:in = 0.25", 0.75),
        ("ND_invert_float", "float inputs:in = 0.25\nfloat inputs:amount = 2", 1.75),
        ("ND_absval_float", "float inputs:in = -1.5", 1.5),
        ("ND_sign_float", "float inputs:in = -1.5", -1.0),
        ("ND_floor_float", "float inputs:in = -1.5", -2.0),
        ("ND_ceil_float", "float inputs:in = 1.25", 2.0),
        ("ND_round_float", "float inputs:in = 1.75", 2.0),
        ("ND_fract_float", "float inputs:in = 1.75", 0.75),
        ("ND_sqrt_float", "float inputs:in = 2.25", 1.5),
        ("ND_exp_float", "float inputs:in = 0", 1.0),
        ("ND_ln_float", "", 0.0),
        ("ND_min_float", "float inputs:in1 = 1.5\nfloat inputs:in2 = 1.25", 1.25),
        ("ND_max_float", "float inputs:in1 = 1.5\nfloat inputs:in2 = 1.25", 1.5),
        ("ND_clamp_float", "float inputs:in = 3", 1.0),
        ("ND_clamp_float", "float inputs:in = 3\nfloat inputs:low = 1\nfloat inputs:high = 2.5", 2.5),
        ("ND_mix_float", "float inputs:fg = 2\nfloat inputs:bg = 1\nfloat inputs:mix = 0.25", 1.25),
        (
            "ND_remap_float",
            "float inputs:in = 0.5\nfloat inputs:inlow = 0\nfloat inputs:inhigh = 2\nfloat inputs:outlow = 1\n"
            "float inputs:outhigh = 3",
            1.5,
        ),
        # 3t² − 2t³ at t = 1/4.
        ("ND_smoothstep_float", "float inputs:in = 1.25\nfloat inputs:low = 1\nfloat inputs:high = 2", 0.15625),
        ("ND_smoothstep_float", "float inputs:in = 7\nfloat inputs:low = 1\nfloat inputs:high = 2", 1.0),
        (
            "ND_ifgreater_float",
            "float inputs:value1 = 2\nfloat inputs:value2 = 1\nfloat inputs:in1 = 1.5\nfloat inputs:in2 = 1.25",
            1.5,
        ),
        # Unauthored, value1 = 1 is greater than value2 = 0.
        ("ND_ifgreater_float", "float inputs:in1 = 1.5\nfloat inputs:in2 = 1.25", 1.5),
        (
            "ND_ifgreatereq_floatI",
            "int inputs:value1 = 2\nint inputs:value2 = 3\nfloat inputs:in1 = 1.5\nfloat inputs:in2 = 1.25",
            1.25,
        ),
        ("ND_ifequal_floatB", "bool inputs:value1 = 1\nfloat inputs:in1 = 1.5\nfloat inputs:in2 = 1.25", 1.25),
        ("ND_switch_float", "float inputs:which = 1.9\nfloat inputs:in2 = 1.25\nfloat inputs:in3 = 1.5", 1.25),
        ("ND_switch_floatI", "int inputs:which = 2\nfloat inputs:in2 = 1.25\nfloat inputs:in3 = 1.5", 1.5),
        ("ND_switch_floatI", "int inputs:which = 10\nfloat inputs:in1 = 1.25", 0.0),
        ("ND_convert_integer_float", "int inputs:in = 2", 2.0),
        ("ND_convert_boolean_float", "bool inputs:in = true", 1.0),
        ("ND_extract_color3", "color3f inputs:in = (0.25, 0.5, 1)\nint inputs:index = 1", 0.5),
        # A shader computes in float32.
        ("ND_add_float", "float inputs:in1 = 1.4\nfloat inputs:in2 = 0.1", f32(f32(1.4) + f32(0.1))),
    ],
)
def test_numbers_follow_from_nodes(identifier, inputs, expected):
    assert folded(identifier, inputs) == {"type": "float", "value": expected}


@pytest.mark.parametrize(
    ("identifier", "inputs", "type_name", "expected"),
    [
        ("ND_constant_color3", "color3f inputs:value = (1, 0.5, 0.25)", "color3f", [1.0, 0.5, 0.25]),
        (
            "ND_multiply_color3FA",
            "color3f inputs:in1 = (1, 0.5, 0.25)\nfloat inputs:in2 = 0.5",
            "color3f",
            [0.5, 0.25, 0.125],
        ),
        ("ND_add_vector2", "float2 inputs:in1 = (1, 2)\nfloat2 inputs:in2 = (3, 4)", "float2", [4.0, 6.0]),
        (
            "ND_mix_color3_color3",
            "color3f inputs:fg = (1, 1, 1)\ncolor3f inputs:mix = (0, 0.5, 1)",
            "color3f",
            [0.0, 0.5, 1.0],
        ),
        ("ND_combine3_color3", "float inputs:in1 = 1\nfloat inputs:in3 = 0.5", "color3f", [1.0, 0.0, 0.5]),
        (
            "ND_combine2_color4CF",
            "color3f inputs:in1 = (1, 2, 3)\nfloat inputs:in2 = 4",
            "color4f",
            [1.0, 2.0, 3.0, 4.0],
        ),
        ("ND_combine2_vector4VV", "float2 inputs:in2 = (3, 4)", "float4", [0.0, 0.0, 3.0, 4.0]),
        ("ND_convert_float_color3", "float inputs:in = 0.5", "color3f", [0.5, 0.5, 0.5]),
        ("ND_convert_float_color4", "float inputs:in = 0.5", "color4f", [0.5, 0.5, 0.5, 0.5]),
        ("ND_convert_vector2_color4", "float2 inputs:in = (0.5, 2)", "color4f", [0.5, 2.0, 0.0, 1.0]),
        ("ND_convert_color4_vector2", "color4f inputs:in = (0.5, 2, 3, 4)", "float2", [0.5, 2.0]),
        (
            "ND_luminance_color4",
            "color4f inputs:in = (1, 1, 1, 0.5)\ncolor3f inputs:lumacoeffs = (0.25, 0.5, 0.25)",
            "color4f",
            [1.0, 1.0, 1.0, 0.5],
        ),
        ("ND_switch_color3", "color3f inputs:in1 = (1, 2, 3)", "color3f", [1.0, 2.0, 3.0]),
        (
            "ND_constant_matrix33",
            "matrix3d inputs:value = ((1, 2, 3), (4, 5, 6), (7, 8, 9))",
            "matrix3d",
            [[1, 2, 3], [4, 5, 6], [7, 8, 9]],
        ),
        ("ND_constant_string", 'string inputs:value = "clear"', "string", "clear"),
        ("ND_constant_filename", "asset inputs:value = @a.png@", "asset", "a.png"),
        ("ND_constant_boolean", "bool inputs:value = true", "bool", True),
        ("ND_constant_integer", "int inputs:value = 3", "int", 3),
        ("ND_floor_integer", "float inputs:in = 3.75", "int", 3),
        ("ND_convert_integer_boolean", "int inputs:in = 2", "bool", True),
        ("ND_ifgreater_boolean", "float inputs:value1 = 0.5\nfloat inputs:value2 = 1", "bool", False),
        ("ND_logical_and", "bool inputs:in1 = true\nbool inputs:in2 = true", "bool", True),
        ("ND_logical_not", "bool inputs:in = true", "bool", False),
    ],
)
def test_values_keep_their_types_through_nodes(identifier, inputs, type_name, expected):
    value = folded(identifier, inputs, f"{type_name} outputs:out", type_name)
    assert value == {"type": type_name, "value": expected}


@pytest.mark.parametrize(("output", "expected"), [("outr", 0.25), ("outg", 0.5), ("outb", 1.0)])
def test_separate_has_an_output_for_each_component(output, expected):
    value = folded("ND_separate3_color3", "color3f inputs:in = (0.25, 0.5, 1)", f"float outputs:{output}")
    assert value == {"type": "float", "value": expected}


@pytest.mark.parametrize(
    ("identifier", "inputs"),
    [
        ("ND_image_float", "asset inputs:file = @a.png@\nfloat inputs:default = 1.5"),
        ("UsdUVTexture", "asset inputs:file = @a.png@\nfloat4 inputs:fallback = (1, 1, 1, 1)"),
        ("ND_tiledimage_float", ""),
        ("ND_noise2d_float", "float inputs:amplitude = 0"),
        ("ND_position_vector3", ""),
        ("some:vendor_node", "float inputs:value = 1.5"),
        ("", "float inputs:value = 1.5"),
        # Inputs that are not what the node's definition says.
        ("ND_add_float", "color3f inputs:in1 = (1, 1, 1)"),
        ("ND_add_color3", "float2 inputs:in1 = (1, 1)"),
        ("ND_add_float", 'string inputs:in1 = "one"'),
        ("ND_extract_color3", "color3f inputs:in = (1, 1, 1)\nint inputs:index = 3"),
        ("ND_extract_color3", "color3f inputs:in = (1, 1, 1)\nint inputs:index = -1"),
    ],
)
def test_what_no_formula_tells_stays_connected(identifier, inputs):
    assert folded(identifier, inputs) == "/M/N.outputs:out"


def test_one_textured_input_makes_a_node_textured():
    texture = node("ND_image_float", name="T")
    inputs = "float inputs:in1 = 1.5\nfloat inputs:in2.connect = </M/T.outputs:out>"
    surface = surface_of(
        "float inputs:ior.connect = </M/N.outputs:out>", material=texture + node("ND_add_float", inputs)
    )
    assert surface["connected"] == {"ior": "/M/N.outputs:out"}


def test_a_branch_that_is_not_taken_does_not_matter():
    texture = node("ND_image_float", name="T")
    inputs = "float inputs:value1 = 1\nfloat inputs:value2 = 2\nfloat inputs:in1.connect = </M/T.outputs:out>\n"
    taken = "float inputs:in2 = 1.5"
    surface = surface_of(
        "float inputs:ior.connect = </M/N.outputs:out>", material=texture + node("ND_ifgreater_float", inputs + taken)
    )
    assert surface["inputs"]["ior"] == {"type": "float", "value": 1.5}


_WORDS = {"true": 1.0, "false": 0.0}


def test_formulas_agree_with_the_definitions_of_materialx():
    mx = pytest.importorskip("MaterialX", reason="the definitions come with the materialx package")
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    checked = compared = 0
    for definition in library.getNodeDefs():
        outputs = definition.getActiveOutputs()
        ours = {o.getName(): find_node(definition.getName(), o.getName()) for o in outputs}
        if not all(isinstance(item, Formula | Choice) for item in ours.values()):
            continue
        declared = {i.getName(): i for i in definition.getActiveInputs()}
        for output in outputs:
            item = ours[output.getName()]
            if MATERIALX_TYPES.get(output.getType()) != item.type:
                assert item.evaluate(lambda name: None) is None, definition.getName()
                continue
            defaults = item.inputs if isinstance(item, Formula) else item.compared
            assert set(defaults) <= set(declared), definition.getName()
            for name, default in defaults.items():
                text = declared[name].getValueString()
                if item.type in ("string", "asset", "matrix3d", "matrix4d") or not text:
                    continue
                values = [float(_WORDS.get(part.strip(), part)) for part in text.split(",")]
                given = default if isinstance(default, list) else [default] * len(values)
                assert values == pytest.approx(given), f"{definition.getName()}.{name}"
            checked += 1
            graph = definition.getImplementation()
            if graph is not None and graph.isA(mx.NodeGraph):
                compared += _agrees_with_graph(definition, graph, output.getName(), item)
    assert checked > 300
    assert compared > 50


def _agrees_with_graph(definition, graph, output, item):
    """Compare a formula with the graph that MaterialX gives for the node, if that is made of nodes that we know."""
    samples = {
        "float": 0.75,
        "integer": 3,
        "boolean": True,
        "color3": [0.25, 0.5, 2.0],
        "color4": [0.25, 0.5, 2.0, 4.0],
    }
    samples |= {f"vector{k}": [0.25, -0.5, 2.0, 4.0][:k] for k in (2, 3, 4)}
    values = {}
    for position, declared in enumerate(definition.getActiveInputs()):
        sample = samples.get(declared.getType())
        if sample is None:
            return 0
        shift = 0.125 * position if declared.getType() not in ("integer", "boolean") else 0
        data = [part + shift for part in sample] if isinstance(sample, list) else type(sample)(sample + shift)
        values[declared.getName()] = Value(MATERIALX_TYPES[declared.getType()], data)
    expected = _of_graph(graph, graph.getOutput(output), values)
    if expected is None:
        return 0
    assert item.evaluate(values.get).data == pytest.approx(expected.data, rel=1e-6), definition.getName()
    return 1


def _of_graph(graph, port, values):
    """The value at a port of a graph, by the nodes inside it; None where we do not know one of them."""
    if port.getAttribute("interfacename"):
        return values[port.getAttribute("interfacename")]
    name = port.getAttribute("nodename")
    if not name:
        parts = [float(_WORDS.get(part.strip(), part)) for part in port.getValueString().split(",")]
        data = parts if len(parts) > 1 else parts[0]
        return Value(MATERIALX_TYPES[port.getType()], data)
    inner = graph.getNode(name)
    definition = inner.getNodeDef()
    outputs = [output.getName() for output in definition.getActiveOutputs()]
    known = find_node(definition.getName(), port.getAttribute("output") or outputs[0])
    inputs = {item.getName(): _of_graph(graph, item, values) for item in inner.getInputs()}
    if known is None or None in inputs.values():
        return None
    return known.evaluate(inputs.get)


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
