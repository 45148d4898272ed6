//! Pieces of the profile of a solid of revolution: heights z over the distance r from the axis.
//!
//! A piece is a surface on its own, with the equation Q = 0 and Q < 0 above it (towards +z), where "above" holds on the
//! sheet that the profile uses:
//!
//! ```text
//! conic   z = v + c r²/(1 + √(1 − K c² r²))      Q = c (r² + K ζ²) − 2 ζ,  ζ = z − v,  K = 1 + k    sheet: 1 − K c ζ ≥ 0
//! cone    z = z0 + (r − r0)/m                     Q = ±(r² − w²),  w = r0 + m (z − z0)               sheet: w ≥ 0
//! ```
//!
//! with the curvature c, 0 for a plane, and the conic constant k (0 a sphere, −1 a paraboloid). Even aspheres have a file
//! of their own (`asphere.rs`).

use glam::{DMat3, DVec3};

use super::asphere::{Asphere, Sag};
use super::solid::Bend;

/// The equation of a piece.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Form {
    /// A cap about the axis; a plane where the curvature is 0.
    Conic { vertex: f64, curvature: f64, kappa: f64 },
    /// Part of a cone: `radius` at the height `height`, changing by `per_height` ≠ 0.
    Cone { height: f64, radius: f64, per_height: f64 },
    /// A cap with terms of higher order.
    Asphere(Asphere),
}

/// A form between the outer radius of the piece before it and its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) form: Form,
    pub(super) outer: f64,
    /// Height at the outer radius: one number for all who ask on which side of the rim a line passes.
    pub(super) rim: f64,
}

/// A line in a frame with the solid's axis as z, with r² = `across` t² + 2 `slope` t + `start`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    across: f64,
    slope: f64,
    start: f64,
    /// Distance from the axis at the nearest point, and where that is.
    nearest: f64,
    at_nearest: f64,
}

/// Where a line meets a piece, as if the piece had no end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Roots {
    /// In order; equal where the line does not quite reach.
    pub(super) at: [f64; 2],
    /// How far each is on the sheet of the profile; negative on another one.
    pub(super) sheet: [f64; 2],
    /// The line crosses, and does not just pass by.
    pub(super) cross: bool,
}

impl Line {
    pub(super) fn new(origin: DVec3, direction: DVec3) -> Self {
        let (o, d) = (origin.truncate(), direction.truncate());
        let across = d.length_squared();
        let slope = o.dot(d);
        let start = o.length_squared();
        // Directions so close to the axis that their squares underflow do not move away from it.
        let (nearest, at_nearest) = if across >= f64::MIN_POSITIVE {
            (o.perp_dot(d).abs() / across.sqrt(), -slope / across)
        } else {
            (start.sqrt(), 0.0)
        };
        Self { origin, direction, across, slope, start, nearest, at_nearest }
    }

    /// Where the line is less than `radius` away from the axis. If it stands on the cylinder of that radius, one end is 0.
    pub(super) fn within(&self, radius: f64, standing: bool) -> Option<[f64; 2]> {
        if self.across < f64::MIN_POSITIVE {
            return (self.nearest < radius || standing).then_some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        if standing {
            let other = 2.0 * self.at_nearest;
            return (other != 0.0).then(|| [other.min(0.0), other.max(0.0)]);
        }
        let discriminant = (radius - self.nearest) * (radius + self.nearest);
        let half = (discriminant / self.across).sqrt();
        (discriminant > 0.0).then_some([self.at_nearest - half, self.at_nearest + half])
    }

    /// Whether it leads anywhere but along the axis.
    pub(super) fn moves_across(&self) -> bool {
        self.across >= f64::MIN_POSITIVE
    }

    /// r² at a distance along the line.
    pub(super) fn square(&self, t: f64) -> f64 {
        self.start + t * self.mean_rate(t)
    }

    /// Its derivative.
    pub(super) fn rate(&self, t: f64) -> f64 {
        2.0 * (self.across * t + self.slope)
    }

    /// The mean of the derivative from the origin to there.
    pub(super) fn mean_rate(&self, t: f64) -> f64 {
        self.across * t + 2.0 * self.slope
    }

    /// Half the second derivative.
    pub(super) fn across(&self) -> f64 {
        self.across
    }

    /// Where the line is nearest to the axis.
    pub(super) fn nearest_point(&self) -> f64 {
        self.at_nearest
    }

    /// Height at a distance along the line.
    pub(super) fn height(&self, t: f64) -> f64 {
        // ∞ · 0 is no number, and a line that does not rise stays where it is.
        if self.direction.z == 0.0 { self.origin.z } else { self.origin.z + t * self.direction.z }
    }
}

impl Form {
    /// Height at the distance `r` from the axis.
    pub(super) fn height(&self, r: f64) -> f64 {
        match *self {
            Self::Conic { vertex, curvature, kappa } => {
                let root = (1.0 - kappa * (curvature * r) * (curvature * r)).max(0.0).sqrt();
                vertex + curvature * r * r / (1.0 + root)
            }
            Self::Cone { height, radius, per_height } => height + (r - radius) / per_height,
            Self::Asphere(ref asphere) => asphere.vertex + asphere.sag(r * r).value,
        }
    }

