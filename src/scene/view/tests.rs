//! Surfaces as rays meet them.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::*;
use crate::bsdf::Interface;
use crate::scene::description::{self, Array, Description, Element};
use crate::spectrum::{SampledSpectrum, visible};

/// A square of side 2 about the origin in the plane z = 0, u along −y and v along x from 0 to 1, with a colour at every corner;
/// `surface` is its material's, if it has one.
fn square(surface: Option<Value>, nodes: Value) -> Scene {
    let primvar = |name: &str| json!({"values": name, "interpolation": "vertex"});
    let material = surface.map(|surface| json!({"path": "/M", "surface": surface, "nodes": nodes}));
    let document = json!({
        "format": description::FORMAT, "version": description::VERSION,
        "stage": {"source": "", "meters_per_unit": 1.0, "up_axis": "Y"},
        "shapes": [{"mesh": {
            "path": "/Square", "points": "points", "face_vertex_counts": "counts", "face_vertex_indices": "indices",
            "uv": primvar("uv"), "uv_name": "st", "primvars": {"displayColor": primvar("colors")},
        }}],
        "groups": [{"path": "/", "items": [
            {"path": "/Square", "target": {"shape": 0}, "material": material.as_ref().map(|_| 0)},
        ]}],
        "root": 0, "materials": material.into_iter().collect::<Vec<_>>(), "cameras": [],
    });
    let floats = |columns, values: &[f32]| Array::from_vec(Element::F32, columns, values.to_vec());
    let ints = |values: &[i32]| Array::from_vec(Element::I32, 1, values.to_vec());
    let arrays = BTreeMap::from([
        ("points".to_owned(), floats(3, &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0])),
        ("uv".to_owned(), floats(2, &[1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0])),
        ("colors".to_owned(), floats(3, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])),
        ("counts".to_owned(), ints(&[4])),
        ("indices".to_owned(), ints(&[0, 1, 2, 3])),
    ]);
    let document = serde_json::from_value(document).expect("follows the schema");
    Scene::build(Description { document, arrays }).expect("builds")
}

/// What a ray along −z finds at (x, y), and its frame.
fn met(scene: &Scene, x: f64, y: f64) -> (SurfaceAt<4>, ShadingFrame, f32) {
    let view = View::new(scene, DVec3::ZERO);
    let ray = Ray { origin: DVec3::new(x, y, 3.0), direction: -DVec3::Z, time: 0.0 };
    let hit = view.intersect(&ray, &Departures::none()).expect("is met");
    let media = Interface { ior_i: SampledSpectrum::ONE, ior_t: SampledSpectrum::ONE };
    let id = view.material_id(&hit);
    let at = view.surface(&hit, id, &visible::sample::<4>(0.6), media);
    let (_, normals) = view.aggregate.normals(&ray, &hit);
    (at, view.shading_frame(&hit, 0.0, &normals, &at), view.share_present(&hit, id))
}

fn surface(driven: &[&str]) -> Value {
    let path = "/M/N.outputs:out";
    let connected: BTreeMap<_, _> = driven.iter().map(|name| (name, path)).collect();
    let networks: BTreeMap<_, _> = driven.iter().map(|name| (name, json!({"node": 0, "output": "out"}))).collect();
    json!({"path": "/M/S", "id": "UsdPreviewSurface", "terminal": "outputs:surface", "connected": connected, "networks": networks})
}

fn reader(kind: &str, name: &str) -> Value {
    let varname = json!({"type": "string", "value": name});
    json!([{"path": "/M/N", "id": format!("UsdPrimvarReader_{kind}"), "inputs": {"varname": varname}}])
}

#[test]
fn inputs_are_looked_up_where_the_ray_meets_the_surface() {
    let scene = square(Some(surface(&["diffuseColor", "metallic"])), reader("float3", "displayColor"));
    for y in [-0.5, 0.0, 0.8] {
        let (at, _, share) = met(&scene, 0.3, y);
        let expected = (0.5 * (y + 1.0)) as f32;
        assert!(at.parameters.base_color.0.iter().all(|x| (x - expected).abs() < 1e-5), "{y}: {at:?}");
        assert!((at.parameters.metalness - expected).abs() < 1e-6);
        assert!((at.presence - 1.0).abs() <= 0.0 && (share - 1.0).abs() <= 0.0);
    }
}

#[test]
fn presence_is_looked_up_as_a_share() {
    let mut presence = surface(&["opacity"]);
    presence["inputs"] = json!({"opacityMode": {"type": "token", "value": "presence"}});
    let scene = square(Some(presence), reader("float3", "displayColor"));
    for y in [-0.5, 0.5] {
        let (at, _, share) = met(&scene, -0.2, y);
        assert!((f64::from(share) - 0.5 * (y + 1.0)).abs() < 1e-6);
        assert_eq!(at.presence.to_bits(), share.to_bits());
    }
}

#[test]
fn geometry_without_a_material_is_diffuse_of_its_display_color() {
    let (at, frame, share) = met(&square(None, json!([])), 0.1, 0.5);
    assert!(at.parameters.base_color.0.iter().all(|x| (x - 0.75).abs() < 1e-5), "{at:?}");
    assert!(at.parameters.specular_weight.abs() <= 0.0 && at.parameters.transmission.abs() <= 0.0);
    assert_eq!(at.parameters.interface.ior_i, at.parameters.interface.ior_t);
    assert!((share - 1.0).abs() <= 0.0 && frame.normal == DVec3::Z);
}

#[test]
fn a_normal_map_bends_the_normal_along_the_texture_coordinates() {
    // The primvar is the tangent-space normal itself: (1, 1, 1) above, going to nothing below.
    let scene = square(Some(surface(&["normal"])), reader("float3", "displayColor"));
    let (at, frame, _) = met(&scene, 0.0, 0.4);
    assert!(at.normal_map.is_some());
    // u goes along −y, v along x.
    let expected = DVec3::new(1.0, -1.0, 1.0).normalize();
    assert!((frame.normal - expected).length() < 1e-7, "{frame:?}");
    assert!(frame.tangent.dot(frame.normal).abs() < 1e-14 && frame.tangent.dot(-DVec3::Y) > 0.0);
    // Nothing at the lower edge: the surface's own.
    let (_, frame, _) = met(&scene, 0.0, -1.0 + 1e-12);
    assert!(frame.normal.is_finite() && (frame.normal.length() - 1.0).abs() < 1e-12);
}
