//! The integrals of `tables.bin`, in f64, by midpoint rules over the numbers that directions are drawn with.
//!
//! `cargo test --lib bsdf::albedo -- --ignored write_tables` writes the file anew.

use super::*;
use crate::bsdf::sheen::Shape;

/// A direction in f64.
#[derive(Clone, Copy)]
struct Direction {
    x: f64,
    y: f64,
    z: f64,
}

impl Direction {
    /// In the plane y = 0.
    fn of_cosine(mu: f64) -> Self {
        // At 0 itself nothing is visible.
        let mu = mu.max(1e-5);
        Self { x: (1.0 - mu * mu).max(0.0).sqrt(), y: 0.0, z: mu }
    }

    fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    fn stretch(self, alpha: f64) -> f64 {
        (alpha * alpha * (self.x * self.x + self.y * self.y) + self.z * self.z).sqrt()
    }

    /// a h + b self
    fn combine(self, b: f64, h: Self, a: f64) -> Self {
        Self { x: a * h.x + b * self.x, y: a * h.y + b * self.y, z: a * h.z + b * self.z }
    }
}

/// α of a row.
fn alpha_of(k: usize) -> f64 {
    let s = k as f64 / (ROUGHNESSES - 1) as f64;
    s * s * s
}

/// η of a row of the dielectric tables, η ≥ 1.
fn ratio_of(k: usize) -> f64 {
    let s = (k as f64 / (RATIOS - 1) as f64).max(1e-3);
    let x = f64::from(GREATEST_X) * s * s;
    (1.0 + x) / (1.0 - x)
}

/// Adds `value` at a cosine to the nodes about it.
fn scatter(row: &mut [f64; NODES], mu: f64, value: f64) {
    let at = At::cosine(mu as f32);
    for (k, w) in at.weights.iter().enumerate() {
        row[at.start + k] += f64::from(*w) * value;
    }
}

/// How fine the rules are.
#[derive(Clone, Copy)]
struct Fineness {
    azimuths: usize,
    heights: usize,
}

const FINE: Fineness = Fineness { azimuths: 64, heights: 160 };

/// 2 ∫ c_j(μ) μ dμ of the cardinal functions, by the midpoint rule: with 2^16 points its error is below 1e-9.
fn mean_row() -> [f64; NODES] {
    const POINTS: usize = 1 << 16;
    let mut row = [0.0; NODES];
    for i in 0..POINTS {
        let t = (i as f64 + 0.5) / POINTS as f64;
        scatter(&mut row, t * t * t, 6.0 * t.powi(5) / POINTS as f64);
    }
    row
}

/// Calls `f` with normals visible from `wo` and their weights, which sum to 1; `k` bounds the cap as in [`crate::bsdf::microfacet`]. One half
/// of the azimuths stands for the other. Heights crowd at both ends of the cap (v²(3 − 2v)), where the tails are.
fn visible_normals(wo: Direction, alpha: f64, k: f64, fine: Fineness, mut f: impl FnMut(Direction, f64)) {
    let length = wo.stretch(alpha);
    let view = Direction { x: alpha * wo.x / length, y: 0.0, z: wo.z / length };
    for j in 0..fine.heights {
        let v = (j as f64 + 0.5) / fine.heights as f64;
        let weight = 6.0 * v * (1.0 - v) / (fine.azimuths * fine.heights) as f64;
        let below = v * v * (3.0 - 2.0 * v) * (1.0 + k * view.z);
        let sine = (below * (2.0 - below)).max(0.0).sqrt();
        for i in 0..fine.azimuths {
            let phi = std::f64::consts::PI * (i as f64 + 0.5) / fine.azimuths as f64;
            let x = alpha * (sine * libm::cos(phi) + view.x);
            let y = alpha * sine * libm::sin(phi);
            let z = (1.0 - below + view.z).max(0.0);
            let length = (x * x + y * y + z * z).sqrt();
            if length > 0.0 {
                f(Direction { x: x / length, y: y / length, z: z / length }, weight);
            }
        }
    }
}

