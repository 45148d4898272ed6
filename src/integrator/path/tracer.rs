//! One path: from the camera from surface to surface, adding what shines on the way.
//!
//! Throughput β is f |cos|/p of the hero's densities p. Beside it runs r, per lane the density with which that lane, had it been the
//! hero, would have made the path, over the hero's: what is added is β L / mean(r), the balance heuristic over the lanes (A. Wilkie
//! et al. 2014; in this form M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §14.2.2). r is 1 until a
//! rough interface disperses. A smooth dispersive refraction takes r of all companions to 0, since no other wavelength goes that way:
//! the hero then counts N-fold by itself.

use glam::{DVec3, Vec3};

use crate::bsdf::{Bsdf, Interface, Scattered};
use crate::geometry::Ray;
use crate::integrator::chain::{Counters, Follower};
use crate::integrator::frame::Frame;
use crate::integrator::lanes::{Laws, PathMedia};
use crate::integrator::surface;
use crate::integrator::walk::{MAX_CROSSINGS, SurfacePoint, Walk};
use crate::light::Light;
use crate::lighting::{LightHit, LightSample, Lighting, Receiver};
use crate::optics::media::MediumId;
use crate::ray::{RayStart, ScatterKind, mirror, refract_or_reflect};
use crate::sampler::PathSampler;
use crate::scene::view::View;
use crate::spectrum::reflectance::Reflectance;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// From this vertex on roulette may end a path.
const ROULETTE_FROM: u32 = 4;

/// A path survives a roulette with at most this probability: all paths end.
const MOST_LIKELY: f32 = 0.97;

/// What a path brings back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<const N: usize> {
    /// Spectral radiance per nm.
    pub(super) radiance: SampledSpectrum<N>,
    /// 1 where the camera sees a surface, 0 where it sees none.
    pub(super) alpha: f32,
}

/// Traces paths on one thread.
pub(super) struct Tracer<'a, const N: usize, const DISPERSIVE: bool> {
    view: &'a View<'a>,
    follower: &'a Follower<'a>,
    lighting: &'a Lighting<'a>,
    media: PathMedia<'a, N>,
    pub(super) counters: Counters,
}

/// The last vertex that chose a direction by a density.
struct Vertex<const N: usize> {
    receiver: Receiver,
    /// r before its event, over the density of the direction.
    r_over_pdf: SampledSpectrum<N>,
    bsdf: Bsdf<N>,
    wo: Vec3,
    wi: Vec3,
}

/// What a path has come to.
struct State<const N: usize> {
    wavelengths: Wavelengths<N>,
    throughput: SampledSpectrum<N>,
    r: SampledSpectrum<N>,
    vertex: Option<Vertex<N>>,
    /// The object of the last event, whose light links count.
    object: Option<u32>,
    radiance: SampledSpectrum<N>,
}

impl<const N: usize> State<N> {
    /// Adds the light that the path's ray has met.
    fn meet<const DISPERSIVE: bool>(&mut self, lighting: &Lighting<'_>, direction: DVec3, met: &LightHit<N>) {
        if self.object.is_some_and(|object| !lighting.is_linked(met.light, object)) {
            return;
        }
        let Some(vertex) = &self.vertex else {
            // Nothing but this way leads there.
            let by_lanes = if DISPERSIVE { 1.0 / self.r.mean() } else { 1.0 };
            self.radiance += self.throughput * met.radiance * by_lanes;
            return;
        };
        let pdf = lighting.pdf(&vertex.receiver, direction, met);
        let mut seen = met.radiance;
        if let Some(light) = lighting.light(met.light)
            && has_factors(light)
        {
            let f = vertex.bsdf.evaluate(vertex.wo, vertex.wi);
            let (diffuse, specular) = (light.diffuse as f32, light.specular as f32);
            seen *= (f.diffuse * diffuse + f.glossy * specular).safe_div(f.diffuse + f.glossy);
        }
        let weight = if DISPERSIVE {
            1.0 / (self.r + vertex.r_over_pdf * pdf).mean()
        } else {
            1.0 / (1.0 + vertex.r_over_pdf.hero() * pdf)
        };
        self.radiance += self.throughput * seen * weight;
    }
}

