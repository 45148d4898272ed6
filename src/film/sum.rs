//! Sums over samples that do not depend on how the samples were grouped.
//!
//! The sum over sample indices `begin..end` is that of a fixed binary tree over the index: a node at level `m` covers
//! `[k·2ᵐ, (k+1)·2ᵐ)`. A render split at aligned indices computes whole nodes of the same tree, so merging the parts gives
//! the same bits as rendering in one go. The error grows with log₂ of the number of samples instead of linearly.

/// A running sum over consecutive sample indices.
///
/// At most one open node per level is kept, as in a binary counter; an absent sample adds exactly zero.
#[derive(Clone, Debug)]
pub struct TreeSum {
    next: u32,
    /// Open nodes with their levels, the largest first.
    open: Vec<(u32, f64)>,
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
        Self { next: begin, open: Vec::with_capacity(8) }
    }

    /// Starts again at index `begin`, keeping the memory.
    pub fn restart(&mut self, begin: u32) {
        self.next = begin;
        self.open.clear();
    }

    /// Adds the sample with the next index.
    #[inline]
    pub fn push(&mut self, value: f64) {
        if self.next & 1 == 0 {
            // It closes nothing.
            self.next += 1;
            self.open.push((0, value));
        } else {
            self.push_node(0, value);
        }
    }

    /// Adds a whole part: the finished sum over the next `count` indices, an aligned range.
    pub fn push_range(&mut self, count: u32, sum: f64) {
        self.push_node(count.next_power_of_two().trailing_zeros(), sum);
    }

    fn push_node(&mut self, level: u32, value: f64) {
        let (mut level, mut value) = (level, value);
        let index = self.next >> level;
        let mut k = index;
        self.next = (index + 1) << level;
        // An odd node closes its parent: add it to the open sibling on its left.
        while k & 1 == 1 {
            match self.open.last() {
                Some(&(open_level, left)) if open_level == level => {
                    value += left;
                    self.open.pop();
                    level += 1;
                    k >>= 1;
                }
                _ => break,
            }
        }
        self.open.push((level, value));
    }

    /// The sum: open nodes are added from the smallest to the largest.
    pub fn total(&self) -> f64 {
        let mut nodes = self.open.iter().rev();
        let first = nodes.next().map_or(0.0, |&(_, value)| value);
        nodes.fold(first, |sum, &(_, value)| value + sum)
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
