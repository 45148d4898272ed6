//! Where light comes from that smooth glass and mirrors send: directions that photons have learned.
//!
//! From a diffuse surface neither a sampled light (the glass is in the way) nor, but by chance, a sampled direction leads to a lamp
//! behind glass. Photons (`photons.rs`) know the way: H. W. Jensen, "Importance driven path tracing using the photon map", EGWR 1995.
//! Space is divided into regions with about as many photons each. A region keeps the points of the glass that its photons
//! left, so that directions to them are right from everywhere in it (as the parallax-aware mixtures of L. Ruppert, S. Herholz, H. Lensch,
//! "Robust fitting of parallax-aware mixtures for path guiding", TOG 39(4), 2020), and gives each two caps of directions as wide as its
//! neighbours are far; where the image of the light that the photon knows (`image.rs`) is smaller than the narrow one, it takes its
//! place. The density of a direction is the sum over the lobes it is in.
//!
//! At an interface a photon was reflected or went through, and a look that is drawn from its narrow lobe does the same (as Z. Fan et
//! al., "Manifold path guiding for importance sampling specular chains", TOG 42(6), 2023, choose the chain's kind): what a facet mirrors
//! faintly is found with certainty. Looks from wide caps choose by chance, like paths.
//!
//! A guide only says where to look. What is found is weighed against the BSDF's own directions, so that a poor guide costs time and
//! never light.

use std::f32::consts::TAU;
use std::ops::Range;

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::image::{Image, ImageLobe, ImageLobes};
use super::state::Way;

/// Photons of a region at least, twice as many at most. Error of the caustics of `benches/RESULTS.md`: 32 or 64 make up to 4 % more, 128
/// and 256 up to 20 %.
const REGION: usize = 48;

/// The neighbours that a narrow cap and a wide one around it reach to, and the part of the directions that are of the wide one: what
/// photons have missed lies beside what they found.
const NEIGHBORS: [usize; 2] = [4, 12];
const WIDE: f32 = 0.25;

/// 1 − cos of the narrowest and the widest cap's half-angle: 2 mrad, which single precision resolves, and 90°.
const NARROWEST: f32 = 2e-6;
const WIDEST: f32 = 1.0;

/// Regions reach beyond their photons by this part of their largest extent: a few photons do not reach all that their light does. More
/// changes nothing where regions touch.
const MARGIN: f64 = 0.25;

/// Looks over the share that focused light has of all, and the most. Error times time of the caustics of `benches/RESULTS.md`: 6 make 12 % (gem)
/// and 6 % (ball) more, 4 make 6 % and 8 % more.
const LOOKS: f32 = 8.0;
const MOST: f32 = 4.0;

/// The least: what is found must not come as a rare spark. A fifth of it is worse, twice as much is no better.
const LEAST: f32 = 0.1;

/// From a larger solid angle, in sr, chance is about as good: a diffuse surface's own directions fill as much as 3π/2 (1/∫ p² dω).
const LARGE: f32 = 2.5;

/// Light that arrived at a surface after nothing but smooth events.
#[derive(Clone, Copy, Debug)]
pub(super) struct Photon {
    /// Where it arrived, render space.
    pub(super) point: DVec3,
    /// Where it left the last smooth surface.
    pub(super) from: DVec3,
    /// Luminance times area and solid angle.
    pub(super) flux: f32,
    /// What it has seen of the light.
    pub(super) image: Option<Image>,
    /// The way back.
    pub(super) way: Way,
}

/// Directions towards a point, and around.
#[derive(Clone, Copy, Debug)]
struct Lobe {
    /// The point, relative to the region's centre.
    toward: Vec3,
    /// 1 − cos of the half-angles of a narrow cap and a wide one.
    heights: [f32; 2],
    /// In the place of the narrow cap.
    image: Option<ImageLobe>,
    /// What a look from the narrow cap or the image takes.
    way: Way,
    share: f32,
    /// Shares up to this one with it, 0..=1.
    up_to: f32,
}

/// The densities of four lobes, lane by lane.
#[derive(Clone, Copy, Debug)]
struct Lobes {
    toward: [Vec4; 3],
    /// Of the narrow caps and the wide ones: sin² of the half-angle, and the cap's share over its solid angle, 1/sr.
    caps: [(Vec4, Vec4); 2],
    /// Of the narrow ones.
    ways: Vec4,
}

