//! A statistical comparison of two sets of images: equal distributions, and no visible edges of zones.

use anyhow::{Result, ensure};
use bottega_image::{FlipOptions, Picture, Rect, flip, luminance};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// The significance at which pixels differ.
const SIGNIFICANCE: f64 = 0.01;

/// The difference between images in zones and images of the whole frame.
pub(super) struct FrameDifference {
    /// Share of the pixels that are bit-identical to the frame of the same seed.
    pub(super) equal: f64,
    /// Mean of all images in zones over that of all frames, minus 1.
    pub(super) mean_off: f64,
    /// The standard error of that ratio; 0 with one image each.
    pub(super) mean_error: f64,
    /// Share of the pixels whose luminance differs by Welch's t-test at 1 %; with one image each: that are not bit-identical.
    pub(super) differing: f64,
    /// Mean FLIP between an image in zones and the frame of the same seed.
    pub(super) flip: f64,
    /// Mean FLIP between frames of two seeds; 0 with one seed.
    pub(super) flip_of_seeds: f64,
    /// The p-value of the hypothesis that there are no seams: a one-sided t-test over the seeds of FLIP at edges of zones against
    /// that inside, minus the same difference between two frames. With one image each: 1 if they are equal, else 0.
    pub(super) no_seams: f64,
}

/// Compares frames with images in zones, seed by seed.
///
/// - `zones`: the zones of each image.
pub(super) fn compare(frames: &[Picture], zoned: &[Picture], zones: &[Vec<Rect>]) -> Result<FrameDifference> {
    ensure!(frames.len() == zoned.len() && zoned.len() == zones.len() && !frames.is_empty(), "pictures are missing");
    let pixels = frames[0].data.len();
    ensure!(frames.iter().chain(zoned).all(|it| it.size() == frames[0].size()), "the pictures differ in size");
    let same = |(a, b): (&Picture, &Picture)| a.data.iter().zip(&b.data).filter(|(a, b)| a == b).count();
    let equal = frames.iter().zip(zoned).map(same).sum::<usize>() as f64 / (pixels * frames.len()) as f64;
    let (of_frames, of_zoned) = (NumberMoments::of(frames.iter().map(mean)), NumberMoments::of(zoned.iter().map(mean)));
    let seams = Seams::find(frames, zoned, zones)?;
    Ok(FrameDifference {
        equal,
        mean_off: of_zoned.mean / of_frames.mean - 1.0,
        mean_error: (of_frames.error_squared() + of_zoned.error_squared()).sqrt() / of_frames.mean,
        differing: if frames.len() > 1 { differing_share(frames, zoned) } else { 1.0 - equal },
        flip: seams.flip,
        flip_of_seeds: seams.flip_of_seeds,
        no_seams: seams.p,
    })
}

fn mean(picture: &Picture) -> f64 {
    picture.data.iter().map(|&color| f64::from(luminance(color))).sum::<f64>() / picture.data.len() as f64
}

/// Mean and variance of some numbers.
#[derive(Clone, Copy, Debug)]
struct NumberMoments {
    count: f64,
    mean: f64,
    variance: f64,
}

impl NumberMoments {
    fn of(numbers: impl Iterator<Item = f64> + Clone) -> Self {
        let count = numbers.clone().count() as f64;
        let mean = numbers.clone().sum::<f64>() / count;
        let squares = numbers.map(|number| (number - mean).powi(2)).sum::<f64>();
        Self { count, mean, variance: squares / (count - 1.0).max(1.0) }
    }

    /// Returns the squared standard error of the mean.
    fn error_squared(&self) -> f64 {
        self.variance / self.count
    }
}

/// Returns the share of pixels that differ by Welch's t-test.
fn differing_share(some: &[Picture], others: &[Picture]) -> f64 {
    let at = |pictures: &[Picture], i: usize| {
        NumberMoments::of(pictures.iter().map(|picture| f64::from(luminance(picture.data[i]))))
    };
    let pixels = some[0].data.len();
    let differ = (0..pixels).filter(|&i| p_value(&at(some, i), &at(others, i)) < SIGNIFICANCE).count();
    differ as f64 / pixels as f64
}

/// Returns the p-value of the hypothesis of equal means; degrees of freedom by Welch and Satterthwaite.
fn p_value(a: &NumberMoments, b: &NumberMoments) -> f64 {
    let (of_a, of_b) = (a.error_squared(), b.error_squared());
    let error = of_a + of_b;
    if error <= 1e-20 {
        // Neither set has any variance.
        return if (a.mean - b.mean).abs() <= 1e-6 * a.mean.abs().max(1e-6) { 1.0 } else { 0.0 };
    }
    let freedom = error * error / (of_a * of_a / (a.count - 1.0) + of_b * of_b / (b.count - 1.0));
    let t = (a.mean - b.mean).abs() / error.sqrt();
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(0.0, |students| 2.0 * (1.0 - students.cdf(t)))
}

