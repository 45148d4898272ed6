//! All instances of a scene under one tree.

use std::cell::OnceCell;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::departures::Crossing;
use super::fused::{self, Fused, Piece, is_fusible};
use super::meeting::{Nearest, Sides};
use super::mesh::Mesh;
use super::motion::Pose;
use super::placed::{Frame, Placed, bounds_under, is_invertible, largest_reach};
use super::start::{UNIT_ROUNDOFF, behind};
use super::tree::{Bounds, Tree};
use super::{Departures, Hit, Instance, InstanceArray, Location, Numbering, Ray, Shape};
use crate::ray::{LocalSurface, UnitNormals};

/// Everything that rays can meet.
#[derive(Debug)]
pub struct Aggregate {
    singles: Vec<(Arc<Shape>, Standing)>,
    arrays: Vec<InstanceArray>,
    /// Per array, whether anything of it moves.
    is_array_moving: Vec<bool>,
    numbering: Numbering,
    /// The point of the stage's world that is render space's zero.
    origin: DVec3,
    tree: Tree,
    /// What most rays walk instead, where meshes are small.
    pub(super) fused: Option<Fused>,
    /// Which instance each primitive of the tree is, where not all are in it: those without extent are left out.
    instances: Option<Vec<u32>>,
    /// Largest condition and largest translation of all instances.
    spread: f64,
    farthest: f64,
    /// |L||v| + |t| of all points of all instances: the largest.
    reach: f64,
}

/// A single instance.
#[derive(Debug)]
enum Standing {
    Still(Frame),
    Moving(Pose),
}

/// Where an instance is, at all times.
struct Extent {
    bounds: Bounds,
    condition: f64,
    farthest: f64,
    /// |L||v| + |t| at most.
    reach: f64,
}

/// A ray that starts on surfaces, and the size of the numbers that were rounded there, computed once somebody asks.
pub(super) struct Footing<'a> {
    aggregate: &'a Aggregate,
    ray: &'a Ray,
    pub(super) departures: &'a Departures,
    magnitude: OnceCell<f64>,
    /// |p| + the largest reach of all.
    pub(super) at_most: f64,
}

impl<'a> Footing<'a> {
    fn new(aggregate: &'a Aggregate, ray: &'a Ray, departures: &'a Departures) -> Self {
        let at_most = ray.origin.abs().max_element() + aggregate.reach * MORE;
        Self { aggregate, ray, departures, magnitude: OnceCell::new(), at_most }
    }

    /// |p| + reach.
    pub(super) fn magnitude(&self) -> f64 {
        *self
            .magnitude
            .get_or_init(|| self.ray.origin.abs().max_element() + self.aggregate.reach(self.ray, self.departures))
    }
}

/// A moving transform is looked at at its samples and at quarters between them: its condition elsewhere may be this many times
/// larger. An instance is not there at times at which it is worse: it is being flattened.
const UNSEEN_CONDITION: f64 = 4.0;
/// Room for the rounding of a few products.
const MORE: f64 = 1.0 + 1e-9;

impl Aggregate {
    /// Builds the tree over `instances` relative to `origin`, the point of the stage's world that is render space's zero.
    ///
    /// Transforms are finite and not singular; whoever reads them refuses others.
    pub fn build(instances: &[Instance], origin: DVec3) -> Self {
        Self::with_arrays(instances, Vec::new(), origin)
    }

