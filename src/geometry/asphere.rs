//! Even aspheres: where a line crosses them, with no root missed, and their derivatives.
//!
//! ```text
//! ζ = σ(ρ),  ρ = r² = x² + y²,   σ(ρ) = c ρ/(1 + s) + Σ A_n ρⁿ (n = 2, 3, …),   s = √(1 − K c² ρ)
//! σ' = c/(2 s) + Σ n A_n ρⁿ⁻¹        σ'' = K c³/(4 s³) + …        σ''' = 3 K² c⁵/(8 s⁵) + …
//! ```
//!
//! Along a line ρ is a quadratic function of t, and h(t) = z(t) − σ(ρ(t)) changes its sign where the line crosses. Stretches
//! are halved until interval arithmetic shows that h has no zero there, or is monotonic (Moore 1966, *Interval analysis*);
//! then a safeguarded Newton iteration finds the zero. If the line starts on the surface, h(0) = 0 and it is the zeros of
//! h(t)/t that are sought: divided differences give it without cancellation.

use super::profile::Line;

/// Halvings after which a stretch is shorter than a rounding of its ends.
const HALVINGS: u32 = 60;
/// Steps of a safeguarded Newton iteration: bisection alone needs one for each bit.
const STEPS: u32 = 80;

/// The surface: a conic and terms of higher order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Asphere {
    pub(super) vertex: f64,
    pub(super) curvature: f64,
    pub(super) kappa: f64,
    /// A₂, A₃, …: coefficients of r⁴, r⁶, ….
    pub(super) terms: Vec<f64>,
    /// Lowest and highest ζ up to the outer radius.
    range: [f64; 2],
}

