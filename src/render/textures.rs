//! The images of a render: which are needed, what is said of those that are missing, and the memory for them.

use super::layers::PlannedLayer;
use super::request::Request;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::is_albedo;
use crate::integrator::Needs;
use crate::scene::Scene;
use crate::texture::{DEFAULT_BUDGET, Unreadable};

const MEGABYTE: u64 = 1_000_000;

/// The memory that is asked for, bytes.
pub(super) fn memory(request: &Request) -> Result<u64> {
    match request.texture_memory {
        None => Ok(DEFAULT_BUDGET),
        Some(megabytes) if megabytes > 0 => Ok(megabytes.saturating_mul(MEGABYTE)),
        Some(_) => Err(Error::usage("--texture-memory", "is 0: give megabytes, 1 or more")),
    }
}

/// The images that may be looked up, increasing.
fn needed(scene: &Scene, needs: &Needs) -> Vec<u32> {
    let programs = scene.materials.iter().flat_map(|material| material.appearance.looked_up(needs.albedo));
    let mut images: Vec<u32> = programs.flat_map(|program| program.images()).collect();
    if needs.transport {
        let bundles = scene.materials.iter().filter_map(|material| material.surface.looked_up());
        images.extend(bundles.flat_map(|bundle| bundle.images()));
    }
    images.sort_unstable();
    images.dedup();
    images
}

/// Says of opacity, albedo and images whether they are looked up, and why.
pub(super) fn decide(scene: &Scene, layers: &[PlannedLayer], needs: &Needs, note: &mut impl FnMut(bool, &str, String)) {
    let holes = scene.materials.iter().find(|material| material.appearance.opacity.is_some());
    let why = match holes {
        Some(material) => format!("the opacity of {} differs from point to point", material.path),
        None => "no material in use has an opacity that differs from point to point".to_owned(),
    };
    note(holes.is_some(), "opacity", why);
    let asking: Vec<_> =
        layers.iter().map(|layer| layer.aov).filter(|aov| is_albedo(aov)).map(|aov| aov.name).collect();
    let why = match asking[..] {
        [] => "no AOV asks for it".to_owned(),
        [name] => format!("{name} asks for it"),
        _ => format!("{} ask for it", asking.join(", ")),
    };
    note(needs.albedo, "albedo", why);
    let (all, needed) = (scene.textures.len(), needed(scene, needs).len());
    if needed > 0 {
        note(true, "images", format!("{needed} of {all} may be looked up; each is read when it is"));
    }
    if needed < all {
        note(false, "images", format!("{} of {all}: nothing looks them up", all - needed));
    }
}

/// Makes ready for a render; an image that is needed and not there is an error if the scene says so.
pub(super) fn prepare(scene: &Scene, needs: &Needs, memory: u64) -> Result<()> {
    scene.textures.set_budget(memory);
    if scene.document().strict_assets
        && let Some(missing) = missing(scene, needs).into_iter().next()
    {
        return Err(refused(&missing));
    }
    Ok(())
}

/// Names the images that are needed and not there.
pub(super) fn report_missing(scene: &Scene, needs: &Needs, diagnostics: &mut Diagnostics) {
    for image in missing(scene, needs) {
        diagnostics.warn("missing-texture", &image.place, in_its_place(&image));
    }
}

/// Names what was looked up and could not be read; an error if the scene says so.
pub(super) fn report_unreadable(scene: &Scene, diagnostics: &mut Diagnostics) -> Result<()> {
    for image in scene.textures.unreadable().iter().filter(|image| !image.missing) {
        if scene.document().strict_assets {
            return Err(refused(image));
        }
        diagnostics.warn("unreadable-texture", &image.place, in_its_place(image));
    }
    Ok(())
}

fn in_its_place(image: &Unreadable) -> String {
    format!("the image {}: the default of its node is used", image.problem)
}

/// Whether a render may stop: an image cannot be read, and that is an error.
pub(super) fn has_failed(scene: &Scene) -> bool {
    scene.document().strict_assets && scene.textures.has_failed()
}

fn missing(scene: &Scene, needs: &Needs) -> Vec<Unreadable> {
    scene.textures.missing(needed(scene, needs).into_iter())
}

fn refused(image: &Unreadable) -> Error {
    Error::scene(
        image.place.as_str(),
        format!("the image {}: correct it, or render with --missing warn", image.problem),
    )
}
