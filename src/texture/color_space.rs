//! What the numbers of an image mean: the colour spaces that USD and MaterialX name, and the way from them to linear Rec. 709.
//!
//! A space is a transfer function and primaries with a white point. Names: USD's `GfColorSpaceNames` (of the Color Interop
//! Forum), MaterialX' `cmlib`, the aliases of OpenColorIO's ACES configurations, and UsdPreviewSurface's `raw` and `sRGB`.
//! White points adapt by Bradford (as published by B. Lindbloom). What has no colour (`raw`, `data`) stays as it is.

use glam::{DMat3, DVec3};

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

/// CIE xy of red, green, blue and white.
type Chromaticities = [[f64; 2]; 4];

const D65: [f64; 2] = [0.3127, 0.3290];
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];
/// ITU-R BT.709.
const REC709: Chromaticities = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65];
/// SMPTE ST 2065-1.
const AP0: Chromaticities = [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], ACES_WHITE];
/// S-2014-004, ACEScg.
const AP1: Chromaticities = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE];
/// SMPTE EG 432-1 with the white of D65.
const P3: Chromaticities = [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65];
/// ITU-R BT.2020.
const REC2020: Chromaticities = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65];
/// Adobe RGB (1998), whose exponent is 2 + 51/256.
const ADOBE_RGB: Chromaticities = [[0.64, 0.33], [0.21, 0.71], [0.15, 0.06], D65];
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
        let (transfer, primaries) = match name {
            "" | "raw" | "data" | "none" | "identity" | "unknown" | "utility - raw" | "non-color" => {
                return Some(Self::RAW);
            }
            "srgb"
            | "srgb_texture"
            | "srgb_tx"
            | "srgb_rec709"
            | "srgb - texture"
            | "utility - srgb - texture"
            | "srgb encoded rec.709 (srgb)" => (Srgb, REC709),
            "lin_rec709"
            | "lin_srgb"
            | "lin_rec709_srgb"
            | "linear"
            | "scene-linear rec.709-srgb"
            | "linear rec.709 (srgb)"
            | "utility - linear - srgb"
            | "utility - linear - rec.709" => (Linear, REC709),
            "g18_rec709" | "gamma 1.8 rec.709 - texture" => (Gamma(1.8), REC709),
            "g22_rec709" | "gamma 2.2 rec.709 - texture" => (Gamma(2.2), REC709),
            "g24_rec709" | "rec709_display" | "gamma 2.4 rec.709 - texture" => (Gamma(2.4), REC709),
            "acescg" | "lin_ap1" | "aces - acescg" => (Linear, AP1),
            "g22_ap1" | "gamma 2.2 ap1 - texture" => (Gamma(2.2), AP1),
            "srgb_ap1" | "srgb encoded ap1 - texture" => (Srgb, AP1),
            "aces2065-1" | "aces2065_1" | "lin_ap0" | "aces - aces2065-1" => (Linear, AP0),
            "lin_p3d65" | "lin_displayp3" | "linear p3-d65" => (Linear, P3),
            "srgb_p3d65" | "srgb_displayp3" => (Srgb, P3),
            "lin_rec2020" | "linear rec.2020" => (Linear, REC2020),
            "lin_adobergb" | "linear adobergb" => (Linear, ADOBE_RGB),
            "adobergb" | "g22_adobergb" => (Gamma(ADOBE_GAMMA), ADOBE_RGB),
            "lin_ciexyzd65" => {
                return Some(Self { transfer: Linear, to_rec709: Some(rows(xyz_from(REC709).inverse())) });
            }
            _ => return None,
        };
        Some(Self { transfer, to_rec709: (primaries != REC709).then(|| to_rec709(primaries)) })
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

fn to_rec709(primaries: Chromaticities) -> [[f32; 3]; 3] {
    rows(xyz_from(REC709).inverse() * bradford(primaries[3], D65) * xyz_from(primaries))
}

fn rows(matrix: DMat3) -> [[f32; 3]; 3] {
    matrix.transpose().to_cols_array_2d().map(|row| row.map(|x| x as f32))
}

fn xyz_of([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// XYZ with Y = 1 for white.
fn xyz_from([r, g, b, white]: Chromaticities) -> DMat3 {
    // Not divided by y, which is 0 for no primary here but negative for one.
    let column = |[x, y]: [f64; 2]| DVec3::new(x, y, 1.0 - x - y);
    let directions = DMat3::from_cols(column(r), column(g), column(b));
    let scale = directions.inverse() * xyz_of(white);
    directions * DMat3::from_diagonal(scale)
}

fn bradford(from: [f64; 2], to: [f64; 2]) -> DMat3 {
    if from.map(f64::to_bits) == to.map(f64::to_bits) {
        return DMat3::IDENTITY;
    }
    let cone = DMat3::from_cols(
        DVec3::new(0.8951, -0.7502, 0.0389),
        DVec3::new(0.2664, 1.7135, -0.0685),
        DVec3::new(-0.1614, 0.0367, 1.0296),
    );
    cone.inverse() * DMat3::from_diagonal((cone * xyz_of(to)) / (cone * xyz_of(from))) * cone
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
