//! Ways to get a derivative AOV, compared on a scene's own chains: what each costs and how wrong it is.
//!
//! Analytic columns stand against finite differences by re-tracing, and first- and second-order prediction of where the
//! ray at λ + δ lands against the exact re-trace. Everything is measured side by side in one run, round by round, so that
//! ratios hold on a machine whose speed drifts. `abbe bench` writes it as tables and plots.

mod single;

use std::hint::black_box;
use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::integrator::chain::{Chain, Counters, End, Follower, Record};
use crate::ray::{
    ColumnSet, Curvature, LambdaColumn, NoColumns, NormalField, RayStart, ScreenColumns, SecondOrderColumns, Step,
    second_order_along,
};
use crate::render::Plan;
use crate::sampler::CameraSample;
use crate::scene::Scene;
use crate::scene::view::Media;
use crate::spectrum::Wavelength;

/// Steps of the finite differences, nm.
const STEPS: [f64; 6] = [10.0, 1.0, 1e-1, 1e-2, 1e-3, 1e-5];
/// Distances of the predictions, nm.
const DISTANCES: [f64; 7] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
/// More chains than this tell nothing new about errors.
const MAX_CHAINS: usize = 4096;
/// The step that the reference's extrapolation starts from, nm.
const REFERENCE_STEP: f64 = 0.5;

/// One way to get ∂p/∂λ at the chain's end.
#[derive(Clone, Debug, Serialize)]
pub struct Method {
    /// `analytic f64`, `central difference` …
    pub name: String,
    /// Step of a difference, nm.
    pub step_nm: Option<f64>,
    /// Time per chain, the chain itself included, ns: median over the rounds.
    pub ns_per_chain: f64,
    /// Median over the rounds of the time over that of the bare chain in the same round.
    pub time_ratio: f64,
    /// Relative error of ∂p/∂λ.
    pub error: Errors,
}

/// A distribution of relative errors.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Errors {
    /// Half of the chains are better.
    pub median: f64,
    /// 1 % are worse.
    pub p99: f64,
    /// The worst.
    pub max: f64,
}

/// Where the ray at λ + δ lands, predicted from the derivatives at λ.
#[derive(Clone, Debug, Serialize)]
pub struct Prediction {
    /// δ, nm.
    pub delta_nm: f64,
    /// 1 or 2.
    pub order: u32,
    /// Chains whose events are the same at λ + δ: only they can be predicted.
    pub chains: usize,
    /// |predicted − exact| over the exact displacement.
    pub error: Errors,
}

/// What a column set costs on every ray of the image.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// What is carried.
    pub columns: String,
    /// Rays cast per second, millions, one thread: median over the rounds.
    pub mrays_per_second: f64,
    /// Median over the rounds of the time over that of no columns in the same round, minus 1.
    pub overhead: f64,
}

/// Everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Chains that the methods were compared on: dispersive, ending on a surface, the same events at ± the largest step.
    pub chains: usize,
    /// How well the reference (Richardson extrapolation of re-traces) knows ∂p/∂λ itself, rounding included: errors below
    /// it mean nothing.
    pub reference_error: Errors,
    /// Ways to the derivative.
    pub methods: Vec<Method>,
    /// Predictions of the landing point.
    pub predictions: Vec<Prediction>,
    /// Cost of the columns over the whole image.
    pub costs: Vec<Cost>,
}