/// A density of looks per solid angle.
#[derive(Clone, Copy, Debug, Default)]
struct Density {
    /// Of those that take a certain way.
    certain: Vec4,
    /// Of those that choose.
    choosing: Vec4,
}

impl Lobes {
    /// Of up to four lobes; further lanes have no density.
    fn new(lobes: &[Lobe]) -> Self {
        let lanes = |of: &dyn Fn(&Lobe) -> f32| Vec4::from_array(std::array::from_fn(|i| lobes.get(i).map_or(0.0, of)));
        let cap = |cap: usize, part: f32| {
            let sin2 = lanes(&|lobe| lobe.heights[cap] * (2.0 - lobe.heights[cap]));
            (sin2, lanes(&|lobe| part * lobe.share / (TAU * lobe.heights[cap])))
        };
        let toward = [0, 1, 2].map(|axis| lanes(&|lobe| lobe.toward[axis]));
        let mut caps = [cap(0, 1.0 - WIDE), cap(1, WIDE)];
        caps[0].1 *= lanes(&|lobe| f32::from(u8::from(lobe.image.is_none())));
        Self { toward, caps, ways: lanes(&|lobe| lobe.way.number()) }
    }

    /// The densities of a direction from `at` by the way with a number.
    #[inline]
    fn pdf(&self, at: Vec3, direction: Vec3, way: Vec4) -> Density {
        let [x, y, z] = self.toward;
        let (x, y, z) = (x - at.x, y - at.y, z - at.z);
        let along = x * direction.x + y * direction.y + z * direction.z;
        // The sine, by which small angles do not lose digits.
        let across =
            [y * direction.z - z * direction.y, z * direction.x - x * direction.z, x * direction.y - y * direction.x];
        let [across2, length2] = [across, [x, y, z]].map(|[x, y, z]| x * x + y * y + z * z);
        let within = |(sin2, density): (Vec4, Vec4)| {
            Vec4::select(across2.cmplt(sin2 * length2) & along.cmpgt(Vec4::ZERO), density, Vec4::ZERO)
        };
        let certain = Vec4::select(self.ways.cmpeq(way), within(self.caps[0]), Vec4::ZERO);
        Density { certain, choosing: within(self.caps[1]) }
    }
}

/// A part of space with its photons.
#[derive(Clone, Debug)]
struct Region {
    center: DVec3,
    half_extent: DVec3,
    /// Looks from here by a path of full weight.
    count: f32,
    lobes: Vec<Lobe>,
    /// The same by four: caps, and those lobes that are images.
    caps: Vec<Lobes>,
    images: Vec<ImageLobes>,
}

/// Which region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RegionId(u32);

/// A direction to look in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    /// A unit vector.
    pub(super) direction: DVec3,
    /// The way that the look takes; `None` if it chooses by chance.
    pub(super) way: Option<Way>,
}

/// A node of the division of space.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// Below `at` on the axis the next node, else the node `above`.
    Split {
        axis: u8,
        at: f64,
        above: u32,
    },
    Leaf(RegionId),
}

/// Directions of focused light.
#[derive(Debug)]
pub(super) struct Guide {
    nodes: Vec<Node>,
    /// `None` where looking is not worth it.
    regions: Vec<Option<Region>>,
}

impl Guide {
    /// Learned from photons; `None` if there is nothing to learn. `others` says what other light falls on the middle of a
    /// region with a number.
    pub(super) fn new(mut photons: Vec<Photon>, others: impl Fn(u32, DVec3) -> f32 + Sync) -> Option<Self> {
        photons.retain(|photon| photon.flux > 0.0 && photon.flux.is_finite() && photon.point.is_finite());
        let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
        divide(&mut photons, 0, &mut nodes, &mut leaves);
        let region = |(number, leaf): (usize, &Range<usize>)| {
            Region::new(&photons[leaf.clone()], |center| others(number as u32, center))
        };
        let regions: Vec<Option<Region>> = leaves.par_iter().enumerate().map(region).collect();
        regions.iter().any(Option::is_some).then_some(Self { nodes, regions })
    }

