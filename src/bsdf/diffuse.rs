//! Diffuse reflection: Lambert, and the Oren–Nayar family with its energy preserved.
//!
//! "EON" of J. Portsmouth, P. Kutz & S. Hill, JCGT 14(1) 2025 (arXiv 2410.18026): Fujii's single scattering
//! f_ss = (ρ/π) A (1 + r s/t), with s = wo·wi − μ_o μ_i, t = max(μ_o, μ_i) where s > 0 and 1 elsewhere,
//! A = 1/(1 + (1/2 − 2/(3π)) r), and for what it loses a multiple-scattering lobe after Kulla & Conty,
//! f_ms = (ρ_ms/π) (1 − E(μ_o))(1 − E(μ_i))/(1 − E_avg), ρ_ms = ρ² E_avg/(1 − ρ(1 − E_avg)).

use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

use crate::math::trig::sin_cos;
use crate::spectrum::SampledSpectrum;

/// Fujii's model at albedo 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrenNayar {
    roughness: f32,
    a: f32,
}

impl OrenNayar {
    #[inline]
    pub(super) fn new(roughness: f32) -> Self {
        if roughness <= 0.0 {
            return Self { roughness: 0.0, a: 1.0 };
        }
        let roughness = roughness.clamp(0.0, 1.0);
        Self { roughness, a: 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * roughness) }
    }

    /// Whether it is Lambert.
    pub(super) fn is_lambert(&self) -> bool {
        self.roughness <= 0.0
    }

    /// A, of Lambert's part.
    pub(super) fn a(&self) -> f32 {
        self.a
    }

    /// A r, of the part that peaks toward the source.
    pub(super) fn b(&self) -> f32 {
        self.a * self.roughness
    }

    /// f_ss at albedo 1, 1/sr.
    #[inline]
    pub(super) fn single(&self, wo: Vec3, wi: Vec3) -> f32 {
        let s = wo.dot(wi) - wo.z * wi.z;
        let s_over_t = if s > 0.0 { s / wo.z.max(wi.z) } else { s };
        (self.a + self.b() * s_over_t) * FRAC_1_PI
    }

    /// Directional albedo of f_ss at albedo 1, in closed form (eq. 31 of the article).
    pub(super) fn albedo(&self, mu: f32) -> f32 {
        let mu = mu.clamp(0.0, 1.0);
        let sine = (1.0 - mu * mu).max(0.0).sqrt();
        // (1 − sin³)/μ tends to 0 at grazing.
        let rest = if mu > 1e-3 { (1.0 - sine * sine * sine) / mu } else { 1.5 * mu };
        let g = sine * (libm::acosf(mu) - sine * mu) + 2.0 / 3.0 * sine * (rest - 1.0);
        self.a + self.b() * FRAC_1_PI * g
    }

    /// Mean of [`Self::albedo`] for diffuse light.
    pub(super) fn mean_albedo(&self) -> f32 {
        self.a * (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * PI)) * self.roughness)
    }
}

/// Albedo of light scattered more than once between facets of albedo ρ of which the fraction `mean` gets out at each turn.
#[inline]
pub(super) fn multiple<const N: usize>(rho: SampledSpectrum<N>, mean: f32) -> SampledSpectrum<N> {
    rho.map(|rho| rho * rho * mean / (1.0 - rho * (1.0 - mean)).max(1e-6))
}

/// A diffuse surface with nothing over it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffuse<const N: usize> {
    pub(super) color: SampledSpectrum<N>,
    shape: OrenNayar,
    /// ρ_ms / (1 − E_avg), 0 for Lambert.
    multiple: SampledSpectrum<N>,
}

impl<const N: usize> Diffuse<N> {
    #[inline]
    pub(super) fn new(color: SampledSpectrum<N>, roughness: f32) -> Self {
        let shape = OrenNayar::new(roughness);
        if shape.is_lambert() {
            return Self { color, shape, multiple: SampledSpectrum::ZERO };
        }
        let mean = shape.mean_albedo();
        Self { color, shape, multiple: multiple(color, mean) * (FRAC_1_PI / (1.0 - mean)) }
    }

    /// f cos θ_i; both directions above the surface.
    #[inline]
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum<N> {
        if self.shape.is_lambert() {
            return self.color * (wi.z * FRAC_1_PI);
        }
        let missing = (1.0 - self.shape.albedo(wo.z)) * (1.0 - self.shape.albedo(wi.z));
        (self.color * self.shape.single(wo, wi) + self.multiple * missing) * wi.z
    }
}

/// Draws a direction above the surface with density cos θ/π.
#[inline]
pub(super) fn sample_cosine([u, v]: [f32; 2]) -> Vec3 {
    let r = u.sqrt();
    let (sine, cosine) = sin_cos(std::f64::consts::TAU * f64::from(v));
    Vec3::new(r * cosine as f32, r * sine as f32, (1.0 - u).max(0.0).sqrt())
}
