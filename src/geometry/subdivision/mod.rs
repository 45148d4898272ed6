//! Subdivision surfaces: control meshes refined to points and normals of their limit surface.
//!
//! Catmull–Clark, Loop and bilinear with everything that UsdGeomMesh says of them: creases and corners of any sharpness,
//! boundaries, face-varying rules, the triangle rule, holes. The topology is refined once (`topology.rs`) and applied to as
//! many arrays as there are (`masks.rs`); positions and normals are then those of the limit surface itself (`limit.rs`), all
//! in f64. Rules are OpenSubdiv's, which USD refers to, with the deviations that `tangents.rs` states.
//!
//! Why not OpenSubdiv itself: the crate that wraps it (opensubdiv-petite 0.3.1) interpolates and evaluates in f32 alone, does
//! not wrap the limit of its primvar refiner, has no way to describe face-varying channels (its limit surfaces have
//! positions only), holds hole indices against the number of vertices, and needs cmake and libclang where this crate is
//! built, which plain `cargo build` on a machine with Rust and a C compiler does not have.

mod face_varying;
mod limit;
mod masks;
mod refined;
mod tangents;
mod topology;

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "what stays has the same bits")]
mod tests;

pub(super) use refined::Refined;

use super::{Buffer, Interpolation, PolygonMesh};
use masks::Masks;
use topology::{INFINITE, Level};

/// `subdivisionScheme`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Quads and any other faces.
    CatmullClark,
    /// Triangles only.
    Loop,
    /// Faces divided, nothing smoothed.
    Bilinear,
}

/// `interpolateBoundary`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundaryInterpolation {
    /// Faces at a boundary only support others.
    None,
    /// Boundaries are smooth curves.
    EdgeOnly,
    /// So they are, but for vertices in one face, which stay.
    EdgeAndCorner,
}

/// `faceVaryingLinearInterpolation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceVaryingInterpolation {
    /// Smooth everywhere.
    None,
    /// Corners stay.
    CornersOnly,
    /// So do values where three or more regions meet, or with a crease inside one of two.
    CornersPlus1,
    /// So do the ends of seams and concave corners.
    CornersPlus2,
    /// Boundaries of regions are straight.
    Boundaries,
    /// Nothing is smoothed.
    All,
}

/// `triangleSubdivisionRule`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriangleRule {
    /// As any face.
    CatmullClark,
    /// Weights that keep triangles smooth.
    Smooth,
}

macro_rules! tokens {
    ($type:ident: $($token:literal => $variant:ident),+) => {
        impl $type {
            /// What the USD token says.
            pub fn from_token(token: &str) -> Option<Self> {
                match token {
                    $($token => Some(Self::$variant),)+
                    _ => None,
                }
            }
        }
    };
}

tokens!(Scheme: "catmullClark" => CatmullClark, "loop" => Loop, "bilinear" => Bilinear);
tokens!(BoundaryInterpolation: "none" => None, "edgeOnly" => EdgeOnly, "edgeAndCorner" => EdgeAndCorner);
tokens!(FaceVaryingInterpolation: "none" => None, "cornersOnly" => CornersOnly, "cornersPlus1" => CornersPlus1,
    "cornersPlus2" => CornersPlus2, "boundaries" => Boundaries, "all" => All);
tokens!(TriangleRule: "catmullClark" => CatmullClark, "smooth" => Smooth);

/// How a mesh is subdivided, as authored and unchecked.
#[derive(Clone, Debug)]
pub struct Subdivision<'a> {
    /// The scheme.
    pub scheme: Scheme,
    /// How often faces are divided; 0 leaves the control mesh.
    pub level: u32,
    /// What boundaries are.
    pub boundary: BoundaryInterpolation,
    /// What face-varying values do.
    pub face_varying: FaceVaryingInterpolation,
    /// What triangles are to Catmull–Clark.
    pub triangles: TriangleRule,
    /// Points of the creases, one crease after the other.
    pub crease_indices: &'a [i32],
    /// Points of each crease, at least two.
    pub crease_lengths: &'a [i32],
    /// One a crease, or one an edge of every crease.
    pub crease_sharpnesses: Option<Buffer<f32>>,
    /// Points that are sharp.
    pub corner_indices: &'a [i32],
    /// One a corner.
    pub corner_sharpnesses: Option<Buffer<f32>>,
}

/// Where nobody asked for a level: coarse control meshes are refined as long as they stay below the first, fine ones once
/// only if twice would go beyond the second.
const FEW_TRIANGLES: u64 = 1 << 13;
const MANY_TRIANGLES: u64 = 1 << 22;

