//! What a surface is made of at a hit: the parameters of its BSDF, constants or looked up.
//!
//! A dialect states [`Layers`] of registers. They are compiled once: what is constant becomes a number or a reflectance, and
//! everything else a result of one bundle of programs, so that a constant material runs none.

mod finish;

use crate::bsdf::{Coat, Film, Interface, Metal, Parameters, SMOOTH_ALPHA, Sheen};
use crate::diagnostics::Diagnostics;
use crate::optics::Dispersion;
use crate::optics::reflectance::MeasuredReflectance;
use crate::scene::description::Shader;
use crate::spectrum::reflectance::Reflectance;
use crate::spectrum::{SampledSpectrum, Wavelengths};
use crate::texture::{Bundle, Register};

use super::Conductor;
use super::appearance::UNSTATED;
use super::network::Networks;
use super::painter::{Painted, Painter};

pub use finish::Finish;
use finish::Plain;

/// The highest index that is computed with; reflectances near 1 have none.
const HIGHEST_INDEX: f32 = 1e4;

/// The registers of a dialect.
#[derive(Clone, Debug)]
pub(super) struct Layers {
    /// Albedo of what is diffuse.
    pub(super) base_color: Register,
    pub(super) diffuse_roughness: Register,
    pub(super) metalness: Register,
    pub(super) metal: MetalLayer,
    pub(super) specular_weight: Register,
    pub(super) specular_color: Register,
    pub(super) alpha: [Register; 2],
    /// Reflectance at normal incidence of the dielectric over an opaque base, if that follows Schlick's law.
    pub(super) schlick_f0: Option<Register>,
    /// Albedo of what is transmitted diffusely.
    pub(super) diffuse_transmission: Register,
    /// Index of the dielectric where the media do not state it.
    pub(super) ior: Register,
    pub(super) transmission: Register,
    pub(super) transmission_tint: Register,
    pub(super) thin_walled: bool,
    pub(super) coat: Option<CoatLayer>,
    pub(super) sheen: Option<SheenLayer>,
    pub(super) film: Option<FilmLayer>,
    /// Share of the surface that is there.
    pub(super) presence: Register,
    /// Colour times weight, in the shader's unit.
    pub(super) emission: Register,
    /// In the frame of the tangents, components from −1 to 1; `None` without a normal map.
    pub(super) normal: Option<Register>,
    /// Of the tangent about the normal, in turns.
    pub(super) rotation: Register,
}

/// What a dialect says of its metal.
#[derive(Clone, Copy, Debug)]
pub(super) enum MetalLayer {
    /// Reflectance at normal incidence, and the tint of Schlick's at 82°.
    Tint { f0: Register, f82: Register },
    /// The same reflectance at every angle.
    Constant(Register),
    /// Reflectance at normal incidence and colour of the edge (O. Gulbrandsen, "Artist friendly metallic Fresnel", JCGT
    /// 3(4), 2014).
    Artistic { reflectivity: Register, edge: Register },
}

