//! Image files to texels: PNG, JPEG, TIFF, Radiance, Targa and EXR, recognised by what is in them.
//!
//! Texels keep the depth of the file. What a header claims is checked before memory is taken for it: an image has at most
//! 2³⁰ texels and its texels at most 4 GiB. Decoders run on the thread that asks, never on the pool of the render: a thread
//! that waits for an image must not be given work that waits for the same image. The JPEG decoder runs without
//! instructions that not every processor has, so that texels are the same everywhere.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ::exr::prelude as exr;
use ::exr::prelude::{ReadChannels, ReadLayers};
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::color_space::ColorSpace;

/// Most texels of an image: 32768 × 32768.
const MAX_TEXELS: u64 = 1 << 30;
/// Most bytes of an image's texels.
const MAX_BYTES: u64 = 1 << 32;
/// No compression of EXR that is read here packs tighter: 1032 is the limit of deflate.
const HIGHEST_RATIO: u64 = 1032;
/// Most channels of an EXR; only four are used.
const MAX_CHANNELS: usize = 1024;

/// Which channels an image has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    Grey,
    GreyAlpha,
    Rg,
    Rgb,
    Rgba,
}

impl Layout {
    pub(super) fn channels(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::GreyAlpha | Self::Rg => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }
}

/// How a channel is stored, native byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// 0..=255 for 0..=1.
    U8,
    /// 0..=65535 for 0..=1.
    U16,
    F16,
    F32,
}

impl Depth {
    pub(super) fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}

/// A decoded image.
#[derive(Debug)]
pub(super) struct Decoded {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) layout: Layout,
    pub(super) depth: Depth,
    /// Row by row from the top, channels together.
    pub(super) texels: Vec<u8>,
    /// What `auto` means for this file.
    pub(super) own_space: ColorSpace,
}

/// Decodes the file `bytes`; `name` is that of the file. Errors say what is wrong with it.
pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Decoded, String> {
    // A decoder of somebody else's that panics is a broken image, not the end of a render.
    catch_unwind(AssertUnwindSafe(|| decode_unguarded(bytes, name)))
        .unwrap_or_else(|_| Err("the decoder failed on it: write it again with another program".to_owned()))
}

fn decode_unguarded(bytes: &[u8], name: &str) -> Result<Decoded, String> {
    if bytes.is_empty() {
        return Err("the file is empty".to_owned());
    }
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        return decode_exr(bytes);
    }
    if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        return decode_jpeg(bytes);
    }
    let is_targa = || name.to_ascii_lowercase().ends_with(".tga");
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Tiff | ImageFormat::Hdr)) => format,
        _ if is_targa() => ImageFormat::Tga,
        _ => return Err("is no image in a format that is read: use EXR, PNG, JPEG, TIFF, HDR or TGA".to_owned()),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let damaged = |e: image::ImageError| format!("cannot be decoded: {e}");
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (layout, depth) = match decoder.color_type() {
        ColorType::L8 => (Layout::Grey, Depth::U8),
        ColorType::La8 => (Layout::GreyAlpha, Depth::U8),
        ColorType::Rgb8 => (Layout::Rgb, Depth::U8),
        ColorType::Rgba8 => (Layout::Rgba, Depth::U8),
        ColorType::L16 => (Layout::Grey, Depth::U16),
        ColorType::La16 => (Layout::GreyAlpha, Depth::U16),
        ColorType::Rgb16 => (Layout::Rgb, Depth::U16),
        ColorType::Rgba16 => (Layout::Rgba, Depth::U16),
        ColorType::Rgb32F => (Layout::Rgb, Depth::F32),
        ColorType::Rgba32F => (Layout::Rgba, Depth::F32),
        other => return Err(format!("has pixels of the kind {other:?}, which are not read")),
    };
    let mut texels = memory(width, height, layout, depth)?;
    decoder.read_image(&mut texels).map_err(damaged)?;
    let stated = if format == ImageFormat::Png { png_is_srgb(bytes) } else { None };
    Ok(Decoded { width, height, layout, depth, texels, own_space: own_space(layout, depth, stated) })
}

