//! The image of a light that a chain of smooth events shows: where on the light a direction from a point leads, to first order.
//!
//! Along a fixed chain the place on the light is a smooth function of the point x from which one looks and of the direction; through
//! flat facets it is nearly affine. A photon takes with it the columns of its ray's Jacobian by its place on the light and by its
//! direction there (`ray/`); where it arrives their inverse is that function's derivative. So one photon knows the whole image of the
//! light, and how it moves and turns as seen from all about: the linearised specular manifold of W. Jakob, S. Marschner, "Manifold
//! exploration", TOG 31(4), 2012, as a lobe of a guide.

use glam::{DMat4, DVec2, DVec3, DVec4, Vec3, Vec4};

use super::state::Way;
use crate::geometry::Ray;
use crate::lighting::Patch;
use crate::optics::IorJet;
use crate::ray::{
    ColumnSet, Curvature, LocalSurface, RayStart, Scattering, ScreenColumns, Transfer, mirror, refract_or_reflect,
};

/// The columns of a photon on its way: by its place on the light, and by its direction there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trail {
    by_place: ScreenColumns,
    by_direction: ScreenColumns,
    /// Of the photon on the patch.
    place: DVec2,
    /// Where it has come to.
    surface: Option<LocalSurface>,
}

/// The image that a photon has seen, where it arrived.
#[derive(Clone, Copy, Debug)]
pub(super) struct Image {
    /// Towards where the photon came from, a unit vector, and two across.
    pub(super) axes: [DVec3; 3],
    /// On the light, −1..1 where it shines.
    place: DVec2,
    /// By how much that changes for a point across, and for the tangent of a direction across.
    by_point: [DVec2; 2],
    by_direction: [DVec2; 2],
}

impl Trail {
    /// Of a photon that begins with `ray` on a light's patch.
    pub(super) fn new(patch: Patch, ray: &Ray) -> Option<Self> {
        let place = patch.coordinates(ray.origin, -ray.direction)?;
        let Ray { origin: point, direction, time } = *ray;
        let frame = direction.any_orthonormal_pair();
        let start = |[point_x, point_y]: [DVec3; 2], [direction_x, direction_y]: [DVec3; 2]| {
            let zero = DVec3::ZERO;
            let start = RayStart {
                point,
                direction,
                point_x,
                point_y,
                direction_x,
                direction_y,
                direction_xx: zero,
                direction_xy: zero,
                direction_yy: zero,
                time,
            };
            ScreenColumns::start(&start, &IorJet::constant(1.0))
        };
        let (nowhere, across) = ([DVec3::ZERO; 2], [frame.0, frame.1]);
        let (by_place, by_direction) = if patch.is_infinite {
            (start(nowhere, patch.half.map(|half| -half)), start(across, nowhere))
        } else {
            (start(patch.half, nowhere), start(nowhere, across))
        };
        Some(Self { by_place, by_direction, place, surface: None })
    }

    /// Goes on to a surface.
    pub(super) fn transfer(&mut self, ray: &Ray, distance: f64, surface: LocalSurface, ior: f64) {
        self.transfer_to(distance, ray.direction, surface.n_g, surface.curvature, ior);
        self.surface = Some(surface);
    }

    /// Refracted at the surface that it has come to, or reflected, into the index `ior_t`; mirrored if that is `None`.
    pub(super) fn turn(&mut self, direction: DVec3, ior_i: f64, ior_t: Option<f64>) {
        let Some(surface) = self.surface else { return };
        let (momentum, ior_i) = (ior_i * direction, IorJet::constant(ior_i));
        self.scatter(&match ior_t {
            Some(ior_t) => refract_or_reflect(momentum, &surface, &ior_i, &IorJet::constant(ior_t)),
            None => mirror(momentum, &surface, &ior_i),
        });
    }

    pub(super) fn transfer_to(&mut self, distance: f64, direction: DVec3, n_g: DVec3, curvature: Curvature, ior: f64) {
        let transfer = Transfer { distance, direction, medium: IorJet::constant(ior), n_g, curvature };
        self.by_place.transfer(&transfer);
        self.by_direction.transfer(&transfer);
    }

