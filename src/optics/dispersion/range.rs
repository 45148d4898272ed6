//! Proofs that an index stays in its range over a whole band.
//!
//! Every formula here is a sum of terms that are monotone in λ between their poles and turning points. On an interval
//! such a sum is bounded by the sums of its terms' smallest and largest values; halving the interval tightens the
//! bounds. So "positive everywhere" is decided, not sampled.

use super::series::Quantity;
use super::term::{Rounded, Term};

/// The open interval in which n(λ) has to stay.
pub(super) struct IorRange {
    pub(super) above: f64,
    pub(super) below: f64,
}

/// Bound on indices of transparent media, both ways. It is no law of physics: real ones are 1 to 4, and what is outside is
/// a coefficient in another unit (nm² for µm² is a factor 10⁶), which had better be refused than rendered.
const LARGEST: f64 = 100.0;

/// Intervals before an undecided one counts as a violation: n then comes within 10⁻⁴ of its limit or is a difference
/// of coefficients so large that its digits mean nothing.
const MOST_INTERVALS: usize = 1 << 14;

impl IorRange {
    /// What an index may be at all.
    pub(super) fn physical() -> Self {
        Self { above: 1.0 / LARGEST, below: LARGEST }
    }

    /// The range of n in `self` such that n_d + scale (n − n_d) lies in `self` too; `scale` is not 0.
    pub(super) fn before_scaling(&self, scale: f64, ior_d: f64) -> Self {
        let before = |limit: f64| ior_d + (limit - ior_d) / scale;
        let (one, other) = (before(self.above), before(self.below));
        Self { above: self.above.max(one.min(other)), below: self.below.min(one.max(other)) }
    }

    /// Whether an index lies inside, for all that it may be off by.
    pub(super) fn contains(&self, ior: Rounded) -> bool {
        let slack = slack(1, ior.magnitude);
        ior.value - slack > self.above && ior.value + slack < self.below
    }

    /// Whether one exact value lies inside.
    pub(super) fn check_value(&self, ior: f64) -> Result<(), String> {
        if self.contains(Rounded { value: ior, magnitude: 0.0 }) {
            return Ok(());
        }
        Err(format!("the index is {ior}, it must lie between {} and {}", self.above, self.below))
    }

    /// Whether a law with this `ior` (of λ in µm) stays inside for all of `band` (µm), in which its terms have no poles.
    /// `constant` and `terms` sum to `quantity` of the index.
    pub(super) fn check(
        &self,
        band: [f64; 2],
        quantity: Quantity,
        constant: f64,
        terms: &[Term],
        ior: impl Fn(f64) -> f64,
    ) -> Result<(), String> {
        let (above, below) = (quantity.of(self.above), quantity.of(self.below));
        let refuse = |micrometers: f64| {
            let problem = self.explain(micrometers, ior(micrometers), band);
            format!("{problem}: check the coefficients and their units (µm)")
        };
        // Asked for the good case, so that NaN is refused too.
        let inside = |micrometers: f64| {
            let sum = terms.iter().map(|term| term.at(micrometers)[0]).sum::<f64>() + constant;
            if sum > above && sum < below { Ok(()) } else { Err(refuse(micrometers)) }
        };
        inside(band[0])?;
        inside(band[1])?;
        let parts: Vec<(&Term, Vec<f64>)> = terms.iter().map(|term| (term, term.turning_points())).collect();
        let mut open = vec![band];
        for _ in 0..MOST_INTERVALS {
            let Some(interval) = open.pop() else { return Ok(()) };
            let (mut low, mut high, mut magnitude) = (constant, constant, constant.abs());
            for (term, turning) in &parts {
                let extremes = Extremes::of(term, turning, interval);
                low += extremes.low;
                high += extremes.high;
                magnitude += extremes.magnitude;
            }
            let slack = slack(terms.len(), magnitude);
            if low - slack > above && high + slack < below {
                continue;
            }
            let middle = 0.5 * (interval[0] + interval[1]);
            inside(middle)?;
            open.push([middle, interval[1]]);
            open.push([interval[0], middle]);
        }
        let undecided = open.last().map_or(band[0], |interval| interval[0]);
        Err(refuse(undecided))
    }

    /// An index outside, or one that cannot be told from the limit, as an error.
    pub(super) fn explain(&self, micrometers: f64, ior: f64, band: [f64; 2]) -> String {
        let what = if ior.is_nan() { "the law has no real index".to_owned() } else { format!("the index is {ior:.6}") };
        format!(
            "{what} at {:.3} nm, within {:.0}–{:.0} nm it must lie between {} and {}",
            1e3 * micrometers,
            1e3 * band[0],
            1e3 * band[1],
            self.above,
            self.below
        )
    }
}

/// What a sum of `terms` values may be off by: each is right to 8 times ε of its magnitude (a power, a square, a
/// difference, a product and a quotient), and each addition to ε of the sum.
fn slack(terms: usize, magnitude: f64) -> f64 {
    (8.0 + terms as f64) * f64::EPSILON * magnitude
}

/// Bounds of one term on an interval without poles.
struct Extremes {
    low: f64,
    high: f64,
    magnitude: f64,
}

impl Extremes {
    /// At the ends, or where the term turns. There it is flat: that the place is rounded is of second order.
    fn of(term: &Term, turning: &[f64], [a, b]: [f64; 2]) -> Self {
        let inside = turning.iter().copied().filter(|point| *point > a && *point < b);
        let mut extremes = Self { low: f64::INFINITY, high: f64::NEG_INFINITY, magnitude: 0.0 };
        for point in [a, b].into_iter().chain(inside) {
            let Rounded { value, magnitude } = term.rounded(point);
            // A value that is not a number must not be passed over, as min and max would.
            if value.is_nan() {
                return Self { low: f64::NAN, high: f64::NAN, magnitude: f64::NAN };
            }
            extremes.low = extremes.low.min(value);
            extremes.high = extremes.high.max(value);
            extremes.magnitude = extremes.magnitude.max(magnitude);
        }
        extremes
    }
}
