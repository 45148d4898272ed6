//! Scenes for tests, described as a bridge would.

#![allow(dead_code, unreachable_pub, reason = "every test file includes this module and uses its own part")]

pub mod transport;

use std::collections::BTreeMap;

use abbe::film::Film;
use abbe::integrator::Registry;
use abbe::render::{Control, Plan, Rendered, Request, plan, render};
use abbe::scene::Scene;
use abbe::scene::description::{
    Array, Arrays, Authored, Camera, Description, Document, Element, FORMAT, Group, Light, LightShape, Material, Mesh,
    Placement, Primvar, Settings, Shader, Shape, Stage, Target, VERSION,
};
use glam::{DMat4, DVec3};
use serde_json::json;

pub const SF11: ([f64; 3], [f64; 3]) =
    ([1.737_596_95, 0.313_747_346, 1.898_781_01], [0.013_188_707, 0.062_306_814_2, 155.236_29]);
pub const BK7: ([f64; 3], [f64; 3]) =
    ([1.039_612_12, 0.231_792_344, 1.010_469_45], [0.006_000_698_67, 0.020_017_914_4, 103.560_653]);

/// A scene in the making; every method adds to it.
pub struct Stagehand {
    pub document: Document,
    pub arrays: Arrays,
}

pub fn authored(type_name: &str, value: serde_json::Value) -> Authored {
    Authored { type_name: type_name.into(), value }
}

impl Stagehand {
    pub fn new() -> Self {
        let document = Document {
            format: FORMAT.into(),
            version: VERSION,
            stage: Stage {
                source: "test.usda".into(),
                meters_per_unit: 0.01,
                up_axis: "Y".into(),
                time_code: None,
                frames_per_second: Some(24.0),
                time_codes_per_second: Some(24.0),
                motion: None,
            },
            shapes: vec![],
            groups: vec![Group { path: "/".into(), ..Group::default() }],
            root: 0,
            materials: vec![],
            cameras: vec![],
            settings: Settings::default(),
            warnings: Default::default(),
            skipped: BTreeMap::new(),
            textures: Vec::new(),
            strict_assets: false,
            link_sets: Vec::new(),
        };
        Self { document, arrays: Arrays::new() }
    }

    /// A material of one shader.
    pub fn surface(&mut self, path: &str, id: &str, inputs: &[(&str, Authored)], abbe: &[(&str, Authored)]) -> usize {
        let map = |list: &[(&str, Authored)]| list.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        self.document.materials.push(Material {
            path: path.into(),
            abbe: map(abbe),
            interface_abbe: BTreeMap::new(),
            surface: Some(Shader {
                path: format!("{path}/Surface"),
                id: id.into(),
                terminal: "outputs:surface".into(),
                inputs: map(inputs),
                connected: BTreeMap::new(),
                networks: BTreeMap::new(),
                abbe: BTreeMap::new(),
            }),
            alternatives: Vec::new(),
            nodes: Vec::new(),
        });
        self.document.materials.len() - 1
    }

    pub fn glass(&mut self, path: &str, law: ([f64; 3], [f64; 3])) -> usize {
        self.authored_glass(
            path,
            &[
                ("abbe:dispersion:sellmeier:b", authored("double[]", json!(law.0))),
                ("abbe:dispersion:sellmeier:c", authored("double[]", json!(law.1))),
            ],
        )
    }

    pub fn glass_with_priority(&mut self, path: &str, law: ([f64; 3], [f64; 3]), priority: i32) -> usize {
        let index = self.glass(path, law);
        self.document.materials[index].abbe.insert("abbe:dielectricPriority".into(), authored("int", json!(priority)));
        index
    }

    /// Clear with these attributes of ours.
    pub fn authored_glass(&mut self, path: &str, abbe: &[(&str, Authored)]) -> usize {
        self.surface(
            path,
            "ND_open_pbr_surface_surfaceshader",
            &[
                ("transmission_weight", authored("float", json!(1.0))),
                ("specular_roughness", authored("float", json!(0.0))),
            ],
            abbe,
        )
    }

