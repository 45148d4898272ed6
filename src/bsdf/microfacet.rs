//! The GGX distribution of microfacets, with masking after Smith, and directions drawn from the normals that are visible.
//!
//! D(h) = 1 / (π α_x α_y (h_x²/α_x² + h_y²/α_y² + h_z²)²); Λ(w) = (√(1 + (α_x² w_x² + α_y² w_y²)/w_z²) − 1)/2; G1 = 1/(1 + Λ);
//! height-correlated G2 = 1/(1 + Λ(wo) + Λ(wi)), for directions on either side.
//!
//! Sources: B. Walter et al., EGSR 2007; E. Heitz, JCGT 3(2) 2014 (masking); J. Dupuy & A. Benyoub, HPG 2023 (spherical caps);
//! K. Eto & Y. Tokuyoshi, SIGGRAPH Asia 2023 (caps bounded to what reflects above the horizon).

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

use super::albedo::{self, At, NODES, Place, Slice};
use crate::spectrum::SampledSpectrum;

/// A GGX distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    alpha: Vec2,
}

impl Ggx {
    pub(super) fn new(alpha: [f32; 2]) -> Self {
        // Sharper than this, f32 directions do not resolve the lobe; such surfaces are smooth unless anisotropic.
        const SHARPEST: f32 = 1e-4;
        Self { alpha: Vec2::from(alpha).clamp(Vec2::splat(SHARPEST), Vec2::ONE) }
    }

    /// α of the isotropic distribution that masks a direction of average azimuth as much: the root of the mean of α².
    pub(super) fn mean_alpha(&self) -> f32 {
        (0.5 * self.alpha.length_squared()).sqrt()
    }

    /// Where `w` looks up what isotropic facets of [`Self::mean_alpha`] hide from each other: at the cosine at which they mask as much as
    /// these, as Λ is a function of α tan θ. `upright` is the answer where α has no direction.
    #[inline]
    pub(super) fn at(&self, w: Vec3, upright: &At) -> At {
        if self.is_isotropic() {
            return *upright;
        }
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        let across = (x * x + y * y) / (0.5 * self.alpha.length_squared());
        At::cosine(w.z.abs() / (w.z * w.z + across).sqrt())
    }

    /// The mean over azimuths of a function that is looked up by [`Self::at`].
    pub(super) fn over_azimuths<const N: usize>(
        &self,
        slice: &[SampledSpectrum<N>; NODES],
    ) -> [SampledSpectrum<N>; NODES] {
        /// Of a quarter turn; the function is smooth in the azimuth and even about both axes.
        const AZIMUTHS: usize = 8;
        if self.is_isotropic() {
            return *slice;
        }
        std::array::from_fn(|i| {
            let mu = albedo::node(i);
            let sine = (1.0 - mu * mu).max(0.0).sqrt();
            let mut sum = SampledSpectrum::ZERO;
            for k in 0..AZIMUTHS {
                let phi = 0.5 * PI * (k as f32 + 0.5) / AZIMUTHS as f32;
                let w = Vec3::new(sine * libm::cosf(phi), sine * libm::sinf(phi), mu);
                sum += self.at(w, &At::cosine(mu)).of_spectra(slice);
            }
            sum * (1.0 / AZIMUTHS as f32)
        })
    }

    /// The lesser and the greater α.
    pub(super) fn extremes(&self) -> [f32; 2] {
        [self.alpha.min_element(), self.alpha.max_element()]
    }

    pub(super) fn is_isotropic(&self) -> bool {
        (self.alpha.x - self.alpha.y).abs() <= 1e-6 * self.alpha.x
    }

    /// Where isotropic facets that reflect as much of F as these in direction `w` are between those of the lesser and of the greater α.
    ///
    /// Along the normal α² is the mean of α_x² and α_y²; at grazing angles light sees the facets along its azimuth, so that α² is
    /// α_x² cos² φ + α_y² sin² φ.
    #[inline]
    pub(super) fn share(&self, w: Vec3) -> f32 {
        if self.is_isotropic() {
            return 0.0;
        }
        let squares = self.alpha * self.alpha;
        let squared = 0.5 * (squares.x + squares.y + (squares.x - squares.y) * (w.x * w.x - w.y * w.y));
        let [least, greatest] = self.extremes();
        ((squared.max(0.0).sqrt() - least) / (greatest - least)).clamp(0.0, 1.0)
    }

