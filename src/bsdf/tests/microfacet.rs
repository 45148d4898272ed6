//! GGX facets against what a distribution must fulfil, and against a closed form.

use glam::Vec3;

use super::support::direction;
use crate::bsdf::albedo::{At, Roughness};
use crate::bsdf::microfacet::Ggx;

/// Sums over the hemisphere of normals, in cells that crowd at its pole.
fn over_normals(mut f: impl FnMut(Vec3) -> f32) -> f64 {
    const HEIGHTS: usize = 600;
    const AZIMUTHS: usize = 360;
    let mut sum = 0.0;
    for i in 0..HEIGHTS {
        // 1 − cos θ = t³
        let t = (i as f64 + 0.5) / HEIGHTS as f64;
        let z = 1.0 - t * t * t;
        let sine = (1.0 - z * z).sqrt();
        for j in 0..AZIMUTHS {
            let phi = 2.0 * std::f64::consts::PI * (j as f64 + 0.5) / AZIMUTHS as f64;
            let h = Vec3::new((sine * phi.cos()) as f32, (sine * phi.sin()) as f32, z as f32);
            sum += f64::from(f(h)) * 3.0 * t * t;
        }
    }
    sum * 2.0 * std::f64::consts::PI / (HEIGHTS * AZIMUTHS) as f64
}

#[test]
fn facets_cover_the_surface_and_the_visible_ones_its_projection() {
    for alpha in [[0.1; 2], [0.5; 2], [1.0; 2], [0.15, 0.6]] {
        let ggx = Ggx::new(alpha);
        let covered = over_normals(|h| ggx.d(h) * h.z);
        assert!((covered - 1.0).abs() < 1e-3, "{alpha:?}: {covered}");
        for cos in [1.0, 0.6, 0.2] {
            let visible = over_normals(|h| ggx.visible_pdf(direction(cos), h));
            assert!((visible - 1.0).abs() < 2e-3, "{alpha:?} {cos}: {visible}");
        }
    }
}

#[test]
fn the_roughest_facets_reflect_one_minus_ln_2_at_normal_incidence() {
    // D = 1/π, Λ(wo) = 0, 1 + Λ(wi) = (1 + 1/μ)/2: E = ∫₀¹ μ/(1 + μ) dμ.
    let e = At::cosine(1.0).of(&Roughness::new(1.0).white());
    assert!((e - (1.0 - std::f32::consts::LN_2)).abs() < 1e-4, "{e}");
}

#[test]
fn normals_are_drawn_where_they_are_visible() {
    for alpha in [[0.002; 2], [0.3; 2], [1.0; 2], [0.05, 0.8]] {
        let ggx = Ggx::new(alpha);
        for cos in [1.0, 0.4, 1e-4] {
            let wo = direction(cos);
            for i in 0..64 {
                let u = [(i % 8) as f32 / 7.999, (i / 8) as f32 / 7.999].map(|u: f32| u.min(1.0 - f32::EPSILON));
                for h in [ggx.sample_visible(wo, u), ggx.sample_reflecting(wo, u)] {
                    assert!((h.length() - 1.0).abs() < 1e-5 && h.z >= 0.0, "{h}");
                    assert!(wo.dot(h) > -1e-6, "{alpha:?} {cos}: {h}");
                }
            }
        }
    }
}
