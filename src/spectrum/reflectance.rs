//! From a colour of a surface to its reflectance at every wavelength.
//!
//! S(λ) = ½ + x / (2√(1 + x²)) with a parabola x in λ (W. Jakob, J. Hanika, "A low-dimensional function space for efficient
//! spectral upsampling", CGF 38(2), 2019): smooth, within 0 and 1, three numbers for three channels. A colour is linear
//! Rec. 709 under D65: channel i is ∫ S D65 rᵢ dλ / ∫ D65 rᵢ dλ, so that S = 1 is (1, 1, 1).
//!
//! Solving for the parabola takes a tenth of a millisecond, which is well for constants ([`Reflectance::exact`]). For textures their
//! table of coefficients is tabulated here, with another rule of interpolation: not the coefficients of the nodes about a colour are
//! averaged, but their *spectra*. Along each axis of the table the colour is linear in the place, so the colour of that average is the
//! colour asked for, however coarse the table; averaged coefficients miss it by 1e-2 near the edge of the gamut. A grey is an
//! average of greys, constant like them.

use std::sync::LazyLock;

use glam::DVec3;

use super::Wavelength;
use super::fit::{Curve, Fit, inverse_sigmoid, sigmoid, sigmoid_slope};
use super::sampled::{SampledSpectrum, Wavelengths};

/// A smooth reflectance within 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectance {
    form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// The same at every wavelength.
    Constant(f32),
    /// The sigmoid of c₀ + c₁u + c₂u², u = −1 at 360 nm to 1 at 830 nm.
    Sigmoid([f32; 3]),
    /// The mean of the spectra of a cell's corners: the index of its first node, and how far the colour is along x, y, z.
    Cell { first: u32, place: [f32; 3] },
}

/// Nodes along x and y: the other channels over the largest, in steps of 1/(N − 1).
pub const NODES: usize = 24;
/// Nodes along z: the largest channel, dense towards 0 and 1 ([`level`]).
pub const LEVELS: usize = 16;

/// The coefficients of every node: for each channel that can be the largest (R, G, B), z by z, y by y, x by x; x is the channel after
/// it, y the one after that. Made by `examples/reflectance_table.rs`.
static TABLE: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let bytes = include_bytes!("reflectance.bin").as_chunks::<4>().0;
    bytes.as_chunks::<3>().0.iter().map(|node| node.map(f32::from_le_bytes)).collect()
});

/// The largest channel at node `k` of z: smoothstep, as Jakob and Hanika have it (once; their table is finer).
pub fn level(k: usize) -> f64 {
    let t = k as f64 / (LEVELS - 1) as f64;
    t * t * (3.0 - 2.0 * t)
}

/// S and its slope.
fn curve(x: f64) -> Curve {
    Curve { value: sigmoid(x), slope: sigmoid_slope(x) }
}

/// The coefficients of the spectrum of `rgb`, each channel within 0..=1; infinite for black and white.
pub fn coefficients(rgb: [f64; 3]) -> [f64; 3] {
    let color = DVec3::from(rgb);
    let mean = color.element_sum() / 3.0;
    if color.max_element() - color.min_element() <= 0.0 {
        return [inverse_sigmoid(color.x), 0.0, 0.0];
    }
    type Sigmoids = Fit<fn(f64) -> Curve>;
    static FIT: LazyLock<Sigmoids> = LazyLock::new(|| Fit::new(curve));
    FIT.solve(color, inverse_sigmoid(mean)).into()
}

impl Reflectance {
    /// The same at every wavelength, 0..=1 (clamped to it).
    pub fn constant(value: f32) -> Self {
        Self { form: Form::Constant(clamped(value)) }
    }

    /// Of the colour `rgb`, linear Rec. 709 under D65, within 0..=1 (clamped to it; NaN is 0). By the table: some nanoseconds.
    #[inline]
    pub fn of_color(rgb: [f32; 3]) -> Self {
        let rgb = rgb.map(clamped);
        let [r, g, b] = rgb;
        let largest = if r >= g && r >= b { 0 } else { usize::from(g < b) + 1 };
        let z = rgb[largest];
        let (x, y) = (rgb[(largest + 1) % 3], rgb[(largest + 2) % 3]);
        if (x - z).abs() + (y - z).abs() <= 0.0 {
            return Self { form: Form::Constant(z) };
        }
        let steps = (NODES - 1) as f32;
        let along = |ratio: f32| {
            let place = ratio * steps;
            let node = (place as usize).min(NODES - 2);
            (node, place - node as f32)
        };
        let ((i, x), (j, y)) = (along(x / z), along(y / z));
        let (k, z) = level_place(z);
        let first = ((largest * LEVELS + k) * NODES + j) * NODES + i;
        Self { form: Form::Cell { first: first as u32, place: [x, y, z] } }
    }

    /// Of the colour `rgb` as [`of_color`](Self::of_color), by a solution of its own: for constants.
    pub fn exact(rgb: [f64; 3]) -> Self {
        let rgb = rgb.map(|channel| if channel > 0.0 { channel.min(1.0) } else { 0.0 });
        if rgb[0].to_bits() == rgb[1].to_bits() && rgb[1].to_bits() == rgb[2].to_bits() {
            return Self::constant(rgb[0] as f32);
        }
        Self { form: Form::Sigmoid(coefficients(rgb).map(|c| c as f32)) }
    }

