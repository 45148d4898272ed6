//! Topology of one level of refinement, and how the next follows from it.
//!
//! Corners are the half-edges: corner c of a face stands at a vertex and owns the edge from there to the face's next
//! vertex. A child is numbered by what it comes from, so that nothing is searched after the first level: vertices are
//! the parent's vertices, then its edges, then (quads only) its faces; the halves of edge e are 2e and 2e + 1, in the order
//! of its ends; the edges inside faces follow, one a corner.

use rayon::prelude::*;

/// Edges and vertices of this sharpness and more stay sharp for ever (as in OpenSubdiv).
pub(super) const INFINITE: f32 = 10.0;
/// Where no index is.
pub(super) const NONE: u32 = u32::MAX;

/// The corners of the faces.
#[derive(Debug)]
pub(super) enum Faces {
    /// All have this many.
    Uniform(u32),
    /// First corner of each face, and the number of all corners.
    Offsets(Vec<u32>),
}

/// Faces, edges and vertices with their sharpness.
#[derive(Debug)]
pub(super) struct Level {
    pub(super) faces: Faces,
    pub(super) vertices: usize,
    /// The vertex of each corner.
    pub(super) corner_vertex: Vec<u32>,
    /// The edge from each corner to the next of its face.
    pub(super) corner_edge: Vec<u32>,
    pub(super) edges: Vec<[u32; 2]>,
    /// Two of the corners that own the edge, [`NONE`] where there is none: all of them where it is not infinitely sharp.
    pub(super) edge_corners: Vec<[u32; 2]>,
    /// Boundaries and edges that are no manifold are infinitely sharp.
    pub(super) edge_sharpness: Vec<f32>,
    pub(super) vertex_sharpness: Vec<f32>,
}

/// Sharpness a level further down.
pub(super) fn refined(sharpness: f32) -> f32 {
    if sharpness >= INFINITE { sharpness } else { (sharpness - 1.0).max(0.0) }
}

impl Level {
    /// Smooth but for boundaries and what is no manifold.
    pub(super) fn new(offsets: Vec<u32>, corner_vertex: Vec<u32>, vertices: usize) -> Self {
        let next = next_corners(&offsets);
        let mut keyed: Vec<(u64, u32)> = (0..corner_vertex.len())
            .into_par_iter()
            .map(|corner| {
                let [a, b] = [corner_vertex[corner], corner_vertex[next[corner] as usize]];
                (u64::from(a.min(b)) << 32 | u64::from(a.max(b)), corner as u32)
            })
            .collect();
        keyed.par_sort_unstable();
        let mut level = Self {
            faces: Faces::Offsets(offsets),
            vertices,
            corner_edge: vec![0; corner_vertex.len()],
            corner_vertex,
            edges: Vec::new(),
            edge_corners: Vec::new(),
            edge_sharpness: Vec::new(),
            vertex_sharpness: vec![0.0; vertices],
        };
        for group in keyed.chunk_by(|a, b| a.0 == b.0) {
            let edge = level.edges.len() as u32;
            let ends = [(group[0].0 >> 32) as u32, group[0].0 as u32];
            for &(_, corner) in group {
                level.corner_edge[corner as usize] = edge;
            }
            let start = |i: usize| level.corner_vertex[group[i].1 as usize];
            let is_manifold = group.len() == 2 && ends[0] != ends[1] && start(0) != start(1);
            level.edges.push(ends);
            level.edge_corners.push([group[0].1, group.get(1).map_or(NONE, |g| g.1)]);
            level.edge_sharpness.push(if is_manifold { 0.0 } else { INFINITE });
        }
        let nonmanifold = NonManifold::find(&level, &next);
        for vertex in nonmanifold.vertices {
            level.vertex_sharpness[vertex as usize] = INFINITE;
        }
        level
    }

    pub(super) fn face_count(&self) -> usize {
        match &self.faces {
            Faces::Uniform(n) => self.corner_vertex.len() / *n as usize,
            Faces::Offsets(offsets) => offsets.len() - 1,
        }
    }

