//! RGB spaces from their primaries, and white points adapted from one to another. All values are linear.
//!
//! Matrices follow from chromaticities by SMPTE RP 177-1993 and are computed, not tabulated: tables are rounded differently
//! everywhere. White points adapt by the linear Bradford transform (K. Lam 1985; ICC.1:2022, annex E.3).

use glam::{DMat3, DVec3};

/// A space of linear R, G, B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RgbSpace {
    /// The name that OpenEXR's `colorInteropID` gives to it.
    pub interop_id: &'static str,
    /// Chromaticities x, y of R, G and B.
    pub primaries: [[f64; 2]; 3],
    /// Chromaticity of (1, 1, 1).
    pub white: [f64; 2],
}

/// Chromaticity of D65 as RGB standards write it.
const D65: [f64; 2] = [0.3127, 0.3290];
/// The white of the ACES spaces, near D60 (SMPTE ST 2065-1:2021).
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];

impl RgbSpace {
    /// Rec. ITU-R BT.709, the primaries of sRGB.
    pub const REC709: Self =
        Self { interop_id: "lin_rec709_scene", primaries: [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]], white: D65 };
    /// Rec. ITU-R BT.2020.
    pub const REC2020: Self = Self {
        interop_id: "lin_rec2020_scene",
        primaries: [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]],
        white: D65,
    };
    /// DCI P3 with the white of a display (SMPTE EG 432-1).
    pub const P3_D65: Self =
        Self { interop_id: "lin_p3d65_scene", primaries: [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]], white: D65 };
    /// ACEScg (S-2014-004).
    pub const ACESCG: Self = Self {
        interop_id: "lin_ap1_scene",
        primaries: [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044]],
        white: ACES_WHITE,
    };
    /// ACES2065-1 (SMPTE ST 2065-1).
    pub const ACES2065_1: Self = Self {
        interop_id: "lin_ap0_scene",
        primaries: [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770]],
        white: ACES_WHITE,
    };

    /// The matrix that makes XYZ of R, G, B; (1, 1, 1) has the chromaticity of the white and Y = 1.
    pub fn xyz_from_rgb(&self) -> DMat3 {
        let [r, g, b] = self.primaries.map(xyz_of);
        let primaries = DMat3::from_cols(r, g, b);
        let scale = primaries.inverse() * xyz_of(self.white);
        primaries * DMat3::from_diagonal(scale)
    }

    /// Its inverse.
    pub fn rgb_from_xyz(&self) -> DMat3 {
        self.xyz_from_rgb().inverse()
    }

    /// The matrix from this space to `other`: what is white in one is white in the other.
    pub fn to(&self, other: &Self) -> DMat3 {
        other.rgb_from_xyz() * adaptation(self.white, other.white) * self.xyz_from_rgb()
    }
}

/// XYZ of a chromaticity at Y = 1.
fn xyz_of([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// The matrix that takes XYZ seen under the white with chromaticity `from` to XYZ seen under `to` (linear Bradford).
pub fn adaptation(from: [f64; 2], to: [f64; 2]) -> DMat3 {
    // Responses of sharpened cones; row by row as Lam has them.
    let cones = DMat3::from_cols(
        DVec3::new(0.8951, -0.7502, 0.0389),
        DVec3::new(0.2664, 1.7135, -0.0685),
        DVec3::new(-0.1614, 0.0367, 1.0296),
    );
    let gain = (cones * xyz_of(to)) / (cones * xyz_of(from));
    cones.inverse() * DMat3::from_diagonal(gain) * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACES: [RgbSpace; 5] =
        [RgbSpace::REC709, RgbSpace::REC2020, RgbSpace::P3_D65, RgbSpace::ACESCG, RgbSpace::ACES2065_1];

    fn is_near(a: DMat3, b: DMat3, tolerance: f64) -> bool {
        a.to_cols_array().iter().zip(b.to_cols_array()).all(|(a, b)| (a - b).abs() <= tolerance)
    }

    #[test]
    fn matrices_are_those_of_the_standards() {
        // IEC 61966-2-1 with four decimals, from its own white; S-2014-004 with ten.
        let srgb = DMat3::from_cols(
            DVec3::new(0.4124, 0.2126, 0.0193),
            DVec3::new(0.3576, 0.7152, 0.1192),
            DVec3::new(0.1805, 0.0722, 0.9505),
        );
        assert!(is_near(RgbSpace::REC709.xyz_from_rgb(), srgb, 6e-5));
        let acescg = DMat3::from_cols(
            DVec3::new(0.662_454_181_1, 0.272_228_716_8, -0.005_574_649_5),
            DVec3::new(0.134_004_206_5, 0.674_081_765_8, 0.004_060_733_5),
            DVec3::new(0.156_187_687_0, 0.053_689_517_4, 1.010_339_100_3),
        );
        assert!(is_near(RgbSpace::ACESCG.xyz_from_rgb(), acescg, 6e-11));
    }

    #[test]
    fn white_stays_white_and_conversions_return() {
        for from in SPACES {
            for to in SPACES {
                let there = from.to(&to);
                assert!((there * DVec3::ONE - DVec3::ONE).length() < 1e-14, "{} to {}", from.interop_id, to.interop_id);
                assert!(is_near(to.to(&from) * there, DMat3::IDENTITY, 1e-13));
            }
        }
    }

    #[test]
    fn rec709_becomes_acescg_as_the_academy_publishes_it() {
        // ACES's own sRGB to ACEScg matrix (aces-dev, Bradford), six decimals.
        let published = DMat3::from_cols(
            DVec3::new(0.613_097, 0.070_194, 0.020_616),
            DVec3::new(0.339_523, 0.916_354, 0.109_570),
            DVec3::new(0.047_379, 0.013_452, 0.869_815),
        );
        assert!(is_near(RgbSpace::REC709.to(&RgbSpace::ACESCG), published, 2e-6));
    }

    #[test]
    fn adaptation_to_itself_is_none() {
        assert!(is_near(adaptation(D65, D65), DMat3::IDENTITY, 1e-15));
    }
}
