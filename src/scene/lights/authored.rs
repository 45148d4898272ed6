//! What one light says, checked and put into the world.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use crate::diagnostics::Diagnostics;
use crate::light::ies::Profile;
use crate::light::{
    Distant, Dome, Ellipsoid, Emission, Geometry, Layout, Light, MaterialSync, Patch, Shadow, Shape, Shaping,
    ShapingProfile, Spectrum, Tube, rgb_of_temperature,
};
use crate::scene::description::{self, Authored, LightShape};
use crate::spectrum::illuminant::Illuminant;

/// Attributes of ours.
const ILLUMINANT: &str = "abbe:illuminant";
const TABLE: &str = "abbe:spectrum:table";
const LIGHT_GROUP: &str = "abbe:lightGroup";
/// Of PhysicalLightIlluminantAPI, without `physical:`.
const PHYSICAL_ILLUMINANT: &str = "illuminant";
const PHYSICAL_TABLE: &str = "customIlluminant";

/// Why a light is left out.
struct Broken {
    attribute: &'static str,
    problem: String,
}

fn broken<T>(attribute: &'static str, problem: impl Into<String>) -> Result<T, Broken> {
    Err(Broken { attribute, problem: problem.into() })
}

/// The light at its place; `None`, with a warning, if there is no such light. Geometry has no prims yet; a portal is none.
///
/// A light that emits nothing at all is left out without a warning: somebody switched it off.
pub(super) fn compile(
    light: &description::Light,
    world_from_light: &DAffine3,
    profile: Option<Arc<Profile>>,
    diagnostics: &mut Diagnostics,
) -> Option<Light> {
    let mut notes = Notes { path: &light.path, diagnostics };
    match compiled(light, world_from_light, profile, &mut notes) {
        Ok(compiled) => compiled,
        Err(Broken { attribute, problem }) => {
            notes.note("broken-light", attribute, format!("{problem}: the light is left out"));
            None
        }
    }
}

/// Warnings about one light.
struct Notes<'a> {
    path: &'a str,
    diagnostics: &'a mut Diagnostics,
}

impl Notes<'_> {
    fn note(&mut self, kind: &str, attribute: &str, message: String) {
        let place = if attribute.is_empty() { self.path.to_owned() } else { format!("{}.{attribute}", self.path) };
        self.diagnostics.warn(kind, place, message);
    }
}

fn compiled(
    light: &description::Light,
    world_from_light: &DAffine3,
    profile: Option<Arc<Profile>>,
    notes: &mut Notes<'_>,
) -> Result<Option<Light>, Broken> {
    let (shape, size) = shape(light, world_from_light, notes)?;
    let Some(emission) = emission(light, size, notes)? else { return Ok(None) };
    let shaping = shaping(light, profile, notes)?;
    let factor = |attribute: &'static str, value: f64, notes: &mut Notes<'_>| {
        if value < 0.0 {
            notes.note("light", attribute, format!("is {value}: it counts as 0"));
        }
        value.max(0.0)
    };
    light_group(light)
        .map_or_else(|| notes.note("light", LIGHT_GROUP, "is no string: the light is in no group".into()), |_| ());
    Ok(Some(Light {
        path: light.path.clone(),
        shape,
        emission,
        shaping,
        light_from_world: world_from_light.matrix3.inverse(),
        shadow: shadow(light, notes),
        diffuse: factor("inputs:diffuse", light.diffuse, notes),
        specular: factor("inputs:specular", light.specular, notes),
        group: None,
        illuminates: light.light_link.map(|set| set as u32),
        shadowed_by: light.shadow_link.map(|set| set as u32),
    }))
}

