//! The stress cases of the calculus with the answers that the mathematics gives, numbered as in the reference.
//!
//! 1 grazing entry · 2 critical angle · 3 equal indices · 4 coincident surfaces · 5 scale · 6 degenerate triangles ·
//! 7 vanishing curvature · 8 opposing shading normals · 9 many reflections · 10 poles · 11 outside of the band ·
//! 12 units. What needs a scene (hits, media along a path, images) is tested where scenes are.

#![allow(clippy::float_cmp, reason = "these laws are about equal bits")]

mod oracle;

use abbe::{
    math::compensated::w_squared,
    optics::{IorJet, dispersion::Dispersion},
    ray::{
        Column, ColumnSet, Curvature, LambdaColumn, LocalSurface, NoColumns, NormalField, RayStart, ScatterKind,
        Scattering, ScreenColumns, SecondOrderColumns, Transfer, critical_distance, direction_derivative, half_width,
        mirror, refract_or_reflect, screen_motion,
    },
    spectrum::{Wavelength, lines},
};
use glam::{DMat3, DVec3};
use oracle::{
    cases,
    chain::{Action, Chain, Event, Law, Root, Start, Surface},
    derivative,
    judge::{self, Verdict},
    random::Random,
    real::Real,
    subject::{self, Run, Subject},
    trace::{self, Kind, Noise},
};

fn bk7() -> IorJet {
    subject::dispersion(&Law::bk7()).expect("a glass").at(Wavelength::from_nanometers(550.0))
}

fn flat(normal: DVec3) -> LocalSurface {
    LocalSurface { n_g: normal, n_s: normal, curvature: Curvature::Plane, field: NormalField::Flat }
}

/// The sphere of radius r at the point with outward normal n.
fn sphere(normal: DVec3, radius: f64) -> LocalSurface {
    let inv_radius = 1.0 / radius;
    LocalSurface {
        n_g: normal,
        n_s: normal,
        curvature: Curvature::Sphere { inv_radius },
        field: NormalField::Sphere { inv_radius },
    }
}

/// A start with every derivative different from zero.
fn start(direction: DVec3) -> RayStart {
    let camera = Start {
        origin_x: DVec3::new(0.01, -0.02, 0.03),
        origin_y: DVec3::new(-0.02, 0.01, 0.01),
        ..Start::pinhole(DVec3::ZERO, direction, 100.0)
    };
    subject::ray_start(&camera, 0.0, 0.0)
}

/// All columns just after the transfer to a surface at distance 1.
fn arrived(direction: DVec3, medium: &IorJet, surface: &LocalSurface) -> SecondOrderColumns {
    let mut columns = SecondOrderColumns::start(&start(direction), medium);
    columns.transfer(&Transfer {
        distance: 1.0,
        direction,
        medium: *medium,
        n_g: surface.n_g,
        curvature: surface.curvature,
    });
    columns
}

/// One interface between two planes' worth of space: camera at the origin, surface at z = 1, receiver beyond.
fn single(law_i: Law, law_t: Law, look: DVec3) -> Chain {
    let plane = |z: f64| Surface::Plane { point: DVec3::new(0.0, 0.0, z), normal: DVec3::NEG_Z };
    Chain {
        start: Start::pinhole(DVec3::ZERO, look, 100.0),
        media: vec![law_i, law_t],
        first_medium: 0,
        events: vec![Event { surface: plane(1.0), root: Root::First, action: Action::Interface(1) }],
        receiver: plane(2.0),
        receiver_root: Root::First,
        nanometers: 550.0,
    }
}

fn run<C: ColumnSet>(chain: &Chain) -> Run<C> {
    Subject::new(chain).run().expect("reaches its receiver")
}

fn bits(columns: &[Column]) -> Vec<u64> {
    columns.iter().flat_map(|c| [c.point.to_array(), c.momentum.to_array()].concat()).map(f64::to_bits).collect()
}

fn all_columns(c: &SecondOrderColumns) -> Vec<Column> {
    let [x, y] = c.screen().expect("carried");
    vec![*x, *y, *c.lambda().expect("carried"), *c.lambda2().expect("carried")]
}

#[track_caller]
fn assert_judged(name: &str, chain: &Chain) {
    match judge::judge(chain) {
        Verdict::Judged(findings) => judge::assert_holds(name, &findings),
        Verdict::Undecidable => panic!("{name}: undecidable"),
        Verdict::Wrong(why) => panic!("{name}: {why}"),
    }
}

// 1. Grazing entry

#[test]
fn case_01_grazing_entry_refracts_into_the_critical_cone_with_finite_derivatives() {
    for degrees in [89.9_f64, 89.99, 89.9999, 89.999_999] {
        let angle = degrees.to_radians();
        let direction = DVec3::new(angle.sin(), 0.0, angle.cos());
        let (air, glass) = (IorJet::VACUUM, bk7());
        let s = refract_or_reflect(direction, &flat(DVec3::NEG_Z), &air, &glass);
        assert_eq!(s.kind, ScatterKind::Refraction);
        // ω = cos θ_t → √(1 − η²) as cos θ_i → 0; they differ by η² cos²θ_i / (2ω).
        let eta = 1.0 / glass.ior;
        let omega = -s.momentum_out.dot(s.normal) / glass.ior;
        let limit = (1.0 - eta * eta).sqrt();
        assert!((omega - limit).abs() <= (eta * angle.cos()).powi(2) / (2.0 * limit) + 4.0 * f64::EPSILON);
        // |∂d'| = |η'| sinθ_i / cosθ_t: the rotation by dispersion alone, to 1e-12.
        let mut column = LambdaColumn::start(&RayStart { point_x: DVec3::ZERO, ..start(direction) }, &air);
        column.scatter(&s);
        let d_out = s.momentum_out / glass.ior;
        let momentum = column.lambda().expect("carried").momentum;
        let d_lambda = direction_derivative(momentum, d_out, glass.ior, glass.dior_dlambda);
        let expected = glass.dior_dlambda.abs() / (glass.ior * glass.ior) * angle.sin() / omega;
        assert!((d_lambda.length() - expected).abs() < 1e-12 * expected, "{degrees}°: {d_lambda}");
        // And every column against the re-trace, for its conditioning at this angle.
        assert_judged(&format!("{degrees}°"), &single(Law::Constant(1.0), Law::bk7(), direction));
    }
}

