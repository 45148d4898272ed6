//! Columns of the ray's Jacobian, and the sets of them that a render carries.

use glam::DVec3;

use super::scatter::{Scattering, scatter_first, scatter_second};
use super::surface::{FlatNormals, LinearNormals, NormalField, Normals, RevolvedNormals, SphereNormals};
use super::transfer::{Segment, Transfer};
use crate::optics::IorJet;

/// How the state of a ray moves when one parameter moves: a column of its Jacobian.
///
/// The parameter is pixel x, pixel y (per pixel) or wavelength (per nanometre); the column does not know which.
/// Every event has one function for all columns; only the wavelength column receives a source term.
/// A second derivative is a column too, per square of the parameter's unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Column {
    /// ∂p/∂s, stage units per unit of the parameter.
    pub point: DVec3,
    /// ∂K/∂s of the optical momentum K = ior · direction, per unit of the parameter.
    pub momentum: DVec3,
}

/// Where a ray begins, and how its beginning moves with the pixel (MATH.md 2.5). Derivatives are per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayStart {
    /// p.
    pub point: DVec3,
    /// Unit direction d.
    pub direction: DVec3,
    /// ∂p/∂x: zero for a pinhole.
    pub point_x: DVec3,
    /// ∂p/∂y.
    pub point_y: DVec3,
    /// ∂d/∂x.
    pub direction_x: DVec3,
    /// ∂d/∂y.
    pub direction_y: DVec3,
    /// ∂²d/∂x².
    pub direction_xx: DVec3,
    /// ∂²d/∂x∂y.
    pub direction_xy: DVec3,
    /// ∂²d/∂y².
    pub direction_yy: DVec3,
    /// When, frames from the scene's own; the whole chain is traced at this time.
    pub time: f64,
}

/// d' = (K' − n' d)/n, the derivative of the unit direction; `dior` is 0 for pixel x and y.
#[inline]
pub fn direction_derivative(column_momentum: DVec3, direction: DVec3, ior: f64, dior: f64) -> DVec3 {
    (column_momentum - direction * dior) / ior
}

/// d'' = (K'' − n'' d − 2n' d')/n, the second derivative of the unit direction; `ddirection` is d'.
#[inline]
pub fn direction_second_derivative(
    column_momentum2: DVec3,
    direction: DVec3,
    ddirection: DVec3,
    medium: &IorJet,
) -> DVec3 {
    (column_momentum2 - direction * medium.d2ior_dlambda2 - ddirection * (2.0 * medium.dior_dlambda)) / medium.ior
}

mod sealed {
    use super::{Normals, Scattering};

    /// Closed, because the hot loop is compiled once per set.
    pub trait Sealed {}

    /// The part of scattering that is compiled once per kind of normal field.
    pub(in crate::ray) trait Scatter {
        fn scatter_with<N: Normals>(&mut self, s: &Scattering, normals: &N);
    }
}

use sealed::Scatter;

/// The columns that a render carries along each ray, as a type.
///
/// A column that several sets have gets the same bits in all of them.
pub trait ColumnSet: sealed::Sealed + Copy + Send + Sync + 'static {
    /// ∂/∂λ is carried.
    const LAMBDA: bool;
    /// ∂/∂x and ∂/∂y are carried.
    const SCREEN: bool;
    /// ∂²/∂λ² is carried.
    const SECOND: bool;

    /// The columns where the ray starts, inside of `medium`.
    fn start(start: &RayStart, medium: &IorJet) -> Self;

    /// Moves on to the next surface.
    fn transfer(&mut self, t: &Transfer);

    /// Refracts or reflects at the surface.
    fn scatter(&mut self, s: &Scattering);

    /// ∂/∂λ, per nm.
    fn lambda(&self) -> Option<&Column>;

    /// ∂/∂x and ∂/∂y, per pixel.
    fn screen(&self) -> Option<[&Column; 2]>;

    /// ∂²p/∂λ² and ∂²K/∂λ², per nm².
    fn lambda2(&self) -> Option<&Column>;
}

