//! Groups unrolled: which shapes stand where, counted before anything is placed.
//!
//! A group that is placed by itself becomes single objects. One placed by an array of transforms becomes an array of
//! objects that shares the transforms. An array within what another places becomes one array for each place of the outer
//! one: memory goes with the outer number, while the inner transforms stay shared.

use std::collections::HashMap;

use glam::{DAffine3, DMat4};
use rayon::prelude::*;

use super::builder::NamedArrays;
use super::description::{Description, Document, Instances, InstancesMotion, Motion, Placement, Target};
use super::manifest::{self, Manifest};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::geometry::{Buffer, PlaceSamples, Pose, Track, affine, are_increasing, is_invertible};

/// More objects than this are refused. One that an array places takes about 150 bytes, and 400 while the tree is built, its
/// transform included (`benches/instances.py`): these take 10 GB, and 27 for a while.
const MAX_OBJECTS: u64 = 1 << 26;

/// Samples of one motion; more are no motion but damage.
pub(crate) const MAX_TIMES: usize = 1024;
/// Samples of motion within motion.
const MAX_NESTED_TIMES: usize = 4 * MAX_TIMES;
/// Transforms that all single placements have as samples: 1.6 GB of them.
const MAX_SAMPLES: usize = 1 << 24;

/// A shape placed by itself.
pub(super) struct Placed<'a> {
    pub(super) shape: usize,
    /// The world, or the prototype, from object space.
    pub(super) transform: Pose,
    pub(super) placement: &'a Placement,
    pub(super) instance: Option<&'a str>,
}

/// A prototype placed by an array.
pub(super) struct PlacedArray<'a> {
    /// Index into [`Unrolled::prototypes`].
    pub(super) prototype: usize,
    pub(super) places: Buffer<[f64; 12]>,
    pub(super) motion: Option<PlaceSamples>,
    /// The world from the array's space.
    pub(super) transform: Pose,
    /// `instance_id` of the instancer's element 0, and which element stands at each place.
    pub(super) first_id: u32,
    pub(super) indices: Option<Buffer<i32>>,
    /// Link sets of all parts, in place of their own.
    pub(super) link_sets: Option<&'a [usize]>,
}

/// Everything placed.
pub(super) struct Unrolled<'a> {
    pub(super) singles: Vec<Placed<'a>>,
    /// What the arrays place.
    pub(super) prototypes: Vec<Vec<Placed<'a>>>,
    pub(super) arrays: Vec<PlacedArray<'a>>,
    /// Names of the arrays' elements.
    pub(super) instances: Manifest,
}

/// Which array of which group.
type Key = (usize, usize);

/// An array within a group that is unrolled.
#[derive(Clone)]
struct Nested<'a> {
    key: Key,
    instances: &'a Instances,
    transform: Pose,
}

/// An array that is still to be placed.
struct Open<'a> {
    nested: Nested<'a>,
    /// The arrays around it, and which combination of their places this is.
    around: usize,
    ordinal: u64,
    /// Link sets of what the outer arrays place.
    link_sets: Option<&'a [usize]>,
}

/// Arrays around an array.
struct Around {
    /// `/World/Outer[0:2,5]`; empty for none.
    name: String,
    /// Combinations of places.
    count: u64,
}

/// An array within those around it: the identifier of its element 0 in their first combination, and itself as what is
/// around others.
#[derive(Clone, Copy)]
struct Named {
    first_id: u32,
    around: usize,
}