/// The shape, and what `normalize` divides by.
fn shape(
    light: &description::Light,
    world_from_light: &DAffine3,
    notes: &mut Notes<'_>,
) -> Result<(Shape, f64), Broken> {
    let length = |attribute: &'static str, value: f64| {
        if value >= 0.0 { Ok(value) } else { broken(attribute, format!("is {value}, and no length is negative")) }
    };
    // Without a radius, a normalised light keeps its power: that of one with any radius.
    let radius = |value: f64| {
        let value = length("inputs:radius", value)?;
        let is_thin = value <= 0.0 && light.normalize;
        Ok((if is_thin { 1.0 } else { value }, is_thin))
    };
    let shape = match light.shape {
        LightShape::Distant { angle } => {
            let toward = world_from_light.matrix3.z_axis.normalize();
            let distant = Distant { toward, half_angle: 0.5 * angle.clamp(0.0, 360.0).to_radians() };
            let size = if light.normalize { distant.size_factor() } else { 1.0 };
            return Ok((Shape::Distant(distant), size));
        }
        LightShape::Dome { texture, ref format, ref pole_axis, .. } => {
            let layout = Layout::from_token(format).unwrap_or_else(|| {
                let known = "automatic, latlong, mirroredBall, angular and cubeMapVerticalCross";
                notes.note(
                    "light",
                    "inputs:texture:format",
                    format!("is '{format}', and there are {known}: automatic"),
                );
                None
            });
            // Columns: where the light's axes are in the environment.
            let environment_from_light = match pole_axis.as_str() {
                "Y" => DMat3::IDENTITY,
                "Z" => DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y),
                other => {
                    notes.note("light", "poleAxis", format!("is '{other}', and there are Y and Z: Y"));
                    DMat3::IDENTITY
                }
            };
            let environment_from_world = environment_from_light * world_from_light.matrix3.inverse();
            return Ok((Shape::Dome(Dome { environment_from_world, texture, layout, portals: Vec::new() }), 1.0));
        }
        LightShape::Geometry { ref material_sync_mode, .. } => {
            if material_sync(material_sync_mode).is_none() {
                let known = "materialGlowTintsLight, independent and noMaterialResponse";
                let message = format!("is '{material_sync_mode}', and there are {known}: noMaterialResponse");
                notes.note("light", "light:materialSyncMode", message);
            }
            let geometry =
                Geometry { prim_ids: Vec::new(), is_normalized: light.normalize, material: MaterialSync::NoResponse };
            return Ok((Shape::Geometry(geometry), 1.0));
        }
        LightShape::Rect { width, height, texture } => {
            let (width, height) = (length("inputs:width", width)?, length("inputs:height", height)?);
            Shape::Rectangle(Patch { texture, ..Patch::rectangle(world_from_light, width, height) })
        }
        LightShape::Portal { width, height } => {
            let (width, height) = (length("inputs:width", width)?, length("inputs:height", height)?);
            Shape::Rectangle(Patch::rectangle(world_from_light, width, height))
        }
        LightShape::Disk { radius } => Shape::Disk(Patch::disk(world_from_light, length("inputs:radius", radius)?)),
        LightShape::Sphere { radius: authored, treat_as_point } => {
            let (radius, is_thin) = radius(authored)?;
            Shape::Sphere(Ellipsoid::new(world_from_light, radius, treat_as_point || is_thin))
        }
        LightShape::Cylinder { length: authored, radius: thickness, treat_as_line } => {
            let (radius, is_thin) = radius(thickness)?;
            let length = length("inputs:length", authored)?;
            Shape::Cylinder(Tube::new(world_from_light, length, radius, treat_as_line || is_thin))
        }
    };
    let area = shape.area().unwrap_or_default();
    if !(area > 0.0 && area.is_finite()) {
        return broken("", format!("its area is {area}, so that nothing shines"));
    }
    Ok((shape, if light.normalize { area } else { 1.0 }))
}

/// `None` of a light that emits nothing.
fn emission(light: &description::Light, size: f64, notes: &mut Notes<'_>) -> Result<Option<Emission>, Broken> {
    if light.intensity < 0.0 {
        return broken("inputs:intensity", format!("is {}, and no light is negative", light.intensity));
    }
    let spectrum = spectrum(light, notes);
    let tint = match &spectrum {
        // A colour temperature is a stand-in for a spectrum.
        None if light.enable_color_temperature => rgb_of_temperature(light.color_temperature),
        _ => [1.0; 3],
    };
    if light.color.iter().any(|&channel| channel < 0.0) {
        notes.note("light", "inputs:color", "has a negative channel, which counts as 0".into());
    }
    let scale = light.intensity * libm::exp2(light.exposure) / size;
    let rgb: [f64; 3] = std::array::from_fn(|i| scale * tint[i] * light.color[i].max(0.0));
    // Radiance is in single precision.
    if rgb.iter().any(|channel| !(*channel as f32).is_finite()) {
        return broken("", "its emission is more than single precision holds");
    }
    if rgb.iter().all(|&channel| channel <= 0.0) {
        return Ok(None);
    }
    let d65 = Spectrum::Illuminant(Illuminant::D65);
    match Emission::new(rgb, spectrum.unwrap_or_else(|| d65.clone())) {
        Some(emission) => Ok(Some(emission)),
        None => {
            notes.note("light", TABLE, "has no light that is visible: its colour alone counts".into());
            Ok(Emission::new(rgb, d65))
        }
    }
}

