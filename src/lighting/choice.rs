//! The choice of a light for a receiver: among trees of lights and the lights that are infinitely far.
//!
//! Lights are in sets by what they illuminate; only the sets that a receiver is in take part, so that a light that is not
//! linked to it is never chosen and nobody has to be corrected for it. Each tree and each infinite light is a candidate, chosen in
//! proportion to the irradiance that may come from it; a tenth of the choices is even, because those estimates ignore what stands
//! in between.

use glam::DVec3;

use super::tree::{LightBounds, LightTree, Way};

/// Part of the choices between candidates that is even.
const EVEN: f64 = 0.1;

/// Where a light is to be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// It is never chosen.
    Nowhere,
    /// At the end of a way through the tree of a set.
    InTree { set: u32, way: Way },
    /// Among the infinite lights of a set.
    Infinite { set: u32, index: u32 },
}

/// A light that is infinitely far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Infinite {
    pub(super) emitter: u32,
    /// Where it is, and the cosine of how far around that; `None` for everywhere.
    pub(super) toward: Option<(DVec3, f64)>,
    /// At normal incidence.
    pub(super) irradiance: f64,
}

impl Infinite {
    fn importance(&self, normal: Option<DVec3>) -> f64 {
        let (Some((toward, cosine)), Some(n)) = (self.toward, normal) else { return self.irradiance };
        let height = n.dot(toward).clamp(-1.0, 1.0);
        let received = if height >= cosine {
            1.0
        } else {
            // cos(a − b), with the sines of angles up to π.
            let sine = |c: f64| (1.0 - c * c).max(0.0).sqrt();
            height * cosine + sine(height) * sine(cosine)
        };
        // The normal comes in single precision.
        self.irradiance * (received + f64::from(f32::EPSILON)).max(0.0)
    }
}

/// Lights that illuminate the same objects.
#[derive(Debug, Default)]
struct Set {
    /// Link set; everything if absent.
    illuminates: Option<u32>,
    tree: LightTree,
    infinite: Vec<Infinite>,
}

/// All lights that can be chosen.
#[derive(Debug, Default)]
pub(super) struct Choice {
    sets: Vec<Set>,
}

/// What a choice is made for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chooser {
    pub(super) point: DVec3,
    pub(super) normal: Option<DVec3>,
}

/// Lights, while they are collected.
#[derive(Debug, Default)]
pub(super) struct Candidates {
    sets: Vec<Collected>,
}

/// Lights that illuminate the same objects, while they are collected.
#[derive(Debug, Default)]
struct Collected {
    illuminates: Option<u32>,
    /// By their emitter.
    bounded: Vec<(u32, LightBounds)>,
    infinite: Vec<Infinite>,
}

impl Candidates {
    fn set(&mut self, illuminates: Option<u32>) -> &mut Collected {
        let known = self.sets.iter().position(|set| set.illuminates == illuminates);
        let index = known.unwrap_or_else(|| {
            self.sets.push(Collected { illuminates, ..Collected::default() });
            self.sets.len() - 1
        });
        &mut self.sets[index]
    }

    pub(super) fn add(&mut self, illuminates: Option<u32>, emitter: u32, bounds: LightBounds) {
        let is_usable = bounds.intensity > 0.0 && bounds.intensity.is_finite() && bounds.bounds.reach().is_finite();
        if is_usable {
            self.set(illuminates).bounded.push((emitter, bounds));
        }
    }

    pub(super) fn add_infinite(&mut self, illuminates: Option<u32>, infinite: Infinite) {
        if infinite.irradiance > 0.0 {
            self.set(illuminates).infinite.push(infinite);
        }
    }

    /// The choice, and the place of each of so many emitters.
    pub(super) fn build(self, emitters: usize) -> (Choice, Vec<Place>) {
        let mut places = vec![Place::Nowhere; emitters];
        let mut sets = Vec::new();
        for Collected { illuminates, bounded, infinite } in self.sets {
            let set = sets.len() as u32;
            for (index, light) in infinite.iter().enumerate() {
                places[light.emitter as usize] = Place::Infinite { set, index: index as u32 };
            }
            let tree = LightTree::build(bounded, |emitter, way| {
                places[emitter as usize] = Place::InTree { set, way };
            });
            sets.push(Set { illuminates, tree, infinite });
        }
        (Choice { sets }, places)
    }
}

/// A candidate: a tree or an infinite light of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Candidate {
    Tree(u32),
    Infinite(u32, u32),
}

