//! Interfaces between media and what the media take from the light, in closed form: slabs, balls, nesting, overlaps with
//! and without priorities, surfaces that touch, media of equal index, cameras inside.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use abbe::camera::{Camera, ConformPolicy};
use abbe::integrator::chain::{Chain, Counters, End, Follower, Record};
use abbe::integrator::transmittance::{Coefficients, Segment};
use abbe::optics::{Extinction, catalog};
use abbe::ray::{ColumnSet, SecondOrderColumns};
use abbe::render::trace::trace;
use abbe::sampler::CameraSample;
use abbe::scene::Scene;
use abbe::scene::view::{Media, View};
use abbe::spectrum::{REFERENCE, Wavelength, response};
use glam::{DMat4, DVec2, DVec3};
use serde_json::json;
use support::{Stagehand, authored, floats, integers, rendered, request, the_plan};

/// A glass of constant index whose transmittance over one stage unit is `grey` at every wavelength.
fn medium(s: &mut Stagehand, path: &str, ior: f64, grey: f64) -> usize {
    let index = s.constant_glass(path, ior);
    tint(s, index, [grey; 3], 1.0);
    index
}

fn tint(s: &mut Stagehand, material: usize, color: [f64; 3], depth: f64) {
    let inputs = &mut s.document.materials[material].surface.as_mut().unwrap().inputs;
    inputs.insert("transmission_color".into(), authored("color3f", json!(color)));
    inputs.insert("transmission_depth".into(), authored("float", json!(depth)));
}

fn abbe(s: &mut Stagehand, material: usize, name: &str, type_name: &str, value: serde_json::Value) {
    s.document.materials[material].abbe.insert(format!("abbe:{name}"), authored(type_name, value));
}

fn prioritise(s: &mut Stagehand, material: usize, priority: i32) {
    abbe(s, material, "dielectricPriority", "int", json!(priority));
}

/// Corners of a box, bit k of the index chooses the upper end of axis k; faces wound outwards.
const FACES: [[i32; 4]; 6] = [[2, 3, 1, 0], [5, 7, 6, 4], [1, 5, 4, 0], [6, 7, 3, 2], [4, 6, 2, 0], [3, 7, 5, 1]];

fn corners(low: [f32; 3], high: [f32; 3]) -> Vec<[f32; 3]> {
    (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { low[k] } else { high[k] })).collect()
}

fn block(s: &mut Stagehand, path: &str, low: [f32; 3], high: [f32; 3], material: usize) {
    let faces: Vec<&[i32]> = FACES.iter().map(|face| &face[..]).collect();
    s.mesh(path, &corners(low, high), &faces, DMat4::IDENTITY, Some(material));
}

/// A block as wide as the scene, from z = `low` to z = `high`.
fn slab(s: &mut Stagehand, path: &str, low: f32, high: f32, material: usize) {
    block(s, path, [-50.0, -50.0, low], [50.0, 50.0, high], material);
}

/// A box with a cavity, as one closed mesh of two shells.
fn vessel(s: &mut Stagehand, path: &str, outer: f32, inner: f32, material: usize) {
    let mut points = corners([-outer; 3], [outer; 3]);
    points.extend(corners([-inner; 3], [inner; 3]));
    let cavity: Vec<[i32; 4]> = FACES.iter().map(|&[a, b, c, d]| [d + 8, c + 8, b + 8, a + 8]).collect();
    let faces: Vec<&[i32]> = FACES.iter().chain(&cavity).map(|face| &face[..]).collect();
    s.mesh(path, &points, &faces, DMat4::IDENTITY, Some(material));
}

/// A chain through the middle of the image, with its segments by the names of their materials.
struct Way {
    chain: Chain<SecondOrderColumns>,
    segments: Vec<(String, f64)>,
    counters: Counters,
    transmittance: f64,
}

const RESOLUTION: [u32; 2] = [31, 21];

fn follow(scene: &Scene, wavelength: Wavelength, offset: DVec2) -> Way {
    let camera =
        Camera::new(&scene.document().cameras[0], RESOLUTION, 1.0, ConformPolicy::ExpandAperture).expect("a camera");
    let view = View::new(scene, camera.position);
    let media = Media::at(scene, wavelength, 1.0).expect("media");
    let mut segments: Vec<Segment> = Vec::new();
    let mut counters = Counters::default();
    let start = camera.ray(&CameraSample::at(15.5 + offset.x, 10.5 + offset.y));
    let record = Record { steps: None, segments: Some(&mut segments) };
    let chain = Follower::new(&view).follow(&start, &media, record, &mut counters);
    let [transmittance] = Coefficients::at(scene, [wavelength]).transmittance(&segments);
    let name = |segment: &Segment| {
        let path = segment.medium.map_or("", |id| &scene.materials[id.0 as usize].path);
        (path.trim_start_matches("/World/").to_owned(), segment.length)
    };
    Way { chain, segments: segments.iter().map(name).collect(), counters, transmittance }
}

/// Through the middle, at the reference wavelength.
fn way(scene: &Scene) -> Way {
    follow(scene, REFERENCE, DVec2::ZERO)
}

#[track_caller]
fn assert_segments(way: &Way, expected: &[(&str, f64)]) {
    let names: Vec<_> = way.segments.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, expected.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    for ((name, length), (_, expected)) in way.segments.iter().zip(expected) {
        assert!(
            (length - expected).abs() <= 1e-13 * expected.max(1.0) || length == expected,
            "{name}: {length} {expected}"
        );
    }
}