#[test]
fn case_01_the_spot_on_a_grazed_surface_grows_as_the_flux_per_area_falls() {
    // |p_x| of the tilted direction is 1/cosθ per unit distance; the flux per area takes cosθ of it away again.
    for cos in [1e-1, 1e-3, 1e-6, 1e-9_f64] {
        let direction = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let tilt = DVec3::new(-cos, 0.0, direction.x);
        let bare = RayStart {
            point: DVec3::ZERO,
            direction,
            point_x: DVec3::ZERO,
            point_y: DVec3::ZERO,
            direction_x: tilt,
            direction_y: DVec3::Y,
            direction_xx: -direction,
            direction_xy: DVec3::ZERO,
            direction_yy: -direction,
            time: 0.0,
        };
        let mut columns = ScreenColumns::start(&bare, &IorJet::VACUUM);
        let transfer = Transfer {
            distance: 1.0,
            direction,
            medium: IorJet::VACUUM,
            n_g: DVec3::NEG_Z,
            curvature: Curvature::Plane,
        };
        columns.transfer(&transfer);
        let [x, y] = columns.screen().expect("carried");
        let area = x.point.cross(y.point).length();
        assert!((area * cos - 1.0).abs() < 1e-12, "cos {cos}: {area}");
    }
}

#[test]
fn case_01_a_caustic_as_seen_from_the_eye_has_no_screen_motion() {
    let (x, n) = (DVec3::new(1.0, 0.5, 0.0), DVec3::Z);
    let v = DVec3::new(0.1, 0.2, 0.0);
    for scale in [1e-150, 1e-6, 1.0, 1e6, 1e150] {
        // Parallel, one of them zero, both in a plane with the normal.
        assert!(screen_motion(scale * x, -3.0 * scale * x, v, n).is_none());
        assert!(screen_motion(scale * x, DVec3::ZERO, v, n).is_none());
        assert!(screen_motion(scale * DVec3::Z, scale * DVec3::Y, v, n).is_none());
    }
    assert!(screen_motion(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, n).is_none());
    // Ill-conditioned is not degenerate.
    let motion = screen_motion(x, x + 1e-6 * DVec3::Y, DVec3::ZERO, n).expect("a thin Jacobian is a Jacobian");
    assert_eq!(motion, glam::DVec2::ZERO);
}

// 2. Critical angle

/// Directions around the critical angle of N-BK7 to air, ulp by ulp in cosθ: K as the product is given it.
fn around_critical(glass: &IorJet, count: i32) -> impl Iterator<Item = DVec3> {
    let n = glass.ior;
    let g = (n * n - 1.0).sqrt();
    let ulp = g.next_up() - g;
    (-count..=count).map(move |k| {
        let g = g + f64::from(k) * ulp;
        DVec3::new((n * n - g * g).sqrt(), 0.0, g)
    })
}

#[test]
fn case_02_total_reflection_is_decided_to_the_last_ulp() {
    let (air, glass) = (IorJet::VACUUM, bk7());
    let mut kinds = [0, 0];
    for momentum in around_critical(&glass, 3000) {
        let s = refract_or_reflect(momentum, &flat(DVec3::Z), &glass, &air);
        // The normal is an axis, so g is exact and W² = n₁² − n₀² + g² has one right sign.
        let [n0, n1, g] = [glass.ior, air.ior, momentum.z].map(Real::new);
        let exact = &n1 * &n1 - &n0 * &n0 + &g * &g;
        let transmitted = !exact.is_negative() && !exact.is_zero();
        assert_eq!(s.kind == ScatterKind::Refraction, transmitted, "g = {}", momentum.z);
        assert!((Real::new(s.w_squared) - &exact).abs().to_f64() <= 4.0 * f64::EPSILON * exact.abs().to_f64());
        kinds[usize::from(transmitted)] += 1;
    }
    assert!(kinds.iter().all(|&count| count > 1000), "{kinds:?}");
}

#[test]
fn case_02_compensated_w_squared_keeps_all_digits_for_nasty_indices() {
    let mut random = Random::new(2);
    let mut worst = 0.0_f64;
    for _ in 0..20_000 {
        let n1 = random.range(1.0, 2.5);
        let n0 =
            if random.chance(0.5) { n1 * (1.0 + random.decades(-16.0, -1.0)) } else { n1 * random.range(1.0, 2.0) };
        let critical = ((n0 - n1) * (n0 + n1)).sqrt();
        let g = -critical * (1.0 + random.decades(-17.0, -1.0) * if random.chance(0.5) { 1.0 } else { -1.0 });
        let [a, b, c] = [n0, n1, g].map(Real::new);
        let exact = &b * &b - &a * &a + &c * &c;
        let found = w_squared(n0, n1, g);
        if exact.is_zero() {
            assert_eq!(found, 0.0);
        } else {
            worst = worst.max(((Real::new(found) - &exact) / &exact).abs().to_f64());
        }
    }
    assert!(worst <= 4.0 * f64::EPSILON, "{worst:e}");
}