    /// Builds the tree over single instances and arrays of them, numbered as by [`Numbering`].
    ///
    /// Places of an array may be singular: nothing stands there.
    pub fn with_arrays(singles: &[Instance], mut arrays: Vec<InstanceArray>, origin: DVec3) -> Self {
        arrays.retain(|array| !array.is_empty());
        let numbering = Numbering::new(singles.len(), arrays.iter().map(|a| (a.places.len(), a.parts.len())));
        let standing = |pose: &Pose| {
            if pose.is_moving() {
                Standing::Moving(pose.clone())
            } else {
                Standing::Still(Frame::new(pose.frame(), origin))
            }
        };
        let singles = singles.iter().map(|i| (Arc::clone(&i.shape), standing(&i.world_from_object))).collect();
        let is_array_moving = arrays.iter().map(InstanceArray::is_moving).collect();
        let mut all = Self {
            singles,
            arrays,
            is_array_moving,
            numbering,
            origin,
            tree: Tree::default(),
            fused: None,
            instances: None,
            spread: 1.0,
            farthest: 0.0,
            reach: 0.0,
        };
        let count = all.numbering.len();
        let in_tree: Vec<u32> = (0..count).into_par_iter().filter(|&i| all.extent_of(i).is_some()).collect();
        // The largest of some numbers does not depend on their grouping.
        (all.spread, all.farthest, all.reach) = in_tree
            .par_iter()
            .filter_map(|&i| all.extent_of(i).map(|extent| (extent.condition, extent.farthest, extent.reach)))
            .reduce(|| (1.0, 0.0, 0.0), |a, b| (f64::max(a.0, b.0), f64::max(a.1, b.1), f64::max(a.2, b.2)));
        all.instances = (in_tree.len() < count as usize).then_some(in_tree);
        let primitives = all.instances.as_ref().map_or(count as usize, Vec::len);
        all.tree = Tree::build(primitives, |i| {
            all.bounds_of(all.instance(i as u32)).expect("only instances with bounds are in the tree")
        });
        all.fused = all.fuse(primitives as u32);
        all
    }

    /// One tree over the triangles of small meshes and the other instances, of which there are `count` in all.
    fn fuse(&self, count: u32) -> Option<Fused> {
        let reach = self.tree.reach();
        let (mut meshes, mut others) = (Vec::new(), Vec::new());
        for instance in (0..count).map(|i| self.instance(i)) {
            match self.still_mesh(instance).filter(|(mesh, frame)| is_fusible(mesh, frame, reach)) {
                Some((mesh, frame)) => meshes.push((instance, mesh, frame)),
                None if others.len() < fused::OTHERS => others.push((instance, self.bounds_of(instance)?)),
                None => return None,
            }
        }
        Fused::new(&meshes, &others)
    }

    /// The mesh that stands still as a single instance; `None` if it is something else.
    fn still_mesh(&self, instance: u32) -> Option<(&Mesh, &Frame)> {
        match self.singles.get(instance as usize) {
            Some((shape, Standing::Still(frame))) => match &**shape {
                Shape::Mesh(mesh) => Some((mesh, frame)),
                _ => None,
            },
            _ => None,
        }
    }

    /// The instance that is the primitive `i` of the tree.
    fn instance(&self, i: u32) -> u32 {
        self.instances.as_ref().map_or(i, |instances| instances[i as usize])
    }

