//! From description to scene: the only way to make a [`Scene`], and the place where everything is checked.
//!
//! Groups are unrolled (prototypes stay shared), shapes and materials that nothing uses are not built, and every index,
//! array, transform and number is looked at before it is used.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use rayon::prelude::*;

use super::description::{self, Array, Description, Document, Element, Placement};
use super::lights;
use super::links::{self, Links};
use super::manifest::Manifest;
use super::material::{self, Context, Material, Resources, ScalarIor};
use super::meshes;
use super::objects::{Appearance, ConstantPrimvars, Object, ObjectArray, Objects, PartIds};
use super::solids;
use super::unroll::{self, Placed, Unrolled};
use super::{Counts, Scene};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::geometry::{
    Buffer, Deformation, InstanceArray, Interpolation, Mesh, MeshReport, NamedPrimvar, Part, PolygonMesh, PrimvarView,
    Shape, Sphere, are_increasing,
};

/// Checks and compiles `description`.
pub fn build(description: Description) -> Result<Scene> {
    let document = &description.document;
    let mut diagnostics = document.warnings.clone();
    check_stage(document)?;
    unroll::check_groups(&description)?;
    links::check(&description)?;
    lights::check(&description, &mut diagnostics)?;
    let Unrolled { singles, prototypes, arrays, mut instances } = unroll::unroll(&description, &mut diagnostics)?;

    let placed = || singles.iter().chain(prototypes.iter().flatten());
    let mut used = vec![false; document.shapes.len()];
    placed().for_each(|p| used[p.shape] = true);
    let mut resources = Resources::new(&description);
    let (materials, material_ids) = build_materials(document, placed(), &mut resources, &mut diagnostics)?;
    let display_color = material::display_color(&mut resources);
    let display_surface = material::display_surface(&mut resources);
    let Resources { store: textures, primvars, .. } = resources;
    let mut has_interior = vec![false; document.shapes.len()];
    placed().for_each(|p| has_interior[p.shape] |= is_medium(p.placement, &materials, &material_ids));
    let wanted: Vec<_> =
        used.iter().zip(&has_interior).map(|(&used, &asks_closed)| used.then_some(asks_closed)).collect();
    let (shapes, tree_time) = build_shapes(&description, &wanted, &primvars, &mut diagnostics)?;

    let mut compiler = Compiler {
        shapes: &shapes,
        materials: &materials,
        material_ids: &material_ids,
        prims: Manifest::default(),
        slots: HashMap::new(),
        seen: vec![false; shapes.len()],
        triangles: 0,
    };
    let mut links = Links::new(&description);
    let mut objects = Vec::with_capacity(singles.len());
    for single in &singles {
        let Some((shape, PartIds { prim_id, material_ids, appearance, .. })) =
            compiler.part(single, &mut diagnostics)?
        else {
            continue;
        };
        let instance_id = match single.instance {
            None => 0,
            Some(path) => instances.id(path, 1).ok_or_else(|| too_many(path))?,
        };
        let primvars = constants(single.placement, &primvars)?;
        let world_from_object = single.transform.clone();
        links.push(single.placement);
        objects.push(Object { shape, world_from_object, prim_id, instance_id, material_ids, primvars, appearance });
    }
    let prototypes = prototypes
        .iter()
        .map(|placed| {
            let (mut parts, mut ids, mut placements) = (Vec::new(), Vec::new(), Vec::new());
            for part in placed {
                let Some((shape, part_ids)) = compiler.part(part, &mut diagnostics)? else { continue };
                let part_ids = PartIds { primvars: constants(part.placement, &primvars)?, ..part_ids };
                parts.push(Part { shape, place_from_object: part.transform.clone() });
                ids.push(part_ids);
                placements.push(part.placement);
            }
            Ok((Arc::<[Part]>::from(parts), Arc::<[PartIds]>::from(ids), placements))
        })
        .collect::<Result<Vec<_>>>()?;
    let arrays = arrays.into_iter().filter_map(|array| {
        let (parts, ids, placements) = &prototypes[array.prototype];
        let instances = InstanceArray {
            parts: Arc::clone(parts),
            places: array.places,
            motion: array.motion,
            world_from_array: array.transform,
        };
        let parts = Arc::clone(ids);
        let placed = ObjectArray { instances, parts, first_id: array.first_id, indices: array.indices };
        let has_places = !placed.instances.is_empty();
        if has_places {
            links.push_array(placements.iter().copied(), array.link_sets);
        }
        has_places.then_some(placed)
    });
    let objects = Objects::new(objects, arrays.collect());
    let Compiler { prims, seen, triangles, .. } = compiler;
    let counts = Counts {
        shapes: seen.iter().filter(|&&s| s).count() as u64,
        triangles,
        objects: u64::from(objects.len()),
        materials: materials.len() as u64,
    };
    let skipped = document.skipped.clone();
    let textures = Arc::new(textures);
    Ok(Scene {
        objects,
        links,
        materials,
        textures,
        display_color,
        display_surface,
        prims,
        instances,
        skipped,
        counts,
        tree_seconds: tree_time.as_secs_f64(),
        diagnostics,
        description,
    })
}

