//! Cauchy's law, given by its coefficients or by n_d and the Abbe number.

use super::range::IorRange;
use crate::spectrum::{Wavelength, lines};

/// n = Σ aₖ λ⁻²ᵏ, λ in µm.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cauchy {
    coefficients: Vec<f64>,
}

impl Cauchy {
    pub(super) fn new(coefficients: &[f64]) -> Self {
        Self { coefficients: coefficients.to_vec() }
    }

    /// n = Σ aₖ xᵏ with x = λ⁻²; n' = −λ⁻¹ Σ 2k aₖ xᵏ; n'' = λ⁻² Σ 2k(2k+1) aₖ xᵏ.
    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        let x = 1.0 / (micrometers * micrometers);
        let [mut value, mut first, mut second] = [0.0; 3];
        for (k, a) in self.coefficients.iter().enumerate().rev() {
            let two_k = 2.0 * k as f64;
            value = value * x + a;
            first = first * x + two_k * a;
            second = second * x + two_k * (two_k + 1.0) * a;
        }
        [value, -first / micrometers, second * x]
    }

    pub(super) fn check(&self, range: &IorRange) -> Result<(), String> {
        // xᵏ falls with λ, so each term is monotone.
        let term = |k: usize, micrometers: f64| self.coefficients[k] * micrometers.powi(-2 * k as i32);
        range.check(self.coefficients.len(), term, |ior| ior, |micrometers| self.at(micrometers)[0])
    }

    pub(super) fn is_constant(&self) -> bool {
        self.coefficients[1..].iter().all(|&a| a == 0.0)
    }

    pub(super) fn describe(&self) -> String {
        let mut text = format!("Cauchy, n = {}", self.coefficients[0]);
        for (k, a) in self.coefficients.iter().enumerate().skip(1) {
            text += &format!(" + {a} λ^-{}", 2 * k);
        }
        text
    }
}

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

    pub(super) fn check(&self, range: &IorRange) -> Result<(), String> {
        let ior = |micrometers: f64| self.at(micrometers)[0];
        range.check(1, |_, micrometers| ior(micrometers), |ior| ior, ior)
    }

    pub(super) fn is_constant(&self) -> bool {
        self.b == 0.0
    }

    pub(super) fn describe(&self) -> String {
        let a = self.nd - self.b * inverse_square(lines::D.micrometers());
        format!("n_d = {}, V_d = {} by Cauchy, n = {a:.9} + {:.9} λ^-2", self.nd, self.vd, self.b)
    }
}
