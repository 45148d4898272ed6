//! Every event of one sample's chain with its columns: what `abbe trace` prints.

use glam::DVec3;
use serde_json::{Value, json};

use super::Plan;
use crate::error::{Error, Result};
use crate::film::Window;
use crate::integrator::chain::{Chain, Counters, End, Follower, Record};
use crate::integrator::transmittance::{Coefficients, Segment};
use crate::ray::{Column, ColumnSet, ScatterKind, SecondOrderColumns, Step};
use crate::sampler::Sampler;
use crate::scene::Scene;
use crate::scene::view::Media;

/// Follows sample `sample` of `pixel` (x right, y down) and tells every event with the columns before and after it.
pub fn trace(scene: &Scene, plan: &Plan, pixel: [i32; 2], sample: u32) -> Result<Value> {
    if sample >= plan.samples.total {
        return Err(Error::usage("--sample", format!("{sample} of {}: the first is 0", plan.samples.total)));
    }
    let [width, height] = plan.resolution;
    let in_raster = (0..width as i32).contains(&pixel[0]) && (0..height as i32).contains(&pixel[1]);
    let Window { x0, y0, x1, y1 } = plan.window;
    let in_window = (x0..x1).contains(&pixel[0]) && (y0..y1).contains(&pixel[1]);
    if !in_raster && !in_window {
        return Err(Error::usage(
            "--pixel",
            format!(
                "({}, {}) is outside of the image of {width} x {height} pixels: x right, y down, from 0",
                pixel[0], pixel[1]
            ),
        ));
    }
    let camera = super::camera(scene, plan)?;
    let view = super::view(scene, plan, &camera);
    let media = Media::at(scene, plan.optics.reference, plan.optics.dispersion_scale)?;
    let follower = Follower::of_camera(&view, &camera);
    let place = Sampler::new(plan.samples.total, plan.seed)?.over_time(plan.shutter.is_some()).sample(pixel, sample);
    let start = camera.ray(&place);
    let (mut log, mut segments) = (Vec::new(), Vec::new());
    let record = Record { steps: Some(&mut log), segments: Some(&mut segments) };
    let chain: Chain<SecondOrderColumns> = follower.follow(&start, &media, record, &mut Counters::default());
    let absorption = Coefficients::at(scene, [plan.optics.reference]);

    let mut columns = SecondOrderColumns::start(&start, &chain.start_medium);
    let mut point = start.point;
    // The way from the last event: its medium, length and transmittance, and the transmittance so far. There is one more
    // segment than steps on a miss, and as many otherwise.
    let way = |i: usize| {
        let Segment { medium, length } = segments[i];
        let [here] = absorption.transmittance(&segments[i..=i]);
        let [so_far] = absorption.transmittance(&segments[..=i]);
        json!({
            "medium": medium.map(|id| &scene.materials[id.0 as usize].path),
            "length": length.is_finite().then_some(length),
            "transmittance": here,
            "transmittance_so_far": so_far,
        })
    };
    let mut events = Vec::new();
    for (i, Step { transfer, scattering }) in log.iter().enumerate() {
        columns.transfer(transfer);
        point += transfer.distance * transfer.direction;
        let Some(scattering) = scattering else { break };
        let before = columns;
        columns.scatter(scattering);
        events.push(json!({
            "event": match scattering.kind {
                ScatterKind::Refraction => "refraction",
                ScatterKind::TotalReflection => "total_reflection",
                ScatterKind::Mirror => "mirror",
            },
            "distance": transfer.distance,
            "segment": way(i),
            "position": array(view.origin + point),
            "normal": array(scattering.normal),
            "geometric_normal_used": scattering.geometric_normal_used,
            "ior": [scattering.ior_i.ior, scattering.ior_t.ior],
            "dior_dlambda": [scattering.ior_i.dior_dlambda, scattering.ior_t.dior_dlambda],
            "w_squared": scattering.w_squared,
            "momentum": [array(scattering.momentum_in), array(scattering.momentum_out)],
            "columns": json!({ "arriving": describe(&before), "leaving": describe(&columns) }),
        }));
    }
    let end = match &chain.end {
        End::Miss => json!({ "kind": "miss" }),
        End::Exhausted => json!({ "kind": "too many events" }),
        End::Surface(met) => json!({
            "kind": "surface",
            "prim": scene.prims.path(scene.objects.ids(met.hit.instance).prim_id),
            "instance": scene.instances.path(scene.objects.ids(met.hit.instance).instance_id),
            "material": (met.material_id as usize).checked_sub(1).map(|i| &scene.materials[i].path),
            "primitive": met.hit.primitive,
            "position": array(view.origin + met.point),
            "normal_geometric": array(met.surface.n_g),
        }),
    };
    Ok(json!({
        "pixel": pixel,
        "sample": sample,
        "raster": place.raster,
        "wavelength_nm": plan.optics.reference.nanometers(),
        "time": start.time,
        "camera": array(view.origin + camera.position_at(start.time)),
        "direction": array(start.direction),
        "start_ior": chain.start_medium.ior,
        "last_segment": if matches!(chain.end, End::Exhausted) { Value::Null } else { way(segments.len() - 1) },
        "events": events,
        "end": end,
        "last_direction": array(chain.direction),
        "interfaces": chain.interfaces,
        "total_reflections": chain.total_reflections,
        "is_dispersive": chain.is_dispersive,
        "nearest_critical_nm": if chain.nearest_critical.is_finite() { json!(chain.nearest_critical) } else { Value::Null },
        "columns": describe(&chain.columns),
    }))
}

fn array(v: DVec3) -> [f64; 3] {
    v.to_array()
}

fn describe(columns: &SecondOrderColumns) -> Value {
    let column = |c: &Column| json!({ "point": array(c.point), "momentum": array(c.momentum) });
    let [x, y] = columns.screen().expect("these columns are carried").map(column);
    json!({ "x": x, "y": y, "lambda": columns.lambda().map(column), "lambda2": columns.lambda2().map(column) })
}
