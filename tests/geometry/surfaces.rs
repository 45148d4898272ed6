//! The surface around a hit, against finite differences of the surface itself.

use std::sync::Arc;

use abbe::geometry::{Aggregate, Axis, Buffer, Interpolation, Mesh, PrimvarView, Ray, Revolved, Shape, Solid};
use abbe::ray::{Curvature, LocalSurface, NormalField};
use glam::{DAffine3, DMat3, DVec3};

use crate::shapes::*;

fn skew() -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols(DVec3::new(1.0, 0.2, -0.1), DVec3::new(0.3, 0.7, 0.2), DVec3::new(-0.2, 0.1, -1.4)),
        translation: DVec3::new(3.0, -2.0, 5.0),
    }
}

fn surface_at(scene: &Aggregate, r: &Ray) -> (DVec3, LocalSurface) {
    let hit = first(scene, r).expect("a hit");
    let (point, surface) = scene.local_surface(r, &hit);
    assert_eq!(scene.normals(r, &hit), (point, surface.normals()), "the short answer is part of the long one");
    assert!((point - r.origin - hit.distance * r.direction).length() < 1e-13 * (1.0 + point.length()));
    assert!((surface.n_g.length() - 1.0).abs() < 1e-15 * 4.0 && (surface.n_s.length() - 1.0).abs() < 1e-15 * 4.0);
    assert_eq!(surface.n_g.dot(r.direction) > 0.0, hit.leaving);
    (point, surface)
}

/// N' and κ for a motion q' of the point, from the record.
fn predicted(surface: &LocalSurface, q: DVec3) -> (DVec3, f64) {
    let n = match surface.field {
        NormalField::Flat => DVec3::ZERO,
        NormalField::Sphere { inv_radius } => q * inv_radius,
        NormalField::Linear { vector, gradient } => {
            let s = gradient * q;
            (s - surface.n_s * surface.n_s.dot(s)) / vector.length()
        }
        NormalField::Revolved { vector, radial, around, second, .. } => {
            let s = radial * (second[0] * radial.dot(q)) + around * (second[1] * around.dot(q));
            (s - surface.n_s * surface.n_s.dot(s)) / vector.length()
        }
    };
    let kappa = match surface.curvature {
        Curvature::Plane => 0.0,
        Curvature::Sphere { inv_radius } => -q.length_squared() * inv_radius,
        Curvature::Quadric { hessian } => -q.dot(hessian * q),
    };
    (n, kappa)
}

/// Compares with central differences of neighbouring rays, at two steps: the error must fall as the square.
fn check(scene: &Aggregate, r: &Ray, step: DVec3) {
    let (p, surface) = surface_at(scene, r);
    let errors = [1e-3, 1e-4].map(|h| {
        let side = |sign: f64| surface_at(scene, &Ray { origin: r.origin + sign * h * step, ..*r });
        let ((p1, s1), (p0, s0)) = (side(1.0), side(-1.0));
        let velocity = (p1 - p0) / (2.0 * h);
        let acceleration = (p1 - 2.0 * p + p0) / (h * h);
        let (n, kappa) = predicted(&surface, velocity);
        let n_error = ((s1.n_s - s0.n_s) / (2.0 * h) - n).length();
        (n_error, (surface.n_g.dot(acceleration) - kappa).abs())
    });
    assert!(errors[1].0 < 1e-6 && errors[1].1 < 1e-4, "{errors:?}");
    assert!(errors[1].0 < 0.02 * errors[0].0 + 1e-10, "{errors:?}");
}

