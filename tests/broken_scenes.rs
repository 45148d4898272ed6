//! Bad input gives an error that names the place and the remedy: nothing panics, nothing hangs.

mod support;

use abbe::error::Error;
use abbe::integrator::Registry;
use abbe::render::{Request, plan};
use abbe::scene::Scene;
use abbe::scene::description::{Array, Description, Element, Group, Placement, Shape, Target};
use abbe::scene::file;
use glam::DMat4;
use support::{Stagehand, ball, request};

fn error(description: Description) -> Error {
    match Scene::build(description) {
        Ok(_) => panic!("the scene was accepted"),
        Err(error) => error,
    }
}

fn assert_says(error: &Error, place: &str, words: &str) {
    let text = error.to_string();
    assert!(text.starts_with(place), "'{text}' does not begin with '{place}'");
    assert!(text.contains(words), "'{text}' does not say '{words}'");
    assert!(!text.contains('\n'), "'{text}' is more than one line");
}

/// What the stage says of one prim and nobody can render: that prim is left out and named, the rest is there.
fn assert_left_out(description: Description, kind: &str, place: &str, words: &str) {
    let others = ball().build().objects.len();
    let scene = Scene::build(description).expect("the rest is rendered");
    assert_eq!(scene.objects.len(), others, "{place}");
    let warning = scene.diagnostics().warnings().iter().find(|w| w.kind == kind).expect("a warning");
    assert!(warning.places[0].starts_with(place), "{warning:?} does not begin with '{place}'");
    assert!(warning.message.contains(words), "{warning:?} does not say '{words}'");
    assert!(!warning.message.contains('\n'), "{warning:?} is more than one line");
}

fn with_mesh(points: &[[f32; 3]], faces: &[&[i32]]) -> Description {
    let mut s = ball();
    s.mesh("/World/Mesh", points, faces, DMat4::IDENTITY, None);
    s.description()
}

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn a_mesh_with_broken_topology_is_left_out() {
    let says = |description, words: &str| assert_left_out(description, "broken-shape", "/World/Mesh.", words);
    says(with_mesh(&TRIANGLE, &[&[0, 1, 3]]), "index 2 is 3, but there are 3 points");
    says(with_mesh(&TRIANGLE, &[&[0, 1, -1]]), "-1");
    let mut nan = TRIANGLE;
    nan[1][2] = f32::NAN;
    says(with_mesh(&nan, &[&[0, 1, 2]]), "finite");
    let mut wrong_sum = with_mesh(&TRIANGLE, &[&[0, 1, 2]]);
    wrong_sum.arrays.insert("shape2.counts".into(), Array::from_vec(Element::I32, 1, vec![4i32]));
    says(wrong_sum, "counts add up to 4, but faceVertexIndices has 3");
}

#[test]
fn arrays_of_the_wrong_kind_are_refused() {
    let mut missing = with_mesh(&TRIANGLE, &[&[0, 1, 2]]);
    missing.arrays.remove("shape2.points");
    assert_says(&error(missing), "/World/Mesh", "missing");
    let mut wrong = with_mesh(&TRIANGLE, &[&[0, 1, 2]]);
    wrong.arrays.insert("shape2.points".into(), Array::from_vec(Element::I32, 3, vec![0i32; 9]));
    assert_says(&error(wrong), "/World/Mesh", "F32");
    let mut lying = with_mesh(&TRIANGLE, &[&[0, 1, 2]]);
    lying.arrays.get_mut("shape2.points").unwrap().shape = vec![usize::MAX / 2, 3];
    assert_says(&error(lying), "/World/Mesh", "shape");
}

fn nested(groups: Vec<Group>) -> Description {
    let mut description = ball().description();
    description.document.groups.extend(groups);
    description.document.groups[0].items.push(placement("/World/Nested", Target::Group(1)));
    description
}

fn placement(path: &str, target: Target) -> Placement {
    Placement { path: path.into(), target, ..Placement::default() }
}

fn group(path: &str, items: Vec<Placement>) -> Group {
    Group { path: path.into(), items, ..Group::default() }
}

#[test]
fn cyclic_instances_are_named() {
    let cycle = nested(vec![
        group("/A", vec![placement("/A/b", Target::Group(2))]),
        group("/B", vec![placement("/B/a", Target::Group(1))]),
    ]);
    assert_says(&error(cycle), "/B/a", "cycle");
}

