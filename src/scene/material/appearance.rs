//! What a surface looks like: the inputs that are looked up where a ray meets it, constants or networks.
//!
//! One table of the shading models' inputs with the defaults of their node definitions; a program for each thing that is
//! asked of a surface. An input that is driven by a network that is not understood has its default, with a warning.

use crate::texture::{Function as F, Program, Register, TooLarge};

use super::painter::Painter;
use super::values::Values;

/// What Hydra gives surfaces that say nothing of their colour, and UsdPreviewSurface's default.
pub(in crate::scene) const UNSTATED: [f32; 4] = [0.18, 0.18, 0.18, 1.0];
const WHITE: [f32; 4] = [1.0; 4];
/// A weight that stands for no input.
const NONE: (&str, f32) = ("", 0.0);

/// The programs of a material. Scalars stand in all four places.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    /// What a denoiser calls albedo: the base colour of what is diffuse and the reflectance of a metal at normal incidence
    /// (in UsdPreviewSurface's specular workflow (1 − max f₀) diffuse + f₀), the tint of what transmits, 1 for clear glass.
    pub albedo: Program,
    /// The colour of the base, its weight included.
    pub base_color: Program,
    /// Weight of the metal.
    pub metallic: Program,
    /// Roughness of the specular lobe.
    pub roughness: Program,
    /// Colour times weight of what the surface emits, in the shader's own unit; `None` where that is black.
    pub emission: Option<Program>,
    /// The normal map's texel as its network hands it on; `None` where there is none.
    pub normal: Option<Program>,
    /// Where the surface is there, if that differs over it.
    pub opacity: Option<Opacity>,
}

/// A surface whose opacity differs from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct Opacity {
    /// The opacity.
    pub program: Program,
    /// Below this the surface is as [`below`](Self::below) says.
    pub limit: f32,
    /// What it is there.
    pub below: Below,
}

/// What a surface is where its opacity is low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below {
    /// Not there; elsewhere as the material says.
    CutOut,
    /// As the material says, which is glass; elsewhere it is opaque.
    Glass,
}

/// Which input is the opacity, and what it decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OpacityInput {
    pub(super) name: &'static str,
    pub(super) limit: f32,
    pub(super) below: Below,
    /// A colour, whose mean counts.
    pub(super) is_color: bool,
}

