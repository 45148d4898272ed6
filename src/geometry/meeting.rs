//! A ray and one instance: which of its surfaces the ray meets first, or one that blocks it.

use std::cmp::Ordering;

use super::aggregate::Footing;
use super::mesh::{Mesh, MeshHit};
use super::placed::{ObjectRay, Placed};
use super::start::{Met, Relation, Start, relation};
use super::{Hit, Ray, Shape};

/// The nearest hit so far.
pub(super) struct Nearest {
    pub(super) hit: Option<Hit>,
    pub(super) limit: f64,
    /// The smallest distance of all others.
    second: f64,
}

impl Nearest {
    /// Of hits before `limit`.
    pub(super) fn before(limit: f64) -> Self {
        Self { hit: None, limit, second: f64::INFINITY }
    }

    pub(super) fn offer(&mut self, hit: Hit) {
        if self.hit.is_none_or(|best| is_before(&hit, &best)) {
            if self.hit.is_some() {
                self.second = self.limit;
            }
            self.limit = hit.distance;
            self.hit = Some(hit);
        } else {
            self.second = self.second.min(hit.distance);
        }
    }

    /// Whether another hit is so near that digits do not tell which comes first.
    pub(super) fn is_doubtful(&self, ray: &Ray) -> bool {
        self.second - self.limit <= DOUBTFUL * (self.limit + ray.origin.abs().max_element())
    }
}

/// Nearest entering and nearest leaving hit of one mesh.
///
/// Where a ray just touches an edge or a vertex it enters and leaves at one point, and rounding decides which of the two
/// distances is smaller. Geometry knows better: whatever is met second reaches beyond the plane of what is met first.
pub(super) struct Sides {
    hits: [Option<Hit>; 2],
    limit: f64,
}

/// Half the digits: hits further apart are in order beyond doubt.
const DOUBTFUL: f64 = 1.0 / 67_108_864.0;

impl Sides {
    pub(super) fn new(limit: f64) -> Self {
        Self { hits: [None; 2], limit }
    }

    /// Takes a hit and returns the distance of the nearest.
    pub(super) fn offer(&mut self, hit: Hit) -> f64 {
        let best = &mut self.hits[usize::from(hit.leaving)];
        if best.is_none_or(|best| is_before(&hit, &best)) {
            *best = Some(hit);
        }
        self.limit = self.limit.min(hit.distance);
        self.limit
    }

    pub(super) fn first(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        let [entering, leaving] = self.hits;
        let (Some(entering), Some(leaving)) = (entering, leaving) else { return entering.or(leaving) };
        let (first, second) = if is_before(&entering, &leaving) { (entering, leaving) } else { (leaving, entering) };
        let size = first.distance + ray.origin.abs().max_element();
        if second.distance - first.distance > DOUBTFUL * size {
            return Some(first);
        }
        // After the first the ray is on its outward side if it left there.
        let corners = |hit: &Hit| mesh.corners(hit.primitive, ray.time);
        match relation(corners(&second), corners(&first), first.leaving) {
            Relation::Behind => Some(Hit { distance: first.distance, ..second }),
            _ => Some(first),
        }
    }
}

/// The order of hits: by distance, then by (instance, primitive).
fn is_before(a: &Hit, b: &Hit) -> bool {
    let order = a.distance.total_cmp(&b.distance);
    order.then((a.instance, a.primitive).cmp(&(b.instance, b.primitive))) == Ordering::Less
}

impl ObjectRay {
    /// The hit in render space.
    pub(super) fn hit(&self, instance: u32, hit: &MeshHit) -> Hit {
        Hit {
            distance: hit.distance / self.stretch,
            instance,
            primitive: hit.primitive,
            barycentric: hit.barycentric,
            leaving: hit.leaving,
            at_start: hit.at_start,
        }
    }

    /// The same for an analytic shape.
    fn analytic_hit(&self, instance: u32, primitive: u32, met: Met, leaving: bool) -> Hit {
        let Met { distance, at_start } = met;
        Hit { distance: distance / self.stretch, instance, primitive, barycentric: [0.0; 2], leaving, at_start }
    }
}

