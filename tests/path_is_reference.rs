//! `path` against `reference`, the slow truth, for every material, light and camera.
//!
//! Both render the picture in X, Y, Z (what R, G, B are told apart by costs noise and tells nothing about transport), and the
//! difference is compared with its standard error: pixel by pixel, in quarters of the picture and in the whole. Each test states
//! the standard error of the whole and is held to that: 0.5 % for materials and lights that are not natural, 1 % for lights
//! (which `reference` must meet by chance), cameras and glass that glows.

mod support;

use std::f64::consts::PI;

use abbe::film::Film;
use abbe::integrator::Registry;
use abbe::render::{Control, Request, render};
use abbe::scene::Scene;
use abbe::scene::description::{Light, LightShadow, LightShape, LightShaping, LinkSet};
use abbe::spectrum::sensor::ColorSpace;
use glam::{DMat4, DVec3};
use serde_json::json;
use support::transport::{
    at, color, color_request, dome, glowing_picture, image, lambert, light, number, open_pbr, soft_lights, sphere,
    still_life, values,
};
use support::{BK7, SF11, Stagehand, authored, the_plan};

const WIDTH: u32 = 8;
const HEIGHT: u32 = 4;

/// X, Y, Z of every pixel, or sums over some of them, with their variances.
#[derive(Clone, Copy, Default)]
struct Estimate {
    value: [f64; 3],
    variance: [f64; 3],
}

impl Estimate {
    fn of_each_pixel(film: &Film) -> Vec<Self> {
        let (color, variance) = (values(film, "color").chunks_exact(4), values(film, "variance").chunks_exact(3));
        let three = |values: &[f32]| std::array::from_fn(|i| f64::from(values[i]));
        color.zip(variance).map(|(color, variance)| Self { value: three(color), variance: three(variance) }).collect()
    }

    fn sum(pixels: &[Self], is_in: impl Fn(u32, u32) -> bool) -> Self {
        let mut sum = Self::default();
        for (pixel, _) in pixels.iter().zip(0..).filter(|(_, index)| is_in(index % WIDTH, index / WIDTH)) {
            for i in 0..3 {
                sum.value[i] += pixel.value[i];
                sum.variance[i] += pixel.variance[i];
            }
        }
        sum
    }
}

/// How much work a comparison is worth.
#[derive(Clone, Copy)]
struct Effort {
    /// Samples a pixel of `path`, of `reference`.
    samples: [u32; 2],
    /// Standard error of the ratio of both pictures' Y, at most; X and Z have up to twice as much. An error of the whole picture
    /// that is six times as large is found with a probability of 93 %.
    error: f64,
}

/// `path` and `reference` agree, pixel by pixel, in quarters of the picture and in the whole.
///
/// With some fifty pictures |z| = 5.5 is met by chance in a pixel in one of 5000 runs of the whole file, |z| = 4.5 in a quarter
/// or a whole in one of 200; seeds are fixed, so that only a change of the bits throws the dice again.
fn assert_agree(name: &str, scene: &Scene, Effort { samples, error }: Effort) {
    let seed = name.bytes().fold(7, |hash: u64, byte| hash.wrapping_mul(31) + u64::from(byte));
    let [a, b] = [("path", samples[0], 0), ("reference", samples[1], seed)].map(|(integrator, samples, seed)| {
        let request = Request { seed: Some(seed), ..color_request(WIDTH, HEIGHT, samples, integrator) };
        let mut plan = the_plan(scene, &request);
        plan.color_space = ColorSpace::Xyz;
        let rendered = render(scene, &plan, &Registry::default(), &Control::none()).unwrap_or_else(|e| panic!("{e}"));
        Estimate::of_each_pixel(&rendered.film)
    });
    let whole = [&a, &b].map(|pixels| Estimate::sum(pixels, |_, _| true));
    let compare = |place: &str, [a, b]: [Estimate; 2], floor: [f64; 3], largest: f64| {
        for i in 0..3 {
            let z = (a.value[i] - b.value[i]) / (a.variance[i] + b.variance[i]).max(floor[i]).sqrt();
            let channel = ["X", "Y", "Z"][i];
            let (a, b) = (a.value[i], b.value[i]);
            assert!(z.abs() < largest, "{name}: {channel} of {place}: {a} instead of {b}, z = {z:.2}");
        }
    };
    let relative = |i: usize| (whole[0].variance[i] + whole[1].variance[i]).sqrt() / whole[1].value[i];
    for (i, bound) in [2.0 * error, error, 2.0 * error].into_iter().enumerate() {
        assert!(relative(i) <= bound, "{name}: a standard error of {} is too large", relative(i));
    }
    compare("the picture", whole, [0.0; 3], 4.5);
    for (right, lower) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let is_in = |x: u32, y: u32| x / (WIDTH / 2) == right && y / (HEIGHT / 2) == lower;
        let quarter = [&a, &b].map(|pixels| Estimate::sum(pixels, is_in));
        compare(&format!("quarter {right} {lower}"), quarter, [0.0; 3], 4.5);
    }
    // What is rarely met has a variance that a pixel's own samples may not know. Those of its neighbours do: none is taken to be
    // much more certain than the picture is in the mean.
    let pixels = f64::from(WIDTH * HEIGHT);
    let floor = std::array::from_fn(|i| 0.25 * (whole[0].variance[i] + whole[1].variance[i]) / pixels);
    for (index, (a, b)) in a.iter().zip(&b).enumerate() {
        compare(&format!("pixel {index}"), [*a, *b], floor, 5.5);
    }
}

