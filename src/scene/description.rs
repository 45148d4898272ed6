//! The scene description: what a bridge hands over. One schema, a JSON document beside named arrays, in memory or as a file.
//!
//! Nothing here is checked beyond its types; [`builder`](super::builder) checks everything when it makes a
//! [`Scene`](super::Scene). The document says what was authored; what it means for optics is decided by the core.
//!
//! Conventions: matrices are 16 doubles, row-major with row vectors as USD has them (translation in the last row), mapping
//! object space to the stage's world. Arrays are named by strings and stand in [`Arrays`]; shapes are `[n]` or `[n, k]`.
//! Wavelengths are in nm. Unknown fields are refused, so that a newer file is not half understood.

use std::collections::BTreeMap;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};

/// The schema's name and version as they stand in every document.
pub const FORMAT: &str = "abbe-scene";
/// Raised when a document of the old version would be misunderstood.
pub const VERSION: u32 = 1;

/// A value as it was authored, with its type: `{"type": "float", "value": 1.5}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Authored {
    /// Sdf type name: `float`, `double`, `int`, `bool`, `token`, `string`, `asset`, `double[]`, `double2[]`, `color3f` …
    #[serde(rename = "type")]
    pub type_name: String,
    /// The value: a number, a string, a boolean or (nested) lists of numbers.
    pub value: serde_json::Value,
}

/// Authored values by full attribute name, for instance `abbe:dispersion:vd`.
pub type AuthoredMap = BTreeMap<String, Authored>;

/// The document.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Where the scene comes from.
    pub stage: Stage,
    /// Shapes, referred to by index.
    pub shapes: Vec<Shape>,
    /// Groups of placed shapes and groups, referred to by index.
    pub groups: Vec<Group>,
    /// The group that is the scene.
    pub root: usize,
    /// Materials, referred to by index.
    pub materials: Vec<Material>,
    /// Images, referred to by index.
    #[serde(default)]
    pub textures: Vec<Texture>,
    /// Cameras, referred to by index. The first is the default.
    pub cameras: Vec<Camera>,
    /// What some light does not reach or some shadow leaves out: each distinct membership once, referred to by index.
    #[serde(default)]
    pub link_sets: Vec<LinkSet>,
    /// Render settings, products flattened.
    #[serde(default)]
    pub settings: Settings,
    /// What the bridge had to say.
    #[serde(default)]
    pub warnings: Diagnostics,
    /// What the bridge left out for a reason that is no warning: reason → count (`invisible`, `purpose proxy`).
    #[serde(default)]
    pub skipped: BTreeMap<String, u64>,
    /// A file that is looked up and missing or unreadable is an error; else a warning, and a default in its place.
    #[serde(default)]
    pub strict_assets: bool,
}

/// A file that the scene refers to: an image, a light's profile.
///
/// Files of the file system are named and read when something looks them up; what lies in a package or behind an asset
/// resolver of a studio comes with the scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asset {
    /// The path as it was authored: what messages name.
    pub path: String,
    /// Absolute path of the file. Absent where `content` has what is in it, or where nothing was found.
    #[serde(default)]
    pub file: Option<String>,
    /// Array u8 `[n]`: what is in the file. Several assets may name one array.
    #[serde(default)]
    pub content: Option<String>,
}

/// An image file, or several that are its tiles.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texture {
    /// The property that names it, for messages.
    pub place: String,
    /// The image. Of tiles the path with `<UDIM>`, neither file nor content.
    pub asset: Asset,
    /// The tiles that were found; empty for a single image.
    #[serde(default)]
    pub tiles: Vec<Tile>,
    /// The `colorSpace` that is stated for it; empty if none is.
    #[serde(default)]
    pub color_space: String,
}

/// A tile of a texture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// 1001 + u + 10 v for the tile whose lower left corner is at (u, v).
    pub number: u32,
    /// Its image.
    pub asset: Asset,
}

/// Stage metadata.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// The stage's root layer as the user named it.
    pub source: String,
    /// Metres per stage unit.
    pub meters_per_unit: f64,
    /// `Y` or `Z`.
    pub up_axis: String,
    /// The time code that was read; absent for default values.
    #[serde(default)]
    pub time_code: Option<f64>,
    /// Frames per second of the stage.
    #[serde(default)]
    pub frames_per_second: Option<f64>,
    /// Time codes per second of the stage.
    #[serde(default)]
    pub time_codes_per_second: Option<f64>,
    /// The interval about the frame in which motion was looked for; absent if it was not.
    #[serde(default)]
    pub motion: Option<[f64; 2]>,
}

