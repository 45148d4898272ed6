//! Where a law holds, and what becomes of wavelengths outside.

use crate::spectrum::{LONGEST, SHORTEST, Wavelength};

/// Wavelengths in print reach from vacuum ultraviolet (100 nm) to the far infrared (some 20 µm for glasses and salts):
/// a number below this is taken for micrometres where nanometres are wanted.
pub(super) const LOOKS_LIKE_MICROMETERS: f64 = 20.0;

/// The wavelengths for which a law was measured or fitted, ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValidRange {
    /// The shortest.
    pub from: Wavelength,
    /// The longest.
    pub to: Wavelength,
}

impl ValidRange {
    /// Whether `wavelength` lies inside.
    pub fn contains(&self, wavelength: Wavelength) -> bool {
        self.from <= wavelength && wavelength <= self.to
    }

    /// Whether all of 360–830 nm does.
    pub fn contains_the_visible(&self) -> bool {
        self.contains(SHORTEST) && self.contains(LONGEST)
    }

    /// The nearest wavelength inside.
    pub(super) fn clamp(&self, wavelength: Wavelength) -> Wavelength {
        match wavelength {
            w if w < self.from => self.from,
            w if w > self.to => self.to,
            w => w,
        }
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let ends = [self.from.nanometers(), self.to.nanometers()];
        if let Some(end) = ends.iter().find(|end| !end.is_finite()) {
            return Err(format!("the valid range ends at {end} nm, which is no finite number"));
        }
        refuse_micrometers("the valid range", ends.into_iter())?;
        if !(ends[0] > 0.0 && ends[0] < ends[1]) {
            return Err(format!("the valid range is {self}: give two positive wavelengths in nm, the shorter first"));
        }
        Ok(())
    }
}

impl std::fmt::Display for ValidRange {
    /// `310 to 2500 nm`
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} to {}", self.from.nanometers(), self.to)
    }
}

/// What becomes of wavelengths outside of a law's valid range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutOfRange {
    /// The index of the nearest end, with derivatives that are 0.
    #[default]
    Clamp,
    /// They must not be asked for: renders that need them are refused.
    Error,
    /// The law is used as it stands.
    Extrapolate,
}

impl OutOfRange {
    /// The name that stages and scripts write.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clamp => "clamp",
            Self::Error => "error",
            Self::Extrapolate => "extrapolate",
        }
    }

    /// The setting of this name.
    pub fn parse(text: &str) -> Option<Self> {
        [Self::Clamp, Self::Error, Self::Extrapolate].into_iter().find(|setting| setting.name() == text)
    }
}

/// Refuses positive wavelengths that are all so short that they must be micrometres.
pub(super) fn refuse_micrometers(what: &str, mut wavelengths: impl Iterator<Item = f64>) -> Result<(), String> {
    let Some(first) = wavelengths.next() else { return Ok(()) };
    let looks = |nm: f64| nm > 0.0 && nm < LOOKS_LIKE_MICROMETERS;
    if looks(first) && wavelengths.all(looks) {
        return Err(format!(
            "{what} has wavelengths that look like µm ({first}): nm are wanted, multiply them by 1000"
        ));
    }
    Ok(())
}
