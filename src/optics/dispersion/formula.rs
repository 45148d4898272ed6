//! The nine formulas of refractiveindex.info, coefficients C1, C2 … in its order ("Dispersion formulas", the document of its
//! database).
//!
//! | | λ in µm |
//! |---|---|
//! | 1 Sellmeier (preferred) | n² − 1 = C1 + C2 λ²/(λ² − C3²) + C4 λ²/(λ² − C5²) + … |
//! | 2 Sellmeier-2 | n² − 1 = C1 + C2 λ²/(λ² − C3) + C4 λ²/(λ² − C5) + … |
//! | 3 Polynomial | n² = C1 + C2 λ^C3 + C4 λ^C5 + … |
//! | 4 RefractiveIndex.INFO | n² = C1 + C2 λ^C3/(λ² − C4^C5) + C6 λ^C7/(λ² − C8^C9) + C10 λ^C11 + C12 λ^C13 + … |
//! | 5 Cauchy | n = C1 + C2 λ^C3 + C4 λ^C5 + … |
//! | 6 Gases | n − 1 = C1 + C2/(C3 − λ⁻²) + C4/(C5 − λ⁻²) + … |
//! | 7 Herzberger | n = C1 + C2/(λ² − 0.028) + C3/(λ² − 0.028)² + C4 λ² + C5 λ⁴ + C6 λ⁶ + … |
//! | 8 Retro | (n² − 1)/(n² + 2) = C1 + C2 λ²/(λ² − C3) + C4 λ² |
//! | 9 Exotic | n² = C1 + C2/(λ² − C3) + C4 (λ − C5)/((λ − C5)² + C6) |
//!
//! Sums may have any number of terms, though the document prints a few. Exponents are any real numbers.

use super::law::{Law, finite};
use super::series::Quantity::{Index, LorentzLorenz, Permittivity};
use super::term::Term;

/// Herzberger's square of a resonance wavelength, µm².
const HERZBERGER: f64 = 0.028;

impl Law {
    /// Formula `number` of refractiveindex.info with its `coefficients` C1, C2 …
    pub fn formula(number: i32, coefficients: &[f64]) -> Result<Self, String> {
        if !(1..=9).contains(&number) {
            return Err(format!("there is no formula {number}: refractiveindex.info has the formulas 1 to 9"));
        }
        finite(&format!("coefficients of formula {number}"), coefficients)?;
        let (c1, rest) = (coefficients[0], &coefficients[1..]);
        match number {
            1 => {
                let (b, c) = pairs(number, rest)?;
                let c_um2: Vec<f64> = c.iter().map(|c| c * c).collect();
                if let Some(c) = c_um2.iter().find(|c| !c.is_finite()) {
                    return Err(format!("formula 1 squares its resonance wavelengths, of which one becomes {c}"));
                }
                Ok(Self::sellmeier_terms(1.0 + c1, &b, &c_um2))
            }
            2 => {
                let (b, c) = pairs(number, rest)?;
                Ok(Self::sellmeier_terms(1.0 + c1, &b, &c))
            }
            3 => Ok(Self::series("polynomial", Permittivity, c1, powers(number, rest)?)),
            4 => Self::mixed(c1, rest),
            5 => Ok(Self::series("Cauchy", Index, c1, powers(number, rest)?)),
            6 => {
                let (a, c) = pairs(number, rest)?;
                let terms = a.into_iter().zip(c).map(|(a, c)| Term::WaveNumber { a, c }).collect();
                Ok(Self::series("gas", Index, 1.0 + c1, terms))
            }
            7 => {
                let terms = rest.iter().enumerate().map(|(i, &a)| match i {
                    0 => Term::Resonance { a, p: 0.0, c: HERZBERGER },
                    1 => Term::DoubleResonance { a, c: HERZBERGER },
                    i => Term::Power { a, p: 2.0 * (i as f64 - 1.0) },
                });
                Ok(Self::series("Herzberger", Index, c1, terms.collect()))
            }
            8 => {
                let [c2, c3, c4] = padded(number, rest)?;
                let terms = vec![Term::Resonance { a: c2, p: 2.0, c: c3 }, Term::Power { a: c4, p: 2.0 }];
                Ok(Self::series("retro", LorentzLorenz, c1, terms))
            }
            _ => {
                let [c2, c3, c4, c5, c6] = padded(number, rest)?;
                let terms = vec![Term::Resonance { a: c2, p: 0.0, c: c3 }, Term::Line { a: c4, u: c5, w: c6 }];
                Ok(Self::series("exotic", Permittivity, c1, terms))
            }
        }
    }

    /// Formula 4: two fractions, then powers. A last fraction may be cut short where its factor is 0.
    fn mixed(c1: f64, rest: &[f64]) -> Result<Self, String> {
        let (fractions, tail) = rest.split_at(rest.len().min(8));
        let mut terms = Vec::new();
        for (i, part) in fractions.chunks(4).enumerate() {
            let first = 4 * i + 2;
            let [a, p, base, exponent] = *part else {
                if part[0] == 0.0 {
                    continue;
                }
                return Err(format!(
                    "formula 4 takes four values a fraction, of the one that begins with C{first} {} are given: author C{first} \
                     to C{}",
                    part.len(),
                    first + 3
                ));
            };
            if a == 0.0 {
                continue;
            }
            let c = libm::pow(base, exponent);
            if !c.is_finite() {
                return Err(format!(
                    "formula 4 has C{}^C{} = {base}^{exponent}, which is no real number: for a pole at λ₀ µm author λ₀ and 2",
                    first + 2,
                    first + 3
                ));
            }
            terms.push(Term::Resonance { a, p, c });
        }
        terms.extend(powers(4, tail)?);
        Ok(Self::series("formula 4", Permittivity, c1, terms))
    }
}

/// Values in twos: the first and the second ones.
fn pairs(number: i32, values: &[f64]) -> Result<(Vec<f64>, Vec<f64>), String> {
    if !values.len().is_multiple_of(2) {
        let first = if number == 4 { "nine values" } else { "C1" };
        return Err(format!(
            "formula {number} takes {first} and then pairs, {} values follow: the last pair is cut short",
            values.len()
        ));
    }
    Ok(values.chunks_exact(2).map(|pair| (pair[0], pair[1])).unzip())
}

fn powers(number: i32, values: &[f64]) -> Result<Vec<Term>, String> {
    let (a, p) = pairs(number, values)?;
    Ok(a.into_iter().zip(p).map(|(a, p)| Term::Power { a, p }).collect())
}

/// Values of a formula with a fixed number of them; the missing ones are 0.
fn padded<const N: usize>(number: i32, values: &[f64]) -> Result<[f64; N], String> {
    let mut all = [0.0; N];
    match all.get_mut(..values.len()) {
        Some(given) => {
            given.copy_from_slice(values);
            Ok(all)
        }
        None => Err(format!("formula {number} takes {} coefficients, {} are given", N + 1, values.len() + 1)),
    }
}
