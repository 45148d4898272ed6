//! Dielectric interfaces that light passes: smooth, rough, and walls with two faces.
//!
//! *Radiance.* `f` is that of radiance that arrives at the camera: what is transmitted carries (ior_i/ior_t)², ior_i on the side of
//! `wo`, since radiance over n² is what refraction keeps. So f_t(wo, wi) n_t² = f_t(wi, wo) n_i², and through a closed body the factors of
//! entering and leaving cancel. A path's throughput rises and falls by them on the way: Russian roulette should not take that
//! for energy.
//!
//! *Rough*: B. Walter et al., EGSR 2007, with h_t = −(n_i wo + n_t wi) turned to wo's side. In a dispersive interface every lane has its
//! own h_t, and so its own value and density. Light that would meet the facets twice, 1 − E_R − E_T, gets diffuse lobes on either
//! side after C. Kulla & A. Conty (SIGGRAPH 2017 course): with M on this side, M′ on the other, and the share x transmitted,
//! (1 − x) M(μ_o) M(μ_i)/(π M_avg) and x M(μ_o) M′(μ_i)/(π M′_avg) (n_i/n_t)². Reciprocity asks for x n_i² M_avg = x′ n_t² M′_avg, which
//! x = (1 − F_avg) M′_avg / max(M_avg, M′_avg) has, as (1 − F_avg) n_i² = (1 − F′_avg) n_t².
//!
//! *Walls*: reflections between the faces summed, R′ = R + T² R a²/(1 − R² a²), T′ = T² a/(1 − R² a²), with a what passes
//! the wall once. A rough wall reflects by its facets, and transmits the same lobe mirrored.

use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use super::albedo::{self, At, Roughness};
use super::fresnel::{self, Fresnel};
use super::microfacet::{Ggx, mirror};
use super::{BsdfSample, Event, Interface, Parameters, Scattered, Slices, diffuse, gloss};
use crate::spectrum::SampledSpectrum;

/// Indices nearer than this are not refracted by facets: a rough lobe that turns by less than 1e-3 rad, and reflects 2.5e-7, is
/// narrower than f32 directions resolve.
const MATCHED: f32 = 1e-3;

/// What a facet, or a smooth surface, reflects and transmits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dielectric<const N: usize> {
    /// Its share of the surface.
    pub(super) weight: f32,
    fresnel: Fresnel<N>,
    /// ior_t / ior_i.
    eta: SampledSpectrum<N>,
    uniform: bool,
    color: SampledSpectrum<N>,
    tint: SampledSpectrum<N>,
    thin: bool,
}

/// Whether all lanes have the same.
#[inline]
fn is_uniform<const N: usize>(eta: SampledSpectrum<N>) -> bool {
    eta.0.iter().all(|e| e.to_bits() == eta[0].to_bits())
}

/// A rough interface.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoughDielectric<const N: usize> {
    facet: Dielectric<N>,
    ggx: Ggx,
    multiple: Multiple<N>,
}

/// The lobes of light that meets the facets more than once.
#[derive(Clone, Copy, Debug)]
struct Multiple<const N: usize> {
    /// M on the side of `wo` and on the other.
    near: Slices<N>,
    far: Slices<N>,
    /// (1 − x) / (π M_avg).
    reflected: SampledSpectrum<N>,
    /// x / (π M′_avg).
    transmitted: SampledSpectrum<N>,
    /// Mean of 1 − x.
    share: f32,
}

/// Reflectance and transmittance.
#[derive(Clone, Copy, Debug)]
struct Split<const N: usize> {
    reflected: SampledSpectrum<N>,
    transmitted: SampledSpectrum<N>,
}

impl<const N: usize> Split<N> {
    /// Probability of reflection.
    fn probability(&self) -> f32 {
        let (r, t) = (self.reflected.mean(), self.transmitted.mean());
        if r + t > 0.0 { r / (r + t) } else { 1.0 }
    }
}

impl<const N: usize> Dielectric<N> {
    pub(super) fn new(parameters: &Parameters<N>, eta: SampledSpectrum<N>, weight: f32) -> Self {
        Self {
            weight,
            uniform: is_uniform(eta),
            fresnel: Fresnel::of_dielectric(parameters, eta),
            eta,
            color: parameters.specular_color,
            tint: parameters.transmission_tint,
            thin: parameters.thin_walled,
        }
    }

    /// All of a surface between two media.
    #[inline]
    pub(super) fn between(interface: &Interface<N>, color: SampledSpectrum<N>, tint: SampledSpectrum<N>) -> Self {
        let eta = interface.ior_t.zip(interface.ior_i, |t, i| t / i);
        let uniform = is_uniform(eta);
        Self { weight: 1.0, uniform, fresnel: Fresnel::of_ratio(eta, uniform), eta, color, tint, thin: false }
    }

    /// Whether its indices are too near to each other for facets.
    fn is_matched(&self) -> bool {
        !self.thin && self.eta.0.iter().all(|eta| (eta - 1.0).abs() < MATCHED)
    }

