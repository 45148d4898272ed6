//! Settings, plan, tiles, progress, statistics: a render from request to film.
//!
//! Tiles are rendered by any thread in any order; what a pixel gets depends on the pixel alone, so the film has the same
//! bits for any number of threads and passes. Cancelling leaves the finished tiles.

mod driver;
mod layers;
pub mod metadata;
mod motion;
mod passes;
pub mod plan;
pub mod request;
mod sampling;
mod settings;
mod shot;
mod textures;
pub mod trace;
mod validity;

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Serialize;

pub use layers::PlannedLayer;
use metadata::Outcome;
use passes::{Passed, Passes, Tally};
pub use plan::{Plan, plan};
pub use request::Request;
pub use trace::trace;

use crate::camera::{Camera, Lens};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::Aov;
use crate::film::metadata::Metadata;
use crate::film::{Film, Layer};
use crate::integrator::chain::Counters;
use crate::integrator::{Registry, Task};
use crate::sampler::Sampler;
use crate::scene::view::View;
use crate::scene::{Counts, Scene};
use crate::texture::TextureCounts;

/// More values than this (4 TiB of floats) are refused before memory is asked for.
const MAX_VALUES: usize = 1 << 40;

/// How far a render is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Finished pixels.
    pub done: u64,
    /// All pixels.
    pub total: u64,
}

/// What a caller can do while a render runs.
pub struct Control<'a> {
    /// Set it to stop at once; finished tiles are kept.
    pub cancel: &'a AtomicBool,
    /// Called after every tile, from any thread.
    pub progress: &'a (dyn Fn(Progress) + Sync),
    /// Called on the rendering thread with the film of the first 1, 2, 4, 8 … samples of each pixel, and of all of them, and its
    /// header; `false` ends the render there. Without it (and without a time limit) all samples are rendered in one go.
    pub pass: Option<&'a (dyn Fn(Film, Metadata) -> bool + Sync)>,
}

impl Control<'static> {
    /// Nobody watches and nobody stops.
    pub fn none() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { cancel: &NEVER, progress: &|_| {}, pass: None }
    }
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control").field("cancel", &self.cancel).finish_non_exhaustive()
    }
}

/// What a render did and found.
#[derive(Clone, Debug, Serialize)]
pub struct Statistics {
    /// Whether every pixel of the window was rendered.
    pub complete: bool,
    /// Finished pixels.
    pub pixels: u64,
    /// The plan.
    pub plan: Plan,
    /// Sizes of the scene.
    pub scene: Counts,
    /// Images of the scene: named, read, kept.
    pub textures: TextureCounts,
    /// What tracing cost.
    pub counters: Counters,
    /// Samples of all pixels.
    pub samples: u64,
    /// Passes rendered: 1 unless the render grew.
    pub passes: u32,
    /// Whether the time limit left samples out.
    pub reached_time_limit: bool,
    /// Samples that were scaled down to the clamp.
    pub clamped_samples: u64,
    /// Values that were not finite and became absent.
    pub non_finite_values: u64,
    /// Warnings of the bridge, the scene, the plan and the render.
    pub warnings: Diagnostics,
    /// Time of building the trees over triangles when the scene was made, seconds, summed over shapes.
    pub tree_seconds: f64,
    /// Wall time of building the tree about the camera, seconds.
    pub prepare_seconds: f64,
    /// Wall time of tracing, seconds.
    pub trace_seconds: f64,
    /// Threads used.
    pub threads: usize,
}

/// A finished render.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The image.
    pub film: Film,
    /// Its header.
    pub metadata: Metadata,
    /// What happened.
    pub statistics: Statistics,
}

/// Renders `plan`.
///
/// A cancelled render is no error: its film holds the finished tiles and its statistics say that it is not complete.
pub fn render(scene: &Scene, plan: &Plan, registry: &Registry, control: &Control<'_>) -> Result<Rendered> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|e| Error::usage("--threads", format!("{} threads cannot be started: {e}", plan.threads)))?;
    pool.install(|| render_here(scene, plan, registry, control))
}

/// The camera of `plan`, fitted to its image.
pub(crate) fn camera(scene: &Scene, plan: &Plan) -> Result<Camera> {
    let authored = &scene.document().cameras[plan.camera];
    let camera = Camera::new(authored, plan.resolution, plan.pixel_aspect_ratio, plan.conform_policy)?;
    let camera = match Lens::of(authored) {
        Some(lens) if plan.depth_of_field => camera.with_lens(lens),
        _ => camera,
    };
    match plan.shutter {
        Some(shutter) => camera.with_shutter(authored, shutter),
        None if plan.motion_vectors => camera.moving(authored),
        None => Ok(camera),
    }
}

/// The scene as the camera of `plan` sees it.
pub(crate) fn view<'a>(scene: &'a Scene, plan: &Plan, camera: &Camera) -> View<'a> {
    if plan.traces_motion { View::moving(scene, camera.position) } else { View::new(scene, camera.position) }
}

