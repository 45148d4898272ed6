//! The layers of a product: which AOV, under what name, stored in how many bits.
//!
//! Names and types are those of the RenderVars (`driver:parameters:aov:name`, `channel_prefix`, `format`, else the prim's
//! name and `dataType`); what a variable asks for and nobody can give is named in a warning.

use serde::Serialize;

use super::request::Request;
use super::settings::Attributes;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::aov::{self, Aov, Family, SampleType};
use crate::film::spectral::{self, Bins};
use crate::integrator::Registry;
use crate::integrator::light_path::Expression;
use crate::scene::description::{Product, Var};

/// What `differentials` writes when nobody says what to write.
const DEFAULT_AOVS: &[&str] = &[
    "dispersion",
    "dispersion_footprint",
    "ddirection_dlambda",
    "dposition_dlambda",
    "ior",
    "interfaces",
    "depth",
    "normal",
    "position",
    "refracted_position",
    "prim_id",
    "material_id",
];

/// The beauty, whose channels stand bare.
const BEAUTY: &str = aov::COLOR;

/// Band of spectral bins unless chosen, nm: what displays and eyes look at.
const SPECTRAL_BAND: [f64; 2] = [400.0, 700.0];
/// Width of a spectral bin unless chosen, nm.
const SPECTRAL_WIDTH: f64 = 10.0;

/// Parameters of a RenderVar's driver that are understood, with those that have no meaning here by their usual value.
const VAR_PARAMETERS: &[&str] = &["name", "format", "channel_prefix", "clearValue", "multiSampled"];

/// One layer to be rendered.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedLayer {
    /// Its AOV.
    #[serde(serialize_with = "aov_name")]
    pub aov: &'static Aov,
    /// EXR layer name; empty for bare channels.
    pub name: String,
    /// What the AOV is told with its name.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub argument: String,
    /// Stored in 16 bits.
    pub half: bool,
}

fn aov_name<S: serde::Serializer>(aov: &&'static Aov, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(aov.name)
}

impl PlannedLayer {
    fn plain(aov: &'static Aov) -> Self {
        let name = layer_name(aov.name, aov.name, "");
        Self { aov, name, argument: String::new(), half: aov.is_half_by_default() }
    }
}

/// `prefix` and `name`; the beauty under one of its own names has bare channels.
fn layer_name(aov: &str, name: &str, prefix: &str) -> String {
    if aov == BEAUTY && prefix.is_empty() && aov::canonical_name(name) == BEAUTY {
        return String::new();
    }
    format!("{prefix}{name}")
}

