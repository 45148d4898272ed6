//! Every material of the catalogue has the indices that its maker prints and its source states.
//!
//! `data/glass_makers.csv` are the makers' sheets, `data/glass_differences.csv` what other editions of them say:
//! `src/optics/catalog/compare.py` writes both. A difference that is not listed fails, and so does one that is listed and
//! is not there. Other entries are held to n_d and V_d as other programs compute them from the same source (`generate.py`).
//! ∂n/∂λ and ∂²n/∂λ² are compared with high-precision differences in `python/test_glass.py`.

use std::collections::BTreeMap;

use abbe::optics::catalog::{self, Entry};
use abbe::optics::dispersion::{Dispersion, OutOfRange};
use abbe::spectrum::{Wavelength, lines};

const LINES: [(&str, Wavelength); 11] = [
    ("i", lines::I),
    ("h", lines::H),
    ("g", lines::G),
    ("F'", lines::F_PRIME),
    ("F", lines::F),
    ("e", lines::E),
    ("d", lines::D),
    ("C'", lines::C_PRIME),
    ("C", lines::C),
    ("r", lines::R),
    ("s", lines::S),
];

/// Rows of a CSV file without quotes, as column to text; empty cells are left out.
fn table(text: &'static str) -> Vec<BTreeMap<&'static str, &'static str>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a line of names").split(',').collect();
    let row = |line: &'static str| -> BTreeMap<&str, &str> {
        names.iter().copied().zip(line.split(',')).filter(|(_, cell)| !cell.is_empty()).collect()
    };
    lines.map(row).collect()
}

/// Listed differences, law minus what is stated: of (against, glass, column).
fn differences() -> BTreeMap<(&'static str, &'static str, &'static str), f64> {
    let mut listed = BTreeMap::new();
    for row in table(include_str!("data/glass_differences.csv")) {
        let (against, glass) = (row["against"], row["glass"]);
        for (column, cell) in row.into_iter().filter(|(column, _)| !matches!(*column, "against" | "glass")) {
            let units: f64 = cell.parse().unwrap();
            listed.insert((against, glass, column), units * unit_of_list(column));
        }
    }
    listed
}

fn unit_of_list(column: &str) -> f64 {
    if column == "vd" { 1e-3 } else { 1e-6 }
}

fn dispersion(entry: Entry) -> Dispersion {
    entry.dispersion(OutOfRange::Error).unwrap_or_else(|problem| panic!("{problem}"))
}

/// One unit in the last digit of `text`, and of at least `digits` of them: zeros at the end are not always printed.
fn last_digit(text: &str, digits: usize) -> f64 {
    let printed = text.split_once('.').map_or(0, |(_, after)| after.len());
    10_f64.powi(-(printed.max(digits) as i32))
}

