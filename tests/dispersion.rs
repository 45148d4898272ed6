//! Dispersion laws against 120-digit arithmetic, the proofs of their bounds, and valid ranges.
//!
//! The oracle states each formula once more, straight from the document of refractiveindex.info, and differentiates it by
//! central differences with a step of 2⁻⁶⁴ µm, whose error of 2⁻¹²⁸ is far below an `f64`'s.

#![expect(clippy::print_stdout, reason = "the worst errors found are what one reads these tests for")]

#[path = "support/bench.rs"]
#[expect(dead_code, reason = "only its random numbers and glasses are used here")]
mod bench;

use abbe::optics::IorJet;
use abbe::optics::dispersion::{Dispersion, Law, OutOfRange, ValidRange};
use abbe::spectrum::{LONGEST, SHORTEST, Wavelength, lines};
use bench::random;
use dashu_float::FBig;

type Big = FBig<dashu_float::round::mode::HalfEven, 2>;

const BITS: usize = 400;

fn big(x: f64) -> Big {
    Big::try_from(x).unwrap().with_precision(BITS).value()
}

fn float(x: &Big) -> f64 {
    x.to_f64().value()
}

/// λ^p, also for exponents that are no integers.
fn pow(x: &Big, p: f64) -> Big {
    match p.fract() == 0.0 && p.abs() < 64.0 {
        true if p < 0.0 => big(1.0) / pow(x, -p),
        true => (0..p as i32).fold(big(1.0), |product, _| product * x),
        false => x.powf(&big(p)),
    }
}

fn nm(nanometers: f64) -> Wavelength {
    Wavelength::from_nanometers(nanometers)
}

fn extrapolated(law: Result<Law, String>) -> Dispersion {
    Dispersion::new(law.unwrap(), None, OutOfRange::Extrapolate).unwrap()
}

/// n(λ) of a formula of refractiveindex.info, λ in µm.
fn formula(number: i32, c: &[f64], l: &Big) -> Big {
    let x = l * l;
    let pairs = |from: usize| (from..c.len().saturating_sub(1)).step_by(2);
    let one = || big(1.0);
    match number {
        1 => pairs(1).fold(one() + big(c[0]), |n, i| n + big(c[i]) * &x / (&x - big(c[i + 1]) * big(c[i + 1]))).sqrt(),
        2 => pairs(1).fold(one() + big(c[0]), |n, i| n + big(c[i]) * &x / (&x - big(c[i + 1]))).sqrt(),
        3 => pairs(1).fold(big(c[0]), |n, i| n + big(c[i]) * pow(l, c[i + 1])).sqrt(),
        4 => {
            let fraction = |i: usize| match c.get(i) {
                Some(&a) if a != 0.0 => big(a) * pow(l, c[i + 1]) / (&x - pow(&big(c[i + 2]), c[i + 3])),
                _ => big(0.0),
            };
            let start = big(c[0]) + fraction(1) + fraction(5);
            pairs(9).fold(start, |n, i| n + big(c[i]) * pow(l, c[i + 1])).sqrt()
        }
        5 => pairs(1).fold(big(c[0]), |n, i| n + big(c[i]) * pow(l, c[i + 1])),
        6 => pairs(1).fold(one() + big(c[0]), |n, i| n + big(c[i]) / (big(c[i + 1]) - one() / &x)),
        7 => {
            // 0.028 as an f64 has it: it is a coefficient like the others.
            let inverse = one() / (&x - big(0.028));
            let start = big(c[0]) + big(c[1]) * &inverse + big(c[2]) * &inverse * &inverse;
            (3..c.len()).fold(start, |n, i| n + big(c[i]) * pow(l, 2.0 * (i as f64 - 2.0)))
        }
        8 => {
            let q = big(c[0]) + big(c[1]) * &x / (&x - big(c[2])) + big(c[3]) * &x;
            ((one() + big(2.0) * &q) / (one() - q)).sqrt()
        }
        9 => {
            let v = l - big(c[4]);
            (big(c[0]) + big(c[1]) / (&x - big(c[2])) + big(c[3]) * &v / (&v * &v + big(c[5]))).sqrt()
        }
        _ => unreachable!(),
    }
}

/// n, n', n'' per µm by central differences.
fn jet(n: impl Fn(&Big) -> Big, wavelength: Wavelength) -> [f64; 3] {
    let h = big(2f64.powi(-64));
    let x = big(wavelength.micrometers());
    let (low, middle, high) = (n(&(&x - &h)), n(&x), n(&(&x + &h)));
    let first = (&high - &low) / (big(2.0) * &h);
    let second = (high - big(2.0) * &middle + low) / (&h * &h);
    [float(&middle), float(&first), float(&second)]
}

/// 360, 370 … 830 nm.
fn band() -> impl Iterator<Item = Wavelength> {
    (0..=47).map(|step| nm(360.0 + 10.0 * f64::from(step)))
}

/// The worst errors of n, n', n'' over the band. The scale of each is its own largest size in the band: n' and n'' may
/// pass through 0, where a relative error has no meaning.
fn worst(law: &Dispersion, n: impl Fn(&Big) -> Big) -> [f64; 3] {
    let (mut errors, mut scales) = ([0.0f64; 3], [0.0f64; 3]);
    for wavelength in band() {
        let jet_of_law = law.at(wavelength);
        let found = [jet_of_law.ior, 1e3 * jet_of_law.dior_dlambda, 1e6 * jet_of_law.d2ior_dlambda2];
        let exact = jet(&n, wavelength);
        for i in 0..3 {
            errors[i] = errors[i].max((found[i] - exact[i]).abs());
            scales[i] = scales[i].max(exact[i].abs());
        }
    }
    std::array::from_fn(|i| errors[i] / scales[i])
}

