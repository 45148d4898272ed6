//! What a view's lights send to receivers: closed forms, density and ray in agreement, links, many lights.

mod support;

use std::f64::consts::PI;

use abbe::geometry::{Departures, Hit, Ray};
use abbe::light::Shape;
use abbe::lighting::{LightHit, LightId, LightSample, Lighting, Receiver};
use abbe::scene::Scene;
use abbe::scene::description::{self, LightShape, LightShaping, LinkSet};
use abbe::scene::view::View;
use abbe::spectrum::{Wavelengths, visible};
use glam::{DMat4, DQuat, DVec3};
use serde_json::json;
use support::{Stagehand, authored};

/// Render space's zero: somewhere.
const ORIGIN: DVec3 = DVec3::new(0.25, -0.5, 1.5);

/// A white light of intensity 1 with a place of its own.
fn light(path: &str, shape: LightShape, transform: DMat4) -> description::Light {
    description::Light { transform: Some(transform.to_cols_array()), ..support::light(path, shape) }
}

fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

fn rect(width: f64, height: f64) -> LightShape {
    LightShape::Rect { width, height, texture: None }
}

fn sphere(radius: f64) -> LightShape {
    LightShape::Sphere { radius, treat_as_point: false }
}

fn distant(angle: f64) -> LightShape {
    LightShape::Distant { angle }
}

fn dome() -> LightShape {
    LightShape::Dome {
        texture: None,
        format: "automatic".into(),
        pole_axis: "Y".into(),
        guide_radius: 1.0,
        portals: Vec::new(),
    }
}

fn scene(lights: Vec<description::Light>) -> Scene {
    let mut s = Stagehand::new();
    let grey = s.diffuse("/World/Grey");
    s.wall(-50.0, 1.0, Some(grey));
    s.document.groups[0].lights = lights;
    s.build()
}

/// At a point of the world.
fn receiver(point: DVec3, normal: Option<DVec3>) -> Receiver {
    Receiver { point: point - ORIGIN, normal: normal.map(|n| n.as_vec3()), object: 0, time: 0.0 }
}

/// The numbers of a path: a lattice with good projections, shifted by the seed.
fn numbers(i: u32, seed: f64) -> (f32, [f32; 2]) {
    // The generalised golden ratio of three dimensions (M. Roberts 2018).
    const G: f64 = 1.220_744_084_605_759_5;
    let t = f64::from(i) + 0.5 + seed;
    let [a, b, c] =
        [1.0 / G, 1.0 / (G * G), 1.0 / (G * G * G)].map(|g| ((t * g).fract() as f32).min(1.0 - f32::EPSILON));
    (a, [b, c])
}

fn wavelengths() -> Wavelengths<4> {
    visible::sample(0.37)
}

/// Irradiance at a receiver over that of white light of radiance 1, from the first lane; and the estimate from every other one.
fn irradiance(lighting: &Lighting<'_>, receiver: &Receiver, n: DVec3, count: u32) -> f64 {
    let wavelengths = wavelengths();
    let white = abbe::light::White::d65().at(wavelengths.nanometers()[0]);
    let sum: f64 = (0..count)
        .map(|i| {
            let (u_light, u) = numbers(i, 0.0);
            let Some(sample) = lighting.sample(receiver, &wavelengths, u_light, u) else { return 0.0 };
            f64::from(sample.radiance[0] / white) * n.dot(sample.wi).max(0.0) / f64::from(sample.pdf)
        })
        .sum();
    sum / f64::from(count)
}

fn close(found: f64, expected: f64, relative: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < relative, "{what}: {found} is not {expected}");
}

#[test]
fn irradiance_has_its_closed_forms() {
    let n = DVec3::Z;
    let p = DVec3::new(1.0, 2.0, 0.0);
    let down = at(1.0, 2.0, 3.0);
    let cases = [
        ("sphere", light("/L", sphere(0.5), down), PI * 0.25 / 9.0),
        ("disk", light("/L", LightShape::Disk { radius: 2.0 }, down), PI * 4.0 / 13.0),
        // Lambert: four quarters of a rectangle over the receiver.
        ("rectangle", light("/L", rect(4.0, 2.0), down), {
            let (a, b) = (2.0 / 3.0_f64, 1.0 / 3.0_f64);
            let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
            4.0 * 0.5 * (part(a, b) + part(b, a))
        }),
        ("dome", light("/L", dome(), DMat4::IDENTITY), PI),
        ("sky", light("/L", distant(60.0), DMat4::IDENTITY), PI * 0.25),
        // An illuminance, not a luminance.
        ("parallel light", light("/L", distant(0.0), DMat4::IDENTITY), 1.0),
        ("normalised sun", description::Light { normalize: true, ..light("/L", distant(0.53), DMat4::IDENTITY) }, 1.0),
        ("point", light("/L", LightShape::Sphere { radius: 0.5, treat_as_point: true }, down), PI * 0.25 / 9.0),
    ];
    for (what, light, expected) in cases {
        let scene = scene(vec![light]);
        let view = View::new(&scene, ORIGIN);
        let lighting = Lighting::new(&view).unwrap();
        for normal in [None, Some(n)] {
            close(irradiance(&lighting, &receiver(p, normal), n, 20_000), expected, 4e-3, what);
        }
    }
}

