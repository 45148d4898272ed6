//! The clear coat: a dielectric over everything but the sheen, with a colour that light takes on in it.
//!
//! Light that reaches the base passes the coat twice, along 1/cos θ_t each; the colour is stated for going in and out
//! at normal incidence, so the transmittance is color^{(1/cos θ_t(μ_o) + 1/cos θ_t(μ_i))/2} (Bouguer's law; OpenPBR 1.1).

use super::albedo::{NODES, Slice};
use super::fresnel::Fresnel;
use super::gloss::Gloss;
use super::{Coat, Interface};
use crate::spectrum::SampledSpectrum;

/// A coat made ready.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatLobe<const N: usize> {
    /// Its interface, the same at every wavelength.
    pub(super) gloss: Gloss<1>,
    weight: f32,
    eta: f32,
    /// ln color / 2; `None` for a colourless one.
    half_log: Option<SampledSpectrum<N>>,
}

impl<const N: usize> CoatLobe<N> {
    /// The coat, and what it leaves of the transmittance of the layers over it.
    pub(super) fn new(coat: &Coat<N>, interface: &Interface<N>, above: Option<&Slice>) -> (Self, Slice) {
        let weight = coat.weight.clamp(0.0, 1.0);
        // As the base: no total reflection where the coat is the rarer medium.
        // The mean over the lanes, not the hero's index: who the hero is must not tell.
        let outside = interface.ior_i.mean();
        let eta = (coat.ior / outside).max(outside / coat.ior);
        let colored = coat.color.0.iter().any(|&c| c < 1.0);
        let reflecting = Gloss::reflecting(weight, Fresnel::uniform(eta), coat.alpha, SampledSpectrum::ONE);
        let gloss = reflecting.gloss;
        let shares = gloss.ggx.map_or([0.0; NODES], |ggx| ggx.shares());
        let below = reflecting.below(above).over_azimuths(&shares).map(|passed| passed[0]);
        let half_log = colored.then(|| coat.color.map(|c| 0.5 * libm::logf(c.clamp(1e-12, 1.0))));
        (Self { gloss, weight, eta, half_log }, below)
    }

    /// What its colour leaves of light between the base and a direction, and back to another one if there is one.
    #[inline]
    pub(super) fn absorption(&self, mu_o: f32, mu_i: Option<f32>) -> SampledSpectrum<N> {
        let Some(half_log) = self.half_log else { return SampledSpectrum::ONE };
        let path = self.path(mu_o) + mu_i.map_or(0.0, |mu| self.path(mu));
        half_log.map(|log| 1.0 + self.weight * (libm::expf(log * path) - 1.0))
    }

    /// 1/cos θ_t.
    fn path(&self, mu: f32) -> f32 {
        let sine2 = (1.0 - mu * mu).max(0.0) / (self.eta * self.eta);
        1.0 / (1.0 - sine2).max(1e-4).sqrt()
    }
}
