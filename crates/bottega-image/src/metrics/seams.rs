//! Detection of seams: visible edges of zones in a picture.

use super::{check_sizes, moments::two_sided_p};
use crate::{ImageError, Picture, Rect, luminance};

/// Length of an edge piece, in pixels: the step across it adds up, noise averages out.
const PIECE: usize = 16;
/// Least length of an edge piece.
const PIECE_MIN: usize = 6;
/// Distances from the edge of the steps to compare with, in pixels; they share no pixels.
const BESIDE: [i64; 3] = [2, 4, 6];

/// The visibility of zone edges, measured by [`seams`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seams {
    /// Number of edge pieces compared.
    pub pieces: usize,
    /// Excess of steps across edges over steps inside, in standard deviations; standard normal without seams.
    pub z: f64,
    /// Median step across edges over median step inside; 1 without seams, or with nothing to compare.
    pub ratio: f64,
}

impl Seams {
    /// Returns the probability, 0 to 1, of a [`z`](Self::z) at least that large without any seam.
    pub fn p(&self) -> f64 {
        let two_sided = two_sided_p(self.z);
        if self.z > 0.0 { 0.5 * two_sided } else { 1.0 - 0.5 * two_sided }
    }
}

/// Compares the steps across the edges of zones with steps a few pixels beside them, in the same rows. Returns the
/// visibility of the edges.
///
/// - `reference`: the same picture without noise, if available. Subtracting it removes the scene's own edges and
///   reveals smaller seams.
/// - `zones`: in pixels of the picture; parts outside are ignored.
///
/// Along a piece of an edge of up to 16 pixels, the differences across the edge are averaged, and so are those 2, 4 and
/// 6 pixels away on either side. Without a seam all seven means have the same distribution, whatever it is, so each
/// rank of the one across the edge is equally likely: outliers do not dominate, and the noise need not be known. The
/// ranks of all pieces together give a z-score. On a uniform gradient the edge has the middle rank.
///
/// Values are compressed by v / (v + mean luminance). Non-finite ones count as 0.
///
/// # Errors
/// `reference` differs in size from `picture`.
pub fn seams(picture: &Picture, reference: Option<&Picture>, zones: &[Rect]) -> Result<Seams, ImageError> {
    if let Some(reference) = reference {
        check_sizes(reference, picture)?;
    }
    let field = SeamField::new(picture, reference, zones);
    let mut found = SeamTally::default();
    for edge in field.edges() {
        found.judge(&field, &edge);
    }
    Ok(found.seams())
}

/// A piece of an edge. Across it, pixel `at − 1` is the last of one zone and pixel `at` the first of another.
struct EdgePiece {
    is_upright: bool,
    at: i64,
    /// First position along the edge, and one past the last.
    along: (i64, i64),
}

/// The values to examine, and the zone of each pixel.
struct SeamField {
    width: i64,
    height: i64,
    values: Vec<[f32; 3]>,
    zones: Vec<u32>,
}

/// The zone of a pixel outside of all zones.
const NO_ZONE: u32 = u32::MAX;

impl SeamField {
    fn new(picture: &Picture, reference: Option<&Picture>, zones: &[Rect]) -> Self {
        let whole = Rect::of_size(picture.width, picture.height);
        let of_mean = reference.unwrap_or(picture);
        let sane = |value: f32| if value.is_finite() { value.max(0.0) } else { 0.0 };
        let sum: f64 = of_mean.data.iter().map(|color| f64::from(luminance(color.map(sane)))).sum();
        let mean = ((sum / of_mean.data.len().max(1) as f64) as f32).max(f32::MIN_POSITIVE);
        let shown = |color: [f32; 3]| color.map(|value| 1.0 - mean / (sane(value) + mean));
        let mut values: Vec<[f32; 3]> = picture.data.iter().map(|&color| shown(color)).collect();
        if let Some(reference) = reference {
            for (value, &color) in values.iter_mut().zip(&reference.data) {
                let expected = shown(color);
                *value = std::array::from_fn(|i| value[i] - expected[i]);
            }
        }
        let mut labels = vec![NO_ZONE; values.len()];
        for (zone, label) in zones.iter().zip(0..) {
            for (x, y) in zone.intersection(&whole).into_iter().flat_map(|part| part.pixels()) {
                labels[whole.index(x, y)] = label;
            }
        }
        Self { width: picture.width.into(), height: picture.height.into(), values, zones: labels }
    }

