//! Quasi-random numbers for Monte Carlo integration, as a pure function of (seed, pixel, sample index, dimension).
//!
//! Dimensions come in sets of four, each with its own Owen-scrambled Sobol' sequence: the four numbers of a set are
//! stratified together, and there can be any number of sets. Nothing is stored and there is no state: the same request
//! gets the same bits, on any thread, in any order, in any pass.
//!
//! Source: Burley 2020, *Practical Hash-based Owen Scrambling* (shuffled scrambled Sobol' in four dimensions); the hash
//! is that of Laine and Karras 2011 with the better mixing constants published by Vegdahl 2021.

mod sobol;

use bottega_kernels::mix64;

/// Four random numbers of one dimension set, each in [0, 1).
pub type Quad = [f32; 4];

/// A set of four dimensions; each decision at each vertex of a path has its own set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DimensionSet(u32);

impl DimensionSet {
    /// The dimensions of the camera ray: position in the pixel (2), position on the lens (2).
    pub const CAMERA: Self = Self(0);

    /// The time of the path (1), spare (3). Beyond all other sets.
    pub(crate) const TIME: Self = Self(u32::MAX);

    /// Returns the dimensions of light sampling at a path's vertex, counted from the camera: choice of the light (1),
    /// position on it (2), spare (1).
    pub fn light(vertex: u32) -> Self {
        Self(1 + 2 * vertex)
    }

    /// Returns the dimensions of distance sampling on a path's segment through a medium: choice of the channel (1),
    /// distance (1), spare (2).
    pub fn distance(segment: u32) -> Self {
        Self(Self::MEDIA + 2 * segment)
    }

    /// Returns the dimensions of light sampling along a path's segment through a medium: choice of the light (1),
    /// distance (1), position on the light (2).
    pub fn along(segment: u32) -> Self {
        Self(Self::MEDIA + 1 + 2 * segment)
    }

    /// Start of the sets of segments through media, beyond those of vertices.
    const MEDIA: u32 = 1 << 30;

    /// Returns the dimensions of the start of a walk below the surface at a path's vertex: choice of the channel (1), first
    /// distance (1), spare (2).
    pub(crate) fn below(vertex: u32) -> Self {
        Self(Self::BELOW + 2 * vertex)
    }

    /// Returns the dimensions of the end of a walk below the surface at a path's vertex: direction (2), Russian roulette (1),
    /// choice of the surface's part (1).
    pub(crate) fn leaving(vertex: u32) -> Self {
        Self(Self::BELOW + 1 + 2 * vertex)
    }

    /// Start of the sets of walks below surfaces, beyond those of segments through media.
    const BELOW: u32 = 1 << 31;

    /// Returns the dimensions of scattering at a path's vertex: choice of the lobe (1), direction (2), Russian
    /// roulette (1).
    pub fn scattering(vertex: u32) -> Self {
        Self(2 + 2 * vertex)
    }
}

/// Key that separates the random numbers of path branches from all others.
const BRANCH: u64 = 0x6272_616e_6368_6573;

/// The random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSampler {
    pixel_key: u64,
    sample_index: u32,
    reversed_index: u32,
}

impl PixelSampler {
    /// Creates the sampler of sample `sample_index` of the pixel (x, y) of the whole picture.
    #[inline(always)]
    pub fn new(seed: u64, x: u32, y: u32, sample_index: u32) -> Self {
        let pixel = u64::from(x) | u64::from(y) << 32;
        Self { pixel_key: mix64(mixed_seed(seed) ^ pixel), sample_index, reversed_index: sample_index.reverse_bits() }
    }

    /// Returns the sampler of branch `branch` of a path that is split at its vertex `vertex`.
    #[inline(always)]
    pub(crate) fn branch(&self, vertex: u32, branch: u32) -> Self {
        let key = u64::from(vertex) << 32 | u64::from(branch);
        Self { pixel_key: mix64(self.pixel_key ^ mix64(key ^ BRANCH)), ..*self }
    }

    /// Returns the four numbers of a dimension set, each in [0, 1).
    #[inline(always)]
    pub fn quad(&self, set: DimensionSet) -> Quad {
        self.scrambled_point(set, self.reversed_index)
    }