#[test]
fn lines_are_thin_cylinders() {
    let place = at(0.4, 0.0, 3.0);
    let (p, n) = (DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 0.6, 0.8));
    let sent = |length: f64, radius: f64, treat_as_line: bool| {
        let scene = scene(vec![light("/L", LightShape::Cylinder { length, radius, treat_as_line }, place)]);
        let view = View::new(&scene, ORIGIN);
        let lighting = Lighting::new(&view).unwrap();
        irradiance(&lighting, &receiver(p, Some(n)), n, 20_000)
    };
    close(sent(5.0, 0.01, true), sent(5.0, 0.01, false), 1e-2, "a thin one");
    // Far away and short: intensity 2 r l over the square of the distance.
    let scene = scene(vec![light(
        "/L",
        LightShape::Cylinder { length: 0.1, radius: 0.02, treat_as_line: true },
        at(0.0, 0.0, 50.0),
    )]);
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    close(
        irradiance(&lighting, &receiver(DVec3::ZERO, None), DVec3::Z, 100),
        2.0 * 0.02 * 0.1 / 2500.0,
        1e-5,
        "a short one",
    );
}

/// Irradiance of a point and of a spot goes with the inverse square, and nothing else finds them.
#[test]
fn points_obey_the_inverse_square_and_rays_pass_them() {
    let shaping = LightShaping {
        focus: 0.0,
        focus_tint: [0.0; 3],
        cone_angle: 30.0,
        cone_softness: 0.0,
        ies: None,
        ies_angle_scale: 0.0,
        ies_normalize: false,
    };
    let point = light("/L", LightShape::Sphere { radius: 0.1, treat_as_point: true }, at(0.0, 0.0, 4.0));
    let scene = scene(vec![description::Light { shaping: Some(shaping), ..point }]);
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let wavelengths = wavelengths();
    for distance in [0.5, 2.0, 8.0, 1e4] {
        let p = DVec3::new(0.0, 0.0, 4.0 - distance);
        let sample = lighting.sample(&receiver(p, Some(DVec3::Z)), &wavelengths, 0.5, [0.5; 2]).unwrap();
        assert!(sample.is_delta && (f64::from(sample.pdf) - 1.0).abs() < 1e-6);
        let white = abbe::light::White::d65().at(wavelengths.nanometers()[0]);
        close(f64::from(sample.radiance[0] / white), PI * 0.01 / (distance * distance), 1e-6, "point");
        let ray = Ray { origin: p - ORIGIN, direction: DVec3::Z, time: 0.0 };
        lighting.along(&ray, f64::INFINITY, &wavelengths, &mut |hit| panic!("{hit:?}"));
    }
    // Out of the cone.
    let p = DVec3::new(3.0, 0.0, 0.0);
    assert!(lighting.sample(&receiver(p, None), &wavelengths, 0.5, [0.5; 2]).is_none());
}

fn all_shapes() -> Vec<description::Light> {
    let turned = |x: f64, y: f64, z: f64, scale: DVec3| {
        DMat4::from_scale_rotation_translation(scale, DQuat::from_rotation_y(0.5), DVec3::new(x, y, z))
    };
    vec![
        light("/Rect", rect(1.0, 0.5), turned(-3.0, 0.0, 4.0, DVec3::ONE)),
        light("/Disk", LightShape::Disk { radius: 0.5 }, turned(-1.0, 0.0, 4.0, DVec3::new(1.0, 2.0, 1.0))),
        light("/Sphere", sphere(0.4), turned(1.0, 0.0, 4.0, DVec3::ONE)),
        light("/Ellipsoid", sphere(0.4), turned(3.0, 0.0, 4.0, DVec3::new(1.0, 0.4, 2.0))),
        light(
            "/Tube",
            LightShape::Cylinder { length: 2.0, radius: 0.2, treat_as_line: false },
            turned(0.0, 2.0, 4.0, DVec3::ONE),
        ),
        light("/Sun", distant(3.0), DMat4::from_rotation_x(0.6)),
        light("/Dome", dome(), DMat4::IDENTITY),
        light(
            "/Line",
            LightShape::Cylinder { length: 2.0, radius: 0.2, treat_as_line: true },
            turned(0.0, -2.0, 4.0, DVec3::ONE),
        ),
    ]
}

