//! MoonRay's DwaRefractiveMaterial and DwaBaseMaterial.
//!
//! Names and defaults: `dreamworksanimation/moonshine` `lib/material/dwabase/json/{transmission,refractive_index,
//! roughness,misc}.json` and `dso/material/{DwaRefractive,DwaBase}/*.json`; the meaning of unset independent values:
//! `lib/material/dwabase/DwaBase.cc`; `priority` (0 is ignored, lower wins): the OpenMoonRay reference of the two
//! materials. In USD the identifier is the class name (hdMoonray's test suite). The transmission colour tints the
//! surface; a volume is a shader of its own there (BaseVolume), which is not read.

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;

use super::super::THRESHOLD;
use super::super::painter::{Painted, Painter};
use super::super::surface::{Layers, MetalLayer, isotropic};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Integer, Number, Switch, input};
use super::layered::{self, Lobe};
use super::vocabulary::{Glass, Response};

const PRESENCE: Number = input("presence", 1.0);
const THIN_GEOMETRY: Switch = input("thin_geometry", false);
const METALLIC: Number = input("metallic", 0.0);
const TRANSMISSION: Number = input("transmission", 0.0);
const SHOW_TRANSMISSION: Switch = input("show_transmission", true);
const ROUGHNESS: Number = input("roughness", 0.5);
const USE_INDEPENDENT_ROUGHNESS: Switch = input("use_independent_transmission_roughness", false);
const INDEPENDENT_ROUGHNESS: Number = input("independent_transmission_roughness", 0.5);
const IOR: Number = input("refractive_index", 1.5);
const USE_INDEPENDENT_IOR: Switch = input("use_independent_transmission_refractive_index", false);
const INDEPENDENT_IOR: Number = input("independent_transmission_refractive_index", 1.5);
const TRANSMISSION_COLOR: Color = input("transmission_color", [1.0; 3]);
const ALBEDO: Color = input("albedo", [1.0; 3]);
const DIFFUSE_ROUGHNESS: Number = input("diffuse_roughness", 0.0);
const METALLIC_COLOR: Color = input("metallic_color", [1.0; 3]);
const METALLIC_EDGE_COLOR: Color = input("metallic_edge_color", [1.0; 3]);
const SPECULAR: Number = input("specular", 1.0);
const USE_DISPERSION: Switch = input("use_dispersion", false);
const ABBE_NUMBER: Number = input("dispersion_abbe_number", 34.0);
const PRIORITY: Integer = input("priority", 0);

/// Glass and nothing else.
pub(super) struct DwaRefractive;

/// Everything, glass by a weight.
pub(super) struct DwaBase;