    /// Returns the numbers of two dimension sets, at little more than the cost of one.
    #[inline(always)]
    pub fn two_quads(&self, first: DimensionSet, second: DimensionSet) -> [Quad; 2] {
        let (p, j) = self.point(first, self.reversed_index);
        let (q, k) = self.point(second, self.reversed_index);
        let join = |a: [u32; 4], b: [u32; 4]| [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
        let keys = [j, j, j, j, k, k, k, k];
        let all = scrambled(join(p, q), keys, [0, 1, 2, 3, 0, 1, 2, 3]);
        [[all[0], all[1], all[2], all[3]], [all[4], all[5], all[6], all[7]]]
    }

    /// Returns the numbers of one part of this sample, if it is split in that set. The parts of all samples form one
    /// sequence, so they are stratified against each other as well.
    ///
    /// - `part`: number of the part, below `part_count`.
    #[inline(always)]
    pub fn split_quad(&self, set: DimensionSet, part: u32, part_count: u32) -> Quad {
        debug_assert!(part < part_count);
        let index = self.sample_index.wrapping_mul(part_count).wrapping_add(part);
        self.scrambled_point(set, index.reverse_bits())
    }

    /// Returns the first number of a set.
    pub fn get_1d(&self, set: DimensionSet) -> f32 {
        self.quad(set)[0]
    }

    /// Returns the first two numbers of a set.
    pub fn get_2d(&self, set: DimensionSet) -> glam::Vec2 {
        let [x, y, ..] = self.quad(set);
        glam::Vec2::new(x, y)
    }

    /// Returns a random number in [0, 1), a hash of the sample and `key`, for decisions without a dimension, such as
    /// the opacity of a half-transparent surface.
    #[inline(always)]
    pub fn hashed(&self, key: u64) -> f32 {
        let bits = mix64(mix64(self.pixel_key ^ key) ^ u64::from(self.sample_index));
        unit_interval((bits >> 32) as u32)
    }

    #[inline(always)]
    fn scrambled_point(&self, set: DimensionSet, reversed_index: u32) -> Quad {
        let (bits, key) = self.point(set, reversed_index);
        scrambled(bits, [key; 4], [0, 1, 2, 3])
    }

    /// Returns the bit-reversed point of the shuffled sequence of a set, and the key of its scrambling.
    #[inline(always)]
    fn point(&self, set: DimensionSet, reversed_index: u32) -> ([u32; 4], u64) {
        let key = mix64(self.pixel_key.wrapping_add(u64::from(set.0).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        // Shuffle the order of the points differently for each set, which decorrelates the sets
        let shuffled = owen_scramble_reversed(reversed_index, (key >> 32) as u32);
        (sobol::reversed_point(shuffled), key)
    }
}

/// Returns the hash of a seed, from which the keys of all pixels are derived.
pub fn mixed_seed(seed: u64) -> u64 {
    mix64(seed)
}

/// Returns the table from which the points of the sequence are combined, see [`crate::flat::sobol_table`].
pub(crate) fn sobol_table() -> &'static [[[u32; 4]; 16]; 8] {
    &sobol::NIBBLES
}

/// Returns numbers in [0, 1) by Owen scrambling of bit-reversed fractions, by keys and dimensions; without branches, for
/// all lanes at once.
#[inline(always)]
fn scrambled<const N: usize>(reversed: [u32; N], keys: [u64; N], dimensions: [u32; N]) -> [f32; N] {
    let seeds: [u32; N] =
        std::array::from_fn(|i| (keys[i] as u32).wrapping_add(dimensions[i].wrapping_mul(0x9e37_79b9)));
    // A bijection of 32 bits that mixes well (Wellons 2018, "lowbias32")
    let seeds: [u32; N] = std::array::from_fn(|i| (seeds[i] ^ seeds[i] >> 16).wrapping_mul(0x7feb_352d));
    let seeds: [u32; N] = std::array::from_fn(|i| (seeds[i] ^ seeds[i] >> 15).wrapping_mul(0x846c_a68b));
    let seeds: [u32; N] = std::array::from_fn(|i| seeds[i] ^ seeds[i] >> 16);
    let bits: [u32; N] = std::array::from_fn(|i| owen_scramble_reversed(reversed[i], seeds[i]).reverse_bits());
    bits.map(unit_interval)
}

/// Converts the 24 high bits to a number in [0, 1).
#[inline(always)]
fn unit_interval(bits: u32) -> f32 {
    // Convert from a signed number, which every vector unit supports
    (bits >> 8).cast_signed() as f32 * (1.0 / 16_777_216.0)
}

/// Owen-scrambles a bit-reversed number: each bit is flipped depending only on the bits below it.
#[inline(always)]
fn owen_scramble_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_4;

    use super::*;

    /// Returns true if each of the 2^a × 2^b cells of an elementary grid contains one point.
    fn fills_grid(points: &[(f32, f32)], columns: usize, rows: usize) -> bool {
        let mut cells = vec![0; columns * rows];
        for &(x, y) in points {
            cells[(y * rows as f32) as usize * columns + (x * columns as f32) as usize] += 1;
        }
        points.len() == cells.len() && cells.iter().all(|&count| count == 1)
    }

    #[test]
    fn the_first_two_dimensions_are_a_net_in_every_set_of_every_pixel() {
        for (x, y, set) in [(0, 0, 0), (17, 4, 1), (300, 7, 5), (5, 5, 40)] {
            let points: Vec<_> = (0..256)
                .map(|i| {
                    let q = PixelSampler::new(9, x, y, i).quad(DimensionSet(set));
                    (q[0], q[1])
                })
                .collect();
            for log_columns in 0..=8 {
                assert!(fills_grid(&points, 1 << log_columns, 256 >> log_columns), "{x} {y} {set}: 2^{log_columns}");
            }
        }
    }

    #[test]
    fn every_dimension_is_stratified_and_every_pair_nearly() {
        let points: Vec<Quad> = (0..256).map(|i| PixelSampler::new(3, 8, 2, i).quad(DimensionSet(7))).collect();
        for d in 0..4 {
            let line: Vec<_> = points.iter().map(|q| (q[d], 0.0)).collect();
            assert!(fills_grid(&line, 256, 1), "dimension {d}");
            for e in 0..d {
                // The quality parameter t of Sobol' pairs here is at most 3: 2^3 points in each of 32 cells.
                let mut cells = [0; 32];
                for q in &points {
                    cells[(q[d] * 8.0) as usize * 4 + (q[e] * 4.0) as usize] += 1;
                }
                assert!(cells.iter().all(|&count| count == 8), "pair {d} {e}: {cells:?}");
            }
        }
    }

    #[test]
    fn aligned_ranges_of_samples_are_stratified_too() {
        for start in [64, 128, 960] {
            let line: Vec<_> =
                (start..start + 64).map(|i| (PixelSampler::new(3, 1, 2, i).quad(DimensionSet(3))[0], 0.0)).collect();
            assert!(fills_grid(&line, 64, 1));
        }
    }

    #[test]
    fn numbers_are_uniform_over_pixels_sets_and_seeds() {
        for variant in 0..3 {
            let mut bins = [0_u32; 64];
            for i in 0..6400_u32 {
                let (seed, x, set) = [(1, i, 0), (u64::from(i), 4, 0), (1, 4, i)][variant];
                for value in PixelSampler::new(seed, x, 3, 0).quad(DimensionSet(set)) {
                    bins[(value * 64.0) as usize] += 1;
                }
            }
            // χ² with 63 degrees of freedom stays below 120 with probability 1 − 2e-5.
            let chi_squared: f64 = bins.iter().map(|&n| (f64::from(n) - 400.0).powi(2) / 400.0).sum();
            assert!(chi_squared < 120.0, "variant {variant}: {chi_squared}");
        }
    }

    #[test]
    fn integration_error_falls_faster_than_that_of_random_numbers() {
        // The mean over pixels of the squared error of ∫ f, for a smooth f in four dimensions with mean (1 − e⁻¹)⁴, and a
        // disc
        let exact = (1.0 - (-1.0_f64).exp()).powi(4);
        let smooth = |q: Quad| f64::from(-q.iter().sum::<f32>()).exp();
        let disc = |q: Quad| f64::from(u8::from(q[0] * q[0] + q[1] * q[1] < 1.0));
        for count in [64, 100, 196, 1024] {
            let mut errors = [0.0; 3];
            for pixel in 0..64 {
                let mut means = [0.0; 3];
                for i in 0..count {
                    let sampler = PixelSampler::new(0, pixel, 0, i);
                    let quad = sampler.quad(DimensionSet(2));
                    let random: Quad = std::array::from_fn(|d| sampler.hashed(d as u64));
                    means[0] += smooth(quad) / f64::from(count);
                    means[1] += smooth(random) / f64::from(count);
                    means[2] += disc(quad) / f64::from(count);
                }
                for (error, (mean, exact)) in errors.iter_mut().zip(means.iter().zip([exact, exact, FRAC_PI_4])) {
                    *error += (mean - exact).powi(2) / 64.0;
                }
            }
            assert!(errors[0] < 0.1 * errors[1], "{count}: {errors:?}");
            let random_disc = FRAC_PI_4 * (1.0 - FRAC_PI_4) / f64::from(count);
            assert!(errors[2] < 0.4 * random_disc, "{count}: {errors:?} against {random_disc}");
        }
    }

    #[test]
    fn neighbouring_pixels_and_sets_are_not_correlated() {
        let correlation = |a: &dyn Fn(u32) -> f32, b: &dyn Fn(u32) -> f32| {
            let n = 4096;
            let sum: f64 = (0..n).map(|i| (f64::from(a(i)) - 0.5) * (f64::from(b(i)) - 0.5)).sum();
            12.0 * sum / f64::from(n)
        };
        let pixel =
            |x: u32, y: u32, set: u32, d: usize| move |i: u32| PixelSampler::new(5, x, y, i).quad(DimensionSet(set))[d];
        let across = |dx: u32, dy: u32| {
            correlation(&|i| pixel(i % 64, i / 64, 1, 0)(0), &|i| pixel(i % 64 + dx, i / 64 + dy, 1, 0)(0))
        };
        let limit = 5.0 / 64.0; // five standard errors of 4096 independent pairs
        for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
            assert!(across(dx, dy).abs() < limit);
        }
        for d in 0..4 {
            assert!(correlation(&pixel(3, 3, 1, d), &pixel(4, 3, 1, d)).abs() < limit);
            assert!(correlation(&pixel(3, 3, 1, d), &pixel(3, 3, 2, d)).abs() < limit);
        }
    }

    #[test]
    fn split_parts_continue_one_sequence() {
        let split: Vec<_> = (0..16)
            .flat_map(|i| (0..4).map(move |k| PixelSampler::new(1, 2, 3, i).split_quad(DimensionSet(1), k, 4)))
            .collect();
        let whole: Vec<_> = (0..64).map(|i| PixelSampler::new(1, 2, 3, i).quad(DimensionSet(1))).collect();
        assert_eq!(split, whole);
    }
}
