//! Shapes that the tests share.

use std::sync::Arc;

use abbe::geometry::{Aggregate, Buffer, Departures, Hit, Instance, Mesh, MeshReport, PolygonMesh, Ray, Shape, Sphere};
use glam::{DAffine3, DVec3};

/// A mesh without attributes.
pub(crate) fn polygons<'a>(points: &[[f32; 3]], counts: &'a [i32], indices: &[i32]) -> PolygonMesh<'a> {
    PolygonMesh::bare("/Mesh", Buffer::from_vec(points.to_vec()), counts, Buffer::from_vec(indices.to_vec()))
}

pub(crate) fn mesh(points: &[[f32; 3]], counts: &[i32], indices: &[i32]) -> (Mesh, MeshReport) {
    Mesh::from_polygons(&polygons(points, counts, indices)).expect("a mesh")
}

pub(crate) const CUBE_COUNTS: [i32; 6] = [4; 6];
pub(crate) const CUBE_INDICES: [i32; 24] = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];

/// Corners of the cube between 0 and `size`, x fastest.
pub(crate) fn cube_points(size: f32) -> Vec<[f32; 3]> {
    (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| bit as f32 * size)).collect()
}

pub(crate) fn cube(size: f32) -> Arc<Shape> {
    let (mesh, report) = mesh(&cube_points(size), &CUBE_COUNTS, &CUBE_INDICES);
    assert!(report.is_closed);
    Arc::new(Shape::Mesh(mesh))
}

/// A closed ball of triangles with bumps, `rings` from pole to pole.
pub(crate) fn ball(rings: usize, bump: f64, size: f32, offset: [f32; 3]) -> Mesh {
    let segments = 2 * rings;
    let mut points = vec![[0.0, 0.0, -1.0]];
    for i in 1..rings {
        for j in 0..segments {
            let (theta, phi) = (i as f64 / rings as f64, j as f64 / segments as f64);
            let (theta, phi) = (theta * std::f64::consts::PI, phi * std::f64::consts::TAU);
            let r = 1.0 + bump * (5.0 * theta).sin() * (7.0 * phi).cos();
            points.push([theta.sin() * phi.cos() * r, theta.sin() * phi.sin() * r, -theta.cos() * r]);
        }
    }
    points.push([0.0, 0.0, 1.0]);
    let points: Vec<[f32; 3]> =
        points.into_iter().map(|p| std::array::from_fn(|k| p[k] as f32 * size + offset[k])).collect();
    let at = |i: usize, j: usize| match i {
        0 => 0,
        i if i == rings => points.len() as i32 - 1,
        i => (1 + (i - 1) * segments + j % segments) as i32,
    };
    let mut indices = Vec::new();
    for i in 0..rings {
        for j in 0..segments {
            if i > 0 {
                indices.extend([at(i, j), at(i, j + 1), at(i + 1, j)]);
            }
            if i + 1 < rings {
                indices.extend([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    let counts = vec![3; indices.len() / 3];
    let (mesh, report) = mesh(&points, &counts, &indices);
    assert!(report.is_closed, "{report:?}");
    mesh
}

/// A square at height `z` facing +z, between ±1.
pub(crate) fn square(z: f32) -> Arc<Shape> {
    let points = [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    Arc::new(Shape::Mesh(mesh(&points, &[4], &[0, 1, 2, 3]).0))
}

pub(crate) fn sphere(radius: f64) -> Arc<Shape> {
    Arc::new(Shape::Sphere(Sphere::new(radius).expect("positive")))
}

pub(crate) fn placed(shape: &Arc<Shape>, world_from_object: DAffine3) -> Instance {
    Instance { shape: Arc::clone(shape), world_from_object: world_from_object.into() }
}

pub(crate) fn at_origin(shape: &Arc<Shape>) -> Instance {
    placed(shape, DAffine3::IDENTITY)
}

pub(crate) fn aggregate(instances: &[Instance]) -> Aggregate {
    Aggregate::build(instances, DVec3::ZERO)
}

pub(crate) fn ray(origin: impl Into<DVec3>, direction: impl Into<DVec3>) -> Ray {
    Ray { origin: origin.into(), direction: direction.into().normalize(), time: 0.0 }
}

pub(crate) fn first(aggregate: &Aggregate, ray: &Ray) -> Option<Hit> {
    aggregate.intersect(ray, &Departures::none())
}

/// All hits of a ray that goes straight on through every surface.
pub(crate) fn straight_through(aggregate: &Aggregate, mut ray: Ray) -> Vec<Hit> {
    let mut departures = Departures::none();
    let mut hits = Vec::new();
    while let Some(hit) = aggregate.intersect(&ray, &departures) {
        let (point, surface) = aggregate.local_surface(&ray, &hit);
        departures.depart(&ray, &hit, ray.direction.dot(surface.n_g) > 0.0);
        ray.origin = point;
        hits.push(hit);
        assert!(hits.len() < 1000, "{:?}", &hits[990..]);
    }
    hits
}

/// Crossings counted +1 outward, −1 inward, and their number.
pub(crate) fn balance(aggregate: &Aggregate, ray: &Ray) -> (i32, u32) {
    let mut count = (0, 0);
    aggregate.crossings(ray, &mut |hit| {
        count.0 += if hit.leaving { 1 } else { -1 };
        count.1 += 1;
    });
    count
}
