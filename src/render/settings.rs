//! From what was asked and what was authored to what holds: request > product > settings > default.

use serde_json::Value;

use super::request::Request;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::{Aov, Family};
use crate::integrator::Optics;
use crate::scene::Scene;
use crate::scene::description::{Authored, AuthoredMap, Product};
use crate::spectrum::color::RgbSpace;
use crate::spectrum::sensor::ColorSpace;
use crate::spectrum::{self, Wavelength};

/// More threads than this would spend their time on each other: no machine has as many cores.
const MAX_THREADS: usize = 1024;
/// Wavelengths that a reference, a band or a channel may have, nm: the transport's.
const SPECTRUM: [f64; 2] = [360.0, 830.0];
/// AOV band unless chosen, nm.
const DEFAULT_BAND: [f64; 2] = [400.0, 700.0];

/// Threads to render with, 0 for all of the machine's.
pub(super) fn threads(request: &Request) -> Result<usize> {
    match request.threads.unwrap_or(0) {
        threads if threads <= MAX_THREADS => Ok(threads),
        threads => {
            Err(Error::usage("--threads", format!("must be at most {MAX_THREADS}, not {threads}: 0 takes all cores")))
        }
    }
}

pub(super) fn optics(request: &Request, attributes: &Attributes<'_>) -> Result<Optics> {
    let wavelength = |place: &str, nm: f64| {
        if (SPECTRUM[0]..=SPECTRUM[1]).contains(&nm) {
            return Ok(Wavelength::from_nanometers(nm));
        }
        let hint = if (0.1..=20.0).contains(&nm) { ": it looks like micrometres, nanometres are wanted" } else { "" };
        Err(Error::usage(place, format!("{nm} nm is outside {} to {} nm{hint}", SPECTRUM[0], SPECTRUM[1])))
    };
    let reference = match request.wavelength {
        Some(nm) => wavelength("--wavelength", nm)?,
        None => match attributes.number("abbe:referenceWavelength")? {
            Some(nm) => wavelength("abbe:referenceWavelength", nm)?,
            None => spectrum::REFERENCE,
        },
    };
    let (place, band) = match request.band {
        Some(band) => ("--band", band),
        None => ("abbe:band", attributes.numbers("abbe:band")?.unwrap_or(DEFAULT_BAND)),
    };
    if band[0] >= band[1] {
        return Err(Error::usage(place, format!("{}:{} is empty: give LO:HI in nm", band[0], band[1])));
    }
    let band = [wavelength(place, band[0])?, wavelength(place, band[1])?];
    let mut channels = spectrum::response::CENTROIDS;
    if let Some(authored) = attributes.numbers::<3>("abbe:channelWavelengths")? {
        for (channel, nm) in channels.iter_mut().zip(authored) {
            // 0 keeps the centroid of the response.
            if nm != 0.0 {
                *channel = wavelength("abbe:channelWavelengths", nm)?;
            }
        }
    }
    let dispersion_scale = match request.dispersion_scale {
        Some(scale) => scale,
        None => attributes.number("abbe:dispersionScale")?.unwrap_or(1.0),
    };
    if !(0.0..=1e3).contains(&dispersion_scale) {
        return Err(Error::usage("--dispersion-scale", format!("must be 0 to 1000, not {dispersion_scale}")));
    }
    Ok(Optics { reference, band, channels, dispersion_scale })
}

/// The space of colours of light: the stage's `renderingColorSpace`, else linear Rec. 709.
pub(super) fn color_space(
    scene: &Scene,
    product: Option<&Product>,
    aovs: &[&Aov],
    diagnostics: &mut Diagnostics,
) -> ColorSpace {
    let default = ColorSpace::Rgb(RgbSpace::REC709);
    let base = product.or(scene.document().settings.base.as_ref()).map_or("", |p| p.rendering_color_space.as_str());
    if base.is_empty() {
        return default;
    }
    ColorSpace::from_token(base).unwrap_or_else(|| {
        if aovs.iter().any(|aov| aov.family == Family::Transport) {
            diagnostics.warn(
                "color-space",
                format!("{}.renderingColorSpace", product.map_or("render settings", |p| p.path.as_str())),
                format!(
                    "'{base}' is not a space that colours are written in ({}): linear Rec. 709 is written",
                    ColorSpace::TOKENS.join(", ")
                ),
            );
        }
        default
    })
}

/// Authored `abbe:…` attributes, the product's before the settings'.
pub(super) struct Attributes<'a> {
    maps: [Option<&'a AuthoredMap>; 2],
}

impl<'a> Attributes<'a> {
    /// Of `product`, then of the scene's settings.
    pub(super) fn new(scene: &'a Scene, product: Option<&'a Product>) -> Self {
        Self { maps: [product.map(|p| &p.abbe), Some(&scene.document().settings.abbe)] }
    }

    fn get(&self, name: &str) -> Option<&'a Authored> {
        self.maps.iter().flatten().find_map(|map| map.get(name))
    }

    fn wrong(name: &str, value: &Value, wanted: &str) -> Error {
        Error::scene(format!("render settings, {name}"), format!("is {value}: {wanted} is wanted"))
    }

    pub(super) fn number(&self, name: &str) -> Result<Option<f64>> {
        let Some(authored) = self.get(name) else { return Ok(None) };
        match authored.value.as_f64().filter(|v| v.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => Err(Self::wrong(name, &authored.value, "a number")),
        }
    }

    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>> {
        let Some(authored) = self.get(name) else { return Ok(None) };
        match authored.value.as_i64().filter(|&v| v >= 0) {
            Some(number) => Ok(Some(number)),
            None => Err(Self::wrong(name, &authored.value, "a whole number, 0 or more,")),
        }
    }

    pub(super) fn text(&self, name: &str) -> Result<Option<String>> {
        let Some(authored) = self.get(name) else { return Ok(None) };
        match authored.value.as_str() {
            Some(text) => Ok(Some(text.to_owned())),
            None => Err(Self::wrong(name, &authored.value, "a name")),
        }
    }

    fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>> {
        let Some(authored) = self.get(name) else { return Ok(None) };
        let list = authored.value.as_array().map(|list| list.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
        match list.and_then(|list| <[f64; N]>::try_from(list).ok()) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(Self::wrong(name, &authored.value, "a list of numbers")),
        }
    }
}
