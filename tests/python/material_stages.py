"""Stages with one material, made from the few lines that a test is about."""

from description_schema import validate
from pxr import Sdf, Usd

from abbe.usd import describe

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
