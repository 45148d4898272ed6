//! Files keep every bit, appear whole or not at all, join to the bits of one render, and survive hostile input.

use std::fs;
use std::path::{Path, PathBuf};

use abbe::Error;
use abbe::exr::{self, merge, read, write};
use abbe::film::aov::{self, Aov, Merge};
use abbe::film::metadata::{Attribute, Metadata};
use abbe::film::sum::{TreeSum, mean, valid_fraction};
use abbe::film::{Film, Layer, SampleRange, Sums, Values, Window};

/// SplitMix64 (Steele et al. 2014): a number for any tuple of indices.
fn random(keys: &[u64]) -> u64 {
    keys.iter().fold(0x9e37_79b9_7f4a_7c15, |state, &key| {
        let mut z = (state ^ key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// Value of one sample: magnitudes over 13 decades, so that every grouping rounds differently; one in five is absent.
fn sample(layer: usize, x: i32, y: i32, component: usize, index: u32) -> Option<f64> {
    let pixel = [layer as u64, x as u64, y as u64, u64::from(index)];
    if random(&pixel).is_multiple_of(5) {
        return None;
    }
    let bits = random(&[pixel[0], pixel[1], pixel[2], pixel[3], 1 + component as u64]);
    let unit = (bits >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
    Some(unit * 10f64.powi((bits % 13) as i32 - 6))
}

fn kinds() -> Vec<(&'static Aov, &'static str)> {
    [
        ("dispersion", "dispersion"),
        ("depth", "depth"),
        ("prim_id", "prim_id"),
        ("normal", "cam.shading_normal"),
        ("interfaces", "interfaces"),
        ("uv", ""),
    ]
    .map(|(name, layer)| (aov::find(name).expect("in the table"), layer))
    .to_vec()
}

const RESOLUTION: [u32; 2] = [23, 37];

/// What a render of `window` with `samples` gives.
fn film(window: Window, samples: SampleRange) -> Film {
    let layers = kinds()
        .into_iter()
        .enumerate()
        .map(|(index, (aov, name))| {
            let mut layer = Layer::new(aov, name.to_owned(), window.area(), !samples.is_all());
            let n = aov.channels.len();
            for pixel in 0..window.area() {
                let x = window.x0 + (pixel % window.width()) as i32;
                let y = window.y0 + (pixel / window.width()) as i32;
                if aov.merge == Merge::First {
                    if let Values::Uint(values) = &mut layer.values {
                        values[pixel] = random(&[7, index as u64, x as u64, y as u64, u64::from(samples.begin)]) as u32;
                    }
                    continue;
                }
                let present = |i: &u32| sample(index, x, y, 0, *i).is_some();
                let count = (samples.begin..samples.end).filter(present).count() as u32;
                for component in 0..n {
                    let mut sum = TreeSum::new(samples.begin);
                    for i in samples.begin..samples.end {
                        sum.push(sample(index, x, y, component, i).unwrap_or(0.0));
                    }
                    if let Values::Float(values) = &mut layer.values {
                        values[pixel * n + component] = mean(sum.total(), count);
                    }
                    if let Some(Sums { values, .. }) = &mut layer.sums {
                        values[pixel * n + component] = sum.total();
                    }
                }
                if let Some(valid) = &mut layer.valid {
                    valid[pixel] = valid_fraction(count, samples.end - samples.begin);
                }
                if let Some(Sums { counts, .. }) = &mut layer.sums {
                    counts[pixel] = count;
                }
            }
            layer
        })
        .collect();
    Film { resolution: RESOLUTION, window, pixel_aspect_ratio: 1.5, samples, layers }
}

fn window(x0: i32, y0: i32, x1: i32, y1: i32) -> Window {
    Window { x0, y0, x1, y1 }
}

fn range(begin: u32, end: u32, total: u32) -> SampleRange {
    SampleRange { begin, end, total }
}

fn metadata() -> Metadata {
    let mut metadata = Metadata::default();
    metadata.set("abbe:settingsHash", Attribute::Text("5f2c".into()));
    metadata.set("abbe:referenceWavelength", Attribute::Double(587.5618));
    metadata.set("abbe:samples", Attribute::Int(12));
    metadata.set("owner", Attribute::Text("Zoë".into()));
    metadata.set("worldToCamera", Attribute::Matrix(std::array::from_fn(|i| i as f32)));
    metadata.set("framesPerSecond", Attribute::Rational(24000, 1001));
    metadata
        .set("chromaticities", Attribute::Chromaticities([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]]));
    metadata.set("screenWindowCenter", Attribute::Vec2([0.25, -0.5]));
    metadata.set("screenWindowWidth", Attribute::Float(2.0));
    metadata.set("multiView", Attribute::Text("left,right".into()));
    metadata.set("abbe:a_name_longer_than_the_thirty_one_bytes_of_old_files", Attribute::Int(-1));
    metadata.set(
        "abbe:unit:dispersion",
        Attribute::Text("something else than the table says, so that it has to be kept".into()),
    );
    metadata
}

/// Equality of everything, floats by their bits.
fn assert_same(a: &Film, b: &Film, what: &str) {
    assert_eq!((a.resolution, a.window, a.samples), (b.resolution, b.window, b.samples), "{what}");
    assert_eq!(a.pixel_aspect_ratio.to_bits(), b.pixel_aspect_ratio.to_bits(), "{what}");
    assert_eq!(a.layers.len(), b.layers.len(), "{what}");
    let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    for (p, q) in a.layers.iter().zip(&b.layers) {
        assert_eq!((p.aov.name, &p.name), (q.aov.name, &q.name), "{what}");
        match (&p.values, &q.values) {
            (Values::Float(u), Values::Float(v)) => assert!(bits(u) == bits(v), "{what}: values of {}", p.name),
            (u, v) => assert!(u == v, "{what}: values of {}", p.name),
        }
        assert_eq!(p.valid.as_deref().map(bits), q.valid.as_deref().map(bits), "{what}: validity of {}", p.name);
        assert_eq!(p.sums.is_some(), q.sums.is_some(), "{what}: sums of {}", p.name);
        if let (Some(u), Some(v)) = (&p.sums, &q.sums) {
            let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert!(bits(&u.values) == bits(&v.values) && u.counts == v.counts, "{what}: sums of {}", p.name);
        }
    }
}

fn message<T: std::fmt::Debug>(result: Result<T, Error>) -> String {
    result.expect_err("must be refused").to_string()
}

#[test]
fn what_was_written_comes_back_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let full = Window::full(RESOLUTION);
    let windows = [full, window(-3, -20, 26, 40), window(5, 4, 6, 5), window(0, 16, 23, 33)];
    for compression in ["", "zip", "zips", "piz", "rle", "none"] {
        for (i, &win) in windows.iter().enumerate() {
            for samples in [range(0, 5, 5), range(4, 8, 12)] {
                let path = dir.path().join(format!("{compression}{i}.exr"));
                let mut original = film(win, samples);
                if let Values::Float(values) = &mut original.layers[0].values {
                    values[0] = -0.0;
                    *values.last_mut().unwrap() = f32::from_bits(1);
                }
                let mut meta = metadata();
                meta.compression = compression.to_owned();
                write(&path, &original, &meta).unwrap();
                let (film, mut back) = read(&path).unwrap();
                assert_same(&original, &film, &format!("{compression} {win:?} {samples:?}"));
                meta.attributes.sort_by(|a, b| a.0.cmp(&b.0));
                if compression.is_empty() {
                    assert_eq!(back.compression, "zip");
                    back.compression.clear();
                }
                assert_eq!(meta, back);
            }
        }
    }
}

#[test]
fn the_same_film_gives_the_same_bytes_on_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let film = film(window(0, 0, 23, 300), range(0, 2, 2));
    let bytes = |threads: usize| {
        let path = dir.path().join("out.exr");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write(&path, &film, &metadata())).unwrap();
        fs::read(&path).unwrap()
    };
    let once = bytes(1);
    assert!(once == bytes(1) && once == bytes(2) && once == bytes(5));
}

#[test]
fn another_library_finds_the_channels_with_their_types() {
    use ::exr::prelude::*;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.exr");
    let original = film(window(-2, 3, 20, 30), range(0, 2, 4));
    write(&path, &original, &metadata()).unwrap();
    let image = read_all_flat_layers_from_file(&path).unwrap();
    let layer = &image.layer_data[0];
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    for name in ["dispersion.X", "dispersion.Y", "dispersion.valid", "depth.Z", "Z", "prim_id.I", "U", "V", "valid"] {
        assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
    }
    for name in ["cam.shading_normal.X", "abbe_partial.uv.U_hi", "abbe_partial.dispersion.count"] {
        assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
    }
    assert!(names.iter().all(|n| n != "prim_id.valid" && !n.starts_with("abbe_partial.prim_id")));
    let channel = |name: &str| &layer.channel_data.list.iter().find(|c| c.name.eq(name)).unwrap().sample_data;
    assert!(matches!(channel("prim_id.I"), FlatSamples::U32(_)));
    assert!(matches!(channel("abbe_partial.depth.Z_lo"), FlatSamples::U32(_)));
    let (FlatSamples::F32(bare), FlatSamples::F32(depth)) = (channel("Z"), channel("depth.Z")) else { panic!() };
    assert_eq!(bare, depth);
    let Values::Float(expected) = &original.layers[1].values else { panic!() };
    assert_eq!(depth, expected);
    assert_eq!(layer.attributes.layer_position, Vec2(-2, 3));
    assert_eq!(image.attributes.display_window.size, Vec2(23, 37));
    assert_eq!(image.attributes.pixel_aspect.to_bits(), 1.5f32.to_bits());
    assert_eq!(layer.attributes.frames_per_second, Some((24000, 1001)));
    assert_eq!(layer.attributes.owner.as_ref().map(|t| t.as_slice().to_vec()), Some("Zoë".as_bytes().to_vec()));
    assert!(layer.attributes.world_to_camera.is_some() && image.attributes.chromaticities.is_some());
    let unit = layer.attributes.other.get("abbe:unit:cam.shading_normal".as_bytes());
    assert_eq!(unit, Some(&AttributeValue::Text("1".into())));
}

#[test]
fn names_that_collide_are_usage_errors_naming_both() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.exr");
    let renamed = |names: &[(&str, &str)]| {
        let mut film = film(window(0, 0, 4, 4), range(0, 1, 1));
        for (aov, name) in names {
            film.layers.iter_mut().find(|layer| layer.aov.name == *aov).unwrap().name = (*name).to_owned();
        }
        film
    };
    let refuse = |names: &[(&str, &str)]| {
        let error = write(&path, &renamed(names), &Metadata::default()).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    };
    let text = refuse(&[("depth", "same"), ("dispersion", "same")]);
    assert!(text.contains("`depth`") && text.contains("`dispersion`") && text.contains("`same`"), "{text}");
    let text = refuse(&[("depth", "")]);
    assert!(text.contains("`depth`") && text.contains("`uv`"), "{text}");
    let text = refuse(&[("uv", "a.X"), ("interfaces", "a.X.valid"), ("depth", "a.X.valid.I.x"), ("normal", "a..b")]);
    assert!(text.contains("a..b"), "{text}");
    // `prim_id` → channel `uv.valid.I`; `uv` → `uv.valid`: no collision. An ids layer called like a channel collides.
    let mut film = renamed(&[("uv", "a")]);
    film.layers.push(Layer::new(aov::find("ior").unwrap(), "b.valid".to_owned(), 16, false));
    write(&path, &film, &Metadata::default()).unwrap();
    assert!(message(write(&path, &renamed(&[("uv", &"x".repeat(300))]), &Metadata::default())).contains("255"));
    assert!(message(write(&path, &renamed(&[("uv", "a\0b")]), &Metadata::default())).contains("layer name"));
    let empty = Film { layers: Vec::new(), ..renamed(&[]) };
    assert!(message(write(&path, &empty, &Metadata::default())).contains("no layers"));
    // A bare Z of another layer stays the only one.
    write(&path, &renamed(&[("uv", "uv"), ("depth", "")]), &Metadata::default()).unwrap();
    assert_same(&renamed(&[("uv", "uv"), ("depth", "")]), &read(&path).unwrap().0, "bare depth");
}

