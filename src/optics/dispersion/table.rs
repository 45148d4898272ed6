//! A table of indices, as measured or computed: a cubic spline between its entries.

use super::range::IorRange;
use super::spline::Spline;
use super::term::Rounded;
use super::valid::{ValidRange, refuse_micrometers};
use crate::spectrum::{LONGEST, SHORTEST, Wavelength};

/// More entries than any table in print; a limit on what a hostile file can make us compute.
const MOST_ENTRIES: usize = 1 << 16;

/// The fewest entries whose every second one still makes a spline, rather than a line or a parabola.
const FEWEST_TO_DOUBT: usize = 7;

/// n(λ) by a C² spline through its entries.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    /// λ in µm.
    spline: Spline,
    range: ValidRange,
    /// How much n'' of this spline differs from that of the spline through every second entry, both as root mean squares
    /// over the part within 360–830 nm.
    curvature_doubt: Option<f64>,
}

impl Table {
    /// Of (wavelength in nm, n), wavelengths increasing.
    pub(super) fn new(entries: &[[f64; 2]]) -> Result<Self, String> {
        if entries.len() > MOST_ENTRIES {
            return Err(format!("the table has {} entries, at most {MOST_ENTRIES} are understood", entries.len()));
        }
        check_wavelengths("the table", "index", entries)?;
        let [first, .., last] = entries else {
            return Err(format!(
                "the table has {}, two at least are needed to tell how n depends on wavelength: for a constant index use the \
                 law constant",
                if entries.is_empty() { "no entry" } else { "one entry" }
            ));
        };
        let range =
            ValidRange { from: Wavelength::from_nanometers(first[0]), to: Wavelength::from_nanometers(last[0]) };
        // No more than that: far from the visible metals have indices that they must not have in it.
        if let Some([wavelength, ior]) = entries.iter().find(|entry| entry[1] <= 0.0) {
            return Err(format!("the table has the index {ior} at {wavelength} nm: it must be positive"));
        }
        // µm by the same rounding as any wavelength that is looked up, so that entries are met exactly.
        let points: Vec<_> =
            entries.iter().map(|&[nm, ior]| [Wavelength::from_nanometers(nm).micrometers(), ior]).collect();
        let spline = Spline::new(&points);
        let curvature_doubt = curvature_doubt(&spline, &points);
        Ok(Self { spline, range, curvature_doubt })
    }

    pub(super) fn range(&self) -> ValidRange {
        self.range
    }

    pub(super) fn curvature_doubt(&self) -> Option<f64> {
        self.curvature_doubt
    }

    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        self.spline.at(micrometers)
    }

    pub(super) fn is_constant(&self) -> bool {
        self.spline.pieces().all(|(_, &[_, c1, c2, c3])| c1 == 0.0 && c2 == 0.0 && c3 == 0.0)
    }

    /// Proves that the index stays in `range` within `band`, by the extremes of each cubic.
    pub(super) fn check(&self, range: &IorRange, band: [f64; 2]) -> Result<(), String> {
        let count = self.spline.knots().len() - 1;
        for (i, (interval, piece)) in self.spline.pieces().enumerate() {
            // The outermost cubics go on beyond the table.
            let from = if i == 0 { band[0] } else { interval[0].max(band[0]) };
            let to = if i + 1 == count { band[1] } else { interval[1].min(band[1]) };
            if from > to {
                continue;
            }
            let (t0, t1) = (from - interval[0], to - interval[0]);
            for t in [t0, t1].into_iter().chain(extremes(piece).into_iter().filter(|&t| t > t0 && t < t1)) {
                let parts = [piece[0], piece[1] * t, piece[2] * t * t, piece[3] * t * t * t];
                let ior = Rounded { value: parts.iter().sum(), magnitude: parts.iter().map(|part| part.abs()).sum() };
                if !range.contains(ior) {
                    let problem = range.explain(interval[0] + t, ior.value, band);
                    return Err(format!("{problem}: the table is off there, or too coarse for a spline"));
                }
            }
        }
        Ok(())
    }

    pub(super) fn describe(&self) -> String {
        let doubt = match self.curvature_doubt {
            Some(doubt) => format!(
                "n'' is uncertain by about {:.2} %, its change when every second entry is left out",
                1e2 * doubt
            ),
            None => "n'' is the curve's, too few entries to tell how far it holds".to_owned(),
        };
        let curve = match self.spline.knots().len() {
            2 => "straight line",
            3 => "parabola",
            _ => "cubic spline",
        };
        format!(
            "table of {} entries from {} to {}, {curve}; {doubt}",
            self.spline.knots().len(),
            self.range.from,
            self.range.to
        )
    }
}