    /// The mean of [`Self::share`] over azimuths, at the nodes.
    pub(super) fn shares(&self) -> Slice {
        /// Of a quarter turn; the share is smooth in the azimuth and even about both axes.
        const AZIMUTHS: usize = 8;
        if self.is_isotropic() {
            return [0.0; NODES];
        }
        let turns: [f32; AZIMUTHS] = std::array::from_fn(|k| 0.5 * PI * (k as f32 + 0.5) / AZIMUTHS as f32);
        std::array::from_fn(|i| {
            let mu = albedo::node(i);
            let sine = (1.0 - mu * mu).max(0.0).sqrt();
            let share = |phi: &f32| self.share(Vec3::new(sine * libm::cosf(*phi), sine * libm::sinf(*phi), mu));
            turns.iter().map(share).sum::<f32>() / AZIMUTHS as f32
        })
    }

    /// Where `w` looks up what facets reflect.
    #[inline]
    pub(super) fn place(&self, w: Vec3) -> Place {
        Place { at: At::cosine(w.z.abs()), share: self.share(w) }
    }

    /// D(h), per steradian.
    #[inline]
    pub(super) fn d(&self, h: Vec3) -> f32 {
        let (x, y) = (h.x / self.alpha.x, h.y / self.alpha.y);
        let s = x * x + y * y + h.z * h.z;
        1.0 / (PI * self.alpha.x * self.alpha.y * s * s)
    }

    /// √(α_x² w_x² + α_y² w_y² + w_z²) = |w_z| (1 + 2Λ(w)).
    #[inline]
    pub(super) fn stretch(&self, w: Vec3) -> f32 {
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        (x * x + y * y + w.z * w.z).sqrt()
    }

    /// G2 / (4 |cos θ_o| |cos θ_i|) = 1 / (2 (|μ_i| s_o + |μ_o| s_i)), s the stretched lengths; finite at grazing.
    #[inline]
    pub(super) fn visibility(&self, wo: Vec3, wi: Vec3) -> f32 {
        let sum = wi.z.abs() * self.stretch(wo) + wo.z.abs() * self.stretch(wi);
        if sum > 0.0 { 0.5 / sum } else { 0.0 }
    }

    /// Draws a normal visible from `wo` (wo.z > 0), with density [`Self::visible_pdf`].
    #[inline]
    pub(super) fn sample_visible(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        self.cap(wo, u, 1.0)
    }

    /// Density of visible normals per solid angle of h: G1(wo) max(0, wo·h) D(h) / wo.z.
    #[inline]
    pub(super) fn visible_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        2.0 * self.d(h) * wo.dot(h).max(0.0) / (wo.z + self.stretch(wo))
    }

    /// Draws a normal visible from `wo`, mostly of those that reflect above the horizon.
    #[inline]
    pub(super) fn sample_reflecting(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        self.cap(wo, u, self.bound(wo))
    }

    /// Density per solid angle of the direction reflected by normals of [`Self::sample_reflecting`].
    #[inline]
    pub(super) fn reflecting_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        0.5 * self.d(h) / (self.bound(wo) * wo.z + self.stretch(wo))
    }

    /// k of Eto & Tokuyoshi (eq. 5).
    #[inline]
    fn bound(&self, wo: Vec3) -> f32 {
        let a = self.alpha.min_element();
        let s = 1.0 + wo.truncate().length();
        let (a2, s2) = (a * a, s * s);
        (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z)
    }

    /// A point of the spherical cap z ≥ −k v_z, halfway to the stretched view v.
    #[inline]
    fn cap(&self, wo: Vec3, [u, v]: [f32; 2], k: f32) -> Vec3 {
        let view = Vec3::new(self.alpha.x * wo.x, self.alpha.y * wo.y, wo.z).normalize();
        // 1 − z, so that the sine keeps its digits at the pole.
        let below = v * (1.0 + k * view.z);
        let sine = (below * (2.0 - below)).max(0.0).sqrt();
        let phi = 2.0 * PI * u;
        let h = Vec3::new(sine * libm::cosf(phi), sine * libm::sinf(phi), 1.0 - below) + view;
        let h = Vec3::new(self.alpha.x * h.x, self.alpha.y * h.y, h.z.max(0.0));
        let length = h.length();
        if length > 0.0 { h / length } else { Vec3::Z }
    }
}

/// `wo` mirrored about `h`.
#[inline]
pub(super) fn mirror(wo: Vec3, h: Vec3) -> Vec3 {
    (2.0 * wo.dot(h) * h - wo).normalize()
}
