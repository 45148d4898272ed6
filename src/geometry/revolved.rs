//! Solids of revolution between two profiles: cylinders, cones, capsules, lenses.
//!
//! The solid is what lies above the lower profile, below the upper profile, and within a radius of the axis. A profile is a
//! chain of [sections](super::profile) from the axis outwards. The line is cut at the circles where sections meet, and at each
//! cut it is above or below the profile by comparison with one number, the height of the rim there. Sections only say
//! where between two cuts the side changes, and cannot disagree with their neighbours whether it does.

mod over_square;

use glam::{DMat3, DVec3};

use super::asphere::Asphere;
use super::profile::{Form, Line, Section};
use super::solid::{Axis, Bend, Border, Borders, Piece};

pub(crate) use over_square::OnPiece;

/// A solid of revolution about an axis of its object space.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolved {
    axis: Axis,
    /// From the axis outwards.
    lower: Vec<Section>,
    upper: Vec<Section>,
    /// Of the cylinder around it all.
    radius: f64,
    bottom: f64,
    top: f64,
    is_lens: bool,
}

/// One face of a lens: a conic and terms of higher order, in light's own direction +z.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cap {
    /// 1/r at the vertex, positive if the centre is on the side of +z; 0 for a plane.
    pub curvature: f64,
    /// The conic constant k: 0 a sphere, −1 a paraboloid.
    pub conic: f64,
    /// Coefficients of r⁴, r⁶, r⁸, ….
    pub aspheres: Vec<f64>,
    /// Radius up to which the face has this form; beyond it is flat.
    pub semi_diameter: f64,
}

impl Cap {
    fn section(&self, vertex: f64, what: &str) -> Result<Section, String> {
        let Self { curvature, conic, ref aspheres, semi_diameter: outer } = *self;
        if !(outer > 0.0 && outer.is_finite()) {
            return Err(format!("the semi-diameter of the {what} is {outer}: it must be positive and finite"));
        }
        if ![curvature, conic].iter().chain(aspheres).all(|x| x.is_finite()) {
            return Err(format!("the {what} has a coefficient that is not finite"));
        }
        let kappa = 1.0 + conic;
        let reach = kappa * (curvature * outer) * (curvature * outer);
        let is_conic = aspheres.iter().all(|&a| a == 0.0);
        // A half sphere may end at its equator, whatever rounding says of 1/r · r.
        let limit = if is_conic { 1.0 + 4.0 * f64::EPSILON } else { 1.0 - f64::EPSILON };
        if reach > limit {
            return Err(format!(
                "the {what} of curvature {curvature} and conic constant {conic} ends at the radius {}: its semi-diameter {outer} \
                 must be smaller",
                1.0 / (kappa.sqrt() * curvature.abs())
            ));
        }
        let form = if is_conic {
            Form::Conic { vertex, curvature, kappa }
        } else {
            Form::Asphere(Asphere::new(vertex, curvature, kappa, aspheres.clone(), outer))
        };
        let rim = form.height(outer);
        Ok(Section { form, outer, rim })
    }
}

/// A change of side along a line.
#[derive(Clone, Copy)]
struct Change {
    at: f64,
    primitive: u32,
}

/// Changes of side of one profile, in order.
struct Changes {
    items: [Change; MAX_CHANGES],
    len: usize,
    /// Whether the line begins above.
    above: bool,
}

fn plane(height: f64, outer: f64) -> Section {
    Section { form: Form::Conic { vertex: height, curvature: 0.0, kappa: 1.0 }, outer, rim: height }
}

/// From the circle (r, z) = `inner` to the circle `outer`, further out.
fn ring(inner: [f64; 2], outer: [f64; 2]) -> Section {
    let per_height = (outer[0] - inner[0]) / (outer[1] - inner[1]);
    if !per_height.is_finite() {
        return plane(outer[1], outer[0]);
    }
    let form = Form::Cone { height: outer[1], radius: outer[0], per_height };
    Section { form, outer: outer[0], rim: outer[1] }
}

