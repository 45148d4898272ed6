//! The terms that every dispersion formula in print is a sum of: value and derivatives, poles, and where they turn.

/// One term of a sum, λ in µm.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Term {
    /// a λᵖ; a constant is p = 0.
    Power { a: f64, p: f64 },
    /// a λᵖ / (λ² − c): Sellmeier's term for p = 2, Herzberger's first for p = 0.
    Resonance { a: f64, p: f64, c: f64 },
    /// a / (λ² − c)².
    DoubleResonance { a: f64, c: f64 },
    /// a / (c − λ⁻²): a resonance in wave numbers, as for gases.
    WaveNumber { a: f64, c: f64 },
    /// a (λ − u) / ((λ − u)² + w).
    Line { a: f64, u: f64, w: f64 },
}

/// A value with the size of the numbers that it was rounded from: it is right to a few times ε · `magnitude`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rounded {
    pub(super) value: f64,
    pub(super) magnitude: f64,
}

impl Term {
    /// Value, first and second derivative by λ in µm.
    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        let x = micrometers * micrometers;
        let power = |p: f64| libm::pow(micrometers, p);
        match *self {
            Self::Power { a, p } => [a * power(p), a * p * power(p - 1.0), a * p * (p - 1.0) * power(p - 2.0)],
            // f' = λᵖ⁻¹ ((p−2) λ² − p c) / (λ²−c)²,
            // f'' = λᵖ⁻² ((p−2)(p−3) λ⁴ + (2 + 6p − 2p²) c λ² + p(p−1) c²) / (λ²−c)³.
            Self::Resonance { a, p, c } => {
                let inverse = 1.0 / (x - c);
                let first = (p - 2.0) * x - p * c;
                let second =
                    ((p - 2.0) * (p - 3.0) * x + (2.0 + 6.0 * p - 2.0 * p * p) * c) * x + p * (p - 1.0) * c * c;
                [
                    a * power(p) * inverse,
                    a * power(p - 1.0) * first * inverse * inverse,
                    a * power(p - 2.0) * second * inverse * inverse * inverse,
                ]
            }
            // f' = −4λ/(λ²−c)³, f'' = 4(5λ² + c)/(λ²−c)⁴.
            Self::DoubleResonance { a, c } => {
                let inverse = 1.0 / (x - c);
                let square = inverse * inverse;
                [a * square, -4.0 * a * micrometers * square * inverse, 4.0 * a * (5.0 * x + c) * square * square]
            }
            // With y = λ⁻²: y' = −2y/λ, y'' = 6y², f' = y'/(c−y)², f'' = (y'' + 2y'²/(c−y))/(c−y)².
            Self::WaveNumber { a, c } => {
                let y = 1.0 / x;
                let inverse = 1.0 / (c - y);
                let dy = -2.0 * y / micrometers;
                [
                    a * inverse,
                    a * dy * inverse * inverse,
                    a * (6.0 * y * y + 2.0 * dy * dy * inverse) * inverse * inverse,
                ]
            }
            // With v = λ − u: f' = (w − v²)/(v²+w)², f'' = 2v(v² − 3w)/(v²+w)³.
            Self::Line { a, u, w } => {
                let v = micrometers - u;
                let square = v * v;
                let inverse = 1.0 / (square + w);
                [
                    a * v * inverse,
                    a * (w - square) * inverse * inverse,
                    2.0 * a * v * (square - 3.0 * w) * inverse * inverse * inverse,
                ]
            }
        }
    }

    /// The value for a proof: with what it may be off by. Differences beside a pole are what loses digits.
    pub(super) fn rounded(&self, micrometers: f64) -> Rounded {
        let value = self.at(micrometers)[0];
        let x = micrometers * micrometers;
        // Digits lost by the difference of two numbers.
        let loss = |one: f64, other: f64| (one.abs() + other.abs()) / (one - other).abs();
        let factor = match *self {
            Self::Power { .. } => 1.0,
            Self::Resonance { c, .. } => 1.0 + loss(x, c),
            Self::DoubleResonance { c, .. } => 1.0 + 2.0 * loss(x, c),
            Self::WaveNumber { c, .. } => 1.0 + loss(c, 1.0 / x),
            Self::Line { a, u, w } => {
                let v = micrometers - u;
                let (before, below) = (micrometers + u.abs(), v * v + w);
                // Beside its zero the term is a difference too, so this is no factor of the value.
                let magnitude =
                    (a * before / below).abs() + (value / below).abs() * (v * v + w.abs() + 2.0 * v.abs() * before);
                return Rounded { value, magnitude };
            }
        };
        Rounded { value, magnitude: value.abs() * factor }
    }

    /// Wavelengths in µm, above 0, at which the term is infinite.
    pub(super) fn poles(&self) -> Vec<f64> {
        let root = |square: f64| if square > 0.0 { vec![square.sqrt()] } else { Vec::new() };
        match *self {
            Self::Power { .. } => Vec::new(),
            Self::Resonance { c, .. } | Self::DoubleResonance { c, .. } => root(c),
            Self::WaveNumber { c, .. } => root(1.0 / c),
            Self::Line { u, w, .. } if w <= 0.0 => vec![u - (-w).sqrt(), u + (-w).sqrt()],
            Self::Line { .. } => Vec::new(),
        }
    }

    /// Wavelengths in µm at which the term turns between rising and falling: between these and the poles it is monotone.
    pub(super) fn turning_points(&self) -> Vec<f64> {
        match *self {
            // (p−2) λ² = p c.
            Self::Resonance { p, c, .. } => {
                let square = p * c / (p - 2.0);
                if square.is_finite() && square > 0.0 { vec![square.sqrt()] } else { Vec::new() }
            }
            // (λ − u)² = w.
            Self::Line { u, w, .. } if w > 0.0 => vec![u - w.sqrt(), u + w.sqrt()],
            _ => Vec::new(),
        }
    }

    /// Whether the value does not depend on wavelength.
    pub(super) fn is_constant(&self) -> bool {
        match *self {
            Self::Power { p: 0.0, .. } | Self::Resonance { p: 2.0, c: 0.0, .. } => true,
            _ => self.is_absent(),
        }
    }

    /// Whether the term is 0 whatever λ: catalogues pad with these, with or without a pole.
    pub(super) fn is_absent(&self) -> bool {
        match *self {
            Self::Power { a, .. }
            | Self::Resonance { a, .. }
            | Self::DoubleResonance { a, .. }
            | Self::WaveNumber { a, .. }
            | Self::Line { a, .. } => a == 0.0,
        }
    }

    /// The factor a, and the rest as text.
    pub(super) fn describe(&self) -> (f64, String) {
        // λ² − c, with the sign of c.
        let minus = |c: f64| if c < 0.0 { format!("+ {}", -c) } else { format!("- {c}") };
        match *self {
            Self::Power { a, p: 0.0 } => (a, String::new()),
            Self::Power { a, p } => (a, format!(" λ^{p}")),
            Self::Resonance { a, p: 2.0, c } => (a, format!(" λ²/(λ² {})", minus(c))),
            Self::Resonance { a, p: 0.0, c } => (a, format!("/(λ² {})", minus(c))),
            Self::Resonance { a, p, c } => (a, format!(" λ^{p}/(λ² {})", minus(c))),
            Self::DoubleResonance { a, c } => (a, format!("/(λ² {})²", minus(c))),
            Self::WaveNumber { a, c } => (a, format!("/({c} - λ^-2)")),
            Self::Line { a, u, w } => (a, format!(" (λ {0})/((λ {0})² {1})", minus(u), minus(-w))),
        }
    }
}
