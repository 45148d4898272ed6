//! Light that a surface receives by way of smooth glass and mirrors, from where the guide says.
//!
//! From every vertex where the guide knows of such light a path of its own looks for it: it costs a chain, as a sampled light costs a
//! shadow ray, and is weighed against the BSDF's own directions.

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
        u_look: f32,
        numbers: &PathSampler,
    ) {
        let (Some(guide), Some(Look { region, probability, .. })) = (self.setting.guide, surface.look) else { return };
        let count = (probability + u_look) as u32;
        let mut numbers = numbers.clone();
        for index in 0..count {
            numbers = numbers.branch();
            let each = (index as f32, 1.0 / count as f32);
            self.look(walk, surface, state, each, &mut numbers.clone());
        }
    }

    fn look(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        state: &State<N>,
        (index, part): (f32, f32),
        numbers: &mut PathSampler,
    ) {
        let (Some(guide), Some(Look { region, .. })) = (self.setting.guide, surface.look) else { return };
        let [u_lobe, u, v, u_cap] = numbers.draw();
        let u_lobe = (u_lobe + index) * part;
        let Some((direction, wanted)) = guide.sample(region, surface.met.point, [u_lobe, u_cap], [u, v]) else { return };
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
            wanted,
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
