//! Material form × values → kind, law, absorption and priority.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::*;
use crate::spectrum::lines;

/// What a form must come out as. V_d is 0 for no dispersion, and then n is n_d everywhere.
struct Expected {
    nd: f64,
    vd: f64,
    /// n(λ) = a + b/λ², λ in µm.
    a: f64,
    b: f64,
    n_f: f64,
    n_c: f64,
}

const fn constant(nd: f64) -> Expected {
    Expected { nd, vd: 0.0, a: nd, b: 0.0, n_f: nd, n_c: nd }
}

/// B = (n_d − 1)/(V_d (λ_F⁻² − λ_C⁻²)) with λ_F = 0.4861327 µm, λ_C = 0.6562725 µm, so λ_F⁻² − λ_C⁻² = 1.90962468… µm⁻²;
/// A = n_d − B/λ_d² with λ_d = 0.5875618 µm. All worked out with 30 digits and printed with 16.
#[test]
fn every_form_gives_the_law_of_its_specification() {
    let cauchy = |nd, vd, a, b, n_f, n_c| Expected { nd, vd, a, b, n_f, n_c };
    let open_pbr = "ND_open_pbr_surface_surfaceshader";
    let standard = "ND_standard_surface_surfaceshader";
    let gltf = "ND_gltf_pbr_surfaceshader";
    let rows: Vec<(&str, Value, Expected)> = vec![
        ("UsdPreviewSurface", json!({"opacity": 0.0}), constant(1.5)),
        ("ND_UsdPreviewSurface_surfaceshader", json!({"opacity": 0.0, "ior": 1.33}), constant(1.33)),
        // Scale 0: off, whatever the Abbe number.
        (open_pbr, json!({"transmission_weight": 1.0, "transmission_dispersion_abbe_number": 30.0}), constant(1.5)),
        // V_d = 32/0.5.
        (
            open_pbr,
            json!({"transmission_weight": 1.0, "specular_ior": 1.52, "transmission_dispersion_scale": 0.5,
                   "transmission_dispersion_abbe_number": 32.0}),
            cauchy(1.52, 64.0, 1.507675529831037, 0.004254762895227518, 1.525679392558436, 1.517554392558436),
        ),
        // The definition's 20 and 1.5.
        (
            "arnold:openpbr_surface",
            json!({"transmission_weight": 1.0, "transmission_dispersion_scale": 1.0}),
            cauchy(1.5, 20.0, 1.462078553326268, 0.01309157813916159, 1.517475054025957, 1.492475054025957),
        ),
        // F0 = (0.5/2.5)² = 0.04; ε = √(0.25·0.04) = 0.1; n_d = 1.1/0.9.
        (
            open_pbr,
            json!({"transmission_weight": 1.0, "specular_weight": 0.25, "transmission_dispersion_scale": 1.0,
                   "transmission_dispersion_abbe_number": 64.0}),
            cauchy(1.1 / 0.9, 64.0, 1.216955354628648, 0.001818274741550221, 1.224649313059161, 1.221177090836938),
        ),
        (standard, json!({"transmission": 1.0}), constant(1.5)),
        (
            "ND_standard_surface_surfaceshader_100",
            json!({"transmission": 1.0, "specular_IOR": 1.6, "transmission_dispersion": 30.0}),
            cauchy(1.6, 30.0, 1.569662842661014, 0.01047326251132928, 1.613980043220766, 1.593980043220766),
        ),
        (
            "arnold:standard_surface",
            json!({"transmission": 1.0, "transmission_dispersion": 40.0}),
            cauchy(1.5, 40.0, 1.481039276663134, 0.006545789069580797, 1.508737527012978, 1.496237527012978),
        ),
        (gltf, json!({"transmission": 1.0, "metallic": 0.0, "thickness": 1.0}), constant(1.5)),
        // V_d = 20/0.5 and, above 1, 20/2.
        (
            gltf,
            json!({"transmission": 1.0, "metallic": 0.0, "thickness": 1.0, "ior": 1.45, "dispersion": 0.5}),
            cauchy(1.45, 40.0, 1.432935348996821, 0.005891210162622718, 1.457863774311681, 1.446613774311681),
        ),
        (
            gltf,
            json!({"transmission": 1.0, "metallic": 0.0, "thickness": 1.0, "dispersion": 2.0}),
            cauchy(1.5, 10.0, 1.424157106652536, 0.02618315627832319, 1.534950108051914, 1.484950108051914),
        ),
        // An Abbe number without the switch is none.
        ("DwaRefractiveMaterial", json!({"dispersion_abbe_number": 20.0}), constant(1.5)),
        (
            "DwaRefractiveMaterial",
            json!({"use_dispersion": true}),
            cauchy(1.5, 34.0, 1.477693266662511, 0.007700928317153879, 1.510279443544681, 1.495573561191739),
        ),
        ("DwaRefractiveMaterial", json!({"use_dispersion": true, "dispersion_abbe_number": 0.0}), constant(1.5)),
        (
            "DwaBaseMaterial",
            json!({"transmission": 1.0, "refractive_index": 1.5, "use_dispersion": true, "dispersion_abbe_number": 25.0,
                   "use_independent_transmission_refractive_index": true,
                   "independent_transmission_refractive_index": 1.2}),
            cauchy(1.2, 25.0, 1.187865137064406, 0.00418930500453171, 1.205592017288306, 1.197592017288306),
        ),
        ("OmniGlass", json!({}), constant(1.491)),
        ("OmniGlass_Opacity", json!({"glass_ior": 1.52}), constant(1.52)),
        (
            "OmniSurface",
            json!({"enable_specular_transmission": true, "specular_transmission_weight": 1.0}),
            constant(1.5),
        ),
        (
            "OmniSurfaceBase",
            json!({"enable_specular_transmission": true, "specular_transmission_weight": 1.0,
                   "specular_reflection_ior_preset": "ior_diamond", "specular_reflection_ior": 1.3,
                   "specular_transmission_dispersion_abbe": 55.0}),
            cauchy(2.42, 55.0, 2.380837487798764, 0.01352002978735234, 2.438046964884988, 2.412228783066806),
        ),
        // The enumerations of MDL are integers in USD: 24 is ior_water_0c, 99 the input's own.
        (
            "OmniSurface",
            json!({"enable_specular_transmission": true, "specular_transmission_weight": 1.0,
                   "specular_reflection_ior_preset": 24}),
            constant(1.333),
        ),
        (
            "OmniSurface",
            json!({"enable_specular_transmission": true, "specular_transmission_weight": 1.0,
                   "specular_reflection_ior_preset": 99, "specular_reflection_ior": 1.3}),
            constant(1.3),
        ),
        ("thick_glass_v2", json!({}), constant(1.4)),
        (
            "thick_glass",
            json!({"abbe_number": 45.0}),
            cauchy(1.4, 45.0, 1.386516818960451, 0.004654783338368567, 1.406213352542562, 1.397324463653674),
        ),
        ("thin_glass_v2", json!({}), constant(1.4)),
        ("vray:BRDFVRayMtl", json!({"refract": [1.0, 1.0, 1.0], "dispersion": 20.0}), constant(1.6)),
        (
            "BRDFVRayMtl",
            json!({"refract": 1.0, "dispersion_on": 1}),
            cauchy(1.6, 50.0, 1.581797705596609, 0.006283957506797565, 1.608388025932459, 1.596388025932459),
        ),
        (
            "vray:BRDFVRayMtl",
            json!({"refract": 1.0, "refract_ior": 1.7, "dispersion_on": true, "dispersion": 20.0}),
            cauchy(1.7, 20.0, 1.646909974656775, 0.01832820939482623, 1.72446507563634, 1.68946507563634),
        ),
        ("ND_disney_principled", json!({"specTrans": 1.0, "ior": 1.7}), constant(1.7)),
        // √0.04 = 0.2: 1.2/0.8; √0.0625 = 0.25: 1.25/0.75.
        ("LamaDielectric", json!({}), constant(1.5)),
        ("ND_lama_dielectric", json!({"reflectivity": 0.0625, "IOR": 1.3}), constant(1.25 / 0.75)),
        ("ND_lama_dielectric", json!({"fresnelMode": 1, "IOR": 1.77}), constant(1.77)),
        ("PxrSurface", json!({"refractionGain": 1.0, "glassIor": 1.55}), constant(1.55)),
        ("AbbeGlass", json!({"abbe_number": 0.0}), constant(1.5168)),
        (
            "AbbeGlass",
            json!({}),
            cauchy(1.5168, 64.17, 1.504583821947337, 0.004217377330415279, 1.522429489119909, 1.51437588151511),
        ),
    ];
    // The expected numbers have 16 digits, and the law is a sum of two terms near 1.
    let same = |what: &str, row: &str, is: f64, expected: f64| {
        let error = (is - expected).abs() / expected.abs().max(1.0);
        assert!(error <= 8.0 * f64::EPSILON, "{row}: {what} is {is}, not {expected}");
    };
    let mut seen = BTreeSet::new();
    for (id, values, expected) in rows {
        seen.insert(id);
        let row = format!("{id} {values}");
        let (material, diagnostics) = compiled(id, &values);
        assert_eq!(kinds_of(&diagnostics), [""; 0], "{row}");
        let Kind::Dielectric { dispersion, .. } = material.kind else { panic!("{row}: {}", material.chosen) };
        let n = |wavelength| dispersion.at(wavelength).ior;
        same("n_d", &row, n(lines::D), expected.nd);
        same("n_F", &row, n(lines::F), expected.n_f);
        same("n_C", &row, n(lines::C), expected.n_c);
        // Away from the three lines the form of the law counts.
        let blue = crate::spectrum::Wavelength::from_nanometers(420.0);
        same("n(420 nm)", &row, n(blue), expected.a + expected.b / 0.42_f64.powi(2));
        assert_eq!(dispersion.is_constant(), expected.vd == 0.0, "{row}");
        match dispersion.abbe_number() {
            // The difference n_F − n_C has lost about two digits.
            Some(vd) => assert!((vd / expected.vd - 1.0).abs() < 1e-12, "{row}: V_d is {vd}"),
            None => assert!(expected.vd == 0.0, "{row}"),
        }
    }
    let ids: BTreeSet<_> = DIALECTS.iter().flat_map(|dialect| dialect.ids()).copied().collect();
    let missing: Vec<_> = ids.difference(&seen).filter(|id| **id != "thin_glass").collect();
    assert!(missing.is_empty(), "no row for {missing:?}");
}

