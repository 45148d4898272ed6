//! What every dialect is translated to.

use crate::diagnostics::Diagnostics;

/// Abbe numbers below this are no glass: the lowest of any optical glass is about 16, of a gemstone about 10.
const LOWEST_CREDIBLE_ABBE_NUMBER: f64 = 5.0;

/// No transparent solid or liquid has an index above this in the visible (diamond 2.42, rutile 2.9, silicon carbide 2.7).
const HIGHEST_CREDIBLE_INDEX: f64 = 4.0;

/// How a surface treats the light that falls on it, with the reason in words.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) enum Response {
    /// The surface is not there.
    CutOut(String),
    /// Light passes.
    Transmissive { why: String, rough: bool, thin_walled: bool },
    /// A metal.
    Metal { why: String, rough: bool },
    /// Neither.
    Opaque(String),
}

/// An index at the d line and what the shader says of its dispersion.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Glass {
    /// n_d > 0, finite.
    pub(in super::super) ior: f64,
    /// Where `ior` comes from, in words.
    pub(in super::super) ior_source: String,
    /// The input that `ior` comes from, for errors.
    pub(in super::super) ior_place: String,
    /// V_d > 0, if the shader states dispersion.
    pub(in super::super) abbe_number: Option<f64>,
    /// Where the Abbe number comes from.
    pub(in super::super) abbe_source: String,
    /// The input that the Abbe number comes from, for errors; that of the index where there is none.
    pub(in super::super) abbe_place: String,
}

impl Glass {
    /// Names numbers that are no material's: mostly they belong to another input, or to another convention.
    pub(super) fn warn_if_suspect(&self, diagnostics: &mut Diagnostics) {
        if self.ior < 1.0 || self.ior > HIGHEST_CREDIBLE_INDEX {
            diagnostics.warn(
                "suspect-ior",
                &self.ior_place,
                format!(
                    "n_d = {} is no transparent medium's (1 to {HIGHEST_CREDIBLE_INDEX}): indices here are absolute, not \
                     ratios across the surface",
                    self.ior
                ),
            );
        }
        if let Some(number) = self.abbe_number.filter(|&number| number < LOWEST_CREDIBLE_ABBE_NUMBER) {
            diagnostics.warn(
                "suspect-abbe-number",
                &self.abbe_place,
                format!(
                    "V_d = {number} disperses more than any medium (glass has 16 to 95, lower disperses more): is this an \
                     Abbe number where a scale is meant, or a scale where an Abbe number is?"
                ),
            );
        }
    }
}

/// Beer's law as shaders state it: what is left of white light after a distance.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Attenuation {
    /// Transmittance of each primary in 0..=1; not white.
    pub(in super::super) color: [f64; 3],
    /// Over this many stage units, positive.
    pub(in super::super) distance: f64,
    /// The input that the colour comes from, for errors and the plan.
    pub(in super::super) place: String,
}
