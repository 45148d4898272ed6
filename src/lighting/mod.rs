//! The lights of a view, in render space: choosing one and a point of it, what a ray meets of them, with what density.
//!
//! Lights that are not geometry (rectangle, disk, sphere, cylinder) are met by rays like surfaces, from the side that shines;
//! they block nothing, so a ray gathers every one along its way ([`Lighting::along`]), as next-event estimation reaches each of them
//! past the others. Domes and distant lights are met by rays that meet nothing ([`Lighting::environment`]), emission of
//! materials and geometry lights where a ray meets the surface ([`Lighting::emitted`]). Densities are per solid angle at the
//! receiver, with the choice of the light in them.
//!
//! Lights stand still. A light chooses among many by a light tree (`tree.rs`), and never one that is not linked to the receiver
//! (`choice.rs`).

mod choice;
mod color;
mod cone;
mod dome;
mod emitter;
mod objects;
mod shape;
#[cfg(test)]
mod tests;
mod tree;

use glam::{DVec2, DVec3, Vec3};

use self::choice::{Candidates, Choice, Chooser, Place};
use self::color::{Color, Filters};
use self::cone::Cone;
use self::emitter::{Form, Placed, hull, looked_up, texture_coordinates};
use self::objects::{Objects, Piece, Source, hit_at};
use self::shape::Toward;
use self::tree::LightBounds;
use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::geometry::{Bounds, Hit, Ray, Tree};
use crate::light::{Light, MaterialSync};
use crate::scene::lights::LightImages;
use crate::scene::view::View;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// From this many lights on rays find them by a tree.
const MANY: usize = 8;
/// How many times larger the rounding of a light's own space is than that of a box: the walk through the tree takes it.
const SPREAD: f64 = 1024.0;

/// Which light: index into [`Lighting::light`], or, beyond those, a material that emits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LightId(pub u32);

/// What can be chosen by itself: a light, or a piece of a surface; for [`Lighting::pdf`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmitterId(u32);

impl EmitterId {
    /// What is never sampled.
    const NONE: Self = Self(u32::MAX);
}

/// What light is sampled for.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Render space.
    pub point: DVec3,
    /// Geometric normal on the side of the path, unit: no light is chosen that comes from its other side alone. `None` where light is
    /// received from both sides.
    pub normal: Option<Vec3>,
    /// Index of the placed object, for light linking.
    pub object: u32,
    /// When, frames from the scene's own.
    pub time: f64,
}

/// A point of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample<const N: usize> {
    /// Which light.
    pub light: LightId,
    /// Unit vector from the receiver.
    pub wi: DVec3,
    /// To the light; infinite for domes and distant lights.
    pub distance: f64,
    /// Radiance per nm that arrives if nothing is in between, before the light's factors for diffuse and specular. For a delta light,
    /// what radiance over density would be: irradiance at normal incidence.
    pub radiance: SampledSpectrum<N>,
    /// Density per solid angle, the choice of the light included; of a delta light the probability of the choice.
    pub pdf: f32,
    /// Nothing else than sampling it finds it: parallel light, points, lines, geometry whose material is what rays see.
    pub is_delta: bool,
}

/// A part of a plane, or of the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// A point, or of the sky a unit vector towards it.
    pub center: DVec3,
    /// From there to the sides.
    pub half: [DVec3; 2],
    /// Infinitely far.
    pub is_infinite: bool,
}

impl Patch {
    /// Where a ray from `point` in direction `wi` meets its plane: −1..1 on it; `None` if nowhere.
    pub fn coordinates(&self, point: DVec3, wi: DVec3) -> Option<DVec2> {
        let [u, v] = self.half;
        let n = u.cross(v);
        let q = if self.is_infinite {
            wi - self.center
        } else {
            let to = self.center - point;
            wi * (to.dot(n) / wi.dot(n)) - to
        };
        let square = n.length_squared();
        let place = DVec2::new(q.dot(v.cross(n)), q.dot(n.cross(u))) / square;
        place.is_finite().then_some(place)
    }
}

