//! Polygon meshes as authored: checked here, and cut into triangles.

use std::ops::Range;

use earcut::Earcut;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Buffer;
use super::mesh::MeshProblem;
use super::subdivision::Subdivision;
use crate::{Error, Result};

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

    /// What there is one value for.
    fn element(self) -> &'static str {
        match self {
            Self::Constant => "mesh",
            Self::Uniform => "face",
            Self::Varying | Self::Vertex => "point",
            Self::FaceVarying => "face corner",
        }
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

/// A primvar that something looks up by its name.
#[derive(Clone, Debug)]
pub struct NamedPrimvar<'a> {
    /// The name without `primvars:`.
    pub name: &'a str,
    /// Floats in a value, 1 to 4.
    pub columns: usize,
    /// The values.
    pub view: PrimvarView<'a>,
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
    pub indices: Buffer<i32>,
    /// Faces that are holes.
    pub holes: &'a [i32],
    /// Winding is clockwise seen from outside.
    pub left_handed: bool,
    /// Shading normals.
    pub normals: Option<PrimvarView<'a>>,
    /// Texture coordinates.
    pub uv: Option<PrimvarView<'a>>,
    /// The number by which the texture coordinates are looked up as a primvar.
    pub uv_number: Option<usize>,
    /// Primvars that are looked up by number; those that the mesh lacks are `None`.
    pub primvars: Vec<Option<NamedPrimvar<'a>>>,
    /// Faces with slots of their own: prim path of the subset and face indices.
    pub subsets: &'a [(&'a str, &'a [i32])],
    /// Makes the mesh the control mesh of a subdivision surface.
    pub subdivision: Option<Subdivision<'a>>,
}

impl<'a> PolygonMesh<'a> {
    /// Points and faces with nothing else to them, counter-clockwise seen from outside.
    pub fn bare(path: &'a str, points: Buffer<[f32; 3]>, counts: &'a [i32], indices: Buffer<i32>) -> Self {
        Self {
            path,
            points,
            counts,
            indices,
            holes: &[],
            left_handed: false,
            normals: None,
            uv: None,
            uv_number: None,
            primvars: Vec::new(),
            subsets: &[],
            subdivision: None,
        }
    }

    /// An error at one of the mesh's attributes.
    fn error(&self, attribute: &str, problem: impl Into<String>) -> Error {
        Error::scene(format!("{}.{attribute}", self.path), problem)
    }

    /// Checks points and topology; everything after may index without fear.
    pub(super) fn check(&self) -> Result<()> {
        // Corners and points are counted in 31 bits.
        for (name, len) in [("points", self.points.len()), ("faceVertexIndices", self.indices.len())] {
            if len >= 1 << 31 {
                return Err(self.error(name, format!("{len} elements are more than 2147483647; split the mesh")));
            }
        }
        if let Some(i) = not_finite(self.points.as_flattened()).map(|i| i / 3) {
            return Err(self.error("points", format!("point {i} is not finite; correct or remove it")));
        }
        if let Some(i) = self.counts.iter().position(|&n| n < 0) {
            return Err(self.error("faceVertexCounts", format!("face {i} has {} corners", self.counts[i])));
        }
        let corners: u64 = self.counts.iter().map(|&n| n as u64).sum();
        if corners != self.indices.len() as u64 {
            return Err(self.error(
                "faceVertexCounts",
                format!(
                    "counts add up to {corners}, but faceVertexIndices has {}; they must agree",
                    self.indices.len()
                ),
            ));
        }
        let points = self.points.len();
        if let Some(i) = out_of_range(&self.indices, points) {
            return Err(self.error(
                "faceVertexIndices",
                format!("index {i} is {}, but there are {points} points", self.indices[i]),
            ));
        }
        let faces = self.counts.len();
        if let Some(i) = out_of_range(self.holes, faces) {
            return Err(
                self.error("holeIndices", format!("index {i} is {}, but there are {faces} faces", self.holes[i]))
            );
        }
        for (path, subset) in self.subsets {
            if let Some(i) = out_of_range(subset, faces) {
                let problem = format!("index {i} is {}, but {} has {faces} faces", subset[i], self.path);
                return Err(Error::scene(format!("{path}.indices"), problem));
            }
        }
        if self.subsets.len() > usize::from(u16::MAX) {
            return Err(
                self.error("subsets", format!("{} subsets are more than 65535; merge some", self.subsets.len()))
            );
        }
        Ok(())
    }

