//! The frame that a BSDF is stated in: normal and tangents at a hit, bent by a normal map and turned as the material says.

use glam::DVec3;

use crate::ray::UnitNormals;

/// Three unit vectors at right angles: right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingFrame {
    /// Along which [`alpha`](crate::bsdf::Parameters::alpha) is the first.
    pub tangent: DVec3,
    /// normal × tangent.
    pub bitangent: DVec3,
    /// On the side of the geometric normal.
    pub normal: DVec3,
}

impl ShadingFrame {
    /// About a surface with these `normals` and the derivatives `tangents` of its point by the texture coordinates, where it has them; the
    /// normal of a map is (along ∂p/∂u, along ∂p/∂v, along the normal), of any length. `turns` turn the tangent
    /// counter-clockwise about the normal, as it is seen from outside.
    pub(in crate::scene) fn new(
        normals: &UnitNormals,
        tangents: Option<[DVec3; 2]>,
        normal_map: Option<[f32; 3]>,
        turns: f32,
    ) -> Self {
        let UnitNormals { n_g, n_s } = *normals;
        let [along_u, along_v] = tangents.unwrap_or_else(|| {
            let u = n_s.any_orthonormal_vector();
            [u, n_s.cross(u)]
        });
        let base = Self::about(n_s, along_u);
        let normal = normal_map.map_or(n_s, |[x, y, z]| {
            // Images that are mirrored on the surface have v on the other side.
            let v = if base.bitangent.dot(along_v) < 0.0 { -base.bitangent } else { base.bitangent };
            let bent = base.tangent * f64::from(x) + v * f64::from(y) + n_s * f64::from(z);
            // What leads under the surface, or nowhere, is no normal of it.
            bent.try_normalize().filter(|bent| bent.dot(n_g) > 0.0).unwrap_or(n_s)
        });
        let frame = Self::about(normal, along_u);
        if turns == 0.0 {
            return frame;
        }
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(turns));
        Self::about(normal, frame.tangent * cos + frame.bitangent * sin)
    }

    /// With a tangent as near to `along` as it can be.
    fn about(normal: DVec3, along: DVec3) -> Self {
        let projected = along - normal * normal.dot(along);
        // What is left of a tangent along the normal is rounding.
        let is_tangent = projected.length_squared() > 1e-20 * along.length_squared();
        let tangent = projected.try_normalize().filter(|_| is_tangent);
        let tangent = tangent.unwrap_or_else(|| normal.any_orthonormal_vector());
        Self { tangent, bitangent: normal.cross(tangent), normal }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(n_g: DVec3) -> UnitNormals {
        UnitNormals { n_g, n_s: n_g }
    }

    fn is_orthonormal(frame: &ShadingFrame) {
        let ShadingFrame { tangent, bitangent, normal } = *frame;
        for v in [tangent, bitangent, normal] {
            assert!((v.length() - 1.0).abs() < 1e-14, "{frame:?}");
        }
        assert!((tangent.cross(bitangent) - normal).length() < 1e-14, "{frame:?}");
    }

    #[test]
    fn a_map_that_points_up_leaves_the_normal_and_an_oblique_frame_is_made_square() {
        let n = DVec3::new(0.3, -0.2, 0.9).normalize();
        let tangents = [DVec3::new(2.0, 0.1, 0.3), DVec3::new(0.2, 3.0, 0.1)];
        let frame = ShadingFrame::new(&flat(n), Some(tangents), Some([0.0, 0.0, 0.7]), 0.0);
        is_orthonormal(&frame);
        assert!((frame.normal - n).length() < 1e-15);
        assert!(frame.tangent.dot(tangents[0]) > 0.0 && frame.tangent.dot(n).abs() < 1e-15);
    }

    #[test]
    fn a_tilt_in_the_map_is_that_tilt_on_the_surface() {
        let tangents = [DVec3::X, DVec3::Y];
        for degrees in [1.0_f64, 20.0, 60.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            for (map, towards) in [([sin, 0.0, cos], DVec3::X), ([0.0, -sin, cos], -DVec3::Y)] {
                let frame = ShadingFrame::new(&flat(DVec3::Z), Some(tangents), Some(map.map(|x| x as f32)), 0.0);
                is_orthonormal(&frame);
                let tilted = DVec3::Z * cos + towards * sin;
                assert!((frame.normal - tilted).length() < 1e-7, "{degrees}: {frame:?}");
            }
        }
    }

    #[test]
    fn mirrored_coordinates_mirror_the_map() {
        let tangents = [DVec3::X, -DVec3::Y];
        let frame = ShadingFrame::new(&flat(DVec3::Z), Some(tangents), Some([0.0, 0.6, 0.8]), 0.0);
        is_orthonormal(&frame);
        assert!((frame.normal - DVec3::new(0.0, -0.6, 0.8)).length() < 1e-7);
    }

    #[test]
    fn turns_go_from_u_to_v() {
        let frame = ShadingFrame::new(&flat(DVec3::Z), Some([DVec3::X, DVec3::Y]), None, 0.25);
        is_orthonormal(&frame);
        assert!((frame.tangent - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn what_cannot_be_a_frame_is_replaced_by_one() {
        for tangents in [None, Some([DVec3::Z, DVec3::Y]), Some([DVec3::splat(1e-300), DVec3::Y])] {
            for map in
                [None, Some([0.0; 3]), Some([0.0, 0.0, -1.0]), Some([f32::NAN; 3]), Some([f32::INFINITY, 0.0, 1.0])]
            {
                let frame = ShadingFrame::new(&flat(DVec3::Z), tangents, map, 0.0);
                is_orthonormal(&frame);
                assert!((frame.normal - DVec3::Z).length() < 1e-15, "{frame:?}");
            }
        }
    }
}
