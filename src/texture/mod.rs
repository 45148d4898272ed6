//! Textures: image files, looked up and computed with.
//!
//! A [`Program`] is a material's input where it is not one value: texture coordinates and other primvars, images, and the
//! arithmetic between them, compiled from a shading network by `scene::material`. A [`Store`] has the images.

pub mod color_space;
mod decode;
mod graph;
mod sample;
mod store;

pub use color_space::ColorSpace;
pub use graph::{Builder, Bundle, Function, MAX_OPERATIONS, MAX_RESULTS, Program, Register, TooLarge};
pub use sample::{Images, Lookup, Wrap};
pub use store::{DEFAULT_BUDGET, Source, Store, TextureCounts, Unreadable};