    /// The mesh without primvars that do not fit; they are named in `problems`.
    pub(super) fn with_usable_primvars(&self, problems: &mut Vec<MeshProblem>) -> Self {
        let mut mesh = self.clone();
        for (name, primvar, width) in [("normals", &mut mesh.normals, 3), ("primvars:st", &mut mesh.uv, 2)] {
            if let Some((attribute, problem)) = primvar.as_ref().and_then(|p| self.primvar_problem(name, p, width)) {
                problems.push(MeshProblem { attribute, problem: format!("{problem}; it is left out") });
                *primvar = None;
            }
        }
        for primvar in &mut mesh.primvars {
            let Some(NamedPrimvar { name, columns, view }) = primvar else { continue };
            if let Some((attribute, problem)) = self.primvar_problem(&format!("primvars:{name}"), view, *columns) {
                problems.push(MeshProblem { attribute, problem: format!("{problem}; it is left out") });
                *primvar = None;
            }
        }
        mesh
    }

    /// What is wrong with a primvar of `width` floats a value: the attribute and the problem.
    fn primvar_problem(&self, name: &str, primvar: &PrimvarView<'_>, width: usize) -> Option<(String, String)> {
        let values = primvar.values.len() / width;
        if !primvar.values.len().is_multiple_of(width) {
            return Some((name.to_owned(), format!("{} floats are not a multiple of {width}", primvar.values.len())));
        }
        if let Some(i) = not_finite(&primvar.values) {
            return Some((name.to_owned(), format!("value {} is not finite; correct or remove it", i / width)));
        }
        let elements = match primvar.interpolation {
            Interpolation::Constant => 1,
            Interpolation::Uniform => self.counts.len(),
            Interpolation::Varying | Interpolation::Vertex => self.points.len(),
            Interpolation::FaceVarying => self.indices.len(),
        };
        let given = primvar.indices.map_or(values, <[i32]>::len);
        if given != elements {
            let element = primvar.interpolation.element();
            let problem =
                format!("{given} values for one per {element}, which makes {elements}; author the missing ones");
            return Some((name.to_owned(), problem));
        }
        if let Some(indices) = primvar.indices
            && let Some(i) = out_of_range(indices, values)
        {
            let problem = format!("index {i} is {}, but there are {values} values", indices[i]);
            return Some((format!("{name}:indices"), problem));
        }
        None
    }

    /// Which faces are not holes and have at least three corners, with their first corner and their number of corners.
    pub(super) fn faces(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let holes = self.hole_flags();
        self.faces_of(0..self.counts.len(), 0).filter(move |&(face, ..)| !is_hole(&holes, face))
    }

    /// Whether each face is a hole; empty where none is.
    pub(super) fn hole_flags(&self) -> Vec<bool> {
        let mut holes = vec![false; if self.holes.is_empty() { 0 } else { self.counts.len() }];
        for &hole in self.holes {
            holes[hole as usize] = true;
        }
        holes
    }

    /// The faces in pieces of work, at least one.
    pub(super) fn pieces(&self) -> Vec<Piece> {
        const FACES: usize = 1 << 15;
        let mut next = 0;
        let piece = |(number, counts): (usize, &[i32])| {
            let (first, begin) = (next, number * FACES);
            next += counts.iter().map(|&count| count as usize).sum::<usize>();
            Piece { faces: begin..begin + counts.len(), first }
        };
        let pieces: Vec<_> = self.counts.chunks(FACES).enumerate().map(piece).collect();
        if pieces.is_empty() { vec![Piece { faces: 0..0, first: 0 }] } else { pieces }
    }

