//! The cubic spline through given points whose third derivative jumps nowhere near its ends ("not-a-knot").
//!
//! de Boor, "A Practical Guide to Splines", rev. ed. 2001, ch. IV. The condition takes no derivative out of thin air at
//! the ends, and reproduces every cubic exactly. Three points give their parabola, two their line.

/// A C² piecewise cubic.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spline {
    /// Increasing.
    x: Vec<f64>,
    /// On piece i, the sum of cₖ (x − xᵢ)ᵏ.
    pieces: Vec<[f64; 4]>,
}

impl Spline {
    /// Through `points` (x, y) with increasing x, two at least.
    pub(super) fn new(points: &[[f64; 2]]) -> Self {
        let x: Vec<f64> = points.iter().map(|point| point[0]).collect();
        let y: Vec<f64> = points.iter().map(|point| point[1]).collect();
        let width: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let slope: Vec<f64> = y.windows(2).zip(&width).map(|(pair, width)| (pair[1] - pair[0]) / width).collect();
        let second = second_derivatives(&width, &slope);
        let pieces = (0..width.len())
            .map(|i| {
                let (h, m, next) = (width[i], second[i], second[i + 1]);
                [y[i], slope[i] - h * (2.0 * m + next) / 6.0, 0.5 * m, (next - m) / (6.0 * h)]
            })
            .collect();
        Self { x, pieces }
    }

    pub(super) fn knots(&self) -> &[f64] {
        &self.x
    }

    /// The pieces with the intervals that they are for.
    pub(super) fn pieces(&self) -> impl Iterator<Item = ([f64; 2], &[f64; 4])> {
        self.x.windows(2).map(|ends| [ends[0], ends[1]]).zip(&self.pieces)
    }

    /// y, y', y''; beyond the ends the outermost cubics go on.
    pub(super) fn at(&self, x: f64) -> [f64; 3] {
        let piece = self.x.partition_point(|&knot| knot <= x).saturating_sub(1).min(self.pieces.len() - 1);
        let [c0, c1, c2, c3] = self.pieces[piece];
        let t = x - self.x[piece];
        [((c3 * t + c2) * t + c1) * t + c0, (3.0 * c3 * t + 2.0 * c2) * t + c1, 6.0 * c3 * t + 2.0 * c2]
    }
}

/// y'' at the points: at every inner one y' is continuous, h₋ m₋ + 2 (h₋ + h) m + h m₊ = 6 (s − s₋); at the first and
/// last inner ones y''' is, which states the outermost m by their neighbours.
fn second_derivatives(width: &[f64], slope: &[f64]) -> Vec<f64> {
    let last = width.len();
    match last {
        1 => return vec![0.0; 2],
        2 => return vec![2.0 * (slope[1] - slope[0]) / (width[0] + width[1]); 3],
        _ => {}
    }
    // Elimination without pivots: every row is dominated by its diagonal, also the two that absorbed an end.
    let (mut over, mut right) = (vec![0.0; last], vec![0.0; last]);
    for i in 1..last {
        let (h, next) = (width[i - 1], width[i]);
        let jump = 6.0 * (slope[i] - slope[i - 1]);
        let [under, diagonal, above, value] = if i == 1 {
            // m₀ = m₁ (1 + h/h₊) − m₂ h/h₊; the row divided by (h + h₊)/h₊.
            [0.0, h + 2.0 * next, next - h, jump * next / (h + next)]
        } else if i == last - 1 {
            [h - next, next + 2.0 * h, 0.0, jump * h / (h + next)]
        } else {
            [h, 2.0 * (h + next), next, jump]
        };
        let pivot = diagonal - under * over[i - 1];
        over[i] = above / pivot;
        right[i] = (value - under * right[i - 1]) / pivot;
    }
    let mut m = vec![0.0; last + 1];
    for i in (1..last).rev() {
        m[i] = right[i] - if i + 1 < last { over[i] * m[i + 1] } else { 0.0 };
    }
    m[0] = m[1] + (m[1] - m[2]) * width[0] / width[1];
    m[last] = m[last - 1] + (m[last - 1] - m[last - 2]) * width[last - 1] / width[last - 2];
    m
}
