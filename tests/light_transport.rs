//! Laws of light transport: `path` against closed forms, and that nothing but the scene decides a bit.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use std::f64::consts::PI;

use abbe::render::Request;
use abbe::scene::Scene;
use abbe::scene::description::LightShape;
use glam::{DMat4, DVec3};
use serde_json::json;
use support::transport::{
    at, color, color_request, dome, lambert, light, mean, number, soft_lights, sphere, still_life, values,
};
use support::{BK7, SF11, Stagehand, authored, rendered, request};

/// A patch of floor with albedo ½, seen so narrowly that it is a point, under one lamp at a height of 2.
fn lit_point(shape: LightShape) -> f64 {
    let mut s = Stagehand::new();
    let white = lambert(&mut s, 0.5);
    s.wall(0.0, 50.0, Some(white));
    s.camera(DVec3::new(3.0, 0.5, 6.0), DVec3::ZERO);
    s.document.cameras[0].focal_length = 3.5e4;
    // The wall faces +z, and the lamp shines along its own −z.
    s.document.groups[0].lights = vec![light("/World/Lamp", shape, at(0.0, 0.0, 2.0))];
    let film = rendered(&s.build(), &color_request(4, 4, 1024, "path")).film;
    let ([r, g, b], _) = mean(&film);
    // A white light on grey is grey to the noise of the companions' stratification.
    assert!((r - g).abs() < 4e-3 * g && (b - g).abs() < 4e-3 * g, "{r} {g} {b}");
    g
}

#[test]
fn irradiance_of_lamps_is_that_of_their_form_factors() {
    let near = |found: f64, form_factor: f64, name: &str| {
        let expected = 0.5 * form_factor;
        assert!((found / expected - 1.0).abs() < 5e-3, "{name}: {found} instead of {expected}");
    };
    // E = π L F; F of a sphere (r/h)², of a disk r²/(r² + h²), of a rectangle about the axis by its quarter.
    near(lit_point(sphere(0.7)), 0.49 / 4.0, "sphere");
    near(lit_point(LightShape::Disk { radius: 1.5 }), 2.25 / (2.25 + 4.0), "disk");
    let (x, y) = (1.5f64 / 2.0, 0.5f64 / 2.0);
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    let quarter = (part(x, y) + part(y, x)) / (2.0 * PI);
    near(lit_point(LightShape::Rect { width: 3.0, height: 1.0, texture: None }), 4.0 * quarter, "rectangle");
    near(lit_point(dome()), 1.0, "dome");
    // ∫ cos dω over the cone of half angle 20°, over π.
    let sine = 20f64.to_radians().sin();
    near(lit_point(LightShape::Distant { angle: 40.0 }), sine * sine, "sun");
    near(lit_point(LightShape::Distant { angle: 0.0 }), 1.0 / PI, "parallel light");
    // A point with the intensity of its ball: π r² L / h² / π.
    near(lit_point(LightShape::Sphere { radius: 0.5, treat_as_point: true }), 0.25 / 4.0, "point");
}

#[test]
fn an_integrating_sphere_multiplies_light_by_one_over_one_minus_albedo() {
    let (albedo, radius, lamp) = (0.8, 2.0, 0.25);
    let mut s = Stagehand::new();
    let wall = lambert(&mut s, albedo);
    s.sphere("/World/Sphere", radius, DMat4::IDENTITY, Some(wall));
    s.camera(DVec3::new(0.9, 0.3, 0.7), DVec3::new(2.0, 0.5, 1.5));
    s.document.groups[0].lights = vec![light("/World/Lamp", sphere(lamp), DMat4::IDENTITY)];
    let ([r, g, b], _) = mean(&rendered(&s.build(), &color_request(6, 4, 1024, "path")).film);
    // Lights block nothing, so that E = π L (lamp/radius)² / (1 − albedo) everywhere.
    let expected = albedo / (1.0 - albedo) * (lamp / radius) * (lamp / radius);
    for channel in [r, g, b] {
        assert!((channel / expected - 1.0).abs() < 1e-2, "{channel} instead of {expected}");
    }
}