    /// Faces of at least three corners in a range whose first corner is `next`.
    fn faces_of(&self, faces: Range<usize>, mut next: usize) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        self.counts[faces.clone()].iter().zip(faces).filter_map(move |(&count, face)| {
            let first = next;
            next += count as usize;
            (count >= 3).then_some((face, first, count as usize))
        })
    }

    /// The point at a corner.
    pub(super) fn point(&self, corner: usize) -> DVec3 {
        let [x, y, z] = self.points[self.indices[corner] as usize];
        DVec3::new(x.into(), y.into(), z.into())
    }

    /// Calls `emit` with every triangle of a piece: its face and its corners (positions in `indices`), counter-clockwise seen
    /// from outside whatever the authored orientation. `holes` are [`hole_flags`](Self::hole_flags).
    pub(super) fn triangulate(&self, piece: &Piece, holes: &[bool], mut emit: impl FnMut(usize, [usize; 3])) {
        let mut cutter = Cutter::default();
        for (face, first, count) in self.faces_of(piece.faces.clone(), piece.first) {
            if is_hole(holes, face) {
                continue;
            }
            let mut put = |a: usize, b: usize, c: usize| {
                let corners = if self.left_handed {
                    [first + a, first + c, first + b]
                } else {
                    [first + a, first + b, first + c]
                };
                emit(face, corners);
            };
            if count == 3 {
                put(0, 1, 2);
                continue;
            }
            cutter.outline.clear();
            cutter.outline.extend((first..first + count).map(|corner| self.point(corner)));
            if cutter.is_convex() {
                for k in 1..count - 1 {
                    put(0, k, k + 1);
                }
            } else {
                cutter.cut();
                for t in cutter.triangles.chunks_exact(3) {
                    put(t[0] as usize, t[1] as usize, t[2] as usize);
                }
            }
        }
    }
}

/// Faces that are cut by one thread.
pub(super) struct Piece {
    pub(super) faces: Range<usize>,
    /// First corner of the first face.
    first: usize,
}

fn is_hole(holes: &[bool], face: usize) -> bool {
    holes.get(face).is_some_and(|&hole| hole)
}

/// What is looked through at once before anything in it is looked for: a maximum is taken of many elements at a time.
const BLOCK: usize = 1 << 10;

/// The first index that is negative or not below `len`.
fn out_of_range(indices: &[i32], len: usize) -> Option<usize> {
    // A negative index is above all others as an unsigned one.
    let is_out = |i: u32| i as usize >= len;
    let largest = |block: &[i32]| block.iter().fold(0, |largest, &i| largest.max(i as u32));
    let block = indices.par_chunks(BLOCK).position_first(|block| is_out(largest(block)))?;
    let at = indices[block * BLOCK..].iter().position(|&i| is_out(i as u32));
    at.map(|at| block * BLOCK + at)
}

/// The first number that is not finite.
fn not_finite(numbers: &[f32]) -> Option<usize> {
    // Without their signs, infinities and what is no number are above all others.
    let magnitude = |x: f32| x.to_bits() & 0x7fff_ffff;
    let largest = |block: &[f32]| block.iter().fold(0, |largest, &x| largest.max(magnitude(x)));
    let block = numbers.par_chunks(BLOCK).position_first(|block| largest(block) >= f32::INFINITY.to_bits())?;
    numbers[block * BLOCK..].iter().position(|x| !x.is_finite()).map(|at| block * BLOCK + at)
}

/// Cuts one polygon after the other; keeps its memory.
#[derive(Default)]
struct Cutter {
    outline: Vec<DVec3>,
    triangles: Vec<u32>,
    earcut: Earcut<f64>,
}

impl Cutter {
    /// Twice the vector area (Newell 1972), relative to the first corner so that far polygons keep their digits.
    fn newell(&self) -> DVec3 {
        let first = self.outline[0];
        self.outline.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum()
    }

    /// Whether no corner turns inward and the fan from the first corner does not overlap itself.
    fn is_convex(&self) -> bool {
        let normal = self.newell();
        let n = self.outline.len();
        let p = |i: usize| self.outline[i % n];
        (0..n).all(|i| {
            let turn = (p(i + 1) - p(i)).cross(p(i + 2) - p(i + 1));
            let fan = (p(i) - p(0)).cross(p(i + 1) - p(0));
            turn.dot(normal) >= 0.0 && fan.dot(normal) >= 0.0
        })
    }

    /// Cuts ears on the Newell plane; the triangles wind as the polygon does.
    fn cut(&mut self) {
        let normal = self.newell();
        let size = normal.abs();
        // Dropping the axis nearest to the normal projects without much distortion, and changes no digit.
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        self.earcut.earcut(self.outline.iter().map(|p| [p[x], p[y]]), &[], &mut self.triangles);
        let flat = |i: u32| DVec2::new(self.outline[i as usize][x], self.outline[i as usize][y]);
        for t in self.triangles.chunks_exact_mut(3) {
            let winding = (flat(t[1]) - flat(t[0])).perp_dot(flat(t[2]) - flat(t[0]));
            if winding * normal[z] < 0.0 {
                t.swap(1, 2);
            }
        }
    }
}
