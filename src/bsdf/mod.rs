//! How a surface scatters light, at the wavelengths of a path.
//!
//! Conventions: everything is in the local frame of the shading normal, z along it on the side of `wo`; `wo` and `wi` are
//! unit vectors away from the surface, to where the path came from and where it goes; cos θ = z. `f` is in 1/sr. Radiometry is
//! f32. A [`Parameters`] says what the surface is made of at a point; a [`Bsdf`] is made of it and evaluated, sampled.
//!
//! Smooth interfaces (delta lobes) only say what happens, with what probability and weight: where a mirrored or refracted ray goes
//! is the calculus' business ([`crate::ray`], f64).

mod parameters;

use glam::Vec3;

use crate::spectrum::SampledSpectrum;

pub use parameters::{Coat, Film, Interface, Metal, Parameters, SMOOTH_ALPHA, Sheen};

/// What kind of event a sample is: for parts of the beauty, light path expressions and ray-depth limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Diffuse reflection (or diffuse transmission).
    Diffuse,
    /// Reflection by a rough interface.
    GlossyReflection,
    /// Transmission by a rough interface.
    GlossyTransmission,
    /// Reflection by a smooth interface.
    SpecularReflection,
    /// Refraction by a smooth interface.
    SpecularTransmission,
    /// Straight through: a thin wall.
    Straight,
}

/// Where a sample goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scattered {
    /// To this unit vector of the local frame.
    Toward(Vec3),
    /// Mirrored by the smooth interface.
    Mirror,
    /// Refracted by the smooth interface, at the hero wavelength.
    Refract,
    /// Straight on.
    Straight,
}

/// A direction drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample<const N: usize> {
    /// Where it goes.
    pub scattered: Scattered,
    /// What happened.
    pub event: Event,
    /// f |cos θ| / pdf, the pdf being the hero's; for smooth lobes weight over probability.
    pub weight: SampledSpectrum<N>,
    /// Density per solid angle with which each lane, were it the hero, would have drawn the direction; of smooth lobes the
    /// probability of the branch. Equal in all lanes unless a rough interface disperses.
    pub pdf: SampledSpectrum<N>,
}

/// A BSDF's values for a pair of directions; smooth lobes are not in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluated<const N: usize> {
    /// f |cos θ_i| of what is diffuse.
    pub diffuse: SampledSpectrum<N>,
    /// f |cos θ_i| of rough interfaces, reflected or transmitted by the side of `wi`.
    pub glossy: SampledSpectrum<N>,
    /// As [`BsdfSample::pdf`].
    pub pdf: SampledSpectrum<N>,
}

/// A BSDF at a point.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<const N: usize> {
    parameters: Parameters<N>,
}

impl<const N: usize> Bsdf<N> {
    /// Of what the surface is made of there.
    pub fn new(parameters: &Parameters<N>) -> Self {
        Self { parameters: *parameters }
    }

    /// Whether every lobe is smooth: then light sampling has nothing to add.
    pub fn is_smooth(&self) -> bool {
        false
    }

    /// Draws a direction; `None` where the light is absorbed. `u_lobe` chooses the lobe, `u` the direction.
    pub fn sample(&self, wo: Vec3, _u_lobe: f32, [u, v]: [f32; 2]) -> Option<BsdfSample<N>> {
        if wo.z <= 0.0 {
            return None;
        }
        let r = u.sqrt();
        let phi = 2.0 * std::f32::consts::PI * v;
        let wi = Vec3::new(r * libm::cosf(phi), r * libm::sinf(phi), (1.0 - u).max(0.0).sqrt());
        let pdf = wi.z * std::f32::consts::FRAC_1_PI;
        (pdf > 0.0).then_some(BsdfSample {
            scattered: Scattered::Toward(wi),
            event: Event::Diffuse,
            weight: self.parameters.base_color,
            pdf: SampledSpectrum::splat(pdf),
        })
    }

    /// The values for a pair of directions.
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluated<N> {
        let pdf = if wo.z > 0.0 { wi.z.max(0.0) * std::f32::consts::FRAC_1_PI } else { 0.0 };
        Evaluated {
            diffuse: self.parameters.base_color * pdf,
            glossy: SampledSpectrum::ZERO,
            pdf: SampledSpectrum::splat(pdf),
        }
    }
}
