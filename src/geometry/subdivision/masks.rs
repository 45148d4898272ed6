//! Subdivision masks: values of a level from those of the level above it.
//!
//! Catmull, Clark 1978, "Recursively generated B-spline surfaces on arbitrary topological meshes"; Loop 1987, "Smooth
//! subdivision surfaces based on triangles"; creases: Hoppe et al. 1994, "Piecewise smooth surface reconstruction"; those of
//! finite sharpness: DeRose, Kass, Truong 1998, "Subdivision surfaces in character animation", in the form that OpenSubdiv
//! made the standard (a vertex between two rules takes their mean, weighted by the sharpness that ends).

use rayon::prelude::*;

use super::topology::{INFINITE, Level, NONE, refined};

/// Rules for values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Masks {
    /// Bilinear, over quads or triangles.
    Linear,
    /// Catmull–Clark; `smooth_triangles`: triangles of the control mesh count more at their edges.
    CatmullClark {
        /// `triangleSubdivisionRule = smooth`.
        smooth_triangles: bool,
    },
    /// Loop.
    Loop,
}

/// Weight of a triangle at its edges under `triangleSubdivisionRule = smooth` (OpenSubdiv); a quad has 1/4.
const SMOOTH_TRIANGLE: f64 = 0.470;

/// What a vertex follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule<T> {
    /// The smooth mask; also where one sharp edge ends.
    Smooth,
    /// A cubic B-spline curve through the two.
    Crease([T; 2]),
    /// It stays.
    Corner,
}

/// The rule of a vertex and the one it has a level further down, with the weight of the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules<T> {
    pub(super) now: Rule<T>,
    pub(super) then: Rule<T>,
    pub(super) weight: f64,
}

impl<T: Copy> Rules<T> {
    /// From the vertex' own sharpness and the sharp edges at it with what is at their other end.
    pub(super) fn new(vertex: f32, edges: impl Iterator<Item = (f32, T)> + Clone) -> Self {
        let rule = |vertex: f32, edges: &mut dyn Iterator<Item = T>| {
            if vertex > 0.0 {
                return Rule::Corner;
            }
            match (edges.next(), edges.next(), edges.next()) {
                (Some(a), Some(b), None) => Rule::Crease([a, b]),
                (Some(_), Some(_), Some(_)) => Rule::Corner,
                _ => Rule::Smooth,
            }
        };
        let sharp = edges.clone().filter(|e| e.0 > 0.0);
        let now = rule(vertex, &mut sharp.clone().map(|e| e.1));
        let then = rule(refined(vertex), &mut sharp.clone().filter(|e| refined(e.0) > 0.0).map(|e| e.1));
        let ending = sharp.map(|e| e.0).chain(std::iter::once(vertex)).filter(|&s| s > 0.0 && refined(s) <= 0.0);
        let (sum, count) = ending.fold((0.0, 0.0), |(sum, count), s| (sum + f64::from(s), count + 1.0));
        Self { now, then, weight: if count > 0.0 { (sum / count).min(1.0) } else { 0.0 } }
    }
}

/// acc += weight · value.
#[inline(always)]
pub(super) fn add<const N: usize>(acc: &mut [f64; N], weight: f64, value: &[f64; N]) {
    for (a, v) in acc.iter_mut().zip(value) {
        *a += weight * v;
    }
}

/// The sum of values with their weights.
#[inline(always)]
pub(super) fn combine<const N: usize, const K: usize>(terms: [(f64, &[f64; N]); K]) -> [f64; N] {
    let mut sum = [0.0; N];
    for (weight, value) in terms {
        add(&mut sum, weight, value);
    }
    sum
}

/// What each of the n neighbours of a vertex weighs in Loop's mask.
pub(super) fn loop_weight(n: f64) -> f64 {
    let c = 0.375 + 0.25 * libm::cos(std::f64::consts::TAU / n);
    (0.625 - c * c) / n
}

/// Mean of the corners of each face.
pub(super) fn face_points<const N: usize>(level: &Level, values: &[[f64; N]]) -> Vec<[f64; N]> {
    let point = |face| {
        let corners = level.corners(face);
        let weight = 1.0 / corners.len() as f64;
        let mut mean = [0.0; N];
        level.corner_vertex[corners].iter().for_each(|&v| add(&mut mean, 1.0, &values[v as usize]));
        mean.map(|x| x * weight)
    };
    (0..level.face_count()).into_par_iter().map(point).collect()
}

/// Values of the next level from those of `level`, which is divided into triangles under Loop's scheme (`triangles`) and
/// into quads otherwise.
pub(super) fn refine<const N: usize>(
    level: &Level,
    masks: Masks,
    triangles: bool,
    values: &[[f64; N]],
) -> Vec<[f64; N]> {
    let points = if triangles { Vec::new() } else { face_points(level, values) };
    let mut out = vertex_points(level, masks, &points, values);
    out.reserve(level.edges.len() + points.len());
    out.par_extend((0..level.edges.len()).into_par_iter().map(|edge| edge_point(level, masks, &points, values, edge)));
    out.extend(points);
    out
}

