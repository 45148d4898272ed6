//! Boxes, cylinders, cones, capsules: what a line crosses, against their definitions as sets of points.

use std::sync::Arc;

use abbe::geometry::{Axis, Cap, Cuboid, Departures, Hit, Ray, Rectangle, Revolved, Shape, Solid};
use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;

use crate::shapes::*;

/// A solid with its definition, independent of how it is intersected.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// Front and back: curvature, conic constant, A4, A6, semi-diameter. Always along z.
    Lens {
        faces: [[f64; 5]; 2],
        thickness: f64,
        edge: f64,
    },
    Box(DVec3),
    Cylinder {
        height: f64,
        bottom: f64,
        top: f64,
    },
    Capsule {
        height: f64,
        bottom: f64,
        top: f64,
    },
}

impl Kind {
    pub(crate) fn solid(self, axis: Axis) -> Solid {
        match self {
            Self::Lens { .. } => Solid::Revolved(self.lens().expect("a lens")),
            Self::Box(sides) => Solid::Cuboid(Cuboid::new(sides).expect("sides")),
            Self::Cylinder { height, bottom, top } => {
                Solid::Revolved(Revolved::cylinder(height, bottom, top, axis).expect("sizes"))
            }
            Self::Capsule { height, bottom, top } => {
                Solid::Revolved(Revolved::capsule(height, bottom, top, axis).expect("sizes"))
            }
        }
    }

    fn lens(self) -> Result<Revolved, String> {
        let Self::Lens { faces, thickness, edge } = self else { return Err("no lens".to_owned()) };
        let cap = |[curvature, conic, a4, a6, semi_diameter]: [f64; 5]| Cap {
            curvature,
            conic,
            aspheres: vec![a4, a6],
            semi_diameter,
        };
        Revolved::lens(&cap(faces[0]), &cap(faces[1]), thickness, edge)
    }

    /// A point that is usually inside.
    fn middle(self) -> DVec3 {
        if let Self::Lens { thickness, .. } = self { DVec3::Z * (0.5 * thickness) } else { DVec3::ZERO }
    }

    fn is_convex(self) -> bool {
        !matches!(self, Self::Lens { .. })
    }

    /// Negative inside; grows at most as fast as `steepness` times the distance.
    fn membership(self, axis: Axis, p: DVec3) -> f64 {
        if let Self::Lens { faces, thickness, edge } = self {
            let r = p.x.hypot(p.y);
            let sag = |[c, k, a4, a6, semi]: [f64; 5]| {
                let q = r.min(semi).powi(2);
                c * q / (1.0 + (1.0 - (1.0 + k) * c * c * q).sqrt()) + a4 * q * q + a6 * q * q * q
            };
            return (r - edge).max(sag(faces[0]) - p.z).max(p.z - thickness - sag(faces[1]));
        }
        // The spine of X runs along x with (y, z) around, and so on in turn.
        let p = match axis {
            Axis::X => DVec3::new(p.y, p.z, p.x),
            Axis::Y => DVec3::new(p.z, p.x, p.y),
            Axis::Z => p,
        };
        let r = p.x.hypot(p.y);
        let cone = |height: f64, bottom: f64, top: f64| {
            let along = p.z / height + 0.5;
            (r - (bottom + (top - bottom) * along)).max(p.z.abs() - 0.5 * height)
        };
        match self {
            Self::Lens { .. } => unreachable!("answered above"),
            // A box has no spine.
            Self::Box(sides) => (p.abs() - 0.5 * turned(axis, sides)).max_element(),
            Self::Cylinder { height, bottom, top } => cone(height, bottom, top),
            Self::Capsule { height, bottom, top } => {
                let slope = if height > 0.0 { (top - bottom) / height } else { 0.0 };
                let ball =
                    |z: f64, r: f64| (p - DVec3::Z * (z + slope * r)).length() - r * (1.0 + slope * slope).sqrt();
                if p.z <= -0.5 * height {
                    ball(-0.5 * height, bottom)
                } else if p.z >= 0.5 * height {
                    ball(0.5 * height, top)
                } else {
                    (r - (bottom + (top - bottom) * (p.z / height + 0.5))) / (1.0 + slope * slope).sqrt()
                }
            }
        }
    }
}

