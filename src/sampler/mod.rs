//! Where in the pixel, on the lens and in the shutter's time samples are taken: decided by (pixel, sample index, seed) alone.
//!
//! Dimensions of the Sobol' sequence: 0, 1 the position in the pixel (x right, y down); 2, 3 the point on the lens, from one
//! call with them; 4 the time; 5 the wavelength; from 8 on, by fours, what the vertices of a path need. Owen-scrambled per
//! pixel and dimension (B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020): the first 2ⁿ samples of a pixel are
//! stratified in every dimension, so that neither subsets nor growing numbers of samples lose by it.

pub mod filter;

use crate::error::{Error, Result};
use filter::Filter;
use sobol_burley::parts;
use std::sync::LazyLock;

/// The most samples a pixel can have. Their indices count in `u32` with room for the nodes of sums over them.
pub const MAX_SAMPLES: u32 = 1 << 24;

/// The length of the Sobol' sequence that `sobol_burley` holds. Longer renders go through it again and again, each time in another
/// scramble: every such block is stratified, and blocks are independent of each other.
const BLOCK: u32 = 1 << 16;

/// An index within its block and the seed of the block, from the seed of a pixel.
#[inline]
fn in_block(index: u32, seed: u64) -> (u32, u32) {
    let seed = match index / BLOCK {
        0 => seed,
        block => hash(seed ^ hash(u64::from(block))),
    };
    (index % BLOCK, (seed ^ (seed >> 32)) as u32)
}

/// The Sobol' dimension of the time.
const TIME: u32 = 4;

/// The Sobol' dimension of the wavelength.
const WAVELENGTH: u32 = 5;

/// The first group of four dimensions that paths use.
const FIRST_GROUP: u32 = 2;

/// Groups of four dimensions that `sobol_burley` has; after them numbers are independent.
const GROUPS: u32 = sobol_burley::NUM_DIMENSIONS / 4;

/// The numbers of one path after its camera ray, four at a time.
#[derive(Clone, Copy, Debug)]
pub struct PathSampler {
    index: u32,
    pixel_seed: u64,
    group: u32,
    /// The sample's place in the sequence and the seed of its scrambles.
    point: Point,
}

/// What `sobol_burley` scrambles the dimensions of a group with.
const SCRAMBLES: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];

/// Of every group of four dimensions, the sums of the direction vectors that each hexadecimal digit of an index stands for.
type Sums = [[[u32; 4]; 16]; 4];
static SUMS: LazyLock<Vec<Sums>> = LazyLock::new(|| {
    let dimensions = |group: u32, index_rev: u32| [0, 1, 2, 3].map(|i| parts::sobol_rev(index_rev, 4 * group + i));
    let sums =
        |group| [16, 20, 24, 28].map(|shift| std::array::from_fn(|digit| dimensions(group, (digit as u32) << shift)));
    (0..GROUPS).map(sums).collect()
});

/// A point of the Owen-scrambled Sobol' sequence: `sobol_burley::sample_4d`, bit by bit, with what all dimensions share computed once.
#[derive(Clone, Copy, Debug)]
struct Point {
    shuffled_rev: u32,
    seed: u32,
}

impl Point {
    #[inline]
    fn new(index: u32, seed: u32) -> Self {
        let scramble = parts::hash(seed ^ 0x79c6_8e4a);
        Self {
            shuffled_rev: parts::owen_scramble_rev(index.reverse_bits(), scramble),
            seed: seed.wrapping_mul(0x9c8f_2d3b),
        }
    }

    /// The bits of four dimensions before they are scrambled, in reverse.
    #[inline]
    fn sobol_rev(&self, group: u32) -> [u32; 4] {
        let sums = &SUMS[group as usize];
        let digit = |k: usize| sums[k][(self.shuffled_rev >> (16 + 4 * k) & 15) as usize];
        let (a, b, c, d) = (digit(0), digit(1), digit(2), digit(3));
        std::array::from_fn(|i| a[i] ^ b[i] ^ c[i] ^ d[i])
    }

