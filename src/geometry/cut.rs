//! Polygons cut into triangles by several threads; the order is that of the faces, however many there are.

use glam::DVec3;
use rayon::prelude::*;

use super::Buffer;
use super::motion::Deformation;
use super::polygons::{Interpolation, Piece, PolygonMesh, PrimvarView};

/// A triangle whose area is below this share of its longest edge squared is a line to the digits of its points.
const SLIVER: f64 = 1e-12;

/// What a mesh keeps of its polygons.
pub(super) struct Cut {
    /// Points of each triangle, counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Slot of each triangle; absent without subsets.
    pub(super) slots: Option<Vec<u16>>,
    /// Which values of the normals, texture coordinates and primvars stand at the corners.
    pub(super) normals: Corners,
    pub(super) uv: Corners,
    pub(super) primvars: Vec<Corners>,
    /// Triangles without area, left out.
    pub(super) degenerate: usize,
}

/// Indices of values at the corners of triangles; absent where they are those of the points, or where there are no values.
pub(super) type Corners = Option<Vec<[u32; 3]>>;

impl Cut {
    /// Cuts checked polygons. What has no area at any time is left out.
    pub(super) fn new(
        polygons: &PolygonMesh<'_>,
        deformation: Option<&Deformation>,
        face_slots: Option<&[u16]>,
    ) -> Self {
        let holes = polygons.hole_flags();
        let one = |piece: &Piece| Self::of_piece(polygons, piece, &holes, deformation, face_slots);
        let pieces = polygons.pieces();
        let (first, others) = pieces.split_first().expect("there is a piece, if an empty one");
        let others: Vec<Self> = others.par_iter().map(one).collect();
        let mut all = one(first);
        all.triangles.reserve_exact(others.iter().map(|cut| cut.triangles.len()).sum());
        others.into_iter().for_each(|cut| all.append(cut));
        all
    }

    fn of_piece(
        polygons: &PolygonMesh<'_>,
        piece: &Piece,
        holes: &[bool],
        deformation: Option<&Deformation>,
        face_slots: Option<&[u16]>,
    ) -> Self {
        let primvars = polygons.primvars.iter().map(|named| named.as_ref().map(|named| &named.view));
        let mut normals = Collector::new(polygons.normals.as_ref());
        let mut uv = Collector::new(polygons.uv.as_ref());
        let mut primvars: Vec<_> = primvars.map(Collector::new).collect();
        let mut triangles = Vec::with_capacity(piece.faces.len());
        let mut slots = face_slots.map(|_| Vec::new());
        let mut degenerate = 0;
        polygons.triangulate(piece, holes, |face, corners| {
            let moved = deformation.iter().flat_map(|d| &d.points);
            let mut points = moved.map(|points| corners.map(|corner| widen(points[polygons.indices[corner] as usize])));
            if is_sliver(corners.map(|corner| polygons.point(corner))) && points.all(is_sliver) {
                degenerate += 1;
                return;
            }
            triangles.push(corners.map(|corner| polygons.indices[corner] as u32));
            if let (Some(slots), Some(face_slots)) = (&mut slots, face_slots) {
                slots.push(face_slots[face]);
            }
            for values in [&mut normals, &mut uv].into_iter().chain(&mut primvars) {
                values.push(face, corners, &polygons.indices);
            }
        });
        let primvars = primvars.into_iter().map(|values| values.indices).collect();
        Self { triangles, slots, normals: normals.indices, uv: uv.indices, primvars, degenerate }
    }

    fn append(&mut self, other: Self) {
        fn join<T>(all: &mut Option<Vec<T>>, other: Option<Vec<T>>) {
            if let (Some(all), Some(mut other)) = (all, other) {
                all.append(&mut other);
            }
        }
        self.triangles.extend_from_slice(&other.triangles);
        join(&mut self.slots, other.slots);
        join(&mut self.normals, other.normals);
        join(&mut self.uv, other.uv);
        for (all, other) in self.primvars.iter_mut().zip(other.primvars) {
            join(all, other);
        }
        self.degenerate += other.degenerate;
    }
}

/// The corners of a mesh that is triangles already, as authored and without a copy, and where nothing but points stands at
/// them; `None` where polygons must be cut. There may be triangles without area among them.
pub(super) fn uncut(polygons: &PolygonMesh<'_>) -> Option<Buffer<[u32; 3]>> {
    let is_by_point = |primvar: Option<&PrimvarView<'_>>| Collector::new(primvar).indices.is_none();
    let is_uncut = !polygons.left_handed
        && polygons.holes.is_empty()
        && is_by_point(polygons.normals.as_ref())
        && is_by_point(polygons.uv.as_ref())
        && polygons.primvars.iter().all(|named| is_by_point(named.as_ref().map(|named| &named.view)))
        && polygons.counts.iter().all(|&count| count == 3);
    // Checked indices are not negative: the same bits.
    if is_uncut { polygons.indices.cast().ok() } else { None }
}

/// Collects which values stand at corners while triangles are made.
struct Collector<'a> {
    primvar: Option<&'a PrimvarView<'a>>,
    /// Absent where points and values have the same index.
    indices: Corners,
}

impl<'a> Collector<'a> {
    fn new(primvar: Option<&'a PrimvarView<'a>>) -> Self {
        let has_own = |primvar: &&PrimvarView<'_>| {
            primvar.indices.is_some()
                || !matches!(primvar.interpolation, Interpolation::Vertex | Interpolation::Varying)
        };
        Self { primvar, indices: primvar.filter(has_own).map(|_| Vec::new()) }
    }

    fn push(&mut self, face: usize, corners: [usize; 3], points: &[i32]) {
        let (Some(primvar), Some(indices)) = (self.primvar, &mut self.indices) else { return };
        indices.push(corners.map(|corner| {
            let element = match primvar.interpolation {
                Interpolation::Constant => 0,
                Interpolation::Uniform => face,
                Interpolation::Varying | Interpolation::Vertex => points[corner] as usize,
                Interpolation::FaceVarying => corner,
            };
            primvar.indices.map_or(element as u32, |indices| indices[element] as u32)
        }));
    }
}

/// Whether a triangle has no area to speak of.
pub(super) fn is_sliver([a, b, c]: [DVec3; 3]) -> bool {
    let (e1, e2, e3) = (b - a, c - a, c - b);
    let longest = e1.length_squared().max(e2.length_squared()).max(e3.length_squared());
    // Squared: points are single precision, so that nothing under- or overflows.
    let bound = 2.0 * SLIVER * longest;
    e1.cross(e2).length_squared() <= bound * bound
}

fn widen([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}
