//! The budget of learning: the number of paths that a picture is learned from.
//!
//! Learning begins with few paths, which cost less than a hundredth of the picture and measure its noise: the variance
//! of one path relative to the brightness of its part of the picture. The noise decides how long learning continues.
//! Where light is rare, a guide from few paths is useless and one from many saves most of the work; where paths agree,
//! more of them gain little.

/// Samples of the picture per path of the first pass; each further pass has twice as many paths as the one before.
const SAMPLES_PER_PATH: u64 = 512;
/// Least and greatest number of paths of a pass.
const PATHS_MIN: u64 = 512;
const PATHS_MAX: u64 = 1 << 18;
/// Number of passes without a guide, which measure the noise.
const PLAIN_PASSES: u32 = 2;
/// Noise from which a picture counts as noisy, and from which its light counts as rare.
const NOISY: f64 = 1.0;
const RARE: f64 = 5.0;
/// Greatest error times work in the first trial, relative to plain paths and as a display shows it, for learning to go
/// on: for calm and for noisy pictures. In noisy ones, few paths teach little and few pixels may miss the noise: for a
/// mesh light and for glass, where the full training reached two thirds, the first trial showed 1.14 to 1.40.
const PROMISE_CALM: f64 = 1.05;
const PROMISE_NOISY: f64 = 1.45;
/// Number of passes of calm and of noisy pictures: some 1 and 6 paths per 100 samples.
const PASSES_CALM: u32 = 3;
const PASSES_NOISY: u32 = 5;
/// Greatest number of passes where light is rare, up to 25 paths per 100 samples, and greatest number of paths with
/// more than [`PASSES_NOISY`]: fewer are not worth it.
const PASSES_RARE: u32 = 7;
const PATHS_RARE: u64 = 160_000;
/// Number of samples below which only rare light justifies more than the first passes: the trial costs too much.
const SAMPLES_MIN: u64 = 1 << 20;

/// The budget of learning of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearningBudget {
    samples: u64,
}

impl LearningBudget {
    /// Plans the learning for a picture.
    ///
    /// - `samples`: number of samples of the whole picture.
    pub(crate) fn new(samples: u64) -> Self {
        Self { samples }
    }

    /// Returns the number of passes without a guide, which measure the noise.
    pub(crate) fn plain_passes(self) -> u32 {
        PLAIN_PASSES
    }

    /// Returns `true` if more passes than the first ones may pay off.
    pub(crate) fn goes_on(self, noise: f64) -> bool {
        noise >= RARE || self.samples >= SAMPLES_MIN
    }

    /// Returns the number of passes before the first trial; `None`: no first trial, because few passes are not
    /// conclusive where light is rare.
    pub(crate) fn passes_before_trial(self, noise: f64) -> Option<u32> {
        match noise {
            noise if noise >= RARE => None,
            noise if noise >= NOISY => Some(PLAIN_PASSES + 1),
            // NaN counts as no noise
            _ => Some(PLAIN_PASSES),
        }
    }

    /// Returns `true` if more learning may pay off.
    ///
    /// - `ratio`: error times work in the first trial, relative to plain paths, as a display shows it.
    pub(crate) fn is_promising(self, noise: f64, ratio: f64) -> bool {
        ratio < if noise >= NOISY { PROMISE_NOISY } else { PROMISE_CALM }
    }

    /// Returns the total number of passes of a picture with this noise.
    pub(crate) fn passes(self, noise: f64) -> u32 {
        match noise {
            noise if noise >= RARE => {
                let all = |passes: u32| (0..passes).map(|pass| u64::from(self.paths(pass))).sum::<u64>();
                (PASSES_NOISY..=PASSES_RARE).rev().find(|&passes| all(passes) <= PATHS_RARE).unwrap_or(PASSES_NOISY)
            }
            noise if noise >= NOISY => PASSES_NOISY,
            _ => PASSES_CALM,
        }
    }

    /// Returns the number of paths of a pass.
    pub(crate) fn paths(self, pass: u32) -> u32 {
        ((self.samples / SAMPLES_PER_PATH) << pass).clamp(PATHS_MIN, PATHS_MAX) as u32
    }
}

/// Returns the variance of one path, estimated from pixels rendered twice with `samples` each.
///
/// - `squares`: squared difference of each pair, relative to the brightness there.
pub(super) fn noise(mut squares: Vec<f64>, samples: u32) -> f64 {
    /// Share of the pixels, those with the greatest differences, that do not count.
    const TRIM: f64 = 0.005;
    squares.sort_unstable_by(f64::total_cmp);
    let kept = squares.len() - (squares.len() as f64 * TRIM).ceil() as usize;
    0.5 * f64::from(samples) * squares[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_learning_budget_follows_noise_and_samples() {
        let (small, large) = (LearningBudget::new(1 << 19), LearningBudget::new(1 << 24));
        let noises = [0.3, 2.0, 20.0, f64::NAN];
        assert_eq!(noises.map(|noise| small.goes_on(noise)), [false, false, true, false]);
        assert!(noises.iter().all(|&noise| large.goes_on(noise)));
        assert_eq!(noises.map(|noise| large.passes(noise)), [3, 5, 5, 3]);
        assert_eq!(noises.map(|noise| large.passes_before_trial(noise)), [Some(2), Some(3), None, Some(2)]);
        assert!(large.is_promising(2.0, 1.2) && !large.is_promising(0.3, 1.2) && large.is_promising(0.3, 1.0));
        assert!(!large.is_promising(2.0, f64::NAN) && !large.is_promising(2.0, f64::INFINITY));
        let share =
            |passes: u32| f64::from((0..passes).map(|pass| small.paths(pass)).sum::<u32>()) / f64::from(1 << 19);
        assert!(share(small.plain_passes()) < 0.006 && share(small.passes(20.0)) < 0.26);
        assert_eq!((small.passes(20.0), LearningBudget::new(u64::MAX >> 10).paths(6)), (7, 1 << 18));
    }

    #[test]
    fn noise_is_the_variance_of_one_path() {
        // Means of 2 that differ by 1: their variance is a half, that of one path 1.
        assert!((noise(vec![1.0; 1000], 2) - 1.0).abs() < 1e-9);
        let with_outlier = [vec![1.0; 999], vec![1e9]].concat();
        assert!((noise(with_outlier, 2) - 1.0).abs() < 1e-9);
        assert!(noise(Vec::new(), 2) == 0.0);
    }
}
