//! An optical bench for tests: surfaces in the order the ray meets them, closed-form intersections, nothing shared with the
//! renderer's geometry.

use abbe::optics::{Dispersion, IorJet};
use abbe::ray::{
    ColumnSet, Curvature, LocalSurface, NormalField, RayStart, ScatterKind, Step, Transfer, mirror, refract_or_reflect,
};
use abbe::spectrum::Wavelength;
use glam::{DMat3, DVec3};

/// N-BK7 (SCHOTT).
pub(crate) fn bk7() -> Dispersion {
    Dispersion::sellmeier(&[1.03961212, 0.231792344, 1.01046945], &[0.00600069867, 0.0200179144, 103.560653]).unwrap()
}

/// SF66 (SCHOTT).
pub(crate) fn sf66() -> Dispersion {
    Dispersion::sellmeier(&[2.0784223, 0.407120032, 1.76711292], &[0.0180875134, 0.0679493572, 215.266127]).unwrap()
}

/// Numbers in 0..1 (SplitMix64, Steele et al. 2014): the same on every machine.
pub(crate) fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }
}

/// A unit vector, anywhere.
pub(crate) fn unit(next: &mut impl FnMut() -> f64) -> DVec3 {
    loop {
        let v = DVec3::new(next(), next(), next()) * 2.0 - DVec3::ONE;
        if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
            return v.normalize();
        }
    }
}

/// Focal length of the camera in pixels.
const FOCAL: f64 = 1000.0;

/// A pinhole camera at `point` looking along `direction`: D = look + x right + y up, d = D/|D|.
pub(crate) fn start(point: DVec3, direction: DVec3) -> RayStart {
    let (right, up) = frame(direction);
    pinhole(point, direction, right / FOCAL, up / FOCAL, 0.0, 0.0)
}

fn frame(direction: DVec3) -> (DVec3, DVec3) {
    let right = direction.any_orthonormal_vector();
    (right, right.cross(direction))
}

fn pinhole(point: DVec3, look: DVec3, right: DVec3, up: DVec3, x: f64, y: f64) -> RayStart {
    let big_d = look + right * x + up * y;
    let inv = 1.0 / big_d.length();
    let d = big_d * inv;
    // d = D/|D|: d_a = (D_a − d(d·D_a))/|D|, d_ab = −(d_b(d·D_a) + d(d_b·D_a) + d_a(d·D_b))/|D|.
    let first = |a: DVec3| (a - d * d.dot(a)) * inv;
    let (d_x, d_y) = (first(right), first(up));
    let second = |a: DVec3, d_a: DVec3, b: DVec3, d_b: DVec3| -(d_b * d.dot(a) + d * d_b.dot(a) + d_a * d.dot(b)) * inv;
    RayStart {
        point,
        direction: d,
        point_x: DVec3::ZERO,
        point_y: DVec3::ZERO,
        direction_x: d_x,
        direction_y: d_y,
        direction_xx: second(right, d_x, right, d_x),
        direction_xy: second(right, d_x, up, d_y),
        direction_yy: second(up, d_y, up, d_y),
        time: 0.0,
    }
}

/// A surface.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// Through `point` with unit `normal`.
    Plane { point: DVec3, normal: DVec3 },
    /// A sphere.
    Sphere { center: DVec3, radius: f64 },
    /// An ellipsoid with half axes along x, y, z.
    Ellipsoid { center: DVec3, half_axes: DVec3 },
}

/// What happens at a surface; `None` is n = 1.
#[derive(Clone, Debug)]
pub(crate) enum Event {
    /// Between the medium outside (where the normal points) and the one inside.
    Interface { outside: Option<Dispersion>, inside: Option<Dispersion> },
    /// A mirror.
    Mirror,
    /// Nothing: the ray ends.
    End,
}

/// A surface with its event, and whether the ray meets it at its first or second intersection.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub(crate) shape: Shape,
    pub(crate) event: Event,
    pub(crate) far: bool,
}