#[test]
#[allow(clippy::float_cmp, reason = "the largest half is exact")]
fn half_floats_are_the_nearest_and_never_infinite() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.exr");
    for compression in ["zip", "zips", "piz", "rle", "none"] {
        let mut film = film(window(-2, 1, 7, 38), range(0, 1, 1));
        let normal = film.layers.iter_mut().find(|layer| layer.aov.name == "normal").unwrap();
        normal.half = true;
        let Values::Float(values) = &mut normal.values else { panic!("normals are floats") };
        values[..8].copy_from_slice(&[1e9, -1e9, 65519.0, 0.1, -0.0, 6e-8, 1.0 / 3.0, 1e-9]);
        let metadata = Metadata { compression: compression.into(), ..Metadata::default() };
        write(&path, &film, &metadata).unwrap();
        let (back, _) = read(&path).unwrap();
        for (there, here) in back.layers.iter().zip(&film.layers) {
            let (Values::Float(there_values), Values::Float(here_values)) = (&there.values, &here.values) else {
                assert_eq!(there, here);
                continue;
            };
            assert_eq!((there.half, &there.valid), (here.half, &here.valid));
            for (&there, &value) in there_values.iter().zip(here_values) {
                if !here.half {
                    assert_eq!(there.to_bits(), value.to_bits());
                } else if value.abs() > 65504.0 {
                    assert_eq!(there, 65504f32.copysign(value), "{compression}");
                } else {
                    // Half of the last of 11 bits, or of the smallest step.
                    let error = f64::from(value.abs()) * 2f64.powi(-12) * 2.0;
                    let difference = f64::from(there - value).abs();
                    assert!(difference <= error.max(2f64.powi(-25)), "{compression}: {there} for {value}");
                }
            }
        }
        // What was read is written again to the same bytes.
        let first = std::fs::read(&path).unwrap();
        write(&path, &back, &metadata).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), first, "{compression}");
    }
}

