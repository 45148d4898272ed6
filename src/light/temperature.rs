//! The colour of a light by its colour temperature, as UsdLux has it.
//!
//! `inputs:colorTemperature` is a colour, not a spectrum: that of a black body in linear Rec. 709, scaled to luminance 1.
//! USD computes it by a Catmull–Rom spline through one colour each 500 K (`UsdLuxBlackbodyTemperatureAsRgb`, OpenUSD,
//! `pxr/usd/usdLux/blackbody.cpp`), and so does this, so that a stage has the same colours here: a test compares. The true
//! spectrum is [`Illuminant::BlackBody`](crate::spectrum::illuminant::Illuminant::BlackBody). 6500 K is near white, but not white, which is D65.

/// Lowest temperature, kelvin; below it counts as this.
const COLDEST: f64 = 1000.0;
/// Highest temperature, kelvin; above it counts as this.
const HOTTEST: f64 = 10_000.0;

/// Distance of the knots, kelvin.
const STEP: f64 = 500.0;

/// From 1000 to 10000 K, largest channel 1: what USD returns there, times a number each.
const KNOTS: [[f64; 3]; 19] = [
    [1.0, 0.02749, 0.0],
    [1.0, 0.149_664, 0.0],
    [1.0, 0.256_644, 0.008_095],
    [1.0, 0.372_033, 0.067_450],
    [1.0, 0.476_725, 0.153_601],
    [1.0, 0.570_376, 0.259_196],
    [1.0, 0.653_480, 0.377_155],
    [1.0, 0.726_878, 0.501_606],
    [1.0, 0.791_543, 0.628_050],
    [1.0, 0.848_462, 0.753_228],
    [1.0, 0.898_581, 0.874_905],
    [1.0, 0.942_771, 0.991_642],
    [0.906_947, 0.890_456, 1.0],
    [0.828_247, 0.841_838, 1.0],
    [0.765_791, 0.801_896, 1.0],
    [0.715_255, 0.768_579, 1.0],
    [0.673_683, 0.740_423, 1.0],
    [0.638_992, 0.716_359, 1.0],
    [0.609_681, 0.695_588, 1.0],
];

/// Luminance of linear Rec. 709 (ITU-R BT.709-6).
pub fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// Linear Rec. 709 with luminance 1 for a temperature in kelvin.
pub fn rgb(kelvin: f64) -> [f64; 3] {
    let last = KNOTS.len() - 1;
    let position = (kelvin.clamp(COLDEST, HOTTEST) - COLDEST) / STEP;
    let segment = (position as usize).min(last - 1);
    let t = position - segment as f64;
    let [a, b, c, d] =
        [KNOTS[segment.saturating_sub(1)], KNOTS[segment], KNOTS[segment + 1], KNOTS[(segment + 2).min(last)]];
    // Catmull–Rom, tension ½.
    let spline = |i: usize| {
        let (p, q, r, s) = (a[i], b[i], c[i], d[i]);
        let cubic = -p + 3.0 * q - 3.0 * r + s;
        let square = 2.0 * p - 5.0 * q + 4.0 * r - s;
        0.5 * (2.0 * q + t * (r - p + t * (square + t * cubic)))
    };
    let rgb = std::array::from_fn(spline);
    let scale = 1.0 / luminance(rgb);
    rgb.map(|channel| (channel * scale).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luminance_is_one_at_every_temperature() {
        for kelvin in (900..10_200).step_by(37) {
            // Clamping a channel at 0 adds what the spline undershoots: at most 2e-4, near 1700 K.
            assert!((luminance(rgb(f64::from(kelvin))) - 1.0).abs() < 2e-4, "{kelvin} K");
        }
    }

    /// `UsdLux.BlackbodyTemperatureAsRgb` of usd-core 26.11, which computes in single precision.
    #[test]
    fn colours_are_those_of_usd() {
        let usd = [
            (500.0, [4.305_504_3, 0.118_358_31, 0.0]),
            (1000.0, [4.305_504_3, 0.118_358_31, 0.0]),
            (3000.0, [1.771_028_4, 0.844_293_53, 0.272_031_75]),
            (6250.0, [1.064_607_3, 0.981_267_2, 0.995_321_1]),
            (6500.0, [1.043_333_4, 0.983_624_46, 1.034_613_3]),
            (10_000.0, [0.871_841_3, 0.994_687_9, 1.429_995_9]),
            (12_000.0, [0.871_841_3, 0.994_687_9, 1.429_995_9]),
        ];
        for (kelvin, expected) in usd {
            for (channel, value) in rgb(kelvin).into_iter().zip(expected) {
                assert!((channel - value).abs() < 2e-6, "{kelvin} K: {channel} is not {value}");
            }
        }
    }
}
