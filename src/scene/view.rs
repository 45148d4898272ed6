//! The scene as one camera sees it: instances about the camera, media at one wavelength, the media it stands in.

use std::sync::atomic::{AtomicU8, Ordering};

use glam::DVec3;

use super::Scene;
use super::material::{Below, Finish, Kind, Material, ShadingFrame, Surface, SurfaceAt};
use crate::bsdf::Interface;
use crate::error::{Error, Result};
use crate::geometry::{Aggregate, Departures, Hit, Ray};
use crate::optics::IorJet;
use crate::optics::media::{Inside, MediaStack, MediumId};
use crate::ray::UnitNormals;
use crate::spectrum::{Wavelength, Wavelengths};
use crate::texture::Program;

/// The direction of the one fixed ray that finds the media around the camera: no axis or diagonal that scenes are built on.
const PARITY_DIRECTION: DVec3 = DVec3::new(0.267_261_241_912_424_4, 0.534_522_483_824_848_8, 0.801_783_725_737_273_2);

/// Whether something is so, found out when a ray first asks. Several threads may find out at once: the answer is the same.
#[derive(Debug, Default)]
struct FoundOut(AtomicU8);

impl FoundOut {
    const UNKNOWN: u8 = 0;
    const NO: u8 = 1;
    const YES: u8 = 2;

    fn or_find(&self, find: impl FnOnce() -> bool) -> bool {
        let mut answer = self.0.load(Ordering::Relaxed);
        if answer == Self::UNKNOWN {
            answer = if find() { Self::YES } else { Self::NO };
            self.0.store(answer, Ordering::Relaxed);
        }
        answer == Self::YES
    }
}

/// What a surface is at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// As its material says.
    AsStated,
    /// Opaque, where its material is glass elsewhere.
    Opaque,
    /// Not there.
    Absent,
}

/// A scene in render space: the stage's world with the camera at the origin.
#[derive(Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// What rays meet.
    pub aggregate: Aggregate,
    /// World position of the origin.
    pub origin: DVec3,
    /// Per object: whether its glass can coincide with that of another.
    touching: Vec<FoundOut>,
    /// Per object: whether it can coincide with any other.
    in_contact: Vec<FoundOut>,
}

impl<'a> View<'a> {
    /// `scene` as it is at the frame, about the world point `origin`.
    pub fn new(scene: &'a Scene, origin: DVec3) -> Self {
        Self::build(scene, origin, false)
    }

    /// `scene` as it moves, about the world point `origin`.
    pub fn moving(scene: &'a Scene, origin: DVec3) -> Self {
        Self::build(scene, origin, true)
    }

    fn build(scene: &'a Scene, origin: DVec3, moves: bool) -> Self {
        let (singles, arrays) = scene.objects.instances(moves);
        let aggregate = Aggregate::with_arrays(&singles, arrays, origin);
        let unknown = || (0..scene.objects.len()).map(|_| FoundOut::default()).collect();
        Self { scene, aggregate, origin, touching: unknown(), in_contact: unknown() }
    }

    fn is_glass(&self, object: u32) -> bool {
        let has_interior =
            |id: &u32| id.checked_sub(1).is_some_and(|i| self.scene.materials[i as usize].has_interior());
        self.scene.objects.ids(object).material_ids.iter().any(has_interior)
    }

    /// Objects whose surfaces may be smooth glass or mirrors, with their boxes at all times in render space.
    pub fn focusing(&self) -> impl Iterator<Item = (u32, [DVec3; 2])> {
        let smooth: Vec<bool> = (self.scene.materials.iter())
            .map(|m| matches!(m.kind, Kind::Dielectric { rough: false, .. } | Kind::Mirror { .. }))
            .collect();
        // Many scenes have none: their objects are not asked.
        let count = if smooth.contains(&true) { self.scene.objects.len() } else { 0 };
        let is_smooth = move |id: &u32| id.checked_sub(1).is_some_and(|i| smooth[i as usize]);
        let has_smooth = move |object: &u32| self.scene.objects.ids(*object).material_ids.iter().any(&is_smooth);
        let bounded = |object| Some((object, self.aggregate.bounds_of_instance(object)?));
        (0..count).filter(has_smooth).filter_map(bounded)
    }

