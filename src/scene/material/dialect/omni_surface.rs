//! NVIDIA's OmniSurface.
//!
//! Names, defaults and formulas: `OmniSurface.mdl`, `OmniSurface/OmniSurfaceBase.mdl` and `OmniShared.mdl` (as in
//! `pablode/gatling` `src/gi/mdl/`). Transmission counts where it is enabled. The index of transmission is that of
//! reflection: the preset's, or the input's where the preset is `ior_custom`. Dispersion is the Abbe number itself, 0 is
//! off; the scattering depth is in stage units. OmniSurfaceLite has no transmission.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::super::painter::{Painted, Painter};
use super::super::surface::{CoatLayer, FilmLayer, Layers, MetalLayer, SheenLayer, isotropic, surface_tint};
use super::super::{Context, THRESHOLD};
use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Color, Inputs, Number, Switch, Word, input};
use super::layered::{self, Lobe, presence};
use super::vocabulary::{Attenuation, Glass, Response};

const ENABLE_OPACITY: Switch = input("enable_opacity", false);
const OPACITY: Number = input("geometry_opacity", 1.0);
const OPACITY_THRESHOLD: Number = input("geometry_opacity_threshold", 0.0);
const THIN_WALLED: Switch = input("thin_walled", false);
const METALNESS: Number = input("metalness", 0.0);
const ENABLE_TRANSMISSION: Switch = input("enable_specular_transmission", false);
const TRANSMISSION: Number = input("specular_transmission_weight", 0.0);
const ROUGHNESS: Number = input("specular_reflection_roughness", 0.2);
const PRESET: Word = input("specular_reflection_ior_preset", "ior_custom");
const IOR: Number = input("specular_reflection_ior", 1.5);
const ABBE_NUMBER: Number = input("specular_transmission_dispersion_abbe", 0.0);
const COLOR: Color = input("specular_transmission_color", [1.0; 3]);
const DEPTH: Number = input("specular_transmission_scattering_depth", 0.0);
const SCATTER: Color = input("specular_transmission_scattering_color", [0.0; 3]);

const DIFFUSE_WEIGHT: Number = input("diffuse_reflection_weight", 0.8);
const DIFFUSE_COLOR: Color = input("diffuse_reflection_color", [1.0; 3]);
const DIFFUSE_ROUGHNESS: Number = input("diffuse_reflection_roughness", 0.0);
const SPECULAR_WEIGHT: Number = input("specular_reflection_weight", 1.0);
const SPECULAR_COLOR: Color = input("specular_reflection_color", [1.0; 3]);
const COAT_WEIGHT: Number = input("coat_weight", 0.0);
const COAT_COLOR: Color = input("coat_color", [1.0; 3]);
const COAT_ROUGHNESS: Number = input("coat_roughness", 0.1);
const COAT_IOR: Number = input("coat_ior", 1.5);
const ENABLE_FILM: Switch = input("enable_thin_film", false);
const FILM_THICKNESS: Number = input("thin_film_thickness", 400.0);
const FILM_IOR: Number = input("thin_film_ior", 1.52);
const SHEEN_WEIGHT: Number = input("specular_retro_reflection_weight", 0.0);
const SHEEN_COLOR: Color = input("specular_retro_reflection_color", [1.0; 3]);
const SHEEN_ROUGHNESS: Number = input("specular_retro_reflection_roughness", 0.3);

