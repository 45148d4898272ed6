//! Manifests: which path an identifier means.
//!
//! Identifiers count from 1 in the order of first use. An entry is a path, or a path with index lists, which stands for
//! as many consecutive identifiers as it has combinations of indices, the last list running fastest:
//! `/World/Scatter[0:1000]` for `/World/Scatter[0]` to `/World/Scatter[999]`, and `/World/Outer[0:2,5]/Bush/Leaves[0:50]` for
//! 150 elements of an instancer within a prototype. Prim paths have no brackets, so that an entry cannot be mistaken.

use std::collections::HashMap;
use std::fmt::Write;

/// Identifiers are 32-bit.
const MAX_ID: u64 = u32::MAX as u64;

/// Paths by identifier; identifiers count from 1.
#[derive(Clone, Debug, Default)]
pub struct Manifest {
    entries: Vec<String>,
    /// Identifier of the first path of each entry.
    firsts: Vec<u32>,
    by_entry: HashMap<String, u32>,
    used: u64,
}

impl Manifest {
    /// The identifier of `entry`'s first path; it stands for `count` of them. `None` if there are no more identifiers.
    pub(super) fn id(&mut self, entry: &str, count: u64) -> Option<u32> {
        if let Some(&id) = self.by_entry.get(entry) {
            return Some(id);
        }
        let first = self.used + 1;
        let used = self.used.checked_add(count).filter(|&used| used <= MAX_ID)?;
        self.used = used;
        self.entries.push(entry.to_owned());
        self.firsts.push(first as u32);
        self.by_entry.insert(entry.to_owned(), first as u32);
        Some(first as u32)
    }

    /// The identifier of `entry`'s first path; `None` where there is no such entry.
    pub(super) fn find(&self, entry: &str) -> Option<u32> {
        self.by_entry.get(entry).copied()
    }

    /// The entries in the order of their identifiers.
    pub fn entries(&self) -> &[String] {
        &self.entries
    }

    /// How many identifiers there are.
    pub fn len(&self) -> u64 {
        self.used
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// The path behind an identifier; `None` for 0 and for what is no identifier.
    pub fn path(&self, id: u32) -> Option<String> {
        if id == 0 || u64::from(id) > self.used {
            return None;
        }
        let entry = self.firsts.partition_point(|&first| first <= id) - 1;
        Some(nth(&self.entries[entry], u64::from(id - self.firsts[entry])))
    }
}

/// The `n`-th path that an entry stands for.
fn nth(entry: &str, n: u64) -> String {
    let (mut rest, mut path) = (n, String::new());
    // From the last list, which runs fastest, to the first; pieces come in reverse.
    let mut pieces = Vec::new();
    let mut head = entry;
    while let Some((before, list)) = head.strip_suffix(']').and_then(|s| s.rsplit_once('[')) {
        let runs = || list.split(',').filter_map(run);
        let length: u64 = runs().map(|(low, high)| high - low).sum();
        let (mut at, mut index) = (rest % length.max(1), 0);
        rest /= length.max(1);
        for (low, high) in runs() {
            if at < high - low {
                index = low + at;
                break;
            }
            at -= high - low;
        }
        // What stands between this list and the one before it.
        let cut = before.rfind(']').map_or(0, |i| i + 1);
        pieces.push(format!("{}[{index}]", &before[cut..]));
        head = &before[..cut];
    }
    path.push_str(head);
    pieces.iter().rev().for_each(|piece| path.push_str(piece));
    path
}

/// `low:high`, or a single index.
fn run(text: &str) -> Option<(u64, u64)> {
    match text.split_once(':') {
        Some((low, high)) => Some((low.parse().ok()?, high.parse().ok()?)),
        None => text.parse().ok().map(|i: u64| (i, i + 1)),
    }
}

/// Increasing indices as a list of runs: `0:3,5,7:9`.
pub(super) fn runs(indices: impl Iterator<Item = u32>) -> String {
    let mut text = String::new();
    let mut open: Option<(u32, u32)> = None;
    let mut close = |run: Option<(u32, u32)>| {
        let Some((low, high)) = run else { return };
        let comma = if text.is_empty() { "" } else { "," };
        let written = if high - low == 1 { write!(text, "{comma}{low}") } else { write!(text, "{comma}{low}:{high}") };
        written.expect("a string takes all");
    };
    for index in indices {
        open = match open {
            Some((low, high)) if high == index => Some((low, high + 1)),
            other => {
                close(other);
                Some((index, index + 1))
            }
        };
    }
    close(open);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_identifier_has_its_path() {
        let mut manifest = Manifest::default();
        assert_eq!(manifest.id("/A", 1), Some(1));
        assert_eq!(manifest.id("/S[0:3]", 3), Some(2));
        assert_eq!(manifest.id("/A", 1), Some(1));
        assert_eq!(manifest.id("/S[0:2,5]/Bush/Leaves[0:2]", 6), Some(5));
        assert_eq!(manifest.id("/B", 1), Some(11));
        let mut expected = vec!["/A".to_owned()];
        expected.extend((0..3).map(|i| format!("/S[{i}]")));
        expected.extend([0, 1, 5].into_iter().flat_map(|i| (0..2).map(move |k| format!("/S[{i}]/Bush/Leaves[{k}]"))));
        expected.push("/B".to_owned());
        assert!((1..=11).map(|id| manifest.path(id).unwrap()).eq(expected));
        assert_eq!((manifest.path(0), manifest.path(12)), (None, None));
        assert_eq!((manifest.len(), manifest.entries().len()), (11, 4));
    }

    #[test]
    fn identifiers_end_at_32_bits() {
        let mut manifest = Manifest::default();
        assert_eq!(manifest.id("/A[0:4294967295]", MAX_ID), Some(1));
        assert_eq!(manifest.id("/B", 1), None);
        assert_eq!(manifest.path(u32::MAX), Some("/A[4294967294]".to_owned()));
    }

    #[test]
    fn indices_are_written_as_runs() {
        assert_eq!(runs([0, 1, 2, 5, 7, 8].into_iter()), "0:3,5,7:9");
        assert_eq!(runs([4].into_iter()), "4");
        assert_eq!(runs(std::iter::empty()), "");
    }
}
