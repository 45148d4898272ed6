//! An instance made ready at one time: transforms both ways, and how large the numbers are that they round.

use std::ops::Deref;

use glam::{DAffine3, DMat3, DVec3};

use super::start::UNIT_ROUNDOFF;
use super::tree::Bounds;
use super::{Ray, Shape};

/// Relative deviation from a similarity that rounding alone explains: a few products of matrices.
const SIMILARITY: f64 = 64.0 * f64::EPSILON;
/// Rounding of a box on its way through a transform, in units of 2^-53 times what was added up.
pub(super) const BOX_ERRORS: f64 = 32.0;

/// A shape in render space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed<'a> {
    pub(super) shape: &'a Shape,
    pub(super) frame: &'a Frame,
    /// When: frames from the scene's own.
    pub(super) time: f64,
}

impl Deref for Placed<'_> {
    type Target = Frame;

    fn deref(&self) -> &Frame {
        self.frame
    }
}

/// Where an instance stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Render space from object space.
    pub(super) linear: DMat3,
    pub(super) translation: DVec3,
    pub(super) inverse: DMat3,
    /// Scale factor, if the transform keeps angles.
    pub(super) similarity: Option<f64>,
    norm: f64,
    inverse_norm: f64,
    /// Largest coordinate of the translation.
    offset: f64,
}

/// A ray in object space.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObjectRay {
    pub(super) origin: DVec3,
    /// Unit vector.
    pub(super) direction: DVec3,
    /// Object-space length of a unit of render space along the ray.
    pub(super) stretch: f64,
}

impl Frame {
    /// For a transform that [`is_invertible`], in a render space whose zero is the world's point `origin`.
    pub(super) fn new(world_from_object: &DAffine3, origin: DVec3) -> Self {
        let DAffine3 { matrix3: linear, translation } = *world_from_object;
        let inverse = inverse(linear);
        Self {
            linear,
            translation: translation - origin,
            inverse,
            similarity: similarity(linear),
            norm: norm(linear),
            inverse_norm: norm(inverse),
            offset: (translation - origin).abs().max_element(),
        }
    }

    /// How many times a transform there and back enlarges rounding errors; ≥ 1.
    pub(super) fn condition(&self) -> f64 {
        (self.norm * self.inverse_norm).max(1.0)
    }

    /// |L||v| + |t| for coordinates up to `extent`.
    pub(super) fn reach_of(&self, extent: f64) -> f64 {
        self.norm * extent + self.offset
    }

    /// The size of the numbers rounded on the way of a ray's start to object space (`start.rs`). `magnitude` is |p| + reach
    /// in render space.
    pub(super) fn start_magnitude(&self, magnitude: f64, ray: &ObjectRay) -> f64 {
        let there = magnitude + self.offset + self.norm * ray.origin.abs().max_element();
        self.inverse_norm * there
    }

    pub(super) fn ray(&self, ray: &Ray) -> ObjectRay {
        let direction = self.inverse * ray.direction;
        let stretch = direction.length();
        let origin = self.inverse * (ray.origin - self.translation);
        ObjectRay { origin, direction: direction / stretch, stretch }
    }

    pub(super) fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.translation
    }

    /// A normal or another covector in render space; outward stays outward under mirrored transforms.
    pub(super) fn covector(&self, n: DVec3) -> DVec3 {
        self.inverse.transpose() * n
    }
}

impl Placed<'_> {
    /// Bounds in render space, outward by the rounding of the transforms; `None` for a shape without extent.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        let transform = DAffine3 { matrix3: self.linear, translation: self.translation };
        bounds_under(&transform, self.shape, self.condition())
    }

    /// Whether some of the surface may lie within `search`, in render space; a no is certain. What stands inside of a room
    /// without touching it is in its bounds, and in the box of none of its triangles.
    pub(super) fn may_meet(&self, search: &Bounds) -> bool {
        let Shape::Mesh(mesh) = self.shape else { return true };
        let center = self.inverse * (0.5 * (search.min + search.max) - self.translation);
        let half = absolute(self.inverse) * (0.5 * (search.max - search.min));
        let rounded = search.reach() + self.reach_of(extent(self.shape));
        let half = half + DVec3::splat(BOX_ERRORS * UNIT_ROUNDOFF * self.inverse_norm * rounded * self.condition());
        mesh.may_meet(&Bounds { min: center - half, max: center + half })
    }

    /// |L||v| + |t| at any point.
    pub(super) fn largest_reach(&self) -> f64 {
        self.reach_of(extent(self.shape))
    }

    /// |L||v| + |t| at a primitive: what rounding a point of it in render space is relative to.
    pub(super) fn reach(&self, primitive: u32) -> f64 {
        let extent = match self.shape {
            Shape::Sphere(sphere) => sphere.radius(),
            Shape::Solid(solid) => solid.extent(),
            Shape::Mesh(mesh) => mesh.reach(primitive, self.time),
        };
        self.reach_of(extent)
    }
}