/// Everything that the ray from a receiver finds of one light.
fn found(
    view: &View<'_>,
    lighting: &Lighting<'_>,
    ray: &Ray,
    wavelengths: &Wavelengths<4>,
    light: LightId,
) -> Vec<LightHit<4>> {
    let mut hits = Vec::new();
    let met: Option<Hit> = view.intersect(ray, &Departures::none());
    lighting.along(ray, f64::INFINITY, wavelengths, &mut |hit| hits.push(hit));
    lighting.environment(ray, wavelengths, &mut |hit| hits.push(hit));
    hits.extend(met.and_then(|met| lighting.emitted(ray, &met, wavelengths)));
    hits.retain(|hit| hit.light == light);
    hits
}

/// What is drawn is found by a ray, at the same distance, as bright, with the same density.
fn assert_agreement(scene: &Scene, points: &[DVec3], normal: Option<DVec3>) -> Vec<LightSample<4>> {
    let view = View::new(scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let wavelengths = wavelengths();
    let mut samples = Vec::new();
    let (mut count, mut missed) = (0, 0);
    for (seed, &p) in (0..).zip(points) {
        let receiver = receiver(p, normal);
        for i in 0..600 {
            let (u_light, u) = numbers(i, f64::from(seed) * 0.37);
            let Some(sample) = lighting.sample(&receiver, &wavelengths, u_light, u) else { continue };
            samples.push(sample);
            if sample.is_delta {
                continue;
            }
            let ray = Ray { origin: receiver.point, direction: sample.wi, time: 0.0 };
            let first = view.intersect(&ray, &Departures::none());
            if first.is_some_and(|hit| hit.distance < sample.distance * (1.0 - 1e-9)) {
                // Another part of what glows is in the way.
                continue;
            }
            count += 1;
            let hits = found(&view, &lighting, &ray, &wavelengths, sample.light);
            let same = |hit: &&LightHit<4>| {
                let are_far = hit.distance.is_infinite() && sample.distance.is_infinite();
                are_far || (hit.distance - sample.distance).abs() <= 1e-6 * sample.distance
            };
            let Some(hit) = hits.iter().find(same) else {
                missed += 1;
                continue;
            };
            let pdf = lighting.pdf(&receiver, sample.wi, hit);
            close(pdf.into(), sample.pdf.into(), 1e-5, "density");
            for lane in 0..4 {
                let (a, b) = (hit.radiance[lane], sample.radiance[lane]);
                assert!((a - b).abs() <= 1e-5 * a.max(b), "{:?}: {a} met, {b} drawn", sample.light);
            }
        }
    }
    assert!(count > 0 && missed * 200 <= count, "{missed} of {count} are not met");
    samples
}

#[test]
fn what_is_drawn_is_what_rays_meet() {
    let scene = scene(all_shapes());
    let points = [DVec3::ZERO, DVec3::new(0.0, 0.0, 3.0), DVec3::new(5.0, -3.0, -2.0), DVec3::new(-2.0, 1.0, 3.3)];
    for normal in [None, Some(DVec3::new(0.0, 0.6, 0.8))] {
        let samples = assert_agreement(&scene, &points, normal);
        for id in 0..8 {
            let of_light = samples.iter().filter(|sample| sample.light == LightId(id)).count();
            assert!(of_light > 5, "light {id} was chosen {of_light} times");
        }
    }
    // Many of them: rays find them by a tree.
    let many = (0..20)
        .flat_map(|i| {
            let shift = DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0) * 9.0;
            all_shapes()
                .into_iter()
                .filter(|l| !matches!(l.shape, LightShape::Dome { .. } | LightShape::Distant { .. }))
                .map(move |mut l| {
                    l.path += &i.to_string();
                    let place = DMat4::from_cols_array(&l.transform.unwrap());
                    l.transform = Some((DMat4::from_translation(shift) * place).to_cols_array());
                    l
                })
        })
        .collect();
    assert_agreement(&self::scene(many), &points, None);
}

