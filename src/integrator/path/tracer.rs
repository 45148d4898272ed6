//! One path: from the camera from surface to surface, adding what shines on the way.
//!
//! Throughput β is f |cos|/p of the hero's densities p. Beside it runs r, per lane the density with which that lane, had it been the
//! hero, would have made the path, over the hero's: what is added is β L / mean(r), the balance heuristic over the lanes (A. Wilkie
//! et al. 2014; in this form M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §14.2.2). r is 1 until a
//! rough interface disperses. A smooth dispersive refraction takes r of all companions to 0, since no other wavelength goes that way:
//! the hero then counts N-fold by itself.

use glam::DVec3;

use super::depth::DepthLimits;
use super::guide::Guide;
use super::image::Trail;
use super::ledger::Ledger;
use super::plate::Plate;
use super::state::{Arrival, Look, Met, Purpose, Scatterer, State, Vertex, Way};
use crate::bsdf::{self, Interface, Scattered};
use crate::camera::Camera;
use crate::geometry::Ray;
use crate::integrator::chain::{Counters, Follower};
use crate::integrator::frame::Frame;
use crate::integrator::lanes::{Laws, Medium, PathMedia};
use crate::integrator::light_path::{self, Event, Expression};
use crate::integrator::surface;
use crate::integrator::walk::{MAX_CROSSINGS, Walk};
use crate::light::Shape;
use crate::lighting::{LightHit, LightId, Lighting, Receiver};
use crate::ray::{Deflected, RayStart, ScatterKind, deflect};
use crate::sampler::{Four, PathSampler};
use crate::scene::material::Finish;
use crate::scene::view::View;
use crate::spectrum::{SampledSpectrum, Wavelengths, visible};

/// A path is worth going on for certain while it carries more than 1 over this of what it carried after its first scattering, which is
/// about what the pixel is worth. Error times time is flat from 1.5 to 4; without (1, from the fourth vertex on) it is 1.3 to 1.6 times
/// as much.
const WORTHWHILE: f32 = 2.0;

/// From this vertex on a path survives with at most this probability, however much it carries: all paths end.
const ENDING_FROM: u32 = 64;
const MOST_LIKELY: f32 = 0.97;

/// Smooth events that light is looked for by way of at most: in cut stones chains are long, and bring little.
const MOST_SMOOTH: u32 = 8;

/// Photons take each of the two ways on from smooth glass with at least this probability: they learn of faint light, too.
const EXPLORED: f32 = 0.1;

/// What all paths of a render have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting<'a> {
    pub(super) view: &'a View<'a>,
    pub(super) camera: &'a Camera,
    pub(super) follower: &'a Follower<'a>,
    pub(super) lighting: &'a Lighting<'a>,
    pub(super) plate: Option<&'a Plate>,
    pub(super) guide: Option<&'a Guide>,
    pub(super) limits: DepthLimits,
}

