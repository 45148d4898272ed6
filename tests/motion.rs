//! Things that move: a scene at a time is the still scene of that time, in every value and column; blur is the mean of
//! stills; what does not move, or is not asked for, changes no bit; vectors of motion lead to where things are next.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use abbe::film::{Film, Values};
use abbe::integrator::chain::{Chain, Counters, End, Follower, Record};
use abbe::ray::ScreenColumns;
use abbe::render::Request;
use abbe::render::trace::trace;
use abbe::sampler::CameraSample;
use abbe::scene::Scene;
use abbe::scene::description::{Array, Element, Instances, InstancesMotion, MeshMotion, Motion, Shape, Target};
use abbe::scene::view::{Media, View};
use abbe::spectrum::Wavelength;
use glam::{DMat4, DVec2, DVec3};
use serde_json::Value;
use support::{BK7, Stagehand, floats, rendered, request, the_plan};

/// Something of every kind that moves: a ball that flies and turns into an ellipsoid, a prism that turns, a wall that bends,
/// a cube placed by an array that moves in an array space that moves, and a camera that drives past.
struct Story {
    times: Vec<f64>,
}

impl Story {
    fn ball(time: f64) -> DMat4 {
        let turn = DMat4::from_rotation_z(0.3) * DMat4::from_scale(DVec3::new(1.0, 1.0 + 0.3 * time, 1.0));
        DMat4::from_translation(DVec3::new(0.1 + 0.4 * time, -0.05, 0.3 * time)) * turn
    }

    fn prism(time: f64) -> DMat4 {
        DMat4::from_translation(DVec3::new(2.0, 0.0, 0.0)) * DMat4::from_rotation_y(2.0 + 0.2 * time)
    }

    fn wall(time: f64) -> Vec<[f32; 3]> {
        let n = 6;
        let at = |i: usize| (i as f64 / f64::from(n as u32) - 0.5) * 60.0;
        (0..=n)
            .flat_map(|i| (0..=n).map(move |j| (at(i), at(j))))
            .map(|(x, y)| [x as f32, y as f32, (-6.0 + time * (0.02 * x + 0.4 * (0.3 * y).sin())) as f32])
            .collect()
    }

    fn array(time: f64) -> DMat4 {
        DMat4::from_translation(DVec3::new(-2.0, 0.3 * time, 0.0)) * DMat4::from_rotation_x(0.2 * time)
    }

    fn places(time: f64) -> Vec<DMat4> {
        vec![
            DMat4::from_translation(DVec3::new(-0.2 * time, -0.8, 0.0)) * DMat4::from_rotation_z(0.5 + 0.3 * time),
            DMat4::from_translation(DVec3::new(0.0, 0.8 + 0.1 * time, 0.4)),
        ]
    }

    fn eye(time: f64) -> DVec3 {
        DVec3::new(0.3 + 0.5 * time, 0.4, 6.0 - 0.4 * time)
    }

    fn look(time: f64) -> DMat4 {
        DMat4::from_translation(Self::eye(time)) * DMat4::from_rotation_y(0.05 + 0.1 * time)
    }

    /// What stands linear between the samples, as the renderer has it.
    fn mixed<T>(&self, time: f64, at: impl Fn(f64) -> T, mix: impl Fn(T, T, f64) -> T) -> T {
        let last = self.times.len() - 1;
        let after = self.times.partition_point(|&t| t <= time).clamp(1, last);
        let (a, b) = (self.times[after - 1], self.times[after]);
        mix(at(a), at(b), (time - a) / (b - a))
    }

    fn matrix(&self, time: f64, at: impl Fn(f64) -> DMat4) -> DMat4 {
        let mixed = self.mixed(time, at, |a, b, s| a + (b - a) * s);
        let mut columns = mixed.to_cols_array();
        // An affine matrix stays one, to the last bit.
        for i in [3, 7, 11] {
            columns[i] = 0.0;
        }
        columns[15] = 1.0;
        DMat4::from_cols_array(&columns)
    }

    fn motion(&self, at: impl Fn(f64) -> DMat4) -> Motion {
        let transforms = self.times.iter().map(|&time| at(time).to_cols_array()).collect();
        Motion { times: self.times.clone(), transforms }
    }

