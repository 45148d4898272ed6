//! Triangle meshes: authored points, 32-bit corners, and only the attributes that say something.

use std::time::{Duration, Instant};

use glam::{DVec3, Vec3A};
use rayon::prelude::*;

use super::Buffer;
use super::cut::{Corners, Cut, is_sliver, uncut};
use super::motion::{Between, Deformation, Deformed};
use super::polygons::{NamedPrimvar, PolygonMesh, PrimvarView};
use super::start::{Relation, Start, behind, relation};
use super::subdivision::{Refined, Refiner};
use super::topology;
use super::tree::{Bounds, Tree};
use super::triangle::{Corner, ShearedRay, TriangleHit};
use crate::Result;

/// Normals that differ from the facet's by less are the facet's, computed by an exporter in f32: sixteen of its steps.
const FLAT: f64 = 16.0 / 16_777_216.0;
/// Of so few triangles a ray asks every one: that takes no longer than to get ready for the tree.
const FEW: usize = 4;
/// Sine of an angle between a ray and a plane that no rounding turns round.
const GRAZING: f64 = 1e-9;

/// Triangles over authored points, with the tree over them.
#[derive(Debug)]
pub struct Mesh {
    points: Buffer<[f32; 3]>,
    /// Where the points are at other times.
    deformation: Option<Deformation>,
    /// Points of each triangle, counter-clockwise seen from outside.
    triangles: Buffer<[u32; 3]>,
    normals: Option<CornerValues>,
    normals_reversed: bool,
    uv: Option<CornerValues>,
    uv_number: Option<usize>,
    /// By the number that they are looked up by, with the floats in a value.
    primvars: Vec<Option<(usize, CornerValues)>>,
    slots: Option<Vec<u16>>,
    tree: Tree,
    bounds: Bounds,
    /// The normal of all triangles, if they are few, lie in one plane and face the same way.
    sheet: Option<DVec3>,
}

/// What was found when a mesh was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Triangles that rays can meet.
    pub triangles: usize,
    /// Triangles without area (relative 1e-12), left out.
    pub degenerate: usize,
    /// Faces with fewer than three corners, left out.
    pub short_faces: usize,
    /// Time taken by the tree.
    pub tree_time: Duration,
    /// Edges (by position) at which an odd number of faces meet; this and the next two only if asked for.
    pub open_edges: usize,
    /// Edges whose faces do not run against each other, as those of a consistent orientation do.
    pub misoriented_edges: usize,
    /// Every edge is passed equally often both ways: the mesh has an inside.
    pub is_closed: bool,
    /// Faces in more than one subset; the first subset has them.
    pub faces_in_several_subsets: usize,
    /// The authored normals point against the faces on most of the mesh; they are used reversed.
    pub normals_reversed: bool,
    /// What was authored and could not be used.
    pub problems: Vec<MeshProblem>,
}

/// An attribute that could not be used; the mesh is made without it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshProblem {
    /// Name of the attribute.
    pub attribute: String,
    /// What is wrong.
    pub problem: String,
}

/// A value at each corner of each triangle.
#[derive(Debug)]
struct CornerValues {
    values: Buffer<f32>,
    /// Values of each triangle's corners; absent where a point and its value have the same index.
    indices: Option<Vec<[u32; 3]>>,
}

impl CornerValues {
    fn at<const N: usize>(&self, triangle: [u32; 3], primitive: u32) -> [[f32; N]; 3] {
        self.among(&self.values, triangle, primitive)
    }

    /// The same of other values in the same order.
    fn among<const N: usize>(&self, values: &[f32], triangle: [u32; 3], primitive: u32) -> [[f32; N]; 3] {
        self.corners(triangle, primitive).map(|i| {
            let first = i as usize * N;
            std::array::from_fn(|k| values[first + k])
        })
    }

