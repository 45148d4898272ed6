//! Face-varying values: a topology of their own, in which a point is a vertex once for each value it has.
//!
//! Values with the same index are one value at one point only; where faces disagree about an edge there is a seam, and a seam
//! is a boundary of this topology. What stays sharp at boundaries is `faceVaryingLinearInterpolation`, with OpenSubdiv's
//! meaning of each option.

use rayon::prelude::*;

use super::masks::Masks;
use super::topology::{Faces, INFINITE, Level, NONE};
use super::{FaceVaryingInterpolation, Refiner, limit};

/// Refined face-varying values.
pub(crate) struct FaceVarying<const N: usize> {
    pub(crate) values: Vec<[f64; N]>,
    /// The value of each refined corner; that of its point if absent.
    pub(crate) indices: Option<Vec<i32>>,
}

impl Refiner {
    /// Refines values given by an index for each authored corner.
    pub(crate) fn face_varying<const N: usize>(
        &self,
        index_of: impl Fn(usize) -> u32 + Sync,
        values: &[[f64; N]],
    ) -> FaceVarying<N> {
        let base = &self.levels[0];
        // A vertex for each pair of point and index.
        let mut pairs: Vec<(u64, u32)> = base
            .corner_vertex
            .par_iter()
            .enumerate()
            .map(|(corner, &vertex)| {
                let index = index_of(self.corners[corner] as usize);
                (u64::from(vertex) << 32 | u64::from(index), corner as u32)
            })
            .collect();
        pairs.par_sort_unstable();
        let mut corner_value = vec![0; pairs.len()];
        let mut vertex_of: Vec<u32> = Vec::new();
        let mut control: Vec<[f64; N]> = Vec::new();
        let distinct = pairs.chunk_by(|a, b| a.0 == b.0).count();
        let corners_of_points = pairs.chunk_by(|a, b| a.0 >> 32 == b.0 >> 32).count();
        // One value at every point: the topology is that of the points.
        let is_same = distinct == corners_of_points && !self.changes_boundaries();
        for group in pairs.chunk_by(|a, b| a.0 == b.0) {
            for &(_, corner) in group {
                corner_value[corner as usize] = vertex_of.len() as u32;
            }
            vertex_of.push((group[0].0 >> 32) as u32);
            control.push(values[group[0].0 as u32 as usize]);
        }
        drop(pairs);
        if is_same {
            let mut of_points = vec![[0.0; N]; base.vertices];
            vertex_of.iter().zip(&control).for_each(|(&v, value)| of_points[v as usize] = *value);
            return FaceVarying { values: self.values(of_points, super::Interpolation::Vertex), indices: None };
        }
        let masks = if self.face_varying == FaceVaryingInterpolation::All { Masks::Linear } else { self.masks };
        let levels = self.value_levels(corner_value, &vertex_of);
        let values = self.at_last_level(&levels, masks, control);
        let last = &levels[levels.len() - 1];
        let values = limit::positions(last, masks, &values);
        FaceVarying { values, indices: Some(last.corner_vertex.iter().map(|&i| i as i32).collect()) }
    }

    /// Whether values without a seam can follow other rules than points.
    fn changes_boundaries(&self) -> bool {
        let base = &self.levels[0];
        match self.face_varying {
            FaceVaryingInterpolation::All => self.masks != Masks::Linear,
            FaceVaryingInterpolation::None => false,
            _ => base.edge_corners.iter().any(|corners| corners[1] == NONE),
        }
    }

