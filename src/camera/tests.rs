use super::*;
use crate::scene::description;

fn authored() -> description::Camera {
    description::Camera {
        path: "/cam".into(),
        transform: DMat4::from_rotation_y(0.3).to_cols_array(),
        projection: "perspective".into(),
        horizontal_aperture: 36.0,
        vertical_aperture: 24.0,
        horizontal_aperture_offset: 3.0,
        vertical_aperture_offset: -2.0,
        focal_length: 35.0,
        f_stop: 1.4,
        focus_distance: 7.0,
        ..description::Camera::default()
    }
}

fn fit(camera: &description::Camera) -> Camera {
    Camera::new(camera, [60, 40], 1.0, ConformPolicy::ExpandAperture).unwrap()
}

/// A pinhole, a lens, parallel rays; each also through a transform that shears, mirrors and scales.
fn cameras() -> Vec<Camera> {
    let sheared =
        DMat4::from_cols_array(&[1.2, 0.1, 0.0, 0.0, -0.3, -0.9, 0.2, 0.0, 0.1, 0.0, 1.5, 0.0, 3.0, 2.0, 1.0, 1.0]);
    let mut cameras = Vec::new();
    for transform in [DMat4::from_rotation_y(0.3), sheared] {
        let mut authored = authored();
        authored.transform = transform.to_cols_array();
        cameras.push(fit(&authored));
        cameras.push(fit(&authored).with_lens(Lens::of(&authored).unwrap()));
        authored.projection = "orthographic".into();
        authored.clipping_range = Some([-2.0, 100.0]);
        cameras.push(fit(&authored));
    }
    cameras
}

#[test]
fn derivatives_are_those_of_the_rays() {
    for (i, camera) in cameras().iter().enumerate() {
        for lens in [[0.5, 0.5], [0.9, 0.2], [0.1, 0.6]] {
            let at = |dx: f64, dy: f64| camera.ray(&CameraSample { raster: [11.5 + dx, 7.25 - dy], lens, time: 0.5 });
            let h = 1e-4;
            let start = at(0.0, 0.0);
            let scale = start.direction_x.length() + start.point_x.length();
            let check = |name: &str, analytic: DVec3, difference: [DVec3; 2]| {
                let difference = (difference[0] - difference[1]) / (2.0 * h);
                let error = (analytic - difference).length();
                assert!(error <= 1e-9 * scale, "camera {i}, {name}: {analytic} against {difference}");
            };
            let [right, left] = [at(h, 0.0), at(-h, 0.0)];
            let [up, down] = [at(0.0, h), at(0.0, -h)];
            check("p_x", start.point_x, [right.point, left.point]);
            check("p_y", start.point_y, [up.point, down.point]);
            check("d_x", start.direction_x, [right.direction, left.direction]);
            check("d_y", start.direction_y, [up.direction, down.direction]);
            check("d_xx", start.direction_xx, [right.direction_x, left.direction_x]);
            check("d_xy", start.direction_xy, [up.direction_x, down.direction_x]);
            check("d_yy", start.direction_yy, [up.direction_y, down.direction_y]);
            // A unit vector's derivatives keep its length.
            let residual = start.direction_x.length_squared() + start.direction.dot(start.direction_xx);
            assert!(residual.abs() <= 1e-16, "{residual}");
        }
    }
}

#[test]
fn every_point_of_the_lens_sees_the_plane_of_focus_as_its_centre_does() {
    let authored = authored();
    let camera = fit(&authored).with_lens(Lens::of(&authored).unwrap());
    let into_camera = DMat4::from_cols_array(&authored.transform).inverse();
    let seen = |lens: [f64; 2]| {
        let start = camera.ray(&CameraSample { raster: [3.0, 31.0], lens, time: 0.5 });
        let (p, d) = (into_camera.transform_vector3(start.point), into_camera.transform_vector3(start.direction));
        // The lens stands in the camera's own plane, and 3.5 units of focal length over f/1.4 are 2.5 across.
        assert!(p.z.abs() < 1e-15 && p.length() <= 1.25 + 1e-15);
        p + d * ((-7.0 - p.z) / d.z)
    };
    let centre = seen([0.5, 0.5]);
    for lens in [[0.0, 0.0], [1.0, 0.3], [0.2, 0.9], [0.7, 0.45]] {
        assert!((seen(lens) - centre).length() < 1e-14, "{lens:?}");
    }
}

#[test]
#[allow(clippy::float_cmp, reason = "the same bits are the law under test")]
fn the_centre_of_the_lens_is_the_pinhole() {
    let authored = authored();
    let (pinhole, lens) = (fit(&authored), fit(&authored).with_lens(Lens::of(&authored).unwrap()));
    for x in 0..60 {
        let sample = CameraSample::at(f64::from(x), 0.7 * f64::from(x));
        assert_eq!(pinhole.ray(&sample), lens.ray(&sample));
    }
}

#[test]
fn what_has_no_lens_is_a_pinhole() {
    let changes: [fn(&mut description::Camera); 6] = [
        |c| c.f_stop = 0.0,
        |c| c.f_stop = -2.8,
        |c| c.focus_distance = 0.0,
        |c| c.focus_distance = f64::NAN,
        |c| c.f_stop = 1e-320,
        |c| c.projection = "orthographic".into(),
    ];
    for change in changes {
        let mut authored = authored();
        change(&mut authored);
        assert_eq!(Lens::of(&authored), None);
    }
}