/// Part of a sphere about (0, `center`), from the axis to the distance `outer`: below the centre for `side` +1, above it
/// for −1.
fn ball(center: f64, radius: f64, side: f64, outer: [f64; 2]) -> Section {
    let form = Form::Conic { vertex: center - side * radius, curvature: side / radius, kappa: 1.0 };
    Section { form, outer: outer[0], rim: outer[1] }
}

impl Revolved {
    /// A cylinder or a truncated cone about the origin: `bottom` and `top` are the radii at ∓height/2 along the axis. One of
    /// them may be 0, which makes it a cone; `None` unless the rest is positive and everything finite.
    pub fn cylinder(height: f64, bottom: f64, top: f64, axis: Axis) -> Option<Self> {
        let end = 0.5 * height;
        let is_solid = end > 0.0 && bottom >= 0.0 && top >= 0.0 && bottom.max(top) > 0.0;
        if !(is_solid && end.is_finite() && bottom.max(top).is_finite()) {
            return None;
        }
        let face = |z: f64, r: f64| (r > 0.0).then(|| plane(z, r));
        let mut lower: Vec<Section> = face(-end, bottom).into_iter().collect();
        let mut upper: Vec<Section> = face(end, top).into_iter().collect();
        if bottom < top {
            lower.push(ring([bottom, -end], [top, end]));
        } else if top < bottom {
            upper.push(ring([top, end], [bottom, -end]));
        }
        Some(Self::new(axis, lower, upper, bottom.max(top)))
    }

    /// UsdGeom's capsule: a truncated cone with the radii `bottom` and `top` at ∓height/2 along the axis, and the parts of
    /// spheres at its ends that continue it without an edge; half spheres for equal radii.
    ///
    /// The height may be 0 for equal radii, and one of the radii may be 0; `None` unless the rest is positive and
    /// everything finite.
    pub fn capsule(height: f64, bottom: f64, top: f64, axis: Axis) -> Option<Self> {
        let end = 0.5 * height;
        let is_solid = end >= 0.0 && bottom >= 0.0 && top >= 0.0 && bottom.max(top) > 0.0;
        if !(is_solid && end.is_finite() && bottom.max(top).is_finite()) {
            return None;
        }
        let per_height = if bottom.to_bits() == top.to_bits() { 0.0 } else { (top - bottom) / height };
        // A sphere that touches the cone at the radius r has its centre at r·m along the axis from there.
        let stretch = (1.0 + per_height * per_height).sqrt();
        let center = [-end + per_height * bottom, end + per_height * top];
        let radius = [bottom * stretch, top * stretch];
        if !center.iter().chain(&radius).all(|x| x.is_finite()) {
            return None;
        }
        let below = |outer: [f64; 2]| (bottom > 0.0).then(|| ball(center[0], radius[0], 1.0, outer));
        let above = |outer: [f64; 2]| (top > 0.0).then(|| ball(center[1], radius[1], -1.0, outer));
        let mut lower: Vec<Section>;
        let mut upper: Vec<Section>;
        if bottom < top {
            lower = below([bottom, -end]).into_iter().collect();
            lower.push(ring([bottom, -end], [top, end]));
            lower.push(ball(center[1], radius[1], 1.0, [radius[1], center[1]]));
            upper = above([radius[1], center[1]]).into_iter().collect();
        } else if top < bottom {
            lower = below([radius[0], center[0]]).into_iter().collect();
            upper = above([top, end]).into_iter().collect();
            upper.push(ring([top, end], [bottom, -end]));
            upper.push(ball(center[0], radius[0], -1.0, [radius[0], center[0]]));
        } else {
            lower = below([bottom, -end]).into_iter().collect();
            upper = above([top, end]).into_iter().collect();
        }
        Some(Self::new(axis, lower, upper, radius[0].max(radius[1])))
    }

