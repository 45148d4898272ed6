//! The AOV table: the one place that gives an AOV its name, channels, unit, type, merge rule and documentation.
//!
//! It drives the USD token (`sourceName`), the Python key, the EXR channels, the header's units, `abbe aovs`, the plan and
//! the checker. An AOV has one name everywhere; an EXR layer is called so unless the stage's RenderVar says otherwise.

use serde::Serialize;

/// What a channel stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleType {
    /// 32-bit float.
    Float,
    /// 32-bit unsigned integer.
    Uint,
}

/// How a pixel's samples become its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Merge {
    /// Mean over the samples where the value is defined; `<layer>.valid` is the fraction of such samples.
    Mean,
    /// Mean over all samples, one without a value counting as 0: light, of which a sample that finds none has found 0.
    All,
    /// The value of the lowest sample index: identifiers and counts are never averaged.
    First,
    /// The number of samples.
    Count,
    /// The variance of the mean over all samples.
    Variance,
}

/// What an AOV tells about, which decides what has to be computed for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// The first surface that the camera ray meets: no chain is followed.
    FirstSurface,
    /// The chain of specular events, or its end; no derivative.
    Chain,
    /// The wavelength column alone.
    LambdaColumn,
    /// The wavelength column to second order.
    LambdaSecondOrder,
    /// Wavelength and screen columns: motion on screen per nanometre.
    ScreenColumns,
    /// Screen motion to second order: a second chain along the first-order motion.
    ScreenSecondOrder,
    /// Exact displacement by tracing again at another wavelength.
    Retrace,
    /// Exact displacement by tracing again at another time.
    MotionRetrace,
    /// Light.
    Transport,
}

/// One row of the table.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Aov {
    /// USD token, EXR layer and Python key.
    pub name: &'static str,
    /// Channel suffixes in the order of a pixel's values.
    pub channels: &'static [&'static str],
    /// What is stored.
    pub sample: SampleType,
    /// Unit of the values; `1` where there is none.
    pub unit: &'static str,
    /// How samples merge.
    pub merge: Merge,
    /// Whether a sample can lack a value, so that a `valid` channel stands beside the layer.
    pub has_validity: bool,
    /// What must be computed.
    pub family: Family,
    /// One line for people.
    pub doc: &'static str,
}

/// What 11 bits of mantissa and a range of 65504 are enough for: colours and unit vectors.
const SOUND_IN_HALF: &[&str] = &[
    "albedo",
    "refracted_albedo",
    "emission",
    "refracted_emission",
    "normal",
    "normal_geometric",
    "refracted_normal",
    "refracted_normal_geometric",
    INTERNAL_TRANSMITTANCE,
];

impl Aov {
    /// Whether half floats hold what its values are for.
    pub fn is_sound_in_half(&self) -> bool {
        SOUND_IN_HALF.contains(&self.name) || self.is_half_by_default()
    }

    /// Whether files hold it in half floats unless asked otherwise: colours of light, whose noise is coarser than their steps.
    pub fn is_half_by_default(&self) -> bool {
        self.family == Family::Transport && self.merge == Merge::All
    }

    /// Whether parts of a render keep sums of it, from which a merge makes the whole.
    pub fn has_sums(&self) -> bool {
        matches!(self.merge, Merge::Mean | Merge::All | Merge::Variance)
    }

    /// Names of the sums that are kept per pixel: of the channels' values, and for a variance of their squares.
    pub fn sums(&self) -> impl Iterator<Item = String> {
        let squares = if self.merge == Merge::Variance { self.channels } else { &[] };
        self.channels.iter().map(|c| (*c).to_owned()).chain(squares.iter().map(|c| format!("{c}2")))
    }

    /// How many sums are kept per pixel.
    pub fn sum_count(&self) -> usize {
        self.channels.len() * if self.merge == Merge::Variance { 2 } else { 1 }
    }
}

