//! Each form against numbers worked out by hand or printed in its specification.

use serde_json::json;

use super::*;
use crate::spectrum::lines;

const CONTEXT: Context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 0.01 };

fn material(document: serde_json::Value) -> description::Material {
    serde_json::from_value(document).expect("the test's document follows the schema")
}

/// A clear UsdPreviewSurface of index 1.5 with our attributes on the material.
fn preview(abbe: serde_json::Value) -> description::Material {
    material(json!({
        "path": "/M",
        "abbe": abbe,
        "surface": shader("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": float(1.5), "roughness": float(0.0)})),
    }))
}

fn shaded(id: &str, inputs: serde_json::Value) -> description::Material {
    material(json!({"path": "/M", "surface": shader(id, inputs)}))
}

fn shader(id: &str, inputs: serde_json::Value) -> serde_json::Value {
    json!({"path": "/M/S", "id": id, "terminal": "outputs:surface", "inputs": inputs})
}

fn float(value: f64) -> serde_json::Value {
    json!({"type": "float", "value": value})
}

fn double(value: f64) -> serde_json::Value {
    json!({"type": "double", "value": value})
}

fn doubles(values: &[f64]) -> serde_json::Value {
    json!({"type": "double[]", "value": values})
}

fn token(value: &str) -> serde_json::Value {
    json!({"type": "token", "value": value})
}

fn compiled(material: &description::Material) -> (Material, Diagnostics) {
    let mut diagnostics = Diagnostics::default();
    let material = compile_alone(material, &CONTEXT, &mut diagnostics).expect("compiles");
    (material, diagnostics)
}

fn kinds_of(diagnostics: &Diagnostics) -> Vec<&str> {
    diagnostics.warnings().iter().map(|warning| warning.kind.as_str()).collect()
}

fn law(material: &description::Material) -> Dispersion {
    let (material, diagnostics) = compiled(material);
    assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
    match material.kind {
        Kind::Dielectric { dispersion, .. } => dispersion,
        kind => panic!("{kind:?}: {}", material.chosen),
    }
}

fn refused(material: &description::Material) -> String {
    compile_alone(material, &CONTEXT, &mut Diagnostics::default()).expect_err("is refused").to_string()
}

/// Differences of a few units in the last place of numbers near 1.
fn close(a: f64, b: f64, digits: i32) {
    assert!((a - b).abs() <= 10f64.powi(-digits), "{a} is not {b}");
}

const BK7_B: [f64; 3] = [1.03961212, 0.231792344, 1.01046945];
const BK7_C: [f64; 3] = [0.00600069867, 0.0200179144, 103.560653];

#[test]
fn sellmeier_is_the_catalogue_glass() {
    let glass = law(&preview(json!({
        "abbe:dispersion:sellmeier:b": doubles(&BK7_B),
        "abbe:dispersion:sellmeier:c": doubles(&BK7_C),
    })));
    close(glass.at(lines::D).ior, 1.51680, 5);
    close(glass.abbe_number().expect("disperses"), 64.17, 2);
}

#[test]
fn formulas_follow_their_numbering() {
    let formula = |number: i32, coefficients: &[f64]| {
        preview(json!({
            "abbe:dispersion:formula": {"type": "int", "value": number},
            "abbe:dispersion:coefficients": doubles(coefficients),
        }))
    };
    // Formula 2 has the poles of the catalogue, formula 1 their roots (in µm).
    let pairs = |root: bool| {
        let mut list = vec![0.0];
        for (b, c) in BK7_B.iter().zip(BK7_C) {
            list.extend([*b, if root { c.sqrt() } else { c }]);
        }
        list
    };
    close(law(&formula(2, &pairs(false))).at(lines::F).ior, 1.52238, 5);
    close(law(&formula(1, &pairs(true))).at(lines::F).ior, 1.52238, 5);
    // n² = 1 + 1.25 at every wavelength: C1 is added to 1.
    close(law(&formula(2, &[1.25])).at(lines::C).ior, 1.5, 12);
    // n = 1.5 + 0.004 λ⁻² + 0.0001 λ⁻⁴; at C, λ² = 0.43069359…
    let expected = 1.5 + 0.004 / 0.656_272_5_f64.powi(2) + 0.0001 / 0.656_272_5_f64.powi(4);
    close(law(&formula(5, &[1.5, 0.004, -2.0, 0.0001, -4.0])).at(lines::C).ior, expected, 14);
    assert!(refused(&formula(1, &[0.0, 1.0])).starts_with("</M>.abbe:dispersion:coefficients"));
    assert!(refused(&formula(12, &[2.0])).contains("1 to 9"));
}

