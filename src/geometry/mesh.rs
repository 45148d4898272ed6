//! Triangle meshes.

use super::PolygonMesh;
use crate::Result;

/// Triangles over authored points, with the tree over them.
#[derive(Debug)]
pub struct Mesh {}

/// What was found when a mesh was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Triangles that rays can meet.
    pub triangles: usize,
    /// Triangles without area (relative 1e-12), left out.
    pub degenerate: usize,
    /// Faces with fewer than three corners, left out.
    pub short_faces: usize,
    /// Edges (by position) at which an odd number of faces meet.
    pub open_edges: usize,
    /// Edges whose faces do not run against each other, as those of a consistent orientation do.
    pub misoriented_edges: usize,
    /// Every edge is passed equally often both ways: the mesh has an inside.
    pub is_closed: bool,
    /// Faces in more than one subset; the first subset has them.
    pub faces_in_several_subsets: usize,
    /// The authored normals point against the faces on most of the mesh; they are used reversed.
    pub normals_reversed: bool,
}

impl Mesh {
    /// Checks the arrays, cuts the polygons into triangles and builds the tree.
    pub fn from_polygons(_polygons: &PolygonMesh<'_>) -> Result<(Self, MeshReport)> {
        todo!()
    }
}
