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

/// Parameters of a RenderVar's driver that are understood, with those that have no meaning here by their usual value.
const VAR_PARAMETERS: &[&str] = &["name", "format", "channel_prefix", "clearValue", "multiSampled"];

/// One layer to be rendered.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedLayer {
    /// Its AOV.
    #[serde(serialize_with = "aov_name")]
    pub aov: &'static Aov,
    /// What the AOV asks for besides, a light group or a light path expression; empty if nothing.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub argument: String,
    /// EXR layer name; empty for bare channels.
    pub name: String,
    /// Stored in 16 bits.
    pub half: bool,
}

fn aov_name<S: serde::Serializer>(aov: &&'static Aov, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(aov.name)
}

impl PlannedLayer {
    fn plain(aov: &'static Aov) -> Self {
        Self { aov, argument: String::new(), name: layer_name(aov.name, aov.name, ""), half: aov.is_half_by_default() }
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
        for asked in names {
            let place = || format!("--aov {asked}");
            let (own_name, asked) = named(asked);
            let (name, argument) = with_argument(asked);
            let aov = find(name).ok_or_else(|| Error::usage(place(), unavailable(name)))?;
            check_argument(aov, argument).map_err(|problem| Error::usage(place(), problem))?;
            if layers.iter().any(|layer| layer.aov.name == aov.name && layer.argument == argument) {
                continue;
            }
            let mut layer = PlannedLayer { argument: argument.to_owned(), ..PlannedLayer::plain(aov) };
            if !argument.is_empty() {
                let wanted = own_name.map_or_else(|| argument_name(aov, argument), str::to_owned);
                layer.name = unused_name(&layers, wanted);
            }
            layers.push(layer);
        }
        if layers.is_empty() {
            return Err(Error::usage("--aov", "no AOV is asked for: name one, or leave the option out"));
        }
        return Ok((chosen, layers));
    }
    for var in product.map_or(&[][..], |p| &p.vars) {
        let source = match source(var) {
            Ok(source) => source,
            Err(problem) => {
                diagnostics.warn("unavailable-render-var", &var.path, format!("{problem}: it is left out"));
                continue;
            }
        };
        let (source, argument) = source;
        let Some(aov) = find(source) else {
            diagnostics.warn("unavailable-render-var", &var.path, format!("{}: it is left out", unavailable(source)));
            continue;
        };
        if let Err(problem) = check_argument(aov, argument) {
            diagnostics.warn(
                "unavailable-render-var",
                &var.path,
                format!("asks for '{argument}', which {problem}: it is left out"),
            );
            continue;
        }
        let name = match text(var, "name") {
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
        layers.push(PlannedLayer { aov, argument: argument.to_owned(), name, half });
    }
    if layers.is_empty() {
        let default = if integrator.transports_light() { &[BEAUTY][..] } else { DEFAULT_AOVS };
        layers = default.iter().filter_map(|name| find(name)).map(PlannedLayer::plain).collect();
        if layers.is_empty() {
            layers = offered.into_iter().map(PlannedLayer::plain).collect();
        }
    }
    Ok((chosen, layers))
}

/// The integrator that nobody chose: with light transport if some AOV asks for light.
fn default_integrator(request: &Request, product: Option<&Product>) -> &'static str {
    let is_light =
        |asked: &str| aov::find(with_argument(named(asked).1).0).is_some_and(|aov| aov.family == Family::Transport);
    let asks = match &request.aovs {
        Some(names) => names.iter().any(|name| is_light(name)),
        None => product.is_some_and(|p| p.vars.iter().any(|var| source(var).is_ok_and(|(name, _)| is_light(name)))),
    };
    if asks { "path" } else { "differentials" }
}

/// `LAYER=AOV`: a name of its own for an AOV with an argument.
fn named(asked: &str) -> (Option<&str>, &str) {
    match asked.split_once('=') {
        Some((name, rest)) if !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_') => {
            (Some(name), rest)
        }
        _ => (None, asked),
    }
}

/// `AOV:ARGUMENT`: light groups and light path expressions.
fn with_argument(asked: &str) -> (&str, &str) {
    match asked.split_once(':') {
        Some((name, argument)) if aov::TAKES_ARGUMENT.contains(&name) => (name, argument),
        _ => (asked, ""),
    }
}

fn check_argument(aov: &Aov, argument: &str) -> Result<(), String> {
    match aov::TAKES_ARGUMENT.contains(&aov.name) {
        true => Expression::of_aov(aov.name, argument).map(drop),
        false => Ok(()),
    }
}

/// What a layer with an argument is called: after the light group, or just by its AOV.
fn argument_name(aov: &Aov, argument: &str) -> String {
    if aov.name != "light_group" {
        return aov.name.to_owned();
    }
    let clean = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("{}_{}", aov.name, argument.chars().map(clean).collect::<String>())
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

fn text<'a>(var: &'a Var, name: &str) -> &'a str {
    var.driver.get(name).and_then(|a| a.value.as_str()).unwrap_or("")
}

/// The AOV that a variable names and its argument, or why it names none. Hydra's prefixes say what `sourceType` says too.
fn source(var: &Var) -> Result<(&str, &str), String> {
    let name = if var.source_name.is_empty() { &var.name } else { &var.source_name };
    let (kind, name) = match name.split_once(':') {
        Some(("primvars", rest)) => ("primvar", rest),
        Some(("lpe", rest)) => ("lpe", rest),
        _ => (var.source_type.as_str(), name.as_str()),
    };
    match kind {
        "primvar" => match aov::canonical_name(name) {
            "uv" => Ok(("uv", "")),
            "normals" | "normal" => Ok(("normal", "")),
            _ => Err(format!(
                "asks for the primvar '{name}', and of primvars only texture coordinates (st) and normals are written"
            )),
        },
        "lpe" if aov::canonical_name(name) != BEAUTY => Ok(("lpe", name)),
        _ => Ok(with_argument(name)),
    }
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