/// From (0, 0, 6) along −z onto a wall at −6.
fn axial() -> Stagehand {
    let mut s = Stagehand::new();
    s.wall(-6.0, 40.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    s
}

/// The same scene seen from the other side; the wall goes there too.
fn turned(mut s: Stagehand) -> Stagehand {
    s.document.cameras.clear();
    s.camera(DVec3::new(0.0, 0.0, -5.9), DVec3::ZERO);
    let behind = 6.1f32;
    s.mesh(
        "/World/Behind",
        &[[-40.0, -40.0, behind], [-40.0, 40.0, behind], [40.0, 40.0, behind], [40.0, -40.0, behind]],
        &[&[0, 1, 2, 3]],
        DMat4::IDENTITY,
        None,
    );
    s
}

fn end(way: &Way) -> DVec3 {
    match &way.chain.end {
        End::Surface(met) => met.point,
        other => panic!("{other:?}"),
    }
}

// ------------------------------------------------------------------------------------------------------- Beer and Lambert

#[test]
fn a_slab_takes_by_its_thickness_over_the_cosine_inside() {
    let (ior, grey, thickness) = (1.5f64, 0.4f64, 0.75);
    for degrees in [0.0f64, 10.0, 45.0, 80.0, 89.9] {
        let mut s = Stagehand::new();
        s.wall(-6.0, 1e6, None);
        let glass = medium(&mut s, "/World/Glass", ior, grey);
        block(&mut s, "/World/Slab", [-1e5, -50.0, -0.75], [1e5, 50.0, 0.0], glass);
        let sine = degrees.to_radians().sin();
        s.camera(DVec3::new(sine, 0.0, degrees.to_radians().cos()), DVec3::ZERO);
        let cos_t = (1.0 - (sine / ior).powi(2)).sqrt();
        let expected = grey.powf(thickness / cos_t);
        let transmittance = way(&s.build()).transmittance;
        assert!((transmittance - expected).abs() < 1e-13, "{degrees}°: {transmittance} {expected}");
    }
}

#[test]
fn a_ball_takes_by_its_chord() {
    let (ior, grey, radius) = (1.5168f64, 0.3f64, 2.0);
    for height in [0.0, 0.5, 1.5, 1.99] {
        let mut s = Stagehand::new();
        s.wall(-60.0, 1e4, None);
        let glass = medium(&mut s, "/World/Glass", ior, grey);
        s.sphere("/World/Ball", radius, DMat4::from_translation(DVec3::Y * height), Some(glass));
        s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
        let chord = 2.0 * radius * (1.0 - (height / (ior * radius)).powi(2)).sqrt();
        let expected = grey.powf(chord);
        let transmittance = way(&s.build()).transmittance;
        assert!((transmittance - expected).abs() < 1e-13, "{height}: {transmittance} {expected}");
    }
}

#[test]
fn measured_absorption_is_physical_and_a_shaders_depth_is_in_stage_units() {
    // 20 mm of a glass with τ(10 mm) = 0.8, or the k that means the same, modelled in metres, centimetres and millimetres.
    let k = -(0.8f64.ln()) / 0.01 * REFERENCE.nanometers() * 1e-9 / (4.0 * std::f64::consts::PI);
    for meters_per_unit in [1.0, 0.01, 0.001] {
        let unit = 0.01 / meters_per_unit;
        let build = |dress: &dyn Fn(&mut Stagehand, usize)| {
            let mut s = Stagehand::new();
            s.document.stage.meters_per_unit = meters_per_unit;
            let glass = s.constant_glass("/World/Glass", 1.5);
            dress(&mut s, glass);
            s.wall((-6.0 * unit) as f32, (40.0 * unit) as f32, None);
            s.sphere("/World/Ball", unit, DMat4::IDENTITY, Some(glass));
            s.camera(DVec3::new(0.0, 0.0, 6.0 * unit), DVec3::ZERO);
            way(&s.build()).transmittance
        };
        let plate = build(&|s, glass| {
            abbe(s, glass, "internalTransmittance:table", "double2[]", json!([[400.0, 0.8], [700.0, 0.8]]));
        });
        assert!((plate - 0.64).abs() < 1e-14, "{meters_per_unit}: {plate}");
        let thin = build(&|s, glass| {
            abbe(s, glass, "internalTransmittance:table", "double2[]", json!([[400.0, 0.8], [700.0, 0.8]]));
            abbe(s, glass, "internalTransmittance:thickness", "double", json!(5.0));
        });
        assert!((thin - 0.8f64.powi(4)).abs() < 1e-14, "{meters_per_unit}: {thin}");
        let extinction = build(&|s, glass| {
            abbe(s, glass, "extinction:table", "double2[]", json!([[400.0, k], [700.0, k]]));
        });
        assert!((extinction - 0.64).abs() < 1e-14, "{meters_per_unit}: {extinction}");
        // Measured data win over the shader's colour.
        let both = build(&|s, glass| {
            abbe(s, glass, "extinction:table", "double2[]", json!([[400.0, k], [700.0, k]]));
            tint(s, glass, [0.1; 3], unit);
        });
        assert_eq!(both, extinction);
        let color = build(&|s, glass| tint(s, glass, [0.5; 3], 2.0));
        assert!((color - 0.5f64.powf(unit)).abs() < 1e-14, "{meters_per_unit}: {color}");
    }
}

#[test]
fn what_the_catalogue_knows_of_absorption_can_be_used() {
    let mut tables = 0;
    for entry in catalog::entries() {
        let Some(table) = entry.extinction() else { continue };
        tables += 1;
        let extinction = Extinction::table(&table).unwrap_or_else(|problem| panic!("{}: {problem}", entry.name()));
        assert!(extinction.at(REFERENCE) >= 0.0);
    }
    assert!(tables > 500, "{tables} tables");
}

#[test]
fn a_named_glass_absorbs_as_it_was_measured() {
    // τ(10 mm) of SCHOTT's data sheet. A ball of a metre absorbs as a hundred such plates.
    let mut s = axial();
    let glass = s.constant_glass("/World/Glass", 1.5);
    abbe(&mut s, glass, "glass", "string", json!("SCHOTT:N-BK7"));
    tint(&mut s, glass, [0.1; 3], 1.0);
    s.document.stage.meters_per_unit = 0.5;
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    let scene = s.build();
    let at = |nm: f64| follow(&scene, Wavelength::from_nanometers(nm), DVec2::ZERO).transmittance;
    // What the sheet's three digits leave open.
    for (nm, tau) in [(400.0, 0.997f64), (546.0, 0.998), (700.0, 0.998)] {
        let [least, most] = [tau - 5e-4, tau + 5e-4].map(|tau| tau.powi(100));
        assert!((least..=most).contains(&at(nm)), "{nm} nm: {}", at(nm));
    }
    assert!(scene.materials[0].chosen.contains("absorbs by k(λ)"), "{}", scene.materials[0].chosen);
}

#[test]
fn the_layer_holds_the_transmittances_at_the_wavelengths_of_the_channels() {
    let mut s = axial();
    let glass = s.glass("/World/Glass", support::BK7);
    tint(&mut s, glass, [0.9, 0.6, 0.3], 1.5);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    let scene = s.build();
    let image = rendered(&scene, &request(31, 21, &["internal_transmittance", "dispersion"]));
    let (values, valid) = floats(&image.film, "internal_transmittance");
    let absorption = abbe::optics::Absorption::from_color([0.9, 0.6, 0.3], 1.5).unwrap();
    let middle = 10 * 31 + 15;
    for (channel, wavelength) in response::CENTROIDS.into_iter().enumerate() {
        let expected = absorption.transmittance(wavelength, 2.0);
        assert!((f64::from(values[3 * middle + channel]) - expected).abs() < 1e-7, "{channel}");
    }
    // The corner passes by the ball, and is as valid.
    assert_eq!(values[..3], [1.0; 3]);
    assert!(valid.iter().all(|&v| v == 1.0));
}

#[test]
fn only_who_asks_pays_and_nobody_else_notices() {
    let build = |color: f64| {
        let mut s = axial();
        let glass = s.glass("/World/Glass", support::SF11);
        tint(&mut s, glass, [color, 0.5 * color + 0.5, 1.0], 1.0);
        s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::new(0.3, 0.1, 0.0)), Some(glass));
        s.build()
    };
    let names = ["dispersion", "refracted_position", "interfaces", "ior", "dispersion2", "internal_transmittance"];
    let (clear, tinted) = (build(1.0), build(0.2));
    let without = rendered(&tinted, &request(31, 21, &names[..5]));
    let with = rendered(&tinted, &request(31, 21, &names));
    let unabsorbing = rendered(&clear, &request(31, 21, &names));
    for layer in &without.film.layers {
        let name = layer.aov.name;
        for image in [&with, &unabsorbing] {
            let other = image.film.layer(name).unwrap();
            assert!(layer.values == other.values && layer.valid == other.valid, "{name}");
        }
    }
    assert!(!without.statistics.plan.needs.transmittance && with.statistics.plan.needs.transmittance);
    // Where nothing absorbs, nothing is carried, and the layer is exactly 1.
    assert!(!unabsorbing.statistics.plan.needs.transmittance);
    assert!(floats(&unabsorbing.film, "internal_transmittance").0.iter().all(|&v| v == 1.0));
    let skipped = &unabsorbing.statistics.plan.skipped;
    assert!(skipped.iter().any(|d| d.why == "no material in use absorbs: internal_transmittance is exactly 1"));
    let carried = &with.statistics.plan.carried;
    assert!(carried.iter().any(|d| d.why == "internal_transmittance asks for it, and /World/Glass absorbs"));
}

