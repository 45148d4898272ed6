//! What a ray has met, as the path tracer needs it: the surface's parameters with its normal and tangent in render space.

use glam::DVec3;

use crate::bsdf::{Interface, Metal, Parameters};
use crate::geometry::{Hit, Ray};
use crate::integrator::walk::SurfacePoint;
use crate::sampler::PathSampler;
use crate::scene::material::Kind;
use crate::scene::view::{Presence, View};
use crate::spectrum::reflectance::Reflectance;
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
    _ray: &Ray,
    met: &SurfacePoint,
    wavelengths: &Wavelengths<N>,
    interface: Interface<N>,
) -> Met<N> {
    let color = view.albedo(&met.hit, met.material_id).map(|c| c as f32);
    let color = Reflectance::of_color(color).at(wavelengths);
    let kind = met.material_id.checked_sub(1).map(|i| &view.scene.materials[i as usize].kind);
    let parameters = match kind {
        _ if met.presence == Presence::Opaque => Parameters::diffuse(color),
        Some(Kind::Dielectric { thin_walled, .. }) => {
            Parameters { thin_walled: *thin_walled, ..Parameters::glass(interface, 0.0) }
        }
        Some(Kind::Mirror { .. }) => Parameters::metal(Metal::Tint { f0: color, f82: SampledSpectrum::ONE }, 0.0),
        _ => Parameters::diffuse(color),
    };
    Met {
        parameters,
        presence: if met.presence == Presence::Absent { 0.0 } else { 1.0 },
        normal: met.surface.n_s,
        tangent: None,
        transmits: parameters.transmission > 0.0,
    }
}

/// What a surface in the way of sampled light lets through; `None`: everything.
pub(super) fn through<const N: usize>(
    view: &View<'_>,
    hit: &Hit,
    _wavelengths: &Wavelengths<N>,
    numbers: &PathSampler,
) -> Option<SampledSpectrum<N>> {
    let id = view.material_id(hit);
    let _ = numbers;
    match view.presence(hit, id) {
        Presence::Absent => None,
        _ => Some(SampledSpectrum::ZERO),
    }
}
