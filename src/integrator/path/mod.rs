//! `path`: spectral path tracing.
//!
//! A hero wavelength, stratified over a pixel's samples, decides where a path goes; companions share it (A. Wilkie et al., "Hero
//! wavelength spectral sampling", EGSR 2014) until a smooth dispersive interface refracts it, where only the hero lives on.
//! Next-event estimation and the directions of the BSDFs are combined by the balance heuristic, over all wavelengths that could have
//! made the path. All other AOVs are those of `differentials`, in the same pass and with the same bits.

mod depth;
mod direct;
mod guide;
mod guided;
mod image;
mod ledger;
mod photons;
mod plate;
mod state;
mod tracer;

use std::ops::Range;

use glam::{DMat3, DVec3};

use super::chain::{Counters, Follower};
use super::differentials::{self, Differentials};
use super::lanes::Laws;
use super::light_path::Expression;
use super::{Integrator, PreparedIntegrator, Task, Worker};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::{AOVS, Aov, COLOR, COLOR_CLEAN, Family, SAMPLE_COUNT, SPECTRAL, VARIANCE};
use crate::film::pixel::PixelAccumulator;
use crate::light::Spectrum;
use crate::lighting::{LightId, Lighting};
use crate::spectrum::illuminant::Illuminant;
use crate::spectrum::visible::Visible;
use crate::spectrum::{LANES, Wavelength, sensor};
pub use depth::DepthLimits;
use guide::Guide;
use plate::Plate;
use tracer::{Setting, Tracer};

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
    /// Without any dispersion, if the clean beauty is asked for; it looks where a render without dispersion does.
    clean: Option<Laws<'a>>,
    clean_guide: Option<Guide>,
    plate: Option<Plate>,
    /// Where to look for light that is focused; `None` if none is.
    guide: Option<Guide>,
    /// What wavelengths are drawn from.
    visible: Visible,
    /// Of the layers that show parts of the light, in the order of `parts`.
    expressions: Vec<Expression>,
    /// Layers of the parts.
    parts: Vec<usize>,
    /// Layers of the clean beauty.
    clean_layers: Vec<usize>,
    /// Everything that is no light; `None` if nothing of it is asked for.
    others: Option<differentials::Prepared<'a>>,
}

impl<'a> Prepared<'a> {
    fn new(task: &'a Task<'a>) -> Result<Self> {
        let scene = task.view.scene;
        let lighting = Lighting::new(task.view)?;
        let (mut expressions, mut parts, mut clean_layers) = (Vec::new(), Vec::new(), Vec::new());
        for (layer, (aov, argument)) in task.aovs.iter().zip(task.arguments).enumerate() {
            match aov.name {
                COLOR_CLEAN => clean_layers.push(layer),
                COLOR | VARIANCE | SAMPLE_COUNT | SPECTRAL => {}
                _ if aov.family == Family::Transport => {
                    let expression = Expression::of_aov(aov.name, argument)
                        .map_err(|problem| Error::usage(format!("--aov {}:{argument}", aov.name), problem))?;
                    expressions.push(expression.with_groups(lighting.groups()));
                    parts.push(layer);
                }
                _ => {}
            }
        }
        let plate = task.plate.map(|path| Plate::open(path, task.resolution)).transpose()?;
        let has_others = task.aovs.iter().any(|aov| aov.family != Family::Transport);
        let mut prepared = Self {
            task,
            follower: Follower::of_camera(task.view, task.camera),
            visible: visible(&lighting),
            lighting,
            laws: Laws::new(scene, task.optics.dispersion_scale)?,
            clean: if clean_layers.is_empty() { None } else { Some(Laws::new(scene, 0.0)?) },
            plate,
            guide: None,
            clean_guide: None,
            expressions,
            parts,
            clean_layers,
            others: if has_others { Some(Differentials::prepared(task)?) } else { None },
        };
        let learn = |laws| photons::guide(prepared.setting(None), task, laws, &prepared.visible);
        let (guide, clean_guide) = (learn(&prepared.laws), prepared.clean.as_ref().and_then(learn));
        (prepared.guide, prepared.clean_guide) = (guide, clean_guide);
        Ok(prepared)
    }

