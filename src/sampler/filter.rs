//! Reconstruction filters, by importance sampling: where a sample of a pixel lies is drawn from the filter itself.
//!
//! So every sample has weight 1, belongs to one pixel, and pixels stay independent of each other (M. Ernst, M. Stamminger, G. Greiner,
//! "Filter importance sampling", IEEE RT 2006; M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §8.8). All
//! filters here are products of one function in x and the same in y, and none is negative anywhere: negative lobes (Mitchell, Lanczos) would need
//! samples of weight −1, more noise, and negative light at edges that no compositor expects in a beauty; `mitchell` is refused by name.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::math::piecewise::PiecewiseLinear;

/// Pieces in which a smooth filter is made linear: it is then right to 1e-6 of its peak.
const PIECES: usize = 512;
/// The widest filter, pixels: beyond it an image is blurred, not filtered.
pub const WIDEST: f64 = 32.0;

/// The shape of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Shape {
    /// Constant.
    Box,
    /// Falls linearly to 0.
    Triangle,
    /// exp(−x²/2σ²) with σ a sixth of the width, less its value at the edge.
    Gaussian,
    /// The four-term window of Blackman and Harris (F. Harris 1978): 0.35875 + 0.48829 cos t + 0.14128 cos 2t + 0.01168 cos 3t, t = −π to π
    /// over the width. It has no visible edge and falls off fast.
    BlackmanHarris,
}

impl Shape {
    /// Names in render settings.
    pub const TOKENS: &[&str] = &["box", "triangle", "gaussian", "blackmanHarris"];

    /// The shape called `token`.
    pub fn from_token(token: &str) -> Option<Self> {
        Some(match token {
            "box" => Self::Box,
            "triangle" => Self::Triangle,
            "gaussian" => Self::Gaussian,
            "blackmanHarris" => Self::BlackmanHarris,
            _ => return None,
        })
    }

    /// At `t` of half the width, −1 to 1; 1 in the middle.
    fn at(self, t: f64) -> f64 {
        match self {
            Self::Box => 1.0,
            Self::Triangle => 1.0 - t.abs(),
            Self::Gaussian => {
                // σ = width/6 is a third of half the width.
                let edge = libm::exp(-4.5);
                (libm::exp(-4.5 * t * t) - edge) / (1.0 - edge)
            }
            Self::BlackmanHarris => {
                let cos = |k: f64| libm::cos(k * std::f64::consts::PI * t);
                (0.35875 + 0.48829 * cos(1.0) + 0.14128 * cos(2.0) + 0.01168 * cos(3.0)).max(0.0)
            }
        }
    }
}

/// A filter about a pixel's centre.
#[derive(Clone, Debug)]
pub struct Filter {
    shape: Shape,
    width: f64,
    density: Arc<PiecewiseLinear>,
}

impl Default for Filter {
    /// The pixel itself.
    fn default() -> Self {
        Self::of(Shape::Box, 1.0)
    }
}

impl Filter {
    /// The filter of `shape`, `width` pixels wide in all, more than 0 and at most [`WIDEST`].
    pub fn new(shape: Shape, width: f64) -> Result<Self> {
        if !(width > 0.0 && width <= WIDEST) {
            return Err(Error::usage(
                "abbe:pixelFilterWidth",
                format!("must be more than 0 and at most {WIDEST} pixels, not {width}"),
            ));
        }
        Ok(Self::of(shape, width))
    }

    fn of(shape: Shape, width: f64) -> Self {
        let pieces = match shape {
            Shape::Box | Shape::Triangle => 2,
            Shape::Gaussian | Shape::BlackmanHarris => PIECES,
        };
        let point = |i: usize| {
            let t = 2.0 * i as f64 / pieces as f64 - 1.0;
            (0.5 * width * t, shape.at(t))
        };
        let table: Vec<_> = (0..=pieces).map(point).collect();
        Self { shape, width, density: Arc::new(PiecewiseLinear::new(&table)) }
    }

    /// Its shape.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Its full width, pixels.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Whether it is the pixel itself.
    pub fn is_pixel(&self) -> bool {
        self.shape == Shape::Box && (self.width - 1.0).abs() <= 0.0
    }

    /// Where a sample lies from the pixel's centre, pixels, for two numbers in 0..1.
    pub fn offset(&self, u: [f64; 2]) -> [f64; 2] {
        u.map(|u| self.density.inverse(u).0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 4] = [Shape::Box, Shape::Triangle, Shape::Gaussian, Shape::BlackmanHarris];

    #[test]
    fn every_token_is_a_shape() {
        for (token, shape) in Shape::TOKENS.iter().zip(SHAPES) {
            assert_eq!(Shape::from_token(token), Some(shape));
            assert_eq!(serde_json::to_value(shape).unwrap(), *token);
        }
        assert_eq!(Shape::from_token("mitchell"), None);
        assert!([0.0, -1.0, 33.0, f64::NAN].iter().all(|&width| Filter::new(Shape::Box, width).is_err()));
    }

    #[test]
    fn offsets_are_distributed_as_the_filter() {
        // Means of 1, x², x⁴ and |x| over a stratified set against integrals of the filter by the midpoint rule.
        for shape in SHAPES {
            for width in [1.0, 3.0] {
                let filter = Filter::new(shape, width).unwrap();
                let moments = |x: f64| [1.0, x * x, x * x * x * x, x.abs(), x];
                let count = 20_000;
                let mut found = [0.0; 5];
                let (mut wanted, mut total) = ([0.0; 5], 0.0);
                for i in 0..count {
                    let t = (f64::from(i) + 0.5) / f64::from(count);
                    let [x, y] = filter.offset([t, 1.0 - t]);
                    assert!(x.abs() <= 0.5 * width && (x + y).abs() < 1e-9, "{shape:?} {x} {y}");
                    let (at, weight) = (width * (t - 0.5), shape.at(2.0 * t - 1.0));
                    total += weight;
                    for (found, moment) in found.iter_mut().zip(moments(x)) {
                        *found += moment / f64::from(count);
                    }
                    for (wanted, moment) in wanted.iter_mut().zip(moments(at)) {
                        *wanted += weight * moment;
                    }
                }
                for (found, wanted) in found.into_iter().zip(wanted) {
                    assert!((found - wanted / total).abs() < 1e-5 * width, "{shape:?} {width}: {found}");
                }
            }
        }
    }

    #[test]
    fn smooth_filters_are_zero_at_their_edge_and_one_in_the_middle() {
        for shape in [Shape::Triangle, Shape::Gaussian, Shape::BlackmanHarris] {
            assert!((shape.at(0.0) - 1.0).abs() < 1e-12 && shape.at(1.0) < 1e-4 && shape.at(-1.0) < 1e-4, "{shape:?}");
        }
    }
}