#[test]
fn attributes_have_the_types_of_the_standard() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.exr");
    let film = film(window(0, 0, 2, 2), range(0, 1, 1));
    let with = |name: &str, value: Attribute| {
        let mut metadata = Metadata::default();
        metadata.set(name, value);
        write(&path, &film, &metadata)
    };
    assert!(message(with("worldToCamera", Attribute::Int(1))).contains("m44f"));
    assert!(message(with("channels", Attribute::Int(1))).contains("film"));
    assert!(message(with("timeCode", Attribute::Text("01:00".into()))).contains("attribute timeCode"));
    assert!(message(with("", Attribute::Int(1))).contains("1 to 255"));
    assert!(message(with("pixelAspectRatio", Attribute::Float(2.0))).contains("film"));
    with("pixelAspectRatio", Attribute::Float(1.5)).unwrap();
    let lossy = Metadata { compression: "dwaa".into(), ..Metadata::default() };
    assert!(message(write(&path, &film, &lossy)).contains("zip, zips, piz, rle, none"));
}

fn names_in(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_failed_write_leaves_what_was_there() {
    let dir = tempfile::tempdir().unwrap();
    let film = film(window(0, 0, 4, 4), range(0, 1, 1));
    let refuse = |path: &Path| message(write(path, &film, &Metadata::default()));

    let text = refuse(&dir.path().join("nowhere/out.exr"));
    assert!(text.contains("does not exist") && text.contains("nowhere"), "{text}");
    assert!(refuse(dir.path()).contains("is a directory"));
    assert!(refuse(Path::new("/dev/null")).contains("device"));
    assert!(refuse(&dir.path().join("..")).contains("no file name"));
    let text = refuse(&dir.path().join("x".repeat(300)));
    assert!(text.contains("file name"), "{text}");

    let old = dir.path().join("old.exr");
    fs::write(&old, b"old").unwrap();
    assert!(refuse(&old.join("in_a_file.exr")).contains("not a directory"));
    let mut rights = fs::metadata(&old).unwrap().permissions();
    rights.set_readonly(true);
    fs::set_permissions(&old, rights).unwrap();
    assert!(refuse(&old).contains("write-protected"));
    assert_eq!(fs::read(&old).unwrap(), b"old");
    assert_eq!(names_in(dir.path()), ["old.exr"]);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_rights_are_the_users() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let film = film(window(0, 0, 4, 4), range(0, 1, 1));
    let (target, link) = (dir.path().join("target.exr"), dir.path().join("link.exr"));
    std::os::unix::fs::symlink("target.exr", &link).unwrap();
    for _ in 0..2 {
        write(&link, &film, &Metadata::default()).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        read(&target).unwrap();
    }
    let plain = dir.path().join("plain");
    fs::write(&plain, b"").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&target), mode(&plain));
    assert_eq!(names_in(dir.path()), ["link.exr", "plain", "target.exr"]);
}

