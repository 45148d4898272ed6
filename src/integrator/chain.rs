//! The specular chain: from the camera through glass to the first surface that is neither transmissive nor a mirror.
//!
//! Deterministic, at one wavelength: transmit at every transmissive interface, reflect where reflection is total and at
//! smooth mirrors. It ends at the first other surface, at a miss, or after [`MAX_EVENTS`] events. The geometric normal
//! alone decides entering or leaving; the media around the ray are a stack with priorities.
//!
//! A camera does not see what its planes clip and what is hidden from it. That holds until the ray is first refracted or
//! reflected: its later segments meet everything. Media are not cut: a ray goes straight through a surface that its camera
//! does not see, and begins behind the last such surface, in the media that are there.

use glam::DVec3;

pub use super::counters::Counters;
use super::transmittance::Segment;
pub use super::walk::SurfacePoint;
use super::walk::{MAX_CROSSINGS, Walk};
use crate::camera::{Camera, Clipping, Sight};
use crate::optics::IorJet;
use crate::optics::media::{MediaStack, MediumId};
use crate::ray::{ColumnSet, RayStart, ScatterKind, Scattering, Step, Transfer};
use crate::ray::{critical_distance, mirror, refract_or_reflect};
use crate::scene::material::Kind;
use crate::scene::view::{Media, Presence, View};

/// A chain that would have more events than this has no end.
pub const MAX_EVENTS: u32 = 64;

/// How a chain ends.
#[allow(clippy::large_enum_variant, reason = "one a chain, on the stack; most chains end at a surface")]
#[derive(Clone, Copy, Debug)]
pub enum End {
    /// At a surface that neither transmits nor mirrors.
    Surface(SurfacePoint),
    /// In the environment.
    Miss,
    /// Nowhere: too many events.
    Exhausted,
}

/// What happened to a ray on its way.
#[derive(Clone, Copy, Debug)]
pub struct Chain<C> {
    /// Its end.
    pub end: End,
    /// The first surface that is there at all (cut-outs are not).
    pub first: Option<SurfacePoint>,
    /// Index of the medium where the ray begins.
    pub start_medium: IorJet,
    /// Unit direction of the last segment.
    pub direction: DVec3,
    /// Index of the last segment's medium at the chain's wavelength.
    pub medium: IorJet,
    /// Columns at the end: transferred to the surface, or leaving the last event for a miss.
    pub columns: C,
    /// `material_id` of the first dielectric entered, 0 for none.
    pub dielectric_id: u32,
    /// Specular events.
    pub interfaces: u32,
    /// Specular events at rough interfaces.
    pub rough_interfaces: u32,
    /// Total internal reflections.
    pub total_reflections: u32,
    /// Whether some refraction had a medium whose index moves with wavelength: else all λ derivatives are exactly 0.
    pub is_dispersive: bool,
    /// The least |δ_c| of all events, nm: how far in wavelength the chain keeps its events (with [`ColumnSet::SECOND`]).
    pub nearest_critical: f64,
}

/// What a chain writes down as it goes; whatever is not asked for is not kept.
#[derive(Debug, Default)]
pub struct Record<'r> {
    /// Every event with its transfer, and the last transfer: what a second chain replays.
    pub steps: Option<&'r mut Vec<Step>>,
    /// Every segment with its medium: one for each step, and the last one of a miss.
    pub segments: Option<&'r mut Vec<Segment>>,
}

impl<'r> Record<'r> {
    /// Nothing.
    pub fn none() -> Self {
        Self::default()
    }

    /// Only what a second chain replays.
    pub fn of_steps(steps: &'r mut Vec<Step>) -> Self {
        Self { steps: Some(steps), segments: None }
    }

    fn clear(&mut self) {
        if let Some(steps) = self.steps.as_deref_mut() {
            steps.clear();
        }
        if let Some(segments) = self.segments.as_deref_mut() {
            segments.clear();
        }
    }

    #[inline]
    fn step(&mut self, transfer: &Transfer, scattering: Option<&Scattering>) {
        if let Some(steps) = self.steps.as_deref_mut() {
            steps.push(Step { transfer: *transfer, scattering: scattering.copied() });
        }
    }

    #[inline]
    fn segment(&mut self, length: f64, medium: Option<MediumId>) {
        if let Some(segments) = self.segments.as_deref_mut() {
            segments.push(Segment { medium, length });
        }
    }
}

/// Follows chains through one view.
#[derive(Debug)]
pub struct Follower<'a> {
    pub(super) view: &'a View<'a>,
    outside: Outside,
    /// What a camera does not see; `None` if it sees everything.
    unseen: Option<Clipping>,
    /// The camera, if it moves.
    camera: Option<Camera>,
}