    /// The scene as it moves, or as it stands at a time; the time code is that of `frame`.
    fn stage(&self, frame: f64, moves: bool) -> Stagehand {
        let mut s = Stagehand::new();
        let glass = s.glass("/World/Glass", BK7);
        let grey = s.diffuse("/World/Grey");
        let now = |at: fn(f64) -> DMat4| self.matrix(frame, at);

        s.sphere("/World/Ball", 0.8, now(Self::ball), Some(glass));
        s.prism(now(Self::prism), Some(glass));
        let wall = self.mixed(frame, Self::wall, |a, b, s| {
            let mix = |a: f32, b: f32| (f64::from(a) + s * (f64::from(b) - f64::from(a))) as f32;
            a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|k| mix(a[k], b[k]))).collect()
        });
        let faces: Vec<[i32; 4]> = (0..6)
            .flat_map(|i| (0..6).map(move |j| 7 * i + j))
            .map(|corner| [corner, corner + 7, corner + 8, corner + 1])
            .collect();
        let faces: Vec<&[i32]> = faces.iter().map(|face| &face[..]).collect();
        s.mesh("/World/Wall", &wall, &faces, DMat4::IDENTITY, Some(grey));

        s.solid(Shape::Cube { path: "/Prototypes/Cube".into(), size: 0.7 }, DMat4::IDENTITY, Some(glass));
        let part = s.document.groups[0].items.pop().expect("the cube");
        let rows = |places: Vec<DMat4>| -> Vec<f64> {
            let row = |m: DMat4| m.to_cols_array().chunks(4).flat_map(|c| c[..3].to_vec()).collect::<Vec<_>>();
            places.into_iter().flat_map(row).collect()
        };
        let places = (0..2).map(|i| self.matrix(frame, |t| Self::places(t)[i])).collect();
        s.arrays.insert("places".into(), Array::from_vec(Element::F64, 12, rows(places)));
        s.document.groups.push(abbe::scene::description::Group {
            path: "/Prototypes".into(),
            items: vec![part],
            instances: vec![],
            lights: vec![],
        });
        let mut instances = Instances {
            path: "/World/Cubes".into(),
            group: 1,
            transform: Some(now(Self::array).to_cols_array()),
            transforms: "places".into(),
            indices: None,
            count: 2,
            motion: None,
            places_motion: None,
            link_sets: Default::default(),
        };
        s.camera(DVec3::ZERO, DVec3::NEG_Z);
        s.document.cameras[0].transform = now(Self::look).to_cols_array();
        s.document.stage.time_code = Some(0.0);
        if moves {
            for (path, motion) in [("/World/Ball", self.motion(Self::ball)), ("/World/Prism", self.motion(Self::prism))]
            {
                let item = s.document.groups[0].items.iter_mut().find(|item| item.path == path);
                item.expect("it is placed").motion = Some(motion);
            }
            let name = |what: &str, i: usize| format!("{what}{i}");
            for (i, &time) in self.times.iter().enumerate() {
                s.arrays.insert(name("wall", i), Array::from_vec(Element::F32, 3, Self::wall(time)));
                s.arrays.insert(name("moved", i), Array::from_vec(Element::F64, 12, rows(Self::places(time))));
            }
            let names = |what: &str| (0..self.times.len()).map(|i| name(what, i)).collect();
            for shape in &mut s.document.shapes {
                if let Shape::Mesh(mesh) = shape
                    && mesh.path == "/World/Wall"
                {
                    mesh.motion =
                        Some(MeshMotion { times: self.times.clone(), points: names("wall"), normals: vec![] });
                }
            }
            instances.motion = Some(self.motion(Self::array));
            instances.places_motion = Some(InstancesMotion { times: self.times.clone(), transforms: names("moved") });
            let camera = &mut s.document.cameras[0];
            camera.motion = Some(self.motion(Self::look));
            (camera.shutter_open, camera.shutter_close) = (self.times[0], self.times[self.times.len() - 1]);
            s.document.stage.motion = Some([camera.shutter_open, camera.shutter_close.max(1.0)]);
        }
        s.document.groups[0].instances.push(instances);
        s
    }
}

fn story() -> Story {
    Story { times: vec![-0.5, -0.125, 0.25, 0.5] }
}

