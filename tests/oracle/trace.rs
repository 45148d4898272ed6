//! The re-trace: Snell's law, the reflection law and intersections in multi-precision, nothing else.

use super::{
    chain::{Action, Chain, Event, Law, Root, Surface},
    random::Random,
    real::{Real, Vector},
};

/// The relative size of the perturbations that measure the condition number: 2⁻⁸⁰.
pub const PERTURBATION_EXPONENT: isize = -80;

/// n(λ) of a law; λ in nanometres.
pub fn ior(law: &Law, nanometers: &Real) -> Real {
    Noise::none().ior(law, nanometers)
}

/// Perturbs what passes through it by about u = 2⁻⁸⁰ of its size, or leaves it alone.
#[derive(Clone, Debug)]
pub struct Noise(Option<Random>);

impl Noise {
    pub fn none() -> Self {
        Self(None)
    }

    pub fn seeded(seed: u64) -> Self {
        Self(Some(Random::new(seed)))
    }

    /// value + e·u·size with a random e of magnitude ½ to 1½. (Signs alone would often cancel where two quantities, the
    /// centre and the radius of a large sphere, nearly compensate each other.)
    fn shift(&mut self, value: Real, size: &Real) -> Real {
        match &mut self.0 {
            None => value,
            Some(random) => {
                let u = Real::power_of_two(PERTURBATION_EXPONENT);
                let e = random.range(-1.0, 1.0);
                value + size * &u * Real::new(e + e.signum() * 0.5)
            }
        }
    }

    fn real(&mut self, value: Real) -> Real {
        if self.0.is_none() { value } else { self.shift(value.clone(), &value) }
    }

    fn vector(&mut self, value: Vector) -> Vector {
        if self.0.is_none() { value } else { Vector(value.0.map(|c| self.real(c))) }
    }

    /// A unit vector, turned: each component moves by about u of the whole.
    fn unit(&mut self, value: Vector) -> Vector {
        if self.0.is_none() { value } else { Vector(value.0.map(|c| self.shift(c, &Real::one()))).unit() }
    }

    /// The direction of a ray in a medium of this index, turned by about u and, independently, by u·n(λ): whoever
    /// carries K and its derivatives rounds each relative to itself, and K' ⊇ n'd.
    fn direction(&mut self, value: Vector, ior: &Real) -> Vector {
        if self.0.is_none() {
            return value;
        }
        let turned = self.unit(value);
        Vector(turned.0.map(|c| self.shift(c, ior))).unit()
    }

    /// An authored number.
    fn number(&mut self, value: f64) -> Real {
        self.real(Real::new(value))
    }

    fn authored(&mut self, value: glam::DVec3) -> Vector {
        self.vector(Vector::new(value.to_array()))
    }

    fn ior(&mut self, law: &Law, nanometers: &Real) -> Real {
        let n = self.exact_law(law, nanometers);
        self.real(n)
    }

    fn exact_law(&mut self, law: &Law, nanometers: &Real) -> Real {
        let micrometers = nanometers / Real::new(1000.0);
        let l2 = &micrometers * &micrometers;
        match law {
            Law::Constant(n) => Real::new(*n),
            Law::Cauchy(coefficients) => {
                let mut sum = Real::zero();
                let mut power = Real::one();
                for &c in coefficients {
                    sum = sum + self.number(c) * &power;
                    power = power / &l2;
                }
                sum
            }
            Law::Sellmeier { b, c } => {
                let mut n2 = Real::one();
                for (&b, &c) in b.iter().zip(c) {
                    n2 = n2 + self.number(b) * &l2 / (&l2 - self.number(c));
                }
                n2.sqrt()
            }
            Law::SellmeierSquared { constant, b, c } => {
                let mut n2 = Real::one() + self.number(*constant);
                for (&b, &c) in b.iter().zip(c) {
                    let pole = self.number(c);
                    n2 = n2 + self.number(b) * &l2 / (&l2 - &pole * &pole);
                }
                n2.sqrt()
            }
            Law::AbbeNumber { nd, vd } => {
                let inverse_square = |line: f64| {
                    let l = Real::new(line) / Real::new(1000.0);
                    Real::one() / (&l * &l)
                };
                let (nd, vd) = (self.number(*nd), self.number(*vd));
                // The Fraunhofer lines F, C and d in nanometres (MATH: section 4).
                let b = (&nd - Real::one()) / (vd * (inverse_square(486.1327) - inverse_square(656.2725)));
                let a = nd - &b * inverse_square(587.5618);
                a + b / l2
            }
            Law::Scaled(inner, factor) => {
                let state = self.clone();
                let nd = self.exact_law(inner, &Real::new(587.5618));
                // The same perturbed coefficients at both wavelengths.
                *self = state;
                let n = self.exact_law(inner, nanometers);
                &nd + Real::new(*factor) * (n - &nd)
            }
        }
    }
}

/// What happened at an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Refraction,
    TotalReflection,
    Mirror,
}

