//! From one surface to the next (MATH.md 2.4).
//!
//! The geometric normal stands here, never the shading normal: the point moves on the surface as it is.

use glam::DVec3;

use super::column::Column;
use super::surface::Curvature;
use crate::optics::IorJet;

/// A straight segment of a ray, up to a point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transfer {
    /// Its length t ≥ 0; 0 between coincident surfaces, where the motion is only projected anew.
    pub distance: f64,
    /// Unit direction d.
    pub direction: DVec3,
    /// What the segment runs through.
    pub medium: IorJet,
    /// Geometric unit normal of the surface reached, either sign (with the curvature's). n_g·d = 0 is no hit.
    pub n_g: DVec3,
    /// Of the surface reached.
    pub curvature: Curvature,
}

/// A transfer with what its columns share.
pub(super) struct Segment<'a> {
    t: &'a Transfer,
    inv_ior: f64,
    /// 1/(n_g·d).
    inv_cos: f64,
}

/// A column after a transfer, with what its second derivative needs of the way there.
pub(super) struct Transferred {
    /// d'.
    ddirection: DVec3,
    /// t'.
    pub(super) ddistance: f64,
    /// q' and K'.
    pub(super) column: Column,
}

impl<'a> Segment<'a> {
    #[inline(always)]
    pub(super) fn new(t: &'a Transfer) -> Self {
        Self { t, inv_ior: 1.0 / t.medium.ior, inv_cos: 1.0 / t.n_g.dot(t.direction) }
    }

    /// q' = v + t' d with v = p' + t d', t' = −(n_g·v)/(n_g·d). `LAMBDA`: the parameter moves the wavelength, so that n'
    /// takes part in d' = (K' − n' d)/n.
    #[inline(always)]
    pub(super) fn first<const LAMBDA: bool>(&self, column: &Column) -> Transferred {
        let t = self.t;
        let momentum_across =
            if LAMBDA { column.momentum - t.direction * t.medium.dior_dlambda } else { column.momentum };
        let ddirection = momentum_across * self.inv_ior;
        let v = column.point + ddirection * t.distance;
        let ddistance = -t.n_g.dot(v) * self.inv_cos;
        Transferred {
            ddirection,
            ddistance,
            column: Column { point: v + t.direction * ddistance, momentum: column.momentum },
        }
    }

    /// q'' = w + t'' d with w = p'' + t d'' + 2t' d', t'' = (κ − n_g·w)/(n_g·d), where κ = n_g·q'' is the surface's.
    #[inline(always)]
    pub(super) fn second(&self, first: &Transferred, second: &Column) -> Column {
        let t = self.t;
        let d2direction = (second.momentum
            - t.direction * t.medium.d2ior_dlambda2
            - first.ddirection * (2.0 * t.medium.dior_dlambda))
            * self.inv_ior;
        let w = second.point + d2direction * t.distance + first.ddirection * (2.0 * first.ddistance);
        let kappa = t.curvature.normal_acceleration(first.column.point);
        let d2distance = (kappa - t.n_g.dot(w)) * self.inv_cos;
        Column { point: w + t.direction * d2distance, momentum: second.momentum }
    }
}
