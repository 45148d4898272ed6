//! Cameras of every kind before glass: lenses, parallel rays, what is clipped or hidden; derivatives against re-traces.

mod support;

use abbe::camera::{Camera, ConformPolicy, Lens};
use abbe::integrator::chain::{Chain, Counters, End, Follower, Record};
use abbe::integrator::transmittance::Segment;
use abbe::ray::{ColumnSet, NoColumns, ScreenColumns, SecondOrderColumns, second_order_along};
use abbe::render::Request;
use abbe::sampler::{CameraSample, Sampler};
use abbe::scene::Scene;
use abbe::scene::description;
use abbe::scene::view::{Media, View};
use abbe::spectrum::Wavelength;
use glam::{DMat4, DVec2, DVec3};
use serde_json::json;
use support::{BK7, SF11, Stagehand, authored, ball, floats, integers, prism, rendered, request, the_plan};

const NM: f64 = 587.5618;
const RESOLUTION: [u32; 2] = [48, 32];

/// A scene and the camera that looks at it, with its lens if it has one.
struct Set {
    scene: Scene,
    camera: Camera,
}

impl Set {
    fn new(mut s: Stagehand, change: impl FnOnce(&mut description::Camera)) -> Self {
        change(&mut s.document.cameras[0]);
        let scene = s.build();
        let authored = &scene.document().cameras[0];
        let camera = Camera::new(authored, RESOLUTION, 1.0, ConformPolicy::ExpandAperture).unwrap();
        let camera = Lens::of(authored).map_or(camera.clone(), |lens| camera.with_lens(lens));
        Self { scene, camera }
    }