#[derive(Clone, Copy, Debug)]
pub(super) struct CoatLayer {
    pub(super) weight: Register,
    pub(super) color: Register,
    pub(super) ior: Register,
    pub(super) alpha: [Register; 2],
    /// Share of the darkening by light between coat and base.
    pub(super) darkening: Register,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct SheenLayer {
    pub(super) weight: Register,
    pub(super) color: Register,
    pub(super) roughness: Register,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct FilmLayer {
    pub(super) weight: Register,
    pub(super) thickness_nm: Register,
    pub(super) ior: Register,
}

impl Layers {
    /// A diffuse surface of `color` and nothing else.
    pub(super) fn diffuse(color: Register, p: &mut Painter<'_, '_, '_>) -> Painted<Self> {
        let (zero, one, white) = (p.constant(0.0)?, p.constant(1.0)?, p.gray(1.0)?);
        Ok(Self {
            base_color: color,
            diffuse_roughness: zero,
            metalness: zero,
            metal: MetalLayer::Tint { f0: white, f82: white },
            specular_weight: zero,
            specular_color: white,
            alpha: [one; 2],
            schlick_f0: None,
            diffuse_transmission: zero,
            ior: one,
            transmission: zero,
            transmission_tint: white,
            thin_walled: false,
            coat: None,
            sheen: None,
            film: None,
            presence: one,
            emission: zero,
            normal: None,
            rotation: zero,
        })
    }

    /// The same under a smooth dielectric with the index `ior`.
    pub(super) fn plastic(color: Register, ior: Register, p: &mut Painter<'_, '_, '_>) -> Painted<Self> {
        let (zero, one) = (p.constant(0.0)?, p.constant(1.0)?);
        Ok(Self { ior, specular_weight: one, alpha: [zero; 2], ..Self::diffuse(color, p)? })
    }
}

/// α = roughness².
pub(super) fn isotropic(roughness: Register, p: &mut Painter<'_, '_, '_>) -> Painted<[Register; 2]> {
    Ok([p.square(roughness)?; 2])
}

/// MaterialX' `roughness_anisotropy`: a = √(1 − min(anisotropy, 0.98)), α = min(roughness²/a, 1) and roughness² a.
pub(super) fn anisotropic(
    roughness: Register,
    anisotropy: Register,
    p: &mut Painter<'_, '_, '_>,
) -> Painted<[Register; 2]> {
    let alpha = p.square(roughness)?;
    let anisotropy = p.clamp(anisotropy, 0.0, 0.98)?;
    let rest = p.one_minus(anisotropy)?;
    let aspect = p.sqrt(rest)?;
    let one = p.constant(1.0)?;
    let along = p.divide(alpha, aspect)?;
    Ok([p.min(along, one)?, p.multiply(alpha, aspect)?])
}

/// The colour that tints what transmits; with a depth it is the inside's.
pub(super) fn surface_tint<'i>(
    color: impl Into<(&'i str, [f32; 3])>,
    depth: impl Into<(&'i str, f32)>,
    p: &mut Painter<'_, '_, '_>,
) -> Painted {
    let depth = p.number(depth)?;
    match p.b().value(depth) {
        Some([depth, ..]) if depth <= 0.0 => p.color(color),
        _ => p.gray(1.0),
    }
}

/// The index with the reflectance `f0` at normal incidence: (1 + √f₀)/(1 − √f₀).
pub(super) fn index_of(f0: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    // Beyond, the index is more than HIGHEST_INDEX.
    let f0 = p.clamp(f0, 0.0, 0.9996)?;
    let (root, one) = (p.sqrt(f0)?, p.constant(1.0)?);
    let (above, below) = (p.add(one, root)?, p.subtract(one, root)?);
    p.divide(above, below)
}

/// ((1 − n)/(1 + n))²
pub(super) fn f0_of(ior: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    let one = p.constant(1.0)?;
    let (below, above) = (p.subtract(one, ior)?, p.add(one, ior)?);
    let root = p.divide(below, above)?;
    p.square(root)
}

/// A number of a surface: itself, or the first component of a result.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    value: Source<f32>,
    low: f32,
    high: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Source<T> {
    Constant(T),
    LookedUp(usize),
}

type Results = [[f32; 4]];

impl Number {
    fn at(&self, results: &Results) -> f32 {
        match self.value {
            Source::Constant(value) => value,
            Source::LookedUp(i) => within(results[i][0], self.low, self.high),
        }
    }

    fn is_zero(&self) -> bool {
        matches!(self.value, Source::Constant(value) if value <= 0.0)
    }
}

/// What is no number is the lower limit.
fn within(x: f32, low: f32, high: f32) -> f32 {
    x.max(low).min(high)
}

/// What the colours of a surface refer to.
#[derive(Clone, Copy)]
struct Found<'a> {
    results: &'a Results,
    reflectance: Option<&'a MeasuredReflectance>,
}

/// A colour of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tint {
    Black,
    White,
    Reflectance(Reflectance),
    LookedUp(usize),
    /// The surface's measured reflectance.
    Measured,
}

impl Tint {
    /// Of a constant.
    fn of([r, g, b, _]: [f32; 4]) -> Self {
        let rgb = [r, g, b].map(|x| within(x, 0.0, 1.0));
        if rgb.iter().all(|&x| x >= 1.0) {
            Self::White
        } else if rgb.iter().all(|&x| x <= 0.0) {
            Self::Black
        } else {
            Self::Reflectance(Reflectance::exact(rgb.map(f64::from)))
        }
    }