/// Compares on the image of `plan`, in `rounds` rounds, on the calling thread.
pub fn compare(scene: &Scene, plan: &Plan, rounds: usize) -> Result<Comparison> {
    let camera = crate::render::camera(scene, plan)?;
    let view = crate::render::view(scene, plan, &camera);
    let follower = Follower::of_camera(&view, &camera);
    let tracer = Tracer { scene, follower: &follower, scale: plan.optics.dispersion_scale };
    let nm = plan.optics.reference.nanometers();
    let window = plan.window;
    let starts: Vec<RayStart> = (window.y0..window.y1)
        .flat_map(|y| (window.x0..window.x1).map(move |x| (x, y)))
        .map(|(x, y)| camera.ray(&CameraSample::at(f64::from(x) + 0.5, f64::from(y) + 0.5)))
        .collect();
    let rounds = rounds.max(1);
    let costs = costs(&tracer, nm, &starts, rounds)?;
    let (cases, reference_error) = cases(&tracer, nm, &starts)?;
    if cases.is_empty() {
        return Err(Error::scene(
            &scene.document().stage.source,
            "no pixel sees a surface through dispersive glass: nothing to compare",
        ));
    }
    let methods = methods(&tracer, nm, &cases, rounds)?;
    let predictions = predictions(&tracer, nm, &cases)?;
    Ok(Comparison { chains: cases.len(), reference_error, methods, predictions, costs })
}

struct Tracer<'a> {
    scene: &'a Scene,
    follower: &'a Follower<'a>,
    scale: f64,
}

impl Tracer<'_> {
    fn media(&self, nm: f64) -> Result<Media> {
        Media::at(self.scene, Wavelength::from_nanometers(nm), self.scale)
    }

    fn logged(&self, start: &RayStart, media: &Media, log: &mut Vec<Step>) -> Chain<NoColumns> {
        self.follower.follow(start, media, Record::of_steps(log), &mut Counters::default())
    }

    fn follow<C: ColumnSet>(&self, start: &RayStart, media: &Media) -> Chain<C> {
        self.follower.follow(start, media, Record::none(), &mut Counters::default())
    }
}

/// On a curved or smooth-shaded surface normals differ by less than this (cosine of 18°), or the chain is far too curved
/// for any derivative.
const SAME_SURFACE: f64 = 0.95;

/// Whether two chains do the same at the same surfaces, so that derivatives of one tell about the other: facets that are
/// flat have to be the very same.
fn are_of_one_family(a: &[Step], b: &[Step]) -> bool {
    let same = |a: &Step, b: &Step| {
        let (n_a, n_b) = (a.transfer.n_g, b.transfer.n_g);
        let is_flat = a.transfer.curvature == Curvature::Plane
            && a.scattering.is_none_or(|s| matches!(s.field, NormalField::Flat));
        a.scattering.map(|s| s.kind) == b.scattering.map(|s| s.kind)
            && if is_flat { n_a == n_b } else { n_a.dot(n_b) > SAME_SURFACE }
    };
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
}

fn end<C>(chain: &Chain<C>) -> Option<DVec3> {
    match &chain.end {
        End::Surface(met) => Some(met.point),
        End::Miss | End::Exhausted => None,
    }
}

/// A chain to compare on.
struct Case {
    start: RayStart,
    truth: DVec3,
}

/// The chains, and how well their reference is known: central differences at h, h/2 and h/4, extrapolated twice
/// (Richardson 1911). What the two first extrapolations differ by bounds both the truncation and the rounding left in it.
fn cases(tracer: &Tracer<'_>, nm: f64, starts: &[RayStart]) -> Result<(Vec<Case>, Errors)> {
    let media = tracer.media(nm)?;
    let steps = [REFERENCE_STEP, REFERENCE_STEP / 2.0, REFERENCE_STEP / 4.0];
    let around = |h: f64| Ok::<_, Error>((tracer.media(nm + h)?, tracer.media(nm - h)?));
    let sides = steps.iter().map(|&h| around(h)).collect::<Result<Vec<_>>>()?;
    let far = around(STEPS[0])?;
    let mut logs = [Vec::new(), Vec::new()];
    let candidates: Vec<&RayStart> = starts
        .iter()
        .filter(|start| {
            let [here, there] = &mut logs;
            let chain = tracer.logged(start, &media, here);
            let mut same = |media| {
                tracer.logged(start, media, there);
                are_of_one_family(here, there)
            };
            chain.is_dispersive && end(&chain).is_some() && same(&far.0) && same(&far.1)
        })
        .collect();
    let stride = candidates.len().div_ceil(MAX_CHAINS).max(1);
    let mut cases = Vec::new();
    let mut uncertainties = Vec::new();
    for start in candidates.into_iter().step_by(stride) {
        let difference = |i: usize| {
            let at = |media| end(&tracer.follow::<NoColumns>(start, media));
            Some((at(&sides[i].0)? - at(&sides[i].1)?) / (2.0 * steps[i]))
        };
        let (Some(a), Some(b), Some(c)) = (difference(0), difference(1), difference(2)) else { continue };
        let (ab, bc) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
        let truth = (16.0 * bc - ab) / 15.0;
        if truth.length() > 0.0 {
            uncertainties.push((ab - bc).length() / truth.length());
            cases.push(Case { start: *start, truth });
        }
    }
    let errors = Errors::of(uncertainties);
    Ok((cases, errors))
}

