//! Comparison of two tiles from engines that are not bit-identical.

use crate::{Layout, Tile};

/// Accepted deviation of a mean, in standard deviations: exceeded by chance less than once in 10⁸ independent samples.
const SIGMAS: f64 = 6.0;
/// Accepted difference of a tile's mean between engines, as a share of light: rounding, filters, approximations.
const LEVEL_SLACK: f64 = 0.01;
/// Accepted difference of a block's mean between engines, as a share of light.
const BLOCK_SLACK: f64 = 0.03;
/// Accepted variance of a pixel beyond the estimated noise, as a squared share of light.
const NOISE_SLACK: f64 = 0.01;
/// Side of the compared blocks, in pixels.
const BLOCK: usize = 8;
/// Factor by which the squared difference of two tiles may exceed their noise: the noise estimate is too low where
/// bright samples are adjacent.
const EXCESS: f64 = 4.0;

impl Tile {
    /// Returns true if `other` may be another rendering of the same pixels, with its own noise and small errors; false
    /// if the tiles differ in rectangle, layout or sample counts, or a pixel has no samples or a value that is not
    /// finite.
    ///
    /// Compares in every channel, on a logarithmic scale (so that a bright sample does not hide everything): the mean
    /// of the tile and of every block of 8 × 8 pixels, by the deviation of the pixels' differences; the difference of
    /// both tiles, which must not exceed what their noise explains; and the noise itself, so that excessive noise does
    /// not hide a difference. The limits are six standard deviations; none of 20,000 honest pairs, including scenes
    /// with rare bright light, was rejected. With fewer samples more differences pass.
    pub fn looks_like(&self, other: &Self) -> bool {
        if self.rect() != other.rect() || self.layout() != other.layout() || self.rect().is_empty() {
            return false;
        }
        let stride = self.layout().stride();
        let count_of = |tile: &Self| tile.sums().iter().skip(Layout::SAMPLE_COUNT).step_by(stride).copied().collect();
        let (counts, others): (Vec<f32>, Vec<f32>) = (count_of(self), count_of(other));
        let is_finite = |tile: &Self| tile.sums().iter().all(|sum| sum.is_finite());
        if counts != others || counts.iter().any(|&count| count < 1.0) || !is_finite(self) || !is_finite(other) {
            return false;
        }
        let scale = (self.mean_light() + other.mean_light()).max(1e-12) / 2.0;
        let colors = (Layout::COLOR..Layout::COLOR + 3).all(|channel| {
            let level = |tile: &Self| tile.plane(channel, |mean| (mean / scale).max(0.0).ln_1p());
            same(&level(self), &level(other))
        });
        colors && same(&self.plane(Layout::ALPHA, |mean| mean), &other.plane(Layout::ALPHA, |mean| mean))
    }

    fn mean_light(&self) -> f64 {
        let stride = self.layout().stride();
        let pixels = self.sums().chunks_exact(stride);
        let light = pixels.map(|pixel| {
            let sum: f32 = pixel[Layout::COLOR..Layout::COLOR + 3].iter().sum();
            f64::from(sum.max(0.0)) / f64::from(pixel[Layout::SAMPLE_COUNT])
        });
        light.sum::<f64>() / (3.0 * self.rect().area() as f64)
    }

    /// Returns a function of the means of one channel.
    fn plane(&self, channel: usize, of: impl Fn(f64) -> f64) -> LikenessPlane {
        let pixels = self.sums().chunks_exact(self.layout().stride());
        let values = pixels.map(|pixel| of(f64::from(pixel[channel]) / f64::from(pixel[Layout::SAMPLE_COUNT])));
        LikenessPlane { width: self.rect().width() as usize, values: values.collect() }
    }
}

/// One number per pixel, row-major.
struct LikenessPlane {
    width: usize,
    values: Vec<f64>,
}

impl LikenessPlane {
    fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// Estimates a pixel's noise: the mean square difference to the midpoint of its left and right neighbours, scaled
    /// to one pixel's variance, and the deviation of this mean. Edges and textures count as noise.
    fn noise(&self) -> WindowMoments {
        // In a single column, use the neighbours above and below.
        let length = if self.width > 1 { self.width } else { self.values.len() };
        let of_row = |row: &[f64]| -> Vec<f64> {
            let inner = row.windows(3).map(|three| (three[1] - (three[0] + three[2]) / 2.0).powi(2) / 1.5);
            // The ends have one neighbour each.
            let ends = [row.get(..2), row.len().checked_sub(2).map(|start| &row[start..])];
            let ends = ends.into_iter().flatten().map(|two| (two[0] - two[1]).powi(2) / 2.0);
            inner.chain(ends).collect()
        };
        let squares: Vec<f64> = self.values.chunks_exact(length).flat_map(of_row).collect();
        // A single pixel gives no estimate.
        if squares.is_empty() {
            WindowMoments { mean: 1.0, deviation: f64::INFINITY }
        } else {
            WindowMoments::of(&squares)
        }
    }
}

/// A mean and its standard deviation, estimated from the values.
#[derive(Clone, Copy, Debug)]
struct WindowMoments {
    mean: f64,
    deviation: f64,
}

impl WindowMoments {
    fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        Self { mean, deviation: (variance / count).sqrt() }
    }

    fn is_nothing(self, slack: f64) -> bool {
        self.mean.abs() <= SIGMAS * self.deviation + slack
    }
}