/// Not a law by itself: the child of the next test, which kills it.
#[test]
fn child_that_writes_until_it_is_killed() {
    if let Some(path) = std::env::var_os("ABBE_TEST_WRITE_UNTIL_KILLED") {
        let films = [0, 1].map(|i| film(window(i, 0, 23, 37), range(0, 1, 1)));
        for film in films.iter().cycle() {
            write(Path::new(&path), film, &Metadata::default()).unwrap();
        }
    }
}

#[test]
fn a_killed_writer_leaves_the_old_file_or_the_new_one() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.exr");
    write(&path, &film(window(0, 0, 23, 37), range(0, 1, 1)), &Metadata::default()).unwrap();
    for milliseconds in [5, 20, 35, 60, 100] {
        let mut child = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child_that_writes_until_it_is_killed", "--nocapture"])
            .env("ABBE_TEST_WRITE_UNTIL_KILLED", &path)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        child.kill().unwrap();
        child.wait().unwrap();
        let (film, _) = read(&path).unwrap();
        assert_eq!(film.window.y1, 37);
    }
}

#[test]
fn foreign_and_missing_files_are_named() {
    let dir = tempfile::tempdir().unwrap();
    assert!(message(read(&dir.path().join("none.exr"))).contains("none.exr"));
    assert!(message(read(dir.path())).contains("plain file"));
    let path = dir.path().join("other.exr");
    fs::write(&path, b"not an image").unwrap();
    assert!(message(read(&path)).contains("not an EXR"));
    fs::write(&path, b"").unwrap();
    assert!(message(read(&path)).contains("not an EXR"));
    ::exr::prelude::write_rgb_file(&path, 8, 8, |_, _| (0.0f32, 0.5f32, 1.0f32)).unwrap();
    assert!(message(read(&path)).contains("other.exr"));
    let scanlines = {
        use ::exr::prelude::*;
        let channels = AnyChannels::sort([AnyChannel::new("R", FlatSamples::F32(vec![0.0; 64]))].into_iter().collect());
        let encoding = Encoding::SMALL_LOSSLESS;
        let layer = Layer::new(
            (8, 8),
            LayerAttributes::named("x"),
            Encoding { blocks: Blocks::ScanLines, ..encoding },
            channels,
        );
        Image::from_layer(layer).write().to_file(&path)
    };
    scanlines.unwrap();
    assert!(message(read(&path)).contains("not written by abbe"));
}