/// A ball of glass, and maybe a prism, in even light from everywhere.
fn furnace(has_prism: bool, glass: impl FnOnce(&mut Stagehand) -> usize) -> ([f64; 3], [f64; 3]) {
    let mut s = Stagehand::new();
    let glass = glass(&mut s);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    if has_prism {
        s.prism(at(1.2, 0.0, 0.0), Some(glass));
    }
    s.camera(DVec3::new(0.2, 0.3, 4.0), DVec3::ZERO);
    s.document.groups[0].lights = vec![light("/World/Dome", dome(), DMat4::IDENTITY)];
    mean(&rendered(&s.build(), &color_request(6, 4, 1024, "path")).film)
}

#[test]
fn what_loses_no_light_vanishes_in_a_furnace() {
    // Every path has weight 1; only the wavelengths are drawn. (A prism of 2.4 holds some light for so long that roulette ends it.)
    for (ior, has_prism) in [(1.1, true), (1.5, true), (2.4, false)] {
        let (channels, _) = furnace(has_prism, |s| s.constant_glass("/World/Glass", ior));
        assert!(channels.iter().all(|channel| (channel - 1.0).abs() < 1e-3), "{ior}: {channels:?}");
    }
    // Refracted paths count at one wavelength, or not at all: no light is lost, but colours are noisy.
    for (name, law) in [("BK7", BK7), ("SF11", SF11)] {
        let (channels, variances) = furnace(true, |s| s.glass("/World/Glass", law));
        for (channel, variance) in channels.into_iter().zip(variances) {
            let error = variance.sqrt();
            assert!(error < 1e-2 && (channel - 1.0).abs() < 4.0 * error, "{name}: {channel} ± {error}");
        }
    }
}

/// Half of it is there, and that is black: each of a ball's two surfaces lets half of the light pass by itself.
fn half_there(s: &mut Stagehand) -> usize {
    let inputs = [("base_color", color([0.0; 3])), ("specular_weight", number(0.0)), ("geometry_opacity", number(0.5))];
    s.surface("/World/Half", "ND_open_pbr_surface_surfaceshader", &inputs, &[])
}

#[test]
fn what_is_half_there_lets_half_pass_at_every_surface() {
    let quarter = |found: f64, whole: f64| {
        assert!((found / whole - 0.25).abs() < 5e-3, "{found} of {whole}");
    };
    // Seen.
    let mut s = Stagehand::new();
    let half = half_there(&mut s);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(half));
    s.camera(DVec3::new(0.2, 0.3, 4.0), DVec3::ZERO);
    s.document.cameras[0].focal_length = 500.0;
    s.document.groups[0].lights = vec![light("/World/Dome", dome(), DMat4::IDENTITY)];
    quarter(mean(&rendered(&s.build(), &color_request(4, 4, 4096, "path")).film).0[1], 1.0);
    // In its shadow.
    let mut s = Stagehand::new();
    let white = lambert(&mut s, 0.5);
    let half = half_there(&mut s);
    s.wall(0.0, 50.0, Some(white));
    s.sphere("/World/Ball", 0.5, at(0.0, 0.0, 2.0), Some(half));
    s.camera(DVec3::new(3.0, 0.5, 6.0), DVec3::ZERO);
    s.document.cameras[0].focal_length = 3.5e4;
    s.document.groups[0].lights = vec![light("/World/Sun", LightShape::Distant { angle: 0.0 }, DMat4::IDENTITY)];
    quarter(mean(&rendered(&s.build(), &color_request(4, 4, 4096, "path")).film).0[1], 0.5 / PI);
}

