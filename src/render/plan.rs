//! The plan: from the scene and what was asked for follows what is carried and computed at all, with reasons.
//!
//! Precedence: request > product > settings > default. Nothing that is skipped changes a bit of what is computed.

use std::fmt;

use serde::Serialize;

use super::driver::Driver;
use super::layers::{PlannedLayer, layers};
use super::motion::motion_plan;
use super::request::Request;
use super::sampling::Sampling;
use super::settings::{self, Attributes};
use super::shot::{DepthOfField, Shot};
use super::textures;
use super::validity;
use crate::camera::ConformPolicy;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::{Aov, INTERNAL_TRANSMITTANCE, SPECTRAL};
use crate::film::metadata::Attribute;
use crate::film::spectral::Bins;
use crate::film::{SampleRange, Window};
use crate::geometry::Shape;
use crate::integrator::path::DepthLimits;
use crate::integrator::transmittance::absorbs;
use crate::integrator::{Columns, Integrator, Needs, Optics, Registry};
use crate::optics::dispersion::Dispersion;
use crate::sampler::filter::Filter;
use crate::scene::description::Product;
use crate::scene::material::{Kind, Material};
use crate::scene::{Scene, lights};
use crate::spectrum::sensor::ColorSpace;
use crate::spectrum::{Wavelength, lines};

/// A decision with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// What is decided about.
    pub what: String,
    /// Why.
    pub why: String,
}

/// What a material came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialDecision {
    /// Its prim path.
    pub what: String,
    /// [`Kind::name`](crate::scene::material::Kind::name).
    pub kind: &'static str,
    /// Index at the d line, of what refracts.
    pub nd: Option<f64>,
    /// Abbe number; absent without dispersion.
    pub vd: Option<f64>,
    /// From which input, and why.
    pub why: String,
}

impl MaterialDecision {
    fn of(material: &Material) -> Self {
        let law = match &material.kind {
            Kind::Dielectric { dispersion, .. } => Some(dispersion),
            _ => None,
        };
        Self {
            what: material.path.clone(),
            kind: material.kind.name(),
            nd: law.map(|law| law.at(lines::D).ior),
            vd: law.and_then(Dispersion::abbe_number),
            why: material.chosen.clone(),
        }
    }
}

/// Everything that is settled before the first ray.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Path of the stage's product; empty if there is none.
    pub product: String,
    /// Output file that the product names; empty if it names none.
    pub output: String,
    /// Index of the camera in the description.
    pub camera: usize,
    /// Path of the camera.
    pub camera_path: String,
    /// Full raster, pixels.
    pub resolution: [u32; 2],
    /// Pixels rendered.
    pub window: Window,
    /// Width of a pixel over its height, before the conform policy.
    pub pixel_aspect_ratio: f64,
    /// How the aperture is fitted.
    #[serde(skip)]
    pub conform_policy: ConformPolicy,
    /// Whether samples are spread over the lens.
    pub depth_of_field: bool,
    /// When the shutter opens and closes, frames from the scene's own, if something moves meanwhile.
    pub shutter: Option<[f64; 2]>,
    /// Whether something moves and vectors of motion are computed.
    pub motion_vectors: bool,
    /// Whether rays are traced at other times than the frame.
    pub traces_motion: bool,
    /// Samples rendered.
    pub samples: SampleRange,
    /// Relative error of a pixel at which it gets no more samples.
    pub error_target: Option<f64>,
    /// Seconds after which no more samples are begun.
    pub time_limit: Option<f64>,
    /// The most that a sample of the beauty may have in a channel.
    pub clamp: Option<f64>,
    /// How samples are spread about a pixel.
    #[serde(serialize_with = "filter")]
    pub filter: Filter,
    /// Seed of the sample positions.
    pub seed: u64,
    /// Threads, 0 for all.
    pub threads: usize,
    /// Memory for the texels of images, bytes.
    pub texture_memory: u64,
    /// Name of the integrator.
    pub integrator: String,
    /// Layers in the film's order.
    pub layers: Vec<PlannedLayer>,
    /// How often light may be scattered.
    pub depth_limits: DepthLimits,
    /// Image file that is seen through glass, behind everything.
    pub plate: Option<String>,
    /// Wavelengths.
    pub optics: Optics,
    /// What the numbers of colours of light mean.
    #[serde(serialize_with = "interop_id")]
    pub color_space: ColorSpace,
    /// What is computed.
    pub needs: Needs,
    /// EXR compression.
    pub compression: String,
    /// Attributes that the product wants in the header.
    #[serde(skip)]
    pub header: Vec<(String, Attribute)>,
    /// What is carried and computed, and why.
    pub carried: Vec<Decision>,
    /// What is skipped, and why.
    pub skipped: Vec<Decision>,
    /// What was decided for each material.
    pub materials: Vec<MaterialDecision>,
    /// Oddities of the request and of the stage's settings.
    #[serde(rename = "warnings")]
    pub diagnostics: Diagnostics,
}

