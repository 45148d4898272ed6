//! Typed reading of authored values: a number, list, word or switch at one prim, with its place in every error.

use serde_json::Value;

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::scene::description::{Authored, AuthoredMap};

/// Authored values of one prim.
pub(super) struct Values<'a> {
    map: &'a AuthoredMap,
    path: &'a str,
    /// What stands before the map's keys on the prim: `inputs:` or nothing.
    prefix: &'static str,
}

impl<'a> Values<'a> {
    pub(super) fn new(map: &'a AuthoredMap, path: &'a str, prefix: &'static str) -> Self {
        Self { map, path, prefix }
    }

    /// Whether these are the prim's own attributes, no inputs.
    pub(super) fn is_own(&self) -> bool {
        self.prefix.is_empty()
    }

    /// `</World/Glass>.inputs:ior`
    pub(super) fn place(&self, name: &str) -> String {
        format!("<{}>.{}{name}", self.path, self.prefix)
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.map.contains_key(name)
    }

    /// The names of everything authored.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.map.keys().map(String::as_str)
    }

    fn error(&self, name: &str, problem: impl AsRef<str>) -> Error {
        let shown = self.map.get(name).map_or_else(|| "not authored".to_owned(), |a| shown(&a.value));
        Error::scene(self.place(name), format!("is {shown}: {}", problem.as_ref()))
    }

    /// An error about an authored value, which it shows.
    pub(super) fn refuse<T>(&self, name: &str, problem: impl AsRef<str>) -> Result<T> {
        Err(self.error(name, problem))
    }

    /// A finite number; the mean of a colour's components (an opacity may be authored as a colour).
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>> {
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let number = match &authored.value {
            Value::Array(parts) if !parts.is_empty() && parts.len() <= 4 => {
                let parts: Option<Vec<_>> = parts.iter().map(|part| meant(authored, part)).collect();
                parts.map(|parts| mean(&parts))
            }
            value => meant(authored, value),
        };
        number.map(Some).ok_or_else(|| self.error(name, "author a finite number"))
    }

    /// A colour, or one number for a grey; alpha is left out.
    pub(super) fn color(&self, name: &str) -> Result<Option<[f64; 3]>> {
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let color = match &authored.value {
            Value::Array(parts) => match parts[..] {
                [ref r, ref g, ref b] | [ref r, ref g, ref b, _] => {
                    let [r, g, b] = [r, g, b].map(|part| meant(authored, part));
                    r.zip(g).zip(b).map(|((r, g), b)| [r, g, b])
                }
                _ => None,
            },
            value => meant(authored, value).map(|grey| [grey; 3]),
        };
        color.map(Some).ok_or_else(|| self.error(name, "author a colour of three finite numbers"))
    }

    /// A number declared `double` by the schema: single precision is accepted with a warning.
    pub(super) fn double(&self, name: &str, diagnostics: &mut Diagnostics) -> Result<Option<f64>> {
        self.warn_of_single_precision(name, diagnostics);
        match self.map.get(name).map(|a| meant(a, &a.value)) {
            None => Ok(None),
            Some(Some(number)) => Ok(Some(number)),
            Some(None) => self.refuse(name, "author a finite number of type double"),
        }
    }

    /// A list declared `double[]`; absent where nothing or an empty list is authored.
    pub(super) fn doubles(&self, name: &str, diagnostics: &mut Diagnostics) -> Result<Option<Vec<f64>>> {
        self.warn_of_single_precision(name, diagnostics);
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let list = match &authored.value {
            Value::Array(parts) => parts.iter().map(finite).collect::<Option<Vec<_>>>(),
            _ => None,
        };
        match list {
            Some(list) => Ok((!list.is_empty()).then_some(list)),
            None => self.refuse(name, "author a list of finite numbers of type double[]"),
        }
    }

    /// A list declared `double2[]`, of pairs; absent where nothing or an empty list is authored.
    pub(super) fn pairs(&self, name: &str, diagnostics: &mut Diagnostics) -> Result<Option<Vec<[f64; 2]>>> {
        self.warn_of_single_precision(name, diagnostics);
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let pair = |value: &Value| match value.as_array()?.as_slice() {
            [first, second] => Some([finite(first)?, finite(second)?]),
            _ => None,
        };
        let list = authored.value.as_array().map(|parts| parts.iter().map(pair).collect::<Option<Vec<_>>>());
        match list.flatten() {
            Some(list) => Ok((!list.is_empty()).then_some(list)),
            None => self.refuse(name, "author a list of pairs of finite numbers of type double2[]"),
        }
    }

    /// An integer.
    pub(super) fn int(&self, name: &str) -> Result<Option<i32>> {
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let int = authored.value.as_i64().and_then(|i| i32::try_from(i).ok());
        int.map(Some).ok_or_else(|| self.error(name, "author an int of 32 bits"))
    }

    /// A switch; numbers count as in C, since MaterialX enumerations cross as integers.
    pub(super) fn switch(&self, name: &str) -> Result<Option<bool>> {
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        let value = authored.value.as_bool().or_else(|| authored.value.as_i64().map(|i| i != 0));
        value.map(Some).ok_or_else(|| self.error(name, "author a bool"))
    }

    /// A word; absent where nothing or an empty one is authored.
    pub(super) fn text(&self, name: &str) -> Result<Option<&'a str>> {
        let Some(authored) = self.map.get(name) else { return Ok(None) };
        match authored.value.as_str() {
            Some(text) => Ok((!text.is_empty()).then_some(text)),
            None => self.refuse(name, "author a token or string"),
        }
    }

    /// The value as it was authored.
    pub(super) fn raw(&self, name: &str) -> Option<&'a Authored> {
        self.map.get(name)
    }

    fn warn_of_single_precision(&self, name: &str, diagnostics: &mut Diagnostics) {
        let Some(authored) = self.map.get(name) else { return };
        let base = authored.type_name.trim_end_matches("[]").trim_end_matches(|c: char| c.is_ascii_digit());
        let digits = match base {
            "float" | "color3f" => "8",
            "half" => "4",
            _ => return,
        };
        diagnostics.warn(
            "float-authored",
            self.place(name),
            format!(
                "is authored as {} with {digits} digits where double is declared: author it as double",
                authored.type_name
            ),
        );
    }
}

/// A finite number. JSON has no NaN and no infinity: bridges write them as null or as a word, neither of which is one.
fn finite(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.is_finite())
}

/// The mean; of equal numbers exactly that number.
fn mean(parts: &[f64]) -> f64 {
    parts[0] + parts.iter().map(|part| part - parts[0]).sum::<f64>() / parts.len() as f64
}

/// A number as it was meant. USD hands 1.52 of type float over as 1.5199999809…: of the numbers that are the same float,
/// the one with the fewest digits was written.
fn meant(authored: &Authored, value: &Value) -> Option<f64> {
    let number = finite(value)?;
    let single = number as f32;
    let is_single =
        matches!(scalar_type(authored), "float" | "color") && f64::from(single).to_bits() == number.to_bits();
    // The shortest text that names a float is what Display gives.
    if is_single { single.to_string().parse().ok() } else { Some(number) }
}

/// `float` of float, float3 and float[]; `color` of the single precision colours.
fn scalar_type(authored: &Authored) -> &str {
    match authored.type_name.as_str() {
        "color3f" | "color4f" => "color",
        name => name.trim_end_matches("[]").trim_end_matches(|c: char| c.is_ascii_digit()),
    }
}

/// A value for an error line, cut where it is long.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = if value.is_null() { "not finite".to_owned() } else { value.to_string() };
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
