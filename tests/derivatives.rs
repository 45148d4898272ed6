//! Every derivative of the calculus against re-traces: with 102 digits, and the product's own in f64.
//!
//! Tolerances: first derivatives 10⁻¹² and second ones 10⁻⁹ of the vector's norm times the chain's condition number,
//! which `oracle` defines and measures (the reaction of the exact result to relative perturbations of every input and
//! intermediate).

mod oracle;

use abbe::ray::{
    Column, ColumnSet, LambdaColumn, NoColumns, ScreenColumns, SecondOrderColumns, direction_derivative,
    direction_second_derivative, screen_motion, second_order_along,
};
use glam::{DVec2, DVec3};
use oracle::{
    cases,
    chain::{Action, Chain, Event, Law, Root, Start, Surface},
    derivative,
    judge::{self, Truth, Verdict},
    random::Random,
    real::{Real, Vector},
    subject::{Run, Subject},
    trace::{Kind, Noise},
};

fn run<C: ColumnSet>(chain: &Chain) -> Run<C> {
    Subject::new(chain).run().expect("the named chains reach their receiver")
}

#[track_caller]
fn assert_judged(name: &str, chain: &Chain) {
    match judge::judge(chain) {
        Verdict::Judged(findings) => judge::assert_holds(name, &findings),
        Verdict::Undecidable => panic!("{name}: too close to total reflection for a named case"),
        Verdict::Wrong(why) => panic!("{name}: {why}"),
    }
}

#[test]
fn prism_agrees_with_the_retrace() {
    assert_judged("prism", &cases::prism());
}

#[test]
fn ball_agrees_with_the_retrace() {
    for internal_reflections in 0..=2 {
        assert_judged(&format!("ball, {internal_reflections} reflections"), &cases::ball(internal_reflections));
    }
}

#[test]
fn deflector_agrees_with_the_retrace_and_is_achromatic() {
    let chain = cases::deflector();
    assert_judged("deflector", &chain);
    let run: Run<LambdaColumn> = run(&chain);
    assert_eq!(run.kinds(), [Kind::Refraction, Kind::TotalReflection, Kind::Refraction]);
    let column = run.columns.lambda().expect("carried");
    let d_lambda = direction_derivative(column.momentum, run.direction, run.medium.ior, run.medium.dior_dlambda);
    // Zero to rounding, against the |n'| ≈ 5e-5/nm that enters at the first leg; the point does move.
    assert!(d_lambda.length() < 1e-19, "{d_lambda}");
    assert!(column.point.length() > 1e-7, "{}", column.point);
}

#[test]
fn smooth_lens_agrees_with_the_retrace() {
    assert_judged("R-R", &cases::smooth_lens(false));
    assert_judged("R-M-M-R", &cases::smooth_lens(true));
}

#[test]
fn ellipsoid_agrees_with_the_retrace() {
    assert_judged("ellipsoid", &cases::ellipsoid());
}

#[test]
fn glass_in_glass_agrees_with_the_retrace() {
    assert_judged("nested glass", &cases::nested_glass());
}

#[test]
fn every_dispersion_law_agrees_with_the_retrace() {
    let laws = [
        Law::Constant(1.6),
        Law::Cauchy(vec![1.5, 0.0042, 1e-4]),
        Law::SellmeierSquared { constant: 0.0, b: vec![1.1, 0.9], c: vec![0.1, 9.5] },
        Law::AbbeNumber { nd: 1.7, vd: 30.0 },
        Law::Scaled(Box::new(Law::sf66()), 3.0),
    ];
    for law in laws {
        let mut chain = cases::ball(1);
        for nanometers in [380.0, 550.0, 780.0] {
            chain.nanometers = nanometers;
            chain.media[1] = law.clone();
            assert_judged(&format!("{law:?} at {nanometers} nm"), &chain);
        }
    }
}

#[test]
fn column_sets_carry_the_same_bits() {
    for (name, chain) in cases::all() {
        let all: Run<SecondOrderColumns> = run(&chain);
        let lambda: Run<LambdaColumn> = run(&chain);
        let screen: Run<ScreenColumns> = run(&chain);
        let none: Run<NoColumns> = run(&chain);
        let bits = |c: &Column| [c.point.to_array(), c.momentum.to_array()].map(|v| v.map(f64::to_bits));
        let of = |c: Option<&Column>| bits(c.expect("carried"));
        assert_eq!(of(all.columns.lambda()), of(lambda.columns.lambda()), "{name}");
        assert_eq!(of(all.columns.lambda()), of(screen.columns.lambda()), "{name}");
        for axis in 0..2 {
            let [a, b] = [all.columns.screen(), screen.columns.screen()].map(|s| bits(s.expect("carried")[axis]));
            assert_eq!(a, b, "{name}");
        }
        assert!(none.columns.lambda().is_none() && none.columns.screen().is_none());
        assert_eq!(none.kinds(), all.kinds());
        assert_eq!(none.point, all.point);
    }
}

