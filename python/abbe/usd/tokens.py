"""Every USD name that the bridge reads by name, once.

The names of our own schemas stand with their types in :data:`MATERIAL_NAMES`, :data:`SETTINGS_NAMES` and
:data:`VAR_NAMES`; they serve to find misspelt attributes, and a test compares them with ``plugin/``. Attributes are
read by name, whether or not the schemas are registered or applied.
"""

from __future__ import annotations

from typing import Final

# Stage metadata.
METERS_PER_UNIT: Final = "metersPerUnit"
UP_AXIS: Final = "upAxis"
START_TIME_CODE: Final = "startTimeCode"
RENDER_SETTINGS_PRIM_PATH: Final = "renderSettingsPrimPath"
FRAMES_PER_SECOND: Final = "framesPerSecond"
TIME_CODES_PER_SECOND: Final = "timeCodesPerSecond"

# Imageable.
VISIBILITY: Final = "visibility"
INVISIBLE: Final = "invisible"
PURPOSE: Final = "purpose"
# Of VisibilityAPI, behind the name of a purpose.
PURPOSE_VISIBILITY: Final = "Visibility"
DEFAULT: Final = "default"
PURPOSES: Final = ("default", "render", "proxy", "guide")
DEFAULT_PURPOSES: Final = ("default", "render")
DOUBLE_SIDED: Final = "doubleSided"
ORIENTATION: Final = "orientation"
LEFT_HANDED: Final = "leftHanded"
DRAW_MODE: Final = "model:drawMode"
APPLY_DRAW_MODE: Final = "model:applyDrawMode"
FULL_DRAW_MODES: Final = ("default", "inherited", "")

# PointInstancer.
PROTOTYPES: Final = "prototypes"
PROTO_INDICES: Final = "protoIndices"
POSITIONS: Final = "positions"
ORIENTATIONS: Final = "orientations"
ORIENTATIONS_F: Final = "orientationsf"
SCALES: Final = "scales"
IDS: Final = "ids"
VELOCITIES: Final = "velocities"
ACCELERATIONS: Final = "accelerations"
MOTION_NAMES: Final = (VELOCITIES, ACCELERATIONS, "angularVelocities")
INSTANCE_TRANSFORMS: Final = (POSITIONS, ORIENTATIONS, ORIENTATIONS_F, SCALES)
# The sources of render variables that tell of motion; `motionvector` is what other renderers call the first.
MOTION_SOURCES: Final = ("motion", "refracted_motion", "motionvector")

# Sphere, Cube, Plane, Cylinder, Cone, Capsule.
RADIUS: Final = "radius"
RADIUS_BOTTOM: Final = "radiusBottom"
RADIUS_TOP: Final = "radiusTop"
HEIGHT: Final = "height"
WIDTH: Final = "width"
LENGTH: Final = "length"
SIZE: Final = "size"
AXIS: Final = "axis"
AXES: Final = ("X", "Y", "Z")

# Mesh.
POINTS: Final = "points"
FACE_VERTEX_COUNTS: Final = "faceVertexCounts"
FACE_VERTEX_INDICES: Final = "faceVertexIndices"
HOLE_INDICES: Final = "holeIndices"
SUBDIVISION_SCHEME: Final = "subdivisionScheme"
NO_SUBDIVISION: Final = "none"
SUBDIVISION_SCHEMES: Final = ("catmullClark", "loop", "bilinear")
# Options of a subdivision surface with what USD allows, the fallback last.
INTERPOLATE_BOUNDARY: Final = ("interpolateBoundary", ("none", "edgeOnly", "edgeAndCorner"))
FACE_VARYING_INTERPOLATION: Final = (
    "faceVaryingLinearInterpolation",
    ("none", "cornersOnly", "cornersPlus2", "boundaries", "all", "cornersPlus1"),
)
TRIANGLE_RULE: Final = ("triangleSubdivisionRule", ("smooth", "catmullClark"))
CREASE_INDICES: Final = "creaseIndices"
CREASE_LENGTHS: Final = "creaseLengths"
CREASE_SHARPNESSES: Final = "creaseSharpnesses"
CORNER_INDICES: Final = "cornerIndices"
CORNER_SHARPNESSES: Final = "cornerSharpnesses"
SUBDIVISION_LEVEL: Final = "abbe:subdivision:level"
# usdrecord's names for refinement levels 0 to 3.
COMPLEXITIES: Final = ("low", "medium", "high", "veryhigh")
NORMALS: Final = "normals"
PRIMVARS_NORMALS: Final = "primvars:normals"
PRIMVARS: Final = "primvars"
PRIMVARS_PREFIX: Final = "primvars:"
PRIMVAR_INDICES: Final = ":indices"
PRIMVARS_ST: Final = "primvars:st"
INTERPOLATION: Final = "interpolation"
INTERPOLATIONS: Final = ("constant", "uniform", "varying", "vertex", "faceVarying")
VERTEX: Final = "vertex"
CONSTANT: Final = "constant"
TEX_COORD_TYPES: Final = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]")
FLOAT2_TYPES: Final = ("float2[]", "double2[]", "half2[]")
# What other applications call their first texture coordinates (Maya, Houdini, Blender, glTF converters).
UV_NAMES: Final = ("st", "uv", "map1", "UVMap", "st0", "st_0", "uv0", "Texture_uv", "TEXCOORD_0")
GEOM_SUBSET: Final = "GeomSubset"
FAMILY_NAME: Final = "familyName"
MATERIAL_BIND: Final = "materialBind"
ELEMENT_TYPE: Final = "elementType"
FACE: Final = "face"
INDICES: Final = "indices"

