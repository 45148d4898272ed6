//! The file's header: magic number, version and typed attributes, in both directions.
//!
//! Attributes stand sorted by name. The ones that describe the pixels (channels, windows, compression …) come from the
//! [`Head`]; the caller's [`Metadata`] give the rest, with the types that OpenEXR defines for standard names.

use std::io::Read;
use std::path::Path;

use ::exr::compression::Compression;
use serde::{Deserialize, Serialize};

use super::layout::{self, Channel, LayerKind, Stored};
use super::{Head, LAYERS, SAMPLE_RANGE, UNIT};
use crate::error::{Error, Result};
use crate::film::aov::{self, SampleType};
use crate::film::metadata::{Attribute, Metadata};
use crate::film::spectral::Bins;
use crate::film::{SampleRange, Window};

const MAGIC: u32 = 20_000_630;
/// Version 2, single-part scan lines: no flag set.
const VERSION: u32 = 2;
/// Flag: names may be longer than 31 bytes.
const LONG_NAMES: u32 = 1 << 10;
/// Coordinates of windows stay below this (`ImfHeader.cpp`, `sanityCheck`).
const COORDINATE_LIMIT: i64 = (i32::MAX / 2) as i64;

/// Lossless compressions: OpenEXR name, code in the file, codec. The first is the default.
const COMPRESSIONS: [(&str, u8, Compression); 5] = [
    ("zip", 3, Compression::ZIP16),
    ("zips", 2, Compression::ZIP1),
    ("piz", 4, Compression::PIZ),
    ("rle", 1, Compression::RLE),
    ("none", 0, Compression::Uncompressed),
];

/// Attributes that are made from the [`Head`].
const OWN: [&str; 14] = [
    "channels",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "maxSamplesPerPixel",
    "name",
    "originalDataWindow",
    "pixelAspectRatio",
    "tiles",
    "type",
    "version",
    LAYERS,
];

/// Standard attributes that the caller may set, by the type that OpenEXR defines (`ImfStandardAttributes.h` 3.4).
const STANDARD: [(&str, &[&str]); 8] = [
    ("chromaticities", &["chromaticities"]),
    ("rational", &["framesPerSecond"]),
    ("stringvector", &["multiView"]),
    ("m44f", &["worldToCamera", "worldToNDC"]),
    ("v2f", &["adoptedNeutral", "screenWindowCenter"]),
    (
        "float",
        &[
            "altitude",
            "aperture",
            "effectiveFocalLength",
            "entrancePupilOffset",
            "expTime",
            "focus",
            "isoSpeed",
            "latitude",
            "longitude",
            "nominalFocalLength",
            "pinholeFocalLength",
            "screenWindowWidth",
            "shutterAngle",
            "tStop",
            "utcOffset",
            "whiteLuminance",
            "xDensity",
        ],
    ),
    (
        "string",
        &[
            "cameraCCTSetting",
            "cameraColorBalance",
            "cameraFirmwareVersion",
            "cameraLabel",
            "cameraMake",
            "cameraModel",
            "cameraSerialNumber",
            "cameraTintSetting",
            "cameraUuid",
            "capDate",
            "colorInteropID",
            "comments",
            "imageCounter",
            "lensFirmwareVersion",
            "lensMake",
            "lensModel",
            "lensSerialNumber",
            "lookModTransform",
            "owner",
            "reelName",
            "renderingTransform",
            "view",
            "wrapmodes",
        ],
    ),
    // Types that a film has no value for.
    ("other", &["deepImageState", "envmap", "idManifest", "keyCode", "preview", "timeCode"]),
];

/// One attribute as it stands in the file.
struct Raw {
    name: String,
    kind: &'static str,
    bytes: Vec<u8>,
}

/// A header ready to be written, and what the pixels need of it.
pub(super) struct Encoded {
    /// Everything before the offset table.
    pub(super) bytes: Vec<u8>,
    pub(super) compression: Compression,
    pub(super) channels: Vec<Channel>,
}

