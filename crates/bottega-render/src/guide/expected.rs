//! The brightness and the importance of the parts of a picture, from paths all over it.

use super::{
    agent::{PictureWorth, TracedPath},
    tree::Guide,
};

/// Number of paths per part.
const PATHS_PER_PART: usize = 64;
/// Least side of a part, in pixels.
const SIDE_MIN: f64 = 4.0;
/// Least brightness of a part, as a share of the mean of the picture.
const DARKEST: f32 = 0.3;
/// Greatest noise of a path's first region, relative to the brightness of its part of the picture; greater noise is
/// clamped to it.
const NOISE_MAX: f32 = 20.0;
/// Greatest ratio between a part's brightness and the median around it; more is clamped as noise.
const BRIGHTEST: f32 = 4.0;

/// The brightness of the parts of a picture.
pub(super) struct PictureParts {
    /// The parts, without their importance.
    grid: PictureWorth,
    /// Brightness of each part, by the greatest channel; empty where the whole picture is dark.
    shown: Vec<f32>,
}

impl PictureParts {
    /// Computes the brightness from paths all over a picture of this size in pixels.
    pub(super) fn new(size: [u32; 2], paths: &[TracedPath]) -> Self {
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

    /// Returns 1 over the brightness at a position in the picture; 0: unknown.
    pub(super) fn weight(&self, place: [f32; 2]) -> f32 {
        self.shown.get(self.grid.part(place)).map_or(0.0, |shown| 1.0 / shown)
    }
}

impl PictureWorth {
    /// Computes the importance from paths all over a picture, the brightness of its parts, and what was learned.
    pub(super) fn new(parts: PictureParts, paths: &[TracedPath], guide: &Guide) -> Self {
        let PictureParts { grid, shown } = parts;
        // The unit of importance: with it, paths continue as one on average at their first vertex
        let mut sum = 0.0_f64;
        for path in paths {
            let Some((p, normal, throughput)) = path.first else { continue };
            let agent = guide.leaf(p, normal).and_then(|leaf| guide.agent(leaf));
            let noise = agent.map_or(0.0, |agent| agent.noise * throughput);
            let shown = shown.get(grid.part(path.place)).copied().unwrap_or(1.0);
            sum += f64::from((noise / shown).min(NOISE_MAX));
        }
        let unit = (sum / paths.len().max(1) as f64) as f32;
        // Without agents, the unit does not matter
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let worth = |shown: &f32| {
            let worth = 1.0 / (shown * unit);
            if worth.is_finite() { worth } else { 0.0 }
        };
        let worth = shown.iter().map(worth).collect::<Vec<_>>();
        if worth.is_empty() { Self::default() } else { Self { worth, ..grid } }
    }

    /// Returns the brightness of a part, clamped to a range around the median of its neighbours.
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