#[test]
fn a_chain_without_an_end_has_no_transmittance_and_a_miss_has_one() {
    let mirrors = || {
        let mut s = Stagehand::new();
        let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
        let metal = s.diffuse("/World/Metal");
        let inputs = &mut s.document.materials[metal].surface.as_mut().unwrap().inputs;
        inputs.insert("metallic".into(), authored("float", json!(1.0)));
        inputs.insert("roughness".into(), authored("float", json!(0.0)));
        slab(&mut s, "/World/Slab", -1.0, 1.0, glass);
        s.wall(-6.0, 4e3, Some(metal));
        s.mesh(
            "/World/Behind",
            &[[-4e3, -4e3, 7.0], [-4e3, 4e3, 7.0], [4e3, 4e3, 7.0], [4e3, -4e3, 7.0]],
            &[&[0, 1, 2, 3]],
            DMat4::IDENTITY,
            Some(metal),
        );
        s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
        s
    };
    let film = rendered(&mirrors().build(), &request(31, 21, &["internal_transmittance"])).film;
    let (values, valid) = floats(&film, "internal_transmittance");
    assert!(valid.iter().chain(values).all(|&v| v == 0.0), "absent");

    let mut s = Stagehand::new();
    let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let scene = s.build();
    assert_segments(&way(&scene), &[("", 5.0), ("Glass", 2.0), ("", f64::INFINITY)]);
    let film = rendered(&scene, &request(31, 21, &["internal_transmittance"])).film;
    let (values, valid) = floats(&film, "internal_transmittance");
    assert_eq!((values[3 * (10 * 31 + 15)], valid[10 * 31 + 15]), (0.25, 1.0));
    assert_eq!((values[0], valid[0]), (1.0, 1.0));
}