/// All numbers between two.
#[derive(Clone, Copy, Debug)]
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    fn new(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    fn add(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }

    fn scale(self, factor: f64) -> Self {
        Self::new(self.low * factor, self.high * factor)
    }

    fn mul(self, other: Self) -> Self {
        let products = [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        Self {
            low: products.into_iter().fold(f64::INFINITY, f64::min),
            high: products.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn holds_zero(self) -> bool {
        self.low <= 0.0 && self.high >= 0.0
    }

    fn size(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}

/// σ and its derivatives by ρ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sag {
    pub(super) value: f64,
    pub(super) first: f64,
    pub(super) second: f64,
    pub(super) third: f64,
}

impl Asphere {
    /// Up to the radius `outer`, where the conic must exist: K c² r² < 1.
    pub(super) fn new(vertex: f64, curvature: f64, kappa: f64, terms: Vec<f64>, outer: f64) -> Self {
        let mut asphere = Self { vertex, curvature, kappa, terms, range: [0.0; 2] };
        let range = asphere.values(Span::new(0.0, outer * outer));
        asphere.range = [range.low, range.high];
        asphere
    }

    /// Bounds of its heights.
    pub(super) fn extremes(&self) -> [f64; 2] {
        self.range.map(|z| self.vertex + z)
    }

    /// s of the conic.
    fn root(&self, square: f64) -> f64 {
        (1.0 - self.kappa * self.curvature * self.curvature * square).max(0.0).sqrt()
    }

    /// σ and its derivatives at ρ = `square`.
    pub(super) fn sag(&self, square: f64) -> Sag {
        let (c, s) = (self.curvature, self.root(square));
        let kc2 = self.kappa * c * c;
        let mut sag = Sag {
            value: c * square / (1.0 + s),
            first: 0.5 * c / s,
            second: 0.25 * c * kc2 / (s * s * s),
            third: 0.375 * c * kc2 * kc2 / (s * s * s * s * s),
        };
        // Horner for Σ A_n ρⁿ and its derivatives.
        let (mut p, mut p1, mut p2, mut p3) = (0.0, 0.0, 0.0, 0.0);
        for &a in self.terms.iter().rev().chain(&[0.0, 0.0]) {
            p3 = p3 * square + 3.0 * p2;
            p2 = p2 * square + 2.0 * p1;
            p1 = p1 * square + p;
            p = p * square + a;
        }
        sag.value += p;
        sag.first += p1;
        sag.second += p2;
        sag.third += p3;
        sag
    }

    /// σ over a span of ρ: every term is monotonic.
    fn values(&self, square: Span) -> Span {
        let conic = |q: f64| self.curvature * q / (1.0 + self.root(q));
        let ends = Span::new(conic(square.low), conic(square.high));
        self.powers(square, ends, |n, a, q| a * q.powi(n))
    }

    fn slopes(&self, square: Span) -> Span {
        let conic = |q: f64| 0.5 * self.curvature / self.root(q);
        let ends = Span::new(conic(square.low), conic(square.high));
        self.powers(square, ends, |n, a, q| f64::from(n) * a * q.powi(n - 1))
    }

    fn powers(&self, square: Span, start: Span, term: impl Fn(i32, f64, f64) -> f64) -> Span {
        (2..)
            .zip(&self.terms)
            .fold(start, |sum, (n, &a)| sum.add(Span::new(term(n, a, square.low), term(n, a, square.high))))
    }

    /// Calls `found` with the distances between `from` and `to` at which the line changes its side, in order; `above` says
    /// on which side it is at the ends.
    pub(super) fn changes(
        &self,
        line: &Line,
        [mut from, mut to]: [f64; 2],
        mut above: [bool; 2],
        standing: bool,
        found: &mut dyn FnMut(f64),
    ) {
        let (o, d) = (line.origin.z - self.vertex, line.direction.z);
        if !line.moves_across() {
            // Parallel to the axis: one crossing, if any.
            if above[0] != above[1] {
                let at = if standing { 0.0 } else { (self.sag(line.square(0.0)).value - o) / d };
                found(at.clamp(from, to));
            }
            return;
        }
        // Below the lowest and above the highest point the side is known.
        if d != 0.0 {
            let reach = [self.range[0], self.range[1]].map(|z| (z - o) / d);
            let (first, last) = (reach[0].min(reach[1]), reach[0].max(reach[1]));
            if first > from && first < to {
                (from, above[0]) = (first, d < 0.0);
            }
            if last < to && last > from {
                (to, above[1]) = (last, d > 0.0);
            }
        }
        let search = Search { asphere: self, line, base: line.square(0.0), standing };
        if !standing {
            return search.split([from, to], above, HALVINGS, found);
        }
        // The sign of h(t)/t is that of h, turned round behind the start.
        let quotient = |t: f64, is_above: bool| is_above != (t < 0.0);
        let signs = [quotient(from, above[0]), quotient(to, above[1])];
        let mut is_pending = from < 0.0 && to > 0.0;
        let mut report = |t: f64| {
            if is_pending && t > 0.0 {
                is_pending = false;
                found(0.0);
            }
            found(t);
        };
        search.split([from, to], signs, HALVINGS, &mut report);
        if is_pending {
            found(0.0);
        }
    }
}

/// The function whose signs are sought along a line: h, or h/t.
struct Search<'a> {
    asphere: &'a Asphere,
    line: &'a Line,
    /// ρ at the start.
    base: f64,
    standing: bool,
}

impl Search<'_> {
    /// The function and its derivative.
    fn value(&self, t: f64) -> (f64, f64) {
        let (asphere, line) = (self.asphere, self.line);
        let (square, rate) = (line.square(t), line.rate(t));
        if !self.standing {
            let sag = asphere.sag(square);
            return (line.height(t) - asphere.vertex - sag.value, line.direction.z - rate * sag.first);
        }
        // h/t = d_z − ((ρ − ρ₀)/t) (σ(ρ) − σ(ρ₀))/(ρ − ρ₀).
        let (quotient, slope) = self.divided(square);
        let mean = line.mean_rate(t);
        (line.direction.z - mean * quotient, -line.across() * quotient - mean * slope * rate)
    }

    /// (σ(ρ) − σ(ρ₀))/(ρ − ρ₀) and its derivative by ρ.
    fn divided(&self, square: f64) -> (f64, f64) {
        let asphere = self.asphere;
        let (c, s0, s1) = (asphere.curvature, asphere.root(self.base), asphere.root(square));
        let mut value = c / (s0 + s1);
        let mut slope = value * 0.5 * asphere.kappa * c * c / (s1 * (s0 + s1));
        for (n, &a) in (2..).zip(&asphere.terms) {
            // Σ ρʲ ρ₀ⁿ⁻¹⁻ʲ.
            let (mut sum, mut rate) = (0.0, 0.0);
            for j in (0..n).rev() {
                rate = rate * square + sum;
                sum = sum * square + self.base.powi(n - 1 - j);
            }
            value += a * sum;
            slope += a * rate;
        }
        (value, slope)
    }

    /// Bounds of the derivative.
    fn slopes(&self, [from, to]: [f64; 2]) -> Span {
        let (asphere, line) = (self.asphere, self.line);
        let square = self.squares([from, to]);
        let rate = Span::new(line.rate(from), line.rate(to));
        if !self.standing {
            let z = Span { low: line.direction.z, high: line.direction.z };
            return z.add(rate.mul(asphere.slopes(square)).scale(-1.0));
        }
        // Both factors are sums of monotonic terms.
        let (mut quotients, mut slopes) = (Span { low: 0.0, high: 0.0 }, Span { low: 0.0, high: 0.0 });
        let s0 = asphere.root(self.base);
        let conic = |q: f64| {
            let s1 = asphere.root(q);
            let value = asphere.curvature / (s0 + s1);
            (value, value * 0.5 * asphere.kappa * asphere.curvature * asphere.curvature / (s1 * (s0 + s1)))
        };
        let (a, b) = (conic(square.low), conic(square.high));
        quotients = quotients.add(Span::new(a.0, b.0));
        slopes = slopes.add(Span::new(a.1, b.1));
        for (n, &a) in (2..).zip(&asphere.terms) {
            for j in 0..n {
                let factor = a * self.base.powi(n - 1 - j);
                quotients = quotients.add(Span::new(factor * square.low.powi(j), factor * square.high.powi(j)));
                if j > 0 {
                    let factor = factor * f64::from(j);
                    slopes = slopes.add(Span::new(factor * square.low.powi(j - 1), factor * square.high.powi(j - 1)));
                }
            }
        }
        let mean = Span::new(line.mean_rate(from), line.mean_rate(to));
        quotients.scale(-line.across()).add(mean.mul(slopes).mul(rate).scale(-1.0))
    }

    /// ρ over a stretch.
    fn squares(&self, [from, to]: [f64; 2]) -> Span {
        let ends = Span::new(self.line.square(from), self.line.square(to));
        let nearest = self.line.nearest_point();
        if from < nearest && nearest < to {
            Span { low: self.line.square(nearest).min(ends.low), ..ends }
        } else {
            ends
        }
    }

    /// Reports the changes of sign between two ends with the given signs.
    fn split(&self, [from, to]: [f64; 2], signs: [bool; 2], halvings: u32, found: &mut dyn FnMut(f64)) {
        let slopes = self.slopes([from, to]);
        let middle = 0.5 * (from + to);
        if !slopes.holds_zero() || halvings == 0 || middle <= from || middle >= to {
            if signs[0] != signs[1] {
                found(self.zero([from, to], signs[1]));
            }
            return;
        }
        let (value, _) = self.value(middle);
        // The mean value theorem: too far from 0 to reach it.
        if signs[0] == signs[1] && (value > 0.0) == signs[0] && value.abs() > slopes.size() * 0.5 * (to - from) {
            return;
        }
        let sign = value > 0.0;
        self.split([from, middle], [signs[0], sign], halvings - 1, found);
        self.split([middle, to], [sign, signs[1]], halvings - 1, found);
    }

    /// The zero between two ends; the function is positive at the second one if `rising`.
    fn zero(&self, [mut from, mut to]: [f64; 2], rising: bool) -> f64 {
        let mut at = 0.5 * (from + to);
        for _ in 0..STEPS {
            let (value, slope) = self.value(at);
            if value == 0.0 {
                return at;
            }
            if (value > 0.0) == rising {
                to = at;
            } else {
                from = at;
            }
            let newton = at - value / slope;
            let next = if newton > from && newton < to { newton } else { 0.5 * (from + to) };
            if next <= from || next >= to {
                return next.clamp(from, to);
            }
            at = next;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn derivatives_of_the_sag_are_derivatives() {
        let asphere = Asphere::new(0.0, 0.3, -0.7, vec![0.02, -0.003, 0.0004], 1.5);
        let h = 1e-3;
        for i in 1..20 {
            let q = 0.1 * f64::from(i);
            let [a, b, c, d] = [q + h, q - h, q + 2.0 * h, q - 2.0 * h].map(|q| asphere.sag(q));
            let slope = |f: fn(&Sag) -> f64| (8.0 * (f(&a) - f(&b)) - f(&c) + f(&d)) / (12.0 * h);
            let here = asphere.sag(q);
            assert!((slope(|s| s.value) - here.first).abs() < 1e-11);
            assert!((slope(|s| s.first) - here.second).abs() < 1e-11);
            assert!((slope(|s| s.second) - here.third).abs() < 1e-10);
        }
    }

    /// A surface that waves: a flat line has up to four crossings, and all are found.
    #[test]
    fn no_crossing_is_missed() {
        let asphere = Asphere::new(0.0, 1.0, 0.0, vec![-1.0, 0.32], 1.6);
        let count = |line: &Line, standing: bool| {
            let span = line.within(1.6, false).expect("inside");
            let above = span.map(|t| line.height(t) > asphere.sag(1.6 * 1.6).value);
            let mut found = Vec::new();
            asphere.changes(line, span, above, standing, &mut |t| found.push(t));
            (found, span)
        };
        let mut most = 0;
        for i in 0..200 {
            for j in 0..10 {
                let z = -0.1 + 0.004 * f64::from(i);
                let line = Line::new(DVec3::new(0.01, 0.1 * f64::from(j), z), DVec3::new(1.0, 0.0, 0.03).normalize());
                let (found, span) = count(&line, false);
                let at = |t: f64| line.height(t) - asphere.sag(line.square(t)).value;
                let mut expected = 0;
                let mut sign = at(span[0] + 1e-9) > 0.0;
                for k in 1..4000 {
                    let t = span[0] + (span[1] - span[0]) * f64::from(k) / 4000.0;
                    if (at(t) > 0.0) != sign {
                        sign = !sign;
                        expected += 1;
                    }
                }
                assert!(found.len() >= expected && found.len() <= expected + 2, "{found:?} {expected}");
                assert!(found.windows(2).all(|p| p[0] <= p[1]), "{found:?}");
                assert!(found.iter().all(|&t| at(t).abs() < 1e-15 * 10.0), "{found:?}");
                most = most.max(found.len());
                // From each crossing, the others are found again, and it is at 0.
                for &t in &found {
                    let start = Line::new(line.origin + t * line.direction, line.direction);
                    let (again, _) = count(&start, true);
                    assert!(again.contains(&0.0), "{again:?}");
                    for &other in &found {
                        assert!(again.iter().any(|a| (a + t - other).abs() < 1e-6), "{found:?} {again:?}");
                    }
                }
            }
        }
        assert!(most >= 4, "{most}");
    }
}