/// A shape in its object space.
#[allow(clippy::large_enum_variant, reason = "a document holds few shapes next to the arrays they name")]
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Shape {
    /// An analytic sphere about the origin.
    Sphere {
        /// Prim path.
        path: String,
        /// Radius > 0.
        radius: f64,
    },
    /// A cube about the origin.
    Cube {
        /// Prim path.
        path: String,
        /// Length of its edges.
        size: f64,
    },
    /// A rectangle about the origin, facing along its axis.
    Plane {
        /// Prim path.
        path: String,
        /// Along x; along z for the axis X.
        width: f64,
        /// Along y; along z for the axis Y.
        length: f64,
        /// `X`, `Y` or `Z`.
        axis: String,
    },
    /// A cylinder or truncated cone about the origin.
    Cylinder {
        /// Prim path.
        path: String,
        /// Along the axis.
        height: f64,
        /// At −height/2.
        radius_bottom: f64,
        /// At +height/2.
        radius_top: f64,
        /// `X`, `Y` or `Z`.
        axis: String,
    },
    /// A cone about the origin, its tip towards +axis.
    Cone {
        /// Prim path.
        path: String,
        /// Along the axis.
        height: f64,
        /// Of the base.
        radius: f64,
        /// `X`, `Y` or `Z`.
        axis: String,
    },
    /// A truncated cone about the origin that spheres continue without an edge at both ends.
    Capsule {
        /// Prim path.
        path: String,
        /// Along the axis, without what the spheres add.
        height: f64,
        /// Of the truncated cone at −height/2.
        radius_bottom: f64,
        /// Of the truncated cone at +height/2.
        radius_top: f64,
        /// `X`, `Y` or `Z`.
        axis: String,
    },
    /// A lens element, traced as its prescription says.
    Lens(Lens),
    /// A polygon mesh.
    Mesh(Mesh),
}

impl Default for Target {
    fn default() -> Self {
        Self::Shape(0)
    }
}

impl Shape {
    /// Its prim path.
    pub fn path(&self) -> &str {
        match self {
            Self::Sphere { path, .. }
            | Self::Cube { path, .. }
            | Self::Plane { path, .. }
            | Self::Cylinder { path, .. }
            | Self::Cone { path, .. }
            | Self::Capsule { path, .. } => path,
            Self::Lens(lens) => &lens.path,
            Self::Mesh(mesh) => &mesh.path,
        }
    }
}

/// A lens element about the z axis: the front vertex at the origin, the back vertex at z = thickness.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Prim path.
    pub path: String,
    /// The face at the origin.
    pub front: LensFace,
    /// The face at z = thickness.
    pub back: LensFace,
    /// Between the vertices.
    pub thickness: f64,
    /// Of the cylinder that joins the faces; the larger semi-diameter if absent.
    #[serde(default)]
    pub edge_radius: Option<f64>,
}

/// One face of a lens.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensFace {
    /// 1/radius, positive if the centre is on the side of +z.
    #[serde(default)]
    pub curvature: f64,
    /// The conic constant: 0 a sphere, −1 a paraboloid.
    #[serde(default)]
    pub conic: f64,
    /// Coefficients of r⁴, r⁶, r⁸, ….
    #[serde(default)]
    pub aspheres: Vec<f64>,
    /// Up to which the face has this form; beyond it is flat.
    pub semi_diameter: f64,
}

/// A polygon mesh as authored.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// Prim path (that of the prototype where prims share the mesh).
    pub path: String,
    /// Array f32 `[n, 3]`.
    pub points: String,
    /// Array i32 `[faces]`.
    pub face_vertex_counts: String,
    /// Array i32 `[corners]`.
    pub face_vertex_indices: String,
    /// Array i32: faces that are holes.
    #[serde(default)]
    pub hole_indices: Option<String>,
    /// Winding is clockwise seen from outside (`orientation = leftHanded`).
    #[serde(default)]
    pub left_handed: bool,
    /// Shading normals, f32 `[n, 3]`.
    #[serde(default)]
    pub normals: Option<Primvar>,
    /// Texture coordinates, f32 `[n, 2]`.
    #[serde(default)]
    pub uv: Option<Primvar>,
    /// The name that the texture coordinates have as a primvar, without `primvars:`.
    #[serde(default)]
    pub uv_name: Option<String>,
    /// Other primvars that materials look up, by name without `primvars:`: f32 `[n]` or `[n, k]` with k ≤ 4.
    #[serde(default)]
    pub primvars: BTreeMap<String, Primvar>,
    /// Faces with materials of their own. Faces in none have the placement's material.
    #[serde(default)]
    pub subsets: Vec<Subset>,
    /// How it is the control mesh of a subdivision surface; a polygon mesh if absent.
    #[serde(default)]
    pub subdivision: Option<Subdivision>,
    /// Where the points are at other times than the frame; they do not move if absent.
    #[serde(default)]
    pub motion: Option<MeshMotion>,
}

