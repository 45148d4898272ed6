//! `path`: spectral path tracing.
//!
//! A hero wavelength, stratified over a pixel's samples, decides where a path goes; companions share it (A. Wilkie et al., "Hero
//! wavelength spectral sampling", EGSR 2014) until a smooth dispersive interface refracts it, where only the hero lives on.
//! Next-event estimation and the directions of the BSDFs are combined by the balance heuristic, over all wavelengths that could have
//! made the path. All other AOVs are those of `differentials`, in the same pass and with the same bits.

use std::ops::Range;

mod tracer;

use super::chain::{Counters, Follower};
use super::differentials::{self, Differentials};
use super::lanes::Laws;
use super::{Integrator, PreparedIntegrator, Task, Worker};
use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::film::aov::{AOVS, Aov, Family};
use crate::film::pixel::PixelAccumulator;
use crate::lighting::Lighting;
use crate::spectrum::sensor;
use crate::spectrum::{LANES, visible};
use glam::{DMat3, DVec3};
use tracer::Tracer;

/// The integrator; it has no settings of its own.
#[derive(Clone, Copy, Debug)]
pub struct Path;

impl Integrator for Path {
    fn name(&self) -> &str {
        "path"
    }

    fn summary(&self) -> &str {
        "spectral path tracing with next-event estimation; all other AOVs in the same pass"
    }

    fn aovs(&self) -> Vec<&'static Aov> {
        AOVS.iter().collect()
    }

    fn transports_light(&self) -> bool {
        true
    }

    fn prepare<'a>(&self, task: &'a Task<'a>) -> Result<Box<dyn PreparedIntegrator + 'a>> {
        Ok(Box::new(Prepared::new(task)?))
    }
}

struct Prepared<'a> {
    task: &'a Task<'a>,
    follower: Follower<'a>,
    lighting: Lighting<'a>,
    laws: Laws<'a>,
    /// Everything that is no light; `None` if nothing of it is asked for.
    others: Option<differentials::Prepared<'a>>,
}

impl<'a> Prepared<'a> {
    fn new(task: &'a Task<'a>) -> Result<Self> {
        let has_others = task.aovs.iter().any(|aov| aov.family != Family::Transport);
        Ok(Self {
            task,
            follower: Follower::of_camera(task.view, task.camera),
            lighting: Lighting::new(task.view)?,
            laws: Laws::new(task.view.scene, task.optics.dispersion_scale)?,
            others: if has_others { Some(Differentials::prepared(task)?) } else { None },
        })
    }
}

impl PreparedIntegrator for Prepared<'_> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        if self.laws.is_dispersive() {
            Box::new(PathWorker::<LANES, true>::new(self))
        } else {
            Box::new(PathWorker::<LANES, false>::new(self))
        }
    }

    fn diagnostics(&self) -> Diagnostics {
        self.lighting.diagnostics().clone()
    }
}

/// A worker of `N` wavelengths a path; without `DISPERSIVE` no index differs between them.
struct PathWorker<'a, const N: usize, const DISPERSIVE: bool> {
    prepared: &'a Prepared<'a>,
    tracer: Tracer<'a, N, DISPERSIVE>,
    others: Option<Box<dyn differentials::SampleWorker + 'a>>,
    color_from_xyz: DMat3,
}

impl<'a, const N: usize, const DISPERSIVE: bool> PathWorker<'a, N, DISPERSIVE> {
    fn new(prepared: &'a Prepared<'a>) -> Self {
        Self {
            prepared,
            tracer: Tracer::new(prepared.task.view, &prepared.follower, &prepared.lighting, &prepared.laws),
            others: prepared.others.as_ref().map(|others| others.sample_worker()),
            color_from_xyz: prepared.task.color_space.from_xyz(),
        }
    }
}

impl<const N: usize, const DISPERSIVE: bool> Worker for PathWorker<'_, N, DISPERSIVE> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        let task = self.prepared.task;
        for index in range {
            let place = task.sampler.sample(pixel, index);
            if let Some(others) = &mut self.others {
                others.sample(&place, out);
            }
            let mut numbers = task.sampler.path(pixel, index);
            let wavelengths = visible::sample::<N>(numbers.wavelength());
            let seen = self.tracer.trace(&task.camera.ray(&place), wavelengths, &mut numbers);
            let DVec3 { x, y, z } = self.color_from_xyz * sensor::xyz(seen.radiance, &wavelengths);
            out.add_color([x, y, z, f64::from(seen.alpha)]);
        }
    }

    fn counters(&self) -> Counters {
        let mut counters = self.tracer.counters;
        if let Some(others) = &self.others {
            counters.add(&others.counters());
        }
        counters
    }
}
