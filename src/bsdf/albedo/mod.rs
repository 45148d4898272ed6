//! Directional albedos: what part of the light a rough interface sends back, for any law of reflectance.
//!
//! What is known of an interface as a function of the cosine μ to the normal stands at [`NODES`] cosines, μ = t³ with t evenly
//! spaced (grazing angles need the resolution), and is interpolated by the cubic through four of them: a [`Slice`]. The
//! albedo of a single reflection is linear in the reflectance F of the facets, and what passes a layer above on the way back is
//! linear in its transmittance T. So two matrices per roughness answer for every F and every T:
//!
//! - `facing`: E(μ) = ∫ F(wo·h) G2 D/(4 μ) dω_i = Σ_j facing_j F(μ_j)
//! - `leaving`: H(μ) = ∫ T(μ_i) G2 D/(4 μ) dω_i = Σ_j leaving_j T(μ_j), at F = 1
//!
//! A dielectric of one index, seen from the rarer side, has its E tabulated; so have rough dielectrics of either side what they lose
//! of what they reflect and transmit, and sheen its albedo. All these integrals come from `integrate`, which only tests
//! compile: it wrote `tables.bin`, and a test holds the one to the other. (Scheme of C. Kulla & A. Conty, "Revisiting physically
//! based shading at Imageworks", SIGGRAPH 2017 course.)

#[cfg(test)]
mod integrate;

use std::sync::OnceLock;

use super::Slices;
use super::microfacet::Ggx;
use crate::spectrum::SampledSpectrum;

/// Cosines of a slice.
pub(super) const NODES: usize = 24;
/// Roughnesses of the tables, α = s³ with s evenly spaced from 0 to 1: narrow lobes lose light at μ ~ α.
const ROUGHNESSES: usize = 24;
/// Index ratios of the dielectric tables on each side of 1, x = |η − 1|/(η + 1) = s² [`GREATEST_X`] with s evenly spaced: near
/// η = 1 the light that grazes turns by √x.
const RATIOS: usize = 24;
/// η = 3, and 1/3.
const GREATEST_X: f32 = 0.5;
/// Roughnesses of sheen, evenly spaced from [`SHARPEST_SHEEN`] to 1.
const SHEENS: usize = 24;
/// Roughness of sheen below which the fit of its masking was not made; smaller ones are this.
pub(super) const SHARPEST_SHEEN: f32 = 0.07;

/// A function of the cosine to the normal.
pub(super) type Slice = [f32; NODES];

/// The cosine of a node.
pub(super) fn node(i: usize) -> f32 {
    let t = i as f32 / (NODES - 1) as f32;
    t * t * t
}

/// The nodes about a cosine with their weights: the cubic of Lagrange through four nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct At {
    start: usize,
    weights: [f32; 4],
}

impl At {
    /// For a cosine of 0..=1.
    #[inline]
    pub(super) fn cosine(mu: f32) -> Self {
        Self::position(libm::cbrtf(mu.clamp(0.0, 1.0)) * (NODES - 1) as f32, NODES)
    }

    #[inline]
    fn position(x: f32, nodes: usize) -> Self {
        let start = (x as usize).saturating_sub(1).min(nodes - 4);
        let f = x - start as f32;
        let (a, b, c) = (f - 1.0, f - 2.0, f - 3.0);
        Self { start, weights: [a * b * c / -6.0, f * b * c / 2.0, f * a * c / -2.0, f * a * b / 6.0] }
    }

    /// The value there, of what is nowhere negative.
    #[inline]
    pub(super) fn of(&self, slice: &Slice) -> f32 {
        let values = &slice[self.start..self.start + 4];
        self.weights.iter().zip(values).map(|(w, v)| w * v).sum::<f32>().max(0.0)
    }

