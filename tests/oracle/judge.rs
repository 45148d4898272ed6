//! The comparison: every vector of the product against the oracle's, in units of what rounding explains.

use super::{
    chain::Chain,
    derivative::{self, Along, Derivatives},
    real::{Real, Vector},
    subject::{Run, Subject},
    trace::{Kind, Lost, Noise},
};
use abbe::ray::{ColumnSet, SecondOrderColumns, direction_derivative, direction_second_derivative, second_order_along};
use glam::DVec3;

/// First derivatives: relative error per unit of condition number.
pub const FIRST_ORDER_BOUND: f64 = 1e-12;
/// Second derivatives: likewise. (10⁻⁹ is asked for; the second-order rules lose no more digits than the first.)
pub const SECOND_ORDER_BOUND: f64 = 1e-12;

/// One compared vector.
#[derive(Clone, Debug)]
pub struct Finding {
    pub name: &'static str,
    pub order: usize,
    /// |error| / |exact|; NaN where the exact vector is zero
    pub relative: f64,
    /// |error| / (cond · |exact|)
    pub conditioned: f64,
    /// The chain's condition number for this vector.
    pub condition: f64,
}

impl Finding {
    pub fn bound(&self) -> f64 {
        if self.order == 2 { SECOND_ORDER_BOUND } else { FIRST_ORDER_BOUND }
    }

    pub fn holds(&self) -> bool {
        // A comparison that fails for NaN.
        self.conditioned <= self.bound()
    }
}

/// The outcome of one chain.
pub enum Verdict {
    Judged(Vec<Finding>),
    /// The decision for total reflection is closer than rounding (relative distance of W² from zero, over its bound).
    Undecidable,
    /// A wrong decision for total reflection or a lost ray: an error of the product or of the case.
    Wrong(String),
}

/// The largest reaction to this many draws of signs counts.
pub const DRAWS: u64 = 2;

/// The exact derivatives and their perturbed versions.
pub struct Truth {
    pub exact: Derivatives,
    pub perturbed: Vec<Derivatives>,
}

impl Truth {
    pub fn new(chain: &Chain) -> Result<Self, Lost> {
        let exact = derivative::derivatives(chain, &Noise::none())?;
        let perturbed = (0..DRAWS)
            .map(|draw| derivative::derivatives(chain, &Noise::seeded(0x5eed + draw)))
            .collect::<Result<_, _>>()?;
        Ok(Self { exact, perturbed })
    }

    /// Compares one vector of the product.
    pub fn compare(
        &self,
        name: &'static str,
        order: usize,
        value: DVec3,
        of: impl Fn(&Derivatives) -> &Vector,
    ) -> Finding {
        let exact = of(&self.exact);
        let reactions: Vec<f64> = self.perturbed.iter().map(|p| derivative::reaction(of(p), exact)).collect();
        finding(name, order, value, exact, &reactions)
    }
}

/// Compares one vector, given the reactions to rounding.
pub fn finding(name: &'static str, order: usize, value: DVec3, exact: &Vector, reactions: &[f64]) -> Finding {
    let size = exact.length().to_f64();
    let error = if value.is_finite() { (&Vector::new(value.to_array()) - exact).length().to_f64() } else { f64::NAN };
    let reaction = reactions.iter().copied().fold(0.0, f64::max);
    let scale = size.max(reaction);
    let conditioned = if error == 0.0 { 0.0 } else { error / scale };
    Finding { name, order, relative: error / size, conditioned, condition: (reaction / size).max(1.0) }
}

/// Judges everything that the product carries along a chain, second order included.
pub fn judge(chain: &Chain) -> Verdict {
    let truth = match Truth::new(chain) {
        Ok(truth) => truth,
        Err(lost) => return Verdict::Wrong(format!("the case itself is lost: {lost:?}")),
    };
    let run: Option<Run<SecondOrderColumns>> = Subject::new(chain).run();
    if let Some(verdict) = decisions(&truth, run.as_ref().map(Run::kinds)) {
        return verdict;
    }
    let run = run.expect("decided");
    let mut findings = compare_columns(&truth, &run);
    // A direction in (x, y, λ) that mixes all three, for the second chain.
    let weights = [0.75, -0.5, 1.0];
    match mixed_second_order(chain, &run, weights) {
        Ok(more) => findings.extend(more),
        Err(lost) => return Verdict::Wrong(format!("the mixed direction is lost: {lost:?}")),
    }
    Verdict::Judged(findings)
}

