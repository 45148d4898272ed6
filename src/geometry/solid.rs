//! Solids with analytic surfaces: what a line crosses, and how a ray goes on that stands on one of them.
//!
//! A solid answers a line with its borders: where the line enters and leaves, in turns and in order. Which piece of the
//! surface is crossed follows from that, never the other way round, so no ray slips through where pieces meet: a ray
//! through a rim enters once and leaves once, whatever rounding says about either piece.
//!
//! A ray that stands on a piece knows two things better than its rounded coordinates do: that the piece is met at distance
//! 0 (its equation has the root 0, the others follow without tolerance), and on which side the ray is (`departures.rs`).
//! [`Borders::next`] holds the list against the side.

use glam::{DMat3, DVec3};

use super::cuboid::{Cuboid, Rectangle};
use super::revolved::Revolved;

/// Borders that one line can have; more than any solid here makes.
const CAPACITY: usize = 40;

/// An analytic solid, or a piece of a plane.
#[derive(Clone, Debug, PartialEq)]
pub enum Solid {
    /// A box about the origin.
    Cuboid(Cuboid),
    /// A rectangle about the origin: it has sides but no inside.
    Rectangle(Rectangle),
    /// Cylinders, cones, capsules, lenses.
    Revolved(Revolved),
}

/// A spine or a normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// +x
    X,
    /// +y
    Y,
    /// +z
    Z,
}

impl Axis {
    /// From USD's token.
    pub fn from_token(token: &str) -> Option<Self> {
        match token {
            "X" => Some(Self::X),
            "Y" => Some(Self::Y),
            "Z" => Some(Self::Z),
            _ => None,
        }
    }

    pub(super) fn index(self) -> usize {
        self as usize
    }

    /// Turns the axes so that this one becomes z.
    pub(super) fn turned_to_z(self, v: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(v.y, v.z, v.x),
            Self::Y => DVec3::new(v.z, v.x, v.y),
            Self::Z => v,
        }
    }

    /// The inverse of [`Self::turned_to_z`].
    pub(super) fn turned_back(self, v: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(v.z, v.x, v.y),
            Self::Y => DVec3::new(v.y, v.z, v.x),
            Self::Z => v,
        }
    }
}

/// Where a line passes through the surface of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Border {
    pub(super) distance: f64,
    /// Which piece of the surface.
    pub(super) primitive: u32,
    pub(super) leaving: bool,
}

/// All borders of a line, in order, entering and leaving in turns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Borders {
    items: [Border; CAPACITY],
    len: usize,
}

/// A piece of surface around one of its points, in object space: the level set F = 0 with F < 0 inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// F.
    pub(super) value: f64,
    /// ∇F, outward; 0 only where the surface has no normal.
    pub(super) gradient: DVec3,
    pub(super) bend: Bend,
}

/// The second derivatives of F.
#[derive(Clone, Copy, Debug)]
pub(super) enum Bend {
    Plane,
    /// H = s I: a sphere of radius |∇F|/|s|, convex for s > 0.
    Sphere(f64),
    Quadric(DMat3),
    /// A surface of revolution with F_zz = 0 and no mixed derivatives in z: along the unit vectors `radial` and `around`,
    /// F_rr and F_tt, F_rrr and F_rtt.
    Revolved {
        radial: DVec3,
        around: DVec3,
        second: [f64; 2],
        third: [f64; 2],
    },
}

impl Borders {
    pub(super) fn new() -> Self {
        Self { items: [Border { distance: 0.0, primitive: 0, leaving: false }; CAPACITY], len: 0 }
    }

    /// Adds the next border. A stay inside of no length is none.
    pub(super) fn push(&mut self, border: Border) {
        if border.leaving && self.len > 0 && border.distance <= self.items[self.len - 1].distance {
            self.len -= 1;
        } else if self.len < CAPACITY {
            self.items[self.len] = border;
            self.len += 1;
        }
    }

    pub(super) fn as_slice(&self) -> &[Border] {
        &self.items[..self.len]
    }

    /// The first border in front of a ray that starts in the open.
    pub(super) fn ahead(&self) -> Option<Border> {
        self.as_slice().iter().copied().find(|b| b.distance > 0.0)
    }

