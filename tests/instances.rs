//! Arrays of instances: the same pictures as placing everything one by one, in less memory, under names that are found.

mod support;

use abbe::geometry::{Departures, Ray};
use abbe::scene::Scene;
use abbe::scene::description::{
    Array, Description, Element, Group, Instances, Lens, LensFace, Placement, Shape, Target,
};
use abbe::scene::view::View;
use glam::{DAffine3, DMat3, DMat4, DVec3};
use support::{BK7, SF11, Stagehand, floats, integers, rendered, request};

const AOVS: [&str; 5] = ["position", "refracted_position", "dispersion", "prim_id", "material_id"];

fn rows(places: &[DAffine3]) -> Array {
    let rows = places.iter().map(DAffine3::to_cols_array).collect();
    Array::from_vec(Element::F64, 12, rows)
}

/// A wall, and the shapes of a lamp: a glass ball (shape 1) beside a pyramid (shape 2), in no group yet.
fn stagehand() -> (Stagehand, Vec<Placement>) {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BK7);
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 40.0, Some(grey));
    s.sphere("/World/P/Ball", 0.4, DMat4::from_translation(DVec3::new(0.0, 0.5, 0.0)), Some(glass));
    let points = [[-0.4, -0.3, 0.4], [0.4, -0.3, 0.4], [0.0, -0.3, -0.4], [0.0, 0.2, 0.0]];
    let faces: [&[i32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
    s.mesh("/World/P/Pyramid", &points, &faces, DMat4::IDENTITY, Some(grey));
    s.camera(DVec3::new(0.3, 0.4, 12.0), DVec3::ZERO);
    let parts = s.document.groups[0].items.split_off(1);
    (s, parts)
}

fn places() -> Vec<DAffine3> {
    (0..12)
        .map(|i| {
            let at = DVec3::new(f64::from(i % 4) * 1.7 - 2.6, f64::from(i / 4) * 1.5 - 1.7, f64::from(i % 3) * 0.3);
            let turn = DMat3::from_rotation_y(f64::from(i)) * DMat3::from_rotation_x(0.3 * f64::from(i));
            DAffine3 {
                matrix3: turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0 + 0.1 * f64::from(i), 0.8)),
                translation: at,
            }
        })
        .collect()
}

fn instances(path: &str, group: usize, transforms: &str, count: usize) -> Instances {
    Instances { path: path.into(), group, transforms: transforms.into(), count, ..Instances::default() }
}

/// What `stagehand` and its like prepare at all places, by an array.
fn at_places((mut s, parts): (Stagehand, Vec<Placement>)) -> Description {
    s.document.groups.push(Group { path: "/World/P".into(), items: parts, ..Group::default() });
    s.arrays.insert("places".into(), rows(&places()));
    s.document.groups[0].instances.push(instances("/World/Lamps", 1, "places", 12));
    s.description()
}

/// The same, each part placed by itself.
fn one_by_one((mut s, parts): (Stagehand, Vec<Placement>)) -> Description {
    for place in places() {
        for part in &parts {
            let local = DAffine3::from_mat4(DMat4::from_cols_array(&part.transform.unwrap()));
            let transform = Some(DMat4::from(place * local).to_cols_array());
            s.document.groups[0].items.push(Placement { transform, ..part.clone() });
        }
    }
    s.description()
}

/// The lamp at all places, by an array.
fn by_array() -> Description {
    at_places(stagehand())
}

