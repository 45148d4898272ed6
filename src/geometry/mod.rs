//! Shapes, instances and the trees over them: what a ray meets, and how the surface is curved there.
//!
//! Conventions: *render space* is the stage's world minus the camera position, in f64. Points stay as authored, f32 in
//! object space, and no transform is baked into them; rays go to object space instead. f32 boxes find what a ray may
//! meet (`tree.rs`, `walk.rs`), for small meshes together and with a look at their triangles (`fused.rs`, `sieve.rs`); f64 shapes
//! decide it (`triangle.rs`, `sphere.rs`, `solid.rs`), so the tree never decides what is hit. Every
//! tolerance is a rounding bound of the numbers at hand: scaling a scene by a power of two changes no bit.
//!
//! A triangle covers its border half-open, by exact signs (`triangle.rs`): a ray through an edge or a vertex of a closed
//! mesh crosses exactly the triangles that a ray infinitesimally beside it crosses.
//!
//! Limits: object-space points between about 1e-37 and 1e37 in size keep all this; f32 has no digits below.

mod aggregate;
mod asphere;
mod buffer;
mod cuboid;
mod cut;
mod departures;
mod fused;
mod instances;
mod meeting;
mod mesh;
mod motion;
mod placed;
mod polygons;
mod profile;
mod revolved;
mod sieve;
mod solid;
mod sphere;
mod start;
mod subdivision;
mod surface;
mod topology;
mod tree;
mod triangle;
mod walk;

use glam::DVec3;

pub use aggregate::Aggregate;
pub use buffer::Buffer;
pub use cuboid::{Cuboid, Rectangle};
pub use departures::Departures;
pub(crate) use instances::affine;
pub use instances::{Instance, InstanceArray, Location, Numbering, Part};
pub use mesh::{Mesh, MeshProblem, MeshReport};
pub use motion::{Deformation, PlaceSamples, Pose, Track, are_increasing};
pub(crate) use placed::is_invertible;
pub use polygons::{Interpolation, NamedPrimvar, PolygonMesh, PrimvarView};
pub(crate) use revolved::OnPiece;
pub use revolved::{Cap, Revolved};
pub use solid::{Axis, Solid};
pub use sphere::Sphere;
pub use subdivision::{
    BoundaryInterpolation, FaceVaryingInterpolation, MAX_TRIANGLES, Scheme, Subdivision, TriangleRule,
};
pub(crate) use tree::{Bounds, Tree};

/// A ray in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Unit vector along travel.
    pub direction: DVec3,
    /// When it is there, frames from the scene's own: everything it meets stands where it is at this time.
    pub time: f64,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Along the ray, ≥ 0; 0 for a surface that coincides with the one the ray stands on.
    pub distance: f64,
    /// Index of the instance.
    pub instance: u32,
    /// Triangle of the mesh, piece of the solid's surface; 0 for a sphere.
    pub primitive: u32,
    /// Weights of the triangle's second and third corner; 0 for analytic shapes.
    pub barycentric: [f64; 2],
    /// The ray leaves the shape: direction · n_g > 0 with n_g outward as authored. Never 0: a ray that only touches a
    /// surface does not meet it.
    pub leaving: bool,
    /// The surface passes through the start of the ray, up to rounding ([`Departures`] keeps what was crossed there).
    pub at_start: bool,
}

/// A shape in its object space.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "shapes stand behind an Arc, one each; a box would be a second hop")]
pub enum Shape {
    /// An analytic sphere about the origin; an ellipsoid under a transform that is no similarity.
    Sphere(Sphere),
    /// Another analytic shape.
    Solid(Solid),
    /// Triangles.
    Mesh(Mesh),
}
