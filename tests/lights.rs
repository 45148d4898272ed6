//! Lights of descriptions, compiled: closed forms, links, and descriptions that nobody should have written.

mod support;

use std::f64::consts::PI;

use abbe::light::{Light, Shape};
use abbe::scene::Scene;
use abbe::scene::description::{
    self, Array, Asset, Authored, Element, Group, Instances, LightShape, LightShaping, LinkSet, Placement, Target,
};
use abbe::scene::lights::Lights;
use glam::{DMat4, DQuat, DVec3};
use support::{Stagehand, ball, light};

fn sphere(radius: f64) -> LightShape {
    LightShape::Sphere { radius, treat_as_point: false }
}

fn shaping() -> LightShaping {
    LightShaping {
        focus: 0.0,
        focus_tint: [0.0; 3],
        cone_angle: 180.0,
        cone_softness: 0.0,
        ies: None,
        ies_angle_scale: 0.0,
        ies_normalize: false,
    }
}

fn scene_with(lights: Vec<description::Light>) -> Scene {
    let mut stage = ball();
    stage.document.groups[0].lights = lights;
    stage.build()
}

fn compiled(lights: Vec<description::Light>) -> Lights {
    scene_with(lights).lights().unwrap()
}

fn one(light: description::Light) -> Light {
    let mut lights = compiled(vec![light]).lights;
    assert_eq!(lights.len(), 1);
    lights.remove(0)
}

fn close(found: f64, expected: f64, relative: f64) {
    assert!((found / expected - 1.0).abs() < relative, "{found} is not {expected}");
}

fn shapes() -> Vec<LightShape> {
    vec![
        sphere(0.7),
        LightShape::Rect { width: 2.0, height: 0.5, texture: None },
        LightShape::Disk { radius: 1.5 },
        LightShape::Cylinder { length: 4.0, radius: 0.25, treat_as_line: false },
    ]
}

fn scaled(shape: &LightShape, factor: f64) -> LightShape {
    match *shape {
        LightShape::Sphere { radius, treat_as_point } => LightShape::Sphere { radius: factor * radius, treat_as_point },
        LightShape::Rect { width, height, texture } => {
            LightShape::Rect { width: factor * width, height: factor * height, texture }
        }
        LightShape::Disk { radius } => LightShape::Disk { radius: factor * radius },
        LightShape::Cylinder { length, radius, treat_as_line } => {
            LightShape::Cylinder { length: factor * length, radius: factor * radius, treat_as_line }
        }
        ref other => other.clone(),
    }
}

#[test]
fn power_is_pi_times_luminance_times_area() {
    let bright = description::Light { intensity: 3.0, exposure: 2.0, ..light("/L", sphere(0.5)) };
    close(one(bright).power().unwrap()[0], PI * 12.0 * 4.0 * PI * 0.25, 1e-14);
    for shape in shapes() {
        let light = one(light("/L", shape));
        close(light.power().unwrap()[1], PI * light.shape.area().unwrap(), 1e-14);
    }
}

#[test]
fn normalised_power_does_not_depend_on_size_wherever_it_comes_from() {
    let turn = DMat4::from_scale_rotation_translation(
        DVec3::new(2.0, 3.0, 0.5),
        DQuat::from_rotation_y(0.7),
        DVec3::new(4.0, 5.0, 6.0),
    );
    let shear =
        DMat4::from_cols_array(&[1.0, 0.2, 0.0, 0.0, -0.3, 1.5, 0.1, 0.0, 0.4, 0.0, -1.2, 0.0, 1.0, 1.0, 1.0, 1.0]);
    for shape in shapes() {
        for factor in [1e-6, 1.0, 40.0] {
            for transform in [None, Some(turn.to_cols_array()), Some(shear.to_cols_array())] {
                let authored = light("/L", scaled(&shape, factor));
                let light = one(description::Light { normalize: true, transform, ..authored });
                close(light.power().unwrap()[2], PI, 1e-12);
            }
        }
    }
}

