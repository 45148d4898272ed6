//! Laws that the calculus and the optics below it must obey, whatever the scene: Snell and Fermat, constants of motion,
//! exact equalities, closed forms, golden values. Derivatives against full re-traces are in `derivatives.rs`.

#![expect(clippy::print_stdout, reason = "the worst errors found are what one reads these tests for")]
#![expect(clippy::float_cmp, reason = "bounds are returned as they are given")]

#[path = "support/bench.rs"]
mod bench;
#[path = "support/supplement.rs"]
mod supplement;

use abbe::math::compensated::{two_prod, two_sum, w_squared};
use abbe::optics::{Dispersion, IorJet};
use abbe::ray::invariant::InvariantSums;
use abbe::ray::{
    Column, ColumnSet, Curvature, LambdaColumn, LocalSurface, NoColumns, NormalField, RayStart, ScatterKind,
    ScreenColumns, SecondOrderColumns, Transfer, critical_distance, deflect, direction_derivative,
    direction_second_derivative, half_width, mirror, refract_or_reflect, screen_motion, second_order_along, standalone,
};
use abbe::spectrum::{REFERENCE, Wavelength, lines};
use bench::{Bench, Event, Shape, bk7, random, sf66};
use dashu_float::FBig;
use glam::{DMat3, DVec2, DVec3};

type Big = FBig<dashu_float::round::mode::HalfEven, 2>;

/// Enough bits for every exact sum and product of a few `f64` here.
const BITS: usize = 400;

fn big(x: f64) -> Big {
    Big::try_from(x).unwrap().with_precision(BITS).value()
}

fn nm(nanometers: f64) -> Wavelength {
    Wavelength::from_nanometers(nanometers)
}

fn flat(normal: DVec3) -> LocalSurface {
    LocalSurface { n_g: normal, n_s: normal, curvature: Curvature::Plane, field: NormalField::Flat }
}

fn relative(a: DVec3, b: DVec3) -> f64 {
    (a - b).length() / b.length().max(f64::MIN_POSITIVE)
}

/// A direction at `angle` degrees from −z, in a plane through z turned by `turn`.
fn incident(angle: f64, turn: f64) -> DVec3 {
    let (sin, cos) = angle.to_radians().sin_cos();
    DVec3::new(sin * turn.cos(), sin * turn.sin(), -cos)
}

// ------------------------------------------------------------------------------------------------ compensated arithmetic

#[test]
fn sums_and_products_carry_their_exact_errors() {
    let mut next = random(1);
    for _ in 0..2000 {
        let (a, b) = (next() * 2f64.powi((next() * 60.0) as i32), next() * 2f64.powi((next() * 60.0) as i32));
        let (s, e) = two_sum(a, b);
        assert_eq!(big(s) + big(e), big(a) + big(b), "{a:e} + {b:e}");
        let (p, e) = two_prod(a, b);
        assert_eq!(big(p) + big(e), big(a) * big(b), "{a:e} * {b:e}");
        assert_eq!(e.to_bits(), a.mul_add(b, -p).to_bits(), "the split and the fused operation agree to the bit");
    }
}

/// W² in exact arithmetic.
fn exact_w_squared(ior_i: f64, ior_t: f64, g: f64) -> Big {
    big(ior_t) * big(ior_t) - big(ior_i) * big(ior_i) + big(g) * big(g)
}

/// Error of `value` in units of ε times the exact value.
fn ulps(value: f64, exact: &Big) -> f64 {
    let difference = (big(value) - exact).to_f64().value();
    difference.abs() / (exact.to_f64().value().abs() * f64::EPSILON).max(f64::MIN_POSITIVE)
}

#[test]
fn squared_normal_momentum_keeps_its_digits_down_to_total_cancellation() {
    let (mut worst_near, mut worst_far) = (0.0f64, 0.0f64);
    let mut next = random(2);
    for (ior_i, ior_t) in
        [(1.5168, 1.0), (2.4175, 1.0), (1.5168, 1.3333), (1.0 + 1e-9, 1.0), (1.92286, 1.7), (1.0, 1.5)]
    {
        let critical = f64::max(1.0 - (ior_t / ior_i) * (ior_t / ior_i), 0.0).sqrt();
        for i in 0..400 {
            // 0.001° and less to either side of the critical angle, down to single ulps, and everywhere else.
            let g = match i % 4 {
                0 => -ior_i * (critical.acos() + 1e-3f64.to_radians() * (next() * 2.0 - 1.0)).cos(),
                1 => -ior_i * critical * (1.0 + f64::from(i - 200) * f64::EPSILON),
                2 => -ior_i * (critical + 10f64.powf(-16.0 * next())),
                _ => -ior_i * next(),
            };
            let exact = exact_w_squared(ior_i, ior_t, g);
            let computed = w_squared(ior_i, ior_t, g);
            assert_eq!(computed > 0.0, exact > Big::ZERO, "total reflection is decided by the exact sign: {g:e}");
            if exact != Big::ZERO {
                let worst = if i % 4 < 3 { &mut worst_near } else { &mut worst_far };
                *worst = worst.max(ulps(computed, &exact));
            }
        }
    }
    println!("W²: worst error {worst_near:.3} ε near the critical angle, {worst_far:.3} ε elsewhere");
    assert!(worst_near <= 1.0 && worst_far <= 6.0, "{worst_near} ε, {worst_far} ε");
}

#[test]
fn squared_normal_momentum_vanishes_exactly_at_the_critical_angle() {
    // 5² − 4² = 3²: representable, so that W = 0 can be met; it counts as reflected.
    assert_eq!(w_squared(5.0, 4.0, -3.0).to_bits(), 0);
    let momentum = DVec3::new(4.0, 0.0, -3.0);
    let s = refract_or_reflect(momentum, &flat(DVec3::Z), &IorJet::constant(5.0), &IorJet::constant(4.0));
    assert_eq!(s.kind, ScatterKind::TotalReflection);
    assert_eq!(s.momentum_out, DVec3::new(4.0, 0.0, 3.0));
}

// ----------------------------------------------------------------------------------------------------------- dispersion

#[test]
fn golden_values_of_the_catalogue_glasses() {
    for (glass, nd, vd, slope) in [(bk7(), 1.51680, 64.17, -0.050_317_718), (sf66(), 1.92286, 20.88, -0.277_775_87)] {
        assert!((glass.at(lines::D).ior - nd).abs() < 5e-6);
        assert!((glass.abbe_number().unwrap() - vd).abs() < 5e-3);
        // Per µm, as MATH.md prints it.
        assert!((1e3 * glass.at(nm(550.0)).dior_dlambda - slope).abs() < 5e-9);
    }
    let bk7_by_vd = Dispersion::from_abbe_number(1.5168, 64.17).unwrap();
    let text = Dispersion::from_abbe_number(bk7().at(lines::D).ior, bk7().abbe_number().unwrap()).unwrap().describe();
    assert!(text.contains("1.5045833") && text.contains("0.004217553"), "A and B of MATH.md 4: {text}");
    assert_eq!(bk7_by_vd.at(REFERENCE).ior.to_bits(), 1.5168f64.to_bits(), "n_d is the authored one");
    assert!((bk7_by_vd.abbe_number().unwrap() - 64.17).abs() < 64.17 * 1e-13);
}

