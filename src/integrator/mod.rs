//! What is computed for a pixel; the plug-in point.
//!
//! An integrator is chosen by name once per render, says what it offers and needs, and is one file. It is given a
//! [`Task`] and makes [`Worker`]s, one per thread, that render pixels. Third parties implement [`Integrator`] in a crate of
//! their own and [`register`](Registry::register) it; `examples/custom_integrator.rs` does.

pub mod chain;
mod counters;
pub mod differentials;
mod frame;
mod lanes;
pub mod light_path;
pub mod path;
pub mod reference;
mod screen_motion;
mod search;
mod surface;
pub mod transmittance;
mod walk;

use std::ops::Range;
use std::sync::Arc;

use serde::Serialize;

use crate::camera::Camera;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::SampleRange;
use crate::film::aov::{Aov, Family, INTERNAL_TRANSMITTANCE, is_albedo};
use crate::film::pixel::PixelAccumulator;
use crate::sampler::Sampler;
use crate::scene::view::View;
use crate::spectrum::Wavelength;
use crate::spectrum::sensor::ColorSpace;
use chain::Counters;

/// Which columns a ray carries, from the least to the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Columns {
    /// None.
    None,
    /// ∂λ.
    Lambda,
    /// ∂x, ∂y, ∂λ.
    Screen,
    /// ∂x, ∂y, ∂λ and ∂²λ.
    SecondOrder,
}

/// What has to be computed for the layers asked for: everything else is skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Needs {
    /// Whether chains are followed beyond the first surface.
    pub chain: bool,
    /// Columns carried along the chain.
    pub columns: Columns,
    /// Whether a second chain follows the first-order motion.
    pub second_chain: bool,
    /// Whether chains are traced again at the wavelengths of the R, G, B responses.
    pub retrace: bool,
    /// Whether the absorption of the media along a chain is summed.
    pub transmittance: bool,
    /// Whether the colours of surfaces are looked up.
    pub albedo: bool,
    /// Whether light is followed: lights are compiled, and all that surfaces scatter with is looked up.
    pub transport: bool,
}

impl Needs {
    /// For `aovs` of a scene in which something disperses, or nothing does.
    pub fn of(aovs: &[&Aov], is_dispersive: bool) -> Self {
        let has = |family| aovs.iter().any(|aov| aov.family == family);
        let columns = if !is_dispersive {
            Columns::None
        } else if has(Family::LambdaSecondOrder) {
            Columns::SecondOrder
        } else if has(Family::ScreenColumns) || has(Family::ScreenSecondOrder) || has(Family::Retrace) {
            Columns::Screen
        } else if has(Family::LambdaColumn) {
            Columns::Lambda
        } else {
            Columns::None
        };
        Self {
            chain: aovs.iter().any(|aov| !matches!(aov.family, Family::FirstSurface | Family::Transport)),
            columns,
            second_chain: is_dispersive && has(Family::ScreenSecondOrder),
            retrace: is_dispersive && has(Family::Retrace),
            albedo: aovs.iter().any(|aov| is_albedo(aov)),
            transmittance: aovs.iter().any(|aov| aov.name == INTERNAL_TRANSMITTANCE),
            transport: has(Family::Transport),
        }
    }
}

/// The wavelengths of a render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Optics {
    /// Where chains are followed and derivatives taken.
    pub reference: Wavelength,
    /// The band of footprints and half-widths.
    pub band: [Wavelength; 2],
    /// Wavelengths of the R, G, B responses.
    pub channels: [Wavelength; 3],
    /// Multiplies the dispersion of every medium: 0 none, 1 physical.
    pub dispersion_scale: f64,
}

impl Optics {
    /// Width of the band, nm.
    pub fn band_width(&self) -> f64 {
        self.band[1].nanometers() - self.band[0].nanometers()
    }
}

