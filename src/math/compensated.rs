//! Error-free transformations, and the one difference of squares that needs them.
//!
//! A sum or product of two `f64` is returned together with its rounding error, exactly (Knuth 1997, §4.2.2; Dekker 1971).
//! Products are split after Veltkamp and Dekker rather than by `f64::mul_add`: on x86-64 without FMA instructions that is
//! a call of some hundred cycles, and a build that switches between the two would have two costs for one answer. Both give
//! the exact error of the product, hence the same bits; the split takes 17 plain operations that round alike everywhere.
//!
//! References:
//! - D. E. Knuth, *The Art of Computer Programming* 2, 3rd ed. 1997.
//! - T. J. Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18 (1971).
//! - J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates",
//!   Discrete Comput. Geom. 18 (1997).

/// `(s, e)` with s = fl(a + b) and s + e = a + b exactly (Knuth's TwoSum). No condition on magnitudes.
#[inline]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b_virtual = s - a;
    let a_virtual = s - b_virtual;
    (s, (a - a_virtual) + (b - b_virtual))
}

/// `(h, l)` with h + l = a exactly and at most 26 significant bits in each (Veltkamp's splitting).
#[inline]
fn split(a: f64) -> (f64, f64) {
    /// 2²⁷ + 1: half of the 53 significant bits, rounded up.
    const SPLITTER: f64 = 134_217_729.0;
    let c = SPLITTER * a;
    let high = c - (c - a);
    (high, a - high)
}

/// `(p, e)` with p = fl(a·b) and p + e = a·b exactly (Dekker's product).
///
/// Exact while neither the split overflows (|a|, |b| < 2⁹⁹⁶) nor the error underflows (|a·b| > 2⁻⁹⁶⁹); refractive
/// indices and cosines are far from both.
#[inline]
pub fn two_prod(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let (a_high, a_low) = split(a);
    let (b_high, b_low) = split(b);
    let e = ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (p, e)
}

/// W² = (n₁ − n₀)(n₁ + n₀) + g², the squared normal component of the refracted optical momentum.
///
/// Entering a denser medium (n₁ ≥ n₀) both terms are positive and the plain sum keeps all digits. Leaving one they cancel
/// at the critical angle, and neither the plain sum nor the factors (g − r)(g + r) keep any (MATH.md 2.7): once they cancel
/// by more than a bit, sum, difference and products carry their errors along, and where even that is not enough the exact
/// expansion decides. The result is within 6 ε of the exact value *for the given `f64` arguments*, and its sign, which
/// decides total reflection, is exactly theirs.
#[inline]
pub fn w_squared(ior_i: f64, ior_t: f64, g: f64) -> f64 {
    let plain = (ior_t - ior_i) * (ior_t + ior_i) + g * g;
    // With ε/2 a rounding: three of |q| and one of g² make at most 5½ of g² where |q| = 1.5 g², so 11 of W² = −g²/2, the worst
    // ratio; the sum adds one. Inside of a gem most reflections end here.
    if ior_t >= ior_i || plain.abs() >= 0.5 * (g * g) { plain } else { w_squared_compensated(ior_i, ior_t, g) }
}

/// W² where its two terms cancel.
#[inline(never)]
fn w_squared_compensated(ior_i: f64, ior_t: f64, g: f64) -> f64 {
    let (difference, difference_error) = two_sum(ior_t, -ior_i);
    let (sum, sum_error) = two_sum(ior_t, ior_i);
    let (q, q_error) = two_prod(difference, sum);
    let (g2, g2_error) = two_prod(g, g);
    let (w2, w2_error) = two_sum(q, g2);
    let tail = (q_error + g2_error) + (difference * sum_error + difference_error * sum);
    let result = w2 + (w2_error + tail);
    // What the tail leaves out and rounds is below 2⁻¹⁰² of the larger of |q| and g². Where the result is above 2⁻⁴⁶ g² that
    // is less than a tenth of its last place; below, both are equal to 46 bits and only their exact difference will do.
    const TRUSTED: f64 = 1.0 / (1u64 << 46) as f64;
    if result.abs() >= TRUSTED * g2 { result } else { w_squared_expanded(ior_i, ior_t, g) }
}

/// n₁² − n₀² + g² from the exact expansion of its six parts: for the last few ulps before the critical angle.
#[cold]
fn w_squared_expanded(ior_i: f64, ior_t: f64, g: f64) -> f64 {
    let (t2, t2_error) = two_prod(ior_t, ior_t);
    let (i2, i2_error) = two_prod(ior_i, ior_i);
    let (g2, g2_error) = two_prod(g, g);
    // Shewchuk 1997, GROW-EXPANSION: adding one number to a nonoverlapping expansion keeps it nonoverlapping, so the
    // components, smallest first, sum without cancellation beyond the last place.
    let mut expansion = [0.0; 6];
    for (count, part) in [t2, t2_error, -i2, -i2_error, g2, g2_error].into_iter().enumerate() {
        let mut carry = part;
        for component in &mut expansion[..count] {
            (carry, *component) = two_sum(carry, *component);
        }
        expansion[count] = carry;
    }
    expansion.iter().sum()
}
