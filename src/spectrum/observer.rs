//! The standard observer: CIE 1931 2° colour-matching functions (ISO/CIE 11664-1:2019), and integrals against them.
//!
//! Between the table's entries, 1 nm apart, they are interpolated linearly. A tristimulus value is the sum over those
//! entries, as colorimetry defines it (CIE 15:2018, §7.1): what an integral of the interpolated functions is, too, for spectra
//! that are linear between them.

use super::tables::CIE_1931;
use super::{SHORTEST, Wavelength};

/// ∫ ȳ dλ, nm: the Y of a spectrum that is 1 everywhere.
pub const LUMINOUS_INTEGRAL: f64 = 106.856_917_101_172;

/// Colour-matching functions x̄, ȳ, z̄ at `wavelength`; 0 outside of 360–830 nm.
pub fn color_matching(wavelength: Wavelength) -> [f64; 3] {
    let last = CIE_1931.len() - 1;
    let position = wavelength.nanometers() - SHORTEST.nanometers();
    if !(0.0..=last as f64).contains(&position) {
        return [0.0; 3];
    }
    // Of 32 bits, as the processor converts it.
    let below = (position as i32 as usize).min(last - 1);
    let fraction = position - below as f64;
    std::array::from_fn(|i| CIE_1931[below][i] + fraction * (CIE_1931[below + 1][i] - CIE_1931[below][i]))
}

/// X, Y, Z of the spectral power `power`, per nm, without any normalisation.
pub fn tristimulus(power: impl Fn(Wavelength) -> f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (step, row) in CIE_1931.iter().enumerate() {
        let power = power(Wavelength::from_nanometers(SHORTEST.nanometers() + step as f64));
        for (sum, response) in sum.iter_mut().zip(row) {
            *sum += power * response;
        }
    }
    sum
}

/// X, Y, Z of the spectral power `power`, per nm and linear between whole nanometres, as the integral of the interpolated functions, which is
/// what means over wavelengths of paths come to. [`tristimulus`], the sum, differs from it by 2e-5 for D65.
pub fn tristimulus_integral(power: impl Fn(Wavelength) -> f64) -> [f64; 3] {
    let at = |step: usize| power(Wavelength::from_nanometers(SHORTEST.nanometers() + step as f64));
    let mut sum = [0.0; 3];
    for (step, rows) in CIE_1931.windows(2).enumerate() {
        let (here, next) = (at(step), at(step + 1));
        for (sum, (response, next_response)) in sum.iter_mut().zip(rows[0].iter().zip(rows[1])) {
            // The product of two straight lines.
            *sum += (here * (2.0 * response + next_response) + next * (response + 2.0 * next_response)) / 6.0;
        }
    }
    sum
}

/// Chromaticity x, y of a tristimulus value; `None` for black.
pub fn chromaticity([x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
    let sum = x + y + z;
    (sum != 0.0).then(|| [x / sum, y / sum])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_hit_and_interpolated_linearly() {
        let at = |nm: f64| color_matching(Wavelength::from_nanometers(nm));
        for (nm, row) in [(360.0, CIE_1931[0]), (555.0, CIE_1931[195]), (830.0, CIE_1931[470])] {
            assert_eq!(at(nm).map(f64::to_bits), row.map(f64::to_bits), "{nm} nm");
        }
        let (low, middle, high) = (at(600.0), at(600.25), at(601.0));
        for i in 0..3 {
            assert!((middle[i] - (0.75 * low[i] + 0.25 * high[i])).abs() < 1e-15);
        }
        for nm in [359.999, 830.001, -1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(at(nm).map(f64::to_bits), [0; 3], "{nm} nm");
        }
    }

    #[test]
    fn equal_energy_has_the_sums_of_the_standard() {
        let [x, y, z] = tristimulus(|_| 1.0);
        // CIE 15:2018 prints the sums of its table with two decimals.
        assert!([x - 106.87, y - 106.86, z - 106.89].iter().all(|difference| difference.abs() < 5e-3), "{x} {y} {z}");
        assert!((y - LUMINOUS_INTEGRAL).abs() < 1e-11, "{y}");
        assert_eq!(chromaticity([0.0; 3]), None);
    }
}
