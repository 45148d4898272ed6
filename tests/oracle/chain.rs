//! What a ray meets, in plain numbers: the common input of the oracle and of the product.

use glam::{DMat3, DVec3};

/// A dispersion law; coefficients as authored (λ in micrometres).
#[derive(Clone, Debug)]
pub enum Law {
    Constant(f64),
    /// n = A + B λ⁻² + C λ⁻⁴ + …
    Cauchy(Vec<f64>),
    /// n² = 1 + Σ Bλ²/(λ² − C)
    Sellmeier {
        b: Vec<f64>,
        c: Vec<f64>,
    },
    /// n² = 1 + constant + Σ Bλ²/(λ² − C²)
    SellmeierSquared {
        constant: f64,
        b: Vec<f64>,
        c: Vec<f64>,
    },
    /// Cauchy law through n_d with the Abbe number V_d.
    AbbeNumber {
        nd: f64,
        vd: f64,
    },
    /// n_d + factor (n − n_d)
    Scaled(Box<Law>, f64),
}

impl Law {
    /// Schott N-BK7.
    pub fn bk7() -> Self {
        Self::Sellmeier {
            b: vec![1.03961212, 0.231792344, 1.01046945],
            c: vec![0.00600069867, 0.0200179144, 103.560653],
        }
    }

    /// Schott SF66, a very dispersive flint.
    pub fn sf66() -> Self {
        Self::Sellmeier { b: vec![2.0784223, 0.407120032, 1.76711292], c: vec![0.0180875134, 0.0679493572, 215.266127] }
    }

    /// n(λ) in f64, for the construction of cases only.
    pub fn ior(&self, nanometers: f64) -> f64 {
        super::trace::ior(self, &super::real::Real::new(nanometers)).to_f64()
    }
}

/// A surface. Normals point to the side that `n_g` of the product points to.
#[derive(Clone, Debug)]
pub enum Surface {
    Plane {
        point: DVec3,
        normal: DVec3,
    },
    /// `inward`: the normal points to the centre (a mirrored transform).
    Sphere {
        center: DVec3,
        radius: f64,
        inward: bool,
    },
    /// |A (q − c)| = 1
    Quadric {
        center: DVec3,
        matrix: DMat3,
    },
    /// The infinite continuation of a triangle, flat or with vertex normals.
    Triangle {
        corners: [DVec3; 3],
        normals: Option<[DVec3; 3]>,
    },
}

/// Which of the (at most two) crossings along the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Root {
    First,
    Second,
}

/// What the surface does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// An interface to the medium of this index; total reflection where Snell's law has no solution.
    Interface(usize),
    /// Reflection that stays in the medium.
    Mirror,
}

#[derive(Clone, Debug)]
pub struct Event {
    pub surface: Surface,
    pub root: Root,
    pub action: Action,
}

/// The ray as a function of the screen: origin = origin + x·origin_x + y·origin_y, D = look + x·right + y·up.
#[derive(Clone, Debug)]
pub struct Start {
    pub origin: DVec3,
    pub origin_x: DVec3,
    pub origin_y: DVec3,
    pub look: DVec3,
    pub right: DVec3,
    pub up: DVec3,
}

impl Start {
    /// A pinhole that looks along `look` with a focal length in pixels.
    pub fn pinhole(origin: DVec3, look: DVec3, focal_length: f64) -> Self {
        let (right, up) = look.normalize().any_orthonormal_pair();
        let pixel = look.length() / focal_length;
        Self { origin, origin_x: DVec3::ZERO, origin_y: DVec3::ZERO, look, right: right * pixel, up: up * pixel }
    }
}

/// A ray, the surfaces that it meets in order, and the surface on which it ends.
#[derive(Clone, Debug)]
pub struct Chain {
    pub start: Start,
    pub media: Vec<Law>,
    pub first_medium: usize,
    pub events: Vec<Event>,
    /// Where the ray ends: transfer only.
    pub receiver: Surface,
    pub receiver_root: Root,
    pub nanometers: f64,
}
