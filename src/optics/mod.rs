//! Refractive indices with their wavelength derivatives, absorption, and the media a ray is in.
//!
//! Indices are relative to air, as catalogues state them: outside of every medium n = 1.
//! An index is an `ior`; `_i` is the side of the incident ray, `_t` the other one. Cosines at an interface are those of the
//! acute angles (positive) wherever they have a name; in momentum form g = K·N is negative because the normal faces the ray.

pub mod absorption;
pub mod catalog;
pub mod dispersion;
pub mod media;
pub mod reflectance;

pub use absorption::{Absorption, Extinction};
pub use dispersion::Dispersion;

/// A refractive index at one wavelength with its first two derivatives by wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IorJet {
    /// n(λ).
    pub ior: f64,
    /// ∂n/∂λ in 1/nm.
    pub dior_dlambda: f64,
    /// ∂²n/∂λ² in 1/nm².
    pub d2ior_dlambda2: f64,
}

impl IorJet {
    /// Outside of every medium.
    pub const VACUUM: Self = Self::constant(1.0);

    /// An index that does not depend on wavelength.
    pub const fn constant(ior: f64) -> Self {
        Self { ior, dior_dlambda: 0.0, d2ior_dlambda2: 0.0 }
    }

    /// Whether both derivatives vanish.
    pub fn is_constant(&self) -> bool {
        self.dior_dlambda == 0.0 && self.d2ior_dlambda2 == 0.0
    }

    /// The derivatives by a parameter u with ∂λ/∂u = `rate` nm (and ∂²λ/∂u² = 0).
    pub fn along(&self, rate: f64) -> Self {
        Self {
            ior: self.ior,
            dior_dlambda: rate * self.dior_dlambda,
            d2ior_dlambda2: rate * rate * self.d2ior_dlambda2,
        }
    }
}
