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

/// What a surface sends back to `wo`, at the hero wavelength, of light that is 1 on this side and `beyond` on the other; from 16
/// independent scramblings of Sobol' points, whose spread is the error. `samples` is a power of two.
pub(super) fn furnace<const N: usize>(bsdf: &Bsdf<N>, wo: Vec3, beyond: f32, samples: u32) -> Estimate {
    const SETS: u32 = 16;
    let mut means = [0.0; SETS as usize];
    for (set, mean) in means.iter_mut().enumerate() {
        for i in 0..samples / SETS {
            let u = [0, 1, 2].map(|dimension| sobol_burley::sample(i, dimension, set as u32));
            if let Some(sample) = bsdf.sample(wo, u[0], [u[1], u[2]]) {
                let through = match sample.scattered {
                    Scattered::Toward(wi) => wi.z < 0.0,
                    Scattered::Mirror => false,
                    Scattered::Refract | Scattered::Straight => true,
                };
                *mean += f64::from(sample.weight.hero() * if through { beyond } else { 1.0 });
            }
        }
        *mean /= f64::from(samples / SETS);
    }
    let sets = f64::from(SETS);
    let mean = means.iter().sum::<f64>() / sets;
    let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (sets * (sets - 1.0));
    Estimate { mean, error: variance.sqrt() }
}

/// Upper tail of the χ² distribution: Q(k/2, x/2) by the continued fraction or the series (Numerical Recipes, §6.2).
pub(super) fn chi_squared_tail(x: f64, degrees: usize) -> f64 {
    let (a, x) = (0.5 * degrees as f64, 0.5 * x);
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-16 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let an = -(i as f64) * (i as f64 - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// Cells of the sphere for histograms: cosine by azimuth.
const COSINES: usize = 24;
const AZIMUTHS: usize = 32;

/// What directions drawn are expected to be, and are.
pub(super) struct Histogram {
    /// Σ pdf dω over each cell.
    expected: Vec<f64>,
    drawn: Vec<f64>,
    samples: usize,
}

impl Histogram {
    /// Draws `samples` directions; the densities are those of the hero.
    pub(super) fn new<const N: usize>(bsdf: &Bsdf<N>, wo: Vec3, samples: usize) -> Self {
        const FINE: usize = 16;
        let mut expected = vec![0.0; COSINES * AZIMUTHS];
        for (cell, sum) in expected.iter_mut().enumerate() {
            for i in 0..FINE {
                for j in 0..FINE {
                    let z = ((cell / AZIMUTHS) as f64 + (i as f64 + 0.5) / FINE as f64) / COSINES as f64 * 2.0 - 1.0;
                    let turn = ((cell % AZIMUTHS) as f64 + (j as f64 + 0.5) / FINE as f64) / AZIMUTHS as f64;
                    let phi = 2.0 * std::f64::consts::PI * turn;
                    let sine = (1.0 - z * z).sqrt();
                    let wi = Vec3::new((sine * phi.cos()) as f32, (sine * phi.sin()) as f32, z as f32);
                    *sum += f64::from(bsdf.evaluate(wo, wi).pdf.hero());
                }
            }
            *sum *= 4.0 * std::f64::consts::PI / (COSINES * AZIMUTHS * FINE * FINE) as f64;
        }
        let mut drawn = vec![0.0; COSINES * AZIMUTHS];
        let mut random = Random(11);
        for _ in 0..samples {
            let (u, v) = (random.next(), [random.next(), random.next()]);
            let Some(sample) = bsdf.sample(wo, u, v) else { continue };
            if let Scattered::Toward(wi) = sample.scattered {
                let row = ((f64::from(wi.z) + 1.0) * 0.5 * COSINES as f64) as usize;
                let turn = f64::from(wi.y).atan2(f64::from(wi.x)) / (2.0 * std::f64::consts::PI);
                let column = (turn.rem_euclid(1.0) * AZIMUTHS as f64) as usize;
                drawn[row.min(COSINES - 1) * AZIMUTHS + column.min(AZIMUTHS - 1)] += 1.0;
            }
        }
        Self { expected, drawn, samples }
    }

    /// ∫ pdf dω.
    pub(super) fn total(&self) -> f64 {
        self.expected.iter().sum()
    }

    /// Part of the samples that are directions.
    pub(super) fn drawn(&self) -> f64 {
        self.drawn.iter().sum::<f64>() / self.samples as f64
    }

    /// Probability that χ² is as great as it is or greater; cells that expect few are one.
    pub(super) fn p_value(&self) -> f64 {
        let (mut chi_squared, mut cells) = (0.0, 0);
        let mut add = |expected: f64, drawn: f64| {
            chi_squared += (drawn - expected) * (drawn - expected) / expected;
            cells += 1;
        };
        let (mut rest_expected, mut rest_drawn) = (0.0, 0.0);
        for (expected, drawn) in self.expected.iter().zip(&self.drawn) {
            let expected = expected * self.samples as f64;
            if expected >= 10.0 {
                add(expected, *drawn);
            } else {
                rest_expected += expected;
                rest_drawn += drawn;
            }
        }
        // What is not a direction: absorbed, or drawn from a smooth lobe.
        rest_expected += (1.0 - self.total()) * self.samples as f64;
        rest_drawn += (1.0 - self.drawn()) * self.samples as f64;
        if rest_expected >= 10.0 {
            add(rest_expected, rest_drawn);
        }
        chi_squared_tail(chi_squared, cells - 1)
    }
}