    fn with<R>(&self, f: impl FnOnce(&Follower<'_>) -> R) -> R {
        let view = View::new(&self.scene, self.camera.position);
        f(&Follower::of_camera(&view, &self.camera))
    }

    fn media(&self, nm: f64) -> Media {
        Media::at(&self.scene, Wavelength::from_nanometers(nm), 1.0).unwrap()
    }

    fn chain<C: ColumnSet>(&self, sample: &CameraSample) -> Chain<C> {
        let start = self.camera.ray(sample);
        let media = self.media(NM);
        self.with(|follower| follower.follow(&start, &media, Record::none(), &mut Counters::default()))
    }

    fn through(&self, x: f64, y: f64) -> Chain<ScreenColumns> {
        self.chain(&CameraSample::at(x, y))
    }

    fn path_of(&self, chain: &Chain<ScreenColumns>) -> String {
        match &chain.end {
            End::Surface(met) => self.scene.prims.path(self.scene.objects.ids(met.hit.instance).prim_id).unwrap(),
            End::Miss => "miss".into(),
            End::Exhausted => "exhausted".into(),
        }
    }
}

fn point<C>(chain: &Chain<C>) -> Option<DVec3> {
    match &chain.end {
        End::Surface(met) => Some(met.point),
        _ => None,
    }
}

/// Best relative error of central differences over a sweep of steps.
fn sweep(analytic: DVec3, unit: f64, f: impl Fn(f64) -> Option<DVec3>) -> f64 {
    let error = |h: f64| Some((((f(h)? - f(-h)?) / (2.0 * h)) - analytic).length() / analytic.length());
    (0..18).filter_map(|i| error(unit * 0.5f64.powi(i))).fold(f64::INFINITY, f64::min)
}

#[test]
fn every_column_is_the_difference_of_re_traces_for_every_camera() {
    type Change = fn(&mut description::Camera);
    let cameras: [(&str, Change, [f64; 2]); 6] = [
        ("off-centre", |c| (c.horizontal_aperture_offset, c.vertical_aperture_offset) = (1.0, -2.0), [0.5, 0.5]),
        ("lens", |c| (c.f_stop, c.focus_distance) = (4.0, 5.0), [0.8, 0.3]),
        ("edge of the lens", |c| (c.f_stop, c.focus_distance) = (2.8, 9.0), [0.5, 0.0]),
        ("parallel", |c| c.projection = "orthographic".into(), [0.5, 0.5]),
        (
            "parallel from behind",
            |c| (c.projection, c.clipping_range) = ("orthographic".into(), Some([-3.0, 90.0])),
            [0.5, 0.5],
        ),
        // Cuts the front off, so that rays begin in the glass.
        ("clipped", |c| c.clipping_range = Some([5.9, 90.0]), [0.5, 0.5]),
    ];
    for (name, change, lens) in cameras {
        for (what, scene, pixel) in [("ball", ball(), [25.5, 15.5]), ("prism", prism(), [24.2, 14.5])] {
            if name == "clipped" && what == "prism" {
                continue;
            }
            let set = Set::new(scene, |c| {
                // Parallel rays see what the lens sees at the glass.
                (c.horizontal_aperture, c.vertical_aperture) = (36.0, 24.0);
                change(c);
            });
            let sample = CameraSample { raster: pixel, lens, time: 0.5 };
            let start = set.camera.ray(&sample);
            set.with(|follower| {
                let follow = |offset: DVec2, nm: f64| -> Chain<SecondOrderColumns> {
                    let start = set.camera.ray(&sample.moved(offset.x, -offset.y));
                    follower.follow(&start, &set.media(nm), Record::none(), &mut Counters::default())
                };
                let mut log = Vec::new();
                let counters = &mut Counters::default();
                let chain: Chain<SecondOrderColumns> =
                    follower.follow(&start, &set.media(NM), Record::of_steps(&mut log), counters);
                let label = |column: &str| format!("{name}, {what}, {column}");
                assert!(chain.is_dispersive && point(&chain).is_some(), "{}: {:?}", label("end"), chain.end);
                let [x, y] = chain.columns.screen().unwrap();
                let (l, ll) = (chain.columns.lambda().unwrap(), chain.columns.lambda2().unwrap());
                let still = DVec2::ZERO;
                let check = |column: &str, error: f64| assert!(error < 2e-8, "{}: {error:e}", label(column));
                check("x", sweep(x.point, 0.01, |h| point(&follow(DVec2::X * h, NM))));
                check("y", sweep(y.point, 0.01, |h| point(&follow(DVec2::Y * h, NM))));
                check("λ", sweep(l.point, 1.0, |h| point(&follow(still, NM + h))));
                check("λλ", sweep(ll.point, 1.0, |h| follow(still, NM + h).columns.lambda().map(|c| c.point)));
                // The second chain along a direction across screen and spectrum: the difference of its own first derivative.
                let s = DVec3::new(0.02, -0.03, 1.0);
                let along = second_order_along(&start, &chain.start_medium, s, &log);
                let first = |h: f64| {
                    let moved = follow(DVec2::new(s.x, s.y) * h, NM + h);
                    let [x, y] = moved.columns.screen()?;
                    Some(x.point * s.x + y.point * s.y + moved.columns.lambda()?.point)
                };
                check("along s", sweep(along.point2, 1.0, first));
            });
        }
    }
}

/// A slab of glass from z = −1 to 1, a wall at −6, the eye at 6.
fn slab(material: impl FnOnce(&mut Stagehand) -> usize) -> Stagehand {
    let mut s = Stagehand::new();
    let glass = material(&mut s);
    s.wall(-6.0, 60.0, None);
    s.solid(
        description::Shape::Cube { path: "/World/Slab".into(), size: 2.0 },
        DMat4::from_scale(DVec3::new(30.0, 30.0, 1.0)),
        Some(glass),
    );
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    s
}

#[test]
fn a_ray_begins_behind_the_surface_that_its_near_plane_clips_in_the_medium_there() {
    // Straight into the slab, then one refraction out of it: sin θ_t = n sin θ.
    let set = Set::new(slab(|s| s.constant_glass("/World/Glass", 1.5)), |c| c.clipping_range = Some([6.0, 100.0]));
    for (x, y) in [(24.0, 16.0), (40.5, 3.5), (1.5, 30.5)] {
        let start = set.camera.ray(&CameraSample::at(x, y));
        let chain = set.through(x, y);
        assert_eq!((chain.interfaces, chain.start_medium.ior), (1, 1.5));
        let d = start.direction;
        let inside = d * (7.0 / -d.z);
        let tangential = 1.5 * d.truncate();
        let out = tangential.extend(-(1.0 - tangential.length_squared()).sqrt());
        let expected = inside + out * (5.0 / -out.z);
        assert!((point(&chain).unwrap() - expected).length() < 1e-13 * expected.length());
        // The medium's own dispersion is that of a camera inside of it.
        assert_eq!(chain.first.map(|met| met.hit.leaving), Some(true));
    }
    // The same near plane does not cut what a refracted ray meets.
    let set = Set::new(slab(|s| s.constant_glass("/World/Glass", 1.5)), |c| c.clipping_range = Some([1.0, 6.5]));
    let chain = set.through(30.5, 10.5);
    assert_eq!((chain.interfaces, set.path_of(&chain).as_str()), (2, "/World/Wall"));
}

#[test]
fn far_surfaces_are_not_seen_by_the_cameras_own_ray() {
    let mut s = ball();
    s.document.cameras[0].clipping_range = Some([0.1, 8.0]);
    let set = Set::new(s, |_| {});
    // Through the ball to the wall at 12, and past the ball to nothing.
    let through = set.through(25.5, 15.5);
    assert_eq!((through.interfaces, set.path_of(&through).as_str()), (2, "/World/Wall"));
    assert_eq!(set.path_of(&set.through(2.5, 2.5)), "miss");
}

#[test]
fn a_clipping_plane_cuts_a_ball_open() {
    // Keeps x ≥ 0 in camera space: the left half of a ball of BK7 is not seen, and what stands behind it is.
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BK7);
    s.wall(-6.0, 60.0, None);
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    // A slanted plane through the centre: rays on its right side enter the ball unseen and leave it seen.
    let set = Set::new(s, |c| c.clipping_planes = vec![[0.8, 0.0, -0.6, -3.6]]);
    let mut counts = [0; 3];
    for x in 0..48 {
        let chain = set.through(f64::from(x) + 0.5, 16.0);
        counts[chain.interfaces as usize] += 1;
        let start = set.camera.ray(&CameraSample::at(f64::from(x) + 0.5, 16.0));
        if chain.interfaces == 1 {
            // In the glass where the ray comes out of the plane.
            assert!(chain.start_medium.ior > 1.5 && chain.is_dispersive);
            let first = chain.first.unwrap();
            assert!(first.point.x * 0.8 + (first.point.z) * -0.6 - 3.6 > 0.0);
        } else {
            assert!(chain.start_medium.ior < 1.1, "{start:?}");
        }
    }
    assert!(counts.iter().all(|&n| n > 2), "{counts:?}");
}

