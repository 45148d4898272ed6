//! A law as it is stated: a formula with its coefficients, or a table.

use super::abbe_number::AbbeNumber;
use super::range::IorRange;
use super::series::{Quantity, Series};
use super::table::Table;
use super::term::Term;
use super::valid::{OutOfRange, ValidRange};
use crate::spectrum::lines;

/// More terms than any law in print; a limit on what a hostile file can make us compute.
const MOST_TERMS: usize = 64;

/// A formula with its coefficients, or a table, not yet proved over any band: [`Dispersion::new`](super::Dispersion::new)
/// does that.
///
/// λ is in µm in every formula, as catalogues print their coefficients.
// Boxed: laws differ much in size, and are looked at a few times a render.
#[derive(Clone, Debug, PartialEq)]
pub struct Law(Box<Form>);

#[derive(Clone, Debug, PartialEq)]
enum Form {
    Constant(f64),
    AbbeNumber(AbbeNumber),
    Series(Series),
    Table(Table),
}

impl Law {
    /// An index that does not depend on wavelength.
    pub fn constant(ior: f64) -> Result<Self, String> {
        finite("the index", &[ior])?;
        Ok(Self(Box::new(Form::Constant(ior))))
    }

    /// Cauchy's law n = A + B λ⁻² + C λ⁻⁴ + …; `coefficients` are A, B in µm², C in µm⁴ …
    pub fn cauchy(coefficients: &[f64]) -> Result<Self, String> {
        finite("Cauchy coefficients", coefficients)?;
        let powers = (0..coefficients.len()).map(|k| -2.0 * k as f64);
        Ok(Self::series("Cauchy", Quantity::Index, 0.0, powers_of(coefficients, powers)))
    }

    /// Sellmeier's law n² = 1 + Σ Bᵢ λ² / (λ² − Cᵢ), Cᵢ in µm² as given (refractiveindex.info formula 2 without its leading
    /// constant, and the glass makers' own).
    pub fn sellmeier(b: &[f64], c_um2: &[f64]) -> Result<Self, String> {
        same_length(b, c_um2)?;
        finite("Sellmeier coefficients B", b)?;
        finite("Sellmeier coefficients C", c_um2)?;
        Ok(Self::sellmeier_terms(1.0, b, c_um2))
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
        Ok(Self::sellmeier_terms(1.0 + constant, b, &c_um2))
    }

    pub(super) fn sellmeier_terms(constant: f64, b: &[f64], c_um2: &[f64]) -> Self {
        let terms = b.iter().zip(c_um2).map(|(&a, &c)| Term::Resonance { a, p: 2.0, c }).collect();
        Self::series("Sellmeier", Quantity::Permittivity, constant, terms)
    }

    /// The two-term Cauchy law with index `nd` at the d line and Abbe number `vd` = (n_d − 1)/(n_F − n_C).
    pub fn abbe_number(nd: f64, vd: f64) -> Result<Self, String> {
        finite("n_d and V_d", &[nd, vd])?;
        if vd <= 0.0 {
            return Err(format!(
                "the Abbe number is {vd}, it must be positive: real media have 15 to 100; for no dispersion use a constant \
                 index"
            ));
        }
        Ok(Self(Box::new(Form::AbbeNumber(AbbeNumber::new(nd, vd)))))
    }

    /// Schott's polynomial n² = a₀ + a₁ λ² + a₂ λ⁻² + a₃ λ⁻⁴ + a₄ λ⁻⁶ + a₅ λ⁻⁸, the form of glass catalogues before
    /// Sellmeier's; further coefficients go on with λ⁻¹⁰ and so on.
    pub fn schott(coefficients: &[f64]) -> Result<Self, String> {
        finite("Schott coefficients", coefficients)?;
        let powers = (0..coefficients.len()).map(|k| match k {
            0 => 0.0,
            1 => 2.0,
            k => -2.0 * (k as f64 - 1.0),
        });
        Ok(Self::series("Schott", Quantity::Permittivity, 0.0, powers_of(coefficients, powers)))
    }

