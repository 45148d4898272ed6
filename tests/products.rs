//! What a product asks for: layers by their variables, types, the driver, windows, the header.

mod support;

use std::collections::BTreeMap;

use abbe::camera::linear_exposure_scale;
use abbe::diagnostics::Diagnostics;
use abbe::film::Window;
use abbe::film::metadata::Attribute;
use abbe::integrator::Registry;
use abbe::render::{Plan, Request, plan};
use abbe::scene::description::{Authored, Exposure, Product, Var};
use serde_json::{Value, json};
use support::{ball, rendered};

fn product(vars: Vec<Var>) -> Product {
    Product {
        path: "/Render/Product".into(),
        name: "out.exr".into(),
        product_type: "raster".into(),
        camera: None,
        resolution: Some([40, 20]),
        pixel_aspect_ratio: 1.0,
        aspect_ratio_conform_policy: "expandAperture".into(),
        data_window_ndc: [0.0, 0.0, 1.0, 1.0],
        disable_depth_of_field: false,
        disable_motion_blur: false,
        rendering_color_space: String::new(),
        abbe: BTreeMap::new(),
        driver: BTreeMap::new(),
        vars,
    }
}

fn map(entries: &[(&str, Value)]) -> BTreeMap<String, Authored> {
    let authored = |value: &Value| Authored { type_name: "token".into(), value: value.clone() };
    entries.iter().map(|(name, value)| ((*name).to_owned(), authored(value))).collect()
}

fn var(name: &str, source: &str, driver: &[(&str, Value)]) -> Var {
    Var {
        path: format!("/Render/{name}"),
        name: name.into(),
        source_name: source.into(),
        source_type: "raw".into(),
        data_type: "color3f".into(),
        driver: map(driver),
        abbe: BTreeMap::new(),
    }
}

fn planned(product: Product) -> Plan {
    let mut s = ball();
    s.document.settings.products.push(product);
    plan(&s.build(), &Request::default(), &Registry::default()).unwrap_or_else(|e| panic!("{e}")).remove(0)
}

fn kinds(diagnostics: &Diagnostics) -> Vec<&str> {
    diagnostics.warnings().iter().map(|w| w.kind.as_str()).collect()
}

/// Names, whether in half, and the kinds of warnings.
fn layers(vars: Vec<Var>) -> (Vec<(String, bool)>, Vec<String>) {
    let plan = planned(product(vars));
    let layers = plan.layers.iter().map(|layer| (layer.name.clone(), layer.half)).collect();
    (layers, kinds(&plan.diagnostics).into_iter().map(str::to_owned).collect())
}

#[test]
fn layers_are_called_as_their_variables_say() {
    let named = |driver: &[(&str, Value)]| layers(vec![var("Var", "dispersion", driver)]).0.remove(0).0;
    assert_eq!(named(&[]), "Var");
    assert_eq!(named(&[("name", json!("disp"))]), "disp");
    assert_eq!(named(&[("name", json!("disp")), ("channel_prefix", json!("glass."))]), "glass.disp");
    assert_eq!(named(&[("channel_prefix", json!("glass."))]), "glass.Var");
    // The same source twice is two layers; the same name twice is an error.
    let twice = vec![var("A", "depth", &[]), var("B", "depth", &[])];
    assert_eq!(layers(twice).0, [("A".to_owned(), false), ("B".to_owned(), false)]);
    let mut s = ball();
    s.document.settings.products.push(product(vec![var("A", "depth", &[]), var("B", "ior", &[("name", json!("A"))])]));
    let error = plan(&s.build(), &Request::default(), &Registry::default()).expect_err("one name for two");
    assert!(error.to_string().contains("/Render/B") && error.to_string().contains("'A'"), "{error}");
}

#[test]
fn types_are_as_asked_where_no_digit_is_lost_that_matters() {
    let half = |source: &str, data_type: &str, format: &str| {
        let mut var = var("Var", source, &[("format", json!(format))]);
        var.data_type = data_type.into();
        let (layers, warnings) = layers(vec![var]);
        (layers[0].1, warnings)
    };
    let plain = |is_half| (is_half, Vec::<String>::new());
    assert_eq!(half("normal", "normal3f", ""), plain(false));
    assert_eq!(half("normal", "normal3h", ""), plain(true));
    assert_eq!(half("normal", "color3f", "color3h"), plain(true));
    assert_eq!(half("normal", "half3", "float3"), plain(false));
    assert_eq!(half("normal", "half3", "auto"), plain(true));
    assert_eq!(half("position", "point3f", "point3f"), plain(false));
    for asked in ["half", "half2", "color3h", "float16"] {
        assert_eq!(half("dispersion", "float2", asked), (false, vec!["half-format".into()]), "{asked}");
    }
    assert_eq!(half("depth", "float", "int"), (false, vec!["int-format".into()]));
    assert_eq!(half("prim_id", "int", "int"), plain(false));
    assert_eq!(half("prim_id", "color3f", ""), plain(false));
    assert_eq!(half("prim_id", "int", "half"), (false, vec!["uint-format".into()]));
}

