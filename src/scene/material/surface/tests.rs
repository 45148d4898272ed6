//! What each model comes to, against the formulas of its specification.

use glam::Vec3;
use serde_json::{Value, json};

use super::super::dialect::every_id;
use super::super::{Context, Kind, Material, SMOOTH_ROUGHNESS, ScalarIor, compile_alone};
use super::*;
use crate::bsdf::{Bsdf, SMOOTH_ALPHA};
use crate::scene::description;
use crate::spectrum::visible;

const CONTEXT: Context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 1.0 };

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";
const STANDARD: &str = "ND_standard_surface_surfaceshader";
const GLTF: &str = "ND_gltf_pbr_surfaceshader";

fn document(id: &str, inputs: &Value) -> description::Material {
    let typed = |value: &Value| {
        let name = match value {
            Value::Array(_) => "color3f",
            Value::Bool(_) => "bool",
            Value::String(_) => "token",
            Value::Number(number) if number.is_i64() => "int",
            _ => "float",
        };
        json!({"type": name, "value": value})
    };
    let inputs: serde_json::Map<_, _> =
        inputs.as_object().expect("a map").iter().map(|(name, value)| (name.clone(), typed(value))).collect();
    let surface = json!({"path": "/M/S", "id": id, "terminal": "outputs:surface", "inputs": inputs});
    serde_json::from_value(json!({"path": "/M", "surface": surface})).expect("follows the schema")
}

fn compiled(document: &description::Material) -> (Material, Diagnostics) {
    let mut diagnostics = Diagnostics::default();
    (compile_alone(document, &CONTEXT, &mut diagnostics).expect("compiles"), diagnostics)
}

fn wavelengths() -> Wavelengths<4> {
    visible::sample::<4>(0.3)
}

/// A material of constants, between media of the indices 1 and 1.25.
fn at(id: &str, inputs: &Value) -> SurfaceAt<4> {
    let (material, diagnostics) = compiled(&document(id, inputs));
    assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
    constant(&material)
}

fn constant(material: &Material) -> SurfaceAt<4> {
    assert!(material.surface.looked_up().is_none(), "constants run no program");
    let media = Interface { ior_i: SampledSpectrum::ONE, ior_t: SampledSpectrum::splat(1.25) };
    material.surface.at(&[], &wavelengths(), media)
}

fn close(a: f32, b: f32) {
    assert!((a - b).abs() <= 2e-5 * (1.0 + b.abs()), "{a} is not {b}");
}

/// A spectrum that is the same everywhere.
fn grey(spectrum: SampledSpectrum<4>, value: f32) {
    spectrum.0.iter().for_each(|&x| close(x, value));
}

/// The reflectance at normal incidence between two indices.
fn f0(interface: &Interface<4>) -> f32 {
    let root = (interface.ior_t[0] - interface.ior_i[0]) / (interface.ior_t[0] + interface.ior_i[0]);
    root * root
}

#[test]
fn defaults_are_those_of_the_definitions() {
    // base colour, α, index, metalness, Schlick's F0
    let models = [
        ("UsdPreviewSurface", 0.18, 0.25, 1.5, 0.0, Some(0.04)),
        (OPEN_PBR, 0.8, 0.09, 1.5, 0.0, None),
        (STANDARD, 0.8, 0.04, 1.5, 0.0, None),
        ("ND_standard_surface_surfaceshader_100", 0.8, 0.04, 1.5, 0.0, None),
        (GLTF, 1.0, 1.0, 1.5, 1.0, Some(0.04)),
        ("ND_disney_principled", 0.16, 0.25, 1.5, 0.0, Some(0.04)),
        ("DwaBaseMaterial", 1.0, 0.25, 1.5, 0.0, None),
        ("OmniSurface", 0.8, 0.04, 1.5, 0.0, None),
        ("vray:BRDFVRayMtl", 0.5, 0.0, 1.6, 0.0, None),
    ];
    for (id, base, alpha, ior, metalness, schlick) in models {
        let SurfaceAt { parameters, presence, emission, normal_map, rotation } = at(id, &json!({}));
        grey(parameters.base_color, base);
        parameters.alpha.into_iter().for_each(|a| close(a, alpha));
        grey(parameters.interface.ior_t, ior);
        close(parameters.metalness, metalness);
        assert_eq!(parameters.schlick_f0.is_some(), schlick.is_some(), "{id}");
        if let (Some(f0), Some(expected)) = (parameters.schlick_f0, schlick) {
            grey(f0, expected);
        }
        close(parameters.specular_weight, 1.0);
        close(parameters.transmission, 0.0);
        close(presence, 1.0);
        assert!(parameters.coat.is_none() && parameters.sheen.is_none() && parameters.film.is_none(), "{id}");
        assert!(normal_map.is_none() && !parameters.thin_walled, "{id}");
        assert!(emission.iter().chain([&rotation]).all(|x| x.abs() <= 0.0), "{id}");
    }
}

