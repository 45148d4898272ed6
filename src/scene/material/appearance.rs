//! What the specular chain asks of a surface: its albedo, and where it is there.
//!
//! One table of the shading models' inputs with the defaults of their node definitions. What light transport asks is in
//! [`surface`](super::surface).

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
    transmission: (&'static str, f32),
    /// The tint of what transmits, and the depth at which it is reached: beyond 0 it is the inside's.
    tint: (&'static str, &'static str),
}

const ONE: (&str, f32) = ("", 1.0);

const STANDARD: Model = Model {
    ids: &["ND_standard_surface_surfaceshader", "arnold:standard_surface"],
    base_color: ("base_color", [0.8; 3]),
    base_weight: ("base", 1.0),
    metallic: ("metalness", 0.0),
    transmission: ("transmission", 0.0),
    tint: ("transmission_color", "transmission_depth"),
};

const MODELS: &[Model] = &[
    Model {
        ids: &["UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"],
        base_color: ("diffuseColor", [0.18; 3]),
        base_weight: ONE,
        metallic: ("metallic", 0.0),
        transmission: NONE,
        tint: ("", ""),
    },
    Model {
        ids: &["ND_open_pbr_surface_surfaceshader", "arnold:openpbr_surface"],
        base_color: ("base_color", [0.8; 3]),
        base_weight: ("base_weight", 1.0),
        metallic: ("base_metalness", 0.0),
        transmission: ("transmission_weight", 0.0),
        tint: ("transmission_color", "transmission_depth"),
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
        transmission: ("transmission", 0.0),
        tint: ("base_color", ""),
    },
    Model {
        ids: &["ND_disney_principled"],
        base_color: ("baseColor", [0.16; 3]),
        base_weight: ONE,
        metallic: ("metallic", 0.0),
        transmission: ("specTrans", 0.0),
        tint: ("baseColor", ""),
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
        Self { albedo: Program::constant(albedo), opacity: None }
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
        let b = &self.networks.builder;
        Ok(Appearance { albedo: b.program(albedo)?, opacity: opacity.map(|(_, opacity)| opacity) })
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