    /// Most tints of a surface are black or white.
    #[inline(always)]
    fn at<const N: usize>(&self, found: Found<'_>, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        match self {
            Self::Black => SampledSpectrum::ZERO,
            Self::White => SampledSpectrum::ONE,
            _ => self.spectrum(found, wavelengths),
        }
    }

    fn spectrum<const N: usize>(&self, found: Found<'_>, wavelengths: &Wavelengths<N>) -> SampledSpectrum<N> {
        match self {
            Self::Black => SampledSpectrum::ZERO,
            Self::White => SampledSpectrum::ONE,
            Self::Reflectance(reflectance) => reflectance.at(wavelengths),
            Self::LookedUp(i) => {
                let [r, g, b, _] = found.results[*i];
                Reflectance::of_color([r, g, b]).at(wavelengths)
            }
            Self::Measured => SampledSpectrum::from_fn(|lane| {
                found.reflectance.map_or(0.0, |measured| measured.at(wavelengths.lane(lane)) as f32)
            }),
        }
    }
}

/// What a surface emits: linear Rec. 709 in the shader's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Emission {
    None,
    Of(Source<[f32; 3]>),
}

#[derive(Clone, Debug)]
enum SurfaceMetal {
    Tint { f0: Tint, f82: Tint },
    Constant(Tint),
    Artistic { reflectivity: Tint, edge: Tint },
    Index(Box<Conductor>),
}

#[derive(Clone, Debug)]
enum Index {
    /// Both sides are what the media around say.
    Media,
    /// A wall without an inside.
    Wall(Dispersion),
    /// The shader's own number, on both sides of the surface.
    Own(Number),
}

/// What is known of a surface by measurement.
#[derive(Clone, Debug, Default)]
pub(super) struct Measured {
    /// n + ik of its metal.
    pub(super) conductor: Option<Conductor>,
    /// The base colour, its weight included.
    pub(super) reflectance: Option<MeasuredReflectance>,
}

/// Where the index of a dielectric comes from.
pub(super) enum IndexOf<'a> {
    /// The media that meet.
    Media,
    /// The law of a thin wall.
    Wall(&'a Dispersion),
    /// The shader.
    Shader,
}

/// What a surface is made of, compiled.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Everything that differs from point to point; `None` where nothing does.
    looked_up: Option<Bundle>,
    /// The short way, if it has one.
    plain: Option<Plain>,
    reflectance: Option<MeasuredReflectance>,
    base_color: Tint,
    diffuse_roughness: Number,
    metalness: Number,
    metal: SurfaceMetal,
    specular_weight: Number,
    specular_color: Tint,
    alpha: [Number; 2],
    schlick_f0: Option<Tint>,
    diffuse_transmission: Tint,
    index: Index,
    transmission: Number,
    transmission_tint: Tint,
    thin_walled: bool,
    coat: Option<SurfaceCoat>,
    sheen: Option<(Number, Tint, Number)>,
    film: Option<[Number; 3]>,
    presence: Number,
    emission: Emission,
    normal: Option<Source<[f32; 3]>>,
    rotation: Number,
}

#[derive(Clone, Copy, Debug)]
struct SurfaceCoat {
    weight: Number,
    color: Tint,
    ior: Number,
    alpha: [Number; 2],
    darkening: Number,
}

