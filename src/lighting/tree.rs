//! The light tree: one of many lights, chosen by power, distance and orientation on the way down from the root.
//!
//! A. Conty Estevez, C. Kulla, "Importance sampling of many lights with adaptive tree splitting", HPG 2018: a tree of bounds that is
//! built by a surface area heuristic with orientations, and an importance of a node for a receiver; both in the form of M. Pharr, W.
//! Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §12.6.3. Differences: φ is the radiant intensity towards where a light
//! is brightest, so that importances are irradiances; what is near counts as being as far away as its bounds reach; a
//! receiver with a normal receives from that side alone; lights on a line have a size.
//!
//! The importance is 0 only where nothing can arrive. Nodes are in single precision with their bounds outward, so that stays
//! true. The tree is the same on any number of threads.

use std::f64::consts::PI;

use glam::DVec3;

use super::cone::Cone;
use crate::geometry::Bounds;

/// Candidates for a border between two halves, along an axis.
const BUCKETS: usize = 12;
/// From this many lights on only the longest axis is tried.
const MANY: usize = 1024;
/// From this many lights on halves are built at the same time.
const PARALLEL: usize = 4096;
/// Below this depth the heuristic decides, deeper the number: 2^24 lights fit into the bits of a way.
const HEURISTIC_DEPTH: u32 = 40;
/// What rounding to single precision does to a cosine or an axis, and a little more.
const ROUNDING: f64 = 1e-6;

/// What is known of a light, or of several: where they are, which way they shine, how strongly.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    pub(super) bounds: Bounds,
    /// Of the normals.
    pub(super) normals: Cone,
    /// From a normal, up to which light goes, radians.
    pub(super) emission_angle: f64,
    /// The other way, too.
    pub(super) is_two_sided: bool,
    /// Radiant intensity towards where it is brightest.
    pub(super) intensity: f64,
}

impl LightBounds {
    fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            normals: self.normals.union(&other.normals),
            emission_angle: self.emission_angle.max(other.emission_angle),
            is_two_sided: self.is_two_sided || other.is_two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    fn middle(&self) -> DVec3 {
        0.5 * (self.bounds.min + self.bounds.max)
    }

    /// What lights in these bounds cost, but for the regularity of the bounds: intensity, orientations, area.
    fn cost(&self) -> f64 {
        let (theta, emission) = (self.normals.angle, self.emission_angle);
        let wide = (theta + emission).min(PI);
        let (sine, cosine) = (libm::sin(theta), libm::cos(theta));
        let orientations = 2.0 * PI * (1.0 - cosine)
            + PI / 2.0 * (2.0 * wide * sine - libm::cos(theta - 2.0 * wide) - 2.0 * theta * sine + cosine);
        let d = self.bounds.max - self.bounds.min;
        // Points on a line have no area, and are apart all the same.
        let area = 2.0 * (d.x * d.y + d.y * d.z + d.z * d.x) + 0.01 * d.length_squared();
        self.intensity * orientations * area
    }
}

/// A node: the bounds of its lights, and where its halves are.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [f32; 3],
    max: [f32; 3],
    axis: [f32; 3],
    cos_normals: f32,
    cos_emission: f32,
    intensity: f32,
    is_two_sided: bool,
    is_leaf: bool,
    /// The light of a leaf; else the second half. The first one follows the node.
    next: u32,
}

/// A tree over lights.
#[derive(Debug, Default)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// Scales intensities so that the largest fits into single precision, and back.
    scale: f64,
}

/// The way to a leaf: at each level from the root the lowest bit, 1 for the second half.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Way(u64);

/// A light of the tree, while it is built.
type Item = (u32, LightBounds);

