//! Directions are drawn with the density that is stated, and weighted by it.

use super::furnace::{interface, white_metal};
use super::support::{Histogram, Random, direction};
use crate::bsdf::{Bsdf, Coat, Interface, Metal, Parameters, Scattered, Sheen};
use crate::spectrum::SampledSpectrum;

fn surfaces() -> Vec<(&'static str, Parameters<1>)> {
    let color = SampledSpectrum::splat(0.6);
    let coat = Some(Coat { alpha: [0.2; 2], color: SampledSpectrum::splat(0.7), ..Coat::default() });
    let sheen = Some(Sheen { weight: 0.8, color, roughness: 0.4 });
    let plastic = Parameters::plastic(color, interface(1.0, 1.5), 0.3);
    vec![
        ("diffuse", Parameters { diffuse_roughness: 0.7, ..Parameters::diffuse(color) }),
        ("leaf", Parameters { diffuse_transmission: color * 0.5, thin_walled: true, ..plastic }),
        ("metal", Parameters::metal(white_metal(), 0.3)),
        ("rough metal", Parameters::metal(white_metal(), 0.9)),
        ("brushed metal", Parameters { alpha: [0.15, 0.6], ..Parameters::metal(white_metal(), 0.0) }),
        ("plastic", plastic),
        ("glass", Parameters::glass(interface(1.0, 1.5), 0.3)),
        ("glass from within", Parameters::glass(interface(1.5, 1.0), 0.3)),
        ("faint glass", Parameters::glass(interface(1.0, 1.25), 0.7)),
        ("wall", Parameters { thin_walled: true, ..Parameters::glass(interface(1.0, 1.5), 0.4) }),
        ("coated metal", Parameters { coat, ..Parameters::metal(white_metal(), 0.4) }),
        ("all", Parameters { coat, sheen, metalness: 0.4, transmission: 0.5, ..plastic }),
    ]
}

#[test]
fn directions_follow_the_density() {
    let surfaces = surfaces();
    let cosines = [0.95, 0.5, 0.15];
    let tests = (surfaces.len() * cosines.len()) as f64;
    for (name, parameters) in &surfaces {
        let bsdf = Bsdf::new(parameters);
        for cos in cosines {
            let histogram = Histogram::new(&bsdf, direction(cos), 60_000);
            let p = histogram.p_value();
            // Šidák: 1 in 100 for all of them together.
            assert!(p > 1.0 - 0.99_f64.powf(1.0 / tests), "{name} at {cos}: p = {p}");
            let total = histogram.total();
            assert!(total < 1.003, "{name} at {cos}: {total}");
            assert!((total - histogram.drawn()).abs() < 0.01, "{name} at {cos}: {total} {}", histogram.drawn());
        }
    }
}

#[test]
fn diffuse_densities_integrate_to_one() {
    let bsdf = Bsdf::new(&surfaces()[0].1);
    assert!((Histogram::new(&bsdf, direction(0.5), 1).total() - 1.0).abs() < 1e-3);
}

#[test]
fn samples_are_weighted_by_all_lobes() {
    let mut random = Random(5);
    for (name, parameters) in &surfaces() {
        let bsdf = Bsdf::new(parameters);
        for _ in 0..300 {
            let wo = direction(random.next().max(0.05));
            let Some(sample) = bsdf.sample(wo, random.next(), [random.next(), random.next()]) else { continue };
            let Scattered::Toward(wi) = sample.scattered else { continue };
            let evaluated = bsdf.evaluate(wo, wi);
            let pdf = evaluated.pdf.hero();
            let near = |a: f32, b: f32| (a - b).abs() <= 1e-4 * b.abs().max(1e-3);
            assert!(near(sample.pdf.hero(), pdf), "{name}");
            assert!(near(sample.weight.hero(), evaluated.value().hero() / pdf), "{name}");
            assert!(near(sample.diffuse.hero(), evaluated.diffuse.hero() / pdf), "{name}");
        }
    }
}

/// The surfaces of a dispersive glass at wavelengths that begin with lane `first`.
fn dispersive(first: usize) -> Parameters<4> {
    let ior = [1.50, 1.53, 1.57, 1.62];
    let ior_t = SampledSpectrum::from_fn(|lane| ior[(lane + first) % 4]);
    Parameters::glass(Interface { ior_i: SampledSpectrum::ONE, ior_t }, 0.25)
}