/// The integrator and the layers of `product`.
pub(super) fn layers(
    request: &Request,
    attributes: &Attributes<'_>,
    product: Option<&Product>,
    registry: &Registry,
    diagnostics: &mut Diagnostics,
) -> Result<(String, Vec<PlannedLayer>)> {
    let chosen = match &request.integrator {
        Some(name) => name.clone(),
        None => match attributes.text("abbe:integrator")?.filter(|name| !name.is_empty()) {
            Some(name) => name,
            None => default_integrator(request, product).to_owned(),
        },
    };
    let integrator = registry.find(&chosen)?;
    let offered = integrator.aovs();
    let find = |name: &str| {
        let canonical = aov::canonical_name(name);
        offered.iter().copied().find(|aov| aov.name == canonical)
    };
    let unavailable = |name: &str| match aov::find(name) {
        Some(_) => format!("the integrator '{chosen}' has no '{name}'"),
        None => format!("the integrator '{chosen}' has no AOV '{name}'; `abbe aovs` lists what there is"),
    };
    let mut layers: Vec<PlannedLayer> = Vec::new();
    if let Some(names) = &request.aovs {
        for text in names {
            let asked = Asked::of(text);
            let place = format!("--aov {text}");
            let aov = find(asked.aov).ok_or_else(|| Error::usage(&place, unavailable(asked.aov)))?;
            let mut layer = asked.layer(aov, names.len() == 1).map_err(|problem| Error::usage(&place, problem))?;
            if layers.iter().any(|known| known.aov.name == layer.aov.name && known.argument == layer.argument) {
                continue;
            }
            if asked.name.is_none() && !layer.argument.is_empty() {
                layer.name = unused_name(&layers, layer.name);
            }
            if layers.iter().any(|known| known.name == layer.name) {
                return Err(Error::usage(
                    place,
                    format!("the layer '{}' is asked for twice: give it another NAME=", layer.name),
                ));
            }
            layers.push(layer);
        }
        if layers.is_empty() {
            return Err(Error::usage("--aov", "no AOV is asked for: name one, or leave the option out"));
        }
        return Ok((chosen, layers));
    }
    for var in product.map_or(&[][..], |p| &p.vars) {
        let asked = match source(var) {
            Ok(asked) => asked,
            Err(problem) => {
                diagnostics.warn("unavailable-render-var", &var.path, format!("{problem}: it is left out"));
                continue;
            }
        };
        let Some(aov) = find(asked.aov) else {
            let problem = match asked.aov {
                aov::LPE => format!(
                    "asks for the light path expression '{}', which needs light transport that tells paths apart: '{chosen}' \
                     does not",
                    asked.argument
                ),
                name => unavailable(name),
            };
            diagnostics.warn("unavailable-render-var", &var.path, format!("{problem}: it is left out"));
            continue;
        };
        let is_alone = product.is_some_and(|p| p.vars.len() == 1);
        let PlannedLayer { aov, name: usual, argument, .. } = match asked.layer(aov, is_alone) {
            Ok(layer) => layer,
            Err(problem) => {
                diagnostics.warn("unavailable-render-var", &var.path, format!("{problem}: it is left out"));
                continue;
            }
        };
        let name = match text(var, "name") {
            // A file of spectra alone is one of their layout, however its variable is called.
            "" if usual == spectral::EMISSION => spectral::EMISSION,
            "" => var.name.as_str(),
            name => name,
        };
        let name = layer_name(aov.name, name, text(var, "channel_prefix"));
        warn_of_parameters(var, aov, diagnostics);
        let half = is_half(var, aov, diagnostics);
        if let Some(other) = layers.iter().find(|layer| layer.name == name) {
            return Err(Error::scene(
                &var.path,
                format!(
                    "its layer '{name}' is also that of '{}': give it another driver:parameters:aov:name",
                    other.aov.name
                ),
            ));
        }
        let aov = if argument.is_empty() { aov } else { with_bins(aov, &argument, &name) };
        layers.push(PlannedLayer { aov, name, argument, half });
    }
    if layers.is_empty() {
        let default = if integrator.transports_light() { &[BEAUTY][..] } else { DEFAULT_AOVS };
        layers = default.iter().filter_map(|name| find(name)).map(PlannedLayer::plain).collect();
        if layers.is_empty() {
            let plain = offered.into_iter().filter(|aov| aov::argument(aov).is_none());
            layers = plain.map(PlannedLayer::plain).collect();
        }
    }
    Ok((chosen, layers))
}

/// An AOV as it is asked for: `[NAME=]AOV[:ARGUMENT]`.
struct Asked<'a> {
    /// The layer's name, if it is told.
    name: Option<&'a str>,
    aov: &'a str,
    argument: std::borrow::Cow<'a, str>,
}

impl<'a> Asked<'a> {
    fn of(text: &'a str) -> Self {
        let (name, rest) = match text.split_once('=') {
            Some((name, rest)) if !name.contains(':') => (Some(name), rest),
            _ => (None, text),
        };
        let (aov, argument) = rest.split_once(':').unwrap_or((rest, ""));
        Self { name, aov, argument: argument.into() }
    }

