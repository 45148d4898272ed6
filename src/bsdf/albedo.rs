//! Directional albedos: what part of the light a rough interface sends back, for any law of reflectance.
//!
//! What is known of an interface as a function of the cosine μ to the normal stands at [`NODES`] cosines, μ = t² with t evenly
//! spaced (grazing angles need the resolution), and is interpolated by the cubic through four of them: a [`Slice`]. The
//! albedo of a single reflection is linear in the reflectance F of the facets, and what passes a layer above on the way back is
//! linear in its transmittance T. So two matrices per roughness answer for every F and every T:
//!
//! - `facing`: E(μ) = ∫ F(wo·h) G2 D/(4 μ) dω_i = Σ_j facing_j F(μ_j)
//! - `leaving`: H(μ) = ∫ T(μ_i) G2 D/(4 μ) dω_i = Σ_j leaving_j T(μ_j), at F = 1
//!
//! They are integrated once per process, at the first use, by a fixed rule in f64: the same bits everywhere. The rule is the
//! midpoint rule over the numbers that bounded visible normals are drawn with. Rough dielectrics also lose light from either side by
//! what they transmit; that depends on the index ratio, and has a table of its own. (Scheme of C. Kulla & A. Conty, "Revisiting
//! physically based shading at Imageworks", SIGGRAPH 2017 course.)

use std::sync::OnceLock;

use crate::spectrum::SampledSpectrum;

/// Cosines of a slice.
pub(super) const NODES: usize = 16;
/// Roughnesses of the tables, √α evenly spaced from 0 to 1.
const ROUGHNESSES: usize = 12;
/// Index ratios of the dielectric table on each side of 1: x = |η − 1|/(η + 1) evenly spaced from 0 to [`GREATEST_X`].
const RATIOS: usize = 9;
/// η = 3, and 1/3.
const GREATEST_X: f64 = 0.5;

/// A function of the cosine to the normal.
pub(super) type Slice = [f32; NODES];