#[test]
fn what_a_variable_asks_for_in_vain_is_named() {
    let of_type = |source_type: &str, source: &str| {
        let mut asked = var("Var", source, &[]);
        asked.source_type = source_type.into();
        let mut product = product(vec![var("Depth", "depth", &[]), asked]);
        product.abbe = map(&[("abbe:integrator", json!("differentials"))]);
        let plan = planned(product);
        let message = plan.diagnostics.warnings().first().map(|w| w.message.clone());
        (plan.layers.get(1).map(|layer| layer.aov.name), message.unwrap_or_default())
    };
    assert_eq!(of_type("primvar", "st"), (Some("uv"), String::new()));
    assert_eq!(of_type("raw", "primvars:st"), (Some("uv"), String::new()));
    assert_eq!(of_type("intrinsic", "Ng"), (Some("normal_geometric"), String::new()));
    for (source_type, source, said) in [
        ("primvar", "displayColor", "the primvar 'displayColor'"),
        ("raw", "primvars:displayColor", "the primvar 'displayColor'"),
        ("lpe", "C<RD>L", "needs light transport"),
        ("raw", "lpe:C<RD>L", "needs light transport"),
        ("lpe", "C.*", "'differentials' has no"),
        ("raw", "Ci", "'differentials' has no 'Ci'"),
        ("raw", "nothing", "`abbe aovs` lists"),
    ] {
        let (layer, message) = of_type(source_type, source);
        assert!(layer.is_none() && message.contains(said), "{source_type} {source}: {message}");
    }
    let parameters = |driver: &[(&str, Value)], source: &str| layers(vec![var("Var", source, driver)]).1;
    // What Solaris authors on every variable has no effect anywhere.
    assert!(parameters(&[("clearValue", json!(0)), ("multiSampled", json!(false))], "prim_id").is_empty());
    assert_eq!(parameters(&[("clearValue", json!(1))], "depth"), ["unused-aov-parameter"]);
    assert_eq!(parameters(&[("multiSampled", json!(true))], "prim_id"), ["unused-aov-parameter"]);
    assert_eq!(parameters(&[("filter", json!("gaussian"))], "depth"), ["unused-aov-parameter"]);
}