#[test]
fn path_is_reference_for_every_material() {
    let glass = |s: &mut Stagehand, law| s.glass("/World/Glass", law);
    type Make = Box<dyn FnOnce(&mut Stagehand) -> usize>;
    let materials: Vec<(&str, Make)> = vec![
        ("Lambert", Box::new(|s| lambert(s, 0.7))),
        (
            "rough diffuse",
            Box::new(|s| {
                let inputs = [("base_diffuse_roughness", number(0.8)), ("specular_weight", number(0.0))];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "plastic",
            Box::new(|s| open_pbr(s, &[("base_color", color([0.1, 0.4, 0.8])), ("specular_roughness", number(0.3))])),
        ),
        ("smooth plastic", Box::new(|s| open_pbr(s, &[("specular_roughness", number(0.0))]))),
        (
            "rough metal",
            Box::new(|s| {
                let inputs = [
                    ("base_metalness", number(1.0)),
                    ("base_color", color([0.9, 0.6, 0.3])),
                    ("specular_roughness", number(0.4)),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        ("mirror", Box::new(|s| open_pbr(s, &[("base_metalness", number(1.0)), ("specular_roughness", number(0.0))]))),
        ("clear glass", Box::new(|s| s.constant_glass("/World/Glass", 1.5))),
        ("BK7", Box::new(move |s| glass(s, BK7))),
        ("SF11", Box::new(move |s| glass(s, SF11))),
        (
            "frosted glass",
            Box::new(|s| open_pbr(s, &[("transmission_weight", number(1.0)), ("specular_roughness", number(0.35))])),
        ),
        (
            "frosted glass that disperses",
            Box::new(|s| {
                let inputs = [
                    ("transmission_weight", number(1.0)),
                    ("specular_roughness", number(0.3)),
                    ("specular_ior", number(1.8)),
                    ("transmission_dispersion_scale", number(1.0)),
                    ("transmission_dispersion_abbe_number", number(20.0)),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "tinted glass",
            Box::new(|s| {
                let inputs = [
                    ("transmission_weight", number(1.0)),
                    ("specular_roughness", number(0.0)),
                    ("transmission_color", color([0.3, 0.8, 0.5])),
                    ("transmission_depth", number(1.0)),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "thin wall",
            Box::new(|s| {
                let inputs = [
                    ("transmission_weight", number(1.0)),
                    ("specular_roughness", number(0.0)),
                    ("geometry_thin_walled", authored("bool", json!(true))),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "coat",
            Box::new(|s| {
                let inputs = [
                    ("base_color", color([0.6, 0.1, 0.1])),
                    ("coat_weight", number(1.0)),
                    ("coat_roughness", number(0.2)),
                    ("coat_color", color([0.9, 0.9, 0.5])),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "fuzz",
            Box::new(|s| {
                let inputs = [("fuzz_weight", number(0.8)), ("fuzz_roughness", number(0.5))];
                open_pbr(s, &inputs)
            }),
        ),
        (
            "thin film",
            Box::new(|s| {
                let inputs = [
                    ("base_metalness", number(1.0)),
                    ("specular_roughness", number(0.2)),
                    ("thin_film_weight", number(1.0)),
                    ("thin_film_thickness", number(0.5)),
                ];
                open_pbr(s, &inputs)
            }),
        ),
        ("half there", Box::new(|s| open_pbr(s, &[("geometry_opacity", number(0.5))]))),
        (
            "glowing",
            Box::new(|s| {
                open_pbr(s, &[("emission_luminance", number(2.0)), ("emission_color", color([1.0, 0.5, 0.2]))])
            }),
        ),
        (
            "UsdPreviewSurface",
            Box::new(|s| {
                let inputs =
                    [("diffuseColor", color([0.2, 0.5, 0.3])), ("roughness", number(0.4)), ("clearcoat", number(0.5))];
                s.surface("/World/Preview", "UsdPreviewSurface", &inputs, &[])
            }),
        ),
        (
            "half metal",
            Box::new(|s| {
                let inputs = [("metallic", number(0.5)), ("roughness", number(0.3))];
                s.surface("/World/Preview", "UsdPreviewSurface", &inputs, &[])
            }),
        ),
    ];
    let effort = Effort { samples: [1024, 16384], error: 0.005 };
    for (name, material) in materials {
        assert_agree(name, &still_life(material, soft_lights()).build(), effort);
    }
    let glowing_glass = |s: &mut Stagehand| {
        let inputs = [
            ("transmission_weight", number(1.0)),
            ("specular_roughness", number(0.4)),
            ("emission_luminance", number(1.0)),
            ("emission_color", color([1.0, 0.5, 0.2])),
        ];
        open_pbr(s, &inputs)
    };
    // What is seen far into the glass, of many bounces, comes with noise.
    let effort = Effort { samples: [2048, 4096], error: 0.012 };
    assert_agree("glowing frosted glass", &still_life(glowing_glass, soft_lights()).build(), effort);
}

#[test]
fn path_is_reference_for_every_light() {
    let down = DMat4::from_rotation_x(-PI / 2.0);
    let shapes: Vec<(&str, LightShape, DMat4, f64)> = vec![
        ("dome", dome(), DMat4::IDENTITY, 1.0),
        ("sun", LightShape::Distant { angle: 100.0 }, DMat4::from_rotation_x(-0.9), 0.3),
        ("parallel light", LightShape::Distant { angle: 0.0 }, DMat4::from_rotation_x(-0.9), 2.0),
        ("rectangle", LightShape::Rect { width: 10.0, height: 8.0, texture: None }, at(0.0, 4.0, 1.0) * down, 0.6),
        ("disk", LightShape::Disk { radius: 5.0 }, at(0.0, 4.0, 1.0) * down, 0.6),
        ("sphere", sphere(2.5), at(3.0, 4.0, 1.0), 1.0),
        ("ellipsoid", sphere(2.0), at(3.0, 4.0, 1.0) * DMat4::from_scale(DVec3::new(1.5, 0.7, 1.2)), 1.0),
        ("cylinder", LightShape::Cylinder { length: 8.0, radius: 2.0, treat_as_line: false }, at(0.0, 4.0, 1.5), 1.0),
        ("point", LightShape::Sphere { radius: 0.5, treat_as_point: true }, at(2.0, 3.0, 2.0), 10.0),
        ("line", LightShape::Cylinder { length: 3.0, radius: 0.5, treat_as_line: true }, at(0.0, 3.0, 2.0), 8.0),
        (
            "ball that shines",
            LightShape::Geometry { prims: vec!["/World/Ball".into()], material_sync_mode: "noMaterialResponse".into() },
            DMat4::IDENTITY,
            2.0,
        ),
    ];
    let effort = Effort { samples: [2048, 24576], error: 0.01 };
    for (name, shape, transform, intensity) in shapes {
        let lamp = Light { intensity, ..light("/World/Lamp", shape, transform) };
        assert_agree(name, &still_life(|s| lambert(s, 0.6), vec![lamp]).build(), effort);
    }
}

#[test]
fn path_is_reference_for_shaped_and_coloured_light_of_many_lamps() {
    let shaping = LightShaping {
        focus: 2.0,
        focus_tint: [0.2, 0.0, 0.4],
        cone_angle: 50.0,
        cone_softness: 0.5,
        ies: None,
        ies_angle_scale: 0.0,
        ies_normalize: false,
    };
    let look_down = at(0.0, 4.0, 1.0) * DMat4::from_rotation_x(-PI / 2.0);
    let spot = Light {
        intensity: 20.0,
        shaping: Some(shaping),
        ..light("/World/Spot", LightShape::Disk { radius: 1.0 }, look_down)
    };
    let mut lamps = vec![spot];
    for i in 0..20 {
        let phi = f64::from(i) * 2.4;
        let place = at(3.0 * phi.cos(), 2.5 + 0.1 * f64::from(i), 3.0 * phi.sin());
        let color = [0.5 + 0.5 * phi.sin(), 0.6, 0.5 + 0.5 * phi.cos()];
        lamps.push(Light { intensity: 1.0, color, ..light(&format!("/World/Lamp{i}"), sphere(0.7), place) });
    }
    lamps.push(Light { intensity: 0.2, ..light("/World/Dome", dome(), DMat4::IDENTITY) });
    let scene = still_life(|s| open_pbr(s, &[("specular_roughness", number(0.3))]), lamps).build();
    assert_agree("many lamps", &scene, Effort { samples: [2048, 24576], error: 0.01 });
}

/// A lamp that treats materials and objects differently, and not as nature has it.
#[test]
fn path_is_reference_for_light_that_is_not_natural() {
    let lamp = || Light { intensity: 1.5, ..light("/World/Lamp", sphere(2.4), at(4.0, 4.5, 2.0)) };
    let shadow =
        LightShadow { enable: true, color: [0.2, 0.4, 0.1], distance: -1.0, falloff: -1.0, falloff_gamma: 1.0 };
    let lamps = [
        ("factors", Light { diffuse: 0.3, specular: 2.0, ..lamp() }),
        ("light link", Light { light_link: Some(0), ..lamp() }),
        ("shadow link", Light { shadow_link: Some(0), ..lamp() }),
        ("coloured shadows", Light { shadow: Some(shadow.clone()), ..lamp() }),
        ("short shadows", Light { shadow: Some(LightShadow { distance: 3.0, falloff: 1.5, ..shadow }), ..lamp() }),
    ];
    let effort = Effort { samples: [1024, 8192], error: 0.006 };
    for (name, lamp) in lamps {
        for (of, roughness) in [("plastic", 0.3), ("smooth plastic", 0.0)] {
            let dome = Light { intensity: 0.2, ..light("/World/Dome", dome(), DMat4::IDENTITY) };
            let mut s =
                still_life(|s| open_pbr(s, &[("specular_roughness", number(roughness))]), vec![lamp.clone(), dome]);
            s.document.link_sets = vec![LinkSet { path: "/World/Lamp.collection:link".into(), excludes: true }];
            let ball = s.document.groups[0].items.iter_mut().find(|item| item.path == "/World/Ball").unwrap();
            ball.link_sets = vec![0];
            assert_agree(&format!("{name}, {of}"), &s.build(), effort);
        }
    }
}

/// What glass gathers on the wall behind it may be found by ways of its own: they must know what lamps are told.
#[test]
fn path_is_reference_for_focused_light() {
    let lamp = || Light { intensity: 4.0, ..light("/World/Lamp", sphere(1.2), at(2.0, 4.0, 3.5)) };
    let shadow = LightShadow { enable: false, color: [0.0; 3], distance: -1.0, falloff: -1.0, falloff_gamma: 1.0 };
    let lamps = [
        ("plain", lamp()),
        ("factors", Light { diffuse: 0.3, specular: 2.0, ..lamp() }),
        ("light link", Light { light_link: Some(0), ..lamp() }),
        ("shadow link", Light { shadow_link: Some(0), ..lamp() }),
        ("no shadows", Light { shadow: Some(shadow), ..lamp() }),
        ("rectangle", {
            let down = at(0.0, 4.0, 2.0) * DMat4::from_rotation_x(-PI / 2.0);
            Light {
                intensity: 4.0,
                ..light("/World/Lamp", LightShape::Rect { width: 2.0, height: 2.5, texture: None }, down)
            }
        }),
    ];
    let effort = Effort { samples: [2048, 32768], error: 0.015 };
    for (name, lamp) in lamps {
        let dome = Light { intensity: 0.05, ..light("/World/Dome", dome(), DMat4::IDENTITY) };
        let mut s = still_life(|s| s.glass("/World/Glass", SF11), vec![lamp, dome]);
        s.document.link_sets = vec![LinkSet { path: "/World/Lamp.collection:link".into(), excludes: true }];
        let ball = s.document.groups[0].items.iter_mut().find(|item| item.path == "/World/Ball").unwrap();
        ball.link_sets = vec![0];
        assert_agree(&format!("focused, {name}"), &s.build(), effort);
    }
}

/// Light by way of a pane and of the varnish behind it: surfaces with a smooth lobe beside others end what is looked for.
#[test]
fn path_is_reference_for_varnish_behind_glass() {
    let mut s = Stagehand::new();
    let (grey, black) = (lambert(&mut s, 0.6), lambert(&mut s, 0.0));
    let varnish = open_pbr(
        &mut s,
        &[("base_color", color([0.02; 3])), ("specular_roughness", number(0.0)), ("specular_ior", number(4.0))],
    );
    let pane = open_pbr(
        &mut s,
        &[
            ("transmission_weight", number(1.0)),
            ("specular_roughness", number(0.0)),
            ("geometry_thin_walled", authored("bool", json!(true))),
        ],
    );
    let mut quad = |path: &str, corners: [[f32; 3]; 4], material| {
        s.mesh(path, &corners, &[&[0, 1, 2, 3]], DMat4::IDENTITY, Some(material));
    };
    quad("/World/Floor", [[-5.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 0.0, -3.0], [-5.0, 0.0, -3.0]], grey);
    let upright = |z: f32| [[-3.0, 0.3, z], [3.0, 0.3, z], [3.0, 5.0, z], [-3.0, 5.0, z]];
    quad("/World/Varnish", upright(-1.0), varnish);
    quad("/World/Pane", upright(-0.9), pane);
    // Between the lamp and the floor.
    quad("/World/Card", [[-5.0, 1.5, 5.0], [5.0, 1.5, 5.0], [5.0, 1.5, 0.7], [-5.0, 1.5, 0.7]], black);
    s.camera(DVec3::new(0.0, 6.0, 0.3), DVec3::new(0.0, 0.0, 0.2));
    s.document.cameras[0].focal_length = 200.0;
    s.document.groups[0].lights =
        vec![Light { intensity: 4.0, ..light("/World/Lamp", sphere(1.3), at(0.0, 3.5, 3.0)) }];
    assert_agree("varnish behind a pane", &s.build(), Effort { samples: [8192, 131_072], error: 0.03 });
}

/// Where a surface bounds no other medium than there was, rays go straight on, and shadow rays do not.
#[test]
fn path_is_reference_for_water_in_water() {
    let lamp = Light { intensity: 4.0, ..light("/World/Lamp", sphere(1.2), at(2.0, 4.0, 3.5)) };
    let mut water = 0;
    let mut s = still_life(
        |s| {
            water = s.constant_glass("/World/Water", 1.33);
            water
        },
        vec![lamp],
    );
    s.sphere("/World/Sea", 30.0, DMat4::IDENTITY, Some(water));
    assert_agree("water in water", &s.build(), Effort { samples: [2048, 32768], error: 0.02 });
}

#[test]
fn path_is_reference_for_light_with_a_picture_on_it() {
    let pixel = |x: u32, y: u32| if (x / 2 + y / 3).is_multiple_of(2) { [255, 200, 40] } else { [10, 30, 120] };
    let effort = Effort { samples: [2048, 24576], error: 0.01 };
    let down = at(0.0, 4.0, 1.0) * DMat4::from_rotation_x(-PI / 2.0);
    let mut s = still_life(|s| lambert(s, 0.6), Vec::new());
    let texture = Some(image(&mut s, 16, pixel));
    let lamp = LightShape::Rect { width: 10.0, height: 8.0, texture };
    s.document.groups[0].lights = vec![light("/World/Lamp", lamp, down)];
    assert_agree("rectangle with a picture", &s.build(), effort);
    let mut s = still_life(|s| lambert(s, 0.6), Vec::new());
    let texture = image(&mut s, 16, pixel);
    let glow = glowing_picture(&mut s, texture);
    s.unit_square("/World/Screen", down * DMat4::from_scale(DVec3::new(5.0, 4.0, 1.0)), glow);
    assert_agree("screen", &s.build(), effort);
}

#[test]
fn path_is_reference_for_every_camera() {
    let scene = |camera: &dyn Fn(&mut abbe::scene::description::Camera)| {
        let mut s = still_life(|s| s.glass("/World/Glass", SF11), soft_lights());
        camera(&mut s.document.cameras[0]);
        s.build()
    };
    let effort = Effort { samples: [1024, 16384], error: 0.009 };
    assert_agree("lens", &scene(&|camera| (camera.f_stop, camera.focus_distance) = (0.2, 5.0)), effort);
    assert_agree(
        "orthographic",
        &scene(&|camera| {
            camera.projection = "orthographic".into();
            (camera.horizontal_aperture, camera.vertical_aperture) = (40.0, 20.0);
        }),
        effort,
    );
    let under_glass = {
        let mut s = still_life(|s| s.glass("/World/Glass", SF11), soft_lights());
        let around = s.constant_glass("/World/Water", 1.33);
        s.sphere("/World/Sea", 3.5, at(0.2, 0.5, 5.0), Some(around));
        s.build()
    };
    assert_agree("under glass", &under_glass, effort);
}
