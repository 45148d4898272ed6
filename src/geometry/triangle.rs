//! Ray against triangle, watertight in f64.
//!
//! Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection", JCGT 2(1): corners relative to the origin of the ray
//! are sheared so that the ray is the z axis, and the signs of three edge functions decide. A corner is projected to the
//! same two numbers for every triangle that has it, so the projected mesh is a planar figure whose edges are shared.
//!
//! Two deviations make the decision exact for that figure, where the paper includes all borders:
//! * The sign of a rounded difference of rounded products is never wrong, but it may be 0 where the exact one is not.
//!   Then the difference of the products' rounding errors, which are floating-point numbers themselves, has the sign.
//! * Where the exact edge function is 0 the ray is thought moved by (ε, ε²), ε → 0 (Edelsbrunner, Mücke 1990, "Simulation
//!   of simplicity"). So a ray through an edge or a vertex crosses just the triangles that a ray beside it crosses: each
//!   sheet of a closed mesh once, and as many inward as outward.

use glam::{DVec2, DVec3};

/// A ray prepared for triangles in its own space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    /// In the order of `axes`.
    origin: DVec3,
    /// Axes that become x, y, z; z is the largest component of the direction, handedness is kept.
    axes: [Axis; 3],
    shear: DVec2,
    per_z: f64,
}

/// An index below 3, so that nobody checks it again.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

/// A corner as it is stored, or as it is computed where points move.
pub(crate) trait Corner: Copy {
    fn along(self, axis: Axis) -> f64;

    #[inline(always)]
    fn wide(self) -> DVec3 {
        DVec3::new(self.along(Axis::X), self.along(Axis::Y), self.along(Axis::Z))
    }
}

impl Corner for &[f32; 3] {
    #[inline(always)]
    fn along(self, axis: Axis) -> f64 {
        f64::from(self[axis as usize])
    }
}

impl Corner for [f64; 3] {
    #[inline(always)]
    fn along(self, axis: Axis) -> f64 {
        self[axis as usize]
    }
}

/// A triangle that the line of the ray crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    /// Along the direction as given, of either sign.
    pub(crate) distance: f64,
    /// Weights of the second and the third corner.
    pub(crate) barycentric: [f64; 2],
    /// direction · ((b − a) × (c − a)) > 0.
    pub(crate) leaving: bool,
}

impl ShearedRay {
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Self {
        let size = direction.abs();
        let [mut x, mut y, z] = if size.x >= size.y && size.x >= size.z {
            [Axis::Y, Axis::Z, Axis::X]
        } else if size.y >= size.z {
            [Axis::Z, Axis::X, Axis::Y]
        } else {
            [Axis::X, Axis::Y, Axis::Z]
        };
        let (from, along) = (origin.to_array(), direction.to_array());
        if along[z as usize] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        let per_z = 1.0 / along[z as usize];
        let shear = DVec2::new(along[x as usize] * per_z, along[y as usize] * per_z);
        let origin = DVec3::new(from[x as usize], from[y as usize], from[z as usize]);
        Self { origin, axes: [x, y, z], shear, per_z }
    }

    /// The corner in the sheared frame; z is the distance along the ray.
    #[inline(always)]
    fn project(&self, p: impl Corner) -> (DVec2, f64) {
        let [x, y, z] = self.axes.map(|axis| p.along(axis));
        let height = z - self.origin.z;
        let across = DVec2::new(x - self.origin.x, y - self.origin.y);
        (across - self.shear * height, height * self.per_z)
    }

    /// The crossing of the ray's line with a triangle.
    #[inline(always)]
    pub(crate) fn intersect(&self, corners: [impl Corner; 3]) -> Option<TriangleHit> {
        let (a, az) = self.project(corners[0]);
        let (b, bz) = self.project(corners[1]);
        let (c, cz) = self.project(corners[2]);
        let mut edges = [edge(b, c), edge(c, a), edge(a, b)];
        // Most candidates end here; exact tails cannot bring them back, for they only move edges that are 0.
        if are_mixed(edges) {
            return None;
        }
        if edges.contains(&0.0) {
            edges = settle(edges, [a, b, c])?;
        }
        let [u, v, w] = edges;
        let det = u + v + w;
        // Only a triangle seen exactly from its edge has no area now.
        if det == 0.0 {
            return None;
        }
        let (u, v, w) = (u / det, v / det, w / det);
        Some(TriangleHit { distance: u * az + v * bz + w * cz, barycentric: [v, w], leaving: det > 0.0 })
    }
}