/// A wall, and in no group yet: a cemented doublet, a cylinder, a cone that nothing is left of, a capsule, a plane.
fn solids() -> (Stagehand, Vec<Placement>) {
    let face = |curvature: f64| LensFace { curvature, conic: -0.3, aspheres: vec![], semi_diameter: 0.5 };
    let lens = |path: &str, front: f64, back: f64, thickness: f64| {
        let path = path.to_owned();
        Shape::Lens(Lens { path, front: face(front), back: face(back), thickness, edge_radius: None })
    };
    let (path, axis) = (|name: &str| format!("/World/P/{name}"), || "X".to_owned());
    let at = |y: f64, z: f64| DMat4::from_translation(DVec3::new(0.0, y, z));
    let mut s = Stagehand::new();
    let (crown, flint) = (s.glass("/World/Crown", BK7), s.glass("/World/Flint", SF11));
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 40.0, Some(grey));
    s.solid(lens("/World/P/Crown", 0.3, -0.4, 0.4), at(0.5, 0.0), Some(crown));
    s.solid(lens("/World/P/Flint", -0.4, 0.1, 0.2), at(0.5, 0.4), Some(flint));
    let (radius_bottom, radius_top) = (0.2, 0.25);
    let cylinder = Shape::Cylinder { path: path("Cylinder"), height: 0.8, radius_bottom, radius_top, axis: axis() };
    s.solid(cylinder, at(-0.5, 0.1), Some(crown));
    s.solid(Shape::Cone { path: path("Flat"), height: 0.0, radius: 1.0, axis: axis() }, at(0.0, 0.0), Some(grey));
    let (radius_bottom, radius_top) = (0.1, 0.1);
    let capsule = Shape::Capsule { path: path("Capsule"), height: 0.6, radius_bottom, radius_top, axis: axis() };
    s.solid(capsule, at(-0.15, 0.2), Some(flint));
    s.solid(Shape::Plane { path: path("Plane"), width: 0.3, length: 0.6, axis: axis() }, at(-0.8, 0.1), Some(grey));
    s.camera(DVec3::new(0.3, 0.4, 12.0), DVec3::ZERO);
    let parts = s.document.groups[0].items.split_off(1);
    (s, parts)
}

fn scene(description: Description) -> Scene {
    Scene::build(description).unwrap_or_else(|e| panic!("{e}"))
}

fn assert_same_pixels(a: &Scene, b: &Scene) {
    let request = request(90, 60, &AOVS);
    let (a, b) = (rendered(a, &request), rendered(b, &request));
    for name in AOVS {
        if name.ends_with("_id") {
            assert_eq!(integers(&a.film, name), integers(&b.film, name), "{name}");
        } else {
            assert_eq!(floats(&a.film, name), floats(&b.film, name), "{name}");
        }
    }
}

#[test]
fn an_array_gives_the_bits_of_placing_one_by_one() {
    let array = scene(by_array());
    assert_same_pixels(&array, &scene(one_by_one(stagehand())));
    assert_eq!(array.objects.len(), 25);
    assert_eq!(array.counts.shapes, 3);
}

#[test]
fn lenses_and_solids_of_an_array_are_those_placed_one_by_one() {
    let (array, plain) = (scene(at_places(solids())), scene(one_by_one(solids())));
    assert_same_pixels(&array, &plain);
    // The wall, and what is left of six parts at twelve places.
    assert_eq!((array.objects.len(), array.counts.shapes), (61, 6));
    assert_eq!(array.objects.singles().len(), 1);
    assert_eq!(array.prims.entries(), plain.prims.entries());
    assert_eq!(array.instances.entries(), ["/World/Lamps[0:12]"]);
    assert!(array.diagnostics().warnings().iter().any(|w| w.kind == "empty-shape" && w.places == ["/World/P/Flat"]));

    // A group placed by itself, as native instances are.
    let (mut native, parts) = solids();
    native.document.groups.push(Group { path: "/Prototype".into(), items: parts, ..Group::default() });
    for (i, place) in places().into_iter().enumerate() {
        native.document.groups[0].items.push(Placement {
            path: "/Prototype".into(),
            target: Target::Group(1),
            transform: Some(DMat4::from(place).to_cols_array()),
            instance: Some(format!("/World/Lamp{i}")),
            ..Placement::default()
        });
    }
    assert_same_pixels(&array, &scene(native.description()));

    // What touches what is found the same way, and a doublet's elements touch.
    let origin = DVec3::new(0.3, 0.4, 12.0);
    let (array_view, plain_view) = (View::new(&array, origin), View::new(&plain, origin));
    let mut elements = 0;
    for (i, j) in (-30..=30).flat_map(|i| (-24..=24).map(move |j| (i, j))) {
        let direction = DVec3::new(0.1 * f64::from(i), 0.1 * f64::from(j), -12.0).normalize();
        let ray = Ray { origin: DVec3::ZERO, direction, time: 0.0 };
        let hits = [&array_view, &plain_view].map(|view| view.intersect(&ray, &Departures::none()));
        assert_eq!(hits[0], hits[1]);
        let Some(hit) = hits[0] else { continue };
        assert_eq!(array_view.is_touching(&hit), plain_view.is_touching(&hit));
        assert_eq!(array_view.is_in_contact(&hit), plain_view.is_in_contact(&hit));
        let path = array.prims.path(array.objects.ids(hit.instance).prim_id).unwrap();
        if path.ends_with("/Crown") || path.ends_with("/Flint") {
            assert!(array_view.is_touching(&hit));
            elements += 1;
        }
    }
    assert!(elements > 100, "{elements}");
}