    /// Calls `f` with an instance made ready: a single one as it is kept, one of an array or one that moves as it is
    /// computed. `None` if it is not there at that time.
    fn with<R>(&self, instance: u32, time: f64, f: impl FnOnce(Placed<'_>) -> R) -> Option<R> {
        match self.numbering.locate(instance) {
            Location::Single(i) => match &self.singles[i] {
                (shape, Standing::Still(frame)) => Some(f(Placed { shape, frame, time })),
                (shape, Standing::Moving(pose)) => {
                    let frame = &self.moved(&pose.at(time))?;
                    Some(f(Placed { shape, frame, time }))
                }
            },
            Location::InArray { array, place, part } => {
                let is_moving = self.is_array_moving[array];
                let array = &self.arrays[array];
                let transform = array.world_from_object(place, part, time);
                let frame = if is_moving { self.moved(&transform)? } else { Frame::new(&transform, self.origin) };
                Some(f(Placed { shape: &array.parts[part].shape, frame: &frame, time }))
            }
        }
    }

    /// What moves, at a time; `None` where it is flattened then.
    fn moved(&self, transform: &DAffine3) -> Option<Frame> {
        is_invertible(transform)
            .then(|| Frame::new(transform, self.origin))
            .filter(|frame| frame.condition() <= self.spread)
    }

    fn shape(&self, instance: u32) -> &Shape {
        match self.numbering.locate(instance) {
            Location::Single(i) => &self.singles[i].0,
            Location::InArray { array, part, .. } => &self.arrays[array].parts[part].shape,
        }
    }

    /// Where an instance is in render space; `None` where it has no extent or its place is singular.
    fn extent_of(&self, instance: u32) -> Option<Extent> {
        let shape = self.shape(instance);
        let still = |frame: &Frame| {
            Some(Extent {
                bounds: Placed { shape, frame, time: 0.0 }.bounds()?,
                condition: frame.condition(),
                farthest: frame.translation.abs().max_element(),
                reach: Placed { shape, frame, time: 0.0 }.largest_reach(),
            })
        };
        match self.numbering.locate(instance) {
            Location::Single(i) => match &self.singles[i].1 {
                Standing::Still(frame) => still(frame),
                Standing::Moving(pose) => {
                    let hull = pose.times().iter().map(|&t| pose.limit(t));
                    self.moving_extent(shape, pose.times(), |t| pose.at(t), hull)
                }
            },
            Location::InArray { array: index, place, part } => {
                let array = &self.arrays[index];
                if !self.is_array_moving[index] {
                    let transform = array.world_from_object(place, part, 0.0);
                    return is_invertible(&transform)
                        .then(|| Frame::new(&transform, self.origin))
                        .as_ref()
                        .and_then(still);
                }
                let times = array.times(part);
                let spans = times.first().map(|&t| [t, t]).into_iter().chain(times.windows(2).map(|w| [w[0], w[1]]));
                let hull = spans.flat_map(|span| array.corners(place, part, span));
                self.moving_extent(shape, &times, |t| array.world_from_object(place, part, t), hull)
            }
        }
    }

    /// Where something is that runs through `at`, bends at `times`, and stays within the convex hull of `hull`, or is where
    /// it is at time 0. `None` if it is flat at all times that are looked at.
    fn moving_extent(
        &self,
        shape: &Shape,
        times: &[f64],
        at: impl Fn(f64) -> DAffine3,
        hull: impl Iterator<Item = DAffine3>,
    ) -> Option<Extent> {
        let quarters = times.windows(2).flat_map(|w| [0.25, 0.5, 0.75].map(|s| w[0] + s * (w[1] - w[0])));
        let seen = times.iter().copied().chain(quarters).chain([0.0]);
        let condition = seen
            .map(&at)
            .filter(is_invertible)
            .map(|transform| Frame::new(&transform, self.origin).condition())
            .reduce(f64::max)?
            * UNSEEN_CONDITION;
        let mut extent: Option<Extent> = None;
        // What is not finite is nowhere, and neither is what is between it and others.
        for mut transform in hull.chain([at(0.0)]).filter(DAffine3::is_finite) {
            // What is between two places is rounded where it is in the world.
            let rounding = 8.0 * UNIT_ROUNDOFF * transform.translation.abs();
            transform.translation -= self.origin;
            let Bounds { min, max } = bounds_under(&transform, shape, condition)?;
            let bounds = Bounds { min: min - rounding, max: max + rounding };
            let farthest = transform.translation.abs().max_element();
            let reach = largest_reach(&transform, shape);
            extent = Some(extent.map_or(Extent { bounds, condition, farthest, reach }, |all| Extent {
                bounds: all.bounds.union(&bounds),
                condition,
                farthest: all.farthest.max(farthest),
                reach: all.reach.max(reach),
            }));
        }
        extent.filter(|extent| extent.bounds.reach().is_finite())
    }

    /// Bounds of an instance in render space at all times; `None` where it has no extent.
    fn bounds_of(&self, instance: u32) -> Option<Bounds> {
        Some(self.extent_of(instance)?.bounds)
    }

    /// Lower and upper bounds of an instance in render space at all times; `None` where it has no extent.
    pub fn bounds_of_instance(&self, instance: u32) -> Option<[DVec3; 2]> {
        self.bounds_of(instance).map(|Bounds { min, max }| [min, max])
    }

    /// Whether an instance stands where it is and as it is at all times.
    pub(crate) fn stands_still(&self, instance: u32) -> bool {
        let deforms = matches!(self.shape(instance), Shape::Mesh(mesh) if mesh.is_deforming());
        !deforms && !self.is_instance_moving(instance)
    }

    fn is_instance_moving(&self, instance: u32) -> bool {
        match self.numbering.locate(instance) {
            Location::Single(i) => matches!(self.singles[i].1, Standing::Moving(_)),
            Location::InArray { array, .. } => self.is_array_moving[array],
        }
    }

    /// |L||v| + |t| at the surfaces that a ray stands on: the largest.
    fn reach(&self, ray: &Ray, departures: &Departures) -> f64 {
        let reach = |c: &Crossing| self.with(c.instance, ray.time, |placed| placed.reach(c.primitive));
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        departures.crossings().iter().filter_map(reach).fold(0.0, larger)
    }

    /// Where a ray that starts on surfaces begins to look for them: behind its start by at least as much as any of them asks for.
    fn looks_from(&self, footing: &Footing<'_>) -> f64 {
        -behind(self.spread * (2.0 * footing.at_most + 2.0 * self.farthest))
    }

    /// The nearest surface that the ray meets; equal distances are decided by (instance, primitive).
    ///
    /// `departures` says which surfaces the ray starts on.
    pub fn intersect(&self, ray: &Ray, departures: &Departures) -> Option<Hit> {
        let footing = Footing::new(self, ray, departures);
        let standing = Some(&footing).filter(|_| !departures.is_none());
        let from = if standing.is_some() { self.looks_from(&footing) } else { 0.0 };
        let mut nearest = Nearest::before(f64::INFINITY);
        let whole = |instance: u32, nearest: &mut Nearest| {
            self.with(instance, ray.time, |placed| placed.intersect(ray, instance, standing, nearest));
        };
        let Some(fused) = &self.fused else {
            self.tree.walk(ray.origin, ray.direction, from, f64::INFINITY, self.spread, |i, _| {
                whole(self.instance(i), &mut nearest);
                nearest.limit
            });
            return nearest.hit;
        };
        fused.walk(ray, [from, f64::INFINITY], self.spread, |Piece { instance, triangle }| {
            match triangle {
                None => whole(instance, &mut nearest),
                Some(triangle) => {
                    if let Some(hit) = self.meet(ray, instance, triangle, standing) {
                        nearest.offer(hit);
                    }
                }
            }
            nearest.limit
        });
        let hit = nearest.hit?;
        if nearest.is_doubtful(ray) {
            // The mesh by itself tells entering and leaving apart.
            nearest = Nearest::before(f64::INFINITY);
            whole(hit.instance, &mut nearest);
            return nearest.hit;
        }
        Some(hit)
    }

    /// Where the ray meets a triangle of a mesh that stands still.
    #[inline]
    fn meet(&self, ray: &Ray, instance: u32, triangle: u32, standing: Option<&Footing<'_>>) -> Option<Hit> {
        let last = standing.and_then(|footing| footing.departures.crossings().last());
        if last.is_some_and(|last| (last.instance, last.primitive) == (instance, triangle)) {
            return None;
        }
        let (mesh, frame) = self.still_mesh(instance)?;
        Placed { shape: &self.singles[instance as usize].0, frame, time: ray.time }
            .meet(mesh, ray, instance, triangle, standing)
    }

    /// Whether some surface before `limit` blocks the ray. Each that the ray meets is asked, in no particular order and some
    /// maybe not at all, until one blocks.
    ///
    /// `departures` says which surfaces the ray starts on. A surface at the limit itself counts as behind it.
    pub fn is_blocked(
        &self,
        ray: &Ray,
        departures: &Departures,
        limit: f64,
        mut blocks: impl FnMut(&Hit) -> bool,
    ) -> bool {
        let footing = Footing::new(self, ray, departures);
        let standing = Some(&footing).filter(|_| !departures.is_none());
        let from = if standing.is_some() { self.looks_from(&footing) } else { 0.0 };
        let mut is_blocked = false;
        let mut meets = |hit: &Hit| hit.distance < limit && blocks(hit);
        let whole = |instance: u32, meets: &mut dyn FnMut(&Hit) -> bool| {
            self.with(instance, ray.time, |placed| placed.meets(ray, instance, standing, limit, meets)) == Some(true)
        };
        // Nothing is before what blocks.
        let left = |is_blocked| if is_blocked { f64::NEG_INFINITY } else { limit };
        match &self.fused {
            None => self.tree.walk(ray.origin, ray.direction, from, limit, self.spread, |i, _| {
                is_blocked |= whole(self.instance(i), &mut meets);
                left(is_blocked)
            }),
            Some(fused) => fused.walk(ray, [from, limit], self.spread, |Piece { instance, triangle }| {
                is_blocked = is_blocked
                    || match triangle {
                        None => whole(instance, &mut meets),
                        Some(triangle) => self.meet(ray, instance, triangle, standing).is_some_and(|hit| meets(&hit)),
                    };
                left(is_blocked)
            }),
        }
        is_blocked
    }

    /// A surface of an instance that `is_member`, which passes through the start of the ray, within rounding, and which the
    /// ray has not crossed there. Casts no further than that.
    pub fn coincident(&self, ray: &Ray, departures: &Departures, is_member: impl Fn(u32) -> bool) -> Option<Hit> {
        let footing = Footing::new(self, ray, departures);
        let about = behind(self.spread * (2.0 * footing.magnitude() + 2.0 * self.farthest));
        let mut nearest = Nearest::before(about);
        self.tree.walk(ray.origin, ray.direction, -about, about, self.spread, |i, _| {
            let instance = self.instance(i);
            if is_member(instance) {
                let standing = Some(&footing);
                self.with(instance, ray.time, |placed| placed.intersect(ray, instance, standing, &mut nearest));
            }
            nearest.limit
        });
        nearest.hit.filter(|hit| hit.at_start)
    }

    /// Calls `f` with every crossing of the ray with a surface at a distance > 0, in no particular order.
    ///
    /// Closed shapes are entered as often as they are left, unless the ray starts inside; edges and vertices count as the
    /// faces that a ray beside them crosses.
    pub fn crossings(&self, ray: &Ray, f: &mut dyn FnMut(&Hit)) {
        self.tree.walk(ray.origin, ray.direction, 0.0, f64::INFINITY, self.spread, |i, limit| {
            let instance = self.instance(i);
            self.with(instance, ray.time, |placed| placed.crossings(ray, instance, f));
            limit
        });
    }

    /// The hit point, on the surface to rounding, and the surface around it.
    pub fn local_surface(&self, ray: &Ray, hit: &Hit) -> (DVec3, LocalSurface) {
        // The common case by itself: the answer is long, and written once.
        if let Some((shape, Standing::Still(frame))) = self.singles.get(hit.instance as usize) {
            return Placed { shape, frame, time: ray.time }.local_surface(ray, hit);
        }
        self.with(hit.instance, ray.time, |placed| placed.local_surface(ray, hit)).expect("it was met at this time")
    }

    /// The same point, and the surface as far as a ray without derivatives needs it.
    pub fn normals(&self, ray: &Ray, hit: &Hit) -> (DVec3, UnitNormals) {
        if let Some((shape, Standing::Still(frame))) = self.singles.get(hit.instance as usize) {
            return Placed { shape, frame, time: ray.time }.normals(ray, hit);
        }
        self.with(hit.instance, ray.time, |placed| placed.normals(ray, hit)).expect("it was met at this time")
    }

    /// Texture coordinates at a hit; `None` where none are authored (always, for analytic shapes). `_point`, the refined hit
    /// point, is for shapes whose coordinates come from the position.
    pub fn uv(&self, hit: &Hit, _point: DVec3) -> Option<[f64; 2]> {
        match self.shape(hit.instance) {
            Shape::Sphere(_) | Shape::Solid(_) => None,
            Shape::Mesh(mesh) => mesh.uv(hit.primitive, hit.barycentric),
        }
    }

    /// How the point moves with each texture coordinate at a hit of a ray at `time`: ∂p/∂u and ∂p/∂v; `None` where none are
    /// authored, or where they are the same all over the triangle.
    pub fn tangents(&self, hit: &Hit, time: f64) -> Option<[DVec3; 2]> {
        self.with(hit.instance, time, |placed| placed.tangents(hit)).expect("it was met at this time")
    }

    /// The primvar with a number at a hit; `None` where the shape has none (always, for analytic shapes).
    pub fn primvar(&self, hit: &Hit, number: usize) -> Option<[f32; 4]> {
        match self.shape(hit.instance) {
            Shape::Sphere(_) | Shape::Solid(_) => None,
            Shape::Mesh(mesh) => mesh.primvar(number, hit.primitive, hit.barycentric),
        }
    }

    /// The material slot that was hit: 0 for faces in no subset, k + 1 for the k-th subset.
    pub fn slot(&self, hit: &Hit) -> u32 {
        match self.shape(hit.instance) {
            Shape::Sphere(_) | Shape::Solid(_) => 0,
            Shape::Mesh(mesh) => mesh.slot(hit.primitive),
        }
    }

    /// Lower and upper bounds of everything in render space; `None` without extent.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let all = (0..self.numbering.len())
            .into_par_iter()
            .filter_map(|i| self.bounds_of(i))
            .reduce_with(|a, b| a.union(&b))?;
        Some([all.min, all.max])
    }

