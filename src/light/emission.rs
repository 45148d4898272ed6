//! How much light a light emits, and of which spectrum.
//!
//! UsdLux counts in luminance: a light of intensity 1 and white colour has 1 nit, which is the pixel value (1, 1, 1). Here
//! that is the spectral radiance of the illuminant scaled to ∫ L ȳ dλ = 1 (no K_m). A colour is what a filter makes of the
//! illuminant: L(λ) = white(λ) · uplifted colour(λ), where the uplift is the integrator's choice.
//!
//! Transport sees a spectrum as a number each nanometre, linear between them ([`White`]), as the observer's functions are:
//! then colorimetric sums over whole nanometres and means over wavelengths of paths agree. Standard illuminants, black bodies
//! and tables at whole nanometres are looked up there. A table with other wavelengths (a line of a lamp, narrower than the
//! step) is spread over the two neighbours of each of its wavelengths, Σ tₖ hatₖ with tₖ = ∫ power · hatₖ dλ: its integral
//! and its mean wavelength stay what they are.

use std::sync::{Arc, LazyLock};

use super::temperature;
use crate::spectrum::illuminant::Illuminant;
use crate::spectrum::observer::tristimulus;
use crate::spectrum::{LONGEST, SHORTEST, Wavelength};

/// Numbers of a [`White`]: 360 to 830 nm.
const STEPS: usize = 471;
/// Wavelengths this close to a whole number are one, nm.
const WHOLE: f64 = 1e-9;

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
    white: Arc<White>,
}

/// A spectrum scaled to luminance 1 (∫ L ȳ dλ = 1): spectral radiance per nm at 360, 361 … 830 nm, linear between, 0 outside.
#[derive(Clone, Debug, PartialEq)]
pub struct White(Box<[f32; STEPS]>);

static D65: LazyLock<Arc<White>> = LazyLock::new(|| {
    let spectrum = Spectrum::Illuminant(Illuminant::D65);
    Arc::new(White::new(&spectrum).expect("daylight is visible"))
});

impl White {
    /// Of D65, which colours are over that nothing else is said of.
    pub fn d65() -> Arc<Self> {
        Arc::clone(&D65)
    }

    /// `None` of what has no luminance.
    fn new(spectrum: &Spectrum) -> Option<Self> {
        let first = SHORTEST.nanometers();
        let powers: Vec<f64> = match spectrum {
            Spectrum::Table(table) if table.iter().any(|[nm, _]| (nm - nm.round()).abs() > WHOLE) => spread(table),
            _ => (0..STEPS).map(|k| spectrum.power(Wavelength::from_nanometers(first + k as f64))).collect(),
        };
        let [_, luminance, _] = tristimulus(|wavelength| powers[(wavelength.nanometers() - first).round() as usize]);
        let scale = 1.0 / luminance;
        let is_visible = luminance > 0.0 && scale > 0.0 && scale.is_finite();
        is_visible.then(|| Self(Box::new(std::array::from_fn(|k| (scale * powers[k]) as f32))))
    }

    /// At so many nanometres.
    #[inline]
    pub fn at(&self, nanometers: f64) -> f32 {
        let position = nanometers - SHORTEST.nanometers();
        if !(0.0..=(STEPS - 1) as f64).contains(&position) {
            return 0.0;
        }
        // Of 32 bits, as the processor converts it.
        let below = (position as i32 as usize).min(STEPS - 2);
        let t = (position - below as f64) as f32;
        self.0[below] + t * (self.0[below + 1] - self.0[below])
    }
}

/// The table on whole nanometres with its integral kept: ∫ power · hatₖ dλ over ∫ hatₖ dλ.
fn spread(table: &[[f64; 2]]) -> Vec<f64> {
    let (first, last) = (SHORTEST.nanometers(), LONGEST.nanometers());
    let mut sums = vec![0.0; STEPS];
    for pair in table.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        let power = |x: f64| y0 + (x - x0) / (x1 - x0) * (y1 - y0);
        let (mut from, to) = (x0.max(first), x1.min(last));
        while from < to {
            let below = (from.floor() - first).min((STEPS - 2) as f64);
            let until = (first + below + 1.0).min(to);
            let hat = |x: f64| x - first - below;
            // Simpson's rule is exact for the product of two straight lines.
            let middle = 0.5 * (from + until);
            let above = (until - from) / 6.0
                * (power(from) * hat(from) + 4.0 * power(middle) * hat(middle) + power(until) * hat(until));
            let all = (until - from) * power(middle);
            sums[below as usize] += all - above;
            sums[below as usize + 1] += above;
            from = until;
        }
    }
    // The hats at the ends are halves.
    sums[0] *= 2.0;
    sums[STEPS - 1] *= 2.0;
    sums
}

impl Emission {
    /// `rgb` over `spectrum`; `None` if that has no luminance.
    pub fn new(rgb: [f64; 3], spectrum: Spectrum) -> Option<Self> {
        let white = match &spectrum {
            Spectrum::Illuminant(Illuminant::D65) => White::d65(),
            other => Arc::new(White::new(other)?),
        };
        Some(Self { rgb, spectrum, white })
    }

    /// Spectral radiance per nm of the spectrum at luminance 1: what [`rgb`](Self::rgb), made a filter, multiplies.
    pub fn white(&self, wavelength: Wavelength) -> f64 {
        self.white.at(wavelength.nanometers()).into()
    }

    /// All of it, shared.
    pub fn white_table(&self) -> &Arc<White> {
        &self.white
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

    /// A line of mercury half a step wide, and one outside of whole nanometres all over.
    #[test]
    fn narrow_lines_keep_their_power_and_their_wavelength() {
        let tables =
            [vec![[545.8, 0.0], [546.07, 3.0], [546.3, 0.0]], vec![[400.25, 1.0], [500.5, 3.0], [577.75, 0.5]]];
        for table in tables {
            let moment = |k: i32| -> f64 {
                let step = 1e-3;
                let table = Spectrum::table(&table).unwrap();
                (0..470_000)
                    .map(|i| 360.0 + (f64::from(i) + 0.5) * step)
                    .map(|x| step * table.power(nm(x)) * (x - 500.0).powi(k))
                    .sum()
            };
            let white = White::new(&Spectrum::table(&table).unwrap()).unwrap();
            let sum = |k: i32| -> f64 {
                (0..471).map(|i| 360.0 + f64::from(i)).map(|x| f64::from(white.at(x)) * (x - 500.0).powi(k)).sum()
            };
            let mean = moment(1) / moment(0);
            assert!((sum(1) / sum(0) - mean).abs() < 1e-4, "{} {mean}", sum(1) / sum(0));
        }
        let line = White::new(&Spectrum::table(&[[545.8, 0.0], [546.07, 3.0], [546.3, 0.0]]).unwrap()).unwrap();
        let centroid = (545.8 + 546.07 + 546.3) / 3.0;
        let power: f64 = (0..471).map(|i| f64::from(line.at(360.0 + f64::from(i)))).sum();
        assert!((power * color_matching(nm(centroid))[1] - 1.0).abs() < 2e-3, "{power}");
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
