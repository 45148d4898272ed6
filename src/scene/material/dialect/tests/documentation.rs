//! `docs/materials.md` says what the code does.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::super::inputs::Input;
use super::*;
use crate::spectrum::lines;

/// As `docs/materials.md` writes it.
fn default_of(declared: &Declared) -> String {
    match declared {
        Declared::Number(input) => input.default.to_string(),
        // Every default is a grey.
        Declared::Color(Input { default: [grey, ..], .. }) => grey.to_string(),
        Declared::Switch(input) => input.default.to_string(),
        Declared::Integer(input) => input.default.to_string(),
        Declared::Word(input) => input.default.to_owned(),
        Declared::Unset(_) => "none".to_owned(),
    }
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The words between `open` and `close`.
fn between<'a>(text: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    text.split(open).skip(1).filter_map(|rest| rest.split_once(close).map(|(word, _)| word)).collect()
}

/// What stands in backticks.
fn code(markdown: &str) -> impl Iterator<Item = &str> {
    markdown.split('`').skip(1).step_by(2)
}

fn every_input<'a>(dialect: &&'a dyn Dialect) -> impl Iterator<Item = &'a Declared> {
    dialect.inputs().iter().chain(dialect.transported())
}

#[test]
fn every_input_that_a_dialect_names_is_in_its_list() {
    let listed: BTreeSet<_> = DIALECTS.iter().flat_map(every_input).map(name_of).collect();
    let mut named = BTreeSet::new();
    for entry in fs::read_dir(root().join("src/scene/material/dialect")).expect("is there") {
        let path = entry.expect("is readable").path();
        if path.is_file() {
            named.extend(between(&read(&path), "input(\"", "\"").into_iter().map(str::to_owned));
        }
    }
    named.insert("attenuation_distance".to_owned());
    assert_eq!(named, listed.into_iter().map(str::to_owned).collect());
}

/// The rows of the Markdown table whose header begins with `first`, as cells.
fn table(document: &str, first: &str) -> Vec<Vec<String>> {
    let mut lines = document.lines().skip_while(|line| !line.starts_with(&format!("| {first} |")));
    assert!(lines.next().is_some(), "docs/materials.md has no table '{first}'");
    lines
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect())
        .collect()
}

#[test]
fn the_documentation_lists_every_dialect_with_its_inputs_and_defaults() {
    let document = read(&root().join("docs/materials.md"));
    let rows = table(&document, "shader");
    assert_eq!(rows.len(), DIALECTS.len(), "one row a dialect");
    for (dialect, row) in DIALECTS.iter().zip(rows) {
        let ids: Vec<_> = code(&row[0]).collect();
        assert_eq!(ids, dialect.ids(), "{row:?}");
        assert_eq!(documented(&row[1..]), stated(dialect.inputs()), "{ids:?}");
    }
}

#[test]
fn the_documentation_lists_every_dialect_with_what_light_transport_reads_beside() {
    let document = read(&root().join("docs/materials.md"));
    let rows = table(&document, "model");
    assert_eq!(rows.len(), DIALECTS.len(), "one row a dialect");
    for (dialect, row) in DIALECTS.iter().zip(rows) {
        let ids: Vec<_> = code(&row[0]).collect();
        assert_eq!(ids, dialect.ids(), "{row:?}");
        assert_eq!(documented(&row[1..]), stated(dialect.transported()), "{ids:?}");
        // What is named without a default is read by both.
        let names: BTreeSet<&str> = every_input(dialect).map(name_of).collect();
        let cells = row[1..].join(" ");
        for word in code(&cells).filter(|word| !word.contains(" = ") && !word.ends_with("normal")) {
            assert!(names.contains(word), "{ids:?} does not read {word}");
        }
    }
}

/// The inputs with their defaults in the cells of a table.
fn documented(cells: &[String]) -> BTreeSet<String> {
    code(&cells.join(" ")).filter(|word| word.contains(" = ")).map(str::to_owned).collect()
}

fn stated(inputs: &[Declared]) -> BTreeSet<String> {
    inputs.iter().map(|declared| format!("{} = {}", name_of(declared), default_of(declared))).collect()
}

#[test]
fn the_examples_of_the_documentation_come_out_as_it_says() {
    let document = read(&root().join("docs/materials.md"));
    let rows = table(&document, "example");
    assert!(rows.len() >= 8);
    for row in rows {
        let [id, inputs, nd, vd, a, b] = &row[..] else { panic!("{row:?}") };
        let values: serde_json::Map<String, Value> = inputs
            .trim_matches('`')
            .split(", ")
            .filter(|part| !part.is_empty())
            .map(|part| {
                let (name, value) = part.split_once(" = ").unwrap_or_else(|| panic!("{part}"));
                (name.to_owned(), serde_json::from_str(value).unwrap_or_else(|_| panic!("{part}")))
            })
            .collect();
        let (material, _) = compiled(id.trim_matches('`'), &Value::Object(values));
        let Kind::Dielectric { dispersion, .. } = &material.kind else { panic!("{row:?}: {}", material.chosen) };
        let [n_f, n_d, n_c] = [lines::F, lines::D, lines::C].map(|line| dispersion.at(line).ior);
        let difference = lines::F.micrometers().powi(-2) - lines::C.micrometers().powi(-2);
        let slope = (n_f - n_c) / difference;
        let constant = n_d - slope / lines::D.micrometers().powi(2);
        let abbe_number = dispersion.abbe_number().map_or("none".to_owned(), |vd| format!("{vd:.2}"));
        assert_eq!(&format!("{n_d:.5}"), nd, "{row:?}");
        assert_eq!(&abbe_number, vd, "{row:?}");
        assert_eq!(&format!("{constant:.6}"), a, "{row:?}");
        assert_eq!(&format!("{slope:.6}"), b, "{row:?}");
    }
}

#[test]
fn the_documentation_lists_every_warning() {
    let document = read(&root().join("docs/materials.md"));
    let documented: BTreeSet<String> =
        table(&document, "warning").into_iter().map(|row| row[0].trim_matches('`').to_owned()).collect();
    let mut sources = vec![root().join("src/scene/material.rs")];
    let mut folders = vec![root().join("src/scene/material")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("is there") {
            let path = entry.expect("is readable").path();
            if path.file_stem().is_some_and(|stem| stem == "tests") {
                continue;
            }
            if path.is_dir() { &mut folders } else { &mut sources }.push(path);
        }
    }
    let warned: BTreeSet<String> = sources
        .iter()
        .flat_map(|path| {
            between(&read(path), "diagnostics.warn(", ",").into_iter().map(str::to_owned).collect::<Vec<_>>()
        })
        .filter_map(|word| word.trim().strip_prefix('"').and_then(|word| word.strip_suffix('"')).map(str::to_owned))
        .collect();
    assert_eq!(documented, warned);
}
