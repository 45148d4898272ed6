//! The images of a scene: each file is read once, when a texel of it is first looked up, under one memory budget.
//!
//! An image that fits into the budget stays in memory as it was decoded, and is read without a lock. One that does not is
//! cut into tiles of 64 × 64 texels in a temporary file, and a part of the budget keeps the tiles that were used last. So
//! no file is decoded twice, a scene with more textures than memory goes on at the speed of the disk, and where texels lie
//! never changes a bit: a texel is a function of the file alone.

use std::collections::{HashMap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use bytes::Bytes;
use serde::Serialize;

use super::color_space::ColorSpace;
use super::decode::{self, Decoded, Depth, Layout};

/// The budget where nobody states one.
pub const DEFAULT_BUDGET: u64 = 4 << 30;

/// Texels of a tile's side.
const TILE: usize = 64;
/// Locks that tiles are spread over.
const SHARDS: usize = 16;
/// The largest file that is read.
const MAX_FILE: u64 = 1 << 32;

/// Where an image comes from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A file of the file system.
    File(PathBuf),
    /// What is in a file.
    Memory(Bytes),
    /// Nothing was found.
    Missing,
}

/// An image that can be looked up.
#[derive(Debug)]
struct Slot {
    /// The file as it was authored.
    name: String,
    /// The property that names it.
    place: String,
    source: Source,
    image: OnceLock<Result<Image, String>>,
}

/// An image, decoded.
#[derive(Debug)]
pub(super) struct Image {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) own_space: ColorSpace,
    layout: Layout,
    depth: Depth,
    texels: Texels,
}

#[derive(Debug)]
enum Texels {
    Resident(Vec<u8>),
    /// Tiles one after the other, each of the full size, from here in the temporary file.
    Spilled {
        number: u64,
        offset: u64,
    },
}

/// What was read, and what was not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TextureCounts {
    /// Image files that materials name, tiles counted one by one.
    pub named: u64,
    /// Of which were read.
    pub read: u64,
    /// Bytes of their files.
    pub file_bytes: u64,
    /// Bytes of their texels.
    pub texel_bytes: u64,
    /// Bytes of texels that did not fit into the budget and went to a temporary file.
    pub spilled_bytes: u64,
}

/// An image that was looked up and is not there or cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// The property that names it, and the file.
    pub place: String,
    /// What is wrong with it.
    pub problem: String,
    /// It was not found at all.
    pub missing: bool,
}

/// All images of a scene.
#[derive(Debug, Default)]
pub struct Store {
    slots: Vec<Slot>,
    /// Bytes; 0 for the default.
    budget: AtomicU64,
    resident: AtomicU64,
    read: AtomicU64,
    file_bytes: AtomicU64,
    failed: AtomicBool,
    spilled: OnceLock<Spill>,
}

impl Store {
    /// Adds an image and returns its number; `name` is the file and `place` the property that names it.
    pub fn add(&mut self, name: String, place: String, source: Source) -> u32 {
        self.slots.push(Slot { name, place, source, image: OnceLock::new() });
        (self.slots.len() - 1) as u32
    }

    /// Sets the budget, bytes; what is in memory already stays there.
    pub fn set_budget(&self, bytes: u64) {
        self.budget.store(bytes, Ordering::Relaxed);
    }

    /// The budget, bytes; 0 for the default.
    pub fn stated_budget(&self) -> u64 {
        self.budget.load(Ordering::Relaxed)
    }

    /// How many images there are.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// What is known to be missing of the images `numbers`, before anything is read.
    pub fn missing(&self, numbers: impl Iterator<Item = u32>) -> Vec<Unreadable> {
        let mut missing = Vec::new();
        for number in numbers {
            let slot = &self.slots[number as usize];
            if matches!(slot.source, Source::Missing) {
                missing.push(slot.unreadable("is not found", true));
            }
        }
        missing
    }

    /// What was looked up so far and could not be read, in the order of the images.
    pub fn unreadable(&self) -> Vec<Unreadable> {
        let failed = |slot: &Slot| match slot.image.get() {
            Some(Err(problem)) => Some(slot.unreadable(problem, matches!(slot.source, Source::Missing))),
            _ => None,
        };
        self.slots.iter().filter_map(failed).collect()
    }

