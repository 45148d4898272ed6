//! Four triangles at a time: which of them a ray may cross, told in f32 so that none that it does cross is missed.
//!
//! The test is that of `triangle.rs`, in the units of a tree's boxes (all coordinates ≤ 1 in size) and with a bound on its error. Let
//! u = 2^-24, o the origin from which the ray walks, d = v − o for a corner v, S ≤ 1 in size the shear, x' = dx − S dz. Then:
//!
//! * v and o are rounded, by u|v| ≤ u(|o| + |d|) and u|o|; so is their difference: d errs by u(2|o| + 2|d|).
//! * S errs by 3 u; with the product and the difference x' errs by u(4|o| + 2|dx| + 6|dz| + |x'|), where |dx| ≤ |x'| + |dz|.
//! * The ray that decides is beside the one that walks by no more than the padding of the boxes, p: it shifts x' by 2 p.
//!
//! Together less than ε = 2 p + 12 u (|o| + |dz| + |x'|). An edge function a × b of coordinates up to m errs by 4 ε m + 2 ε² for that
//! and by 4 u m² ≤ ε m / 2 for its own rounding. What reads as more than 5 ε m + 2 ε² has the sign it shows; the factors are rounded up
//! for the rounding of the bound itself. The distances of the corners along the ray err by ε over the largest component of the
//! direction, at least 3^-½.

use glam::{DVec3, Vec4};

use super::tree::Tree;
use super::walk::{Moved, Sift};

/// 12 u.
const RELATIVE: f32 = 12.0 / 16_777_216.0;
/// Room for the rounding of transforms to the space of the boxes, of which the padding of the walk knows nothing: 2^-36.
pub(super) const PLACING: f32 = 1.0 / 68_719_476_736.0;

/// Corners of four triangles: corner by corner, axis by axis, lane by lane. A lane that is not a number is always passed.
#[derive(Clone, Copy, Debug)]
struct Pack([[Vec4; 3]; 3]);

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
            let mut pack = Pack([[Vec4::NAN; 3]; 3]);
            for (lane, &primitive) in leaf.iter().enumerate() {
                let Some(corners) = corners_of(primitive) else { continue };
                for (corner, point) in pack.0.iter_mut().zip(corners) {
                    for (axis, along) in corner.iter_mut().zip((point * tree.scale).to_array()) {
                        axis[lane] = along as f32;
                    }
                }
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
        let [along, origin] = [moved.direction.extend(0.0), moved.origin].map(|v| v.to_array());
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
        let Pack(corners) = &self.packs[first / 4];
        let (ax, ay, az) = ray.project(&corners[0]);
        let (bx, by, bz) = ray.project(&corners[1]);
        let (cx, cy, cz) = ray.project(&corners[2]);
        let (u, v, w) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let along = az.abs().max(bz.abs()).max(cz.abs());
        let across = ax.abs().max(bx.abs()).max(cx.abs()).max(ay.abs()).max(by.abs()).max(cy.abs());
        let error = ray.error + RELATIVE * (across + along);
        let doubt = error * (6.0 * across + 3.0 * error);
        let (az, bz, cz) = (az * ray.per_z, bz * ray.per_z, cz * ray.per_z);
        let (near, far) = (az.min(bz).min(cz), az.max(bz).max(cz));
        let slack = 4.0 * error;
        let is_beside = least.cmplt(-doubt) & most.cmpgt(doubt);
        let is_apart = far.cmplt(-slack) | (near - slack).cmpgt(Vec4::splat(farthest));
        !(is_beside | is_apart).bitmask() & ((1 << count) - 1)
    }
}