/// An event as the oracle saw it.
#[derive(Clone, Debug)]
pub struct Passed {
    pub kind: Kind,
    /// (n₁ cos θ_t)², negative for total reflection; None at a mirror.
    pub w_squared: Option<Real>,
    /// cos of the angle of incidence on the normal that was used
    pub cos_i: Real,
    pub geometric_normal_used: bool,
    /// Length of the segment that ended here and the index of its medium.
    pub distance: Real,
    pub medium: usize,
}

/// A ray under way.
#[derive(Clone, Debug)]
pub struct State {
    pub point: Vector,
    pub direction: Vector,
    pub medium: usize,
}

/// Where a chain ended.
#[derive(Clone, Debug)]
pub struct End {
    pub point: Vector,
    /// Unit direction of arrival.
    pub direction: Vector,
    /// K = n d
    pub momentum: Vector,
    /// Geometric normal of the receiver.
    pub n_g: Vector,
    /// Σ n ℓ
    pub optical_path: Real,
    pub passed: Vec<Passed>,
    /// The last segment.
    pub distance: Real,
    pub medium: usize,
}

/// Why a chain has no end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The line misses this event's surface or meets it behind the ray.
    Missed(usize),
}

/// Follows a chain with the ray of pixel offset (x, y) at a wavelength.
pub fn trace(chain: &Chain, x: &Real, y: &Real, nanometers: &Real, noise: Noise) -> Result<End, Lost> {
    let mut tracer = Tracer { noise, nanometers: nanometers.clone(), media: Vec::new() };
    tracer.media = chain.media.iter().map(|law| tracer.noise.ior(law, nanometers)).collect();
    let mut state = tracer.start(chain, x, y);
    let mut optical_path = Real::zero();
    let mut passed = Vec::with_capacity(chain.events.len());
    for (index, event) in chain.events.iter().enumerate() {
        let step = tracer.pass(&mut state, event).ok_or(Lost::Missed(index))?;
        optical_path = optical_path + &step.distance * &tracer.media[step.medium];
        passed.push(step);
    }
    let (distance, n_g, _) =
        tracer.travel(&mut state, &chain.receiver, chain.receiver_root).ok_or(Lost::Missed(chain.events.len()))?;
    optical_path = optical_path + &distance * &tracer.media[state.medium];
    let momentum = state.direction.scale(&tracer.media[state.medium]);
    Ok(End {
        point: state.point,
        direction: state.direction,
        momentum,
        n_g,
        optical_path,
        passed,
        distance,
        medium: state.medium,
    })
}

/// The stepwise tracer, also used to build random chains.
#[derive(Clone, Debug)]
pub struct Tracer {
    noise: Noise,
    nanometers: Real,
    media: Vec<Real>,
}

impl Tracer {
    /// A tracer for building chains: no perturbation.
    pub fn new(media: &[Law], nanometers: f64) -> Self {
        let nanometers = Real::new(nanometers);
        let media = media.iter().map(|law| ior(law, &nanometers)).collect();
        Self { noise: Noise::none(), nanometers, media }
    }

    /// The ray as it leaves the camera.
    pub fn start(&mut self, chain: &Chain, x: &Real, y: &Real) -> State {
        let s = &chain.start;
        let mut affine = |base, bx, by| {
            let (base, bx, by) = (self.noise.authored(base), self.noise.authored(bx), self.noise.authored(by));
            &(&base + &bx.scale(x)) + &by.scale(y)
        };
        let point = affine(s.origin, s.origin_x, s.origin_y);
        let direction = affine(s.look, s.right, s.up).unit();
        let direction = self.noise.direction(direction, &self.media[chain.first_medium]);
        State { point, direction, medium: chain.first_medium }
    }

    /// Travels to the event's surface and scatters there; None where the line misses it.
    pub fn pass(&mut self, state: &mut State, event: &Event) -> Option<Passed> {
        let medium = state.medium;
        let (distance, n_g, n_s) = self.travel(state, &event.surface, event.root)?;
        let d = state.direction.clone();
        let along = d.dot(&n_g);
        let n_s = if n_s.dot(&n_g).is_negative() { -&n_s } else { n_s };
        let mut geometric = d.dot(&n_s).is_negative() != along.is_negative();
        loop {
            let normal = if geometric { n_g.clone() } else { n_s.clone() };
            let cos = d.dot(&normal);
            // The normal that faces the ray.
            let (normal, cos) = if cos.is_negative() { (normal, cos) } else { (-&normal, -cos) };
            let (out, kind, w_squared) = match event.action {
                Action::Mirror => (reflect(&d, &normal), Kind::Mirror, None),
                Action::Interface(beyond) => {
                    let (n0, n1) = (&self.media[medium], &self.media[beyond]);
                    // Snell's law: the component of n d along the surface is conserved.
                    let tangential = (&d - &normal.scale(&cos)).scale(n0);
                    let w_squared = n1 * n1 - tangential.dot(&tangential);
                    if w_squared.is_negative() || w_squared.is_zero() {
                        (reflect(&d, &normal), Kind::TotalReflection, Some(w_squared))
                    } else {
                        let k = &tangential - &normal.scale(&w_squared.sqrt());
                        (k.scale(&(Real::one() / n1)), Kind::Refraction, Some(w_squared))
                    }
                }
            };
            let crosses = out.dot(&n_g).is_negative() == along.is_negative();
            if !geometric && crosses != (kind == Kind::Refraction) {
                geometric = true;
                continue;
            }
            if let (Kind::Refraction, Action::Interface(beyond)) = (kind, event.action) {
                state.medium = beyond;
            }
            state.direction = self.noise.direction(out.unit(), &self.media[state.medium]);
            return Some(Passed { kind, w_squared, cos_i: -cos, geometric_normal_used: geometric, distance, medium });
        }
    }