#[test]
fn every_lane_has_the_density_that_it_would_have_as_the_hero() {
    let mut random = Random(3);
    let turned: [Bsdf<4>; 4] = std::array::from_fn(|first| Bsdf::new(&dispersive(first)));
    let mut differ = 0;
    for _ in 0..500 {
        let wo = direction(random.next().max(0.1));
        let Some(sample) = turned[0].sample(wo, random.next(), [random.next(), random.next()]) else { continue };
        let Scattered::Toward(wi) = sample.scattered else { panic!("is rough") };
        let all = turned[0].evaluate(wo, wi);
        for (lane, bsdf) in turned.iter().enumerate() {
            let own = bsdf.evaluate(wo, wi);
            assert!((own.pdf.hero() - all.pdf[lane]).abs() <= 1e-4 * all.pdf[lane].abs().max(1e-3));
            assert!((own.glossy.hero() - all.glossy[lane]).abs() <= 1e-4 * all.glossy[lane].abs().max(1e-3));
        }
        differ += usize::from((all.pdf[0] - all.pdf[3]).abs() > 1e-3 * all.pdf[0]);
    }
    assert!(differ > 100, "a rough dispersive interface has other densities in other lanes");
}

#[test]
fn lanes_of_equal_index_are_one_lane() {
    let mut random = Random(9);
    let wide = |p: &Parameters<1>| {
        let wide = |s: SampledSpectrum<1>| SampledSpectrum::<4>::splat(s[0]);
        let metal = match p.metal {
            Metal::Tint { f0, f82 } => Metal::Tint { f0: wide(f0), f82: wide(f82) },
            Metal::Index { n, k } => Metal::Index { n: wide(n), k: wide(k) },
            Metal::Constant { f0 } => Metal::Constant { f0: wide(f0) },
        };
        Parameters::<4> {
            base_color: wide(p.base_color),
            diffuse_roughness: p.diffuse_roughness,
            metalness: p.metalness,
            metal,
            specular_weight: p.specular_weight,
            specular_color: wide(p.specular_color),
            alpha: p.alpha,
            interface: Interface { ior_i: wide(p.interface.ior_i), ior_t: wide(p.interface.ior_t) },
            transmission: p.transmission,
            transmission_tint: wide(p.transmission_tint),
            thin_walled: p.thin_walled,
            coat: p.coat.map(|c| Coat {
                weight: c.weight,
                color: wide(c.color),
                ior: c.ior,
                alpha: c.alpha,
                darkening: c.darkening,
            }),
            sheen: p.sheen.map(|s| Sheen { weight: s.weight, color: wide(s.color), roughness: s.roughness }),
            film: None,
            diffuse_transmission: wide(p.diffuse_transmission),
            schlick_f0: p.schlick_f0.map(wide),
        }
    };
    for (name, parameters) in &surfaces() {
        let (one, four) = (Bsdf::new(parameters), Bsdf::new(&wide(parameters)));
        for _ in 0..100 {
            let wo = direction(random.next().max(0.05));
            let (u, v) = (random.next(), [random.next(), random.next()]);
            let (a, b) = (one.sample(wo, u, v), four.sample(wo, u, v));
            assert_eq!(a.map(|a| a.event), b.map(|b| b.event), "{name}");
            let (Some(a), Some(b)) = (a, b) else { continue };
            assert_eq!(a.scattered, b.scattered, "{name}");
            for lane in 0..4 {
                assert!((a.weight[0] - b.weight[lane]).abs() <= 1e-5 * a.weight[0], "{name}");
                assert!((a.pdf[0] - b.pdf[lane]).abs() <= 1e-5 * a.pdf[0], "{name}");
            }
        }
    }
}

#[test]
fn all_lanes_together_see_a_white_furnace() {
    // Every lane in turn is the hero, and every lane's value is divided by the mean of the densities: the estimator of a path.
    const SAMPLES: u32 = 1 << 14;
    let turned: [Bsdf<4>; 4] = std::array::from_fn(|first| Bsdf::new(&dispersive(first)));
    let ior = dispersive(0).interface.ior_t;
    for cos in [0.9, 0.3] {
        let mut sums = [0.0_f64; 4];
        for (hero, bsdf) in turned.iter().enumerate() {
            for i in 0..SAMPLES {
                let u = [0, 1, 2].map(|dimension| sobol_burley::sample(i, dimension, hero as u32));
                let Some(sample) = bsdf.sample(direction(cos), u[0], [u[1], u[2]]) else { continue };
                let Scattered::Toward(wi) = sample.scattered else { panic!("is rough") };
                let value = sample.weight * (sample.pdf.hero() / sample.pdf.mean());
                for lane in 0..4 {
                    // Lane `lane` of all is lane (lane − hero) of this one.
                    let n = if wi.z < 0.0 { ior[lane] } else { 1.0 };
                    sums[lane] += f64::from(value[(lane + 4 - hero) % 4] * n * n);
                }
            }
        }
        for (lane, sum) in sums.iter().enumerate() {
            let mean = sum / f64::from(4 * SAMPLES);
            assert!((mean - 1.0).abs() < 2e-3, "lane {lane} at {cos}: {mean}");
        }
    }
}
