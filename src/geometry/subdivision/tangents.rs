//! Limit masks: left eigenvectors of the matrix that takes the neighbourhood of a vertex to the next level.
//!
//! The neighbourhood is the vertex v, the ends of its spokes e_i and, for Catmull–Clark, the face points F_i that the next
//! level will have (F_i lies between e_i and e_(i+1)); with these instead of the corners opposite to v the masks hold for
//! faces of any number of corners. The eigenvector of 1 gives the limit position, the next two a pair of tangents (Halstead,
//! Kass, DeRose 1993; Biermann, Levin, Zorin 2000, "Piecewise smooth subdivision surfaces with normal control").
//!
//! One deviation: the tangent across a crease that Biermann et al. print, and OpenSubdiv with them, belongs to their
//! modified rules; under the rules in use it is no eigenvector unless the crease is regular. Here it is. (With many faces on
//! one side, five and more for Catmull–Clark, those rules leave no single tangent plane: what is nearest to the crease has the
//! one that is given.)

use std::f64::consts::{PI, TAU};

/// Weights of a ring: `vertex`, then one a spoke, then one a face point.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights {
    pub(super) vertex: f64,
    pub(super) spokes: Vec<f64>,
    pub(super) faces: Vec<f64>,
}

/// Factor of the spokes beside that of the opposite corners in Catmull–Clark's tangents of angle `theta` a face.
fn spoke_factor(theta: f64) -> f64 {
    let c = libm::cos(theta);
    1.0 + c + libm::cos(0.5 * theta) * (2.0 * (9.0 + c)).sqrt()
}

/// Limit position of a smooth vertex in n faces: weights of the vertex, each spoke, each face point.
pub(super) fn smooth_position(n: f64, is_loop: bool) -> [f64; 3] {
    if is_loop {
        let weight = 1.0 / (n + 0.375 / super::masks::loop_weight(n));
        [1.0 - n * weight, weight, 0.0]
    } else {
        let weight = 1.0 / (n * (n + 5.0));
        [n * (n - 1.0) * weight, 2.0 * weight, 4.0 * weight]
    }
}

/// The two tangents of a smooth vertex in n faces: for each face and its first spoke the weights [spoke, face point] of the
/// first tangent and of the second. The first points about along spoke 0, the second counter-clockwise from there.
pub(super) fn smooth_tangents(n: usize, is_loop: bool) -> Vec<[[f64; 2]; 2]> {
    let theta = TAU / n as f64;
    let factor = if is_loop { 4.0 } else { spoke_factor(theta) };
    let at = |wave: fn(f64) -> f64, i: usize| {
        let (here, next) = (wave(theta * i as f64), wave(theta * (i + 1) as f64));
        [0.25 * factor * here, if is_loop { 0.0 } else { (1.0 + 0.25 * factor) * (here + next) }]
    };
    (0..n).map(|i| [at(libm::cos, i), at(libm::sin, i)]).collect()
}

/// The tangent across a crease into k ≥ 2 faces, k + 1 spokes; it points into the faces.
pub(super) fn across_crease(k: usize, is_loop: bool) -> Weights {
    let theta = PI / k as f64;
    let wave = |i: usize| libm::sin(theta * i as f64);
    let mut spokes: Vec<f64> = (0..=k).map(wave).collect();
    spokes[k] = 0.0;
    let cot = 1.0 / libm::tan(0.5 * theta); // = Σ sin iθ
    // With w of v and q of the ends unknown, column v and column e_0 of ℓS = λℓ are
    //   w (3/4 − λ) + q = −a,   w/8 + q (1/2 − λ) = −b.
    let solve = |lambda: f64, a: f64, b: f64| {
        let det = (0.75 - lambda) * (0.5 - lambda) - 0.125;
        let w = (b - a * (0.5 - lambda)) / det;
        (w, -a - w * (0.75 - lambda))
    };
    if is_loop {
        let (vertex, end) = solve(0.375 + 0.25 * libm::cos(theta), 0.375 * cot, 0.125 * wave(1));
        spokes[0] = end;
        spokes[k] = end;
        return Weights { vertex, spokes, faces: vec![0.0; k] };
    }
    let factor = spoke_factor(theta);
    let lambda = 0.25 + factor / 16.0;
    spokes.iter_mut().for_each(|s| *s *= factor);
    let (vertex, end) = solve(lambda, (0.375 * factor + 0.5) * cot, (factor / 16.0 + 0.25) * wave(1));
    spokes[0] = end;
    spokes[k] = end;
    let faces = (0..k).map(|i| wave(i) + if i + 1 == k { 0.0 } else { wave(i + 1) }).collect();
    over_face_points(Weights { vertex, spokes, faces })
}

