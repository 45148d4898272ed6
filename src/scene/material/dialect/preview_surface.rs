//! UsdPreviewSurface.
//!
//! Specification: OpenUSD `docs/spec_usdpreviewsurface.rst` 2.6; names and defaults: `usdShaders/shaderDefs.usda`
//! 26.11 and MaterialX 1.39 `usd_preview_surface.mtlx`. It states no dispersion, no absorption and no thin walls.

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::texture::Register;

use super::super::THRESHOLD;
use super::super::appearance::{Below, OpacityInput};
use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, Layers, MetalLayer, f0_of, isotropic};
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, Word, input};
use super::vocabulary::{Glass, Response};
use super::{Dialect, layered};

const OPACITY: Number = input("opacity", 1.0);
const OPACITY_MODE: Word = input("opacityMode", "transparent");
const OPACITY_THRESHOLD: Number = input("opacityThreshold", 0.0);
const METALLIC: Number = input("metallic", 0.0);
const USE_SPECULAR_WORKFLOW: Switch = input("useSpecularWorkflow", false);
const ROUGHNESS: Number = input("roughness", 0.5);
const IOR: Number = input("ior", 1.5);
const DIFFUSE_COLOR: Color = input("diffuseColor", [0.18; 3]);
const SPECULAR_COLOR: Color = input("specularColor", [0.0; 3]);
const EMISSIVE_COLOR: Color = input("emissiveColor", [0.0; 3]);
const CLEARCOAT: Number = input("clearcoat", 0.0);
const CLEARCOAT_ROUGHNESS: Number = input("clearcoatRoughness", 0.01);
const NORMAL: &str = "normal";

pub(super) struct PreviewSurface;

impl Dialect for PreviewSurface {
    fn ids(&self) -> &'static [&'static str] {
        &["UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(OPACITY),
            Declared::Word(OPACITY_MODE),
            Declared::Number(OPACITY_THRESHOLD),
            Declared::Number(METALLIC),
            Declared::Switch(USE_SPECULAR_WORKFLOW),
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Color(DIFFUSE_COLOR),
            Declared::Color(SPECULAR_COLOR),
            Declared::Color(EMISSIVE_COLOR),
            Declared::Number(CLEARCOAT),
            Declared::Number(CLEARCOAT_ROUGHNESS),
        ]
    }

    /// Opacity under 0.5 is glass in the mode `transparent`, and a hole in the mode `presence` or under a threshold.
    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        let looked_up = self.opacity(inputs, diagnostics)?;
        if looked_up.is_some_and(|opacity| opacity.below == Below::Glass) {
            let rough = inputs.is_rough(ROUGHNESS, diagnostics)?;
            let why = "opacity is looked up: glass below 0.5, opaque elsewhere".to_owned();
            return Ok(Response::Transmissive { why, rough, thin_walled: false });
        }
        let opacity = if looked_up.is_some() { OPACITY.default } else { inputs.number(OPACITY, diagnostics)? };
        let threshold = inputs.number(OPACITY_THRESHOLD, diagnostics)?;
        let is_presence = inputs.word(OPACITY_MODE, &["transparent", "presence"])? == "presence";
        // With a threshold, what is under it is not rendered and everything else is fully opaque.
        let limit = if threshold > 0.0 { threshold } else { THRESHOLD };
        if opacity < limit {
            if threshold > 0.0 {
                return Ok(Response::CutOut(format!("opacity {opacity} under opacityThreshold {threshold}")));
            }
            if is_presence {
                return Ok(Response::CutOut(format!("opacity {opacity} in opacityMode presence")));
            }
            let rough = inputs.is_rough(ROUGHNESS, diagnostics)?;
            return Ok(Response::Transmissive { why: format!("opacity {opacity}"), rough, thin_walled: false });
        }
        let metalness = inputs.metalness(METALLIC)?;
        if metalness.value >= THRESHOLD && !inputs.switch(USE_SPECULAR_WORKFLOW, diagnostics)? {
            return Ok(Response::Metal { why: metalness.to_string(), rough: inputs.is_rough(ROUGHNESS, diagnostics)? });
        }
        let masked = if threshold > 0.0 { format!(", not under opacityThreshold {threshold}") } else { String::new() };
        Ok(Response::Opaque(format!("opacity {opacity}{masked}")))
    }

    fn opacity(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        if !inputs.is_looked_up(OPACITY.name) {
            return Ok(None);
        }
        let threshold = inputs.number(OPACITY_THRESHOLD, diagnostics)?;
        let is_presence = inputs.word(OPACITY_MODE, &["transparent", "presence"])? == "presence";
        let limit = if threshold > 0.0 { threshold } else { THRESHOLD } as f32;
        let below = if threshold > 0.0 || is_presence { Below::CutOut } else { Below::Glass };
        Ok(Some(OpacityInput { name: OPACITY.name, limit, below, is_color: false }))
    }
    /// Specular workflow: F0 is the specular colour. Metallic workflow: F0 = ((1 − ior)/(1 + ior))² under white, the metal reflects its albedo at every angle.
    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (color, ior) = (p.color(DIFFUSE_COLOR)?, p.number(IOR)?);
        let alpha = isotropic(p.number(ROUGHNESS)?, p)?;
        let (presence, transmission) = presence_and_transmission(p)?;
        let coat_roughness = p.number(CLEARCOAT_ROUGHNESS)?;
        let coat = CoatLayer {
            weight: p.number(CLEARCOAT)?,
            color: p.gray(1.0)?,
            ior,
            alpha: isotropic(coat_roughness, p)?,
            darkening: p.constant(0.0)?,
        };
        let layers = Layers {
            alpha,
            transmission,
            presence,
            coat: Some(coat),
            emission: p.color(EMISSIVE_COLOR)?,
            normal: p.network(NORMAL),
            ..Layers::plastic(color, ior, p)?
        };
        if p.switch(USE_SPECULAR_WORKFLOW) {
            return Ok(Layers { schlick_f0: Some(p.color(SPECULAR_COLOR)?), ..layers });
        }
        Ok(Layers {
            schlick_f0: Some(f0_of(ior, p)?),
            metalness: p.number(METALLIC)?,
            metal: MetalLayer::Constant(color),
            ..layers
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }
}

/// Under a threshold nothing is there, in the mode `presence` the opacity is how much, else glass is what is not opaque.
fn presence_and_transmission(p: &mut Painter<'_, '_, '_>) -> Painted<(Register, Register)> {
    let (opacity, threshold) = (p.number(OPACITY)?, p.number(OPACITY_THRESHOLD)?);
    let (zero, one) = (p.constant(0.0)?, p.constant(1.0)?);
    if p.b().value(threshold).is_none_or(|[threshold, ..]| threshold > 0.0) {
        return Ok((p.is_at_least(opacity, threshold)?, zero));
    }
    match p.word(OPACITY_MODE, &["transparent", "presence"]) {
        "presence" => Ok((opacity, zero)),
        _ => Ok((one, p.one_minus(opacity)?)),
    }
}
