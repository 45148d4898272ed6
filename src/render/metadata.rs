//! The header of an image: everything that is needed to use its numbers without this manual.

use serde_json::json;

use super::Plan;
use crate::camera::{Camera, linear_exposure_scale};
use crate::film::aov::{Family, Merge, SPECTRAL};
use crate::film::metadata::{Attribute, Metadata};
use crate::film::spectral;
use crate::scene::Scene;
use crate::scene::description;
use crate::spectrum::Wavelength;
use crate::spectrum::color::RgbSpace;
use crate::spectrum::sensor::ColorSpace;
use glam::{DMat4, DVec4};

/// How a render ended.
pub(super) struct Outcome {
    pub(super) complete: bool,
    /// Samples per pixel of the whole render, or the most that a pixel could have.
    pub(super) total: u32,
    pub(super) reached_limit: bool,
    /// Samples that were scaled down.
    pub(super) clamped: u64,
}

/// What a film of `plan` says about itself. Times and machines are left out, so that the same render gives the same bytes.
pub(super) fn metadata(scene: &Scene, plan: &Plan, camera: &Camera, outcome: &Outcome) -> Metadata {
    let mut metadata = Metadata { compression: plan.compression.clone(), ..Metadata::default() };
    // What the product wants comes first: it does not replace what is true.
    metadata.attributes.clone_from(&plan.header);
    let mut set = |name: &str, value| metadata.set(name, value);
    let text = |value: &str| Attribute::Text(value.to_owned());
    let stage = &scene.document().stage;
    let nm = |w: Wavelength| w.nanometers();
    let [low, high] = plan.optics.band.map(nm);

    set("abbe:version", text(env!("CARGO_PKG_VERSION")));
    set("abbe:stage", text(&stage.source));
    set("abbe:integrator", text(&plan.integrator));
    set("abbe:referenceWavelength", Attribute::Double(nm(plan.optics.reference)));
    set("abbe:referenceWavelengthText", Attribute::Text(format!("{} nm", nm(plan.optics.reference))));
    set("abbe:band", Attribute::Text(format!("{low}:{high} nm")));
    let [r, g, b] = plan.optics.channels.map(nm);
    set("abbe:channelWavelengths", Attribute::Text(format!("R {r} nm, G {g} nm, B {b} nm")));
    set("abbe:dispersionScale", Attribute::Double(plan.optics.dispersion_scale));
    set(
        "abbe:axes",
        text("pixel vectors: +x right, +y up, full-raster pixels; vectors and positions: the stage's world"),
    );
    set(
        "abbe:sign",
        text(
            "dispersion: motion of the feature seen here per nm of increasing wavelength; dispersion_r/_g/_b: fetch offset, \
             look up the image here + offset; \
             motion, refracted_motion: from this frame to the next one",
        ),
    );
    set("abbe:metersPerUnit", Attribute::Double(stage.meters_per_unit));
    set("abbe:upAxis", text(&stage.up_axis));
    set("abbe:camera", text(&plan.camera_path));
    if let Some(time) = stage.time_code {
        set("abbe:timeCode", Attribute::Double(time));
    }
    if let Some([open, close]) = plan.shutter {
        set("abbe:shutter", Attribute::Text(format!("{open}:{close} frames from the time code")));
    }
    set("abbe:samples", Attribute::Int(outcome.total as i32));
    if let Some(target) = plan.error_target {
        set("abbe:errorTarget", Attribute::Double(target));
    }
    if outcome.reached_limit {
        set("abbe:reproducible", Attribute::Int(0));
        set(
            "abbe:timeLimit",
            Attribute::Text(format!(
                "{} s were over after {} of {} samples: another run may end with others; the same number of samples gives the same bits",
                plan.time_limit.unwrap_or_default(),
                outcome.total,
                plan.samples.total
            )),
        );
    }
    if let Some(clamp) = plan.clamp {
        set("abbe:clamp", Attribute::Double(clamp));
        set("abbe:clampedSamples", Attribute::Text(outcome.clamped.to_string()));
    }
    set("abbe:seed", Attribute::Text(plan.seed.to_string()));
    set("abbe:settingsHash", Attribute::Text(settings_hash(scene, plan)));
    if !outcome.complete {
        // A whole image says nothing, so that it is the same file however it came about.
        set("abbe:complete", Attribute::Int(0));
    }
    for layer in &plan.layers {
        // Bare channels go by the AOV's name.
        let title = if layer.name.is_empty() { layer.aov.name } else { &layer.name };
        set(&format!("abbe:unit:{title}"), text(layer.aov.unit));
        if title != layer.aov.name {
            set(&format!("abbe:aov:{title}"), text(layer.aov.name));
        }
    }
    if plan.layers.iter().any(|layer| layer.name == spectral::EMISSION && layer.aov.name == SPECTRAL) {
        set("spectralLayoutVersion", text("1.0"));
        set("emissiveUnits", text("radiance per nm, of which D65 with Y = 1 is white"));
    }
    for layer in plan.layers.iter().filter(|layer| !layer.argument.is_empty()) {
        set(&format!("abbe:argument:{}", layer.name), text(&layer.argument));
    }
    let has_ids =
        |what: &str| plan.layers.iter().any(|layer| layer.aov.merge == Merge::First && layer.aov.name.contains(what));
    for (name, paths, wanted) in [
        ("abbe:primManifest", scene.prims.entries(), has_ids("prim_id")),
        ("abbe:instanceManifest", scene.instances.entries(), has_ids("instance_id")),
    ] {
        if wanted {
            set(name, Attribute::Text(json!(paths).to_string()));
        }
    }
    if has_ids("material_id") {
        let paths: Vec<_> = scene.materials.iter().map(|m| &m.path).collect();
        set("abbe:materialManifest", Attribute::Text(json!(paths).to_string()));
    }
    let laws: serde_json::Map<_, _> = plan.materials.iter().map(|d| (d.what.clone(), json!(d.why))).collect();
    set("abbe:materials", Attribute::Text(serde_json::Value::Object(laws).to_string()));

    let transports = plan.layers.iter().any(|layer| layer.aov.family == Family::Transport);
    // Colours of surfaces stay what they are authored in.
    let space = if transports { plan.color_space } else { ColorSpace::Rgb(RgbSpace::REC709) };
    set("chromaticities", Attribute::Chromaticities(space.chromaticities().map(|xy| xy.map(|v| v as f32))));
    if transports {
        set("colorInteropID", text(space.interop_id()));
        set("abbe:pixelFilter", Attribute::Text(filter_text(plan)));
        if let ColorSpace::Rgb(RgbSpace { white: [x, y], .. }) = space {
            set("adoptedNeutral", Attribute::Vec2([x as f32, y as f32]));
        }
    }
    if let Some(rate) = stage.frames_per_second.filter(|rate| *rate > 0.0 && *rate < 1e6) {
        // Film and video rates are n or n·1000/1001.
        let (n, d) = if rate.fract() == 0.0 { (rate as i32, 1) } else { ((rate * 1001.0).round() as i32, 1001) };
        set("framesPerSecond", Attribute::Rational(n, d));
    }
    let authored = &scene.document().cameras[plan.camera];
    for (name, value) in lens(authored, stage) {
        set(name, Attribute::Float(value));
    }
    if let Some(exposure) = &authored.exposure {
        let scale = linear_exposure_scale(exposure);
        if scale.is_finite() {
            set("abbe:exposureScale", Attribute::Double(scale));
        }
    }
    let (to_camera, to_ndc) = matrices(camera);
    set("worldToCamera", Attribute::Matrix(to_camera));
    set("worldToNDC", Attribute::Matrix(to_ndc));
    metadata
}

