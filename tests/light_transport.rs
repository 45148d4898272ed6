//! Laws of light transport: `path` against `reference` and closed forms, and that nothing but the scene decides a bit.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use std::f64::consts::PI;

use abbe::film::{Film, Values};
use abbe::render::Request;
use abbe::scene::Scene;
use abbe::scene::description::{Authored, Light, LightShape, LightShaping};
use glam::{DMat4, DVec3};
use serde_json::json;
use support::{BK7, SF11, Stagehand, authored, rendered, request};

/// A white light of intensity 1 with a place of its own.
fn light(path: &str, shape: LightShape, transform: DMat4) -> Light {
    Light { transform: Some(transform.to_cols_array()), ..support::light(path, shape) }
}

fn dome() -> LightShape {
    LightShape::Dome {
        texture: None,
        format: "automatic".into(),
        pole_axis: "Y".into(),
        guide_radius: 1e5,
        portals: Vec::new(),
    }
}

fn sphere(radius: f64) -> LightShape {
    LightShape::Sphere { radius, treat_as_point: false }
}

fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

fn number(value: f64) -> Authored {
    authored("float", json!(value))
}

fn color(rgb: [f64; 3]) -> Authored {
    authored("color3f", json!(rgb))
}

fn open_pbr(s: &mut Stagehand, inputs: &[(&str, Authored)]) -> usize {
    s.surface("/World/Material", "ND_open_pbr_surface_surfaceshader", inputs, &[])
}

/// Lambert of this albedo.
fn lambert(s: &mut Stagehand, albedo: f64) -> usize {
    open_pbr(s, &[("base_color", color([albedo; 3])), ("specular_weight", number(0.0))])
}

fn color_request(width: u32, height: u32, samples: u32, integrator: &str) -> Request {
    Request {
        samples: Some(samples),
        integrator: Some(integrator.into()),
        pixel_filter: Some("box".into()),
        pixel_filter_width: Some(1.0),
        ..request(width, height, &["color", "variance"])
    }
}

fn values<'f>(film: &'f Film, layer: &str) -> &'f [f32] {
    let layer = film.layers.iter().find(|l| l.name == layer || l.aov.name == layer).expect("was asked for");
    match &layer.values {
        Values::Float(values) => values,
        Values::Uint(_) => panic!("holds integers"),
    }
}

/// Means of all pixels, R, G, B, and the squared standard errors of these means.
fn mean(film: &Film) -> ([f64; 3], [f64; 3]) {
    let (color, variance) = (values(film, "color"), values(film, "variance"));
    let pixels = (variance.len() / 3) as f64;
    let mut sums = ([0.0; 3], [0.0; 3]);
    for (rgba, v) in color.chunks_exact(4).zip(variance.chunks_exact(3)) {
        for i in 0..3 {
            sums.0[i] += f64::from(rgba[i]) / pixels;
            sums.1[i] += f64::from(v[i]) / (pixels * pixels);
        }
    }
    sums
}

/// `path` and `reference` agree, pixel by pixel and in the mean of the image.
///
/// With 96 numbers an image and some forty images, |z| = 5.5 is met by chance in one of 7000 runs of the whole file.
fn assert_agree(name: &str, scene: &Scene) {
    const LARGEST: f64 = 5.5;
    let path = rendered(scene, &color_request(8, 4, 512, "path")).film;
    let truth = rendered(scene, &Request { seed: Some(7), ..color_request(8, 4, 4096, "reference") }).film;
    let (a, va, b, vb) =
        (values(&path, "color"), values(&path, "variance"), values(&truth, "color"), values(&truth, "variance"));
    // What is rarely met has a variance that a pixel's own samples may not know. Those of its neighbours do: none is taken to be
    // much more certain than the image is in the mean.
    let typical = |variances: &[f32]| {
        let sum: f64 = variances.iter().copied().map(f64::from).sum();
        0.25 * sum / variances.len() as f64
    };
    let floors = typical(va) + typical(vb);
    let ((ma, sa), (mb, sb)) = (mean(&path), mean(&truth));
    for (pixel, (a, b)) in a.chunks_exact(4).zip(b.chunks_exact(4)).enumerate() {
        for i in 0..3 {
            let error = (f64::from(va[3 * pixel + i]) + f64::from(vb[3 * pixel + i])).max(floors).sqrt();
            let z = (f64::from(a[i]) - f64::from(b[i])) / error;
            assert!(z.abs() < LARGEST, "{name}: pixel {pixel}, channel {i}: {} against {}, z = {z:.2}", a[i], b[i]);
        }
    }
    for i in 0..3 {
        let z = (ma[i] - mb[i]) / (sa[i] + sb[i]).sqrt();
        assert!(z.abs() < LARGEST, "{name}: mean of channel {i}: {} against {}, z = {z:.2}", ma[i], mb[i]);
    }
}

