//! Laws that every scattering model keeps.

mod furnace;
mod support;