    /// A lens along z with the vertex of its front at the origin and that of its back at z = `thickness`, both faces flat
    /// from their semi-diameters to the `edge` radius, where a cylinder joins them.
    ///
    /// # Errors
    ///
    /// What does not make a solid: sizes that are not positive, a face that ends before its semi-diameter, faces that cross.
    pub fn lens(front: &Cap, back: &Cap, thickness: f64, edge: f64) -> Result<Self, String> {
        if !(thickness > 0.0 && thickness.is_finite()) {
            return Err(format!("the thickness is {thickness}: it must be positive and finite"));
        }
        let widest = front.semi_diameter.max(back.semi_diameter);
        if !(edge >= widest && edge.is_finite()) {
            return Err(format!("the edge radius is {edge}: it must be at least the larger semi-diameter, {widest}"));
        }
        let profile = |cap: &Cap, vertex: f64, what: &str| {
            let cap = cap.section(vertex, what)?;
            let flat = (cap.outer < edge).then(|| plane(cap.rim, edge));
            Ok::<_, String>(std::iter::once(cap).chain(flat).collect::<Vec<_>>())
        };
        let (lower, upper) = (profile(front, 0.0, "front")?, profile(back, thickness, "back")?);
        // Faces that cross between two of these radii leave a solid all the same: what is between them.
        let gap = |r: f64| {
            let height =
                |sections: &[Section]| sections.iter().find(|s| r <= s.outer).map_or(0.0, |s| s.form.height(r));
            height(&upper) - height(&lower)
        };
        for i in 0..=GAPS {
            let r = edge * f64::from(i) / f64::from(GAPS);
            if gap(r) < 0.0 {
                return Err(format!("front and back cross at the radius {r}: make it thicker, or the edge smaller"));
            }
        }
        Ok(Self { is_lens: true, ..Self::new(Axis::Z, lower, upper, edge) })
    }

    fn new(axis: Axis, lower: Vec<Section>, upper: Vec<Section>, radius: f64) -> Self {
        let ends = |sections: &[Section]| -> Vec<f64> {
            let axis = sections.first().map(|s| s.form.height(0.0));
            // An asphere may turn between its ends; all other sections rise or fall all the way.
            let turning = sections.iter().filter_map(|s| match &s.form {
                Form::Asphere(asphere) => Some(asphere.extremes()),
                Form::Conic { .. } | Form::Cone { .. } => None,
            });
            sections.iter().map(|s| s.rim).chain(axis).chain(turning.flatten()).collect()
        };
        let bottom = ends(&lower).into_iter().fold(f64::INFINITY, f64::min);
        let top = ends(&upper).into_iter().fold(f64::NEG_INFINITY, f64::max);
        Self { axis, lower, upper, radius, bottom, top, is_lens: false }
    }

    /// Cylinders, cones and capsules are; lenses need not be.
    pub(super) fn is_convex(&self) -> bool {
        !self.is_lens
    }

    pub(super) fn bounds(&self) -> [DVec3; 2] {
        let r = self.radius;
        [DVec3::new(-r, -r, self.bottom), DVec3::new(r, r, self.top)].map(|p| self.axis.turned_back(p))
    }

    /// Pieces of the surface, numbered along the profile: the lower sections from the axis outwards, the cylinder around, the
    /// upper sections from the outside in.
    pub(super) fn pieces(&self) -> u32 {
        (self.lower.len() + 1 + self.upper.len()) as u32
    }

    fn edge(&self) -> u32 {
        self.lower.len() as u32
    }

    fn number(&self, is_upper: bool, section: usize) -> u32 {
        if is_upper { self.pieces() - 1 - section as u32 } else { section as u32 }
    }

    /// Whether the piece belongs to the upper profile, and its index there; `None` for the cylinder.
    fn section(&self, primitive: u32) -> Option<(bool, usize)> {
        match primitive.cmp(&self.edge()) {
            std::cmp::Ordering::Less => Some((false, primitive as usize)),
            std::cmp::Ordering::Equal => None,
            std::cmp::Ordering::Greater => Some((true, (self.pieces() - 1 - primitive) as usize)),
        }
    }