/// A lamp that many directions see: what shaping leaves of its power has a closed form.
#[test]
fn cones_leave_their_share_of_the_power() {
    let angle: f64 = 50.0;
    let cone = LightShaping { cone_angle: angle, ..shaping() };
    let shaped = |shape| one(description::Light { shaping: Some(cone.clone()), ..light("/L", shape) });
    // A ball shows the same disk in all directions, a flat lamp its cosine. Half a step of the sum's angle, 1.4°, is 5 % here.
    let ball = shaped(sphere(0.7));
    let solid_angle = 2.0 * PI * (1.0 - angle.to_radians().cos());
    close(ball.power().unwrap()[0], PI * 0.49 * solid_angle, 0.05);
    let disk = shaped(LightShape::Disk { radius: 0.7 });
    close(disk.power().unwrap()[0], PI * 0.49 * PI * angle.to_radians().sin().powi(2), 0.05);
    let focused = LightShaping { focus: 3.0, ..shaping() };
    let focused = one(description::Light { shaping: Some(focused), ..light("/L", sphere(0.7)) });
    close(focused.power().unwrap()[0], PI * 0.49 * 4.0 * PI / 4.0, 1e-3);
}

#[test]
fn points_and_lines_send_what_their_shapes_send_far_away() {
    let normalized = |shape| one(description::Light { normalize: true, ..light("/L", shape) });
    // A normalised sphere: L π r² = π r² / 4 π r² = ¼ in every direction; also of radius 0.
    for (radius, treat_as_point) in [(0.3, true), (0.0, true), (0.0, false)] {
        let light = normalized(LightShape::Sphere { radius, treat_as_point });
        assert!(matches!(&light.shape, Shape::Sphere(ball) if ball.is_point), "{radius}");
        for d in [DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
            close(light.emission.rgb[0] * light.shape.projected_area(d).unwrap(), 0.25, 1e-14);
        }
    }
    // A line sends nothing along itself and most across.
    let line = normalized(LightShape::Cylinder { length: 2.0, radius: 0.0, treat_as_line: false });
    assert!(matches!(&line.shape, Shape::Cylinder(tube) if tube.is_line));
    let sent = |d: DVec3| line.emission.rgb[0] * line.shape.projected_area(d).unwrap();
    assert!(sent(DVec3::X).abs() < 1e-15);
    close(sent(DVec3::Y), 1.0 / PI, 1e-14);
    close(sent(DVec3::new(0.8, 0.0, 0.6)), 0.6 / PI, 1e-14);
    // A radius of 0 without normalisation is no light.
    assert!(compiled(vec![light("/L", sphere(0.0))]).lights.is_empty());
}

/// Members are asked by object, as the scene numbers them, whether sets list members or the others.
#[test]
fn links_are_found_by_object() {
    for excludes in [false, true] {
        let mut stage = Stagehand::new();
        for path in ["/A", "/B"] {
            stage.sphere(path, 1.0, DMat4::IDENTITY, None);
        }
        stage.sphere("/P/C", 1.0, DMat4::IDENTITY, None);
        let mut part = stage.document.groups[0].items.pop().unwrap();
        let listed = |is_member: bool| if is_member != excludes { vec![0] } else { vec![] };
        for (item, is_member) in stage.document.groups[0].items.iter_mut().zip([true, false]) {
            item.link_sets = listed(is_member);
        }
        part.link_sets = listed(true);
        stage.document.link_sets = vec![LinkSet { path: "/L.collection:lightLink".into(), excludes }];
        stage.document.groups.push(Group { path: "/P".into(), items: vec![part], ..Group::default() });
        for (path, link_sets) in [("/Own", None), ("/Other", Some(listed(false)))] {
            let rows = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 5.0, 0.0, 0.0];
            stage.arrays.insert(path.into(), Array::from_vec(Element::F64, 12, [rows, rows].concat()));
            stage.document.groups[0].instances.push(Instances {
                path: path.into(),
                group: 1,
                transforms: path.into(),
                count: 2,
                link_sets,
                ..Instances::default()
            });
        }
        let mut lamp = light("/L", sphere(1.0));
        lamp.light_link = Some(0);
        stage.document.groups[0].lights.push(lamp);
        let scene = stage.build();
        let lights = scene.lights().unwrap().lights;
        assert_eq!((lights[0].illuminates, lights[0].shadowed_by), (Some(0), None));
        let linked: Vec<_> = (0..scene.objects.len()).map(|object| scene.is_linked(0, object)).collect();
        assert_eq!(linked, [true, false, true, true, false, false], "excludes {excludes}");
    }
}

