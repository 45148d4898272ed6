//! The optics and the calculus alone, on flat NumPy arrays; shapes and broadcasting are Python's (`abbe/optics.py`).

use abbe::Error;
use abbe::optics::dispersion::{Law, OutOfRange, ValidRange};
use abbe::optics::{self, IorJet};
use abbe::ray::standalone;
use abbe::spectrum::Wavelength;
use glam::DVec3;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::{Failure, Outcome};

/// How the refractive index of a medium depends on wavelength.
#[pyclass(name = "Dispersion", module = "abbe._core", frozen)]
pub(crate) struct PyDispersion {
    law: optics::Dispersion,
}

impl PyDispersion {
    pub(crate) fn of(law: optics::Dispersion) -> Self {
        Self { law }
    }
}

fn made(by: &str, law: Result<optics::Dispersion, String>) -> Outcome<PyDispersion> {
    match law {
        Ok(law) => Ok(PyDispersion { law }),
        Err(problem) => Err(Error::usage(format!("Dispersion.{by}"), problem).into()),
    }
}

/// Where a law holds, as Python has it.
type Range = Option<(f64, f64)>;

/// A law that holds in `valid_range` (nm).
fn ranged(by: &str, law: Result<Law, String>, valid_range: Range, out_of_range: &str) -> Outcome<PyDispersion> {
    let Some(out_of_range) = OutOfRange::parse(out_of_range) else {
        let problem = format!("'{out_of_range}' is unknown: use clamp, error or extrapolate");
        return Err(Error::usage("out_of_range", problem).into());
    };
    let valid = valid_range
        .map(|(from, to)| ValidRange { from: Wavelength::from_nanometers(from), to: Wavelength::from_nanometers(to) });
    made(by, law.and_then(|law| optics::Dispersion::new(law, valid, out_of_range)))
}

type Column<'py> = Bound<'py, PyArray1<f64>>;
type Vectors<'py> = Bound<'py, PyArray2<f64>>;

#[pymethods]
impl PyDispersion {
    /// The same index at every wavelength.
    #[staticmethod]
    fn constant(ior: f64) -> Outcome<Self> {
        made("constant", optics::Dispersion::constant(ior))
    }

    /// n = A + B/λ² + C/λ⁴ + …, λ in µm.
    #[staticmethod]
    #[pyo3(signature = (coefficients, valid_range=None, out_of_range="clamp"))]
    fn cauchy(coefficients: Vec<f64>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("cauchy", Law::cauchy(&coefficients), valid_range, out_of_range)
    }

    /// n² = 1 + Σ Bᵢ λ²/(λ² − Cᵢ), λ in µm, Cᵢ in µm².
    #[staticmethod]
    #[pyo3(signature = (b, c_um2, valid_range=None, out_of_range="clamp"))]
    fn sellmeier(b: Vec<f64>, c_um2: Vec<f64>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("sellmeier", Law::sellmeier(&b, &c_um2), valid_range, out_of_range)
    }

    /// n² = a₀ + a₁ λ² + a₂ λ⁻² + a₃ λ⁻⁴ + …, λ in µm.
    #[staticmethod]
    #[pyo3(signature = (coefficients, valid_range=None, out_of_range="clamp"))]
    fn schott(coefficients: Vec<f64>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("schott", Law::schott(&coefficients), valid_range, out_of_range)
    }

    /// n = A + B λ⁻¹ + C λ⁻³·⁵, λ in µm.
    #[staticmethod]
    #[pyo3(signature = (coefficients, valid_range=None, out_of_range="clamp"))]
    fn conrady(coefficients: Vec<f64>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("conrady", Law::conrady(&coefficients), valid_range, out_of_range)
    }

    /// Formula 1 to 9 of refractiveindex.info.
    #[staticmethod]
    #[pyo3(signature = (number, coefficients, valid_range=None, out_of_range="clamp"))]
    fn formula(number: i32, coefficients: Vec<f64>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("formula", Law::formula(number, &coefficients), valid_range, out_of_range)
    }