/// Surfaces in the order in which the ray meets them.
#[derive(Clone, Debug)]
pub(crate) struct Bench {
    pub(crate) name: String,
    pub(crate) start: RayStart,
    look: DVec3,
    pub(crate) elements: Vec<Element>,
}

/// A ray on its way through a bench.
pub(crate) struct Trace<C> {
    bench: Bench,
    wavelength: Wavelength,
    medium: IorJet,
    pub(crate) point: DVec3,
    pub(crate) momentum: DVec3,
    pub(crate) columns: C,
    pub(crate) log: Vec<Step>,
    pub(crate) events: usize,
}

impl Bench {
    fn new(name: &str, point: DVec3, look: DVec3, elements: Vec<Element>) -> Self {
        let look = look.normalize();
        Self { name: name.to_owned(), start: start(point, look), look, elements }
    }

    /// The same bench seen at another pixel.
    pub(crate) fn moved(&self, x: f64, y: f64) -> Self {
        let (right, up) = frame(self.look);
        Self { start: pinhole(self.start.point, self.look, right / FOCAL, up / FOCAL, x, y), ..self.clone() }
    }

    /// Everything `factor` times as large.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let mut bench = self.clone();
        bench.start.point *= factor;
        for element in &mut bench.elements {
            match &mut element.shape {
                Shape::Plane { point, .. } => *point *= factor,
                Shape::Sphere { center, radius } => {
                    *center *= factor;
                    *radius *= factor;
                }
                Shape::Ellipsoid { center, half_axes } => {
                    *center *= factor;
                    *half_axes *= factor;
                }
            }
        }
        bench
    }

    /// The same bench with constant indices.
    pub(crate) fn without_dispersion(&self) -> Self {
        let mut bench = self.clone();
        let constant = |law: &mut Option<Dispersion>| *law = law.take().map(|law| law.scaled(0.0).unwrap());
        for element in &mut bench.elements {
            if let Event::Interface { outside, inside } = &mut element.event {
                constant(outside);
                constant(inside);
            }
        }
        bench
    }

    pub(crate) fn trace<C: ColumnSet>(&self, wavelength: Wavelength) -> Trace<C> {
        let medium = IorJet::VACUUM;
        Trace {
            bench: self.clone(),
            wavelength,
            medium,
            point: self.start.point,
            momentum: self.start.direction,
            columns: C::start(&self.start, &medium),
            log: Vec::new(),
            events: 0,
        }
    }

    pub(crate) fn run<C: ColumnSet>(&self, wavelength: Wavelength) -> Trace<C> {
        let mut trace = self.trace(wavelength);
        while trace.step().is_some() {}
        trace
    }

    fn plane(point: DVec3, normal: DVec3, event: Event) -> Element {
        Element { shape: Shape::Plane { point, normal: normal.normalize() }, event, far: false }
    }

    fn screen(z: f64) -> Element {
        Self::plane(DVec3::new(0.0, 0.0, z), DVec3::new(0.1, -0.05, 1.0), Event::End)
    }

    fn glass(law: Dispersion) -> Event {
        Event::Interface { outside: None, inside: Some(law) }
    }

    /// 45-90-45: in through one leg, totally reflected at the hypotenuse, out through the other leg.
    pub(crate) fn right_angle_prism() -> Self {
        let leg = DVec3::new(0.0, 0.0, 1.0);
        let other = DVec3::new(1.0, 0.0, 0.0);
        Self::new(
            "45-90-45 prism",
            DVec3::new(0.03, 0.1, 3.0),
            // Not along the leg's normal, or nothing would be displaced.
            DVec3::new(0.12, -0.07, -1.0),
            vec![
                Self::plane(DVec3::new(0.0, 0.0, 1.0), leg, Self::glass(bk7())),
                // The hypotenuse's outward normal; the mirror image of the entry leg is the exit leg.
                Self::plane(DVec3::ZERO, DVec3::new(-1.0, 0.0, -1.0), Self::glass(bk7())),
                Self::plane(DVec3::new(1.0, 0.0, 0.0), other, Self::glass(bk7())),
                Self::plane(DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.0, 0.2, 0.1), Event::End),
            ],
        )
    }

    /// Through a ball onto a plane.
    pub(crate) fn ball_before_a_plane() -> Self {
        let ball =
            |far| Element { shape: Shape::Sphere { center: DVec3::ZERO, radius: 1.0 }, event: Self::glass(bk7()), far };
        Self::new(
            "ball",
            DVec3::new(0.0, 0.0, 5.0),
            DVec3::new(0.07, 0.04, -1.0),
            vec![ball(false), ball(true), Self::screen(-4.0)],
        )
    }
}

