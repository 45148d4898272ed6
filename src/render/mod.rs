//! Settings, plan, tiles, progress, statistics: a render from request to film.
//!
//! Tiles are rendered by any thread in any order; what a pixel gets depends on the pixel alone, so the film has the same
//! bits for any number of threads. Cancelling leaves the finished tiles.

mod driver;
mod layers;
pub mod metadata;
mod motion;
pub mod plan;
pub mod request;
mod settings;
mod shot;
mod textures;
pub mod trace;
mod validity;

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

pub use layers::PlannedLayer;
pub use plan::{Plan, plan};
pub use request::Request;
pub use trace::trace;

use crate::camera::{Camera, Lens};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::Aov;
use crate::film::metadata::Metadata;
use crate::film::pixel::PixelAccumulator;
use crate::film::{Film, Layer, Values, Window};
use crate::integrator::chain::Counters;
use crate::integrator::{Registry, Task};
use crate::sampler::Sampler;
use crate::scene::view::View;
use crate::scene::{Counts, Scene};
use crate::texture::TextureCounts;

/// Side of a tile, pixels: small enough to share the work evenly, large enough to forget its administration.
const TILE: i32 = 16;

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
}

impl Control<'static> {
    /// Nobody watches and nobody stops.
    pub fn none() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { cancel: &NEVER, progress: &|_| {} }
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
    let task = Task {
        view: &view,
        camera: &camera,
        aovs: &aovs,
        needs: plan.needs,
        optics: plan.optics,
        sampler: Sampler::new(plan.samples.total, plan.seed)?.over_time(plan.shutter.is_some()),
        samples: plan.samples,
        color_space: plan.color_space,
        resolution: plan.resolution,
        motion_vectors: plan.motion_vectors,
    };
    let prepared = integrator.prepare(&task)?;
    let mut film = empty_film(plan, &camera)?;
    let prepare_seconds = begin.elapsed().as_secs_f64();

    let begin = Instant::now();
    let tiles = tiles(plan.window);
    let total = plan.window.area() as u64;
    let done = AtomicU64::new(0);
    let shared = Mutex::new((&mut film, Counters::default(), 0u64));
    tiles.par_iter().for_each_init(
        || (prepared.worker(), PixelAccumulator::new(aovs.iter().copied(), plan.samples.begin), Counters::default(), 0),
        |(worker, pixel, counted, non_finite_counted), &tile| {
            if control.cancel.load(Ordering::Relaxed) || textures::has_failed(scene) {
                return;
            }
            let keep_sums = !plan.samples.is_all();
            let mut layers: Vec<_> =
                aovs.iter().map(|aov| Layer::new(aov, String::new(), tile.area(), keep_sums)).collect();
            let mut index = 0;
            for y in tile.y0..tile.y1 {
                for x in tile.x0..tile.x1 {
                    pixel.restart();
                    worker.render([x, y], plan.samples.begin..plan.samples.end, pixel);
                    pixel.advance(plan.samples.end);
                    pixel.finish(&mut layers, index);
                    index += 1;
                }
                if control.cancel.load(Ordering::Relaxed) {
                    return;
                }
            }
            let counters = worker.counters();
            {
                let mut shared = shared.lock().expect("no thread panics while it holds the film");
                copy_tile(shared.0, tile, &layers);
                shared.1.add(&counters.since(counted));
                shared.2 += pixel.non_finite - *non_finite_counted;
            }
            (*counted, *non_finite_counted) = (counters, pixel.non_finite);
            let done = done.fetch_add(tile.area() as u64, Ordering::Relaxed) + tile.area() as u64;
            (control.progress)(Progress { done, total });
        },
    );
    let trace_seconds = begin.elapsed().as_secs_f64();
    let (_, counters, non_finite_values) = shared.into_inner().expect("all threads have ended well");

    let mut warnings = scene.diagnostics().clone();
    warnings.extend(&plan.diagnostics);
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
    if non_finite_values > 0 {
        warnings.warn(
            "non-finite",
            &scene.document().stage.source,
            format!("{non_finite_values} values were not finite and are absent: `abbe trace` shows a pixel's chain"),
        );
    }
    let pixels = done.into_inner();
    let complete = pixels == total;
    let metadata = metadata::metadata(scene, plan, &camera, complete);
    let statistics = Statistics {
        complete,
        pixels,
        plan: plan.clone(),
        scene: scene.counts,
        textures: scene.textures.counts(),
        counters,
        non_finite_values,
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
            .map(|layer| Layer { half: layer.half, ..Layer::new(layer.aov, layer.name.clone(), pixels, keep_sums) })
            .collect(),
    })
}

/// The window in tiles, row by row.
fn tiles(window: Window) -> Vec<Window> {
    let mut tiles = Vec::new();
    for y0 in (window.y0..window.y1).step_by(TILE as usize) {
        for x0 in (window.x0..window.x1).step_by(TILE as usize) {
            tiles.push(Window { x0, y0, x1: (x0 + TILE).min(window.x1), y1: (y0 + TILE).min(window.y1) });
        }
    }
    tiles
}

/// Copies the pixels of a finished tile to their place in the film.
fn copy_tile(film: &mut Film, tile: Window, layers: &[Layer]) {
    let window = film.window;
    for (to, from) in film.layers.iter_mut().zip(layers) {
        let channels = to.aov.channels.len();
        for row in 0..tile.height() {
            let source = row * tile.width();
            let target = ((tile.y0 - window.y0) as usize + row) * window.width() + (tile.x0 - window.x0) as usize;
            match (&mut to.values, &from.values) {
                (Values::Float(to), Values::Float(from)) => copy_row(to, target, from, source, tile.width(), channels),
                (Values::Uint(to), Values::Uint(from)) => copy_row(to, target, from, source, tile.width(), channels),
                _ => unreachable!("tiles have the film's layers"),
            }
            if let (Some(to), Some(from)) = (&mut to.valid, &from.valid) {
                copy_row(to, target, from, source, tile.width(), 1);
            }
            if let (Some(to), Some(from)) = (&mut to.sums, &from.sums) {
                copy_row(&mut to.values, target, &from.values, source, tile.width(), channels);
                copy_row(&mut to.counts, target, &from.counts, source, tile.width(), 1);
            }
        }
    }
}

fn copy_row<T: Copy>(to: &mut [T], target: usize, from: &[T], source: usize, pixels: usize, channels: usize) {
    to[target * channels..][..pixels * channels].copy_from_slice(&from[source * channels..][..pixels * channels]);
}