#[test]
fn absorption_counts_from_the_last_surface_that_is_not_seen() {
    let s = || slab(|s| s.constant_glass("/World/Glass", 1.5));
    let lengths = |change: fn(&mut description::Camera)| {
        let set = Set::new(s(), change);
        let start = set.camera.ray(&CameraSample::at(24.0, 16.0));
        let mut segments: Vec<Segment> = Vec::new();
        let record = Record { steps: None, segments: Some(&mut segments) };
        let chain: Chain<NoColumns> = set.with(|f| f.follow(&start, &set.media(NM), record, &mut Counters::default()));
        assert!(point(&chain).is_some());
        segments.iter().map(|s| (s.medium.is_some(), s.length)).collect::<Vec<_>>()
    };
    assert_eq!(lengths(|_| {}), [(false, 5.0), (true, 2.0), (false, 5.0)]);
    assert_eq!(lengths(|c| c.clipping_range = Some([5.5, 99.0])), [(true, 2.0), (false, 5.0)]);
    assert_eq!(lengths(|c| c.clipping_range = Some([7.5, 99.0])), [(false, 5.0)]);
}

#[test]
fn what_is_hidden_from_the_camera_is_met_by_later_segments() {
    // A mirror behind the hidden ball shows it; the camera itself does not.
    let mut s = Stagehand::new();
    let mirror = s.diffuse("/World/Silver");
    let inputs = &mut s.document.materials[mirror].surface.as_mut().unwrap().inputs;
    inputs.insert("metallic".into(), authored("float", json!(1.0)));
    inputs.insert("roughness".into(), authored("float", json!(0.0)));
    s.wall(-6.0, 60.0, Some(mirror));
    s.sphere("/World/Hidden", 1.0, DMat4::IDENTITY, None);
    s.document.groups[0].items[1].hidden_from_camera = true;
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let set = Set::new(s, |_| {});
    let chain = set.through(24.0, 16.0);
    assert_eq!((chain.interfaces, set.path_of(&chain).as_str()), (1, "/World/Hidden"));
    let first = chain.first.map(|met| set.scene.objects.ids(met.hit.instance).prim_id);
    assert_eq!(first.and_then(|id| set.scene.prims.path(id)), Some("/World/Wall".into()));
}