#[test]
fn an_endless_way_through_what_absorbs_leaves_nothing() {
    // Entered and never left: an open sheet. In a clear medium everything is left.
    for (grey, left) in [(0.5, 0.0), (1.0, 1.0)] {
        let mut s = Stagehand::new();
        let glass = medium(&mut s, "/World/Glass", 1.5, grey);
        s.wall(0.0, 40.0, Some(glass));
        s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
        let way = way(&s.build());
        assert_segments(&way, &[("", 6.0), ("Glass", f64::INFINITY)]);
        assert_eq!(way.transmittance, left);
    }
}

#[test]
fn thin_walls_take_nothing() {
    let mut s = axial();
    let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
    let inputs = &mut s.document.materials[glass].surface.as_mut().unwrap().inputs;
    inputs.insert("geometry_thin_walled".into(), authored("bool", json!(true)));
    s.sphere("/World/Bubble", 1.0, DMat4::IDENTITY, Some(glass));
    let way = way(&s.build());
    assert_segments(&way, &[("", 12.0)]);
    assert_eq!((way.transmittance, way.chain.interfaces), (1.0, 2));
}

#[test]
fn the_trace_tells_medium_length_and_what_is_left() {
    let mut s = axial();
    let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
    let liquid = medium(&mut s, "/World/Liquid", 1.3, 0.8);
    s.sphere("/World/Ball", 2.0, DMat4::IDENTITY, Some(glass));
    s.sphere("/World/Drop", 1.0, DMat4::IDENTITY, Some(liquid));
    let scene = s.build();
    let told = trace(&scene, &the_plan(&scene, &request(31, 21, &["interfaces"])), [15, 10], 0).unwrap();
    let ways: Vec<_> = told["events"].as_array().unwrap().iter().map(|event| &event["segment"]).collect();
    let expected = [
        (None, 4.0, 1.0, 1.0),
        (Some("/World/Glass"), 1.0, 0.5, 0.5),
        (Some("/World/Liquid"), 2.0, 0.64, 0.32),
        (Some("/World/Glass"), 1.0, 0.5, 0.16),
        (None, 4.0, 1.0, 0.16),
    ];
    for (way, (medium, length, here, so_far)) in ways.into_iter().chain([&told["last_segment"]]).zip(expected) {
        assert_eq!(way["medium"].as_str(), medium);
        for (name, value) in [("length", length), ("transmittance", here), ("transmittance_so_far", so_far)] {
            assert!((way[name].as_f64().unwrap() - value).abs() < 1e-13, "{name}: {way}");
        }
    }
}

// ------------------------------------------------------------------------------------------- nesting, overlaps, priorities

#[test]
fn where_objects_overlap_the_strongest_alone_absorbs() {
    // A liquid that reaches into its glass; glass 2 to 1, liquid 1.5 to −1.
    for (glass_priority, liquid_priority, expected) in [
        (1, 2, [("", 4.0), ("Glass", 1.0), ("Liquid", 2.0), ("", 5.0)]),
        (2, 1, [("", 4.0), ("Glass", 0.5), ("Liquid", 2.5), ("", 5.0)]),
        // Set wins over unset.
        (1, 0, [("", 4.0), ("Glass", 1.0), ("Liquid", 2.0), ("", 5.0)]),
        (0, 7, [("", 4.0), ("Glass", 0.5), ("Liquid", 2.5), ("", 5.0)]),
    ] {
        let build = || {
            let mut s = axial();
            let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
            let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
            prioritise(&mut s, glass, glass_priority);
            prioritise(&mut s, liquid, liquid_priority);
            slab(&mut s, "/World/Wall", 1.0, 2.0, glass);
            slab(&mut s, "/World/Water", -1.0, 1.5, liquid);
            s
        };
        let forth = way(&build().build());
        assert_segments(&forth, &expected);
        let left = 0.5f64.powf(expected[1].1) * 0.8f64.powf(expected[2].1);
        assert!((forth.transmittance - left).abs() < 1e-14);
        assert_eq!(
            (forth.chain.interfaces, forth.counters.undecided_overlaps, forth.counters.unmatched_exits),
            (3, 0, 0)
        );
        // The same media on the way back.
        let back = way(&turned(build()).build());
        assert_eq!(back.segments[1].0, "Liquid");
        assert!(
            (back.segments[1].1 - expected[2].1).abs() < 1e-13 && (back.segments[2].1 - expected[1].1).abs() < 1e-13
        );
        assert!((back.transmittance - left).abs() < 1e-14);
    }
}

#[test]
fn an_overlap_that_no_priority_decides_is_reported() {
    for priority in [0, 3] {
        let mut s = axial();
        let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
        let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
        prioritise(&mut s, glass, priority);
        prioritise(&mut s, liquid, priority);
        slab(&mut s, "/World/Wall", 1.0, 2.0, glass);
        slab(&mut s, "/World/Water", -1.0, 1.5, liquid);
        let scene = s.build();
        // The last entered wins, on the way back the other one: nothing that is true of a point.
        let way = way(&scene);
        assert_segments(&way, &[("", 4.0), ("Glass", 0.5), ("Liquid", 2.5), ("", 5.0)]);
        assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (1, 0));
        let warnings = rendered(&scene, &request(31, 21, &["interfaces"])).statistics.warnings;
        let warning = warnings.warnings().iter().find(|w| w.kind == "undecided-overlap").expect("a warning");
        assert!(warning.message.contains("abbe:dielectricPriority"), "{}", warning.message);
    }
}

