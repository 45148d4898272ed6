//! Reads files of ours, whole or a band of rows at a time, trusting nothing in them.

use std::fs::{self, File};
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use ::exr::meta::header::Header;
use rayon::prelude::*;

use super::header::{self, Decoded, damaged};
use super::layout::{self, Channel};
use super::{Head, writer};
use crate::error::{Error, Result};
use crate::film::metadata::Metadata;
use crate::film::{Film, Window};

/// No compression of ours packs tighter: 1032 is the limit of deflate (258 bytes from two bits); RLE reaches 64 and the
/// run code of PIZ 408.
const HIGHEST_RATIO: u64 = 1032;

/// Blocks decompressed at once.
const BATCH: usize = 64;

/// A file of ours, its header read and its blocks found.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    input: BufReader<File>,
    head: Head,
    metadata: Metadata,
    channels: Vec<Channel>,
    codec: Header,
    /// Where the compressed bytes of each block begin, and how many they are.
    blocks: Vec<(u64, u32)>,
}

impl Reader {
    /// Opens `path` and checks that header and blocks are sound.
    pub fn open(path: &Path) -> Result<Self> {
        let known = fs::metadata(path).map_err(|e| Error::io(path, "read the image", e))?;
        if !known.is_file() {
            return Err(Error::file(path, "this is not a plain file: name an EXR that abbe wrote"));
        }
        let file = File::open(path).map_err(|e| Error::io(path, "read the image", e))?;
        let mut input = BufReader::with_capacity(1 << 16, file);
        let (Decoded { head, metadata, compression, channels }, length) =
            header::decode(path, &mut input, known.len())?;
        let Window { y0, y1, .. } = head.window;
        let lines = compression.scan_lines_per_block();
        let count = head.window.height().div_ceil(lines) as u64;
        let row = head.window.width() as u64 * writer::bytes_per_pixel(&channels) as u64;
        let table_end = length + count * 8;
        if table_end > known.len() {
            return Err(damaged(path, "the file is shorter than its header says"));
        }
        let mut table = vec![0; count as usize * 8];
        input.read_exact(&mut table).map_err(|e| Error::io(path, "read the image", e))?;
        let mut blocks = Vec::with_capacity(count as usize);
        let mut free = table_end;
        for (k, offset) in table.as_chunks::<8>().0.iter().enumerate() {
            let offset = u64::from_le_bytes(*offset);
            let wrong = |what: &str| damaged(path, format!("block {k} {what}"));
            // Blocks follow each other, so the file's length bounds what they can unpack to.
            if offset < free || offset.checked_add(8).is_none_or(|end| end > known.len()) {
                return Err(wrong("is not in its place; was the file written to its end?"));
            }
            let mut words = [0; 8];
            input
                .seek(SeekFrom::Start(offset))
                .and_then(|_| input.read_exact(&mut words))
                .map_err(|e| Error::io(path, "read the image", e))?;
            let [y, size] = [[0, 1, 2, 3], [4, 5, 6, 7]].map(|at: [usize; 4]| at.map(|i| words[i]));
            let top = i64::from(y0) + (k * lines) as i64;
            let size = u32::from_le_bytes(size);
            let unpacked = row * (i64::from(y1) - top).min(lines as i64) as u64;
            if i64::from(i32::from_le_bytes(y)) != top {
                return Err(wrong("has the wrong line number"));
            }
            free = offset + 8 + u64::from(size);
            if size == 0
                || u64::from(size) > unpacked
                || free > known.len()
                || unpacked > u64::from(size) * HIGHEST_RATIO
            {
                return Err(wrong("has an impossible size"));
            }
            blocks.push((offset + 8, size));
        }
        let codec = writer::codec_header(head.window, compression, &channels);
        Ok(Self { path: path.to_owned(), input, head, metadata, channels, codec, blocks })
    }

    /// What the header says about the image.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// The caller's metadata, sorted by name.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The caller's metadata, sorted by name.
    pub fn into_metadata(self) -> Metadata {
        self.metadata
    }

    /// The rows `y0..y1` of the data window.
    pub fn rows(&mut self, y0: i32, y1: i32) -> Result<Film> {
        let Window { x0, x1, y0: top, y1: bottom } = self.head.window;
        assert!(top <= y0 && y0 < y1 && y1 <= bottom, "rows {y0}..{y1} of {top}..{bottom}");
        let window = Window { x0, x1, y0, y1 };
        let layers = self.head.layers.iter();
        let mut film = Film {
            resolution: self.head.resolution,
            window,
            pixel_aspect_ratio: self.head.pixel_aspect_ratio,
            samples: self.head.samples,
            layers: layers.map(|kind| kind.layer(window.area())).collect(),
        };
        let lines = self.codec.compression.scan_lines_per_block() as i32;
        let wanted: Vec<usize> = ((y0 - top) / lines..=(y1 - 1 - top) / lines).map(|k| k as usize).collect();
        for batch in wanted.chunks(BATCH) {
            let packed = batch.iter().map(|&k| self.packed(k)).collect::<Result<Vec<_>>>()?;
            let codec = &self.codec;
            let unpacked: Vec<(i32, i32, Vec<u8>)> = batch
                .par_iter()
                .zip(packed)
                .map(|(&k, bytes)| {
                    let y = top + k as i32 * lines;
                    let end = (y + lines).min(bottom);
                    let rows = writer::section(codec, y, end);
                    codec
                        .compression
                        .decompress_image_section_from_le(codec, bytes, rows, true)
                        .map(|data| (y, end, data))
                        .map_err(|e| damaged(&self.path, format!("block {k}: {e}")))
                })
                .collect::<Result<_>>()?;
            for (y, end, data) in unpacked {
                let mut rest = data.as_slice();
                let rows = (y..end).flat_map(|y| self.channels.iter().map(move |channel| (y, channel)));
                for (y, channel) in rows {
                    let (bytes, after) = rest
                        .split_at_checked(window.width() * channel.sample.size())
                        .ok_or_else(|| damaged(&self.path, "a block is too short"))?;
                    rest = after;
                    if (y0..y1).contains(&y) {
                        layout::store_row(&mut film, channel, (y - y0) as usize, bytes);
                    }
                }
            }
        }
        self.check_sums(&film)?;
        Ok(film)
    }

    fn packed(&mut self, block: usize) -> Result<Vec<u8>> {
        let (offset, size) = self.blocks[block];
        let mut bytes = vec![0; size as usize];
        self.input
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.input.read_exact(&mut bytes))
            .map_err(|e| Error::io(&self.path, "read the image", e))?;
        Ok(bytes)
    }

    /// Sums are computed with again, so they must be numbers.
    fn check_sums(&self, film: &Film) -> Result<()> {
        let samples = film.samples.end - film.samples.begin;
        for layer in &film.layers {
            if let Some(sums) = &layer.sums
                && (sums.values.iter().any(|sum| !sum.is_finite()) || sums.counts.iter().any(|&count| count > samples))
            {
                return Err(damaged(&self.path, format!("layer `{}` has impossible sums", layer.name)));
            }
        }
        Ok(())
    }
}
