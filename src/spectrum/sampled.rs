//! Values at the wavelengths of a path: what radiometry is computed with, in f32.
//!
//! A path carries a *hero* wavelength, which decides where it goes, and *companions* (A. Wilkie et al., "Hero wavelength
//! spectral sampling", EGSR 2014). Lane 0 is the hero. The number of lanes is a type parameter: [`LANES`] for paths, 1 for
//! the one-wavelength truth beside them.

use std::ops::{Add, AddAssign, Index, IndexMut, Mul, MulAssign, Sub};

use super::Wavelength;

/// Wavelengths that a path carries.
pub const LANES: usize = 4;

/// Values at the wavelengths of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledSpectrum<const N: usize>(pub [f32; N]);

impl<const N: usize> SampledSpectrum<N> {
    /// 0 at every wavelength.
    pub const ZERO: Self = Self([0.0; N]);
    /// 1 at every wavelength.
    pub const ONE: Self = Self([1.0; N]);

    /// The same value everywhere.
    #[inline]
    pub const fn splat(value: f32) -> Self {
        Self([value; N])
    }

    /// The value of lane i is `f(i)`.
    #[inline]
    pub fn from_fn(f: impl FnMut(usize) -> f32) -> Self {
        Self(std::array::from_fn(f))
    }

    /// `f` of every value.
    #[inline]
    pub fn map(self, f: impl FnMut(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }

    /// `f` of the values of both, lane by lane.
    #[inline]
    pub fn zip(self, other: Self, mut f: impl FnMut(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    /// The value at the hero wavelength.
    #[inline]
    pub fn hero(&self) -> f32 {
        self.0[0]
    }

    /// Sum over the lanes.
    #[inline]
    pub fn sum(&self) -> f32 {
        self.0.iter().sum()
    }

    /// Mean over the lanes.
    #[inline]
    pub fn mean(&self) -> f32 {
        self.sum() / N as f32
    }

    /// The greatest value.
    #[inline]
    pub fn max_element(&self) -> f32 {
        self.0.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }

    /// Whether no lane is different from 0.
    #[inline]
    pub fn is_black(&self) -> bool {
        self.0.iter().all(|&value| value == 0.0)
    }

    /// Whether every lane is finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }

    /// Quotients, 0 where the divisor is 0.
    #[inline]
    pub fn safe_div(self, divisor: Self) -> Self {
        self.zip(divisor, |a, b| if b == 0.0 { 0.0 } else { a / b })
    }

    /// (1 − t) self + t other.
    #[inline]
    pub fn lerp(self, other: Self, t: f32) -> Self {
        self.zip(other, |a, b| a * (1.0 - t) + b * t)
    }
}

impl<const N: usize> Default for SampledSpectrum<N> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<const N: usize> Index<usize> for SampledSpectrum<N> {
    type Output = f32;
    #[inline]
    fn index(&self, lane: usize) -> &f32 {
        &self.0[lane]
    }
}

impl<const N: usize> IndexMut<usize> for SampledSpectrum<N> {
    #[inline]
    fn index_mut(&mut self, lane: usize) -> &mut f32 {
        &mut self.0[lane]
    }
}

impl<const N: usize> Add for SampledSpectrum<N> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<const N: usize> AddAssign for SampledSpectrum<N> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> Sub for SampledSpectrum<N> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<const N: usize> Mul for SampledSpectrum<N> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<const N: usize> Mul<f32> for SampledSpectrum<N> {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        self.map(|value| value * factor)
    }
}

impl<const N: usize> MulAssign for SampledSpectrum<N> {
    #[inline]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<const N: usize> MulAssign<f32> for SampledSpectrum<N> {
    #[inline]
    fn mul_assign(&mut self, factor: f32) {
        *self = *self * factor;
    }
}

/// The wavelengths of a path with the densities that they were drawn with; made by [`super::visible`] only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelengths<const N: usize> {
    pub(super) nanometers: [f64; N],
    /// Per nm.
    pub(super) pdf_lambda: [f32; N],
}

impl<const N: usize> Wavelengths<N> {
    /// The hero, which decides where the path goes.
    #[inline]
    pub fn hero(&self) -> Wavelength {
        self.lane(0)
    }

    /// The wavelength of a lane.
    #[inline]
    pub fn lane(&self, lane: usize) -> Wavelength {
        Wavelength::from_nanometers(self.nanometers[lane])
    }

    /// The wavelengths, nm.
    #[inline]
    pub fn nanometers(&self) -> &[f64; N] {
        &self.nanometers
    }

    /// The densities, per nm. The estimator of ∫ f dλ is the mean over the lanes of f/p.
    #[inline]
    pub fn pdf_lambda(&self) -> SampledSpectrum<N> {
        SampledSpectrum(self.pdf_lambda)
    }
}