/// What a surface is at a hit, at the wavelengths of a path.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceAt<const N: usize> {
    /// What it is made of, seen from the side of `wo`.
    pub parameters: Parameters<N>,
    /// Share of it that is there, 0..=1: with probability 1 − presence a path goes straight on, as if it met nothing.
    pub presence: f32,
    /// What it emits, linear Rec. 709 in the shader's own unit, 0 or more.
    pub emission: [f32; 3],
    /// The normal of a normal map in the frame of the tangents, not of unit length; `None` without one.
    pub normal_map: Option<[f32; 3]>,
    /// By how much the tangent is turned about the normal, in turns.
    pub rotation: f32,
}

impl<const N: usize> SurfaceAt<N> {
    /// Whether light comes from behind.
    pub fn transmits(&self) -> bool {
        self.parameters.transmission > 0.0 || !self.parameters.diffuse_transmission.is_black()
    }

    /// Itself, if its normal or its tangent are not those of the shape alone.
    pub fn directed(&self) -> Option<&Self> {
        self.has_direction().then_some(self)
    }

    /// Whether it matters which way its tangent points.
    #[allow(clippy::float_cmp, reason = "isotropic materials have the same number twice")]
    pub fn has_direction(&self) -> bool {
        let differs = |[along, across]: [f32; 2]| along != across;
        let Parameters { alpha, coat, .. } = &self.parameters;
        self.normal_map.is_some() || differs(*alpha) || coat.is_some_and(|coat| differs(coat.alpha))
    }
}

/// Sorts registers into constants and results.
struct Compiler<'p, 'a, 'n, 'd> {
    p: &'p mut Painter<'a, 'n, 'd>,
    results: Vec<Register>,
}

impl Compiler<'_, '_, '_, '_> {
    fn result(&mut self, register: Register) -> usize {
        let known = self.results.iter().position(|&other| other == register);
        known.unwrap_or_else(|| {
            self.results.push(register);
            self.results.len() - 1
        })
    }

    fn number(&mut self, register: Register, low: f32, high: f32) -> Number {
        let value = match self.p.b().value(register) {
            Some([x, ..]) => Source::Constant(within(x, low, high)),
            None => Source::LookedUp(self.result(register)),
        };
        Number { value, low, high }
    }

    fn share(&mut self, register: Register) -> Number {
        self.number(register, 0.0, 1.0)
    }

    /// A map that says what the surface says anyway is none.
    fn normal(&mut self, register: Register) -> Option<Source<[f32; 3]>> {
        match self.p.b().value(register) {
            Some([x, y, z, _]) if x == 0.0 && y == 0.0 && z > 0.0 => None,
            Some([x, y, z, _]) => Some(Source::Constant([x, y, z])),
            None => Some(Source::LookedUp(self.result(register))),
        }
    }

    fn tint(&mut self, register: Register) -> Tint {
        match self.p.b().value(register) {
            Some(value) => Tint::of(value),
            None => Tint::LookedUp(self.result(register)),
        }
    }
}

impl Surface {
    /// Of a material whose shader is not understood, or says nothing.
    pub(super) fn unstated() -> Self {
        let mut networks = Networks::default();
        let grey = networks.builder.constant(UNSTATED).expect("one operation is not too many");
        Self::diffuse(grey, &mut networks)
    }

    /// Diffuse, of the colour in a register of `networks`.
    pub(super) fn diffuse(color: Register, networks: &mut Networks) -> Self {
        let shader = Shader::default();
        let mut diagnostics = Diagnostics::default();
        let mut painter = Painter::new(&shader, networks, &mut diagnostics);
        let layers = Layers::diffuse(color, &mut painter);
        let compiled =
            layers.and_then(|layers| Self::compile(&layers, Measured::default(), IndexOf::Shader, &mut painter));
        compiled.expect("a handful of operations is not too many")
    }