/// Chains of every kind of surface and event with true normals.
pub(crate) fn all() -> Vec<Bench> {
    let sphere = |event: Event, far| Element { shape: Shape::Sphere { center: DVec3::ZERO, radius: 1.0 }, event, far };
    let glass = Bench::glass;
    let ellipsoid = |law: Dispersion, far| Element {
        shape: Shape::Ellipsoid { center: DVec3::new(0.1, 0.0, -0.2), half_axes: DVec3::new(1.0, 1.4, 0.8) },
        event: glass(law),
        far,
    };
    vec![
        Bench::right_angle_prism(),
        Bench::ball_before_a_plane(),
        Bench::new(
            "60° prism of SF66",
            // Close to the minimum of deviation: 74° of incidence.
            DVec3::new(-3.47, 0.3, -2.78),
            DVec3::new(0.72, -0.05, 0.695),
            vec![
                Bench::plane(DVec3::new(-0.3, 0.0, 0.5), DVec3::new(-(3f64.sqrt()), 0.0, 1.0), glass(sf66())),
                Bench::plane(DVec3::new(0.3, 0.0, 0.5), DVec3::new(3f64.sqrt(), 0.0, 1.0), glass(sf66())),
                Bench::plane(DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 0.1, 0.2), Event::End),
            ],
        ),
        Bench::new(
            "first rainbow",
            DVec3::new(0.3, 0.2, 5.0),
            DVec3::new(0.07, 0.06, -1.0),
            vec![
                sphere(glass(bk7()), false),
                sphere(Event::Mirror, true),
                sphere(glass(bk7()), true),
                Bench::plane(DVec3::new(0.0, 0.0, 7.0), DVec3::new(0.1, 0.3, 1.0), Event::End),
            ],
        ),
        Bench::new(
            "second rainbow",
            DVec3::new(0.3, 0.2, 5.0),
            DVec3::new(0.12, 0.05, -1.0),
            vec![
                sphere(glass(sf66()), false),
                sphere(Event::Mirror, true),
                sphere(Event::Mirror, true),
                sphere(glass(sf66()), true),
                sphere_around(20.0),
            ],
        ),
        Bench::new(
            "ellipsoid",
            DVec3::new(0.2, 0.1, 5.0),
            DVec3::new(0.02, 0.05, -1.0),
            vec![ellipsoid(sf66(), false), ellipsoid(sf66(), true), Bench::screen(-4.0)],
        ),
        Bench::new(
            "cemented doublet",
            DVec3::new(0.1, 0.1, 5.0),
            DVec3::new(0.02, 0.03, -1.0),
            vec![
                Element {
                    shape: Shape::Sphere { center: DVec3::new(0.0, 0.0, -2.0), radius: 2.5 },
                    event: glass(bk7()),
                    far: false,
                },
                Element {
                    shape: Shape::Sphere { center: DVec3::new(0.0, 0.0, 2.3), radius: 2.1 },
                    // The cement: crown inside of this sphere, flint outside.
                    event: Event::Interface { outside: Some(sf66()), inside: Some(bk7()) },
                    far: true,
                },
                Bench::plane(
                    DVec3::new(0.0, 0.0, -0.1),
                    DVec3::new(0.0, 0.02, 1.0),
                    Event::Interface { outside: Some(sf66()), inside: None },
                ),
                Bench::screen(-4.0),
            ],
        ),
    ]
}