    /// The values there, lane by lane.
    #[inline]
    pub(super) fn of_spectra<const N: usize>(&self, slice: &[SampledSpectrum<N>; NODES]) -> SampledSpectrum<N> {
        let mut sum = SampledSpectrum::ZERO;
        for (w, v) in self.weights.iter().zip(&slice[self.start..self.start + 4]) {
            sum += *v * *w;
        }
        sum.map(|value| value.max(0.0))
    }
}

/// 2 ∫ s(μ) μ dμ: the mean over diffuse light.
pub(super) fn mean(slice: &Slice) -> f32 {
    slice.iter().zip(&tables().mean).map(|(s, w)| s * w).sum()
}

/// [`mean`], lane by lane.
pub(super) fn mean_of_spectra<const N: usize>(slice: &[SampledSpectrum<N>; NODES]) -> SampledSpectrum<N> {
    let mut sum = SampledSpectrum::ZERO;
    for (s, w) in slice.iter().zip(&tables().mean) {
        sum += *s * *w;
    }
    sum
}

/// Where a direction looks up what depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Its cosine.
    pub(super) at: At,
    /// Of anisotropic facets, the share of the rougher ones ([`Ggx::share`]).
    pub(super) share: f32,
}

/// A function of the direction, at every wavelength: a slice, or for anisotropic facets two, those of isotropic facets of the lesser and of the
/// greater α, which are mixed by azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Directional<const N: usize> {
    sharper: Slices<N>,
    rougher: Option<Slices<N>>,
}

impl<const N: usize> Directional<N> {
    /// Of what depends on the cosine alone.
    pub(super) fn upright(slices: Slices<N>) -> Self {
        Self { sharper: slices, rougher: None }
    }

    /// Of a function of the roughness.
    pub(super) fn of_facets(ggx: &Ggx, slices: impl Fn(&Roughness) -> Slices<N>) -> Self {
        let [least, greatest] = ggx.extremes();
        let rougher = (!ggx.is_isotropic()).then(|| slices(&Roughness::new(greatest)));
        Self { sharper: slices(&Roughness::new(least)), rougher }
    }

    /// The values in a direction.
    #[inline]
    pub(super) fn at(&self, place: &Place) -> SampledSpectrum<N> {
        let sharper = place.at.of_spectra(&self.sharper);
        match &self.rougher {
            None => sharper,
            Some(rougher) => sharper.lerp(place.at.of_spectra(rougher), place.share),
        }
    }

    /// `f` of the slices.
    pub(super) fn map(&self, f: impl Fn(&Slices<N>) -> Slices<N>) -> Self {
        Self { sharper: f(&self.sharper), rougher: self.rougher.as_ref().map(f) }
    }

    /// The mean over azimuths; `shares` is that of the shares ([`Ggx::shares`]).
    pub(super) fn over_azimuths(&self, shares: &Slice) -> Slices<N> {
        match &self.rougher {
            None => self.sharper,
            Some(rougher) => std::array::from_fn(|i| self.sharper[i].lerp(rougher[i], shares[i])),
        }
    }

    /// The mean over diffuse light.
    pub(super) fn mean(&self, shares: &Slice) -> SampledSpectrum<N> {
        mean_of_spectra(&self.over_azimuths(shares))
    }
}

/// A slice for the index ratio of every lane. Lanes of a glass are near to each other: the two outer ones are made, and between them the
/// slices are interpolated linearly, as long as their ratios differ by less than a quarter of their distance to 1.
pub(super) fn of_lanes<const N: usize>(
    eta: SampledSpectrum<N>,
    slice: impl Fn(f32) -> Slice,
) -> [SampledSpectrum<N>; NODES] {
    let (mut least, mut greatest) = (eta[0], eta[0]);
    for &lane in &eta.0 {
        least = least.min(lane);
        greatest = greatest.max(lane);
    }
    let range = greatest - least;
    if range <= 0.0 {
        return slice(least).map(SampledSpectrum::splat);
    }
    if (least > 1.0 && range < 0.25 * (least - 1.0)) || (greatest < 1.0 && range < 0.25 * (1.0 - greatest)) {
        let (low, high) = (slice(least), slice(greatest));
        let share = eta.map(|eta| (eta - least) / range);
        return std::array::from_fn(|i| share.map(|s| low[i] + s * (high[i] - low[i])));
    }
    let lanes = eta.0.map(slice);
    std::array::from_fn(|i| SampledSpectrum::from_fn(|lane| lanes[lane][i]))
}