/// The inputs of a shading model.
struct Model {
    ids: &'static [&'static str],
    base_color: (&'static str, [f32; 3]),
    base_weight: (&'static str, f32),
    metallic: (&'static str, f32),
    roughness: (&'static str, f32),
    transmission: (&'static str, f32),
    /// The tint of what transmits, and the depth at which it is reached: beyond 0 it is the inside's.
    tint: (&'static str, &'static str),
    emission_color: (&'static str, [f32; 3]),
    emission_weight: (&'static str, f32),
    normal: &'static str,
}

const ONE: (&str, f32) = ("", 1.0);

const STANDARD: Model = Model {
    ids: &["ND_standard_surface_surfaceshader", "arnold:standard_surface"],
    base_color: ("base_color", [0.8; 3]),
    base_weight: ("base", 1.0),
    metallic: ("metalness", 0.0),
    roughness: ("specular_roughness", 0.2),
    transmission: ("transmission", 0.0),
    tint: ("transmission_color", "transmission_depth"),
    emission_color: ("emission_color", [1.0; 3]),
    emission_weight: ("emission", 0.0),
    normal: "normal",
};

const MODELS: &[Model] = &[
    Model {
        ids: &["UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"],
        base_color: ("diffuseColor", [0.18; 3]),
        base_weight: ONE,
        metallic: ("metallic", 0.0),
        roughness: ("roughness", 0.5),
        transmission: NONE,
        tint: ("", ""),
        emission_color: ("emissiveColor", [0.0; 3]),
        emission_weight: ONE,
        normal: "normal",
    },
    Model {
        ids: &["ND_open_pbr_surface_surfaceshader", "arnold:openpbr_surface"],
        base_color: ("base_color", [0.8; 3]),
        base_weight: ("base_weight", 1.0),
        metallic: ("base_metalness", 0.0),
        roughness: ("specular_roughness", 0.3),
        transmission: ("transmission_weight", 0.0),
        tint: ("transmission_color", "transmission_depth"),
        emission_color: ("emission_color", [1.0; 3]),
        emission_weight: ("emission_luminance", 0.0),
        normal: "geometry_normal",
    },
    STANDARD,
    Model {
        ids: &["ND_standard_surface_surfaceshader_100"],
        base_color: ("base_color", [1.0; 3]),
        base_weight: ("base", 0.8),
        ..STANDARD
    },
    Model {
        ids: &["ND_gltf_pbr_surfaceshader"],
        base_color: ("base_color", [1.0; 3]),
        base_weight: ONE,
        metallic: ("metallic", 1.0),
        roughness: ("roughness", 1.0),
        transmission: ("transmission", 0.0),
        tint: ("base_color", ""),
        emission_color: ("emissive", [0.0; 3]),
        emission_weight: ("emissive_strength", 1.0),
        normal: "normal",
    },
    Model {
        ids: &["ND_disney_principled"],
        base_color: ("baseColor", [0.16; 3]),
        base_weight: ONE,
        metallic: ("metallic", 0.0),
        roughness: ("roughness", 0.5),
        transmission: ("specTrans", 0.0),
        tint: ("baseColor", ""),
        emission_color: ("", [0.0; 3]),
        emission_weight: NONE,
        normal: "",
    },
];

impl Appearance {
    /// Of a material whose shader is not understood, or says nothing.
    pub(super) fn unstated() -> Self {
        Self::constant(UNSTATED)
    }

    /// Of clear glass.
    pub(super) fn clear() -> Self {
        Self::constant(WHITE)
    }

    fn constant(albedo: [f32; 4]) -> Self {
        Self {
            albedo: Program::constant(albedo),
            base_color: Program::constant(albedo),
            metallic: Program::constant([0.0; 4]),
            roughness: Program::constant([0.0; 4]),
            emission: None,
            normal: None,
            opacity: None,
        }
    }

    /// Of the shader that `painter` reads. `is_glass` tells that the whole surface transmits by its opacity;
    /// `opacity` is the input that decides it from point to point.
    pub(super) fn of(painter: &mut Painter<'_, '_, '_>, is_glass: bool, opacity: Option<OpacityInput>) -> Self {
        let Some(model) = MODELS.iter().find(|model| model.ids.contains(&painter.id())) else {
            return if is_glass { Self::clear() } else { Self::unstated() };
        };
        let painted = painter.paint(model, is_glass, opacity);
        painted.unwrap_or_else(|TooLarge| {
            painter.warn("", "the networks of its surface are too large");
            Self::unstated()
        })
    }

    /// The programs that a render runs: for where the surface is there, and for its albedo if that `is_asked`.
    pub fn looked_up(&self, is_asked: bool) -> impl Iterator<Item = &Program> {
        let opacity = self.opacity.as_ref().map(|opacity| &opacity.program);
        opacity.into_iter().chain(is_asked.then_some(&self.albedo))
    }
}

impl Painter<'_, '_, '_> {
    fn paint(&mut self, model: &Model, is_glass: bool, opacity: Option<OpacityInput>) -> Result<Appearance, TooLarge> {
        let color = self.color(model.base_color)?;
        let weight = self.number(model.base_weight)?;
        let base = self.b().binary(F::Multiply, color, weight)?;
        let metallic = self.number(model.metallic)?;
        let roughness = self.number(model.roughness)?;
        let mut albedo = self.specular_workflow(base)?;
        let transmission = self.number(model.transmission)?;
        if self.b().value(transmission) != Some([0.0; 4]) {
            let tint = self.tint(model)?;
            let one = self.b().number(1.0)?;
            let dielectric = self.b().binary(F::Subtract, one, metallic)?;
            let transmitting = self.b().binary(F::Multiply, transmission, dielectric)?;
            albedo = self.b().ternary(F::Mix, tint, albedo, transmitting)?;
        }
        let white = self.b().constant(WHITE)?;
        let opacity = match opacity {
            Some(input) => Some(self.opacity(input)?),
            None => None,
        };
        if let Some((register, opacity)) = &opacity
            && opacity.below == Below::Glass
        {
            let limit = self.b().number(opacity.limit)?;
            let is_clear = self.b().binary(F::Greater, limit, *register)?;
            albedo = self.b().ternary(F::Select, white, albedo, is_clear)?;
        } else if is_glass && model.transmission == NONE {
            albedo = white;
        }
        let emission_color = self.color(model.emission_color)?;
        let emission_weight = self.number(model.emission_weight)?;
        let emission = self.b().binary(F::Multiply, emission_color, emission_weight)?;
        let is_black = matches!(self.b().value(emission), Some([r, g, b, _]) if [r, g, b].iter().all(|&x| x == 0.0));
        let normal = self.networks.register(model.normal);
        let b = &self.networks.builder;
        Ok(Appearance {
            albedo: b.program(albedo)?,
            base_color: b.program(base)?,
            metallic: b.program(metallic)?,
            roughness: b.program(roughness)?,
            emission: if is_black { None } else { Some(b.program(emission)?) },
            normal: normal.map(|normal| b.program(normal)).transpose()?,
            opacity: opacity.map(|(_, opacity)| opacity),
        })
    }

    fn opacity(&mut self, input: OpacityInput) -> Result<(Register, Opacity), TooLarge> {
        let driven = self.networks.register(input.name).expect("only a network makes opacity differ");
        let register = if input.is_color {
            let third = self.b().number(1.0 / 3.0)?;
            self.b().binary(F::Dot(3), driven, third)?
        } else {
            self.b().swizzle(driven, "x")?
        };
        let program = self.networks.builder.program(register)?;
        Ok((register, Opacity { program, limit: input.limit, below: input.below }))
    }

    /// (1 − max f₀) diffuse + f₀ in UsdPreviewSurface's specular workflow, else the base itself.
    fn specular_workflow(&mut self, base: Register) -> Result<Register, TooLarge> {
        if !self.switch(("useSpecularWorkflow", false)) {
            return Ok(base);
        }
        let specular = self.color(("specularColor", [0.0; 3]))?;
        let [greatest, _] = self.extremes(specular)?;
        let b = self.b();
        let one = b.number(1.0)?;
        let rest = b.binary(F::Subtract, one, greatest)?;
        let diffuse = b.binary(F::Multiply, base, rest)?;
        b.binary(F::Add, diffuse, specular)
    }

    /// What tints light at the surface; the colour of an inside with a depth is not the surface's.
    fn tint(&mut self, model: &Model) -> Result<Register, TooLarge> {
        let (color, depth) = model.tint;
        let is_inside = !depth.is_empty()
            && (self.networks.register(depth).is_some()
                || self.authored(depth, Values::number).is_some_and(|depth| depth > 0.0));
        if color.is_empty() || is_inside {
            return self.b().constant(WHITE);
        }
        self.color((color, [1.0; 3]))
    }
}
