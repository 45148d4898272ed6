//! Where light comes from: lights as surfaces in the stage's world, with their exact areas under any affine transform.
//!
//! What `normalize` divides by is the area in the world, scales and shears included. Of a unit sphere and of a cylinder's
//! side these are complete elliptic integrals, taken from Carlson's symmetric R_G (B. C. Carlson, "Numerical computation of
//! real or complex elliptic integrals", Numerical Algorithms 10, 1995; NIST DLMF §19.16, §19.33).
//!
//! A surface seen from far away in direction d sends radiance times [`projected_area`](Shape::projected_area)(d): that is
//! also the radiant intensity of a sphere that may be treated as a point, and of a cylinder treated as a line.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3};

use super::environment::Layout;

/// What shines, in the stage's world.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Light from a disk of sky.
    Distant(Distant),
    /// Light from everywhere.
    Dome(Dome),
    /// A parallelogram.
    Rectangle(Patch),
    /// An ellipse.
    Disk(Patch),
    /// An ellipsoid.
    Sphere(Ellipsoid),
    /// The side of a cylinder with an elliptic section.
    Cylinder(Tube),
    /// Placed geometry.
    Geometry(Geometry),
}

/// Light from a cone of directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Distant {
    /// Unit vector to the middle of the source: the light's +z.
    pub toward: DVec3,
    /// Of the cone, radians; 0 for parallel light, whose irradiance at normal incidence is then the emission itself.
    pub half_angle: f64,
}

impl Distant {
    /// What `normalize` divides by: ∫ |cos| dω over the cone, 1 for parallel light (UsdLux, `inputs:normalize`).
    pub fn size_factor(&self) -> f64 {
        if self.half_angle <= 0.0 {
            return 1.0;
        }
        let sine = libm::sin(self.half_angle);
        PI * if self.half_angle <= PI / 2.0 { sine * sine } else { 2.0 - sine * sine }
    }
}

/// Light from everywhere.
#[derive(Clone, Debug)]
pub struct Dome {
    /// The environment's space (upper pole +y, centre of the image +z) from the stage's world; directions only.
    pub environment_from_world: DMat3,
    /// What it looks like: index into the description's textures; white if absent.
    pub texture: Option<usize>,
    /// How directions map to the image; `None`: by the image's [aspect](Layout::of_image).
    pub layout: Option<Layout>,
    /// Openings through which it is seen, as hints for sampling; everywhere if there are none.
    pub portals: Vec<Patch>,
}

/// A flat surface that shines to one side: of a rectangle or an ellipse.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Its middle.
    pub center: DVec3,
    /// From the middle along the light's +x to the edge.
    pub u: DVec3,
    /// From the middle along the light's +y to the edge.
    pub v: DVec3,
    /// Unit vector to the side that shines: the light's −z.
    pub normal: DVec3,
    /// Its area.
    pub area: f64,
    /// What it looks like: index into the description's textures; white if absent. Image coordinates are ½ − x/width from
    /// the left and ½ − y/height from the top, so that the image stands upright and readable for whom it shines on.
    pub texture: Option<usize>,
}

impl Patch {
    /// A rectangle of `width` by `height` in the light's space.
    pub fn rectangle(world_from_light: &DAffine3, width: f64, height: f64) -> Self {
        let (u, v) = (0.5 * width * world_from_light.matrix3.x_axis, 0.5 * height * world_from_light.matrix3.y_axis);
        Self::new(world_from_light, u, v, 4.0)
    }

    /// A disk of `radius` in the light's space.
    pub fn disk(world_from_light: &DAffine3, radius: f64) -> Self {
        let (u, v) = (radius * world_from_light.matrix3.x_axis, radius * world_from_light.matrix3.y_axis);
        Self::new(world_from_light, u, v, PI)
    }