/// Traces paths on one thread.
pub(super) struct Tracer<'a, const N: usize, const DISPERSIVE: bool> {
    pub(super) setting: Setting<'a>,
    pub(super) media: PathMedia<'a, N>,
    /// Radiance per nm of the last path, and what it is divided into.
    pub(super) ledger: Ledger<'a, N>,
    pub(super) counters: Counters,
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
        let mut walk = Walk::new(self.setting.follower, start);
        let mut state = State::new(Purpose::Picture, wavelengths);
        self.follow(&mut walk, &mut state, numbers);
        state.alpha
    }

    /// Follows light from `ray` on to where it arrives by way of smooth surfaces alone; `None` if it meets another surface first, or
    /// gets lost.
    pub(super) fn photon(
        &mut self,
        ray: Ray,
        trail: Option<Trail>,
        wavelengths: Wavelengths<N>,
        numbers: &mut PathSampler,
    ) -> Option<Arrival<N>> {
        self.media.restart(wavelengths);
        let mut walk = Walk::anywhere(self.setting.view, ray);
        let mut state = State { trail: trail.map(Box::new), ..State::new(Purpose::Photon, wavelengths) };
        self.follow(&mut walk, &mut state, numbers);
        state.arrival
    }

    /// Follows a walk to its end.
    pub(super) fn follow(&mut self, walk: &mut Walk<'a>, state: &mut State<N>, numbers: &mut PathSampler) {
        loop {
            let mut met: Option<Met> = walk.advance(&mut self.counters);
            let limit = met.as_ref().map_or(f64::INFINITY, |met| met.hit.distance);
            let medium = self.media.of(walk.media.current());
            if state.meets_lights() {
                self.meet_along(&walk.ray, limit, &medium, state);
            }
            let Some(met) = &mut met else {
                // What absorbs lets nothing through from infinitely far.
                let absorbs = |sigma: &SampledSpectrum<N>| sigma.0.iter().any(|&sigma| sigma > 0.0);
                if state.meets_lights() && !medium.absorption.as_ref().is_some_and(absorbs) {
                    self.leave(state, &walk.ray);
                }
                break;
            };
            if let Some(through) = medium.transmittance(limit) {
                state.throughput *= through;
            }
            walk.in_contact(met, &mut self.counters);
            if walk.crossings > MAX_CROSSINGS {
                self.counters.exhausted += 1;
                break;
            }
            if let Some(trail) = &mut state.trail {
                let (_, surface) = self.setting.view.aggregate.local_surface(&walk.ray, &met.hit);
                trail.transfer(&walk.ray, met.hit.distance, surface, medium.ior);
            }
            if !self.event(walk, met, &medium, state, numbers) {
                break;
            }
        }
    }

    /// Adds the lights that are no geometry and that the path's ray meets before `limit`.
    fn meet_along(&mut self, ray: &Ray, limit: f64, medium: &Medium<N>, state: &State<N>) {
        self.setting.lighting.along(ray, limit, &state.wavelengths, &mut |mut light| {
            if let Some(through) = medium.transmittance(light.distance) {
                light.radiance *= through;
            }
            self.meet(state, ray.direction, &light);
        });
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
        let is_direct = state.smooth_events == 0;
        let mut seen = met.radiance;
        if state.object.is_some()
            && let Some(light) = light.filter(|light| light.has_factors())
        {
            let scattered = state.vertex.as_ref().filter(|_| is_direct);
            let diffuse_share = scattered.map_or(SampledSpectrum::ZERO, |vertex| vertex.diffuse_share);
            let specular = SampledSpectrum::splat(light.specular as f32);
            seen *= specular + diffuse_share * (light.diffuse - light.specular) as f32;
        }
        let Some(vertex) = &state.vertex else {
            // Nothing but this way leads there.
            self.ledger.add(state.carried::<DISPERSIVE>() * seen, emission);
            return;
        };
        // By way of smooth surfaces the guide finds it, if anything does. A look that takes a certain way has a throughput as if it
        // had chosen it by chance: its density is over that probability.
        let pdf = match (self.setting.guide, vertex.look) {
            _ if is_direct => lighting.pdf(&vertex.receiver, direction, met),
            _ if state.smooth_events > MOST_SMOOTH => 0.0,
            (Some(guide), Some(Look { region, count })) => {
                count * guide.pdf(region, vertex.receiver.point, vertex.direction, state.way, state.chosen)
            }
            _ => 0.0,
        };
        if is_direct && pdf > 0.0 && light.is_some_and(|light| !light.has_natural_shadows()) {
            // What blocks it is not what blocks rays: all of it is sampled.
            return;
        }
        let pdf = if is_direct && state.is_cut_off { 0.0 } else { pdf };
        if state.purpose == Purpose::Focused && pdf <= 0.0 {
            // Rounding has put it just beyond the edge of its own lobe, where nothing may be left.
            return;
        }
        let weight = if DISPERSIVE {
            1.0 / (state.r + vertex.r_over_pdf * pdf).mean()
        } else {
            1.0 / (state.r.hero() + vertex.r_over_pdf.hero() * pdf)
        };
        self.ledger.add(state.throughput * seen * weight, emission);
    }

    /// What a light is to expressions.
    pub(super) fn emission(&self, id: LightId) -> Event {
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
        met: &Met,
        medium: &Medium<N>,
        state: &mut State<N>,
        numbers: &mut PathSampler,
    ) -> bool {
        let Setting { view, lighting, .. } = self.setting;
        let inside = view.inside(&met.hit, met.material_id);
        if state.purpose != Purpose::Picture
            && inside.is_none()
            && view.is_rough(met.material_id)
            && !lighting.is_empty()
        {
            self.arrive(walk, met, state);
            return false;
        }
        // What lies behind: another medium only where the surface bounds one.
        let far = inside.map(|_| walk.far_side(met, &mut self.counters));
        let far_medium = match &far {
            Some(far) => self.media.of(far.medium),
            None => *medium,
        };
        let interface = Interface { ior_i: medium.iors, ior_t: far_medium.iors };
        let finish = view.finish(&met.hit, met.material_id, &state.wavelengths, interface);
        let presence = finish.presence();
        let is_there = presence >= 1.0 || numbers.of(surface::crossing(&met.hit)) < presence;
        if !is_there {
            walk.cross(met);
            return true;
        }
        if far.as_ref().is_some_and(|far| far.medium == walk.media.current()) {
            // The same medium on both sides: no optics. But shadow rays know nothing of media.
            state.is_cut_off = true;
            walk.go_behind(met, far);
            return true;
        }
        if !self.see(walk, met, state) {
            return false;
        }
        // Moving it would take longer than what most surfaces need of it.
        let bsdf = &finish.bsdf();
        let (frame, n_g) = frame(view, &walk.ray, met, &finish);
        let mut surface = Scatterer {
            met,
            n_g,
            frame,
            wo: frame.to_local(-walk.ray.direction),
            bsdf,
            receiver: Receiver {
                point: met.point,
                normal: (!finish.transmits()).then(|| n_g.as_vec3()),
                object: met.hit.instance,
                time: walk.ray.time,
            },
            far: far.as_ref().map(|far| far.medium),
            look: None,
        };
        if !bsdf.is_smooth() && !lighting.is_empty() {
            match state.purpose {
                Purpose::Focused => return false,
                Purpose::Photon => {
                    state.arrive::<DISPERSIVE>(met.point, &walk.ray, medium.ior);
                    return false;
                }
                Purpose::Picture => self.gather(walk, &mut surface, state, numbers),
            }
        }
        if state.purpose != Purpose::Picture && state.smooth_events == MOST_SMOOTH {
            return false;
        }
        let four = numbers.four();
        let Some(turn) = self.scatter(walk, &surface, [medium, &far_medium], state, &four) else { return false };
        if turn.passes {
            if far.is_some() {
                let ratio = (far_medium.ior / medium.ior) as f32;
                state.squeezed *= ratio * ratio;
            }
            // Through a wall straight on: what lies behind is not of this surface.
            walk.go_behind(met, if turn.is_straight { None } else { far });
        }
        if !turn.is_straight {
            walk.turn(met, turn.direction, turn.passes);
        }
        self.survives(state, || four.at(3))
    }

    /// The path meets a surface that is there, with what it emits; whether it scatters.
    fn see(&mut self, walk: &Walk<'a>, met: &Met, state: &mut State<N>) -> bool {
        let Setting { view, lighting, .. } = self.setting;
        if state.sees_through && view.scene.objects.ids(met.hit.instance).appearance.matte {
            state.open::<DISPERSIVE>();
            return false;
        }
        if state.depth.total() == 0 {
            state.alpha = 1.0;
        }
        self.meet_emission(walk, met, state);
        state.object = Some(met.hit.instance);
        !lighting.replaces_material(&met.hit)
    }

    /// Adds what the surface emits.
    fn meet_emission(&mut self, walk: &Walk<'a>, met: &Met, state: &State<N>) {
        if state.meets_lights()
            && let Some(emitted) = self.setting.lighting.emitted(&walk.ray, &met.hit, &state.wavelengths)
        {
            self.meet(state, walk.ray.direction, &emitted);
        }
    }

    /// Adds what the surface scatters of light that is looked for: at a sampled point of a light, and by way of smooth surfaces.
    fn gather(&mut self, walk: &Walk<'a>, surface: &mut Scatterer<'_, N>, state: &State<N>, numbers: &mut PathSampler) {
        let Setting { lighting, guide, .. } = self.setting;
        let four = numbers.four();
        let (u_light, u) = (|| four.at(0), [four.at(1), four.at(2)]);
        if let Some(light) = lighting.sample_where_chosen(&surface.receiver, &state.wavelengths, u_light, u) {
            self.add_direct(walk, surface, &light, state, numbers);
        }
        let Some(guide) = guide else { return };
        surface.look = guide.region(surface.met.point).map(|region| {
            let weight = state.carried::<DISPERSIVE>().mean();
            Look { region, count: guide.count(region, weight) }
        });
        self.add_focused(walk, surface, state, || four.at(3), numbers);
    }

    /// Draws what becomes of the path between the `media` of both sides; `None` where it ends.
    fn scatter(
        &mut self,
        walk: &Walk<'a>,
        surface: &Scatterer<'_, N>,
        [medium, far_medium]: [&Medium<N>; 2],
        state: &mut State<N>,
        four: &Four,
    ) -> Option<Turn> {
        let is_clear = surface.bsdf.is_clear();
        let wanted = match state.wanted.map(|way| way.at(state.smooth_events)) {
            Some(None) => return None,
            wanted => wanted.flatten(),
        };
        let u_lobe = || match state.purpose {
            Purpose::Focused if is_clear && wanted.is_some() => f32::from(u8::from(wanted == Some(true))),
            Purpose::Photon if four.at(3) < EXPLORED => 0.0,
            Purpose::Photon if four.at(3) < 2.0 * EXPLORED => 1.0 - f32::EPSILON,
            _ => four.at(0),
        };
        let sample = surface.bsdf.sample_lazily(surface.wo, u_lobe, || [four.at(1), four.at(2)])?;
        if state.purpose == Purpose::Photon && sample.pdf.hero() < 1.0 {
            let probability = sample.pdf.hero();
            state.throughput *= probability / ((1.0 - 2.0 * EXPLORED) * probability + EXPLORED);
        }
        if wanted.is_some_and(|passes| passes == (sample.scattered == Scattered::Mirror)) {
            return None;
        }
        if is_clear {
            state.chosen *= sample.pdf.hero();
        }
        state.depth = state.depth.after(sample.event);
        if !state.depth.is_within(&self.setting.limits) {
            return None;
        }
        let before = state.r;
        state.throughput *= sample.weight;
        let normals = &surface.met.surface;
        let direction = walk.ray.direction;
        let (turned, passes) = if let Scattered::Toward(wi) = sample.scattered {
            let turned = surface.frame.to_world(wi);
            let passes = turned.dot(surface.n_g) < 0.0;
            if passes != (wi.z < 0.0) {
                return None;
            }
            let hero = sample.pdf.hero();
            if DISPERSIVE {
                state.r *= sample.pdf * (1.0 / hero);
            }
            state.vertex = Some(Vertex {
                receiver: surface.receiver,
                r_over_pdf: before * (1.0 / hero),
                diffuse_share: sample.diffuse.safe_div(sample.weight),
                look: surface.look.filter(|_| !passes),
                direction: turned,
            });
            (state.smooth_events, state.is_cut_off) = (0, false);
            (state.way, state.chosen) = (Way::START, 1.0);
            if state.first.is_none() {
                state.first = Some(state.worth::<DISPERSIVE>());
            }
            (turned, passes)
        } else {
            // A look ends at a surface with other lobes: nothing but this way leads on from its smooth one.
            if !surface.bsdf.is_smooth() {
                state.vertex = None;
            }
            state.pass_smoothly(sample.scattered != Scattered::Mirror);
            match sample.scattered {
                Scattered::Toward(_) | Scattered::Straight => (direction, true),
                Scattered::Mirror => {
                    if let Some(trail) = &mut state.trail {
                        trail.turn(direction, medium.ior, None);
                    }
                    let Deflected { momentum, .. } = deflect(medium.ior * direction, normals, medium.ior, None);
                    ((momentum / medium.ior).normalize(), false)
                }
                Scattered::Refract => {
                    if let Some(trail) = &mut state.trail {
                        trail.turn(direction, medium.ior, Some(far_medium.ior));
                    }
                    let Deflected { momentum, kind } =
                        deflect(medium.ior * direction, normals, medium.ior, Some(far_medium.ior));
                    if DISPERSIVE && (medium.is_dispersive || far_medium.is_dispersive) {
                        state.leave_companions();
                    }
                    // f32 has let pass what f64 reflects: at the last digit before the critical angle.
                    let passes = kind == ScatterKind::Refraction;
                    ((momentum / if passes { far_medium.ior } else { medium.ior }).normalize(), passes)
                }
            }
        };
        if self.ledger.is_divided() {
            self.ledger.scatter(&ways(&sample, passes));
        }
        state.sees_through &= passes && sample.event != bsdf::Event::Diffuse;
        Some(Turn { direction: turned, passes, is_straight: sample.scattered == Scattered::Straight })
    }

    /// What looks for a surface that is not smooth has met one: of its material no more has to be known.
    fn arrive(&mut self, walk: &Walk<'a>, met: &Met, state: &mut State<N>) {
        self.meet_emission(walk, met, state);
        if state.purpose == Purpose::Photon && !self.setting.lighting.replaces_material(&met.hit) {
            let ior = self.media.of(walk.media.current()).ior;
            state.arrive::<DISPERSIVE>(met.point, &walk.ray, ior);
        }
    }

    /// Roulette: a path goes on with a probability in proportion to what it still carries.
    fn survives(&self, state: &mut State<N>, u: impl FnOnce() -> f32) -> bool {
        if state.purpose == Purpose::Focused {
            // Its densities stand in the weight of what it meets.
            return !state.throughput.is_black();
        }
        let carried = state.worth::<DISPERSIVE>();
        if !(carried > 0.0 && carried.is_finite()) {
            return false;
        }
        // Photons are few beside paths.
        if state.purpose == Purpose::Photon && state.depth.total() < ENDING_FROM {
            return true;
        }
        let most = if state.depth.total() < ENDING_FROM { 1.0 } else { MOST_LIKELY };
        let probability = (WORTHWHILE * carried / state.first.unwrap_or(1.0)).min(most);
        if u() >= probability {
            return false;
        }
        state.throughput *= 1.0 / probability;
        true
    }
}

/// Where a path goes on from a surface.
struct Turn {
    direction: DVec3,
    /// To the other side.
    passes: bool,
    /// As if nothing were met.
    is_straight: bool,
}

/// The frame in which a surface scatters, and its geometric normal on the side of the ray that met it. The shading normal
/// decides how light is scattered, the geometric one which side it is on.
fn frame<const N: usize>(view: &View<'_>, ray: &Ray, met: &Met, finish: &Finish<N>) -> (Frame, DVec3) {
    let (normal, tangent) = surface::normal_and_tangent(view, ray, &met.hit, &met.surface, finish.directed());
    let toward = |n: DVec3| if ray.direction.dot(met.surface.n_g) > 0.0 { -n } else { n };
    let n_g = toward(met.surface.n_g);
    let mut normal = toward(normal);
    if ray.direction.dot(normal) >= 0.0 {
        normal = n_g;
    }
    let frame = match tangent {
        Some(tangent) => Frame::along(normal, tangent),
        None => Frame::about(normal),
    };
    (frame, n_g)
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
