//! Wavelengths importance-sampled for the eye, and for lights that shine in lines.
//!
//! The density is p(λ) ∝ ‖r(λ)‖, the length of the responses of R, G, B (each with integral 1 under white), plus a twentieth spread evenly over
//! 360–830 nm, so that no weight is without a bound. Among densities it minimises the sum of the channels' variances for the
//! spectrum 1 and one wavelength a path, which is what dispersion leaves of a path (the integrand is r/p, and ∫‖r‖²/p dλ is least for
//! p ∝ ‖r‖). Measured over sixty smooth reflectances under D65, E and A, against 1/cosh²(0.0072 (λ − 538)) of pbrt (M. Pharr, W.
//! Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed. 2023, §4.5.4): the mean second moment of R, G, B falls from 6.90 to 4.90
//! with one wavelength, from 1.48 to 1.43 with four; 1.37 and 1.38 with eight.
//!
//! It is linear between knots 1 nm apart, so its integral is a parabola, whose inverse is exact. The hero comes from one number of the
//! sampler, stratified over a pixel's samples; the companions divide the rest of the unit interval evenly.

use std::sync::LazyLock;

use super::sampled::Wavelengths;
use super::{LONGEST, SHORTEST, Wavelength, sensor};
use crate::math::piecewise::{Knot, PiecewiseLinear};

/// Share of the density that is spread evenly.
const EVEN: f64 = 0.05;
/// Share of the density that goes to lights with lines, if there are any.
const LINES: f64 = 0.5;
/// A light is one with lines if its brightness at a wavelength, seen by the eye, has a mean square of so many squared means; daylight has
/// less than 1.1.
const PEAKED: f64 = 2.0;
/// A density of wavelengths on 360–830 nm, positive everywhere.
#[derive(Clone, Debug)]
pub struct Visible {
    density: PiecewiseLinear,
}

/// The density for the eye alone.
pub static EYE: LazyLock<Visible> = LazyLock::new(|| {
    let shape = |nm: f64| sensor::rec709(Wavelength::from_nanometers(nm)).length();
    let table: Vec<_> = whole_nanometers().map(|nm| (nm, shape(nm))).collect();
    let responses = PiecewiseLinear::new(&table);
    let even = EVEN / (LONGEST.nanometers() - SHORTEST.nanometers());
    let mixed = |knot: &Knot| (knot.x, (1.0 - EVEN) * knot.pdf + even);
    let table: Vec<_> = responses.knots().iter().map(mixed).collect();
    Visible { density: PiecewiseLinear::new(&table) }
});

fn whole_nanometers() -> impl Iterator<Item = f64> {
    (SHORTEST.nanometers() as u32..=LONGEST.nanometers() as u32).map(f64::from)
}

impl Visible {
    /// For the eye and for lights with the spectra `lights`: points (nm, power per nm) in increasing order, linear in between and 0
    /// outside. Those with lines get a share of the wavelengths each, however narrow their lines are; the others have no influence, nor have
    /// tables that are no spectra.
    pub fn with_lights<'a>(lights: impl IntoIterator<Item = &'a [(f64, f64)]>) -> Self {
        let peaked: Vec<_> =
            lights.into_iter().filter_map(Self::seen).filter(|light| EYE.spread(light) > PEAKED).collect();
        if peaked.is_empty() {
            return EYE.clone();
        }
        let each = LINES / peaked.len() as f64;
        let mut places: Vec<f64> = whole_nanometers().collect();
        places.extend(peaked.iter().flat_map(|light| light.knots().iter().map(|knot| knot.x)));
        places.sort_by(f64::total_cmp);
        places.dedup();
        let mixed = |nm: f64| {
            let lines: f64 = peaked.iter().map(|light| each * light.pdf(nm)).sum();
            (nm, (1.0 - LINES) * EYE.pdf_lambda(nm) + lines)
        };
        let table: Vec<_> = places.into_iter().map(mixed).collect();
        Self { density: PiecewiseLinear::new(&table) }
    }

    /// The density that is proportional to what the eye sees of a light; `None` if that is nothing.
    fn seen(light: &[(f64, f64)]) -> Option<PiecewiseLinear> {
        let is_table = light.windows(2).all(|pair| pair[0].0 < pair[1].0);
        if !is_table || light.iter().any(|(nm, power)| !nm.is_finite() || !power.is_finite() || *power < 0.0) {
            return None;
        }
        let (first, last) = (SHORTEST.nanometers(), LONGEST.nanometers());
        let mut places: Vec<f64> = whole_nanometers().collect();
        places.extend(light.iter().map(|point| point.0).filter(|nm| (first..=last).contains(nm)));
        places.sort_by(f64::total_cmp);
        places.dedup();
        let power = |nm: f64| match light.partition_point(|point| point.0 <= nm) {
            0 => 0.0,
            after if after == light.len() => {
                if light[after - 1].0 < nm {
                    0.0
                } else {
                    light[after - 1].1
                }
            }
            after => {
                let ((x0, y0), (x1, y1)) = (light[after - 1], light[after]);
                y0 + (y1 - y0) * (nm - x0) / (x1 - x0)
            }
        };
        let table: Vec<_> = places.into_iter().map(|nm| (nm, EYE.pdf_lambda(nm) * power(nm))).collect();
        table.iter().any(|(_, value)| *value > 0.0).then(|| PiecewiseLinear::new(&table))
    }

    /// ∫ q²/p dλ of a density `q`, by the trapezium rule over its knots: 1 for p itself.
    fn spread(&self, q: &PiecewiseLinear) -> f64 {
        let value = |knot: &Knot| knot.pdf * knot.pdf / self.pdf_lambda(knot.x);
        let area = |pair: &[Knot]| 0.5 * (value(&pair[0]) + value(&pair[1])) * (pair[1].x - pair[0].x);
        q.knots().windows(2).map(area).sum()
    }

    /// Density at `nm`, per nm; 0 outside 360–830 nm.
    #[inline]
    pub fn pdf_lambda(&self, nm: f64) -> f64 {
        self.density.pdf(nm)
    }

    /// Wavelengths for the hero's place `u` in 0..1.
    #[inline]
    pub fn sample<const N: usize>(&self, u: f64) -> Wavelengths<N> {
        let mut drawn = Wavelengths { nanometers: [0.0; N], pdf_lambda: [0.0; N] };
        for lane in 0..N {
            let place = u + lane as f64 / N as f64;
            let (nanometers, pdf) = self.density.inverse(if place >= 1.0 { place - 1.0 } else { place });
            (drawn.nanometers[lane], drawn.pdf_lambda[lane]) = (nanometers, pdf as f32);
        }
        drawn
    }
}

