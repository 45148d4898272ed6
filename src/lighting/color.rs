//! From the colour of a light to radiance at the wavelengths of a path.
//!
//! L(λ) = white(λ) · filter(λ), where the filter is the colour, made a spectrum ([`Unbounded`]).

use std::sync::Arc;

use crate::light::{Emission, White};
use crate::spectrum::reflectance::Unbounded;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// The emission of a light, ready for wavelengths.
#[derive(Clone, Debug)]
pub(super) struct Color {
    rgb: [f64; 3],
    filter: Unbounded,
    white: Arc<White>,
}

impl Color {
    pub(super) fn new(emission: &Emission) -> Self {
        Self { rgb: emission.rgb, filter: Unbounded::exact(emission.rgb), white: Arc::clone(emission.white_table()) }
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

    fn white<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        SampledSpectrum(wavelengths.nanometers().map(|nm| self.white.at(nm)))
    }
}