#[test]
fn a_slab_absorbs_by_beer_and_lambert() {
    let mut s = Stagehand::new();
    let table = json!([[360.0, 0.5], [830.0, 0.5]]);
    let glass = s.authored_glass(
        "/World/Filter",
        &[
            ("abbe:dispersion:nd", authored("double", json!(1.5))),
            ("abbe:internalTransmittance:table", authored("double2[]", table)),
            ("abbe:internalTransmittance:thickness", authored("double", json!(10.0))),
        ],
    );
    // The stage is in centimetres: the slab is 2 cm thick.
    s.solid(
        abbe::scene::description::Shape::Cube { path: "/World/Slab".into(), size: 2.0 },
        DMat4::from_scale(DVec3::new(20.0, 20.0, 1.0)),
        Some(glass),
    );
    s.camera(DVec3::new(0.0, 0.0, 400.0), DVec3::ZERO);
    s.document.cameras[0].focal_length = 3500.0;
    s.document.groups[0].lights = vec![light("/World/Dome", dome(), DMat4::IDENTITY)];
    let ([r, g, b], _) = mean(&rendered(&s.build(), &color_request(4, 4, 4096, "path")).film);
    // At normal incidence R = ((n − 1)/(n + 1))² at each face, T = ½² inside: R + (1 − R)² T / (1 − R T) altogether, the even
    // and odd orders of the light reflected inside summed up.
    let (reflected, inside) = (0.04, 0.25);
    let transmitted = (1.0 - reflected) * (1.0 - reflected) * inside / (1.0 - reflected * reflected * inside * inside);
    let back = reflected
        + (1.0 - reflected) * (1.0 - reflected) * inside * inside * reflected
            / (1.0 - reflected * reflected * inside * inside);
    let expected = transmitted + back;
    for channel in [r, g, b] {
        assert!((channel / expected - 1.0).abs() < 1e-2, "{channel} instead of {expected}");
    }
}

fn test_scene() -> Scene {
    let mut lights = soft_lights();
    lights[1].abbe.insert("abbe:lightGroup".into(), authored("string", json!("lamp")));
    still_life(|s| s.glass("/World/Glass", SF11), lights).build()
}

#[test]
fn parts_sum_to_the_whole() {
    let scene = test_scene();
    let parts = ["diffuse", "reflection", "transmission", "emission"];
    let asked =
        ["color", "diffuse", "reflection", "transmission", "emission", "all=lpe:C.*[LOB]", "glass=lpe:C<TS>+.*L"];
    let request = Request { samples: Some(16), ..request(24, 16, &asked) };
    let film = rendered(&scene, &request).film;
    let whole = values(&film, "color");
    for (pixel, whole) in whole.chunks_exact(4).enumerate() {
        for (i, whole) in whole[..3].iter().enumerate() {
            let of = |layer: &str| values(&film, layer)[3 * pixel + i];
            let sum: f32 = parts.iter().map(|part| of(part)).sum();
            let size = parts.iter().map(|part| of(part).abs()).sum::<f32>() + whole.abs();
            assert!((sum - whole).abs() <= 2e-6 * size + 1e-6, "pixel {pixel}: {sum} of {whole}");
            assert_eq!(of("all"), *whole, "pixel {pixel}");
        }
    }
    let request = Request { aovs: Some(vec!["light_group:lamp".into(), "dome=lpe:C.*B".into()]), ..request };
    let by_light = rendered(&scene, &request).film;
    for (pixel, whole) in whole.chunks_exact(4).enumerate() {
        for (i, whole) in whole[..3].iter().enumerate() {
            let [lamp, dome] = ["light_group_lamp", "dome"].map(|layer| values(&by_light, layer)[3 * pixel + i]);
            let size = lamp.abs() + dome.abs() + whole.abs();
            assert!((lamp + dome - whole).abs() <= 2e-6 * size + 1e-6, "pixel {pixel}: {lamp} + {dome} of {whole}");
        }
    }
    let total = |layer: &str| values(&film, layer).iter().sum::<f32>();
    assert!(total("glass") > 0.0 && total("glass") <= total("transmission"));
}

#[test]
fn the_clean_beauty_is_the_render_without_dispersion() {
    let scene = test_scene();
    let both = rendered(&scene, &Request { samples: Some(8), ..request(24, 16, &["color", "color_clean"]) }).film;
    let clean = Request { samples: Some(8), dispersion_scale: Some(0.0), ..request(24, 16, &["color"]) };
    let clean = rendered(&scene, &clean).film;
    assert_eq!(values(&both, "color_clean"), values(&clean, "color"));
    assert_ne!(values(&both, "color"), values(&clean, "color"));
}

