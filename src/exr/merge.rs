//! Joins parts of one render (crops, aligned sample ranges, both at once) to the bits of the whole.
//!
//! The edges of all data windows cut the result into cells; within a cell the same files cover every pixel. Per cell the
//! files with the same samples must agree bit for bit, and the ranges must follow each other without gap or overlap; their
//! exact sums then meet in the tree of [`TreeSum`], as the samples of an undivided render do. Rows are read and written in
//! bands, so memory does not grow with the size of the image.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use super::header::same_value;
use super::{Head, Reader, writer};
use crate::error::{Error, Result};
use crate::film::aov::Merge;
use crate::film::metadata::{Attribute, Metadata};
use crate::film::sum::{TreeSum, is_aligned, mean, valid_fraction, variance_of_mean};
use crate::film::{Film, Layer, SampleRange, Sums, Values, Window};

/// Attributes that tell of a part, not of the render: they may differ between parts and the result does not have them.
pub const PER_PART: &[&str] = &[
    "abbe:clampedSamples",
    "abbe:commandLine",
    "abbe:crop",
    "abbe:renderTime",
    "abbe:statistics",
    "abbe:threads",
    "abbe:window",
    "capDate",
];

/// One input.
struct Part {
    path: PathBuf,
    window: Window,
    samples: SampleRange,
    has_sums: bool,
    reader: Reader,
}

/// Rows in which the same files are met.
struct Strip {
    y0: i32,
    y1: i32,
    cells: Vec<Cell>,
}

/// Pixels that the same files cover.
struct Cell {
    x0: i32,
    x1: i32,
    /// Indices of parts: one group per sample range, in the order of the samples; a group's parts hold the same samples.
    groups: Vec<Vec<usize>>,
}

/// Joins the parts of a render in `inputs` to one file.
///
/// Parts may be crops, aligned sample ranges ([`is_aligned`]), or both. Together they must fill a rectangle of pixels, all
/// with the same samples: those of the whole render, or one aligned range of it (the result is then a part again, with its
/// sums). Pixels that parts share must be equal bit for bit. Headers must agree in all attributes but [`PER_PART`].
/// Identifiers and counts are those of the lowest sample.
pub fn merge(inputs: &[PathBuf], out: &Path) -> Result<()> {
    let mut parts = inputs.iter().map(|path| open(path)).collect::<Result<Vec<_>>>()?;
    let Some((first, others)) = parts.split_first() else {
        return Err(Error::usage("merge", "no files to join: name at least one"));
    };
    others.iter().try_for_each(|part| check_agreement(first, part))?;
    let window = parts.iter().map(|part| part.window).reduce(bounding_box).unwrap_or(first.window);
    let strips = cells(&parts, window)?;
    let samples = common_samples(&parts, &strips)?;
    for cell in strips.iter().flat_map(|strip| &strip.cells).filter(|cell| cell.groups.len() > 1) {
        cell.groups.iter().flatten().try_for_each(|&i| check_summable(&parts[i]))?;
    }
    // Sums have done their work once all samples are there.
    let keep_sums = !samples.is_all() && parts.iter().all(|part| part.has_sums);
    if !samples.is_all()
        && !keep_sums
        && let Some(odd) = parts.iter().find(|part| part.has_sums)
    {
        return Err(Error::file(&odd.path, "has exact sums and other parts have none: render all parts the same way"));
    }
    let known = first.reader.head();
    let mut layers = known.layers.clone();
    layers.iter_mut().for_each(|layer| layer.sums = keep_sums && layer.aov.has_sums());
    let head = Head { window, samples, layers, ..*known };
    let mut metadata = first.reader.metadata().clone();
    metadata.attributes.retain(|(name, _)| !PER_PART.contains(&name.as_str()));
    writer::write_bands(out, &head, &metadata, |band| join(&mut parts, &strips, &head, band).map(Cow::Owned))
}