/// Whether two traces tell the same, numbers to a relative difference; of what is not finite nothing is told.
fn assert_alike(a: &Value, b: &Value, place: &str, tolerance: f64) {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= tolerance * (1.0 + a.abs().max(b.abs())), "{place}: {a} against {b}");
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            a.iter().zip(b).enumerate().for_each(|(i, (a, b))| assert_alike(a, b, &format!("{place}[{i}]"), tolerance));
        }
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in a {
                if !["time", "sample", "raster"].contains(&key.as_str()) {
                    assert_alike(value, &b[key], &format!("{place}.{key}"), tolerance);
                }
            }
        }
        _ => assert_eq!(a, b, "{place}"),
    }
}

#[test]
fn a_moving_scene_at_a_time_is_the_still_scene_of_that_time() {
    let story = story();
    let scene = story.stage(0.0, true).build();
    let asked = Request { samples: Some(1), ..request(48, 32, &["dispersion2"]) };
    let mut glass = 0;
    let mut seen = std::collections::BTreeSet::new();
    for time in [-0.5, -0.3, 0.125, 0.4, 0.5] {
        // A shutter that is open but for a moment has all its samples there.
        let mut document = scene.description().clone();
        let camera = &mut document.document.cameras[0];
        (camera.shutter_open, camera.shutter_close) = (time, f64::next_up(time));
        let moment = Scene::build(document).expect("a scene");
        let still = story.stage(time, false).build();
        for pixel in [[24, 16], [27, 14], [20, 18], [33, 15], [35, 17], [12, 9], [12, 22], [14, 24], [4, 3]] {
            let moving = trace(&moment, &the_plan(&moment, &asked), pixel, 0).expect("a trace");
            let standing = trace(&still, &the_plan(&still, &asked), pixel, 0).expect("a trace");
            glass += usize::from(moving["interfaces"].as_u64() > Some(0));
            seen.extend(moving["events"].as_array().into_iter().flatten().map(|e| e["event"].to_string()));
            seen.extend([moving["end"]["instance"].to_string(), moving["end"]["prim"].to_string()]);
            // Columns amplify the rounding of where the camera is, and f32 points that of the bent wall.
            assert_alike(&moving, &standing, &format!("{time} {pixel:?}"), 2e-5);
        }
    }
    assert!(glass > 10, "{glass} chains go through glass");
    assert!(seen.len() > 2, "{seen:?}");
}

#[test]
fn columns_at_a_time_are_the_difference_of_re_traces_at_that_time() {
    let scene = story().stage(0.0, true).build();
    let authored = &scene.document().cameras[0];
    let camera = abbe::camera::Camera::new(authored, [48, 32], 1.0, abbe::camera::ConformPolicy::ExpandAperture)
        .and_then(|camera| camera.with_shutter(authored, [-0.5, 0.5]))
        .expect("a camera");
    let view = View::moving(&scene, camera.position);
    let follower = Follower::of_camera(&view, &camera);
    let chain = |x: f64, y: f64, nm: f64, time: f64| -> Chain<ScreenColumns> {
        let media = Media::at(&scene, Wavelength::from_nanometers(nm), 1.0).unwrap();
        let start = camera.ray_at(&CameraSample::at(x, y), time);
        follower.follow(&start, &media, Record::none(), &mut Counters::default())
    };
    let end = |chain: &Chain<ScreenColumns>| match &chain.end {
        End::Surface(met) => met.point,
        other => panic!("{other:?}"),
    };
    use abbe::ray::ColumnSet;
    for (x, y, time) in [(24.5, 16.5, 0.3), (24.5, 17.5, -0.3), (25.5, 15.5, 0.1), (23.5, 16.5, -0.1)] {
        let here = chain(x, y, 550.0, time);
        assert!(here.interfaces > 0, "({x}, {y}) goes through glass");
        let [p_x, p_y] = here.columns.screen().unwrap().map(|column| column.point);
        let p_lambda = here.columns.lambda().unwrap().point;
        let h = 1e-5;
        let difference = |a: Chain<ScreenColumns>, b: Chain<ScreenColumns>, h: f64| (end(&a) - end(&b)) / (2.0 * h);
        for (name, analytic, found) in [
            ("x", p_x, difference(chain(x + h, y, 550.0, time), chain(x - h, y, 550.0, time), h)),
            ("y", p_y, difference(chain(x, y - h, 550.0, time), chain(x, y + h, 550.0, time), h)),
            ("λ", p_lambda, difference(chain(x, y, 550.01, time), chain(x, y, 549.99, time), 0.01)),
        ] {
            assert!((analytic - found).length() <= 1e-6 * analytic.length(), "{name}: {analytic} against {found}");
        }
    }
}

