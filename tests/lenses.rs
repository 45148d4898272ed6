//! Lens systems traced through the scene, against a sequential trace with 102 digits that knows nothing of it.
//!
//! The oracle follows a ray from surface to surface in the order of the prescription, with Newton's method for the
//! intersections and Snell's law, and differentiates by central differences with a step of 2⁻¹⁰⁰ nm.

mod oracle;
mod support;

use abbe::integrator::chain::{Counters, End, Follower, Record};
use abbe::ray::{ColumnSet, LambdaColumn, RayStart, direction_derivative};
use abbe::scene::Scene;
use abbe::scene::description::{Lens, LensFace, Shape};
use abbe::scene::view::{Media, View};
use abbe::spectrum::Wavelength;
use glam::{DMat4, DVec3};
use oracle::chain::Law;
use oracle::real::{Real, Vector};
use serde_json::json;
use support::{Stagehand, authored};

/// A surface of a prescription, and what follows it.
struct Surface {
    radius: f64,
    conic: f64,
    aspheres: &'static [f64],
    semi_diameter: f64,
    thickness: f64,
    glass: Option<Law>,
}

fn surface(radius: f64, thickness: f64, semi_diameter: f64, glass: Option<Law>) -> Surface {
    Surface { radius, conic: 0.0, aspheres: &[], semi_diameter, thickness, glass }
}

fn curvature(radius: f64) -> f64 {
    if radius.is_finite() { 1.0 / radius } else { 0.0 }
}

fn abbe_number(nd: f64, vd: f64) -> Option<Law> {
    Some(Law::AbbeNumber { nd, vd })
}

/// A Cooke triplet of SCHOTT N-SK16 and F2, f = 50 mm, f/5 (Laikin, *Lens Design*; the radii of common optics programs).
fn cooke() -> Vec<Surface> {
    let sk16 = || {
        Some(Law::Sellmeier {
            b: vec![1.34317774, 0.241144399, 0.994317969],
            c: vec![0.00704687339, 0.0229005, 92.7508526],
        })
    };
    let f2 = || {
        Some(Law::Sellmeier {
            b: vec![1.34533359, 0.209073176, 0.937357162],
            c: vec![0.00997743871, 0.0470450767, 111.886764],
        })
    };
    vec![
        surface(22.01359, 3.25896, 9.5, sk16()),
        surface(-435.76044, 6.00755, 9.5, None),
        surface(-22.21328, 0.99997, 5.0, f2()),
        surface(20.29192, 4.75041, 5.0, None),
        surface(79.68360, 2.95208, 7.5, sk16()),
        surface(-18.39533, 42.20778, 7.5, None),
    ]
}

/// A double Gauss with two cemented doublets (f = 100 mm, f/3; the sample of common optics programs).
fn double_gauss() -> Vec<Surface> {
    vec![
        surface(56.20238, 8.75, 28.0, abbe_number(1.622_292, 53.16)),
        surface(152.28580, 0.5, 28.0, None),
        surface(37.68262, 12.5, 22.0, abbe_number(1.607_381, 56.65)),
        surface(f64::INFINITY, 3.8, 22.0, abbe_number(1.603_417, 38.03)),
        surface(24.23130, 30.117_402, 14.5, None),
        surface(-28.37731, 3.8, 14.5, abbe_number(1.603_417, 38.03)),
        surface(f64::INFINITY, 11.0, 20.0, abbe_number(1.620_408, 60.32)),
        surface(-37.92546, 0.5, 20.0, None),
        surface(177.41176, 7.0, 23.0, abbe_number(1.620_408, 60.32)),
        surface(-79.41143, 61.487_536, 23.0, None),
    ]
}

/// A cemented doublet with a conic and aspheres, whose cement is curved.
fn aspheric_doublet() -> Vec<Surface> {
    vec![
        Surface { conic: -0.8, aspheres: &[1e-6, -2e-9], ..surface(60.0, 6.0, 12.0, Some(Law::bk7())) },
        surface(-45.0, 3.0, 12.0, Some(Law::sf66())),
        Surface { conic: 1.5, aspheres: &[-3e-7, 0.0, 4e-12], ..surface(-130.0, 90.0, 12.0, None) },
    ]
}

/// Where the image plane is: a number that f32 holds, behind everything.
fn image(system: &[Surface]) -> f64 {
    system.iter().map(|s| s.thickness).sum::<f64>().round()
}

