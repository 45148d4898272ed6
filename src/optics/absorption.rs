//! What a medium takes from the light that crosses it, by Beer and Lambert: T(λ, d) = exp(−σ(λ) d).
//!
//! σ is a coefficient per stage unit. It comes from the imaginary part k of the index, σ = 4πk/λ (M. Born, E. Wolf,
//! *Principles of Optics*, 7th ed. 1999, §14.1), from the internal transmittance τ of a plate of known thickness as glass
//! catalogues print it, σ = −ln τ / thickness, or from the colour that a shader states for a depth. k and plates are
//! physical and need the length of the stage unit; a shader's depth is in stage units already.

use crate::spectrum::uplift::{DARKEST, Transmittance};
use crate::spectrum::{LONGEST, REFERENCE, SHORTEST, Wavelength};

/// Longest table that is read: one entry each quarter of a nanometre from 360 to 830 nm; a limit on hostile files.
const MOST_ENTRIES: usize = 1 << 11;

/// Bound on k: silver in the infrared has 100. What is above is a number in another unit, most likely one per length.
const LARGEST_EXTINCTION: f64 = 1e3;

/// A curve of straight pieces through (nm, value), constant outside.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pieces {
    points: Vec<[f64; 2]>,
}

impl Pieces {
    /// Checks the wavelengths; `check` names what is wrong with a value.
    pub(super) fn new(points: &[[f64; 2]], check: impl Fn(f64) -> Option<String>) -> Result<Self, String> {
        if points.len() < 2 {
            return Err(format!("the table has {} entries, it needs two or more: (nm, value) each", points.len()));
        }
        if points.len() > MOST_ENTRIES {
            return Err(format!("the table has {} entries, at most {MOST_ENTRIES} are understood", points.len()));
        }
        for (i, &[nm, value]) in points.iter().enumerate() {
            if !(nm > 0.0 && nm.is_finite()) {
                return Err(format!("entry {i} is at {nm} nm: wavelengths are positive and finite"));
            }
            if i > 0 && nm <= points[i - 1][0] {
                return Err(format!(
                    "entry {i} is at {nm} nm after {} nm: author the wavelengths in increasing order",
                    points[i - 1][0]
                ));
            }
            if let Some(problem) = check(value) {
                return Err(format!("the value at {nm} nm is {value}: {problem}"));
            }
        }
        let (first, last) = (points[0][0], points[points.len() - 1][0]);
        if last < SHORTEST.nanometers() || first > LONGEST.nanometers() {
            return Err(format!(
                "the table goes from {first} to {last} nm and misses 360–830 nm: wavelengths are in nm, 1 µm is 1000"
            ));
        }
        Ok(Self { points: points.to_vec() })
    }

    pub(super) fn at(&self, wavelength: Wavelength) -> f64 {
        let nm = wavelength.nanometers();
        let above = self.points.partition_point(|point| point[0] <= nm);
        match (above.checked_sub(1).map(|below| self.points[below]), self.points.get(above)) {
            (Some([x0, y0]), Some(&[x1, y1])) => y0 + (nm - x0) / (x1 - x0) * (y1 - y0),
            (Some([_, y]), None) | (None, Some(&[_, y])) => y,
            (None, None) => unreachable!("a table has entries"),
        }
    }

    fn describe(&self) -> String {
        let (first, last) = (self.points[0][0], self.points[self.points.len() - 1][0]);
        format!("{} entries from {first} to {last} nm", self.points.len())
    }
}

/// The imaginary part k(λ) of a refractive index n + ik.
#[derive(Clone, Debug, PartialEq)]
pub struct Extinction {
    pieces: Pieces,
}

impl Extinction {
    /// From entries (nm, k ≥ 0) with increasing wavelengths, two or more, of which some lie about 360–830 nm.
    pub fn table(entries: &[[f64; 2]]) -> Result<Self, String> {
        let check = |k: f64| {
            let explain = || "k is a number from 0 to 1000 without unit; σ = 4πk/λ is the coefficient";
            (!(0.0..=LARGEST_EXTINCTION).contains(&k)).then(|| explain().to_owned())
        };
        Ok(Self { pieces: Pieces::new(entries, check)? })
    }

    /// k at `wavelength`: piecewise linear, outside of the table constant.
    pub fn at(&self, wavelength: Wavelength) -> f64 {
        self.pieces.at(wavelength)
    }

    /// How much data there is, in words.
    pub fn describe(&self) -> String {
        self.pieces.describe()
    }
}

/// The spectral absorption coefficient of a medium, per stage unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Absorption {
    source: Source,
}