    /// Refracted or reflected.
    pub(super) fn scatter(&mut self, scattering: &Scattering) {
        self.by_place.scatter(scattering);
        self.by_direction.scatter(scattering);
    }

    /// What it has seen, arriving in a direction; `None` if that is no plane image: light from all about meets in one point.
    pub(super) fn image(&self, direction: DVec3, ior: f64) -> Option<Image> {
        let (x, y) = direction.any_orthonormal_pair();
        // On the plane across.
        let mut end = *self;
        end.transfer_to(0.0, direction, direction, Curvature::Plane, ior);
        let columns = [end.by_place.screen()?, end.by_direction.screen()?].concat();
        let column = |i: usize| {
            let c = columns[i];
            let (point, turn) = (c.point, c.momentum / ior);
            DVec4::new(x.dot(point), y.dot(point), x.dot(turn), y.dot(turn))
        };
        let arrival = DMat4::from_cols(column(0), column(1), column(2), column(3));
        let inverse = arrival.inverse();
        let rows = |i: usize| DVec2::new(inverse.col(i).x, inverse.col(i).y);
        let image = Image {
            axes: [-direction, x, y],
            place: self.place,
            by_point: [rows(0), rows(1)],
            // A direction back is the opposite.
            by_direction: [-rows(2), -rows(3)],
        };
        let is_finite = [rows(0), rows(1), rows(2), rows(3)].iter().all(|v| v.is_finite());
        (is_finite && image.determinant().abs() > 0.0).then_some(image)
    }
}

impl Image {
    fn determinant(&self) -> f64 {
        let [a, b] = self.by_direction;
        a.perp_dot(b)
    }

    /// Its size on the plane of tangents.
    pub(super) fn size(&self) -> f64 {
        4.0 / self.determinant().abs()
    }

    /// As a lobe of a region, for a photon that arrived at `point`, relative to the region's centre.
    pub(super) fn lobe(&self, point: DVec3) -> ImageLobe {
        let [z, x, y] = self.axes;
        let along = |[a, b]: [DVec2; 2], k: usize| (x * a[k] + y * b[k]).as_vec3();
        let by_point = [0, 1].map(|k| along(self.by_point, k));
        let at_zero = [0, 1].map(|k| {
            let row = x * self.by_point[0][k] + y * self.by_point[1][k];
            (self.place[k] - row.dot(point)) as f32
        });
        let by_direction = [0, 1].map(|k| along(self.by_direction, k));
        let [a, b] = self.by_direction;
        let d = self.determinant();
        // Of the inverse of the matrix with the columns a, b.
        let back = [(x * b.y - y * a.y) / d, (y * a.x - x * b.x) / d].map(|v| v.as_vec3());
        ImageLobe { axis: z.as_vec3(), at_zero, by_point, by_direction, back, density: (d.abs() / 4.0) as f32 }
    }
}

/// An image in a region, relative to its centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageLobe {
    /// The plane of tangents is that of the directions d with d·axis = 1.
    axis: Vec3,
    /// The place on the light is at_zero + by_point·x + by_direction·d.
    at_zero: [f32; 2],
    by_point: [Vec3; 2],
    by_direction: [Vec3; 2],
    /// How d changes with that place.
    back: [Vec3; 2],
    /// On the plane of tangents.
    density: f32,
}

impl ImageLobe {
    /// Along the direction from `at` to a place of the light, each coordinate 0..1.
    pub(super) fn direction(&self, at: Vec3, u: [f32; 2]) -> Vec3 {
        let offset = |k: usize| 2.0 * u[k] - 1.0 - self.at_zero[k] - self.by_point[k].dot(at);
        self.axis + self.back[0] * offset(0) + self.back[1] * offset(1)
    }
}

/// Four of them, lane by lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageLobes {
    axis: [Vec4; 3],
    at_zero: [Vec4; 2],
    by_point: [[Vec4; 3]; 2],
    by_direction: [[Vec4; 3]; 2],
    ways: Vec4,
    density: Vec4,
}

