//! What dialects share: metal over glass over an opaque base, an index, an Abbe number, a colour over a depth.

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;

use super::super::THRESHOLD;
use super::super::appearance::{Below, OpacityInput};
use super::super::painter::{Painted, Painter};
use super::inputs::{Color, Inputs, Integer, Number, Switch, Weight};
use super::vocabulary::{Attenuation, Glass, Response};

/// How light leaves a transmissive surface.
pub(super) struct Lobe {
    pub(super) rough: bool,
    pub(super) thin_walled: bool,
}

/// Metal lies over the glass with its weight, both over the opaque base.
///
/// What a lobe is like is read only where it is what decides, so that nothing is said of inputs without effect.
pub(super) fn layered(
    inputs: &Inputs<'_>,
    transmission: Weight,
    metalness: Weight,
    glass: impl FnOnce(&mut Diagnostics) -> Result<Lobe>,
    metal_is_rough: impl FnOnce(&mut Diagnostics) -> Result<bool>,
    diagnostics: &mut Diagnostics,
) -> Result<Response> {
    if transmission.value * (1.0 - metalness.value) >= THRESHOLD {
        let Lobe { rough, thin_walled } = glass(diagnostics)?;
        return Ok(Response::Transmissive { why: transmission.to_string(), rough, thin_walled });
    }
    if transmission.value >= THRESHOLD {
        diagnostics.warn(
            "metal-over-glass",
            inputs.place(metalness.name),
            format!(
                "{} has no effect under {} = {}: author 0 for glass",
                transmission.name, metalness.name, metalness.value
            ),
        );
    }
    if metalness.value >= THRESHOLD {
        return Ok(Response::Metal { why: metalness.to_string(), rough: metal_is_rough(diagnostics)? });
    }
    Ok(Response::Opaque(transmission.to_string()))
}

/// Holes where an opacity that is looked up is below one half.
pub(super) fn holes(inputs: &Inputs<'_>, input: Number, is_color: bool) -> Option<OpacityInput> {
    let limit = THRESHOLD as f32;
    inputs.is_looked_up(input.name).then_some(OpacityInput { name: input.name, limit, below: Below::CutOut, is_color })
}

/// Of NVIDIA's materials: an opacity that counts where it is enabled, as it is, or cut at a threshold beyond 0.
pub(super) fn presence(p: &mut Painter<'_, '_, '_>, enabled: Switch, opacity: Number, threshold: Number) -> Painted {
    if !p.switch(enabled) {
        return p.constant(1.0);
    }
    let (opacity, threshold) = (p.number(opacity)?, p.number(threshold)?);
    match p.b().value(threshold) {
        Some([number, ..]) if number <= 0.0 => Ok(opacity),
        _ => p.is_at_least(opacity, threshold),
    }
}

/// The index of refraction, positive.
pub(super) fn index(inputs: &Inputs<'_>, ior: Number, diagnostics: &mut Diagnostics) -> Result<f64> {
    let index = inputs.number(ior, diagnostics)?;
    if index <= 0.0 {
        return inputs.refuse(ior.name, "author the refractive index at the d line, a positive number");
    }
    Ok(index)
}

/// Glass whose index is an input.
pub(super) fn glass(
    inputs: &Inputs<'_>,
    ior: Number,
    abbe_number: Option<Stated>,
    diagnostics: &mut Diagnostics,
) -> Result<Glass> {
    let index = index(inputs, ior, diagnostics)?;
    Ok(glass_of(inputs, ior.name, index, inputs.source(ior.name), abbe_number))
}

/// Glass whose index comes from the input `name`, by `source`.
pub(super) fn glass_of(
    inputs: &Inputs<'_>,
    name: &str,
    index: f64,
    source: String,
    abbe_number: Option<Stated>,
) -> Glass {
    let place = inputs.place(name);
    let (abbe_number, abbe_source, abbe_place) = match abbe_number {
        Some(stated) => (Some(stated.number), stated.source, stated.place),
        None => (None, String::new(), place.clone()),
    };
    Glass { ior: index, ior_source: source, ior_place: place, abbe_number, abbe_source, abbe_place }
}

/// An Abbe number, positive, with its place.
pub(super) struct Stated {
    pub(super) number: f64,
    pub(super) source: String,
    pub(super) place: String,
}

/// An input that is the Abbe number itself; 0 is off.
pub(super) fn abbe_number(inputs: &Inputs<'_>, input: Number, diagnostics: &mut Diagnostics) -> Result<Option<Stated>> {
    let number = inputs.number(input, diagnostics)?;
    if number < 0.0 {
        return inputs.refuse(input.name, "author a positive Abbe number, or 0 for no dispersion");
    }
    Ok((number > 0.0).then(|| Stated { number, source: inputs.source(input.name), place: inputs.place(input.name) }))
}

/// A colour that white light has after `distance` stage units; white is none.
pub(super) fn attenuation(
    inputs: &Inputs<'_>,
    color: Color,
    distance: f64,
    diagnostics: &mut Diagnostics,
) -> Result<Option<Attenuation>> {
    let rgb = inputs.transmittance(color, diagnostics)?;
    if rgb.iter().all(|&part| part >= 1.0) {
        return Ok(None);
    }
    Ok(Some(Attenuation { color: rgb, distance, place: inputs.place(color.name) }))
}

/// The same, where a depth of 0 means a tint of the surface and no absorption.
pub(super) fn attenuation_over_depth(
    inputs: &Inputs<'_>,
    color: Color,
    depth: Number,
    diagnostics: &mut Diagnostics,
) -> Result<Option<Attenuation>> {
    let distance = inputs.length(depth, diagnostics)?;
    if distance == 0.0 {
        return Ok(None);
    }
    attenuation(inputs, color, distance, diagnostics)
}

/// Says of a scattering volume that only its unscattered light is followed.
pub(super) fn warn_of_scattering(inputs: &Inputs<'_>, scatter: Color, diagnostics: &mut Diagnostics) -> Result<()> {
    if !is_black(inputs.color(scatter, diagnostics)?) {
        inputs.warn_unread(
            scatter.name,
            "light scattered in the volume is not followed: what passes unscattered is attenuated by the colour",
            diagnostics,
        );
    }
    Ok(())
}

/// No component is anything but 0.
pub(super) fn is_black(color: [f64; 3]) -> bool {
    color.iter().all(|&part| part == 0.0)
}

/// `dielectric_priority`, which Arnold's nodes have and the MaterialX nodes of the same models do not.
pub(super) fn arnolds_priority(inputs: &Inputs<'_>, input: Integer) -> Result<Option<(Priority, String)>> {
    match inputs.shader().id.starts_with("arnold:") {
        true => inputs.priority(input, Priority::higher_wins, "higher wins"),
        false => Ok(None),
    }
}
