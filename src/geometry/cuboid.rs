//! Boxes and rectangles about the origin, with sides along the axes.
//!
//! A box is the intersection of three slabs, so a line enters it where it enters the last slab and leaves it where it leaves
//! the first (Kay, Kajiya 1986). Slabs and rectangles hold their lower border and not their upper one.

use glam::DVec3;

use super::solid::{Axis, Bend, Border, Borders, Piece};

/// A box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    half: DVec3,
}

/// A rectangle with the normal +axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    axis: Axis,
    /// 0 along the axis.
    half: DVec3,
}

fn is_size(x: f64) -> bool {
    x > 0.0 && x.is_finite()
}

impl Cuboid {
    /// A box with sides of the given lengths; `None` unless they are positive and finite.
    pub fn new(sides: DVec3) -> Option<Self> {
        sides.to_array().into_iter().all(is_size).then_some(Self { half: 0.5 * sides })
    }

    pub(super) fn bounds(&self) -> [DVec3; 2] {
        [-self.half, self.half]
    }

    /// Faces are numbered −x, +x, −y, +y, −z, +z.
    pub(super) fn borders(&self, origin: DVec3, direction: DVec3, standing: Option<u32>) -> Borders {
        let mut borders = Borders::new();
        let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        for axis in 0..3 {
            let (o, d, h) = (origin[axis], direction[axis], self.half[axis]);
            let face = |high: bool| 2 * axis as u32 + u32::from(high);
            if d == 0.0 {
                let on_face = standing.is_some_and(|s| s as usize / 2 == axis);
                if !(on_face || (-h <= o && o < h)) {
                    return borders;
                }
                continue;
            }
            let at = |high: bool| {
                let plane = if high { h } else { -h };
                if standing == Some(face(high)) { 0.0 } else { (plane - o) / d }
            };
            let near = d < 0.0;
            let (from, to) = (at(near), at(!near));
            if from > enter.0 {
                enter = (from, face(near));
            }
            if to < leave.0 {
                leave = (to, face(!near));
            }
        }
        if enter.0 < leave.0 {
            borders.push(Border { distance: enter.0, primitive: enter.1, leaving: false });
            borders.push(Border { distance: leave.0, primitive: leave.1, leaving: true });
        }
        borders
    }

    pub(super) fn piece(&self, primitive: u32, p: DVec3) -> Piece {
        let axis = (primitive / 2) as usize % 3;
        let sign = if primitive % 2 == 1 { 1.0 } else { -1.0 };
        let mut gradient = DVec3::ZERO;
        gradient[axis] = sign;
        Piece { value: sign * p[axis] - self.half[axis], gradient, bend: Bend::Plane }
    }

    pub(super) fn covers(&self, p: DVec3, error: f64) -> bool {
        p.abs().cmple(self.half + error).all()
    }
}

impl Rectangle {
    /// A rectangle with the normal +`axis` and the sides of UsdGeomPlane: the width runs along x, along z for the axis X;
    /// the length along y, along z for the axis Y. `None` unless both are positive and finite.
    pub fn new(width: f64, length: f64, axis: Axis) -> Option<Self> {
        let sides = match axis {
            Axis::X => DVec3::new(0.0, length, width),
            Axis::Y => DVec3::new(width, 0.0, length),
            Axis::Z => DVec3::new(width, length, 0.0),
        };
        (is_size(width) && is_size(length)).then_some(Self { axis, half: 0.5 * sides })
    }

    pub(super) fn bounds(&self) -> [DVec3; 2] {
        [-self.half, self.half]
    }

    pub(super) fn borders(&self, origin: DVec3, direction: DVec3, standing: Option<u32>) -> Borders {
        let mut borders = Borders::new();
        let axis = self.axis.index();
        let d = direction[axis];
        if d == 0.0 || standing.is_some() {
            return borders;
        }
        let distance = -origin[axis] / d;
        let p = origin + distance * direction;
        let holds = |i: usize| -self.half[i] <= p[i] && p[i] < self.half[i];
        if (0..3).all(|i| i == axis || holds(i)) {
            borders.push(Border { distance, primitive: 0, leaving: d > 0.0 });
        }
        borders
    }

    pub(super) fn piece(&self, p: DVec3) -> Piece {
        let mut gradient = DVec3::ZERO;
        gradient[self.axis.index()] = 1.0;
        Piece { value: p[self.axis.index()], gradient, bend: Bend::Plane }
    }

    pub(super) fn covers(&self, p: DVec3, error: f64) -> bool {
        p.abs().cmple(self.half + error).all()
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the law under test")]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_an_edge_crosses_once_or_not_at_all() {
        let cube = Cuboid::new(DVec3::splat(2.0)).expect("a cube");
        let count =
            |o: [f64; 3], d: [f64; 3]| cube.borders(o.into(), DVec3::from(d).normalize(), None).as_slice().len();
        assert_eq!(count([0.0, 0.0, -3.0], [0.0, 0.0, 1.0]), 2);
        assert_eq!(count([-1.0, 0.5, -3.0], [0.0, 0.0, 1.0]), 2);
        assert_eq!(count([1.0, 0.5, -3.0], [0.0, 0.0, 1.0]), 0);
        assert_eq!(count([-2.0, 0.5, 0.0], [1.0, 0.0, 1.0]), 0, "touches an edge");
        assert_eq!(count([-3.0, -3.0, -3.0], [1.0, 1.0, 1.0]), 2);
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Cuboid::new(DVec3::new(1.0, size, 1.0)), None);
            assert_eq!(Rectangle::new(1.0, size, Axis::X), None);
        }
    }

    #[test]
    fn width_and_length_run_along_the_axes_that_usd_says() {
        let bounds = |axis| Rectangle::new(2.0, 6.0, axis).expect("a plane").bounds()[1];
        assert_eq!(bounds(Axis::Z), DVec3::new(1.0, 3.0, 0.0));
        assert_eq!(bounds(Axis::Y), DVec3::new(1.0, 0.0, 3.0));
        assert_eq!(bounds(Axis::X), DVec3::new(0.0, 3.0, 1.0));
    }
}