    /// What a facet sends where, with the tints.
    #[inline]
    fn split(&self, cos_i: f32) -> Split<N> {
        let r = self.fresnel.at(cos_i);
        if self.thin {
            let transmitted = r.zip(self.tint, |r, a| {
                let t = 1.0 - r;
                t * t * a / (1.0 - r * r * a * a).max(f32::MIN_POSITIVE)
            });
            // R′ = R + R a T′
            let reflected = r + r * self.tint * transmitted;
            return Split { reflected: reflected * self.color, transmitted };
        }
        Split { reflected: r * self.color, transmitted: r.map(|r| 1.0 - r) * self.tint }
    }

    /// (ior_i/ior_t)²: radiance on its way back through the interface.
    #[inline]
    fn radiance(&self) -> SampledSpectrum<N> {
        self.eta.map(|eta| 1.0 / (eta * eta))
    }

    /// The branch that a smooth interface takes; `None` where the hero cannot take it. `chosen` is the probability of having come here,
    /// `through` what the layers above leave of the reflected and of the transmitted light.
    pub(super) fn sample(
        &self,
        cos_i: f32,
        u: f32,
        chosen: f32,
        through: [SampledSpectrum<N>; 2],
    ) -> Option<BsdfSample<N>> {
        let split = self.split(cos_i);
        let p = split.probability();
        let (scattered, event, value, probability) = if u < p {
            (Scattered::Mirror, Event::SpecularReflection, split.reflected * through[0], p)
        } else if split.transmitted.hero() <= 0.0 {
            return None;
        } else if self.thin {
            (Scattered::Straight, Event::Straight, split.transmitted * through[1], 1.0 - p)
        } else {
            let value = split.transmitted * self.radiance() * through[1];
            (Scattered::Refract, Event::SpecularTransmission, value, 1.0 - p)
        };
        let probability = chosen * probability;
        Some(BsdfSample {
            scattered,
            event,
            weight: value * (self.weight / probability),
            diffuse: SampledSpectrum::ZERO,
            pdf: SampledSpectrum::splat(probability),
        })
    }
}

impl<const N: usize> RoughDielectric<N> {
    /// `None` where the surface is smooth.
    pub(super) fn new(facet: &Dielectric<N>, alpha: [f32; 2]) -> Option<Self> {
        let ggx = gloss::distribution(alpha).filter(|_| !facet.is_matched())?;
        Some(Self { facet: *facet, ggx, multiple: Multiple::new(facet, &ggx) })
    }

    /// Its share of the surface.
    pub(super) fn weight(&self) -> f32 {
        self.facet.weight
    }

    /// Probability of the lobes of multiple scattering.
    #[inline]
    fn choice(&self, at_o: &At) -> f32 {
        at_o.of_spectra(&self.multiple.near).mean().clamp(0.0, 1.0)
    }

    /// Draws a direction off the rough interface; `None` where a facet sends it back into the surface.
    pub(super) fn sample(&self, wo: Vec3, at_o: &At, u_lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        let choice = self.choice(&self.ggx.at(wo, at_o));
        if u_lobe < choice {
            let wi = diffuse::sample_cosine(u);
            return Some(if u_lobe < choice * self.multiple.share { wi } else { Vec3::new(wi.x, wi.y, -wi.z) });
        }
        let v = (u_lobe - choice) / (1.0 - choice);
        if self.facet.thin {
            let h = self.ggx.sample_reflecting(wo, u);
            let wi = mirror(wo, h);
            let reflects = v < self.facet.split(wo.dot(h)).probability();
            return (wi.z > 0.0).then_some(if reflects { wi } else { Vec3::new(wi.x, wi.y, -wi.z) });
        }
        let h = self.ggx.sample_visible(wo, u);
        let c = wo.dot(h);
        if v < self.facet.split(c).probability() {
            let wi = mirror(wo, h);
            return (wi.z > 0.0).then_some(wi);
        }
        let eta = self.facet.eta.hero();
        let inside = (eta - 1.0) * (eta + 1.0) + c * c;
        if inside <= 0.0 {
            return None;
        }
        let wi = (((c - inside.sqrt()) / eta) * h - wo / eta).normalize();
        (wi.z < 0.0).then_some(wi)
    }

