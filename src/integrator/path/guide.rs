//! Where light comes from that smooth glass and mirrors send: directions that photons have learned.
//!
//! From a diffuse surface neither a sampled light (the glass is in the way) nor, but by chance, a sampled direction leads to a lamp
//! behind glass. Photons (`photons.rs`) know the way: H. W. Jensen, "Importance driven path tracing using the photon map", EGWR 1995.
//! Space is divided into regions with about as many photons each. A region keeps the points of the glass that its photons
//! left, so that directions to them are right from everywhere in it (as the parallax-aware mixtures of L. Ruppert, S. Herholz, H. Lensch,
//! "Robust fitting of parallax-aware mixtures for path guiding", TOG 39(4), 2020), and gives each two caps of directions as wide as its
//! neighbours are far: the density of a direction is the sum over the caps it is in.
//!
//! A guide only says where to look. What is found is weighed against the BSDF's own directions, so that a poor guide costs time and
//! never light.

use std::f32::consts::TAU;

use glam::{DVec3, Vec3, Vec4};

/// Photons of a region.
const REGION: usize = 32;

/// The neighbours that a narrow cap and a wide one around it reach to, and the part of the directions that are of the wide one: what
/// photons have missed lies beside what they found.
const NEIGHBORS: [usize; 2] = [4, 12];
const WIDE: f32 = 0.25;

/// 1 − cos of the narrowest and the widest cap's half-angle: 2 mrad, which single precision resolves, and 90°.
const NARROWEST: f32 = 2e-6;
const WIDEST: f32 = 1.0;

/// Regions reach beyond their photons by this part of their largest extent.
const MARGIN: f64 = 0.25;

/// The least probability of looking: even faint light is found often enough not to come as a rare spark.
const LEAST: f32 = 0.1;

/// The probability where the irradiance is the median of the focused light; more takes time from all else.
const LOOKS: f32 = 2.0;

/// From a larger solid angle chance is as good, sr.
const LARGE: f32 = 2.5;

/// Light that arrived at a surface after nothing but smooth events.
#[derive(Clone, Copy, Debug)]
pub(super) struct Photon {
    /// Where it arrived, render space.
    pub(super) point: DVec3,
    /// Where it left the last smooth surface.
    pub(super) from: DVec3,
    /// In any unit.
    pub(super) flux: f32,
}

/// Directions towards a point, and around.
#[derive(Clone, Copy, Debug)]
struct Lobe {
    /// The point, relative to the region's centre.
    toward: Vec3,
    /// 1 − cos of the half-angles of a narrow cap and a wide one.
    heights: [f32; 2],
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
        Self { toward, caps: [cap(0, 1.0 - WIDE), cap(1, WIDE)] }
    }

    /// The densities of a direction from `at`.
    #[inline]
    fn pdf(&self, at: Vec3, direction: Vec3) -> Vec4 {
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
        within(self.caps[0]) + within(self.caps[1])
    }
}

/// A part of space with its photons.
#[derive(Clone, Debug)]
struct Region {
    center: DVec3,
    half_extent: DVec3,
    /// Flux, and that over the region's area.
    flux: f32,
    irradiance: f32,
    /// Probability with which a path of full weight looks for light from here.
    probability: f32,
    lobes: Vec<Lobe>,
    /// The same by four.
    densities: Vec<Lobes>,
}

/// Which region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RegionId(u32);

/// A node of the division of space.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// Below `at` on the axis the next node, else the node `above`.
    Split { axis: u8, at: f64, above: u32 },
    /// A region, if it is worth looking.
    Leaf(Option<RegionId>),
}

/// Directions of focused light.
#[derive(Debug)]
pub(super) struct Guide {
    nodes: Vec<Node>,
    regions: Vec<Region>,
}

impl Guide {
    /// Learned from photons; `None` if there is nothing to learn.
    pub(super) fn new(mut photons: Vec<Photon>) -> Option<Self> {
        photons.retain(|photon| photon.flux > 0.0 && photon.flux.is_finite() && photon.point.is_finite());
        let mut guide = Self { nodes: Vec::new(), regions: Vec::new() };
        guide.divide(&mut photons);
        guide.weigh();
        (!guide.regions.is_empty()).then_some(guide)
    }