#[test]
fn hidden_glass_is_passed_straight_and_keeps_the_media_right() {
    // A visible ball within a hidden one: entered from the hidden ball's glass, left into it, and that into air.
    let mut s = Stagehand::new();
    let (outer, inner) = (s.glass("/World/Outer", BK7), s.glass_with_priority("/World/Inner", SF11, 1));
    s.wall(-6.0, 60.0, None);
    s.sphere("/World/Hidden", 1.5, DMat4::IDENTITY, Some(outer));
    s.sphere("/World/Seen", 0.5, DMat4::IDENTITY, Some(inner));
    s.document.groups[0].items[1].hidden_from_camera = true;
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let set = Set::new(s, |_| {});
    let mut counters = Counters::default();
    let start = set.camera.ray(&CameraSample::at(24.5, 16.5));
    let chain: Chain<ScreenColumns> = set.with(|f| f.follow(&start, &set.media(NM), Record::none(), &mut counters));
    assert_eq!((chain.interfaces, counters.unmatched_exits, counters.unseen), (3, 0, 1));
    // Beside the inner ball the outer one is not there at all.
    let beside = set.through(31.0, 16.5);
    assert_eq!((beside.interfaces, beside.start_medium.ior, set.path_of(&beside).as_str()), (0, 1.0, "/World/Wall"));
    let straight = set.camera.ray(&CameraSample::at(31.0, 16.5)).direction;
    assert_eq!(beside.direction, straight);
}

#[test]
fn every_ray_begins_in_the_medium_where_it_begins() {
    // Parallel rays of which some begin inside of a ball; a lens that is half under water.
    let mut s = ball();
    s.document.cameras.clear();
    s.camera(DVec3::new(0.1, -0.05, 0.0), DVec3::new(0.1, -0.05, -1.0));
    let set = Set::new(s, |c| c.projection = "orthographic".into());
    for (x, y) in [(24.5, 16.5), (2.5, 16.5), (45.5, 2.5), (30.5, 20.5)] {
        let start = set.camera.ray(&CameraSample::at(x, y));
        let is_inside = start.point.length() < 1.0;
        assert_eq!(set.through(x, y).start_medium.ior > 1.5, is_inside, "({x}, {y})");
        assert_eq!(set.through(x, y).interfaces, u32::from(is_inside), "({x}, {y}): {:?}", set.through(x, y));
    }
    let mut s = Stagehand::new();
    let water = s.constant_glass("/World/Water", 1.33);
    s.wall(-6.0, 60.0, None);
    let cube = description::Shape::Cube { path: "/World/Pool".into(), size: 2.0 };
    s.solid(
        cube,
        DMat4::from_translation(DVec3::new(0.0, -15.0, 5.0)) * DMat4::from_scale(DVec3::splat(15.0)),
        Some(water),
    );
    s.camera(DVec3::new(0.0, 0.01, 6.0), DVec3::new(0.0, 0.01, 0.0));
    let set = Set::new(s, |c| (c.f_stop, c.focus_distance) = (1.4, 12.0));
    for lens in [[0.5, 0.9], [0.5, 0.1], [0.2, 0.4], [0.7, 0.52]] {
        let sample = CameraSample { raster: [24.5, 16.5], lens, time: 0.5 };
        let start = set.camera.ray(&sample);
        let chain: Chain<NoColumns> = set.chain(&sample);
        assert_eq!(chain.start_medium.ior > 1.3, start.point.y + 0.01 < 0.0, "{lens:?}");
    }
}

#[test]
fn the_circle_of_confusion_is_that_of_a_thin_lens() {
    // Focused at 9, a wall at 12: rays through the lens' rim land on a circle of radius r · 3/9 about the centre's point.
    let mut s = Stagehand::new();
    s.wall(-6.0, 60.0, None);
    s.camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let set = Set::new(s, |c| (c.f_stop, c.focus_distance) = (2.0, 9.0));
    // 35 tenths of a unit over f/2 are 1.75 across.
    let centre = point(&set.through(7.5, 20.5)).unwrap();
    let sampler = Sampler::new(256, 3).unwrap();
    let (mut largest, mut mean) = (0.0f64, DVec3::ZERO);
    for i in 0..256 {
        let lens = sampler.sample([7, 20], i).lens;
        let there = point(&set.chain::<NoColumns>(&CameraSample { raster: [7.5, 20.5], lens, time: 0.5 })).unwrap();
        largest = largest.max((there - centre).length());
        mean += (there - centre) / 256.0;
    }
    let radius = 0.875 / 3.0;
    assert!(largest <= radius * (1.0 + 1e-12) && largest > 0.95 * radius, "{largest} of {radius}");
    assert!(mean.length() < 0.02 * radius, "{mean}");
}

