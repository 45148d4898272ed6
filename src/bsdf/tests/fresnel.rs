//! Reflectances against closed forms and against an independent method.

use crate::bsdf::film::FilmStack;
use crate::bsdf::fresnel::{Fresnel, conductor, dielectric, dielectric_mean, weighted_eta};
use crate::bsdf::{Film, Interface, Metal, Parameters};
use crate::spectrum::SampledSpectrum;

/// Complex numbers in f64, for the oracle.
type C = (f64, f64);
fn mul(a: C, b: C) -> C {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}
fn add(a: C, b: C) -> C {
    (a.0 + b.0, a.1 + b.1)
}
fn sub(a: C, b: C) -> C {
    (a.0 - b.0, a.1 - b.1)
}
fn div(a: C, b: C) -> C {
    let n = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / n, (a.1 * b.0 - a.0 * b.1) / n)
}
fn root(a: C) -> C {
    let m = a.0.hypot(a.1).sqrt();
    let half = 0.5 * a.1.atan2(a.0);
    let r = (m * half.cos(), m * half.sin());
    if r.1 < 0.0 { (-r.0, -r.1) } else { r }
}

/// Reflectance of layers by the characteristic matrix of the stack (Macleod, *Thin-Film Optical Filters*, ch. 2): tangential fields are carried
/// through the film by [[cos δ, −i sin δ/η], [−i η sin δ, cos δ]] (time factor e^{−iωt}), with the tilted admittances η = N cos θ (s), N/cos θ (p).
fn transfer_matrix(cos_i: f64, outside: f64, film: f64, thickness: f64, base: C, nm: f64) -> f64 {
    let sin2 = outside * outside * (1.0 - cos_i * cos_i);
    let cos = |n: C| root(sub((1.0, 0.0), div((sin2, 0.0), mul(n, n))));
    let (n0, n1) = ((outside, 0.0), (film, 0.0));
    let (c1, c2) = (cos(n1), cos(base));
    let delta = mul((2.0 * std::f64::consts::PI * thickness / nm, 0.0), mul(n1, c1));
    // cos and sin of a complex number
    let (sh, ch) = (delta.1.sinh(), delta.1.cosh());
    let cos_delta = (delta.0.cos() * ch, -delta.0.sin() * sh);
    let sin_delta = (delta.0.sin() * ch, delta.0.cos() * sh);
    let reflectance = |a0: C, a1: C, a2: C| {
        let i_sin = mul((0.0, -1.0), sin_delta);
        let b = add(cos_delta, mul(div(i_sin, a1), a2));
        let c = add(mul(mul(i_sin, a1), (1.0, 0.0)), mul(cos_delta, a2));
        let r = div(sub(mul(a0, b), c), add(mul(a0, b), c));
        r.0 * r.0 + r.1 * r.1
    };
    let c0 = (cos_i, 0.0);
    let s = reflectance(mul(n0, c0), mul(n1, c1), mul(base, c2));
    let p = reflectance(div(n0, c0), div(n1, c1), div(base, c2));
    0.5 * (s + p)
}

fn film_over(outside: f32, film: Film<1>) -> Parameters<1> {
    let ior_i = SampledSpectrum::splat(outside);
    Parameters {
        film: Some(film),
        interface: Interface { ior_i, ..Parameters::default().interface },
        ..Parameters::default()
    }
}