#[test]
fn geometry_shines_wherever_its_prim_is_placed() {
    let mut stage = ball();
    let path = stage.document.groups[0].items[0].path.clone();
    let shape = LightShape::Geometry { prims: vec![path.clone()], material_sync_mode: "independent".into() };
    stage.document.groups[0].lights = vec![light("/L", shape)];
    let scene = stage.build();
    let lights = scene.lights().unwrap().lights;
    let Shape::Geometry(geometry) = &lights[0].shape else { panic!("{:?}", lights[0].shape) };
    assert_eq!(geometry.prim_ids.len(), 1);
    assert_eq!(scene.prims.path(geometry.prim_ids[0]), Some(path));
    // Of prims that nothing places there is no light, and that is said.
    let shape = LightShape::Geometry { prims: vec!["/Gone".into()], material_sync_mode: "independent".into() };
    let lights = compiled(vec![light("/L", shape)]);
    assert!(lights.lights.is_empty());
    assert_eq!(lights.diagnostics.warnings()[0].places, ["/L"]);
}

#[test]
fn portals_are_the_domes() {
    let dome = LightShape::Dome {
        texture: None,
        format: "latlong".into(),
        pole_axis: "Z".into(),
        guide_radius: 1e5,
        portals: vec!["/Window".into(), "/Gone".into()],
    };
    let window = light("/Window", LightShape::Portal { width: 2.0, height: 3.0 });
    let lights = compiled(vec![light("/Sky", dome), window]).lights;
    assert_eq!(lights.len(), 1);
    let Shape::Dome(dome) = &lights[0].shape else { panic!("{:?}", lights[0].shape) };
    assert_eq!(dome.portals.len(), 1);
    close(dome.portals[0].area, 6.0, 1e-14);
    // The pole on +Z; the middle of the image is −Y (UsdLux, DomeLight_1).
    assert!((dome.environment_from_world * DVec3::Z - DVec3::Y).length() < 1e-15);
    assert!((dome.environment_from_world * -DVec3::Y - DVec3::Z).length() < 1e-15);
}

#[test]
fn lights_that_cannot_be_are_left_out_and_named() {
    let singular = Some(DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0)).to_cols_array());
    let unbounded = Some(DMat4::from_scale(DVec3::splat(1e200)).to_cols_array());
    let mut cone = light("/L", sphere(1.0));
    cone.shaping = Some(LightShaping { cone_angle: -1.0, ..shaping() });
    let of = |shape: LightShape| light("/L", shape);
    let broken = vec![
        ("/L.inputs:radius", of(sphere(-1.0))),
        ("/L.inputs:width", of(LightShape::Rect { width: -1.0, height: 1.0, texture: None })),
        ("/L.inputs:length", of(LightShape::Cylinder { length: -2.0, radius: 1.0, treat_as_line: false })),
        ("/L", of(LightShape::Rect { width: 0.0, height: 1.0, texture: None })),
        ("/L", of(sphere(1e200))),
        ("/L.inputs:intensity", description::Light { intensity: -1.0, ..of(sphere(1.0)) }),
        ("/L", description::Light { exposure: 1e6, ..of(sphere(1.0)) }),
        ("/L", description::Light { intensity: 1e300, ..of(sphere(1.0)) }),
        ("/L", description::Light { transform: singular, ..of(sphere(1.0)) }),
        ("/L", description::Light { transform: unbounded, ..of(sphere(1.0)) }),
        ("/L.inputs:shaping:cone:angle", cone),
    ];
    for (place, light) in broken {
        let scene = scene_with(vec![light, self::light("/Fine", sphere(1.0))]);
        let lights = scene.lights().unwrap();
        let paths: Vec<_> = lights.lights.iter().map(|light| light.path.as_str()).collect();
        assert_eq!(paths, ["/Fine"], "{place}");
        let warnings = scene.diagnostics().warnings().iter().chain(lights.diagnostics.warnings());
        let named: Vec<_> = warnings.filter(|w| w.places.iter().any(|p| p == place)).collect();
        assert_eq!(named.len(), 1, "{place}: {named:?}");
        assert!(named[0].message.contains("left out"), "{}", named[0].message);
    }
    // Switched off is not broken.
    let scene = scene_with(vec![description::Light { intensity: 0.0, ..of(sphere(1.0)) }]);
    assert!(scene.lights().unwrap().lights.is_empty() && scene.diagnostics().warnings().is_empty());
}