impl Subdivision<'_> {
    /// The level where none is asked for: 2; 3 or 4 while that makes no more than 8192 triangles; 1 if 2 would make more than
    /// four million.
    ///
    /// Level 0 is no choice: facets bend glass in steps. At level 2, through a lens of ten faces across, ∂p/∂λ is right to 1e-4
    /// and what needs the curvature to 2e-3 (`tests/python/test_subdivision.py` has the rates); a finer choice would cost
    /// every wall and chair four times as much, while the ball made of a cube costs nothing and is as round as others.
    pub fn default_level(scheme: Scheme, counts: &[i32]) -> u32 {
        let corners = counts.iter().map(|&n| n.max(0) as u64).sum();
        let triangles = |level| triangles_at(scheme, level, counts.len() as u64, corners);
        match (triangles(4), triangles(3), triangles(2)) {
            (0..=FEW_TRIANGLES, ..) => 4,
            (_, 0..=FEW_TRIANGLES, _) => 3,
            (.., 0..=MANY_TRIANGLES) => 2,
            _ => 1,
        }
    }
}

/// Triangles at a level of at least 1; `u64::MAX` where they cannot be counted.
fn triangles_at(scheme: Scheme, level: u32, faces: u64, corners: u64) -> u64 {
    let first = if scheme == Scheme::Loop { 4 * faces } else { 2 * corners };
    1_u64.checked_shl(2 * (level - 1)).and_then(|more| first.checked_mul(more)).unwrap_or(u64::MAX)
}

/// More triangles than this are not made of one mesh: the level is lowered until they fit.
pub const MAX_TRIANGLES: u64 = 1 << 25;

/// The topology of a subdivision surface, refined: made once, applied to any number of arrays.
#[derive(Debug)]
pub(super) struct Refiner {
    scheme: Scheme,
    masks: Masks,
    face_varying: FaceVaryingInterpolation,
    /// The control mesh first.
    levels: Vec<Level>,
    /// The authored face of each face of the control mesh.
    faces: Vec<u32>,
    /// The authored corner of each of its corners.
    corners: Vec<u32>,
    /// Authored faces that are not drawn.
    holes: Vec<bool>,
    left_handed: bool,
}

/// Points of the limit surface with its normals.
pub(super) struct Surface {
    pub(super) points: Vec<[f32; 3]>,
    /// Flat, three floats each: one a point, then more for points with several.
    pub(super) normals: Vec<f32>,
    /// The normal of each corner; that of its point if absent.
    pub(super) normal_indices: Option<Vec<i32>>,
}

impl Refiner {
    /// Checked polygons, as `subdivision` says. Says what it could not use; `None` where the scheme cannot be applied.
    pub(super) fn new(
        polygons: &PolygonMesh<'_>,
        subdivision: &Subdivision<'_>,
        problems: &mut Vec<String>,
    ) -> Option<Self> {
        let mut offsets = vec![0];
        let (mut faces, mut corners, mut corner_vertex) = (Vec::new(), Vec::new(), Vec::new());
        let mut first = 0;
        for (face, &count) in polygons.counts.iter().enumerate() {
            let range = first..first + count as usize;
            first = range.end;
            if count < 3 {
                continue;
            }
            if subdivision.scheme == Scheme::Loop && count != 3 {
                problems.push(format!(
                    "face {face} has {count} corners, and Loop's scheme knows triangles only: the control mesh is used"
                ));
                return None;
            }
            faces.push(face as u32);
            corner_vertex.extend(polygons.indices[range.clone()].iter().map(|&i| i as u32));
            corners.extend(range.map(|corner| corner as u32));
            offsets.push(corners.len() as u32);
        }
        let level = affordable(subdivision, faces.len(), corners.len());
        if level < subdivision.level {
            problems.push(format!(
                "{} levels would make more than {MAX_TRIANGLES} triangles: {level} are used",
                subdivision.level
            ));
        }
        if level == 0 {
            return None;
        }
        let triangles = subdivision.scheme == Scheme::Loop;
        let mut base = Level::new(offsets, corner_vertex, polygons.points.len());
        if triangles {
            base.faces = topology::Faces::Uniform(3);
        }
        let mut holes = vec![false; polygons.counts.len()];
        polygons.holes.iter().for_each(|&hole| holes[hole as usize] = true);
        sharpen_edges(&mut base, subdivision, problems);
        let is_smooth = subdivision.scheme != Scheme::Bilinear;
        if is_smooth && subdivision.boundary == BoundaryInterpolation::None {
            hide_boundaries(&base, subdivision, &faces, &mut holes);
        }
        sharpen_vertices(&mut base, subdivision, problems);
        let mut levels = vec![base];
        for _ in 0..level {
            let last = &levels[levels.len() - 1];
            levels.push(if triangles { last.divided_into_triangles() } else { last.divided_into_quads() });
        }
        let masks = match subdivision.scheme {
            Scheme::Bilinear => Masks::Linear,
            Scheme::Loop => Masks::Loop,
            Scheme::CatmullClark => {
                Masks::CatmullClark { smooth_triangles: subdivision.triangles == TriangleRule::Smooth }
            }
        };
        Some(Self {
            scheme: subdivision.scheme,
            masks,
            face_varying: subdivision.face_varying,
            levels,
            faces,
            corners,
            holes,
            left_handed: polygons.left_handed,
        })
    }