#[test]
fn airy_equals_the_transfer_matrix_and_the_sum_of_reflections() {
    for (outside, n_film, base) in [
        (1.0, 1.38, (1.52, 0.0)),
        (1.0, 2.1, (1.5, 0.0)),
        (1.5, 1.33, (1.0, 0.0)),
        (1.5, 1.2, (1.0, 0.0)),
        (1.0, 1.4, (0.2, 3.4)),
        (1.33, 2.4, (2.9, 3.1)),
    ] {
        for thickness in [40.0_f32, 137.0, 550.0] {
            for nm in [400.0_f32, 550.0, 700.0] {
                let nanometers = SampledSpectrum::splat(nm);
                let film = Film { weight: 1.0, thickness_nm: thickness, ior: n_film as f32, nanometers };
                let lane = |x: f64| SampledSpectrum::<1>::splat((x / outside) as f32);
                let stack =
                    FilmStack::new(&film_over(outside as f32, film), lane(base.0), lane(base.1)).expect("is a film");
                for cos_i in [1.0_f32, 0.9, 0.7, 0.4, 0.2, 0.05] {
                    let expected =
                        transfer_matrix(f64::from(cos_i), outside, n_film, f64::from(thickness), base, f64::from(nm));
                    let r = f64::from(stack.at(cos_i)[0]);
                    assert!(
                        (r - expected).abs() < 2e-5,
                        "{outside} {n_film} {base:?} {thickness} {nm} {cos_i}: {r} {expected}"
                    );
                }
            }
        }
    }
    // The sum of the reflected waves, r + t t' r₂₃ e^{2iβ} Σ (r' r₂₃ e^{2iβ})^m, at normal incidence.
    let (n1, n2, n3, thickness, nm) = (1.0_f64, 1.8, 1.5, 300.0, 530.0);
    let (r12, r23) = ((n1 - n2) / (n1 + n2), (n2 - n3) / (n2 + n3));
    let tt = 4.0 * n1 * n2 / ((n1 + n2) * (n1 + n2));
    let phase = 4.0 * std::f64::consts::PI * n2 * thickness / nm;
    let (mut sum, mut wave) = ((r12, 0.0), (tt * r23 * phase.cos(), tt * r23 * phase.sin()));
    for _ in 0..200 {
        sum = add(sum, wave);
        wave = mul(wave, (-r12 * r23 * phase.cos(), -r12 * r23 * phase.sin()));
    }
    let film = Film { weight: 1.0, thickness_nm: 300.0, ior: 1.8, nanometers: SampledSpectrum::splat(530.0) };
    let stack = FilmStack::new(&film_over(1.0, film), SampledSpectrum::<1>::splat(1.5), SampledSpectrum::ZERO).unwrap();
    assert!((f64::from(stack.at(1.0)[0]) - (sum.0 * sum.0 + sum.1 * sum.1)).abs() < 1e-6);
}

#[test]
fn a_film_without_thickness_or_contrast_is_no_film() {
    for cos_i in [1.0, 0.6, 0.2, 0.02] {
        let bare = dielectric(cos_i, 1.5);
        let film =
            |thickness_nm, ior| Film { weight: 1.0, thickness_nm, ior, nanometers: SampledSpectrum::splat(550.0) };
        let at = |film| {
            let parameters = film_over(1.0, film);
            Fresnel::of_dielectric(&parameters, SampledSpectrum::<1>::splat(1.5)).at(cos_i)[0]
        };
        assert!((at(film(0.0, 1.3)) - bare).abs() < 1e-7);
        assert!((at(film(1e-3, 1.3)) - bare).abs() < 2e-5);
        assert!((at(film(400.0, 1.5)) - bare).abs() < 2e-5, "as the base");
        assert!((at(film(400.0, 1.0)) - bare).abs() < 2e-5, "as the air");
    }
}

#[test]
fn dielectrics_at_normal_incidence_brewster_and_critical_angles() {
    for eta in [0.4_f32, 0.75, 1.000_001, 1.33, 1.5, 2.4] {
        let f0 = (eta - 1.0) / (eta + 1.0);
        assert!((dielectric(1.0, eta) - f0 * f0).abs() < 1e-7);
        assert!((dielectric(0.0, eta) - 1.0).abs() < 1e-7);
        // At tan θ = η only s is reflected: R = ½ ((1 − η²)/(1 + η²))².
        let brewster = 1.0 / (1.0 + eta * eta).sqrt();
        let s = (1.0 - eta * eta) / (1.0 + eta * eta);
        assert!((dielectric(brewster, eta) - 0.5 * s * s).abs() < 1e-6, "{eta}");
    }
    // sin θ_c = η
    let critical = (1.0_f32 - 0.64).sqrt();
    assert_eq!(dielectric(critical * 0.999, 0.8).to_bits(), 1.0_f32.to_bits());
    let before = dielectric(critical * 1.001, 0.8);
    assert!(before < 0.9 && before > 0.5, "{before}");
    // Equal indices reflect nothing, at any angle.
    assert_eq!(dielectric(0.3, 1.0).to_bits(), 0.0_f32.to_bits());
}

