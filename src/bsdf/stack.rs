//! Layers: sheen over coat over a base that is metal, plastic and glass in shares.
//!
//! Light that a layer does not send back reaches the next one; the last opaque one sends back the rest, reciprocally. With T(μ)
//! the part that passes all layers above, in and out, an interface's lobe is f √(T(μ_o) T(μ_i)), and leaves T − (its albedo) to
//! the next. The diffuse base, of directional transmittance D, is ρ D(μ_o) D(μ_i) / (π D_avg): a white one sends back D(μ_o). So a stack of
//! lossless layers is lossless.
//!
//! One direction is drawn from one lobe, and judged by all: the density is that of the mixture (one-sample MIS with the balance
//! heuristic, E. Veach 1997, §9.2.4). The choice depends on `wo` and on means over the lanes, so all lanes have the same.

use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use super::albedo::{self, At, Directional, NODES, Place, Slice};
use super::coat::CoatLobe;
use super::conductor::{Conductor, Pair, darkening};
use super::dielectric::{Dielectric, RoughDielectric, halfway};
use super::diffuse::{self, OrenNayar};
use super::fresnel::{self, Fresnel};
use super::gloss::Gloss;
use super::microfacet::{Ggx, mirror};
use super::sheen::{self, SheenLobe};
use super::{BsdfSample, Evaluated, Event, Parameters, Scattered, Slices};
use crate::spectrum::SampledSpectrum;

/// All lobes of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stack<const N: usize> {
    /// The facets of the base, of which all that depends on the azimuth is looked up.
    facets: Ggx,
    sheen: Option<SheenLobe<N>>,
    coat: Option<CoatLobe<N>>,
    /// What passes the sheen.
    below_sheen: Option<Slice>,
    /// What passes sheen and coat.
    below_coat: Option<Slice>,
    metal: Option<Conductor<N>>,
    gloss: Option<Gloss<N>>,
    base: Option<Base<N>>,
    glass: Option<Glass<N>>,
}

/// What transmits: smooth, or by its facets.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "part of a BSDF, which lives on the stack of one path vertex")]
enum Glass<const N: usize> {
    Smooth(Dielectric<N>),
    Rough(RoughDielectric<N>),
}

/// The diffuse base under its interface.
#[derive(Clone, Copy, Debug)]
struct Base<const N: usize> {
    /// Albedo by its share, darkened by a coat; reflected and transmitted.
    reflected: SampledSpectrum<N>,
    transmitted: SampledSpectrum<N>,
    /// 1/(π D_avg).
    scale: SampledSpectrum<N>,
    /// D at the nodes.
    reached: Directional<N>,
    rough: Option<RoughBase<N>>,
}

/// What only the rough diffuse base needs.
#[derive(Clone, Copy, Debug)]
struct RoughBase<const N: usize> {
    shape: OrenNayar,
    /// 1 − ∫ f_ss D: times D it is what multiple scattering makes up for.
    lost: Slices<N>,
    /// Its colour over π times its mean.
    multiple: SampledSpectrum<N>,
}

/// Lobes that can be chosen.
const LOBES: usize = 6;
const SHEEN: usize = 0;
const COAT: usize = 1;
const METAL: usize = 2;
const GLOSS: usize = 3;
const BASE: usize = 4;
const GLASS: usize = 5;