#[derive(Clone, Debug, PartialEq)]
enum Source {
    Extinction {
        extinction: Extinction,
        meters_per_unit: f64,
    },
    /// −ln τ of the plate: straight pieces in the quantity that grows with thickness, so that plates of different
    /// thickness of one glass give one curve.
    Plate {
        depth: Pieces,
        thickness_mm: f64,
        /// Thicknesses in a stage unit.
        per_unit: f64,
    },
    Color {
        spectrum: Transmittance,
        rgb: [f64; 3],
        distance: f64,
    },
}

impl Absorption {
    /// σ = 4πk/λ of a medium in a stage whose unit is `meters_per_unit` metres long (positive and finite, as the scene
    /// builder makes sure).
    pub fn from_extinction(extinction: &Extinction, meters_per_unit: f64) -> Self {
        assert!(meters_per_unit > 0.0 && meters_per_unit.is_finite(), "metersPerUnit is {meters_per_unit}");
        Self { source: Source::Extinction { extinction: extinction.clone(), meters_per_unit } }
    }

    /// σ = −ln τ / thickness from entries (nm, τ) with 0 < τ ≤ 1, measured without reflection losses on a plate of
    /// `thickness_mm` millimetres.
    pub fn from_internal_transmittance(
        entries: &[[f64; 2]],
        thickness_mm: f64,
        meters_per_unit: f64,
    ) -> Result<Self, String> {
        if !(thickness_mm > 0.0 && thickness_mm.is_finite()) {
            return Err(format!("the thickness is {thickness_mm} mm: author a positive one, catalogues use 10 or 25"));
        }
        if !(meters_per_unit > 0.0 && meters_per_unit.is_finite()) {
            return Err(format!("metersPerUnit is {meters_per_unit}: it must be positive"));
        }
        let check = |tau: f64| {
            if tau > 1.0 && tau <= 100.0 {
                Some("a transmittance lies between 0 and 1: is it in percent?".to_owned())
            } else if tau > 0.0 && tau <= 1.0 {
                None
            } else {
                Some(
                    "a transmittance lies above 0 and not above 1: where nothing passes, author the least that was \
                     measurable, or a thinner plate's"
                        .to_owned(),
                )
            }
        };
        let mut depth = Pieces::new(entries, check)?;
        // Adding 0 makes the −0 of ln 1 a zero like any other.
        depth.points.iter_mut().for_each(|point| point[1] = 0.0 - libm::log(point[1]));
        let per_unit = meters_per_unit * 1e3 / thickness_mm;
        if !per_unit.is_finite() {
            return Err(format!("a stage unit of {meters_per_unit} m holds too many plates of {thickness_mm} mm"));
        }
        Ok(Self { source: Source::Plate { depth, thickness_mm, per_unit } })
    }

    /// The absorption under which light that has gone `distance` stage units has the colour `rgb` (linear Rec. 709, each
    /// channel in 0..=1): a [smooth spectrum](Transmittance::of_color).
    pub fn from_color(rgb: [f64; 3], distance: f64) -> Result<Self, String> {
        if !(distance > 0.0 && distance.is_finite()) {
            return Err(format!(
                "the colour is that at a depth of {distance}: author a positive one in stage units, or white for no \
                 absorption"
            ));
        }
        let spectrum = Transmittance::of_color(rgb)?;
        // The darkest spectrum has an optical depth of 2 ln 10⁴ = 18.4: only the division can overflow.
        if !(20.0 / distance).is_finite() {
            return Err(format!("the depth {distance} is too small to be divided by: author it in stage units"));
        }
        Ok(Self { source: Source::Color { spectrum, rgb, distance } })
    }

    /// σ ≥ 0 at `wavelength`, per stage unit.
    pub fn coefficient(&self, wavelength: Wavelength) -> f64 {
        match &self.source {
            Source::Extinction { extinction, meters_per_unit } => {
                let wavelength_m = wavelength.nanometers() * 1e-9;
                4.0 * std::f64::consts::PI * extinction.at(wavelength) * (meters_per_unit / wavelength_m)
            }
            Source::Plate { depth, per_unit, .. } => depth.at(wavelength) * per_unit,
            Source::Color { spectrum, distance, .. } => spectrum.optical_depth(wavelength) / distance,
        }
    }

    /// T = exp(−σd) of `distance` ≥ 0 stage units; infinitely far 0, or 1 where nothing is absorbed.
    pub fn transmittance(&self, wavelength: Wavelength, distance: f64) -> f64 {
        libm::exp(-optical_depth(self.coefficient(wavelength), distance))
    }

    /// What absorbs and how much, in one line.
    pub fn describe(&self) -> String {
        let what = match &self.source {
            Source::Extinction { extinction, .. } => format!("k(λ), {}", extinction.describe()),
            Source::Plate { depth, thickness_mm, .. } => {
                format!("internal transmittance of {thickness_mm} mm, {}", depth.describe())
            }
            Source::Color { rgb: [r, g, b], distance, .. } => {
                let floor = match [r, g, b].into_iter().any(|&channel| channel < DARKEST) {
                    true => format!(", channels at least {DARKEST:e}"),
                    false => String::new(),
                };
                format!("colour ({r}, {g}, {b}) at a depth of {distance}{floor}")
            }
        };
        format!("absorbs by {what} (σ = {:.6e} per stage unit at {REFERENCE})", self.coefficient(REFERENCE))
    }
}