# Materials.
MATERIAL_BINDING: Final = "material:binding"
COLLECTION: Final = "collection"
# The all-purpose binding has no name.
BINDING_PURPOSES: Final = ("full", "")
# What Houdini writes for the purpose whose token is empty.
ALL_PURPOSE_ALIAS: Final = "allPurpose"
OUTPUTS_PREFIX: Final = "outputs:"
INPUTS: Final = "inputs"
INPUTS_PREFIX: Final = "inputs:"
# Nodes that read texture coordinates by their number, and the color of the geometry.
TEXTURE_COORDINATE_NODES: Final = "ND_texcoord_"
GEOMETRY_COLOR_NODES: Final = "ND_geomcolor_"
ST: Final = "st"
DISPLAY_COLOR: Final = "displayColor"
# Where in the name of an image the number of its tile stands.
TILE_PATTERNS: Final = ("<UDIM>",)
INFO: Final = "info"
INFO_ID: Final = "info:id"
SURFACE_OUTPUT: Final = "outputs:surface"
MATERIALX_SURFACE_OUTPUT: Final = "outputs:mtlx:surface"
# The surface terminals in the order they are looked for; those of other render contexts come after.
SURFACE_OUTPUTS: Final = ("outputs:abbe:surface", MATERIALX_SURFACE_OUTPUT, SURFACE_OUTPUT)
SOURCE_ASSET: Final = "sourceAsset"
SUB_IDENTIFIER: Final = "subIdentifier"
MATERIALX_NODE_PREFIX: Final = "ND_"
# What UsdMtlx makes of a MaterialX document.
MATERIALX_EXTENSION: Final = "mtlx"
MATERIALX_ROOT: Final = "/MaterialX"
NODE_GRAPHS: Final = "NodeGraphs"
MATERIALX_VERSION: Final = "config:mtlx:version"
# Nodes that read a primvar: the input that names it, and the one that has the value where there is none.
PRIMVAR_NODES: Final = {
    "UsdPrimvarReader_": ("varname", "fallback"),
    "ND_UsdPrimvarReader_": ("varname", "fallback"),
    "ND_geompropvalue_": ("geomprop", "default"),
    "ND_geompropvalueuniform_": ("geomprop", "default"),
}
# The last part of their names, and of MaterialX nodes' names, to Sdf types.
MATERIALX_TYPES: Final = {
    "boolean": "bool",
    "integer": "int",
    "float": "float",
    "color3": "color3f",
    "color4": "color4f",
    "vector2": "float2",
    "vector3": "float3",
    "vector4": "float4",
    "matrix33": "matrix3d",
    "matrix44": "matrix4d",
    "string": "string",
    "filename": "asset",
    "geomname": "string",
    "integerarray": "int[]",
    "floatarray": "float[]",
    "color3array": "color3f[]",
    "color4array": "color4f[]",
    "vector2array": "float2[]",
    "vector3array": "float3[]",
    "vector4array": "float4[]",
    "stringarray": "string[]",
    "geomnamearray": "string[]",
    "surfaceshader": "token",
}
PRIMVAR_READER_TYPES: Final = {
    "int": "int",
    "float2": "float2",
    "float3": "float3",
    "float4": "float4",
    "normal": "normal3f",
    "point": "point3f",
    "vector": "vector3f",
    "matrix": "matrix4d",
}