#[test]
fn abbe_number_gives_the_cauchy_law_of_the_exact_lines() {
    // MATH.md 4: B = (n_d − 1)/(V (λ_F⁻² − λ_C⁻²)) = 0.0042175527 µm² for BK7.
    let glass = law(&preview(json!({"abbe:dispersion:nd": double(1.5168), "abbe:dispersion:vd": double(64.17)})));
    close(glass.at(lines::D).ior, 1.5168, 14);
    close(glass.abbe_number().expect("disperses"), 64.17, 9);
    close(glass.at(lines::F).ior - glass.at(lines::C).ior, 0.5168 / 64.17, 14);
}

#[test]
fn a_zero_index_is_the_shaders_and_a_zero_abbe_number_is_none() {
    let shaders = law(&preview(json!({"abbe:dispersion:nd": double(0.0), "abbe:dispersion:vd": double(40.0)})));
    close(shaders.at(lines::D).ior, 1.5, 14);
    let constant = law(&preview(json!({"abbe:dispersion:vd": double(0.0)})));
    assert!(constant.is_constant());
    let mut open_pbr = shaded(
        "ND_open_pbr_surface_surfaceshader",
        json!({"transmission_weight": float(1.0), "transmission_dispersion_scale": float(1.0)}),
    );
    open_pbr.abbe.insert(
        "abbe:dispersion:vd".to_owned(),
        description::Authored { type_name: "double".to_owned(), value: json!(0.0) },
    );
    assert!(law(&open_pbr).is_constant(), "an authored 0 switches the network's dispersion off");
}

#[test]
fn cauchy_and_constant_laws() {
    let cauchy = law(&preview(json!({"abbe:dispersion:cauchy": doubles(&[1.5, 0.004])})));
    close(cauchy.at(lines::D).ior, 1.5 + 0.004 / 0.587_561_8_f64.powi(2), 14);
    let constant = law(&preview(json!({"abbe:dispersion:law": token("constant"), "abbe:dispersion:nd": double(1.7)})));
    assert!(constant.is_constant());
    close(constant.at(lines::F).ior, 1.7, 15);
}

#[test]
fn scale_multiplies_the_deviation_from_the_d_line() {
    let with_scale = |scale: f64| {
        law(&preview(json!({
            "abbe:dispersion:cauchy": doubles(&[1.5, 0.004]),
            "abbe:dispersion:scale": double(scale),
        })))
    };
    let (plain, double_) = (with_scale(1.0), with_scale(2.0));
    let at_d = plain.at(lines::D).ior;
    close(double_.at(lines::D).ior, at_d, 15);
    close(double_.at(lines::F).ior - at_d, 2.0 * (plain.at(lines::F).ior - at_d), 14);
    assert!(with_scale(0.0).is_constant());
}