impl Errors {
    fn of(mut errors: Vec<f64>) -> Self {
        if errors.is_empty() {
            return Self { median: 0.0, p99: 0.0, max: 0.0 };
        }
        errors.sort_by(f64::total_cmp);
        let at = |fraction: f64| errors[((errors.len() - 1) as f64 * fraction) as usize];
        Self { median: at(0.5), p99: at(0.99), max: at(1.0) }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A way to ∂p/∂λ of one chain.
type Derivative<'a> = Box<dyn FnMut(&RayStart) -> Option<DVec3> + 'a>;

fn methods(tracer: &Tracer<'_>, nm: f64, cases: &[Case], rounds: usize) -> Result<Vec<Method>> {
    let media = &tracer.media(nm)?;
    let sides =
        STEPS.iter().map(|&h| Ok((h, tracer.media(nm + h)?, tracer.media(nm - h)?))).collect::<Result<Vec<_>>>()?;
    let mut ways: Vec<(String, Option<f64>, Derivative<'_>)> = vec![
        (
            "chain alone".into(),
            None,
            Box::new(|start| {
                black_box(tracer.follow::<NoColumns>(start, media));
                None
            }),
        ),
        (
            "analytic f64".into(),
            None,
            Box::new(|start| tracer.follow::<LambdaColumn>(start, media).columns.lambda().map(|c| c.point)),
        ),
        ("analytic f32".into(), None, {
            let mut log: Vec<Step> = Vec::new();
            Box::new(move |start| {
                let mut counters = Counters::default();
                let chain: Chain<NoColumns> =
                    tracer.follower.follow(start, media, Record::of_steps(&mut log), &mut counters);
                Some(single::lambda_column(start, &chain.start_medium, &log))
            })
        }),
    ];
    for (h, plus, minus) in &sides {
        ways.push((
            "forward difference".into(),
            Some(*h),
            Box::new(move |start| {
                let here = end(&tracer.follow::<NoColumns>(start, media))?;
                Some((end(&tracer.follow::<NoColumns>(start, plus))? - here) / *h)
            }),
        ));
        ways.push((
            "central difference".into(),
            Some(*h),
            Box::new(move |start| {
                black_box(tracer.follow::<NoColumns>(start, media));
                let above = end(&tracer.follow::<NoColumns>(start, plus))?;
                Some((above - end(&tracer.follow::<NoColumns>(start, minus))?) / (2.0 * h))
            }),
        ));
    }
    let mut times = vec![Vec::new(); ways.len()];
    for _ in 0..rounds {
        for ((_, _, way), times) in ways.iter_mut().zip(&mut times) {
            let begin = Instant::now();
            for case in cases {
                black_box(way(black_box(&case.start)));
            }
            times.push(begin.elapsed().as_secs_f64() * 1e9 / cases.len() as f64);
        }
    }
    let bare = times[0].clone();
    let row = |((name, step_nm, mut way), times): ((String, Option<f64>, Derivative<'_>), Vec<f64>)| {
        let ratios = times.iter().zip(&bare).map(|(t, b)| t / b).collect();
        let error = |case: &Case| Some((way(&case.start)? - case.truth).length() / case.truth.length());
        Method {
            name,
            step_nm,
            ns_per_chain: median(times),
            time_ratio: median(ratios),
            error: Errors::of(cases.iter().filter_map(error).collect()),
        }
    };
    Ok(ways.into_iter().zip(times).skip(1).map(row).collect())
}

fn predictions(tracer: &Tracer<'_>, nm: f64, cases: &[Case]) -> Result<Vec<Prediction>> {
    let media = tracer.media(nm)?;
    let [mut here, mut there] = [Vec::new(), Vec::new()];
    let mut rows = Vec::new();
    for delta in DISTANCES {
        if !(crate::spectrum::SHORTEST.nanometers()..=crate::spectrum::LONGEST.nanometers()).contains(&(nm + delta)) {
            continue;
        }
        let shifted = tracer.media(nm + delta)?;
        let mut errors = [Vec::new(), Vec::new()];
        for case in cases {
            let start = &case.start;
            let from = end(&tracer.logged(start, &media, &mut here));
            let to = end(&tracer.logged(start, &shifted, &mut there));
            let (Some(from), Some(to), true) = (from, to, are_of_one_family(&here, &there)) else { continue };
            let along = second_order_along(start, &here[0].transfer.medium, DVec3::Z, &here);
            let first = along.point * delta;
            let second = first + along.point2 * (0.5 * delta * delta);
            let moved = to - from;
            for (errors, predicted) in errors.iter_mut().zip([first, second]) {
                errors.push((predicted - moved).length() / moved.length());
            }
        }
        for (order, errors) in (1..).zip(errors) {
            rows.push(Prediction { delta_nm: delta, order, chains: errors.len(), error: Errors::of(errors) });
        }
    }
    Ok(rows)
}

/// One image, one thread, one column set: seconds and rays.
type Pass<'a> = Box<dyn Fn() -> (f64, u64) + 'a>;

fn costs(tracer: &Tracer<'_>, nm: f64, starts: &[RayStart], rounds: usize) -> Result<Vec<Cost>> {
    let media = tracer.media(nm)?;
    fn pass<C: ColumnSet>(tracer: &Tracer<'_>, media: &Media, starts: &[RayStart]) -> (f64, u64) {
        let mut counters = Counters::default();
        let begin = Instant::now();
        for start in starts {
            black_box(tracer.follower.follow::<C>(black_box(start), media, Record::none(), &mut counters));
        }
        (begin.elapsed().as_secs_f64(), counters.rays)
    }
    let second_chain = || {
        let mut counters = Counters::default();
        let mut log = Vec::new();
        let begin = Instant::now();
        for start in starts {
            let chain = tracer.follower.follow::<ScreenColumns>(
                black_box(start),
                &media,
                Record::of_steps(&mut log),
                &mut counters,
            );
            if chain.is_dispersive {
                black_box(second_order_along(start, &chain.start_medium, DVec3::ONE, &log));
            }
        }
        (begin.elapsed().as_secs_f64(), counters.rays)
    };
    let passes: Vec<(&str, Pass<'_>)> = vec![
        ("none", Box::new(|| pass::<NoColumns>(tracer, &media, starts))),
        ("λ", Box::new(|| pass::<LambdaColumn>(tracer, &media, starts))),
        ("x, y, λ", Box::new(|| pass::<ScreenColumns>(tracer, &media, starts))),
        ("x, y, λ, λλ", Box::new(|| pass::<SecondOrderColumns>(tracer, &media, starts))),
        ("x, y, λ and the second chain", Box::new(second_chain)),
    ];
    let mut times = vec![Vec::new(); passes.len()];
    let mut rays = 0;
    passes[0].1(); // warms up
    for _ in 0..rounds {
        for ((_, pass), times) in passes.iter().zip(&mut times) {
            let (seconds, cast) = pass();
            times.push(seconds);
            rays = cast;
        }
    }
    let bare = times[0].clone();
    let row = |((name, _), times): (&(&str, Pass<'_>), Vec<f64>)| Cost {
        columns: (*name).to_owned(),
        overhead: median(times.iter().zip(&bare).map(|(t, b)| t / b).collect()) - 1.0,
        mrays_per_second: rays as f64 / median(times) / 1e6,
    };
    Ok(passes.iter().zip(times).map(row).collect())
}
