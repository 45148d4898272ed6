//! What a material says, compiled to what a ray follows.
//!
//! The index comes from the first of: our `abbe:…` attributes (`law`); the dispersion inputs of the shading network,
//! each by its own specification (`dialect`); a scalar index, constant unless [`ScalarIor`] says otherwise. Fallbacks
//! of a schema never decide, only authored values do, and what decided stands in [`Material::chosen`].

mod absorption;
mod dialect;
mod law;
#[cfg(test)]
mod tests;
mod values;

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::Absorption;
use crate::optics::dispersion::Dispersion;
use crate::optics::media::Priority;
use crate::scene::description::{self, Shader};

use dialect::{Response, Surface};
use law::Authored;
use values::Values;

/// From this weight on a surface counts as what the weight says: transmissive, metallic, present.
const THRESHOLD: f64 = 0.5;

/// The highest roughness of a smooth surface: its GGX lobe α = roughness² = 0.0009 rad is as narrow as a pixel of a
/// 960 pixel wide image with a field of 50°, so what is seen in it is seen at full sharpness. A metal above it ends the
/// specular chain, a dielectric is followed along the mean normal and counts as rough.
pub const SMOOTH_ROUGHNESS: f64 = 0.03;

/// What becomes of an index that nothing else is known of (`abbe:scalarIor`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ScalarIor {
    /// It holds at every wavelength; its derivative is exactly 0.
    #[default]
    Constant,
}

impl ScalarIor {
    /// Reads the token of the stage or of the command line; `place` names where it stands.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        match text {
            "" | "constant" => Ok(Self::Constant),
            "nearestGlass" | "nearest-glass" => Err(Error::usage(
                place,
                format!("'{text}' needs the glass catalogue, which is not part of this version: use constant"),
            )),
            _ => Err(Error::usage(place, format!("'{text}' is unknown: use constant"))),
        }
    }
}

/// What a material cannot say of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Context {
    /// What becomes of an index without dispersion.
    pub scalar_ior: ScalarIor,
    /// Metres in a unit of the stage, positive.
    pub meters_per_unit: f64,
}

/// A compiled material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Prim path.
    pub path: String,
    /// What a ray does at its surface.
    pub kind: Kind,
    /// What decided the kind and the index, and why; one line for the plan.
    pub chosen: String,
}

impl Material {
    /// Whether a ray inside is in another medium.
    pub fn has_interior(&self) -> bool {
        matches!(self.kind, Kind::Dielectric { thin_walled: false, .. })
    }
}

/// What a ray of the specular chain does at a surface.
#[derive(Clone, Debug)]
pub enum Kind {
    /// It is refracted or totally reflected.
    Dielectric {
        /// The index inside.
        dispersion: Dispersion,
        /// What the inside takes from the light; `None` where it is clear, and of a wall without an inside.
        absorption: Option<Absorption>,
        /// Which medium wins where objects overlap.
        priority: Priority,
        /// Rougher than [`SMOOTH_ROUGHNESS`].
        rough: bool,
        /// A wall without an inside: the ray goes straight through.
        thin_walled: bool,
    },
    /// It is reflected: a smooth metal.
    Mirror,
    /// It goes straight on, as if the surface were not there.
    PassThrough,
    /// It ends.
    Opaque,
}

/// Compiles what was authored. Errors name the prim and attribute, and what to author instead.
pub fn compile(material: &description::Material, context: &Context, diagnostics: &mut Diagnostics) -> Result<Material> {
    let (kind, chosen) = classify(material, context, diagnostics)?;
    Ok(Material { path: material.path.clone(), kind, chosen })
}

