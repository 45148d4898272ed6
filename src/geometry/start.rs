//! The start of a ray as one instance sees it: which of the candidates that pass through it are met.
//!
//! The rules are those of [`Departures`](super::Departures); this file has the error bounds behind "here".
//!
//! Let u = 2^-53. A hit point in render space is a combination of transformed corners: it is off its surface by less than
//! 8 u (|L||v| + |t|), L and t being the transform and v the corner. Going to object space with a rounded inverse adds 4 u
//! ‖L⁻¹‖ (|p| + |t|) and 8 u ‖L⁻¹‖ ‖L‖ |o|. Together less than `16 u ‖L⁻¹‖ (|p| + |t| + reach + ‖L‖ |o|)`, reach being the
//! largest |L||v| + |t| of the surfaces that the ray stands on. The test of a triangle errs by its projected size over its
//! area: in distance from the plane by less than 8 u · size · |e1||e2| / |e1 × e2|.

use glam::{DMat3, DVec3};

use super::departures::Crossing;
use super::solid::{Border, Solid};
use super::triangle::TriangleHit;

/// 2^-53, half the distance from 1 to the next f64.
pub(super) const UNIT_ROUNDOFF: f64 = f64::EPSILON / 2.0;
/// Factor of the bound above.
const START_ERRORS: f64 = 16.0;
/// Factor of the triangle's own error.
const TRIANGLE_ERRORS: f64 = 8.0;
/// Crossings are kept while the ray has not left their place by more than this many bounds: further than what counts as
/// here, so that a surface just crossed is not taken for one that is still to come.
const KEPT: f64 = 4.0;
/// The same with room for rounding: what is higher than this many bounds is not here.
const FAR: f64 = 5.0;
/// A surface may cut the ray behind its start, by rounding: at most by half the digits, where a grazing ray makes the
/// bound on the distance from the plane a long way along the ray.
const BEHIND: f64 = 1.0 / 67_108_864.0;

/// A candidate that is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met {
    pub(super) distance: f64,
    pub(super) at_start: bool,
}

/// The start of a ray in the object space of an instance.
pub(super) struct Start<'a, M> {
    pub(super) instance: u32,
    pub(super) crossings: &'a [Crossing],
    /// Render-space direction of the ray that arrived here, and the map from there.
    pub(super) arrival: DVec3,
    pub(super) inverse: &'a DMat3,
    /// ‖L⁻¹‖ (|p| + |t| + reach + ‖L‖ |o|): the numbers that were rounded. Most candidates end before it is asked for.
    pub(super) magnitude: M,
    /// The same for the largest reach of all surfaces: at least as much.
    pub(super) at_most: f64,
}

/// How far behind its start a ray looks, given the size of the numbers that were rounded.
pub(super) fn behind(magnitude: f64) -> f64 {
    BEHIND * magnitude
}

