//! Photons for the guide: light that smooth glass and mirrors pass on, followed to the first surface that scatters it.
//!
//! A photon is aimed: at a point in the box of an object that may focus light, from a light that is sampled for that point. Which
//! points of lights and what light they send is therefore the lights' business, as for a receiver. The flux it stands for only has to
//! be about right: the guide says where to look, not what is there.

use glam::DVec3;
use rayon::prelude::*;

use super::guide::{Guide, Photon};
use super::image::Trail;
use super::tracer::{Setting, Tracer};
use crate::geometry::Ray;
use crate::integrator::Task;
use crate::integrator::lanes::Laws;
use crate::lighting::Receiver;
use crate::spectrum::visible::Visible;
use crate::spectrum::{LANES, sensor};

/// Photons for a pixel of the whole image, and the fewest and the most. They take about as long as samples. Error times time of the gem of
/// `benches/RESULTS.md` is 20 % more with two, and the same with eight, for which images of a few samples would wait twice as long.
const PER_PIXEL: u64 = 4;
const FEWEST: u64 = 1 << 12;
const MOST: u64 = 1 << 18;

/// Lights that are asked what else falls on a region.
const LIGHTS: u32 = 16;

/// Photons sent by one task.
const CHUNK: u32 = 512;

/// The pixel whose numbers photons draw: one that no image has.
const PIXEL: [i32; 2] = [i32::MIN; 2];

/// An object that may focus light.
struct Target {
    object: u32,
    min: DVec3,
    extent: DVec3,
}

/// Sends photons and learns from them; `None` where nothing focuses light. The same for all parts of an image.
pub(super) fn guide(setting: Setting<'_>, task: &Task<'_>, laws: &Laws<'_>, visible: &Visible) -> Option<Guide> {
    if setting.lighting.is_empty() {
        return None;
    }
    let targets: Vec<Target> =
        setting.view.focusing().map(|(object, [min, max])| Target { object, min, extent: max - min }).collect();
    if targets.is_empty() {
        return None;
    }
    let pixels = u64::from(task.resolution[0]) * u64::from(task.resolution[1]);
    let count = (PER_PIXEL * pixels).clamp(FEWEST, MOST) as u32;
    let photons = if laws.is_dispersive() {
        send::<true>(setting, task, laws, visible, &targets, count)
    } else {
        send::<false>(setting, task, laws, visible, &targets, count)
    };
    // As if nothing were in the way, and from all sides alike: half of it is behind.
    let others = |region: u32, point| {
        let receiver = Receiver { point, normal: None, object: targets[0].object, time: 0.0 };
        let one = |index| {
            let mut numbers = task.sampler.independent(PIXEL, LIGHTS * region + index);
            let wavelengths = visible.sample::<LANES>(numbers.wavelength());
            let [u_light, u, v, _] = numbers.draw();
            let light = setting.lighting.sample(&receiver, &wavelengths, u_light, [u, v])?;
            Some(sensor::xyz(light.radiance, &wavelengths).y as f32 / light.pdf)
        };
        0.5 * (0..LIGHTS).filter_map(one).sum::<f32>() / LIGHTS as f32
    };
    Guide::new(photons, others)
}

fn send<const DISPERSIVE: bool>(
    setting: Setting<'_>,
    task: &Task<'_>,
    laws: &Laws<'_>,
    visible: &Visible,
    targets: &[Target],
    count: u32,
) -> Vec<Photon> {
    // Beyond everything.
    let reach = setting.view.aggregate.bounds().map_or(1.0, |[min, max]| (max - min).length());
    let chunks: Vec<Vec<_>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut tracer = Tracer::<LANES, DISPERSIVE>::new(setting, laws, &[]);
            let indices = chunk * CHUNK..((chunk + 1) * CHUNK).min(count);
            indices.filter_map(|index| one(&mut tracer, task, visible, targets, reach, index)).collect()
        })
        .collect();
    let mut photons = chunks.concat();
    // A photon of the chosen object stands for those of the others.
    let share = targets.len() as f32 / count as f32;
    photons.iter_mut().for_each(|photon| photon.flux *= share);
    photons
}

fn one<const DISPERSIVE: bool>(
    tracer: &mut Tracer<'_, LANES, DISPERSIVE>,
    task: &Task<'_>,
    visible: &Visible,
    targets: &[Target],
    reach: f64,
    index: u32,
) -> Option<Photon> {
    let mut numbers = task.sampler.path(PIXEL, index);
    let wavelengths = visible.sample::<LANES>(numbers.wavelength());
    let time = task.camera.time(&task.sampler.sample(PIXEL, index));
    let [u_target, x, y, z] = numbers.draw();
    let chosen = (u_target * targets.len() as f32) as usize;
    let &Target { object, min, extent } = targets.get(chosen).or(targets.last())?;
    let aim = min + extent * DVec3::new(x.into(), y.into(), z.into());
    let [u_light, u, v, _] = numbers.draw();
    let receiver = Receiver { point: aim, normal: None, object, time };
    let light = tracer.setting.lighting.sample(&receiver, &wavelengths, u_light, [u, v])?;
    // No direction leads to what has no size.
    if light.is_delta {
        return None;
    }
    // From before the light's own surface.
    let distance = light.distance.min((aim - min).length() + 2.0 * reach) * (1.0 - 1e-6);
    let ray = Ray { origin: aim + distance * light.wi, direction: -light.wi, time };
    // Rays through points that are even in a box are more the longer their way through it: for a beam of `area`, volume over way.
    let along = ((min - aim) / light.wi, (min + extent - aim) / light.wi);
    let (near, far) = (along.0.min(along.1), along.0.max(along.1));
    let way = far.min_element() - near.max_element();
    let volume = extent.max(DVec3::splat(1e-3 * extent.max_element())).element_product();
    let area = volume / way.max(1e-3 * extent.max_element());
    let patch = tracer.setting.lighting.patch(light.light, light.wi);
    let trail = patch.and_then(|patch| Trail::new(patch, &ray));
    let arrival = tracer.photon(ray, trail, wavelengths, &mut numbers)?;
    let [_, luminance, _] = sensor::xyz(light.radiance * arrival.carried, &wavelengths).to_array();
    let flux = (luminance * area) as f32 / light.pdf;
    Some(Photon { point: arrival.point, from: arrival.from, flux, image: arrival.image, way: arrival.way })
}
