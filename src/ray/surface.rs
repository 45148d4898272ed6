//! The surface around a hit, to second order.

use glam::{DMat3, DVec3};

/// How the geometric surface bends: what κ = n_g·q'' it forces on a point q that moves on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curvature {
    /// κ = 0.
    Plane,
    /// κ = −|q'|²·inv_radius, n_g outward.
    Sphere {
        /// 1 / radius.
        inv_radius: f64,
    },
    /// κ = −q'ᵀ·hessian·q'.
    Quadric {
        /// H/|∇f| with ∇f along n_g.
        hessian: DMat3,
    },
}

/// How the shading normal varies over the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalField {
    /// N' = 0.
    Flat,
    /// N' = q'·inv_radius.
    Sphere {
        /// 1 / radius.
        inv_radius: f64,
    },
    /// N = S/|S| with S' = gradient·q'.
    Linear {
        /// S.
        vector: DVec3,
        /// ∂S/∂q.
        gradient: DMat3,
    },
}

/// The surface around a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalSurface {
    /// Geometric unit normal, outward as authored.
    pub n_g: DVec3,
    /// Shading unit normal, n_s·n_g > 0.
    pub n_s: DVec3,
    /// Of the geometric surface.
    pub curvature: Curvature,
    /// Of the shading normal.
    pub field: NormalField,
}