/// Where what could block a light at `distance` ends: before its own surface, which is met with the error of many roundings.
fn before(distance: f64) -> f64 {
    distance * (1.0 - 1e-9)
}

/// Whether a light shines on diffuse and specular materials differently from what it is.
fn has_factors(light: &Light) -> bool {
    #[expect(clippy::float_cmp, reason = "1 is what nobody authored")]
    let factors = light.diffuse != 1.0 || light.specular != 1.0;
    factors
}

impl<'a, const N: usize, const DISPERSIVE: bool> Tracer<'a, N, DISPERSIVE> {
    pub(super) fn new(
        view: &'a View<'a>,
        follower: &'a Follower<'a>,
        lighting: &'a Lighting<'a>,
        laws: &'a Laws<'a>,
    ) -> Self {
        let media = PathMedia::new(laws, crate::spectrum::visible::sample(0.5));
        Self { view, follower, lighting, media, counters: Counters::default() }
    }

    /// The radiance that arrives along `start` at the wavelengths, by one path.
    pub(super) fn trace(
        &mut self,
        start: &RayStart,
        wavelengths: Wavelengths<N>,
        numbers: &mut PathSampler,
    ) -> Seen<N> {
        self.media.restart(wavelengths);
        let mut walk = Walk::new(self.follower, start);
        let mut state = State {
            wavelengths,
            throughput: SampledSpectrum::ONE,
            r: SampledSpectrum::ONE,
            vertex: None,
            object: None,
            radiance: SampledSpectrum::ZERO,
        };
        let mut alpha = 0.0;
        let mut vertices = 0;
        loop {
            let met = walk.advance(&mut self.counters);
            let limit = met.as_ref().map_or(f64::INFINITY, |met| met.hit.distance);
            let medium = self.media.of(walk.media.current());
            let ray = walk.ray;
            self.lighting.along(&ray, limit, &wavelengths, &mut |mut light| {
                if let Some(through) = medium.transmittance(light.distance) {
                    light.radiance *= through;
                }
                state.meet::<DISPERSIVE>(self.lighting, ray.direction, &light);
            });
            let Some(met) = met else {
                // What absorbs lets nothing through from infinitely far.
                let absorbs = |sigma: &SampledSpectrum<N>| sigma.0.iter().any(|&sigma| sigma > 0.0);
                if !medium.absorption.as_ref().is_some_and(absorbs) {
                    self.lighting.environment(&ray, &wavelengths, &mut |light| {
                        state.meet::<DISPERSIVE>(self.lighting, ray.direction, &light);
                    });
                }
                break;
            };
            if let Some(through) = medium.transmittance(limit) {
                state.throughput *= through;
            }
            let met = walk.in_contact(met, &mut self.counters);
            if walk.crossings > MAX_CROSSINGS {
                self.counters.exhausted += 1;
                break;
            }
            if !self.event(&mut walk, &met, &mut state, numbers, &mut alpha, &mut vertices) {
                break;
            }
        }
        Seen { radiance: state.radiance, alpha }
    }

