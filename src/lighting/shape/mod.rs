//! Shapes that shine, in render space: a point of one for a receiver, its density per solid angle, and where a ray meets one.
//!
//! Each shape has three functions that agree: `sample` draws a direction, `pdf` is the density with which it would have
//! drawn the direction of a ray that met the shape, `meet` finds what rays meet. Where a shape shines to one side only, none of
//! them knows the other.

mod disk;
mod ellipsoid;
mod rectangle;
mod ring;
mod triangle;
mod tube;

use glam::{DMat3, DVec3};

pub(super) use disk::Disk;
pub(super) use ellipsoid::Ellipsoid;
pub(super) use rectangle::Rectangle;
pub(super) use ring::{Ring, Rings};
pub(super) use triangle::Triangle;
pub(super) use tube::{Line, Tube};

/// A direction to a point of a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Toward {
    /// Unit vector from the receiver.
    pub(super) wi: DVec3,
    /// To the point; infinite for what is infinitely far.
    pub(super) distance: f64,
    /// Density per solid angle.
    pub(super) pdf_solid_angle: f64,
}

/// Two unit vectors that make a right-handed frame with the unit vector `z` (T. Duff et al., "Building an orthonormal basis,
/// revisited", JCGT 6(1), 2017).
pub(super) fn frame(z: DVec3) -> [DVec3; 2] {
    let sign = 1f64.copysign(z.z);
    let a = -1.0 / (sign + z.z);
    let b = z.x * z.y * a;
    [DVec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x), DVec3::new(b, sign + z.y * z.y * a, -z.y)]
}

/// A linear map of directions, both ways, and how densities per solid angle change under it.
#[derive(Clone, Debug)]
pub(super) struct Directions {
    pub(super) render_from_local: DMat3,
    pub(super) local_from_render: DMat3,
    determinant: f64,
}

impl Directions {
    pub(super) fn new(render_from_local: DMat3) -> Self {
        let local_from_render = render_from_local.inverse();
        Self { render_from_local, local_from_render, determinant: render_from_local.determinant().abs() }
    }

    /// Density per solid angle of render space of one in local space, where a unit vector there has the image of length
    /// `stretch` here: dω = |det| dω_local / stretch³.
    pub(super) fn density(&self, local: f64, stretch: f64) -> f64 {
        local * (stretch * stretch * stretch) / self.determinant
    }
}