    /// The corners of a face.
    pub(super) fn corners(&self, face: usize) -> std::ops::Range<usize> {
        match &self.faces {
            Faces::Uniform(n) => face * *n as usize..(face + 1) * *n as usize,
            Faces::Offsets(offsets) => offsets[face] as usize..offsets[face + 1] as usize,
        }
    }

    /// The level with each face divided into one quad for each of its corners: its vertex, the edge after it, the face,
    /// the edge before it. The child face has the number of the corner.
    pub(super) fn divided_into_quads(&self) -> Self {
        let (vertices, edges, corners) = (self.vertices as u32, self.edges.len() as u32, self.corner_vertex.len());
        let mut corner_vertex = Vec::with_capacity(4 * corners);
        let mut corner_edge = Vec::with_capacity(4 * corners);
        let mut ends = self.halves(corners);
        for face in 0..self.face_count() {
            let range = self.corners(face);
            let middle = vertices + edges + face as u32;
            for corner in range.clone() {
                let before = if corner == range.start { range.end - 1 } else { corner - 1 };
                let [out, into] = [self.corner_edge[corner], self.corner_edge[before]];
                let vertex = self.corner_vertex[corner];
                corner_vertex.extend([vertex, vertices + out, middle, vertices + into]);
                let inner = |corner: usize| 2 * edges + corner as u32;
                corner_edge.extend([self.half(out, vertex), inner(corner), inner(before), self.half(into, vertex)]);
                ends.push([vertices + out, middle]);
            }
        }
        let count = self.vertices + self.edges.len() + self.face_count();
        self.child(Faces::Uniform(4), count, corner_vertex, corner_edge, ends)
    }

    /// The level with each triangle divided into those at its corners and the one between them, in this order.
    pub(super) fn divided_into_triangles(&self) -> Self {
        let (vertices, edges, corners) = (self.vertices as u32, self.edges.len() as u32, self.corner_vertex.len());
        let mut corner_vertex = Vec::with_capacity(4 * corners);
        let mut corner_edge = Vec::with_capacity(4 * corners);
        let mut ends = self.halves(corners);
        for (face, (v, e)) in self.corner_vertex.chunks_exact(3).zip(self.corner_edge.chunks_exact(3)).enumerate() {
            // The edge that cuts off corner k.
            let inner = |k: usize| 2 * edges + (3 * face + k) as u32;
            for k in 0..3 {
                let [out, into] = [e[k], e[(k + 2) % 3]];
                corner_vertex.extend([v[k], vertices + out, vertices + into]);
                corner_edge.extend([self.half(out, v[k]), inner(k), self.half(into, v[k])]);
                ends.push([vertices + out, vertices + into]);
            }
            corner_vertex.extend([vertices + e[0], vertices + e[1], vertices + e[2]]);
            corner_edge.extend([inner(1), inner(2), inner(0)]);
        }
        self.child(Faces::Uniform(3), self.vertices + self.edges.len(), corner_vertex, corner_edge, ends)
    }

    /// The ends of the halves of all edges, with room for `more`.
    fn halves(&self, more: usize) -> Vec<[u32; 2]> {
        let mut ends = Vec::with_capacity(2 * self.edges.len() + more);
        for (edge, &[a, b]) in self.edges.iter().enumerate() {
            let middle = (self.vertices + edge) as u32;
            ends.extend([[a, middle], [middle, b]]);
        }
        ends
    }

    /// The half of an edge at one of its ends.
    fn half(&self, edge: u32, vertex: u32) -> u32 {
        2 * edge + u32::from(self.edges[edge as usize][0] != vertex)
    }

