//! The Python extension `abbe._core`: a thin border over the core.

use pyo3::prelude::*;

/// The compiled half of the package `abbe`.
#[pymodule]
mod _core {
    use super::*;

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