    fn get(&self, id: RegionId) -> &Region {
        self.regions[id.0 as usize].as_ref().expect("only regions have numbers")
    }

    /// How many times, as a mean, a path that carries `weight` looks for light from the region.
    pub(super) fn count(&self, id: RegionId, weight: f32) -> f32 {
        (weight * self.get(id).count).clamp(0.0, MOST)
    }

    /// The region about a point; `None` where no focused light is known of.
    pub(super) fn region(&self, point: DVec3) -> Option<RegionId> {
        let mut node = 0;
        loop {
            match self.nodes[node] {
                Node::Split { axis, at, above } => {
                    node = if point[usize::from(axis)] < at { node + 1 } else { above as usize };
                }
                Node::Leaf(id) => {
                    let region = self.regions[id.0 as usize].as_ref()?;
                    let is_within = (point - region.center).abs().cmple(region.half_extent).all();
                    return is_within.then_some(id);
                }
            }
        }
    }

    /// A direction from `point`, in the region, and the way that the look takes from there if it is certain; `u_lobe` chooses where
    /// about, `u_cap` how near.
    pub(super) fn sample(&self, id: RegionId, point: DVec3, [u_lobe, u_cap]: [f32; 2], u: [f32; 2]) -> Option<Drawn> {
        let region = self.get(id);
        let at = (point - region.center).as_vec3();
        let chosen = region.lobes.partition_point(|lobe| lobe.up_to <= u_lobe).min(region.lobes.len() - 1);
        let lobe = &region.lobes[chosen];
        let is_wide = u_cap < WIDE;
        let way = (!is_wide).then_some(lobe.way);
        if let Some(image) = lobe.image.filter(|_| !is_wide) {
            let direction = image.direction(at, u).as_dvec3().try_normalize()?;
            return Some(Drawn { direction, way });
        }
        let axis = (lobe.toward - at).try_normalize()?;
        let height = lobe.heights[usize::from(is_wide)] * u[0];
        let (sin, cos) = ((height * (2.0 - height)).sqrt(), 1.0 - height);
        let (x, y) = axis.any_orthonormal_pair();
        let (sin_phi, cos_phi) = libm::sincosf(TAU * u[1]);
        let direction = (x * (sin * cos_phi) + y * (sin * sin_phi) + axis * cos).as_dvec3().normalize();
        Some(Drawn { direction, way })
    }

    /// The density per solid angle with which [`sample`](Self::sample) draws a direction and its look takes the way, over the probability
    /// `chosen` with which one that chooses does.
    pub(super) fn pdf(&self, id: RegionId, point: DVec3, direction: DVec3, way: Way, chosen: f32) -> f32 {
        let region = self.get(id);
        region.pdf((point - region.center).as_vec3(), direction.as_vec3(), way, chosen)
    }
}

/// Halves the photons again and again, until each part has few; `begin` is the place of the first one among all.
fn divide(photons: &mut [Photon], begin: usize, nodes: &mut Vec<Node>, leaves: &mut Vec<Range<usize>>) {
    let (min, max) = bounds(photons);
    let extent = max - min;
    let is_point = extent.max_element() <= 0.0;
    if photons.len() < 2 * REGION || is_point {
        nodes.push(Node::Leaf(RegionId(leaves.len() as u32)));
        // Any of many in one point say the same.
        leaves.push(begin..begin + photons.len().min(2 * REGION));
        return;
    }
    let axis = extent.max_position();
    let middle = photons.len() / 2;
    let (_, at, _) = photons.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    let at = at.point[axis];
    let node = nodes.len();
    nodes.push(Node::Split { axis: axis as u8, at, above: 0 });
    let (below, rest) = photons.split_at_mut(middle);
    divide(below, begin, nodes, leaves);
    nodes[node] = Node::Split { axis: axis as u8, at, above: nodes.len() as u32 };
    divide(rest, begin + middle, nodes, leaves);
}

fn bounds(photons: &[Photon]) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    photons.iter().fold(empty, |(min, max), photon| (min.min(photon.point), max.max(photon.point)))
}