#[test]
fn blur_is_the_mean_of_its_samples() {
    // With one sample each, many shutters that are open for a moment; their mean is the blurred image.
    let scene = story().stage(0.0, true).build();
    let asked = Request { samples: Some(16), seed: Some(3), ..request(24, 16, &["position", "depth"]) };
    let blurred = rendered(&scene, &asked);
    let (values, valid) = floats(&blurred.film, "position");
    let plan = the_plan(&scene, &asked);
    assert_eq!(plan.shutter, Some([-0.5, 0.5]));
    for (x, y) in [(12, 8), (17, 7), (3, 3), (6, 5)] {
        let mut sum = DVec3::ZERO;
        let mut times = Vec::new();
        let mut count = 0;
        for sample in 0..16 {
            let told = trace(&scene, &plan, [x, y], sample).expect("a trace");
            times.push(told["time"].as_f64().unwrap());
            // The first surface: of the first event, or the end.
            let event = told["events"].as_array().unwrap().first().cloned().unwrap_or_else(|| told["end"].clone());
            if let Some(p) = event.get("position").and_then(Value::as_array) {
                sum += DVec3::from_slice(&p.iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>());
                count += 1;
            }
        }
        let index = (y * 24 + x) as usize;
        assert_eq!(valid[index], count as f32 / 16.0);
        let mean = sum / f64::from(count);
        let found = DVec3::from_slice(&values[3 * index..][..3].iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
        assert!((mean - found).length() <= 1e-5, "{mean} against {found}");
        // A sixteenth of the shutter for each.
        times.sort_by(f64::total_cmp);
        for (i, time) in times.iter().enumerate() {
            let stratum = (time + 0.5) * 16.0;
            assert!((i as f64..i as f64 + 1.0).contains(&stratum), "{times:?}");
        }
    }
}

fn assert_same_bits(a: &Film, b: &Film) {
    for layer in &a.layers {
        let other = b.layer(&layer.name).expect("the same layers");
        match (&layer.values, &other.values) {
            (Values::Float(a), Values::Float(b)) => {
                assert!(a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits())), "{}", layer.name);
            }
            (Values::Uint(a), Values::Uint(b)) => assert_eq!(a, b, "{}", layer.name),
            _ => panic!("{}", layer.name),
        }
    }
}

const ALL: &[&str] =
    &["dispersion", "ior", "depth", "position", "normal", "refracted_position", "prim_id", "interfaces"];

#[test]
fn without_blur_a_moving_scene_has_the_bits_of_a_still_one() {
    let story = story();
    let scene = story.stage(0.0, true).build();
    let off = Request { motion_blur: Some(false), samples: Some(4), ..request(24, 16, ALL) };
    let plan = the_plan(&scene, &off);
    assert!(plan.shutter.is_none() && !plan.traces_motion);
    let still = rendered(&story.stage(0.0, false).build(), &Request { samples: Some(4), ..request(24, 16, ALL) });
    assert_same_bits(&rendered(&scene, &off).film, &still.film);
    // And neither do vectors change a bit of anything else.
    let names: Vec<_> = ALL.iter().copied().chain(["motion", "refracted_motion"]).collect();
    let asked = Request { motion_blur: Some(false), samples: Some(4), ..request(24, 16, &names) };
    assert_same_bits(&still.film, &rendered(&scene, &asked).film);
}

