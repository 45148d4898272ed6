//! Autodesk Standard Surface, and Arnold's node of it.
//!
//! Specification: Autodesk Standard Surface 1.0.1; names and defaults: MaterialX 1.39 `standard_surface.mtlx`, both
//! versions. Dispersion is the Abbe number itself, 0 is off. Arnold's node adds `dielectric_priority` (higher wins, 0
//! unset, negative weaker than unset; Arnold User Guide, Nested Dielectrics).

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;
use crate::texture::{Function, Register};

use super::super::appearance::OpacityInput;
use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, FilmLayer, Layers, MetalLayer, SheenLayer, anisotropic, surface_tint};
use super::super::{Context, SMOOTH_ROUGHNESS};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Integer, Number, Switch, input};
use super::layered::{self, Lobe};
use super::vocabulary::{Attenuation, Glass, Response};

const OPACITY: Number = input("opacity", 1.0);
const THIN_WALLED: Switch = input("thin_walled", false);
const METALNESS: Number = input("metalness", 0.0);
const TRANSMISSION: Number = input("transmission", 0.0);
const ROUGHNESS: Number = input("specular_roughness", 0.2);
const EXTRA_ROUGHNESS: Number = input("transmission_extra_roughness", 0.0);
const IOR: Number = input("specular_IOR", 1.5);
const ABBE_NUMBER: Number = input("transmission_dispersion", 0.0);
const COLOR: Color = input("transmission_color", [1.0; 3]);
const DEPTH: Number = input("transmission_depth", 0.0);
const SCATTER: Color = input("transmission_scatter", [0.0; 3]);
const BASE: Number = input("base", 1.0);
const BASE_COLOR: Color = input("base_color", [0.8; 3]);
const DIFFUSE_ROUGHNESS: Number = input("diffuse_roughness", 0.0);
const SPECULAR: Number = input("specular", 1.0);
const SPECULAR_COLOR: Color = input("specular_color", [1.0; 3]);
const ANISOTROPY: Number = input("specular_anisotropy", 0.0);
const ROTATION: Number = input("specular_rotation", 0.0);
const SUBSURFACE: Number = input("subsurface", 0.0);
const SUBSURFACE_COLOR: Color = input("subsurface_color", [1.0; 3]);
const SHEEN: Number = input("sheen", 0.0);
const SHEEN_COLOR: Color = input("sheen_color", [1.0; 3]);
const SHEEN_ROUGHNESS: Number = input("sheen_roughness", 0.3);
const COAT: Number = input("coat", 0.0);
const COAT_COLOR: Color = input("coat_color", [1.0; 3]);
const COAT_ROUGHNESS: Number = input("coat_roughness", 0.1);
const COAT_ANISOTROPY: Number = input("coat_anisotropy", 0.0);
const COAT_IOR: Number = input("coat_IOR", 1.5);
const COAT_AFFECT_COLOR: Number = input("coat_affect_color", 0.0);
const COAT_AFFECT_ROUGHNESS: Number = input("coat_affect_roughness", 0.0);
const FILM_THICKNESS: Number = input("thin_film_thickness", 0.0);
const FILM_IOR: Number = input("thin_film_IOR", 1.5);
const EMISSION: Number = input("emission", 0.0);
const EMISSION_COLOR: Color = input("emission_color", [1.0; 3]);
const NORMAL: &str = "normal";
const PRIORITY: Integer = input("dielectric_priority", 0);

pub(super) struct StandardSurface;

