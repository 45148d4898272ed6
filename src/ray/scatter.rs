//! Refraction, total reflection and mirrors (MATH.md 2.3).

use glam::DVec3;

use super::column::Column;
use super::surface::{Curvature, LocalSurface, NormalField, Normals, UnitNormals};
use crate::math::compensated::w_squared;
use crate::optics::IorJet;

/// What happened at a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScatterKind {
    /// Transmitted by Snell's law.
    Refraction,
    /// Reflected, because nothing can be transmitted.
    TotalReflection,
    /// Reflected by a mirror.
    Mirror,
}

/// One event at a surface: the momentum before and after, and everything that the columns share.
///
/// Made by [`refract_or_reflect`] and [`mirror`] only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// What happened.
    pub kind: ScatterKind,
    /// K before.
    pub momentum_in: DVec3,
    /// K after; |K| is the index of the medium it is in.
    pub momentum_out: DVec3,
    /// The normal N that was used, unit, facing the ray: K·N < 0.
    pub normal: DVec3,
    /// How N changes over the surface; the facing sign is applied.
    pub field: NormalField,
    /// g = K·N.
    pub g: f64,
    /// W² = q + g²; not positive at total reflection; g² at a mirror.
    pub w_squared: f64,
    /// G in K⁺ = K − G N.
    pub deflection: f64,
    /// The medium before.
    pub ior_i: IorJet,
    /// The medium on the other side; at a mirror, the medium before.
    pub ior_t: IorJet,
    /// The shading normal was impossible for this ray, so the geometric one and its derivatives took its place.
    pub geometric_normal_used: bool,
    /// ∂G/∂g: G' = gain·g' + q₁/W.
    gain: f64,
    /// 1/W at a refraction, 0 at a reflection, where neither source nor second-order remainder exists.
    inv_w: f64,
}

impl Scattering {
    /// W = n₁ cos θ_t at a refraction; `None` at reflections.
    pub fn w(&self) -> Option<f64> {
        (self.kind == ScatterKind::Refraction).then(|| self.w_squared.sqrt())
    }

    /// Between equal media nothing changes, to the last bit, whatever the normal does.
    #[inline(always)]
    pub(super) fn changes_nothing(&self) -> bool {
        self.kind == ScatterKind::Refraction && self.ior_i == self.ior_t
    }

    /// The same event with the derivatives of the media by a parameter that moves the wavelength by `rate` nm.
    pub(super) fn along(&self, rate: f64) -> Self {
        Self { ior_i: self.ior_i.along(rate), ior_t: self.ior_t.along(rate), ..*self }
    }
}

/// Refracts the optical momentum at a surface, or reflects it where W² ≤ 0 (W = 0 counts as reflected).
///
/// Snell's law as conservation of the tangential momentum: K⁺ = K − G N. G = q/(W − g) is the root g + W of G² − 2gG = q
/// that transmits, without its cancellation for nearly equal indices; the other root, with q = 0, is the reflection G = 2g.
/// W² is [compensated](crate::math::compensated::w_squared) on the way out of a denser medium.
///
/// The shading normal is used unless it contradicts the geometric one, which alone decides sides: if the ray would come
/// from behind the shading normal, or leave on the wrong side of the surface, the event is redone with n_g *and* its own
/// derivatives.
///
/// |K⁺| is restored to the medium's index: an event adds the rounding of |N|² to the error it was given, and between two
/// facets of a gem it is the same rounding again and again (1.2e-14 after fifty reflections; restored, none is left).
#[inline]
pub fn refract_or_reflect(momentum: DVec3, surface: &LocalSurface, ior_i: &IorJet, ior_t: &IorJet) -> Scattering {
    with_usable_normal(momentum, surface, |normal, field| interface(momentum, normal, field, ior_i, ior_t))
}

