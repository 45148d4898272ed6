//! The ellipsoid: the cone of directions that it fills, even in the space where it is a sphere.
//!
//! In that space the visible cap fills a cone about the centre (P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo techniques for
//! direct lighting calculations", TOG 15(1), 1996); directions and their densities are carried over by the linear map. Of a true
//! sphere directions are even in render space, too.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3};

use crate::light;

use super::{Directions, Toward, frame};

/// An ellipsoid that shines outwards, or to both sides.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Ellipsoid {
    center: DVec3,
    /// Render space from the space where it is the unit sphere.
    directions: Directions,
    area: f64,
    is_two_sided: bool,
}

/// What is seen of the unit sphere.
enum Seen {
    /// From outside: the distance and the direction of its centre, and 1 − cos of the cone's half angle.
    Cap { distance: f64, axis: DVec3, one_minus_cosine: f64 },
    /// From inside, where that shines.
    Inside,
    /// From the point of it in this direction: all the rest, through the inside.
    Itself(DVec3),
}

impl Seen {
    fn density(&self) -> f64 {
        match self {
            Self::Cap { one_minus_cosine, .. } => 1.0 / (2.0 * PI * one_minus_cosine),
            Self::Inside => 1.0 / (4.0 * PI),
            Self::Itself(_) => 1.0 / (2.0 * PI),
        }
    }
}

impl Ellipsoid {
    /// `axes` are the images of the unit sphere's radii.
    pub(in crate::lighting) fn new(center: DVec3, axes: DMat3, is_two_sided: bool) -> Self {
        let place = DAffine3 { matrix3: axes, translation: DVec3::ZERO };
        let area = light::Ellipsoid::new(&place, 1.0, false).area;
        Self { center, directions: Directions::new(axes), area, is_two_sided }
    }

    /// Half the size of its box.
    pub(in crate::lighting) fn half_extent(&self) -> DVec3 {
        let rows = self.directions.render_from_local.transpose();
        DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length())
    }

    /// Half sides of a parallelogram about the centre, across `d`, in which it is seen by an observer far off in that direction: with the axes A and
    /// two vectors E across, its outline is the ellipse L u, |u| = 1, of L Lᵀ = E A Aᵀ Eᵀ.
    pub(in crate::lighting) fn shadow(&self, d: DVec3) -> [DVec3; 2] {
        let [x, y] = frame(d);
        let rows = self.directions.render_from_local.transpose();
        let (a, b) = (rows * x, rows * y);
        let length = a.length();
        let along = a.dot(b) / length;
        [length * x + along * y, (b.length_squared() - along * along).max(0.0).sqrt() * y]
    }

    pub(in crate::lighting) fn center(&self) -> DVec3 {
        self.center
    }

    /// Of its surface.
    pub(in crate::lighting) fn area(&self) -> f64 {
        self.area
    }

    fn local(&self, p: DVec3) -> DVec3 {
        self.directions.local_from_render * (p - self.center)
    }

    /// `on_it`: from a point of its surface, whichever side rounding has put that on.
    fn seen(&self, origin: DVec3, on_it: bool) -> Option<Seen> {
        let distance = origin.length();
        if on_it {
            return self.is_two_sided.then(|| Seen::Itself(origin / distance));
        }
        if distance <= 1.0 {
            return self.is_two_sided.then_some(Seen::Inside);
        }
        let cosine = ((distance - 1.0) * (distance + 1.0)).sqrt() / distance;
        let one_minus_cosine = 1.0 / (distance * distance * (1.0 + cosine));
        Some(Seen::Cap { distance, axis: -origin / distance, one_minus_cosine })
    }

    /// For the point `p`, which may be one of the surface itself.
    pub(in crate::lighting) fn sample(&self, p: DVec3, on_it: bool, [u, v]: [f64; 2]) -> Option<Toward> {
        let origin = self.local(p);
        let seen = self.seen(origin, on_it)?;
        let (axis, height) = match seen {
            Seen::Cap { axis, one_minus_cosine, .. } => (axis, u * one_minus_cosine),
            Seen::Inside => (DVec3::Z, 2.0 * u),
            Seen::Itself(place) => (-place, u),
        };
        let (sine, cosine) = ((height * (2.0 - height)).max(0.0).sqrt(), 1.0 - height);
        let [x, y] = frame(axis);
        let phi = 2.0 * PI * v;
        let direction = sine * (libm::cos(phi) * x + libm::sin(phi) * y) + cosine * axis;
        let along = match seen {
            Seen::Cap { distance, .. } => {
                let aside = distance * sine;
                distance * cosine - ((1.0 - aside) * (1.0 + aside)).max(0.0).sqrt()
            }
            Seen::Inside => {
                let to_nearest = -origin.dot(direction);
                let aside = (origin + to_nearest * direction).length();
                to_nearest + ((1.0 - aside) * (1.0 + aside)).max(0.0).sqrt()
            }
            Seen::Itself(_) => 2.0 * cosine,
        };
        let image = self.directions.render_from_local * direction;
        let stretch = image.length();
        let pdf_solid_angle = self.directions.density(seen.density(), stretch);
        (along > 0.0).then_some(Toward { wi: image / stretch, distance: along * stretch, pdf_solid_angle })
    }

    /// Of the direction `wi`, which meets it at `distance`: 0 on the far side, which is only seen where the near one is not there.
    pub(in crate::lighting) fn pdf(&self, p: DVec3, on_it: bool, wi: DVec3, distance: f64) -> f64 {
        let origin = self.local(p);
        let Some(seen) = self.seen(origin, on_it) else { return 0.0 };
        let d = self.directions.local_from_render * wi;
        let shrink = d.length();
        // Beyond the middle of the chord.
        if matches!(seen, Seen::Cap { .. }) && distance * shrink * shrink > -origin.dot(d) {
            return 0.0;
        }
        self.directions.density(seen.density(), 1.0 / shrink)
    }

    /// Distance at which a ray meets it from outside.
    pub(in crate::lighting) fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let o = self.local(origin);
        let distance = o.length();
        if distance <= 1.0 {
            return None;
        }
        let d = self.directions.local_from_render * direction;
        let stretch = d.length();
        let d = d / stretch;
        // As `geometry::sphere` has it: nothing cancels.
        let to_nearest = -o.dot(d);
        let nearest = (o + to_nearest * d).length();
        if to_nearest <= 0.0 || nearest >= 1.0 {
            return None;
        }
        let far = to_nearest + ((1.0 - nearest) * (1.0 + nearest)).sqrt();
        let near = (distance - 1.0) * (distance + 1.0) / far;
        (near > 0.0).then_some(near / stretch)
    }

    /// Radiant intensity towards the unit vector `d` for a radiance of 1: area of the shadow.
    pub(in crate::lighting) fn projected_area(&self, d: DVec3) -> f64 {
        PI * self.directions.determinant * (self.directions.local_from_render * d).length()
    }
}
