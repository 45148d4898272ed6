//! The lights of a scene: checked with it, compiled when an integrator asks.
//!
//! A light that cannot be is left out with a warning, and so is what a light says that has no meaning; the rest of the
//! picture stays. Numbers outside of a range that UsdLux clamps to are clamped without a word. Only indices out of range,
//! which no stage has, are errors.

mod authored;
mod images;
mod summary;

use std::collections::HashMap;
use std::sync::Arc;

use glam::DAffine3;

use super::Scene;
use super::builder::NamedArrays;
use super::description::{self, Asset, Description, Document, LightShape, Target};
use super::unroll::place_of;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::geometry::{Buffer, affine, is_invertible};
use crate::light::ies::{self, Profile};
use crate::light::{Geometry, Light, MaterialSync, Patch, Shape};

pub use images::LightImages;
pub use summary::{Summary, kinds};

/// More lights than this that point instancers would place are left out: 100 MB of them, and far more than light sampling
/// is good for.
const MAX_INSTANCED: u64 = 1 << 16;

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// In the order of the description; of point instancers, place by place.
    pub lights: Vec<Light>,
    /// Names of the light groups, by first use.
    pub groups: Vec<String>,
    /// What was odd about them and was not known before: files, transforms.
    pub diagnostics: Diagnostics,
}

/// Every light's numbers, textures and placements are usable; without looking into files.
pub(super) fn check(description: &Description, diagnostics: &mut Diagnostics) -> Result<()> {
    let textures = description.document.textures.len();
    for light in description.document.groups.iter().flat_map(|group| &group.lights) {
        if let LightShape::Dome { texture: Some(index), .. } | LightShape::Rect { texture: Some(index), .. } =
            light.shape
            && index >= textures
        {
            let problem =
                format!("refers to texture {index} of {textures}: the scene file is damaged, export it again");
            return Err(Error::scene(&light.path, problem));
        }
        authored::compile(light, &DAffine3::IDENTITY, None, diagnostics);
    }
    Ok(())
}

/// Compiles the lights of `scene`.
pub(super) fn compile(scene: &Scene) -> Result<Lights> {
    let mut compiler = Compiler {
        scene,
        profiles: HashMap::new(),
        lights: Vec::new(),
        groups: Vec::new(),
        portals: HashMap::new(),
        domes: Vec::new(),
        instanced: 0,
        diagnostics: Diagnostics::default(),
    };
    let document = scene.document();
    // Geometry is a light wherever it is placed: by its prim, whatever places it.
    for light in document.groups.iter().flat_map(|group| &group.lights) {
        if let LightShape::Geometry { prims, material_sync_mode } = &light.shape {
            compiler.geometry(light, prims, material_sync_mode)?;
        }
    }
    let counts = counts(document);
    compiler.walk(document.root, &counts)?;
    let Compiler { mut lights, groups, portals, domes, diagnostics, .. } = compiler;
    for (index, paths) in domes {
        if let Shape::Dome(dome) = &mut lights[index].shape {
            dome.portals = paths.iter().filter_map(|path| portals.get(path.as_str())).flatten().cloned().collect();
        }
    }
    Ok(Lights { lights, groups, diagnostics: new_ones(&diagnostics, &scene.diagnostics) })
}

/// The warnings of `found` that `known` does not have.
fn new_ones(found: &Diagnostics, known: &Diagnostics) -> Diagnostics {
    let mut new = Diagnostics::default();
    for warning in found.warnings() {
        if !known.warnings().iter().any(|w| w.kind == warning.kind && w.message == warning.message) {
            for place in &warning.places {
                new.warn(&warning.kind, place, &warning.message);
            }
        }
    }
    new
}

