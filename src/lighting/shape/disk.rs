//! The ellipse: by area from afar, by the solid angle of the rectangle around it from nearby.
//!
//! Nearby, densities over the area would fall and rise with the square of the distance; the rectangle's density is even, and
//! its corners, a fifth of it, miss.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Rectangle, Toward};

/// From this solid angle of the rectangle on, that is what is sampled: ten degrees about the middle.
const NEAR: f64 = 0.1;

/// An ellipse that shines to one side.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Disk {
    center: DVec3,
    /// Half axes, perpendicular to each other.
    half: [DVec3; 2],
    normal: DVec3,
    area: f64,
    around: Rectangle,
}

impl Disk {
    /// center + u cos φ + v sin φ is its edge; shines towards `normal`, a unit vector.
    pub(in crate::lighting) fn new(center: DVec3, u: DVec3, v: DVec3, normal: DVec3) -> Self {
        // The edge is farthest where the derivative of its square, (v² − u²) sin 2φ + 2 u·v cos 2φ, is 0.
        let phi = 0.5 * libm::atan2(2.0 * u.dot(v), u.length_squared() - v.length_squared());
        let (sine, cosine) = (libm::sin(phi), libm::cos(phi));
        let a = u * cosine + v * sine;
        // Perpendicular to the first in the plane to rounding, as long as the area asks for.
        let b = normal.cross(a) * (u.cross(v).length() / a.length_squared());
        let area = PI * u.cross(v).length();
        Self { center, half: [a, b], normal, area, around: Rectangle::new(center, a, b, normal, false) }
    }

    pub(in crate::lighting) fn center(&self) -> DVec3 {
        self.center
    }

    /// Half axes, perpendicular to each other.
    pub(in crate::lighting) fn half(&self) -> [DVec3; 2] {
        self.half
    }

    pub(in crate::lighting) fn corners(&self) -> [DVec3; 4] {
        self.around.corners()
    }

    /// Density over the rectangle around it, where that is what is sampled.
    fn by_angle(&self, p: DVec3) -> Option<f64> {
        self.around.sampled_solid_angle(p).filter(|&solid_angle| solid_angle >= NEAR).map(f64::recip)
    }

    fn by_area(&self, height: f64, distance: f64) -> f64 {
        distance * distance * distance / (self.area * height)
    }

    fn height(&self, p: DVec3) -> Option<f64> {
        let height = (p - self.center).dot(self.normal);
        (height > 0.0).then_some(height)
    }

    pub(in crate::lighting) fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<Toward> {
        let height = self.height(p)?;
        if self.by_angle(p).is_some() {
            let toward = self.around.sample(p, u)?;
            let [x, y] = self.around.coordinates(p + toward.distance * toward.wi);
            return (x * x + y * y <= 1.0).then_some(toward);
        }
        let [x, y] = concentric(u);
        let to = self.center + x * self.half[0] + y * self.half[1] - p;
        let distance = to.length();
        Some(Toward { wi: to / distance, distance, pdf_solid_angle: self.by_area(height, distance) })
    }

    pub(in crate::lighting) fn pdf(&self, p: DVec3, distance: f64) -> f64 {
        let Some(height) = self.height(p) else { return 0.0 };
        self.by_angle(p).unwrap_or_else(|| self.by_area(height, distance))
    }

    /// Distance at which a ray meets the side that shines.
    pub(in crate::lighting) fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let (distance, [x, y]) = self.around.meet(origin, direction)?;
        (x * x + y * y <= 1.0).then_some(distance)
    }
}

/// The unit disk from the unit square, even in area (P. Shirley, K. Chiu, "A low distortion map between disk and square",
/// JGT 2(3), 1997).
fn concentric(u: [f64; 2]) -> [f64; 2] {
    let [x, y] = u.map(|u| 2.0 * u - 1.0);
    if x == 0.0 && y == 0.0 {
        return [0.0; 2];
    }
    let (r, phi) = if x.abs() > y.abs() { (x, PI / 4.0 * (y / x)) } else { (y, PI / 2.0 - PI / 4.0 * (x / y)) };
    [r * libm::cos(phi), r * libm::sin(phi)]
}
