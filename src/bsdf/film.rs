//! Reflectance of an interface with a thin film: Airy's sum over the reflections within it, at each wavelength, without averages.
//!
//! With the amplitudes r₁₂ at the top of the film, r₂₃ at its bottom, and the phase 2β = (4π/λ) d n_f cos θ_f,
//! r = (r₁₂ + r₂₃ e^{2iβ}) / (1 + r₁₂ r₂₃ e^{2iβ}) for each polarisation (Born & Wolf 1999, §1.6.4, eq. 55–57; time factor
//! e^{−iωt}, so that absorption is k > 0). Indices are relative to the side of the incident ray; what refracts is
//! q = N cos θ = √(N² − sin² θ_i), which is imaginary where the film or the base reflects totally.

use super::{Film, Parameters};
use crate::spectrum::SampledSpectrum;

/// A film between two media.
#[derive(Clone, Copy, Debug)]
pub(super) struct FilmStack<const N: usize> {
    weight: f32,
    /// Relative index of the film.
    film: SampledSpectrum<N>,
    /// Relative index of what is below, n + ik.
    base_n: SampledSpectrum<N>,
    base_k: SampledSpectrum<N>,
    /// 4π d ior_i / λ: times q of the film it is the phase 2β.
    phase: SampledSpectrum<N>,
}

impl<const N: usize> FilmStack<N> {
    /// The film of `parameters` over a base of this relative index; `None` where there is none.
    pub(super) fn new(
        parameters: &Parameters<N>,
        base_n: SampledSpectrum<N>,
        base_k: SampledSpectrum<N>,
    ) -> Option<Self> {
        let Film { weight, thickness_nm, ior, nanometers } = parameters.film?;
        if !(weight > 0.0 && thickness_nm > 0.0 && ior > 0.0) {
            return None;
        }
        let outside = parameters.interface.ior_i;
        Some(Self {
            weight: weight.min(1.0),
            film: outside.map(|o| ior / o),
            base_n,
            base_k,
            phase: outside.zip(nanometers, |o, nm| 4.0 * std::f32::consts::PI * thickness_nm * o / nm),
        })
    }

    /// Share of the surface that has it.
    #[inline]
    pub(super) fn weight(&self) -> f32 {
        self.weight
    }

    /// Reflectance at every wavelength.
    #[inline]
    pub(super) fn at(&self, cos_i: f32) -> SampledSpectrum<N> {
        SampledSpectrum::from_fn(|i| {
            airy(cos_i, self.film[i], Complex::new(self.base_n[i], self.base_k[i]), self.phase[i])
        })
    }
}

/// Reflectance for unpolarised light of a film of relative index `film` on a base of relative index `base`.
fn airy(cos_i: f32, film: f32, base: Complex, phase: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let sin2 = 1.0 - cos_i * cos_i;
    let film_squared = Complex::new(film * film, 0.0);
    let base_squared = base * base;
    let q1 = Complex::new(cos_i, 0.0);
    let q2 = (film_squared - Complex::new(sin2, 0.0)).sqrt();
    let q3 = (base_squared - Complex::new(sin2, 0.0)).sqrt();
    // e^{2iβ}
    let damping = libm::expf(-phase * q2.im);
    let turn = Complex::new(damping * libm::cosf(phase * q2.re), damping * libm::sinf(phase * q2.re));
    let total = |r12: Complex, r23: Complex| {
        let back = r23 * turn;
        ((r12 + back) / (Complex::ONE + r12 * back)).norm_squared()
    };
    let s = total((q1 - q2) / (q1 + q2), (q2 - q3) / (q2 + q3));
    let p = total(
        (film_squared * q1 - q2) / (film_squared * q1 + q2),
        (base_squared * q2 - film_squared * q3) / (base_squared * q2 + film_squared * q3),
    );
    // At grazing incidence on an index-matched film 0/0 can occur; there everything is reflected.
    let r = 0.5 * (s + p);
    if r.is_finite() { r.clamp(0.0, 1.0) } else { 1.0 }
}

/// As much of complex numbers as films need.
#[derive(Clone, Copy, Debug)]
struct Complex {
    re: f32,
    im: f32,
}

impl Complex {
    const ONE: Self = Self { re: 1.0, im: 0.0 };

    fn new(re: f32, im: f32) -> Self {
        Self { re, im }
    }

    fn norm_squared(self) -> f32 {
        self.re * self.re + self.im * self.im
    }

    /// The root with Im ≥ 0: waves that decay into the medium.
    fn sqrt(self) -> Self {
        let modulus = self.norm_squared().sqrt();
        let re = (0.5 * (modulus + self.re)).max(0.0).sqrt();
        let im = (0.5 * (modulus - self.re)).max(0.0).sqrt();
        Self { re: if self.im < 0.0 { -re } else { re }, im }
    }
}

impl std::ops::Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl std::ops::Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl std::ops::Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)
    }
}

impl std::ops::Div for Complex {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let scale = 1.0 / other.norm_squared();
        Self::new((self.re * other.re + self.im * other.im) * scale, (self.im * other.re - self.re * other.im) * scale)
    }
}