impl<const N: usize> Stack<N> {
    pub(super) fn new(parameters: &Parameters<N>) -> Self {
        let sheen = parameters.sheen.as_ref().filter(|s| s.weight > 0.0).map(SheenLobe::new);
        let below_sheen: Option<Slice> = sheen.as_ref().map(|s| s.albedo.map(|e| (1.0 - s.weight * e).clamp(0.0, 1.0)));
        let coated = parameters
            .coat
            .as_ref()
            .filter(|c| c.weight > 0.0)
            .map(|c| CoatLobe::new(c, &parameters.interface, below_sheen.as_ref()));
        let below_coat = coated.as_ref().map(|coated| coated.1).or(below_sheen);
        let coat = coated.map(|coated| coated.0);

        let facets = Ggx::new(parameters.alpha);
        let metalness = parameters.metalness.clamp(0.0, 1.0);
        let transmission = parameters.transmission.clamp(0.0, 1.0);
        let metal = (metalness > 0.0).then(|| Conductor::new(parameters, metalness, below_coat.as_ref()));
        let eta = ratio(parameters);
        let share = (1.0 - metalness) * transmission;
        let glass = (share > 0.0).then(|| {
            let facet = Dielectric::new(parameters, eta, share);
            RoughDielectric::new(&facet, parameters.alpha).map_or(Glass::Smooth(facet), Glass::Rough)
        });
        let share = (1.0 - metalness) * (1.0 - transmission);
        let (mut gloss, mut base) = (None, None);
        if share > 0.0 {
            let fresnel = match parameters.schlick_f0 {
                Some(f0) => Fresnel::of_schlick(f0, parameters.specular_weight),
                // Seen from the denser side an opaque base would reflect totally from an angle on that depends on wavelength; as in
                // OpenPBR 1.1 it reflects as from the rarer side, which is the same at normal incidence.
                None => Fresnel::of_dielectric(parameters, eta.map(|eta| eta.max(1.0 / eta))),
            };
            // Without an interface of the base, what passes the layers above reaches the base.
            let bare = parameters.specular_weight <= 0.0
                || (parameters.schlick_f0.is_none() && parameters.film.is_none() && is_matched(eta));
            let reflecting =
                (!bare).then(|| Gloss::reflecting(1.0, fresnel, parameters.alpha, parameters.specular_color));
            let reached = match &reflecting {
                None => Directional::upright(below_coat.unwrap_or([1.0; NODES]).map(SampledSpectrum::splat)),
                Some(reflecting) => reflecting.below(below_coat.as_ref()),
            };
            base = Base::new(parameters, share, reached, &facets.shares());
            gloss = reflecting.map(|reflecting| Gloss { weight: share, ..reflecting.gloss });
        }
        Self { facets, sheen, coat, below_sheen, below_coat, metal, gloss, base, glass }
    }

    /// Whether every lobe is smooth.
    pub(super) fn is_smooth(&self) -> bool {
        self.sheen.is_none()
            && self.base.is_none()
            && self.coat.is_none_or(|coat| coat.gloss.ggx.is_none())
            && self.metal.is_none_or(|metal| metal.rough.is_none())
            && self.gloss.is_none_or(|gloss| gloss.ggx.is_none())
            && self.glass.is_none_or(|glass| matches!(glass, Glass::Smooth(_)))
    }

    /// Probabilities of the lobes.
    fn choices(&self, view: &View) -> [f32; LOBES] {
        let mut p = [0.0; LOBES];
        if let Some(sheen) = &self.sheen {
            p[SHEEN] = sheen.importance(&view.place.at);
        }
        if self.coat.is_some() {
            p[COAT] = view.coat * view.below_sheen;
        }
        let through = view.below_coat * view.absorbed;
        if let Some(metal) = &self.metal {
            p[METAL] = metal.importance() * through;
        }
        if let Some(gloss) = &self.gloss {
            p[GLOSS] = gloss.importance(&view.place.at) * through;
        }
        if let Some(base) = &self.base {
            p[BASE] = ((base.reflected + base.transmitted) * base.reached.at(&view.place)).mean() * view.absorbed;
        }
        if let Some(glass) = &self.glass {
            let weight = match glass {
                Glass::Smooth(facet) => facet.weight,
                Glass::Rough(rough) => rough.weight(),
            };
            p[GLASS] = weight * through;
        }
        let p = p.map(|p| p.max(0.0));
        let sum: f32 = p.iter().sum();
        if sum > 0.0 { p.map(|p| p / sum) } else { p }
    }

