//! What a ray has met, as light transport needs it: the surface's parameters with its normal and tangent in render space.

use glam::DVec3;

use super::walk::SurfacePoint;
use crate::bsdf::{Interface, Parameters};
use crate::geometry::{Hit, Ray};
use crate::sampler::PathSampler;
use crate::scene::view::View;
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// A surface at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met<const N: usize> {
    /// What it is made of.
    pub(super) parameters: Parameters<N>,
    /// Share of it that is there.
    pub(super) presence: f32,
    /// Shading normal, on the outside as authored.
    pub(super) normal: DVec3,
    /// Along what is anisotropic.
    pub(super) tangent: Option<DVec3>,
    /// Whether light comes from behind.
    pub(super) transmits: bool,
}

/// The surface that a ray met.
pub(super) fn at<const N: usize>(
    view: &View<'_>,
    ray: &Ray,
    met: &SurfacePoint,
    wavelengths: &Wavelengths<N>,
    interface: Interface<N>,
) -> Met<N> {
    let at = view.surface(&met.hit, met.material_id, wavelengths, interface);
    let (mut normal, mut tangent) = (met.surface.n_s, None);
    if at.has_direction() {
        let frame = view.shading_frame(&met.hit, ray.time, &met.surface, &at);
        (normal, tangent) = (frame.normal, Some(frame.tangent));
    }
    let parameters = at.parameters;
    Met {
        parameters,
        presence: at.presence,
        normal,
        tangent,
        transmits: parameters.transmission > 0.0 || !parameters.diffuse_transmission.is_black(),
    }
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
