//! Our own AbbeGlass: glass with the numbers of a catalogue, and `inputs:abbe:…` for laws beyond them.
//!
//! Its definition is registered with Sdr by the plug-in. The defaults are N-BK7: a shader without any input is real
//! glass. The priority is `inputs:abbe:dielectricPriority`.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::Context;
use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, isotropic, surface_tint};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, input};
use super::layered;
use super::vocabulary::{Attenuation, Glass, Response};

const IOR: Number = input("ior", 1.5168);
const ABBE_NUMBER: Number = input("abbe_number", 64.17);
const ROUGHNESS: Number = input("roughness", 0.0);
const THIN_WALLED: Switch = input("thin_walled", false);
const COLOR: Color = input("transmission_color", [1.0; 3]);
const DEPTH: Number = input("transmission_depth", 0.0);

pub(super) struct AbbeGlass;

impl Dialect for AbbeGlass {
    fn ids(&self) -> &'static [&'static str] {
        &["AbbeGlass"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(IOR),
            Declared::Number(ABBE_NUMBER),
            Declared::Number(ROUGHNESS),
            Declared::Switch(THIN_WALLED),
            Declared::Color(COLOR),
            Declared::Number(DEPTH),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        Ok(Response::Transmissive {
            why: "AbbeGlass".to_owned(),
            rough: inputs.is_rough(ROUGHNESS, diagnostics)?,
            thin_walled: inputs.switch(THIN_WALLED, diagnostics)?,
        })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (white, ior, roughness) = (p.gray(1.0)?, p.number(IOR)?, p.number(ROUGHNESS)?);
        Ok(Layers {
            alpha: isotropic(roughness, p)?,
            transmission: p.constant(1.0)?,
            transmission_tint: surface_tint(COLOR, DEPTH, p)?,
            thin_walled: p.switch(THIN_WALLED),
            ..Layers::plastic(white, ior, p)?
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
        layered::attenuation_over_depth(inputs, COLOR, DEPTH, diagnostics)
    }
}