#[test]
fn case_02_one_ulp_before_the_critical_angle_everything_is_finite() {
    let (air, glass) = (IorJet::VACUUM, bk7());
    let momentum = around_critical(&glass, 3000)
        .find(|&k| refract_or_reflect(k, &flat(DVec3::Z), &glass, &air).kind == ScatterKind::Refraction)
        .expect("some are transmitted");
    let s = refract_or_reflect(momentum, &flat(DVec3::Z), &glass, &air);
    let w = s.w_squared.sqrt();
    assert!(w < 1e-7, "{w:e}");
    let mut columns = arrived(momentum / glass.ior, &glass, &flat(DVec3::Z));
    let before = *columns.lambda().expect("carried");
    columns.scatter(&s);
    assert!(all_columns(&columns).iter().all(|c| c.point.is_finite() && c.momentum.is_finite()));
    // |∂d'| ≈ |n₀n₀' sin²…|/W: of the order |n'|·1e8.
    let d_lambda = direction_derivative(columns.lambda().expect("carried").momentum, s.momentum_out, 1.0, 0.0).length();
    assert!((1e7..1e10).contains(&(d_lambda / glass.dior_dlambda.abs())), "{d_lambda:e}");
    // The footprint ends where transmission ends.
    let limit = critical_distance(&s, &before);
    assert!(limit > 0.0 && limit < 1e-9, "{limit:e} nm");
    let column = columns.lambda().expect("carried");
    assert!(half_width(column.point, DVec3::ZERO, 5.0, limit) <= limit);
}

#[test]
fn case_02_distance_to_total_reflection_is_that_of_the_retrace() {
    // W² at λ ± h by the oracle, against the product's −W²/(W²)'. The ball makes N' matter.
    for (name, chain) in
        [("prism", cases::prism()), ("ball", cases::ball(0)), ("glass in glass", cases::nested_glass())]
    {
        let product: Run<LambdaColumn> = run(&chain);
        let zero = Real::zero();
        let h = Real::power_of_two(-100);
        let at = |steps: f64| {
            let lambda = Real::new(chain.nanometers) + &h * Real::new(steps);
            trace::trace(&chain, &zero, &zero, &lambda, Noise::none()).expect("reaches").passed
        };
        let (minus, here, plus) = (at(-1.0), at(0.0), at(1.0));
        for (index, step) in product.steps.iter().enumerate().take(here.len()) {
            let w2 = |passed: &[trace::Passed]| passed[index].w_squared.clone().expect("an interface");
            let slope = (w2(&plus) - w2(&minus)) * Real::power_of_two(99);
            let s = step.scattering.as_ref().expect("an event");
            let column = product.transfers[index][1].lambda().expect("carried");
            let found = critical_distance(s, column);
            let expected = (w2(&here) / slope).abs().to_f64();
            if expected > 1e15 {
                // A ball gives back the angle it took, at any wavelength: nothing but rounding moves W² at its exit.
                assert!(found > 1e12, "{name}, event {index}: {found:e}");
                continue;
            }
            assert!((found - expected).abs() < 1e-10 * expected, "{name}, event {index}: {found} {expected}");
        }
    }
}

#[test]
fn case_02_transmitted_footprint_stays_bounded_at_the_critical_angle() {
    let (air, glass) = (IorJet::VACUUM, bk7());
    let n0 = glass.ior;
    let sin_i: f64 = 1.0 / n0;
    let cos_i = (1.0 - sin_i * sin_i).sqrt();
    // |n₀'| sinθ_i (2/(n₀ cosθ_i) + 2n₀/cosθ_i) for n₁ = 1, unpolarised.
    let limit = glass.dior_dlambda.abs() * sin_i * (2.0 / (n0 * cos_i) + 2.0 * n0 / cos_i);
    for omega in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6_f64] {
        let tangential = (1.0 - omega * omega).sqrt();
        let g = (n0 * n0 - tangential * tangential).sqrt();
        let momentum = DVec3::new(tangential, 0.0, g);
        let s = refract_or_reflect(momentum, &flat(DVec3::Z), &glass, &air);
        let mut column = LambdaColumn::start(&start(momentum / n0), &glass);
        column.scatter(&s);
        let d_lambda = direction_derivative(column.lambda().expect("carried").momentum, s.momentum_out, 1.0, 0.0);
        let (ci, ct) = (-s.g / n0, s.w_squared.sqrt());
        let ts = 2.0 * n0 * ci / (n0 * ci + ct);
        let tp = 2.0 * n0 * ci / (ci + n0 * ct);
        let transmittance = ct / (n0 * ci) * 0.5 * (ts * ts + tp * tp);
        let product = transmittance * d_lambda.length();
        assert!(product <= limit * (1.0 + 1e-9), "ω = {omega}: {product:e} > {limit:e}");
        // It approaches the limit with ω.
        assert!((product / limit - 1.0).abs() < 10.0 * omega + 1e-9, "ω = {omega}: {}", product / limit);
    }
}

#[test]
fn case_02_the_decision_does_not_depend_on_the_columns_carried() {
    let glass = bk7();
    for momentum in around_critical(&glass, 200) {
        let look = momentum / glass.ior;
        let mut chain = single(Law::bk7(), Law::Constant(1.0), look);
        chain.receiver = Surface::Sphere { center: DVec3::Z, radius: 3.0, inward: true };
        chain.receiver_root = Root::Second;
        let kinds = run::<NoColumns>(&chain).kinds();
        assert_eq!(kinds, run::<LambdaColumn>(&chain).kinds());
        assert_eq!(kinds, run::<ScreenColumns>(&chain).kinds());
        assert_eq!(kinds, run::<SecondOrderColumns>(&chain).kinds());
    }
}

// 3. Equal indices, no dispersion

#[test]
fn case_03_the_same_medium_on_both_sides_changes_no_bit() {
    let glass = bk7();
    let mut random = Random::new(3);
    for _ in 0..1000 {
        let direction = random.direction();
        let normal = random.direction();
        let gradient = DMat3::from_cols(random.direction(), random.direction(), random.direction());
        let fields = [
            NormalField::Flat,
            NormalField::Sphere { inv_radius: random.decades(-3.0, 6.0) },
            NormalField::Linear { vector: 1.7 * normal, gradient: 1e3 * gradient },
        ];
        for field in fields {
            let surface = LocalSurface { n_g: normal, n_s: normal, curvature: Curvature::Plane, field };
            let mut columns = arrived(direction, &glass, &surface);
            let before = bits(&all_columns(&columns));
            let momentum = direction * glass.ior;
            let s = refract_or_reflect(momentum, &surface, &glass, &glass);
            columns.scatter(&s);
            assert_eq!(s.kind, ScatterKind::Refraction);
            assert_eq!(s.momentum_out, momentum);
            assert_eq!(bits(&all_columns(&columns)), before, "{field:?}");
        }
    }
}