    /// Crossings of the line with a quadric. If it stands on the piece, 0 is one of them.
    pub(super) fn roots(&self, line: &Line, standing: bool) -> Option<Roots> {
        let Line { origin, direction, across, slope, start, .. } = *line;
        // a t² + 2 b t + c = 0.
        let (a, b, c) = match *self {
            Self::Conic { vertex, curvature, kappa } => {
                let zeta = origin.z - vertex;
                let a = curvature * (across + kappa * direction.z * direction.z);
                let b = curvature * (slope + kappa * zeta * direction.z) - direction.z;
                (a, b, curvature * (start + kappa * zeta * zeta) - 2.0 * zeta)
            }
            Self::Cone { height, radius, per_height } => {
                let (w, dw) = (radius + per_height * (origin.z - height), per_height * direction.z);
                let r = start.sqrt();
                (across - dw * dw, slope - w * dw, (r - w) * (r + w))
            }
            Self::Asphere(_) => return None,
        };
        let c = if standing { 0.0 } else { c };
        let discriminant = b * b - a * c;
        let (at, cross) = if discriminant > 0.0 {
            let q = -(b + discriminant.sqrt().copysign(b));
            let (s, t) = (q / a, c / q);
            ([s.min(t), s.max(t)], true)
        } else {
            ([-b / a; 2], false)
        };
        // A line in the plane, or along the cone, has no crossing.
        if at.iter().all(|t| !t.is_finite()) {
            return None;
        }
        let sheet = at.map(|t| match *self {
            _ if !t.is_finite() => f64::NEG_INFINITY,
            Self::Conic { vertex, curvature, kappa } => 1.0 - kappa * curvature * (line.height(t) - vertex),
            Self::Cone { height, radius, per_height } => radius + per_height * (line.height(t) - height),
            Self::Asphere(_) => f64::NEG_INFINITY,
        });
        Some(Roots { at, sheet, cross })
    }

    /// Whether `p` is above the piece. Off its sheet, the whole sheet is on one side.
    fn is_under(&self, p: DVec3) -> bool {
        let value = match *self {
            Self::Conic { vertex, curvature, kappa } => {
                let zeta = p.z - vertex;
                if 1.0 - kappa * curvature * zeta < 0.0 {
                    return zeta > 0.0;
                }
                self.equation(p).0
            }
            Self::Cone { height, radius, per_height } => {
                if radius + per_height * (p.z - height) < 0.0 {
                    return per_height < 0.0;
                }
                self.equation(p).0
            }
            Self::Asphere(_) => self.equation(p).0,
        };
        value < 0.0
    }

