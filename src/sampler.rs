//! Where in the pixel samples are taken: decided by (pixel, sample index, seed) alone.

use crate::error::{Error, Result};

/// The most samples a pixel can have: the length of the Sobol' sequence that `sobol_burley` holds.
pub const MAX_SAMPLES: u32 = 1 << 16;

/// Positions in the unit square of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    samples: u32,
    seed: u64,
}

impl Sampler {
    /// A sampler for `samples` samples a pixel, at least 1.
    pub fn new(samples: u32, seed: u64) -> Result<Self> {
        if samples == 0 || samples > MAX_SAMPLES {
            return Err(Error::usage("--samples", format!("must be 1 to {MAX_SAMPLES}, not {samples}")));
        }
        Ok(Self { samples, seed })
    }

    /// Position of sample `index` of `pixel` inside the pixel, x right, y down, in [0, 1).
    ///
    /// One sample stands at the centre; more follow an Owen-scrambled Sobol' sequence (Burley 2020), scrambled per pixel.
    pub fn position(&self, pixel: [i32; 2], index: u32) -> [f64; 2] {
        if self.samples == 1 {
            return [0.5, 0.5];
        }
        let seed = hash(self.seed ^ (u64::from(pixel[0] as u32) << 32 | u64::from(pixel[1] as u32)));
        let point = sobol_burley::sample_4d(index, 0, (seed ^ (seed >> 32)) as u32);
        [f64::from(point[0]), f64::from(point[1])]
    }
}

/// Mixes all bits of `x` (finaliser of SplitMix64; Steele, Lea, Flood 2014).
fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the law under test")]
mod tests {
    use super::*;

    #[test]
    fn one_sample_stands_at_the_centre() {
        assert_eq!(Sampler::new(1, 7).unwrap().position([3, -4], 0), [0.5, 0.5]);
    }

    #[test]
    fn every_quarter_of_a_pixel_gets_a_quarter_of_the_samples() {
        let sampler = Sampler::new(64, 1).unwrap();
        let mut counts = [0; 4];
        for i in 0..64 {
            let [x, y] = sampler.position([10, 20], i);
            assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
            counts[usize::from(x >= 0.5) + 2 * usize::from(y >= 0.5)] += 1;
        }
        assert_eq!(counts, [16; 4]);
    }

    #[test]
    fn neighbours_and_seeds_differ() {
        let at = |seed, pixel| Sampler::new(16, seed).unwrap().position(pixel, 5);
        assert_ne!(at(0, [0, 0]), at(0, [1, 0]));
        assert_ne!(at(0, [0, 0]), at(1, [0, 0]));
    }

    #[test]
    fn impossible_counts_are_refused() {
        assert!(Sampler::new(0, 0).is_err() && Sampler::new(MAX_SAMPLES + 1, 0).is_err());
    }
}
