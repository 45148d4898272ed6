//! Our own attributes on a material, its shader and its interface: which law of n(λ) they state, which absorption and
//! which priority.
//!
//! Which of several forms is meant is decided here; `compile` makes the law of it, `absorption` reads k(λ) and plates.

mod absorption;
mod compile;
#[cfg(test)]
mod tests;

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::catalog;
use crate::optics::dispersion::Dispersion;
use crate::optics::media::Priority;
use crate::optics::reflectance::MeasuredReflectance;

use super::values::Values;

pub(super) use absorption::StatedAbsorption;

const GLASS: &str = "abbe:glass";
const LAW: &str = "abbe:dispersion:law";
const ND: &str = "abbe:dispersion:nd";
const VD: &str = "abbe:dispersion:vd";
const CAUCHY: &str = "abbe:dispersion:cauchy";
const SELLMEIER_B: &str = "abbe:dispersion:sellmeier:b";
const SELLMEIER_C: &str = "abbe:dispersion:sellmeier:c";
const FORMULA: &str = "abbe:dispersion:formula";
const COEFFICIENTS: &str = "abbe:dispersion:coefficients";
const TABLE: &str = "abbe:dispersion:table";
const VALID_RANGE: &str = "abbe:dispersion:validRange";
const OUT_OF_RANGE: &str = "abbe:dispersion:outOfRange";
const EXTINCTION: &str = "abbe:extinction:table";
const TRANSMITTANCE: &str = "abbe:internalTransmittance:table";
const THICKNESS: &str = "abbe:internalTransmittance:thickness";
const SCALE: &str = "abbe:dispersion:scale";
/// Of AbbeReflectanceAPI.
const REFLECTANCE: &str = "abbe:reflectance:table";
const PRIORITY: &str = "abbe:dielectricPriority";

/// Everything that AbbeDispersionAPI declares.
const ATTRIBUTES: &[&str] = &[
    GLASS,
    LAW,
    ND,
    VD,
    CAUCHY,
    SELLMEIER_B,
    SELLMEIER_C,
    FORMULA,
    COEFFICIENTS,
    TABLE,
    VALID_RANGE,
    OUT_OF_RANGE,
    EXTINCTION,
    TRANSMITTANCE,
    THICKNESS,
    SCALE,
    PRIORITY,
];

/// The laws that can be stated, by precedence where several are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Constant,
    Glass,
    Sellmeier,
    Cauchy,
    Formula,
    Table,
    AbbeNumber,
}

impl Form {
    const BY_PRECEDENCE: [Self; 6] =
        [Self::Glass, Self::Sellmeier, Self::Cauchy, Self::Formula, Self::Table, Self::AbbeNumber];

    fn token(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Glass => "glass",
            Self::Sellmeier => "sellmeier",
            Self::Cauchy => "cauchy",
            Self::Formula => "formula",
            Self::Table => "table",
            Self::AbbeNumber => "abbeNumber",
        }
    }

    fn of_token(token: &str) -> Option<Self> {
        std::iter::once(Self::Constant).chain(Self::BY_PRECEDENCE).find(|form| form.token() == token)
    }

    /// The laws that `values` authors, by precedence.
    fn authored(values: &Values<'_>) -> Result<Vec<Self>> {
        let mut authored = Vec::new();
        for form in Self::BY_PRECEDENCE {
            if form.is_authored(values)? {
                authored.push(form);
            }
        }
        Ok(authored)
    }

    /// The attribute that an error or a plan points to.
    fn place(self, values: &Values<'_>) -> String {
        values.place(match self {
            Self::Constant => ND,
            Self::Glass => GLASS,
            Self::Sellmeier => SELLMEIER_B,
            Self::Cauchy => CAUCHY,
            Self::Formula => COEFFICIENTS,
            Self::Table => TABLE,
            Self::AbbeNumber if !values.has(VD) => ND,
            Self::AbbeNumber => VD,
        })
    }

    /// Whether `values` authors this law. Fallbacks written out ("" and []) and a zero index say nothing; a zero Abbe
    /// number does: no dispersion.
    fn is_authored(self, values: &Values<'_>) -> Result<bool> {
        let list = |name: &str| values.raw(name).is_some_and(|a| !a.value.as_array().is_some_and(Vec::is_empty));
        Ok(match self {
            Self::Constant => false,
            Self::Glass => values.text(GLASS)?.is_some(),
            Self::Sellmeier => list(SELLMEIER_B) || list(SELLMEIER_C),
            Self::Cauchy => list(CAUCHY),
            Self::Formula => values.int(FORMULA)?.is_some_and(|formula| formula != 0) || list(COEFFICIENTS),
            Self::Table => list(TABLE),
            Self::AbbeNumber => values.has(VD) || values.raw(ND).is_some_and(|a| a.value.as_f64() != Some(0.0)),
        })
    }
}

/// A law with the place that states it.
#[derive(Clone, Debug)]
pub(super) struct Stated {
    /// The law, unscaled.
    pub(super) dispersion: Dispersion,
    /// The material of the catalogue that it is the law of.
    pub(super) glass: Option<catalog::Entry>,
    /// Where it stands, for the plan.
    pub(super) source: String,
}

/// What our attributes say, looked up in the order of the places given.
pub(super) struct Authored<'a> {
    places: Vec<Values<'a>>,
}

impl<'a> Authored<'a> {
    pub(super) fn new(places: Vec<Values<'a>>) -> Self {
        Self { places }
    }