fn sphere_around(radius: f64) -> Element {
    Element { shape: Shape::Sphere { center: DVec3::ZERO, radius }, event: Event::End, far: true }
}

impl Shape {
    fn intersect(&self, p: DVec3, d: DVec3, far: bool) -> f64 {
        match *self {
            Self::Plane { point, normal } => (point - p).dot(normal) / d.dot(normal),
            Self::Sphere { center, radius } => quadratic(p - center, d, radius, far),
            Self::Ellipsoid { center, half_axes } => {
                // In units of the half axes; the parameter stays that of the unit direction.
                let (p, v) = ((p - center) / half_axes, d / half_axes);
                let length = v.length();
                quadratic(p, v / length, 1.0, far) / length
            }
        }
    }

    fn at(&self, q: DVec3) -> LocalSurface {
        match *self {
            Self::Plane { normal, .. } => {
                LocalSurface { n_g: normal, n_s: normal, curvature: Curvature::Plane, field: NormalField::Flat }
            }
            Self::Sphere { center, radius } => {
                let n = (q - center).normalize();
                let inv_radius = 1.0 / radius;
                LocalSurface {
                    n_g: n,
                    n_s: n,
                    curvature: Curvature::Sphere { inv_radius },
                    field: NormalField::Sphere { inv_radius },
                }
            }
            Self::Ellipsoid { center, half_axes } => {
                // f = Σ (x/a)²/2, ∇f = x/a², H = diag(1/a²).
                let weights = (half_axes * half_axes).recip();
                let vector = (q - center) * weights;
                let n = vector.normalize();
                let hessian = DMat3::from_diagonal(weights);
                LocalSurface {
                    n_g: n,
                    n_s: n,
                    curvature: Curvature::Quadric { hessian: hessian * (1.0 / vector.length()) },
                    field: NormalField::Linear { vector, gradient: hessian },
                }
            }
        }
    }
}

fn quadratic(p: DVec3, d: DVec3, radius: f64, far: bool) -> f64 {
    let b = p.dot(d);
    let across = p - d * b;
    let half_chord = (radius * radius - across.length_squared()).sqrt();
    if far { -b + half_chord } else { -b - half_chord }
}

impl<C: ColumnSet> Trace<C> {
    pub(crate) fn direction(&self) -> DVec3 {
        self.momentum / self.medium.ior
    }

    pub(crate) fn kinds(&self) -> Vec<ScatterKind> {
        self.log.iter().filter_map(|step| step.scattering.map(|s| s.kind)).collect()
    }

    /// To the next surface and through its event; momentum and medium after it.
    pub(crate) fn step(&mut self) -> Option<(DVec3, IorJet)> {
        let element = self.bench.elements.get(self.events)?.clone();
        self.events += 1;
        let direction = self.direction();
        let distance = element.shape.intersect(self.point, direction, element.far);
        assert!(distance > 0.0, "{}: the ray misses surface {}", self.bench.name, self.events);
        self.point += direction * distance;
        let surface = element.shape.at(self.point);
        let transfer =
            Transfer { distance, direction, medium: self.medium, n_g: surface.n_g, curvature: surface.curvature };
        self.columns.transfer(&transfer);
        let jet = |law: &Option<Dispersion>| law.as_ref().map_or(IorJet::VACUUM, |law| law.at(self.wavelength));
        let scattering = match &element.event {
            Event::End => None,
            Event::Mirror => Some(mirror(self.momentum, &surface, &self.medium)),
            Event::Interface { outside, inside } => {
                let behind = if direction.dot(surface.n_g) < 0.0 { jet(inside) } else { jet(outside) };
                Some(refract_or_reflect(self.momentum, &surface, &self.medium, &behind))
            }
        };
        if let Some(s) = &scattering {
            self.columns.scatter(s);
            self.momentum = s.momentum_out;
            if s.kind == ScatterKind::Refraction {
                self.medium = s.ior_t;
            }
        }
        self.log.push(Step { transfer, scattering });
        Some((self.momentum, self.medium))
    }
}
