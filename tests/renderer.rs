//! Laws of the whole renderer: what an AOV claims is true of the renderer's own views at other wavelengths, and nothing
//! but the scene decides a bit.

#![allow(clippy::float_cmp, reason = "exact values are the law under test")]

mod support;

use abbe::film::aov::{AOVS, Family};
use abbe::film::{SampleRange, Values};
use abbe::integrator::chain::{Chain, Counters, End, Follower, Record};
use abbe::ray::{ColumnSet, NoColumns, ScreenColumns, SecondOrderColumns};
use abbe::render::Request;
use abbe::sampler::CameraSample;
use abbe::scene::Scene;
use abbe::scene::description::Shape;
use abbe::scene::view::{Media, View};
use abbe::spectrum::Wavelength;
use glam::{DMat4, DVec2, DVec3};
use support::{Stagehand, ball, floats, integers, prism, rendered, request, the_plan};

/// A scene with a camera of 48 × 32 pixels and the media at any wavelength: chains in f64, without film or file.
struct Bench<'a> {
    scene: &'a Scene,
    view: &'a View<'a>,
    camera: abbe::camera::Camera,
}

fn camera(scene: &Scene) -> abbe::camera::Camera {
    let authored = &scene.document().cameras[0];
    abbe::camera::Camera::new(authored, [48, 32], 1.0, abbe::camera::ConformPolicy::ExpandAperture).unwrap()
}

impl Bench<'_> {
    fn chain<C: ColumnSet>(&self, raster: DVec2, nm: f64) -> Chain<C> {
        let media = Media::at(self.scene, Wavelength::from_nanometers(nm), 1.0).unwrap();
        let follower = Follower::new(self.view);
        follower.follow(
            &self.camera.ray(&CameraSample::at(raster.x, raster.y)),
            &media,
            Record::none(),
            &mut Counters::default(),
        )
    }

    fn end(&self, raster: DVec2, nm: f64) -> Option<DVec3> {
        match self.chain::<NoColumns>(raster, nm).end {
            End::Surface(met) => Some(met.point),
            _ => None,
        }
    }
}

fn with_bench(s: Stagehand, test: impl FnOnce(&Bench<'_>)) {
    let scene = s.build();
    let camera = camera(&scene);
    let view = View::new(&scene, camera.position);
    test(&Bench { scene: &scene, view: &view, camera });
}

const NM: f64 = 587.5618;

/// Central differences of full re-traces with a sweep of steps: the smallest relative error must be that of a second-order
/// difference at its best step (ε^⅔ ≈ 4e-11, times the conditioning of the re-trace), and halving a large step quarters it.
fn assert_derivative(name: &str, analytic: DVec3, f: impl Fn(f64) -> Option<DVec3>, unit: f64) {
    let scale = analytic.length();
    let mut best = f64::INFINITY;
    for exponent in 0..18 {
        let h = unit * 0.5f64.powi(exponent);
        let (Some(a), Some(b)) = (f(h), f(-h)) else { continue };
        let error = ((a - b) / (2.0 * h) - analytic).length() / scale;
        best = best.min(error);
    }
    assert!(best < 2e-8, "{name}: best relative error of the sweep {best:e} of {analytic}");
}

#[test]
fn every_column_is_the_difference_of_re_traces() {
    for (name, s, pixel) in [
        ("ball", ball(), DVec2::new(25.5, 14.5)),
        ("ball near its rim", ball(), DVec2::new(29.25, 15.5)),
        ("prism", prism(), DVec2::new(24.5, 13.5)),
        ("ellipsoid", ellipsoid(), DVec2::new(25.5, 14.5)),
        ("smooth mesh", smooth(), DVec2::new(25.5, 14.5)),
    ] {
        with_bench(s, |bench| {
            let chain = bench.chain::<SecondOrderColumns>(pixel, NM);
            assert!(chain.is_dispersive && matches!(chain.end, End::Surface(_)), "{name}: {:?}", chain.end);
            let [x, y] = chain.columns.screen().unwrap();
            let lambda = chain.columns.lambda().unwrap();
            assert_derivative(&format!("{name}, x"), x.point, |h| bench.end(pixel + DVec2::X * h, NM), 0.01);
            // Raster rows run down, columns up.
            assert_derivative(&format!("{name}, y"), y.point, |h| bench.end(pixel - DVec2::Y * h, NM), 0.01);
            assert_derivative(&format!("{name}, λ"), lambda.point, |h| bench.end(pixel, NM + h), 1.0);
            let second = chain.columns.lambda2().unwrap();
            let of_first = |h: f64| bench.chain::<ScreenColumns>(pixel, NM + h).columns.lambda().map(|c| c.point);
            assert_derivative(&format!("{name}, λλ"), second.point, of_first, 1.0);
        });
    }
}

fn ellipsoid() -> Stagehand {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::SF11);
    s.wall(-6.0, 40.0, None);
    let shape =
        DMat4::from_rotation_y(0.4) * DMat4::from_scale(DVec3::new(1.4, 0.9, -0.7)) * DMat4::from_rotation_z(0.3);
    s.sphere("/World/Egg", 1.0, shape, Some(glass));
    s.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO);
    s
}