#[test]
fn case_03_index_matched_deflection_keeps_its_digits() {
    let mut random = Random::new(33);
    for _ in 0..2000 {
        let n0 = random.range(1.0, 2.5);
        let n1 = n0 + 1e-12 * random.range(-2.0, 2.0);
        if n1 == n0 {
            continue;
        }
        let cos = random.range(0.01, 1.0);
        let momentum = DVec3::new(n0 * (1.0 - cos * cos).sqrt(), 0.0, n0 * cos);
        let s = refract_or_reflect(momentum, &flat(DVec3::NEG_Z), &IorJet::constant(n0), &IorJet::constant(n1));
        // G = W + g for the given n₀, n₁ and g, with all digits.
        let [a, b, g] = [n0, n1, s.g].map(Real::new);
        let exact = (&b * &b - &a * &a + &g * &g).sqrt() + &g;
        let error = ((Real::new(s.deflection) - &exact) / &exact).abs().to_f64();
        assert!(error < 1e-15, "n₀ {n0}, n₁ {n1}, cos {cos}: {error:e}");
    }
}

#[test]
fn case_03_christiansen_filter_deflects_no_ray_but_disperses_it() {
    let glass = bk7();
    let other = IorJet { dior_dlambda: 3.0 * glass.dior_dlambda, ..glass };
    for degrees in [0.0_f64, 10.0, 45.0, 80.0, 89.0] {
        let angle = degrees.to_radians();
        let direction = DVec3::new(angle.sin(), 0.0, angle.cos());
        let momentum = direction * glass.ior;
        let s = refract_or_reflect(momentum, &flat(DVec3::NEG_Z), &glass, &other);
        assert_eq!(s.kind, ScatterKind::Refraction);
        assert_eq!(s.momentum_out, momentum, "equal indices deflect nothing");
        let mut column = LambdaColumn::start(&start(direction), &glass);
        column.scatter(&s);
        let momentum = column.lambda().expect("carried").momentum;
        let d_lambda = direction_derivative(momentum, direction, other.ior, other.dior_dlambda);
        // |∂d'| = |η'| tanθ, η' = (n₀' − n₁')/n.
        let expected = 2.0 * glass.dior_dlambda.abs() / glass.ior * angle.tan();
        assert!((d_lambda.length() - expected).abs() <= 1e-12 * expected.max(1e-6), "{degrees}°: {d_lambda}");
    }
}

#[test]
fn case_03_without_dispersion_the_wavelength_column_is_exactly_zero() {
    for (name, mut chain) in cases::all() {
        for law in &mut chain.media {
            *law = Law::Constant(law.ior(550.0));
        }
        let run: Run<SecondOrderColumns> = run(&chain);
        for column in [run.columns.lambda(), run.columns.lambda2()] {
            let column = column.expect("carried");
            assert_eq!((column.point, column.momentum), (DVec3::ZERO, DVec3::ZERO), "{name}");
        }
        // Dispersion switched off by its scale is no dispersion.
        let off = Dispersion::sellmeier(&[1.03961212], &[0.006]).and_then(|law| law.scaled(0.0)).expect("a glass");
        assert!(off.is_constant() && off.at(Wavelength::from_nanometers(450.0)).is_constant());
    }
}

#[test]
fn case_03_a_line_source_has_no_footprint() {
    let run: Run<SecondOrderColumns> = run(&cases::prism());
    let (first, second) = (run.columns.lambda().expect("carried"), run.columns.lambda2().expect("carried"));
    assert_eq!(half_width(first.point, second.point, 0.0, f64::INFINITY), 0.0);
    assert_eq!(half_width(DVec3::ZERO, DVec3::ZERO, 5.0, f64::INFINITY), 5.0);
}

// 4. Coincident surfaces

/// Two plates of glass, N-BK7 and SF66, with air of this thickness between their tilted (or curved) faces.
fn cemented(gap: f64, curved: bool) -> Chain {
    let middle = |shift: f64| {
        if curved {
            Surface::Sphere { center: DVec3::new(0.0, 0.0, 4.0 + shift), radius: 3.0, inward: false }
        } else {
            let normal = DVec3::new(0.2, 0.1, -1.0).normalize();
            Surface::Plane { point: DVec3::new(0.0, 0.0, 1.0) - shift * normal, normal }
        }
    };
    let plane = |z: f64| Surface::Plane { point: DVec3::new(0.0, 0.0, z), normal: DVec3::NEG_Z };
    let event = |surface, beyond| Event { surface, root: Root::First, action: Action::Interface(beyond) };
    Chain {
        start: Start::pinhole(DVec3::new(0.1, 0.0, -2.0), DVec3::new(0.1, 0.15, 1.0), 500.0),
        media: vec![Law::Constant(1.0), Law::bk7(), Law::sf66()],
        first_medium: 0,
        events: vec![event(plane(0.0), 1), event(middle(0.0), 0), event(middle(gap), 2), event(plane(2.0), 0)],
        receiver: plane(5.0),
        receiver_root: Root::First,
        nanometers: 550.0,
    }
}

#[test]
fn case_04_a_vanishing_gap_is_the_limit_of_a_small_one() {
    for curved in [false, true] {
        let columns = |gap| {
            let chain = cemented(gap, curved);
            let run: Run<SecondOrderColumns> = run(&chain);
            assert_eq!(run.kinds(), [Kind::Refraction; 4]);
            all_columns(&run.columns)
        };
        let (closed, open) = (columns(0.0), columns(1e-12));
        for (order, (a, b)) in closed.iter().zip(&open).enumerate() {
            assert!((a.point - b.point).length() < 1e-9 * a.point.length(), "column {order}: {a:?} {b:?}");
            assert!((a.momentum - b.momentum).length() < 1e-9 * a.momentum.length().max(1e-9), "column {order}");
        }
    }
}

