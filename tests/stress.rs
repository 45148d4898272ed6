//! Numerical stress: randomised chains over all laws, surfaces and scales, at grazing and critical angles, between
//! index-matched media, with 1 to 50 events, against multi-precision re-traces.
//!
//! Prints a table of the worst errors per category. `make stress` runs the long form (minutes), `make test` a short one
//! (seconds). Environment: `ABBE_STRESS_CHAINS=N` judges N chains in either;
//! `ABBE_STRESS_CASE=n` judges that one chain and prints everything about it.
//!
//! Errors are given as such and in units of the chain's condition number (see `oracle`). Only the latter have a bound:
//! 10⁻¹² for first and for second derivatives. W² and G are compared with their exact values for the product's own n₀, n₁
//! and g.

#![allow(clippy::print_stdout, reason = "the table is what the test is for")]

mod oracle;

use abbe::ray::{ScatterKind, SecondOrderColumns};
use glam::{DMat3, DQuat, DVec3};
use oracle::{
    chain::{Action, Chain, Event, Law, Root, Start, Surface},
    judge::{self, FIRST_ORDER_BOUND, Finding, SECOND_ORDER_BOUND, Verdict},
    random::Random,
    real::Real,
    subject::{self, Run, Subject},
    trace::{Kind, Passed, State, Tracer},
};
use rayon::prelude::*;
use std::{env, time::Instant};

/// W² is a compensated sum and G a quotient: a few units of rounding, 2⁻⁵³ each.
const W_SQUARED_BOUND: f64 = 4.0 * f64::EPSILON;

/// Chains of the short form, per category.
const SHORT_FORM: usize = 16;

/// And of the long one.
const LONG_FORM: usize = 400;

type Recipe = fn(&mut Random) -> Option<Chain>;

const CATEGORIES: [(&str, Recipe); 14] = [
    ("planes, facets", |r| generic(r, &[Shape::Plane, Shape::Facet], 8)),
    ("spheres", |r| generic(r, &[Shape::Sphere], 6)),
    ("ellipsoids", |r| generic(r, &[Shape::Ellipsoid], 5)),
    ("smooth facets", |r| generic(r, &[Shape::Smooth], 6)),
    ("weak curvature (r to 1e9)", weak_curvature),
    ("grazing incidence", grazing),
    ("before the critical angle", |r| critical(r, 1.0)),
    ("beyond the critical angle", |r| critical(r, -1.0)),
    ("index-matched media", index_matched),
    ("scales 1e-6 to 1e6", scaled),
    ("far from the origin", far_away),
    ("gem, 30 to 50 reflections", gem),
    ("ball, 1 to 40 reflections", whispering_ball),
    ("everything, 1 to 50 events", |r| generic(r, &Shape::ALL, 50)),
];

#[derive(Clone, Copy)]
enum Shape {
    Plane,
    Facet,
    Sphere,
    Ellipsoid,
    Smooth,
}

impl Shape {
    const ALL: [Self; 5] = [Self::Plane, Self::Facet, Self::Sphere, Self::Ellipsoid, Self::Smooth];
}

/// A valid dispersion law of any kind.
fn law(random: &mut Random) -> Law {
    loop {
        let law = any_law(random);
        if subject::dispersion(&law).is_ok() {
            return law;
        }
    }
}

fn any_law(random: &mut Random) -> Law {
    let kind = random.below(7);
    let mut vary =
        |values: &[f64], by: f64| -> Vec<f64> { values.iter().map(|v| v * random.range(1.0 - by, 1.0 + by)).collect() };
    match kind {
        0 => Law::Sellmeier {
            b: vary(&[1.03961212, 0.231792344, 1.01046945], 0.2),
            c: vary(&[0.00600069867, 0.0200179144, 103.560653], 0.2),
        },
        // The second pole up to 0.345 µm, hard by the band.
        1 => Law::Sellmeier { b: vary(&[1.6, 0.02], 0.3), c: vary(&[0.01, 0.1], 0.19) },
        2 => Law::SellmeierSquared {
            constant: vary(&[0.2], 1.0)[0],
            b: vary(&[1.0, 0.9], 0.3),
            c: vary(&[0.13, 9.0], 0.3),
        },
        3 => Law::Cauchy(vary(&[1.6, 0.008, 2e-4], 0.3)),
        4 => Law::AbbeNumber { nd: vary(&[1.9], 0.25)[0], vd: vary(&[50.0], 0.7)[0] },
        5 => Law::Scaled(Box::new(Law::sf66()), vary(&[2.0], 0.9)[0]),
        _ => Law::Constant(vary(&[1.7], 0.4)[0]),
    }
}

