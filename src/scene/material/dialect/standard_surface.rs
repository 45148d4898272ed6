//! Autodesk Standard Surface, and Arnold's node of it.
//!
//! Specification: Autodesk Standard Surface 1.0.1; names and defaults: MaterialX 1.39 `standard_surface.mtlx`, both
//! versions. Dispersion is the Abbe number itself, 0 is off. Arnold's node adds `dielectric_priority` (higher wins, 0
//! unset, negative weaker than unset; Arnold User Guide, Nested Dielectrics).

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;

use super::super::appearance::OpacityInput;
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