const XYZ: &[&str] = &["X", "Y", "Z"];
const XY: &[&str] = &["X", "Y"];
const UV: &[&str] = &["U", "V"];
/// A colour: the one thing that is R, G, B.
const RGB: &[&str] = &["R", "G", "B"];
const RGBA: &[&str] = &["R", "G", "B", "A"];
const X: &[&str] = &["X"];
const Z: &[&str] = &["Z"];
const I: &[&str] = &["I"];

const fn mean(
    name: &'static str,
    channels: &'static [&'static str],
    unit: &'static str,
    family: Family,
    doc: &'static str,
) -> Aov {
    Aov { name, channels, sample: SampleType::Float, unit, merge: Merge::Mean, has_validity: true, family, doc }
}

const fn first(name: &'static str, unit: &'static str, family: Family, doc: &'static str) -> Aov {
    Aov { name, channels: I, sample: SampleType::Uint, unit, merge: Merge::First, has_validity: false, family, doc }
}

const fn light(name: &'static str, channels: &'static [&'static str], unit: &'static str, doc: &'static str) -> Aov {
    let (sample, merge) = (SampleType::Float, Merge::All);
    Aov { name, channels, sample, unit, merge, has_validity: false, family: Family::Transport, doc }
}

/// The beauty.
pub const COLOR: &str = "color";
/// The beauty without dispersion.
pub const COLOR_CLEAN: &str = "color_clean";
/// Variance of the beauty.
pub const VARIANCE: &str = "variance";
/// Samples that a pixel got.
pub const SAMPLE_COUNT: &str = "sample_count";
/// Spectral bins.
pub const SPECTRAL: &str = "spectral";
/// The part of the beauty that comes from a group of lights.
pub const LIGHT_GROUP: &str = "light_group";
/// The part of the beauty whose light paths an expression describes.
pub const LPE: &str = "lpe";
/// What colours of light are measured in.
const RADIANCE: &str = "radiance";

/// The one AOV that the absorption of media is summed for.
pub const INTERNAL_TRANSMITTANCE: &str = "internal_transmittance";

/// Motion on screen of the first surface, for which no ray is traced at another time.
pub const MOTION: &str = "motion";
/// Motion on screen of what is seen through glass, which is traced again at the frame and at the next one.
pub const REFRACTED_MOTION: &str = "refracted_motion";

/// What an AOV has to be told with its name (`NAME:ARGUMENT`), in words; `None` if nothing.
pub fn argument(aov: &Aov) -> Option<&'static str> {
    match aov.name {
        SPECTRAL => Some("LO:HI:WIDTH in nm, such as 400:700:10"),
        LIGHT_GROUP => Some("the name of a light group"),
        LPE => Some("a light path expression"),
        _ => None,
    }
}

/// Whether an AOV is that of a surface's color.
pub fn is_albedo(aov: &Aov) -> bool {
    matches!(aov.name, "albedo" | "refracted_albedo")
}