/// Grows a chain surface by surface in front of the ray.
struct Builder {
    chain: Chain,
    tracer: Tracer,
    state: State,
    scale: f64,
}

impl Builder {
    fn new(random: &mut Random, media: Vec<Law>, first_medium: usize, scale: f64, offset: DVec3) -> Self {
        let look = random.direction() * random.decades(-1.0, 1.0);
        let mut start = Start::pinhole(offset, look, random.decades(1.5, 3.5));
        if random.chance(0.3) {
            // No pinhole: a lens or an orthographic camera.
            start.origin_x = random.direction() * (0.01 * scale);
            start.origin_y = random.direction() * (0.01 * scale);
        }
        let nanometers = random.range(380.0, 780.0);
        Self::with(
            Chain {
                start,
                media,
                first_medium,
                events: Vec::new(),
                receiver: Surface::Plane { point: DVec3::ZERO, normal: DVec3::Z },
                receiver_root: Root::First,
                nanometers,
            },
            scale,
        )
    }

    fn with(chain: Chain, scale: f64) -> Self {
        let mut tracer = Tracer::new(&chain.media, chain.nanometers);
        let state = tracer.start(&chain, &Real::zero(), &Real::zero());
        Self { chain, tracer, state, scale }
    }

    fn point(&self) -> DVec3 {
        DVec3::from_array(self.state.point.to_f64())
    }

    fn direction(&self) -> DVec3 {
        DVec3::from_array(self.state.direction.to_f64())
    }

    fn ior(&self, medium: usize) -> f64 {
        self.chain.media[medium].ior(self.chain.nanometers)
    }

    /// A surface that the ray meets at this cosine of the angle of incidence.
    fn surface(&self, random: &mut Random, shape: Shape, cos: f64, radius: f64) -> (Surface, Root) {
        let (p, d) = (self.point(), self.direction());
        let side = d.cross(random.direction()).normalize();
        // The normal that faces the ray.
        let normal = -cos * d + ((1.0 - cos) * (1.0 + cos)).sqrt() * side;
        let reached = p + d * (self.scale * random.range(0.3, 2.0));
        let flipped = random.chance(0.5);
        let authored = if flipped { -normal } else { normal };
        match shape {
            Shape::Plane => {
                let within = normal.cross(random.direction()) * self.scale;
                (Surface::Plane { point: reached + within, normal: authored }, Root::First)
            }
            Shape::Facet | Shape::Smooth => {
                let (u, v) = authored.any_orthonormal_pair();
                let corner = |angle: f64, r: f64| reached + self.scale * r * (angle.cos() * u + angle.sin() * v);
                let turn = random.range(0.0, 6.0);
                let corners = [0.0, 2.1, 4.2].map(|a| corner(a + turn, random.range(0.5, 1.5)));
                let normals = matches!(shape, Shape::Smooth).then(|| {
                    // Vertex normals lean by less than the ray does, and are not all of length 1.
                    let lean = 0.3 * cos.min(0.7);
                    corners.map(|_| (authored + lean * random.direction()) * random.range(0.7, 1.5))
                });
                (Surface::Triangle { corners, normals }, Root::First)
            }
            Shape::Sphere => {
                // The centre behind the surface: met from outside; before it: from inside, at the second crossing.
                let outside = random.chance(0.5);
                let center = if outside { reached - radius * normal } else { reached + radius * normal };
                let root = if outside { Root::First } else { Root::Second };
                (Surface::Sphere { center, radius, inward: flipped }, root)
            }
            Shape::Ellipsoid => {
                let turn = DMat3::from_quat(DQuat::from_axis_angle(random.direction(), random.range(0.0, 3.0)));
                let mut axis = || 1.0 / (radius * random.range(0.5, 1.5));
                let matrix = DMat3::from_diagonal(DVec3::new(axis(), axis(), axis())) * turn;
                // The point of the unit sphere whose image has this normal: A⁻ᵀ n, normalised.
                let inverse = matrix.inverse();
                let outside = random.chance(0.5);
                let outward = if outside { normal } else { -normal };
                let away = inverse * (inverse.transpose() * outward).normalize();
                let root = if outside { Root::First } else { Root::Second };
                (Surface::Quadric { center: reached - away, matrix }, root)
            }
        }
    }

