//! What the media along a chain leave of the light: the product of Beer and Lambert's law over its segments.
//!
//! The way is that of the chain, at its own wavelength; the coefficients may be those of any other.

use crate::optics::absorption::optical_depth;
use crate::optics::media::MediumId;
use crate::scene::Scene;
use crate::scene::material::{Kind, Material};
use crate::spectrum::Wavelength;

/// A stretch of a chain from one event to the next: straight, in one medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// What it runs through; `None` outside of everything. Of several media that overlap, the strongest.
    pub medium: Option<MediumId>,
    /// In stage units; infinite where the chain misses.
    pub length: f64,
}

/// The absorption coefficients of all media of a scene at `N` wavelengths.
#[derive(Clone, Debug)]
pub struct Coefficients<const N: usize> {
    /// By medium, per stage unit.
    coefficients: Vec<[f64; N]>,
}

impl<const N: usize> Coefficients<N> {
    /// At `wavelengths`.
    pub fn at(scene: &Scene, wavelengths: [Wavelength; N]) -> Self {
        let of = |material: &Material| match &material.kind {
            Kind::Dielectric { absorption: Some(absorption), .. } => wavelengths.map(|w| absorption.coefficient(w)),
            _ => [0.0; N],
        };
        Self { coefficients: scene.materials.iter().map(of).collect() }
    }

    /// −ln T of `segment`.
    pub fn optical_depth(&self, segment: &Segment) -> [f64; N] {
        let of = |medium: MediumId| self.coefficients[medium.0 as usize].map(|c| optical_depth(c, segment.length));
        segment.medium.map_or([0.0; N], of)
    }

    /// T of `segments` together, each channel in 0..=1.
    pub fn transmittance(&self, segments: &[Segment]) -> [f64; N] {
        let mut depth = [0.0; N];
        for segment in segments {
            for (sum, part) in depth.iter_mut().zip(self.optical_depth(segment)) {
                *sum += part;
            }
        }
        depth.map(|depth| libm::exp(-depth))
    }
}

/// Whether light fades inside of `material`.
pub fn absorbs(material: &Material) -> bool {
    matches!(material.kind, Kind::Dielectric { absorption: Some(_), thin_walled: false, .. })
}
