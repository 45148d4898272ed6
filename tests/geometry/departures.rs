//! Rays that start on surfaces.

use std::sync::Arc;

use abbe::geometry::{Aggregate, Departures, Hit, Ray, Shape};
use glam::{DAffine3, DVec3};
use proptest::prelude::*;

use crate::shapes::*;

/// Follows a ray; `event` gives the new direction.
fn follow(
    scene: &Aggregate,
    mut ray: Ray,
    events: usize,
    mut event: impl FnMut(&Hit, DVec3, DVec3) -> DVec3,
) -> Vec<Hit> {
    let mut departures = Departures::none();
    let mut hits = Vec::new();
    while let Some(hit) = scene.intersect(&ray, &departures) {
        hits.push(hit);
        if hits.len() == events {
            break;
        }
        let (point, surface) = scene.local_surface(&ray, &hit);
        let direction = event(&hit, ray.direction, surface.n_g);
        departures.depart(&ray, &hit, direction.dot(surface.n_g) > 0.0);
        ray = Ray { origin: point, direction, ..ray };
    }
    hits
}

fn reflected(d: DVec3, n: DVec3) -> DVec3 {
    (d - 2.0 * d.dot(n) * n).normalize()
}

#[test]
fn coincident_squares_are_both_met() {
    let shape = square(0.0);
    let turned = DAffine3::from_axis_angle(DVec3::new(0.3, 0.5, 0.8).normalize(), 1.0);
    for place in [DAffine3::IDENTITY, turned, DAffine3::from_translation(DVec3::new(1e4, 3.0, -7.7)) * turned] {
        let scene = aggregate(&[placed(&shape, place), placed(&shape, place), placed(&shape, place)]);
        for k in 0..500 {
            let t = f64::from(k);
            let target = place.transform_point3(DVec3::new(0.9 * t.sin(), 0.9 * (1.7 * t).cos(), 0.0));
            let from = place.transform_point3(DVec3::new((0.3 * t).cos(), t.cos(), 1.5 + t.sin()));
            let straight = ray(from, target - from);
            let hits = straight_through(&scene, straight);
            let instances: Vec<u32> = hits.iter().map(|h| h.instance).collect();
            assert_eq!(instances, [0, 1, 2]);
            assert!(hits.iter().all(|h| !h.leaving) && hits[1].at_start && hits[2].at_start);
            // A mirror turns the ray back before it reaches the others.
            let hits = follow(&scene, straight, 9, |_, d, n| reflected(d, n));
            assert_eq!(hits.len(), 1);
            // The second one a mirror: the first is crossed back, the third never met.
            let hits = follow(&scene, straight, 9, |h, d, n| if h.instance == 1 { reflected(d, n) } else { d });
            let met: Vec<(u32, bool)> = hits.iter().map(|h| (h.instance, h.leaving)).collect();
            assert_eq!(met, [(0, false), (1, false), (0, true)]);
        }
    }
}

#[test]
fn cemented_cubes_are_left_and_entered() {
    // Two cubes that share a face, as two instances and as one mesh.
    let shape = cube(1.0);
    let two = aggregate(&[at_origin(&shape), placed(&shape, DAffine3::from_translation(DVec3::Z))]);
    let mut points = cube_points(1.0);
    points.extend(cube_points(1.0).iter().map(|p| [p[0], p[1], p[2] + 1.0]));
    let indices: Vec<i32> = CUBE_INDICES.iter().copied().chain(CUBE_INDICES.iter().map(|i| i + 8)).collect();
    let (both, report) = mesh(&points, &[4; 12], &indices);
    assert!(report.is_closed);
    let one = aggregate(&[at_origin(&Arc::new(Shape::Mesh(both)))]);
    for scene in [two, one] {
        for i in 0..64 {
            for j in 1..63 {
                // Diagonals of the faces included.
                let r = ray([f64::from(i.max(1)) / 64.0, f64::from(j) / 64.0, -1.0], [0.0, 0.0, 1.0]);
                let hits = straight_through(&scene, r);
                assert_eq!(hits.len(), 4, "{r:?} {hits:?}");
                assert_eq!(hits.iter().filter(|h| h.leaving).count(), 2);
                assert!(!hits[0].leaving && hits[3].leaving);
            }
        }
    }
}