/// Entries of the refractiveindex.info database, one formula each, and variations that its entries leave out: exponents
/// that are no integers, negative C, many terms.
fn entries() -> Vec<(&'static str, i32, Vec<f64>)> {
    vec![
        ("SiO2 Malitson", 1, vec![0.0, 0.6961663, 0.0684043, 0.4079426, 0.1162414, 0.8974794, 9.896161]),
        ("N-BK7 SCHOTT", 2, vec![0.0, 1.03961212, 0.00600069867, 0.231792344, 0.0200179144, 1.01046945, 103.560653]),
        ("a constant and a negative C", 2, vec![0.5, 0.7, 0.01, 0.2, -0.3]),
        (
            "dioxane Moutzouris",
            3,
            vec![1.996073056, -0.00163203, 2.0, 0.00665705, -2.0, 6.00055e-5, -4.0, 7.70185e-5, -6.0],
        ),
        ("any exponents", 3, vec![2.1, 0.03, -1.5, -0.01, 0.7, 2e-4, -5.25, 1e-3, std::f64::consts::PI]),
        (
            "nine terms",
            3,
            vec![
                2.1, 0.01, -1.0, 0.002, -2.0, 1e-3, -3.0, 1e-4, -4.0, 1e-5, -5.0, 1e-3, 1.0, -2e-3, 2.0, 1e-3, 3.0,
                -4e-4, 4.0,
            ],
        ),
        (
            "KHP Moutzouris β",
            4,
            vec![2.670444937, 0.031617528, 0.0, 0.208293225, 2.0, 0.0, 0.0, 0.0, 1.0, -0.004014395, 2.0],
        ),
        ("LBO Chen β, C4 < 0", 4, vec![2.525, 0.017123, 0.0, -0.0060517, 1.0, 0.0, 0.0, 0.0, 1.0, -0.0087838, 2.0]),
        (
            "KNbO3-like, two fractions",
            4,
            vec![1.0, 2.497064, 2.0, 0.1290921, 2.0, 1.336582, 2.0, 0.2581573, 2.0, -0.02517432, 2.0],
        ),
        ("odd exponents", 4, vec![2.0, 0.05, 1.3, 0.11, 1.7, -0.02, -0.5, 9.0, 1.1, 0.01, -1.7, 0.002, 2.9]),
        ("one fraction", 4, vec![2.0, 0.05, 3.0, 0.04, 1.0]),
        ("heptane Kerl", 5, vec![1.38248838, -4.05375e-3, -1.0, 4.58433e-3, -2.0]),
        ("half exponents", 5, vec![1.5, 0.01, -0.5, 0.001, -3.5, -0.0003, 1.25]),
        ("5PCH Wu", 6, vec![0.3866, 1.49, 25.0, 0.53, 18.1077]),
        ("air Ciddor", 6, vec![0.0, 0.05792105, 238.0185, 0.00167917, 57.362]),
        ("Herzberger", 7, vec![1.5, 0.0061, 0.00032, -0.0029, 1.3e-5, -1.9e-6, 4e-8]),
        ("Herzberger, four coefficients", 7, vec![3.41983, 0.159906, -0.00123109, 1.26878e-6]),
        ("AgBr Schroter", 8, vec![0.452505, 0.09939, 0.070537, -0.000150]),
        ("urea Rosker e", 9, vec![2.51527, 0.0240, 0.0300, 0.020, 1.52, 0.8771]),
        ("a line in the band", 9, vec![2.5, 0.02, 0.03, 0.002, 0.55, 0.01]),
    ]
}

#[test]
fn formulas_of_refractiveindex_info_and_their_derivatives() {
    let mut overall = [0.0f64; 3];
    for (name, number, coefficients) in entries() {
        let law = extrapolated(Law::formula(number, &coefficients));
        let errors = worst(&law, |l| formula(number, &coefficients, l));
        println!("formula {number}, {name}: n {:.1e}, n' {:.1e}, n'' {:.1e}", errors[0], errors[1], errors[2]);
        for i in 0..3 {
            overall[i] = overall[i].max(errors[i]);
        }
    }
    assert!(overall[0] < 1e-15 * 4.0, "n: {:e}", overall[0]);
    assert!(overall[1] < 1e-10 && overall[2] < 1e-10, "n', n'': {overall:?}");
}