    fn new(world_from_light: &DAffine3, u: DVec3, v: DVec3, area_of_unit: f64) -> Self {
        let matrix = world_from_light.matrix3;
        // x × y in the world points along the image of the normal z, or against it where the transform mirrors.
        let across = matrix.x_axis.cross(matrix.y_axis).normalize();
        let normal = if matrix.determinant() > 0.0 { -across } else { across };
        let area = area_of_unit * u.cross(v).length();
        Self { center: world_from_light.translation, u, v, normal, area, texture: None }
    }
}

/// A sphere under an affine transform, shining outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Its middle.
    pub center: DVec3,
    /// Images of the radii along x, y and z.
    pub axes: DMat3,
    /// Of its surface.
    pub area: f64,
    /// It is a point with the radiant intensity of this surface, radiance times projected area in each direction.
    pub is_point: bool,
}

impl Ellipsoid {
    /// A sphere of `radius` in the light's space.
    pub fn new(world_from_light: &DAffine3, radius: f64, is_point: bool) -> Self {
        let axes = radius * world_from_light.matrix3;
        // dA = |C n| dω with the cofactor matrix C of the axes; squared, a quadratic form in n.
        let cofactors = DMat3::from_cols(
            axes.y_axis.cross(axes.z_axis),
            axes.z_axis.cross(axes.x_axis),
            axes.x_axis.cross(axes.y_axis),
        );
        let [x, y, z] = eigenvalues(&(cofactors.transpose() * cofactors));
        Self { center: world_from_light.translation, axes, area: 4.0 * PI * carlson_rg(x, y, z), is_point }
    }
}

/// The side of a cylinder under an affine transform, shining outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Tube {
    /// Its middle.
    pub center: DVec3,
    /// From the middle along the light's +x to an end.
    pub half_axis: DVec3,
    /// Images of the radii along y and z.
    pub radii: [DVec3; 2],
    /// Of the side; the ends do not shine.
    pub area: f64,
    /// It is a line along its axis with the radiant intensity of this surface, radiance times projected area.
    pub is_line: bool,
}

impl Tube {
    /// A cylinder of `length` along x and `radius` in the light's space.
    pub fn new(world_from_light: &DAffine3, length: f64, radius: f64, is_line: bool) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = world_from_light.matrix3;
        let half_axis = 0.5 * length * x_axis;
        let radii = [radius * y_axis, radius * z_axis];
        // The side's area is twice the half axis' length times the circumference of the ellipse p cos φ + q sin φ.
        let [p, q] = radii.map(|radius| half_axis.cross(radius));
        let [large, small] = squared_half_axes(p, q);
        let area = 2.0 * 8.0 * carlson_rg(0.0, large, small);
        Self { center: world_from_light.translation, half_axis, radii, area, is_line }
    }
}

/// Geometry that shines. Each placed object with such a prim is a light of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// `prim_id` of the objects, increasing.
    pub prim_ids: Vec<u32>,
    /// The emission is divided by the area of each object in the world.
    pub is_normalized: bool,
    /// What becomes of the material.
    pub material: MaterialSync,
}

/// How the light of geometry and its material go together (`light:materialSyncMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialSync {
    /// What the material emits is multiplied by the light's colour; the other controls of the light apply.
    GlowTintsLight,
    /// Rays that see the surface see what the material emits; as a light it emits what the light says.
    Independent,
    /// There is no material.
    NoResponse,
}

impl Shape {
    /// Area in the world; `None` of what has none, and of geometry, where each object has its own.
    pub fn area(&self) -> Option<f64> {
        match self {
            Self::Rectangle(patch) | Self::Disk(patch) => Some(patch.area),
            Self::Sphere(ellipsoid) => Some(ellipsoid.area),
            Self::Cylinder(tube) => Some(tube.area),
            Self::Distant(_) | Self::Dome(_) | Self::Geometry(_) => None,
        }
    }

