//! Objects that shine: those of geometry lights, and those whose materials emit.
//!
//! What stands still is sampled, piece by piece: triangles, spheres, the faces of boxes, the pieces of solids of revolution.
//! What moves shines where rays happen to meet it: sampling it would need its place at the time of each path.
//!
//! A material emits to both sides, as surfaces do in Storm, Arnold and Cycles. A geometry light is an area light, whose normals point
//! outwards: it shines to that side, so that its power is π times area times radiance.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::color::Color;
use super::shape::{Ellipsoid, Rectangle, Ring, Rings, Triangle};
use crate::diagnostics::Diagnostics;
use crate::geometry::{Hit, Shape, Solid};
use crate::light::{Ellipsoid as WorldEllipsoid, Light, MaterialSync, Shape as LightShape, White};
use crate::scene::view::View;
use crate::spectrum::reflectance::Unbounded;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// More pieces than this are not sampled: a gigabyte of them.
const MAX_PIECES: usize = 1 << 22;
/// Barycentric coordinates where a texture is looked up to guess what a triangle emits.
const PROBES: [[f64; 2]; 4] = [[1.0 / 3.0, 1.0 / 3.0], [0.1, 0.1], [0.8, 0.1], [0.1, 0.8]];

/// Why an object shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    /// Its material emits.
    Material,
    /// It is a geometry light. The light's emission is multiplied by `scale`.
    Light { light: u32, sync: MaterialSync, scale: f64 },
}

/// An object that shines.
#[derive(Debug)]
pub(super) struct Object {
    pub(super) instance: u32,
    pub(super) source: Source,
    surface: Surface,
    /// Emitter of the first piece.
    first: u32,
    /// Which piece a primitive is, where not all of them are; `u32::MAX` for none.
    pieces: Option<Vec<u32>>,
}

/// What is sampled of it.
#[derive(Debug)]
enum Surface {
    Mesh { render_from_object: DAffine3, is_mirrored: bool },
    Sphere(Box<Ellipsoid>),
    Faces(Vec<Rectangle>),
    Rings(Box<Rings>),
    Nothing,
}

