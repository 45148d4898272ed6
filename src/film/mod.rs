//! The film: finished layers over a window of the raster, with the exact sums behind them where a render is a part.
//!
//! Rows run down and pixels are interleaved (`height × width × channels`), as EXR and NumPy have them. A film has never
//! heard of files: [`crate::exr`] writes it.

pub mod aov;
pub mod metadata;
pub mod pixel;
pub mod spectral;
pub mod sum;

use aov::{Aov, SampleType};

/// A rectangle of pixels, half-open, in raster coordinates: x right, y down, (0, 0) the top-left of the full raster.
///
/// It may reach outside the raster (overscan).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// First column.
    pub x0: i32,
    /// First row.
    pub y0: i32,
    /// One past the last column.
    pub x1: i32,
    /// One past the last row.
    pub y1: i32,
}

impl Window {
    /// The whole raster.
    pub fn full(resolution: [u32; 2]) -> Self {
        Self { x0: 0, y0: 0, x1: resolution[0] as i32, y1: resolution[1] as i32 }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        (self.x1 - self.x0).max(0) as usize
    }

    /// Rows.
    pub fn height(&self) -> usize {
        (self.y1 - self.y0).max(0) as usize
    }

    /// Pixels.
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }
}

/// The samples `begin..end` of each pixel, out of `total`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SampleRange {
    /// First sample index.
    pub begin: u32,
    /// One past the last sample index.
    pub end: u32,
    /// Samples of the whole render.
    pub total: u32,
}

impl SampleRange {
    /// All of `total` samples.
    pub fn all(total: u32) -> Self {
        Self { begin: 0, end: total, total }
    }

    /// Whether these are all samples of the render.
    pub fn is_all(&self) -> bool {
        self.begin == 0 && self.end == self.total
    }
}

/// The values of one layer, interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 32-bit floats.
    Float(Vec<f32>),
    /// 32-bit unsigned integers.
    Uint(Vec<u32>),
}

/// The exact sums behind a layer of means, kept when the render covers only a part of its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    /// Sums over the valid samples by [`sum::TreeSum`], interleaved in the order of [`Aov::sums`].
    pub values: Vec<f64>,
    /// How many samples the sums are over, per pixel: valid ones, or all.
    pub counts: Vec<u32>,
}

/// One AOV of the film.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its row of the table.
    pub aov: &'static Aov,
    /// Its EXR layer name: the AOV's, unless the stage's RenderVar says otherwise. Empty: bare channels.
    pub name: String,
    /// What the AOV is told with its name, as [`aov::argument`] says; empty for most.
    pub argument: String,
    /// Whether files store the values in 16 bits: a request of the stage, kept only where no digits are lost that matter.
    pub half: bool,
    /// The pixels.
    pub values: Values,
    /// Fraction of samples with a value, per pixel; only where the AOV [has validity](Aov::has_validity).
    pub valid: Option<Vec<f32>>,
    /// The sums, if the render covers only a part of its samples.
    pub sums: Option<Sums>,
}

impl Layer {
    /// A layer of absent values.
    pub fn new(aov: &'static Aov, name: String, pixels: usize, keep_sums: bool) -> Self {
        let n = pixels * aov.channels.len();
        let values = match aov.sample {
            SampleType::Float => Values::Float(vec![0.0; n]),
            SampleType::Uint => Values::Uint(vec![0; n]),
        };
        let valid = aov.has_validity.then(|| vec![0.0; pixels]);
        let sums = (keep_sums && aov.has_sums())
            .then(|| Sums { values: vec![0.0; pixels * aov.sum_count()], counts: vec![0; pixels] });
        Self { aov, name, argument: String::new(), half: false, values, valid, sums }
    }
}

impl Layer {
    /// By what it is found in a film: its AOV's name; that of the layer where an AOV can stand several times.
    pub fn key(&self) -> &str {
        if self.argument.is_empty() || self.aov.name == aov::SPECTRAL { self.aov.name } else { &self.name }
    }

    /// Keeps sums from now on, if there are any of such an AOV.
    pub fn keep_sums(&mut self) {
        if self.sums.is_none() && self.aov.has_sums() {
            let pixels = match &self.values {
                Values::Float(values) => values.len(),
                Values::Uint(values) => values.len(),
            } / self.aov.channels.len();
            self.sums = Some(Sums { values: vec![0.0; pixels * self.aov.sum_count()], counts: vec![0; pixels] });
        }
    }
}

/// A rendered image: all layers over one window.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Width and height of the full raster in pixels: the display window.
    pub resolution: [u32; 2],
    /// The pixels that were rendered: the data window.
    pub window: Window,
    /// Width of a pixel over its height.
    pub pixel_aspect_ratio: f32,
    /// The samples that the values cover.
    pub samples: SampleRange,
    /// One per AOV asked for, in that order.
    pub layers: Vec<Layer>,
}

impl Film {
    /// The layer with the [key](Layer::key) `name`: its AOV's for most.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.key() == name)
    }
}
