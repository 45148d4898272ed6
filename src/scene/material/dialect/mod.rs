//! What a surface shader says, dialect by dialect, in one vocabulary: does light pass, with which index, Abbe number,
//! absorption and priority.
//!
//! A dialect is one file. It lists the inputs that it reads with the defaults of its node definition, and has that
//! definition's formulas; what several share is in `layered`. An input that is declared without a value, or is not
//! there, has the default; so does one that is driven by a network, with a warning. `docs/materials.md` is the table
//! of all of them, and a test compares the two.

mod abbe_glass;
mod disney_principled;
mod gltf_pbr;
mod inputs;
mod lama_dielectric;
mod layered;
mod mdl_glass;
mod moonray;
mod omni_glass;
mod omni_surface;
mod open_pbr;
mod preview_surface;
mod pxr_surface;
mod standard_surface;
#[cfg(test)]
mod tests;
mod vocabulary;
mod vray_mtl;

use std::collections::BTreeSet;

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;
use crate::scene::description::Shader;

use super::Context;
use super::appearance::OpacityInput;
use super::painter::{Painted, Painter};
use super::surface::Layers;
#[cfg(test)]
use inputs::Declared;
use inputs::Inputs;
pub(super) use vocabulary::{Attenuation, Glass, Response};

/// A shading model.
trait Dialect: Sync {
    /// The shader identifiers that it understands.
    fn ids(&self) -> &'static [&'static str];

    /// Every input that it reads, to compare with the documentation.
    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared];

    /// Every other input that light transport reads.
    #[cfg(test)]
    fn transported(&self) -> &'static [Declared];

    /// What the surface does to light.
    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response>;

    /// What the surface is made of.
    fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers>;

    /// The index and dispersion of a transmissive surface.
    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass>;

    /// The input that says where the surface is there, if that is looked up from point to point.
    fn opacity(&self, _: &Inputs<'_>, _: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        Ok(None)
    }

    /// How the inside absorbs; `None` where it does not, or where the model colours the surface alone.
    fn attenuation(&self, _: &Inputs<'_>, _: &Context, _: &mut Diagnostics) -> Result<Option<Attenuation>> {
        Ok(None)
    }

    /// The dielectric priority and where it stands; `None` where none is set.
    fn priority(&self, _: &Inputs<'_>) -> Result<Option<(Priority, String)>> {
        Ok(None)
    }
}

const DIALECTS: &[&dyn Dialect] = &[
    &abbe_glass::AbbeGlass,
    &open_pbr::OpenPbr,
    &preview_surface::PreviewSurface,
    &standard_surface::StandardSurface,
    &gltf_pbr::GltfPbr,
    &moonray::DwaRefractive,
    &moonray::DwaBase,
    &omni_glass::OmniGlass,
    &omni_surface::OmniSurface,
    &mdl_glass::ThickGlass,
    &mdl_glass::ThinGlass,
    &vray_mtl::VRayMtl,
    &disney_principled::DisneyPrincipled,
    &lama_dielectric::LamaDielectric,
    &pxr_surface::PxrSurface,
];

/// Every shader identifier that is understood.
#[cfg(test)]
pub(super) fn every_id() -> impl Iterator<Item = &'static str> {
    DIALECTS.iter().flat_map(|dialect| dialect.ids()).copied()
}

/// A shader whose dialect is understood.
pub(super) struct Terminal<'a> {
    dialect: &'static dyn Dialect,
    inputs: Inputs<'a>,
}

impl<'a> Terminal<'a> {
    /// `None` if the shader's identifier is unknown.
    pub(super) fn of(shader: &'a Shader) -> Option<Self> {
        let dialect = DIALECTS.iter().find(|dialect| dialect.ids().contains(&shader.id.as_str()))?;
        Some(Self { dialect: *dialect, inputs: Inputs::new(shader) })
    }

    /// Says which driven inputs can be looked up where a ray meets the surface.
    pub(super) fn look_up(&mut self, can: impl Fn(&str) -> bool) {
        self.inputs.look_up(can);
    }

    /// The input that says where the surface is there, if that is looked up from point to point.
    pub(super) fn opacity(&self, diagnostics: &mut Diagnostics) -> Result<Option<OpacityInput>> {
        self.dialect.opacity(&self.inputs, diagnostics)
    }

    /// Driven inputs whose default was used, with a warning.
    pub(super) fn defaulted(&self) -> BTreeSet<String> {
        self.inputs.defaulted()
    }

    /// What the surface is made of.
    pub(super) fn layers(&self, p: &mut Painter<'_, '_, '_>) -> Painted<Layers> {
        self.dialect.layers(p)
    }

    /// The shader itself.
    pub(super) fn shader(&self) -> &'a Shader {
        self.inputs.shader()
    }

    /// What the surface does to light.
    pub(super) fn response(&self, diagnostics: &mut Diagnostics) -> Result<Response> {
        self.dialect.response(&self.inputs, diagnostics)
    }

    /// The index and dispersion of a transmissive surface.
    pub(super) fn glass(&self, diagnostics: &mut Diagnostics) -> Result<Glass> {
        let glass = self.dialect.glass(&self.inputs, diagnostics)?;
        glass.warn_if_suspect(diagnostics);
        Ok(glass)
    }

    /// How the inside absorbs, distances in stage units.
    pub(super) fn attenuation(&self, context: &Context, diagnostics: &mut Diagnostics) -> Result<Option<Attenuation>> {
        self.dialect.attenuation(&self.inputs, context, diagnostics)
    }

    /// The dielectric priority and where it stands; `None` where none is set.
    pub(super) fn priority(&self) -> Result<Option<(Priority, String)>> {
        self.dialect.priority(&self.inputs)
    }
}
