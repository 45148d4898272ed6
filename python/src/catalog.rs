//! The catalogue of optical materials; searching and units are Python's (`abbe/catalog.py`).

use abbe::Error;
use abbe::optics::catalog::{self, Entry};
use abbe::optics::dispersion::OutOfRange;
use numpy::IntoPyArray;
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::error::{Failure, Outcome};
use crate::optics::PyDispersion;

/// An entry of the catalogue.
#[pyclass(name = "Glass", module = "abbe._core", frozen)]
pub(crate) struct PyGlass {
    entry: Entry,
}

fn failure(problem: String) -> Failure {
    Error::usage("glass", problem).into()
}

type Column<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl PyGlass {
    /// The name in full.
    #[getter]
    fn name(&self) -> &'static str {
        self.entry.name()
    }

    /// The name without maker or page.
    #[getter]
    fn bare_name(&self) -> &'static str {
        self.entry.bare_name()
    }

    /// The maker of a maker's glass.
    #[getter]
    fn maker(&self) -> Option<&'static str> {
        self.entry.maker()
    }

    /// glass, crystal, metal …
    #[getter]
    fn category(&self) -> &'static str {
        self.entry.category().name()
    }

    /// preferred, standard, special, obsolete, or empty.
    #[getter]
    fn status(&self) -> &'static str {
        self.entry.status().name()
    }

    /// Shelf, book and page of refractiveindex.info.
    #[getter]
    fn page(&self) -> &'static str {
        self.entry.page()
    }

    /// The source in a browser.
    #[getter]
    fn url(&self) -> String {
        self.entry.url()
    }

    /// The family of a glass, or the source's heading.
    #[getter]
    fn title(&self) -> &'static str {
        self.entry.title()
    }

    /// Who measured or states it.
    #[getter]
    fn reference(&self) -> &'static str {
        self.entry.reference()
    }

    /// n_d to nine digits, read and not computed.
    #[getter]
    fn nd(&self) -> f64 {
        self.entry.nd()
    }

    /// V_d to six digits, read and not computed.
    #[getter]
    fn vd(&self) -> Option<f64> {
        self.entry.vd()
    }

    /// n_d and V_d that the source states.
    #[getter]
    fn stated(&self) -> Option<(f64, f64)> {
        self.entry.stated_nd().zip(self.entry.stated_vd())
    }

    /// Where n(λ) holds, nm.
    #[getter]
    fn valid_range(&self) -> (f64, f64) {
        let range = self.entry.valid_range();
        (range.from.nanometers(), range.to.nanometers())
    }

    /// The law as the source states it: its number and coefficients, or None and a table of nm, n, nm, n …
    #[getter]
    fn source_law(&self) -> (Option<i32>, Vec<f64>) {
        self.entry.source_law()
    }

    /// n(λ); `out_of_range` is clamp, error or extrapolate.
    fn dispersion(&self, out_of_range: &str) -> Outcome<PyDispersion> {
        let Some(out_of_range) = OutOfRange::parse(out_of_range) else {
            return Err(Error::usage("out_of_range", "must be clamp, error or extrapolate").into());
        };
        Ok(PyDispersion::of(self.entry.dispersion(out_of_range).map_err(failure)?))
    }

    /// Wavelengths in nm and k there; None where the source has none.
    fn extinction<'py>(&self, py: Python<'py>) -> Option<(Column<'py>, Column<'py>)> {
        let table = self.entry.extinction()?;
        let column = |i: usize| table.iter().map(|row| row[i]).collect::<Vec<f64>>().into_pyarray(py);
        Some((column(0), column(1)))
    }
}

/// The entry of this name.
#[pyfunction]
pub(crate) fn glass(name: &str) -> Outcome<PyGlass> {
    Ok(PyGlass { entry: catalog::find(name).map_err(failure)? })
}

/// All entries.
#[pyfunction]
pub(crate) fn glasses() -> Vec<PyGlass> {
    catalog::entries().map(|entry| PyGlass { entry }).collect()
}

/// The clear entry nearest in n_d.
#[pyfunction]
pub(crate) fn nearest_glass(nd: f64) -> PyGlass {
    PyGlass { entry: catalog::nearest(nd) }
}

/// Release and licence of the data.
#[pyfunction]
pub(crate) fn glass_database() -> (&'static str, &'static str) {
    (catalog::DATABASE_VERSION, catalog::DATABASE_LICENSE)
}
