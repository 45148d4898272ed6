//! What can be chosen: a light of the stage at its place in render space, or a piece of an object that shines.

use glam::{DMat3, DVec3};

use super::Patch;
use super::choice::Infinite;
use super::cone::Cone;
use super::dome::Dome;
use super::shape::{Disk, Ellipsoid, Line, Rectangle, Toward, Tube, frame};
use super::tree::LightBounds;
use crate::geometry::Bounds;
use crate::light::{self, Distant, Light, Shape};
use crate::scene::lights::LightImages;
use crate::texture::Lookup;

/// Lookups along a side to guess how bright a rectangle's image is.
const PROBES: u32 = 16;
/// What single precision needs where light goes no further than a cone, radians.
const EDGE: f64 = 1e-3;

/// A light of the stage in render space.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) form: Form,
    /// Greatest weight of its shaping, as far as that is known; 0 if nothing of it is ever seen.
    brightness: f64,
}

/// What it looks like.
#[derive(Debug)]
pub(super) enum Form {
    Rectangle { shape: Rectangle, image: Option<Lookup> },
    Disk(Disk),
    Ellipsoid(Ellipsoid),
    Point(Ellipsoid),
    Tube(Tube),
    Line(Line),
    Distant(Sky),
    Dome(Dome),
}

/// A disk of sky.
#[derive(Debug)]
pub(super) struct Sky {
    pub(super) toward: DVec3,
    half_angle: f64,
    /// 1 − cos of the half angle.
    height: f64,
}

impl Sky {
    fn new(distant: &Distant) -> Self {
        let half_angle = distant.half_angle;
        let sine = libm::sin(0.5 * half_angle);
        Self { toward: distant.toward, half_angle, height: 2.0 * sine * sine }
    }

    /// Light comes from one direction.
    pub(super) fn is_parallel(&self) -> bool {
        self.half_angle <= 0.0
    }

    pub(super) fn pdf(&self) -> f64 {
        1.0 / (2.0 * std::f64::consts::PI * self.height)
    }

    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> Toward {
        let height = u * self.height;
        let (sine, phi) = ((height * (2.0 - height)).max(0.0).sqrt(), 2.0 * std::f64::consts::PI * v);
        let [x, y] = frame(self.toward);
        let wi = sine * (libm::cos(phi) * x + libm::sin(phi) * y) + (1.0 - height) * self.toward;
        Toward { wi: wi.normalize(), distance: f64::INFINITY, pdf_solid_angle: self.pdf() }
    }

    /// Whether a direction is within.
    pub(super) fn contains(&self, direction: DVec3) -> bool {
        // |a − b|² = 2 (1 − cos).
        !self.is_parallel() && (direction - self.toward).length_squared() <= 2.0 * self.height
    }
}

impl Placed {
    /// `None` of geometry, which is placed as objects. `origin` is render space's zero in the world; the mean channel of an
    /// image counts for how bright the light is.
    pub(super) fn new(light: &Light, images: &LightImages, origin: DVec3) -> Option<Self> {
        let lookup = |texture: Option<usize>| texture.and_then(|index| images.lookups[index].as_ref());
        let mut brightness = 1.0;
        let form = match &light.shape {
            Shape::Geometry(_) => return None,
            Shape::Rectangle(patch) => {
                let image = lookup(patch.texture).cloned();
                brightness = image.as_ref().map_or(1.0, |image| mean_of(image, images));
                let shape = Rectangle::new(patch.center - origin, patch.u, patch.v, patch.normal, false);
                Form::Rectangle { shape, image }
            }
            Shape::Disk(patch) => Form::Disk(Disk::new(patch.center - origin, patch.u, patch.v, patch.normal)),
            Shape::Sphere(light::Ellipsoid { center, axes, is_point, .. }) => {
                let ball = Ellipsoid::new(*center - origin, *axes, false);
                if *is_point { Form::Point(ball) } else { Form::Ellipsoid(ball) }
            }
            Shape::Cylinder(tube) => {
                let center = tube.center - origin;
                if tube.is_line {
                    Form::Line(Line::new(center, tube.half_axis, tube.radii))
                } else {
                    Form::Tube(Tube::new(center, tube.half_axis, tube.radii))
                }
            }
            Shape::Distant(distant) => Form::Distant(Sky::new(distant)),
            Shape::Dome(dome) => {
                let dome = Dome::new(dome, lookup(dome.texture), &images.store, origin);
                brightness = dome.mean();
                Form::Dome(dome)
            }
        };
        if let Some(profile) = light.shaping.as_ref().and_then(|shaping| shaping.profile.as_ref()) {
            // Of twice its mean intensity: profiles are brighter where they shine than all around.
            brightness *= 2.0 * profile.factor * profile.profile.mean();
        }
        Some(Self { form, brightness })
    }