#[test]
fn damaged_files_are_errors_and_never_panics() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("hostile.exr");
    for compression in ["zip", "zips", "piz", "rle", "none"] {
        let mut meta = metadata();
        meta.compression = compression.to_owned();
        write(&path, &film(window(0, 0, 9, 21), range(0, 2, 4)), &meta).unwrap();
        let good = fs::read(&path).unwrap();
        // Every length of the header, then every 97th.
        for length in (0..1200.min(good.len())).step_by(3).chain((1200..good.len()).step_by(97)) {
            fs::write(&path, &good[..length]).unwrap();
            assert!(read(&path).is_err(), "{compression}: {length} of {} bytes", good.len());
        }
        for round in 0..600u64 {
            let mut bytes = good.clone();
            for k in 0..=round % 3 {
                let at = random(&[round, k]) as usize % bytes.len();
                bytes[at] = match round % 4 {
                    0 => bytes[at] ^ (1 << (random(&[round, k, 1]) % 8)),
                    1 => 0xff,
                    2 => 0,
                    _ => random(&[round, k, 2]) as u8,
                };
            }
            fs::write(&path, &bytes).unwrap();
            let _ = read(&path);
        }
    }
}

#[test]
fn a_small_file_cannot_claim_a_large_image() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("hostile.exr");
    write(&path, &film(window(0, 0, 4, 4), range(0, 1, 1)), &Metadata::default()).unwrap();
    let good = fs::read(&path).unwrap();
    let at = good.windows(17).position(|w| w == b"dataWindow\0box2i\0").unwrap() + 17 + 4;
    for corners in [
        [0, 0, 1 << 29, 1 << 29],
        [0, 0, 3, 1 << 29],
        [0, 0, 1 << 29, 3],
        [i32::MIN, i32::MIN, i32::MAX, i32::MAX],
        [4, 4, 0, 0],
        [0, 0, 30_000, 3],
    ] {
        let mut bytes = good.clone();
        for (k, corner) in corners.into_iter().enumerate() {
            bytes[at + 4 * k..at + 4 * k + 4].copy_from_slice(&i32::to_le_bytes(corner));
        }
        fs::write(&path, &bytes).unwrap();
        assert!(message(read(&path)).contains("damaged"), "{corners:?}");
    }
}

