//! How the inside of a glass absorbs: by what is measured of it, or by the colour that its shader gives it at a depth.
//!
//! First match wins: our `abbe:extinction:table` and `abbe:internalTransmittance:table`, and k(λ) of the glass that
//! `abbe:glass` names, which are physical lengths; then what the shader states, whose depth is in stage units.

use super::Context;
use super::dialect::Terminal;
use super::law::{Authored, StatedAbsorption};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::{Absorption, Extinction};

/// The absorption of a transmissive surface's inside with where it comes from; `None` where it is clear.
pub(super) fn absorption(
    surface: &Terminal<'_>,
    authored: &Authored<'_>,
    thin_walled: bool,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<Option<(Absorption, String)>> {
    if thin_walled {
        if let Some(place) = authored.absorption_place() {
            let message = "a thin wall has no inside that could absorb: author a closed, thick glass";
            diagnostics.warn("idle-absorption", place, message);
        }
        return Ok(None);
    }
    if let Some(stated) = authored.absorption(diagnostics)? {
        if let Some(silenced) = surface.attenuation(context, diagnostics)? {
            let message = format!("{} says how the glass absorbs, and this colour has no effect", stated.place());
            diagnostics.warn("several-absorptions", silenced.place, message);
        }
        return of_table(&stated, context).map(Some);
    }
    let Some(stated) = surface.attenuation(context, diagnostics)? else { return Ok(None) };
    let absorption =
        Absorption::from_color(stated.color, stated.distance).map_err(|e| Error::scene(&stated.place, e))?;
    Ok(Some((absorption, stated.place)))
}

fn of_table(stated: &StatedAbsorption, context: &Context) -> Result<(Absorption, String)> {
    let absorption = match stated {
        StatedAbsorption::Extinction { entries, .. } => Extinction::table(entries)
            .map(|extinction| Absorption::from_extinction(&extinction, context.meters_per_unit)),
        StatedAbsorption::InternalTransmittance { entries, thickness_mm, .. } => {
            Absorption::from_internal_transmittance(entries, *thickness_mm, context.meters_per_unit)
        }
    };
    let absorption = absorption.map_err(|problem| Error::scene(stated.place(), problem))?;
    Ok((absorption, stated.place().to_owned()))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::{Kind, Material, ScalarIor, compile_alone};
    use super::*;
    use crate::spectrum::{REFERENCE, lines};

    fn compiled(abbe: &Value, inputs: &Value, meters_per_unit: f64) -> Result<(Material, Diagnostics)> {
        let mut all = json!({
            "transmission_weight": {"type": "float", "value": 1.0},
            "specular_roughness": {"type": "float", "value": 0.0},
        });
        all.as_object_mut().expect("a map").extend(inputs.as_object().expect("a map").clone());
        let material = json!({
            "path": "/M",
            "abbe": abbe,
            "surface": {
                "path": "/M/S",
                "id": "ND_open_pbr_surface_surfaceshader",
                "terminal": "outputs:surface",
                "inputs": all,
            },
        });
        let material = serde_json::from_value(material).expect("the test's document follows the schema");
        let mut diagnostics = Diagnostics::default();
        let context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit };
        compile_alone(&material, &context, &mut diagnostics).map(|material| (material, diagnostics))
    }

    fn color(rgb: [f64; 3], depth: f64) -> Value {
        json!({
            "transmission_color": {"type": "color3f", "value": rgb},
            "transmission_depth": {"type": "float", "value": depth},
        })
    }

    fn table(name: &str, entries: [[f64; 2]; 2]) -> Value {
        json!({name: {"type": "double2[]", "value": entries}})
    }

    fn coefficient(material: &Material) -> Option<f64> {
        match &material.kind {
            Kind::Dielectric { absorption, .. } => absorption.as_ref().map(|a| a.coefficient(REFERENCE)),
            kind => panic!("{kind:?}: {}", material.chosen),
        }
    }

    #[test]
    fn a_shaders_depth_is_in_stage_units_and_measured_lengths_are_physical() {
        let plate = table("abbe:internalTransmittance:table", [[400.0, 0.5], [700.0, 0.5]]);
        for meters_per_unit in [1.0, 0.01, 0.001] {
            let (shaded, warnings) = compiled(&json!({}), &color([0.25; 3], 2.0), meters_per_unit).unwrap();
            assert!((coefficient(&shaded).unwrap() - 2f64.ln()).abs() < 1e-15 && warnings.is_empty());
            let source = "absorbs by colour (0.25, 0.25, 0.25) at a depth of 2 (σ = 6.931472e-1 per stage unit at \
                          587.5618 nm) from </M/S>.inputs:transmission_color";
            assert!(shaded.chosen.contains(source), "{}", shaded.chosen);
            let (measured, warnings) = compiled(&plate, &json!({}), meters_per_unit).unwrap();
            let per_unit = 2f64.ln() * 100.0 * meters_per_unit;
            assert!((coefficient(&measured).unwrap() / per_unit - 1.0).abs() < 1e-14 && warnings.is_empty());
            assert!(measured.chosen.contains("absorbs by internal transmittance of 10 mm"), "{}", measured.chosen);
        }
    }

    #[test]
    fn what_is_measured_silences_the_shader_and_says_so() {
        let k = table("abbe:extinction:table", [[400.0, 1e-6], [700.0, 1e-6]]);
        let named = json!({"abbe:glass": {"type": "string", "value": "SCHOTT:N-BK7"}});
        for (abbe, place) in [(&k, "abbe:extinction:table"), (&named, "abbe:glass")] {
            let (alone, warnings) = compiled(abbe, &json!({}), 0.01).unwrap();
            assert!(warnings.is_empty() && coefficient(&alone).unwrap() > 0.0);
            let (both, warnings) = compiled(abbe, &color([0.1, 0.5, 0.5], 1.0), 0.01).unwrap();
            assert_eq!(coefficient(&both), coefficient(&alone));
            let [warning] = warnings.warnings() else { panic!("{:?}", warnings.warnings()) };
            assert_eq!(
                (warning.kind.as_str(), warning.places[0].as_str()),
                ("several-absorptions", "</M/S>.inputs:transmission_color")
            );
            assert!(warning.message.contains(place), "{}", warning.message);
        }
        let (coefficient, expected) =
            (coefficient(&compiled(&k, &json!({}), 1.0).unwrap().0), 4e-6 * std::f64::consts::PI);
        assert!((coefficient.unwrap() * lines::D.nanometers() * 1e-9 / expected - 1.0).abs() < 1e-14);
    }

    #[test]
    fn white_depth_zero_and_thin_walls_are_clear() {
        for inputs in [color([1.0; 3], 2.0), color([0.2; 3], 0.0), json!({})] {
            let (material, warnings) = compiled(&json!({}), &inputs, 0.01).unwrap();
            assert!(coefficient(&material).is_none() && warnings.is_empty(), "{}", material.chosen);
            assert!(!material.chosen.contains("absorbs"), "{}", material.chosen);
        }
        let thin = json!({"geometry_thin_walled": {"type": "bool", "value": true}});
        let k = table("abbe:extinction:table", [[400.0, 1e-6], [700.0, 1e-6]]);
        let (material, warnings) = compiled(&k, &thin, 0.01).unwrap();
        assert_eq!(coefficient(&material), None);
        assert_eq!(warnings.warnings()[0].kind, "idle-absorption");
        let named = json!({"abbe:glass": {"type": "string", "value": "SCHOTT:N-BK7"}});
        let (material, warnings) = compiled(&named, &thin, 0.01).unwrap();
        assert!(coefficient(&material).is_none() && warnings.is_empty());
    }

    #[test]
    fn what_cannot_be_is_refused_with_place_and_remedy() {
        for (abbe, inputs, place, words) in [
            (json!({}), color([1.5, 0.5, 0.5], 1.0), "</M/S>.inputs:transmission_color", "1"),
            (json!({}), color([0.5; 3], -1.0), "</M/S>.inputs:transmission_depth", "0"),
            (table("abbe:extinction:table", [[0.4, 1e-6], [0.7, 1e-6]]), json!({}), "</M>.abbe:extinction:table", "nm"),
            (
                table("abbe:extinction:table", [[400.0, 1e-6], [700.0, 1e9]]),
                json!({}),
                "</M>.abbe:extinction:table",
                "4πk/λ",
            ),
            (
                table("abbe:internalTransmittance:table", [[400.0, 0.9], [700.0, 99.0]]),
                json!({}),
                "</M>.abbe:internalTransmittance:table",
                "100",
            ),
        ] {
            let error = compiled(&abbe, &inputs, 0.01).unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(words), "{error}");
        }
    }
}
