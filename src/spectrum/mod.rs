//! Wavelengths, spectral lines, responses.
