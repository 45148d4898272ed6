//! From directions to the pixels of environment images, and back to what the layouts are called.
//!
//! Directions are in the environment's space: upper pole +y, the middle of the image +z; who looks there has −x to his
//! right. Image coordinates (s, t) run from the upper left corner, (0, 0), to the lower right, (1, 1).
//!
//! `latlong` is that of the OpenEXR documentation, which UsdLux cites: longitude π at the left edge, −π at the right,
//! longitude π/2 is +x. `mirroredBall` and `angular` are the light probe images of P. Debevec (SIGGRAPH 1998): a mirrored
//! ball seen from far away, and the disk whose radius is proportional to the angle. `cubeMapVerticalCross` has three columns
//! and four rows of faces: up, then left, front, right, then down, then the back, upside down.

use std::f64::consts::PI;

use glam::DVec3;

/// How directions map to an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Latitude and longitude.
    Latlong,
    /// A mirrored ball.
    MirroredBall,
    /// Radius proportional to the angle from the middle.
    Angular,
    /// The faces of a cube.
    VerticalCross,
}

impl Layout {
    /// By the name of UsdLux; `Some(None)` for `automatic`.
    pub fn from_token(token: &str) -> Option<Option<Self>> {
        Some(match token {
            "automatic" => None,
            "latlong" => Some(Self::Latlong),
            "mirroredBall" => Some(Self::MirroredBall),
            "angular" => Some(Self::Angular),
            "cubeMapVerticalCross" => Some(Self::VerticalCross),
            _ => return None,
        })
    }

    /// What an image of that many pixels is where nothing says it: a cross if it is 3 : 4, else latitude and longitude.
    pub fn of_image(width: u32, height: u32) -> Self {
        if width > 0 && 4 * u64::from(width) == 3 * u64::from(height) { Self::VerticalCross } else { Self::Latlong }
    }

    /// Image coordinates of the unit vector `d`, within 0..=1.
    pub fn image_coordinates(self, d: DVec3) -> [f64; 2] {
        let [s, t] = match self {
            Self::Latlong => [0.5 - libm::atan2(d.x, d.z) / (2.0 * PI), libm::acos(d.y.clamp(-1.0, 1.0)) / PI],
            // On the ball's image, the radius is the sine of half the angle to the middle.
            Self::MirroredBall => disk(d, |angle| libm::sin(0.5 * angle)),
            Self::Angular => disk(d, |angle| angle / PI),
            Self::VerticalCross => cross(d),
        };
        [s.clamp(0.0, 1.0), t.clamp(0.0, 1.0)]
    }
}

/// On a disk that fills the image, at a radius in 0..=1 by the angle to +z.
fn disk(d: DVec3, radius: impl Fn(f64) -> f64) -> [f64; 2] {
    let sine = libm::hypot(d.x, d.y);
    let r = radius(libm::atan2(sine, d.z));
    let (x, y) = if sine > 0.0 { (d.x / sine, d.y / sine) } else { (0.0, 1.0) };
    [0.5 * (1.0 - r * x), 0.5 * (1.0 - r * y)]
}