#[test]
fn the_first_place_states_the_whole_law() {
    let mut glass = preview(json!({"abbe:dispersion:vd": double(30.0)}));
    let authored = |value: serde_json::Value| description::Authored { type_name: "double[]".to_owned(), value };
    let shader = glass.surface.as_mut().expect("has a shader");
    shader.abbe.insert("abbe:dispersion:cauchy".to_owned(), authored(json!([1.6, 0.01])));
    glass.interface_abbe.insert("abbe:dispersion:cauchy".to_owned(), authored(json!([1.7, 0.01])));
    close(law(&glass).at(lines::D).ior, 1.5, 14);
    glass.abbe.clear();
    close(law(&glass).at(lines::D).ior, 1.6 + 0.01 / 0.587_561_8_f64.powi(2), 14);
    glass.surface.as_mut().expect("has a shader").abbe.clear();
    close(law(&glass).at(lines::D).ior, 1.7 + 0.01 / 0.587_561_8_f64.powi(2), 14);
}

#[test]
fn several_laws_are_decided_by_the_law_token_or_by_precedence_with_a_warning() {
    let both = json!({"abbe:dispersion:cauchy": doubles(&[1.6]), "abbe:dispersion:vd": double(40.0)});
    let (_, diagnostics) = compiled(&preview(both.clone()));
    assert_eq!(kinds_of(&diagnostics), ["several-dispersion-laws"]);
    let mut decided = both;
    decided["abbe:dispersion:law"] = token("abbeNumber");
    let (decided, diagnostics) = compiled(&preview(decided));
    assert_eq!(kinds_of(&diagnostics), ["silenced-dispersion-law"]);
    let Kind::Dielectric { dispersion, .. } = decided.kind else { panic!("{}", decided.chosen) };
    close(dispersion.abbe_number().expect("disperses"), 40.0, 9);
}

#[test]
fn fallbacks_written_out_say_nothing() {
    let glass = law(&preview(json!({
        "abbe:glass": {"type": "string", "value": ""},
        "abbe:dispersion:law": token(""),
        "abbe:dispersion:cauchy": doubles(&[]),
        "abbe:dispersion:sellmeier:b": doubles(&[]),
        "abbe:dispersion:formula": {"type": "int", "value": 0},
        "abbe:dispersion:nd": double(0.0),
    })));
    assert!(glass.is_constant());
}

#[test]
fn open_pbr_divides_the_abbe_number_by_the_scale() {
    let glass = law(&shaded(
        "ND_open_pbr_surface_surfaceshader",
        json!({
            "transmission_weight": float(1.0),
            "specular_ior": float(1.52),
            "specular_roughness": float(0.0),
            "transmission_dispersion_scale": float(0.5),
            "transmission_dispersion_abbe_number": float(32.0),
        }),
    ));
    close(glass.abbe_number().expect("disperses"), 64.0, 9);
    close(glass.at(lines::D).ior, 1.52, 14);
}

#[test]
fn open_pbr_specular_weight_moves_the_index() {
    // n = 1.5: F0 = 0.04, ε = √(0.25·0.04) = 0.1, n' = 1.1/0.9. Below 1 the sign of ε follows: n = 1/1.5 gives 0.9/1.1.
    let index = |ior: f64, warnings: &[&str]| {
        let glass = shaded(
            "ND_open_pbr_surface_surfaceshader",
            json!({"transmission_weight": double(1.0), "specular_ior": double(ior), "specular_weight": double(0.25)}),
        );
        let (glass, diagnostics) = compiled(&glass);
        assert_eq!(kinds_of(&diagnostics), warnings);
        let Kind::Dielectric { dispersion, .. } = glass.kind else { panic!("{}", glass.chosen) };
        dispersion.at(lines::D).ior
    };
    close(index(1.5, &[]), 1.1 / 0.9, 14);
    close(index(1.0 / 1.5, &["suspect-ior"]), 0.9 / 1.1, 14);
}

#[test]
fn standard_surface_takes_the_abbe_number_itself_and_doubts_low_ones() {
    let glass = |number: f64| {
        shaded(
            "ND_standard_surface_surfaceshader_100",
            json!({"transmission": float(1.0), "specular_IOR": float(1.6), "transmission_dispersion": float(number)}),
        )
    };
    close(law(&glass(30.0)).abbe_number().expect("disperses"), 30.0, 9);
    assert!(law(&glass(0.0)).is_constant());
    let (_, diagnostics) = compiled(&glass(4.0));
    assert_eq!(kinds_of(&diagnostics), ["suspect-abbe-number"]);
    assert!(refused(&glass(-3.0)).starts_with("</M/S>.inputs:transmission_dispersion: is -3"));
}