fn interop_id<S: serde::Serializer>(space: &ColorSpace, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(space.interop_id())
}

fn filter<S: serde::Serializer>(filter: &Filter, serializer: S) -> Result<S::Ok, S::Error> {
    (filter.shape(), filter.width()).serialize(serializer)
}

/// Plans for every product of the scene that `request` asks for; one plan if the stage has no product.
pub fn plan(scene: &Scene, request: &Request, registry: &Registry) -> Result<Vec<Plan>> {
    let authored = &scene.document().settings;
    if let Some(wanted) = &request.product {
        let Some(product) = authored.products.iter().find(|p| p.path == *wanted) else {
            let known: Vec<_> = authored.products.iter().map(|p| p.path.as_str()).collect();
            let known = if known.is_empty() { "the stage has none".to_owned() } else { known.join(", ") };
            return Err(Error::usage(
                format!("--product {wanted}"),
                format!("there is no such RenderProduct: {known}"),
            ));
        };
        return Ok(vec![plan_product(scene, request, registry, Some(product))?]);
    }
    if authored.products.is_empty() {
        return Ok(vec![plan_product(scene, request, registry, authored.base.as_ref())?]);
    }
    authored.products.iter().map(|product| plan_product(scene, request, registry, Some(product))).collect()
}

fn plan_product(scene: &Scene, request: &Request, registry: &Registry, product: Option<&Product>) -> Result<Plan> {
    let mut diagnostics = Diagnostics::default();
    let attributes = Attributes::new(scene, product);

    let (integrator, layers) = layers(request, &attributes, product, registry, &mut diagnostics)?;
    let integrator = registry.find(&integrator)?;
    let sampling = Sampling::new(request, &attributes, integrator, &layers, &mut diagnostics)?;
    let samples = sampling.samples;
    let shot = Shot::new(scene, request, product, samples, &mut diagnostics)?;
    let optics = settings::optics(request, &attributes)?;
    let aovs: Vec<&Aov> = layers.iter().map(|layer| layer.aov).collect();
    let dispersive = dispersive_material(scene, &optics);
    let absorbing = scene.materials.iter().find(|material| absorbs(material));
    let mut needs = integrator.needs(&aovs, dispersive.is_some());
    needs.transmittance &= absorbing.is_some();
    validity::check(scene, &optics, &needs, &aovs)?;
    let (mut carried, mut skipped) = reasons(scene, integrator, &layers, &needs, [dispersive, absorbing], &optics);
    let DepthOfField { is_on, why } = &shot.depth_of_field;
    (if *is_on { &mut carried } else { &mut skipped })
        .push(Decision { what: "depth of field".to_owned(), why: why.clone() });
    let motion = motion_plan(scene, request, product, shot.authored(scene), &aovs, &mut diagnostics);
    (if motion.shutter.is_some() { &mut carried } else { &mut skipped })
        .push(Decision { what: "motion blur".to_owned(), why: motion.why });
    let seed = match (request.seed, attributes.integer("abbe:seed")?) {
        (Some(seed), _) => seed,
        (None, Some(seed)) => seed as u64,
        (None, None) => 0,
    };
    let driver = product.map(|p| Driver::new(p, &mut diagnostics)).unwrap_or_default();
    let color_space = settings::color_space(scene, product, &aovs, &mut diagnostics);
    textures::report_missing(scene, &needs, &mut diagnostics);
    if request.strict {
        refuse_warnings(&[scene.diagnostics(), &diagnostics])?;
    }
    let materials = scene.materials.iter().map(MaterialDecision::of).collect();
    Ok(Plan {
        product: product.map(|p| p.path.clone()).unwrap_or_default(),
        output: product.map(|p| p.name.clone()).unwrap_or_default(),
        camera: shot.camera,
        camera_path: shot.camera_path,
        resolution: shot.resolution,
        window: shot.window,
        pixel_aspect_ratio: shot.pixel_aspect_ratio,
        conform_policy: shot.conform_policy,
        depth_of_field: shot.depth_of_field.is_on,
        shutter: motion.shutter,
        motion_vectors: motion.vectors,
        traces_motion: motion.traced,
        samples,
        error_target: sampling.error_target,
        time_limit: sampling.time_limit,
        clamp: sampling.clamp,
        filter: sampling.filter,
        seed,
        threads: settings::threads(request)?,
        texture_memory: textures::memory(request)?,
        integrator: integrator.name().to_owned(),
        layers,
        depth_limits: DepthLimits {
            total: request.max_depth,
            diffuse: request.max_diffuse_depth,
            reflection: request.max_reflection_depth,
            transmission: request.max_transmission_depth,
        },
        plate: request.plate.clone(),
        optics,
        color_space,
        needs,
        compression: driver.compression,
        header: driver.header,
        carried,
        skipped,
        materials,
        diagnostics,
    })
}

