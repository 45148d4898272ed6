//! How what is seen moves on screen with wavelength (MATH.md 2.5).

use glam::{DVec2, DVec3};

/// (x_λ, y_λ) = −J⁺ v_λ with J = [v_x v_y]: the motion on screen, in pixels per nm, of what is fixed at the end of the
/// chain.
///
/// For a surface, v is the point and `normal` its geometric normal; for an infinitely far environment, v is the direction
/// and `normal` the direction itself. The normal's sign and length do not matter.
///
/// `None` at a caustic as seen from the eye, where Δ = (v_x × v_y)·n vanishes relative to |v_x||v_y||n| and the motion
/// is unbounded.
pub fn screen_motion(v_x: DVec3, v_y: DVec3, v_lambda: DVec3, normal: DVec3) -> Option<DVec2> {
    /// Δ is rounded by a few ulp of |v_x||v_y||n|, and its arguments are by a few more; 2¹⁰ ulp is where about two digits
    /// of it are left.
    const LOST: f64 = 1024.0 * f64::EPSILON;
    let delta = v_x.cross(v_y).dot(normal);
    let scale = v_x.length() * v_y.length() * normal.length();
    if delta.abs() <= LOST * scale {
        return None;
    }
    let motion = DVec2::new(-v_lambda.cross(v_y).dot(normal) / delta, -v_x.cross(v_lambda).dot(normal) / delta);
    motion.is_finite().then_some(motion)
}