fn dot([x, y, z]: [Vec4; 3], v: Vec3) -> Vec4 {
    x * v.x + y * v.y + z * v.z
}

impl ImageLobes {
    /// With their ways and shares, up to four; further lanes have no density.
    pub(super) fn new(lobes: &[(ImageLobe, Way, f32)]) -> Self {
        let lanes = |of: &dyn Fn(&ImageLobe, f32) -> f32| {
            Vec4::from_array(std::array::from_fn(|i| lobes.get(i).map_or(0.0, |l| of(&l.0, l.2))))
        };
        let vector = |of: &dyn Fn(&ImageLobe) -> Vec3| [0, 1, 2].map(|axis| lanes(&|l, _| of(l)[axis]));
        Self {
            axis: vector(&|l| l.axis),
            at_zero: [0, 1].map(|k| lanes(&|l, _| l.at_zero[k])),
            by_point: [0, 1].map(|k| vector(&|l| l.by_point[k])),
            by_direction: [0, 1].map(|k| vector(&|l| l.by_direction[k])),
            ways: Vec4::from_array(std::array::from_fn(|i| lobes.get(i).map_or(0.0, |(_, way, _)| way.number()))),
            density: lanes(&|l, share| share * l.density),
        }
    }

    /// Densities per solid angle of a direction from `at` by the way with a number.
    #[inline]
    pub(super) fn pdf(&self, at: Vec3, direction: Vec3, way: Vec4) -> Vec4 {
        let along = dot(self.axis, direction);
        let inverse = along.recip();
        let within = |k: usize| {
            let place = self.at_zero[k] + dot(self.by_point[k], at) + dot(self.by_direction[k], direction) * inverse;
            place.abs().cmple(Vec4::ONE)
        };
        let is_in = self.ways.cmpeq(way) & within(0) & within(1) & along.cmpgt(Vec4::ZERO);
        Vec4::select(is_in, self.density * inverse * inverse * inverse, Vec4::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::NormalField;

    const IOR: f64 = 1.5;

    /// A prism's faces, each a point and a normal: the way from the lamp above goes in at the first, out at the second.
    fn faces() -> [(DVec3, DVec3); 2] {
        [(DVec3::Y * 2.0, DVec3::new(0.2, 1.0, 0.1).normalize()), (DVec3::Y, DVec3::new(0.1, -1.0, 0.3).normalize())]
    }

    fn surface(normal: DVec3) -> LocalSurface {
        LocalSurface { n_g: normal, n_s: normal, curvature: Curvature::Plane, field: NormalField::Flat }
    }

    /// Where a ray through the prism, one way or the other, is at a height, and its direction there.
    fn through(
        mut point: DVec3,
        mut direction: DVec3,
        faces: [(DVec3, DVec3); 2],
        height: f64,
        trail: &mut Option<Trail>,
    ) -> [DVec3; 2] {
        let mut iors = [1.0, IOR];
        let end = (DVec3::Y * height, DVec3::Y);
        for (index, (on, normal)) in [faces[0], faces[1], end].into_iter().enumerate() {
            let distance = (on - point).dot(normal) / direction.dot(normal);
            point += distance * direction;
            if let Some(trail) = trail {
                trail.transfer_to(distance, direction, normal, Curvature::Plane, iors[0]);
            }
            if index < 2 {
                let jets = iors.map(IorJet::constant);
                let scattering = refract_or_reflect(iors[0] * direction, &surface(normal), &jets[0], &jets[1]);
                if let Some(trail) = trail {
                    trail.scatter(&scattering);
                }
                direction = (scattering.momentum_out / iors[1]).normalize();
                iors.reverse();
            }
        }
        [point, direction]
    }

    #[test]
    fn looks_through_a_prism_reach_the_lamp_with_an_error_of_second_order() {
        let [first, second] = faces();
        let error = |size: f64| {
            let (center, half) = (DVec3::Y * 4.0, [DVec3::X * size, DVec3::Z * size]);
            let (place, direction) = (DVec2::new(0.3, -0.2), DVec3::new(0.1, -1.0, 0.05).normalize());
            let origin = center + place.x * half[0] + place.y * half[1];
            let patch = Patch { center, half, is_infinite: false };
            let mut trail = Trail::new(patch, &Ray { origin, direction, time: 0.0 });
            let [arrived, direction] = through(origin, direction, [first, second], 0.0, &mut trail);
            let lobe = trail.unwrap().image(direction, 1.0).unwrap().lobe(DVec3::ZERO);
            // From beside where the photon arrived.
            let beside = DVec3::new(0.7, 0.0, -0.4) * size;
            [[0.1f32, 0.9], [0.8, 0.4]].map(|u| {
                let toward = lobe.direction(beside.as_vec3(), u).as_dvec3().normalize();
                let [at, _] = through(arrived + beside, toward, [second, first], 4.0, &mut None);
                let wanted = u.map(|u| 2.0 * f64::from(u) - 1.0);
                (patch.coordinates(at, DVec3::Y).unwrap() - DVec2::from(wanted)).length()
            })
        };
        // In units of the lamp's size, of which the second order leaves one.
        let [large, small] = [0.1, 0.01].map(error);
        for (large, small) in large.into_iter().zip(small) {
            assert!(large < 0.5 && small < 0.15 * large && small > 0.0, "{large} {small}");
        }
    }

    #[test]
    fn the_density_of_an_image_is_that_of_its_directions() {
        let patch = Patch { center: DVec3::Y, half: [DVec3::X * 0.2, DVec3::new(0.1, 0.0, 0.3)], is_infinite: false };
        // Straight up the place on the lamp goes with the tangent.
        let (origin, at) = (DVec3::new(0.1, 1.0, 0.1), DVec3::new(0.1, 0.0, 0.1));
        let direction = (at - origin).normalize();
        let mut trail = Trail::new(patch, &Ray { origin, direction, time: 0.0 }).unwrap();
        trail.transfer_to((at - origin).length(), direction, DVec3::Y, Curvature::Plane, 1.0);
        let lobe = trail.image(direction, 1.0).unwrap().lobe(DVec3::ZERO);
        let lobes = ImageLobes::new(&[(lobe, Way::START, 0.5)]);
        let here = DVec3::new(0.2, 0.0, 0.0);
        let toward = lobe.direction(here.as_vec3(), [0.3, 0.6]).normalize();
        // Even on the lamp: distance² over area and cosine.
        let distance = 1.0 / f64::from(toward.y);
        let expected = 0.5 * distance * distance * distance / patch.half[0].cross(patch.half[1]).length() / 4.0;
        let pdf = lobes.pdf(here.as_vec3(), toward, Vec4::splat(Way::START.number()));
        assert!((f64::from(pdf.x) / expected - 1.0).abs() < 1e-5 && pdf.y == 0.0, "{pdf} {expected}");
        let other = lobes.pdf(here.as_vec3(), toward, Vec4::splat(Way::START.then(true).number()));
        let beside = lobes.pdf(here.as_vec3(), Vec3::new(0.9, 0.4, 0.0), Vec4::splat(Way::START.number()));
        assert_eq!([other, beside], [Vec4::ZERO; 2]);
    }

    #[test]
    fn the_sky_has_images_too() {
        let sky = DVec3::new(0.3, 1.0, -0.2).normalize();
        let (x, y) = sky.any_orthonormal_pair();
        let patch = Patch { center: sky, half: [x * 0.01, y * 0.01], is_infinite: true };
        let wi = (sky + 0.5 * patch.half[0]).normalize();
        let mut trail = Trail::new(patch, &Ray { origin: wi * 100.0, direction: -wi, time: 0.0 }).unwrap();
        trail.transfer_to(100.0, -wi, DVec3::Y, Curvature::Plane, 1.0);
        let lobe = trail.image(-wi, 1.0).unwrap().lobe(DVec3::ZERO);
        for point in [Vec3::ZERO, Vec3::new(5.0, 0.0, 3.0)] {
            let toward = lobe.direction(point, [0.0, 1.0]).as_dvec3().normalize();
            let expected = (sky - patch.half[0] + patch.half[1]).normalize();
            assert!((toward - expected).length() < 1e-4, "{toward} {expected}");
        }
    }
}