    /// Whether the bounds of an instance meet the surface of another one that `is_member`, as far as boxes tell: only then can
    /// their surfaces coincide.
    pub fn is_touching(&self, instance: u32, is_member: impl Fn(u32) -> bool) -> bool {
        let Some(bounds) = self.bounds_of(instance) else { return false };
        // Surfaces that coincide under different transforms differ by rounding of their coordinates.
        let margin = |reach: f64| reach * self.spread * 2f64.powi(-46);
        let widest = margin(self.tree.reach());
        let search = Bounds { min: bounds.min - widest, max: bounds.max + widest };
        self.tree.any_meeting(&search, |i| {
            let other = self.instance(i);
            other != instance
                && is_member(other)
                && self.bounds_of(other).is_some_and(|other| {
                    let margin = margin(bounds.reach().max(other.reach()));
                    bounds.min.cmple(other.max + margin).all() && other.min.cmple(bounds.max + margin).all()
                })
                && (self.is_instance_moving(other)
                    || self.with(other, 0.0, |placed| placed.may_meet(&search)) == Some(true))
        })
    }

    /// Whether anything in it moves.
    pub fn is_moving(&self) -> bool {
        let deforms = |shape: &Shape| matches!(shape, Shape::Mesh(mesh) if mesh.is_deforming());
        self.is_array_moving.contains(&true)
            || self.singles.iter().any(|(shape, standing)| matches!(standing, Standing::Moving(_)) || deforms(shape))
            || self.arrays.iter().any(|array| array.parts.iter().any(|part| deforms(&part.shape)))
    }

