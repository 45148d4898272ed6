//! Cameras: where rays begin, and how they move with the pixel.
//!
//! A direction is d = D/|D| with D = look + x·right + y·up (Igehy 1999, eq. 8); x and y are in pixels, +x right and
//! +y up. Depth of field is not part of the specular chain: its ray starts at the centre of the lens.

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
    /// Where the image's centre stands in the window, in its units (the aperture offsets).
    centre: [f64; 2],
    resolution: [u32; 2],
}

impl Camera {
    /// Fits `camera` to an image of `resolution` pixels.
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
        let (position, look) = if is_orthographic {
            (world_from_camera.w_axis.truncate() + shift, (-z_axis).normalize())
        } else {
            (world_from_camera.w_axis.truncate(), shift - z_axis)
        };
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
            centre: offset,
            resolution,
        })
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
        let big_d = self.look + x * self.right + y * self.up;
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
            point: DVec3::ZERO,
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
        p.dot(self.axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let description = description::Camera {
            path: "/cam".into(),
            transform: DMat4::from_rotation_y(0.3).to_cols_array(),
            projection: "perspective".into(),
            horizontal_aperture: 36.0,
            vertical_aperture: 24.0,
            horizontal_aperture_offset: 3.0,
            vertical_aperture_offset: -2.0,
            focal_length: 35.0,
            clipping_range: None,
            f_stop: 0.0,
            focus_distance: 0.0,
            shutter_open: 0.0,
            shutter_close: 0.0,
        };
        Camera::new(&description, [60, 40], 1.0, ConformPolicy::ExpandAperture).unwrap()
    }

    #[test]
    fn derivatives_are_those_of_the_rays() {
        let camera = camera();
        let (x, y) = (11.5, 7.25);
        let at = |dx: f64, dy: f64| camera.ray(&CameraSample::at(x + dx, y - dy));
        let h = 1e-4;
        let start = at(0.0, 0.0);
        let check = |name: &str, analytic: DVec3, difference: DVec3, tolerance: f64| {
            let scale = start.direction_x.length();
            assert!((analytic - difference).length() <= tolerance * scale, "{name}: {analytic} against {difference}");
        };
        check("x", start.direction_x, (at(h, 0.0).direction - at(-h, 0.0).direction) / (2.0 * h), 1e-9);
        check("y", start.direction_y, (at(0.0, h).direction - at(0.0, -h).direction) / (2.0 * h), 1e-9);
        check("xx", start.direction_xx, (at(h, 0.0).direction_x - at(-h, 0.0).direction_x) / (2.0 * h), 1e-9);
        check("xy", start.direction_xy, (at(0.0, h).direction_x - at(0.0, -h).direction_x) / (2.0 * h), 1e-9);
        check("yy", start.direction_yy, (at(0.0, h).direction_y - at(0.0, -h).direction_y) / (2.0 * h), 1e-9);
    }

    #[test]
    fn the_second_derivative_keeps_the_length() {
        let start = camera().ray(&CameraSample::at(3.0, 30.0));
        let residual = start.direction_x.length_squared() + start.direction.dot(start.direction_xx);
        assert!(residual.abs() <= 1e-16, "{residual}");
    }
}
