//! The analytic sphere.

/// A sphere about the origin of its object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    radius: f64,
}

impl Sphere {
    /// A sphere of the given radius; `None` unless it is positive and finite.
    pub fn new(radius: f64) -> Option<Self> {
        (radius > 0.0 && radius.is_finite()).then_some(Self { radius })
    }

    /// Its radius, object units.
    pub fn radius(&self) -> f64 {
        self.radius
    }
}