/// A piece of an object, made ready.
pub(super) enum Piece<'a> {
    Triangle(Triangle),
    Sphere(&'a Ellipsoid),
    Face(&'a Rectangle),
    Ring(Ring<'a>),
}

/// A piece that may be chosen.
pub(super) struct NewPiece {
    pub(super) primitive: u32,
    /// Radiant intensity towards where it is brightest.
    pub(super) intensity: f64,
}

/// Which objects shine, and how their materials emit.
#[derive(Debug, Default)]
pub(super) struct Objects {
    /// By instance.
    list: Vec<Object>,
    /// Of each material that emits the same everywhere.
    colors: Vec<Option<Color>>,
}

/// A place on an object as a hit.
pub(super) fn hit_at(instance: u32, primitive: u32, barycentric: [f64; 2]) -> Hit {
    Hit { distance: 0.0, instance, primitive, barycentric, leaving: false, at_start: false }
}

impl Objects {
    /// All objects of the view that shine; `add` is told of each piece and returns the number of its emitter, one after the other.
    pub(super) fn new(
        view: &View<'_>,
        lights: &[Light],
        diagnostics: &mut Diagnostics,
        mut add: impl FnMut(u32, &Object, &NewPiece) -> u32,
    ) -> Self {
        let scene = view.scene;
        let constants = scene.materials.iter().map(|material| material.surface.constant_emission());
        let color = |rgb: Option<[f32; 3]>| rgb.map(|rgb| Color::over_d65(rgb.map(f64::from)));
        let mut all = Self { list: Vec::new(), colors: constants.map(color).collect() };
        let mut of_prim: Vec<(u32, u32, MaterialSync, bool)> = Vec::new();
        for (light, index) in lights.iter().zip(0..) {
            if let LightShape::Geometry(geometry) = &light.shape {
                let prims = geometry.prim_ids.iter();
                of_prim.extend(prims.map(|&prim| (prim, index, geometry.material, geometry.is_normalized)));
            }
        }
        // Of several lights of a prim the first.
        of_prim.sort_by_key(|&(prim, light, ..)| (prim, light));
        of_prim.dedup_by_key(|entry| entry.0);
        let emits: Vec<bool> = scene.materials.iter().map(|material| material.surface.emits()).collect();
        if of_prim.is_empty() && !emits.contains(&true) {
            return all;
        }
        let mut count = 0;
        for instance in 0..scene.objects.len() {
            let ids = scene.objects.ids(instance);
            let light = of_prim.binary_search_by_key(&ids.prim_id, |entry| entry.0).ok().map(|i| of_prim[i]);
            let glows = ids.material_ids.iter().any(|&id| id > 0 && emits[id as usize - 1]);
            let source = match light {
                Some((_, light, sync, _)) => Source::Light { light, sync, scale: 1.0 },
                None if glows => Source::Material,
                None => continue,
            };
            let mut object = Object { instance, source, surface: Surface::Nothing, first: 0, pieces: None };
            if view.aggregate.stands_still(instance) {
                object.settle(view);
            }
            if let Some((.., true)) = light
                && let Source::Light { scale, .. } = &mut object.source
            {
                let area = area(view, instance);
                *scale = if area > 0.0 { 1.0 / area } else { 0.0 };
            }
            let total = object.total(view);
            if count + total > MAX_PIECES {
                let path = scene.prims.path(ids.prim_id).unwrap_or_default();
                let problem =
                    format!("what shines has more than {MAX_PIECES} pieces: this is only lit by where paths meet it");
                diagnostics.warn("emissive-geometry", path, problem);
                object.surface = Surface::Nothing;
            } else {
                count += total;
                let pieces = all.pieces(view, lights, &object, total);
                if pieces.len() < total {
                    object.pieces = Some(vec![u32::MAX; total]);
                }
                for (number, piece) in (0..).zip(&pieces) {
                    if let Some(numbers) = &mut object.pieces {
                        numbers[piece.primitive as usize] = number;
                    }
                    let emitter = add(all.list.len() as u32, &object, piece);
                    if number == 0 {
                        object.first = emitter;
                    }
                }
            }
            all.list.push(object);
        }
        all
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    pub(super) fn get(&self, index: u32) -> &Object {
        &self.list[index as usize]
    }

    /// The object that is an instance.
    pub(super) fn find(&self, instance: u32) -> Option<&Object> {
        let found = self.list.binary_search_by_key(&instance, |object| object.instance);
        found.ok().map(|i| &self.list[i])
    }

    /// The pieces of an object that emit anything.
    fn pieces(&self, view: &View<'_>, lights: &[Light], object: &Object, total: usize) -> Vec<NewPiece> {
        let strength = |primitive: u32| {
            let piece = object.piece(view, primitive)?;
            let probes = if matches!(piece, Piece::Triangle(_)) { &PROBES[..] } else { &PROBES[..1] };
            let mean = |rgb: [f64; 3]| rgb.iter().sum::<f64>() / 3.0;
            let base = match object.source {
                Source::Light { light, scale, .. } => lights[light as usize].emission.rgb.map(|x| scale * x),
                Source::Material => [1.0; 3],
            };
            let needs_glow =
                matches!(object.source, Source::Material | Source::Light { sync: MaterialSync::GlowTintsLight, .. });
            let emitted = if needs_glow {
                // At most four values, of which what is bright counts.
                let values = probes.iter().filter_map(|&place| {
                    let hit = hit_at(object.instance, primitive, place);
                    let glow = view.emission(&hit, view.material_id(&hit))?;
                    Some(mean(std::array::from_fn(|i| base[i] * f64::from(glow[i]))))
                });
                let values: Vec<f64> = values.collect();
                if values.is_empty() { return None } else { values.iter().sum::<f64>() / values.len() as f64 }
            } else {
                mean(base)
            };
            // What no probe saw may shine all the same: it is chosen now and then.
            let floor = if needs_glow && !self.is_known(view, object, primitive) { 1e-3 } else { 0.0 };
            let intensity = piece.area() * emitted.max(floor) * piece.intensity_factor();
            (intensity > 0.0 && intensity.is_finite()).then_some(NewPiece { primitive, intensity })
        };
        (0..total as u32).into_par_iter().filter_map(strength).collect()
    }

    /// Whether the material there emits the same everywhere.
    fn is_known(&self, view: &View<'_>, object: &Object, primitive: u32) -> bool {
        let id = view.material_id(&hit_at(object.instance, primitive, PROBES[0]));
        id == 0 || self.colors[id as usize - 1].is_some()
    }

    /// What the material at `hit` emits at the wavelengths; `None` where it does not.
    pub(super) fn glow<const N: usize>(
        &self,
        view: &View<'_>,
        hit: &Hit,
        id: u32,
        wavelengths: &Wavelengths<N>,
    ) -> Option<SampledSpectrum<N>> {
        let material = id.checked_sub(1)? as usize;
        if let Some(color) = &self.colors[material] {
            return Some(color.at(wavelengths));
        }
        let filter = Unbounded::of_color(view.emission(hit, id)?);
        let white = White::d65();
        Some(SampledSpectrum(wavelengths.nanometers().map(|nm| white.at(nm))) * filter.at(wavelengths))
    }

    /// What an object emits at `hit` in the direction of travel `direction`, as what is sampled of it does; where its surface is
    /// only there in part, as the part that is there does.
    pub(super) fn radiance<const N: usize>(
        &self,
        view: &View<'_>,
        lights: (&[Light], &[Color]),
        object: &Object,
        hit: &Hit,
        direction: DVec3,
        wavelengths: &Wavelengths<N>,
    ) -> SampledSpectrum<N> {
        let id = view.material_id(hit);
        match object.source {
            Source::Material => self.glow(view, hit, id, wavelengths).unwrap_or(SampledSpectrum::ZERO),
            Source::Light { light, sync, scale } => {
                let (light, color) = (&lights.0[light as usize], &lights.1[light as usize]);
                let mut factor = light.shaped(direction).map(|x| scale * x);
                if sync == MaterialSync::GlowTintsLight {
                    let Some(glow) = view.emission(hit, id) else { return SampledSpectrum::ZERO };
                    factor = std::array::from_fn(|i| factor[i] * f64::from(glow[i]));
                }
                color.times(factor, wavelengths)
            }
        }
    }
}

impl Object {
    /// The share of its surface that is there at `hit`.
    pub(super) fn presence(&self, view: &View<'_>, hit: &Hit) -> f32 {
        match self.source {
            Source::Light { sync: MaterialSync::NoResponse, .. } => 1.0,
            _ => view.share_present(hit, view.material_id(hit)),
        }
    }

    /// Whether it shines to both sides.
    pub(super) fn is_two_sided(&self) -> bool {
        self.source == Source::Material
    }

    /// Makes the surface ready.
    fn settle(&mut self, view: &View<'_>) {
        let (shape, mut place) = view.scene.objects.placed(self.instance, 0.0);
        if !crate::geometry::is_invertible(&place) {
            return;
        }
        place.translation -= view.origin;
        let is_two_sided = self.is_two_sided();
        self.surface = match shape {
            Shape::Mesh(_) => {
                Surface::Mesh { render_from_object: place, is_mirrored: place.matrix3.determinant() < 0.0 }
            }
            Shape::Sphere(sphere) => {
                let axes = place.matrix3 * sphere.radius();
                Surface::Sphere(Box::new(Ellipsoid::new(place.translation, axes, is_two_sided)))
            }
            Shape::Solid(solid @ (Solid::Cuboid(_) | Solid::Rectangle(_))) => {
                Surface::Faces(faces(solid, &place, is_two_sided))
            }
            Shape::Solid(Solid::Revolved(_)) => Surface::Rings(Box::new(Rings::new(&place))),
        };
    }

    /// How many primitives can be pieces.
    fn total(&self, view: &View<'_>) -> usize {
        match &self.surface {
            Surface::Nothing => 0,
            Surface::Sphere(_) => 1,
            Surface::Faces(faces) => faces.len(),
            Surface::Rings(_) => match view.scene.objects.placed(self.instance, 0.0).0 {
                Shape::Solid(Solid::Revolved(solid)) => solid.piece_count() as usize,
                _ => 0,
            },
            Surface::Mesh { .. } => match view.scene.objects.placed(self.instance, 0.0).0 {
                Shape::Mesh(mesh) => mesh.len(),
                _ => 0,
            },
        }
    }

    /// The piece that is a primitive.
    pub(super) fn piece<'b>(&'b self, view: &'b View<'_>, primitive: u32) -> Option<Piece<'b>> {
        match &self.surface {
            Surface::Nothing => None,
            Surface::Sphere(sphere) => Some(Piece::Sphere(sphere)),
            Surface::Faces(faces) => faces.get(primitive as usize).map(Piece::Face),
            Surface::Rings(rings) => match view.scene.objects.placed(self.instance, 0.0).0 {
                Shape::Solid(Solid::Revolved(solid)) => {
                    Some(Piece::Ring(Ring::new(solid, primitive, rings, self.is_two_sided())))
                }
                _ => None,
            },
            Surface::Mesh { render_from_object, is_mirrored } => {
                let (Shape::Mesh(mesh), _) = view.scene.objects.placed(self.instance, 0.0) else { return None };
                let local = mesh.corners(primitive, 0.0);
                let corners = local.map(|p| render_from_object.matrix3 * p + render_from_object.translation);
                // Edges from object space, where they are exact.
                let [u, v] = [local[1] - local[0], local[2] - local[0]].map(|e| render_from_object.matrix3 * e);
                let normal = if *is_mirrored { v.cross(u) } else { u.cross(v) };
                Some(Piece::Triangle(Triangle::new(corners, normal, self.is_two_sided())))
            }
        }
    }

    /// The emitter of a primitive; `None` where it is not sampled.
    pub(super) fn emitter(&self, primitive: u32) -> Option<u32> {
        if let Surface::Nothing = self.surface {
            return None;
        }
        let piece = match &self.pieces {
            None => primitive,
            Some(pieces) => *pieces.get(primitive as usize).filter(|&&piece| piece != u32::MAX)?,
        };
        Some(self.first + piece)
    }
}

impl Piece<'_> {
    fn area(&self) -> f64 {
        match self {
            Self::Triangle(triangle) => triangle.area(),
            Self::Sphere(sphere) => sphere.area(),
            Self::Face(face) => face.area(),
            Self::Ring(ring) => ring.area(),
        }
    }

    /// Intensity where it is brightest over radiance times area.
    fn intensity_factor(&self) -> f64 {
        match self {
            Self::Triangle(_) | Self::Face(_) => 1.0,
            // The mean over all directions.
            Self::Sphere(_) | Self::Ring(_) => 0.25,
        }
    }
}