    pub fn constant_glass(&mut self, path: &str, ior: f64) -> usize {
        self.surface(
            path,
            "ND_open_pbr_surface_surfaceshader",
            &[
                ("transmission_weight", authored("float", json!(1.0))),
                ("specular_roughness", authored("float", json!(0.0))),
                ("specular_ior", authored("float", json!(ior))),
            ],
            &[],
        )
    }

    pub fn diffuse(&mut self, path: &str) -> usize {
        self.surface(path, "UsdPreviewSurface", &[("ior", authored("float", json!(1.5)))], &[])
    }

    pub fn sphere(&mut self, path: &str, radius: f64, transform: DMat4, material: Option<usize>) {
        self.document.shapes.push(Shape::Sphere { path: path.into(), radius });
        self.place(path, transform, material);
    }

    /// A shape that needs no arrays.
    pub fn solid(&mut self, shape: Shape, transform: DMat4, material: Option<usize>) {
        let path = shape.path().to_owned();
        self.document.shapes.push(shape);
        self.place(&path, transform, material);
    }

    /// A polygon mesh, right-handed: counter-clockwise from outside.
    pub fn mesh(
        &mut self,
        path: &str,
        points: &[[f32; 3]],
        faces: &[&[i32]],
        transform: DMat4,
        material: Option<usize>,
    ) {
        let n = self.document.shapes.len();
        let name = |what: &str| format!("shape{n}.{what}");
        self.arrays.insert(name("points"), Array::from_vec(Element::F32, 3, points.to_vec()));
        let counts: Vec<i32> = faces.iter().map(|f| f.len() as i32).collect();
        let indices: Vec<i32> = faces.concat();
        self.arrays.insert(name("counts"), Array::from_vec(Element::I32, 1, counts));
        self.arrays.insert(name("indices"), Array::from_vec(Element::I32, 1, indices));
        self.document.shapes.push(Shape::Mesh(Mesh {
            path: path.into(),
            points: name("points"),
            face_vertex_counts: name("counts"),
            face_vertex_indices: name("indices"),
            hole_indices: None,
            left_handed: false,
            normals: None,
            uv: None,
            uv_name: None,
            primvars: BTreeMap::new(),
            subsets: vec![],
            subdivision: None,
            motion: None,
        }));
        self.place(path, transform, material);
    }

    /// Gives the last mesh vertex normals.
    pub fn vertex_normals(&mut self, normals: &[[f32; 3]]) {
        let n = self.document.shapes.len() - 1;
        let name = format!("shape{n}.normals");
        self.arrays.insert(name.clone(), Array::from_vec(Element::F32, 3, normals.to_vec()));
        if let Some(Shape::Mesh(mesh)) = self.document.shapes.last_mut() {
            mesh.normals = Some(Primvar { values: name, indices: None, interpolation: "vertex".into() });
        }
    }

    fn place(&mut self, path: &str, transform: DMat4, material: Option<usize>) {
        let shape = self.document.shapes.len() - 1;
        self.document.groups[0].items.push(Placement {
            path: path.into(),
            target: Target::Shape(shape),
            transform: Some(transform.to_cols_array()),
            material,
            ..Placement::default()
        });
    }

    /// A wall: the plane z = `z`, facing +z.
    pub fn wall(&mut self, z: f32, half: f32, material: Option<usize>) {
        self.mesh(
            "/World/Wall",
            &[[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]],
            &[&[0, 1, 2, 3]],
            DMat4::IDENTITY,
            material,
        );
    }

