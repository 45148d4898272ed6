//! What a ray hits: the same with and without trees, at every scale, and never through a closed mesh.

use std::sync::Arc;

use abbe::geometry::{Instance, Mesh, PolygonMesh, Shape};
use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;

use crate::shapes::*;

fn vector(range: f64) -> impl Strategy<Value = DVec3> {
    [-range..range, -range..range, -range..range].prop_map(DVec3::from)
}

/// Directions, with every share of axes and diagonals.
fn direction() -> impl Strategy<Value = DVec3> {
    let integers = [-2..=2_i32, -2..=2, -2..=2].prop_map(|d| DVec3::from(d.map(f64::from)));
    prop_oneof![3 => vector(1.0), 1 => integers].prop_filter_map("no direction", |d| d.try_normalize())
}

/// Rotations, scales (mirrored and uneven), shears, and offsets.
fn transform() -> impl Strategy<Value = DAffine3> {
    let linear = (vector(1.0), vector(1.0), vector(1.0))
        .prop_map(|(x, y, z)| DMat3::from_cols(x, y, z))
        .prop_filter("nearly singular", |m| m.determinant().abs() > 1e-2);
    let exact = prop_oneof![Just(DMat3::IDENTITY), Just(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)))];
    (prop_oneof![2 => linear, 1 => exact], vector(3.0))
        .prop_map(|(matrix3, translation)| DAffine3 { matrix3, translation })
}

/// A few triangles anywhere, sharing points.
fn soup() -> impl Strategy<Value = (Vec<[f32; 3]>, Vec<i32>)> {
    proptest::collection::vec([-1.0_f32..1.0, -1.0..1.0, -1.0..1.0], 3..30).prop_flat_map(|points| {
        let n = points.len() as i32;
        (Just(points), proptest::collection::vec([0..n, 0..n, 0..n], 1..60).prop_map(|t| t.concat()))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_tree_finds_what_asking_every_primitive_finds(
        (points, indices) in soup(),
        transforms in proptest::collection::vec(transform(), 1..5),
        scale in -6..=6_i32,
        offset in prop_oneof![Just(0.0_f32), Just(10.0), Just(1e4)],
        rays in proptest::collection::vec((vector(4.0), direction(), 0..3_usize), 40),
    ) {
        let size = 10.0_f32.powi(scale);
        let points: Vec<[f32; 3]> = points.into_iter().map(|p| p.map(|x| (x + offset) * size)).collect();
        let counts = vec![3; indices.len() / 3];
        let shape = Arc::new(Shape::Mesh(mesh(&points, &counts, &indices).0));
        let ball = sphere(f64::from(size));
        let size = f64::from(size);
        let instances: Vec<Instance> = transforms.iter().enumerate().map(|(i, t)| {
            let shape = if i == 2 { &ball } else { &shape };
            placed(shape, DAffine3 { matrix3: t.matrix3, translation: t.translation * size })
        }).collect();
        let scene = aggregate(&instances);
        for (origin, direction, how) in rays {
            let origin = origin * size;
            let ray = match how {
                0 => ray(origin, direction),
                // Towards a point of the mesh, and far away from it.
                _ => {
                    let p = DVec3::from(points[indices[how] as usize].map(f64::from));
                    let target = instances[0].world_from_object.frame().transform_point3(p);
                    let direction = if how == 1 { (target - origin).normalize_or(direction) } else { direction };
                    ray(target - direction * size * 1e3, direction)
                }
            };
            prop_assert_eq!(first(&scene, &ray), scene.intersect_without_tree(&ray));
        }
    }

    #[test]
    fn no_ray_leaks_through_a_closed_mesh(
        t in transform(), scale in -6..=6_i32, start in vector(0.3), d in direction(), vertex in 0..200_usize,
    ) {
        let size = 10.0_f64.powi(scale);
        let mesh = ball(10, 0.05, size as f32, [0.0; 3]);
        let shape = Arc::new(Shape::Mesh(mesh));
        let place = DAffine3 { matrix3: t.matrix3, translation: t.translation * size };
        let scene = aggregate(&[placed(&shape, place)]);
        // From inside, in any direction and towards a vertex or the middle of an edge.
        let inside = place.transform_point3(start * size);
        let (i, j) = (1 + vertex / 20 % 9, vertex % 20);
        let point = |i: usize, j: usize| {
            let (theta, phi) = (i as f64 / 10.0 * std::f64::consts::PI, j as f64 / 20.0 * std::f64::consts::TAU);
            let r = 1.0 + 0.05 * (5.0 * theta).sin() * (7.0 * phi).cos();
            let p = [theta.sin() * phi.cos() * r, theta.sin() * phi.sin() * r, -theta.cos() * r];
            place.transform_point3(DVec3::from(p.map(|x| f64::from(x as f32 * size as f32))))
        };
        let edge = 0.5 * (point(i, j) + point(i, j + 1));
        for target in [inside + d * size, point(i, j), edge] {
            let ray = ray(inside, target - inside);
            let hit = first(&scene, &ray);
            prop_assert!(hit.is_some_and(|h| h.leaving), "{:?}", hit);
            prop_assert_eq!(balance(&scene, &ray).0, 1);
            let outside = abbe::geometry::Ray { origin: ray.origin - ray.direction * 100.0 * size, ..ray };
            let (net, count) = balance(&scene, &outside);
            prop_assert!(net == 0 && count >= 2, "{net} of {count}");
            let hits = straight_through(&scene, outside);
            prop_assert_eq!(hits.len(), count as usize);
            for (k, hit) in hits.iter().enumerate() {
                prop_assert_eq!(hit.leaving, k % 2 == 1);
            }
        }
    }

    #[test]
    fn scaling_by_a_power_of_two_changes_no_bit(
        (points, indices) in soup(), t in transform(), power in prop_oneof![-80..80_i32],
        origin in vector(3.0), d in direction(),
    ) {
        let counts = vec![3; indices.len() / 3];
        let scene_of = |shape_scale: f64, place_scale: f64| {
            let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| (f64::from(x) * shape_scale) as f32)).collect();
            let shape = Arc::new(Shape::Mesh(mesh(&points, &counts, &indices).0));
            let ball = sphere(0.5 * shape_scale);
            let place = |m: DMat3, t: DVec3| DAffine3 { matrix3: m * place_scale, translation: t * shape_scale * place_scale };
            aggregate(&[placed(&shape, place(t.matrix3, t.translation)), placed(&ball, place(t.matrix3, DVec3::X))])
        };
        let s = 2.0_f64.powi(power);
        let reference = scene_of(1.0, 1.0);
        let small = ray(origin, d);
        let large = abbe::geometry::Ray { origin: small.origin * s, ..small };
        for scene in [scene_of(s, 1.0), scene_of(1.0, s)] {
            let (a, b) = (first(&reference, &small), first(&scene, &large));
            prop_assert_eq!(a.map(|h| abbe::geometry::Hit { distance: h.distance * s, ..h }), b);
            if let (Some(a), Some(b)) = (a, b) {
                let ((p, here), (q, there)) = (reference.local_surface(&small, &a), scene.local_surface(&large, &b));
                prop_assert_eq!(p * s, q);
                prop_assert_eq!(here.n_g, there.n_g);
            }
        }
    }
}