    /// What happens at a surface; whether the path goes on.
    fn event(
        &mut self,
        walk: &mut Walk<'a>,
        met: &SurfacePoint,
        state: &mut State<N>,
        numbers: &mut PathSampler,
        alpha: &mut f32,
        vertices: &mut u32,
    ) -> bool {
        let inside = self.view.inside(&met.hit, met.material_id);
        let medium = self.media.of(walk.media.current());
        // What lies behind: another medium only where the surface bounds one.
        let mut far = inside.map(|_| walk.far_side(met, &mut self.counters));
        let far_medium = far.as_ref().map_or(medium, |far| self.media.of(far.medium));
        let interface = Interface { ior_i: medium.iors, ior_t: far_medium.iors };
        let at = surface::at(self.view, &walk.ray, met, &state.wavelengths, interface);
        let way = u64::from(met.hit.instance) << 32 | u64::from(met.hit.primitive);
        if at.presence < 1.0 && (at.presence <= 0.0 || numbers.of(way) >= at.presence) {
            walk.cross(met);
            return true;
        }
        if let Some(far) = far.take_if(|far| far.medium == walk.media.current()) {
            // The same medium on both sides: no optics.
            walk.pass(met, far);
            return true;
        }
        if *vertices == 0 {
            *alpha = 1.0;
        }
        let direction = walk.ray.direction;
        if let Some(emitted) = self.lighting.emitted(&walk.ray, &met.hit, &state.wavelengths) {
            state.meet::<DISPERSIVE>(self.lighting, direction, &emitted);
        }
        if self.lighting.replaces_material(&met.hit) {
            return false;
        }
        state.object = Some(met.hit.instance);
        // The shading normal decides how light is scattered, the geometric one which side it is on.
        let toward = |n: DVec3| if direction.dot(met.surface.n_g) > 0.0 { -n } else { n };
        let n_g = toward(met.surface.n_g);
        let mut normal = toward(at.normal);
        if direction.dot(normal) >= 0.0 {
            normal = n_g;
        }
        let frame = match at.tangent {
            Some(tangent) => Frame::along(normal, tangent),
            None => Frame::about(normal),
        };
        let wo = frame.to_local(-direction);
        let bsdf = Bsdf::new(&at.parameters);
        let receiver = Receiver {
            point: met.point,
            normal: (!at.transmits).then(|| n_g.as_vec3()),
            object: met.hit.instance,
            time: walk.ray.time,
        };
        if !bsdf.is_smooth() && !self.lighting.is_empty() {
            let [u_light, u, v, _] = numbers.next();
            if let Some(light) = self.lighting.sample(&receiver, &state.wavelengths, u_light, [u, v]) {
                let local = frame.to_local(light.wi);
                // A side that the shading normal makes up is not lit.
                if (local.z > 0.0) == (light.wi.dot(n_g) > 0.0) {
                    self.add_direct(
                        walk,
                        met,
                        &bsdf,
                        [wo, local],
                        &light,
                        far.as_ref().map(|f| f.medium),
                        state,
                        numbers,
                    );
                }
            }
        }
        *vertices += 1;
        let [u_lobe, u, v, u_roulette] = numbers.next();
        let Some(sample) = bsdf.sample(wo, u_lobe, [u, v]) else { return false };
        let before = state.r;
        state.throughput *= sample.weight;
        let (direction, passes) = match sample.scattered {
            Scattered::Toward(wi) => {
                let direction = frame.to_world(wi);
                let passes = direction.dot(n_g) < 0.0;
                if passes != (wi.z < 0.0) {
                    return false;
                }
                let hero = sample.pdf.hero();
                if DISPERSIVE {
                    state.r *= sample.pdf * (1.0 / hero);
                }
                state.vertex = Some(Vertex { receiver, r_over_pdf: before * (1.0 / hero), bsdf, wo, wi });
                (direction, passes)
            }
            Scattered::Mirror => {
                state.vertex = None;
                let ior = medium.jet();
                let scattering = mirror(ior.ior * direction, &met.surface, &ior);
                ((scattering.momentum_out / ior.ior).normalize(), false)
            }
            Scattered::Refract => {
                state.vertex = None;
                let (ior_i, ior_t) = (medium.jet(), far_medium.jet());
                let scattering = refract_or_reflect(ior_i.ior * direction, &met.surface, &ior_i, &ior_t);
                if DISPERSIVE && (medium.is_dispersive || far_medium.is_dispersive) {
                    // No companion goes this way.
                    for lane in 1..N {
                        (state.throughput[lane], state.r[lane]) = (0.0, 0.0);
                    }
                }
                // f32 has let pass what f64 reflects: at the last digit before the critical angle.
                let passes = scattering.kind == ScatterKind::Refraction;
                let ior = if passes { ior_t.ior } else { ior_i.ior };
                ((scattering.momentum_out / ior).normalize(), passes)
            }
            Scattered::Straight => {
                state.vertex = None;
                walk.cross(met);
                return self.survives(state, *vertices, u_roulette);
            }
        };
        if passes {
            match far {
                Some(far) => walk.pass(met, far),
                None => walk.cross(met),
            }
        }
        walk.turn(met, direction, passes);
        self.survives(state, *vertices, u_roulette)
    }