impl Choice {
    /// Calls `f` with every candidate that may contribute and its importance, in a fixed order.
    fn each(&self, chooser: &Chooser, is_linked: &impl Fn(u32) -> bool, mut f: impl FnMut(Candidate, f64)) {
        for (number, set) in self.sets.iter().enumerate() {
            if set.illuminates.is_some_and(|link| !is_linked(link)) {
                continue;
            }
            if !set.tree.is_empty() {
                let importance = set.tree.importance(chooser.point, chooser.normal);
                if importance > 0.0 {
                    f(Candidate::Tree(number as u32), importance);
                }
            }
            for (index, light) in set.infinite.iter().enumerate() {
                let importance = light.importance(chooser.normal);
                if importance > 0.0 {
                    f(Candidate::Infinite(number as u32, index as u32), importance);
                }
            }
        }
    }

    /// The tree that is the only candidate there is.
    #[inline]
    fn lone_tree(&self) -> Option<&Set> {
        match &self.sets[..] {
            [set] if set.infinite.is_empty() && !set.tree.is_empty() => Some(set),
            _ => None,
        }
    }

    /// Sum of the importances, and how many there are.
    fn total(&self, chooser: &Chooser, is_linked: &impl Fn(u32) -> bool) -> (f64, f64) {
        let (mut sum, mut count) = (0.0, 0.0);
        self.each(chooser, is_linked, |_, importance| {
            sum += importance;
            count += 1.0;
        });
        (sum, count)
    }

    fn share(importance: f64, (sum, count): (f64, f64)) -> f64 {
        (1.0 - EVEN) * importance / sum + EVEN / count
    }

    /// The emitter of a light and the probability with which it is chosen; `u`, in 0..1, is asked for where there is a choice.
    pub(super) fn sample(
        &self,
        chooser: &Chooser,
        is_linked: impl Fn(u32) -> bool,
        u: impl FnOnce() -> f64,
    ) -> Option<(u32, f64)> {
        // Nothing to compare it with: no importance is needed.
        if let Some(Set { illuminates, tree, .. }) = self.lone_tree() {
            let is_possible = illuminates.is_none_or(&is_linked) && tree.may_reach(chooser.point, chooser.normal);
            return if is_possible { tree.sample(chooser.point, chooser.normal, u) } else { None };
        }
        let (u, total) = (u(), self.total(chooser, &is_linked));
        let mut up_to = 0.0;
        let mut chosen = None;
        self.each(chooser, &is_linked, |candidate, importance| {
            // The last candidate has what rounding leaves.
            if chosen.is_none() || u >= up_to {
                let share = Self::share(importance, total);
                chosen = Some((candidate, share, (u - up_to) / share));
                up_to += share;
            }
        });
        let (candidate, share, rest) = chosen?;
        match candidate {
            Candidate::Infinite(set, index) => Some((self.sets[set as usize].infinite[index as usize].emitter, share)),
            Candidate::Tree(set) => {
                let rest = rest.clamp(0.0, 1.0 - f64::EPSILON);
                let (emitter, probability) =
                    self.sets[set as usize].tree.sample(chooser.point, chooser.normal, || rest)?;
                Some((emitter, share * probability))
            }
        }
    }

    /// The probability with which the light at a place is chosen.
    pub(super) fn probability(&self, chooser: &Chooser, is_linked: impl Fn(u32) -> bool, place: Place) -> f64 {
        let wanted = match (place, self.lone_tree()) {
            (Place::Nowhere, _) => return 0.0,
            (Place::InTree { way, .. }, Some(Set { illuminates, tree, .. })) => {
                let is_possible = illuminates.is_none_or(&is_linked) && tree.may_reach(chooser.point, chooser.normal);
                return if is_possible { tree.probability(chooser.point, chooser.normal, way) } else { 0.0 };
            }
            (Place::InTree { set, .. }, None) => Candidate::Tree(set),
            (Place::Infinite { set, index }, _) => Candidate::Infinite(set, index),
        };
        let (mut sum, mut count, mut own) = (0.0, 0.0, 0.0);
        self.each(chooser, &is_linked, |candidate, importance| {
            sum += importance;
            count += 1.0;
            if candidate == wanted {
                own = importance;
            }
        });
        if own <= 0.0 {
            return 0.0;
        }
        let share = Self::share(own, (sum, count));
        match place {
            Place::InTree { set, way } => {
                share * self.sets[set as usize].tree.probability(chooser.point, chooser.normal, way)
            }
            _ => share,
        }
    }
}
