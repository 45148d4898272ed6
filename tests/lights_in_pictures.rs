//! What lights and glowing materials are told to do, as pictures by `path` show it: closed forms.

mod support;

use std::f64::consts::PI;

use abbe::render::Request;
use abbe::scene::description::{Light, LightShadow, LightShape, LinkSet, Shape};
use glam::{DMat4, DVec3};
use support::transport::{
    at, color, color_request, glowing_picture, image, lambert, light, mean, number, open_pbr, sphere, values,
};
use support::{Stagehand, rendered};

/// The floor z = 0, and a camera that looks at so little of it about the origin that it is a point.
fn floor(material: impl FnOnce(&mut Stagehand) -> usize) -> Stagehand {
    let mut s = Stagehand::new();
    let material = material(&mut s);
    s.wall(0.0, 50.0, Some(material));
    s.camera(DVec3::new(0.5, 0.0, 6.0), DVec3::ZERO);
    s.document.cameras[0].focal_length = 3.5e4;
    s
}

fn grey_floor() -> Stagehand {
    floor(|s| lambert(s, 0.5))
}

fn mirror(s: &mut Stagehand) -> usize {
    let white = [("base_metalness", number(1.0)), ("base_color", color([1.0; 3])), ("specular_roughness", number(0.0))];
    open_pbr(s, &white)
}

/// What the camera sees of the floor.
fn seen(s: Stagehand) -> [f64; 3] {
    mean(&rendered(&s.build(), &color_request(4, 4, 1024, "path")).film).0
}

fn assert_seen(s: Stagehand, expected: [f64; 3], what: &str) {
    let (found, largest) = (seen(s), expected.into_iter().fold(0.0, f64::max));
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found - expected).abs() <= 6e-3 * largest + 1e-9, "{what}: {found} instead of {expected}");
    }
}

/// A disk of radius 3/2 over the floor at a height of 2, and the part that it is of all that the floor sees, weighed by cosines.
fn lamp() -> Light {
    light("/World/Lamp", LightShape::Disk { radius: 1.5 }, at(0.0, 0.0, 2.0))
}
const FORM_FACTOR: f64 = 2.25 / (2.25 + 4.0);

#[test]
fn factors_multiply_what_lobes_receive() {
    let told = || Light { diffuse: 0.25, specular: 3.0, ..lamp() };
    let mut s = grey_floor();
    s.document.groups[0].lights = vec![told()];
    assert_seen(s, [0.25 * 0.5 * FORM_FACTOR; 3], "diffuse");
    let mut s = floor(mirror);
    s.document.groups[0].lights = vec![told()];
    assert_seen(s, [3.0; 3], "mirror");
    // Rough, and so wide a lamp that nothing of the lobe misses it.
    let rough = |s: &mut Stagehand| {
        let inputs =
            [("base_metalness", number(1.0)), ("base_color", color([1.0; 3])), ("specular_roughness", number(0.2))];
        open_pbr(s, &inputs)
    };
    let mut ratio = [told(), lamp()].map(|lamp| {
        let mut s = floor(rough);
        s.document.groups[0].lights = vec![lamp];
        seen(s)[1]
    });
    ratio[0] /= ratio[1];
    assert!((ratio[0] - 3.0).abs() < 1e-2, "rough metal: {}", ratio[0]);
    // The camera is no material.
    let mut s = Stagehand::new();
    s.camera(DVec3::ZERO, DVec3::Z);
    s.document.cameras[0].focal_length = 3.5e4;
    s.document.groups[0].lights = vec![told()];
    assert_seen(s, [1.0; 3], "seen by itself");
}

#[test]
fn lights_reach_what_they_are_linked_to() {
    for (what, material, alone) in [
        ("diffuse", (|s: &mut Stagehand| lambert(s, 0.5)) as fn(&mut Stagehand) -> usize, 0.5 * FORM_FACTOR),
        ("mirror", mirror, 1.0),
    ] {
        for excludes in [true, false] {
            let mut s = floor(material);
            s.document.link_sets = vec![LinkSet { path: "/World/Lamp.collection:lightLink".into(), excludes }];
            // As one that is not in the collection, and as the only one that is.
            s.document.groups[0].items[0].link_sets = vec![0];
            s.document.groups[0].lights = vec![Light { light_link: Some(0), intensity: 5.0, ..lamp() }, lamp()];
            let expected = if excludes { alone } else { 6.0 * alone };
            assert_seen(s, [expected; 3], &format!("{what}, excludes: {excludes}"));
        }
    }
}