/// The FLIP error at edges of zones and inside.
struct Seams {
    flip: f64,
    flip_of_seeds: f64,
    p: f64,
}

impl Seams {
    fn find(frames: &[Picture], zoned: &[Picture], zones: &[Vec<Rect>]) -> Result<Self> {
        let options = FlipOptions::default();
        let (mut flips, mut control_flips, mut excesses) = (0.0, 0.0, Vec::new());
        for (i, (frame, picture)) in frames.iter().zip(zoned).enumerate() {
            let edges = edges(frame, &zones[i]);
            let seen = flip(frame, picture, &options)?;
            flips += seen.mean / frames.len() as f64;
            // The scene's own edges and noise are at the same places in two frames.
            let control = flip(frame, &frames[(i + 1) % frames.len()], &options)?;
            control_flips += control.mean / frames.len() as f64;
            excesses.push(excess(&seen.map, &edges) - excess(&control.map, &edges));
        }
        let found = NumberMoments::of(excesses.iter().copied());
        let error = found.error_squared().sqrt();
        let p = if error > 0.0 {
            let students = StudentsT::new(0.0, 1.0, found.count - 1.0)?;
            1.0 - students.cdf(found.mean / error)
        } else {
            // A single image has no variance: any difference at edges counts.
            f64::from(u8::from(found.mean <= 0.0))
        };
        Ok(Self { flip: flips, flip_of_seeds: control_flips, p })
    }
}

/// Returns the mask of pixels next to a pixel of another zone.
fn edges(picture: &Picture, zones: &[Rect]) -> Vec<bool> {
    let whole = Rect::of_size(picture.width, picture.height);
    let mut labels = vec![0; picture.data.len()];
    for (zone, label) in zones.iter().zip(1_u32..) {
        zone.pixels().for_each(|(x, y)| labels[whole.index(x, y)] = label);
    }
    let is_edge = |(x, y): (u32, u32)| {
        let around = Rect::new(x, y, x + 1, y + 1).grown(1, &whole);
        around.pixels().any(|(a, b)| labels[whole.index(a, b)] != labels[whole.index(x, y)])
    };
    whole.pixels().map(is_edge).collect()
}

/// Returns the mean at edges minus that inside.
fn excess(map: &[f32], edges: &[bool]) -> f64 {
    let mean = |wanted: bool| {
        let values =
            map.iter().zip(edges).filter(|(_, is_edge)| **is_edge == wanted).map(|(value, _)| f64::from(*value));
        let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        sum / f64::max(count, 1.0)
    };
    mean(true) - mean(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of noise around 1, determined by the seed.
    fn noisy(seed: u32, size: u32, lift: impl Fn(u32, u32) -> f32) -> Picture {
        Picture::from_fn(size, size, |x, y| {
            let mut hash = (x + 977 * y + 1_000_003 * seed).wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
            hash = (hash ^ (hash >> 15)).wrapping_mul(0xc2b2_ae35);
            let noise = (hash >> 8) as f32 / (1 << 24) as f32 - 0.5;
            [1.0 + 0.4 * noise + lift(x, y); 3]
        })
    }

    fn found(lift: impl Fn(u32, u32) -> f32 + Copy) -> FrameDifference {
        let size = 64;
        let zones = vec![Rect::new(0, 0, 32, 64), Rect::new(32, 0, 64, 64)];
        let frames: Vec<Picture> = (0..6).map(|seed| noisy(seed, size, |_, _| 0.0)).collect();
        let zoned: Vec<Picture> = (10..16).map(|seed| noisy(seed, size, lift)).collect();
        compare(&frames, &zoned, &vec![zones; 6]).unwrap()
    }

    #[test]
    fn differences_by_chance_alone_count_as_equal() {
        let found = found(|_, _| 0.0);
        assert!(found.differing < 0.02 && found.mean_off.abs() < 0.003 && found.no_seams > 1e-3, "{}", found.no_seams);
    }

    #[test]
    fn a_darker_picture_a_shifted_part_and_a_seam_are_found() {
        assert!(found(|_, _| -0.02).mean_off < -0.01);
        assert!(found(|x, _| if x < 8 { 0.3 } else { 0.0 }).differing > 0.05);
        assert!(found(|x, _| if x == 31 || x == 32 { 0.4 } else { 0.0 }).no_seams < 1e-3);
    }

    #[test]
    fn equal_pictures_have_equal_bits() {
        let frames = [noisy(1, 16, |_, _| 0.0)];
        let found =
            compare(&frames, &frames.clone(), &[vec![Rect::new(0, 0, 8, 16), Rect::new(8, 0, 16, 16)]]).unwrap();
        assert_eq!((found.equal, found.differing, found.no_seams, found.mean_off), (1.0, 0.0, 1.0, 0.0));
    }
}
