//! Passes, error targets, time limits and parts: whatever the way, a pixel has the same bits for the same samples.
//!
//! The integrator here shines in numbers made of pixel and sample index alone, so that nothing but the film and the driver is tried.

mod support;

use std::ops::Range;
use std::sync::{Arc, Mutex};

use abbe::film::aov::{self, Aov};
use abbe::film::metadata::{Attribute, Metadata};
use abbe::film::pixel::PixelAccumulator;
use abbe::film::{Film, SampleRange, Values};
use abbe::integrator::chain::Counters;
use abbe::integrator::{Integrator, PreparedIntegrator, Registry, Task, Worker};
use abbe::render::{Control, Rendered, Request, plan, render};
use abbe::scene::Scene;
use support::ball;

const AOVS: [&str; 5] = ["color", "variance", "sample_count", "uv", "prim_id"];

struct Toy;
struct Prepared<'a>(&'a Task<'a>);

impl Integrator for Toy {
    fn name(&self) -> &str {
        "toy"
    }
    fn summary(&self) -> &str {
        "numbers"
    }
    fn aovs(&self) -> Vec<&'static Aov> {
        AOVS.map(|name| aov::find(name).unwrap()).to_vec()
    }
    fn transports_light(&self) -> bool {
        true
    }
    fn prepare<'a>(&self, task: &'a Task<'a>) -> abbe::Result<Box<dyn PreparedIntegrator + 'a>> {
        Ok(Box::new(Prepared(task)))
    }
}

impl PreparedIntegrator for Prepared<'_> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        Box::new(Prepared(self.0))
    }
}

/// In 0..1, of everything.
fn number(pixel: [i32; 2], index: u32, k: u32) -> f64 {
    let mut x = (pixel[0] as u64) << 40 ^ (pixel[1] as u64) << 24 ^ u64::from(index) << 4 ^ u64::from(k);
    for _ in 0..3 {
        x = (x ^ (x >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    (x >> 11) as f64 / (1u64 << 53) as f64
}

/// Noise grows with x from none at all.
fn color(pixel: [i32; 2], index: u32) -> [f64; 4] {
    let noise = f64::from(pixel[0]) / 10.0;
    let channel = |k| 0.5 * (1.0 + noise * (2.0 * number(pixel, index, k) - 1.0));
    [channel(0), channel(1), channel(2), 1.0]
}

impl Worker for Prepared<'_> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        for index in range {
            out.add_color(color(pixel, index));
            for (layer, aov) in self.0.aovs.iter().enumerate() {
                match aov.name {
                    "uv" => out
                        .add(layer, (index % 3 > 0).then(|| [number(pixel, index, 3), 1e6 * number(pixel, index, 4)])),
                    "prim_id" => out.add_first(layer, 7 + index),
                    _ => {}
                }
            }
        }
    }
    fn counters(&self) -> Counters {
        Counters::default()
    }
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.register(Arc::new(Toy));
    registry
}

fn request(samples: u32) -> Request {
    Request {
        width: Some(37),
        height: Some(19),
        samples: Some(samples),
        integrator: Some("toy".into()),
        aovs: Some(AOVS.map(str::to_owned).to_vec()),
        ..Request::default()
    }
}

fn run_with(scene: &Scene, request: &Request, control: &Control<'_>) -> Rendered {
    let registry = registry();
    let plan = plan(scene, request, &registry).unwrap_or_else(|e| panic!("{e}")).remove(0);
    render(scene, &plan, &registry, control).unwrap_or_else(|e| panic!("{e}"))
}

fn run(scene: &Scene, request: &Request) -> Rendered {
    run_with(scene, request, &Control::none())
}

fn refusal(scene: &Scene, request: &Request) -> String {
    plan(scene, request, &registry()).expect_err("is refused").to_string()
}

fn floats<'a>(film: &'a Film, name: &str) -> &'a [f32] {
    match &film.layer(name).unwrap().values {
        Values::Float(values) => values,
        Values::Uint(_) => panic!("{name} is of integers"),
    }
}

fn counts(film: &Film) -> &[u32] {
    match &film.layer("sample_count").unwrap().values {
        Values::Uint(values) => values,
        Values::Float(_) => panic!("counts are integers"),
    }
}