/// Nothing is carried: the clean plate, a scene without glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoColumns;

/// ∂λ alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LambdaColumn {
    lambda: Column,
}

/// ∂x, ∂y, ∂λ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScreenColumns {
    x: Column,
    y: Column,
    lambda: Column,
}

/// ∂x, ∂y, ∂λ and ∂²λ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SecondOrderColumns {
    first: ScreenColumns,
    lambda2: Column,
}

/// Decides the kind of normal field once per event.
#[inline(always)]
fn scatter_any<C: Scatter>(columns: &mut C, s: &Scattering) {
    match s.field {
        NormalField::Flat => columns.scatter_with(s, &FlatNormals),
        NormalField::Sphere { inv_radius } => columns.scatter_with(s, &SphereNormals { inv_radius }),
        NormalField::Linear { vector, gradient } => {
            columns.scatter_with(s, &LinearNormals::new(s.normal, vector, gradient));
        }
        NormalField::Revolved { vector, radial, around, second, third } => {
            columns.scatter_with(s, &RevolvedNormals::new(s.normal, vector, [radial, around], second, third));
        }
    }
}

/// K = n d, K_λ = n' d: inside a medium the momentum changes with wavelength from the start.
#[inline(always)]
fn start_lambda(start: &RayStart, medium: &IorJet) -> Column {
    Column { point: DVec3::ZERO, momentum: start.direction * medium.dior_dlambda }
}

impl sealed::Sealed for NoColumns {}

impl ColumnSet for NoColumns {
    const LAMBDA: bool = false;
    const SCREEN: bool = false;
    const SECOND: bool = false;

    #[inline(always)]
    fn start(_: &RayStart, _: &IorJet) -> Self {
        Self
    }

    #[inline(always)]
    fn transfer(&mut self, _: &Transfer) {}

    #[inline(always)]
    fn scatter(&mut self, _: &Scattering) {}

    #[inline(always)]
    fn lambda(&self) -> Option<&Column> {
        None
    }

    #[inline(always)]
    fn screen(&self) -> Option<[&Column; 2]> {
        None
    }

    #[inline(always)]
    fn lambda2(&self) -> Option<&Column> {
        None
    }
}

impl sealed::Sealed for LambdaColumn {}

impl Scatter for LambdaColumn {
    #[inline(always)]
    fn scatter_with<N: Normals>(&mut self, s: &Scattering, normals: &N) {
        self.lambda = scatter_first::<N, true>(s, normals, &self.lambda).column;
    }
}

impl ColumnSet for LambdaColumn {
    const LAMBDA: bool = true;
    const SCREEN: bool = false;
    const SECOND: bool = false;

    #[inline]
    fn start(start: &RayStart, medium: &IorJet) -> Self {
        Self { lambda: start_lambda(start, medium) }
    }

    #[inline]
    fn transfer(&mut self, t: &Transfer) {
        self.lambda = Segment::new(t).first::<true>(&self.lambda).column;
    }

    #[inline]
    fn scatter(&mut self, s: &Scattering) {
        if !s.changes_nothing() {
            scatter_any(self, s);
        }
    }

    #[inline]
    fn lambda(&self) -> Option<&Column> {
        Some(&self.lambda)
    }

    #[inline]
    fn screen(&self) -> Option<[&Column; 2]> {
        None
    }

    #[inline]
    fn lambda2(&self) -> Option<&Column> {
        None
    }
}

impl sealed::Sealed for ScreenColumns {}

impl Scatter for ScreenColumns {
    #[inline(always)]
    fn scatter_with<N: Normals>(&mut self, s: &Scattering, normals: &N) {
        self.x = scatter_first::<N, false>(s, normals, &self.x).column;
        self.y = scatter_first::<N, false>(s, normals, &self.y).column;
        self.lambda = scatter_first::<N, true>(s, normals, &self.lambda).column;
    }
}

impl ColumnSet for ScreenColumns {
    const LAMBDA: bool = true;
    const SCREEN: bool = true;
    const SECOND: bool = false;

