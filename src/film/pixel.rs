//! One pixel in the making: samples go in by their index, a finished value per layer comes out.

use super::aov::{self, Aov, Merge};
use super::spectral::Bins;
use super::sum::{self, TreeSums};
use super::{Layer, Values};
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// A value that errors are compared with at least: a hundredth of white, below which an image is black to the eye.
pub const FLOOR: f64 = 0.01;

/// Collects the samples of one pixel for all layers; used again for the next pixel.
#[derive(Clone, Debug)]
pub struct PixelAccumulator {
    slots: Vec<Slot>,
    /// Layers that are made of the beauty's samples.
    color: Vec<usize>,
    /// Layers of spectral bins.
    spectral: Vec<(usize, Bins)>,
    /// A sample's bins.
    bins: Vec<f64>,
    first_sample: u32,
    /// One past the last sample that was begun.
    next_sample: u32,
    /// The most that a channel of a sample of the beauty may have.
    clamp: f64,
    /// Values that were not finite in `f32`: counted, and treated as absent (light: as 0).
    pub non_finite: u64,
    /// Samples of the beauty that were clamped.
    pub clamped: u64,
}

#[derive(Clone, Debug)]
enum Slot {
    Mean { sums: TreeSums, valid: u32 },
    All { sums: TreeSums },
    First { value: Option<u32> },
    Count,
    Variance { sums: TreeSums, squares: TreeSums },
}

impl Slot {
    fn sums(&mut self) -> impl Iterator<Item = &mut TreeSums> {
        let (sums, squares) = match self {
            Self::Mean { sums, .. } | Self::All { sums } => (Some(sums), None),
            Self::Variance { sums, squares } => (Some(sums), Some(squares)),
            Self::First { .. } | Self::Count => (None, None),
        };
        sums.into_iter().chain(squares)
    }
}