    /// Returns the index of the pixel at `across` and `along` the edge.
    fn index(&self, is_upright: bool, across: i64, along: i64) -> Option<usize> {
        let (x, y) = if is_upright { (across, along) } else { (along, across) };
        let is_in = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        is_in.then(|| (y * self.width + x) as usize)
    }

    fn zone(&self, is_upright: bool, across: i64, along: i64) -> u32 {
        self.index(is_upright, across, along).map_or(NO_ZONE, |index| self.zones[index])
    }

    /// Returns all pieces between two zones.
    fn edges(&self) -> Vec<EdgePiece> {
        let mut pieces = Vec::new();
        for is_upright in [true, false] {
            let (across, along) = if is_upright { (self.width, self.height) } else { (self.height, self.width) };
            for at in 1..across {
                let sides = |along| (self.zone(is_upright, at - 1, along), self.zone(is_upright, at, along));
                let mut first = 0;
                while first < along {
                    let (before, behind) = sides(first);
                    let mut last = first + 1;
                    while last < along && last - first < PIECE as i64 && sides(last) == (before, behind) {
                        last += 1;
                    }
                    let is_edge = before != behind && before != NO_ZONE && behind != NO_ZONE;
                    if is_edge && last - first >= PIECE_MIN as i64 {
                        pieces.push(EdgePiece { is_upright, at, along: (first, last) });
                    }
                    first = last;
                }
            }
        }
        pieces
    }

    /// Returns the length of the mean color step between adjacent pixels, `beside` pixels from the edge. `None` if it
    /// leaves the zone on that side.
    fn step(&self, piece: &EdgePiece, beside: i64) -> Option<f64> {
        let EdgePiece { is_upright, at, along: (first, last) } = *piece;
        let mut sum = [0.0f64; 3];
        for along in first..last {
            if beside != 0 {
                let own = self.zone(is_upright, if beside < 0 { at - 1 } else { at }, along);
                let is_inside = |across| self.zone(is_upright, across, along) == own;
                if !is_inside(at - 1 + beside) || !is_inside(at + beside) {
                    return None;
                }
            }
            let one = self.values[self.index(is_upright, at - 1 + beside, along)?];
            let next = self.values[self.index(is_upright, at + beside, along)?];
            sum.iter_mut().zip(one).zip(next).for_each(|((sum, one), next)| *sum += f64::from(next - one));
        }
        let count = (last - first) as f64;
        Some(sum.iter().map(|value| (value / count) * (value / count)).sum::<f64>().sqrt())
    }
}

/// The steps and ranks so far.
#[derive(Default)]
struct SeamTally {
    across: Vec<f64>,
    inside: Vec<f64>,
    /// Sum over the pieces of the rank's deviation from its mean, in standard deviations.
    ranks: f64,
}

impl SeamTally {
    fn judge(&mut self, field: &SeamField, piece: &EdgePiece) {
        let Some(across) = field.step(piece, 0) else { return };
        // Use both sides or neither, so that a uniform gradient has the middle rank.
        let pairs = BESIDE.iter().filter_map(|&d| Some([field.step(piece, -d)?, field.step(piece, d)?]));
        let inside: Vec<f64> = pairs.flatten().collect();
        let all = || inside.iter().copied().chain([across]);
        let rank = |value: f64| {
            let below = inside.iter().chain([&across]).filter(|&&other| other < value).count() as f64;
            let equal = inside.iter().chain([&across]).filter(|&&other| other == value).count() as f64;
            below + 0.5 * (equal + 1.0)
        };
        let count = inside.len() as f64 + 1.0;
        let mean = 0.5 * (count + 1.0);
        let variance = all().map(|value| (rank(value) - mean).powi(2)).sum::<f64>() / count;
        // Skip pieces without differences, or with nothing to compare with.
        if variance > 0.0 {
            self.ranks += (rank(across) - mean) / variance.sqrt();
            self.across.push(across);
            self.inside.extend(inside);
        }
    }

