//! Reflection by a dielectric interface over something opaque: the specular lobe of plastics, and the coat.
//!
//! What it does not reflect goes on to what is below; so it has no lobe for multiple scattering of its own: light that meets a
//! dielectric twice is reflected twice with F², a thousandth of it.

use glam::Vec3;

use super::albedo::{self, At, NODES, Roughness};
use super::fresnel::Fresnel;
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
    /// Directional albedo at weight and colour 1.
    pub(super) albedo: Slices<N>,
    pub(super) color: SampledSpectrum<N>,
}

/// The distribution of a roughness, `None` for smooth.
pub(super) fn distribution(alpha: [f32; 2]) -> Option<Ggx> {
    (alpha[0].max(alpha[1]) >= SMOOTH_ALPHA).then(|| Ggx::new(alpha))
}

impl<const N: usize> Gloss<N> {
    pub(super) fn new(weight: f32, fresnel: Fresnel<N>, alpha: [f32; 2], color: SampledSpectrum<N>) -> Self {
        let ggx = distribution(alpha);
        let albedo = match (&ggx, fresnel.is_uniform()) {
            (None, _) => std::array::from_fn(|i| fresnel.at(albedo::node(i))),
            (Some(ggx), true) => {
                let reflectance = std::array::from_fn(|i| fresnel.lane(albedo::node(i), 0));
                Roughness::new(ggx.mean_alpha()).facing(&reflectance).map(SampledSpectrum::splat)
            }
            (Some(ggx), false) => {
                let reflectance: [_; NODES] = std::array::from_fn(|i| fresnel.at(albedo::node(i)));
                Roughness::new(ggx.mean_alpha()).facing_of_spectra(&reflectance)
            }
        };
        Self { weight, fresnel, ggx, albedo, color }
    }

    /// What it leaves of the transmittance of the layers over it.
    ///
    /// It reflects T(μ_o) f T(μ_i), of which T² E is the albedo: exact where it is smooth or nothing is over it.
    pub(super) fn below(&self, above: f32, node: usize) -> SampledSpectrum<N> {
        self.albedo[node].map(|e| (above - self.weight * e * above * above).max(0.0))
    }

    /// f cos θ_i of the rough interface, without the layers over it.
    #[inline]
    pub(super) fn evaluate(&self, ggx: &Ggx, wo: Vec3, wi: Vec3, h: Vec3) -> SampledSpectrum<N> {
        self.fresnel.at(wo.dot(h)) * self.color * (self.weight * ggx.d(h) * ggx.visibility(wo, wi) * wi.z)
    }

    /// Albedo for a direction, for the choice of lobes.
    #[inline]
    pub(super) fn importance(&self, at: &At) -> f32 {
        (self.weight * (at.of_spectra(&self.albedo) * self.color).mean()).max(0.0)
    }
}
