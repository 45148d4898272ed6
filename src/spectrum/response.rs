//! How the channels of an image respond to wavelength.
//!
//! CIE 1931 2° colour-matching functions by the multi-lobe fit of C. Wyman, P.-P. Sloan, P. Shirley, "Simple analytic
//! approximations to the CIE XYZ color matching functions", JCGT 2(2), 2013 (greatest error 0.024 of a peak of 1.8).

use super::{LONGEST, SHORTEST, Wavelength};

/// Where the R, G and B channels of a Rec. 709 image look: the centroids of the positive parts of their responses, in
/// 360–830 nm. The wavelengths of `dispersion_r`, `_g`, `_b` unless settings say otherwise.
///
/// [`centroids`] computes them; a test compares.
pub const CENTROIDS: [Wavelength; 3] = [
    Wavelength::from_nanometers(601.243_470_916),
    Wavelength::from_nanometers(540.672_008_547),
    Wavelength::from_nanometers(451.793_973_038),
];

/// CIE 1931 colour-matching functions x̄, ȳ, z̄ at `wavelength`.
pub fn color_matching(wavelength: Wavelength) -> [f64; 3] {
    let nm = wavelength.nanometers();
    // A Gaussian with different widths left and right of its peak.
    let lobe = |peak: f64, left: f64, right: f64| {
        let t = (nm - peak) / if nm < peak { left } else { right };
        libm::exp(-0.5 * t * t)
    };
    [
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    ]
}

/// Responses of the R, G, B channels of a Rec. 709 image (linear, D65) at `wavelength`; negative where the light lies
/// outside the gamut.
pub fn rec709(wavelength: Wavelength) -> [f64; 3] {
    // XYZ to linear Rec. 709 / sRGB, D65 (IEC 61966-2-1 primaries and white; seven digits as B. Lindbloom tabulates them).
    const RGB_FROM_XYZ: [[f64; 3]; 3] = [
        [3.240_454_2, -1.537_138_5, -0.498_531_4],
        [-0.969_266_0, 1.876_010_8, 0.041_556_0],
        [0.055_643_4, -0.204_025_9, 1.057_225_2],
    ];
    let [x, y, z] = color_matching(wavelength);
    RGB_FROM_XYZ.map(|[r, g, b]| r * x + g * y + b * z)
}

/// The values of [`CENTROIDS`], by the midpoint rule with steps of 0.1 nm.
pub fn centroids() -> [Wavelength; 3] {
    const STEPS_PER_NM: f64 = 10.0;
    let steps = ((LONGEST.nanometers() - SHORTEST.nanometers()) * STEPS_PER_NM) as u32;
    let (mut weight, mut moment) = ([0.0; 3], [0.0; 3]);
    for step in 0..steps {
        let nm = SHORTEST.nanometers() + (f64::from(step) + 0.5) / STEPS_PER_NM;
        for (channel, response) in rec709(Wavelength::from_nanometers(nm)).into_iter().enumerate() {
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

    #[test]
    fn luminous_efficiency_integrates_to_that_of_the_observer() {
        let sum: f64 = (360..=830).map(|nm| color_matching(Wavelength::from_nanometers(f64::from(nm)))[1]).sum();
        // Σ ȳ over the CIE's 1-nm table is 106.857; the fit gives 106.922.
        assert!((sum - 106.922).abs() < 5e-4, "{sum}");
    }
}
