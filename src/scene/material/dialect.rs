//! What a surface shader says, dialect by dialect, in one vocabulary: does light pass, with which index and Abbe number.
//!
//! Names and defaults are those of the node definitions: UsdPreviewSurface (usdShaders shaderDefs.usda 26.11), OpenPBR
//! 1.1.1, Standard Surface 1.0.1 and glTF PBR 2.0.1 (MaterialX 1.39 `libraries/bxdf`). An input that is declared without
//! a value, or is not there, has the definition's default. An input driven by a network has it too, with a warning.

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;
use crate::scene::description::Shader;

use super::values::Values;
use super::{SMOOTH_ROUGHNESS, THRESHOLD};

/// Abbe numbers below this are no glass (the lowest of any optical glass is about 16): MaterialX's translation graphs
/// copy OpenPBR's dispersion *scale*, 0 to 1, into Standard Surface's Abbe number.
const LOWEST_CREDIBLE_ABBE_NUMBER: f64 = 5.0;

/// The shading models that are understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    PreviewSurface,
    OpenPbr,
    StandardSurface,
    Gltf,
}

impl Dialect {
    fn of(id: &str) -> Option<Self> {
        Some(match id {
            "UsdPreviewSurface" | "ND_UsdPreviewSurface_surfaceshader" => Self::PreviewSurface,
            "ND_open_pbr_surface_surfaceshader" | "arnold:openpbr_surface" => Self::OpenPbr,
            "ND_standard_surface_surfaceshader"
            | "ND_standard_surface_surfaceshader_100"
            | "arnold:standard_surface" => Self::StandardSurface,
            "ND_gltf_pbr_surfaceshader" => Self::Gltf,
            _ => return None,
        })
    }
}

/// How a surface treats the light that falls on it, with the reason in words.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Response {
    /// The surface is not there.
    CutOut(String),
    /// Light passes.
    Transmissive { why: String, rough: bool, thin_walled: bool },
    /// A metal.
    Metal { why: String, rough: bool },
    /// Neither.
    Opaque(String),
}

/// An index at the d line and what the shader says of its dispersion.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Glass {
    /// n_d > 0, finite.
    pub(super) ior: f64,
    /// Where `ior` comes from, in words.
    pub(super) ior_source: String,
    /// The input that `ior` comes from, for errors.
    pub(super) ior_place: String,
    /// V_d > 0, if the shader states dispersion.
    pub(super) abbe_number: Option<f64>,
    /// Where the Abbe number comes from.
    pub(super) abbe_source: String,
}

/// A shader whose dialect is understood.
pub(super) struct Surface<'a> {
    dialect: Dialect,
    shader: &'a Shader,
    values: Values<'a>,
}

impl<'a> Surface<'a> {
    /// `None` if the shader's id is unknown.
    pub(super) fn of(shader: &'a Shader) -> Option<Self> {
        let dialect = Dialect::of(&shader.id)?;
        Some(Self { dialect, shader, values: Values::new(&shader.inputs, &shader.path, "inputs:") })
    }