#[test]
fn a_moving_scene_has_the_same_bits_for_any_threads_and_crop() {
    let scene = story().stage(0.0, true).build();
    let names: Vec<_> = ALL.iter().copied().chain(["motion", "refracted_motion"]).collect();
    let asked = Request { samples: Some(4), ..request(40, 24, &names) };
    let one = rendered(&scene, &Request { threads: Some(1), ..asked.clone() });
    assert_same_bits(&one.film, &rendered(&scene, &Request { threads: Some(3), ..asked.clone() }).film);
    let crop = rendered(&scene, &Request { crop: Some([8, 5, 32, 20]), ..asked });
    let ((whole, _), (part, _)) = (floats(&one.film, "position"), floats(&crop.film, "position"));
    for y in 0..15 {
        let row = &whole[((y + 5) * 40 + 8) * 3..][..24 * 3];
        assert!(row.iter().map(|v| v.to_bits()).eq(part[y * 72..][..72].iter().map(|v| v.to_bits())), "row {y}");
    }
}

#[test]
fn vectors_of_motion_lead_to_the_next_frame() {
    // A wall at depth 10 goes by (0.3, 0.2, 0); a camera of focal length 35 on 36 mm over 360 pixels sees 350/10 pixels a unit.
    let shift = DVec3::new(0.3, 0.2, 0.0);
    let mut s = Stagehand::new();
    s.wall(-10.0, 40.0, None);
    let at = |t: f64| DMat4::from_translation(shift * t).to_cols_array();
    s.document.groups[0].items[0].motion = Some(Motion { times: vec![0.0, 1.0], transforms: vec![at(0.0), at(1.0)] });
    s.camera(DVec3::ZERO, DVec3::NEG_Z);
    s.document.stage.time_code = Some(0.0);
    s.document.stage.motion = Some([0.0, 1.0]);
    let mut panned = s.document.clone();
    let arrays = s.arrays.clone();
    let scene = s.build();
    let film = rendered(&scene, &request(360, 240, &["motion", "refracted_motion"])).film;
    for name in ["motion", "refracted_motion"] {
        let (values, valid) = floats(&film, name);
        assert!(valid.iter().all(|&v| v == 1.0));
        for v in values.chunks(2) {
            assert!((v[0] - 10.5).abs() < 1e-4 && (v[1] - 7.0).abs() < 1e-4, "{name} {v:?}");
        }
    }

    // The camera turns instead: what stands still, or is infinitely far, goes by −Δtan(angle).
    panned.groups[0].items[0].motion = None;
    let turn = |angle: f64| DMat4::from_rotation_y(angle).to_cols_array();
    let angle = 0.03;
    panned.cameras[0].motion = Some(Motion { times: vec![0.0, 1.0], transforms: vec![turn(0.0), turn(angle)] });
    let mut away = panned.clone();
    away.groups[0].items.clear();
    for document in [panned, away] {
        let scene = Scene::build(abbe::scene::description::Description { document, arrays: arrays.clone() }).unwrap();
        let film =
            rendered(&scene, &Request { crop: Some([170, 110, 190, 130]), ..request(360, 240, &["motion"]) }).film;
        let (values, valid) = floats(&film, "motion");
        assert!(valid.iter().all(|&v| v == 1.0));
        for (i, v) in values.chunks(2).enumerate() {
            let (x, y) = (170.5 + (i % 20) as f64 - 180.0, 120.0 - (110.5 + (i / 20) as f64));
            // A turn by +angle about y moves the direction (x, y, −350) to the right.
            let d = DMat4::from_rotation_y(-angle).transform_vector3(DVec3::new(x, y, -350.0));
            let expected = DVec2::new(d.x / -d.z * 350.0 - x, d.y / -d.z * 350.0 - y);
            assert!((DVec2::new(v[0].into(), v[1].into()) - expected).length() < 1e-3, "{v:?} against {expected}");
        }
    }
}

