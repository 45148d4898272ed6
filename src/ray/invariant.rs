//! Invariants of a chain: what must stay constant along every ray, without a finite difference (MATH.md 2.6).
//!
//! | | |
//! |---|---|
//! | I1 | K_x·p_y − K_y·p_x, the Lagrange invariant |
//! | I2 | K_x·p_λ − K_λ·p_x + Σ nᵢ' ∂ℓᵢ/∂x, and the same in y |
//! | I3 | d(OPL)/dλ − Σ nᵢ'ℓᵢ − K·p_λ, Conrady's sum |
//!
//! They hold where the shading normal is the true normal (spheres, planes, facets). Interpolated normals break them: there
//! they measure how far shading is from geometry, and are no test.

use glam::DVec3;

use super::column::ColumnSet;
use super::transfer::Transfer;

/// What the invariants accumulate along a chain.
///
/// Tell it of every transfer, *before* the columns make it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvariantSums {
    start: Values,
    /// Σ nᵢ' ∂ℓᵢ/∂x and /∂y.
    chromatic: [f64; 2],
    /// Σ nᵢ'ℓᵢ.
    dispersed: f64,
    /// Σ nᵢ ∂ℓᵢ/∂λ.
    lengthened: f64,
}

/// How much each invariant has changed since the start, with the magnitude of the terms that cancel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Of the Lagrange invariant.
    pub lagrange: f64,
    /// Of its mixed form with λ, for x and y.
    pub chromatic: [f64; 2],
    /// Of Conrady's sum.
    pub conrady: f64,
    /// Sums of the magnitudes of the terms in the three, the scales to judge the residuals by: lagrange, chromatic (the
    /// larger of x and y), conrady.
    pub scales: [f64; 3],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Values {
    lagrange: f64,
    mixed: [f64; 2],
    along: f64,
    scales: [f64; 3],
}

impl InvariantSums {
    /// At the start of a ray with `columns` and `momentum`. Missing columns count as zero.
    pub fn start<C: ColumnSet>(columns: &C, momentum: DVec3) -> Self {
        Self { start: values(columns, momentum), chromatic: [0.0; 2], dispersed: 0.0, lengthened: 0.0 }
    }

    /// Adds a segment; `before` are the columns at its beginning.
    pub fn transfer<C: ColumnSet>(&mut self, before: &C, t: &Transfer) {
        use super::transfer::Segment;
        let segment = Segment::new(t);
        if let Some(columns) = before.screen() {
            for (sum, column) in self.chromatic.iter_mut().zip(columns) {
                *sum += t.medium.dior_dlambda * segment.first::<false>(column).ddistance;
            }
        }
        self.dispersed += t.medium.dior_dlambda * t.distance;
        if let Some(column) = before.lambda() {
            self.lengthened += t.medium.ior * segment.first::<true>(column).ddistance;
        }
    }

    /// d(OPL)/dλ = Σ (nᵢ'ℓᵢ + nᵢ ∂ℓᵢ/∂λ), in stage units per nm.
    pub fn optical_path_derivative(&self) -> f64 {
        self.dispersed + self.lengthened
    }

    /// What has become of the invariants where the ray has `columns` and `momentum` now.
    pub fn residuals<C: ColumnSet>(&self, columns: &C, momentum: DVec3) -> Residuals {
        let now = values(columns, momentum);
        let mixed = |i: usize| now.mixed[i] + self.chromatic[i] - self.start.mixed[i];
        Residuals {
            lagrange: now.lagrange - self.start.lagrange,
            chromatic: [mixed(0), mixed(1)],
            conrady: self.lengthened - (now.along - self.start.along),
            scales: [
                now.scales[0],
                now.scales[1] + self.chromatic[0].abs().max(self.chromatic[1].abs()),
                now.scales[2] + self.lengthened.abs(),
            ],
        }
    }
}

fn values<C: ColumnSet>(columns: &C, momentum: DVec3) -> Values {
    let mut values = Values::default();
    if let Some([x, y]) = columns.screen() {
        values.lagrange = x.momentum.dot(y.point) - y.momentum.dot(x.point);
        values.scales[0] = x.momentum.length() * y.point.length() + y.momentum.length() * x.point.length();
        if let Some(lambda) = columns.lambda() {
            for (i, column) in [x, y].into_iter().enumerate() {
                values.mixed[i] = column.momentum.dot(lambda.point) - lambda.momentum.dot(column.point);
                let scale =
                    column.momentum.length() * lambda.point.length() + lambda.momentum.length() * column.point.length();
                values.scales[1] = values.scales[1].max(scale);
            }
        }
    }
    if let Some(lambda) = columns.lambda() {
        values.along = momentum.dot(lambda.point);
        values.scales[2] = momentum.length() * lambda.point.length();
    }
    values
}