    /// Compiles what a dialect states. A metal whose n + ik is known is that, and `index` says whose index counts.
    pub(super) fn compile(
        layers: &Layers,
        measured: Measured,
        index: IndexOf<'_>,
        p: &mut Painter<'_, '_, '_>,
    ) -> Painted<Self> {
        // The index of a medium counts as it is: there the weight tints.
        let (specular_weight, specular_color) = match index {
            IndexOf::Media => (p.constant(1.0)?, p.multiply(layers.specular_color, layers.specular_weight)?),
            _ => (layers.specular_weight, layers.specular_color),
        };
        let mut c = Compiler { p, results: Vec::new() };
        let metalness = c.share(layers.metalness);
        let Measured { conductor, reflectance } = measured;
        let base = |color: Tint| if reflectance.is_some() { Tint::Measured } else { color };
        let metal = match (conductor, layers.metal) {
            (Some(conductor), _) => SurfaceMetal::Index(Box::new(conductor)),
            // Nobody asks of a metal that is not there.
            (None, _) if metalness.is_zero() => SurfaceMetal::Constant(Tint::White),
            (None, MetalLayer::Tint { f0, f82 }) => SurfaceMetal::Tint { f0: base(c.tint(f0)), f82: c.tint(f82) },
            (None, MetalLayer::Constant(f0)) => SurfaceMetal::Constant(base(c.tint(f0))),
            (None, MetalLayer::Artistic { reflectivity, edge }) => {
                SurfaceMetal::Artistic { reflectivity: base(c.tint(reflectivity)), edge: c.tint(edge) }
            }
        };
        let coat = layers.coat.map(|coat| SurfaceCoat {
            weight: c.share(coat.weight),
            color: c.tint(coat.color),
            ior: c.number(coat.ior, 1.0, HIGHEST_INDEX),
            alpha: coat.alpha.map(|alpha| c.share(alpha)),
            darkening: c.share(coat.darkening),
        });
        let sheen = layers.sheen.map(|s| (c.share(s.weight), c.tint(s.color), c.share(s.roughness)));
        let film = layers.film.map(|film| {
            let thickness = c.number(film.thickness_nm, 0.0, f32::MAX);
            [c.share(film.weight), thickness, c.number(film.ior, 1.0, HIGHEST_INDEX)]
        });
        let emission = match c.p.b().value(layers.emission) {
            Some([r, g, b, _]) => match [r, g, b].map(|x| within(x, 0.0, f32::MAX)) {
                rgb if rgb.iter().all(|&x| x <= 0.0) => Emission::None,
                rgb => Emission::Of(Source::Constant(rgb)),
            },
            None => Emission::Of(Source::LookedUp(c.result(layers.emission))),
        };
        let transmission = c.share(layers.transmission);
        let diffuse_transmission = c.tint(layers.diffuse_transmission);
        // Without an inside, light that passes goes straight on; where none passes, there is no wall.
        let thin_walled = match transmission.is_zero() {
            true => layers.thin_walled && diffuse_transmission != Tint::Black,
            false => layers.thin_walled || !matches!(index, IndexOf::Media),
        };
        let index = match index {
            IndexOf::Media => Index::Media,
            IndexOf::Wall(dispersion) => Index::Wall(dispersion.clone()),
            IndexOf::Shader => Index::Own(c.number(layers.ior, 1.0 / HIGHEST_INDEX, HIGHEST_INDEX)),
        };
        let surface = Self {
            looked_up: None,
            plain: None,
            reflectance: None,
            base_color: base(c.tint(layers.base_color)),
            diffuse_roughness: c.share(layers.diffuse_roughness),
            metalness,
            metal,
            specular_weight: c.number(specular_weight, 0.0, f32::MAX),
            specular_color: c.tint(specular_color),
            alpha: layers.alpha.map(|alpha| c.share(alpha)),
            schlick_f0: layers.schlick_f0.map(|f0| c.tint(f0)),
            diffuse_transmission,
            index,
            transmission,
            transmission_tint: if transmission.is_zero() { Tint::White } else { c.tint(layers.transmission_tint) },
            thin_walled,
            coat: coat.filter(|coat| !coat.weight.is_zero()),
            sheen: sheen.filter(|(weight, color, _)| !weight.is_zero() && *color != Tint::Black),
            film: film.filter(|[weight, thickness, _]| !weight.is_zero() && !thickness.is_zero()),
            presence: c.share(layers.presence),
            emission,
            normal: layers.normal.and_then(|normal| c.normal(normal)),
            rotation: c.number(layers.rotation, f32::MIN, f32::MAX),
        };
        let Compiler { p, results } = c;
        let looked_up = if results.is_empty() { None } else { Some(p.b().bundle(&results)?) };
        let plain = if looked_up.is_none() { surface.plainly() } else { None };
        Ok(Self { looked_up, plain, reflectance, ..surface })
    }