fn render_here(scene: &Scene, plan: &Plan, registry: &Registry, control: &Control<'_>) -> Result<Rendered> {
    let begin = Instant::now();
    let integrator = registry.find(&plan.integrator)?;
    let camera = camera(scene, plan)?;
    let view = view(scene, plan, &camera);
    textures::prepare(scene, &plan.needs, plan.texture_memory)?;
    let aovs: Vec<&'static Aov> = plan.layers.iter().map(|layer| layer.aov).collect();
    let arguments: Vec<String> = plan.layers.iter().map(|layer| layer.argument.clone()).collect();
    let task = Task {
        view: &view,
        camera: &camera,
        aovs: &aovs,
        arguments: &arguments,
        needs: plan.needs,
        optics: plan.optics,
        sampler: Sampler::new(plan.samples.total, plan.seed)?.over_time(plan.shutter.is_some()).filtered(&plan.filter),
        samples: plan.samples,
        color_space: plan.color_space,
        depth_limits: plan.depth_limits,
        plate: plan.plate.as_deref(),
        resolution: plan.resolution,
        motion_vectors: plan.motion_vectors,
    };
    let prepared = integrator.prepare(&task)?;
    let mut film = empty_film(plan, &camera)?;
    let prepare_seconds = begin.elapsed().as_secs_f64();

    let begin = Instant::now();
    let describe = |film: &Film, tally: &Tally, complete: bool, reached_limit: bool| {
        let total = film.samples.total;
        metadata::metadata(scene, plan, &camera, &Outcome { complete, total, reached_limit, clamped: tally.clamped })
    };
    let passes = Passes { scene, plan, prepared: &*prepared, control, began: begin, describe: &describe };
    let Passed { tally, pixels, complete, passes, reached_limit } = passes.run(&mut film);
    let Tally { counters, non_finite, clamped, samples } = tally;
    let trace_seconds = begin.elapsed().as_secs_f64();

    let mut warnings = scene.diagnostics().clone();
    warnings.extend(&plan.diagnostics);
    warnings.extend(&prepared.diagnostics());
    textures::report_unreadable(scene, &mut warnings)?;
    if counters.unmatched_exits > 0 {
        warnings.warn(
            "unmatched-exits",
            &scene.document().stage.source,
            format!(
                "{} rays left a glass that they had not entered: an open mesh, or normals that point inward",
                counters.unmatched_exits
            ),
        );
    }
    if counters.undecided_overlaps > 0 {
        warnings.warn(
            "undecided-overlap",
            &scene.document().stage.source,
            format!(
                "{} times a ray left one glass inside of another of the same priority: the objects overlap, and which \
                 medium fills the overlap depends on where the ray comes from: author abbe:dielectricPriority (lower wins)",
                counters.undecided_overlaps
            ),
        );
    }
    let authored = &scene.document().cameras[plan.camera];
    if counters.unseen > 0
        && let Some([near, far]) = authored.clipping_range
        && !authored.clipping_authored
        && authored.clipping_planes.is_empty()
        && !scene.objects.hides_some()
    {
        warnings.warn(
            "clipped-by-fallback",
            format!("{}.clippingRange", authored.path),
            format!(
                "is not authored, and its fallback ({near}, {far}) hides surfaces from {} rays: author the range that is wanted",
                counters.unseen
            ),
        );
    }
    if non_finite > 0 {
        warnings.warn(
            "non-finite",
            &scene.document().stage.source,
            format!(
                "{non_finite} values were not finite and are absent (light: 0): `abbe trace` shows a pixel's chain"
            ),
        );
    }
    if clamped > 0 {
        warnings.warn(
            "clamped-samples",
            &scene.document().stage.source,
            format!("{clamped} of {samples} samples were brighter than --clamp and were scaled down: light is missing"),
        );
    }
    let metadata = describe(&film, &tally, complete, reached_limit);
    let statistics = Statistics {
        complete,
        pixels,
        plan: plan.clone(),
        scene: scene.counts,
        textures: scene.textures.counts(),
        counters,
        samples,
        passes,
        reached_time_limit: reached_limit,
        clamped_samples: clamped,
        non_finite_values: non_finite,
        warnings,
        prepare_seconds,
        trace_seconds,
        tree_seconds: scene.tree_seconds,
        threads: rayon::current_num_threads(),
    };
    Ok(Rendered { film, metadata, statistics })
}

/// A film of absent values, or an error if there is no memory for it.
fn empty_film(plan: &Plan, camera: &Camera) -> Result<Film> {
    let pixels = plan.window.area();
    let channels: usize = plan.layers.iter().map(|layer| layer.aov.channels.len() + 1).sum();
    if pixels.checked_mul(channels).is_none_or(|n| n > MAX_VALUES) {
        return Err(Error::usage(
            "--width",
            format!("{pixels} pixels of {channels} channels are too many: render crops"),
        ));
    }
    let mut probe: Vec<f32> = Vec::new();
    probe.try_reserve_exact(pixels * channels).map_err(|_| {
        Error::usage("--width", format!("no memory for {pixels} pixels of {channels} channels: render crops"))
    })?;
    drop(probe);
    let keep_sums = !plan.samples.is_all();
    Ok(Film {
        resolution: plan.resolution,
        window: plan.window,
        pixel_aspect_ratio: camera.pixel_aspect_ratio as f32,
        samples: plan.samples,
        layers: plan
            .layers
            .iter()
            .map(|layer| Layer {
                half: layer.half,
                argument: layer.argument.clone(),
                ..Layer::new(layer.aov, layer.name.clone(), pixels, keep_sums)
            })
            .collect(),
    })
}