/// A header that was read and understood.
pub(super) struct Decoded {
    pub(super) head: Head,
    pub(super) metadata: Metadata,
    pub(super) compression: Compression,
    pub(super) channels: Vec<Channel>,
}

/// How a layer stands in the [`LAYERS`] attribute.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LayerEntry {
    name: String,
    aov: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    argument: String,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    sums: bool,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    half: bool,
}

/// The header for `head` with the caller's `metadata`.
pub(super) fn encode(head: &Head, metadata: &Metadata) -> Result<Encoded> {
    let channels = layout::channels(&head.layers)?;
    if channels.is_empty() {
        return Err(Error::usage("EXR", "the film has no layers: ask for at least one AOV"));
    }
    let (_, code, compression) = find_compression(&metadata.compression)?;
    let mut attributes = own_attributes(head, &channels, code)?;
    for (name, value) in &metadata.attributes {
        if let Some(attribute) = caller_attribute(head, name, value)? {
            match attributes.iter().find(|known| known.name == attribute.name) {
                None => attributes.push(attribute),
                Some(known) if known.bytes == attribute.bytes && known.kind == attribute.kind => {}
                Some(_) => {
                    return Err(Error::usage(
                        format!("attribute {name}"),
                        "stands twice with different values: set it once",
                    ));
                }
            }
        }
    }
    for attribute in default_attributes(head) {
        if attributes.iter().all(|known| known.name != attribute.name) {
            attributes.push(attribute);
        }
    }
    attributes.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));

    let long = channels.iter().map(|c| c.name.len()).chain(attributes.iter().map(|a| a.name.len())).any(|n| n > 31);
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&MAGIC.to_le_bytes());
    bytes.extend_from_slice(&(VERSION | if long { LONG_NAMES } else { 0 }).to_le_bytes());
    for Raw { name, kind, bytes: value } in &attributes {
        let size = i32::try_from(value.len())
            .map_err(|_| Error::usage(format!("attribute {name}"), "is longer than the 2 GiB of EXR: shorten it"))?;
        put_text(&mut bytes, name);
        put_text(&mut bytes, kind);
        bytes.extend_from_slice(&size.to_le_bytes());
        bytes.extend_from_slice(value);
    }
    bytes.push(0);
    Ok(Encoded { bytes, compression, channels })
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(text.as_bytes());
    out.push(0);
}

fn find_compression(name: &str) -> Result<(&'static str, u8, Compression)> {
    if name.is_empty() {
        return Ok(COMPRESSIONS[0]);
    }
    COMPRESSIONS.into_iter().find(|(known, ..)| *known == name).ok_or_else(|| {
        let reason = match name {
            "pxr24" | "b44" | "b44a" | "dwaa" | "dwab" => "would round the data",
            _ => "is not known",
        };
        let known = COMPRESSIONS.map(|(name, ..)| name).join(", ");
        Error::usage(format!("compression `{name}`"), format!("{reason}: choose one of {known}"))
    })
}