    /// Takes the bins that a variable has as attributes of its own, if it asks for bins.
    fn take_bins(&mut self, var: &Var) {
        if aov::canonical_name(self.aov) == aov::SPECTRAL && self.argument.is_empty() {
            let numbers = |name: &str| match var.abbe.get(name).map(|a| &a.value) {
                Some(serde_json::Value::Array(list)) => list.iter().filter_map(serde_json::Value::as_f64).collect(),
                Some(value) => value.as_f64().into_iter().collect(),
                None => Vec::new(),
            };
            let band = <[f64; 2]>::try_from(numbers("abbe:spectral:band")).ok();
            let [low, high] = band.filter(|[low, high]| low < high).unwrap_or(SPECTRAL_BAND);
            let width = numbers("abbe:spectral:binWidth").first().copied().unwrap_or(SPECTRAL_WIDTH);
            self.argument = format!("{low}:{high}:{width}").into();
        }
    }

    /// The layer of `aov`; one of spectra `is_alone` in its file is called as their layout has it.
    fn layer(&self, aov: &'static Aov, is_alone: bool) -> Result<PlannedLayer, String> {
        let plain = PlannedLayer::plain(aov);
        let argument = match (aov::argument(aov), &*self.argument) {
            (None, "") => String::new(),
            (None, argument) => return Err(format!("'{}' takes no argument, and ':{argument}' is one", aov.name)),
            (Some(_), "") if aov.name == aov::SPECTRAL => {
                let [low, high] = SPECTRAL_BAND;
                format!("{low}:{high}:{SPECTRAL_WIDTH}")
            }
            (Some(wanted), "") => return Err(format!("'{0}' needs an argument: {0}:ARGUMENT, {wanted}", aov.name)),
            (Some(_), argument) => argument.to_owned(),
        };
        match aov.name {
            aov::SPECTRAL => {
                Bins::parse(&argument).map_err(|error| error.to_string())?;
            }
            aov::LIGHT_GROUP | aov::LPE => {
                Expression::of_aov(aov.name, &argument)?;
            }
            _ => {}
        }
        let name = match (self.name, aov.name) {
            (Some(name), _) => layer_name(aov.name, name, ""),
            (None, aov::SPECTRAL) if is_alone => spectral::EMISSION.to_owned(),
            (None, aov::LIGHT_GROUP) => format!("{}_{}", aov.name, plain_letters(&argument)),
            (None, _) => plain.name,
        };
        let aov = with_bins(aov, &argument, &name);
        Ok(PlannedLayer { aov, name, argument, ..plain })
    }
}

/// The row of `aov` with the channels of its bins, if it has some.
fn with_bins(aov: &'static Aov, argument: &str, name: &str) -> &'static Aov {
    match (aov.name, Bins::parse(argument)) {
        (aov::SPECTRAL, Ok(bins)) => bins.row(name),
        _ => aov,
    }
}

/// `text` with an underscore for everything that no layer's name should have.
fn plain_letters(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// `wanted`, or the first of `wanted_2`, `wanted_3` … that no layer has.
fn unused_name(layers: &[PlannedLayer], wanted: String) -> String {
    let is_free = |name: &str| layers.iter().all(|layer| layer.name != name);
    if is_free(&wanted) {
        return wanted;
    }
    let mut names = (2..).map(|i| format!("{wanted}_{i}"));
    names.find(|name| is_free(name)).expect("there are fewer layers than numbers")
}

/// The integrator that nobody chose: with light transport if some AOV asks for light.
fn default_integrator(request: &Request, product: Option<&Product>) -> &'static str {
    let is_light = |name: &str| aov::find(name).is_some_and(|aov| aov.family == Family::Transport);
    let asks = match &request.aovs {
        Some(names) => names.iter().any(|name| is_light(Asked::of(name).aov)),
        None => product.is_some_and(|p| p.vars.iter().any(|var| source(var).is_ok_and(|asked| is_light(asked.aov)))),
    };
    if asks { "path" } else { "differentials" }
}

fn text<'a>(var: &'a Var, name: &str) -> &'a str {
    var.driver.get(name).and_then(|a| a.value.as_str()).unwrap_or("")
}

