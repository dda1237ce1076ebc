//! The results of all renderers, as text and as JSON.

use serde_json::{Value, json};

use crate::report::Report;

/// The name of our own renderer.
pub(super) const OURS: &str = "bottega";

/// The results of all renderers on all scenes.
#[derive(Debug)]
pub(super) struct PeersReport {
    pub(super) rows: Vec<PeerRow>,
    /// The renderers that were left out, and why.
    pub(super) missing: Vec<(&'static str, String)>,
}

/// The result of a renderer on a scene with a number of threads.
#[derive(Debug)]
pub(super) struct PeerRow {
    pub(super) scene: String,
    pub(super) threads: usize,
    pub(super) renderer: &'static str,
    /// Pixels times samples, in millions per second; median over repetitions.
    pub(super) mpaths: f64,
    pub(super) seconds: f64,
    pub(super) rel_mse: f64,
    /// Mean squared error of the displayed image.
    pub(super) srgb_mse: f64,
    /// The number of pixels far brighter than their neighborhood, in one image.
    pub(super) fireflies: f64,
}

impl PeerRow {
    pub(super) fn efficiency(&self) -> f64 {
        1.0 / (self.rel_mse * self.seconds)
    }

    /// Returns the efficiency by the error of the displayed image.
    pub(super) fn seen_efficiency(&self) -> f64 {
        1.0 / (self.srgb_mse * self.seconds)
    }
}

impl Report for PeersReport {
    fn as_text(&self) -> String {
        as_text(&self.rows)
    }

