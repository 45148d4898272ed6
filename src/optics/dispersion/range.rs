//! Proofs that an index stays in its range over the whole band.
//!
//! Every law here is a sum of terms that are monotone in λ between poles. On an interval such a sum is bounded by the sums
//! of its terms' smaller and larger end values; halving the interval tightens the bound. So "positive everywhere" is
//! decided, not sampled.

use crate::spectrum::{LONGEST, SHORTEST};

/// The open interval in which n(λ) has to stay.
pub(super) struct IorRange {
    pub(super) above: f64,
    pub(super) below: f64,
}

/// Bound on indices of transparent media, both ways. It is no law of physics: real ones are 1 to 4, and what is outside is
/// a coefficient in another unit (nm² for µm² is a factor 10⁶), which had better be refused than rendered.
const LARGEST: f64 = 100.0;

/// Halvings before an undecided interval counts as a violation: n then comes within 10⁻⁴ of its limit or is a difference
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

    /// Whether one value lies inside.
    pub(super) fn check_value(&self, ior: f64) -> Result<(), String> {
        if ior > self.above && ior < self.below {
            return Ok(());
        }
        Err(format!("the index is {ior}, it must lie between {} and {}", self.above, self.below))
    }

    /// Whether a law with this `ior` (of λ in µm) stays inside for all of 360–830 nm. `terms` sum to `transform`(n), a
    /// growing function of n > 0; each is monotone in λ there.
    pub(super) fn check(
        &self,
        terms: usize,
        term: impl Fn(usize, f64) -> f64,
        transform: impl Fn(f64) -> f64,
        ior: impl Fn(f64) -> f64,
    ) -> Result<(), String> {
        let explain = |micrometers: f64| {
            let ior = ior(micrometers);
            let what =
                if ior.is_nan() { "the law has no real index".to_owned() } else { format!("the index is {ior:.6}") };
            format!(
                "{what} at {:.3} nm, within 360–830 nm it must lie between {} and {}: check the coefficients and their \
                 units (µm)",
                1e3 * micrometers,
                self.above,
                self.below
            )
        };
        stays_positive(terms + 1, |k, x| if k < terms { term(k, x) } else { -transform(self.above) })
            .map_err(explain)?;
        stays_positive(terms + 1, |k, x| if k < terms { -term(k, x) } else { transform(self.below) }).map_err(explain)
    }
}

/// `Err(λ)` with a place where the sum of the monotone terms is not positive or not certainly so.
fn stays_positive(terms: usize, term: impl Fn(usize, f64) -> f64) -> Result<(), f64> {
    let (first, last) = (SHORTEST.micrometers(), LONGEST.micrometers());
    let value = |x: f64| (0..terms).map(|k| term(k, x)).sum::<f64>();
    // Asked for the good case, so that NaN is refused too.
    let positive_at = |x: f64| if value(x) > 0.0 { Ok(()) } else { Err(x) };
    positive_at(first)?;
    positive_at(last)?;
    let mut open = vec![(first, last)];
    for _ in 0..MOST_INTERVALS {
        let Some((a, b)) = open.pop() else { return Ok(()) };
        let (mut lower, mut magnitude) = (0.0, 0.0);
        for k in 0..terms {
            let (at_a, at_b) = (term(k, a), term(k, b));
            lower += at_a.min(at_b);
            magnitude += at_a.abs().max(at_b.abs());
        }
        // Each term is right to a few ulp and each addition to half of one.
        if lower > 4.0 * terms as f64 * f64::EPSILON * magnitude {
            continue;
        }
        let middle = 0.5 * (a + b);
        positive_at(middle)?;
        open.push((middle, b));
        open.push((a, middle));
    }
    Err(open.last().map_or(first, |&(a, _)| a))
}