#[test]
fn named_laws_and_their_derivatives() {
    let schott = [2.2718929, -0.010108077, 0.010592509, 0.00020816965, -7.6472538e-06, 4.9240991e-07];
    let law = extrapolated(Law::schott(&schott));
    let n = |l: &Big| {
        let powers = [0.0, 2.0, -2.0, -4.0, -6.0, -8.0];
        schott.iter().zip(powers).fold(big(0.0), |n, (a, p)| n + big(*a) * pow(l, p)).sqrt()
    };
    // BK7 of SCHOTT's older catalogues, n_d = 1.51680.
    assert!((law.at(lines::D).ior - 1.51680).abs() < 5e-6);
    let errors = worst(&law, n);
    println!("Schott: {errors:?}");
    assert!(errors.iter().all(|e| *e < 1e-10));

    let conrady = [1.5, 0.0091, 0.000527];
    let law = extrapolated(Law::conrady(&conrady));
    let n = |l: &Big| big(conrady[0]) + big(conrady[1]) / l + big(conrady[2]) / (pow(l, 3.0) * l.sqrt());
    let errors = worst(&law, n);
    println!("Conrady: {errors:?}");
    assert!(errors.iter().all(|e| *e < 1e-10));
    assert!(Law::conrady(&[1.5, 0.01, 0.001, 0.1]).unwrap_err().contains("A, B and C"));
    assert!(Law::schott(&[]).is_err());

    let cauchy = [1.5045833, 0.0042175527, 1.3e-4, -2e-6, 1e-8];
    let law = extrapolated(Law::cauchy(&cauchy));
    let n = |l: &Big| cauchy.iter().enumerate().fold(big(0.0), |n, (k, a)| n + big(*a) * pow(l, -2.0 * k as f64));
    assert!(worst(&law, n).iter().all(|e| *e < 1e-10));
}

#[test]
fn formulas_one_two_and_five_are_the_named_laws() {
    let (b, c) = ([1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653]);
    let interleaved: Vec<f64> = std::iter::once(0.0).chain(b.iter().zip(&c).flat_map(|(b, c)| [*b, *c])).collect();
    assert_eq!(Law::formula(2, &interleaved).unwrap(), Law::sellmeier(&b, &c).unwrap());
    let roots: Vec<f64> = std::iter::once(0.2).chain([1.0, 0.1, 0.5, -0.05]).collect();
    assert_eq!(
        Law::formula(1, &roots).unwrap(),
        Law::sellmeier_squared(0.2, &[1.0, 0.5], &[0.1, 0.05]).unwrap(),
        "C is squared, so its sign has no say"
    );
    let (five, cauchy) =
        (Law::formula(5, &[1.5, 0.004, -2.0, 1e-4, -4.0]).unwrap(), Law::cauchy(&[1.5, 0.004, 1e-4]).unwrap());
    assert_eq!(five, cauchy);
    for number in 1..=9 {
        let constant = extrapolated(Law::formula(number, &[if number == 8 { 0.3 } else { 2.0 }]));
        assert!(constant.is_constant(), "formula {number} of one coefficient");
    }
    // Formulas 1, 2 and 6 add 1; 3, 4 and 9 state n²; 8 states (n²−1)/(n²+2): ε = (1 + 2·0.3)/(1 − 0.3).
    for (number, c1, ior) in [
        (1, 1.25, 1.5),
        (2, 1.25, 1.5),
        (3, 2.25, 1.5),
        (4, 2.25, 1.5),
        (5, 1.5, 1.5),
        (6, 0.5, 1.5),
        (7, 1.5, 1.5),
        (8, 0.3, (1.6f64 / 0.7).sqrt()),
        (9, 2.25, 1.5),
    ] {
        assert!((extrapolated(Law::formula(number, &[c1])).at(lines::D).ior - ior).abs() < 4e-16, "formula {number}");
    }
}

#[test]
fn formulas_with_wrong_coefficients_say_what_is_wrong() {
    let refused = |number: i32, coefficients: &[f64]| Law::formula(number, coefficients).unwrap_err();
    assert!(refused(0, &[1.0]).contains("1 to 9") && refused(10, &[1.0]).contains("1 to 9"));
    for number in 1..=9 {
        assert!(refused(number, &[]).contains("at least one"));
        assert!(refused(number, &[f64::NAN]).contains("no finite number"));
        assert!(refused(number, &[1.0; 65]).contains("at most 64"));
    }
    for number in [1, 2, 3, 5, 6] {
        assert!(refused(number, &[0.0, 1.0]).contains("the last pair is cut short"), "formula {number}");
    }
    assert!(refused(4, &[2.0, 0.1, 0.0, 0.2]).contains("four values"));
    assert!(refused(4, &[2.0, 0.1, 0.0, -0.2, 0.5]).contains("no real number"), "the root of a negative number");
    assert!(refused(4, &[2.0, 0.1, 0.0, 0.0, -1.0]).contains("no real number"), "1/0");
    assert!(refused(4, &[2.0, 0.1, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5]).contains("cut short"));
    assert!(refused(8, &[0.4, 0.1, 0.1, 0.0, 0.0]).contains("takes 4 coefficients, 5 are given"));
    assert!(refused(9, &[2.0; 7]).contains("takes 6 coefficients, 7 are given"));
    assert!(refused(1, &[0.0, 1.0, 1e200]).contains("squares"));
}

// --------------------------------------------------------------------------------------------------------------- proofs

fn refused(law: Result<Law, String>) -> String {
    Dispersion::new(law.unwrap(), None, OutOfRange::Extrapolate).unwrap_err()
}