    #[inline]
    fn dimension(&self, dimension: u32) -> f32 {
        let (group, lane) = (dimension / 4, dimension as usize % 4);
        self.scrambled(self.sobol_rev(group)[lane], group, lane)
    }

    /// Four dimensions at once.
    #[inline]
    fn dimensions(&self, group: u32) -> [f32; 4] {
        let sobol = self.sobol_rev(group);
        std::array::from_fn(|lane| self.scrambled(sobol[lane], group, lane))
    }

    #[inline(always)]
    fn scrambled(&self, sobol_rev: u32, group: u32, lane: usize) -> f32 {
        let scramble = parts::hash(SCRAMBLES[lane] ^ self.seed ^ group);
        parts::u32_to_f32_norm(parts::owen_scramble_rev(sobol_rev, scramble).reverse_bits())
    }
}

impl PathSampler {
    fn new(index: u32, pixel_seed: u64, group: u32) -> Self {
        let (in_block, block_seed) = in_block(index, pixel_seed);
        Self { index, pixel_seed, group, point: Point::new(in_block, block_seed) }
    }

    /// The place of the hero wavelength, 0..1: stratified over the pixel's samples.
    #[inline]
    pub fn wavelength(&self) -> f64 {
        self.point.dimension(WAVELENGTH).into()
    }

    /// Four numbers in 0..1, the next of the path.
    #[inline]
    pub fn draw(&mut self) -> [f32; 4] {
        let four = self.four();
        std::array::from_fn(|i| four.at(i))
    }

    /// The same where not all of them may be needed.
    #[inline]
    pub fn four(&mut self) -> Four {
        let group = self.group;
        self.group += 1;
        Four(if group < GROUPS {
            Drawn::Stratified { sobol_rev: self.point.sobol_rev(group), point: self.point, group }
        } else {
            Drawn::Independent(hash(self.pixel_seed ^ (u64::from(self.index) << 32 | u64::from(group))))
        })
    }

    /// The numbers of a side path that begins here: independent of all others, stratified over the pixel's samples themselves.
    pub fn branch(&self) -> Self {
        Self::new(self.index, hash(self.pixel_seed ^ hash(!u64::from(self.group))), FIRST_GROUP)
    }

    /// A number in 0..1 for something that has a number of its own on the way: independent of all others.
    pub fn of(&self, what: u64) -> f32 {
        unit(hash(self.pixel_seed ^ hash(what ^ (u64::from(self.index) << 32 | u64::from(self.group)))))
    }
}

/// Four numbers in 0..1 that a path has drawn, each computed when it is asked for: scrambling them is most of the work.
#[derive(Clone, Copy, Debug)]
pub struct Four(Drawn);

#[derive(Clone, Copy, Debug)]
enum Drawn {
    /// Of the sequence, not scrambled yet.
    Stratified { sobol_rev: [u32; 4], point: Point, group: u32 },
    /// Beyond it: what their hashes begin with.
    Independent(u64),
}

impl Four {
    /// The number `i` of the four.
    #[inline]
    pub fn at(&self, i: usize) -> f32 {
        match self.0 {
            Drawn::Stratified { sobol_rev, point, group } => point.scrambled(sobol_rev[i], group, i),
            Drawn::Independent(state) => unit((0..=i).fold(state, |state, _| hash(state))),
        }
    }
}

/// Everything that a camera ray depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSample {
    /// On the full raster in pixels, x right, y down from the top-left corner.
    pub raster: [f64; 2],
    /// On the lens, as a point of the unit square; (½, ½) is its centre.
    pub lens: [f64; 2],
    /// Within the shutter's opening, 0 to 1; ½ is its middle.
    pub time: f64,
}

impl CameraSample {
    /// At raster position (`x`, `y`), through the centre of the lens, at the middle of the shutter's time.
    pub const fn at(x: f64, y: f64) -> Self {
        Self { raster: [x, y], lens: [0.5; 2], time: 0.5 }
    }

