//! How much light a light emits, and of which spectrum.
//!
//! UsdLux counts in luminance: a light of intensity 1 and white colour has 1 nit, which is the pixel value (1, 1, 1). Here
//! that is the spectral radiance of the illuminant scaled to ∫ L ȳ dλ = 1 (no K_m). A colour is what a filter makes of the
//! illuminant: L(λ) = scale · illuminant(λ) · uplifted colour(λ), where the uplift is the integrator's choice.

use std::sync::Arc;

use super::blackbody;
use crate::spectrum::response::color_matching;
use crate::spectrum::{LONGEST, SHORTEST, Wavelength, illuminant};

/// Planck's second radiation constant hc/k, nm K (CODATA 2018).
const C2: f64 = 1.438_776_877e7;

/// Temperature and second radiation constant that define CIE standard illuminant A (ISO/CIE 11664-2:2022).
const A_KELVIN: f64 = 2848.0;
const A_C2: f64 = 1.435e7;

/// A relative spectral power distribution.
#[derive(Clone, Debug, PartialEq)]
pub enum Illuminant {
    /// CIE D65: what white is white under. Colours without a spectrum of their own are over it.
    D65,
    /// CIE A: a tungsten lamp.
    A,
    /// The same at every wavelength.
    E,
    /// A black body of this many kelvin.
    Planck(f64),
    /// (nm, power) with increasing wavelengths, linear between them and 0 outside.
    Table(Arc<[[f64; 2]]>),
}

impl Illuminant {
    /// Spectral power at `wavelength`, on a scale of its own.
    pub fn relative(&self, wavelength: Wavelength) -> f64 {
        let nm = wavelength.nanometers();
        match self {
            Self::D65 => illuminant::d65(wavelength),
            Self::A => planck(nm, A_KELVIN, A_C2),
            Self::E => 1.0,
            Self::Planck(kelvin) => planck(nm, *kelvin, C2),
            Self::Table(table) => lookup(table, nm),
        }
    }

    /// A table of (nm, power); says what is wrong with one that is none.
    pub fn table(entries: &[[f64; 2]]) -> Result<Self, String> {
        if entries.len() < 2 {
            return Err(format!("has {} entries: a spectrum has at least two", entries.len()));
        }
        if let Some([nm, power]) =
            entries.iter().find(|[nm, power]| !(nm.is_finite() && *power >= 0.0 && power.is_finite()))
        {
            return Err(format!(
                "has the entry ({nm}, {power}): wavelengths are finite, power is finite and not negative"
            ));
        }
        if let Some(pair) = entries.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
            return Err(format!("has {} nm before {} nm: wavelengths increase", pair[0][0], pair[1][0]));
        }
        Ok(Self::Table(entries.into()))
    }

    /// ∫ power ȳ dλ over 360–830 nm, by the midpoint rule with 1 nm: tables are as a rule in steps of whole nm.
    fn luminance(&self) -> f64 {
        let count = (LONGEST.nanometers() - SHORTEST.nanometers()) as u32;
        (0..count)
            .map(|i| {
                let wavelength = Wavelength::from_nanometers(SHORTEST.nanometers() + f64::from(i) + 0.5);
                self.relative(wavelength) * color_matching(wavelength)[1]
            })
            .sum()
    }
}

/// Planck's law, 1 at 560 nm.
fn planck(nm: f64, kelvin: f64, c2: f64) -> f64 {
    const AT: f64 = 560.0;
    libm::pow(AT / nm, 5.0) * libm::expm1(c2 / (kelvin * AT)) / libm::expm1(c2 / (kelvin * nm))
}

fn lookup(table: &[[f64; 2]], nm: f64) -> f64 {
    let above = table.partition_point(|entry| entry[0] <= nm);
    if above == 0 {
        return 0.0;
    }
    let [x0, y0] = table[above - 1];
    match table.get(above) {
        Some(&[x1, y1]) => y0 + (nm - x0) / (x1 - x0) * (y1 - y0),
        // The last wavelength itself still counts.
        None if nm > x0 => 0.0,
        None => y0,
    }
}

