//! Pieces of solids of revolution as images of the unit square: what sampling over their area is written with.
//!
//! (s, t) is the way along the profile and the turn about the axis. Along flat pieces and cones r² is even in s, around a cylinder
//! the height, so that equal parts of the square have equal areas. On curved caps √(1 − r²/r₁²) is even, with the outer radius r₁:
//! that is so for half a sphere, and keeps the area bounded where a cap becomes vertical.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{Form, Revolved};

/// A point of a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnPiece {
    /// Object space.
    pub(crate) point: DVec3,
    /// Outward unit normal.
    pub(crate) normal: DVec3,
    /// Area per unit of the square.
    pub(crate) area: f64,
}

impl Revolved {
    /// How many pieces the surface has.
    pub(crate) fn piece_count(&self) -> u32 {
        self.pieces()
    }

    /// Lowest and highest corner in object space.
    pub(crate) fn box_ends(&self) -> [DVec3; 2] {
        self.bounds()
    }

    /// The image of a place of the unit square on the piece `primitive`; `None` where the piece has no area.
    pub(crate) fn over_square(&self, primitive: u32, [s, t]: [f64; 2]) -> Option<OnPiece> {
        let (r, z, ring) = match self.section(primitive) {
            None => {
                let [low, high] = [&self.lower, &self.upper].map(|sections| sections.last().map_or(0.0, |s| s.rim));
                (self.radius, low + s * (high - low), TAU * self.radius * (high - low))
            }
            Some((is_upper, i)) => {
                let sections = if is_upper { &self.upper } else { &self.lower };
                let (inner, outer) = (i.checked_sub(1).map_or(0.0, |i| sections[i].outer), sections[i].outer);
                // ∫ … r dr per ds, without the slope.
                let (r, step) = if is_curved(&sections[i].form) {
                    let first = cap(inner, outer);
                    let c = first * (1.0 - s);
                    (outer * ((1.0 - c) * (1.0 + c)).sqrt(), outer * outer * c * first)
                } else {
                    let squares = [inner * inner, outer * outer];
                    ((squares[0] + s * (squares[1] - squares[0])).sqrt(), 0.5 * (squares[1] - squares[0]))
                };
                (r, sections[i].form.height(r), TAU * step)
            }
        };
        let around = DVec2::new(libm::cos(TAU * t), libm::sin(TAU * t)) * r;
        let point = self.axis.turned_back(around.extend(z));
        let normal = self.piece(primitive, point).gradient.normalize_or_zero();
        // √(1 + h'²) is over the cosine of the normal to the axis.
        let slope = match self.section(primitive) {
            None => 1.0,
            Some(_) => 1.0 / self.axis.turned_to_z(normal).z.abs(),
        };
        let area = ring * slope;
        (area > 0.0 && area.is_finite()).then_some(OnPiece { point, normal, area })
    }

    /// The place of the unit square whose image is `p`, a point of the piece up to rounding.
    pub(crate) fn place_on_square(&self, primitive: u32, p: DVec3) -> [f64; 2] {
        let p = self.axis.turned_to_z(p);
        let r = p.truncate().length();
        let s = match self.section(primitive) {
            None => {
                let [low, high] = [&self.lower, &self.upper].map(|sections| sections.last().map_or(0.0, |s| s.rim));
                (p.z - low) / (high - low)
            }
            Some((is_upper, i)) => {
                let sections = if is_upper { &self.upper } else { &self.lower };
                let (inner, outer) = (i.checked_sub(1).map_or(0.0, |i| sections[i].outer), sections[i].outer);
                if is_curved(&sections[i].form) {
                    1.0 - cap(r, outer) / cap(inner, outer)
                } else {
                    (r - inner) * (r + inner) / ((outer - inner) * (outer + inner))
                }
            }
        };
        let turn = libm::atan2(p.y, p.x) / TAU;
        [s.clamp(0.0, 1.0), if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}

fn is_curved(form: &Form) -> bool {
    match form {
        Form::Conic { curvature, .. } => *curvature != 0.0,
        Form::Cone { .. } => false,
        Form::Asphere(_) => true,
    }
}

/// √(1 − r²/outer²).
fn cap(r: f64, outer: f64) -> f64 {
    ((outer - r) * (outer + r)).max(0.0).sqrt() / outer
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::geometry::{Axis, Cap};

    /// The area of all pieces, by the midpoint rule along the profile.
    fn area(solid: &Revolved) -> f64 {
        let steps = 2000;
        let piece = |primitive: u32| -> f64 {
            (0..steps)
                .filter_map(|i| solid.over_square(primitive, [(f64::from(i) + 0.5) / f64::from(steps), 0.3]))
                .map(|on| on.area / f64::from(steps))
                .sum()
        };
        (0..solid.piece_count()).map(piece).sum()
    }

    fn solids() -> Vec<(Revolved, f64)> {
        let cylinder = Revolved::cylinder(3.0, 0.5, 0.5, Axis::X).unwrap();
        let cone = Revolved::cylinder(3.0, 0.5, 0.0, Axis::Y).unwrap();
        let capsule = Revolved::capsule(2.0, 0.5, 0.5, Axis::Z).unwrap();
        let slant = (9.0_f64 + 0.25).sqrt();
        // A half ball and the plane behind it.
        let face = Cap { curvature: 0.5, semi_diameter: 1.5, ..Cap::default() };
        let lens = Revolved::lens(&face, &Cap { semi_diameter: 1.5, ..Cap::default() }, 2.0, 1.5).unwrap();
        let sag = 2.0 - (4.0_f64 - 2.25).sqrt();
        let lens_area = 2.0 * PI * 2.0 * sag + PI * 2.25 + 2.0 * PI * 1.5 * (2.0 - sag);
        vec![
            (cylinder, 2.0 * PI * 0.5 * 3.0 + 2.0 * PI * 0.25),
            (cone, PI * 0.5 * slant + PI * 0.25),
            (capsule, 2.0 * PI * 0.5 * 2.0 + 4.0 * PI * 0.25),
            (lens, lens_area),
        ]
    }

    #[test]
    fn areas_are_those_of_school() {
        for (solid, expected) in solids() {
            let found = area(&solid);
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} is not {expected}");
        }
    }

    #[test]
    fn the_square_is_found_again() {
        let uneven = Revolved::capsule(2.0, 0.5, 0.2, Axis::X).unwrap();
        for solid in solids().into_iter().map(|(solid, _)| solid).chain([uneven]) {
            for primitive in 0..solid.piece_count() {
                for place in [[0.1, 0.2], [0.5, 0.7], [0.93, 0.99]] {
                    let Some(OnPiece { point, normal, .. }) = solid.over_square(primitive, place) else { continue };
                    let [s, t] = solid.place_on_square(primitive, point);
                    assert!((s - place[0]).abs() < 1e-9 && (t - place[1]).abs() < 1e-9, "{primitive}: {s} {t}");
                    assert!((normal.length() - 1.0).abs() < 1e-12);
                    assert!(solid.covers(primitive, point, 1e-12));
                }
            }
        }
    }
}
