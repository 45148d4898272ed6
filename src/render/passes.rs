//! Passes: a render in one go, or in growing numbers of samples, to the same bits.
//!
//! A pass ends after 1, 2, 4, 8 … samples of each pixel. There every sum is one node of its tree
//! ([`TreeSum`](crate::film::sum::TreeSum)), so the film keeps all that the next pass has to know, and what a pixel gets does
//! not depend on passes, tiles or threads.
//!
//! A pixel may be finished early: with an error target it looks at its own samples after 16, 32, 64 … of them, whatever the passes.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::{Control, Plan, Progress, textures};
use crate::film::aov::{self, Aov};
use crate::film::metadata::Metadata;
use crate::film::pixel::PixelAccumulator;
use crate::film::spectral::Bins;
use crate::film::{Film, Layer, SampleRange, Values, Window};
use crate::integrator::PreparedIntegrator;
use crate::integrator::chain::Counters;
use crate::scene::Scene;

/// Side of a tile, pixels: small enough to share the work evenly, large enough to forget its administration.
const TILE: i32 = 16;

/// Samples after which an error target is looked at first: fewer tell little of a variance.
const FIRST_LOOK: u32 = 16;

/// What rendering has come to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub(super) counters: Counters,
    pub(super) non_finite: u64,
    pub(super) clamped: u64,
    /// Samples of all pixels.
    pub(super) samples: u64,
}

/// What passes have come to.
pub(super) struct Passed {
    pub(super) tally: Tally,
    /// Pixels that have samples.
    pub(super) pixels: u64,
    /// Whether nothing was interrupted.
    pub(super) complete: bool,
    /// Passes that were rendered to their end.
    pub(super) passes: u32,
    /// Whether the time limit left samples out.
    pub(super) reached_limit: bool,
}

/// A render in the making.
pub(super) struct Passes<'a> {
    pub(super) scene: &'a Scene,
    pub(super) plan: &'a Plan,
    pub(super) prepared: &'a dyn PreparedIntegrator,
    pub(super) control: &'a Control<'a>,
    pub(super) began: Instant,
    /// The header of a film, of what it has come to, whether it is complete, and whether the time limit left samples out.
    pub(super) describe: &'a (dyn Fn(&Film, &Tally, bool, bool) -> Metadata + Sync),
}

/// What is known between passes.
struct State<'f> {
    film: &'f mut Film,
    /// Pixels that need no more samples; empty before there is an error target.
    finished: Vec<bool>,
    tally: Tally,
    /// Samples per pixel that are done, times pixels.
    done: u64,
}

