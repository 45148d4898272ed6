//! The refraction formula of the derivation supplement itself, as an oracle for the momentum form.
//!
//! O. Elek, P. Bauszat, T. Ritschel, M. Magnor, H.-P. Seidel, "Spectral ray differentials. Supplemental material:
//! derivation", CGF 33(4), 2014, section 4. Written with unit directions and the ratio η = n₀/n₁, term by term as printed,
//! with what MATH.md 2.1 corrects or adds: the intermediate ½ω^(−1/2) means ½ω⁻¹ (finding 1, the final formula has it
//! right); the normal faces the ray, and n turns together with ∂n (finding 3); both media disperse,
//! η' = (n₀'n₁ − n₀n₁')/n₁² (finding 6).

use abbe::optics::IorJet;
use glam::DVec3;

/// d' and ∂d'/∂λ after refraction; `None` where ω² ≤ 0, about which the supplement says nothing (finding 5).
pub(crate) fn refract(
    d: DVec3,
    n: DVec3,
    ior_0: IorJet,
    ior_1: IorJet,
    d_lambda: DVec3,
    n_lambda: DVec3,
) -> Option<(DVec3, DVec3)> {
    let (n, n_lambda) = if d.dot(n) > 0.0 { (-n, -n_lambda) } else { (n, n_lambda) };
    let eta = ior_0.ior / ior_1.ior;
    let eta_lambda = (ior_0.dior_dlambda * ior_1.ior - ior_0.ior * ior_1.dior_dlambda) / (ior_1.ior * ior_1.ior);
    let theta = d.dot(n);
    let omega_squared = 1.0 - eta * eta + eta * eta * theta * theta;
    if omega_squared <= 0.0 {
        return None;
    }
    let omega = omega_squared.sqrt();
    let mu = eta * theta + omega;
    let theta_lambda = d_lambda.dot(n) + d.dot(n_lambda);
    let omega_lambda =
        (-eta * eta_lambda + eta * eta_lambda * theta * theta + eta * eta * theta * theta_lambda) / omega;
    let mu_lambda = eta_lambda * theta + eta * theta_lambda + omega_lambda;
    let refracted = eta * d - mu * n;
    let refracted_lambda = eta_lambda * d + eta * d_lambda - mu_lambda * n - mu * n_lambda;
    Some((refracted, refracted_lambda))
}
