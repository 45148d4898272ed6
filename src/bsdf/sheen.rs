//! Sheen: fibres that stand on the surface, seen at grazing angles.
//!
//! "Charlie" of A. Conty Estevez & C. Kulla, "Production friendly microfacet sheen BRDF", SIGGRAPH 2017:
//! D(h) = (2 + 1/r) sin^{1/r} θ_h / (2π), f = D G / (4 μ_o μ_i), G = 1/(1 + Λ(μ_o) + Λ(μ_i)), with their fit of Λ. Its albedo
//! is tabulated ([`super::albedo`]); what sheen does not reflect, 1 − w E(μ), goes on to what is below (as OpenPBR has it, whatever the colour).

use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

use super::albedo::{self, At, Slice};
use crate::spectrum::SampledSpectrum;

/// A sheen lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct SheenLobe<const N: usize> {
    pub(super) weight: f32,
    pub(super) color: SampledSpectrum<N>,
    shape: Shape,
    /// Directional albedo at weight and colour 1.
    pub(super) albedo: Slice,
}

impl<const N: usize> SheenLobe<N> {
    pub(super) fn new(sheen: &super::Sheen<N>) -> Self {
        let roughness = sheen.roughness.clamp(albedo::SHARPEST_SHEEN, 1.0);
        Self {
            weight: sheen.weight.clamp(0.0, 1.0),
            color: sheen.color,
            shape: Shape::new(roughness),
            albedo: albedo::sheen(roughness),
        }
    }

    /// f cos θ_i.
    #[inline]
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, h: Vec3) -> SampledSpectrum<N> {
        self.color * (self.weight * self.shape.value(wo.z, wi.z, h.z) * wi.z)
    }

    /// Albedo for a direction, for the choice of lobes.
    #[inline]
    pub(super) fn importance(&self, at: &At) -> f32 {
        self.weight * self.color.mean() * at.of(&self.albedo)
    }
}

/// The distribution of a roughness with its masking.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    inverse: f32,
    a: f32,
    b: f32,
    c: f32,
    d: f32,
    e: f32,
    /// L(1/2)
    middle: f32,
}

impl Shape {
    pub(super) fn new(roughness: f32) -> Self {
        let t = (1.0 - roughness) * (1.0 - roughness);
        let mix = |rough: f32, smooth: f32| rough + (smooth - rough) * t;
        let mut shape = Self {
            inverse: 1.0 / roughness,
            a: mix(21.5473, 25.3245),
            b: mix(3.82987, 3.32435),
            c: mix(0.19823, 0.16801),
            d: mix(-1.97760, -1.27393),
            e: mix(-4.32054, -4.85967),
            middle: 0.0,
        };
        shape.middle = shape.fit(0.5);
        shape
    }

    fn fit(&self, x: f32) -> f32 {
        self.a / (1.0 + self.b * libm::powf(x, self.c)) + self.d * x + self.e
    }

    fn lambda(&self, mu: f32) -> f32 {
        if mu < 0.5 {
            libm::expf(self.fit(mu.max(0.0)))
        } else {
            libm::expf(2.0 * self.middle - self.fit((1.0 - mu).max(0.0)))
        }
    }

    /// f, 1/sr.
    pub(super) fn value(&self, mu_o: f32, mu_i: f32, mu_h: f32) -> f32 {
        let sine = (1.0 - mu_h * mu_h).max(0.0).sqrt();
        let d = (2.0 + self.inverse) * libm::powf(sine, self.inverse) / (2.0 * PI);
        let denominator = 4.0 * mu_o * mu_i * (1.0 + self.lambda(mu_o) + self.lambda(mu_i));
        if denominator > 0.0 { d / denominator } else { 0.0 }
    }
}

/// Density per solid angle with which sheen is drawn: a cosine, since it is broad.
pub(super) fn pdf(wi: Vec3) -> f32 {
    wi.z * FRAC_1_PI
}