    pub(super) fn borders(&self, origin: DVec3, direction: DVec3, standing: Option<u32>) -> Borders {
        let (origin, direction) = (self.axis.turned_to_z(origin), self.axis.turned_to_z(direction));
        // Seen from the point next to the middle the numbers are as small as the solid; a ray on its surface is there.
        let moved = if standing.is_some() { 0.0 } else { -origin.dot(direction) };
        let line = Line::new(origin + moved * direction, direction);
        let mut borders = Borders::new();
        let Some(span) = line.within(self.radius, standing == Some(self.edge())) else { return borders };
        let lower = self.changes(&line, span, false, standing);
        let upper = self.changes(&line, span, true, standing);
        let (mut above, mut below) = (lower.above, !upper.above);
        let mut add = |at: f64, primitive: u32, leaving: bool| {
            borders.push(Border { distance: at + moved, primitive, leaving });
        };
        if above && below {
            add(span[0], self.edge(), false);
        }
        let (mut low, mut high) = (lower.as_slice(), upper.as_slice());
        loop {
            let was_inside = above && below;
            let is_low = match (low.first(), high.first()) {
                (Some(l), Some(h)) => l.at <= h.at,
                (l, _) => l.is_some(),
            };
            let changes = if is_low { &mut low } else { &mut high };
            let Some((&change, rest)) = changes.split_first() else { break };
            *changes = rest;
            if is_low {
                above = !above;
            } else {
                below = !below;
            }
            if (above && below) != was_inside {
                add(change.at, change.primitive, was_inside);
            }
        }
        if above && below {
            add(span[1], self.edge(), true);
        }
        borders
    }

    /// How far a ray that starts on the piece runs to meet it again; 0 if it does not.
    pub(super) fn chord(&self, origin: DVec3, direction: DVec3, primitive: u32) -> f64 {
        let line = Line::new(self.axis.turned_to_z(origin), self.axis.turned_to_z(direction));
        let end = match self.section(primitive) {
            None => line.within(self.radius, true).map(|ends| ends[1]),
            Some((is_upper, i)) => {
                let sections = if is_upper { &self.upper } else { &self.lower };
                sections[i].form.roots(&line, true).map(|roots| roots.at[1])
            }
        };
        end.filter(|t| t.is_finite()).map_or(0.0, |t| t.max(0.0))
    }

    /// Where the line changes its side of a profile within the `span` inside the cylinder.
    fn changes(&self, line: &Line, span: [f64; 2], is_upper: bool, standing: Option<u32>) -> Changes {
        let sections = if is_upper { &self.upper } else { &self.lower };
        let Some(outermost) = sections.last() else { unreachable!("both profiles reach from the axis to the radius") };
        let is_above = |t: f64, rim: f64| line.height(t) > rim;
        let ends = span.map(|t| is_above(t, outermost.rim));
        let mut changes = Changes { items: [Change { at: 0.0, primitive: 0 }; MAX_CHANGES], len: 0, above: ends[0] };
        // Inwards until a circle is not reached, then outwards again.
        let mut outside = (span, ends);
        let mut far = [(span[1], ends[1]); MAX_SECTIONS];
        let mut innermost = sections.len() - 1;
        loop {
            far[innermost] = (outside.0[1], outside.1[1]);
            let inner = innermost.checked_sub(1).map(|i| &sections[i]);
            let cut = inner.and_then(|s| Some((line.within(s.outer, false)?, s.rim)));
            let primitive = self.number(is_upper, innermost);
            let is_standing = standing == Some(primitive);
            let mut found = |at: f64| changes.push(Change { at, primitive });
            let Some((cut, rim)) = cut else {
                sections[innermost].changes(line, outside.0, outside.1, is_standing, &mut found);
                break;
            };
            let cut = cut.map(|t| t.clamp(outside.0[0], outside.0[1]));
            let above = cut.map(|t| is_above(t, rim));
            let way_in = ([outside.0[0], cut[0]], [outside.1[0], above[0]]);
            sections[innermost].changes(line, way_in.0, way_in.1, is_standing, &mut found);
            outside = (cut, above);
            innermost -= 1;
        }
        for i in innermost + 1..sections.len() {
            let (from, to) = (far[i - 1], far[i]);
            let primitive = self.number(is_upper, i);
            let mut found = |at: f64| changes.push(Change { at, primitive });
            sections[i].changes(line, [from.0, to.0], [from.1, to.1], standing == Some(primitive), &mut found);
        }
        changes
    }