impl Placed<'_> {
    /// What a ray that stands on surfaces knows of them in this object's space.
    fn start<'d>(
        &'d self,
        object: &'d ObjectRay,
        instance: u32,
        standing: Option<&'d Footing<'_>>,
    ) -> Option<Start<'d, impl Fn() -> f64>> {
        standing.map(|footing| Start {
            instance,
            crossings: footing.departures.crossings(),
            arrival: footing.departures.arrival(),
            inverse: &self.frame.inverse,
            magnitude: move || self.start_magnitude(footing.magnitude(), object),
            at_most: self.start_magnitude(footing.at_most, object),
        })
    }

    /// Whether the ray has just left a sheet, which it cannot meet.
    #[inline]
    fn is_behind(&self, instance: u32, object: &ObjectRay, standing: Option<&Footing<'_>>) -> bool {
        let last = standing.and_then(|footing| footing.departures.crossings().last());
        last.is_some_and(|last| {
            last.instance == instance
                && matches!(self.shape, Shape::Mesh(mesh) if mesh.is_behind(last.outward, object.direction))
        })
    }

    /// Whether a surface before `limit` is one that `blocks`.
    pub(super) fn meets(
        &self,
        ray: &Ray,
        instance: u32,
        standing: Option<&Footing<'_>>,
        limit: f64,
        blocks: &mut dyn FnMut(&Hit) -> bool,
    ) -> bool {
        let Shape::Mesh(mesh) = self.shape else {
            let mut nearest = Nearest::before(limit);
            self.intersect(ray, instance, standing, &mut nearest);
            // Far from the start, what lies beyond the first surface needs no care for where the ray stands.
            return nearest.hit.is_some_and(|first| {
                let mut is_blocked = blocks(&first);
                if !is_blocked {
                    self.crossings(ray, instance, &mut |hit| {
                        let is_beyond = hit.distance > first.distance && hit.distance < limit;
                        is_blocked = is_blocked || is_beyond && blocks(hit);
                    });
                }
                is_blocked
            });
        };
        let object = self.ray(ray);
        if self.is_behind(instance, &object, standing) {
            return false;
        }
        let start = self.start(&object, instance, standing);
        let limit = limit * object.stretch;
        let mut is_blocked = false;
        mesh.walk(object.origin, object.direction, ray.time, start.as_ref(), limit, |hit| {
            is_blocked = is_blocked || blocks(&object.hit(instance, &hit));
            if is_blocked { f64::NEG_INFINITY } else { limit }
        });
        is_blocked
    }

    /// Where the ray meets a triangle of a mesh that does not deform; of several that it meets this does not tell the first.
    pub(super) fn meet(
        &self,
        mesh: &Mesh,
        ray: &Ray,
        instance: u32,
        triangle: u32,
        standing: Option<&Footing<'_>>,
    ) -> Option<Hit> {
        let object = self.ray(ray);
        let start = self.start(&object, instance, standing);
        let hit = mesh.meet_one(object.origin, object.direction, start.as_ref(), triangle)?;
        Some(object.hit(instance, &hit))
    }

    pub(super) fn intersect(&self, ray: &Ray, instance: u32, standing: Option<&Footing<'_>>, nearest: &mut Nearest) {
        let object = self.ray(ray);
        if self.is_behind(instance, &object, standing) {
            return;
        }
        let start = self.start(&object, instance, standing);
        match self.shape {
            Shape::Mesh(mesh) => {
                let mut sides = Sides::new(nearest.limit);
                mesh.walk(
                    object.origin,
                    object.direction,
                    ray.time,
                    start.as_ref(),
                    sides.limit * object.stretch,
                    |hit| sides.offer(object.hit(instance, &hit)) * object.stretch,
                );
                if let Some(hit) = sides.first(mesh, ray) {
                    nearest.offer(hit);
                }
            }
            Shape::Sphere(sphere) => {
                let roots = sphere.roots(object.origin, object.direction);
                let found = match start {
                    Some(start) => start.sphere(sphere.radius(), object.origin, object.direction, roots),
                    None => roots.and_then(|roots| {
                        let leaving = roots[0] <= 0.0;
                        let distance = roots[usize::from(leaving)];
                        (distance > 0.0).then_some((Met { distance, at_start: false }, leaving))
                    }),
                };
                if let Some((met, leaving)) = found {
                    nearest.offer(object.analytic_hit(instance, 0, met, leaving));
                }
            }
            Shape::Solid(solid) => {
                let found = match start {
                    Some(start) => start.solid(solid, object.origin, object.direction),
                    None => solid
                        .borders(object.origin, object.direction, None)
                        .ahead()
                        .map(|border| (Met { distance: border.distance, at_start: false }, border)),
                };
                if let Some((met, border)) = found {
                    nearest.offer(object.analytic_hit(instance, border.primitive, met, border.leaving));
                }
            }
        }
    }

    pub(super) fn crossings(&self, ray: &Ray, instance: u32, f: &mut dyn FnMut(&Hit)) {
        let object = self.ray(ray);
        match self.shape {
            Shape::Mesh(mesh) => {
                let nowhere = None::<&Start<'_, fn() -> f64>>;
                mesh.walk(object.origin, object.direction, ray.time, nowhere, f64::INFINITY, |hit| {
                    f(&object.hit(instance, &hit));
                    f64::INFINITY
                });
            }
            Shape::Sphere(sphere) => {
                for (root, leaving) in
                    sphere.roots(object.origin, object.direction).into_iter().flatten().zip([false, true])
                {
                    if root > 0.0 {
                        f(&object.analytic_hit(instance, 0, Met { distance: root, at_start: false }, leaving));
                    }
                }
            }
            Shape::Solid(solid) => {
                let borders = solid.borders(object.origin, object.direction, None);
                for border in borders.as_slice().iter().filter(|b| b.distance > 0.0) {
                    let met = Met { distance: border.distance, at_start: false };
                    f(&object.analytic_hit(instance, border.primitive, met, border.leaving));
                }
            }
        }
    }
}