#[test]
fn an_explosion_of_instances_is_refused_before_it_happens() {
    let mut groups: Vec<Group> = (0..40)
        .map(|i| {
            group(&format!("/G{i}"), (0..4).map(|k| placement(&format!("/G{i}/{k}"), Target::Group(i + 2))).collect())
        })
        .collect();
    groups.push(group("/Leaf", vec![placement("/Leaf/s", Target::Shape(0))]));
    assert_says(&error(nested(groups)), "/", "unroll");
}

#[test]
fn deep_nesting_does_not_overflow_the_stack() {
    let depth = 200_000;
    let mut groups: Vec<Group> =
        (0..depth).map(|i| group("/deep", vec![placement("/deep/i", Target::Group(i + 2))])).collect();
    groups.push(group("/Leaf", vec![placement("/Leaf/s", Target::Shape(0))]));
    let scene = Scene::build(nested(groups)).unwrap();
    assert_eq!(scene.objects.len(), 3);
}

#[test]
fn indices_out_of_range_are_refused() {
    for target in [Target::Shape(99), Target::Group(99)] {
        let mut description = ball().description();
        description.document.groups[0].items.push(placement("/World/Lost", target));
        assert_says(&error(description), "/World/Lost", "99");
    }
    let mut description = ball().description();
    description.document.groups[0].items[0].material = Some(99);
    assert_says(&error(description), "/World/Wall", "99");
    let mut description = ball().description();
    description.document.root = 5;
    assert_says(&error(description), "test.usda", "5");
}

#[test]
fn transforms_are_checked() {
    let mut projective = DMat4::IDENTITY.to_cols_array();
    projective[7] = 0.5;
    for (transform, words) in [([f64::NAN; 16], "not finite"), (projective, "projective")] {
        let mut description = ball().description();
        let mut moved = description.document.groups[0].items[0].clone();
        (moved.path, moved.transform) = ("/World/Moved".into(), Some(transform));
        description.document.groups[0].items.push(moved);
        assert_left_out(description, "broken-transform", "/World/Moved", words);
    }
    // Scaled to nothing is how animators hide things: left out, and said so.
    let mut s = ball();
    s.sphere("/World/Flat", 1.0, DMat4::from_scale(glam::DVec3::new(1.0, 0.0, 1.0)), None);
    let scene = s.build();
    assert_eq!(scene.objects.len(), 2);
    assert!(
        scene.diagnostics().warnings().iter().any(|w| w.kind == "singular-transform" && w.places == ["/World/Flat"])
    );
}

#[test]
fn a_sphere_without_a_size_is_left_out() {
    for (radius, kind, words) in [
        (0.0, "empty-shape", "size is 0"),
        (-1.0, "broken-shape", "is -1: it must be positive"),
        (f64::NAN, "broken-shape", "NaN"),
        (f64::INFINITY, "broken-shape", "inf"),
    ] {
        let mut s = ball();
        s.sphere("/World/Other", radius, DMat4::IDENTITY, None);
        assert_left_out(s.description(), kind, "/World/Other", words);
    }
}

