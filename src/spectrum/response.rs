//! How the channels of an image respond to wavelength.

use glam::{DMat3, DVec3};

use super::color::RgbSpace;
use super::observer::color_matching;
use super::{LONGEST, SHORTEST, Wavelength};

/// Where the R, G and B channels of a Rec. 709 image look: the centroids of the positive parts of their responses, in
/// 360–830 nm. The wavelengths of `dispersion_r`, `_g`, `_b` unless settings say otherwise.
///
/// [`centroids`] computes them; a test compares.
pub const CENTROIDS: [Wavelength; 3] = [
    Wavelength::from_nanometers(602.406_142_034),
    Wavelength::from_nanometers(540.492_354_904),
    Wavelength::from_nanometers(451.773_696_637),
];

/// Responses of the R, G, B channels of a Rec. 709 image (linear, D65); negative where the light lies outside the gamut.
#[derive(Clone, Copy, Debug)]
pub struct Rec709 {
    rgb_from_xyz: DMat3,
}

impl Default for Rec709 {
    fn default() -> Self {
        Self { rgb_from_xyz: RgbSpace::REC709.rgb_from_xyz() }
    }
}

impl Rec709 {
    /// At `wavelength`.
    pub fn at(&self, wavelength: Wavelength) -> DVec3 {
        self.rgb_from_xyz * DVec3::from(color_matching(wavelength))
    }
}

/// The values of [`CENTROIDS`], by the midpoint rule with steps of 0.1 nm.
pub fn centroids() -> [Wavelength; 3] {
    const STEPS_PER_NM: f64 = 10.0;
    let steps = ((LONGEST.nanometers() - SHORTEST.nanometers()) * STEPS_PER_NM) as u32;
    let responses = Rec709::default();
    let (mut weight, mut moment) = ([0.0; 3], [0.0; 3]);
    for step in 0..steps {
        let nm = SHORTEST.nanometers() + (f64::from(step) + 0.5) / STEPS_PER_NM;
        for (channel, response) in responses.at(Wavelength::from_nanometers(nm)).to_array().into_iter().enumerate() {
            weight[channel] += response.max(0.0);
            moment[channel] += response.max(0.0) * nm;
        }
    }
    std::array::from_fn(|channel| Wavelength::from_nanometers(moment[channel] / weight[channel]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centroids_are_those_of_the_responses() {
        for (constant, computed) in CENTROIDS.into_iter().zip(centroids()) {
            // The constants stand with nine decimals.
            assert!((constant.nanometers() - computed.nanometers()).abs() < 1e-9, "{constant} {computed}");
        }
    }
}