#[test]
fn poles_in_the_band_are_found_in_every_formula() {
    // At √0.3 µm = 547.7 nm, too narrow to be met by sampling.
    let tiny = 1e-14;
    for (number, coefficients) in [
        (1, vec![1.25, tiny, 0.3f64.sqrt()]),
        (2, vec![1.25, tiny, 0.3]),
        (4, vec![2.25, tiny, 1.3, 0.3, 1.0]),
        (4, vec![2.25, 0.0, 0.0, 0.0, 0.0, tiny, -1.0, 0.3f64.sqrt(), 2.0]),
        (6, vec![0.5, tiny, 1.0 / 0.3]),
        (8, vec![0.3, tiny, 0.3, 0.0]),
        (9, vec![2.25, tiny, 0.3, 0.0, 0.0, 0.0]),
        (9, vec![2.25, 0.0, 0.0, tiny, 0.5477225575, 0.0]),
        (9, vec![2.25, 0.0, 0.0, tiny, 0.9, -0.1241]),
    ] {
        let problem = refused(Law::formula(number, &coefficients));
        assert!(problem.contains("pole at 547.7"), "formula {number}: {problem}");
    }
    // Beside the band they are fine, also those of a factor 0 within.
    for coefficients in [vec![1.25, 1e-3, 0.12], vec![1.25, 1e-3, 0.7], vec![1.25, 0.0, 0.3]] {
        assert!(Dispersion::new(Law::formula(2, &coefficients).unwrap(), None, OutOfRange::Extrapolate).is_ok());
    }
    // Clamped laws are not used outside of their range, so a pole there does not matter.
    let law = Law::formula(2, &[1.25, 1e-4, 0.16]).unwrap();
    let valid = Some(ValidRange { from: nm(420.0), to: nm(900.0) });
    assert!(Dispersion::new(law.clone(), valid, OutOfRange::Extrapolate).unwrap_err().contains("pole at 400.000 nm"));
    for outside in [OutOfRange::Clamp, OutOfRange::Error] {
        assert!(Dispersion::new(law.clone(), valid, outside).is_ok());
    }
}

#[test]
fn indices_out_of_bounds_are_found_between_samples() {
    // n² < 0 over a thousandth of a nanometre: a Lorentzian line of half-width 10⁻⁶ µm and depth 1e-5/2e-6 = 5.
    let problem = refused(Law::formula(9, &[2.25, 0.0, 0.0, 1e-5, 0.5, 1e-12]));
    assert!(problem.contains("500.00") || problem.contains("499.99"), "{problem}");
    assert!(
        Dispersion::new(Law::formula(9, &[2.25, 0.0, 0.0, 1e-6, 0.5, 1e-12]).unwrap(), None, OutOfRange::Clamp).is_ok()
    );
    // Formula 4's fraction turns within the band: λ⁻²/(λ² − c) has its extreme at λ² = c/2 for p = −2 …
    let c: f64 = -0.5;
    let turn = (-2.0 * c / -4.0f64).abs().sqrt();
    assert!((0.36..0.83).contains(&turn));
    // … and p = 4, c < 0: λ⁴/(λ² − c) rises all through; p = 1, c = −0.3: λ/(λ² + 0.3) has a maximum at √0.3 µm.
    let peak = 0.3f64.sqrt() / 0.6;
    let touching = |depth: f64| Law::formula(4, &[1e-4 + depth, -1.0, 1.0, -0.3, 1.0]);
    assert!(refused(touching(peak - 1e-7)).contains("547."), "below the limit at the turning point only");
    assert!(Dispersion::new(touching(peak + 1e-7).unwrap(), None, OutOfRange::Clamp).is_ok());
    // Beyond the pole of the Lorentz–Lorenz ratio at 1, or below −1/2, there is no index.
    for c1 in [1.0, 1.2, -0.5, -3.0] {
        assert!(Dispersion::new(Law::formula(8, &[c1]).unwrap(), None, OutOfRange::Clamp).is_err(), "{c1}");
    }
    // A spline that overshoots between its entries, all of which are harmless.
    let overshoot = [[400.0, 1.5], [500.0, 1.5], [500.001, 1.2], [500.002, 1.5], [600.0, 1.5]];
    assert!(refused(Law::table(&overshoot)).contains("too coarse for a spline"));
    assert!(refused(Law::formula(3, &[1e308, 1e308, 1.0])).contains("360–830"));
    assert!(refused(Law::formula(3, &[2.0, 1.0, 1e6, -1.0, 1e6, 1.0, -1e4])).contains("360–830"));
}

/// A law of random coefficients around what media have, often beyond.
fn drawn(number: i32, next: &mut impl FnMut() -> f64) -> Vec<f64> {
    let mut signed = |size: f64| (2.0 * next() - 1.0) * size;
    match number {
        1 | 2 => vec![0.5 + signed(1.0), signed(1.5), 0.4 + signed(0.5), signed(1.5), signed(1.5)],
        3 => vec![1.5 + signed(1.5), signed(1.0), signed(4.0), signed(1.0), signed(4.0)],
        4 => {
            let mut c = vec![1.0 + signed(1.0)];
            for _ in 0..2 {
                c.extend([signed(0.6), signed(4.0), signed(1.0).abs(), 2.0 + signed(1.0)]);
            }
            c.extend([signed(0.5), signed(3.0)]);
            c
        }
        5 => vec![1.0 + signed(1.0), signed(1.0), signed(4.0), signed(1.0), signed(4.0)],
        6 => vec![signed(1.0), signed(5.0), signed(9.0), signed(5.0), signed(9.0)],
        7 => vec![1.0 + signed(1.0), signed(0.2), signed(0.1), signed(1.0), signed(1.0)],
        8 => vec![signed(0.8), signed(0.5), signed(0.4), signed(0.8)],
        _ => vec![1.5 + signed(1.5), signed(0.5), signed(0.4), signed(0.2), 0.6 + signed(0.5), signed(0.05)],
    }
}

