//! How a refractive index depends on wavelength: laws with n, ∂n/∂λ and ∂²n/∂λ² in closed form.
//!
//! | law | n(λ), λ in µm | file |
//! |---|---|---|
//! | constant | n | here |
//! | Cauchy | A + B λ⁻² + C λ⁻⁴ + … | `cauchy.rs` |
//! | Abbe number | n_d + B (λ⁻² − λ_d⁻²), B from V_d | `cauchy.rs` |
//! | Sellmeier | n² = A + Σ Bᵢ λ² / (λ² − Cᵢ) | `sellmeier.rs` |
//!
//! A law that exists is usable in all of 360–830 nm: constructors prove that no pole lies there and that n stays within
//! 0.01–100, by bounds on intervals and not by sampling. Their errors say what is wrong and what to do; the caller adds
//! where. A law is a file with a type that answers `at`, `check` and `describe`; this file only forwards.

mod cauchy;
mod range;
mod sellmeier;

use cauchy::{AbbeNumber, Cauchy};
use range::IorRange;
use sellmeier::Sellmeier;

use super::IorJet;
use crate::spectrum::{Wavelength, lines};

/// More terms than any law in print; a limit on what a hostile file can make us compute.
const MOST_TERMS: usize = 64;

/// The dispersion of a medium: a law, and the artistic scale of its deviation from n_d.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispersion {
    law: Law,
    scale: f64,
    /// n_d of the law, about which `scale` works.
    ior_d: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum Law {
    Constant(f64),
    Cauchy(Cauchy),
    AbbeNumber(AbbeNumber),
    Sellmeier(Sellmeier),
}

impl Law {
    /// n, n', n'' with λ in µm.
    fn at(&self, micrometers: f64) -> [f64; 3] {
        match self {
            Self::Constant(ior) => [*ior, 0.0, 0.0],
            Self::Cauchy(law) => law.at(micrometers),
            Self::AbbeNumber(law) => law.at(micrometers),
            Self::Sellmeier(law) => law.at(micrometers),
        }
    }

    fn check(&self, range: &IorRange) -> Result<(), String> {
        match self {
            Self::Constant(ior) => range.check_value(*ior),
            Self::Cauchy(law) => law.check(range),
            Self::AbbeNumber(law) => law.check(range),
            Self::Sellmeier(law) => law.check(range),
        }
    }

    fn is_constant(&self) -> bool {
        match self {
            Self::Constant(_) => true,
            Self::Cauchy(law) => law.is_constant(),
            Self::AbbeNumber(law) => law.is_constant(),
            Self::Sellmeier(law) => law.is_constant(),
        }
    }

    fn describe(&self) -> String {
        match self {
            Self::Constant(ior) => format!("constant, n = {ior}"),
            Self::Cauchy(law) => law.describe(),
            Self::AbbeNumber(law) => law.describe(),
            Self::Sellmeier(law) => law.describe(),
        }
    }
}

impl Dispersion {
    /// An index that does not depend on wavelength.
    pub fn constant(ior: f64) -> Result<Self, String> {
        finite("the index", &[ior])?;
        Self::new(Law::Constant(ior))
    }

    /// Cauchy's law n = A + B λ⁻² + C λ⁻⁴ + …; `coefficients` are A, B in µm², C in µm⁴ …
    pub fn cauchy(coefficients: &[f64]) -> Result<Self, String> {
        finite("Cauchy coefficients", coefficients)?;
        Self::new(Law::Cauchy(Cauchy::new(coefficients)))
    }

    /// Sellmeier's law n² = 1 + Σ Bᵢ λ² / (λ² − Cᵢ), Cᵢ in µm² as given (refractiveindex.info formula 2 without its leading
    /// constant, and the glass makers' own).
    pub fn sellmeier(b: &[f64], c_um2: &[f64]) -> Result<Self, String> {
        same_length(b, c_um2)?;
        finite("Sellmeier coefficients B", b)?;
        finite("Sellmeier coefficients C", c_um2)?;
        Self::new(Law::Sellmeier(Sellmeier::new(1.0, b, c_um2)))
    }

