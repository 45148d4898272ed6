//! Each shape: samples against the density, the density's integral, irradiance against closed forms and quadrature.
//!
//! Directions are in the equal-area projection about the direction of the shape, r² = 2 (1 − cos θ): cells have solid angles that
//! are their areas.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::super::shape::{Disk, Ellipsoid, Rectangle, Toward, Triangle, Tube, frame};
use super::{Random, deviations};

/// A shape and what the tests ask it.
enum Form {
    Rectangle(Rectangle),
    Disk(Disk),
    Ellipsoid(Ellipsoid),
    Tube(Tube),
    Triangle(Triangle),
}

impl Form {
    fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<Toward> {
        match self {
            Self::Rectangle(s) => s.sample(p, u),
            Self::Disk(s) => s.sample(p, u),
            Self::Ellipsoid(s) => s.sample(p, false, u),
            Self::Tube(s) => s.sample(p, u),
            Self::Triangle(s) => s.sample(p, u).map(|(toward, _)| toward),
        }
    }

    /// Where a ray meets it and the density of its direction.
    fn met(&self, p: DVec3, d: DVec3) -> Option<(f64, f64)> {
        match self {
            Self::Rectangle(s) => s.meet(p, d).map(|(t, _)| (t, s.pdf(p, t))),
            Self::Disk(s) => s.meet(p, d).map(|t| (t, s.pdf(p, t))),
            Self::Ellipsoid(s) => s.meet(p, d).map(|t| (t, s.pdf(p, false, d, t))),
            Self::Tube(s) => s.meet(p, d).map(|t| (t, s.pdf(p, d))),
            Self::Triangle(s) => {
                let [a, b, c] = s.corners();
                let n = s.unit_normal();
                let t = (a - p).dot(n) / d.dot(n);
                let q = p + t * d;
                let inside = |u: DVec3, v: DVec3| (v - u).cross(q - u).dot(n) >= 0.0;
                let is_met = t > 0.0 && d.dot(n) < 0.0 && inside(a, b) && inside(b, c) && inside(c, a);
                is_met.then(|| (t, s.pdf(p, d, t)))
            }
        }
    }
}

/// Directions about an axis, by the equal-area projection.
struct Projection {
    axis: DVec3,
    across: [DVec3; 2],
}

impl Projection {
    fn about(axis: DVec3) -> Self {
        let axis = axis.normalize();
        Self { axis, across: frame(axis) }
    }

    fn of(&self, d: DVec3) -> [f64; 2] {
        let radius = (d - self.axis).length();
        let [x, y] = self.across.map(|a| a.dot(d));
        let length = x.hypot(y).max(1e-300);
        [radius * x / length, radius * y / length]
    }

    fn direction(&self, [x, y]: [f64; 2]) -> Option<DVec3> {
        let squared = x * x + y * y;
        if squared > 4.0 {
            return None;
        }
        let cosine = 1.0 - 0.5 * squared;
        let scale = (1.0 - 0.25 * squared).sqrt();
        Some(scale * (x * self.across[0] + y * self.across[1]) + cosine * self.axis)
    }
}

const CELLS: usize = 8;
/// Quadrature points along a side of a cell.
const FINE: usize = 48;
const SAMPLES: usize = 20_000;

