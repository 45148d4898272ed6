//! A colour of an image at texture coordinates: tile, wrap mode, bilinear filter, colour space.
//!
//! Conventions of UsdUVTexture: (0, 0) is the lower left corner of the image, whose first row is on top; the centre of the
//! texel in column i is at u = (i + ½)/width. Texels are made linear before they are mixed.
//!
//! Always the finest level: what is seen of a texture from far away becomes right as the mean over a pixel's samples. A
//! level chosen by the ray's footprint would depend on the columns that are carried, and so on what else is asked for.

use std::sync::LazyLock;

use super::color_space::{ColorSpace, Transfer};
use super::store::{Image, RawTexel, Store};

/// What is seen where coordinates leave 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wrap {
    /// The border's colour.
    Border,
    /// The texel at the edge.
    Clamp,
    /// The image again.
    Repeat,
    /// The image again, every other time the other way round.
    Mirror,
}

impl Wrap {
    /// The mode with a name of UsdUVTexture or of MaterialX. `useMetadata` is `black`, as it is where a file has none.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "black" | "useMetadata" | "constant" => Self::Border,
            "clamp" => Self::Clamp,
            "repeat" | "periodic" => Self::Repeat,
            "mirror" => Self::Mirror,
            _ => return None,
        })
    }

    /// The texel that stands for number `i` of `n`; `None` for the border.
    fn texel(self, i: i64, n: i64) -> Option<usize> {
        let inside = match self {
            Self::Border => (0..n).contains(&i).then_some(i)?,
            Self::Clamp => i.clamp(0, n - 1),
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let twice = i.rem_euclid(2 * n);
                if twice < n { twice } else { 2 * n - 1 - twice }
            }
        };
        Some(inside as usize)
    }
}

/// Which image is looked up where.
#[derive(Clone, Debug, PartialEq)]
pub enum Images {
    /// One for all coordinates.
    Single(u32),
    /// UDIM: number 1001 + u + 10 v of the tile, and the image, increasing.
    Tiles(Vec<(u32, u32)>),
}

/// How an image is looked up.
#[derive(Clone, Debug, PartialEq)]
pub struct Lookup {
    /// In what.
    pub images: Images,
    /// Of the numbers; `None` for what the file says of itself.
    pub space: Option<ColorSpace>,
    /// Along u and v; tiles are clamped.
    pub wrap: [Wrap; 2],
    /// What [`Wrap::Border`] sees.
    pub border: [f32; 4],
    /// The nearest texel instead of a mean of four.
    pub closest: bool,
}

/// Linear light of eight bits of sRGB.
static SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| Transfer::Srgb.linear(i as f32 / 255.0)));

impl Lookup {
    /// The colour (and alpha) at `uv`; `None` where there is no tile, or its image cannot be read.
    pub fn at(&self, store: &Store, uv: [f32; 2]) -> Option<[f32; 4]> {
        let [mut u, mut v] = uv.map(f64::from);
        if !(u.is_finite() && v.is_finite()) {
            return None;
        }
        let (number, wrap) = match &self.images {
            Images::Single(number) => (*number, self.wrap),
            Images::Tiles(tiles) => {
                let (column, row) = (u.floor(), v.floor());
                if !(0.0..10.0).contains(&column) || !(0.0..1000.0).contains(&row) {
                    return None;
                }
                let wanted = 1001 + column as u32 + 10 * row as u32;
                let tile = tiles.binary_search_by_key(&wanted, |tile| tile.0).ok()?;
                (u, v) = (u - column, v - row);
                (tiles[tile].1, [Wrap::Clamp; 2])
            }
        };
        let image = store.image(number)?;
        let space = self.space.unwrap_or(image.own_space);
        let (x, y) = (u * f64::from(image.width), (1.0 - v) * f64::from(image.height));
        // Beyond this a float has no texels to tell apart.
        if x.abs() > 1e15 || y.abs() > 1e15 {
            return None;
        }
        let texel = |i: i64, j: i64| self.texel(store, image, &space, wrap, [i, j]);
        if self.closest {
            return Some(texel(x.floor() as i64, y.floor() as i64));
        }
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (s, t) = ((x - 0.5 - left) as f32, (y - 0.5 - top) as f32);
        let (i, j) = (left as i64, top as i64);
        let mix =
            |a: [f32; 4], b: [f32; 4], t: f32| -> [f32; 4] { std::array::from_fn(|k| a[k] * (1.0 - t) + b[k] * t) };
        Some(mix(mix(texel(i, j), texel(i + 1, j), s), mix(texel(i, j + 1), texel(i + 1, j + 1), s), t))
    }

    /// Width and height of the image, the first of tiles, texels; `None` if it cannot be read.
    pub fn dimensions(&self, store: &Store) -> Option<[u32; 2]> {
        let number = match &self.images {
            Images::Single(number) => *number,
            Images::Tiles(tiles) => tiles.first()?.1,
        };
        store.image(number).map(|image| [image.width, image.height])
    }

    fn texel(&self, store: &Store, image: &Image, space: &ColorSpace, wrap: [Wrap; 2], [i, j]: [i64; 2]) -> [f32; 4] {
        // Rows run against v, which mirrors and repeats the same either way.
        let column = wrap[0].texel(i, i64::from(image.width));
        let row = wrap[1].texel(j, i64::from(image.height));
        let (Some(x), Some(y)) = (column, row) else { return self.border };
        let ([r, g, b], a) = match store.texel(image, x, y) {
            RawTexel::Bytes([r, g, b, a]) => {
                let rgb = match space.transfer {
                    Transfer::Srgb => [r, g, b].map(|x| SRGB[usize::from(x)]),
                    transfer => [r, g, b].map(|x| transfer.linear(f32::from(x) / 255.0)),
                };
                (rgb, f32::from(a) / 255.0)
            }
            RawTexel::Numbers([r, g, b, a]) => ([r, g, b].map(|x| space.transfer.linear(x)), a),
        };
        let [r, g, b] = space.primaries([r, g, b]);
        [r, g, b, a]
    }
}
