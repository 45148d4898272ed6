//! Every form of our attributes, and every impossible number with its prim, attribute and remedy.

use serde_json::{Value, json};

use super::super::{Context, Kind, Material, ScalarIor, compile_alone};
use super::absorption::StatedAbsorption;
use super::*;
use crate::optics::Extinction;
use crate::optics::dispersion::OutOfRange;
use crate::scene::description;
use crate::spectrum::{Wavelength, lines};

/// A clear surface of index 1.5 with `abbe` on the material.
fn glass(abbe: &Value) -> description::Material {
    let float = |value: f64| json!({"type": "float", "value": value});
    let document = json!({
        "path": "/M",
        "abbe": abbe,
        "surface": {
            "path": "/M/S",
            "id": "UsdPreviewSurface",
            "terminal": "outputs:surface",
            "inputs": {"opacity": float(0.0), "ior": float(1.5), "roughness": float(0.0)},
        },
    });
    serde_json::from_value(document).expect("the test's document follows the schema")
}

fn compiled(abbe: &Value) -> Result<(Material, Diagnostics)> {
    let mut diagnostics = Diagnostics::default();
    let context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 0.01 };
    let material = compile_alone(&glass(abbe), &context, &mut diagnostics)?;
    Ok((material, diagnostics))
}

fn dispersion(abbe: &Value) -> (Dispersion, Vec<String>) {
    let (material, diagnostics) = compiled(abbe).expect("compiles");
    let kinds = diagnostics.warnings().iter().map(|warning| warning.to_string()).collect();
    match material.kind {
        Kind::Dielectric { dispersion, .. } => (dispersion, kinds),
        kind => panic!("{kind:?}"),
    }
}

fn quiet(abbe: &Value) -> Dispersion {
    let (dispersion, warnings) = dispersion(abbe);
    assert!(warnings.is_empty(), "{warnings:?}");
    dispersion
}

fn refused(abbe: &Value) -> String {
    compiled(abbe).expect_err("is refused").to_string()
}

fn absorption(abbe: &Value) -> Option<StatedAbsorption> {
    let material = glass(abbe);
    let authored = Authored::new(vec![Values::new(&material.abbe, &material.path, "")]);
    authored.absorption(&mut Diagnostics::default()).expect("is read")
}

fn double(value: f64) -> Value {
    json!({"type": "double", "value": value})
}

fn doubles(values: &[f64]) -> Value {
    json!({"type": "double[]", "value": values})
}

fn range(from: f64, to: f64) -> Value {
    json!({"type": "double2", "value": [from, to]})
}

fn pairs(values: &[[f64; 2]]) -> Value {
    json!({"type": "double2[]", "value": values})
}

fn token(value: &str) -> Value {
    json!({"type": "token", "value": value})
}

fn formula(number: i32, coefficients: &[f64]) -> Value {
    json!({FORMULA: {"type": "int", "value": number}, COEFFICIENTS: doubles(coefficients)})
}

#[test]
fn each_formula_is_read_by_its_number() {
    // By hand at the d line, λ = 0.5875618 µm: L = λ² = 0.345228868…
    let l = 0.587_561_8_f64;
    let x = l * l;
    for (number, coefficients, ior) in [
        (1, vec![0.1, 1.1, 0.1], (1.1 + 1.1 * x / (x - 0.01)).sqrt()),
        (2, vec![0.1, 1.1, 0.01], (1.1 + 1.1 * x / (x - 0.01)).sqrt()),
        (3, vec![2.2, 0.01, -2.0, 0.02, 0.5], (2.2 + 0.01 / x + 0.02 * l.sqrt()).sqrt()),
        (
            4,
            vec![2.0, 0.1, 1.0, 0.2, 2.0, 0.0, 0.0, 0.0, 1.0, -0.01, 2.0],
            (2.0 + 0.1 * l / (x - 0.04) - 0.01 * x).sqrt(),
        ),
        (5, vec![1.5, 0.004, -1.0], 1.5 + 0.004 / l),
        (6, vec![0.4, 1.5, 25.0], 1.4 + 1.5 / (25.0 - 1.0 / x)),
        (7, vec![1.5, 0.006, 0.0003, -0.003], 1.5 + 0.006 / (x - 0.028) + 0.0003 / (x - 0.028).powi(2) - 0.003 * x),
        (8, vec![0.3, 0.05, 0.03, -0.001], {
            let q = 0.3 + 0.05 * x / (x - 0.03) - 0.001 * x;
            ((1.0 + 2.0 * q) / (1.0 - q)).sqrt()
        }),
        (9, vec![2.5, 0.02, 0.03, 0.02, 1.5, 0.9], {
            let v = l - 1.5;
            (2.5 + 0.02 / (x - 0.03) + 0.02 * v / (v * v + 0.9)).sqrt()
        }),
    ] {
        let found = quiet(&formula(number, &coefficients)).at(lines::D).ior;
        assert!((found - ior).abs() < 1e-15 * 4.0, "formula {number}: {found} is not {ior}");
    }
}

