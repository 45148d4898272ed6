//! Standard illuminants: relative spectral powers of light that colours are defined under, or that lamps are sold as.
//!
//! Daylight D and the fluorescent lamps are tables of the CIE (CIE 15:2018), interpolated linearly as it prescribes; A and
//! black bodies are closed forms. All but E are 100 at 560 nm, or near it where a table says so.

use super::tables::{DAYLIGHT, FL2, FL7, FL11};
use super::{SHORTEST, Wavelength, blackbody};

/// Distance of the entries of daylight's tables, nm.
const DAYLIGHT_STEP: f64 = 10.0;

/// D65 from 360 to 830 nm: ISO/CIE 11664-2:2022, table 1 (the same numbers as CIE 15:2018, table 5). The standard's finer
/// tables are this one, interpolated.
const D65: [f64; 48] = [
    46.6383, 52.0891, 49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, // 360
    117.812, 114.861, 115.923, 108.811, 109.354, 107.802, 104.790, 107.689, 104.405, 104.046, // 460
    100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, // 560
    80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.3490, 61.6040, 69.8856, 75.0870, 63.5927, // 660
    46.4182, 66.8054, 63.3828, 64.3040, 59.4519, 51.9590, 57.4406, 60.3125, // 760
];

/// Relative spectral power of D65 at `wavelength`, per nm, 100 at 560 nm. Outside of 360–830 nm, that of the nearer end.
pub fn d65(wavelength: Wavelength) -> f64 {
    interpolate(&D65, SHORTEST.nanometers(), DAYLIGHT_STEP, wavelength)
}

/// A standard illuminant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Illuminant {
    /// Equal energy at every wavelength: 1.
    E,
    /// Incandescent light, 2856 K on the temperature scale of 1968.
    A,
    /// Average daylight, 6504 K.
    D65,
    /// Daylight of another correlated colour temperature.
    Daylight(Daylight),
    /// A black body of so many kelvin.
    BlackBody(f64),
    /// A fluorescent lamp: FL2 (standard), FL7 (broad band), FL11 (three narrow bands).
    Fluorescent(Lamp),
}

/// A fluorescent lamp of CIE 15.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// Cool white, 4230 K.
    Fl2,
    /// Broad-band daylight, 6500 K.
    Fl7,
    /// Narrow-band white, 4000 K.
    Fl11,
}

/// Daylight by its principal components: S = S₀ + M₁S₁ + M₂S₂ (CIE 15:2018, §4.1.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Daylight {
    m1: f64,
    m2: f64,
}

impl Daylight {
    /// Correlated colour temperatures for which the CIE defines daylight, K.
    pub const RANGE: [f64; 2] = [4000.0, 25_000.0];

    /// Daylight of correlated colour temperature `kelvin`; `None` outside of [`RANGE`](Self::RANGE).
    ///
    /// The components' weights are rounded to three decimals, as the CIE has it.
    pub fn of_temperature(kelvin: f64) -> Option<Self> {
        if !(Self::RANGE[0]..=Self::RANGE[1]).contains(&kelvin) {
            return None;
        }
        let t = 1e3 / kelvin;
        let x = if kelvin <= 7000.0 {
            0.244_063 + t * (0.099_11 + t * (2.967_8 - t * 4.607_0))
        } else {
            0.237_040 + t * (0.247_48 + t * (1.901_8 - t * 2.006_4))
        };
        let y = -3.000 * x * x + 2.870 * x - 0.275;
        let scale = 0.0241 + 0.2562 * x - 0.7341 * y;
        let round = |value: f64| (value * 1e3).round() / 1e3;
        Some(Self {
            m1: round((-1.3515 - 1.7703 * x + 5.9114 * y) / scale),
            m2: round((0.0300 - 31.4424 * x + 30.0717 * y) / scale),
        })
    }
}

impl Illuminant {
    /// The illuminant called `name`: `E`, `A`, `D50`, `D55`, `D65`, `D75` (any `D40` to `D250`), `FL2`, `FL7`, `FL11` (also
    /// `F2` …).
    pub fn named(name: &str) -> Option<Self> {
        // 1.4388/1.4380: the radiation constant c₂ has changed since the temperatures were given their names.
        const RESCALED: f64 = 1.4388 / 1.4380;
        Some(match name {
            "E" => Self::E,
            "A" => Self::A,
            "D65" => Self::D65,
            "FL2" | "F2" => Self::Fluorescent(Lamp::Fl2),
            "FL7" | "F7" => Self::Fluorescent(Lamp::Fl7),
            "FL11" | "F11" => Self::Fluorescent(Lamp::Fl11),
            _ => {
                let hundreds: u16 = name.strip_prefix('D')?.parse().ok()?;
                Self::Daylight(Daylight::of_temperature(f64::from(hundreds) * 100.0 * RESCALED)?)
            }
        })
    }