impl PixelAccumulator {
    /// For the layers of `aovs`, in that order, whose first sample has index `first_sample`.
    pub fn new<'a>(aovs: impl IntoIterator<Item = &'a Aov>, first_sample: u32) -> Self {
        let mut color = Vec::new();
        let slot = |(layer, aov): (usize, &Aov)| {
            if matches!(aov.name, aov::COLOR | aov::VARIANCE) {
                color.push(layer);
            }
            let sums = || TreeSums::new(first_sample, aov.channels.len());
            match aov.merge {
                Merge::Mean => Slot::Mean { sums: sums(), valid: 0 },
                Merge::All => Slot::All { sums: sums() },
                Merge::First => Slot::First { value: None },
                Merge::Count => Slot::Count,
                Merge::Variance => Slot::Variance { sums: sums(), squares: sums() },
            }
        };
        let slots = aovs.into_iter().enumerate().map(slot).collect();
        let clamp = f64::INFINITY;
        Self {
            slots,
            color,
            spectral: Vec::new(),
            bins: Vec::new(),
            first_sample,
            next_sample: first_sample,
            clamp,
            non_finite: 0,
            clamped: 0,
        }
    }

    /// The same, with the bins of layers of spectra: their indices and what they are.
    pub fn with_bins(self, spectral: Vec<(usize, Bins)>) -> Self {
        Self { spectral, ..self }
    }

    /// Adds the next sample of the beauty's spectrum, times `scale`, to every layer of spectral bins.
    pub fn add_spectrum<const N: usize>(
        &mut self,
        radiance: SampledSpectrum<N>,
        wavelengths: &Wavelengths<N>,
        scale: f64,
    ) {
        for k in 0..self.spectral.len() {
            let (layer, bins) = self.spectral[k];
            let mut values = std::mem::take(&mut self.bins);
            values.clear();
            values.resize(bins.count(), 0.0);
            bins.estimate(radiance, wavelengths, &mut values);
            self.add_channels(layer, values.iter().map(|value| value * scale));
            self.bins = values;
        }
    }

    /// The same with samples of the beauty scaled down to at most `clamp` in R, G and B, if there is one.
    pub fn clamped_to(self, clamp: Option<f64>) -> Self {
        Self { clamp: clamp.unwrap_or(f64::INFINITY), ..self }
    }

    /// Forgets the last pixel.
    pub fn restart(&mut self) {
        self.next_sample = self.first_sample;
        for slot in &mut self.slots {
            slot.sums().for_each(|sums| sums.restart(self.first_sample));
            match slot {
                Slot::Mean { valid, .. } => *valid = 0,
                Slot::First { value } => *value = None,
                Slot::All { .. } | Slot::Count | Slot::Variance { .. } => {}
            }
        }
    }

    /// Takes up pixel `pixel` of `layers`, which has `count` samples and their sums: a power of two of them from an aligned
    /// beginning on, so that each sum is one node of its tree.
    pub fn resume(&mut self, layers: &[Layer], pixel: usize, count: u32) {
        debug_assert!(count.is_power_of_two(), "{count} samples are no node of the sum");
        self.restart();
        self.next_sample = self.first_sample + count;
        for (slot, layer) in self.slots.iter_mut().zip(layers) {
            if let (Slot::First { value }, Values::Uint(values)) = (&mut *slot, &layer.values) {
                *value = Some(values[pixel]);
            }
            let Some(kept) = &layer.sums else { continue };
            if let Slot::Mean { valid, .. } = slot {
                *valid = kept.counts[pixel];
            }
            let mut values = &kept.values[pixel * layer.aov.sum_count()..];
            for sums in slot.sums() {
                let (of_these, rest) = values.split_at(sums.channels());
                sums.push_range(count, of_these);
                values = rest;
            }
        }
    }

    /// Estimate of the standard error of the beauty's mean over its value: √(V/3) / (m + [`FLOOR`]), where V is the sum over R, G, B of the variances of
    /// their means and m their mean. To V is added what one more sample would bring that differs from the mean by
    /// m + [`FLOOR`]: a pixel whose samples agree may yet have missed what is rare, the more so the fewer they are. So no error is below 1/n.
    ///
    /// `None` if no layer keeps the variance.
    pub fn relative_error(&self) -> Option<f64> {
        let n = self.sample_count();
        let channels = self.slots.iter().find_map(|slot| match slot {
            Slot::Variance { sums, squares } => Some(sums.totals().zip(squares.totals())),
            _ => None,
        })?;
        let (mut variance, mut mean) = (0.0, 0.0);
        for (sum, squares) in channels {
            variance += sum::variance_of_mean(sum, squares, n) / 3.0;
            mean += sum.abs() / f64::from(n) / 3.0;
        }
        let value = mean + FLOOR;
        let unseen = value / f64::from(n);
        Some((variance + unseen * unseen).sqrt() / value)
    }

    /// How many samples the pixel has.
    pub fn sample_count(&self) -> u32 {
        self.next_sample - self.first_sample
    }

    /// Says that the samples up to `end` (exclusive) have been added: the driver does, after each range.
    pub fn advance(&mut self, end: u32) {
        self.next_sample = end;
    }

    /// Adds the next sample of a layer of means; `None` where the sample has no value, which is 0 for light.
    ///
    /// Every layer of means must get every sample, in the order of their indices.
    pub fn add<const N: usize>(&mut self, layer: usize, value: Option<impl Into<[f64; N]>>) {
        let value = self.finite(value.map(Into::into));
        match &mut self.slots[layer] {
            Slot::Mean { sums, valid } => {
                *valid += u32::from(value.is_some());
                sums.push(&value.unwrap_or([0.0; N]));
            }
            Slot::All { sums } => sums.push(&value.unwrap_or([0.0; N])),
            _ => panic!("layer {layer} does not hold means"),
        }
    }

    /// Adds the next sample of a layer of light whose number of channels is not known when compiled.
    pub fn add_channels(&mut self, layer: usize, values: impl IntoIterator<Item = f64>) {
        let Slot::All { sums } = &mut self.slots[layer] else {
            panic!("layer {layer} does not hold light");
        };
        sums.push_each(values.into_iter().map(|value| {
            let representable = (value as f32).is_finite();
            self.non_finite += u64::from(!representable);
            if representable { value } else { 0.0 }
        }));
    }

    /// Adds the next sample R, G, B, A of the beauty to every layer that is made of it: `color`, `variance`.
    ///
    /// Returns the factor by which light was scaled down, 1 unless the render clamps: the parts of the beauty take it too, so that they
    /// sum to it.
    pub fn add_color(&mut self, [r, g, b, a]: [f64; 4]) -> f64 {
        let largest = r.max(g).max(b);
        let scale = if largest > self.clamp { self.clamp / largest } else { 1.0 };
        self.clamped += u64::from(scale < 1.0);
        if self.color.is_empty() {
            return scale;
        }
        let value = self.finite(Some([r * scale, g * scale, b * scale, a])).unwrap_or_default();
        for &layer in &self.color {
            match &mut self.slots[layer] {
                Slot::All { sums } => sums.push(&value),
                Slot::Variance { sums, squares } => {
                    let [r, g, b, _] = value;
                    sums.push(&[r, g, b]);
                    squares.push(&[r * r, g * g, b * b]);
                }
                _ => unreachable!("the beauty's layers are these"),
            }
        }
        scale
    }

    fn finite<const N: usize>(&mut self, value: Option<[f64; N]>) -> Option<[f64; N]> {
        value.filter(|value| {
            let representable = value.iter().all(|v| (*v as f32).is_finite());
            self.non_finite += u64::from(!representable);
            representable
        })
    }

    /// Offers the value of the next sample to a layer that keeps the first.
    pub fn add_first(&mut self, layer: usize, sample: u32) {
        let Slot::First { value } = &mut self.slots[layer] else {
            panic!("layer {layer} does not hold first values");
        };
        value.get_or_insert(sample);
    }

    /// Writes the pixel's values to place `pixel` of `layers`.
    pub fn finish(&self, layers: &mut [Layer], pixel: usize) {
        let taken = self.sample_count();
        for (slot, layer) in self.slots.iter().zip(layers) {
            let range = |count: usize| pixel * count..(pixel + 1) * count;
            match (slot, &mut layer.values) {
                (Slot::Mean { sums, valid }, Values::Float(values)) => {
                    means(sums, *valid, &mut values[range(sums.channels())]);
                    if let Some(fraction) = &mut layer.valid {
                        fraction[pixel] = sum::valid_fraction(*valid, taken);
                    }
                }
                (Slot::All { sums }, Values::Float(values)) => means(sums, taken, &mut values[range(sums.channels())]),
                (Slot::Variance { sums, squares }, Values::Float(values)) => {
                    let channels = sums.totals().zip(squares.totals());
                    for ((sum, squares), value) in channels.zip(&mut values[range(sums.channels())]) {
                        *value = sum::variance_of_mean(sum, squares, taken) as f32;
                    }
                }
                (Slot::First { value }, Values::Uint(values)) => values[pixel] = value.unwrap_or(0),
                (Slot::Count, Values::Uint(values)) => values[pixel] = taken,
                _ => unreachable!("the AOV's sample type follows its merge rule"),
            }
            if let Some(kept) = &mut layer.sums {
                let (totals, count): (Vec<f64>, u32) = match slot {
                    Slot::Mean { sums, valid } => (sums.totals().collect(), *valid),
                    Slot::All { sums } => (sums.totals().collect(), taken),
                    Slot::Variance { sums, squares } => (sums.totals().chain(squares.totals()).collect(), taken),
                    Slot::First { .. } | Slot::Count => unreachable!("only sums are kept as sums"),
                };
                kept.counts[pixel] = count;
                kept.values[range(totals.len())].copy_from_slice(&totals);
            }
        }
    }
}