#[test]
fn every_model_of_constants_runs_no_program() {
    for id in every_id() {
        constant(&compiled(&document(id, &json!({}))).0);
    }
    assert!(Surface::unstated().looked_up().is_none());
}

#[test]
fn preview_surface_in_the_metallic_workflow() {
    for ior in [1.1, 1.5, 2.4_f32] {
        let inputs = json!({"ior": ior, "roughness": 0.3, "metallic": 0.25, "diffuseColor": [0.5, 0.5, 0.5]});
        let parameters = at("UsdPreviewSurface", &inputs).parameters;
        let expected = ((1.0 - ior) / (1.0 + ior)).powi(2);
        grey(parameters.schlick_f0.expect("is Schlick's"), expected);
        close(f0(&parameters.interface), expected);
        parameters.alpha.into_iter().for_each(|alpha| close(alpha, 0.09));
        close(parameters.metalness, 0.25);
        // F0 = F90.
        let Metal::Constant { f0 } = parameters.metal else { panic!("{:?}", parameters.metal) };
        grey(f0, 0.5);
    }
}

#[test]
fn preview_surface_in_the_specular_workflow() {
    let inputs = json!({"useSpecularWorkflow": 1, "specularColor": [0.3, 0.3, 0.3], "metallic": 1.0, "ior": 3.0});
    let parameters = at("UsdPreviewSurface", &inputs).parameters;
    grey(parameters.schlick_f0.expect("is Schlick's"), 0.3);
    close(parameters.metalness, 0.0);
    grey(parameters.base_color, 0.18);
}

#[test]
fn preview_surfaces_opacity_is_glass_or_presence_or_a_mask() {
    let cases = [
        (json!({"opacity": 0.3}), 0.7, 1.0),
        (json!({"opacity": 0.3, "opacityMode": "presence"}), 0.0, 0.3),
        (json!({"opacity": 0.3, "opacityThreshold": 0.2}), 0.0, 1.0),
        (json!({"opacity": 0.3, "opacityThreshold": 0.4}), 0.0, 0.0),
        (json!({"opacity": 0.3, "opacityThreshold": 0.4, "opacityMode": "presence"}), 0.0, 0.0),
    ];
    for (inputs, transmission, presence) in cases {
        let at = at("UsdPreviewSurface", &inputs);
        close(at.parameters.transmission, transmission);
        close(at.presence, presence);
    }
}

#[test]
fn preview_surfaces_coat_has_its_index() {
    let inputs = json!({"clearcoat": 0.5, "clearcoatRoughness": 0.2, "ior": 1.7});
    let coat = at("UsdPreviewSurface", &inputs).parameters.coat.expect("is coated");
    close(coat.weight, 0.5);
    close(coat.ior, 1.7);
    coat.alpha.into_iter().for_each(|alpha| close(alpha, 0.04));
    assert_eq!(coat.color, SampledSpectrum::ONE);
}