/// UsdPreviewSurface's `auto`: what the file states, else sRGB for three or four channels of eight bits.
fn own_space(layout: Layout, depth: Depth, stated: Option<bool>) -> ColorSpace {
    let is_srgb = stated.unwrap_or(depth == Depth::U8 && matches!(layout, Layout::Rgb | Layout::Rgba));
    if is_srgb { ColorSpace::SRGB } else { ColorSpace::RAW }
}

/// Zeros for an image, if it is one that can be.
fn memory(width: u32, height: u32, layout: Layout, depth: Depth) -> Result<Vec<u8>, String> {
    let texels = u64::from(width) * u64::from(height);
    let bytes = texels.saturating_mul((layout.channels() * depth.size()) as u64);
    if texels == 0 {
        return Err(format!("has no pixels ({width} x {height})"));
    }
    if texels > MAX_TEXELS || bytes > MAX_BYTES {
        return Err(format!("is {width} x {height}: at most 2^30 texels and 4 GiB are read, cut it into UDIM tiles"));
    }
    let mut memory = Vec::new();
    memory.try_reserve_exact(bytes as usize).map_err(|_| format!("there is no memory for {bytes} bytes of texels"))?;
    memory.resize(bytes as usize, 0);
    Ok(memory)
}

fn decode_jpeg(bytes: &[u8]) -> Result<Decoded, String> {
    use zune_jpeg::JpegDecoder;
    use zune_jpeg::zune_core::bytestream::ZCursor;
    use zune_jpeg::zune_core::colorspace::ColorSpace as Jpeg;
    use zune_jpeg::zune_core::options::DecoderOptions;
    let options = DecoderOptions::default()
        .set_use_unsafe(false)
        .set_strict_mode(false)
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX));
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let damaged = |e| format!("cannot be decoded: {e:?}");
    decoder.decode_headers().map_err(damaged)?;
    let (width, height) = decoder.dimensions().ok_or("has no size")?;
    let (layout, output) = match decoder.input_colorspace() {
        Some(Jpeg::Luma) => (Layout::Grey, Jpeg::Luma),
        _ => (Layout::Rgb, Jpeg::RGB),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(output));
    let mut texels = memory(width as u32, height as u32, layout, Depth::U8)?;
    decoder.decode_into(&mut texels).map_err(damaged)?;
    let (width, height, depth) = (width as u32, height as u32, Depth::U8);
    Ok(Decoded { width, height, layout, depth, texels, own_space: own_space(layout, depth, None) })
}

/// Whether the chunks of a PNG say that it is sRGB, or that it is not.
fn png_is_srgb(bytes: &[u8]) -> Option<bool> {
    let mut rest = bytes.get(8..)?;
    loop {
        let (head, body) = rest.split_at_checked(8)?;
        let length = u32::from_be_bytes(head[..4].try_into().ok()?) as usize;
        match &head[4..] {
            b"sRGB" => return Some(true),
            b"gAMA" => {
                let gamma = u32::from_be_bytes(body.get(..4)?.try_into().ok()?);
                // 1/2.2 in units of 1e-5, as everybody who means sRGB rounds it.
                return Some((45_000..46_000).contains(&gamma));
            }
            // A profile by its name; whether another one is sRGB in all but name is not looked at.
            b"iCCP" if body.len() >= 4 && body[..4].eq_ignore_ascii_case(b"sRGB") => return Some(true),
            b"IDAT" => return None,
            _ => rest = body.get(length.checked_add(4)?..)?,
        }
    }
}