/// A lens-like pillow: two bulging sheets with normals that are not those of the facets.
fn smooth() -> Stagehand {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::BK7);
    s.wall(-6.0, 40.0, None);
    let n = 9;
    let (mut points, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::<[i32; 4]>::new());
    for side in [1.0f32, -1.0] {
        let base = points.len() as i32;
        for j in 0..n {
            for i in 0..n {
                let (x, y) = (i as f32 / 4.0 - 1.0, j as f32 / 4.0 - 1.0);
                points.push([x, y, side * (0.5 - 0.2 * (x * x + y * y))]);
                let normal = glam::Vec3::new(0.4 * x, 0.4 * y, side).normalize();
                normals.push(normal.to_array());
            }
        }
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                let a = base + j * n + i;
                let quad = [a, a + 1, a + n + 1, a + n];
                faces.push(if side > 0.0 { quad } else { [quad[3], quad[2], quad[1], quad[0]] });
            }
        }
    }
    let faces: Vec<&[i32]> = faces.iter().map(|f| &f[..]).collect();
    s.mesh("/World/Pillow", &points, &faces, DMat4::from_rotation_x(0.1), Some(glass));
    s.vertex_normals(&normals);
    s.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO);
    s
}

fn all_aovs() -> Vec<&'static str> {
    AOVS.iter().filter(|aov| aov.family != Family::Transport).map(|aov| aov.name).collect()
}

#[test]
fn fetching_with_the_offset_finds_what_is_seen_at_the_other_wavelength() {
    for s in [ball(), prism(), ellipsoid(), smooth()] {
        with_bench(s, |bench| {
            let request = request(48, 32, &["dispersion_r", "dispersion_g", "dispersion_b"]);
            let image = rendered(bench.scene, &request);
            let channels = image.statistics.plan.optics.channels;
            let mut compared = 0;
            for (name, wavelength) in ["dispersion_r", "dispersion_g", "dispersion_b"].iter().zip(channels) {
                let (values, valid) = floats(&image.film, name);
                for (i, &valid) in valid.iter().enumerate() {
                    let raster = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
                    let offset = DVec2::new(f64::from(values[2 * i]), f64::from(values[2 * i + 1]));
                    if valid == 0.0 || offset == DVec2::ZERO {
                        continue;
                    }
                    let seen = bench.end(raster, wavelength.nanometers());
                    let fetched = bench.end(raster + DVec2::new(offset.x, -offset.y), NM);
                    let (Some(seen), Some(fetched)) = (seen, fetched) else { continue };
                    let [x, y] = bench.chain::<ScreenColumns>(raster, NM).columns.screen().unwrap().map(|c| c.point);
                    let pixel = x.length().max(y.length());
                    // The offset is an f32: what that cannot tell, in pixels, times the size of a pixel on the surface.
                    let tolerance = 1e-3 * offset.length() + 1e-4;
                    assert!(
                        (seen - fetched).length() <= tolerance * pixel,
                        "{name} at {raster}: off by {} px",
                        (seen - fetched).length() / pixel
                    );
                    compared += 1;
                }
            }
            assert!(compared > 100, "only {compared} pixels could be compared");
        });
    }
}

