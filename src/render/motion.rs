//! Whether anything moves in an image, and why: the shutter, and who asks for vectors of motion.

use super::request::Request;
use crate::diagnostics::Diagnostics;
use crate::film::aov::{Aov, MOTION, REFRACTED_MOTION};
use crate::scene::Scene;
use crate::scene::description::{self, Product};

/// What is decided about motion.
pub(super) struct MotionPlan {
    /// When the shutter opens and closes, frames from the scene's own; `None` if it is open at the frame alone.
    pub(super) shutter: Option<[f64; 2]>,
    /// Vectors of motion are computed, and something moves.
    pub(super) vectors: bool,
    /// Rays are traced at other times than the frame.
    pub(super) traced: bool,
    pub(super) why: String,
}

pub(super) fn motion_plan(
    scene: &Scene,
    request: &Request,
    product: Option<&Product>,
    camera: &description::Camera,
    aovs: &[&Aov],
    diagnostics: &mut Diagnostics,
) -> MotionPlan {
    let asks = |name: &str| aovs.iter().any(|aov| aov.name == name);
    let asks_for_vectors = asks(MOTION) || asks(REFRACTED_MOTION);
    let moves = camera.motion.is_some() || scene.objects.is_moving();
    let shutter = [camera.shutter_open, camera.shutter_close];
    let is_open = shutter[0] < shutter[1] && shutter.iter().all(|t| t.is_finite());
    let is_wanted = request.motion_blur.unwrap_or(!product.is_some_and(|p| p.disable_motion_blur));
    let [open, close] = shutter;
    let why = if !is_wanted {
        if request.motion_blur.is_some() { "it is turned off" } else { "disableMotionBlur says so" }.to_owned()
    } else if !is_open {
        "the camera's shutter is open at the frame alone".to_owned()
    } else if !moves {
        "nothing moves while the shutter is open".to_owned()
    } else {
        format!("something moves while the shutter is open, from {open} to {close} frames from the time code")
    };
    let blurs = is_wanted && is_open;
    // What has no time code has no time; what has one may have been written without motion.
    let stage = &scene.document().stage;
    let needed = [
        if blurs { open.min(0.0) } else { 0.0 },
        f64::max(if asks_for_vectors { 1.0 } else { 0.0 }, if blurs { close } else { 0.0 }),
    ];
    let is_read = stage.motion.is_some_and(|[low, high]| low <= needed[0] && needed[1] <= high);
    if stage.time_code.is_some() && !is_read && needed.iter().any(|&time| time != 0.0) {
        diagnostics.warn(
            "motion-not-read",
            &stage.source,
            format!(
                "motion is wanted from {} to {} frames from the time code, for which the scene was not read: what moves \
                 stands still outside of what it was read for: export the stage again",
                needed[0], needed[1]
            ),
        );
    }
    let shutter = (blurs && moves).then_some(shutter);
    let vectors = moves && asks_for_vectors;
    MotionPlan { shutter, vectors, traced: moves && (blurs || asks(REFRACTED_MOTION)), why }
}
