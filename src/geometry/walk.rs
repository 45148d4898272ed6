//! A ray's way through a tree: conservative f32 slabs, children near to far, no allocation.
//!
//! The slab test must never miss a box in which the f64 shape test finds a hit. In the units of the boxes (all
//! coordinates ≤ 1 in size) the errors are:
//!
//! * The origin. It is moved in f64 to where the ray enters the bounds of everything, unless it is near them, so it is ≤ 2 in
//!   size before it is rounded. The move errs by a few 2^-53 (|o| + 1), as does the shape test, which works with the origin as given: 2^-49
//!   (|o| + 1) bounds both, times the caller's `spread` where the shape test has its own space. The origin is
//!   moved up for the near planes of positive directions and far planes of negative ones, down for the others, by the padding and
//!   two steps of f32 so that no rounding needs to be looked at; what underflows, the padding covers.
//! * The direction. Components below 2^-64 are replaced by ±2^-64, so that 1/d is finite and 0·∞ cannot arise; over a
//!   distance of 8, more than the diagonal and the way there, that moves the ray by 2^-61, which the padding of 2^-40 covers.
//! * The distances. d, 1/d, the difference and the product err by 2^-24 relatively, together (1 + 2^-24)^4: multiplying far
//!   distances by 1 + 2^-20 covers both sides of the comparison and the rounding of the limit (Ize 2013, "Robust BVH ray traversal", JCGT 2(2)).
//!   The relative error cannot change a sign, and distances below 0 are behind the start.

use glam::{DVec3, Vec4};

use super::tree::{Child, Node, STACK, Tree, stack_of};

const SMALLEST_DIRECTION: f32 = 1.0 / 18_446_744_073_709_551_616.0;
const PADDING: f64 = 1.0 / 1_099_511_627_776.0;
const RELATIVE_PADDING: f64 = 1.0 / 562_949_953_421_312.0;
const FAR_FACTOR: f64 = 1.0 + 1.0 / 1_048_576.0;
/// 2^-22, two steps of f32: an origin is rounded, and so is what is padded.
const STEPS: f32 = 1.0 / 4_194_304.0;

/// Entries of a stack for trees of eight levels, a few hundred to some thousand primitives.
const SHALLOW: usize = stack_of(8);
/// Of two levels.
const FLAT: usize = stack_of(2);

/// What waits on the stack: a child, and in the upper half where the ray enters it. Distances are not negative, so that their bits are
/// in their order; 0 is no child but the root.
type Waiting = u64;

/// A ray on its way in the units of the boxes, rounded.
pub(super) struct Moved {
    /// Where it enters the bounds of everything, or starts; the last lane is 0.
    pub(super) origin: Vec4,
    /// No component is 0.
    pub(super) direction: Vec4,
    /// 1 over each.
    pub(super) inverse: Vec4,
    /// How far beside it the ray that decides may be, rounded up.
    pub(super) padding: f32,
}

impl Moved {
    #[inline(always)]
    fn new(origin: DVec3, direction: DVec3, padding: f64) -> Self {
        let direction = direction.as_vec3().extend(1.0);
        let sized = direction.abs().max(Vec4::splat(SMALLEST_DIRECTION)).copysign(direction);
        Self {
            origin: origin.as_vec3().extend(0.0),
            direction: sized,
            inverse: sized.recip(),
            padding: padding as f32 * (1.0 + STEPS),
        }
    }
}

/// What knows more of the primitives than their boxes.
pub(super) trait Sift {
    /// A ray made ready.
    type Ray;

    fn ray(&self, moved: &Moved) -> Self::Ray;

    /// A bit for each of the `count` primitives of the leaf that begins at `first` which the ray may meet before `farthest`.
    fn passed(&self, ray: &Self::Ray, first: usize, count: u32, farthest: f32) -> u32;
}

/// Nothing is known but boxes.
pub(super) struct Unsifted;

impl Sift for Unsifted {
    type Ray = ();

    #[inline(always)]
    fn ray(&self, _: &Moved) {}