#[test]
fn case_04_a_transfer_of_no_length_only_projects_anew() {
    let (glass, direction) = (bk7(), DVec3::new(0.3, -0.2, 1.0).normalize());
    let surface = flat(DVec3::new(0.1, 0.2, -1.0).normalize());
    let there =
        |distance: f64, n_g: DVec3| Transfer { distance, direction, medium: glass, n_g, curvature: Curvature::Plane };
    let once = arrived(direction, &glass, &surface);
    // On the same tangent plane the point stays, to rounding.
    let mut again = once;
    again.transfer(&there(0.0, surface.n_g));
    for (a, b) in all_columns(&once).iter().zip(all_columns(&again)) {
        assert!((a.point - b.point).length() <= 4.0 * f64::EPSILON * a.point.length());
        assert_eq!(a.momentum, b.momentum);
    }
    // On another one it moves along the ray, and is the same as if the first surface had not been there.
    let other = flat(DVec3::new(-0.3, 0.1, -1.0).normalize());
    let mut via = once;
    via.transfer(&there(0.0, other.n_g));
    let direct = arrived(direction, &glass, &other);
    for (a, b) in all_columns(&via).iter().zip(all_columns(&direct)).take(3) {
        assert!((a.point - b.point).length() <= 16.0 * f64::EPSILON * b.point.length(), "{a:?} {b:?}");
    }
}

// 5. Scale

fn scaled_surface(surface: &Surface, scale: f64) -> Surface {
    match surface.clone() {
        Surface::Plane { point, normal } => Surface::Plane { point: scale * point, normal },
        Surface::Sphere { center, radius, inward } => {
            Surface::Sphere { center: scale * center, radius: scale * radius, inward }
        }
        Surface::Quadric { center, matrix } => {
            Surface::Quadric { center: scale * center, matrix: matrix * (1.0 / scale) }
        }
        Surface::Triangle { corners, normals } => Surface::Triangle { corners: corners.map(|c| scale * c), normals },
    }
}

/// The same scene in other units of length.
fn scaled(chain: &Chain, scale: f64) -> Chain {
    let mut scaled = chain.clone();
    let start = &mut scaled.start;
    for v in [&mut start.origin, &mut start.origin_x, &mut start.origin_y] {
        *v *= scale;
    }
    for event in &mut scaled.events {
        event.surface = scaled_surface(&event.surface, scale);
    }
    scaled.receiver = scaled_surface(&scaled.receiver, scale);
    scaled
}

#[test]
fn case_05_power_of_two_scales_change_no_bit() {
    for (name, chain) in cases::all() {
        let reference: Run<SecondOrderColumns> = run(&chain);
        for exponent in [-20, -3, 1, 20] {
            let scale = f64::powi(2.0, exponent);
            let run: Run<SecondOrderColumns> = run(&scaled(&chain, scale));
            for (a, b) in all_columns(&reference.columns).iter().zip(all_columns(&run.columns)) {
                assert_eq!((scale * a.point, a.momentum), (b.point, b.momentum), "{name} at 2^{exponent}");
            }
        }
    }
}

#[test]
fn case_05_points_scale_and_momenta_do_not() {
    for (name, chain) in cases::all() {
        let reference: Run<SecondOrderColumns> = run(&chain);
        for scale in [1e-6, 1e-3, 1e3, 1e6] {
            let run: Run<SecondOrderColumns> = run(&scaled(&chain, scale));
            for (a, b) in all_columns(&reference.columns).iter().zip(all_columns(&run.columns)) {
                let close = |a: DVec3, b: DVec3, floor: f64| (a - b).length() <= 1e-11 * a.length() + floor;
                assert!(close(scale * a.point, b.point, 0.0), "{name} at {scale}: {a:?} {b:?}");
                // The deflector's K_λ vanishes; what is left is rounding of n' ≈ 5e-5/nm.
                assert!(close(a.momentum, b.momentum, 1e-19), "{name} at {scale}: {a:?} {b:?}");
            }
            assert_judged(&format!("{name} at {scale}"), &scaled(&chain, scale));
        }
    }
}

#[test]
fn case_05_screen_motion_has_no_unit_of_length() {
    let (x, y) = (DVec3::new(0.3, 0.1, 0.0), DVec3::new(-0.2, 0.5, 0.0));
    let v = DVec3::new(0.01, 0.02, 0.0);
    let reference = screen_motion(x, y, v, DVec3::Z).expect("no caustic");
    for scale in [1e-100, 1e-6, 1e6, 1e100] {
        let motion = screen_motion(scale * x, scale * y, scale * v, DVec3::Z).expect("no caustic");
        assert!((motion - reference).length() <= 1e-14 * reference.length(), "{scale}: {motion}");
    }
}

// 6. Degenerate triangles (as far as they reach the calculus: flat normals; the mesh drops them before)

#[test]
fn case_06_sliver_triangles_have_finite_derivatives() {
    // A triangle 1 by 1e-12 with vertex normals: its gradient is huge across and the ray still has derivatives.
    for height in [1e-3, 1e-6, 1e-9, 1e-12] {
        let corners = [DVec3::new(-0.5, 0.0, 1.0), DVec3::new(0.0, height, 1.0), DVec3::new(0.5, 0.0, 1.0)];
        let lean = |x: f64| DVec3::new(x, 0.0, -1.0);
        let mut chain = single(Law::Constant(1.0), Law::bk7(), DVec3::new(0.01, 0.25 * height, 1.0));
        let normals = Some([lean(-0.1), lean(0.0), lean(0.1)]);
        chain.events[0].surface = Surface::Triangle { corners, normals };
        let run: Run<SecondOrderColumns> = run(&chain);
        assert!(all_columns(&run.columns).iter().all(|c| c.point.is_finite() && c.momentum.is_finite()));
        assert_judged(&format!("height {height}"), &chain);
    }
}

// 7. Vanishing curvature

