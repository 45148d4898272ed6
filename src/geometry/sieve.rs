//! Four triangles at a time: which of them a ray may cross, told in f32 so that none that it does cross is missed.
//!
//! The test is that of `triangle.rs`, in the units of a tree's boxes (all coordinates ≤ 1 in size) and with a bound on its error. Let
//! u = 2^-24, o the origin from which the ray walks, d = v − o for a corner v, S ≤ 1 in size the shear, x' = dx − S dz. Then:
//!
//! * v and o are rounded, by u|v| ≤ u(|o| + |d|) and u|o|; so is their difference: d errs by u(2|o| + 2|d|).
//! * S errs by 4 u; with the product and the difference x' errs by u(4|o| + 2|dx| + 7|dz| + |x'|), where |dx| ≤ |x'| + |dz|.
//! * The ray that decides is beside the one that walks by no more than the padding of the boxes, p: it shifts x' by 2 p.
//!
//! Together less than ε = 2 p + 12 u (|o| + |dz| + |x'|). An edge function a × b of coordinates up to m errs by 4 ε m + 2 ε² for that
//! and by 4 u m² ≤ ε m / 2 for its own rounding. What reads as more than 5 ε m + 2 ε² has the sign it shows; the factors are rounded up
//! for the rounding of the bound itself. The distances of the corners along the ray err by ε over the largest component of the
//! direction, at least 3^-½.

use glam::{DVec3, Vec4};

use super::tree::{Tree, round_up};
use super::walk::{Moved, Sift};

/// 12 u.
const RELATIVE: f32 = 12.0 / 16_777_216.0;
/// Room for the rounding of transforms to the space of the boxes, of which the padding of the walk knows nothing: 2^-36.
pub(super) const PLACING: f32 = 1.0 / 68_719_476_736.0;

/// Four triangles, lane by lane. A lane that is not a number is always passed.
#[derive(Clone, Copy, Debug)]
struct Pack {
    /// Corner by corner, axis by axis.
    corners: [[Vec4; 3]; 3],
    /// How far the corners are apart at most: the sum over the axes.
    size: Vec4,
}

/// The triangles in the leaves of a tree.
#[derive(Debug)]
pub(super) struct Packs {
    packs: Vec<Pack>,
}

impl Packs {
    /// One per leaf of a tree. `corners_of` says where a primitive is, in the tree's
    /// own units; `None` if it is no triangle.
    pub(super) fn new(tree: &Tree, corners_of: impl Fn(u32) -> Option<[DVec3; 3]>) -> Self {
        let pack = |leaf: &[u32]| {
            let mut pack = Pack { corners: [[Vec4::NAN; 3]; 3], size: Vec4::NAN };
            for (lane, &primitive) in leaf.iter().enumerate() {
                let Some(corners) = corners_of(primitive) else { continue };
                for (corner, point) in pack.corners.iter_mut().zip(corners) {
                    for (axis, along) in corner.iter_mut().zip((point * tree.scale).to_array()) {
                        axis[lane] = along as f32;
                    }
                }
                let [a, b, c] = corners.map(|corner| corner * tree.scale);
                let extent = (a.max(b).max(c) - a.min(b).min(c)).element_sum();
                pack.size[lane] = round_up(DVec3::splat(extent)).x;
            }
            pack
        };
        Self { packs: tree.order.chunks(4).map(pack).collect() }
    }
}

/// A ray prepared for packs.
pub(super) struct PackRay {
    /// Axes that become x, y, z; z is the largest component of the direction.
    axes: [usize; 3],
    origin: [Vec4; 3],
    shear: [Vec4; 2],
    per_z: Vec4,
    /// What ε is at the ray's origin.
    error: Vec4,
}

impl PackRay {
    /// Corners in the sheared frame.
    #[inline(always)]
    fn project(&self, corner: &[Vec4; 3]) -> (Vec4, Vec4, Vec4) {
        let [x, y, z] = self.axes;
        let height = corner[z] - self.origin[2];
        let across = (corner[x] - self.origin[0], corner[y] - self.origin[1]);
        (across.0 - self.shear[0] * height, across.1 - self.shear[1] * height, height)
    }
}

impl Sift for Packs {
    type Ray = PackRay;

    #[inline(always)]
    fn ray(&self, moved: &Moved) -> PackRay {
        let size = moved.direction.abs();
        let axes = if size.x >= size.y && size.x >= size.z {
            [1, 2, 0]
        } else if size.y >= size.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
        let [along, origin] = [moved.direction, moved.origin].map(|v| v.to_array());
        let per_z = moved.inverse.to_array()[axes[2]];
        let error = 2.0 * (moved.padding + PLACING) + RELATIVE * moved.origin.abs().max_element();
        Self::Ray {
            axes,
            origin: axes.map(|axis| Vec4::splat(origin[axis])),
            shear: [Vec4::splat(along[axes[0]] * per_z), Vec4::splat(along[axes[1]] * per_z)],
            per_z: Vec4::splat(per_z),
            error: Vec4::splat(error),
        }
    }

