//! How a surface scatters light, at the wavelengths of a path.
//!
//! Conventions: everything is in the local frame of the shading normal, z along it on the side of `wo`; `wo` and `wi` are
//! unit vectors away from the surface, to where the path came from and where it goes; cos θ = z. `f` is in 1/sr. Radiometry is
//! f32. A [`Parameters`] says what the surface is made of at a point; a [`Bsdf`] is made of it and evaluated, sampled.
//!
//! Smooth interfaces (delta lobes) only say what happens, with what probability and weight: where a mirrored or refracted ray goes
//! is the calculus' business ([`crate::ray`], f64).

mod albedo;
mod coat;
mod conductor;
mod dielectric;
mod diffuse;
mod film;
mod fresnel;
mod gloss;
mod microfacet;
mod parameters;
mod sheen;
mod stack;

use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use crate::spectrum::SampledSpectrum;
use dielectric::Dielectric;
use diffuse::{Diffuse, sample_cosine};
use fresnel::Fresnel;
use stack::Stack;

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
    /// The part of `weight` that diffuse lobes have; the rest is of rough interfaces. 0 for smooth lobes. A direction is drawn from
    /// one lobe (`event`) but weighed by all of them: parts of the beauty are exact if they are split by this.
    pub diffuse: SampledSpectrum<N>,
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

impl<const N: usize> Evaluated<N> {
    /// No light goes this way.
    pub const NOTHING: Self =
        Self { diffuse: SampledSpectrum::ZERO, glossy: SampledSpectrum::ZERO, pdf: SampledSpectrum::ZERO };

    /// f |cos θ_i|.
    #[inline]
    pub fn value(&self) -> SampledSpectrum<N> {
        self.diffuse + self.glossy
    }
}

/// A function of the cosine to the normal, at every wavelength ([`albedo`]).
type Slices<const N: usize> = [SampledSpectrum<N>; albedo::NODES];

/// A BSDF at a point.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<const N: usize> {
    kind: Kind<N>,
}

/// The common surfaces have a short way.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "lives on the stack of one path vertex; a box would allocate per hit")]
enum Kind<const N: usize> {
    /// Nothing but diffuse reflection.
    Diffuse(Diffuse<N>),
    /// A smooth metal.
    Mirror(Fresnel<N>),
    /// A smooth interface that light passes.
    Clear(Dielectric<N>),
    /// Anything.
    Stack(Stack<N>),
}

impl<const N: usize> Bsdf<N> {
    /// Of what the surface is made of there.
    pub fn new(parameters: &Parameters<N>) -> Self {
        let bare = parameters.coat.is_none_or(|coat| coat.weight <= 0.0)
            && parameters.sheen.is_none_or(|sheen| sheen.weight <= 0.0);
        let opaque = parameters.metalness <= 0.0 && parameters.transmission <= 0.0;
        // Equal media have no interface between them.
        let is_matched = parameters.interface.ior_i == parameters.interface.ior_t
            && parameters.schlick_f0.is_none()
            && parameters.film.is_none();
        let has_interface = parameters.specular_weight > 0.0 && !is_matched;
        // Returned from where they are made: moving a BSDF costs more than making a short one.
        if bare && opaque && !has_interface && parameters.diffuse_transmission.is_black() {
            return Self::diffuse(parameters.base_color, parameters.diffuse_roughness);
        }
        let smooth = parameters.alpha[0].max(parameters.alpha[1]) < SMOOTH_ALPHA;
        if bare && smooth && parameters.metalness >= 1.0 {
            return Self { kind: Kind::Mirror(Fresnel::of_metal(parameters)) };
        }
        if bare && smooth && parameters.metalness <= 0.0 && parameters.transmission >= 1.0 {
            return Self { kind: Kind::Clear(Dielectric::new(parameters, stack::ratio(parameters), 1.0)) };
        }
        Self { kind: Kind::Stack(Stack::new(parameters)) }
    }

    /// Of nothing but diffuse reflection, as [`new`](Self::new) makes it of an albedo and a roughness.
    #[inline]
    pub fn diffuse(color: SampledSpectrum<N>, roughness: f32) -> Self {
        Self { kind: Kind::Diffuse(Diffuse::new(color, roughness)) }
    }

    /// Of a smooth interface between two media, with the tints of what it reflects and transmits.
    #[inline]
    pub fn clear(interface: &Interface<N>, color: SampledSpectrum<N>, tint: SampledSpectrum<N>) -> Self {
        Self { kind: Kind::Clear(Dielectric::between(interface, color, tint)) }
    }

    /// Whether every lobe is smooth: then light sampling has nothing to add.
    pub fn is_smooth(&self) -> bool {
        match &self.kind {
            Kind::Diffuse(_) => false,
            Kind::Mirror(_) | Kind::Clear(_) => true,
            Kind::Stack(stack) => stack.is_smooth(),
        }
    }

    /// Whether it is one smooth interface that light passes: it is mirrored for `u_lobe` = 0 and passes for 1, if it can, and what has
    /// another probability than 0 or 1 is that choice alone.
    pub fn is_clear(&self) -> bool {
        matches!(self.kind, Kind::Clear(_))
    }

    /// Draws a direction; `None` where the light is absorbed, or `wo` is not above the surface. `u_lobe` chooses the lobe, `u` the
    /// direction.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        self.sample_lazily(wo, || u_lobe, || u)
    }

    /// The same, with numbers that are asked for where they are needed.
    #[inline]
    pub fn sample_lazily(
        &self,
        wo: Vec3,
        u_lobe: impl FnOnce() -> f32,
        u: impl FnOnce() -> [f32; 2],
    ) -> Option<BsdfSample<N>> {
        if wo.z <= 0.0 {
            return None;
        }
        let diffuse = match &self.kind {
            Kind::Diffuse(diffuse) => diffuse,
            Kind::Mirror(fresnel) => {
                return Some(BsdfSample {
                    scattered: Scattered::Mirror,
                    event: Event::SpecularReflection,
                    weight: fresnel.at(wo.z),
                    diffuse: SampledSpectrum::ZERO,
                    pdf: SampledSpectrum::ONE,
                });
            }
            Kind::Clear(facet) => return facet.sample(wo.z, u_lobe(), 1.0, [SampledSpectrum::ONE; 2]),
            Kind::Stack(stack) => return stack.sample(wo, u_lobe(), u()),
        };
        let wi = sample_cosine(u());
        let pdf = wi.z * FRAC_1_PI;
        if pdf <= 0.0 || diffuse.color.is_black() {
            return None;
        }
        let weight = diffuse.evaluate(wo, wi) * (1.0 / pdf);
        Some(BsdfSample {
            scattered: Scattered::Toward(wi),
            event: Event::Diffuse,
            weight,
            diffuse: weight,
            pdf: SampledSpectrum::splat(pdf),
        })
    }

    /// The values for a pair of directions.
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluated<N> {
        if wo.z <= 0.0 {
            return Evaluated::NOTHING;
        }
        match &self.kind {
            Kind::Mirror(_) | Kind::Clear(_) => Evaluated::NOTHING,
            Kind::Diffuse(_) if wi.z <= 0.0 => Evaluated::NOTHING,
            Kind::Diffuse(diffuse) => Evaluated {
                diffuse: diffuse.evaluate(wo, wi),
                glossy: SampledSpectrum::ZERO,
                pdf: SampledSpectrum::splat(wi.z * FRAC_1_PI),
            },
            Kind::Stack(stack) => stack.evaluate(wo, wi),
        }
    }
}

#[cfg(test)]
mod tests;