#[test]
fn what_is_seen_through_moving_glass_is_found_at_the_next_frame() {
    // Everything moves, and the vector leads to a chain that ends at the moved point.
    let story = Story { times: vec![0.0, 1.0] };
    let scene = story.stage(0.0, true).build();
    let asked = Request { motion_blur: Some(false), ..request(48, 32, &["refracted_motion", "interfaces"]) };
    let film = rendered(&scene, &asked).film;
    let (values, valid) = floats(&film, "refracted_motion");
    let (now, then) = (story.stage(0.0, false).build(), story.stage(1.0, false).build());
    let chain_of = |scene: &Scene, raster: DVec2| -> Chain<abbe::ray::NoColumns> {
        let authored = &scene.document().cameras[0];
        let camera =
            abbe::camera::Camera::new(authored, [48, 32], 1.0, abbe::camera::ConformPolicy::ExpandAperture).unwrap();
        let view = View::new(scene, camera.position);
        let media = Media::at(scene, abbe::spectrum::REFERENCE, 1.0).unwrap();
        let start = camera.ray(&CameraSample::at(raster.x, raster.y));
        Follower::new(&view).follow(&start, &media, Record::none(), &mut Counters::default())
    };
    let mut checked = 0;
    for (i, v) in values.chunks(2).enumerate().filter(|&(i, _)| valid[i] == 1.0) {
        let raster = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
        let here = chain_of(&now, raster);
        let End::Surface(met) = here.end else { continue };
        if here.interfaces == 0 || i % 3 != 0 {
            continue;
        }
        let there = chain_of(&then, raster + DVec2::new(v[0].into(), -f64::from(v[1])));
        let End::Surface(moved) = there.end else { panic!("{raster}: {:?}", there.end) };
        assert_eq!((met.hit.instance, here.interfaces), (moved.hit.instance, there.interfaces));
        // The vector is single precision: the same triangle, and nearly the same place on it.
        let off = DVec2::from(met.hit.barycentric) - DVec2::from(moved.hit.barycentric);
        assert!(met.hit.primitive != moved.hit.primitive || off.length() < 1e-4, "{raster} {off}");
        checked += 1;
    }
    assert!(checked > 15, "{checked} pixels through glass");
}

#[test]
fn a_camera_that_enters_glass_starts_in_it() {
    // From outside of a ball of glass into it: the medium at the start is that of the time.
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BK7);
    s.wall(-9.0, 40.0, None);
    s.sphere("/World/Ball", 2.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO);
    let at = |z: f64| DMat4::from_translation(DVec3::Z * z).to_cols_array();
    let camera = &mut s.document.cameras[0];
    camera.motion = Some(Motion { times: vec![0.0, 1.0], transforms: vec![at(3.0), at(0.0)] });
    (camera.shutter_open, camera.shutter_close) = (0.0, 1.0);
    s.document.stage.motion = Some([0.0, 1.0]);
    let scene = s.build();
    let asked = Request { samples: Some(16), ..request(24, 16, &["ior"]) };
    let plan = the_plan(&scene, &asked);
    let mut inside = 0;
    for sample in 0..16 {
        let told = trace(&scene, &plan, [12, 8], sample).expect("a trace");
        let z = 3.0 - 3.0 * told["time"].as_f64().unwrap();
        let index = told["start_ior"].as_f64().unwrap();
        assert_eq!(index > 1.2, z < 2.0, "at {z} the index is {index}");
        assert_eq!(told["interfaces"].as_u64(), Some(if z < 2.0 { 1 } else { 2 }));
        inside += usize::from(z < 2.0);
    }
    assert!((9..=12).contains(&inside), "two thirds of the way: {inside} of 16");
}

#[test]
fn broken_motion_stands_still_and_is_named() {
    let good = story().motion(Story::ball);
    let cases: [fn(&mut Motion); 5] = [
        |motion| motion.times.truncate(2),
        |motion| motion.times.swap(0, 1),
        |motion| motion.times[1] = f64::NAN,
        |motion| motion.transforms[0][12] = f64::INFINITY,
        |motion| motion.transforms[0][3] = 1.0,
    ];
    for damage in cases {
        let mut s = support::ball();
        let mut motion = good.clone();
        damage(&mut motion);
        s.document.groups[0].items[1].motion = Some(motion.clone());
        let scene = s.build();
        assert!(!scene.objects.is_moving());
        assert_eq!(scene.diagnostics().warnings()[0].kind, "broken-motion");
        // A camera is what was asked for: an error.
        let mut s = support::ball();
        s.document.cameras[0].motion = Some(motion);
        (s.document.cameras[0].shutter_open, s.document.cameras[0].shutter_close) = (0.0, 1.0);
        let scene = s.build();
        let plan = the_plan(&scene, &request(8, 8, &["depth"]));
        let rendered =
            abbe::render::render(&scene, &plan, &abbe::integrator::Registry::default(), &abbe::render::Control::none());
        assert!(rendered.unwrap_err().to_string().contains("motion is broken"));
    }
    // Points of another number, of none, not finite.
    for points in [vec![], vec![[0.0f32; 3]; 3], vec![[f32::NAN; 3]; 4]] {
        let mut s = support::ball();
        s.arrays.insert("moved".into(), Array::from_vec(Element::F32, 3, points));
        let Shape::Mesh(mesh) = &mut s.document.shapes[0] else { panic!("the wall") };
        mesh.motion = Some(MeshMotion { times: vec![1.0], points: vec!["moved".into()], normals: vec![] });
        let scene = s.build();
        let warning = &scene.diagnostics().warnings()[0];
        assert!(warning.message.contains("motion"), "{warning:?}");
    }
}