    /// The same but for the raster position, moved by `x` right and `y` down.
    pub fn moved(&self, x: f64, y: f64) -> Self {
        Self { raster: [self.raster[0] + x, self.raster[1] + y], ..*self }
    }
}

/// Samples of pixels.
#[derive(Clone, Debug)]
pub struct Sampler {
    samples: u32,
    seed: u64,
    over_time: bool,
    /// `None` for the pixel itself.
    filter: Option<Filter>,
}

impl Sampler {
    /// A sampler for `samples` samples a pixel, at least 1.
    pub fn new(samples: u32, seed: u64) -> Result<Self> {
        if samples == 0 || samples > MAX_SAMPLES {
            return Err(Error::usage("--samples", format!("must be 1 to {MAX_SAMPLES}, not {samples}")));
        }
        Ok(Self { samples, seed, over_time: false, filter: None })
    }

    /// The same sampler, with samples spread over time, or all in the middle of it. Nothing else of a sample changes.
    pub fn over_time(self, over_time: bool) -> Self {
        Self { over_time, ..self }
    }

    /// The same sampler, with samples spread over the pixel as `filter` weighs its surroundings. Nothing else of a sample changes.
    pub fn filtered(self, filter: &Filter) -> Self {
        Self { filter: (!filter.is_pixel()).then(|| filter.clone()), ..self }
    }

    /// The numbers of the path that sample `index` of `pixel` begins.
    pub fn path(&self, pixel: [i32; 2], index: u32) -> PathSampler {
        PathSampler::new(index, self.pixel_seed(pixel), FIRST_GROUP)
    }

    /// Independent numbers for the path that sample `index` of `pixel` begins: nothing of them is stratified.
    pub fn independent(&self, pixel: [i32; 2], index: u32) -> PathSampler {
        PathSampler::new(index, hash(self.pixel_seed(pixel)), GROUPS)
    }

    fn pixel_seed(&self, pixel: [i32; 2]) -> u64 {
        hash(self.seed ^ (u64::from(pixel[0] as u32) << 32 | u64::from(pixel[1] as u32)))
    }

    /// Sample `index` of `pixel`.
    ///
    /// One sample stands at the centre of everything; more follow an Owen-scrambled Sobol' sequence (Burley 2020), scrambled
    /// per pixel.
    pub fn sample(&self, pixel: [i32; 2], index: u32) -> CameraSample {
        self.start(pixel, &self.path(pixel, index))
    }

    /// The sample of `pixel` with which the path of these `numbers`, none of which it has drawn yet, begins.
    #[inline]
    pub fn start(&self, pixel: [i32; 2], numbers: &PathSampler) -> CameraSample {
        let [x, y] = pixel.map(f64::from);
        if self.samples == 1 {
            return CameraSample::at(x + 0.5, y + 0.5);
        }
        let point = numbers.point;
        let [dx, dy, u, v] = point.dimensions(0).map(f64::from);
        let time = if self.over_time { point.dimension(TIME).into() } else { 0.5 };
        let raster = match &self.filter {
            None => [x + dx, y + dy],
            Some(filter) => {
                let [dx, dy] = filter.offset([dx, dy]);
                [x + 0.5 + dx, y + 0.5 + dy]
            }
        };
        CameraSample { raster, lens: [u, v], time }
    }
}

/// The first bits of `x` as a number in 0..1: 24 fill the mantissa, so that it is never 1.
#[inline]
fn unit(x: u64) -> f32 {
    (x >> 40) as f32 * (1.0 / 16_777_216.0)
}

/// Mixes all bits of `x` (finaliser of SplitMix64; Steele, Lea, Flood 2014).
fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the law under test")]
mod tests {
    use super::*;

    #[test]
    fn one_sample_stands_at_the_centre() {
        assert_eq!(Sampler::new(1, 7).unwrap().sample([3, -4], 0), CameraSample::at(3.5, -3.5));
    }

