//! What a ray has met, as light transport needs it: the surface's normal and tangent in render space, what it lets through.

use glam::DVec3;

use crate::geometry::{Hit, Ray};
use crate::ray::UnitNormals;
use crate::sampler::PathSampler;
use crate::scene::material::SurfaceAt;
use crate::scene::view::View;
use crate::spectrum::SampledSpectrum;

/// Shading normal of the surface that a ray met, on the outside as authored, and the tangent along which it is anisotropic; `at` has
/// the say in them if it is [directed](SurfaceAt::directed).
#[inline]
pub(super) fn normal_and_tangent<const N: usize>(
    view: &View<'_>,
    ray: &Ray,
    hit: &Hit,
    normals: &UnitNormals,
    at: Option<&SurfaceAt<N>>,
) -> (DVec3, Option<DVec3>) {
    let Some(at) = at else { return (normals.n_s, None) };
    let frame = view.shading_frame(hit, ray.time, normals, at);
    (frame.normal, Some(frame.tangent))
}

/// Tells the crossings of one straight way apart: a ray enters and leaves a sphere by the same primitive.
pub(super) fn crossing(hit: &Hit) -> u64 {
    u64::from(hit.leaving) << 63 | u64::from(hit.instance) << 32 | u64::from(hit.primitive)
}

/// What a surface in the way of sampled light lets through; `None`: everything.
///
/// `numbers` decides for each surface by itself whether a share of it is there.
pub(super) fn through<const N: usize>(view: &View<'_>, hit: &Hit, numbers: &PathSampler) -> Option<SampledSpectrum<N>> {
    let share = view.share_present(hit, view.material_id(hit));
    let is_there = share >= 1.0 || numbers.of(crossing(hit)) < share;
    is_there.then_some(SampledSpectrum::ZERO)
}
