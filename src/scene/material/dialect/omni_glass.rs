//! NVIDIA's OmniGlass.
//!
//! Names, defaults and formulas: `OmniGlass.mdl` and `OmniGlass_Opacity.mdl` (as in `pablode/gatling` `src/gi/mdl/`). It
//! states no dispersion. The glass colour tints the surface; `depth` is the coefficient of a grey absorption, per metre
//! as everywhere in MDL.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, isotropic};
use super::super::{Context, THRESHOLD};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, input};
use super::layered::{self, presence};
use super::vocabulary::{Attenuation, Glass, Response};

const ENABLE_OPACITY: Switch = input("enable_opacity", false);
const OPACITY: Number = input("cutout_opacity", 1.0);
const OPACITY_THRESHOLD: Number = input("opacity_threshold", 0.0);
const THIN_WALLED: Switch = input("thin_walled", false);
const ROUGHNESS: Number = input("frosting_roughness", 0.0);
const IOR: Number = input("glass_ior", 1.491);
const COLOR: Color = input("glass_color", [1.0; 3]);
const REFLECTION_COLOR: Color = input("reflection_color", [1.0; 3]);
const DEPTH: Number = input("depth", 0.001);

pub(super) struct OmniGlass;

impl Dialect for OmniGlass {
    fn ids(&self) -> &'static [&'static str] {
        &["OmniGlass", "OmniGlass_Opacity"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Switch(ENABLE_OPACITY),
            Declared::Number(OPACITY),
            Declared::Number(OPACITY_THRESHOLD),
            Declared::Switch(THIN_WALLED),
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
            Declared::Number(DEPTH),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Color(COLOR), Declared::Color(REFLECTION_COLOR)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        let opacity = inputs.weight(OPACITY, diagnostics)?;
        if inputs.switch(ENABLE_OPACITY, diagnostics)? {
            let threshold = inputs.number(OPACITY_THRESHOLD, diagnostics)?;
            let limit = if threshold > 0.0 { threshold } else { THRESHOLD };
            if opacity.value < limit {
                return Ok(Response::CutOut(opacity.to_string()));
            }
        }
        Ok(Response::Transmissive {
            why: "OmniGlass".to_owned(),
            rough: inputs.is_rough(ROUGHNESS, diagnostics)?,
            // The material makes itself thin-walled where its opacity is anything but 1.
            thin_walled: inputs.switch(THIN_WALLED, diagnostics)? || opacity.value < 1.0,
        })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let opacity = p.number(OPACITY)?;
        let presence = presence(p, ENABLE_OPACITY, OPACITY, OPACITY_THRESHOLD)?;
        let (white, ior, roughness) = (p.gray(1.0)?, p.number(IOR)?, p.number(ROUGHNESS)?);
        Ok(Layers {
            alpha: isotropic(roughness, p)?,
            transmission: p.constant(1.0)?,
            specular_color: p.color(REFLECTION_COLOR)?,
            transmission_tint: p.color(COLOR)?,
            thin_walled: p.switch(THIN_WALLED) || p.b().value(opacity).is_some_and(|[opacity, ..]| opacity < 1.0),
            presence,
            ..Layers::plastic(white, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }

    /// σ = depth: 1/e is left after 1/depth metres.
    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        context: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        let coefficient = inputs.length(DEPTH, diagnostics)?;
        Ok((coefficient > 0.0).then(|| Attenuation {
            color: [(-1.0_f64).exp(); 3],
            distance: 1.0 / (coefficient * context.meters_per_unit),
            place: inputs.place(DEPTH.name),
        }))
    }
}