fn decode_exr(bytes: &[u8]) -> Result<Decoded, String> {
    let damaged = |e: ::exr::error::Error| format!("cannot be decoded: {e}");
    let meta = ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    let mut claimed = 0u64;
    for header in &meta.headers {
        let size = header.layer_size;
        let texels = (size.0 as u64).saturating_mul(size.1 as u64);
        let width: u64 = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
        if header.channels.list.len() > MAX_CHANNELS {
            return Err(format!("has {} channels, more than {MAX_CHANNELS}", header.channels.list.len()));
        }
        if texels > MAX_TEXELS {
            return Err(format!(
                "is {} x {}: at most 2^30 texels and 4 GiB are read, cut it into UDIM tiles",
                size.0, size.1
            ));
        }
        claimed = claimed.saturating_add(texels.saturating_mul(width));
    }
    if claimed > (bytes.len() as u64).saturating_mul(HIGHEST_RATIO) || claimed > 4 * MAX_BYTES {
        return Err(format!("claims {claimed} bytes of pixels, which a file of {} cannot hold", bytes.len()));
    }
    let image = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let window = image.attributes.display_window;
    let layer = &image.layer_data;
    let channels = &layer.channel_data.list;
    let find = |names: &[&str]| {
        names.iter().find_map(|name| channels.iter().find(|c| c.name.to_string().eq_ignore_ascii_case(name)))
    };
    let [red, green, blue] = [["R", "Red"], ["G", "Green"], ["B", "Blue"]].map(|names| find(&names));
    let (alpha, luminance) = (find(&["A", "Alpha"]), find(&["Y"]));
    let (layout, used) = match (red, green, blue, luminance, alpha) {
        (Some(r), Some(g), Some(b), _, Some(a)) => (Layout::Rgba, vec![r, g, b, a]),
        (Some(r), Some(g), Some(b), _, None) => (Layout::Rgb, vec![r, g, b]),
        (Some(r), Some(g), None, ..) => (Layout::Rg, vec![r, g]),
        (_, _, _, Some(y), Some(a)) => (Layout::GreyAlpha, vec![y, a]),
        (_, _, _, Some(y), None) => (Layout::Grey, vec![y]),
        _ => match channels.first() {
            Some(first) if channels.len() == 1 => (Layout::Grey, vec![first]),
            _ => {
                let names: Vec<_> = channels.iter().take(8).map(|c| c.name.to_string()).collect();
                return Err(format!("has the channels {}, none of which is R or Y", names.join(", ")));
            }
        },
    };
    if used.iter().any(|c| c.sampling != exr::Vec2(1, 1)) {
        return Err("has subsampled channels: write them at full resolution".to_owned());
    }
    let is_half = used.iter().all(|c| matches!(c.sample_data, exr::FlatSamples::F16(_)));
    let depth = if is_half { Depth::F16 } else { Depth::F32 };
    let side = |n: usize| u32::try_from(n).map_err(|_| format!("has a side of {n} pixels"));
    let (width, height) = (side(window.size.0)?, side(window.size.1)?);
    let mut texels = memory(width, height, layout, depth)?;
    // What lies outside of the display window is overscan, and what is not in the data window is black.
    let offset = layer.attributes.layer_position - window.position;
    let (texel, stride) = (layout.channels() * depth.size(), layer.size.0);
    for (k, channel) in used.iter().enumerate() {
        for y in 0..layer.size.1 {
            let row = y as i64 + i64::from(offset.1);
            if !(0..i64::from(height)).contains(&row) {
                continue;
            }
            for x in 0..stride {
                let column = x as i64 + i64::from(offset.0);
                if !(0..i64::from(width)).contains(&column) {
                    continue;
                }
                let at = (row as usize * width as usize + column as usize) * texel + k * depth.size();
                let from = y * stride + x;
                match (depth, &channel.sample_data) {
                    (Depth::F16, exr::FlatSamples::F16(v)) => {
                        texels[at..at + 2].copy_from_slice(&v[from].to_bits().to_ne_bytes());
                    }
                    (_, exr::FlatSamples::F16(v)) => {
                        texels[at..at + 4].copy_from_slice(&v[from].to_f32().to_ne_bytes());
                    }
                    (_, exr::FlatSamples::F32(v)) => texels[at..at + 4].copy_from_slice(&v[from].to_ne_bytes()),
                    (_, exr::FlatSamples::U32(v)) => {
                        texels[at..at + 4].copy_from_slice(&(v[from] as f32).to_ne_bytes())
                    }
                }
            }
        }
    }
    Ok(Decoded { width, height, layout, depth, texels, own_space: ColorSpace::RAW })
}
