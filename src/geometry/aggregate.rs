//! All instances of a scene under one tree.

use glam::DVec3;

use super::{Departures, Hit, Instance, Ray};
use crate::ray::LocalSurface;

/// Everything that rays can meet.
#[derive(Debug)]
pub struct Aggregate {}

impl Aggregate {
    /// Builds the tree over `instances` relative to `origin`, the point of the stage's world that is render space's zero.
    pub fn build(_instances: &[Instance], _origin: DVec3) -> Self {
        todo!()
    }

    /// The nearest surface that the ray meets; equal distances are decided by (instance, primitive).
    pub fn intersect(&self, _ray: &Ray, _departures: &Departures) -> Option<Hit> {
        todo!()
    }

    /// Calls `f` with every crossing of the ray with a surface, in no particular order.
    pub fn crossings(&self, _ray: &Ray, _f: &mut dyn FnMut(&Hit)) {
        todo!()
    }

    /// The hit point, on the surface to rounding, and the surface around it.
    pub fn local_surface(&self, _ray: &Ray, _hit: &Hit) -> (DVec3, LocalSurface) {
        todo!()
    }

    /// Texture coordinates at a hit; `None` where none are authored (always, for spheres).
    pub fn uv(&self, _hit: &Hit, _point: DVec3) -> Option<[f64; 2]> {
        todo!()
    }

    /// The material slot that was hit: 0 for faces in no subset, k + 1 for the k-th subset.
    pub fn slot(&self, _hit: &Hit) -> u32 {
        todo!()
    }
}