/// The cosine of a node.
pub(super) fn node(i: usize) -> f32 {
    let t = i as f32 / (NODES - 1) as f32;
    t * t
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
        Self::position(mu.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32, NODES)
    }

    #[inline]
    fn position(x: f32, nodes: usize) -> Self {
        let start = (x as usize).saturating_sub(1).min(nodes - 4);
        let f = x - start as f32;
        let (a, b, c) = (f - 1.0, f - 2.0, f - 3.0);
        Self { start, weights: [a * b * c / -6.0, f * b * c / 2.0, f * a * c / -2.0, f * a * b / 6.0] }
    }

    /// The value there.
    #[inline]
    pub(super) fn of(&self, slice: &Slice) -> f32 {
        let values = &slice[self.start..self.start + 4];
        self.weights.iter().zip(values).map(|(w, v)| w * v).sum()
    }

    /// The values there, lane by lane.
    #[inline]
    pub(super) fn of_spectra<const N: usize>(&self, slice: &[SampledSpectrum<N>; NODES]) -> SampledSpectrum<N> {
        let mut sum = SampledSpectrum::ZERO;
        for (w, v) in self.weights.iter().zip(&slice[self.start..self.start + 4]) {
            sum += *v * *w;
        }
        sum
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

/// The rows of the tables about an α, with their weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Roughness(At);

impl Roughness {
    pub(super) fn new(alpha: f32) -> Self {
        Self(At::position(alpha.clamp(0.0, 1.0).sqrt() * (ROUGHNESSES - 1) as f32, ROUGHNESSES))
    }

    /// Albedo of a single reflection where every facet reflects everything.
    pub(super) fn white(&self) -> Slice {
        let mut slice = [0.0; NODES];
        for (k, w) in self.0.weights.iter().enumerate() {
            for (s, v) in slice.iter_mut().zip(&tables().white[self.0.start + k]) {
                *s += w * v;
            }
        }
        slice
    }

    /// Albedo of a single reflection where facets reflect `reflectance`, given at the nodes.
    pub(super) fn facing(&self, reflectance: &Slice) -> Slice {
        self.apply(&tables().facing, reflectance)
    }

    /// [`Self::facing`], lane by lane.
    pub(super) fn facing_of_spectra<const N: usize>(
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
        self.apply(&tables().leaving, transmittance)
    }

    fn apply(&self, matrices: &[Matrix; ROUGHNESSES], function: &Slice) -> Slice {
        let mut slice = [0.0; NODES];
        for (k, w) in self.0.weights.iter().enumerate() {
            for (s, row) in slice.iter_mut().zip(&matrices[self.0.start + k]) {
                *s += w * row.iter().zip(function).map(|(v, f)| v * f).sum::<f32>();
            }
        }
        slice
    }

    /// What a rough dielectric loses, of light that it would reflect or transmit, to a second encounter with itself.
    pub(super) fn dielectric_loss(&self, eta_ti: f32) -> Slice {
        let x = f64::from((eta_ti - 1.0).abs() / (eta_ti + 1.0)).min(GREATEST_X) / GREATEST_X;
        let at = At::position(x as f32 * (RATIOS - 1) as f32, RATIOS);
        let table = &losses()[usize::from(eta_ti < 1.0)];
        let mut slice = [0.0; NODES];
        for (i, wi) in at.weights.iter().enumerate() {
            for (k, wk) in self.0.weights.iter().enumerate() {
                for (s, v) in slice.iter_mut().zip(&table[at.start + i][self.0.start + k]) {
                    *s += wi * wk * v;
                }
            }
        }
        slice.map(|loss| loss.max(0.0))
    }
}

/// ∫ (s/t)/π T(μ_i) μ_i dω_i of the Oren–Nayar family ([`super::diffuse`]) for a transmittance given at the nodes.
pub(super) fn oren_nayar_leaving(transmittance: &Slice) -> Slice {
    tables().oren_nayar.map(|row| row.iter().zip(transmittance).map(|(v, t)| v * t).sum())
}

type Matrix = [[f32; NODES]; NODES];

struct Tables {
    mean: Slice,
    white: [Slice; ROUGHNESSES],
    facing: [Matrix; ROUGHNESSES],
    leaving: [Matrix; ROUGHNESSES],
    oren_nayar: Matrix,
}

fn tables() -> &'static Tables {
    static TABLES: OnceLock<Box<Tables>> = OnceLock::new();
    TABLES.get_or_init(|| {
        let mut tables = Box::new(Tables {
            mean: mean_weights(),
            white: [[0.0; NODES]; ROUGHNESSES],
            facing: [[[0.0; NODES]; NODES]; ROUGHNESSES],
            leaving: [[[0.0; NODES]; NODES]; ROUGHNESSES],
            oren_nayar: std::array::from_fn(|i| oren_nayar_row(f64::from(node(i)))),
        });
        for k in 0..ROUGHNESSES {
            for i in 0..NODES {
                let (facing, leaving) = reflection_rows(f64::from(node(i)), alpha_of(k));
                tables.white[k][i] = facing.iter().sum();
                tables.facing[k][i] = facing;
                tables.leaving[k][i] = leaving;
            }
        }
        tables
    })
}

/// α of a row.
fn alpha_of(k: usize) -> f64 {
    let r = k as f64 / (ROUGHNESSES - 1) as f64;
    r * r
}

/// Adds `value` at a cosine to the nodes about it.
fn scatter(row: &mut [f64; NODES], mu: f64, value: f64) {
    let at = At::cosine(mu as f32);
    for (k, w) in at.weights.iter().enumerate() {
        row[at.start + k] += f64::from(*w) * value;
    }
}

