//! A ray on its way from surface to surface, with the media around it and the surfaces that it stands on.
//!
//! What every integrator's rays have in common: what the camera does not see, glass that touches what is behind it, cemented
//! faces, priorities. Which way a ray goes on is its caller's business.

use glam::DVec3;

use super::chain::{Counters, Follower};
use crate::camera::Sight;
use crate::geometry::{Aggregate, Departures, Hit, Ray};
use crate::optics::media::{Inside, MediaStack, MediumId};
use crate::ray::{LocalSurface, RayStart, UnitNormals};
use crate::scene::view::{Presence, View};

/// Straight crossings (cut-outs, surfaces inside a medium of higher priority) that one chain may make.
pub(super) const MAX_CROSSINGS: u32 = 4096;

/// Coincident surfaces that are taken together; more are met one by one.
const MAX_COINCIDENT: u32 = 8;

/// How much a ray has to know of the surfaces that it meets.
pub(super) trait Extent: Copy {
    /// The point of a hit, and the surface around it.
    fn around(aggregate: &Aggregate, ray: &Ray, hit: &Hit) -> (DVec3, Self);
}

impl Extent for LocalSurface {
    #[inline]
    fn around(aggregate: &Aggregate, ray: &Ray, hit: &Hit) -> (DVec3, Self) {
        aggregate.local_surface(ray, hit)
    }
}

impl Extent for UnitNormals {
    #[inline]
    fn around(aggregate: &Aggregate, ray: &Ray, hit: &Hit) -> (DVec3, Self) {
        aggregate.normals(ray, hit)
    }
}

/// A point on a surface, as a ray met it.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint<S = LocalSurface> {
    /// Which surface, and where on it.
    pub hit: Hit,
    /// Render space.
    pub point: DVec3,
    /// The surface about the point.
    pub surface: S,
    /// 1-based, 0 for none.
    pub material_id: u32,
    /// What it is there.
    pub presence: Presence,
}

/// A ray on its way, with the media around it.
#[derive(Clone)]
pub(super) struct Walk<'a> {
    pub(super) view: &'a View<'a>,
    pub(super) ray: Ray,
    pub(super) media: MediaStack,
    pub(super) departures: Departures,
    /// From the last event to the last surface met.
    pub(super) travelled: f64,
    pub(super) crossings: u32,
    /// Where the camera sees surfaces; `None` once the ray was refracted or reflected, or where it sees all.
    sight: Option<Sight>,
    /// How far from its start the ray begins: behind the last surface that the camera does not see.
    pub(super) begin: f64,
    /// Whether `begin` has moved, and the media with it.
    pub(super) begins_anew: bool,
    /// Whether there were too many surfaces that the camera does not see.
    pub(super) is_lost: bool,
}

impl<'a> Walk<'a> {
    pub(super) fn new(follower: &Follower<'a>, start: &RayStart) -> Self {
        Self {
            view: follower.view,
            ray: Ray { origin: start.point, direction: start.direction, time: start.time },
            media: follower.media_around(start),
            departures: Departures::none(),
            travelled: 0.0,
            crossings: 0,
            sight: follower.sight(start),
            begin: 0.0,
            begins_anew: false,
            is_lost: false,
        }
    }

    /// On `ray`, which no camera sent.
    pub(super) fn anywhere(view: &'a View<'a>, ray: Ray) -> Self {
        Self {
            view,
            ray,
            media: view.media_at(ray.origin, ray.time),
            departures: Departures::none(),
            travelled: 0.0,
            crossings: 0,
            sight: None,
            begin: 0.0,
            begins_anew: false,
            is_lost: false,
        }
    }

    /// The next surface that is seen.
    pub(super) fn advance<S: Extent>(&mut self, counters: &mut Counters) -> Option<SurfacePoint<S>> {
        loop {
            counters.rays += 1;
            let hit = self.view.intersect(&self.ray, &self.departures)?;
            let (point, surface) = S::around(&self.view.aggregate, &self.ray, &hit);
            self.travelled += hit.distance;
            let material_id = self.view.material_id(&hit);
            let is_seen = match self.sight {
                Some(sight) if self.travelled > sight.far => {
                    counters.unseen += 1;
                    return None;
                }
                Some(sight) => self.travelled >= sight.near && !self.view.is_hidden_from_camera(&hit),
                None => true,
            };
            if is_seen {
                let presence = self.view.presence(&hit, material_id);
                return Some(SurfacePoint { hit, point, surface, material_id, presence });
            }
            self.overlook(&SurfacePoint { hit, point, surface, material_id, presence: Presence::AsStated }, counters);
            if self.crossings > MAX_CROSSINGS {
                self.is_lost = true;
                return None;
            }
        }
    }

    /// Goes straight on through a surface that the camera does not see, into the media behind it.
    fn overlook<S>(&mut self, met: &SurfacePoint<S>, counters: &mut Counters) {
        counters.unseen += 1;
        match self.view.inside(&met.hit, met.material_id) {
            Some(inside) if met.hit.leaving => counters.unmatched_exits += u64::from(!self.media.leave(&inside)),
            Some(inside) => self.media.enter(inside),
            None => {}
        }
        self.cross(met);
        (self.begin, self.begins_anew) = (self.travelled, true);
    }

    /// Puts what is seen from inside of a glass in the place of `met`, its surface: an opaque surface or a mirror that coincides with
    /// it, if there is one. Without this, rounding would decide for each ray whether glass that stands on a table touches it.
    #[inline]
    pub(super) fn in_contact<S: Extent>(&self, met: &mut SurfacePoint<S>, counters: &mut Counters) {
        let bounds_glass = |hit: &Hit, id: u32| self.view.inside(hit, id).is_some();
        if met.hit.leaving && self.view.is_in_contact(&met.hit) && bounds_glass(&met.hit, met.material_id) {
            self.look_for_backing(met, counters);
        }
    }