/// A light that a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit<const N: usize> {
    /// Which light.
    pub light: LightId,
    /// Along the ray; infinite for domes and distant lights.
    pub distance: f64,
    /// Radiance per nm against the ray's direction.
    pub radiance: SampledSpectrum<N>,
    /// What [`Lighting::pdf`] is asked about.
    pub emitter: EmitterId,
    /// Where; the start of a ray may have moved on since the receiver.
    point: DVec3,
}

/// What a number of an emitter stands for.
#[derive(Clone, Copy, Debug)]
enum Emitter {
    /// The light with the same number.
    Light,
    /// A primitive of an object that shines.
    Piece { object: u32, primitive: u32 },
}

/// The lights of a view.
#[derive(Debug)]
pub struct Lighting<'a> {
    view: &'a View<'a>,
    lights: Vec<Light>,
    groups: Vec<String>,
    colors: Vec<Color>,
    /// Each light in render space; none of geometry.
    placed: Vec<Option<Placed>>,
    images: LightImages,
    objects: Objects,
    /// Lights in their order, then pieces of objects.
    emitters: Vec<Emitter>,
    places: Vec<Place>,
    choice: Choice,
    /// Lights that rays meet, and the tree over them where there are many.
    visible: Vec<u32>,
    tree: Option<Tree>,
    /// Domes and distant lights that rays see.
    environment: Vec<u32>,
    diagnostics: Diagnostics,
}