/// 2 ∫ c_j(μ) μ dμ of the cardinal functions, exact: between nodes c_j(t²) t³ is of degree 6, which four points of Gauss integrate.
fn mean_weights() -> Slice {
    const GAUSS: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
        (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    ];
    let mut row = [0.0; NODES];
    let width = 1.0 / (NODES - 1) as f64;
    for interval in 0..NODES - 1 {
        for (x, w) in GAUSS {
            let t = (interval as f64 + 0.5 + 0.5 * x) * width;
            scatter(&mut row, t * t, 0.5 * width * w * 4.0 * t * t * t);
        }
    }
    row.map(|w| w as f32)
}

/// A direction in f64.
#[derive(Clone, Copy)]
struct Direction {
    x: f64,
    y: f64,
    z: f64,
}

impl Direction {
    fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    fn stretch(self, alpha: f64) -> f64 {
        (alpha * alpha * (self.x * self.x + self.y * self.y) + self.z * self.z).sqrt()
    }
}

/// Calls `f` with normals visible from a direction of cosine `mu` in the plane y = 0, with equal weights that sum to 1; `k` bounds the cap as
/// in [`super::microfacet`]. One half of the azimuths stands for the other.
fn visible_normals(mu: f64, alpha: f64, k: f64, azimuths: usize, heights: usize, mut f: impl FnMut(Direction, f64)) {
    let wo = Direction { x: (1.0 - mu * mu).max(0.0).sqrt(), y: 0.0, z: mu };
    let length = wo.stretch(alpha);
    let view = Direction { x: alpha * wo.x / length, y: 0.0, z: wo.z / length };
    let weight = 1.0 / (azimuths * heights) as f64;
    for j in 0..heights {
        let below = (j as f64 + 0.5) / heights as f64 * (1.0 + k * view.z);
        let sine = (below * (2.0 - below)).max(0.0).sqrt();
        for i in 0..azimuths {
            let phi = std::f64::consts::PI * (i as f64 + 0.5) / azimuths as f64;
            let (x, y, z) = (
                alpha * (sine * libm::cos(phi) + view.x),
                alpha * sine * libm::sin(phi),
                (1.0 - below + view.z).max(0.0),
            );
            let length = (x * x + y * y + z * z).sqrt();
            if length > 0.0 {
                f(Direction { x: x / length, y: y / length, z: z / length }, weight);
            }
        }
    }
}

/// Smallest cosine that albedos are integrated at: at 0 itself nothing is visible.
const GRAZING: f64 = 1e-5;

/// One row of `facing` and of `leaving`.
fn reflection_rows(mu: f64, alpha: f64) -> ([f32; NODES], [f32; NODES]) {
    let (mut facing, mut leaving) = ([0.0; NODES], [0.0; NODES]);
    let mu = mu.max(GRAZING);
    if alpha == 0.0 {
        scatter(&mut facing, mu, 1.0);
        scatter(&mut leaving, mu, 1.0);
        return (facing.map(|v| v as f32), leaving.map(|v| v as f32));
    }
    let wo = Direction { x: (1.0 - mu * mu).max(0.0).sqrt(), y: 0.0, z: mu };
    let s = 1.0 + wo.x;
    let (a2, s2) = (alpha * alpha, s * s);
    let k = (1.0 - a2) * s2 / (s2 + a2 * mu * mu);
    let stretch = wo.stretch(alpha);
    visible_normals(mu, alpha, k, 32, 64, |h, weight| {
        let c = wo.dot(h);
        let wi = Direction { x: 2.0 * c * h.x - wo.x, y: 2.0 * c * h.y - wo.y, z: 2.0 * c * h.z - wo.z };
        if wi.z <= 0.0 {
            return;
        }
        // G2/G1 with the density of the bounded cap in place of that of all visible normals.
        let value = weight * wi.z * (k * mu + stretch) / (wi.z * stretch + mu * wi.stretch(alpha));
        scatter(&mut facing, c, value);
        scatter(&mut leaving, wi.z, value);
    });
    (facing.map(|v| v as f32), leaving.map(|v| v as f32))
}