#[test]
fn a_named_glass_is_that_of_the_catalogue_with_its_range_and_its_absorption() {
    // SCHOTT's data sheet: n_d = 1.51680, V_d = 64.17.
    for name in ["SCHOTT:N-BK7", "schott: n bk7"] {
        let glass = quiet(&json!({GLASS: token(name)}));
        assert!((glass.at(lines::D).ior - 1.51680).abs() < 5e-6);
        assert!((glass.abbe_number().expect("disperses") - 64.17).abs() < 5e-3);
        assert!(glass.valid_range().is_some_and(|range| range.contains_the_visible()));
    }
    let by_law = quiet(&json!({LAW: token("glass"), GLASS: token("SCHOTT:N-BK7"), VALID_RANGE: range(300.0, 900.0)}));
    assert_eq!(by_law.valid_range().map(|range| range.to_string()), Some("300 to 900 nm".to_owned()));
    let scaled = quiet(&json!({GLASS: token("SCHOTT:N-BK7"), SCALE: double(2.0)}));
    assert!((scaled.abbe_number().expect("disperses") - 64.17 / 2.0).abs() < 5e-3);
    // k of the glass, unless absorption is authored, and only where the glass is the law.
    let entry = catalog::find("SCHOTT:N-BK7").expect("is there");
    let measured = entry.extinction().expect("SCHOTT states transmittances");
    assert_eq!(
        absorption(&json!({GLASS: token("SCHOTT:N-BK7")})),
        Some(StatedAbsorption::Extinction { entries: measured, place: format!("</M>.{GLASS}") })
    );
    let own = [[400.0, 1e-8], [700.0, 0.0]];
    assert_eq!(
        absorption(&json!({GLASS: token("SCHOTT:N-BK7"), EXTINCTION: pairs(&own)})),
        Some(StatedAbsorption::Extinction { entries: own.to_vec(), place: format!("</M>.{EXTINCTION}") })
    );
    assert_eq!(absorption(&json!({LAW: token("abbeNumber"), VD: double(30.0), GLASS: token("SCHOTT:N-BK7")})), None);
}

#[test]
fn every_clear_material_of_the_catalogue_can_be_authored_by_its_name() {
    let mut count = 0;
    for entry in catalog::entries().filter(|entry| !entry.is_metal()) {
        let material = json!({GLASS: token(entry.name())});
        let (law, _) = dispersion(&material);
        assert_eq!(law, entry.dispersion(OutOfRange::Clamp).expect("is a law"), "{}", entry.name());
        if let Some(StatedAbsorption::Extinction { entries, .. }) = absorption(&material) {
            Extinction::table(&entries).unwrap_or_else(|problem| panic!("{}: {problem}", entry.name()));
        }
        count += 1;
    }
    assert!(count > 500, "{count} entries");
}

#[test]
fn a_table_is_read_as_pairs() {
    let law = quiet(&json!({TABLE: pairs(&[[350.0, 1.53], [550.0, 1.51], [850.0, 1.5]])}));
    assert!((law.at(Wavelength::from_nanometers(550.0)).ior - 1.51).abs() < 1e-15);
    assert_eq!(law.valid_range().map(|range| range.to_string()), Some("350 to 850 nm".to_owned()));
}