/// How a mesh is subdivided.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subdivision {
    /// `catmullClark`, `loop` or `bilinear`.
    pub scheme: String,
    /// How often faces are divided; 0 shows the control mesh. The renderer's default if absent.
    #[serde(default)]
    pub level: Option<u32>,
    /// `none`, `edgeOnly` or `edgeAndCorner`; the last if absent.
    #[serde(default)]
    pub interpolate_boundary: Option<String>,
    /// `none`, `cornersOnly`, `cornersPlus1`, `cornersPlus2`, `boundaries` or `all`; `cornersPlus1` if absent.
    #[serde(default)]
    pub face_varying_linear_interpolation: Option<String>,
    /// `catmullClark` or `smooth`; the first if absent.
    #[serde(default)]
    pub triangle_subdivision_rule: Option<String>,
    /// Array i32: points of all creases, one crease after the other.
    #[serde(default)]
    pub crease_indices: Option<String>,
    /// Array i32: points of each crease.
    #[serde(default)]
    pub crease_lengths: Option<String>,
    /// Array f32: one a crease, or one for each edge of every crease.
    #[serde(default)]
    pub crease_sharpnesses: Option<String>,
    /// Array i32: points that are sharp.
    #[serde(default)]
    pub corner_indices: Option<String>,
    /// Array f32: one a corner.
    #[serde(default)]
    pub corner_sharpnesses: Option<String>,
}

/// Transforms at other times than the frame, whose own stands beside them: linear between the samples, held beyond.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// In frames (time codes of the stage) from the frame, increasing.
    pub times: Vec<f64>,
    /// One for each time.
    pub transforms: Vec<[f64; 16]>,
}

/// Points of a mesh at other times than the frame: linear between the samples, held beyond.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshMotion {
    /// In frames from the frame, increasing.
    pub times: Vec<f64>,
    /// One array for each time, as [`Mesh::points`].
    pub points: Vec<String>,
    /// One array for each time, as the values of [`Mesh::normals`]; none if the normals do not move.
    #[serde(default)]
    pub normals: Vec<String>,
}

/// Transforms of instances at other times than the frame: linear between the samples, held beyond.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstancesMotion {
    /// In frames from the frame, increasing.
    pub times: Vec<f64>,
    /// One array for each time, as [`Instances::transforms`].
    pub transforms: Vec<String>,
}

/// Values over a mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Primvar {
    /// Array of values.
    pub values: String,
    /// Array i32 of indices into the values, if indexed.
    #[serde(default)]
    pub indices: Option<String>,
    /// `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
    pub interpolation: String,
}

/// Faces of a mesh with a material of their own (a GeomSubset of family `materialBind`).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subset {
    /// Prim path.
    pub path: String,
    /// Array i32 of face indices.
    pub faces: String,
}

/// Things placed together.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// For messages: a prim path.
    pub path: String,
    /// What stands in it.
    pub items: Vec<Placement>,
    /// What stands in it many times.
    #[serde(default)]
    pub instances: Vec<Instances>,
    /// What shines in it.
    #[serde(default)]
    pub lights: Vec<Light>,
}