/// |L||v| + |t| at any point of a shape under a transform to render space.
pub(super) fn largest_reach(transform: &DAffine3, shape: &Shape) -> f64 {
    norm(transform.matrix3) * extent(shape) + transform.translation.abs().max_element()
}

/// Bounds of a shape under a transform to render space whose rounding is enlarged `condition` times; outward by that.
pub(super) fn bounds_under(transform: &DAffine3, shape: &Shape, condition: f64) -> Option<Bounds> {
    let &DAffine3 { matrix3: linear, translation } = transform;
    let about =
        |[min, max]: [DVec3; 2]| (linear * (0.5 * (min + max)) + translation, absolute(linear) * (0.5 * (max - min)));
    let (center, half) = match shape {
        Shape::Sphere(sphere) => {
            // The extent of the ellipsoid L·S² along an axis is the length of that row of L.
            let rows = linear.transpose();
            let half = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
            (translation, half * sphere.radius())
        }
        Shape::Solid(solid) => about(solid.bounds()),
        Shape::Mesh(mesh) => about(mesh.bounds()?),
    };
    let magnitude = (norm(linear) * extent(shape) + translation.abs().max_element()) * condition;
    let error = DVec3::splat(BOX_ERRORS * UNIT_ROUNDOFF * magnitude);
    Some(Bounds { min: center - half - error, max: center + half + error })
}

/// Largest coordinate of a shape in object space.
fn extent(shape: &Shape) -> f64 {
    match shape {
        Shape::Sphere(sphere) => sphere.radius(),
        Shape::Solid(solid) => solid.extent(),
        Shape::Mesh(mesh) => mesh.bounds().map_or(0.0, |[min, max]| min.abs().max(max.abs()).max_element()),
    }
}

/// Longest to shortest direction of a transform that places anything. The boxes of the trees are padded by 2^-49 times as much
/// ([`walk`](super::walk)), for every instance beside it: a sheet thinner than this is nothing to the digits of its rays.
const FLATTEST: f64 = 1_099_511_627_776.0;

/// Whether the inverse exists to working precision: the volume is compared with that of the columns' box, so scale is free.
pub(crate) fn is_invertible(transform: &DAffine3) -> bool {
    let m = transform.matrix3;
    let box_volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let inverse = transform.inverse();
    m.determinant().abs() > 1e-14 * box_volume && inverse.is_finite() && norm(m) * norm(inverse.matrix3) <= FLATTEST
}

/// The inverse, by way of a power of two so that determinants of tiny and huge transforms do not under- or overflow.
fn inverse(m: DMat3) -> DMat3 {
    let (_, exponent) = libm::frexp(absolute(m).to_cols_array().into_iter().fold(0.0, f64::max));
    let scale = libm::ldexp(1.0, (-exponent).clamp(-1022, 1022));
    (m * scale).inverse() * scale
}

/// Largest row sum of absolute values: the norm that belongs to the largest coordinate.
fn norm(m: DMat3) -> f64 {
    (absolute(m) * DVec3::ONE).max_element()
}

fn absolute(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// The scale factor of a transform that keeps angles: LᵀL = s² I up to rounding.
fn similarity(m: DMat3) -> Option<f64> {
    let gram = m.transpose() * m;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let rest = absolute(gram - DMat3::from_diagonal(DVec3::splat(mean)));
    let off = rest.to_cols_array().into_iter().fold(0.0, f64::max);
    (off <= SIMILARITY * mean).then(|| mean.sqrt())
}