fn too_many(path: &str) -> Error {
    Error::scene(path, "is one too many: no more than 2^32 prims or instances can be told apart")
}

/// The constant primvars of a placement by the numbers of `names`; `None` if it has none of them.
fn constants(placement: &Placement, names: &[String]) -> Result<Option<ConstantPrimvars>> {
    let value = |name: &String| {
        let Some(numbers) = placement.primvars.get(name) else { return Ok(None) };
        if numbers.is_empty() || numbers.len() > 4 || numbers.iter().any(|number| !number.is_finite()) {
            let problem = format!("is {numbers:?}: one to four finite numbers are needed");
            return Err(Error::scene(format!("{}.primvars:{name}", placement.path), problem));
        }
        let mut value = [0.0; 4];
        value.iter_mut().zip(numbers).for_each(|(to, from)| *to = *from as f32);
        Ok(Some(value))
    };
    if placement.primvars.is_empty() {
        return Ok(None);
    }
    let values = names.iter().map(value).collect::<Result<Vec<_>>>()?;
    Ok(values.iter().any(Option::is_some).then(|| values.into()))
}

/// Gives placed shapes their compiled shape and their identifiers.
struct Compiler<'a> {
    shapes: &'a [Option<Compiled>],
    materials: &'a [Material],
    /// Identifier of each of the document's materials.
    material_ids: &'a [u32],
    prims: Manifest,
    /// Lists of materials, shared between equal ones.
    slots: HashMap<Vec<u32>, Arc<[u32]>>,
    seen: Vec<bool>,
    triangles: u64,
}

impl Compiler<'_> {
    fn part(&mut self, placed: &Placed<'_>, diagnostics: &mut Diagnostics) -> Result<Option<(Arc<Shape>, PartIds)>> {
        let &Placed { shape, placement, .. } = placed;
        let prim_id = self.prims.id(&placement.path, 1).ok_or_else(|| too_many(&placement.path))?;
        let Some((compiled, report)) = &self.shapes[shape] else { return Ok(None) };
        let material_of = |index: Option<usize>| index.map_or(0, |i| self.material_ids[i]);
        let mut list = vec![material_of(placement.material)];
        list.extend(placement.subset_materials.iter().map(|m| material_of(m.or(placement.material))));
        list.resize(1 + report.subsets, list[0]);
        if !report.is_closed && list.iter().any(|&id| id > 0 && self.materials[id as usize - 1].is_glass_all_over()) {
            diagnostics.warn(
                "open-glass-mesh",
                &placement.path,
                format!(
                    "a glass surface is not closed ({} open edges), so inside and outside are uncertain: close the mesh, or \
                     make the material thin-walled",
                    report.open_edges
                ),
            );
        }
        if !std::mem::replace(&mut self.seen[shape], true) {
            self.triangles += report.triangles;
        }
        let material_ids = self.slots.entry(list).or_insert_with_key(|list| list.as_slice().into()).clone();
        let &Placement { hidden_from_camera, matte, .. } = placement;
        let appearance = Appearance { hidden_from_camera, matte };
        Ok(Some((Arc::clone(compiled), PartIds { prim_id, material_ids, primvars: None, appearance })))
    }
}

fn check_stage(document: &Document) -> Result<()> {
    let stage = &document.stage;
    if !(stage.meters_per_unit > 0.0 && stage.meters_per_unit.is_finite()) {
        return Err(Error::scene(
            &stage.source,
            format!("metersPerUnit is {}: it must be positive", stage.meters_per_unit),
        ));
    }
    if !matches!(stage.up_axis.as_str(), "Y" | "Z") {
        return Err(Error::scene(&stage.source, format!("upAxis is '{}': it must be Y or Z", stage.up_axis)));
    }
    Ok(())
}

type Compiled = (Arc<Shape>, ShapeReport);