    /// Whether some surface of an instance that `is_member` may lie in the box `[min, max]`, in render space; a no is certain.
    pub fn has_surface_in(&self, [min, max]: [DVec3; 2], is_member: impl Fn(u32) -> bool) -> bool {
        let search = Bounds { min, max };
        let margin = search.reach().max(self.tree.reach()) * self.spread * 2f64.powi(-46);
        let search = Bounds { min: min - margin, max: max + margin };
        self.tree.any_meeting(&search, |i| {
            let instance = self.instance(i);
            is_member(instance)
                && self
                    .bounds_of(instance)
                    .is_some_and(|bounds| bounds.min.cmple(search.max).all() && search.min.cmple(bounds.max).all())
                && (self.is_instance_moving(instance)
                    || self.with(instance, 0.0, |placed| placed.may_meet(&search)) == Some(true))
        })
    }

    /// What `intersect` finds by asking every primitive: the law that trees are tested against.
    #[doc(hidden)]
    pub fn intersect_without_tree(&self, ray: &Ray) -> Option<Hit> {
        let mut nearest = Nearest::before(f64::INFINITY);
        for instance in (0..self.numbering.len()).filter(|&i| self.bounds_of(i).is_some()) {
            self.with(instance, ray.time, |placed| {
                let object = placed.ray(ray);
                match placed.shape {
                    Shape::Sphere(_) | Shape::Solid(_) => placed.intersect(ray, instance, None, &mut nearest),
                    Shape::Mesh(mesh) => {
                        let mut sides = Sides::new(f64::INFINITY);
                        mesh.every_crossing(object.origin, object.direction, ray.time, |hit| {
                            sides.offer(object.hit(instance, &hit));
                        });
                        if let Some(hit) = sides.first(mesh, ray) {
                            nearest.offer(hit);
                        }
                    }
                }
            });
        }
        nearest.hit
    }
}
