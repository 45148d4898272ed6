//! `abbe` renders scenes with dispersive glass and tells how everything it sees moves with wavelength.
//!
//! The core carries *spectral ray differentials* (Elek et al. 2014): the derivatives of a ray's position and optical
//! momentum K = n(λ)·d with respect to the screen and the wavelength, through every refraction and reflection. It has
//! never heard of USD, Python or files in any layer above [`exr`] and [`scene::file`].
//!
//! Conventions: wavelengths are in nanometres and have a type ([`spectrum::Wavelength`]); lengths are in stage units;
//! geometry, momenta and derivatives are `f64`, authored points stay `f32` in object space; pixel vectors are +x right,
//! +y up; image rows run down.
//!
//! | layer | what it knows |
//! |---|---|
//! | [`math`], [`error`], [`diagnostics`], `atomic` | compensated arithmetic; errors; structured warnings; files whole or not at all |
//! | [`spectrum`] | wavelengths, lines, responses, colours made spectra |
//! | [`optics`] | n(λ) and its derivatives, absorption, media and their priorities |
//! | [`ray`] | columns, transfer, scattering, footprint, chromatic motion: the calculus |
//! | [`geometry`] | shapes, instances, trees, hits |
//! | [`bsdf`] | how surfaces scatter light |
//! | [`light`] | what shines: shapes, spectra, profiles |
//! | [`texture`] | images, colour spaces, what is computed of them |
//! | [`camera`], [`sampler`] | where rays begin |
//! | [`scene`] | the description, its checks, the compiled scene |
//! | [`lighting`] | the lights of a view: choosing one, a point of it, what a ray meets of them |
//! | [`film`] | the AOV table, layers, sums independent of grouping |
//! | [`integrator`] | what is computed for a pixel; the plug-in point |
//! | [`render`] | settings, plan, tiles, progress, statistics |
//! | [`exr`] | multichannel files |
//! | [`compare`] | ways to get a derivative, measured side by side |
//!
//! Imports go down this table only from its bottom up: a layer knows those above it (`tests/architecture.rs`).

mod atomic;
pub mod bsdf;
pub mod camera;
pub mod compare;
pub mod diagnostics;
pub mod error;
pub mod exr;
pub mod film;
pub mod geometry;
pub mod integrator;
pub mod light;
pub mod lighting;
pub mod math;
pub mod optics;
pub mod ray;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod spectrum;
pub mod texture;

pub use error::{Error, Result};