    fn value_levels(&self, corner_value: Vec<u32>, vertex_of: &[u32]) -> Vec<Level> {
        let points = &self.levels[0];
        let is_loop = matches!(points.faces, Faces::Uniform(_));
        let offsets = match &points.faces {
            Faces::Offsets(offsets) => offsets.clone(),
            Faces::Uniform(n) => (0..=points.face_count() as u32).map(|face| face * n).collect(),
        };
        let mut base = Level::new(offsets, corner_value, vertex_of.len());
        if is_loop {
            base.faces = Faces::Uniform(3);
        }
        // Creases and corners of the points are those of their values.
        for (corner, &edge) in base.corner_edge.iter().enumerate() {
            let sharpness = points.edge_sharpness[points.corner_edge[corner] as usize];
            let kept = &mut base.edge_sharpness[edge as usize];
            *kept = kept.max(sharpness);
        }
        for (sharpness, &point) in base.vertex_sharpness.iter_mut().zip(vertex_of) {
            *sharpness = sharpness.max(points.vertex_sharpness[point as usize]);
        }
        self.sharpen_values(&mut base, vertex_of);
        let mut levels = vec![base];
        for _ in 1..self.levels.len() {
            let last = &levels[levels.len() - 1];
            levels.push(if is_loop { last.divided_into_triangles() } else { last.divided_into_quads() });
        }
        levels
    }

    fn sharpen_values(&self, base: &mut Level, vertex_of: &[u32]) {
        use FaceVaryingInterpolation as Rule;
        #[derive(Clone, Copy, Default)]
        struct Span {
            faces: u32,
            at_boundary: bool,
            has_infinite: bool,
            semi_sharp: f32,
        }
        let points = &self.levels[0];
        let mut spans = vec![Span::default(); base.vertices];
        base.corner_vertex.iter().for_each(|&v| spans[v as usize].faces += 1);
        for ((ends, corners), &sharpness) in base.edges.iter().zip(&base.edge_corners).zip(&base.edge_sharpness) {
            let owner = points.corner_edge[corners[0] as usize] as usize;
            let is_seam = corners[1] == NONE && points.edge_corners[owner][1] != NONE;
            for &end in ends {
                let span = &mut spans[end as usize];
                if corners[1] == NONE {
                    span.at_boundary |= is_seam || points.edge_corners[owner][1] == NONE;
                } else if sharpness >= INFINITE {
                    span.has_infinite = true;
                } else {
                    span.semi_sharp = span.semi_sharp.max(sharpness);
                }
            }
        }
        let mut values_of: Vec<Vec<u32>> = Vec::new();
        let mut group = vec![NONE; points.vertices];
        for (value, &point) in vertex_of.iter().enumerate() {
            let slot = &mut group[point as usize];
            if *slot == NONE {
                *slot = values_of.len() as u32;
                values_of.push(Vec::new());
            }
            values_of[*slot as usize].push(value as u32);
        }
        let mut is_boundary_point = vec![false; points.vertices];
        for (ends, corners) in points.edges.iter().zip(&points.edge_corners) {
            if corners[1] == NONE {
                ends.iter().for_each(|&v| is_boundary_point[v as usize] = true);
            }
        }
        let rule = self.face_varying;
        let has_dependent = matches!(rule, Rule::CornersPlus1 | Rule::CornersPlus2);
        for values in values_of {
            // Values that no seam and no boundary touches follow their point.
            if !values.iter().any(|&v| spans[v as usize].at_boundary) {
                continue;
            }
            let point = vertex_of[values[0] as usize] as usize;
            let of = |v: u32| spans[v as usize];
            let all = rule == Rule::Boundaries
                || (has_dependent && values.len() > 2)
                || (rule == Rule::CornersPlus2 && values.len() == 1 && !is_boundary_point[point])
                || (has_dependent && values.len() == 2 && values.iter().any(|&v| of(v).has_infinite))
                || (rule == Rule::CornersPlus2 && values.len() == 2 && values.iter().any(|&v| of(v).faces == 1));
            for (i, &value) in values.iter().enumerate() {
                let span = of(value);
                let kept = &mut base.vertex_sharpness[value as usize];
                if all || span.has_infinite || (span.faces == 1 && rule != Rule::None) {
                    *kept = INFINITE;
                } else if has_dependent && values.len() == 2 {
                    // Sharp as long as a crease inside the other region is.
                    let other = of(values[1 - i]);
                    if span.semi_sharp <= 0.0 && other.semi_sharp > 0.0 {
                        *kept = kept.max(other.semi_sharp);
                    }
                }
            }
        }
    }
}
