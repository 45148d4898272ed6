//! The triangle: by the solid angle that it subtends, by its area where that is tiny or nearly everything.
//!
//! J. Arvo, "Stratified sampling of spherical triangles", SIGGRAPH 1995; in the form of M. Pharr, W. Jakob, G. Humphreys,
//! *Physically Based Rendering*, 4th ed. 2023, §6.5.4, whose limits for the change these are.

use std::f64::consts::PI;

use glam::DVec3;

use super::Toward;

/// Solid angles within which directions are even.
const RANGE: std::ops::Range<f64> = 3e-4..6.22;

/// A triangle that shines.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Triangle {
    corners: [DVec3; 3],
    /// Outward; its length is twice the area.
    normal: DVec3,
    is_two_sided: bool,
}

/// The spherical triangle over it.
struct Seen {
    corners: [DVec3; 3],
    /// At the first corner.
    alpha: f64,
    solid_angle: f64,
}

impl Triangle {
    /// `normal` has the length of twice the area and points to the side that shines.
    pub(in crate::lighting) fn new(corners: [DVec3; 3], normal: DVec3, is_two_sided: bool) -> Self {
        Self { corners, normal, is_two_sided }
    }

    pub(in crate::lighting) fn area(&self) -> f64 {
        0.5 * self.normal.length()
    }

    pub(in crate::lighting) fn corners(&self) -> [DVec3; 3] {
        self.corners
    }

    /// Unit vector outwards.
    pub(in crate::lighting) fn unit_normal(&self) -> DVec3 {
        self.normal.normalize_or_zero()
    }

    /// Whether light of it comes to `p`.
    fn is_facing(&self, p: DVec3) -> bool {
        let height = (p - self.corners[0]).dot(self.normal);
        if self.is_two_sided { height != 0.0 } else { height > 0.0 }
    }

    /// Where its solid angle is what is sampled.
    fn seen(&self, p: DVec3) -> Option<Seen> {
        let [a, b, c] = self.corners.map(|corner| (corner - p).normalize_or_zero());
        // A. van Oosterom, J. Strackee 1983: most triangles are small, and are found to be here.
        let triple = a.dot(b.cross(c)).abs();
        let rough = 2.0 * libm::atan2(triple, 1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        if !RANGE.contains(&rough) {
            return None;
        }
        let [ab, bc, ca] = [a.cross(b), b.cross(c), c.cross(a)].map(DVec3::normalize_or_zero);
        let angle = |u: DVec3, v: DVec3| libm::atan2(u.cross(v).length(), u.dot(v));
        let (alpha, beta, gamma) = (angle(ab, -ca), angle(bc, -ab), angle(ca, -bc));
        let solid_angle = alpha + beta + gamma - PI;
        (solid_angle > 0.0).then_some(Seen { corners: [a, b, c], alpha, solid_angle })
    }

    /// Also the weights of the second and the third corner.
    pub(in crate::lighting) fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<(Toward, [f64; 2])> {
        if !self.is_facing(p) {
            return None;
        }
        let [a, b, c] = self.corners;
        let Some(seen) = self.seen(p) else {
            // Even over the area, by a map that folds nothing (E. Heitz 2019, "A low-distortion map between triangle and
            // square").
            let [s, t] = u;
            let weights = if s < t { [0.5 * s, t - 0.5 * s] } else { [s - 0.5 * t, 0.5 * t] };
            let to = a + weights[0] * (b - a) + weights[1] * (c - a) - p;
            let distance = to.length();
            let wi = to / distance;
            return Some((Toward { wi, distance, pdf_solid_angle: self.by_area(wi, distance) }, weights));
        };
        let wi = seen.direction(u)?;
        let n = self.normal;
        let distance = (a - p).dot(n) / wi.dot(n);
        let q = p + distance * wi - a;
        let scale = 1.0 / n.length_squared();
        // The normal may be that of the mirrored triangle: signs drop out.
        let m = (b - a).cross(c - a);
        let weights = [q.cross(c - a).dot(m) * scale, (b - a).cross(q).dot(m) * scale];
        let weights = weights.map(|w| w.clamp(0.0, 1.0));
        let is_usable = distance > 0.0 && distance.is_finite();
        is_usable.then_some((Toward { wi, distance, pdf_solid_angle: 1.0 / seen.solid_angle }, weights))
    }

    /// Of the direction `wi`, which meets it at `distance`.
    pub(in crate::lighting) fn pdf(&self, p: DVec3, wi: DVec3, distance: f64) -> f64 {
        if !self.is_facing(p) {
            return 0.0;
        }
        self.seen(p).map_or_else(|| self.by_area(wi, distance), |seen| 1.0 / seen.solid_angle)
    }

    /// distance² / (area · cos).
    fn by_area(&self, wi: DVec3, distance: f64) -> f64 {
        2.0 * distance * distance / self.normal.dot(wi).abs()
    }
}

impl Seen {
    fn direction(&self, [u, v]: [f64; 2]) -> Option<DVec3> {
        let ([a, b, c], alpha) = (self.corners, self.alpha);
        // Of the part of the triangle up to the new corner c', which is on the side from a to c.
        let area = PI + u * self.solid_angle;
        let (sin_alpha, cos_alpha) = (libm::sin(alpha), libm::cos(alpha));
        let (sin_area, cos_area) = (libm::sin(area), libm::cos(area));
        let sin_phi = sin_area * cos_alpha - cos_area * sin_alpha;
        let cos_phi = cos_area * cos_alpha + sin_area * sin_alpha;
        let k1 = cos_phi + cos_alpha;
        let k2 = sin_phi - sin_alpha * a.dot(b);
        let cosine = (k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha) / ((k2 * sin_phi + k1 * cos_phi) * sin_alpha);
        if !cosine.is_finite() {
            return None;
        }
        let cosine = cosine.clamp(-1.0, 1.0);
        let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
        let across = |v: DVec3, axis: DVec3| (v - v.dot(axis) * axis).normalize_or_zero();
        let corner = cosine * a + sine * across(c, a);
        // 1 − corner·b, without cancellation.
        let height = v * 0.5 * (corner - b).length_squared();
        let sine = (height * (2.0 - height)).max(0.0).sqrt();
        Some(((1.0 - height) * b + sine * across(corner, b)).normalize())
    }
}
