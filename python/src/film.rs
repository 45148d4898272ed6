//! `Film`: a rendered image whose layers NumPy sees without a copy.

use std::path::PathBuf;

use abbe::film::aov;
use abbe::film::metadata::{Attribute, Metadata};
use abbe::film::{Film, Layer, Values};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::error::{Outcome, released};
use crate::json;
use crate::memory::view_of;

/// A rendered image: one array per AOV, top row first.
///
/// Arrays are read-only views of the film's own memory, ``float32`` or (identifiers and counts) ``uint32``, with shape
/// (height, width, channels). They stay valid as long as they are referred to, whatever happens to the film.
#[pyclass(name = "Film", module = "abbe", frozen)]
pub(crate) struct PyFilm {
    film: Film,
    metadata: Metadata,
    statistics: serde_json::Value,
}

impl PyFilm {
    pub(crate) fn new(film: Film, metadata: Metadata, statistics: serde_json::Value) -> Self {
        Self { film, metadata, statistics }
    }

    fn layer(&self, name: &str) -> PyResult<&Layer> {
        let by_layer_name = || self.film.layers.iter().find(|layer| layer.name == name);
        self.film.layer(aov::canonical_name(name)).or_else(by_layer_name).ok_or_else(|| {
            let names: Vec<_> = self.film.layers.iter().map(Layer::key).collect();
            PyKeyError::new_err(format!("'{name}' was not rendered: this film has {}", names.join(", ")))
        })
    }

    fn shape(&self, channels: usize) -> [usize; 3] {
        [self.film.window.height(), self.film.window.width(), channels]
    }
}

#[pymethods]
impl PyFilm {
    /// The AOVs of this film, in the order they were asked for.
    fn names(&self) -> Vec<&str> {
        self.film.layers.iter().map(Layer::key).collect()
    }

    /// The same as :meth:`names`: ``dict(film)`` and ``for name in film`` work.
    fn keys(&self) -> Vec<&str> {
        self.names()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.names().into_pyobject(py)?.try_iter()?.into_any())
    }

    fn __len__(&self) -> usize {
        self.film.layers.len()
    }

    fn __contains__(&self, name: &str) -> bool {
        self.layer(name).is_ok()
    }

    /// The pixels of the AOV ``name`` (or an alias of it), shape (height, width, channels); absent values are 0.
    fn __getitem__<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.get();
        let layer = this.layer(name)?;
        let shape = this.shape(layer.aov.channels.len());
        let owner = slf.clone().into_any();
        Ok(match &layer.values {
            Values::Float(values) => view_of(owner, shape, values).into_any(),
            Values::Uint(values) => view_of(owner, shape, values).into_any(),
        })
    }

    /// The fraction of samples in which the AOV ``name`` has a value, float32 with shape (height, width), 0..1.
    ///
    /// ``None`` for an AOV that always has one (identifiers and counts).
    fn valid<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let this = slf.get();
        let Some(valid) = &this.layer(name)?.valid else { return Ok(None) };
        let [height, width, _] = this.shape(1);
        let view = view_of(slf.clone().into_any(), this.shape(1), valid);
        view.call_method1("reshape", (height, width)).map(Some)
    }

    /// Writes the film as a multichannel EXR file, complete or not at all.
    fn write(&self, py: Python<'_>, path: PathBuf) -> Outcome<()> {
        released(py, || Ok(abbe::exr::write(&path, &self.film, &self.metadata)?))
    }

    /// Width and height of the full raster in pixels.
    #[getter]
    fn resolution(&self) -> (u32, u32) {
        (self.film.resolution[0], self.film.resolution[1])
    }

    /// The rendered pixels (x0, y0, x1, y1), half-open, y down: what the arrays cover.
    #[getter]
    fn window(&self) -> (i32, i32, i32, i32) {
        let window = self.film.window;
        (window.x0, window.y0, window.x1, window.y1)
    }

    /// Samples of each pixel that the film covers; with an error target the most that a pixel can have.
    #[getter]
    fn samples(&self) -> u32 {
        self.film.samples.end - self.film.samples.begin
    }

    /// Names of the channels of the AOV ``name``, in the order of the array's last axis.
    fn channels(&self, name: &str) -> PyResult<Vec<&'static str>> {
        Ok(self.layer(name)?.aov.channels.to_vec())
    }

    /// What was counted, chosen and met during the render.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.statistics)
    }

    /// The EXR header: name to text, number or tuple of numbers.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let header = PyDict::new(py);
        for (name, value) in &self.metadata.attributes {
            match value {
                Attribute::Text(text) => header.set_item(name, text)?,
                Attribute::Int(value) => header.set_item(name, value)?,
                Attribute::Float(value) => header.set_item(name, value)?,
                Attribute::Double(value) => header.set_item(name, value)?,
                Attribute::Vec2(values) => header.set_item(name, PyTuple::new(py, values)?)?,
                Attribute::Matrix(values) => header.set_item(name, PyTuple::new(py, values)?)?,
                Attribute::Rational(numerator, denominator) => header.set_item(name, (numerator, denominator))?,
                Attribute::Chromaticities(xy) => header.set_item(name, xy.map(|[x, y]| (x, y)))?,
            }
        }
        Ok(header)
    }

    fn __repr__(&self) -> String {
        let window = self.film.window;
        format!("<abbe.Film {} x {}: {}>", window.width(), window.height(), self.names().join(", "))
    }
}