#[test]
fn a_range_that_clamps_a_part_of_the_band_is_told_once() {
    let authored = |range: Value, outside: &str| json!({CAUCHY: doubles(&[1.5, 0.004]), VALID_RANGE: range, OUT_OF_RANGE: token(outside)});
    let (law, warnings) = dispersion(&authored(range(450.0, 650.0), ""));
    assert_eq!(law.out_of_range(), OutOfRange::Clamp);
    assert!(law.at(Wavelength::from_nanometers(400.0)).is_constant());
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.starts_with("</M>.abbe:dispersion:cauchy: the law is valid from 450 to 650 nm: "), "{warning}");
    // Nothing to tell: the range is as wide as the band, is not clamped, or is the law's own.
    assert_eq!(quiet(&authored(range(300.0, 900.0), "clamp")).out_of_range(), OutOfRange::Clamp);
    assert_eq!(quiet(&authored(range(450.0, 650.0), "error")).out_of_range(), OutOfRange::Error);
    let free = quiet(&authored(range(450.0, 650.0), "extrapolate"));
    assert!(!free.at(Wavelength::from_nanometers(400.0)).is_constant());
    assert_eq!(quiet(&authored(range(0.0, 0.0), "clamp")).valid_range(), None);
    let (_, warnings) = dispersion(&json!({TABLE: pairs(&[[450.0, 1.53], [550.0, 1.51], [650.0, 1.5]])}));
    assert!(
        warnings.len() == 1 && warnings[0].starts_with("</M>.abbe:dispersion:table: the law is valid"),
        "{warnings:?}"
    );
    let (_, warnings) = dispersion(&json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: range(450.0, 650.0)}));
    assert!(warnings.is_empty(), "a constant index is what it is: {warnings:?}");
}

#[test]
fn an_explicit_law_names_what_it_silences() {
    let both = json!({
        LAW: token("cauchy"), CAUCHY: doubles(&[1.5, 0.004]), TABLE: pairs(&[[400.0, 1.5]]), VD: double(30.0),
    });
    let (_, warnings) = dispersion(&both);
    assert_eq!(
        warnings,
        ["</M>.abbe:dispersion:law: is cauchy: what is authored for table, abbeNumber have no effect"],
        "and the broken table is not read"
    );
    // The constant law's own attribute silences nothing, nor does an Abbe number of 0; another one is overruled.
    let constant = |vd: f64| json!({LAW: token("constant"), ND: double(1.7), VD: double(vd)});
    assert!(quiet(&constant(0.0)).is_constant());
    assert!(quiet(&json!({LAW: token("constant"), ND: double(1.7)})).is_constant());
    assert_eq!(dispersion(&constant(30.0)).1.len(), 1);
    assert!(quiet(&json!({LAW: token("abbeNumber"), ND: double(1.7), VD: double(30.0)})).abbe_number().is_some());
}

#[test]
fn absorption_is_k_or_the_transmittance_of_a_plate() {
    let (k, tau) = ([[400.0, 1e-8], [700.0, 0.0]], [[400.0, 0.99], [700.0, 1.0]]);
    let place = |name: &str| format!("</M>.{name}");
    assert_eq!(
        absorption(&json!({EXTINCTION: pairs(&k)})),
        Some(StatedAbsorption::Extinction { entries: k.to_vec(), place: place(EXTINCTION) })
    );
    let plate = |thickness_mm| {
        Some(StatedAbsorption::InternalTransmittance {
            entries: tau.to_vec(),
            thickness_mm,
            place: place(TRANSMITTANCE),
        })
    };
    assert_eq!(absorption(&json!({TRANSMITTANCE: pairs(&tau), THICKNESS: double(25.0)})), plate(25.0));
    assert_eq!(absorption(&json!({TRANSMITTANCE: pairs(&tau)})), plate(10.0), "the schema's fallback");
    assert_eq!(absorption(&json!({EXTINCTION: pairs(&[]), TRANSMITTANCE: pairs(&[]), THICKNESS: double(10.0)})), None);
    let (material, diagnostics) =
        compiled(&json!({EXTINCTION: pairs(&k), TRANSMITTANCE: pairs(&tau)})).expect("compiles");
    assert_eq!(diagnostics.warnings()[0].kind, "several-absorptions");
    assert!(material.chosen.contains("</M>.abbe:extinction:table"), "{}", material.chosen);
}