    /// Whether the surface at `hit` can coincide with another object's glass (cemented lenses, liquid in its glass).
    pub fn is_touching(&self, hit: &Hit) -> bool {
        self.touching[hit.instance as usize].or_find(|| {
            self.is_glass(hit.instance) && self.aggregate.is_touching(hit.instance, |object| self.is_glass(object))
        })
    }

    /// Whether the surface at `hit` can coincide with a [backing](Self::is_backing) (glass on a table, the silver behind a
    /// mirror).
    pub fn is_in_contact(&self, hit: &Hit) -> bool {
        self.in_contact[hit.instance as usize].or_find(|| {
            self.has_backing(hit.instance)
                || self.aggregate.is_touching(hit.instance, |object| self.has_backing(object))
        })
    }

    /// Whether a surface with material `id` lets nothing pass: it is opaque or a mirror.
    pub fn is_backing(&self, id: u32) -> bool {
        id.checked_sub(1)
            .is_none_or(|i| matches!(self.scene.materials[i as usize].kind, Kind::Opaque | Kind::Mirror { .. }))
    }

    fn has_backing(&self, object: u32) -> bool {
        self.scene.objects.ids(object).material_ids.iter().any(|&id| self.is_backing(id))
    }

    /// A surface at the start of the ray that has not been crossed, of an object with a backing; objects that are glass all
    /// over are not asked.
    pub fn coincident_backing(&self, ray: &Ray, departures: &Departures) -> Option<Hit> {
        self.aggregate.coincident(ray, departures, |object| self.has_backing(object))
    }

    /// Whether rays of the camera itself pass through the surface at `hit`.
    pub fn is_hidden_from_camera(&self, hit: &Hit) -> bool {
        self.scene.objects.hides_some() && self.scene.objects.ids(hit.instance).appearance.hidden_from_camera
    }

    /// Whether some surface of a glass may lie in the box `[min, max]`, in render space, at any time.
    pub fn has_glass_in(&self, search: [DVec3; 2]) -> bool {
        self.aggregate.has_surface_in(search, |object| self.is_glass(object))
    }

    /// `material_id` at `hit`, 0 for none.
    #[inline]
    pub fn material_id(&self, hit: &Hit) -> u32 {
        let ids = self.scene.objects.material_ids(hit.instance);
        ids[self.slot(hit, ids) as usize]
    }

    #[inline]
    fn slot(&self, hit: &Hit, ids: &[u32]) -> u32 {
        // One material, one slot: no lookup of the face.
        if ids.len() == 1 { 0 } else { self.aggregate.slot(hit) }
    }