/// χ² of the samples from `p` against the density, whose integral is the part of the samples that there are; what is drawn is met
/// at the same distance with the same density. Returns ∫ cos⁺ dω about `n` by quadrature and from the samples.
fn check(what: &str, form: &Form, p: DVec3, n: DVec3, center: DVec3) -> (f64, f64) {
    let projection = Projection::about(center - p);
    let mut random = Random(7);
    let mut drawn = Vec::new();
    let (mut sum, mut missed) = (0.0, 0);
    for i in 0..SAMPLES {
        // Stratified in a hundred columns: the irradiance is a closer check so.
        let u = [((i % 100) as f64 + random.next()) / 100.0, random.next()];
        let Some(Toward { wi, distance, pdf_solid_angle }) = form.sample(p, u) else { continue };
        assert!((wi.length() - 1.0).abs() < 1e-12 && distance > 0.0 && pdf_solid_angle > 0.0, "{what}");
        match form.met(p, wi) {
            Some((met, pdf)) => {
                assert!((met / distance - 1.0).abs() < 1e-6, "{what}: drawn at {distance}, met at {met}");
                assert!((pdf / pdf_solid_angle - 1.0).abs() < 1e-6, "{what}: density {pdf_solid_angle}, then {pdf}");
            }
            None => missed += 1,
        }
        sum += n.dot(wi).max(0.0) / pdf_solid_angle;
        drawn.push(projection.of(wi));
    }
    // Only where rounding decides at an edge.
    assert!(missed <= SAMPLES / 2000, "{what}: {missed} directions meet nothing");
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for at in &drawn {
        for k in 0..2 {
            low[k] = low[k].min(at[k]);
            high[k] = high[k].max(at[k]);
        }
    }
    // What no sample found is looked at, too.
    for k in 0..2 {
        let margin = 0.05 * (high[k] - low[k]);
        (low[k], high[k]) = (low[k] - margin, high[k] + margin);
    }
    let size = [0, 1].map(|k| (high[k] - low[k]) / CELLS as f64);
    let mut counts = [[0.0; CELLS]; CELLS];
    for at in &drawn {
        let cell = [0, 1].map(|k| (((at[k] - low[k]) / size[k]) as usize).min(CELLS - 1));
        counts[cell[0]][cell[1]] += 1.0;
    }
    let area = size[0] * size[1] / (FINE * FINE) as f64;
    let (mut chi_squared, mut freedom, mut total, mut irradiance) = (0.0, -1.0_f64, 0.0, 0.0);
    let mut rest = [0.0; 2];
    for (i, row) in counts.iter().enumerate() {
        for (j, &count) in row.iter().enumerate() {
            let mut expected = 0.0;
            for k in 0..FINE * FINE {
                let x = low[0] + (i as f64 + ((k % FINE) as f64 + 0.5) / FINE as f64) * size[0];
                let y = low[1] + (j as f64 + ((k / FINE) as f64 + 0.5) / FINE as f64) * size[1];
                let Some(d) = projection.direction([x, y]) else { continue };
                if let Some((_, pdf)) = form.met(p, d) {
                    expected += area * pdf;
                    irradiance += area * n.dot(d).max(0.0);
                }
            }
            total += expected;
            let expected = expected * SAMPLES as f64;
            if expected < 40.0 {
                rest = [rest[0] + count, rest[1] + expected];
            } else {
                chi_squared += (count - expected) * (count - expected) / expected;
                freedom += 1.0;
            }
        }
    }
    if rest[1] > 10.0 {
        chi_squared += (rest[0] - rest[1]) * (rest[0] - rest[1]) / rest[1];
        freedom += 1.0;
    }
    let part = drawn.len() as f64 / SAMPLES as f64;
    assert!((total - part).abs() < 0.02, "{what}: the density's integral is {total} of {part}");
    let off = deviations(chi_squared, freedom.max(1.0));
    // The quadrature errs by some per cent at the edges of a shape, which a few samples do not see.
    assert!(off < 4.5, "{what}: χ² = {chi_squared} of {freedom}, {off} standard deviations");
    (irradiance, sum / SAMPLES as f64)
}

fn agree(what: &str, (quadrature, sampled): (f64, f64), closed: Option<f64>) {
    let expected = closed.unwrap_or(quadrature);
    assert!((quadrature / expected - 1.0).abs() < 0.02, "{what}: {quadrature} by quadrature, {expected}");
    assert!((sampled / expected - 1.0).abs() < 0.02, "{what}: {sampled} sampled, {expected}");
}

