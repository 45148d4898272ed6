//! Placed shapes and their identifiers: single ones, and arrays that store once what their objects share.

use std::sync::Arc;

use glam::DAffine3;

use crate::geometry::{Buffer, Instance, InstanceArray, Location, Numbering, Pose, Shape};

/// A placed shape.
#[derive(Clone, Debug)]
pub struct Object {
    /// The shape, shared between its placements.
    pub shape: Arc<Shape>,
    /// Stage world from object space.
    pub world_from_object: Pose,
    /// `prim_id`: 1-based index into [`Scene::prims`](super::Scene::prims).
    pub prim_id: u32,
    /// `instance_id`: what [`Scene::instances`](super::Scene::instances) counts, 0 for none.
    pub instance_id: u32,
    /// Material per slot (slot 0: faces in no subset): `material_id`, 1-based index into
    /// [`Scene::materials`](super::Scene::materials), 0 for none.
    pub material_ids: Arc<[u32]>,
    /// Constant primvars.
    pub primvars: Option<ConstantPrimvars>,
    /// How cameras see it.
    pub appearance: Appearance,
}

/// How cameras see an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Appearance {
    /// Camera rays pass through it unseen.
    pub hidden_from_camera: bool,
    /// Nothing of it shows, and alpha is 0 there.
    pub matte: bool,
}

/// Constant primvars by the number that they are looked up by.
pub type ConstantPrimvars = Arc<[Option<[f32; 4]>]>;

/// What every place of an array has of one part.
#[derive(Clone, Debug)]
pub struct PartIds {
    /// `prim_id`.
    pub prim_id: u32,
    /// Material per slot.
    pub material_ids: Arc<[u32]>,
    /// Constant primvars.
    pub primvars: Option<ConstantPrimvars>,
    /// How cameras see it.
    pub appearance: Appearance,
}

/// Shapes placed by an array of transforms.
#[derive(Clone, Debug)]
pub struct ObjectArray {
    /// Where they stand.
    pub instances: InstanceArray,
    /// Identifiers of the parts.
    pub parts: Arc<[PartIds]>,
    /// `instance_id` of the instancer's element 0.
    pub first_id: u32,
    /// Which element of the instancer stands at each place; its own number if absent.
    pub indices: Option<Buffer<i32>>,
}

/// The identifiers of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectIds<'a> {
    /// 1-based index into [`Scene::prims`](super::Scene::prims).
    pub prim_id: u32,
    /// What [`Scene::instances`](super::Scene::instances) counts, 0 for none.
    pub instance_id: u32,
    /// Material per slot.
    pub material_ids: &'a [u32],
    /// How cameras see it.
    pub appearance: Appearance,
}

/// All placed shapes, numbered: single ones first, then array by array, place by place, part by part. The number is the
/// tie-breaker between coincident surfaces.
#[derive(Clone, Debug, Default)]
pub struct Objects {
    singles: Vec<Object>,
    arrays: Vec<ObjectArray>,
    numbering: Numbering,
    hides_some: bool,
}

impl Objects {
    /// Arrays have at least one place and one part; there are less than 2^32 objects.
    pub(super) fn new(singles: Vec<Object>, arrays: Vec<ObjectArray>) -> Self {
        let sizes = arrays.iter().map(|a| (a.instances.places.len(), a.instances.parts.len()));
        let numbering = Numbering::new(singles.len(), sizes);
        let parts = arrays.iter().flat_map(|a| a.parts.iter()).map(|part| part.appearance);
        let hides_some = singles.iter().map(|o| o.appearance).chain(parts).any(|a| a.hidden_from_camera);
        Self { singles, arrays, numbering, hides_some }
    }

    /// Whether some are hidden from the camera.
    pub fn hides_some(&self) -> bool {
        self.hides_some
    }

    /// How many there are.
    pub fn len(&self) -> u32 {
        self.numbering.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.numbering.is_empty()
    }

    /// Those placed one by one.
    pub fn singles(&self) -> &[Object] {
        &self.singles
    }