#[test]
fn what_has_no_meaning_counts_as_not_authored() {
    let text = |value: &str| Authored { type_name: "token".into(), value: value.into() };
    let with = |name: &str, value: Authored| {
        let mut light = light("/L", sphere(1.0));
        light.abbe.insert(name.into(), value);
        light
    };
    let dome = |format: &str, pole_axis: &str| {
        let (format, pole_axis) = (format.into(), pole_axis.into());
        light("/L", LightShape::Dome { texture: None, format, pole_axis, guide_radius: 1.0, portals: vec![] })
    };
    let mut spotlit = dome("latlong", "Y");
    spotlit.shaping = Some(LightShaping { focus: 1.0, ..shaping() });
    let odd = vec![
        ("/L.abbe:illuminant", with("abbe:illuminant", text("moonlight"))),
        ("/L.abbe:spectrum:table", with("abbe:spectrum:table", text("nm"))),
        ("/L.abbe:lightGroup", with("abbe:lightGroup", Authored { type_name: "int".into(), value: 3.into() })),
        ("/L.inputs:texture:format", dome("octahedral", "Y")),
        ("/L.poleAxis", dome("latlong", "X")),
        ("/L.inputs:color", description::Light { color: [1.0, -1.0, 0.0], ..light("/L", sphere(1.0)) }),
        ("/L.inputs:diffuse", description::Light { diffuse: -1.0, ..light("/L", sphere(1.0)) }),
        ("/L", spotlit),
    ];
    for (place, light) in odd {
        let scene = scene_with(vec![light]);
        let warnings = scene.diagnostics().warnings();
        assert_eq!(warnings.len(), 1, "{place}: {warnings:?}");
        assert_eq!(warnings[0].places, [place]);
        let lights = scene.lights().unwrap();
        assert_eq!(lights.lights.len(), 1);
        assert!(lights.diagnostics.warnings().is_empty(), "said already");
        assert!(lights.lights[0].emission.rgb[1] >= 0.0);
    }
}

#[test]
fn damaged_scene_files_are_refused() {
    let refused = |edit: &dyn Fn(&mut Stagehand), words: &str| {
        let mut stage = ball();
        stage.document.groups[0].lights = vec![light("/L", sphere(1.0))];
        edit(&mut stage);
        let error = Scene::build(stage.description()).expect_err(words).to_string();
        assert!(error.contains(words), "'{error}' does not say '{words}'");
    };
    refused(&|s| s.document.groups[0].lights[0].light_link = Some(0), "link sets");
    refused(&|s| s.document.groups[0].lights[0].shadow_link = Some(usize::MAX), "link sets");
    refused(&|s| s.document.groups[0].items[0].link_sets = vec![0], "link sets");
    let two = |path: &str| LinkSet { path: path.into(), excludes: false };
    refused(
        &|s| {
            s.document.link_sets = vec![two("/A"), two("/B")];
            s.document.groups[0].items[0].link_sets = vec![1, 0];
        },
        "link sets",
    );
    refused(
        &|s| s.document.groups[0].lights[0].shape = LightShape::Rect { width: 1.0, height: 1.0, texture: Some(7) },
        "texture 7",
    );
}