/// From weights of the corners f_i opposite to v to those of the face points: f_i = 4 F_i − v − e_i − e_(i+1). The spokes may
/// be one more than the faces.
fn over_face_points(mut weights: Weights) -> Weights {
    let count = weights.spokes.len();
    for (i, face) in weights.faces.iter_mut().enumerate() {
        weights.vertex -= *face;
        weights.spokes[i] -= *face;
        weights.spokes[(i + 1) % count] -= *face;
        *face *= 4.0;
    }
    weights
}

/// Faces about a vertex beyond which a crease that ends there is not looked at: the mask is the smooth one.
const MAX_DART: usize = 32;

/// Position and first tangent where one crease ends, at a vertex in n ≥ 2 faces; spoke 0 is the crease. The second tangent is
/// that of the smooth vertex, which vanishes on the crease. `None` for 32 faces or more.
///
/// There is no closed form: powers of the matrix, squared again and again, tend to the left eigenvectors, the one of 1
/// taken away and only what is symmetric about the crease kept for the tangent.
pub(super) fn dart(n: usize, is_loop: bool) -> Option<[Weights; 2]> {
    if n >= MAX_DART {
        return None;
    }
    let size = if is_loop { n + 1 } else { 2 * n + 1 };
    let (spoke, face) = (|i: usize| 1 + i % n, |i: usize| 1 + n + i % n);
    let mut matrix = vec![vec![0.0; size]; size];
    let valence = n as f64;
    if is_loop {
        let weight = super::masks::loop_weight(valence);
        matrix[0][0] = 1.0 - valence * weight;
        for i in 0..n {
            matrix[0][spoke(i)] += weight;
            for (column, weight) in [(0, 0.375), (spoke(i), 0.375), (spoke(i + 1), 0.125), (spoke(i + n - 1), 0.125)] {
                matrix[spoke(i)][column] += weight;
            }
        }
    } else {
        matrix[0][0] = (valence - 2.0) / valence;
        for i in 0..n {
            let corners = [0, spoke(i), spoke(i + 1), face(i)];
            matrix[0][spoke(i)] += 1.0 / (valence * valence);
            matrix[spoke(i)][0] += 0.25;
            matrix[spoke(i)][spoke(i)] += 0.25;
            for column in corners {
                matrix[face(i)][column] += 0.25;
                matrix[0][column] += 0.25 / (valence * valence);
                matrix[spoke(i)][column] += 0.0625;
                matrix[spoke(i + 1)][column] += 0.0625;
            }
        }
    }
    matrix[spoke(0)].fill(0.0);
    matrix[spoke(0)][0] = 0.5;
    matrix[spoke(0)][spoke(0)] = 0.5;
    let position = power(&matrix).swap_remove(0);
    let total: f64 = position.iter().sum();
    let position: Vec<f64> = position.iter().map(|x| x / total).collect();
    let mirrored = |column: usize| match column {
        0 => 0,
        c if c <= n => spoke(n - (c - 1)),
        c => face(2 * n - 1 - (c - 1 - n)),
    };
    for row in &mut matrix {
        row.iter_mut().zip(&position).for_each(|(x, p)| *x -= p);
    }
    let symmetric = |row: usize, column: usize| {
        let (r, c) = (mirrored(row), mirrored(column));
        0.25 * (matrix[row][column] + matrix[r][column] + matrix[row][c] + matrix[r][c])
    };
    let reduced: Vec<Vec<f64>> =
        (0..size).map(|row| (0..size).map(|column| symmetric(row, column)).collect()).collect();
    let norm = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>();
    let tangent = power(&reduced).into_iter().max_by(|a, b| norm(a).total_cmp(&norm(b))).expect("rows");
    let sign = tangent[spoke(0)].signum();
    let weights = |row: &[f64], sign: f64| {
        let scaled = |range: std::ops::Range<usize>| row[range].iter().map(|x| x * sign).collect::<Vec<f64>>();
        let faces = if is_loop { vec![0.0; n] } else { scaled(1 + n..size) };
        over_face_points(Weights { vertex: row[0] * sign, spokes: scaled(1..1 + n), faces })
    };
    Some([weights(&position, 1.0), weights(&tangent, sign)])
}

