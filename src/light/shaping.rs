//! Where the emission of a light goes: focus, cone and profile of UsdLuxShapingAPI.
//!
//! The formulas are those that the schema's documentation states; the axis is the light's −z, and directions are taken in the
//! light's own space, as hdEmbree of OpenUSD does. The schema says that a normalised profile is multiplied by its power,
//! which would square it; hdEmbree divides, and so does this.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;

use super::ies::Profile;

/// What a light's emission is multiplied by, by its direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Shaping {
    /// Exponent of the cosine to the axis; 0 for none.
    pub focus: f64,
    /// What stays of the colour where the focus takes it.
    pub focus_tint: [f64; 3],
    /// Beyond this angle to the axis there is no light, radians.
    pub cone_angle: f64,
    /// Part of the cone, from its edge inwards, over which light fades: 0..=1.
    pub cone_softness: f64,
    /// Photometric profile.
    pub profile: Option<ShapingProfile>,
}

/// A profile with its controls.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapingProfile {
    /// The profile.
    pub profile: Arc<Profile>,
    /// Scale of its angles to the axis: from the nadir if positive, from the zenith if negative; 0 leaves them.
    pub angle_scale: f64,
    /// What the intensities are multiplied by.
    pub factor: f64,
}

impl ShapingProfile {
    /// `is_normalized`: the mean intensity becomes 1.
    pub fn new(profile: Arc<Profile>, angle_scale: f64, is_normalized: bool) -> Self {
        let mean = profile.mean();
        let factor = match is_normalized {
            false => 1.0,
            true if mean > 0.0 => 1.0 / mean,
            true => 0.0,
        };
        Self { profile, angle_scale, factor }
    }

    fn weight(&self, d: DVec3) -> f64 {
        let scaled = if self.angle_scale.to_bits() & !(1 << 63) == 0 { d } else { self.scaled(d) };
        self.factor * self.profile.intensity(scaled)
    }

    /// The direction whose intensity counts for `d` (UsdLux, `inputs:shaping:ies:angleScale`).
    fn scaled(&self, d: DVec3) -> DVec3 {
        let theta = libm::acos((-d.z).clamp(-1.0, 1.0));
        let scale = self.angle_scale;
        let theta = if scale > 0.0 { theta / scale } else { (theta - PI) / -scale + PI };
        let theta = theta.clamp(0.0, PI);
        let across = libm::hypot(d.x, d.y);
        let (x, y) = if across > 0.0 { (d.x / across, d.y / across) } else { (1.0, 0.0) };
        let (sine, cosine) = (libm::sin(theta), libm::cos(theta));
        DVec3::new(sine * x, sine * y, -cosine)
    }
}

impl Shaping {
    /// What the emission in direction `d` is multiplied by; `d` is a unit vector of travel in the light's space.
    pub fn weight(&self, d: DVec3) -> [f64; 3] {
        let cosine = (-d.z).clamp(-1.0, 1.0);
        let cone = self.cone(libm::acos(cosine));
        if cone <= 0.0 {
            return [0.0; 3];
        }
        let level = cone * self.profile.as_ref().map_or(1.0, |profile| profile.weight(d));
        if self.focus <= 0.0 {
            return [level; 3];
        }
        let focus = libm::pow(cosine.abs(), self.focus);
        self.focus_tint.map(|tint| level * (tint + focus * (1.0 - tint)))
    }