/// What a light emits where nothing shapes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Linear Rec. 709 by luminance: what a pixel shows that sees the light. Finite and not negative.
    pub rgb: [f64; 3],
    /// What the colour is over.
    pub illuminant: Illuminant,
    /// Makes the illuminant's luminance 1.
    scale: f64,
}

impl Emission {
    /// `rgb` over `illuminant`; `None` if that has no luminance.
    pub fn new(rgb: [f64; 3], illuminant: Illuminant) -> Option<Self> {
        let luminance = illuminant.luminance();
        let scale = 1.0 / luminance;
        (luminance > 0.0 && scale > 0.0 && scale.is_finite()).then_some(Self { rgb, illuminant, scale })
    }

    /// Spectral radiance per nm of the illuminant at luminance 1: what [`rgb`](Self::rgb), made a filter, multiplies.
    pub fn white(&self, wavelength: Wavelength) -> f64 {
        self.scale * self.illuminant.relative(wavelength)
    }

    /// Luminance of the colour.
    pub fn luminance(&self) -> f64 {
        blackbody::luminance(self.rgb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nm(nanometers: f64) -> Wavelength {
        Wavelength::from_nanometers(nanometers)
    }

    fn all() -> Vec<Illuminant> {
        let table = Illuminant::table(&[[380.0, 0.5], [500.0, 2.0], [700.0, 0.25]]).unwrap();
        vec![Illuminant::D65, Illuminant::A, Illuminant::E, Illuminant::Planck(3200.0), table]
    }

    #[test]
    fn every_illuminant_has_luminance_one() {
        for illuminant in all() {
            let emission = Emission::new([1.0; 3], illuminant).unwrap();
            // A finer rule than the one it was scaled by; tables have corners.
            let step = 0.1;
            let sum: f64 = (0..4700)
                .map(|i| nm(360.0 + (f64::from(i) + 0.5) * step))
                .map(|wavelength| step * emission.white(wavelength) * color_matching(wavelength)[1])
                .sum();
            assert!((sum - 1.0).abs() < 1e-4, "{:?}: {sum}", emission.illuminant);
        }
    }

    #[test]
    fn illuminant_a_is_the_standards() {
        // ISO/CIE 11664-2:2022, table 1, divided by 100.
        for (wavelength, power) in [(300.0, 0.009_304_83), (400.0, 0.147_080), (500.0, 0.598_611), (600.0, 1.290_43)] {
            let found = Illuminant::A.relative(nm(wavelength));
            assert!((found / power - 1.0).abs() < 5e-5, "{wavelength} nm: {found}");
        }
    }

    #[test]
    fn a_black_body_peaks_where_wien_says() {
        for kelvin in [4000.0, 5000.0, 6500.0] {
            let peak = 2.897_771_955e6 / kelvin;
            let at = |nanometers| Illuminant::Planck(kelvin).relative(nm(nanometers));
            assert!(at(peak) > at(peak - 1.0) && at(peak) > at(peak + 1.0), "{kelvin} K");
        }
    }

    #[test]
    fn tables_are_linear_within_and_dark_without() {
        let table = Illuminant::table(&[[400.0, 1.0], [500.0, 3.0]]).unwrap();
        for (wavelength, power) in [(399.9, 0.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (500.1, 0.0)] {
            assert!((table.relative(nm(wavelength)) - power).abs() < 1e-12, "{wavelength} nm");
        }
        assert!(Emission::new([1.0; 3], Illuminant::table(&[[100.0, 1.0], [200.0, 1.0]]).unwrap()).is_none());
        assert!(Illuminant::table(&[[400.0, 1.0]]).is_err());
        assert!(Illuminant::table(&[[400.0, 1.0], [400.0, 1.0]]).unwrap_err().contains("increase"));
        assert!(Illuminant::table(&[[400.0, 1.0], [500.0, -1.0]]).unwrap_err().contains("-1"));
        assert!(Illuminant::table(&[[400.0, f64::NAN], [500.0, 1.0]]).is_err());
    }
}