#[test]
fn depth_of_field_is_as_the_stage_says_unless_asked_otherwise() {
    let scene = |change: fn(&mut description::Camera)| {
        let mut s = ball();
        (s.document.cameras[0].f_stop, s.document.cameras[0].focus_distance) = (2.8, 6.0);
        change(&mut s.document.cameras[0]);
        s.build()
    };
    let ask = |samples: u32, depth_of_field: Option<bool>| Request {
        samples: Some(samples),
        depth_of_field,
        ..request(24, 16, &["depth", "dispersion", "refracted_position", "prim_id"])
    };
    let (open, pinhole) = (scene(|_| {}), scene(|c| c.f_stop = 0.0));
    // A sample through the centre of the lens, and a lens that is turned off, are the pinhole's bits.
    for request in [ask(1, None), ask(1, Some(true)), ask(16, Some(false))] {
        assert_eq!(rendered(&open, &request).film, rendered(&pinhole, &request).film);
    }
    assert_ne!(rendered(&open, &ask(16, None)).film, rendered(&pinhole, &ask(16, None)).film);
    assert_eq!(rendered(&pinhole, &ask(16, Some(true))).film, rendered(&pinhole, &ask(16, None)).film);
    let warnings = |scene: &Scene, request: &Request| {
        let plan = the_plan(scene, request);
        let of_depth = |w: &&abbe::diagnostics::Warning| w.kind == "depth-of-field";
        plan.diagnostics.warnings().iter().find(of_depth).map(|w| w.message.clone())
    };
    assert_eq!(warnings(&open, &ask(16, None)), None);
    assert_eq!(warnings(&open, &ask(1, Some(false))), None);
    assert!(warnings(&open, &ask(1, None)).unwrap().contains("--samples 16"));
    assert!(warnings(&pinhole, &ask(16, Some(true))).unwrap().contains("no fStop"));
    assert!(warnings(&scene(|c| c.focus_distance = 0.0), &ask(16, None)).unwrap().contains("focusDistance"));
    let parallel = scene(|c| c.projection = "orthographic".into());
    assert!(warnings(&parallel, &ask(16, None)).unwrap().contains("orthographic"));
}

#[test]
fn a_range_that_holds_nothing_is_ignored_with_a_warning() {
    let mut s = ball();
    s.document.cameras[0].clipping_range = Some([5.0, 5.0]);
    let scene = s.build();
    let image = rendered(&scene, &request(24, 16, &["prim_id"]));
    assert!(image.statistics.warnings.warnings().iter().any(|w| w.kind == "clipping-range"));
    assert!(integers(&image.film, "prim_id").iter().all(|&id| id > 0));
}

#[test]
fn clipping_needs_no_more_rays_where_it_cuts_nothing() {
    let rays = |range: Option<[f64; 2]>| {
        let mut s = ball();
        s.document.cameras[0].clipping_range = range;
        let image = rendered(&s.build(), &request(24, 16, &["dispersion"]));
        (image.statistics.counters, floats(&image.film, "dispersion").0.to_vec())
    };
    assert_eq!(rays(Some([1.0, 1e6])), rays(None));
}

#[test]
fn a_fallback_that_clips_is_named_and_an_authored_range_is_not() {
    for (is_authored, range, is_named) in
        [(false, [5.5, 1e6], true), (true, [5.5, 1e6], false), (false, [1.0, 1e6], false)]
    {
        let mut s = ball();
        (s.document.cameras[0].clipping_range, s.document.cameras[0].clipping_authored) = (Some(range), is_authored);
        let image = rendered(&s.build(), &request(24, 16, &["depth"]));
        let named = image.statistics.warnings.warnings().iter().any(|w| w.kind == "clipped-by-fallback");
        assert_eq!(named, is_named, "{range:?}");
    }
}