/// σd, with 0 of an infinite way through a clear medium.
pub fn optical_depth(coefficient: f64, distance: f64) -> f64 {
    if coefficient == 0.0 { 0.0 } else { coefficient * distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::lines;

    fn nm(nanometers: f64) -> Wavelength {
        Wavelength::from_nanometers(nanometers)
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 8.0 * f64::EPSILON * b.abs()
    }

    #[test]
    fn extinction_is_straight_between_its_entries_and_constant_outside() {
        let k = Extinction::table(&[[400.0, 2.0], [500.0, 4.0], [700.0, 0.0]]).unwrap();
        for (wavelength, expected) in
            [(300.0, 2.0), (400.0, 2.0), (450.0, 3.0), (500.0, 4.0), (600.0, 2.0), (900.0, 0.0)]
        {
            assert!(close(k.at(nm(wavelength)), expected), "{wavelength} nm");
        }
    }

    #[test]
    fn the_coefficient_of_an_extinction_is_four_pi_k_over_lambda() {
        // Light at 500 nm in a medium with k = 1e-6: 4π·1e-6 / 500e-9 m = 25.13 per metre.
        let k = Extinction::table(&[[360.0, 1e-6], [830.0, 1e-6]]).unwrap();
        let per_meter = 8.0 * std::f64::consts::PI;
        for meters_per_unit in [1.0, 0.01, 0.001, 2.54e-2, 1e3] {
            let absorption = Absorption::from_extinction(&k, meters_per_unit);
            assert!(close(absorption.coefficient(nm(500.0)), per_meter * meters_per_unit), "{meters_per_unit}");
            // The same plate in every stage: 10 mm.
            let distance = 0.01 / meters_per_unit;
            assert!((absorption.transmittance(nm(500.0), distance) - (-0.01 * per_meter).exp()).abs() < 1e-15);
        }
    }

    #[test]
    fn a_plate_of_the_stated_thickness_has_the_stated_transmittance() {
        // SCHOTT N-BK7, data sheet: τᵢ at 10 mm.
        let plate = [[365.0, 0.988], [400.0, 0.997], [546.0, 0.998], [700.0, 0.998]];
        for meters_per_unit in [1.0, 0.01, 0.001] {
            let glass = Absorption::from_internal_transmittance(&plate, 10.0, meters_per_unit).unwrap();
            let distance = 0.01 / meters_per_unit;
            for [wavelength, tau] in plate {
                assert!(close(glass.transmittance(nm(wavelength), distance), tau));
                let thick = glass.transmittance(nm(wavelength), 2.5 * distance);
                assert!((thick - tau.powf(2.5)).abs() < 1e-15, "25 mm at {wavelength} nm");
            }
        }
    }

    #[test]
    fn plates_of_different_thickness_of_one_glass_are_one_glass() {
        let thin = [[400.0, 0.9], [500.0, 0.99], [700.0, 0.5]];
        let thick = thin.map(|[wavelength, tau]| [wavelength, tau * tau]);
        let a = Absorption::from_internal_transmittance(&thin, 5.0, 0.01).unwrap();
        let b = Absorption::from_internal_transmittance(&thick, 10.0, 0.01).unwrap();
        for wavelength in [360.0, 430.0, 555.0, 690.0, 830.0].map(nm) {
            assert!((a.coefficient(wavelength) / b.coefficient(wavelength) - 1.0).abs() < 1e-13, "{wavelength}");
        }
    }

    #[test]
    fn a_color_is_that_at_its_depth() {
        let rgb = [0.9, 0.5, 0.2];
        let spectrum = Transmittance::of_color(rgb).unwrap();
        let medium = Absorption::from_color(rgb, 2.5).unwrap();
        for wavelength in [400.0, 550.0, 700.0].map(nm) {
            assert!(close(medium.transmittance(wavelength, 2.5), spectrum.at(wavelength)));
            assert!(close(medium.transmittance(wavelength, 5.0), spectrum.at(wavelength).powi(2)));
        }
        let clear = Absorption::from_color([1.0; 3], 1.0).unwrap();
        assert_eq!(clear.coefficient(lines::D).to_bits(), 0.0f64.to_bits());
        assert_eq!(clear.transmittance(lines::D, 1e300).to_bits(), 1.0f64.to_bits());
    }

    #[test]
    fn ways_multiply_and_ends_are_exact() {
        let medium = Absorption::from_color([0.5; 3], 1.0).unwrap();
        let t = |distance| medium.transmittance(lines::D, distance);
        assert!(close(t(1.25) * t(0.5), t(1.75)));
        assert_eq!(t(0.0).to_bits(), 1.0f64.to_bits());
        assert_eq!(t(f64::INFINITY).to_bits(), 0.0f64.to_bits());
        let clear = Absorption::from_color([1.0; 3], 1.0).unwrap();
        assert_eq!(clear.transmittance(lines::D, f64::INFINITY).to_bits(), 1.0f64.to_bits());
    }

    #[test]
    fn tables_that_cannot_be_are_refused_with_a_remedy() {
        let long: Vec<_> = (0..4000).map(|i| [300.0 + 0.1 * f64::from(i), 0.0]).collect();
        let tables: [(&[[f64; 2]], &str); 10] = [
            (&[], "0 entries"),
            (&[[500.0, 0.1]], "1 entries"),
            (&[[500.0, 0.1], [400.0, 0.1]], "increasing order"),
            (&[[500.0, 0.1], [500.0, 0.2]], "increasing order"),
            (&[[0.4, 0.1], [0.7, 0.1]], "1 µm is 1000"),
            (&[[4e3, 0.1], [7e3, 0.1]], "misses 360–830 nm"),
            (&[[f64::NAN, 0.1], [500.0, 0.1]], "positive and finite"),
            (&[[-400.0, 0.1], [500.0, 0.1]], "positive and finite"),
            (&[[400.0, 0.1], [f64::INFINITY, 0.1]], "positive and finite"),
            (&long, "at most"),
        ];
        for (table, words) in tables {
            let error = Extinction::table(table).unwrap_err();
            assert!(error.contains(words), "{error}");
            let error = Absorption::from_internal_transmittance(table, 10.0, 0.01).unwrap_err();
            assert!(error.contains(words) || table.len() > 2, "{error}");
        }
        for k in [-1e-9, f64::NAN, f64::INFINITY, 1e4] {
            let error = Extinction::table(&[[400.0, 0.1], [500.0, k]]).unwrap_err();
            assert!(error.contains("500 nm") && error.contains("4πk/λ"), "{error}");
        }
        for (tau, words) in
            [(0.0, "least"), (-0.1, "above 0"), (99.9, "percent"), (1e3, "above 0"), (f64::NAN, "above 0")]
        {
            let error = Absorption::from_internal_transmittance(&[[400.0, 0.9], [500.0, tau]], 10.0, 0.01).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn lengths_that_cannot_be_are_refused_with_a_remedy() {
        let plate = [[400.0, 0.9], [700.0, 0.9]];
        for length in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let thickness = Absorption::from_internal_transmittance(&plate, length, 0.01).unwrap_err();
            assert!(thickness.contains("mm"), "{thickness}");
            let unit = Absorption::from_internal_transmittance(&plate, 10.0, length).unwrap_err();
            assert!(unit.contains("metersPerUnit"), "{unit}");
            let depth = Absorption::from_color([0.5; 3], length).unwrap_err();
            assert!(depth.contains("stage units"), "{depth}");
        }
        assert!(Absorption::from_internal_transmittance(&plate, 1e-300, 1e300).is_err());
        assert!(Absorption::from_color([0.5; 3], 1e-310).is_err());
        assert!(Absorption::from_color([0.5, 1.5, 0.5], 1.0).unwrap_err().contains("between 0 and 1"));
        // Whatever is let in gives a number.
        let extreme = Absorption::from_color([0.0, 1.0, 0.5], 1e-306).unwrap();
        assert!(extreme.coefficient(lines::D).is_finite());
        let dark = Absorption::from_extinction(&Extinction::table(&[[400.0, 1e3], [700.0, 1e3]]).unwrap(), 1e300);
        assert!(dark.coefficient(lines::D) > 0.0);
        assert_eq!(dark.transmittance(lines::D, 1.0).to_bits(), 0.0f64.to_bits());
    }

    #[test]
    fn what_absorbs_is_told() {
        let color = Absorption::from_color([0.5, 0.0, 1.0], 2.0).unwrap().describe();
        assert!(color.contains("colour (0.5, 0, 1) at a depth of 2, channels at least 1e-4"), "{color}");
        let plate = Absorption::from_internal_transmittance(&[[400.0, 0.9], [700.0, 0.9]], 10.0, 0.01).unwrap();
        assert!(plate.describe().contains("internal transmittance of 10 mm, 2 entries from 400 to 700 nm"));
        let k = Absorption::from_extinction(&Extinction::table(&[[400.0, 1e-6], [700.0, 0.0]]).unwrap(), 1.0);
        assert!(k.describe().contains("k(λ), 2 entries from 400 to 700 nm (σ = 8."), "{}", k.describe());
    }
}
