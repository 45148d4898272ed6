//! One path: from the camera from surface to surface, adding what shines on the way.
//!
//! Throughput β is f |cos|/p of the hero's densities p. Beside it runs r, per lane the density with which that lane, had it been the
//! hero, would have made the path, over the hero's: what is added is β L / mean(r), the balance heuristic over the lanes (A. Wilkie
//! et al. 2014; in this form M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §14.2.2). r is 1 until a
//! rough interface disperses. A smooth dispersive refraction takes r of all companions to 0, since no other wavelength goes that way:
//! the hero then counts N-fold by itself.

use glam::{DVec3, Vec3};

use super::depth::{Depth, DepthLimits};
use super::ledger::Ledger;
use super::plate::Plate;
use crate::bsdf::{self, Bsdf, Interface, Scattered};
use crate::camera::Camera;
use crate::geometry::Ray;
use crate::integrator::chain::{Counters, Follower};
use crate::integrator::frame::Frame;
use crate::integrator::lanes::{Laws, PathMedia};
use crate::integrator::light_path::{self, Event, Expression};
use crate::integrator::surface;
use crate::integrator::walk::{MAX_CROSSINGS, SurfacePoint, Walk};
use crate::light::{Light, Shape};
use crate::lighting::{LightHit, LightId, LightSample, Lighting, Receiver};
use crate::optics::media::MediumId;
use crate::ray::{RayStart, ScatterKind, mirror, refract_or_reflect};
use crate::sampler::PathSampler;
use crate::scene::view::View;
use crate::spectrum::reflectance::Reflectance;
use crate::spectrum::{SampledSpectrum, Wavelengths, visible};

/// From this vertex on roulette may end a path.
const ROULETTE_FROM: u32 = 4;

/// From this vertex on a path survives with at most this probability, however much it carries: all paths end.
const ENDING_FROM: u32 = 64;
const MOST_LIKELY: f32 = 0.97;

/// What all paths of a render have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting<'a> {
    pub(super) view: &'a View<'a>,
    pub(super) camera: &'a Camera,
    pub(super) follower: &'a Follower<'a>,
    pub(super) lighting: &'a Lighting<'a>,
    pub(super) plate: Option<&'a Plate>,
    pub(super) limits: DepthLimits,
}

/// Traces paths on one thread.
pub(super) struct Tracer<'a, const N: usize, const DISPERSIVE: bool> {
    setting: Setting<'a>,
    media: PathMedia<'a, N>,
    /// Radiance per nm of the last path, and what it is divided into.
    pub(super) ledger: Ledger<'a, N>,
    pub(super) counters: Counters,
}

/// The last vertex that chose a direction by a density.
struct Vertex<const N: usize> {
    receiver: Receiver,
    /// r before its event, over the density of the direction.
    r_over_pdf: SampledSpectrum<N>,
    /// The part of its weight that is diffuse.
    diffuse_share: SampledSpectrum<N>,
}

/// What a path has come to.
struct State<const N: usize> {
    wavelengths: Wavelengths<N>,
    throughput: SampledSpectrum<N>,
    r: SampledSpectrum<N>,
    vertex: Option<Vertex<N>>,
    /// The object of the last event: only lights that are linked to it count.
    object: Option<u32>,
    depth: Depth,
    /// Since the camera light was only let through.
    sees_through: bool,
    alpha: f32,
    /// Squared index of the medium over that of the first: what refraction has taken from β without taking light, and gives back.
    squeezed: f32,
}

impl<const N: usize> State<N> {
    /// β / mean(r): what radiance from here counts.
    fn carried<const DISPERSIVE: bool>(&self) -> SampledSpectrum<N> {
        if DISPERSIVE { self.throughput * (1.0 / self.r.mean()) } else { self.throughput }
    }

    /// The path's light ends in what is no part of the picture: as much of the pixel stays open.
    fn open<const DISPERSIVE: bool>(&mut self) {
        if self.alpha > 0.0 {
            self.alpha -= self.carried::<DISPERSIVE>().mean().clamp(0.0, 1.0);
        }
    }
}

/// A surface that scatters, where the path has met it.
struct Scatterer<'s, const N: usize> {
    met: &'s SurfacePoint,
    /// Geometric normal on the side of the path.
    n_g: DVec3,
    frame: Frame,
    wo: Vec3,
    bsdf: Bsdf<N>,
    receiver: Receiver,
    /// The medium behind, where the surface bounds one.
    far: Option<Option<MediumId>>,
}

/// Where what could block a light at `distance` ends: before its own surface, which is met with the error of many roundings.
fn before(distance: f64) -> f64 {
    distance * (1.0 - 1e-9)
}

impl<'a, const N: usize, const DISPERSIVE: bool> Tracer<'a, N, DISPERSIVE> {
    pub(super) fn new(setting: Setting<'a>, laws: &'a Laws<'a>, expressions: &'a [Expression]) -> Self {
        let media = PathMedia::new(laws, visible::sample(0.5));
        Self { setting, media, ledger: Ledger::new(expressions), counters: Counters::default() }
    }

