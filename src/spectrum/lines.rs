//! Fraunhofer and spectral lines at which glass catalogues state indices.
//!
//! Values in air as printed by the glass makers (SCHOTT, Technical Information TIE-29 "Refractive index and dispersion",
//! table of spectral lines; the same in the catalogues of Ohara and Hoya). A primed letter is the line of ISO 7944 for the
//! e line's Abbe number. Lower- and upper-case letters differ in the literature (`D` there is the sodium doublet); here the
//! constants are upper case by convention of the language and `D` is the helium d line.

use super::Wavelength;

/// i, mercury.
pub const I: Wavelength = Wavelength::from_nanometers(365.0146);
/// h, mercury.
pub const H: Wavelength = Wavelength::from_nanometers(404.6561);
/// g, mercury.
pub const G: Wavelength = Wavelength::from_nanometers(435.8343);
/// F', cadmium.
pub const F_PRIME: Wavelength = Wavelength::from_nanometers(479.9914);
/// F, hydrogen.
pub const F: Wavelength = Wavelength::from_nanometers(486.1327);
/// e, mercury.
pub const E: Wavelength = Wavelength::from_nanometers(546.0740);
/// d, helium: the line of n_d and V_d.
pub const D: Wavelength = Wavelength::from_nanometers(587.5618);
/// C', cadmium.
pub const C_PRIME: Wavelength = Wavelength::from_nanometers(643.8469);
/// C, hydrogen.
pub const C: Wavelength = Wavelength::from_nanometers(656.2725);
/// r, helium.
pub const R: Wavelength = Wavelength::from_nanometers(706.5188);
/// s, caesium.
pub const S: Wavelength = Wavelength::from_nanometers(852.11);