    /// At one wavelength.
    pub fn at_wavelength(&self, wavelength: Wavelength) -> f32 {
        self.at(&Wavelengths::<1> { nanometers: [wavelength.nanometers()], pdf_lambda: [1.0] })[0]
    }

    /// At the wavelengths of a path.
    #[inline]
    pub fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        let u = || SampledSpectrum::from_fn(|lane| ((wavelengths.nanometers()[lane] - 595.0) / 235.0) as f32);
        match self.form {
            Form::Constant(value) => SampledSpectrum::splat(value),
            Form::Sigmoid(coefficients) => u().map(|u| sigmoid_of(coefficients, u)),
            Form::Cell { first, place: [x, y, z] } => {
                let u = u();
                let table = &TABLE[first as usize..];
                let mut sum = SampledSpectrum::ZERO;
                for (k, weight_z) in [(0, 1.0 - z), (NODES * NODES, z)] {
                    for (j, weight_y) in [(0, 1.0 - y), (NODES, y)] {
                        for (i, weight_x) in [(0, 1.0 - x), (1, x)] {
                            let (node, weight) = (table[k + j + i], weight_x * weight_y * weight_z);
                            sum += u.map(|u| weight * sigmoid_of(node, u));
                        }
                    }
                }
                sum
            }
        }
    }
}

/// The colour as (a multiple of) a reflectance: what an emission or anything else without an upper bound is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unbounded {
    /// The largest channel, doubled: the reflectance then stays off 1, where spectra are steep.
    pub scale: f32,
    /// The shape.
    pub shape: Reflectance,
}

impl Unbounded {
    /// Of `rgb` ≥ 0 (clamped to it), linear Rec. 709 of the quotient with an illuminant; exactly constant for greys.
    pub fn exact(rgb: [f64; 3]) -> Self {
        let rgb = rgb.map(|channel| if channel > 0.0 { channel } else { 0.0 });
        let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
        if scale <= 0.0 || !scale.is_finite() {
            return Self { scale: 0.0, shape: Reflectance::constant(0.0) };
        }
        Self { scale: scale as f32, shape: Reflectance::exact(rgb.map(|channel| channel / scale)) }
    }

    /// The same by the table: for textures.
    #[inline]
    pub fn of_color(rgb: [f32; 3]) -> Self {
        let rgb = rgb.map(|channel| if channel > 0.0 { channel } else { 0.0 });
        let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
        if scale <= 0.0 || !scale.is_finite() {
            return Self { scale: 0.0, shape: Reflectance::constant(0.0) };
        }
        Self { scale, shape: Reflectance::of_color(rgb.map(|channel| channel / scale)) }
    }

    /// At the wavelengths of a path: to be multiplied by an illuminant.
    #[inline]
    pub fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        self.shape.at(wavelengths) * self.scale
    }
}

/// Within 0..=1; NaN is 0.
#[inline]
fn clamped(channel: f32) -> f32 {
    if channel > 0.0 { channel.min(1.0) } else { 0.0 }
}

/// The cell of z and the place in it.
#[inline]
fn level_place(z: f32) -> (usize, f32) {
    static LEVEL: LazyLock<[f32; LEVELS]> = LazyLock::new(|| std::array::from_fn(|k| level(k) as f32));
    let levels = &*LEVEL;
    let k = levels[1..LEVELS - 1].partition_point(|&level| level <= z);
    (k, (z - levels[k]) / (levels[k + 1] - levels[k]))
}