    /// A spline through pairs (nm, n).
    #[staticmethod]
    #[pyo3(signature = (entries, valid_range=None, out_of_range="clamp"))]
    fn table(entries: Vec<[f64; 2]>, valid_range: Range, out_of_range: &str) -> Outcome<Self> {
        ranged("table", Law::table(&entries), valid_range, out_of_range)
    }

    /// The two-term Cauchy law with these n_d and V_d.
    #[staticmethod]
    fn abbe(nd: f64, vd: f64) -> Outcome<Self> {
        made("abbe", optics::Dispersion::from_abbe_number(nd, vd))
    }

    /// The law with n(λ) − n_d multiplied by `scale`.
    fn scaled(&self, scale: f64) -> Outcome<Self> {
        made("scaled", self.law.scaled(scale))
    }

    /// n, ∂n/∂λ in 1/nm and ∂²n/∂λ² in 1/nm² at wavelengths in nm.
    fn at<'py>(
        &self,
        py: Python<'py>,
        wavelength: PyReadonlyArray1<'py, f64>,
    ) -> Outcome<(Column<'py>, Column<'py>, Column<'py>)> {
        if let (Some(range), OutOfRange::Error) = (self.law.valid_range(), self.law.out_of_range())
            && let Some(nm) = wavelength.as_array().iter().find(|&&nm| !range.contains(Wavelength::from_nanometers(nm)))
        {
            let problem = format!("{nm} nm is outside of the law's valid range, {range}, and out_of_range is 'error'");
            return Err(Error::usage("wavelength", problem).into());
        }
        let jets: Vec<IorJet> =
            wavelength.as_array().iter().map(|&nm| self.law.at(Wavelength::from_nanometers(nm))).collect();
        let column = |f: fn(&IorJet) -> f64| jets.iter().map(f).collect::<Vec<_>>().into_pyarray(py);
        Ok((column(|jet| jet.ior), column(|jet| jet.dior_dlambda), column(|jet| jet.d2ior_dlambda2)))
    }

    /// V_d; None if the index is the same at the F and C lines.
    #[getter]
    fn abbe_number(&self) -> Option<f64> {
        self.law.abbe_number()
    }

    /// Ends of the valid range in nm; None if the law holds everywhere.
    #[getter]
    fn valid_range(&self) -> Range {
        self.law.valid_range().map(|range| (range.from.nanometers(), range.to.nanometers()))
    }

    /// What becomes of wavelengths outside of the valid range.
    #[getter]
    fn out_of_range(&self) -> &'static str {
        self.law.out_of_range().name()
    }

    /// How much ∂²n/∂λ² of a table changes, relatively, when every second entry is left out.
    #[getter]
    fn curvature_doubt(&self) -> Option<f64> {
        self.law.curvature_doubt()
    }

    /// Whether the index is the same at every wavelength.
    #[getter]
    fn is_constant(&self) -> bool {
        self.law.is_constant()
    }

    /// The law with its coefficients, n_d and V_d.
    fn describe(&self) -> String {
        self.law.describe()
    }
}

/// The rows of an `n × 3` array.
fn vectors(array: &PyReadonlyArray2<'_, f64>) -> Vec<DVec3> {
    array.as_array().rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect()
}