    fn view(&self, wo: Vec3) -> View {
        let place = self.facets.place(wo);
        let passed = |slice: &Option<Slice>| slice.as_ref().map_or(1.0, |s| place.at.of(s).clamp(0.0, 1.0));
        View {
            place,
            coat: self.coat.as_ref().map_or(0.0, |coat| coat.gloss.importance(&place.at)),
            below_sheen: passed(&self.below_sheen),
            below_coat: passed(&self.below_coat),
            absorbed: self.coat.as_ref().map_or(1.0, |coat| coat.absorption(wo.z, Some(wo.z)).mean()),
        }
    }

    /// As [`super::Bsdf::sample`].
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let view = self.view(wo);
        let choices = self.choices(&view);
        let (lobe, rest) = choose(&choices, u_lobe)?;
        let chosen = choices[lobe];
        let mirrored = |value: SampledSpectrum<N>| {
            Some(BsdfSample {
                scattered: Scattered::Mirror,
                event: Event::SpecularReflection,
                weight: value * (1.0 / chosen),
                diffuse: SampledSpectrum::ZERO,
                pdf: SampledSpectrum::splat(chosen),
            })
        };
        let through = self.absorption(wo.z, Some(wo.z)) * view.below_coat;
        let off = |ggx: Ggx| mirror(wo, ggx.sample_reflecting(wo, u));
        let (wi, event) = match lobe {
            SHEEN => (diffuse::sample_cosine(u), Event::Diffuse),
            COAT => {
                let gloss = &self.coat.as_ref()?.gloss;
                match gloss.ggx {
                    None => {
                        return mirrored(SampledSpectrum::splat(
                            gloss.fresnel.at(wo.z)[0] * gloss.weight * view.below_sheen,
                        ));
                    }
                    Some(ggx) => (off(ggx), Event::GlossyReflection),
                }
            }
            METAL => {
                let metal = self.metal.as_ref()?;
                match &metal.rough {
                    None => return mirrored(metal.reflectance(wo.z) * through),
                    Some(rough) => {
                        (rough.sample(wo, &view.place.at, view.below_coat, rest, u), Event::GlossyReflection)
                    }
                }
            }
            GLOSS => {
                let gloss = self.gloss.as_ref()?;
                match gloss.ggx {
                    None => {
                        let value = gloss.fresnel.at(wo.z) * gloss.color * gloss.weight;
                        return mirrored(value * through);
                    }
                    Some(ggx) => (off(ggx), Event::GlossyReflection),
                }
            }
            BASE => {
                let wi = diffuse::sample_cosine(u);
                let below = rest >= self.base.as_ref()?.share();
                (if below { Vec3::new(wi.x, wi.y, -wi.z) } else { wi }, Event::Diffuse)
            }
            _ => match self.glass.as_ref()? {
                Glass::Smooth(facet) => {
                    let once = self.absorption(wo.z, None) * view.below_coat;
                    return facet.sample(wo.z, rest, chosen, [through, once]);
                }
                Glass::Rough(rough) => {
                    let wi = rough.sample(wo, &view.place.at, rest, u)?;
                    (wi, if wi.z > 0.0 { Event::GlossyReflection } else { Event::GlossyTransmission })
                }
            },
        };
        // Facets that mirror into the surface: of what other lobes transmit that is no sample.
        if wi.z <= 0.0 && matches!(lobe, COAT | METAL | GLOSS) {
            return None;
        }
        let evaluated = self.evaluate_from(&view, &choices, wo, wi);
        let pdf = evaluated.pdf.hero();
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let diffuse = evaluated.diffuse * (1.0 / pdf);
        Some(BsdfSample {
            scattered: Scattered::Toward(wi),
            event,
            weight: diffuse + evaluated.glossy * (1.0 / pdf),
            diffuse,
            pdf: evaluated.pdf,
        })
    }

    /// As [`super::Bsdf::evaluate`].
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluated<N> {
        let view = self.view(wo);
        self.evaluate_from(&view, &self.choices(&view), wo, wi)
    }

    fn absorption(&self, mu_o: f32, mu_i: Option<f32>) -> SampledSpectrum<N> {
        self.coat.as_ref().map_or(SampledSpectrum::ONE, |coat| coat.absorption(mu_o, mu_i))
    }

    fn evaluate_from(&self, view: &View, choices: &[f32; LOBES], wo: Vec3, wi: Vec3) -> Evaluated<N> {
        let mut evaluated = Evaluated::NOTHING;
        if wi.z == 0.0 {
            return evaluated;
        }
        let mut pdf = 0.0;
        let absorption = self.absorption(wo.z, (wi.z > 0.0).then_some(wi.z));
        if wi.z > 0.0 {
            let place_i = self.facets.place(wi);
            let pair = Pair { wo, wi, h: halfway(wo, wi), place_o: view.place, place_i };
            let passed = |slice: &Option<Slice>| slice.as_ref().map_or(1.0, |s| place_i.at.of(s).clamp(0.0, 1.0));
            let below_sheen = view.below_sheen * passed(&self.below_sheen);
            let below_coat = view.below_coat * passed(&self.below_coat);
            if let Some(sheen) = &self.sheen {
                evaluated.diffuse += sheen.evaluate(wo, wi, pair.h);
                pdf += choices[SHEEN] * sheen::pdf(wi);
            }
            if let Some((gloss, ggx)) = self.coat.as_ref().and_then(|c| Some((&c.gloss, c.gloss.ggx.as_ref()?))) {
                let value = gloss.evaluate(ggx, wo, wi, pair.h)[0] * below_sheen.sqrt();
                evaluated.glossy += SampledSpectrum::splat(value);
                pdf += choices[COAT] * ggx.reflecting_pdf(wo, pair.h);
            }
            if let Some((metal, rough)) = self.metal.as_ref().and_then(|m| Some((m, m.rough.as_ref()?))) {
                evaluated.glossy += metal.evaluate(rough, &pair, below_coat) * absorption;
                pdf += choices[METAL] * rough.pdf(&pair, view.below_coat);
            }
            if let Some((gloss, ggx)) = self.gloss.as_ref().and_then(|g| Some((g, g.ggx.as_ref()?))) {
                evaluated.glossy += gloss.evaluate(ggx, wo, wi, pair.h) * absorption * below_coat.sqrt();
                pdf += choices[GLOSS] * ggx.reflecting_pdf(wo, pair.h);
            }
            if let Some(base) = &self.base {
                evaluated.diffuse += base.reflect(&pair) * absorption;
                pdf += choices[BASE] * base.share() * wi.z * FRAC_1_PI;
            }
        } else if let Some(base) = &self.base {
            evaluated.diffuse += base.transmit(view, wi, &self.facets) * absorption;
            pdf += choices[BASE] * (1.0 - base.share()) * -wi.z * FRAC_1_PI;
        }
        evaluated.pdf = SampledSpectrum::splat(pdf);
        if let Some(Glass::Rough(rough)) = &self.glass {
            let valued = rough.evaluate(wo, wi, &view.place.at);
            // Reciprocal for what is reflected; what is transmitted does not know the other side's layers.
            let through = match (wi.z > 0.0, &self.below_coat) {
                (_, None) => 1.0,
                (false, _) => view.below_coat,
                (true, Some(t)) => (view.below_coat * At::cosine(wi.z).of(t).clamp(0.0, 1.0)).sqrt(),
            };
            evaluated.glossy += valued.value * absorption * through;
            evaluated.pdf += valued.pdf * choices[GLASS];
        }
        evaluated
    }
}