#[test]
fn gltf_dispersion_is_twenty_over_the_abbe_number() {
    let inputs = json!({
        "transmission": float(1.0), "metallic": float(0.0), "thickness": float(1.0), "dispersion": float(0.5),
    });
    let glass = law(&shaded("ND_gltf_pbr_surfaceshader", inputs));
    close(glass.abbe_number().expect("disperses"), 40.0, 9);
    // The definition's metallic is 1: without authoring 0 there is no glass.
    let (metal, diagnostics) = compiled(&shaded("ND_gltf_pbr_surfaceshader", json!({"transmission": float(1.0)})));
    assert!(matches!(metal.kind, Kind::Opaque), "roughness is 1 unless authored");
    assert_eq!(kinds_of(&diagnostics), ["metal-over-glass"]);
}

#[test]
fn preview_surface_opacity_is_glass_or_a_hole() {
    let kind = |inputs: serde_json::Value| compiled(&shaded("UsdPreviewSurface", inputs)).0.kind;
    assert!(matches!(kind(json!({"opacity": float(0.4)})), Kind::Dielectric { rough: true, thin_walled: false, .. }));
    assert!(matches!(kind(json!({"opacity": float(0.5)})), Kind::Opaque));
    let presence = json!({"opacity": float(0.4), "opacityMode": token("presence")});
    assert!(matches!(kind(presence), Kind::PassThrough));
    let under = json!({"opacity": float(0.4), "opacityThreshold": float(0.45)});
    assert!(matches!(kind(under), Kind::PassThrough));
    let over = json!({"opacity": float(0.4), "opacityThreshold": float(0.3)});
    assert!(matches!(kind(over), Kind::Opaque));
    assert!(matches!(kind(json!({"metallic": float(1.0), "roughness": float(0.0)})), Kind::Mirror { .. }));
    assert!(matches!(kind(json!({"metallic": float(1.0)})), Kind::Opaque));
}

#[test]
fn thin_walls_and_cut_outs() {
    let (wall, _) = compiled(&shaded(
        "ND_standard_surface_surfaceshader",
        json!({"transmission": float(1.0), "thin_walled": {"type": "bool", "value": true}}),
    ));
    assert!(matches!(wall.kind, Kind::Dielectric { thin_walled: true, .. }));
    let opacity = json!({"transmission": float(1.0), "opacity": {"type": "color3f", "value": [0.0, 0.2, 0.1]}});
    let (hole, _) = compiled(&shaded("ND_standard_surface_surfaceshader", opacity));
    assert!(matches!(hole.kind, Kind::PassThrough));
}

#[test]
fn unknown_shaders_and_missing_surfaces_are_opaque() {
    let (unknown, diagnostics) = compiled(&shaded("PxrDiffuse", json!({})));
    assert!(matches!(unknown.kind, Kind::Opaque));
    assert_eq!(kinds_of(&diagnostics), ["unsupported-shader"]);
    assert!(diagnostics.warnings()[0].to_string().starts_with("</M/S>: shader 'PxrDiffuse'"));
    let (bare, diagnostics) = compiled(&material(json!({"path": "/M"})));
    assert!(matches!(bare.kind, Kind::Opaque) && diagnostics.is_empty());
    let idle = material(json!({"path": "/M", "abbe": {"abbe:dispersion:vd": double(30.0)}}));
    assert_eq!(kinds_of(&compiled(&idle).1), ["idle-dispersion"]);
}