fn turned(axis: Axis, v: DVec3) -> DVec3 {
    match axis {
        Axis::X => DVec3::new(v.y, v.z, v.x),
        Axis::Y => DVec3::new(v.z, v.x, v.y),
        Axis::Z => v,
    }
}

fn kind() -> impl Strategy<Value = Kind> {
    let size = || prop_oneof![0.2_f64..2.0, Just(1.0)];
    // Capsules that are much shorter than their ends differ are parts of huge spheres, in which test rays would start.
    let end = || prop_oneof![3 => 0.2_f64..1.5, 1 => Just(0.0), 1 => Just(1.0)];
    let face = || {
        let terms = prop_oneof![2 => Just([0.0, 0.0]), 1 => [-0.2_f64..0.2, -0.05..0.05]];
        let curvature = prop_oneof![3 => -0.9_f64..0.9, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(-1.0)];
        let conic = prop_oneof![2 => Just(0.0), 1 => Just(-1.0), 2 => -3.0_f64..0.3];
        (curvature, conic, terms, 0.4_f64..1.0).prop_map(|(c, k, [a4, a6], semi)| [c, k, a4, a6, semi])
    };
    let lens = (face(), face(), 0.1_f64..1.5, prop_oneof![Just(0.0), 0.0_f64..0.3]).prop_filter_map(
        "faces cross",
        |(front, back, thickness, flat)| {
            let lens = Kind::Lens { faces: [front, back], thickness, edge: front[4].max(back[4]) + flat };
            lens.lens().is_ok().then_some(lens)
        },
    );
    prop_oneof![
        4 => lens,
        1 => [size(), size(), size()].prop_map(|s| Kind::Box(DVec3::from(s))),
        1 => (size(), end(), 0.2_f64..1.5).prop_map(|(height, bottom, top)| Kind::Cylinder { height, bottom, top }),
        1 => (size(), 0.2_f64..1.5, end()).prop_map(|(height, bottom, top)| Kind::Cylinder { height, bottom, top }),
        1 => (size(), size()).prop_map(|(height, r)| Kind::Cylinder { height, bottom: r, top: r }),
        1 => (prop_oneof![size(), Just(0.0)], size()).prop_map(|(height, r)| Kind::Capsule { height, bottom: r, top: r }),
        1 => (1.0_f64..2.0, end(), 0.2_f64..1.5).prop_map(|(height, bottom, top)| Kind::Capsule { height, bottom, top }),
    ]
}

fn axis() -> impl Strategy<Value = Axis> {
    prop_oneof![Just(Axis::X), Just(Axis::Y), Just(Axis::Z)]
}

fn vector(range: f64) -> impl Strategy<Value = DVec3> {
    [-range..range, -range..range, -range..range].prop_map(DVec3::from)
}

/// Directions, with every share of axes and diagonals.
fn direction() -> impl Strategy<Value = DVec3> {
    let integers = [-2..=2_i32, -2..=2, -2..=2].prop_map(|d| DVec3::from(d.map(f64::from)));
    prop_oneof![3 => vector(1.0), 1 => integers].prop_filter_map("no direction", |d| d.try_normalize())
}

fn transform() -> impl Strategy<Value = DAffine3> {
    let linear = (vector(1.0), vector(1.0), vector(1.0))
        .prop_map(|(x, y, z)| DMat3::from_cols(x, y, z))
        .prop_filter("nearly singular", |m| m.determinant().abs() > 3e-2);
    let exact = prop_oneof![Just(DMat3::IDENTITY), Just(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)))];
    (prop_oneof![2 => linear, 1 => exact], vector(3.0))
        .prop_map(|(matrix3, translation)| DAffine3 { matrix3, translation })
}

fn shape(solid: Solid) -> Arc<Shape> {
    Arc::new(Shape::Solid(solid))
}

/// Points where sections and faces meet, in object space.
fn rims(solid: &Solid, u: f64) -> Vec<DVec3> {
    let [min, max] = solid.bounds();
    let (s, c) = u.sin_cos();
    let middle = 0.5 * (min + max);
    let half = 0.5 * (max - min);
    let mut rims = vec![min, max, DVec3::new(min.x, max.y, middle.z)];
    for i in 0..3 {
        for end in [min[i], max[i], 0.0] {
            let mut p = middle;
            p[i] = end;
            p[(i + 1) % 3] += half[(i + 1) % 3] * c;
            p[(i + 2) % 3] += half[(i + 2) % 3] * s;
            rims.push(p);
        }
    }
    rims
}