#[test]
fn shadows_are_as_they_are_told() {
    let shadow = |color, distance| LightShadow { enable: true, color, distance, falloff: -1.0, falloff_gamma: 1.0 };
    let [natural, off] = [true, false].map(|enable| LightShadow { enable, ..shadow([0.0; 3], -1.0) });
    let full = 0.5 * 0.25 * 0.25;
    for (what, lamp, expected) in [
        ("natural", (None, Some(natural)), [0.0; 3]),
        ("not linked", (Some(0), None), [full; 3]),
        ("off", (None, Some(off)), [full; 3]),
        ("coloured", (None, Some(shadow([0.2, 0.5, 0.3], -1.0))), [0.2, 0.5, 0.3].map(|c: f64| c * full)),
        ("too far", (None, Some(shadow([0.0; 3], 0.9))), [full; 3]),
        ("near enough", (None, Some(shadow([0.0; 3], 1.5))), [0.0; 3]),
    ] {
        let mut s = grey_floor();
        let black = lambert(&mut s, 0.0);
        let slab = DMat4::from_scale(DVec3::new(40.0, 40.0, 0.1));
        s.solid(Shape::Cube { path: "/World/Blocker".into(), size: 1.0 }, at(0.0, 0.0, 1.1) * slab, Some(black));
        // Below the blocker.
        s.document.cameras.clear();
        s.camera(DVec3::new(3.0, 0.5, 0.8), DVec3::ZERO);
        s.document.cameras[0].focal_length = 3.5e4;
        s.document.link_sets = vec![LinkSet { path: "/World/Lamp.collection:shadowLink".into(), excludes: true }];
        s.document.groups[0].items[1].link_sets = vec![0];
        let (shadow_link, shadow) = lamp;
        let ball = light("/World/Lamp", sphere(0.5), at(0.0, 0.0, 2.0));
        s.document.groups[0].lights = vec![Light { shadow_link, shadow, ..ball }];
        assert_seen(s, expected, what);
    }
}

/// The part that a rectangle from a point's foot to (x, y), at a height of 1, is of what the point sees, weighed by cosines.
fn corner(x: f64, y: f64) -> f64 {
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    (part(x, y) + part(y, x)) / (2.0 * PI)
}

#[test]
fn pictures_shine_from_where_they_are_bright() {
    // Its left half is (1, 0.2159, 0) in linear light, its right half black.
    let half = |s: &mut Stagehand| image(s, 64, |x, _| if x < 32 { [255, 128, 0] } else { [0; 3] });
    let linear = [1.0, 0.215_860_5, 0.0];
    let lamp = |s: &mut Stagehand| {
        let texture = Some(half(s));
        // Seen from below its left is at larger x, and over the point is the middle of that half's outer side.
        let shape = LightShape::Rect { width: 4.0, height: 2.0, texture };
        s.document.groups[0].lights.push(light("/World/Lamp", shape, at(-2.0, 0.0, 2.0)));
    };
    let screen = |s: &mut Stagehand| {
        let texture = half(s);
        let glow = glowing_picture(s, texture);
        s.unit_square("/World/Screen", at(-2.0, 0.0, 2.0) * DMat4::from_scale(DVec3::new(2.0, 1.0, 1.0)), glow);
    };
    for (what, place) in [("lamp", &lamp as &dyn Fn(&mut Stagehand)), ("screen", &screen)] {
        let mut s = grey_floor();
        place(&mut s);
        s.document.cameras.clear();
        s.camera(DVec3::new(1.5, 0.0, 1.5), DVec3::ZERO);
        s.document.cameras[0].focal_length = 3.5e4;
        assert_seen(s, linear.map(|c| c * 0.5 * 2.0 * corner(1.0, 0.5)), what);
        // And are what the camera sees.
        for (x, expected) in [(-1.0, linear), (-3.0, [0.0; 3])] {
            let mut s = Stagehand::new();
            place(&mut s);
            s.camera(DVec3::new(x, 0.0, 0.5), DVec3::new(x, 0.0, 2.0));
            s.document.cameras[0].focal_length = 3.5e4;
            assert_seen(s, expected, &format!("{what} at {x}"));
        }
    }
}