/// Lights block nothing and shine to their side.
#[test]
fn rays_gather_every_light_that_faces_them() {
    let facing = |z: f64| light(&format!("/L{z}"), rect(2.0, 2.0), at(0.0, 0.0, z));
    let away = light("/Away", rect(2.0, 2.0), at(0.0, 0.0, 3.0) * DMat4::from_rotation_x(PI));
    let scene = scene(vec![facing(2.0), away, facing(4.0), light("/Ball", sphere(0.5), at(0.0, 0.0, 6.0))]);
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let ray = Ray { origin: DVec3::new(0.1, 0.1, 0.0) - ORIGIN, direction: DVec3::Z, time: 0.0 };
    let met = |limit: f64| {
        let mut met = Vec::new();
        lighting.along(&ray, limit, &wavelengths(), &mut |hit| met.push(hit.light.0));
        met
    };
    assert_eq!(met(f64::INFINITY), [0, 2, 3]);
    assert_eq!(met(5.0), [0, 2]);
    assert_eq!(met(2.0), [] as [u32; 0], "what is before the limit");
}

fn glowing(s: &mut Stagehand, path: &str, color: [f64; 3]) -> usize {
    let material = s.diffuse(path);
    let surface = s.document.materials[material].surface.as_mut().unwrap();
    surface.inputs.insert("emissiveColor".into(), authored("color3f", json!(color)));
    material
}