#[test]
fn abbe_number_law_is_the_two_term_cauchy_law() {
    let (nd, vd) = (1.5168, 64.17);
    let x = |line: Wavelength| line.micrometers().powi(-2);
    let b = (nd - 1.0) / (vd * (x(lines::F) - x(lines::C)));
    let cauchy = Dispersion::cauchy(&[nd - b * x(lines::D), b]).unwrap();
    let abbe = Dispersion::from_abbe_number(nd, vd).unwrap();
    for step in 0..=47 {
        let wavelength = nm(360.0 + 10.0 * f64::from(step));
        let (a, c) = (abbe.at(wavelength), cauchy.at(wavelength));
        assert!((a.ior - c.ior).abs() < 1e-15 * 8.0);
        assert!((a.dior_dlambda - c.dior_dlambda).abs() < 1e-14 * c.dior_dlambda.abs());
        assert!((a.d2ior_dlambda2 - c.d2ior_dlambda2).abs() < 1e-14 * c.d2ior_dlambda2.abs());
    }
}

#[test]
fn both_sellmeier_conventions_are_one_law() {
    let c = [0.00600069867f64, 0.0200179144, 103.560653];
    let b = [1.03961212, 0.231792344, 1.01046945];
    let two = Dispersion::sellmeier(&b, &c).unwrap();
    let one = Dispersion::sellmeier_squared(0.0, &b, &c.map(f64::sqrt)).unwrap();
    for wavelength in [400.0, 550.0, 800.0].map(nm) {
        let (a, b) = (two.at(wavelength), one.at(wavelength));
        assert!((a.ior - b.ior).abs() < 1e-15 * 4.0);
        assert!((a.dior_dlambda - b.dior_dlambda).abs() < 1e-13 * a.dior_dlambda.abs());
    }
    // A constant above 1: half of a term without resonance.
    let shifted = Dispersion::sellmeier_squared(0.25, &[0.5], &[0.1]).unwrap();
    let x = 0.55f64 * 0.55;
    assert!((shifted.at(nm(550.0)).ior - (1.25 + 0.5 * x / (x - 0.01)).sqrt()).abs() < 1e-15);
}

/// n(λ) in `BITS` bits from the law's coefficients.
enum BigLaw {
    Sellmeier([f64; 3], [f64; 3]),
    Cauchy(Vec<f64>),
}

impl BigLaw {
    fn at(&self, micrometers: &Big) -> Big {
        let x = micrometers * micrometers;
        match self {
            Self::Sellmeier(b, c) => {
                let epsilon = (0..3).fold(big(1.0), |sum, i| sum + big(b[i]) * &x / (&x - big(c[i])));
                epsilon.sqrt()
            }
            Self::Cauchy(a) => a.iter().rev().fold(big(0.0), |sum, a| sum / &x + big(*a)),
        }
    }

    /// n' and n'' by central differences with a step of 2⁻⁶⁴ µm, whose error of 2⁻¹²⁸ is far below an `f64`'s.
    fn derivatives(&self, micrometers: f64) -> [f64; 2] {
        let h = big(2f64.powi(-64));
        let x = big(micrometers);
        let (low, middle, high) = (self.at(&(&x - &h)), self.at(&x), self.at(&(&x + &h)));
        let first = (&high - &low) / (big(2.0) * &h);
        let second = (high - big(2.0) * middle + low) / (&h * &h);
        [first.to_f64().value(), second.to_f64().value()]
    }
}

#[test]
fn index_derivatives_are_those_of_the_law() {
    let (sf66_b, sf66_c) = ([2.0784223, 0.407120032, 1.76711292], [0.0180875134, 0.0679493572, 215.266127]);
    let (bk7_b, bk7_c) = ([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653]);
    let cauchy = vec![1.5045833, 0.0042175527, 1.3e-4, -2e-6];
    let mut worst = 0.0f64;
    for (law, exact) in [
        (bk7(), BigLaw::Sellmeier(bk7_b, bk7_c)),
        (sf66(), BigLaw::Sellmeier(sf66_b, sf66_c)),
        (Dispersion::cauchy(&cauchy).unwrap(), BigLaw::Cauchy(cauchy)),
    ] {
        for step in 0..=47 {
            let wavelength = nm(360.0 + 10.0 * f64::from(step));
            let jet = law.at(wavelength);
            let [first, second] = exact.derivatives(wavelength.micrometers());
            worst = worst.max((1e3 * jet.dior_dlambda / first - 1.0).abs());
            worst = worst.max((1e6 * jet.d2ior_dlambda2 / second - 1.0).abs());
        }
    }
    println!("n', n'': worst relative error {worst:.2e}");
    assert!(worst < 1e-13, "{worst:e}");
}

#[test]
fn laws_with_poles_or_impossible_indices_are_refused() {
    // A pole at 500 nm, at both ends of the band, and so narrow that sampling would not find it.
    for c in [0.25, 0.36 * 0.36, 0.83 * 0.83, 0.3] {
        let error = Dispersion::sellmeier(&[1.0, 1e-12], &[0.01, c]).unwrap_err();
        assert!(error.contains("pole"), "{error}");
    }
    // The same pole with the other convention: C is a wavelength.
    assert!(Dispersion::sellmeier_squared(0.0, &[1.0], &[0.5]).unwrap_err().contains("pole"));
    assert!(Dispersion::sellmeier_squared(0.0, &[1.0], &[-0.5]).unwrap_err().contains("pole"), "squared");
    // A pole outside is fine, also with a term that is padding, and a resonance without a real wavelength.
    assert!(Dispersion::sellmeier(&[1.0, 0.0], &[0.01, 0.25]).is_ok());
    assert!(Dispersion::sellmeier(&[1.0, 0.5], &[0.01, -0.25]).is_ok());
    // n² < 0 over a fifth of a nanometre only: (x − a)² − tiny, with x = λ⁻², as a Cauchy polynomial.
    let a = 0.5f64.powi(-2);
    let error = Dispersion::cauchy(&[a * a + 0.01 - 1e-6, -2.0 * a, 1.0]).unwrap_err();
    assert!(error.contains("500.0") || error.contains("499.9"), "found without sampling: {error}");
    assert!(Dispersion::cauchy(&[a * a + 0.0101, -2.0 * a, 1.0]).is_ok(), "touches 0.0101 at 500 nm");
    assert!(Dispersion::sellmeier(&[-3.0], &[0.01]).unwrap_err().contains("no real index"));
    // Coefficients in nm² where µm² are meant.
    let error = Dispersion::cauchy(&[1.5045833, 4217.5527]).unwrap_err();
    assert!(error.contains("units"), "{error}");
    for ior in [0.0, -1.5, 1e-3, 1e6, f64::NAN, f64::INFINITY] {
        assert!(Dispersion::constant(ior).is_err(), "{ior}");
    }
    assert!(Dispersion::cauchy(&[]).is_err());
    assert!(Dispersion::cauchy(&[1e308, 1e308]).is_err());
    assert!(Dispersion::cauchy(&[1.5; 1000]).is_err());
    assert!(Dispersion::sellmeier(&[], &[]).is_err());
    assert!(Dispersion::sellmeier(&[1.0, 2.0], &[0.01]).is_err());
    assert!(Dispersion::sellmeier(&[1e308, -1e308], &[0.01, 0.011]).is_err());
    assert!(Dispersion::sellmeier(&[f64::NAN], &[0.01]).is_err());
    assert!(Dispersion::sellmeier_squared(0.0, &[1.0], &[1e200]).is_err());
    for (nd, vd) in [(1.5, 0.0), (1.5, -30.0), (1.5, f64::NAN), (1.5, 0.05), (0.0, 50.0), (-1.5, 50.0)] {
        assert!(Dispersion::from_abbe_number(nd, vd).is_err(), "{nd} {vd}");
    }
}

