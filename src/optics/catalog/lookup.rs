//! Binary search in the lines of the data.

use std::cmp::Ordering;

use super::Entry;

/// Sorted lines, see the head of the file.
static DATA: &str = include_str!("catalog.tsv");

/// A line of the data.
#[derive(Clone, Copy, Debug)]
pub(super) enum Record {
    Entry(Entry),
    /// Another name for an entry: the key of that name, and the entry's name in full.
    Alias {
        key: &'static str,
        target: &'static str,
    },
}

impl Record {
    fn of_line(line: &'static str) -> Self {
        let mut cells = line.splitn(4, '\t');
        let (key, _, name) = (cells.next(), cells.next(), cells.next());
        match name.and_then(|name| name.strip_prefix('=')) {
            Some(target) => Self::Alias { key: key.unwrap_or_default(), target },
            None => Self::Entry(Entry::of_line(line)),
        }
    }

    pub(super) fn entry(&self) -> Option<Entry> {
        match self {
            Self::Entry(entry) => Some(*entry),
            Self::Alias { .. } => None,
        }
    }
}

/// All lines of the data but its head.
pub(super) fn records() -> impl Iterator<Item = Record> {
    DATA.lines().filter(|line| !is_comment(line)).map(Record::of_line)
}

/// The lines whose first key this is; an alias comes first.
pub(super) fn of_key(key: &str) -> Vec<Record> {
    let first = lower_bound(|line| keys(line).0.cmp(key));
    DATA[first..].lines().take_while(|line| keys(line).0 == key).map(Record::of_line).collect()
}

/// The entry with these two keys.
pub(super) fn exact(key: &str, qualifier: &str) -> Option<Entry> {
    let first = lower_bound(|line| keys(line).cmp(&(key, qualifier)));
    let line = DATA[first..].lines().next()?;
    (keys(line) == (key, qualifier)).then(|| Record::of_line(line).entry()).flatten()
}

/// Where the first line begins that is not `Less`; the end of the data if all are.
fn lower_bound(order: impl Fn(&str) -> Ordering) -> usize {
    // Both are always the begin of a line, or the end of the data.
    let (mut low, mut high) = (0, DATA.len());
    while low < high {
        let middle = (low..=low + (high - low) / 2).rev().find(|&at| DATA.is_char_boundary(at)).unwrap_or(low);
        let begin = DATA[low..middle].rfind('\n').map_or(low, |at| low + at + 1);
        let line = DATA[begin..].lines().next().unwrap_or_default();
        if is_comment(line) || order(line) == Ordering::Less {
            low = begin + line.len() + 1;
        } else {
            high = begin;
        }
    }
    low.min(DATA.len())
}

fn is_comment(line: &str) -> bool {
    line.starts_with('#')
}

fn keys(line: &str) -> (&str, &str) {
    let mut cells = line.splitn(3, '\t');
    (cells.next().unwrap_or_default(), cells.next().unwrap_or_default())
}