#[test]
fn every_form_is_of_the_right_kind() {
    let open_pbr = "ND_open_pbr_surface_surfaceshader";
    let standard = "ND_standard_surface_surfaceshader";
    let gltf = "ND_gltf_pbr_surfaceshader";
    let rows: Vec<(&str, Value, &str)> = vec![
        // What a shader without inputs is.
        ("UsdPreviewSurface", json!({}), "opaque"),
        (open_pbr, json!({}), "opaque"),
        (standard, json!({}), "opaque"),
        // A metal with a roughness of 1.
        (gltf, json!({}), "opaque"),
        ("DwaRefractiveMaterial", json!({}), "rough glass"),
        ("DwaBaseMaterial", json!({}), "opaque"),
        ("OmniGlass", json!({}), "glass"),
        ("OmniSurface", json!({}), "opaque"),
        ("thick_glass_v2", json!({}), "glass"),
        ("thin_glass_v2", json!({}), "thin glass"),
        ("BRDFVRayMtl", json!({}), "opaque"),
        ("ND_disney_principled", json!({}), "opaque"),
        ("LamaDielectric", json!({}), "rough glass"),
        ("PxrSurface", json!({}), "opaque"),
        ("AbbeGlass", json!({}), "glass"),
        // Weights.
        (open_pbr, json!({"transmission_weight": 0.5, "specular_roughness": 0.03}), "glass"),
        (open_pbr, json!({"transmission_weight": 0.49}), "opaque"),
        (open_pbr, json!({"transmission_weight": 1.0, "geometry_thin_walled": true}), "thin rough glass"),
        (open_pbr, json!({"transmission_weight": 1.0, "geometry_opacity": 0.4}), "cut out"),
        (open_pbr, json!({"base_metalness": 1.0, "specular_roughness": 0.0}), "mirror"),
        (standard, json!({"transmission": 1.0, "specular_roughness": 0.0}), "glass"),
        (
            standard,
            json!({"transmission": 1.0, "specular_roughness": 0.0, "transmission_extra_roughness": 0.1}),
            "rough glass",
        ),
        (
            standard,
            json!({"transmission": 1.0, "specular_roughness": 0.1, "transmission_extra_roughness": -0.1}),
            "glass",
        ),
        (standard, json!({"opacity": [0.0, 0.2, 0.1]}), "cut out"),
        (standard, json!({"metalness": 1.0, "specular_roughness": 0.01}), "mirror"),
        (standard, json!({"metalness": 1.0}), "opaque"),
        (gltf, json!({"transmission": 1.0, "metallic": 0.0, "roughness": 0.0}), "thin glass"),
        (gltf, json!({"transmission": 1.0, "metallic": 0.0, "roughness": 0.0, "thickness": 0.1}), "glass"),
        (gltf, json!({"metallic": 1.0, "roughness": 0.0}), "mirror"),
        (gltf, json!({"alpha": 0.2, "metallic": 0.0}), "opaque"),
        (gltf, json!({"alpha": 0.2, "alpha_mode": 1}), "cut out"),
        (gltf, json!({"alpha": 0.2, "alpha_mode": 1, "alpha_cutoff": 0.1, "metallic": 0.0}), "opaque"),
        (gltf, json!({"alpha": 0.2, "alpha_mode": "BLEND"}), "cut out"),
        ("DwaRefractiveMaterial", json!({"roughness": 0.0}), "glass"),
        (
            "DwaRefractiveMaterial",
            json!({"roughness": 0.0, "use_independent_transmission_roughness": true}),
            "rough glass",
        ),
        ("DwaRefractiveMaterial", json!({"roughness": 0.0, "thin_geometry": true}), "thin glass"),
        ("DwaRefractiveMaterial", json!({"presence": 0.0}), "cut out"),
        ("DwaRefractiveMaterial", json!({"show_transmission": false}), "opaque"),
        ("DwaBaseMaterial", json!({"transmission": 1.0, "roughness": 0.0}), "glass"),
        ("DwaBaseMaterial", json!({"transmission": 1.0, "show_transmission": false}), "opaque"),
        ("DwaBaseMaterial", json!({"metallic": 1.0, "roughness": 0.0}), "mirror"),
        ("OmniGlass", json!({"frosting_roughness": 0.2}), "rough glass"),
        ("OmniGlass", json!({"thin_walled": true}), "thin glass"),
        ("OmniGlass", json!({"cutout_opacity": 0.2}), "thin glass"),
        ("OmniGlass", json!({"cutout_opacity": 0.2, "enable_opacity": true}), "cut out"),
        ("OmniGlass", json!({"cutout_opacity": 0.2, "enable_opacity": true, "opacity_threshold": 0.1}), "thin glass"),
        ("OmniSurface", json!({"specular_transmission_weight": 0.2, "enable_specular_transmission": true}), "opaque"),
        (
            "OmniSurface",
            json!({"specular_transmission_weight": 1.0, "enable_specular_transmission": true, "thin_walled": true,
                   "specular_reflection_roughness": 0.0}),
            "thin glass",
        ),
        ("OmniSurface", json!({"metalness": 1.0, "specular_reflection_roughness": 0.0}), "mirror"),
        ("OmniSurface", json!({"geometry_opacity": 0.1}), "opaque"),
        ("OmniSurface", json!({"geometry_opacity": 0.1, "enable_opacity": true}), "cut out"),
        ("thick_glass_v2", json!({"roughness": 0.1}), "rough glass"),
        ("BRDFVRayMtl", json!({"refract": [0.9, 0.9, 0.9]}), "glass"),
        ("BRDFVRayMtl", json!({"refract": [0.9, 0.9, 0.9], "refract_glossiness": 0.9}), "rough glass"),
        ("BRDFVRayMtl", json!({"refract": 1.0, "refract_glossiness": 0.0, "option_use_roughness": true}), "glass"),
        ("BRDFVRayMtl", json!({"refract": 1.0, "refract_thin_walled": true}), "thin glass"),
        ("BRDFVRayMtl", json!({"refract": 1.0, "opacity": 0.0}), "cut out"),
        ("BRDFVRayMtl", json!({"metalness": 1.0}), "mirror"),
        // The transmission lobe is smooth whatever the roughness; the metal is not.
        ("ND_disney_principled", json!({"specTrans": 1.0, "roughness": 0.9}), "glass"),
        ("ND_disney_principled", json!({"metallic": 1.0}), "opaque"),
        ("ND_disney_principled", json!({"metallic": 1.0, "roughness": 0.0}), "mirror"),
        ("LamaDielectric", json!({"roughness": 0.0}), "glass"),
        ("PxrSurface", json!({"refractionGain": 1.0}), "rough glass"),
        ("PxrSurface", json!({"refractionGain": 1.0, "glassRoughness": 0.0}), "glass"),
        (
            "PxrSurface",
            json!({"refractionGain": 1.0, "glassRoughness": 0.0, "glassRefractionRoughness": 0.2}),
            "rough glass",
        ),
        ("PxrSurface", json!({"refractionGain": 1.0, "glassRefractionRoughness": 0.0, "thinGlass": 1}), "thin glass"),
        ("PxrSurface", json!({"refractionGain": 1.0, "presence": 0.0}), "cut out"),
        ("AbbeGlass", json!({"roughness": 0.2, "thin_walled": true}), "thin rough glass"),
    ];
    for (id, values, expected) in rows {
        let (material, diagnostics) = compiled(id, &values);
        assert_eq!(word(&material.kind), expected, "{id} {values}: {}", material.chosen);
        assert_eq!(kinds_of(&diagnostics), [""; 0], "{id} {values}");
    }
}