/// What is known of `wo`.
struct View {
    place: Place,
    /// The coat's importance.
    coat: f32,
    below_sheen: f32,
    below_coat: f32,
    /// Mean of what the coat's colour leaves.
    absorbed: f32,
}

impl<const N: usize> Base<N> {
    /// `None` where it is black.
    fn new(parameters: &Parameters<N>, share: f32, reached: Directional<N>, shares: &Slice) -> Option<Self> {
        let color = parameters.base_color;
        let mean = reached.mean(shares);
        if (color + parameters.diffuse_transmission).is_black() || mean.max_element() <= 0.0 {
            return None;
        }
        let dark = darkening(parameters.coat.as_ref(), color, [1.0; 2]) * share;
        let scale = mean.map(|mean| if mean > 0.0 { FRAC_1_PI / mean } else { 0.0 });
        let shape = OrenNayar::new(parameters.diffuse_roughness);
        let rough = (!shape.is_lambert()).then(|| RoughBase::new(shape, &reached, shares, color, dark));
        Some(Self {
            reflected: color * dark,
            transmitted: parameters.diffuse_transmission * dark,
            scale,
            reached,
            rough,
        })
    }

    /// Probability that a sample stays on the side of `wo`.
    fn share(&self) -> f32 {
        let (r, t) = (self.reflected.mean(), self.transmitted.mean());
        r / (r + t)
    }