    fn as_json(&self) -> Value {
        as_json(&self.rows, &self.missing)
    }
}

/// Ratios of our efficiency to the best of the others: number of threads, one ratio per scene, and their geometric mean.
type EfficiencyRatios = (usize, Vec<(String, f64)>, f64);

/// An efficiency: by relative error, or by the error of the displayed image.
type Measure = fn(&PeerRow) -> f64;

/// Returns the ratios by number of threads.
fn ratios(rows: &[PeerRow], efficiency: Measure) -> Vec<EfficiencyRatios> {
    let mut threads: Vec<usize> = rows.iter().map(|row| row.threads).collect();
    threads.sort_unstable();
    threads.dedup();
    let of = |threads: usize| {
        let ours = rows.iter().filter(|row| row.threads == threads && row.renderer == OURS);
        let ratios: Vec<(String, f64)> = ours
            .filter_map(|ours| {
                let others =
                    rows.iter().filter(|row| row.threads == threads && row.scene == ours.scene && row.renderer != OURS);
                let best = others.map(efficiency).max_by(f64::total_cmp)?;
                Some((ours.scene.clone(), efficiency(ours) / best))
            })
            .collect();
        let mean = ratios.iter().map(|(_, ratio)| ratio.ln()).sum::<f64>() / ratios.len().max(1) as f64;
        (threads, ratios, mean.exp())
    };
    threads.into_iter().map(of).collect()
}

/// Returns our efficiency over that of a row on the same scene with as many threads.
fn ratio(rows: &[PeerRow], other: &PeerRow, efficiency: Measure) -> Option<f64> {
    let ours =
        rows.iter().find(|row| row.renderer == OURS && row.scene == other.scene && row.threads == other.threads)?;
    Some(efficiency(ours) / efficiency(other))
}

/// Both measures are needed: by relative error alone, images full of black specks seem better.
const MEASURES: [(&str, Measure); 2] = [("relMSE", PeerRow::efficiency), ("sRGB", PeerRow::seen_efficiency)];

fn as_text(rows: &[PeerRow]) -> String {
    let mut out = format!(
        "{:<12} {:>7}  {:<20} {:>9} {:>9} {:>9} {:>9} {:>12} {:>9}  {}\n",
        "scene",
        "threads",
        "renderer",
        "Mpaths/s",
        "seconds",
        "relMSE",
        "sRGB MSE",
        "efficiency",
        "fireflies",
        "ours over it (sRGB)"
    );
    for row in rows {
        let of = |efficiency| ratio(rows, row, efficiency);
        let ratio = of(PeerRow::efficiency).zip(of(PeerRow::seen_efficiency));
        let ratio = ratio.map_or_else(String::new, |(ratio, seen)| format!("{ratio:.2} ({seen:.2})"));
        out += &format!(
            "{:<12} {:>7}  {:<20} {:>9.3} {:>9.2} {:>9.5} {:>9.6} {:>12.3} {:>9.1}  {ratio}\n",
            row.scene,
            row.threads,
            row.renderer,
            row.mpaths,
            row.seconds,
            row.rel_mse,
            row.srgb_mse,
            row.efficiency(),
            row.fireflies
        );
    }
    for (measure, efficiency) in MEASURES {
        for (threads, ratios, mean) in ratios(rows, efficiency) {
            let each: Vec<String> = ratios.iter().map(|(scene, ratio)| format!("{scene} {ratio:.2}")).collect();
            if !each.is_empty() {
                let each = each.join(", ");
                out += &format!(
                    "\nover the best of them by {measure}, {threads} threads: {each}; geometric mean {mean:.2}\n"
                );
            }
        }
    }
    out
}

fn as_json(rows: &[PeerRow], missing: &[(&str, String)]) -> Value {
    let rows_json: Vec<Value> = rows
        .iter()
        .map(|row| {
            json!({
                "scene": row.scene, "threads": row.threads, "renderer": row.renderer, "mpaths_per_second": row.mpaths,
                "seconds": row.seconds, "rel_mse": row.rel_mse, "srgb_mse": row.srgb_mse, "efficiency": row.efficiency(),
                "srgb_efficiency": row.seen_efficiency(), "fireflies": row.fireflies,
                "ours_over_it": ratio(rows, row, PeerRow::efficiency),
                "ours_over_it_srgb": ratio(rows, row, PeerRow::seen_efficiency),
            })
        })
        .collect();
    let best = |efficiency: Measure| -> Vec<Value> {
        ratios(rows, efficiency)
            .into_iter()
            .map(|(threads, ratios, mean)| {
                let scenes: serde_json::Map<String, Value> =
                    ratios.into_iter().map(|(scene, ratio)| (scene, json!(ratio))).collect();
                json!({"threads": threads, "scenes": scenes, "geometric_mean": mean})
            })
            .collect()
    };
    let missing: serde_json::Map<String, Value> =
        missing.iter().map(|(name, reason)| ((*name).to_owned(), json!(reason))).collect();
    json!({
        "rows": rows_json, "over_the_best": best(PeerRow::efficiency),
        "over_the_best_srgb": best(PeerRow::seen_efficiency), "left_out": missing,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(renderer: &'static str, scene: &str, seconds: f64, rel_mse: f64) -> PeerRow {
        PeerRow {
            scene: scene.to_owned(),
            threads: 1,
            renderer,
            mpaths: 1.0,
            seconds,
            rel_mse,
            srgb_mse: rel_mse * rel_mse,
            fireflies: 0.0,
        }
    }

    #[test]
    fn ratios_are_to_the_best_of_each_scene() {
        let rows = [
            row(OURS, "a", 1.0, 0.1),
            row("mitsuba scalar_rgb", "a", 4.0, 0.2),
            row("cycles", "a", 2.0, 0.1),
            row(OURS, "b", 1.0, 0.1),
            row("cycles", "b", 1.0, 0.8),
            row(OURS, "c", 1.0, 0.1),
        ];
        let all = ratios(&rows, PeerRow::efficiency);
        let (threads, each, mean) = &all[0];
        assert_eq!((*threads, each.len()), (1, 2), "nobody else painted c");
        assert!((each[0].1 - 2.0).abs() < 1e-9 && (each[1].1 - 8.0).abs() < 1e-9 && (mean - 4.0).abs() < 1e-9);
        assert_eq!(as_json(&rows, &[])["over_the_best"][0]["scenes"]["b"], json!(8.0));
        assert_eq!(as_json(&rows, &[])["over_the_best_srgb"][0]["scenes"]["b"], json!(64.0));
        assert!(as_text(&rows).contains("geometric mean 4.00") && as_text(&rows).contains("mean 11.31"));
    }
}
