//! Light of a black body: Planck's law.

use super::Wavelength;

/// 2hc², W·m²/sr, times 1e-9 for a radiance per nanometre (CODATA 2018: h and c are exact).
const FIRST: f64 = 2.0 * 6.626_070_15e-34 * 299_792_458.0 * 299_792_458.0 * 1e-9;
/// hc/k, m·K (k is exact).
const SECOND: f64 = 6.626_070_15e-34 * 299_792_458.0 / 1.380_649e-23;

/// Spectral radiance of a black body at `kelvin` > 0, W/(m²·sr·nm).
pub fn radiance(wavelength: Wavelength, kelvin: f64) -> f64 {
    let metres = wavelength.nanometers() * 1e-9;
    // exp(x) − 1 overflows to infinity for a cold body: then nothing is radiated, as is right.
    FIRST / (metres.powi(5) * libm::expm1(SECOND / (metres * kelvin)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_follows_wien() {
        for kelvin in [3000.0, 5000.0, 8000.0] {
            let peak = 2.897_771_955e6 / kelvin;
            let at = |nm: f64| radiance(Wavelength::from_nanometers(nm), kelvin);
            assert!(at(peak) > at(peak * 1.001) && at(peak) > at(peak * 0.999));
        }
    }

    #[test]
    fn all_of_it_is_stefan_boltzmanns() {
        // ∫ B dλ = σT⁴/π, by the trapezium rule in ln λ, which converges exponentially here.
        let kelvin = 4000.0;
        let step = 0.01;
        let sum: f64 = (0..1200)
            .map(|i| {
                let nm = 20.0 * libm::exp(step * f64::from(i));
                radiance(Wavelength::from_nanometers(nm), kelvin) * nm * step
            })
            .sum();
        let exact = 5.670_374_419e-8 * kelvin.powi(4) / std::f64::consts::PI;
        assert!((sum / exact - 1.0).abs() < 1e-6, "{}", sum / exact);
    }

    #[test]
    fn extremes_stay_finite() {
        for kelvin in [1e-3, 1.0, 1e12] {
            assert!(radiance(Wavelength::from_nanometers(360.0), kelvin).is_finite(), "{kelvin} K");
        }
    }
}
