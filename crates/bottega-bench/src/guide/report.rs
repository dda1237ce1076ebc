//! The gain of path guiding, as text and as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::report::Report;

/// The time of an image, and its error to the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct WayResult {
    /// Processor time in seconds, including learning.
    pub(super) seconds: f64,
    pub(super) rel_mse: f64,
    pub(super) srgb_mse: f64,
}

/// All images of a scene with this many samples, by seed.
#[derive(Clone, Debug)]
pub(super) struct GuideRow {
    pub(super) scene: String,
    pub(super) samples: u32,
    pub(super) without: Vec<WayResult>,
    pub(super) with: Vec<WayResult>,
}

/// The gain of path guiding on all scenes, by samples per pixel.
#[derive(Clone, Debug)]
pub(super) struct GuideReport {
    pub(super) rows: Vec<GuideRow>,
    pub(super) size: [u32; 2],
    pub(super) seeds: u32,
}

/// A value of an image's result.
type Figure = fn(&WayResult) -> f64;

/// The two error measures.
const MEASURES: [Figure; 2] = [|it| it.rel_mse, |it| it.srgb_mse];

fn mean(results: &[WayResult], figure: Figure) -> f64 {
    results.iter().map(figure).sum::<f64>() / results.len().max(1) as f64
}

impl GuideRow {
    /// Returns the time with guiding over that without.
    fn time_ratio(&self) -> f64 {
        mean(&self.with, |it| it.seconds) / mean(&self.without, |it| it.seconds)
    }

    /// Returns error × time with guiding over that without.
    fn ratio(&self, error: Figure) -> f64 {
        self.time_ratio() * mean(&self.with, error) / mean(&self.without, error)
    }

    /// Returns the uncertainty factor of the ratio: the standard error of its logarithm over the seeds.
    fn spread(&self, error: Figure) -> f64 {
        let logs: Vec<f64> = self
            .with
            .iter()
            .zip(&self.without)
            .map(|(with, without)| (error(with) * with.seconds / (error(without) * without.seconds)).ln())
            .collect();
        let count = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / count;
        let square = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>();
        (square / (count - 1.0).max(1.0) / count).sqrt()
    }

    pub(super) fn line(&self) -> String {
        let [rel, srgb] = MEASURES.map(|error| format!("{:.2} ± {:.2}", self.ratio(error), self.spread(error)));
        let error = mean(&self.without, MEASURES[0]);
        format!(
            "{:<14} {:>7} {:>9.2} {:>9.2} {:>11.5} {rel:>13} {srgb:>13}",
            self.scene,
            self.samples,
            mean(&self.without, |it| it.seconds),
            self.time_ratio(),
            error
        )
    }
}

impl Report for GuideReport {
    fn as_text(&self) -> String {
        let [width, height] = self.size;
        let mut out = format!(
            "error × time of the processors with --guide ala over that of --guide none, learning included; {width} × \
             {height}, {} seeds\n{:<14} {:>7} {:>9} {:>9} {:>11} {:>13} {:>13}\n",
            self.seeds, "scene", "samples", "s of none", "time", "relMSE none", "by relMSE", "by sRGB"
        );
        for row in &self.rows {
            _ = writeln!(out, "{}", row.line());
        }
        out
    }

    fn as_json(&self) -> Value {
        let way = |results: &[WayResult]| {
            let [rel_mse, srgb_mse] = MEASURES.map(|error| mean(results, error));
            json!({ "seconds": mean(results, |it| it.seconds), "rel_mse": rel_mse, "srgb_mse": srgb_mse })
        };
        let row = |row: &GuideRow| {
            let [rel, srgb] = MEASURES.map(|error| json!({ "ratio": row.ratio(error), "spread": row.spread(error) }));
            json!({ "scene": row.scene, "samples": row.samples, "none": way(&row.without), "ala": way(&row.with),
                "time_ratio": row.time_ratio(), "by_rel_mse": rel, "by_srgb": srgb })
        };
        json!({ "size": self.size, "seeds": self.seeds, "rows": self.rows.iter().map(row).collect::<Vec<_>>() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_of_error_times_time() {
        let of = |seconds, rel_mse, srgb_mse| WayResult { seconds, rel_mse, srgb_mse };
        let row = GuideRow {
            scene: "a".to_owned(),
            samples: 8,
            without: vec![of(1.0, 0.2, 0.1), of(3.0, 0.2, 0.1)],
            with: vec![of(2.0, 0.05, 0.2), of(6.0, 0.05, 0.2)],
        };
        let [rel, srgb] = MEASURES.map(|error| row.ratio(error));
        assert!((rel - 0.5).abs() < 1e-9 && (srgb - 4.0).abs() < 1e-9, "{rel} {srgb}");
        assert!(row.spread(MEASURES[0]) < 1e-9, "both seeds say the same");
        let report = GuideReport { rows: vec![row], size: [4, 3], seeds: 2 };
        assert!(report.as_text().contains("0.50 ± 0.00"), "{}", report.as_text());
        assert_eq!(report.as_json()["rows"][0]["samples"], json!(8));
    }
}
