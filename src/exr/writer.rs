//! Writes a film band by band: header, offset table, then blocks of scan lines, compressed in parallel, stored in order.

use std::borrow::Cow;
use std::io::{Seek, SeekFrom};
use std::path::Path;

use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{ChannelDescription, IntegerBounds, LineOrder, SampleType as ExrSample, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::{SmallVec, Vec2};
use rayon::prelude::*;

use super::header::Encoded;
use super::layout::{Channel, Stored};
use super::{Head, header, layout};
use crate::atomic;
use crate::error::{Error, Result};
use crate::film::metadata::Metadata;
use crate::film::{Film, Window};

/// Rows that are compressed at once: several blocks of every compression (1, 16 or 32 lines), so that threads have work
/// and a merge needs little memory.
pub(super) const BAND: i32 = 128;

/// Writes the film that `head` tells of; `band` gives the pixels of each window that it is asked for, or of a larger one.
pub(super) fn write_bands<'a>(
    path: &Path,
    head: &Head,
    metadata: &Metadata,
    mut band: impl FnMut(Window) -> Result<Cow<'a, Film>>,
) -> Result<()> {
    let Encoded { bytes, compression, channels } = header::encode(head, metadata)?;
    let codec = codec_header(head.window, compression, &channels);
    let lines = compression.scan_lines_per_block() as i32;
    let Window { x0, y0, x1, y1 } = head.window;
    let bytes_per_pixel = bytes_per_pixel(&channels);
    if i32::try_from(head.window.width() * bytes_per_pixel * lines as usize).is_err() {
        return Err(Error::usage(
            "EXR",
            format!(
                "{lines} lines of {} channels are longer than a block may be: choose compression zips",
                channels.len()
            ),
        ));
    }
    atomic::replace(path, |out| {
        let table = bytes.len() as u64;
        let mut offsets: Vec<u64> = Vec::with_capacity(codec.chunk_count);
        atomic::put(out, path, &bytes)?;
        atomic::put(out, path, &vec![0; codec.chunk_count * 8])?;
        let mut position = table + codec.chunk_count as u64 * 8;
        for top in (y0..y1).step_by(BAND as usize) {
            let window = Window { x0, x1, y0: top, y1: (top + BAND).min(y1) };
            let film = band(window)?;
            assert!(film.window.x0 == x0 && film.window.x1 == x1, "a band spans the data window");
            let blocks: Vec<i32> = (window.y0..window.y1).step_by(lines as usize).collect();
            let compressed: Vec<Vec<u8>> = blocks
                .par_iter()
                .map(|&y| block(&film, &channels, &codec, y, (y + lines).min(window.y1)))
                .collect::<Result<_, _>>()
                .map_err(|e| Error::file(path, format!("cannot compress the image: {e}")))?;
            for (y, data) in blocks.into_iter().zip(compressed) {
                offsets.push(position);
                position += 8 + data.len() as u64;
                atomic::put(out, path, &y.to_le_bytes())?;
                atomic::put(out, path, &(data.len() as i32).to_le_bytes())?;
                atomic::put(out, path, &data)?;
            }
        }
        out.seek(SeekFrom::Start(table)).map_err(|e| Error::io(path, "write the image", e))?;
        offsets.iter().try_for_each(|offset| atomic::put(out, path, &offset.to_le_bytes()))
    })
}

/// Bytes of all channels of a pixel.
pub(super) fn bytes_per_pixel(channels: &[Channel]) -> usize {
    channels.iter().map(|channel| channel.sample.size()).sum()
}

/// The rows `y0..y1`, channel after channel in each row, compressed.
fn block(film: &Film, channels: &[Channel], codec: &Header, y0: i32, y1: i32) -> ::exr::error::Result<Vec<u8>> {
    let mut data = Vec::with_capacity((y1 - y0) as usize * film.window.width() * bytes_per_pixel(channels));
    for y in y0..y1 {
        let row = (y - film.window.y0) as usize;
        channels.iter().for_each(|channel| layout::append_row(film, channel, row, &mut data));
    }
    codec.compression.compress_image_section_to_le(codec, data, section(codec, y0, y1))
}

/// Rows `y0..y1` as the codec counts them: from the top of the data window.
pub(super) fn section(codec: &Header, y0: i32, y1: i32) -> IntegerBounds {
    let top = y0 - codec.own_attributes.layer_position.y();
    IntegerBounds::new(Vec2(0, top), Vec2(codec.layer_size.width(), (y1 - y0) as usize))
}

/// What the codec has to know of the file.
pub(super) fn codec_header(
    window: Window,
    compression: ::exr::compression::Compression,
    channels: &[Channel],
) -> Header {
    let channels: SmallVec<[ChannelDescription; 5]> = channels
        .iter()
        .map(|channel| ChannelDescription {
            name: Text::from_slice_unchecked(channel.name.as_bytes()),
            sample_type: match channel.sample {
                Stored::Half => ExrSample::F16,
                Stored::Float => ExrSample::F32,
                Stored::Uint => ExrSample::U32,
            },
            quantize_linearly: false,
            sampling: Vec2(1, 1),
        })
        .collect();
    let size = Vec2(window.width(), window.height());
    Header::new(Text::from_slice_unchecked(b""), size, channels)
        .with_position(Vec2(window.x0, window.y0))
        .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
}