    /// Roulette: a path goes on with the probability of what it still carries.
    fn survives(&self, state: &mut State<N>, vertices: u32, u: f32) -> bool {
        let carried = if DISPERSIVE { state.throughput * (1.0 / state.r.mean()) } else { state.throughput };
        // As a mean over the lanes: that is what the pixel gets.
        let carried = carried.mean();
        if !(carried > 0.0 && carried.is_finite()) {
            return false;
        }
        if vertices < ROULETTE_FROM {
            return true;
        }
        let probability = carried.min(MOST_LIKELY);
        if u >= probability {
            return false;
        }
        state.throughput *= 1.0 / probability;
        true
    }

    /// Adds what a sampled point of a light sends by way of the surface.
    #[expect(clippy::too_many_arguments, reason = "a stretch of `event`, apart so that surfaces without it stay short")]
    fn add_direct(
        &mut self,
        walk: &Walk<'a>,
        met: &SurfacePoint,
        bsdf: &Bsdf<N>,
        [wo, wi]: [Vec3; 2],
        light: &LightSample<N>,
        far: Option<Option<MediumId>>,
        state: &mut State<N>,
        numbers: &PathSampler,
    ) {
        let f = bsdf.evaluate(wo, wi);
        let source = self.lighting.light(light.light);
        let value = match source {
            Some(source) if has_factors(source) => {
                f.diffuse * source.diffuse as f32 + f.glossy * source.specular as f32
            }
            _ => f.diffuse + f.glossy,
        };
        let mut carried = state.throughput * value * light.radiance;
        if carried.is_black() {
            return;
        }
        let Some(through) = self.visibility(walk, met, light, source, far, state, numbers) else { return };
        carried *= through;
        let weight = match (light.is_delta, DISPERSIVE) {
            (true, true) => 1.0 / (state.r * light.pdf).mean(),
            (true, false) => 1.0 / light.pdf,
            (false, true) => 1.0 / (state.r * (f.pdf + SampledSpectrum::splat(light.pdf))).mean(),
            (false, false) => 1.0 / (f.pdf.hero() + light.pdf),
        };
        state.radiance += carried * weight;
    }

    /// What comes through from a sampled point of a light; `None` if nothing does.
    #[expect(clippy::too_many_arguments, reason = "as `add_direct`")]
    fn visibility(
        &mut self,
        walk: &Walk<'a>,
        met: &SurfacePoint,
        light: &LightSample<N>,
        source: Option<&Light>,
        far: Option<Option<MediumId>>,
        state: &State<N>,
        numbers: &PathSampler,
    ) -> Option<SampledSpectrum<N>> {
        let passes = light.wi.dot(walk.ray.direction) > 0.0 && (light.wi.dot(met.surface.n_g) > 0.0) == met.hit.leaving;
        let medium = match far {
            Some(medium) if passes => medium,
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
        let (view, wavelengths) = (self.view, &state.wavelengths);
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
            let dark = color.at(wavelengths);
            through *= SampledSpectrum::splat(1.0 - strength) + dark * strength;
        }
        Some(through)
    }
}
