//! Wavelengths that a plan uses against the ranges in which the laws of its materials hold.

use crate::error::{Error, Result};
use crate::film::aov::Aov;
use crate::integrator::{Needs, Optics};
use crate::optics::dispersion::OutOfRange;
use crate::scene::Scene;
use crate::scene::material::Kind;
use crate::spectrum::Wavelength;

/// Layers that speak of the whole band, by the derivative at the reference wavelength.
const OVER_THE_BAND: &[&str] = &["dispersion_footprint", "footprint_half_width"];

/// Refuses a reference wavelength outside of a material's valid range: n and its derivatives there are what everything is
/// computed from. A material whose law must not be used outside (`abbe:dispersion:outOfRange = "error"`) is asked about
/// every wavelength, one whose law may be extrapolated about none.
pub(super) fn check(scene: &Scene, optics: &Optics, needs: &Needs, aovs: &[&Aov]) -> Result<()> {
    if !needs.chain {
        return Ok(());
    }
    let uses_band = aovs.iter().any(|aov| OVER_THE_BAND.contains(&aov.name));
    let reference =
        Use { what: "reference wavelength", attribute: "abbe:referenceWavelength", wavelength: optics.reference };
    let band = optics.band.map(|wavelength| Use { what: "band", attribute: "abbe:band", wavelength });
    let channels = optics.channels.map(|wavelength| Use {
        what: "colour channel",
        attribute: "abbe:channelWavelengths",
        wavelength,
    });
    for material in &scene.materials {
        let Kind::Dielectric { dispersion, thin_walled: false, .. } = &material.kind else { continue };
        let Some(range) = dispersion.valid_range() else { continue };
        let mut uses = vec![&reference];
        match dispersion.out_of_range() {
            OutOfRange::Extrapolate => continue,
            OutOfRange::Clamp => {}
            OutOfRange::Error => {
                uses.extend(band.iter().filter(|_| uses_band));
                uses.extend(channels.iter().filter(|_| needs.retrace));
            }
        }
        if let Some(Use { what, attribute, wavelength }) = uses.into_iter().find(|u| !range.contains(u.wavelength)) {
            return Err(Error::scene(
                format!("<{}>", material.path),
                format!(
                    "its index is valid from {range}, and the {what} is at {wavelength}: choose one inside ({attribute}), or \
                     author abbe:dispersion:outOfRange = \"extrapolate\" if the law may be trusted there"
                ),
            ));
        }
    }
    Ok(())
}

/// A wavelength and what sets it.
struct Use {
    what: &'static str,
    attribute: &'static str,
    wavelength: Wavelength,
}