#[test]
fn what_is_accepted_holds_everywhere_and_what_is_refused_fails_somewhere() {
    let mut next = random(7);
    let (mut accepted, mut refused) = (0, 0);
    for draw in 0..3600 {
        let number = draw % 9 + 1;
        let coefficients = drawn(number, &mut next);
        let Ok(law) = Law::formula(number, &coefficients) else { continue };
        let built = Dispersion::new(law, None, OutOfRange::Extrapolate);
        // The formula again, in plain arithmetic.
        let steps = 470;
        let samples = (0..=steps).map(|i| 0.36 + 0.47 * f64::from(i) / f64::from(steps));
        let value = |l: f64| plain(number, &coefficients, l);
        let outside = samples.clone().any(|l| !(value(l) > 0.01 && value(l) < 100.0));
        match built {
            Ok(_) => {
                accepted += 1;
                assert!(!outside, "formula {number} {coefficients:?}");
            }
            Err(problem) => {
                refused += 1;
                // The place that the message names is one.
                let place = problem.split("at ").find_map(|part| part.split(" nm").next()?.parse::<f64>().ok());
                let Some(place) = place else {
                    assert!(problem.contains("divide them by 10^6"), "{problem}");
                    continue;
                };
                let found = value(place / 1e3);
                let is_pole = problem.contains("pole");
                assert!(
                    is_pole || !(found > 0.0101 && found < 99.9),
                    "formula {number} {coefficients:?}: {problem}, {found}"
                );
            }
        }
    }
    println!("{accepted} accepted, {refused} refused");
    assert!(accepted > 500 && refused > 500);
}

/// n(λ) in plain arithmetic.
fn plain(number: i32, c: &[f64], l: f64) -> f64 {
    let x = l * l;
    let pairs = |from: usize| (from..c.len().saturating_sub(1)).step_by(2);
    match number {
        1 => (1.0 + c[0] + pairs(1).map(|i| c[i] * x / (x - c[i + 1] * c[i + 1])).sum::<f64>()).sqrt(),
        2 => (1.0 + c[0] + pairs(1).map(|i| c[i] * x / (x - c[i + 1])).sum::<f64>()).sqrt(),
        3 => (c[0] + pairs(1).map(|i| c[i] * l.powf(c[i + 1])).sum::<f64>()).sqrt(),
        4 => {
            let fraction = |i: usize| c[i] * l.powf(c[i + 1]) / (x - c[i + 2].powf(c[i + 3]));
            (c[0] + fraction(1) + fraction(5) + pairs(9).map(|i| c[i] * l.powf(c[i + 1])).sum::<f64>()).sqrt()
        }
        5 => c[0] + pairs(1).map(|i| c[i] * l.powf(c[i + 1])).sum::<f64>(),
        6 => 1.0 + c[0] + pairs(1).map(|i| c[i] / (c[i + 1] - 1.0 / x)).sum::<f64>(),
        7 => {
            let inverse = 1.0 / (x - 0.028);
            c[0] + c[1] * inverse
                + c[2] * inverse * inverse
                + (3..c.len()).map(|i| c[i] * x.powi(i as i32 - 2)).sum::<f64>()
        }
        8 => {
            let q = c[0] + c[1] * x / (x - c[2]) + c[3] * x;
            ((1.0 + 2.0 * q) / (1.0 - q)).sqrt()
        }
        _ => {
            let v = l - c[4];
            (c[0] + c[1] / (x - c[2]) + c[3] * v / (v * v + c[5])).sqrt()
        }
    }
}

#[test]
fn coefficients_for_nanometres_are_recognised() {
    // N-BK7 with C in nm²: n = 0.99997 would violate no bound.
    let c = [0.00600069867e6, 0.0200179144e6, 103.560653e6];
    let problem = refused(Law::sellmeier(&[1.03961212, 0.231792344, 1.01046945], &c));
    assert!(problem.contains("1.5168") && problem.contains("divide them by 10^6"), "{problem}");
    let roots = c.map(f64::sqrt);
    assert!(refused(Law::sellmeier_squared(0.0, &[1.03961212, 0.231792344, 1.01046945], &roots)).contains("nm²"));
    for (law, nd) in [
        (Law::cauchy(&[1.5045833, 4217.5527]), "1.5168"),
        (Law::schott(&[2.2718929, -0.010108077e-6, 0.010592509e6, 0.00020816965e12]), "1.516"),
        (Law::conrady(&[1.5, 9.1, 0.000527e10]), "1.5"),
    ] {
        let problem = refused(law);
        assert!(problem.contains("coefficients for λ in nm") && problem.contains(nd), "{problem}");
    }
}

// --------------------------------------------------------------------------------------------------------------- tables