fn tetrahedron() -> ([[f32; 3]; 4], [&'static [i32]; 4]) {
    (
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [&[0, 2, 1], &[0, 1, 3], &[0, 3, 2], &[1, 2, 3]],
    )
}

/// Meshes, mirrored ones, spheres, boxes, rectangles.
fn glowing_objects() -> Stagehand {
    let mut s = Stagehand::new();
    let glow = glowing(&mut s, "/World/Glow", [2.0, 1.0, 0.5]);
    let (points, faces) = tetrahedron();
    s.mesh("/World/Mesh", &points, &faces, at(-3.0, 0.0, 4.0), Some(glow));
    let mirrored = at(-1.0, 0.0, 4.0) * DMat4::from_scale(DVec3::new(-1.0, 0.7, 1.0));
    s.mesh("/World/Mirrored", &points, &faces, mirrored, Some(glow));
    s.sphere("/World/Ball", 0.5, at(1.0, 0.0, 4.0) * DMat4::from_scale(DVec3::new(1.0, 0.5, 1.0)), Some(glow));
    let turned = at(3.0, 0.0, 4.0) * DMat4::from_rotation_y(0.7);
    s.solid(description::Shape::Cube { path: "/World/Cube".into(), size: 0.8 }, turned, Some(glow));
    let upright = at(0.0, 2.0, 4.0) * DMat4::from_scale(DVec3::new(1.0, 1.5, 0.7));
    let axis = "Y".to_owned();
    let capsule = description::Shape::Capsule {
        path: "/World/Capsule".into(),
        height: 1.0,
        radius_bottom: 0.3,
        radius_top: 0.2,
        axis: axis.clone(),
    };
    s.solid(capsule, upright, Some(glow));
    let cone = description::Shape::Cone { path: "/World/Cone".into(), height: 1.0, radius: 0.4, axis };
    s.solid(cone, at(2.0, 2.0, 4.0), Some(glow));
    s
}

#[test]
fn what_glows_is_sampled_like_a_light() {
    let scene = glowing_objects().build();
    let points = [DVec3::ZERO, DVec3::new(0.0, 0.5, 3.5), DVec3::new(1.0, 8.0, 9.0)];
    let samples = assert_agreement(&scene, &points, None);
    assert!(
        samples.iter().all(|sample| sample.light == LightId(0)),
        "there are no lights, and one material that emits"
    );
    // From inside of what glows on both sides.
    assert_agreement(&scene, &[DVec3::new(1.0, 0.0, 4.0), DVec3::new(3.0, 0.1, 4.0)], None);
}

/// The irradiance of a sphere is the same as a light, as a geometry light and as what glows.
#[test]
fn geometry_that_shines_is_as_bright_as_a_light() {
    let (p, n) = (DVec3::new(0.3, 0.2, 0.0), DVec3::new(0.0, 0.6, 0.8));
    let place = at(1.0, 1.0, 5.0);
    let sent = |scene: &Scene| {
        let view = View::new(scene, ORIGIN);
        // Receivers are the first object, which is not what shines.
        irradiance(&Lighting::new(&view).unwrap(), &receiver(p, Some(n)), n, 10_000)
    };
    let expected = sent(&scene(vec![light("/L", sphere(0.7), place)]));
    let mut s = Stagehand::new();
    s.wall(-50.0, 1.0, None);
    let white = glowing(&mut s, "/World/Glow", [1.0; 3]);
    s.sphere("/World/Ball", 0.7, place, Some(white));
    close(sent(&s.build()), expected, 2e-3, "glow");
    for (normalize, intensity) in [(false, 1.0), (true, 4.0 * PI * 0.49)] {
        let mut s = Stagehand::new();
        s.wall(-50.0, 1.0, None);
        let black = s.diffuse("/World/Black");
        s.sphere("/World/Ball", 0.7, place, Some(black));
        let shape =
            LightShape::Geometry { prims: vec!["/World/Ball".into()], material_sync_mode: "noMaterialResponse".into() };
        let geometry = light("/World/Ball", shape, DMat4::IDENTITY);
        s.document.groups[0].lights = vec![description::Light { normalize, intensity, ..geometry }];
        let scene = s.build();
        close(sent(&scene), expected, 2e-3, "geometry light");
        assert_agreement(&scene, &[p], None);
    }
}

/// Power is π A L: summed over receivers all around a mesh, whose triangles are chosen by a tree.
#[test]
fn a_geometry_light_sends_pi_times_area_times_radiance() {
    let mut s = Stagehand::new();
    let grey = s.diffuse("/World/Grey");
    let (points, faces) = tetrahedron();
    let place = at(0.3, -0.2, 0.1) * DMat4::from_scale(DVec3::new(1.0, 2.0, -0.5));
    s.mesh("/World/Mesh", &points, &faces, place, Some(grey));
    let shape = LightShape::Geometry { prims: vec!["/World/Mesh".into()], material_sync_mode: "independent".into() };
    s.document.groups[0].lights = vec![light("/World/Mesh", shape, DMat4::IDENTITY)];
    let scene = s.build();
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let corners = points.map(|p| place.transform_point3(DVec3::from(p.map(f64::from))));
    let area: f64 = faces
        .iter()
        .map(|f| {
            let [a, b, c] = [f[0], f[1], f[2]].map(|i| corners[i as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    // The flux through a sphere around it, received along the radius.
    let (radius, count) = (6.0, 400);
    let golden = PI * (3.0 - 5f64.sqrt());
    let sum: f64 = (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            let r = (1.0 - z * z).sqrt();
            let d = DVec3::new(r * (golden * f64::from(i)).cos(), r * (golden * f64::from(i)).sin(), z);
            irradiance(&lighting, &receiver(radius * d, None), -d, 200)
        })
        .sum();
    let power = sum / f64::from(count) * 4.0 * PI * radius * radius;
    close(power, PI * area, 1e-2, "power");
    // Its material is what rays see: dark.
    let towards = DVec3::new(0.5, 0.1, 0.05);
    let ray = Ray {
        origin: DVec3::new(5.0, 4.0, 3.0) - ORIGIN,
        direction: (towards - DVec3::new(5.0, 4.0, 3.0)).normalize(),
        time: 0.0,
    };
    let hit = view.intersect(&ray, &Departures::none()).expect("it is there");
    assert_eq!(lighting.emitted(&ray, &hit, &wavelengths()), None);
    let sample = lighting.sample(&receiver(DVec3::new(5.0, 4.0, 3.0), None), &wavelengths(), 0.4, [0.3, 0.6]).unwrap();
    assert!(sample.is_delta && sample.light == LightId(0));
}

#[test]
fn lights_that_are_not_linked_are_never_chosen() {
    let mut s = Stagehand::new();
    let grey = s.diffuse("/World/Grey");
    s.sphere("/World/A", 0.5, at(-2.0, 0.0, 0.0), Some(grey));
    s.sphere("/World/B", 0.5, at(2.0, 0.0, 0.0), Some(grey));
    let set = |name: &str| LinkSet { path: name.into(), excludes: false };
    s.document.link_sets = vec![set("/Only.collection:lightLink"), set("/None.collection:lightLink")];
    s.document.groups[0].items[0].link_sets = vec![0];
    s.document.groups[0].lights = vec![
        description::Light { light_link: Some(0), ..light("/Only", sphere(0.5), at(0.0, 0.0, 5.0)) },
        light("/All", sphere(0.5), at(0.0, 3.0, 5.0)),
        description::Light { light_link: Some(1), ..light("/None", sphere(5.0), at(0.0, 0.0, 9.0)) },
        description::Light { light_link: Some(0), ..light("/Sky", dome(), DMat4::IDENTITY) },
    ];
    let scene = s.build();
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    for (object, allowed) in [(0, &[0, 1, 3][..]), (1, &[1][..])] {
        let receiver = Receiver { object, ..receiver(DVec3::ZERO, None) };
        let mut seen = [false; 4];
        for i in 0..500 {
            let (u_light, u) = numbers(i, 0.0);
            if let Some(sample) = lighting.sample(&receiver, &wavelengths(), u_light, u) {
                seen[sample.light.0 as usize] = true;
            }
        }
        for id in 0..4 {
            assert_eq!(seen[id as usize], allowed.contains(&id), "light {id} for object {object}");
            assert_eq!(lighting.is_linked(LightId(id), object), allowed.contains(&id));
        }
        let ray = Ray { origin: receiver.point, direction: DVec3::Z, time: 0.0 };
        lighting.along(&ray, f64::INFINITY, &wavelengths(), &mut |hit| {
            assert_eq!(lighting.pdf(&receiver, DVec3::Z, &hit) > 0.0, allowed.contains(&hit.light.0));
        });
    }
}

/// A hundred thousand lights: chosen in a few steps, and right.
#[test]
fn many_lights_add_up() {
    let side = 316;
    let lights = (0..side * side)
        .map(|i| {
            let (x, y) = (f64::from(i % side), f64::from(i / side));
            let intensity = 0.5 + f64::from(i % 7);
            let shape = LightShape::Sphere { radius: 0.1, treat_as_point: true };
            description::Light { intensity, ..light(&format!("/L{i}"), shape, at(x, y, 2.0 + f64::from(i % 3))) }
        })
        .collect();
    let scene = scene(lights);
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let (p, n) = (DVec3::new(40.3, 77.7, 0.0), DVec3::Z);
    let exact: f64 = (0..side * side)
        .map(|i| {
            let to = DVec3::new(f64::from(i % side), f64::from(i / side), 2.0 + f64::from(i % 3)) - p;
            (0.5 + f64::from(i % 7)) * PI * 0.01 * to.z / to.length().powi(3)
        })
        .sum();
    let count = 40_000;
    close(irradiance(&lighting, &receiver(p, Some(n)), n, count), exact, 1e-2, "irradiance");
}

/// The colour of a light is what its pixels have: D65 filtered by the colour is that colour.
#[test]
fn colours_come_through_transport() {
    let colored = description::Light { color: [0.9, 0.3, 0.1], intensity: 7.0, ..light("/L", dome(), DMat4::IDENTITY) };
    let scene = scene(vec![colored]);
    let view = View::new(&scene, ORIGIN);
    let lighting = Lighting::new(&view).unwrap();
    let ray = Ray { origin: DVec3::ZERO, direction: DVec3::X, time: 0.0 };
    let mut xyz = DVec3::ZERO;
    let count = 4000;
    for i in 0..count {
        let wavelengths: Wavelengths<4> = visible::sample((f64::from(i) + 0.5) / f64::from(count));
        lighting.environment(&ray, &wavelengths, &mut |hit| {
            for lane in 0..4 {
                let matching = abbe::spectrum::observer::color_matching(wavelengths.lane(lane)).map(f64::from);
                let weight = f64::from(hit.radiance[lane] / wavelengths.pdf_lambda()[lane]) / 4.0 / f64::from(count);
                xyz += weight * DVec3::from(matching);
            }
        });
    }
    // IEC 61966-2-1, to Rec. 709.
    let rgb = [
        3.240_97 * xyz.x - 1.537_38 * xyz.y - 0.498_61 * xyz.z,
        -0.969_24 * xyz.x + 1.875_97 * xyz.y + 0.041_56 * xyz.z,
        0.055_63 * xyz.x - 0.203_98 * xyz.y + 1.056_97 * xyz.z,
    ];
    for (found, expected) in rgb.into_iter().zip([6.3, 2.1, 0.7]) {
        assert!((found - expected).abs() < 1e-2, "{rgb:?}");
    }
    assert!(matches!(lighting.light(LightId(0)).unwrap().shape, Shape::Dome(_)));
}
