//! What light has to know of a surface at a hit, short for the surfaces that most scenes are made of.

use super::{Found, Index, Number, Surface, SurfaceAt, Tint};
use crate::bsdf::{Bsdf, Interface, SMOOTH_ALPHA};
use crate::spectrum::{SampledSpectrum, Wavelengths};

/// Surfaces that most scenes are made of: constant and there all over, without layers, with a normal and no direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plain {
    /// Diffuse and nothing else, where the medium before it has the index `matched`, if there is one to match.
    Diffuse { color: Tint, roughness: f32, matched: Option<f32> },
    /// The smooth interface of two media.
    Clear { color: Tint, tint: Tint },
}

/// What a surface is at a hit, to light.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "lives on the stack of one path vertex; a box would allocate per hit")]
pub enum Finish<const N: usize> {
    /// Diffuse, of this albedo and roughness.
    Diffuse(SampledSpectrum<N>, f32),
    /// The smooth interface of two media, with the tints of what it reflects and what it transmits.
    Clear(Interface<N>, [SampledSpectrum<N>; 2]),
    /// Anything.
    Other(SurfaceAt<N>),
}

impl<const N: usize> Finish<N> {
    /// Share of the surface that is there.
    #[inline]
    pub fn presence(&self) -> f32 {
        match self {
            Self::Diffuse(..) | Self::Clear(..) => 1.0,
            Self::Other(at) => at.presence,
        }
    }

    /// Whether light comes from behind.
    #[inline]
    pub fn transmits(&self) -> bool {
        match self {
            Self::Diffuse(..) => false,
            Self::Clear(..) => true,
            Self::Other(at) => at.transmits(),
        }
    }

    /// How it scatters.
    #[inline]
    pub fn bsdf(&self) -> Bsdf<N> {
        match self {
            Self::Diffuse(color, roughness) => Bsdf::diffuse(*color, *roughness),
            Self::Clear(interface, [color, tint]) => Bsdf::clear(interface, *color, *tint),
            Self::Other(at) => Bsdf::new(&at.parameters),
        }
    }

    /// As [`SurfaceAt::directed`].
    #[inline]
    pub fn directed(&self) -> Option<&SurfaceAt<N>> {
        match self {
            Self::Other(at) => at.directed(),
            Self::Diffuse(..) | Self::Clear(..) => None,
        }
    }
}

impl Surface {
    /// The short way of a surface of which nothing is looked up.
    #[allow(clippy::float_cmp, reason = "isotropic materials have the same number twice")]
    pub(super) fn plainly(&self) -> Option<Plain> {
        let at = |number: &Number| number.at(&[]);
        let is_bare = self.coat.is_none() && self.sheen.is_none() && self.film.is_none() && self.schlick_f0.is_none();
        let [along, across] = self.alpha.each_ref().map(at);
        if !is_bare || !self.is_present() || self.normal.is_some() || along != across || !self.metalness.is_zero() {
            return None;
        }
        if self.transmission.is_zero() && self.diffuse_transmission == Tint::Black {
            let matched = match &self.index {
                _ if self.specular_weight.is_zero() => None,
                // Without an interface by an index that is that of the vacuum, as OpenPBR has it.
                Index::Own(index) if at(index) == 1.0 => Some(1.0),
                _ => return None,
            };
            return Some(Plain::Diffuse { color: self.base_color, roughness: at(&self.diffuse_roughness), matched });
        }
        let is_clear = at(&self.transmission) >= 1.0 && along < SMOOTH_ALPHA && !self.thin_walled;
        let has_index = matches!(self.index, Index::Media) && at(&self.specular_weight) == 1.0;
        (is_clear && has_index).then_some(Plain::Clear { color: self.specular_color, tint: self.transmission_tint })
    }

    /// What it is to light at a hit: `other` says it of what is not short to say.
    #[inline]
    pub(in crate::scene) fn finish<const N: usize>(
        &self,
        wavelengths: &Wavelengths<N>,
        interface: Interface<N>,
        other: impl FnOnce() -> SurfaceAt<N>,
    ) -> Finish<N> {
        let found = Found { results: &[], reflectance: self.reflectance.as_ref() };
        let tint = |tint: &Tint| tint.at(found, wavelengths);
        match &self.plain {
            Some(Plain::Diffuse { color, roughness, matched })
                if matched.is_none_or(|index| interface.ior_i == SampledSpectrum::splat(index)) =>
            {
                Finish::Diffuse(tint(color), *roughness)
            }
            Some(Plain::Clear { color, tint: through }) => Finish::Clear(interface, [tint(color), tint(through)]),
            _ => Finish::Other(other()),
        }
    }
}