#[test]
fn geometry_lights_and_materials_go_together_as_the_light_says() {
    let (glow, tint) = ([1.0, 0.5, 0.25], [0.4, 0.8, 2.0]);
    let product = [0, 1, 2].map(|i| glow[i] * tint[i]);
    let sum = [0, 1, 2].map(|i| glow[i] + tint[i]);
    // What the floor receives, and what the camera sees: where both go their own way, floors see the material, too.
    for (mode, sent, shown) in
        [("materialGlowTintsLight", product, product), ("independent", sum, glow), ("noMaterialResponse", tint, tint)]
    {
        for camera_sees in [false, true] {
            let mut s = grey_floor();
            let inputs = [("diffuseColor", color([0.0; 3])), ("emissiveColor", color(glow))];
            let material = s.surface("/World/Glow", "UsdPreviewSurface", &inputs, &[]);
            s.sphere("/World/Ball", 0.7, at(0.0, 0.0, 2.0), Some(material));
            let shape = LightShape::Geometry { prims: vec!["/World/Ball".into()], material_sync_mode: mode.into() };
            s.document.groups[0].lights = vec![Light { color: tint, ..light("/World/Lamp", shape, DMat4::IDENTITY) }];
            s.document.cameras.clear();
            let target = if camera_sees { DVec3::new(0.0, 0.0, 2.0) } else { DVec3::ZERO };
            s.camera(DVec3::new(3.0, 0.5, 1.0), target);
            s.document.cameras[0].focal_length = 3.5e4;
            let expected = if camera_sees { shown } else { sent.map(|c| c * 0.5 * 0.49 / 4.0) };
            assert_seen(s, expected, &format!("{mode}, seen: {camera_sees}"));
        }
    }
}

#[test]
fn convex_things_that_glow_do_not_light_themselves() {
    let path = || "/World/Thing".to_owned();
    let turned = DMat4::from_rotation_x(0.3) * DMat4::from_rotation_y(0.7) * at(0.1, -0.2, 0.3);
    let shapes = [
        ("sphere", Shape::Sphere { path: path(), radius: 1.0 }),
        ("cube", Shape::Cube { path: path(), size: 1.7 }),
        (
            "cylinder",
            Shape::Cylinder { path: path(), height: 2.0, radius_bottom: 1.0, radius_top: 1.0, axis: "Z".into() },
        ),
        ("cone", Shape::Cone { path: path(), height: 2.0, radius: 1.0, axis: "Z".into() }),
    ];
    for (name, shape) in shapes {
        for stretch in [DVec3::ONE, DVec3::new(1.0, 0.6, 1.3)] {
            let mut s = Stagehand::new();
            let inputs = [("diffuseColor", color([0.8; 3])), ("emissiveColor", color([1.0, 0.5, 0.2]))];
            let glow = s.surface("/World/Glow", "UsdPreviewSurface", &inputs, &[]);
            s.solid(shape.clone(), turned * DMat4::from_scale(stretch), Some(glow));
            s.camera(DVec3::new(0.3, 0.5, 4.0), DVec3::ZERO);
            let scene = s.build();
            let all = color_request(12, 8, 64, "path");
            let emitted = Request { max_depth: Some(0), ..all.clone() };
            let [all, emitted] = [all, emitted].map(|request| rendered(&scene, &request).film);
            let pairs = values(&all, "color").iter().zip(values(&emitted, "color"));
            let most = pairs.map(|(all, emitted)| (all - emitted).abs()).fold(0.0, f32::max);
            assert!(most <= 0.0, "{name} {stretch}: {most}");
        }
    }
}
