//! The exposure of a camera.

use crate::scene::description::Exposure;

/// What radiance is multiplied with on its way to the sensor's value: time · ISO/100 · responsivity / N², and a power of 2
/// (`UsdGeomCamera::ComputeLinearExposureScale`). What is not authored counts as 1, the ISO as 100.
pub fn linear_exposure_scale(exposure: &Exposure) -> f64 {
    let Exposure { stops, time, iso, f_stop, responsivity } = *exposure;
    let n = f_stop.unwrap_or(1.0);
    time.unwrap_or(1.0)
        * (iso.unwrap_or(100.0) / 100.0)
        * libm::exp2(stops.unwrap_or(0.0))
        * responsivity.unwrap_or(1.0)
        / (n * n)
}
