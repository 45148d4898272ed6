//! What the specular chain does at every kind of surface, in closed form.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use abbe::integrator::chain::MAX_EVENTS;
use glam::{DMat4, DVec3};
use serde_json::json;
use support::{Stagehand, authored, floats, integers, rendered, request};

/// The camera looks along −z at the origin from 6; a wall stands at −6.
fn before_a_wall() -> Stagehand {
    let mut s = Stagehand::new();
    s.wall(-6.0, 40.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    s
}

const AOVS: &[&str] = &[
    "interfaces",
    "total_reflections",
    "refracted_position",
    "position",
    "dispersion",
    "refracted_prim_id",
    "prim_id",
    "ior",
    "depth",
];

/// Interfaces at the centre of an image of odd size, and where the chain ends there.
fn centre(s: Stagehand) -> (u32, u32, [f32; 3], u32) {
    let film = rendered(&s.build(), &request(31, 21, AOVS)).film;
    let i = 10 * 31 + 15;
    let (position, _) = floats(&film, "refracted_position");
    (
        integers(&film, "interfaces")[i],
        integers(&film, "total_reflections")[i],
        [position[3 * i], position[3 * i + 1], position[3 * i + 2]],
        integers(&film, "refracted_prim_id")[i],
    )
}

fn set(s: &mut Stagehand, material: usize, input: &str, type_name: &str, value: serde_json::Value) {
    let surface = s.document.materials[material].surface.as_mut().unwrap();
    surface.inputs.insert(input.into(), authored(type_name, value));
}

fn near(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn thin_walls_go_straight_through_without_dispersion() {
    let mut s = before_a_wall();
    let glass = s.glass("/World/Glass", support::SF11);
    set(&mut s, glass, "geometry_thin_walled", "bool", json!(true));
    s.sphere("/World/Bubble", 1.0, DMat4::from_translation(DVec3::new(0.4, 0.3, 0.0)), Some(glass));
    let film = rendered(&s.build(), &request(31, 21, AOVS)).film;
    assert!(integers(&film, "interfaces").contains(&2));
    assert!(floats(&film, "dispersion").0.iter().all(|&v| v == 0.0));
    // Straight: what is seen behind the sphere is where the same pixel sees without it.
    let plain = rendered(&before_a_wall().build(), &request(31, 21, AOVS)).film;
    let (through, direct) = (floats(&film, "refracted_position").0, floats(&plain, "refracted_position").0);
    assert!(through.iter().zip(direct).all(|(a, b)| (a - b).abs() < 1e-5));
}

#[test]
fn cut_outs_are_not_there() {
    let mut s = before_a_wall();
    let ghost = s.diffuse("/World/Ghost");
    set(&mut s, ghost, "opacity", "float", json!(0.0));
    set(&mut s, ghost, "opacityMode", "token", json!("presence"));
    s.sphere("/World/Ghost", 1.0, DMat4::IDENTITY, Some(ghost));
    let film = rendered(&s.build(), &request(31, 21, AOVS)).film;
    assert!(integers(&film, "interfaces").iter().all(|&n| n == 0));
    assert!(integers(&film, "prim_id").iter().all(|&id| id == 1), "the wall is the first surface");
    assert!(floats(&film, "depth").0.iter().all(|&d| (d - 12.0).abs() < 1e-5));
}

#[test]
fn smooth_metal_mirrors_and_rough_metal_ends() {
    for (roughness, interfaces, z) in [(0.0, 1, 12.0), (0.5, 0, 1.0)] {
        let mut s = before_a_wall();
        // A second wall behind the camera, facing it.
        s.mesh(
            "/World/Behind",
            &[[-90.0, -90.0, 12.0], [-90.0, 90.0, 12.0], [90.0, 90.0, 12.0], [90.0, -90.0, 12.0]],
            &[&[0, 1, 2, 3]],
            DMat4::IDENTITY,
            None,
        );
        let metal = s.diffuse("/World/Metal");
        set(&mut s, metal, "metallic", "float", json!(1.0));
        set(&mut s, metal, "roughness", "float", json!(roughness));
        s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(metal));
        let (met, total, end, _) = centre(s);
        assert_eq!((met, total), (interfaces, 0), "roughness {roughness}");
        assert!(near(end, [0.0, 0.0, z]), "{end:?}");
    }
}

#[test]
fn the_innermost_or_the_strongest_glass_is_the_medium() {
    // A small sphere inside of a big one, seen along the axis: 4 interfaces, whatever their priorities; with the big
    // one stronger the small one is not there.
    for (big, small, interfaces) in [(0, 0, 4), (2, 1, 4), (1, 2, 2), (1, 0, 2), (0, 1, 4)] {
        let mut s = before_a_wall();
        let outer = s.glass_with_priority("/World/Outer", support::BK7, big);
        let inner = s.glass_with_priority("/World/Inner", support::SF11, small);
        s.sphere("/World/Big", 2.0, DMat4::IDENTITY, Some(outer));
        s.sphere("/World/Small", 1.0, DMat4::IDENTITY, Some(inner));
        assert_eq!(centre(s).0, interfaces, "priorities {big}, {small}");
    }
}

#[test]
fn a_bubble_with_inward_normals_is_air() {
    // As a shell of the same glass with normals towards the air: entering the bubble leaves the glass.
    let mut s = before_a_wall();
    let glass = s.glass("/World/Glass", support::BK7);
    s.sphere("/World/Big", 2.0, DMat4::IDENTITY, Some(glass));
    let h = 0.7;
    let corners: Vec<[f32; 3]> = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -h } else { h })).collect();
    // Wound so that the normals point inwards.
    let faces: [&[i32]; 6] = [&[0, 1, 3, 2], &[4, 6, 7, 5], &[0, 4, 5, 1], &[2, 3, 7, 6], &[0, 2, 6, 4], &[1, 5, 7, 3]];
    s.mesh("/World/Bubble", &corners, &faces, DMat4::IDENTITY, Some(glass));
    let image = rendered(&s.build(), &request(31, 21, AOVS));
    assert_eq!(integers(&image.film, "interfaces")[10 * 31 + 15], 4);
    assert_eq!(image.statistics.counters.unmatched_exits, 0);
}

