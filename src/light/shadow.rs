//! Shadows that are not as nature has them (UsdLuxShadowAPI).

/// How occluders darken what a light reaches.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadow {
    /// Whether they do.
    pub is_enabled: bool,
    /// What is seen, per channel of the light, in full shadow.
    pub color: [f64; 3],
    /// Occluders farther from the surface than this cast none.
    pub distance: Option<f64>,
    /// Length of the zone before that in which shadows fade; 0 for none, at most the distance.
    pub falloff: f64,
    /// Exponent of the fading.
    pub falloff_gamma: f64,
}

impl Default for Shadow {
    fn default() -> Self {
        Self { is_enabled: true, color: [0.0; 3], distance: None, falloff: 0.0, falloff_gamma: 1.0 }
    }
}

impl Shadow {
    /// Whether light that something blocks is simply gone.
    pub fn is_natural(&self) -> bool {
        self.is_enabled && self.distance.is_none() && self.color.iter().all(|&channel| channel <= 0.0)
    }

    /// How much of a shadow an opaque occluder casts that is `distance` away from the surface: 1 all of it, 0 none.
    ///
    /// Within the zone it is the part of the zone that is left, to the power of γ.
    pub fn strength(&self, distance: f64) -> f64 {
        if !self.is_enabled {
            return 0.0;
        }
        let Some(limit) = self.distance else { return 1.0 };
        if distance > limit {
            0.0
        } else if distance <= limit - self.falloff {
            1.0
        } else {
            libm::pow(((limit - distance) / self.falloff).clamp(0.0, 1.0), self.falloff_gamma)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_strengths(shadow: &Shadow, expected: &[(f64, f64)]) {
        for &(distance, strength) in expected {
            assert!((shadow.strength(distance) - strength).abs() < 1e-15, "{distance}: {}", shadow.strength(distance));
        }
    }

    #[test]
    fn strength_falls_from_one_to_nothing_within_the_zone() {
        let shadow = Shadow { distance: Some(10.0), falloff: 4.0, falloff_gamma: 2.0, ..Shadow::default() };
        assert_strengths(&shadow, &[(0.0, 1.0), (6.0, 1.0), (8.0, 0.25), (10.0, 0.0), (11.0, 0.0)]);
        let hard = Shadow { falloff: 0.0, ..shadow.clone() };
        assert_strengths(&hard, &[(9.999, 1.0), (10.0, 1.0), (10.001, 0.0)]);
        assert_strengths(&Shadow { is_enabled: false, ..shadow }, &[(1.0, 0.0)]);
        assert!(Shadow::default().is_natural() && !hard.is_natural());
        assert_strengths(&Shadow::default(), &[(1e30, 1.0)]);
    }
}