/// The 4(N−1) coefficients of the not-a-knot spline, by elimination in 400 bits of the conditions that define it.
fn exact_spline(points: &[[f64; 2]]) -> Vec<[Big; 4]> {
    let pieces = points.len() - 1;
    let size = 4 * pieces;
    let x: Vec<Big> = points.iter().map(|point| big(nm(point[0]).micrometers())).collect();
    let mut rows: Vec<Vec<Big>> = Vec::new();
    let row = |entries: &[(usize, Big)], right: Big| {
        let mut row = vec![big(0.0); size + 1];
        for (column, value) in entries {
            row[*column] = &row[*column] + value;
        }
        row[size] = right;
        row
    };
    for i in 0..pieces {
        let h = &x[i + 1] - &x[i];
        let power = |k: usize| (0..k).fold(big(1.0), |product, _| product * &h);
        rows.push(row(&[(4 * i, big(1.0))], big(points[i][1])));
        let ends: Vec<_> = (0..4).map(|k| (4 * i + k, power(k))).collect();
        rows.push(row(&ends, big(points[i + 1][1])));
        if i + 1 < pieces {
            let slope: Vec<_> = (1..4).map(|k| (4 * i + k, big(k as f64) * power(k - 1))).collect();
            rows.push(row(&[&slope[..], &[(4 * i + 5, big(-1.0))]].concat(), big(0.0)));
            let bend = [(4 * i + 2, big(2.0)), (4 * i + 3, big(6.0) * &h), (4 * i + 6, big(-2.0))];
            rows.push(row(&bend, big(0.0)));
        }
    }
    // Not a knot: the third derivative goes on over the first and the last inner point.
    rows.push(row(&[(3, big(1.0)), (7, big(-1.0))], big(0.0)));
    rows.push(row(&[(size - 1, big(1.0)), (size - 5, big(-1.0))], big(0.0)));
    for column in 0..size {
        let magnitude = |row: &Vec<Big>| float(&row[column]).abs();
        let pivot = (column..size).max_by(|&a, &b| magnitude(&rows[a]).total_cmp(&magnitude(&rows[b]))).unwrap();
        rows.swap(column, pivot);
        let pivot = rows[column].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            if i != column && row[column] != big(0.0) {
                let factor = &row[column] / &pivot[column];
                for (value, above) in row.iter_mut().zip(&pivot) {
                    *value = &*value - &factor * above;
                }
            }
        }
    }
    let solved: Vec<Big> = (0..size).map(|i| &rows[i][size] / &rows[i][i]).collect();
    solved.chunks_exact(4).map(|piece| std::array::from_fn(|k| piece[k].clone())).collect()
}

fn bk7_table(step: f64) -> Vec<[f64; 2]> {
    let count = (520.0 / step).round() as i32;
    (0..=count)
        .map(|i| {
            let wavelength = 340.0 + step * f64::from(i);
            [wavelength, bench::bk7().at(nm(wavelength)).ior]
        })
        .collect()
}

#[test]
fn a_table_is_the_not_a_knot_spline_with_its_derivatives() {
    let points = [
        [340.0, 1.5402],
        [365.0, 1.5363],
        [404.6561, 1.53024],
        [435.8343, 1.52668],
        [486.1327, 1.52238],
        [587.5618, 1.5168],
        [590.0, 1.5167],
        [706.5188, 1.51289],
        [900.0, 1.5088],
    ];
    let table = extrapolated(Law::table(&points));
    let exact = exact_spline(&points);
    let spline = |l: &Big| {
        let piece = points.iter().rposition(|point| big(nm(point[0]).micrometers()) <= *l).unwrap().min(7);
        let t = l - big(nm(points[piece][0]).micrometers());
        exact[piece].iter().rev().fold(big(0.0), |sum, c| sum * &t + c)
    };
    let errors = worst(&table, spline);
    println!("spline: n {:.1e}, n' {:.1e}, n'' {:.1e}", errors[0], errors[1], errors[2]);
    assert!(errors.iter().all(|e| *e < 1e-10), "{errors:?}");
    for [wavelength, ior] in points {
        assert!((table.at(nm(wavelength)).ior - ior).abs() < 4e-16, "entries are met");
    }
    // C²: what is left of a jump at a knot is the slope of n'' over the distance of two neighbouring numbers.
    for [wavelength, _] in &points[1..8] {
        let (before, after) = (table.at(nm(wavelength.next_down())), table.at(nm(wavelength.next_up())));
        assert!((before.dior_dlambda - after.dior_dlambda).abs() < 1e-13 * after.dior_dlambda.abs());
        assert!((before.d2ior_dlambda2 - after.d2ior_dlambda2).abs() < 1e-10 * after.d2ior_dlambda2.abs().max(1e-9));
    }
}

#[test]
fn tables_reproduce_what_they_can() {
    // A cubic at any spacing, a parabola by three entries, a line by two: exactly, also between entries and beyond.
    let cubic = |l: f64| 1.5 + 0.1 * (l - 0.5) - 0.3 * (l - 0.5) * (l - 0.5) + 0.7 * (l - 0.5).powi(3);
    let spaced = [360.0, 371.0, 430.0, 560.0, 561.0, 800.0].map(|wavelength| [wavelength, cubic(wavelength / 1e3)]);
    let parabola = |l: f64| 1.5 + 0.1 * (l - 0.5) - 0.3 * (l - 0.5) * (l - 0.5);
    let line = |l: f64| 1.6 - 0.1 * l;
    for (entries, law, second) in [
        (&spaced[..], &cubic as &dyn Fn(f64) -> f64, Some(0.7)),
        (&spaced[..4], &cubic, Some(0.7)),
        (&[400.0, 450.0, 700.0].map(|w| [w, parabola(w / 1e3)])[..], &parabola, Some(0.0)),
        (&[400.0, 700.0].map(|w| [w, line(w / 1e3)])[..], &line, None),
    ] {
        let table = extrapolated(Law::table(entries));
        for wavelength in band() {
            let l = wavelength.micrometers();
            let jet = table.at(wavelength);
            assert!((jet.ior - law(l)).abs() < 1e-13, "{wavelength}");
            let expected = second.map_or(0.0, |third: f64| -0.6 + 6.0 * third * (l - 0.5));
            // Values rounded to ε over neighbours 1 nm apart: ε/(1e-3)² in n''.
            assert!((1e6 * jet.d2ior_dlambda2 - expected).abs() < 1e-8, "{wavelength}: {jet:?}");
        }
    }
    assert!(extrapolated(Law::table(&[[400.0, 1.5], [600.0, 1.5], [800.0, 1.5]])).is_constant());
}

