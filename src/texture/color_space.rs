//! What the numbers of an image mean: the colour spaces that USD and MaterialX name, and the way from them to linear Rec. 709.
//!
//! A space is a transfer function and primaries with a white point. Names: USD's `GfColorSpaceNames` (of the Color Interop
//! Forum), MaterialX' `cmlib`, the aliases of OpenColorIO's ACES configurations, and UsdPreviewSurface's `raw` and `sRGB`.
//! White points adapt by Bradford (as published by B. Lindbloom). What has no colour (`raw`, `data`) stays as it is.

use glam::DMat3;

use crate::spectrum::color::RgbSpace;

/// From stored numbers to linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// They are linear.
    Linear,
    /// A pure power.
    Gamma(f32),
    /// IEC 61966-2-1.
    Srgb,
}

impl Transfer {
    /// Linear light of a stored number; negative ones are mirrored.
    pub fn linear(self, x: f32) -> f32 {
        match self {
            Self::Linear => x,
            Self::Gamma(gamma) => libm::powf(x.abs(), gamma).copysign(x),
            Self::Srgb => {
                let a = x.abs();
                let y = if a <= 0.04045 { a / 12.92 } else { libm::powf((a + 0.055) / 1.055, 2.4) };
                y.copysign(x)
            }
        }
    }
}

/// A colour space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorSpace {
    /// From stored numbers to linear light in the space's own primaries.
    pub transfer: Transfer,
    /// From its primaries to those of Rec. 709, rows; `None` where they are the same, or where the numbers are no colours.
    pub to_rec709: Option<[[f32; 3]; 3]>,
}

/// The exponent of Adobe RGB (1998): 2 + 51/256.
const ADOBE_GAMMA: f32 = 2.199_218_8;

impl ColorSpace {
    /// Numbers that are used as they are.
    pub const RAW: Self = Self { transfer: Transfer::Linear, to_rec709: None };
    /// sRGB as images have it.
    pub const SRGB: Self = Self { transfer: Transfer::Srgb, to_rec709: None };

    /// The space with a name, whatever its case; `None` where the name is not known.
    pub fn named(name: &str) -> Option<Self> {
        use Transfer::{Gamma, Linear, Srgb};
        let name = name.trim().to_ascii_lowercase();
        // USD's names say that they are of scenes, and mean the same.
        let name = name.strip_suffix("_scene").unwrap_or(&name);
        let (transfer, space) = match name {
            "" | "raw" | "data" | "none" | "identity" | "unknown" | "utility - raw" | "non-color" => {
                return Some(Self::RAW);
            }
            "srgb"
            | "srgb_texture"
            | "srgb_tx"
            | "srgb_rec709"
            | "srgb - texture"
            | "utility - srgb - texture"
            | "srgb encoded rec.709 (srgb)" => (Srgb, RgbSpace::REC709),
            "lin_rec709"
            | "lin_srgb"
            | "lin_rec709_srgb"
            | "linear"
            | "scene-linear rec.709-srgb"
            | "linear rec.709 (srgb)"
            | "utility - linear - srgb"
            | "utility - linear - rec.709" => (Linear, RgbSpace::REC709),
            "g18_rec709" | "gamma 1.8 rec.709 - texture" => (Gamma(1.8), RgbSpace::REC709),
            "g22_rec709" | "gamma 2.2 rec.709 - texture" => (Gamma(2.2), RgbSpace::REC709),
            "g24_rec709" | "rec709_display" | "gamma 2.4 rec.709 - texture" => (Gamma(2.4), RgbSpace::REC709),
            "acescg" | "lin_ap1" | "aces - acescg" => (Linear, RgbSpace::ACESCG),
            "g22_ap1" | "gamma 2.2 ap1 - texture" => (Gamma(2.2), RgbSpace::ACESCG),
            "srgb_ap1" | "srgb encoded ap1 - texture" => (Srgb, RgbSpace::ACESCG),
            "aces2065-1" | "aces2065_1" | "lin_ap0" | "aces - aces2065-1" => (Linear, RgbSpace::ACES2065_1),
            "lin_p3d65" | "lin_displayp3" | "linear p3-d65" => (Linear, RgbSpace::P3_D65),
            "srgb_p3d65" | "srgb_displayp3" => (Srgb, RgbSpace::P3_D65),
            "lin_rec2020" | "linear rec.2020" => (Linear, RgbSpace::REC2020),
            "lin_adobergb" | "linear adobergb" => (Linear, RgbSpace::ADOBE_RGB),
            "adobergb" | "g22_adobergb" => (Gamma(ADOBE_GAMMA), RgbSpace::ADOBE_RGB),
            "lin_ciexyzd65" => {
                return Some(Self { transfer: Linear, to_rec709: Some(rows(RgbSpace::REC709.rgb_from_xyz())) });
            }
            _ => return None,
        };
        Some(Self { transfer, to_rec709: (space != RgbSpace::REC709).then(|| rows(space.to(&RgbSpace::REC709))) })
    }

    /// Linear Rec. 709 of a stored colour.
    pub fn linear(&self, rgb: [f32; 3]) -> [f32; 3] {
        self.primaries(rgb.map(|x| self.transfer.linear(x)))
    }

    /// Rec. 709 of linear light in the space's own primaries.
    pub fn primaries(&self, rgb: [f32; 3]) -> [f32; 3] {
        match &self.to_rec709 {
            None => rgb,
            Some(rows) => rows.map(|[r, g, b]| r * rgb[0] + g * rgb[1] + b * rgb[2]),
        }
    }
}

fn rows(matrix: DMat3) -> [[f32; 3]; 3] {
    matrix.transpose().to_cols_array_2d().map(|row| row.map(|x| x as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: [f32; 3], b: [f32; 3], tolerance: f32) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance), "{a:?} is not {b:?}");
    }

    #[test]
    fn white_stays_white_in_every_space_of_colours() {
        for name in ["acescg", "lin_ap0", "srgb_texture", "g22_ap1", "lin_p3d65", "lin_rec2020", "adobergb", "lin_srgb"]
        {
            near(ColorSpace::named(name).unwrap().linear([1.0; 3]), [1.0; 3], 1e-6);
        }
    }

    #[test]
    fn aces_primaries_come_to_the_published_matrix() {
        // ACEScg to Rec. 709 of the ACES configurations for OpenColorIO (Bradford), rounded there to ten digits.
        let published = [
            [1.705_051, -0.621_792_1, -0.083_258_9],
            [-0.130_256_4, 1.140_804_7, -0.010_548_3],
            [-0.024_003_4, -0.128_969, 1.152_972_4],
        ];
        let rows = ColorSpace::named("ACEScg").unwrap().to_rec709.unwrap();
        rows.into_iter().zip(published).for_each(|(row, published)| near(row, published, 2e-6));
    }

    #[test]
    fn srgb_is_that_of_the_standard() {
        let middle = ColorSpace::SRGB.linear([0.5, 0.04045, 0.0]);
        near(middle, [0.214_041_14, 0.003_130_8, 0.0], 1e-7);
    }

    #[test]
    fn names_of_usd_and_of_materialx_mean_the_same() {
        for (usd, materialx) in
            [("srgb_rec709_scene", "srgb_texture"), ("lin_ap1_scene", "acescg"), ("g22_rec709_scene", "g22_rec709")]
        {
            assert_eq!(ColorSpace::named(usd), ColorSpace::named(materialx));
        }
        assert_eq!(ColorSpace::named("arri_logc4"), None);
    }
}