#[test]
fn a_sphere_is_left_at_the_other_side() {
    let shape = sphere(1.0);
    for (scale, place) in [
        (1.0, DAffine3::IDENTITY),
        (1e-6, DAffine3::from_scale(DVec3::splat(1e-6))),
        (1e6, DAffine3::from_scale(DVec3::splat(1e6))),
        (1.0, DAffine3::from_translation(DVec3::new(1e3, -1e3, 1e3))),
        (1.0, DAffine3::from_scale(DVec3::new(1.0, 0.3, -2.0))),
    ] {
        let scene = aggregate(&[placed(&shape, place)]);
        for k in 0..500 {
            let t = f64::from(k);
            // Up to grazing.
            let across = 1.0 - 10.0_f64.powi(-(k % 15));
            let from = place.transform_point3(DVec3::new(across * t.sin(), across * t.cos(), -3.0));
            let to = place.transform_point3(DVec3::new(across * t.sin(), across * t.cos(), 3.0));
            let r = ray(from, to - from);
            let hits = straight_through(&scene, r);
            assert!(hits.len() == 2 || (hits.is_empty() && k % 15 > 12), "{scale} {k} {hits:?}");
            // 40 reflections inside stay inside, always with the same chord.
            let mut chords = Vec::new();
            let mut entered = false;
            let hits = follow(&scene, r, 40, |hit, d, n| {
                chords.push(hit.distance);
                if std::mem::replace(&mut entered, true) { reflected(d, n) } else { d }
            });
            assert!(hits.is_empty() || (hits.len() == 40 && hits[1..].iter().all(|h| h.leaving)), "{hits:?}");
            if place.matrix3.determinant().abs() > 0.0
                && k % 15 > 0
                && k % 15 < 6
                && (place.matrix3.x_axis.x - place.matrix3.y_axis.y).abs() < f64::MIN_POSITIVE
            {
                assert!(chords[2..].iter().all(|c| (c / chords[1] - 1.0).abs() < 1e-8), "{chords:?}");
            }
        }
    }
}

#[test]
fn coincident_spheres_are_both_met() {
    let shape = sphere(1.0);
    let place = DAffine3::from_translation(DVec3::new(3.0, 1e3, 0.1));
    let scene = aggregate(&[placed(&shape, place), placed(&shape, place)]);
    for k in 0..500 {
        let t = f64::from(k);
        let aim = place.translation + 0.6 * DVec3::new(t.sin(), t.cos(), (1.3 * t).sin());
        let r = ray(
            place.translation + 3.0 * DVec3::new((0.7 * t).cos(), (0.9 * t).sin(), 1.0),
            DVec3::ZERO + aim - (place.translation + 3.0 * DVec3::new((0.7 * t).cos(), (0.9 * t).sin(), 1.0)),
        );
        let hits = straight_through(&scene, r);
        assert!(hits.len() == 4 || hits.is_empty(), "{hits:?}");
        if !hits.is_empty() {
            assert_eq!(hits.iter().map(|h| h.leaving).collect::<Vec<_>>(), [false, false, true, true]);
        }
        // A mirror inside the glass sphere's surface.
        let hits = follow(&scene, r, 9, |h, d, n| if h.instance == 1 { reflected(d, n) } else { d });
        assert!(hits.len() <= 3, "{hits:?}");
    }
}

