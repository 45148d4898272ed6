//! Light that a surface receives from sampled points of lights.

use super::state::{Scatterer, State};
use super::tracer::Tracer;
use crate::bsdf::{self, Evaluated};
use crate::geometry::Ray;
use crate::integrator::light_path::Event;
use crate::integrator::surface;
use crate::integrator::walk::Walk;
use crate::light::Light;
use crate::lighting::LightSample;
use crate::sampler::PathSampler;
use crate::spectrum::SampledSpectrum;
use crate::spectrum::reflectance::Reflectance;

/// Where what could block a light at `distance` ends: before its own surface, which is met with the error of many roundings.
fn before(distance: f64) -> f64 {
    distance * (1.0 - 1e-9)
}

impl<'a, const N: usize, const DISPERSIVE: bool> Tracer<'a, N, DISPERSIVE> {
    /// Adds what a sampled point of a light sends by way of the surface.
    pub(super) fn add_direct(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        light: &LightSample<N>,
        state: &State<N>,
        numbers: &PathSampler,
    ) {
        let wi = surface.frame.to_local(light.wi);
        let passes = light.wi.dot(surface.n_g) < 0.0;
        // A side that the shading normal makes up is not lit.
        if passes != (wi.z < 0.0) {
            return;
        }
        let mut f = surface.bsdf.evaluate(surface.wo, wi);
        let source = self.setting.lighting.light(light.light);
        if let Some(source) = source
            && source.has_factors()
        {
            f.diffuse *= source.diffuse as f32;
            f.glossy *= source.specular as f32;
        }
        let gloss = if passes { bsdf::Event::GlossyTransmission } else { bsdf::Event::GlossyReflection };
        self.limit(&mut f, state, gloss);
        let carried = state.throughput * light.radiance;
        if (carried * f.value()).is_black() {
            return;
        }
        let Some(through) = self.visibility(walk, surface, light, source, state, numbers) else { return };
        let is_sampled_alone = light.is_delta || source.is_some_and(|source| !source.has_natural_shadows());
        let weight = match (is_sampled_alone, DISPERSIVE) {
            (true, true) => 1.0 / (state.r * light.pdf).mean(),
            (true, false) => 1.0 / light.pdf,
            (false, true) => 1.0 / (state.r * (f.pdf + SampledSpectrum::splat(light.pdf))).mean(),
            (false, false) => 1.0 / (f.pdf.hero() + light.pdf),
        };
        let carried = carried * through * weight;
        if !self.ledger.is_divided() {
            self.ledger.total += carried * f.value();
            return;
        }
        let emission = self.emission(light.light);
        let ways = [
            (Event::scattering(bsdf::Event::Diffuse, passes), carried * f.diffuse),
            (Event::scattering(gloss, passes), carried * f.glossy),
        ];
        self.ledger.add_scattered(&ways, emission);
    }

    /// Takes from the values what the limits of depth do not allow.
    pub(super) fn limit(&self, f: &mut Evaluated<N>, state: &State<N>, gloss: bsdf::Event) {
        let limits = &self.setting.limits;
        if !state.depth.after(bsdf::Event::Diffuse).is_within(limits) {
            f.diffuse = SampledSpectrum::ZERO;
        }
        if !state.depth.after(gloss).is_within(limits) {
            f.glossy = SampledSpectrum::ZERO;
        }
    }

    /// What comes through from a sampled point of a light; `None` if nothing does.
    fn visibility(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        light: &LightSample<N>,
        source: Option<&Light>,
        state: &State<N>,
        numbers: &PathSampler,
    ) -> Option<SampledSpectrum<N>> {
        let met = surface.met;
        let medium = match surface.far {
            Some(medium) if light.wi.dot(surface.n_g) < 0.0 => medium,
            _ => walk.media.current(),
        };
        let mut through = self.media.of(medium).transmittance(light.distance).unwrap_or(SampledSpectrum::ONE);
        let shadow = source.map(|light| &light.shadow);
        if shadow.is_some_and(|shadow| !shadow.is_enabled) {
            return Some(through);
        }
        let set = source.and_then(|light| light.shadowed_by);
        let mut departures = walk.departures;
        departures.depart(&walk.ray, &met.hit, light.wi.dot(met.surface.n_g) > 0.0);
        let ray = Ray { origin: met.point, direction: light.wi, ..walk.ray };
        self.counters.rays += 1;
        let natural = shadow.is_none_or(|shadow| shadow.is_natural());
        let mut nearest = f64::INFINITY;
        let view = self.setting.view;
        let is_blocked = view.aggregate.is_blocked(&ray, &departures, before(light.distance), |hit| {
            if set.is_some_and(|set| !view.scene.is_linked(set, hit.instance)) {
                return false;
            }
            match surface::through::<N>(view, hit, numbers) {
                None => false,
                Some(part) if part.is_black() => {
                    nearest = nearest.min(hit.distance);
                    natural
                }
                Some(part) => {
                    through *= part;
                    false
                }
            }
        });
        if natural {
            return (!is_blocked).then_some(through);
        }
        if nearest.is_finite()
            && let Some(shadow) = shadow
        {
            // What is seen in full shadow is the light times the shadow's colour.
            let strength = shadow.strength(nearest) as f32;
            let color = Reflectance::of_color(shadow.color.map(|c| c as f32));
            let dark = color.at(&state.wavelengths);
            through *= SampledSpectrum::splat(1.0 - strength) + dark * strength;
        }
        Some(through)
    }
}
