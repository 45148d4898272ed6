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

use glam::{DMat4, DVec3};

use crate::error::{Error, Result};
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
    /// D at the image's centre (perspective), the common direction (orthographic).
    look: DVec3,
    /// ∂D/∂x (∂p/∂x if orthographic) per pixel.
    right: DVec3,
    /// ∂D/∂y (∂p/∂y if orthographic) per pixel.
    up: DVec3,
    /// The unit axis along which depth is measured.
    axis: DVec3,
    /// Depth of the points where rays begin: less than 0 where an orthographic view begins behind its camera.
    start_depth: f64,
    /// Where the image's centre stands in the window, in its units (the aperture offsets).
    centre: [f64; 2],
    resolution: [u32; 2],
    /// x and y of camera space, and the lens in it; a pinhole without.
    lens: Option<([DVec3; 2], Lens)>,
    clipping: Clipping,
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
        let [x_axis, y_axis, z_axis] =
            [world_from_camera.x_axis, world_from_camera.y_axis, world_from_camera.z_axis].map(|c| c.truncate());
        let shift = x_axis * offset[0] + y_axis * offset[1];
        let clipping_range = camera.clipping_range.filter(|[near, far]| near < far);
        // Parallel rays may begin behind their camera; those of a perspective begin in it.
        let behind = clipping_range.map_or(0.0, |[near, _]| near.min(0.0));
        let eye = world_from_camera.w_axis.truncate();
        let (position, look, start_depth) = if is_orthographic {
            (eye + shift - z_axis * behind, (-z_axis).normalize(), behind)
        } else {
            (eye, shift - z_axis, 0.0)
        };
        let camera_from_render = world_from_camera.inverse() * DMat4::from_translation(position);
        Ok(Self {
            position,
            pixel_aspect_ratio,
            world_from_camera,
            window,
            is_orthographic,
            look,
            right: x_axis * (window[0] / f64::from(resolution[0])),
            up: y_axis * (window[1] / f64::from(resolution[1])),
            axis: (-z_axis).normalize(),
            start_depth: start_depth * z_axis.length(),
            centre: offset,
            resolution,
            lens: None,
            clipping: Clipping::new(&camera_from_render, clipping_range, &camera.clipping_planes),
        })
    }

    /// The same camera with `lens`, if it has a perspective.
    pub fn with_lens(mut self, lens: Lens) -> Self {
        let [x_axis, y_axis] = [self.world_from_camera.x_axis, self.world_from_camera.y_axis].map(|c| c.truncate());
        self.lens = (!self.is_orthographic).then_some(([x_axis, y_axis], lens));
        self
    }

    /// What is not seen, in render space.
    pub fn clipping(&self) -> &Clipping {
        &self.clipping
    }

    /// A box in render space that holds the beginnings of all rays through the raster; `None` where it is one point, the
    /// origin.
    pub fn start_box(&self) -> Option<[DVec3; 2]> {
        let corners = match (self.is_orthographic, &self.lens) {
            (true, _) => {
                let [width, height] = self.resolution.map(f64::from);
                let corner = |x, y| self.ray(&CameraSample::at(x, y)).point;
                [corner(0.0, 0.0), corner(0.0, height), corner(width, 0.0), corner(width, height)]
            }
            (false, Some(([x_axis, y_axis], lens))) => {
                let [x, y] = [*x_axis * lens.radius, *y_axis * lens.radius];
                [x + y, x - y, y - x, -x - y]
            }
            (false, None) => return None,
        };
        Some(corners[1..].iter().fold([corners[0]; 2], |[min, max], corner| [min.min(*corner), max.max(*corner)]))
    }

    /// The ray of `sample` with its derivatives per pixel, in render space (relative to [`position`](Self::position)).
    pub fn ray(&self, sample: &CameraSample) -> RayStart {
        let [x, y] = sample.raster;
        let x = x - 0.5 * f64::from(self.resolution[0]);
        let y = 0.5 * f64::from(self.resolution[1]) - y;
        if self.is_orthographic {
            return RayStart {
                point: x * self.right + y * self.up,
                direction: self.look,
                point_x: self.right,
                point_y: self.up,
                direction_x: DVec3::ZERO,
                direction_y: DVec3::ZERO,
                direction_xx: DVec3::ZERO,
                direction_xy: DVec3::ZERO,
                direction_yy: DVec3::ZERO,
                time: 0.0,
            };
        }
        let mut big_d = self.look + x * self.right + y * self.up;
        let mut point = DVec3::ZERO;
        if let Some(([x_axis, y_axis], lens)) = &self.lens {
            let [x, y] = lens.point(sample.lens);
            point = x * *x_axis + y * *y_axis;
            big_d -= point / lens.focus;
        }
        let length = big_d.length();
        let direction = big_d / length;
        let (a, b) = (self.right / length, self.up / length);
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
            time: 0.0,
        }
    }

    /// Where the image's centre stands in camera space, in the units of [`window`](Self::window).
    pub fn window_centre(&self) -> (f64, f64) {
        (self.centre[0], self.centre[1])
    }

    /// Distance of the render-space point `p` from the camera, along its axis.
    pub fn depth(&self, p: DVec3) -> f64 {
        p.dot(self.axis) + self.start_depth
    }
}

#[cfg(test)]
mod tests;
