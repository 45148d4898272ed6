//! The limit surface at the vertices of a level: positions and normals, exactly.
//!
//! A vertex whose edges are smooth has closed forms (`tangents.rs`). Where something is sharp the neighbourhood is taken
//! down level by level, which needs nothing but itself, until no sharpness is left that ends; then the masks of what the
//! vertex is hold.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::masks::{Masks, Rule, Rules, add, combine, face_points, is_semi_sharp, specials};
use super::tangents::{self, Weights};
use super::topology::{INFINITE, Level, NONE, refined};

/// Points of the limit surface and its normals.
pub(super) struct LimitSurface {
    pub(super) points: Vec<[f64; 3]>,
    /// One a vertex, then more for vertices with several.
    pub(super) normals: Vec<[f64; 3]>,
    /// The normal of each corner; that of its vertex if absent.
    pub(super) corner_normals: Option<Vec<u32>>,
}

/// Limits of values that a level's vertices have. All faces of the level have the same number of corners.
pub(super) fn positions<const N: usize>(level: &Level, masks: Masks, values: &[[f64; N]]) -> Vec<[f64; N]> {
    if masks == Masks::Linear {
        return values.to_vec();
    }
    let rings = Rings::new(level, masks, values);
    let mut out: Vec<[f64; N]> = (0..level.vertices)
        .into_par_iter()
        .map(|vertex| match rings.valence(vertex) {
            Some(n) => rings.smooth_position(vertex, n),
            None => values[vertex],
        })
        .collect();
    let mut darts = Darts::default();
    for mut ring in rings.special_rings() {
        ring.settle(rings.is_loop());
        out[ring.vertex as usize] = ring.position(&mut darts, rings.is_loop());
    }
    out
}

/// The limit of points, with its normals.
pub(super) fn surface(level: &Level, masks: Masks, points: &[[f64; 3]]) -> LimitSurface {
    if masks == Masks::Linear {
        return bilinear(level, points);
    }
    let rings = Rings::new(level, masks, points);
    let (mut limits, mut normals): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (0..level.vertices)
        .into_par_iter()
        .map(|vertex| match rings.valence(vertex) {
            Some(n) => (rings.smooth_position(vertex, n), rings.smooth_normal(vertex, n)),
            None => (points[vertex], [0.0; 3]),
        })
        .unzip();
    let mut corner_normals: Option<Vec<u32>> = None;
    let mut darts = Darts::default();
    for mut ring in rings.special_rings() {
        ring.settle(rings.is_loop());
        let vertex = ring.vertex as usize;
        limits[vertex] = ring.position(&mut darts, rings.is_loop());
        for (i, sector) in ring.sectors().into_iter().enumerate() {
            let normal = ring.normal(&sector, &mut darts, rings.is_loop());
            if i == 0 {
                normals[vertex] = normal;
                continue;
            }
            let of_corners = corner_normals.get_or_insert_with(|| level.corner_vertex.clone());
            for &face in &sector.faces {
                of_corners[ring.faces[face].corner as usize] = normals.len() as u32;
            }
            normals.push(normal);
        }
    }
    LimitSurface { points: limits, normals, corner_normals }
}

/// A bilinear surface has at each corner the plane of the two edges.
fn bilinear(level: &Level, points: &[[f64; 3]]) -> LimitSurface {
    let at = |corner: usize| DVec3::from(points[level.corner_vertex[corner] as usize]);
    let normals: Vec<[f64; 3]> = (0..level.corner_vertex.len())
        .into_par_iter()
        .map(|corner| {
            let here = at(corner);
            unit((at(next(level, corner)) - here).cross(at(previous(level, corner)) - here))
        })
        .collect();
    let corner_normals = Some((0..normals.len() as u32).collect());
    LimitSurface { points: points.to_vec(), normals, corner_normals }
}

fn unit(v: DVec3) -> [f64; 3] {
    v.normalize_or_zero().to_array()
}

fn size(level: &Level) -> usize {
    match level.faces {
        super::topology::Faces::Uniform(n) => n as usize,
        super::topology::Faces::Offsets(_) => unreachable!("the control mesh has no limit masks"),
    }
}

fn next(level: &Level, corner: usize) -> usize {
    let n = size(level);
    if corner % n + 1 == n { corner + 1 - n } else { corner + 1 }
}

fn previous(level: &Level, corner: usize) -> usize {
    let n = size(level);
    if corner.is_multiple_of(n) { corner + n - 1 } else { corner - 1 }
}