    /// Adds an event; None where the surface cannot be met.
    fn add(&mut self, surface: Surface, root: Root, action: Action) -> Option<Passed> {
        let event = Event { surface, root, action };
        let mut state = self.state.clone();
        let passed = self.tracer.pass(&mut state, &event)?;
        // From one surface to the next there is a way; coincident surfaces have a test of their own.
        if passed.distance.to_f64() < 1e-3 * self.scale {
            return None;
        }
        self.state = state;
        self.chain.events.push(event);
        Some(passed)
    }

    fn finish(mut self, random: &mut Random) -> Option<Chain> {
        let shape = if random.chance(0.5) { Shape::Plane } else { Shape::Sphere };
        let cos = random.range(0.3, 1.0);
        let radius = self.scale * random.range(3.0, 10.0);
        let (receiver, root) = self.surface(random, shape, cos, radius);
        let kept = self.chain.clone();
        self.add(receiver.clone(), root, Action::Mirror)?;
        Some(Chain { receiver, receiver_root: root, ..kept })
    }
}

fn media(random: &mut Random, count: usize) -> Vec<Law> {
    let mut media = vec![Law::Constant(1.0)];
    media.extend((1..count).map(|_| law(random)));
    media
}

/// Any surfaces of these shapes at moderate incidence, in any order of refractions, mirrors and total reflections.
fn walk(random: &mut Random, builder: &mut Builder, shapes: &[Shape], events: usize) -> Option<()> {
    // Long chains of strong curvature are chaotic: every event multiplies errors by about 2 L/r.
    let weakness = if events > 10 { 1.0 } else { 0.0 };
    for _ in 0..events {
        let shape = shapes[random.below(shapes.len())];
        let cos = random.range(0.25, 1.0);
        let radius = builder.scale * random.decades(0.3 + weakness, 1.5 + weakness);
        let (surface, root) = builder.surface(random, shape, cos, radius);
        let action = if random.chance(0.25) {
            Action::Mirror
        } else {
            Action::Interface(random.below(builder.chain.media.len()))
        };
        builder.add(surface, root, action)?;
    }
    Some(())
}

fn generic(random: &mut Random, shapes: &[Shape], most: usize) -> Option<Chain> {
    let media = media(random, 4);
    // Air most of the time, glass else: a camera inside a medium.
    let first = if random.chance(0.8) { 0 } else { 1 };
    let mut builder = Builder::new(random, media, first, 1.0, DVec3::ZERO);
    let events = 1 + random.below(most);
    walk(random, &mut builder, shapes, events)?;
    builder.finish(random)
}

fn weak_curvature(random: &mut Random) -> Option<Chain> {
    let media = media(random, 3);
    let mut builder = Builder::new(random, media, 0, 1.0, DVec3::ZERO);
    for _ in 0..1 + random.below(4) {
        let (cos, radius) = (random.range(0.3, 1.0), random.decades(3.0, 9.0));
        let shape = if random.chance(0.7) { Shape::Sphere } else { Shape::Ellipsoid };
        let (surface, root) = builder.surface(random, shape, cos, radius);
        builder.add(surface, root, Action::Interface(random.below(3)))?;
    }
    builder.finish(random)
}