/// Films of all passes, and the last.
fn grown(scene: &Scene, request: &Request) -> (Vec<Film>, Rendered) {
    let films = Mutex::new(Vec::new());
    let pass = |film: Film, metadata: Metadata| {
        assert_eq!(metadata.get("abbe:samples"), Some(&Attribute::Int(film.samples.total as i32)));
        films.lock().unwrap().push(film);
        true
    };
    let rendered = run_with(scene, request, &Control { pass: Some(&pass), ..Control::none() });
    (films.into_inner().unwrap(), rendered)
}

#[test]
fn growing_renders_have_the_bits_of_one_pass_and_every_film_those_of_its_samples() {
    let scene = ball().build();
    let whole = run(&scene, &request(61));
    for threads in [1, 3] {
        let (films, last) = grown(&scene, &Request { threads: Some(threads), ..request(61) });
        assert_eq!(last.film, whole.film);
        assert_eq!(last.metadata, whole.metadata);
        let ends: Vec<_> = films.iter().map(|film| film.samples).collect();
        assert_eq!(ends, [1, 2, 4, 8, 16, 32, 61].map(SampleRange::all));
        for film in &films {
            let end = film.samples.end;
            let part = if end == 61 { None } else { Some([0, end]) };
            let alone = run(&scene, &Request { sample_range: part, ..request(61) }).film;
            for (a, b) in film.layers.iter().zip(&alone.layers) {
                assert_eq!((&a.values, &a.valid, &a.half), (&b.values, &b.valid, &b.half), "{} at {end}", a.aov.name);
                assert!(a.sums.is_none());
            }
        }
    }
    assert_eq!(whole.statistics.samples, 37 * 19 * 61);
    assert_eq!(whole.statistics.passes, 1);
}

#[test]
fn a_part_of_the_samples_grows_too() {
    let scene = ball().build();
    let part = Request { sample_range: Some([32, 64]), ..request(100) };
    let whole = run(&scene, &part);
    let (films, last) = grown(&scene, &part);
    assert_eq!(last.film, whole.film);
    assert_eq!(films.len(), 6);
}

#[test]
fn a_growing_render_stops_when_told() {
    let scene = ball().build();
    let pass = |film: Film, _: Metadata| film.samples.end < 4;
    let stopped = run_with(&scene, &request(64), &Control { pass: Some(&pass), ..Control::none() });
    assert!(!stopped.statistics.complete);
    assert_eq!(stopped.statistics.passes, 3);
    assert!(counts(&stopped.film).iter().all(|&count| count == 4));
}

#[test]
fn the_variance_is_that_of_the_mean() {
    let scene = ball().build();
    let film = run(&scene, &request(50)).film;
    let variance = floats(&film, "variance");
    for (x, y) in [(0, 0), (3, 2), (36, 18)] {
        let samples: Vec<f64> = (0..50).map(|i| color([x, y], i)[1]).collect();
        let mean = samples.iter().sum::<f64>() / 50.0;
        let wanted = samples.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (49.0 * 50.0);
        let pixel = (y * 37 + x) as usize;
        assert!((f64::from(variance[3 * pixel + 1]) - wanted).abs() <= 1e-6 * wanted, "{x} {y}");
        assert!((f64::from(floats(&film, "color")[4 * pixel + 1]) - mean).abs() < 1e-7);
    }
}

#[test]
fn ranges_and_crops_merge_to_the_bits_of_the_whole() {
    let scene = ball().build();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, request: &Request| {
        let path = folder.path().join(name);
        let image = run(&scene, request);
        abbe::exr::write(&path, &image.film, &image.metadata).unwrap();
        path
    };
    let whole = write("whole.exr", &request(48));
    let mut parts = Vec::new();
    for (i, crop) in [[0, 0, 20, 19], [20, 0, 37, 19]].into_iter().enumerate() {
        for (j, range) in [[0, 32], [32, 48]].into_iter().enumerate() {
            let part = Request { crop: Some(crop), sample_range: Some(range), ..request(48) };
            parts.push(write(&format!("part{i}{j}.exr"), &part));
        }
    }
    let merged = folder.path().join("merged.exr");
    abbe::exr::merge(&parts, &merged).unwrap();
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(&merged).unwrap());
    let (film, metadata) = abbe::exr::read(&merged).unwrap();
    assert!(counts(&film).iter().all(|&count| count == 48));
    assert_eq!(metadata.get("colorInteropID"), Some(&Attribute::Text("lin_rec709_scene".into())));
    assert_eq!(metadata.get("abbe:pixelFilter"), Some(&Attribute::Text("blackmanHarris 3 px".into())));
    assert!(film.layer("color").unwrap().half && !film.layer("variance").unwrap().half);
}

