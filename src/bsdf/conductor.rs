//! Metals: GGX facets of complex index, with the light that is reflected between them.
//!
//! A single reflection at F = 1 sends back H(μ) of what arrives, less than all: the rest meets facets again. It gets a diffuse lobe after
//! C. Kulla & A. Conty (SIGGRAPH 2017 course), M(μ_o) M(μ_i) / (π M_avg), M = 1 − H, times the colour
//! F_avg² E_avg / (1 − F_avg (1 − E_avg)): with it a lossless metal reflects everything. Under layers of transmittance T the
//! single reflection is T(μ_o) f T(μ_i), and M = T (1 − H) with H = ∫ f T: also what a layer sends back from below is in the lobe, and
//! the same sum is kept.

use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use super::albedo::{self, At, Place, Roughness, Slice};
use super::diffuse;
use super::fresnel::Fresnel;
use super::gloss;
use super::microfacet::Ggx;
use super::{Coat, Parameters};
use crate::spectrum::SampledSpectrum;

/// A metal; smooth where it has no distribution of facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conductor<const N: usize> {
    /// Its share, darkened by a coat.
    pub(super) weight: SampledSpectrum<N>,
    fresnel: Fresnel<N>,
    pub(super) rough: Option<Rough<N>>,
    /// Mean reflectance, for the choice of lobes.
    importance: f32,
}

/// What only rough metals need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough<const N: usize> {
    pub(super) ggx: Ggx,
    /// M at the nodes.
    missing: Slice,
    /// Colour of multiple scattering over π M_avg.
    multiple: SampledSpectrum<N>,
}

impl<const N: usize> Conductor<N> {
    /// `above`: transmittance of the layers over it, at the nodes.
    pub(super) fn new(parameters: &Parameters<N>, weight: f32, above: Option<&Slice>) -> Self {
        let fresnel = Fresnel::of_metal(parameters);
        let mean = fresnel.metal_mean();
        let rough = gloss::distribution(parameters.alpha).map(|ggx| {
            let roughness = Roughness::new(ggx.mean_alpha());
            let (missing, all) = match above {
                None => (roughness.white().map(|e| (1.0 - e).max(0.0)), 1.0),
                Some(t) => {
                    let back = roughness.leaving(t);
                    (std::array::from_fn(|i| (t[i] * (1.0 - back[i])).max(0.0)), albedo::mean(t))
                }
            };
            let missing_mean =
                albedo::mean_of_spectra(&ggx.over_azimuths(&missing.map(SampledSpectrum::<1>::splat)))[0];
            let got = if all > 0.0 { (1.0 - missing_mean / all).clamp(0.0, 1.0) } else { 1.0 };
            let scale = if missing_mean > 0.0 { FRAC_1_PI / missing_mean } else { 0.0 };
            Rough { ggx, missing, multiple: diffuse::multiple(mean, got) * scale }
        });
        let weight = SampledSpectrum::splat(weight) * darkening(parameters.coat.as_ref(), mean, parameters.alpha);
        Self { weight, fresnel, rough, importance: (weight * mean).mean() }
    }

    /// Reflectance of the smooth metal.
    #[inline]
    pub(super) fn reflectance(&self, cos_i: f32) -> SampledSpectrum<N> {
        self.fresnel.at(cos_i) * self.weight
    }

    /// Share of the light, for the choice of lobes.
    #[inline]
    pub(super) fn importance(&self) -> f32 {
        self.importance
    }

    /// f cos θ_i of the rough metal; `through` is T(μ_o) T(μ_i).
    #[inline]
    pub(super) fn evaluate(&self, rough: &Rough<N>, pair: &Pair, through: f32) -> SampledSpectrum<N> {
        let Pair { wo, wi, h, place_o, place_i } = pair;
        let single = rough.ggx.d(*h) * rough.ggx.visibility(*wo, *wi) * through * wi.z;
        let missing = |w: Vec3, at: &At| rough.ggx.at(w, at).of(&rough.missing);
        let twice = missing(*wo, &place_o.at) * missing(*wi, &place_i.at) * wi.z;
        (self.fresnel.at(wo.dot(*h)) * single + rough.multiple * twice) * self.weight
    }
}

impl<const N: usize> Rough<N> {
    /// Probability with which the lobe of multiple scattering is drawn.
    #[inline]
    fn choice(&self, wo: Vec3, at_o: &At, above: f32) -> f32 {
        if above > 0.0 { (self.ggx.at(wo, at_o).of(&self.missing) / above).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Draws a direction.
    #[inline]
    pub(super) fn sample(&self, wo: Vec3, at_o: &At, above: f32, u_lobe: f32, u: [f32; 2]) -> Vec3 {
        if u_lobe < self.choice(wo, at_o, above) {
            diffuse::sample_cosine(u)
        } else {
            super::microfacet::mirror(wo, self.ggx.sample_reflecting(wo, u))
        }
    }

    /// Density per solid angle of [`Self::sample`].
    #[inline]
    pub(super) fn pdf(&self, pair: &Pair, above: f32) -> f32 {
        let choice = self.choice(pair.wo, &pair.place_o.at, above);
        choice * pair.wi.z * FRAC_1_PI + (1.0 - choice) * self.ggx.reflecting_pdf(pair.wo, pair.h)
    }
}

/// Two directions above the surface, the vector halfway, and where they look up what depends on them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) wo: Vec3,
    pub(super) wi: Vec3,
    pub(super) h: Vec3,
    pub(super) place_o: Place,
    pub(super) place_i: Place,
}

/// Factor by which light reflected between a coat and a base of this albedo darkens the base (OpenPBR 1.1, "coat darkening"):
/// (1 − K)/(1 − E_b K), K the reflectance of the coat from within: for diffuse light over a rough base, 1 − (1 − F_avg)/η², at normal
/// incidence over a smooth one.
pub(super) fn darkening<const N: usize>(
    coat: Option<&Coat<N>>,
    albedo: SampledSpectrum<N>,
    alpha: [f32; 2],
) -> SampledSpectrum<N> {
    let Some(coat) = coat else { return SampledSpectrum::ONE };
    let eta = coat.ior.max(1.0);
    let rough = 1.0 - (1.0 - super::fresnel::dielectric_mean(eta)) / (eta * eta);
    let smooth = super::fresnel::dielectric(1.0, eta);
    let k = smooth + (rough - smooth) * (alpha[0] * alpha[1]).max(0.0).sqrt().min(1.0);
    let share = (coat.weight * coat.darkening).clamp(0.0, 1.0);
    albedo.map(|e| 1.0 + share * ((1.0 - k) / (1.0 - e.clamp(0.0, 1.0) * k) - 1.0))
}
