//! What a surface is made of, at the wavelengths of a path.

use crate::spectrum::SampledSpectrum;

/// What a surface is made of at a point, after OpenPBR: a coat over a base that is metal, opaque dielectric or
/// transmissive dielectric, with sheen on top. Everything is already at the path's wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters<const N: usize> {
    /// Albedo of the diffuse base, its weight included.
    pub base_color: SampledSpectrum<N>,
    /// Roughness of the diffuse base, 0 Lambert to 1 (Oren–Nayar family).
    pub diffuse_roughness: f32,
    /// Share of the base that is metal, 0..=1.
    pub metalness: f32,
    /// What the metal reflects.
    pub metal: Metal<N>,
    /// Factor of the dielectric's reflectance at normal incidence, 0..=1 and beyond, by way of its index as OpenPBR has it; 1 where
    /// the index of `interface` was changed for it already, as it is for what transmits. 0: no interface.
    pub specular_weight: f32,
    /// Tint of the dielectric's specular reflection.
    pub specular_color: SampledSpectrum<N>,
    /// GGX α along the tangent and across it; below [`SMOOTH_ALPHA`] the interface is smooth.
    pub alpha: [f32; 2],
    /// Indices on the side of `wo` and on the other side, at every wavelength, of the dielectric base.
    pub interface: Interface<N>,
    /// Share of the dielectric base that transmits, 0..=1.
    pub transmission: f32,
    /// Tint of what is transmitted at the surface.
    pub transmission_tint: SampledSpectrum<N>,
    /// The surface is a wall of its own: light passes straight, and is reflected between its faces.
    pub thin_walled: bool,
    /// Clear coat.
    pub coat: Option<Coat<N>>,
    /// Sheen on top of everything.
    pub sheen: Option<Sheen<N>>,
    /// Film on the base's interface.
    pub film: Option<Film<N>>,
    /// Albedo with which the opaque base transmits diffusely, beside `base_color`; with it their sum should not exceed 1.
    pub diffuse_transmission: SampledSpectrum<N>,
    /// Where given, the dielectric over an opaque base reflects by Schlick's law from this reflectance at normal incidence
    /// to white at grazing, in place of Fresnel's law (UsdPreviewSurface, glTF).
    pub schlick_f0: Option<SampledSpectrum<N>>,
}

impl<const N: usize> Default for Parameters<N> {
    /// Grey Lambert: albedo ½, nothing specular.
    fn default() -> Self {
        Self {
            base_color: SampledSpectrum::splat(0.5),
            diffuse_roughness: 0.0,
            metalness: 0.0,
            metal: Metal::Tint { f0: SampledSpectrum::ONE, f82: SampledSpectrum::ONE },
            specular_weight: 0.0,
            specular_color: SampledSpectrum::ONE,
            alpha: [0.0; 2],
            interface: Interface { ior_i: SampledSpectrum::ONE, ior_t: SampledSpectrum::splat(1.5) },
            transmission: 0.0,
            transmission_tint: SampledSpectrum::ONE,
            thin_walled: false,
            coat: None,
            sheen: None,
            film: None,
            diffuse_transmission: SampledSpectrum::ZERO,
            schlick_f0: None,
        }
    }
}

impl<const N: usize> Parameters<N> {
    /// Lambert of this albedo.
    pub fn diffuse(color: SampledSpectrum<N>) -> Self {
        Self { base_color: color, ..Self::default() }
    }

    /// Lambert of this albedo under a dielectric interface.
    pub fn plastic(color: SampledSpectrum<N>, interface: Interface<N>, alpha: f32) -> Self {
        Self { base_color: color, specular_weight: 1.0, interface, alpha: [alpha; 2], ..Self::default() }
    }

    /// A dielectric interface that light passes.
    pub fn glass(interface: Interface<N>, alpha: f32) -> Self {
        Self { transmission: 1.0, specular_weight: 1.0, interface, alpha: [alpha; 2], ..Self::default() }
    }

    /// A metal.
    pub fn metal(metal: Metal<N>, alpha: f32) -> Self {
        Self { metalness: 1.0, metal, specular_weight: 1.0, alpha: [alpha; 2], ..Self::default() }
    }
}

/// What a metal reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metal<const N: usize> {
    /// By its complex index n + ik.
    Index {
        /// n
        n: SampledSpectrum<N>,
        /// k
        k: SampledSpectrum<N>,
    },
    /// By its reflectance at normal incidence and the tint at 82° (generalised Schlick of OpenPBR: "F82-tint").
    Tint {
        /// Reflectance at normal incidence.
        f0: SampledSpectrum<N>,
        /// Multiplies Schlick's reflectance near 82°; 1 is Schlick.
        f82: SampledSpectrum<N>,
    },
    /// The same at every angle (UsdPreviewSurface: F0 = F90).
    Constant {
        /// Reflectance.
        f0: SampledSpectrum<N>,
    },
}

/// The indices of two media that meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface<const N: usize> {
    /// On the side of `wo`.
    pub ior_i: SampledSpectrum<N>,
    /// On the other side.
    pub ior_t: SampledSpectrum<N>,
}

/// A clear coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat<const N: usize> {
    /// How much of the surface it covers, 0..=1.
    pub weight: f32,
    /// Transmittance of its colour for light that goes in and out at normal incidence.
    pub color: SampledSpectrum<N>,
    /// Its index.
    pub ior: f32,
    /// GGX α along the tangent and across it.
    pub alpha: [f32; 2],
    /// Share of the darkening by light reflected between coat and base that is shown, 0..=1 (OpenPBR; 1 is physical).
    pub darkening: f32,
}

impl<const N: usize> Default for Coat<N> {
    /// Smooth, clear and complete, of index 1.5.
    fn default() -> Self {
        Self { weight: 1.0, color: SampledSpectrum::ONE, ior: 1.5, alpha: [0.0; 2], darkening: 1.0 }
    }
}

/// Sheen: fibres over everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen<const N: usize> {
    /// 0..=1.
    pub weight: f32,
    /// Its colour.
    pub color: SampledSpectrum<N>,
    /// 0..=1.
    pub roughness: f32,
}

/// A thin film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film<const N: usize> {
    /// Share of the surface that has it, 0..=1.
    pub weight: f32,
    /// Thickness, nm.
    pub thickness_nm: f32,
    /// Its index.
    pub ior: f32,
    /// The wavelengths at which the light interferes, nm: those of the path.
    pub nanometers: SampledSpectrum<N>,
}

/// A GGX lobe narrower than this is treated as smooth: the next number after α = 0.03², so that a roughness of
/// `scene::material::SMOOTH_ROUGHNESS` itself is smooth, as it is for the specular chain.
pub const SMOOTH_ALPHA: f32 = f32::from_bits(0.0009_f32.to_bits() + 1);
