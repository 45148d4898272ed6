//! How the inside of a glass absorbs: what the shader states of its colour at a depth.

use super::Context;
use super::dialect::Surface;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::optics::Absorption;

/// The absorption of a transmissive surface's inside with where it comes from; `None` where it is clear.
pub(super) fn absorption(
    surface: &Surface<'_>,
    context: &Context,
    diagnostics: &mut Diagnostics,
) -> Result<Option<(Absorption, String)>> {
    let Some(stated) = surface.attenuation(context, diagnostics)? else { return Ok(None) };
    let absorption =
        Absorption::from_color(stated.color, stated.distance).map_err(|e| Error::scene(&stated.place, e))?;
    Ok(Some((absorption, stated.place)))
}