/// Unrolls the groups of `description`, which are [checked](check_groups).
pub(super) fn unroll<'a>(description: &'a Description, diagnostics: &mut Diagnostics) -> Result<Unrolled<'a>> {
    let document = &description.document;
    let mut samples = Samples { left: MAX_SAMPLES };
    let (singles, nested) = flatten(document, document.root, &mut samples, diagnostics)?;
    let mut unroller = Unroller {
        description,
        diagnostics,
        prototypes: Vec::new(),
        by_group: HashMap::new(),
        around: vec![Around { name: String::new(), count: 1 }],
        named: HashMap::new(),
        arrays: Vec::new(),
        instances: Manifest::default(),
        left_out: Vec::new(),
        samples,
    };
    let mut level: Vec<_> =
        nested.into_iter().map(|nested| Open { nested, around: 0, ordinal: 0, link_sets: None }).collect();
    while !level.is_empty() {
        let mut next = Vec::new();
        for open in level {
            unroller.place(&open, &mut next)?;
        }
        level = next;
    }
    let Unroller { prototypes, arrays, instances, left_out, diagnostics, .. } = unroller;
    for (path, count) in left_out {
        let message =
            format!("{count} instances whose transform flattens them to nothing or is not finite are left out");
        diagnostics.warn("singular-transform", path, message);
    }
    Ok(Unrolled { singles, prototypes: prototypes.into_iter().map(|p| p.parts).collect(), arrays, instances })
}

/// A group that arrays place, unrolled.
struct Prototype<'a> {
    parts: Vec<Placed<'a>>,
    nested: Vec<Nested<'a>>,
}

struct Unroller<'a, 'd> {
    description: &'a Description,
    diagnostics: &'d mut Diagnostics,
    prototypes: Vec<Prototype<'a>>,
    by_group: HashMap<usize, usize>,
    around: Vec<Around>,
    named: HashMap<(usize, Key), Named>,
    arrays: Vec<PlacedArray<'a>>,
    instances: Manifest,
    left_out: Vec<(&'a str, usize)>,
    samples: Samples,
}

impl<'a> Unroller<'a, '_> {
    /// Places an array, and puts what its prototype nests on `next`.
    fn place(&mut self, open: &Open<'a>, next: &mut Vec<Open<'a>>) -> Result<()> {
        let Nested { key, instances, ref transform } = open.nested;
        let link_sets = open.link_sets.or(instances.link_sets.as_deref());
        let arrays = NamedArrays { description: self.description, place: &instances.path };
        let places: Buffer<[f64; 12]> = arrays.doubles(&instances.transforms, 12)?;
        if places.is_empty() {
            return Ok(());
        }
        let motion = instances.places_motion.as_ref().map(|motion| place_samples(motion, &arrays)).transpose()?;
        let indices = instances.indices.as_deref().map(|name| arrays.indices(name)).transpose()?;
        let prototype = self.prototype(instances.group)?;
        let named = self.name(open.around, key, instances, places.len(), indices.as_deref())?;
        let elements = instances.count as u64;
        let Prototype { parts, nested } = &self.prototypes[prototype];
        for inner in nested {
            for place in 0..places.len() {
                let pose = transform.compose(&place_pose(&places, motion.as_ref(), place)).compose(&inner.transform);
                self.samples.count(&pose, &instances.path)?;
                let nested = Nested { transform: pose, ..inner.clone() };
                let ordinal = open.ordinal * places.len() as u64 + place as u64;
                next.push(Open { nested, around: named.around, ordinal, link_sets });
            }
        }
        if parts.is_empty() {
            return Ok(());
        }
        let singular = (0..places.len())
            .into_par_iter()
            .map(|place| {
                let is_nowhere = |part: &&Placed<'_>| match motion.is_none() && !transform.is_moving() {
                    // Moving or not, nearly all are somewhere at the frame.
                    true if !part.transform.is_moving() => {
                        !is_invertible(&(*transform.frame() * affine(&places[place]) * *part.transform.frame()))
                    }
                    _ => {
                        let pose = transform.compose(&place_pose(&places, motion.as_ref(), place));
                        !is_somewhere(&pose.compose(&part.transform))
                    }
                };
                parts.iter().filter(is_nowhere).count()
            })
            .sum();
        if singular > 0 {
            match self.left_out.iter_mut().find(|(path, _)| *path == instances.path) {
                Some((_, count)) => *count += singular,
                None => self.left_out.push((&instances.path, singular)),
            }
        }
        // The manifest has room for all combinations, so that this one fits.
        let first_id = named.first_id + (open.ordinal * elements) as u32;
        let transform = transform.clone();
        self.arrays.push(PlacedArray { prototype, places, motion, transform, first_id, indices, link_sets });
        Ok(())
    }

    /// The prototype that is the group `group`.
    fn prototype(&mut self, group: usize) -> Result<usize> {
        if let Some(&prototype) = self.by_group.get(&group) {
            return Ok(prototype);
        }
        let (parts, nested) = flatten(&self.description.document, group, &mut self.samples, self.diagnostics)?;
        self.prototypes.push(Prototype { parts, nested });
        self.by_group.insert(group, self.prototypes.len() - 1);
        Ok(self.prototypes.len() - 1)
    }

    /// Names an array within those around it. Several arrays of one instancer, one for each prototype, share identifiers.
    fn name(
        &mut self,
        around: usize,
        key: Key,
        instances: &Instances,
        places: usize,
        indices: Option<&[i32]>,
    ) -> Result<Named> {
        if let Some(&named) = self.named.get(&(around, key)) {
            return Ok(named);
        }
        let Around { name, count } = &self.around[around];
        let path = if name.is_empty() {
            instances.path.clone()
        } else {
            // From the prototype on: what is above it is not above its instances.
            let prototype = &self.description.document.groups[key.0].path;
            let parent = prototype.rfind('/').map_or("", |slash| &prototype[..slash]);
            let rest = instances.path.strip_prefix(parent).unwrap_or(&instances.path);
            format!("{name}/{}", rest.trim_start_matches('/'))
        };
        let too_many = || Error::scene(&instances.path, "there are more than 2^32 instances: load a part of the stage");
        let Prototype { parts, nested } = &self.prototypes[self.by_group[&instances.group]];
        let first_id = if parts.is_empty() {
            0
        } else {
            let ids = count.checked_mul(instances.count as u64).ok_or_else(too_many)?;
            self.instances.id(&format!("{path}[0:{}]", instances.count), ids).ok_or_else(too_many)?
        };
        let mut named = Named { first_id, around };
        if !nested.is_empty() {
            let list = match indices {
                Some(indices) => manifest::runs(indices.iter().map(|&i| i as u32)),
                None => manifest::runs(0..places as u32),
            };
            let count = count.checked_mul(places as u64).ok_or_else(too_many)?;
            named.around = self.around.len();
            self.around.push(Around { name: format!("{path}[{list}]"), count });
        }
        self.named.insert((around, key), named);
        Ok(named)
    }
}

