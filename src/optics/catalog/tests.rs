//! The data are sorted, complete and unambiguous, and what one looks up is what one gets. That the laws give the makers'
//! indices is tested in `tests/catalog.rs`.

use super::lookup::{Record, records};
use super::*;
use crate::optics::dispersion::OutOfRange;

#[test]
fn lines_are_sorted_and_keys_are_those_of_the_names() {
    let mut last = (String::new(), String::new());
    let mut seen = 0;
    for record in records() {
        let keys = match record {
            Record::Alias { key, .. } => (key.to_owned(), String::new()),
            Record::Entry(entry) => {
                let (before, after) = entry.name().split_once(':').expect("a qualified name");
                let (before, after) = (key(before), key(after));
                assert!(entry.key() == before || entry.key() == after, "{entry:?}");
                // The bare name comes after a maker, and before a page.
                if entry.key() == after { (after, before) } else { (before, after) }
            }
        };
        assert!(last < keys, "{last:?} stands before {keys:?}");
        last = keys;
        seen += 1;
    }
    assert!(seen > 2000, "{seen}");
}

#[test]
fn the_version_is_that_of_the_data() {
    let head: String = include_str!("catalog.tsv").lines().take_while(|line| line.starts_with('#')).collect();
    assert!(head.contains(&format!("database {DATABASE_VERSION} (commit")), "{head}");
    assert!(head.contains("CC0 1.0"), "{head}");
}

#[test]
fn every_entry_can_be_read_and_found_by_its_name() {
    for entry in entries() {
        assert_eq!(find(entry.name()), Ok(entry));
        assert!(Category::ALL.contains(&entry.category()));
        assert_eq!(entry.page().split('/').count(), 3, "{entry:?}");
        assert!(entry.url().starts_with("https://refractiveindex.info/?shelf="), "{entry:?}");
        assert!(!entry.title().is_empty() && !entry.reference().is_empty(), "{entry:?}");
        assert!(entry.status() == Status::Unknown || entry.maker().is_some(), "{entry:?}");
        assert!(key(entry.bare_name()) == entry.key(), "{entry:?}");
        let law = entry.dispersion(OutOfRange::Clamp).unwrap_or_else(|problem| panic!("{problem}"));
        assert_eq!(law.valid_range(), Some(entry.valid_range()));
        assert!(entry.nd() > 0.0 && entry.nd() < 10.0, "{entry:?}");
        assert!(entry.stated_nd().is_some() == entry.stated_vd().is_some(), "{entry:?}");
        if let Some(table) = entry.extinction() {
            assert!(table.len() > 1 && table.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{entry:?}");
            assert!(table.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{entry:?}");
        }
        if matches!(entry.category(), Category::Metal | Category::Semiconductor) {
            let table = entry.extinction().expect("k of what is opaque");
            assert!(table[0][0] <= 400.0 && table[table.len() - 1][0] >= 700.0, "{entry:?}");
        }
    }
}

#[test]
fn aliases_lead_to_entries() {
    let mut seen = 0;
    for record in records() {
        if let Record::Alias { key, target } = record {
            assert_eq!(find(target), find(key), "{key}");
            assert_eq!(find(key).map(|entry| entry.name()), Ok(target), "{key}");
            seen += 1;
        }
    }
    assert!(seen > 300, "{seen}");
}

#[test]
fn case_blanks_and_hyphens_do_not_count() {
    let glass = find("SCHOTT:N-BK7").unwrap();
    for name in ["schott:n-bk7", "Schott:NBK7", "N-BK7", "n bk7", "N_BK7", "  N-BK7\n", "schott : n bk 7"] {
        assert_eq!(find(name), Ok(glass), "{name}");
    }
    for (name, full) in [
        ("diamond", "diamond:Peter"),
        ("Diamond:Peter", "diamond:Peter"),
        ("Sapphire", "sapphire:Malitson-o"),
        ("sapphire-e", "sapphire:Malitson-e"),
        ("water", "water:Daimon-20.0C"),
        ("H2O", "water:Daimon-20.0C"),
        ("ice", "ice:Warren-2008"),
        ("quartz", "quartz:Ghosh-o"),
        ("fused silica", "fused silica:Malitson"),
        ("acrylic", "PMMA:Sultanova"),
        ("aluminum", "aluminium:Rakic"),
        ("gold", "gold:Johnson"),
        ("chrysoberyl:Walling-α", "chrysoberyl:Walling-α"),
        ("chrysoberyl:walling-alpha", "chrysoberyl:Walling-α"),
        ("CDGM:H-K9L*", "CDGM:H-K9L*"),
        ("CDGM:H-K9Lstar", "CDGM:H-K9L*"),
    ] {
        assert_eq!(find(name).map(|entry| entry.name()), Ok(full), "{name}");
    }
}

#[test]
fn a_glass_of_several_makers_has_to_be_named_in_full() {
    let error = find("F2").unwrap_err();
    assert!(error.contains("SCHOTT:F2") && error.contains("CDGM:F2"), "{error}");
    assert!(find("SCHOTT:F2").is_ok());
}

#[test]
fn misspelled_names_get_suggestions() {
    for (name, meant) in [
        ("SCHOTT:N-BK77", "SCHOTT:N-BK7"),
        ("SCHOT:N-BK7", "SCHOTT:N-BK7"),
        ("ZEISS:N-BK7", "SCHOTT:N-BK7"),
        ("BK7", "SCHOTT:N-BK7"),
        ("N-SF111", "SCHOTT:N-SF11"),
        ("dimond", "diamond"),
        ("daimond", "diamond"),
        ("watr", "water"),
        ("fused silca", "fused silica"),
        ("polycarbonat", "polycarbonate"),
        ("goldd", "gold"),
        ("diamond:Petter", "diamond:Peter"),
    ] {
        let error = find(name).unwrap_err();
        assert!(error.contains("did you mean") && error.contains(meant), "{name}: {error}");
    }
    for name in ["unobtainium", "", " ", ":", "::", "SCHOTT:", &"x".repeat(1 << 20), "\u{0}", "\t", "="] {
        let error = find(name).unwrap_err();
        assert!(!error.contains("did you mean"), "{name}: {error}");
    }
}

#[test]
fn nearest_is_nearest() {
    for i in 0..=300 {
        let nd = 1.2 + 0.005 * f64::from(i);
        let found = nearest(nd);
        assert_eq!(found, nearest(nd));
        let distance = (found.nd() - nd).abs();
        for entry in entries().filter(|entry| entry.is_common() && entry.is_clear()) {
            let other = (entry.nd() - nd).abs();
            let before = other.total_cmp(&distance).then_with(|| entry.preference().cmp(&found.preference())).is_lt();
            assert!(!before, "{nd}: {found:?}, not {entry:?}");
        }
    }
    // Nothing else is as far out.
    assert_eq!(nearest(9.0).bare_name(), find(nearest(9.0).bare_name()).unwrap().bare_name());
    assert_eq!(nearest(find("diamond").unwrap().nd()).name(), "diamond:Peter");
    // What somebody means who writes these.
    for (nd, name) in [(1.33, "water"), (1.31, "ice"), (2.42, "diamond"), (1.0, "ice")] {
        assert_eq!(nearest(nd).bare_name(), name, "{nd}");
    }
    for nd in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        // Whatever is asked, an answer and no panic.
        assert!(nearest(nd).nd() > 1.0);
    }
}
