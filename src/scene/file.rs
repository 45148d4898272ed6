//! The scene description as a safetensors file: the document as the byte tensor `scene.json` beside the arrays.
//!
//! The file is what farms move and what `abbe-render` reads. Its content is checked like any other description; a hostile
//! file gets an error. Arrays are shared with the file's memory, whether it was read (the default) or mapped.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use bytes::Bytes;
use safetensors::tensor::{Dtype, SafeTensors, View};

use super::description::{Array, Description, Element, FORMAT};
use crate::atomic;
use crate::error::{Error, Result};

/// Name of the tensor that holds the document.
const DOCUMENT: &str = "scene.json";

struct Tensor<'a> {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: &'a [u8],
}

impl View for &Tensor<'_> {
    fn dtype(&self) -> Dtype {
        self.dtype
    }
    fn shape(&self) -> &[usize] {
        &self.shape
    }
    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.bytes)
    }
    fn data_len(&self) -> usize {
        self.bytes.len()
    }
}

/// Writes `description` to `path`, by way of a temporary file that is renamed when complete.
///
/// The same description gives the same bytes.
pub fn write(path: &Path, description: &Description) -> Result<()> {
    let json = serde_json::to_vec(&description.document).expect("the document has string keys and finite structure");
    let mut tensors = BTreeMap::new();
    tensors.insert(DOCUMENT.to_owned(), Tensor { dtype: Dtype::U8, shape: vec![json.len()], bytes: &json });
    for (name, array) in &description.arrays {
        if name == DOCUMENT {
            return Err(Error::scene(name.as_str(), "is the document's own name: rename the array"));
        }
        let dtype = match array.element {
            Element::F32 => Dtype::F32,
            Element::F64 => Dtype::F64,
            Element::I32 => Dtype::I32,
            Element::U8 => Dtype::U8,
        };
        tensors.insert(name.clone(), Tensor { dtype, shape: array.shape.clone(), bytes: &array.bytes });
    }
    let metadata = std::collections::HashMap::from([("format".to_owned(), FORMAT.to_owned())]);
    let bytes = safetensors::serialize(&tensors, Some(metadata))
        .map_err(|e| Error::file(path, format!("cannot be put together: {e}")))?;
    atomic::replace(path, |out| atomic::put(out, path, &bytes))
}

/// The description with what is in the files that it names, images and profiles of lights, so that it is whole on another
/// machine.
///
/// Files that cannot be read stay names: they are warned of where they are looked up.
pub fn embedded(description: &Description) -> Description {
    let mut whole = description.clone();
    let Description { document, arrays } = &mut whole;
    let images = document.textures.iter_mut().flat_map(|texture| {
        let tiles = texture.tiles.iter_mut().map(|tile| &mut tile.asset);
        std::iter::once(&mut texture.asset).chain(tiles)
    });
    let lights = document.groups.iter_mut().flat_map(|group| &mut group.lights);
    let profiles = lights.filter_map(|light| light.shaping.as_mut()?.ies.as_mut());
    let mut known: BTreeMap<String, String> = BTreeMap::new();
    for asset in images.chain(profiles) {
        let Some(file) = asset.file.clone() else { continue };
        if !known.contains_key(&file) {
            let Ok(content) = std::fs::read(&file) else { continue };
            let name = format!("file{}.content", known.len());
            arrays.insert(name.clone(), Array::from_vec(Element::U8, 1, content));
            known.insert(file.clone(), name);
        }
        asset.content = known.get(&file).cloned();
        asset.file = None;
    }
    whole
}

/// Reads the scene file `path`; `mapped` maps it into memory instead (it must then not change while it is in use).
pub fn read(path: &Path, mapped: bool) -> Result<Description> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let bytes = if mapped { map(path, &file)? } else { load(path, file)? };
    parse(&bytes, &path.display().to_string())
}

/// Reads a scene file's content; `place` names it in errors.
pub fn parse(bytes: &Bytes, place: &str) -> Result<Description> {
    let tensors = SafeTensors::deserialize(bytes)
        .map_err(|e| Error::scene(place, format!("is not a scene file: {e}; `abbe export` writes one")))?;
    let mut json = None;
    let mut arrays = BTreeMap::new();
    for (name, view) in tensors.iter() {
        if name == DOCUMENT {
            json =
                Some(std::str::from_utf8(view.data()).map_err(|_| Error::scene(place, "its document is not UTF-8"))?);
            continue;
        }
        let element = match view.dtype() {
            Dtype::F32 => Element::F32,
            Dtype::F64 => Element::F64,
            Dtype::I32 => Element::I32,
            Dtype::U8 => Element::U8,
            other => return Err(Error::scene(place, format!("array '{name}' has the unknown type {other:?}"))),
        };
        let shape = view.shape().to_vec();
        arrays.insert(name.to_owned(), Array { element, shape, bytes: bytes.slice_ref(view.data()) });
    }
    let json = json.ok_or_else(|| {
        Error::scene(
            place,
            format!("has no '{DOCUMENT}': it is a safetensors file, but not a scene written by `abbe export`"),
        )
    })?;
    Description::from_json(json, arrays, place)
}

/// The whole file in memory aligned to 8 bytes, as the arrays need.
fn load(path: &Path, mut file: File) -> Result<Bytes> {
    struct Owner {
        words: Vec<u64>,
        length: usize,
    }
    impl AsRef<[u8]> for Owner {
        fn as_ref(&self) -> &[u8] {
            &bytemuck::cast_slice(&self.words)[..self.length]
        }
    }
    let length = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
    let length = usize::try_from(length).map_err(|_| Error::file(path, "is larger than the address space"))?;
    let mut words = Vec::new();
    words.try_reserve_exact(length.div_ceil(8)).map_err(|_| {
        Error::file(path, format!("needs {length} bytes of memory, more than there is: map it instead"))
    })?;
    words.resize(length.div_ceil(8), 0u64);
    file.read_exact(&mut bytemuck::cast_slice_mut(&mut words)[..length]).map_err(|e| Error::io(path, "read", e))?;
    Ok(Bytes::from_owner(Owner { words, length }))
}

#[allow(
    unsafe_code,
    reason = "mapping a file is unsafe because another process may change it; asked for explicitly, documented in `read`"
)]
fn map(path: &Path, file: &File) -> Result<Bytes> {
    // SAFETY: the mapping is read-only and private; the caller asked for it knowing that the file must not change.
    let mapping = unsafe { memmap2::Mmap::map(file) }.map_err(|e| Error::io(path, "map", e))?;
    Ok(Bytes::from_owner(mapping))
}