#[test]
fn case_07_a_huge_sphere_is_a_plane() {
    let chain = |surface: Surface| Chain {
        events: vec![
            Event { surface, root: Root::First, action: Action::Interface(1) },
            Event {
                surface: Surface::Plane { point: DVec3::new(0.0, 0.0, 2.0), normal: DVec3::new(0.2, 0.0, 1.0) },
                root: Root::First,
                action: Action::Interface(0),
            },
        ],
        receiver: Surface::Plane { point: DVec3::new(0.0, 0.0, 4.0), normal: DVec3::NEG_Z },
        ..single(Law::Constant(1.0), Law::bk7(), DVec3::new(0.2, 0.3, 1.0))
    };
    let flat: Run<SecondOrderColumns> =
        run(&chain(Surface::Plane { point: DVec3::new(0.0, 0.0, 1.0), normal: DVec3::NEG_Z }));
    let lean = |x: f64, y: f64| DVec3::new(1e-9 * x, 1e-9 * y, -1.0);
    let smooth = Surface::Triangle {
        corners: [DVec3::new(-1.0, -1.0, 1.0), DVec3::new(0.0, 2.0, 1.0), DVec3::new(2.0, -1.0, 1.0)],
        normals: Some([lean(-1.0, -1.0), lean(0.0, 2.0), lean(2.0, -1.0)]),
    };
    let huge = Surface::Sphere { center: DVec3::new(0.0, 0.0, 1.0 + 1e9), radius: 1e9, inward: false };
    for (name, surface) in [("vertex normals equal to 1e-9", smooth), ("sphere of radius 1e9", huge)] {
        let chain = chain(surface);
        let curved: Run<SecondOrderColumns> = run(&chain);
        for (a, b) in all_columns(&flat.columns).iter().zip(all_columns(&curved.columns)) {
            // Normals 1e-9 apart are 1e-9 apart in angle; the geometry between adds a factor of a few.
            assert!((a.point - b.point).length() < 5e-9 * a.point.length(), "{name}: {a:?} {b:?}");
            assert!((a.momentum - b.momentum).length() < 5e-9 * a.momentum.length(), "{name}: {a:?} {b:?}");
        }
        assert_judged(name, &chain);
    }
}

#[test]
fn case_07_vertex_normals_that_cancel_leave_a_flat_facet() {
    // |S| → 0: the normal is the geometric one and does not move.
    let glass = bk7();
    let direction = DVec3::new(0.2, 0.1, 1.0).normalize();
    let gradient = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::ZERO);
    let surface = LocalSurface { field: NormalField::Linear { vector: DVec3::ZERO, gradient }, ..flat(DVec3::NEG_Z) };
    let columns_after = |surface: &LocalSurface| {
        let mut columns = arrived(direction, &IorJet::VACUUM, surface);
        columns.scatter(&refract_or_reflect(direction, surface, &IorJet::VACUUM, &glass));
        all_columns(&columns)
    };
    assert_eq!(bits(&columns_after(&surface)), bits(&columns_after(&flat(DVec3::NEG_Z))));
}

// 8. Shading normal against geometric normal

/// A shading normal from behind: the ray at grazing incidence on n_g comes from the other side of n_s.
fn contradicting(curvature: Curvature) -> [(DVec3, LocalSurface); 2] {
    let n_g = DVec3::NEG_Z;
    let gradient = DMat3::from_cols(DVec3::new(0.3, 0.1, 0.0), DVec3::new(-0.1, 0.2, 0.0), DVec3::ZERO);
    let shaded = |n_s: DVec3| LocalSurface {
        n_g,
        n_s: n_s.normalize(),
        curvature,
        field: NormalField::Linear { vector: n_s, gradient },
    };
    [
        // K·N and K·n_g of different sign.
        (DVec3::new(1.0, 0.0, 0.1).normalize(), shaded(DVec3::new(0.5, 0.1, -1.0))),
        // Seen from the front, but the mirror image goes through the surface.
        (DVec3::new(1.0, 0.0, 0.3).normalize(), shaded(DVec3::new(0.25, 0.1, -1.0))),
    ]
}

#[test]
fn case_08_a_contradicting_shading_normal_gives_way_with_its_derivatives() {
    let (air, glass) = (IorJet::VACUUM, bk7());
    let sphere_field = sphere(DVec3::NEG_Z, 2.5);
    let geometric = [flat(DVec3::NEG_Z), sphere_field];
    for plain in geometric {
        for (case, (direction, surface)) in contradicting(plain.curvature).into_iter().enumerate() {
            let events: [&dyn Fn(&LocalSurface) -> Scattering; 2] =
                [&|s| mirror(direction, s, &air), &|s| refract_or_reflect(direction, s, &air, &glass)];
            for (index, event) in events.into_iter().enumerate() {
                // The second ray is transmitted to the right side, only its mirror image is impossible.
                if case == 1 && index == 1 {
                    continue;
                }
                let (found, expected) = (event(&surface), event(&plain));
                assert!(found.geometric_normal_used && !expected.geometric_normal_used, "{case} {index}");
                let after = |s: &Scattering| {
                    let mut columns = arrived(direction, &air, &plain);
                    columns.scatter(s);
                    bits(&all_columns(&columns))
                };
                assert_eq!(found.momentum_out, expected.momentum_out);
                assert_eq!(after(&found), after(&expected));
            }
        }
    }
}