/// On the face of the cube that `d` goes through.
fn cross(d: DVec3) -> [f64; 2] {
    let (x, y, z) = (d.x.abs(), d.y.abs(), d.z.abs());
    // Column, row, and −1..=1 to the right and down within the face.
    let (column, row, right, down) = if y >= x && y >= z {
        if d.y > 0.0 { (1.0, 0.0, -d.x / y, d.z / y) } else { (1.0, 2.0, -d.x / y, -d.z / y) }
    } else if x >= z {
        if d.x > 0.0 { (0.0, 1.0, d.z / x, -d.y / x) } else { (2.0, 1.0, -d.z / x, -d.y / x) }
    } else if d.z > 0.0 {
        (1.0, 1.0, -d.x / z, -d.y / z)
    } else {
        (1.0, 3.0, -d.x / z, d.y / z)
    };
    [(column + 0.5 * (1.0 + right)) / 3.0, (row + 0.5 * (1.0 + down)) / 4.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUTS: [Layout; 4] = [Layout::Latlong, Layout::MirroredBall, Layout::Angular, Layout::VerticalCross];

    fn near(found: [f64; 2], expected: [f64; 2]) -> bool {
        (found[0] - expected[0]).abs() < 1e-12 && (found[1] - expected[1]).abs() < 1e-12
    }

    /// The sentences of the OpenEXR documentation.
    #[test]
    fn latitude_and_longitude_are_openexrs() {
        let at = |d: DVec3| Layout::Latlong.image_coordinates(d.normalize());
        assert!(near(at(DVec3::Z), [0.5, 0.5]));
        assert!(near(at(DVec3::X), [0.25, 0.5]));
        assert!(near(at(-DVec3::X), [0.75, 0.5]));
        assert!(near(at(DVec3::new(1e-9, 0.0, -1.0)), [0.0, 0.5]) || at(DVec3::new(1e-9, 0.0, -1.0))[0] < 1e-8);
        assert!(at(DVec3::Y)[1].abs() < 1e-12 && (at(-DVec3::Y)[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn all_layouts_agree_on_what_is_right_and_what_is_up() {
        for layout in LAYOUTS {
            let centre = layout.image_coordinates(DVec3::Z);
            let right = layout.image_coordinates(DVec3::new(-0.1, 0.0, 1.0).normalize());
            let up = layout.image_coordinates(DVec3::new(0.0, 0.1, 1.0).normalize());
            assert!(right[0] > centre[0] && (right[1] - centre[1]).abs() < 1e-12, "{layout:?}");
            assert!(up[1] < centre[1] && (up[0] - centre[0]).abs() < 1e-12, "{layout:?}");
        }
    }

    #[test]
    fn the_horizon_of_a_probe_is_where_the_definition_says() {
        let x = -DVec3::X;
        assert!(near(Layout::Angular.image_coordinates(x), [0.75, 0.5]));
        assert!(near(Layout::MirroredBall.image_coordinates(x), [0.5 + 0.5 * 0.5f64.sqrt(), 0.5]));
        for layout in [Layout::Angular, Layout::MirroredBall] {
            let [s, t] = layout.image_coordinates(-DVec3::Z);
            assert!((libm::hypot(s - 0.5, t - 0.5) - 0.5).abs() < 1e-12, "{layout:?}: the back is the rim");
        }
    }

    /// Across every edge of the cube that is whole in the cross, the image does not jump.
    #[test]
    fn faces_of_a_cross_join() {
        let edges = [
            (DVec3::new(-1.0, 0.3, 1.0), DVec3::X),
            (DVec3::new(1.0, 0.3, 1.0), DVec3::X),
            (DVec3::new(0.3, 1.0, 1.0), DVec3::Y),
            (DVec3::new(0.3, -1.0, 1.0), DVec3::Y),
            (DVec3::new(0.3, -1.0, -1.0), DVec3::Y),
        ];
        for (edge, across) in edges {
            let [a, b] =
                [1e-9, -1e-9].map(|e| Layout::VerticalCross.image_coordinates((edge + e * across).normalize()));
            assert!((a[0] - b[0]).abs() < 1e-8 && (a[1] - b[1]).abs() < 1e-8, "{edge}: {a:?}, {b:?}");
        }
        assert!(near(Layout::VerticalCross.image_coordinates(DVec3::Y), [0.5, 0.125]));
        assert!(near(Layout::VerticalCross.image_coordinates(DVec3::X), [1.0 / 6.0, 0.375]));
        assert!(near(Layout::VerticalCross.image_coordinates(-DVec3::Z), [0.5, 0.875]));
    }

    #[test]
    fn names_are_usds() {
        assert_eq!(Layout::from_token("automatic"), Some(None));
        assert_eq!(Layout::from_token("angular"), Some(Some(Layout::Angular)));
        assert_eq!(Layout::from_token("octahedral"), None);
        assert_eq!(Layout::of_image(1024, 512), Layout::Latlong);
        assert_eq!(Layout::of_image(768, 1024), Layout::VerticalCross);
        assert_eq!(Layout::of_image(0, 0), Layout::Latlong);
    }
}
