//! A surface near one of its points, as far as two derivatives of a ray need it.

use glam::{DMat3, DVec3};

/// How a surface bends away from its tangent plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curvature {
    /// Not at all: a triangle, a plane.
    Plane,
    /// A sphere with n_g pointing away from its centre (`inv_radius` > 0) or towards it (< 0).
    Sphere {
        /// 1/r, in 1/stage unit.
        inv_radius: f64,
    },
    /// A level set f = 0 of a quadratic f with ∇f along n_g.
    Quadric {
        /// The Hessian of f divided by |∇f|, in 1/stage unit; symmetric.
        hessian: DMat3,
    },
}

impl Curvature {
    /// κ = n_g·q'', what the surface demands of the second derivative of a point that moves on it with q'
    /// (MATH.md 2.4).
    #[inline]
    pub fn normal_acceleration(&self, dpoint: DVec3) -> f64 {
        match self {
            Self::Plane => 0.0,
            Self::Sphere { inv_radius } => -dpoint.length_squared() * inv_radius,
            Self::Quadric { hessian } => -dpoint.dot(*hessian * dpoint),
        }
    }

    /// The field of the geometric normal `n_g` itself.
    ///
    /// Its second derivative is that of the surface as long as ∇f is linear, which it is for planes, spheres and quadrics.
    pub fn normal_field(&self, n_g: DVec3) -> NormalField {
        match *self {
            Self::Plane => NormalField::Flat,
            Self::Sphere { inv_radius } => NormalField::Sphere { inv_radius },
            // n_g = ∇f/|∇f| and d(∇f) = H dq; dividing both by |∇f| at this point leaves S = n_g.
            Self::Quadric { hessian } => NormalField::Linear { vector: n_g, gradient: hessian },
        }
    }
}

/// How the shading normal changes over the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalField {
    /// Not at all.
    Flat,
    /// N' = q'/r, N'' = q''/r: the normal of a sphere.
    Sphere {
        /// 1/r, in 1/stage unit; negative if the normal points towards the centre.
        inv_radius: f64,
    },
    /// N = S/|S| with S linear in position: interpolated vertex normals, quadrics.
    Linear {
        /// S at the point.
        vector: DVec3,
        /// ∂S/∂q: S' = `gradient`·q', S'' = `gradient`·q''.
        gradient: DMat3,
    },
    /// N = S/|S| with S = ∇f of a surface of revolution: aspheres. With v = `radial`·q' and w = `around`·q',
    /// S' = f_rr v `radial` + f_tt w `around`, and S'' has besides the same of q'' the term
    /// (f_rrr v² + f_rtt w²) `radial` + 2 f_rtt v w `around`.
    Revolved {
        /// S at the point.
        vector: DVec3,
        /// Covector of the direction away from the axis.
        radial: DVec3,
        /// Covector of the direction around the axis.
        around: DVec3,
        /// f_rr and f_tt.
        second: [f64; 2],
        /// f_rrr and f_rtt.
        third: [f64; 2],
    },
}

impl NormalField {
    /// The field of −N.
    #[inline]
    pub fn reversed(&self) -> Self {
        match *self {
            Self::Flat => Self::Flat,
            Self::Sphere { inv_radius } => Self::Sphere { inv_radius: -inv_radius },
            Self::Linear { vector, gradient } => Self::Linear { vector: -vector, gradient: -gradient },
            Self::Revolved { vector, radial, around, second, third } => {
                let negative = |[a, b]: [f64; 2]| [-a, -b];
                Self::Revolved { vector: -vector, radial, around, second: negative(second), third: negative(third) }
            }
        }
    }
}

/// A surface at the point where a ray meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalSurface {
    /// Geometric unit normal, outward as authored. It alone decides which side a ray is on.
    pub n_g: DVec3,
    /// Shading unit normal, n_s·n_g > 0.
    pub n_s: DVec3,
    /// Of the geometric surface.
    pub curvature: Curvature,
    /// Of `n_s`.
    pub field: NormalField,
}

impl LocalSurface {
    /// Its normals alone.
    pub fn normals(&self) -> UnitNormals {
        UnitNormals { n_g: self.n_g, n_s: self.n_s }
    }
}

/// A surface as far as a ray needs it that carries no derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitNormals {
    /// As [`LocalSurface::n_g`].
    pub n_g: DVec3,
    /// As [`LocalSurface::n_s`].
    pub n_s: DVec3,
}