/// What an integrator is asked to compute.
#[derive(Debug)]
pub struct Task<'a> {
    /// The scene about the camera.
    pub view: &'a View<'a>,
    /// Where rays begin.
    pub camera: &'a Camera,
    /// One AOV per layer, in the film's order.
    pub aovs: &'a [&'static Aov],
    /// What each AOV is told with its name, as [`argument`](crate::film::aov::argument) says; empty for most.
    pub arguments: &'a [String],
    /// What the layers need.
    pub needs: Needs,
    /// Wavelengths.
    pub optics: Optics,
    /// Where in the pixel.
    pub sampler: Sampler,
    /// Which samples: workers are asked for parts of them.
    pub samples: SampleRange,
    /// What the numbers of colours mean.
    pub color_space: ColorSpace,
    /// How often light may be scattered.
    pub depth_limits: path::DepthLimits,
    /// Image file that is seen through glass, behind everything.
    pub plate: Option<&'a str>,
    /// Full raster, pixels.
    pub resolution: [u32; 2],
    /// Whether something moves and vectors of motion are wanted; they are 0 if not.
    pub motion_vectors: bool,
}

/// A way to compute pixels, chosen by name.
pub trait Integrator: Send + Sync {
    /// The name it is chosen by.
    fn name(&self) -> &str;
    /// One line for people.
    fn summary(&self) -> &str;
    /// The AOVs it offers.
    fn aovs(&self) -> Vec<&'static Aov>;
    /// Whether it computes light: its samples are then many unless told otherwise, and spread by the pixel filter.
    fn transports_light(&self) -> bool {
        false
    }
    /// What it needs for `aovs`, in a scene where something disperses or nothing does.
    fn needs(&self, aovs: &[&Aov], is_dispersive: bool) -> Needs {
        Needs::of(aovs, is_dispersive)
    }
    /// Makes ready for one image.
    fn prepare<'a>(&self, task: &'a Task<'a>) -> Result<Box<dyn PreparedIntegrator + 'a>>;
}

/// An integrator made ready for one image; shared between threads.
pub trait PreparedIntegrator: Send + Sync {
    /// A worker for one thread.
    fn worker(&self) -> Box<dyn Worker + '_>;

    /// What was odd about what it has read while it was made ready.
    fn diagnostics(&self) -> Diagnostics {
        Diagnostics::default()
    }
}

/// Renders pixels on one thread. What it writes depends on the pixel and its sample indices alone.
pub trait Worker {
    /// Adds the samples `range` of `pixel` (x right, y down) to every layer, in order.
    ///
    /// Called with consecutive ranges, which depend on what was asked for; their bounds must not change a bit.
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator);
    /// What it has done so far.
    fn counters(&self) -> Counters;
}

/// The integrators that can be chosen.
#[derive(Clone)]
pub struct Registry {
    integrators: Vec<Arc<dyn Integrator>>,
}

impl Default for Registry {
    /// The integrators of this crate.
    fn default() -> Self {
        Self {
            integrators: vec![
                Arc::new(differentials::Differentials),
                Arc::new(path::Path),
                Arc::new(reference::Reference),
            ],
        }
    }
}

impl Registry {
    /// Adds an integrator; one of the same name is replaced.
    pub fn register(&mut self, integrator: Arc<dyn Integrator>) {
        self.integrators.retain(|known| known.name() != integrator.name());
        self.integrators.push(integrator);
    }

    /// The integrator called `name`.
    pub fn find(&self, name: &str) -> Result<&dyn Integrator> {
        self.integrators.iter().map(AsRef::as_ref).find(|known| known.name() == name).ok_or_else(|| {
            let known: Vec<_> = self.integrators.iter().map(|i| i.name()).collect();
            Error::usage(
                format!("integrator '{name}'"),
                format!("there is none of this name in this version: choose {}", known.join(", ")),
            )
        })
    }

    /// All integrators.
    pub fn iter(&self) -> impl Iterator<Item = &dyn Integrator> {
        self.integrators.iter().map(AsRef::as_ref)
    }
}

impl std::fmt::Debug for Registry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.integrators.iter().map(|i| i.name())).finish()
    }
}