/// A group placed by an array of transforms: those elements of a point instancer that show one prototype.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instances {
    /// Prim path of the instancer; the `instance_id` is that of `path[index]`.
    pub path: String,
    /// The prototype: index into [`Document::groups`].
    pub group: usize,
    /// The surrounding group's space from the instancer's; identity if absent.
    #[serde(default)]
    pub transform: Option<[f64; 16]>,
    /// Array f64 `[n, 12]`: the instancer's space from the prototype's. Rows of matrices without their last column, which is
    /// (0, 0, 0, 1): translation last.
    pub transforms: String,
    /// Array i32 `[n]`: which element of the instancer each is, increasing; 0, 1, 2 … if absent.
    #[serde(default)]
    pub indices: Option<String>,
    /// Elements of the instancer, hidden ones and those of other prototypes included.
    pub count: usize,
    /// The link sets of all that this places; those of what is placed if absent.
    #[serde(default)]
    pub link_sets: Option<Vec<usize>>,
    /// The surrounding group's space from the instancer's at other times.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// The instancer's space from the prototype's at other times.
    #[serde(default)]
    pub places_motion: Option<InstancesMotion>,
}

/// A shape or a group, placed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Prim path as it appears on the composed stage; the `prim_id` of shapes.
    pub path: String,
    /// What is placed.
    pub target: Target,
    /// Parent space from object space; identity if absent.
    #[serde(default)]
    pub transform: Option<[f64; 16]>,
    /// Parent space from object space at other times than the frame; it does not move if absent.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// Path of the instance this belongs to; the `instance_id`.
    #[serde(default)]
    pub instance: Option<String>,
    /// Material of the faces in no subset.
    #[serde(default)]
    pub material: Option<usize>,
    /// Materials of the mesh's subsets, in their order; shorter or `null`: the material above.
    #[serde(default)]
    pub subset_materials: Vec<Option<usize>>,
    /// Constant primvars that materials look up, inherited ones included, where the mesh itself has none of the name: by
    /// name without `primvars:`, one to four numbers.
    #[serde(default)]
    pub primvars: BTreeMap<String, Vec<f64>>,
    /// Camera rays pass through it unseen; rays that were refracted or reflected meet it.
    #[serde(default)]
    pub hidden_from_camera: bool,
    /// It holds out what is behind it: nothing of it shows, and alpha is 0 there.
    #[serde(default)]
    pub matte: bool,
    /// Lit and shaded from both sides; for glass the sides are decided by the normal alone.
    #[serde(default)]
    pub double_sided: bool,
    /// Indices into [`Document::link_sets`], increasing: see [`LinkSet::excludes`].
    #[serde(default)]
    pub link_sets: Vec<usize>,
}

/// What a placement places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Target {
    /// Index into [`Document::shapes`].
    Shape(usize),
    /// Index into [`Document::groups`].
    Group(usize),
}

/// A material as authored.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Prim path.
    pub path: String,
    /// Authored `abbe:…` attributes of the Material prim.
    #[serde(default)]
    pub abbe: AuthoredMap,
    /// Authored `inputs:abbe:…` of the Material's interface, keyed without `inputs:`.
    #[serde(default)]
    pub interface_abbe: AuthoredMap,
    /// The surface shader of the first terminal that leads to one: ours, MaterialX', the universal one, then those of
    /// other render contexts by name.
    #[serde(default)]
    pub surface: Option<Shader>,
    /// The surface shaders of the terminals after it, in the same order, each shader once.
    #[serde(default)]
    pub alternatives: Vec<Shader>,
    /// The nodes behind inputs that are no constants, each behind those that it is connected to.
    #[serde(default)]
    pub nodes: Vec<Node>,
}

/// A node of a shading network as authored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Prim path.
    pub path: String,
    /// `info:id`, for instance `UsdUVTexture` or `ND_multiply_color3`.
    pub id: String,
    /// Authored constant inputs by name without `inputs:`, connections to constants followed.
    #[serde(default)]
    pub inputs: AuthoredMap,
    /// Inputs that other nodes drive.
    #[serde(default)]
    pub connected: BTreeMap<String, NodeOutput>,
    /// Inputs that name an image: index into [`Document::textures`].
    #[serde(default)]
    pub textures: BTreeMap<String, usize>,
}

/// One output of a node.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeOutput {
    /// Index into [`Material::nodes`]; of a node's input one before the node's own.
    pub node: usize,
    /// Name of the output without `outputs:`.
    pub output: String,
}