/// What the scene needs to know of a compiled shape.
struct ShapeReport {
    is_closed: bool,
    open_edges: u64,
    triangles: u64,
    subsets: usize,
}

/// Whether a material of a placement fills a volume, so that it matters whether the surface has an inside.
fn is_medium(placement: &Placement, materials: &[Material], material_ids: &[u32]) -> bool {
    let has_interior = |&index: &usize| {
        let id = material_ids[index] as usize;
        id > 0 && materials[id - 1].has_interior()
    };
    placement.material.iter().chain(placement.subset_materials.iter().flatten()).any(has_interior)
}

/// Compiles the shapes that are wanted, which says whether it is asked if they are closed. The time is that of their trees.
fn build_shapes(
    description: &Description,
    wanted: &[Option<bool>],
    names: &[String],
    diagnostics: &mut Diagnostics,
) -> Result<(Vec<Option<Compiled>>, Duration)> {
    let built: Vec<_> = description
        .document
        .shapes
        .par_iter()
        .zip(wanted)
        .map(|(shape, wanted)| wanted.map(|asks| build_shape(description, shape, names, asks)).transpose())
        .collect();
    let mut tree_time = Duration::ZERO;
    let mut shapes = Vec::with_capacity(built.len());
    for (shape, result) in description.document.shapes.iter().zip(built) {
        let Some(built) = result? else {
            shapes.push(None);
            continue;
        };
        let (compiled, report) = match built {
            Built::Shape(compiled, report) => (compiled, report),
            Built::Nothing => {
                let problem = "a size is 0, so that nothing of it is seen: it is left out";
                diagnostics.warn("empty-shape", shape.path(), problem);
                shapes.push(None);
                continue;
            }
            Built::Broken { place, problem } => {
                diagnostics.warn("broken-shape", place, format!("{problem}; the shape is left out"));
                shapes.push(None);
                continue;
            }
        };
        if let (description::Shape::Mesh(mesh), Some(report)) = (shape, &report) {
            meshes::report(mesh, report, diagnostics);
            tree_time += report.tree_time;
        }
        let report = match report {
            None => {
                let is_closed = !matches!(&*compiled, Shape::Solid(solid) if !solid.is_closed());
                ShapeReport { is_closed, open_edges: if is_closed { 0 } else { 4 }, triangles: 0, subsets: 0 }
            }
            Some(report) => ShapeReport {
                is_closed: report.is_closed,
                open_edges: report.open_edges as u64,
                triangles: report.triangles as u64,
                subsets: match shape {
                    description::Shape::Mesh(mesh) => mesh.subsets.len(),
                    _ => 0,
                },
            },
        };
        shapes.push(Some((compiled, report)));
    }
    Ok((shapes, tree_time))
}

/// What became of a shape.
enum Built {
    /// Meshes have a report.
    Shape(Arc<Shape>, Option<MeshReport>),
    /// A size is 0.
    Nothing,
    /// What the stage says of it is no shape. It is left out, and the rest of the picture kept.
    Broken { place: String, problem: String },
}

/// Compiles a shape. What the stage got wrong is no error but [`Built::Broken`]; arrays that the document names and the
/// description lacks are damage to the description itself, and an error.
fn build_shape(
    description: &Description,
    shape: &description::Shape,
    names: &[String],
    asks_closed: bool,
) -> Result<Built> {
    match compile_shape(description, shape, names, asks_closed)? {
        Ok(built) => Ok(built),
        Err(Error::Scene { place, problem }) => Ok(Built::Broken { place, problem }),
        Err(other) => Err(other),
    }
}