#[test]
fn absorption_is_a_colour_over_a_distance_in_stage_units() {
    let open_pbr = "ND_open_pbr_surface_surfaceshader";
    let gltf = "ND_gltf_pbr_surfaceshader";
    let red = [0.9, 0.5, 0.1];
    let grey = [(-1.0_f64).exp(); 3];
    // Transmittances after a distance, at a hundredth of a metre per unit.
    // The colour and its distance.
    type Absorbed = Option<([f64; 3], f64)>;
    let rows: Vec<(&str, Value, Absorbed)> = vec![
        ("UsdPreviewSurface", json!({"opacity": 0.0}), None),
        // Without a depth the colour tints the surface, and white absorbs nothing.
        (open_pbr, json!({"transmission_color": red}), None),
        (open_pbr, json!({"transmission_depth": 2.0}), None),
        (open_pbr, json!({"transmission_color": red, "transmission_depth": 2.0}), Some((red, 2.0))),
        ("arnold:standard_surface", json!({"transmission_color": red}), None),
        ("arnold:standard_surface", json!({"transmission_color": red, "transmission_depth": 0.5}), Some((red, 0.5))),
        (gltf, json!({"attenuation_color": red}), None),
        (gltf, json!({"attenuation_color": red, "attenuation_distance": 3.0}), Some((red, 3.0))),
        ("DwaRefractiveMaterial", json!({"transmission_color": red}), None),
        // σ = depth per metre: 1/e after 1/0.001 m = 100 000 cm; the colour is the surface's.
        ("OmniGlass", json!({"glass_color": red}), Some((grey, 1e5))),
        ("OmniGlass", json!({"depth": 0.0}), None),
        ("OmniGlass", json!({"depth": 2.0}), Some((grey, 50.0))),
        ("OmniSurface", json!({"specular_transmission_color": red}), None),
        (
            "OmniSurface",
            json!({"specular_transmission_color": red, "specular_transmission_scattering_depth": 4.0}),
            Some((red, 4.0)),
        ),
        // 0.95 after 0.1 m.
        ("thick_glass_v2", json!({}), Some(([0.95; 3], 10.0))),
        ("thick_glass_v2", json!({"glass_color": red, "base_thickness": 0.02}), Some((red, 2.0))),
        ("thick_glass_v2", json!({"base_thickness": 0.0}), None),
        ("thin_glass_v2", json!({"glass_color": red}), None),
        // 1/fog_mult centimetres, here stage units.
        ("BRDFVRayMtl", json!({"fog_color": red, "fog_mult": 0.25}), Some((red, 4.0))),
        ("BRDFVRayMtl", json!({"fog_color": red, "fog_mult": 0.25, "fog_depth": 2.0}), Some((red, 8.0))),
        ("BRDFVRayMtl", json!({"fog_color": red, "fog_mult": 0.0}), None),
        ("ND_disney_principled", json!({"baseColor": red}), None),
        ("LamaDielectric", json!({"absorptionColor": red, "absorptionRadius": 5.0}), Some((red, 5.0))),
        ("LamaDielectric", json!({"absorptionRadius": 5.0}), None),
        ("AbbeGlass", json!({"transmission_color": red, "transmission_depth": 2.0}), Some((red, 2.0))),
        ("AbbeGlass", json!({"transmission_color": red}), None),
    ];
    let found = |id: &str, values: &Value, context: &Context| {
        let shader = shader(id, values);
        let surface = Terminal::of(&shader).unwrap_or_else(|| panic!("{id} is understood"));
        surface
            .attenuation(context, &mut Diagnostics::default())
            .unwrap_or_else(|error| panic!("{id} {values}: {error}"))
    };
    for (id, values, expected) in rows {
        let is = found(id, &values, &CENTIMETERS);
        match (&is, expected) {
            (None, None) => {}
            (Some(is), Some((color, distance))) => {
                let same = |a: f64, b: f64| (a / b - 1.0).abs() <= 4.0 * f64::EPSILON;
                assert!(
                    is.color.iter().zip(color).all(|(a, b)| same(*a, b)) && same(is.distance, distance),
                    "{id} {values}: {is:?}"
                );
            }
            _ => panic!("{id} {values}: {is:?}"),
        }
    }
    // V-Ray's unit scale off, and metres as units: distances that are physical follow the stage's unit, others do not.
    let meters = Context { meters_per_unit: 1.0, ..CENTIMETERS };
    let distance = |id: &str, values: Value| found(id, &values, &meters).expect("absorbs").distance;
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() <= 4.0 * f64::EPSILON, "{a} is not {b}");
    close(distance("BRDFVRayMtl", json!({"fog_color": red, "fog_mult": 0.25})), 0.04);
    close(distance("BRDFVRayMtl", json!({"fog_color": red, "fog_mult": 0.25, "fog_unit_scale_on": false})), 4.0);
    close(distance("thick_glass_v2", json!({})), 0.1);
    close(distance("OmniGlass", json!({})), 1000.0);
    close(distance(open_pbr, json!({"transmission_color": red, "transmission_depth": 2.0})), 2.0);
    // Where OmniSurface scatters, its extinction is −ln(color/(1 + scattering))/depth.
    let scattering = json!({"specular_transmission_color": [0.9, 0.9, 0.9], "specular_transmission_scattering_depth": 4.0,
                            "specular_transmission_scattering_color": [0.5, 0.2, 0.2]});
    close(found("OmniSurface", &scattering, &meters).expect("absorbs").color[0], 0.6);
}

#[test]
fn priorities_keep_their_meaning() {
    let rows = [
        ("arnold:standard_surface", json!({"transmission": 1.0, "dielectric_priority": 3}), Priority::higher_wins(3)),
        (
            "arnold:openpbr_surface",
            json!({"transmission_weight": 1.0, "dielectric_priority": -1}),
            Priority::higher_wins(-1),
        ),
        // The MaterialX nodes of the same models have no such input.
        ("ND_standard_surface_surfaceshader", json!({"transmission": 1.0, "dielectric_priority": 3}), Priority::UNSET),
        ("DwaRefractiveMaterial", json!({"priority": 3}), Priority::lower_wins(3)),
        ("DwaRefractiveMaterial", json!({"priority": 0}), Priority::UNSET),
        ("DwaBaseMaterial", json!({"transmission": 1.0, "priority": 1}), Priority::lower_wins(1)),
        ("AbbeGlass", json!({}), Priority::UNSET),
    ];
    for (id, values, expected) in rows {
        let (material, _) = compiled(id, &values);
        let Kind::Dielectric { priority, .. } = material.kind else { panic!("{id}: {}", material.chosen) };
        assert_eq!(priority, expected, "{id} {values}");
    }
}