    /// Relative spectral power at `wavelength`, per nm.
    pub fn power(&self, wavelength: Wavelength) -> f64 {
        let nm = wavelength.nanometers();
        match *self {
            Self::E => 1.0,
            Self::A => {
                // ISO 11664-2: 100 (560/λ)⁵ (exp(c/560) − 1)/(exp(c/λ) − 1), c = 1.435e7/2848 nm.
                const C: f64 = 1.435e7 / 2848.0;
                100.0 * (560.0 / nm).powi(5) * libm::expm1(C / 560.0) / libm::expm1(C / nm)
            }
            Self::D65 => d65(wavelength),
            Self::Daylight(Daylight { m1, m2 }) => {
                let component = |i: usize| {
                    interpolate(&DAYLIGHT.map(|row| row[i]), SHORTEST.nanometers(), DAYLIGHT_STEP, wavelength)
                };
                component(0) + m1 * component(1) + m2 * component(2)
            }
            Self::BlackBody(kelvin) => {
                let reference = Wavelength::from_nanometers(560.0);
                100.0 * blackbody::radiance(wavelength, kelvin) / blackbody::radiance(reference, kelvin)
            }
            Self::Fluorescent(lamp) => {
                const FIRST: f64 = 380.0;
                const LAST: f64 = 780.0;
                // The tables end where the lamps no longer shine.
                if !(FIRST..=LAST).contains(&nm) {
                    return 0.0;
                }
                let table = match lamp {
                    Lamp::Fl2 => &FL2,
                    Lamp::Fl7 => &FL7,
                    Lamp::Fl11 => &FL11,
                };
                interpolate(table, FIRST, 5.0, wavelength)
            }
        }
    }
}

/// The table's value, its nearer end's outside of it.
fn interpolate(table: &[f64], first: f64, step: f64, wavelength: Wavelength) -> f64 {
    let last = table.len() - 1;
    let position = ((wavelength.nanometers() - first) / step).clamp(0.0, last as f64);
    let below = (position as usize).min(last - 1);
    let fraction = position - below as f64;
    table[below] + fraction * (table[below + 1] - table[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer::{chromaticity, tristimulus};

    fn nm(nanometers: f64) -> Wavelength {
        Wavelength::from_nanometers(nanometers)
    }

    #[test]
    fn the_table_is_hit_and_interpolated_linearly() {
        for (wavelength, power) in [(360.0, 46.6383), (560.0, 100.0), (760.0, 46.4182), (830.0, 60.3125)] {
            assert_eq!(d65(nm(wavelength)).to_bits(), f64::to_bits(power), "{wavelength} nm");
        }
        // Of the standard's table at 5 nm, which gives six digits.
        for (wavelength, power) in [(365.0, 49.3637), (455.0, 117.41), (595.0, 89.3459), (715.0, 67.9765)] {
            assert!((d65(nm(wavelength)) - power).abs() < 6e-5, "{wavelength} nm");
        }
        for (outside, end) in [(0.0, 360.0), (359.0, 360.0), (831.0, 830.0), (1e9, 830.0)] {
            assert_eq!(d65(nm(outside)).to_bits(), d65(nm(end)).to_bits(), "{outside} nm");
        }
    }

    #[test]
    fn chromaticities_are_those_of_the_standard() {
        // CIE 15:2018, table T.3 and T.8.1; five digits for A and D, four for lamps.
        for (name, x, y, digits) in [
            ("A", 0.44758, 0.40745, 5e-5),
            ("D50", 0.34567, 0.35851, 3e-5),
            ("D55", 0.33243, 0.34744, 3e-5),
            ("D65", 0.31272, 0.32903, 2e-5),
            ("D75", 0.29903, 0.31488, 3e-5),
            ("E", 0.33333, 0.33333, 5e-5),
            ("FL2", 0.3721, 0.3751, 2e-4),
            ("FL7", 0.3129, 0.3292, 2e-4),
            ("FL11", 0.3805, 0.3769, 3e-4),
        ] {
            let illuminant = Illuminant::named(name).unwrap();
            let [found_x, found_y] = chromaticity(tristimulus(|w| illuminant.power(w))).unwrap();
            assert!((found_x - x).abs() < digits && (found_y - y).abs() < digits, "{name}: {found_x}, {found_y}");
        }
    }

    #[test]
    fn black_bodies_have_the_colors_that_colour_science_finds() {
        // colour-science 0.4.7, summed over 360 to 830 nm; its c₂ of 1.4388e-2 m·K differs from CODATA's by 2e-6.
        for (kelvin, x, y) in [
            (1000.0, 0.652_752_97, 0.344_459_64),
            (2856.0, 0.447_538_64, 0.407_429_30),
            (6500.0, 0.313_527_51, 0.323_629_89),
            (20_000.0, 0.256_457_58, 0.257_631_32),
        ] {
            let [found_x, found_y] = chromaticity(tristimulus(|w| Illuminant::BlackBody(kelvin).power(w))).unwrap();
            assert!((found_x - x).abs() < 1e-5 && (found_y - y).abs() < 1e-5, "{kelvin}: {found_x}, {found_y}");
        }
    }

    #[test]
    fn daylight_of_6504_kelvin_is_d65() {
        let daylight = Illuminant::Daylight(Daylight::of_temperature(6504.0).unwrap());
        for step in 0..=470 {
            let wavelength = nm(360.0 + f64::from(step));
            let difference = (daylight.power(wavelength) - d65(wavelength)).abs();
            // Weights to three decimals of components up to 100: 5e-4 × 100.
            assert!(difference < 0.05, "{wavelength}: {difference}");
        }
    }

    #[test]
    fn no_daylight_where_the_cie_defines_none() {
        for kelvin in [3999.0, 25_001.0, f64::NAN, -1.0] {
            assert_eq!(Daylight::of_temperature(kelvin), None);
        }
        for name in ["", "D", "D1", "D999", "B", "FL3", "d65", "D6x"] {
            assert_eq!(Illuminant::named(name), None, "{name}");
        }
    }
}