#[test]
fn scaling_dispersion_multiplies_the_deviation_from_n_d() {
    let glass = sf66();
    let ior_d = glass.at(lines::D).ior;
    for scale in [0.5, 3.0, -1.0] {
        let scaled = glass.scaled(scale).unwrap();
        for wavelength in [400.0, 587.5618, 700.0].map(nm) {
            let (plain, jet) = (glass.at(wavelength), scaled.at(wavelength));
            assert!((jet.ior - (ior_d + scale * (plain.ior - ior_d))).abs() < 1e-15 * 4.0);
            assert!((jet.dior_dlambda - scale * plain.dior_dlambda).abs() <= 1e-15 * jet.dior_dlambda.abs());
        }
        assert_eq!(scaled.at(lines::D).ior.to_bits(), ior_d.to_bits());
    }
    assert_eq!(glass.scaled(1.0).unwrap().at(nm(450.0)), glass.at(nm(450.0)), "1 changes no bit");
    assert_eq!(glass.scaled(2.0).unwrap().scaled(0.5).unwrap(), glass);
    let off = glass.scaled(0.0).unwrap();
    assert!(off.is_constant() && off.abbe_number().is_none());
    assert_eq!(off.at(nm(400.0)), IorJet::constant(ior_d));
    assert!(glass.scaled(-100.0).unwrap_err().contains("scaled"), "n would go below zero in the violet");
    assert!(glass.scaled(1000.0).is_err() && glass.scaled(f64::NAN).is_err());
    assert!(glass.scaled(1e-300).is_ok() && glass.scaled(1e300).is_err());
    assert!(Dispersion::constant(1.5).unwrap().scaled(1e300).is_ok(), "nothing deviates");
}

#[test]
fn a_law_without_dispersion_is_constant_exactly() {
    for law in [
        Dispersion::constant(1.5).unwrap(),
        Dispersion::cauchy(&[1.5]).unwrap(),
        Dispersion::cauchy(&[1.5, 0.0, 0.0]).unwrap(),
        Dispersion::sellmeier(&[1.25], &[0.0]).unwrap(),
        Dispersion::from_abbe_number(1.0, 50.0).unwrap(),
    ] {
        let jet = law.at(nm(432.1));
        assert!(law.is_constant() && jet.is_constant(), "{}", law.describe());
        assert_eq!(jet, law.at(nm(700.0)));
        assert_eq!(law.abbe_number(), None);
    }
}

// ----------------------------------------------------------------------------------------------------------- refraction

#[test]
fn snells_law() {
    let mut next = random(3);
    for _ in 0..500 {
        let (ior_i, ior_t) = (1.0 + 1.5 * next(), 1.0 + 1.5 * next());
        let angle = 89.9 * next();
        let d = incident(angle, 6.0 * next());
        let s = refract_or_reflect(d * ior_i, &flat(DVec3::Z), &IorJet::constant(ior_i), &IorJet::constant(ior_t));
        let sin_t = ior_i * angle.to_radians().sin() / ior_t;
        assert_eq!(s.kind == ScatterKind::TotalReflection, sin_t > 1.0);
        let out = s.momentum_out;
        assert!((out.truncate() - d.truncate() * ior_i).length() < 4e-16 * ior_i, "tangential momentum is conserved");
        if s.kind == ScatterKind::Refraction {
            assert!((out.truncate().length() / ior_t - sin_t).abs() < 1e-15);
            assert!(out.z < 0.0 && (out.length() / ior_t - 1.0).abs() < 1e-15);
            assert!((s.w().unwrap() + out.z).abs() < 1e-15 * ior_t, "W = n₁ cos θ_t");
        } else {
            assert!((out.z + d.z * ior_i).abs() < 1e-15 * ior_i);
        }
    }
}

#[test]
fn fermats_principle_at_an_interface_and_a_mirror() {
    // The optical path from A to B over the point (x, y, 0) is stationary where the ray goes through.
    let a = DVec3::new(-0.3, 0.2, 1.1);
    let d = -a.normalize();
    for (ior_t, reflects) in [(1.7, false), (1.0, true)] {
        let surface = flat(DVec3::Z);
        let s = if reflects {
            mirror(d, &surface, &IorJet::VACUUM)
        } else {
            refract_or_reflect(d, &surface, &IorJet::VACUUM, &IorJet::constant(ior_t))
        };
        let b = s.momentum_out * 0.8;
        let path = |x: f64, y: f64| {
            let p = DVec3::new(x, y, 0.0);
            (p - a).length() + ior_t * (b - p).length()
        };
        let h = 1e-4;
        let slope = DVec2::new(path(h, 0.0) - path(-h, 0.0), path(0.0, h) - path(0.0, -h)) / (2.0 * h);
        // Third derivatives of the path times h², and rounding over h.
        assert!(slope.length() < 2.0 * h * h, "{slope}");
    }
}

#[test]
fn nearly_equal_indices_deflect_by_all_their_digits() {
    let mut worst = 0.0f64;
    let mut next = random(4);
    for _ in 0..200 {
        let ior_i = 1.3 + next();
        let ior_t = ior_i + 1e-12 * (2.0 * next() - 1.0);
        let d = incident(85.0 * next(), next());
        let s = refract_or_reflect(d * ior_i, &flat(DVec3::Z), &IorJet::constant(ior_i), &IorJet::constant(ior_t));
        let g = big(s.g);
        let q = (big(ior_t) - big(ior_i)) * (big(ior_t) + big(ior_i));
        let exact = &q / ((&q + &g * &g).sqrt() - &g);
        if q != Big::ZERO {
            worst = worst.max((big(s.deflection) / exact - big(1.0)).to_f64().value().abs());
        }
    }
    println!("G at Δn = 1e-12: worst relative error {worst:.2e}");
    assert!(worst < 1e-15, "{worst:e}");
}

#[test]
fn a_reversed_path_returns() {
    let mut next = random(5);
    let mut worst = 0.0f64;
    for _ in 0..300 {
        let (ior_i, ior_t) = (1.0 + next(), 1.0 + next());
        let normal = bench::unit(&mut next);
        let mut d = bench::unit(&mut next);
        if d.dot(normal) > 0.0 {
            d = -d;
        }
        let (i, t) = (IorJet::constant(ior_i), IorJet::constant(ior_t));
        let s = refract_or_reflect(d * ior_i, &flat(normal), &i, &t);
        let back = match s.kind {
            ScatterKind::Refraction => refract_or_reflect(-s.momentum_out, &flat(normal), &t, &i),
            _ => refract_or_reflect(-s.momentum_out, &flat(normal), &i, &t),
        };
        assert_eq!(back.kind, s.kind);
        // Grazing on either side loses digits by the inverse normal component, as it must.
        let condition = 1.0 + 1.0 / s.w_squared.abs().sqrt() + 1.0 / s.g.abs();
        worst = worst.max((back.momentum_out + d * ior_i).length() / condition);
    }
    assert!(worst < 1e-15, "{worst:e}");
}

