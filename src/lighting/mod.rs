//! The lights of a view, in render space: choosing one and a point of it, what a ray meets of them, with what density.
//!
//! Lights that are not geometry (rectangle, disk, sphere, cylinder) are met by rays like surfaces; domes and distant lights by
//! rays that meet nothing; emission of materials where a ray meets the surface. Densities are per solid angle at the receiver.

use glam::{DVec3, Vec3};

use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::light::{Light, Shape};
use crate::scene::view::View;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// Which light: index into [`Lighting::light`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LightId(pub u32);

/// What light is sampled for.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Render space.
    pub point: DVec3,
    /// Geometric normal on the side of the path, unit; what matters is a hint where light may come from. `None` where light is received
    /// from both sides.
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
    /// Nothing else than sampling it finds it: parallel light, points, lines.
    pub is_delta: bool,
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
}

/// The lights of a view.
#[derive(Debug)]
pub struct Lighting<'a> {
    lights: Vec<Light>,
    groups: Vec<String>,
    _view: &'a View<'a>,
}

impl<'a> Lighting<'a> {
    /// Compiles the lights of the view's scene.
    pub fn new(view: &'a View<'a>) -> Result<Self> {
        let lights = view.scene.lights()?;
        Ok(Self { lights: lights.lights, groups: lights.groups, _view: view })
    }

    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// What a light is; `None` for the emission of a material.
    pub fn light(&self, id: LightId) -> Option<&Light> {
        self.lights.get(id.0 as usize)
    }

    /// Names of the light groups.
    pub fn groups(&self) -> &[String] {
        &self.groups
    }

    /// Chooses a light and a point of it. `u_light` chooses, `u` is the point's place.
    pub fn sample<const N: usize>(
        &self,
        _receiver: &Receiver,
        _wavelengths: &Wavelengths<N>,
        _u_light: f32,
        _u: [f32; 2],
    ) -> Option<LightSample<N>> {
        None
    }

    /// The density with which [`sample`](Self::sample) draws, for the receiver, the direction of a ray that met `light` at `distance`; 0 for
    /// delta lights.
    pub fn pdf(&self, _receiver: &Receiver, _wi: DVec3, _light: LightId, _distance: f64) -> f32 {
        0.0
    }

    /// The nearest light that is not geometry, before `limit`.
    pub fn intersect<const N: usize>(
        &self,
        _ray: &Ray,
        _limit: f64,
        _wavelengths: &Wavelengths<N>,
    ) -> Option<LightHit<N>> {
        None
    }

    /// What shines from infinitely far along the ray: every dome and distant light.
    pub fn environment<const N: usize>(
        &self,
        _ray: &Ray,
        wavelengths: &Wavelengths<N>,
        f: &mut dyn FnMut(LightHit<N>),
    ) {
        for (index, light) in self.lights.iter().enumerate() {
            if matches!(light.shape, Shape::Dome(_)) {
                let radiance = SampledSpectrum::from_fn(|i| light.emission.white(wavelengths.lane(i)) as f32);
                f(LightHit { light: LightId(index as u32), distance: f64::INFINITY, radiance });
            }
        }
    }

    /// What the surface at `hit` emits towards the ray that met it there: emissive materials and geometry lights.
    pub fn emitted<const N: usize>(
        &self,
        _ray: &Ray,
        _hit: &Hit,
        _wavelengths: &Wavelengths<N>,
    ) -> Option<LightHit<N>> {
        None
    }
}
