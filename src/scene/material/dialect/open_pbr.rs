//! OpenPBR Surface.
//!
//! Specification: OpenPBR 1.1.1, sections on the translucent base and the specular weight; names and defaults: MaterialX
//! 1.39 `open_pbr_surface.mtlx`. Arnold's node of the same model adds `dielectric_priority` (higher wins, 0 unset; Arnold
//! User Guide, Nested Dielectrics).

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;

use super::super::Context;
use super::super::appearance::OpacityInput;
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