/// The AOV that a variable asks for, or why it asks for none. Hydra's prefixes say what `sourceType` says too.
fn source(var: &Var) -> Result<Asked<'_>, String> {
    let name = if var.source_name.is_empty() { &var.name } else { &var.source_name };
    let (kind, name) = match name.split_once(':') {
        Some(("primvars", rest)) => ("primvar", rest),
        Some(("lpe", rest)) => ("lpe", rest),
        _ => (var.source_type.as_str(), name.as_str()),
    };
    let mut asked = match kind {
        "primvar" => match aov::canonical_name(name) {
            "uv" => Asked::of("uv"),
            "normals" | "normal" => Asked::of("normal"),
            _ => {
                return Err(format!(
                    "asks for the primvar '{name}', and of primvars only texture coordinates (st) and normals are written"
                ));
            }
        },
        "lpe" if aov::canonical_name(name) == BEAUTY => Asked::of(BEAUTY),
        "lpe" => Asked { name: None, aov: aov::LPE, argument: name.into() },
        _ => Asked { name: None, ..Asked::of(name) },
    };
    asked.take_bins(var);
    Ok(asked)
}

/// Whether a layer is stored in half floats, as its variable asks for by `format`, else by `dataType`.
fn is_half(var: &Var, aov: &Aov, diagnostics: &mut Diagnostics) -> bool {
    let format = match text(var, "format") {
        "auto" => "",
        format => format,
    };
    let asked = if format.is_empty() { var.data_type.as_str() } else { format };
    let base = asked.trim_end_matches("[]").trim_end_matches(|c: char| c.is_ascii_digit());
    let wants_half = base == "half" || asked.ends_with('h') || asked == "float16";
    let is_integer = ["int", "uint"].iter().any(|token| base.starts_with(token));
    let mut refuse = |kind: &str, why: &str| diagnostics.warn(kind, &var.path, why);
    match aov.sample {
        SampleType::Uint => {
            if !format.is_empty() && !is_integer {
                refuse("uint-format", "asks for floats, which would round identifiers and counts: UINT is written");
            }
            false
        }
        SampleType::Float if wants_half && aov.is_sound_in_half() => true,
        // `dataType` alone does not tell: color3f is what the schema says where nobody says anything.
        SampleType::Float if format.is_empty() && aov.is_half_by_default() => true,
        SampleType::Float => {
            if wants_half {
                refuse("half-format", "asks for half floats, which lose what a derivative is for: FLOAT is written");
            } else if !format.is_empty() && is_integer {
                refuse("int-format", "asks for integers, and its values are none: FLOAT is written");
            }
            false
        }
    }
}

/// Parameters of the driver that change nothing here are named where they would have changed something elsewhere.
fn warn_of_parameters(var: &Var, aov: &Aov, diagnostics: &mut Diagnostics) {
    let number = |name: &str| var.driver.get(name).map(|a| a.value.as_f64().or(a.value.as_bool().map(f64::from)));
    if number("clearValue").is_some_and(|value| value != Some(0.0)) {
        diagnostics.warn(
            "unused-aov-parameter",
            &var.path,
            "clearValue is not written: absent values are 0, and <layer>.valid tells where they are",
        );
    }
    if number("multiSampled") == Some(Some(1.0)) && aov.sample == SampleType::Uint {
        diagnostics.warn(
            "unused-aov-parameter",
            &var.path,
            "multiSampled has no effect: identifiers and counts are those of the first sample",
        );
    }
    for name in var.driver.keys().filter(|name| !VAR_PARAMETERS.contains(&name.as_str())) {
        diagnostics.warn(
            "unused-aov-parameter",
            &var.path,
            format!("driver:parameters:aov:{name} has no effect here: it is another renderer's"),
        );
    }
}
