//! From the attributes of one place to a [`Dispersion`]: each form's own attributes, and the range in which it holds.

use super::super::values::Values;
use super::{
    CAUCHY, COEFFICIENTS, FORMULA, Form, GLASS, LAW, ND, OUT_OF_RANGE, SELLMEIER_B, SELLMEIER_C, TABLE, VALID_RANGE, VD,
};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::catalog::{self, Entry};
use crate::optics::dispersion::{Dispersion, Law, OutOfRange, ValidRange};
use crate::spectrum::Wavelength;

/// The law of `form` at the place of `values`, and the material of the catalogue that it is. `shader_ior` is the index that
/// n_d = 0 refers to.
pub(super) fn dispersion(
    form: Form,
    values: &Values<'_>,
    shader_ior: f64,
    diagnostics: &mut Diagnostics,
) -> Result<(Dispersion, Option<Entry>)> {
    let glass = match form {
        Form::Glass => Some(glass(values)?),
        _ => None,
    };
    let law = law(form, values, shader_ior, diagnostics)?;
    let out_of_range = match values.text(OUT_OF_RANGE)? {
        None => OutOfRange::default(),
        Some(text) => match OutOfRange::parse(text) {
            Some(out_of_range) => out_of_range,
            None => return values.refuse(OUT_OF_RANGE, "author clamp, error or extrapolate"),
        },
    };
    let authored = valid_range(values, diagnostics)?;
    if let Some(range) = authored {
        law.check_range(range, out_of_range).or_else(|problem| values.refuse(VALID_RANGE, problem))?;
    }
    let valid = authored.or_else(|| glass.map(|entry| entry.valid_range()));
    let dispersion =
        Dispersion::new(law, valid, out_of_range).map_err(|problem| Error::scene(form.place(values), problem))?;
    if let Some(range) = dispersion.valid_range()
        && dispersion.out_of_range() == OutOfRange::Clamp
        && !range.contains_the_visible()
        && !dispersion.is_constant()
    {
        diagnostics.warn(
            "clamped-index",
            form.place(values),
            format!(
                "the law is valid from {range}: elsewhere in 360–830 nm the index is that of the nearest end and its \
                 derivatives are 0, unless {OUT_OF_RANGE} says otherwise"
            ),
        );
    }
    Ok((dispersion, glass))
}

/// The material of the catalogue that is named.
pub(super) fn glass(values: &Values<'_>) -> Result<Entry> {
    match values.text(GLASS)? {
        Some(name) => catalog::find(name).or_else(|problem| values.refuse(GLASS, problem)),
        None => values.refuse(GLASS, "the law needs it: author a name of the catalogue, such as \"SCHOTT:N-BK7\""),
    }
}

fn law(form: Form, values: &Values<'_>, shader_ior: f64, diagnostics: &mut Diagnostics) -> Result<Law> {
    let at = |name: &str| {
        let place = values.place(name);
        move |problem: String| Error::scene(place, problem)
    };
    match form {
        Form::Constant => Law::constant(index(values, shader_ior, diagnostics)?).map_err(at(ND)),
        Form::AbbeNumber => {
            let nd = index(values, shader_ior, diagnostics)?;
            let Some(vd) = values.double(VD, diagnostics)? else {
                if values.text(LAW)?.is_some() {
                    return values
                        .refuse(VD, "law abbeNumber needs it: author the Abbe number, or 0 for no dispersion");
                }
                return Law::constant(nd).map_err(at(ND));
            };
            if vd < 0.0 {
                return values.refuse(VD, "author a positive Abbe number, or 0 for no dispersion");
            }
            match vd > 0.0 {
                true => Law::abbe_number(nd, vd).map_err(at(VD)),
                false => Law::constant(nd).map_err(at(ND)),
            }
        }
        Form::Cauchy => Law::cauchy(&needed(values, CAUCHY, "A, B (µm²), C (µm⁴) …", diagnostics)?).map_err(at(CAUCHY)),
        Form::Sellmeier => {
            let b = needed(values, SELLMEIER_B, "B1 B2 …", diagnostics)?;
            let c = needed(values, SELLMEIER_C, "C1 C2 … in µm²", diagnostics)?;
            if b.len() != c.len() {
                return values.refuse(
                    SELLMEIER_C,
                    format!("has {} values where {SELLMEIER_B} has {}: author one C for each B", c.len(), b.len()),
                );
            }
            Law::sellmeier(&b, &c).map_err(at(SELLMEIER_B))
        }
        Form::Formula => {
            let Some(number) = values.int(FORMULA)?.filter(|&number| number != 0) else {
                return values.refuse(FORMULA, "author the number of the formula that the coefficients belong to");
            };
            if !(1..=9).contains(&number) {
                return values.refuse(FORMULA, "refractiveindex.info has the formulas 1 to 9");
            }
            let coefficients = needed(values, COEFFICIENTS, "the formula's coefficients", diagnostics)?;
            Law::formula(number, &coefficients).or_else(|problem| values.refuse(COEFFICIENTS, problem))
        }
        Form::Table => match values.pairs(TABLE, diagnostics)? {
            Some(entries) => Law::table(&entries).or_else(|problem| values.refuse(TABLE, problem)),
            None => values.refuse(TABLE, "the law needs it: author pairs (nm, n)"),
        },
        Form::Glass => glass(values)?.law().or_else(|problem| values.refuse(GLASS, problem)),
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

/// The range that is authored; (0, 0) leaves it to the law.
fn valid_range(values: &Values<'_>, diagnostics: &mut Diagnostics) -> Result<Option<ValidRange>> {
    match values.doubles(VALID_RANGE, diagnostics)?.as_deref() {
        None => Ok(None),
        Some([from, to]) if *from == 0.0 && *to == 0.0 => Ok(None),
        Some(&[from, to]) => {
            Ok(Some(ValidRange { from: Wavelength::from_nanometers(from), to: Wavelength::from_nanometers(to) }))
        }
        Some(_) => values.refuse(VALID_RANGE, "author two wavelengths in nm"),
    }
}