#[test]
fn glass_lies_between_media_and_walls_and_shares_have_their_own_index() {
    for (inputs, ior, thin_walled) in [
        (json!({"transmission_weight": 1.0}), 1.25, false),
        (json!({"transmission_weight": 1.0, "geometry_thin_walled": true}), 1.5, true),
        (json!({"transmission_weight": 0.3}), 1.5, true),
        (json!({}), 1.5, false),
    ] {
        let parameters = at(OPEN_PBR, &inputs).parameters;
        grey(parameters.interface.ior_t, ior);
        assert_eq!(parameters.thin_walled, thin_walled, "{inputs}");
    }
    for (depth, tint) in [(0.0, 0.5), (1.0, 1.0)] {
        let inputs = json!({"transmission_weight": 1.0, "transmission_color": 0.5, "transmission_depth": depth});
        grey(at(OPEN_PBR, &inputs).parameters.transmission_tint, tint);
    }
    // A dispersive wall has its index at each wavelength.
    let inputs =
        json!({"transmission_weight": 1.0, "geometry_thin_walled": true, "transmission_dispersion_scale": 1.0});
    let (material, _) = compiled(&document(OPEN_PBR, &inputs));
    let Kind::Dielectric { dispersion, .. } = &material.kind else { panic!("{}", material.chosen) };
    for lane in 0..4 {
        let expected = dispersion.at(wavelengths().lane(lane)).ior as f32;
        close(constant(&material).parameters.interface.ior_t[lane], expected);
    }
}

#[test]
fn open_pbr_weights_stretches_and_blurs() {
    // The weight multiplies F0.
    close(f0(&at(OPEN_PBR, &json!({"specular_weight": 0.25})).parameters.interface), 0.01);
    close(f0(&at(OPEN_PBR, &json!({"specular_weight": 0.0})).parameters.interface), 0.0);
    // α_t α_b = r⁴ · 2 (1 − a)/(1 + (1 − a)²), α_b/α_t = 1 − a.
    let [along, across] = at(OPEN_PBR, &json!({"specular_roughness_anisotropy": 0.5})).parameters.alpha;
    close(across / along, 0.5);
    close(along, 0.09 * 1.6_f32.sqrt());
    let coated = at(OPEN_PBR, &json!({"coat_weight": 1.0, "coat_roughness": 0.5})).parameters;
    close(coated.alpha[0], (0.3_f32.powi(4) + 2.0 * 0.5_f32.powi(4)).sqrt());
    let coat = coated.coat.expect("is coated");
    close(coat.alpha[0], 0.25);
    close(coat.ior, 1.6);
    close(coat.darkening, 1.0);
}

#[test]
fn open_pbr_and_standard_surface_scatter_below_the_surface_diffusely() {
    let half = |id: &str, thin: &str, weight: &str, walled: bool| {
        let at = at(id, &json!({weight: 0.5, "subsurface_color": 0.4, "base_color": 0.6, thin: walled}));
        (at.parameters.base_color, at.parameters.diffuse_transmission)
    };
    for (id, thin, weight) in
        [(OPEN_PBR, "geometry_thin_walled", "subsurface_weight"), (STANDARD, "thin_walled", "subsurface")]
    {
        let (reflected, transmitted) = half(id, thin, weight, false);
        grey(reflected, 0.5);
        grey(transmitted, 0.0);
    }
    let (reflected, transmitted) = half(OPEN_PBR, "geometry_thin_walled", "subsurface_weight", true);
    grey(reflected, 0.4);
    grey(transmitted, 0.1);
    let (reflected, transmitted) = half(STANDARD, "thin_walled", "subsurface", true);
    grey(reflected, 0.3);
    grey(transmitted, 0.2);
}

#[test]
fn layers_have_their_inputs() {
    let inputs = json!({
        "fuzz_weight": 0.25, "fuzz_color": 0.5, "thin_film_weight": 0.75, "thin_film_thickness": 0.3,
        "emission_luminance": 100.0, "emission_color": [1.0, 0.5, 0.0], "geometry_opacity": 0.25,
        "base_diffuse_roughness": 0.4,
    });
    let at = at(OPEN_PBR, &inputs);
    let (sheen, film) = (at.parameters.sheen.expect("has sheen"), at.parameters.film.expect("has a film"));
    close(sheen.weight, 0.25);
    grey(sheen.color, 0.5);
    close(sheen.roughness, 0.5);
    close(film.weight, 0.75);
    close(film.thickness_nm, 300.0);
    close(film.ior, 1.4);
    close(film.nanometers[2], wavelengths().nanometers()[2] as f32);
    close(at.parameters.diffuse_roughness, 0.4);
    close(at.presence, 0.25);
    at.emission.into_iter().zip([100.0, 50.0, 0.0]).for_each(|(a, b)| close(a, b));
}

/// The reflectance at normal incidence of n + ik.
fn metallic_f0(n: f32, k: f32) -> f32 {
    ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
}

