//! A background plate that glass refracts: the image behind everything, as the camera has it.
//!
//! Where a ray leaves the scene after nothing but transmissions, it sees the plate at the place on screen where its direction points.
//! Where nothing is in front, the picture stays empty (colour and alpha 0): laid over the plate it is complete.

use glam::DVec3;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::spectrum::reflectance::Unbounded;
use crate::spectrum::{SampledSpectrum, Wavelengths, sensor};
use crate::texture::{DEFAULT_BUDGET, Images, Lookup, Source, Store, Wrap};

/// A plate.
#[derive(Debug)]
pub(super) struct Plate {
    store: Store,
    lookup: Lookup,
    resolution: [f64; 2],
}

impl Plate {
    /// From an image file that fills the raster.
    pub(super) fn open(path: &str, resolution: [u32; 2]) -> Result<Self> {
        let mut store = Store::default();
        store.set_budget(DEFAULT_BUDGET);
        let image = store.add(path.to_owned(), "--plate".to_owned(), Source::File(path.into()));
        let wrap = [Wrap::Clamp; 2];
        let lookup = Lookup { images: Images::Single(image), space: None, wrap, border: [0.0; 4], closest: false };
        if lookup.at(&store, [0.5; 2]).is_none() {
            let why =
                store.unreadable().first().map_or_else(|| "cannot be read".to_owned(), |image| image.problem.clone());
            return Err(Error::usage(format!("--plate {path}"), why));
        }
        Ok(Self { store, lookup, resolution: resolution.map(f64::from) })
    }

    /// Radiance per nm in a direction; nothing where the camera has no picture.
    pub(super) fn radiance<const N: usize>(
        &self,
        camera: &Camera,
        direction: DVec3,
        time: f64,
        wavelengths: &Wavelengths<N>,
    ) -> SampledSpectrum<N> {
        let Some(place) = camera.raster_of(direction, true, time) else { return SampledSpectrum::ZERO };
        let uv = [place.x / self.resolution[0], 1.0 - place.y / self.resolution[1]].map(|x| x as f32);
        let Some([r, g, b, _]) = self.lookup.at(&self.store, uv) else { return SampledSpectrum::ZERO };
        let white = SampledSpectrum::from_fn(|lane| sensor::white(wavelengths.lane(lane)) as f32);
        Unbounded::of_color([r, g, b].map(|c| c.max(0.0))).at(wavelengths) * white
    }
}
