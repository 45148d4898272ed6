//! A ray's way through a tree: conservative f32 slabs, children near to far, no allocation.
//!
//! The slab test must never miss a box in which the f64 shape test finds a hit. In the units of the boxes (all
//! coordinates ≤ 1 in size) the errors are:
//!
//! * The origin. It is moved in f64 to where the ray enters the bounds of everything, unless it is near them, so it is ≤ 2 in
//!   size before it is rounded. The move errs by a few 2^-53 (|o| + 1), as does the shape test, which works with the origin as given: 2^-49
//!   (|o| + 1) bounds both, times the caller's `spread` where the shape test has its own space. The padded origin is
//!   rounded up for the near planes of positive directions and far planes of negative ones, down for the others, each by
//!   a whole step of f32 so that no rounding needs to be looked at; what underflows, the padding covers.
//! * The direction. Components below 2^-64 are replaced by ±2^-64, so that 1/d is finite and 0·∞ cannot arise; over a
//!   distance of 8, more than the diagonal and the way there, that moves the ray by 2^-61, which the padding of 2^-40 covers.
//! * The distances. 1/d, the difference and the product err by 2^-24 relatively, together (1 + 2^-24)^3: multiplying far
//!   distances by 1 + 2^-21 covers both sides of the comparison and the rounding of the limit (Ize 2013, "Robust BVH ray traversal", JCGT 2(2)).
//!   The relative error cannot change a sign, and distances below 0 are behind the start.

use glam::{DVec3, Vec4};

use super::tree::{Node, STACK, Tree, stack_of};

const SMALLEST_DIRECTION: f64 = 1.0 / 18_446_744_073_709_551_616.0;
const PADDING: f64 = 1.0 / 1_099_511_627_776.0;
const RELATIVE_PADDING: f64 = 1.0 / 562_949_953_421_312.0;
const FAR_FACTOR: f64 = 1.0 + 1.0 / 2_097_152.0;
/// 2^-23: moves any f64 by more than its rounding to f32 does.
const F32_STEP: f64 = 1.0 / 8_388_608.0;

/// Entries of a stack for trees of eight levels, a few hundred to some thousand primitives.
const SHALLOW: usize = stack_of(8);
/// Of two levels.
const FLAT: usize = stack_of(2);

/// What waits on the stack: a node (`count` 0) or a leaf, and where the ray enters it.
#[derive(Clone, Copy)]
struct Waiting {
    near: f32,
    first: u32,
    count: u32,
}

const WAITING: Waiting = Waiting { near: 0.0, first: 0, count: 0 };

/// The ray in the units of the boxes.
struct Slabs {
    /// Whether the direction is negative, per axis.
    negative: [usize; 3],
    inverse: [Vec4; 3],
    near_origin: [Vec4; 3],
    far_origin: [Vec4; 3],
}

impl Tree {
    /// Calls `visit` with every primitive whose box the ray passes between the distances `start` and the limit, which
    /// `visit` returns anew each time; near boxes first.
    ///
    /// `spread` ≥ 1 says how many times larger the rounding errors of the caller's own test are than those of a test in
    /// the space of the boxes.
    pub(crate) fn walk(
        &self,
        origin: DVec3,
        direction: DVec3,
        start: f64,
        limit: f64,
        spread: f64,
        visit: impl FnMut(u32, f64) -> f64,
    ) {
        // Clearing a stack that is never used takes longer than a step.
        if self.nodes.len() == 1 {
            self.walk_with(&mut [], origin, direction, start, limit, spread, visit);
        } else if self.stack <= FLAT {
            self.walk_with(&mut [WAITING; FLAT], origin, direction, start, limit, spread, visit);
        } else if self.stack <= SHALLOW {
            self.walk_with(&mut [WAITING; SHALLOW], origin, direction, start, limit, spread, visit);
        } else {
            self.walk_with(&mut [WAITING; STACK], origin, direction, start, limit, spread, visit);
        }
    }

