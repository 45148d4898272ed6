//! How a refractive index depends on wavelength: laws with n, ∂n/∂λ and ∂²n/∂λ² in closed form.
//!
//! | law | n(λ), λ in µm |
//! |---|---|
//! | constant | n |
//! | Cauchy | n = A + B λ⁻² + C λ⁻⁴ + … |
//! | Abbe number | n = n_d + B (λ⁻² − λ_d⁻²), B from V_d |
//! | Sellmeier | n² = A + Σ Bᵢ λ² / (λ² − Cᵢ) |
//! | Schott | n² = a₀ + a₁ λ² + a₂ λ⁻² + a₃ λ⁻⁴ + … |
//! | Conrady | n = A + B λ⁻¹ + C λ⁻³·⁵ |
//! | formulas 1 to 9 of refractiveindex.info | `formula.rs` |
//! | table | cubic spline |
//!
//! A [`Law`] is what is stated; a [`Dispersion`] is a law that is usable in all of 360–830 nm (or as much of it as its
//! valid range covers): its constructor proves that no pole lies there and that n stays within 0.01–100, by bounds on
//! intervals and not by sampling. Errors say what is wrong and what to do; the caller adds where.
//!
//! Every formula in print is n, n² or the Lorentz–Lorenz ratio (`series.rs`) as a sum of five kinds of terms (`term.rs`),
//! so that derivatives and bounds are written once a term. A new formula is a line in `law.rs` or `formula.rs`.

mod abbe_number;
mod formula;
mod law;
mod range;
mod series;
mod spline;
mod table;
mod term;
mod valid;

pub use law::Law;
pub use table::check_wavelengths;
pub use valid::{OutOfRange, ValidRange};

use law::finite;
use range::IorRange;

use super::IorJet;
use crate::spectrum::{LONGEST, SHORTEST, Wavelength, lines};

/// The dispersion of a medium: a law, where it holds, and the artistic scale of its deviation from n_d.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispersion {
    law: Law,
    valid: Option<ValidRange>,
    out_of_range: OutOfRange,
    scale: f64,
    /// n_d of the law, about which `scale` works.
    ior_d: f64,
}

impl Dispersion {
    /// The dispersion that `law` states, which holds in `valid` (everywhere if `None`, from end to end for a table).
    ///
    /// Refused are a pole and an index outside of 0.01–100 anywhere in 360–830 nm, as far as the law is used there: unless
    /// it is extrapolated, within `valid` only, which then has to hold the d line.
    pub fn new(law: Law, valid: Option<ValidRange>, out_of_range: OutOfRange) -> Result<Self, String> {
        let valid = valid.or(law.own_range());
        if let Some(range) = valid {
            law.check_range(range, out_of_range)?;
        }
        let mut dispersion = Self { law, valid, out_of_range, scale: 1.0, ior_d: 1.0 };
        dispersion.law.check(&IorRange::physical(), dispersion.used_band())?;
        dispersion.ior_d = dispersion.law.at(lines::D.micrometers())[0];
        // A law without dispersion has derivatives that are zero, not zero times something.
        if dispersion.law.is_constant() {
            dispersion.law = Law::constant(dispersion.ior_d)?;
        }
        Ok(dispersion)
    }

    fn everywhere(law: Law) -> Result<Self, String> {
        Self::new(law, None, OutOfRange::default())
    }

    /// [`Law::constant`], valid everywhere.
    pub fn constant(ior: f64) -> Result<Self, String> {
        Self::everywhere(Law::constant(ior)?)
    }

    /// [`Law::cauchy`], valid everywhere.
    pub fn cauchy(coefficients: &[f64]) -> Result<Self, String> {
        Self::everywhere(Law::cauchy(coefficients)?)
    }

    /// [`Law::sellmeier`], valid everywhere.
    pub fn sellmeier(b: &[f64], c_um2: &[f64]) -> Result<Self, String> {
        Self::everywhere(Law::sellmeier(b, c_um2)?)
    }

    /// [`Law::sellmeier_squared`], valid everywhere.
    pub fn sellmeier_squared(constant: f64, b: &[f64], c_um: &[f64]) -> Result<Self, String> {
        Self::everywhere(Law::sellmeier_squared(constant, b, c_um)?)
    }

    /// [`Law::abbe_number`], valid everywhere.
    pub fn from_abbe_number(nd: f64, vd: f64) -> Result<Self, String> {
        Self::everywhere(Law::abbe_number(nd, vd)?)
    }

