//! From radiance at the wavelengths of a path to the colour of a pixel.
//!
//! X, Y, Z = ∫ L x̄ dλ, ∫ L ȳ dλ, ∫ L z̄ dλ with L per nm and the CIE 1931 2° observer, without K_m: L = D65 scaled to
//! ∫ L ȳ dλ = 1 is what an emission of RGB (1, 1, 1) means. Each integral is estimated by the mean of L·x̄/p over the path's
//! wavelengths.
//!
//! R, G, B are linear combinations of X, Y, Z, and are stored as they come: a spectral colour outside the gamut has negative
//! components, which are kept. Clipping them would be wrong in the mean of a pixel, and the next conversion (to a wider
//! space, say) could not undo it.
//!
//! Rec. 709 here has its standard's primaries and, as its white, the chromaticity of the D65 *spectrum*, of which the standard's
//! (0.3127, 0.3290) is a rounding: so the spectrum of white is (1, 1, 1) to rounding, not to 2.5e-4. Every other space follows from it by
//! [`RgbSpace::to`]: white stays white, adapted by Bradford where the white point is another.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::color::RgbSpace;
use super::observer::{self, color_matching};
use super::sampled::{SampledSpectrum, Wavelengths};
use super::{illuminant, response::Rec709};

/// ∫ D65 ȳ dλ of the table that is 100 at 560 nm: what emission is divided by.
static D65_LUMINANCE: LazyLock<f64> = LazyLock::new(|| observer::tristimulus_integral(illuminant::d65)[1]);

/// D65 per nm with Y = 1: the spectrum that an emission of RGB (1, 1, 1) has. Outside of 360–830 nm, that of the nearer end.
pub fn white(wavelength: super::Wavelength) -> f64 {
    illuminant::d65(wavelength) / *D65_LUMINANCE
}

/// Estimate of X, Y, Z of `radiance`, per nm at `wavelengths`.
#[inline]
pub fn xyz<const N: usize>(radiance: SampledSpectrum<N>, wavelengths: &Wavelengths<N>) -> DVec3 {
    let pdf_lambda = wavelengths.pdf_lambda();
    let mut sum = DVec3::ZERO;
    for lane in 0..N {
        if radiance[lane] != 0.0 {
            let weight = f64::from(radiance[lane]) / f64::from(pdf_lambda[lane]);
            sum += weight * DVec3::from(color_matching(wavelengths.lane(lane)));
        }
    }
    sum / N as f64
}

/// What the numbers of a colour mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColorSpace {
    /// X, Y, Z themselves; D65 is about (0.9504, 1, 1.0888).
    Xyz,
    /// Linear R, G, B.
    Rgb(RgbSpace),
}

impl ColorSpace {
    /// Names by which a stage can ask for a space, OpenEXR's `colorInteropID` and OpenColorIO's common ones.
    pub const TOKENS: &[&str] = &["lin_rec709_scene", "lin_ap1_scene", "lin_ciexyzd65_scene"];

    /// The space of `token`, by its `colorInteropID` or another name that is common for it.
    pub fn from_token(token: &str) -> Option<Self> {
        Some(Self::Rgb(match token {
            "lin_rec709_scene" | "lin_rec709" | "Linear Rec.709 (sRGB)" | "lin_srgb" | "scene_linear" => {
                RgbSpace::REC709
            }
            "lin_ap1_scene" | "lin_ap1" | "ACEScg" | "acescg" => RgbSpace::ACESCG,
            "lin_ap0_scene" | "lin_ap0" | "ACES2065-1" => RgbSpace::ACES2065_1,
            "lin_rec2020_scene" | "lin_rec2020" | "Linear Rec.2020" => RgbSpace::REC2020,
            "lin_p3d65_scene" | "lin_p3d65" | "Linear P3-D65" => RgbSpace::P3_D65,
            "lin_adobergb_scene" | "lin_adobergb" | "Linear AdobeRGB" => RgbSpace::ADOBE_RGB,
            "lin_ciexyzd65_scene" | "lin_ciexyzd65" | "CIE-XYZ-D65" | "XYZ" => return Some(Self::Xyz),
            _ => return None,
        }))
    }