impl LightTree {
    /// Over lights with finite bounds and positive intensity; tells `found` the way to each.
    pub(super) fn build(mut items: Vec<Item>, mut found: impl FnMut(u32, Way)) -> Self {
        if items.is_empty() {
            return Self::default();
        }
        assert!(items.len() < 1 << 24, "lights are counted before they are put into the tree");
        let total: f64 = items.iter().map(|(_, bounds)| bounds.intensity).sum();
        let scale = 1.0 / total;
        items.iter_mut().for_each(|(_, bounds)| bounds.intensity *= scale);
        let empty = Node::new(&items[0].1, true, 0);
        let mut nodes = vec![empty; 2 * items.len() - 1];
        split(&mut items, &mut nodes, 0, 0);
        let mut open = vec![(0, 0_u64, 0_u32)];
        while let Some((index, way, depth)) = open.pop() {
            let node: &Node = &nodes[index];
            if node.is_leaf {
                found(node.next, Way(way));
            } else {
                open.push((index + 1, way, depth + 1));
                open.push((node.next as usize, way | 1 << depth, depth + 1));
            }
        }
        Self { nodes, scale: total }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Irradiance that may arrive, in the units of the intensities; 0 only where nothing does.
    pub(super) fn importance(&self, p: DVec3, normal: Option<DVec3>) -> f64 {
        self.nodes.first().map_or(0.0, |root| self.scale * root.importance(p, normal))
    }

    /// Whether some of it is on the side of `normal`; a no is certain, and the importance then 0.
    pub(super) fn may_reach(&self, p: DVec3, normal: Option<DVec3>) -> bool {
        self.nodes.first().is_some_and(|root| normal.is_none_or(|normal| root.is_above(p, normal)))
    }

    /// A light and the probability with which it is chosen; `u`, in 0..1, is asked for where there is more than one.
    pub(super) fn sample(&self, p: DVec3, normal: Option<DVec3>, u: impl FnOnce() -> f64) -> Option<(u32, f64)> {
        let root = self.nodes.first()?;
        if root.is_leaf {
            return Some((root.next, 1.0));
        }
        let (mut index, mut probability, mut u) = (0, 1.0, u());
        loop {
            let node = self.nodes.get(index)?;
            if node.is_leaf {
                return Some((node.next, probability));
            }
            let first = self.first_half(index, p, normal)?;
            if u < first {
                (index, probability, u) = (index + 1, probability * first, u / first);
            } else {
                let second = 1.0 - first;
                (index, probability, u) = (node.next as usize, probability * second, (u - first) / second);
            }
            u = u.clamp(0.0, 1.0 - f64::EPSILON);
        }
    }

    /// The probability with which the light at the end of `way` is chosen.
    pub(super) fn probability(&self, p: DVec3, normal: Option<DVec3>, way: Way) -> f64 {
        let (mut index, mut probability, mut way) = (0, 1.0, way.0);
        while let Some(node) = self.nodes.get(index) {
            if node.is_leaf {
                return probability;
            }
            let Some(first) = self.first_half(index, p, normal) else { return 0.0 };
            if way & 1 == 0 {
                (index, probability) = (index + 1, probability * first);
            } else {
                (index, probability) = (node.next as usize, probability * (1.0 - first));
            }
            way >>= 1;
        }
        0.0
    }

    /// The probability of a node's first half; `None` if nothing of either arrives.
    fn first_half(&self, index: usize, p: DVec3, normal: Option<DVec3>) -> Option<f64> {
        let [first, second] =
            [index + 1, self.nodes[index].next as usize].map(|half| self.nodes[half].importance(p, normal));
        let sum = first + second;
        (sum > 0.0).then(|| if second > 0.0 { first / sum } else { 1.0 })
    }
}

/// Fills `nodes`, 2 n − 1 of them for n items, whose first will be number `at` of the tree; returns the bounds.
fn split(items: &mut [Item], nodes: &mut [Node], at: u32, depth: u32) -> LightBounds {
    let [(light, bounds)] = *items else {
        let middle = border(items, depth);
        let (low, high) = items.split_at_mut(middle);
        let (node, rest) = nodes.split_first_mut().expect("there is a node for each half");
        let (first, second) = rest.split_at_mut(2 * middle - 1);
        let second_at = at + 2 * middle as u32;
        let (a, b) = if low.len() + high.len() >= PARALLEL {
            rayon::join(|| split(low, first, at + 1, depth + 1), || split(high, second, second_at, depth + 1))
        } else {
            (split(low, first, at + 1, depth + 1), split(high, second, second_at, depth + 1))
        };
        let bounds = a.union(&b);
        *node = Node::new(&bounds, false, second_at);
        return bounds;
    };
    nodes[0] = Node::new(&bounds, true, light);
    bounds
}

/// Sorts items into two halves, neither empty; returns how many the first has.
fn border(items: &mut [Item], depth: u32) -> usize {
    let half = items.len() / 2;
    let all = items.iter().fold(Bounds::EMPTY, |all, (_, b)| all.union(&b.bounds));
    let middles = items.iter().fold(Bounds::EMPTY, |all, (_, b)| {
        let middle = b.middle();
        all.union(&Bounds { min: middle, max: middle })
    });
    let size = middles.max - middles.min;
    let longest = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    let by_number = |items: &mut [Item], axis: usize| {
        items
            .select_nth_unstable_by(half, |a, b| a.1.middle()[axis].total_cmp(&b.1.middle()[axis]).then(a.0.cmp(&b.0)));
        half
    };
    if size.max_element() <= 0.0 || depth >= HEURISTIC_DEPTH {
        return by_number(items, longest);
    }
    let bucket = |axis: usize, b: &LightBounds| {
        let t = (b.middle()[axis] - middles.min[axis]) / size[axis];
        ((t * BUCKETS as f64) as usize).min(BUCKETS - 1)
    };
    let diagonal = all.max - all.min;
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        if size[axis] <= 0.0 || (items.len() >= MANY && axis != longest) {
            continue;
        }
        let mut buckets: [Option<LightBounds>; BUCKETS] = [None; BUCKETS];
        for (_, b) in items.iter() {
            let held = &mut buckets[bucket(axis, b)];
            *held = Some(held.map_or(*b, |held| held.union(b)));
        }
        let join = |a: Option<LightBounds>, b: Option<LightBounds>| match (a, b) {
            (Some(a), Some(b)) => Some(a.union(&b)),
            (a, b) => a.or(b),
        };
        let mut above = [None; BUCKETS];
        for i in (0..BUCKETS - 1).rev() {
            above[i] = join(above[i + 1], buckets[i + 1]);
        }
        let mut below = None;
        for i in 0..BUCKETS - 1 {
            below = join(below, buckets[i]);
            if let (Some(below), Some(above)) = (&below, &above[i]) {
                let regularity = diagonal.max_element() / diagonal[axis].max(f64::MIN_POSITIVE);
                let cost = regularity * (below.cost() + above.cost());
                if cost > 0.0 && cost.is_finite() && best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, i));
                }
            }
        }
    }
    let Some((_, axis, last)) = best else { return by_number(items, longest) };
    // Items keep their order on both sides: the tree does not depend on how they are moved.
    let (low, high): (Vec<Item>, Vec<Item>) = items.iter().partition(|(_, b)| bucket(axis, b) <= last);
    let count = low.len();
    items[..count].copy_from_slice(&low);
    items[count..].copy_from_slice(&high);
    count
}