fn open(path: &Path) -> Result<Part> {
    let reader = Reader::open(path)?;
    if reader.metadata().get("abbe:complete") == Some(&Attribute::Int(0)) {
        return Err(Error::file(path, "was interrupted, so pixels are missing in it: render it again"));
    }
    let Head { window, samples, ref layers, .. } = *reader.head();
    let mut means = layers.iter().filter(|layer| layer.aov.has_sums()).peekable();
    let has_sums =
        means.peek().is_none() && !samples.is_all() || means.peek().is_some() && means.all(|layer| layer.sums);
    Ok(Part { path: path.to_owned(), window, samples, has_sums, reader })
}

fn bounding_box(a: Window, b: Window) -> Window {
    Window { x0: a.x0.min(b.x0), y0: a.y0.min(b.y0), x1: a.x1.max(b.x1), y1: a.y1.max(b.y1) }
}

/// Refuses parts of different renders.
fn check_agreement(first: &Part, other: &Part) -> Result<()> {
    let (a, b) = (first.reader.head(), other.reader.head());
    let differ = |what: &str, here: &dyn fmt::Display, there: &dyn fmt::Display| {
        Err(Error::file(
            &other.path,
            format!(
                "{what} is {here}, but {there} in {}: only parts of one render can be joined",
                first.path.display()
            ),
        ))
    };
    let size = |head: &Head| format!("{} x {}", head.resolution[0], head.resolution[1]);
    if a.resolution != b.resolution {
        return differ("the resolution", &size(b), &size(a));
    }
    if a.pixel_aspect_ratio.to_bits() != b.pixel_aspect_ratio.to_bits() {
        return differ("pixelAspectRatio", &b.pixel_aspect_ratio, &a.pixel_aspect_ratio);
    }
    if a.samples.total != b.samples.total {
        return differ("the number of samples", &b.samples.total, &a.samples.total);
    }
    let names = |head: &Head| -> Vec<String> {
        head.layers.iter().map(|layer| format!("{} ({})", layer.title(), layer.aov.name)).collect()
    };
    if names(a) != names(b) {
        return differ("the list of layers", &names(b).join(", "), &names(a).join(", "));
    }
    let (a, b) = (first.reader.metadata(), other.reader.metadata());
    let shown = |metadata: &Metadata, name: &str| match metadata.get(name) {
        None => "absent".to_owned(),
        Some(Attribute::Text(text)) => format!("`{}`", abbreviated(text)),
        Some(value) => abbreviated(&format!("{value:?}")),
    };
    for (name, _) in a.attributes.iter().chain(&b.attributes).filter(|(name, _)| !PER_PART.contains(&name.as_str())) {
        let equal = match (a.get(name), b.get(name)) {
            (Some(a), Some(b)) => same_value(a, b),
            _ => false,
        };
        if !equal {
            return differ(&format!("attribute {name}"), &shown(b, name), &shown(a, name));
        }
    }
    Ok(())
}

/// The beginning of a long value.
fn abbreviated(text: &str) -> String {
    const SHOWN: usize = 60;
    if text.chars().count() <= SHOWN { text.to_owned() } else { text.chars().take(SHOWN).chain(['…']).collect() }
}

