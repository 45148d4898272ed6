//! Rays per second through one displaced, tessellated ball: coherent from a camera, and in all directions from inside.
//!
//! `cargo bench --bench bvh`; the numbers belong to the machine. The build's settings (`src/geometry/tree.rs`) come from here.

use std::sync::Arc;

use abbe::geometry::{Aggregate, Buffer, Departures, Instance, Mesh, PolygonMesh, Ray, Shape};
use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DAffine3, DVec3};

/// Rings of quads from pole to pole: 80 thousand and one million triangles.
const RINGS: [usize; 2] = [142, 502];
const SIDE: u32 = 128;

fn main() {
    divan::main();
}

/// A closed ball of about 4·rings² triangles with bumps.
fn ball(rings: usize) -> (Vec<[f32; 3]>, Vec<i32>) {
    let segments = 2 * rings;
    let mut points = Vec::new();
    for i in 0..=rings {
        for j in 0..segments {
            let (theta, phi) = (i as f64 / rings as f64, j as f64 / segments as f64);
            let (theta, phi) = (theta * std::f64::consts::PI, phi * std::f64::consts::TAU);
            let r = 1.0 + 0.03 * (23.0 * theta).sin() * (31.0 * phi).cos();
            let p = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos()];
            points.push(p.map(|x| (x * r) as f32));
        }
    }
    let at = |i: usize, j: usize| (i * segments + j % segments) as i32;
    let mut indices = Vec::new();
    for i in 0..rings {
        for j in 0..segments {
            indices.extend([at(i, j), at(i, j + 1), at(i + 1, j)]);
            indices.extend([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    (points, indices)
}

fn mesh(points: &Buffer<[f32; 3]>, counts: &[i32], indices: &Buffer<i32>) -> Mesh {
    let polygons = PolygonMesh::bare("/Ball", points.clone(), counts, indices.clone());
    Mesh::from_polygons(&polygons).expect("a ball").0
}

fn scene(rings: usize) -> Aggregate {
    let (points, indices) = ball(rings);
    let counts = vec![3; indices.len() / 3];
    let shape = Arc::new(Shape::Mesh(mesh(&Buffer::from_vec(points), &counts, &Buffer::from_vec(indices))));
    Aggregate::build(&[Instance { shape, world_from_object: DAffine3::IDENTITY.into() }], DVec3::ZERO)
}

fn shoot(bencher: Bencher<'_, '_>, rings: usize, rays: &[Ray]) {
    let scene = scene(rings);
    let none = Departures::none();
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| rays.iter().filter(|ray| scene.intersect(ray, &none).is_some()).count());
}

#[divan::bench(args = RINGS, sample_count = 20)]
fn primary(bencher: Bencher<'_, '_>, rings: usize) {
    let rays: Vec<Ray> = (0..SIDE * SIDE)
        .map(|i| {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(SIDE) - 0.5;
            let direction = DVec3::new(at(i % SIDE) * 0.8, at(i / SIDE) * 0.8, -1.0).normalize();
            Ray { origin: DVec3::new(0.0, 0.0, 3.5), direction, time: 0.0 }
        })
        .collect();
    shoot(bencher, rings, &rays);
}

#[divan::bench(args = RINGS, sample_count = 20)]
fn random(bencher: Bencher<'_, '_>, rings: usize) {
    // Weyl sequences: spread evenly, in no coherent order.
    let weyl = |i: u32, step: f64| (f64::from(i) * step).fract();
    let rays: Vec<Ray> = (0..SIDE * SIDE)
        .map(|i| {
            let z = 2.0 * weyl(i, 0.819_172_513_396_164_4) - 1.0;
            let phi = std::f64::consts::TAU * weyl(i, 0.671_043_606_703_789_2);
            let r = (1.0 - z * z).sqrt();
            let origin = 0.9 * DVec3::new(weyl(i, 0.549_700_477_901_970_3) - 0.5, weyl(i, 0.45) - 0.5, 0.0);
            Ray { origin, direction: DVec3::new(r * phi.cos(), r * phi.sin(), z), time: 0.0 }
        })
        .collect();
    shoot(bencher, rings, &rays);
}

#[divan::bench(args = RINGS, sample_count = 3)]
fn build(bencher: Bencher<'_, '_>, rings: usize) {
    let (points, indices) = ball(rings);
    let (points, counts) = (Buffer::from_vec(points), vec![3; indices.len() / 3]);
    let indices = Buffer::from_vec(indices);
    bencher.counter(ItemsCount::new(counts.len())).bench_local(|| mesh(&points, &counts, &indices));
}
