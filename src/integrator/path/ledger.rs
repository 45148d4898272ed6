//! What a path brings back, divided among the layers that show a part of it.
//!
//! Every layer has a [light path expression](crate::integrator::light_path). Where a surface scatters in several ways at once, a
//! path is in several sets of states with the share of its light that belongs to each, so that parts which exclude each other sum to the
//! whole sample by sample. Without such layers nothing of this is done.

use crate::integrator::light_path::{Event, Expression, States};
use crate::spectrum::SampledSpectrum;

/// Where a path may be in an expression, and the share of its light that is there.
pub(super) type Branches<const N: usize> = Vec<(States, SampledSpectrum<N>)>;

/// Of one path after the other.
#[derive(Debug)]
pub(super) struct Ledger<'a, const N: usize> {
    /// All light, radiance per nm.
    pub(super) total: SampledSpectrum<N>,
    parts: Vec<Part<'a, N>>,
}

/// One layer's part.
#[derive(Debug)]
struct Part<'a, const N: usize> {
    expression: &'a Expression,
    sum: SampledSpectrum<N>,
    branches: Branches<N>,
}

impl<'a, const N: usize> Ledger<'a, N> {
    pub(super) fn new(expressions: &'a [Expression]) -> Self {
        let part = |expression| Part { expression, sum: SampledSpectrum::ZERO, branches: Vec::new() };
        Self { total: SampledSpectrum::ZERO, parts: expressions.iter().map(part).collect() }
    }

    /// Begins a path.
    pub(super) fn restart(&mut self) {
        self.total = SampledSpectrum::ZERO;
        for part in &mut self.parts {
            part.sum = SampledSpectrum::ZERO;
            part.branches.clear();
            part.branches.push((part.expression.start(), SampledSpectrum::ONE));
        }
    }

    /// Whether somebody asks how surfaces scatter.
    pub(super) fn is_divided(&self) -> bool {
        !self.parts.is_empty()
    }

    /// The light of each part, in the order of the expressions.
    pub(super) fn parts(&self) -> impl Iterator<Item = SampledSpectrum<N>> {
        self.parts.iter().map(|part| part.sum)
    }

    /// A surface scatters the path in one of these ways, with their shares of the light.
    pub(super) fn scatter(&mut self, ways: &[(Event, SampledSpectrum<N>)]) {
        for part in &mut self.parts {
            let before = std::mem::take(&mut part.branches);
            for (states, weight) in before {
                for &(event, share) in ways {
                    let next = part.expression.step(states, &event);
                    let weight = weight * share;
                    if next.is_dead() || weight.is_black() {
                        continue;
                    }
                    match part.branches.iter_mut().find(|(states, _)| *states == next) {
                        Some((_, sum)) => *sum += weight,
                        None => part.branches.push((next, weight)),
                    }
                }
            }
        }
    }

    /// Where the path is in all expressions, to return to.
    pub(super) fn branches(&self) -> Vec<Branches<N>> {
        self.parts.iter().map(|part| part.branches.clone()).collect()
    }

    /// Goes back to where the path was.
    pub(super) fn return_to(&mut self, branches: Vec<Branches<N>>) {
        for (part, branches) in self.parts.iter_mut().zip(branches) {
            part.branches = branches;
        }
    }

    /// Light that the path's ray has met.
    pub(super) fn add(&mut self, light: SampledSpectrum<N>, emission: Event) {
        self.total += light;
        for part in &mut self.parts {
            for &(states, weight) in &part.branches {
                if part.expression.accepts(part.expression.step(states, &emission)) {
                    part.sum += light * weight;
                }
            }
        }
    }

    /// Light that a surface scatters into the path in these ways, which sum to what is added.
    pub(super) fn add_scattered(&mut self, ways: &[(Event, SampledSpectrum<N>)], emission: Event) {
        for &(event, light) in ways {
            self.total += light;
            for part in &mut self.parts {
                for &(states, weight) in &part.branches {
                    let after = part.expression.step(states, &event);
                    if !after.is_dead() && part.expression.accepts(part.expression.step(after, &emission)) {
                        part.sum += light * weight;
                    }
                }
            }
        }
    }
}