#[test]
fn agrees_with_the_formula_of_the_supplement() {
    let mut next = random(6);
    let mut worst = 0.0f64;
    for _ in 0..2000 {
        let normal = bench::unit(&mut next);
        let d = bench::unit(&mut next);
        let jet = |next: &mut dyn FnMut() -> f64| IorJet {
            ior: 1.0 + next(),
            dior_dlambda: -1e-3 * next(),
            d2ior_dlambda2: 0.0,
        };
        let (ior_i, ior_t) = (jet(&mut next), jet(&mut next));
        let ddirection = d.cross(bench::unit(&mut next)) * 1e-3;
        let dnormal = normal.cross(bench::unit(&mut next)) * 1e-3;
        let ours = standalone::refract(d, normal, ior_i, ior_t, ddirection, dnormal);
        let Some((direction, derivative)) = supplement::refract(d, normal, ior_i, ior_t, ddirection, dnormal) else {
            assert!(ours.total_reflection);
            continue;
        };
        assert!(!ours.total_reflection);
        // What the supplement's own cancellations leave it: ω² is a difference, and 1/ω multiplies.
        let eta = ior_i.ior / ior_t.ior;
        let omega = (1.0 - eta * eta * (1.0 - d.dot(normal).powi(2))).sqrt();
        let condition = 1.0 / (omega * omega);
        worst = worst.max((ours.direction - direction).length() / condition);
        worst = worst.max((ours.ddirection - derivative).length() / (1e-3 * condition));
    }
    println!("against the supplement: worst error {worst:.2e} of the condition");
    assert!(worst < 5e-15, "{worst:e}");
}

#[test]
fn pure_dispersion_turns_the_refracted_ray_by_its_closed_form() {
    // |∂d'| = |η'| sin θ_i / cos θ_t, from normal incidence to grazing (MATH.md 2.2).
    let glass = bk7().at(nm(500.0));
    for angle in [1e-6, 1e-3, 1.0, 30.0, 60.0, 89.0, 89.9999] {
        let d = incident(angle, 0.3);
        let out = standalone::refract(d, DVec3::Z, IorJet::VACUUM, glass, DVec3::ZERO, DVec3::ZERO);
        let sin_i = d.truncate().length();
        let cos_t = (1.0 - (sin_i / glass.ior).powi(2)).sqrt();
        let expected = glass.dior_dlambda.abs() / glass.ior.powi(2) * sin_i / cos_t;
        let error = (out.ddirection.length() - expected).abs();
        // Relative to the vector, but K' itself is rounded: its part along the ray is n' and cancels near the normal.
        assert!(error < 1e-15 * (expected + glass.dior_dlambda.abs()), "{angle}°: {error:e} of {expected:e}");
        assert!(out.ddirection.dot(out.direction).abs() < 1e-15 * glass.dior_dlambda.abs());
    }
}

#[test]
fn christiansen_media_turn_the_ray_without_bending_it() {
    // Equal n, different n': the direction is unchanged and |∂d'| = |η'| tan θ.
    let (i, t) = (
        IorJet { ior: 1.5, dior_dlambda: -2e-5, d2ior_dlambda2: 1e-7 },
        IorJet { ior: 1.5, dior_dlambda: -9e-5, d2ior_dlambda2: 4e-7 },
    );
    for angle in [0.1, 30.0, 80.0] {
        let d = incident(angle, 1.0);
        let start = bench::start(DVec3::ZERO, d);
        let mut columns = LambdaColumn::start(&start, &i);
        let s = refract_or_reflect(d * i.ior, &flat(DVec3::Z), &i, &t);
        assert_eq!(s.momentum_out, d * i.ior, "to the bit");
        columns.scatter(&s);
        let turned = direction_derivative(columns.lambda().unwrap().momentum, d, t.ior, t.dior_dlambda).length();
        let expected = ((i.dior_dlambda - t.dior_dlambda) / 1.5).abs() * angle.to_radians().tan();
        assert!((turned / expected - 1.0).abs() < 1e-12, "{angle}: {turned:e} {expected:e}");
    }
}

#[test]
fn between_equal_media_nothing_changes_by_a_bit() {
    let glass = sf66().at(nm(500.0));
    let mut next = random(7);
    for trial in 0..100 {
        let d = incident(70.0 * next(), 6.0 * next());
        let mut columns = SecondOrderColumns::start(&bench::start(DVec3::ZERO, d), &IorJet::VACUUM);
        // Something in every column first: a curved refraction.
        let sphere = LocalSurface {
            n_g: DVec3::Z,
            n_s: DVec3::Z,
            curvature: Curvature::Sphere { inv_radius: 0.7 },
            field: NormalField::Sphere { inv_radius: 0.7 },
        };
        columns.transfer(&Transfer {
            distance: 2.0,
            direction: d,
            medium: IorJet::VACUUM,
            n_g: DVec3::Z,
            curvature: sphere.curvature,
        });
        let s = refract_or_reflect(d, &sphere, &IorJet::VACUUM, &glass);
        columns.scatter(&s);
        let gradient = DMat3::from_cols(bench::unit(&mut next), bench::unit(&mut next), bench::unit(&mut next)) * 3.0;
        let n_s = (DVec3::Z + 0.2 * bench::unit(&mut next)).normalize();
        let field = if trial % 2 == 0 {
            NormalField::Linear { vector: n_s * 1.7, gradient }
        } else {
            NormalField::Sphere { inv_radius: -4.0 }
        };
        let surface = LocalSurface { n_g: DVec3::Z, n_s, curvature: Curvature::Plane, field };
        let event = refract_or_reflect(s.momentum_out, &surface, &glass, &glass);
        let before = columns;
        columns.scatter(&event);
        assert_eq!(event.deflection.to_bits() << 1, 0, "G = 0");
        assert_eq!(bits(event.momentum_out), bits(s.momentum_out));
        let pairs = [
            (before.screen().unwrap()[0], columns.screen().unwrap()[0]),
            (before.screen().unwrap()[1], columns.screen().unwrap()[1]),
            (before.lambda().unwrap(), columns.lambda().unwrap()),
            (before.lambda2().unwrap(), columns.lambda2().unwrap()),
        ];
        for (a, b) in pairs {
            assert_eq!((bits(a.point), bits(a.momentum)), (bits(b.point), bits(b.momentum)));
        }
    }
}

fn bits(v: DVec3) -> [u64; 3] {
    v.to_array().map(f64::to_bits)
}

#[test]
fn one_ulp_before_the_critical_angle_everything_is_finite() {
    let (i, t) = (bk7().at(nm(550.0)), IorJet::VACUUM);
    let sin_c = 1.0 / i.ior;
    for ulps in [-1000i32, -3, -2, -1, 0, 1, 2, 3, 1000] {
        let sin = sin_c * (1.0 + f64::from(ulps) * f64::EPSILON);
        let d = DVec3::new(sin, 0.0, -(1.0 - sin * sin).sqrt());
        let s = refract_or_reflect(d * i.ior, &flat(DVec3::Z), &i, &t);
        let mut columns = SecondOrderColumns::start(&bench::start(DVec3::ZERO, d), &i);
        let before = *columns.lambda().unwrap();
        columns.scatter(&s);
        let after = columns.lambda().unwrap();
        assert!(after.momentum.is_finite() && columns.lambda2().unwrap().momentum.is_finite(), "{ulps}");
        assert!(after.momentum.length() < 1e9 * i.dior_dlambda.abs(), "at most about |n'|·1e8: {}", after.momentum);
        assert!(
            (s.momentum_out.length() / if s.kind == ScatterKind::Refraction { 1.0 } else { i.ior } - 1.0).abs() < 1e-15
        );
        assert!(critical_distance(&s, &before).is_finite());
    }
}

// ---------------------------------------------------------------------------------------------------------------- chains