    fn last(&self) -> &Level {
        &self.levels[self.levels.len() - 1]
    }

    /// Corners of every refined face.
    pub(super) fn face_size(&self) -> usize {
        if self.scheme == Scheme::Loop { 3 } else { 4 }
    }

    /// The point of each refined corner.
    pub(super) fn corner_points(&self) -> &[u32] {
        &self.last().corner_vertex
    }

    /// The authored face that each refined face is part of.
    pub(super) fn authored_faces(&self) -> impl Iterator<Item = u32> + '_ {
        let depth = 2 * (self.levels.len() as u32 - 1);
        let base = &self.levels[0];
        (0..base.face_count()).flat_map(move |face| {
            // A quad is made of each corner, and four of each after that; four of a triangle from the first.
            let children = match self.scheme {
                Scheme::Loop => 1 << depth,
                _ => base.corners(face).len() << (depth - 2),
            };
            std::iter::repeat_n(self.faces[face], children)
        })
    }

    /// Whether an authored face is not drawn.
    pub(super) fn is_hole(&self, face: u32) -> bool {
        self.holes[face as usize]
    }

    /// The authored faces that are not drawn.
    pub(super) fn holes(&self) -> Vec<i32> {
        (0..self.holes.len() as i32).filter(|&face| self.is_hole(face as u32)).collect()
    }

    fn at_last_level<const N: usize>(&self, levels: &[Level], masks: Masks, values: Vec<[f64; N]>) -> Vec<[f64; N]> {
        let (_, parents) = levels.split_last().expect("the control mesh");
        parents.iter().fold(values, |values, level| masks::refine(level, masks, self.scheme == Scheme::Loop, &values))
    }

    /// The limit of control points.
    pub(super) fn surface(&self, points: &[[f32; 3]]) -> Surface {
        let points = points.iter().map(|p| p.map(f64::from)).collect();
        let refined = self.at_last_level(&self.levels, self.masks, points);
        let limit = limit::surface(self.last(), self.masks, &refined);
        let sign = if self.left_handed { -1.0 } else { 1.0 };
        Surface {
            points: limit.points.iter().map(|p| p.map(|x| x as f32)).collect(),
            normals: limit.normals.iter().flatten().map(|x| (sign * x) as f32).collect(),
            normal_indices: limit.corner_normals.map(|indices| indices.into_iter().map(|i| i as i32).collect()),
        }
    }

    /// Values of the refined points from those of the control points.
    pub(super) fn values<const N: usize>(&self, values: Vec<[f64; N]>, interpolation: Interpolation) -> Vec<[f64; N]> {
        let masks = if interpolation == Interpolation::Varying { Masks::Linear } else { self.masks };
        limit::positions(self.last(), masks, &self.at_last_level(&self.levels, masks, values))
    }
}

/// How many levels make no more triangles than allowed.
fn affordable(subdivision: &Subdivision<'_>, faces: usize, corners: usize) -> u32 {
    let fits = |level: &u32| triangles_at(subdivision.scheme, *level, faces as u64, corners as u64) <= MAX_TRIANGLES;
    // No faces at all could be divided for ever.
    (1..=subdivision.level.min(12)).take_while(fits).last().unwrap_or(0)
}