    fn look_for_backing<S: Extent>(&self, met: &mut SurfacePoint<S>, counters: &mut Counters) {
        let ahead = Ray { origin: met.point, ..self.ray };
        let mut departures = self.departures;
        departures.depart(&self.ray, &met.hit, true);
        for _ in 0..MAX_COINCIDENT {
            counters.rays += 1;
            let Some(hit) = self.view.coincident_backing(&ahead, &departures) else { break };
            let material_id = self.view.material_id(&hit);
            let presence = self.view.presence(&hit, material_id);
            if self.view.is_backing(material_id) && presence != Presence::Absent {
                let (point, surface) = S::around(&self.view.aggregate, &ahead, &hit);
                // Met where the glass was, by the ray that met the glass.
                let hit = Hit { distance: met.hit.distance, at_start: met.hit.at_start, ..hit };
                *met = SurfacePoint { hit, point, surface, material_id, presence };
                return;
            }
            departures.depart(&ahead, &hit, hit.leaving);
        }
    }

    /// Goes straight on through the surface.
    pub(super) fn cross<S>(&mut self, met: &SurfacePoint<S>) {
        self.crossings += 1;
        self.departures.depart(&self.ray, &met.hit, met.hit.leaving);
        self.ray.origin = met.point;
    }

    /// Goes on from the surface in a new direction, a unit vector. Whatever goes to the far side has [passed](Self::pass)
    /// already.
    pub(super) fn turn<S>(&mut self, met: &SurfacePoint<S>, direction: DVec3, has_passed: bool) {
        if !has_passed {
            self.departures.depart(&self.ray, &met.hit, !met.hit.leaving);
        }
        self.ray = Ray { origin: met.point, direction, ..self.ray };
        (self.travelled, self.begin, self.sight) = (0.0, 0.0, None);
    }

    /// What lies behind the surface, together with all glass that coincides with it: two cemented faces are one interface
    /// between their media, in whatever order rounding presents them.
    #[inline]
    pub(super) fn far_side<S>(&self, met: &SurfacePoint<S>, counters: &mut Counters) -> FarSide {
        let inside = self.view.inside(&met.hit, met.material_id);
        if self.view.is_touching(&met.hit) {
            return self.behind_all(met, inside, counters);
        }
        // Nothing coincides: the stack is asked, not copied.
        let medium = match inside {
            Some(inside) if met.hit.leaving => self.media.preview_leave(&inside).unwrap_or_else(|_| {
                counters.unmatched_exits += 1;
                self.media.current()
            }),
            Some(inside) => self.media.preview_enter(&inside),
            None => self.media.current(),
        };
        FarSide { medium, inside, cluster: None }
    }

    /// What lies behind a surface and all that may coincide with it.
    fn behind_all<S>(&self, met: &SurfacePoint<S>, inside: Option<Inside>, counters: &mut Counters) -> FarSide {
        let mut cluster = Box::new(Cluster { media: self.media.clone(), departures: self.departures });
        let mut is_alone = true;
        self.include(&mut cluster, &met.hit, inside, counters);
        let ahead = Ray { origin: met.point, ..self.ray };
        for _ in 0..MAX_COINCIDENT {
            counters.rays += 1;
            let Some(hit) = self.view.intersect(&ahead, &cluster.departures).filter(|hit| hit.at_start) else { break };
            let inside = self.view.inside(&hit, self.view.material_id(&hit));
            if inside.is_none() {
                break;
            }
            is_alone = false;
            self.include(&mut cluster, &hit, inside, counters);
        }
        if let Some(inside) = inside
            && met.hit.leaving
            && is_alone
        {
            counters.undecided_overlaps += u64::from(self.media.is_undecided(&inside));
        }
        FarSide { medium: cluster.media.current(), inside, cluster: Some(cluster) }
    }

    fn include(&self, cluster: &mut Cluster, hit: &Hit, inside: Option<Inside>, counters: &mut Counters) {
        cluster.departures.depart(&self.ray, hit, hit.leaving);
        match inside {
            Some(inside) if hit.leaving => counters.unmatched_exits += u64::from(!cluster.media.leave(&inside)),
            Some(inside) => cluster.media.enter(inside),
            None => {}
        }
    }

    /// Goes to the far side, or straight on where nothing is bounded.
    #[inline]
    pub(super) fn go_behind<S>(&mut self, met: &SurfacePoint<S>, far: Option<FarSide>) {
        match far {
            Some(far) => self.pass(met, far),
            None => self.cross(met),
        }
    }

    /// Goes to the far side; the direction is the caller's.
    pub(super) fn pass<S>(&mut self, met: &SurfacePoint<S>, far: FarSide) {
        self.crossings += 1;
        self.ray.origin = met.point;
        match (far.cluster, far.inside) {
            (Some(cluster), _) => (self.media, self.departures) = (cluster.media, cluster.departures),
            (None, inside) => {
                self.departures.depart(&self.ray, &met.hit, met.hit.leaving);
                match inside {
                    // What was never entered is not left; the look has counted it.
                    Some(inside) if met.hit.leaving => drop(self.media.leave(&inside)),
                    Some(inside) => self.media.enter(inside),
                    None => {}
                }
            }
        }
    }
}

/// The far side of an interface.
pub(super) struct FarSide {
    pub(super) medium: Option<MediumId>,
    /// What the surface that was met bounds.
    inside: Option<Inside>,
    /// Where several surfaces coincide: the state behind all of them.
    cluster: Option<Box<Cluster>>,
}

/// The state of a walk behind coincident surfaces.
struct Cluster {
    media: MediaStack,
    departures: Departures,
}