impl Region {
    /// `None` where light comes from so many directions that chance finds it.
    fn new(photons: &[Photon], others: impl Fn(DVec3) -> f32) -> Option<Self> {
        if photons.len() <= NEIGHBORS[1] {
            return None;
        }
        let (min, max) = bounds(photons);
        let center = 0.5 * (min + max);
        let half_extent = 0.5 * (max - min) + MARGIN * (max - min).max_element();
        let towards: Vec<Vec3> = photons.iter().map(|photon| (photon.from - center).as_vec3()).collect();
        let directions: Vec<Vec3> = towards.iter().map(|toward| toward.normalize_or_zero()).collect();
        let total: f32 = photons.iter().map(|photon| photon.flux).sum();
        let mut up_to = 0.0;
        let lobe = |i: usize| {
            // Of unit vectors |a − b|² = 2 (1 − cos).
            let mut heights: Vec<f32> =
                directions.iter().map(|d| 0.5 * (*d - directions[i]).length_squared()).collect();
            let (nearer, &mut wide, _) = heights.select_nth_unstable_by(NEIGHBORS[1], f32::total_cmp);
            let (_, &mut narrow, _) = nearer.select_nth_unstable_by(NEIGHBORS[0], f32::total_cmp);
            let heights = [narrow, wide].map(|height| height.clamp(NARROWEST, WIDEST));
            let share = photons[i].flux / total;
            up_to += share;
            // An image's size on the plane of tangents is at least the solid angle.
            let is_smaller = |image: &Image| image.size() < f64::from(TAU * heights[0]);
            let image = photons[i].image.filter(is_smaller).map(|image| image.lobe(photons[i].point - center));
            Lobe { toward: towards[i], heights, image, way: photons[i].way, share, up_to }
        };
        let lobes: Vec<Lobe> = (0..photons.len()).map(lobe).collect();
        let caps = lobes.chunks(4).map(Lobes::new).collect();
        let image = |lobe: &Lobe| Some((lobe.image?, lobe.way, (1.0 - WIDE) * lobe.share));
        let images: Vec<_> = lobes.iter().filter_map(image).collect();
        let images = images.chunks(4).map(ImageLobes::new).collect();
        // Surfaces are flat: the area is that of the two largest extents.
        let DVec3 { x, y, z } = max - min;
        let area = (x * y).max(y * z).max(z * x);
        let mut region = Self { center, half_extent, count: 1.0, lobes, caps, images };
        // 1 over the mean density of its own directions.
        let mean: f32 = (photons.iter().zip(&directions))
            .map(|(p, d)| p.flux / total * region.pdf(Vec3::ZERO, *d, p.way, 1.0))
            .sum();
        let solid_angle = 1.0 / mean;
        if solid_angle > LARGE {
            return None;
        }
        let irradiance = (f64::from(total) / area).min(f64::from(f32::MAX)) as f32;
        let share = 1.0 / (1.0 + others(center) / irradiance);
        region.count = (LOOKS * share).max(LEAST);
        Some(region)
    }