fn grazing(random: &mut Random) -> Option<Chain> {
    let media = media(random, 3);
    let mut builder = Builder::new(random, media, 0, 1.0, DVec3::ZERO);
    let shapes = [Shape::Plane, Shape::Facet, Shape::Sphere, Shape::Smooth];
    let shape = shapes[random.below(shapes.len())];
    let (cos, radius) = (random.decades(-6.0, -1.0), random.decades(0.0, 2.0));
    let (surface, root) = builder.surface(random, shape, cos, radius);
    builder.add(surface, root, Action::Interface(1 + random.below(2)))?;
    let more = random.below(3);
    walk(random, &mut builder, &[Shape::Plane, Shape::Sphere], more)?;
    builder.finish(random)
}

/// From glass into air at W² = ± n₀²·10⁻¹² … n₀²·10⁻².
fn critical(random: &mut Random, sign: f64) -> Option<Chain> {
    let media = media(random, 3);
    let mut builder = Builder::new(random, media, 1, 1.0, DVec3::ZERO);
    let beyond = if random.chance(0.7) { 0 } else { 2 };
    let (n0, n1) = (builder.ior(1), builder.ior(beyond));
    if n1 >= 0.98 * n0 {
        return None;
    }
    let w2 = sign * random.decades(-12.0, -2.0);
    let sin2 = (n1 / n0).powi(2) - w2;
    let cos = (1.0 - sin2).sqrt();
    let shapes = [Shape::Plane, Shape::Facet, Shape::Sphere, Shape::Ellipsoid];
    let shape = shapes[random.below(shapes.len())];
    let radius = random.decades(0.3, 1.5);
    let (surface, root) = builder.surface(random, shape, cos, radius);
    let passed = builder.add(surface, root, Action::Interface(beyond))?;
    let expected = if sign > 0.0 { Kind::Refraction } else { Kind::TotalReflection };
    if passed.kind != expected {
        return None;
    }
    let more = random.below(3);
    walk(random, &mut builder, &[Shape::Plane, Shape::Sphere], more)?;
    builder.finish(random)
}

/// Δn/n from 10⁻¹⁵ to 10⁻³ between laws of the same kind, or equal n with different n' (a Christiansen filter).
fn index_matched(random: &mut Random) -> Option<Chain> {
    let change = random.decades(-15.0, -3.0) * if random.chance(0.5) { 1.0 } else { -1.0 };
    let christiansen = random.chance(0.3);
    let nd = random.range(1.4, 2.2);
    let media = if christiansen {
        let vd = [random.range(15.0, 40.0), random.range(45.0, 90.0)];
        vec![Law::Constant(1.0), Law::AbbeNumber { nd, vd: vd[0] }, Law::AbbeNumber { nd, vd: vd[1] }]
    } else {
        let near = Law::Cauchy(vec![nd, 0.008, 1e-4]);
        let matched = Law::Cauchy(vec![nd * (1.0 + change), 0.008 * random.range(0.5, 1.5), 1e-4]);
        vec![Law::Constant(1.0), near, matched]
    };
    let mut builder = Builder::new(random, media, 1, 1.0, DVec3::ZERO);
    if christiansen {
        builder.chain.nanometers = 587.5618;
        builder = Builder::with(builder.chain, 1.0);
    }
    for index in 0..1 + random.below(4) {
        let cos = if random.chance(0.3) { random.decades(-3.0, -1.0) } else { random.range(0.2, 1.0) };
        let shape = Shape::ALL[random.below(5)];
        let radius = random.decades(0.3, 1.5);
        let (surface, root) = builder.surface(random, shape, cos, radius);
        builder.add(surface, root, Action::Interface(2 - index % 2))?;
    }
    builder.finish(random)
}