#[test]
fn an_array_within_an_array_is_the_product() {
    let outer: Vec<_> = (0..3).map(|i| DAffine3::from_translation(DVec3::X * 2.0 * f64::from(i - 1))).collect();
    let inner: Vec<_> = (0..4).map(|i| DAffine3::from_translation(DVec3::Y * (f64::from(i) - 1.5))).collect();
    let (mut s, parts) = stagehand();
    s.document.groups.push(Group { path: "/World/Q/Row".into(), ..Group::default() });
    s.document.groups.push(Group { path: "/World/P".into(), items: parts.clone(), ..Group::default() });
    s.arrays.insert("outer".into(), rows(&outer));
    s.arrays.insert("elements".into(), Array::from_vec(Element::I32, 1, vec![1, 2, 5]));
    s.arrays.insert("inner".into(), rows(&inner));
    let nested = instances("/World/Q/Row/Lamps", 2, "inner", 4);
    s.document.groups[1].instances.push(nested);
    let outermost = Instances { indices: Some("elements".into()), ..instances("/World/Rows", 1, "outer", 6) };
    s.document.groups[0].instances.push(outermost);
    let nested = s.build();

    let (mut s, parts) = stagehand();
    s.document.groups.push(Group { path: "/World/P".into(), items: parts, ..Group::default() });
    let product: Vec<_> = outer.iter().flat_map(|o| inner.iter().map(move |i| o * i)).collect();
    s.arrays.insert("places".into(), rows(&product));
    s.document.groups[0].instances.push(instances("/World/Lamps", 1, "places", 12));
    let flat = s.build();

    assert_same_pixels(&nested, &flat);
    assert_eq!(nested.instances.entries(), ["/World/Rows[1:3,5]/Row/Lamps[0:4]"]);
    // Every object's identifier names its element of both.
    for (k, (i, j)) in [1, 2, 5].into_iter().flat_map(|i| (0..4).map(move |j| (i, j))).enumerate() {
        for part in 0..2 {
            let ids = nested.objects.ids(1 + 2 * k as u32 + part);
            assert_eq!(nested.instances.path(ids.instance_id), Some(format!("/World/Rows[{i}]/Row/Lamps[{j}]")));
        }
    }
}

#[test]
fn prototypes_of_one_instancer_share_its_identifiers() {
    let (mut s, parts) = stagehand();
    for part in parts {
        s.document.groups.push(Group { path: part.path.clone(), items: vec![part], ..Group::default() });
    }
    let places = places();
    for (group, elements) in [(1usize, [0, 4, 9]), (2, [1, 2, 11])] {
        s.arrays.insert(format!("places{group}"), rows(&elements.map(|i| places[i as usize])));
        s.arrays.insert(format!("elements{group}"), Array::from_vec(Element::I32, 1, elements.to_vec()));
        s.document.groups[0].instances.push(Instances {
            indices: Some(format!("elements{group}")),
            ..instances("/World/Lamps", group, &format!("places{group}"), 12)
        });
    }
    let scene = s.build();
    assert_eq!(scene.instances.entries(), ["/World/Lamps[0:12]"]);
    let ids: Vec<_> = (0..scene.objects.len()).map(|i| scene.objects.ids(i).instance_id).collect();
    assert_eq!(ids, [0, 1, 5, 10, 2, 3, 12]);
}