/// Cuts `window` along the edges of all parts. Every pixel must be in a part.
fn cells(parts: &[Part], window: Window) -> Result<Vec<Strip>> {
    fn cuts(edges: impl Iterator<Item = i32>) -> Vec<i32> {
        let mut cuts: Vec<i32> = edges.collect();
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    }
    let mut strips = Vec::new();
    let mut missing: Option<Window> = None;
    let mut missing_pixels = 0;
    for rows in cuts(parts.iter().flat_map(|part| [part.window.y0, part.window.y1])).windows(2) {
        let (y0, y1) = (rows[0], rows[1]);
        let active: Vec<usize> =
            (0..parts.len()).filter(|&i| parts[i].window.y0 <= y0 && y1 <= parts[i].window.y1).collect();
        let edges = active.iter().flat_map(|&i| [parts[i].window.x0, parts[i].window.x1]);
        let mut strip = Strip { y0, y1, cells: Vec::new() };
        for columns in cuts(edges.chain([window.x0, window.x1])).windows(2) {
            let (x0, x1) = (columns[0], columns[1]);
            let mut inside: Vec<usize> =
                active.iter().copied().filter(|&i| parts[i].window.x0 <= x0 && x1 <= parts[i].window.x1).collect();
            if inside.is_empty() {
                let hole = Window { x0, y0, x1, y1 };
                missing.get_or_insert(hole);
                missing_pixels += hole.area();
                continue;
            }
            inside.sort_by_key(|&i| (parts[i].samples.begin, parts[i].samples.end));
            let groups =
                inside.chunk_by(|&a, &b| parts[a].samples == parts[b].samples).map(<[usize]>::to_vec).collect();
            strip.cells.push(Cell { x0, x1, groups });
        }
        strips.push(strip);
    }
    match missing {
        None => Ok(strips),
        Some(Window { x0, y0, x1, y1 }) => Err(Error::usage(
            "merge",
            format!(
                "{missing_pixels} pixels are in no file, among them {x0},{y0} to {x1},{y1} (exclusive): \
                 add the crops that cover them; the parts must fill a rectangle"
            ),
        )),
    }
}

/// The samples that every pixel has.
fn common_samples(parts: &[Part], strips: &[Strip]) -> Result<SampleRange> {
    let total = parts[0].samples.total;
    let mut common: Option<SampleRange> = None;
    for strip in strips {
        for cell in &strip.cells {
            let place = format!("pixels {},{} to {},{} (exclusive)", cell.x0, strip.y0, cell.x1, strip.y1);
            let leaders: Vec<&Part> = cell.groups.iter().map(|group| &parts[group[0]]).collect();
            for pair in leaders.windows(2) {
                let (before, after) = (pair[0].samples, pair[1].samples);
                if after.begin < before.end {
                    return Err(Error::file(
                        &pair[1].path,
                        format!(
                            "samples {}..{} of {place} are also in {}: leave one of the files out",
                            after.begin,
                            after.end.min(before.end),
                            pair[0].path.display()
                        ),
                    ));
                }
                if after.begin > before.end {
                    return Err(Error::usage(
                        "merge",
                        format!("samples {}..{} of {place} are missing: add their files", before.end, after.begin),
                    ));
                }
            }
            let (begin, end) = (leaders[0].samples.begin, leaders[leaders.len() - 1].samples.end);
            let here = SampleRange { begin, end, total };
            match common {
                Some(known) if known != here => {
                    return Err(Error::usage(
                        "merge",
                        format!(
                            "{place} have the samples {begin}..{end}, others {}..{}: add the missing files",
                            known.begin, known.end
                        ),
                    ));
                }
                _ => common = Some(here),
            }
        }
    }
    let samples = common.unwrap_or(parts[0].samples);
    let SampleRange { begin, end, .. } = samples;
    if parts.len() > 1 && !is_aligned(begin, end, total) && parts.iter().any(|part| part.samples != samples) {
        let gap = if end < total { (end, total) } else { (0, begin) };
        return Err(Error::usage(
            "merge",
            format!(
                "samples {}..{} of {total} are missing, and {begin}..{end} cannot be joined with them later \
                 (a part begins at a multiple of its length, a power of two): add their files",
                gap.0, gap.1
            ),
        ));
    }
    Ok(samples)
}

/// Whether the part's sums can be joined with others.
fn check_summable(part: &Part) -> Result<()> {
    let SampleRange { begin, end, total } = part.samples;
    if !is_aligned(begin, end, total) {
        return Err(Error::file(
            &part.path,
            format!(
                "its samples {begin}..{end} of {total} are no whole node of the sum: render ranges that begin at a \
                 multiple of their length, which is a power of two (the last one may be shorter)"
            ),
        ));
    }
    if !part.has_sums {
        return Err(Error::file(
            &part.path,
            "has no exact sums, so its samples cannot be joined: render it with a sample range",
        ));
    }
    Ok(())
}