/// Calls `f` with (wo·h, μ_i, weight) of directions that facets reflect to.
fn reflections(mu: f64, alpha: f64, fine: Fineness, mut f: impl FnMut(f64, f64, f64)) {
    let wo = Direction::of_cosine(mu);
    if alpha == 0.0 {
        return f(wo.z, wo.z, 1.0);
    }
    let s = 1.0 + wo.x;
    let (a2, s2) = (alpha * alpha, s * s);
    let k = (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z);
    let stretch = wo.stretch(alpha);
    visible_normals(wo, alpha, k, fine, |h, weight| {
        let c = wo.dot(h);
        let wi = wo.combine(-1.0, h, 2.0 * c);
        if wi.z > 0.0 {
            // G2/G1 with the density of the bounded cap in place of that of all visible normals.
            f(c, wi.z, weight * wi.z * (k * wo.z + stretch) / (wi.z * stretch + wo.z * wi.stretch(alpha)));
        }
    });
}

fn fresnel(c: f64, eta: f64) -> f64 {
    let inside = (eta - 1.0) * (eta + 1.0) + c * c;
    if inside <= 0.0 {
        return 1.0;
    }
    let w = inside.sqrt();
    let s = (c - w) / (c + w);
    let p = (eta * eta * c - w) / (eta * eta * c + w);
    0.5 * (s * s + p * p)
}

/// 1 − E_R − E_T.
fn dielectric_loss(mu: f64, alpha: f64, eta: f64, fine: Fineness) -> f64 {
    if alpha == 0.0 {
        return 0.0;
    }
    let wo = Direction::of_cosine(mu);
    let stretch = wo.stretch(alpha);
    // G2/G1 = (1 + Λ_o)/(1 + Λ_o + Λ_i)
    let passing = |wi: Direction| {
        let cos = wi.z.abs();
        cos * (wo.z + stretch) / (cos * stretch + wo.z * wi.stretch(alpha))
    };
    let mut kept = 0.0;
    visible_normals(wo, alpha, 1.0, fine, |h, weight| {
        let c = wo.dot(h);
        let f = fresnel(c, eta);
        let reflected = wo.combine(-1.0, h, 2.0 * c);
        if reflected.z > 0.0 {
            kept += weight * f * passing(reflected);
        }
        if f < 1.0 {
            let w = ((eta - 1.0) * (eta + 1.0) + c * c).sqrt();
            let refracted = wo.combine(-1.0 / eta, h, (c - w) / eta);
            if refracted.z < 0.0 {
                kept += weight * (1.0 - f) * passing(refracted);
            }
        }
    });
    1.0 - kept
}

/// With x = s/t, ∫ x/π c_j(μ_i) μ_i dω_i.
fn oren_nayar_row(mu: f64) -> [f64; NODES] {
    const HEIGHTS: usize = 4096;
    let mut row = [0.0; NODES];
    let sine = (1.0 - mu * mu).max(0.0).sqrt();
    for j in 0..HEIGHTS {
        let t = (j as f64 + 0.5) / HEIGHTS as f64;
        let mu_i = t * t * t;
        let sine_i = (1.0 - mu_i * mu_i).max(0.0).sqrt();
        // Over half of the azimuths s is positive, where it is divided by t: ∫ cos φ = 2 over it, −2 over the other.
        let ring = 2.0 * sine * sine_i * (1.0 / mu.max(mu_i) - 1.0) * std::f64::consts::FRAC_1_PI;
        scatter(&mut row, mu_i, ring * mu_i * 3.0 * t * t / HEIGHTS as f64);
    }
    row
}