# Lights; names without `inputs:`, as they were before USD 21.02.
INTENSITY: Final = "intensity"
LIGHT_EXPOSURE: Final = "exposure"
NORMALIZE: Final = "normalize"
COLOR: Final = "color"
ENABLE_COLOR_TEMPERATURE: Final = "enableColorTemperature"
COLOR_TEMPERATURE: Final = "colorTemperature"
DIFFUSE: Final = "diffuse"
SPECULAR: Final = "specular"
ANGLE: Final = "angle"
TREAT_AS_POINT: Final = "treatAsPoint"
TREAT_AS_LINE: Final = "treatAsLine"
TEXTURE_FILE: Final = "texture:file"
TEXTURE_FORMAT: Final = "texture:format"
AUTOMATIC: Final = "automatic"
POLE_AXIS: Final = "poleAxis"
SCENE: Final = "scene"
GUIDE_RADIUS: Final = "guideRadius"
PORTALS: Final = "portals"
GEOMETRY: Final = "geometry"
MATERIAL_SYNC_MODE: Final = "light:materialSyncMode"
NO_MATERIAL_RESPONSE: Final = "noMaterialResponse"
LIGHT_FILTERS: Final = "light:filters"
OLD_LIGHT_FILTERS: Final = "filters"
SHAPING: Final = "shaping"
SHAPING_FOCUS: Final = "shaping:focus"
SHAPING_FOCUS_TINT: Final = "shaping:focusTint"
SHAPING_CONE_ANGLE: Final = "shaping:cone:angle"
SHAPING_CONE_SOFTNESS: Final = "shaping:cone:softness"
SHAPING_IES_FILE: Final = "shaping:ies:file"
SHAPING_IES_ANGLE_SCALE: Final = "shaping:ies:angleScale"
SHAPING_IES_NORMALIZE: Final = "shaping:ies:normalize"
SHADOW: Final = "shadow"
SHADOW_ENABLE: Final = "shadow:enable"
SHADOW_COLOR: Final = "shadow:color"
SHADOW_DISTANCE: Final = "shadow:distance"
SHADOW_FALLOFF: Final = "shadow:falloff"
SHADOW_FALLOFF_GAMMA: Final = "shadow:falloffGamma"
LIGHT_LINK: Final = "lightLink"
SHADOW_LINK: Final = "shadowLink"
# PhysicalLightIlluminantAPI, of a proposal to OpenUSD.
PHYSICAL: Final = "physical"

# Cameras.
PERSPECTIVE: Final = "perspective"
CAMERA: Final = "camera"
# By name, because 24.8 has only the first: what the description calls each.
EXPOSURE: Final = {
    "exposure": "stops",
    "exposure:time": "time",
    "exposure:iso": "iso",
    "exposure:fStop": "f_stop",
    "exposure:responsivity": "responsivity",
}

# Render settings.
RENDER_SETTINGS: Final = "RenderSettings"
RENDER_PRODUCT: Final = "RenderProduct"
RENDER_VAR: Final = "RenderVar"
PRODUCTS: Final = "products"
ORDERED_VARS: Final = "orderedVars"
PRODUCT_NAME: Final = "productName"
PRODUCT_TYPE: Final = "productType"
RASTER: Final = "raster"
RESOLUTION: Final = "resolution"
PIXEL_ASPECT_RATIO: Final = "pixelAspectRatio"
ASPECT_RATIO_CONFORM_POLICY: Final = "aspectRatioConformPolicy"
EXPAND_APERTURE: Final = "expandAperture"
DATA_WINDOW_NDC: Final = "dataWindowNDC"
INSTANTANEOUS_SHUTTER: Final = "instantaneousShutter"
DISABLE_MOTION_BLUR: Final = "disableMotionBlur"
DISABLE_DEPTH_OF_FIELD: Final = "disableDepthOfField"
RENDERING_COLOR_SPACE: Final = "renderingColorSpace"
INCLUDED_PURPOSES: Final = "includedPurposes"
MATERIAL_BINDING_PURPOSES: Final = "materialBindingPurposes"
DATA_TYPE: Final = "dataType"
COLOR3F: Final = "color3f"
SOURCE_NAME: Final = "sourceName"
SOURCE_TYPE: Final = "sourceType"
RAW: Final = "raw"
RENDER_PASS: Final = "RenderPass"
RENDER_SOURCE: Final = "renderSource"
INPUT_PASSES: Final = "inputPasses"
COMMAND: Final = "command"
FILE_NAME: Final = "fileName"
PRUNE: Final = "prune"
RENDER_VISIBILITY: Final = "renderVisibility"
CAMERA_VISIBILITY: Final = "cameraVisibility"
MATTE: Final = "matte"
# Later ones win, so that RenderMan's spelling yields to the common one.
DRIVER_NAMESPACES: Final = ("ri:driver:parameters", "driver:parameters")
AOV_DRIVER_NAMESPACES: Final = ("ri:driver:parameters:aov", "driver:parameters:aov")
# Product names that mean a window of an application, not a file: Solaris' image viewers.
VIEWER_PRODUCT_NAMES: Final = ("ip", "md")

