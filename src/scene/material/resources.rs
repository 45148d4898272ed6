//! What the materials of a scene share: images, and the primvars that they look up.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::scene::description::{Asset, Description, Element};
use crate::texture::{Images, Source, Store};

/// Images and primvars by number, collected while materials are compiled.
#[derive(Debug)]
pub(in crate::scene) struct Resources<'a> {
    description: &'a Description,
    /// What each of the document's textures is in the store, as far as materials asked.
    images: Vec<Option<Images>>,
    pub(in crate::scene) store: Store,
    /// Names of primvars.
    pub(in crate::scene) primvars: Vec<String>,
}

impl<'a> Resources<'a> {
    pub(in crate::scene) fn new(description: &'a Description) -> Self {
        let images = vec![None; description.document.textures.len()];
        Self { description, images, store: Store::default(), primvars: Vec::new() }
    }

    /// The number of the primvar `name`.
    pub(in crate::scene) fn primvar(&mut self, name: &str) -> u32 {
        let known = self.primvars.iter().position(|other| other == name);
        known.unwrap_or_else(|| {
            self.primvars.push(name.to_owned());
            self.primvars.len() - 1
        }) as u32
    }

    /// The images of the document's texture `index`, and the colour space that is stated for it; `place` names who asks.
    pub(super) fn images(&mut self, index: usize, place: &str) -> Result<(Images, &'a str)> {
        let textures = &self.description.document.textures;
        let Some(texture) = textures.get(index) else {
            let problem =
                format!("refers to texture {index} of {}: the scene file is damaged, export it again", textures.len());
            return Err(Error::scene(place, problem));
        };
        if let Some(images) = &self.images[index] {
            return Ok((images.clone(), &texture.color_space));
        }
        let images = if texture.tiles.is_empty() {
            Images::Single(self.add(&texture.asset, &texture.place)?)
        } else {
            let mut tiles = Vec::with_capacity(texture.tiles.len());
            for tile in &texture.tiles {
                tiles.push((tile.number, self.add(&tile.asset, &texture.place)?));
            }
            tiles.sort_unstable();
            Images::Tiles(tiles)
        };
        self.images[index] = Some(images.clone());
        Ok((images, &texture.color_space))
    }

    fn add(&mut self, asset: &Asset, place: &str) -> Result<u32> {
        let source = source(self.description, asset, place)?;
        Ok(self.store.add(asset.path.clone(), place.to_owned(), source))
    }
}

/// Where the content of a file is; `place` names who refers to it.
pub(in crate::scene) fn source(description: &Description, asset: &Asset, place: &str) -> Result<Source> {
    match (&asset.content, &asset.file) {
        (Some(name), _) => match description.arrays.get(name) {
            Some(array) if array.element == Element::U8 => Ok(Source::Memory(array.bytes.clone())),
            _ => Err(Error::scene(place, format!("its file's array '{name}' is missing: export the stage again"))),
        },
        (None, Some(file)) => Ok(Source::File(PathBuf::from(file))),
        (None, None) => Ok(Source::Missing),
    }
}