#[test]
fn networks_are_named_and_their_default_is_used() {
    let mut glass = shaded("ND_open_pbr_surface_surfaceshader", json!({"transmission_weight": float(1.0)}));
    let shader = glass.surface.as_mut().expect("has a shader");
    shader.connected.insert("specular_ior".to_owned(), "/M/Map.outputs:out".to_owned());
    let (glass, diagnostics) = compiled(&glass);
    assert_eq!(kinds_of(&diagnostics), ["textured-input"]);
    let Kind::Dielectric { dispersion, .. } = glass.kind else { panic!("{}", glass.chosen) };
    close(dispersion.at(lines::D).ior, 1.5, 15);
}

#[test]
fn single_precision_and_misspelt_attributes_are_named() {
    let (_, diagnostics) = compiled(&preview(json!({
        "abbe:dispersion:vd": float(40.0),
        "abbe:dispersion:vdd": double(40.0),
    })));
    assert_eq!(kinds_of(&diagnostics), ["unread-attribute", "float-authored"]);
}

#[test]
fn priority_is_read_from_the_first_place_that_authors_it() {
    let (glass, _) = compiled(&preview(json!({"abbe:dielectricPriority": {"type": "int", "value": 3}})));
    assert!(matches!(glass.kind, Kind::Dielectric { priority, .. } if priority == Priority::lower_wins(3)));
}

#[test]
fn wrong_numbers_are_refused_where_they_stand() {
    for (abbe, start) in [
        (json!({"abbe:dispersion:vd": double(-3.0)}), "</M>.abbe:dispersion:vd: is -3.0: author a positive"),
        (json!({"abbe:dispersion:nd": double(-1.5)}), "</M>.abbe:dispersion:nd: is -1.5"),
        (json!({"abbe:dispersion:vd": {"type": "double", "value": null}}), "</M>.abbe:dispersion:vd: is not finite"),
        (json!({"abbe:dispersion:vd": {"type": "double", "value": "inf"}}), "</M>.abbe:dispersion:vd: is \"inf\""),
        (json!({"abbe:dispersion:scale": double(-1.0)}), "</M>.abbe:dispersion:scale: is -1.0"),
        (json!({"abbe:dispersion:law": token("sellmeyer")}), "</M>.abbe:dispersion:law: is \"sellmeyer\""),
        (json!({"abbe:dispersion:law": token("cauchy")}), "</M>.abbe:dispersion:cauchy: is not authored"),
        (json!({"abbe:dispersion:law": token("abbeNumber")}), "</M>.abbe:dispersion:vd: is not authored"),
        (
            json!({"abbe:dispersion:sellmeier:b": doubles(&[1.0, 2.0]), "abbe:dispersion:sellmeier:c": doubles(&[0.01])}),
            "</M>.abbe:dispersion:sellmeier:c: is [0.01]: has 1 values where abbe:dispersion:sellmeier:b has 2",
        ),
        // A pole at √0.3 µm = 548 nm.
        (
            json!({"abbe:dispersion:sellmeier:b": doubles(&[1.0]), "abbe:dispersion:sellmeier:c": doubles(&[0.3])}),
            "</M>.abbe:dispersion:sellmeier:b: ",
        ),
        (
            json!({"abbe:dispersion:cauchy": doubles(&[1.5]), "abbe:dispersion:validRange": {"type": "double2", "value": [600.0, 700.0]}}),
            "</M>.abbe:dispersion:validRange: ",
        ),
        (json!({"abbe:dielectricPriority": double(0.5)}), "</M>.abbe:dielectricPriority: is 0.5"),
    ] {
        let text = refused(&preview(abbe));
        assert!(text.starts_with(start), "{text}");
    }
    let no_ior = shaded("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": float(0.0)}));
    assert!(refused(&no_ior).starts_with("</M/S>.inputs:ior: is 0.0: author the refractive index"));
}

