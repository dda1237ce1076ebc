//! The worth of the parts of a picture to a viewer, from paths all over it.

use super::{
    agent::{EyePath, PictureWorth},
    tree::Guide,
};

/// Paths in a part of the picture, as far as there are enough.
const PATHS_PER_PART: usize = 64;
/// Least side of a part, in pixels.
const SIDE_MIN: f64 = 4.0;
/// What a part shows counts as no less than this share of what the picture does.
const DARKEST: f32 = 0.3;
/// A path whose first region is so many times as noisy as its part of the picture is bright counts as no noisier.
const NOISE_MAX: f32 = 20.0;
/// A light that differs from the mean of those next to it by more than this factor is taken for noise.
const BRIGHTEST: f32 = 4.0;

/// What the parts of a picture show.
pub(super) struct PictureParts {
    /// Without what they are worth.
    grid: PictureWorth,
    /// The greatest channel of each part. None where all is dark.
    shown: Vec<f32>,
}

impl PictureParts {
    /// From paths all over a picture of this size in pixels.
    pub(super) fn new(size: [u32; 2], paths: &[EyePath]) -> Self {
        let [width, height] = size.map(f64::from);
        let parts = (paths.len() / PATHS_PER_PART).max(1) as f64;
        let side = (width * height / parts).sqrt().max(SIDE_MIN);
        let [columns, rows] = [width, height].map(|length| (length / side).ceil().max(1.0) as u32);
        let grid = PictureWorth { columns, rows, worth: Vec::new() };
        let count = (columns * rows) as usize;
        let (mut sums, mut counts) = (vec![0.0_f64; count], vec![0_u32; count]);
        for path in paths {
            let part = grid.part(path.place);
            sums[part] += f64::from(path.brightness);
            counts[part] += 1;
        }
        let total = sums.iter().sum::<f64>() / paths.len().max(1) as f64;
        let means: Vec<f32> = sums
            .iter()
            .zip(&counts)
            .map(|(&sum, &count)| if count > 0 { (sum / f64::from(count)) as f32 } else { total as f32 })
            .collect();
        if !(total > 0.0 && total.is_finite()) {
            return Self { grid, shown: Vec::new() };
        }
        let least = DARKEST * total as f32;
        let shown = (0..count).map(|part| grid.calmed(&means, part).max(least)).collect();
        Self { grid, shown }
    }

    /// One over what a place in the picture shows; 0 where nobody knows.
    pub(super) fn weight(&self, place: [f32; 2]) -> f32 {
        self.shown.get(self.grid.part(place)).map_or(0.0, |shown| 1.0 / shown)
    }
}

impl PictureWorth {
    /// From paths all over a picture, what its parts show, and what was learnt from them.
    pub(super) fn new(parts: PictureParts, paths: &[EyePath], guide: &Guide) -> Self {
        let PictureParts { grid, shown } = parts;
        // In units of this, paths go on as one on the average where they first can.
        let mut sum = 0.0_f64;
        for path in paths {
            let Some((p, normal, throughput)) = path.first else { continue };
            let agent = guide.leaf(p, normal).and_then(|leaf| guide.agent(leaf));
            let noise = agent.map_or(0.0, |agent| agent.noise * throughput);
            let shown = shown.get(grid.part(path.place)).copied().unwrap_or(1.0);
            sum += f64::from((noise / shown).min(NOISE_MAX));
        }
        let unit = (sum / paths.len().max(1) as f64) as f32;
        // Where there are no agents, the unit is of no use.
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let worth = |shown: &f32| {
            let worth = 1.0 / (shown * unit);
            if worth.is_finite() { worth } else { 0.0 }
        };
        let worth = shown.iter().map(worth).collect::<Vec<_>>();
        if worth.is_empty() { Self::default() } else { Self { worth, ..grid } }
    }

    /// What a part shows, if that is about what is around it.
    fn calmed(&self, means: &[f32], part: usize) -> f32 {
        let (columns, rows) = (self.columns as usize, self.rows as usize);
        let (x, y) = (part % columns, part / columns);
        let mut around = [0.0; 9];
        let mut count = 0;
        for y in y.saturating_sub(1)..(y + 2).min(rows) {
            for x in x.saturating_sub(1)..(x + 2).min(columns) {
                around[count] = means[y * columns + x];
                count += 1;
            }
        }
        around[..count].sort_unstable_by(f32::total_cmp);
        let middle = around[count / 2];
        means[part].clamp(middle / BRIGHTEST, middle * BRIGHTEST)
    }
}