    /// f |cos θ_i| and density of the rough interface.
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, at_o: &At) -> Valued<N> {
        let cos = wi.z.abs();
        let (at_o, at_i) = (self.ggx.at(wo, at_o), self.ggx.at(wi, &At::cosine(cos)));
        let choice = self.choice(&at_o);
        let near = at_o.of_spectra(&self.multiple.near);
        let through = self.ggx.visibility(wo, wi) * cos;
        if wi.z > 0.0 {
            let h = halfway(wo, wi);
            let c = wo.dot(h);
            let split = self.facet.split(c);
            let single = split.reflected * (self.ggx.d(h) * through);
            let twice = near * at_i.of_spectra(&self.multiple.near) * self.multiple.reflected * cos;
            let density = if self.facet.thin {
                self.ggx.reflecting_pdf(wo, h)
            } else {
                self.ggx.visible_pdf(wo, h) / (4.0 * c).max(1e-20)
            };
            let pdf = choice * self.multiple.share * cos * FRAC_1_PI + (1.0 - choice) * density * split.probability();
            return Valued { value: (single + twice) * self.facet.weight, pdf: SampledSpectrum::splat(pdf) };
        }
        let twice = near * at_i.of_spectra(&self.multiple.far) * self.multiple.transmitted * cos;
        let diffuse = choice * (1.0 - self.multiple.share) * cos * FRAC_1_PI;
        if self.facet.thin {
            let mirrored = Vec3::new(wi.x, wi.y, -wi.z);
            let h = halfway(wo, mirrored);
            let split = self.facet.split(wo.dot(h));
            let single = split.transmitted * (self.ggx.d(h) * through);
            let pdf = diffuse + (1.0 - choice) * self.ggx.reflecting_pdf(wo, h) * (1.0 - split.probability());
            return Valued { value: (single + twice) * self.facet.weight, pdf: SampledSpectrum::splat(pdf) };
        }
        let mut valued = Valued { value: twice, pdf: SampledSpectrum::splat(diffuse) };
        for lane in 0..if self.facet.uniform { 1 } else { N } {
            let Some(facet) = Facet::transmitting(wo, wi, self.facet.eta[lane]) else { continue };
            let split = self.facet.split(facet.cos_o);
            // f_t |μ_i| = (1 − F) D G2 c_o/|μ_o| · dω_h/dω_i, with G2/(4 μ_o μ_i) in `through`.
            let single = 4.0 * self.ggx.d(facet.h) * through * facet.cos_o * facet.jacobian;
            let density =
                self.ggx.visible_pdf(wo, facet.h) * facet.jacobian * (1.0 - split.probability()) * (1.0 - choice);
            for i in lane..if self.facet.uniform { N } else { lane + 1 } {
                valued.value[i] += single * split.transmitted[i];
                valued.pdf[i] += density;
            }
        }
        valued.value = valued.value * self.facet.radiance() * self.facet.weight;
        valued
    }
}

impl<const N: usize> Multiple<N> {
    fn new(facet: &Dielectric<N>, ggx: &Ggx) -> Self {
        let roughness = Roughness::new(ggx.mean_alpha());
        let mean = |slices: &Slices<N>| albedo::mean_of_spectra(&ggx.over_azimuths(slices));
        let quotient = |x: f32, mean: f32| if mean > 0.0 { x * FRAC_1_PI / mean } else { 0.0 };
        if facet.thin {
            let near = roughness.white().map(|e| SampledSpectrum::splat((1.0 - e).max(0.0)));
            let mean = mean(&near)[0];
            let split = |i| facet.split(albedo::node(i));
            let r = albedo::mean_of_spectra(&std::array::from_fn(|i| split(i).reflected));
            let t = albedo::mean_of_spectra(&std::array::from_fn(|i| split(i).transmitted));
            return Self {
                near,
                far: near,
                reflected: r.map(|r| quotient(r, mean)),
                transmitted: t.map(|t| quotient(t, mean)),
                share: Split { reflected: r, transmitted: t }.probability(),
            };
        }
        let near = albedo::of_lanes(facet.eta, |eta| roughness.dielectric_loss(eta));
        let far = albedo::of_lanes(facet.eta, |eta| roughness.dielectric_loss(1.0 / eta));
        let (near_mean, far_mean) = (mean(&near), mean(&far));
        let x = SampledSpectrum::<N>::from_fn(|i| {
            let greater = near_mean[i].max(far_mean[i]);
            if greater > 0.0 { (1.0 - fresnel::dielectric_mean(facet.eta[i])) * far_mean[i] / greater } else { 0.0 }
        });
        Self {
            near,
            far,
            reflected: x.zip(near_mean, |x, mean| quotient(1.0 - x, mean)) * facet.color,
            transmitted: x.zip(far_mean, quotient) * facet.tint,
            share: 1.0 - x.mean(),
        }
    }
}

/// A value with its density.
#[derive(Clone, Copy, Debug)]
pub(super) struct Valued<const N: usize> {
    pub(super) value: SampledSpectrum<N>,
    pub(super) pdf: SampledSpectrum<N>,
}

/// The vector halfway between two directions.
#[inline]
pub(super) fn halfway(a: Vec3, b: Vec3) -> Vec3 {
    (a + b).normalize_or(Vec3::Z)
}

/// A facet that refracts one direction to another.
struct Facet {
    h: Vec3,
    cos_o: f32,
    /// dω_h/dω_i.
    jacobian: f32,
}

impl Facet {
    fn transmitting(wo: Vec3, wi: Vec3, eta: f32) -> Option<Self> {
        let h = wo + eta * wi;
        let h = h.normalize_or_zero();
        // On wo's side of the surface.
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        if !(cos_o > 0.0 && cos_i < 0.0) {
            return None;
        }
        // n_t² |c_i| / (n_i c_o + n_t c_i)²
        let sum = cos_o + eta * cos_i;
        let jacobian = eta * eta * -cos_i / (sum * sum);
        jacobian.is_finite().then_some(Self { h, cos_o, jacobian })
    }
}
