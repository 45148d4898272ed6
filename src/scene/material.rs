//! What a material says, compiled to what a ray follows.
//!
//! The index comes from the first of: our `abbe:…` attributes (`law`); the dispersion inputs of the shading network,
//! each by its own specification (`dialect`); a scalar index, constant unless [`ScalarIor`] says otherwise. Fallbacks
//! of a schema never decide, only authored values do, and what decided stands in [`Material::chosen`].

mod absorption;
mod appearance;
mod dialect;
mod law;
mod network;
mod nodes;
mod painter;
mod resources;
mod shading_frame;
mod surface;
#[cfg(test)]
mod tests;
mod values;

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::dispersion::{Dispersion, OutOfRange};
use crate::optics::media::Priority;
use crate::optics::{Absorption, Extinction, catalog};
use crate::scene::description::{self, Shader};
use crate::texture::{Builder, Program, TooLarge};

pub use appearance::{Appearance, Below, Opacity};
use dialect::{Glass, Response, Terminal};
use law::{Authored, StatedAbsorption};
use network::Networks;
use painter::Painter;
pub(in crate::scene) use resources::{Resources, source};
pub use shading_frame::ShadingFrame;
pub use surface::{Finish, Surface, SurfaceAt};
use surface::{IndexOf, Measured};
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
    /// It is that of the catalogue's glass, liquid or crystal whose n_d is nearest, and so is the curve.
    NearestGlass,
}

impl ScalarIor {
    /// Reads the token of the stage or of the command line; `place` names where it stands.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        match text {
            "" | "constant" => Ok(Self::Constant),
            "nearestGlass" | "nearest-glass" => Ok(Self::NearestGlass),
            _ => Err(Error::usage(place, format!("'{text}' is unknown: use constant or nearestGlass"))),
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
    /// What is looked up where a ray meets it.
    pub appearance: Appearance,
    /// What light transport meets.
    pub surface: Surface,
}

impl Material {
    /// Whether it is glass wherever it is: not only where some image says so.
    pub fn is_glass_all_over(&self) -> bool {
        self.has_interior() && self.appearance.opacity.as_ref().is_none_or(|opacity| opacity.below != Below::Glass)
    }

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
    Mirror {
        /// The metal, where one is stated beyond a colour.
        conductor: Option<Conductor>,
    },
    /// It goes straight on, as if the surface were not there.
    PassThrough,
    /// It ends.
    Opaque,
}

/// The complex index n + ik of a metal.
#[derive(Clone, Debug)]
pub struct Conductor {
    /// n(λ).
    pub dispersion: Dispersion,
    /// k(λ).
    pub extinction: Extinction,
}

impl Kind {
    /// In one or two words: dielectric, thin wall, mirror, cut out or opaque.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Dielectric { thin_walled: false, .. } => "dielectric",
            Self::Dielectric { thin_walled: true, .. } => "thin wall",
            Self::Mirror { .. } => "mirror",
            Self::PassThrough => "cut out",
            Self::Opaque => "opaque",
        }
    }
}

/// The albedo of what has no material, as Hydra shows it: `displayColor`, or a grey.
pub(super) fn display_color(resources: &mut Resources<'_>) -> Program {
    let mut builder = Builder::default();
    let mut compile = || {
        let grey = builder.constant(appearance::UNSTATED)?;
        let color = builder.primvar(resources.primvar("displayColor"), grey)?;
        builder.program(color)
    };
    compile().expect("two operations are not too many")
}

/// The surface of what has no material: diffuse, of the colour that [`display_color`] is.
pub(super) fn display_surface(resources: &mut Resources<'_>) -> Surface {
    let mut networks = Networks::default();
    let b = &mut networks.builder;
    let mut color = || {
        let grey = b.constant(appearance::UNSTATED)?;
        b.primvar(resources.primvar("displayColor"), grey)
    };
    let color = color().expect("two operations are not too many");
    Surface::diffuse(color, &mut networks)
}