    /// 1 within the cone, 0 beyond its angle, smooth between.
    fn cone(&self, angle: f64) -> f64 {
        let start = self.cone_angle * (1.0 - self.cone_softness);
        if angle <= start {
            1.0
        } else if angle > self.cone_angle {
            0.0
        } else {
            let t = (angle - start) / (self.cone_angle - start);
            1.0 - t * t * (3.0 - 2.0 * t)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open() -> Shaping {
        Shaping { focus: 0.0, focus_tint: [0.0; 3], cone_angle: PI, cone_softness: 0.0, profile: None }
    }

    /// At an angle to the axis, radians.
    fn at(theta: f64) -> DVec3 {
        DVec3::new(0.6 * theta.sin(), 0.8 * theta.sin(), -theta.cos())
    }

    /// ∫ weight dω, of what is round about the axis.
    fn integral(shaping: &Shaping) -> f64 {
        let steps = 200_000;
        (0..steps)
            .map(|i| PI * (f64::from(i) + 0.5) / f64::from(steps))
            .map(|theta| 2.0 * PI * theta.sin() * shaping.weight(at(theta))[0] * PI / f64::from(steps))
            .sum()
    }

    #[test]
    fn integrals_are_closed_forms() {
        let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-4, "{found}, {expected}");
        close(integral(&open()), 4.0 * PI);
        let cone_angle = 0.7;
        close(integral(&Shaping { cone_angle, ..open() }), 2.0 * PI * (1.0 - cone_angle.cos()));
        // ∫ |cos|^n dω = 4π/(n + 1).
        for focus in [0.5, 1.0, 7.0] {
            close(integral(&Shaping { focus, ..open() }), 4.0 * PI / (focus + 1.0));
        }
        // A cone that is soft all over: ∫ (1 − 3t² + 2t³) sin(at) a dt · 2π from 0 to 1 = 2π (1 − 12/a² − ...), by parts:
        // 1 + 6 sin(a)/a³·… is left to the quadrature; here, small angles: 2π a² (½ − ¾ + ⅖) = 2π a² · 3/20.
        let cone_angle = 1e-3;
        let soft = Shaping { cone_angle, cone_softness: 1.0, ..open() };
        let steps = 10_000;
        let sum: f64 = (0..steps)
            .map(|i| cone_angle * (f64::from(i) + 0.5) / f64::from(steps))
            .map(|theta| 2.0 * PI * theta.sin() * soft.weight(at(theta))[0] * cone_angle / f64::from(steps))
            .sum();
        close(sum, 2.0 * PI * cone_angle * cone_angle * 3.0 / 20.0);
    }

    #[test]
    fn a_hard_cone_is_lit_up_to_its_edge() {
        let shaping = Shaping { cone_angle: 0.5, ..open() };
        let is =
            |shaping: &Shaping, d: DVec3, weight: f64| shaping.weight(d).map(f64::to_bits) == [weight.to_bits(); 3];
        assert!(is(&shaping, at(0.499_999), 1.0) && is(&shaping, at(0.500_001), 0.0) && is(&open(), DVec3::Z, 1.0));
    }

    #[test]
    fn white_tint_disables_focus() {
        let shaping = Shaping { focus: 9.0, focus_tint: [1.0, 0.5, 0.0], ..open() };
        let [r, g, b] = shaping.weight(at(1.2));
        let power = 1.2f64.cos().powf(9.0);
        assert!((r - 1.0).abs() < 1e-12 && (g - 0.5 * (1.0 + power)).abs() < 1e-12 && (b - power).abs() < 1e-12);
        // Behind the light as in front of it.
        assert!((shaping.weight(at(PI - 1.2))[2] - power).abs() < 1e-12);
    }

    #[test]
    fn profiles_are_scaled_and_normalised() {
        let text = "TILT=NONE\n1 1 1 4 1 1 1 0 0 0 1 1 1\n0 30 31 180\n0\n8 8 0 0\n";
        let profile = Arc::new(Profile::parse(text.as_bytes()).unwrap());
        let shaped = |angle_scale, is_normalized| Shaping {
            profile: Some(ShapingProfile::new(Arc::clone(&profile), angle_scale, is_normalized)),
            ..open()
        };
        let weight = |scale: f64, angle: f64| shaped(scale, false).weight(at(angle.to_radians()))[0];
        let assert_edge = |scale: f64, lit: f64, dark: f64| {
            assert!((weight(scale, lit) - 8.0).abs() < 1e-12 && weight(scale, dark) < 1e-12, "{scale}");
        };
        assert_edge(0.0, 29.0, 32.0);
        // Half the angles: narrower. Twice: broader.
        assert_edge(0.5, 14.0, 16.0);
        assert_edge(2.0, 59.0, 63.0);
        // From the other end: 30° from the nadir are 150° from the zenith, and half of that is 75°.
        assert_edge(-0.5, 104.0, 106.0);
        // The mean over the sphere is 1.
        assert!((integral(&shaped(0.0, true)) / (4.0 * PI) - 1.0).abs() < 1e-4);
    }
}