/// How far |K| = n, K·K' = n n', d·d' = 0 and |d'|² + d·d'' = 0 are from holding, each relative to the greatest |K'| and
/// |K''| so far, from whose roundings they suffer. Returns the worst.
fn self_check(momentum: DVec3, columns: &SecondOrderColumns, medium: &IorJet, greatest: &mut [f64; 2]) -> f64 {
    let (lambda, lambda2) = (columns.lambda().unwrap(), columns.lambda2().unwrap());
    greatest[0] = greatest[0].max(lambda.momentum.length());
    greatest[1] = greatest[1].max(lambda2.momentum.length()).max(lambda.momentum.length_squared());
    let d = momentum / medium.ior;
    let d1 = direction_derivative(lambda.momentum, d, medium.ior, medium.dior_dlambda);
    let d2 = direction_second_derivative(lambda2.momentum, d, d1, medium);
    let first = |residual: f64| if greatest[0] > 0.0 { residual.abs() / greatest[0] } else { residual.abs() };
    let second = |residual: f64| if greatest[1] > 0.0 { residual.abs() / greatest[1] } else { residual.abs() };
    (momentum.length() / medium.ior - 1.0)
        .abs()
        .max(first(momentum.dot(lambda.momentum) - medium.ior * medium.dior_dlambda))
        .max(first(d.dot(d1)))
        .max(second(d1.length_squared() + d.dot(d2)))
}

#[test]
fn momentum_and_its_derivatives_keep_their_identities_after_each_event() {
    let mut worst = 0.0f64;
    for bench in bench::all() {
        let mut trace = bench.trace::<SecondOrderColumns>(nm(550.0));
        let mut greatest = [0.0; 2];
        while let Some((momentum, medium)) = trace.step() {
            worst = worst.max(self_check(momentum, &trace.columns, &medium, &mut greatest));
        }
        assert!(trace.events > 0);
    }
    println!("|K| = n, K·K' = n n', d·d' = 0, |d'|² + d·d'' = 0: worst {worst:.2e}");
    assert!(worst < 1e-14, "{worst:e}");
}

#[test]
fn invariants_hold_on_true_normals() {
    let mut worst = 0.0f64;
    for bench in bench::all() {
        let mut trace = bench.trace::<ScreenColumns>(nm(550.0));
        let mut sums = InvariantSums::start(&trace.columns, trace.momentum);
        loop {
            let before = trace.columns;
            if trace.step().is_none() {
                break;
            }
            sums.transfer(&before, &trace.log.last().unwrap().transfer);
            let r = sums.residuals(&trace.columns, trace.momentum);
            for (residual, scale) in [
                (r.lagrange, r.scales[0]),
                (r.chromatic[0], r.scales[1]),
                (r.chromatic[1], r.scales[1]),
                (r.conrady, r.scales[2]),
            ] {
                if scale > 0.0 {
                    worst = worst.max(residual.abs() / scale);
                }
            }
        }
    }
    println!("I1, I2, I3: worst residual {worst:.2e} of the terms' magnitude");
    assert!(worst < 1e-13, "{worst:e}");
}

#[test]
fn total_reflection_does_not_depend_on_what_is_carried() {
    for bench in bench::all() {
        let none = bench.run::<NoColumns>(nm(550.0));
        let lambda = bench.run::<LambdaColumn>(nm(550.0));
        let screen = bench.run::<ScreenColumns>(nm(550.0));
        let second = bench.run::<SecondOrderColumns>(nm(550.0));
        for other in [&lambda.momentum, &screen.momentum, &second.momentum] {
            assert_eq!(bits(none.momentum), bits(*other));
        }
        for kinds in [lambda.kinds(), screen.kinds(), second.kinds()] {
            assert_eq!(none.kinds(), kinds);
        }
        // And a column has the same bits in every set.
        assert_eq!(lambda.columns.lambda(), screen.columns.lambda());
        assert_eq!(lambda.columns.lambda(), second.columns.lambda());
        assert_eq!(screen.columns.screen(), second.columns.screen());
    }
}

#[test]
fn scaling_by_a_power_of_two_changes_no_bit() {
    for bench in bench::all() {
        for scale in [2f64.powi(-20), 0.5, 2f64.powi(20)] {
            let plain = bench.run::<SecondOrderColumns>(nm(550.0));
            let scaled = bench.scaled(scale).run::<SecondOrderColumns>(nm(550.0));
            assert_eq!(bits(plain.momentum), bits(scaled.momentum));
            let same = |a: &Column, b: &Column| {
                assert_eq!(bits(a.point * scale), bits(b.point));
                assert_eq!(bits(a.momentum), bits(b.momentum));
            };
            same(plain.columns.lambda().unwrap(), scaled.columns.lambda().unwrap());
            same(plain.columns.lambda2().unwrap(), scaled.columns.lambda2().unwrap());
            for (a, b) in plain.columns.screen().unwrap().into_iter().zip(scaled.columns.screen().unwrap()) {
                same(a, b);
            }
        }
    }
}

#[test]
fn without_dispersion_the_wavelength_column_is_exactly_zero() {
    for bench in bench::all() {
        let trace = bench.without_dispersion().run::<SecondOrderColumns>(nm(550.0));
        for column in [trace.columns.lambda().unwrap(), trace.columns.lambda2().unwrap()] {
            assert_eq!(*column, Column::default());
        }
    }
}

#[test]
fn momentum_does_not_drift_in_fifty_total_reflections() {
    // A ray caught between two facets of a diamond: the same rounded normals again and again.
    let mut next = random(8);
    let (mut worst, mut worst_left_alone) = (0.0f64, 0.0f64);
    let diamond = IorJet { ior: 2.4175, dior_dlambda: -8e-5, d2ior_dlambda2: 4e-7 };
    for _ in 0..50 {
        let a = bench::unit(&mut next);
        let tangent = a.cross(bench::unit(&mut next)).normalize();
        let mut momentum = (tangent * 0.8 - a * 0.6).normalize() * diamond.ior;
        let mut left_alone = momentum;
        let mut columns = LambdaColumn::start(&bench::start(DVec3::ZERO, momentum / diamond.ior), &diamond);
        for bounce in 0..50 {
            let surface = flat(if bounce % 2 == 0 { a } else { -a });
            let s = refract_or_reflect(momentum, &surface, &diamond, &IorJet::VACUUM);
            assert_eq!(s.kind, ScatterKind::TotalReflection);
            columns.scatter(&s);
            momentum = s.momentum_out;
            left_alone -= s.normal * (2.0 * left_alone.dot(s.normal));
        }
        worst = worst.max((momentum.length() / diamond.ior - 1.0).abs());
        worst_left_alone = worst_left_alone.max((left_alone.length() / diamond.ior - 1.0).abs());
        let lambda = columns.lambda().unwrap();
        assert!((momentum.dot(lambda.momentum) / (diamond.ior * diamond.dior_dlambda) - 1.0).abs() < 1e-12);
    }
    println!("|K| after 50 total reflections: worst {worst:.2e}, not restored {worst_left_alone:.2e}");
    assert!(worst < 1e-15, "{worst:e}");
}

#[test]
fn a_right_angle_prism_with_total_reflection_is_an_achromatic_deflector() {
    let bench = Bench::right_angle_prism();
    let mut trace = bench.trace::<SecondOrderColumns>(nm(550.0));
    while trace.step().is_some() {}
    assert_eq!(trace.kinds()[1], ScatterKind::TotalReflection);
    let (lambda, lambda2) = (trace.columns.lambda().unwrap(), trace.columns.lambda2().unwrap());
    let d1 = direction_derivative(lambda.momentum, trace.direction(), 1.0, 0.0);
    let d2 = direction_second_derivative(lambda2.momentum, trace.direction(), d1, &IorJet::VACUUM);
    let slope = bk7().at(nm(550.0)).dior_dlambda.abs();
    assert!(d1.length() < 2e-15 * slope, "d_λ = {d1}");
    assert!(d2.length() < 2e-15 * bk7().at(nm(550.0)).d2ior_dlambda2, "d_λλ = {d2}");
    assert!(lambda.point.length() > 0.1 * slope, "but the ray is displaced: {}", lambda.point);
}