/// Reflects the optical momentum at a mirror, whatever lies behind. The choice of normal is that of
/// [`refract_or_reflect`].
#[inline]
pub fn mirror(momentum: DVec3, surface: &LocalSurface, ior_i: &IorJet) -> Scattering {
    with_usable_normal(momentum, surface, |normal, field| {
        let g = momentum.dot(normal);
        reflection(ScatterKind::Mirror, momentum, normal, field, g, g * g, ior_i, ior_i)
    })
}

/// A momentum after an event, for whom nothing of its derivatives is needed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deflected {
    /// What happened.
    pub kind: ScatterKind,
    /// K after.
    pub momentum: DVec3,
}

/// What [`refract_or_reflect`] says of the momentum, bit by bit; without `ior_t` what [`mirror`] says.
#[inline]
pub fn deflect(momentum: DVec3, normals: &UnitNormals, ior_i: f64, ior_t: Option<f64>) -> Deflected {
    // Neither enters the momentum.
    let (curvature, field) = (Curvature::Plane, NormalField::Flat);
    let surface = LocalSurface { n_g: normals.n_g, n_s: normals.n_s, curvature, field };
    let ior_i = IorJet::constant(ior_i);
    let scattering = match ior_t {
        Some(ior_t) => refract_or_reflect(momentum, &surface, &ior_i, &IorJet::constant(ior_t)),
        None => mirror(momentum, &surface, &ior_i),
    };
    Deflected { kind: scattering.kind, momentum: scattering.momentum_out }
}

/// Applies `event` with the shading normal, or with the geometric normal where that one is impossible.
#[inline(always)]
fn with_usable_normal(
    momentum: DVec3,
    surface: &LocalSurface,
    event: impl Fn(DVec3, NormalField) -> Scattering,
) -> Scattering {
    let leaving = momentum.dot(surface.n_g) > 0.0;
    let facing = |n: DVec3| if leaving { -n } else { n };
    let (n_g, n_s) = (facing(surface.n_g), facing(surface.n_s));
    if momentum.dot(n_s) < 0.0 {
        let field = if leaving { surface.field.reversed() } else { surface.field };
        let scattering = event(n_s, field);
        let side = scattering.momentum_out.dot(n_g);
        let right_side = if scattering.kind == ScatterKind::Refraction { side < 0.0 } else { side > 0.0 };
        if right_side {
            return scattering;
        }
    }
    redo_with_geometric_normal(surface, leaving, n_g, event)
}

#[cold]
#[inline(never)]
fn redo_with_geometric_normal(
    surface: &LocalSurface,
    leaving: bool,
    n_g: DVec3,
    event: impl Fn(DVec3, NormalField) -> Scattering,
) -> Scattering {
    let field = surface.curvature.normal_field(surface.n_g);
    let mut scattering = event(n_g, if leaving { field.reversed() } else { field });
    scattering.geometric_normal_used = true;
    scattering
}

/// The event between two media at a normal that faces the ray.
#[inline(always)]
pub(super) fn interface(
    momentum: DVec3,
    normal: DVec3,
    field: NormalField,
    ior_i: &IorJet,
    ior_t: &IorJet,
) -> Scattering {
    let g = momentum.dot(normal);
    let w_squared = w_squared(ior_i.ior, ior_t.ior, g);
    if w_squared <= 0.0 {
        return reflection(ScatterKind::TotalReflection, momentum, normal, field, g, w_squared, ior_i, ior_t);
    }
    let w = w_squared.sqrt();
    let q = (ior_t.ior - ior_i.ior) * (ior_t.ior + ior_i.ior);
    let deflection = q / (w - g);
    let inv_w = 1.0 / w;
    Scattering {
        kind: ScatterKind::Refraction,
        momentum_in: momentum,
        momentum_out: deflected(momentum, normal, deflection, ior_t.ior),
        normal,
        field,
        g,
        w_squared,
        deflection,
        ior_i: *ior_i,
        ior_t: *ior_t,
        geometric_normal_used: false,
        gain: deflection * inv_w,
        inv_w,
    }
}