/// What EXR needs to find the pixels, and what tells layers apart.
fn own_attributes(head: &Head, channels: &[Channel], compression: u8) -> Result<Vec<Raw>> {
    let Head { window, resolution, .. } = head;
    let display = Window::full(*resolution);
    check_window(*window).and_then(|()| check_window(display)).map_err(|problem| Error::usage("EXR", problem))?;
    if !(head.pixel_aspect_ratio.is_normal() && head.pixel_aspect_ratio > 0.0) {
        return Err(Error::usage("pixelAspectRatio", format!("{} is not positive", head.pixel_aspect_ratio)));
    }
    let mut list = Vec::new();
    for channel in channels {
        put_text(&mut list, &channel.name);
        let sample: u32 = match channel.sample {
            Stored::Uint => 0,
            Stored::Half => 1,
            Stored::Float => 2,
        };
        // Type; pLinear and three reserved bytes; horizontal and vertical sampling.
        for word in [sample, 0, 1, 1] {
            list.extend_from_slice(&word.to_le_bytes());
        }
    }
    list.push(0);
    let entries: Vec<LayerEntry> = head
        .layers
        .iter()
        .map(|kind| LayerEntry {
            name: kind.name.clone(),
            aov: kind.aov.name.to_owned(),
            argument: kind.argument.clone(),
            sums: kind.sums,
            half: kind.half,
        })
        .collect();
    let layers = serde_json::to_string(&entries).expect("strings and flags always serialise");
    let SampleRange { begin, end, total } = head.samples;
    let raw = |name: &str, kind, bytes| Raw { name: name.to_owned(), kind, bytes };
    let mut attributes = vec![
        raw("channels", "chlist", list),
        raw("compression", "compression", vec![compression]),
        raw("dataWindow", "box2i", box_bytes(*window)),
        raw("displayWindow", "box2i", box_bytes(display)),
        raw("lineOrder", "lineOrder", vec![0]),
        raw("pixelAspectRatio", "float", head.pixel_aspect_ratio.to_le_bytes().to_vec()),
        raw(LAYERS, "string", layers.into_bytes()),
        raw(SAMPLE_RANGE, "string", format!("{begin}:{end}:{total}").into_bytes()),
    ];
    let cropped = window.x0 >= display.x0
        && window.y0 >= display.y0
        && window.x1 <= display.x1
        && window.y1 <= display.y1
        && *window != display;
    if cropped {
        attributes.push(raw("originalDataWindow", "box2i", box_bytes(display)));
    }
    Ok(attributes)
}

/// What is written unless the caller says otherwise.
fn default_attributes(head: &Head) -> Vec<Raw> {
    let mut defaults = vec![
        Raw { name: "screenWindowCenter".to_owned(), kind: "v2f", bytes: vec![0; 8] },
        Raw { name: "screenWindowWidth".to_owned(), kind: "float", bytes: 1f32.to_le_bytes().to_vec() },
    ];
    defaults.extend(head.layers.iter().map(|layer| Raw {
        name: format!("{UNIT}{}", layer.title()),
        kind: "string",
        bytes: layer.aov.unit.as_bytes().to_vec(),
    }));
    defaults
}

fn check_window(window: Window) -> Result<(), String> {
    let Window { x0, y0, x1, y1 } = window;
    if [x0, y0, x1, y1].iter().any(|&c| i64::from(c).abs() >= COORDINATE_LIMIT) {
        return Err(format!("the window {x0},{y0},{x1},{y1} is larger than EXR can say: choose a smaller one"));
    }
    if window.area() == 0 {
        return Err(format!("the window {x0},{y0},{x1},{y1} has no pixels: give it a width and a height"));
    }
    Ok(())
}

/// A `box2i`, whose corners are both inside.
fn box_bytes(window: Window) -> Vec<u8> {
    [window.x0, window.y0, window.x1 - 1, window.y1 - 1].iter().flat_map(|c| c.to_le_bytes()).collect()
}

/// The type that OpenEXR defines for the attribute `name`, if it does.
pub fn standard_type(name: &str) -> Option<&'static str> {
    STANDARD.iter().find(|(_, names)| names.contains(&name)).map(|(kind, _)| *kind)
}

/// Whether a file can have the attribute `name` with this value.
pub fn check_attribute(name: &str, value: &Attribute) -> Result<()> {
    let place = || format!("attribute {name}");
    if OWN.contains(&name) || name == SAMPLE_RANGE {
        return Err(Error::usage(place(), "comes from the film: leave it out of the metadata"));
    }
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        return Err(Error::usage(place(), "no attribute of EXR: a name has 1 to 255 bytes and no NUL"));
    }
    let standard = standard_type(name);
    let (kind, _) = encode_value(value, standard == Some("stringvector"));
    match standard {
        Some(expected) if expected != kind => Err(Error::usage(
            place(),
            format!("OpenEXR defines its type as {expected}, and other programs refuse a {kind}: set that type"),
        )),
        _ => Ok(()),
    }
}

