//! Polygon meshes as authored.

use super::Buffer;

/// How the values of a primvar belong to a mesh (UsdGeomPrimvar).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// One value for the mesh.
    Constant,
    /// One per face.
    Uniform,
    /// One per point; for polygons the same as `Vertex`.
    Varying,
    /// One per point.
    Vertex,
    /// One per face corner.
    FaceVarying,
}

impl Interpolation {
    /// The interpolation with this USD token.
    pub fn from_token(token: &str) -> Option<Self> {
        Some(match token {
            "constant" => Self::Constant,
            "uniform" => Self::Uniform,
            "varying" => Self::Varying,
            "vertex" => Self::Vertex,
            "faceVarying" => Self::FaceVarying,
            _ => return None,
        })
    }
}

/// Values over a mesh, as authored.
#[derive(Clone, Debug)]
pub struct PrimvarView<'a> {
    /// Values, flat: three floats each for normals, two for texture coordinates.
    pub values: Buffer<f32>,
    /// Indices into the values, if indexed.
    pub indices: Option<&'a [i32]>,
    /// What the values belong to.
    pub interpolation: Interpolation,
}

/// A polygon mesh, as authored and unchecked.
#[derive(Clone, Debug)]
pub struct PolygonMesh<'a> {
    /// Prim path, for messages.
    pub path: &'a str,
    /// Points in object space.
    pub points: Buffer<[f32; 3]>,
    /// Corners of each face.
    pub counts: &'a [i32],
    /// Points of all corners, face after face.
    pub indices: &'a [i32],
    /// Faces that are holes.
    pub holes: &'a [i32],
    /// Winding is clockwise seen from outside.
    pub left_handed: bool,
    /// Shading normals.
    pub normals: Option<PrimvarView<'a>>,
    /// Texture coordinates.
    pub uv: Option<PrimvarView<'a>>,
    /// Faces with slots of their own: prim path of the subset and face indices.
    pub subsets: &'a [(&'a str, &'a [i32])],
}