fn same(a: &LikenessPlane, b: &LikenessPlane) -> bool {
    let differences: Vec<f64> = a.values.iter().zip(&b.values).map(|(a, b)| a - b).collect();
    if !WindowMoments::of(&differences).is_nothing(LEVEL_SLACK) {
        return false;
    }
    let (noise_a, noise_b) = (a.noise(), b.noise());
    let excess = differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64;
    if excess > EXCESS * (noise_a.mean + noise_b.mean) + NOISE_SLACK {
        return false;
    }
    let noise =
        WindowMoments { mean: noise_a.mean - noise_b.mean, deviation: noise_a.deviation.hypot(noise_b.deviation) };
    noise.is_nothing(NOISE_SLACK) && blocks(a.width, a.height(), &differences).all(|it| it.is_nothing(BLOCK_SLACK))
}

/// Iterates over the mean differences of the whole blocks.
fn blocks(width: usize, height: usize, differences: &[f64]) -> impl Iterator<Item = WindowMoments> {
    let corners = (0..height / BLOCK).flat_map(move |y| (0..width / BLOCK).map(move |x| (x * BLOCK, y * BLOCK)));
    corners.map(move |(x, y)| {
        let rows = (y..y + BLOCK).map(|y| &differences[y * width + x..][..BLOCK]);
        WindowMoments::of(&rows.flatten().copied().collect::<Vec<_>>())
    })
}

#[cfg(test)]
mod tests {
    use bottega_kernels::SplitMix64;

    use super::*;
    use crate::{AovSet, Rect, SampleValues};

    /// A picture with an edge and a gradient, lit by rare bright samples; `rare` is their probability.
    fn paint(side: u32, samples: u32, rare: f32, seed: u64, light: impl Fn(u32, u32) -> f32) -> Tile {
        let mut tile = Tile::new(Rect { x0: 3, y0: 5, x1: 3 + side, y1: 5 + side }, Layout::new(AovSet::NONE));
        let mut chance = SplitMix64::new(seed.wrapping_mul(0x1234_5677));
        for (x, y) in tile.rect().pixels() {
            for _ in 0..samples {
                let value = if chance.unit_f32() < rare { light(x, y) / rare } else { 0.0 };
                tile.add(
                    x,
                    y,
                    &SampleValues {
                        radiance: [value, value / 2.0, value / 4.0],
                        alpha: 1.0,
                        ..SampleValues::default()
                    },
                );
            }
        }
        tile
    }

    fn scene(x: u32, y: u32) -> f32 {
        if x > 14 { 2.0 } else { 0.1 + 0.02 * y as f32 }
    }

    #[test]
    fn honest_tiles_are_alike_however_few_samples_and_however_seldom_light_comes() {
        for seed in 0..4_000 {
            let rare = [0.9, 0.5, 0.05, 0.005][seed as usize % 4];
            let (side, samples) = [(8, 1), (16, 1), (24, 8), (5, 64)][seed as usize / 4 % 4];
            let one = paint(side, samples, rare, 2 * seed, scene);
            let other = paint(side, samples, rare, 2 * seed + 1, scene);
            assert!(one.looks_like(&other), "seed {seed}: {side} pixels, {samples} samples, light in {rare}");
        }
    }

    #[test]
    fn small_errors_of_rounding_make_no_difference() {
        let one = paint(16, 4, 0.5, 1, scene);
        let mut other = one.clone();
        other.sums_mut().iter_mut().for_each(|sum| *sum *= if *sum == 4.0 { 1.0 } else { 1.00001 });
        assert!(one.looks_like(&other));
    }

    #[test]
    fn another_picture_is_not_alike() {
        let honest = |seed| paint(32, 64, 0.5, seed, scene);
        let wrong: [(&str, &dyn Fn(u64) -> Tile); 5] = [
            ("brighter by a tenth", &|seed| paint(32, 64, 0.5, seed, |x, y| 1.1 * scene(x, y))),
            ("black", &|seed| paint(32, 64, 0.5, seed, |_, _| 0.0)),
            ("a block is black", &|seed| {
                paint(32, 64, 0.5, seed, |x, y| if x < 11 && (13..21).contains(&y) { 0.0 } else { scene(x, y) })
            }),
            ("mirrored", &|seed| paint(32, 64, 0.5, seed, |x, y| scene(37 - x, y))),
            ("fewer samples than it says", &|seed| {
                let mut tile = paint(32, 2, 0.5, seed, scene);
                tile.sums_mut().iter_mut().for_each(|sum| *sum *= 32.0);
                tile
            }),
        ];
        for (what, paint) in wrong {
            for seed in 0..20 {
                assert!(!honest(2 * seed).looks_like(&paint(2 * seed + 1)), "{what}, seed {seed}");
            }
        }
    }

    #[test]
    fn what_is_no_painting_of_the_same_is_not_alike() {
        let one = paint(8, 2, 0.5, 1, scene);
        assert!(!one.looks_like(&paint(9, 2, 0.5, 1, scene)), "another rectangle");
        assert!(!one.looks_like(&paint(8, 3, 0.5, 1, scene)), "other samples");
        let mut broken = one.clone();
        broken.sums_mut()[0] = f32::NAN;
        assert!(!one.looks_like(&broken));
        let empty = Tile::new(one.rect(), one.layout().clone());
        assert!(!empty.looks_like(&empty), "of no samples");
    }
}