#[test]
fn a_flat_reflection_has_no_wavelength_source() {
    let d = incident(40.0, 0.7);
    let s = mirror(d, &flat(DVec3::Z), &IorJet::VACUUM);
    let mut columns = SecondOrderColumns::start(&bench::start(DVec3::ZERO, d), &IorJet::VACUUM);
    columns.scatter(&s);
    assert_eq!(*columns.lambda().unwrap(), Column::default());
    assert!((s.momentum_out - DVec3::new(d.x, d.y, -d.z)).length() < 1e-16);
    assert_eq!(s.ior_t, s.ior_i);
}

// ------------------------------------------------------------------------------------- central differences of the whole

/// Central difference and second difference of `f`, extrapolated once (Richardson): errors of order h⁴.
fn differences(f: impl Fn(f64) -> DVec3, h: f64) -> (DVec3, DVec3) {
    let first = |h: f64| (f(h) - f(-h)) / (2.0 * h);
    let middle = f(0.0);
    let second = |h: f64| (f(h) - middle * 2.0 + f(-h)) / (h * h);
    ((first(h) * 4.0 - first(2.0 * h)) / 3.0, (second(h) * 4.0 - second(2.0 * h)) / 3.0)
}

#[test]
fn columns_are_the_differences_of_the_re_trace() {
    let wavelength = nm(550.0);
    for bench in bench::all() {
        let trace = bench.run::<SecondOrderColumns>(wavelength);
        let (lambda, lambda2) = (trace.columns.lambda().unwrap(), trace.columns.lambda2().unwrap());
        let [x, y] = trace.columns.screen().unwrap();
        let end = |s: DVec3| bench.moved(s.x, s.y).run::<NoColumns>(nm(550.0 + s.z));
        for s in [DVec3::Z, DVec3::X, DVec3::Y, DVec3::new(2.0, -1.0, 1.0), DVec3::new(-0.3, 0.7, 0.5)] {
            let along = second_order_along(&bench.start, &IorJet::VACUUM, s, &trace.log);
            // A two-hundredth of the way to where the second order rivals the first.
            let h = (0.005 * along.point.length() / along.point2.length()).min(1.0);
            let (p1, p2) = differences(|u| end(s * u).point, h);
            let (k1, k2) = differences(|u| end(s * u).momentum, h);
            let linear_point = x.point * s.x + y.point * s.y + lambda.point * s.z;
            let linear_momentum = x.momentum * s.x + y.momentum * s.y + lambda.momentum * s.z;
            let name = &bench.name;
            assert!(
                (along.point - linear_point).length() < 1e-13 * (along.point.length() + lambda.point.length()),
                "{name}"
            );
            assert!(
                (along.momentum - linear_momentum).length()
                    < 1e-13 * (along.momentum.length() + lambda.momentum.length()),
                "{name} {s}"
            );
            // Rounding of the re-trace over h and h².
            let size = trace.point.length() + 1.0;
            assert!(
                (along.point - p1).length() < 1e-7 * p1.length() + 1e-14 * size / h,
                "{name} {s}: {} {p1}",
                along.point
            );
            assert!((along.momentum - k1).length() < 1e-7 * k1.length() + 1e-14 / h, "{name} {s}");
            assert!(
                (along.point2 - p2).length() < 1e-5 * p2.length() + 1e-13 * size / (h * h),
                "{name} {s}: {} {p2}",
                along.point2
            );
            assert!(
                (along.momentum2 - k2).length() < 1e-5 * k2.length() + 1e-13 / (h * h),
                "{name} {s}: {} {k2}",
                along.momentum2
            );
        }
        let along = second_order_along(&bench.start, &IorJet::VACUUM, DVec3::Z, &trace.log);
        assert!(relative(along.point2, lambda2.point) < 1e-14 || lambda2.point == DVec3::ZERO);
        assert!(relative(along.momentum2, lambda2.momentum) < 1e-14 || lambda2.momentum == DVec3::ZERO);
    }
}

#[test]
fn second_order_screen_motion_follows_what_is_seen() {
    // Newton's method keeps the end point fixed while the wavelength moves; its path on screen has these derivatives.
    let wavelength = nm(500.0);
    let bench = Bench::ball_before_a_plane();
    let trace = bench.run::<SecondOrderColumns>(wavelength);
    let [x, y] = trace.columns.screen().unwrap();
    let normal = trace.log.last().unwrap().transfer.n_g;
    let motion = screen_motion(x.point, y.point, trace.columns.lambda().unwrap().point, normal).unwrap();
    let along = second_order_along(&bench.start, &IorJet::VACUUM, motion.extend(1.0), &trace.log);
    assert!(along.point.length() < 1e-14 * x.point.length(), "nothing moves along the solution");
    let motion2 = screen_motion(x.point, y.point, along.point2, normal).unwrap();
    let pixel_at = |delta: f64| {
        let mut pixel = DVec2::ZERO;
        for _ in 0..8 {
            let here = bench.moved(pixel.x, pixel.y).run::<ScreenColumns>(nm(500.0 + delta));
            let [x, y] = here.columns.screen().unwrap();
            pixel += screen_motion(x.point, y.point, here.point - trace.point, normal).unwrap();
        }
        pixel.extend(0.0)
    };
    let (first, second) = differences(pixel_at, 2.0);
    assert!((motion.extend(0.0) - first).length() < 1e-8 * first.length(), "{motion} {first}");
    assert!((motion2.extend(0.0) - second).length() < 1e-5 * second.length(), "{motion2} {second}");
}

#[test]
fn critical_distance_is_where_total_reflection_begins() {
    // A prism face that the ray leaves just before the critical angle; the violet is reflected first.
    let glass = sf66();
    let face = flat(DVec3::Z);
    for distance in [0.1, 1.0, 5.0] {
        let threshold = nm(550.0 - distance);
        let sin_i = 1.0 / glass.at(threshold).ior;
        let d = DVec3::new(sin_i, 0.0, -(1.0 - sin_i * sin_i).sqrt());
        let ior = glass.at(nm(550.0));
        let columns = LambdaColumn::start(&bench::start(DVec3::ZERO, d), &ior);
        let s = refract_or_reflect(d * ior.ior, &face, &ior, &IorJet::VACUUM);
        assert_eq!(s.kind, ScatterKind::Refraction);
        let predicted = critical_distance(&s, columns.lambda().unwrap());
        // First order: the error grows with the distance, over a scale of about 550 nm.
        assert!((predicted / distance - 1.0).abs() < distance / 100.0, "{predicted} for {distance}");
        // And from the other side.
        let ior = glass.at(nm(550.0 - 2.0 * distance));
        let s = refract_or_reflect(d * ior.ior, &face, &ior, &IorJet::VACUUM);
        assert_eq!(s.kind, ScatterKind::TotalReflection);
        let columns = LambdaColumn::start(&bench::start(DVec3::ZERO, d), &ior);
        let predicted = critical_distance(&s, columns.lambda().unwrap());
        assert!((predicted / distance - 1.0).abs() < distance / 50.0, "{predicted} for {distance}");
    }
    let constant = IorJet::constant(1.5);
    let s = refract_or_reflect(incident(20.0, 0.0), &face, &IorJet::VACUUM, &constant);
    assert_eq!(critical_distance(&s, &Column::default()), f64::INFINITY);
    assert_eq!(critical_distance(&mirror(incident(20.0, 0.0), &face, &constant), &Column::default()), f64::INFINITY);
}