/// A ball of a material over a grey floor and before a wall of stripes, under a dome and a large lamp.
fn still_life(material: impl FnOnce(&mut Stagehand) -> usize, lights: Vec<Light>) -> Stagehand {
    let mut s = Stagehand::new();
    let grey = lambert(&mut s, 0.5);
    let material = material(&mut s);
    s.wall(-3.0, 8.0, Some(grey));
    s.sphere("/World/Ball", 1.0, at(0.1, 0.0, 0.0), Some(material));
    s.camera(DVec3::new(0.2, 0.5, 5.0), DVec3::ZERO);
    s.document.groups[0].lights = lights;
    s
}

fn soft_lights() -> Vec<Light> {
    vec![
        Light { intensity: 0.3, color: [0.7, 0.9, 1.0], ..light("/World/Dome", dome(), DMat4::IDENTITY) },
        Light { intensity: 4.0, color: [1.0, 0.8, 0.6], ..light("/World/Lamp", sphere(1.2), at(3.0, 3.5, 2.0)) },
    ]
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
    for (name, material) in materials {
        assert_agree(name, &still_life(material, soft_lights()).build());
    }
}

#[test]
fn path_is_reference_for_every_light() {
    let down = DMat4::from_rotation_x(-PI / 2.0);
    let shapes: Vec<(&str, LightShape, DMat4, f64)> = vec![
        ("dome", dome(), DMat4::IDENTITY, 1.0),
        ("sun", LightShape::Distant { angle: 40.0 }, DMat4::from_rotation_x(-0.9), 1.0),
        ("parallel light", LightShape::Distant { angle: 0.0 }, DMat4::from_rotation_x(-0.9), 2.0),
        ("rectangle", LightShape::Rect { width: 4.0, height: 3.0, texture: None }, at(0.0, 4.0, 1.0) * down, 3.0),
        ("disk", LightShape::Disk { radius: 2.0 }, at(0.0, 4.0, 1.0) * down, 3.0),
        ("sphere", sphere(1.0), at(2.5, 3.0, 1.0), 5.0),
        ("ellipsoid", sphere(1.0), at(2.5, 3.0, 1.0) * DMat4::from_scale(DVec3::new(1.5, 0.5, 1.0)), 5.0),
        ("cylinder", LightShape::Cylinder { length: 4.0, radius: 0.8, treat_as_line: false }, at(0.0, 3.0, 1.5), 4.0),
        ("point", LightShape::Sphere { radius: 0.5, treat_as_point: true }, at(2.0, 3.0, 2.0), 10.0),
        ("line", LightShape::Cylinder { length: 3.0, radius: 0.5, treat_as_line: true }, at(0.0, 3.0, 2.0), 8.0),
        (
            "ball that shines",
            LightShape::Geometry { prims: vec!["/World/Ball".into()], material_sync_mode: "noMaterialResponse".into() },
            DMat4::IDENTITY,
            2.0,
        ),
    ];
    for (name, shape, transform, intensity) in shapes {
        let lamp = Light { intensity, ..light("/World/Lamp", shape, transform) };
        assert_agree(name, &still_life(|s| lambert(s, 0.6), vec![lamp]).build());
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
    assert_agree("many lamps", &still_life(|s| open_pbr(s, &[("specular_roughness", number(0.3))]), lamps).build());
}

#[test]
fn path_is_reference_for_every_camera() {
    let scene = |camera: &dyn Fn(&mut abbe::scene::description::Camera)| {
        let mut s = still_life(|s| s.glass("/World/Glass", SF11), soft_lights());
        camera(&mut s.document.cameras[0]);
        s.build()
    };
    assert_agree("lens", &scene(&|camera| (camera.f_stop, camera.focus_distance) = (0.2, 5.0)));
    assert_agree(
        "orthographic",
        &scene(&|camera| {
            camera.projection = "orthographic".into();
            (camera.horizontal_aperture, camera.vertical_aperture) = (40.0, 20.0);
        }),
    );
    assert_agree("under glass", &{
        let mut s = still_life(|s| s.glass("/World/Glass", SF11), soft_lights());
        let around = s.constant_glass("/World/Water", 1.33);
        s.sphere("/World/Sea", 3.5, at(0.2, 0.5, 5.0), Some(around));
        s.build()
    });
}

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
