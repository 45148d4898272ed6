//! From description to scene: the only way to make a [`Scene`], and the place where everything is checked.
//!
//! Groups are unrolled (prototypes stay shared), shapes and materials that nothing uses are not built, and every index,
//! array, transform and number is looked at before it is used.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DMat4};
use rayon::prelude::*;

use super::description::{self, Array, Description, Document, Element, Group, Placement, Target};
use super::material::{self, Context, Material, ScalarIor};
use super::solids;
use super::{Counts, Object, Scene};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::geometry::{Buffer, Interpolation, Mesh, MeshReport, PolygonMesh, PrimvarView, Shape, Sphere};

/// More objects than this cannot be addressed; nested groups reach it quickly, so they are counted before they are unrolled.
const MAX_OBJECTS: u64 = 1 << 31;

/// Checks and compiles `description`.
pub fn build(description: Description) -> Result<Scene> {
    let document = &description.document;
    let mut diagnostics = document.warnings.clone();
    check_stage(document)?;
    check_groups(document)?;
    let placed = unroll(document, &mut diagnostics)?;

    let mut used = vec![false; document.shapes.len()];
    placed.iter().for_each(|p| used[p.shape] = true);
    let shapes = build_shapes(&description, &used, &mut diagnostics)?;
    let (materials, material_ids) = build_materials(document, &placed, &mut diagnostics)?;

    let mut prims = Manifest::default();
    let mut instances = Manifest::default();
    let mut slots = HashMap::<Vec<u32>, Arc<[u32]>>::new();
    let mut objects = Vec::with_capacity(placed.len());
    let mut triangles = 0;
    let mut seen = vec![false; shapes.len()];
    for Placed { shape, transform, placement, instance } in placed {
        let prim_id = prims.id(&placement.path);
        let instance_id = instance.map_or(0, |path| instances.id(path));
        let Some((compiled, report)) = &shapes[shape] else { continue };
        let material_of = |index: Option<usize>| index.map_or(0, |i| material_ids[i]);
        let mut list = vec![material_of(placement.material)];
        list.extend(placement.subset_materials.iter().map(|m| material_of(m.or(placement.material))));
        list.resize(1 + report.subsets, list[0]);
        if !report.is_closed && list.iter().any(|&id| id > 0 && materials[id as usize - 1].has_interior()) {
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
        if !std::mem::replace(&mut seen[shape], true) {
            triangles += report.triangles;
        }
        let material_ids = slots.entry(list).or_insert_with_key(|list| list.as_slice().into()).clone();
        objects.push(Object {
            shape: Arc::clone(compiled),
            world_from_object: transform,
            prim_id,
            instance_id,
            material_ids,
        });
    }
    let counts = Counts {
        shapes: seen.iter().filter(|&&s| s).count() as u64,
        triangles,
        objects: objects.len() as u64,
        materials: materials.len() as u64,
    };
    let skipped = document.skipped.clone();
    Ok(Scene {
        objects,
        materials,
        prims: prims.paths,
        instances: instances.paths,
        skipped,
        counts,
        diagnostics,
        description,
    })
}

/// Paths in the order of first use; ids start at 1.
#[derive(Default)]
struct Manifest {
    paths: Vec<String>,
    ids: HashMap<String, u32>,
}

impl Manifest {
    fn id(&mut self, path: &str) -> u32 {
        if let Some(&id) = self.ids.get(path) {
            return id;
        }
        self.paths.push(path.to_owned());
        let id = self.paths.len() as u32;
        self.ids.insert(path.to_owned(), id);
        id
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

/// Every index of every group is in range, no group contains itself, and the whole is small enough to unroll.
fn check_groups(document: &Document) -> Result<()> {
    let in_range = |index: usize, length: usize, place: &str, what: &str| {
        if index < length {
            return Ok(());
        }
        Err(Error::scene(
            place,
            format!("refers to {what} {index} of {length}: the scene file is damaged, export it again"),
        ))
    };
    in_range(document.root, document.groups.len(), &document.stage.source, "group")?;
    for group in &document.groups {
        for item in &group.items {
            match item.target {
                Target::Shape(i) => in_range(i, document.shapes.len(), &item.path, "shape")?,
                Target::Group(i) => in_range(i, document.groups.len(), &item.path, "group")?,
            }
            for material in item.material.iter().chain(item.subset_materials.iter().flatten()) {
                in_range(*material, document.materials.len(), &item.path, "material")?;
            }
        }
    }
    // Depth first with an explicit stack: a hostile file may nest deeper than the thread's own.
    #[derive(Clone, Copy)]
    enum State {
        New,
        Open,
        Counted(u64),
    }
    let mut states = vec![State::New; document.groups.len()];
    let mut stack = vec![(document.root, 0)];
    states[document.root] = State::Open;
    while let Some((group, next)) = stack.pop() {
        let items = &document.groups[group].items;
        if let Some(item) = items.get(next) {
            stack.push((group, next + 1));
            if let Target::Group(child) = item.target {
                match states[child] {
                    State::New => {
                        states[child] = State::Open;
                        stack.push((child, 0));
                    }
                    State::Open => {
                        return Err(Error::scene(
                            &item.path,
                            format!("instances {}, which contains it: break the cycle", document.groups[child].path),
                        ));
                    }
                    State::Counted(_) => {}
                }
            }
        } else {
            let count = items.iter().fold(0u64, |sum, item| {
                sum.saturating_add(match item.target {
                    Target::Shape(_) => 1,
                    Target::Group(child) => match states[child] {
                        State::Counted(n) => n,
                        State::New | State::Open => 0,
                    },
                })
            });
            if count > MAX_OBJECTS {
                return Err(Error::scene(
                    &document.groups[group].path,
                    format!("its instances unroll to more than {MAX_OBJECTS} objects: load a part of the stage"),
                ));
            }
            states[group] = State::Counted(count);
        }
    }
    Ok(())
}

struct Placed<'a> {
    shape: usize,
    transform: DAffine3,
    placement: &'a Placement,
    instance: Option<&'a str>,
}

/// Unrolls the groups into placed shapes, in the order of the description.
fn unroll<'a>(document: &'a Document, diagnostics: &mut Diagnostics) -> Result<Vec<Placed<'a>>> {
    struct Frame<'a> {
        group: &'a Group,
        next: usize,
        transform: DAffine3,
        instance: Option<&'a str>,
    }
    let mut placed = Vec::new();
    let mut stack =
        vec![Frame { group: &document.groups[document.root], next: 0, transform: DAffine3::IDENTITY, instance: None }];
    while let Some(mut frame) = stack.pop() {
        let Some(item) = frame.group.items.get(frame.next) else { continue };
        frame.next += 1;
        let local = item.transform.map_or(Ok(DAffine3::IDENTITY), |m| affine(&m, &item.path))?;
        let transform = frame.transform * local;
        let instance = item.instance.as_deref().or(frame.instance);
        stack.push(frame);
        match item.target {
            Target::Group(child) => {
                stack.push(Frame { group: &document.groups[child], next: 0, transform, instance });
            }
            Target::Shape(shape) => {
                if !is_invertible(&transform) {
                    diagnostics.warn(
                        "singular-transform",
                        &item.path,
                        "its transform flattens it to nothing: it is left out",
                    );
                    continue;
                }
                placed.push(Placed { shape, transform, placement: item, instance });
            }
        }
    }
    Ok(placed)
}

