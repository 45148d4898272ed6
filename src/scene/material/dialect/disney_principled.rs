//! The Disney Principled BSDF as a MaterialX node.
//!
//! Names, defaults and formulas: MaterialX 1.39 `disney_principled.mtlx`. It states no dispersion and no absorption, has
//! no opacity, and its transmission lobe is smooth whatever the roughness, which is the reflection's.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, Layers, MetalLayer, SheenLayer, anisotropic, isotropic};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, input};
use super::layered::{self, Lobe};
use super::vocabulary::{Glass, Response};

const METALLIC: Number = input("metallic", 0.0);
const TRANSMISSION: Number = input("specTrans", 0.0);
const ROUGHNESS: Number = input("roughness", 0.5);
const IOR: Number = input("ior", 1.5);
const BASE_COLOR: Color = input("baseColor", [0.16; 3]);
const SPECULAR: Number = input("specular", 0.5);
const SPECULAR_TINT: Number = input("specularTint", 0.0);
const ANISOTROPIC: Number = input("anisotropic", 0.0);
const SHEEN: Number = input("sheen", 0.0);
const SHEEN_TINT: Number = input("sheenTint", 0.5);
const CLEARCOAT: Number = input("clearcoat", 0.0);
const CLEARCOAT_GLOSS: Number = input("clearcoatGloss", 1.0);

pub(super) struct DisneyPrincipled;

impl Dialect for DisneyPrincipled {
    fn ids(&self) -> &'static [&'static str] {
        &["ND_disney_principled"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(METALLIC),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Color(BASE_COLOR),
            Declared::Number(SPECULAR),
            Declared::Number(SPECULAR_TINT),
            Declared::Number(ANISOTROPIC),
            Declared::Number(SHEEN),
            Declared::Number(SHEEN_TINT),
            Declared::Number(CLEARCOAT),
            Declared::Number(CLEARCOAT_GLOSS),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        layered::layered(
            inputs,
            inputs.weight(TRANSMISSION, diagnostics)?,
            inputs.metalness(METALLIC)?,
            |_| Ok(Lobe { rough: false, thin_walled: false }),
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let color = p.color(BASE_COLOR)?;
        let (specular, range) = (p.number(SPECULAR)?, p.constant(0.08)?);
        let intensity = p.multiply(specular, range)?;
        let (white, tint) = (p.gray(1.0)?, p.number(SPECULAR_TINT)?);
        let tint = p.mix(white, color, tint)?;
        let (sheen, sheen_tint) = (p.number(SHEEN)?, p.number(SHEEN_TINT)?);
        let gloss = p.number(CLEARCOAT_GLOSS)?;
        let coat_roughness = p.one_minus(gloss)?;
        let coat = CoatLayer {
            weight: p.number(CLEARCOAT)?,
            color: white,
            ior: p.constant(1.5)?,
            alpha: isotropic(coat_roughness, p)?,
            darkening: p.constant(0.0)?,
        };
        let (roughness, anisotropy) = (p.number(ROUGHNESS)?, p.number(ANISOTROPIC)?);
        let sheen_layer =
            SheenLayer { weight: sheen, color: p.mix(white, color, sheen_tint)?, roughness: p.constant(0.3)? };
        let ior = p.number(IOR)?;
        Ok(Layers {
            metalness: p.number(METALLIC)?,
            metal: MetalLayer::Tint { f0: color, f82: white },
            schlick_f0: Some(p.multiply(tint, intensity)?),
            alpha: anisotropic(roughness, anisotropy, p)?,
            transmission: p.number(TRANSMISSION)?,
            transmission_tint: color,
            coat: Some(coat),
            sheen: Some(sheen_layer),
            ..Layers::plastic(color, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }
}