    #[test]
    fn every_quarter_of_pixel_and_lens_gets_a_quarter_of_the_samples() {
        let sampler = Sampler::new(64, 1).unwrap();
        let mut counts = [[0; 4]; 2];
        for i in 0..64 {
            let CameraSample { raster: [x, y], lens, .. } = sampler.sample([10, 20], i);
            for (counts, [x, y]) in counts.iter_mut().zip([[x - 10.0, y - 20.0], lens]) {
                assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                counts[usize::from(x >= 0.5) + 2 * usize::from(y >= 0.5)] += 1;
            }
        }
        assert_eq!(counts, [[16; 4]; 2]);
    }

    #[test]
    fn points_are_those_of_the_sequence() {
        for (index, seed) in [(0, 0), (1, 7), (12_345, 0xdead_beef), (BLOCK - 1, u32::MAX)] {
            let point = Point::new(index, seed);
            for group in 0..GROUPS {
                let wanted = sobol_burley::sample_4d(index, group, seed);
                assert_eq!(point.dimensions(group), wanted);
                assert_eq!([0, 1, 2, 3].map(|i| point.dimension(4 * group + i)), wanted);
            }
        }
    }

    #[test]
    fn neighbours_and_seeds_differ() {
        let within = |seed, pixel: [i32; 2]| {
            let sample = Sampler::new(16, seed).unwrap().sample(pixel, 5);
            (sample.moved(f64::from(-pixel[0]), f64::from(-pixel[1])).raster, sample.lens)
        };
        assert_ne!(within(0, [0, 0]), within(0, [1, 0]));
        assert_ne!(within(0, [0, 0]), within(1, [0, 0]));
    }

    #[test]
    fn blocks_beyond_the_sequence_are_stratified_and_differ() {
        let sampler = Sampler::new(1 << 17, 1).unwrap();
        let offset = |index| sampler.sample([3, 4], index).moved(-3.0, -4.0).raster;
        let mut counts = [0; 4];
        for i in 0..64 {
            let [x, y] = offset(BLOCK + i);
            counts[usize::from(x >= 0.5) + 2 * usize::from(y >= 0.5)] += 1;
            assert_ne!(offset(BLOCK + i), offset(i));
        }
        assert_eq!(counts, [16; 4]);
        let mut path = sampler.path([3, 4], BLOCK + 5);
        assert_ne!(path.wavelength(), sampler.path([3, 4], 5).wavelength());
        assert_ne!(path.draw(), sampler.path([3, 4], 5).draw());
    }

    #[test]
    fn a_filter_moves_samples_about_the_centre_and_nothing_else() {
        let plain = Sampler::new(64, 1).unwrap();
        let filtered = plain.clone().filtered(&Filter::new(filter::Shape::BlackmanHarris, 3.0).unwrap());
        let mut mean = [0.0; 2];
        for i in 0..64 {
            let (a, b) = (plain.sample([5, 6], i), filtered.sample([5, 6], i));
            assert_eq!((a.lens, a.time), (b.lens, b.time));
            mean[0] += (b.raster[0] - 5.5) / 64.0;
            mean[1] += (b.raster[1] - 6.5) / 64.0;
            assert!(b.moved(-5.5, -6.5).raster.iter().all(|v| v.abs() <= 1.5));
        }
        assert!(mean.iter().all(|m| m.abs() < 0.02), "{mean:?}");
        assert_eq!(plain.sample([5, 6], 7), plain.clone().filtered(&Filter::default()).sample([5, 6], 7));
        let one = Sampler::new(1, 7).unwrap().filtered(&Filter::new(filter::Shape::Gaussian, 3.0).unwrap());
        assert_eq!(one.sample([3, -4], 0), CameraSample::at(3.5, -3.5));
    }

    #[test]
    fn impossible_counts_are_refused() {
        assert!(Sampler::new(0, 0).is_err() && Sampler::new(MAX_SAMPLES + 1, 0).is_err());
    }
}
