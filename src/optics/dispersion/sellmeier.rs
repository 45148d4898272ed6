//! Sellmeier's law.

use super::range::IorRange;
use crate::spectrum::{LONGEST, SHORTEST};

/// n² = A + Σ Bᵢ λ² / (λ² − Cᵢ), λ in µm, Cᵢ in µm² (a wavelength of resonance, squared).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sellmeier {
    constant: f64,
    /// (Bᵢ, Cᵢ); terms with Bᵢ = 0, with which catalogues pad, are left out.
    terms: Vec<(f64, f64)>,
}

impl Sellmeier {
    pub(super) fn new(constant: f64, b: &[f64], c_um2: &[f64]) -> Self {
        let terms = b.iter().copied().zip(c_um2.iter().copied()).filter(|&(b, _)| b != 0.0).collect();
        Self { constant, terms }
    }

    /// With ε = n²: ε' = −2λ Σ BC/(λ²−C)², ε'' = 2 Σ BC(3λ²+C)/(λ²−C)³; n' = ε'/(2n), n'' = (ε'' − 2n'²)/(2n).
    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        let x = micrometers * micrometers;
        let [mut epsilon, mut first, mut second] = [self.constant, 0.0, 0.0];
        for &(b, c) in &self.terms {
            let inverse = 1.0 / (x - c);
            epsilon += b * x * inverse;
            let bc = b * c * inverse * inverse;
            first += bc;
            second += bc * (3.0 * x + c) * inverse;
        }
        let ior = epsilon.sqrt();
        let dior = -micrometers * first / ior;
        [ior, dior, (second - dior * dior) / ior]
    }

    pub(super) fn check(&self, range: &IorRange) -> Result<(), String> {
        for &(b, c) in &self.terms {
            let pole_nm = 1e3 * c.max(0.0).sqrt();
            if pole_nm >= SHORTEST.nanometers() && pole_nm <= LONGEST.nanometers() {
                return Err(format!(
                    "the Sellmeier term B = {b}, C = {c} µm² has a pole at {pole_nm:.3} nm, within 360–830 nm: check C and \
                     its unit (µm², formula 1 of refractiveindex.info wants C in µm and squares it)"
                ));
            }
        }
        // Each term Bx/(x − C) has the derivative −BC/(x − C)², of one sign between poles.
        let term = |k: usize, micrometers: f64| {
            let x = micrometers * micrometers;
            self.terms.get(k).map_or(self.constant, |&(b, c)| b * x / (x - c))
        };
        let epsilon = |ior: f64| ior.max(0.0) * ior.max(0.0);
        range.check(self.terms.len() + 1, term, epsilon, |micrometers| self.at(micrometers)[0])
    }

    pub(super) fn is_constant(&self) -> bool {
        self.terms.iter().all(|&(_, c)| c == 0.0)
    }

    pub(super) fn describe(&self) -> String {
        let mut text = format!("Sellmeier, n² = {}", self.constant);
        for (b, c) in &self.terms {
            text += &format!(" + {b} λ²/(λ² - {c})");
        }
        text
    }
}
