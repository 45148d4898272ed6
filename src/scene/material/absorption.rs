//! How the inside of a glass absorbs: by what is measured of it, or by the colour that its shader gives it at a depth.
//!
//! First match wins: our `abbe:extinction:table` and `abbe:internalTransmittance:table`, which are physical lengths; what
//! the shader states, whose depth is in stage units.

use super::Context;
use super::dialect::Surface;
use super::law::{Authored, StatedAbsorption};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::{Absorption, Extinction};

/// The absorption of a transmissive surface's inside with where it comes from; `None` where it is clear.
pub(super) fn absorption(
    surface: &Surface<'_>,
    authored: &Authored<'_>,
    thin_walled: bool,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<Option<(Absorption, String)>> {
    let measured = authored.absorption(diagnostics)?;
    if thin_walled {
        if let Some(stated) = measured {
            diagnostics.warn(
                "idle-absorption",
                stated.place(),
                "a thin wall has no inside that could absorb: author a closed, thick glass",
            );
        }
        return Ok(None);
    }
    if let Some(stated) = measured {
        return of_table(&stated, context).map(Some);
    }
    let Some(stated) = surface.attenuation(context, diagnostics)? else { return Ok(None) };
    let absorption =
        Absorption::from_color(stated.color, stated.distance).map_err(|e| Error::scene(&stated.place, e))?;
    Ok(Some((absorption, stated.place)))
}

fn of_table(stated: &StatedAbsorption, context: &Context) -> Result<(Absorption, String)> {
    let absorption = match stated {
        StatedAbsorption::Extinction { entries, .. } => Extinction::table(entries)
            .map(|extinction| Absorption::from_extinction(&extinction, context.meters_per_unit)),
        StatedAbsorption::InternalTransmittance { entries, thickness_mm, .. } => {
            Absorption::from_internal_transmittance(entries, *thickness_mm, context.meters_per_unit)
        }
    };
    let absorption = absorption.map_err(|problem| Error::scene(stated.place(), problem))?;
    Ok((absorption, stated.place().to_owned()))
}