fn scaled(random: &mut Random) -> Option<Chain> {
    let media = media(random, 3);
    let scale = random.decades(-6.0, 6.0);
    let mut builder = Builder::new(random, media, 0, scale, DVec3::ZERO);
    let events = 1 + random.below(5);
    walk(random, &mut builder, &Shape::ALL, events)?;
    builder.finish(random)
}

fn far_away(random: &mut Random) -> Option<Chain> {
    let media = media(random, 3);
    let offset = random.direction() * random.decades(2.0, 7.0);
    let mut builder = Builder::new(random, media, 0, 1.0, offset);
    let events = 1 + random.below(4);
    walk(random, &mut builder, &Shape::ALL, events)?;
    builder.finish(random)
}

/// Into a convex polyhedron, around inside by total reflection (or silvered facets), and out on a receiver inside.
fn gem(random: &mut Random) -> Option<Chain> {
    let facets: Vec<(DVec3, f64)> = {
        let mut facets: Vec<DVec3> = Vec::new();
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for sign in [-1.0, 1.0] {
                facets.push((sign * axis + 0.3 * random.direction()).normalize());
            }
        }
        facets.extend((0..8).map(|_| random.direction()));
        facets.into_iter().map(|n| (n, random.range(0.8, 1.2))).collect()
    };
    let media = vec![Law::Constant(1.0), law(random)];
    let target = 0.3 * random.direction();
    let look = random.direction();
    let mut builder = Builder::new(random, media, 0, 1.0, target - 6.0 * look);
    builder.chain.start = Start::pinhole(target - 6.0 * look, look, 1000.0);
    builder = Builder::with(builder.chain, 1.0);
    let plane = |(normal, distance): (DVec3, f64)| Surface::Plane { point: normal * distance, normal };
    // A convex body is entered at the last of the crossings of the facets that face the ray.
    let (p, d) = (builder.point(), builder.direction());
    let entry = facets
        .iter()
        .filter(|(n, _)| n.dot(d) < 0.0)
        .map(|&(n, distance)| ((distance - n.dot(p)) / n.dot(d), (n, distance)))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    builder.add(plane(entry.1), Root::First, Action::Interface(1))?;
    let mut last = entry.1;
    for _ in 0..30 + random.below(21) {
        let (p, d) = (builder.point(), builder.direction());
        let next = facets
            .iter()
            .filter(|(n, _)| n.dot(d) > 0.0 && (*n - last.0).length() > 1e-9)
            .map(|&(n, distance)| ((distance - n.dot(p)) / n.dot(d), (n, distance)))
            .min_by(|a, b| a.0.total_cmp(&b.0))?
            .1;
        last = next;
        let cos = next.0.dot(d);
        let totally = builder.ior(1) * (1.0 - cos * cos).sqrt() > 1.0;
        let action = if totally { Action::Interface(0) } else { Action::Mirror };
        // None: a hop shorter than `add` takes, in an edge of the gem.
        builder.add(plane(next), Root::First, action)?;
        if builder.state.medium != 1 {
            return None;
        }
    }
    builder.finish(random)
}

fn whispering_ball(random: &mut Random) -> Option<Chain> {
    let media = vec![Law::Constant(1.0), law(random)];
    let mut builder = Builder::new(random, media, 0, 1.0, DVec3::ZERO);
    let cos = random.range(0.2, 0.98);
    let (ball, root) = loop {
        let (ball, root) = builder.surface(random, Shape::Sphere, cos, 1.0);
        if root == Root::First {
            break (ball, root);
        }
    };
    builder.add(ball.clone(), root, Action::Interface(1))?;
    for _ in 0..1 + random.below(40) {
        builder.add(ball.clone(), Root::Second, Action::Mirror)?;
    }
    builder.add(ball, Root::Second, Action::Interface(0))?;
    builder.finish(random)
}

/// The chain of a case number: category and draw.
fn build(case: u64) -> (usize, Chain) {
    let category = (case % CATEGORIES.len() as u64) as usize;
    let mut random = Random::new(case.wrapping_mul(0xd134_2543_de82_ef95));
    loop {
        if let Some(chain) = CATEGORIES[category].1(&mut random) {
            return (category, chain);
        }
    }
}

