//! Cameras: where rays begin, and how they move with the pixel.
//!
//! A direction is d = D/|D| with D = look + x·right + y·up (Igehy 1999, eq. 8); x and y are in pixels, +x right and
//! +y up. Through another point o of the lens the ray goes to the same point at the focus distance f, o₀ + f D, so that D
//! is look + x·right + y·up − (o − o₀)/f there: ∂D is the same, and at a fixed point of the lens ∂p = 0.
//!
//! Distances of a camera (focus, near and far) are those of its own space: a scaled camera scales them.

mod clipping;
mod exposure;
mod lens;

pub use clipping::{Clipping, Sight};
pub use exposure::linear_exposure_scale;
pub use lens::Lens;

use glam::{DAffine3, DMat3, DMat4, DVec2, DVec3, DVec4};

use crate::error::{Error, Result};
use crate::geometry::{Pose, Track};
use crate::ray::RayStart;
use crate::sampler::CameraSample;
use crate::scene::description;

/// How a camera's aperture is fitted to the image (`aspectRatioConformPolicy` of UsdRender).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConformPolicy {
    /// Widen the narrower side, so that nothing of the aperture is lost.
    ExpandAperture,
    /// Narrow the wider side, so that nothing beyond the aperture is seen.
    CropAperture,
    /// Keep the height.
    AdjustApertureWidth,
    /// Keep the width.
    AdjustApertureHeight,
    /// Keep both and make pixels oblong.
    AdjustPixelAspectRatio,
}

impl ConformPolicy {
    /// Their names in USD.
    pub const TOKENS: [&str; 5] =
        ["expandAperture", "cropAperture", "adjustApertureWidth", "adjustApertureHeight", "adjustPixelAspectRatio"];

    /// The policy called `token`.
    pub fn from_token(token: &str) -> Option<Self> {
        Some(match token {
            "expandAperture" => Self::ExpandAperture,
            "cropAperture" => Self::CropAperture,
            "adjustApertureWidth" => Self::AdjustApertureWidth,
            "adjustApertureHeight" => Self::AdjustApertureHeight,
            "adjustPixelAspectRatio" => Self::AdjustPixelAspectRatio,
            _ => return None,
        })
    }
}

/// A camera ready for one image.
#[derive(Clone, Debug)]
pub struct Camera {
    /// World position of the centre of projection, the origin of render space.
    pub position: DVec3,
    /// Width of a pixel over its height, after the conform policy.
    pub pixel_aspect_ratio: f64,
    /// World from camera, as authored.
    pub world_from_camera: DMat4,
    /// Aperture after the conform policy, over the focal length (perspective) or in stage units (orthographic).
    pub window: [f64; 2],
    /// Whether rays are parallel.
    pub is_orthographic: bool,
    /// At the frame.
    still: Standing,
    /// World from camera at other times; `None` if it stands still or its shutter does not stay open.
    motion: Option<Pose>,
    /// When the shutter opens and closes, frames from the scene's own.
    shutter: [f64; 2],
    /// Depth of the points where rays begin, in units of the camera: less than 0 where an orthographic view begins behind
    /// its camera.
    start_depth: f64,
    /// Where the image's centre stands in the window, in its units (the aperture offsets).
    centre: [f64; 2],
    resolution: [u32; 2],
    /// A pinhole without.
    lens: Option<Lens>,
    clipping: Clipping,
}

/// A camera at one time, in render space.
#[derive(Clone, Copy, Debug)]
struct Standing {
    /// The centre of projection, or of the plane where an orthographic view begins.
    position: DVec3,
    /// x and y of camera space.
    axes: [DVec3; 2],
    /// D at the image's centre (perspective), the common direction (orthographic).
    look: DVec3,
    /// ∂D/∂x (∂p/∂x if orthographic) per pixel.
    right: DVec3,
    /// ∂D/∂y (∂p/∂y if orthographic) per pixel.
    up: DVec3,
    /// The unit axis along which depth is measured.
    axis: DVec3,
    /// Depth where rays begin.
    start_depth: f64,
}