/// Writes the parts and returns their paths.
fn parts(dir: &Path, pieces: &[(Window, SampleRange)]) -> Vec<PathBuf> {
    pieces
        .iter()
        .enumerate()
        .map(|(i, &(window, samples))| {
            let path = dir.join(format!("part{i}.exr"));
            let mut meta = metadata();
            meta.set("abbe:renderTime", Attribute::Double(i as f64));
            write(&path, &film(window, samples), &meta).unwrap();
            path
        })
        .collect()
}

/// Merges the pieces and compares with a film of `window` and `samples` rendered in one go, down to the file's bytes.
fn assert_merges(pieces: &[(Window, SampleRange)], window: Window, samples: SampleRange, what: &str) {
    let dir = tempfile::tempdir().unwrap();
    let inputs = parts(dir.path(), pieces);
    let (out, direct) = (dir.path().join("merged.exr"), dir.path().join("direct.exr"));
    merge(&inputs, &out).unwrap_or_else(|e| panic!("{what}: {e}"));
    let whole = film(window, samples);
    assert_same(&whole, &read(&out).unwrap().0, what);
    let mut meta = metadata();
    meta.compression = "zip".into();
    write(&direct, &whole, &meta).unwrap();
    assert!(fs::read(&out).unwrap() == fs::read(&direct).unwrap(), "{what}: the files differ");
}