/// The rows of `band` of the result.
fn join(parts: &mut [Part], strips: &[Strip], head: &Head, band: Window) -> Result<Film> {
    let mut films = Vec::with_capacity(parts.len());
    for part in parts.iter_mut() {
        let (y0, y1) = (part.window.y0.max(band.y0), part.window.y1.min(band.y1));
        films.push(if y0 < y1 { Some(part.reader.rows(y0, y1)?) } else { None });
    }
    let new = |kind: &super::layout::LayerKind| kind.layer(band.area());
    let mut joined = Film {
        resolution: head.resolution,
        window: band,
        pixel_aspect_ratio: head.pixel_aspect_ratio,
        samples: head.samples,
        layers: head.layers.iter().map(new).collect(),
    };
    for strip in strips {
        for y in strip.y0.max(band.y0)..strip.y1.min(band.y1) {
            for cell in &strip.cells {
                for index in 0..head.layers.len() {
                    let span = |part: usize| Span::new(&films, part, index, cell.x0, y, cell.x1);
                    for group in &cell.groups {
                        let leader = span(group[0]);
                        for &other in &group[1..] {
                            if let Some(column) = leader.first_difference(&span(other)) {
                                let x = cell.x0 + column as i32;
                                return Err(different(&parts[group[0]], &parts[other], &joined.layers[index], x, y));
                            }
                        }
                    }
                    let groups: Vec<Span<'_>> = cell.groups.iter().map(|group| span(group[0])).collect();
                    let first = (y - band.y0) as usize * band.width() + (cell.x0 - band.x0) as usize;
                    join_span(&groups, head.samples, &mut joined.layers[index], first);
                }
            }
        }
    }
    Ok(joined)
}

fn different(a: &Part, b: &Part, layer: &Layer, x: i32, y: i32) -> Error {
    let name = if layer.name.is_empty() { layer.aov.name } else { &layer.name };
    Error::file(
        &b.path,
        format!(
            "layer `{name}` at pixel {x},{y} differs from {}: parts that overlap must come from the same render",
            a.path.display()
        ),
    )
}

/// A run of pixels of one layer of one part, all slices beginning at its first pixel.
struct Span<'a> {
    layer: &'a Layer,
    samples: SampleRange,
    first: usize,
    pixels: usize,
}

impl<'a> Span<'a> {
    fn new(films: &'a [Option<Film>], part: usize, layer: usize, x0: i32, y: i32, x1: i32) -> Self {
        let film = films[part].as_ref().expect("the cell lies in the part's rows");
        let first = (y - film.window.y0) as usize * film.window.width() + (x0 - film.window.x0) as usize;
        Self { layer: &film.layers[layer], samples: film.samples, first, pixels: (x1 - x0) as usize }
    }

    /// Indices of the interleaved values.
    fn components(&self) -> std::ops::Range<usize> {
        let n = self.layer.aov.channels.len();
        self.first * n..(self.first + self.pixels) * n
    }

    /// Indices of the interleaved sums.
    fn sum_components(&self) -> std::ops::Range<usize> {
        let n = self.layer.aov.sum_count();
        self.first * n..(self.first + self.pixels) * n
    }

    /// The value of a layer of counts at pixel `pixel` of the span.
    fn count(&self, pixel: usize) -> u32 {
        match &self.layer.values {
            Values::Uint(values) => values[self.first + pixel],
            Values::Float(_) => unreachable!("counts are integers"),
        }
    }

    fn per_pixel(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.pixels
    }