#[test]
fn scalar_ior_policies_are_constant_and_nearest_glass() {
    for text in ["", "constant"] {
        assert_eq!(ScalarIor::parse(text, "--scalar-ior").expect("is known"), ScalarIor::Constant);
    }
    for text in ["nearestGlass", "nearest-glass"] {
        assert_eq!(ScalarIor::parse(text, "--scalar-ior").expect("is known"), ScalarIor::NearestGlass);
    }
    let error = ScalarIor::parse("other", "--scalar-ior").expect_err("is refused");
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().starts_with("--scalar-ior: "), "{error}");
}

#[test]
fn nearest_glass_gives_a_lone_index_the_curve_of_the_catalogue() {
    let nearest = Context { scalar_ior: ScalarIor::NearestGlass, ..CONTEXT };
    let with_ior = |ior: f64, abbe_number: f64| {
        let inputs = json!({"transmission": float(1.0), "specular_IOR": float(ior), "transmission_dispersion": float(abbe_number)});
        let mut diagnostics = Diagnostics::default();
        let glass = compile_alone(&shaded("ND_standard_surface_surfaceshader", inputs), &nearest, &mut diagnostics);
        (glass.expect("compiles"), diagnostics)
    };
    let curve = |glass: &Material| match &glass.kind {
        Kind::Dielectric { dispersion, .. } => dispersion.clone(),
        kind => panic!("{kind:?}"),
    };
    for ior in [1.333, 1.46, 1.5168, 1.6, 1.78472, 2.0] {
        let (glass, _) = with_ior(ior, 0.0);
        let distance = (curve(&glass).at(lines::D).ior - ior).abs();
        assert!(distance < 0.005, "{}", glass.chosen);
        assert!(curve(&glass).abbe_number().is_some(), "{}", glass.chosen);
        assert!(glass.chosen.contains("nearest is "), "{}", glass.chosen);
    }
    // N-SF11 and its equivalents have V_d from 25.6 to 25.8.
    close(curve(&with_ior(1.78472, 0.0).0).abbe_number().expect("disperses"), 25.7, 0);
    let (none, diagnostics) = with_ior(1.0, 0.0);
    assert!(curve(&none).is_constant());
    assert_eq!(kinds_of(&diagnostics), ["no-near-glass"]);
    // Where dispersion is authored, or said to be none, the policy says nothing.
    let (authored, _) = with_ior(1.5168, 30.0);
    close(curve(&authored).abbe_number().expect("disperses"), 30.0, 9);
    let mut constant = shaded("ND_standard_surface_surfaceshader", json!({"transmission": float(1.0)}));
    constant.abbe.insert(
        "abbe:dispersion:vd".to_owned(),
        description::Authored { type_name: "double".to_owned(), value: json!(0.0) },
    );
    let glass = compile_alone(&constant, &nearest, &mut Diagnostics::default()).expect("compiles");
    assert!(curve(&glass).is_constant());
}

#[test]
fn the_first_terminal_that_is_understood_is_used() {
    let mut glass = shaded("Unheard_of", json!({}));
    glass.alternatives = vec![
        serde_json::from_value(shader("Unknown_too", json!({}))).expect("is a shader"),
        serde_json::from_value(shader("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": float(1.7)})))
            .expect("is a shader"),
        serde_json::from_value(shader("ND_gltf_pbr_surfaceshader", json!({}))).expect("is a shader"),
    ];
    let (found, diagnostics) = compiled(&glass);
    assert!(diagnostics.is_empty(), "{:?}", diagnostics.warnings());
    let Kind::Dielectric { dispersion, .. } = found.kind else { panic!("{}", found.chosen) };
    close(dispersion.at(lines::D).ior, 1.7, 15);
    assert!(
        found.chosen.contains("UsdPreviewSurface through outputs:surface")
            && found.chosen.contains("Unheard_of, Unknown_too"),
        "{}",
        found.chosen
    );
    glass.alternatives.truncate(1);
    let (unknown, diagnostics) = compiled(&glass);
    assert_eq!(kinds_of(&diagnostics), ["unsupported-shader", "unsupported-shader"]);
    assert_eq!(unknown.chosen, "opaque: shader 'Unheard_of', 'Unknown_too' is not understood");
}

