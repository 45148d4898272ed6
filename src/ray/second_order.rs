//! Second derivatives along any direction in (x, y, λ), by replaying a chain without casting a ray (MATH.md 2.5).

use glam::DVec3;

use super::column::{Column, RayStart, SecondOrderColumn};
use super::scatter::Scattering;
use super::transfer::Transfer;
use crate::optics::IorJet;

/// One entry in the log of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The way to the surface.
    pub transfer: Transfer,
    /// What happened there; `None` only at the end of the chain.
    pub scattering: Option<Scattering>,
}

/// The state's first and second derivatives along one direction s: ∂/∂u and ∂²/∂u² of the chain that starts at pixel
/// (x + s_x u, y + s_y u) with the wavelength λ + s_λ u.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SecondOrder {
    /// ∂p/∂u.
    pub point: DVec3,
    /// ∂K/∂u.
    pub momentum: DVec3,
    /// ∂²p/∂u².
    pub point2: DVec3,
    /// ∂²K/∂u².
    pub momentum2: DVec3,
}

/// Follows one column and its second derivative along `s` = (x, y, λ) through the logged `steps`.
///
/// With s = (x_λ, y_λ, 1) the first derivative of the end point vanishes and −J⁺ p_ss = (x_λλ, y_λλ).
pub fn second_order_along(start: &RayStart, medium: &IorJet, s: DVec3, steps: &[Step]) -> SecondOrder {
    // Along the direction the wavelength moves at the rate s_λ; everything else of the chain is as logged.
    let rate = s.z;
    let medium = medium.along(rate);
    let d = start.direction;
    let d1 = start.direction_x * s.x + start.direction_y * s.y;
    let d2 =
        start.direction_xx * (s.x * s.x) + start.direction_xy * (2.0 * s.x * s.y) + start.direction_yy * (s.y * s.y);
    let mut column = SecondOrderColumn {
        first: Column {
            point: start.point_x * s.x + start.point_y * s.y,
            momentum: d1 * medium.ior + d * medium.dior_dlambda,
        },
        second: Column {
            point: DVec3::ZERO,
            momentum: d2 * medium.ior + d1 * (2.0 * medium.dior_dlambda) + d * medium.d2ior_dlambda2,
        },
    };
    for step in steps {
        column.transfer(&Transfer { medium: step.transfer.medium.along(rate), ..step.transfer });
        if let Some(scattering) = &step.scattering {
            column.scatter(&scattering.along(rate));
        }
    }
    SecondOrder {
        point: column.first.point,
        momentum: column.first.momentum,
        point2: column.second.point,
        momentum2: column.second.momentum,
    }
}