/// Follows a ray; `event` gives the new direction.
fn follow(
    scene: &abbe::geometry::Aggregate,
    mut ray: Ray,
    mut event: impl FnMut(DVec3, DVec3) -> DVec3,
    events: usize,
) -> Vec<Hit> {
    let mut departures = Departures::none();
    let mut hits = Vec::new();
    while let Some(hit) = scene.intersect(&ray, &departures) {
        hits.push(hit);
        if hits.len() == events {
            break;
        }
        let (point, surface) = scene.local_surface(&ray, &hit);
        assert!(surface.n_g.is_finite(), "{hit:?}");
        let direction = event(ray.direction, surface.n_g);
        let outward = if direction == ray.direction { hit.leaving } else { !hit.leaving };
        departures.depart(&ray, &hit, outward);
        ray = Ray { origin: point, direction, ..ray };
    }
    hits
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// Every change of side that is further than a step from the next is found, and where it is.
    #[test]
    fn borders_are_where_the_definition_says(
        kind in kind(), axis in axis(), target in vector(0.8), d in direction(),
    ) {
        let solid = kind.solid(axis);
        let scene = aggregate(&[at_origin(&shape(solid))]);
        let line = ray(kind.middle() + target - 10.0 * d, d);
        let at = |t: f64| kind.membership(axis, line.origin + t * line.direction);
        const STEPS: usize = 8000;
        let mut expected = Vec::new();
        for i in 0..STEPS {
            let [mut a, mut b] = [i, i + 1].map(|i| 5.0 + 10.0 * i as f64 / STEPS as f64);
            if (at(a) < 0.0) == (at(b) < 0.0) {
                continue;
            }
            let leaving = at(a) < 0.0;
            for _ in 0..60 {
                let middle = 0.5 * (a + b);
                if (at(middle) < 0.0) == leaving { a = middle } else { b = middle }
            }
            expected.push((a, leaving));
        }
        let mut found = Vec::new();
        scene.crossings(&line, &mut |hit| found.push((hit.distance, hit.leaving)));
        // Chords and gaps shorter than a step may be missing from the march.
        for &(t, leaving) in &expected {
            prop_assert!(found.iter().any(|f| (f.0 - t).abs() < 1e-7 && f.1 == leaving), "{expected:?} {found:?}");
        }
        for pair in found.windows(2) {
            prop_assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1, "{found:?}");
        }
        prop_assert!(found.len() % 2 == 0);
        if found.len() != expected.len() {
            prop_assert!(found.windows(2).any(|p| p[1].0 - p[0].0 < 20.0 / STEPS as f64), "{expected:?} {found:?}");
        }
        // The nearest hit is the first of them, on the surface, facing the ray.
        let hit = first(&scene, &line);
        prop_assert_eq!(hit.map(|h| h.distance), found.first().map(|f| f.0));
        if let Some(hit) = hit {
            let (p, surface) = scene.local_surface(&line, &hit);
            prop_assert!(kind.membership(axis, p).abs() < 2e-14, "{}", kind.membership(axis, p));
            prop_assert!(surface.n_g.dot(d) < 1e-9);
        }
    }

    /// Through any point, rims included, at every scale and under every transform.
    #[test]
    fn no_ray_leaks(
        kind in kind(), axis in axis(), t in transform(), scale in -6..=6_i32, u in 0.0_f64..6.3, d in direction(),
        start in vector(0.1),
    ) {
        let size = 10.0_f64.powi(scale);
        let solid = kind.solid(axis);
        let rims = rims(&solid, u);
        let place = DAffine3 { matrix3: t.matrix3 * size, translation: t.translation * size };
        let scene = aggregate(&[placed(&shape(solid), place)]);
        let inside = kind.middle() + start * 0.5;
        let is_inside = kind.membership(axis, inside) < -1e-6;
        for target in rims {
            let to = place.transform_point3(target);
            let across = place.transform_vector3(d).normalize();
            let mut rays = vec![ray(to - across * 20.0 * size, across)];
            if is_inside && (target - inside).length() > 0.2 {
                let from = place.transform_point3(inside);
                let ray = ray(from, to - from);
                let hit = first(&scene, &ray);
                prop_assert!(hit.is_some_and(|h| h.leaving), "{hit:?}");
                let (net, count) = balance(&scene, &ray);
                prop_assert!(net == 1 && (count == 1 || !kind.is_convex()), "{net} of {count}");
                rays.push(Ray { origin: ray.origin - ray.direction * 20.0 * size, ..ray });
            }
            for ray in rays {
                let (net, count) = balance(&scene, &ray);
                prop_assert_eq!(net, 0);
                let hits = follow(&scene, ray, |d, _| d, 100);
                prop_assert_eq!(hits.len() % 2, 0, "{:?}", hits);
                prop_assert!(hits.iter().enumerate().all(|(k, h)| h.leaving == (k % 2 == 1)), "{hits:?}");
                prop_assert!(hits.len() <= 2 || !kind.is_convex(), "{hits:?}");
                // Where two surfaces meet a hair of a ray may be seen once and not again; nowhere else.
                let short = hits.windows(2).any(|p| p[1].distance < 1e-6 * size) || (hits.len() < count as usize);
                prop_assert!(hits.len() == count as usize || short, "{hits:?} {count}");
            }
        }
    }

    #[test]
    fn a_ray_bouncing_inside_stays_inside(
        kind in kind(), axis in axis(), scale in -6..=6_i32, far in prop_oneof![Just(0.0), Just(1e3)], d in direction(),
        start in vector(0.1), grazing in prop_oneof![Just(1.0), Just(1e-3), Just(1e-7)],
    ) {
        let start = kind.middle() + start * 0.5;
        prop_assume!(kind.membership(axis, start) < -1e-6);
        let size = 10.0_f64.powi(scale);
        let place = DAffine3::from_translation(DVec3::new(0.3, -0.8, 0.1) * far * size)
            * DAffine3::from_scale(DVec3::new(size, size, -size))
            * DAffine3::from_axis_angle(DVec3::new(0.1, 0.2, 0.9).normalize(), 0.4);
        let scene = aggregate(&[placed(&shape(kind.solid(axis)), place)]);
        let mut count = 0;
        // The first bounce may turn the ray almost into the surface.
        let bounce = |d: DVec3, n: DVec3| {
            count += 1;
            let reflected = (d - 2.0 * d.dot(n) * n).normalize();
            if count == 1 {
                let across = reflected - reflected.dot(n) * n;
                (across + grazing * (reflected - across)).normalize()
            } else {
                reflected
            }
        };
        let r = ray(place.transform_point3(start), d);
        let hits = follow(&scene, r, bounce, 100);
        prop_assert_eq!(hits.len(), 100);
        prop_assert!(hits.iter().all(|h| h.leaving));
    }

    #[test]
    fn scaling_by_a_power_of_two_changes_no_bit(
        kind in kind(), axis in axis(), t in transform(), power in -60..60_i32, origin in vector(3.0), d in direction(),
    ) {
        let s = 2.0_f64.powi(power);
        let solid = shape(kind.solid(axis));
        let large = shape(match kind {
            Kind::Lens { faces, thickness, edge } => Kind::Lens {
                faces: faces.map(|[c, k, a4, a6, semi]| [c / s, k, a4 / s.powi(3), a6 / s.powi(5), semi * s]),
                thickness: thickness * s,
                edge: edge * s,
            },
            Kind::Box(sides) => Kind::Box(sides * s),
            Kind::Cylinder { height, bottom, top } => Kind::Cylinder { height: height * s, bottom: bottom * s, top: top * s },
            Kind::Capsule { height, bottom, top } => Kind::Capsule { height: height * s, bottom: bottom * s, top: top * s },
        }.solid(axis));
        let scene = |shape: &Arc<Shape>, matrix3: DMat3, size: f64| {
            aggregate(&[placed(shape, DAffine3 { matrix3, translation: t.translation * size })])
        };
        let reference = scene(&solid, t.matrix3, 1.0);
        let small = ray(origin, d);
        let far = Ray { origin: small.origin * s, ..small };
        for scene in [scene(&large, t.matrix3, s), scene(&solid, t.matrix3 * s, s)] {
            let (a, b) = (first(&reference, &small), first(&scene, &far));
            prop_assert_eq!(a.map(|h| Hit { distance: h.distance * s, ..h }), b);
            if let (Some(a), Some(b)) = (a, b) {
                let ((p, here), (q, there)) = (reference.local_surface(&small, &a), scene.local_surface(&far, &b));
                prop_assert_eq!(p * s, q);
                prop_assert_eq!(here.n_g, there.n_g);
            }
        }
    }

    #[test]
    fn coincident_solids_are_both_met(
        kind in kind(), axis in axis(), t in transform(), target in vector(0.5), d in direction(),
    ) {
        let solid = shape(kind.solid(axis));
        let scene = aggregate(&[placed(&solid, t), placed(&solid, t)]);
        let one = aggregate(&[placed(&solid, t)]);
        let to = t.transform_point3(kind.middle() + target);
        let d = t.transform_vector3(d).normalize();
        let r = ray(to - 10.0 * d, d);
        let single = straight_through(&one, r);
        // A chord next to nothing may be there or not; both solids need not agree.
        prop_assume!(single.windows(2).all(|p| p[1].distance > 1e-6));
        let hits = straight_through(&scene, r);
        prop_assert_eq!(hits.len(), 2 * single.len(), "{:?}", hits);
        for (pair, hit) in hits.chunks(2).zip(&single) {
            prop_assert!(pair.iter().all(|h| h.leaving == hit.leaving));
            prop_assert!(pair[0].instance != pair[1].instance && pair[1].at_start);
        }
    }
}

