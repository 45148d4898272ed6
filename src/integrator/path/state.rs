//! What a path has come to between its events.

use glam::{DVec3, Vec3};

use super::depth::Depth;
use super::guide::RegionId;
use super::image::{Image, Trail};
use crate::bsdf::Bsdf;
use crate::geometry::Ray;
use crate::integrator::frame::Frame;
use crate::integrator::walk::SurfacePoint;
use crate::lighting::Receiver;
use crate::optics::media::MediumId;
use crate::ray::UnitNormals;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// A surface as a path meets it.
pub(super) type Met = SurfacePoint<UnitNormals>;

/// What a path is followed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// All its light.
    Picture,
    /// What shines by way of smooth surfaces alone; it ends at the first other one.
    Focused,
    /// Where light arrives by way of smooth surfaces alone: it comes from a light.
    Photon,
}

/// Which way a path takes from one smooth event to the next: a bit for each, the first one highest, 1 if it passes; above them a 1. Only the
/// last 15 are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Way(u16);

impl Way {
    /// Before any event.
    pub(super) const START: Self = Self(1);

    fn events(self) -> u32 {
        self.0.checked_ilog2().unwrap_or(0)
    }

    /// After another event.
    pub(super) fn then(self, passes: bool) -> Self {
        Self(self.0 << 1 | u16::from(passes))
    }

    /// What happens after a number of events; `None` at the end.
    pub(super) fn at(self, event: u32) -> Option<bool> {
        let left = self.events().checked_sub(event + 1)?;
        Some(self.0 >> left & 1 == 1)
    }

    /// The other way round.
    pub(super) fn reversed(self) -> Self {
        (0..self.events()).rev().filter_map(|event| self.at(event)).fold(Self::START, Self::then)
    }

    /// As a number, for lanes of numbers.
    pub(super) fn number(self) -> f32 {
        f32::from(self.0)
    }
}

/// Light by way of smooth surfaces is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// Where the guide knows of some.
    pub(super) region: RegionId,
    /// So many times, as a mean.
    pub(super) count: f32,
}

/// The last vertex that chose a direction by a density.
pub(super) struct Vertex<const N: usize> {
    pub(super) receiver: Receiver,
    /// r before its event, over the density of the direction.
    pub(super) r_over_pdf: SampledSpectrum<N>,
    /// The part of its weight that is diffuse.
    pub(super) diffuse_share: SampledSpectrum<N>,
    /// How the guide could have found the direction.
    pub(super) look: Option<Look>,
    /// Away from it.
    pub(super) direction: DVec3,
}

/// Where a photon has arrived.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival<const N: usize> {
    pub(super) point: DVec3,
    /// The last event.
    pub(super) from: DVec3,
    /// What is left of its light.
    pub(super) carried: SampledSpectrum<N>,
    /// What it has seen of the light.
    pub(super) image: Option<Image>,
    /// The way back.
    pub(super) way: Way,
}

/// What a path has come to.
pub(super) struct State<const N: usize> {
    pub(super) purpose: Purpose,
    pub(super) wavelengths: Wavelengths<N>,
    pub(super) throughput: SampledSpectrum<N>,
    pub(super) r: SampledSpectrum<N>,
    pub(super) vertex: Option<Vertex<N>>,
    /// Smooth events since the vertex, or the start.
    pub(super) smooth_events: u32,
    /// What they were.
    pub(super) way: Way,
    /// Probability of the choices among them that a look makes by itself.
    pub(super) chosen: f32,
    /// The only way that a look takes.
    pub(super) wanted: Option<Way>,
    /// Whether it has gone on since through what blocks shadow rays.
    pub(super) is_cut_off: bool,
    /// The object of the last event: only lights that are linked to it count.
    pub(super) object: Option<u32>,
    pub(super) depth: Depth,
    /// Since the camera light was only let through.
    pub(super) sees_through: bool,
    pub(super) alpha: f32,
    /// Squared index of the medium over that of the first: what refraction has taken from β without taking light, and gives back.
    pub(super) squeezed: f32,
    /// Its worth after the first event that was not smooth: about what the pixel is worth.
    pub(super) first: Option<f32>,
    /// Where a photon has arrived.
    pub(super) arrival: Option<Arrival<N>>,
    /// How a photon's way changes with its beginning.
    pub(super) trail: Option<Box<Trail>>,
}

