//! From a colour that a medium has at some depth to a transmittance at every wavelength.
//!
//! The curve is a sigmoid of a parabola, S(x) = ½ + x / (2√(1 + x²)), x = c₀ + c₁u + c₂u² (W. Jakob, J. Hanika, "A
//! low-dimensional function space for efficient spectral upsampling", CGF 38(2), 2019): smooth, bounded and three numbers
//! for three channels. Here it shapes the optical depth, not the transmittance: −ln T(λ) = 2 max(−ln rgb) S(λ), as pbrt
//! does for extinctions (M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §4.6.6), and then is
//! solved for the colour of T itself. As a transmittance it would be right in colour only: a glass that is nearly white
//! but for a tenth in red would let through a thousandth at 700 nm, where the eye does not look but thickness does.
//!
//! A colour is linear Rec. 709 under D65: channel i of T is ∫ T D65 rᵢ dλ / ∫ D65 rᵢ dλ with rᵢ of [`Rec709`](super::response::Rec709),
//! so that T = 1 is (1, 1, 1) exactly, whatever the white of the responses.

use glam::DVec3;

use super::Wavelength;
use super::fit::{Curve, Fit, inverse_sigmoid, powers, sigmoid, sigmoid_slope};

/// A channel below this counts as this: black has no optical depth. It is a third of the first step above black of an
/// 8-bit sRGB image, so that nothing that was painted is changed.
pub const DARKEST: f64 = 1e-4;

/// A smooth transmittance in (0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmittance {
    /// Optical depth where the sigmoid is 1.
    deepest: f64,
    /// c₀, c₁, c₂, of u = −1 at 360 nm to 1 at 830 nm.
    coefficients: DVec3,
}

impl Transmittance {
    /// The spectrum whose colour is `rgb`, linear Rec. 709 within 0..=1.
    ///
    /// White gives exactly 1 at every wavelength and a grey is exactly constant. Channels below [`DARKEST`] count as it.
    /// The colour comes back to 1e-5 in each channel.
    pub fn of_color(rgb: [f64; 3]) -> Result<Self, String> {
        if let Some(channel) = rgb.iter().find(|channel| !(0.0..=1.0).contains(*channel)) {
            return Err(format!(
                "the colour ({}, {}, {}) has the channel {channel}: what a medium lets through lies between 0 and 1",
                rgb[0], rgb[1], rgb[2]
            ));
        }
        let color = DVec3::from(rgb).max(DVec3::splat(DARKEST));
        // Adding 0 makes the −0 of ln 1 a zero like any other.
        let deepest = 0.0 - 2.0 * libm::log(color.min_element());
        let grey = Self { deepest, coefficients: DVec3::ZERO };
        // S = ½ is the darkest channel: for a grey that is all.
        if color.x.to_bits() == color.y.to_bits() && color.y.to_bits() == color.z.to_bits() {
            return Ok(grey);
        }
        // The sigmoid's inverse at the share of the depth that the grey has: it lies within (0, ½).
        let share = -libm::log(color.element_sum() / 3.0) / deepest;
        let coefficients = Fit::new(transmittance(deepest)).solve(color, inverse_sigmoid(share));
        Ok(Self { deepest, coefficients })
    }

    /// −ln T ≥ 0 at `wavelength`. Outside of 360–830 nm, that of the nearer end.
    pub fn optical_depth(&self, wavelength: Wavelength) -> f64 {
        self.deepest * sigmoid(self.coefficients.dot(powers(wavelength)))
    }

    /// T at `wavelength`.
    pub fn at(&self, wavelength: Wavelength) -> f64 {
        libm::exp(-self.optical_depth(wavelength))
    }
}