fn filter_text(plan: &Plan) -> String {
    let shape = serde_json::to_value(plan.filter.shape()).ok();
    format!("{} {} px", shape.as_ref().and_then(serde_json::Value::as_str).unwrap_or_default(), plan.filter.width())
}

/// Standard attributes of a camera, in the units that OpenEXR defines for them; those that nothing is authored for are left
/// out.
fn lens(camera: &description::Camera, stage: &description::Stage) -> Vec<(&'static str, f32)> {
    let exposure = camera.exposure.unwrap_or_default();
    let opening = camera.shutter_close - camera.shutter_open;
    // The shutter is in time codes about the frame.
    let seconds = stage.time_codes_per_second.map(|rate| opening / rate);
    let angle = seconds.zip(stage.frames_per_second).map(|(seconds, rate)| 360.0 * seconds * rate);
    let is_perspective = camera.projection == "perspective";
    let millimetres = camera.focal_length * 0.1 * stage.meters_per_unit * 1000.0;
    [
        ("expTime", exposure.time.or(seconds)),
        ("shutterAngle", angle),
        ("isoSpeed", exposure.iso),
        ("aperture", Some(camera.f_stop)),
        ("focus", Some(camera.focus_distance * stage.meters_per_unit)),
        ("nominalFocalLength", is_perspective.then_some(millimetres)),
    ]
    .into_iter()
    .filter_map(|(name, value)| Some((name, value? as f32)))
    .filter(|(_, value)| *value > 0.0 && value.is_finite())
    .collect()
}

