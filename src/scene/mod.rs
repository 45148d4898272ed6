//! The scene: its description, the checks, the compiled form.
//!
//! A [`Scene`] comes only from [`builder::build`], so what exists is valid: indices are in range, transforms invert,
//! materials have a curve. It knows the stage's world, not yet a camera.

pub mod builder;
pub mod description;
pub mod file;
pub mod lights;
mod links;
mod manifest;
pub mod material;
mod meshes;
mod objects;
mod solids;
mod unroll;
pub mod view;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::texture::{Program, Store};
use description::{Description, Document};
use links::Links;
pub use manifest::Manifest;
use material::Material;
pub use objects::{Appearance, ConstantPrimvars, Object, ObjectArray, ObjectIds, Objects, PartIds};

/// Everything that can be rendered, checked.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Placed shapes in the order of the description.
    pub objects: Objects,
    links: Links,
    /// Materials bound to some object, in the order of the description.
    pub materials: Vec<Material>,
    /// Images that materials name.
    pub textures: Arc<Store>,
    /// The albedo of what has no material: the primvar `displayColor`.
    pub display_color: Program,
    /// What light transport meets where there is no material: a diffuse surface of that colour.
    pub display_surface: material::Surface,
    /// Prim paths behind `prim_id`.
    pub prims: Manifest,
    /// Instance paths behind `instance_id`.
    pub instances: Manifest,
    /// What was left out, and how often.
    pub skipped: BTreeMap<String, u64>,
    /// Counts for the statistics: triangles stored, shapes, bytes.
    pub counts: Counts,
    /// Time of building the trees over triangles, seconds, summed over shapes.
    pub tree_seconds: f64,
    pub(crate) diagnostics: Diagnostics,
    pub(crate) description: Description,
}

/// Sizes of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Distinct shapes that are placed at least once.
    pub shapes: u64,
    /// Triangles stored, shared ones once.
    pub triangles: u64,
    /// Placed shapes.
    pub objects: u64,
    /// Materials bound to an object.
    pub materials: u64,
}

impl Scene {
    /// Checks and compiles a description.
    ///
    /// Errors name the prim concerned; oddities that were repaired stand in [`diagnostics`](Self::diagnostics).
    pub fn build(description: Description) -> Result<Self> {
        builder::build(description)
    }

    /// The lights, compiled now: their files are read. Only integrators that use lights ask.
    pub fn lights(&self) -> Result<lights::Lights> {
        lights::compile(self)
    }

    /// Whether an object is in a link set: what [`Light::illuminates`](crate::light::Light::illuminates) and
    /// [`Light::shadowed_by`](crate::light::Light::shadowed_by) refer to.
    pub fn is_linked(&self, set: u32, object: u32) -> bool {
        self.links.contains(set, self.objects.location(object))
    }

    /// What the bridge and the builder had to say.
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.diagnostics
    }

    /// The description the scene was built from.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The description's document.
    pub fn document(&self) -> &Document {
        &self.description.document
    }
}
