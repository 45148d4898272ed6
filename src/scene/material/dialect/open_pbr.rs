//! OpenPBR Surface.
//!
//! Specification: OpenPBR 1.1.1, sections on the translucent base and the specular weight; names and defaults: MaterialX
//! 1.39 `open_pbr_surface.mtlx`. Arnold's node of the same model adds `dielectric_priority` (higher wins, 0 unset; Arnold
//! User Guide, Nested Dielectrics).

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;
use crate::texture::Register;

use super::super::Context;
use super::super::appearance::OpacityInput;
use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, FilmLayer, Layers, MetalLayer, SheenLayer, surface_tint};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Integer, Number, Switch, input};
use super::layered::{self, Lobe, Stated};
use super::vocabulary::{Attenuation, Glass, Response};

const OPACITY: Number = input("geometry_opacity", 1.0);
const THIN_WALLED: Switch = input("geometry_thin_walled", false);
const METALNESS: Number = input("base_metalness", 0.0);
const TRANSMISSION: Number = input("transmission_weight", 0.0);
const ROUGHNESS: Number = input("specular_roughness", 0.3);
const IOR: Number = input("specular_ior", 1.5);
const SPECULAR_WEIGHT: Number = input("specular_weight", 1.0);
const DISPERSION_SCALE: Number = input("transmission_dispersion_scale", 0.0);
const ABBE_NUMBER: Number = input("transmission_dispersion_abbe_number", 20.0);
const COLOR: Color = input("transmission_color", [1.0; 3]);
const DEPTH: Number = input("transmission_depth", 0.0);
const SCATTER: Color = input("transmission_scatter", [0.0; 3]);
const BASE_WEIGHT: Number = input("base_weight", 1.0);
const BASE_COLOR: Color = input("base_color", [0.8; 3]);
const DIFFUSE_ROUGHNESS: Number = input("base_diffuse_roughness", 0.0);
const SPECULAR_COLOR: Color = input("specular_color", [1.0; 3]);
const ANISOTROPY: Number = input("specular_roughness_anisotropy", 0.0);
const SUBSURFACE_WEIGHT: Number = input("subsurface_weight", 0.0);
const SUBSURFACE_COLOR: Color = input("subsurface_color", [0.8; 3]);
const SUBSURFACE_ANISOTROPY: Number = input("subsurface_scatter_anisotropy", 0.0);
const FUZZ_WEIGHT: Number = input("fuzz_weight", 0.0);
const FUZZ_COLOR: Color = input("fuzz_color", [1.0; 3]);
const FUZZ_ROUGHNESS: Number = input("fuzz_roughness", 0.5);
const COAT_WEIGHT: Number = input("coat_weight", 0.0);
const COAT_COLOR: Color = input("coat_color", [1.0; 3]);
const COAT_ROUGHNESS: Number = input("coat_roughness", 0.0);
const COAT_ANISOTROPY: Number = input("coat_roughness_anisotropy", 0.0);
const COAT_DARKENING: Number = input("coat_darkening", 1.0);
const COAT_IOR: Number = input("coat_ior", 1.6);
const FILM_WEIGHT: Number = input("thin_film_weight", 0.0);
const FILM_THICKNESS: Number = input("thin_film_thickness", 0.5);
const FILM_IOR: Number = input("thin_film_ior", 1.4);
const EMISSION_LUMINANCE: Number = input("emission_luminance", 0.0);
const EMISSION_COLOR: Color = input("emission_color", [1.0; 3]);
const NORMAL: &str = "geometry_normal";
const PRIORITY: Integer = input("dielectric_priority", 0);

pub(super) struct OpenPbr;