/// The shapes of a group and of the groups placed in it by themselves, in the order of the description, and the arrays.
fn flatten<'a>(
    document: &'a Document,
    group: usize,
    samples: &mut Samples,
    diagnostics: &mut Diagnostics,
) -> Result<(Vec<Placed<'a>>, Vec<Nested<'a>>)> {
    struct Frame<'a> {
        group: usize,
        next: usize,
        transform: Pose,
        instance: Option<&'a str>,
    }
    let (mut placed, mut nested) = (Vec::new(), Vec::new());
    // An explicit stack: a hostile file may nest deeper than the thread's own.
    let mut stack = vec![Frame { group, next: 0, transform: DAffine3::IDENTITY.into(), instance: None }];
    while let Some(mut frame) = stack.pop() {
        let Some(item) = document.groups[frame.group].items.get(frame.next) else {
            for (i, instances) in document.groups[frame.group].instances.iter().enumerate() {
                let Instances { path, transform, motion, .. } = instances;
                let Some(local) = pose_of(transform.as_ref(), motion.as_ref(), path, diagnostics) else {
                    continue;
                };
                let transform = frame.transform.compose(&local);
                samples.count(&transform, path)?;
                nested.push(Nested { key: (frame.group, i), instances, transform });
            }
            continue;
        };
        frame.next += 1;
        let Some(local) = pose_of(item.transform.as_ref(), item.motion.as_ref(), &item.path, diagnostics) else {
            stack.push(frame);
            continue;
        };
        let transform = frame.transform.compose(&local);
        samples.count(&transform, &item.path)?;
        let instance = item.instance.as_deref().or(frame.instance);
        stack.push(frame);
        match item.target {
            Target::Group(child) => stack.push(Frame { group: child, next: 0, transform, instance }),
            Target::Shape(_) if !is_somewhere(&transform) => diagnostics.warn(
                "singular-transform",
                &item.path,
                "its transform flattens it to nothing: it is left out",
            ),
            Target::Shape(shape) => placed.push(Placed { shape, transform, placement: item, instance }),
        }
    }
    Ok((placed, nested))
}