    /// Values of `columns` floats, up to four; the others are 0.
    fn padded(&self, columns: usize, triangle: [u32; 3], primitive: u32) -> [[f32; 4]; 3] {
        self.corners(triangle, primitive).map(|i| {
            let mut value = [0.0; 4];
            value[..columns].copy_from_slice(&self.values[i as usize * columns..][..columns]);
            value
        })
    }

    fn corners(&self, triangle: [u32; 3], primitive: u32) -> [u32; 3] {
        self.indices.as_ref().map_or(triangle, |indices| indices[primitive as usize])
    }
}

/// What stands at the corners of the triangles beside their points.
struct Values {
    slots: Option<Vec<u16>>,
    normals: Corners,
    uv: Corners,
    primvars: Vec<Corners>,
}

impl Values {
    /// As the points have it, for so many primvars.
    fn by_point(primvars: usize) -> Self {
        Self { slots: None, normals: None, uv: None, primvars: vec![None; primvars] }
    }
}

/// The box of all triangles; `None` if one has no area.
fn all_with_area(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Option<Bounds> {
    triangles
        .par_iter()
        .map(|corners| {
            let corners = corners.map(|p| points[p as usize]);
            (!is_sliver(corners.map(widen))).then(|| bounds_of(corners))
        })
        .try_reduce(|| Bounds::EMPTY, |a, b| Some(a.union(&b)))
}

/// A candidate of a mesh, decided.
pub(super) struct MeshHit {
    pub(super) primitive: u32,
    pub(super) distance: f64,
    pub(super) barycentric: [f64; 2],
    pub(super) leaving: bool,
    pub(super) at_start: bool,
}

impl Mesh {
    /// Checks the arrays, refines a subdivision surface, cuts the polygons into triangles and builds the tree.
    ///
    /// Errors begin with the prim path and the attribute. What is only odd (faces of two corners, triangles without area,
    /// overlapping subsets, primvars of the wrong size) is left out and stands in the report.
    pub fn from_polygons(polygons: &PolygonMesh<'_>) -> Result<(Self, MeshReport)> {
        Self::deforming(polygons, None, true)
    }

    /// The same with points that move as the checked `deformation` has them, which is as long as they are. Whether the mesh is
    /// closed is only found out if `asks_closed`: no surface needs it but that of a medium.
    pub(crate) fn deforming(
        polygons: &PolygonMesh<'_>,
        deformation: Option<Deformation>,
        asks_closed: bool,
    ) -> Result<(Self, MeshReport)> {
        polygons.check()?;
        let mut report =
            MeshReport { short_faces: polygons.counts.iter().filter(|&&n| n < 3).count(), ..MeshReport::default() };
        let polygons = &polygons.with_usable_primvars(&mut report.problems);
        let face_slots = face_slots(polygons, &mut report);
        let Some(refiner) = refiner(polygons, &mut report) else {
            let deformation =
                deformation.map(|d| Deformation { normals: d.normals.filter(|_| polygons.normals.is_some()), ..d });
            let control = asks_closed.then_some(polygons);
            return Ok(Self::assemble(polygons, deformation, face_slots.as_deref(), control, report));
        };
        let holes = refiner.holes();
        let control = PolygonMesh { holes: &holes, ..polygons.clone() };
        let deformation = deformation.map(|deformation| refiner.deformation(&deformation));
        let refined = Refined::new(&refiner, polygons);
        drop(refiner);
        let face_slots = face_slots.map(|slots| refined.of_faces(&slots));
        let control = asks_closed.then_some(&control);
        Ok(Self::assemble(&refined.polygons(polygons), deformation, face_slots.as_deref(), control, report))
    }

    /// Triangles of checked polygons. Whether the mesh has an inside is decided by `control`, if there is one.
    fn assemble(
        polygons: &PolygonMesh<'_>,
        deformation: Option<Deformation>,
        face_slots: Option<&[u16]>,
        control: Option<&PolygonMesh<'_>>,
        mut report: MeshReport,
    ) -> (Self, MeshReport) {
        let points = polygons.points.clone();
        // The first pass over the triangles is the tree's; it finds out whether they can stay as they are.
        let begin = Instant::now();
        let authored = match (&deformation, face_slots) {
            (None, None) => uncut(polygons).and_then(|t| Some((all_with_area(&points, &t)?, t))),
            _ => None,
        };
        report.tree_time = begin.elapsed();
        let (triangles, all, Values { slots, normals, uv, primvars }) = match authored {
            Some((all, triangles)) => (triangles, Some(all), Values::by_point(polygons.primvars.len())),
            None => {
                let Cut { triangles, slots, normals, uv, primvars, degenerate } =
                    Cut::new(polygons, deformation.as_ref(), face_slots);
                report.degenerate = degenerate;
                (Buffer::from_vec(triangles), None, Values { slots, normals, uv, primvars })
            }
        };
        report.triangles = triangles.len();
        if let Some(control) = control {
            let imbalance = topology::imbalance(control);
            report.open_edges = imbalance.open;
            report.misoriented_edges = imbalance.misoriented;
            report.is_closed = imbalance == topology::Imbalance::default() && !triangles.is_empty();
        }

        let corners = triangles.as_slice();
        let bounds_of = |i: usize| {
            let at = |points: &[[f32; 3]]| bounds_of(corners[i].map(|p| points[p as usize]));
            let moved = deformation.iter().flat_map(|d| &d.points);
            moved.fold(at(&points), |all, points| all.union(&at(points)))
        };
        let begin = Instant::now();
        let tree = match all {
            Some(all) => Tree::within(&all, corners.len(), bounds_of),
            None => Tree::build(corners.len(), bounds_of),
        };
        report.tree_time += begin.elapsed();
        let bounds = tree.extent();
        let values = |primvar: &Option<PrimvarView<'_>>, indices| {
            primvar.as_ref().map(|primvar| CornerValues { values: primvar.values.clone(), indices })
        };
        let primvar = |(named, indices): (&Option<NamedPrimvar<'_>>, Corners)| {
            let NamedPrimvar { columns, view, .. } = named.as_ref()?;
            Some((*columns, CornerValues { values: view.values.clone(), indices }))
        };
        let mut mesh = Self {
            points,
            deformation,
            triangles,
            normals: values(&polygons.normals, normals),
            normals_reversed: false,
            uv: values(&polygons.uv, uv),
            uv_number: polygons.uv_number,
            primvars: polygons.primvars.iter().zip(primvars).map(primvar).collect(),
            slots,
            tree,
            bounds,
            sheet: None,
        };
        mesh.sheet = mesh.find_sheet();
        mesh.settle_normals();
        report.normals_reversed = mesh.normals_reversed;
        (mesh, report)
    }

    /// How many triangles rays can meet.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether no ray can meet the mesh.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Whether shading normals are used: some authored normal differs from its facet's.
    pub fn has_normals(&self) -> bool {
        self.normals.is_some()
    }

    /// Whether texture coordinates are authored.
    pub fn has_uv(&self) -> bool {
        self.uv.is_some()
    }

    /// The slot of a triangle: 0 for faces in no subset, k + 1 for the k-th subset.
    pub fn slot(&self, primitive: u32) -> u32 {
        self.slots.as_ref().map_or(0, |slots| slots[primitive as usize].into())
    }

    /// Lower and upper bounds in object space; `None` if the mesh is empty.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        (!self.is_empty()).then_some([self.bounds.min, self.bounds.max])
    }

    /// Whether points move.
    pub fn is_deforming(&self) -> bool {
        self.deformation.is_some()
    }

    /// The moved points at a time; `None` where the mesh has its own.
    #[inline]
    fn deformed(&self, time: f64) -> Option<Deformed<'_>> {
        if time == 0.0 { None } else { self.deformation.as_ref().map(|deformation| deformation.at(time)) }
    }

    /// Largest coordinate of a triangle.
    pub(super) fn reach(&self, primitive: u32, time: f64) -> f64 {
        match self.deformed(time) {
            None => {
                let [a, b, c] = self.corners_f32(primitive).map(|p| Vec3A::from_array(p).abs());
                a.max(b).max(c).max_element().into()
            }
            Some(_) => self.corners(primitive, time).iter().map(|p| p.abs().max_element()).fold(0.0, f64::max),
        }
    }

    #[inline]
    pub(crate) fn corners(&self, primitive: u32, time: f64) -> [DVec3; 3] {
        match self.deformed(time) {
            None => self.corners_f32(primitive).map(widen),
            Some(deformed) => self.triangles[primitive as usize].map(|p| deformed.point(p).into()),
        }
    }

    /// Texture coordinates at a point of a triangle.
    pub(super) fn uv(&self, primitive: u32, barycentric: [f64; 2]) -> Option<[f64; 2]> {
        let [a, b, c] = self.uv.as_ref()?.at::<2>(self.triangles[primitive as usize], primitive);
        Some(std::array::from_fn(|k| {
            let [a, b, c] = [a[k], b[k], c[k]].map(f64::from);
            a + barycentric[0] * (b - a) + barycentric[1] * (c - a)
        }))
    }

    /// How the point of a triangle, whose `edges` go out from its first corner, moves with each texture coordinate: ∂p/∂u and ∂p/∂v.
    /// `None` without coordinates, or where they do not tell the points of the triangle apart.
    pub(super) fn tangents(&self, primitive: u32, edges: [DVec3; 2]) -> Option<[DVec3; 2]> {
        let corners = self.uv.as_ref()?.at::<2>(self.triangles[primitive as usize], primitive);
        let [a, b, c] = corners.map(|uv| uv.map(f64::from));
        let [du1, dv1, du2, dv2] = [b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]];
        // e₁ = du₁ p_u + dv₁ p_v and e₂ = du₂ p_u + dv₂ p_v, solved for p_u and p_v.
        let determinant = du1 * dv2 - du2 * dv1;
        let [e1, e2] = edges;
        let tangents = [(e1 * dv2 - e2 * dv1) / determinant, (e2 * du1 - e1 * du2) / determinant];
        tangents.iter().all(|t| t.is_finite() && *t != DVec3::ZERO).then_some(tangents)
    }

    /// The value at a point of a triangle of the primvar with a number, missing components 0; `None` if there is none.
    pub(super) fn primvar(&self, number: usize, primitive: u32, barycentric: [f64; 2]) -> Option<[f32; 4]> {
        let (columns, values) = match self.uv_number == Some(number) {
            true => (2, self.uv.as_ref()?),
            false => self.primvars.get(number)?.as_ref().map(|(columns, values)| (*columns, values))?,
        };
        let [a, b, c] = values.padded(columns, self.triangles[primitive as usize], primitive);
        Some(std::array::from_fn(|k| {
            let [a, b, c] = [a[k], b[k], c[k]].map(f64::from);
            (a + barycentric[0] * (b - a) + barycentric[1] * (c - a)) as f32
        }))
    }

    /// Authored normals at the corners of a triangle, on the side of the faces.
    pub(super) fn normals(&self, primitive: u32, time: f64) -> Option<[DVec3; 3]> {
        let authored = self.normals.as_ref()?;
        let triangle = self.triangles[primitive as usize];
        let normals = match &self.deformation {
            Some(Deformation { times, normals: Some(samples), .. }) if time != 0.0 => {
                let between = Between::find(times, time);
                let [a, b] =
                    [between.first, between.second].map(|i| authored.among::<3>(&samples[i], triangle, primitive));
                std::array::from_fn(|corner| between.mix_points(widen(a[corner]), widen(b[corner])))
            }
            _ => authored.at::<3>(triangle, primitive).map(widen),
        };
        let sign = if self.normals_reversed { -1.0 } else { 1.0 };
        Some(normals.map(|n| n * sign))
    }

    /// Whether the box of any triangle meets `search`, in object space.
    pub(super) fn may_meet(&self, search: &Bounds) -> bool {
        self.tree.any_meeting(search, |_| true)
    }

    /// Calls `found` with every crossing of the ray that is met before the limit, which `found` returns anew each time.
    /// All in object space; `start` is absent for rays that start in the open.
    pub(super) fn walk(
        &self,
        origin: DVec3,
        direction: DVec3,
        time: f64,
        start: Option<&Start<'_, impl Fn() -> f64>>,
        limit: f64,
        found: impl FnMut(MeshHit) -> f64,
    ) {
        let from = (origin, direction, time);
        match self.deformed(time) {
            None => {
                let points = self.points.as_slice();
                self.walk_points(from, start, limit, |p| &points[p as usize], found);
            }
            Some(deformed) => self.walk_points(from, start, limit, |p| deformed.point(p), found),
        }
    }

    #[inline(always)]
    fn walk_points<C: Corner>(
        &self,
        (origin, direction, time): (DVec3, DVec3, f64),
        start: Option<&Start<'_, impl Fn() -> f64>>,
        limit: f64,
        point: impl Fn(u32) -> C,
        mut found: impl FnMut(MeshHit) -> f64,
    ) {
        let sheared = ShearedRay::new(origin, direction);
        let triangles = self.triangles.as_slice();
        let left = start.and_then(Start::left);
        let mut meet = |primitive: u32, limit: f64| {
            if left == Some(primitive) {
                return limit;
            }
            let corners = triangles[primitive as usize].map(&point);
            self.meet(&sheared, (origin, direction, time), start, primitive, corners).map_or(limit, &mut found)
        };
        if triangles.len() <= FEW {
            (0..triangles.len() as u32).fold(limit, |limit, primitive| meet(primitive, limit));
            return;
        }
        let from = start.map_or(0.0, |start| -behind(start.at_most));
        self.tree.walk(origin, direction, from, limit, 1.0, meet);
    }

    /// The crossing of a triangle that does not deform and was not the last that the ray has left.
    pub(super) fn meet_one(
        &self,
        origin: DVec3,
        direction: DVec3,
        start: Option<&Start<'_, impl Fn() -> f64>>,
        primitive: u32,
    ) -> Option<MeshHit> {
        let points = self.points.as_slice();
        let corners = self.triangles[primitive as usize].map(|p| &points[p as usize]);
        self.meet(&ShearedRay::new(origin, direction), (origin, direction, 0.0), start, primitive, corners)
    }

    #[inline(always)]
    fn meet<C: Corner>(
        &self,
        sheared: &ShearedRay,
        (origin, direction, time): (DVec3, DVec3, f64),
        start: Option<&Start<'_, impl Fn() -> f64>>,
        primitive: u32,
        corners: [C; 3],
    ) -> Option<MeshHit> {
        let hit = sheared.intersect(corners)?;
        let (distance, at_start) = match start {
            None if hit.distance > 0.0 => (hit.distance, false),
            None => return None,
            Some(start) => {
                let relative = corners.map(|p| p.wide() - origin);
                let relative_of = |primitive| self.corners(primitive, time).map(|p| p - origin);
                let met = start.triangle(primitive, &hit, direction, relative, relative_of)?;
                (met.distance, met.at_start)
            }
        };
        let TriangleHit { barycentric, leaving, .. } = hit;
        Some(MeshHit { primitive, distance, barycentric, leaving, at_start })
    }

    /// Calls `found` with every crossing at a distance > 0, asking every triangle.
    pub(super) fn every_crossing(&self, origin: DVec3, direction: DVec3, time: f64, mut found: impl FnMut(MeshHit)) {
        let sheared = ShearedRay::new(origin, direction);
        for primitive in 0..self.triangles.len() as u32 {
            if let Some(TriangleHit { distance, barycentric, leaving }) =
                sheared.intersect(self.corners(primitive, time).map(|p| p.to_array()))
                && distance > 0.0
            {
                found(MeshHit { primitive, distance, barycentric, leaving, at_start: false });
            }
        }
    }

    #[inline]
    fn corners_f32(&self, primitive: u32) -> [[f32; 3]; 3] {
        let points = self.points.as_slice();
        self.triangles[primitive as usize].map(|p| points[p as usize])
    }

    fn find_sheet(&self) -> Option<DVec3> {
        if self.deformation.is_some() || self.is_empty() || self.len() > FEW {
            return None;
        }
        let corners = |primitive: usize| self.corners(primitive as u32, 0.0);
        let is_sheet = |(i, j): (usize, usize)| {
            [true, false].into_iter().all(|outward| relation(corners(i), corners(j), outward) == Relation::SameSheet)
        };
        let [a, b, c] = corners(0);
        let pairs = (0..self.len()).flat_map(|i| (0..self.len()).map(move |j| (i, j)));
        pairs.filter(|(i, j)| i != j).all(is_sheet).then(|| (b - a).cross(c - a).normalize())
    }

    /// Whether a ray that has left a triangle on this side, whatever else it stands on, cannot meet the mesh: it is one sheet, and
    /// the ray runs away from it, beyond doubt.
    pub(super) fn is_behind(&self, outward: bool, direction: DVec3) -> bool {
        self.sheet.is_some_and(|normal| {
            let rise = normal.dot(direction);
            if outward { rise > GRAZING } else { rise < -GRAZING }
        })
    }

    /// Drops normals that say nothing, and finds out which way the others point.
    fn settle_normals(&mut self) {
        if self.normals.is_none() {
            return;
        }
        let (flat, against) = (0..self.triangles.len() as u32)
            .into_par_iter()
            .map(|primitive| {
                let [a, b, c] = self.corners(primitive, 0.0);
                let n_g = (b - a).cross(c - a).normalize();
                let normals = self.normals(primitive, 0.0).expect("there are normals");
                let flat = normals.iter().all(|n| (n.normalize_or_zero() - n_g).length() <= FLAT);
                let against = normals.iter().sum::<DVec3>().dot(n_g) < 0.0;
                (flat, usize::from(against))
            })
            .reduce(|| (true, 0), |x, y| (x.0 && y.0, x.1 + y.1));
        // Normals that move say something as soon as the mesh bends.
        let moves = self.deformation.as_ref().is_some_and(|deformation| deformation.normals.is_some());
        if flat && !moves {
            self.normals = None;
        }
        self.normals_reversed = against * 2 > self.triangles.len();
    }
}