#[test]
fn case_08_total_reflection_does_not_pass_through_the_surface() {
    // Inside glass, the shading normal reflects totally into the outside: redone with the geometric normal.
    let (air, glass) = (IorJet::VACUUM, bk7());
    let mut random = Random::new(8);
    let mut redone = 0;
    for _ in 0..5000 {
        let direction = random.direction();
        let n_g = random.direction();
        let n_s = (n_g + random.range(0.0, 1.5) * random.direction()).normalize();
        if n_s.dot(n_g) <= 0.0 {
            continue;
        }
        let surface = LocalSurface { n_g, n_s, curvature: Curvature::Plane, field: NormalField::Flat };
        for (ior_i, ior_t) in [(&air, &glass), (&glass, &air)] {
            let momentum = direction * ior_i.ior;
            for s in [refract_or_reflect(momentum, &surface, ior_i, ior_t), mirror(momentum, &surface, ior_i)] {
                let before = momentum.dot(n_g).is_sign_positive();
                let after = s.momentum_out.dot(n_g).is_sign_positive();
                assert_eq!(before == after, s.kind == ScatterKind::Refraction, "{direction} {surface:?}");
                assert!(s.momentum_in.dot(s.normal) < 0.0);
                redone += u32::from(s.geometric_normal_used);
            }
        }
    }
    assert!(redone > 100, "{redone}");
}

// 9. Many reflections

/// A tilted brick of glass with 40 internal reflections, entered and left through its faces.
fn brick(reflections: usize) -> Chain {
    let faces = [
        (DVec3::new(1.0, 0.1, 0.0), 1.0),
        (DVec3::new(-1.0, 0.0, 0.12), 1.1),
        (DVec3::new(0.0, 1.0, 0.07), 0.8),
        (DVec3::new(0.09, -1.0, 0.0), 0.9),
        (DVec3::new(0.0, 0.05, 1.0), 1.2),
        (DVec3::new(0.0, -0.11, -1.0), 1.0),
    ]
    .map(|(n, distance): (DVec3, f64)| (n.normalize(), distance));
    let surface = |(normal, distance): (DVec3, f64)| Surface::Plane { point: normal * distance, normal };
    let start = Start::pinhole(DVec3::new(0.1, 0.2, -4.0), DVec3::new(0.11, -0.07, 1.0), 500.0);
    let (mut p, mut d) = (start.origin, start.look.normalize());
    // The path for the order of the faces alone; mirrors do not care how precisely.
    let n = Law::bk7().ior(550.0);
    let entry = faces[5];
    p += d * ((entry.1 - entry.0.dot(p)) / entry.0.dot(d));
    let tangential = (d - entry.0 * entry.0.dot(d)) / n;
    d = tangential - entry.0 * (1.0 - tangential.length_squared()).sqrt();
    let mut events = vec![Event { surface: surface(entry), root: Root::First, action: Action::Interface(1) }];
    let mut last = 5;
    for _ in 0..reflections {
        let (t, face) = (0..6)
            .filter(|&k| k != last && faces[k].0.dot(d) > 0.0)
            .map(|k| ((faces[k].1 - faces[k].0.dot(p)) / faces[k].0.dot(d), k))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("a closed body");
        p += t * d;
        d -= 2.0 * d.dot(faces[face].0) * faces[face].0;
        events.push(Event { surface: surface(faces[face]), root: Root::First, action: Action::Mirror });
        last = face;
    }
    let receiver = Surface::Sphere { center: DVec3::ZERO, radius: 5.0, inward: true };
    Chain {
        start,
        media: vec![Law::Constant(1.0), Law::bk7()],
        first_medium: 0,
        events,
        receiver,
        receiver_root: Root::Second,
        nanometers: 550.0,
    }
}

#[test]
fn case_09_fifty_flat_reflections_keep_the_momentum_and_the_invariants() {
    let chain = brick(50);
    let subject = Subject::new(&chain);
    let run: Run<SecondOrderColumns> = subject.run().expect("stays inside");
    let jets = subject.jets();
    let jet = run.medium;
    assert!((run.momentum.length() - jet.ior).abs() < 1e-14 * jet.ior);
    // K·K' = n n' at every bounce.
    for (index, [_, after]) in run.transfers.iter().enumerate().skip(1) {
        let momentum = run.steps[index].transfer.direction * jet.ior;
        let product = momentum.dot(after.lambda().expect("carried").momentum);
        let expected = jet.ior * jet.dior_dlambda;
        assert!((product - expected).abs() < 1e-12 * expected.abs(), "bounce {index}: {product:e} {expected:e}");
        for column in after.screen().expect("carried") {
            assert!(momentum.dot(column.momentum).abs() < 1e-12 * column.momentum.length(), "bounce {index}");
        }
    }
    let [x, y] = run.columns.screen().expect("carried");
    let lambda = run.columns.lambda().expect("carried");
    let scale = x.momentum.length() * y.point.length();
    let i1 = x.momentum.dot(y.point) - y.momentum.dot(x.point);
    assert!(i1.abs() < 1e-10 * scale, "I1: {i1:e} of {scale:e}");
    let mut path = 0.0;
    for ((step, [before, after]), &medium) in run.steps.iter().zip(&run.transfers).zip(&run.media) {
        let [b, a] = [before, after].map(|c| c.screen().expect("carried")[0].point);
        path += jets[medium].dior_dlambda * step.transfer.direction.dot(a - b);
    }
    let i2 = x.momentum.dot(lambda.point) - lambda.momentum.dot(x.point) + path;
    let scale = x.momentum.length() * lambda.point.length() + lambda.momentum.length() * x.point.length();
    assert!(i2.abs() < 1e-10 * scale, "I2: {i2:e} of {scale:e}");
    assert_judged("brick", &chain);
}

#[test]
fn case_09_flat_facets_grow_the_spot_linearly_with_the_path() {
    // Unfolded, the reflections are a straight line: p_λ after n bounces grows as its length.
    let size = |bounces: usize| {
        let run: Run<LambdaColumn> = run(&brick(bounces));
        let path: f64 = run.steps.iter().skip(1).map(|s| s.transfer.distance).sum();
        // Across the ray, the obliquity of the last surface taken off.
        let p = run.columns.lambda().expect("carried").point;
        let across = p - run.direction * p.dot(run.direction);
        across.length() / path
    };
    let reference = size(5);
    for bounces in [10, 20, 40] {
        assert!((size(bounces) / reference - 1.0).abs() < 0.2, "{bounces}: {} {reference}", size(bounces));
    }
}

// 10. Poles

