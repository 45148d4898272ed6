//! From the colour of a light to radiance at the wavelengths of a path.
//!
//! L(λ) = white(λ) · filter(λ), where the filter is the colour, made a spectrum ([`Unbounded`]).

use std::collections::HashMap;
use std::sync::Arc;

use crate::light::{Emission, White};
use crate::spectrum::reflectance::Unbounded;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// Colours that are solved for one by one; of more, the table's spectra have the same colours.
const MAX_SOLVED: usize = 256;

/// Makes colours spectra, each once: a thousand lights have a few colours, but for their intensity.
#[derive(Debug, Default)]
pub(super) struct Filters {
    /// Of a colour whose greatest channel is 1.
    known: HashMap<[u32; 3], Unbounded>,
}

impl Filters {
    fn of(&mut self, rgb: [f64; 3]) -> Unbounded {
        let greatest = rgb[0].max(rgb[1]).max(rgb[2]);
        if !(greatest > 0.0 && greatest.is_finite()) {
            return Unbounded::exact([0.0; 3]);
        }
        let key = rgb.map(|channel| ((channel / greatest) as f32).to_bits());
        let solved = match self.known.get(&key) {
            Some(known) => *known,
            None if self.known.len() >= MAX_SOLVED => return Unbounded::of_color(rgb.map(|channel| channel as f32)),
            None => {
                let solved = Unbounded::exact(rgb.map(|channel| channel / greatest));
                self.known.insert(key, solved);
                solved
            }
        };
        Unbounded { scale: (f64::from(solved.scale) * greatest) as f32, ..solved }
    }
}

/// The emission of a light, ready for wavelengths.
#[derive(Clone, Debug)]
pub(super) struct Color {
    rgb: [f64; 3],
    filter: Unbounded,
    white: Arc<White>,
}

impl Color {
    pub(super) fn new(emission: &Emission, filters: &mut Filters) -> Self {
        Self { rgb: emission.rgb, filter: filters.of(emission.rgb), white: Arc::clone(emission.white_table()) }
    }

    /// `rgb` over D65.
    pub(super) fn over_d65(rgb: [f64; 3]) -> Self {
        Self { rgb, filter: Unbounded::exact(rgb), white: White::d65() }
    }

    /// Of the channels: what chooses between lights, none of whose colours is invisible.
    pub(super) fn mean(&self) -> f64 {
        self.rgb.iter().sum::<f64>() / 3.0
    }

    /// Spectral radiance per nm.
    pub(super) fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        self.white(wavelengths) * self.filter.at(wavelengths)
    }

    /// The same where the colour is multiplied by `factor`.
    pub(super) fn times<const N: usize>(&self, factor: [f64; 3], wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        let [r, g, b] = factor;
        // Most shapings and masks have no colour: then the filter is known.
        if r.to_bits() == g.to_bits() && g.to_bits() == b.to_bits() {
            return if r > 0.0 { self.at(wavelengths) * r as f32 } else { SampledSpectrum::ZERO };
        }
        let filter = Unbounded::of_color(std::array::from_fn(|i| (self.rgb[i] * factor[i]) as f32));
        self.white(wavelengths) * filter.at(wavelengths)
    }

    #[inline]
    fn white<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        SampledSpectrum::from_fn(|lane| self.white.at(wavelengths.nanometers()[lane]))
    }
}
