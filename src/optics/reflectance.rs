//! What a surface was measured to reflect, wavelength by wavelength.

use super::absorption::Pieces;
use crate::spectrum::Wavelength;

/// A measured reflectance: piecewise linear, outside of its table constant.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredReflectance {
    pieces: Pieces,
}

impl MeasuredReflectance {
    /// From entries (nm, reflectance 0..=1) with increasing wavelengths, two or more, of which some lie about 360–830 nm.
    pub fn table(entries: &[[f64; 2]]) -> Result<Self, String> {
        let check = |reflectance: f64| {
            let explain = || "a reflectance is from 0 to 1: divide per cents by 100";
            (!(0.0..=1.0).contains(&reflectance)).then(|| explain().to_owned())
        };
        Ok(Self { pieces: Pieces::new(entries, check)? })
    }

    /// At `wavelength`, 0..=1.
    pub fn at(&self, wavelength: Wavelength) -> f64 {
        self.pieces.at(wavelength)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_linear_within_and_constant_without() {
        let measured = MeasuredReflectance::table(&[[400.0, 0.2], [500.0, 0.4], [700.0, 0.0]]).expect("is a table");
        for (nanometers, expected) in
            [(360.0, 0.2), (400.0, 0.2), (450.0, 0.3), (500.0, 0.4), (650.0, 0.1), (830.0, 0.0)]
        {
            let found = measured.at(Wavelength::from_nanometers(nanometers));
            assert!((found - expected).abs() < 1e-15, "{nanometers}: {found}");
        }
    }

    #[test]
    fn what_is_no_reflectance_is_refused_with_a_remedy() {
        for (entries, word) in [
            (&[[400.0, 0.5]][..], "two or more"),
            (&[[400.0, 20.0], [700.0, 30.0]], "per cents"),
            (&[[400.0, -0.1], [700.0, 0.3]], "0 to 1"),
            (&[[0.4, 0.1], [0.7, 0.3]], "in nm"),
            (&[[500.0, 0.1], [400.0, 0.3]], "increasing"),
        ] {
            let problem = MeasuredReflectance::table(entries).expect_err("is refused");
            assert!(problem.contains(word), "{problem}");
        }
    }
}