impl<const N: usize> State<N> {
    /// At the start of a path.
    pub(super) fn new(purpose: Purpose, wavelengths: Wavelengths<N>) -> Self {
        Self {
            purpose,
            wavelengths,
            throughput: SampledSpectrum::ONE,
            r: SampledSpectrum::ONE,
            vertex: None,
            smooth_events: 0,
            way: Way::START,
            chosen: 1.0,
            wanted: None,
            is_cut_off: false,
            object: None,
            depth: Depth::default(),
            sees_through: purpose == Purpose::Picture,
            alpha: 0.0,
            squeezed: 1.0,
            first: None,
            arrival: None,
            trail: None,
        }
    }

    /// Whether lights that its ray meets count.
    pub(super) fn meets_lights(&self) -> bool {
        match self.purpose {
            Purpose::Picture => true,
            Purpose::Focused => self.smooth_events > 0 && self.wanted.is_none_or(|way| way == self.way),
            Purpose::Photon => false,
        }
    }

    /// β / mean(r): what radiance from here counts.
    pub(super) fn carried<const DISPERSIVE: bool>(&self) -> SampledSpectrum<N> {
        if DISPERSIVE { self.throughput * (1.0 / self.r.mean()) } else { self.throughput }
    }

    /// What a unit of light from here counts on average over the lanes, for that is what the pixel gets.
    pub(super) fn worth<const DISPERSIVE: bool>(&self) -> f32 {
        self.carried::<DISPERSIVE>().mean() * self.squeezed
    }

    /// The path's light ends in what is no part of the picture: as much of the pixel stays open.
    pub(super) fn open<const DISPERSIVE: bool>(&mut self) {
        if self.alpha > 0.0 {
            self.alpha -= self.carried::<DISPERSIVE>().mean().clamp(0.0, 1.0);
        }
    }

    /// A photon that comes from `from` has arrived, if it came by way of a smooth surface.
    pub(super) fn arrive<const DISPERSIVE: bool>(&mut self, point: DVec3, from: &Ray, ior: f64) {
        let image = self.trail.as_ref().and_then(|trail| trail.image(from.direction, ior));
        let arrival = Arrival {
            point,
            from: from.origin,
            carried: self.carried::<DISPERSIVE>(),
            image,
            way: self.way.reversed(),
        };
        self.arrival = (self.smooth_events > 0).then_some(arrival);
    }

    /// A smooth event; only what the guide may have found still has another way to be found.
    pub(super) fn pass_smoothly(&mut self, passes: bool) {
        self.smooth_events += 1;
        self.way = self.way.then(passes);
        if self.vertex.as_ref().is_some_and(|vertex| vertex.look.is_none()) {
            self.vertex = None;
        }
    }

    /// No companion goes where the hero goes.
    pub(super) fn leave_companions(&mut self) {
        for lane in 1..N {
            (self.throughput[lane], self.r[lane]) = (0.0, 0.0);
            if let Some(vertex) = &mut self.vertex {
                vertex.r_over_pdf[lane] = 0.0;
            }
        }
    }
}

/// A surface that scatters, where the path has met it.
pub(super) struct Scatterer<'s, const N: usize> {
    pub(super) met: &'s Met,
    /// Geometric normal on the side of the path.
    pub(super) n_g: DVec3,
    pub(super) frame: Frame,
    pub(super) wo: Vec3,
    pub(super) bsdf: &'s Bsdf<N>,
    pub(super) receiver: Receiver,
    /// The medium behind, where the surface bounds one.
    pub(super) far: Option<Option<MediumId>>,
    /// Whether focused light is looked for.
    pub(super) look: Option<Look>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_back_has_the_same_events_in_the_other_order() {
        let events = [true, false, false, true, true, false];
        let way = events.into_iter().fold(Way::START, Way::then);
        let back = way.reversed();
        assert_eq!(back.reversed(), way);
        for (index, event) in (0..).zip(events) {
            assert_eq!((way.at(index), back.at(5 - index)), (Some(event), Some(event)));
        }
        assert_eq!((way.at(6), Way::START.at(0), Way::START.reversed()), (None, None, Way::START));
        // What is too long is forgotten at its beginning, without a panic.
        (0..40).fold(way, |way, _| way.then(false)).reversed();
    }
}