#[test]
fn case_10_a_pole_in_the_band_is_refused_when_the_law_is_made() {
    for pole in [0.36, 0.361, 0.5, 0.55, 0.829, 0.83] {
        let message = Dispersion::sellmeier(&[1.0], &[pole * pole]).expect_err("a pole in the band");
        assert!(!message.is_empty());
        Dispersion::sellmeier_squared(0.0, &[1.0], &[pole]).expect_err("a pole in the band");
        // A weak one is a pole too.
        Dispersion::sellmeier(&[1.0, 1e-9], &[0.01, pole * pole]).expect_err("a weak pole in the band");
    }
    // n² ≤ 0: below a pole beyond the band, or by negative strength.
    Dispersion::sellmeier(&[5.0], &[0.9]).expect_err("n² < 0 in the band");
    Dispersion::sellmeier(&[-3.0], &[0.01]).expect_err("n² < 0 in the band");
    Dispersion::cauchy(&[-1.0, 0.01]).expect_err("n < 0");
    Dispersion::cauchy(&[0.1, -0.1]).expect_err("n < 0 at the blue end");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        Dispersion::constant(bad).expect_err("no number");
        Dispersion::cauchy(&[1.5, bad]).expect_err("no number");
        Dispersion::sellmeier(&[bad], &[0.01]).expect_err("no number");
        Dispersion::sellmeier(&[1.0], &[bad]).expect_err("no number");
        Dispersion::from_abbe_number(1.5, bad).expect_err("no number");
    }
    for bad in [0.0, -0.0, -1.5] {
        Dispersion::constant(bad).expect_err("no index");
    }
    Dispersion::sellmeier(&[], &[]).expect_err("no terms");
    Dispersion::sellmeier(&[1.0, 2.0], &[0.01]).expect_err("lengths differ");
}

#[test]
fn case_10_every_law_that_exists_is_finite_in_the_band() {
    let mut random = Random::new(10);
    let mut made = 0;
    for _ in 0..4000 {
        let b: Vec<f64> = (0..1 + random.below(3)).map(|_| random.range(-2.0, 3.0)).collect();
        let c: Vec<f64> = b.iter().map(|_| random.decades(-3.0, 2.5)).collect();
        let Ok(law) = Dispersion::sellmeier(&b, &c) else { continue };
        made += 1;
        for _ in 0..50 {
            let jet = law.at(Wavelength::from_nanometers(random.range(360.0, 830.0)));
            assert!(jet.ior > 0.0 && jet.ior.is_finite(), "{b:?} {c:?}: {jet:?}");
            assert!(jet.dior_dlambda.is_finite() && jet.d2ior_dlambda2.is_finite(), "{b:?} {c:?}: {jet:?}");
        }
    }
    assert!(made > 500, "{made}");
}

// 11. Outside of the range: the closed laws have none beyond the visible band, in which every one is proven to be finite;
// the limit of the band itself belongs to the band.

#[test]
fn case_11_laws_hold_on_the_ends_of_the_band() {
    for law in [Law::bk7(), Law::sf66(), Law::AbbeNumber { nd: 1.5, vd: 20.0 }] {
        for nanometers in [360.0, 830.0] {
            let jet = subject::dispersion(&law).expect("a glass").at(Wavelength::from_nanometers(nanometers));
            let h = Real::power_of_two(-100);
            let at = |steps: f64| trace::ior(&law, &(Real::new(nanometers) + &h * Real::new(steps)));
            let first = ((at(1.0) - at(-1.0)) * Real::power_of_two(99)).to_f64();
            let second = ((at(1.0) - at(0.0) - (at(0.0) - at(-1.0))) * Real::power_of_two(200)).to_f64();
            assert!((jet.ior - at(0.0).to_f64()).abs() <= 4.0 * f64::EPSILON * jet.ior);
            assert!((jet.dior_dlambda - first).abs() <= 1e-14 * first.abs(), "{law:?} {nanometers}");
            assert!((jet.d2ior_dlambda2 - second).abs() <= 1e-13 * second.abs(), "{law:?} {nanometers}");
        }
    }
}

// 12. Units

#[test]
fn case_12_laws_take_micrometres_and_answer_per_nanometre() {
    let wavelength = Wavelength::from_nanometers(550.0);
    assert_eq!(wavelength.micrometers(), 0.55);
    // Golden values of the catalogue, per µm.
    for (law, per_micrometer) in [(Law::bk7(), -0.050317718), (Law::sf66(), -0.27777587)] {
        let jet = subject::dispersion(&law).expect("a glass").at(wavelength);
        assert!((1000.0 * jet.dior_dlambda - per_micrometer).abs() < 5e-9, "{jet:?}");
    }
    assert_eq!(lines::D.nanometers(), 587.5618);
    assert!((subject::dispersion(&Law::bk7()).expect("a glass").at(lines::D).ior - 1.51680).abs() < 5e-6);
}

/// The oracle's perturbed re-trace reacts as rounding does: otherwise every bound here would be empty.
#[test]
fn the_judge_finds_a_wrong_column() {
    let chain = cases::ball(1);
    let truth = judge::Truth::new(&chain).expect("reaches");
    let run: Run<SecondOrderColumns> = run(&chain);
    let right = *run.columns.lambda().expect("carried");
    assert!(truth.compare("p_λ", 1, right.point, |t| &t.lambda.point).holds());
    let wrong = right.point * (1.0 + 1e-9);
    assert!(!truth.compare("p_λ", 1, wrong, |t| &t.lambda.point).holds());
    assert!(!truth.compare("p_λ", 1, DVec3::NAN, |t| &t.lambda.point).holds());
    assert!(!truth.compare("p_λ", 1, DVec3::ZERO, |t| &t.lambda.point).holds());
    let noise = derivative::derivatives(&chain, &Noise::seeded(1)).expect("reaches");
    let reaction = derivative::reaction(&noise.lambda.point, &truth.exact.lambda.point);
    let size = truth.exact.lambda.point.length().to_f64();
    assert!((0.1..1e3).contains(&(reaction / size)), "{}", reaction / size);
}