    #[inline(always)]
    fn passed(&self, (): &(), _: usize, count: u32, _: f32) -> u32 {
        (1 << count) - 1
    }
}

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
        self.walk_sifted(&Unsifted, [origin, direction], [start, limit], spread, visit);
    }

    /// The same where `sift` is asked about primitives, too.
    #[inline(always)]
    pub(super) fn walk_sifted(
        &self,
        sift: &impl Sift,
        ray: [DVec3; 2],
        between: [f64; 2],
        spread: f64,
        visit: impl FnMut(u32, f64) -> f64,
    ) {
        // Clearing a stack that is never used takes longer than a step.
        if self.nodes.len() == 1 {
            self.walk_with(sift, &mut [], ray, between, spread, visit);
        } else if self.stack <= FLAT {
            self.walk_with(sift, &mut [0; FLAT], ray, between, spread, visit);
        } else if self.stack <= SHALLOW {
            self.walk_with(sift, &mut [0; SHALLOW], ray, between, spread, visit);
        } else {
            self.walk_with(sift, &mut [0; STACK], ray, between, spread, visit);
        }
    }

    fn walk_with<S: Sift>(
        &self,
        sift: &S,
        stack: &mut [Waiting],
        [origin, direction]: [DVec3; 2],
        [start, limit]: [f64; 2],
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
        let mut limit = limit;
        let mut enter = start * scale;
        // From within or nearby, the boxes of the first node are all that can be missed.
        if origin.abs().max_element() > 1.0 || enter < -1.0 {
            let sized = |d: f64| d.abs().max(SMALLEST_DIRECTION.into()).copysign(d);
            let inverse = DVec3::new(sized(direction.x), sized(direction.y), sized(direction.z)).recip();
            let to_min = (self.bounds[0] - padding - origin) * inverse;
            let to_max = (self.bounds[1] + padding - origin) * inverse;
            enter = to_min.min(to_max).max_element().max(enter);
            let exit = to_min.max(to_max).min_element();
            if !(enter <= exit * FAR_FACTOR + padding && enter <= limit * scale + padding) {
                return;
            }
        }
        let moved = Moved::new(origin + direction * enter, direction, padding);
        let sifted = sift.ray(&moved);
        let slabs = Slabs::new(&moved);
        // Distances from the moved origin.
        let reach = |limit: f64| ((limit * scale - enter) * FAR_FACTOR + padding) as f32;
        let mut farthest = reach(limit);

        // A few primitives are in one node: nothing has to wait on a stack.
        if let [node] = &self.nodes[..] {
            let (near, lanes) = slabs.entries(node, farthest);
            for item in far_to_near(near, lanes, &node.children).into_iter().rev() {
                if f32::from_bits((item >> 32) as u32) > farthest {
                    return;
                }
                let Child::Leaf { first, count } = Child::unpack(item as u32) else { continue };
                let mut passed = sift.passed(&sifted, first, count, farthest);
                while passed != 0 {
                    limit = visit(self.order[first + passed.trailing_zeros() as usize], limit);
                    passed &= passed - 1;
                }
                farthest = reach(limit);
            }
            return;
        }

        stack[0] = 0;
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let item = stack[len];
            if f32::from_bits((item >> 32) as u32) > farthest {
                continue;
            }
            match Child::unpack(item as u32) {
                Child::Leaf { first, count } => {
                    let mut passed = sift.passed(&sifted, first, count, farthest);
                    if passed != 0 {
                        while passed != 0 {
                            limit = visit(self.order[first + passed.trailing_zeros() as usize], limit);
                            passed &= passed - 1;
                        }
                        farthest = reach(limit);
                    }
                }
                Child::Node(node) => {
                    let node = &self.nodes[node];
                    let (near, lanes) = slabs.entries(node, farthest);
                    let Some(waiting) = stack[len..].first_chunk_mut::<4>() else {
                        unreachable!("the tree says how deep it is")
                    };
                    *waiting = far_to_near(near, lanes, &node.children);
                    len += usize::from(PASSED[lanes as usize & 15]);
                }
            }
        }
    }
}

/// How many bits are set.
const PASSED: [u8; 16] = [0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4];

/// The children whose bits are set by distance, then zeros. A sorting network: branches would be coin tosses.
#[inline(always)]
fn far_to_near(near: [f32; 4], lanes: u32, children: &[u32; 4]) -> [Waiting; 4] {
    let key = |lane: usize| {
        let key = u64::from(near[lane].to_bits()) << 32 | u64::from(children[lane]);
        if lanes >> lane & 1 == 0 { 0 } else { key }
    };
    let [mut a, mut b, mut c, mut d] = [key(0), key(1), key(2), key(3)];
    (a, b) = (a.max(b), a.min(b));
    (c, d) = (c.max(d), c.min(d));
    (a, c) = (a.max(c), a.min(c));
    (b, d) = (b.max(d), b.min(d));
    (b, c) = (b.max(c), b.min(c));
    [a, b, c, d]
}

impl Slabs {
    #[inline(always)]
    fn new(&Moved { origin, inverse, padding, .. }: &Moved) -> Self {
        let padding = origin.abs() * STEPS + padding;
        let negative = inverse.cmplt(Vec4::ZERO);
        let padding = Vec4::select(negative, -padding, padding);
        let splat = |v: Vec4| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        let negative = negative.bitmask() as usize;
        Self {
            negative: [negative & 1, negative >> 1 & 1, negative >> 2 & 1],
            inverse: splat(inverse),
            near_origin: splat(origin + padding),
            far_origin: splat(origin - padding),
        }
    }

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
        // The second one where it is not a number: of a ray that has none, no lane is passed.
        let passed = near.cmple(Vec4::splat(farthest).min(far * FAR_FACTOR as f32));
        (near.to_array(), passed.bitmask())
    }
}