    pub(super) fn piece(&self, primitive: u32, p: DVec3) -> Piece {
        let p = self.axis.turned_to_z(p);
        let (value, gradient, bend) = match self.section(primitive) {
            // Inside is above the lower profile, where Q < 0, and below the upper one.
            Some((false, i)) => self.lower[i].form.equation(p),
            Some((true, i)) => {
                let (value, gradient, bend) = self.upper[i].form.equation(p);
                let bend = match bend {
                    Bend::Plane => Bend::Plane,
                    Bend::Sphere(s) => Bend::Sphere(-s),
                    Bend::Quadric(hessian) => Bend::Quadric(-hessian),
                    Bend::Revolved { radial, around, second, third } => {
                        Bend::Revolved { radial, around, second: second.map(|x| -x), third: third.map(|x| -x) }
                    }
                };
                (-value, -gradient, bend)
            }
            None => {
                let r = p.truncate().length();
                let hessian = DMat3::from_diagonal(DVec3::new(2.0, 2.0, 0.0));
                let gradient = DVec3::new(2.0 * p.x, 2.0 * p.y, 0.0);
                ((r - self.radius) * (r + self.radius), gradient, Bend::Quadric(hessian))
            }
        };
        let bend = match bend {
            Bend::Quadric(h) => {
                let turn = |v: DVec3| self.axis.turned_back(v);
                let basis = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| turn(h * self.axis.turned_to_z(e)));
                Bend::Quadric(DMat3::from_cols(basis[0], basis[1], basis[2]))
            }
            Bend::Revolved { radial, around, second, third } => Bend::Revolved {
                radial: self.axis.turned_back(radial),
                around: self.axis.turned_back(around),
                second,
                third,
            },
            other @ (Bend::Plane | Bend::Sphere(_)) => other,
        };
        Piece { value, gradient: self.axis.turned_back(gradient), bend }
    }

    /// The normal at the tip of a cone, which has none: along the axis.
    pub(super) fn tip_normal(&self, primitive: u32) -> DVec3 {
        let is_upper = self.section(primitive).is_some_and(|(is_upper, _)| is_upper);
        self.axis.turned_back(if is_upper { DVec3::Z } else { DVec3::NEG_Z })
    }

    /// Whether the piece is where `p` is, up to `error`, if its surface passes there.
    pub(super) fn covers(&self, primitive: u32, p: DVec3, error: f64) -> bool {
        let p = self.axis.turned_to_z(p);
        let r = p.truncate().length();
        match self.section(primitive) {
            Some((is_upper, i)) => {
                let sections = if is_upper { &self.upper } else { &self.lower };
                let inner = i.checked_sub(1).map_or(0.0, |i| sections[i].outer);
                // The other sheet of a sphere or a cone is far from the profile's.
                let height = sections[i].form.height(r.clamp(inner, sections[i].outer));
                let size = self.radius.max(sections[i].outer);
                r >= inner - error
                    && r <= sections[i].outer + error
                    && (p.z - height).abs() <= size * HALF_DIGITS + error
            }
            None => {
                let rim = |sections: &[Section]| sections.last().map_or(0.0, |s| s.rim);
                p.z >= rim(&self.lower) - error && p.z <= rim(&self.upper) + error
            }
        }
    }
}

/// Changes of side along one line at most.
const MAX_CHANGES: usize = 16;
/// Radii at which the faces of a lens are compared.
const GAPS: i32 = 1024;
/// Sections of one profile at most.
const MAX_SECTIONS: usize = 3;
/// A sphere's height at its equator answers an error of its radius with the square root: half of the digits.
const HALF_DIGITS: f64 = 1.0 / 16_777_216.0;

impl Changes {
    fn push(&mut self, change: Change) {
        // Two changes for each of five stretches, and a few more for an asphere that waves.
        if let Some(item) = self.items.get_mut(self.len) {
            *item = change;
            self.len += 1;
        }
    }

    fn as_slice(&self) -> &[Change] {
        &self.items[..self.len]
    }
}