    #[expect(clippy::too_many_arguments, reason = "those of `walk`, and memory")]
    fn walk_with(
        &self,
        stack: &mut [Waiting],
        origin: DVec3,
        direction: DVec3,
        start: f64,
        limit: f64,
        spread: f64,
        mut visit: impl FnMut(u32, f64) -> f64,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let scale = self.scale;
        let origin = origin * scale;
        let padding = PADDING + RELATIVE_PADDING * spread * (origin.abs().max_element() + 1.0);
        // The ray does not tell where in the boxes it is, not even in which half of them.
        if padding >= 1.0 {
            return;
        }
        let sized = |d: f64| if d.abs() < SMALLEST_DIRECTION { SMALLEST_DIRECTION.copysign(d) } else { d };
        let direction = DVec3::new(sized(direction.x), sized(direction.y), sized(direction.z));
        let inverse = direction.recip();
        let mut limit = limit;
        let mut enter = start * scale;
        // From within or nearby, the boxes of the first node are all that can be missed.
        if origin.abs().max_element() > 1.0 || enter < -1.0 {
            let to_min = (self.bounds[0] - padding - origin) * inverse;
            let to_max = (self.bounds[1] + padding - origin) * inverse;
            enter = to_min.min(to_max).max_element().max(enter);
            let exit = to_min.max(to_max).min_element();
            if !(enter <= exit * FAR_FACTOR + padding && enter <= limit * scale + padding) {
                return;
            }
        }
        let moved = origin + direction * enter;
        let (low, high) = (moved - padding, moved + padding);
        let (low, high) = (low - low.abs() * F32_STEP, high + high.abs() * F32_STEP);
        let (low, high) = (low.as_vec3().extend(0.0), high.as_vec3().extend(0.0));
        let inverse = inverse.as_vec3().extend(0.0);
        let negative = inverse.cmplt(Vec4::ZERO);
        let (near, far) = (Vec4::select(negative, low, high), Vec4::select(negative, high, low));
        let splat = |v: Vec4| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        let slabs = Slabs {
            negative: [inverse.x < 0.0, inverse.y < 0.0, inverse.z < 0.0].map(usize::from),
            inverse: splat(inverse),
            near_origin: splat(near),
            far_origin: splat(far),
        };
        // Distances from the moved origin.
        let reach = |limit: f64| ((limit * scale - enter) * FAR_FACTOR + padding) as f32;
        let mut farthest = reach(limit);

        // A few primitives are in one node: nothing has to wait on a stack.
        if let [node] = &self.nodes[..] {
            let (near, mut lanes) = slabs.entries(node, farthest);
            while lanes != 0 {
                let mut lane = (lanes.trailing_zeros() & 3) as usize;
                let mut others = lanes & (lanes - 1);
                while others != 0 {
                    let other = (others.trailing_zeros() & 3) as usize;
                    lane = if near[other] < near[lane] { other } else { lane };
                    others &= others - 1;
                }
                lanes &= !(1 << lane);
                if near[lane] > farthest {
                    return;
                }
                let (first, count) = (node.first[lane] as usize, node.count[lane] as usize);
                for &primitive in &self.order[first..first + count] {
                    limit = visit(primitive, limit);
                }
                farthest = reach(limit);
            }
            return;
        }

        let mut len = 1;
        while len > 0 {
            len -= 1;
            let item = stack[len];
            if item.near > farthest {
                continue;
            }
            if item.count > 0 {
                let first = item.first as usize;
                for &primitive in &self.order[first..first + item.count as usize] {
                    limit = visit(primitive, limit);
                }
                farthest = reach(limit);
                continue;
            }
            let node = &self.nodes[item.first as usize];
            let (near, lanes) = slabs.entries(node, farthest);
            let Some(waiting) = stack[len..].first_chunk_mut::<4>() else {
                unreachable!("the tree says how deep it is")
            };
            // Farthest deepest on the stack, and those that are not passed above its end.
            for (waiting, lane) in waiting.iter_mut().zip(far_to_near(near, lanes)) {
                *waiting = Waiting { near: near[lane], first: node.first[lane], count: node.count[lane] };
            }
            len += usize::from(PASSED[lanes as usize & 15]);
        }
    }
}

/// How many bits are set.
const PASSED: [u8; 16] = [0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4];

/// The lanes by distance, those without a bit last. A sorting network: branches would be coin tosses.
#[inline(always)]
fn far_to_near(near: [f32; 4], lanes: u32) -> [usize; 4] {
    // Distances are not negative: their bits are in their order.
    let mut keys: [u64; 4] = std::array::from_fn(|lane| {
        let is_passed = u64::from(lanes >> lane & 1);
        is_passed << 34 | u64::from(near[lane].to_bits()) << 2 | lane as u64
    });
    for (i, j) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (keys[i], keys[j]) = (keys[i].max(keys[j]), keys[i].min(keys[j]));
    }
    keys.map(|key| (key & 3) as usize)
}

impl Slabs {
    /// Where the ray enters the children, and a bit for each that it passes before `farthest`.
    #[inline(always)]
    fn entries(&self, node: &Node, farthest: f32) -> ([f32; 4], u32) {
        let plane = |axis: usize, far: usize, origin: &[Vec4; 3]| {
            (node.bounds[(self.negative[axis] ^ far) & 1][axis] - origin[axis]) * self.inverse[axis]
        };
        let near = plane(0, 0, &self.near_origin)
            .max(plane(1, 0, &self.near_origin))
            .max(plane(2, 0, &self.near_origin).max(Vec4::ZERO));
        let far = plane(0, 1, &self.far_origin).min(plane(1, 1, &self.far_origin)).min(plane(2, 1, &self.far_origin));
        let passed = near.cmple((far * FAR_FACTOR as f32).min(Vec4::splat(farthest)));
        (near.to_array(), passed.bitmask())
    }
}
