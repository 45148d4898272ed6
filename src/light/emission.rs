//! How much light a light emits, and of which spectrum.
//!
//! UsdLux counts in luminance: a light of intensity 1 and white colour has 1 nit, which is the pixel value (1, 1, 1). Here
//! that is the spectral radiance of the illuminant scaled to ∫ L ȳ dλ = 1 (no K_m). A colour is what a filter makes of the
//! illuminant: L(λ) = scale · illuminant(λ) · uplifted colour(λ), where the uplift is the integrator's choice.

use std::sync::Arc;

use super::temperature;
use crate::spectrum::Wavelength;
use crate::spectrum::illuminant::Illuminant;
use crate::spectrum::observer::tristimulus;

/// A relative spectral power distribution.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// A standard illuminant or a black body. Colours without a spectrum of their own are over D65.
    Illuminant(Illuminant),
    /// (nm, power) with increasing wavelengths, linear between them and 0 outside.
    Table(Arc<[[f64; 2]]>),
}

impl Spectrum {
    /// Spectral power at `wavelength`, on a scale of its own.
    pub fn power(&self, wavelength: Wavelength) -> f64 {
        match self {
            Self::Illuminant(illuminant) => illuminant.power(wavelength),
            Self::Table(table) => lookup(table, wavelength.nanometers()),
        }
    }

    /// A table of (nm, power); says what is wrong with one that is none.
    pub fn table(entries: &[[f64; 2]]) -> Result<Self, String> {
        if entries.len() < 2 {
            return Err(format!("has {} entries, and a spectrum has at least two", entries.len()));
        }
        let is_number = |[nm, power]: &[f64; 2]| nm.is_finite() && *power >= 0.0 && power.is_finite();
        if let Some([nm, power]) = entries.iter().find(|entry| !is_number(entry)) {
            return Err(format!("has the entry ({nm}, {power}), and power is finite and not negative"));
        }
        if let Some(pair) = entries.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
            return Err(format!("has {} nm before {} nm, and wavelengths increase", pair[0][0], pair[1][0]));
        }
        Ok(Self::Table(entries.into()))
    }
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
    pub spectrum: Spectrum,
    /// Makes the spectrum's luminance 1.
    scale: f64,
}

impl Emission {
    /// `rgb` over `spectrum`; `None` if that has no luminance.
    pub fn new(rgb: [f64; 3], spectrum: Spectrum) -> Option<Self> {
        let [_, luminance, _] = tristimulus(|wavelength| spectrum.power(wavelength));
        let scale = 1.0 / luminance;
        (luminance > 0.0 && scale > 0.0 && scale.is_finite()).then_some(Self { rgb, spectrum, scale })
    }

    /// Spectral radiance per nm of the spectrum at luminance 1: what [`rgb`](Self::rgb), made a filter, multiplies.
    pub fn white(&self, wavelength: Wavelength) -> f64 {
        self.scale * self.spectrum.power(wavelength)
    }

    /// Luminance of the colour.
    pub fn luminance(&self) -> f64 {
        temperature::luminance(self.rgb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer::color_matching;

    fn nm(nanometers: f64) -> Wavelength {
        Wavelength::from_nanometers(nanometers)
    }

    #[test]
    fn every_spectrum_has_luminance_one() {
        let mut spectra = vec![Spectrum::table(&[[380.0, 0.5], [500.0, 2.0], [700.0, 0.25]]).unwrap()];
        let named = ["D65", "A", "E", "D50", "FL11"].map(|name| Illuminant::named(name).unwrap());
        spectra.extend(named.into_iter().chain([Illuminant::BlackBody(3200.0)]).map(Spectrum::Illuminant));
        for spectrum in spectra {
            let emission = Emission::new([1.0; 3], spectrum).unwrap();
            // A finer rule than the one it was scaled by.
            let step = 0.1;
            let sum: f64 = (0..4700)
                .map(|i| nm(360.0 + (f64::from(i) + 0.5) * step))
                .map(|wavelength| step * emission.white(wavelength) * color_matching(wavelength)[1])
                .sum();
            assert!((sum - 1.0).abs() < 1e-4, "{:?}: {sum}", emission.spectrum);
        }
    }

    #[test]
    fn tables_are_linear_within_and_dark_without() {
        let table = Spectrum::table(&[[400.0, 1.0], [500.0, 3.0]]).unwrap();
        for (wavelength, power) in [(399.9, 0.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (500.1, 0.0)] {
            assert!((table.power(nm(wavelength)) - power).abs() < 1e-12, "{wavelength} nm");
        }
        assert!(Emission::new([1.0; 3], Spectrum::table(&[[100.0, 1.0], [200.0, 1.0]]).unwrap()).is_none());
        assert!(Spectrum::table(&[[400.0, 1.0]]).is_err());
        assert!(Spectrum::table(&[[400.0, 1.0], [400.0, 1.0]]).unwrap_err().contains("increase"));
        assert!(Spectrum::table(&[[400.0, 1.0], [500.0, -1.0]]).unwrap_err().contains("-1"));
        assert!(Spectrum::table(&[[400.0, f64::NAN], [500.0, 1.0]]).is_err());
    }
}
