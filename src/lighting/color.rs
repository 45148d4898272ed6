//! From the colour of a light to radiance at the wavelengths of a path.
//!
//! L(λ) = white(λ) · filter(λ), where the filter is the colour, uplifted as a reflectance: the colour over twice its greatest
//! channel, times that again. So no colour is too bright for the uplift, and its spectrum is smooth (M. Pharr, W. Jakob, G.
//! Humphreys, *Physically Based Rendering*, 4th ed. 2023, §4.6.5). A grey filter is the same at every wavelength.

use std::sync::Arc;

use crate::light::{Emission, White};
use crate::spectrum::reflectance::Reflectance;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// A colour made a factor at every wavelength.
#[derive(Clone, Copy, Debug)]
pub(super) enum Filter {
    Grey(f32),
    Colored { scale: f32, reflectance: Reflectance },
}

impl Filter {
    /// Of linear Rec. 709; what is negative or no number counts as 0.
    pub(super) fn of(rgb: [f64; 3]) -> Self {
        let [r, g, b] = rgb.map(|channel| if channel > 0.0 { channel.min(f64::from(f32::MAX)) } else { 0.0 });
        let greatest = r.max(g).max(b);
        let least = r.min(g).min(b);
        // Single precision tells no colour apart from grey that is nearer to it.
        if greatest - least <= f64::from(f32::EPSILON) * greatest {
            return Self::Grey(greatest as f32);
        }
        let scale = 2.0 * greatest;
        let reflectance = Reflectance::of_color([r, g, b].map(|channel| (channel / scale) as f32));
        Self::Colored { scale: scale as f32, reflectance }
    }

    pub(super) fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        match self {
            Self::Grey(level) => SampledSpectrum::splat(*level),
            Self::Colored { scale, reflectance } => reflectance.at(wavelengths) * *scale,
        }
    }
}

/// The emission of a light, ready for wavelengths.
#[derive(Clone, Debug)]
pub(super) struct Color {
    rgb: [f64; 3],
    filter: Filter,
    white: Arc<White>,
}

impl Color {
    pub(super) fn new(emission: &Emission) -> Self {
        Self { rgb: emission.rgb, filter: Filter::of(emission.rgb), white: Arc::clone(emission.white_table()) }
    }

    /// `rgb` over D65.
    pub(super) fn over_d65(rgb: [f64; 3]) -> Self {
        Self { rgb, filter: Filter::of(rgb), white: White::d65() }
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
        let filter = Filter::of(std::array::from_fn(|i| self.rgb[i] * factor[i]));
        self.white(wavelengths) * filter.at(wavelengths)
    }

    fn white<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        SampledSpectrum(wavelengths.nanometers().map(|nm| self.white.at(nm)))
    }
}
