//! What each model comes to, against the formulas of its specification.

use serde_json::{Value, json};

use super::super::{Context, Material, ScalarIor, compile_alone};
use super::*;
use crate::scene::description;
use crate::spectrum::visible;

const CONTEXT: Context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 1.0 };

fn material(id: &str, inputs: &Value) -> Material {
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
    let material: description::Material =
        serde_json::from_value(json!({"path": "/M", "surface": surface})).expect("follows the schema");
    let mut diagnostics = Diagnostics::default();
    let material = compile_alone(&material, &CONTEXT, &mut diagnostics).expect("compiles");
    assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
    material
}

fn at(id: &str, inputs: &Value) -> SurfaceAt<4> {
    let surface = material(id, inputs).surface;
    assert!(surface.looked_up().is_none(), "constants run no program");
    let wavelengths = visible::sample::<4>(0.3);
    let media = Interface { ior_i: SampledSpectrum::ONE, ior_t: SampledSpectrum::splat(1.25) };
    surface.at(&[[0.0; 4]; MAX_RESULTS], &wavelengths, media)
}

fn close(a: f32, b: f32) {
    assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{a} is not {b}");
}

/// The reflectance at normal incidence of the dielectric.
fn f0(at: &SurfaceAt<4>) -> f32 {
    let Interface { ior_i, ior_t } = at.parameters.interface;
    let root = (ior_t[0] - ior_i[0]) / (ior_t[0] + ior_i[0]);
    root * root
}

#[test]
fn preview_surface_in_the_metallic_workflow() {
    for ior in [1.1, 1.5, 2.4_f32] {
        let at = at("UsdPreviewSurface", &json!({"ior": ior, "roughness": 0.3, "metallic": 0.25}));
        close(f0(&at), ((1.0 - ior) / (1.0 + ior)).powi(2));
        at.parameters.schlick_f0.expect("is Schlick's").0.map(|schlick| close(schlick, f0(&at)));
        at.parameters.alpha.map(|alpha| close(alpha, 0.09));
        close(at.parameters.metalness, 0.25);
        close(at.parameters.transmission, 0.0);
        assert!(at.parameters.coat.is_none() && at.parameters.sheen.is_none() && at.parameters.film.is_none());
    }
}

#[test]
fn preview_surface_in_the_specular_workflow_has_schlicks_reflectance_of_its_colour() {
    let inputs = json!({"useSpecularWorkflow": 1, "specularColor": [0.3, 0.3, 0.3], "metallic": 1.0, "ior": 3.0});
    let at = at("UsdPreviewSurface", &inputs);
    at.parameters.schlick_f0.expect("is Schlick's").0.map(|f0| close(f0, 0.3));
    close(at.parameters.metalness, 0.0);
    assert!(at.parameters.base_color.0.iter().all(|albedo| (albedo - 0.18).abs() < 1e-5));
}