/// Compiles what was authored. Errors name the prim and attribute, and what to author instead.
pub(super) fn compile(
    material: &description::Material,
    context: &Context,
    resources: &mut Resources<'_>,
    diagnostics: &mut Diagnostics,
) -> Result<Material> {
    let terminals: Vec<&Shader> = material.surface.iter().chain(&material.alternatives).collect();
    let mut surface = terminals.iter().find_map(|shader| Terminal::of(shader));
    let mut networks = Networks::default();
    if let Some(surface) = &mut surface {
        networks = Networks::compile(surface.shader(), &material.nodes, resources)?;
        surface.look_up(|name| networks.register(name).is_some());
    }
    let Classified { kind, measured, chosen } = classify(material, &terminals, surface.as_ref(), context, diagnostics)?;
    let (appearance, surface) = match &surface {
        Some(surface) => {
            let is_glass = matches!(kind, Kind::Dielectric { .. });
            let opacity = surface.opacity(diagnostics)?;
            let mut painter = Painter::new(surface.shader(), &mut networks, diagnostics).after(surface.defaulted());
            let appearance = Appearance::of(&mut painter, is_glass, opacity);
            let index = match &kind {
                Kind::Dielectric { thin_walled: false, .. } => IndexOf::Media,
                Kind::Dielectric { dispersion, .. } => IndexOf::Wall(dispersion),
                _ => IndexOf::Shader,
            };
            let compiled =
                surface.layers(&mut painter).and_then(|l| Surface::compile(&l, measured, index, &mut painter));
            let compiled = compiled.unwrap_or_else(|TooLarge| {
                painter.warn("", "the networks of its surface are too large");
                Surface::unstated()
            });
            (appearance, compiled)
        }
        None => (Appearance::unstated(), Surface::unstated()),
    };
    Ok(Material { path: material.path.clone(), kind, chosen, appearance, surface })
}