    fn reflect(&self, pair: &Pair) -> SampledSpectrum<N> {
        match &self.rough {
            None => {
                let reached = self.reached.at(&pair.place_o) * self.reached.at(&pair.place_i);
                self.reflected * self.scale * reached * pair.wi.z
            }
            Some(rough) => {
                let reached = self.reached.at(&pair.place_o) * self.reached.at(&pair.place_i);
                let lost = pair.place_o.at.of_spectra(&rough.lost) * pair.place_i.at.of_spectra(&rough.lost);
                (self.reflected * reached * rough.shape.single(pair.wo, pair.wi) + rough.multiple * lost * reached)
                    * pair.wi.z
            }
        }
    }

    fn transmit(&self, view: &View, wi: Vec3, facets: &Ggx) -> SampledSpectrum<N> {
        let reached = self.reached.at(&view.place) * self.reached.at(&facets.place(wi));
        self.transmitted * self.scale * reached * -wi.z
    }
}

impl<const N: usize> RoughBase<N> {
    fn new(
        shape: OrenNayar,
        reached: &Directional<N>,
        shares: &Slice,
        color: SampledSpectrum<N>,
        share: SampledSpectrum<N>,
    ) -> Self {
        let upright = reached.over_azimuths(shares);
        let mean = albedo::mean_of_spectra(&upright);
        let peaks: [Slice; N] =
            std::array::from_fn(|lane| albedo::oren_nayar_leaving(&std::array::from_fn(|i| upright[i][lane])));
        let lost: Slices<N> = std::array::from_fn(|i| {
            SampledSpectrum::from_fn(|lane| (1.0 - shape.a() * mean[lane] - shape.b() * peaks[lane][i]).max(0.0))
        });
        let missing_mean = albedo::mean_of_spectra(&std::array::from_fn(|i| upright[i] * lost[i]));
        let multiple = SampledSpectrum::from_fn(|i| {
            if missing_mean[i] <= 0.0 {
                return 0.0;
            }
            let got = (1.0 - missing_mean[i] / mean[i]).clamp(0.0, 1.0);
            diffuse::multiple(SampledSpectrum([color[i]]), got)[0] * share[i] * FRAC_1_PI / missing_mean[i]
        });
        Self { shape, lost, multiple }
    }
}

/// ior_t/ior_i with the specular weight in it.
pub(super) fn ratio<const N: usize>(parameters: &Parameters<N>) -> SampledSpectrum<N> {
    let interface = &parameters.interface;
    interface.ior_t.zip(interface.ior_i, |t, i| fresnel::weighted_eta(t / i, parameters.specular_weight))
}

/// Whether there is no interface.
fn is_matched<const N: usize>(eta: SampledSpectrum<N>) -> bool {
    eta.0.iter().all(|eta| (eta - 1.0).abs() < f32::EPSILON)
}

/// The lobe that `u` falls on, and where on it, 0..1.
fn choose(choices: &[f32; LOBES], u: f32) -> Option<(usize, f32)> {
    let mut below = 0.0;
    let mut last = None;
    for (lobe, &p) in choices.iter().enumerate() {
        if p <= 0.0 {
            continue;
        }
        let rest = (u - below) / p;
        if rest < 1.0 {
            return Some((lobe, rest.max(0.0)));
        }
        below += p;
        last = Some(lobe);
    }
    // Rounding left u beyond the last one.
    last.map(|lobe| (lobe, 1.0 - f32::EPSILON))
}