/// USD's row-vector matrix as an affine map of column vectors.
fn affine(matrix: &[f64; 16], place: &str) -> Result<DAffine3> {
    if matrix.iter().any(|v| !v.is_finite()) {
        return Err(Error::scene(place, "its transform has a value that is not finite"));
    }
    if [matrix[3], matrix[7], matrix[11], matrix[15] - 1.0].iter().any(|&v| v != 0.0) {
        return Err(Error::scene(place, "its transform is projective: only affine transforms place geometry"));
    }
    Ok(DAffine3::from_mat4(DMat4::from_cols_array(matrix)))
}

/// Whether the inverse exists to working precision: the volume is compared with that of the columns' box, so scale is free.
fn is_invertible(transform: &DAffine3) -> bool {
    let m = transform.matrix3;
    let box_volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let inverse = transform.inverse();
    m.determinant().abs() > 1e-14 * box_volume && inverse.is_finite()
}

type Compiled = (Arc<Shape>, ShapeReport);

/// What the scene needs to know of a compiled shape.
struct ShapeReport {
    is_closed: bool,
    open_edges: u64,
    triangles: u64,
    subsets: usize,
}

fn build_shapes(
    description: &Description,
    used: &[bool],
    diagnostics: &mut Diagnostics,
) -> Result<Vec<Option<Compiled>>> {
    let built: Vec<_> = description
        .document
        .shapes
        .par_iter()
        .zip(used)
        .map(|(shape, &used)| if used { build_shape(description, shape).map(Some) } else { Ok(None) })
        .collect();
    let mut shapes = Vec::with_capacity(built.len());
    for (shape, result) in description.document.shapes.iter().zip(built) {
        let Some((compiled, report)) = result? else {
            shapes.push(None);
            continue;
        };
        let Some(compiled) = compiled else {
            diagnostics.warn("empty-shape", shape.path(), "a size is 0, so that nothing of it is seen: it is left out");
            shapes.push(None);
            continue;
        };
        if let (description::Shape::Mesh(mesh), Some(report)) = (shape, &report) {
            report_mesh(mesh, report, diagnostics);
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
    Ok(shapes)
}

fn report_mesh(mesh: &description::Mesh, report: &MeshReport, diagnostics: &mut Diagnostics) {
    if report.degenerate > 0 {
        diagnostics.warn(
            "degenerate-faces",
            &mesh.path,
            format!("{} triangles without area are left out", report.degenerate),
        );
    }
    if report.triangles == 0 {
        diagnostics.warn("empty-mesh", &mesh.path, "it has no face with an area: nothing of it is seen");
    }
}

/// The shape, `None` if there is nothing of it; meshes with their report.
fn build_shape(
    description: &Description,
    shape: &description::Shape,
) -> Result<(Option<Arc<Shape>>, Option<MeshReport>)> {
    match shape {
        description::Shape::Sphere { path, radius } => {
            let sphere = Sphere::new(*radius).ok_or_else(|| {
                Error::scene(format!("{path}.radius"), format!("is {radius}: it must be positive and finite"))
            })?;
            Ok((Some(Arc::new(Shape::Sphere(sphere))), None))
        }
        description::Shape::Mesh(mesh) => {
            let arrays = MeshArrays { description, mesh };
            let hole_indices = mesh.hole_indices.as_deref().map(|name| arrays.integers(name)).transpose()?;
            let counts = arrays.integers(&mesh.face_vertex_counts)?;
            let indices = arrays.integers(&mesh.face_vertex_indices)?;
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
                subsets: &subsets,
            };
            let (compiled, report) = Mesh::from_polygons(&polygons)?;
            Ok((Some(Arc::new(Shape::Mesh(compiled))), Some(report)))
        }
        solid => Ok((solids::compile(solid)?.map(|solid| Arc::new(Shape::Solid(solid))), None)),
    }
}

/// Typed access to the arrays of one mesh.
struct MeshArrays<'a> {
    description: &'a Description,
    mesh: &'a description::Mesh,
}