#[test]
fn rectangles_are_open_sheets() {
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let plane = shape(Solid::Rectangle(Rectangle::new(2.0, 4.0, axis).expect("sides")));
        let normal = match axis {
            Axis::X => DVec3::X,
            Axis::Y => DVec3::Y,
            Axis::Z => DVec3::Z,
        };
        let scene = aggregate(&[at_origin(&plane), at_origin(&plane)]);
        let r = ray(3.0 * normal + DVec3::splat(0.25), -normal);
        let hits = straight_through(&scene, r);
        assert_eq!(hits.iter().map(|h| (h.instance, h.leaving)).collect::<Vec<_>>(), [(0, false), (1, false)]);
        let (p, surface) = scene.local_surface(&r, &hits[0]);
        assert_eq!((p.dot(normal), surface.n_g), (0.0, normal));
        assert!(first(&scene, &ray(3.0 * normal + DVec3::splat(2.5), -normal)).is_none());
        // A mirror on top: the other one is never met.
        assert_eq!(follow(&scene, r, |d, n| d - 2.0 * d.dot(n) * n, 5).len(), 1);
    }
}

#[test]
fn the_tip_of_a_cone_has_a_normal() {
    let cone = shape(Solid::Revolved(Revolved::cylinder(2.0, 1.0, 0.0, Axis::Z).expect("a cone")));
    let scene = aggregate(&[at_origin(&cone)]);
    let down = ray([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]);
    let hits = straight_through(&scene, down);
    assert_eq!(hits.len(), 2);
    let (p, surface) = scene.local_surface(&down, &hits[0]);
    assert_eq!((p, surface.n_g), (DVec3::Z, DVec3::Z));
    assert!((hits[1].distance - 2.0).abs() < 1e-15);
}

#[test]
fn sizes_without_a_solid_are_refused() {
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(Revolved::cylinder(bad, 1.0, 1.0, Axis::Z), None);
        assert_eq!(Revolved::cylinder(1.0, bad, 1.0, Axis::Z), None);
        assert_eq!(Revolved::cylinder(1.0, 1.0, bad, Axis::Z), None);
        assert_eq!(Revolved::capsule(bad, 1.0, 1.0, Axis::Z), None);
        assert_eq!(Revolved::capsule(1.0, bad, 1.0, Axis::Z), None);
        assert_eq!(Revolved::capsule(1.0, 1.0, bad, Axis::Z), None);
    }
    assert_eq!(Revolved::cylinder(0.0, 1.0, 1.0, Axis::Z), None);
    assert_eq!(Revolved::cylinder(1.0, 0.0, 0.0, Axis::Z), None);
    assert_eq!(Revolved::capsule(1.0, 0.0, 0.0, Axis::Z), None);
    assert!(Revolved::capsule(0.0, 1.0, 1.0, Axis::Z).is_some());
}
