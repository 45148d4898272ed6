//! Which surfaces a ray stands on: no surface is met twice, and none that coincides with it is missed.
//!
//! A ray that goes on after an event starts on a surface, up to rounding. No distance is small enough to skip and large
//! enough to be safe, so nothing is skipped by distance. Instead the crossings made at this place are remembered with
//! the side on which the ray is afterwards, and a candidate that passes through the start of the ray within the derived
//! rounding error ("here") is judged by sides:
//!
//! * The surface of the last event is planar or a sphere: it is not met again at the start.
//! * An instance crossed here can only be crossed from the side where the ray is: outward after inward, inward after
//!   outward. So the coplanar neighbour across a shared edge is not met, and the opposite face of a corner is.
//! * After an event the ray runs in the open half-space on its side of the triangle it left. A triangle of the same
//!   instance that does not reach into it is not met: at a convex edge a reflected ray does not enter the neighbour.
//! * An instance not yet crossed here lies on the side where the arriving ray had not crossed it: it is met if the ray
//!   still runs through it in the sense in which it arrived (coincident lens faces after a refraction), and not if it
//!   has turned back (after a reflection at the first of them).

use glam::DVec3;

use super::{Hit, Ray};

/// How many crossings at one place are remembered; further ones push out the oldest. More coincident surfaces than this
/// do not occur in what people model.
const CAPACITY: usize = 8;

/// A crossing made at the place where a ray starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Crossing {
    pub(crate) instance: u32,
    pub(crate) primitive: u32,
    /// The ray runs on the outward side of the surface after the event.
    pub(crate) outward: bool,
}

/// The surfaces that a ray stands on.
///
/// ```
/// # use abbe::geometry::{Aggregate, Departures, Ray};
/// # fn follow(aggregate: &Aggregate, mut ray: Ray, mut event: impl FnMut(&Ray) -> glam::DVec3) {
/// let mut departures = Departures::none();
/// while let Some(hit) = aggregate.intersect(&ray, &departures) {
///     let (point, surface) = aggregate.local_surface(&ray, &hit);
///     let direction = event(&ray); // refracted, reflected or straight on
///     departures.depart(&ray, &hit, direction.dot(surface.n_g) > 0.0);
///     ray = Ray { origin: point, direction, ..ray };
/// }
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Departures {
    crossings: [Crossing; CAPACITY],
    len: u8,
    arrival: DVec3,
}

impl Departures {
    /// A ray that starts in the open: at a camera, a light, a point of a volume.
    pub const fn none() -> Self {
        Self {
            crossings: [Crossing { instance: 0, primitive: 0, outward: false }; CAPACITY],
            len: 0,
            arrival: DVec3::ZERO,
        }
    }

    /// The ray `ray` met `hit`; it goes on from there, on the outward side of the surface if `outward` (new direction ·
    /// n_g > 0), whatever the event was. To be called at every event, cut-outs that are passed straight through included,
    /// with the ray that met the surface.
    pub fn depart(&mut self, ray: &Ray, hit: &Hit, outward: bool) {
        if !hit.at_start {
            self.len = 0;
            self.arrival = ray.direction;
        }
        if usize::from(self.len) == CAPACITY {
            self.crossings.copy_within(1.., 0);
            self.len -= 1;
        }
        self.crossings[usize::from(self.len)] = Crossing { instance: hit.instance, primitive: hit.primitive, outward };
        self.len += 1;
    }

    /// Whether the ray starts in the open.
    pub fn is_none(&self) -> bool {
        self.len == 0
    }

    /// The crossings made here, oldest first.
    pub(crate) fn crossings(&self) -> &[Crossing] {
        &self.crossings[..usize::from(self.len)]
    }

    /// Direction of the ray that arrived at this place.
    pub(crate) fn arrival(&self) -> DVec3 {
        self.arrival
    }
}