/// The caller's attribute as it goes into the file; `None` for what the head says too.
fn caller_attribute(head: &Head, name: &str, value: &Attribute) -> Result<Option<Raw>> {
    if name == "pixelAspectRatio" && *value == Attribute::Float(head.pixel_aspect_ratio) {
        return Ok(None);
    }
    check_attribute(name, value)?;
    let (kind, bytes) = encode_value(value, standard_type(name) == Some("stringvector"));
    Ok(Some(Raw { name: name.to_owned(), kind, bytes }))
}

fn encode_value(value: &Attribute, as_list: bool) -> (&'static str, Vec<u8>) {
    fn floats<'a>(values: impl IntoIterator<Item = &'a f32>) -> Vec<u8> {
        values.into_iter().flat_map(|v| v.to_le_bytes()).collect()
    }
    match value {
        Attribute::Text(text) if as_list => {
            let mut bytes = Vec::new();
            for item in text.split(',').map(str::trim) {
                bytes.extend_from_slice(&(item.len() as i32).to_le_bytes());
                bytes.extend_from_slice(item.as_bytes());
            }
            ("stringvector", bytes)
        }
        Attribute::Text(text) => ("string", text.as_bytes().to_vec()),
        Attribute::Int(v) => ("int", v.to_le_bytes().to_vec()),
        Attribute::Float(v) => ("float", v.to_le_bytes().to_vec()),
        Attribute::Double(v) => ("double", v.to_le_bytes().to_vec()),
        Attribute::Vec2(v) => ("v2f", floats(v)),
        Attribute::Matrix(v) => ("m44f", floats(v)),
        Attribute::Rational(n, d) => ("rational", [n.to_le_bytes(), d.to_le_bytes()].concat()),
        Attribute::Chromaticities(v) => ("chromaticities", floats(v.iter().flatten())),
    }
}

/// The value of an attribute of type `kind`; `None` if a film has no such type or the bytes are wrong.
fn decode_value(kind: &str, bytes: &[u8]) -> Option<Attribute> {
    fn words<const N: usize>(bytes: &[u8]) -> Option<[[u8; 4]; N]> {
        let (words, rest) = bytes.as_chunks::<4>();
        if rest.is_empty() { words.try_into().ok() } else { None }
    }
    fn floats<const N: usize>(bytes: &[u8]) -> Option<[f32; N]> {
        words::<N>(bytes).map(|w| w.map(f32::from_le_bytes))
    }
    match kind {
        "string" => Some(Attribute::Text(String::from_utf8(bytes.to_vec()).ok()?)),
        "stringvector" => {
            let (mut items, mut rest) = (Vec::new(), bytes);
            while let Some((size, tail)) = rest.split_first_chunk::<4>() {
                let (item, tail) = tail.split_at_checked(usize::try_from(i32::from_le_bytes(*size)).ok()?)?;
                items.push(String::from_utf8(item.to_vec()).ok()?);
                rest = tail;
            }
            rest.is_empty().then(|| Attribute::Text(items.join(",")))
        }
        "int" => Some(Attribute::Int(i32::from_le_bytes(bytes.try_into().ok()?))),
        "float" => Some(Attribute::Float(f32::from_le_bytes(bytes.try_into().ok()?))),
        "double" => Some(Attribute::Double(f64::from_le_bytes(bytes.try_into().ok()?))),
        "v2f" => floats(bytes).map(Attribute::Vec2),
        "m44f" => floats(bytes).map(Attribute::Matrix),
        "rational" => {
            words(bytes).map(|[n, d]: [[u8; 4]; 2]| Attribute::Rational(i32::from_le_bytes(n), u32::from_le_bytes(d)))
        }
        "chromaticities" => floats::<8>(bytes)
            .map(|v| Attribute::Chromaticities([[v[0], v[1]], [v[2], v[3]], [v[4], v[5]], [v[6], v[7]]])),
        _ => None,
    }
}

