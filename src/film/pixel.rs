//! One pixel in the making: samples go in by their index, a finished value per layer comes out.

use super::aov::{Aov, Merge};
use super::sum::{self, TreeSum};
use super::{Layer, SampleRange, Values};

/// Collects the samples of one pixel for all layers; used again for the next pixel.
#[derive(Clone, Debug)]
pub struct PixelAccumulator {
    slots: Vec<Slot>,
    samples: SampleRange,
    /// Values that were not finite in `f32`: counted and treated as absent.
    pub non_finite: u64,
}

#[derive(Clone, Debug)]
enum Slot {
    Mean { sums: Vec<TreeSum>, valid: u32 },
    First { value: Option<u32> },
}

impl PixelAccumulator {
    /// For the layers of `aovs`, in that order, over `samples`.
    pub fn new<'a>(aovs: impl IntoIterator<Item = &'a Aov>, samples: SampleRange) -> Self {
        let slot = |aov: &Aov| match aov.merge {
            Merge::Mean => Slot::Mean { sums: vec![TreeSum::new(samples.begin); aov.channels.len()], valid: 0 },
            Merge::First => Slot::First { value: None },
        };
        Self { slots: aovs.into_iter().map(slot).collect(), samples, non_finite: 0 }
    }

    /// Forgets the last pixel.
    pub fn restart(&mut self) {
        for slot in &mut self.slots {
            match slot {
                Slot::Mean { sums, valid } => {
                    sums.iter_mut().for_each(|sum| sum.restart(self.samples.begin));
                    *valid = 0;
                }
                Slot::First { value } => *value = None,
            }
        }
    }

    /// Adds the next sample of a layer of means; `None` where the sample has no value.
    ///
    /// Every layer of means must get every sample, in the order of their indices.
    pub fn add<const N: usize>(&mut self, layer: usize, value: Option<impl Into<[f64; N]>>) {
        let Slot::Mean { sums, valid } = &mut self.slots[layer] else {
            panic!("layer {layer} holds first values, not means");
        };
        debug_assert_eq!(sums.len(), N, "channels of layer {layer}");
        let value = value.map(Into::into).filter(|value| {
            let representable = value.iter().all(|v| (*v as f32).is_finite());
            self.non_finite += u64::from(!representable);
            representable
        });
        match value {
            Some(value) => {
                *valid += 1;
                sums.iter_mut().zip(value).for_each(|(sum, v)| sum.push(v));
            }
            None => sums.iter_mut().for_each(|sum| sum.push(0.0)),
        }
    }

    /// Offers the value of the next sample to a layer that keeps the first.
    pub fn add_first(&mut self, layer: usize, sample: u32) {
        let Slot::First { value } = &mut self.slots[layer] else {
            panic!("layer {layer} holds means, not first values");
        };
        value.get_or_insert(sample);
    }

    /// Writes the pixel's values to place `pixel` of `layers`.
    pub fn finish(&self, layers: &mut [Layer], pixel: usize) {
        for (slot, layer) in self.slots.iter().zip(layers) {
            match (slot, &mut layer.values) {
                (Slot::Mean { sums, valid }, Values::Float(values)) => {
                    let channels = sums.len();
                    let range = pixel * channels..(pixel + 1) * channels;
                    for (sum, value) in sums.iter().zip(&mut values[range.clone()]) {
                        *value = sum::mean(sum.total(), *valid);
                    }
                    if let Some(fraction) = &mut layer.valid {
                        fraction[pixel] = sum::valid_fraction(*valid, self.samples.end - self.samples.begin);
                    }
                    if let Some(kept) = &mut layer.sums {
                        kept.counts[pixel] = *valid;
                        kept.values[range].iter_mut().zip(sums).for_each(|(kept, sum)| *kept = sum.total());
                    }
                }
                (Slot::First { value }, Values::Uint(values)) => values[pixel] = value.unwrap_or(0),
                _ => unreachable!("the AOV's sample type follows its merge rule"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::aov;
    use super::*;

    #[test]
    fn means_are_over_valid_samples_and_ids_are_the_first() {
        let aovs = [aov::find("uv").unwrap(), aov::find("prim_id").unwrap()];
        let samples = SampleRange::all(4);
        let mut pixel = PixelAccumulator::new(aovs, samples);
        let mut layers: Vec<_> = aovs.iter().map(|aov| Layer::new(aov, aov.name.into(), 1, false)).collect();
        for (value, id) in [(Some([1.0, 2.0]), 7), (None, 8), (Some([3.0, 6.0]), 9), (Some([f64::NAN, 0.0]), 9)] {
            pixel.add(0, value);
            pixel.add_first(1, id);
        }
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![2.0, 4.0]));
        assert_eq!(layers[0].valid, Some(vec![0.5]));
        assert_eq!(layers[1].values, Values::Uint(vec![7]));
        assert_eq!(pixel.non_finite, 1);
        pixel.restart();
        pixel.finish(&mut layers, 0);
        assert_eq!(layers[0].values, Values::Float(vec![0.0, 0.0]));
    }
}