#[test]
fn impossible_numbers_name_prim_attribute_and_remedy() {
    let not_a_number = json!({"type": "double", "value": null});
    for (abbe, attribute, remedy) in [
        (json!({VD: double(-3.0)}), VD, "is -3.0: author a positive Abbe number, or 0 for no dispersion"),
        (json!({VD: not_a_number}), VD, "is not finite: author a finite number of type double"),
        (json!({VD: double(0.01)}), VD, "the index is"),
        (json!({ND: double(-1.5)}), ND, "is -1.5: author a positive index, or 0 for the shader's"),
        (json!({ND: double(0.001)}), ND, "the index is 0.001, it must lie between 0.01 and 100"),
        (json!({ND: double(1e6)}), ND, "it must lie between 0.01 and 100"),
        (json!({CAUCHY: doubles(&[1.5, 4217.0])}), CAUCHY, "look like coefficients for λ in nm"),
        (json!({CAUCHY: {"type": "double[]", "value": [1.5, null]}}), CAUCHY, "author a list of finite numbers"),
        (json!({CAUCHY: doubles(&[-1.5])}), CAUCHY, "it must lie between 0.01 and 100"),
        (
            json!({SELLMEIER_B: doubles(&[1.04, 0.23, 1.01]), SELLMEIER_C: doubles(&[6000.7, 20017.9, 1.0356e8])}),
            SELLMEIER_B,
            "if the coefficients C were in nm²: divide them by 10^6",
        ),
        (
            json!({SELLMEIER_B: doubles(&[1.04])}),
            SELLMEIER_C,
            "is not authored: the law needs it: author C1 C2 … in µm²",
        ),
        (json!({SELLMEIER_B: doubles(&[1.0]), SELLMEIER_C: doubles(&[0.3])}), SELLMEIER_B, "has a pole at 547.723 nm"),
        (formula(12, &[2.0]), FORMULA, "is 12: refractiveindex.info has the formulas 1 to 9"),
        (formula(-1, &[2.0]), FORMULA, "is -1: refractiveindex.info has the formulas 1 to 9"),
        (formula(0, &[2.0]), FORMULA, "author the number of the formula"),
        (formula(3, &[]), COEFFICIENTS, "author the formula's coefficients"),
        (formula(3, &[2.0, 0.1]), COEFFICIENTS, "the last pair is cut short"),
        (formula(6, &[0.0, 0.001, 4.0]), COEFFICIENTS, "has a pole at 500.000 nm"),
        (formula(8, &[1.5]), COEFFICIENTS, "the law has no real index"),
        (json!({TABLE: pairs(&[[500.0, 1.5]])}), TABLE, "one entry, two at least are needed"),
        (json!({TABLE: pairs(&[[700.0, 1.49], [400.0, 1.5]])}), TABLE, "decreasing wavelengths: reverse"),
        (json!({TABLE: pairs(&[[400.0, 1.5], [400.0, 1.5]])}), TABLE, "two entries at 400 nm: leave one out"),
        (
            json!({TABLE: pairs(&[[0.4, 1.5], [0.7, 1.49]])}),
            TABLE,
            "look like µm (0.4): nm are wanted, multiply them by 1000",
        ),
        (
            json!({TABLE: pairs(&[[400.0, 0.0], [700.0, 1.49]])}),
            TABLE,
            "has the index 0 at 400 nm: it must be positive",
        ),
        (json!({TABLE: pairs(&[[900.0, 1.5], [1000.0, 1.49]])}), TABLE, "without the d line"),
        (json!({TABLE: doubles(&[400.0, 1.5])}), TABLE, "author a list of pairs of finite numbers of type double2[]"),
        (json!({LAW: token("glass")}), GLASS, "author a name of the catalogue, such as \"SCHOTT:N-BK7\""),
        (json!({GLASS: token("SCHOTT:N-BK77")}), GLASS, "N-BK7"),
        (json!({GLASS: token("gold")}), GLASS, "is a metal, and light passes this surface"),
        (json!({GLASS: double(1.5)}), GLASS, "is 1.5: author a token or string"),
        (json!({GLASS: token("SCHOTT:N-BK7"), VALID_RANGE: range(0.4, 0.7)}), VALID_RANGE, "look like µm"),
        (json!({LAW: token("table")}), TABLE, "is not authored: the law needs it: author pairs (nm, n)"),
        (json!({TABLE: {"type": "double2[]", "value": [[400.0, null], [700.0, 1.5]]}}), TABLE, "finite numbers"),
        (json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: range(0.4, 0.7)}), VALID_RANGE, "look like µm"),
        (json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: range(700.0, 400.0)}), VALID_RANGE, "the shorter first"),
        (json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: range(600.0, 700.0)}), VALID_RANGE, "without the d line"),
        (json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: double(500.0)}), VALID_RANGE, "author a list"),
        (json!({CAUCHY: doubles(&[1.5]), VALID_RANGE: doubles(&[500.0])}), VALID_RANGE, "author two wavelengths in nm"),
        (
            json!({TABLE: pairs(&[[400.0, 1.5], [700.0, 1.49]]), VALID_RANGE: range(300.0, 700.0)}),
            VALID_RANGE,
            "goes beyond the table, which knows 400 to 700 nm",
        ),
        (
            json!({CAUCHY: doubles(&[1.5]), OUT_OF_RANGE: token("crash")}),
            OUT_OF_RANGE,
            "author clamp, error or extrapolate",
        ),
        (
            json!({LAW: token("sellmeyer")}),
            LAW,
            "author glass, sellmeier, cauchy, formula, table, abbeNumber or constant",
        ),
        (json!({SCALE: double(-1.0)}), SCALE, "author 0 (off), 1 (physical) or any positive factor"),
        (json!({CAUCHY: doubles(&[1.5, 0.01]), SCALE: double(1e4)}), SCALE, "with the dispersion scaled by 10000"),
        (
            json!({EXTINCTION: pairs(&[[400.0, -1e-8], [700.0, 0.0]])}),
            EXTINCTION,
            "k is -0.00000001 at 400 nm: k is 0 or more",
        ),
        (json!({EXTINCTION: pairs(&[[400.0, 0.1]])}), EXTINCTION, "has one entry"),
        (json!({EXTINCTION: pairs(&[[0.4, 0.1], [0.7, 0.1]])}), EXTINCTION, "look like µm"),
        (json!({EXTINCTION: pairs(&[[700.0, 0.1], [400.0, 0.1]])}), EXTINCTION, "decreasing wavelengths"),
        (json!({TRANSMITTANCE: pairs(&[[400.0, 0.0], [700.0, 1.0]])}), TRANSMITTANCE, "lets nothing at all pass"),
        (json!({TRANSMITTANCE: pairs(&[[400.0, 99.0], [700.0, 1.0]])}), TRANSMITTANCE, "divide per cents by 100"),
        (json!({TRANSMITTANCE: pairs(&[[400.0, -0.1], [700.0, 1.0]])}), TRANSMITTANCE, "above 0 and not above 1"),
        (json!({TRANSMITTANCE: pairs(&[[400.0, 0.9], [300.0, 1.0], [500.0, 1.0]])}), TRANSMITTANCE, "sort the entries"),
        (
            json!({TRANSMITTANCE: pairs(&[[400.0, 0.9], [700.0, 1.0]]), THICKNESS: double(0.0)}),
            THICKNESS,
            "is 0.0: author the thickness of the plate in mm",
        ),
    ] {
        let text = refused(&abbe);
        assert!(text.starts_with(&format!("</M>.{attribute}: ")), "{attribute}: {text}");
        assert!(text.contains(remedy), "{text}");
    }
}