#[test]
fn parts_merge_to_the_bits_of_one_render() {
    let full = Window::full(RESOLUTION);
    let all = range(0, 12, 12);
    let (left, right) = (window(0, 0, 9, 37), window(9, 0, 23, 37));
    let (top, bottom) = (window(0, 0, 23, 17), window(0, 17, 23, 37));
    let quarters = [range(0, 4, 12), range(4, 8, 12), range(8, 12, 12)];

    assert_merges(&[(full, all)], full, all, "one file");
    assert_merges(&[(right, all), (left, all)], full, all, "crops, any order");
    assert_merges(&quarters.map(|r| (full, r)), full, all, "ranges");
    assert_merges(&[(full, range(8, 12, 12)), (full, range(0, 8, 12))], full, all, "unequal ranges, any order");
    let singles: Vec<_> = (0..12).map(|i| (full, range(i, i + 1, 12))).collect();
    assert_merges(&singles, full, all, "every sample alone");
    let product: Vec<_> = quarters.iter().flat_map(|&r| [left, right].map(|w| (w, r))).collect();
    assert_merges(&product, full, all, "crops × ranges");
    let mixed = [(top, range(0, 8, 12)), (top, range(8, 12, 12)), (bottom, all)];
    assert_merges(&mixed, full, all, "a crop in ranges beside a whole one");
    let ragged = [
        (left, range(0, 4, 12)),
        (right, range(0, 4, 12)),
        (top, range(4, 8, 12)),
        (bottom, range(4, 8, 12)),
        (full, range(8, 12, 12)),
    ];
    assert_merges(&ragged, full, all, "each range cropped its own way");
    let overlapping = [(window(0, 0, 15, 37), all), (window(6, 0, 23, 37), all), (window(2, 2, 20, 30), all)];
    assert_merges(&overlapping, full, all, "overlapping crops");
    assert_merges(
        &[(window(-2, -3, 9, 40), all), (window(9, -3, 25, 40), all)],
        window(-2, -3, 25, 40),
        all,
        "overscan",
    );
    assert_merges(
        &[(window(3, 5, 9, 20), all), (window(9, 5, 14, 20), all)],
        window(3, 5, 14, 20),
        all,
        "a crop of crops",
    );
    for total in [1, 2, 7, 13, 16] {
        for size in [1, 2, 4, 8, 16] {
            let pieces: Vec<_> = (0..total)
                .step_by(size as usize)
                .map(|begin| (left, range(begin, (begin + size).min(total), total)))
                .collect();
            assert_merges(&pieces, left, SampleRange::all(total), &format!("{total} samples by {size}"));
        }
    }
}

#[test]
fn an_aligned_range_of_parts_is_a_part_again() {
    let full = Window::full(RESOLUTION);
    let (left, right) = (window(0, 0, 9, 37), window(9, 0, 23, 37));
    assert_merges(&[(full, range(8, 12, 21)), (full, range(12, 16, 21))], full, range(8, 16, 21), "inner node");
    assert_merges(&[(full, range(16, 20, 21)), (full, range(20, 21, 21))], full, range(16, 21, 21), "tail");
    assert_merges(&[(left, range(4, 8, 21)), (right, range(4, 8, 21))], full, range(4, 8, 21), "crops of one range");

    // In two steps to the same bits.
    let dir = tempfile::tempdir().unwrap();
    let inputs = parts(dir.path(), &[(full, range(0, 4, 8)), (full, range(4, 6, 8)), (full, range(6, 8, 8))]);
    let (half, out) = (dir.path().join("half.exr"), dir.path().join("out.exr"));
    merge(&inputs[1..], &half).unwrap();
    merge(&[half, inputs[0].clone()], &out).unwrap();
    assert_same(&film(full, range(0, 8, 8)), &read(&out).unwrap().0, "two steps");
}