impl Plan {
    /// The layers of spectral bins: their indices and what the bins are.
    pub fn bins(&self) -> impl Iterator<Item = (usize, Bins)> {
        let spectral = self.layers.iter().enumerate().filter(|(_, layer)| layer.aov.name == SPECTRAL);
        spectral.filter_map(|(index, layer)| Some((index, Bins::parse(&layer.argument).ok()?)))
    }
}

/// Under `--strict` the first warning is an error, which says how many there are.
fn refuse_warnings(diagnostics: &[&Diagnostics]) -> Result<()> {
    let warnings = || diagnostics.iter().flat_map(|d| d.warnings());
    let Some(first) = warnings().next() else { return Ok(()) };
    let others = match warnings().count() - 1 {
        0 => String::new(),
        others => format!(", and {others} more kinds of warning"),
    };
    let place = first.places.first().map_or("scene", String::as_str);
    Err(Error::scene(place, format!("{} (--strict{others})", first.message)))
}

/// The first material whose index moves with wavelength under this render's scale.
fn dispersive_material<'a>(scene: &'a Scene, optics: &Optics) -> Option<&'a Material> {
    scene.materials.iter().find(|m| match &m.kind {
        Kind::Dielectric { dispersion, thin_walled: false, .. } => {
            optics.dispersion_scale != 0.0 && !dispersion.is_constant()
        }
        _ => false,
    })
}