/// Where a feature seen at pixel `raster` at λ_ref is at λ_ref + δ, by Newton on full re-traces with difference quotients.
fn feature_at(bench: &Bench<'_>, raster: DVec2, delta: f64) -> Option<DVec2> {
    let target = bench.end(raster, NM)?;
    let mut at = raster;
    for _ in 0..12 {
        let h = 1e-4;
        let here = bench.end(at, NM + delta)?;
        let d_x = (bench.end(at + DVec2::X * h, NM + delta)? - bench.end(at - DVec2::X * h, NM + delta)?) / (2.0 * h);
        let d_y = (bench.end(at + DVec2::Y * h, NM + delta)? - bench.end(at - DVec2::Y * h, NM + delta)?) / (2.0 * h);
        let r = target - here;
        let (a, b, c) = (d_x.dot(d_x), d_x.dot(d_y), d_y.dot(d_y));
        let det = a * c - b * b;
        at += DVec2::new((c * r.dot(d_x) - b * r.dot(d_y)) / det, (a * r.dot(d_y) - b * r.dot(d_x)) / det);
    }
    Some(at)
}

#[test]
fn dispersion_is_how_features_move_on_screen() {
    for s in [ball(), prism(), ellipsoid()] {
        with_bench(s, |bench| {
            let image = rendered(bench.scene, &request(48, 32, &["dispersion", "dispersion2"]));
            let (first, valid) = floats(&image.film, "dispersion");
            let (second, _) = floats(&image.film, "dispersion2");
            let mut compared = 0;
            for i in (0..48 * 32).step_by(7) {
                let at = |v: &[f32]| DVec2::new(f64::from(v[2 * i]), f64::from(v[2 * i + 1]));
                if valid[i] == 0.0 || at(first) == DVec2::ZERO {
                    continue;
                }
                let raster = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
                let (Some(up), Some(down)) = (feature_at(bench, raster, 1.0), feature_at(bench, raster, -1.0)) else {
                    continue;
                };
                let flip = |v: DVec2| DVec2::new(v.x, -v.y);
                let moved = flip((up - down) / 2.0);
                let bent = flip(up + down - 2.0 * raster);
                assert!(
                    (moved - at(first)).length() <= 1e-3 * moved.length() + 1e-4,
                    "{raster}: {moved} but {}",
                    at(first)
                );
                assert!(
                    (bent - at(second)).length() <= 1e-3 * bent.length() + 1e-4,
                    "{raster}: {bent} but {}",
                    at(second)
                );
                compared += 1;
            }
            assert!(compared > 15, "only {compared} pixels could be compared");
        });
    }
}

#[test]
fn neither_threads_nor_other_aovs_change_a_bit() {
    let names = all_aovs();
    for s in [ball(), prism(), smooth()] {
        let scene = s.build();
        let one = Request { threads: Some(1), samples: Some(3), ..request(40, 30, &names) };
        let whole = rendered(&scene, &one).film;
        assert_eq!(whole, rendered(&scene, &Request { threads: Some(2), ..one.clone() }).film);
        // Subsets chosen by the bits of a fixed pseudo-random sequence.
        let mut bits = 0x1234_5678_9abc_def1_u64;
        for _ in 0..12 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let chosen: Vec<_> = names
                .iter()
                .enumerate()
                .filter(|(i, _)| bits >> (20 + i) & 1 == 1)
                .map(|(_, n)| (*n).to_owned())
                .collect();
            if chosen.is_empty() {
                continue;
            }
            let film = rendered(&scene, &Request { aovs: Some(chosen.clone()), ..one.clone() }).film;
            for name in &chosen {
                assert_eq!(film.layer(name), whole.layer(name), "{name} among {chosen:?}");
            }
        }
    }
}