fn scene(system: &[Surface]) -> Scene {
    let mut s = Stagehand::new();
    let grey = s.diffuse("/World/Grey");
    let mut z = 0.0;
    for (i, pair) in system.windows(2).enumerate() {
        if let Some(law) = &pair[0].glass {
            let path = format!("/World/Element{i}");
            let material = match law {
                Law::Sellmeier { b, c } => {
                    let glass = s.glass(&path, ([b[0], b[1], b[2]], [c[0], c[1], c[2]]));
                    let key = |name: &str| format!("abbe:dispersion:sellmeier:{name}");
                    s.document.materials[glass].abbe.insert(key("b"), authored("double[]", json!(b)));
                    s.document.materials[glass].abbe.insert(key("c"), authored("double[]", json!(c)));
                    glass
                }
                Law::AbbeNumber { nd, vd } => {
                    let glass = s.constant_glass(&path, *nd);
                    s.document.materials[glass].abbe.insert("abbe:dispersion:nd".into(), authored("double", json!(nd)));
                    s.document.materials[glass].abbe.insert("abbe:dispersion:vd".into(), authored("double", json!(vd)));
                    glass
                }
                other => panic!("{other:?} is not used here"),
            };
            let face = |s: &Surface| LensFace {
                curvature: curvature(s.radius),
                conic: s.conic,
                aspheres: s.aspheres.to_vec(),
                semi_diameter: s.semi_diameter,
            };
            let lens = Lens {
                path: path.clone(),
                front: face(&pair[0]),
                back: face(&pair[1]),
                thickness: pair[0].thickness,
                edge_radius: None,
            };
            s.solid(Shape::Lens(lens), DMat4::from_translation(DVec3::new(0.0, 0.0, z)), Some(material));
        }
        z += pair[0].thickness;
    }
    s.wall(image(system) as f32, 4096.0, Some(grey));
    s.camera(DVec3::new(0.0, 0.0, -100.0), DVec3::ZERO);
    s.build()
}

/// ζ and dζ/dρ of a surface.
fn sag(s: &Surface, square: &Real) -> (Real, Real) {
    let c = if s.radius.is_finite() { Real::new(curvature(s.radius)) } else { Real::zero() };
    let kappa = Real::new(1.0 + s.conic);
    let root = (Real::one() - &(&kappa * &(&c * &c)) * square).sqrt();
    let mut value = &(&c * square) / &(Real::one() + root.clone());
    let mut slope = &c / &(Real::new(2.0) * root);
    let mut power = square.clone();
    for (n, &a) in (2..).zip(s.aspheres) {
        slope = slope + &(Real::new(f64::from(n) * a) * power.clone()) * &Real::one();
        power = &power * square;
        value = value + Real::new(a) * power.clone();
    }
    (value, slope)
}

/// The oracle: point on the image plane and direction there, at a wavelength, and whether the ray stays within all
/// semi-diameters.
fn sequential(system: &[Surface], origin: &Vector, direction: &Vector, nanometers: &Real) -> (Vector, Vector, bool) {
    let (mut p, mut d) = (origin.clone(), direction.unit());
    let mut vertex = Real::zero();
    let mut ior = Real::one();
    let mut fits = true;
    for s in system {
        // Newton's method from the vertex plane.
        let mut t = &(&vertex - &p.0[2]) / &d.0[2];
        for _ in 0..12 {
            let q = add(&p, &d, &t);
            let square = &(&q.0[0] * &q.0[0]) + &(&q.0[1] * &q.0[1]);
            let (value, slope) = sag(s, &square);
            let f = &(&q.0[2] - &vertex) - &value;
            let across = &(&q.0[0] * &d.0[0]) + &(&q.0[1] * &d.0[1]);
            let rate = &d.0[2] - &(Real::new(2.0) * slope * across);
            t = &t - &(&f / &rate);
        }
        p = add(&p, &d, &t);
        let square = &(&p.0[0] * &p.0[0]) + &(&p.0[1] * &p.0[1]);
        fits &= square.to_f64().sqrt() < s.semi_diameter;
        let (_, slope) = sag(s, &square);
        let two = Real::new(-2.0) * slope;
        let normal = Vector([&two * &p.0[0], &two * &p.0[1], Real::one()]).unit();
        let beyond = s.glass.as_ref().map_or(Real::one(), |law| oracle::trace::ior(law, nanometers));
        // n' d' = n d + (√(n'² − n² + g²) − g) N with g = n d·N > 0.
        let g = &ior * &d.dot(&normal);
        let w = (&(&(&beyond * &beyond) - &(&ior * &ior)) + &(&g * &g)).sqrt();
        let momentum = add(&d.scale(&ior), &normal, &(&w - &g));
        d = momentum.unit();
        ior = beyond;
        vertex = vertex + Real::new(s.thickness);
    }
    let t = &(&Real::new(image(system)) - &p.0[2]) / &d.0[2];
    (add(&p, &d, &t), d, fits)
}

