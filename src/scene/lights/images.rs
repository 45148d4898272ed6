//! The images of rectangles and domes, read when an integrator that uses lights asks.
//!
//! (0, 0) of a lookup is the lower left corner. Longitudes go on across the left and right border of `latlong`; everywhere
//! else the image ends at its border.

use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::light::{Layout, Light, Shape};
use crate::scene::Scene;
use crate::scene::material::source;
use crate::texture::{ColorSpace, Images, Lookup, Store, Wrap};

/// What lights look like.
#[derive(Debug, Default)]
pub struct LightImages {
    /// By the description's texture; absent where no light has it or it cannot be read.
    pub lookups: Vec<Option<Lookup>>,
    /// The images, apart from those of materials: under a budget of the same size.
    pub store: Store,
    /// What could not be read.
    pub diagnostics: Diagnostics,
}

impl LightImages {
    /// Reads what `lights` of `scene` look like. An image that cannot be read is an error if the scene says so; else the
    /// light shines without.
    pub fn read(scene: &Scene, lights: &[Light]) -> Result<Self> {
        let mut diagnostics = Diagnostics::default();
        let (lookups, store) = read(scene, lights, &mut diagnostics)?;
        Ok(Self { lookups, store, diagnostics })
    }
}

fn read(scene: &Scene, lights: &[Light], diagnostics: &mut Diagnostics) -> Result<(Vec<Option<Lookup>>, Store)> {
    let document = scene.document();
    let mut store = Store::default();
    store.set_budget(scene.textures.stated_budget());
    let mut lookups: Vec<Option<Lookup>> = vec![None; document.textures.len()];
    for light in lights {
        let (index, is_round) = match &light.shape {
            Shape::Dome(dome) => (dome.texture, matches!(dome.layout, None | Some(Layout::Latlong))),
            Shape::Rectangle(patch) => (patch.texture, false),
            _ => (None, false),
        };
        let Some(index) = index.filter(|&index| lookups[index].is_none()) else { continue };
        let texture = &document.textures[index];
        let mut add = |asset| -> Result<u32> {
            let source = source(scene.description(), asset, &texture.place)?;
            Ok(store.add(asset.path.clone(), texture.place.clone(), source))
        };
        let images = if texture.tiles.is_empty() {
            Images::Single(add(&texture.asset)?)
        } else {
            let mut tiles = Vec::with_capacity(texture.tiles.len());
            for tile in &texture.tiles {
                tiles.push((tile.number, add(&tile.asset)?));
            }
            tiles.sort_unstable();
            Images::Tiles(tiles)
        };
        let space = match texture.color_space.as_str() {
            "" | "auto" => None,
            name => ColorSpace::named(name).or_else(|| {
                diagnostics.warn("color-space", &texture.place, format!("'{name}' is unknown: the file decides"));
                None
            }),
        };
        let across = if is_round { Wrap::Repeat } else { Wrap::Clamp };
        lookups[index] = Some(Lookup { images, space, wrap: [across, Wrap::Clamp], border: [0.0; 4], closest: false });
    }
    for lookup in &mut lookups {
        if lookup.as_ref().is_some_and(|lookup| lookup.dimensions(&store).is_none()) {
            *lookup = None;
        }
    }
    for image in store.unreadable() {
        if document.strict_assets {
            let problem = format!("the image {}: correct it, or render with --missing warn", image.problem);
            return Err(Error::scene(image.place.as_str(), problem));
        }
        let kind = if image.missing { "missing-texture" } else { "unreadable-texture" };
        diagnostics.warn(kind, &image.place, format!("the image {}: the light shines without", image.problem));
    }
    Ok((lookups, store))
}
