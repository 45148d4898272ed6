//! The dialects against numbers worked out by hand from each specification's formula, and against `docs/materials.md`.

mod documentation;
mod forms;
mod refusals;

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::super::{Kind, Material, ScalarIor, compile_alone};
use super::*;
use crate::diagnostics::Diagnostics;
use crate::scene::description;

const CENTIMETERS: Context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 0.01 };

/// A shader with the inputs of `values`, by name.
fn shader(id: &str, values: &Value) -> Shader {
    let inputs: BTreeMap<_, _> = values
        .as_object()
        .expect("inputs by name")
        .iter()
        .map(|(name, value)| (name.clone(), json!({"type": "float", "value": value})))
        .collect();
    serde_json::from_value(json!({"path": "/M/S", "id": id, "terminal": "outputs:surface", "inputs": inputs}))
        .expect("is a shader")
}

fn material(id: &str, values: &Value) -> description::Material {
    serde_json::from_value(json!({"path": "/M", "surface": shader(id, values)})).expect("is a material")
}

fn compiled(id: &str, values: &Value) -> (Material, Diagnostics) {
    let mut diagnostics = Diagnostics::default();
    let material = compile_alone(&material(id, values), &CENTIMETERS, &mut diagnostics)
        .unwrap_or_else(|error| panic!("{id} {values}: {error}"));
    (material, diagnostics)
}

fn kinds_of(diagnostics: &Diagnostics) -> Vec<&str> {
    diagnostics.warnings().iter().map(|warning| warning.kind.as_str()).collect()
}

/// `kind` in one word, with `rough` and `thin` where they apply.
fn word(kind: &Kind) -> String {
    match kind {
        Kind::Dielectric { rough, thin_walled, .. } => {
            format!("{}{}glass", if *thin_walled { "thin " } else { "" }, if *rough { "rough " } else { "" })
        }
        Kind::Mirror { .. } => "mirror".to_owned(),
        Kind::PassThrough => "cut out".to_owned(),
        Kind::Opaque => "opaque".to_owned(),
    }
}

fn name_of(declared: &Declared) -> &'static str {
    match declared {
        Declared::Number(input) => input.name,
        Declared::Color(input) => input.name,
        Declared::Switch(input) => input.name,
        Declared::Integer(input) => input.name,
        Declared::Word(input) => input.name,
        Declared::Unset(name) => name,
    }
}
