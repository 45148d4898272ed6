//! What cannot be is refused where it stands, and what hardly can is warned of.

use serde_json::{Value, json};

use super::*;

/// Glass, and whatever else it takes, so that each listed input is read by one of them.
fn bases(id: &str) -> Vec<Value> {
    match id {
        "UsdPreviewSurface" => vec![json!({"opacity": 0.0}), json!({"metallic": 1.0})],
        "ND_open_pbr_surface_surfaceshader" => {
            vec![json!({"transmission_weight": 1.0, "transmission_dispersion_scale": 1.0, "transmission_depth": 1.0})]
        }
        "arnold:openpbr_surface" => vec![json!({"transmission_weight": 1.0})],
        "ND_standard_surface_surfaceshader" | "arnold:standard_surface" => {
            vec![json!({"transmission": 1.0, "transmission_depth": 1.0})]
        }
        "ND_gltf_pbr_surfaceshader" => vec![
            json!({"transmission": 1.0, "metallic": 0.0, "thickness": 1.0, "attenuation_distance": 1.0}),
            json!({"alpha_mode": 1}),
        ],
        "DwaRefractiveMaterial" | "DwaBaseMaterial" => vec![
            json!({"transmission": 1.0, "use_dispersion": true}),
            json!({"transmission": 1.0, "use_independent_transmission_roughness": true,
                   "use_independent_transmission_refractive_index": true}),
        ],
        "OmniGlass" => vec![json!({"enable_opacity": true})],
        "OmniSurface" => vec![json!({"enable_specular_transmission": true, "specular_transmission_weight": 1.0,
                                     "enable_opacity": true, "specular_transmission_scattering_depth": 1.0})],
        "vray:BRDFVRayMtl" => vec![json!({"refract": 1.0, "dispersion_on": true}), json!({"metalness": 1.0})],
        "ND_disney_principled" => vec![json!({"specTrans": 1.0}), json!({"metallic": 1.0})],
        "LamaDielectric" => vec![json!({"fresnelMode": "Scientific"}), json!({})],
        "PxrSurface" => {
            vec![json!({"refractionGain": 1.0}), json!({"refractionGain": 1.0, "glassRefractionRoughness": 0.1})]
        }
        "AbbeGlass" => vec![json!({"transmission_depth": 1.0})],
        _ => vec![json!({})],
    }
}

fn with(base: &Value, name: &str, value: Value) -> Value {
    let mut values = base.clone();
    values[name] = value;
    values
}

/// What compiling says of `name` being `value`, for the first of the bases under which it is read.
fn refused(ids: &[&str], name: &str, value: &Value) -> Option<String> {
    ids.iter().flat_map(|id| bases(id).into_iter().map(move |base| (id, base))).find_map(|(id, base)| {
        let material = material(id, &with(&base, name, value.clone()));
        compile_alone(&material, &CENTIMETERS, &mut Diagnostics::default()).err().map(|error| error.to_string())
    })
}

#[test]
fn what_is_no_value_is_refused_at_every_input() {
    for dialect in DIALECTS {
        for name in dialect.inputs().iter().map(name_of) {
            // What becomes of NaN on its way here.
            let text = refused(dialect.ids(), name, &Value::Null)
                .unwrap_or_else(|| panic!("{:?} does not read {name}", dialect.ids()));
            assert!(
                text.starts_with(&format!("</M/S>.inputs:{name}: is not finite: author a")),
                "{:?} {name}: {text}",
                dialect.ids()
            );
        }
    }
}