/// Central differences of the product's own re-trace approach its columns with the square of the step.
#[test]
fn central_differences_approach_the_columns_quadratically() {
    for (name, chain) in cases::all() {
        let subject = Subject::new(&chain);
        let here: Run<SecondOrderColumns> = subject.run().expect("reaches");
        let lambda = here.columns.lambda().expect("carried");
        let lambda2 = here.columns.lambda2().expect("carried");
        let [x, y] = here.columns.screen().expect("carried");
        let point = |x, y, l: f64| subject.at::<NoColumns>(x, y, chain.nanometers + l).expect("a near ray").point;
        let quantities: [(&str, DVec3, f64, Box<dyn Fn(f64) -> DVec3>); 4] = [
            ("p_x", x.point, 8.0, Box::new(|h| (point(h, 0.0, 0.0) - point(-h, 0.0, 0.0)) / (2.0 * h))),
            ("p_y", y.point, 8.0, Box::new(|h| (point(0.0, h, 0.0) - point(0.0, -h, 0.0)) / (2.0 * h))),
            ("p_λ", lambda.point, 8.0, Box::new(|h| (point(0.0, 0.0, h) - point(0.0, 0.0, -h)) / (2.0 * h))),
            (
                "p_λλ",
                lambda2.point,
                16.0,
                Box::new(|h| (point(0.0, 0.0, h) - 2.0 * here.point + point(0.0, 0.0, -h)) / (h * h)),
            ),
        ];
        for (quantity, exact, largest, difference) in quantities {
            let steps: Vec<f64> = (0..5).map(|k| largest / f64::from(1 << k)).collect();
            let errors: Vec<f64> = steps.iter().map(|&h| (difference(h) - exact).length()).collect();
            // Where the error falls below what f64 can subtract, the law cannot show any more.
            let order = if quantity == "p_λλ" { 2 } else { 1 };
            let coordinates = here.point.length() + chain.start.origin.length();
            for k in 1..steps.len() {
                let floor = 2e3 * f64::EPSILON * coordinates / steps[k].powi(order);
                if errors[k] < 20.0 * floor {
                    break;
                }
                let ratio = errors[k - 1] / errors[k];
                assert!(
                    (ratio - 4.0).abs() < 0.6,
                    "{name}, {quantity}: halving the step to {} divides the error by {ratio}: {errors:?}",
                    steps[k]
                );
            }
            let scale = exact.length().max(1e-12);
            assert!(errors[4] < 1e-2 * scale, "{name}, {quantity}: {errors:?} against {exact}");
        }
    }
}

/// (I1), (I2) and (I3) of the Lagrange invariants, accumulated from the columns themselves.
#[test]
fn lagrange_invariants_vanish_for_a_pinhole() {
    for (name, chain) in cases::with_true_normals() {
        let subject = Subject::new(&chain);
        let run: Run<SecondOrderColumns> = subject.run().expect("reaches");
        let jets = subject.jets();
        let [x, y] = run.columns.screen().expect("carried");
        let lambda = run.columns.lambda().expect("carried");
        let (mut path_x, mut path_y, mut path_lambda, mut opl_lambda) = (0.0, 0.0, 0.0, 0.0);
        for ((step, [before, after]), &medium) in run.steps.iter().zip(&run.transfers).zip(&run.media) {
            let d = step.transfer.direction;
            let dn = jets[medium].dior_dlambda;
            // q − p = ℓ d, so ∂ℓ = d·(∂q − ∂p)
            let change = |i: usize| {
                let [b, a] = [before, after].map(|c| c.screen().expect("carried")[i].point);
                d.dot(a - b)
            };
            let change_lambda = {
                let [b, a] = [before, after].map(|c| c.lambda().expect("carried").point);
                d.dot(a - b)
            };
            path_x += dn * change(0);
            path_y += dn * change(1);
            path_lambda += dn * step.transfer.distance;
            opl_lambda += dn * step.transfer.distance + jets[medium].ior * change_lambda;
        }
        let residual = |name: &str, value: f64, terms: &[f64]| {
            let scale: f64 = terms.iter().map(|t| t.abs()).sum();
            (name.to_string(), value.abs() / scale)
        };
        let (a, b) = (x.momentum.dot(y.point), y.momentum.dot(x.point));
        let (c, d) = (x.momentum.dot(lambda.point), lambda.momentum.dot(x.point));
        let (e, f) = (y.momentum.dot(lambda.point), lambda.momentum.dot(y.point));
        let g = run.momentum.dot(lambda.point);
        let residuals = [
            residual("I1", a - b, &[a, b, x.momentum.length() * y.point.length()]),
            residual("I2 in x", c - d + path_x, &[c, d, path_x, lambda.momentum.length() * x.point.length()]),
            residual("I2 in y", e - f + path_y, &[e, f, path_y, lambda.momentum.length() * y.point.length()]),
            residual("I3", path_lambda + g - opl_lambda, &[path_lambda, g, opl_lambda]),
        ];
        for (invariant, value) in residuals {
            assert!(value < 1e-12, "{name}: {invariant} = {value:e} of its terms");
        }
    }
}

