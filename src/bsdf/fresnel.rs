//! What part of the light an interface reflects: Fresnel's equations for dielectrics and metals, with Airy's for a thin film
//! over them ([`super::film`]); Schlick's where a material asks for it.
//!
//! All are for unpolarised light and take the cosine on the side of the incident ray, of the acute angle. `eta_ti` is the
//! relative index ior_t / ior_i.
//!
//! Sources: M. Born & E. Wolf, *Principles of Optics*, 7th ed. 1999, §1.5.2 (dielectrics), §14.2 (metals);
//! C. Schlick, EGSR 1994; P. Kutz, M. Hašan & D. Edmondson, "Novel
//! aspects of the Adobe Standard Material", 2021 (F82 tint); J. W. T. Walsh 1926 (mean reflectance of a dielectric).

use super::film::FilmStack;
use super::{Metal, Parameters};
use crate::spectrum::SampledSpectrum;

/// Reflectance of a dielectric interface; 1 on total reflection.
#[inline]
pub(super) fn dielectric(cos_i: f32, eta_ti: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    // cos_t² = 1 − sin_i²/η², written as (η² − 1 + cos_i²)/η² so that nearly equal indices do not cancel.
    let inside = (eta_ti - 1.0) * (eta_ti + 1.0) + cos_i * cos_i;
    if inside <= 0.0 {
        return 1.0;
    }
    // η cos_t
    let w = inside.sqrt();
    let eta_squared = eta_ti * eta_ti;
    let s = (cos_i - w) / (cos_i + w);
    let p = (eta_squared * cos_i - w) / (eta_squared * cos_i + w);
    0.5 * (s * s + p * p)
}

/// Mean reflectance of a dielectric for diffuse light, F_avg = 2 ∫ F(μ) μ dμ, in closed form.
///
/// Walsh's formula for light that comes from the rarer side (η ≥ 1); from the denser one by the reciprocity of transmission,
/// (1 − F_avg(1/η)) = (1 − F_avg(η)) / η².
pub(super) fn dielectric_mean(eta_ti: f32) -> f32 {
    let eta = f64::from(eta_ti);
    if eta < 1.0 {
        return (1.0 - (1.0 - mean_from_rarer(1.0 / eta)) * eta * eta) as f32;
    }
    mean_from_rarer(eta) as f32
}

fn mean_from_rarer(n: f64) -> f64 {
    // Near 1 the terms of Walsh's formula cancel (n⁴ − 1 stands squared below); there F_avg falls to 0 with a slope ∝ (n − 1),
    // and its series is exact to 1e-6: F = 2(n−1)/3 − …; taken from the formula at the border by the same law.
    const BORDER: f64 = 1.001;
    if n < BORDER {
        return mean_from_rarer(BORDER) * (n - 1.0) / (BORDER - 1.0);
    }
    let n2 = n * n;
    let n4 = n2 * n2;
    let sum = n2 + 1.0;
    let difference = n4 - 1.0;
    0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) * (n + 1.0))
        + n2 * (n2 - 1.0) * (n2 - 1.0) / (sum * sum * sum) * libm::log((n - 1.0) / (n + 1.0))
        - 2.0 * n2 * n * (n2 + 2.0 * n - 1.0) / (sum * difference)
        + 8.0 * n4 * (n4 + 1.0) / (sum * difference * difference) * libm::log(n)
}

/// Reflectance of a metal of relative complex index `n` + i `k`.
#[inline]
pub(super) fn conductor(cos_i: f32, n: f32, k: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let cos2 = cos_i * cos_i;
    let sin2 = 1.0 - cos2;
    let (n2, k2) = (n * n, k * k);
    let t0 = n2 - k2 - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * n2 * k2).sqrt();
    let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
    let t1 = a2_plus_b2 + cos2;
    let t2 = 2.0 * a * cos_i;
    let s = (t1 - t2) / (t1 + t2);
    let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
    let t4 = t2 * sin2;
    let denominator = t3 + t4;
    let p = if denominator > 0.0 { s * (t3 - t4) / denominator } else { s };
    (0.5 * (s + p)).clamp(0.0, 1.0)
}