#[test]
fn nesting_and_overlaps_of_one_material_are_decided() {
    // Glass in glass, side by side, and two lumps of one glass that grow into each other.
    let mut nested = axial();
    let outer = medium(&mut nested, "/World/Outer", 1.5, 0.9);
    let inner = medium(&mut nested, "/World/Inner", 1.7, 0.5);
    nested.sphere("/World/A", 2.0, DMat4::IDENTITY, Some(outer));
    nested.sphere("/World/B", 1.0, DMat4::IDENTITY, Some(inner));
    let nested = way(&nested.build());
    assert_segments(&nested, &[("", 4.0), ("Outer", 1.0), ("Inner", 2.0), ("Outer", 1.0), ("", 4.0)]);

    let mut lumps = axial();
    let glass = medium(&mut lumps, "/World/Glass", 1.5, 0.9);
    slab(&mut lumps, "/World/A", 0.0, 2.0, glass);
    slab(&mut lumps, "/World/B", -2.0, 1.0, glass);
    let lumps = way(&lumps.build());
    assert_segments(&lumps, &[("", 4.0), ("Glass", 4.0), ("", 4.0)]);
    for way in [nested, lumps] {
        assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (0, 0));
    }
}

#[test]
fn a_vessel_and_its_liquid_are_one_in_every_style_of_modelling() {
    // Walls that coincide exactly, a liquid that reaches into the wall, one that leaves a gap of air.
    let styles = [("coincident", 1.0f32), ("overlapping", 1.0625), ("with a gap", 1.0 - 1.0 / 1024.0)];
    for eye in [DVec3::new(0.0, 0.0, 6.0), DVec3::new(1.5, 0.7, 6.0)] {
        let ways = styles.map(|(_, half)| {
            let mut s = Stagehand::new();
            let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
            let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
            prioritise(&mut s, glass, 1);
            prioritise(&mut s, liquid, 2);
            vessel(&mut s, "/World/Vessel", 1.5, 1.0, glass);
            block(&mut s, "/World/Water", [-half; 3], [half; 3], liquid);
            s.wall(-6.0, 40.0, None);
            s.camera(eye, DVec3::ZERO);
            way(&s.build())
        });
        let [coincident, overlapping, gap] = &ways;
        let names = |way: &Way| way.segments.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(coincident), ["", "Glass", "Liquid", "Glass", ""]);
        assert_eq!(names(coincident), names(overlapping));
        for (a, b) in coincident.segments.iter().zip(&overlapping.segments) {
            assert!((a.1 - b.1).abs() < 1e-13, "{a:?} {b:?}");
        }
        assert!((end(coincident) - end(overlapping)).length() < 1e-13);
        assert_eq!(coincident.chain.interfaces, overlapping.chain.interfaces);
        assert_eq!(coincident.chain.dielectric_id, overlapping.chain.dielectric_id);
        // The gap is two more interfaces on either side of which the direction is the same, and as much way as it is wide.
        assert_eq!(names(gap), ["", "Glass", "", "Liquid", "", "Glass", ""]);
        assert!((gap.chain.direction - coincident.chain.direction).length() < 1e-14);
        assert!((end(gap) - end(coincident)).length() < 4.0 / 1024.0);
        assert!((gap.transmittance / coincident.transmittance - 1.0).abs() < 4.0 / 1024.0);
        for way in &ways {
            assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (0, 0));
        }
    }
}

#[test]
fn coincident_walls_need_no_priorities_and_no_order() {
    // A vessel and its liquid without priorities, in either order of description, from either side.
    for first in ["glass", "liquid"] {
        let build = || {
            let mut s = axial();
            let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
            let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
            if first == "glass" {
                vessel(&mut s, "/World/Vessel", 1.5, 1.0, glass);
            }
            block(&mut s, "/World/Water", [-1.0; 3], [1.0; 3], liquid);
            if first == "liquid" {
                vessel(&mut s, "/World/Vessel", 1.5, 1.0, glass);
            }
            s
        };
        for s in [build(), turned(build())] {
            let way = way(&s.build());
            let names: Vec<_> = way.segments.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, ["", "Glass", "Liquid", "Glass", ""], "{first} first");
            assert!((way.transmittance - 0.5 * 0.64).abs() < 1e-14);
            assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (0, 0), "{first} first");
            assert_eq!(way.chain.interfaces, 4);
        }
    }
}

#[test]
fn a_cemented_face_is_one_interface_in_any_order() {
    // Crown and flint with one face in common, which is a sphere in one and a translated sphere in the other.
    for swapped in [false, true] {
        let mut s = Stagehand::new();
        let crown = medium(&mut s, "/World/Crown", 1.52, 0.9);
        let flint = medium(&mut s, "/World/Flint", 1.72, 0.6);
        let blocks: [(&str, f32, f32, usize); 2] = [("/World/A", 0.0, 1.0, crown), ("/World/B", -1.0, 0.0, flint)];
        let order = if swapped { [1, 0] } else { [0, 1] };
        for i in order {
            let (path, low, high, material) = blocks[i];
            slab(&mut s, path, low, high, material);
        }
        s.wall(-6.0, 40.0, None);
        s.camera(DVec3::new(2.0, 1.0, 6.0), DVec3::ZERO);
        let way = way(&s.build());
        let names: Vec<_> = way.segments.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["", "Crown", "Flint", ""]);
        let cos_in = 6.0 / 41.0f64.sqrt();
        let sine2 = 1.0 - cos_in * cos_in;
        let lengths = [1.52f64, 1.72].map(|n| 1.0 / (1.0 - sine2 / (n * n)).sqrt());
        assert!((way.transmittance - 0.9f64.powf(lengths[0]) * 0.6f64.powf(lengths[1])).abs() < 1e-14);
        assert_eq!((way.chain.interfaces, way.chain.dielectric_id), (3, 1));
    }
}

