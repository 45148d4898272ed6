//! Records that cross the border as plain Python values, by way of JSON: small, once per render.

use abbe::Error;
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::Outcome;

/// `value` as dicts, lists, strings and numbers.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).expect("records have string keys");
    py.import("json")?.call_method1("loads", (text,))
}

/// The record that `text` holds; `what` it is stands in the error.
pub(crate) fn parse<T: DeserializeOwned>(what: &str, text: &str) -> Outcome<T> {
    Ok(serde_json::from_str(text).map_err(|e| Error::usage(what, format!("is not understood: {e}")))?)
}
