//! Which channels a film's layers become, and where each channel's numbers are.
//!
//! | channel | content |
//! |---|---|
//! | `<layer>.<C>` | the values |
//! | `<layer>.valid` | fraction of samples with a value |
//! | `Z` | the values of the first `depth` layer once more, unless a layer has that channel itself |
//! | `abbe_partial.<layer>.<C>_hi`, `_lo` | upper and lower half of the bits of the f64 sum over the valid samples |
//! | `abbe_partial.<layer>.<C>2_hi`, `_lo` | of a variance: the same of the sum of the squares |
//! | `abbe_partial.<layer>.count` | number of samples in the sums |
//!
//! A layer with an empty name has bare channels; in `abbe_partial` it goes by its AOV's name.

use half::f16;

use crate::error::{Error, Result};
use crate::film::aov::{Aov, SampleType};
use crate::film::{Film, Layer, Values};

/// The layer above all channels of exact sums.
pub const PARTIAL: &str = "abbe_partial";

/// A layer without its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerKind {
    /// Its row of the AOV table.
    pub aov: &'static Aov,
    /// Its EXR layer name.
    pub name: String,
    /// What its AOV is told with its name.
    pub argument: String,
    /// Whether exact sums are kept.
    pub sums: bool,
    /// Whether values are stored in 16 bits.
    pub half: bool,
}

impl LayerKind {
    /// The kind of `layer`.
    pub fn of(layer: &Layer) -> Self {
        Self {
            aov: layer.aov,
            name: layer.name.clone(),
            argument: layer.argument.clone(),
            sums: layer.sums.is_some(),
            half: layer.half,
        }
    }

    /// A layer of this kind without values.
    pub fn layer(&self, pixels: usize) -> Layer {
        Layer {
            half: self.half,
            argument: self.argument.clone(),
            ..Layer::new(self.aov, self.name.clone(), pixels, self.sums)
        }
    }

    /// What errors and attributes call the layer: its name, or its AOV's where that is empty.
    pub fn title(&self) -> &str {
        if self.name.is_empty() { self.aov.name } else { &self.name }
    }

    fn channel(&self, suffix: &str) -> String {
        if self.name.is_empty() { suffix.to_owned() } else { format!("{}.{suffix}", self.name) }
    }
}

/// Where a channel's numbers are: the layer's index, and the component where there are several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Value {
        layer: usize,
        component: usize,
    },
    Valid {
        layer: usize,
    },
    SumHigh {
        layer: usize,
        component: usize,
    },
    SumLow {
        layer: usize,
        component: usize,
    },
    Count {
        layer: usize,
    },
    /// The values of another channel once more: written, not read.
    Twin {
        layer: usize,
    },
}

impl Source {
    fn layer(self) -> usize {
        match self {
            Self::Value { layer, .. }
            | Self::Valid { layer }
            | Self::SumHigh { layer, .. }
            | Self::SumLow { layer, .. }
            | Self::Count { layer }
            | Self::Twin { layer } => layer,
        }
    }
}

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stored {
    Uint,
    Half,
    Float,
}

impl Stored {
    /// Bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Uint | Self::Float => 4,
        }
    }
}

/// One channel of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) name: String,
    pub(super) sample: Stored,
    pub(super) source: Source,
}

/// The channels of `layers` in the file's order (by bytes of their names).
///
/// Names that collide, that EXR cannot hold or that other programs would misread are usage errors.
pub(super) fn channels(layers: &[LayerKind]) -> Result<Vec<Channel>> {
    for (i, layer) in layers.iter().enumerate() {
        if let Some(other) = layers[..i].iter().find(|other| other.name == layer.name) {
            let called = if layer.name.is_empty() {
                "have no layer name (bare channels)".to_owned()
            } else {
                format!("are both called `{}`", layer.name)
            };
            return Err(Error::usage(
                "EXR layers",
                format!(
                    "`{}` and `{}` {called}: give one of them another name (driver:parameters:aov:name)",
                    other.aov.name, layer.aov.name
                ),
            ));
        }
        if layer.name.chars().any(char::is_control)
            || (!layer.name.is_empty() && layer.name.split('.').any(str::is_empty))
        {
            return Err(Error::usage(
                "EXR layers",
                format!(
                    "`{}` is no layer name: use letters, digits and `_`, with single dots between nested layers",
                    layer.name.escape_debug()
                ),
            ));
        }
    }
    let mut channels = Vec::new();
    for (index, layer) in layers.iter().enumerate() {
        for (component, suffix) in layer.aov.channels.iter().enumerate() {
            channels.push(Channel {
                name: layer.channel(suffix),
                sample: match layer.aov.sample {
                    SampleType::Uint => Stored::Uint,
                    SampleType::Float if layer.half => Stored::Half,
                    SampleType::Float => Stored::Float,
                },
                source: Source::Value { layer: index, component },
            });
        }
        if layer.aov.has_validity {
            let source = Source::Valid { layer: index };
            channels.push(Channel { name: layer.channel("valid"), sample: Stored::Float, source });
        }
        if layer.sums {
            let title = layer.title();
            let mut add = |name: String, source| channels.push(Channel { name, sample: Stored::Uint, source });
            for (component, suffix) in layer.aov.sums().enumerate() {
                add(format!("{PARTIAL}.{title}.{suffix}_hi"), Source::SumHigh { layer: index, component });
                add(format!("{PARTIAL}.{title}.{suffix}_lo"), Source::SumLow { layer: index, component });
            }
            add(format!("{PARTIAL}.{title}.count"), Source::Count { layer: index });
        }
    }
    if let Some(layer) = layers.iter().position(|layer| layer.aov.name == "depth")
        && channels.iter().all(|channel| channel.name != "Z")
    {
        channels.push(Channel { name: "Z".to_owned(), sample: Stored::Float, source: Source::Twin { layer } });
    }
    channels.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
    for pair in channels.windows(2) {
        if pair[0].name == pair[1].name {
            let title = |channel: &Channel| layers[channel.source.layer()].title();
            return Err(Error::usage(
                "EXR layers",
                format!(
                    "layers `{}` and `{}` both have a channel `{}`: give one of them another name",
                    title(&pair[0]),
                    title(&pair[1]),
                    pair[0].name
                ),
            ));
        }
    }
    // Length of the field with its terminator, less that (OpenEXR, File Layout, "Version field").
    if let Some(long) = channels.iter().find(|channel| channel.name.len() > 255) {
        return Err(Error::usage(
            "EXR layers",
            format!("channel name `{}` is longer than the 255 bytes of EXR: shorten the layer's name", long.name),
        ));
    }
    Ok(channels)
}