    #[inline(always)]
    fn passed(&self, ray: &PackRay, first: usize, count: u32, farthest: f32) -> u32 {
        let Pack { corners, size } = &self.packs[first / 4];
        let (ax, ay, az) = ray.project(&corners[0]);
        let (bx, by, bz) = ray.project(&corners[1]);
        let (cx, cy, cz) = ray.project(&corners[2]);
        let (u, v, w) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        // Sheared, too, no corner is farther from the first than that: |Δx − S Δz| ≤ |Δx| + |Δz|.
        let across = ax.abs() + ay.abs() + *size;
        let error = ray.error + RELATIVE * (across + az.abs() + *size);
        let doubt = error * (6.0 * across + 3.0 * error);
        let (az, bz, cz) = (az * ray.per_z, bz * ray.per_z, cz * ray.per_z);
        let (near, far) = (az.min(bz).min(cz), az.max(bz).max(cz));
        let slack = 4.0 * error;
        let is_beside = least.cmplt(-doubt) & most.cmpgt(doubt);
        let is_apart = far.cmplt(-slack) | (near - slack).cmpgt(Vec4::splat(farthest));
        !(is_beside | is_apart).bitmask() & ((1 << count) - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::Bounds;
    use super::super::triangle::ShearedRay;
    use super::*;

    fn uniform(i: u32, salt: u32) -> f64 {
        let mut z = u64::from(i) << 32 | u64::from(salt);
        z = (z ^ (z >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        z = (z ^ (z >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
        (z ^ (z >> 33)) as f64 / 2f64.powi(63) - 1.0
    }

    fn point(i: u32, salt: u32) -> DVec3 {
        DVec3::new(uniform(i, salt), uniform(i, salt + 1), uniform(i, salt + 2))
    }

    /// Triangles of sizes between the whole scene and a millionth of it, not all about the origin.
    fn triangles(count: u32, size: f64) -> Vec<[[f32; 3]; 3]> {
        let one = |i| {
            let size = size * 10f64.powf(3.0 * uniform(i, 0) - 3.0);
            let center = size.max(0.7) * point(i, 1);
            [4, 7, 10].map(|salt| (center + size * point(i, salt)).to_array().map(|x| x as f32))
        };
        (0..count).map(one).collect()
    }

    fn wide(corners: [[f32; 3]; 3]) -> [DVec3; 3] {
        corners.map(|p| DVec3::from(p.map(f64::from)))
    }

    #[test]
    fn nothing_that_is_crossed_is_sifted_out_and_little_else_is_left() {
        for size in [1e-3, 1.0, 3e4] {
            let all = triangles(1000, size);
            let tree = Tree::of_packs(all.len(), |i| {
                let [a, b, c] = wide(all[i]);
                Bounds { min: a.min(b).min(c), max: a.max(b).max(c) }
            });
            let packs = Packs::new(&tree, |i| Some(wide(all[i as usize])));
            let (mut crossed, mut left) = (0, 0);
            for i in 0..4000_u32 {
                let [a, b, c] = wide(all[(i % 1000) as usize]);
                // At the inside, an edge or a corner of a triangle, and by a rounding or more beside it.
                let aim = match i % 5 {
                    0 => (a + b + c) / 3.0,
                    1 => a + 0.3 * (b - a),
                    2 => a,
                    3 => a + 0.6 * (c - a) + 1e-12 * size * point(i, 20),
                    _ => b + 1e-9 * size * point(i, 20),
                };
                let mut origin = size.max(0.7) * [0.1, 1.0, 50.0][(i % 3) as usize] * point(i, 30);
                if i % 7 == 0 {
                    // In the plane of the triangle, or almost.
                    origin = a + 5.0 * (b - a) + 2.0 * (c - a);
                }
                let direction = (aim - origin).normalize();
                let mut passed = vec![false; all.len()];
                tree.walk_sifted(&packs, [origin, direction], [0.0, f64::INFINITY], 1.0, |i, limit| {
                    passed[i as usize] = true;
                    limit
                });
                let sheared = ShearedRay::new(origin, direction);
                for (i, triangle) in all.iter().enumerate() {
                    let hit = sheared.intersect(triangle.each_ref());
                    if hit.is_some_and(|hit| hit.distance > 0.0) {
                        crossed += 1;
                        assert!(passed[i], "{origin:?} {direction:?} {triangle:?}");
                    }
                }
                left += passed.iter().filter(|passed| **passed).count();
            }
            assert!(crossed > 1000, "{crossed}");
            // Of triangles of less than 1e-6 of the scene f32 tells nothing.
            assert!(size < 1.0 || left < 3 * crossed, "{left} of {crossed}");
        }
    }

    #[test]
    fn what_is_no_triangle_is_never_sifted_out() {
        let bounds = |i: usize| Bounds { min: DVec3::splat(i as f64), max: DVec3::splat(i as f64 + 0.5) };
        let tree = Tree::of_packs(3, bounds);
        let packs = Packs::new(&tree, |_| None);
        let mut passed = 0;
        let ray = [DVec3::splat(-1.0), DVec3::ONE.normalize()];
        tree.walk_sifted(&packs, ray, [0.0, f64::INFINITY], 1.0, |_, limit| {
            passed += 1;
            limit
        });
        assert_eq!(passed, 3);
    }
}