#[test]
fn the_array_itself_can_be_placed() {
    let turn = DMat4::from_rotation_z(0.4);
    let mut moved = by_array();
    moved.document.groups[0].instances[0].transform = Some(turn.to_cols_array());
    let mut baked = by_array();
    let turned: Vec<_> = places().into_iter().map(|p| DAffine3::from_mat4(turn) * p).collect();
    baked.arrays.insert("places".into(), rows(&turned));
    assert_same_pixels(&scene(moved), &scene(baked));
}

#[test]
fn instances_scaled_to_nothing_or_not_finite_are_left_out() {
    let mut flat = places();
    flat[3].matrix3.x_axis = DVec3::ZERO;
    flat[7].translation.x = f64::NAN;
    let mut with = by_array();
    with.arrays.insert("places".into(), rows(&flat));
    let with = scene(with);
    let (warning,) = (with.diagnostics().warnings().iter().find(|w| w.kind == "singular-transform").unwrap(),);
    assert_eq!(warning.places, ["/World/Lamps"]);
    assert!(warning.message.starts_with("4 instances"), "{}", warning.message);

    flat.remove(7);
    flat.remove(3);
    let mut without = by_array();
    without.arrays.insert("places".into(), rows(&flat));
    assert_same_pixels(&with, &scene(without));
}

#[test]
fn broken_arrays_name_the_instancer() {
    let broken = |change: &dyn Fn(&mut Description)| {
        let mut description = by_array();
        change(&mut description);
        let error = Scene::build(description).expect_err("the scene was accepted").to_string();
        assert!(error.starts_with("/World/Lamps"), "{error}");
        error
    };
    let element = |values: Vec<i32>| {
        move |d: &mut Description| {
            d.arrays.insert("elements".into(), Array::from_vec(Element::I32, 1, values.clone()));
            d.document.groups[0].instances[0].indices = Some("elements".into());
        }
    };
    assert!(broken(&|d| drop(d.arrays.remove("places"))).contains("missing"));
    assert!(broken(&|d| d.document.groups[0].instances[0].group = 9).contains("group 9 of 2"));
    assert!(broken(&|d| d.document.groups[0].instances[0].count = 11).contains("12 transforms for 11 elements"));
    assert!(broken(&element((0..11).collect())).contains("11 indices for 12 transforms"));
    assert!(broken(&element((1..13).collect())).contains("element 12 of 12"));
    assert!(broken(&element((-1..11).collect())).contains("element -1"));
    let flat = Array::from_vec(Element::F64, 3, vec![0.0; 36]);
    assert!(broken(&|d| drop(d.arrays.insert("places".into(), flat.clone()))).contains("12 columns"));
}

#[test]
fn an_instancer_that_stands_nowhere_is_left_out_and_named() {
    let mut lost = by_array();
    lost.document.groups[0].instances[0].transform = Some([f64::INFINITY; 16]);
    let others = lost.document.groups[0].items.len();
    let scene = Scene::build(lost).expect("the rest is rendered");
    assert_eq!(scene.objects.len() as usize, others);
    let warnings = scene.diagnostics().warnings();
    assert!(warnings.iter().any(|w| w.kind == "broken-transform" && w.places == ["/World/Lamps"]), "{warnings:?}");
}

#[test]
fn explosions_and_cycles_are_refused_before_anything_is_placed() {
    // 4096 places in each of three levels: 2^36 objects; and the same of nothing.
    for items in [stagehand().1, vec![]] {
        let (mut s, _) = stagehand();
        s.arrays.insert("places".into(), rows(&vec![DAffine3::IDENTITY; 4096]));
        for level in 1..=3 {
            s.document.groups.push(Group { path: format!("/World/L{level}"), ..Group::default() });
            s.document.groups[level - 1].instances.push(instances(&format!("/World/I{level}"), level, "places", 4096));
        }
        s.document.groups[3].items = items;
        let error = Scene::build(s.description()).expect_err("the scene was accepted").to_string();
        assert!(error.contains("unroll to more than 67108864"), "{error}");
    }
    let mut cycle = by_array();
    cycle.document.groups[1].instances.push(instances("/World/Loop", 0, "places", 12));
    let error = Scene::build(cycle).expect_err("the scene was accepted").to_string();
    assert!(error.starts_with("/World/Loop") && error.contains("cycle"), "{error}");
}
