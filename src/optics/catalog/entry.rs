//! One material of the catalogue: where it comes from, and its n(λ) and k(λ).

use std::cmp::Ordering;
use std::fmt;

use super::key;
use crate::optics::dispersion::{Dispersion, Law, OutOfRange, ValidRange};
use crate::spectrum::{Wavelength, lines};

/// A material of the catalogue. It is a line of the data and as cheap to copy as a string slice; what is asked of it is
/// parsed then.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    line: &'static str,
}

/// The cells of a line, as the head of `catalog.tsv` counts them. The second one, the qualifier's key, is there to be sorted
/// by and searched for.
#[derive(Clone, Copy)]
enum Cell {
    Key = 0,
    Name = 2,
    Category,
    Status,
    Common,
    Page,
    Title,
    Reference,
    ValidFrom,
    ValidTo,
    Nd,
    Vd,
    StatedNd,
    StatedVd,
    Law,
    Extinction,
}

/// What kind of stuff an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Category {
    /// Glasses, and glass ceramics.
    Glass,
    /// Coloured glasses, ophthalmic ones among them.
    Filter,
    /// Crystals and minerals; of birefringent ones, one ray.
    Crystal,
    /// Polymers and adhesives.
    Plastic,
    /// Liquids.
    Liquid,
    /// Gases; their indices are against vacuum.
    Gas,
    /// Metals and what else is metallic: n + ik.
    Metal,
    /// Semiconductors that absorb visible light: n + ik.
    Semiconductor,
    /// Materials known as thin films.
    Film,
}

impl Category {
    /// All, in the order of their declaration.
    pub const ALL: [Self; 9] = [
        Self::Glass,
        Self::Filter,
        Self::Crystal,
        Self::Plastic,
        Self::Liquid,
        Self::Gas,
        Self::Metal,
        Self::Semiconductor,
        Self::Film,
    ];

    /// `glass`, `metal` …
    pub fn name(self) -> &'static str {
        match self {
            Self::Glass => "glass",
            Self::Filter => "filter",
            Self::Crystal => "crystal",
            Self::Plastic => "plastic",
            Self::Liquid => "liquid",
            Self::Gas => "gas",
            Self::Metal => "metal",
            Self::Semiconductor => "semiconductor",
            Self::Film => "film",
        }
    }
}

/// What the maker says about the supply of a glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// Recommended.
    Preferred,
    /// On stock.
    Standard,
    /// Nobody says so: no maker's glass, or the source is silent.
    Unknown,
    /// On request.
    Special,
    /// No longer made.
    Obsolete,
}

impl Status {
    /// `preferred`, `obsolete` …; empty if unknown.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preferred => "preferred",
            Self::Standard => "standard",
            Self::Unknown => "",
            Self::Special => "special",
            Self::Obsolete => "obsolete",
        }
    }

    const ALL: [Self; 5] = [Self::Preferred, Self::Standard, Self::Unknown, Self::Special, Self::Obsolete];
}

/// Least internal transmittance, through `CLEAR_NM` at the d line, of what counts as clear.
const CLEAR_TRANSMITTANCE: f64 = 0.5;
/// 10 mm, the thickness for which makers state transmittances.
const CLEAR_NM: f64 = 1e7;

impl Entry {
    pub(super) fn of_line(line: &'static str) -> Self {
        Self { line }
    }