/// Where the cubic Σ cₖ tᵏ has its extremes: c₁ + 2c₂t + 3c₃t² = 0 without cancellation, q = −(c₂ ± √(c₂² − 3c₁c₃)),
/// t = q/(3c₃) and c₁/q.
fn extremes(&[_, c1, c2, c3]: &[f64; 4]) -> Vec<f64> {
    let discriminant = c2 * c2 - 3.0 * c1 * c3;
    if discriminant < 0.0 {
        return Vec::new();
    }
    let q = -(c2 + discriminant.sqrt().copysign(c2));
    [q / (3.0 * c3), c1 / q].into_iter().filter(|t| t.is_finite()).collect()
}

/// How much n'' depends on the spacing of the entries. Truncation and the noise of rounded entries both enter; neither can
/// be told from the table alone, so the difference is stated as it is, relative to the coarser spline's n'': noise swells the
/// finer one's.
fn curvature_doubt(spline: &Spline, points: &[[f64; 2]]) -> Option<f64> {
    if points.len() < FEWEST_TO_DOUBT {
        return None;
    }
    let coarse: Vec<_> = points.iter().step_by(2).copied().collect();
    let end = coarse.last()?[0];
    let coarse = Spline::new(&coarse);
    let (mut difference, mut size) = (0.0, 0.0);
    for &x in spline.knots().iter().filter(|&&x| x <= end && x >= SHORTEST.micrometers() && x <= LONGEST.micrometers())
    {
        let (fine, coarse) = (spline.at(x)[2], coarse.at(x)[2]);
        difference += (fine - coarse) * (fine - coarse);
        size += coarse * coarse;
    }
    (size > 0.0).then(|| (difference / size).sqrt())
}

/// Checks the first column of any table over wavelength: finite, in nm, positive and increasing. `table` is its name in
/// errors, `what` that of the second column.
pub fn check_wavelengths(table: &str, what: &str, entries: &[[f64; 2]]) -> Result<(), String> {
    if let Some([wavelength, value]) = entries.iter().find(|entry| !entry.iter().all(|v| v.is_finite())) {
        return Err(format!("{table} has the entry ({wavelength}, {value}): both have to be finite numbers"));
    }
    let all_below = |column: usize, limit: f64| entries.iter().all(|entry| entry[column] < limit);
    if entries.is_empty() {
        return Ok(());
    }
    if all_below(0, super::valid::LOOKS_LIKE_MICROMETERS) && entries.iter().all(|entry| entry[1] > 100.0) {
        return Err(format!("{table} has its columns swapped: entries are (wavelength in nm, {what})"));
    }
    refuse_micrometers(table, entries.iter().map(|entry| entry[0]))?;
    if let Some([wavelength, _]) = entries.iter().find(|entry| entry[0] <= 0.0) {
        return Err(format!("{table} has the wavelength {wavelength} nm: it must be positive"));
    }
    if entries.len() > 1 && entries.windows(2).all(|pair| pair[0][0] > pair[1][0]) {
        return Err(format!("{table} has decreasing wavelengths: reverse the order of its entries"));
    }
    match entries.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
        Some(pair) if pair[1][0] >= pair[0][0] => {
            Err(format!("{table} has two entries at {} nm: leave one out", pair[0][0]))
        }
        Some(pair) => Err(format!(
            "{table} has {} nm after {} nm: wavelengths must increase, sort the entries",
            pair[1][0], pair[0][0]
        )),
        None => Ok(()),
    }
}
