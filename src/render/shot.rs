//! What an image shows: which camera, what raster, which part of it, through what lens.
//!
//! Precedence: request > product > settings > default.

use super::request::Request;
use crate::camera::{ConformPolicy, Lens};
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::film::{SampleRange, Window};
use crate::scene::Scene;
use crate::scene::description::{self, Product};

/// Width of an image for which neither the request nor the stage says one (as usdrecord).
const DEFAULT_WIDTH: u32 = 960;
/// The largest image side: what an EXR window can address with room for arithmetic.
const MAX_SIDE: u32 = 1 << 17;
/// How many images wide or high a data window may reach.
const MAX_IMAGES: f32 = 16.0;

/// What an image shows.
pub(super) struct Shot {
    /// Index of the camera in the description.
    pub(super) camera: usize,
    pub(super) camera_path: String,
    /// Full raster, pixels.
    pub(super) resolution: [u32; 2],
    /// Pixels rendered.
    pub(super) window: Window,
    /// Before the conform policy.
    pub(super) pixel_aspect_ratio: f64,
    pub(super) conform_policy: ConformPolicy,
    pub(super) depth_of_field: DepthOfField,
}

/// Whether samples are spread over the lens, and why.
pub(super) struct DepthOfField {
    pub(super) is_on: bool,
    pub(super) why: String,
}

impl Shot {
    /// Of `product`, or of the render settings themselves.
    pub(super) fn new(
        scene: &Scene,
        request: &Request,
        product: Option<&Product>,
        samples: SampleRange,
        diagnostics: &mut Diagnostics,
    ) -> Result<Self> {
        let (camera, camera_path) = camera(scene, request, product)?;
        let authored = &scene.document().cameras[camera];
        let resolution = resolution(request, product, authored)?;
        let policy = product.map_or("expandAperture", |p| p.aspect_ratio_conform_policy.as_str());
        let conform_policy = ConformPolicy::from_token(policy).ok_or_else(|| {
            Error::scene(
                product_place(product),
                format!("unknown aspectRatioConformPolicy '{policy}': use {}", ConformPolicy::TOKENS.join(", ")),
            )
        })?;
        check_clipping(authored, diagnostics);
        Ok(Self {
            camera,
            resolution,
            window: window(request, product, resolution)?,
            pixel_aspect_ratio: product.map_or(1.0, |p| p.pixel_aspect_ratio),
            conform_policy,
            depth_of_field: depth_of_field(request, product, authored, samples, diagnostics),
            camera_path,
        })
    }
}

impl Shot {
    /// The camera as authored.
    pub(super) fn authored<'a>(&self, scene: &'a Scene) -> &'a description::Camera {
        &scene.document().cameras[self.camera]
    }
}

fn product_place(product: Option<&Product>) -> &str {
    product.map_or("render settings", |p| p.path.as_str())
}

fn camera(scene: &Scene, request: &Request, product: Option<&Product>) -> Result<(usize, String)> {
    let cameras = &scene.document().cameras;
    let index = match &request.camera {
        Some(wanted) => cameras
            .iter()
            .position(|c| c.path == *wanted || c.path.rsplit('/').next() == Some(wanted.as_str()))
            .ok_or_else(|| {
                let known: Vec<_> = cameras.iter().map(|c| c.path.as_str()).collect();
                Error::usage(
                    format!("--camera {wanted}"),
                    format!("the scene has no such camera: {}", known.join(", ")),
                )
            })?,
        None => product.and_then(|p| p.camera).unwrap_or(0),
    };
    let camera = cameras.get(index).ok_or_else(|| {
        Error::scene(
            product_place(product),
            format!("camera {index} of {} does not exist: export the stage again", cameras.len()),
        )
    })?;
    Ok((index, camera.path.clone()))
}

fn resolution(request: &Request, product: Option<&Product>, camera: &description::Camera) -> Result<[u32; 2]> {
    let authored = match product.and_then(|p| p.resolution) {
        Some([w, h]) => {
            let side = |v: i64| u32::try_from(v).ok().filter(|&v| v > 0 && v <= MAX_SIDE);
            let (Some(w), Some(h)) = (side(w), side(h)) else {
                return Err(Error::scene(
                    format!("{}.resolution", product_place(product)),
                    format!("is ({w}, {h}): each side must be 1 to {MAX_SIDE} pixels"),
                ));
            };
            Some([w, h])
        }
        None => None,
    };
    for (flag, value) in [("--width", request.width), ("--height", request.height)] {
        if value.is_some_and(|v| v == 0 || v > MAX_SIDE) {
            return Err(Error::usage(flag, format!("must be 1 to {MAX_SIDE} pixels, not {}", value.unwrap_or(0))));
        }
    }
    let aspect =
        authored.map_or(camera.horizontal_aperture / camera.vertical_aperture, |[w, h]| f64::from(w) / f64::from(h));
    // The height is cut off, as usdrecord does, but never to nothing.
    let side = |v: f64| if v.is_finite() { (v.floor() as u32).clamp(1, MAX_SIDE) } else { 1 };
    Ok(match (request.width, request.height, authored) {
        (Some(w), Some(h), _) => [w, h],
        (Some(w), None, _) => [w, side(f64::from(w) / aspect)],
        (None, Some(h), _) => [side(f64::from(h) * aspect), h],
        (None, None, Some(authored)) => authored,
        (None, None, None) => [DEFAULT_WIDTH, side(f64::from(DEFAULT_WIDTH) / aspect)],
    })
}