/// Compares one number with what is stated, unless that difference is listed; takes what it finds off the list.
fn compare(
    key: (&'static str, &'static str, &'static str),
    law: f64,
    stated: f64,
    last_digit: f64,
    listed: &mut BTreeMap<(&'static str, &'static str, &'static str), f64>,
) {
    let difference = law - stated;
    match listed.remove(&key) {
        // The list is rounded to its unit.
        Some(known) => assert!(
            (difference - known).abs() <= 0.5001 * unit_of_list(key.2) && difference.abs() > last_digit,
            "{key:?}: {law} against {stated}, not {known} as listed"
        ),
        // compare.py allows what binary numbers add to one unit.
        None => assert!(
            difference.abs() <= last_digit * (1.0 + 1e-9),
            "{key:?}: {law} against {stated}: run src/optics/catalog/compare.py and look at what it lists"
        ),
    }
}

#[test]
fn indices_at_the_lines_are_those_that_makers_print() {
    let mut listed = differences();
    listed.retain(|(against, ..), _| *against == "sheet");
    let (mut glasses, mut numbers) = (0, 0);
    for row in table(include_str!("data/glass_makers.csv")) {
        let name = row["glass"];
        let law = dispersion(catalog::find(name).unwrap());
        glasses += 1;
        for (line, wavelength) in LINES {
            if let Some(stated) = row.get(line)
                && law.is_valid_at(wavelength)
            {
                let value = law.at(wavelength).ior;
                compare(("sheet", name, line), value, stated.parse().unwrap(), last_digit(stated, 0), &mut listed);
                numbers += 1;
            }
        }
        if let Some(stated) = row.get("vd") {
            let value = law.abbe_number().unwrap();
            compare(("sheet", name, "vd"), value, stated.parse().unwrap(), last_digit(stated, 0), &mut listed);
            numbers += 1;
        }
    }
    assert!(glasses > 900 && numbers > 10_000, "{glasses} glasses, {numbers} numbers");
    assert!(listed.is_empty(), "listed, and not so: {:?}", listed.keys().next());
}

#[test]
fn n_d_and_v_d_are_those_that_the_database_states() {
    let mut listed = differences();
    listed.retain(|(against, ..), _| *against == "database");
    let mut stated = 0;
    for entry in catalog::entries() {
        let (Some(nd), Some(vd)) = (entry.stated_nd(), entry.stated_vd()) else { continue };
        let law = dispersion(entry);
        let name = entry.name();
        let ior = law.at(lines::D).ior;
        compare(("database", name, "d"), ior, nd, last_digit(&nd.to_string(), 5), &mut listed);
        compare(("database", name, "vd"), law.abbe_number().unwrap(), vd, last_digit(&vd.to_string(), 1), &mut listed);
        stated += 1;
    }
    assert!(stated > 1600, "{stated}");
    assert!(listed.is_empty(), "listed, and not so: {:?}", listed.keys().next());
}

#[test]
fn n_d_and_v_d_are_those_that_other_programs_compute() {
    let mut seen = 0;
    for entry in catalog::entries() {
        let law = dispersion(entry);
        let ior = law.at(lines::D).ior;
        // Nine digits are stored: half a unit of the ninth, for 1 ≤ n < 10 in units of 1e-8.
        assert!((ior - entry.nd()).abs() <= 0.5001e-8 * entry.nd().max(1.0), "{entry:?}: {ior} and {}", entry.nd());
        match (law.abbe_number(), entry.vd()) {
            // Six digits.
            (Some(vd), Some(stored)) => {
                let unit = 10_f64.powf(vd.abs().log10().floor() - 5.0);
                assert!((vd - stored).abs() <= 0.5001 * unit, "{entry:?}: {vd} and {stored}");
            }
            (vd, stored) => assert_eq!(vd.is_some(), stored.is_some(), "{entry:?}"),
        }
        seen += 1;
    }
    assert!(seen > 1900, "{seen}");
}

#[test]
fn glasses_of_every_maker_are_there() {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for entry in catalog::entries() {
        *counts.entry(entry.maker().unwrap_or("")).or_default() += 1;
    }
    // As many as the pages of the database have, less duplicates.
    for (maker, least) in
        [("SCHOTT", 157), ("OHARA", 410), ("HIKARI", 360), ("CDGM", 310), ("HOYA", 190), ("SUMITA", 176), ("LZOS", 51)]
    {
        assert!(counts[maker] >= least, "{maker}: {}", counts[maker]);
    }
}

#[test]
fn what_renderers_ask_for_is_there() {
    // Name, n_d as every handbook has it, and how far handbooks differ (temperature, grade, ray).
    for (name, nd, within) in [
        ("diamond", 2.4175, 0.002),
        ("sapphire", 1.7682, 0.0005),
        ("sapphire-e", 1.7601, 0.0005),
        // Daimon and Masumura state it against vacuum, handbooks against air.
        ("water", 1.3330 * 1.000_277, 0.0002),
        ("ice", 1.3095, 0.001),
        ("quartz", 1.5442, 0.0003),
        ("quartz-e", 1.5533, 0.0003),
        ("fused silica", 1.45846, 0.00002),
        ("calcite", 1.6584, 0.0005),
        ("calcite-e", 1.4864, 0.0005),
        ("PMMA", 1.4914, 0.002),
        ("polycarbonate", 1.5855, 0.002),
        ("polystyrene", 1.5916, 0.002),
        ("CaF2", 1.43385, 0.00005),
        ("MgF2", 1.37774, 0.0001),
        ("salt", 1.5443, 0.0005),
        ("cubic zirconia", 2.158, 0.01),
        ("rutile", 2.6142, 0.01),
        ("ethanol", 1.3614, 0.002),
        ("glycerol", 1.473, 0.003),
        ("air", 1.000_277, 0.000_002),
    ] {
        let entry = catalog::find(name).unwrap();
        assert!((entry.nd() - nd).abs() <= within, "{entry:?}: {} against {nd}", entry.nd());
        assert!(!entry.is_metal());
    }
    for name in [
        "gold",
        "silver",
        "copper",
        "aluminium",
        "iron",
        "chromium",
        "nickel",
        "titanium",
        "tungsten",
        "platinum",
        "zinc",
        "cobalt",
        "mercury",
        "brass",
        "stainless steel",
        "lead",
    ] {
        let entry = catalog::find(name).unwrap();
        assert!(entry.is_metal(), "{entry:?}");
        assert!(entry.extinction().is_some_and(|table| table.iter().all(|[_, k]| *k > 0.0)), "{entry:?}");
    }
}
