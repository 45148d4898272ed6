//! Wavelengths, spectral lines, the observer, illuminants, colour spaces, colours made spectra.
//!
//! A wavelength is a [`Wavelength`], never a bare number: nanometres inside, micrometres for the dispersion laws.

pub mod blackbody;
pub mod color;
mod fit;
pub mod illuminant;
pub mod lines;
pub mod observer;
pub mod reflectance;
pub mod response;
pub mod sampled;
pub mod sensor;
mod tables;
pub mod uplift;
pub mod visible;
mod wavelength;

pub use sampled::{LANES, SampledSpectrum, Wavelengths};
pub use wavelength::Wavelength;

/// Reference wavelength λ_ref of every AOV unless settings say otherwise: the d line, so that the index there is n_d.
pub const REFERENCE: Wavelength = lines::D;

/// Shortest wavelength of transport and observer; dispersion laws are checked from here.
pub const SHORTEST: Wavelength = Wavelength::from_nanometers(360.0);

/// Longest wavelength of transport and observer; dispersion laws are checked up to here.
pub const LONGEST: Wavelength = Wavelength::from_nanometers(830.0);
