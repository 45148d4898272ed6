//! Wavelengths importance-sampled for the eye.
//!
//! p(λ) = 0.0039398042 / cosh²(0.0072 (λ − 538)) on 360–830 nm (M. Pharr, W. Jakob, G. Humphreys, *Physically Based
//! Rendering*, 4th ed. 2023, §4.5.4). The hero comes from one number of the sampler, stratified over a pixel's samples; the companions
//! divide the rest of the unit interval evenly.

use super::sampled::Wavelengths;

/// Wavelength, nm, at which the share `u` of the density lies below.
fn inverse(u: f64) -> f64 {
    538.0 - 138.888_889 * libm::atanh(0.856_910_62 - 1.827_501_97 * u)
}

/// Density at `nm`, per nm; 0 outside 360–830 nm.
pub fn pdf_lambda(nm: f64) -> f64 {
    if !(360.0..=830.0).contains(&nm) {
        return 0.0;
    }
    let cosh = libm::cosh(0.0072 * (nm - 538.0));
    0.003_939_804_2 / (cosh * cosh)
}

/// Wavelengths for the hero's place `u` in 0..1.
pub fn sample<const N: usize>(u: f64) -> Wavelengths<N> {
    let nanometers = std::array::from_fn(|lane| {
        let place = u + lane as f64 / N as f64;
        inverse(if place >= 1.0 { place - 1.0 } else { place }).clamp(360.0, 830.0)
    });
    Wavelengths { nanometers, pdf_lambda: nanometers.map(|nm| pdf_lambda(nm) as f32) }
}