fn means(sums: &TreeSums, count: u32, values: &mut [f32]) {
    sums.totals().zip(values).for_each(|(sum, value)| *value = sum::mean(sum, count));
}

#[cfg(test)]
mod tests {
    use super::super::aov;
    use super::*;

    fn layers(aovs: &[&'static Aov], keep_sums: bool) -> Vec<Layer> {
        aovs.iter().map(|aov| Layer::new(aov, aov.name.into(), 1, keep_sums)).collect()
    }

    #[test]
    fn means_are_over_valid_samples_and_ids_are_the_first() {
        let aovs = [aov::find("uv").unwrap(), aov::find("prim_id").unwrap()];
        let mut pixel = PixelAccumulator::new(aovs, 0);
        let mut layers = layers(&aovs, false);
        for (value, id) in [(Some([1.0, 2.0]), 7), (None, 8), (Some([3.0, 6.0]), 9), (Some([f64::NAN, 0.0]), 9)] {
            pixel.add(0, value);
            pixel.add_first(1, id);
        }
        pixel.advance(4);
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![2.0, 4.0]));
        assert_eq!(layers[0].valid, Some(vec![0.5]));
        assert_eq!(layers[1].values, Values::Uint(vec![7]));
        assert_eq!(pixel.non_finite, 1);
        pixel.restart();
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![0.0, 0.0]));
    }

    /// A value of sample `i`, different for every `k`.
    fn value(i: u32, k: u32) -> f64 {
        (f64::from(i) * 0.734 + f64::from(k)).sin() * 10f64.powi(((i + k) % 7) as i32 - 3)
    }

    #[test]
    fn a_pixel_taken_up_again_gets_the_same_bits() {
        let aovs = ["color", "variance", "sample_count", "uv", "prim_id"].map(|name| aov::find(name).unwrap());
        for first in [0u32, 64] {
            let add = |pixel: &mut PixelAccumulator, begin: u32, end: u32| {
                for i in begin..end {
                    pixel.add_color([value(i, 0), value(i, 1), value(i, 2), 1.0]);
                    pixel.add(3, (i % 3 > 0).then(|| [value(i, 3), value(i, 4)]));
                    pixel.add_first(4, i + 1);
                }
                pixel.advance(end);
            };
            let mut whole = PixelAccumulator::new(aovs, first);
            add(&mut whole, first, first + 61);
            let mut wanted = layers(&aovs, true);
            whole.finish(&mut wanted, 0);
            for count in [1, 2, 4, 8, 16, 32] {
                let mut pixel = PixelAccumulator::new(aovs, first);
                let mut film = layers(&aovs, true);
                add(&mut pixel, first, first + count);
                pixel.finish(&mut film, 0);
                pixel.restart();
                pixel.resume(&film, 0, count);
                add(&mut pixel, first + count, first + 61);
                pixel.finish(&mut film, 0);
                assert_eq!(film, wanted, "{first} {count}");
            }
        }
    }

    #[test]
    fn errors_are_relative_and_never_below_what_one_sample_could_bring() {
        let aovs = [aov::find("variance").unwrap()];
        let mut pixel = PixelAccumulator::new(aovs, 0);
        for _ in 0..16 {
            pixel.add_color([0.0, 0.0, 0.0, 1.0]);
        }
        pixel.advance(16);
        assert!((pixel.relative_error().unwrap() - 1.0 / 16.0).abs() < 1e-12);
        // Half of the samples 0, half 2m: the deviation of one is m, of the mean of 64 m/8, less Bessel's correction.
        pixel.restart();
        for i in 0..64 {
            pixel.add_color([f64::from(i % 2) * 2e3; 4]);
        }
        pixel.advance(64);
        let wanted = (1.0 / 63.0 + 1.0 / 4096.0f64).sqrt();
        assert!((pixel.relative_error().unwrap() / wanted - 1.0).abs() < 1e-4);
    }

    #[test]
    fn clamped_samples_keep_their_hue_and_are_counted() {
        let aovs = [aov::find("color").unwrap()];
        let mut pixel = PixelAccumulator::new(aovs, 0).clamped_to(Some(2.0));
        let mut film = layers(&aovs, false);
        assert!((pixel.add_color([8.0, 4.0, -2.0, 1.0]) - 0.25).abs() < 1e-15);
        assert!((pixel.add_color([2.0, 1.0, 0.0, 1.0]) - 1.0).abs() < 1e-15);
        pixel.advance(2);
        pixel.finish(&mut film, 0);
        assert_eq!(film[0].values, Values::Float(vec![2.0, 1.0, -0.25, 1.0]));
        assert_eq!(pixel.clamped, 1);
    }

    #[test]
    fn a_hundred_thousand_samples_lose_no_digit() {
        // A sum in f32 stops growing at 2²⁴ units; in a tree of f64 the mean is right to its own rounding.
        let aovs = [aov::find("color").unwrap()];
        let mut pixel = PixelAccumulator::new(aovs, 0);
        let mut film = layers(&aovs, false);
        let count = 100_000;
        for i in 0..count {
            pixel.add_color([1e4 + f64::from(i), 0.1, 1e-6, 1.0]);
        }
        pixel.advance(count);
        pixel.finish(&mut film, 0);
        assert_eq!(film[0].values, Values::Float(vec![59_999.5, 0.1, 1e-6, 1.0]));
    }

    #[test]
    fn light_is_a_mean_over_all_samples_with_its_variance() {
        let aovs = ["color", "variance", "sample_count"].map(|name| aov::find(name).unwrap());
        let mut pixel = PixelAccumulator::new(aovs, 0);
        let mut layers = layers(&aovs, true);
        // 1, 2, 3, 6 in red: mean 3, variance of a sample 14/3, of the mean 7/6.
        for red in [1.0, 2.0, 3.0, 6.0] {
            pixel.add_color([red, -red, 0.5, 1.0]);
        }
        pixel.advance(4);
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![3.0, -3.0, 0.5, 1.0]));
        assert_eq!(layers[1].values, Values::Float(vec![7.0 / 6.0, 7.0 / 6.0, 0.0]));
        assert_eq!(layers[2].values, Values::Uint(vec![4]));
        assert!(layers.iter().all(|layer| layer.valid.is_none()));
        assert_eq!(layers[1].sums.as_ref().unwrap().values, [12.0, -12.0, 2.0, 50.0, 50.0, 1.0]);
        // What is not finite counts as 0, and is counted.
        pixel.add_color([f64::INFINITY, 0.0, 0.5, 1.0]);
        pixel.advance(5);
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![2.4, -2.4, 0.4, 0.8]));
        assert_eq!(pixel.non_finite, 1);
    }
}