/// The spectrum that a light asks for: by our attributes, else by PhysicalLightIlluminantAPI, else none.
fn spectrum(light: &description::Light, notes: &mut Notes<'_>) -> Option<Spectrum> {
    let (attribute, token) = match (light.abbe.get(ILLUMINANT), light.physical.get(PHYSICAL_ILLUMINANT)) {
        (Some(authored), _) => (ILLUMINANT, authored),
        (None, Some(authored)) => ("physical:illuminant", authored),
        // A table alone says enough.
        (None, None) if light.abbe.contains_key(TABLE) => return table(light.abbe.get(TABLE), TABLE, notes),
        (None, None) => return None,
    };
    let is_ours = attribute == ILLUMINANT;
    let name = token.value.as_str().unwrap_or_default();
    let standard = match name {
        "" if is_ours => return None,
        "table" if is_ours => return table(light.abbe.get(TABLE), TABLE, notes),
        "custom" if !is_ours => {
            return table(light.physical.get(PHYSICAL_TABLE), "physical:customIlluminant", notes);
        }
        // Colder than this nothing of it is seen, in doubles.
        "blackbody" if light.color_temperature >= 100.0 => Some(Illuminant::BlackBody(light.color_temperature)),
        "white" if !is_ours => Some(Illuminant::D65),
        name if is_ours => Illuminant::named(name),
        _ => None,
    };
    if standard.is_none() {
        let message = if name == "blackbody" {
            format!("is a black body of {} K, which does not shine: its colour alone counts", light.color_temperature)
        } else {
            let known = if is_ours {
                "E, A, D40 to D250, FL2, FL7, FL11, blackbody and table"
            } else {
                "white, blackbody and custom"
            };
            format!("is {}, and there are {known}: its colour alone counts", token.value)
        };
        notes.note("light", attribute, message);
    }
    standard.map(Spectrum::Illuminant)
}

fn table(authored: Option<&Authored>, attribute: &'static str, notes: &mut Notes<'_>) -> Option<Spectrum> {
    let entries = authored.map(|authored| serde_json::from_value::<Vec<[f64; 2]>>(authored.value.clone()));
    let table = match entries {
        None => Err("is not there".into()),
        Some(Err(_)) => Err("is no list of pairs of numbers".into()),
        Some(Ok(entries)) => Spectrum::table(&entries),
    };
    table.map_err(|problem| notes.note("light", attribute, format!("{problem}: its colour alone counts"))).ok()
}

fn shaping(
    light: &description::Light,
    profile: Option<Arc<Profile>>,
    notes: &mut Notes<'_>,
) -> Result<Option<Shaping>, Broken> {
    let Some(shaping) = &light.shaping else { return Ok(None) };
    if shaping.cone_angle < 0.0 {
        return broken("inputs:shaping:cone:angle", format!("is {}, and no cone has that angle", shaping.cone_angle));
    }
    let focus = shaping.focus.max(0.0);
    let cone_angle = shaping.cone_angle.min(180.0).to_radians();
    if matches!(light.shape, LightShape::Distant { .. } | LightShape::Dome { .. }) {
        if focus > 0.0 || shaping.cone_angle < 90.0 || shaping.ies.is_some() {
            notes.note("light", "", "distant lights and domes have no shape to shape: its shaping is ignored".into());
        }
        return Ok(None);
    }
    if focus <= 0.0 && cone_angle >= PI && profile.is_none() {
        return Ok(None);
    }
    let is_normalized = shaping.ies_normalize;
    Ok(Some(Shaping {
        focus,
        focus_tint: shaping.focus_tint.map(|channel| channel.max(0.0)),
        cone_angle,
        cone_softness: shaping.cone_softness.clamp(0.0, 1.0),
        profile: profile.map(|profile| ShapingProfile::new(profile, shaping.ies_angle_scale, is_normalized)),
    }))
}

fn shadow(light: &description::Light, notes: &mut Notes<'_>) -> Shadow {
    let Some(shadow) = &light.shadow else { return Shadow::default() };
    let distance = (shadow.distance >= 0.0).then_some(shadow.distance);
    let falloff_gamma = if shadow.falloff_gamma > 0.0 {
        shadow.falloff_gamma
    } else {
        let message = format!("is {}, and an exponent is positive: it counts as 1", shadow.falloff_gamma);
        notes.note("light", "inputs:shadow:falloffGamma", message);
        1.0
    };
    Shadow {
        is_enabled: shadow.enable,
        color: shadow.color.map(|channel| channel.max(0.0)),
        distance,
        falloff: shadow.falloff.clamp(0.0, distance.unwrap_or(0.0)),
        falloff_gamma,
    }
}

/// By the name of UsdLux.
pub(super) fn material_sync(mode: &str) -> Option<MaterialSync> {
    match mode {
        "materialGlowTintsLight" => Some(MaterialSync::GlowTintsLight),
        "independent" => Some(MaterialSync::Independent),
        "noMaterialResponse" => Some(MaterialSync::NoResponse),
        _ => None,
    }
}

/// The name of its light group, empty for none; `None` if it is no string.
pub(super) fn light_group(light: &description::Light) -> Option<&str> {
    light.abbe.get(LIGHT_GROUP).map_or(Some(""), |authored| authored.value.as_str())
}