impl Dialect for OpenPbr {
    fn ids(&self) -> &'static [&'static str] {
        &["ND_open_pbr_surface_surfaceshader", "arnold:openpbr_surface"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(OPACITY),
            Declared::Switch(THIN_WALLED),
            Declared::Number(METALNESS),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
            Declared::Number(SPECULAR_WEIGHT),
            Declared::Number(DISPERSION_SCALE),
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
            Declared::Number(BASE_WEIGHT),
            Declared::Color(BASE_COLOR),
            Declared::Number(DIFFUSE_ROUGHNESS),
            Declared::Color(SPECULAR_COLOR),
            Declared::Number(ANISOTROPY),
            Declared::Number(SUBSURFACE_WEIGHT),
            Declared::Color(SUBSURFACE_COLOR),
            Declared::Number(SUBSURFACE_ANISOTROPY),
            Declared::Number(FUZZ_WEIGHT),
            Declared::Color(FUZZ_COLOR),
            Declared::Number(FUZZ_ROUGHNESS),
            Declared::Number(COAT_WEIGHT),
            Declared::Color(COAT_COLOR),
            Declared::Number(COAT_ROUGHNESS),
            Declared::Number(COAT_ANISOTROPY),
            Declared::Number(COAT_DARKENING),
            Declared::Number(COAT_IOR),
            Declared::Number(FILM_WEIGHT),
            Declared::Number(FILM_THICKNESS),
            Declared::Number(FILM_IOR),
            Declared::Number(EMISSION_LUMINANCE),
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
                Ok(Lobe {
                    rough: inputs.is_rough(ROUGHNESS, diagnostics)?,
                    thin_walled: inputs.switch(THIN_WALLED, diagnostics)?,
                })
            },
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn opacity(&self, inputs: &Inputs<'_>, _: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        Ok(layered::holes(inputs, OPACITY, false))
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (weight, color) = (p.number(BASE_WEIGHT)?, p.color(BASE_COLOR)?);
        let base = p.multiply(color, weight)?;
        let (specular_weight, specular_color) = (p.number(SPECULAR_WEIGHT)?, p.color(SPECULAR_COLOR)?);
        let (coat_weight, coat_roughness) = (p.number(COAT_WEIGHT)?, p.number(COAT_ROUGHNESS)?);
        let roughness = p.number(ROUGHNESS)?;
        let roughness = under_the_coat(roughness, coat_weight, coat_roughness, p)?;
        let anisotropy = p.number(ANISOTROPY)?;
        let alpha = stretched(roughness, anisotropy, p)?;
        let coat_anisotropy = p.number(COAT_ANISOTROPY)?;
        let coat = CoatLayer {
            weight: coat_weight,
            color: p.color(COAT_COLOR)?,
            ior: p.number(COAT_IOR)?,
            alpha: stretched(coat_roughness, coat_anisotropy, p)?,
            darkening: p.number(COAT_DARKENING)?,
        };
        let (subsurface_color, subsurface) = (p.color(SUBSURFACE_COLOR)?, p.number(SUBSURFACE_WEIGHT)?);
        let (micrometers, nanometers) = (p.number(FILM_THICKNESS)?, p.constant(1000.0)?);
        let sheen = SheenLayer {
            weight: p.number(FUZZ_WEIGHT)?,
            color: p.color(FUZZ_COLOR)?,
            roughness: p.number(FUZZ_ROUGHNESS)?,
        };
        let film = FilmLayer {
            weight: p.number(FILM_WEIGHT)?,
            thickness_nm: p.multiply(micrometers, nanometers)?,
            ior: p.number(FILM_IOR)?,
        };
        let ior = p.number(IOR)?;
        let (luminance, emission) = (p.number(EMISSION_LUMINANCE)?, p.color(EMISSION_COLOR)?);
        let thin_walled = p.switch(THIN_WALLED);
        let (diffuse, diffuse_transmission) = match thin_walled {
            // Under a thin wall half of it, more by its anisotropy, comes out on the other side (section 3.9).
            true => {
                let (anisotropy, half) = (p.number(SUBSURFACE_ANISOTROPY)?, p.constant(0.5)?);
                let forward = p.multiply(anisotropy, half)?;
                let (forward, weighted) = (p.add(forward, half)?, p.multiply(subsurface_color, subsurface)?);
                let (backward, zero) = (p.one_minus(forward)?, p.constant(0.0)?);
                let reflected = p.multiply(weighted, backward)?;
                let rest = p.mix(base, zero, subsurface)?;
                (p.add(rest, reflected)?, p.multiply(weighted, forward)?)
            }
            false => (p.mix(base, subsurface_color, subsurface)?, p.constant(0.0)?),
        };
        Ok(Layers {
            diffuse_roughness: p.number(DIFFUSE_ROUGHNESS)?,
            metalness: p.number(METALNESS)?,
            metal: MetalLayer::Tint { f0: p.multiply(base, specular_weight)?, f82: specular_color },
            specular_color,
            alpha,
            transmission: p.number(TRANSMISSION)?,
            transmission_tint: surface_tint(COLOR, DEPTH, p)?,
            thin_walled,
            diffuse_transmission,
            coat: Some(coat),
            sheen: Some(sheen),
            film: Some(film),
            presence: p.number(OPACITY)?,
            emission: p.multiply(emission, luminance)?,
            normal: p.network(NORMAL),
            ..Layers::plastic(diffuse, weighted_index(ior, specular_weight, p)?, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let abbe_number = scaled_abbe_number(inputs, diagnostics)?;
        let authored = layered::index(inputs, IOR, diagnostics)?;
        let mut source = inputs.source(IOR.name);
        let index = modulated_index(inputs, authored, &mut source, diagnostics)?;
        Ok(layered::glass_of(inputs, IOR.name, index, source, abbe_number))
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

/// V_d = abbe_number / scale; scale 0 is off.
fn scaled_abbe_number(inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Option<Stated>> {
    let scale = inputs.number(DISPERSION_SCALE, diagnostics)?;
    if scale < 0.0 {
        return inputs.refuse(DISPERSION_SCALE.name, "author 0 (off) or more");
    }
    if scale == 0.0 {
        return Ok(None);
    }
    let number = inputs.number(ABBE_NUMBER, diagnostics)?;
    if number <= 0.0 {
        return inputs.refuse(
            ABBE_NUMBER.name,
            "author a positive Abbe number, or transmission_dispersion_scale = 0 for no dispersion",
        );
    }
    Ok(Some(Stated {
        number: number / scale,
        source: format!("inputs:{} {number} / inputs:{} {scale}", ABBE_NUMBER.name, DISPERSION_SCALE.name),
        place: inputs.place(ABBE_NUMBER.name),
    }))
}

/// The specular weight w scales F0, and the index follows: η' = (1 + ε)/(1 − ε), ε = sgn(η − 1)·√(w·F0).
fn modulated_index(inputs: &Inputs<'_>, index: f64, source: &mut String, diagnostics: &mut Diagnostics) -> Result<f64> {
    let weight = inputs.length(SPECULAR_WEIGHT, diagnostics)?;
    // 1 leaves the index as it is, bit for bit.
    if weight.to_bits() == 1.0_f64.to_bits() {
        return Ok(index);
    }
    // √F0 with the sign of η − 1.
    let root_f0 = (index - 1.0) / (index + 1.0);
    let epsilon = root_f0 * weight.sqrt();
    if epsilon.abs() >= 1.0 {
        return inputs
            .refuse(SPECULAR_WEIGHT.name, format!("raises the reflectance at n = {index} to 1 or more, author less"));
    }
    source.push_str(&format!(" = {index} after specular_weight {weight}"));
    Ok((1.0 + epsilon) / (1.0 - epsilon))
}

/// The same for inputs that are looked up.
fn weighted_index(ior: Register, weight: Register, p: &mut Painter<'_, '_, '_>) -> Painted {
    if p.is(weight, 1.0) {
        return Ok(ior);
    }
    let one = p.constant(1.0)?;
    let (below, above) = (p.subtract(ior, one)?, p.add(ior, one)?);
    let (root_f0, root_weight) = (p.divide(below, above)?, p.sqrt(weight)?);
    let epsilon = p.multiply(root_f0, root_weight)?;
    // √F0 of the highest index that is computed with.
    let epsilon = p.clamp(epsilon, -0.9998, 0.9998)?;
    let (above, below) = (p.add(one, epsilon)?, p.subtract(one, epsilon)?);
    p.divide(above, below)
}

/// A rough coat blurs what is under it: r' = (min(1, r⁴ + 2 r_c⁴))^¼, by the weight of the coat (section 3.10).
fn under_the_coat(
    roughness: Register,
    coat_weight: Register,
    coat_roughness: Register,
    p: &mut Painter<'_, '_, '_>,
) -> Painted {
    if p.is(coat_weight, 0.0) || p.is(coat_roughness, 0.0) {
        return Ok(roughness);
    }
    let (squared, coat_squared) = (p.square(roughness)?, p.square(coat_roughness)?);
    let (fourth, coat_fourth) = (p.square(squared)?, p.square(coat_squared)?);
    let (twice, one) = (p.add(coat_fourth, coat_fourth)?, p.constant(1.0)?);
    let sum = p.add(fourth, twice)?;
    let sum = p.min(sum, one)?;
    let root = p.sqrt(sum)?;
    let blurred = p.sqrt(root)?;
    p.mix(roughness, blurred, coat_weight)
}

/// α_t = r² √(2/(1 + (1 − a)²)), α_b = (1 − a) α_t (section 2.3).
fn stretched(roughness: Register, anisotropy: Register, p: &mut Painter<'_, '_, '_>) -> Painted<[Register; 2]> {
    let (ratio, one, two) = (p.one_minus(anisotropy)?, p.constant(1.0)?, p.constant(2.0)?);
    let ratio_squared = p.square(ratio)?;
    let divisor = p.add(one, ratio_squared)?;
    let quotient = p.divide(two, divisor)?;
    let (stretch, squared) = (p.sqrt(quotient)?, p.square(roughness)?);
    let along = p.multiply(squared, stretch)?;
    Ok([along, p.multiply(along, ratio)?])
}
