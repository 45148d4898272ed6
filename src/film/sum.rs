//! Sums over samples that do not depend on how the samples were grouped.
//!
//! The sum over sample indices `begin..end` is that of a fixed binary tree over the index: a node at level `m` covers
//! `[k·2ᵐ, (k+1)·2ᵐ)`. A render split at aligned indices computes whole nodes of the same tree, so merging the parts gives
//! the same bits as rendering in one go. The error grows with log₂ of the number of samples instead of linearly.

/// A running sum over consecutive sample indices.
///
/// At most one open node per level is kept, as in a binary counter; an absent sample adds exactly zero.
#[derive(Clone, Debug)]
pub struct TreeSum(TreeSums);

/// Sums of as many channels, each of which is a [`TreeSum`]: their trees are one.
#[derive(Clone, Debug)]
pub struct TreeSums {
    channels: usize,
    next: u32,
    /// Levels of the open nodes, the largest first.
    levels: Vec<u32>,
    /// What they sum to, channel by channel, node by node.
    nodes: Vec<f64>,
}

/// Whether `begin..end` of a render of `total` samples is a whole node of the tree, or its unfinished tail.
pub fn is_aligned(begin: u32, end: u32, total: u32) -> bool {
    if begin >= end || end > total {
        return false;
    }
    let size = (end - begin).next_power_of_two();
    begin.is_multiple_of(size) && (end - begin == size || end == total)
}

impl TreeSum {
    /// An empty sum whose first sample has index `begin`.
    pub fn new(begin: u32) -> Self {
        Self(TreeSums::new(begin, 1))
    }

    /// Starts again at index `begin`, keeping the memory.
    pub fn restart(&mut self, begin: u32) {
        self.0.restart(begin);
    }

    /// Adds the sample with the next index.
    #[inline]
    pub fn push(&mut self, value: f64) {
        self.0.push(&[value]);
    }

    /// Adds a whole part: the finished sum over the next `count` indices, an aligned range.
    pub fn push_range(&mut self, count: u32, sum: f64) {
        self.0.push_range(count, &[sum]);
    }

    /// The sum: open nodes are added from the smallest to the largest.
    pub fn total(&self) -> f64 {
        self.0.total(0)
    }
}

impl TreeSums {
    /// Empty sums whose first sample has index `begin`.
    pub fn new(begin: u32, channels: usize) -> Self {
        Self { channels, next: begin, levels: Vec::with_capacity(8), nodes: Vec::with_capacity(8 * channels) }
    }

    /// How many there are.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// As [`TreeSum::restart`].
    pub fn restart(&mut self, begin: u32) {
        self.next = begin;
        self.levels.clear();
        self.nodes.clear();
    }

    /// As [`TreeSum::push`], one value for each channel.
    #[inline]
    pub fn push(&mut self, values: &[f64]) {
        debug_assert_eq!(values.len(), self.channels, "a value for each channel");
        self.nodes.extend_from_slice(values);
        self.close_leaf();
    }

    /// The same where the channels come one by one; what is missing is 0.
    pub fn push_each(&mut self, values: impl IntoIterator<Item = f64>) {
        self.nodes.extend(values.into_iter().chain(std::iter::repeat(0.0)).take(self.channels));
        self.close_leaf();
    }

    #[inline]
    fn close_leaf(&mut self) {
        if self.next & 1 == 0 {
            // It closes nothing.
            self.next += 1;
            self.levels.push(0);
        } else {
            self.close(0);
        }
    }

    /// As [`TreeSum::push_range`].
    pub fn push_range(&mut self, count: u32, sums: &[f64]) {
        debug_assert_eq!(sums.len(), self.channels, "a sum for each channel");
        self.nodes.extend_from_slice(sums);
        self.close(count.next_power_of_two().trailing_zeros());
    }

    /// The last of the nodes is new, and of this level.
    fn close(&mut self, mut level: u32) {
        let index = self.next >> level;
        let mut k = index;
        self.next = (index + 1) << level;
        // An odd node closes its parent: add it to the open sibling on its left.
        while k & 1 == 1 && self.levels.last() == Some(&level) {
            let last = self.nodes.len() - self.channels;
            let (rest, values) = self.nodes.split_at_mut(last);
            rest[last - self.channels..].iter_mut().zip(values).for_each(|(left, value)| *left += *value);
            self.nodes.truncate(last);
            self.levels.pop();
            level += 1;
            k >>= 1;
        }
        self.levels.push(level);
    }

    /// As [`TreeSum::total`], of one channel.
    pub fn total(&self, channel: usize) -> f64 {
        let mut nodes = self.nodes.iter().skip(channel).step_by(self.channels).rev();
        let first = nodes.next().copied().unwrap_or_default();
        nodes.fold(first, |sum, &value| value + sum)
    }

    /// All of them, channel by channel.
    pub fn totals(&self) -> impl Iterator<Item = f64> {
        (0..self.channels).map(|channel| self.total(channel))
    }
}

/// What a pixel stores of `count` valid samples that sum to `sum`: their mean, or 0 where there is none.
///
/// Whoever finishes a sum does it here, so that a merged render rounds like an undivided one.
pub fn mean(sum: f64, count: u32) -> f32 {
    if count == 0 { 0.0 } else { (sum / f64::from(count)) as f32 }
}

/// Unbiased estimate of the variance of the mean of `count` samples, from their sum and that of their squares; 0 where one
/// sample or none tells nothing of it.
pub fn variance_of_mean(sum: f64, squares: f64, count: u32) -> f64 {
    if count < 2 {
        return 0.0;
    }
    let n = f64::from(count);
    // Less than 0 by rounding only.
    ((squares - sum * sum / n) / (n * (n - 1.0))).max(0.0)
}

/// What the `valid` channel stores: the fraction of `samples` that have a value.
pub fn valid_fraction(count: u32, samples: u32) -> f32 {
    (f64::from(count) / f64::from(samples)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(i: u32) -> f64 {
        (f64::from(i) * 0.734_251).sin() * 10f64.powi((i % 13) as i32 - 6)
    }

    fn direct(begin: u32, end: u32) -> f64 {
        let mut sum = TreeSum::new(begin);
        (begin..end).for_each(|i| sum.push(sample(i)));
        sum.total()
    }

    #[test]
    fn aligned_parts_merge_to_the_same_bits() {
        for total in [1u32, 2, 3, 7, 12, 13, 16, 61, 100] {
            for size in [1u32, 2, 4, 8, 16, 32] {
                let mut merged = TreeSum::new(0);
                let mut begin = 0;
                while begin < total {
                    let end = (begin + size).min(total);
                    assert!(is_aligned(begin, end, total));
                    merged.push_range(end - begin, direct(begin, end));
                    begin = end;
                }
                assert_eq!(merged.total().to_bits(), direct(0, total).to_bits(), "{total} by {size}");
            }
        }
    }

    #[test]
    fn misaligned_ranges_are_known() {
        assert!(is_aligned(0, 12, 12) && is_aligned(8, 12, 12) && is_aligned(4, 8, 12));
        assert!(!is_aligned(2, 6, 12) && !is_aligned(0, 3, 12) && !is_aligned(3, 3, 12) && !is_aligned(8, 16, 12));
        assert!(!is_aligned(4, 12, 12), "spans two nodes of different parents");
    }
}
