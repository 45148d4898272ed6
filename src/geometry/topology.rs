//! Whether a mesh has an inside: every edge is passed equally often both ways.

use rayon::prelude::*;

use super::PolygonMesh;

/// Edges that do not balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Imbalance {
    /// Edges with an odd number of faces.
    pub(super) open: usize,
    /// Edges with an even number of faces that do not run against each other.
    pub(super) misoriented: usize,
}

/// Counts by vertex index and, where that does not balance, with vertices merged by exact position: exporters split
/// vertices along seams of normals and texture coordinates.
pub(super) fn imbalance(mesh: &PolygonMesh<'_>) -> Imbalance {
    let by_index = count(mesh, |point| point);
    if by_index == Imbalance::default() {
        return by_index;
    }
    let merged = merged_points(&mesh.points);
    count(mesh, |point| merged[point as usize])
}

/// For each point, the point of smallest index at the same position.
fn merged_points(points: &[[f32; 3]]) -> Vec<u32> {
    // Adding 0 turns −0 into 0.
    let key = |i: u32| points[i as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (key(i), i));
    let mut merged = vec![0; points.len()];
    let mut first = 0;
    for (at, &i) in order.iter().enumerate() {
        if at == 0 || key(i) != key(first) {
            first = i;
        }
        merged[i as usize] = first;
    }
    merged
}

fn count(mesh: &PolygonMesh<'_>, merged: impl Fn(u32) -> u32) -> Imbalance {
    // Both ends in 31 bits each, the sense of passing in the lowest bit.
    let mut edges: Vec<u64> = Vec::with_capacity(mesh.indices.len());
    for (_, first, count) in mesh.faces() {
        let corners = &mesh.indices[first..first + count];
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % count];
            let (from, to) = (u64::from(merged(from as u32)), u64::from(merged(to as u32)));
            if from != to {
                edges.push(from.min(to) << 33 | from.max(to) << 1 | u64::from(from > to));
            }
        }
    }
    edges.par_sort_unstable();
    let mut imbalance = Imbalance::default();
    for edge in edges.chunk_by(|a, b| a >> 1 == b >> 1) {
        let backward = edge.iter().filter(|&&e| e & 1 == 1).count();
        if edge.len() % 2 == 1 {
            imbalance.open += 1;
        } else if backward * 2 != edge.len() {
            imbalance.misoriented += 1;
        }
    }
    imbalance
}
