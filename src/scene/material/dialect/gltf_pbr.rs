//! glTF 2.0 PBR as a MaterialX node.
//!
//! Specification: Khronos KHR_materials_transmission, _volume, _ior and _dispersion; names and defaults: MaterialX 1.39
//! `gltf_pbr.mtlx` 2.0.1. Dispersion is 20/V_d, 0 is off, and more than 1 is legal. Without a thickness the wall is thin.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::appearance::{Below, OpacityInput};
use super::super::{Context, THRESHOLD};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Word, input};
use super::layered::{self, Lobe, Stated};
use super::vocabulary::{Attenuation, Glass, Response};

const ALPHA: Number = input("alpha", 1.0);
const ALPHA_MODE: Word = input("alpha_mode", "OPAQUE");
const ALPHA_CUTOFF: Number = input("alpha_cutoff", 0.5);
const METALLIC: Number = input("metallic", 1.0);
const TRANSMISSION: Number = input("transmission", 0.0);
const ROUGHNESS: Number = input("roughness", 1.0);
const THICKNESS: Number = input("thickness", 0.0);
const IOR: Number = input("ior", 1.5);
const DISPERSION: Number = input("dispersion", 0.0);
const COLOR: Color = input("attenuation_color", [1.0; 3]);
const DISTANCE: &str = "attenuation_distance";

pub(super) struct GltfPbr;

impl Dialect for GltfPbr {
    fn ids(&self) -> &'static [&'static str] {
        &["ND_gltf_pbr_surfaceshader"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(ALPHA),
            Declared::Word(ALPHA_MODE),
            Declared::Number(ALPHA_CUTOFF),
            Declared::Number(METALLIC),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Number(THICKNESS),
            Declared::Number(IOR),
            Declared::Number(DISPERSION),
            Declared::Color(COLOR),
            Declared::Unset(DISTANCE),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(limit) = limit(inputs, diagnostics)?
            && !inputs.is_looked_up(ALPHA.name)
        {
            let alpha = inputs.weight(ALPHA, diagnostics)?;
            if alpha.value < limit {
                return Ok(Response::CutOut(alpha.to_string()));
            }
        }
        let response = layered::layered(
            inputs,
            inputs.weight(TRANSMISSION, diagnostics)?,
            inputs.metalness(METALLIC)?,
            |diagnostics| {
                Ok(Lobe {
                    rough: inputs.is_rough(ROUGHNESS, diagnostics)?,
                    thin_walled: inputs.length(THICKNESS, diagnostics)? == 0.0,
                })
            },
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )?;
        let is_thin_glass = matches!(response, Response::Transmissive { thin_walled: true, .. });
        if is_thin_glass && inputs.number(DISPERSION, diagnostics)? > 0.0 {
            diagnostics.warn(
                "thin-wall-dispersion",
                inputs.place(DISPERSION.name),
                "glTF glass without thickness is a thin wall and does not disperse: author inputs:thickness > 0",
            );
        }
        Ok(response)
    }

    fn opacity(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        let limit = if inputs.is_looked_up(ALPHA.name) { limit(inputs, diagnostics)? } else { None };
        let cut_out =
            |limit| OpacityInput { name: ALPHA.name, limit: limit as f32, below: Below::CutOut, is_color: false };
        Ok(limit.map(cut_out))
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let dispersion = inputs.number(DISPERSION, diagnostics)?;
        if dispersion < 0.0 {
            return inputs.refuse(DISPERSION.name, "author 20 / V_d, or 0 for no dispersion");
        }
        let abbe_number = (dispersion > 0.0).then(|| Stated {
            number: 20.0 / dispersion,
            source: format!("20 / inputs:{} {dispersion}", DISPERSION.name),
            place: inputs.place(DISPERSION.name),
        });
        layered::glass(inputs, IOR, abbe_number, diagnostics)
    }

    /// The distance is infinite unless authored.
    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        _: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        match inputs.authored_number(DISTANCE, diagnostics)? {
            None => Ok(None),
            Some(distance) if distance > 0.0 => layered::attenuation(inputs, COLOR, distance, diagnostics),
            Some(_) => inputs.refuse(DISTANCE, "author a positive distance, or nothing for no absorption"),
        }
    }
}

/// The alpha below which the surface is not there; in the mode OPAQUE alpha is ignored.
fn limit(inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Option<f64>> {
    Ok(match inputs.word(ALPHA_MODE, &["OPAQUE", "MASK", "BLEND"])? {
        "MASK" => Some(inputs.number(ALPHA_CUTOFF, diagnostics)?),
        "BLEND" => Some(THRESHOLD),
        _ => None,
    })
}