/// The faces of a box in the order of its primitives, or the rectangle alone.
fn faces(solid: &Solid, place: &DAffine3, is_two_sided: bool) -> Vec<Rectangle> {
    let [_, half] = solid.bounds();
    let axis = |i: usize| {
        let mut v = DVec3::ZERO;
        v[i] = half[i];
        place.matrix3 * v
    };
    let covector = place.matrix3.inverse().transpose();
    let face = |i: usize, sign: f64, offset: DVec3| {
        let mut n = DVec3::ZERO;
        n[i] = sign;
        let normal = (covector * n).normalize();
        Rectangle::new(place.translation + offset, axis((i + 1) % 3), axis((i + 2) % 3), normal, is_two_sided)
    };
    if let Some(flat) = (0..3).find(|&i| half[i] == 0.0) {
        return vec![face(flat, 1.0, DVec3::ZERO)];
    }
    (0..3).flat_map(|i| [-1.0, 1.0].map(|sign| face(i, sign, sign * axis(i)))).collect()
}

/// Area of an object in the world at the scene's own time.
fn area(view: &View<'_>, instance: u32) -> f64 {
    let (shape, place) = view.scene.objects.placed(instance, 0.0);
    match shape {
        Shape::Sphere(sphere) => WorldEllipsoid::new(&place, sphere.radius(), false).area,
        Shape::Mesh(mesh) => (0..mesh.len() as u32)
            .map(|primitive| {
                let [a, b, c] = mesh.corners(primitive, 0.0);
                0.5 * (place.matrix3 * (b - a)).cross(place.matrix3 * (c - a)).length()
            })
            .sum(),
        Shape::Solid(solid @ (Solid::Cuboid(_) | Solid::Rectangle(_))) => {
            faces(solid, &place, true).iter().map(Rectangle::area).sum()
        }
        Shape::Solid(Solid::Revolved(solid)) => {
            let rings = Rings::new(&place);
            (0..solid.piece_count()).map(|primitive| Ring::new(solid, primitive, &rings, true).area()).sum()
        }
    }
}