impl<'a> MeshArrays<'a> {
    fn get(&self, name: &str, element: Element, columns: usize) -> Result<&'a Array> {
        let place = &self.mesh.path;
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
    fn buffer<T: bytemuck::Pod>(&self, name: &str, columns: usize) -> Result<Buffer<T>> {
        let array = self.get(name, Element::F32, columns)?;
        Buffer::new(array.bytes.clone())
            .map_err(|problem| Error::scene(&self.mesh.path, format!("array '{name}': {problem}")))
    }

    fn integers(&self, name: &str) -> Result<&'a [i32]> {
        let array = self.get(name, Element::I32, 1)?;
        bytemuck::try_cast_slice(&array.bytes).map_err(|_| {
            Error::scene(
                &self.mesh.path,
                format!("array '{name}' is not aligned to its elements: write the file again"),
            )
        })
    }

    fn primvar(&self, primvar: &'a description::Primvar, columns: usize) -> Result<PrimvarView<'a>> {
        Ok(PrimvarView {
            values: self.buffer(&primvar.values, columns)?,
            indices: primvar.indices.as_deref().map(|name| self.integers(name)).transpose()?,
            interpolation: Interpolation::from_token(&primvar.interpolation).ok_or_else(|| {
                Error::scene(
                    &self.mesh.path,
                    format!("unknown interpolation '{}': use vertex or faceVarying", primvar.interpolation),
                )
            })?,
        })
    }
}

/// Compiles the materials that something placed uses; returns them with the id of each of the document's materials.
fn build_materials(
    document: &Document,
    placed: &[Placed<'_>],
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
            materials.push(material::compile(authored, &context, diagnostics)?);
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