    /// The first border in front of a ray that starts on the piece `primitive`, inside or outside of a `closed` solid.
    ///
    /// The sense of the first border ahead must fit the side. Where it does not, rounding has moved a border across the
    /// start, forward or backward: the nearer one of the two in question.
    pub(super) fn next(&self, inside: bool, primitive: u32, closed: bool) -> Option<Border> {
        let borders = self.as_slice();
        let first = borders.iter().position(|b| b.distance > 0.0).unwrap_or(borders.len());
        let ahead = borders.get(first).copied();
        if !closed || ahead.is_some_and(|b| b.leaving == inside) {
            return ahead;
        }
        let behind = first.checked_sub(1).map(|i| borders[i]).filter(|b| b.leaving == inside);
        // The piece on which the ray stands has been crossed for good, or is left at once.
        let crossed_behind = behind.filter(|b| inside || b.primitive != primitive);
        let is_nearer = match (crossed_behind, ahead) {
            (Some(behind), Some(ahead)) => -behind.distance < ahead.distance,
            (behind, _) => behind.is_some() && (inside || ahead.is_some()),
        };
        match crossed_behind {
            Some(behind) if is_nearer => Some(Border { distance: 0.0, ..behind }),
            _ => borders.get(first + 1).copied(),
        }
    }
}

impl Solid {
    /// Whether it has an inside.
    pub fn is_closed(&self) -> bool {
        !matches!(self, Self::Rectangle(_))
    }

    /// Whether a ray that has left it cannot meet it again.
    pub(super) fn is_convex(&self) -> bool {
        match self {
            Self::Cuboid(_) => true,
            Self::Rectangle(_) => false,
            Self::Revolved(revolved) => revolved.is_convex(),
        }
    }

    /// Whether its normals move over its surface.
    pub fn is_curved(&self) -> bool {
        matches!(self, Self::Revolved(_))
    }

    /// Lowest and highest corner in object space.
    pub fn bounds(&self) -> [DVec3; 2] {
        match self {
            Self::Cuboid(cuboid) => cuboid.bounds(),
            Self::Rectangle(rectangle) => rectangle.bounds(),
            Self::Revolved(revolved) => revolved.bounds(),
        }
    }

    /// Largest coordinate.
    pub(super) fn extent(&self) -> f64 {
        let [min, max] = self.bounds();
        min.abs().max(max.abs()).max_element()
    }

    /// The borders of the line through `origin`, which lies on the piece `standing` if there is one.
    pub(super) fn borders(&self, origin: DVec3, direction: DVec3, standing: Option<u32>) -> Borders {
        match self {
            Self::Cuboid(cuboid) => cuboid.borders(origin, direction, standing),
            Self::Rectangle(rectangle) => rectangle.borders(origin, direction, standing),
            Self::Revolved(revolved) => revolved.borders(origin, direction, standing),
        }
    }

    /// The surface `primitive` at `p`, a point on it up to rounding.
    pub(super) fn piece(&self, primitive: u32, p: DVec3) -> Piece {
        match self {
            Self::Cuboid(cuboid) => cuboid.piece(primitive, p),
            Self::Rectangle(rectangle) => rectangle.piece(p),
            Self::Revolved(revolved) => revolved.piece(primitive, p),
        }
    }

    /// A normal for where a piece has none.
    pub(super) fn tip_normal(&self, primitive: u32) -> DVec3 {
        match self {
            Self::Revolved(revolved) => revolved.tip_normal(primitive),
            Self::Cuboid(_) | Self::Rectangle(_) => self.piece(primitive, DVec3::ZERO).gradient,
        }
    }

    /// The way out of a closed solid for a ray that stands on the piece `primitive` and of whose stay inside rounding has
    /// left nothing: through a neighbour that is here, or at the end of a short chord.
    pub(super) fn way_out(&self, origin: DVec3, direction: DVec3, primitive: u32, error: f64) -> Border {
        let leads_out = |piece: &Piece| direction.dot(piece.gradient) > 0.0;
        if let Some(neighbour) = self.piece_at(origin, error, leads_out) {
            return Border { distance: 0.0, primitive: neighbour, leaving: true };
        }
        let chord = match self {
            Self::Revolved(revolved) => revolved.chord(origin, direction, primitive),
            Self::Cuboid(_) | Self::Rectangle(_) => 0.0,
        };
        Border { distance: chord, primitive, leaving: true }
    }