impl Passes<'_> {
    /// Renders into `film`, whose layers are those of the plan.
    pub(super) fn run(&self, film: &mut Film) -> Passed {
        let samples = self.plan.samples;
        let growing = self.control.pass.is_some() || self.plan.time_limit.is_some();
        // The variance that an error is known from, if no layer has it.
        let hidden = self.plan.error_target.is_some() && film.layer(aov::VARIANCE).is_none();
        if hidden {
            let row = aov::find(aov::VARIANCE).expect("in the table");
            film.layers.push(Layer::new(row, String::new(), film.window.area(), false));
        }
        if growing {
            for layer in &mut film.layers {
                layer.keep_sums();
            }
        }
        let finished = if self.plan.error_target.is_some() { vec![false; film.window.area()] } else { Vec::new() };
        let mut state = State { film, finished, tally: Tally::default(), done: 0 };
        let area = self.plan.window.area() as u64;
        let mut passed = Passed { tally: Tally::default(), pixels: 0, complete: true, passes: 0, reached_limit: false };
        let mut begin = samples.begin;
        while begin < samples.end && !passed.reached_limit {
            let wanted = if growing { self.doubled(begin) } else { samples.end };
            let end = self.affordable_end(begin, wanted);
            passed.reached_limit = end < wanted;
            if end > begin {
                let pixels = self.pass(begin..end, &mut state);
                // What an interrupted pass did not reach has the samples of the one before.
                passed.pixels = if passed.passes > 0 { area } else { pixels };
                passed.complete = pixels == area;
                if !passed.complete {
                    break;
                }
                passed.passes += 1;
                begin = end;
                if let Some(pass) = self.control.pass {
                    let film = snapshot(state.film, hidden, SampleRange { end, ..samples });
                    let metadata = (self.describe)(&film, &state.tally, true, passed.reached_limit);
                    if !pass(film, metadata) {
                        passed.complete = end == samples.end;
                        break;
                    }
                }
                if !state.finished.is_empty() && state.finished.iter().all(|&finished| finished) {
                    break;
                }
            }
        }
        passed.tally = state.tally;
        if hidden {
            film.layers.pop();
        }
        if passed.reached_limit && passed.complete {
            film.samples = SampleRange::all(begin);
        }
        if film.samples.is_all() {
            film.layers.iter_mut().for_each(|layer| layer.sums = None);
        }
        passed
    }

    /// Where a pass that begins at `begin` ends in a growing render: with twice the samples.
    fn doubled(&self, begin: u32) -> u32 {
        let SampleRange { begin: first, end, .. } = self.plan.samples;
        first.saturating_add((begin - first).saturating_mul(2).max(1)).min(end)
    }

    /// Where a pass that begins at `begin` and would end at `end` has to end so that the time suffices, at the rate so far. The
    /// first pass is always rendered. One that is cut short is the last, so it may end anywhere.
    fn affordable_end(&self, begin: u32, end: u32) -> u32 {
        let count = begin - self.plan.samples.begin;
        let Some(limit) = self.plan.time_limit.filter(|_| count > 0) else { return end };
        let elapsed = self.began.elapsed().as_secs_f64().max(1e-9);
        let affordable = f64::from(count) * (limit - elapsed).max(0.0) / elapsed;
        begin + (end - begin).min(affordable as u32)
    }

    /// Renders the samples `range` of every pixel; returns how many pixels are through.
    fn pass(&self, range: Range<u32>, state: &mut State<'_>) -> u64 {
        let plan = self.plan;
        let samples = plan.samples;
        let aovs: Vec<&'static Aov> = state.film.layers.iter().map(|layer| layer.aov).collect();
        let bins: Vec<(usize, Bins)> = plan.bins().collect();
        let tiles = tiles(plan.window);
        let pixels = AtomicU64::new(0);
        let total = plan.window.area() as u64;
        let (before, each) = (state.done, u64::from(range.end - range.start));
        let all = total * u64::from(samples.end - samples.begin);
        let shared = Mutex::new(&mut *state);
        tiles.par_iter().for_each_init(
            || {
                let pixel = PixelAccumulator::new(aovs.iter().copied(), samples.begin);
                let pixel = pixel.clamped_to(plan.clamp).with_bins(bins.clone());
                (self.prepared.worker(), pixel, Tally::default())
            },
            |(worker, pixel, counted), &tile| {
                if self.control.cancel.load(Ordering::Relaxed) || textures::has_failed(self.scene) {
                    return;
                }
                let (mut layers, mut finished) = {
                    let shared = shared.lock().expect("no thread panics while it holds the film");
                    read_tile(shared.film, &shared.finished, tile)
                };
                let mut index = 0;
                let mut taken = counted.samples;
                for y in tile.y0..tile.y1 {
                    for x in tile.x0..tile.x1 {
                        let is_finished = finished.get_mut(index);
                        if !is_finished.as_deref().is_some_and(|&finished| finished) {
                            if range.start == samples.begin {
                                pixel.restart();
                            } else {
                                pixel.resume(&layers, index, range.start - samples.begin);
                            }
                            let mut begin = range.start;
                            for end in looks(&range, plan.error_target.is_some()) {
                                worker.render([x, y], begin..end, pixel);
                                pixel.advance(end);
                                taken += u64::from(end - begin);
                                begin = end;
                                if let (Some(target), Some(is_finished)) = (plan.error_target, finished.get_mut(index))
                                    && end >= FIRST_LOOK
                                    && end.is_power_of_two()
                                    && pixel.relative_error().is_some_and(|error| error <= target)
                                {
                                    *is_finished = true;
                                    break;
                                }
                            }
                            pixel.finish(&mut layers, index);
                        }
                        index += 1;
                    }
                    if self.control.cancel.load(Ordering::Relaxed) {
                        return;
                    }
                }
                let now = Tally {
                    counters: worker.counters(),
                    non_finite: pixel.non_finite,
                    clamped: pixel.clamped,
                    samples: taken,
                };
                {
                    let mut shared = shared.lock().expect("no thread panics while it holds the film");
                    let shared = &mut **shared;
                    copy_tile(shared.film, tile, &layers);
                    write_flags(&mut shared.finished, plan.window, tile, &finished);
                    shared.tally.counters.add(&now.counters.since(&counted.counters));
                    shared.tally.non_finite += now.non_finite - counted.non_finite;
                    shared.tally.clamped += now.clamped - counted.clamped;
                    shared.tally.samples += now.samples - counted.samples;
                    shared.done += tile.area() as u64 * each;
                }
                *counted = now;
                let done = pixels.fetch_add(tile.area() as u64, Ordering::Relaxed) + tile.area() as u64;
                // In pixels of the whole render, of which a pass brings its share.
                let share = u128::from(before + done * each) * u128::from(total) / u128::from(all);
                (self.control.progress)(Progress { done: share as u64, total });
            },
        );
        pixels.into_inner()
    }
}