/// The neighbourhoods of a level's vertices.
struct Rings<'a, const N: usize> {
    level: &'a Level,
    masks: Masks,
    values: &'a [[f64; N]],
    /// The next level's face points; none under Loop's scheme.
    points: Vec<[f64; N]>,
    /// A corner at each smooth vertex; [`NONE`] for others.
    start: Vec<u32>,
    /// Tangents of smooth vertices by the number of faces.
    tangents: Vec<Vec<[[f64; 2]; 2]>>,
}

/// Tangents of this many faces and more are computed where they are needed.
const TABLE: usize = 33;

impl<'a, const N: usize> Rings<'a, N> {
    fn new(level: &'a Level, masks: Masks, values: &'a [[f64; N]]) -> Self {
        let is_loop = masks == Masks::Loop;
        let mut start = vec![NONE; level.vertices];
        for (corner, &vertex) in level.corner_vertex.iter().enumerate() {
            start[vertex as usize] = corner as u32;
        }
        specials(level).iter().for_each(|s| start[s.vertex as usize] = NONE);
        Self {
            level,
            masks,
            values,
            points: if is_loop { Vec::new() } else { face_points(level, values) },
            start,
            tangents: (0..TABLE).map(|n| tangents::smooth_tangents(n.max(1), is_loop)).collect(),
        }
    }

    fn is_loop(&self) -> bool {
        self.masks == Masks::Loop
    }

    /// Calls `visit` with the corners at a smooth vertex, counter-clockwise.
    #[inline]
    fn walk(&self, vertex: usize, mut visit: impl FnMut(usize, usize)) {
        let start = self.start[vertex] as usize;
        let mut corner = start;
        for i in 0.. {
            visit(i, corner);
            let before = previous(self.level, corner) as u32;
            let [a, b] = self.level.edge_corners[self.level.corner_edge[before as usize] as usize];
            corner = if a == before { b } else { a } as usize;
            if corner == start {
                break;
            }
        }
    }

    /// How many faces meet at a smooth vertex; `None` if it is none.
    fn valence(&self, vertex: usize) -> Option<usize> {
        if self.start[vertex] == NONE {
            return None;
        }
        let mut n = 0;
        self.walk(vertex, |_, _| n += 1);
        Some(n)
    }

    fn spoke(&self, corner: usize) -> &[f64; N] {
        &self.values[self.level.corner_vertex[next(self.level, corner)] as usize]
    }

    fn face(&self, corner: usize) -> Option<&[f64; N]> {
        self.points.get(corner / size(self.level))
    }

    fn smooth_position(&self, vertex: usize, n: usize) -> [f64; N] {
        let [own, spoke, face] = tangents::smooth_position(n as f64, self.is_loop());
        let mut limit = self.values[vertex].map(|x| own * x);
        self.walk(vertex, |_, corner| {
            add(&mut limit, spoke, self.spoke(corner));
            if let Some(point) = self.face(corner) {
                add(&mut limit, face, point);
            }
        });
        limit
    }

    /// Every vertex that is sharp or has sharp edges, with what is about it.
    fn special_rings(&self) -> Vec<Ring<N>> {
        let vertices: Vec<u32> = specials(self.level).iter().map(|s| s.vertex).collect();
        if vertices.is_empty() {
            return Vec::new();
        }
        let mut corners: Vec<(u32, u32)> = Vec::new();
        let mut is_special = vec![false; self.level.vertices];
        vertices.iter().for_each(|&v| is_special[v as usize] = true);
        for (corner, &vertex) in self.level.corner_vertex.iter().enumerate() {
            if is_special[vertex as usize] {
                corners.push((vertex, corner as u32));
            }
        }
        corners.par_sort_unstable();
        corners.par_chunk_by(|a, b| a.0 == b.0).map(|group| self.ring(group)).collect()
    }

    fn ring(&self, corners: &[(u32, u32)]) -> Ring<N> {
        let level = self.level;
        let vertex = corners[0].0;
        let mut ring = Ring {
            vertex,
            value: self.values[vertex as usize],
            sharpness: level.vertex_sharpness[vertex as usize],
            spokes: Vec::with_capacity(corners.len() + 1),
            faces: Vec::with_capacity(corners.len()),
        };
        let mut index_of: HashMap<u32, usize> = HashMap::with_capacity(corners.len() + 1);
        for &(_, corner) in corners {
            let corner = corner as usize;
            let (after, before) = (next(level, corner), previous(level, corner));
            let [out, into] = [(corner, after), (before, before)].map(|(owner, end)| {
                let edge = level.corner_edge[owner];
                *index_of.entry(edge).or_insert_with(|| {
                    let end = self.values[level.corner_vertex[end] as usize];
                    ring.spokes.push(Spoke { end, sharpness: level.edge_sharpness[edge as usize] });
                    ring.spokes.len() - 1
                })
            });
            let point = self.face(corner).copied().unwrap_or([0.0; N]);
            ring.faces.push(RingFace { corner: corner as u32, out, into, point });
        }
        ring
    }
}

