//! The search for a parabola whose sigmoid has a given colour: what colours made spectra have in common.
//!
//! A curve is f(x(λ)) with x = c₀ + c₁u + c₂u², u = −1 at 360 nm to 1 at 830 nm, and f a smooth function of one number (W. Jakob, J.
//! Hanika, "A low-dimensional function space for efficient spectral upsampling", CGF 38(2), 2019). Its colour is linear
//! Rec. 709 under D65, each channel divided by what it is for f = 1. Levenberg–Marquardt finds the three coefficients.

use glam::{DMat3, DVec3};

use super::response::Rec709;
use super::{LONGEST, SHORTEST, Wavelength, illuminant};

/// 1, u, u².
pub(super) fn powers(wavelength: Wavelength) -> DVec3 {
    let (first, last) = (SHORTEST.nanometers(), LONGEST.nanometers());
    let nm = wavelength.nanometers().clamp(first, last);
    let u = (2.0 * nm - (first + last)) / (last - first);
    DVec3::new(1.0, u, u * u)
}

/// S(x) = ½ + x / (2√(1 + x²)), within (0, 1) also where that form cancels.
pub(super) fn sigmoid(x: f64) -> f64 {
    let root = (1.0 + x * x).sqrt();
    if x < 0.0 { 0.5 / (root * (root - x)) } else { 0.5 * (1.0 + x / root) }
}

/// S'(x) = ½ (1 + x²)^(−3/2).
pub(super) fn sigmoid_slope(x: f64) -> f64 {
    let square = 1.0 + x * x;
    0.5 / (square * square.sqrt())
}

/// The sigmoid's inverse, of a value within (0, 1).
pub(super) fn inverse_sigmoid(value: f64) -> f64 {
    (value - 0.5) / (value * (1.0 - value)).sqrt()
}

/// f(x) and f'(x).
pub(super) struct Curve {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// One wavelength of the quadrature.
struct Node {
    powers: DVec3,
    /// D65 times the responses, each channel's divided by its sum.
    weights: DVec3,
}

/// The search for the coefficients of curves `f`.
pub(super) struct Fit<F> {
    nodes: Vec<Node>,
    f: F,
}

/// What the current coefficients give.
pub(super) struct Trial {
    pub(super) coefficients: DVec3,
    pub(super) residual: DVec3,
    /// ∂color/∂c.
    pub(super) jacobian: DMat3,
}

impl<F: Fn(f64) -> Curve> Fit<F> {
    /// Panels of Simpson's rule, nm: the observer's table. Within one of them responses and illuminant are linear, and the
    /// steepest curve that a colour asks for rises within 2 nm.
    const PANEL: f64 = 1.0;

    pub(super) fn new(f: F) -> Self {
        let panels = ((LONGEST.nanometers() - SHORTEST.nanometers()) / Self::PANEL) as u32;
        let responses = Rec709::default();
        let mut nodes: Vec<_> = (0..=2 * panels)
            .map(|i| {
                let nm = SHORTEST.nanometers() + f64::from(i) * 0.5 * Self::PANEL;
                let wavelength = Wavelength::from_nanometers(nm);
                // 1 4 2 4 … 4 1
                let simpson = if i % 2 == 1 {
                    4.0
                } else if i == 0 || i == 2 * panels {
                    1.0
                } else {
                    2.0
                };
                let weights = responses.at(wavelength) * (simpson * illuminant::d65(wavelength));
                Node { powers: powers(wavelength), weights }
            })
            .collect();
        let white: DVec3 = nodes.iter().map(|node| node.weights).sum();
        nodes.iter_mut().for_each(|node| node.weights /= white);
        Self { nodes, f }
    }

    pub(super) fn trial(&self, coefficients: DVec3, target: DVec3) -> Trial {
        let (mut color, mut columns) = (DVec3::ZERO, [DVec3::ZERO; 3]);
        for node in &self.nodes {
            let x = coefficients.dot(node.powers);
            let Curve { value, slope } = (self.f)(x);
            color += node.weights * value;
            let weighted = node.weights * slope;
            for (column, power) in columns.iter_mut().zip(node.powers.to_array()) {
                *column += weighted * power;
            }
        }
        let [a, b, c] = columns;
        Trial { coefficients, residual: color - target, jacobian: DMat3::from_cols(a, b, c) }
    }

    /// Levenberg–Marquardt steps for a target that walks from the grey of the same mean, whose curve is constant at x = `start`, to
    /// `color`. From the answer for one target the next is found in a few steps; the work is bounded.
    pub(super) fn solve(&self, color: DVec3, start: f64) -> DVec3 {
        const TARGETS: u32 = 8;
        const STEPS: u32 = 6;
        const LAST_STEPS: u32 = 60;

        let grey = color.element_sum() / 3.0;
        let mut coefficients = DVec3::new(start, 0.0, 0.0);
        for k in 1..=TARGETS {
            let target = DVec3::splat(grey).lerp(color, f64::from(k) / f64::from(TARGETS));
            coefficients = self.descend(coefficients, target, if k < TARGETS { STEPS } else { LAST_STEPS });
        }
        coefficients
    }

    fn descend(&self, start: DVec3, target: DVec3, steps: u32) -> DVec3 {
        // A sum of a few hundred products of order one is good to this.
        const EXACT: f64 = 1e-15;
        // Relative to the diagonal: small enough to leave Newton's steps what they are, grown where they fail.
        const DAMPING: f64 = 1e-9;

        let mut here = self.trial(start, target);
        let mut damping = DAMPING;
        for _ in 0..steps {
            if here.residual.abs().max_element() <= EXACT {
                break;
            }
            let transposed = here.jacobian.transpose();
            let mut normal = transposed * here.jacobian;
            for i in 0..3 {
                normal.col_mut(i)[i] *= 1.0 + damping;
            }
            let step = normal.inverse() * (transposed * -here.residual);
            let next = self.trial(here.coefficients + step, target);
            // Not true of NaN, which a singular matrix gives.
            if next.residual.length_squared() < here.residual.length_squared() {
                here = next;
                damping *= 0.1;
            } else {
                damping *= 10.0;
            }
        }
        here.coefficients
    }
}