/// Ends of the parts of `range` after which a pixel looks at its error; the range's own end if it never does.
fn looks(range: &Range<u32>, has_target: bool) -> impl Iterator<Item = u32> + use<> {
    let (start, end) = (range.start, range.end);
    let first = if has_target { FIRST_LOOK.max((start + 1).next_power_of_two()) } else { end };
    std::iter::successors(Some(first.min(end)), move |&look| (look < end).then(|| look.saturating_mul(2).min(end)))
}

/// The film as if its render had `samples` only.
fn snapshot(film: &Film, hidden: bool, samples: SampleRange) -> Film {
    let shown = film.layers.len() - usize::from(hidden);
    let samples = if samples.begin == 0 { SampleRange::all(samples.end) } else { samples };
    let layers = film.layers[..shown].iter().map(|layer| Layer {
        values: layer.values.clone(),
        valid: layer.valid.clone(),
        sums: if samples.is_all() { None } else { layer.sums.clone() },
        ..Layer::new(layer.aov, layer.name.clone(), 0, false)
    });
    let layers = layers
        .zip(&film.layers)
        .map(|(shown, layer)| Layer { half: layer.half, argument: layer.argument.clone(), ..shown })
        .collect();
    Film { samples, layers, ..*film }
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

/// Runs of pixels of `tile` in the tile itself and in `window`: first pixel in each, row by row.
fn rows(window: Window, tile: Window) -> impl Iterator<Item = (usize, usize)> {
    (0..tile.height()).map(move |row| {
        let in_window = ((tile.y0 - window.y0) as usize + row) * window.width() + (tile.x0 - window.x0) as usize;
        (row * tile.width(), in_window)
    })
}

/// What the film has at a tile.
fn read_tile(film: &Film, flags: &[bool], tile: Window) -> (Vec<Layer>, Vec<bool>) {
    let new = |layer: &Layer| Layer::new(layer.aov, String::new(), tile.area(), layer.sums.is_some());
    let mut layers: Vec<Layer> = film.layers.iter().map(new).collect();
    let mut finished = vec![false; if flags.is_empty() { 0 } else { tile.area() }];
    for (in_tile, in_film) in rows(film.window, tile) {
        for (to, from) in layers.iter_mut().zip(&film.layers) {
            copy_run(to, in_tile, from, in_film, tile.width());
        }
        if !flags.is_empty() {
            finished[in_tile..][..tile.width()].copy_from_slice(&flags[in_film..][..tile.width()]);
        }
    }
    (layers, finished)
}

/// Copies the pixels of a finished tile to their place in the film.
fn copy_tile(film: &mut Film, tile: Window, layers: &[Layer]) {
    for (in_tile, in_film) in rows(film.window, tile) {
        for (to, from) in film.layers.iter_mut().zip(layers) {
            copy_run(to, in_film, from, in_tile, tile.width());
        }
    }
}

fn write_flags(flags: &mut [bool], window: Window, tile: Window, finished: &[bool]) {
    if !flags.is_empty() {
        for (in_tile, in_film) in rows(window, tile) {
            flags[in_film..][..tile.width()].copy_from_slice(&finished[in_tile..][..tile.width()]);
        }
    }
}

fn copy_run(to: &mut Layer, target: usize, from: &Layer, source: usize, pixels: usize) {
    let channels = to.aov.channels.len();
    match (&mut to.values, &from.values) {
        (Values::Float(to), Values::Float(from)) => copy(to, target, from, source, pixels, channels),
        (Values::Uint(to), Values::Uint(from)) => copy(to, target, from, source, pixels, channels),
        _ => unreachable!("tiles have the film's layers"),
    }
    if let (Some(to), Some(from)) = (&mut to.valid, &from.valid) {
        copy(to, target, from, source, pixels, 1);
    }
    if let (Some(sums), Some(from)) = (&mut to.sums, &from.sums) {
        copy(&mut sums.values, target, &from.values, source, pixels, to.aov.sum_count());
        copy(&mut sums.counts, target, &from.counts, source, pixels, 1);
    }
}

fn copy<T: Copy>(to: &mut [T], target: usize, from: &[T], source: usize, pixels: usize, channels: usize) {
    to[target * channels..][..pixels * channels].copy_from_slice(&from[source * channels..][..pixels * channels]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_looks_at_its_error_at_powers_of_two_whatever_the_passes() {
        let found = |start, end| looks(&(start..end), true).collect::<Vec<_>>();
        assert_eq!(found(0, 100), [16, 32, 64, 100]);
        assert_eq!(found(0, 8), [8]);
        assert_eq!(found(8, 16), [16]);
        assert_eq!(found(16, 32), [32]);
        assert_eq!(found(32, 40), [40]);
        assert_eq!(looks(&(3..100), false).collect::<Vec<_>>(), [100]);
    }
}
