//! The cylinder's side, and the line that stands for it.
//!
//! In the space where its section is a circle, directions from outside are an azimuth γ about the cylinder's axis and an
//! elevation ε: dω = cos ε dε dγ. The azimuths that meet it are an interval, and at each of them so are the elevations: γ is
//! even in the first and sin ε in the second, so that the density in solid angle depends on γ alone, and little on that.

use glam::{DMat3, DVec3};

use super::{Directions, Toward};

/// The side of a cylinder that shines outwards.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Tube {
    center: DVec3,
    half_axis: DVec3,
    radii: [DVec3; 2],
    /// Render space from the space of the cylinder of radius 1 along x.
    directions: Directions,
    /// Half its length there.
    half_length: f64,
}

/// From the receiver to where a direction of one azimuth can meet it.
struct Strip {
    /// Distance across the axis.
    across: f64,
    /// Sines of the elevations of the ends.
    sines: [f64; 2],
}

impl Tube {
    pub(in crate::lighting) fn new(center: DVec3, half_axis: DVec3, radii: [DVec3; 2]) -> Self {
        // The axis is scaled as the radii are, so that the map of a round cylinder keeps angles.
        let scale = (radii[0].length() * radii[1].length()).sqrt();
        let half_length = half_axis.length() / scale;
        let directions = Directions::new(DMat3::from_cols(half_axis / half_length, radii[0], radii[1]));
        Self { center, half_axis, radii, directions, half_length }
    }

    /// Half the size of its box.
    pub(in crate::lighting) fn half_extent(&self) -> DVec3 {
        let [p, q] = self.radii;
        let round = DVec3::new(libm::hypot(p.x, q.x), libm::hypot(p.y, q.y), libm::hypot(p.z, q.z));
        self.half_axis.abs() + round
    }

    pub(in crate::lighting) fn center(&self) -> DVec3 {
        self.center
    }

    fn local(&self, p: DVec3) -> DVec3 {
        self.directions.local_from_render * (p - self.center)
    }

    /// Distance to the axis and half the angle under which the circle is seen; `None` from inside of it.
    fn seen(origin: DVec3) -> Option<(f64, f64)> {
        let distance = libm::hypot(origin.y, origin.z);
        (distance > 1.0).then(|| (distance, libm::asin(1.0 / distance)))
    }

    /// At the sine of an azimuth from the axis.
    fn strip(&self, origin: DVec3, distance: f64, sine: f64) -> Strip {
        let aside = distance * sine;
        let cosine = ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt();
        let across = distance * cosine - ((1.0 - aside) * (1.0 + aside)).max(0.0).sqrt();
        let elevation = |x: f64| (x - origin.x) / libm::hypot(x - origin.x, across);
        Strip { across, sines: [elevation(-self.half_length), elevation(self.half_length)] }
    }

    fn density(half_angle: f64, strip: &Strip) -> f64 {
        1.0 / (2.0 * half_angle * (strip.sines[1] - strip.sines[0]))
    }

    pub(in crate::lighting) fn sample(&self, p: DVec3, [u, v]: [f64; 2]) -> Option<Toward> {
        let origin = self.local(p);
        let (distance, half_angle) = Self::seen(origin)?;
        let gamma = (2.0 * u - 1.0) * half_angle;
        let (sin_gamma, cos_gamma) = (libm::sin(gamma), libm::cos(gamma));
        let strip = self.strip(origin, distance, sin_gamma);
        let sine = strip.sines[0] + v * (strip.sines[1] - strip.sines[0]);
        let cosine = ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt();
        // To the axis, and turned by γ about it.
        let (y, z) = (-origin.y / distance, -origin.z / distance);
        let direction =
            DVec3::new(sine, cosine * (cos_gamma * y - sin_gamma * z), cosine * (sin_gamma * y + cos_gamma * z));
        let image = self.directions.render_from_local * direction;
        let stretch = image.length();
        let along = strip.across / cosine;
        let pdf_solid_angle = self.directions.density(Self::density(half_angle, &strip), stretch);
        let is_usable = along > 0.0 && along.is_finite() && pdf_solid_angle.is_finite();
        is_usable.then_some(Toward { wi: image / stretch, distance: along * stretch, pdf_solid_angle })
    }

