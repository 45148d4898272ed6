//! Optics as `path` sees it: where light appears behind a prism, and where a ball lens gathers it, wavelength by wavelength.

mod support;

use std::f64::consts::{FRAC_PI_3, FRAC_PI_6};

use abbe::render::Request;
use abbe::scene::description::LightShape;
use glam::{DMat4, DQuat, DVec3};
use support::transport::{color_request, lambert, light, values};
use support::{SF11, Stagehand, rendered};

/// n by Sellmeier's law.
fn ior(([b1, b2, b3], [c1, c2, c3]): ([f64; 3], [f64; 3]), nm: f64) -> f64 {
    let square = (nm / 1000.0) * (nm / 1000.0);
    (1.0 + [(b1, c1), (b2, c2), (b3, c3)].map(|(b, c)| b * square / (square - c)).iter().sum::<f64>()).sqrt()
}

/// What is reflected inside makes ghosts: the prism shows a mirrored one, of 0.3 %.
fn spectral_request(size: [u32; 2], samples: u32, bins: &str) -> Request {
    let aovs = Some(vec![format!("spectral:{bins}")]);
    Request { aovs, max_reflection_depth: Some(0), ..color_request(size[0], size[1], samples, "path") }
}

/// A sun of so many degrees whose light travels along `direction`.
fn sun(angle: f64, direction: DVec3) -> abbe::scene::description::Light {
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, direction);
    light("/World/Sun", LightShape::Distant { angle }, DMat4::from_quat(turn))
}

#[test]
fn a_prism_shows_a_lamp_where_refraction_puts_it() {
    // The ray of 520 nm along the axis of the camera has minimum deviation, and meets the middle of the sun.
    let incidence = (ior(SF11, 520.0) * FRAC_PI_6.sin()).asin();
    // Into the right face, whose normal points 30° up from +x, at an angle of incidence.
    let inward = |i: f64| DVec3::new(-(i - FRAC_PI_6).cos(), 0.0, (i - FRAC_PI_6).sin());
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", SF11);
    s.prism(DMat4::IDENTITY, Some(glass));
    let axis = inward(incidence);
    let middle = DVec3::new(0.25, 0.0, 3f64.sqrt() / 12.0);
    s.camera(middle - 1.5 * axis, middle);
    // 9.5° by 0.95°: of 1.5 units 0.25 of the face, which is 1 wide and is seen at 63°.
    let camera = &mut s.document.cameras[0];
    (camera.horizontal_aperture, camera.vertical_aperture, camera.focal_length) = (10.0, 1.0, 60.0);
    s.document.groups[0].lights = vec![sun(0.4, DVec3::new(-axis.x, 0.0, axis.z))];
    let [width, height] = [300, 30];
    let film = rendered(&s.build(), &spectral_request([width, height], 64, "450:650:10")).film;
    let radiance = values(&film, "spectral");
    let bins = 20;
    let right = DVec3::Y.cross(-axis);
    let mut sum = 0.0;
    for bin in 0..bins {
        let (mut power, mut moment) = (0.0, 0.0);
        for (pixel, spectrum) in radiance.chunks_exact(bins).enumerate() {
            let x = ((pixel % width as usize) as f64 + 0.5) / f64::from(width) - 0.5;
            power += f64::from(spectrum[bin]);
            moment += f64::from(spectrum[bin]) * x * 10.0 / 60.0;
        }
        // From the sun through the prism to the camera: r + r' = 60°, sin i' = n sin r'.
        let n = ior(SF11, 455.0 + 10.0 * bin as f64);
        let from_sun = (incidence.sin() / n).asin();
        let seen = inward((n * (FRAC_PI_3 - from_sun).sin()).asin());
        let expected = (seen.dot(right) / seen.dot(axis)).atan().to_degrees();
        let found = (moment / power).atan().to_degrees();
        // Some 200 paths meet a disk whose standard deviation is a quarter of its diameter: 0.007°.
        assert!((found - expected).abs() < 0.03, "bin {bin}: {found}° instead of {expected}°");
        sum += (found - expected) / bins as f64;
        if bin == 0 || bin == bins - 1 {
            assert!(expected.abs() > 1.0, "dispersion is much larger than all this: {expected}°");
        }
    }
    assert!(sum.abs() < 0.007, "{sum}°");
}