/// The media where rays start.
#[derive(Debug)]
enum Outside {
    /// The same everywhere.
    Same(MediaStack),
    /// The same for all rays that start in this box.
    SameWithin([DVec3; 2], MediaStack),
    /// Different from ray to ray, in place or time.
    Different,
}

impl<'a> Follower<'a> {
    /// For rays that start at the camera of `view` and see everything.
    pub fn new(view: &'a View<'a>) -> Self {
        let zero = DVec3::ZERO;
        let passing = view.aggregate.is_moving() && view.has_glass_in([zero; 2]);
        let outside = if passing { Outside::Different } else { Outside::Same(view.media_at(zero, 0.0)) };
        Self { view, outside, unseen: None, camera: None }
    }

    /// For the rays of `camera`, whose position is the origin of `view`.
    pub fn of_camera(view: &'a View<'a>, camera: &Camera) -> Self {
        let outside = match camera.start_box() {
            None => Self::new(view).outside,
            Some(starts) if view.has_glass_in(starts) => Outside::Different,
            Some(starts) => Outside::SameWithin(starts, view.media_at(0.5 * (starts[0] + starts[1]), 0.0)),
        };
        let clipping = match view.aggregate.bounds() {
            Some(_) if camera.is_moving() => camera.clipping().clone(),
            Some(bounds) if !camera.clipping().is_empty() => camera.clipping().of_box(bounds),
            _ => Clipping::default(),
        };
        let unseen = (view.scene.objects.hides_some() || !clipping.is_empty()).then_some(clipping);
        Self { view, outside, unseen, camera: camera.is_moving().then(|| camera.clone()) }
    }

    /// Where the camera sees surfaces on a ray.
    pub(super) fn sight(&self, start: &RayStart) -> Option<Sight> {
        let clipping = self.unseen.as_ref()?;
        // The planes move with the camera; a map of both changes no distance along the ray.
        let (mut point, mut direction) = (start.point, start.direction);
        if let Some(frame) = self.camera.as_ref().and_then(|camera| camera.frame_from_time(start.time)) {
            (point, direction) = (frame.transform_point3(point), frame.transform_vector3(direction));
        }
        Some(clipping.sight(point, direction))
    }

    pub(super) fn media_around(&self, start: &RayStart) -> MediaStack {
        let p = start.point;
        match &self.outside {
            Outside::Same(media) => media.clone(),
            Outside::SameWithin([min, max], media) if min.cmple(p).all() && p.cmple(*max).all() => media.clone(),
            Outside::SameWithin(..) | Outside::Different => self.view.media_at(p, start.time),
        }
    }

    /// The first surface alone: nothing is followed.
    pub fn first_surface(&self, start: &RayStart, counters: &mut Counters) -> Option<SurfacePoint> {
        let mut walk = Walk::new(self, start);
        loop {
            let met: SurfacePoint = walk.advance(counters)?;
            if met.presence != Presence::Absent {
                return Some(met);
            }
            walk.cross(&met);
            if walk.crossings > MAX_CROSSINGS {
                return None;
            }
        }
    }

