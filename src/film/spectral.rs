//! Layers of spectral bins: the mean radiance per nm in equal pieces of a band, one channel each.
//!
//! Two layouts: channels `w405`, `w415` … of a layer beside others, named by the middles of the bins in nm (`p` for the decimal point), since
//! names of letters and digits survive everywhere; and that of A. Fichet, R. Pacanowski, A. Wilkie, "An OpenEXR layout for
//! spectral images", JCGT 10(3), 2021: `S0.405,000000nm`, for files of their own.

use std::sync::Mutex;

use super::aov::{self, Aov};
use crate::error::{Error, Result};
use crate::spectrum::{LONGEST, SHORTEST, SampledSpectrum, Wavelengths};

/// The layer name of Fichet et al.'s unpolarised emission; a layer that is called so has their channels.
pub const EMISSION: &str = "S0";

/// The narrowest bin, nm: the observer's own step.
const NARROWEST: f64 = 1.0;

/// Equal pieces of a band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bins {
    first: f64,
    width: f64,
    count: usize,
}

impl Bins {
    /// Pieces of `width` nm of the band from `low` to `high` nm, which must be a whole number of them within 360–830 nm.
    pub fn new(low: f64, high: f64, width: f64) -> Result<Self> {
        let place = format!("spectral {low}:{high}:{width}");
        if !(SHORTEST.nanometers() <= low && low < high && high <= LONGEST.nanometers()) {
            return Err(Error::usage(place, "the band must lie within 360 and 830 nm, the lower end first"));
        }
        if !(width >= NARROWEST && width <= high - low) {
            return Err(Error::usage(
                place,
                format!("bins must be {NARROWEST} nm to the whole band wide, not {width}"),
            ));
        }
        let count = ((high - low) / width).round();
        // Ends that were computed are off by their rounding only.
        if (count * width - (high - low)).abs() > 1e-6 {
            return Err(Error::usage(place, format!("{} nm are no whole number of bins of {width} nm", high - low)));
        }
        Ok(Self { first: low, width, count: count as usize })
    }

    /// Of the text `LO:HI:WIDTH`.
    pub fn parse(text: &str) -> Result<Self> {
        let numbers: Option<Vec<f64>> = text.split(':').map(|part| part.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[low, high, width]) => Self::new(low, high, width),
            _ => Err(Error::usage(format!("spectral {text}"), "is not of the form LO:HI:WIDTH, in nm")),
        }
    }

    /// The text that [`parse`](Self::parse) reads.
    pub fn text(&self) -> String {
        format!("{}:{}:{}", self.first, self.first + self.count as f64 * self.width, self.width)
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The middle of a bin, nm.
    pub fn middle(&self, bin: usize) -> f64 {
        self.first + (bin as f64 + 0.5) * self.width
    }

    /// Adds the estimate of each bin's mean radiance per nm to `out`.
    #[inline]
    pub fn estimate<const N: usize>(
        &self,
        radiance: SampledSpectrum<N>,
        wavelengths: &Wavelengths<N>,
        out: &mut [f64],
    ) {
        let pdf_lambda = wavelengths.pdf_lambda();
        for lane in 0..N {
            let place = (wavelengths.nanometers()[lane] - self.first) / self.width;
            if place >= 0.0 && (place as usize) < self.count && radiance[lane] != 0.0 {
                out[place as usize] +=
                    f64::from(radiance[lane]) / (f64::from(pdf_lambda[lane]) * self.width * N as f64);
            }
        }
    }

    fn channel(&self, bin: usize, layer: &str) -> String {
        let middle = self.middle(bin);
        if layer == EMISSION {
            return format!("{middle:.6}nm").replace('.', ",");
        }
        // Six decimals at most, without trailing zeros.
        let text = format!("{middle:.6}");
        format!("w{}", text.trim_end_matches('0').trim_end_matches('.').replace('.', "p"))
    }

    /// The row of the AOV table for a layer called `layer` of these bins.
    ///
    /// Rows are made when first asked for and kept for the life of the process, as those of the table are.
    pub fn row(&self, layer: &str) -> &'static Aov {
        static ROWS: Mutex<Vec<(Bins, bool, &'static Aov)>> = Mutex::new(Vec::new());
        let is_emission = layer == EMISSION;
        let mut rows = ROWS.lock().expect("nobody panics while holding the rows");
        if let Some((.., row)) = rows.iter().find(|(bins, layout, _)| bins == self && *layout == is_emission) {
            return row;
        }
        let names: Vec<&'static str> =
            (0..self.count).map(|bin| &*Box::leak(self.channel(bin, layer).into_boxed_str())).collect();
        let general = aov::find(aov::SPECTRAL).expect("in the table");
        let row: &'static Aov = Box::leak(Box::new(Aov { channels: Box::leak(names.into_boxed_slice()), ..*general }));
        rows.push((*self, is_emission, row));
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::visible;

    #[test]
    fn channels_are_named_by_the_middles() {
        let bins = Bins::parse("400:700:100").unwrap();
        assert_eq!(bins.row("spectral").channels, ["w450", "w550", "w650"]);
        assert_eq!(bins.row("S0").channels, ["450,000000nm", "550,000000nm", "650,000000nm"]);
        assert!(std::ptr::eq(bins.row("spectral"), Bins::new(400.0, 700.0, 100.0).unwrap().row("other")));
        assert_eq!(Bins::parse("400:405:2.5").unwrap().row("spectral").channels, ["w401p25", "w403p75"]);
        assert_eq!(Bins::parse(&bins.text()).unwrap(), bins);
    }

    #[test]
    fn impossible_bins_are_refused() {
        for text in [
            "",
            "400:700",
            "700:400:10",
            "300:700:10",
            "400:900:10",
            "400:700:0.5",
            "400:705:10",
            "a:b:c",
            "400:700:nan",
        ] {
            assert!(Bins::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn bins_have_the_means_of_the_spectrum_and_its_integral() {
        let bins = Bins::parse("360:830:10").unwrap();
        let mut sums = vec![0.0; bins.count()];
        // Odd, so that the four wavelengths fall on different places: 1700 in the bins at the ends, which get the fewest, and one more or
        // less of them is 6e-4.
        let count = 400_001;
        for i in 0..count {
            let wavelengths = visible::sample::<4>((f64::from(i) + 0.5) / f64::from(count));
            let radiance = SampledSpectrum::from_fn(|lane| wavelengths.nanometers()[lane] as f32 * 1e-3);
            bins.estimate(radiance, &wavelengths, &mut sums);
        }
        for (bin, sum) in sums.iter().enumerate() {
            let mean = sum / f64::from(count);
            assert!((mean / (bins.middle(bin) * 1e-3) - 1.0).abs() < 2e-3, "{bin}: {mean}");
        }
    }
}