fn window(request: &Request, product: Option<&Product>, resolution: [u32; 2]) -> Result<Window> {
    let full = Window::full(resolution);
    if let Some([x0, y0, x1, y1]) = request.crop {
        if x0 >= x1 || y0 >= y1 {
            return Err(Error::usage(
                "--crop",
                format!("({x0}, {y0}) to ({x1}, {y1}) holds no pixel: X0,Y0,X1,Y1 are half-open, y down"),
            ));
        }
        let limit = MAX_SIDE as i32;
        if [x0, y0, x1, y1].iter().any(|v| v.abs() > limit) {
            return Err(Error::usage("--crop", format!("reaches beyond ±{limit} pixels")));
        }
        return Ok(Window { x0, y0, x1, y1 });
    }
    let Some(product) = product else { return Ok(full) };
    let [x_min, y_min, x_max, y_max] = product.data_window_ndc.map(|v| v as f32);
    if ![x_min, y_min, x_max, y_max].iter().all(|v| v.abs() <= MAX_IMAGES) {
        return Err(Error::scene(
            format!("{}.dataWindowNDC", product.path),
            format!("must be finite and within ±{MAX_IMAGES} images"),
        ));
    }
    // A pixel is inside when its centre is; NDC counts y from the bottom. In f32, which is what the attribute holds: there
    // 0.15 of 10 pixels are 1.5, as its author meant (and as hdPrman computes it).
    let first = |ndc: f32, side: u32| (ndc * side as f32 - 0.5).ceil() as i32;
    let [w, h] = resolution;
    let window =
        Window { x0: first(x_min, w), y0: first(1.0 - y_max, h), x1: first(x_max, w), y1: first(1.0 - y_min, h) };
    if window.area() == 0 {
        return Err(Error::scene(
            format!("{}.dataWindowNDC", product.path),
            "holds no pixel: min must be less than max",
        ));
    }
    Ok(window)
}

/// A range that holds nothing is ignored, and said so.
fn check_clipping(camera: &description::Camera, diagnostics: &mut Diagnostics) {
    if let Some([near, far]) = camera.clipping_range.filter(|[near, far]| near >= far || near.is_nan() || far.is_nan())
    {
        diagnostics.warn(
            "clipping-range",
            format!("{}.clippingRange", camera.path),
            format!("({near}, {far}) holds nothing, and is ignored: the near distance must be less than the far one"),
        );
    }
}

fn depth_of_field(
    request: &Request,
    product: Option<&Product>,
    camera: &description::Camera,
    samples: SampleRange,
    diagnostics: &mut Diagnostics,
) -> DepthOfField {
    let mut off = |why: &str, is_lack: bool| {
        if is_lack {
            diagnostics.warn("depth-of-field", &camera.path, format!("depth of field is not rendered: {why}"));
        }
        DepthOfField { is_on: false, why: why.to_owned() }
    };
    let is_wanted = request.depth_of_field.unwrap_or(!product.is_some_and(|p| p.disable_depth_of_field));
    let is_open = camera.f_stop > 0.0;
    if !is_wanted {
        return off(
            if request.depth_of_field.is_some() { "it is turned off" } else { "disableDepthOfField says so" },
            false,
        );
    }
    if !is_open {
        return off("the camera has no fStop, so that it is a pinhole", request.depth_of_field.is_some());
    }
    if camera.projection == "orthographic" {
        return off("an orthographic view has no lens", true);
    }
    let Some(Lens { radius, focus }) = Lens::of(camera) else {
        return off("the camera has no focusDistance: author one that is more than 0", true);
    };
    if samples.total == 1 {
        return off("one sample a pixel goes through the centre of the lens: ask for more (--samples 16)", true);
    }
    let why = format!("samples are spread over a lens of radius {radius} that is focused at {focus}");
    DepthOfField { is_on: true, why }
}