    /// Of the direction `wi`, which meets it.
    pub(in crate::lighting) fn pdf(&self, p: DVec3, wi: DVec3) -> f64 {
        let origin = self.local(p);
        let Some((distance, half_angle)) = Self::seen(origin) else { return 0.0 };
        let d = self.directions.local_from_render * wi;
        let sine = (d.y * origin.z - d.z * origin.y) / (distance * libm::hypot(d.y, d.z));
        let strip = self.strip(origin, distance, sine);
        let density = Self::density(half_angle, &strip);
        if density.is_finite() { self.directions.density(density, 1.0 / d.length()) } else { 0.0 }
    }

    /// Distance at which a ray meets it from outside.
    pub(in crate::lighting) fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let o = self.local(origin);
        let distance = libm::hypot(o.y, o.z);
        if distance <= 1.0 {
            return None;
        }
        let d = self.directions.local_from_render * direction;
        let stretch = libm::hypot(d.y, d.z);
        if stretch <= 0.0 {
            return None;
        }
        let (y, z) = (d.y / stretch, d.z / stretch);
        let to_nearest = -(o.y * y + o.z * z);
        let nearest = libm::hypot(o.y + to_nearest * y, o.z + to_nearest * z);
        if to_nearest <= 0.0 || nearest >= 1.0 {
            return None;
        }
        let far = to_nearest + ((1.0 - nearest) * (1.0 + nearest)).sqrt();
        let along = (distance - 1.0) * (distance + 1.0) / far / stretch;
        let is_on_side = (o.x + along * d.x).abs() <= self.half_length;
        (along > 0.0 && is_on_side).then_some(along)
    }
}

/// A line with the radiant intensity of a tube, that nothing meets.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Line {
    center: DVec3,
    half_axis: DVec3,
    /// Half axis × radii: ∫ max(0, n · d) dA = 4 |(P, Q)| with P = p · d.
    sides: [DVec3; 2],
}

impl Line {
    pub(in crate::lighting) fn new(center: DVec3, half_axis: DVec3, radii: [DVec3; 2]) -> Self {
        Self { center, half_axis, sides: radii.map(|radius| half_axis.cross(radius)) }
    }

    pub(in crate::lighting) fn center(&self) -> DVec3 {
        self.center
    }

    pub(in crate::lighting) fn half_extent(&self) -> DVec3 {
        self.half_axis.abs()
    }

    /// A point of it with the angle between the directions to its ends divided evenly, and irradiance at normal incidence
    /// over density there for a radiance of 1 (C. Kulla, M. Fajardo, "Importance sampling techniques for path tracing in
    /// participating media", CGF 31(4), 2012: equi-angular).
    pub(in crate::lighting) fn sample(&self, p: DVec3, u: f64) -> Option<(DVec3, f64, f64)> {
        let half = self.half_axis.length();
        let axis = self.half_axis / half;
        let from = p - self.center;
        let foot = from.dot(axis);
        let across = (from - foot * axis).length();
        if across <= 0.0 {
            return None;
        }
        let [low, high] = [-half, half].map(|x| libm::atan((x - foot) / across));
        let theta = low + u * (high - low);
        let x = foot + across * libm::tan(theta);
        let to = self.center + x * axis - p;
        let distance = to.length();
        let wi = to / distance;
        // dx = across dθ / cos² θ = (distance² / across) dθ; intensity per length over distance² is what arrives.
        let [a, b] = self.sides.map(|side| side.dot(wi));
        let per_length = 4.0 * libm::hypot(a, b) / (2.0 * half);
        let irradiance = per_length * (high - low) / across;
        (irradiance > 0.0 && irradiance.is_finite()).then_some((wi, distance, irradiance))
    }
}
