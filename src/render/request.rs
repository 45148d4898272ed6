//! What a caller asks for: everything optional, everything above what the stage says.

use serde::{Deserialize, Serialize};

/// A request; what it leaves open is taken from the stage's product, then its settings, then the defaults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Path of a camera of the scene.
    pub camera: Option<String>,
    /// Path of the one product to render.
    pub product: Option<String>,
    /// Pixels; alone, it keeps the authored aspect.
    pub width: Option<u32>,
    /// Pixels; alone, it keeps the authored aspect.
    pub height: Option<u32>,
    /// Samples per pixel; the most of them if there is an error target.
    pub samples: Option<u32>,
    /// Relative error at which a pixel gets no more samples; 0 for none.
    pub error_target: Option<f64>,
    /// Seconds after which the image is finished with the samples that it has; 0 for none.
    pub time_limit: Option<f64>,
    /// The most that a sample of the beauty may have in R, G, B; no limit if absent.
    pub clamp: Option<f64>,
    /// Name of the reconstruction filter of light.
    pub pixel_filter: Option<String>,
    /// Its full width, pixels.
    pub pixel_filter_width: Option<f64>,
    /// Whether samples are spread over the lens; as the stage says if absent.
    pub depth_of_field: Option<bool>,
    /// Name of an integrator.
    pub integrator: Option<String>,
    /// AOVs, in the order of the film's layers; the stage's RenderVars if absent.
    pub aovs: Option<Vec<String>>,
    /// Reference wavelength, nm.
    pub wavelength: Option<f64>,
    /// Band of footprints and half-widths, nm.
    pub band: Option<[f64; 2]>,
    /// Multiplies all dispersion: 0 none, 1 physical.
    pub dispersion_scale: Option<f64>,
    /// How often light may be scattered altogether: 0 leaves what shines by itself, 1 direct light. Unlimited if absent.
    pub max_depth: Option<u32>,
    /// How often diffusely.
    pub max_diffuse_depth: Option<u32>,
    /// How often it may be reflected by interfaces.
    pub max_reflection_depth: Option<u32>,
    /// How often it may be transmitted by interfaces.
    pub max_transmission_depth: Option<u32>,
    /// Image file that is seen through glass, behind everything.
    pub plate: Option<String>,
    /// False closes all shutters at the frame.
    pub motion_blur: Option<bool>,
    /// Seed of the sample positions.
    pub seed: Option<u64>,
    /// Threads; all of the machine's if absent or 0. Never changes a bit of the image.
    pub threads: Option<usize>,
    /// Memory for the texels of images, MB (10⁶ bytes); 4294 MB if absent. Never changes a bit of the image.
    pub texture_memory: Option<u64>,
    /// Pixels to render: x0, y0, x1, y1, half-open, y down.
    pub crop: Option<[i32; 4]>,
    /// Samples to render: begin, end, half-open; aligned as [`is_aligned`](crate::film::sum::is_aligned) says.
    pub sample_range: Option<[u32; 2]>,
    /// Turns any warning, of the scene or the request, into an error.
    pub strict: bool,
}