/// S of c₀ + c₁u + c₂u², within 0..=1 to full precision at both ends; c₀ may be infinite if the others are 0.
#[inline]
fn sigmoid_of([c0, c1, c2]: [f32; 3], u: f32) -> f32 {
    let x = c0 + u * (c1 + u * c2);
    let root = (1.0 + x * x).sqrt();
    let tail = 0.5 / (root * (root + x.abs()));
    if x < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{illuminant, sensor, visible};

    fn at(reflectance: &Reflectance, nanometers: f64) -> f64 {
        reflectance.at_wavelength(Wavelength::from_nanometers(nanometers)).into()
    }

    /// The colour by an integration of its own, in steps of 0.2 nm.
    fn color(reflectance: &Reflectance) -> DVec3 {
        let (mut sum, mut white) = (DVec3::ZERO, DVec3::ZERO);
        for step in 0..2350 {
            let nm = 360.1 + 0.2 * f64::from(step);
            let wavelength = Wavelength::from_nanometers(nm);
            let weight = sensor::rec709(wavelength) * illuminant::d65(wavelength);
            sum += weight * at(reflectance, nm);
            white += weight;
        }
        sum / white
    }

    fn grid(levels: &[f32]) -> Vec<[f32; 3]> {
        let mut colors = Vec::new();
        for &r in levels {
            for &g in levels {
                colors.extend(levels.iter().map(|&b| [r, g, b]));
            }
        }
        colors
    }

    #[test]
    fn colors_return_from_the_table_and_from_solutions() {
        for rgb in grid(&[0.0, 0.004, 0.1, 0.37, 0.62, 0.93, 1.0]) {
            for reflectance in [Reflectance::of_color(rgb), Reflectance::exact(rgb.map(f64::from))] {
                let error = (color(&reflectance) - DVec3::from(rgb.map(f64::from))).abs().max_element();
                // Measured 3e-6: the quadrature of the fit against the one here.
                assert!(error < 1e-5, "{rgb:?}: {error}");
            }
        }
    }

    #[test]
    fn the_table_is_what_the_solver_gives() {
        for (largest, k, j, i) in [(0, 1, 3, 4), (1, 8, 0, 20), (2, 14, 11, 2), (1, 15, 23, 23), (0, 0, 5, 5)] {
            let (z, ratio) = (level(k), |n: usize| n as f64 / (NODES - 1) as f64);
            let mut rgb = [z; 3];
            rgb[(largest + 1) % 3] = z * ratio(i);
            rgb[(largest + 2) % 3] = z * ratio(j);
            let node = TABLE[((largest * LEVELS + k) * NODES + j) * NODES + i];
            for (stored, solved) in node.into_iter().zip(coefficients(rgb)) {
                let close = (f64::from(stored) - solved).abs() <= 1e-5 * solved.abs();
                assert!(close || stored.is_infinite() && solved.is_infinite(), "{rgb:?}: {stored} {solved}");
            }
        }
        assert_eq!(TABLE.len(), 3 * LEVELS * NODES * NODES);
    }

    #[test]
    fn greys_are_constant_black_is_zero_and_white_is_one() {
        let wavelengths = visible::sample::<8>(0.1);
        for grey in [0.0, 1e-30, 1e-4, 0.3, 0.999, 1.0] {
            for reflectance in [Reflectance::of_color([grey; 3]), Reflectance::exact([f64::from(grey); 3])] {
                assert_eq!(reflectance.at(&wavelengths), SampledSpectrum::splat(grey));
            }
            let emission = Unbounded::of_color([grey * 50.0; 3]).at(&wavelengths);
            assert!(emission.0.iter().all(|value| (value - grey * 50.0).abs() <= 1e-6 * grey * 50.0));
        }
    }

    #[test]
    fn near_greys_are_near_constant() {
        let wavelengths = visible::sample::<8>(0.1);
        for tiny in [1e-3, 1e-5, 1e-7] {
            for reflectance in [
                Reflectance::of_color([0.5, 0.5 + tiny, 0.5 - tiny]),
                Reflectance::exact([0.5, 0.5 + f64::from(tiny), 0.5 - f64::from(tiny)]),
            ] {
                let values = reflectance.at(&wavelengths);
                assert!(values.0.iter().all(|value| (value - 0.5).abs() < 50.0 * tiny + 1e-6), "{tiny}: {values:?}");
            }
        }
    }

    #[test]
    fn all_stay_within_zero_and_one() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e-40, 0.0, 0.5, 1.0 - 6e-8, 1.0, 7.0];
        let wavelengths = visible::sample::<8>(0.05);
        for rgb in grid(&odd) {
            for reflectance in [Reflectance::of_color(rgb), Reflectance::exact(rgb.map(f64::from))] {
                let values = reflectance.at(&wavelengths);
                assert!(
                    values.0.iter().all(|value| (0.0..=1.0 + 4.0 * f32::EPSILON).contains(value)),
                    "{rgb:?}: {values:?}"
                );
            }
            assert!(Unbounded::of_color(rgb).at(&wavelengths).is_finite(), "{rgb:?}");
            assert!(Unbounded::exact(rgb.map(f64::from)).at(&wavelengths).is_finite(), "{rgb:?}");
        }
    }

    #[test]
    fn spectra_follow_their_colors_without_a_jump() {
        // Across the faces on which another channel becomes the largest, and across the table's cells.
        let wavelengths = visible::sample::<8>(0.0);
        for step in 0..2000 {
            let t = step as f32 / 2000.0;
            let path =
                |t: f32| Reflectance::of_color([0.1 + 0.8 * t, 0.9 - 0.7 * t, 0.3 + 0.5 * (6.0 * t).sin().abs()]);
            let (here, next) = (path(t).at(&wavelengths), path(t + 1.0 / 2000.0).at(&wavelengths));
            assert!((0..8).all(|lane| (here[lane] - next[lane]).abs() < 0.02), "{t}: {here:?} {next:?}");
        }
    }

    #[test]
    fn emissions_have_their_colors() {
        for rgb in [[3.0, 0.5, 0.1], [100.0, 90.0, 0.0], [0.0, 0.0, 1e-3], [1.0, 1.0, 1.0]] {
            for Unbounded { scale, shape } in [Unbounded::of_color(rgb), Unbounded::exact(rgb.map(f64::from))] {
                let error = color(&shape) * f64::from(scale) - DVec3::from(rgb.map(f64::from));
                assert!(error.abs().max_element() < 1e-5 * f64::from(scale), "{rgb:?}: {error}");
            }
        }
    }
}
