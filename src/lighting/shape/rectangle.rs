//! The parallelogram, sampled by the solid angle that it subtends if it is a rectangle.
//!
//! C. Ureña, M. Fajardo, A. King, "An area-preserving parametrization for spherical rectangles", CGF 32(4), 2013; the symbols
//! are theirs. Where the solid angle is so small that nothing is left of it in the sum of angles, and for a sheared
//! rectangle, points are even over the area.

use std::f64::consts::PI;

use glam::DVec3;

use super::Toward;

/// Below this solid angle the area is sampled: the rounding of the angles, 2^-50, is 2^-30 of it.
const SMALLEST: f64 = 1.0 / 1_048_576.0;
/// |cos| of the sides' angle up to which they count as perpendicular: rounding of a few products.
const PERPENDICULAR: f64 = 1e-12;

/// Distance from the plane, over the longer side, up to which rounding may have put a point of it.
const IN_PLANE: f64 = 1e-9;

/// A parallelogram that shines.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Rectangle {
    center: DVec3,
    /// From the middle to the sides.
    half: [DVec3; 2],
    /// Unit vectors of both.
    axes: [DVec3; 2],
    lengths: [f64; 2],
    normal: DVec3,
    area: f64,
    is_right_angled: bool,
    is_two_sided: bool,
}

/// A rectangle as it is seen from a point.
struct Seen {
    /// Of the corners, along the sides: lower and upper.
    x: [f64; 2],
    y: [f64; 2],
    /// Negative: behind the plane.
    z: f64,
    /// Unit vector along z, away from the rectangle.
    axis: DVec3,
    b0: f64,
    b1: f64,
    k: f64,
    solid_angle: f64,
}

impl Rectangle {
    /// About `center`, with `u` and `v` from there to the sides; shines towards `normal`, a unit vector, or to both sides.
    pub(in crate::lighting) fn new(center: DVec3, u: DVec3, v: DVec3, normal: DVec3, is_two_sided: bool) -> Self {
        let lengths = [u.length(), v.length()];
        let axes = [u / lengths[0], v / lengths[1]];
        Self {
            center,
            half: [u, v],
            axes,
            lengths,
            normal,
            area: 4.0 * u.cross(v).length(),
            is_right_angled: axes[0].dot(axes[1]).abs() <= PERPENDICULAR,
            is_two_sided,
        }
    }

    pub(in crate::lighting) fn area(&self) -> f64 {
        self.area
    }

    /// Unit vector to the side that shines.
    pub(in crate::lighting) fn normal(&self) -> DVec3 {
        self.normal
    }

    pub(in crate::lighting) fn corners(&self) -> [DVec3; 4] {
        let [u, v] = self.half;
        [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].map(|[s, t]| self.center + s * u + t * v)
    }

    /// −1..1 along both sides, of a point of the plane.
    pub(in crate::lighting) fn coordinates(&self, point: DVec3) -> [f64; 2] {
        let ([u, v], q) = (self.half, point - self.center);
        let n = u.cross(v);
        let scale = 1.0 / n.length_squared();
        [q.cross(v).dot(n) * scale, u.cross(q).dot(n) * scale]
    }

    /// Whether a point of an object that it is a face of is in its plane: none of its light goes there.
    pub(in crate::lighting) fn is_in_plane(&self, p: DVec3) -> bool {
        let height = (p - self.center).dot(self.normal);
        height.abs() <= IN_PLANE * self.lengths[0].max(self.lengths[1])
    }

    /// Height of a point over the plane; `None` on the side that is dark and in the plane.
    fn height(&self, p: DVec3) -> Option<f64> {
        let height = (p - self.center).dot(self.normal);
        (if self.is_two_sided { height != 0.0 } else { height > 0.0 }).then_some(height)
    }

