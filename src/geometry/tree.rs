//! The tree: four-wide nodes of f32 boxes that say which primitives a ray may meet.
//!
//! obvhs builds a binary tree (PLOC with reinsertion); it becomes a tree of four-wide nodes with one SIMD lane per child.
//! The stock traversal of obvhs cannot be used: its node test clamps distances to an absolute 1e-4.
//!
//! Boxes are stored scaled by a power of two so that no coordinate exceeds 1: scenes of all sizes build the same tree,
//! and neither areas nor distances under- or overflow. Boxes never decide a hit, so neither the builder's threads nor its
//! settings have an influence on what is hit.

use glam::{DVec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

/// Primitives in a leaf at most, and what a step down costs relative to a primitive's test (`benches/bvh.rs`).
const LEAF: u32 = 4;
const STEP_COST: f32 = 1.0;
/// The same where four tests are one.
const STEP_COST_OF_PACKS: f32 = 4.0;
/// Share of the nodes that the builder tries to place better (`benches/bvh.rs`).
const REINSERTION: f32 = 0.02;

/// Deepest four-wide tree that a traversal can hold: three children wait at every level.
const MAX_DEPTH: usize = 32;
pub(super) const STACK: usize = stack_of(MAX_DEPTH);

/// What a traversal of a tree with so many levels holds at most.
pub(super) const fn stack_of(depth: usize) -> usize {
    3 * depth + 4
}

/// Four children: bounds lane by lane, and where they are.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Lower and upper bounds, one vector per axis. An empty lane has its lower bounds above its upper ones.
    pub(super) bounds: [[Vec4; 3]; 2],
    /// Packed.
    pub(super) children: [u32; 4],
}

const _: () = assert!(std::mem::size_of::<Node>() == 128);

impl Node {
    const EMPTY: Self = Self { bounds: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], children: [0; 4] };

    fn set(&mut self, lane: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.bounds[0][axis][lane] = bounds.min[axis];
            self.bounds[1][axis][lane] = bounds.max[axis];
        }
        self.children[lane] = child.pack();
    }
}

/// What a lane of a node stands for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Child {
    /// The node with an index.
    Node(usize),
    /// 1 to 4 primitives, from a place in the order that is a multiple of four.
    Leaf { first: usize, count: u32 },
}

impl Child {
    const LEAF: u32 = 1 << 31;

    fn pack(self) -> u32 {
        match self {
            Self::Node(index) => index as u32,
            Self::Leaf { first, count } => Self::LEAF | first as u32 | (count - 1),
        }
    }

    #[inline(always)]
    pub(super) fn unpack(packed: u32) -> Self {
        if packed & Self::LEAF == 0 {
            return Self::Node(packed as usize);
        }
        let place = packed & !Self::LEAF;
        Self::Leaf { first: (place & !3) as usize, count: (place & 3) + 1 }
    }
}

/// A tree over boxes.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// Primitives, leaf after leaf; every leaf begins at a multiple of four, and what fills the gaps belongs to none.
    pub(super) order: Vec<u32>,
    /// What a traversal holds at most.
    pub(super) stack: usize,
    /// A power of two: from the caller's units to those of the boxes.
    pub(super) scale: f64,
    /// Bounds of everything, scaled.
    pub(super) bounds: [DVec3; 2],
}

/// An axis-aligned box in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
}

impl Bounds {
    pub(crate) const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    pub(crate) fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Largest coordinate.
    pub(crate) fn reach(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }
}

impl Tree {
    /// A tree over `count` primitives with finite bounds.
    pub(crate) fn build(count: usize, bounds_of: impl Fn(usize) -> Bounds + Sync) -> Self {
        Self::with_steps(STEP_COST, count, bounds_of)
    }

    /// The same with full leaves, for primitives that are [sifted](super::walk::Sift) all at once.
    pub(super) fn of_packs(count: usize, bounds_of: impl Fn(usize) -> Bounds + Sync) -> Self {
        Self::with_steps(STEP_COST_OF_PACKS, count, bounds_of)
    }

    fn with_steps(step_cost: f32, count: usize, bounds_of: impl Fn(usize) -> Bounds + Sync) -> Self {
        let all = (0..count).into_par_iter().map(&bounds_of).reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
        Self::new(step_cost, &all, count, bounds_of)
    }

    /// A tree where the box of `all` primitives is known.
    pub(super) fn within(all: &Bounds, count: usize, bounds_of: impl Fn(usize) -> Bounds + Sync) -> Self {
        Self::new(STEP_COST, all, count, bounds_of)
    }