    /// ∫ max(0, n · d) dA over the surface for a unit direction of travel `d`; `None` as [`area`](Self::area).
    pub fn projected_area(&self, d: DVec3) -> Option<f64> {
        match self {
            Self::Rectangle(patch) | Self::Disk(patch) => Some(patch.area * patch.normal.dot(d).max(0.0)),
            // The shadow of an ellipsoid: the shadow of the unit sphere along A⁻¹d, π, under the map A.
            Self::Sphere(Ellipsoid { axes, .. }) => Some(PI * axes.determinant().abs() * (axes.inverse() * d).length()),
            // ∫ max(0, P cos φ + Q sin φ) dφ = 2 √(P² + Q²).
            Self::Cylinder(Tube { half_axis, radii, .. }) => {
                let [p, q] = radii.map(|radius| half_axis.cross(radius).dot(d));
                Some(2.0 * 2.0 * libm::hypot(p, q))
            }
            Self::Distant(_) | Self::Dome(_) | Self::Geometry(_) => None,
        }
    }
}

/// Squared half axes of the ellipse p cos φ + q sin φ.
fn squared_half_axes(p: DVec3, q: DVec3) -> [f64; 2] {
    let (pp, qq, pq) = (p.length_squared(), q.length_squared(), p.dot(q));
    let mean = 0.5 * (pp + qq);
    let radius = libm::hypot(0.5 * (pp - qq), pq);
    let large = mean + radius;
    // Their product is |p × q|²: no cancellation for a thin ellipse.
    [large, if large > 0.0 { p.cross(q).length_squared() / large } else { 0.0 }]
}

/// Eigenvalues of a symmetric matrix without negative ones, by Jacobi's rotations.
fn eigenvalues(matrix: &DMat3) -> [f64; 3] {
    // Converges quadratically: five sweeps are enough for doubles, more do no harm.
    const SWEEPS: usize = 12;
    let mut a = matrix.to_cols_array_2d();
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= f64::MIN_POSITIVE {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + libm::hypot(theta, 1.0));
            let c = 1.0 / libm::hypot(t, 1.0);
            let s = t * c;
            let mut rotation = DMat3::IDENTITY.to_cols_array_2d();
            rotation[p][p] = c;
            rotation[q][q] = c;
            rotation[p][q] = -s;
            rotation[q][p] = s;
            let r = DMat3::from_cols_array_2d(&rotation);
            a = (r.transpose() * DMat3::from_cols_array_2d(&a) * r).to_cols_array_2d();
        }
    }
    [a[0][0].max(0.0), a[1][1].max(0.0), a[2][2].max(0.0)]
}

/// R_G(x, y, z) = 1/4π ∫ √(x l² + y m² + z n²) dω over the unit sphere, at most one argument 0.
fn carlson_rg(x: f64, y: f64, z: f64) -> f64 {
    let mut sorted = [x, y, z];
    sorted.sort_by(f64::total_cmp);
    let [small, middle, large] = sorted;
    if large <= 0.0 || middle <= 0.0 {
        // ∫ |l| dω / 4π.
        return 0.5 * large.max(0.0).sqrt();
    }
    // DLMF 19.21.10 with the middle one as z, so that nothing cancels; scaled, so that nothing overflows.
    let (x, y, z) = (small / large, 1.0, middle / large);
    let integral = z * carlson_rf(x, y, z) - (x - z) * (y - z) * carlson_rd(x, y, z) / 3.0 + (x * y / z).sqrt();
    0.5 * integral * large.sqrt()
}

/// Relative error of the series that end the duplication: their first missing term is of the sixth power of this.
const SPREAD: f64 = 1e-3;

/// R_F(x, y, z) by duplication (Carlson 1995, §2).
fn carlson_rf(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    loop {
        let mean = (x + y + z) / 3.0;
        let [dx, dy, dz] = [x, y, z].map(|v| 1.0 - v / mean);
        if dx.abs().max(dy.abs()).max(dz.abs()) < SPREAD {
            let (e2, e3) = (dx * dy - dz * dz, dx * dy * dz);
            return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / mean.sqrt();
        }
        let lambda = (x * y).sqrt() + (y * z).sqrt() + (z * x).sqrt();
        [x, y, z] = [x, y, z].map(|v| 0.25 * (v + lambda));
    }
}

