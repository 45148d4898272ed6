//! The named chains: prism, balls, deflector, smooth lens, ellipsoid, glass in glass.

use super::chain::{Action, Chain, Event, Law, Root, Start, Surface};
use glam::{DMat3, DQuat, DVec3};

const FOCAL_LENGTH: f64 = 1000.0;

fn event(surface: &Surface, root: Root, action: Action) -> Event {
    Event { surface: surface.clone(), root, action }
}

fn plane(point: [f64; 3], normal: [f64; 3]) -> Surface {
    Surface::Plane { point: point.into(), normal: DVec3::from_array(normal).normalize() }
}

fn chain(start: Start, media: Vec<Law>, events: Vec<Event>, receiver: Surface) -> Chain {
    Chain { start, media, first_medium: 0, events, receiver, receiver_root: Root::First, nanometers: 550.0 }
}

fn air_and(glass: Law) -> Vec<Law> {
    vec![Law::Constant(1.0), glass]
}

/// A 60° prism of SF66 near minimum deviation, skew to its principal section.
pub fn prism() -> Chain {
    let (sin, cos) = (0.5, 0.75_f64.sqrt());
    let entry = Surface::Triangle {
        corners: [DVec3::new(-1.0, 0.0, -2.0), DVec3::new(-1.0, 0.0, 2.0), DVec3::new(-1.0 + sin, cos, 0.0)],
        normals: None,
    };
    let exit = plane([1.0, 0.0, 0.0], [cos, sin, 0.0]);
    let look = DVec3::new(44_f64.to_radians().cos(), 44_f64.to_radians().sin(), 0.04);
    let start = Start::pinhole(DVec3::new(-0.9, 0.2, 0.1) - 3.0 * look, look, FOCAL_LENGTH);
    let events =
        vec![event(&entry, Root::First, Action::Interface(1)), event(&exit, Root::First, Action::Interface(0))];
    chain(start, air_and(Law::sf66()), events, plane([9.0, 0.0, 0.0], [-1.0, 0.3, 0.1]))
}

/// A ball of N-BK7 with 0 to 2 internal reflections (1: the rainbow, 2: the secondary one), onto a plane.
pub fn ball(internal_reflections: usize) -> Chain {
    let ball = Surface::Sphere { center: DVec3::new(0.1, -0.2, 0.3), radius: 1.25, inward: false };
    let look = DVec3::new(0.05, 0.11, 1.0);
    let start = Start::pinhole(DVec3::new(0.3, 0.2, -5.0), look, FOCAL_LENGTH);
    let mut events = vec![event(&ball, Root::First, Action::Interface(1))];
    events.extend((0..internal_reflections).map(|_| event(&ball, Root::Second, Action::Mirror)));
    events.push(event(&ball, Root::Second, Action::Interface(0)));
    let receiver = match internal_reflections {
        0 => plane([0.0, 0.0, 6.0], [0.1, 0.2, -1.0]),
        1 => plane([0.0, 0.0, -8.0], [0.1, -0.1, 1.0]),
        _ => Surface::Sphere { center: DVec3::new(0.4, 0.1, 0.0), radius: 20.0, inward: true },
    };
    let mut chain = chain(start, air_and(Law::bk7()), events, receiver);
    if internal_reflections > 1 {
        chain.receiver_root = Root::Second;
    }
    chain
}