/// The outer error is the description's, the inner the stage's.
fn compile_shape(
    description: &Description,
    shape: &description::Shape,
    names: &[String],
    asks_closed: bool,
) -> Result<Result<Built>> {
    let solid = |shape: Option<Shape>| shape.map_or(Built::Nothing, |shape| Built::Shape(Arc::new(shape), None));
    match shape {
        description::Shape::Sphere { radius: 0.0, .. } => Ok(Ok(Built::Nothing)),
        description::Shape::Sphere { path, radius } => {
            Ok(Sphere::new(*radius).map(|sphere| solid(Some(Shape::Sphere(sphere)))).ok_or_else(|| {
                Error::scene(format!("{path}.radius"), format!("is {radius}: it must be positive and finite"))
            }))
        }
        description::Shape::Mesh(mesh) => {
            let arrays = NamedArrays { description, place: &mesh.path };
            let hole_indices = mesh.hole_indices.as_deref().map(|name| arrays.integers(name)).transpose()?;
            let counts = arrays.integers(&mesh.face_vertex_counts)?;
            let indices = arrays.indices(&mesh.face_vertex_indices)?;
            let subsets = mesh
                .subsets
                .iter()
                .map(|s| Ok((s.path.as_str(), arrays.integers(&s.faces)?)))
                .collect::<Result<Vec<_>>>()?;
            let polygons = PolygonMesh {
                path: &mesh.path,
                points: arrays.buffer(&mesh.points, 3)?,
                counts,
                indices,
                holes: hole_indices.unwrap_or(&[]),
                left_handed: mesh.left_handed,
                normals: mesh.normals.as_ref().map(|p| arrays.primvar(p, 3)).transpose()?,
                uv: mesh.uv.as_ref().map(|p| arrays.primvar(p, 2)).transpose()?,
                uv_number: names.iter().position(|name| mesh.uv_name.as_ref() == Some(name)),
                primvars: names.iter().map(|name| arrays.named_primvar(mesh, name)).collect::<Result<_>>()?,
                subsets: &subsets,
                subdivision: meshes::subdivision(&arrays, mesh, counts)?,
            };
            let normals = polygons.normals.as_ref().map(|normals| normals.values.len());
            let deformation = match &mesh.motion {
                Some(motion) => match arrays.deformation(motion, polygons.points.len(), normals)? {
                    Ok(deformation) => Some(deformation),
                    Err(problem) => return Ok(Err(problem)),
                },
                None => None,
            };
            let mesh = Mesh::deforming(&polygons, deformation, asks_closed);
            Ok(mesh.map(|(mesh, report)| Built::Shape(Arc::new(Shape::Mesh(mesh)), Some(report))))
        }
        other => Ok(solids::compile(other).map(|compiled| solid(compiled.map(Shape::Solid)))),
    }
}

/// Typed access to the arrays of one prim.
pub(super) struct NamedArrays<'a> {
    pub(super) description: &'a Description,
    /// Path of the prim.
    pub(super) place: &'a str,
}