/// The same scene with its f32 points and its radii scaled.
fn scaled(mut s: Stagehand, scale: f64) -> Stagehand {
    for shape in &mut s.document.shapes {
        match shape {
            Shape::Sphere { radius, .. } => *radius *= scale,
            Shape::Mesh(mesh) => {
                let array = s.arrays.get_mut(&mesh.points).unwrap();
                let scaled: Vec<f32> = bytemuck::cast_slice::<u8, f32>(&array.bytes)
                    .iter()
                    .map(|v| (f64::from(*v) * scale) as f32)
                    .collect();
                *array = abbe::scene::description::Array::from_vec(abbe::scene::description::Element::F32, 3, scaled);
            }
            other => unreachable!("{} is no sphere and no mesh", other.path()),
        }
    }
    let place = |m: &mut [f64; 16]| m[12..15].iter_mut().for_each(|v| *v *= scale);
    s.document.groups[0].items.iter_mut().for_each(|item| place(item.transform.as_mut().unwrap()));
    s.document.cameras.iter_mut().for_each(|c| place(&mut c.transform));
    s
}

/// The same scene scaled and moved by its double transforms: its f32 points would round, and be another shape.
fn moved(mut s: Stagehand, scale: f64, offset: DVec3) -> Stagehand {
    let place = |m: &mut [f64; 16]| {
        let world = DMat4::from_translation(offset) * DMat4::from_scale(DVec3::splat(scale));
        *m = (world * DMat4::from_cols_array(m)).to_cols_array();
    };
    s.document.groups[0].items.iter_mut().for_each(|item| place(item.transform.as_mut().unwrap()));
    s.document.cameras.iter_mut().for_each(|c| place(&mut c.transform));
    s
}

/// By which power of the scale a layer grows.
fn length_exponent(name: &str) -> i32 {
    match name {
        "dposition_dlambda"
        | "dispersion_footprint"
        | "depth"
        | "refracted_depth"
        | "position"
        | "refracted_position" => 1,
        _ => 0,
    }
}

#[test]
fn scaling_by_a_power_of_two_changes_no_bit() {
    let names = all_aovs();
    for exponent in [-40, -1, 1, 40] {
        for make in [ball as fn() -> Stagehand, prism, ellipsoid, smooth] {
            let scale = 2f64.powi(exponent);
            let here = rendered(&make().build(), &request(40, 30, &names)).film;
            let there = rendered(&scaled(make(), scale).build(), &request(40, 30, &names)).film;
            for (a, b) in here.layers.iter().zip(&there.layers) {
                let factor = (scale as f32).powi(length_exponent(a.aov.name));
                let scaled = match &a.values {
                    Values::Float(v) => Values::Float(v.iter().map(|v| v * factor).collect()),
                    Values::Uint(v) => Values::Uint(v.clone()),
                };
                assert!(scaled == b.values && a.valid == b.valid, "{} at 2^{exponent}", a.aov.name);
            }
        }
    }
}