#[test]
fn solids_without_a_size_are_left_out() {
    let solids = |size: f64| {
        let (path, axis) = (|| "/World/Solid".to_owned(), || "X".to_owned());
        [
            ("size", Shape::Cube { path: path(), size }),
            ("length", Shape::Plane { path: path(), width: 1.0, length: size, axis: axis() }),
            (
                "height",
                Shape::Cylinder { path: path(), height: size, radius_bottom: 1.0, radius_top: 0.5, axis: axis() },
            ),
            (
                "radius",
                Shape::Cylinder { path: path(), height: 1.0, radius_bottom: size, radius_top: size, axis: axis() },
            ),
            ("radius", Shape::Cone { path: path(), height: 1.0, radius: size, axis: axis() }),
            (
                "radius",
                Shape::Capsule { path: path(), height: 1.0, radius_bottom: size, radius_top: size, axis: axis() },
            ),
        ]
    };
    for (name, solid) in [-1.0, f64::NAN, f64::INFINITY].into_iter().flat_map(solids) {
        let mut s = ball();
        s.solid(solid, DMat4::IDENTITY, None);
        let place = format!("/World/Solid.{name}");
        assert_left_out(s.description(), "broken-shape", &place, "must be finite and not negative");
    }
    for (_, solid) in solids(0.0) {
        let mut s = ball();
        s.solid(solid, DMat4::IDENTITY, None);
        let scene = s.build();
        assert_eq!(scene.objects.len(), 2);
        let warning = scene.diagnostics().warnings().iter().find(|w| w.kind == "empty-shape").expect("a warning");
        assert_eq!(warning.places, ["/World/Solid"]);
    }
    let mut s = ball();
    s.solid(Shape::Cone { path: "/C".into(), height: 1.0, radius: 1.0, axis: "W".into() }, DMat4::IDENTITY, None);
    assert_left_out(s.description(), "broken-shape", "/C.axis", "X, Y or Z");
    // No sphere touches a cone that is flat.
    let mut s = ball();
    let flat = Shape::Capsule { path: "/C".into(), height: 0.0, radius_bottom: 1.0, radius_top: 2.0, axis: "Z".into() };
    s.solid(flat, DMat4::IDENTITY, None);
    assert_left_out(
        s.description(),
        "broken-shape",
        "/C",
        "height 0, radiusBottom 1, radiusTop 2: there is no such solid",
    );
}

#[test]
fn open_glass_is_warned_of() {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::BK7);
    s.wall(0.0, 1.0, Some(glass));
    s.camera(glam::DVec3::Z, glam::DVec3::ZERO);
    let scene = s.build();
    let warning = scene.diagnostics().warnings().iter().find(|w| w.kind == "open-glass-mesh").expect("a warning");
    assert_eq!(warning.places, ["/World/Wall"]);
}

#[test]
fn requests_are_checked() {
    let scene = ball().build();
    let says = |request: Request, place: &str, words: &str| {
        let error = plan(&scene, &request, &Registry::default()).expect_err("the request was accepted");
        assert_says(&error, place, words);
        assert_eq!(error.exit_code(), 2, "{error}");
    };
    says(request(0, 10, &["depth"]), "--width", "0");
    says(request(10, 10, &["depht"]), "--aov depht", "abbe aovs");
    let without_light = Request { integrator: Some("differentials".into()), ..request(10, 10, &["color"]) };
    says(without_light, "--aov color", "has no 'color'");
    says(request(10, 10, &["lpe:CXL"]), "--aov lpe:CXL", "'X' at place 2");
    says(request(10, 10, &["light_group:"]), "--aov light_group:", "needs an argument");
    says(Request { integrator: Some("paht".into()), ..Request::default() }, "integrator 'paht'", "differentials, path");
    says(Request { camera: Some("/No".into()), ..Request::default() }, "--camera /No", "/World/Camera");
    says(Request { product: Some("/No".into()), ..Request::default() }, "--product /No", "none");
    says(Request { wavelength: Some(0.55), ..Request::default() }, "--wavelength", "micrometres");
    says(Request { band: Some([700.0, 400.0]), ..Request::default() }, "--band", "LO:HI");
    says(Request { samples: Some(0), ..Request::default() }, "--samples", "1 to");
    says(
        Request { samples: Some(12), sample_range: Some([2, 6]), ..Request::default() },
        "--sample-range 2:6",
        "aligned",
    );
    says(Request { threads: Some(100_000), ..Request::default() }, "--threads", "at most");
    says(Request { crop: Some([5, 5, 5, 9]), ..Request::default() }, "--crop", "no pixel");
    says(Request { dispersion_scale: Some(f64::NAN), ..Request::default() }, "--dispersion-scale", "0 to 1000");
}

#[test]
fn an_image_too_large_for_memory_is_refused() {
    let scene = ball().build();
    let request = request(1 << 17, 1 << 17, &["position", "normal", "uv", "refracted_position"]);
    let plan = plan(&scene, &request, &Registry::default()).unwrap().remove(0);
    let rendered = abbe::render::render(&scene, &plan, &Registry::default(), &abbe::render::Control::none());
    assert_says(&rendered.expect_err("rendered?"), "--width", "crops");
}