    /// A 60° prism with its edges along y, apex up in x.
    pub fn prism(&mut self, transform: DMat4, material: Option<usize>) {
        let h = 3f32.sqrt() / 2.0;
        let mut points = Vec::new();
        for y in [-3.0, 3.0] {
            points.extend([[-0.5, y, -h / 3.0], [0.5, y, -h / 3.0], [0.0, y, 2.0 * h / 3.0]]);
        }
        // Seen along y the corners run a, b, c; outward winding of each side.
        let faces: [&[i32]; 5] = [&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]];
        self.mesh("/World/Prism", &points, &faces, transform, material);
    }

    /// Looks from `eye` at `target`; 35 mm on 36 × 24.
    pub fn camera(&mut self, eye: DVec3, target: DVec3) {
        let z = (eye - target).normalize();
        let x = DVec3::Y.cross(z).normalize();
        let y = z.cross(x);
        let transform = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), eye.extend(1.0));
        self.document.cameras.push(Camera {
            path: "/World/Camera".into(),
            transform: transform.to_cols_array(),
            projection: "perspective".into(),
            horizontal_aperture: 36.0,
            vertical_aperture: 24.0,
            focal_length: 35.0,
            ..Camera::default()
        });
    }

    pub fn description(self) -> Description {
        Description { document: self.document, arrays: self.arrays }
    }

    pub fn build(self) -> Scene {
        Scene::build(self.description()).unwrap_or_else(|e| panic!("{e}"))
    }
}

/// A white light of intensity 1, placed by its group.
pub fn light(path: &str, shape: LightShape) -> Light {
    Light {
        path: path.into(),
        shape,
        transform: None,
        intensity: 1.0,
        exposure: 0.0,
        normalize: false,
        color: [1.0; 3],
        enable_color_temperature: false,
        color_temperature: 6500.0,
        diffuse: 1.0,
        specular: 1.0,
        shaping: None,
        shadow: None,
        light_link: None,
        shadow_link: None,
        abbe: BTreeMap::new(),
        physical: BTreeMap::new(),
    }
}

/// A ball of BK7 before a wall.
pub fn ball() -> Stagehand {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BK7);
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 40.0, Some(grey));
    s.sphere("/World/Ball", 1.0, DMat4::from_translation(DVec3::new(0.1, -0.05, 0.0)), Some(glass));
    s.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO);
    s
}

/// A prism of SF11 before a wall.
pub fn prism() -> Stagehand {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", SF11);
    let grey = s.diffuse("/World/Grey");
    s.wall(-6.0, 60.0, Some(grey));
    // Near minimum deviation, so that what enters one side leaves by the other.
    s.prism(DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2 + 0.57), Some(glass));
    s.camera(DVec3::new(0.2, 0.3, 5.0), DVec3::ZERO);
    s
}

pub fn request(width: u32, height: u32, aovs: &[&str]) -> Request {
    Request {
        width: Some(width),
        height: Some(height),
        aovs: Some(aovs.iter().map(|a| (*a).to_owned()).collect()),
        ..Request::default()
    }
}

pub fn the_plan(scene: &Scene, request: &Request) -> Plan {
    plan(scene, request, &Registry::default()).unwrap_or_else(|e| panic!("{e}")).remove(0)
}

pub fn rendered(scene: &Scene, request: &Request) -> Rendered {
    render(scene, &the_plan(scene, request), &Registry::default(), &Control::none()).unwrap_or_else(|e| panic!("{e}"))
}

/// The float pixels of a layer, with their validity.
pub fn floats<'a>(film: &'a Film, name: &str) -> (&'a [f32], &'a [f32]) {
    let layer = film.layer(name).unwrap_or_else(|| panic!("no layer {name}"));
    match &layer.values {
        abbe::film::Values::Float(values) => (values, layer.valid.as_deref().unwrap_or(&[])),
        abbe::film::Values::Uint(_) => panic!("{name} holds integers"),
    }
}

pub fn integers<'a>(film: &'a Film, name: &str) -> &'a [u32] {
    match &film.layer(name).unwrap_or_else(|| panic!("no layer {name}")).values {
        abbe::film::Values::Uint(values) => values,
        abbe::film::Values::Float(_) => panic!("{name} holds floats"),
    }
}
