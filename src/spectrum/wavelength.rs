//! One wavelength, with its unit in the type.

use std::fmt;

/// A vacuum-or-air wavelength as catalogues give it; the renderer does not tell the two apart (2.7e-4, below any law here).
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, serde::Serialize)]
#[serde(transparent)]
pub struct Wavelength {
    nanometers: f64,
}

impl Wavelength {
    /// The wavelength of `nanometers` nm. Visible light is 360 to 830.
    pub const fn from_nanometers(nanometers: f64) -> Self {
        Self { nanometers }
    }

    /// In nanometres.
    pub const fn nanometers(self) -> f64 {
        self.nanometers
    }

    /// In micrometres, the unit of every dispersion law. Divided, not multiplied by an inexact 1e-3: one rounding, not two.
    pub const fn micrometers(self) -> f64 {
        self.nanometers / 1000.0
    }
}

impl fmt::Display for Wavelength {
    /// `587.5618 nm`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} nm", self.nanometers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn micrometers_are_rounded_once() {
        for nm in [587.5618, 486.1327, 656.2725, 360.0, 830.0] {
            let wavelength = Wavelength::from_nanometers(nm);
            assert_eq!(wavelength.nanometers().to_bits(), nm.to_bits());
            assert!((wavelength.micrometers() * 1e3 - nm).abs() <= f64::EPSILON * nm);
        }
        assert_eq!(Wavelength::from_nanometers(550.0).to_string(), "550 nm");
    }
}