/// Every AOV.
pub static AOVS: &[Aov] = &[
    light(
        COLOR,
        RGBA,
        RADIANCE,
        "the beauty: light that reaches the camera, D65 with Y = 1 being (1, 1, 1), and the associated alpha",
    ),
    light(
        COLOR_CLEAN,
        RGBA,
        RADIANCE,
        "the beauty as it is without any dispersion, from the same samples: the clean plate",
    ),
    light("diffuse", RGB, RADIANCE, "part of color that the first surface scatters diffusely"),
    light("reflection", RGB, RADIANCE, "part of color that the first surface reflects, rough or smooth"),
    light("transmission", RGB, RADIANCE, "part of color that the first surface lets through, rough or smooth"),
    light("emission", RGB, RADIANCE, "part of color that is seen by itself: lights, domes, emitting surfaces"),
    light(LIGHT_GROUP, RGB, RADIANCE, "part of color that the lights of a group send: light_group:NAME"),
    light(LPE, RGB, RADIANCE, "part of color whose paths match a light path expression: lpe:EXPRESSION"),
    Aov {
        unit: "radiance²",
        merge: Merge::Variance,
        ..light(
            VARIANCE,
            RGB,
            RADIANCE,
            "variance of the pixel mean of color in each channel, as its own samples tell it: the squared standard error",
        )
    },
    Aov {
        sample: SampleType::Uint,
        merge: Merge::Count,
        ..light(SAMPLE_COUNT, I, "count", "samples that the pixel got")
    },
    light(
        SPECTRAL,
        &["w550"],
        "radiance/nm",
        "mean radiance per nm in bins of the band, one channel each, called by the middle of its bin in nm",
    ),
    mean(
        "ddirection_dlambda",
        XYZ,
        "1/nm",
        Family::LambdaColumn,
        "∂d/∂λ of the unit direction of the chain's last segment",
    ),
    mean(
        "dposition_dlambda",
        XYZ,
        "stage unit/nm",
        Family::LambdaColumn,
        "∂p/∂λ of the chain's end point on the geometric surface",
    ),
    mean(
        "dispersion_footprint",
        X,
        "stage unit",
        Family::LambdaColumn,
        "|∂p/∂λ| × band width: how long the spectrum of this pixel is on the surface it sees, linear and unclipped",
    ),
    mean(
        "footprint_half_width",
        X,
        "nm",
        Family::LambdaSecondOrder,
        "how far in wavelength the first-order footprint holds: min(half the band, 2ε|p_λ|/|p_λλ| with ε = 0.05, |δ_c| of every interface); silhouettes not included",
    ),
    mean(
        "dispersion",
        XY,
        "pixel/nm",
        Family::ScreenColumns,
        "how the feature seen here moves on screen as the wavelength increases, +x right, +y up",
    ),
    mean(
        "dispersion2",
        XY,
        "pixel/nm²",
        Family::ScreenSecondOrder,
        "second derivative of that motion: at λ_ref + δ the feature is at pixel + dispersion·δ + ½·dispersion2·δ²",
    ),
    mean(
        "dispersion_r",
        XY,
        "pixel",
        Family::Retrace,
        "exact fetch offset at the wavelength of the red response: look up the image here + offset",
    ),
    mean("dispersion_g", XY, "pixel", Family::Retrace, "exact fetch offset at the wavelength of the green response"),
    mean("dispersion_b", XY, "pixel", Family::Retrace, "exact fetch offset at the wavelength of the blue response"),
    mean("ior", X, "1", Family::Chain, "refractive index of the first dielectric entered, at the reference wavelength"),
    mean(
        "dior_dlambda",
        X,
        "1/nm",
        Family::Chain,
        "∂n/∂λ of the first dielectric entered, at the reference wavelength",
    ),
    mean(
        "abbe_number",
        X,
        "1",
        Family::Chain,
        "Abbe number (d, F, C) of the first dielectric entered; absent where it is constant",
    ),
    mean(
        INTERNAL_TRANSMITTANCE,
        XYZ,
        "1",
        Family::Chain,
        "what the media leave of the light, ∏ exp(−σ·length) along the chain at the reference wavelength: X, Y, Z at the wavelengths of the red, green, blue responses",
    ),
    first("interfaces", "count", Family::Chain, "specular events on the chain"),
    first(
        "rough_interfaces",
        "count",
        Family::Chain,
        "specular events on the chain that are rough, followed along the mean normal",
    ),
    first("total_reflections", "count", Family::Chain, "total internal reflections on the chain"),
    mean(
        "depth",
        Z,
        "stage unit",
        Family::FirstSurface,
        "distance of the first surface from the camera, along its axis",
    ),
    mean("position", XYZ, "stage unit", Family::FirstSurface, "world position of the first surface"),
    mean(
        "normal",
        XYZ,
        "1",
        Family::FirstSurface,
        "unit shading normal of the first surface, world space, facing the camera",
    ),
    mean(
        "normal_geometric",
        XYZ,
        "1",
        Family::FirstSurface,
        "unit geometric normal of the first surface, world space, outward as authored",
    ),
    mean("uv", UV, "1", Family::FirstSurface, "texture coordinates of the first surface"),
    mean(
        MOTION,
        XY,
        "pixel/frame",
        Family::FirstSurface,
        "motion on screen of the first surface's point from this frame to the next (time code + 1), +x right, +y up, whatever the shutter; of the direction on a miss",
    ),
    mean(
        REFRACTED_MOTION,
        XY,
        "pixel/frame",
        Family::MotionRetrace,
        "the same of the chain's end as it is seen through the glass, both of which may move; absent where the next frame does not show it through as many interfaces",
    ),
    mean(
        "albedo",
        RGB,
        "1",
        Family::FirstSurface,
        "what denoisers expect of the first surface, linear Rec. 709: base color of what is diffuse, reflectance at normal incidence of a metal, tint of what transmits (1 for clear glass), displayColor where there is no material",
    ),
    mean(
        "refracted_depth",
        Z,
        "stage unit",
        Family::Chain,
        "distance of the chain's end from the camera, along its axis",
    ),
    mean(
        "refracted_position",
        XYZ,
        "stage unit",
        Family::Chain,
        "world position of the chain's end: what is seen through the glass",
    ),
    mean(
        "refracted_normal",
        XYZ,
        "1",
        Family::Chain,
        "unit shading normal at the chain's end, world space, facing the arriving ray",
    ),
    mean(
        "refracted_normal_geometric",
        XYZ,
        "1",
        Family::Chain,
        "unit geometric normal at the chain's end, world space, outward as authored",
    ),
    mean("refracted_uv", UV, "1", Family::Chain, "texture coordinates at the chain's end"),
    mean("refracted_albedo", RGB, "1", Family::Chain, "albedo at the chain's end: of what is seen through the glass"),
    first(
        "prim_id",
        "index",
        Family::FirstSurface,
        "prim of the first surface: 0 nothing, n = n-th path of the header's prim manifest",
    ),
    first(
        "instance_id",
        "index",
        Family::FirstSurface,
        "instance of the first surface: 0 none, n = n-th path of the header's instance manifest",
    ),
    first(
        "material_id",
        "index",
        Family::FirstSurface,
        "material of the first surface: 0 none, n = n-th path of the header's material manifest",
    ),
    first("refracted_prim_id", "index", Family::Chain, "prim at the chain's end"),
    first("refracted_instance_id", "index", Family::Chain, "instance at the chain's end"),
    first("refracted_material_id", "index", Family::Chain, "material at the chain's end"),
];