    /// Whether any law is authored anywhere.
    pub(super) fn has_law(&self) -> Result<bool> {
        Ok(self.stating()?.is_some())
    }

    /// The first place that states a law: one place states the whole law, so that coefficients never mix.
    fn stating(&self) -> Result<Option<&Values<'a>>> {
        for values in &self.places {
            if values.text(LAW)?.is_some() {
                return Ok(Some(values));
            }
            if !Form::authored(values)?.is_empty() {
                return Ok(Some(values));
            }
        }
        Ok(None)
    }

    /// The place that states the law and the form that counts there: what `abbe:dispersion:law` says, or the first.
    fn decided(&self) -> Result<Option<(&Values<'a>, Form)>> {
        let Some(values) = self.stating()? else { return Ok(None) };
        let form = match values.text(LAW)? {
            Some(token) => Form::of_token(token),
            None => Form::authored(values)?.first().copied(),
        };
        match form {
            Some(form) => Ok(Some((values, form))),
            None => values.refuse(
                LAW,
                "author glass, sellmeier, cauchy, formula, table, abbeNumber or constant, or nothing to infer it",
            ),
        }
    }

    /// The law, if one is stated. `shader_ior` is the index that n_d = 0 refers to.
    pub(super) fn law(&self, shader_ior: f64, diagnostics: &mut Diagnostics) -> Result<Option<Stated>> {
        let Some((values, form)) = self.decided()? else { return Ok(None) };
        warn_of_several(form, values, diagnostics)?;
        let (dispersion, glass) = compile::dispersion(form, values, shader_ior, diagnostics)?;
        let source = match form {
            Form::Constant => values.place(LAW),
            _ => form.place(values),
        };
        Ok(Some(Stated { dispersion, glass, source }))
    }

    /// Names every attribute that is none of ours.
    pub(super) fn warn_of_unread(&self, diagnostics: &mut Diagnostics) {
        for values in &self.places {
            // A reflectance is the material's own.
            let is_read = |name: &str| ATTRIBUTES.contains(&name) || (name == REFLECTANCE && values.is_own());
            for name in values.names().filter(|name| !is_read(name)) {
                diagnostics.warn(
                    "unread-attribute",
                    values.place(name),
                    "is no attribute of AbbeDispersionAPI and has no effect: is it misspelt?",
                );
            }
        }
    }

    /// The artistic factor on n(λ) − n_d, 1 if not authored.
    pub(super) fn scale(&self, diagnostics: &mut Diagnostics) -> Result<f64> {
        for values in &self.places {
            if let Some(scale) = values.double(SCALE, diagnostics)? {
                if scale < 0.0 {
                    return values.refuse(SCALE, "author 0 (off), 1 (physical) or any positive factor");
                }
                return Ok(scale);
            }
        }
        Ok(1.0)
    }

    /// The place of the scale, for errors about its result.
    pub(super) fn scale_place(&self) -> String {
        let place = self.places.iter().find(|values| values.has(SCALE)).or(self.places.first());
        place.map_or_else(String::new, |values| values.place(SCALE))
    }

    /// The measured reflectance of the material, and where it stands.
    pub(super) fn reflectance(&self, diagnostics: &mut Diagnostics) -> Result<Option<(MeasuredReflectance, String)>> {
        let Some(values) = self.places.iter().find(|values| values.is_own()) else { return Ok(None) };
        let Some(entries) = values.pairs(REFLECTANCE, diagnostics)? else { return Ok(None) };
        let place = values.place(REFLECTANCE);
        let measured = MeasuredReflectance::table(&entries).map_err(|problem| Error::scene(&place, problem))?;
        Ok(Some((measured, place)))
    }

    /// The dielectric priority and where it stands; `None` where none is set (0 is unset).
    pub(super) fn priority(&self) -> Result<Option<(Priority, String)>> {
        for values in &self.places {
            if let Some(number) = values.int(PRIORITY)? {
                let priority = Priority::lower_wins(number);
                return Ok((priority != Priority::UNSET)
                    .then(|| (priority, format!("{number} (lower wins) from {}", values.place(PRIORITY)))));
            }
        }
        Ok(None)
    }
}

/// Names what is authored beside `form` and has no effect, whether a rule or the author overrules it.
fn warn_of_several(form: Form, values: &Values<'_>, diagnostics: &mut Diagnostics) -> Result<()> {
    let authored = Form::authored(values)?;
    if values.text(LAW)?.is_none() {
        if authored.len() > 1 {
            let names: Vec<_> = authored.iter().map(|form| form.token()).collect();
            diagnostics.warn(
                "several-dispersion-laws",
                values.place(LAW),
                format!("{} are authored, {} is used: author the law", names.join(", "), form.token()),
            );
        }
        return Ok(());
    }
    let mut silenced = Vec::new();
    for &other in authored.iter().filter(|&&other| other != form) {
        // A constant index is that of nd; an Abbe number of 0 says the same as it does.
        let agrees =
            form == Form::Constant && other == Form::AbbeNumber && values.number(VD)?.is_none_or(|vd| vd == 0.0);
        if !agrees {
            silenced.push(other.token());
        }
    }
    if !silenced.is_empty() {
        let (names, has) = (silenced.join(", "), if silenced.len() == 1 { "has" } else { "have" });
        diagnostics.warn(
            "silenced-dispersion-law",
            values.place(LAW),
            format!("is {}: what is authored for {names} {has} no effect", form.token()),
        );
    }
    Ok(())
}
