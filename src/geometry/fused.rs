//! Small meshes that stand still, triangle by triangle in one tree with all other instances: a room of a few hundred
//! triangles is one tree, not one within the other, and its triangles are sieved by four before any is asked.
//!
//! No transform is baked into what decides: a triangle that is not sifted out is asked in its own object space, as ever.

use std::ops::Range;

use super::Ray;
use super::mesh::Mesh;
use super::placed::{BOX_ERRORS, Frame};
use super::sieve::{PLACING, Packs};
use super::start::UNIT_ROUNDOFF;
use super::tree::{Bounds, Tree};

/// Triangles of a mesh at most: on the way to one of so many, getting ready for a second tree is little, and here a
/// triangle costs 40 bytes or more beside its box.
const MESH: usize = 1 << 14;
/// Triangles in all, and other instances beside them at most: about 10 MB. Fewer triangles are as well off in the boxes of their meshes
/// (`benches/RESULTS.md`, `diffuse` and `ball`: 8 of them, 2 and 8 % more instructions fused; `gem`: 88, 17 % less).
const TRIANGLES: Range<usize> = 32..1 << 17;
pub(super) const OTHERS: usize = 1 << 12;

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
    !mesh.is_deforming()
        && !mesh.is_empty()
        && mesh.len() <= MESH
        && rounding * reach_of(mesh, frame) <= f64::from(PLACING) / 8.0 * reach
}

fn reach_of(mesh: &Mesh, frame: &Frame) -> f64 {
    let extent = mesh.bounds().map_or(0.0, |[min, max]| min.abs().max(max.abs()).max_element());
    frame.reach_of(extent)
}

impl Fused {
    /// Over meshes where they stand and the bounds of all other instances; `None` if that is not worth it.
    pub(super) fn new(meshes: &[(u32, &Mesh, &Frame)], others: &[(u32, Bounds)]) -> Option<Self> {
        let triangles: usize = meshes.iter().map(|(_, mesh, _)| mesh.len()).sum();
        if !TRIANGLES.contains(&triangles) {
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DAffine3, DQuat, DVec3};

    use super::super::{Aggregate, Buffer, Departures, Instance, PolygonMesh, Shape, Sphere};
    use super::*;

    /// Even numbers in −1..1.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let z = (self.0 >> 33 ^ self.0).wrapping_mul(0xff51_afd7_ed55_8ccd);
            (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }

        fn point(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next())
        }

