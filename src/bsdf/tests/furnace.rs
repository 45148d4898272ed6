//! White furnace: surfaces that lose nothing send back what arrives; what is not exact is stated in docs/scattering.md.

use super::support::{Estimate, direction, furnace};
use crate::bsdf::{Bsdf, Coat, Film, Interface, Metal, Parameters, Sheen};
use crate::spectrum::SampledSpectrum;

const ONE: SampledSpectrum<1> = SampledSpectrum::ONE;

pub(super) fn interface(i: f32, t: f32) -> Interface<1> {
    Interface { ior_i: SampledSpectrum::splat(i), ior_t: SampledSpectrum::splat(t) }
}

pub(super) fn white_metal() -> Metal<1> {
    Metal::Tint { f0: ONE, f82: ONE }
}

/// Radiance of a furnace of 1 on the other side, in terms of this one's: it is over n² that it is equal.
fn beyond(parameters: &Parameters<1>) -> f32 {
    if parameters.thin_walled {
        return 1.0;
    }
    let eta = parameters.interface.ior_t[0] / parameters.interface.ior_i[0];
    eta * eta
}

/// As many samples as it takes to know the albedo to 4e-4, within bounds.
fn albedo(parameters: &Parameters<1>, cos: f32) -> Estimate {
    let (bsdf, mut samples) = (Bsdf::new(parameters), 1 << 13);
    loop {
        let estimate = furnace(&bsdf, direction(cos), beyond(parameters), samples);
        if estimate.error < 3e-4 || samples >= 1 << 18 {
            return estimate;
        }
        samples *= 4;
    }
}

/// Loses nothing, to 1e-3 and what the estimate's own error explains.
fn assert_lossless(name: &str, parameters: &Parameters<1>) {
    for cos in [1.0, 0.7, 0.4, 0.15] {
        let Estimate { mean, error } = albedo(parameters, cos);
        assert!(error < 1e-3, "{name} at {cos}: the estimate is too noisy, ±{error}");
        assert!((mean - 1.0).abs() < 1e-3 + 2.0 * error, "{name} at {cos}: {mean} ± {error}");
    }
}

#[test]
fn white_diffuse_surfaces() {
    for diffuse_roughness in [0.0, 0.4, 1.0] {
        let base = Parameters { diffuse_roughness, ..Parameters::diffuse(ONE) };
        assert_lossless("diffuse", &base);
        for alpha in [0.0, 0.05, 0.25, 1.0] {
            let ior = if alpha > 0.1 { 1.5 } else { 2.0 };
            let plastic = Parameters { diffuse_roughness, ..Parameters::plastic(ONE, interface(1.0, ior), alpha) };
            assert_lossless(&format!("plastic {alpha} over {diffuse_roughness}"), &plastic);
            let coat = Some(Coat { alpha: [alpha; 2], ..Coat::default() });
            assert_lossless("coat", &Parameters { coat, ..base });
            let sheen = Some(Sheen { weight: 1.0, color: ONE, roughness: alpha });
            assert_lossless("sheen", &Parameters { sheen, ..base });
        }
    }
    let leaf = Parameters {
        diffuse_transmission: ONE * 0.3,
        thin_walled: true,
        ..Parameters::plastic(ONE * 0.7, interface(1.0, 1.4), 0.2)
    };
    assert_lossless("leaf", &leaf);
    let film = Some(Film { weight: 0.8, thickness_nm: 400.0, ior: 1.8, nanometers: SampledSpectrum::splat(540.0) });
    for alpha in [0.0, 0.2] {
        assert_lossless("film", &Parameters { film, ..Parameters::plastic(ONE, interface(1.0, 1.5), alpha) });
    }
    for (i, t) in [(1.33, 1.3), (1.5, 1.0)] {
        assert_lossless("from the denser side", &Parameters::plastic(ONE, interface(i, t), 0.1));
    }
    let schlick = Parameters { schlick_f0: Some(ONE * 0.3), ..Parameters::plastic(ONE, interface(1.0, 1.5), 0.3) };
    assert_lossless("Schlick", &schlick);
}

#[test]
fn lossless_metals() {
    for alpha in [0.0, 0.03, 0.1, 0.3, 0.6, 1.0] {
        let metal = Parameters::metal(white_metal(), alpha);
        assert_lossless(&format!("metal {alpha}"), &metal);
        for coat_alpha in [0.0, 0.2] {
            let coat = Some(Coat { alpha: [coat_alpha; 2], ..Coat::default() });
            assert_lossless(&format!("coat {coat_alpha} over metal {alpha}"), &Parameters { coat, ..metal });
        }
        if alpha >= 0.1 {
            let sheen = Some(Sheen { weight: 0.7, color: ONE, roughness: 0.5 });
            assert_lossless(&format!("sheen over metal {alpha}"), &Parameters { sheen, ..metal });
        }
    }
}

#[test]
fn clear_glass() {
    for alpha in [0.0, 0.1, 0.3, 0.6, 1.0] {
        for (i, t) in [(1.0, 1.5), (1.5, 1.0), (1.0, 1.1), (1.1, 1.0), (1.33, 1.5), (1.0, 2.4)] {
            assert_lossless(&format!("glass {alpha} {i} {t}"), &Parameters::glass(interface(i, t), alpha));
        }
        let wall = Parameters { thin_walled: true, ..Parameters::glass(interface(1.0, 1.5), alpha) };
        assert_lossless(&format!("wall {alpha}"), &wall);
        let coat = Some(Coat::default());
        assert_lossless("coat over glass", &Parameters { coat, ..Parameters::glass(interface(1.0, 1.5), 0.0) });
    }
}