/// 2⁴⁰ lights by nesting take neither time nor memory.
#[test]
fn an_explosion_of_lights_is_left_out() {
    let mut stage = ball();
    let rows: Vec<f64> =
        (0..1024).flat_map(|i| [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, f64::from(i), 0.0, 0.0]).collect();
    stage.arrays.insert("rows".into(), Array::from_vec(Element::F64, 12, rows));
    for level in 0..4 {
        stage.document.groups[level].instances.push(Instances {
            path: format!("/I{level}"),
            group: level + 1,
            transforms: "rows".into(),
            count: 1024,
            ..Instances::default()
        });
        stage.document.groups.push(Group { path: format!("/P{level}"), ..Group::default() });
    }
    stage.document.groups[4].lights = vec![light("/L", sphere(1.0))];
    stage.document.groups[0].lights = vec![light("/Fine", sphere(1.0))];
    // As geometry that many would be refused, and so are groups that are only walked through.
    match Scene::build(stage.description()) {
        Err(error) => assert!(error.to_string().contains("objects"), "{error}"),
        Ok(scene) => {
            let lights = scene.lights().unwrap();
            assert_eq!(lights.lights.len(), 1);
            assert_eq!(lights.diagnostics.warnings()[0].places, ["/I0"]);
        }
    }
}

#[test]
fn groups_placed_by_themselves_carry_their_lights() {
    let mut stage = ball();
    stage.document.groups.push(Group {
        path: "/Prototype".into(),
        lights: vec![description::Light {
            transform: Some(DMat4::from_translation(DVec3::Y).to_cols_array()),
            ..light("/L", sphere(1.0))
        }],
        ..Group::default()
    });
    for x in [3.0, 7.0] {
        stage.document.groups[0].items.push(Placement {
            path: "/Copy".into(),
            target: Target::Group(1),
            transform: Some(DMat4::from_translation(DVec3::X * x).to_cols_array()),
            ..Placement::default()
        });
    }
    let centers: Vec<_> = stage
        .build()
        .lights()
        .unwrap()
        .lights
        .iter()
        .map(|light| match &light.shape {
            Shape::Sphere(ball) => ball.center,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(centers, [DVec3::new(3.0, 1.0, 0.0), DVec3::new(7.0, 1.0, 0.0)]);
}

#[test]
fn profiles_come_from_scenes_too_and_missing_ones_are_named() {
    let profile = "TILT=NONE\n1 1 1 2 1 1 1 0 0 0 1 1 1\n0 180\n0\n5 5\n";
    let shaped = |asset: Asset| {
        let mut light = light("/L", sphere(1.0));
        light.shaping = Some(LightShaping { ies: Some(asset), ..shaping() });
        light
    };
    let mut stage = ball();
    stage.arrays.insert("lamp".into(), Array::from_vec(Element::U8, 1, profile.as_bytes().to_vec()));
    let asset = Asset { path: "x.usdz[lamp.ies]".into(), file: None, content: Some("lamp".into()) };
    stage.document.groups[0].lights = vec![shaped(asset)];
    let lights = stage.build().lights().unwrap();
    assert!(lights.diagnostics.warnings().is_empty());
    for d in [DVec3::X, DVec3::NEG_Z] {
        close(lights.lights[0].shaped(d)[0], 5.0, 1e-14);
    }
    // A file goes into a scene that is to be whole on another machine.
    let file = std::env::temp_dir().join(format!("abbe-lights-{}.ies", std::process::id()));
    std::fs::write(&file, profile).unwrap();
    let asset = Asset { path: "lamp.ies".into(), file: Some(file.display().to_string()), content: None };
    let whole = abbe::scene::file::embedded(scene_with(vec![shaped(asset)]).description());
    std::fs::remove_file(&file).unwrap();
    let lights = Scene::build(whole).unwrap().lights().unwrap();
    close(lights.lights[0].shaped(DVec3::X)[0], 5.0, 1e-14);

    for (file, words) in [(None, "not found"), (Some("/nowhere/lamp.ies"), "cannot be read"), (Some("/"), "no file")] {
        let asset = Asset { path: "lamp.ies".into(), file: file.map(Into::into), content: None };
        let lights = compiled(vec![shaped(asset.clone())]);
        assert!(lights.lights[0].shaping.is_none());
        let [warning] = lights.diagnostics.warnings() else { panic!("{:?}", lights.diagnostics) };
        assert!(warning.message.contains("lamp.ies") && warning.message.contains(words), "{}", warning.message);
        let mut strict = ball();
        strict.document.strict_assets = true;
        strict.document.groups[0].lights = vec![shaped(asset)];
        assert!(strict.build().lights().unwrap_err().to_string().contains(words));
    }
}