/// R_D(x, y, z) by duplication (Carlson 1995, §2).
fn carlson_rd(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut factor) = (0.0, 1.0);
    loop {
        let mean = (x + y + 3.0 * z) / 5.0;
        let [dx, dy, dz] = [x, y, z].map(|v| 1.0 - v / mean);
        if dx.abs().max(dy.abs()).max(dz.abs()) < SPREAD {
            let (a, b) = (dx * dy, dz * dz);
            let (e2, e3) = (a - 6.0 * b, (3.0 * a - 8.0 * b) * dz);
            let (e4, e5) = (3.0 * (a - b) * b, a * b * dz);
            let series =
                1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0
                    + 3.0 * e5 / 26.0;
            return 3.0 * sum + factor * series / (mean * mean.sqrt());
        }
        let lambda = (x * y).sqrt() + (y * z).sqrt() + (z * x).sqrt();
        sum += factor / (z.sqrt() * (z + lambda));
        factor *= 0.25;
        [x, y, z] = [x, y, z].map(|v| 0.25 * (v + lambda));
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DQuat};

    use super::*;

    fn close(found: f64, expected: f64, relative: f64, what: &str) {
        assert!((found / expected - 1.0).abs() < relative, "{what}: {found} is not {expected}");
    }

    /// Rotated, translated and scaled along x, y, z.
    fn placed(scale: DVec3) -> DAffine3 {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
        DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(3.0, -2.0, 7.0))
    }

    #[test]
    fn areas_of_round_lights_are_those_of_school() {
        let similar = placed(DVec3::splat(2.0));
        let area = |shape: Shape| shape.area().unwrap();
        close(area(Shape::Sphere(Ellipsoid::new(&similar, 0.7, false))), 4.0 * PI * 1.4 * 1.4, 1e-14, "sphere");
        close(area(Shape::Cylinder(Tube::new(&similar, 3.0, 0.7, false))), 2.0 * PI * 1.4 * 6.0, 1e-14, "cylinder");
        close(area(Shape::Disk(Patch::disk(&similar, 0.7))), PI * 1.4 * 1.4, 1e-14, "disk");
        close(area(Shape::Rectangle(Patch::rectangle(&similar, 3.0, 0.7))), 6.0 * 1.4, 1e-14, "rectangle");
    }

    #[test]
    fn areas_of_stretched_lights_are_closed_forms_where_there_are_some() {
        // Spheroids: prolate 2πa²(1 + c/(a e) asin e), e² = 1 − a²/c²; oblate 2πa²(1 + (1 − e²)/e atanh e), e² = 1 − c²/a².
        for ratio in [1.001, 1.5, 4.0, 100.0, 1e5] {
            let prolate = Ellipsoid::new(&placed(DVec3::new(1.0, ratio, 1.0)), 1.0, false).area;
            let e = (1.0 - 1.0 / (ratio * ratio)).sqrt();
            close(prolate, 2.0 * PI * (1.0 + ratio / e * e.asin()), 1e-8, "prolate");
            let oblate = Ellipsoid::new(&placed(DVec3::new(ratio, 1.0, ratio)), 1.0, false).area;
            let expected = 2.0 * PI * ratio * ratio * (1.0 + (1.0 - e * e) / e * e.atanh());
            close(oblate, expected, 1e-8, "oblate");
        }
        // The circumference of an ellipse 2 : 1 is 4 · 2 · E(m = 3/4).
        let tube = Tube::new(&placed(DVec3::new(1.0, 2.0, 1.0)), 5.0, 1.0, false);
        close(tube.area, 5.0 * 4.0 * 2.0 * 1.211_056_027_568_459_5, 1e-14, "elliptic cylinder");
        let disk = Patch::disk(&placed(DVec3::new(2.0, 3.0, 9.0)), 0.5);
        close(disk.area, PI * 1.0 * 1.5, 1e-14, "ellipse");
    }

    /// Shears, mirrors and all: sums over small facets.
    #[test]
    fn areas_and_shadows_agree_with_small_facets() {
        let shear = DMat4::from_cols_array(&[
            1.3, 0.2, -0.4, 0.0, 0.5, -0.9, 0.3, 0.0, -0.2, 0.6, 1.7, 0.0, 1.0, 2.0, 3.0, 1.0,
        ]);
        let place = DAffine3::from_mat4(shear);
        let d = DVec3::new(0.3, -0.8, 0.52).normalize();
        let cofactor = place.matrix3.determinant() * place.matrix3.inverse().transpose();
        // dA n for a unit normal in the light's space; its sign is that of the determinant.
        let facet = |n: DVec3| place.matrix3.determinant().signum() * (cofactor * n);
        let (mut area, mut shadow) = (0.0, 0.0);
        let count = 400;
        for i in 0..count {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            for j in 0..2 * count {
                let phi = PI * (f64::from(j) + 0.5) / f64::from(count);
                let r = (1.0 - z * z).sqrt();
                let facet = facet(DVec3::new(r * phi.cos(), r * phi.sin(), z))
                    * (2.0 / f64::from(count))
                    * (PI / f64::from(count));
                area += facet.length();
                shadow += facet.dot(d).max(0.0);
            }
        }
        let ball = Shape::Sphere(Ellipsoid::new(&place, 1.0, false));
        close(ball.area().unwrap(), area, 1e-5, "ellipsoid");
        close(ball.projected_area(d).unwrap(), shadow, 1e-4, "shadow of an ellipsoid");

        let (mut area, mut shadow) = (0.0, 0.0);
        for j in 0..2 * count {
            let phi = PI * (f64::from(j) + 0.5) / f64::from(count);
            let facet = facet(DVec3::new(0.0, phi.cos(), phi.sin())) * 0.4 * 2.5 * PI / f64::from(count);
            area += facet.length();
            shadow += facet.dot(d).max(0.0);
        }
        let tube = Shape::Cylinder(Tube::new(&place, 2.5, 0.4, false));
        close(tube.area().unwrap(), area, 1e-10, "tube");
        close(tube.projected_area(d).unwrap(), shadow, 1e-4, "shadow of a tube");

        let patch = Patch::rectangle(&place, 2.0, 3.0);
        let flat = 6.0 * facet(-DVec3::Z);
        close(patch.area, flat.length(), 1e-13, "parallelogram");
        assert!((patch.normal - flat.normalize()).length() < 1e-13);
        let shadow = Shape::Rectangle(patch).projected_area(d).unwrap();
        assert!((shadow - flat.dot(d).max(0.0)).abs() < 1e-12);
    }

    #[test]
    fn patches_shine_along_minus_z_also_when_mirrored() {
        assert_eq!(Patch::disk(&DAffine3::IDENTITY, 1.0).normal, -DVec3::Z);
        assert_eq!(Patch::disk(&DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), 1.0).normal, -DVec3::Z);
        assert_eq!(Patch::disk(&DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0)), 1.0).normal, DVec3::Z);
    }

    #[test]
    fn size_of_a_distant_light_is_the_integral_of_the_cosine() {
        let factor = |half_angle| Distant { toward: DVec3::Z, half_angle }.size_factor();
        close(factor(0.0), 1.0, 1e-15, "parallel");
        for half_angle in [0.004_625, 0.3, 1.5, 2.0, 3.0, PI] {
            let steps = 100_000;
            let sum: f64 = (0..steps)
                .map(|i| half_angle * (f64::from(i) + 0.5) / f64::from(steps))
                .map(|theta| 2.0 * PI * theta.sin() * theta.cos().abs() * half_angle / f64::from(steps))
                .sum();
            close(factor(half_angle), sum, 1e-8, "cone");
        }
    }
}