/// Reads a header and says what the file is; `size` is the length of the whole file.
///
/// Returns the header and its length. Nothing is allocated that the file is not long enough to fill.
pub(super) fn decode(path: &Path, input: &mut impl Read, size: u64) -> Result<(Decoded, u64)> {
    let mut fields = Fields { path, input, left: size };
    if size < 8 || u32::from_le_bytes(fields.array()?) != MAGIC {
        return Err(Error::file(path, "this is not an EXR file: name one that abbe wrote"));
    }
    if u32::from_le_bytes(fields.array()?) & !LONG_NAMES != VERSION {
        return Err(Error::file(
            path,
            "a tiled, deep or multi-part EXR, which abbe does not write: name a file of abbe",
        ));
    }
    let mut attributes: Vec<(String, String, Vec<u8>)> = Vec::new();
    loop {
        let name = fields.name()?;
        if name.is_empty() {
            break;
        }
        let kind = fields.name()?;
        let size = u32::from_le_bytes(fields.array()?);
        let bytes = fields.bytes(u64::from(size))?;
        if attributes.iter().any(|(known, ..)| *known == name) {
            return Err(damaged(path, format!("attribute `{name}` stands twice")));
        }
        attributes.push((name, kind, bytes));
    }
    let length = size - fields.left;
    Ok((understand(path, attributes)?, length))
}

/// The error for content that a file of ours cannot have.
pub(super) fn damaged(path: &Path, what: impl std::fmt::Display) -> Error {
    Error::file(path, format!("the file is damaged ({what}): render or copy it again"))
}

/// Reads that stay inside the file.
struct Fields<'a, R> {
    path: &'a Path,
    input: &'a mut R,
    left: u64,
}

impl<R: Read> Fields<'_, R> {
    fn exact(&mut self, buffer: &mut [u8]) -> Result<()> {
        let ended = || damaged(self.path, "the header ends too early");
        self.left = self.left.checked_sub(buffer.len() as u64).ok_or_else(ended)?;
        self.input.read_exact(buffer).map_err(|e| Error::io(self.path, "read the header", e))
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        self.exact(&mut array)?;
        Ok(array)
    }

    fn bytes(&mut self, size: u64) -> Result<Vec<u8>> {
        if size > self.left {
            return Err(damaged(self.path, "an attribute is longer than the file"));
        }
        let mut bytes = vec![0; size as usize];
        self.exact(&mut bytes)?;
        Ok(bytes)
    }

    fn name(&mut self) -> Result<String> {
        let mut name = Vec::new();
        loop {
            match self.array::<1>()? {
                [0] => break,
                [byte] if name.len() < 255 => name.push(byte),
                _ => return Err(damaged(self.path, "a name is longer than 255 bytes")),
            }
        }
        String::from_utf8(name).map_err(|_| damaged(self.path, "a name is not UTF-8"))
    }
}

