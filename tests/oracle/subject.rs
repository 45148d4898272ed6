//! The product on trial: its columns carried along a [`Chain`] in `f64`.
//!
//! Intersections are the plain textbook ones, written here in the forms that do not cancel; everything about
//! derivatives, normals' derivatives and scattering comes from the product.

use super::{
    chain::{Action, Chain, Law, Root, Start, Surface},
    trace::Kind,
};
use abbe::{
    optics::{IorJet, dispersion::Dispersion},
    ray::{
        ColumnSet, Curvature, LocalSurface, NormalField, RayStart, ScatterKind, Scattering, Step, Transfer, mirror,
        refract_or_reflect,
    },
    spectrum::Wavelength,
};
use glam::{DMat3, DVec3};

/// The product's law for an authored one; its refusal where the coefficients are no glass.
pub fn dispersion(law: &Law) -> Result<Dispersion, String> {
    match law {
        Law::Constant(n) => Dispersion::constant(*n),
        Law::Cauchy(coefficients) => Dispersion::cauchy(coefficients),
        Law::Sellmeier { b, c } => Dispersion::sellmeier(b, c),
        Law::SellmeierSquared { constant, b, c } => Dispersion::sellmeier_squared(*constant, b, c),
        Law::AbbeNumber { nd, vd } => Dispersion::from_abbe_number(*nd, *vd),
        Law::Scaled(inner, factor) => dispersion(inner)?.scaled(*factor),
    }
}

/// The camera's ray and its screen derivatives: D = look + x·right + y·up, d = D/|D| (L = |D|, so that L d = D).
pub fn ray_start(start: &Start, x: f64, y: f64) -> RayStart {
    let d_unnormalised = start.look + x * start.right + y * start.up;
    let length = d_unnormalised.length();
    let d = d_unnormalised / length;
    let first = |axis: DVec3| d.cross(axis.cross(d)) / length;
    let (length_x, length_y) = (d.dot(start.right), d.dot(start.up));
    let (d_x, d_y) = (first(start.right), first(start.up));
    // (L d)_ab = 0 since D is linear.
    let second = |a: DVec3, d_a: DVec3, d_b: DVec3, l_a: f64, l_b: f64| {
        let l_ab = d_b.dot(a);
        -(d_b * l_a + d_a * l_b + d * l_ab) / length
    };
    RayStart {
        point: start.origin + x * start.origin_x + y * start.origin_y,
        direction: d,
        point_x: start.origin_x,
        point_y: start.origin_y,
        direction_x: d_x,
        direction_y: d_y,
        direction_xx: second(start.right, d_x, d_x, length_x, length_x),
        direction_xy: second(start.right, d_x, d_y, length_x, length_y),
        direction_yy: second(start.up, d_y, d_y, length_y, length_y),
        time: 0.0,
    }
}

/// A chain prepared for many traces.
pub struct Subject<'a> {
    chain: &'a Chain,
    laws: Vec<Dispersion>,
}

/// What the product found at the chain's end and on the way.
pub struct Run<C> {
    pub start: RayStart,
    pub first_medium: IorJet,
    pub columns: C,
    /// Columns before and after every transfer.
    pub transfers: Vec<[C; 2]>,
    pub steps: Vec<Step>,
    /// The medium of every transfer.
    pub media: Vec<usize>,
    pub point: DVec3,
    pub direction: DVec3,
    pub momentum: DVec3,
    pub medium: IorJet,
    pub n_g: DVec3,
}

impl<C> Run<C> {
    pub fn kinds(&self) -> Vec<Kind> {
        self.steps
            .iter()
            .filter_map(|step| step.scattering.as_ref())
            .map(|s| match s.kind {
                ScatterKind::Refraction => Kind::Refraction,
                ScatterKind::TotalReflection => Kind::TotalReflection,
                ScatterKind::Mirror => Kind::Mirror,
            })
            .collect()
    }
}

impl<'a> Subject<'a> {
    pub fn new(chain: &'a Chain) -> Self {
        Self { chain, laws: chain.media.iter().map(|law| dispersion(law).expect("cases use valid laws")).collect() }
    }

    /// The chain's own ray.
    pub fn run<C: ColumnSet>(&self) -> Option<Run<C>> {
        self.at(0.0, 0.0, self.chain.nanometers)
    }

    /// The ray of another pixel offset or wavelength; None where it misses a surface.
    pub fn at<C: ColumnSet>(&self, x: f64, y: f64, nanometers: f64) -> Option<Run<C>> {
        let chain = self.chain;
        let wavelength = Wavelength::from_nanometers(nanometers);
        let jets: Vec<IorJet> = self.laws.iter().map(|law| law.at(wavelength)).collect();
        let start = ray_start(&chain.start, x, y);
        let mut medium = chain.first_medium;
        let mut columns = C::start(&start, &jets[medium]);
        let (mut point, mut direction) = (start.point, start.direction);
        let mut momentum = direction * jets[medium].ior;
        let mut steps = Vec::new();
        let mut transfers = Vec::new();
        let mut media = Vec::new();
        for event in &chain.events {
            let (distance, reached, surface) = hit(&event.surface, event.root, point, direction)?;
            let transfer =
                Transfer { distance, direction, medium: jets[medium], n_g: surface.n_g, curvature: surface.curvature };
            let before = columns;
            columns.transfer(&transfer);
            transfers.push([before, columns]);
            media.push(medium);
            point = reached;
            let scattering = match event.action {
                Action::Mirror => mirror(momentum, &surface, &jets[medium]),
                Action::Interface(beyond) => refract_or_reflect(momentum, &surface, &jets[medium], &jets[beyond]),
            };
            columns.scatter(&scattering);
            if let (ScatterKind::Refraction, Action::Interface(beyond)) = (scattering.kind, event.action) {
                medium = beyond;
            }
            momentum = scattering.momentum_out;
            direction = momentum.normalize();
            steps.push(Step { transfer, scattering: Some(scattering) });
        }
        let (distance, reached, surface) = hit(&chain.receiver, chain.receiver_root, point, direction)?;
        let transfer =
            Transfer { distance, direction, medium: jets[medium], n_g: surface.n_g, curvature: surface.curvature };
        let before = columns;
        columns.transfer(&transfer);
        transfers.push([before, columns]);
        media.push(medium);
        steps.push(Step { transfer, scattering: None });
        Some(Run {
            first_medium: jets[chain.first_medium],
            start,
            columns,
            transfers,
            steps,
            media,
            point: reached,
            direction,
            momentum,
            medium: jets[medium],
            n_g: surface.n_g,
        })
    }

