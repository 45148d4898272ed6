//! What our attributes say about absorption: k(λ), or the internal transmittance of a plate.

use super::super::values::Values;
use super::compile::glass;
use super::{Authored, EXTINCTION, Form, GLASS, THICKNESS, TRANSMITTANCE};
use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::dispersion::check_wavelengths;

/// Thickness of the plate where none is authored, mm: the schema's fallback.
const THICKNESS_MM: f64 = 10.0;

/// Absorption as it is authored, and where.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) enum StatedAbsorption {
    /// k(λ) as (nm, k), k ≥ 0.
    Extinction { entries: Vec<[f64; 2]>, place: String },
    /// τ(λ) of a plate as (nm, τ), 0 < τ ≤ 1.
    InternalTransmittance { entries: Vec<[f64; 2]>, thickness_mm: f64, place: String },
}

impl StatedAbsorption {
    /// Where it stands, for the plan.
    pub(in super::super) fn place(&self) -> &str {
        match self {
            Self::Extinction { place, .. } | Self::InternalTransmittance { place, .. } => place,
        }
    }
}

impl Authored<'_> {
    /// The first table of absorption that is authored, whatever stands in it.
    pub(in super::super) fn absorption_place(&self) -> Option<String> {
        let of = |values: &Values<'_>| {
            let name = [EXTINCTION, TRANSMITTANCE].into_iter().find(|name| values.has(name));
            name.map(|name| values.place(name))
        };
        self.places.iter().find_map(of)
    }

    /// The first place that states absorption; of two tables at one place k is used, with a warning. Else k(λ) of the
    /// catalogue, if the law is that of a named material.
    pub(in super::super) fn absorption(&self, diagnostics: &mut Diagnostics) -> Result<Option<StatedAbsorption>> {
        for values in &self.places {
            let extinction = values.pairs(EXTINCTION, diagnostics)?;
            let transmittance = values.pairs(TRANSMITTANCE, diagnostics)?;
            if extinction.is_some() && transmittance.is_some() {
                diagnostics.warn(
                    "several-absorptions",
                    values.place(TRANSMITTANCE),
                    format!("{EXTINCTION} is authored as well and is used: author one of them"),
                );
            }
            if let Some(entries) = extinction {
                check(values, EXTINCTION, "k", &entries, |k| {
                    (k < 0.0).then_some("k is 0 or more: a medium does not shine")
                })?;
                return Ok(Some(StatedAbsorption::Extinction { entries, place: values.place(EXTINCTION) }));
            }
            if let Some(entries) = transmittance {
                check(values, TRANSMITTANCE, "transmittance", &entries, |tau| match tau {
                    t if t < 0.0 => Some("a transmittance lies above 0 and not above 1"),
                    0.0 => Some(
                        "no thickness of a medium lets nothing at all pass: author the least that could be measured, or the \
                         transmittance of a thinner plate",
                    ),
                    t if t > 1.0 => Some("a transmittance lies above 0 and not above 1: divide per cents by 100"),
                    _ => None,
                })?;
                let thickness_mm = values.double(THICKNESS, diagnostics)?.unwrap_or(THICKNESS_MM);
                if thickness_mm <= 0.0 {
                    return values.refuse(THICKNESS, "author the thickness of the plate in mm, 10 and 25 are usual");
                }
                let place = values.place(TRANSMITTANCE);
                return Ok(Some(StatedAbsorption::InternalTransmittance { entries, thickness_mm, place }));
            }
        }
        let Some((values, Form::Glass)) = self.decided()? else { return Ok(None) };
        let place = values.place(GLASS);
        Ok(glass(values)?.extinction().map(|entries| StatedAbsorption::Extinction { entries, place }))
    }
}

/// Wavelengths that increase, two of them at least, and a value that `problem` has nothing against.
fn check(
    values: &Values<'_>,
    name: &str,
    what: &str,
    entries: &[[f64; 2]],
    problem: impl Fn(f64) -> Option<&'static str>,
) -> Result<()> {
    check_wavelengths("the table", what, entries).or_else(|problem| values.refuse(name, problem))?;
    if let [[wavelength, value]] = entries {
        return values.refuse(
            name,
            format!("has one entry: if {what} is {value} not only at {wavelength} nm, author it at 360 and at 830 nm"),
        );
    }
    match entries.iter().find_map(|&[nm, value]| problem(value).map(|problem| (nm, value, problem))) {
        Some((nm, value, problem)) => values.refuse(name, format!("{what} is {value} at {nm} nm: {problem}")),
        None => Ok(()),
    }
}