/// Lambert's formula: the irradiance of a polygon of radiance 1, all of it above the horizon.
fn lambert(p: DVec3, n: DVec3, corners: &[DVec3]) -> f64 {
    let unit: Vec<DVec3> = corners.iter().map(|c| (*c - p).normalize()).collect();
    let sum: f64 = (0..unit.len())
        .map(|i| {
            let (a, b) = (unit[i], unit[(i + 1) % unit.len()]);
            a.angle_between(b) * n.dot(a.cross(b).normalize())
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn rectangles() {
    let (u, v) = (DVec3::new(1.2, 0.0, 0.0), DVec3::new(0.0, 0.4, 0.3));
    let n = u.cross(v).normalize();
    let center = DVec3::new(0.3, -0.2, 0.1);
    let sheared = DVec3::new(0.5, 0.4, 0.3);
    for (name, v) in [("rectangle", v), ("parallelogram", sheared)] {
        let n = if name == "rectangle" { n } else { u.cross(v).normalize() };
        let shape = Form::Rectangle(Rectangle::new(center, u, v, n, false));
        let receivers = [
            ("far", 40.0 * n + DVec3::X),
            ("beside", 0.8 * n + 2.0 * u),
            ("near", 0.9 * n),
            ("grazing", 0.3 * n + 3.0 * u),
        ];
        for (place, offset) in receivers {
            let p = center + offset;
            let up = (center - p).normalize();
            let what = format!("{name} {place}");
            let Form::Rectangle(rectangle) = &shape else { unreachable!() };
            let [a, b, c, d] = rectangle.corners();
            let corners = [a, b, d, c];
            let is_above = corners.iter().all(|c| up.dot(*c - p) > 0.0);
            let closed = is_above.then(|| lambert(p, up, &corners));
            agree(&what, check(&what, &shape, p, up, center), closed);
        }
        assert!(shape.sample(center - n, [0.5; 2]).is_none(), "{name} is dark behind");
        assert!(shape.met(center - n, n).is_none());
        assert!(shape.sample(center + u, [0.5; 2]).is_none(), "and from within its plane");
    }
}

#[test]
fn disks() {
    let center = DVec3::new(0.3, -0.2, 0.1);
    let n = DVec3::new(0.2, 0.3, -0.9).normalize();
    let [x, y] = frame(n);
    let round = Form::Disk(Disk::new(center, 0.7 * x, 0.7 * y, n));
    for height in [0.3, 2.0, 30.0] {
        let what = format!("disk from {height}");
        let closed = PI * 0.49 / (0.49 + height * height);
        agree(&what, check(&what, &round, center + height * n, -n, center), Some(closed));
    }
    let ellipse = Form::Disk(Disk::new(center, 0.7 * x, 0.2 * x + 0.3 * y, n));
    for (place, offset) in
        [("far", 20.0 * n), ("near", 0.4 * n), ("beside", 0.3 * n + 1.5 * x), ("grazing", 0.1 * n + 4.0 * y)]
    {
        let p = center + offset;
        let what = format!("ellipse {place}");
        agree(&what, check(&what, &ellipse, p, (center - p).normalize(), center), None);
    }
    assert!(round.sample(center - n, [0.5; 2]).is_none() && round.met(center - n, n).is_none());
}

#[test]
fn spheres_and_ellipsoids() {
    let center = DVec3::new(0.3, -0.2, 0.1);
    let ball = Form::Ellipsoid(Ellipsoid::new(center, DMat3::from_diagonal(DVec3::splat(0.5)), false));
    for distance in [0.51, 0.8, 3.0, 1e3, 1e7] {
        let p = center + distance * DVec3::new(0.48, 0.6, 0.64);
        let what = format!("sphere from {distance}");
        let n = (center - p).normalize();
        let [x, _] = frame(n);
        let sine = 0.5 / distance;
        agree(&what, check(&what, &ball, p, n, center), Some(PI * sine * sine));
        // Tilted, all of it still above the horizon.
        let tilted = (n * 0.8 + x * 0.6).normalize();
        if sine < 0.6 {
            agree(&what, check(&what, &ball, p, tilted, center), Some(PI * sine * sine * 0.8));
        }
    }
    assert!(ball.sample(center, [0.5; 2]).is_none() && ball.met(center, DVec3::X).is_none(), "dark inside");
    let axes = DMat3::from_cols(DVec3::new(0.9, 0.1, 0.0), DVec3::new(0.2, 0.3, -0.1), DVec3::new(0.0, 0.2, 0.5));
    let ellipsoid = Form::Ellipsoid(Ellipsoid::new(center, axes, false));
    for offset in [DVec3::new(0.0, 5.0, 1.0), DVec3::new(1.0, 0.4, 0.0), DVec3::new(0.0, 0.6, -0.3)] {
        let p = center + offset;
        let what = format!("ellipsoid from {offset}");
        agree(&what, check(&what, &ellipsoid, p, (center - p).normalize(), center), None);
    }
}

#[test]
fn what_glows_on_both_sides_is_seen_from_inside() {
    let ball = Ellipsoid::new(DVec3::X, DMat3::from_diagonal(DVec3::splat(2.0)), true);
    let mut random = Random(3);
    let p = DVec3::new(1.5, 0.7, -0.3);
    for _ in 0..100 {
        let Toward { wi, distance, pdf_solid_angle } = ball.sample(p, false, random.pair()).unwrap();
        assert!(((p + distance * wi - DVec3::X).length() - 2.0).abs() < 1e-12);
        assert!(
            (pdf_solid_angle * 4.0 * PI - 1.0).abs() < 1e-12
                && (ball.pdf(p, false, wi, distance) / pdf_solid_angle - 1.0).abs() < 1e-12
        );
    }
}

#[test]
fn a_point_of_a_ball_sees_the_rest_of_it_through_the_inside() {
    let center = DVec3::new(1.0, -2.0, 0.5);
    let axes = DMat3::from_diagonal(DVec3::splat(2.0));
    let [glowing, dark] = [true, false].map(|is_two_sided| Ellipsoid::new(center, axes, is_two_sided));
    let mut random = Random(5);
    for _ in 0..100 {
        // Rounding has put about half of these points outside.
        let n = random.direction();
        let p = center + 2.0 * n;
        let Toward { wi, distance, pdf_solid_angle } = glowing.sample(p, true, random.pair()).unwrap();
        assert!((distance + 4.0 * wi.dot(n)).abs() < 1e-12 && wi.dot(n) < 0.0, "{distance}");
        assert!((pdf_solid_angle * 2.0 * PI - 1.0).abs() < 1e-12);
        assert!((glowing.pdf(p, true, wi, distance) / pdf_solid_angle - 1.0).abs() < 1e-12);
        assert!(dark.sample(p, true, random.pair()).is_none() && dark.pdf(p, true, wi, distance) <= 0.0);
    }
}

#[test]
fn tubes() {
    let center = DVec3::new(0.3, -0.2, 0.1);
    let axis = DVec3::new(0.6, 0.0, 0.8);
    let [x, y] = frame(axis);
    for (name, half, radii) in [
        ("round", 1.5 * axis, [0.2 * x, 0.2 * y]),
        ("thin", 4.0 * axis, [0.01 * x, 0.01 * y]),
        ("elliptic", 1.5 * axis, [0.2 * x + 0.1 * axis, 0.1 * x + 0.4 * y]),
    ] {
        let tube = Form::Tube(Tube::new(center, half, radii));
        for (place, offset) in [
            ("far", 30.0 * x + 5.0 * axis),
            ("near", 0.6 * x),
            ("beside the end", 2.0 * half + 0.9 * y),
            ("along", 6.0 * half + 1.2 * x),
        ] {
            let p = center + offset;
            let what = format!("{name} tube, {place}");
            agree(&what, check(&what, &tube, p, (center - p).normalize(), center), None);
        }
        assert!(tube.sample(center + 3.0 * half, [0.5; 2]).is_none(), "{name}: only ends are seen along the axis");
        assert!(tube.met(center + 3.0 * half, -half.normalize()).is_none() && tube.met(center, x).is_none());
    }
}

#[test]
fn triangles() {
    let corners = [DVec3::new(0.0, 0.1, 0.0), DVec3::new(1.0, 0.0, 0.2), DVec3::new(0.2, 0.9, -0.1)];
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let triangle = Form::Triangle(Triangle::new(corners, n, false));
    let center = (corners[0] + corners[1] + corners[2]) / 3.0;
    let unit = n.normalize();
    for (place, offset) in [
        ("far", 50.0 * unit),
        ("at some distance", 2.0 * unit + DVec3::X),
        ("near", 0.3 * unit),
        ("grazing", 0.1 * unit + (corners[1] - corners[0])),
    ] {
        let p = center + offset;
        let what = format!("triangle {place}");
        let up = (center - p).normalize();
        let closed = corners.iter().all(|c| up.dot(*c - p) > 0.0).then(|| lambert(p, up, &corners));
        agree(&what, check(&what, &triangle, p, up, center), closed);
    }
    assert!(triangle.sample(center - unit, [0.5; 2]).is_none());
    // Weights and direction are of the same point.
    let Form::Triangle(triangle) = triangle else { unreachable!() };
    let mut random = Random(5);
    for _ in 0..100 {
        for p in [center + 0.5 * unit, center + 90.0 * unit] {
            let (Toward { wi, distance, .. }, [v, w]) = triangle.sample(p, random.pair()).unwrap();
            let [a, b, c] = corners;
            assert!((a + v * (b - a) + w * (c - a) - (p + distance * wi)).length() < 1e-9);
        }
    }
}
