//! The analytic sphere.
//!
//! Intersection after Haines, Günther, Akenine-Möller 2019, "Precision improvements for ray/sphere intersection", Ray Tracing
//! Gems ch. 7: the discriminant from the distance of the centre to the line, the roots without cancellation.

use glam::DVec3;

/// A sphere about the origin of its object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    radius: f64,
}

impl Sphere {
    /// A sphere of the given radius; `None` unless it is positive and finite.
    pub fn new(radius: f64) -> Option<Self> {
        (radius > 0.0 && radius.is_finite()).then_some(Self { radius })
    }

    /// Its radius, object units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Where the ray's line enters and leaves, in this order; `None` if it passes by or only touches.
    pub(super) fn roots(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        // Along the ray to the point nearest to the centre, and how far that point is from the centre.
        let to_nearest = -origin.dot(direction);
        let nearest = (origin + to_nearest * direction).length();
        let discriminant = (self.radius - nearest) * (self.radius + nearest);
        if discriminant.is_nan() || discriminant <= 0.0 {
            return None;
        }
        let half_chord = discriminant.sqrt();
        let q = to_nearest + half_chord.copysign(to_nearest);
        let distance = origin.length();
        let other = (distance - self.radius) * (distance + self.radius) / q;
        // The sign of q, not of `to_nearest`, which may be −0.
        let roots = if q < 0.0 { [q, other] } else { [other, q] };
        (roots[0] < roots[1]).then_some(roots)
    }

    /// The point of the surface next to `p`.
    pub(super) fn project(&self, p: DVec3) -> DVec3 {
        p * (self.radius / p.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_keep_their_digits_near_and_far() {
        let sphere = Sphere::new(1.0).expect("positive");
        assert_eq!(sphere.roots(DVec3::new(0.0, 0.0, -3.0), DVec3::Z), Some([2.0, 4.0]));
        // A start 1e-12 outside: the near root keeps the digits of the distance.
        let [near, far] = sphere.roots(DVec3::new(0.0, 0.0, -1.0 - 1e-12), DVec3::Z).expect("through the centre");
        assert!((near - 1e-12).abs() < 2e-16 && (far - 2.0).abs() < 1e-11);
        let [near, far] = sphere.roots(DVec3::new(0.0, 0.5, -1e8), DVec3::Z).expect("from far away");
        let half = 0.75_f64.sqrt();
        assert!((near - (1e8 - half)).abs() < 3e-8 && (far - (1e8 + half)).abs() < 3e-8);
    }

    #[test]
    fn a_start_abreast_of_the_centre_has_a_root_on_either_side() {
        let sphere = Sphere::new(1.0).expect("positive");
        for direction in [DVec3::Z, DVec3::NEG_Z, DVec3::new(-0.0, -0.0, 1.0), DVec3::new(-0.0, 0.0, -1.0)] {
            for origin in [DVec3::ZERO, DVec3::new(0.6, 0.0, 0.0), DVec3::new(0.0, -0.6, -0.0)] {
                let half = (1.0 - origin.length_squared()).sqrt();
                let [near, far] = sphere.roots(origin, direction).expect("from inside");
                assert!((near + half).abs() < 1e-15 && (far - half).abs() < 1e-15, "{origin} {direction}");
            }
        }
    }

    #[test]
    fn touching_is_no_crossing() {
        let sphere = Sphere::new(1.0).expect("positive");
        assert_eq!(sphere.roots(DVec3::new(0.0, 1.0, -3.0), DVec3::Z), None);
        assert_eq!(sphere.roots(DVec3::new(0.0, 2.0, -3.0), DVec3::Z), None);
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Sphere::new(radius), None);
        }
    }
}
