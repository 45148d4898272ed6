//! V-Ray's BRDFVRayMtl.
//!
//! Names, defaults and meanings: `ChaosGroup/vray_for_blender_addon` `plugins_desc/BRDF/BRDFVRayMtl.json`. The weight of
//! the refraction is a colour; dispersion is the Abbe number itself and counts where it is switched on; glossiness is
//! 1 − roughness unless `option_use_roughness` says that it is the roughness. The fog's colour is what is left after
//! `fog_depth`/`fog_mult` centimetres, or stage units without `fog_unit_scale_on`. That the power is
//! `fog_mult`·distance/`fog_depth` is taken from the words of that description; no published formula was found.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, MetalLayer, isotropic};
use super::super::{Context, SMOOTH_ROUGHNESS};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, input};
use super::layered::{self, Lobe};
use super::vocabulary::{Attenuation, Glass, Response};

const OPACITY: Number = input("opacity", 1.0);
const METALNESS: Number = input("metalness", 0.0);
const REFRACT: Number = input("refract", 0.0);
const THIN_WALLED: Switch = input("refract_thin_walled", false);
const REFLECT_GLOSSINESS: Number = input("reflect_glossiness", 1.0);
const REFRACT_GLOSSINESS: Number = input("refract_glossiness", 1.0);
const USE_ROUGHNESS: Switch = input("option_use_roughness", false);
const IOR: Number = input("refract_ior", 1.6);
const DISPERSION_ON: Switch = input("dispersion_on", false);
const ABBE_NUMBER: Number = input("dispersion", 50.0);
const DIFFUSE: Color = input("diffuse", [0.5; 3]);
const DIFFUSE_ROUGHNESS: Number = input("roughness", 0.0);
const REFLECT: Color = input("reflect", [0.0; 3]);
const REFRACT_COLOR: Color = input("refract", [0.0; 3]);
const FOG_COLOR: Color = input("fog_color", [1.0; 3]);
const FOG_MULT: Number = input("fog_mult", 1.0);
const FOG_DEPTH: Number = input("fog_depth", 1.0);
const FOG_UNIT_SCALE: Switch = input("fog_unit_scale_on", true);
const FOG_BIAS: Number = input("fog_bias", 0.0);

const METERS_PER_CENTIMETER: f64 = 0.01;

pub(super) struct VRayMtl;

impl Dialect for VRayMtl {
    fn ids(&self) -> &'static [&'static str] {
        &["vray:BRDFVRayMtl", "BRDFVRayMtl"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(OPACITY),
            Declared::Number(METALNESS),
            Declared::Number(REFRACT),
            Declared::Switch(THIN_WALLED),
            Declared::Number(REFLECT_GLOSSINESS),
            Declared::Number(REFRACT_GLOSSINESS),
            Declared::Switch(USE_ROUGHNESS),
            Declared::Number(IOR),
            Declared::Switch(DISPERSION_ON),
            Declared::Number(ABBE_NUMBER),
            Declared::Color(FOG_COLOR),
            Declared::Number(FOG_MULT),
            Declared::Number(FOG_DEPTH),
            Declared::Switch(FOG_UNIT_SCALE),
            Declared::Number(FOG_BIAS),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Color(DIFFUSE), Declared::Number(DIFFUSE_ROUGHNESS), Declared::Color(REFLECT)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(why) = inputs.cut_out(OPACITY, diagnostics)? {
            return Ok(Response::CutOut(why));
        }
        layered::layered(
            inputs,
            inputs.weight(REFRACT, diagnostics)?,
            inputs.metalness(METALNESS)?,
            |diagnostics| {
                Ok(Lobe {
                    rough: is_rough(inputs, REFRACT_GLOSSINESS, diagnostics)?,
                    thin_walled: inputs.switch(THIN_WALLED, diagnostics)?,
                })
            },
            |diagnostics| is_rough(inputs, REFLECT_GLOSSINESS, diagnostics),
            diagnostics,
        )
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (diffuse, reflect, refract) = (p.color(DIFFUSE)?, p.color(REFLECT)?, p.color(REFRACT_COLOR)?);
        let transmission = p.mean_of_color(REFRACT)?;
        let (metalness, white) = (p.number(METALNESS)?, p.gray(1.0)?);
        let mut roughness = p.number(REFLECT_GLOSSINESS)?;
        if !p.switch(USE_ROUGHNESS) {
            roughness = p.one_minus(roughness)?;
        }
        // The weight is a colour: its mean is the share, the rest a tint.
        let tiny = p.constant(f32::MIN_POSITIVE)?;
        let divisor = p.max(transmission, tiny)?;
        let ior = p.number(IOR)?;
        Ok(Layers {
            diffuse_roughness: p.number(DIFFUSE_ROUGHNESS)?,
            metalness,
            metal: MetalLayer::Tint { f0: diffuse, f82: white },
            specular_color: reflect,
            alpha: isotropic(roughness, p)?,
            transmission,
            transmission_tint: p.divide(refract, divisor)?,
            thin_walled: p.switch(THIN_WALLED),
            presence: p.mean_of_color(OPACITY)?,
            ..Layers::plastic(diffuse, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let abbe_number = match inputs.switch(DISPERSION_ON, diagnostics)? {
            true => layered::abbe_number(inputs, ABBE_NUMBER, diagnostics)?,
            false => None,
        };
        layered::glass(inputs, IOR, abbe_number, diagnostics)
    }

    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        context: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        let multiplier = inputs.length(FOG_MULT, diagnostics)?;
        if multiplier == 0.0 {
            return Ok(None);
        }
        if inputs.number(FOG_BIAS, diagnostics)? != 0.0 {
            inputs.warn_unread(FOG_BIAS.name, "the fog's colour is not biased with depth here", diagnostics);
        }
        let depth = inputs.length(FOG_DEPTH, diagnostics)?;
        if depth == 0.0 {
            return inputs.refuse(FOG_DEPTH.name, "author a positive factor, or fog_mult = 0 for no absorption");
        }
        let unit = match inputs.switch(FOG_UNIT_SCALE, diagnostics)? {
            true => METERS_PER_CENTIMETER / context.meters_per_unit,
            false => 1.0,
        };
        layered::attenuation(inputs, FOG_COLOR, unit * depth / multiplier, diagnostics)
    }
}

fn is_rough(inputs: &Inputs<'_>, glossiness: Number, diagnostics: &mut Diagnostics) -> Result<bool> {
    let is_roughness = inputs.switch(USE_ROUGHNESS, diagnostics)?;
    let value = inputs.number(glossiness, diagnostics)?;
    Ok(if is_roughness { value } else { 1.0 - value } > SMOOTH_ROUGHNESS)
}
