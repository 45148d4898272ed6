//! Glass cylinders, cones, capsules, cubes: every column against differences of the whole re-trace, through the scene, its
//! trees and its transforms.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use abbe::integrator::chain::{Counters, End, Follower, Record};
use abbe::ray::{ColumnSet, NoColumns, RayStart, SecondOrderColumns};
use abbe::scene::Scene;
use abbe::scene::description::{Lens, LensFace, Shape};
use abbe::scene::view::{Media, View};
use abbe::spectrum::Wavelength;
use glam::{DMat4, DVec3};
use support::Stagehand;

const NANOMETERS: f64 = 550.0;

/// A solid of dense flint before a wall, seen along −z.
fn scene(shape: Shape, transform: DMat4) -> Scene {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::SF11);
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 400.0, Some(grey));
    s.solid(shape, transform, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    s.build()
}

fn lens(front: (f64, f64, &[f64]), back: (f64, f64, &[f64])) -> Shape {
    let face = |(curvature, conic, aspheres): (f64, f64, &[f64])| LensFace {
        curvature,
        conic,
        aspheres: aspheres.to_vec(),
        semi_diameter: 1.0,
    };
    Shape::Lens(Lens {
        path: "/World/Solid".into(),
        front: face(front),
        back: face(back),
        thickness: 0.7,
        edge_radius: Some(1.1),
    })
}

fn solids() -> Vec<(&'static str, Shape)> {
    let path = || "/World/Solid".to_owned();
    let axis = || "Y".to_owned();
    vec![
        ("cylinder", Shape::Cylinder { path: path(), height: 2.0, radius_bottom: 0.9, radius_top: 0.9, axis: axis() }),
        ("frustum", Shape::Cylinder { path: path(), height: 2.0, radius_bottom: 0.5, radius_top: 1.1, axis: axis() }),
        ("cone", Shape::Cone { path: path(), height: 2.5, radius: 1.2, axis: axis() }),
        ("capsule", Shape::Capsule { path: path(), height: 0.4, radius_bottom: 0.9, radius_top: 0.9, axis: axis() }),
        (
            "tapered capsule",
            Shape::Capsule { path: path(), height: 0.6, radius_bottom: 1.0, radius_top: 0.7, axis: axis() },
        ),
        ("biconvex lens", lens((0.4, 0.0, &[]), (-0.3, 0.0, &[]))),
        ("conic meniscus", lens((-0.4, -1.7, &[]), (-0.6, 0.3, &[]))),
        ("aspheric lens", lens((0.5, -0.6, &[0.05, -0.02]), (0.2, 0.0, &[-0.04, 0.01, 0.002]))),
        ("cube", Shape::Cube { path: path(), size: 1.6 }),
    ]
}

fn transforms() -> [(&'static str, DMat4); 3] {
    let turned = DMat4::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.6);
    let mut sheared = turned * DMat4::from_scale(DVec3::new(1.3, 0.8, 1.1));
    sheared.x_axis += 0.3 * sheared.y_axis;
    [
        ("turned", turned),
        ("sheared", sheared),
        ("small", DMat4::from_translation(DVec3::new(0.1, 0.0, 4.5)) * DMat4::from_scale(DVec3::splat(0.1)) * turned),
    ]
}

/// A pinhole at (0, 0, 6) with a focal length of 100 pixels.
fn start(x: f64, y: f64) -> RayStart {
    let (look, right, up) = (DVec3::new(x, y, -100.0), DVec3::X, DVec3::Y);
    let length = look.length();
    let d = look / length;
    let first = |a: DVec3| (a - d * d.dot(a)) / length;
    let (d_x, d_y) = (first(right), first(up));
    let second =
        |a: DVec3, b: DVec3, d_a: DVec3, d_b: DVec3| -(d_b * d.dot(a) + d_a * d.dot(b) + d * d_b.dot(a)) / length;
    RayStart {
        point: DVec3::ZERO,
        direction: d,
        point_x: DVec3::ZERO,
        point_y: DVec3::ZERO,
        direction_x: d_x,
        direction_y: d_y,
        direction_xx: second(right, right, d_x, d_x),
        direction_xy: second(right, up, d_x, d_y),
        direction_yy: second(up, up, d_y, d_y),
        time: 0.0,
    }
}

/// Where the chain ends on the wall, its events, and the columns there.
fn trace<C: ColumnSet>(
    scene: &Scene,
    view: &View<'_>,
    x: f64,
    y: f64,
    nanometers: f64,
) -> Option<(DVec3, Vec<u32>, C)> {
    let media = Media::at(scene, Wavelength::from_nanometers(nanometers), 1.0).expect("indices");
    let mut counters = Counters::default();
    let mut log = Vec::new();
    let chain = Follower::new(view).follow::<C>(&start(x, y), &media, Record::of_steps(&mut log), &mut counters);
    let End::Surface(end) = chain.end else { return None };
    assert_eq!(counters.unmatched_exits, 0);
    let kinds = log.iter().filter_map(|step| step.scattering.as_ref().map(|s| s.kind as u32)).collect();
    Some((end.point, kinds, chain.columns))
}

