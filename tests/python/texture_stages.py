"""A square that fills the image, so that pixels are texels: what a material looks up, read back from the albedo."""

from pathlib import Path

import numpy as np

import abbe

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    renderSettingsPrimPath = "/Render/Settings"
)
def Scope "Render"
{
    def RenderSettings "Settings"
    {
        # Whatever the resolution, the square fills it.
        uniform token aspectRatioConformPolicy = "adjustPixelAspectRatio"
    }
}
def Xform "World"
{
    def Camera "Camera"
    {
        token projection = "orthographic"
        float horizontalAperture = 10
        float verticalAperture = 10
        float2 clippingRange = (0.1, 100)
        double3 xformOp:translate = (0.5, 0.5, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "Square" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token subdivisionScheme = "none"
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        texCoord2f[] primvars:st = %(st)s (interpolation = "vertex")
        rel material:binding = </World/M>
%(square)s
    }
%(extra)s
    def Material "M"
    {
        token outputs:%(terminal)ssurface.connect = </World/M/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "%(shader)s"
            token outputs:surface
%(surface)s
        }
%(nodes)s
    }
}
"""
UNIT = "[(0, 0), (1, 0), (1, 1), (0, 1)]"


def write(folder, nodes, surface=None, *, st=UNIT, square="", extra="", shader="UsdPreviewSurface", terminal=""):
    """Write a stage whose square has a material; by default its diffuse colour is the output rgb of the node T."""
    if surface is None:
        surface = "color3f inputs:diffuseColor.connect = </World/M/T.outputs:rgb>"
    path = Path(folder) / "square.usda"
    path.write_text(STAGE % locals())
    return path


def texture(file, inputs="", name="T"):
    """A UsdUVTexture of a file that looks up where the reader R says."""
    return f"""def Shader "{name}"
{{
    uniform token info:id = "UsdUVTexture"
    asset inputs:file = @{file}@
    float2 inputs:st.connect = </World/M/R.outputs:result>
    {inputs}
    float3 outputs:rgb
    float outputs:r
    float outputs:g
    float outputs:b
    float outputs:a
}}
def Shader "R"
{{
    uniform token info:id = "UsdPrimvarReader_float2"
    string inputs:varname = "st"
    float2 outputs:result
}}
"""


def node(identifier, inputs="", output="color3f outputs:out", name="T"):
    """A node of a network."""
    return f'def Shader "{name}"\n{{\n uniform token info:id = "{identifier}"\n {inputs}\n {output}\n}}\n'


def albedo(path, size, **options):
    """The albedo of the square at ``size`` (columns, rows), shape (rows, columns, 3)."""
    width, height = size
    film = abbe.render(path, aovs=["albedo"], width=width, height=height, **options)
    return np.array(film["albedo"])


def looked_up(folder, nodes, size=(8, 8), **options):
    """What the diffuse colour is over the square."""
    return albedo(write(folder, nodes, **options), size)