/// `ior_preset_to_value`, in the order of the enumeration `ior_presets`, which begins at 0.
const PRESETS: [(&str, f64); 27] = [
    ("ior_acrylic_glass", 1.49),
    ("ior_air", 1.0),
    ("ior_crystal", 2.0),
    ("ior_diamond", 2.42),
    ("ior_emerald", 1.56),
    ("ior_ethanol", 1.36),
    ("ior_flint_glass", 1.66),
    ("ior_glass", 1.5),
    ("ior_honey_21p_water", 1.484),
    ("ior_human_eye_aqueous_humor", 1.33),
    ("ior_human_eye_cornea", 1.37),
    ("ior_human_eye_lens", 1.41),
    ("ior_human_eye_vitreous_humor", 1.34),
    ("ior_human_skin", 1.4),
    ("ior_human_hair", 1.55),
    ("ior_human_wet_hair", 1.85),
    ("ior_ice", 1.31),
    ("ior_milk", 1.35),
    ("ior_olive_oil", 1.47),
    ("ior_pearl", 1.53),
    ("ior_plastic", 1.55),
    ("ior_sapphire", 1.77),
    ("ior_soap_bubble", 1.4),
    ("ior_vacuum", 1.0),
    ("ior_water_0c", 1.333),
    ("ior_water_35c", 1.325),
    ("ior_water_100c", 1.318),
];

/// What `ior_custom` is in that enumeration.
const CUSTOM: i64 = 99;

pub(super) struct OmniSurface;