    /// The jets of all media at the chain's wavelength.
    pub fn jets(&self) -> Vec<IorJet> {
        self.laws.iter().map(|law| law.at(Wavelength::from_nanometers(self.chain.nanometers))).collect()
    }
}

/// W² and g of a scattering, for comparisons.
pub fn w_squared(scattering: &Scattering) -> f64 {
    scattering.w_squared
}

/// A distance that is zero but for rounding counts as zero: coincident surfaces are met one after the other.
fn ahead(t: f64, p: DVec3, reach: f64) -> Option<f64> {
    let rounding = 16.0 * f64::EPSILON * (p.length() + reach);
    (t.is_finite() && t >= -rounding).then_some(t.max(0.0))
}

/// Distance, hit point and local surface where a line meets a surface.
pub fn hit(surface: &Surface, root: Root, p: DVec3, d: DVec3) -> Option<(f64, DVec3, LocalSurface)> {
    match surface {
        Surface::Plane { point, normal } => {
            let n = normal.normalize();
            let t = ahead(n.dot(*point - p) / n.dot(d), p, point.length())?;
            Some((t, p + t * d, flat(n)))
        }
        Surface::Sphere { center, radius, inward } => {
            let o = p - *center;
            let t = quadratic(1.0, o, d, *radius, root)?;
            // Not projected onto the sphere: that would round by the size of the centre, off the ray.
            let reached = p + t * d;
            let outward = (reached - *center).normalize();
            let sign = if *inward { -1.0 } else { 1.0 };
            let inv_radius = sign / radius;
            let n = sign * outward;
            let local = LocalSurface {
                n_g: n,
                n_s: n,
                curvature: Curvature::Sphere { inv_radius },
                field: NormalField::Sphere { inv_radius },
            };
            Some((t, reached, local))
        }
        Surface::Quadric { center, matrix } => {
            let (o, u) = (*matrix * (p - *center), *matrix * d);
            let t = quadratic(u.length(), o, u, 1.0, root)?;
            let reached = p + t * d;
            let away = reached - *center;
            let hessian = 2.0 * matrix.transpose().mul_mat3(matrix);
            let gradient = hessian * away;
            let length = gradient.length();
            let n = gradient / length;
            let local = LocalSurface {
                n_g: n,
                n_s: n,
                curvature: Curvature::Quadric { hessian: hessian * (1.0 / length) },
                field: NormalField::Linear { vector: gradient, gradient: hessian },
            };
            Some((t, reached, local))
        }
        Surface::Triangle { corners: [a, b, c], normals } => {
            let (e1, e2) = (*b - *a, *c - *a);
            let m = e1.cross(e2);
            let n = m.normalize();
            let t = ahead(n.dot(*a - p) / n.dot(d), p, a.length())?;
            let point = p + t * d;
            let local = match normals {
                None => flat(n),
                Some([s0, s1, s2]) => {
                    let m2 = m.length_squared();
                    let (beta1, beta2) = (e2.cross(m) / m2, m.cross(e1) / m2);
                    let v = point - *a;
                    let vector = *s0 + beta1.dot(v) * (*s1 - *s0) + beta2.dot(v) * (*s2 - *s0);
                    let gradient = outer(*s1 - *s0, beta1) + outer(*s2 - *s0, beta2);
                    let sign = vector.dot(n).signum();
                    let (vector, gradient) = (sign * vector, sign * gradient);
                    LocalSurface {
                        n_g: n,
                        n_s: vector.normalize(),
                        curvature: Curvature::Plane,
                        field: NormalField::Linear { vector, gradient },
                    }
                }
            };
            Some((t, point, local))
        }
    }
}

fn flat(n: DVec3) -> LocalSurface {
    LocalSurface { n_g: n, n_s: n, curvature: Curvature::Plane, field: NormalField::Flat }
}

/// a bᵀ
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Where |o + t u| = radius, with |u| = speed.
fn quadratic(speed: f64, o: DVec3, u: DVec3, radius: f64, root: Root) -> Option<f64> {
    let direction = u / speed;
    let b = o.dot(direction);
    // The distance of the line from the centre as a vector, which does not cancel.
    let offset = (o - b * direction).length();
    let discriminant = (radius - offset) * (radius + offset);
    if discriminant < 0.0 {
        return None;
    }
    let s = discriminant.sqrt();
    let distance = o.length();
    let c = (distance - radius) * (distance + radius);
    let large = -b - if b < 0.0 { -s } else { s };
    let (low, high) = if large > 0.0 { (c / large, large) } else { (large, c / large) };
    let t = if root == Root::First { low } else { high } / speed;
    ahead(t, o / speed, radius / speed)
}