    fn new(step_cost: f32, all: &Bounds, count: usize, bounds_of: impl Fn(usize) -> Bounds + Sync) -> Self {
        if count == 0 {
            return Self::default();
        }
        assert!(count < 1 << 29, "primitives are counted in 29 bits: leaves with one of them take four places");
        let (_, exponent) = libm::frexp(all.reach());
        // 2^-1022 … 2^1022: beyond, the boxes lose digits but stay bounds.
        let scale = libm::ldexp(1.0, (-exponent).clamp(-1022, 1022));
        let boxes: Vec<Aabb> = (0..count)
            .into_par_iter()
            .map(|i| {
                let b = bounds_of(i);
                Aabb { min: round_down(b.min * scale), max: round_up(b.max * scale) }
            })
            .collect();
        let binary = agglomerate(&boxes, step_cost);
        let (mut nodes, mut order, depth) = match widen(&binary.nodes, &binary.primitive_indices) {
            Some(wide) => wide,
            None => {
                let (binary, order) = halve(&boxes);
                widen(&binary, &order).expect("halving 2^31 primitives takes 31 binary levels")
            }
        };
        // Trees are built once and kept: what the vectors grew beyond their ends would be kept with them.
        nodes.shrink_to_fit();
        order.shrink_to_fit();
        Self { nodes, order, stack: stack_of(depth), scale, bounds: [all.min * scale, all.max * scale] }
    }
}

impl Tree {
    /// The box of everything; the scale is a power of two, so that no digit is lost.
    pub(super) fn extent(&self) -> Bounds {
        if self.nodes.is_empty() {
            return Bounds::EMPTY;
        }
        Bounds { min: self.bounds[0] / self.scale, max: self.bounds[1] / self.scale }
    }

    /// Largest coordinate of everything.
    pub(super) fn reach(&self) -> f64 {
        if self.nodes.is_empty() {
            0.0
        } else {
            self.bounds[0].abs().max(self.bounds[1].abs()).max_element() / self.scale
        }
    }

