//! What a mesh of the description says beyond its polygons, and what is reported of it.

use super::builder::NamedArrays;
use super::description;
use crate::diagnostics::Diagnostics;
use crate::error::{Error, Result};
use crate::geometry::{BoundaryInterpolation, FaceVaryingInterpolation, MeshReport, Scheme, Subdivision, TriangleRule};

/// How the mesh is subdivided; `counts` are the corners of its faces.
pub(super) fn subdivision<'a>(
    arrays: &NamedArrays<'a>,
    mesh: &'a description::Mesh,
    counts: &[i32],
) -> Result<Option<Subdivision<'a>>> {
    let Some(authored) = &mesh.subdivision else { return Ok(None) };
    let integers = |name: &'a Option<String>| match name {
        Some(name) => arrays.integers(name),
        None => Ok(&[][..]),
    };
    let scheme = token(mesh, "subdivisionScheme", Some(&authored.scheme), "", Scheme::from_token)?;
    Ok(Some(Subdivision {
        scheme,
        level: authored.level.unwrap_or_else(|| Subdivision::default_level(scheme, counts)),
        boundary: token(
            mesh,
            "interpolateBoundary",
            authored.interpolate_boundary.as_deref(),
            "edgeAndCorner",
            BoundaryInterpolation::from_token,
        )?,
        face_varying: token(
            mesh,
            "faceVaryingLinearInterpolation",
            authored.face_varying_linear_interpolation.as_deref(),
            "cornersPlus1",
            FaceVaryingInterpolation::from_token,
        )?,
        triangles: token(
            mesh,
            "triangleSubdivisionRule",
            authored.triangle_subdivision_rule.as_deref(),
            "catmullClark",
            TriangleRule::from_token,
        )?,
        crease_indices: integers(&authored.crease_indices)?,
        crease_lengths: integers(&authored.crease_lengths)?,
        crease_sharpnesses: authored.crease_sharpnesses.as_deref().map(|name| arrays.buffer(name, 1)).transpose()?,
        corner_indices: integers(&authored.corner_indices)?,
        corner_sharpnesses: authored.corner_sharpnesses.as_deref().map(|name| arrays.buffer(name, 1)).transpose()?,
    }))
}

fn token<T>(
    mesh: &description::Mesh,
    attribute: &str,
    authored: Option<&str>,
    default: &str,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<T> {
    let text = authored.unwrap_or(default);
    parse(text).ok_or_else(|| {
        Error::scene(
            format!("{}.{attribute}", mesh.path),
            format!("'{text}' is none of the tokens that USD has for it"),
        )
    })
}

/// Warns of what was left out.
pub(super) fn report(mesh: &description::Mesh, report: &MeshReport, diagnostics: &mut Diagnostics) {
    for problem in &report.problems {
        let place = format!("{}.{}", mesh.path, problem.attribute);
        diagnostics.warn("unusable-attribute", place, problem.problem.as_str());
    }
    if report.faces_in_several_subsets > 0 {
        let problem = format!("{} faces are in several subsets; the first has them", report.faces_in_several_subsets);
        diagnostics.warn("overlapping-subsets", &mesh.path, problem);
    }
    if report.degenerate > 0 {
        diagnostics.warn(
            "degenerate-faces",
            &mesh.path,
            format!("{} triangles without area are left out", report.degenerate),
        );
    }
    if report.triangles == 0 {
        diagnostics.warn("empty-mesh", &mesh.path, "it has no face with an area: nothing of it is seen");
    }
}