#[test]
fn impossible_numbers_are_refused_where_they_stand() {
    let indices = [
        "ior",
        "specular_ior",
        "specular_IOR",
        "refractive_index",
        "independent_transmission_refractive_index",
        "glass_ior",
        "specular_reflection_ior",
        "refract_ior",
        "IOR",
        "glassIor",
    ];
    let abbe_numbers = [
        "transmission_dispersion_abbe_number",
        "transmission_dispersion",
        "dispersion_abbe_number",
        "specular_transmission_dispersion_abbe",
        "abbe_number",
        "dispersion",
    ];
    let colors =
        ["transmission_color", "attenuation_color", "fog_color", "specular_transmission_color", "absorptionColor"];
    let mut checked = 0;
    for dialect in DIALECTS {
        for name in dialect.inputs().iter().map(name_of) {
            let wrong = match name {
                _ if indices.contains(&name) => vec![json!(0.0), json!(-1.5), json!(1e30)],
                _ if abbe_numbers.contains(&name) => vec![json!(-3.0)],
                "transmission_dispersion_scale" => vec![json!(-0.5)],
                "reflectivity" => vec![json!(1.0), json!(-0.1)],
                "specular_weight" => vec![json!(-1.0), json!(25.0)],
                "attenuation_distance" | "absorptionRadius" => vec![json!(0.0), json!(-1.0)],
                "transmission_depth"
                | "specular_transmission_scattering_depth"
                | "depth"
                | "fog_mult"
                | "thickness" => {
                    vec![json!(-1.0)]
                }
                _ if colors.contains(&name) => vec![json!([0.5, 1.5, 0.5]), json!([-0.1, 0.5, 0.5]), json!([0.5, 0.5])],
                "opacityMode" | "alpha_mode" | "fresnelMode" | "specular_reflection_ior_preset" => {
                    vec![json!("other"), json!(-1)]
                }
                _ => continue,
            };
            for value in wrong {
                let text = refused(dialect.ids(), name, &value)
                    .unwrap_or_else(|| panic!("{:?} takes {name} = {value}", dialect.ids()));
                assert!(text.starts_with(&format!("</M/S>.inputs:{name}: ")), "{text}");
                assert!(text.contains("author") || value == json!(1e30), "a remedy is missing: {text}");
                checked += 1;
            }
        }
    }
    assert!(checked > 60, "{checked}");
}

#[test]
fn numbers_that_are_no_materials_are_warned_of() {
    let rows = [
        ("AbbeGlass", json!({"ior": 0.66}), "suspect-ior"),
        ("AbbeGlass", json!({"ior": 4.5}), "suspect-ior"),
        ("AbbeGlass", json!({"abbe_number": 1.0}), "suspect-abbe-number"),
        (
            "ND_standard_surface_surfaceshader",
            json!({"transmission": 1.0, "transmission_dispersion": 0.5}),
            "suspect-abbe-number",
        ),
        (
            "ND_gltf_pbr_surfaceshader",
            json!({"transmission": 1.0, "metallic": 0.0, "thickness": 1.0, "dispersion": 20.0}),
            "suspect-abbe-number",
        ),
        (
            "ND_gltf_pbr_surfaceshader",
            json!({"transmission": 1.0, "metallic": 0.0, "dispersion": 1.0}),
            "thin-wall-dispersion",
        ),
        (
            "ND_open_pbr_surface_surfaceshader",
            json!({"transmission_weight": 1.0, "base_metalness": 1.0}),
            "metal-over-glass",
        ),
        (
            "ND_open_pbr_surface_surfaceshader",
            json!({"transmission_weight": 1.0, "transmission_depth": 1.0, "transmission_scatter": 0.1}),
            "unread-input",
        ),
        ("OmniSurface", json!({"specular_transmission_weight": 1.0}), "unread-input"),
        ("BRDFVRayMtl", json!({"refract": 1.0, "fog_bias": 1.0}), "unread-input"),
        ("PxrSurface", json!({"refractionGain": 1.0, "extinction": [1.0, 0.0, 0.0]}), "unread-input"),
    ];
    for (id, values, kind) in rows {
        let (_, diagnostics) = compiled(id, &values);
        assert_eq!(kinds_of(&diagnostics), [kind], "{id} {values}");
        assert!(diagnostics.warnings()[0].places[0].starts_with("</M/S>.inputs:"), "{:?}", diagnostics.warnings());
    }
}