/// One row of the table of [`oren_nayar_leaving`]: with x = s/t, ∫ x/π c_j(μ_i) μ_i dω_i.
fn oren_nayar_row(mu: f64) -> [f32; NODES] {
    const HEIGHTS: usize = 256;
    let mut row = [0.0; NODES];
    let sine = (1.0 - mu * mu).max(0.0).sqrt();
    for j in 0..HEIGHTS {
        // μ_i = t², as the nodes.
        let t = (j as f64 + 0.5) / HEIGHTS as f64;
        let mu_i = t * t;
        let sine_i = (1.0 - mu_i * mu_i).max(0.0).sqrt();
        // Over half of the azimuths s is positive, where it is divided by t: ∫ cos φ = 2 over it, −2 over the other.
        let product = sine * sine_i;
        let mean = 2.0 * product * (1.0 / mu.max(mu_i) - 1.0) * std::f64::consts::FRAC_1_PI;
        scatter(&mut row, mu_i, mean * mu_i * 2.0 * t / HEIGHTS as f64);
    }
    row.map(|v| v as f32)
}

type Loss = [[[Slice; ROUGHNESSES]; RATIOS]; 2];

fn losses() -> &'static Loss {
    static LOSSES: OnceLock<Box<Loss>> = OnceLock::new();
    LOSSES.get_or_init(|| {
        let mut table = Box::new([[[[0.0; NODES]; ROUGHNESSES]; RATIOS]; 2]);
        for (side, ratios) in table.iter_mut().enumerate() {
            for (ratio, roughnesses) in ratios.iter_mut().enumerate() {
                let x = GREATEST_X * (ratio as f64 / (RATIOS - 1) as f64).max(1e-6);
                let eta = (1.0 + x) / (1.0 - x);
                let eta = if side == 0 { eta } else { 1.0 / eta };
                for (k, slice) in roughnesses.iter_mut().enumerate().skip(1) {
                    for (i, value) in slice.iter_mut().enumerate() {
                        *value = dielectric_loss(f64::from(node(i)), alpha_of(k), eta) as f32;
                    }
                }
            }
        }
        table
    })
}

/// 1 − E_R − E_T.
fn dielectric_loss(mu: f64, alpha: f64, eta: f64) -> f64 {
    let mu = mu.max(GRAZING);
    let wo = Direction { x: (1.0 - mu * mu).max(0.0).sqrt(), y: 0.0, z: mu };
    let stretch = wo.stretch(alpha);
    // G2/G1 = (1 + Λ_o)/(1 + Λ_o + Λ_i)
    let passing = |wi: Direction| {
        let cos = wi.z.abs();
        cos * (mu + stretch) / (cos * stretch + mu * wi.stretch(alpha))
    };
    let mut kept = 0.0;
    visible_normals(mu, alpha, 1.0, 16, 32, |h, weight| {
        let c = wo.dot(h);
        let reflected = Direction { x: 2.0 * c * h.x - wo.x, y: 2.0 * c * h.y - wo.y, z: 2.0 * c * h.z - wo.z };
        let inside = (eta - 1.0) * (eta + 1.0) + c * c;
        let f = if inside <= 0.0 {
            1.0
        } else {
            let w = inside.sqrt();
            let s = (c - w) / (c + w);
            let p = (eta * eta * c - w) / (eta * eta * c + w);
            // wi = −wo/η + (c/η − cos_t) h
            let along = (c - w) / eta;
            let wi =
                Direction { x: along * h.x - wo.x / eta, y: along * h.y - wo.y / eta, z: along * h.z - wo.z / eta };
            let f = 0.5 * (s * s + p * p);
            if wi.z < 0.0 {
                kept += weight * (1.0 - f) * passing(wi);
            }
            f
        };
        if reflected.z > 0.0 {
            kept += weight * f * passing(reflected);
        }
    });
    1.0 - kept
}