#[test]
fn priorities_of_arnold_let_the_higher_win_and_ours_come_first() {
    let priority = |glass: &description::Material| match compiled(glass).0.kind {
        Kind::Dielectric { priority, .. } => priority,
        kind => panic!("{kind:?}"),
    };
    let int = |value: i32| json!({"type": "int", "value": value});
    let mut arnold =
        shaded("arnold:standard_surface", json!({"transmission": float(1.0), "dielectric_priority": int(2)}));
    assert_eq!(priority(&arnold), Priority::higher_wins(2));
    assert!(compiled(&arnold).0.chosen.ends_with("; priority 2 (higher wins) from </M/S>.inputs:dielectric_priority"));
    arnold.abbe.insert(
        "abbe:dielectricPriority".to_owned(),
        description::Authored { type_name: "int".to_owned(), value: json!(5) },
    );
    assert_eq!(priority(&arnold), Priority::lower_wins(5));
}

#[test]
fn metals_are_what_their_attributes_state() {
    let metal = |abbe: serde_json::Value| {
        let mut metal = preview(abbe);
        metal.surface = serde_json::from_value(shader(
            "UsdPreviewSurface",
            json!({"metallic": float(1.0), "roughness": float(0.0)}),
        ))
        .expect("is a shader");
        metal
    };
    let conductor = |abbe: serde_json::Value| {
        let (metal, diagnostics) = compiled(&metal(abbe));
        match metal.kind {
            Kind::Mirror { conductor } => {
                (conductor, kinds_of(&diagnostics).iter().map(|k| (*k).to_owned()).collect::<Vec<_>>())
            }
            kind => panic!("{kind:?}: {}", metal.chosen),
        }
    };
    let pairs = |values: [[f64; 2]; 2]| json!({"type": "double2[]", "value": values});
    let law = json!({"abbe:dispersion:cauchy": doubles(&[0.2]), "abbe:extinction:table": pairs([[400.0, 3.0], [800.0, 5.0]])});
    let (stated, warnings) = conductor(law);
    let Conductor { dispersion, extinction } = stated.expect("is stated");
    close(dispersion.at(lines::D).ior, 0.2, 15);
    close(extinction.at(crate::spectrum::Wavelength::from_nanometers(600.0)), 4.0, 12);
    assert!(warnings.is_empty());
    assert!(conductor(json!({})).0.is_none());
    // Gold, by name: yellow, so k grows towards the red.
    let named = |name: &str| conductor(json!({"abbe:glass": {"type": "string", "value": name}}));
    let gold = named("gold").0.expect("is a metal");
    assert!(gold.extinction.at(lines::C) > gold.extinction.at(lines::F));
    assert!(gold.dispersion.at(lines::D).ior < 1.0);
    for half in [
        json!({"abbe:dispersion:vd": double(30.0)}),
        json!({"abbe:extinction:table": pairs([[400.0, 3.0], [800.0, 5.0]])}),
        json!({"abbe:glass": {"type": "string", "value": "SCHOTT:N-BK7"}}),
    ] {
        let (none, warnings) = conductor(half);
        assert!(none.is_none());
        assert_eq!(warnings, ["no-metal"]);
    }
}

#[test]
fn single_precision_is_read_as_it_was_written() {
    // What a stage's `float inputs:ior = 1.52` crosses as.
    let single = f64::from(1.52_f32);
    let glass = shaded("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": float(single)}));
    assert!(law(&glass).at(lines::D).ior.to_bits() == 1.52_f64.to_bits());
    let wide = shaded("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": double(single)}));
    assert!(law(&wide).at(lines::D).ior.to_bits() == single.to_bits());
    let third = shaded("UsdPreviewSurface", json!({"opacity": float(0.0), "ior": double(4.0 / 3.0)}));
    assert!(law(&third).at(lines::D).ior.to_bits() == (4.0_f64 / 3.0).to_bits());
}