#[test]
fn spheres_and_ellipsoids_bend_as_they_say() {
    let shape = sphere(1.5);
    let rotation = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.9);
    for (place, is_sphere) in [
        (DAffine3::IDENTITY, true),
        (rotation * DAffine3::from_scale(DVec3::splat(-0.3)), true),
        (rotation * DAffine3::from_scale(DVec3::new(0.5, 1.0, -2.0)), false),
        (skew(), false),
    ] {
        let scene = aggregate(&[placed(&shape, place)]);
        let target = place.transform_point3(DVec3::new(0.2, 0.3, 0.1));
        let r = ray(target - DVec3::new(3.0, 8.0, 4.0), DVec3::new(3.0, 8.0, 4.0));
        let (_, surface) = surface_at(&scene, &r);
        assert_eq!(matches!(surface.curvature, Curvature::Sphere { .. }), is_sphere);
        assert!(surface.n_g.dot(r.direction) < 0.0, "outward");
        check(&scene, &r, DVec3::new(0.05, -0.02, 0.03));
    }
}

#[test]
fn solids_bend_as_they_say() {
    let solid = |revolved: Option<Revolved>| Arc::new(Shape::Solid(Solid::Revolved(revolved.expect("a solid"))));
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let shapes = [
            solid(Revolved::cylinder(1.5, 0.8, 0.8, axis)),
            solid(Revolved::cylinder(1.5, 0.9, 0.0, axis)),
            solid(Revolved::cylinder(1.5, 0.4, 0.9, axis)),
            solid(Revolved::capsule(0.5, 0.7, 0.7, axis)),
            solid(Revolved::capsule(1.5, 0.9, 0.6, axis)),
        ];
        for shape in &shapes {
            for place in [DAffine3::IDENTITY, DAffine3::from_scale(DVec3::splat(-0.3)), skew()] {
                let scene = aggregate(&[placed(shape, place)]);
                for (object, d) in [
                    (DVec3::new(0.05, 0.02, 0.1), DVec3::new(3.0, 8.0, 1.0)),
                    (DVec3::new(0.1, -0.03, 0.06), DVec3::new(-7.0, 1.0, 2.0)),
                    (DVec3::new(0.02, 0.07, -0.05), DVec3::new(1.0, 2.0, 9.0)),
                ] {
                    let target = place.transform_point3(object);
                    let d = place.transform_vector3(d);
                    let r = ray(target - d, d);
                    let (_, surface) = surface_at(&scene, &r);
                    assert!(surface.n_g.dot(r.direction) < 0.0, "outward");
                    check(&scene, &r, place.transform_vector3(DVec3::new(0.05, -0.02, 0.03)));
                }
            }
        }
    }
}

fn smooth(normals: [[f32; 3]; 3], place: DAffine3) -> (Aggregate, Ray, bool) {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.2], [0.2, 1.0, -0.1]];
    let mut triangle = polygons(&points, &[3], &[0, 1, 2]);
    triangle.normals = Some(PrimvarView {
        values: Buffer::from_vec(normals.concat()),
        indices: None,
        interpolation: Interpolation::Vertex,
    });
    let (mesh, report) = Mesh::from_polygons(&triangle).expect("a triangle");
    let scene = aggregate(&[placed(&Arc::new(Shape::Mesh(mesh)), place)]);
    let target = place.transform_point3(DVec3::new(0.4, 0.366_667, 0.033_333));
    (scene, ray(target - DVec3::new(0.5, 1.0, 6.0), [0.5, 1.0, 6.0]), report.normals_reversed)
}

#[test]
fn interpolated_normals_vary_as_they_say() {
    let normals = [[-0.3, -0.2, 1.0], [0.4, 0.1, 0.9], [0.0, 0.5, 1.3]];
    for place in [DAffine3::IDENTITY, skew(), DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))] {
        let (scene, r, reversed) = smooth(normals, place);
        assert!(!reversed);
        let (_, surface) = surface_at(&scene, &r);
        assert!(matches!(surface.field, NormalField::Linear { .. }));
        assert!(surface.n_s.dot(surface.n_g) > 0.0);
        check(&scene, &r, DVec3::new(0.03, -0.02, 0.01));
        // Reversed normals give the same surface.
        let (turned, _, reversed) = smooth(normals.map(|n| n.map(|x| -x)), place);
        assert!(reversed);
        assert_eq!(surface_at(&turned, &r).1, surface);
    }
}

