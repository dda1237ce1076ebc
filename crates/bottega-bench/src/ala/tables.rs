//! Tables of the measured figures, for people and for programs.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{ludd, paper, report::AlaReport, ways::MethodResult};
use crate::Report;

impl Report for AlaReport {
    fn as_text(&self) -> String {
        as_text(self)
    }

    fn as_json(&self) -> Value {
        as_json(self)
    }
}

fn as_text(report: &AlaReport) -> String {
    let mut text = String::new();
    let target = report.photons.error();
    let mut line = |row: String| {
        // A string can always be written to.
        let _ = writeln!(text, "{row}");
    };
    let (width, height) = (report.reference.width, report.reference.height);
    line(format!(
        "{width} × {height}, {} samples a pixel; relMSE without the worst 0.1 % of the pixels\n",
        report.samples
    ));
    line(format!(
        "{:<28} {:>9} {:>9} {:>10} {:>10} {:>14}",
        "", "casting s", "maps MB", "render s", "relMSE", "to equal error"
    ));
    for result in report.all() {
        let equal = result.seconds_to(target).map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.2} s"));
        line(format!(
            "{:<28} {:>9.2} {:>9.2} {:>10.2} {:>10.2e} {equal:>14}",
            result.way.name,
            result.casting,
            result.megabytes(),
            result.seconds(),
            result.error()
        ));
    }
    line("\nmemory by map, MB: seen (caustic), irradiance, shadow photons, cache, agents".to_owned());
    for result in std::iter::once(&report.photons).chain(&report.others) {
        let bytes = &result.bytes;
        let megabytes = [bytes.seen, bytes.irradiance, bytes.shadow, bytes.cache, bytes.agents];
        let cells: String = megabytes.iter().map(|&bytes| format!(" {:>8.3}", bytes as f64 / 1e6)).collect();
        line(format!("{:<28}{cells}", result.way.name));
    }
    line("\nshadow rays                   traced   pixels with FLIP > 0.1 beside all rays traced".to_owned());
    for shadows in &report.shadows {
        line(format!("{:<28} {:>6.1} %  {:.4} %", shadows.name, 100.0 * shadows.traced, 100.0 * shadows.wrong));
    }
    line(format!(
        "\n{:<34} {:>8} {:>6} {:>24} {:>22}",
        "agents over photons", "casting", "maps", "render at equal samples", "render at equal error"
    ));
    let [casting, render] = [paper::CASTING, paper::RENDERING].map(|[photons, agents]| agents / photons);
    let maps = paper::AGENTS / paper::MAPS.iter().sum::<f64>();
    line(format!("{:<34} {casting:>8.2} {maps:>6.2} {render:>24.2}", "the paper's own figures"));
    for baseline in report.baselines() {
        line(format!("beside {} (relMSE {:.2e}):", baseline.way.name, baseline.error()));
        let named = |name: &str, result: &MethodResult| {
            let Ratios { casting, maps, render, equal } = Ratios::new(baseline, result);
            let equal = equal.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}"));
            format!("  {name:<32} {casting:>8.2} {maps:>6.3} {render:>24.2} {equal:>22}")
        };
        for result in report.others.iter().filter(|result| result.agents.is_some()) {
            line(named(&result.way.name, result));
        }
        if let Some(best) = report.best(baseline) {
            line(named(&format!("first there: {}", best.way.name), best));
        }
    }
    text + &ludd::as_text(&report.useful_data)
}

/// What a way takes, as shares of what some photon mapping takes.
struct Ratios {
    casting: f64,
    maps: f64,
    /// At as many samples.
    render: f64,
    /// Until the error is no greater; `None`: it was not reached.
    equal: Option<f64>,
}

impl Ratios {
    fn new(baseline: &MethodResult, result: &MethodResult) -> Self {
        Self {
            casting: result.casting / baseline.casting,
            maps: result.megabytes() / baseline.megabytes(),
            render: result.seconds() / baseline.seconds(),
            equal: result.seconds_to(baseline.error()).map(|seconds| seconds / baseline.seconds()),
        }
    }

    fn as_json(&self) -> Value {
        let Self { casting, maps, render, equal } = self;
        json!({ "casting": casting, "maps": maps, "render": render, "render_at_equal_error": equal })
    }
}

fn as_json(report: &AlaReport) -> Value {
    let told = |result: &MethodResult| {
        let bytes = &result.bytes;
        json!({
            "name": result.way.name,
            "casting_seconds": result.casting,
            "map_bytes": {
                "seen": bytes.seen,
                "irradiance": bytes.irradiance,
                "shadow": bytes.shadow,
                "cache": bytes.cache,
                "agents": bytes.agents,
            },
            "curve": result.marks.iter().map(|mark| json!({
                "samples": mark.samples,
                "seconds": mark.seconds,
                "rel_mse": mark.error,
            })).collect::<Vec<_>>(),
            "seconds_to_equal_error": result.seconds_to(report.photons.error()),
            "shadow_rays_traced": result.traced(),
            "over_photons": Ratios::new(&report.photons, result).as_json(),
        })
    };
    json!({
        "width": report.reference.width,
        "height": report.reference.height,
        "samples": report.samples,
        "photons": told(&report.photons),
        "others": report.others.iter().map(told).collect::<Vec<_>>(),
        "budgets": report.budgets.iter().map(told).collect::<Vec<_>>(),
        "first_at_equal_error": report.baselines().map(|baseline| json!({
            "beside": baseline.way.name,
            "rel_mse": baseline.error(),
            "first": report.best(baseline).map(|best| best.way.name.as_str()),
            "over": report.best(baseline).map(|best| Ratios::new(baseline, best).as_json()),
        })).collect::<Vec<_>>(),
        "useful_data": ludd::as_json(&report.useful_data),
        "shadows": report.shadows.iter().map(|shadows| json!({
            "name": shadows.name,
            "traced": shadows.traced,
            "wrong_pixels": shadows.wrong,
        })).collect::<Vec<_>>(),
        "paper": {
            "casting_seconds": paper::CASTING,
            "photon_maps_megabytes": paper::MAPS,
            "agents_megabytes": paper::AGENTS,
            "rendering_seconds": paper::RENDERING,
        },
    })
}