/// The derivatives of a unit normal at a point that moves. Types rather than an enum, so that the kind is decided once
/// per event and not once per column.
pub(super) trait Normals {
    /// All derivatives are zero.
    const FLAT: bool;
    /// N' where the point moves with q' = `dpoint`.
    fn first(&self, dpoint: DVec3) -> DVec3;
    /// N'' where it moves with q' and q''; `dnormal` is N'.
    fn second(&self, dpoint: DVec3, dnormal: DVec3, d2point: DVec3) -> DVec3;
}

pub(super) struct FlatNormals;

impl Normals for FlatNormals {
    const FLAT: bool = true;

    #[inline(always)]
    fn first(&self, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    #[inline(always)]
    fn second(&self, _: DVec3, _: DVec3, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }
}

pub(super) struct SphereNormals {
    pub(super) inv_radius: f64,
}

impl Normals for SphereNormals {
    const FLAT: bool = false;

    #[inline(always)]
    fn first(&self, dpoint: DVec3) -> DVec3 {
        dpoint * self.inv_radius
    }

    #[inline(always)]
    fn second(&self, _: DVec3, _: DVec3, d2point: DVec3) -> DVec3 {
        d2point * self.inv_radius
    }
}

pub(super) struct LinearNormals {
    normal: DVec3,
    length: f64,
    inv_length: f64,
    gradient: DMat3,
}

impl LinearNormals {
    #[inline(always)]
    pub(super) fn new(normal: DVec3, vector: DVec3, gradient: DMat3) -> Self {
        let length = vector.length();
        // Vertex normals that cancel leave no S to normalise: the normal then is the given one and does not move.
        let inv_length = if length > 0.0 { 1.0 / length } else { 0.0 };
        Self { normal, length, inv_length, gradient }
    }
}

impl Normals for LinearNormals {
    const FLAT: bool = false;

    /// N' = (S' − (N·S') N)/|S|.
    #[inline(always)]
    fn first(&self, dpoint: DVec3) -> DVec3 {
        let s1 = self.gradient * dpoint;
        (s1 - self.normal * self.normal.dot(s1)) * self.inv_length
    }

    /// N'' = (S'' − 2L'N' − L''N)/L with L = |S|, L' = N·S' and L'' = L|N'|² + N·S'', which is MATH.md's
    /// (|S'|² + S·S'' − L'²)/L without its cancellation.
    #[inline(always)]
    fn second(&self, dpoint: DVec3, dnormal: DVec3, d2point: DVec3) -> DVec3 {
        let l1 = self.normal.dot(self.gradient * dpoint);
        let s2 = self.gradient * d2point;
        let l2 = self.length * dnormal.length_squared() + self.normal.dot(s2);
        (s2 - dnormal * (2.0 * l1) - self.normal * l2) * self.inv_length
    }
}

pub(super) struct RevolvedNormals {
    linear: LinearNormals,
    radial: DVec3,
    around: DVec3,
    third: [f64; 2],
}

impl RevolvedNormals {
    #[inline(always)]
    pub(super) fn new(
        normal: DVec3,
        vector: DVec3,
        [radial, around]: [DVec3; 2],
        second: [f64; 2],
        third: [f64; 2],
    ) -> Self {
        let outer = |u: DVec3, v: DVec3| DMat3::from_cols(u * v.x, u * v.y, u * v.z);
        let gradient = outer(radial * second[0], radial) + outer(around * second[1], around);
        Self { linear: LinearNormals::new(normal, vector, gradient), radial, around, third }
    }
}

impl Normals for RevolvedNormals {
    const FLAT: bool = false;

    #[inline(always)]
    fn first(&self, dpoint: DVec3) -> DVec3 {
        self.linear.first(dpoint)
    }

    /// That of the linear field, and the part of S'' that is quadratic in q', projected like any S''.
    #[inline(always)]
    fn second(&self, dpoint: DVec3, dnormal: DVec3, d2point: DVec3) -> DVec3 {
        let (v, w) = (self.radial.dot(dpoint), self.around.dot(dpoint));
        let [rrr, rtt] = self.third;
        let s2 = self.radial * (rrr * v * v + rtt * w * w) + self.around * (2.0 * rtt * v * w);
        let normal = self.linear.normal;
        self.linear.second(dpoint, dnormal, d2point) + (s2 - normal * normal.dot(s2)) * self.linear.inv_length
    }
}

/// A normal whose derivative is given, not derived from the motion of a point.
pub(super) struct GivenNormals {
    pub(super) dnormal: DVec3,
}

impl Normals for GivenNormals {
    const FLAT: bool = false;

    #[inline(always)]
    fn first(&self, _: DVec3) -> DVec3 {
        self.dnormal
    }

    /// Not needed by anyone who gives first derivatives only.
    #[inline(always)]
    fn second(&self, _: DVec3, _: DVec3, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }
}