    /// The material at `hit`.
    pub fn material(&self, hit: &Hit) -> Option<&'a Material> {
        (self.material_id(hit) as usize).checked_sub(1).map(|i| &self.scene.materials[i])
    }

    /// The albedo of the surface at `hit`, whose material is `id` (1-based, 0 for none): linear Rec. 709.
    pub fn albedo(&self, hit: &Hit, id: u32) -> [f64; 3] {
        let program = match id.checked_sub(1) {
            Some(index) => &self.scene.materials[index as usize].appearance.albedo,
            None => &self.scene.display_color,
        };
        let [r, g, b, _] = self.evaluate(program, hit);
        [r, g, b].map(f64::from)
    }

    /// What the material `id` of the surface at `hit` emits: linear Rec. 709 by luminance; `None` where it has no emission.
    pub fn emission(&self, hit: &Hit, id: u32) -> Option<[f32; 3]> {
        let surface = self.surface_of(id);
        surface.emits().then(|| self.with_results(surface, hit, |results| surface.emission(results)))
    }

    /// Whether the surface at `hit`, whose material is `id`, is as its material says, something else, or not there.
    #[inline]
    pub fn presence(&self, hit: &Hit, id: u32) -> Presence {
        let Some(index) = id.checked_sub(1) else { return Presence::AsStated };
        let material = &self.scene.materials[index as usize];
        match (&material.kind, &material.appearance.opacity) {
            (Kind::PassThrough, _) => Presence::Absent,
            (_, None) => Presence::AsStated,
            (_, Some(opacity)) => {
                // A value that is no number is not below anything.
                let is_below = self.evaluate(&opacity.program, hit)[0] < opacity.limit;
                match (opacity.below, is_below) {
                    (Below::CutOut, true) => Presence::Absent,
                    (Below::Glass, false) => Presence::Opaque,
                    _ => Presence::AsStated,
                }
            }
        }
    }

    /// What the surface at `hit`, whose material is `id`, is made of at the wavelengths of a path. `interface` has the media
    /// on the side that the path comes from and on the other side; where the surface bounds none that counts, the index of
    /// its own shader takes the place of `ior_t`.
    pub fn surface<const N: usize>(
        &self,
        hit: &Hit,
        id: u32,
        wavelengths: &Wavelengths<N>,
        interface: Interface<N>,
    ) -> SurfaceAt<N> {
        let surface = self.surface_of(id);
        self.with_results(surface, hit, |results| surface.at(results, wavelengths, interface))
    }

    /// The same as far as light has to know it, which of most surfaces is little.
    #[inline]
    pub fn finish<const N: usize>(
        &self,
        hit: &Hit,
        id: u32,
        wavelengths: &Wavelengths<N>,
        interface: Interface<N>,
    ) -> Finish<N> {
        let other = || self.surface(hit, id, wavelengths, interface);
        self.surface_of(id).finish(wavelengths, interface, other)
    }

    /// The frame of what [`surface`](Self::surface) said of `hit`, met at `time`: its normal after the normal map, on the side of
    /// the geometric normal, and its tangent along u, turned as the material says.
    pub fn shading_frame<const N: usize>(
        &self,
        hit: &Hit,
        time: f64,
        normals: &UnitNormals,
        at: &SurfaceAt<N>,
    ) -> ShadingFrame {
        let authored = if at.has_direction() { self.aggregate.tangents(hit, time) } else { None };
        ShadingFrame::new(normals, authored, at.normal_map, at.rotation)
    }

    /// The share of the surface at `hit` that is there, 0..=1: 1 − this goes straight on, as if nothing were met. The same as
    /// [`SurfaceAt::presence`], for rays that only ask what is in their way.
    #[inline]
    pub fn share_present(&self, hit: &Hit, id: u32) -> f32 {
        let surface = self.surface_of(id);
        if surface.is_present() { 1.0 } else { self.with_results(surface, hit, |results| surface.presence(results)) }
    }

    /// Whether surfaces with material `id` are there all over and never smooth, as far as is known without a look.
    pub fn is_rough(&self, id: u32) -> bool {
        self.surface_of(id).is_rough()
    }

    #[inline]
    fn surface_of(&self, id: u32) -> &'a Surface {
        match id.checked_sub(1) {
            Some(index) => &self.scene.materials[index as usize].surface,
            None => &self.scene.display_surface,
        }
    }

    /// `f` of what the programs of a surface find at `hit`; none run where everything is constant.
    fn with_results<R>(&self, surface: &Surface, hit: &Hit, f: impl FnOnce(&[[f32; 4]]) -> R) -> R {
        match surface.looked_up() {
            Some(programs) => f(&programs.at(&self.scene.textures, self.primvars(hit))),
            None => f(&[]),
        }
    }

    fn evaluate(&self, program: &Program, hit: &Hit) -> [f32; 4] {
        program.at(&self.scene.textures, self.primvars(hit))
    }

    fn primvars(&self, hit: &Hit) -> impl Fn(u32) -> Option<[f32; 4]> {
        move |number| {
            let number = number as usize;
            let over_shape = self.aggregate.primvar(hit, number);
            over_shape.or_else(|| self.scene.objects.primvar(hit.instance, number))
        }
    }

    /// The medium behind the surface at `hit`, if its material `id` (1-based) fills a volume.
    pub fn inside(&self, hit: &Hit, id: u32) -> Option<Inside> {
        let index = id.checked_sub(1)?;
        match self.scene.materials[index as usize].kind {
            Kind::Dielectric { priority, thin_walled: false, .. } => {
                Some(Inside { instance: hit.instance, slot: id, medium: MediumId(index), priority })
            }
            _ => None,
        }
    }

    /// The media around the render-space point `p` at a time: those left more often than entered on the way out to infinity along
    /// one fixed ray. The nearest exit is the innermost medium.
    pub fn media_at(&self, p: DVec3, time: f64) -> MediaStack {
        let mut stack = MediaStack::new();
        if !self.scene.materials.iter().any(Material::has_interior) {
            return stack;
        }
        let mut crossings = Vec::new();
        let ray = Ray { origin: p, direction: PARITY_DIRECTION, time };
        self.aggregate.crossings(&ray, &mut |hit| {
            let id = self.material_id(hit);
            if let Some(inside) = self.inside(hit, id) {
                crossings.push((hit.distance, hit.leaving, inside));
            }
        });
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.instance.cmp(&b.2.instance)).then(a.1.cmp(&b.1)));
        // Going outwards, an entry must be left again before an exit counts as ours.
        let mut open: Vec<Inside> = Vec::new();
        let mut around = Vec::new();
        for (_, leaving, inside) in crossings {
            if !leaving {
                open.push(inside);
                continue;
            }
            // What is left here is what the stack would leave: a bubble that is a shell of the glass around it is no glass.
            let same_object = |entry: &Inside| entry.instance == inside.instance && entry.slot == inside.slot;
            let same_medium = |entry: &Inside| entry.medium == inside.medium;
            match open.iter().rposition(same_object).or_else(|| open.iter().rposition(same_medium)) {
                Some(i) => drop(open.remove(i)),
                None => around.push(inside),
            }
        }
        around.into_iter().rev().for_each(|inside| stack.enter(inside));
        stack
    }

    /// The nearest surface.
    pub fn intersect(&self, ray: &Ray, departures: &Departures) -> Option<Hit> {
        self.aggregate.intersect(ray, departures)
    }
}

