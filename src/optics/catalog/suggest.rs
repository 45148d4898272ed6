//! What somebody may have meant who wrote a name that is not in the catalogue.

use std::collections::BTreeMap;

use super::lookup::{Record, records};
use super::{Entry, key, resolved};

/// More would not be read.
const MOST_SUGGESTIONS: usize = 5;

/// Longer than any name in the catalogue; a limit on what a hostile file can make us compare.
const LONGEST_NAME: usize = 64;

/// How near a name is: edits, then whether it contains what was asked for, then what the maker prefers.
type Rank = (usize, bool, super::Status);

/// The error for a name that is unknown.
pub(super) fn unknown(name: &str) -> String {
    let close = close_to(name);
    if close.is_empty() {
        return format!("\"{name}\" is not in the catalogue: `abbe glass list` shows what is");
    }
    format!("\"{name}\" is not in the catalogue: did you mean {}? `abbe glass list` shows all", close.join(", "))
}

/// Names within a few edits (insertion, deletion, substitution, transposition), the nearest first.
fn close_to(name: &str) -> Vec<String> {
    let asked = key(name);
    let bare = name.split_once(':').map_or_else(|| asked.clone(), |(_, after)| key(after));
    // A single letter is one edit from every other.
    if !(2..=LONGEST_NAME).contains(&bare.chars().count()) {
        return Vec::new();
    }
    // One slip in a short name, two in a longer one.
    let most = 1 + bare.chars().count() / 5;
    let mut found: BTreeMap<String, Rank> = BTreeMap::new();
    for record in records() {
        let known = match record {
            Record::Alias { key, .. } => key,
            Record::Entry(entry) => entry.key(),
        };
        let mut edits = strsim::osa_distance(&bare, known);
        if asked.contains(':') {
            // A maker that is wrong or misspelled must not hide the glass: that is one slip.
            edits += 1;
            if let Record::Entry(entry) = record {
                edits = edits.min(strsim::osa_distance(&asked, &key(entry.name())));
            }
        }
        if edits > most {
            continue;
        }
        let (entry, shown) = match record {
            Record::Alias { target, .. } => (resolved(target), shortest_name(known, resolved(target))),
            Record::Entry(entry) => (entry, entry.name().to_owned()),
        };
        let rank = (edits, !known.contains(&bare), entry.status());
        let best = found.entry(shown).or_insert(rank);
        *best = rank.min(*best);
    }
    let mut ranked: Vec<(Rank, String)> = found.into_iter().map(|(name, rank)| (rank, name)).collect();
    ranked.sort();
    ranked.into_iter().map(|(_, name)| name).take(MOST_SUGGESTIONS).collect()
}

/// The bare name of an entry if that is the alias, else its full name.
fn shortest_name(alias: &str, entry: Entry) -> String {
    if entry.key() == alias { entry.bare_name().to_owned() } else { entry.name().to_owned() }
}