#[test]
fn a_right_angle_prism_reflects_totally_and_does_not_disperse() {
    // Enters a leg at normal incidence, is reflected at the hypotenuse, leaves by the other leg: −z becomes +x.
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::BK7);
    let mut points = Vec::new();
    for y in [-1.0, 1.0] {
        points.extend([[-1.0, y, 1.0], [1.0, y, 1.0], [1.0, y, -1.0]]);
    }
    let faces: [&[i32]; 5] = [&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
    s.mesh("/World/Prism", &points, &faces, DMat4::IDENTITY, Some(glass));
    s.mesh(
        "/World/Side",
        &[[9.0, -9.0, -9.0], [9.0, -9.0, 9.0], [9.0, 9.0, 9.0], [9.0, 9.0, -9.0]],
        &[&[0, 1, 2, 3]],
        DMat4::IDENTITY,
        None,
    );
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let film = rendered(
        &s.build(),
        &request(31, 21, &["interfaces", "total_reflections", "refracted_position", "ddirection_dlambda", "ior"]),
    )
    .film;
    let i = 10 * 31 + 15;
    assert_eq!((integers(&film, "interfaces")[i], integers(&film, "total_reflections")[i]), (3, 1));
    let end = &floats(&film, "refracted_position").0[3 * i..][..3];
    assert!(near([end[0], end[1], end[2]], [9.0, 0.0, 0.0]), "{end:?}");
    let (change, valid) = floats(&film, "ddirection_dlambda");
    let (ior, _) = floats(&film, "ior");
    // Rays that reach the side wall have taken this way; others leave by the hypotenuse, and disperse.
    let arrived = floats(&film, "refracted_position").1;
    let through: Vec<_> = (0..31 * 21)
        .filter(|&i| integers(&film, "total_reflections")[i] == 1 && arrived[i] == 1.0 && valid[i] == 1.0)
        .collect();
    assert!(through.len() > 50);
    for i in through {
        // |n'| is 4e-5/nm: what is left is rounding.
        assert!(change[3 * i..][..3].iter().all(|v| v.abs() < 1e-18), "{:?}", &change[3 * i..][..3]);
        assert!((ior[i] - 1.5168).abs() < 1e-5);
    }
}

#[test]
fn a_chain_without_an_end_has_no_values() {
    // Two mirrors that face each other.
    let mut s = Stagehand::new();
    let metal = s.diffuse("/World/Metal");
    set(&mut s, metal, "metallic", "float", json!(1.0));
    set(&mut s, metal, "roughness", "float", json!(0.0));
    s.wall(-6.0, 4000.0, Some(metal));
    s.mesh(
        "/World/Behind",
        &[[-4e3, -4e3, 7.0], [-4e3, 4e3, 7.0], [4e3, 4e3, 7.0], [4e3, -4e3, 7.0]],
        &[&[0, 1, 2, 3]],
        DMat4::IDENTITY,
        Some(metal),
    );
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let image = rendered(&s.build(), &request(31, 21, AOVS));
    assert!(integers(&image.film, "interfaces").iter().all(|&n| n == MAX_EVENTS));
    for name in ["refracted_position", "dispersion"] {
        assert!(floats(&image.film, name).1.iter().all(|&v| v == 0.0), "{name} is absent");
    }
    assert!(floats(&image.film, "position").1.iter().all(|&v| v == 1.0), "the first surface is known");
    assert_eq!(image.statistics.counters.exhausted, 31 * 21);
}

#[test]
fn a_miss_has_a_direction_but_no_position() {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::SF11);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.2, 0.1, 6.0), DVec3::ZERO);
    let names = [
        "ddirection_dlambda",
        "dispersion",
        "dispersion2",
        "dposition_dlambda",
        "dispersion_footprint",
        "refracted_position",
    ];
    let film = rendered(&s.build(), &request(31, 21, &names)).film;
    for (name, expected) in names.iter().zip([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) {
        assert!(floats(&film, name).1.iter().all(|&v| v == expected), "{name}");
    }
    assert!(floats(&film, "dispersion").0.iter().any(|&v| v != 0.0));
}