/// Lights that each group places, those of groups and arrays in it included.
fn counts(document: &Document) -> Vec<u64> {
    let mut counts = vec![None; document.groups.len()];
    // Depth first with an explicit stack; there are no cycles.
    let mut stack = vec![document.root];
    while let Some(&group) = stack.last() {
        if counts[group].is_some() {
            stack.pop();
            continue;
        }
        let described = &document.groups[group];
        let inner = described.items.iter().filter_map(|item| match item.target {
            Target::Group(inner) => Some((inner, 1)),
            Target::Shape(_) => None,
        });
        let inner = inner.chain(described.instances.iter().map(|instances| (instances.group, instances.count as u64)));
        let mut sum = described.lights.iter().filter(|light| is_placed(light)).count() as u64;
        let mut is_known = true;
        for (inner, places) in inner {
            match counts[inner] {
                Some(count) => sum = sum.saturating_add(places.saturating_mul(count)),
                None => {
                    is_known = false;
                    stack.push(inner);
                }
            }
        }
        if is_known {
            counts[group] = Some(sum);
            stack.pop();
        }
    }
    counts.into_iter().map(Option::unwrap_or_default).collect()
}

/// Whether a light has a place of its own.
fn is_placed(light: &description::Light) -> bool {
    !matches!(light.shape, LightShape::Geometry { .. })
}

struct Compiler<'a> {
    scene: &'a Scene,
    profiles: HashMap<&'a str, Option<Arc<Profile>>>,
    lights: Vec<Light>,
    groups: Vec<String>,
    portals: HashMap<&'a str, Vec<Patch>>,
    /// Domes with portals.
    domes: Vec<(usize, &'a [String])>,
    instanced: u64,
    diagnostics: Diagnostics,
}

impl<'a> Compiler<'a> {
    /// Every placed light of a group and of what is in it.
    fn walk(&mut self, root: usize, counts: &[u64]) -> Result<()> {
        let document: &'a Document = self.scene.document();
        let mut stack = vec![(root, DAffine3::IDENTITY)];
        while let Some((group, world_from_group)) = stack.pop() {
            if counts[group] == 0 {
                continue;
            }
            let group = &document.groups[group];
            for light in group.lights.iter().filter(|light| is_placed(light)) {
                self.place(light, &world_from_group)?;
            }
            let mut inner = Vec::new();
            for item in &group.items {
                if let Target::Group(index) = item.target
                    && counts[index] > 0
                    && let Some(local) = place_of(item.transform.as_ref(), &item.path, &mut self.diagnostics)
                {
                    inner.push((index, world_from_group * local));
                }
            }
            for instances in group.instances.iter().filter(|instances| counts[instances.group] > 0) {
                let arrays = NamedArrays { description: self.scene.description(), place: &instances.path };
                let places: Buffer<[f64; 12]> = arrays.doubles(&instances.transforms, 12)?;
                let lights = counts[instances.group].saturating_mul(places.len() as u64);
                if self.instanced.saturating_add(lights) > MAX_INSTANCED {
                    let problem = format!(
                        "its prototypes' lights are left out: with them, point instancers would place more than \
                         {MAX_INSTANCED} lights"
                    );
                    self.diagnostics.warn("instanced-lights", &instances.path, problem);
                    continue;
                }
                self.instanced += lights;
                let Some(local) = place_of(instances.transform.as_ref(), &instances.path, &mut self.diagnostics) else {
                    continue;
                };
                let world_from_array = world_from_group * local;
                inner.extend(places.iter().map(|rows| (instances.group, world_from_array * affine(rows))));
            }
            // The first on top.
            stack.extend(inner.into_iter().rev());
        }
        Ok(())
    }

