//! Cauchy's law given by n_d and the Abbe number.

use super::range::IorRange;
use super::series::Quantity;
use super::term::Term;
use crate::spectrum::{Wavelength, lines};

/// The two-term Cauchy law through n_d with the Abbe number V_d = (n_d − 1)/(n_F − n_C):
/// B = (n_d − 1) / (V_d (λ_F⁻² − λ_C⁻²)), A = n_d − B λ_d⁻².
///
/// Kept as n_d + B (λ⁻² − λ_d⁻²), so that the index at the d line is the given n_d to the last bit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AbbeNumber {
    nd: f64,
    vd: f64,
    b: f64,
}

/// λ⁻² in µm⁻².
fn inverse_square(micrometers: f64) -> f64 {
    1.0 / (micrometers * micrometers)
}

impl AbbeNumber {
    pub(super) fn new(nd: f64, vd: f64) -> Self {
        let x = |line: Wavelength| inverse_square(line.micrometers());
        Self { nd, vd, b: (nd - 1.0) / (vd * (x(lines::F) - x(lines::C))) }
    }

    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        let x = inverse_square(micrometers);
        let value = self.nd + self.b * (x - inverse_square(lines::D.micrometers()));
        [value, -2.0 * self.b * x / micrometers, 6.0 * self.b * x * x]
    }

    pub(super) fn check(&self, range: &IorRange, band: [f64; 2]) -> Result<(), String> {
        let terms = [Term::Power { a: self.b, p: -2.0 }];
        range.check(band, Quantity::Index, self.a(), &terms, |micrometers| self.at(micrometers)[0])
    }

    /// A of n = A + B λ⁻².
    fn a(&self) -> f64 {
        self.nd - self.b * inverse_square(lines::D.micrometers())
    }

    pub(super) fn is_constant(&self) -> bool {
        self.b == 0.0
    }

    pub(super) fn describe(&self) -> String {
        format!("n_d = {}, V_d = {} by Cauchy, n = {:.9} + {:.9} λ^-2", self.nd, self.vd, self.a(), self.b)
    }
}