#[test]
fn the_mean_over_diffuse_light_is_the_integral() {
    for eta in [0.3_f64, 0.6, 0.9, 0.9999, 1.0001, 1.0008, 1.02, 1.2, 1.5, 2.0, 3.5] {
        let mut sum = 0.0;
        const POINTS: usize = 200_000;
        for i in 0..POINTS {
            // Points crowd at grazing angles.
            let t = (i as f64 + 0.5) / POINTS as f64;
            let c = t * t;
            let inside = eta * eta - 1.0 + c * c;
            let f = if inside <= 0.0 {
                1.0
            } else {
                let w = inside.sqrt();
                0.5 * (((c - w) / (c + w)).powi(2) + ((eta * eta * c - w) / (eta * eta * c + w)).powi(2))
            };
            sum += 2.0 * f * c * 2.0 * t / POINTS as f64;
        }
        let mean = f64::from(dielectric_mean(eta as f32));
        assert!((mean - sum).abs() < 3e-6, "{eta}: {mean} {sum}");
    }
}

#[test]
fn metals_at_normal_incidence_and_without_absorption() {
    for (n, k) in [(0.2_f32, 3.4_f32), (1.5, 0.0), (2.9, 3.1), (0.05, 4.2)] {
        let f0 = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
        assert!((conductor(1.0, n, k) - f0).abs() < 1e-6, "{n} {k}");
        assert!((conductor(0.0, n, k) - 1.0).abs() < 1e-6);
    }
    for cos_i in [0.9, 0.5, 0.1] {
        assert!((conductor(cos_i, 1.5, 0.0) - dielectric(cos_i, 1.5)).abs() < 1e-6);
        // Against the amplitudes in complex numbers.
        let (n, k) = (0.9, 2.1);
        let matrix = transfer_matrix(f64::from(cos_i), 1.0, 1.0, 0.0, (n, k), 500.0);
        assert!((f64::from(conductor(cos_i, n as f32, k as f32)) - matrix).abs() < 1e-6);
    }
}

#[test]
fn the_tint_of_a_metal_is_met_at_82_degrees() {
    let f0 = SampledSpectrum([0.9_f32, 0.5, 0.1]);
    let f82 = SampledSpectrum([1.0_f32, 0.7, 0.2]);
    let parameters = Parameters { metal: Metal::Tint { f0, f82 }, ..Parameters::default() };
    let fresnel = Fresnel::of_metal(&parameters);
    let rise = (6.0_f32 / 7.0).powi(5);
    for lane in 0..3 {
        assert!((fresnel.at(1.0)[lane] - f0[lane]).abs() < 1e-6);
        let schlick = f0[lane] + (1.0 - f0[lane]) * rise;
        assert!((fresnel.at(1.0 / 7.0)[lane] - schlick * f82[lane]).abs() < 1e-6);
        let mean: f64 = (0..10_000)
            .map(|i| {
                let mu = (f64::from(i) + 0.5) / 10_000.0;
                f64::from(fresnel.at(mu as f32)[lane]) * 2.0 * mu / 10_000.0
            })
            .sum();
        assert!(
            (f64::from(fresnel.metal_mean()[lane]) - mean).abs() < 2e-3,
            "the clamp at 0 is not in the closed form"
        );
    }
}

#[test]
fn a_constant_metal_reflects_alike_at_every_angle() {
    let f0 = SampledSpectrum([0.9_f32, 0.5, 0.0]);
    let fresnel = Fresnel::of_metal(&Parameters { metal: Metal::Constant { f0 }, ..Parameters::default() });
    for cos_i in [0.0, 0.1, 0.5, 1.0] {
        assert_eq!(fresnel.at(cos_i), f0);
    }
    assert_eq!(fresnel.metal_mean(), f0);
}

#[test]
fn specular_weight_scales_the_reflectance_at_normal_incidence() {
    for eta in [0.7, 1.3, 1.5] {
        for weight in [0.0, 0.3, 1.0, 2.0] {
            let scaled = dielectric(1.0, weighted_eta(eta, weight));
            assert!((scaled - weight * dielectric(1.0, eta)).abs() < 1e-6);
            assert!((weighted_eta(eta, weight) - 1.0) * (eta - 1.0) >= 0.0);
        }
    }
}
