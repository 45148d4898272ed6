//! Smooth interfaces: probabilities, weights, walls.

use crate::bsdf::fresnel::dielectric;
use crate::bsdf::{Bsdf, BsdfSample, Event, Interface, Metal, Parameters, SMOOTH_ALPHA, Scattered};
use crate::spectrum::SampledSpectrum;

use super::support::direction;

fn close<const N: usize>(a: SampledSpectrum<N>, b: SampledSpectrum<N>) {
    for lane in 0..N {
        assert!((a[lane] - b[lane]).abs() < 1e-5 * (1.0 + b[lane].abs()), "{a:?} {b:?}");
    }
}

/// The reflected and the other branch of a smooth surface.
fn branches<const N: usize>(bsdf: &Bsdf<N>, cos: f32) -> (Option<BsdfSample<N>>, Option<BsdfSample<N>>) {
    (bsdf.sample(direction(cos), 0.0, [0.3, 0.7]), bsdf.sample(direction(cos), 0.999_999, [0.3, 0.7]))
}

#[test]
fn branches_are_chosen_by_the_mean_and_weighted_by_lane() {
    let interface = Interface { ior_i: SampledSpectrum::ONE, ior_t: SampledSpectrum([1.50, 1.52, 1.55, 1.6]) };
    let bsdf = Bsdf::new(&Parameters::glass(interface, 0.0));
    assert!(bsdf.is_smooth());
    for cos in [1.0, 0.5, 0.1] {
        let r = interface.ior_t.map(|n| dielectric(cos, n));
        let (reflected, refracted) = branches(&bsdf, cos);
        let (reflected, refracted) = (reflected.unwrap(), refracted.unwrap());
        assert_eq!((reflected.scattered, reflected.event), (Scattered::Mirror, Event::SpecularReflection));
        assert_eq!((refracted.scattered, refracted.event), (Scattered::Refract, Event::SpecularTransmission));
        close(reflected.pdf, SampledSpectrum::splat(r.mean()));
        close(reflected.weight, r * (1.0 / r.mean()));
        close(refracted.pdf, SampledSpectrum::splat(1.0 - r.mean()));
        let radiance = interface.ior_t.map(|n| 1.0 / (n * n));
        close(refracted.weight, r.map(|r| 1.0 - r) * radiance * (1.0 / (1.0 - r.mean())));
    }
}

#[test]
fn lanes_that_reflect_totally_have_no_share_in_refraction() {
    // Between the critical angles of the lanes.
    let interface = Interface { ior_i: SampledSpectrum([1.5, 1.6]), ior_t: SampledSpectrum::ONE };
    let cos = (1.0_f32 - 0.4096).sqrt();
    let (_, refracted) = branches(&Bsdf::new(&Parameters::glass(interface, 0.0)), cos);
    let refracted = refracted.unwrap();
    assert!(refracted.weight[0] > 0.0);
    assert_eq!(refracted.weight[1].to_bits(), 0.0_f32.to_bits());
    // With the lanes exchanged the hero cannot go there.
    let interface = Interface { ior_i: SampledSpectrum([1.6, 1.5]), ..interface };
    let (reflected, refracted) = branches(&Bsdf::new(&Parameters::glass(interface, 0.0)), cos);
    assert!(refracted.is_none() && reflected.is_some());
    // All of it is reflected where all lanes do.
    let interface = Interface { ior_i: SampledSpectrum([1.6, 1.5]), ior_t: SampledSpectrum::ONE };
    let (a, b) = branches(&Bsdf::new(&Parameters::glass(interface, 0.0)), 0.3);
    for sample in [a.unwrap(), b.unwrap()] {
        assert_eq!(sample.scattered, Scattered::Mirror);
        close(sample.weight, SampledSpectrum::ONE);
    }
}

#[test]
fn walls_sum_the_reflections_between_their_faces() {
    let interface = Interface { ior_i: SampledSpectrum::<1>::ONE, ior_t: SampledSpectrum::splat(1.5) };
    for tint in [1.0_f32, 0.6] {
        let parameters = Parameters {
            thin_walled: true,
            transmission_tint: SampledSpectrum::splat(tint),
            ..Parameters::glass(interface, 0.0)
        };
        for cos in [1.0, 0.4, 0.1] {
            let r = dielectric(cos, 1.5);
            // Light in the wall, pass by pass.
            let (mut reflected, mut transmitted, mut inside) = (r, 0.0, 1.0 - r);
            for _ in 0..200 {
                inside *= tint;
                transmitted += inside * (1.0 - r);
                inside *= r * tint;
                reflected += inside * (1.0 - r);
                inside *= r;
            }
            let (a, b) = branches(&Bsdf::new(&parameters), cos);
            let (a, b) = (a.unwrap(), b.unwrap());
            assert_eq!((b.scattered, b.event), (Scattered::Straight, Event::Straight));
            close(a.weight * a.pdf, SampledSpectrum::splat(reflected));
            close(b.weight * b.pdf, SampledSpectrum::splat(transmitted));
            if tint > 0.9 {
                close(a.weight * a.pdf, SampledSpectrum::splat(2.0 * r / (1.0 + r)));
                close(b.weight * b.pdf, SampledSpectrum::splat((1.0 - r) / (1.0 + r)));
            }
        }
    }
}

#[test]
fn smoothness_begins_at_its_alpha() {
    let white = Metal::Tint { f0: SampledSpectrum::<1>::ONE, f82: SampledSpectrum::ONE };
    assert!(Bsdf::new(&Parameters::metal(white, SMOOTH_ALPHA * 0.99)).is_smooth());
    assert!(!Bsdf::new(&Parameters::metal(white, SMOOTH_ALPHA * 1.01)).is_smooth());
    let glass = Interface { ior_i: SampledSpectrum::<1>::ONE, ior_t: SampledSpectrum::splat(1.5) };
    assert!(!Bsdf::new(&Parameters::plastic(SampledSpectrum::ONE, glass, 0.0)).is_smooth(), "it has a diffuse base");
    assert!(Bsdf::new(&Parameters::plastic(SampledSpectrum::ZERO, glass, 0.0)).is_smooth());
}

#[test]
fn nothing_is_seen_from_below() {
    let bsdf = Bsdf::new(&Parameters::diffuse(SampledSpectrum::<4>::ONE));
    for cos in [-0.5, 0.0] {
        assert!(bsdf.sample(direction(cos), 0.5, [0.5; 2]).is_none());
        assert!(bsdf.evaluate(direction(cos), direction(0.5)).value().is_black());
    }
    assert!(bsdf.evaluate(direction(0.5), direction(-0.5)).value().is_black(), "opaque");
}

#[test]
fn matched_indices_let_everything_pass() {
    for alpha in [0.0, 0.3] {
        let interface = Interface { ior_i: SampledSpectrum::<4>::splat(1.5), ior_t: SampledSpectrum::splat(1.5) };
        let bsdf = Bsdf::new(&Parameters::glass(interface, alpha));
        let (a, b) = branches(&bsdf, 0.3);
        for sample in [a.unwrap(), b.unwrap()] {
            assert_eq!(sample.scattered, Scattered::Refract);
            close(sample.weight, SampledSpectrum::ONE);
        }
    }
}