/// Density of [`EYE`] at `nm`, per nm; 0 outside 360–830 nm.
pub fn pdf_lambda(nm: f64) -> f64 {
    EYE.pdf_lambda(nm)
}

/// Wavelengths for the eye, for the hero's place `u` in 0..1.
pub fn sample<const N: usize>(u: f64) -> Wavelengths<N> {
    EYE.sample(u)
}

/// One wavelength, evenly from 360–830 nm, for the place `u` in 0..1: what `reference` uses.
pub fn uniform(u: f64) -> Wavelengths<1> {
    let (first, last) = (SHORTEST.nanometers(), LONGEST.nanometers());
    Wavelengths { nanometers: [first + u * (last - first)], pdf_lambda: [(1.0 / (last - first)) as f32] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::SampledSpectrum;

    /// Mercury's green line, a tenth of a nanometre wide, over nothing else.
    const LINE: [(f64, f64); 3] = [(546.0, 0.0), (546.05, 20.0), (546.1, 0.0)];

    #[test]
    fn densities_integrate_to_one_and_are_positive() {
        for density in [EYE.clone(), Visible::with_lights([&LINE[..]])] {
            // The midpoint rule is exact between the knots of a line if none lies inside a step.
            let step = 0.025;
            let sum: f64 = (0..18_800).map(|i| density.pdf_lambda(360.0 + (f64::from(i) + 0.5) * step) * step).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
            assert!((0..=4700).all(|i| density.pdf_lambda(360.0 + 0.1 * f64::from(i)) > 5e-5));
            assert!(density.pdf_lambda(359.999) <= 0.0 && density.pdf_lambda(830.001) <= 0.0);
        }
    }

    #[test]
    fn companions_divide_the_interval_evenly() {
        let wavelengths = sample::<4>(0.6);
        for lane in 0..4 {
            let alone = sample::<1>((0.6 + 0.25 * lane as f64) % 1.0);
            assert!((wavelengths.nanometers()[lane] - alone.nanometers()[0]).abs() < 1e-9);
        }
    }

    #[test]
    fn a_line_narrower_than_a_nanometre_is_found() {
        let density = Visible::with_lights([&LINE[..]]);
        let power = |nm: f64| 400.0 * (0.05 - (nm - 546.05).abs()).max(0.0);
        let count = 256;
        let mut sum = glam::DVec3::ZERO;
        for i in 0..count {
            let wavelengths = density.sample::<4>((f64::from(i) + 0.5) / f64::from(count));
            let radiance = SampledSpectrum::from_fn(|lane| power(wavelengths.nanometers()[lane]) as f32);
            sum += sensor::xyz(radiance, &wavelengths);
        }
        // The line's area is 1.
        let wanted = glam::DVec3::from(crate::spectrum::observer::color_matching(Wavelength::from_nanometers(546.05)));
        let found = sum / f64::from(count);
        assert!(((found - wanted) / wanted).abs().max_element() < 2e-3, "{found} {wanted}");
    }

    #[test]
    fn lights_without_lines_change_nothing() {
        let table = |power: &dyn Fn(f64) -> f64| whole_nanometers().map(|nm| (nm, power(nm))).collect::<Vec<_>>();
        let daylight = table(&|nm| crate::spectrum::illuminant::d65(Wavelength::from_nanometers(nm)));
        let black = table(&|_| 0.0);
        let backwards = [(600.0, 1.0), (500.0, 1.0)];
        let density = Visible::with_lights([&daylight[..], &black[..], &backwards[..], &[]]);
        assert_eq!(density.density.knots().len(), EYE.density.knots().len());
        let spread = EYE.spread(&Visible::seen(&daylight).unwrap());
        assert!((1.0..1.1).contains(&spread), "{spread}");
    }
}