    /// Sellmeier's law n² = 1 + `constant` + Σ Bᵢ λ² / (λ² − Cᵢ²), Cᵢ in µm and squared here (refractiveindex.info
    /// formula 1, whose first coefficient is `constant`).
    pub fn sellmeier_squared(constant: f64, b: &[f64], c_um: &[f64]) -> Result<Self, String> {
        same_length(b, c_um)?;
        finite("the Sellmeier constant", &[constant])?;
        finite("Sellmeier coefficients B", b)?;
        finite("Sellmeier coefficients C", c_um)?;
        let c_um2: Vec<f64> = c_um.iter().map(|c| c * c).collect();
        finite("squared Sellmeier coefficients C", &c_um2)?;
        Self::new(Law::Sellmeier(Sellmeier::new(1.0 + constant, b, &c_um2)))
    }

    /// The two-term Cauchy law with index `nd` at the d line and Abbe number `vd` = (n_d − 1)/(n_F − n_C).
    pub fn from_abbe_number(nd: f64, vd: f64) -> Result<Self, String> {
        finite("n_d and V_d", &[nd, vd])?;
        if vd <= 0.0 {
            return Err(format!(
                "the Abbe number is {vd}, it must be positive: real media have 15 to 100; for no dispersion use a constant \
                 index"
            ));
        }
        Self::new(Law::AbbeNumber(AbbeNumber::new(nd, vd)))
    }

    fn new(law: Law) -> Result<Self, String> {
        law.check(&IorRange::physical())?;
        // A law without dispersion has derivatives that are zero, not zero times something.
        let law = if law.is_constant() { Law::Constant(law.at(lines::D.micrometers())[0]) } else { law };
        let ior_d = law.at(lines::D.micrometers())[0];
        Ok(Self { law, scale: 1.0, ior_d })
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
            return Ok(Self { law: Law::Constant(self.ior_d), scale: 1.0, ior_d: self.ior_d });
        }
        self.law
            .check(&IorRange::physical().before_scaling(scale, self.ior_d))
            .map_err(|problem| format!("with the dispersion scaled by {scale}, {problem}"))?;
        Ok(Self { law: self.law.clone(), scale, ior_d: self.ior_d })
    }

    /// n, ∂n/∂λ, ∂²n/∂λ² at `wavelength`.
    ///
    /// Outside of 360–830 nm the law is evaluated as it stands, which may have a pole there or no real value (NaN).
    pub fn at(&self, wavelength: Wavelength) -> IorJet {
        let [ior, first, second] = self.law.at(wavelength.micrometers());
        // Per µm to per nm.
        let (first, second) = (first / 1e3, second / 1e6);
        if self.is_scaled() {
            IorJet {
                ior: self.ior_d + self.scale * (ior - self.ior_d),
                dior_dlambda: self.scale * first,
                d2ior_dlambda2: self.scale * second,
            }
        } else {
            IorJet { ior, dior_dlambda: first, d2ior_dlambda2: second }
        }
    }

    /// Whether the index does not depend on wavelength; then derivatives are exactly 0.
    pub fn is_constant(&self) -> bool {
        matches!(self.law, Law::Constant(_))
    }

    #[expect(clippy::float_cmp, reason = "1 is a setting here, not a result: then not even a rounding is added")]
    fn is_scaled(&self) -> bool {
        self.scale != 1.0
    }

    /// V_d = (n_d − 1)/(n_F − n_C); `None` if n_F = n_C, as for a constant index.
    pub fn abbe_number(&self) -> Option<f64> {
        let ior = |line: Wavelength| self.at(line).ior;
        let difference = ior(lines::F) - ior(lines::C);
        (difference != 0.0).then(|| (ior(lines::D) - 1.0) / difference)
    }

    /// The law with its coefficients, n_d and V_d, in one line.
    pub fn describe(&self) -> String {
        let mut text = self.law.describe();
        if self.is_scaled() {
            text += &format!(", dispersion scaled by {}", self.scale);
        }
        if let Some(vd) = self.abbe_number() {
            text += &format!(" (n_d = {:.6}, V_d = {vd:.3})", self.ior_d);
        }
        text
    }
}

fn finite(what: &str, values: &[f64]) -> Result<(), String> {
    if values.is_empty() {
        return Err(format!("{what}: none are given, at least one is needed"));
    }
    if values.len() > MOST_TERMS {
        return Err(format!("{what}: {} are given, at most {MOST_TERMS} are understood", values.len()));
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(format!("{what}: {value} is no finite number")),
        None => Ok(()),
    }
}

fn same_length(b: &[f64], c: &[f64]) -> Result<(), String> {
    if b.len() == c.len() {
        return Ok(());
    }
    Err(format!("{} Sellmeier coefficients B with {} coefficients C: each term needs one of each", b.len(), c.len()))
}