    fn divide(&mut self, photons: &mut [Photon]) {
        let (min, max) = bounds(photons);
        let extent = max - min;
        if photons.len() < 2 * REGION || extent.max_element() <= 0.0 {
            let region = Region::new(photons).map(|region| {
                self.regions.push(region);
                RegionId(self.regions.len() as u32 - 1)
            });
            self.nodes.push(Node::Leaf(region));
            return;
        }
        let axis = extent.max_position();
        let middle = photons.len() / 2;
        let (below, at, _) = photons.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
        let (count, at) = (below.len(), at.point[axis]);
        let node = self.nodes.len();
        self.nodes.push(Node::Split { axis: axis as u8, at, above: 0 });
        let (below, rest) = photons.split_at_mut(count);
        self.divide(below);
        self.nodes[node] = Node::Split { axis: axis as u8, at, above: self.nodes.len() as u32 };
        self.divide(rest);
    }

    /// Looks are shared out by the square root of what is there, as strata by their deviation: most of the light has all of them.
    fn weigh(&mut self) {
        let mut sorted: Vec<(f32, f32)> = self.regions.iter().map(|region| (region.irradiance, region.flux)).collect();
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let half = 0.5 * sorted.iter().map(|(_, flux)| flux).sum::<f32>();
        let mut sum = 0.0;
        let median = sorted.iter().find(|(_, flux)| {
            sum += flux;
            sum >= half
        });
        let Some(&(median, _)) = median else { return };
        for region in &mut self.regions {
            region.probability = (LOOKS * (region.irradiance / median).sqrt()).clamp(LEAST, 1.0);
        }
    }

    /// Probability with which a path of full weight looks for light from the region.
    pub(super) fn probability(&self, id: RegionId) -> f32 {
        self.regions[id.0 as usize].probability
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
                    let region = &self.regions[id?.0 as usize];
                    let is_within = (point - region.center).abs().cmple(region.half_extent).all();
                    return id.filter(|_| is_within);
                }
            }
        }
    }

    /// A direction from `point`, in the region, and its density per solid angle; `u_lobe` chooses where about, `u_cap` how near.
    pub(super) fn sample(
        &self,
        id: RegionId,
        point: DVec3,
        [u_lobe, u_cap]: [f32; 2],
        u: [f32; 2],
    ) -> Option<(DVec3, f32)> {
        let region = &self.regions[id.0 as usize];
        let at = (point - region.center).as_vec3();
        let chosen = region.lobes.partition_point(|lobe| lobe.up_to <= u_lobe).min(region.lobes.len() - 1);
        let lobe = &region.lobes[chosen];
        let axis = (lobe.toward - at).try_normalize()?;
        let height = lobe.heights[usize::from(u_cap < WIDE)] * u[0];
        let (sin, cos) = ((height * (2.0 - height)).sqrt(), 1.0 - height);
        let (x, y) = axis.any_orthonormal_pair();
        let (sin_phi, cos_phi) = libm::sincosf(TAU * u[1]);
        let direction = (x * (sin * cos_phi) + y * (sin * sin_phi) + axis * cos).as_dvec3().normalize();
        // Rounding can put it just beyond the edge of its own cap, where nothing may be left.
        let pdf = region.pdf(at, direction.as_vec3());
        (pdf > 0.0).then_some((direction, pdf))
    }

    /// The density per solid angle with which [`sample`](Self::sample) draws a direction.
    pub(super) fn pdf(&self, id: RegionId, point: DVec3, direction: DVec3) -> f32 {
        let region = &self.regions[id.0 as usize];
        region.pdf((point - region.center).as_vec3(), direction.as_vec3())
    }
}

fn bounds(photons: &[Photon]) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    photons.iter().fold(empty, |(min, max), photon| (min.min(photon.point), max.max(photon.point)))
}

impl Region {
    /// `None` where light comes from so many directions that chance finds it.
    fn new(photons: &[Photon]) -> Option<Self> {
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
            Lobe { toward: towards[i], heights, share, up_to }
        };
        let lobes: Vec<Lobe> = (0..photons.len()).map(lobe).collect();
        let densities = lobes.chunks(4).map(Lobes::new).collect();
        // Surfaces are flat: the area is that of the two largest extents.
        let DVec3 { x, y, z } = max - min;
        let area = (x * y).max(y * z).max(z * x);
        let irradiance = (f64::from(total) / area.max(f64::MIN_POSITIVE)) as f32;
        let region = Self { center, half_extent, flux: total, irradiance, probability: 1.0, lobes, densities };
        // 1 over the mean density of its own directions.
        let mean: f32 =
            (photons.iter().zip(&directions)).map(|(p, d)| p.flux / total * region.pdf(Vec3::ZERO, *d)).sum();
        (1.0 / mean < LARGE).then_some(region)
    }

    fn pdf(&self, at: Vec3, direction: Vec3) -> f32 {
        self.densities.iter().map(|lobes| lobes.pdf(at, direction)).sum::<Vec4>().element_sum()
    }
}
