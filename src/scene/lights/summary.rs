//! Lights in words, for listings and plans.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Lights;
use crate::light::{Light, Shape, Spectrum, luminance};
use crate::scene::Scene;
use crate::scene::description::{Document, LightShape};
use crate::spectrum::illuminant::{Illuminant, Lamp};

/// One light as a listing has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Prim path.
    pub path: String,
    /// `distant`, `dome`, `rect`, `disk`, `sphere`, `point`, `cylinder`, `line` or `geometry`.
    pub kind: &'static str,
    /// Its middle in the stage's world, for lights that are somewhere.
    pub position: Option<[f64; 3]>,
    /// Where it shines to, of what shines to one side.
    pub direction: Option<[f64; 3]>,
    /// In the stage's world, of surfaces.
    pub area: Option<f64>,
    /// Emission in linear Rec. 709: luminance in nits of what is seen, illuminance in lux of parallel light.
    pub emission: [f64; 3],
    /// `D65`, `A`, `E`, `FL2` …, `daylight` of another temperature, `blackbody 3200 K` or `table`.
    pub spectrum: String,
    /// Luminous power, nits times area times steradian, of surfaces; textures taken as white.
    pub power: Option<f64>,
    /// Focus, cone or profile shape it.
    pub shaped: bool,
    /// The file it looks like, as authored.
    pub texture: Option<String>,
    /// Light group.
    pub group: Option<String>,
    /// The collection of what it illuminates; everything if absent.
    pub illuminates: Option<String>,
    /// The collection of what casts shadows in it; everything if absent.
    pub shadowed_by: Option<String>,
}

impl Summary {
    /// Of all `lights` of `scene`.
    pub fn all(scene: &Scene, lights: &Lights) -> Vec<Self> {
        lights.lights.iter().map(|light| Self::of(scene, lights, light)).collect()
    }

    fn of(scene: &Scene, lights: &Lights, light: &Light) -> Self {
        let document = scene.document();
        let (kind, position, direction, texture) = match &light.shape {
            Shape::Distant(distant) => ("distant", None, Some(-distant.toward), None),
            Shape::Dome(dome) => ("dome", None, None, dome.texture),
            Shape::Rectangle(patch) => ("rect", Some(patch.center), Some(patch.normal), patch.texture),
            Shape::Disk(patch) => ("disk", Some(patch.center), Some(patch.normal), None),
            Shape::Sphere(ball) => (if ball.is_point { "point" } else { "sphere" }, Some(ball.center), None, None),
            Shape::Cylinder(tube) => (if tube.is_line { "line" } else { "cylinder" }, Some(tube.center), None, None),
            Shape::Geometry(_) => ("geometry", None, None, None),
        };
        let set = |set: Option<u32>| set.map(|set| document.link_sets[set as usize].path.clone());
        Self {
            path: light.path.clone(),
            kind,
            position: position.map(Into::into),
            direction: direction.map(Into::into),
            // Points and lines have none.
            area: light.shape.area().filter(|_| !matches!(kind, "point" | "line")),
            emission: light.emission.rgb,
            spectrum: match &light.emission.spectrum {
                Spectrum::Table(_) => "table".into(),
                Spectrum::Illuminant(illuminant) => match illuminant {
                    Illuminant::E => "E".into(),
                    Illuminant::A => "A".into(),
                    Illuminant::D65 => "D65".into(),
                    Illuminant::Daylight(_) => "daylight".into(),
                    Illuminant::BlackBody(kelvin) => format!("blackbody {kelvin} K"),
                    Illuminant::Fluorescent(Lamp::Fl2) => "FL2".into(),
                    Illuminant::Fluorescent(Lamp::Fl7) => "FL7".into(),
                    Illuminant::Fluorescent(Lamp::Fl11) => "FL11".into(),
                },
            },
            power: light.power().map(luminance),
            shaped: light.shaping.is_some(),
            texture: texture.map(|index| document.textures[index].asset.path.clone()),
            group: light.group.map(|group| lights.groups[group as usize].clone()),
            illuminates: set(light.illuminates),
            shadowed_by: set(light.shadowed_by),
        }
    }
}

/// How many lights of which kind a document has; those of prototypes once. Portals are none.
pub fn kinds(document: &Document) -> BTreeMap<&'static str, usize> {
    let mut kinds = BTreeMap::new();
    for light in document.groups.iter().flat_map(|group| &group.lights) {
        let kind = match light.shape {
            LightShape::Distant { .. } => "distant",
            LightShape::Dome { .. } => "dome",
            LightShape::Rect { .. } => "rect",
            LightShape::Disk { .. } => "disk",
            LightShape::Sphere { .. } => "sphere",
            LightShape::Cylinder { .. } => "cylinder",
            LightShape::Geometry { .. } => "geometry",
            LightShape::Portal { .. } => continue,
        };
        *kinds.entry(kind).or_default() += 1;
    }
    kinds
}
