//! Domes: images of every layout against brute force, portals.

use std::f64::consts::PI;

use bytes::Bytes;
use glam::{DMat3, DVec3};

use super::super::dome::Dome;
use super::super::shape::Toward;
use super::{Random, deviations};
use crate::light::{Dome as Shape, Layout, Patch};
use crate::texture::{Images, Lookup, Source, Store, Wrap};

/// A sky with a gradient and one bright spot, as a Radiance picture.
fn picture(width: usize, height: usize, spot: [usize; 2]) -> (Store, Lookup) {
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for y in 0..height {
        for x in 0..width {
            // Mantissas over 256, times 2^(e − 128).
            let level = 40 + (200 * y / height) as u8;
            let exponent = if [x, y] == spot { 132 } else { 128 };
            file.extend([level, level / 2, 20 + (100 * x / width) as u8, exponent]);
        }
    }
    let mut store = Store::default();
    let number = store.add("sky.hdr".into(), "</Sky>".into(), Source::Memory(Bytes::from(file)));
    let wrap = [Wrap::Repeat, Wrap::Clamp];
    (store, Lookup { images: Images::Single(number), space: None, wrap, border: [0.0; 4], closest: false })
}

fn shape(layout: Layout) -> Shape {
    let environment_from_world = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
    Shape { environment_from_world, texture: Some(0), layout: Some(layout), portals: Vec::new() }
}

/// Directions with equal solid angles.
fn directions(rows: usize) -> impl Iterator<Item = DVec3> {
    (0..2 * rows * rows).map(move |i| {
        let z = 1.0 - 2.0 * ((i / (2 * rows)) as f64 + 0.5) / rows as f64;
        let phi = PI * ((i % (2 * rows)) as f64 + 0.5) / rows as f64;
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z)
    })
}

#[test]
fn images_are_sampled_by_how_bright_they_are() {
    for (layout, size, spot) in [
        (Layout::Latlong, [64, 32], [20, 9]),
        (Layout::MirroredBall, [48, 48], [15, 20]),
        (Layout::Angular, [48, 48], [15, 20]),
        (Layout::VerticalCross, [48, 64], [20, 22]),
    ] {
        let (store, lookup) = picture(size[0], size[1], spot);
        let dome = Dome::new(&shape(layout), Some(&lookup), &store, DVec3::ZERO);
        let p = DVec3::ZERO;
        let red = |d: DVec3| dome.looked_up(&store, d)[0];
        // The density's integral, and the light's, by brute force.
        let rows = 600;
        let cell = 4.0 * PI / (2 * rows * rows) as f64;
        let (mut total, mut brute) = (0.0, 0.0);
        let octant = |d: DVec3| usize::from(d.x > 0.0) + 2 * usize::from(d.y > 0.0) + 4 * usize::from(d.z > 0.2);
        let mut expected = [0.0; 8];
        for d in directions(rows) {
            let pdf = dome.pdf(p, None, d);
            assert!(pdf > 0.0);
            total += cell * pdf;
            brute += cell * red(d);
            expected[octant(d)] += cell * pdf;
        }
        assert!((total - 1.0).abs() < 2e-3, "{layout:?}: {total}");
        let mut random = Random(6);
        let count = 20_000;
        let (mut sum, mut squares, mut counts) = (0.0, 0.0, [0.0; 8]);
        for _ in 0..count {
            let Toward { wi, pdf_solid_angle, .. } = dome.sample(p, None, random.pair()).unwrap();
            assert!((dome.pdf(p, None, wi) / pdf_solid_angle - 1.0).abs() < 1e-6);
            let value = red(wi) / pdf_solid_angle;
            sum += value;
            squares += value * value;
            counts[octant(wi)] += 1.0;
        }
        let n = f64::from(count);
        let mean = sum / n;
        let deviation = ((squares / n - mean * mean) / n).sqrt();
        // The quadrature of the spot errs by some per mille.
        assert!((mean - brute).abs() < 4.0 * deviation + 4e-3 * brute, "{layout:?}: {mean} ± {deviation}, {brute}");
        assert!(deviation * n.sqrt() < 0.8 * mean, "{layout:?}: the image decides: {deviation} of {mean}");
        let chi_squared: f64 = counts.iter().zip(expected).map(|(c, e)| (c - n * e) * (c - n * e) / (n * e)).sum();
        assert!(deviations(chi_squared, 7.0) < 4.0, "{layout:?}: {chi_squared}");
        let means = [0, 1, 2].map(|i| directions(200).map(|d| dome.looked_up(&store, d)[i]).sum::<f64>() / 80_000.0);
        assert!((dome.mean() / (means.iter().sum::<f64>() / 3.0) - 1.0).abs() < 0.02, "{layout:?}: {}", dome.mean());
    }
}