    fn child(
        &self,
        faces: Faces,
        vertices: usize,
        corner_vertex: Vec<u32>,
        corner_edge: Vec<u32>,
        edges: Vec<[u32; 2]>,
    ) -> Self {
        let mut edge_corners = vec![[NONE; 2]; edges.len()];
        for (corner, &edge) in corner_edge.iter().enumerate() {
            let pair = &mut edge_corners[edge as usize];
            pair[usize::from(pair[0] != NONE)] = corner as u32;
        }
        let mut edge_sharpness: Vec<f32> = self.edge_sharpness.iter().flat_map(|&s| [refined(s); 2]).collect();
        edge_sharpness.resize(edges.len(), 0.0);
        let mut vertex_sharpness: Vec<f32> = self.vertex_sharpness.iter().map(|&s| refined(s)).collect();
        vertex_sharpness.resize(vertices, 0.0);
        Self { faces, vertices, corner_vertex, corner_edge, edges, edge_corners, edge_sharpness, vertex_sharpness }
    }
}

/// The corner after each corner in its face.
pub(super) fn next_corners(offsets: &[u32]) -> Vec<u32> {
    let mut next: Vec<u32> = (1..=*offsets.last().expect("offsets end with the number of corners")).collect();
    for face in offsets.windows(2) {
        if face[0] < face[1] {
            next[face[1] as usize - 1] = face[0];
        }
    }
    next
}

/// Where the faces about a vertex are no disc and no half disc.
struct NonManifold {
    /// Those whose neighbourhood no curve through them continues.
    vertices: Vec<u32>,
}

impl NonManifold {
    fn find(level: &Level, next: &[u32]) -> Self {
        #[derive(Clone, Copy, Default)]
        struct About {
            corners: u32,
            /// Edges that join two faces here.
            links: u32,
            boundaries: u32,
            /// Edges with more than two faces, or two that do not run against each other.
            broken: u32,
            repeated: bool,
            first: u32,
        }
        let mut about = vec![About::default(); level.vertices];
        for (corner, &vertex) in level.corner_vertex.iter().enumerate() {
            let about = &mut about[vertex as usize];
            about.corners += 1;
            about.first = corner as u32;
        }
        let mut faces = vec![0_u32; level.edges.len()];
        level.corner_edge.iter().for_each(|&edge| faces[edge as usize] += 1);
        for ((ends, &sharpness), faces) in level.edges.iter().zip(&level.edge_sharpness).zip(faces) {
            for &end in ends {
                let about = &mut about[end as usize];
                match faces {
                    _ if sharpness < INFINITE => about.links += 1,
                    1 if ends[0] != ends[1] => about.boundaries += 1,
                    _ => about.broken += 1,
                }
            }
        }
        if let Faces::Offsets(offsets) = &level.faces {
            let mut seen: Vec<u32> = Vec::new();
            for face in offsets.windows(2) {
                seen.clear();
                seen.extend(&level.corner_vertex[face[0] as usize..face[1] as usize]);
                seen.sort_unstable();
                seen.windows(2).filter(|w| w[0] == w[1]).for_each(|w| about[w[0] as usize].repeated = true);
            }
        }
        let mut previous = vec![0; next.len()];
        next.iter().enumerate().for_each(|(corner, &next)| previous[next as usize] = corner as u32);
        let is_one_closed_fan = |about: &About| {
            let (mut corner, mut steps) = (about.first, 0);
            loop {
                let before = previous[corner as usize];
                let [a, b] = level.edge_corners[level.corner_edge[before as usize] as usize];
                corner = if a == before { b } else { a };
                steps += 1;
                if corner == about.first || steps > about.corners {
                    return steps == about.corners;
                }
            }
        };
        let is_broken = |about: &About| {
            if about.repeated {
                return true;
            }
            match (about.broken, about.boundaries) {
                (0, 0) if about.corners == 0 => false,
                (0, 0) => !is_one_closed_fan(about),
                // One open fan has one link less than corners, and no closed fan beside it.
                (0, 2) => about.links + 1 != about.corners,
                // Fins along a curve through the vertex: every fan goes from one edge to the other.
                (2, 0) => about.links >= about.corners || about.corners - about.links < 3,
                _ => true,
            }
        };
        let vertices = about.iter().enumerate().filter(|(_, about)| is_broken(about)).map(|(v, _)| v as u32).collect();
        Self { vertices }
    }
}