#[test]
fn a_table_says_how_far_its_second_derivative_holds() {
    // The truth is known here: a table of a glass, exact or with five decimals as printed. What is stated must not be less
    // than the error there is, and small where the table is good.
    let error = |table: &[[f64; 2]]| {
        let law = extrapolated(Law::table(table));
        let (mut difference, mut size) = (0.0, 0.0);
        for wavelength in band() {
            let (spline, exact) = (law.at(wavelength).d2ior_dlambda2, bench::bk7().at(wavelength).d2ior_dlambda2);
            difference += (spline - exact) * (spline - exact);
            size += exact * exact;
        }
        (f64::sqrt(difference / size), law.curvature_doubt().unwrap())
    };
    let rounded = |table: &[[f64; 2]], digits: f64| -> Vec<[f64; 2]> {
        table.iter().map(|[l, n]| [*l, (n * digits).round() / digits]).collect()
    };
    for step in [5.0, 10.0, 20.0, 40.0] {
        let (good, coarse) = (bk7_table(step), rounded(&bk7_table(step), 1e5));
        for (name, table) in [("exact", &good), ("five decimals", &coarse)] {
            let (actual, stated) = error(table);
            println!("every {step} nm, {name}: n'' is off by {actual:.2e}, stated {stated:.2e}");
            assert!(stated > 0.8 * actual, "not honest: {stated} for {actual}");
            assert!(stated < 20.0 * actual, "not useful: {stated} for {actual}");
        }
    }
    let (_, stated) = error(&bk7_table(5.0));
    assert!(stated < 0.02, "a fine table is trusted: {stated}");
    let text = extrapolated(Law::table(&bk7_table(10.0))).describe();
    assert!(
        text.contains("table of 53 entries from 340 nm to 860 nm") && text.contains("every second entry"),
        "{text}"
    );
    let few = extrapolated(Law::table(&[[400.0, 1.52], [500.0, 1.51], [700.0, 1.505]]));
    assert!(few.curvature_doubt().is_none() && few.describe().contains("too few entries"));
    assert!(bench::bk7().curvature_doubt().is_none(), "a formula has nothing to doubt");
}

#[test]
fn tables_that_cannot_be_read_say_what_to_do() {
    for (entries, remedy) in [
        (&[][..], "no entry, two at least"),
        (&[[500.0, 1.5]], "one entry, two at least"),
        (&[[0.4, 1.5], [0.7, 1.49]], "look like µm (0.4): nm are wanted, multiply them by 1000"),
        (&[[0.5, 1.5]], "look like µm"),
        (&[[1.5, 400.0], [1.49, 700.0]], "columns swapped"),
        (&[[700.0, 1.49], [400.0, 1.5]], "decreasing wavelengths: reverse"),
        (&[[400.0, 1.5], [600.0, 1.49], [500.0, 1.495]], "has 500 nm after 600 nm: wavelengths must increase"),
        (&[[400.0, 1.5], [400.0, 1.5], [500.0, 1.495]], "two entries at 400 nm"),
        (&[[-400.0, 1.5], [700.0, 1.49]], "the wavelength -400 nm: it must be positive"),
        (&[[400.0, f64::NAN], [700.0, 1.49]], "finite"),
        (&[[400.0, 1.5], [f64::INFINITY, 1.49]], "finite"),
        (&[[400.0, 0.0], [700.0, 1.49]], "has the index 0 at 400 nm: it must be positive"),
        (&[[400.0, 1.5], [700.0, -1.49]], "has the index -1.49 at 700 nm"),
    ] {
        let problem = Law::table(entries).unwrap_err();
        assert!(problem.contains(remedy), "{problem}");
    }
    let problem = refused(Law::table(&[[400.0, 150.0], [700.0, 1.49]]));
    assert!(
        problem.contains("the index is 150.000000 at 400.000 nm") || problem.contains("at 360.000 nm"),
        "{problem}"
    );
    assert!(problem.contains("the table is off there") && !problem.contains("coefficients"), "{problem}");
    // Aluminium has n > 100 beyond 33 µm, which no visible light asks for.
    let aluminium = [[400.0, 0.49], [500.0, 0.77], [600.0, 1.2], [900.0, 2.1], [33_000.0, 102.0]];
    assert!(Dispersion::new(Law::table(&aluminium).unwrap(), None, OutOfRange::Clamp).is_ok());
    let endless: Vec<_> = (0..70_000).map(|i| [300.0 + f64::from(i), 1.5]).collect();
    assert!(Law::table(&endless).unwrap_err().contains("at most 65536"));
}