fn add(p: &Vector, d: &Vector, t: &Real) -> Vector {
    Vector([0, 1, 2].map(|i| &p.0[i] + &(&d.0[i] * t)))
}

fn quotient(a: &Vector, b: &Vector, step: isize) -> [f64; 3] {
    let scale = Real::power_of_two(-step - 1);
    [0, 1, 2].map(|i| ((&a.0[i] - &b.0[i]) * scale.clone()).to_f64())
}

/// Largest relative errors of (p, p_λ, d_λ), and how many rays were compared.
fn compare(system: &[Surface], aim: f64) -> ([f64; 3], usize) {
    let scene = scene(system);
    let mut worst = [0.0_f64; 3];
    let mut compared = 0;
    for origin in [DVec3::new(0.0, 0.0, -100.0), DVec3::new(3.0, -14.0, -150.0)] {
        let view = View::new(&scene, origin);
        for i in 0..24 {
            let (turn, reach) = (2.4 * f64::from(i), aim * f64::from(i + 1) / 24.0);
            let target = DVec3::new(reach * turn.cos(), reach * turn.sin(), 0.0);
            let direction = (target - origin).normalize();
            for nanometers in [486.1327, 587.5618] {
                let zero = DVec3::ZERO;
                let start = RayStart {
                    point: zero,
                    direction,
                    point_x: zero,
                    point_y: zero,
                    direction_x: zero,
                    direction_y: zero,
                    direction_xx: zero,
                    direction_xy: zero,
                    direction_yy: zero,
                    time: 0.0,
                };
                let (o, d) = (Vector::new(origin.to_array()), Vector::new(direction.to_array()));
                let (exact, _, fits) = sequential(system, &o, &d, &Real::new(nanometers));
                // What meets an edge is another path than the prescription's.
                if !fits {
                    continue;
                }
                let media = Media::at(&scene, Wavelength::from_nanometers(nanometers), 1.0).expect("indices");
                let mut counters = Counters::default();
                let chain = Follower::new(&view).follow::<LambdaColumn>(&start, &media, Record::none(), &mut counters);
                let End::Surface(end) = chain.end else { panic!("the wall is behind everything") };
                assert_eq!(counters.unmatched_exits, 0);
                assert_eq!(chain.interfaces as usize, system.len());
                let exact = DVec3::from(exact.to_f64());
                let error = (end.point + origin - exact).length() / exact.length();
                let at = |sign: f64| {
                    let step = Real::new(sign) * Real::power_of_two(-100);
                    sequential(system, &o, &d, &(Real::new(nanometers) + step))
                };
                let (after, before) = (at(1.0), at(-1.0));
                let p_lambda = DVec3::from(quotient(&after.0, &before.0, -100));
                let d_lambda = DVec3::from(quotient(&after.1, &before.1, -100));
                let column = chain.columns.lambda().expect("carried");
                let ours = direction_derivative(column.momentum, chain.direction, chain.medium.ior, 0.0);
                let errors = [
                    error,
                    (column.point - p_lambda).length() / p_lambda.length(),
                    (ours - d_lambda).length() / d_lambda.length(),
                ];
                for (worst, error) in worst.iter_mut().zip(errors) {
                    *worst = worst.max(error);
                }
                compared += 1;
            }
        }
    }
    (worst, compared)
}

#[test]
fn lens_systems_agree_with_the_sequential_trace() {
    let systems = [
        ("Cooke triplet", cooke(), 7.0),
        ("double Gauss", double_gauss(), 18.0),
        ("aspheres", aspheric_doublet(), 10.0),
    ];
    for (name, system, aim) in systems {
        let (worst, compared) = compare(&system, aim);
        assert!(compared >= 40, "{name}: only {compared} rays went the prescription's way");
        assert!(worst[0] < 1e-13 && worst[1] < 1e-9 && worst[2] < 1e-9, "{name}: {worst:?}");
    }
}
