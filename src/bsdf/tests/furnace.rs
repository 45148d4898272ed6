//! White furnace: surfaces that lose nothing send back what arrives.

use super::support::{direction, furnace};
use crate::bsdf::{Bsdf, Coat, Interface, Metal, Parameters, Sheen};
use crate::spectrum::SampledSpectrum;

const ONE: SampledSpectrum<1> = SampledSpectrum::ONE;

fn interface(i: f32, t: f32) -> Interface<1> {
    Interface { ior_i: SampledSpectrum::splat(i), ior_t: SampledSpectrum::splat(t) }
}

#[test]
#[ignore = "a survey to read"]
fn survey() {
    let white = Metal::Tint { f0: ONE, f82: ONE };
    let mut all: Vec<(String, Parameters<1>, f32)> = vec![];
    all.push(("lambert".into(), Parameters::diffuse(ONE), 1.0));
    for r in [0.3, 1.0] {
        all.push((format!("eon {r}"), Parameters { diffuse_roughness: r, ..Parameters::diffuse(ONE) }, 1.0));
    }
    for a in [0.0, 0.01, 0.05, 0.1, 0.3, 0.6, 1.0] {
        all.push((format!("metal {a}"), Parameters::metal(white, a), 1.0));
        all.push((format!("plastic {a}"), Parameters::plastic(ONE, interface(1.0, 1.5), a), 1.0));
        all.push((format!("plastic2 {a}"), Parameters::plastic(ONE, interface(1.0, 2.2), a), 1.0));
        all.push((
            format!("eonplastic {a}"),
            Parameters { diffuse_roughness: 1.0, ..Parameters::plastic(ONE, interface(1.0, 1.5), a) },
            1.0,
        ));
        all.push((format!("glass {a}"), Parameters::glass(interface(1.0, 1.5), a), 2.25));
        all.push((format!("glass out {a}"), Parameters::glass(interface(1.5, 1.0), a), 1.0 / 2.25));
        all.push((format!("glass 1.1 {a}"), Parameters::glass(interface(1.0, 1.1), a), 1.21));
        all.push((format!("glass 1.1 out {a}"), Parameters::glass(interface(1.1, 1.0), a), 1.0 / 1.21));
        all.push((
            format!("thin {a}"),
            Parameters { thin_walled: true, ..Parameters::glass(interface(1.0, 1.5), a) },
            1.0,
        ));
        for c in [0.0, 0.2] {
            let coat = Some(Coat { alpha: [c; 2], ..Coat::default() });
            all.push((format!("coat {c} metal {a}"), Parameters { coat, ..Parameters::metal(white, a) }, 1.0));
            all.push((
                format!("coat {c} plastic {a}"),
                Parameters { coat, ..Parameters::plastic(ONE, interface(1.0, 1.5), a) },
                1.0,
            ));
        }
        let coat = Some(Coat { alpha: [a; 2], ..Coat::default() });
        all.push((format!("coat {a} lambert"), Parameters { coat, ..Parameters::diffuse(ONE) }, 1.0));
        all.push((
            format!("coat {a} eon"),
            Parameters { coat, diffuse_roughness: 1.0, ..Parameters::diffuse(ONE) },
            1.0,
        ));
        let sheen = Some(Sheen { weight: 1.0, color: ONE, roughness: a });
        all.push((format!("sheen {a} lambert"), Parameters { sheen, ..Parameters::diffuse(ONE) }, 1.0));
        all.push((format!("sheen {a} metal 0.2"), Parameters { sheen, ..Parameters::metal(white, 0.2) }, 1.0));
        all.push((
            format!("sheen {a} plastic 0.2"),
            Parameters { sheen, ..Parameters::plastic(ONE, interface(1.0, 1.5), 0.2) },
            1.0,
        ));
    }
    for (name, p, beyond) in all {
        let bsdf = Bsdf::new(&p);
        let mut line = format!("{name:24}");
        for mu in [1.0, 0.8, 0.5, 0.2, 0.1, 0.03] {
            let e = furnace(&bsdf, direction(mu), beyond, 16384);
            line += &format!(" {:+.5}±{:.5}", e.mean - 1.0, e.error);
        }
        println!("{line}");
    }
}