/// Names of other renderers that mean an AOV of ours.
pub static ALIASES: &[(&str, &str)] = &[
    ("primId", "prim_id"),
    ("instanceId", "instance_id"),
    ("materialId", "material_id"),
    ("cameraDepth", "depth"),
    ("Z", "depth"),
    ("z", "depth"),
    ("P", "position"),
    ("Pworld", "position"),
    ("N", "normal"),
    ("Nn", "normal"),
    ("Ng", "normal_geometric"),
    ("st", "uv"),
    ("motionvector", MOTION),
    ("Albedo", "albedo"),
    ("Ci", "color"),
    ("C", "color"),
    ("RGBA", "color"),
    ("rgba", "color"),
    ("beauty", "color"),
    ("C.*", "color"),
];

/// The row called `name`, or that another renderer's `name` means.
pub fn find(name: &str) -> Option<&'static Aov> {
    let canonical = canonical_name(name);
    AOVS.iter().find(|aov| aov.name == canonical)
}

/// Our name for `name`, which may be an alias; `name` itself if it is none.
pub fn canonical_name(name: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == name).map_or(name, |(_, canonical)| canonical)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_stands_once_and_survives_nuke() {
        for (i, aov) in AOVS.iter().enumerate() {
            assert!(AOVS[..i].iter().all(|other| other.name != aov.name), "{} stands twice", aov.name);
            assert!(aov.name.starts_with(|c: char| c.is_ascii_lowercase()), "{}", aov.name);
            assert!(aov.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{}", aov.name);
        }
    }

    #[test]
    fn aliases_lead_to_rows() {
        for (alias, name) in ALIASES {
            assert!(find(alias).is_some(), "{alias}: {name}");
        }
    }
}
