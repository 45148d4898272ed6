//! LamaDielectric, of RenderMan and of MaterialX.
//!
//! Names, defaults and formulas: MaterialX 1.39 `lama/lama_dielectric.mtlx`. It states no dispersion. In the Artistic mode
//! the index comes from the reflectivity at normal incidence. The absorption colour is reached at the absorption radius,
//! as the node's documentation says (its MaterialX graph divides the colour by the radius instead, which would absorb
//! what the colour is to let pass).

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::Context;
use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, anisotropic, index_of};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Word, input};
use super::layered;
use super::vocabulary::{Attenuation, Glass, Response};

const FRESNEL_MODE: Word = input("fresnelMode", "Artistic");
const REFLECTIVITY: Number = input("reflectivity", 0.04);
const IOR: Number = input("IOR", 1.5);
const ROUGHNESS: Number = input("roughness", 0.1);
const REFLECTION_TINT: Color = input("reflectionTint", [1.0; 3]);
const TRANSMISSION_TINT: Color = input("transmissionTint", [1.0; 3]);
const ANISOTROPY: Number = input("anisotropy", 0.0);
const ROTATION: Number = input("rotation", 0.0);
const NORMAL: &str = "normal";
const COLOR: Color = input("absorptionColor", [1.0; 3]);
const RADIUS: Number = input("absorptionRadius", 1.0);

pub(super) struct LamaDielectric;

impl Dialect for LamaDielectric {
    fn ids(&self) -> &'static [&'static str] {
        &["LamaDielectric", "ND_lama_dielectric"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Word(FRESNEL_MODE),
            Declared::Number(REFLECTIVITY),
            Declared::Number(IOR),
            Declared::Number(ROUGHNESS),
            Declared::Color(COLOR),
            Declared::Number(RADIUS),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Color(REFLECTION_TINT),
            Declared::Color(TRANSMISSION_TINT),
            Declared::Number(ANISOTROPY),
            Declared::Number(ROTATION),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        let rough = inputs.is_rough(ROUGHNESS, diagnostics)?;
        Ok(Response::Transmissive { why: "LamaDielectric".to_owned(), rough, thin_walled: false })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (white, roughness, anisotropy) = (p.gray(1.0)?, p.number(ROUGHNESS)?, p.number(ANISOTROPY)?);
        let (turns, minus) = (p.number(ROTATION)?, p.constant(-1.0)?);
        let rotation = p.multiply(turns, minus)?;
        let ior = match p.word(FRESNEL_MODE, &["Artistic", "Scientific"]) {
            "Scientific" => p.number(IOR)?,
            _ => {
                let f0 = p.number(REFLECTIVITY)?;
                index_of(f0, p)?
            }
        };
        Ok(Layers {
            specular_color: p.color(REFLECTION_TINT)?,
            alpha: anisotropic(roughness, anisotropy, p)?,
            transmission: p.constant(1.0)?,
            transmission_tint: p.color(TRANSMISSION_TINT)?,
            normal: p.network(NORMAL),
            rotation,
            ..Layers::plastic(white, ior, p)?
        })
    }

    /// Artistic: r = ((n − 1)/(n + 1))², so n = (1 + √r)/(1 − √r). Scientific: the index itself.
    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        if inputs.word(FRESNEL_MODE, &["Artistic", "Scientific"])? == "Scientific" {
            return layered::glass(inputs, IOR, None, diagnostics);
        }
        let reflectivity = inputs.number(REFLECTIVITY, diagnostics)?;
        if !(0.0..1.0).contains(&reflectivity) {
            return inputs.refuse(REFLECTIVITY.name, "author the reflectance at normal incidence, from 0 to below 1");
        }
        let root = reflectivity.sqrt();
        let source = format!("{} (Artistic)", inputs.source(REFLECTIVITY.name));
        Ok(layered::glass_of(inputs, REFLECTIVITY.name, (1.0 + root) / (1.0 - root), source, None))
    }

    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        _: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        let radius = inputs.number(RADIUS, diagnostics)?;
        if radius <= 0.0 {
            return inputs.refuse(RADIUS.name, "author a positive distance; for no absorption a white absorptionColor");
        }
        layered::attenuation(inputs, COLOR, radius, diagnostics)
    }
}