    /// The name of `colorInteropID`.
    pub fn interop_id(&self) -> &'static str {
        match self {
            Self::Xyz => "lin_ciexyzd65_scene",
            Self::Rgb(space) => space.interop_id,
        }
    }

    /// CIE x, y of the primaries R, G, B and of white, for a header.
    pub fn chromaticities(&self) -> [[f64; 2]; 4] {
        match self {
            Self::Xyz => [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0; 2]],
            Self::Rgb(RgbSpace { primaries: [r, g, b], white, .. }) => [*r, *g, *b, *white],
        }
    }

    /// The matrix from [`xyz`] to the numbers of this space.
    pub fn from_xyz(&self) -> DMat3 {
        match self {
            Self::Xyz => DMat3::IDENTITY,
            Self::Rgb(space) => RgbSpace::REC709.to(space) * rec709_from_xyz(),
        }
    }
}

/// Each channel of Rec. 709 divided by what it is for [`white`].
fn rec709_from_xyz() -> DMat3 {
    let standard = RgbSpace::REC709.rgb_from_xyz();
    let white = standard * DVec3::from(observer::tristimulus_integral(white));
    DMat3::from_diagonal(1.0 / white) * standard
}

/// The responses of R, G, B that [`ColorSpace::from_xyz`] of Rec. 709 has: ∫ white · response dλ = 1 in each channel.
pub fn rec709(wavelength: super::Wavelength) -> DVec3 {
    static SCALE: LazyLock<DVec3> =
        LazyLock::new(|| 1.0 / (RgbSpace::REC709.rgb_from_xyz() * DVec3::from(observer::tristimulus_integral(white))));
    *SCALE * Rec709::default().at(wavelength)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Wavelength, visible};

    #[test]
    fn white_is_one_in_every_rgb_space() {
        let white = DVec3::from(observer::tristimulus_integral(white));
        assert!((white.y - 1.0).abs() < 1e-14);
        for token in ["lin_rec709_scene", "lin_ap1_scene", "lin_ap0_scene", "lin_rec2020_scene", "lin_p3d65_scene"] {
            let space = ColorSpace::from_token(token).unwrap();
            assert_eq!(space.interop_id(), token);
            assert!((space.from_xyz() * white - DVec3::ONE).length() < 1e-13, "{token}");
        }
        assert_eq!(ColorSpace::from_token("XYZ"), Some(ColorSpace::Xyz));
        assert_eq!(ColorSpace::from_token("srgb_texture"), None);
    }

    #[test]
    fn rec709_is_the_standards_but_for_the_rounding_of_its_white() {
        let ours = ColorSpace::Rgb(RgbSpace::REC709).from_xyz();
        let standard = RgbSpace::REC709.rgb_from_xyz();
        for (a, b) in ours.to_cols_array().into_iter().zip(standard.to_cols_array()) {
            assert!((a / b - 1.0).abs() < 3e-4, "{a} {b}");
        }
    }

    #[test]
    fn the_estimate_has_the_integral_as_its_mean() {
        // A stratified mean over many heroes is a quadrature: linear spectra come out to its order.
        let spectrum = |nm: f64| 0.2 + 1e-3 * nm;
        let wanted = DVec3::from(observer::tristimulus_integral(|w| spectrum(w.nanometers())));
        let count = 20_000;
        let mut sum = DVec3::ZERO;
        for i in 0..count {
            let wavelengths = visible::sample::<4>((f64::from(i) + 0.5) / f64::from(count) / 4.0);
            let radiance = SampledSpectrum::from_fn(|lane| spectrum(wavelengths.nanometers()[lane]) as f32);
            sum += xyz(radiance, &wavelengths);
        }
        let found = sum / f64::from(count);
        assert!(((found - wanted) / wanted).abs().max_element() < 1e-5, "{found} {wanted}");
        let nm = Wavelength::from_nanometers(555.0);
        let by_matrix = ColorSpace::Rgb(RgbSpace::REC709).from_xyz() * DVec3::from(color_matching(nm));
        assert!((rec709(nm) - by_matrix).length() < 1e-14);
    }
}