    /// Moves to the surface; returns the distance and the unit geometric and shading normals.
    fn travel(&mut self, state: &mut State, surface: &Surface, root: Root) -> Option<(Real, Vector, Vector)> {
        let (p, d) = (state.point.clone(), state.direction.clone());
        let half = Real::new(0.5);
        let from_roots = |a: Real, b: Real, c: Real| {
            // a t² + 2 b t + c = 0, a > 0
            let discriminant = &b * &b - &a * &c;
            if discriminant.is_negative() {
                return None;
            }
            let s = discriminant.sqrt();
            let s = if root == Root::First { -s } else { s };
            Some((s - b) / a)
        };
        let (distance, n_g, n_s) = match surface {
            Surface::Plane { point, normal } => {
                let (point, normal) =
                    (self.noise.authored(*point), self.noise.unit(Vector::new(normal.to_array()).unit()));
                let t = plane_distance(&p, &d, &point, &normal)?;
                (t, normal.clone(), normal)
            }
            Surface::Sphere { center, radius, inward } => {
                let (center, radius) = (self.noise.authored(*center), self.noise.number(*radius));
                let o = &p - &center;
                let t = from_roots(Real::one(), o.dot(&d), o.dot(&o) - &radius * &radius)?;
                let outward = (&o + &d.scale(&t)).unit();
                let n = if *inward { -&outward } else { outward };
                (t, n.clone(), n)
            }
            Surface::Quadric { center, matrix } => {
                let center = self.noise.authored(*center);
                let rows = matrix.transpose();
                let rows = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| self.noise.authored(row));
                let apply = |v: &Vector| Vector([0, 1, 2].map(|i| rows[i].dot(v)));
                let (o, u) = (apply(&(&p - &center)), apply(&d));
                let t = from_roots(u.dot(&u), o.dot(&u), o.dot(&o) - Real::one())?;
                let on_unit = &o + &u.scale(&t);
                // ∇|A(q−c)|² = 2 Aᵀ A (q − c)
                let mut gradient = Vector::zero();
                for i in 0..3 {
                    gradient = &gradient + &rows[i].scale(&on_unit.0[i]);
                }
                let n = gradient.unit();
                (t, n.clone(), n)
            }
            Surface::Triangle { corners, normals } => {
                let [a, b, c] = corners.map(|corner| self.noise.authored(corner));
                let (e1, e2) = (&b - &a, &c - &a);
                let m = e1.cross(&e2);
                let n_g = m.unit();
                let t = plane_distance(&p, &d, &a, &n_g)?;
                let n_s = match normals {
                    None => n_g.clone(),
                    Some(normals) => {
                        let [s0, s1, s2] = normals.map(|n| self.noise.authored(n));
                        let v = &(&p + &d.scale(&t)) - &a;
                        // Areas of the sub-triangles over the whole: barycentric coordinates.
                        let m2 = m.dot(&m);
                        let b1 = v.cross(&e2).dot(&m) / &m2;
                        let b2 = e1.cross(&v).dot(&m) / &m2;
                        (&(&s0 + &(&s1 - &s0).scale(&b1)) + &(&s2 - &s0).scale(&b2)).unit()
                    }
                };
                (t, n_g, n_s)
            }
        };
        if distance.is_negative() {
            return None;
        }
        let mut point = &p + &d.scale(&distance);
        for axis in 0..3 {
            // A computed hit point is rounded by the size of its two terms.
            let size = (p.0[axis].abs() + (&d.0[axis] * &distance).abs()) * &half;
            point.0[axis] = self.noise.shift(point.0[axis].clone(), &size);
        }
        state.point = point;
        Some((distance, self.noise.unit(n_g), self.noise.unit(n_s)))
    }
}

fn plane_distance(p: &Vector, d: &Vector, point: &Vector, normal: &Vector) -> Option<Real> {
    let along = normal.dot(d);
    (!along.is_zero()).then(|| normal.dot(&(point - p)) / along)
}

fn reflect(d: &Vector, normal: &Vector) -> Vector {
    d - &normal.scale(&(d.dot(normal) * Real::new(2.0)))
}