# Ours.
ABBE: Final = "abbe"
ABBE_PREFIX: Final = "abbe:"
MATERIAL_NAMES: Final = {
    "abbe:glass": "string",
    "abbe:dispersion:law": "token",
    "abbe:dispersion:nd": "double",
    "abbe:dispersion:vd": "double",
    "abbe:dispersion:cauchy": "double[]",
    "abbe:dispersion:sellmeier:b": "double[]",
    "abbe:dispersion:sellmeier:c": "double[]",
    "abbe:dispersion:formula": "int",
    "abbe:dispersion:coefficients": "double[]",
    "abbe:dispersion:table": "double2[]",
    "abbe:extinction:table": "double2[]",
    "abbe:dispersion:validRange": "double2",
    "abbe:dispersion:outOfRange": "token",
    "abbe:dispersion:scale": "double",
    "abbe:internalTransmittance:table": "double2[]",
    "abbe:internalTransmittance:thickness": "double",
    "abbe:dielectricPriority": "int",
}
REFLECTANCE_NAMES: Final = {"abbe:reflectance:table": "double2[]"}
LENS_THICKNESS: Final = "abbe:lens:thickness"
LENS_EDGE_RADIUS: Final = "abbe:lens:edgeRadius"
LENS_PREFIX: Final = "abbe:lens:"
LENS_NAMES: Final = {
    "abbe:lens:thickness": "double",
    "abbe:lens:edgeRadius": "double",
    "abbe:lens:front:curvature": "double",
    "abbe:lens:front:conic": "double",
    "abbe:lens:front:aspheres": "double[]",
    "abbe:lens:front:semiDiameter": "double",
    "abbe:lens:back:curvature": "double",
    "abbe:lens:back:conic": "double",
    "abbe:lens:back:aspheres": "double[]",
    "abbe:lens:back:semiDiameter": "double",
}
LIGHT_NAMES: Final = {
    "abbe:illuminant": "token",
    "abbe:spectrum:table": "double2[]",
    "abbe:lightGroup": "string",
}
MESH_NAMES: Final = {SUBDIVISION_LEVEL: "int"}
SCALAR_IOR: Final = "abbe:scalarIor"
SETTINGS_NAMES: Final = {
    "abbe:integrator": "token",
    "abbe:samples": "int",
    "abbe:errorTarget": "double",
    "abbe:timeLimit": "double",
    "abbe:referenceWavelength": "double",
    "abbe:band": "double2",
    "abbe:dispersionScale": "double",
    "abbe:seed": "int",
    "abbe:seedPerFrame": "bool",
    SCALAR_IOR: "token",
    "abbe:pixelFilter": "token",
    "abbe:pixelFilterWidth": "float",
    "abbe:channelWavelengths": "double3",
}
VAR_NAMES: Final = {
    "abbe:filter": "token",
    "abbe:wavelength": "double",
    "abbe:spectral:band": "double2",
    "abbe:spectral:binWidth": "double",
}
LIGHT_TYPES: Final = (
    "DistantLight",
    "DomeLight",
    "DomeLight_1",
    "RectLight",
    "DiskLight",
    "SphereLight",
    "CylinderLight",
    "GeometryLight",
    "PortalLight",
)
OUR_SCHEMAS: Final = {
    "Material": {**MATERIAL_NAMES, **REFLECTANCE_NAMES},
    "Mesh": {**LENS_NAMES, **MESH_NAMES, **LIGHT_NAMES},
    "Xform": LENS_NAMES,
    RENDER_SETTINGS: SETTINGS_NAMES,
    RENDER_VAR: VAR_NAMES,
    **dict.fromkeys(LIGHT_TYPES, LIGHT_NAMES),
}
