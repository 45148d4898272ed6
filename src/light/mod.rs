//! Lights (UsdLux) as they are in the stage's world: shapes, emission, shaping, shadows.
//!
//! Conventions: lengths in stage units; directions of emission are directions of travel, away from the light; rectangle, disk
//! and distant light shine along the light's −z, a cylinder lies along x; emission counts in luminance, see [`emission`].
//! Everything here is checked when it is made (`scene::lights`): numbers are finite, areas and luminances positive.
//! Sources: the documentation of UsdLux (OpenUSD 26.11, `pxr/usd/usdLux/schema.usda`) and, where that is silent, the
//! reference renderer hdEmbree; each deviation says so.

pub mod emission;
pub mod environment;
pub mod ies;
mod shadow;
mod shape;
mod shaping;
mod temperature;

use std::f64::consts::PI;

pub use emission::{Emission, Spectrum, White};
pub use environment::Layout;
use glam::{DMat3, DVec3};
pub use shadow::Shadow;
pub use shape::{Distant, Dome, Ellipsoid, Geometry, MaterialSync, Patch, Shape, Tube};
pub use shaping::{Shaping, ShapingProfile};
pub use temperature::{luminance, rgb as rgb_of_temperature};

/// A light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Prim path.
    pub path: String,
    /// What shines, in the stage's world.
    pub shape: Shape,
    /// What it emits where nothing shapes it: radiance of surfaces and domes, irradiance at normal incidence of parallel light.
    /// What `normalize` asks for is in it, but for [`Shape::Geometry`].
    pub emission: Emission,
    /// By direction; all directions alike if absent.
    pub shaping: Option<Shaping>,
    /// The light's space from the world, for directions: what [`shaping`](Self::shaping) is in.
    pub light_from_world: DMat3,
    /// Shadows in it.
    pub shadow: Shadow,
    /// Factor on what diffuse materials receive.
    pub diffuse: f64,
    /// Factor on what specular materials receive.
    pub specular: f64,
    /// Index into the light groups' names.
    pub group: Option<u32>,
    /// Link set of the objects that it illuminates; all if absent.
    pub illuminates: Option<u32>,
    /// Link set of the objects that cast shadows in it; all if absent.
    pub shadowed_by: Option<u32>,
}

impl Light {
    /// Whether diffuse and specular materials receive other than what the light is.
    pub fn has_factors(&self) -> bool {
        #[expect(clippy::float_cmp, reason = "1 is what nobody authored")]
        let factors = self.diffuse != 1.0 || self.specular != 1.0;
        factors
    }

    /// Whether it is blocked by what blocks rays, all of it and nothing else.
    pub fn has_natural_shadows(&self) -> bool {
        self.shadow.is_natural() && self.shadowed_by.is_none()
    }

    /// What the emission is multiplied by in a direction of travel, a unit vector in the world.
    pub fn shaped(&self, direction: DVec3) -> [f64; 3] {
        match &self.shaping {
            None => [1.0; 3],
            Some(shaping) => shaping.weight((self.light_from_world * direction).normalize()),
        }
    }

    /// All that a surface emits, linear Rec. 709 by luminance times area times steradian, textures taken as white; `None` of
    /// what has no surface of its own.
    ///
    /// Without shaping exactly π A times the emission; with it by a sum over directions, good to a few per cent where
    /// the shaping is sharp: enough to choose between lights.
    pub fn power(&self) -> Option<[f64; 3]> {
        const HEIGHTS: u32 = 64;
        const TURNS: u32 = 64;
        let area = self.shape.area()?;
        if self.shaping.is_none() {
            return Some(self.emission.rgb.map(|channel| PI * area * channel));
        }
        let mut sum = [0.0; 3];
        let world_from_light = self.light_from_world.inverse();
        for i in 0..HEIGHTS {
            // Equal steps of the angle to the axis, weighted with the sine: cones are narrow.
            let theta = PI * (f64::from(i) + 0.5) / f64::from(HEIGHTS);
            for j in 0..TURNS {
                let phi = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(TURNS);
                let (sine, cosine) = (libm::sin(theta), libm::cos(theta));
                // Even in the world where the transform is a similarity; elsewhere a start is what counts.
                let local = DVec3::new(sine * libm::cos(phi), sine * libm::sin(phi), -cosine);
                let direction = (world_from_light * local).normalize();
                // dω in the world of dω in the light's space: det M / |M d|³.
                let stretch = (world_from_light * local).length();
                let density = world_from_light.determinant().abs() / (stretch * stretch * stretch);
                let weight = sine * density * self.shape.projected_area(direction)?;
                for (sum, shaped) in sum.iter_mut().zip(self.shaped(direction)) {
                    *sum += weight * shaped;
                }
            }
        }
        let cell = PI / f64::from(HEIGHTS) * (2.0 * PI / f64::from(TURNS));
        Some(std::array::from_fn(|i| self.emission.rgb[i] * sum[i] * cell))
    }
}