/// A 45-90-45 prism used as a deflector by total reflection: d_λ = 0 though p_λ ≠ 0.
pub fn deflector() -> Chain {
    let leg_in = plane([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let hypotenuse = plane([0.0, 0.0, 0.0], [-1.0, 1.0, 0.0]);
    let leg_out = plane([0.0, 0.0, 0.0], [0.0, -1.0, 0.0]);
    let look = DVec3::new(-1.0, 0.05, 0.03);
    let start = Start::pinhole(DVec3::new(4.0, 0.4, 0.2), look, FOCAL_LENGTH);
    let events = vec![
        event(&leg_in, Root::First, Action::Interface(1)),
        event(&hypotenuse, Root::First, Action::Interface(0)),
        event(&leg_out, Root::First, Action::Interface(0)),
    ];
    chain(start, air_and(Law::bk7()), events, plane([0.0, -3.0, 0.0], [0.1, 1.0, 0.0]))
}

/// Two facets of a smooth-shaded biconvex lens of SF66: refraction twice, or with two mirrors between.
pub fn smooth_lens(internal_mirrors: bool) -> Chain {
    let facet = |z: f64, towards: f64| {
        let corners = [DVec3::new(-1.0, -0.8, z), DVec3::new(1.1, -0.7, z + 0.05), DVec3::new(0.1, 1.2, z - 0.03)];
        // Normals of a sphere of radius 6 through the corners' neighbourhood, of length other than 1 on purpose.
        let normals = corners.map(|c| 1.3 * DVec3::new(c.x / 6.0, c.y / 6.0, towards));
        let corners = if towards < 0.0 { [corners[0], corners[2], corners[1]] } else { corners };
        let normals = if towards < 0.0 { [normals[0], normals[2], normals[1]] } else { normals };
        Surface::Triangle { corners, normals: Some(normals) }
    };
    let (front, back) = (facet(0.0, -1.0), facet(0.7, 1.0));
    let look = DVec3::new(0.04, 0.06, 1.0);
    let start = Start::pinhole(DVec3::new(0.1, 0.05, -3.0), look, FOCAL_LENGTH);
    let mut events = vec![event(&front, Root::First, Action::Interface(1))];
    if internal_mirrors {
        events.push(event(&back, Root::First, Action::Mirror));
        events.push(event(&front, Root::First, Action::Mirror));
    }
    events.push(event(&back, Root::First, Action::Interface(0)));
    chain(start, air_and(Law::sf66()), events, plane([0.0, 0.0, 8.0], [0.1, 0.0, -1.0]))
}

/// A rotated ellipsoid of N-BK7 with an internal reflection.
pub fn ellipsoid() -> Chain {
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7));
    let matrix = DMat3::from_diagonal(DVec3::new(1.0, 1.0 / 1.5, 1.0 / 0.7)) * rotation;
    let body = Surface::Quadric { center: DVec3::new(0.1, 0.0, 0.2), matrix };
    let look = DVec3::new(0.06, 0.05, 1.0);
    let start = Start::pinhole(DVec3::new(-0.2, 0.1, -4.0), look, FOCAL_LENGTH);
    let events = vec![
        event(&body, Root::First, Action::Interface(1)),
        event(&body, Root::Second, Action::Mirror),
        event(&body, Root::Second, Action::Interface(0)),
    ];
    chain(start, air_and(Law::bk7()), events, plane([0.0, 0.0, -6.0], [0.2, 0.1, 1.0]))
}

/// A ball of SF66 inside a ball of N-BK7.
pub fn nested_glass() -> Chain {
    let outer = Surface::Sphere { center: DVec3::ZERO, radius: 2.0, inward: false };
    let inner = Surface::Sphere { center: DVec3::new(0.2, -0.1, 0.3), radius: 0.8, inward: false };
    let look = DVec3::new(0.03, 0.05, 1.0);
    let start = Start::pinhole(DVec3::new(0.1, -0.2, -6.0), look, FOCAL_LENGTH);
    let events = vec![
        event(&outer, Root::First, Action::Interface(1)),
        event(&inner, Root::First, Action::Interface(2)),
        event(&inner, Root::Second, Action::Interface(1)),
        event(&outer, Root::Second, Action::Interface(0)),
    ];
    let media = vec![Law::Constant(1.0), Law::bk7(), Law::sf66()];
    chain(start, media, events, plane([0.0, 0.0, 7.0], [0.0, 0.1, -1.0]))
}

/// All of them.
pub fn all() -> Vec<(&'static str, Chain)> {
    vec![
        ("prism", prism()),
        ("ball", ball(0)),
        ("ball, one internal reflection", ball(1)),
        ("ball, two internal reflections", ball(2)),
        ("deflector", deflector()),
        ("smooth lens", smooth_lens(false)),
        ("smooth lens, two internal mirrors", smooth_lens(true)),
        ("ellipsoid, internal reflection", ellipsoid()),
        ("glass in glass", nested_glass()),
    ]
}

/// Those with true geometric normals, for which the Lagrange invariants hold.
pub fn with_true_normals() -> Vec<(&'static str, Chain)> {
    all().into_iter().filter(|(name, _)| !name.starts_with("smooth")).collect()
}