impl Node {
    fn new(b: &LightBounds, is_leaf: bool, next: u32) -> Self {
        let lower =
            |v: DVec3| v.to_array().map(|x| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 });
        let cosine = |angle: f64| if angle >= PI { -1.0 } else { ((libm::cos(angle) - ROUNDING) as f32).max(-1.0) };
        Self {
            min: lower(b.bounds.min),
            max: lower(-b.bounds.max).map(|x| -x),
            axis: b.normals.axis.as_vec3().to_array(),
            cos_normals: cosine(b.normals.angle),
            cos_emission: cosine(b.emission_angle),
            intensity: (b.intensity as f32).max(f32::MIN_POSITIVE),
            is_two_sided: b.is_two_sided,
            is_leaf,
            next,
        }
    }

    /// Whether a part of the sphere around the bounds is above the plane through `p`.
    fn is_above(&self, p: DVec3, normal: DVec3) -> bool {
        let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let (min, max) = (wide(self.min), wide(self.max));
        let radius_squared = 0.25 * (max - min).length_squared();
        let to = 0.5 * (min + max) - p;
        let height = to.dot(normal);
        // The normal comes in single precision.
        height > 0.0 || height * height <= radius_squared + 2.0 * ROUNDING * to.length_squared()
    }

    /// Irradiance that may arrive at `p`, on the side of `normal` or on both.
    fn importance(&self, p: DVec3, normal: Option<DVec3>) -> f64 {
        let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let (min, max) = (wide(self.min), wide(self.max));
        let radius_squared = 0.25 * (max - min).length_squared();
        let to = p - 0.5 * (min + max);
        let squared = to.length_squared();
        // Under which half angle the lights are seen: everything from among them.
        let (sin_b, cos_b) = if squared > radius_squared {
            let sin_squared = radius_squared / squared;
            (sin_squared.sqrt(), (1.0 - sin_squared).sqrt())
        } else {
            (0.0, -1.0)
        };
        let w = to * squared.max(f64::MIN_POSITIVE).sqrt().recip();
        let axis_cosine = wide(self.axis).dot(w);
        let cos_w = (if self.is_two_sided { axis_cosine.abs() } else { axis_cosine }).clamp(-1.0, 1.0);
        let sin_w = (1.0 - cos_w * cos_w).sqrt();
        let cos_o = f64::from(self.cos_normals);
        let sin_o = (1.0 - cos_o * cos_o).max(0.0).sqrt();
        let (sin_x, cos_x) = angle_less(sin_w, cos_w, sin_o, cos_o);
        let (_, cos_emitted) = angle_less(sin_x, cos_x, sin_b, cos_b);
        let cos_emission = f64::from(self.cos_emission);
        if cos_emitted <= cos_emission {
            return 0.0;
        }
        // Beyond a right angle (a spot of more than that) it is still within the emission.
        let emitted = cos_emitted.max(ROUNDING);
        let received = normal.map_or(1.0, |n| {
            let cosine = (-w.dot(n)).clamp(-1.0, 1.0);
            let sine = (1.0 - cosine * cosine).sqrt();
            // The normal comes in single precision.
            (angle_less(sine, cosine, sin_b, cos_b).1 + ROUNDING).max(0.0)
        });
        let distance_squared = squared.max(radius_squared).max(f64::MIN_POSITIVE);
        f64::from(self.intensity) * emitted * received / distance_squared
    }
}

/// Sine and cosine of max(0, a − b) from those of a and b.
fn angle_less(sin_a: f64, cos_a: f64, sin_b: f64, cos_b: f64) -> (f64, f64) {
    if cos_a > cos_b { (0.0, 1.0) } else { (sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b) }
}
