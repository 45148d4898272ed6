//! A thin lens: what is not in focus is seen from many points at once.
//!
//! Every point of the lens sees the plane of focus as the centre does (Potmesil & Chakravarty 1981; Pharr, Jakob,
//! Humphreys 2023, §5.2.3). Lengths are in camera space.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use crate::scene::description;

/// A lens that is open and focused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Of the entrance pupil.
    pub radius: f64,
    /// Distance of the plane that is in focus, along the axis.
    pub focus: f64,
}

impl Lens {
    /// The lens of `camera`; `None` where it is a pinhole: without an f-stop, without a distance to focus at, or with parallel
    /// rays, which meet in no lens.
    ///
    /// The f-number is focal length over diameter, and focal lengths are in tenths of a stage unit.
    pub fn of(camera: &description::Camera) -> Option<Self> {
        let radius = 0.5 * (0.1 * camera.focal_length) / camera.f_stop;
        let is_open = camera.f_stop > 0.0 && radius > 0.0 && radius.is_finite();
        let is_focused = camera.focus_distance > 0.0 && camera.focus_distance.is_finite();
        (camera.projection == "perspective" && is_open && is_focused)
            .then_some(Self { radius, focus: camera.focus_distance })
    }

    /// The point of the lens, x right and y up, that the point (`u`, `v`) of the unit square stands for; (½, ½) is its centre.
    ///
    /// Equal areas go to equal areas, and neighbours stay neighbours (Shirley & Chiu 1997, "A low distortion map between
    /// disk and square").
    pub fn point(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        if a == 0.0 && b == 0.0 {
            return [0.0; 2];
        }
        let (r, angle) =
            if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
        [self.radius * r * libm::cos(angle), self.radius * r * libm::sin(angle)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_go_to_equal_areas() {
        // The map's Jacobian is constant: π r² over the unit square.
        let lens = Lens { radius: 0.7, focus: 5.0 };
        let h = 1e-6;
        for (u, v) in [(0.9, 0.4), (0.3, 0.8), (0.1, 0.45), (0.52, 0.06), (0.61, 0.55)] {
            let column = |du: f64, dv: f64| {
                let ([x1, y1], [x0, y0]) = (lens.point([u + du, v + dv]), lens.point([u - du, v - dv]));
                [(x1 - x0) / (2.0 * h), (y1 - y0) / (2.0 * h)]
            };
            let ([xu, yu], [xv, yv]) = (column(h, 0.0), column(0.0, h));
            let area = std::f64::consts::PI * 0.7 * 0.7;
            assert!((xu * yv - yu * xv - area).abs() < 1e-8 * area, "({u}, {v})");
        }
    }

    #[test]
    #[allow(clippy::float_cmp, reason = "the centre is exact")]
    fn the_square_fills_the_disk_and_no_more() {
        let lens = Lens { radius: 2.0, focus: 1.0 };
        assert_eq!(lens.point([0.5, 0.5]), [0.0, 0.0]);
        for i in 0..=16 {
            let t = f64::from(i) / 16.0;
            for corner in [[t, 0.0], [t, 1.0], [0.0, t], [1.0, t]] {
                let [x, y] = lens.point(corner);
                assert!((x.hypot(y) - 2.0).abs() < 1e-14, "{corner:?}");
            }
        }
    }
}