    /// The solid angle where it is what is sampled.
    fn seen(&self, p: DVec3) -> Option<Seen> {
        if !self.is_right_angled {
            return None;
        }
        let height = self.height(p)?;
        let corner = self.center - self.half[0] - self.half[1] - p;
        let (x0, y0) = (corner.dot(self.axes[0]), corner.dot(self.axes[1]));
        let (x, y) = ([x0, x0 + 2.0 * self.lengths[0]], [y0, y0 + 2.0 * self.lengths[1]]);
        let z = -height.abs();
        // z components of the normals of the planes through the eye and a side.
        let across = |a: f64| a / libm::hypot(a, z);
        let (n0, n1, n2, n3) = (-across(y[0]), across(x[1]), across(y[1]), -across(x[0]));
        let angle = |a: f64, b: f64| libm::acos((-a * b).clamp(-1.0, 1.0));
        let (g0, g1, g2, g3) = (angle(n0, n1), angle(n1, n2), angle(n2, n3), angle(n3, n0));
        let solid_angle = g0 + g1 + g2 + g3 - 2.0 * PI;
        let axis = if height > 0.0 { self.normal } else { -self.normal };
        (solid_angle >= SMALLEST).then_some(Seen { x, y, z, axis, b0: n0, b1: n2, k: 2.0 * PI - g2 - g3, solid_angle })
    }

    /// How large it looks from a point, steradian; `None` where that is little and from where it is dark.
    pub(in crate::lighting) fn solid_angle(&self, p: DVec3) -> Option<f64> {
        self.seen(p).map(|seen| seen.solid_angle)
    }

    pub(in crate::lighting) fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<Toward> {
        let height = self.height(p)?;
        let (to, by_angle) = match self.seen(p) {
            Some(seen) => (seen.point(u, self.axes), Some(1.0 / seen.solid_angle)),
            None => {
                let [s, t] = u.map(|u| 2.0 * u - 1.0);
                (self.center + s * self.half[0] + t * self.half[1] - p, None)
            }
        };
        let distance = to.length();
        let wi = to / distance;
        let pdf_solid_angle = by_angle.unwrap_or_else(|| self.by_area(height, distance));
        Some(Toward { wi, distance, pdf_solid_angle })
    }

    /// Of the direction that meets it at `distance`.
    pub(in crate::lighting) fn pdf(&self, p: DVec3, distance: f64) -> f64 {
        let Some(height) = self.height(p) else { return 0.0 };
        self.seen(p).map_or_else(|| self.by_area(height, distance), |seen| 1.0 / seen.solid_angle)
    }

    /// distance² / (area · cos), where cos = height / distance.
    fn by_area(&self, height: f64, distance: f64) -> f64 {
        distance * distance * distance / (self.area * height.abs())
    }

    /// Distance at which a ray meets the side that shines, and where between the sides, −1..1.
    pub(in crate::lighting) fn meet(&self, origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
        let height = self.height(origin)?;
        let distance = -height / direction.dot(self.normal);
        if !(distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let at = self.coordinates(origin + distance * direction);
        at.iter().all(|x| x.abs() <= 1.0).then_some((distance, at))
    }
}

impl Seen {
    /// From the eye to the point with the coordinates `u` of the unit square.
    fn point(&self, [u, v]: [f64; 2], axes: [DVec3; 2]) -> DVec3 {
        let Self { x, y, z, axis, b0, b1, k, solid_angle } = *self;
        let au = u * solid_angle + k;
        let fu = (libm::cos(au) * b0 - b1) / libm::sin(au);
        let cu = (1f64.copysign(fu) / libm::hypot(fu, b0)).clamp(-1.0, 1.0);
        let sine = (1.0 - cu * cu).sqrt();
        let xu = if sine > 0.0 { (-cu * z / sine).clamp(x[0], x[1]) } else { x[usize::from(cu > 0.0)] };
        let d = libm::hypot(xu, z);
        let [h0, h1] = y.map(|y| y / libm::hypot(d, y));
        let h = h0 + v * (h1 - h0);
        let rest = 1.0 - h * h;
        let yv = if rest > 0.0 { (h * d / rest.sqrt()).clamp(y[0], y[1]) } else { y[usize::from(h > 0.0)] };
        xu * axes[0] + yv * axes[1] + z * axis
    }
}