#[test]
fn shading_normals_break_the_lagrange_invariant() {
    let run: Run<ScreenColumns> = run(&cases::smooth_lens(false));
    let [x, y] = run.columns.screen().expect("carried");
    let residual = x.momentum.dot(y.point) - y.momentum.dot(x.point);
    // Not a defect: interpolated normals make the map of rays non-symplectic, which the residual measures.
    assert!(residual.abs() > 1e-6 * x.momentum.length() * y.point.length(), "{residual:e}");
}

/// −J⁺p_λ and −J⁺p_ss against Newton solves of p(x(λ), y(λ), λ) = const.
#[test]
fn screen_motion_agrees_with_newton_solves() {
    for (name, chain) in cases::all() {
        // A deflector's direction does not move, and what is infinitely far stays where it is.
        for infinite in [false, true] {
            let exact = derivative::screen_motion(&chain, infinite, &Noise::none()).expect("reaches");
            let noisy: Vec<_> = (0..judge::DRAWS)
                .map(|draw| derivative::screen_motion(&chain, infinite, &Noise::seeded(draw)).expect("reaches"))
                .collect();
            let (first, second) = product_screen_motion(&chain, infinite);
            let lift = |v: &[Real; 2]| Vector([v[0].clone(), v[1].clone(), Real::zero()]);
            let finding = |label, order, value: DVec2, of: &dyn Fn(&derivative::ScreenMotion) -> Vector| {
                let reactions: Vec<f64> = noisy.iter().map(|n| derivative::reaction(&of(n), &of(&exact))).collect();
                judge::finding(label, order, value.extend(0.0), &of(&exact), &reactions)
            };
            let findings = [
                finding("(x_λ, y_λ)", 1, first, &|m| lift(&m.first)),
                finding("(x_λλ, y_λλ)", 2, second, &|m| lift(&m.second)),
            ];
            judge::assert_holds(&format!("{name}, {}", if infinite { "environment" } else { "surface" }), &findings);
        }
    }
}

/// The screen's first and second motion as the product computes them.
fn product_screen_motion(chain: &Chain, infinite: bool) -> (DVec2, DVec2) {
    let run: Run<ScreenColumns> = run(chain);
    let [x, y] = run.columns.screen().expect("carried");
    let lambda = run.columns.lambda().expect("carried");
    let (d, jet) = (run.direction, run.medium);
    let (v_x, v_y, v_lambda, normal) = if infinite {
        (
            direction_derivative(x.momentum, d, jet.ior, 0.0),
            direction_derivative(y.momentum, d, jet.ior, 0.0),
            direction_derivative(lambda.momentum, d, jet.ior, jet.dior_dlambda),
            d,
        )
    } else {
        (x.point, y.point, lambda.point, run.n_g)
    };
    let first = screen_motion(v_x, v_y, v_lambda, normal).expect("no caustic");
    let along = second_order_along(&run.start, &run.first_medium, DVec3::new(first.x, first.y, 1.0), &run.steps);
    let v_ss = if infinite {
        let d_s = direction_derivative(along.momentum, d, jet.ior, jet.dior_dlambda);
        direction_second_derivative(along.momentum2, d, d_s, &jet)
    } else {
        along.point2
    };
    (first, screen_motion(v_x, v_y, v_ss, normal).expect("no caustic"))
}

/// The final formula of the derivation supplement (Elek et al. 2014) for ∂d'/∂λ, with d·n < 0.
fn supplement(d: DVec3, n: DVec3, d_l: DVec3, n_l: DVec3, n0: [f64; 2], n1: [f64; 2]) -> DVec3 {
    let eta = n0[0] / n1[0];
    let eta_l = (n0[1] * n1[0] - n0[0] * n1[1]) / (n1[0] * n1[0]);
    let theta = d.dot(n);
    let theta_l = d_l.dot(n) + d.dot(n_l);
    let omega = (1.0 - eta * eta + eta * eta * theta * theta).sqrt();
    let mu = eta * theta + omega;
    let omega_l = (-eta * eta_l + eta * eta_l * theta * theta + eta * eta * theta * theta_l) / omega;
    let mu_l = eta_l * theta + eta * theta_l + omega_l;
    eta_l * d + eta * d_l - mu_l * n - mu * n_l
}

