//! Numbers, estimates and statistics for the tests.

use glam::Vec3;

use crate::bsdf::{Bsdf, Scattered};

/// A small generator with a fixed start (splitmix64).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A direction with this cosine to the normal, off the axes.
pub(super) fn direction(cos: f32) -> Vec3 {
    let sine = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(sine * 0.8, sine * 0.6, cos)
}

/// An estimate with its standard error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub(super) mean: f64,
    pub(super) error: f64,
}

/// What a surface sends back to `wo`, at the hero wavelength, of light that is 1 on this side and `beyond` on the other. The points are
/// those of the additive recurrence of the plastic number (R3), each of 16 sets shifted at random: their spread is the error.
pub(super) fn furnace<const N: usize>(bsdf: &Bsdf<N>, wo: Vec3, beyond: f32, samples: usize) -> Estimate {
    const SETS: usize = 16;
    const G: f64 = 1.220_744_084_605_759_5;
    let steps = [1.0 / G, 1.0 / (G * G), 1.0 / (G * G * G)];
    let mut random = Random(7);
    let mut means = [0.0; SETS];
    for mean in &mut means {
        let shift: [f64; 3] = std::array::from_fn(|_| f64::from(random.next()));
        for i in 0..samples / SETS {
            let u: [f32; 3] =
                std::array::from_fn(|k| ((shift[k] + steps[k] * i as f64).fract() as f32).min(1.0 - f32::EPSILON));
            if let Some(sample) = bsdf.sample(wo, u[0], [u[1], u[2]]) {
                let through = match sample.scattered {
                    Scattered::Toward(wi) => wi.z < 0.0,
                    Scattered::Mirror => false,
                    Scattered::Refract | Scattered::Straight => true,
                };
                *mean += f64::from(sample.weight.hero() * if through { beyond } else { 1.0 });
            }
        }
        *mean /= (samples / SETS) as f64;
    }
    let mean = means.iter().sum::<f64>() / SETS as f64;
    let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (SETS * (SETS - 1)) as f64;
    Estimate { mean, error: variance.sqrt() }
}