#[test]
fn standard_surfaces_metal_keeps_its_reflectance() {
    for (base, edge) in [(0.5_f64, 1.0), (0.9, 0.3), (0.04, 0.0), (0.99, 1.0)] {
        let inputs = json!({"metalness": 1.0, "base_color": base, "specular_color": edge});
        let Metal::Index { n, k } = at(STANDARD, &inputs).parameters.metal else { panic!("has an index") };
        for lane in 0..4 {
            assert!((f64::from(metallic_f0(n[lane], k[lane])) - base).abs() < 1e-4, "{base} {edge}: {n:?} {k:?}");
        }
        let (least, most) = ((1.0 - base) / (1.0 + base), (1.0 + base.sqrt()) / (1.0 - base.sqrt()));
        let expected = edge * least + (1.0 - edge) * most;
        assert!((f64::from(n[0]) - expected).abs() < 1e-3 * expected, "{n:?} is not {expected}");
    }
}

#[test]
fn standard_surface_follows_its_graph() {
    // MaterialX' roughness_anisotropy.
    let [along, across] =
        at(STANDARD, &json!({"specular_anisotropy": 0.75, "specular_roughness": 0.4})).parameters.alpha;
    close(along, 0.32);
    close(across, 0.08);
    let turned = at(STANDARD, &json!({"specular_anisotropy": 0.75, "specular_rotation": 0.25}));
    close(turned.rotation, -0.25);
    assert!(turned.has_direction());
    let inputs = json!({"coat": 1.0, "coat_roughness": 0.5, "coat_affect_roughness": 0.4, "coat_affect_color": 1.0});
    let coated = at(STANDARD, &inputs).parameters;
    close(coated.alpha[0], 0.36_f32.powi(2));
    grey(coated.base_color, 0.64);
    let inputs = json!({"transmission": 1.0, "transmission_extra_roughness": 0.3});
    close(at(STANDARD, &inputs).parameters.alpha[0], 0.25);
}

#[test]
fn gltf_follows_its_extensions() {
    let base = json!({"metallic": 0.0, "specular": 0.5, "specular_color": 2.0, "ior": 1.5});
    let parameters = at(GLTF, &base).parameters;
    // KHR_materials_specular: F0 = min(0.04 · 2, 1) · 0.5.
    grey(parameters.schlick_f0.expect("is Schlick's") * parameters.specular_weight, 0.04);
    let mut film = base.clone();
    film["iridescence"] = json!(1.0);
    let parameters = at(GLTF, &film).parameters;
    assert!(parameters.schlick_f0.is_none() && parameters.film.is_some(), "{parameters:?}");
    let inputs =
        json!({"roughness": 0.5, "anisotropy_strength": 0.5, "anisotropy_rotation": std::f64::consts::FRAC_PI_2});
    let turned = at(GLTF, &inputs);
    close(turned.parameters.alpha[0], 0.25 + 0.75 * 0.25);
    close(turned.parameters.alpha[1], 0.25);
    close(turned.rotation, 0.25);
    for (mode, presence) in [("OPAQUE", 1.0), ("MASK", 0.0), ("BLEND", 0.4)] {
        close(at(GLTF, &json!({"alpha": 0.4, "alpha_mode": mode})).presence, presence);
    }
    let emissive = at(GLTF, &json!({"emissive": [1.0, 0.5, 0.25], "emissive_strength": 4.0})).emission;
    emissive.into_iter().zip([4.0, 2.0, 1.0]).for_each(|(a, b)| close(a, b));
}

#[test]
fn metals_with_an_index_have_it_at_every_wavelength_rough_or_smooth() {
    for roughness in [0.0, 0.5] {
        let mut gold = document(OPEN_PBR, &json!({"base_metalness": 1.0, "specular_roughness": roughness}));
        let authored = |name: &str, value: Value| description::Authored { type_name: name.to_owned(), value };
        gold.abbe.insert("abbe:dispersion:cauchy".to_owned(), authored("double[]", json!([0.2, 0.05])));
        gold.abbe
            .insert("abbe:extinction:table".to_owned(), authored("double2[]", json!([[400.0, 2.0], [700.0, 5.0]])));
        let (gold, diagnostics) = compiled(&gold);
        assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
        let Metal::Index { n, k } = constant(&gold).parameters.metal else { panic!("has an index") };
        for lane in 0..4 {
            let nanometers = wavelengths().nanometers()[lane];
            let micrometers = nanometers * 1e-3;
            close(n[lane], (0.2 + 0.05 / (micrometers * micrometers)) as f32);
            close(k[lane], (2.0 + (nanometers.clamp(400.0, 700.0) - 400.0) * 0.01) as f32);
        }
    }
}