/// (1 − μ)⁵.
#[inline]
pub(super) fn schlick_rise(cos_i: f32) -> f32 {
    let m = (1.0 - cos_i).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// μ̄ = 1/7 is the cosine at which the tint of [`Metal::Tint`] is stated (82°).
const TINT_COSINE: f32 = 1.0 / 7.0;

/// Coefficient a of F(μ) = F0 + (1 − F0)(1 − μ)⁵ − a μ(1 − μ)⁶, such that F(1/7) is Schlick's times the tint.
#[inline]
fn tint_coefficient(f0: f32, f82: f32) -> f32 {
    let m = 1.0 - TINT_COSINE;
    let m5 = schlick_rise(TINT_COSINE);
    (f0 + (1.0 - f0) * m5) * (1.0 - f82) / (TINT_COSINE * m5 * m)
}

/// Reflectance by F0 and the tint at 82°.
#[inline]
fn tinted(cos_i: f32, f0: f32, coefficient: f32) -> f32 {
    let rise = schlick_rise(cos_i);
    (f0 + (1.0 - f0) * rise - coefficient * cos_i * (1.0 - cos_i) * rise).clamp(0.0, 1.0)
}

/// Index ratio with the reflectance at normal incidence scaled by `weight` (OpenPBR 1.1, "specular weight"):
/// ε = sgn(η − 1) √(weight F0), η′ = (1 + ε)/(1 − ε).
pub(super) fn weighted_eta(eta_ti: f32, weight: f32) -> f32 {
    if (weight - 1.0).abs() < f32::EPSILON {
        return eta_ti;
    }
    let epsilon = weight.max(0.0).sqrt() * (eta_ti - 1.0) / (eta_ti + 1.0);
    // F0 stays below 1.
    let epsilon = epsilon.clamp(-0.999, 0.999);
    (1.0 + epsilon) / (1.0 - epsilon)
}

/// A film needs an index; a metal of n = (1 + √F0)/(1 − √F0), k = 0 has this F0 (as Belcour & Barla do).
fn index_of_f0<const N: usize>(f0: SampledSpectrum<N>) -> SampledSpectrum<N> {
    f0.map(|f| {
        let root = f.min(0.9999).sqrt();
        (1.0 + root) / (1.0 - root)
    })
}

/// The law by which an interface reflects.
#[derive(Clone, Copy, Debug)]
pub(super) enum Law<const N: usize> {
    /// Dielectric; the same index ratio in all lanes.
    Uniform(f32),
    /// Dielectric that disperses.
    Dielectric(SampledSpectrum<N>),
    /// Schlick's from F0 to white.
    Schlick(SampledSpectrum<N>),
    /// F0 and the coefficient of the tint at 82°.
    Tint(SampledSpectrum<N>, SampledSpectrum<N>),
    /// The same at every angle.
    Constant(SampledSpectrum<N>),
    /// Metal of relative index n + ik.
    Conductor(SampledSpectrum<N>, SampledSpectrum<N>),
}

/// The reflectance of an interface, with its film.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fresnel<const N: usize> {
    law: Law<N>,
    film: Option<FilmStack<N>>,
}

impl<const N: usize> Fresnel<N> {
    /// Of a dielectric of this ratio of indices.
    pub(super) fn uniform(eta_ti: f32) -> Self {
        Self { law: Law::Uniform(eta_ti), film: None }
    }

    /// Of a dielectric without a film; `uniform` says whether the ratio of indices is the same in all lanes.
    #[inline]
    pub(super) fn of_ratio(ratio: SampledSpectrum<N>, uniform: bool) -> Self {
        Self { law: if uniform { Law::Uniform(ratio[0]) } else { Law::Dielectric(ratio) }, film: None }
    }