    /// Whether `visit` is true of any primitive whose box meets `bounds`.
    pub(super) fn any_meeting(&self, bounds: &Bounds, mut visit: impl FnMut(u32) -> bool) -> bool {
        // Outward, as the boxes are.
        let (low, high) = (round_down(bounds.min * self.scale), round_up(bounds.max * self.scale));
        let mut open = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = open.pop() {
            let node: &Node = &self.nodes[node];
            for lane in 0..4 {
                let meets =
                    |axis: usize| node.bounds[0][axis][lane] <= high[axis] && low[axis] <= node.bounds[1][axis][lane];
                if !(meets(0) && meets(1) && meets(2)) {
                    continue;
                }
                match Child::unpack(node.children[lane]) {
                    Child::Node(node) => open.push(node),
                    Child::Leaf { first, count } => {
                        if self.order[first..first + count as usize].iter().any(|&primitive| visit(primitive)) {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }
}

/// The builder's tree. Its steps are called one by one: the builder's own sequence validates itself in debug builds at a
/// depth that is too small for degenerate input.
fn agglomerate(boxes: &[Aabb], step_cost: f32) -> Bvh2 {
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Low,
        boxes,
        (0..boxes.len() as u32).collect(),
        SortPrecision::U64,
        0,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, REINSERTION, None);
    collapse(&mut tree, LEAF, step_cost);
    tree
}

/// A balanced tree by halving along the longest axis: not as good, but never deep.
fn halve(boxes: &[Aabb]) -> (Vec<Bvh2Node>, Vec<u32>) {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let bound = |order: &[u32]| order.iter().fold(Aabb::INVALID, |all, &i| all.union(&boxes[i as usize]));
    let mut nodes = vec![Bvh2Node::new(bound(&order), 0, 0)];
    let mut open = vec![(0, 0..boxes.len())];
    while let Some((node, range)) = open.pop() {
        let bounds = *nodes[node].aabb();
        if range.len() <= LEAF as usize {
            nodes[node] = Bvh2Node::new(bounds, range.len() as u32, range.start as u32);
            continue;
        }
        let axis = bounds.largest_axis();
        let middle = range.len() / 2;
        let part = &mut order[range.clone()];
        part.select_nth_unstable_by(middle, |&a, &b| {
            let center = |i: u32| boxes[i as usize].min[axis] + boxes[i as usize].max[axis];
            center(a).total_cmp(&center(b)).then(a.cmp(&b))
        });
        let (low, high) = part.split_at(middle);
        let first = nodes.len();
        let children = [Bvh2Node::new(bound(low), 0, 0), Bvh2Node::new(bound(high), 0, 0)];
        nodes.extend(children);
        nodes[node] = Bvh2Node::new(bounds, 0, first as u32);
        open.push((first, range.start..range.start + middle));
        open.push((first + 1, range.start + middle..range.end));
    }
    (nodes, order)
}

/// Four-wide nodes from a binary tree over primitives in `together`, their order leaf after leaf, and the levels: each node takes in
/// the largest of its children until it has four. `None` if the result is deeper than a traversal can hold.
fn widen(binary: &[Bvh2Node], together: &[u32]) -> Option<(Vec<Node>, Vec<u32>, usize)> {
    let mut nodes = vec![Node::EMPTY];
    let mut order: Vec<u32> = Vec::with_capacity(together.len());
    let mut deepest = 1;
    let mut open = vec![(0_u32, 0_usize, 1_usize)];
    while let Some((root, node, depth)) = open.pop() {
        if depth > MAX_DEPTH {
            return None;
        }
        deepest = deepest.max(depth);
        let mut children = [root; 4];
        let mut len = 1;
        while len < 4 {
            let mut largest: Option<(usize, f32)> = None;
            for (lane, &child) in children[..len].iter().enumerate() {
                let child = &binary[child as usize];
                let area = child.aabb().half_area();
                if !child.is_leaf() && largest.is_none_or(|(_, most)| area > most) {
                    largest = Some((lane, area));
                }
            }
            let Some((lane, _)) = largest else { break };
            let first = binary[children[lane] as usize].first_index;
            children[lane] = first;
            children[len] = first + 1;
            len += 1;
        }
        for (lane, &child) in children[..len].iter().enumerate() {
            let source = &binary[child as usize];
            if source.is_leaf() {
                let leaf = &together[source.first_index as usize..][..source.prim_count as usize];
                nodes[node].set(lane, source.aabb(), Child::Leaf { first: order.len(), count: source.prim_count });
                order.extend_from_slice(leaf);
                order.resize(order.len().next_multiple_of(LEAF as usize), leaf[0]);
            } else {
                let index = nodes.len();
                nodes.push(Node::EMPTY);
                nodes[node].set(lane, source.aabb(), Child::Node(index));
                open.push((child, index, depth + 1));
            }
        }
    }
    Some((nodes, order, deepest))
}

/// The largest f32 vector not above `v`.
pub(super) fn round_down(v: DVec3) -> Vec3A {
    let down = |x: f64| {
        let y = x as f32;
        if f64::from(y) > x { y.next_down() } else { y }
    };
    Vec3A::new(down(v.x), down(v.y), down(v.z))
}

/// The smallest f32 vector not below `v`.
pub(super) fn round_up(v: DVec3) -> Vec3A {
    -round_down(-v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_input_gives_shallow_trees() {
        // Boxes inside each other, sizes from 2^0 to 2^-400, and 10000 equal ones.
        let nested = Tree::build(400, |i| {
            let size = DVec3::splat(libm::ldexp(1.0, -(i as i32)));
            Bounds { min: -size, max: size }
        });
        let equal = Tree::build(10_000, |_| Bounds { min: DVec3::ZERO, max: DVec3::ONE });
        let line = Tree::build(1000, |i| {
            let p = DVec3::X * libm::ldexp(1.0, i as i32 - 500);
            Bounds { min: p, max: p }
        });
        for (tree, count) in [(nested, 400), (equal, 10_000), (line, 1000)] {
            let mut order = tree.order.clone();
            order.sort_unstable();
            // What fills leaves is in there a second time.
            order.dedup();
            assert!(order.into_iter().eq(0..count));
        }
        let boxes = vec![Aabb { min: Vec3A::ZERO, max: Vec3A::ONE }; 1000];
        let (binary, order) = halve(&boxes);
        assert_eq!(order.len(), 1000);
        assert!(widen(&binary, &order).is_some());
    }

    #[test]
    fn boxes_that_meet_are_those_that_a_look_at_all_finds() {
        // Boxes of many sizes about a curve that fills space, some of them points.
        let boxes: Vec<Bounds> = (0..500)
            .map(|i| {
                let t = f64::from(i);
                let centre = DVec3::new((1.7 * t).sin(), (2.3 * t).sin(), (3.1 * t).cos()) * 1e3;
                let half = DVec3::splat(f64::from(i % 7) * 9.0);
                Bounds { min: centre - half, max: centre + half }
            })
            .collect();
        let tree = Tree::build(boxes.len(), |i| boxes[i]);
        assert!((tree.reach() - boxes.iter().map(Bounds::reach).fold(0.0, f64::max)).abs() <= 1e-9);
        for search in &boxes {
            let meets = |b: &Bounds| b.min.cmple(search.max).all() && search.min.cmple(b.max).all();
            let mut found = Vec::new();
            tree.any_meeting(search, |i| {
                found.push(i as usize);
                false
            });
            assert!((0..boxes.len()).filter(|&i| meets(&boxes[i])).all(|i| found.contains(&i)));
            assert!(found.len() < 100, "most boxes are far away");
            assert!(tree.any_meeting(search, |i| meets(&boxes[i as usize])));
        }
        let nowhere = Bounds { min: DVec3::splat(2e3), max: DVec3::splat(3e3) };
        assert!(!tree.any_meeting(&nowhere, |_| true));
        assert!(!Tree::default().any_meeting(&nowhere, |_| true));
    }

    #[test]
    fn rounding_is_outward() {
        for x in [0.1, -0.1, 1e-50, -1e-50, 1e300, -1e300, 0.5, 0.0] {
            let v = DVec3::splat(x);
            assert!(f64::from(round_down(v).x) <= x && x <= f64::from(round_up(v).x));
        }
        assert_eq!(round_up(DVec3::splat(0.5)), Vec3A::splat(0.5));
    }
}