/// The refined topology of a subdivision surface; `None` for polygons and for what cannot be refined.
fn refiner(polygons: &PolygonMesh<'_>, report: &mut MeshReport) -> Option<Refiner> {
    let subdivision = polygons.subdivision.as_ref().filter(|subdivision| subdivision.level > 0)?;
    let mut problems = Vec::new();
    let refiner = Refiner::new(polygons, subdivision, &mut problems);
    let as_problem = |problem| MeshProblem { attribute: "subdivisionScheme".to_owned(), problem };
    report.problems.extend(problems.into_iter().map(as_problem));
    refiner
}

/// The slot of each face; `None` without subsets. A face in two subsets belongs to the first.
fn face_slots(polygons: &PolygonMesh<'_>, report: &mut MeshReport) -> Option<Vec<u16>> {
    if polygons.subsets.is_empty() {
        return None;
    }
    let mut slots = vec![0; polygons.counts.len()];
    let mut several = vec![false; slots.len()];
    for (slot, (_, faces)) in (1..).zip(polygons.subsets) {
        for &face in *faces {
            let face = face as usize;
            match slots[face] {
                0 => slots[face] = slot,
                taken => several[face] |= taken != slot,
            }
        }
    }
    report.faces_in_several_subsets = several.into_iter().filter(|&s| s).count();
    Some(slots)
}

fn bounds_of(corners: [[f32; 3]; 3]) -> Bounds {
    let [a, b, c] = corners.map(widen);
    Bounds { min: a.min(b).min(c), max: a.max(b).max(c) }
}

fn widen([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}