#[test]
fn thirty_nested_balls_are_entered_and_left_in_order() {
    let shells = 30;
    let mut s = Stagehand::new();
    let mut expected = vec![(String::new(), 40.0 - 30.0)];
    for i in 0..shells {
        let name = format!("Shell{i}");
        let shell = medium(&mut s, &format!("/World/{name}"), 1.3 + 0.02 * f64::from(i), 0.99 - 0.01 * f64::from(i));
        s.sphere(&format!("/World/Ball{i}"), f64::from(shells - i), DMat4::IDENTITY, Some(shell));
        expected.push((name, if i == shells - 1 { 2.0 } else { 1.0 }));
    }
    let out: Vec<_> = expected[..expected.len() - 1].iter().rev().cloned().collect();
    expected.extend(out);
    s.wall(-40.0, 400.0, None);
    s.camera(DVec3::new(0.0, 0.0, 40.0), DVec3::ZERO);
    let scene = s.build();
    let straight = way(&scene);
    let expected: Vec<_> = expected.iter().map(|(name, length)| (name.as_str(), *length)).collect();
    assert_segments(&straight, &expected);
    assert_eq!((straight.chain.interfaces, straight.counters.unmatched_exits), (60, 0));
    let depth: f64 = (0..shells).map(|i| -2.0 * (0.99 - 0.01 * f64::from(i)).ln()).sum();
    assert!((straight.transmittance / (-depth).exp() - 1.0).abs() < 1e-12);
    // Aside from the axis the stack of the way out is that of the way in, turned round.
    let aside = follow(&scene, REFERENCE, DVec2::new(3.0, 1.0));
    let names: Vec<_> = aside.segments.iter().map(|(name, _)| name.clone()).collect();
    assert!(names.len() > 20, "{names:?}");
    assert_eq!(names, names.iter().rev().cloned().collect::<Vec<_>>());
}

#[test]
fn bubbles_are_air_however_they_are_modelled() {
    // As a shell in the mesh of the glass, as a shell of its own with the glass's material and normals towards the air,
    // and as an object of index 1 with a stronger priority.
    let expected = [("", 3.0), ("Glass", 2.0), ("", 2.0), ("Glass", 2.0), ("", 3.0)];
    let glass_of = |s: &mut Stagehand| medium(s, "/World/Glass", 1.5, 0.5);
    let mut one = axial();
    let glass = glass_of(&mut one);
    vessel(&mut one, "/World/Ball", 3.0, 1.0, glass);
    let mut shell = axial();
    let glass = glass_of(&mut shell);
    block(&mut shell, "/World/Ball", [-3.0; 3], [3.0; 3], glass);
    let inward: Vec<[i32; 4]> = FACES.iter().map(|&[a, b, c, d]| [d, c, b, a]).collect();
    let inward: Vec<&[i32]> = inward.iter().map(|face| &face[..]).collect();
    shell.mesh("/World/Bubble", &corners([-1.0; 3], [1.0; 3]), &inward, DMat4::IDENTITY, Some(glass));
    for s in [one, shell] {
        let way = way(&s.build());
        assert_segments(&way, &expected);
        assert!((way.transmittance - 0.0625).abs() < 1e-15);
        assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (0, 0));
    }
    let mut air = axial();
    let glass = glass_of(&mut air);
    let bubble = air.constant_glass("/World/Air", 1.0);
    prioritise(&mut air, bubble, 1);
    block(&mut air, "/World/Ball", [-3.0; 3], [3.0; 3], glass);
    block(&mut air, "/World/Bubble", [-1.0; 3], [1.0; 3], bubble);
    assert_segments(&way(&air.build()), &[("", 3.0), ("Glass", 2.0), ("Air", 2.0), ("Glass", 2.0), ("", 3.0)]);
}

// --------------------------------------------------------------------------------------------------- cameras inside of media