    /// Conrady's law n = A + B λ⁻¹ + C λ⁻³·⁵, for few measured lines (Conrady, "Applied Optics and Optical Design", 1960,
    /// vol. 2, ch. XI); one to three coefficients.
    pub fn conrady(coefficients: &[f64]) -> Result<Self, String> {
        finite("Conrady coefficients", coefficients)?;
        if coefficients.len() > 3 {
            return Err(format!("Conrady's law takes A, B and C, {} coefficients are given", coefficients.len()));
        }
        Ok(Self::series("Conrady", Quantity::Index, 0.0, powers_of(coefficients, [0.0, -1.0, -3.5].into_iter())))
    }

    /// A table of (wavelength in nm, n), wavelengths strictly increasing, two entries at least: a cubic spline ("not a
    /// knot", C²), through three entries the parabola, through two the line.
    pub fn table(entries: &[[f64; 2]]) -> Result<Self, String> {
        Ok(Self(Box::new(Form::Table(Table::new(entries)?))))
    }

    pub(super) fn series(name: &'static str, quantity: Quantity, constant: f64, terms: Vec<Term>) -> Self {
        Self(Box::new(Form::Series(Series::new(name, quantity, constant, terms))))
    }

    /// n, n', n'' with λ in µm.
    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        match &*self.0 {
            Form::Constant(ior) => [*ior, 0.0, 0.0],
            Form::AbbeNumber(law) => law.at(micrometers),
            Form::Series(law) => law.at(micrometers),
            Form::Table(law) => law.at(micrometers),
        }
    }

    /// Proves that no pole lies within `band` (µm) and that the index stays in `range` there.
    pub(super) fn check(&self, range: &IorRange, band: [f64; 2]) -> Result<(), String> {
        match &*self.0 {
            Form::Constant(ior) => range.check_value(*ior),
            Form::AbbeNumber(law) => law.check(range, band),
            Form::Series(law) => law.check(range, band),
            Form::Table(law) => law.check(range, band),
        }
    }

    pub(super) fn is_constant(&self) -> bool {
        match &*self.0 {
            Form::Constant(_) => true,
            Form::AbbeNumber(law) => law.is_constant(),
            Form::Series(law) => law.is_constant(),
            Form::Table(law) => law.is_constant(),
        }
    }

    /// The wavelengths beyond which the law itself knows nothing: a table's ends.
    pub(super) fn own_range(&self) -> Option<ValidRange> {
        match &*self.0 {
            Form::Table(law) => Some(law.range()),
            _ => None,
        }
    }

    /// Whether `range` can be this law's valid range: two wavelengths in nm, within a table, and, unless the law is
    /// extrapolated, about the d line.
    pub fn check_range(&self, range: ValidRange, out_of_range: OutOfRange) -> Result<(), String> {
        range.check()?;
        if let Some(own) = self.own_range()
            && (range.from < own.from || range.to > own.to)
        {
            return Err(format!(
                "the valid range {range} goes beyond the table, which knows {own}: author a range inside, or none"
            ));
        }
        if out_of_range != OutOfRange::Extrapolate && !range.contains(lines::D) {
            return Err(format!(
                "the law is valid from {range} only, without the d line ({}), at which n_d is stated: take a law for visible \
                 light, or extrapolate it",
                lines::D
            ));
        }
        Ok(())
    }

    pub(super) fn curvature_doubt(&self) -> Option<f64> {
        match &*self.0 {
            Form::Table(law) => law.curvature_doubt(),
            _ => None,
        }
    }

    pub(super) fn describe(&self) -> String {
        match &*self.0 {
            Form::Constant(ior) => format!("constant, n = {ior}"),
            Form::AbbeNumber(law) => law.describe(),
            Form::Series(law) => law.describe(),
            Form::Table(law) => law.describe(),
        }
    }
}

fn powers_of(coefficients: &[f64], powers: impl Iterator<Item = f64>) -> Vec<Term> {
    coefficients.iter().zip(powers).map(|(&a, p)| Term::Power { a, p }).collect()
}

pub(super) fn finite(what: &str, values: &[f64]) -> Result<(), String> {
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