struct Outcome {
    case: u64,
    category: usize,
    events: usize,
    verdict: Verdict,
    w_squared_error: f64,
}

fn examine(case: u64) -> Outcome {
    let (category, chain) = build(case);
    Outcome {
        case,
        category,
        events: chain.events.len(),
        verdict: judge::judge(&chain),
        w_squared_error: w_squared_error(&chain),
    }
}

/// The worst relative error of W² and of the deflection G = W + g at the interfaces of a chain, for n₀, n₁ and g as the
/// product has them.
fn w_squared_error(chain: &Chain) -> f64 {
    let Some(run): Option<Run<SecondOrderColumns>> = Subject::new(chain).run() else { return 0.0 };
    let mut worst = 0.0_f64;
    let mut compare = |value: f64, exact: Real| {
        let error = if value.is_finite() { (Real::new(value) - &exact).abs() } else { return worst = f64::INFINITY };
        worst = worst.max(if exact.is_zero() { error.to_f64() } else { (error / exact.abs()).to_f64() });
    };
    for s in run.steps.iter().filter_map(|step| step.scattering.as_ref()) {
        if s.kind == ScatterKind::Mirror {
            continue;
        }
        let [n0, n1, g] = [s.ior_i.ior, s.ior_t.ior, s.g].map(Real::new);
        let exact = &n1 * &n1 - &n0 * &n0 + &g * &g;
        compare(s.w_squared, exact.clone());
        if s.kind == ScatterKind::Refraction && !exact.is_negative() {
            compare(s.deflection, exact.sqrt() + &g);
        }
    }
    worst
}

impl Outcome {
    fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        match &self.verdict {
            Verdict::Judged(findings) => {
                problems.extend(findings.iter().filter(|f| !f.holds()).map(describe));
            }
            Verdict::Undecidable => {}
            Verdict::Wrong(why) => problems.push(why.clone()),
        }
        if self.w_squared_error > W_SQUARED_BOUND {
            problems.push(format!("W² or G: relative error {:.1e} > {W_SQUARED_BOUND:.1e}", self.w_squared_error));
        }
        problems
    }
}

fn describe(f: &Finding) -> String {
    format!(
        "{:>5}: relative {:8.1e}  condition {:8.1e}  conditioned {:8.1e}  bound {:.0e}{}",
        f.name,
        f.relative,
        f.condition,
        f.conditioned,
        f.bound(),
        if f.holds() { "" } else { "  EXCEEDED" }
    )
}

/// The worst of one category.
#[derive(Default)]
struct Row {
    chains: usize,
    events: usize,
    undecidable: usize,
    relative: [f64; 3],
    condition: [f64; 3],
    conditioned: [f64; 3],
    w_squared: f64,
}

#[test]
fn random_chains_agree_with_the_retrace() {
    if let Ok(case) = env::var("ABBE_STRESS_CASE") {
        repeat(case.parse().expect("ABBE_STRESS_CASE is a case number"));
        return;
    }
    stress(chains_or(SHORT_FORM * CATEGORIES.len()));
}

#[test]
#[ignore = "minutes: the long form, run by `make stress`"]
fn many_random_chains_agree_with_the_retrace() {
    stress(chains_or(LONG_FORM * CATEGORIES.len()));
}

fn chains_or(default: usize) -> usize {
    match env::var("ABBE_STRESS_CHAINS") {
        Ok(chains) => chains.parse().expect("ABBE_STRESS_CHAINS is a number of chains"),
        Err(_) => default,
    }
}