#[test]
fn supplement_formula_gives_the_same_numbers() {
    let mut random = Random::new(2014);
    let mut compared = 0;
    while compared < 200 {
        // A ball met away from grazing; the second event sees ∂d ≠ 0 and ∂n ≠ 0.
        let (sin, angle) = (random.range(0.05, 0.9), random.range(0.0, 6.28));
        let ball = Surface::Sphere { center: DVec3::ZERO, radius: 1.0, inward: false };
        let origin = DVec3::new(sin * angle.cos(), sin * angle.sin(), -4.0);
        let event = |root, beyond| Event { surface: ball.clone(), root, action: Action::Interface(beyond) };
        let chain = Chain {
            start: Start::pinhole(origin, DVec3::Z, 500.0),
            media: vec![Law::bk7(), Law::sf66()],
            first_medium: 0,
            events: vec![event(Root::First, 1), event(Root::Second, 0)],
            receiver: Surface::Plane { point: DVec3::new(0.0, 0.0, 5.0), normal: DVec3::Z },
            receiver_root: Root::First,
            nanometers: random.range(400.0, 700.0),
        };
        let Some(run) = Subject::new(&chain).run::<LambdaColumn>() else { continue };
        if run.kinds() != [Kind::Refraction, Kind::Refraction] {
            continue;
        }
        compared += 1;
        for (index, step) in run.steps[..2].iter().enumerate() {
            let s = step.scattering.as_ref().expect("an event");
            let before = run.transfers[index][1].lambda().expect("carried");
            let after = run.transfers[index + 1][0].lambda().expect("carried");
            let d = s.momentum_in / s.ior_i.ior;
            let d_l = direction_derivative(before.momentum, d, s.ior_i.ior, s.ior_i.dior_dlambda);
            // On the unit ball ∂n = ± ∂q.
            let sign = if index == 0 { 1.0 } else { -1.0 };
            let n_l = sign * before.point;
            let [n0, n1] = [&s.ior_i, &s.ior_t].map(|jet| [jet.ior, jet.dior_dlambda]);
            let theirs = supplement(d, s.normal, d_l, n_l, n0, n1);
            let ours =
                direction_derivative(after.momentum, s.momentum_out / s.ior_t.ior, s.ior_t.ior, s.ior_t.dior_dlambda);
            // Both formulas cancel by at most 1/ω² here, ω being above 0.1.
            assert!((theirs - ours).length() < 1e-12 * ours.length(), "{theirs} {ours}");
        }
    }
}

/// The oracle itself, against closed forms.
#[test]
fn retrace_knows_the_closed_forms() {
    // N-BK7: n_d and n' (the golden values of the catalogue), n' by the oracle's own difference.
    assert!((Law::bk7().ior(587.5618) - 1.51680).abs() < 5e-6);
    let h = Real::power_of_two(-100);
    let at = |steps: f64| oracle::trace::ior(&Law::bk7(), &(Real::new(550.0) + &h * Real::new(steps)));
    let slope = ((at(1.0) - at(-1.0)) * Real::power_of_two(99)).to_f64();
    assert!((slope - -0.050317718e-3).abs() < 1e-12, "{slope}");
    // A plane-parallel plate displaces sideways by t sinθ (1 − cosθ/√(n² − sin²θ)): its slope along n in closed form.
    let theta = 0.6_f64;
    let look = DVec3::new(theta.sin(), 0.0, theta.cos());
    let face = |z: f64| Surface::Plane { point: DVec3::new(0.0, 0.0, z), normal: DVec3::NEG_Z };
    let event = |z, beyond| Event { surface: face(z), root: Root::First, action: Action::Interface(beyond) };
    let chain = Chain {
        start: Start::pinhole(DVec3::new(0.0, 0.0, -1.0), look, 100.0),
        media: vec![Law::Constant(1.0), Law::bk7()],
        first_medium: 0,
        events: vec![event(0.0, 1), event(2.0, 0)],
        receiver: face(3.0),
        receiver_root: Root::First,
        nanometers: 550.0,
    };
    let truth = Truth::new(&chain).expect("reaches");
    let n = Law::bk7().ior(550.0);
    // x on the far face = 2 sinθ/√(n² − sin²θ); nothing moves after it.
    let expected = -2.0 * theta.sin() * n * slope / (n * n - theta.sin().powi(2)).powf(1.5);
    let found = truth.exact.lambda.point.to_f64();
    assert!((found[0] - expected).abs() < 1e-14 * expected.abs().max(1.0), "{found:?} {expected}");
    assert!(truth.exact.lambda.direction.length().to_f64() < 1e-60);
}