    fn setting<'s>(&'s self, guide: Option<&'s Guide>) -> Setting<'s> {
        Setting {
            view: self.task.view,
            camera: self.task.camera,
            follower: &self.follower,
            lighting: &self.lighting,
            plate: self.plate.as_ref(),
            guide,
            limits: self.task.depth_limits,
        }
    }
}

/// Wavelengths for the eye and for lights with lines; each spectrum counts once.
fn visible(lighting: &Lighting<'_>) -> Visible {
    let mut spectra: Vec<&Spectrum> = Vec::new();
    let mut tables: Vec<Vec<(f64, f64)>> = Vec::new();
    for light in (0..).map_while(|index| lighting.light(LightId(index))) {
        let spectrum = &light.emission.spectrum;
        if *spectrum != Spectrum::Illuminant(Illuminant::D65) && !spectra.contains(&spectrum) {
            spectra.push(spectrum);
            let power = |nm: u32| light.emission.white(Wavelength::from_nanometers(f64::from(nm)));
            tables.push((360..=830).map(|nm| (f64::from(nm), power(nm))).collect());
        }
    }
    Visible::with_lights(tables.iter().map(Vec::as_slice))
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
    /// Of the clean beauty, in which nothing disperses.
    clean: Option<Tracer<'a, N, false>>,
    others: Option<Box<dyn differentials::SampleWorker + 'a>>,
    color_from_xyz: DMat3,
}

impl<'a, const N: usize, const DISPERSIVE: bool> PathWorker<'a, N, DISPERSIVE> {
    fn new(prepared: &'a Prepared<'a>) -> Self {
        Self {
            prepared,
            tracer: Tracer::new(prepared.setting(prepared.guide.as_ref()), &prepared.laws, &prepared.expressions),
            clean: prepared
                .clean
                .as_ref()
                .map(|laws| Tracer::new(prepared.setting(prepared.clean_guide.as_ref()), laws, &[])),
            others: prepared.others.as_ref().map(|others| others.sample_worker()),
            color_from_xyz: prepared.task.color_space.from_xyz(),
        }
    }
}

impl<const N: usize, const DISPERSIVE: bool> Worker for PathWorker<'_, N, DISPERSIVE> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        let task = self.prepared.task;
        for index in range {
            let numbers = task.sampler.path(pixel, index);
            let place = task.sampler.start(pixel, &numbers);
            if let Some(others) = &mut self.others {
                others.sample(&place, out);
            }
            let wavelengths = self.prepared.visible.sample::<N>(numbers.wavelength());
            let start = task.camera.ray(&place);
            let color = |radiance| -> [f64; 3] {
                let DVec3 { x, y, z } = self.color_from_xyz * sensor::xyz(radiance, &wavelengths);
                [x, y, z]
            };
            let alpha = self.tracer.trace(&start, wavelengths, &mut numbers.clone()).into();
            let [r, g, b] = color(self.tracer.ledger.total);
            // A sample that is scaled down takes its parts with it.
            let scale = out.add_color([r, g, b, alpha]);
            out.add_spectrum(self.tracer.ledger.total, &wavelengths, scale);
            for (&layer, light) in self.prepared.parts.iter().zip(self.tracer.ledger.parts()) {
                out.add(layer, Some(color(light).map(|channel| scale * channel)));
            }
            if let Some(clean) = &mut self.clean {
                let alpha = clean.trace(&start, wavelengths, &mut numbers.clone()).into();
                let [r, g, b] = color(clean.ledger.total);
                for &layer in &self.prepared.clean_layers {
                    out.add(layer, Some([r, g, b, alpha]));
                }
            }
        }
    }

    fn counters(&self) -> Counters {
        let mut counters = self.tracer.counters;
        if let Some(clean) = &self.clean {
            counters.add(&clean.counters);
        }
        if let Some(others) = &self.others {
            counters.add(&others.counters());
        }
        counters
    }
}
