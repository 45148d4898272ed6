//! The wavelength column once more in single precision: what `f64` buys. Events are those of the `f64` chain, rounded.

use glam::{DVec3, Vec3};

use crate::optics::IorJet;
use crate::ray::{NormalField, RayStart, ScatterKind, Step};

/// ∂p/∂λ at the end of the logged chain, by the formulas of [`crate::ray`] in `f32`.
pub(super) fn lambda_column(start: &RayStart, medium: &IorJet, log: &[Step]) -> DVec3 {
    let mut point = Vec3::ZERO;
    let mut momentum = start.direction.as_vec3() * medium.dior_dlambda as f32;
    for Step { transfer, scattering } in log {
        let d = transfer.direction.as_vec3();
        let n_g = transfer.n_g.as_vec3();
        let (ior, dior) = (transfer.medium.ior as f32, transfer.medium.dior_dlambda as f32);
        let v = point + (momentum - d * dior) / ior * transfer.distance as f32;
        point = v - d * (n_g.dot(v) / n_g.dot(d));
        let Some(s) = scattering else { break };
        let normal = s.normal.as_vec3();
        let dnormal = match s.field {
            NormalField::Flat => Vec3::ZERO,
            NormalField::Sphere { inv_radius } => point * inv_radius as f32,
            NormalField::Linear { vector, gradient } => {
                let ds = gradient.as_mat3() * point;
                (ds - normal * normal.dot(ds)) / vector.length() as f32
            }
            NormalField::Revolved { vector, radial, around, second, .. } => {
                let along = |covector: glam::DVec3, rate: f64| {
                    let covector = covector.as_vec3();
                    covector * (rate as f32 * covector.dot(point))
                };
                let ds = along(radial, second[0]) + along(around, second[1]);
                (ds - normal * normal.dot(ds)) / vector.length() as f32
            }
        };
        let dg = momentum.dot(normal) + s.momentum_in.as_vec3().dot(dnormal);
        let deflection = s.deflection as f32;
        let ddeflection = match s.kind {
            ScatterKind::Refraction => {
                let source = s.ior_t.ior * s.ior_t.dior_dlambda - s.ior_i.ior * s.ior_i.dior_dlambda;
                (source as f32 + dg * deflection) / s.w_squared.sqrt() as f32
            }
            ScatterKind::TotalReflection | ScatterKind::Mirror => 2.0 * dg,
        };
        momentum -= normal * ddeflection + dnormal * deflection;
    }
    point.as_dvec3()
}
