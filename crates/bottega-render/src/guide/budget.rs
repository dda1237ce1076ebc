//! The budget of learning: how many paths a picture is worth learning from.
//!
//! Learning begins with few paths, which cost less than a hundredth of the picture and tell how noisy it is: the variance of one path
//! relative to what its part of the picture shows. That decides how far learning may go. Where light is rare, a guide of few paths is
//! of no use and one of many saves most of the work; where paths agree, more of them teach little that the picture would gain from.

/// Samples of the picture for each path of the first pass; each further pass has twice as many as the one before.
const SAMPLES_PER_PATH: u64 = 512;
/// Paths of a pass, at least and at most.
const PATHS_MIN: u64 = 512;
const PATHS_MAX: u64 = 1 << 18;
/// Passes whose paths go as if nothing had been learnt, and tell the noise.
const PLAIN_PASSES: u32 = 2;
/// Noise from which on a picture is noisy, and from which on its light is rare.
const NOISY: f64 = 1.0;
const RARE: f64 = 5.0;
/// Error times work over that of plain paths, by what a display shows, below which the first trial promises enough to learn on: of a
/// picture that is not noisy and of one that is. There few paths teach little, and few pixels may miss where the noise is: of a mesh
/// light and of glass, where all passes brought it to two thirds, they told 1.14 to 1.40.
const PROMISE_CALM: f64 = 1.05;
const PROMISE_NOISY: f64 = 1.45;
/// All passes of a picture that is not noisy, and of one that is: some 1 and 6 paths for each 100 samples.
const PASSES_CALM: u32 = 3;
const PASSES_NOISY: u32 = 5;
/// Where light is rare, there are more, up to 25 paths for each 100 samples, until they are so many together: what fewer teach is not
/// worth having.
const PASSES_RARE: u32 = 7;
const PATHS_RARE: u64 = 160_000;
/// Samples below which only rare light is worth more than the first passes: too few paths could be spared to find out whether more pay.
const SAMPLES_MIN: u64 = 1 << 20;

/// How far learning goes for a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearningBudget {
    samples: u64,
}

impl LearningBudget {
    /// - `samples`: of the picture, all pixels together.
    pub(crate) fn new(samples: u64) -> Self {
        Self { samples }
    }

    /// Passes with which learning begins: their paths go as if nothing had been learnt, and tell the noise.
    pub(crate) fn plain_passes(self) -> u32 {
        PLAIN_PASSES
    }

    /// Whether more may be worth learning than what the first passes tell.
    pub(crate) fn goes_on(self, noise: f64) -> bool {
        noise >= RARE || self.samples >= SAMPLES_MIN
    }

    /// Passes after which it is tried whether more of them may pay; `None`: where light is rare, few cannot know, and it is not.
    pub(crate) fn passes_before_trial(self, noise: f64) -> Option<u32> {
        match noise {
            noise if noise >= RARE => None,
            noise if noise >= NOISY => Some(PLAIN_PASSES + 1),
            // (What is no number is as good as no noise.)
            _ => Some(PLAIN_PASSES),
        }
    }

    /// Whether more learning may pay.
    ///
    /// - `ratio`: error times work of what the first trial tried, over that of plain paths, by what a display shows.
    pub(crate) fn is_promising(self, noise: f64, ratio: f64) -> bool {
        ratio < if noise >= NOISY { PROMISE_NOISY } else { PROMISE_CALM }
    }

    /// All passes of a picture with such noise that goes on.
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

    /// Paths of a pass.
    pub(crate) fn paths(self, pass: u32) -> u32 {
        ((self.samples / SAMPLES_PER_PATH) << pass).clamp(PATHS_MIN, PATHS_MAX) as u32
    }
}

/// Variance of one path from pictures of the same pixels, painted twice with `samples` each.
///
/// - `squares`: squared difference of each pair, relative to what is shown there.
pub(super) fn noise(mut squares: Vec<f64>, samples: u32) -> f64 {
    /// Share of the pixels, the worst ones, that do not count.
    const TRIM: f64 = 0.005;
    squares.sort_unstable_by(f64::total_cmp);
    let kept = squares.len() - (squares.len() as f64 * TRIM).ceil() as usize;
    0.5 * f64::from(samples) * squares[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_learnt_from_follows_noise_and_samples() {
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