impl Dialect for OmniSurface {
    fn ids(&self) -> &'static [&'static str] {
        &["OmniSurface", "OmniSurfaceBase"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Switch(ENABLE_OPACITY),
            Declared::Number(OPACITY),
            Declared::Number(OPACITY_THRESHOLD),
            Declared::Switch(THIN_WALLED),
            Declared::Number(METALNESS),
            Declared::Switch(ENABLE_TRANSMISSION),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Word(PRESET),
            Declared::Number(IOR),
            Declared::Number(ABBE_NUMBER),
            Declared::Color(COLOR),
            Declared::Number(DEPTH),
            Declared::Color(SCATTER),
        ]
    }

    #[cfg(test)]
    fn transported(&self) -> &'static [Declared] {
        &[
            Declared::Number(DIFFUSE_WEIGHT),
            Declared::Color(DIFFUSE_COLOR),
            Declared::Number(DIFFUSE_ROUGHNESS),
            Declared::Number(SPECULAR_WEIGHT),
            Declared::Color(SPECULAR_COLOR),
            Declared::Number(COAT_WEIGHT),
            Declared::Color(COAT_COLOR),
            Declared::Number(COAT_ROUGHNESS),
            Declared::Number(COAT_IOR),
            Declared::Number(SHEEN_WEIGHT),
            Declared::Color(SHEEN_COLOR),
            Declared::Number(SHEEN_ROUGHNESS),
            Declared::Switch(ENABLE_FILM),
            Declared::Number(FILM_THICKNESS),
            Declared::Number(FILM_IOR),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        if inputs.switch(ENABLE_OPACITY, diagnostics)? {
            let opacity = inputs.weight(OPACITY, diagnostics)?;
            let threshold = inputs.number(OPACITY_THRESHOLD, diagnostics)?;
            let limit = if threshold > 0.0 { threshold } else { THRESHOLD };
            if opacity.value < limit {
                return Ok(Response::CutOut(opacity.to_string()));
            }
        }
        let mut transmission = inputs.weight(TRANSMISSION, diagnostics)?;
        if !inputs.switch(ENABLE_TRANSMISSION, diagnostics)? {
            if transmission.value >= THRESHOLD {
                inputs.warn_unread(
                    TRANSMISSION.name,
                    "has no effect without inputs:enable_specular_transmission = true",
                    diagnostics,
                );
            }
            transmission.value = 0.0;
        }
        layered::layered(
            inputs,
            transmission,
            inputs.metalness(METALNESS)?,
            |diagnostics| {
                Ok(Lobe {
                    rough: inputs.is_rough(ROUGHNESS, diagnostics)?,
                    thin_walled: inputs.switch(THIN_WALLED, diagnostics)?,
                })
            },
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        let (weight, color) = (p.number(DIFFUSE_WEIGHT)?, p.color(DIFFUSE_COLOR)?);
        let base = p.multiply(color, weight)?;
        let (specular, specular_color) = (p.number(SPECULAR_WEIGHT)?, p.color(SPECULAR_COLOR)?);
        let names = PRESETS.map(|(name, _)| name);
        let preset = p.word(PRESET, &names);
        let ior = match PRESETS.iter().find(|(name, _)| *name == preset) {
            Some((_, index)) => p.constant(*index as f32)?,
            None => p.number(IOR)?,
        };
        let transmission = if p.switch(ENABLE_TRANSMISSION) { p.number(TRANSMISSION)? } else { p.constant(0.0)? };
        let coat_roughness = p.number(COAT_ROUGHNESS)?;
        let coat = CoatLayer {
            weight: p.number(COAT_WEIGHT)?,
            color: p.color(COAT_COLOR)?,
            ior: p.number(COAT_IOR)?,
            alpha: isotropic(coat_roughness, p)?,
            darkening: p.constant(0.0)?,
        };
        let sheen = SheenLayer {
            weight: p.number(SHEEN_WEIGHT)?,
            color: p.color(SHEEN_COLOR)?,
            roughness: p.number(SHEEN_ROUGHNESS)?,
        };
        let has_film = p.switch(ENABLE_FILM);
        let film = FilmLayer {
            weight: p.constant(if has_film { 1.0 } else { 0.0 })?,
            thickness_nm: p.number(FILM_THICKNESS)?,
            ior: p.number(FILM_IOR)?,
        };
        let roughness = p.number(ROUGHNESS)?;
        Ok(Layers {
            diffuse_roughness: p.number(DIFFUSE_ROUGHNESS)?,
            metalness: p.number(METALNESS)?,
            metal: MetalLayer::Tint { f0: base, f82: specular_color },
            specular_weight: specular,
            specular_color,
            alpha: isotropic(roughness, p)?,
            transmission,
            transmission_tint: surface_tint(COLOR, DEPTH, p)?,
            thin_walled: p.switch(THIN_WALLED),
            coat: Some(coat),
            sheen: Some(sheen),
            film: Some(film),
            presence: presence(p, ENABLE_OPACITY, OPACITY, OPACITY_THRESHOLD)?,
            ..Layers::plastic(base, ior, p)?
        })
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let abbe_number = layered::abbe_number(inputs, ABBE_NUMBER, diagnostics)?;
        match preset(inputs)? {
            Some((name, index)) => {
                let source = format!("{name} of inputs:{}", PRESET.name);
                Ok(layered::glass_of(inputs, PRESET.name, index, source, abbe_number))
            }
            None => layered::glass(inputs, IOR, abbe_number, diagnostics),
        }
    }

    /// σ = −ln(color / (1 + max scattering color)) / depth; with a depth of 0 the colour tints the surface.
    fn attenuation(
        &self,
        inputs: &Inputs<'_>,
        _: &Context,
        diagnostics: &mut Diagnostics,
    ) -> Result<Option<Attenuation>> {
        let distance = inputs.length(DEPTH, diagnostics)?;
        if distance == 0.0 {
            return Ok(None);
        }
        layered::warn_of_scattering(inputs, SCATTER, diagnostics)?;
        let scattering = inputs.color(SCATTER, diagnostics)?.into_iter().fold(0.0, f64::max);
        if scattering == 0.0 {
            return layered::attenuation(inputs, COLOR, distance, diagnostics);
        }
        let color = inputs.transmittance(COLOR, diagnostics)?.map(|part| part / (1.0 + scattering));
        Ok(Some(Attenuation { color, distance, place: inputs.place(COLOR.name) }))
    }
}

/// The preset and its index; `None` where the input's own counts.
fn preset(inputs: &Inputs<'_>) -> Result<Option<(&'static str, f64)>> {
    let Some(authored) = inputs.raw(PRESET.name) else { return Ok(None) };
    if authored.as_i64() == Some(CUSTOM) || authored.as_str() == Some(PRESET.default) {
        return Ok(None);
    }
    let names = PRESETS.map(|(name, _)| name);
    let name = inputs.word(PRESET, &names)?;
    Ok(PRESETS.iter().copied().find(|(preset, _)| *preset == name))
}