#[test]
fn an_error_target_is_reached_pixel_by_pixel() {
    let scene = ball().build();
    let asked = Request { error_target: Some(0.03), ..request(4096) };
    let image = run(&scene, &asked);
    let (color, variance) = (floats(&image.film, "color"), floats(&image.film, "variance"));
    let mut seen = std::collections::BTreeSet::new();
    for (pixel, &count) in counts(&image.film).iter().enumerate() {
        assert!(count.is_power_of_two() && (64..=4096).contains(&count), "{count}");
        let error = (variance[3 * pixel..][..3].iter().sum::<f32>() / 3.0).sqrt();
        let mean = color[4 * pixel..][..3].iter().sum::<f32>() / 3.0;
        assert!(count == 4096 || error / mean < 0.031, "{pixel}: {error} of {mean}");
        seen.insert(count);
    }
    // Where nothing is noise, as many as could hide a rare event: more than 1/0.03.
    assert_eq!(counts(&image.film)[0], 64);
    assert!(seen.len() > 3, "{seen:?}");
    let total: u64 = counts(&image.film).iter().map(|&count| u64::from(count)).sum();
    assert_eq!(image.statistics.samples, total);
    // The same in passes, on other threads, and without a layer that has the variance.
    let (films, last) = grown(&scene, &Request { threads: Some(3), ..asked.clone() });
    assert_eq!(last.film, image.film);
    assert_eq!(films.last().unwrap().layers, image.film.layers);
    let alone = run(&scene, &Request { aovs: Some(vec!["color".into()]), ..asked.clone() });
    assert_eq!(alone.film.layers.len(), 1);
    assert_eq!(alone.film.layer("color"), image.film.layer("color"));
    let crop = run(&scene, &Request { crop: Some([30, 3, 37, 9]), ..asked.clone() });
    assert_eq!(counts(&crop.film)[0], counts(&image.film)[3 * 37 + 30]);
    assert!(refusal(&scene, &Request { sample_range: Some([0, 64]), ..asked.clone() }).contains("--error-target"));
    assert!(refusal(&scene, &Request { aovs: Some(vec!["uv".into()]), ..asked.clone() }).contains("color"));
    assert!(refusal(&scene, &Request { error_target: Some(-0.1), ..asked }).contains("must be"));
}

#[test]
fn a_time_limit_ends_with_what_there_is() {
    let scene = ball().build();
    let asked = Request { time_limit: Some(1e-9), ..request(1 << 20) };
    let image = run(&scene, &asked);
    assert!(image.statistics.complete && image.statistics.reached_time_limit);
    assert_eq!(image.film.samples, SampleRange::all(1));
    assert_eq!(image.metadata.get("abbe:reproducible"), Some(&Attribute::Int(0)));
    assert_eq!(image.metadata.get("abbe:samples"), Some(&Attribute::Int(1)));
    // A limit that is not reached leaves no trace but the setting.
    let long = run(&scene, &Request { time_limit: Some(1e6), ..request(64) });
    assert!(!long.statistics.reached_time_limit);
    assert_eq!(long.film, run(&scene, &request(64)).film);
    // Cut short in the middle of a pass it has the bits of so many samples.
    let image = run(&scene, &Request { time_limit: Some(0.05), ..request(1 << 20) });
    let taken = image.film.samples.end;
    if taken > 1 {
        let same = run(&scene, &request(taken));
        assert_eq!(image.film, same.film);
    }
    assert!(
        refusal(&scene, &Request { sample_range: Some([0, 64]), time_limit: Some(1.0), ..request(64) })
            .contains("--time-limit")
    );
}

#[test]
fn clamping_is_off_and_never_silent() {
    let scene = ball().build();
    let plain = run(&scene, &request(16));
    assert!(plain.metadata.get("abbe:clamp").is_none() && plain.statistics.clamped_samples == 0);
    let clamped = run(&scene, &Request { clamp: Some(1.0), ..request(16) });
    let wanted: u64 = (0..19 * 37)
        .map(|p| (0..16).filter(|&i| color([p % 37, p / 37], i)[..3].iter().any(|&v| v > 1.0)).count() as u64)
        .sum();
    assert!(wanted > 0);
    assert_eq!(clamped.statistics.clamped_samples, wanted);
    assert_eq!(clamped.metadata.get("abbe:clampedSamples"), Some(&Attribute::Text(wanted.to_string())));
    assert!(clamped.statistics.warnings.warnings().iter().any(|w| w.kind == "clamped-samples"));
    assert!(floats(&clamped.film, "color").iter().all(|&v| v <= 1.0));
}

