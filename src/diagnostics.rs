//! Structured warnings: what a scene has and the renderer lacks or repairs, named once per kind with its places.
//!
//! The core prints nothing; callers show [`Diagnostics`] as text or JSON. Order is that of first occurrence, so two runs
//! of one scene report the same.

use serde::{Deserialize, Serialize};

/// How many example places a warning keeps; the count goes on.
const EXAMPLES: usize = 5;

/// One kind of oddity, with the places where it was met.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warning {
    /// Short stable name: `open-glass-mesh`, `unsupported-prim`.
    pub kind: String,
    /// What was found and what was done about it.
    pub message: String,
    /// The first few prim paths or files concerned.
    pub places: Vec<String>,
    /// How often it was met.
    pub count: u64,
}

/// Warnings collected while a scene is read, built and rendered.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Diagnostics {
    warnings: Vec<Warning>,
}

impl Diagnostics {
    /// Records one occurrence of `kind` at `place`; the same kind and message are counted together.
    pub fn warn(&mut self, kind: &str, place: impl Into<String>, message: impl Into<String>) {
        let (place, message) = (place.into(), message.into());
        if let Some(known) = self.warnings.iter_mut().find(|w| w.kind == kind && w.message == message) {
            known.count += 1;
            if known.places.len() < EXAMPLES && !known.places.contains(&place) {
                known.places.push(place);
            }
        } else {
            self.warnings.push(Warning { kind: kind.to_owned(), message, places: vec![place], count: 1 });
        }
    }

    /// Adds everything that `other` recorded.
    pub fn extend(&mut self, other: &Self) {
        for warning in &other.warnings {
            if let Some(known) =
                self.warnings.iter_mut().find(|w| w.kind == warning.kind && w.message == warning.message)
            {
                known.count += warning.count;
                for place in &warning.places {
                    if known.places.len() < EXAMPLES && !known.places.contains(place) {
                        known.places.push(place.clone());
                    }
                }
            } else {
                self.warnings.push(warning.clone());
            }
        }
    }

    /// All warnings in the order of first occurrence.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.warnings.is_empty()
    }
}

impl std::fmt::Display for Warning {
    /// `</World/Glass> and 3 more: the mesh is open …`
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.places.first().map_or("", String::as_str))?;
        if self.count > 1 {
            write!(f, " and {} more", self.count - 1)?;
        }
        write!(f, ": {}", self.message)
    }
}