#[test]
fn sight_is_between_the_planes_in_camera_space() {
    for (i, camera) in cameras().iter().enumerate() {
        let mut authored = authored();
        authored.transform = camera.world_from_camera.to_cols_array();
        authored.clipping_range = Some([0.5, 9.0]);
        // Keeps y ≥ −0.1 x − 2, and what is nearer than 8.
        authored.clipping_planes = vec![[0.1, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 8.0], [0.0; 4]];
        if camera.is_orthographic {
            authored.projection = "orthographic".into();
        }
        let clipped = fit(&authored);
        let into_camera = camera.world_from_camera.inverse();
        for (x, y) in [(30.0, 20.0), (1.0, 2.0), (50.0, 39.0), (44.0, 3.0)] {
            let start = clipped.ray(&CameraSample::at(x, y));
            let sight = clipped.clipping().sight(start.point, start.direction);
            let is_seen = |t: f64| {
                let p = into_camera.transform_point3(clipped.position + start.point + t * start.direction);
                (0.5..=8.0).contains(&-p.z) && p.y + 0.1 * p.x + 2.0 >= 0.0
            };
            for step in 0..400 {
                let t = 0.0371 * f64::from(step);
                assert_eq!(sight.near <= t && t <= sight.far, is_seen(t), "camera {i}, ({x}, {y}) at {t}: {sight:?}");
            }
        }
    }
}

#[test]
fn planes_that_cut_nothing_off_are_forgotten() {
    let mut authored = authored();
    authored.transform = DMat4::IDENTITY.to_cols_array();
    authored.clipping_range = Some([1.0, 100.0]);
    let clipping = fit(&authored).clipping().clone();
    let seen = |near: f64, far: f64| clipping.of_box([DVec3::new(-5.0, -5.0, -far), DVec3::new(5.0, 5.0, -near)]);
    assert!(seen(2.0, 90.0).is_empty());
    assert!(!seen(0.9, 90.0).is_empty() && !seen(2.0, 101.0).is_empty() && !seen(1.0, 90.0).is_empty());
}

#[test]
fn a_view_of_parallel_rays_may_begin_behind_its_camera() {
    let mut authored = authored();
    authored.projection = "orthographic".into();
    authored.clipping_range = Some([-2.0, 100.0]);
    let (behind, plain) = (fit(&authored), {
        authored.clipping_range = Some([0.0, 100.0]);
        fit(&authored)
    });
    let sample = CameraSample::at(12.0, 3.0);
    let (a, b) = (behind.ray(&sample), plain.ray(&sample));
    let distance = (plain.position + b.point - behind.position - a.point).length();
    assert!((distance - 2.0).abs() < 1e-15);
    // Depth is that of the camera, wherever the ray begins.
    let p = plain.position + b.point + 3.0 * b.direction;
    assert!((behind.depth(p - behind.position, 0.0) - 3.0).abs() < 1e-14);
    assert!((plain.depth(p - plain.position, 0.0) - 3.0).abs() < 1e-14);
}

#[test]
fn the_aperture_takes_the_images_shape_by_policy() {
    // UsdRenderComputeSpec: width, height and pixel aspect ratio that each policy leaves of 36 × 24 (3:2).
    let (wide, high) = ([60, 20], [20, 40]);
    use ConformPolicy::{
        AdjustApertureHeight, AdjustApertureWidth, AdjustPixelAspectRatio, CropAperture, ExpandAperture,
    };
    #[rustfmt::skip]
    let table = [
        // Twice as wide as the aperture (3:1), and three times as high (1:2); then with pixels of 2:1 (1:1).
        (ExpandAperture,         wide, 1.0, [72.0, 24.0], 1.0),
        (CropAperture,           wide, 1.0, [36.0, 12.0], 1.0),
        (AdjustApertureWidth,    wide, 1.0, [72.0, 24.0], 1.0),
        (AdjustApertureHeight,   wide, 1.0, [36.0, 12.0], 1.0),
        (AdjustPixelAspectRatio, wide, 1.0, [36.0, 24.0], 0.5),
        (ExpandAperture,         high, 1.0, [36.0, 72.0], 1.0),
        (CropAperture,           high, 1.0, [12.0, 24.0], 1.0),
        (AdjustApertureWidth,    high, 1.0, [12.0, 24.0], 1.0),
        (AdjustApertureHeight,   high, 1.0, [36.0, 72.0], 1.0),
        (AdjustPixelAspectRatio, high, 1.0, [36.0, 24.0], 3.0),
        (ExpandAperture,         high, 2.0, [36.0, 36.0], 2.0),
        (CropAperture,           high, 2.0, [24.0, 24.0], 2.0),
        (AdjustApertureWidth,    high, 2.0, [24.0, 24.0], 2.0),
        (AdjustApertureHeight,   high, 2.0, [36.0, 36.0], 2.0),
        (AdjustPixelAspectRatio, high, 2.0, [36.0, 24.0], 3.0),
    ];
    for (policy, resolution, ratio, [width, height], pixel) in table {
        let camera = Camera::new(&authored(), resolution, ratio, policy).unwrap();
        let case = format!("{policy:?} {resolution:?} {ratio}");
        assert!((camera.window[0] * 35.0 - width).abs() < 1e-12, "{case}: {:?}", camera.window);
        assert!((camera.window[1] * 35.0 - height).abs() < 1e-12, "{case}: {:?}", camera.window);
        assert!((camera.pixel_aspect_ratio - pixel).abs() < 1e-12, "{case}: {}", camera.pixel_aspect_ratio);
        assert!(ConformPolicy::TOKENS.iter().any(|token| ConformPolicy::from_token(token) == Some(policy)));
    }
}