/// The matrix to a high power, scaled: its rows are what of its left eigenvectors is left.
fn power(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    // The second eigenvalue is below 0.97 for fewer than 32 faces: 2^12 steps leave nothing of it.
    const SQUARINGS: usize = 12;
    let mut power = matrix.to_vec();
    for _ in 0..SQUARINGS {
        let mut square = vec![vec![0.0; power.len()]; power.len()];
        for (row, out) in power.iter().zip(&mut square) {
            for (&x, other) in row.iter().zip(&power) {
                out.iter_mut().zip(other).for_each(|(o, y)| *o += x * y);
            }
        }
        let largest = square.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        if largest > 0.0 {
            square.iter_mut().flatten().for_each(|x| *x /= largest);
        }
        power = square;
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Applies the crease's rules to weights from the left: ℓS, with corners f_i.
    fn crease_step(k: usize, is_loop: bool) -> Vec<Vec<f64>> {
        let size = if is_loop { k + 2 } else { 2 * k + 2 };
        let (spoke, face) = (|i: usize| 1 + i, |i: usize| 2 + k + i);
        let mut rows = vec![vec![0.0; size]; size];
        for (row, weights) in [(0, [0.75, 0.125]), (spoke(0), [0.5, 0.5]), (spoke(k), [0.5, 0.5])] {
            rows[row][0] = weights[0];
            if row == 0 {
                rows[0][spoke(0)] = weights[1];
                rows[0][spoke(k)] = weights[1];
            } else {
                rows[row][row] = weights[1];
            }
        }
        for i in 1..k {
            if is_loop {
                for (column, weight) in [(0, 0.375), (spoke(i), 0.375), (spoke(i - 1), 0.125), (spoke(i + 1), 0.125)] {
                    rows[spoke(i)][column] += weight;
                }
            } else {
                rows[spoke(i)][0] += 0.25;
                rows[spoke(i)][spoke(i)] += 0.25;
                for f in [i - 1, i] {
                    for column in [0, spoke(f), spoke(f + 1), face(f)] {
                        rows[spoke(i)][column] += 0.0625;
                    }
                }
            }
        }
        if !is_loop {
            for i in 0..k {
                for column in [0, spoke(i), spoke(i + 1), face(i)] {
                    rows[face(i)][column] += 0.25;
                }
            }
        }
        rows
    }

    #[test]
    fn the_tangent_across_a_crease_is_a_left_eigenvector_of_its_rules() {
        for is_loop in [false, true] {
            for k in 2..9 {
                let weights = across_crease(k, is_loop);
                // Back from face points to corners.
                let mut left = vec![weights.vertex];
                left.extend(&weights.spokes);
                if !is_loop {
                    for (i, f) in weights.faces.iter().enumerate() {
                        left[0] += 0.25 * f;
                        left[1 + i] += 0.25 * f;
                        left[2 + i] += 0.25 * f;
                    }
                    left.extend(weights.faces.iter().map(|f| 0.25 * f));
                }
                let rows = crease_step(k, is_loop);
                let image: Vec<f64> =
                    (0..left.len()).map(|c| left.iter().zip(&rows).map(|(l, row)| l * row[c]).sum()).collect();
                let c = libm::cos(PI / k as f64);
                let lambda = if is_loop { 0.375 + 0.25 * c } else { 0.25 + spoke_factor(PI / k as f64) / 16.0 };
                for (x, y) in image.iter().zip(&left) {
                    assert!((x - lambda * y).abs() < 1e-13, "{is_loop} {k}: {image:?} {left:?}");
                }
                assert!(left.iter().sum::<f64>().abs() < 1e-13, "a tangent does not change with the origin");
            }
        }
    }

    #[test]
    fn the_dart_masks_are_an_eigenvector_of_one_and_a_tangent_along_the_crease() {
        for is_loop in [false, true] {
            for n in [3, 4, 5, 6, 9, 31] {
                let [position, tangent] = dart(n, is_loop).expect("few faces");
                let sum = |w: &Weights| w.vertex + w.spokes.iter().chain(&w.faces).sum::<f64>();
                assert!((sum(&position) - 1.0).abs() < 1e-12 && sum(&tangent).abs() < 1e-9, "{is_loop} {n}");
                // Points of a regular star in the plane: the tangent is along spoke 0.
                let angle = |i: f64| TAU * i / n as f64;
                let y: f64 = (0..n)
                    .map(|i| tangent.spokes[i] * angle(i as f64).sin() + tangent.faces[i] * angle(i as f64 + 0.5).sin())
                    .sum();
                let x: f64 = (0..n)
                    .map(|i| tangent.spokes[i] * angle(i as f64).cos() + tangent.faces[i] * angle(i as f64 + 0.5).cos())
                    .sum();
                assert!(x > 0.0 && y.abs() < 1e-9 * x, "{is_loop} {n}: {x} {y}");
            }
        }
    }
}