#[test]
fn a_camera_in_a_medium_sees_through_it_from_the_start() {
    let mut s = Stagehand::new();
    let water = medium(&mut s, "/World/Water", 1.33, 0.9);
    slab(&mut s, "/World/Pool", -4.0, 20.0, water);
    s.wall(-6.0, 40.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let way = way(&s.build());
    assert_segments(&way, &[("Water", 10.0), ("", 2.0)]);
    assert!((way.transmittance - 0.9f64.powi(10)).abs() < 1e-15);
    assert_eq!(way.chain.dielectric_id, 0, "leaving is not entering");
}

#[test]
fn a_camera_in_an_overlap_is_in_the_strongest() {
    for (priorities, expected) in
        [([1, 2], [("Glass", 6.0), ("Liquid", 2.0), ("", 4.0)]), ([2, 1], [("Liquid", 8.0), ("", 4.0), ("", 0.0)])]
    {
        let mut s = axial();
        let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
        let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
        prioritise(&mut s, glass, priorities[0]);
        prioritise(&mut s, liquid, priorities[1]);
        slab(&mut s, "/World/Wall", 0.0, 10.0, glass);
        slab(&mut s, "/World/Water", -2.0, 9.0, liquid);
        let way = way(&s.build());
        assert_segments(&way, &expected[..way.segments.len()]);
        assert_eq!((way.counters.undecided_overlaps, way.counters.unmatched_exits), (0, 0));
    }
}

#[test]
fn a_camera_in_a_bubble_is_in_air() {
    // A shell of the glass's material with normals towards the air is no glass, for the camera's parity as for the ray.
    let mut s = axial();
    let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
    block(&mut s, "/World/Block", [-20.0; 3], [20.0; 3], glass);
    let inward: Vec<[i32; 4]> = FACES.iter().map(|&[a, b, c, d]| [d, c, b, a]).collect();
    let inward: Vec<&[i32]> = inward.iter().map(|face| &face[..]).collect();
    s.mesh("/World/Bubble", &corners([-1.0, -1.0, 4.0], [1.0, 1.0, 7.0]), &inward, DMat4::IDENTITY, Some(glass));
    let way = way(&s.build());
    assert_segments(&way, &[("", 2.0), ("Glass", 10.0)]);
    assert_eq!((way.chain.dielectric_id, way.counters.unmatched_exits), (1, 0));
}

#[test]
fn the_first_dielectric_is_the_one_entered_whichever_face_is_met() {
    // From glass into a liquid whose face coincides: rounding or the order of description picks the face, not the medium.
    for liquid_first in [false, true] {
        let mut s = axial();
        let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
        let liquid = medium(&mut s, "/World/Liquid", 1.33, 0.8);
        if liquid_first {
            slab(&mut s, "/World/Water", -2.0, 0.0, liquid);
        }
        slab(&mut s, "/World/Wall", 0.0, 10.0, glass);
        if !liquid_first {
            slab(&mut s, "/World/Water", -2.0, 0.0, liquid);
        }
        let scene = s.build();
        let way = way(&scene);
        assert_segments(&way, &[("Glass", 6.0), ("Liquid", 2.0), ("", 4.0)]);
        assert_eq!(scene.materials[way.chain.dielectric_id as usize - 1].path, "/World/Liquid");
        assert_eq!(integers(&rendered(&scene, &request(31, 21, &["interfaces"])).film, "interfaces")[10 * 31 + 15], 2);
    }
}

// ------------------------------------------------------------------------------------------------------ media of equal index

#[test]
fn equal_indices_with_different_absorption_deflect_nothing() {
    let mut s = Stagehand::new();
    let clear = medium(&mut s, "/World/Clear", 1.5, 0.9);
    let dark = medium(&mut s, "/World/Dark", 1.5, 0.3);
    slab(&mut s, "/World/Slab", -2.0, 2.0, clear);
    s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::new(0.0, 0.4, 0.0)), Some(dark));
    s.wall(-6.0, 40.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let way = way(&s.build());
    let chord = 2.0 * (1.0f64 - 0.16).sqrt();
    assert_eq!(way.segments.len(), 5);
    assert!((way.transmittance - 0.9f64.powf(4.0 - chord) * 0.3f64.powf(chord)).abs() < 1e-14);
    assert_eq!(way.chain.direction, DVec3::NEG_Z, "bit for bit");
    assert_eq!(way.chain.interfaces, 4);
}

#[test]
fn the_deflection_vanishes_with_the_difference_of_the_indices() {
    // Into a ball at an impact parameter b the direction turns by twice θ_i − θ_t ≈ 2 (Δn/n) tan θ to first order.
    let deflection = |difference: f64| {
        let mut s = Stagehand::new();
        let outer = medium(&mut s, "/World/Outer", 1.5, 0.9);
        let inner = medium(&mut s, "/World/Inner", 1.5 + difference, 0.3);
        slab(&mut s, "/World/Slab", -50.0, 50.0, outer);
        s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::Y * -0.6), Some(inner));
        s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
        s.wall(-6.0, 40.0, None);
        let direction = way(&s.build()).chain.direction;
        direction.y.hypot(direction.x)
    };
    for difference in [1e-3, 1e-6, 1e-9, 1e-12] {
        let first_order = 2.0 * difference / 1.5 * 0.75;
        let measured = deflection(difference);
        // The next order is relative Δn; 1.5 + Δn is rounded to 2⁻⁵².
        let tolerance = 4.0 * difference + 4.0 * f64::EPSILON / difference;
        assert!((measured / first_order - 1.0).abs() < tolerance, "{difference}: {measured:e} {first_order:e}");
    }
    assert_eq!(deflection(0.0), 0.0);
}

/// A ball in a slab, n_d = 1.5 both, that disperse differently: what is not deflected at the d line moves with λ.
fn christiansen() -> Scene {
    let mut s = Stagehand::new();
    let outer = medium(&mut s, "/World/Outer", 1.5, 0.9);
    let inner = medium(&mut s, "/World/Inner", 1.5, 0.3);
    abbe(&mut s, outer, "dispersion:vd", "double", json!(60.0));
    abbe(&mut s, inner, "dispersion:vd", "double", json!(25.0));
    slab(&mut s, "/World/Slab", -2.0, 2.0, outer);
    s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::new(0.2, 0.4, 0.1)), Some(inner));
    s.wall(-6.0, 40.0, None);
    s.camera(DVec3::new(0.3, 0.1, 6.0), DVec3::new(0.1, 0.0, 0.0));
    s.build()
}