        fn direction(&mut self) -> DVec3 {
            std::iter::repeat_with(|| self.point()).find(|p| (0.01..1.0).contains(&p.length())).unwrap().normalize()
        }
    }

    fn mesh(points: Vec<[f32; 3]>, indices: Vec<i32>) -> Arc<Shape> {
        let counts = vec![3; indices.len() / 3];
        let polygons = PolygonMesh::bare("/Mesh", Buffer::from_vec(points), &counts, Buffer::from_vec(indices));
        Arc::new(Shape::Mesh(Mesh::from_polygons(&polygons).unwrap().0))
    }

    fn octahedron() -> Arc<Shape> {
        let points = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
        let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        mesh(points, faces.concat())
    }

    /// Octahedra under transforms of all kinds, two of them face to face, a floor that one stands on, and a ball.
    fn scene(numbers: &mut Numbers) -> Aggregate {
        let shape = octahedron();
        let mut place = |_| {
            let turn = DQuat::from_axis_angle(numbers.direction(), 3.0 * numbers.next());
            let scale = DVec3::new(1.5 + numbers.next(), 1.5 + numbers.next(), -1.5 + numbers.next());
            DAffine3::from_scale_rotation_translation(scale, turn, 6.0 * numbers.point())
        };
        let mut places: Vec<DAffine3> = (0..8).map(&mut place).collect();
        places.extend([DVec3::ZERO, DVec3::splat(2.0 / 3.0), 5.0 * DVec3::Y].map(DAffine3::from_translation));
        let mut instances: Vec<Instance> =
            places.into_iter().map(|p| Instance { shape: Arc::clone(&shape), world_from_object: p.into() }).collect();
        let floor = vec![[-9., 4., -9.], [9., 4., -9.], [9., 4., 9.], [-9., 4., 9.]];
        let floor = mesh(floor, vec![0, 2, 1, 0, 3, 2]);
        instances.push(Instance { shape: floor, world_from_object: DAffine3::IDENTITY.into() });
        let ball = Arc::new(Shape::Sphere(Sphere::new(1.5).unwrap()));
        let place = DAffine3::from_translation(DVec3::new(0.0, -2.0, 1.0));
        instances.push(Instance { shape: ball, world_from_object: place.into() });
        Aggregate::build(&instances, DVec3::splat(0.1))
    }

    #[test]
    fn paths_meet_what_they_meet_without_it() {
        let mut numbers = Numbers(7);
        let fused = scene(&mut numbers);
        let mut plain = scene(&mut Numbers(7));
        assert!(plain.fused.take().is_some() && fused.fused.is_some());
        let mut met = 0;
        for i in 0..4000 {
            let origin = 8.0 * numbers.point();
            // At corners and edges, too: of the octahedron in the middle.
            let aim = match i % 4 {
                0 => DVec3::X - DVec3::splat(0.1),
                1 => DVec3::new(0.5, 0.5, 0.0) - DVec3::splat(0.1),
                _ => 4.0 * numbers.point(),
            };
            let mut ray = Ray { origin, direction: (aim - origin).normalize(), time: 0.0 };
            let mut departures = Departures::none();
            for _ in 0..12 {
                let hit = plain.intersect(&ray, &departures);
                assert_eq!(fused.intersect(&ray, &departures), hit, "{ray:?}");
                for limit in [0.5, 3.0, f64::INFINITY] {
                    let blocks = |aggregate: &Aggregate| {
                        aggregate.is_blocked(&ray, &departures, limit, |hit| hit.instance % 3 != 0 || hit.leaving)
                    };
                    assert_eq!(blocks(&fused), blocks(&plain), "{ray:?} {limit}");
                }
                let Some(hit) = hit else { break };
                met += 1;
                let (point, surface) = plain.local_surface(&ray, &hit);
                let direction = if numbers.next() < 0.0 { ray.direction } else { numbers.direction() };
                departures.depart(&ray, &hit, direction.dot(surface.n_g) > 0.0);
                ray = Ray { origin: point, direction, ..ray };
            }
        }
        assert!(met > 8000, "{met}");
    }

    #[test]
    fn rays_that_are_no_numbers_meet_nothing() {
        let mut numbers = Numbers(7);
        let mut scenes = [scene(&mut numbers), scene(&mut Numbers(7))];
        scenes[1].fused = None;
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for axis in 0..6 {
                let mut parts = [0.5, 0.1, -0.2, 0.6, 0.0, 0.8];
                parts[axis] = bad;
                let [origin, direction] = [0, 3].map(|first| DVec3::from_slice(&parts[first..]));
                let ray = Ray { origin, direction, time: 0.0 };
                for scene in &scenes {
                    let hit = scene.intersect(&ray, &Departures::none());
                    assert!(hit.is_none_or(|hit| !hit.distance.is_nan()), "{ray:?} {hit:?}");
                    scene.is_blocked(&ray, &Departures::none(), 2.0, |_| false);
                }
            }
        }
    }

    #[test]
    fn little_and_much_are_left_as_they_are() {
        let one = |count: usize| {
            let instance = Instance { shape: octahedron(), world_from_object: DAffine3::IDENTITY.into() };
            Aggregate::build(&vec![instance; count], DVec3::ZERO).fused.is_some()
        };
        assert_eq!([1, 3, 4, 100, 17_000].map(one), [false, false, true, true, false]);
    }
}
