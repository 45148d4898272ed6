//! Refractive indices with their wavelength derivatives, and the media a ray is in.