    /// Whether some image that was looked up could not be read.
    pub fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed)
    }

    /// Counts so far.
    pub fn counts(&self) -> TextureCounts {
        let spilled_bytes = self.spilled.get().map_or(0, |spill| spill.lock().end);
        TextureCounts {
            named: self.slots.len() as u64,
            read: self.read.load(Ordering::Relaxed),
            file_bytes: self.file_bytes.load(Ordering::Relaxed),
            texel_bytes: self.resident.load(Ordering::Relaxed) + spilled_bytes,
            spilled_bytes,
        }
    }

    /// The image with a number, read if it has not been; `None` if it cannot be read.
    pub(super) fn image(&self, number: u32) -> Option<&Image> {
        let slot = &self.slots[number as usize];
        let load = || {
            let image = self.load(slot);
            self.failed.fetch_or(image.is_err(), Ordering::Relaxed);
            image
        };
        slot.image.get_or_init(load).as_ref().ok()
    }

    fn load(&self, slot: &Slot) -> Result<Image, String> {
        let unreadable = |e: std::io::Error| format!("cannot be read: {e}");
        let bytes = match &slot.source {
            Source::Missing => return Err("is not found".to_owned()),
            Source::Memory(bytes) => bytes.clone(),
            Source::File(path) => {
                let known = std::fs::metadata(path).map_err(unreadable)?;
                if !known.is_file() || known.len() > MAX_FILE {
                    return Err(format!("is no plain file of at most 4 GiB ({} bytes)", known.len()));
                }
                std::fs::read(path).map_err(unreadable)?.into()
            }
        };
        self.read.fetch_add(1, Ordering::Relaxed);
        self.file_bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let Decoded { width, height, layout, depth, texels, own_space } = decode::decode(&bytes, &slot.name)?;
        let size = texels.len() as u64;
        // A quarter of the budget is for tiles of what does not fit into the rest.
        let room = self.budget() / 4 * 3;
        let fits = self
            .resident
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |used| {
                used.checked_add(size).filter(|&used| used <= room)
            })
            .is_ok();
        let texels = if fits {
            Texels::Resident(texels)
        } else {
            let texel = layout.channels() * depth.size();
            match self.spill()?.put(&texels, width as usize, height as usize, texel) {
                Ok((number, offset)) => Texels::Spilled { number, offset },
                Err(e) => {
                    return Err(format!(
                        "does not fit into the texture memory, nor into a temporary file ({e}): raise the texture memory, or \
                         set TMPDIR to a larger disk"
                    ));
                }
            }
        };
        Ok(Image { width, height, own_space, layout, depth, texels })
    }

    fn budget(&self) -> u64 {
        match self.budget.load(Ordering::Relaxed) {
            0 => DEFAULT_BUDGET,
            bytes => bytes,
        }
    }

    fn spill(&self) -> Result<&Spill, String> {
        if let Some(spill) = self.spilled.get() {
            return Ok(spill);
        }
        let file = tempfile::tempfile().map_err(|e| format!("there is no temporary file for its texels: {e}"))?;
        Ok(self.spilled.get_or_init(|| Spill::new(file, self.budget() / 4)))
    }

    /// The texel at column `x`, row `y` from the top, as stored: linear numbers, alpha 1 and greys in all colours where
    /// the image has none. The second value is whether the first three are a colour.
    pub(super) fn texel(&self, image: &Image, x: usize, y: usize) -> RawTexel {
        let size = image.layout.channels() * image.depth.size();
        match &image.texels {
            Texels::Resident(texels) => {
                let at = (y * image.width as usize + x) * size;
                image.number(&texels[at..at + size])
            }
            Texels::Spilled { number, offset } => {
                let tiles_across = (image.width as usize).div_ceil(TILE);
                let tile = y / TILE * tiles_across + x / TILE;
                let spill = self.spilled.get().expect("what is spilled has a file");
                let bytes = spill.tile((*number, tile as u64), *offset, TILE * TILE * size);
                let at = (y % TILE * TILE + x % TILE) * size;
                image.number(&bytes[at..at + size])
            }
        }
    }
}

/// A texel before its colour space.
pub(super) enum RawTexel {
    /// Eight bits: what a table can be asked for.
    Bytes([u8; 4]),
    Numbers([f32; 4]),
}