/// ∫ f μ_i dω_i of sheen, over t = ∛μ_i and half of the azimuths.
fn sheen_albedo(mu: f64, roughness: f64, fine: Fineness) -> f64 {
    let shape = Shape::new(roughness as f32);
    let wo = Direction::of_cosine(mu);
    let mut sum = 0.0;
    for j in 0..fine.heights {
        let t = (j as f64 + 0.5) / fine.heights as f64;
        let mu_i = t * t * t;
        let sine = (1.0 - mu_i * mu_i).sqrt();
        for k in 0..fine.azimuths {
            let phi = std::f64::consts::PI * (k as f64 + 0.5) / fine.azimuths as f64;
            let (x, y, z) = (wo.x + sine * libm::cos(phi), sine * libm::sin(phi), wo.z + mu_i);
            let mu_h = z / (x * x + y * y + z * z).sqrt();
            sum += f64::from(shape.value(wo.z as f32, mu_i as f32, mu_h as f32)) * mu_i * 3.0 * t * t;
        }
    }
    sum * 2.0 * std::f64::consts::PI / (fine.azimuths * fine.heights) as f64
}

/// The row of the file at this place, in f64.
fn row(place: usize, fine: Fineness) -> [f64; NODES] {
    let mut at = place;
    let mut within = |rows: usize| {
        if at < rows {
            return Some(at);
        }
        at -= rows;
        None
    };
    let at_nodes = |f: &dyn Fn(f64) -> f64| -> [f64; NODES] { std::array::from_fn(|i| f(f64::from(node(i)))) };
    if within(1).is_some() {
        return mean_row();
    }
    if let Some(k) = within(ROUGHNESSES) {
        return at_nodes(&|mu| {
            let mut sum = 0.0;
            reflections(mu, alpha_of(k), fine, |_, _, weight| sum += weight);
            sum
        });
    }
    for leaving in [false, true] {
        if let Some(k) = within(ROUGHNESSES * NODES) {
            let mut row = [0.0; NODES];
            reflections(f64::from(node(k % NODES)), alpha_of(k / NODES), fine, |c, mu_i, weight| {
                scatter(&mut row, if leaving { mu_i } else { c }, weight);
            });
            return row;
        }
    }
    if let Some(k) = within(NODES) {
        return oren_nayar_row(f64::from(node(k)));
    }
    if let Some(k) = within(RATIOS * ROUGHNESSES) {
        let (eta, alpha) = (ratio_of(k / ROUGHNESSES), alpha_of(k % ROUGHNESSES));
        return at_nodes(&|mu| {
            let mut sum = 0.0;
            reflections(mu, alpha, fine, |c, _, weight| sum += weight * fresnel(c, eta));
            sum
        });
    }
    for denser in [false, true] {
        if let Some(k) = within(RATIOS * ROUGHNESSES) {
            let eta = ratio_of(k / ROUGHNESSES);
            let eta = if denser { 1.0 / eta } else { eta };
            return at_nodes(&|mu| dielectric_loss(mu, alpha_of(k % ROUGHNESSES), eta, fine));
        }
    }
    let k = within(SHEENS).expect("rows end with sheen");
    let sharpest = f64::from(SHARPEST_SHEEN);
    let roughness = sharpest + (1.0 - sharpest) * k as f64 / (SHEENS - 1) as f64;
    at_nodes(&|mu| sheen_albedo(mu, roughness, fine))
}

#[test]
#[ignore = "writes src/bsdf/albedo/tables.bin; takes a minute"]
fn write_tables() {
    let rows = Tables::zeroed().rows().count();
    let mut bytes = Vec::new();
    for place in 0..rows {
        let mut carried = 0.0;
        for value in row(place, FINE) {
            let exact = value / f64::from(STEP) + carried;
            let rounded = exact.round();
            carried = exact - rounded;
            bytes.extend((rounded as i16).to_le_bytes());
        }
    }
    std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/albedo/tables.bin"), bytes).unwrap();
}

#[test]
fn the_file_holds_the_integrals() {
    let mut tables = tables().clone();
    let count = tables.rows().count();
    assert_eq!(FILE.len(), count * NODES * 2);
    // A prime stride visits every table and all ranges of the parameters.
    for (place, stored) in tables.rows().enumerate().step_by(149) {
        for (a, b) in stored.iter().zip(row(place, FINE)) {
            assert!(
                (f64::from(*a) - b).abs() <= f64::from(STEP) * 1.01,
                "row {place}: {a} in the file, {b} integrated"
            );
        }
    }
}
