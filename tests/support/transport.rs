//! Scenes with light, and what is asked of their pictures.

use abbe::film::{Film, Values};
use abbe::render::Request;
use abbe::scene::description::{
    Array, Asset, Authored, Element, Light, LightShape, Node, NodeOutput, Primvar, Shape, Texture,
};
use glam::{DMat4, DVec3};
use serde_json::json;

use super::{Stagehand, authored, request};

/// A white light of intensity 1 with a place of its own.
pub fn light(path: &str, shape: LightShape, transform: DMat4) -> Light {
    Light { transform: Some(transform.to_cols_array()), ..super::light(path, shape) }
}

pub fn dome() -> LightShape {
    LightShape::Dome {
        texture: None,
        format: "automatic".into(),
        pole_axis: "Y".into(),
        guide_radius: 1e5,
        portals: Vec::new(),
    }
}

pub fn sphere(radius: f64) -> LightShape {
    LightShape::Sphere { radius, treat_as_point: false }
}

pub fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

pub fn number(value: f64) -> Authored {
    authored("float", json!(value))
}

pub fn color(rgb: [f64; 3]) -> Authored {
    authored("color3f", json!(rgb))
}

pub fn open_pbr(s: &mut Stagehand, inputs: &[(&str, Authored)]) -> usize {
    s.surface("/World/Material", "ND_open_pbr_surface_surfaceshader", inputs, &[])
}

/// Lambert of this albedo.
pub fn lambert(s: &mut Stagehand, albedo: f64) -> usize {
    open_pbr(s, &[("base_color", color([albedo; 3])), ("specular_weight", number(0.0))])
}

pub fn color_request(width: u32, height: u32, samples: u32, integrator: &str) -> Request {
    Request {
        samples: Some(samples),
        integrator: Some(integrator.into()),
        pixel_filter: Some("box".into()),
        pixel_filter_width: Some(1.0),
        ..request(width, height, &["color", "variance"])
    }
}

pub fn values<'f>(film: &'f Film, layer: &str) -> &'f [f32] {
    let layer = film.layers.iter().find(|l| l.name == layer || l.aov.name == layer).expect("was asked for");
    match &layer.values {
        Values::Float(values) => values,
        Values::Uint(_) => panic!("holds integers"),
    }
}

/// Means of all pixels, R, G, B, and the squared standard errors of these means.
pub fn mean(film: &Film) -> ([f64; 3], [f64; 3]) {
    let (color, variance) = (values(film, "color"), values(film, "variance"));
    let pixels = (variance.len() / 3) as f64;
    let mut sums = ([0.0; 3], [0.0; 3]);
    for (rgba, v) in color.chunks_exact(4).zip(variance.chunks_exact(3)) {
        for i in 0..3 {
            sums.0[i] += f64::from(rgba[i]) / pixels;
            sums.1[i] += f64::from(v[i]) / (pixels * pixels);
        }
    }
    sums
}

/// A ball of a material over a grey floor and before a wall of stripes, under a dome and a large lamp.
pub fn still_life(material: impl FnOnce(&mut Stagehand) -> usize, lights: Vec<Light>) -> Stagehand {
    let mut s = Stagehand::new();
    let grey = lambert(&mut s, 0.5);
    let material = material(&mut s);
    s.wall(-3.0, 8.0, Some(grey));
    s.sphere("/World/Ball", 1.0, at(0.1, 0.0, 0.0), Some(material));
    s.camera(DVec3::new(0.2, 0.5, 5.0), DVec3::ZERO);
    s.document.groups[0].lights = lights;
    s
}

pub fn soft_lights() -> Vec<Light> {
    vec![
        Light { intensity: 0.3, color: [0.7, 0.9, 1.0], ..light("/World/Dome", dome(), DMat4::IDENTITY) },
        Light { intensity: 1.5, color: [1.0, 0.8, 0.6], ..light("/World/Lamp", sphere(2.4), at(4.0, 4.5, 2.0)) },
    ]
}

/// A square image in sRGB; `pixel` from the upper left corner.
pub fn image(s: &mut Stagehand, size: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> usize {
    let mut file = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_fn(size, size, |x, y| image::Rgb(pixel(x, y)));
    image.write_to(&mut file, image::ImageFormat::Png).unwrap();
    let number = s.document.textures.len();
    let name = format!("image{number}");
    s.arrays.insert(name.clone(), Array::from_vec(Element::U8, 1, file.into_inner()));
    s.document.textures.push(Texture {
        place: format!("/World/Image{number}.inputs:file"),
        asset: Asset { path: format!("{name}.png"), file: None, content: Some(name) },
        tiles: Vec::new(),
        color_space: String::new(),
    });
    number
}

/// A black surface that glows as a texture says.
pub fn glowing_picture(s: &mut Stagehand, texture: usize) -> usize {
    let index = s.surface("/World/Picture", "UsdPreviewSurface", &[("diffuseColor", color([0.0; 3]))], &[]);
    let material = &mut s.document.materials[index];
    material.nodes = vec![
        Node {
            path: "/World/Picture/Place".into(),
            id: "UsdPrimvarReader_float2".into(),
            inputs: [("varname".to_owned(), authored("string", json!("st")))].into(),
            connected: Default::default(),
            textures: Default::default(),
        },
        Node {
            path: "/World/Picture/Image".into(),
            id: "UsdUVTexture".into(),
            inputs: Default::default(),
            connected: [("st".to_owned(), NodeOutput { node: 0, output: "result".into() })].into(),
            textures: [("file".to_owned(), texture)].into(),
        },
    ];
    let surface = material.surface.as_mut().unwrap();
    surface.connected = [("emissiveColor".to_owned(), "/World/Picture/Image.outputs:rgb".to_owned())].into();
    surface.networks = [("emissiveColor".to_owned(), NodeOutput { node: 1, output: "rgb".into() })].into();
    index
}

impl Stagehand {
    /// The square −1..1 in x and y that faces −z, as a rectangle light does, and has its texture coordinates.
    pub fn unit_square(&mut self, path: &str, transform: DMat4, material: usize) {
        let points = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        self.mesh(path, &points, &[&[3, 2, 1, 0]], transform, Some(material));
        let name = format!("{path}.st");
        let uv = points.map(|[x, y, _]: [f32; 3]| [0.5 - 0.5 * x, 0.5 + 0.5 * y]);
        self.arrays.insert(name.clone(), Array::from_vec(Element::F32, 2, uv.to_vec()));
        if let Some(Shape::Mesh(mesh)) = self.document.shapes.last_mut() {
            mesh.uv = Some(Primvar { values: name, indices: None, interpolation: "vertex".into() });
            mesh.uv_name = Some("st".into());
        }
    }
}
