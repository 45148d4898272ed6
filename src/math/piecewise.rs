//! A density that is linear between knots: its integral is made of parabolas, so that it is inverted without iterating.

/// A density on an interval.
#[derive(Clone, Debug)]
pub struct PiecewiseLinear {
    knots: Vec<Knot>,
    segments: Vec<Segment>,
    /// The segment in which cell `i` of the unit interval begins.
    guide: Vec<u32>,
    /// How many cells there are.
    cells: f64,
}

/// From one knot to the next.
#[derive(Clone, Copy, Debug)]
struct Segment {
    x: f64,
    width: f64,
    pdf: f64,
    below: f64,
    slope: f64,
}

/// Where two segments meet.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// Where.
    pub x: f64,
    /// The density there.
    pub pdf: f64,
    /// Its integral up to here.
    pub below: f64,
}

/// Cells of the guide to the segments, per knot.
const GUIDE: usize = 4;

impl PiecewiseLinear {
    /// Proportional to the linear interpolation of `table`: points (x, value ≥ 0) with x increasing, at least two, not all 0.
    pub fn new(table: &[(f64, f64)]) -> Self {
        let area = |a: (f64, f64), b: (f64, f64)| 0.5 * (a.1 + b.1) * (b.0 - a.0);
        let total: f64 = table.windows(2).map(|pair| area(pair[0], pair[1])).sum();
        assert!(total > 0.0 && total.is_finite(), "a density has an integral");
        let mut below = 0.0;
        let mut knots: Vec<Knot> = Vec::with_capacity(table.len());
        for (i, &(x, value)) in table.iter().enumerate() {
            if i > 0 {
                below += area(table[i - 1], table[i]) / total;
            }
            knots.push(Knot { x, pdf: value / total, below });
        }
        let cells = GUIDE * knots.len();
        let mut segment = 0;
        let guide = (0..cells)
            .map(|cell| {
                while segment + 2 < knots.len() && knots[segment + 1].below <= cell as f64 / cells as f64 {
                    segment += 1;
                }
                segment as u32
            })
            .collect();
        let segment = |pair: &[Knot]| {
            let (a, b) = (pair[0], pair[1]);
            let width = b.x - a.x;
            Segment { x: a.x, width, pdf: a.pdf, below: a.below, slope: (b.pdf - a.pdf) / width }
        };
        Self { cells: cells as f64, segments: knots.windows(2).map(segment).collect(), knots, guide }
    }

    /// The knots in increasing order.
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// The density at `x`; 0 outside the interval.
    #[inline]
    pub fn pdf(&self, x: f64) -> f64 {
        if !(self.knots[0].x..=self.knots[self.knots.len() - 1].x).contains(&x) {
            return 0.0;
        }
        let after = self.knots.partition_point(|knot| knot.x <= x).min(self.knots.len() - 1);
        between(&self.knots[after - 1], &self.knots[after], x)
    }

    /// The place below which the share `u` of the density lies, and the density there.
    #[inline]
    pub fn inverse(&self, u: f64) -> (f64, f64) {
        let cell = (u * self.cells) as u32 as usize;
        let mut segment = *self.guide.get(cell).or(self.guide.last()).expect("there is a segment") as usize;
        while segment + 1 < self.segments.len() && self.segments[segment + 1].below <= u {
            segment += 1;
        }
        let Segment { x, width, pdf, below, slope } = self.segments[segment];
        // p₀t + ½ slope t² = c, in the form that does not cancel; the root is the density at t.
        let c = (u - below).max(0.0);
        let root = (pdf * pdf + 2.0 * slope * c).max(0.0).sqrt();
        let denominator = pdf + root;
        if denominator <= 0.0 {
            return (x, pdf);
        }
        let t = 2.0 * c / denominator;
        if t < width { (x + t, root) } else { (x + width, pdf + slope * width) }
    }
}

fn between(a: &Knot, b: &Knot, x: f64) -> f64 {
    let t = (x - a.x) / (b.x - a.x);
    a.pdf + t * (b.pdf - a.pdf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_is_that_of_the_integral() {
        // From 0 to 0, over a gap, with very unequal segments.
        let table = [(-2.0, 0.0), (-1.0, 3.0), (-0.999, 0.0), (0.5, 0.0), (0.6, 1e-3), (4.0, 1.0), (4.5, 0.0)];
        let density = PiecewiseLinear::new(&table);
        let mut before = -2.0;
        for i in 0..=10_000 {
            let u = f64::from(i) / 10_000.0;
            let (x, pdf) = density.inverse(u);
            assert!(x >= before && x <= 4.5);
            assert!((pdf - density.pdf(x)).abs() < 1e-9, "{x}");
            let after = density.knots.partition_point(|knot| knot.x <= x).min(density.knots.len() - 1);
            let knot = &density.knots[after - 1];
            let below = knot.below + 0.5 * (knot.pdf + pdf) * (x - knot.x);
            assert!((below - u).abs() < 1e-12, "{u} {x} {below}");
            before = x;
        }
        assert!(density.pdf(-2.1) <= 0.0 && density.pdf(4.6) <= 0.0 && density.pdf(f64::NAN) <= 0.0);
    }
}