#[test]
fn a_measured_reflectance_is_the_base_colour_at_every_wavelength() {
    let table = |material: &mut description::Material, entries: Value| {
        let authored = description::Authored { type_name: "double2[]".to_owned(), value: entries };
        material.abbe.insert("abbe:reflectance:table".to_owned(), authored);
    };
    for (id, metal) in [("UsdPreviewSurface", "metallic"), (STANDARD, "metalness"), (OPEN_PBR, "base_metalness")] {
        for metalness in [0.0, 1.0] {
            let mut measured = document(id, &json!({metal: metalness}));
            table(&mut measured, json!([[360.0, 0.2], [830.0, 0.6]]));
            let (measured, diagnostics) = compiled(&measured);
            assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
            let parameters = constant(&measured).parameters;
            for lane in 0..4 {
                let expected = (0.2 + 0.4 * (wavelengths().nanometers()[lane] - 360.0) / 470.0) as f32;
                close(parameters.base_color[lane], expected);
                match parameters.metal {
                    _ if metalness == 0.0 => {}
                    Metal::Tint { f0, .. } | Metal::Constant { f0 } => close(f0[lane], expected),
                    Metal::Index { n, k } => close(metallic_f0(n[lane], k[lane]), expected),
                }
            }
        }
    }
    let mut glass = document(OPEN_PBR, &json!({"transmission_weight": 1.0}));
    table(&mut glass, json!([[360.0, 0.2], [830.0, 0.6]]));
    assert_eq!(compiled(&glass).1.warnings()[0].kind, "idle-reflectance");
    let mut wrong = document(OPEN_PBR, &json!({}));
    table(&mut wrong, json!([[360.0, 20.0], [830.0, 60.0]]));
    let error = compile_alone(&wrong, &CONTEXT, &mut Diagnostics::default()).expect_err("is refused").to_string();
    assert!(error.starts_with("</M>.abbe:reflectance:table") && error.contains("divide per cents by 100"), "{error}");
}

#[test]
fn chain_and_paths_agree_on_what_is_smooth() {
    for (roughness, is_smooth) in [(0.0, true), (SMOOTH_ROUGHNESS, true), (0.0301, false), (0.3, false)] {
        let inputs = json!({"transmission_weight": 1.0, "specular_roughness": roughness});
        let (glass, _) = compiled(&document(OPEN_PBR, &inputs));
        assert!(matches!(glass.kind, Kind::Dielectric { rough, .. } if rough != is_smooth), "{roughness}");
        let [alpha, _] = constant(&glass).parameters.alpha;
        assert_eq!(alpha < SMOOTH_ALPHA, is_smooth, "{roughness}: {alpha}");
    }
}

#[test]
fn what_cannot_be_is_cut_or_warned_of() {
    let odd = json!({
        "base_color": [7.0, -1.0, 0.5], "coat_weight": 3.0, "coat_ior": -2.0, "fuzz_roughness": -1.0,
        "thin_film_weight": 1.0, "thin_film_thickness": -5.0, "specular_roughness_anisotropy": 9.0,
        "emission_luminance": -3.0, "specular_weight": 1e30, "base_diffuse_roughness": -0.5,
    });
    let at = at(OPEN_PBR, &odd);
    assert!(at.parameters.base_color.0.iter().all(|x| (0.0..=1.0).contains(x)));
    assert!(at.parameters.interface.ior_t.0.iter().all(|ior| ior.is_finite() && *ior >= 1.0));
    assert!(at.parameters.alpha.iter().all(|alpha| (0.0..=1.0).contains(alpha)), "{:?}", at.parameters.alpha);
    let coat = at.parameters.coat.expect("is coated");
    assert!(coat.weight <= 1.0 && coat.ior >= 1.0 && at.parameters.film.is_none());
    assert!(at.emission.iter().all(|&e| e >= 0.0) && at.parameters.diffuse_roughness >= 0.0);

    for (name, value) in [("coat_color", json!("red")), ("fuzz_weight", json!(null)), ("base_color", json!([1.0]))] {
        let (material, diagnostics) = compiled(&document(OPEN_PBR, &json!({name: value})));
        let [warning] = diagnostics.warnings() else { panic!("{:?}", diagnostics.warnings()) };
        assert_eq!(warning.kind, "unread-network");
        assert_eq!(warning.places, [format!("</M/S>.inputs:{name}")]);
        grey(constant(&material).parameters.base_color, 0.8);
    }
}