    /// The programs that light transport runs at every hit; `None` where everything is constant.
    pub fn looked_up(&self) -> Option<&Bundle> {
        self.looked_up.as_ref()
    }

    /// Whether the surface is there all over, so that nothing has to be asked of it.
    pub fn is_present(&self) -> bool {
        matches!(self.presence.value, Source::Constant(share) if share >= 1.0)
    }

    /// Whether it is known without a look that the surface is there and not smooth: what reflects is diffuse or a rough interface.
    pub fn is_rough(&self) -> bool {
        let is_opaque = self.metalness.is_zero() && self.transmission.is_zero();
        let is_bare = self.coat.is_none() && self.sheen.is_none();
        let rough = |alpha: &Number| matches!(alpha.value, Source::Constant(alpha) if alpha >= SMOOTH_ALPHA);
        is_opaque && is_bare && (self.specular_weight.is_zero() || self.alpha.iter().any(rough)) && self.is_present()
    }

    /// Whether some light passes through the surface somewhere.
    pub fn transmits(&self) -> bool {
        !self.transmission.is_zero() && !matches!(self.metalness.value, Source::Constant(share) if share >= 1.0)
    }

    /// Whether it emits anywhere.
    pub fn emits(&self) -> bool {
        self.emission != Emission::None
    }

    /// What it emits where that is the same all over: linear Rec. 709 in the shader's own unit.
    pub fn constant_emission(&self) -> Option<[f32; 3]> {
        match self.emission {
            Emission::Of(Source::Constant(rgb)) => Some(rgb),
            _ => None,
        }
    }

    /// What it emits where its programs have these results.
    pub(in crate::scene) fn emission(&self, results: &Results) -> [f32; 3] {
        match self.emission {
            Emission::None => [0.0; 3],
            Emission::Of(Source::Constant(rgb)) => rgb,
            Emission::Of(Source::LookedUp(i)) => std::array::from_fn(|k| within(results[i][k], 0.0, f32::MAX)),
        }
    }