/// Sixth-order central differences: first and second derivative.
fn differences(h: f64, f: impl Fn(f64) -> Option<DVec3>) -> Option<[DVec3; 2]> {
    let [a, b, c] = [1.0, 2.0, 3.0].map(|k| Some((f(k * h)?, f(-k * h)?)));
    let (a, b, c, centre) = (a?, b?, c?, f(0.0)?);
    let first = (45.0 * (a.0 - a.1) - 9.0 * (b.0 - b.1) + (c.0 - c.1)) / (60.0 * h);
    let second = (270.0 * (a.0 + a.1) - 27.0 * (b.0 + b.1) + 2.0 * (c.0 + c.1) - 490.0 * centre) / (180.0 * h * h);
    Some([first, second])
}

#[test]
fn columns_through_solids_are_derivatives_of_the_retrace() {
    for (name, shape) in solids() {
        for (how, transform) in transforms() {
            let scene = scene(shape.clone(), transform);
            let view = View::new(&scene, DVec3::new(0.0, 0.0, 6.0));
            let mut compared = 0;
            for i in -9..=9 {
                for j in -9..=9 {
                    let (x, y) = (1.63 * f64::from(i) + 0.31, 1.47 * f64::from(j) - 0.17);
                    let at =
                        |dx: f64, dy: f64, dl: f64| trace::<NoColumns>(&scene, &view, x + dx, y + dy, NANOMETERS + dl);
                    let Some((end, kinds, columns)) = trace::<SecondOrderColumns>(&scene, &view, x, y, NANOMETERS)
                    else {
                        continue;
                    };
                    if kinds.is_empty() {
                        continue;
                    }
                    let same = |t: Option<(DVec3, Vec<u32>, NoColumns)>| t.filter(|t| t.1 == kinds).map(|t| t.0);
                    // Two steps tell how far the differences themselves can be trusted.
                    let by =
                        |f: &dyn Fn(f64) -> Option<DVec3>, h: f64| Some([differences(h, f)?, differences(0.5 * h, f)?]);
                    let Some(by_x) = by(&|h| same(at(h, 0.0, 0.0)), 2e-3) else { continue };
                    let Some(by_y) = by(&|h| same(at(0.0, h, 0.0)), 2e-3) else { continue };
                    let Some(by_l) = by(&|h| same(at(0.0, 0.0, h)), 4.0) else { continue };
                    let [col_x, col_y] = columns.screen().expect("carried");
                    let (col_l, col_ll) = (columns.lambda().expect("carried"), columns.lambda2().expect("carried"));
                    let pairs = [
                        ("p_x", col_x.point, by_x.map(|d| d[0]), 1e-9, 1e-3),
                        ("p_y", col_y.point, by_y.map(|d| d[0]), 1e-9, 1e-3),
                        ("p_λ", col_l.point, by_l.map(|d| d[0]), 1e-9, 2.0),
                        ("p_λλ", col_ll.point, by_l.map(|d| d[1]), 1e-5, 4.0),
                    ];
                    for (quantity, ours, [coarse, fine], tolerance, step) in pairs {
                        let doubt = (coarse - fine).length();
                        let scale = fine.length();
                        // A hundred roundings of the coordinates, divided by the step.
                        let noise = 100.0 * f64::EPSILON * (end.length() + 6.0) / step;
                        if doubt > tolerance * scale {
                            continue;
                        }
                        compared += 1;
                        let error = (ours - fine).length();
                        assert!(
                            error < 3.0 * tolerance * scale + noise,
                            "{name}, {how}, pixel {x} {y}, {quantity}: {ours} against {fine}, off by {:e} (doubt {:e})",
                            error / scale,
                            doubt / scale
                        );
                    }
                }
            }
            assert!(compared > 40, "{name}, {how}: only {compared} derivatives could be compared");
        }
    }
}

/// A cube is a cube, however it is made.
#[test]
fn a_cube_traces_like_its_mesh() {
    let transform = transforms()[1].1;
    let analytic = scene(Shape::Cube { path: "/World/Solid".into(), size: 1.5 }, transform);
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::SF11);
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 400.0, Some(grey));
    let points: Vec<[f32; 3]> =
        (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 1.5 * bit as f32 - 0.75)).collect();
    let faces: [&[i32]; 6] = [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
    s.mesh("/World/Solid", &points, &faces, transform, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let mesh = s.build();
    let origin = DVec3::new(0.0, 0.0, 6.0);
    let (a, b) = (View::new(&analytic, origin), View::new(&mesh, origin));
    let mut through = 0;
    for i in -20..=20 {
        for j in -20..=20 {
            let (x, y) = (f64::from(i) + 0.137, f64::from(j) - 0.291);
            let one = trace::<SecondOrderColumns>(&analytic, &a, x, y, NANOMETERS);
            let other = trace::<SecondOrderColumns>(&mesh, &b, x, y, NANOMETERS);
            assert_eq!(one.is_some(), other.is_some());
            let (Some(one), Some(other)) = (one, other) else { continue };
            assert_eq!(one.1, other.1);
            let near = |p: DVec3, q: DVec3| (p - q).length() <= 1e-11 * (1.0 + p.length());
            assert!(near(one.0, other.0), "{} {}", one.0, other.0);
            let lambda = |c: &SecondOrderColumns| c.lambda().expect("carried").point;
            assert!(near(lambda(&one.2), lambda(&other.2)));
            through += usize::from(!one.1.is_empty());
        }
    }
    assert!(through > 100);
}