#[test]
fn motion_nested_without_end_is_refused() {
    let mut s = support::ball();
    let groups = 64;
    let times: Vec<f64> = (0..500).map(f64::from).collect();
    for depth in 0..groups {
        let items = std::mem::take(&mut s.document.groups[0].items);
        s.document.groups.push(abbe::scene::description::Group {
            path: format!("/G{depth}"),
            items,
            instances: vec![],
            lights: vec![],
        });
        let mut item = support::ball().document.groups[0].items.remove(0);
        item.target = Target::Group(s.document.groups.len() - 1);
        let shifted = times.iter().map(|t| t + f64::from(depth) / 64.0).collect();
        item.motion = Some(Motion { times: shifted, transforms: vec![DMat4::IDENTITY.to_cols_array(); 500] });
        s.document.groups[0].items.push(item);
    }
    let error = Scene::build(s.description()).unwrap_err().to_string();
    assert!(error.contains("too many samples"), "{error}");
}

#[test]
fn what_grows_from_nothing_is_there_as_soon_as_it_has_a_size() {
    let mut s = Stagehand::new();
    let grey = s.diffuse("/World/Grey");
    s.sphere("/World/Ball", 1.0, DMat4::from_scale(DVec3::splat(1e-300)), Some(grey));
    let sizes = [0.0, 1.0].map(|size| DMat4::from_scale(DVec3::splat(size)).to_cols_array());
    s.document.groups[0].items[0].transform = Some(sizes[0]);
    s.document.groups[0].items[0].motion = Some(Motion { times: vec![0.0, 1.0], transforms: sizes.to_vec() });
    s.camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    (s.document.cameras[0].shutter_open, s.document.cameras[0].shutter_close) = (0.0, 1.0);
    s.document.stage.motion = Some([0.0, 1.0]);
    let scene = s.build();
    let plan = the_plan(&scene, &Request { samples: Some(64), ..request(33, 22, &["depth"]) });
    let mut met = 0;
    for sample in 0..64 {
        let told = trace(&scene, &plan, [16, 11], sample).expect("a trace");
        // By how much the ray passes the centre, against the radius: the time itself.
        let d: Vec<f64> = told["direction"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        let passes = 5.0 * (d[0] * d[0] + d[1] * d[1]).sqrt();
        let is_met = told["end"]["kind"] == "surface";
        assert_eq!(is_met, passes < told["time"].as_f64().unwrap(), "{told}");
        met += u32::from(is_met);
    }
    assert!(met > 50, "{met}");
}

#[test]
fn boxes_hold_what_moves_at_all_times() {
    // Trees decide nothing: every ray meets at its time what a look at every primitive finds.
    let scene = story().stage(0.0, true).build();
    let view = View::moving(&scene, Story::eye(0.0));
    assert!(view.aggregate.is_moving());
    let mut hits = 0;
    for i in 0..4000u32 {
        let part = |step: f64| (f64::from(i) * step).fract();
        let direction = DVec3::new(part(0.618_034) - 0.5, part(0.414_214) - 0.5, -1.0).normalize();
        let ray = abbe::geometry::Ray { origin: DVec3::ZERO, direction, time: 1.2 * part(0.324_718) - 0.6 };
        let found = view.aggregate.intersect(&ray, &abbe::geometry::Departures::none());
        assert_eq!(found, view.aggregate.intersect_without_tree(&ray), "{ray:?}");
        hits += usize::from(found.is_some());
    }
    assert!(hits > 3000, "{hits}");
}