impl Image {
    fn number(&self, bytes: &[u8]) -> RawTexel {
        let spread = |c: &dyn Fn(usize) -> f32| match self.layout {
            Layout::Grey => [c(0), c(0), c(0), 1.0],
            Layout::GreyAlpha => [c(0), c(0), c(0), c(1)],
            Layout::Rg => [c(0), c(1), 0.0, 1.0],
            Layout::Rgb => [c(0), c(1), c(2), 1.0],
            Layout::Rgba => [c(0), c(1), c(2), c(3)],
        };
        let two = |k: usize| u16::from_ne_bytes([bytes[2 * k], bytes[2 * k + 1]]);
        match self.depth {
            Depth::U8 => RawTexel::Bytes(match (self.layout, bytes) {
                (Layout::Grey, &[y]) => [y, y, y, 255],
                (Layout::GreyAlpha, &[y, a]) => [y, y, y, a],
                (Layout::Rg, &[r, g]) => [r, g, 0, 255],
                (Layout::Rgb, &[r, g, b]) => [r, g, b, 255],
                (_, &[r, g, b, a]) => [r, g, b, a],
                _ => unreachable!("a texel has as many bytes as its layout says"),
            }),
            Depth::U16 => RawTexel::Numbers(spread(&|k| f32::from(two(k)) / 65535.0)),
            Depth::F16 => RawTexel::Numbers(spread(&|k| half::f16::from_bits(two(k)).to_f32())),
            Depth::F32 => RawTexel::Numbers(spread(&|k| f32::from_ne_bytes(std::array::from_fn(|i| bytes[4 * k + i])))),
        }
    }
}

impl Slot {
    fn unreadable(&self, problem: &str, missing: bool) -> Unreadable {
        Unreadable { place: format!("{} = '{}'", self.place, self.name), problem: problem.to_owned(), missing }
    }
}

/// Texels in a temporary file, and the tiles of it that are in memory.
#[derive(Debug)]
struct Spill {
    file: Mutex<SpillFile>,
    shards: [Mutex<Shard>; SHARDS],
    /// Bytes that each shard keeps.
    room: usize,
}

#[derive(Debug)]
struct SpillFile {
    file: File,
    end: u64,
    images: u64,
}

/// An image's number in the file, and a tile of it.
type TileKey = (u64, u64);

/// Tiles by the clock algorithm: the oldest that was not used since the hand last passed goes.
#[derive(Debug, Default)]
struct Shard {
    tiles: HashMap<TileKey, (Arc<[u8]>, bool)>,
    order: VecDeque<TileKey>,
    bytes: usize,
}

impl Spill {
    fn new(file: File, room: u64) -> Self {
        let room = usize::try_from(room).unwrap_or(usize::MAX) / SHARDS;
        Self {
            file: Mutex::new(SpillFile { file, end: 0, images: 0 }),
            shards: std::array::from_fn(|_| Mutex::default()),
            room,
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, SpillFile> {
        self.file.lock().expect("no thread panics while it holds the file")
    }

    /// Writes an image tile by tile; returns its number and where it begins.
    fn put(&self, texels: &[u8], width: usize, height: usize, texel: usize) -> std::io::Result<(u64, u64)> {
        let mut guard = self.lock();
        let SpillFile { file, end, images } = &mut *guard;
        let (number, offset) = (*images, *end);
        file.seek(SeekFrom::Start(offset))?;
        let mut tile = vec![0; TILE * TILE * texel];
        let mut written = 0;
        for y0 in (0..height).step_by(TILE) {
            for x0 in (0..width).step_by(TILE) {
                let columns = TILE.min(width - x0) * texel;
                for y in y0..height.min(y0 + TILE) {
                    let from = (y * width + x0) * texel;
                    tile[(y - y0) * TILE * texel..][..columns].copy_from_slice(&texels[from..from + columns]);
                }
                file.write_all(&tile)?;
                written += tile.len() as u64;
            }
        }
        *images += 1;
        *end += written;
        Ok((number, offset))
    }

    fn tile(&self, key: TileKey, offset: u64, size: usize) -> Arc<[u8]> {
        let shard = &self.shards[(key.0 + key.1) as usize % SHARDS];
        let mut shard = shard.lock().expect("no thread panics while it holds tiles");
        if let Some((tile, used)) = shard.tiles.get_mut(&key) {
            *used = true;
            return Arc::clone(tile);
        }
        let mut bytes = vec![0; size];
        let mut guard = self.lock();
        let read = guard
            .file
            .seek(SeekFrom::Start(offset + key.1 * size as u64))
            .and_then(|_| guard.file.read_exact(&mut bytes));
        drop(guard);
        assert!(read.is_ok(), "texels in a temporary file cannot be read back: {read:?}");
        let tile: Arc<[u8]> = bytes.into();
        while shard.bytes + size > self.room {
            let Some(oldest) = shard.order.pop_front() else { break };
            match shard.tiles.get_mut(&oldest) {
                Some((_, used)) if *used => {
                    *used = false;
                    shard.order.push_back(oldest);
                }
                _ => {
                    let gone = shard.tiles.remove(&oldest);
                    shard.bytes -= gone.map_or(0, |(tile, _)| tile.len());
                }
            }
        }
        shard.bytes += size;
        shard.order.push_back(key);
        shard.tiles.insert(key, (Arc::clone(&tile), false));
        tile
    }
}
