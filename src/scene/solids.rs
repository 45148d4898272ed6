//! Analytic solids from their descriptions: sizes are checked, and what has none is left out.

use super::description::{Lens, LensFace, Shape};
use crate::error::{Error, Result};
use crate::geometry::{Axis, Cap, Cuboid, Rectangle, Revolved, Solid};
use glam::DVec3;

/// The solid of a description; `None` if a size is 0, so that there is nothing to see. Not for spheres and meshes.
pub(super) fn compile(shape: &Shape) -> Result<Option<Solid>> {
    if let Shape::Lens(lens) = shape {
        return compile_lens(lens).map(Some);
    }
    let (path, sizes) = sizes(shape);
    for &(name, size) in &sizes {
        if !(size >= 0.0 && size.is_finite()) {
            return Err(Error::scene(
                format!("{path}.{name}"),
                format!("is {size}: it must be finite and not negative"),
            ));
        }
    }
    if is_empty(shape) {
        return Ok(None);
    }
    let axis = |token: &str| {
        Axis::from_token(token)
            .ok_or_else(|| Error::scene(format!("{path}.axis"), format!("is '{token}': it must be X, Y or Z")))
    };
    let solid = match *shape {
        Shape::Cube { size, .. } => Cuboid::new(DVec3::splat(size)).map(Solid::Cuboid),
        Shape::Plane { width, length, axis: ref token, .. } => {
            Rectangle::new(width, length, axis(token)?).map(Solid::Rectangle)
        }
        Shape::Cylinder { height, radius_bottom, radius_top, axis: ref token, .. } => {
            Revolved::cylinder(height, radius_bottom, radius_top, axis(token)?).map(Solid::Revolved)
        }
        Shape::Cone { height, radius, axis: ref token, .. } => {
            Revolved::cylinder(height, radius, 0.0, axis(token)?).map(Solid::Revolved)
        }
        Shape::Capsule { height, radius_bottom, radius_top, axis: ref token, .. } => {
            Revolved::capsule(height, radius_bottom, radius_top, axis(token)?).map(Solid::Revolved)
        }
        Shape::Sphere { .. } | Shape::Lens(_) | Shape::Mesh(_) => None,
    };
    let listed = || sizes.iter().map(|(name, size)| format!("{name} {size}")).collect::<Vec<_>>().join(", ");
    solid.map(Some).ok_or_else(|| Error::scene(path, format!("{}: there is no such solid in doubles", listed())))
}

fn compile_lens(lens: &Lens) -> Result<Solid> {
    let cap = |face: &LensFace| Cap {
        curvature: face.curvature,
        conic: face.conic,
        aspheres: face.aspheres.clone(),
        semi_diameter: face.semi_diameter,
    };
    let edge = lens.edge_radius.unwrap_or(lens.front.semi_diameter.max(lens.back.semi_diameter));
    Revolved::lens(&cap(&lens.front), &cap(&lens.back), lens.thickness, edge)
        .map(Solid::Revolved)
        .map_err(|problem| Error::scene(&lens.path, format!("is no lens: {problem}")))
}

/// The prim path and the sizes under their USD names.
fn sizes(shape: &Shape) -> (&str, Vec<(&'static str, f64)>) {
    let round = |height: f64, bottom: f64, top: f64| {
        // Prims of the older schemas have one radius.
        let radii = [("radius", bottom), ("radiusBottom", bottom), ("radiusTop", top)];
        let is_one = bottom.to_bits() == top.to_bits();
        std::iter::once(("height", height))
            .chain(if is_one { radii[..1].to_vec() } else { radii[1..].to_vec() })
            .collect()
    };
    match *shape {
        Shape::Cube { ref path, size } => (path, vec![("size", size)]),
        Shape::Plane { ref path, width, length, .. } => (path, vec![("width", width), ("length", length)]),
        Shape::Cone { ref path, height, radius, .. } => (path, vec![("height", height), ("radius", radius)]),
        Shape::Cylinder { ref path, height, radius_bottom, radius_top, .. }
        | Shape::Capsule { ref path, height, radius_bottom, radius_top, .. } => {
            (path, round(height, radius_bottom, radius_top))
        }
        Shape::Sphere { ref path, radius } => (path, vec![("radius", radius)]),
        Shape::Lens(ref lens) => (&lens.path, vec![]),
        Shape::Mesh(ref mesh) => (&mesh.path, vec![]),
    }
}

/// Whether it has no volume, or a plane no area. A capsule without a spine is a ball.
fn is_empty(shape: &Shape) -> bool {
    match *shape {
        Shape::Cube { size, .. } => size <= 0.0,
        Shape::Plane { width, length, .. } => width.min(length) <= 0.0,
        Shape::Cone { height, radius, .. } => height.min(radius) <= 0.0,
        Shape::Cylinder { height, radius_bottom, radius_top, .. } => height.min(radius_bottom.max(radius_top)) <= 0.0,
        Shape::Capsule { radius_bottom, radius_top, .. } => radius_bottom.max(radius_top) <= 0.0,
        Shape::Sphere { .. } | Shape::Lens(_) | Shape::Mesh(_) => false,
    }
}