/// World to camera (left-handed, +z forward, as OpenEXR wants it) and world to NDC (origin top-left, y down, z unused),
/// row-major for row vectors.
fn matrices(camera: &Camera) -> ([f32; 16], [f32; 16]) {
    let camera_from_world = camera.world_from_camera.inverse();
    let flip_z = DMat4::from_diagonal(DVec4::new(1.0, 1.0, -1.0, 1.0));
    let to_camera = flip_z * camera_from_world;
    // A raster position is linear in the camera's homogeneous coordinates; `Camera` has the window and the centre.
    let [width, height] = camera.window;
    let (cx, cy) = camera.window_centre();
    let (sx, sy) = (1.0 / width, -1.0 / height);
    let (ox, oy) = (0.5 - cx / width, 0.5 + cy / height);
    let projection = if camera.is_orthographic {
        DMat4::from_cols(
            DVec4::new(sx, 0.0, 0.0, 0.0),
            DVec4::new(0.0, sy, 0.0, 0.0),
            DVec4::new(0.0, 0.0, 1.0, 0.0),
            DVec4::new(ox, oy, 0.0, 1.0),
        )
    } else {
        DMat4::from_cols(
            DVec4::new(sx, 0.0, 0.0, 0.0),
            DVec4::new(0.0, sy, 0.0, 0.0),
            DVec4::new(ox, oy, 1.0, 1.0),
            DVec4::new(0.0, 0.0, 0.0, 0.0),
        )
    };
    let flat = |m: DMat4| m.to_cols_array().map(|v| v as f32);
    (flat(to_camera), flat(projection * to_camera))
}

/// A fingerprint of everything that decides the pixels but the part of them that is rendered.
fn settings_hash(scene: &Scene, plan: &Plan) -> String {
    let layers: Vec<_> = plan.layers.iter().map(|layer| (&layer.name, layer.aov.name)).collect();
    let mut camera = scene.document().cameras[plan.camera].clone();
    // A scene file keeps motion that this render has no use for, and that a stage would not have been asked for.
    if plan.shutter.is_none() && !plan.motion_vectors {
        camera.motion = None;
    }
    let transports = plan.layers.iter().any(|layer| layer.aov.family == Family::Transport);
    let mut decisive = json!({
        "camera": camera,
        "resolution": plan.resolution,
        "pixelAspectRatio": plan.pixel_aspect_ratio,
        "depthOfField": plan.depth_of_field,
        "conformPolicy": format!("{:?}", plan.conform_policy),
        "samples": plan.samples.total,
        "seed": plan.seed,
        "shutter": plan.shutter,
        "integrator": plan.integrator,
        "optics": plan.optics,
        "layers": layers,
        "materials": plan.materials,
        "objects": scene.counts.objects,
        "triangles": scene.counts.triangles,
    });
    if transports {
        decisive["colorSpace"] = json!(plan.color_space.interop_id());
        decisive["pixelFilter"] = json!(filter_text(plan));
        decisive["errorTarget"] = json!(plan.error_target);
        decisive["clamp"] = json!(plan.clamp);
    }
    // FNV-1a (Fowler, Noll, Vo): tells settings apart, guards nothing.
    let hash = decisive
        .to_string()
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    format!("{hash:016x}")
}