#[test]
fn nothing_but_the_scene_decides_a_bit() {
    let scene = test_scene();
    let asked = &["color", "dispersion", "variance"];
    let one = Request { samples: Some(8), threads: Some(1), ..request(24, 16, asked) };
    let whole = rendered(&scene, &one).film;
    let two = rendered(&scene, &Request { threads: Some(2), ..one.clone() }).film;
    assert_eq!(whole.layers, two.layers);
    // A part of the image.
    let part = rendered(&scene, &Request { crop: Some([5, 3, 19, 13]), ..one.clone() }).film;
    for (y, row) in values(&part, "color").chunks_exact(14 * 4).enumerate() {
        let from = ((y + 3) * 24 + 5) * 4;
        assert_eq!(row, &values(&whole, "color")[from..from + 14 * 4], "row {y}");
    }
    // Less asked for.
    let alone = rendered(&scene, &Request { aovs: Some(vec!["color".into()]), ..one.clone() }).film;
    assert_eq!(values(&alone, "color"), values(&whole, "color"));
    // Under the filter that `differentials` has, all other AOVs are its own.
    let boxed = Request { pixel_filter: Some("box".into()), pixel_filter_width: Some(1.0), ..one };
    let others =
        Request { integrator: Some("differentials".into()), aovs: Some(vec!["dispersion".into()]), ..boxed.clone() };
    assert_eq!(
        values(&rendered(&scene, &others).film, "dispersion"),
        values(&rendered(&scene, &boxed).film, "dispersion")
    );
}

#[test]
fn a_plate_is_seen_through_glass_and_nowhere_else() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plate.png");
    // Bright on the right, dark on the left; sRGB 188 is 0.5029 in linear light.
    let image = image::RgbImage::from_fn(30, 20, |x, _| image::Rgb([if x < 15 { 0 } else { 188 }; 3]));
    image.save(&file).unwrap();
    let mut s = Stagehand::new();
    // Of index 1: what is seen through it stays where it is, and nothing is reflected.
    let clear = s.constant_glass("/World/Clear", 1.0);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(clear));
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    s.document.groups[0].lights = vec![light("/World/Dome", dome(), DMat4::IDENTITY)];
    let plate = Some(file.to_str().unwrap().to_owned());
    let film = rendered(&s.build(), &Request { plate, ..color_request(30, 20, 1024, "path") }).film;
    let pixel = |x: usize, y: usize| &values(&film, "color")[4 * (30 * y + x)..][..4];
    let [r, g, b, a] = pixel(17, 10) else { panic!("four channels") };
    assert!([r, g, b].iter().all(|c| (**c - 0.5029).abs() < 5e-3) && *a == 1.0, "{:?}", pixel(17, 10));
    assert!(pixel(12, 10)[..3].iter().all(|c| c.abs() < 1e-3), "{:?}", pixel(12, 10));
    assert_eq!(pixel(1, 1), [0.0; 4]);
    let missing = Request { plate: Some("/nowhere/plate.png".into()), ..color_request(4, 4, 1, "path") };
    let plan = support::the_plan(&test_scene(), &missing);
    let control = abbe::render::Control::none();
    let error = abbe::render::render(&test_scene(), &plan, &abbe::integrator::Registry::default(), &control);
    assert!(error.expect_err("there is no such file").to_string().contains("/nowhere/plate.png"));
}

#[test]
fn depth_limits_cut_what_they_name() {
    let scene = still_life(|s| lambert(s, 0.7), soft_lights()).build();
    let rendered_with = |limits: Request| mean(&rendered(&scene, &limits).film).0[1];
    let request = color_request(8, 4, 64, "path");
    let all = rendered_with(request.clone());
    let direct = rendered_with(Request { max_depth: Some(1), ..request.clone() });
    let emitted = rendered_with(Request { max_depth: Some(0), ..request.clone() });
    let no_diffuse = rendered_with(Request { max_diffuse_depth: Some(0), ..request });
    assert!(emitted < direct && direct < all, "{emitted} {direct} {all}");
    assert_eq!(emitted, no_diffuse, "everything here is diffuse");
}

#[test]
fn matte_objects_leave_a_hole() {
    let mut s = still_life(|s| lambert(s, 0.7), soft_lights());
    let ball = s.document.groups[0].items.iter_mut().find(|item| item.path == "/World/Ball").unwrap();
    ball.matte = true;
    let film = rendered(&s.build(), &color_request(9, 5, 4, "path")).film;
    let middle = &values(&film, "color")[(2 * 9 + 4) * 4..][..4];
    assert_eq!(middle, [0.0; 4]);
    let corner = &values(&film, "color")[..4];
    assert_eq!(corner[3], 1.0);
}