/// The rows of the tables about an α, with their weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Roughness(At);

impl Roughness {
    pub(super) fn new(alpha: f32) -> Self {
        Self(At::position(libm::cbrtf(alpha.clamp(0.0, 1.0)) * (ROUGHNESSES - 1) as f32, ROUGHNESSES))
    }

    /// Albedo of a single reflection where every facet reflects everything.
    pub(super) fn white(&self) -> Slice {
        let mut slice = [0.0; NODES];
        self.gather(1.0, &tables().white, &mut slice);
        slice
    }

    /// Albedo of a single reflection where facets reflect (1 − cos)⁵: the other term of Schlick's law.
    pub(super) fn rise(&self) -> Slice {
        let mut slice = [0.0; NODES];
        self.gather(1.0, &tables().rise, &mut slice);
        slice
    }

    /// Albedo of a single reflection by a dielectric of the index ratio η ≥ 1.
    pub(super) fn dielectric(&self, eta_ti: f32) -> Slice {
        self.of_ratio(&tables().dielectric, eta_ti)
    }

    /// What a rough dielectric loses, of light that it would reflect or transmit, to a second encounter with itself.
    pub(super) fn dielectric_loss(&self, eta_ti: f32) -> Slice {
        self.of_ratio(&tables().losses[usize::from(eta_ti < 1.0)], eta_ti)
    }

    /// Albedo of a single reflection where facets reflect `reflectance`, given at the nodes.
    pub(super) fn facing<const N: usize>(
        &self,
        reflectance: &[SampledSpectrum<N>; NODES],
    ) -> [SampledSpectrum<N>; NODES] {
        let mut slice = [SampledSpectrum::ZERO; NODES];
        for (k, w) in self.0.weights.iter().enumerate() {
            for (s, row) in slice.iter_mut().zip(&tables().facing[self.0.start + k]) {
                for (v, r) in row.iter().zip(reflectance) {
                    *s += *r * (w * v);
                }
            }
        }
        slice
    }

    /// What of a single, complete reflection passes a layer of this transmittance on its way back.
    pub(super) fn leaving(&self, transmittance: &Slice) -> Slice {
        let mut slice = [0.0; NODES];
        for (k, w) in self.0.weights.iter().enumerate() {
            for (s, row) in slice.iter_mut().zip(&tables().leaving[self.0.start + k]) {
                *s += w * row.iter().zip(transmittance).map(|(v, t)| v * t).sum::<f32>();
            }
        }
        slice
    }

    fn of_ratio(&self, table: &[[Slice; ROUGHNESSES]; RATIOS], eta_ti: f32) -> Slice {
        let x = ((eta_ti - 1.0).abs() / (eta_ti + 1.0) / GREATEST_X).min(1.0);
        let at = At::position(x.sqrt() * (RATIOS - 1) as f32, RATIOS);
        let mut slice = [0.0; NODES];
        for (i, w) in at.weights.iter().enumerate() {
            self.gather(*w, &table[at.start + i], &mut slice);
        }
        slice.map(|value| value.clamp(0.0, 1.0))
    }

    fn gather(&self, weight: f32, table: &[Slice; ROUGHNESSES], slice: &mut Slice) {
        for (k, w) in self.0.weights.iter().enumerate() {
            let w = weight * w;
            for (s, v) in slice.iter_mut().zip(&table[self.0.start + k]) {
                *s += w * v;
            }
        }
    }
}

