//! Reflection by a dielectric interface over something opaque: the specular lobe of plastics, and the coat.
//!
//! What it does not reflect goes on to what is below; so it has no lobe for multiple scattering of its own: light that meets a
//! dielectric twice is reflected twice with F², a thousandth of it.

use glam::Vec3;

use super::albedo::{self, At, Directional, Roughness, Slice};
use super::fresnel::{Fresnel, Law};
use super::microfacet::Ggx;
use super::{SMOOTH_ALPHA, Slices};
use crate::spectrum::SampledSpectrum;

/// An interface that reflects; smooth where it has no distribution of facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gloss<const N: usize> {
    /// Share of the surface that has it.
    pub(super) weight: f32,
    pub(super) fresnel: Fresnel<N>,
    pub(super) ggx: Option<Ggx>,
    pub(super) color: SampledSpectrum<N>,
    /// Mean over lanes and azimuths of the albedo with its colour at weight 1, for the choice of lobes.
    pub(super) importance: Slice,
}

/// An interface with its directional albedo at weight and colour 1, which only the layers below ask for.
pub(super) struct Reflecting<const N: usize> {
    pub(super) gloss: Gloss<N>,
    albedo: Directional<N>,
}

/// The distribution of a roughness, `None` for smooth.
pub(super) fn distribution(alpha: [f32; 2]) -> Option<Ggx> {
    (alpha[0].max(alpha[1]) >= SMOOTH_ALPHA).then(|| Ggx::new(alpha))
}

/// Directional albedo of facets with this reflectance.
fn rough_albedo<const N: usize>(fresnel: &Fresnel<N>, roughness: &Roughness) -> Slices<N> {
    match fresnel.bare() {
        Some(Law::Uniform(eta)) => roughness.dielectric(*eta).map(SampledSpectrum::splat),
        Some(Law::Dielectric(eta)) => albedo::of_lanes(*eta, |eta| roughness.dielectric(eta)),
        Some(Law::Schlick(f0)) => {
            let (rise, white) = (roughness.rise(), roughness.white());
            std::array::from_fn(|i| f0.map(|f0| f0 * (white[i] - rise[i]) + rise[i]))
        }
        _ => roughness.facing(&std::array::from_fn(|i| fresnel.at(albedo::node(i)))),
    }
}

impl<const N: usize> Gloss<N> {
    pub(super) fn reflecting(
        weight: f32,
        fresnel: Fresnel<N>,
        alpha: [f32; 2],
        color: SampledSpectrum<N>,
    ) -> Reflecting<N> {
        let ggx = distribution(alpha);
        let albedo = match &ggx {
            None => Directional::upright(std::array::from_fn(|i| fresnel.at(albedo::node(i)))),
            Some(ggx) => Directional::of_facets(ggx, |roughness| rough_albedo(&fresnel, roughness)),
        };
        let shares = ggx.map_or([0.0; albedo::NODES], |ggx| ggx.shares());
        let importance = albedo.over_azimuths(&shares).map(|e| (e * color).mean());
        Reflecting { gloss: Self { weight, fresnel, ggx, color, importance }, albedo }
    }

    /// f cos θ_i of the rough interface, without the layers over it.
    #[inline]
    pub(super) fn evaluate(&self, ggx: &Ggx, wo: Vec3, wi: Vec3, h: Vec3) -> SampledSpectrum<N> {
        self.fresnel.at(wo.dot(h)) * self.color * (self.weight * ggx.d(h) * ggx.visibility(wo, wi) * wi.z)
    }

    /// Albedo for a direction, for the choice of lobes.
    #[inline]
    pub(super) fn importance(&self, at: &At) -> f32 {
        self.weight * at.of(&self.importance)
    }
}

impl<const N: usize> Reflecting<N> {
    /// What it leaves of the transmittance of the layers over it.
    ///
    /// It reflects f √(T(μ_o) T(μ_i)): T E where it is smooth. Over a rough lobe the mean of √T is needed, weighted by F. Facets that reflect
    /// much are seen at grazing angles, and send light to grazing angles, where T falls; so of the mean over the lobe of white facets
    /// and √T(μ) itself the latter counts for a quarter, which fits integration best. What is off then stands in docs/scattering.md.
    pub(super) fn below(&self, above: Option<&Slice>) -> Directional<N> {
        let Some(above) = above else {
            return self.albedo.map(|albedo| albedo.map(|e| e.map(|e| (1.0 - self.gloss.weight * e).max(0.0))));
        };
        let root = above.map(f32::sqrt);
        let back: Slice = match &self.gloss.ggx {
            None => root,
            Some(ggx) => {
                let roughness = Roughness::new(ggx.mean_alpha());
                let (leaving, white) = (roughness.leaving(&root), roughness.white());
                std::array::from_fn(|i| 0.25 * root[i] + 0.75 * leaving[i] / white[i].max(1e-6))
            }
        };
        self.albedo.map(|albedo| {
            std::array::from_fn(|i| albedo[i].map(|e| (above[i] - self.gloss.weight * e * root[i] * back[i]).max(0.0)))
        })
    }
}
