//! Derivatives of the re-trace by central differences, and how they react to rounding.

use super::{
    chain::Chain,
    real::{Real, Vector},
    trace::{End, Lost, Noise, PERTURBATION_EXPONENT, trace},
};

/// The step of every difference, in pixels and in nanometres: 2⁻¹⁰⁰.
///
/// Truncation is (h/s)² for a chain that changes on the scale s; even one ulp before the critical angle (s ≈ 10⁻¹³ nm)
/// that is 10⁻³⁴.
const STEP_EXPONENT: isize = -100;

/// Value and first two derivatives of what a chain ends with, along one parameter.
#[derive(Clone, Debug)]
pub struct Along {
    pub point: Vector,
    pub direction: Vector,
    pub momentum: Vector,
    pub point2: Vector,
    pub direction2: Vector,
    pub momentum2: Vector,
    /// ∂(Σ n ℓ)
    pub optical_path: Real,
    /// ∂ℓ of every segment, the last one included
    pub distances: Vec<Real>,
}

/// Everything the product is judged by.
#[derive(Clone, Debug)]
pub struct Derivatives {
    pub end: End,
    pub x: Along,
    pub y: Along,
    pub lambda: Along,
}

/// The re-trace at (x, y, λ) = s·h·weights from the chain's own ray.
fn at(chain: &Chain, weights: [&Real; 3], steps: f64, noise: &Noise) -> Result<End, Lost> {
    let h = Real::power_of_two(STEP_EXPONENT) * Real::new(steps);
    let lambda = Real::new(chain.nanometers) + &h * weights[2];
    trace(chain, &(&h * weights[0]), &(&h * weights[1]), &lambda, noise.clone())
}

/// Derivatives along the direction `weights` in (x, y, λ).
pub fn along(chain: &Chain, middle: &End, weights: [f64; 3], noise: &Noise) -> Result<Along, Lost> {
    let weights = weights.map(Real::new);
    along_reals(chain, middle, weights.each_ref(), noise)
}

fn along_reals(chain: &Chain, middle: &End, weights: [&Real; 3], noise: &Noise) -> Result<Along, Lost> {
    let (plus, minus) = (at(chain, weights, 1.0, noise)?, at(chain, weights, -1.0, noise)?);
    let per_2h = Real::power_of_two(-STEP_EXPONENT - 1);
    let per_h2 = Real::power_of_two(-2 * STEP_EXPONENT);
    let first = |a: &Vector, b: &Vector| (a - b).scale(&per_2h);
    let second = |a: &Vector, m: &Vector, b: &Vector| (&(a - m) - &(m - b)).scale(&per_h2);
    let lengths = |end: &End| -> Vec<Real> {
        end.passed.iter().map(|p| p.distance.clone()).chain([end.distance.clone()]).collect()
    };
    Ok(Along {
        point: first(&plus.point, &minus.point),
        direction: first(&plus.direction, &minus.direction),
        momentum: first(&plus.momentum, &minus.momentum),
        point2: second(&plus.point, &middle.point, &minus.point),
        direction2: second(&plus.direction, &middle.direction, &minus.direction),
        momentum2: second(&plus.momentum, &middle.momentum, &minus.momentum),
        optical_path: (&plus.optical_path - &minus.optical_path) * &per_2h,
        distances: lengths(&plus).iter().zip(&lengths(&minus)).map(|(a, b)| (a - b) * &per_2h).collect(),
    })
}

/// Derivatives along x, y and λ.
pub fn derivatives(chain: &Chain, noise: &Noise) -> Result<Derivatives, Lost> {
    let (zero, lambda) = (Real::zero(), Real::new(chain.nanometers));
    let end = trace(chain, &zero, &zero, &lambda, noise.clone())?;
    Ok(Derivatives {
        x: along(chain, &end, [1.0, 0.0, 0.0], noise)?,
        y: along(chain, &end, [0.0, 1.0, 0.0], noise)?,
        lambda: along(chain, &end, [0.0, 0.0, 1.0], noise)?,
        end,
    })
}

/// (x_λ, y_λ) and (x_λλ, y_λλ) of what is seen at a fixed point of the receiver.
#[derive(Clone, Debug)]
pub struct ScreenMotion {
    pub first: [Real; 2],
    pub second: [Real; 2],
}

/// How a vector reacts to relative perturbations of everything: |v_u − v| / u.
pub fn reaction(perturbed: &Vector, exact: &Vector) -> f64 {
    ((perturbed - exact).length() * Real::power_of_two(-PERTURBATION_EXPONENT)).to_f64()
}

/// What the screen does, found by Newton solves of p(x(λ), y(λ), λ) = p(0, 0, λ₀) (`infinite`: of d instead of p).
pub fn screen_motion(chain: &Chain, infinite: bool, noise: &Noise) -> Result<ScreenMotion, Lost> {
    let base = derivatives(chain, noise)?;
    let seen = |end: &End| if infinite { end.direction.clone() } else { end.point.clone() };
    let (px, py) = if infinite {
        (base.x.direction.clone(), base.y.direction.clone())
    } else {
        (base.x.point.clone(), base.y.point.clone())
    };
    let normal = if infinite { base.end.direction.clone() } else { base.end.n_g.clone() };
    let target = seen(&base.end);
    let determinant = px.cross(&py).dot(&normal);
    let h = Real::power_of_two(STEP_EXPONENT);
    // Chord Newton: the Jacobian at λ₀ is off by O(h), so that every step gains about 30 digits.
    let solve = |steps: f64| -> Result<[Real; 2], Lost> {
        let lambda = Real::new(chain.nanometers) + &h * Real::new(steps);
        let mut xy = [Real::zero(), Real::zero()];
        for _ in 0..4 {
            let end = trace(chain, &xy[0], &xy[1], &lambda, noise.clone())?;
            let miss = &seen(&end) - &target;
            let dx = -(miss.cross(&py).dot(&normal) / &determinant);
            let dy = -(px.cross(&miss).dot(&normal) / &determinant);
            xy = [&xy[0] + &dx, &xy[1] + &dy];
        }
        Ok(xy)
    };
    let (plus, minus) = (solve(1.0)?, solve(-1.0)?);
    let per_2h = Real::power_of_two(-STEP_EXPONENT - 1);
    let per_h2 = Real::power_of_two(-2 * STEP_EXPONENT);
    Ok(ScreenMotion {
        first: [0, 1].map(|i| (&plus[i] - &minus[i]) * &per_2h),
        second: [0, 1].map(|i| (&plus[i] + &minus[i]) * &per_h2),
    })
}