#[test]
fn an_image_of_the_default_normal_is_no_map() {
    let mut mapped = document(OPEN_PBR, &json!({}));
    let nodes = json!([{"path": "/M/N", "id": "ND_normalmap_float"}]);
    mapped.nodes = serde_json::from_value(nodes).expect("are nodes");
    let shader = mapped.surface.as_mut().expect("has a shader");
    shader.connected.insert("geometry_normal".to_owned(), "/M/N.outputs:out".to_owned());
    shader.networks.insert(
        "geometry_normal".to_owned(),
        serde_json::from_value(json!({"node": 0, "output": "out"})).expect("is an output"),
    );
    assert!(constant(&compiled(&mapped).0).normal_map.is_none());
    let tilted = json!([{"path": "/M/N", "id": "ND_normalmap_vector2", "inputs": {
        "in": {"type": "float3", "value": [0.75, 0.25, 1.0]}, "scale": {"type": "float2", "value": [1.0, 2.0]},
    }}]);
    mapped.nodes = serde_json::from_value(tilted).expect("are nodes");
    let normal = constant(&compiled(&mapped).0).normal_map.expect("is tilted");
    normal.into_iter().zip([0.5, -1.0, 1.0]).for_each(|(a, b)| close(a, b));
}

#[test]
fn the_short_way_scatters_as_the_long_one_does() {
    let matt = json!({"base_color": [0.6, 0.3, 0.1], "specular_weight": 0.0});
    let rough = json!({"base_color": [0.6, 0.3, 0.1], "specular_weight": 0.0, "base_diffuse_roughness": 0.7});
    let glass = json!({"transmission_weight": 1.0, "specular_roughness": 0.0, "transmission_color": [0.9, 0.5, 0.7]});
    let (air, water) = (SampledSpectrum::ONE, SampledSpectrum::splat(1.33));
    let dispersive = SampledSpectrum([1.5, 1.51, 1.52, 1.53]);
    let plastic = json!({"base_color": [0.6, 0.3, 0.1]});
    for (inputs, ior_i, ior_t, is_short) in [
        (&matt, air, air, true),
        (&matt, water, air, false),
        (&rough, air, air, true),
        (&plastic, air, air, false),
        (&glass, air, water, true),
        (&glass, dispersive, air, true),
    ] {
        let (material, _) = compiled(&document(OPEN_PBR, inputs));
        let interface = Interface { ior_i, ior_t };
        let long = || material.surface.at(&[], &wavelengths(), interface);
        let finish = material.surface.finish(&wavelengths(), interface, long);
        assert_eq!(!matches!(finish, Finish::Other(_)), is_short, "{inputs}");
        let (at, short) = (long(), finish.bsdf());
        assert_eq!((finish.presence(), finish.transmits()), (at.presence, at.transmits()), "{inputs}");
        assert!(finish.directed().is_none() && at.directed().is_none(), "{inputs}");
        let long = Bsdf::new(&at.parameters);
        let direction = |i: u32| {
            let (z, turn) = (0.05 + 0.9 * (i as f32 * 0.37).fract(), i as f32 * 2.4);
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * turn.cos(), r * turn.sin(), z)
        };
        for i in 0..200 {
            let (wo, wi, u) = (direction(i), direction(3 * i + 7), (i as f32 * 0.618).fract());
            assert_eq!(short.evaluate(wo, wi), long.evaluate(wo, wi), "{inputs}");
            assert_eq!(short.sample(wo, u, [1.0 - u, u]), long.sample(wo, u, [1.0 - u, u]), "{inputs}");
            assert_eq!(short.is_smooth(), long.is_smooth(), "{inputs}");
        }
    }
}
