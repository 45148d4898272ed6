//! Multichannel EXR: layers, types, header, atomic writing, exact reading and merging.
//!
//! One film is one file: single-part scan lines, channels `layer.X`, one compression. Ids and counts are UINT, the
//! rest is FLOAT, or HALF where a layer says so. `<layer>.valid` stands beside a layer that can lack values; `depth` is there a second time as
//! the bare `Z` that compositors look for. A render of a part of its samples also carries the exact sums behind its
//! means ([`layout`]), which lets [`merge()`] join parts to the bits of one render.
//!
//! The same film and metadata give the same bytes: attributes and channels are sorted, nothing depends on time or
//! threads. Pixel compression is the `exr` crate's; the file frame is written and read here, because that crate keeps
//! attributes in a hash map (their order would change from run to run) and has no bounded reader for single blocks.
//!
//! Sources: OpenEXR, *File Layout* and `ImfStandardAttributes.h` (3.4).

mod header;
pub mod layout;
mod merge;
mod reader;
mod writer;

use std::borrow::Cow;
use std::path::Path;

pub use header::{check_attribute, standard_type};
pub use merge::{PER_PART, merge};
pub use reader::Reader;

use crate::error::Result;
use crate::film::metadata::Metadata;
use crate::film::{Film, SampleRange, Window};
use layout::LayerKind;

/// Header attribute that lists the file's layers: a JSON array of `{"name", "aov", "sums"}` in the film's order.
pub const LAYERS: &str = "abbe:layers";
/// Header attribute with the samples that the values cover: `begin:end:total`.
pub const SAMPLE_RANGE: &str = "abbe:sampleRange";
/// Prefix of the header attributes with a layer's unit; the layer's name follows (the AOV's where that is empty).
pub const UNIT: &str = "abbe:unit:";

/// What a file says about its image apart from the caller's metadata: a [`Film`] without pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    /// The display window's size.
    pub resolution: [u32; 2],
    /// The data window.
    pub window: Window,
    /// Width of a pixel over its height.
    pub pixel_aspect_ratio: f32,
    /// The samples that the values cover.
    pub samples: SampleRange,
    /// The layers in the film's order.
    pub layers: Vec<LayerKind>,
}

impl Head {
    /// The head of `film`.
    pub fn of(film: &Film) -> Self {
        let layers = film.layers.iter().map(LayerKind::of).collect();
        let Film { resolution, window, pixel_aspect_ratio, samples, .. } = *film;
        Self { resolution, window, pixel_aspect_ratio, samples, layers }
    }
}

/// Writes `film` to `path`, whole or not at all.
///
/// The file appears under its name when it is complete and on disk; on an error, or if the process is killed, what was
/// there before is still there.
pub fn write(path: &Path, film: &Film, metadata: &Metadata) -> Result<()> {
    writer::write_bands(path, &Head::of(film), metadata, |_| Ok(Cow::Borrowed(film)))
}

/// Reads a file that [`write()`] or [`merge()`] wrote.
///
/// Metadata come back sorted by name, without the attributes that [`write()`] adds by itself.
/// Anything else, damaged files included, is an error; memory stays in proportion to the file's size.
pub fn read(path: &Path) -> Result<(Film, Metadata)> {
    let mut reader = Reader::open(path)?;
    let window = reader.head().window;
    let film = reader.rows(window.y0, window.y1)?;
    Ok((film, reader.into_metadata()))
}
