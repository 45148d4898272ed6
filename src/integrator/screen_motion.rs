//! Motion on screen from the frame to the next one: the vectors that compositors blur and filters follow.
//!
//! A point that is seen at some time within the shutter belongs to a surface and moves with it. Where that point is at the
//! frame (time 0) and at the next (time 1), seen by the camera of that time, are two places on the raster; the vector leads
//! from the first to the second. So a blurred image and a sharp one have the same vectors, whatever the shutter, and an
//! application scales them by how long it wants a shutter to be open.

use glam::{DVec2, DVec3};

use super::Task;
use super::chain::{Chain, Counters, End, Follower, Record, SurfacePoint};
use super::search::{EndState, Wanted};
use crate::geometry::Shape;
use crate::ray::RayStart;
use crate::sampler::CameraSample;
use crate::scene::view::{Media, View};

/// The frame and the next one.
const FRAMES: [f64; 2] = [0.0, 1.0];

/// Motion of a surface's point that was met by the ray `start`, or of its direction on a miss.
pub(super) fn of_surface(task: &Task<'_>, start: &RayStart, met: Option<&SurfacePoint>) -> Option<DVec2> {
    if !task.motion_vectors {
        return Some(DVec2::ZERO);
    }
    let [from, to] = FRAMES.map(|time| match met {
        Some(met) => task.camera.raster_of(point_at(task.view, met, start.time, time), false, time),
        None => task.camera.raster_of(start.direction, true, time),
    });
    Some(y_up(to? - from?))
}

/// Motion of what is seen at the end of `chain`, through all that is in between: chains are followed at both frames to
/// where they end at the same point of the same surface.
pub(super) fn of_end<C>(
    task: &Task<'_>,
    follower: &Follower<'_>,
    media: &Media,
    place: &CameraSample,
    start: &RayStart,
    chain: &Chain<C>,
    counters: &mut Counters,
) -> Option<DVec2> {
    let end = EndState::new(chain);
    if !end.exists() || !task.motion_vectors {
        return end.exists().then_some(DVec2::ZERO);
    }
    let mut offset = DVec2::ZERO;
    let mut found = [DVec2::ZERO; 2];
    for (found, time) in found.iter_mut().zip(FRAMES) {
        if (time - start.time).abs() > 0.0 {
            let value = match &chain.end {
                End::Surface(met) => point_at(task.view, met, start.time, time),
                End::Miss | End::Exhausted => end.value,
            };
            let wanted = Wanted { end: EndState { value, ..end }, ..Wanted::of(chain) };
            let instance = |chain_end: &End| match chain_end {
                End::Surface(met) => Some(met.hit.instance),
                End::Miss | End::Exhausted => None,
            };
            let mut is_same = true;
            offset = wanted.find(offset, counters, |offset, counters| {
                let moved = task.camera.ray_at(&place.moved(offset.x, -offset.y), time);
                let there = follower.follow(&moved, media, Record::none(), counters);
                is_same = instance(&there.end) == instance(&chain.end);
                there
            })?;
            if !is_same {
                return None;
            }
        }
        *found = offset;
    }
    Some(found[1] - found[0])
}

/// Where in render space the point of a surface, which was met at one time, is at another.
fn point_at(view: &View<'_>, met: &SurfacePoint, then: f64, time: f64) -> DVec3 {
    let objects = &view.scene.objects;
    let (shape, world_from_object) = objects.placed(met.hit.instance, time);
    let point = match shape {
        Shape::Mesh(mesh) => {
            let [a, b, c] = mesh.corners(met.hit.primitive, time);
            let [v, w] = met.hit.barycentric;
            (1.0 - v - w) * a + v * b + w * c
        }
        Shape::Sphere(_) | Shape::Solid(_) => {
            let (_, then) = objects.placed(met.hit.instance, then);
            then.inverse().transform_point3(view.origin + met.point)
        }
    };
    world_from_object.transform_point3(point) - view.origin
}

fn y_up(raster: DVec2) -> DVec2 {
    DVec2::new(raster.x, -raster.y)
}