impl<'a> Lighting<'a> {
    /// Compiles the lights of the view's scene: reads their images, and builds what chooses among them.
    pub fn new(view: &'a View<'a>) -> Result<Self> {
        let compiled = view.scene.lights()?;
        let mut diagnostics = compiled.diagnostics;
        let lights = compiled.lights;
        let images = LightImages::read(view.scene, &lights)?;
        diagnostics.extend(&images.diagnostics);
        let mut filters = Filters::default();
        let colors: Vec<Color> = lights.iter().map(|light| Color::new(&light.emission, &mut filters)).collect();
        let placed: Vec<Option<Placed>> = lights.iter().map(|light| Placed::new(light, &images, view.origin)).collect();
        let mut emitters = vec![Emitter::Light; lights.len()];
        let mut candidates = Candidates::default();
        let is_received = |light: &Light| light.diffuse > 0.0 || light.specular > 0.0;
        for (number, (light, placed)) in (0..).zip(lights.iter().zip(&placed)) {
            let mean = colors[number as usize].mean();
            let Some(placed) = placed.as_ref().filter(|_| is_received(light)) else { continue };
            if let Some(bounds) = placed.bounds(light, mean) {
                candidates.add(light.illuminates, number, bounds);
            } else if let Some(infinite) = placed.infinite(light, mean, number) {
                candidates.add_infinite(light.illuminates, infinite);
            }
        }
        let objects = Objects::new(view, &lights, &mut diagnostics, |index, object, piece| {
            let number = emitters.len() as u32;
            emitters.push(Emitter::Piece { object: index, primitive: piece.primitive });
            let illuminates = match object.source {
                Source::Light { light, .. } if !is_received(&lights[light as usize]) => return number,
                Source::Light { light, .. } => lights[light as usize].illuminates,
                Source::Material => None,
            };
            let (bounds, normals) = match object.piece(view, piece.primitive) {
                Some(Piece::Triangle(t)) => (hull(&t.corners()), Cone { axis: t.unit_normal(), angle: 0.0 }),
                Some(Piece::Face(f)) => (hull(&f.corners()), Cone { axis: f.normal(), angle: 0.0 }),
                Some(Piece::Sphere(s)) => {
                    let (center, half) = (s.center(), s.half_extent());
                    (Bounds { min: center - half, max: center + half }, Cone::EVERYTHING)
                }
                Some(Piece::Ring(ring)) => (hull(&ring.box_corners()), Cone::EVERYTHING),
                None => return number,
            };
            let emission_angle = std::f64::consts::FRAC_PI_2;
            let is_two_sided = object.is_two_sided();
            let bounds = LightBounds { bounds, normals, emission_angle, is_two_sided, intensity: piece.intensity };
            candidates.add(illuminates, number, bounds);
            number
        });
        let (choice, places) = candidates.build(emitters.len());
        let boxes: Vec<(u32, Bounds)> =
            (0..).zip(&placed).filter_map(|(number, placed)| Some((number, placed.as_ref()?.visible()?))).collect();
        let visible = boxes.iter().map(|&(number, _)| number).collect();
        let tree = (boxes.len() >= MANY).then(|| Tree::build(boxes.len(), |i| boxes[i].1));
        let is_seen = |placed: &Option<Placed>| match placed.as_ref().map(|placed| &placed.form) {
            Some(Form::Distant(sky)) => !sky.is_parallel(),
            Some(Form::Dome(_)) => true,
            _ => false,
        };
        let environment = (0..).zip(&placed).filter(|(_, placed)| is_seen(placed)).map(|(number, _)| number).collect();
        Ok(Self {
            view,
            lights,
            groups: compiled.groups,
            colors,
            placed,
            images,
            objects,
            emitters,
            places,
            choice,
            visible,
            tree,
            environment,
            diagnostics,
        })
    }

    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty() && self.objects.is_empty()
    }

    /// What was odd about the lights and was not known before: files, transforms, sizes.
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.diagnostics
    }

    /// What a light is; `None` for the emission of a material.
    pub fn light(&self, id: LightId) -> Option<&Light> {
        self.lights.get(id.0 as usize)
    }

    /// A parallelogram that covers a light as it is seen in the direction `wi`; `None` of domes, objects and what has no size.
    pub fn patch(&self, id: LightId, wi: DVec3) -> Option<Patch> {
        self.placed.get(id.0 as usize)?.as_ref()?.patch(wi)
    }

    /// Names of the light groups.
    pub fn groups(&self) -> &[String] {
        &self.groups
    }

    /// Whether a light reaches an object at all, by light linking. [`sample`](Self::sample) only chooses such lights;
    /// those that rays find must be asked about.
    pub fn is_linked(&self, light: LightId, object: u32) -> bool {
        let set = self.light(light).and_then(|light| light.illuminates);
        set.is_none_or(|set| self.view.scene.is_linked(set, object))
    }

    /// Whether the surface at `hit` has no material: all that it does is to shine.
    pub fn replaces_material(&self, hit: &Hit) -> bool {
        let source = self.objects.find(hit.instance).map(|object| object.source);
        matches!(source, Some(Source::Light { sync: MaterialSync::NoResponse, .. }))
    }

    /// Chooses a light and a point of it. `u_light` chooses, `u` is the point's place, all in 0..1.
    pub fn sample<const N: usize>(
        &self,
        receiver: &Receiver,
        wavelengths: &Wavelengths<N>,
        u_light: f32,
        u: [f32; 2],
    ) -> Option<LightSample<N>> {
        self.sample_where_chosen(receiver, wavelengths, || u_light, u)
    }

    /// The same; `u_light` is not asked for where there is but one light.
    pub fn sample_where_chosen<const N: usize>(
        &self,
        receiver: &Receiver,
        wavelengths: &Wavelengths<N>,
        u_light: impl FnOnce() -> f32,
        u: [f32; 2],
    ) -> Option<LightSample<N>> {
        let chooser = chooser(receiver);
        let is_linked = |set| self.view.scene.is_linked(set, receiver.object);
        let (number, probability) = self.choice.sample(&chooser, is_linked, || refined(u_light(), u))?;
        let (p, u) = (receiver.point, u.map(f64::from));
        let light = match self.emitters[number as usize] {
            Emitter::Piece { object, primitive } => {
                return self.sample_piece(object, primitive, receiver, u, probability, wavelengths);
            }
            Emitter::Light => number as usize,
        };
        let placed = self.placed[light].as_ref()?;
        let delta = |wi: DVec3, distance: f64, irradiance: f64| {
            let factor = self.lights[light].shaped(-wi).map(|x| x * irradiance);
            LightSample {
                light: LightId(number),
                wi,
                distance,
                radiance: self.colors[light].times(factor, wavelengths),
                pdf: probability as f32,
                is_delta: true,
            }
        };
        let toward = match &placed.form {
            Form::Rectangle { shape, .. } => shape.sample(p, u)?,
            Form::Disk(disk) => disk.sample(p, u)?,
            Form::Ellipsoid(ball) => ball.sample(p, false, u)?,
            Form::Tube(tube) => tube.sample(p, u)?,
            Form::Dome(dome) => dome.sample(p, chooser.normal, u)?,
            Form::Distant(sky) if sky.is_parallel() => {
                return usable(delta(sky.toward, f64::INFINITY, 1.0));
            }
            Form::Distant(sky) => sky.sample(u),
            Form::Point(ball) => {
                let to = ball.center() - p;
                let distance = to.length();
                let wi = to / distance;
                let irradiance = ball.projected_area(-wi) / (distance * distance);
                return (distance > 0.0).then(|| delta(wi, distance, irradiance)).and_then(usable);
            }
            Form::Line(line) => {
                let (wi, distance, irradiance) = line.sample(p, u[0])?;
                return usable(delta(wi, distance, irradiance));
            }
        };
        let Toward { wi, distance, pdf_solid_angle } = toward;
        let at = match &placed.form {
            Form::Rectangle { shape, image: Some(_) } => shape.coordinates(p + distance * wi),
            _ => [0.0; 2],
        };
        usable(LightSample {
            light: LightId(number),
            wi,
            distance,
            radiance: self.radiance(light, placed, wi, at, wavelengths),
            pdf: (probability * pdf_solid_angle) as f32,
            is_delta: false,
        })
    }

    fn sample_piece<const N: usize>(
        &self,
        object: u32,
        primitive: u32,
        receiver: &Receiver,
        u: [f64; 2],
        probability: f64,
        wavelengths: &Wavelengths<N>,
    ) -> Option<LightSample<N>> {
        let object = self.objects.get(object);
        // An object may light itself, but not a point of it that very point, on whichever side of it rounding has put the ray.
        let (p, on_it) = (receiver.point, object.instance == receiver.object);
        let (Toward { wi, distance, pdf_solid_angle }, barycentric) = match object.piece(self.view, primitive)? {
            Piece::Triangle(triangle) => triangle.sample(p, u)?,
            Piece::Sphere(ball) => (ball.sample(p, on_it, u)?, [0.0; 2]),
            Piece::Face(face) if on_it && face.is_in_plane(p) => return None,
            Piece::Face(face) => (face.sample(p, u)?, [0.0; 2]),
            Piece::Ring(ring) => (ring.sample(p, u)?, [0.0; 2]),
        };
        let hit = hit_at(object.instance, primitive, barycentric);
        let lights = (&self.lights[..], &self.colors[..]);
        let radiance = self.objects.radiance(self.view, lights, object, &hit, -wi, wavelengths);
        // Rays meet no more of it than is there.
        let radiance = radiance * object.presence(self.view, &hit);
        let light = self.id_of(object.source, &hit);
        let sample =
            LightSample { light, wi, distance, radiance, pdf: (probability * pdf_solid_angle) as f32, is_delta: false };
        match object.source {
            // Rays see the material there, so that nothing else finds this light.
            Source::Light { sync: MaterialSync::Independent, .. } => usable(LightSample {
                radiance: radiance * (1.0 / pdf_solid_angle) as f32,
                pdf: probability as f32,
                is_delta: true,
                ..sample
            }),
            _ => usable(sample),
        }
    }

    fn id_of(&self, source: Source, hit: &Hit) -> LightId {
        match source {
            Source::Light { light, .. } => LightId(light),
            Source::Material => LightId(self.lights.len() as u32 + self.view.material_id(hit).saturating_sub(1)),
        }
    }

    /// Of a light that is no object, from where `wi` points; `at` is a place on a rectangle, −1..1.
    fn radiance<const N: usize>(
        &self,
        light: usize,
        placed: &Placed,
        wi: DVec3,
        at: [f64; 2],
        wavelengths: &Wavelengths<N>,
    ) -> SampledSpectrum<N> {
        let (color, shaping) = (&self.colors[light], &self.lights[light].shaping);
        let image = match &placed.form {
            Form::Rectangle { image: Some(image), .. } => Some(looked_up(image, &self.images, texture_coordinates(at))),
            Form::Dome(dome) if dome.has_image() => Some(dome.looked_up(&self.images.store, wi)),
            _ => None,
        };
        match (image, shaping) {
            (None, None) => color.at(wavelengths),
            (image, _) => {
                let shaped = self.lights[light].shaped(-wi);
                let image = image.unwrap_or([1.0; 3]);
                color.times(std::array::from_fn(|i| shaped[i] * image[i]), wavelengths)
            }
        }
    }

    /// The density with which [`sample`](Self::sample) draws, for the receiver, the direction `wi` of a ray from there that met
    /// `hit`, straight on through whatever; 0 of what is never sampled for it.
    pub fn pdf<const N: usize>(&self, receiver: &Receiver, wi: DVec3, hit: &LightHit<N>) -> f32 {
        let EmitterId(number) = hit.emitter;
        if hit.emitter == EmitterId::NONE {
            return 0.0;
        }
        let chooser = chooser(receiver);
        let is_linked = |set| self.view.scene.is_linked(set, receiver.object);
        let probability = self.choice.probability(&chooser, is_linked, self.places[number as usize]);
        if probability <= 0.0 {
            return 0.0;
        }
        let (p, distance) = (receiver.point, (hit.point - receiver.point).length());
        let pdf_solid_angle = match self.emitters[number as usize] {
            Emitter::Piece { object, primitive } => {
                let object = self.objects.get(object);
                match object.piece(self.view, primitive) {
                    Some(Piece::Triangle(triangle)) => triangle.pdf(p, wi, distance),
                    Some(Piece::Sphere(ball)) => ball.pdf(p, object.instance == receiver.object, wi, distance),
                    Some(Piece::Face(face)) => face.pdf(p, distance),
                    Some(Piece::Ring(ring)) => ring.pdf(p, wi, distance),
                    None => 0.0,
                }
            }
            Emitter::Light => match self.placed[number as usize].as_ref().map(|placed| &placed.form) {
                Some(Form::Rectangle { shape, .. }) => shape.pdf(p, distance),
                Some(Form::Disk(disk)) => disk.pdf(p, distance),
                Some(Form::Ellipsoid(ball)) => ball.pdf(p, false, wi, distance),
                Some(Form::Tube(tube)) => tube.pdf(p, wi),
                Some(Form::Distant(sky)) => sky.pdf(),
                Some(Form::Dome(dome)) => dome.pdf(p, chooser.normal, wi),
                Some(Form::Point(_) | Form::Line(_)) | None => 0.0,
            },
        };
        (probability * pdf_solid_angle) as f32
    }

    /// Calls `f` with every light that is not geometry and that the ray meets before `limit`, in the order of the lights.
    /// They block nothing, so that all of them count.
    #[inline]
    pub fn along<const N: usize>(
        &self,
        ray: &Ray,
        limit: f64,
        wavelengths: &Wavelengths<N>,
        f: &mut dyn FnMut(LightHit<N>),
    ) {
        match &self.tree {
            None => self.visible.iter().for_each(|&number| self.meet(number, ray, limit, wavelengths, f)),
            Some(tree) => self.along_many(tree, ray, limit, wavelengths, f),
        }
    }

    /// The same by a tree.
    fn along_many<const N: usize>(
        &self,
        tree: &Tree,
        ray: &Ray,
        limit: f64,
        wavelengths: &Wavelengths<N>,
        f: &mut dyn FnMut(LightHit<N>),
    ) {
        // The order of a walk is the tree's, and that is the builder's threads'.
        let mut near = Vec::new();
        tree.walk(ray.origin, ray.direction, 0.0, limit, SPREAD, |i, limit| {
            near.push(self.visible[i as usize]);
            limit
        });
        near.sort_unstable();
        near.into_iter().for_each(|number| self.meet(number, ray, limit, wavelengths, f));
    }

    /// Calls `f` with a light that is not geometry if the ray meets it before `limit`.
    #[inline]
    fn meet<const N: usize>(
        &self,
        number: u32,
        ray: &Ray,
        limit: f64,
        wavelengths: &Wavelengths<N>,
        f: &mut dyn FnMut(LightHit<N>),
    ) {
        if let Some(placed) = &self.placed[number as usize]
            && let Some((distance, at)) = placed.meet(ray.origin, ray.direction)
            && distance < limit
        {
            let radiance = self.radiance(number as usize, placed, ray.direction, at, wavelengths);
            let point = ray.origin + distance * ray.direction;
            f(LightHit { light: LightId(number), distance, radiance, emitter: EmitterId(number), point });
        }
    }

    /// What shines from infinitely far along the ray: every dome and distant light.
    pub fn environment<const N: usize>(&self, ray: &Ray, wavelengths: &Wavelengths<N>, f: &mut dyn FnMut(LightHit<N>)) {
        for &number in &self.environment {
            let Some(placed) = &self.placed[number as usize] else { continue };
            if let Form::Distant(sky) = &placed.form
                && !sky.contains(ray.direction)
            {
                continue;
            }
            let radiance = self.radiance(number as usize, placed, ray.direction, [0.0; 2], wavelengths);
            let (light, distance) = (LightId(number), f64::INFINITY);
            f(LightHit { light, distance, radiance, emitter: EmitterId(number), point: ray.origin });
        }
    }

    /// What the surface at `hit` emits towards the ray that met it there: emissive materials and geometry lights.
    pub fn emitted<const N: usize>(&self, ray: &Ray, hit: &Hit, wavelengths: &Wavelengths<N>) -> Option<LightHit<N>> {
        let object = self.objects.find(hit.instance)?;
        let emitter = || object.emitter(hit.primitive).map_or(EmitterId::NONE, EmitterId);
        let (radiance, light, emitter) = match object.source {
            Source::Light { sync: MaterialSync::Independent, .. } => {
                let id = self.view.material_id(hit);
                let light = LightId(self.lights.len() as u32 + id.saturating_sub(1));
                (self.objects.glow(self.view, hit, id, wavelengths)?, light, EmitterId::NONE)
            }
            Source::Light { .. } if hit.leaving => return None,
            source => {
                let lights = (&self.lights[..], &self.colors[..]);
                let radiance = self.objects.radiance(self.view, lights, object, hit, -ray.direction, wavelengths);
                (radiance, self.id_of(source, hit), emitter())
            }
        };
        let (distance, point) = (hit.distance, ray.origin + hit.distance * ray.direction);
        (!radiance.is_black()).then_some(LightHit { light, distance, radiance, emitter, point })
    }
}

fn chooser(receiver: &Receiver) -> Chooser {
    Chooser { point: receiver.point, normal: receiver.normal.map(Vec3::as_dvec3) }
}

/// A sample that something arrives of.
fn usable<const N: usize>(sample: LightSample<N>) -> Option<LightSample<N>> {
    let is_usable = sample.pdf > 0.0 && sample.pdf.is_finite() && !sample.radiance.is_black();
    (is_usable && sample.radiance.is_finite()).then_some(sample)
}

/// The number with digits beyond those of single precision, so that lights with a probability below 2⁻²⁴ are chosen, too: a
/// hash of all three numbers (the finalizer of SplitMix64, G. Steele, D. Lea, C. Flood 2014).
fn refined(u_light: f32, u: [f32; 2]) -> f64 {
    let bits = |x: f32| u64::from(x.to_bits());
    let mut z = bits(u_light) ^ bits(u[0]).rotate_left(21) ^ bits(u[1]).rotate_left(42);
    z = (z.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    // A step of single precision just below 1 is 2⁻²⁴.
    let rest = (z >> 11) as f64 / 9_007_199_254_740_992.0;
    (f64::from(u_light) + rest / 16_777_216.0).clamp(0.0, 1.0 - f64::EPSILON)
}
