//! Lights against closed forms, quadrature and each other.

mod dome;
mod shapes;
mod tree;

use glam::DVec3;

/// Uniform numbers (SplitMix64).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    pub(super) fn pair(&mut self) -> [f64; 2] {
        [self.next(), self.next()]
    }

    pub(super) fn direction(&mut self) -> DVec3 {
        loop {
            let v = 2.0 * DVec3::new(self.next(), self.next(), self.next()) - 1.0;
            if (1e-3..1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }
}

/// Standard deviations that χ² of so many degrees of freedom is off (E. Wilson, M. Hilferty 1931).
pub(super) fn deviations(chi_squared: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
}