/// The indices of all media at one wavelength.
#[derive(Clone, Debug)]
pub struct Media {
    jets: Vec<IorJet>,
}

impl Media {
    /// At `wavelength`, with the dispersion of every medium scaled by `scale` (1 physical, 0 none).
    ///
    /// Refuses a scale under which a medium has no index.
    pub fn at(scene: &Scene, wavelength: Wavelength, scale: f64) -> Result<Self> {
        let jet = |material: &Material| match &material.kind {
            Kind::Dielectric { dispersion, .. } => {
                let scaled = dispersion.scaled(scale).map_err(|problem| Error::scene(&material.path, problem))?;
                Ok(scaled.at(wavelength))
            }
            _ => Ok(IorJet::VACUUM),
        };
        Ok(Self { jets: scene.materials.iter().map(jet).collect::<Result<_>>()? })
    }

    /// Of `medium`; 1 outside everything.
    pub fn of(&self, medium: Option<MediumId>) -> IorJet {
        medium.map_or(IorJet::VACUUM, |id| self.jets[id.0 as usize])
    }
    /// Of the material with the 1-based `material_id`; 1 for none.
    pub fn of_material(&self, material_id: u32) -> IorJet {
        self.of(material_id.checked_sub(1).map(MediumId))
    }
}

#[cfg(test)]
mod tests;