    fn place(&mut self, light: &'a description::Light, world_from_group: &DAffine3) -> Result<()> {
        let Some(local) = place_of(light.transform.as_ref(), &light.path, &mut self.diagnostics) else {
            return Ok(());
        };
        let world_from_light = *world_from_group * local;
        if !is_invertible(&world_from_light) {
            let problem = "its transform flattens it to nothing: it is left out";
            self.diagnostics.warn("singular-transform", &light.path, problem);
            return Ok(());
        }
        if let LightShape::Portal { width, height } = light.shape {
            let patch = Patch::rectangle(&world_from_light, width, height);
            if patch.area > 0.0 && patch.area.is_finite() {
                self.portals.entry(&light.path).or_default().push(patch);
            }
            return Ok(());
        }
        if let LightShape::Dome { portals, .. } = &light.shape
            && !portals.is_empty()
        {
            self.domes.push((self.lights.len(), portals));
        }
        let profile = self.profile(light)?;
        match authored::compile(light, &world_from_light, profile, &mut self.diagnostics) {
            Some(compiled) => self.push(light, compiled),
            None => self.domes.retain(|&(index, _)| index < self.lights.len()),
        }
        Ok(())
    }

    fn geometry(&mut self, light: &'a description::Light, prims: &[String], mode: &str) -> Result<()> {
        let profile = self.profile(light)?;
        let Some(mut compiled) = authored::compile(light, &DAffine3::IDENTITY, profile, &mut self.diagnostics) else {
            return Ok(());
        };
        let mut prim_ids: Vec<u32> = prims.iter().filter_map(|path| self.scene.prims.find(path)).collect();
        prim_ids.sort_unstable();
        prim_ids.dedup();
        if prim_ids.is_empty() {
            let problem = "nothing that is rendered shines by it: it is left out";
            self.diagnostics.warn("broken-light", &light.path, problem);
            return Ok(());
        }
        let material = authored::material_sync(mode).unwrap_or(MaterialSync::NoResponse);
        compiled.shape = Shape::Geometry(Geometry { prim_ids, is_normalized: light.normalize, material });
        self.push(light, compiled);
        Ok(())
    }

    fn push(&mut self, authored: &description::Light, mut light: Light) {
        let name = authored::light_group(authored).unwrap_or_default();
        if !name.is_empty() {
            let known = self.groups.iter().position(|group| group == name);
            light.group = Some(known.unwrap_or_else(|| {
                self.groups.push(name.to_owned());
                self.groups.len() - 1
            }) as u32);
        }
        self.lights.push(light);
    }

    /// The light's profile, read once for all lights with the same file.
    fn profile(&mut self, light: &'a description::Light) -> Result<Option<Arc<Profile>>> {
        let Some(asset) = light.shaping.as_ref().and_then(|shaping| shaping.ies.as_ref()) else { return Ok(None) };
        let key = asset.file.as_deref().or(asset.content.as_deref()).unwrap_or(&asset.path);
        if let Some(profile) = self.profiles.get(key) {
            return Ok(profile.clone());
        }
        let profile = match self.read(asset, &light.path)?.and_then(|bytes| Profile::parse(&bytes)) {
            Ok(profile) => Some(Arc::new(profile)),
            Err(problem) if self.scene.document().strict_assets => {
                return Err(Error::scene(&light.path, format!("its profile {} {problem}", asset.path)));
            }
            Err(problem) => {
                let message = format!("its profile {} {problem}: it shines without", asset.path);
                self.diagnostics.warn("light-profile", &light.path, message);
                None
            }
        };
        self.profiles.insert(key, profile.clone());
        Ok(profile)
    }

    /// What is in a file; the inner error says why it cannot be read.
    fn read(&self, asset: &Asset, place: &str) -> Result<Result<Vec<u8>, String>> {
        if let Some(name) = &asset.content {
            let arrays = NamedArrays { description: self.scene.description(), place };
            return Ok(Ok(arrays.bytes(name)?.to_vec()));
        }
        let Some(file) = &asset.file else { return Ok(Err("was not found".into())) };
        let reason = |error: std::io::Error| format!("cannot be read ({error})");
        Ok(std::fs::metadata(file).map_err(reason).and_then(|about| {
            if !about.is_file() {
                return Err("is no file".into());
            }
            if about.len() > ies::MAX_BYTES as u64 {
                return Err(format!("has {} bytes: no profile is that large", about.len()));
            }
            std::fs::read(file).map_err(reason)
        }))
    }
}
