//! Indices and absorption of the media at the wavelengths of one path: computed when the path first asks, constants once.

use crate::error::{Error, Result};
use crate::optics::media::MediumId;
use crate::optics::{Absorption, Dispersion, IorJet};
use crate::scene::Scene;
use crate::scene::material::Kind;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// What the media are at every wavelength.
#[derive(Debug)]
pub(super) struct Laws<'a> {
    /// By material; `None` of what no ray is in.
    laws: Vec<Option<Law<'a>>>,
}

#[derive(Debug)]
struct Law<'a> {
    dispersion: Dispersion,
    absorption: Option<&'a Absorption>,
}

impl<'a> Laws<'a> {
    /// Of all materials, with their dispersion scaled.
    pub(super) fn new(scene: &'a Scene, scale: f64) -> Result<Self> {
        let law = |material: &'a crate::scene::material::Material| match &material.kind {
            Kind::Dielectric { dispersion, absorption, .. } => {
                let dispersion = dispersion.scaled(scale).map_err(|problem| Error::scene(&material.path, problem))?;
                Ok(Some(Law { dispersion, absorption: absorption.as_ref() }))
            }
            _ => Ok(None),
        };
        Ok(Self { laws: scene.materials.iter().map(law).collect::<Result<_>>()? })
    }

    /// Whether the index of some medium that has an inside moves with wavelength.
    pub(super) fn is_dispersive(&self) -> bool {
        self.laws.iter().flatten().any(|law| !law.dispersion.is_constant())
    }
}

/// A medium at the wavelengths of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Medium<const N: usize> {
    /// At the hero wavelength; derivatives are not asked for here.
    pub(super) ior: f64,
    /// At every wavelength.
    pub(super) iors: SampledSpectrum<N>,
    /// Absorption coefficients per stage unit, if there is some.
    pub(super) absorption: Option<SampledSpectrum<N>>,
    /// Whether the index differs between wavelengths.
    pub(super) is_dispersive: bool,
}

impl<const N: usize> Medium<N> {
    /// Outside of everything.
    const OUTSIDE: Self = Self { ior: 1.0, iors: SampledSpectrum::ONE, absorption: None, is_dispersive: false };

    /// The index for the calculus.
    pub(super) fn jet(&self) -> IorJet {
        IorJet::constant(self.ior)
    }

    /// What a stretch of `distance` stage units lets through.
    #[inline]
    pub(super) fn transmittance(&self, distance: f64) -> Option<SampledSpectrum<N>> {
        let absorption = self.absorption.as_ref()?;
        let through = |sigma: f32| if sigma > 0.0 { libm::expf(-sigma * distance as f32) } else { 1.0 };
        Some(absorption.map(through))
    }
}

/// The media at the wavelengths of one path after the other.
#[derive(Clone, Debug)]
pub(super) struct PathMedia<'a, const N: usize> {
    laws: &'a Laws<'a>,
    wavelengths: Wavelengths<N>,
    /// Counts paths: what was computed for another one is stale.
    path: u64,
    known: Vec<(u64, Medium<N>)>,
}

impl<'a, const N: usize> PathMedia<'a, N> {
    pub(super) fn new(laws: &'a Laws<'a>, wavelengths: Wavelengths<N>) -> Self {
        Self { laws, wavelengths, path: 1, known: vec![(0, Medium::OUTSIDE); laws.laws.len()] }
    }

    /// Begins a path.
    pub(super) fn restart(&mut self, wavelengths: Wavelengths<N>) {
        self.wavelengths = wavelengths;
        self.path += 1;
    }

    /// A medium at the path's wavelengths.
    #[inline]
    pub(super) fn of(&mut self, medium: Option<MediumId>) -> Medium<N> {
        let Some(MediumId(index)) = medium else { return Medium::OUTSIDE };
        let (path, known) = &mut self.known[index as usize];
        if *path != self.path {
            let Some(law) = &self.laws.laws[index as usize] else { return Medium::OUTSIDE };
            // A constant needs no second look; absorption is a curve in general.
            let is_fixed = law.dispersion.is_constant() && law.absorption.is_none();
            if *path == 0 || !is_fixed {
                *known = law.at(&self.wavelengths);
            }
            *path = self.path;
        }
        *known
    }
}

impl Law<'_> {
    fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> Medium<N> {
        let ior = self.dispersion.at(wavelengths.hero()).ior;
        let is_dispersive = !self.dispersion.is_constant();
        let iors = if is_dispersive {
            SampledSpectrum::from_fn(|lane| match lane {
                0 => ior as f32,
                _ => self.dispersion.at(wavelengths.lane(lane)).ior as f32,
            })
        } else {
            SampledSpectrum::splat(ior as f32)
        };
        let coefficients =
            |a: &Absorption| SampledSpectrum::from_fn(|lane| a.coefficient(wavelengths.lane(lane)) as f32);
        Medium { ior, iors, absorption: self.absorption.map(coefficients), is_dispersive }
    }
}