#[test]
fn shares_of_lossless_surfaces_are_lossless() {
    let mixed = Parameters {
        metalness: 0.4,
        metal: white_metal(),
        transmission: 0.5,
        ..Parameters::plastic(ONE, interface(1.0, 1.5), 0.3)
    };
    assert_lossless("metal, glass and plastic", &mixed);
}

#[test]
fn a_closed_glass_body_is_not_seen_in_a_furnace() {
    // Light enters, is reflected within by facets that see it from all sides alike, and leaves: the factors (n_i/n_t)² cancel. Per event the
    // radiance over n² is kept, which the other tests have; here both are put in a row along one path.
    let (enter, leave) = (
        Bsdf::new(&Parameters::glass(interface(1.0, 1.5), 0.0)),
        Bsdf::new(&Parameters::glass(interface(1.5, 1.0), 0.0)),
    );
    for cos in [1.0_f32, 0.6, 0.2] {
        let inside = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
        let enter = enter.sample(direction(cos), 0.999_999, [0.5; 2]).unwrap();
        let leave = leave.sample(direction(inside), 0.999_999, [0.5; 2]).unwrap();
        assert!((enter.weight[0] * leave.weight[0] - 1.0).abs() < 1e-5);
    }
}

/// The surfaces of the tables of docs/scattering.md.
fn stated(name: &str) -> Parameters<1> {
    let plastic = |alpha| Parameters::plastic(ONE, interface(1.0, 1.5), alpha);
    let coat = Some(Coat::default());
    let rough_coat = Some(Coat { alpha: [0.2; 2], ..Coat::default() });
    let sheen = Some(Sheen { weight: 1.0, color: ONE, roughness: 0.3 });
    let film = Some(Film { weight: 1.0, thickness_nm: 300.0, ior: 1.8, nanometers: SampledSpectrum::splat(540.0) });
    let glass = Parameters::glass(interface(1.0, 1.5), 0.3);
    match name {
        "smooth coat over plastic, α = 0.1" => Parameters { coat, ..plastic(0.1) },
        "smooth coat over plastic, α = 0.3" => Parameters { coat, ..plastic(0.3) },
        "coat, α = 0.2, over plastic, α = 0.3" => Parameters { coat: rough_coat, ..plastic(0.3) },
        "sheen, roughness 0.3, over plastic, α = 0.3" => Parameters { sheen, ..plastic(0.3) },
        "sheen, roughness 0.3, over coat, α = 0.2, over metal, α = 0.3" => {
            Parameters { sheen, coat: rough_coat, ..Parameters::metal(white_metal(), 0.3) }
        }
        "smooth coat over glass, α = 0.3" => Parameters { coat, ..glass },
        "sheen, roughness 0.3, over glass, α = 0.3" => Parameters { sheen, ..glass },
        "film, n = 1.8, 300 nm at 540 nm, on glass, α = 0.3" => Parameters { film, ..glass },
        "glass of n = 4, α = 0.3" => Parameters::glass(interface(1.0, 4.0), 0.3),
        "metal, α = 0.1 × 0.4" => Parameters { alpha: [0.1, 0.4], ..Parameters::metal(white_metal(), 0.0) },
        "glass, α = 0.1 × 0.4" => Parameters { alpha: [0.1, 0.4], ..glass },
        "plastic, α = 0.1 × 0.4" => Parameters { alpha: [0.1, 0.4], ..plastic(0.0) },
        _ => panic!("docs/scattering.md names '{name}', which is not a surface of this test"),
    }
}

#[test]
fn what_is_not_exact_is_stated() {
    let text = include_str!("../../../docs/scattering.md");
    let table = text.split("<!-- table: remainder -->").nth(1).expect("the table has its mark");
    let mut rows = 0;
    for line in table.lines().skip_while(|line| !line.starts_with("| ---")).skip(1) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if cells.len() < 6 {
            break;
        }
        rows += 1;
        for (cell, cos) in cells[2..6].iter().zip([1.0, 0.5, 0.2, 0.1]) {
            let parameters = stated(cells[1]);
            let Estimate { mean, error } = albedo(&parameters, cos);
            let said: f64 = cell.replace('−', "-").parse().expect("a number");
            assert!(
                (mean - 1.0 - said).abs() < 1e-3 + 2.0 * error,
                "{}: {said} stated at {cos}, {}",
                cells[1],
                mean - 1.0
            );
        }
    }
    assert_eq!(rows, 12);
}

#[test]
fn what_single_scattering_would_lose_is_stated() {
    let text = include_str!("../../../docs/scattering.md");
    let table = text.split("<!-- table: single -->").nth(1).expect("the table has its mark");
    let mut rows = 0;
    for line in table.lines().skip_while(|line| !line.starts_with("| ---")).skip(1) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if cells.len() < 6 {
            break;
        }
        rows += 1;
        let (what, alpha) = cells[1].split_once(", α = ").expect("names the roughness");
        let roughness = crate::bsdf::albedo::Roughness::new(alpha.parse().expect("a number"));
        for (cell, cos) in cells[2..6].iter().zip([1.0, 0.5, 0.2, 0.1]) {
            let at = crate::bsdf::albedo::At::cosine(cos);
            let lost = match what {
                "metal" => 1.0 - at.of(&roughness.white()),
                "glass from outside" => at.of(&roughness.dielectric_loss(1.5)),
                "glass from within" => at.of(&roughness.dielectric_loss(1.0 / 1.5)),
                _ => panic!("unknown row '{what}'"),
            };
            let said: f32 = cell.parse().expect("a number");
            assert!((lost - said).abs() < 1e-3, "{}: {said} stated at {cos}, {lost}", cells[1]);
        }
    }
    assert_eq!(rows, 9);
}