    fn pdf(&self, at: Vec3, direction: Vec3, way: Way, chosen: f32) -> f32 {
        let way = Vec4::splat(way.number());
        let mut all = Density::default();
        for caps in &self.caps {
            let Density { certain, choosing } = caps.pdf(at, direction, way);
            all.certain += certain;
            all.choosing += choosing;
        }
        for images in &self.images {
            all.certain += images.pdf(at, direction, way);
        }
        // The probability of many faint reflections may be too small for a number.
        (all.certain * (1.0 / chosen.max(f32::MIN_POSITIVE)) + all.choosing).element_sum().min(f32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::super::image::Trail;
    use super::*;
    use crate::geometry::Ray;
    use crate::lighting::Patch;
    use crate::ray::Curvature;

    fn uniform(i: u32, salt: u32) -> f32 {
        let mut z = u64::from(i) << 32 | u64::from(salt);
        z = (z ^ (z >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        z = (z ^ (z >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
        ((z ^ (z >> 33)) >> 40) as f32 / 16_777_216.0
    }

    /// Photons on a floor of 2 × 2 that left a lens of radius 0.3 above it, brighter on one side.
    fn photons(count: u32) -> Vec<Photon> {
        let around = |i: u32, salt: u32| f64::from(uniform(i, salt)) * 2.0 - 1.0;
        (0..count)
            .map(|i| Photon {
                point: DVec3::new(around(i, 1), 0.0, around(i, 2)),
                from: DVec3::new(0.3 * around(i, 3), 1.0, 0.3 * around(i, 4)),
                flux: 0.1 + uniform(i, 5),
                image: None,
                way: Way::START.then(i % 3 == 0),
            })
            .collect()
    }

    /// The image of a lamp of 0.2 × 0.2 at (0, 2, 0), seen from below with nothing in between.
    fn with_images(mut photons: Vec<Photon>) -> Vec<Photon> {
        for (photon, i) in photons.iter_mut().zip(0..) {
            let around = |salt: u32| f64::from(uniform(i, salt)) * 2.0 - 1.0;
            let half = [DVec3::X * 0.1, DVec3::Z * 0.1];
            let origin = DVec3::Y * 2.0 + around(6) * half[0] + around(7) * half[1];
            let direction = (photon.point - origin).normalize();
            let patch = Patch { center: DVec3::Y * 2.0, half, is_infinite: false };
            let mut trail = Trail::new(patch, &Ray { origin, direction, time: 0.0 }).unwrap();
            trail.transfer_to((photon.point - origin).length(), direction, DVec3::Y, Curvature::Plane, 1.0);
            photon.image = trail.image(direction, 1.0);
        }
        photons
    }

    #[test]
    fn directions_are_drawn_with_their_density() {
        let ways = [false, true].map(|passes| Way::START.then(passes));
        for photons in [photons(2000), with_images(photons(2000))] {
            let guide = Guide::new(photons, |_, _| 0.0).unwrap();
            let point = DVec3::new(0.4, 0.0, -0.3);
            let id = guide.region(point).unwrap();
            // A look that chooses by chance takes the first way with this probability.
            let chosen = 0.3f32;
            let chances = [chosen, 1.0 - chosen];
            // Of a smooth function: its mean over what is drawn, and ∫ of it times the density, with ∫ of the density itself.
            let f = |d: DVec3| (3.0 * d.x).sin() + d.z * d.y;
            let count = 400_000;
            let (mut drawn, mut integral, mut whole) = ([0.0; 2], [0.0; 2], 0.0);
            let mut beyond = 0;
            for i in 0..count {
                let u = |salt| uniform(i, salt);
                let Drawn { direction, way } = guide.sample(id, point, [u(1), u(2)], [u(3), u(4)]).unwrap();
                let taken = way.unwrap_or(ways[usize::from(u(7) >= chosen)]);
                let way = usize::from(taken == ways[1]);
                drawn[way] += f(direction) / f64::from(count);
                beyond += u32::from(guide.pdf(id, point, direction, taken, chances[way]) <= 0.0);
                // Even directions of the cone in which all lobes are, half of the upper hemisphere.
                let (y, phi) = (f64::from(u(5)), f64::from(TAU * u(6)));
                let r = (1.0 - y * y).sqrt();
                let direction = DVec3::new(r * phi.cos(), y, r * phi.sin());
                for way in 0..2 {
                    let pdf = chances[way] * guide.pdf(id, point, direction, ways[way], chances[way]);
                    let weight = f64::from(pdf) * f64::from(TAU) / f64::from(count);
                    whole += weight;
                    integral[way] += weight * f(direction);
                }
            }
            assert!((whole - 1.0).abs() < 0.01, "{whole}");
            // Rounding puts one of 10⁵ or so beyond the edge of its own lobe.
            assert!(beyond <= count / 10_000, "{beyond}");
            for way in 0..2 {
                assert!((drawn[way] - integral[way]).abs() < 0.01, "{drawn:?} {integral:?}");
            }
        }
    }

    #[test]
    fn images_are_where_the_lamp_is() {
        let guide = Guide::new(with_images(photons(2000)), |_, _| 0.0).unwrap();
        for point in [DVec3::new(0.9, 0.0, 0.9), DVec3::new(-0.5, 0.0, 0.1), DVec3::ZERO] {
            let region = guide.get(guide.region(point).unwrap());
            let images: Vec<ImageLobe> = region.lobes.iter().filter_map(|lobe| lobe.image).collect();
            assert!(images.len() > REGION / 2, "{}", images.len());
            for (image, i) in images.iter().zip(0..) {
                let u = [uniform(i, 3), uniform(i, 4)];
                let direction = image.direction((point - region.center).as_vec3(), u).as_dvec3();
                let at = point + direction * ((2.0 - point.y) / direction.y);
                let wanted = u.map(|u| 0.2 * f64::from(u) - 0.1);
                // To first order: points of a region are up to 0.4 apart, a fifth of the way to the lamp, of which the square is 0.08.
                assert!((at - DVec3::new(wanted[0], 2.0, wanted[1])).length() < 0.08, "{at}");
            }
        }
    }

    #[test]
    fn directions_lead_to_where_the_photons_came_from() {
        let guide = Guide::new(photons(2000), |_, _| 0.0).unwrap();
        for point in [DVec3::new(0.9, 0.0, 0.9), DVec3::new(-0.5, 0.0, 0.1), DVec3::ZERO] {
            let id = guide.region(point).unwrap();
            let lens = (0..1000).filter(|&i| {
                let u = |salt| uniform(i, salt);
                let Drawn { direction, .. } = guide.sample(id, point, [u(1), u(2)], [u(3), u(4)]).unwrap();
                let at = point + direction * ((1.0 - point.y) / direction.y);
                at.x.abs() < 0.35 && at.z.abs() < 0.35
            });
            // The narrow caps have three quarters of the directions; some of theirs, by the rim of the lens, pass it.
            let count = lens.count();
            assert!(count > 650, "{count} of 1000");
        }
    }

    #[test]
    fn nothing_is_looked_for_where_no_photon_came() {
        let guide = Guide::new(photons(2000), |_, _| 0.0).unwrap();
        assert!(guide.region(DVec3::new(0.0, 3.0, 0.0)).is_none());
        assert!(guide.region(DVec3::new(9.0, 0.0, 0.0)).is_none());
        assert!(Guide::new(Vec::new(), |_, _| 0.0).is_none() && Guide::new(photons(5), |_, _| 0.0).is_none());
        let broken = Photon { point: DVec3::NAN, from: DVec3::ZERO, flux: f32::NAN, image: None, way: Way::START };
        assert!(Guide::new(vec![broken; 500], |_, _| 0.0).is_none());
        // All in one point: a region without extent.
        let same = Photon { point: DVec3::ONE, from: DVec3::Y * 3.0, flux: 1.0, image: None, way: Way::START };
        let guide = Guide::new(vec![same; 500], |_, _| 0.0).unwrap();
        let id = guide.region(DVec3::ONE).unwrap();
        let Drawn { direction, .. } = guide.sample(id, DVec3::ONE, [0.5; 2], [0.5; 2]).unwrap();
        let pdf = guide.pdf(id, DVec3::ONE, direction, Way::START, 0.0);
        assert!(direction.is_finite() && pdf.is_finite() && (0.0..=MOST).contains(&guide.count(id, 1.0)));
    }

    #[test]
    fn light_from_everywhere_is_left_to_chance() {
        let from_everywhere = |i: u32| {
            let (y, phi) = (f64::from(uniform(i, 1)), f64::from(TAU * uniform(i, 2)));
            let r = (1.0 - y * y).sqrt();
            let point = DVec3::new(f64::from(uniform(i, 3)), 0.0, f64::from(uniform(i, 4)));
            Photon {
                point,
                from: point + DVec3::new(r * phi.cos(), y, r * phi.sin()),
                flux: 1.0,
                image: None,
                way: Way::START,
            }
        };
        assert!(Guide::new((0..1000).map(from_everywhere).collect(), |_, _| 0.0).is_none());
    }

    #[test]
    fn faint_light_is_looked_for_seldom() {
        let count = |others: f32| {
            let guide = Guide::new(photons(2000), |_, _| others)?;
            let id = guide.region(DVec3::ZERO)?;
            Some(guide.count(id, 1.0))
        };
        // 2000 photons of 0.6 on 4: an irradiance of 300 from a tenth of a steradian or two.
        assert_eq!(count(0.0), Some(MOST));
        assert!(count(1e4).is_some_and(|n| (0.15..0.35).contains(&n)));
        assert_eq!(count(1e9), Some(LEAST));
    }
}