#[test]
fn parts_that_do_not_fit_are_refused_with_the_reason() {
    let full = Window::full(RESOLUTION);
    let all = range(0, 8, 8);
    let (left, right) = (window(0, 0, 9, 37), window(9, 0, 23, 37));
    let refuse = |pieces: &[(Window, SampleRange)], words: &[&str]| {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out.exr");
        let inputs = parts(dir.path(), pieces);
        let text = message(merge(&inputs, &out));
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
        assert_eq!(names_in(dir.path()).len(), inputs.len(), "nothing is left behind");
    };
    refuse(&[], &["no files"]);
    refuse(&[(left, all), (window(12, 0, 23, 37), all)], &["111 pixels", "9,0 to 12,37"]);
    refuse(&[(left, all), (window(9, 0, 23, 30), all)], &["98 pixels", "9,30 to 23,37"]);
    refuse(&[(full, range(0, 2, 8)), (full, range(4, 8, 8))], &["2..4", "missing"]);
    refuse(&[(full, range(0, 4, 8)), (full, range(4, 6, 8))], &["6..8", "missing"]);
    refuse(&[(full, range(2, 4, 8)), (full, range(4, 8, 8))], &["0..2", "missing"]);
    refuse(&[(full, range(0, 4, 8)), (full, range(0, 2, 8))], &["0..2", "also in", "part"]);
    refuse(&[(full, range(0, 3, 8)), (full, range(3, 8, 8))], &["0..3", "power of two"]);
    refuse(&[(left, range(0, 4, 8)), (right, range(4, 8, 8))], &["0..4", "4..8", "pixels"]);
    refuse(&[(full, range(0, 4, 8)), (full, range(4, 8, 12))], &["number of samples", "12"]);
}

#[test]
fn parts_of_different_renders_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let all = range(0, 2, 2);
    let (a, b, out) = (dir.path().join("a.exr"), dir.path().join("b.exr"), dir.path().join("out.exr"));
    let inputs = [a.clone(), b.clone()];
    let (left, right) = (film(window(0, 0, 9, 37), all), film(window(9, 0, 23, 37), all));
    write(&a, &left, &metadata()).unwrap();

    let mut other = metadata();
    other.set("abbe:settingsHash", Attribute::Text("ffff".into()));
    write(&b, &right, &other).unwrap();
    let text = message(merge(&inputs, &out));
    assert!(
        text.contains("b.exr") && text.contains("a.exr") && text.contains("settingsHash") && text.contains("ffff"),
        "{text}"
    );

    let mut other = metadata();
    other.set("comments", Attribute::Text("only here".into()));
    write(&b, &right, &other).unwrap();
    assert!(message(merge(&inputs, &out)).contains("comments"));

    let mut fewer = right.clone();
    fewer.layers.pop();
    write(&b, &fewer, &metadata()).unwrap();
    assert!(message(merge(&inputs, &out)).contains("layers"));

    let mut larger = right.clone();
    larger.resolution = [24, 37];
    write(&b, &larger, &metadata()).unwrap();
    assert!(message(merge(&inputs, &out)).contains("resolution"));

    // Overlapping pixels with another bit, in each kind of channel.
    type Change = fn(&mut Film);
    let changes: [(Change, &str); 3] = [
        (
            |film| {
                if let Values::Float(v) = &mut film.layers[0].values {
                    v[2 * (23 * 5 + 4)] += 1.0
                }
            },
            "dispersion",
        ),
        (|film| film.layers[1].valid.as_mut().unwrap()[23 * 5 + 4] = 0.25, "depth"),
        (
            |film| {
                if let Values::Uint(v) = &mut film.layers[2].values {
                    v[23 * 5 + 4] ^= 1
                }
            },
            "prim_id",
        ),
    ];
    for (change, layer) in changes {
        let mut overlapping = film(Window::full(RESOLUTION), all);
        change(&mut overlapping);
        write(&b, &overlapping, &metadata()).unwrap();
        let text = message(merge(&inputs, &out));
        assert!(text.contains(layer) && text.contains("4,5") && text.contains("b.exr"), "{text}");
    }
    assert!(!out.exists());
    assert!(exr::PER_PART.contains(&"abbe:renderTime"));
}