/// A surface shader as authored.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shader {
    /// Prim path.
    pub path: String,
    /// `info:id`, for instance `ND_open_pbr_surface_surfaceshader`.
    pub id: String,
    /// The terminal it was found through: `outputs:abbe:surface`, `outputs:mtlx:surface`, `outputs:surface` or another
    /// render context's, such as `outputs:arnold:surface`.
    pub terminal: String,
    /// Authored constant inputs by name without `inputs:`, connections to constants followed.
    #[serde(default)]
    pub inputs: AuthoredMap,
    /// Inputs driven by a network: name → the path of the output that drives it.
    #[serde(default)]
    pub connected: BTreeMap<String, String>,
    /// The same inputs, to the nodes of the material that drive them.
    #[serde(default)]
    pub networks: BTreeMap<String, NodeOutput>,
    /// Authored `inputs:abbe:…`, keyed without `inputs:`, connections followed.
    #[serde(default)]
    pub abbe: AuthoredMap,
}

/// A light as authored (UsdLux), the schema's fallbacks filled in. Rect, disk and distant lights shine along their −z, the
/// cylinder lies along x.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Prim path.
    pub path: String,
    /// What shines.
    pub shape: LightShape,
    /// The group's space from the light's; identity if absent.
    #[serde(default)]
    pub transform: Option<[f64; 16]>,
    /// `inputs:intensity`: luminance in nits, relative to the colour.
    pub intensity: f64,
    /// `inputs:exposure`: a power of two on it.
    pub exposure: f64,
    /// `inputs:normalize`: divided by the light's size.
    pub normalize: bool,
    /// `inputs:color`, linear Rec. 709.
    pub color: [f64; 3],
    /// `inputs:enableColorTemperature`.
    pub enable_color_temperature: bool,
    /// `inputs:colorTemperature`, kelvin.
    pub color_temperature: f64,
    /// `inputs:diffuse`: a factor on what diffuse materials receive.
    pub diffuse: f64,
    /// `inputs:specular`: a factor on what specular materials receive.
    pub specular: f64,
    /// What UsdLuxShapingAPI says; absent where it is neither applied nor authored.
    #[serde(default)]
    pub shaping: Option<LightShaping>,
    /// What UsdLuxShadowAPI says; absent where it is neither applied nor authored.
    #[serde(default)]
    pub shadow: Option<LightShadow>,
    /// What it illuminates: index into [`Document::link_sets`], everything if absent.
    #[serde(default)]
    pub light_link: Option<usize>,
    /// What casts shadows in its light: index into [`Document::link_sets`], everything if absent.
    #[serde(default)]
    pub shadow_link: Option<usize>,
    /// Authored `abbe:…` attributes.
    #[serde(default)]
    pub abbe: AuthoredMap,
    /// Authored `physical:…` attributes (PhysicalLightIlluminantAPI), keyed without that prefix.
    #[serde(default)]
    pub physical: AuthoredMap,
}

/// What a light is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum LightShape {
    /// Light from one direction, or from a disk of sky.
    Distant {
        /// Its diameter, degrees.
        angle: f64,
    },
    /// Light from everywhere.
    Dome {
        /// What it looks like: index into [`Document::textures`]; white if absent.
        texture: Option<usize>,
        /// `automatic`, `latlong`, `mirroredBall`, `angular` or `cubeMapVerticalCross`.
        format: String,
        /// Which axis of the light its upper pole is on: `Y` or `Z`.
        pole_axis: String,
        /// Radius at which other software draws it.
        guide_radius: f64,
        /// Paths of the portal lights through which it shines.
        portals: Vec<String>,
    },
    /// A rectangle.
    Rect {
        /// Along x.
        width: f64,
        /// Along y.
        height: f64,
        /// What it looks like: index into [`Document::textures`]; white if absent.
        texture: Option<usize>,
    },
    /// A disk.
    Disk {
        /// Its radius.
        radius: f64,
    },
    /// A sphere.
    Sphere {
        /// Its radius.
        radius: f64,
        /// It may be taken for a point.
        treat_as_point: bool,
    },
    /// The side of a cylinder.
    Cylinder {
        /// Along x.
        length: f64,
        /// Its radius.
        radius: f64,
        /// It may be taken for a line.
        treat_as_line: bool,
    },
    /// Geometry that shines.
    Geometry {
        /// Paths of placements.
        prims: Vec<String>,
        /// `materialGlowTintsLight`, `independent` or `noMaterialResponse`.
        material_sync_mode: String,
    },
    /// A rectangle through which a dome shines; no light by itself.
    Portal {
        /// Along x.
        width: f64,
        /// Along y.
        height: f64,
    },
}