    /// The first pixel, counted from the span's, where the parts disagree in a bit.
    fn first_difference(&self, other: &Self) -> Option<usize> {
        fn differs<T>(a: &[T], b: &[T], bits: impl Fn(&T) -> u64) -> Option<usize> {
            a.iter().zip(b).position(|(a, b)| bits(a) != bits(b))
        }
        let (a, b) = (self.components(), other.components());
        let n = self.layer.aov.channels.len();
        let values = match (&self.layer.values, &other.layer.values) {
            (Values::Float(u), Values::Float(v)) => differs(&u[a], &v[b], |x| u64::from(x.to_bits())),
            (Values::Uint(u), Values::Uint(v)) => differs(&u[a], &v[b], |x| u64::from(*x)),
            _ => Some(0),
        };
        let valid = match (&self.layer.valid, &other.layer.valid) {
            (Some(u), Some(v)) => differs(&u[self.per_pixel()], &v[other.per_pixel()], |x| u64::from(x.to_bits())),
            _ => None,
        };
        let (sums, counts) = match (&self.layer.sums, &other.layer.sums) {
            (Some(u), Some(v)) => (
                differs(&u.values[self.sum_components()], &v.values[other.sum_components()], |x| x.to_bits()),
                differs(&u.counts[self.per_pixel()], &v.counts[other.per_pixel()], |x| u64::from(*x)),
            ),
            _ => (None, None),
        };
        [values.map(|i| i / n), valid, sums.map(|i| i / self.layer.aov.sum_count()), counts].into_iter().flatten().min()
    }
}

/// Joins one run of pixels, whose samples are those of `groups` in turn, and stores it at pixel `first` of `out`.
fn join_span(groups: &[Span<'_>], samples: SampleRange, out: &mut Layer, first: usize) {
    let lowest = &groups[0];
    let n = out.aov.channels.len();
    let pixels = first..first + lowest.pixels;
    let components = first * n..(first + lowest.pixels) * n;
    if groups.len() == 1 || out.aov.merge == Merge::First {
        match (&mut out.values, &lowest.layer.values) {
            (Values::Float(to), Values::Float(from)) => {
                to[components.clone()].copy_from_slice(&from[lowest.components()])
            }
            (Values::Uint(to), Values::Uint(from)) => {
                to[components.clone()].copy_from_slice(&from[lowest.components()])
            }
            _ => unreachable!("a layer's type is its AOV's"),
        }
        if let (Some(to), Some(from)) = (&mut out.valid, &lowest.layer.valid) {
            to[pixels.clone()].copy_from_slice(&from[lowest.per_pixel()]);
        }
        if let (Some(to), Some(from)) = (&mut out.sums, &lowest.layer.sums) {
            let n = out.aov.sum_count();
            let components = first * n..(first + lowest.pixels) * n;
            to.values[components].copy_from_slice(&from.values[lowest.sum_components()]);
            to.counts[pixels].copy_from_slice(&from.counts[lowest.per_pixel()]);
        }
        return;
    }
    if out.aov.merge == Merge::Count {
        let Values::Uint(to) = &mut out.values else { unreachable!("counts are integers") };
        for (pixel, to) in to[pixels].iter_mut().enumerate() {
            *to = groups.iter().map(|span| span.count(pixel)).sum();
        }
        return;
    }
    let sources: Vec<(&Span<'_>, &Sums)> = groups
        .iter()
        .map(|span| (span, span.layer.sums.as_ref().expect("parts with several ranges were checked to have sums")))
        .collect();
    let covered = samples.end - samples.begin;
    let sum_count = out.aov.sum_count();
    let mut tree = TreeSum::new(samples.begin);
    let mut totals = vec![0.0; sum_count];
    for pixel in 0..lowest.pixels {
        let count: u32 = sources.iter().map(|(span, sums)| sums.counts[span.first + pixel]).sum();
        for (component, total) in totals.iter_mut().enumerate() {
            tree.restart(samples.begin);
            for (span, sums) in &sources {
                tree.push_range(
                    span.samples.end - span.samples.begin,
                    sums.values[(span.first + pixel) * sum_count + component],
                );
            }
            *total = tree.total();
        }
        if let Values::Float(values) = &mut out.values {
            for component in 0..n {
                values[(first + pixel) * n + component] = match out.aov.merge {
                    Merge::Variance => variance_of_mean(totals[component], totals[n + component], count) as f32,
                    _ => mean(totals[component], count),
                };
            }
        }
        if let Some(valid) = &mut out.valid {
            valid[first + pixel] = valid_fraction(count, covered);
        }
        if let Some(sums) = &mut out.sums {
            sums.values[(first + pixel) * sum_count..][..sum_count].copy_from_slice(&totals);
            sums.counts[first + pixel] = count;
        }
    }
}
