//! The calculus: how a ray moves with the screen and with the wavelength.
//!
//! A ray is its position p and its optical momentum K = n(λ)·d. What is carried along are their derivatives by pixel x,
//! pixel y and wavelength λ, one [`Column`] each, and optionally the second derivative by λ; which of them is a type, a
//! [`ColumnSet`], so that what is not carried costs nothing. Every event is one linear operator for all columns; the
//! wavelength column alone receives a source, the dispersion of the media.
//!
//! Two kinds of events alternate: a [`Transfer`] to the next surface (with the geometric normal), and a [`Scattering`]
//! there (with the shading normal).
//!
//! Symbols of the formulas below: N unit normal facing the ray, g = K·N (< 0), q = (n₁−n₀)(n₁+n₀), q₁ = n₁n₁'−n₀n₀',
//! q₂ = (n₁'²+n₁n₁'')−(n₀'²+n₀n₀''), W² = q + g², G = q/(W−g); a prime is the derivative by the column's parameter, and n'
//! is zero in the screen columns.
//!
//! References:
//! - O. Elek, P. Bauszat, T. Ritschel, M. Magnor, H.-P. Seidel, "Spectral ray differentials", CGF 33(4), 2014, and its
//!   supplement (the λ column; here in momentum form).
//! - H. Igehy, "Tracing ray differentials", SIGGRAPH 1999 (the screen columns).
//! - M. Born, E. Wolf, *Principles of Optics*, 7th ed. 1999, §3.2.2 (Snell's law as conserved tangential momentum).

pub mod chroma;
mod column;
pub mod footprint;
pub mod invariant;
mod scatter;
mod second_order;
pub mod standalone;
mod surface;
mod transfer;

pub use chroma::screen_motion;
pub use column::{
    Column, ColumnSet, LambdaColumn, NoColumns, RayStart, ScreenColumns, SecondOrderColumns, direction_derivative,
    direction_second_derivative,
};
pub use footprint::{critical_distance, half_width};
pub use scatter::{Deflected, ScatterKind, Scattering, deflect, mirror, refract_or_reflect};
pub use second_order::{SecondOrder, Step, second_order_along};
pub use surface::{Curvature, LocalSurface, NormalField, UnitNormals};
pub use transfer::Transfer;
