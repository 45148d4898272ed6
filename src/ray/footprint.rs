//! How far in wavelength a column may be trusted (MATH.md 2.7, 2.8).

use glam::DVec3;

use super::column::Column;
use super::scatter::{ScatterKind, Scattering};
use super::surface::{LinearNormals, NormalField, Normals, RevolvedNormals};

/// Accepted error of the first-order footprint, relative to its length.
const TOLERANCE: f64 = 0.05;

/// |δ_c| = |W²/(W²)'| with (W²)' = 2(gg' + q₁): the distance in nm to the wavelength where this interface goes over
/// between refraction and total reflection, to first order. Infinite where W² does not move, and at mirrors.
///
/// `col_lambda` is the wavelength column *before* the event: after the transfer to the surface.
pub fn critical_distance(s: &Scattering, col_lambda: &Column) -> f64 {
    if s.kind == ScatterKind::Mirror {
        return f64::INFINITY;
    }
    let dnormal = match s.field {
        NormalField::Flat => DVec3::ZERO,
        NormalField::Sphere { inv_radius } => col_lambda.point * inv_radius,
        NormalField::Linear { vector, gradient } => {
            LinearNormals::new(s.normal, vector, gradient).first(col_lambda.point)
        }
        NormalField::Revolved { vector, radial, around, second, third } => {
            RevolvedNormals::new(s.normal, vector, [radial, around], second, third).first(col_lambda.point)
        }
    };
    let dg = col_lambda.momentum.dot(s.normal) + s.momentum_in.dot(dnormal);
    let q1 = s.ior_t.ior * s.ior_t.dior_dlambda - s.ior_i.ior * s.ior_i.dior_dlambda;
    let rate = 2.0 * (s.g * dg + q1);
    if rate == 0.0 { f64::INFINITY } else { (s.w_squared / rate).abs() }
}

/// Half-width b in nm of the band over which p + p_λδ stands for the true position: the least of half the band,
/// 2ε|p_λ|/|p_λλ| with ε = 0.05, and the distance to the nearest change between refraction and total reflection.
///
/// ½|p_λλ|b² is then at most ε|p_λ|b. Nothing moves: half the band.
pub fn half_width(p_lambda: DVec3, p_lambda2: DVec3, half_band: f64, nearest_critical: f64) -> f64 {
    let curvature = p_lambda2.length();
    let accurate = if curvature > 0.0 { 2.0 * TOLERANCE * p_lambda.length() / curvature } else { f64::INFINITY };
    half_band.min(accurate).min(nearest_critical)
}
