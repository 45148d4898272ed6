//! The calculus: how a ray moves with the screen and with the wavelength.

mod surface;

pub use surface::{Curvature, LocalSurface, NormalField};