    #[inline]
    fn start(start: &RayStart, medium: &IorJet) -> Self {
        Self {
            x: Column { point: start.point_x, momentum: start.direction_x * medium.ior },
            y: Column { point: start.point_y, momentum: start.direction_y * medium.ior },
            lambda: start_lambda(start, medium),
        }
    }

    #[inline]
    fn transfer(&mut self, t: &Transfer) {
        let segment = Segment::new(t);
        self.x = segment.first::<false>(&self.x).column;
        self.y = segment.first::<false>(&self.y).column;
        self.lambda = segment.first::<true>(&self.lambda).column;
    }

    #[inline]
    fn scatter(&mut self, s: &Scattering) {
        if !s.changes_nothing() {
            scatter_any(self, s);
        }
    }

    #[inline]
    fn lambda(&self) -> Option<&Column> {
        Some(&self.lambda)
    }

    #[inline]
    fn screen(&self) -> Option<[&Column; 2]> {
        Some([&self.x, &self.y])
    }

    #[inline]
    fn lambda2(&self) -> Option<&Column> {
        None
    }
}

impl sealed::Sealed for SecondOrderColumns {}

impl Scatter for SecondOrderColumns {
    #[inline(always)]
    fn scatter_with<N: Normals>(&mut self, s: &Scattering, normals: &N) {
        self.first.x = scatter_first::<N, false>(s, normals, &self.first.x).column;
        self.first.y = scatter_first::<N, false>(s, normals, &self.first.y).column;
        let before = self.first.lambda;
        let first = scatter_first::<N, true>(s, normals, &before);
        self.lambda2 = scatter_second(s, normals, &before, &first, &self.lambda2);
        self.first.lambda = first.column;
    }
}

impl ColumnSet for SecondOrderColumns {
    const LAMBDA: bool = true;
    const SCREEN: bool = true;
    const SECOND: bool = true;

    #[inline]
    fn start(start: &RayStart, medium: &IorJet) -> Self {
        Self {
            first: ScreenColumns::start(start, medium),
            lambda2: Column { point: DVec3::ZERO, momentum: start.direction * medium.d2ior_dlambda2 },
        }
    }

    #[inline]
    fn transfer(&mut self, t: &Transfer) {
        let segment = Segment::new(t);
        self.first.x = segment.first::<false>(&self.first.x).column;
        self.first.y = segment.first::<false>(&self.first.y).column;
        let first = segment.first::<true>(&self.first.lambda);
        self.lambda2 = segment.second(&first, &self.lambda2);
        self.first.lambda = first.column;
    }

    #[inline]
    fn scatter(&mut self, s: &Scattering) {
        if !s.changes_nothing() {
            scatter_any(self, s);
        }
    }

    #[inline]
    fn lambda(&self) -> Option<&Column> {
        self.first.lambda()
    }

    #[inline]
    fn screen(&self) -> Option<[&Column; 2]> {
        self.first.screen()
    }

    #[inline]
    fn lambda2(&self) -> Option<&Column> {
        Some(&self.lambda2)
    }
}

/// One parameter with its second derivative, without the others: what [`second_order_along`](super::second_order_along)
/// carries.
#[derive(Clone, Copy)]
pub(super) struct SecondOrderColumn {
    pub(super) first: Column,
    pub(super) second: Column,
}

impl SecondOrderColumn {
    pub(super) fn transfer(&mut self, t: &Transfer) {
        let segment = Segment::new(t);
        let first = segment.first::<true>(&self.first);
        self.second = segment.second(&first, &self.second);
        self.first = first.column;
    }

    pub(super) fn scatter(&mut self, s: &Scattering) {
        if !s.changes_nothing() {
            scatter_any(self, s);
        }
    }
}

impl Scatter for SecondOrderColumn {
    fn scatter_with<N: Normals>(&mut self, s: &Scattering, normals: &N) {
        let first = scatter_first::<N, true>(s, normals, &self.first);
        self.second = scatter_second(s, normals, &self.first, &first, &self.second);
        self.first = first.column;
    }
}