// --------------------------------------------------------------------------------------------------------- valid ranges

#[test]
fn outside_of_its_valid_range_a_law_is_held_refused_or_extrapolated() {
    let law = || Law::cauchy(&[1.5, 0.004]).unwrap();
    let range = ValidRange { from: nm(450.0), to: nm(650.0) };
    let clamped = Dispersion::new(law(), Some(range), OutOfRange::Clamp).unwrap();
    let free = Dispersion::new(law(), Some(range), OutOfRange::Extrapolate).unwrap();
    let strict = Dispersion::new(law(), Some(range), OutOfRange::Error).unwrap();
    let plain = Dispersion::cauchy(&[1.5, 0.004]).unwrap();
    for wavelength in band().chain([nm(450.0), nm(650.0)]) {
        assert_eq!(free.at(wavelength), plain.at(wavelength));
        let expected = match wavelength.nanometers() {
            w if w < 450.0 => IorJet::constant(plain.at(nm(450.0)).ior),
            w if w > 650.0 => IorJet::constant(plain.at(nm(650.0)).ior),
            _ => plain.at(wavelength),
        };
        assert_eq!(clamped.at(wavelength), expected);
        assert_eq!(strict.at(wavelength), expected);
        assert_eq!(clamped.is_valid_at(wavelength), range.contains(wavelength));
    }
    assert_eq!(clamped.abbe_number(), None, "the C line is outside");
    assert!(free.abbe_number().is_some() && clamped.describe().contains("valid from 450 to 650 nm, constant outside"));
    let doubled = clamped.scaled(2.0).unwrap();
    let ior_d = plain.at(lines::D).ior;
    assert!((doubled.at(nm(400.0)).ior - (2.0 * plain.at(nm(450.0)).ior - ior_d)).abs() < 1e-15);
    assert!(doubled.at(nm(400.0)).is_constant() && !doubled.at(nm(500.0)).is_constant());
    assert_eq!((doubled.valid_range(), doubled.out_of_range()), (Some(range), OutOfRange::Clamp));
    assert!(!range.contains_the_visible() && ValidRange { from: SHORTEST, to: LONGEST }.contains_the_visible());
    assert_eq!((plain.valid_range(), clamped.scaled(0.0).unwrap().is_constant()), (None, true));
}

#[test]
fn tables_are_valid_from_end_to_end_or_in_a_part() {
    let table = || Law::table(&[[400.0, 1.52], [500.0, 1.515], [600.0, 1.51], [700.0, 1.508]]).unwrap();
    let own = Dispersion::new(table(), None, OutOfRange::Clamp).unwrap();
    assert_eq!(own.valid_range(), Some(ValidRange { from: nm(400.0), to: nm(700.0) }));
    assert_eq!(own.at(nm(380.0)), IorJet::constant(1.52));
    assert_eq!(own.at(nm(800.0)).ior.to_bits(), own.at(nm(700.0)).ior.to_bits());
    assert!((own.at(nm(800.0)).ior - 1.508).abs() < 4e-16 && own.at(nm(800.0)).is_constant());
    let narrow = Some(ValidRange { from: nm(450.0), to: nm(650.0) });
    assert_eq!(Dispersion::new(table(), narrow, OutOfRange::Clamp).unwrap().valid_range(), narrow);
    let wide = Some(ValidRange { from: nm(450.0), to: nm(750.0) });
    assert!(Dispersion::new(table(), wide, OutOfRange::Clamp).unwrap_err().contains("beyond the table"));
    let infrared = Law::table(&[[900.0, 1.5], [2000.0, 1.49]]).unwrap();
    let problem = Dispersion::new(infrared, None, OutOfRange::Clamp).unwrap_err();
    assert!(problem.contains("valid from 900 to 2000 nm only, without the d line"), "{problem}");
}

#[test]
fn impossible_valid_ranges_are_refused() {
    for (from, to, remedy) in [
        (0.4, 0.7, "look like µm"),
        (700.0, 400.0, "the shorter first"),
        (500.0, 500.0, "two positive wavelengths"),
        (-1.0, 700.0, "two positive wavelengths"),
        (f64::NAN, 700.0, "no finite number"),
        (400.0, f64::INFINITY, "no finite number"),
        (600.0, 700.0, "without the d line"),
        (300.0, 500.0, "without the d line"),
    ] {
        let range = Some(ValidRange { from: nm(from), to: nm(to) });
        for outside in [OutOfRange::Clamp, OutOfRange::Error] {
            let problem = Dispersion::new(Law::cauchy(&[1.5, 0.004]).unwrap(), range, outside).unwrap_err();
            assert!(problem.contains(remedy), "{problem}");
        }
    }
    let infrared = Some(ValidRange { from: nm(900.0), to: nm(2000.0) });
    assert!(Dispersion::new(Law::cauchy(&[1.5, 0.004]).unwrap(), infrared, OutOfRange::Extrapolate).is_ok());
    for (text, outside) in
        [("clamp", OutOfRange::Clamp), ("error", OutOfRange::Error), ("extrapolate", OutOfRange::Extrapolate)]
    {
        assert_eq!(OutOfRange::parse(text), Some(outside));
    }
    assert_eq!(OutOfRange::parse("Clamp"), None);
}