/// Where a light's emission goes (UsdLuxShapingAPI).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightShaping {
    /// Exponent of the cosine to the axis.
    pub focus: f64,
    /// Colour off the axis.
    pub focus_tint: [f64; 3],
    /// Beyond it there is no light, degrees.
    pub cone_angle: f64,
    /// Part of the cone over which light fades.
    pub cone_softness: f64,
    /// Photometric profile.
    #[serde(default)]
    pub ies: Option<Asset>,
    /// How the profile's angles are scaled; 0 leaves them.
    pub ies_angle_scale: f64,
    /// The profile shapes the light without changing its power.
    pub ies_normalize: bool,
}

/// Shadows in the light of one light (UsdLuxShadowAPI).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightShadow {
    /// Whether there are any.
    pub enable: bool,
    /// What is seen in full shadow.
    pub color: [f64; 3],
    /// Occluders farther from the surface than this cast none; negative: all do.
    pub distance: f64,
    /// Length of the zone before that in which shadows fade; none unless positive.
    pub falloff: f64,
    /// Exponent of the fading.
    pub falloff_gamma: f64,
}

/// A collection that a light or its shadows are linked to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkSet {
    /// The first collection with these members, such as `/Lamp.collection:lightLink`.
    pub path: String,
    /// Placements outside of the collection list the set; else those in it do. The bridge takes the shorter way.
    pub excludes: bool,
}

/// A camera as authored (UsdGeomCamera: apertures and focal length in tenths of a stage unit).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Prim path; empty for a camera that the bridge framed by itself.
    pub path: String,
    /// World from camera space (camera looks along −z, y up).
    pub transform: [f64; 16],
    /// `perspective` or `orthographic`.
    pub projection: String,
    /// Tenths of a stage unit.
    pub horizontal_aperture: f64,
    /// Tenths of a stage unit.
    pub vertical_aperture: f64,
    /// Tenths of a stage unit, +x right.
    #[serde(default)]
    pub horizontal_aperture_offset: f64,
    /// Tenths of a stage unit, +y up.
    #[serde(default)]
    pub vertical_aperture_offset: f64,
    /// Tenths of a stage unit.
    pub focal_length: f64,
    /// Near and far, stage units.
    #[serde(default)]
    pub clipping_range: Option<[f64; 2]>,
    /// Whether `clipping_range` is authored, not a fallback.
    #[serde(default)]
    pub clipping_authored: bool,
    /// Planes (a, b, c, d): what is seen has a x + b y + c z + d ≥ 0 in camera space.
    #[serde(default)]
    pub clipping_planes: Vec<[f64; 4]>,
    /// 0 for a pinhole.
    #[serde(default)]
    pub f_stop: f64,
    /// Stage units.
    #[serde(default)]
    pub focus_distance: f64,
    /// What the sensor makes of light; nothing of it is applied to derivatives.
    #[serde(default)]
    pub exposure: Option<Exposure>,
    /// Shutter opening, frames relative to the time code.
    #[serde(default)]
    pub shutter_open: f64,
    /// Shutter closing.
    #[serde(default)]
    pub shutter_close: f64,
    /// The transform at other times than the frame.
    #[serde(default)]
    pub motion: Option<Motion>,
}

/// What is authored of a camera's exposure (UsdGeomCamera: `exposure`, `exposure:time` …).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Compensation, powers of 2.
    #[serde(default)]
    pub stops: Option<f64>,
    /// Seconds.
    #[serde(default)]
    pub time: Option<f64>,
    /// Speed of the sensor.
    #[serde(default)]
    pub iso: Option<f64>,
    /// The f-number that lets light in; that of the lens' blur is [`Camera::f_stop`].
    #[serde(default)]
    pub f_stop: Option<f64>,
    /// Of the sensor.
    #[serde(default)]
    pub responsivity: Option<f64>,
}

/// Render settings with their products flattened by the rules of UsdRenderComputeSpec.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Prim path, if the stage has any.
    #[serde(default)]
    pub path: Option<String>,
    /// Authored `abbe:…` attributes.
    #[serde(default)]
    pub abbe: AuthoredMap,
    /// One per product; none if the stage has none.
    #[serde(default)]
    pub products: Vec<Product>,
    /// Resolution and window of the settings prim itself, for stages with settings but no product.
    #[serde(default)]
    pub base: Option<Product>,
}