/// Transforms of moving things that are still allowed: a hostile file may nest motion in motion.
struct Samples {
    left: usize,
}

impl Samples {
    fn count(&mut self, pose: &Pose, path: &str) -> Result<()> {
        let samples = pose.times().len();
        if samples > MAX_NESTED_TIMES || samples > self.left {
            let problem = "moves within what moves, with too many samples together: sample the motion less often";
            return Err(Error::scene(path, problem));
        }
        self.left -= samples;
        Ok(())
    }
}

/// Whether it is not flat at the frame and at all samples.
fn is_somewhere(pose: &Pose) -> bool {
    is_invertible(pose.frame()) || pose.times().iter().any(|&time| is_invertible(&pose.at(time)))
}

/// Where a place of an array is.
fn place_pose(places: &[[f64; 12]], motion: Option<&PlaceSamples>, place: usize) -> Pose {
    let frame = affine(&places[place]);
    let Some(motion) = motion else { return frame.into() };
    let transforms = motion.places.iter().map(|places| affine(&places[place])).collect();
    Track::new(motion.times.clone(), transforms).map_or(frame.into(), |track| Pose::moving(frame, track))
}

fn place_samples(motion: &InstancesMotion, arrays: &NamedArrays<'_>) -> Result<PlaceSamples> {
    let places = motion.transforms.iter().map(|name| arrays.doubles(name, 12)).collect::<Result<_>>()?;
    Ok(PlaceSamples { times: motion.times.clone(), places })
}

/// A transform with its motion; `None` with a warning if it is none. A motion that is none is warned of and left out.
fn pose_of(
    matrix: Option<&[f64; 16]>,
    motion: Option<&Motion>,
    path: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Pose> {
    let frame = place_of(matrix, path, diagnostics)?;
    let Some(motion) = motion else { return Some(frame.into()) };
    let is_affine =
        |m: &[f64; 16]| m.iter().all(|v| v.is_finite()) && [m[3], m[7], m[11], m[15] - 1.0].iter().all(|&v| v == 0.0);
    let transforms: Vec<_> = (motion.transforms.iter().filter(|m| is_affine(m)))
        .map(|m| DAffine3::from_mat4(DMat4::from_cols_array(m)))
        .collect();
    let track = if motion.times.len() <= MAX_TIMES { Track::new(motion.times.clone(), transforms) } else { None };
    if track.is_none() {
        let problem =
            "its motion is broken (as many affine transforms as increasing times are needed): it stands still";
        diagnostics.warn("broken-motion", path, problem);
    }
    Some(track.map_or(frame.into(), |track| Pose::moving(frame, track)))
}

/// USD's row-vector matrix as an affine map of column vectors; `None` with a warning if it is none.
pub(super) fn place_of(matrix: Option<&[f64; 16]>, path: &str, diagnostics: &mut Diagnostics) -> Option<DAffine3> {
    let Some(matrix) = matrix else { return Some(DAffine3::IDENTITY) };
    let problem = if matrix.iter().any(|v| !v.is_finite()) {
        "its transform has a value that is not finite: it is left out"
    } else if [matrix[3], matrix[7], matrix[11], matrix[15] - 1.0].iter().any(|&v| v != 0.0) {
        "its transform is projective, and only affine ones place geometry: it is left out"
    } else {
        return Some(DAffine3::from_mat4(DMat4::from_cols_array(matrix)));
    };
    diagnostics.warn("broken-transform", path, problem);
    None
}

/// What a group places: items one by one, then arrays with as many places.
enum Child<'a> {
    Item(&'a Placement),
    Array(&'a Instances, u64),
}

impl Child<'_> {
    fn path(&self) -> &str {
        match self {
            Self::Item(item) => &item.path,
            Self::Array(instances, _) => &instances.path,
        }
    }
}

/// Every index of every group is in range, no group contains itself, and the whole is small enough to unroll.
pub(super) fn check_groups(description: &Description) -> Result<()> {
    let document = &description.document;
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
            if let Some(instance) = item.instance.as_deref().filter(|path| path.contains(['[', ']'])) {
                return Err(Error::scene(&item.path, format!("is of the instance {instance}, which is no prim path")));
            }
        }
        for instances in &group.instances {
            in_range(instances.group, document.groups.len(), &instances.path, "group")?;
            check_instances(description, instances)?;
        }
    }
    count_objects(description)
}

