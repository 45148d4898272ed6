//! The glasses of NVIDIA's MDL core definitions.
//!
//! Names, defaults and formulas: `nvidia/core_definitions.mdl` (as in `pablode/gatling` `src/gi/mdl/`), `thick_glass_v2`,
//! `thin_glass_v2` and their deprecated forerunners with the same inputs. The Abbe number is itself, 0 is off. The volume
//! colour is reached after `base_thickness` metres; the transmission colour tints the surface, of a pane the glass
//! colour.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::Context;
use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, isotropic};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, input};
use super::layered;
use super::vocabulary::{Attenuation, Glass, Response};

const ROUGHNESS: Number = input("roughness", 0.0);
const IOR: Number = input("ior", 1.4);
const ABBE_NUMBER: Number = input("abbe_number", 0.0);
const COLOR: Color = input("glass_color", [0.95; 3]);
const TRANSMISSION_COLOR: Color = input("transmission_color", [1.0; 3]);
const THICKNESS: Number = input("base_thickness", 0.1);

/// Solid.
pub(super) struct ThickGlass;

/// A pane without an inside; its index changes the reflection alone.
pub(super) struct ThinGlass;

impl Dialect for ThickGlass {
    fn ids(&self) -> &'static [&'static str] {
        &["thick_glass_v2", "thick_glass"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
            Declared::Number(ABBE_NUMBER),
            Declared::Color(COLOR),
            Declared::Number(THICKNESS),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Color(TRANSMISSION_COLOR)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        let rough = inputs.is_rough(ROUGHNESS, diagnostics)?;
        Ok(Response::Transmissive { why: "thick glass".to_owned(), rough, thin_walled: false })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (white, ior, roughness) = (p.gray(1.0)?, p.number(IOR)?, p.number(ROUGHNESS)?);
        Ok(Layers {
            alpha: isotropic(roughness, p)?,
            transmission: p.constant(1.0)?,
            transmission_tint: p.color(TRANSMISSION_COLOR)?,
            thin_walled: false,
            ..Layers::plastic(white, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let abbe_number = layered::abbe_number(inputs, ABBE_NUMBER, diagnostics)?;
        layered::glass(inputs, IOR, abbe_number, diagnostics)
    }

    /// σ = −ln(color)/thickness per metre; a thickness of 0 or less is no absorption.
    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        context: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        let thickness = inputs.number(THICKNESS, diagnostics)?;
        if thickness <= 0.0 {
            return Ok(None);
        }
        layered::attenuation(inputs, COLOR, thickness / context.meters_per_unit, diagnostics)
    }
}

impl Dialect for ThinGlass {
    fn ids(&self) -> &'static [&'static str] {
        &["thin_glass_v2", "thin_glass"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[Declared::Number(ROUGHNESS), Declared::Number(IOR)]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Color(COLOR)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        let rough = inputs.is_rough(ROUGHNESS, diagnostics)?;
        Ok(Response::Transmissive { why: "thin glass".to_owned(), rough, thin_walled: true })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (white, ior, roughness) = (p.gray(1.0)?, p.number(IOR)?, p.number(ROUGHNESS)?);
        Ok(Layers {
            alpha: isotropic(roughness, p)?,
            transmission: p.constant(1.0)?,
            transmission_tint: p.color(COLOR)?,
            thin_walled: true,
            ..Layers::plastic(white, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }
}