    /// Bounds of a light of mean channel `mean`; `None` if it is infinitely far.
    pub(super) fn bounds(&self, light: &Light, mean: f64) -> Option<LightBounds> {
        let around = |center: DVec3, half: DVec3| Bounds { min: center - half, max: center + half };
        let bounds = match &self.form {
            Form::Rectangle { shape, .. } => hull(&shape.corners()),
            Form::Disk(disk) => hull(&disk.corners()),
            Form::Ellipsoid(ball) => around(ball.center(), ball.half_extent()),
            Form::Point(ball) => around(ball.center(), DVec3::ZERO),
            Form::Tube(tube) => around(tube.center(), tube.half_extent()),
            Form::Line(line) => around(line.center(), line.half_extent()),
            Form::Distant(_) | Form::Dome(_) => return None,
        };
        let area = light.shape.area().unwrap_or_default();
        let cone = spot(light);
        let (normals, emission_angle, factor) = match &self.form {
            Form::Rectangle { .. } | Form::Disk(_) => {
                let normal = match &light.shape {
                    Shape::Rectangle(patch) | Shape::Disk(patch) => patch.normal,
                    _ => DVec3::Z,
                };
                let angle =
                    cone.map_or(std::f64::consts::FRAC_PI_2, |(_, angle)| angle.min(std::f64::consts::FRAC_PI_2));
                (Cone { axis: normal, angle: 0.0 }, angle, 1.0)
            }
            // As strong in every direction of the cone.
            _ => match cone {
                Some((axis, angle)) => (Cone { axis, angle }, EDGE, 0.25),
                None => (Cone::EVERYTHING, std::f64::consts::FRAC_PI_2, 0.25),
            },
        };
        let intensity = factor * area * mean * self.brightness;
        Some(LightBounds { bounds, normals, emission_angle, is_two_sided: false, intensity })
    }

    /// Of a light that is infinitely far.
    pub(super) fn infinite(&self, light: &Light, mean: f64, emitter: u32) -> Option<Infinite> {
        match (&self.form, &light.shape) {
            (Form::Distant(sky), Shape::Distant(distant)) => Some(Infinite {
                emitter,
                toward: Some((sky.toward, 1.0 - sky.height)),
                irradiance: mean * distant.size_factor(),
            }),
            (Form::Dome(_), _) => {
                Some(Infinite { emitter, toward: None, irradiance: std::f64::consts::PI * mean * self.brightness })
            }
            _ => None,
        }
    }

    /// What covers it as it is seen in the direction `wi`.
    pub(super) fn patch(&self, wi: DVec3) -> Option<Patch> {
        let finite = |center: DVec3, half: [DVec3; 2]| Patch { center, half, is_infinite: false };
        match &self.form {
            Form::Rectangle { shape, .. } => Some(finite(shape.center(), shape.half())),
            Form::Disk(disk) => Some(finite(disk.center(), disk.half())),
            Form::Ellipsoid(ball) => Some(finite(ball.center(), ball.shadow(wi))),
            Form::Distant(sky) => Some(Patch {
                center: sky.toward,
                half: frame(sky.toward).map(|axis| axis * libm::sin(sky.half_angle)),
                is_infinite: true,
            }),
            Form::Tube(_) | Form::Point(_) | Form::Line(_) | Form::Dome(_) => None,
        }
    }