    /// Follows one path from `start` at the wavelengths: its light stands in [`ledger`](Self::ledger) then. Returns alpha: 1 where
    /// the camera sees a surface, 0 where it sees none.
    pub(super) fn trace(&mut self, start: &RayStart, wavelengths: Wavelengths<N>, numbers: &mut PathSampler) -> f32 {
        self.media.restart(wavelengths);
        self.ledger.restart();
        let Setting { lighting, .. } = self.setting;
        let mut walk = Walk::new(self.setting.follower, start);
        let mut state = State {
            wavelengths,
            throughput: SampledSpectrum::ONE,
            r: SampledSpectrum::ONE,
            vertex: None,
            object: None,
            depth: Depth::default(),
            sees_through: true,
            alpha: 0.0,
            squeezed: 1.0,
        };
        loop {
            let met = walk.advance(&mut self.counters);
            let limit = met.as_ref().map_or(f64::INFINITY, |met| met.hit.distance);
            let medium = self.media.of(walk.media.current());
            let ray = walk.ray;
            lighting.along(&ray, limit, &wavelengths, &mut |mut light| {
                if let Some(through) = medium.transmittance(light.distance) {
                    light.radiance *= through;
                }
                self.meet(&state, ray.direction, &light);
            });
            let Some(met) = met else {
                // What absorbs lets nothing through from infinitely far.
                let absorbs = |sigma: &SampledSpectrum<N>| sigma.0.iter().any(|&sigma| sigma > 0.0);
                if !medium.absorption.as_ref().is_some_and(absorbs) {
                    self.leave(&mut state, &ray);
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
            if !self.event(&mut walk, &met, &mut state, numbers) {
                break;
            }
        }
        state.alpha
    }

    /// The path meets nothing more.
    fn leave(&mut self, state: &mut State<N>, ray: &Ray) {
        let Setting { lighting, camera, plate, .. } = self.setting;
        if let (Some(plate), true) = (plate, state.sees_through) {
            if state.alpha > 0.0 {
                let seen = plate.radiance(camera, ray.direction, ray.time, &state.wavelengths);
                let background = Event::emission(light_path::Source::Environment, None);
                self.ledger.add(state.carried::<DISPERSIVE>() * seen, background);
            }
            return;
        }
        lighting.environment(ray, &state.wavelengths, &mut |light| self.meet(state, ray.direction, &light));
    }

    /// Adds the light that the path's ray has met.
    fn meet(&mut self, state: &State<N>, direction: DVec3, met: &LightHit<N>) {
        let lighting = self.setting.lighting;
        if state.object.is_some_and(|object| !lighting.is_linked(met.light, object)) {
            return;
        }
        let emission = self.emission(met.light);
        let light = lighting.light(met.light);
        let mut seen = met.radiance;
        if state.object.is_some()
            && let Some(light) = light.filter(|light| light.has_factors())
        {
            let diffuse_share = state.vertex.as_ref().map_or(SampledSpectrum::ZERO, |vertex| vertex.diffuse_share);
            let specular = SampledSpectrum::splat(light.specular as f32);
            seen *= specular + diffuse_share * (light.diffuse - light.specular) as f32;
        }
        let Some(vertex) = &state.vertex else {
            // Nothing but this way leads there.
            self.ledger.add(state.carried::<DISPERSIVE>() * seen, emission);
            return;
        };
        let pdf = lighting.pdf(&vertex.receiver, direction, met);
        if pdf > 0.0 && light.is_some_and(|light| !light.has_natural_shadows()) {
            // What blocks it is not what blocks rays: all of it is sampled.
            return;
        }
        let weight = if DISPERSIVE {
            1.0 / (state.r + vertex.r_over_pdf * pdf).mean()
        } else {
            1.0 / (1.0 + vertex.r_over_pdf.hero() * pdf)
        };
        self.ledger.add(state.throughput * seen * weight, emission);
    }

    /// What a light is to expressions.
    fn emission(&self, id: LightId) -> Event {
        if !self.ledger.is_divided() {
            return Event::emission(light_path::Source::Light, None);
        }
        let Some(light) = self.setting.lighting.light(id) else {
            return Event::emission(light_path::Source::Surface, None);
        };
        let source = match light.shape {
            Shape::Distant(_) | Shape::Dome(_) => light_path::Source::Environment,
            _ => light_path::Source::Light,
        };
        Event::emission(source, light.group)
    }

    /// What happens at a surface; whether the path goes on.
    fn event(
        &mut self,
        walk: &mut Walk<'a>,
        met: &SurfacePoint,
        state: &mut State<N>,
        numbers: &mut PathSampler,
    ) -> bool {
        let Setting { view, lighting, limits, .. } = self.setting;
        let inside = view.inside(&met.hit, met.material_id);
        let medium = self.media.of(walk.media.current());
        // What lies behind: another medium only where the surface bounds one.
        let mut far = inside.map(|_| walk.far_side(met, &mut self.counters));
        let far_medium = far.as_ref().map_or(medium, |far| self.media.of(far.medium));
        let interface = Interface { ior_i: medium.iors, ior_t: far_medium.iors };
        let at = surface::at(view, &walk.ray, met, &state.wavelengths, interface);
        let is_there = at.presence >= 1.0 || numbers.of(surface::crossing(&met.hit)) < at.presence;
        if !is_there {
            walk.cross(met);
            return true;
        }
        if let Some(far) = far.take_if(|far| far.medium == walk.media.current()) {
            // The same medium on both sides: no optics.
            walk.pass(met, far);
            return true;
        }
        if state.sees_through && view.scene.objects.ids(met.hit.instance).appearance.matte {
            state.open::<DISPERSIVE>();
            return false;
        }
        if state.depth.total() == 0 {
            state.alpha = 1.0;
        }
        let direction = walk.ray.direction;
        if let Some(emitted) = lighting.emitted(&walk.ray, &met.hit, &state.wavelengths) {
            self.meet(state, direction, &emitted);
        }
        if lighting.replaces_material(&met.hit) {
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
        let surface = Scatterer {
            met,
            n_g,
            frame,
            wo: frame.to_local(-direction),
            bsdf: Bsdf::new(&at.parameters),
            receiver: Receiver {
                point: met.point,
                normal: (!at.transmits).then(|| n_g.as_vec3()),
                object: met.hit.instance,
                time: walk.ray.time,
            },
            far: far.as_ref().map(|far| far.medium),
        };
        if !surface.bsdf.is_smooth() && !lighting.is_empty() {
            let [u_light, u, v, _] = numbers.draw();
            if let Some(light) = lighting.sample(&surface.receiver, &state.wavelengths, u_light, [u, v]) {
                self.add_direct(walk, &surface, &light, state, numbers);
            }
        }
        let [u_lobe, u, v, u_roulette] = numbers.draw();
        let Some(sample) = surface.bsdf.sample(surface.wo, u_lobe, [u, v]) else { return false };
        state.depth = state.depth.after(sample.event);
        if !state.depth.is_within(&limits) {
            return false;
        }
        let before = state.r;
        state.throughput *= sample.weight;
        let (turned, passes) = match sample.scattered {
            Scattered::Toward(wi) => {
                let turned = frame.to_world(wi);
                let passes = turned.dot(n_g) < 0.0;
                if passes != (wi.z < 0.0) {
                    return false;
                }
                let hero = sample.pdf.hero();
                if DISPERSIVE {
                    state.r *= sample.pdf * (1.0 / hero);
                }
                state.vertex = Some(Vertex {
                    receiver: surface.receiver,
                    r_over_pdf: before * (1.0 / hero),
                    diffuse_share: sample.diffuse.safe_div(sample.weight),
                });
                (turned, passes)
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
                (direction, true)
            }
        };
        if self.ledger.is_divided() {
            self.ledger.scatter(&ways(&sample, passes));
        }
        if passes && far.is_some() {
            let ratio = (far_medium.ior / medium.ior) as f32;
            state.squeezed *= ratio * ratio;
        }
        state.sees_through &= passes && sample.event != bsdf::Event::Diffuse;
        match (sample.scattered, far) {
            (Scattered::Straight, _) | (_, None) if passes => walk.cross(met),
            (_, Some(far)) if passes => walk.pass(met, far),
            _ => {}
        }
        if sample.scattered != Scattered::Straight {
            walk.turn(met, turned, passes);
        }
        self.survives(state, u_roulette)
    }

    /// Roulette: a path goes on with the probability of what it still carries.
    fn survives(&self, state: &mut State<N>, u: f32) -> bool {
        // As a mean over the lanes: that is what the pixel gets.
        let carried = state.carried::<DISPERSIVE>().mean() * state.squeezed;
        if !(carried > 0.0 && carried.is_finite()) {
            return false;
        }
        if state.depth.total() < ROULETTE_FROM {
            return true;
        }
        let most = if state.depth.total() < ENDING_FROM { 1.0 } else { MOST_LIKELY };
        let probability = carried.min(most);
        if u >= probability {
            return false;
        }
        state.throughput *= 1.0 / probability;
        true
    }

    /// Adds what a sampled point of a light sends by way of the surface.
    fn add_direct(
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
        let limits = &self.setting.limits;
        if !state.depth.after(bsdf::Event::Diffuse).is_within(limits) {
            f.diffuse = SampledSpectrum::ZERO;
        }
        if !state.depth.after(gloss).is_within(limits) {
            f.glossy = SampledSpectrum::ZERO;
        }
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

/// The ways in which the drawn direction is scattered, with their shares.
fn ways<const N: usize>(sample: &bsdf::BsdfSample<N>, passes: bool) -> [(Event, SampledSpectrum<N>); 2] {
    let diffuse = Event::scattering(bsdf::Event::Diffuse, passes);
    if !matches!(sample.scattered, Scattered::Toward(_)) {
        return [(Event::scattering(sample.event, passes), SampledSpectrum::ONE), (diffuse, SampledSpectrum::ZERO)];
    }
    let gloss = if passes { bsdf::Event::GlossyTransmission } else { bsdf::Event::GlossyReflection };
    let share = sample.diffuse.safe_div(sample.weight);
    [(diffuse, share), (Event::scattering(gloss, passes), SampledSpectrum::ONE - share)]
}
