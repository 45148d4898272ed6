//! Small meshes that stand still, triangle by triangle in one tree with all other instances: a room of a few hundred
//! triangles is one tree, not one within the other, and its triangles are sieved by four before any is asked.
//!
//! No transform is baked into what decides: a triangle that is not sifted out is asked in its own object space, as ever.

use super::Ray;
use super::mesh::Mesh;
use super::placed::{BOX_ERRORS, Frame};
use super::sieve::{PLACING, Packs};
use super::start::UNIT_ROUNDOFF;
use super::tree::{Bounds, Tree};

/// Triangles of a mesh at most: larger ones are worth a tree of their own, whose boxes are as good and whose triangles cost less memory.
const MESH: usize = 1 << 14;
/// Triangles in all, and other instances beside them.
const TRIANGLES: usize = 1 << 17;
const OTHERS: usize = 1 << 12;

/// A primitive of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) instance: u32,
    /// A triangle; `None` for the whole instance.
    pub(super) triangle: Option<u32>,
}

/// One tree over triangles and instances.
#[derive(Debug)]
pub(super) struct Fused {
    tree: Tree,
    packs: Packs,
    pieces: Vec<Piece>,
}

/// Whether the triangles of a mesh under a transform may be told apart by numbers that are rounded where the scene has the size
/// `reach`.
pub(super) fn is_fusible(mesh: &Mesh, frame: &Frame, reach: f64) -> bool {
    // Rounding of a corner, enlarged as that of the ray, in units of the largest coordinate; 2^-3 more to spare.
    let rounding = BOX_ERRORS * UNIT_ROUNDOFF * frame.condition();
    !mesh.is_deforming() && !mesh.is_empty() && mesh.len() > 4 && mesh.len() <= MESH && rounding * reach_of(mesh, frame) <= f64::from(PLACING) / 8.0 * reach
}

fn reach_of(mesh: &Mesh, frame: &Frame) -> f64 {
    let extent = mesh.bounds().map_or(0.0, |[min, max]| min.abs().max(max.abs()).max_element());
    frame.reach_of(extent)
}

impl Fused {
    /// Over meshes where they stand and the bounds of all other instances; `None` if that is not worth it.
    pub(super) fn new(meshes: &[(u32, &Mesh, &Frame)], others: &[(u32, Bounds)]) -> Option<Self> {
        let triangles: usize = meshes.iter().map(|(_, mesh, _)| mesh.len()).sum();
        if meshes.is_empty() || triangles > TRIANGLES || others.len() > OTHERS {
            return None;
        }
        let whole = others.iter().map(|&(instance, _)| Piece { instance, triangle: None });
        let of_mesh = |(number, &(instance, mesh, _)): (usize, &(u32, &Mesh, &Frame))| {
            let triangles = 0..mesh.len() as u32;
            triangles.map(move |triangle| (number, Piece { instance, triangle: Some(triangle) }))
        };
        let pieces: Vec<(usize, Piece)> =
            whole.enumerate().chain(meshes.iter().enumerate().flat_map(of_mesh)).collect();
        let corners = |&(number, Piece { triangle, .. }): &(usize, Piece)| {
            let triangle = triangle?;
            let (_, mesh, frame) = meshes[number];
            Some(mesh.corners(triangle, 0.0).map(|p| frame.point(p)))
        };
        let bounds = |i: usize| match corners(&pieces[i]) {
            None => others[i].1,
            Some([a, b, c]) => {
                let (_, mesh, frame) = meshes[pieces[i].0];
                let error = BOX_ERRORS * UNIT_ROUNDOFF * frame.condition() * reach_of(mesh, frame);
                Bounds { min: a.min(b).min(c) - error, max: a.max(b).max(c) + error }
            }
        };
        let tree = Tree::of_packs(pieces.len(), bounds);
        let packs = Packs::new(&tree, |i| corners(&pieces[i as usize]));
        Some(Self { tree, packs, pieces: pieces.into_iter().map(|(_, piece)| piece).collect() })
    }

    /// Calls `visit` with every piece that the ray may meet between the distances, as [`Tree::walk`] does.
    #[inline(always)]
    pub(super) fn walk(&self, ray: &Ray, between: [f64; 2], spread: f64, mut visit: impl FnMut(Piece) -> f64) {
        let ray = [ray.origin, ray.direction];
        self.tree.walk_sifted(&self.packs, ray, between, spread, |i, _| visit(self.pieces[i as usize]));
    }
}