/// Appends row `row` of `film` in `channel` to `out`, as native words of the channel's size.
pub(super) fn append_row(film: &Film, channel: &Channel, row: usize, out: &mut Vec<u8>) {
    let width = film.window.width();
    let layer = &film.layers[channel.source.layer()];
    let stride = layer.aov.channels.len();
    let pixels = row * width..(row + 1) * width;
    let interleaved = |component: usize| pixels.clone().map(move |pixel| pixel * stride + component);
    let sum_stride = layer.aov.sum_count();
    let summed = |component: usize| pixels.clone().map(move |pixel| pixel * sum_stride + component);
    // Every other source is a column of 32-bit words.
    fn push(out: &mut Vec<u8>, words: impl Iterator<Item = u32>) {
        words.for_each(|word| out.extend_from_slice(&word.to_ne_bytes()));
    }
    match (channel.source, layer) {
        (Source::Value { component, .. }, Layer { values: Values::Float(values), .. })
            if channel.sample == Stored::Half =>
        {
            interleaved(component).for_each(|i| out.extend_from_slice(&to_half(values[i]).to_ne_bytes()));
        }
        (Source::Value { component, .. }, Layer { values: Values::Float(values), .. }) => {
            push(out, interleaved(component).map(|i| values[i].to_bits()));
        }
        (Source::Twin { .. }, Layer { values: Values::Float(values), .. }) => {
            push(out, interleaved(0).map(|i| values[i].to_bits()));
        }
        (Source::Value { component, .. }, Layer { values: Values::Uint(values), .. }) => {
            push(out, interleaved(component).map(|i| values[i]));
        }
        (Source::Valid { .. }, Layer { valid: Some(valid), .. }) => {
            push(out, valid[pixels].iter().map(|v| v.to_bits()));
        }
        (Source::SumHigh { component, .. }, Layer { sums: Some(sums), .. }) => {
            push(out, summed(component).map(|i| (sums.values[i].to_bits() >> 32) as u32));
        }
        (Source::SumLow { component, .. }, Layer { sums: Some(sums), .. }) => {
            push(out, summed(component).map(|i| sums.values[i].to_bits() as u32));
        }
        (Source::Count { .. }, Layer { sums: Some(sums), .. }) => push(out, sums.counts[pixels].iter().copied()),
        (source, layer) => unreachable!("layer `{}` has no {source:?}", layer.aov.name),
    }
}

/// The nearest half float; what is beyond its range is its largest.
fn to_half(value: f32) -> f16 {
    let half = f16::from_f32(value);
    if half.is_infinite() { f16::MAX.copysign(half) } else { half }
}

/// Puts the native words of `bytes`, a row of `channel`, into row `row` of `film`.
pub(super) fn store_row(film: &mut Film, channel: &Channel, row: usize, bytes: &[u8]) {
    let width = film.window.width();
    let layer = &mut film.layers[channel.source.layer()];
    let stride = layer.aov.channels.len();
    let sum_stride = layer.aov.sum_count();
    let first = row * width;
    let words = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_ne_bytes(*word)).enumerate();
    match (channel.source, layer) {
        (Source::Twin { .. }, _) => {}
        (Source::Value { component, .. }, Layer { values: Values::Float(values), .. })
            if channel.sample == Stored::Half =>
        {
            for (i, word) in bytes.as_chunks::<2>().0.iter().enumerate() {
                values[(first + i) * stride + component] = f16::from_ne_bytes(*word).to_f32();
            }
        }
        (Source::Value { component, .. }, Layer { values: Values::Float(values), .. }) => {
            words.for_each(|(i, word)| values[(first + i) * stride + component] = f32::from_bits(word));
        }
        (Source::Value { component, .. }, Layer { values: Values::Uint(values), .. }) => {
            words.for_each(|(i, word)| values[(first + i) * stride + component] = word);
        }
        (Source::Valid { .. }, Layer { valid: Some(valid), .. }) => {
            words.for_each(|(i, word)| valid[first + i] = f32::from_bits(word));
        }
        (Source::SumHigh { component, .. }, Layer { sums: Some(sums), .. }) => words.for_each(|(i, word)| {
            let sum = &mut sums.values[(first + i) * sum_stride + component];
            *sum = f64::from_bits(sum.to_bits() & 0xffff_ffff | u64::from(word) << 32);
        }),
        (Source::SumLow { component, .. }, Layer { sums: Some(sums), .. }) => words.for_each(|(i, word)| {
            let sum = &mut sums.values[(first + i) * sum_stride + component];
            *sum = f64::from_bits(sum.to_bits() & !0xffff_ffff | u64::from(word));
        }),
        (Source::Count { .. }, Layer { sums: Some(sums), .. }) => {
            words.for_each(|(i, word)| sums.counts[first + i] = word);
        }
        (source, layer) => unreachable!("layer `{}` has no {source:?}", layer.aov.name),
    }
}