    /// At a hit. `results` are those of [`looked_up`](Self::looked_up) there, `interface` the media on the sides.
    pub(in crate::scene) fn at<const N: usize>(
        &self,
        results: &Results,
        wavelengths: &Wavelengths<N>,
        interface: Interface<N>,
    ) -> SurfaceAt<N> {
        let found = Found { results, reflectance: self.reflectance.as_ref() };
        let tint = |tint: &Tint| tint.at(found, wavelengths);
        let pair = |pair: &[Number; 2]| pair.map(|number| number.at(results));
        // Everything in one literal: it is long, and written once.
        let emission = self.emission(results);
        let normal_map = self.normal.map(|normal| match normal {
            Source::Constant(normal) => normal,
            Source::LookedUp(i) => [results[i][0], results[i][1], results[i][2]],
        });
        SurfaceAt {
            parameters: Parameters {
                base_color: tint(&self.base_color),
                diffuse_roughness: self.diffuse_roughness.at(results),
                metalness: self.metalness.at(results),
                metal: self.metal(found, wavelengths),
                specular_weight: self.specular_weight.at(results),
                specular_color: tint(&self.specular_color),
                alpha: pair(&self.alpha),
                interface: self.interface(results, wavelengths, interface),
                transmission: self.transmission.at(results),
                transmission_tint: tint(&self.transmission_tint),
                thin_walled: self.thin_walled,
                coat: self.coat.map(|coat| Coat {
                    weight: coat.weight.at(results),
                    color: tint(&coat.color),
                    ior: coat.ior.at(results),
                    alpha: pair(&coat.alpha),
                    darkening: coat.darkening.at(results),
                }),
                sheen: self.sheen.as_ref().map(|(weight, color, roughness)| Sheen {
                    weight: weight.at(results),
                    color: tint(color),
                    roughness: roughness.at(results),
                }),
                film: self.film.as_ref().map(|[weight, thickness, ior]| Film {
                    weight: weight.at(results),
                    thickness_nm: thickness.at(results),
                    ior: ior.at(results),
                    nanometers: SampledSpectrum::from_fn(|lane| wavelengths.nanometers()[lane] as f32),
                }),
                diffuse_transmission: tint(&self.diffuse_transmission),
                schlick_f0: self.schlick_f0.as_ref().map(tint),
            },
            presence: self.presence.at(results),
            emission,
            normal_map,
            rotation: self.rotation.at(results),
        }
    }

    /// Share of the surface that is there.
    pub(in crate::scene) fn presence(&self, results: &Results) -> f32 {
        self.presence.at(results)
    }

    fn interface<const N: usize>(
        &self,
        results: &Results,
        wavelengths: &Wavelengths<N>,
        media: Interface<N>,
    ) -> Interface<N> {
        match &self.index {
            Index::Media => media,
            Index::Wall(dispersion) => {
                let ior_t = SampledSpectrum::from_fn(|lane| dispersion.at(wavelengths.lane(lane)).ior as f32);
                Interface { ior_t, ..media }
            }
            Index::Own(number) => Interface { ior_t: SampledSpectrum::splat(number.at(results)), ..media },
        }
    }

    fn metal<const N: usize>(&self, found: Found<'_>, wavelengths: &Wavelengths<N>) -> Metal<N> {
        match &self.metal {
            SurfaceMetal::Tint { f0, f82 } => {
                Metal::Tint { f0: f0.at(found, wavelengths), f82: f82.at(found, wavelengths) }
            }
            SurfaceMetal::Constant(f0) => Metal::Constant { f0: f0.at(found, wavelengths) },
            SurfaceMetal::Artistic { reflectivity, edge } => {
                let reflectivity = reflectivity.at(found, wavelengths);
                let edge = edge.at(found, wavelengths);
                Metal::Index {
                    n: reflectivity.zip(edge, |r, g| artistic(r, g)[0]),
                    k: reflectivity.zip(edge, |r, g| artistic(r, g)[1]),
                }
            }
            SurfaceMetal::Index(conductor) => Metal::Index {
                n: SampledSpectrum::from_fn(|lane| conductor.dispersion.at(wavelengths.lane(lane)).ior as f32),
                k: SampledSpectrum::from_fn(|lane| conductor.extinction.at(wavelengths.lane(lane)) as f32),
            },
        }
    }
}

/// n and k of Gulbrandsen's parameters: the reflectance r at normal incidence is kept, g moves n between its bounds.
fn artistic(r: f32, g: f32) -> [f32; 2] {
    let r = r.clamp(0.0, 0.99);
    let (least, most) = ((1.0 - r) / (1.0 + r), (1.0 + r.sqrt()) / (1.0 - r.sqrt()));
    let n = least * g + most * (1.0 - g);
    let k_squared = (r * (n + 1.0) * (n + 1.0) - (n - 1.0) * (n - 1.0)) / (1.0 - r);
    [n, k_squared.max(0.0).sqrt()]
}

#[cfg(test)]
mod tests;