#[test]
fn filters_are_of_light_alone() {
    let scene = ball().build();
    let planned = |request: &Request| plan(&scene, request, &registry()).unwrap().remove(0);
    assert!((planned(&request(4)).filter.width() - 3.0).abs() < 1e-12);
    let narrow = Request { pixel_filter: Some("box".into()), ..request(4) };
    assert!(planned(&narrow).filter.is_pixel());
    let geometry = Request { integrator: None, aovs: Some(vec!["depth".into()]), ..request(4) };
    assert!(planned(&geometry).filter.is_pixel());
    assert!(
        refusal(&scene, &Request { pixel_filter: Some("mitchell".into()), ..request(4) }).contains("negative lobes")
    );
    assert!(refusal(&scene, &Request { pixel_filter_width: Some(0.0), ..request(4) }).contains("Width"));
    // Light takes many samples unless told otherwise.
    assert_eq!(planned(&Request { samples: None, ..request(4) }).samples, SampleRange::all(64));
    assert_eq!(planned(&Request { samples: None, ..geometry }).samples, SampleRange::all(1));
}

#[test]
fn spectral_bins_have_a_layout_of_their_own_and_one_beside_others() {
    let scene = ball().build();
    let planned = |aovs: &[&str]| {
        let request =
            Request { aovs: Some(aovs.iter().map(|name| (*name).to_owned()).collect()), ..Request::default() };
        plan(&scene, &Request { integrator: Some("path".into()), ..request }, &Registry::default())
            .map(|mut plans| plans.remove(0))
    };
    let alone = planned(&["spectral:400:700:100"]).unwrap();
    assert_eq!(alone.layers[0].name, "S0");
    assert_eq!(alone.layers[0].aov.channels, ["450,000000nm", "550,000000nm", "650,000000nm"]);
    let beside = planned(&["color", "spectral"]).unwrap();
    assert_eq!(beside.layers[1].name, "spectral");
    assert_eq!(beside.layers[1].aov.channels.len(), 30);
    assert_eq!(beside.layers[1].aov.channels[15], "w555");
    let named = planned(&["color", "fine=spectral:500:600:5"]).unwrap();
    assert_eq!((named.layers[1].name.as_str(), named.layers[1].argument.as_str()), ("fine", "500:600:5"));
    for (wrong, hint) in [("spectral:1:2:3", "360"), ("color:x", "no argument"), ("spectral:400:700", "LO:HI:WIDTH")] {
        assert!(planned(&[wrong]).unwrap_err().to_string().contains(hint), "{wrong}");
    }
}

#[test]
fn spectral_layers_return_from_files_and_merge() {
    let scene = ball().build();
    let folder = tempfile::tempdir().unwrap();
    let asked = |range: Option<[u32; 2]>| Request {
        width: Some(9),
        height: Some(7),
        samples: Some(8),
        integrator: Some("path".into()),
        aovs: Some(vec!["color".into(), "spectral:400:700:50".into(), "variance".into()]),
        sample_range: range,
        ..Request::default()
    };
    let write = |name: &str, request: &Request| {
        let plan = plan(&scene, request, &Registry::default()).unwrap_or_else(|e| panic!("{e}")).remove(0);
        let image = render(&scene, &plan, &Registry::default(), &Control::none()).unwrap_or_else(|e| panic!("{e}"));
        let path = folder.path().join(name);
        abbe::exr::write(&path, &image.film, &image.metadata).unwrap();
        (path, image)
    };
    let (whole, image) = write("whole.exr", &asked(None));
    let (film, metadata) = abbe::exr::read(&whole).unwrap();
    assert_eq!(film.layers[1].aov.channels, ["w425", "w475", "w525", "w575", "w625", "w675"]);
    assert_eq!(film.layers[1].argument, "400:700:50");
    assert_eq!(film.layers[2], image.film.layers[2]);
    assert!(metadata.get("abbe:argument:spectral").is_some());
    let parts: Vec<_> = [[0, 4], [4, 8]].iter().map(|&r| write(&format!("{}.exr", r[0]), &asked(Some(r))).0).collect();
    let merged = folder.path().join("merged.exr");
    abbe::exr::merge(&parts, &merged).unwrap();
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(&merged).unwrap());
}