impl Rings<'_, 3> {
    fn smooth_normal(&self, vertex: usize, n: usize) -> [f64; 3] {
        let (mut first, mut second) = ([0.0; 3], [0.0; 3]);
        let computed;
        let weights = match self.tangents.get(n) {
            Some(weights) => weights,
            None => {
                computed = tangents::smooth_tangents(n, self.is_loop());
                &computed
            }
        };
        self.walk(vertex, |i, corner| {
            let [[a, b], [c, d]] = weights[i];
            add(&mut first, a, self.spoke(corner));
            add(&mut second, c, self.spoke(corner));
            if let Some(point) = self.face(corner) {
                add(&mut first, b, point);
                add(&mut second, d, point);
            }
        });
        unit(DVec3::from(first).cross(DVec3::from(second)))
    }
}

struct Spoke<const N: usize> {
    end: [f64; N],
    sharpness: f32,
}

struct RingFace<const N: usize> {
    corner: u32,
    /// Spoke on its right, seen from the vertex.
    out: usize,
    /// Spoke on its left.
    into: usize,
    /// The next level's face point.
    point: [f64; N],
}

/// A vertex and what is about it.
struct Ring<const N: usize> {
    vertex: u32,
    value: [f64; N],
    sharpness: f32,
    spokes: Vec<Spoke<N>>,
    faces: Vec<RingFace<N>>,
}

/// Faces side by side, counter-clockwise, that no infinitely sharp spoke parts; their spokes in order, the last of a closed
/// fan being the first.
struct Sector {
    faces: Vec<usize>,
    spokes: Vec<usize>,
}

/// Masks of vertices where one crease ends, by the number of faces.
type Darts = HashMap<usize, Option<[Weights; 2]>>;

impl<const N: usize> Ring<N> {
    /// Goes down until no sharpness is left that ends.
    fn settle(&mut self, is_loop: bool) {
        while is_semi_sharp(self.sharpness) || self.spokes.iter().any(|s| is_semi_sharp(s.sharpness)) {
            self.refine(is_loop);
        }
    }

    /// The ring at the next level.
    fn refine(&mut self, is_loop: bool) {
        let mut across = vec![[0.0; N]; self.spokes.len()];
        let mut sum = [0.0; N];
        for face in &self.faces {
            let [right, left] =
                if is_loop { [self.spokes[face.into].end, self.spokes[face.out].end] } else { [face.point; 2] };
            add(&mut across[face.out], 1.0, &right);
            add(&mut across[face.into], 1.0, &left);
            add(&mut sum, 1.0, &face.point);
        }
        self.spokes.iter().for_each(|spoke| add(&mut sum, 1.0, &spoke.end));
        let n = self.spokes.len() as f64;
        let smooth = if is_loop {
            let weight = super::masks::loop_weight(n);
            combine([(1.0 - n * weight, &self.value), (weight, &sum)])
        } else {
            combine([((n - 2.0) / n, &self.value), (1.0 / (n * n), &sum)])
        };
        let rules = Rules::new(self.sharpness, self.spokes.iter().enumerate().map(|(i, s)| (s.sharpness, i)));
        let of = |rule: Rule<usize>| match rule {
            Rule::Smooth => smooth,
            Rule::Corner => self.value,
            Rule::Crease([a, b]) => {
                combine([(0.75, &self.value), (0.125, &self.spokes[a].end), (0.125, &self.spokes[b].end)])
            }
        };
        let value = if rules.now == rules.then {
            of(rules.now)
        } else {
            combine([(rules.weight, &of(rules.now)), (1.0 - rules.weight, &of(rules.then))])
        };
        let (own, other) = if is_loop { (0.375, 0.125) } else { (0.25, 0.25) };
        for (spoke, across) in self.spokes.iter_mut().zip(&across) {
            let s = f64::from(spoke.sharpness).min(1.0);
            let middle = combine([(0.5, &self.value), (0.5, &spoke.end)]);
            let smooth = combine([(own, &self.value), (own, &spoke.end), (other, across)]);
            spoke.end = if spoke.sharpness >= 1.0 { middle } else { combine([(s, &middle), (1.0 - s, &smooth)]) };
            spoke.sharpness = refined(spoke.sharpness);
        }
        self.value = value;
        self.sharpness = refined(self.sharpness);
        if !is_loop {
            for face in &mut self.faces {
                let ends = [face.out, face.into].map(|i| self.spokes[i].end);
                face.point = combine([(0.25, &self.value), (0.25, &ends[0]), (0.25, &ends[1]), (0.25, &face.point)]);
            }
        }
    }

