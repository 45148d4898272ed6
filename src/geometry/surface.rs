//! The surface around a hit, in render space: point, normals, curvature (MATH.md 2.4).

use glam::{DMat3, DVec3};

use super::mesh::Mesh;
use super::placed::Placed;
use super::solid::{Bend, Solid};
use super::sphere::Sphere;
use super::{Hit, Ray, Shape};
use crate::ray::{Curvature, LocalSurface, NormalField, UnitNormals};

/// Below this share of the corner normals an interpolated one is nothing but their f32 rounding: sixteen of its steps.
const VANISHING: f64 = 16.0 / 16_777_216.0;

/// A triangle at a hit.
struct Facet {
    /// In object space.
    corners: [DVec3; 3],
    point: DVec3,
    n_g: DVec3,
    /// What its corners' normals say, if they say something.
    smooth: Option<Interpolated>,
}

/// Corner normals, interpolated.
struct Interpolated {
    vector: DVec3,
    /// Its derivatives by the weights of the second and the third corner.
    along: [DVec3; 2],
}

impl Placed<'_> {
    pub(super) fn local_surface(&self, ray: &Ray, hit: &Hit) -> (DVec3, LocalSurface) {
        match self.shape {
            Shape::Mesh(mesh) => self.facet(mesh, hit),
            Shape::Sphere(sphere) => self.ellipsoid(*sphere, ray, hit),
            Shape::Solid(solid) => self.piece(solid, ray, hit),
        }
    }

    /// The point of [`local_surface`](Self::local_surface) and the normals alone, bit by bit.
    #[inline]
    pub(super) fn normals(&self, ray: &Ray, hit: &Hit) -> (DVec3, UnitNormals) {
        match self.shape {
            Shape::Mesh(mesh) => {
                let Facet { point, n_g, smooth, .. } = self.facet_at(mesh, hit);
                (point, UnitNormals { n_g, n_s: smooth.map_or(n_g, |smooth| smooth.vector.normalize()) })
            }
            Shape::Sphere(sphere) => {
                let (_, point, n_g) = self.ball_at(*sphere, ray, hit);
                (point, UnitNormals { n_g, n_s: n_g })
            }
            Shape::Solid(solid) => {
                let (point, surface) = self.piece(solid, ray, hit);
                (point, surface.normals())
            }
        }
    }

    /// The point is the combination of corners, which lies in the plane to rounding however far the ray came.
    #[inline(always)]
    fn facet_at(&self, mesh: &Mesh, hit: &Hit) -> Facet {
        let corners = mesh.corners(hit.primitive, self.time);
        let [a, b, c] = corners.map(|p| self.point(p));
        let [v, w] = hit.barycentric;
        let point = (1.0 - v - w) * a + v * b + w * c;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let n_g = self.covector(normal).normalize();
        let smooth = mesh.normals(hit.primitive, self.time).and_then(|normals| {
            let [s0, s1, s2] = normals.map(|n| self.covector(n));
            let along = [s1 - s0, s2 - s0];
            let vector = s0 + v * along[0] + w * along[1];
            let largest = s0.length().max(s1.length()).max(s2.length());
            let is_normal = vector.length() > VANISHING * largest && vector.dot(n_g) > 0.0;
            is_normal.then_some(Interpolated { vector, along })
        });
        Facet { corners, point, n_g, smooth }
    }

    fn facet(&self, mesh: &Mesh, hit: &Hit) -> (DVec3, LocalSurface) {
        let Facet { corners, point, n_g, smooth } = self.facet_at(mesh, hit);
        // Written where it is returned: it is long.
        let surface = |n_s, field| (point, LocalSurface { n_g, n_s, curvature: Curvature::Plane, field });
        let Some(Interpolated { vector, along: [d1, d2] }) = smooth else { return surface(n_g, NormalField::Flat) };
        let n_s = vector.normalize();
        if d1 == DVec3::ZERO && d2 == DVec3::ZERO {
            return surface(n_s, NormalField::Flat);
        }
        // Edges from object space: there they are exact, while corners far from render space's zero are rounded.
        let (e1, e2) = (self.linear * (corners[1] - corners[0]), self.linear * (corners[2] - corners[0]));
        let m = e1.cross(e2);
        // ∇β1 and ∇β2, so that β1(q − a) = ∇β1·(q − a).
        let (g1, g2) = (e2.cross(m) / m.length_squared(), m.cross(e1) / m.length_squared());
        let gradient = outer(d1, g1) + outer(d2, g2);
        surface(n_s, NormalField::Linear { vector, gradient })
    }

    /// ∂p/∂u and ∂p/∂v of the texture coordinates; `None` where there are none.
    pub(super) fn tangents(&self, hit: &Hit) -> Option<[DVec3; 2]> {
        let Shape::Mesh(mesh) = self.shape else { return None };
        let [a, b, c] = mesh.corners(hit.primitive, self.time);
        mesh.tangents(hit.primitive, [self.linear * (b - a), self.linear * (c - a)])
    }

    /// The point in object space and in render space, and the normal there.
    #[inline(always)]
    fn ball_at(&self, sphere: Sphere, ray: &Ray, hit: &Hit) -> (DVec3, DVec3, DVec3) {
        let object = self.ray(ray);
        let p = sphere.project(object.origin + hit.distance * object.stretch * object.direction);
        (p, self.point(p), self.covector(p).normalize())
    }

    fn ellipsoid(&self, sphere: Sphere, ray: &Ray, hit: &Hit) -> (DVec3, LocalSurface) {
        let (p, point, n_g) = self.ball_at(sphere, ray, hit);
        let surface = match self.similarity {
            Some(scale) => {
                let inv_radius = 1.0 / (scale * sphere.radius());
                LocalSurface {
                    n_g,
                    n_s: n_g,
                    curvature: Curvature::Sphere { inv_radius },
                    field: NormalField::Sphere { inv_radius },
                }
            }
            None => {
                // f = ½ (|L⁻¹(q − c)|² − r²): ∇f = L⁻ᵀ L⁻¹ (q − c), H = L⁻ᵀ L⁻¹.
                let hessian = self.inverse.transpose() * self.inverse;
                let vector = self.covector(p);
                LocalSurface {
                    n_g,
                    n_s: n_g,
                    curvature: Curvature::Quadric { hessian: hessian * vector.length().recip() },
                    field: NormalField::Linear { vector, gradient: hessian },
                }
            }
        };
        (point, surface)
    }

    fn piece(&self, solid: &Solid, ray: &Ray, hit: &Hit) -> (DVec3, LocalSurface) {
        let object = self.ray(ray);
        let p = solid.project(hit.primitive, object.origin + hit.distance * object.stretch * object.direction);
        let point = self.point(p);
        let piece = solid.piece(hit.primitive, p);
        let vector = self.covector(piece.gradient);
        let length = vector.length();
        if length == 0.0 {
            let n_g = self.covector(solid.tip_normal(hit.primitive)).normalize();
            return (point, LocalSurface { n_g, n_s: n_g, curvature: Curvature::Plane, field: NormalField::Flat });
        }
        let n_g = vector / length;
        let quadric = |hessian: DMat3| {
            // F(L⁻¹(q − t)) has the gradient L⁻ᵀ ∇F and the Hessian L⁻ᵀ H L⁻¹.
            let gradient = self.inverse.transpose() * hessian * self.inverse;
            (Curvature::Quadric { hessian: gradient * length.recip() }, NormalField::Linear { vector, gradient })
        };
        let (curvature, field) = match (piece.bend, self.similarity) {
            (Bend::Plane, _) => (Curvature::Plane, NormalField::Flat),
            (Bend::Sphere(s), Some(scale)) => {
                let inv_radius = s / (scale * piece.gradient.length());
                (Curvature::Sphere { inv_radius }, NormalField::Sphere { inv_radius })
            }
            (Bend::Sphere(s), None) => quadric(DMat3::from_diagonal(DVec3::splat(s))),
            (Bend::Quadric(hessian), _) => quadric(hessian),
            (Bend::Revolved { radial, around, second, third }, _) => {
                let (radial, around) = (self.covector(radial), self.covector(around));
                let gradient = outer(radial * second[0], radial) + outer(around * second[1], around);
                let field = NormalField::Revolved { vector, radial, around, second, third };
                (Curvature::Quadric { hessian: gradient * length.recip() }, field)
            }
        };
        (point, LocalSurface { n_g, n_s: n_g, curvature, field })
    }
}

/// u vᵀ.
fn outer(u: DVec3, v: DVec3) -> DMat3 {
    DMat3::from_cols(u * v.x, u * v.y, u * v.z)
}