/// Makes sense of the attributes of a file of ours.
fn understand(path: &Path, mut attributes: Vec<(String, String, Vec<u8>)>) -> Result<Decoded> {
    let mut take = |name: &str, kind: &str| {
        let at = attributes.iter().position(|(known, ..)| known == name)?;
        let (_, found, bytes) = attributes.remove(at);
        (found == kind).then_some(bytes)
    };
    let mut need = |name: &str, kind: &str| {
        take(name, kind).ok_or_else(|| damaged(path, format!("no attribute `{name}` of type {kind}")))
    };
    let layers = need(LAYERS, "string").map_err(|_| {
        Error::file(path, format!("not written by abbe (no attribute `{LAYERS}`): name a file that abbe wrote"))
    })?;
    let entries: Vec<LayerEntry> =
        serde_json::from_slice(&layers).map_err(|e| damaged(path, format!("attribute `{LAYERS}`: {e}")))?;
    let mut layers = Vec::with_capacity(entries.len());
    for LayerEntry { name, aov, argument, sums, half } in entries {
        let row = aov::AOVS.iter().find(|row| row.name == aov).ok_or_else(|| {
            Error::file(
                path,
                format!("layer `{name}` has the AOV `{aov}`, unknown to this version: use the abbe that wrote it"),
            )
        })?;
        let row = if row.name == aov::SPECTRAL {
            let bins = Bins::parse(&argument).map_err(|_| damaged(path, format!("layer `{name}` has no bins")))?;
            bins.row(&name)
        } else {
            row
        };
        if sums && !row.has_sums() {
            return Err(damaged(path, format!("layer `{name}` cannot have sums")));
        }
        if half && row.sample == SampleType::Uint {
            return Err(damaged(path, format!("layer `{name}` cannot be in half floats")));
        }
        layers.push(LayerKind { aov: row, name, argument, sums, half });
    }
    let samples = String::from_utf8(need(SAMPLE_RANGE, "string")?)
        .ok()
        .and_then(|text| parse_range(&text))
        .ok_or_else(|| damaged(path, format!("attribute `{SAMPLE_RANGE}` is no sample range")))?;
    let window = read_box(&need("dataWindow", "box2i")?).ok_or_else(|| damaged(path, "dataWindow"))?;
    let display = read_box(&need("displayWindow", "box2i")?).ok_or_else(|| damaged(path, "displayWindow"))?;
    check_window(window).and_then(|()| check_window(display)).map_err(|problem| damaged(path, problem))?;
    if (display.x0, display.y0) != (0, 0) {
        return Err(damaged(path, "the display window does not begin at 0,0"));
    }
    let compression = need("compression", "compression")?;
    let (compression_name, _, codec) = COMPRESSIONS
        .into_iter()
        .find(|(_, code, _)| *compression == [*code])
        .ok_or_else(|| damaged(path, "a compression that abbe does not write"))?;
    if need("lineOrder", "lineOrder")? != [0] {
        return Err(damaged(path, "a line order that abbe does not write"));
    }
    let aspect = need("pixelAspectRatio", "float")?;
    let Some(Attribute::Float(pixel_aspect_ratio)) = decode_value("float", &aspect) else {
        return Err(damaged(path, "pixelAspectRatio"));
    };
    let list = need("channels", "chlist")?;
    take("originalDataWindow", "box2i");

    let channels = layout::channels(&layers).map_err(|e| damaged(path, e))?;
    let head = Head { resolution: [display.x1 as u32, display.y1 as u32], window, pixel_aspect_ratio, samples, layers };
    // The list has to be the very bytes that we would write: names, types and sampling are then right.
    let expected = own_attributes(&head, &channels, 0)
        .map_err(|e| damaged(path, e))?
        .into_iter()
        .find(|raw| raw.name == "channels");
    if expected.is_none_or(|raw| raw.bytes != list) {
        return Err(damaged(path, "the channels are not those of its layers"));
    }
    let defaults = default_attributes(&head);
    let mut metadata = Metadata { attributes: Vec::new(), compression: compression_name.to_owned() };
    for (name, kind, bytes) in attributes {
        if defaults.iter().any(|known| known.name == name && known.kind == kind && known.bytes == bytes) {
            continue;
        }
        let value = decode_value(&kind, &bytes).ok_or_else(|| {
            Error::file(
                path,
                format!("attribute `{name}` has a type ({kind}) or value that abbe does not write: remove it"),
            )
        })?;
        metadata.attributes.push((name, value));
    }
    metadata.attributes.sort_by(|(a, _), (b, _)| a.as_bytes().cmp(b.as_bytes()));
    Ok(Decoded { head, metadata, compression: codec, channels })
}

fn read_box(bytes: &[u8]) -> Option<Window> {
    let (words, []) = bytes.as_chunks::<4>() else { return None };
    let [x0, y0, x1, y1] = <[[u8; 4]; 4]>::try_from(words).ok()?.map(i32::from_le_bytes);
    Some(Window { x0, y0, x1: x1.checked_add(1)?, y1: y1.checked_add(1)? })
}

/// Reads `begin:end:total`.
fn parse_range(text: &str) -> Option<SampleRange> {
    let mut parts = text.split(':').map(|part| part.parse::<u32>().ok());
    let (begin, end, total) = (parts.next()??, parts.next()??, parts.next()??);
    (parts.next().is_none() && begin < end && end <= total).then_some(SampleRange { begin, end, total })
}

/// Whether two values are the same bits; NaN is itself, and 0 is not −0.
pub(super) fn same_value(a: &Attribute, b: &Attribute) -> bool {
    encode_value(a, false) == encode_value(b, false)
}