fn edge_point<const N: usize>(
    level: &Level,
    masks: Masks,
    points: &[[f64; N]],
    values: &[[f64; N]],
    edge: usize,
) -> [f64; N] {
    let [a, b] = level.edges[edge].map(|v| &values[v as usize]);
    let middle = || combine([(0.5, a), (0.5, b)]);
    let sharpness = level.edge_sharpness[edge];
    if masks == Masks::Linear || sharpness >= 1.0 {
        return middle();
    }
    let [c, d] = level.edge_corners[edge].map(|c| c as usize);
    let smooth = match masks {
        Masks::Loop => {
            // The corner before the owner of the edge is the one across it.
            let across =
                |c: usize| &values[level.corner_vertex[if c.is_multiple_of(3) { c + 2 } else { c - 1 }] as usize];
            combine([(0.375, a), (0.375, b), (0.125, across(c)), (0.125, across(d))])
        }
        _ => {
            let [f, g] = [c, d].map(|c| face_of(level, c));
            let weight = |face| match masks {
                Masks::CatmullClark { smooth_triangles: true } if level.corners(face).len() == 3 => SMOOTH_TRIANGLE,
                _ => 0.25,
            };
            let face = 0.5 * (weight(f) + weight(g));
            combine([(0.5 - face, a), (0.5 - face, b), (face, &points[f]), (face, &points[g])])
        }
    };
    if sharpness > 0.0 {
        let s = f64::from(sharpness);
        return combine([(s, &middle()), (1.0 - s, &smooth)]);
    }
    smooth
}

fn face_of(level: &Level, corner: usize) -> usize {
    match &level.faces {
        super::topology::Faces::Uniform(n) => corner / *n as usize,
        // Empty faces have the same offset as the next one.
        super::topology::Faces::Offsets(offsets) => offsets.partition_point(|&first| first as usize <= corner) - 1,
    }
}

fn vertex_points<const N: usize>(
    level: &Level,
    masks: Masks,
    points: &[[f64; N]],
    values: &[[f64; N]],
) -> Vec<[f64; N]> {
    if masks == Masks::Linear {
        return values.to_vec();
    }
    let mut out = vec![[0.0; N]; level.vertices];
    let mut valence = vec![0_u32; level.vertices];
    for &[a, b] in &level.edges {
        let [a, b] = [a as usize, b as usize];
        add(&mut out[a], 1.0, &values[b]);
        add(&mut out[b], 1.0, &values[a]);
        valence[a] += 1;
        valence[b] += 1;
    }
    if masks != Masks::Loop {
        for (face, point) in points.iter().enumerate() {
            for &vertex in &level.corner_vertex[level.corners(face)] {
                add(&mut out[vertex as usize], 1.0, point);
            }
        }
    }
    out.par_iter_mut().zip(values).zip(&valence).for_each(|((sum, value), &valence)| {
        let n = f64::from(valence);
        let (own, other) = match (masks, valence) {
            // Nothing is about it, or nothing that makes a surface.
            (_, 0 | 1) => (1.0, 0.0),
            (Masks::Loop, _) => {
                let weight = loop_weight(n);
                (1.0 - n * weight, weight)
            }
            _ => ((n - 2.0) / n, 1.0 / (n * n)),
        };
        *sum = combine([(own, value), (other, &*sum)]);
    });
    for special in specials(level) {
        let vertex = special.vertex as usize;
        let smooth = out[vertex];
        let of = |rule: Rule<u32>| match rule {
            Rule::Smooth => smooth,
            Rule::Corner => values[vertex],
            Rule::Crease([a, b]) => {
                combine([(0.75, &values[vertex]), (0.125, &values[a as usize]), (0.125, &values[b as usize])])
            }
        };
        let Rules { now, then, weight } = special.rules;
        out[vertex] = if now == then { of(now) } else { combine([(weight, &of(now)), (1.0 - weight, &of(then))]) };
    }
    out
}

/// A vertex that is sharp or has sharp edges.
pub(super) struct Special {
    pub(super) vertex: u32,
    pub(super) rules: Rules<u32>,
}

/// In the order of the vertices.
pub(super) fn specials(level: &Level) -> Vec<Special> {
    let mut sharp: Vec<(u32, u32)> = Vec::new();
    for (edge, (&[a, b], &sharpness)) in level.edges.iter().zip(&level.edge_sharpness).enumerate() {
        if sharpness > 0.0 {
            sharp.extend([(a, edge as u32), (b, edge as u32)]);
        }
    }
    let vertices = level.vertex_sharpness.iter().enumerate();
    sharp.extend(vertices.filter(|&(_, &s)| s > 0.0).map(|(vertex, _)| (vertex as u32, NONE)));
    sharp.par_sort_unstable();
    let special = |group: &[(u32, u32)]| {
        let vertex = group[0].0;
        let edges = group.iter().filter(|g| g.1 != NONE).map(|&(_, edge)| {
            let [a, b] = level.edges[edge as usize];
            (level.edge_sharpness[edge as usize], if a == vertex { b } else { a })
        });
        Special { vertex, rules: Rules::new(level.vertex_sharpness[vertex as usize], edges) }
    };
    sharp.chunk_by(|a, b| a.0 == b.0).map(special).collect()
}

/// Whether a sharpness ends some levels further down.
pub(super) fn is_semi_sharp(sharpness: f32) -> bool {
    sharpness > 0.0 && sharpness < INFINITE
}
