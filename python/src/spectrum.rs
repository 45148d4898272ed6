//! Spectra and colours on NumPy arrays, by the renderer's own estimators.

use abbe::Error;
use abbe::spectrum::reflectance::Reflectance;
use abbe::spectrum::sensor::{self, ColorSpace};
use abbe::spectrum::visible::Visible;
use abbe::spectrum::{LANES, SampledSpectrum, Wavelength, blackbody, illuminant::Illuminant};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::{Outcome, released};

/// The linear interpolation of a table, its nearer end's outside of it.
fn at(nanometers: &[f64], power: &[f64], nm: f64) -> f64 {
    match nanometers.partition_point(|&x| x <= nm) {
        0 => power[0],
        after if after == nanometers.len() => power[after - 1],
        after => {
            let t = (nm - nanometers[after - 1]) / (nanometers[after] - nanometers[after - 1]);
            power[after - 1] + t * (power[after] - power[after - 1])
        }
    }
}

/// The colour of the light with power per nm ``power`` at ``nanometers`` (increasing), as a pixel of ``samples`` samples has it.
///
/// ``peaked`` has wavelengths drawn for its lines too.
#[pyfunction]
#[pyo3(signature = (nanometers, power, space, samples, peaked))]
pub(crate) fn color_of_spectrum(
    py: Python<'_>,
    nanometers: PyReadonlyArray1<'_, f64>,
    power: PyReadonlyArray1<'_, f64>,
    space: &str,
    samples: u32,
    peaked: bool,
) -> Outcome<[f64; 3]> {
    let (nanometers, power) = (nanometers.as_array().to_vec(), power.as_array().to_vec());
    released(py, || {
        if nanometers.is_empty() || nanometers.len() != power.len() || samples == 0 {
            return Err(Error::usage("spectrum", "as many powers as wavelengths are wanted, one or more").into());
        }
        if nanometers.windows(2).any(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less)) {
            return Err(Error::usage("spectrum", "its wavelengths must increase").into());
        }
        let Some(color_space) = ColorSpace::from_token(space) else {
            let known = ColorSpace::TOKENS.join(", ");
            return Err(Error::usage(format!("space '{space}'"), format!("is not known: choose {known}")).into());
        };
        let table: Vec<_> = nanometers.iter().copied().zip(power.iter().copied()).collect();
        let density = if peaked { Visible::with_lights([&table[..]]) } else { Visible::with_lights([]) };
        let mut sum = glam::DVec3::ZERO;
        for i in 0..samples {
            let wavelengths = density.sample::<LANES>((f64::from(i) + 0.5) / f64::from(samples));
            let radiance =
                SampledSpectrum::from_fn(|lane| at(&nanometers, &power, wavelengths.nanometers()[lane]) as f32);
            sum += sensor::xyz(radiance, &wavelengths);
        }
        Ok((color_space.from_xyz() * (sum / f64::from(samples))).to_array())
    })
}

/// Relative power per nm of a standard illuminant at ``nanometers``; of D65 with Y = 1 for the name ``white``.
#[pyfunction]
pub(crate) fn illuminant_power<'py>(
    py: Python<'py>,
    name: &str,
    nanometers: PyReadonlyArray1<'py, f64>,
) -> Outcome<Bound<'py, PyArray1<f64>>> {
    let nanometers = nanometers.as_array();
    let wavelengths = nanometers.iter().map(|&nm| Wavelength::from_nanometers(nm));
    let power: Vec<f64> = if name == "white" {
        wavelengths.map(sensor::white).collect()
    } else {
        let Some(illuminant) = Illuminant::named(name) else {
            let known = "E, A, D50, D55, D65, D75 (any D40 to D250), FL2, FL7, FL11 or white";
            return Err(Error::usage(format!("illuminant '{name}'"), format!("is not known: choose {known}")).into());
        };
        wavelengths.map(|wavelength| illuminant.power(wavelength)).collect()
    };
    Ok(power.into_pyarray(py))
}

/// Spectral radiance of a black body, W/(m²·sr·nm).
#[pyfunction]
pub(crate) fn blackbody_radiance<'py>(
    py: Python<'py>,
    kelvin: f64,
    nanometers: PyReadonlyArray1<'py, f64>,
) -> Outcome<Bound<'py, PyArray1<f64>>> {
    if !(kelvin > 0.0 && kelvin.is_finite()) {
        return Err(Error::usage("temperature", format!("{kelvin} K is no temperature: more than 0 is wanted")).into());
    }
    let nanometers = nanometers.as_array();
    let radiance: Vec<f64> =
        nanometers.iter().map(|&nm| blackbody::radiance(Wavelength::from_nanometers(nm), kelvin)).collect();
    Ok(radiance.into_pyarray(py))
}

/// The reflectance that a colour becomes, at ``nanometers``; by the table of textures if not ``exact``.
#[pyfunction]
pub(crate) fn reflectance_of_color<'py>(
    py: Python<'py>,
    rgb: [f64; 3],
    nanometers: PyReadonlyArray1<'py, f64>,
    exact: bool,
) -> Bound<'py, PyArray1<f32>> {
    let reflectance =
        if exact { Reflectance::exact(rgb) } else { Reflectance::of_color(rgb.map(|channel| channel as f32)) };
    let nanometers = nanometers.as_array();
    let values: Vec<f32> =
        nanometers.iter().map(|&nm| reflectance.at_wavelength(Wavelength::from_nanometers(nm))).collect();
    values.into_pyarray(py)
}