    /// The box of what rays can meet.
    pub(super) fn visible(&self) -> Option<Bounds> {
        let around = |center: DVec3, half: DVec3| Bounds { min: center - half, max: center + half };
        match &self.form {
            Form::Rectangle { shape, .. } => Some(hull(&shape.corners())),
            Form::Disk(disk) => Some(hull(&disk.corners())),
            Form::Ellipsoid(ball) => Some(around(ball.center(), ball.half_extent())),
            Form::Tube(tube) => Some(around(tube.center(), tube.half_extent())),
            Form::Point(_) | Form::Line(_) | Form::Distant(_) | Form::Dome(_) => None,
        }
    }

    /// Distance at which a ray meets the side that shines, and where on a rectangle.
    #[inline]
    pub(super) fn meet(&self, origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
        match &self.form {
            Form::Rectangle { shape, .. } => shape.meet(origin, direction),
            Form::Disk(disk) => disk.meet(origin, direction).map(|distance| (distance, [0.0; 2])),
            Form::Ellipsoid(ball) => ball.meet(origin, direction).map(|distance| (distance, [0.0; 2])),
            Form::Tube(tube) => tube.meet(origin, direction).map(|distance| (distance, [0.0; 2])),
            Form::Point(_) | Form::Line(_) | Form::Distant(_) | Form::Dome(_) => None,
        }
    }
}

/// The box of some points.
pub(super) fn hull(points: &[DVec3]) -> Bounds {
    let of = |&p: &DVec3| Bounds { min: p, max: p };
    points.iter().map(of).fold(Bounds::EMPTY, |all, b| all.union(&b))
}

/// Texture coordinates of a place on a rectangle: its image is readable for whom it shines on.
pub(super) fn texture_coordinates([x, y]: [f64; 2]) -> [f32; 2] {
    [(0.5 - 0.5 * x) as f32, (0.5 + 0.5 * y) as f32]
}

/// The colour of an image, without what is no light.
pub(super) fn looked_up(image: &Lookup, images: &LightImages, uv: [f32; 2]) -> [f64; 3] {
    let [r, g, b, _] = image.at(&images.store, uv).unwrap_or([0.0; 4]);
    [r, g, b].map(|x| if x > 0.0 && x.is_finite() { f64::from(x) } else { 0.0 })
}

fn mean_of(image: &Lookup, images: &LightImages) -> f64 {
    let at = |i: u32| (f64::from(i % PROBES) + 0.5, f64::from(i / PROBES) + 0.5);
    let place = |(x, y): (f64, f64)| [(x / f64::from(PROBES)) as f32, (y / f64::from(PROBES)) as f32];
    let count = PROBES * PROBES;
    let sum: f64 = (0..count).map(|i| looked_up(image, images, place(at(i))).iter().sum::<f64>() / 3.0).sum();
    // What no probe saw may shine all the same.
    (sum / f64::from(count)).max(1e-3)
}

/// The axis and the half angle of a cone of directions beyond which a light's shaping is 0.
fn spot(light: &Light) -> Option<(DVec3, f64)> {
    let angle = light.shaping.as_ref()?.cone_angle;
    let m: DMat3 = light.light_from_world;
    // Only under a similarity is a cone in the light's space one in the world.
    let scale = m.x_axis.length();
    let gram = m.transpose() * m * (1.0 / (scale * scale)) - DMat3::IDENTITY;
    let is_similar = gram.to_cols_array().into_iter().all(|x| x.abs() < 1e-9);
    (is_similar && angle < std::f64::consts::PI).then(|| (-(m.inverse().z_axis).normalize(), angle))
}
