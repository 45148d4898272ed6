//! Light that a surface receives by way of smooth glass and mirrors, from where the guide says.
//!
//! From every vertex where the guide knows of such light paths of their own look for it: each costs a chain, as a sampled light costs a
//! shadow ray. What they meet is weighed against the BSDF's own directions: with the density p of these, q of n looks as a mean, and
//! the probability c of the choices at interfaces on the way, f / (p c + n q) is what light counts. q is known where light is met, not before.

use super::guide::Drawn;
use super::state::{Look, Purpose, Scatterer, State, Vertex};
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
        let Some(Look { count, .. }) = surface.look else { return };
        let count = (count + u_look()) as u32;
        let mut numbers = *numbers;
        for index in 0..count {
            numbers = numbers.branch();
            self.look(walk, surface, state, [index, count], &mut numbers.clone());
        }
    }

    /// One look of several.
    fn look(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        state: &State<N>,
        [index, count]: [u32; 2],
        numbers: &mut PathSampler,
    ) {
        let (Some(guide), Some(Look { region, .. })) = (self.setting.guide, surface.look) else { return };
        let [u_lobe, u, v, u_cap] = numbers.draw();
        // Each looks somewhere else.
        let u_lobe = (index as f32 + u_lobe) / count as f32;
        let Some(Drawn { direction, way }) = guide.sample(region, surface.met.point, [u_lobe, u_cap], [u, v]) else {
            return;
        };
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
            wanted: way,
            throughput: state.throughput * value,
            r: state.r * f.pdf,
            vertex: Some(Vertex {
                receiver: surface.receiver,
                r_over_pdf: state.r,
                diffuse_share: SampledSpectrum::ZERO,
                look: surface.look,
                direction,
            }),
            ..State::new(Purpose::Focused, state.wavelengths)
        };
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
        self.follow(&mut walk, &mut found, numbers);
        self.ledger.return_to(kept);
    }
}
