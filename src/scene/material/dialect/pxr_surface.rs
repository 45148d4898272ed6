//! The glass lobe of RenderMan's PxrSurface.
//!
//! Names: OpenUSD `third_party/renderman-*/plugin/hdPrman/matfiltConvertPreviewMaterial.cpp` (`refractionGain`, `glassIor`,
//! `glassRoughness`, `presence`) and Mari's exporter of the node (the others). Meaning, and the default of the index: the
//! RenderMan documentation, PxrSurface, Glass Parameters. The other defaults are those of RenderMan's own node definition
//! and were not verified against a public source. It states no dispersion; `extinction` and `ssAlbedo` have no published
//! formula and are not read.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::THRESHOLD;
use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, isotropic};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, input};
use super::layered;
use super::vocabulary::{Glass, Response};

const PRESENCE: Number = input("presence", 1.0);
const REFRACTION_GAIN: Number = input("refractionGain", 0.0);
const THIN: Switch = input("thinGlass", false);
const ROUGHNESS: Number = input("glassRoughness", 0.1);
const REFRACTION_ROUGHNESS: Number = input("glassRefractionRoughness", -1.0);
const IOR: Number = input("glassIor", 1.5);
const DIFFUSE_GAIN: Number = input("diffuseGain", 1.0);
const DIFFUSE_COLOR: Color = input("diffuseColor", [0.18; 3]);
const REFRACTION_COLOR: Color = input("refractionColor", [1.0; 3]);
const EXTINCTION: Color = input("extinction", [0.0; 3]);

pub(super) struct PxrSurface;

impl Dialect for PxrSurface {
    fn ids(&self) -> &'static [&'static str] {
        &["PxrSurface"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(PRESENCE),
            Declared::Number(REFRACTION_GAIN),
            Declared::Switch(THIN),
            Declared::Number(ROUGHNESS),
            Declared::Number(REFRACTION_ROUGHNESS),
            Declared::Number(IOR),
            Declared::Color(EXTINCTION),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Number(DIFFUSE_GAIN), Declared::Color(DIFFUSE_COLOR), Declared::Color(REFRACTION_COLOR)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(why) = inputs.cut_out(PRESENCE, diagnostics)? {
            return Ok(Response::CutOut(why));
        }
        let gain = inputs.weight(REFRACTION_GAIN, diagnostics)?;
        if gain.value < THRESHOLD {
            return Ok(Response::Opaque(gain.to_string()));
        }
        if !layered::is_black(inputs.color(EXTINCTION, diagnostics)?) {
            inputs.warn_unread(
                EXTINCTION.name,
                "the interior of PxrSurface is not read: its glass is clear",
                diagnostics,
            );
        }
        // Negative: as the reflection.
        let is_separate = inputs.number(REFRACTION_ROUGHNESS, diagnostics)? >= 0.0;
        let rough = inputs.is_rough(if is_separate { REFRACTION_ROUGHNESS } else { ROUGHNESS }, diagnostics)?;
        Ok(Response::Transmissive { why: gain.to_string(), rough, thin_walled: inputs.switch(THIN, diagnostics)? })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (gain, color, ior) = (p.number(DIFFUSE_GAIN)?, p.color(DIFFUSE_COLOR)?, p.number(IOR)?);
        let (base, transmission) = (p.multiply(color, gain)?, p.number(REFRACTION_GAIN)?);
        let roughness = p.number(ROUGHNESS)?;
        // The dielectric is the glass lobe's; the specular lobes are not read.
        Ok(Layers {
            specular_weight: transmission,
            alpha: isotropic(roughness, p)?,
            transmission,
            transmission_tint: p.color(REFRACTION_COLOR)?,
            thin_walled: p.switch(THIN),
            presence: p.number(PRESENCE)?,
            ..Layers::plastic(base, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }
}
