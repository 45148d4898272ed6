//! Light that a surface receives by way of smooth glass and mirrors, from where the guide says.
//!
//! From every vertex where the guide knows of such light a path of its own looks for it: it costs a chain, as a sampled light costs a
//! shadow ray, and is weighed against the BSDF's own directions.

use super::state::{Look, Purpose, Scatterer, State};
use super::tracer::Tracer;
use crate::bsdf;
use crate::integrator::light_path::Event;
use crate::integrator::walk::Walk;
use crate::sampler::PathSampler;
use crate::spectrum::SampledSpectrum;

impl<'a, const N: usize, const DISPERSIVE: bool> Tracer<'a, N, DISPERSIVE> {
    /// Adds what comes by way of smooth surfaces from a direction that the guide draws.
    pub(super) fn add_focused(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        state: &State<N>,
        u_look: impl FnOnce() -> f32,
        numbers: &PathSampler,
    ) {
        let (Some(guide), Some(Look { region, probability })) = (self.setting.guide, surface.look) else { return };
        if u_look() >= probability {
            return;
        }
        let mut numbers = numbers.branch();
        let [u_lobe, u, v, u_cap] = numbers.draw();
        let Some((direction, pdf)) = guide.sample(region, surface.met.point, [u_lobe, u_cap], [u, v]) else { return };
        let wi = surface.frame.to_local(direction);
        if wi.z <= 0.0 || direction.dot(surface.n_g) <= 0.0 {
            return;
        }
        let mut f = surface.bsdf.evaluate(surface.wo, wi);
        self.limit(&mut f, state, bsdf::Event::GlossyReflection);
        let value = f.value();
        let event =
            if f.diffuse.mean() >= f.glossy.mean() { bsdf::Event::Diffuse } else { bsdf::Event::GlossyReflection };
        let mut found = State {
            smooth_events: 0,
            depth: state.depth.after(event),
            squeezed: state.squeezed,
            ..State::new(Purpose::Focused, state.wavelengths)
        };
        let either = f.pdf + SampledSpectrum::splat(probability * pdf);
        if DISPERSIVE {
            (found.throughput, found.r) = (state.throughput * value, state.r * either);
        } else {
            found.throughput = state.throughput * value * (1.0 / either.hero());
        }
        if found.throughput.is_black() {
            return;
        }
        let kept = self.ledger.branches();
        if self.ledger.is_divided() {
            let ways = [
                (Event::scattering(bsdf::Event::Diffuse, false), f.diffuse.safe_div(value)),
                (Event::scattering(bsdf::Event::GlossyReflection, false), f.glossy.safe_div(value)),
            ];
            self.ledger.scatter(&ways);
        }
        let mut walk = walk.clone();
        walk.turn(surface.met, direction, false);
        self.follow(&mut walk, &mut found, &mut numbers);
        self.ledger.return_to(kept);
    }
}