/// Albedo of white sheen.
pub(super) fn sheen(roughness: f32) -> Slice {
    let x = (roughness - SHARPEST_SHEEN) / (1.0 - SHARPEST_SHEEN);
    let at = At::position(x.clamp(0.0, 1.0) * (SHEENS - 1) as f32, SHEENS);
    let rows = &tables().sheen[at.start..at.start + 4];
    std::array::from_fn(|i| at.weights.iter().zip(rows).map(|(w, row)| w * row[i]).sum())
}

/// ∫ (s/t)/π T(μ_i) μ_i dω_i of the Oren–Nayar family ([`super::diffuse`]) for a transmittance given at the nodes.
pub(super) fn oren_nayar_leaving(transmittance: &Slice) -> Slice {
    tables().oren_nayar.map(|row| row.iter().zip(transmittance).map(|(v, t)| v * t).sum())
}

/// Rows for the cosine to the camera, columns for the cosine of F or T.
type Matrix = [[f32; NODES]; NODES];

/// The integrals.
#[derive(Clone)]
struct Tables {
    mean: Slice,
    white: [Slice; ROUGHNESSES],
    facing: [Matrix; ROUGHNESSES],
    leaving: [Matrix; ROUGHNESSES],
    oren_nayar: Matrix,
    dielectric: [[Slice; ROUGHNESSES]; RATIOS],
    /// From the rarer side, from the denser one.
    losses: [[[Slice; ROUGHNESSES]; RATIOS]; 2],
    sheen: [Slice; SHEENS],
    /// Not in the file: `facing` of (1 − μ)⁵.
    rise: [Slice; ROUGHNESSES],
}

impl Tables {
    fn zeroed() -> Box<Self> {
        Box::new(Self {
            mean: [0.0; NODES],
            white: [[0.0; NODES]; ROUGHNESSES],
            facing: [[[0.0; NODES]; NODES]; ROUGHNESSES],
            leaving: [[[0.0; NODES]; NODES]; ROUGHNESSES],
            oren_nayar: [[0.0; NODES]; NODES],
            dielectric: [[[0.0; NODES]; ROUGHNESSES]; RATIOS],
            losses: [[[[0.0; NODES]; ROUGHNESSES]; RATIOS]; 2],
            sheen: [[0.0; NODES]; SHEENS],
            rise: [[0.0; NODES]; ROUGHNESSES],
        })
    }

    /// All rows, in the order of the file.
    fn rows(&mut self) -> impl Iterator<Item = &mut Slice> {
        std::iter::once(&mut self.mean)
            .chain(&mut self.white)
            .chain(self.facing.as_flattened_mut())
            .chain(self.leaving.as_flattened_mut())
            .chain(&mut self.oren_nayar)
            .chain(self.dielectric.as_flattened_mut())
            .chain(self.losses.as_flattened_mut().as_flattened_mut())
            .chain(&mut self.sheen)
    }
}

/// One step of the 16-bit integers of the file. Along a row the rounding is carried on to the next number, so that a sum is off by no more than
/// half a step.
const STEP: f32 = 1.0 / 16384.0;

/// Little-endian 16-bit integers, in units of [`STEP`].
static FILE: &[u8] = include_bytes!("tables.bin");

fn tables() -> &'static Tables {
    static TABLES: OnceLock<Box<Tables>> = OnceLock::new();
    TABLES.get_or_init(|| {
        let mut tables = Tables::zeroed();
        for (row, bytes) in tables.rows().zip(FILE.chunks_exact(2 * NODES)) {
            for (value, bytes) in row.iter_mut().zip(bytes.chunks_exact(2)) {
                *value = f32::from(i16::from_le_bytes([bytes[0], bytes[1]])) * STEP;
            }
        }
        let rise: Slice = std::array::from_fn(|i| super::fresnel::schlick_rise(node(i)));
        for (slice, matrix) in tables.rise.iter_mut().zip(&tables.facing) {
            *slice = matrix.map(|row| row.iter().zip(&rise).map(|(v, r)| v * r).sum());
        }
        tables
    })
}