fn stress(chains: usize) {
    assert!(chains >= CATEGORIES.len(), "at least one chain of every category: {}", CATEGORIES.len());
    let clock = Instant::now();
    let outcomes: Vec<Outcome> = (0..chains as u64).into_par_iter().map(examine).collect();
    let mut rows: [Row; CATEGORIES.len()] = Default::default();
    for outcome in &outcomes {
        let row = &mut rows[outcome.category];
        row.chains += 1;
        row.events += outcome.events;
        row.w_squared = row.w_squared.max(outcome.w_squared_error);
        match &outcome.verdict {
            Verdict::Judged(findings) => {
                for f in findings {
                    // A vector that vanishes to all digits of an f64 has no relative error.
                    if f.relative.is_finite() && f.condition < 1e16 {
                        row.relative[f.order] = row.relative[f.order].max(f.relative);
                        row.condition[f.order] = row.condition[f.order].max(f.condition);
                    }
                    row.conditioned[f.order] = row.conditioned[f.order].max(f.conditioned);
                }
            }
            Verdict::Undecidable => row.undecidable += 1,
            Verdict::Wrong(_) => {}
        }
    }
    print(&rows);
    println!("{chains} chains in {:.1} s", clock.elapsed().as_secs_f64());
    let failures: Vec<&Outcome> = outcomes.iter().filter(|o| !o.problems().is_empty()).collect();
    for failure in failures.iter().take(10) {
        println!("\ncase {} ({}) fails; to repeat it:", failure.case, CATEGORIES[failure.category].0);
        println!("  ABBE_STRESS_CASE={} cargo test --release --test stress -- --nocapture", failure.case);
        for problem in failure.problems() {
            println!("  {problem}");
        }
    }
    assert!(failures.is_empty(), "{} of {chains} chains exceed a bound", failures.len());
    let undecidable: usize = rows.iter().map(|row| row.undecidable).sum();
    // A test that judges nothing is no test.
    assert!(undecidable * 10 < chains, "{undecidable} of {chains} chains are undecidable");
}

fn print(rows: &[Row]) {
    println!(
        "{:27} {:>6} {:>7} {:>9} | {:>8} {:>8} {:>8} | {:>8} {:>8} {:>8} | {:>8}",
        "", "", "", "", "p', K'", "p', K'", "p', K'", "p'', K''", "p'', K''", "p'', K''", "W², G"
    );
    println!(
        "{:27} {:>6} {:>7} {:>9} | {:>8} {:>8} {:>8} | {:>8} {:>8} {:>8} | {:>8}",
        "worst of each category",
        "chains",
        "events",
        "undecided",
        "relative",
        "cond",
        "rel/cond",
        "relative",
        "cond",
        "rel/cond",
        "relative"
    );
    for (row, (name, _)) in rows.iter().zip(CATEGORIES) {
        println!(
            "{name:27} {:6} {:7} {:9} | {:8.1e} {:8.1e} {:8.1e} | {:8.1e} {:8.1e} {:8.1e} | {:8.1e}",
            row.chains,
            row.events,
            row.undecidable,
            row.relative[1],
            row.condition[1],
            row.conditioned[1].max(row.conditioned[0]),
            row.relative[2],
            row.condition[2],
            row.conditioned[2],
            row.w_squared
        );
    }
    println!(
        "{:27} {:6} {:7} {:9} | {:8} {:8} {:8.1e} | {:8} {:8} {:8.1e} | {:8.1e}",
        "bound", "", "", "", "", "", FIRST_ORDER_BOUND, "", "", SECOND_ORDER_BOUND, W_SQUARED_BOUND
    );
}

/// Everything about one case.
fn repeat(case: u64) {
    let (category, chain) = build(case);
    println!("case {case}: {}\n{chain:#?}", CATEGORIES[category].0);
    let outcome = examine(case);
    match &outcome.verdict {
        Verdict::Judged(findings) => findings.iter().for_each(|f| println!("{}", describe(f))),
        Verdict::Undecidable => println!("too close to total reflection to be decided in f64"),
        Verdict::Wrong(why) => println!("{why}"),
    }
    println!("W², G: relative {:.1e}  bound {W_SQUARED_BOUND:.1e}", outcome.w_squared_error);
    assert!(outcome.problems().is_empty(), "case {case} exceeds a bound");
}
