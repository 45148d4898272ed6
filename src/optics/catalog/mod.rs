//! The optical materials that the renderer carries: glasses of the makers, crystals, liquids, plastics, gases, metals.
//!
//! The data are those of the refractiveindex.info database (Polyanskiy 2024, Sci. Data 11, 94; CC0 1.0), written into
//! `catalog.tsv` by `generate.py`, which says what is carried and how to run it. The file is part of the program as it
//! stands: one line an entry, sorted by what one looks up. Naming a material is a binary search through its bytes, and only
//! the line found is ever parsed; a program that names none never touches it.
//!
//! Names: a glass is `MAKER:GLASS` (`SCHOTT:N-BK7`), a substance `substance:Page` (`diamond:Peter`). What stands behind a
//! maker's colon is enough where one maker has it, and a bare substance is its usual page. Case, blanks, `-` and `_` do not
//! count.

mod entry;
mod lookup;
mod suggest;

pub use entry::{Category, Entry, Status};

use lookup::Record;

/// The release of the refractiveindex.info database that the data are from.
pub const DATABASE_VERSION: &str = "v2026-05-24";

/// The licence of the data: public domain dedication.
pub const DATABASE_LICENSE: &str = "CC0-1.0";

/// The entry of this name.
///
/// An error says what was asked for and which names are close, or, for a glass of several makers, whose there are.
pub fn find(name: &str) -> Result<Entry, String> {
    let name = name.trim();
    if name.is_empty() {
        return Err("no name is given: \"SCHOTT:N-BK7\" or \"water\" would be one".to_owned());
    }
    let found = match name.split_once(':') {
        Some((before, after)) => {
            let (before, after) = (key(before), key(after));
            lookup::exact(&after, &before).or_else(|| lookup::exact(&before, &after))
        }
        None => None,
    };
    if let Some(entry) = found {
        return Ok(entry);
    }
    let candidates = lookup::of_key(&key(name));
    if let Some(Record::Alias { target, .. }) = candidates.first() {
        return Ok(resolved(target));
    }
    let entries: Vec<Entry> = candidates.iter().filter_map(Record::entry).collect();
    match entries.as_slice() {
        [entry] => Ok(*entry),
        [] => Err(suggest::unknown(name)),
        several => {
            let names: Vec<&str> = several.iter().map(Entry::name).collect();
            Err(format!("\"{name}\" is the name of several: {}: name one of them in full", names.join(", ")))
        }
    }
}

/// All entries, in the order of their keys.
pub fn entries() -> impl Iterator<Item = Entry> {
    lookup::records().filter_map(|record| record.entry())
}

/// The entry whose n_d is nearest to `nd`, among glasses of the makers and what else clear everyday objects are made of
/// (solids and liquids): what a material with an index and no more may be.
///
/// Of two that are as near, the one that its maker prefers comes first, then the one whose name does.
pub fn nearest(nd: f64) -> Entry {
    let mut best: Option<(f64, Entry)> = None;
    for entry in entries().filter(Entry::is_common) {
        let distance = (entry.nd() - nd).abs();
        let closer = best.is_none_or(|(least, other)| {
            distance.total_cmp(&least).then_with(|| entry.preference().cmp(&other.preference())).is_lt()
        });
        if closer && entry.is_clear() {
            best = Some((distance, entry));
        }
    }
    best.expect("the catalogue has a clear glass").1
}

/// The entry that an alias of the data names in full.
fn resolved(target: &str) -> Entry {
    let (before, after) = target.split_once(':').expect("an alias names an entry in full");
    let (before, after) = (key(before), key(after));
    lookup::exact(&before, &after)
        .or_else(|| lookup::exact(&after, &before))
        .expect("an alias names an entry that is there (tested)")
}

/// What counts of a name: no case, blanks, `-` or `_`, and Greek letters of crystal axes spelled out.
fn key(name: &str) -> String {
    let mut key = String::with_capacity(name.len());
    for c in name.chars().flat_map(char::to_lowercase) {
        match c {
            '-' | '_' => (),
            'α' => key.push_str("alpha"),
            'β' => key.push_str("beta"),
            'γ' => key.push_str("gamma"),
            c if c.is_whitespace() => (),
            c => key.push(c),
        }
    }
    key
}

#[cfg(test)]
mod tests;
