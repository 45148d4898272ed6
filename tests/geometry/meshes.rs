//! Polygons to triangles: checks, areas, subsets, closedness.

use std::sync::Arc;

use abbe::geometry::{Buffer, Interpolation, Mesh, PrimvarView, Shape};
use proptest::prelude::*;

use crate::shapes::*;

fn problem(change: impl FnOnce(&mut abbe::geometry::PolygonMesh<'_>)) -> String {
    let mut cube = polygons(&cube_points(1.0), &CUBE_COUNTS, &CUBE_INDICES);
    change(&mut cube);
    match Mesh::from_polygons(&cube) {
        Err(error) => error.to_string(),
        Ok((_, report)) => {
            let [problem] = report.problems.as_slice() else { panic!("{:?}", report.problems) };
            format!("/Mesh.{}: {}", problem.attribute, problem.problem)
        }
    }
}

#[test]
fn broken_arrays_are_named_and_broken_primvars_left_out() {
    let normals = |values: Vec<f32>, interpolation| {
        Some(PrimvarView { values: Buffer::from_vec(values), indices: None, interpolation })
    };
    let cases = [
        (problem(|m| m.counts = &[4, 4]), "/Mesh.faceVertexCounts: counts add up to 8"),
        (problem(|m| m.counts = &[4, 4, -4, 4, 4, 4]), "/Mesh.faceVertexCounts: face 2 has -4 corners"),
        (problem(|m| m.points = Buffer::from_vec(vec![[0.0; 3]; 7])), "index 6 is 7, but there are 7 points"),
        (problem(|m| m.points = Buffer::from_vec(vec![[f32::NAN; 3]; 8])), "/Mesh.points: point 0 is not finite"),
        (problem(|m| m.holes = &[6]), "/Mesh.holeIndices: index 0 is 6, but there are 6 faces"),
        (problem(|m| m.subsets = &[("/Mesh/s", &[0, -1])]), "/Mesh/s.indices: index 1 is -1"),
        (problem(|m| m.normals = normals(vec![0.0; 23], Interpolation::Vertex)), "/Mesh.normals: 23 floats"),
        (
            problem(|m| m.normals = normals(vec![0.0; 21], Interpolation::Vertex)),
            "/Mesh.normals: 7 values for one per point",
        ),
        (problem(|m| m.normals = normals(vec![f32::NAN; 24], Interpolation::Vertex)), "value 0 is not finite"),
        (
            problem(|m| {
                m.normals = normals(vec![0.0; 3], Interpolation::Uniform);
                m.normals.as_mut().expect("set").indices = Some(&[0, 0, 0, 0, 0, 1]);
            }),
            "/Mesh.normals:indices: index 5 is 1",
        ),
        (problem(|m| m.uv = normals(vec![0.0; 2], Interpolation::FaceVarying)), "/Mesh.primvars:st: 1 values"),
    ];
    for (text, expected) in cases {
        assert!(text.contains(expected), "{text:?} should contain {expected:?}");
    }
}

proptest! {
    #[test]
    fn triangles_of_a_star_polygon_have_its_area(
        radii in proptest::collection::vec(0.2_f64..1.0, 3..40),
        axis in [-1.0_f64..1.0, -1.0..1.0, -1.0..1.0],
    ) {
        let n = radii.len();
        let normal = glam::DVec3::from(axis).normalize_or(glam::DVec3::Z);
        let (x, y) = normal.any_orthonormal_pair();
        let corners: Vec<glam::DVec3> = radii.iter().enumerate().map(|(k, r)| {
            let phi = std::f64::consts::TAU * k as f64 / n as f64;
            (x * phi.cos() + y * phi.sin()) * *r
        }).collect();
        let area: f64 = (0..n).map(|k| 0.5 * corners[k].cross(corners[(k + 1) % n]).dot(normal)).sum();
        let points: Vec<[f32; 3]> = corners.iter().map(|p| p.to_array().map(|x| x as f32)).collect();
        let indices: Vec<i32> = (0..n as i32).collect();
        // Seen along its normal, a ray meets the polygon once where it is inside, and leaves it.
        let (mesh, report) = mesh(&points, &[n as i32], &indices);
        prop_assert_eq!(report.triangles + report.degenerate, n - 2);
        let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
        let (mut inside, steps) = (0, 40);
        for i in 0..steps {
            for j in 0..steps {
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0;
                let r = ray(x * at(i) + y * at(j) - 2.0 * normal, normal);
                let (net, count) = balance(&scene, &r);
                prop_assert!(net == count as i32 && count <= 1, "{} {}", net, count);
                inside += net;
            }
        }
        // Each boundary cell may be on either side.
        let cell = 4.0 / f64::from(steps * steps);
        let slack = 2.0 * f64::from(steps) * n as f64 * cell;
        prop_assert!((f64::from(inside) * cell - area).abs() < slack.min(0.3), "{} {}", inside, area);
    }
}

#[test]
fn concave_quads_are_cut_at_the_reflex_corner() {
    // An arrowhead in each rotation of its corners.
    let points = [[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0], [-1.0, -1.0, 0.0]];
    for turn in 0..4 {
        let indices: Vec<i32> = (0..4).map(|k| (k + turn) % 4).collect();
        let (mesh, report) = mesh(&points, &[4], &indices);
        assert_eq!(report.triangles, 2);
        let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
        let count = |x: f64, y: f64| balance(&scene, &ray([x, y, -1.0], [0.0, 0.0, 1.0]));
        assert_eq!(count(0.0, -0.5), (0, 0), "in the notch, turn {turn}");
        assert_eq!(count(0.1, 0.5), (1, 1), "in the head, turn {turn}");
        assert_eq!(count(0.7, -0.6), (1, 1), "in a wing, turn {turn}");
    }
}

#[test]
fn orientation_turns_the_outside() {
    let mut cube = polygons(&cube_points(1.0), &CUBE_COUNTS, &CUBE_INDICES);
    for left_handed in [false, true] {
        cube.left_handed = left_handed;
        let (mesh, _) = Mesh::from_polygons(&cube).expect("a cube");
        let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
        let r = ray([0.3, 0.4, -1.0], [0.0, 0.0, 1.0]);
        let hit = first(&scene, &r).expect("a hit");
        assert_eq!(hit.leaving, left_handed);
        let (_, surface) = scene.local_surface(&r, &hit);
        assert_eq!(surface.n_g.dot(r.direction) > 0.0, left_handed);
    }
}

#[test]
fn subsets_become_slots_and_the_first_wins() {
    let mut cube = polygons(&cube_points(1.0), &CUBE_COUNTS, &CUBE_INDICES);
    let subsets: [(&str, &[i32]); 2] = [("/Mesh/a", &[0, 0]), ("/Mesh/b", &[0, 1])];
    cube.subsets = &subsets;
    let (mesh, report) = Mesh::from_polygons(&cube).expect("a cube");
    assert_eq!(report.faces_in_several_subsets, 1);
    let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
    let slot = |r| scene.slot(&first(&scene, &r).expect("a hit"));
    assert_eq!(slot(ray([0.3, 0.4, -1.0], [0.0, 0.0, 1.0])), 1);
    assert_eq!(slot(ray([0.3, 0.4, 2.0], [0.0, 0.0, -1.0])), 2);
    assert_eq!(slot(ray([-1.0, 0.4, 0.3], [1.0, 0.0, 0.0])), 0);
}

#[test]
fn closedness_sees_through_split_vertices() {
    let points = cube_points(1.0);
    let split: Vec<[f32; 3]> =
        CUBE_INDICES.iter().map(|&i| points[i as usize].map(|x| if x == 0.0 { -0.0 } else { x })).collect();
    let own: Vec<i32> = (0..24).collect();
    let (_, report) = mesh(&split, &CUBE_COUNTS, &own);
    assert!(report.is_closed && report.open_edges == 0);
    let (_, report) = mesh(&points, &CUBE_COUNTS[1..], &CUBE_INDICES[4..]);
    assert_eq!((report.is_closed, report.open_edges), (false, 4));
    let mut turned = CUBE_INDICES;
    turned[..4].reverse();
    let (_, report) = mesh(&points, &CUBE_COUNTS, &turned);
    assert_eq!((report.is_closed, report.open_edges, report.misoriented_edges), (false, 0, 4));
    let mut holed = polygons(&points, &CUBE_COUNTS, &CUBE_INDICES);
    holed.holes = &[2];
    let (holed, report) = Mesh::from_polygons(&holed).expect("a cube with a hole");
    assert_eq!((report.triangles, report.is_closed, holed.len()), (10, false, 10));
    let (_, report) = mesh(&points, &[2, 1, 0, 3], &[0, 1, 2, 0, 2, 3]);
    assert_eq!((report.short_faces, report.triangles), (3, 1));
}

#[test]
fn texture_coordinates_follow_every_interpolation() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let corners = vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
    type Case = (Interpolation, Vec<f32>, Option<&'static [i32]>, [f64; 2]);
    let cases: [Case; 5] = [
        (Interpolation::Vertex, corners.clone(), None, [0.25, 0.75]),
        (Interpolation::Varying, corners.clone(), Some(&[3, 2, 1, 0]), [0.25, 0.25]),
        (Interpolation::FaceVarying, corners, None, [0.25, 0.75]),
        (Interpolation::Uniform, vec![0.5, 2.0], None, [0.5, 2.0]),
        (Interpolation::Constant, vec![3.0, 4.0], None, [3.0, 4.0]),
    ];
    for (interpolation, values, indices, expected) in cases {
        let mut quad = polygons(&points, &[4], &[0, 1, 2, 3]);
        quad.uv = Some(PrimvarView { values: Buffer::from_vec(values), indices, interpolation });
        let (mesh, _) = Mesh::from_polygons(&quad).expect("a quad");
        let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
        let r = ray([0.25, 0.75, 1.0], [0.0, 0.0, -1.0]);
        let hit = first(&scene, &r).expect("a hit");
        let (point, _) = scene.local_surface(&r, &hit);
        assert_eq!(scene.uv(&hit, point), Some(expected), "{interpolation:?}");
    }
}

#[test]
fn a_million_triangles_build() {
    let rings = 500;
    let mesh = ball(rings, 0.02, 1.0, [0.0; 3]);
    assert_eq!(mesh.len(), 4 * rings * (rings - 1));
    let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]);
    for k in 0..1000 {
        let t = f64::from(k);
        let r = ray([0.0; 3], [t.sin(), (1.3 * t).cos(), (0.7 * t).sin()]);
        assert_eq!(balance(&scene, &r), (1, 1));
    }
}
