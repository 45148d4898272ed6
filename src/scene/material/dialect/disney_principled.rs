//! The Disney Principled BSDF as a MaterialX node.
//!
//! Names, defaults and formulas: MaterialX 1.39 `disney_principled.mtlx`. It states no dispersion and no absorption, has
//! no opacity, and its transmission lobe is smooth whatever the roughness, which is the reflection's.

use crate::diagnostics::Diagnostics;
use crate::error::Result;

use super::Dialect;
#[cfg(test)]
use super::inputs::Declared;
use super::inputs::{Inputs, Number, input};
use super::layered::{self, Lobe};
use super::vocabulary::{Glass, Response};

const METALLIC: Number = input("metallic", 0.0);
const TRANSMISSION: Number = input("specTrans", 0.0);
const ROUGHNESS: Number = input("roughness", 0.5);
const IOR: Number = input("ior", 1.5);

pub(super) struct DisneyPrincipled;

impl Dialect for DisneyPrincipled {
    fn ids(&self) -> &'static [&'static str] {
        &["ND_disney_principled"]
    }

    #[cfg(test)]
    fn inputs(&self) -> &'static [Declared] {
        &[
            Declared::Number(METALLIC),
            Declared::Number(TRANSMISSION),
            Declared::Number(ROUGHNESS),
            Declared::Number(IOR),
        ]
    }

    fn response(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Response> {
        layered::layered(
            inputs,
            inputs.weight(TRANSMISSION, diagnostics)?,
            inputs.metalness(METALLIC)?,
            |_| Ok(Lobe { rough: false, thin_walled: false }),
            |diagnostics| inputs.is_rough(ROUGHNESS, diagnostics),
            diagnostics,
        )
    }

    fn glass(&self, inputs: &Inputs<'_>, diagnostics: &mut Diagnostics) -> Result<Glass> {
        layered::glass(inputs, IOR, None, diagnostics)
    }
}