#[test]
fn neither_size_nor_place_matters() {
    // Sizes that round, and a place so far away that f32 could not tell the camera from the glass.
    let names: Vec<_> = all_aovs();
    for (scale, offset, tolerance) in
        [(1e-6, DVec3::ZERO, 1e-6), (1e6, DVec3::ZERO, 1e-6), (1.0, DVec3::new(1e7, -2e7, 3e7), 1e-6)]
    {
        for make in [ball as fn() -> Stagehand, prism] {
            let here = rendered(&make().build(), &request(24, 16, &names)).film;
            let there = rendered(&moved(make(), scale, offset).build(), &request(24, 16, &names)).film;
            for (a, b) in here.layers.iter().zip(&there.layers) {
                let name = a.aov.name;
                let (Values::Float(v), Values::Float(w)) = (&a.values, &b.values) else {
                    assert_eq!(a.values, b.values, "{name} at {scale} + {offset}");
                    continue;
                };
                if name.ends_with("position") && offset != DVec3::ZERO {
                    continue; // the place itself
                }
                assert_eq!(a.valid, b.valid, "{name} at {scale} + {offset}");
                let factor = scale.powi(length_exponent(name));
                let channels = a.aov.channels.len();
                // Vectors that cancel to nearly nothing keep the digits of what cancelled: the layer's typical length.
                let typical = (v.iter().map(|v| v * v).sum::<f32>() * channels as f32 / v.len() as f32).sqrt();
                for (pixel, (v, w)) in v.chunks(channels).zip(w.chunks(channels)).enumerate() {
                    let length = v.iter().map(|v| v * v).sum::<f32>().sqrt().max(typical);
                    for (v, w) in v.iter().zip(w) {
                        let error = (f64::from(*w) / factor - f64::from(*v)).abs();
                        assert!(
                            error <= tolerance * f64::from(length) + 1e-12,
                            "{name}, pixel {pixel} at {scale} + {offset}: {v} but {w} (off by {error:e} of {length})"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn without_dispersion_derivatives_are_exactly_zero_and_nothing_is_carried() {
    let mut s = Stagehand::new();
    let glass = s.constant_glass("/World/Glass", 1.5);
    s.wall(-6.0, 40.0, None);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.3, 0.4, 6.0), DVec3::ZERO);
    let image = rendered(&s.build(), &request(40, 30, &all_aovs()));
    for name in ["dispersion", "dispersion2", "ddirection_dlambda", "dposition_dlambda", "dispersion_r", "dior_dlambda"]
    {
        let (values, _) = floats(&image.film, name);
        assert!(values.iter().all(|v| v.to_bits() == 0), "{name}");
    }
    let (_, valid) = floats(&image.film, "dispersion");
    assert!(valid.iter().all(|&v| v == 1.0), "no dispersive event: 0 and valid");
    assert!(floats(&image.film, "abbe_number").1.iter().all(|&v| v == 0.0), "a constant index has no Abbe number");
    let counters = image.statistics.counters;
    assert_eq!((counters.column_updates, counters.second_chains, counters.retraces), (0, 0, 0));
    assert!(integers(&image.film, "interfaces").contains(&2));
}

#[test]
fn what_nobody_asks_for_is_not_computed() {
    let scene = ball().build();
    let counters = |aovs: &[&str]| rendered(&scene, &request(40, 30, aovs)).statistics.counters;
    let first = counters(&["depth", "normal", "prim_id"]);
    assert_eq!((first.chains, first.events, first.column_updates, first.uv_lookups), (0, 0, 0, 0));
    assert_eq!(first.rays, 40 * 30);
    let chain = counters(&["refracted_position", "interfaces"]);
    assert!(chain.events > 0 && chain.column_updates == 0);
    let lambda = counters(&["ddirection_dlambda"]);
    let screen = counters(&["dispersion"]);
    let second = counters(&["footprint_half_width"]);
    assert_eq!(screen.column_updates, 3 * lambda.column_updates);
    assert_eq!(second.column_updates, 4 * lambda.column_updates);
    assert_eq!((lambda.rays, screen.rays), (chain.rays, chain.rays));
    assert_eq!((screen.second_chains, screen.retraces), (0, 0));
    assert!(counters(&["dispersion2"]).second_chains > 0);
    assert!(counters(&["dispersion_r"]).retraces > 0);
    assert!(counters(&["uv"]).uv_lookups > 0);
}

#[test]
fn a_clean_plate_is_the_same_with_less_dispersion() {
    let scene = ball().build();
    let clean = rendered(
        &scene,
        &Request { dispersion_scale: Some(0.0), ..request(40, 30, &["dispersion", "refracted_position"]) },
    );
    let full = rendered(&scene, &request(40, 30, &["dispersion", "refracted_position"]));
    // λ_ref is the d line, where scaling leaves the index as it is.
    assert_eq!(clean.film.layer("refracted_position"), full.film.layer("refracted_position"));
    assert!(floats(&clean.film, "dispersion").0.iter().all(|&v| v == 0.0));
    assert_eq!(clean.statistics.counters.column_updates, 0);
    let half = rendered(&scene, &Request { dispersion_scale: Some(0.5), ..request(40, 30, &["dispersion"]) });
    for (h, f) in floats(&half.film, "dispersion").0.iter().zip(floats(&full.film, "dispersion").0) {
        assert!((2.0 * h - f).abs() <= 1e-6 * f.abs() + 1e-12, "{h} against {f}");
    }
}

#[test]
fn parts_of_the_samples_and_of_the_image_merge_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let scene = ball().build();
    let names = ["dispersion", "position", "prim_id", "interfaces", "refracted_uv"];
    let whole = Request { samples: Some(13), ..request(37, 21, &names) };
    let write = |name: &str, request: &Request| {
        let image = rendered(&scene, request);
        let path = folder.path().join(name);
        abbe::exr::write(&path, &image.film, &image.metadata).unwrap();
        path
    };
    let expected = abbe::exr::read(&write("whole.exr", &whole)).unwrap().0;
    let mut parts = Vec::new();
    for (i, range) in [[0, 4], [4, 8], [8, 12], [12, 13]].into_iter().enumerate() {
        for (k, crop) in [[0, 0, 20, 21], [20, 0, 37, 9], [20, 9, 37, 21]].into_iter().enumerate() {
            let part = Request { sample_range: Some(range), crop: Some(crop), ..whole.clone() };
            parts.push(write(&format!("{i}-{k}.exr"), &part));
        }
    }
    let out = folder.path().join("merged.exr");
    abbe::exr::merge(&parts, &out).unwrap();
    let merged = abbe::exr::read(&out).unwrap().0;
    assert_eq!(merged.samples, SampleRange::all(13));
    assert_eq!(merged, expected);
}

#[test]
fn a_description_renders_the_same_from_memory_and_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.safetensors");
    let description = smooth().description();
    abbe::scene::file::write(&path, &description).unwrap();
    let request = request(40, 30, &all_aovs());
    let memory = rendered(&Scene::build(description).unwrap(), &request);
    for mapped in [false, true] {
        let scene = Scene::build(abbe::scene::file::read(&path, mapped).unwrap()).unwrap();
        let file = rendered(&scene, &request);
        assert_eq!(memory.film, file.film);
        assert_eq!(memory.metadata, file.metadata);
    }
}

#[test]
fn a_cancelled_render_keeps_finished_tiles() {
    use std::sync::atomic::{AtomicBool, Ordering};
    let scene = ball().build();
    let request = Request { threads: Some(1), ..request(64, 64, &["depth"]) };
    let cancel = AtomicBool::new(false);
    let stop = |p: abbe::render::Progress| {
        if p.done >= 512 {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let control = abbe::render::Control { cancel: &cancel, progress: &stop, pass: None };
    let plan = the_plan(&scene, &request);
    let image = abbe::render::render(&scene, &plan, &Default::default(), &control).unwrap();
    assert!(!image.statistics.complete);
    assert_eq!(image.statistics.pixels, 512);
    let valid = floats(&image.film, "depth").1;
    assert_eq!(valid.iter().filter(|&&v| v == 1.0).count(), 512);
    // What is missing cannot be merged away.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.exr");
    abbe::exr::write(&path, &image.film, &image.metadata).unwrap();
    let error = abbe::exr::merge(&[path], &folder.path().join("merged.exr")).expect_err("merged an unfinished image");
    assert!(error.to_string().contains("interrupted"), "{error}");
}

#[test]
fn a_camera_inside_glass_starts_in_its_medium() {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", support::SF11);
    s.wall(-6.0, 40.0, None);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 0.5), DVec3::ZERO);
    with_bench(s, |bench| {
        let pixel = DVec2::new(20.5, 14.5);
        let chain = bench.chain::<ScreenColumns>(pixel, NM);
        assert_eq!((chain.interfaces, chain.is_dispersive), (1, true));
        let lambda = chain.columns.lambda().unwrap();
        assert_derivative("λ", lambda.point, |h| bench.end(pixel, NM + h), 1.0);
    });
}

#[test]
fn cemented_surfaces_are_both_met_and_a_gap_changes_nothing() {
    // Two slabs that share a face, and the same with a gap of 1e-12.
    let slabs = |gap: f64, priorities: [i32; 2]| {
        let mut s = Stagehand::new();
        let crown = s.glass_with_priority("/World/Crown", support::BK7, priorities[0]);
        let flint = s.glass_with_priority("/World/Flint", support::SF11, priorities[1]);
        s.wall(-6.0, 40.0, None);
        let corners: Vec<[f32; 3]> = (0..8)
            .map(|i| {
                [
                    if i & 1 == 0 { -3.0 } else { 3.0 },
                    if i & 2 == 0 { -3.0 } else { 3.0 },
                    if i & 4 == 0 { 0.0 } else { 1.0 },
                ]
            })
            .collect();
        let faces: [&[i32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        s.mesh("/World/A", &corners, &faces, DMat4::from_translation(DVec3::Z * gap), Some(crown));
        s.mesh("/World/B", &corners, &faces, DMat4::from_translation(-DVec3::Z), Some(flint));
        s.camera(DVec3::new(1.3, 0.4, 6.0), DVec3::ZERO);
        s
    };
    for priorities in [[0, 0], [1, 2], [2, 1]] {
        let mut ends = Vec::new();
        for gap in [0.0, 1e-12] {
            with_bench(slabs(gap, priorities), |bench| {
                let chain = bench.chain::<ScreenColumns>(DVec2::new(20.5, 14.5), NM);
                // Cemented faces are one interface; across a gap there are two.
                assert_eq!((chain.interfaces, chain.total_reflections), (if gap == 0.0 { 3 } else { 4 }, 0));
                ends.push(chain.columns.lambda().unwrap().point);
            });
        }
        assert!((ends[0] - ends[1]).length() <= 1e-9 * ends[1].length(), "{priorities:?}: {ends:?}");
        assert!(ends[0].length() > 1e-6);
    }
}

#[test]
fn everything_in_front_of_the_camera_is_framed_right() {
    // A pixel right of the centre sees +x, a row below the centre sees −y.
    let mut s = Stagehand::new();
    s.wall(0.0, 40.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let image = rendered(&s.build(), &request(40, 30, &["position", "depth", "normal", "prim_id"]));
    let (position, _) = floats(&image.film, "position");
    let at = |x: usize, y: usize| &position[3 * (y * 40 + x)..][..3];
    assert!(at(30, 15)[0] > 0.0 && at(5, 15)[0] < 0.0 && at(20, 25)[1] < 0.0 && at(20, 5)[1] > 0.0);
    assert!(floats(&image.film, "depth").0.iter().all(|&d| (d - 6.0).abs() < 1e-5), "depth is along the axis");
    assert!(integers(&image.film, "prim_id").iter().all(|&id| id == 1));
    assert!(floats(&image.film, "normal").0.chunks(3).all(|n| n == [0.0, 0.0, 1.0]));
}

#[test]
fn analytic_columns_beat_every_difference_and_predictions_improve_with_order() {
    let scene = ball().build();
    let plan = the_plan(&scene, &request(48, 32, &["dispersion"]));
    let comparison = abbe::compare::compare(&scene, &plan, 1).unwrap();
    assert!(comparison.chains > 100);
    let error = |name: &str, step: Option<f64>| {
        comparison.methods.iter().find(|m| m.name == name && m.step_nm == step).unwrap().error.median
    };
    let analytic = error("analytic f64", None);
    assert!(analytic <= 1e-9, "{analytic:e}");
    assert!(error("analytic f32", None) <= 1e-4);
    for method in comparison.methods.iter().filter(|m| m.name.contains("difference")) {
        assert!(method.error.median >= analytic, "{method:?}");
    }
    // First order errs by h, central differences by h²: a tenth of the step.
    let ratio = |name| error(name, Some(10.0)) / error(name, Some(1.0));
    assert!((8.0..12.0).contains(&ratio("forward difference")), "{}", ratio("forward difference"));
    assert!((80.0..120.0).contains(&ratio("central difference")), "{}", ratio("central difference"));
    for pair in comparison.predictions.chunks(2) {
        assert!(pair[1].error.median < pair[0].error.median, "{pair:?}");
    }
}

#[test]
fn the_headers_matrices_project_positions_to_their_pixels() {
    use abbe::film::metadata::Attribute;
    let mut s = prism();
    s.document.cameras[0].horizontal_aperture_offset = 2.5;
    s.document.cameras[0].vertical_aperture_offset = -4.0;
    for projection in ["perspective", "orthographic"] {
        let mut s = Stagehand { document: s.document.clone(), arrays: s.arrays.clone() };
        s.document.cameras[0].projection = projection.into();
        let image = rendered(&s.build(), &request(40, 30, &["position", "depth"]));
        let matrix = |name: &str| match image.metadata.get(name) {
            Some(Attribute::Matrix(m)) => m.map(f64::from),
            other => panic!("{name} is {other:?}"),
        };
        let (to_ndc, to_camera) = (matrix("worldToNDC"), matrix("worldToCamera"));
        let (position, valid) = floats(&image.film, "position");
        let (depth, _) = floats(&image.film, "depth");
        for (i, p) in position.chunks(3).enumerate().filter(|(i, _)| valid[*i] > 0.0) {
            // Row vectors: p' = (p, 1) M.
            let by = |m: &[f64; 16], column: usize| {
                (0..3).map(|row| f64::from(p[row]) * m[4 * row + column]).sum::<f64>() + m[12 + column]
            };
            let [x, y, w] = [by(&to_ndc, 0), by(&to_ndc, 1), by(&to_ndc, 3)];
            let pixel = [x / w * 40.0, y / w * 30.0];
            let expected = [(i % 40) as f64 + 0.5, (i / 40) as f64 + 0.5];
            assert!((0..2).all(|k| (pixel[k] - expected[k]).abs() < 1e-3), "{projection}: {pixel:?} for {expected:?}");
            assert!((by(&to_camera, 2) - f64::from(depth[i])).abs() < 1e-4, "+z of the EXR's camera is depth");
        }
    }
}

#[test]
fn the_half_width_never_reaches_beyond_an_interfaces_critical_wavelength() {
    with_bench(prism(), |bench| {
        let image = rendered(bench.scene, &request(48, 32, &["footprint_half_width"]));
        let (half_width, valid) = floats(&image.film, "footprint_half_width");
        let mut limited = 0;
        for i in (0..48 * 32).filter(|&i| valid[i] > 0.0) {
            let raster = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
            let chain = bench.chain::<SecondOrderColumns>(raster, NM);
            assert!(f64::from(half_width[i]) <= chain.nearest_critical.min(150.0) * (1.0 + 1e-6), "{raster}");
            limited += usize::from(chain.nearest_critical < 150.0);
        }
        assert!(limited > 10, "only {limited} chains come near a critical angle");
    });
}
