//! How many samples a pixel gets, when it gets no more, and how they are spread about it: request > product > settings > default.

use super::PlannedLayer;
use super::request::Request;
use super::settings::Attributes;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::{COLOR, VARIANCE};
use crate::film::{SampleRange, sum};
use crate::integrator::Integrator;
use crate::sampler::Sampler;
use crate::sampler::filter::{Filter, Shape};

/// Samples of light unless chosen.
const LIGHT_SAMPLES: u32 = 64;
/// Filter of light unless chosen.
const LIGHT_FILTER: Shape = Shape::BlackmanHarris;
/// Width of a filter of light unless chosen, pixels.
const LIGHT_FILTER_WIDTH: f64 = 3.0;

/// How a pixel is sampled.
pub(super) struct Sampling {
    pub(super) samples: SampleRange,
    pub(super) error_target: Option<f64>,
    pub(super) time_limit: Option<f64>,
    pub(super) clamp: Option<f64>,
    pub(super) filter: Filter,
}

impl Sampling {
    pub(super) fn new(
        request: &Request,
        attributes: &Attributes<'_>,
        integrator: &dyn Integrator,
        layers: &[PlannedLayer],
        diagnostics: &mut Diagnostics,
    ) -> Result<Self> {
        let samples = samples(request, attributes, integrator.transports_light())?;
        let error_target = error_target(request, attributes, layers, diagnostics)?;
        let (time_limit, place) = chosen(request.time_limit, "--time-limit", attributes, "abbe:timeLimit", "seconds")?;
        let (clamp, _) = positive(request.clamp, "--clamp", "a radiance")?;
        if request.sample_range.is_some() {
            // Parts merge to the whole only if every pixel has the same samples, whatever the machine.
            let refused = |place: &str, why: &str| {
                Err(Error::usage(
                    place,
                    format!("cannot go with --sample-range: {why}: split the image by --crop instead"),
                ))
            };
            if error_target.is_some() {
                return refused("--error-target", "a pixel decides by all of its samples");
            }
            if time_limit.is_some() {
                return refused(place, "parts would end with other samples");
            }
        }
        let filter = filter(request, attributes, integrator, diagnostics)?;
        Ok(Self { samples, error_target, time_limit, clamp, filter })
    }
}

fn samples(request: &Request, attributes: &Attributes<'_>, transports_light: bool) -> Result<SampleRange> {
    let total = match request.samples {
        Some(samples) => samples,
        None => match attributes.integer("abbe:samples")? {
            Some(samples) => u32::try_from(samples).unwrap_or(0),
            None if transports_light => LIGHT_SAMPLES,
            None => 1,
        },
    };
    Sampler::new(total, 0)?;
    match request.sample_range {
        None => Ok(SampleRange::all(total)),
        Some([begin, end]) if sum::is_aligned(begin, end, total) => Ok(SampleRange { begin, end, total }),
        Some([begin, end]) => Err(Error::usage(
            format!("--sample-range {begin}:{end}"),
            format!(
                "is not an aligned part of {total} samples: its length must be a power of two (or reach to the end) and \
                 its begin a multiple of it, so that parts merge to the same bits"
            ),
        )),
    }
}

/// The number of the request, else the stage's, `None` for 0; and what set it.
fn chosen<'a>(
    requested: Option<f64>,
    option: &'a str,
    attributes: &Attributes<'_>,
    attribute: &'a str,
    what: &str,
) -> Result<(Option<f64>, &'a str)> {
    match requested {
        Some(_) => positive(requested, option, what),
        None => positive(attributes.number(attribute)?, attribute, what),
    }
}

fn positive<'a>(value: Option<f64>, place: &'a str, what: &str) -> Result<(Option<f64>, &'a str)> {
    match value {
        Some(value) if !(value >= 0.0 && value.is_finite()) => {
            Err(Error::usage(place, format!("must be {what}, more than 0, or 0 for none, not {value}")))
        }
        value => Ok((value.filter(|value| *value > 0.0), place)),
    }
}

fn error_target(
    request: &Request,
    attributes: &Attributes<'_>,
    layers: &[PlannedLayer],
    diagnostics: &mut Diagnostics,
) -> Result<Option<f64>> {
    let what = "a relative error";
    let (target, place) = chosen(request.error_target, "--error-target", attributes, "abbe:errorTarget", what)?;
    if target.is_none() || layers.iter().any(|layer| matches!(layer.aov.name, COLOR | VARIANCE)) {
        return Ok(target);
    }
    let problem = "is of the layer color, which is not rendered: every pixel gets all its samples";
    if request.error_target.is_some() {
        return Err(Error::usage(
            place,
            "is of the layer color, which is not rendered: ask for color too, or leave it out",
        ));
    }
    diagnostics.warn("unused-setting", format!("render settings, {place}"), problem);
    Ok(None)
}

fn filter(
    request: &Request,
    attributes: &Attributes<'_>,
    integrator: &dyn Integrator,
    diagnostics: &mut Diagnostics,
) -> Result<Filter> {
    let (place, token) = match &request.pixel_filter {
        Some(token) => ("--pixel-filter", Some(token.clone())),
        None => ("abbe:pixelFilter", attributes.text("abbe:pixelFilter")?),
    };
    let width = match request.pixel_filter_width {
        Some(width) => Some(width),
        None => attributes.number("abbe:pixelFilterWidth")?,
    };
    if !integrator.transports_light() {
        // Derivatives are those of the pixel itself: a wider filter would mix what it is meant to tell apart.
        if token.as_deref().is_some_and(|token| token != "box") {
            diagnostics.warn(
                "unused-setting",
                place,
                format!(
                    "is {}, but the integrator '{}' takes the mean over the pixel itself",
                    token.unwrap_or_default(),
                    integrator.name()
                ),
            );
        }
        return Ok(Filter::default());
    }
    let shape = match token.filter(|token| !token.is_empty()) {
        None => LIGHT_FILTER,
        Some(token) => Shape::from_token(&token).ok_or_else(|| {
            Error::usage(
                place,
                format!(
                    "'{token}' is no filter here: choose {} (those with negative lobes are not offered: every sample has weight 1)",
                    Shape::TOKENS.join(", ")
                ),
            )
        })?,
    };
    let default = if shape == Shape::Box { 1.0 } else { LIGHT_FILTER_WIDTH };
    Filter::new(shape, width.unwrap_or(default))
}
