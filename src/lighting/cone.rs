//! Cones of directions: which way the normals of several lights point.
//!
//! M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §3.8.4 and §12.6.3.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector.
    pub(super) axis: DVec3,
    /// Half angle, radians; π for every direction.
    pub(super) angle: f64,
}

impl Cone {
    pub(super) const EVERYTHING: Self = Self { axis: DVec3::Z, angle: PI };

    /// A cone around both.
    pub(super) fn union(&self, other: &Self) -> Self {
        let (a, b) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        let apart = angle_between(a.axis, b.axis);
        if (apart + b.angle).min(PI) <= a.angle {
            return *a;
        }
        let angle = 0.5 * (a.angle + apart + b.angle);
        let turn = a.axis.cross(b.axis);
        if angle >= PI || turn.length_squared() <= 0.0 {
            return Self::EVERYTHING;
        }
        let axis = DQuat::from_axis_angle(turn.normalize(), angle - a.angle) * a.axis;
        Self { axis: axis.normalize(), angle }
    }
}

/// Between unit vectors, radians.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    2.0 * libm::atan2((a - b).length(), (a + b).length())
}