    /// Q, ∇Q and the second derivatives at `p`.
    pub(super) fn equation(&self, p: DVec3) -> (f64, DVec3, Bend) {
        let square = p.truncate().length_squared();
        match *self {
            Self::Conic { vertex, curvature: c, kappa } => {
                let zeta = p.z - vertex;
                let value = c * (square + kappa * zeta * zeta) - 2.0 * zeta;
                let gradient = DVec3::new(2.0 * c * p.x, 2.0 * c * p.y, 2.0 * (c * kappa * zeta - 1.0));
                let bend = if c == 0.0 {
                    Bend::Plane
                } else if kappa.to_bits() == 1.0_f64.to_bits() {
                    Bend::Sphere(2.0 * c)
                } else {
                    Bend::Quadric(DMat3::from_diagonal(DVec3::new(2.0 * c, 2.0 * c, 2.0 * c * kappa)))
                };
                (value, gradient, bend)
            }
            Self::Cone { height, radius, per_height: m } => {
                let w = radius + m * (p.z - height);
                let r = square.sqrt();
                let sign = m.signum();
                let gradient = DVec3::new(2.0 * p.x, 2.0 * p.y, -2.0 * m * w);
                let hessian = DMat3::from_diagonal(DVec3::new(2.0, 2.0, -2.0 * m * m));
                (sign * (r - w) * (r + w), sign * gradient, Bend::Quadric(sign * hessian))
            }
            Self::Asphere(ref asphere) => {
                // Q = 2 (σ − ζ), of the size of the conic's.
                let Sag { value, first, second, third } = asphere.sag(square);
                let gradient = DVec3::new(4.0 * first * p.x, 4.0 * first * p.y, -2.0);
                let r = square.sqrt();
                // At the axis every direction is radial.
                let radial = if r > 0.0 { DVec3::new(p.x / r, p.y / r, 0.0) } else { DVec3::X };
                let bend = Bend::Revolved {
                    radial,
                    around: DVec3::new(-radial.y, radial.x, 0.0),
                    second: [4.0 * first + 8.0 * second * square, 4.0 * first],
                    third: [r * (24.0 * second + 16.0 * third * square), 8.0 * r * second],
                };
                (2.0 * (value - (p.z - asphere.vertex)), gradient, bend)
            }
        }
    }
}

impl Section {
    /// Calls `found` with the distances between `from` and `to` at which the line changes its side of the piece, in order.
    ///
    /// `above` says on which side it is at either end. Those two answers are shared with the neighbours, so they stand, and
    /// the roots are held against them: where rounding has moved a root across an end, it is the ends that are right.
    pub(super) fn changes(
        &self,
        line: &Line,
        [from, to]: [f64; 2],
        above: [bool; 2],
        standing: bool,
        found: &mut dyn FnMut(f64),
    ) {
        if let Form::Asphere(asphere) = &self.form {
            return asphere.changes(line, [from, to], above, standing, found);
        }
        let roots = self.form.roots(line, standing);
        let valid =
            |roots: &Roots, i: usize| roots.cross && roots.sheet[i] >= 0.0 && from < roots.at[i] && roots.at[i] < to;
        let [first, second] = roots.map_or([None; 2], |r| [0, 1].map(|i| valid(&r, i).then_some(r.at[i])));
        if above[0] == above[1] {
            let middle = 0.5 * (from + to);
            let pair = match (first, second, roots) {
                (Some(first), Some(second), _) => Some([first, second]),
                // The chord may be the whole stretch, from rim to rim.
                (_, _, Some(r)) if r.cross && middle.is_finite() => {
                    let p = line.origin + middle * line.direction;
                    (self.form.is_under(p) != above[0]).then(|| r.at.map(|t| t.clamp(from, to)))
                }
                _ => None,
            };
            pair.into_iter().flatten().for_each(&mut *found);
            return;
        }
        found(match (first, second) {
            (Some(t), None) | (None, Some(t)) => t,
            // One of them belongs to the neighbour: the one closer to an end.
            (Some(first), Some(second)) => {
                if first - from < to - second {
                    second
                } else {
                    first
                }
            }
            // The root is at an end; on which one, the sheet tells.
            (None, None) => {
                let best = roots.map_or(from, |r| if r.sheet[1] > r.sheet[0] { r.at[1] } else { r.at[0] });
                best.clamp(from, to)
            }
        });
    }
}