/// None where product and oracle agree on what happens at every event.
pub fn decisions(truth: &Truth, kinds: Option<Vec<Kind>>) -> Option<Verdict> {
    let passed = &truth.exact.end.passed;
    let Some(kinds) = kinds else {
        return Some(Verdict::Wrong("the product's ray misses a surface".into()));
    };
    let index = passed.iter().zip(&kinds).position(|(a, b)| a.kind != *b)?;
    let event = &passed[index];
    let w2 = event.w_squared.as_ref().map_or(f64::NAN, Real::to_f64);
    let reaction = truth
        .perturbed
        .iter()
        .filter_map(|p| p.end.passed[index].w_squared.as_ref())
        .map(|w| {
            let difference = (w - event.w_squared.as_ref().expect("the same kind")).abs();
            (difference * Real::power_of_two(-super::trace::PERTURBATION_EXPONENT)).to_f64()
        })
        .fold(0.0, f64::max);
    if w2.abs() <= FIRST_ORDER_BOUND * reaction.max(1.0) {
        Some(Verdict::Undecidable)
    } else {
        Some(Verdict::Wrong(format!(
            "event {index}: oracle says {:?} with W² = {w2:e}, the product {:?}",
            event.kind, kinds[index]
        )))
    }
}

/// Columns of any set against the oracle.
pub fn compare_columns<C: ColumnSet>(truth: &Truth, run: &Run<C>) -> Vec<Finding> {
    let mut findings = vec![
        truth.compare("p", 0, run.point, |t| &t.end.point),
        truth.compare("K", 0, run.momentum, |t| &t.end.momentum),
    ];
    let (d, jet) = (run.direction, run.medium);
    if let Some([x, y]) = run.columns.screen() {
        findings.push(truth.compare("p_x", 1, x.point, |t| &t.x.point));
        findings.push(truth.compare("K_x", 1, x.momentum, |t| &t.x.momentum));
        findings.push(truth.compare("p_y", 1, y.point, |t| &t.y.point));
        findings.push(truth.compare("K_y", 1, y.momentum, |t| &t.y.momentum));
        let d_x = direction_derivative(x.momentum, d, jet.ior, 0.0);
        findings.push(truth.compare("d_x", 1, d_x, |t| &t.x.direction));
    }
    if let Some(lambda) = run.columns.lambda() {
        findings.push(truth.compare("p_λ", 1, lambda.point, |t| &t.lambda.point));
        findings.push(truth.compare("K_λ", 1, lambda.momentum, |t| &t.lambda.momentum));
        let d_lambda = direction_derivative(lambda.momentum, d, jet.ior, jet.dior_dlambda);
        findings.push(truth.compare("d_λ", 1, d_lambda, |t| &t.lambda.direction));
        if let Some(lambda2) = run.columns.lambda2() {
            findings.push(truth.compare("p_λλ", 2, lambda2.point, |t| &t.lambda.point2));
            findings.push(truth.compare("K_λλ", 2, lambda2.momentum, |t| &t.lambda.momentum2));
            let d2 = direction_second_derivative(lambda2.momentum, d, d_lambda, &jet);
            findings.push(truth.compare("d_λλ", 2, d2, |t| &t.lambda.direction2));
        }
    }
    findings
}

/// The second chain along a direction in (x, y, λ).
pub fn mixed_second_order<C: ColumnSet>(chain: &Chain, run: &Run<C>, weights: [f64; 3]) -> Result<Vec<Finding>, Lost> {
    let middle = |noise: &Noise| {
        super::trace::trace(chain, &Real::zero(), &Real::zero(), &Real::new(chain.nanometers), noise.clone())
    };
    let along = |noise: Noise| -> Result<Along, Lost> { derivative::along(chain, &middle(&noise)?, weights, &noise) };
    let exact = along(Noise::none())?;
    let perturbed = (0..DRAWS).map(|draw| along(Noise::seeded(0x5eed + draw))).collect::<Result<Vec<_>, _>>()?;
    let product = second_order_along(&run.start, &run.first_medium, DVec3::from_array(weights), &run.steps);
    let compare = |name, order, value, of: &dyn Fn(&Along) -> &Vector| {
        let reactions: Vec<f64> = perturbed.iter().map(|p| derivative::reaction(of(p), of(&exact))).collect();
        finding(name, order, value, of(&exact), &reactions)
    };
    Ok(vec![
        compare("p_s", 1, product.point, &|a| &a.point),
        compare("K_s", 1, product.momentum, &|a| &a.momentum),
        compare("p_ss", 2, product.point2, &|a| &a.point2),
        compare("K_ss", 2, product.momentum2, &|a| &a.momentum2),
    ])
}

/// Panics with a table where a finding exceeds its bound.
#[track_caller]
pub fn assert_holds(name: &str, findings: &[Finding]) {
    let failures: Vec<String> = findings
        .iter()
        .filter(|f| !f.holds())
        .map(|f| {
            format!(
                "  {}: relative error {:.2e}, condition {:.2e}, conditioned error {:.2e} > {:.0e}",
                f.name,
                f.relative,
                f.condition,
                f.conditioned,
                f.bound()
            )
        })
        .collect();
    assert!(failures.is_empty(), "{name}: against the multi-precision re-trace:\n{}", failures.join("\n"));
}
