//! Renders at wavelengths for which a glass was never measured: refused, held or extrapolated, as it is authored.

mod support;

use abbe::integrator::Registry;
use abbe::render::{Request, plan};
use abbe::scene::Scene;
use glam::{DMat4, DVec3};
use serde_json::json;
use support::{Stagehand, authored, floats, rendered, request};

/// A ball of a glass that is known from 480 to 620 nm, before a wall.
fn ball(out_of_range: &str) -> Scene {
    let mut s = Stagehand::new();
    let glass = s.authored_glass(
        "/World/Glass",
        &[
            ("abbe:dispersion:cauchy", authored("double[]", json!([1.5, 0.004]))),
            ("abbe:dispersion:validRange", authored("double2", json!([480.0, 620.0]))),
            ("abbe:dispersion:outOfRange", authored("token", json!(out_of_range))),
        ],
    );
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 40.0, Some(grey));
    s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::new(0.1, -0.05, 0.0)), Some(glass));
    // The same glass again: what is said of it is said once.
    s.sphere("/World/Other", 1.0, DMat4::from_translation(DVec3::new(2.5, -0.05, 0.0)), Some(glass));
    s.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO);
    s.build()
}

fn at(wavelength: f64, aovs: &[&str]) -> Request {
    Request { wavelength: Some(wavelength), ..request(16, 12, aovs) }
}

fn refused(scene: &Scene, request: &Request) -> String {
    plan(scene, request, &Registry::default()).expect_err("is refused").to_string()
}

fn planned(scene: &Scene, request: &Request) {
    plan(scene, request, &Registry::default()).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_reference_wavelength_outside_of_the_valid_range_is_refused() {
    for out_of_range in ["clamp", "error"] {
        let scene = ball(out_of_range);
        for wavelength in [450.0, 479.999, 620.001, 700.0] {
            let text = refused(&scene, &at(wavelength, &["dispersion"]));
            assert!(text.starts_with("</World/Glass>: its index is valid from 480 to 620 nm"), "{text}");
            assert!(text.contains(&format!("the reference wavelength is at {wavelength} nm")), "{text}");
            assert!(text.contains("abbe:referenceWavelength") && text.contains("extrapolate"), "{text}");
        }
        for wavelength in [480.0, 587.5618, 620.0] {
            planned(&scene, &at(wavelength, &["dispersion"]));
        }
        // What is not followed into the glass does not ask for its index.
        planned(&scene, &at(700.0, &["depth", "normal"]));
    }
    planned(&ball("extrapolate"), &at(700.0, &["dispersion", "dispersion_footprint", "dispersion_r"]));
}

#[test]
fn a_glass_that_must_not_be_used_outside_is_asked_about_every_wavelength_in_use() {
    let strict = ball("error");
    planned(&strict, &at(550.0, &["dispersion", "ior"]));
    let text = refused(&strict, &at(550.0, &["dispersion_footprint"]));
    assert!(text.contains("the band is at 400 nm") && text.contains("abbe:band"), "{text}");
    planned(&strict, &Request { band: Some([480.0, 620.0]), ..at(550.0, &["dispersion_footprint"]) });
    let text = refused(&strict, &at(550.0, &["dispersion_b"]));
    assert!(text.contains("the colour channel is at") && text.contains("abbe:channelWavelengths"), "{text}");
    planned(&ball("clamp"), &at(550.0, &["dispersion_footprint", "dispersion_b"]));
}

#[test]
fn a_clamped_glass_is_told_of_once_and_has_no_dispersion_at_the_wavelengths_outside() {
    let scene = ball("clamp");
    let warnings = scene.diagnostics().warnings();
    let told: Vec<_> = warnings.iter().filter(|warning| warning.kind == "clamped-index").collect();
    assert!(told.len() == 1 && told[0].count == 1, "{warnings:?}");
    assert_eq!(told[0].places, ["</World/Glass>.abbe:dispersion:cauchy"]);
    // At the ends of the range the derivatives are the law's, as within.
    for wavelength in [480.0, 620.0] {
        let film = rendered(&scene, &at(wavelength, &["dior_dlambda"])).film;
        let (values, valid) = floats(&film, "dior_dlambda");
        let slope = -2.0 * 0.004 * 1e6 / f64::powi(wavelength, 3);
        let mut seen = 0;
        for (value, _) in values.iter().zip(valid).filter(|(_, valid)| **valid > 0.0) {
            seen += 1;
            assert!((f64::from(*value) / slope - 1.0).abs() < 1e-6, "{value} is not {slope}");
        }
        assert!(seen > 0);
    }
}