impl Camera {
    /// Fits `camera` to an image of `resolution` pixels; a pinhole until [`with_lens`](Self::with_lens).
    ///
    /// A clipping range whose near plane is not before its far plane clips nothing.
    pub fn new(
        camera: &description::Camera,
        resolution: [u32; 2],
        pixel_aspect_ratio: f64,
        policy: ConformPolicy,
    ) -> Result<Self> {
        let place = if camera.path.is_empty() { "camera" } else { &camera.path };
        let error = |problem: &str| Err(Error::scene(place, problem));
        let world_from_camera = DMat4::from_cols_array(&camera.transform);
        let determinant = world_from_camera.determinant();
        if !world_from_camera.is_finite() || determinant == 0.0 || !determinant.is_finite() {
            return error("its transform is singular or not finite: give it a rotation and a translation");
        }
        let is_orthographic = match camera.projection.as_str() {
            "perspective" => false,
            "orthographic" => true,
            other => return error(&format!("unknown projection '{other}': use perspective or orthographic")),
        };
        let (mut width, mut height) = (camera.horizontal_aperture, camera.vertical_aperture);
        if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
            return error("its apertures must be positive");
        }
        let has_focal_length = camera.focal_length > 0.0 && camera.focal_length.is_finite();
        if !is_orthographic && !has_focal_length {
            return error("its focal length must be positive");
        }
        if !(pixel_aspect_ratio > 0.0 && pixel_aspect_ratio.is_finite()) {
            return error("the pixel aspect ratio of its image must be positive");
        }
        // UsdRenderComputeSpec: the aperture takes the image's shape.
        let mut pixel_aspect_ratio = pixel_aspect_ratio;
        let raster = f64::from(resolution[0]) / f64::from(resolution[1]);
        let (image, aperture) = (pixel_aspect_ratio * raster, width / height);
        match policy {
            ConformPolicy::AdjustPixelAspectRatio => pixel_aspect_ratio = aperture / raster,
            ConformPolicy::AdjustApertureWidth => width = height * image,
            ConformPolicy::AdjustApertureHeight => height = width / image,
            ConformPolicy::ExpandAperture if aperture > image => height = width / image,
            ConformPolicy::ExpandAperture => width = height * image,
            ConformPolicy::CropAperture if aperture > image => width = height * image,
            ConformPolicy::CropAperture => height = width / image,
        }
        // Apertures and focal length share their unit, a tenth of the stage's; only an orthographic view needs to know.
        let unit = if is_orthographic { 10.0 } else { camera.focal_length };
        let window = [width / unit, height / unit];
        let offset = [camera.horizontal_aperture_offset / unit, camera.vertical_aperture_offset / unit];
        let clipping_range = camera.clipping_range.filter(|[near, far]| near < far);
        // Parallel rays may begin behind their camera; those of a perspective begin in it.
        let behind = clipping_range.map_or(0.0, |[near, _]| near.min(0.0));
        let nowhere = DVec3::ZERO;
        let mut fitted = Self {
            position: nowhere,
            pixel_aspect_ratio,
            world_from_camera,
            window,
            is_orthographic,
            still: Standing {
                position: nowhere,
                axes: [nowhere; 2],
                look: nowhere,
                right: nowhere,
                up: nowhere,
                axis: nowhere,
                start_depth: 0.0,
            },
            motion: None,
            shutter: [0.0; 2],
            start_depth: if is_orthographic { behind } else { 0.0 },
            centre: offset,
            resolution,
            lens: None,
            clipping: Clipping::default(),
        };
        fitted.stand_about(fitted.standing(&world_from_camera).position);
        let camera_from_render = world_from_camera.inverse() * DMat4::from_translation(fitted.position);
        fitted.clipping = Clipping::new(&camera_from_render, clipping_range, &camera.clipping_planes);
        Ok(fitted)
    }

    /// Where it stands in the world under a transform.
    fn standing(&self, world_from_camera: &DMat4) -> Standing {
        let [x_axis, y_axis, z_axis] =
            [world_from_camera.x_axis, world_from_camera.y_axis, world_from_camera.z_axis].map(|c| c.truncate());
        let shift = x_axis * self.centre[0] + y_axis * self.centre[1];
        let eye = world_from_camera.w_axis.truncate();
        let (position, look) = if self.is_orthographic {
            (eye + shift - z_axis * self.start_depth, (-z_axis).normalize())
        } else {
            (eye, shift - z_axis)
        };
        Standing {
            position,
            axes: [x_axis, y_axis],
            look,
            right: x_axis * (self.window[0] / f64::from(self.resolution[0])),
            up: y_axis * (self.window[1] / f64::from(self.resolution[1])),
            axis: (-z_axis).normalize(),
            start_depth: self.start_depth * z_axis.length(),
        }
    }

    /// Makes the world point `origin` render space's zero.
    fn stand_about(&mut self, origin: DVec3) {
        self.position = origin;
        self.still = self.standing_at(0.0);
    }

    fn standing_at(&self, time: f64) -> Standing {
        let mut standing = match &self.motion {
            Some(pose) if time != 0.0 => self.standing(&pose.at(time).into()),
            _ => self.standing(&self.world_from_camera),
        };
        standing.position -= self.position;
        standing
    }

    /// The same camera with `lens`, if it has a perspective.
    pub fn with_lens(mut self, lens: Lens) -> Self {
        self.lens = (!self.is_orthographic).then_some(lens);
        self
    }

    /// The same camera with a shutter that opens and closes at these times; it moves as `authored` does. Render space is
    /// then about where it is half-way.
    pub fn with_shutter(mut self, authored: &description::Camera, shutter: [f64; 2]) -> Result<Self> {
        self = self.moving(authored)?;
        self.shutter = shutter;
        let middle = self.position + self.standing_at(0.5 * (shutter[0] + shutter[1])).position;
        self.clipping = self.clipping.moved(middle - self.position);
        self.stand_about(middle);
        Ok(self)
    }

    /// The same camera, which moves as `authored` does but opens at the frame alone.
    pub fn moving(mut self, authored: &description::Camera) -> Result<Self> {
        let place = if authored.path.is_empty() { "camera" } else { &authored.path };
        if let Some(description::Motion { times, transforms }) = &authored.motion {
            let transforms: Vec<_> = transforms.iter().map(DMat4::from_cols_array).collect();
            let is_usable =
                |m: &DMat4| m.is_finite() && m.determinant() != 0.0 && m.row(3) == DVec4::new(0.0, 0.0, 0.0, 1.0);
            let affine = transforms.iter().filter(|m| is_usable(m)).map(|m| DAffine3::from_mat4(*m)).collect();
            let track = Track::new(times.clone(), affine).filter(|_| is_usable(&self.world_from_camera));
            let Some(track) = track else {
                let problem = "its motion is broken: as many affine transforms as increasing times are needed";
                return Err(Error::scene(place, problem));
            };
            self.motion = Some(Pose::moving(DAffine3::from_mat4(self.world_from_camera), track));
        }
        Ok(self)
    }

    /// When a sample is taken: frames from the scene's own.
    pub fn time(&self, sample: &CameraSample) -> f64 {
        let [open, close] = self.shutter;
        open + sample.time * (close - open)
    }

    /// From render space to where the same would be seen at the frame; `None` if that does not change.
    pub fn frame_from_time(&self, time: f64) -> Option<DAffine3> {
        let pose = self.motion.as_ref().filter(|_| time != 0.0)?;
        let origin = DAffine3::from_translation(self.position);
        Some(origin.inverse() * *pose.frame() * pose.at(time).inverse() * origin)
    }

    /// Raster position, x right and y down from the top-left corner, of the render-space point `p` at a time, or of what is
    /// infinitely far in the direction `p`; `None` if it is not in front of a perspective, and for directions in an
    /// orthographic view.
    pub fn raster_of(&self, p: DVec3, is_direction: bool, time: f64) -> Option<DVec2> {
        if is_direction && self.is_orthographic {
            return None;
        }
        let Standing { position, look, right, up, .. } = if time == 0.0 { self.still } else { self.standing_at(time) };
        let offset = if is_direction { p } else { p - position };
        // offset = s look + x right + y up, up to a factor (perspective) or exactly (orthographic).
        let coordinates = DMat3::from_cols(right, up, look).inverse() * offset;
        let [x, y] = if self.is_orthographic {
            [coordinates.x, coordinates.y]
        } else {
            [coordinates.x / coordinates.z, coordinates.y / coordinates.z]
        };
        let [width, height] = self.resolution.map(f64::from);
        let raster = DVec2::new(0.5 * width + x, 0.5 * height - y);
        ((self.is_orthographic || coordinates.z > 0.0) && raster.is_finite()).then_some(raster)
    }

    /// Where it is in render space at a time.
    pub fn position_at(&self, time: f64) -> DVec3 {
        self.standing_at(time).position
    }

    /// Whether it moves.
    pub fn is_moving(&self) -> bool {
        self.motion.is_some()
    }

    /// What is not seen at the frame, in render space.
    pub fn clipping(&self) -> &Clipping {
        &self.clipping
    }

    /// A box in render space that holds the beginnings of all rays through the raster; `None` where it is one point, the
    /// origin.
    pub fn start_box(&self) -> Option<[DVec3; 2]> {
        let reach = |standing: &Standing| match (self.is_orthographic, &self.lens) {
            (true, _) => {
                let [width, height] = self.resolution.map(f64::from);
                [standing.right * (0.5 * width), standing.up * (0.5 * height)]
            }
            (false, Some(lens)) => standing.axes.map(|axis| axis * lens.radius),
            (false, None) => [DVec3::ZERO; 2],
        };
        if !self.is_orthographic && self.lens.is_none() && self.motion.is_none() {
            return None;
        }
        // All of it is linear in the transform, as that is in time.
        let moved = self.motion.iter().flat_map(|pose| pose.times()).map(|&time| self.standing_at(time));
        let corners = moved.chain([self.still]).flat_map(|standing| {
            let [x, y] = reach(&standing);
            [x + y, x - y, y - x, -x - y].map(|corner| standing.position + corner)
        });
        corners.map(|corner| [corner; 2]).reduce(|[min, max], [corner, _]| [min.min(corner), max.max(corner)])
    }

    /// The ray of `sample` with its derivatives per pixel, in render space (relative to [`position`](Self::position)).
    pub fn ray(&self, sample: &CameraSample) -> RayStart {
        self.ray_at(sample, self.time(sample))
    }

    /// The same at a time in frames, whatever the sample's.
    pub fn ray_at(&self, sample: &CameraSample, time: f64) -> RayStart {
        match &self.motion {
            Some(_) if time != 0.0 => self.ray_from(&self.standing_at(time), sample, time),
            _ => self.ray_from(&self.still, sample, time),
        }
    }

    fn ray_from(&self, standing: &Standing, sample: &CameraSample, time: f64) -> RayStart {
        let &Standing { position, axes: [x_axis, y_axis], look, right, up, .. } = standing;
        let [x, y] = sample.raster;
        let x = x - 0.5 * f64::from(self.resolution[0]);
        let y = 0.5 * f64::from(self.resolution[1]) - y;
        if self.is_orthographic {
            return RayStart {
                point: position + (x * right + y * up),
                direction: look,
                point_x: right,
                point_y: up,
                direction_x: DVec3::ZERO,
                direction_y: DVec3::ZERO,
                direction_xx: DVec3::ZERO,
                direction_xy: DVec3::ZERO,
                direction_yy: DVec3::ZERO,
                time,
            };
        }
        let mut big_d = look + x * right + y * up;
        let mut point = position;
        if let Some(lens) = &self.lens {
            let [x, y] = lens.point(sample.lens);
            let from_centre = x * x_axis + y * y_axis;
            point += from_centre;
            big_d -= from_centre / lens.focus;
        }
        let length = big_d.length();
        let direction = big_d / length;
        let (a, b) = (right / length, up / length);
        // d' = a − (d·a) d for a unit d; differentiating once more, with |D|' / |D| = d·a:
        // d_ab = −(d·b) a_⊥ − (d·a) b_⊥ − (a_⊥·b_⊥) d, where a_⊥ = d_a.
        let (along_a, along_b) = (direction.dot(a), direction.dot(b));
        let d_a = a - along_a * direction;
        let d_b = b - along_b * direction;
        let second = |along_a: f64, d_a: DVec3, along_b: f64, d_b: DVec3| {
            -along_b * d_a - along_a * d_b - d_a.dot(d_b) * direction
        };
        RayStart {
            point,
            direction,
            point_x: DVec3::ZERO,
            point_y: DVec3::ZERO,
            direction_x: d_a,
            direction_y: d_b,
            direction_xx: second(along_a, d_a, along_a, d_a),
            direction_xy: second(along_a, d_a, along_b, d_b),
            direction_yy: second(along_b, d_b, along_b, d_b),
            time,
        }
    }

    /// Where the image's centre stands in camera space, in the units of [`window`](Self::window).
    pub fn window_centre(&self) -> (f64, f64) {
        (self.centre[0], self.centre[1])
    }

    /// Distance of the render-space point `p` from the camera at a time, along its axis.
    pub fn depth(&self, p: DVec3, time: f64) -> f64 {
        let moved = self.motion.as_ref().filter(|_| time != 0.0).map(|_| self.standing_at(time));
        let &Standing { position, axis, start_depth, .. } = moved.as_ref().unwrap_or(&self.still);
        (p - position).dot(axis) + start_depth
    }
}

#[cfg(test)]
mod tests;