#[test]
fn reflection_at_an_exact_edge_does_not_go_inside() {
    let scene = aggregate(&[at_origin(&cube(1.0))]);
    for k in 0..=32 {
        // At the middle of edges and at corners of the top, from all sides.
        let x = f64::from(k) / 32.0;
        for (target, from) in
            [([x, 1.0, 1.0], [x, 2.0, 2.0]), ([1.0, x, 1.0], [2.0, x, 2.0]), ([1.0, 1.0, 1.0], [2.0, 2.0, 2.0])]
        {
            let (target, from) = (DVec3::from(target), DVec3::from(from));
            let hits = follow(&scene, ray(from, target - from), 5, |_, d, n| reflected(d, n));
            assert!(hits.len() <= 1, "{hits:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_ray_bouncing_inside_a_closed_mesh_stays_inside(
        start in [-0.2_f64..0.2, -0.2..0.2, -0.2..0.2],
        d in [-1.0_f64..1.0, -1.0..1.0, -1.0..1.0],
        scale in -6..=6_i32,
        far in prop_oneof![Just(0.0), Just(1e3)],
        gem in any::<bool>(),
    ) {
        let direction = DVec3::from(d).normalize_or(DVec3::X);
        let size = 10.0_f64.powi(scale);
        let shape = if gem { cube(2.0) } else { Arc::new(Shape::Mesh(ball(8, 0.1, 1.0, [0.0; 3]))) };
        let center = if gem { DVec3::ONE } else { DVec3::ZERO };
        let place = DAffine3::from_translation(DVec3::new(0.3, -0.8, 0.1) * far * size)
            * DAffine3::from_scale(DVec3::new(size, size, -size))
            * DAffine3::from_axis_angle(DVec3::new(0.1, 0.2, 0.9).normalize(), 0.4);
        let scene = aggregate(&[placed(&shape, place)]);
        let r = ray(place.transform_point3(DVec3::from(start) + center), direction);
        let hits = follow(&scene, r, 200, |_, d, n| reflected(d, n));
        prop_assert_eq!(hits.len(), 200);
        prop_assert!(hits.iter().all(|h| h.leaving));
    }

    #[test]
    fn a_plate_on_a_mirror_is_left_and_entered_again(
        x in 0.01_f64..0.99, y in 0.01_f64..0.99, tilt in [-1.0_f64..1.0, -1.0..1.0], turn in 0.0_f64..6.0,
        mirror_first in any::<bool>(),
    ) {
        // The mirror coincides with the bottom of the cube.
        let place = DAffine3::from_axis_angle(DVec3::new(0.1, 0.7, 0.2).normalize(), turn);
        let glass = placed(&cube(1.0), place);
        let mirror = placed(&square(0.0), place * DAffine3::from_scale(DVec3::new(8.0, 8.0, 1.0)));
        let order = if mirror_first { [mirror, glass] } else { [glass, mirror] };
        let scene = aggregate(&order);
        let is_mirror = |h: &Hit| (h.instance == 0) == mirror_first;
        let from = place.transform_point3(DVec3::new(x + 0.1 * tilt[0], y + 0.1 * tilt[1], 4.0));
        let to = place.transform_point3(DVec3::new(x, y, 0.0));
        let hits = follow(&scene, ray(from, to - from), 20, |h, d, n| if is_mirror(h) { reflected(d, n) } else { d });
        // The glass is entered and left in turns, and the mirror met once.
        prop_assert_eq!(hits.iter().filter(|h| is_mirror(h)).count(), 1);
        let glass: Vec<bool> = hits.iter().filter(|h| !is_mirror(h)).map(|h| h.leaving).collect();
        prop_assert!(glass.len() == 2 || glass.len() == 4, "{:?}", hits);
        prop_assert!(glass.iter().enumerate().all(|(k, &leaving)| leaving == (k % 2 == 1)), "{:?}", hits);
    }
}

#[test]
fn glass_in_a_room_touches_what_it_stands_on_and_not_the_room() {
    let (room, gem, ball) = (cube(10.0), cube(1.0), sphere(1.0));
    let turn = DAffine3::from_rotation_y(0.3);
    for scale in [1e-6, 1.0, 1e6] {
        // The cubes have a corner at their origin.
        let place = |corner: f64, height: f64| {
            let at = DVec3::new(corner, corner + height, corner);
            DAffine3::from_scale(DVec3::splat(scale)) * turn * DAffine3::from_translation(at)
        };
        for (glass, corner, size) in [(&gem, -0.5, 0.5), (&ball, 0.0, 1.0)] {
            for (height, touches) in [(0.0, false), (size - 4.999, false), (size - 5.0, true), (size - 5.1, true)] {
                let scene = aggregate(&[placed(glass, place(corner, height)), placed(&room, place(-5.0, 0.0))]);
                assert_eq!(scene.is_touching(0, |_| true), touches, "{height} at scale {scale}");
                assert!(!scene.is_touching(0, |_| false));
            }
        }
    }
}