    /// Follows the chain of `start` with the indices of `media`, carrying the columns `C`. What stands in `record` is
    /// replaced.
    pub fn follow<C: ColumnSet>(
        &self,
        start: &RayStart,
        media: &Media,
        mut record: Record<'_>,
        counters: &mut Counters,
    ) -> Chain<C> {
        counters.chains += 1;
        record.clear();
        let mut walk = Walk::new(self, start);
        let mut medium = media.of(walk.media.current());
        let mut chain = Chain {
            end: End::Miss,
            first: None,
            start_medium: medium,
            direction: start.direction,
            medium,
            columns: C::start(start, &medium),
            dielectric_id: 0,
            interfaces: 0,
            rough_interfaces: 0,
            total_reflections: 0,
            is_dispersive: false,
            nearest_critical: f64::INFINITY,
        };
        let columns_carried = u64::from(C::LAMBDA) + 2 * u64::from(C::SCREEN) + u64::from(C::SECOND);
        let mut momentum = medium.ior * start.direction;
        loop {
            let met: Option<SurfacePoint> = walk.advance(counters);
            if std::mem::take(&mut walk.begins_anew) {
                medium = media.of(walk.media.current());
                momentum = medium.ior * start.direction;
                (chain.start_medium, chain.columns) = (medium, C::start(start, &medium));
            }
            let Some(mut met) = met else { break };
            let cut_out = met.presence == Presence::Absent;
            if !cut_out && chain.first.is_none() {
                chain.first = Some(met);
            }
            if cut_out {
                walk.cross(&met);
                if walk.crossings > MAX_CROSSINGS {
                    chain.end = End::Exhausted;
                    break;
                }
                continue;
            }
            walk.in_contact(&mut met, counters);
            let transfer = Transfer {
                distance: walk.travelled,
                direction: walk.ray.direction,
                medium,
                n_g: met.surface.n_g,
                curvature: met.surface.curvature,
            };
            // Asked before the event, which may change it; only where it is written down.
            let travelled = if record.segments.is_some() { walk.media.current() } else { None };
            let (scattering, rough) = match walk.event(&met, media, &medium, momentum, counters) {
                Event::End => {
                    chain.columns.transfer(&transfer);
                    counters.column_updates += columns_carried;
                    record.step(&transfer, None);
                    record.segment(transfer.distance - walk.begin, travelled);
                    chain.end = End::Surface(met);
                    break;
                }
                Event::Straight { is_interface, rough } => {
                    if walk.crossings > MAX_CROSSINGS || is_interface && chain.interfaces == MAX_EVENTS {
                        chain.end = End::Exhausted;
                        break;
                    }
                    chain.interfaces += u32::from(is_interface);
                    chain.rough_interfaces += u32::from(rough);
                    if is_interface && chain.dielectric_id == 0 {
                        chain.dielectric_id = met.material_id;
                    }
                    continue;
                }
                Event::Scattered { scattering, rough } => (scattering, rough),
            };
            if chain.interfaces == MAX_EVENTS {
                chain.end = End::Exhausted;
                break;
            }
            chain.interfaces += 1;
            chain.rough_interfaces += u32::from(rough);
            counters.events += 1;
            counters.column_updates += 2 * columns_carried;
            counters.geometric_normal_events += u64::from(scattering.geometric_normal_used);
            chain.columns.transfer(&transfer);
            if C::SECOND
                && scattering.kind != ScatterKind::Mirror
                && let Some(col_lambda) = chain.columns.lambda()
            {
                chain.nearest_critical = chain.nearest_critical.min(critical_distance(&scattering, col_lambda));
            }
            chain.columns.scatter(&scattering);
            match scattering.kind {
                ScatterKind::Refraction => {
                    chain.is_dispersive |= !(scattering.ior_i.is_constant() && scattering.ior_t.is_constant());
                    // Not the surface's material: of coincident surfaces rounding decides which one is met.
                    if chain.dielectric_id == 0 {
                        chain.dielectric_id = walk.media.current().map_or(0, |id| id.0 + 1);
                    }
                    medium = scattering.ior_t;
                }
                ScatterKind::TotalReflection => chain.total_reflections += 1,
                ScatterKind::Mirror => {}
            }
            momentum = scattering.momentum_out;
            record.step(&transfer, Some(&scattering));
            record.segment(transfer.distance - walk.begin, travelled);
            walk.turn(&met, (momentum / medium.ior).normalize(), scattering.kind == ScatterKind::Refraction);
        }
        if walk.is_lost {
            chain.end = End::Exhausted;
        }
        if matches!(chain.end, End::Miss) {
            record.segment(f64::INFINITY, walk.media.current());
        }
        counters.exhausted += u64::from(matches!(chain.end, End::Exhausted));
        chain.direction = walk.ray.direction;
        chain.medium = medium;
        chain
    }
}

/// What a surface does to the chain.
#[allow(clippy::large_enum_variant, reason = "one at a time, on the stack; most events scatter")]
enum Event {
    End,
    Straight { is_interface: bool, rough: bool },
    Scattered { scattering: Scattering, rough: bool },
}

impl Walk<'_> {
    /// What happens at the surface; straight crossings are made at once.
    fn event(
        &mut self,
        met: &SurfacePoint,
        media: &Media,
        medium: &IorJet,
        momentum: DVec3,
        counters: &mut Counters,
    ) -> Event {
        let Some(material) = met.material_id.checked_sub(1).map(|i| &self.view.scene.materials[i as usize]) else {
            return Event::End;
        };
        match &material.kind {
            _ if met.presence == Presence::Opaque => Event::End,
            Kind::Opaque => Event::End,
            Kind::PassThrough => {
                self.cross(met);
                Event::Straight { is_interface: false, rough: false }
            }
            Kind::Mirror { .. } => {
                Event::Scattered { scattering: mirror(momentum, &met.surface, medium), rough: false }
            }
            &Kind::Dielectric { thin_walled: true, rough, .. } => {
                self.cross(met);
                Event::Straight { is_interface: true, rough }
            }
            &Kind::Dielectric { rough, .. } => {
                let far = self.far_side(met, counters);
                if far.medium == self.media.current() {
                    // The same medium on both sides: no optics, and the columns do not notice.
                    self.pass(met, far);
                    return Event::Straight { is_interface: false, rough: false };
                }
                let scattering = refract_or_reflect(momentum, &met.surface, medium, &media.of(far.medium));
                if scattering.kind == ScatterKind::Refraction {
                    self.pass(met, far);
                }
                Event::Scattered { scattering, rough }
            }
        }
    }
}