/// A material by itself: nothing of it is an image.
#[cfg(test)]
fn compile_alone(
    material: &description::Material,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<Material> {
    let document = serde_json::json!({
        "format": description::FORMAT, "version": description::VERSION,
        "stage": {"source": "", "meters_per_unit": 1.0, "up_axis": "Y"},
        "shapes": [], "groups": [], "root": 0, "materials": [], "cameras": [],
    });
    let document = serde_json::from_value(document).expect("is a document");
    let description = description::Description { document, arrays: Default::default() };
    compile(material, context, &mut Resources::new(&description), diagnostics)
}

/// What a material is.
struct Classified {
    kind: Kind,
    measured: Measured,
    /// Why.
    chosen: String,
}

fn classify(
    material: &description::Material,
    terminals: &[&Shader],
    surface: Option<&Terminal<'_>>,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<Classified> {
    let mut places = vec![Values::new(&material.abbe, &material.path, "")];
    if let Some(shader) = surface.map(Terminal::shader).or(material.surface.as_ref()) {
        places.push(Values::new(&shader.abbe, &shader.path, "inputs:"));
    }
    places.push(Values::new(&material.interface_abbe, &material.path, "inputs:"));
    let authored = Authored::new(places);
    authored.warn_of_unread(diagnostics);

    let Some(surface) = surface else {
        let reason = match terminals[..] {
            [] => "no surface shader".to_owned(),
            _ => warn_of_unknown(terminals, diagnostics),
        };
        warn_of_idle_law(material, &authored, &reason, diagnostics)?;
        let chosen = format!("opaque: {reason}");
        return Ok(Classified { kind: Kind::Opaque, measured: Measured::default(), chosen });
    };
    let response = surface.response(diagnostics)?;
    let mut measured = Measured::default();
    let uses_law = matches!(response, Response::Transmissive { .. } | Response::Metal { .. });
    let (kind, reason) = match response {
        Response::Transmissive { why, rough, thin_walled } => {
            let (dispersion, source) =
                dispersion(surface, surface.shader(), &authored, context.scalar_ior, diagnostics)?;
            let wall = if thin_walled { "thin-walled dielectric, followed straight through" } else { "dielectric" };
            let lobe = if rough { ", rough" } else { "" };
            let (absorption, fades) =
                match absorption::absorption(surface, &authored, thin_walled, context, diagnostics)? {
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
        Response::Metal { why, rough } => {
            let (conductor, source) = match conductor(surface, &authored, diagnostics)? {
                Some((conductor, source)) => (Some(conductor), format!("; n + ik from {source}")),
                None => (None, String::new()),
            };
            measured.conductor.clone_from(&conductor);
            match rough {
                false => (Kind::Mirror { conductor }, format!("mirror: {why}, smooth{source}")),
                true => (Kind::Opaque, format!("opaque: {why}, rougher than {SMOOTH_ROUGHNESS}{source}")),
            }
        }
        Response::CutOut(why) => (Kind::PassThrough, format!("cut out: {why}")),
        Response::Opaque(why) => (Kind::Opaque, format!("opaque: {why}")),
    };
    if !uses_law {
        warn_of_idle_law(material, &authored, &reason, diagnostics)?;
    }
    if let Some((reflectance, place)) = authored.reflectance(diagnostics)? {
        let is_opaque = matches!(kind, Kind::Opaque | Kind::Mirror { .. });
        if !is_opaque || measured.conductor.is_some() {
            let message = "has no effect: this surface is glass, a hole, or a metal whose n + ik is stated";
            diagnostics.warn("idle-reflectance", place, message);
        } else {
            measured.reflectance = Some(reflectance);
        }
    }
    let chosen = format!("{reason}{}", passed_over(terminals, surface.shader()));
    Ok(Classified { kind, measured, chosen })
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
    surface: &Terminal<'_>,
    shader: &description::Shader,
    authored: &Authored<'_>,
    scalar_ior: ScalarIor,
    diagnostics: &mut Diagnostics,
) -> Result<(Dispersion, String)> {
    let glass = surface.glass(diagnostics)?;
    let at_ior = |problem: String| Error::scene(&glass.ior_place, problem);
    let (law, source) = if let Some(stated) = authored.law(glass.ior, diagnostics)? {
        if let Some(metal) = stated.glass.filter(|entry| entry.is_metal()) {
            return Err(Error::scene(
                stated.source,
                format!("{} is a metal, and light passes this surface: name a glass, or author a metal", metal.name()),
            ));
        }
        (stated.dispersion, stated.source)
    } else if let Some(abbe_number) = glass.abbe_number {
        // An index that cannot be is the index's fault, what is left is the Abbe number's.
        Dispersion::constant(glass.ior).map_err(at_ior)?;
        let law = Dispersion::from_abbe_number(glass.ior, abbe_number)
            .map_err(|problem| Error::scene(&glass.abbe_place, problem))?;
        (law, format!("{} of {}, n_d from {}", glass.abbe_source, shader.id, glass.ior_source))
    } else {
        let constant = Dispersion::constant(glass.ior).map_err(at_ior)?;
        let authored = format!("no dispersion is authored, {} of {}", glass.ior_source, shader.id);
        let nearest = match scalar_ior {
            ScalarIor::Constant => None,
            ScalarIor::NearestGlass => nearest_glass(&glass, diagnostics)?,
        };
        match nearest {
            Some((law, name)) => (law, format!("{authored}: nearest is {name}")),
            None => (constant, authored),
        }
    };
    let scale = authored.scale(diagnostics)?;
    // 1 leaves the law as it is, bit for bit.
    if scale.to_bits() == 1.0_f64.to_bits() {
        return Ok((law.clone(), format!("{} from {source}", law.describe())));
    }
    let scaled = law.scaled(scale).map_err(|problem| Error::scene(authored.scale_place(), problem))?;
    Ok((scaled, format!("{} from {source}, dispersion × {scale}", law.describe())))
}

/// The catalogue's curve nearest in n_d, and its name; `None`, with a warning, where no medium is near.
fn nearest_glass(glass: &Glass, diagnostics: &mut Diagnostics) -> Result<Option<(Dispersion, String)>> {
    /// Glasses and liquids lie closer than this to each other from 1.3 to 2; a larger distance means that the index is no
    /// known medium's, for instance 1 for "does not refract".
    const NEAR: f64 = 0.01;
    let entry = catalog::nearest(glass.ior);
    if (entry.nd() - glass.ior).abs() > NEAR {
        diagnostics.warn(
            "no-near-glass",
            &glass.ior_place,
            format!(
                "no medium of the catalogue has an index near {} (the nearest is {}, {:.4}): it stays constant",
                glass.ior,
                entry.name(),
                entry.nd()
            ),
        );
        return Ok(None);
    }
    let law = entry.dispersion(OutOfRange::Clamp).map_err(|problem| Error::scene(&glass.ior_place, problem))?;
    Ok(Some((law, format!("{} (n_d = {:.5})", entry.name(), entry.nd()))))
}

/// The metal that our attributes state, and where; `None` where they say nothing of it, or half.
fn conductor(
    surface: &Terminal<'_>,
    authored: &Authored<'_>,
    diagnostics: &mut Diagnostics,
) -> Result<Option<(Conductor, String)>> {
    let absorption = authored.absorption(diagnostics)?;
    let law = match authored.has_law()? {
        true => authored.law(surface.glass(diagnostics)?.ior, diagnostics)?,
        false => None,
    };
    match (law, absorption) {
        (Some(stated), Some(StatedAbsorption::Extinction { entries, place }))
            if stated.glass.is_none_or(|entry| entry.is_metal()) =>
        {
            let extinction = Extinction::table(&entries).map_err(|problem| Error::scene(place, problem))?;
            Ok(Some((Conductor { dispersion: stated.dispersion, extinction }, stated.source)))
        }
        (None, None) => Ok(None),
        (law, absorption) => {
            let place = match (&law, &absorption) {
                (Some(stated), _) => stated.source.clone(),
                (None, stated) => stated.as_ref().map_or_else(String::new, |stated| stated.place().to_owned()),
            };
            diagnostics.warn(
                "no-metal",
                place,
                "is not the n + ik of a metal, which this surface is: name a metal of the catalogue, author n(λ) and \
                 abbe:extinction:table, or make the surface transmissive",
            );
            Ok(None)
        }
    }
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
