//! A piece of a solid of revolution (the side of a cylinder, a cone, the ends of a capsule, the face of a lens), sampled over
//! its area.

use glam::{DAffine3, DMat3, DVec3};

use super::Toward;
use crate::geometry::{OnPiece, Revolved};

/// Steps along the profile and around it for the area of a piece: the first errs with their square, the second is as good
/// as exact.
const STEPS: [u32; 2] = [256, 24];

/// Where a solid of revolution stands.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Rings {
    render_from_object: DAffine3,
    object_from_render: DMat3,
    /// Of unit normals: to vectors along the normals here, with the length of the area here over that there.
    cofactors: DMat3,
}

impl Rings {
    pub(in crate::lighting) fn new(render_from_object: &DAffine3) -> Self {
        let linear = render_from_object.matrix3;
        let object_from_render = linear.inverse();
        // |det| times the inverse transpose: outward stays outward.
        let cofactors = object_from_render.transpose() * linear.determinant().abs();
        Self { render_from_object: *render_from_object, object_from_render, cofactors }
    }
}

/// A piece of it.
#[derive(Clone, Debug)]
pub(in crate::lighting) struct Ring<'a> {
    solid: &'a Revolved,
    primitive: u32,
    rings: &'a Rings,
    is_two_sided: bool,
}

/// A point of a piece in render space: there, unit normal, area per unit of the square.
struct Point {
    at: DVec3,
    normal: DVec3,
    area: f64,
}

impl<'a> Ring<'a> {
    pub(in crate::lighting) fn new(solid: &'a Revolved, primitive: u32, rings: &'a Rings, is_two_sided: bool) -> Self {
        Self { solid, primitive, rings, is_two_sided }
    }

    fn point(&self, place: [f64; 2]) -> Option<Point> {
        let OnPiece { point, normal, area } = self.solid.over_square(self.primitive, place)?;
        let scaled = self.rings.cofactors * normal;
        let stretch = scaled.length();
        let at = self.rings.render_from_object.transform_point3(point);
        Some(Point { at, normal: scaled / stretch, area: area * stretch })
    }

    pub(in crate::lighting) fn area(&self) -> f64 {
        let [along, around] = STEPS;
        let place = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
        let areas =
            (0..along * around).filter_map(|i| self.point([place(i / around, along), place(i % around, around)]));
        areas.map(|point| point.area).sum::<f64>() / f64::from(along * around)
    }

    /// Of the solid's box.
    pub(in crate::lighting) fn box_corners(&self) -> [DVec3; 8] {
        let ends = self.solid.box_ends();
        std::array::from_fn(|i| {
            let corner = DVec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2 & 1].z);
            self.rings.render_from_object.transform_point3(corner)
        })
    }

    pub(in crate::lighting) fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<Toward> {
        let point = self.point(u)?;
        let to = point.at - p;
        let distance = to.length();
        let wi = to / distance;
        let pdf_solid_angle = self.density(&point, wi, distance);
        (pdf_solid_angle > 0.0).then_some(Toward { wi, distance, pdf_solid_angle })
    }

    /// Of the direction `wi`, which meets it at `distance`.
    pub(in crate::lighting) fn pdf(&self, p: DVec3, wi: DVec3, distance: f64) -> f64 {
        let met = p + distance * wi - self.rings.render_from_object.translation;
        let place = self.solid.place_on_square(self.primitive, self.rings.object_from_render * met);
        self.point(place).map_or(0.0, |point| self.density(&point, wi, distance))
    }

    fn density(&self, point: &Point, wi: DVec3, distance: f64) -> f64 {
        let cosine = -wi.dot(point.normal);
        let cosine = if self.is_two_sided { cosine.abs() } else { cosine };
        let density = distance * distance / (cosine * point.area);
        if cosine > 0.0 && density.is_finite() { density } else { 0.0 }
    }
}
