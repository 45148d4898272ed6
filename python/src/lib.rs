//! The Python extension `abbe._core`: a thin border over the core.
//!
//! It converts values, errors and memory and decides nothing. What people call stands in the package `abbe`.

use pyo3::prelude::*;

mod catalog;
mod error;
mod film;
mod json;
mod memory;
mod optics;
mod scene;
mod spectrum;

/// The compiled half of the package `abbe`.
#[pymodule]
mod _core {
    use std::path::PathBuf;

    use super::*;
    use crate::error::{Outcome, released};

    #[pymodule_export]
    use crate::catalog::{PyGlass, glass, glass_database, glasses, nearest_glass};
    #[pymodule_export]
    use crate::film::PyFilm;
    #[pymodule_export]
    use crate::optics::{PyDispersion, reflect, refract, transfer};
    #[pymodule_export]
    use crate::scene::PyScene;
    #[pymodule_export]
    use crate::spectrum::{blackbody_radiance, color_of_spectrum, illuminant_power, reflectance_of_color};

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// The AOV table: one dict per row with name, channels, sample, unit, merge, has_validity, family and doc.
    #[pyfunction]
    fn aovs(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        json::to_python(py, &abbe::film::aov::AOVS)
    }

    /// Names of other renderers that are understood: alias to our name.
    #[pyfunction]
    fn aov_aliases() -> std::collections::BTreeMap<&'static str, &'static str> {
        abbe::film::aov::ALIASES.iter().copied().collect()
    }

    /// The integrators that can be chosen: dicts with name, summary and the names of their aovs.
    #[pyfunction]
    fn integrators(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let registry = abbe::integrator::Registry::default();
        let rows: Vec<_> = registry
            .iter()
            .map(|integrator| {
                let aovs: Vec<_> = integrator.aovs().iter().map(|aov| aov.name).collect();
                serde_json::json!({ "name": integrator.name(), "summary": integrator.summary(), "aovs": aovs })
            })
            .collect();
        json::to_python(py, &rows)
    }

    /// Joins crops and aligned sample ranges of one render into one file: the same bits as rendering in one go.
    #[pyfunction]
    fn merge(py: Python<'_>, inputs: Vec<PathBuf>, out: PathBuf) -> Outcome<()> {
        released(py, || Ok(abbe::exr::merge(&inputs, &out)?))
    }
}