/// Twice the area of (0, a, b): the sign is that of the exact value, or 0. Exactly antisymmetric.
#[inline(always)]
fn edge(a: DVec2, b: DVec2) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Whether the ray passes on different sides of the edges. No branches: each sign would be a coin toss.
#[inline(always)]
fn are_mixed([u, v, w]: [f64; 3]) -> bool {
    ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0))
}

/// Edge functions with exact signs, if those and the displacement where they are 0 say that the triangle is crossed.
#[cold]
fn settle(mut edges: [f64; 3], [a, b, c]: [DVec2; 3]) -> Option<[f64; 3]> {
    let ends = [(b, c), (c, a), (a, b)];
    for (edge, (a, b)) in edges.iter_mut().zip(ends) {
        if *edge == 0.0 {
            *edge = edge_tail(a, b);
        }
    }
    if are_mixed(edges) {
        return None;
    }
    if edges.contains(&0.0) {
        let [u, v, w] = [0, 1, 2].map(|i| displaced_sign(edges[i], ends[i].0, ends[i].1));
        if u == 0 || v != u || w != u {
            return None;
        }
    }
    Some(edges)
}

/// The products are equal when rounded: what is left is the difference of what their rounding cut off.
fn edge_tail(a: DVec2, b: DVec2) -> f64 {
    // `mul_add` is slow without FMA hardware, and rare.
    a.x.mul_add(b.y, -(a.x * b.y)) - a.y.mul_add(b.x, -(a.y * b.x))
}

/// Sign of the edge function at the point (ε, ε²): e − ε (b.y − a.y) + ε² (b.x − a.x).
fn displaced_sign(e: f64, a: DVec2, b: DVec2) -> i8 {
    for term in [e, a.y - b.y, b.x - a.x] {
        if term != 0.0 {
            return if term > 0.0 { 1 } else { -1 };
        }
    }
    0
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the law under test")]
mod tests {
    use super::*;

    fn hit(origin: [f64; 3], direction: [f64; 3], corners: [[f32; 3]; 3]) -> Option<TriangleHit> {
        ShearedRay::new(origin.into(), direction.into()).intersect(corners.each_ref())
    }

    const FACE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn the_side_is_that_of_the_normal() {
        for (axis, direction) in [(0, 1.0), (1, 1.0), (2, 1.0), (0, -1.0), (1, -1.0), (2, -1.0)] {
            let turn = |p: [f64; 3]| [p[(3 - axis) % 3], p[(4 - axis) % 3], p[(5 - axis) % 3]];
            let corners = FACE.map(|p| turn(p.map(f64::from)).map(|x| x as f32));
            let h = hit(turn([0.25, 0.25, -2.0 * direction]), turn([0.0, 0.0, direction]), corners).expect("inside");
            let n_g = DVec3::from(turn([0.0, 0.0, 1.0]));
            assert_eq!(h.leaving, n_g.dot(turn([0.0, 0.0, direction]).into()) > 0.0);
            assert_eq!(h.distance, 2.0);
            assert_eq!(h.barycentric, [0.25, 0.25]);
        }
    }

    #[test]
    fn two_triangles_share_their_edge_without_gap_or_overlap() {
        let other = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for i in 1..64 {
            let s = f64::from(i) / 64.0;
            for z in [-3.0, 3.0] {
                let count = [FACE, other]
                    .iter()
                    .filter(|&&t| hit([s, 1.0 - s, z], [0.0, 0.0, -z.signum()], t).is_some())
                    .count();
                assert_eq!(count, 1);
            }
        }
    }

    #[test]
    fn degenerate_triangles_are_not_met() {
        let up = [0.0, 0.0, 1.0];
        assert_eq!(hit([0.0, 0.0, -1.0], up, [[0.0; 3]; 3]), None);
        assert_eq!(hit([0.5, 0.0, -1.0], up, [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), None);
        assert_eq!(hit([0.1, 0.1, 0.0], [1.0, 0.0, 0.0], FACE), None, "in its plane");
        for size in [1e-36_f32, 1e36] {
            let s = f64::from(size);
            let corners = FACE.map(|p| p.map(|x| x * size));
            let h = hit([0.25 * s, 0.25 * s, -s], up, corners).expect("inside");
            assert!((h.distance / s - 1.0).abs() < 1e-15);
        }
    }
}