impl Dialect for DwaRefractive {
    fn ids(&self) -> &'static [&'static str] {
        &["DwaRefractiveMaterial"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(PRESENCE),
            Declared::Switch(SHOW_TRANSMISSION),
            Declared::Switch(THIN_GEOMETRY),
            Declared::Number(ROUGHNESS),
            Declared::Switch(USE_INDEPENDENT_ROUGHNESS),
            Declared::Number(INDEPENDENT_ROUGHNESS),
            Declared::Number(IOR),
            Declared::Switch(USE_INDEPENDENT_IOR),
            Declared::Number(INDEPENDENT_IOR),
            Declared::Switch(USE_DISPERSION),
            Declared::Number(ABBE_NUMBER),
            Declared::Integer(PRIORITY),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[Declared::Color(TRANSMISSION_COLOR)]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(why) = inputs.cut_out(PRESENCE, diagnostics)? {
            return Ok(Response::CutOut(why));
        }
        let shown = inputs.switch(SHOW_TRANSMISSION, diagnostics)?;
        let why = format!("{} {shown}", SHOW_TRANSMISSION.name);
        if !shown {
            return Ok(Response::Opaque(why));
        }
        let Lobe { rough, thin_walled } = lobe(inputs, diagnostics)?;
        Ok(Response::Transmissive { why, rough, thin_walled })
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (shown, white) = (p.switch(SHOW_TRANSMISSION), p.gray(1.0)?);
        let roughness = match shown && p.switch(USE_INDEPENDENT_ROUGHNESS) {
            true => p.number(INDEPENDENT_ROUGHNESS)?,
            false => p.number(ROUGHNESS)?,
        };
        let ior = match shown && p.switch(USE_INDEPENDENT_IOR) {
            true => p.number(INDEPENDENT_IOR)?,
            false => p.number(IOR)?,
        };
        let black = p.gray(0.0)?;
        Ok(Layers {
            alpha: isotropic(roughness, p)?,
            transmission: p.constant(if shown { 1.0 } else { 0.0 })?,
            transmission_tint: p.color(TRANSMISSION_COLOR)?,
            thin_walled: p.switch(THIN_GEOMETRY),
            presence: p.number(PRESENCE)?,
            ..Layers::plastic(if shown { white } else { black }, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        glass(inputs, diagnostics)
    }

    fn priority(&self, inputs: &Inputs<'_>) -> Result<Option<(Priority, String)>> {
        inputs.priority(PRIORITY, Priority::lower_wins, "lower wins")
    }
}

impl Dialect for DwaBase {
    fn ids(&self) -> &'static [&'static str] {
        &["DwaBaseMaterial"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(PRESENCE),
            Declared::Number(METALLIC),
            Declared::Number(TRANSMISSION),
            Declared::Switch(SHOW_TRANSMISSION),
            Declared::Switch(THIN_GEOMETRY),
            Declared::Number(ROUGHNESS),
            Declared::Switch(USE_INDEPENDENT_ROUGHNESS),
            Declared::Number(INDEPENDENT_ROUGHNESS),
            Declared::Number(IOR),
            Declared::Switch(USE_INDEPENDENT_IOR),
            Declared::Number(INDEPENDENT_IOR),
            Declared::Switch(USE_DISPERSION),
            Declared::Number(ABBE_NUMBER),
            Declared::Integer(PRIORITY),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Color(TRANSMISSION_COLOR),
            Declared::Color(ALBEDO),
            Declared::Number(DIFFUSE_ROUGHNESS),
            Declared::Color(METALLIC_COLOR),
            Declared::Color(METALLIC_EDGE_COLOR),
            Declared::Number(SPECULAR),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if let Some(why) = inputs.cut_out(PRESENCE, diagnostics)? {
            return Ok(Response::CutOut(why));
        }
        let mut transmission = inputs.weight(TRANSMISSION, diagnostics)?;
        if transmission.value >= THRESHOLD && !inputs.switch(SHOW_TRANSMISSION, diagnostics)? {
            transmission.value = 0.0;
        }
        layered::layered(
            inputs,
            transmission,
            inputs.metalness(METALLIC)?,
            |diagnostics| lobe(inputs, diagnostics),
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let transmission = if p.switch(SHOW_TRANSMISSION) { p.number(TRANSMISSION)? } else { p.constant(0.0)? };
        let (albedo, roughness, ior) = (p.color(ALBEDO)?, p.number(ROUGHNESS)?, p.number(IOR)?);
        Ok(Layers {
            diffuse_roughness: p.number(DIFFUSE_ROUGHNESS)?,
            metalness: p.number(METALLIC)?,
            metal: MetalLayer::Artistic { reflectivity: p.color(METALLIC_COLOR)?, edge: p.color(METALLIC_EDGE_COLOR)? },
            specular_weight: p.number(SPECULAR)?,
            alpha: isotropic(roughness, p)?,
            transmission,
            transmission_tint: p.color(TRANSMISSION_COLOR)?,
            thin_walled: p.switch(THIN_GEOMETRY),
            presence: p.number(PRESENCE)?,
            ..Layers::plastic(albedo, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        glass(inputs, diagnostics)
    }

    fn priority(&self, inputs: &Inputs<'_>) -> Result<Option<(Priority, String)>> {
        inputs.priority(PRIORITY, Priority::lower_wins, "lower wins")
    }
}

fn lobe(inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Lobe> {
    let roughness = match inputs.switch(USE_INDEPENDENT_ROUGHNESS, diagnostics)? {
        true => INDEPENDENT_ROUGHNESS,
        false => ROUGHNESS,
    };
    Ok(Lobe {
        rough: inputs.is_rough(roughness, diagnostics)?,
        thin_walled: inputs.switch(THIN_GEOMETRY, diagnostics)?,
    })
}

/// The Abbe number counts where dispersion is switched on; 0 is off there too.
fn glass(inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
    let ior = match inputs.switch(USE_INDEPENDENT_IOR, diagnostics)? {
        true => INDEPENDENT_IOR,
        false => IOR,
    };
    let abbe_number = match inputs.switch(USE_DISPERSION, diagnostics)? {
        true => layered::abbe_number(inputs, ABBE_NUMBER, diagnostics)?,
        false => None,
    };
    layered::glass(inputs, ior, abbe_number, diagnostics)
}