impl<M: Fn() -> f64> Start<'_, M> {
    /// The direction of arrival in object space; its length does not matter.
    fn arrived(&self) -> DVec3 {
        *self.inverse * self.arrival
    }

    /// The last crossing of this instance here, and whether it is the last of all.
    fn last(&self) -> Option<(Crossing, bool)> {
        let index = self.crossings.iter().rposition(|c| c.instance == self.instance)?;
        Some((self.crossings[index], index + 1 == self.crossings.len()))
    }

    /// The primitive of this instance that the ray has left last, if no other instance was left since: it is not met here.
    pub(super) fn left(&self) -> Option<u32> {
        self.crossings.last().filter(|crossing| crossing.instance == self.instance).map(|crossing| crossing.primitive)
    }

    /// Whether a triangle that the ray's line crosses is met, which is not the one that it has [left](Self::left). `corners` are
    /// relative to the start; `corners_of` gives those of another triangle of the mesh.
    pub(super) fn triangle(
        &self,
        primitive: u32,
        hit: &TriangleHit,
        direction: DVec3,
        corners: [DVec3; 3],
        corners_of: impl Fn(u32) -> [DVec3; 3],
    ) -> Option<Met> {
        let [a, b, c] = corners;
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let raised = (hit.distance * direction.dot(normal)).abs();
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let size = corners.iter().fold(0.0, |size, p| larger(p.abs().max_element(), size));
        // Most are far away, beyond doubt: |e1||e2| is at least the area. The rest takes roots and quotients.
        let most = FAR * UNIT_ROUNDOFF * (START_ERRORS * self.at_most + TRIANGLE_ERRORS * size);
        if raised * raised > most * most * (e1.length_squared() * e2.length_squared()) {
            return (hit.distance > 0.0).then_some(Met { distance: hit.distance, at_start: false });
        }
        let magnitude = (self.magnitude)();
        let area = normal.length();
        let height = raised / area;
        let slenderness = e1.length() * e2.length() / area;
        let error = UNIT_ROUNDOFF * (START_ERRORS * magnitude + TRIANGLE_ERRORS * size * slenderness);
        if height > error {
            let at_start = height <= KEPT * error;
            return (hit.distance > 0.0).then_some(Met { distance: hit.distance, at_start });
        }
        if hit.distance < -behind(magnitude) {
            return None;
        }
        let met = self.crosses_now(primitive, hit.leaving, corners, &corners_of).unwrap_or_else(|| {
            // Not crossed when the ray arrived, so it is crossed now if the ray still goes the way it came.
            let arriving = self.arrived().dot(normal);
            if hit.leaving { arriving > 0.0 } else { arriving < 0.0 }
        });
        met.then_some(Met { distance: hit.distance.max(0.0), at_start: true })
    }

    /// Whether a triangle here is crossed in view of the crossings of its instance; `None` if there are none.
    fn crosses_now(
        &self,
        primitive: u32,
        leaving: bool,
        corners: [DVec3; 3],
        corners_of: impl Fn(u32) -> [DVec3; 3],
    ) -> Option<bool> {
        let mut met = None;
        for crossing in self.crossings.iter().rev().filter(|c| c.instance == self.instance) {
            // The ray is on this side of the sheet.
            let other_side = crossing.outward != leaving;
            if crossing.primitive == primitive {
                return Some(other_side);
            }
            match relation(corners, corners_of(crossing.primitive), crossing.outward) {
                Relation::SameSheet => return Some(other_side),
                // A coincident sheet that faces the other way is another one: only its own crossings count.
                Relation::FacingSheet => met = Some(true),
                Relation::Beyond => return Some(other_side),
                Relation::Behind => return Some(false),
            }
        }
        met
    }

    /// Where a sphere is met: the distance, and whether the ray leaves there.
    ///
    /// A ray that stands on the sphere meets it at the other root of the quadratic equation, with no need of a tolerance:
    /// t = 0 is a root by construction, so the other is −2 o·d.
    pub(super) fn sphere(
        &self,
        radius: f64,
        origin: DVec3,
        direction: DVec3,
        roots: Option<[f64; 2]>,
    ) -> Option<(Met, bool)> {
        let along = origin.dot(direction);
        let error = UNIT_ROUNDOFF * START_ERRORS * (self.magnitude)();
        let other_side = |distance: f64| {
            let height = distance * along.abs() / radius;
            (Met { distance, at_start: height <= KEPT * error }, true)
        };
        let here = |leaving| Some((Met { distance: 0.0, at_start: true }, leaving));
        if let Some((crossing, is_last)) = self.last() {
            return match (crossing.outward, is_last) {
                // After the event itself the side is known better than the sign of a rounded product.
                (true, true) => None,
                (false, true) => Some(other_side((-2.0 * along).max(0.0))),
                // Another surface here has turned the ray since.
                (true, false) => {
                    if along < 0.0 {
                        here(false)
                    } else {
                        None
                    }
                }
                (false, false) if along < 0.0 => Some(other_side(-2.0 * along)),
                (false, false) => here(true),
            };
        }
        if (origin.length() - radius).abs() <= error {
            let arriving = self.arrived().dot(origin);
            if along > 0.0 && arriving > 0.0 {
                return here(true);
            }
            if along < 0.0 {
                return if arriving < 0.0 { here(false) } else { Some(other_side(-2.0 * along)) };
            }
            return None;
        }
        let [near, far] = roots?;
        let (distance, leaving) = if near > 0.0 { (near, false) } else { (far, true) };
        (distance > 0.0).then(|| {
            let height = distance * ((origin + distance * direction).dot(direction)).abs() / radius;
            (Met { distance, at_start: height <= KEPT * error }, leaving)
        })
    }

    /// Where a solid is met.
    ///
    /// If the ray stands on the solid, its side is known: from the last crossing, or, where that has yet to be made, from
    /// the way the ray arrived. What another surface here has done to the ray since may have turned it to the other side.
    pub(super) fn solid(&self, solid: &Solid, origin: DVec3, direction: DVec3) -> Option<(Met, Border)> {
        let error = UNIT_ROUNDOFF * START_ERRORS * (self.magnitude)();
        let standing = match self.last() {
            Some((crossing, is_last)) => Some((crossing.primitive, !crossing.outward, is_last)),
            None => solid
                .piece_at(origin, error, |_| true)
                .map(|primitive| (primitive, self.arrived().dot(solid.piece(primitive, origin).gradient) > 0.0, false)),
        };
        let border = match standing {
            None => solid.borders(origin, direction, None).ahead()?,
            Some((primitive, inside, settled)) => {
                // After the event itself the side is known better than the sign of a rounded product.
                let along = direction.dot(solid.piece(primitive, origin).gradient);
                if !settled && if inside { along > 0.0 } else { along < 0.0 } {
                    let border = Border { distance: 0.0, primitive, leaving: inside };
                    return Some((Met { distance: 0.0, at_start: true }, border));
                }
                if !inside && solid.is_convex() {
                    return None;
                }
                let borders = solid.borders(origin, direction, Some(primitive));
                match borders.next(inside, primitive, solid.is_closed()) {
                    None if inside && solid.is_closed() => solid.way_out(origin, direction, primitive, KEPT * error),
                    border => border?,
                }
            }
        };
        let normal = solid.piece(border.primitive, origin + border.distance * direction).gradient;
        let height = border.distance * direction.dot(normal).abs();
        let at_start = height <= KEPT * error * normal.length();
        Some((Met { distance: border.distance, at_start }, border))
    }
}

/// How a triangle lies to another one that a ray has left on one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// In its plane, facing the same way.
    SameSheet,
    /// In its plane, facing the other way.
    FacingSheet,
    /// It reaches into the half-space in which the ray runs.
    Beyond,
    /// It does not: the ray cannot meet it.
    Behind,
}

/// How the triangle `corners` lies to the triangle `left`, on whose outward or inward side the ray runs.
pub(super) fn relation(corners: [DVec3; 3], left: [DVec3; 3], outward: bool) -> Relation {
    let normal = (left[1] - left[0]).cross(left[2] - left[0]);
    let side = if outward { normal } else { -normal };
    let mut coplanar = true;
    for corner in corners {
        let offset = corner - left[0];
        let height = side.dot(offset);
        // Shared corners are in the plane to the rounding of the product.
        let error = TRIANGLE_ERRORS * UNIT_ROUNDOFF * normal.length() * offset.length();
        if height > error {
            return Relation::Beyond;
        }
        coplanar &= height >= -error;
    }
    if !coplanar {
        Relation::Behind
    } else if (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(normal) > 0.0 {
        Relation::SameSheet
    } else {
        Relation::FacingSheet
    }
}