    /// Of the dielectric base; `ratio` has the specular weight in it.
    pub(super) fn of_dielectric(parameters: &Parameters<N>, ratio: SampledSpectrum<N>) -> Self {
        let uniform = ratio.0.iter().all(|eta| eta.to_bits() == ratio[0].to_bits());
        Self { film: FilmStack::new(parameters, ratio, SampledSpectrum::ZERO), ..Self::of_ratio(ratio, uniform) }
    }

    /// Of the dielectric over an opaque base, which a material may state by its F0.
    pub(super) fn of_schlick(f0: SampledSpectrum<N>, weight: f32) -> Self {
        Self { law: Law::Schlick(f0.map(|f| (f * weight).clamp(0.0, 1.0))), film: None }
    }

    /// Of the metal.
    pub(super) fn of_metal(parameters: &Parameters<N>) -> Self {
        let outside = parameters.interface.ior_i;
        match parameters.metal {
            Metal::Index { n, k } => {
                let (n, k) = (n.zip(outside, |n, o| n / o), k.zip(outside, |k, o| k / o));
                Self { law: Law::Conductor(n, k), film: FilmStack::new(parameters, n, k) }
            }
            Metal::Tint { f0, f82 } => {
                let f0 = f0.map(|f| f.clamp(0.0, 1.0));
                let coefficient = f0.zip(f82, |f0, f82| tint_coefficient(f0, f82.clamp(0.0, 1.0)));
                let film = FilmStack::new(parameters, index_of_f0(f0), SampledSpectrum::ZERO);
                Self { law: Law::Tint(f0, coefficient), film }
            }
            Metal::Constant { f0 } => {
                let f0 = f0.map(|f| f.clamp(0.0, 1.0));
                let film = FilmStack::new(parameters, index_of_f0(f0), SampledSpectrum::ZERO);
                Self { law: Law::Constant(f0), film }
            }
        }
    }

    /// The reflectance at every wavelength.
    #[inline]
    pub(super) fn at(&self, cos_i: f32) -> SampledSpectrum<N> {
        let bare = match &self.law {
            Law::Uniform(eta) => SampledSpectrum::splat(dielectric(cos_i, *eta)),
            Law::Dielectric(eta) => eta.map(|eta| dielectric(cos_i, eta)),
            Law::Schlick(f0) => {
                let rise = schlick_rise(cos_i);
                f0.map(|f0| f0 + (1.0 - f0) * rise)
            }
            Law::Tint(f0, a) => f0.zip(*a, |f0, a| tinted(cos_i, f0, a)),
            Law::Constant(f0) => *f0,
            Law::Conductor(n, k) => n.zip(*k, |n, k| conductor(cos_i, n, k)),
        };
        match &self.film {
            None => bare,
            Some(film) => bare.lerp(film.at(cos_i), film.weight()),
        }
    }

    /// The law where there is no film.
    pub(super) fn bare(&self) -> Option<&Law<N>> {
        self.film.is_none().then_some(&self.law)
    }
}

impl<const N: usize> Fresnel<N> {
    /// 2 ∫ F μ dμ of a metal: exact for F0 and tint, of which the terms integrate to 1/21 and 1/126; a metal by its index is
    /// replaced here by the tint through its reflectances at 0 and 82°.
    pub(super) fn metal_mean(&self) -> SampledSpectrum<N> {
        let mean = |f0: f32, a: f32| (f0 + (1.0 - f0) / 21.0 - a / 126.0).clamp(0.0, 1.0);
        match (&self.law, &self.film) {
            (Law::Tint(f0, a), None) => f0.zip(*a, mean),
            (Law::Constant(f0), None) => *f0,
            _ => {
                let f0 = self.at(1.0);
                f0.zip(self.at(TINT_COSINE), |f0, at_82| {
                    let schlick = f0 + (1.0 - f0) * schlick_rise(TINT_COSINE);
                    mean(f0, tint_coefficient(f0, at_82 / schlick.max(1e-6)))
                })
            }
        }
    }
}