    /// Those placed by arrays.
    pub fn arrays(&self) -> &[ObjectArray] {
        &self.arrays
    }

    /// What [`Aggregate::with_arrays`](crate::geometry::Aggregate::with_arrays) takes; it numbers the same way.
    /// Without motion unless it `moves`.
    pub(super) fn instances(&self, moves: bool) -> (Vec<Instance>, Vec<InstanceArray>) {
        let pose = |pose: &Pose| if moves { pose.clone() } else { pose.held() };
        let single =
            |o: &Object| Instance { shape: Arc::clone(&o.shape), world_from_object: pose(&o.world_from_object) };
        let array = |a: &ObjectArray| if moves { a.instances.clone() } else { a.instances.held() };
        (self.singles.iter().map(single).collect(), self.arrays.iter().map(array).collect())
    }

    /// Whether anything moves: places, or points of shapes.
    pub fn is_moving(&self) -> bool {
        let deforms = |shape: &Shape| matches!(shape, Shape::Mesh(mesh) if mesh.is_deforming());
        self.singles.iter().any(|o| o.world_from_object.is_moving() || deforms(&o.shape))
            || self
                .arrays
                .iter()
                .any(|a| a.instances.is_moving() || a.instances.parts.iter().any(|p| deforms(&p.shape)))
    }

    /// Where the object `index` is at a time, and its shape.
    pub fn placed(&self, index: u32, time: f64) -> (&Shape, DAffine3) {
        match self.numbering.locate(index) {
            Location::Single(i) => {
                let object = &self.singles[i];
                (&object.shape, object.world_from_object.at(time))
            }
            Location::InArray { array, place, part } => {
                let instances = &self.arrays[array].instances;
                (&instances.parts[part].shape, instances.world_from_object(place, part, time))
            }
        }
    }

    /// The constant primvar with a number of the object `index`.
    pub fn primvar(&self, index: u32, number: usize) -> Option<[f32; 4]> {
        let primvars = match self.numbering.locate(index) {
            Location::Single(i) => &self.singles[i].primvars,
            Location::InArray { array, part, .. } => &self.arrays[array].parts[part].primvars,
        };
        *primvars.as_ref()?.get(number)?
    }

    /// Where the object `index` is among the single ones and the arrays.
    pub(super) fn location(&self, index: u32) -> Location {
        self.numbering.locate(index)
    }

    /// The identifiers of the object `index`.
    pub fn ids(&self, index: u32) -> ObjectIds<'_> {
        match self.numbering.locate(index) {
            Location::Single(i) => {
                let Object { prim_id, instance_id, ref material_ids, appearance, .. } = self.singles[i];
                ObjectIds { prim_id, instance_id, material_ids, appearance }
            }
            Location::InArray { array, place, part } => {
                let array = &self.arrays[array];
                let element = array.indices.as_ref().map_or(place as u32, |indices| indices[place] as u32);
                let PartIds { prim_id, ref material_ids, appearance, .. } = array.parts[part];
                ObjectIds { prim_id, instance_id: array.first_id + element, material_ids, appearance }
            }
        }
    }

    /// The materials of the object `index`, one a slot: what rays ask of every surface that they meet.
    #[inline]
    pub fn material_ids(&self, index: u32) -> &[u32] {
        match self.singles.get(index as usize) {
            Some(object) => &object.material_ids,
            None => self.ids(index).material_ids,
        }
    }

    /// Every combination of shape and identifiers once: (shape, prim_id, materials).
    pub fn kinds(&self) -> impl Iterator<Item = (&Shape, u32, &[u32])> {
        let singles = self.singles.iter().map(|o| (&*o.shape, o.prim_id, &*o.material_ids));
        let parts = self.arrays.iter().flat_map(|a| {
            let ids = a.instances.parts.iter().zip(&*a.parts);
            ids.map(|(part, ids)| (&*part.shape, ids.prim_id, &*ids.material_ids))
        });
        singles.chain(parts)
    }
}