#[test]
fn pixel_rays_enter_and_leave_a_cube_once() {
    let shape = cube(1.0);
    for (place, exact) in [
        (DAffine3::IDENTITY, true),
        (DAffine3::from_scale(DVec3::new(-1.0, 2.0, 1.0)), true),
        (DAffine3::from_axis_angle(DVec3::ONE.normalize(), 0.7), false),
    ] {
        let scene = aggregate(&[placed(&shape, place)]);
        let mut entered = 0;
        for i in -2..=18 {
            for j in -2..=18 {
                // Through edges, vertices and diagonals of the faces, along the axes.
                let (u, v) = (f64::from(i) / 16.0, f64::from(j) / 16.0);
                for (from, to) in [
                    (DVec3::new(u, v, -2.0), DVec3::Z),
                    (DVec3::new(u, 3.0, v), -DVec3::Y),
                    (DVec3::new(-2.0, u, v), DVec3::X),
                    (DVec3::new(u - 2.0, v - 2.0, -2.0), DVec3::ONE),
                ] {
                    let ray = ray(place.transform_point3(from), place.transform_vector3(to));
                    let (net, count) = balance(&scene, &ray);
                    assert_eq!(net, 0, "{ray:?}");
                    let inside = i > 0 && i < 16 && j > 0 && j < 16;
                    if !inside && !exact {
                        // A ray in the plane of a face, to rounding: on which side it goes on is anybody's guess.
                        continue;
                    }
                    let hits = straight_through(&scene, ray);
                    assert_eq!(hits.len(), count as usize, "{ray:?} {hits:?}");
                    assert!(hits.len() == 2 || hits.is_empty(), "{ray:?} {hits:?}");
                    if inside {
                        assert_eq!(hits.len(), 2, "{ray:?}");
                        assert!(!hits[0].leaving && hits[1].leaving, "{ray:?} {hits:?}");
                    }
                    entered += hits.len() / 2;
                }
            }
        }
        assert!(entered > 600);
    }
}

#[test]
fn equal_distances_are_decided_by_instance_and_primitive() {
    let shape = square(0.0);
    let scene = aggregate(&vec![at_origin(&shape); 9]);
    let hit = first(&scene, &ray([0.25, -0.5, 2.0], [0.0, 0.0, -1.0])).expect("a hit");
    assert_eq!((hit.instance, hit.distance, hit.leaving), (0, 2.0, false));
    // The same triangle twice in one mesh.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let (double, _) = mesh(&points, &[3, 3, 3], &[0, 1, 2, 0, 1, 2, 0, 1, 2]);
    let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(double)))]);
    assert_eq!(first(&scene, &ray([0.25, 0.25, 2.0], [0.0, 0.0, -1.0])).expect("a hit").primitive, 0);
}