/// Gives the edges of creases their sharpness.
fn sharpen_edges(base: &mut Level, subdivision: &Subdivision<'_>, problems: &mut Vec<String>) {
    let Subdivision { crease_indices: indices, crease_lengths: lengths, .. } = subdivision;
    let sharpnesses = subdivision.crease_sharpnesses.as_deref().unwrap_or_default();
    if indices.is_empty() && lengths.is_empty() {
        return;
    }
    let points: i64 = lengths.iter().map(|&n| i64::from(n.max(0))).sum();
    let edges: i64 = lengths.iter().map(|&n| i64::from(n) - 1).sum();
    if lengths.iter().any(|&n| n < 2) || points != indices.len() as i64 {
        problems.push(format!(
            "creaseLengths (at least 2 each) add up to {points}, but creaseIndices has {}: the creases are left out",
            indices.len()
        ));
        return;
    }
    let a_crease = sharpnesses.len() == lengths.len();
    if !a_crease && sharpnesses.len() as i64 != edges {
        problems.push(format!(
            "creaseSharpnesses has {} values for {} creases of {edges} edges: the creases are left out",
            sharpnesses.len(),
            lengths.len()
        ));
        return;
    }
    let (mut first, mut edge, mut unknown) = (0, 0, 0);
    for (crease, &length) in lengths.iter().enumerate() {
        for pair in indices[first..first + length as usize].windows(2) {
            let sharpness = sharpnesses[if a_crease { crease } else { edge }];
            edge += 1;
            let ends = [pair[0].min(pair[1]), pair[0].max(pair[1])];
            let found =
                u32::try_from(ends[0]).ok().and_then(|low| base.edges.binary_search(&[low, ends[1] as u32]).ok());
            match found {
                Some(found) => {
                    let kept = &mut base.edge_sharpness[found];
                    *kept = kept.max(clean(sharpness));
                }
                None => unknown += 1,
            }
        }
        first += length as usize;
    }
    if unknown > 0 {
        problems.push(format!("{unknown} pairs of creaseIndices are no edge of the mesh: they are left out"));
    }
}

/// A sharpness from 0 to [`INFINITE`].
fn clean(sharpness: f32) -> f32 {
    if sharpness > 0.0 { sharpness.min(INFINITE) } else { 0.0 }
}

/// `interpolateBoundary = none`: faces at boundaries that no infinitely sharp crease follows are holes (OpenSubdiv).
fn hide_boundaries(base: &Level, subdivision: &Subdivision<'_>, faces: &[u32], holes: &mut [bool]) {
    let creased = authored_infinite(base, subdivision);
    let mut at_boundary = vec![false; base.vertices];
    for (edge, (&ends, corners)) in base.edges.iter().zip(&base.edge_corners).enumerate() {
        if corners[1] == topology::NONE && !creased.contains(&(edge as u32)) {
            ends.iter().for_each(|&v| at_boundary[v as usize] = true);
        }
    }
    for (face, &authored) in faces.iter().enumerate() {
        if base.corner_vertex[base.corners(face)].iter().any(|&v| at_boundary[v as usize]) {
            holes[authored as usize] = true;
        }
    }
}

/// Edges that authored creases make infinitely sharp, boundaries or not.
fn authored_infinite(base: &Level, subdivision: &Subdivision<'_>) -> std::collections::BTreeSet<u32> {
    // The same walk over the creases, on edges that are all smooth to begin with.
    let mut smooth = Level {
        faces: topology::Faces::Uniform(3),
        vertices: 0,
        corner_vertex: Vec::new(),
        corner_edge: Vec::new(),
        edges: base.edges.clone(),
        edge_corners: Vec::new(),
        edge_sharpness: vec![0.0; base.edges.len()],
        vertex_sharpness: Vec::new(),
    };
    sharpen_edges(&mut smooth, subdivision, &mut Vec::new());
    let infinite = smooth.edge_sharpness.iter().enumerate().filter(|(_, s)| **s >= INFINITE);
    infinite.map(|(edge, _)| edge as u32).collect()
}

/// Gives corners their sharpness, authored ones and those that the boundary rule asks for.
fn sharpen_vertices(base: &mut Level, subdivision: &Subdivision<'_>, problems: &mut Vec<String>) {
    let indices = subdivision.corner_indices;
    let sharpnesses = subdivision.corner_sharpnesses.as_deref().unwrap_or_default();
    if indices.len() != sharpnesses.len() {
        problems.push(format!(
            "cornerSharpnesses has {} values for {} cornerIndices: the corners are left out",
            sharpnesses.len(),
            indices.len()
        ));
    } else {
        let mut unknown = 0;
        for (&index, &sharpness) in indices.iter().zip(sharpnesses) {
            match usize::try_from(index).ok().and_then(|i| base.vertex_sharpness.get_mut(i)) {
                Some(kept) => *kept = kept.max(clean(sharpness)),
                None => unknown += 1,
            }
        }
        if unknown > 0 {
            problems.push(format!("{unknown} of the cornerIndices are no point of the mesh: they are left out"));
        }
    }
    if subdivision.boundary == BoundaryInterpolation::EdgeAndCorner {
        let mut faces = vec![0_u32; base.vertices];
        base.corner_vertex.iter().for_each(|&v| faces[v as usize] += 1);
        let mut edges = vec![0_u32; base.vertices];
        base.edges.iter().flatten().for_each(|&v| edges[v as usize] += 1);
        for ((sharpness, faces), edges) in base.vertex_sharpness.iter_mut().zip(faces).zip(edges) {
            if faces == 1 && edges == 2 {
                *sharpness = INFINITE;
            }
        }
    }
}