#[test]
fn without_an_image_directions_are_about_the_normal_or_everywhere() {
    let shape = Shape { texture: None, ..shape(Layout::Latlong) };
    let dome = Dome::new(&shape, None, &Store::default(), DVec3::ZERO);
    let n = DVec3::new(0.48, 0.6, 0.64);
    let mut random = Random(9);
    // ∫ cos⁺ dω = π, without variance where directions follow the cosine.
    for _ in 0..200 {
        let Toward { wi, pdf_solid_angle, distance } = dome.sample(DVec3::ZERO, Some(n), random.pair()).unwrap();
        assert!((n.dot(wi) / pdf_solid_angle / PI - 1.0).abs() < 1e-9 && distance == f64::INFINITY);
    }
    let (mut sum, count) = (DVec3::ZERO, 10_000);
    for _ in 0..count {
        let Toward { wi, pdf_solid_angle, .. } = dome.sample(DVec3::ZERO, None, random.pair()).unwrap();
        assert!((pdf_solid_angle * 4.0 * PI - 1.0).abs() < 1e-12 && (wi.length() - 1.0).abs() < 1e-12);
        sum += wi;
    }
    assert!(sum.length() / f64::from(count) < 4.0 / f64::from(count).sqrt());
    assert!((dome.mean() - 1.0).abs() < 1e-15);
}

#[test]
fn half_of_the_samples_go_through_portals() {
    let portal = |center: DVec3, u: DVec3, v: DVec3| Patch {
        center,
        u,
        v,
        normal: u.cross(v).normalize(),
        area: 4.0 * u.cross(v).length(),
        texture: None,
    };
    let portals = vec![
        portal(DVec3::new(3.0, 0.0, 0.0), DVec3::Y, DVec3::Z),
        portal(DVec3::new(0.0, 2.0, 5.0), DVec3::X, 0.3 * DVec3::Y),
    ];
    let (store, lookup) = picture(32, 16, [3, 5]);
    for image in [None, Some(&lookup)] {
        let shape = Shape { portals: portals.clone(), ..shape(Layout::Latlong) };
        let dome = Dome::new(&shape, image, &store, DVec3::new(0.1, 0.2, 0.3));
        let p = DVec3::new(0.2, -0.4, 0.1);
        let rows = 500;
        let cell = 4.0 * PI / (2 * rows * rows) as f64;
        let total: f64 = directions(rows).map(|d| cell * dome.pdf(p, None, d)).sum();
        assert!((total - 1.0).abs() < 4e-3, "{total}");
        let mut random = Random(1);
        let (mut through, count) = (0, 10_000);
        let frames: Vec<_> =
            portals.iter().map(|q| (q.center - DVec3::new(0.1, 0.2, 0.3) - p, q.u, q.v, q.normal)).collect();
        for _ in 0..count {
            let Toward { wi, pdf_solid_angle, .. } = dome.sample(p, None, random.pair()).unwrap();
            assert!((dome.pdf(p, None, wi) / pdf_solid_angle - 1.0).abs() < 1e-6);
            let is_through = frames.iter().any(|&(center, u, v, n)| {
                let t = center.dot(n) / wi.dot(n);
                let q = t * wi - center;
                t > 0.0 && q.dot(u).abs() <= u.length_squared() && q.dot(v).abs() <= v.length_squared()
            });
            through += u32::from(is_through);
        }
        assert!(f64::from(through) / f64::from(count) > 0.48, "{through}");
    }
}