fn reasons(
    scene: &Scene,
    integrator: &dyn Integrator,
    layers: &[PlannedLayer],
    needs: &Needs,
    [dispersive, absorbing]: [Option<&Material>; 2],
    optics: &Optics,
) -> (Vec<Decision>, Vec<Decision>) {
    use crate::film::aov::Family;
    let mut carried = Vec::new();
    let mut skipped = Vec::new();
    let asked = |families: &[Family]| {
        layers
            .iter()
            .filter(|layer| families.contains(&layer.aov.family))
            .map(|layer| layer.aov.name)
            .collect::<Vec<_>>()
    };
    let why_not = |names: &[&str]| {
        if names.is_empty() {
            "no AOV asks for it".to_owned()
        } else if optics.dispersion_scale == 0.0 {
            format!("the dispersion scale is 0: {} exactly 0", list(names, "is", "are"))
        } else {
            format!("no material in use disperses: {} exactly 0", list(names, "is", "are"))
        }
    };
    let mut decide = |what: &str, computed: bool, families: &[Family]| {
        let names = asked(families);
        let because = dispersive.map_or_else(String::new, |m| format!(", and {} disperses", m.path));
        let (list, why) = if computed {
            (&mut carried, format!("{} for it{because}", list(&names, "asks", "ask")))
        } else {
            (&mut skipped, why_not(&names))
        };
        list.push(Decision { what: what.to_owned(), why });
    };
    use Family::{
        Chain, FirstSurface, LambdaColumn, LambdaSecondOrder, MotionRetrace, Retrace, ScreenColumns, ScreenSecondOrder,
    };
    decide(
        "wavelength column ∂λ",
        needs.columns >= Columns::Lambda,
        &[LambdaColumn, LambdaSecondOrder, ScreenColumns, ScreenSecondOrder, Retrace],
    );
    decide(
        "screen columns ∂x, ∂y",
        needs.columns >= Columns::Screen,
        &[ScreenColumns, ScreenSecondOrder, LambdaSecondOrder, Retrace],
    );
    decide("second order ∂²λ", needs.columns >= Columns::SecondOrder, &[LambdaSecondOrder]);
    decide("second chain along the screen motion", needs.second_chain, &[ScreenSecondOrder]);
    decide("re-trace at the R, G, B wavelengths", needs.retrace, &[Retrace]);
    let mut note = |computed: bool, what: &str, why: String| {
        let list = if computed { &mut carried } else { &mut skipped };
        list.push(Decision { what: what.to_owned(), why });
    };
    let chain_asked =
        asked(&[Chain, LambdaColumn, LambdaSecondOrder, ScreenColumns, ScreenSecondOrder, Retrace, MotionRetrace]);
    if needs.chain {
        note(true, "specular chain", format!("{} about it", list(&chain_asked, "tells", "tell")));
    } else {
        let why = match &asked(&[FirstSurface])[..] {
            [] => "no AOV asks for it".to_owned(),
            names => format!("{} about the first surface only", list(names, "tells", "tell")),
        };
        note(false, "specular chain", why);
    }
    let asks = layers.iter().any(|layer| layer.aov.name == INTERNAL_TRANSMITTANCE);
    let why = match (asks, absorbing) {
        (false, _) => "no AOV asks for it".to_owned(),
        (true, None) => format!("no material in use absorbs: {INTERNAL_TRANSMITTANCE} is exactly 1"),
        (true, Some(material)) => format!("{INTERNAL_TRANSMITTANCE} asks for it, and {} absorbs", material.path),
    };
    note(needs.transmittance, "absorption along the chain", why);
    let uv: Vec<_> = layers.iter().map(|layer| layer.aov.name).filter(|name| name.ends_with("uv")).collect();
    let why =
        if uv.is_empty() { "no AOV asks for them".into() } else { format!("{} for them", list(&uv, "asks", "ask")) };
    note(!uv.is_empty(), "texture coordinates", why);
    if needs.columns > Columns::None {
        match scene.objects.kinds().find(|(shape, _, materials)| is_smooth_glass(scene, shape, materials)) {
            Some((_, prim_id, _)) => {
                let path = scene.prims.path(prim_id).unwrap_or_default();
                note(true, "∂N, how normals move", format!("{path} is glass with a curved or smooth-shaded surface"));
            }
            None => note(false, "∂N, how normals move", "every glass has flat facets".into()),
        }
    }
    let kinds: Vec<_> =
        lights::kinds(scene.document()).into_iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    let emitting = scene.materials.iter().find(|material| material.surface.emits());
    let why = match needs.transport {
        true => format!("{} for light", list(&asked(&[Family::Transport]), "asks", "ask")),
        false => format!("the integrator '{}' has no use for them, or no AOV asks for light", integrator.name()),
    };
    if kinds.is_empty() {
        note(false, "light sampling", "the stage has no lights".into());
    } else {
        note(needs.transport, &format!("lights ({})", kinds.join(", ")), why.clone());
    }
    match emitting {
        None => note(false, "emission", "no material in use emits".into()),
        Some(material) => note(needs.transport, "emission", format!("{} emits, and {why}", material.path)),
    }
    textures::decide(scene, layers, needs, &mut note);
    if scene.objects.hides_some() {
        note(
            true,
            "what is hidden from the camera",
            "its own rays pass through it; refracted and reflected ones meet it".into(),
        );
    }
    for (reason, count) in &scene.skipped {
        note(false, reason, format!("{count} left out by the bridge"));
    }
    (carried, skipped)
}