/// The arrays fit each other.
fn check_instances(description: &Description, instances: &Instances) -> Result<()> {
    let Instances { path, count, places_motion, .. } = instances;
    let arrays = NamedArrays { description, place: path };
    let places = arrays.doubles::<[f64; 12]>(&instances.transforms, 12)?.len();
    let damaged = |problem: String| Err(Error::scene(path, format!("{problem}: export the stage again")));
    if *count > i32::MAX as usize || path.contains(['[', ']']) {
        return damaged(format!("has {count} elements, which is no instancer"));
    }
    if let Some(motion) = places_motion {
        let InstancesMotion { times, transforms } = motion;
        if !are_increasing(times) || times.len() != transforms.len() || times.len() > MAX_TIMES {
            return damaged(format!("has {} transforms at {} times that must increase", transforms.len(), times.len()));
        }
        for name in transforms {
            let moved = arrays.doubles::<[f64; 12]>(name, 12)?.len();
            if moved != places {
                return damaged(format!("has {moved} transforms at another time for {places}"));
            }
        }
    }
    let Some(name) = &instances.indices else {
        return if places <= *count {
            Ok(())
        } else {
            damaged(format!("has {places} transforms for {count} elements"))
        };
    };
    let indices = arrays.indices(name)?;
    if indices.len() != places {
        return damaged(format!("has {} indices for {places} transforms", indices.len()));
    }
    match indices.iter().find(|&&i| usize::try_from(i).map_or(true, |i| i >= *count)) {
        Some(index) => damaged(format!("shows element {index} of {count}")),
        None => Ok(()),
    }
}

fn count_objects(description: &Description) -> Result<()> {
    let document = &description.document;
    let child = |group: usize, next: usize| {
        let group = &document.groups[group];
        group.items.get(next).map(Child::Item).or_else(|| {
            let instances = group.instances.get(next - group.items.len())?;
            let places = description.arrays.get(&instances.transforms).map_or(0, |array| array.shape[0]);
            Some(Child::Array(instances, places as u64))
        })
    };
    // Depth first with an explicit stack: a hostile file may nest deeper than the thread's own.
    #[derive(Clone, Copy)]
    enum State {
        New,
        Open,
        Counted(u64),
    }
    let mut states = vec![State::New; document.groups.len()];
    // A group, its next child, and what was counted of it.
    let mut stack = vec![(document.root, 0, 0u64)];
    states[document.root] = State::Open;
    while let Some((group, next, count)) = stack.pop() {
        let Some(child) = child(group, next) else {
            // An empty group is walked through as often as a full one.
            states[group] = State::Counted(count.max(1));
            continue;
        };
        let (inner, places) = match &child {
            Child::Item(Placement { target: Target::Group(inner), .. }) => (*inner, 1),
            Child::Array(instances, places) => (instances.group, *places),
            Child::Item(_) => {
                stack.push((group, next + 1, count.saturating_add(1)));
                continue;
            }
        };
        match states[inner] {
            State::New => {
                states[inner] = State::Open;
                stack.push((group, next, count));
                stack.push((inner, 0, 0));
            }
            State::Open => {
                let problem = format!("instances {}, which contains it: break the cycle", document.groups[inner].path);
                return Err(Error::scene(child.path(), problem));
            }
            State::Counted(objects) => {
                let count = count.saturating_add(objects.saturating_mul(places));
                if count > MAX_OBJECTS {
                    let problem = format!(
                        "its instances unroll to more than {MAX_OBJECTS} objects: load a part of the stage, or thin out what \
                         is instanced"
                    );
                    return Err(Error::scene(child.path(), problem));
                }
                stack.push((group, next + 1, count));
            }
        }
    }
    Ok(())
}