#[test]
fn degenerate_scenes_have_no_surprises() {
    let down = [0.0, 0.0, -1.0];
    let nothing = aggregate(&[]);
    assert_eq!(first(&nothing, &ray([0.0; 3], down)), None);
    assert_eq!(nothing.bounds(), None);
    let (empty, report) = mesh(&[], &[], &[]);
    assert!(!report.is_closed && empty.is_empty());
    let (flat, report) = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], &[3, 3], &[0, 1, 2, 1, 1, 2]);
    assert_eq!((report.degenerate, report.triangles), (2, 0));
    let scene = aggregate(&[at_origin(&Arc::new(Shape::Mesh(empty))), at_origin(&Arc::new(Shape::Mesh(flat)))]);
    assert_eq!(first(&scene, &ray([0.5, 0.0, 1.0], down)), None);
    // One triangle, also parallel to the ray, and exactly in its plane.
    let one = aggregate(&[at_origin(&square(0.0))]);
    assert!(first(&one, &ray([0.5, 0.25, 1.0], down)).is_some());
    assert_eq!(first(&one, &ray([-3.0, 0.25, 1.0], [1.0, 0.0, 0.0])), None);
    assert_eq!(first(&one, &ray([-3.0, 0.25, 0.0], [1.0, 0.0, 0.0])), None);
    // Behind the ray.
    assert_eq!(first(&one, &ray([0.5, 0.25, -1.0], down)), None);
    // Tiny and huge, as far as f32 has its digits.
    for size in [1e-36_f32, 1e-30, 1e-12, 1e12, 1e36] {
        let s = f64::from(size);
        let scene = aggregate(&[at_origin(&cube(size))]);
        let hits = straight_through(&scene, ray(DVec3::new(0.3, 0.4, -2.0) * s, [0.0, 0.0, 1.0]));
        assert_eq!(hits.len(), 2, "{size}");
        assert!((hits[0].distance / s - 2.0).abs() < 1e-14);
        // The same by the transform alone.
        let scene = aggregate(&[placed(&cube(1.0), DAffine3::from_scale(DVec3::splat(s * s)))]);
        let hits = straight_through(&scene, ray(DVec3::new(0.3, 0.4, -2.0) * s * s, [0.0, 0.0, 1.0]));
        assert_eq!(hits.len(), 2, "{size} by transform");
    }
}

#[test]
fn far_away_scenes_and_cameras_keep_their_hits() {
    let shape = Arc::new(Shape::Mesh(ball(20, 0.0, 1.0, [0.0; 3])));
    for distance in [1e3, 1e6, 1e9] {
        let place = DVec3::new(0.3, -0.7, 0.5) * distance;
        let scene = abbe::geometry::Aggregate::build(&[placed(&shape, DAffine3::from_translation(place))], DVec3::ZERO);
        let camera_relative =
            abbe::geometry::Aggregate::build(&[placed(&shape, DAffine3::from_translation(place))], place);
        for k in 0..200 {
            let t = f64::from(k) * 0.37;
            let aim = DVec3::new(t.sin(), (1.7 * t).cos(), (0.3 * t).sin()) * 0.5;
            let far = ray([0.0; 3], place + aim);
            assert_eq!(balance(&scene, &far), (0, 2), "{distance}");
            assert_eq!(straight_through(&scene, far).len(), 2, "{distance}");
            let near = ray(aim, [t.cos(), t.sin(), 0.1]);
            assert_eq!(balance(&camera_relative, &near), (1, 1));
        }
    }
}

#[test]
fn triangles_that_stay_as_authored_are_those_that_are_cut() {
    // The same cube as triangles that need no cutting, with one without area among them, and wound the other way.
    let points = cube_points(1.0);
    let indices: Vec<i32> = CUBE_INDICES.chunks(4).flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).collect();
    let counts = [3; 13];
    let uncut = mesh(&points, &counts[..12], &indices).0;
    let (cut, report) = mesh(&points, &counts, &[&indices[..15], &[0, 1, 0], &indices[15..]].concat());
    assert_eq!((report.degenerate, report.triangles), (1, 12));
    let turned: Vec<i32> = indices.chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
    let mirrored = PolygonMesh { left_handed: true, ..polygons(&points, &counts[..12], &turned) };
    let mirrored = Mesh::from_polygons(&mirrored).expect("a mesh").0;
    let scenes = [uncut, cut, mirrored].map(|mesh| aggregate(&[at_origin(&Arc::new(Shape::Mesh(mesh)))]));
    for i in 0..200 {
        let t = f64::from(i);
        let direction = DVec3::new((1.7 * t).sin(), (2.3 * t).cos(), (0.7 * t).sin() + 0.1).normalize();
        let middle = DVec3::splat(0.5) + 0.2 * direction.any_orthonormal_vector();
        let ray = ray(middle - 3.0 * direction, direction);
        let [a, b, c] = scenes.each_ref().map(|scene| first(scene, &ray));
        assert!(a.is_some() && a == b && a == c, "{ray:?}");
    }
}