impl Dialect for StandardSurface {
    fn ids(&self) -> &'static [&'static str] {
        &["ND_standard_surface_surfaceshader", "ND_standard_surface_surfaceshader_100", "arnold:standard_surface"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(OPACITY),
            Declared::Switch(THIN_WALLED),
            Declared::Number(METALNESS),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Number(EXTRA_ROUGHNESS),
            Declared::Number(IOR),
            Declared::Number(ABBE_NUMBER),
            Declared::Color(COLOR),
            Declared::Number(DEPTH),
            Declared::Color(SCATTER),
            Declared::Integer(PRIORITY),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Number(BASE),
            Declared::Color(BASE_COLOR),
            Declared::Number(DIFFUSE_ROUGHNESS),
            Declared::Number(SPECULAR),
            Declared::Color(SPECULAR_COLOR),
            Declared::Number(ANISOTROPY),
            Declared::Number(ROTATION),
            Declared::Number(SUBSURFACE),
            Declared::Color(SUBSURFACE_COLOR),
            Declared::Number(SHEEN),
            Declared::Color(SHEEN_COLOR),
            Declared::Number(SHEEN_ROUGHNESS),
            Declared::Number(COAT),
            Declared::Color(COAT_COLOR),
            Declared::Number(COAT_ROUGHNESS),
            Declared::Number(COAT_ANISOTROPY),
            Declared::Number(COAT_IOR),
            Declared::Number(COAT_AFFECT_COLOR),
            Declared::Number(COAT_AFFECT_ROUGHNESS),
            Declared::Number(FILM_THICKNESS),
            Declared::Number(FILM_IOR),
            Declared::Number(EMISSION),
            Declared::Color(EMISSION_COLOR),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(why) = inputs.cut_out(OPACITY, diagnostics)? {
            return Ok(Response::CutOut(why));
        }
        layered::layered(
            inputs,
            inputs.weight(TRANSMISSION, diagnostics)?,
            inputs.metalness(METALNESS)?,
            |diagnostics| {
                let roughness = inputs.number(ROUGHNESS, diagnostics)? + inputs.number(EXTRA_ROUGHNESS, diagnostics)?;
                Ok(Lobe { rough: roughness > SMOOTH_ROUGHNESS, thin_walled: inputs.switch(THIN_WALLED, diagnostics)? })
            },
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn opacity(&self, inputs: &Inputs<'_>, _: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        Ok(layered::holes(inputs, OPACITY, true))
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        // Version 1.0.0 has the defaults the other way round.
        let (weight, color) = match p.id() {
            "ND_standard_surface_surfaceshader_100" => {
                (p.number((BASE.name, 0.8))?, p.color((BASE_COLOR.name, [1.0; 3]))?)
            }
            _ => (p.number(BASE)?, p.color(BASE_COLOR)?),
        };
        let (specular, specular_color) = (p.number(SPECULAR)?, p.color(SPECULAR_COLOR)?);
        let (coat, coat_roughness) = (p.number(COAT)?, p.number(COAT_ROUGHNESS)?);
        let (transmission, anisotropy) = (p.number(TRANSMISSION)?, p.number(ANISOTROPY)?);
        let roughness = roughness(transmission, coat, coat_roughness, p)?;
        let coat_anisotropy = p.number(COAT_ANISOTROPY)?;
        let coat_layer = CoatLayer {
            weight: coat,
            color: p.color(COAT_COLOR)?,
            ior: p.number(COAT_IOR)?,
            alpha: anisotropic(coat_roughness, coat_anisotropy, p)?,
            darkening: p.constant(0.0)?,
        };
        let (subsurface_color, subsurface) = (p.color(SUBSURFACE_COLOR)?, p.number(SUBSURFACE)?);
        let affected = coat_gamma(coat, p)?;
        let diffuse = saturated(color, affected, p)?;
        let diffuse = p.multiply(diffuse, weight)?;
        let below = saturated(subsurface_color, affected, p)?;
        let (thin_walled, zero) = (p.switch(THIN_WALLED), p.constant(0.0)?);
        let (diffuse, diffuse_transmission) = match thin_walled {
            // Under a thin wall all of it comes out on the other side.
            true => (p.mix(diffuse, zero, subsurface)?, p.multiply(below, subsurface)?),
            false => (p.mix(diffuse, below, subsurface)?, zero),
        };
        let sheen = SheenLayer {
            weight: p.number(SHEEN)?,
            color: p.color(SHEEN_COLOR)?,
            roughness: p.number(SHEEN_ROUGHNESS)?,
        };
        let film =
            FilmLayer { weight: p.constant(1.0)?, thickness_nm: p.number(FILM_THICKNESS)?, ior: p.number(FILM_IOR)? };
        let (emission, emission_color) = (p.number(EMISSION)?, p.color(EMISSION_COLOR)?);
        let metal = MetalLayer::Artistic {
            reflectivity: p.multiply(color, weight)?,
            edge: p.multiply(specular_color, specular)?,
        };
        // MaterialX' `rotate3d` turns clockwise.
        let (turns, minus) = (p.number(ROTATION)?, p.constant(-1.0)?);
        let rotation = p.multiply(turns, minus)?;
        let ior = p.number(IOR)?;
        Ok(Layers {
            diffuse_roughness: p.number(DIFFUSE_ROUGHNESS)?,
            metalness: p.number(METALNESS)?,
            metal,
            specular_weight: specular,
            specular_color,
            alpha: anisotropic(roughness, anisotropy, p)?,
            transmission,
            transmission_tint: surface_tint(COLOR, DEPTH, p)?,
            thin_walled,
            diffuse_transmission,
            coat: Some(coat_layer),
            sheen: Some(sheen),
            film: Some(film),
            presence: p.mean_of_color(OPACITY)?,
            emission: p.multiply(emission_color, emission)?,
            normal: p.network(NORMAL),
            rotation,
            ..Layers::plastic(diffuse, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let abbe_number = layered::abbe_number(inputs, ABBE_NUMBER, diagnostics)?;
        layered::glass(inputs, IOR, abbe_number, diagnostics)
    }

    /// With a depth of 0 the colour tints the surface.
    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        _: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        if inputs.length(DEPTH, diagnostics)? > 0.0 {
            layered::warn_of_scattering(inputs, SCATTER, diagnostics)?;
        }
        layered::attenuation_over_depth(inputs, COLOR, DEPTH, diagnostics)
    }

    fn priority(&self, inputs: &Inputs<'_>) -> Result<Option<(Priority, String)>> {
        layered::arnolds_priority(inputs, PRIORITY)
    }
}

/// Of the interface: what transmits has the extra roughness by its share, and a rough coat blurs what is under it.
fn roughness(transmission: Register, coat: Register, coat_roughness: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    let (roughness, extra) = (p.number(ROUGHNESS)?, p.number(EXTRA_ROUGHNESS)?);
    let transmitting = p.add(roughness, extra)?;
    let transmitting = p.clamp(transmitting, 0.0, 1.0)?;
    let roughness = p.mix(roughness, transmitting, transmission)?;
    let affect = p.number(COAT_AFFECT_ROUGHNESS)?;
    let affect = p.multiply(affect, coat)?;
    let (affect, one) = (p.multiply(affect, coat_roughness)?, p.constant(1.0)?);
    p.mix(roughness, one, affect)
}

/// Under the coat colours are raised to this power.
fn coat_gamma(coat: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    let (coat, affect) = (p.clamp(coat, 0.0, 1.0)?, p.number(COAT_AFFECT_COLOR)?);
    let (more, one) = (p.multiply(coat, affect)?, p.constant(1.0)?);
    p.add(one, more)
}

fn saturated(color: Register, gamma: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    if p.is(gamma, 1.0) {
        return Ok(color);
    }
    let zero = p.constant(0.0)?;
    let color = p.b().binary(Function::Max, color, zero)?;
    p.power(color, gamma)
}