    fn rule(&self) -> Rule<usize> {
        Rules::new(self.sharpness, self.spokes.iter().enumerate().map(|(i, s)| (s.sharpness, i))).now
    }

    fn sum(&self, weights: &Weights, sector: &Sector) -> [f64; N] {
        let mut sum = self.value.map(|x| weights.vertex * x);
        for (&weight, &spoke) in weights.spokes.iter().zip(&sector.spokes) {
            add(&mut sum, weight, &self.spokes[spoke].end);
        }
        for (&weight, &face) in weights.faces.iter().zip(&sector.faces) {
            add(&mut sum, weight, &self.faces[face].point);
        }
        sum
    }

    fn is_dart(&self) -> bool {
        self.spokes.iter().any(|spoke| spoke.sharpness > 0.0)
    }

    fn position(&self, darts: &mut Darts, is_loop: bool) -> [f64; N] {
        match self.rule() {
            Rule::Corner => self.value,
            Rule::Crease([a, b]) => {
                let third = 1.0 / 3.0;
                combine([
                    (2.0 * third, &self.value),
                    (0.5 * third, &self.spokes[a].end),
                    (0.5 * third, &self.spokes[b].end),
                ])
            }
            Rule::Smooth => {
                let n = self.faces.len();
                let sectors = self.sectors();
                if self.is_dart()
                    && let Some([position, _]) = darts.entry(n).or_insert_with(|| tangents::dart(n, is_loop))
                    && let [sector] = sectors.as_slice()
                {
                    return self.sum(position, sector);
                }
                let [vertex, spoke, face] = tangents::smooth_position(n as f64, is_loop);
                let mut limit = self.value.map(|x| vertex * x);
                self.spokes.iter().for_each(|s| add(&mut limit, spoke, &s.end));
                self.faces.iter().for_each(|f| add(&mut limit, face, &f.point));
                limit
            }
        }
    }

    fn sectors(&self) -> Vec<Sector> {
        let mut with_out: Vec<Option<usize>> = vec![None; self.spokes.len()];
        let is_cut = |spoke: usize| self.spokes[spoke].sharpness >= INFINITE;
        for (i, face) in self.faces.iter().enumerate() {
            if !is_cut(face.out) {
                with_out[face.out] = Some(i);
            }
        }
        let mut taken = vec![false; self.faces.len()];
        let mut sectors = Vec::new();
        // Open fans first: a closed one may begin anywhere.
        let open = (0..self.faces.len()).filter(|&i| is_cut(self.faces[i].out));
        for first in open.chain(0..self.faces.len()) {
            let mut sector = Sector { faces: Vec::new(), spokes: Vec::new() };
            let mut face = Some(first);
            while let Some(i) = face.filter(|&i| !std::mem::replace(&mut taken[i], true)) {
                sector.faces.push(i);
                sector.spokes.push(self.faces[i].out);
                face = with_out[self.faces[i].into];
            }
            if let Some(&last) = sector.faces.last() {
                sector.spokes.push(self.faces[last].into);
                sectors.push(sector);
            }
        }
        sectors
    }
}

impl Ring<3> {
    fn normal(&self, sector: &Sector, darts: &mut Darts, is_loop: bool) -> [f64; 3] {
        let end = |spoke: usize| DVec3::from(self.spokes[sector.spokes[spoke]].end);
        let k = sector.faces.len();
        let tangents = match self.rule() {
            Rule::Crease(_) if k > 1 => {
                Some([end(0) - end(k), self.sum(&tangents::across_crease(k, is_loop), sector).into()])
            }
            Rule::Smooth if sector.spokes[0] == sector.spokes[k] => {
                let weights = tangents::smooth_tangents(k, is_loop);
                let tangent = |which: usize| Weights {
                    vertex: 0.0,
                    spokes: weights.iter().map(|w| w[which][0]).collect(),
                    faces: weights.iter().map(|w| w[which][1]).collect(),
                };
                let dart = if self.is_dart() {
                    darts.entry(k).or_insert_with(|| tangents::dart(k, is_loop)).as_ref()
                } else {
                    None
                };
                let first = dart.map_or_else(|| self.sum(&tangent(0), sector), |[_, along]| self.sum(along, sector));
                Some([first.into(), self.sum(&tangent(1), sector).into()])
            }
            _ => None,
        };
        let normal = tangents.map_or(DVec3::ZERO, |[a, b]| a.cross(b));
        if normal.length_squared() > 0.0 {
            return unit(normal);
        }
        // A corner, exact for one face: the sides of the faces towards the vertex, by area.
        let here = DVec3::from(self.value);
        unit((0..k).map(|i| (end(i) - here).cross(end(i + 1) - here)).sum())
    }
}