/// One output file of the stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// Prim path.
    pub path: String,
    /// `productName`, tokens already replaced; empty if unusable.
    pub name: String,
    /// `productType`.
    #[serde(default)]
    pub product_type: String,
    /// Index of the camera; the default camera if absent.
    #[serde(default)]
    pub camera: Option<usize>,
    /// Only if authored on the product or the settings.
    #[serde(default)]
    pub resolution: Option<[i64; 2]>,
    /// `pixelAspectRatio`.
    pub pixel_aspect_ratio: f64,
    /// `aspectRatioConformPolicy`.
    pub aspect_ratio_conform_policy: String,
    /// xmin, ymin, xmax, ymax, y up.
    pub data_window_ndc: [f64; 4],
    /// Depth of field is off.
    #[serde(default)]
    pub disable_depth_of_field: bool,
    /// Motion blur is off.
    #[serde(default)]
    pub disable_motion_blur: bool,
    /// `renderingColorSpace`; empty if not authored.
    #[serde(default)]
    pub rendering_color_space: String,
    /// Authored `abbe:…` attributes.
    #[serde(default)]
    pub abbe: AuthoredMap,
    /// Authored `driver:parameters:…` attributes, keyed without that prefix.
    #[serde(default)]
    pub driver: AuthoredMap,
    /// The variables, in order.
    #[serde(default)]
    pub vars: Vec<Var>,
}

/// One RenderVar of a product.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Var {
    /// Prim path.
    pub path: String,
    /// Prim name.
    pub name: String,
    /// `sourceName`.
    pub source_name: String,
    /// `raw`, `primvar`, `lpe` or `intrinsic`.
    #[serde(default)]
    pub source_type: String,
    /// `dataType`.
    #[serde(default)]
    pub data_type: String,
    /// Authored `driver:parameters:aov:…` (and `ri:driver:parameters:aov:…`), keyed without that prefix.
    #[serde(default)]
    pub driver: AuthoredMap,
    /// Authored `abbe:…` attributes.
    #[serde(default)]
    pub abbe: AuthoredMap,
}

/// Element type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `f32`
    F32,
    /// `f64`
    F64,
    /// `i32`
    I32,
    /// `u8`
    U8,
}

impl Element {
    /// Bytes per element.
    pub fn size(self) -> usize {
        match self {
            Self::F32 | Self::I32 => 4,
            Self::F64 => 8,
            Self::U8 => 1,
        }
    }
}

/// A named array: shared bytes with a type and a shape. Cloning shares.
#[derive(Clone, Debug)]
pub struct Array {
    /// Element type.
    pub element: Element,
    /// Row-major shape.
    pub shape: Vec<usize>,
    /// The memory: ours, Python's or a mapped file's. Aligned to the element, or the accessors refuse it.
    pub bytes: Bytes,
}

impl Array {
    /// Owned values as an array of shape `[n, k]` (`[n]` if `columns` is 1).
    pub fn from_vec<T: bytemuck::NoUninit + Send + Sync>(element: Element, columns: usize, values: Vec<T>) -> Self {
        struct Owner<T>(Vec<T>);
        impl<T: bytemuck::NoUninit> AsRef<[u8]> for Owner<T> {
            fn as_ref(&self) -> &[u8] {
                bytemuck::cast_slice(&self.0)
            }
        }
        let count = std::mem::size_of_val(values.as_slice()) / element.size();
        let shape = if columns == 1 { vec![count] } else { vec![count / columns, columns] };
        Self { element, shape, bytes: Bytes::from_owner(Owner(values)) }
    }
}

/// Arrays by name.
pub type Arrays = BTreeMap<String, Array>;

/// A document with its arrays.
#[derive(Clone, Debug)]
pub struct Description {
    /// The document.
    pub document: Document,
    /// The arrays that it names.
    pub arrays: Arrays,
}

impl Description {
    /// Reads the document's JSON; `place` names its origin in errors.
    pub fn from_json(json: &str, arrays: Arrays, place: &str) -> Result<Self> {
        let document: Document = serde_json::from_str(json)
            .map_err(|e| Error::scene(place, format!("is not a scene description of version {VERSION}: {e}")))?;
        if document.format != FORMAT || document.version != VERSION {
            return Err(Error::scene(
                place,
                format!(
                    "is '{}' version {}, this abbe reads '{FORMAT}' version {VERSION}: export the stage again",
                    document.format, document.version
                ),
            ));
        }
        Ok(Self { document, arrays })
    }
}
