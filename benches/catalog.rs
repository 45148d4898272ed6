//! Looking up a glass by its name, and what it takes to have its law.
//!
//! `cargo bench --bench catalog`; the numbers belong to the machine.

use abbe::optics::catalog;
use abbe::optics::dispersion::OutOfRange;
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

#[divan::bench(args = ["SCHOTT:N-BK7", "N-BK7", "diamond", "water"])]
fn find(name: &str) -> catalog::Entry {
    catalog::find(black_box(name)).expect("a name of the catalogue")
}

#[divan::bench(args = ["SCHOTT:N-BK7", "diamond", "gold"])]
fn find_and_prove(bencher: Bencher<'_, '_>, name: &str) {
    bencher.bench_local(|| catalog::find(black_box(name)).and_then(|entry| entry.dispersion(OutOfRange::Clamp)));
}

#[divan::bench]
fn nearest() -> catalog::Entry {
    catalog::nearest(black_box(1.5168))
}

#[divan::bench]
fn misspelled() -> Result<catalog::Entry, String> {
    catalog::find(black_box("SCHOTT:N-BK77"))
}