    fn cell(&self, cell: Cell) -> &'static str {
        self.line.split('\t').nth(cell as usize).unwrap_or_default()
    }

    /// `SCHOTT:N-BK7`, `diamond:Peter`.
    pub fn name(&self) -> &'static str {
        self.cell(Cell::Name)
    }

    /// What it is called without maker or page: `N-BK7`, `diamond`.
    pub fn bare_name(&self) -> &'static str {
        let name = self.name();
        let part = name.split(':').find(|part| key(part) == self.key());
        part.unwrap_or(name)
    }

    /// The maker, of a maker's glass.
    pub fn maker(&self) -> Option<&'static str> {
        self.is_makers().then(|| self.name().split_once(':').map(|(maker, _)| maker)).flatten()
    }

    pub(super) fn key(&self) -> &'static str {
        self.cell(Cell::Key)
    }

    /// What kind of stuff it is.
    pub fn category(&self) -> Category {
        let name = self.cell(Cell::Category);
        Category::ALL.into_iter().find(|category| category.name() == name).expect("a category of ours (tested)")
    }

    /// Whether it is a metal, known by n + ik.
    pub fn is_metal(&self) -> bool {
        self.category() == Category::Metal
    }

    /// What the maker says about the supply.
    pub fn status(&self) -> Status {
        let name = self.cell(Cell::Status);
        Status::ALL.into_iter().find(|status| status.name() == name).expect("a status of ours (tested)")
    }

    /// The page of refractiveindex.info: `specs/SCHOTT-optical/N-BK7` is shelf, book and page.
    pub fn page(&self) -> &'static str {
        self.cell(Cell::Page)
    }

    /// Where to see the source in a browser.
    pub fn url(&self) -> String {
        let mut parts = self.page().splitn(3, '/');
        let mut part = || parts.next().unwrap_or_default();
        format!("https://refractiveindex.info/?shelf={}&book={}&page={}", part(), part(), part())
    }

    /// The family of a glass, or the source's heading.
    pub fn title(&self) -> &'static str {
        self.cell(Cell::Title)
    }

    /// Who measured or states it.
    pub fn reference(&self) -> &'static str {
        self.cell(Cell::Reference)
    }

    /// n_d of the law to nine digits, for searches; [`Self::dispersion`] gives all of them.
    pub fn nd(&self) -> f64 {
        self.number(Cell::Nd).expect("every entry has n_d (tested)")
    }

    /// V_d of the law to six digits, for searches; `None` where n_F = n_C.
    pub fn vd(&self) -> Option<f64> {
        self.number(Cell::Vd)
    }

    /// n_d that the source states.
    pub fn stated_nd(&self) -> Option<f64> {
        self.number(Cell::StatedNd)
    }

    /// V_d that the source states.
    pub fn stated_vd(&self) -> Option<f64> {
        self.number(Cell::StatedVd)
    }

    fn number(&self, cell: Cell) -> Option<f64> {
        self.cell(cell).parse().ok()
    }

    /// Where the source's n(λ) holds: the range of its formula, the ends of its table.
    pub fn valid_range(&self) -> ValidRange {
        let end =
            |cell| Wavelength::from_nanometers(self.number(cell).expect("every entry has a valid range (tested)"));
        ValidRange { from: end(Cell::ValidFrom), to: end(Cell::ValidTo) }
    }

    /// The law as the source states it: the number of a formula of refractiveindex.info with its coefficients (λ in µm), or
    /// `None` and a table of nm, n, nm, n …
    pub fn source_law(&self) -> (Option<i32>, Vec<f64>) {
        let cell = self.cell(Cell::Law);
        let (kind, rest) = cell.split_once(' ').expect("a formula or a table (tested)");
        let mut values = numbers(rest);
        match kind {
            "table" => (None, values.collect()),
            _ => (values.next().map(|number| number as i32), values.collect()),
        }
    }

    /// n(λ), not yet proved over any band.
    pub fn law(&self) -> Result<Law, String> {
        match self.source_law() {
            (Some(number), coefficients) => Law::formula(number, &coefficients),
            (None, table) => Law::table(&pairs(&table)),
        }
        .map_err(|problem| format!("{}: {problem}", self.name()))
    }

    /// n(λ) in its valid range, with what becomes of wavelengths outside.
    pub fn dispersion(&self, out_of_range: OutOfRange) -> Result<Dispersion, String> {
        Dispersion::new(self.law()?, Some(self.valid_range()), out_of_range)
            .map_err(|problem| format!("{}: {problem}", self.name()))
    }

    /// k(λ) as pairs of nm and k, increasing in λ; `None` where the source has none, or nothing but zeros.
    pub fn extinction(&self) -> Option<Vec<[f64; 2]>> {
        let cell = self.cell(Cell::Extinction);
        (!cell.is_empty()).then(|| pairs(&numbers(cell).collect::<Vec<_>>()))
    }

    /// Whether the bulk is transparent at the d line, measured by [`CLEAR_TRANSMITTANCE`].
    pub(super) fn is_clear(&self) -> bool {
        let Some(table) = self.extinction() else { return true };
        let nm = lines::D.nanometers();
        let k = match table.partition_point(|[at, _]| *at < nm) {
            0 => table[0][1],
            end if end == table.len() => table[end - 1][1],
            i => {
                let ([x0, k0], [x1, k1]) = (table[i - 1], table[i]);
                k0 + (k1 - k0) * (nm - x0) / (x1 - x0)
            }
        };
        // Beer–Lambert: τ = exp(−4πk d/λ).
        4.0 * std::f64::consts::PI * k * CLEAR_NM / nm <= -CLEAR_TRANSMITTANCE.ln()
    }

    fn is_makers(&self) -> bool {
        self.page().starts_with("specs/")
    }

    /// Whether everyday objects may be made of it: any glass of a maker, and solids and liquids that one meets outside of
    /// laboratories.
    pub(super) fn is_common(&self) -> bool {
        self.cell(Cell::Common) == "common"
    }

    /// Orders entries of equal merit.
    pub(super) fn preference(&self) -> impl Ord + use<> {
        (self.status(), self.name())
    }
}

impl fmt::Debug for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Entry").field(&self.name()).finish()
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// By name.
    fn cmp(&self, other: &Self) -> Ordering {
        (self.name(), self.line).cmp(&(other.name(), other.line))
    }
}

/// The numbers of a cell, which blanks separate.
fn numbers(cell: &str) -> impl Iterator<Item = f64> {
    cell.split(' ').map(|text| text.parse().expect("a number of ours (tested)"))
}

fn pairs(values: &[f64]) -> Vec<[f64; 2]> {
    values.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}