    /// The same medium with n(λ) − n_d multiplied by `scale`: 0 switches dispersion off, 1 is physical. Scales multiply.
    ///
    /// Refuses a scale that drives the index out of its physical range somewhere in 360–830 nm.
    pub fn scaled(&self, scale: f64) -> Result<Self, String> {
        finite("the dispersion scale", &[scale])?;
        if self.is_constant() {
            return Ok(self.clone());
        }
        let scale = self.scale * scale;
        if scale == 0.0 {
            return Ok(Self { law: Law::constant(self.ior_d)?, scale: 1.0, ..self.clone() });
        }
        self.law
            .check(&IorRange::physical().before_scaling(scale, self.ior_d), self.used_band())
            .map_err(|problem| format!("with the dispersion scaled by {scale}, {problem}"))?;
        Ok(Self { scale, ..self.clone() })
    }

    /// n, ∂n/∂λ, ∂²n/∂λ² at `wavelength`.
    ///
    /// Outside of the valid range the index is that of its nearest end and the derivatives are 0, unless the law is
    /// extrapolated. [`OutOfRange::Error`] is the caller's to mind: ask [`is_valid_at`](Self::is_valid_at) first. A law
    /// outside of 360–830 nm is evaluated as it stands and may have a pole there or no real value (NaN).
    pub fn at(&self, wavelength: Wavelength) -> IorJet {
        let held = match self.valid {
            Some(range) if self.out_of_range != OutOfRange::Extrapolate => range.clamp(wavelength),
            _ => wavelength,
        };
        let [ior, first, second] = self.law.at(held.micrometers());
        let ior = if self.is_scaled() { self.ior_d + self.scale * (ior - self.ior_d) } else { ior };
        if held != wavelength {
            return IorJet::constant(ior);
        }
        // Per µm to per nm.
        IorJet { ior, dior_dlambda: self.scale * (first / 1e3), d2ior_dlambda2: self.scale * (second / 1e6) }
    }

    /// Where the law holds; everywhere if `None`.
    pub fn valid_range(&self) -> Option<ValidRange> {
        self.valid
    }

    /// What becomes of wavelengths outside of the valid range.
    pub fn out_of_range(&self) -> OutOfRange {
        self.out_of_range
    }

    /// Whether `wavelength` lies within the valid range.
    pub fn is_valid_at(&self, wavelength: Wavelength) -> bool {
        self.valid.is_none_or(|range| range.contains(wavelength))
    }

    /// Whether the index does not depend on wavelength; then derivatives are exactly 0.
    pub fn is_constant(&self) -> bool {
        self.law.is_constant()
    }

    #[expect(clippy::float_cmp, reason = "1 is a setting here, not a result: then not even a rounding is added")]
    fn is_scaled(&self) -> bool {
        self.scale != 1.0
    }

    /// V_d = (n_d − 1)/(n_F − n_C); `None` if n_F = n_C, as for a constant index, or if a line lies outside of the valid
    /// range of a law that is not extrapolated.
    pub fn abbe_number(&self) -> Option<f64> {
        let is_known = |line| self.out_of_range == OutOfRange::Extrapolate || self.is_valid_at(line);
        if !(is_known(lines::F) && is_known(lines::C)) {
            return None;
        }
        let ior = |line: Wavelength| self.at(line).ior;
        let difference = ior(lines::F) - ior(lines::C);
        (difference != 0.0).then(|| (ior(lines::D) - 1.0) / difference)
    }

    /// How far ∂²n/∂λ² of a table can be trusted: by which part of its size (root mean squares over 360–830 nm) it changes
    /// when every second entry is left out. `None` for a formula, and for a table with too few entries to tell.
    pub fn curvature_doubt(&self) -> Option<f64> {
        self.law.curvature_doubt()
    }

    /// The law with its coefficients, valid range, n_d and V_d, in one line.
    pub fn describe(&self) -> String {
        let mut text = self.law.describe();
        if self.is_scaled() {
            text += &format!(", dispersion scaled by {}", self.scale);
        }
        if let Some(range) = self.valid {
            let outside = match self.out_of_range {
                OutOfRange::Clamp => "constant outside",
                OutOfRange::Error => "not to be used outside",
                OutOfRange::Extrapolate => "extrapolated outside",
            };
            text += &format!(", valid from {range}, {outside}");
        }
        match self.abbe_number() {
            Some(vd) => text += &format!(" (n_d = {:.6}, V_d = {vd:.3})", self.ior_d),
            None if !self.is_constant() => text += &format!(" (n_d = {:.6})", self.ior_d),
            None => {}
        }
        text
    }

    /// The part of 360–830 nm in which the law is evaluated, µm: from the outside it is held at the ends of its range.
    fn used_band(&self) -> [f64; 2] {
        let visible = [SHORTEST, LONGEST];
        let used = match self.valid {
            Some(range) if self.out_of_range != OutOfRange::Extrapolate => visible.map(|end| range.clamp(end)),
            _ => visible,
        };
        used.map(Wavelength::micrometers)
    }
}