/// T = exp(−deepest S(x)) and its slope.
fn transmittance(deepest: f64) -> impl Fn(f64) -> Curve {
    move |x| {
        let value = libm::exp(-deepest * sigmoid(x));
        Curve { value, slope: -deepest * value * sigmoid_slope(x) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::illuminant;
    use crate::spectrum::response::Rec709;

    /// The colour by an integration of its own, in steps of 0.1 nm.
    fn color(spectrum: impl Fn(Wavelength) -> f64) -> DVec3 {
        let responses = Rec709::default();
        let (mut sum, mut white) = (DVec3::ZERO, DVec3::ZERO);
        for step in 0..4700 {
            let wavelength = Wavelength::from_nanometers(360.05 + 0.1 * f64::from(step));
            let weight = responses.at(wavelength) * illuminant::d65(wavelength);
            sum += weight * spectrum(wavelength);
            white += weight;
        }
        sum / white
    }

    fn band() -> impl Iterator<Item = Wavelength> {
        (360..=830).map(|nm| Wavelength::from_nanometers(f64::from(nm)))
    }

    fn grid(levels: &[f64]) -> Vec<[f64; 3]> {
        let mut colors = Vec::new();
        for &r in levels {
            for &g in levels {
                colors.extend(levels.iter().map(|&b| [r, g, b]));
            }
        }
        colors
    }

    #[test]
    fn colors_return() {
        let mut worst = (0.0, [0.0; 3]);
        for rgb in grid(&[0.0, 0.003, 0.05, 0.3, 0.6, 0.9, 0.99, 1.0]) {
            let spectrum = Transmittance::of_color(rgb).unwrap();
            let error = color(|w| spectrum.at(w)) - DVec3::from(rgb).max(DVec3::splat(DARKEST));
            if error.abs().max_element() > worst.0 {
                worst = (error.abs().max_element(), rgb);
            }
        }
        // Measured 7.7e-6: the quadrature of the fit against the one here.
        assert!(worst.0 < 1e-5, "{worst:?}");
    }

    #[test]
    fn the_fit_itself_leaves_nothing() {
        for rgb in grid(&[0.0, 0.003, 0.05, 0.3, 0.6, 0.9, 0.99, 1.0]) {
            let color = DVec3::from(rgb).max(DVec3::splat(DARKEST));
            let spectrum = Transmittance::of_color(rgb).unwrap();
            let residual = Fit::new(transmittance(spectrum.deepest)).trial(spectrum.coefficients, color).residual;
            assert!(residual.abs().max_element() < 1e-14, "{rgb:?}: {residual}");
        }
    }

    #[test]
    fn the_jacobian_is_that_of_the_color() {
        let fit = Fit::new(transmittance(3.0));
        let c = DVec3::new(0.3, -1.2, 2.0);
        let here = fit.trial(c, DVec3::ZERO);
        for i in 0..3 {
            // Fourth order in a step of 1e-3: an error of some 1e-12.
            let at = |h: f64| fit.trial(c + h * DVec3::AXES[i], DVec3::ZERO).residual;
            let difference = (8.0 * (at(1e-3) - at(-1e-3)) - (at(2e-3) - at(-2e-3))) / 12e-3;
            assert!((here.jacobian.col(i) - difference).length() < 1e-10, "column {i}");
        }
    }

    #[test]
    fn white_is_one_and_greys_are_constant() {
        let white = Transmittance::of_color([1.0; 3]).unwrap();
        for grey in [1.0, 0.999, 0.5, 0.1, 1e-3, 0.0] {
            let spectrum = Transmittance::of_color([grey; 3]).unwrap();
            let expected = -libm::log(f64::max(grey, DARKEST));
            for wavelength in band() {
                assert_eq!(white.at(wavelength).to_bits(), 1.0f64.to_bits());
                assert!((spectrum.optical_depth(wavelength) - expected).abs() <= f64::EPSILON * expected, "{grey}");
            }
        }
    }

    #[test]
    fn near_greys_are_near_constant() {
        for tiny in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
            let spectrum = Transmittance::of_color([0.5, 0.5 + tiny, 0.5 - tiny]).unwrap();
            for wavelength in band() {
                // The steepest spectrum of the hues moves by some tens of its colour's difference.
                assert!((spectrum.at(wavelength) - 0.5).abs() < 50.0 * tiny + 1e-14, "{tiny} at {wavelength}");
            }
        }
    }

    #[test]
    fn every_color_stays_within_zero_and_one_and_is_smooth() {
        for rgb in grid(&[0.0, 1e-4, 0.01, 0.2, 0.5, 0.8, 0.99, 1.0]) {
            let spectrum = Transmittance::of_color(rgb).unwrap();
            let darkest = rgb.iter().fold(1.0, |a: f64, &b| a.min(b)).max(DARKEST);
            let mut turns = 0;
            let values: Vec<f64> = band().map(|w| spectrum.at(w)).collect();
            for value in &values {
                // S < 1: never darker than the square of the darkest channel.
                assert!((darkest * darkest * (1.0 - 1e-13)..=1.0).contains(value), "{rgb:?}: {value}");
            }
            for window in values.windows(3) {
                turns += u32::from((window[1] - window[0]) * (window[2] - window[1]) < 0.0);
            }
            assert!(turns <= 1, "{rgb:?}: a parabola turns once, this {turns} times");
        }
    }

    #[test]
    fn less_light_is_less_at_every_wavelength_of_a_grey_and_not_much_more_at_any_of_a_hue() {
        for rgb in grid(&[0.01, 0.5, 1.0]) {
            let is_grey = rgb.iter().all(|c| c.to_bits() == rgb[0].to_bits());
            let mut above = Transmittance::of_color(rgb).unwrap();
            for scale in [0.9, 0.6, 0.3] {
                let spectrum = Transmittance::of_color(rgb.map(|c| scale * c)).unwrap();
                let gain = band().map(|w| spectrum.at(w) - above.at(w)).fold(f64::NEG_INFINITY, f64::max);
                if is_grey {
                    assert!(gain < 0.0, "{rgb:?} × {scale}");
                }
                // Three numbers cannot keep a pure hue and lose light everywhere: its flanks move. Measured 0.30, in a step of cyan.
                assert!(gain < 0.35, "{rgb:?} × {scale} gains {gain}");
                above = spectrum;
            }
        }
    }

    #[test]
    fn a_slight_tint_stays_slight_where_the_eye_does_not_look() {
        // First order in the tint: −ln T ≤ 2 max(−ln rgb).
        for rgb in [[0.9, 1.0, 0.95], [0.99, 1.0, 1.0], [1.0, 0.95, 1.0], [1.0, 1.0, 0.9]] {
            let spectrum = Transmittance::of_color(rgb).unwrap();
            assert!(band().all(|w| spectrum.at(w) > 0.8), "{rgb:?}");
        }
    }

    #[test]
    fn no_other_colors() {
        for rgb in [[1.1, 0.5, 0.5], [0.5, -0.1, 0.5], [0.5, 0.5, f64::NAN], [f64::INFINITY, 1.0, 1.0]] {
            assert!(Transmittance::of_color(rgb).unwrap_err().contains("between 0 and 1"), "{rgb:?}");
        }
    }

    #[test]
    fn the_sigmoid_is_exact_far_out() {
        // 1/(4x²) to leading order.
        for x in [-1e4, -1e8, -1e150] {
            assert!((sigmoid(x) * 4.0 * x * x - 1.0).abs() < 1e-7, "{x}");
            assert!((sigmoid(-x) - 1.0).abs() < 1e-8);
        }
        assert_eq!(sigmoid(0.0).to_bits(), 0.5f64.to_bits());
        assert!((sigmoid(1.0) + sigmoid(-1.0) - 1.0).abs() < f64::EPSILON);
    }
}