#[test]
fn hostile_scene_files_get_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.safetensors");
    file::write(&path, &ball().description()).unwrap();
    let good = std::fs::read(&path).unwrap();
    assert!(file::read(&path, false).is_ok() && file::read(&path, true).is_ok());
    // Cut anywhere, and with any byte of the head changed: an error or a scene, never a panic.
    for cut in (0..good.len()).step_by(97) {
        std::fs::write(&path, &good[..cut]).unwrap();
        assert!(file::read(&path, false).is_err(), "cut at {cut}");
    }
    for at in (0..good.len().min(4096)).step_by(13) {
        for value in [0u8, 0xff, b'9', b'"'] {
            let mut bad = good.clone();
            bad[at] = value;
            std::fs::write(&path, &bad).unwrap();
            if let Ok(description) = file::read(&path, false) {
                let _ = Scene::build(description);
            }
        }
    }
    let missing = file::read(&folder.path().join("no.safetensors"), false).expect_err("read what is not there");
    assert!(missing.to_string().contains("no.safetensors"), "{missing}");
}

#[test]
fn whatever_a_material_says_is_compiled_or_refused() {
    use serde_json::json;
    let names = [
        "abbe:glass",
        "abbe:dispersion:law",
        "abbe:dispersion:nd",
        "abbe:dispersion:vd",
        "abbe:dispersion:cauchy",
        "abbe:dispersion:sellmeier:b",
        "abbe:dispersion:sellmeier:c",
        "abbe:dispersion:formula",
        "abbe:dispersion:coefficients",
        "abbe:dispersion:table",
        "abbe:dispersion:validRange",
        "abbe:dispersion:scale",
        "abbe:dielectricPriority",
        "abbe:dispersion:outOfRange",
    ];
    let inputs = [
        "specular_ior",
        "ior",
        "specular_IOR",
        "transmission",
        "transmission_weight",
        "opacity",
        "opacityMode",
        "specular_roughness",
        "roughness",
        "transmission_dispersion",
        "transmission_dispersion_scale",
        "transmission_dispersion_abbe_number",
        "dispersion",
        "base_metalness",
        "metallic",
        "geometry_thin_walled",
    ];
    let ids = [
        "UsdPreviewSurface",
        "ND_open_pbr_surface_surfaceshader",
        "ND_standard_surface_surfaceshader",
        "ND_gltf_pbr_surfaceshader",
        "arnold:standard_surface",
        "Unknown",
    ];
    let values = [
        json!(1.5),
        json!(0.0),
        json!(-3.0),
        json!(1e300),
        json!(1e-300),
        json!(64),
        json!(-1),
        json!(9),
        json!("nan"),
        json!("sellmeier"),
        json!(""),
        json!(true),
        json!([]),
        json!([1.0]),
        json!([1.0, 0.01]),
        json!([0.2, 0.4, 0.3]),
        json!([[400.0, 1.5], [500.0, 1.4]]),
        json!(null),
        json!({"a": 1}),
        json!([1.5, "x"]),
        json!(u64::MAX),
    ];
    let types = ["float", "double", "double[]", "int", "token", "string", "bool", "color3f"];
    let mut state = 7u64;
    let mut pick = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    let (mut compiled, mut refused) = (0, 0);
    for _ in 0..4000 {
        let mut description = ball().description();
        let material = &mut description.document.materials[0];
        material.abbe.clear();
        for _ in 0..pick(4) {
            let value = support::authored(types[pick(types.len())], values[pick(values.len())].clone());
            material.abbe.insert(names[pick(names.len())].into(), value);
        }
        let surface = material.surface.as_mut().unwrap();
        surface.id = ids[pick(ids.len())].into();
        for _ in 0..pick(4) {
            let value = support::authored(types[pick(types.len())], values[pick(values.len())].clone());
            surface.inputs.insert(inputs[pick(inputs.len())].into(), value);
        }
        match Scene::build(description) {
            Ok(scene) => {
                compiled += 1;
                // What was accepted can be rendered, and no value of it is not finite.
                let image =
                    support::rendered(&scene, &request(6, 4, &["dispersion2", "footprint_half_width", "abbe_number"]));
                assert_eq!(image.statistics.non_finite_values, 0);
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().trim_start_matches('<').starts_with("/World/Glass"), "{error}");
            }
        }
    }
    assert!(compiled > 500 && refused > 500, "{compiled} compiled, {refused} refused");
}
