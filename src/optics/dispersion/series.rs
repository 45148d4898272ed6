//! Laws in closed form: n, n² or the Lorentz–Lorenz ratio as a sum of terms.

use super::range::IorRange;
use super::term::Term;
use crate::spectrum::lines;

/// What a formula states: a growing function of n > 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// n.
    Index,
    /// ε = n².
    Permittivity,
    /// (n² − 1)/(n² + 2).
    LorentzLorenz,
}

impl Quantity {
    /// The quantity of an index.
    pub(super) fn of(self, ior: f64) -> f64 {
        match self {
            Self::Index => ior,
            Self::Permittivity => ior * ior,
            Self::LorentzLorenz => (ior * ior - 1.0) / (ior * ior + 2.0),
        }
    }

    /// n, n', n'' from the quantity q and its derivatives.
    ///
    /// ε = n²: n' = ε'/(2n), n'' = (ε'' − 2n'²)/(2n). Lorentz–Lorenz: ε = (1 + 2q)/(1 − q), ε' = 3q'/(1 − q)²,
    /// ε'' = (3q'' + 6q'²/(1 − q))/(1 − q)².
    fn index(self, [q, first, second]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Index => [q, first, second],
            Self::Permittivity => {
                let ior = q.sqrt();
                let dior = 0.5 * first / ior;
                [ior, dior, (0.5 * second - dior * dior) / ior]
            }
            Self::LorentzLorenz => {
                // Beyond 1 the quotient is negative, and so below −1/2: no real index either way.
                let rest = 1.0 - q;
                let square = rest * rest;
                Self::Permittivity.index([
                    (1.0 + 2.0 * q) / rest,
                    3.0 * first / square,
                    (3.0 * second + 6.0 * first * first / rest) / square,
                ])
            }
        }
    }

    fn symbol(self) -> &'static str {
        match self {
            Self::Index => "n",
            Self::Permittivity => "n²",
            Self::LorentzLorenz => "(n² - 1)/(n² + 2)",
        }
    }
}

/// A named formula: a quantity as a constant and terms that depend on λ.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Series {
    name: &'static str,
    quantity: Quantity,
    constant: f64,
    terms: Vec<Term>,
}

impl Series {
    pub(super) fn new(name: &'static str, quantity: Quantity, constant: f64, terms: Vec<Term>) -> Self {
        let mut series = Self { name, quantity, constant, terms: Vec::with_capacity(terms.len()) };
        for term in terms {
            if !term.is_constant() {
                series.terms.push(term);
            } else if !term.is_absent() {
                // Constant, so any wavelength will do.
                series.constant += term.at(1.0)[0];
            }
        }
        series
    }

    /// n, n', n'' with λ in µm.
    pub(super) fn at(&self, micrometers: f64) -> [f64; 3] {
        let mut sum = [self.constant, 0.0, 0.0];
        for term in &self.terms {
            for (sum, part) in sum.iter_mut().zip(term.at(micrometers)) {
                *sum += part;
            }
        }
        self.quantity.index(sum)
    }

    pub(super) fn is_constant(&self) -> bool {
        self.terms.is_empty()
    }

    /// Proves that no pole lies within `band` (µm) and that the index stays in `range` there.
    pub(super) fn check(&self, range: &IorRange, band: [f64; 2]) -> Result<(), String> {
        self.refuse_nanometers()?;
        for term in &self.terms {
            if let Some(pole) = term.poles().into_iter().find(|pole| (band[0]..=band[1]).contains(pole)) {
                let (factor, rest) = term.describe();
                return Err(format!(
                    "the term {factor}{rest} has a pole at {:.3} nm, within {:.0}–{:.0} nm: check its coefficients and their \
                     units (λ is in µm; of the two Sellmeier formulas of refractiveindex.info, 1 takes C in µm and squares \
                     it, 2 takes C in µm²)",
                    1e3 * pole,
                    1e3 * band[0],
                    1e3 * band[1],
                ));
            }
        }
        let ior = |micrometers: f64| self.at(micrometers)[0];
        range.check(band, self.quantity, self.constant, &self.terms, ior).map_err(|mut problem| {
            if let Some(nd) = self.as_nanometers() {
                problem += &format!(
                    "; they look like coefficients for λ in nm, by which n_d would be {nd:.4}: a factor of λ^p has to be \
                     multiplied by 10^(3p), C of a Sellmeier term divided by 10^6"
                );
            }
            problem
        })
    }

    /// n_d if the coefficients were for λ in nm, where that is an index as media have it.
    fn as_nanometers(&self) -> Option<f64> {
        let nd = self.at(lines::D.nanometers())[0];
        (nd > 1.0 && nd < 5.0).then_some(nd)
    }

    /// A Sellmeier law with C in nm² gives an index a little below 1, which is no violation of any bound. But a medium
    /// whose resonances all lie in the far infrared does not refract as one in the visible.
    fn refuse_nanometers(&self) -> Result<(), String> {
        let is_sellmeier = self.quantity == Quantity::Permittivity
            && self.terms.iter().all(|term| matches!(term, Term::Resonance { p: 2.0, .. }));
        let nd = self.at(lines::D.micrometers())[0];
        match self.as_nanometers() {
            Some(in_nanometers) if is_sellmeier && !self.terms.is_empty() && nd <= 1.0 => Err(format!(
                "n_d is {nd:.6}, and {in_nanometers:.4} if the coefficients C were in nm²: divide them by 10^6, µm² are \
                 wanted"
            )),
            _ => Ok(()),
        }
    }

    pub(super) fn describe(&self) -> String {
        let mut text = format!("{}, {} = {}", self.name, self.quantity.symbol(), self.constant);
        for term in &self.terms {
            let (factor, rest) = term.describe();
            let sign = if factor < 0.0 { '-' } else { '+' };
            text += &format!(" {sign} {}{rest}", factor.abs());
        }
        text
    }
}
