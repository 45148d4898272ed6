//! Laws that every scattering model keeps.

mod fresnel;
mod furnace;
mod laws;
mod microfacet;
mod sampling;
mod smooth;
mod support;
