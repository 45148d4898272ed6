//! Our own attributes on a material, its shader and its interface: which law of n(λ) they state.

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::dispersion::Dispersion;
use crate::optics::media::Priority;
use crate::spectrum;

use super::values::Values;

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
const SCALE: &str = "abbe:dispersion:scale";
const PRIORITY: &str = "abbe:dielectricPriority";

/// Read here.
const READ: &[&str] = &[
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
    SCALE,
    PRIORITY,
];

/// Declared by the schema, and not computed with: absorption and metals have no part in the specular chain.
const UNREAD: &[&str] =
    &["abbe:extinction:table", "abbe:internalTransmittance:table", "abbe:internalTransmittance:thickness"];

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
            for form in Form::BY_PRECEDENCE {
                if form.is_authored(values)? {
                    return Ok(Some(values));
                }
            }
        }
        Ok(None)
    }

    /// The law, if one is stated. `shader_ior` is the index that n_d = 0 refers to.
    pub(super) fn law(&self, shader_ior: f64, diagnostics: &mut Diagnostics) -> Result<Option<Stated>> {
        let Some(values) = self.stating()? else { return Ok(None) };
        let mut authored = Vec::new();
        for form in Form::BY_PRECEDENCE {
            if form.is_authored(values)? {
                authored.push(form);
            }
        }
        let form = match values.text(LAW)? {
            Some(token) => match Form::of_token(token) {
                Some(form) => form,
                None => {
                    return values.refuse(
                        LAW,
                        "author constant, abbeNumber, cauchy, sellmeier or formula, or nothing to infer it",
                    );
                }
            },
            None => {
                if let [first, _, ..] = authored[..] {
                    let names: Vec<_> = authored.iter().map(|form| form.token()).collect();
                    diagnostics.warn(
                        "several-dispersion-laws",
                        values.place(LAW),
                        format!("{} are authored, {} is used: author the law", names.join(", "), first.token()),
                    );
                }
                authored[0]
            }
        };
        let dispersion = compile(form, values, shader_ior, diagnostics)?;
        check_range(values, diagnostics)?;
        let source = match form {
            Form::Constant => values.place(LAW),
            Form::AbbeNumber if !values.has(VD) => values.place(ND),
            _ => values.place(attribute(form)),
        };
        Ok(Some(Stated { dispersion, source }))
    }

    /// Names every attribute that has no effect: not computed with yet, or misspelt.
    pub(super) fn warn_of_unread(&self, diagnostics: &mut Diagnostics) {
        for values in &self.places {
            for name in values.names().filter(|name| !READ.contains(name)) {
                let message = match UNREAD.contains(&name) {
                    true => "absorption is not computed by this version: the attribute has no effect",
                    false => "is no attribute of AbbeDispersionAPI and has no effect: is it misspelt?",
                };
                diagnostics.warn("unread-attribute", values.place(name), message);
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

/// The attribute that an error or a plan points to.
fn attribute(form: Form) -> &'static str {
    match form {
        Form::Constant => ND,
        Form::Glass => GLASS,
        Form::Sellmeier => SELLMEIER_B,
        Form::Cauchy => CAUCHY,
        Form::Formula => COEFFICIENTS,
        Form::Table => TABLE,
        Form::AbbeNumber => VD,
    }
}

fn compile(form: Form, values: &Values<'_>, shader_ior: f64, diagnostics: &mut Diagnostics) -> Result<Dispersion> {
    let at = |name: &str| {
        let place = values.place(name);
        move |problem: String| Error::scene(place, problem)
    };
    match form {
        Form::Constant => Dispersion::constant(index(values, shader_ior, diagnostics)?).map_err(at(ND)),
        Form::AbbeNumber => {
            let nd = index(values, shader_ior, diagnostics)?;
            let Some(vd) = values.double(VD, diagnostics)? else {
                if values.text(LAW)?.is_some() {
                    return values.refuse(VD, "law abbeNumber needs it: author the Abbe number, or 0 for no dispersion");
                }
                return Dispersion::constant(nd).map_err(at(ND));
            };
            if vd < 0.0 {
                return values.refuse(VD, "author a positive Abbe number, or 0 for no dispersion");
            }
            match vd > 0.0 {
                true => Dispersion::from_abbe_number(nd, vd).map_err(at(VD)),
                false => Dispersion::constant(nd).map_err(at(ND)),
            }
        }
        Form::Cauchy => {
            Dispersion::cauchy(&needed(values, CAUCHY, "A, B (µm²), C (µm⁴) …", diagnostics)?).map_err(at(CAUCHY))
        }
        Form::Sellmeier => {
            let b = needed(values, SELLMEIER_B, "B1 B2 …", diagnostics)?;
            let c = needed(values, SELLMEIER_C, "C1 C2 … in µm²", diagnostics)?;
            if b.len() != c.len() {
                return values.refuse(
                    SELLMEIER_C,
                    format!("has {} values where {SELLMEIER_B} has {}: author one C for each B", c.len(), b.len()),
                );
            }
            Dispersion::sellmeier(&b, &c).map_err(at(SELLMEIER_B))
        }
        Form::Formula => formula(values, diagnostics),
        Form::Glass => values.refuse(
            GLASS,
            "the glass catalogue is not part of this version: author its coefficients as abbe:dispersion:sellmeier:b and :c",
        ),
        Form::Table => values.refuse(
            TABLE,
            "tabulated indices are not part of this version: author abbe:dispersion:sellmeier:b and :c or abbe:dispersion:cauchy",
        ),
    }
}

/// n_d as authored, or the shader's where it is 0 or missing.
fn index(values: &Values<'_>, shader_ior: f64, diagnostics: &mut Diagnostics) -> Result<f64> {
    match values.double(ND, diagnostics)? {
        Some(nd) if nd < 0.0 => values.refuse(ND, "author a positive index, or 0 for the shader's"),
        Some(nd) if nd > 0.0 => Ok(nd),
        _ => Ok(shader_ior),
    }
}

fn needed(values: &Values<'_>, name: &str, what: &str, diagnostics: &mut Diagnostics) -> Result<Vec<f64>> {
    match values.doubles(name, diagnostics)? {
        Some(list) => Ok(list),
        None => values.refuse(name, format!("the law needs it: author {what}")),
    }
}

/// The formulas of refractiveindex.info that are one of our laws. Coefficients are C1, then pairs; λ in µm.
fn formula(values: &Values<'_>, diagnostics: &mut Diagnostics) -> Result<Dispersion> {
    let Some(number) = values.int(FORMULA)?.filter(|&number| number != 0) else {
        return values.refuse(FORMULA, "author the number of the formula that the coefficients belong to");
    };
    let coefficients = needed(values, COEFFICIENTS, "the formula's coefficients", diagnostics)?;
    let (constant, pairs) = (coefficients[0], &coefficients[1..]);
    let is_known = matches!(number, 1 | 2 | 5);
    if is_known && pairs.len() % 2 != 0 {
        return values.refuse(
            COEFFICIENTS,
            format!(
                "formula {number} takes C1 and then pairs, an odd number of values; {} are authored",
                coefficients.len()
            ),
        );
    }
    let (first, second): (Vec<f64>, Vec<f64>) = pairs.chunks_exact(2).map(|pair| (pair[0], pair[1])).unzip();
    let built = match number {
        // n² − 1 = C1 + Σ C2 λ²/(λ² − C3²)
        1 => Dispersion::sellmeier_squared(constant, &first, &second),
        // n² − 1 = C1 + Σ C2 λ²/(λ² − C3): the constant is a term whose pole is at 0.
        2 if constant != 0.0 => {
            let b: Vec<_> = std::iter::once(constant).chain(first).collect();
            let c: Vec<_> = std::iter::once(0.0).chain(second).collect();
            Dispersion::sellmeier(&b, &c)
        }
        2 => Dispersion::sellmeier(&first, &second),
        // n = C1 + Σ C2 λ^C3
        5 => {
            let mut cauchy = vec![constant];
            for (&factor, &power) in first.iter().zip(&second) {
                let order = -power / 2.0;
                let is_even_inverse = order.fract() == 0.0 && (1.0..=8.0).contains(&order);
                if !is_even_inverse {
                    return values.refuse(
                        COEFFICIENTS,
                        format!("formula 5 with λ^{power} is not part of this version: powers are -2, -4, … -16"),
                    );
                }
                // Whole and within 1..=8 by the check above.
                let slot = order as usize;
                cauchy.resize(cauchy.len().max(slot + 1), 0.0);
                cauchy[slot] += factor;
            }
            Dispersion::cauchy(&cauchy)
        }
        3 | 4 | 6..=9 => {
            return values.refuse(
                FORMULA,
                "this formula is not part of this version: 1, 2 and 5 are; fit the data with abbe:dispersion:sellmeier:b and :c",
            );
        }
        _ => return values.refuse(FORMULA, "refractiveindex.info has the formulas 1 to 9"),
    };
    built.map_err(|problem| Error::scene(values.place(COEFFICIENTS), problem))
}

/// The range that was authored for the law: it must hold the reference wavelength.
fn check_range(values: &Values<'_>, diagnostics: &mut Diagnostics) -> Result<()> {
    if !matches!(values.text(OUT_OF_RANGE)?, None | Some("clamp" | "error" | "extrapolate")) {
        return values.refuse(OUT_OF_RANGE, "author clamp, error or extrapolate");
    }
    let Some(range) = values.doubles(VALID_RANGE, diagnostics)? else { return Ok(()) };
    let [from, to] = range[..] else { return values.refuse(VALID_RANGE, "author two wavelengths in nm") };
    if from == 0.0 && to == 0.0 {
        return Ok(());
    }
    let reference = spectrum::REFERENCE.nanometers();
    if !(from < to && from <= reference && reference <= to) {
        return values.refuse(
            VALID_RANGE,
            format!("author increasing wavelengths in nm around the reference wavelength {reference}"),
        );
    }
    // Transport and observer go from 360 to 830 nm (DESIGN 5).
    if from > 360.0 || to < 830.0 {
        diagnostics.warn(
            "valid-range-unread",
            values.place(VALID_RANGE),
            "this version extrapolates the law outside its valid range, down to 360 nm and up to 830 nm",
        );
    }
    Ok(())
}