/// No glass that exists: n is about 3/2, so that the focus is well outside of a ball, but the Abbe number 19.
const BALL: ([f64; 3], [f64; 3]) = ([1.2, 0.0, 0.0], [0.03, 0.01, 0.01]);
/// Half the side of the square stop before the ball of radius 1.
const STOP: f64 = 0.4;

/// Where a ray parallel to the axis at `height` meets it behind the ball, from the centre, and its slope there.
fn crossing(n: f64, height: f64) -> (f64, f64) {
    let turned = 2.0 * (height.asin() - (height / n).asin());
    (height / turned.sin(), turned.tan())
}

/// Mean squares of the distance from the axis in a plane so far behind the centre of the ball, for each bin.
fn spread(distance: f64) -> Vec<f64> {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BALL);
    let [white, black] = [0.5, 0.0].map(|albedo| lambert(&mut s, albedo));
    s.wall(-distance as f32, 5.0, Some(white));
    s.sphere("/World/Ball", 1.0, DMat4::IDENTITY, Some(glass));
    let (a, b) = (STOP as f32, 5.0);
    let corners = |r: f32| [[-r, -r, 1.2], [r, -r, 1.2], [r, r, 1.2], [-r, r, 1.2]];
    let points = [corners(a), corners(b)].concat();
    let faces: [&[i32]; 4] = [&[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 4, 0]];
    s.mesh("/World/Stop", &points, &faces, DMat4::IDENTITY, Some(black));
    for item in &mut s.document.groups[0].items {
        item.hidden_from_camera = item.path != "/World/Wall";
    }
    s.camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    let camera = &mut s.document.cameras[0];
    camera.projection = "orthographic".into();
    (camera.horizontal_aperture, camera.vertical_aperture) = (3.6, 3.6);
    s.document.groups[0].lights = vec![sun(5.0, DVec3::NEG_Z)];
    let size = 48;
    // What the wall scatters back to the ball is no caustic.
    let request = Request { max_diffuse_depth: Some(1), ..spectral_request([size, size], 192, "450:650:40") };
    let film = rendered(&s.build(), &request).film;
    let bins = 5;
    let mut moments = vec![[0.0; 2]; bins];
    for (pixel, spectrum) in values(&film, "spectral").chunks_exact(bins).enumerate() {
        let place = |i: usize| 0.36 * ((i as f64 + 0.5) / f64::from(size) - 0.5);
        let [x, y] = [pixel % size as usize, pixel / size as usize].map(place);
        for (moments, power) in moments.iter_mut().zip(spectrum) {
            moments[0] += f64::from(*power);
            moments[1] += f64::from(*power) * (x * x + y * y);
        }
    }
    moments.iter().map(|[power, moment]| moment / power).collect()
}

#[test]
fn a_ball_gathers_light_at_its_focus() {
    let (middle, step) = (1.42, 0.35);
    let [near, at, far] = [middle - step, middle, middle + step].map(spread);
    let mut found = Vec::new();
    for bin in 0..5 {
        // A mean square is a parabola over the distance, least where the spot is narrowest.
        let narrowest = middle - 0.5 * step * (far[bin] - near[bin]) / (far[bin] + near[bin] - 2.0 * at[bin]);
        // The same of rays parallel to the axis, even over the stop and the bin: Σ z tan² / Σ tan².
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in 0..20 * 20 * 8 {
            let part = |i: i32, n: i32| (f64::from(i) + 0.5) / f64::from(n);
            let height = STOP * part(i % 20, 20).hypot(part(i / 20 % 20, 20));
            let nm = 450.0 + 40.0 * (bin as f64 + part(i / 400, 8));
            let (z, slope) = crossing(ior(BALL, nm), height);
            sum += z * slope * slope;
            weights += slope * slope;
        }
        let expected = sum / weights;
        // Paraxially nD/(4(n − 1)), and nearer by no more than the ray through the stop's corner.
        let n = ior(BALL, 470.0 + 40.0 * bin as f64);
        let focus = n / (2.0 * (n - 1.0));
        let aberration = focus - crossing(n, STOP * 2f64.sqrt()).0;
        assert!((focus - aberration..focus).contains(&expected), "{expected} of {focus}");
        // Of some 800 paths: 0.0045. The sun is no point, which is less than 0.003; the foci of the bins are 0.05 apart.
        assert!((narrowest - expected).abs() < 0.02, "bin {bin}: {narrowest} instead of {expected}");
        found.push(narrowest - expected);
    }
    let mean = found.iter().sum::<f64>() / 5.0;
    assert!(mean.abs() < 0.009, "{mean}");
}