impl<'a> NamedArrays<'a> {
    fn get(&self, name: &str, element: Element, columns: usize) -> Result<&'a Array> {
        let place = self.place;
        let array = self
            .description
            .arrays
            .get(name)
            .ok_or_else(|| Error::scene(place, format!("its array '{name}' is missing: export the stage again")))?;
        let expected =
            if columns == 1 { array.shape.len() == 1 } else { array.shape.len() == 2 && array.shape[1] == columns };
        let elements = array.shape.iter().try_fold(1usize, |n, &k| n.checked_mul(k));
        if array.element != element
            || !expected
            || elements.map(|n| n.saturating_mul(element.size())) != Some(array.bytes.len())
        {
            return Err(Error::scene(
                place,
                format!(
                    "array '{name}' is {:?} of shape {:?}: {element:?} with {columns} columns is needed",
                    array.element, array.shape
                ),
            ));
        }
        Ok(array)
    }

    /// Shares the memory of a float array.
    pub(super) fn buffer<T: bytemuck::Pod>(&self, name: &str, columns: usize) -> Result<Buffer<T>> {
        self.share(name, Element::F32, columns)
    }

    /// Shares the memory of an array of doubles.
    pub(super) fn doubles<T: bytemuck::Pod>(&self, name: &str, columns: usize) -> Result<Buffer<T>> {
        self.share(name, Element::F64, columns)
    }

    /// What is in an array of bytes.
    pub(super) fn bytes(&self, name: &str) -> Result<&'a [u8]> {
        Ok(&self.get(name, Element::U8, 1)?.bytes)
    }

    /// Shares the memory of an array of integers.
    pub(super) fn indices(&self, name: &str) -> Result<Buffer<i32>> {
        self.share(name, Element::I32, 1)
    }

    fn share<T: bytemuck::Pod>(&self, name: &str, element: Element, columns: usize) -> Result<Buffer<T>> {
        let array = self.get(name, element, columns)?;
        Buffer::new(array.bytes.clone())
            .map_err(|problem| Error::scene(self.place, format!("array '{name}': {problem}")))
    }

    /// Points and normals at other times: of a mesh with so many points, and floats in its normals. What is only broken (not
    /// what is missing from the file) is the inner error.
    fn deformation(
        &self,
        motion: &description::MeshMotion,
        points: usize,
        normals: Option<usize>,
    ) -> Result<Result<Deformation>> {
        let description::MeshMotion { times, points: names, normals: normal_names } = motion;
        let broken = |problem: &str| Ok(Err(Error::scene(self.place, problem)));
        if !are_increasing(times) || times.len() > unroll::MAX_TIMES {
            return broken("the times of its motion do not increase");
        }
        if names.len() != times.len() || ![0, times.len()].contains(&normal_names.len()) {
            return broken("its motion needs points, and normals if any, for each of its times");
        }
        let moved: Vec<Buffer<[f32; 3]>> = names.iter().map(|name| self.buffer(name, 3)).collect::<Result<_>>()?;
        if moved.iter().any(|moved| moved.len() != points) {
            return broken("its motion has another number of points at another time");
        }
        if moved.par_iter().any(|moved| moved.iter().flatten().any(|v| !v.is_finite())) {
            return broken("its motion has a point that is not finite");
        }
        let turned: Vec<Buffer<f32>> = normal_names.iter().map(|name| self.buffer(name, 3)).collect::<Result<_>>()?;
        if turned.iter().any(|turned| Some(turned.len()) != normals) {
            return broken("its motion has another number of normals at another time");
        }
        let normals = (!turned.is_empty()).then_some(turned);
        Ok(Ok(Deformation { times: times.clone(), points: moved, normals }))
    }

    pub(super) fn integers(&self, name: &str) -> Result<&'a [i32]> {
        let array = self.get(name, Element::I32, 1)?;
        // An empty array may begin anywhere.
        if array.bytes.is_empty() {
            return Ok(&[]);
        }
        bytemuck::try_cast_slice(&array.bytes).map_err(|_| {
            Error::scene(self.place, format!("array '{name}' is not aligned to its elements: write the file again"))
        })
    }

    /// The primvar `name` of a mesh, if it has it.
    fn named_primvar(&self, mesh: &'a description::Mesh, name: &str) -> Result<Option<NamedPrimvar<'a>>> {
        let Some((name, primvar)) = mesh.primvars.get_key_value(name) else { return Ok(None) };
        let shape = self.description.arrays.get(&primvar.values).map_or(&[][..], |array| &array.shape);
        let columns = if let [_, columns] = *shape { columns } else { 1 };
        if !(1..=4).contains(&columns) {
            let problem = format!("has {columns} numbers in a value: what materials look up has 1 to 4");
            return Err(Error::scene(format!("{}.primvars:{name}", self.place), problem));
        }
        Ok(Some(NamedPrimvar { name, columns, view: self.primvar(primvar, columns)? }))
    }

    fn primvar(&self, primvar: &'a description::Primvar, columns: usize) -> Result<PrimvarView<'a>> {
        Ok(PrimvarView {
            values: self.buffer(&primvar.values, columns)?,
            indices: primvar.indices.as_deref().map(|name| self.integers(name)).transpose()?,
            interpolation: Interpolation::from_token(&primvar.interpolation).ok_or_else(|| {
                Error::scene(
                    self.place,
                    format!("unknown interpolation '{}': use vertex or faceVarying", primvar.interpolation),
                )
            })?,
        })
    }
}

/// Compiles the materials that something placed uses; returns them with the id of each of the document's materials.
fn build_materials<'a>(
    document: &Document,
    placed: impl Iterator<Item = &'a Placed<'a>>,
    resources: &mut Resources<'_>,
    diagnostics: &mut Diagnostics,
) -> Result<(Vec<Material>, Vec<u32>)> {
    let mut used = vec![false; document.materials.len()];
    for placed in placed {
        let placement = placed.placement;
        for &material in placement.material.iter().chain(placement.subset_materials.iter().flatten()) {
            used[material] = true;
        }
    }
    let mut materials = Vec::new();
    let mut ids = vec![0; document.materials.len()];
    let context = Context { scalar_ior: scalar_ior(document)?, meters_per_unit: document.stage.meters_per_unit };
    for (i, authored) in document.materials.iter().enumerate() {
        if used[i] {
            materials.push(material::compile(authored, &context, resources, diagnostics)?);
            ids[i] = materials.len() as u32;
        }
    }
    Ok((materials, ids))
}

/// `abbe:scalarIor` of the render settings.
fn scalar_ior(document: &Document) -> Result<ScalarIor> {
    const NAME: &str = "abbe:scalarIor";
    let Some(authored) = document.settings.abbe.get(NAME) else { return Ok(ScalarIor::default()) };
    let place = format!("render settings, {NAME}");
    match authored.value.as_str() {
        Some(text) => ScalarIor::parse(text, &place),
        None => Err(Error::usage(place, format!("is {}: use constant or nearestGlass", authored.value))),
    }
}