#[test]
fn half_width_is_the_least_of_its_bounds() {
    let (p1, p2) = (DVec3::X * 2.0, DVec3::Y * 0.01);
    assert_eq!(half_width(p1, p2, 150.0, f64::INFINITY), 2.0 * 0.05 * 2.0 / 0.01);
    assert_eq!(half_width(p1, p2, 10.0, f64::INFINITY), 10.0);
    assert_eq!(half_width(p1, p2, 150.0, 3.0), 3.0);
    assert_eq!(half_width(p1, DVec3::ZERO, 150.0, f64::INFINITY), 150.0);
    assert_eq!(half_width(DVec3::ZERO, DVec3::ZERO, 150.0, f64::INFINITY), 150.0, "nothing moves");
    assert_eq!(half_width(DVec3::ZERO, p2, 150.0, f64::INFINITY), 0.0, "the first order says nothing");
}

#[test]
fn screen_motion_inverts_the_jacobian_or_is_absent() {
    let (v_x, v_y) = (DVec3::new(1.0, 0.2, 0.0), DVec3::new(-0.1, 0.9, 0.0));
    let motion = screen_motion(v_x, v_y, v_x * -3.0 + v_y * 0.5, DVec3::Z).unwrap();
    assert!((motion - DVec2::new(3.0, -0.5)).length() < 1e-15);
    // The normal's sign and length do not matter, nor do units.
    assert!((screen_motion(v_x, v_y, v_x, DVec3::Z * -7.0).unwrap() - DVec2::new(-1.0, 0.0)).length() < 1e-15);
    let tiny = 1e-30;
    assert!((screen_motion(v_x * tiny, v_y * tiny, v_x * tiny, DVec3::Z).unwrap().x + 1.0).abs() < 1e-15);
    assert_eq!(screen_motion(v_x, v_y, DVec3::ZERO, DVec3::Z).unwrap(), DVec2::ZERO);
    for (x, y, normal) in [
        (DVec3::ZERO, v_y, DVec3::Z),
        (v_x, v_x * 3.0, DVec3::Z),
        (v_x, v_y, DVec3::X),
        (v_x, v_y, DVec3::ZERO),
        (v_x, DVec3::NAN, DVec3::Z),
        (v_x * f64::MAX, v_y * f64::MAX, DVec3::Z),
    ] {
        assert_eq!(screen_motion(x, y, v_x, normal), None, "{x} {y} {normal}");
    }
}

// --------------------------------------------------------------------------------------------------------------- normals

#[test]
fn an_impossible_shading_normal_gives_way_to_the_geometric_one() {
    let curvature = Curvature::Sphere { inv_radius: 0.5 };
    let field = NormalField::Linear { vector: DVec3::X, gradient: DMat3::IDENTITY };
    let glass = IorJet::constant(1.5);
    // Grazing, with the shading normal tilted away from the ray: K·N > 0.
    let d = incident(85.0, 0.0);
    let n_s = DVec3::new(0.5, 0.0, 1.0).normalize();
    assert!(d.dot(n_s) > 0.0);
    let surface = LocalSurface { n_g: DVec3::Z, n_s, curvature, field };
    for s in [refract_or_reflect(d, &surface, &IorJet::VACUUM, &glass), mirror(d, &surface, &IorJet::VACUUM)] {
        assert!(s.geometric_normal_used);
        assert_eq!((s.normal, s.field), (DVec3::Z, NormalField::Sphere { inv_radius: 0.5 }));
    }
    // A mirror tilted so far that the reflection would go into the surface, and one that is not.
    let tilted = |degrees: f64| {
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        LocalSurface { n_g: DVec3::Z, n_s: DVec3::new(sin, 0.0, cos), curvature, field }
    };
    let d = incident(70.0, 0.0);
    for (degrees, expected) in [(9.0, false), (11.0, true), (-40.0, false)] {
        let s = mirror(d, &tilted(degrees), &IorJet::VACUUM);
        assert_eq!(s.geometric_normal_used, expected, "{degrees}°");
        assert!(s.momentum_out.z > 0.0);
    }
    // Leaving at 60°, by the shading normal at 40°, whose refraction at 75° from it would return into the glass: redone
    // with the geometric normal it is a total reflection.
    let d = DVec3::new(60f64.to_radians().sin(), 0.0, 60f64.to_radians().cos());
    let s = refract_or_reflect(d * 1.5, &tilted(20.0), &glass, &IorJet::VACUUM);
    assert!(s.geometric_normal_used && s.kind == ScatterKind::TotalReflection && s.momentum_out.z < 0.0);
    // Leaving: the facing sign is applied to the normal and to its field.
    let d = DVec3::new(0.1, 0.0, 1.0).normalize();
    let sphere = NormalField::Sphere { inv_radius: 0.5 };
    let surface = LocalSurface { n_g: DVec3::Z, n_s: DVec3::Z, curvature, field: sphere };
    let s = refract_or_reflect(d * 1.5, &surface, &glass, &IorJet::VACUUM);
    assert!(!s.geometric_normal_used);
    assert_eq!((s.normal, s.field), (-DVec3::Z, sphere.reversed()));
}

#[test]
fn a_quadric_and_a_sphere_are_one_when_they_are() {
    // The sphere's own description against the general one: f = |q|²/2, ∇f = q, H = 1.
    let radius = 1.3;
    let n = DVec3::new(0.3, -0.2, 0.8).normalize();
    let hessian = DMat3::IDENTITY * (1.0 / radius);
    let sphere = LocalSurface {
        n_g: n,
        n_s: n,
        curvature: Curvature::Sphere { inv_radius: 1.0 / radius },
        field: NormalField::Sphere { inv_radius: 1.0 / radius },
    };
    let curvature = Curvature::Quadric { hessian };
    let quadric = LocalSurface { n_g: n, n_s: n, curvature, field: curvature.normal_field(n) };
    let glass = sf66().at(nm(480.0));
    let follow = |surface: &LocalSurface| {
        let d = DVec3::new(0.1, 0.3, -1.0).normalize();
        let mut columns = SecondOrderColumns::start(&bench::start(DVec3::ZERO, d), &glass);
        columns.transfer(&Transfer {
            distance: 2.5,
            direction: d,
            medium: glass,
            n_g: n,
            curvature: surface.curvature,
        });
        columns.scatter(&refract_or_reflect(d * glass.ior, surface, &glass, &IorJet::VACUUM));
        columns.transfer(&Transfer {
            distance: 1.5,
            direction: -n,
            medium: IorJet::VACUUM,
            n_g: n,
            curvature: surface.curvature,
        });
        columns
    };
    let (a, b) = (follow(&sphere), follow(&quadric));
    let pairs = [(a.lambda(), b.lambda()), (a.lambda2(), b.lambda2())];
    for (a, b) in pairs {
        let (a, b) = (a.unwrap(), b.unwrap());
        assert!(relative(a.point, b.point) < 1e-14 && relative(a.momentum, b.momentum) < 1e-14, "{a:?} {b:?}");
    }
}