fn same_rows(arrays: &[&[DVec3]], columns: &[&PyReadonlyArray1<'_, f64>]) -> Outcome<usize> {
    let rows = arrays[0].len();
    if arrays.iter().all(|a| a.len() == rows) && columns.iter().all(|c| c.as_array().len() == rows) {
        Ok(rows)
    } else {
        Err(Failure::from(Error::usage("arrays", "differ in length: broadcast them first")))
    }
}

fn to_numpy(py: Python<'_>, vectors: impl ExactSizeIterator<Item = DVec3>) -> Vectors<'_> {
    let rows = vectors.len();
    let flat = vectors.flat_map(|v| v.to_array()).collect();
    Array2::from_shape_vec((rows, 3), flat).expect("three values a vector").into_pyarray(py)
}

/// Refraction of `n` directions; total reflection where Snell's law has no answer.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called by abbe/optics.py alone, which names them all")]
pub(crate) fn refract<'py>(
    py: Python<'py>,
    direction: PyReadonlyArray2<'py, f64>,
    normal: PyReadonlyArray2<'py, f64>,
    ior_i: PyReadonlyArray1<'py, f64>,
    ior_t: PyReadonlyArray1<'py, f64>,
    dior_i: PyReadonlyArray1<'py, f64>,
    dior_t: PyReadonlyArray1<'py, f64>,
    ddirection: PyReadonlyArray2<'py, f64>,
    dnormal: PyReadonlyArray2<'py, f64>,
) -> Outcome<(Vectors<'py>, Vectors<'py>, Bound<'py, PyArray1<bool>>)> {
    let (d, n, dd, dn) = (vectors(&direction), vectors(&normal), vectors(&ddirection), vectors(&dnormal));
    let rows = same_rows(&[&d, &n, &dd, &dn], &[&ior_i, &ior_t, &dior_i, &dior_t])?;
    let jet = |ior: &PyReadonlyArray1<'_, f64>, dior: &PyReadonlyArray1<'_, f64>, i: usize| IorJet {
        ior: ior.as_array()[i],
        dior_dlambda: dior.as_array()[i],
        d2ior_dlambda2: 0.0,
    };
    let refracted: Vec<_> = (0..rows)
        .map(|i| standalone::refract(d[i], n[i], jet(&ior_i, &dior_i, i), jet(&ior_t, &dior_t, i), dd[i], dn[i]))
        .collect();
    Ok((
        to_numpy(py, refracted.iter().map(|r| r.direction)),
        to_numpy(py, refracted.iter().map(|r| r.ddirection)),
        refracted.iter().map(|r| r.total_reflection).collect::<Vec<_>>().into_pyarray(py),
    ))
}

/// Reflection of `n` directions.
#[pyfunction]
pub(crate) fn reflect<'py>(
    py: Python<'py>,
    direction: PyReadonlyArray2<'py, f64>,
    normal: PyReadonlyArray2<'py, f64>,
    ddirection: PyReadonlyArray2<'py, f64>,
    dnormal: PyReadonlyArray2<'py, f64>,
) -> Outcome<(Vectors<'py>, Vectors<'py>)> {
    let (d, n, dd, dn) = (vectors(&direction), vectors(&normal), vectors(&ddirection), vectors(&dnormal));
    let rows = same_rows(&[&d, &n, &dd, &dn], &[])?;
    let reflected: Vec<_> = (0..rows).map(|i| standalone::reflect(d[i], n[i], dd[i], dn[i])).collect();
    Ok((to_numpy(py, reflected.iter().map(|r| r.direction)), to_numpy(py, reflected.iter().map(|r| r.ddirection))))
}

/// Transfer of `n` points to the next surface; NaN where the ray runs along it.
#[pyfunction]
pub(crate) fn transfer<'py>(
    py: Python<'py>,
    point: PyReadonlyArray2<'py, f64>,
    dpoint: PyReadonlyArray2<'py, f64>,
    direction: PyReadonlyArray2<'py, f64>,
    ddirection: PyReadonlyArray2<'py, f64>,
    distance: PyReadonlyArray1<'py, f64>,
    normal: PyReadonlyArray2<'py, f64>,
) -> Outcome<(Vectors<'py>, Vectors<'py>)> {
    let (p, dp, d, dd, n) =
        (vectors(&point), vectors(&dpoint), vectors(&direction), vectors(&ddirection), vectors(&normal));
    let rows = same_rows(&[&p, &dp, &d, &dd, &n], &[&distance])?;
    let moved: Vec<_> =
        (0..rows).map(|i| standalone::transfer(p[i], dp[i], d[i], dd[i], distance.as_array()[i], n[i])).collect();
    Ok((
        to_numpy(py, moved.iter().map(|m| m.map_or(DVec3::NAN, |m| m.point))),
        to_numpy(py, moved.iter().map(|m| m.map_or(DVec3::NAN, |m| m.dpoint))),
    ))
}