    fn seams(mut self) -> Seams {
        let pieces = self.across.len();
        if pieces == 0 {
            return Seams { pieces, z: 0.0, ratio: 1.0 };
        }
        let (across, inside) = (median(&mut self.across), median(&mut self.inside));
        let ratio = if inside > 0.0 {
            across / inside
        } else if across > 0.0 {
            f64::INFINITY
        } else {
            1.0
        };
        Seams { pieces, z: self.ranks / (pieces as f64).sqrt(), ratio }
    }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use bottega_kernels::SplitMix64;

    use super::*;

    /// About normal, of mean 0 and deviation 1: the sum of twelve uniform numbers.
    fn normal(numbers: &mut SplitMix64) -> f32 {
        (0..12).map(|_| numbers.unit_f32()).sum::<f32>() - 6.0
    }

    const SIZE: (u32, u32) = (256, 192);
    const NOISE: f32 = 0.1;

    fn zones() -> Vec<Rect> {
        Rect::of_size(SIZE.0, SIZE.1).blocks(32).collect()
    }

    /// A scene of slopes and stripes with noise; every second zone is brighter by `step`.
    fn painted(seed: u64, step: f32) -> Picture {
        let mut numbers = SplitMix64::new(seed);
        let scene = scene();
        Picture::from_fn(SIZE.0, SIZE.1, |x, y| {
            let seam = if (x / 32 + y / 32) % 2 == 0 { step } else { 0.0 };
            scene.pixel(x, y).map(|value| (value + seam) * (1.0 + NOISE * normal(&mut numbers)))
        })
    }

    fn scene() -> Picture {
        Picture::from_fn(SIZE.0, SIZE.1, |x, y| {
            let slope = 0.3 + 0.4 * x as f32 / SIZE.0 as f32;
            let stripe = if (x + 2 * y) % 53 < 9 { 0.15 } else { 0.0 };
            [slope + stripe, slope, 0.5 * slope]
        })
    }

    #[test]
    fn without_seams_z_is_normally_distributed() {
        let z: Vec<f64> = (0..60).map(|seed| seams(&painted(seed, 0.0), None, &zones()).unwrap().z).collect();
        let mean = z.iter().sum::<f64>() / 60.0;
        let deviation = (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / 59.0).sqrt();
        // Three standard errors of each.
        assert!(mean.abs() < 3.0 / 60f64.sqrt(), "{mean}");
        assert!((deviation - 1.0).abs() < 3.0 / 118f64.sqrt(), "{deviation}");
    }

    #[test]
    fn a_seam_of_half_the_noise_of_a_pixel_is_found_every_time() {
        // Noise is a tenth of the brightness, some 0.05; the seam half of that.
        for seed in 0..20 {
            let picture = painted(seed, 0.025);
            let alone = seams(&picture, None, &zones()).unwrap();
            assert!(alone.p() < 1e-3, "seed {seed}: {alone:?}");
            let beside = seams(&picture, Some(&scene()), &zones()).unwrap();
            assert!(beside.z > alone.z - 1.0 && beside.ratio > 1.1, "seed {seed}: {beside:?}, {alone:?}");
        }
    }

    #[test]
    fn where_there_is_nothing_to_compare_there_is_no_seam() {
        let even = Picture::from_fn(64, 64, |_, _| [0.5; 3]);
        let halves = [Rect::new(0, 0, 32, 64), Rect::new(32, 0, 64, 64)];
        assert_eq!(seams(&even, None, &halves).unwrap(), Seams { pieces: 0, z: 0.0, ratio: 1.0 });
        let slivers: Vec<Rect> = (0..32).map(|i| Rect::new(2 * i, 0, 2 * i + 2, 64)).collect();
        assert_eq!(seams(&painted(1, 0.0), None, &slivers).unwrap().pieces, 0);
        assert_eq!(seams(&even, None, &[Rect::new(10, 10, 900, 900)]).unwrap().p(), 0.5);
        assert!(seams(&even, Some(&painted(1, 0.0)), &halves).is_err());
        let broken = Picture::from_fn(64, 64, |x, _| [f32::NAN, x as f32, f32::INFINITY]);
        assert!(seams(&broken, None, &halves).unwrap().z.is_finite());
    }
}
