//! glTF 2.0 PBR as a MaterialX node.
//!
//! Specification: Khronos KHR_materials_transmission, _volume, _ior and _dispersion; names and defaults: MaterialX 1.39
//! `gltf_pbr.mtlx` 2.0.1. Dispersion is 20/V_d, 0 is off, and more than 1 is legal. Without a thickness the wall is thin.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::appearance::{Below, OpacityInput};
use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, FilmLayer, Layers, MetalLayer, SheenLayer, f0_of, isotropic};
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
const BASE_COLOR: Color = input("base_color", [1.0; 3]);
const SPECULAR: Number = input("specular", 1.0);
const SPECULAR_COLOR: Color = input("specular_color", [1.0; 3]);
const IRIDESCENCE: Number = input("iridescence", 0.0);
const IRIDESCENCE_IOR: Number = input("iridescence_ior", 1.3);
const IRIDESCENCE_THICKNESS: Number = input("iridescence_thickness", 100.0);
const SHEEN_COLOR: Color = input("sheen_color", [0.0; 3]);
const SHEEN_ROUGHNESS: Number = input("sheen_roughness", 0.0);
const CLEARCOAT: Number = input("clearcoat", 0.0);
const CLEARCOAT_ROUGHNESS: Number = input("clearcoat_roughness", 0.0);
const EMISSIVE: Color = input("emissive", [0.0; 3]);
const EMISSIVE_STRENGTH: Number = input("emissive_strength", 1.0);
const ANISOTROPY_STRENGTH: Number = input("anisotropy_strength", 0.0);
const ANISOTROPY_ROTATION: Number = input("anisotropy_rotation", 0.0);
const NORMAL: &str = "normal";
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

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Color(BASE_COLOR),
            Declared::Number(SPECULAR),
            Declared::Color(SPECULAR_COLOR),
            Declared::Number(IRIDESCENCE),
            Declared::Number(IRIDESCENCE_IOR),
            Declared::Number(IRIDESCENCE_THICKNESS),
            Declared::Color(SHEEN_COLOR),
            Declared::Number(SHEEN_ROUGHNESS),
            Declared::Number(CLEARCOAT),
            Declared::Number(CLEARCOAT_ROUGHNESS),
            Declared::Color(EMISSIVE),
            Declared::Number(EMISSIVE_STRENGTH),
            Declared::Number(ANISOTROPY_STRENGTH),
            Declared::Number(ANISOTROPY_ROTATION),
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

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let color = p.color(BASE_COLOR)?;
        // F0 = min(((1 − n)/(1 + n))² specular_color, 1); where there is a film it is on the index.
        let (ior, specular, specular_color) = (p.number(IOR)?, p.number(SPECULAR)?, p.color(SPECULAR_COLOR)?);
        let f0 = f0_of(ior, p)?;
        let (f0, white) = (p.multiply(specular_color, f0)?, p.gray(1.0)?);
        let f0 = p.min(f0, white)?;
        let clearcoat_roughness = p.number(CLEARCOAT_ROUGHNESS)?;
        let coat = CoatLayer {
            weight: p.number(CLEARCOAT)?,
            color: p.gray(1.0)?,
            ior: p.constant(1.5)?,
            alpha: isotropic(clearcoat_roughness, p)?,
            darkening: p.constant(0.0)?,
        };
        let sheen_roughness = p.number(SHEEN_ROUGHNESS)?;
        let sheen = SheenLayer {
            weight: p.constant(1.0)?,
            color: p.color(SHEEN_COLOR)?,
            roughness: p.square(sheen_roughness)?,
        };
        let film = FilmLayer {
            weight: p.number(IRIDESCENCE)?,
            thickness_nm: p.number(IRIDESCENCE_THICKNESS)?,
            ior: p.number(IRIDESCENCE_IOR)?,
        };
        let has_film = !p.is(film.weight, 0.0);
        // KHR_materials_anisotropy: α_t = mix(α, 1, strength²), α_b = α.
        let roughness = p.number(ROUGHNESS)?;
        let (alpha, strength) = (p.square(roughness)?, p.number(ANISOTROPY_STRENGTH)?);
        let (strength, one) = (p.square(strength)?, p.constant(1.0)?);
        let along = p.mix(alpha, one, strength)?;
        let (radians, turns) = (p.number(ANISOTROPY_ROTATION)?, p.constant(std::f32::consts::TAU.recip())?);
        let (strength, emissive) = (p.number(EMISSIVE_STRENGTH)?, p.color(EMISSIVE)?);
        let thickness = p.number(THICKNESS)?;
        Ok(Layers {
            metalness: p.number(METALLIC)?,
            metal: MetalLayer::Tint { f0: color, f82: white },
            specular_weight: specular,
            specular_color: if has_film { specular_color } else { white },
            schlick_f0: (!has_film).then_some(f0),
            alpha: [along, alpha],
            transmission: p.number(TRANSMISSION)?,
            transmission_tint: color,
            thin_walled: p.is(thickness, 0.0),
            coat: Some(coat),
            sheen: Some(sheen),
            film: Some(film),
            presence: presence(p)?,
            emission: p.multiply(emissive, strength)?,
            normal: p.network(NORMAL),
            rotation: p.multiply(radians, turns)?,
            ..Layers::plastic(color, ior, p)?
        })
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

/// 1 in the mode OPAQUE, cut at `alpha_cutoff` in MASK, alpha in BLEND.
fn presence(p: &mut Painter<'_, '_, '_>) -> Painted {
    match p.word(ALPHA_MODE, &["OPAQUE", "MASK", "BLEND"]) {
        "MASK" => {
            let (alpha, cutoff) = (p.number(ALPHA)?, p.number(ALPHA_CUTOFF)?);
            p.is_at_least(alpha, cutoff)
        }
        "BLEND" => p.number(ALPHA),
        _ => p.constant(1.0),
    }
}