#[test]
fn the_driver_decides_compression_and_writes_into_the_header() {
    let mut wanted = product(vec![]);
    wanted.driver = map(&[
        ("OpenEXR:compression", json!("zips")),
        ("artist", json!("us")),
        ("comment", json!("a ball")),
        ("OpenEXR:hostname", json!("here")),
        ("OpenEXR:shot", json!("010")),
        ("OpenEXR:take", json!(3)),
        ("OpenEXR:isoSpeed", json!(400)),
        ("OpenEXR:lift", json!([0.5, 0.25])),
        ("OpenEXR:abbe:version", json!("99")),
    ]);
    let mut s = ball();
    s.document.settings.products.push(wanted);
    let image = rendered(&s.build(), &Request::default());
    assert_eq!(image.metadata.compression, "zips");
    let text = |text: &str| Some(Attribute::Text(text.into()));
    for (name, value) in [
        ("artist", text("us")),
        ("comments", text("a ball")),
        ("hostname", text("here")),
        ("shot", text("010")),
        ("take", Some(Attribute::Int(3))),
        ("isoSpeed", Some(Attribute::Float(400.0))),
        ("lift", Some(Attribute::Vec2([0.5, 0.25]))),
        // Ours is true.
        ("abbe:version", text(env!("CARGO_PKG_VERSION"))),
    ] {
        assert_eq!(image.metadata.get(name), value.as_ref(), "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    abbe::exr::write(&folder.path().join("out.exr"), &image.film, &image.metadata).unwrap();
    for (name, value, kind) in [
        ("compression", json!("dwaa"), "compression"),
        ("OpenEXR:dataWindow", json!("all"), "header-attribute"),
        ("OpenEXR:owner", json!(3), "header-attribute"),
        ("asrgba", json!(1), "unused-driver-parameter"),
    ] {
        let mut wanted = product(vec![]);
        wanted.driver = map(&[(name, value)]);
        assert_eq!(kinds(&planned(wanted).diagnostics), [kind], "{name}");
    }
    let deep = Product { product_type: "deepRaster".into(), ..product(vec![]) };
    assert_eq!(kinds(&planned(deep).diagnostics), ["product-type"]);
}

#[test]
fn a_pixel_is_in_the_data_window_when_its_centre_is() {
    let window = |ndc: [f64; 4]| planned(Product { data_window_ndc: ndc, ..product(vec![]) }).window;
    // 40 × 20 pixels, y up in NDC and down in the raster.
    for (ndc, [x0, y0, x1, y1]) in [
        ([0.0, 0.0, 1.0, 1.0], [0, 0, 40, 20]),
        ([0.25, 0.0, 0.75, 0.5], [10, 10, 30, 20]),
        ([-0.1, -0.05, 1.1, 1.25], [-4, -5, 44, 21]),
        // A pixel's centre at 0.5/40 is inside from there on, and the one at 39.5/40 is not inside before it.
        ([0.0125, 0.0, 0.9875, 1.0], [0, 0, 39, 20]),
        ([0.0126, 0.0, 0.9876, 1.0], [1, 0, 40, 20]),
    ] {
        assert_eq!(window(ndc), Window { x0, y0, x1, y1 }, "{ndc:?}");
    }
    // Decimals are meant as written: f32's 0.3 of 5 pixels are 1.5, as 0.3 · 5 is.
    let five = Product { resolution: Some([5, 5]), ..product(vec![]) };
    let narrow = planned(Product { data_window_ndc: [f64::from(0.3f32), 0.0, 1.0, 1.0], ..five });
    assert_eq!(narrow.window.x0, 1);
}

#[test]
fn the_header_has_the_lens_in_the_units_of_openexr() {
    let mut s = ball();
    let camera = &mut s.document.cameras[0];
    // 35 tenths of a centimetre at f/2.8, focused at 6 m, open for half a frame.
    (camera.f_stop, camera.focus_distance, camera.shutter_open, camera.shutter_close) = (2.8, 600.0, -0.25, 0.25);
    let image = rendered(&s.build(), &support::request(8, 8, &["depth"]));
    let float = |name: &str| match image.metadata.get(name) {
        Some(Attribute::Float(value)) => *value,
        other => panic!("{name}: {other:?}"),
    };
    let near = |name: &str, value: f32| assert!((float(name) - value).abs() < 1e-5 * value, "{name}: {}", float(name));
    near("aperture", 2.8);
    near("focus", 6.0);
    near("nominalFocalLength", 35.0);
    near("expTime", 0.5 / 24.0);
    near("shutterAngle", 180.0);
    // Nothing is said of what nobody authored.
    let plain = rendered(&ball().build(), &support::request(8, 8, &["depth"]));
    for name in ["aperture", "focus", "expTime", "shutterAngle", "isoSpeed", "abbe:exposureScale"] {
        assert_eq!(plain.metadata.get(name), None, "{name}");
    }
    let mut s = ball();
    s.document.cameras[0].exposure = Some(Exposure { stops: Some(1.0), iso: Some(200.0), ..Exposure::default() });
    let image = rendered(&s.build(), &support::request(8, 8, &["depth"]));
    assert_eq!(image.metadata.get("abbe:exposureScale"), Some(&Attribute::Double(4.0)));
    assert_eq!(image.metadata.get("isoSpeed"), Some(&Attribute::Float(200.0)));
}

#[test]
#[allow(clippy::float_cmp, reason = "powers of two and quotients that are exact")]
fn exposure_is_that_of_a_photographer() {
    let scale = linear_exposure_scale;
    assert_eq!(scale(&Exposure::default()), 1.0);
    let f4 = Exposure { time: Some(0.5), f_stop: Some(4.0), iso: Some(400.0), ..Exposure::default() };
    assert_eq!(scale(&f4), 0.5 * 4.0 / 16.0);
    assert_eq!(scale(&Exposure { stops: Some(-1.0), responsivity: Some(3.0), ..f4 }), 0.125 * 0.5 * 3.0);
}