#[test]
fn equal_indices_with_different_dispersion_move_as_the_re_trace_does() {
    let scene = christiansen();
    let at = |difference: f64| {
        end(&follow(&scene, Wavelength::from_nanometers(REFERENCE.nanometers() + difference), DVec2::ZERO))
    };
    let here = way(&scene);
    assert!(here.chain.is_dispersive && here.chain.interfaces == 4);
    let columns = &here.chain.columns;
    let lambda = columns.lambda().unwrap().point;
    let lambda2 = columns.lambda2().unwrap().point;
    assert!(lambda.length() > 1e-6, "{lambda}");
    // Central differences: the error falls with h² until rounding of the hit point takes over.
    let mut best = [f64::INFINITY; 2];
    for exponent in 0..14 {
        let h = 8.0 * 0.5f64.powi(exponent);
        let (above, below) = (at(h), at(-h));
        let first = (above - below) / (2.0 * h);
        let second = (above - 2.0 * end(&here) + below) / (h * h);
        best[0] = best[0].min((first - lambda).length() / lambda.length());
        best[1] = best[1].min((second - lambda2).length() / lambda2.length());
    }
    assert!(best[0] < 1e-8 && best[1] < 1e-3, "{best:?}");
    // The screen columns of the undeflected ray are those of the straight line.
    let pixel = |offset: DVec2| end(&follow(&scene, REFERENCE, offset));
    let [x, y] = columns.screen().unwrap();
    // Raster rows run down, columns up.
    for (column, axis) in [(x, DVec2::X), (y, DVec2::NEG_Y)] {
        let quotient = (pixel(1e-4 * axis) - pixel(-1e-4 * axis)) / 2e-4;
        assert!((quotient - column.point).length() < 1e-7 * quotient.length(), "{quotient} {}", column.point);
    }
}

// -------------------------------------------------------------------------------------------------------- where three meet

#[test]
fn three_media_that_meet_in_an_edge_share_out_the_way() {
    // Index-matched blocks about the edge x = 0, z = 0: the way is straight, and each part of it has one owner. The edge
    // itself, its neighbourhood within rounding, and rays along its plane.
    for (shift, slope) in [
        (0.0, 0.25),
        (1e-16, 0.25),
        (-1e-16, 0.25),
        (1e-9, -0.25),
        (0.0, -0.7),
        (3e-8, 0.1),
        (0.0, 0.85),
        (0.0, 0.0),
        (0.25, 0.5),
    ] {
        let mut s = Stagehand::new();
        let media = ["A", "B", "C"].map(|name| medium(&mut s, &format!("/World/{name}"), 1.5, 0.9));
        // A fills z > 0; B and C share z < 0.
        block(&mut s, "/World/a", [-3.0, -3.0, 0.0], [3.0, 3.0, 2.0], media[0]);
        block(&mut s, "/World/b", [-3.0, -3.0, -2.0], [0.0, 3.0, 0.0], media[1]);
        block(&mut s, "/World/c", [0.0, -3.0, -2.0], [3.0, 3.0, 0.0], media[2]);
        s.wall(-6.0, 400.0, None);
        // Starts inside of A, so that nothing refracts before the edge; under 41.8°, so that nothing is reflected after it.
        s.camera(DVec3::new(shift + slope, 0.0, 1.0), DVec3::new(shift, 0.0, 0.0));
        let way = way(&s.build());
        let stretch = slope.hypot(1.0);
        let owner = |name: &str| way.segments.iter().filter(|(n, _)| n == name).map(|(_, length)| length).sum::<f64>();
        let inside: f64 = ["A", "B", "C"].iter().map(|name| owner(name)).sum();
        assert!((owner("A") - stretch).abs() < 1e-12, "{shift} {slope}: {:?}", way.segments);
        assert!((inside - 3.0 * stretch).abs() < 1e-12, "{shift} {slope}: {:?}", way.segments);
        // Below, the side that the ray runs to.
        let expected = if slope > 1e-3 && shift < 0.1 {
            "B"
        } else if slope < -1e-3 {
            "C"
        } else {
            ""
        };
        if !expected.is_empty() {
            assert!((owner(expected) - 2.0 * stretch).abs() < 1e-6, "{shift} {slope}: {:?}", way.segments);
        }
        assert_eq!(way.counters.unmatched_exits, 0, "{shift} {slope}: {:?}", way.segments);
    }
}

#[test]
fn glass_that_stands_on_a_table_touches_it() {
    // The bottom and the table coincide exactly, in other triangles, in either order of description: no ray slips out
    // between them, none is reflected there, and all arrive in the glass.
    for (table_first, metal) in [(false, false), (true, false), (false, true), (true, true)] {
        let mut s = Stagehand::new();
        let glass = medium(&mut s, "/World/Glass", 1.5, 0.5);
        let silver = metal.then(|| {
            let silver = s.diffuse("/World/Silver");
            let inputs = &mut s.document.materials[silver].surface.as_mut().unwrap().inputs;
            inputs.insert("metallic".into(), authored("float", json!(1.0)));
            inputs.insert("roughness".into(), authored("float", json!(0.0)));
            silver
        });
        if table_first {
            s.wall(0.0, 37.3, silver);
        }
        block(&mut s, "/World/Cube", [-25.1, -25.3, 0.0], [25.2, 25.4, 1.0], glass);
        if !table_first {
            s.wall(0.0, 37.3, silver);
        }
        s.camera(DVec3::new(5.0, 1.0, 6.0), DVec3::new(0.3, 0.1, 0.0));
        let scene = s.build();
        let names = ["interfaces", "total_reflections", "internal_transmittance", "refracted_prim_id"];
        let image = rendered(&scene, &request(31, 21, &names));
        // In by the top; with silver the reflection and out by the top again.
        let interfaces = if metal { 3 } else { 1 };
        assert!(integers(&image.film, "interfaces").iter().all(|&n| n == interfaces), "{table_first} {metal}");
        assert!(integers(&image.film, "total_reflections").iter().all(|&n| n == 0), "{table_first} {metal}");
        assert_eq!(image.statistics.counters.unmatched_exits, 0);
        if !metal {
            let ids = integers(&image.film, "refracted_prim_id");
            assert!(ids.iter().all(|&id| scene.prims.path(id).as_deref() == Some("/World/Wall")), "{table_first}");
        }
    }
}