#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the fields of the record that it makes, in their order")]
fn reflection(
    kind: ScatterKind,
    momentum: DVec3,
    normal: DVec3,
    field: NormalField,
    g: f64,
    w_squared: f64,
    ior_i: &IorJet,
    ior_t: &IorJet,
) -> Scattering {
    let deflection = 2.0 * g;
    Scattering {
        kind,
        momentum_in: momentum,
        momentum_out: deflected(momentum, normal, deflection, ior_i.ior),
        normal,
        field,
        g,
        w_squared,
        deflection,
        ior_i: *ior_i,
        ior_t: *ior_t,
        geometric_normal_used: false,
        gain: 2.0,
        inv_w: 0.0,
    }
}

/// K − G N with its length restored to `ior` by one Newton step of 1/√; unchanged where nothing deflects.
#[inline(always)]
fn deflected(momentum: DVec3, normal: DVec3, deflection: f64, ior: f64) -> DVec3 {
    if deflection == 0.0 {
        return momentum;
    }
    let momentum = momentum - normal * deflection;
    let ior2 = ior * ior;
    let excess = momentum.length_squared() - ior2;
    momentum - momentum * (0.5 * excess / ior2)
}

/// A column after a scattering, with what its second derivative needs.
pub(super) struct Scattered {
    /// N'.
    dnormal: DVec3,
    /// g'.
    dg: f64,
    /// G'.
    ddeflection: f64,
    /// p' and K⁺'.
    pub(super) column: Column,
}

/// g' = K'·N + K·N', G' = (q₁ + g'G)/W (reflection: 2g'), K⁺' = K' − G'N − G N'. `LAMBDA`: the parameter moves the
/// wavelength, so that q₁ takes part.
#[inline(always)]
pub(super) fn scatter_first<N: Normals, const LAMBDA: bool>(s: &Scattering, normals: &N, column: &Column) -> Scattered {
    let mut dg = column.momentum.dot(s.normal);
    let mut dnormal = DVec3::ZERO;
    if !N::FLAT {
        dnormal = normals.first(column.point);
        dg += s.momentum_in.dot(dnormal);
    }
    let mut ddeflection = s.gain * dg;
    if LAMBDA {
        let q1 = s.ior_t.ior * s.ior_t.dior_dlambda - s.ior_i.ior * s.ior_i.dior_dlambda;
        ddeflection += q1 * s.inv_w;
    }
    let mut momentum = column.momentum - s.normal * ddeflection;
    if !N::FLAT {
        momentum -= dnormal * s.deflection;
    }
    Scattered { dnormal, dg, ddeflection, column: Column { point: column.point, momentum } }
}

/// g'' = K''·N + 2K'·N' + K·N'', G'' = (q₂ + g''G + 2g'G' − G'²)/W (reflection: 2g''),
/// K⁺'' = K'' − G''N − 2G'N' − G N''. `before` and `first` are the first derivative before and after the event.
#[inline(always)]
pub(super) fn scatter_second<N: Normals>(
    s: &Scattering,
    normals: &N,
    before: &Column,
    first: &Scattered,
    second: &Column,
) -> Column {
    let mut d2g = second.momentum.dot(s.normal);
    let mut d2normal = DVec3::ZERO;
    if !N::FLAT {
        d2normal = normals.second(before.point, first.dnormal, second.point);
        d2g += 2.0 * before.momentum.dot(first.dnormal) + s.momentum_in.dot(d2normal);
    }
    // Grouped by medium: equal media give exactly zero.
    let half_second = |jet: &IorJet| jet.dior_dlambda * jet.dior_dlambda + jet.ior * jet.d2ior_dlambda2;
    let q2 = half_second(&s.ior_t) - half_second(&s.ior_i);
    let remainder = q2 + first.ddeflection * (2.0 * first.dg - first.ddeflection);
    let d2deflection = s.gain * d2g + remainder * s.inv_w;
    let mut momentum = second.momentum - s.normal * d2deflection;
    if !N::FLAT {
        momentum -= first.dnormal * (2.0 * first.ddeflection) + d2normal * s.deflection;
    }
    Column { point: second.point, momentum }
}
