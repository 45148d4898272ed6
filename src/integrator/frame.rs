//! The local frame of a shading normal: between the world's f64 and the f32 of scattering.

use glam::{DVec3, Vec3};

/// An orthonormal frame with z along a normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    x: DVec3,
    y: DVec3,
    z: DVec3,
}

impl Frame {
    /// About the unit vector `z` (T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017).
    pub(super) fn about(z: DVec3) -> Self {
        let sign = 1f64.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: DVec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
            y: DVec3::new(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// About `z` with x along `tangent`, as far as that is across z.
    pub(super) fn along(z: DVec3, tangent: DVec3) -> Self {
        let across = tangent - z * z.dot(tangent);
        let length = across.length();
        // Half the digits: a shorter one has no direction.
        if length <= 1e-8 * tangent.length() {
            return Self::about(z);
        }
        let x = across / length;
        Self { x, y: z.cross(x), z }
    }

    pub(super) fn to_local(self, v: DVec3) -> Vec3 {
        DVec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z)).as_vec3()
    }

    /// A unit vector of the world.
    pub(super) fn to_world(self, v: Vec3) -> DVec3 {
        let v = v.as_dvec3();
        (self.x * v.x + self.y * v.y + self.z * v.z).normalize()
    }
}