/// Names with the verb for one or for many; of a long list the first few.
fn list(names: &[&str], one: &str, many: &str) -> String {
    const SHOWN: usize = 4;
    match names {
        [name] => format!("{name} {one}"),
        names if names.len() <= SHOWN + 1 => format!("{} {many}", names.join(", ")),
        names => format!("{} and {} more {many}", names[..SHOWN].join(", "), names.len() - SHOWN),
    }
}

/// Whether a shape with these materials is glass whose normals move over its surface.
fn is_smooth_glass(scene: &Scene, shape: &Shape, material_ids: &[u32]) -> bool {
    let is_glass = |id: &u32| id.checked_sub(1).is_some_and(|i| scene.materials[i as usize].has_interior());
    let is_smooth = match shape {
        Shape::Sphere(_) => true,
        Shape::Solid(solid) => solid.is_curved(),
        Shape::Mesh(mesh) => mesh.has_normals(),
    };
    is_smooth && material_ids.iter().any(is_glass)
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.resolution;
        let or = |text: &str, other: &str| if text.is_empty() { other.to_owned() } else { text.to_owned() };
        writeln!(f, "product      {}", or(&self.product, "(none authored)"))?;
        writeln!(f, "output       {}", or(&self.output, "(named on the command line)"))?;
        writeln!(f, "camera       {}", or(&self.camera_path, "(framed automatically)"))?;
        write!(f, "image        {width} x {height}")?;
        if self.window != Window::full(self.resolution) {
            let Window { x0, y0, x1, y1 } = self.window;
            write!(f, ", pixels ({x0}, {y0}) to ({x1}, {y1})")?;
        }
        write!(f, ", {} sample{}", self.samples.total, if self.samples.total == 1 { "" } else { "s" })?;
        if !self.samples.is_all() {
            write!(f, ", of which {}:{}", self.samples.begin, self.samples.end)?;
        }
        writeln!(f)?;
        writeln!(f, "integrator   {}", self.integrator)?;
        let nm = |w: Wavelength| w.nanometers();
        writeln!(
            f,
            "wavelengths  reference {} nm, band {} to {} nm, dispersion scale {}",
            nm(self.optics.reference),
            nm(self.optics.band[0]),
            nm(self.optics.band[1]),
            self.optics.dispersion_scale
        )?;
        for (i, names) in self.layers.chunks(6).enumerate() {
            let names: Vec<_> = names.iter().map(|layer| layer.aov.name).collect();
            writeln!(f, "{:13}{}", if i == 0 { "layers" } else { "" }, names.join(", "))?;
        }
        let worded = |decisions: &[Decision]| decisions.iter().map(|d| format!("{}: {}", d.what, d.why)).collect();
        let materials = self.materials.iter().map(|m| format!("{}: {}", m.what, m.why)).collect();
        let sections: [(&str, Vec<String>); 3] =
            [("carried", worded(&self.carried)), ("skipped", worded(&self.skipped)), ("materials", materials)];
        for (title, lines) in sections {
            writeln!(f, "{title}")?;
            for line in &lines {
                writeln!(f, "  {line}")?;
            }
            if lines.is_empty() {
                writeln!(f, "  none")?;
            }
        }
        Ok(())
    }
}