    /// The shader itself.
    pub(super) fn shader(&self) -> &'a Shader {
        self.shader
    }

    /// What the surface does to light.
    pub(super) fn response(&self, diagnostics: &mut Diagnostics) -> Result<Response> {
        match self.dialect {
            Dialect::PreviewSurface => self.preview_response(diagnostics),
            Dialect::OpenPbr => {
                let presence = self.number("geometry_opacity", 1.0, diagnostics)?;
                if presence < THRESHOLD {
                    return Ok(Response::CutOut(format!("geometry_opacity {presence}")));
                }
                self.layered_response("transmission_weight", "base_metalness", 0.0, diagnostics)
            }
            Dialect::StandardSurface => {
                let presence = self.number("opacity", 1.0, diagnostics)?;
                if presence < THRESHOLD {
                    return Ok(Response::CutOut(format!("opacity {presence}")));
                }
                self.layered_response("transmission", "metalness", 0.0, diagnostics)
            }
            Dialect::Gltf => self.gltf_response(diagnostics),
        }
    }

    /// The index and dispersion of a transmissive surface.
    pub(super) fn glass(&self, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let (ior_name, dispersion) = match self.dialect {
            Dialect::PreviewSurface => ("ior", None),
            Dialect::OpenPbr => ("specular_ior", self.open_pbr_abbe_number(diagnostics)?),
            Dialect::StandardSurface => ("specular_IOR", self.standard_surface_abbe_number(diagnostics)?),
            Dialect::Gltf => ("ior", self.gltf_abbe_number(diagnostics)?),
        };
        let authored = self.number(ior_name, 1.5, diagnostics)?;
        if authored <= 0.0 {
            return self.values.refuse(ior_name, "author the refractive index at the d line, a positive number");
        }
        let mut ior_source = match self.values.has(ior_name) {
            true => format!("inputs:{ior_name}"),
            false => format!("the default of inputs:{ior_name}"),
        };
        let ior = match self.dialect {
            Dialect::OpenPbr => self.modulated_ior(authored, &mut ior_source, diagnostics)?,
            _ => authored,
        };
        let (abbe_number, abbe_source) = match dispersion {
            Some((number, source)) => (Some(number), source),
            None => (None, String::new()),
        };
        Ok(Glass { ior, ior_source, ior_place: self.values.place(ior_name), abbe_number, abbe_source })
    }

    /// Opacity under 0.5 is glass in the mode `transparent`, and a hole in the mode `presence` or under a threshold.
    fn preview_response(&self, diagnostics: &mut Diagnostics) -> Result<Response> {
        let opacity = self.number("opacity", 1.0, diagnostics)?;
        let threshold = self.number("opacityThreshold", 0.0, diagnostics)?;
        let presence = self.is_presence()?;
        // With a threshold, what is under it is not rendered and everything else is fully opaque.
        let limit = if threshold > 0.0 { threshold } else { THRESHOLD };
        if opacity < limit {
            if threshold > 0.0 {
                return Ok(Response::CutOut(format!("opacity {opacity} under opacityThreshold {threshold}")));
            }
            if presence {
                return Ok(Response::CutOut(format!("opacity {opacity} in opacityMode presence")));
            }
            let rough = self.is_rough(diagnostics)?;
            return Ok(Response::Transmissive { why: format!("opacity {opacity}"), rough, thin_walled: false });
        }
        let is_specular_workflow = self.switch("useSpecularWorkflow", false, diagnostics)?;
        let metalness = self.metalness("metallic", 0.0)?;
        if metalness >= THRESHOLD && !is_specular_workflow {
            return Ok(Response::Metal { why: format!("metallic {metalness}"), rough: self.is_rough(diagnostics)? });
        }
        Ok(Response::Opaque(format!("opacity {opacity}")))
    }

    /// A token in USD, an integer in MaterialX (0 transparent, 1 presence).
    fn is_presence(&self) -> Result<bool> {
        const NAME: &str = "opacityMode";
        match self.values.raw(NAME).map(|authored| &authored.value) {
            None => Ok(false),
            Some(serde_json::Value::Number(_)) => Ok(self.values.switch(NAME)?.unwrap_or(false)),
            Some(_) => match self.values.text(NAME)? {
                None | Some("transparent") => Ok(false),
                Some("presence") => Ok(true),
                Some(_) => self.values.refuse(NAME, "author transparent or presence"),
            },
        }
    }

    fn gltf_response(&self, diagnostics: &mut Diagnostics) -> Result<Response> {
        let alpha = self.number("alpha", 1.0, diagnostics)?;
        // 0 opaque (alpha ignored), 1 mask, 2 blend.
        let limit = match self.number("alpha_mode", 0.0, diagnostics)? {
            mode if mode < 0.5 => f64::NEG_INFINITY,
            mode if mode < 1.5 => self.number("alpha_cutoff", 0.5, diagnostics)?,
            _ => THRESHOLD,
        };
        if alpha < limit {
            return Ok(Response::CutOut(format!("alpha {alpha}")));
        }
        let response = self.layered_response("transmission", "metallic", 1.0, diagnostics)?;
        let is_thin_glass = matches!(response, Response::Transmissive { thin_walled: true, .. });
        if is_thin_glass && self.values.number("dispersion")?.is_some_and(|dispersion| dispersion > 0.0) {
            diagnostics.warn(
                "thin-wall-dispersion",
                self.values.place("dispersion"),
                "glTF glass without thickness is a thin wall and does not disperse: author inputs:thickness > 0",
            );
        }
        Ok(response)
    }

    /// OpenPBR, Standard Surface and glTF: metal lies over the glass with its weight, both over the opaque base.
    fn layered_response(
        &self,
        transmission_name: &str,
        metalness_name: &str,
        default_metalness: f64,
        diagnostics: &mut Diagnostics,
    ) -> Result<Response> {
        let transmission = self.number(transmission_name, 0.0, diagnostics)?;
        let metalness = self.metalness(metalness_name, default_metalness)?;
        if transmission * (1.0 - metalness) >= THRESHOLD {
            let (rough, thin_walled) = (self.is_rough(diagnostics)?, self.is_thin_walled(diagnostics)?);
            return Ok(Response::Transmissive {
                why: format!("{transmission_name} {transmission}"),
                rough,
                thin_walled,
            });
        }
        if transmission >= THRESHOLD {
            diagnostics.warn(
                "metal-over-glass",
                self.values.place(metalness_name),
                format!("{transmission_name} has no effect under {metalness_name} = {metalness}: author 0 for glass"),
            );
        }
        if metalness >= THRESHOLD {
            return Ok(Response::Metal {
                why: format!("{metalness_name} {metalness}"),
                rough: self.is_rough(diagnostics)?,
            });
        }
        Ok(Response::Opaque(format!("{transmission_name} {transmission}")))
    }

    fn is_rough(&self, diagnostics: &mut Diagnostics) -> Result<bool> {
        let roughness = match self.dialect {
            Dialect::PreviewSurface => self.number("roughness", 0.5, diagnostics)?,
            Dialect::OpenPbr => self.number("specular_roughness", 0.3, diagnostics)?,
            Dialect::StandardSurface => {
                let extra = self.number("transmission_extra_roughness", 0.0, diagnostics)?;
                self.number("specular_roughness", 0.2, diagnostics)? + extra
            }
            Dialect::Gltf => self.number("roughness", 1.0, diagnostics)?,
        };
        Ok(roughness > SMOOTH_ROUGHNESS)
    }

    fn is_thin_walled(&self, diagnostics: &mut Diagnostics) -> Result<bool> {
        match self.dialect {
            Dialect::PreviewSurface => Ok(false),
            Dialect::OpenPbr => self.switch("geometry_thin_walled", false, diagnostics),
            Dialect::StandardSurface => self.switch("thin_walled", false, diagnostics),
            // KHR_materials_volume: no thickness is a thin wall.
            Dialect::Gltf => Ok(self.number("thickness", 0.0, diagnostics)? <= 0.0),
        }
    }

    /// A painted metalness makes no uniform mirror and hides no glass: it counts as 0, and being common and harmless
    /// to the chain it is no warning.
    fn metalness(&self, name: &str, default: f64) -> Result<f64> {
        if self.shader.connected.contains_key(name) {
            return Ok(0.0);
        }
        Ok(self.values.number(name)?.unwrap_or(default))
    }

    /// OpenPBR 1.1.1, specular weight: F0 is scaled by it, and the index follows: η' = (1 + ε)/(1 − ε),
    /// ε = sgn(η − 1)·√(w·F0).
    fn modulated_ior(&self, ior: f64, source: &mut String, diagnostics: &mut Diagnostics) -> Result<f64> {
        const NAME: &str = "specular_weight";
        let weight = self.number(NAME, 1.0, diagnostics)?;
        if weight < 0.0 {
            return self.values.refuse(NAME, "author 0 or more");
        }
        let root_f0 = (ior - 1.0) / (ior + 1.0);
        // ε keeps the sign of η − 1; for a weight of 1 it is root_f0 and η' is η, so the index is not touched at all.
        let epsilon = root_f0 * weight.sqrt();
        if epsilon.abs() >= 1.0 {
            return self.values.refuse(NAME, format!("raises the reflectance at n = {ior} to 1 or more, author less"));
        }
        if (weight - 1.0).abs() < f64::EPSILON {
            return Ok(ior);
        }
        source.push_str(&format!(" = {ior} after specular_weight {weight}"));
        Ok((1.0 + epsilon) / (1.0 - epsilon))
    }

    /// OpenPBR: V_d = abbe_number / scale, scale 0 is off.
    fn open_pbr_abbe_number(&self, diagnostics: &mut Diagnostics) -> Result<Option<(f64, String)>> {
        const SCALE: &str = "transmission_dispersion_scale";
        const NUMBER: &str = "transmission_dispersion_abbe_number";
        let scale = self.number(SCALE, 0.0, diagnostics)?;
        if scale < 0.0 {
            return self.values.refuse(SCALE, "author 0 (off) or more");
        }
        if scale == 0.0 {
            return Ok(None);
        }
        let number = self.number(NUMBER, 20.0, diagnostics)?;
        if number <= 0.0 {
            return self.values.refuse(NUMBER, "author a positive Abbe number, or transmission_dispersion_scale = 0");
        }
        Ok(Some((number / scale, format!("inputs:{NUMBER} {number} / inputs:{SCALE} {scale}"))))
    }

    /// Standard Surface, Arnold: the Abbe number itself, 0 is off.
    fn standard_surface_abbe_number(&self, diagnostics: &mut Diagnostics) -> Result<Option<(f64, String)>> {
        const NAME: &str = "transmission_dispersion";
        let number = self.number(NAME, 0.0, diagnostics)?;
        if number < 0.0 {
            return self.values.refuse(NAME, "author a positive Abbe number, or 0 for no dispersion");
        }
        if number > 0.0 && number < LOWEST_CREDIBLE_ABBE_NUMBER {
            diagnostics.warn(
                "suspect-abbe-number",
                self.values.place(NAME),
                "is an Abbe number here (glass has 16 to 95), and low ones disperse more: is this OpenPBR's dispersion scale?",
            );
        }
        Ok((number > 0.0).then(|| (number, format!("inputs:{NAME}"))))
    }

    /// KHR_materials_dispersion: 20 / V_d, 0 is off.
    fn gltf_abbe_number(&self, diagnostics: &mut Diagnostics) -> Result<Option<(f64, String)>> {
        const NAME: &str = "dispersion";
        let dispersion = self.number(NAME, 0.0, diagnostics)?;
        if dispersion < 0.0 {
            return self.values.refuse(NAME, "author 20 / V, or 0 for no dispersion");
        }
        Ok((dispersion > 0.0).then(|| (20.0 / dispersion, format!("20 / inputs:{NAME} {dispersion}"))))
    }

    fn number(&self, name: &str, default: f64, diagnostics: &mut Diagnostics) -> Result<f64> {
        if self.is_driven(name, default, diagnostics) {
            return Ok(default);
        }
        Ok(self.values.number(name)?.unwrap_or(default))
    }

    fn switch(&self, name: &str, default: bool, diagnostics: &mut Diagnostics) -> Result<bool> {
        if self.is_driven(name, default, diagnostics) {
            return Ok(default);
        }
        Ok(self.values.switch(name)?.unwrap_or(default))
    }

    fn is_driven(&self, name: &str, default: impl std::fmt::Display, diagnostics: &mut Diagnostics) -> bool {
        let driven = self.shader.connected.contains_key(name);
        if driven {
            diagnostics.warn(
                "textured-input",
                self.values.place(name),
                format!(
                    "is driven by a network, which the specular chain does not read: its default {default} is used"
                ),
            );
        }
        driven
    }

    /// The dielectric priority and where it stands; `None` where none is set.
    pub(super) fn priority(&self) -> Result<Option<(Priority, String)>> {
        const NAME: &str = "dielectric_priority";
        let number = match self.shader.id.as_str() {
            "arnold:standard_surface" => self.values.int(NAME)?.unwrap_or(0),
            _ => 0,
        };
        let priority = Priority::higher_wins(number);
        let source = || format!("{number} (higher wins) from {}", self.values.place(NAME));
        Ok((priority != Priority::UNSET).then(|| (priority, source())))
    }
}
