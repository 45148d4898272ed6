//! What a camera does not see: beyond its near and far planes and its clipping planes.
//!
//! Clipping is a matter of the camera's ray alone: surfaces on it outside of a range of distances are not seen. What the
//! ray meets after it was refracted or reflected is not clipped, and media are not cut: a ray begins in the medium that is
//! there.

use glam::{DMat4, DVec3, DVec4};

/// Surfaces are seen where `normal`·p + `offset` ≥ 0, p in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

/// The planes of one camera in render space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clipping {
    planes: Vec<Plane>,
}

/// Distances along a ray between which surfaces are seen; nothing is where `far` is less than `near`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Nearer surfaces are not seen.
    pub near: f64,
    /// Farther surfaces are not seen.
    pub far: f64,
}

impl Clipping {
    /// The planes of a camera with `range` along −z and with `planes` (a, b, c, d), which keep a x + b y + c z + d ≥ 0 in
    /// camera space (UsdGeomCamera). Planes without a direction are left out.
    pub(super) fn new(camera_from_render: &DMat4, range: Option<[f64; 2]>, planes: &[[f64; 4]]) -> Self {
        let range = range.map(|[near, far]| [[0.0, 0.0, -1.0, -near], [0.0, 0.0, 1.0, far]]);
        let in_render = |plane: &[f64; 4]| {
            // A plane is a row: it goes with the inverse of what points go with.
            let row = camera_from_render.transpose() * DVec4::from_array(*plane);
            (row.is_finite() && row.truncate() != DVec3::ZERO)
                .then_some(Plane { normal: row.truncate(), offset: row.w })
        };
        Self { planes: range.iter().flatten().chain(planes).filter_map(in_render).collect() }
    }

    /// The same planes in a render space whose zero stands at `offset` of the old one.
    pub(super) fn moved(&self, offset: DVec3) -> Self {
        let move_plane =
            |plane: &Plane| Plane { normal: plane.normal, offset: plane.offset + plane.normal.dot(offset) };
        Self { planes: self.planes.iter().map(move_plane).collect() }
    }

    /// Without the planes that cut nothing off the box from `min` to `max`.
    pub fn of_box(&self, [min, max]: [DVec3; 2]) -> Self {
        let cuts = |plane: &&Plane| {
            let lowest = DVec3::select(plane.normal.cmplt(DVec3::ZERO), max, min);
            // Hit points are off their surface by rounding, as this sum is: both far less than 2^-40 of what is added.
            let size = (plane.normal * lowest).abs().element_sum() + plane.offset.abs();
            plane.normal.dot(lowest) + plane.offset <= size / (1u64 << 40) as f64
        };
        Self { planes: self.planes.iter().filter(cuts).copied().collect() }
    }

    /// Whether nothing is cut off.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// The part of the ray in which surfaces are seen.
    pub fn sight(&self, point: DVec3, direction: DVec3) -> Sight {
        let mut sight = Sight { near: 0.0, far: f64::INFINITY };
        for Plane { normal, offset } in &self.planes {
            let (height, rate) = (normal.dot(point) + offset, normal.dot(direction));
            if rate > 0.0 {
                sight.near = sight.near.max(-height / rate);
            } else if rate < 0.0 {
                sight.far = sight.far.min(-height / rate);
            } else if height < 0.0 {
                sight.far = f64::NEG_INFINITY;
            }
        }
        sight
    }
}
