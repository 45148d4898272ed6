//! The calculus in plain terms, one event at a time: unit directions and their derivatives by wavelength.
//!
//! For scripts that trace rays of their own. The inside is the momentum form of the renderer. Directions and normals are
//! unit vectors and their derivatives perpendicular to them; a normal may point to either side. With media of zero
//! derivatives the parameter may be any other than wavelength.

use glam::DVec3;

use super::column::{Column, direction_derivative};
use super::scatter::{ScatterKind, Scattering, interface, mirror, scatter_first};
use super::surface::{Curvature, GivenNormals, LocalSurface, NormalField};
use super::transfer::{Segment, Transfer};
use crate::optics::IorJet;

/// A direction after refraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refracted {
    /// Unit direction.
    pub direction: DVec3,
    /// Its derivative, per nm.
    pub ddirection: DVec3,
    /// Nothing was transmitted: the direction is that of the reflected ray.
    pub total_reflection: bool,
}

/// A direction after reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflected {
    /// Unit direction.
    pub direction: DVec3,
    /// Its derivative, per nm.
    pub ddirection: DVec3,
}

/// A point after a transfer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transferred {
    /// On the surface.
    pub point: DVec3,
    /// Its derivative along the surface, per nm.
    pub dpoint: DVec3,
}

/// Refracts `direction` from a medium `ior_i` into `ior_t`, with `ddirection` and `dnormal` the derivatives before.
pub fn refract(
    direction: DVec3,
    normal: DVec3,
    ior_i: IorJet,
    ior_t: IorJet,
    ddirection: DVec3,
    dnormal: DVec3,
) -> Refracted {
    let sign = if direction.dot(normal) > 0.0 { -1.0 } else { 1.0 };
    let event = interface(direction * ior_i.ior, normal * sign, NormalField::Flat, &ior_i, &ior_t);
    let total_reflection = event.kind == ScatterKind::TotalReflection;
    let medium = if total_reflection { ior_i } else { ior_t };
    let (direction, ddirection) = leave(&event, direction, ddirection, dnormal * sign, &medium);
    Refracted { direction, ddirection, total_reflection }
}

/// Reflects `direction` at `normal`, with `ddirection` and `dnormal` the derivatives before. No medium takes part.
pub fn reflect(direction: DVec3, normal: DVec3, ddirection: DVec3, dnormal: DVec3) -> Reflected {
    let sign = if direction.dot(normal) > 0.0 { -1.0 } else { 1.0 };
    let n = normal * sign;
    let surface = LocalSurface { n_g: n, n_s: n, curvature: Curvature::Plane, field: NormalField::Flat };
    let event = mirror(direction, &surface, &IorJet::VACUUM);
    let (direction, ddirection) = leave(&event, direction, ddirection, dnormal * sign, &IorJet::VACUUM);
    Reflected { direction, ddirection }
}

/// Moves `point` by `distance` along `direction` to a surface with geometric normal `n_g`, on which it then stays when
/// the parameter moves. `None` for a ray that runs along the surface, n_g·d = 0.
pub fn transfer(
    point: DVec3,
    dpoint: DVec3,
    direction: DVec3,
    ddirection: DVec3,
    distance: f64,
    n_g: DVec3,
) -> Option<Transferred> {
    if n_g.dot(direction) == 0.0 {
        return None;
    }
    let t = Transfer { distance, direction, medium: IorJet::VACUUM, n_g, curvature: Curvature::Plane };
    let moved = Segment::new(&t).first::<false>(&Column { point: dpoint, momentum: ddirection });
    Some(Transferred { point: point + direction * distance, dpoint: moved.column.point })
}

/// Unit direction and its derivative after `event`, in `medium`.
fn leave(event: &Scattering, direction: DVec3, ddirection: DVec3, dnormal: DVec3, medium: &IorJet) -> (DVec3, DVec3) {
    let momentum = ddirection * event.ior_i.ior + direction * event.ior_i.dior_dlambda;
    let before = Column { point: DVec3::ZERO, momentum };
    let after = scatter_first::<_, true>(event, &GivenNormals { dnormal }, &before).column;
    let direction = event.momentum_out / medium.ior;
    (direction, direction_derivative(after.momentum, direction, medium.ior, medium.dior_dlambda))
}
