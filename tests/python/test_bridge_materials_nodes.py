"""What the bridge makes of shading nodes whose inputs are constants.

Expected numbers are worked out by hand from the MaterialX specification's formulas, or by MaterialX' own graphs.
"""

import struct

import pytest

pytest.importorskip("pxr.Usd", reason="the bridge needs usd-core")

from material_stages import folded, node, surface_of

from abbe.usd.nodes import Choice, Formula, Value, find_node
from abbe.usd.tokens import MATERIALX_TYPES


def f32(x):
    """The float32 nearest to a number, as a double."""
    return struct.unpack("f", struct.pack("f", x))[0]


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