    /// The piece that passes through `p`, up to `error`, and is `eligible`.
    pub(super) fn piece_at(&self, p: DVec3, error: f64, eligible: impl Fn(&Piece) -> bool) -> Option<u32> {
        let pieces = match self {
            Self::Cuboid(_) => 0..6,
            Self::Rectangle(_) => 0..1,
            Self::Revolved(revolved) => 0..revolved.pieces(),
        };
        let covers = |primitive: u32| match self {
            Self::Cuboid(cuboid) => cuboid.covers(p, error),
            Self::Rectangle(rectangle) => rectangle.covers(p, error),
            Self::Revolved(revolved) => revolved.covers(primitive, p, error),
        };
        pieces
            .filter_map(|primitive| {
                let piece = self.piece(primitive, p);
                let distance = piece.value.abs() / piece.gradient.length();
                (distance <= error && eligible(&piece) && covers(primitive)).then_some((primitive, distance))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(primitive, _)| primitive)
    }

    /// The point of the surface `primitive` next to `p`, which is on it up to rounding.
    pub(super) fn project(&self, primitive: u32, p: DVec3) -> DVec3 {
        let Piece { value, gradient, .. } = self.piece(primitive, p);
        let slope = gradient.length_squared();
        if slope > 0.0 { p - gradient * (value / slope) } else { p }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn borders(list: &[(f64, u32, bool)]) -> Borders {
        let mut borders = Borders::new();
        for &(distance, primitive, leaving) in list {
            borders.push(Border { distance, primitive, leaving });
        }
        borders
    }

    fn found(list: &[(f64, u32, bool)], inside: bool) -> Option<(f64, u32, bool)> {
        borders(list).next(inside, 0, true).map(|b| (b.distance, b.primitive, b.leaving))
    }

    #[test]
    fn the_side_decides_what_rounding_leaves_open() {
        let tiny = 1e-17;
        // Inside, whether the way in is computed behind, here or ahead.
        for here in [-tiny, 0.0, tiny] {
            assert_eq!(found(&[(here, 0, false), (2.0, 1, true)], true), Some((2.0, 1, true)));
            assert_eq!(
                found(&[(here, 0, false), (2.0, 1, true), (3.0, 2, false), (4.0, 3, true)], true),
                Some((2.0, 1, true))
            );
        }
        // At a rim: the way out through the neighbour is here, computed ahead or behind.
        assert_eq!(
            found(&[(-1.0, 2, false), (tiny, 1, true), (3.0, 2, false), (4.0, 3, true)], true),
            Some((tiny, 1, true))
        );
        assert_eq!(
            found(&[(-1.0, 2, false), (-tiny, 1, true), (3.0, 2, false), (4.0, 3, true)], true),
            Some((0.0, 1, true))
        );
        assert_eq!(found(&[(-1.0, 2, false), (-tiny, 1, true)], true), Some((0.0, 1, true)));
        assert_eq!(found(&[], true), None);
        // Outside, after the event here, wherever it was computed.
        for here in [-tiny, 0.0, tiny] {
            assert_eq!(found(&[(-2.0, 1, false), (here, 0, true)], false), None);
            assert_eq!(
                found(&[(-2.0, 1, false), (here, 0, true), (3.0, 2, false), (4.0, 3, true)], false),
                Some((3.0, 2, false))
            );
        }
        assert_eq!(found(&[], false), None);
        // In a hollow rim: the neighbour is entered here.
        assert_eq!(found(&[(-tiny, 1, false), (2.0, 2, true)], false), Some((0.0, 1, false)));
        // The piece itself is not entered again.
        assert_eq!(found(&[(0.0, 0, false), (2.0, 2, true)], false), None);
    }

    #[test]
    fn stays_without_length_are_none() {
        assert!(borders(&[(1.0, 0, false), (1.0, 1, true)]).as_slice().is_empty());
        assert_eq!(borders(&[(1.0, 0, false), (2.0, 1, true)]).ahead().map(|b| b.distance), Some(1.0));
    }
}