fn classify(
    material: &description::Material,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<(Kind, String)> {
    let terminals: Vec<&Shader> = material.surface.iter().chain(&material.alternatives).collect();
    let surface = terminals.iter().find_map(|shader| Surface::of(shader));

    let mut places = vec![Values::new(&material.abbe, &material.path, "")];
    if let Some(shader) = surface.as_ref().map(Surface::shader).or(material.surface.as_ref()) {
        places.push(Values::new(&shader.abbe, &shader.path, "inputs:"));
    }
    places.push(Values::new(&material.interface_abbe, &material.path, "inputs:"));
    let authored = Authored::new(places);
    authored.warn_of_unread(diagnostics);

    let Some(surface) = surface else {
        let reason = match terminals[..] {
            [] => "no surface shader".to_owned(),
            _ => warn_of_unknown(&terminals, diagnostics),
        };
        warn_of_idle_law(material, &authored, &reason, diagnostics)?;
        return Ok((Kind::Opaque, format!("opaque: {reason}")));
    };
    let (kind, reason) = match surface.response(diagnostics)? {
        Response::Transmissive { why, rough, thin_walled } => {
            let (dispersion, source) =
                dispersion(&surface, surface.shader(), &authored, context.scalar_ior, diagnostics)?;
            let wall = if thin_walled { "thin-walled dielectric, followed straight through" } else { "dielectric" };
            let lobe = if rough { ", rough" } else { "" };
            let (absorption, fades) =
                match absorption::absorption(&surface, &authored, thin_walled, context, diagnostics)? {
                    Some((absorption, place)) => {
                        let fades = format!("; {} from {place}", absorption.describe());
                        (Some(absorption), fades)
                    }
                    None => (None, String::new()),
                };
            let (priority, rank) = match authored.priority()?.or(surface.priority()?) {
                Some((priority, source)) => (priority, format!("; priority {source}")),
                None => (Priority::UNSET, String::new()),
            };
            let chosen = format!("{wall} ({why}{lobe}): {source}{fades}{rank}");
            (Kind::Dielectric { dispersion, absorption, priority, rough, thin_walled }, chosen)
        }
        Response::Metal { why, rough: false } => (Kind::Mirror, format!("mirror: {why}, smooth")),
        Response::Metal { why, rough: true } => {
            (Kind::Opaque, format!("opaque: {why}, rougher than {SMOOTH_ROUGHNESS}"))
        }
        Response::CutOut(why) => (Kind::PassThrough, format!("cut out: {why}")),
        Response::Opaque(why) => (Kind::Opaque, format!("opaque: {why}")),
    };
    if !matches!(kind, Kind::Dielectric { .. }) {
        warn_of_idle_law(material, &authored, &reason, diagnostics)?;
    }
    Ok((kind, format!("{reason}{}", passed_over(&terminals, surface.shader()))))
}

/// Says that none of the terminals leads to a shader that is understood; returns it for the plan.
fn warn_of_unknown(terminals: &[&Shader], diagnostics: &mut Diagnostics) -> String {
    for shader in terminals {
        diagnostics.warn(
            "unsupported-shader",
            format!("<{}>", shader.path),
            format!("shader '{}' is not understood: its surfaces are opaque", shader.id),
        );
    }
    let ids: Vec<_> = terminals.iter().map(|shader| format!("'{}'", shader.id)).collect();
    format!("shader {} is not understood", ids.join(", "))
}

/// For the plan: the terminal of `used`, where others came before it.
fn passed_over(terminals: &[&Shader], used: &Shader) -> String {
    let others: Vec<_> = terminals.iter().take_while(|s| !std::ptr::eq(**s, used)).map(|s| s.id.as_str()).collect();
    match others[..] {
        [] => String::new(),
        _ => format!(" [{} through {}, since {} is not understood]", used.id, used.terminal, others.join(", ")),
    }
}

/// The index of a transmissive surface and where it comes from.
fn dispersion(
    surface: &Surface<'_>,
    shader: &description::Shader,
    authored: &Authored<'_>,
    scalar_ior: ScalarIor,
    diagnostics: &mut Diagnostics,
) -> Result<(Dispersion, String)> {
    let glass = surface.glass(diagnostics)?;
    let at_ior = |problem: String| Error::scene(&glass.ior_place, problem);
    let (law, source) = if let Some(stated) = authored.law(glass.ior, diagnostics)? {
        (stated.dispersion, stated.source)
    } else if let Some(abbe_number) = glass.abbe_number {
        let law = Dispersion::from_abbe_number(glass.ior, abbe_number).map_err(at_ior)?;
        (law, format!("{} of {}, n_d from {}", glass.abbe_source, shader.id, glass.ior_source))
    } else {
        let ScalarIor::Constant = scalar_ior;
        let law = Dispersion::constant(glass.ior).map_err(at_ior)?;
        (law, format!("no dispersion is authored, {} of {}", glass.ior_source, shader.id))
    };
    let scale = authored.scale(diagnostics)?;
    // 1 leaves the law as it is, bit for bit.
    if scale.to_bits() == 1.0_f64.to_bits() {
        return Ok((law.clone(), format!("{} from {source}", law.describe())));
    }
    let scaled = law.scaled(scale).map_err(|problem| Error::scene(authored.scale_place(), problem))?;
    Ok((scaled, format!("{} from {source}, dispersion × {scale}", law.describe())))
}

/// A law on a surface that lets no light pass is most likely a forgotten transmission.
fn warn_of_idle_law(
    material: &description::Material,
    authored: &Authored<'_>,
    reason: &str,
    diagnostics: &mut Diagnostics,
) -> Result<()> {
    if authored.has_law()? {
        diagnostics.warn(
            "idle-dispersion",
            format!("<{}>", material.path),
            format!("has a dispersion law and no glass to use it ({reason}): author a transmissive surface"),
        );
    }
    Ok(())
}