#[test]
fn useless_normals_fall_back_to_the_facet() {
    let up = [0.0, 0.0, 1.0];
    // Opposing, so that the sum vanishes at the hit; and against the facet at the hit.
    for normals in [[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0; 3]], [[0.0; 3]; 3]] {
        let (scene, r, _) = smooth(normals, DAffine3::IDENTITY);
        let (_, surface) = surface_at(&scene, &r);
        assert!(surface.n_s.is_finite() && surface.n_s.dot(surface.n_g) > 0.0);
    }
    // Three equal normals: bent, but flat.
    let (scene, r, _) = smooth([up; 3], DAffine3::IDENTITY);
    let (_, surface) = surface_at(&scene, &r);
    assert_eq!(surface.field, NormalField::Flat);
    assert_eq!(surface.n_s, DVec3::Z);
}

#[test]
fn normals_of_the_facets_are_dropped() {
    let points = cube_points(1.0);
    let mut cube = polygons(&points, &CUBE_COUNTS, &CUBE_INDICES);
    let normals = [[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]];
    cube.normals = Some(PrimvarView {
        values: Buffer::from_vec(normals.concat().into_iter().map(|x| x as f32).collect()),
        indices: None,
        interpolation: Interpolation::Uniform,
    });
    let (mesh, _) = Mesh::from_polygons(&cube).expect("a cube");
    assert!(!mesh.has_normals());
}

#[test]
fn tangents_are_the_derivatives_of_the_point_by_the_texture_coordinates() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.3], [0.2, 1.2, -0.4], [1.4, 1.1, 0.6]];
    let with_uv = |uv: &[f32]| {
        let view =
            PrimvarView { values: Buffer::from_vec(uv.to_vec()), indices: None, interpolation: Interpolation::Vertex };
        let polygons =
            abbe::geometry::PolygonMesh { uv: Some(view), ..polygons(&points, &[3, 3], &[0, 1, 2, 1, 3, 2]) };
        let mesh = Mesh::from_polygons(&polygons).expect("a mesh").0;
        aggregate(&[placed(&Arc::new(Shape::Mesh(mesh)), skew())])
    };
    // A turned, stretched and mirrored chart.
    let scene = with_uv(&[0.1, 0.2, 0.9, -0.3, -0.4, -0.7, 0.3, -1.5]);
    for (x, y) in [(0.2, 0.2), (0.5, 0.3), (0.9, 0.9)] {
        let target = skew().transform_point3(DVec3::new(x, y, 0.0));
        let r = ray(target + DVec3::new(0.1, 0.2, 4.0), DVec3::new(-0.1, -0.2, -4.0).normalize());
        let hit = first(&scene, &r).expect("a hit");
        let [p_u, p_v] = scene.tangents(&hit, 0.0).expect("has coordinates");
        let (point, local) = surface_at(&scene, &r);
        assert!(p_u.dot(local.n_g).abs() < 1e-14 && p_v.dot(local.n_g).abs() < 1e-14);
        let [u, v] = scene.uv(&hit, point).expect("has coordinates");
        for step in [DVec3::X, DVec3::Y] {
            let moved = Ray { origin: r.origin + 1e-3 * step, ..r };
            let other = first(&scene, &moved).expect("a hit");
            assert_eq!(other.primitive, hit.primitive);
            let q = surface_at(&scene, &moved).0;
            let [u1, v1] = scene.uv(&other, q).expect("has coordinates");
            assert!((point + p_u * (u1 - u) + p_v * (v1 - v) - q).length() < 1e-14, "{step}");
        }
    }
    // Coordinates that do not tell points apart.
    for uv in [[0.5; 8], [0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]] {
        let scene = with_uv(&uv);
        let r = ray(skew().transform_point3(DVec3::new(0.3, 0.3, 0.0)) + 4.0 * DVec3::Z, -DVec3::Z);
        assert_eq!(scene.tangents(&first(&scene, &r).expect("a hit"), 0.0), None);
    }
}