#[test]
fn a_gap_of_nothing_only_projects_anew() {
    // Cemented surfaces: t = 0 and t = 1e-12 agree to 1e-9 (MATH.md 5.4).
    let (crown, flint) = (bk7().at(nm(550.0)), sf66().at(nm(550.0)));
    let d = incident(25.0, 0.4);
    let follow = |gap: f64| {
        let mut columns = ScreenColumns::start(&bench::start(DVec3::ZERO, d), &IorJet::VACUUM);
        let plane = Curvature::Plane;
        columns.transfer(&Transfer {
            distance: 1.0,
            direction: d,
            medium: IorJet::VACUUM,
            n_g: DVec3::Z,
            curvature: plane,
        });
        let s = refract_or_reflect(d, &flat(DVec3::Z), &IorJet::VACUUM, &crown);
        columns.scatter(&s);
        let d = s.momentum_out / crown.ior;
        let tilted = DVec3::new(0.1, 0.0, 1.0).normalize();
        columns.transfer(&Transfer { distance: gap, direction: d, medium: crown, n_g: tilted, curvature: plane });
        let s = refract_or_reflect(s.momentum_out, &flat(tilted), &crown, &flint);
        columns.scatter(&s);
        let d = s.momentum_out / flint.ior;
        columns.transfer(&Transfer { distance: 1.0, direction: d, medium: flint, n_g: DVec3::Z, curvature: plane });
        columns
    };
    let (none, tiny) = (follow(0.0), follow(1e-12));
    assert!(relative(tiny.lambda().unwrap().point, none.lambda().unwrap().point) < 1e-9);
    assert!(relative(tiny.screen().unwrap()[0].point, none.screen().unwrap()[0].point) < 1e-9);
}

// ------------------------------------------------------------------------------------------------------------ standalone

#[test]
fn standalone_functions_are_the_same_calculus() {
    let (i, t) = (IorJet::VACUUM, bk7().at(nm(486.0)));
    let d = incident(33.0, 0.2);
    // Either side of the normal gives the same ray.
    let dnormal = DVec3::new(1e-4, -2e-4, 0.0);
    let one = standalone::refract(d, DVec3::Z, i, t, DVec3::ZERO, dnormal);
    let other = standalone::refract(d, -DVec3::Z, i, t, DVec3::ZERO, -dnormal);
    assert_eq!(one, other);
    // Total reflection is the reflection, with its derivative.
    let d = incident(60.0, 0.2);
    let ddirection = d.cross(DVec3::Y) * 1e-5;
    let total = standalone::refract(d, DVec3::Z, t, i, ddirection, dnormal);
    let reflected = standalone::reflect(d, DVec3::Z, ddirection, dnormal);
    assert!(total.total_reflection);
    assert!(relative(total.direction, reflected.direction) < 1e-15);
    assert!(relative(total.ddirection, reflected.ddirection) < 1e-14);
    // ∂d' = ∂d − 2[(∂d·n + d·∂n) n + θ ∂n].
    let (n, theta) = (DVec3::Z, d.z);
    let expected = ddirection - 2.0 * ((ddirection.dot(n) + d.dot(dnormal)) * n + theta * dnormal);
    assert!(relative(reflected.ddirection, expected) < 1e-14);
    // A transfer keeps the moved point in the tangent plane.
    let moved = standalone::transfer(DVec3::Z, DVec3::X * 1e-3, d, ddirection, 2.0, DVec3::Z).unwrap();
    assert!((moved.point - (DVec3::Z + d * 2.0)).length() < 1e-15);
    assert!(moved.dpoint.z.abs() < 1e-18);
    assert_eq!(standalone::transfer(DVec3::Z, DVec3::X, DVec3::X, DVec3::ZERO, 2.0, DVec3::Z), None, "runs along it");
}

#[test]
fn degenerate_input_gives_no_surprise() {
    let glass = bk7().at(nm(550.0));
    // Exactly along the surface: no division by zero.
    for (i, t) in [(IorJet::VACUUM, glass), (glass, IorJet::VACUUM)] {
        let s = refract_or_reflect(DVec3::X * i.ior, &flat(DVec3::Z), &i, &t);
        let mut columns = LambdaColumn::start(&bench::start(DVec3::ZERO, DVec3::X), &i);
        columns.scatter(&s);
        assert!(s.momentum_out.is_finite() && columns.lambda().unwrap().momentum.is_finite());
    }
    // Grazing entry at 89.9999°: everything finite.
    let d = incident(89.9999, 0.1);
    let out = standalone::refract(d, DVec3::Z, IorJet::VACUUM, glass, DVec3::ZERO, DVec3::ZERO);
    assert!(out.ddirection.is_finite() && !out.total_reflection);
    // Straight down: an exactly normal ray neither bends nor turns.
    let out = standalone::refract(-DVec3::Z, DVec3::Z, IorJet::VACUUM, glass, DVec3::ZERO, DVec3::ZERO);
    assert!((out.direction + DVec3::Z).length() < 1e-15 && out.ddirection.length() < 1e-15 * glass.dior_dlambda.abs());
    // A zero distance, a huge one, a tiny one.
    for distance in [0.0, 1e-300, 1e12] {
        let moved = standalone::transfer(DVec3::ZERO, DVec3::X, d, DVec3::Y * 1e-6, distance, DVec3::Z).unwrap();
        assert!(moved.dpoint.is_finite());
    }
    let start = RayStart {
        point: DVec3::ZERO,
        direction: DVec3::X,
        point_x: DVec3::ZERO,
        point_y: DVec3::ZERO,
        direction_x: DVec3::ZERO,
        direction_y: DVec3::ZERO,
        direction_xx: DVec3::ZERO,
        direction_xy: DVec3::ZERO,
        direction_yy: DVec3::ZERO,
        time: 0.0,
    };
    let none = second_order_along(&start, &IorJet::VACUUM, DVec3::ZERO, &[]);
    assert_eq!((none.point2, none.momentum2), (DVec3::ZERO, DVec3::ZERO));
}

#[test]
fn every_bench_meets_its_events() {
    // The chains above are no tests if their rays miss.
    for bench in bench::all() {
        let trace = bench.run::<NoColumns>(nm(550.0));
        assert_eq!(trace.events, bench.elements.len(), "{}", bench.name);
        assert!(bench.elements.iter().any(|e| matches!(e.event, Event::Interface { .. })));
        assert!(bench.elements.iter().all(|e| !matches!(e.shape, Shape::Sphere { radius, .. } if radius <= 0.0)));
    }
}

#[test]
fn a_momentum_alone_goes_where_it_goes_with_its_derivatives() {
    let mut next = random(6);
    let mut unit = || (DVec3::new(next(), next(), next()) - 0.5).normalize();
    for i in 0..10_000 {
        let (direction, n_g, bent) = (unit(), unit(), unit());
        // From hardly bent to impossible.
        let n_s = (n_g + bent * f64::from(i % 7) * 0.3).normalize();
        let field = NormalField::Linear { vector: n_s, gradient: DMat3::from_diagonal(bent) };
        let curvature = Curvature::Quadric { hessian: DMat3::from_diagonal(n_s) };
        let surface = LocalSurface { n_g, n_s, curvature, field };
        let (ior_i, ior_t) = [(1.0, 1.5), (1.5, 1.0), (1.7, 1.7)][i as usize % 3];
        let momentum = ior_i * direction;
        let (before, behind) = (IorJet::constant(ior_i), IorJet::constant(ior_t));
        for (long, ior_t) in [
            (refract_or_reflect(momentum, &surface, &before, &behind), Some(ior_t)),
            (mirror(momentum, &surface, &before), None),
        ] {
            let short = deflect(momentum, &surface.normals(), ior_i, ior_t);
            assert_eq!((short.kind, short.momentum), (long.kind, long.momentum_out));
        }
    }
}
