//! Tables of the results, as text and as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{ludd, paper, report::AlaReport, ways::MethodResult};
use crate::report::Report;

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
        // Writing to a string cannot fail.
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
    let names: String = report.photons.by_map().iter().map(|(name, _)| format!(" {name:>10}")).collect();
    line(format!("\n{:<28}{names}", "memory by map, MB"));
    for result in std::iter::once(&report.photons).chain(&report.others) {
        let cells = result.by_map().map(|(_, bytes)| format!(" {:>10.3}", bytes as f64 / 1e6));
        line(format!("{:<28}{}", result.way.name, cells.concat()));
    }
    table_2(report, &mut line);
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
        for result in report.others.iter().chain(&report.budgets).filter(|result| result.agents.is_some()) {
            line(Ratios::new(baseline, result).row(&result.way.name));
        }
        if let Some(best) = report.best(baseline) {
            line(Ratios::new(baseline, best).row(&format!("first there: {}", best.way.name)));
        }
    }
    for other in &report.elsewhere {
        let photons = &other.photons;
        line(format!("{}, beside {} (relMSE {:.2e}):", other.scene, photons.way.name, photons.error()));
        other.agents.iter().for_each(|result| line(Ratios::new(photons, result).row(&result.way.name)));
    }
    text + &ludd::as_text(&report.useful_data)
}

/// Writes the paper's table 2: memory of photon maps and agents, and the reason why the speedup of casting differs.
fn table_2(report: &AlaReport, line: &mut dyn FnMut(String)) {
    let agents = report.others.iter().find(|result| result.agents.is_some());
    let (Some(photons), Some(agents)) = (report.four_maps(), agents) else { return };
    line(format!(
        "\n{:<34} {:>10} {:>10} {:>8} {:>10} {:>8}",
        "table 2", "photons", "agents", "ratio", "the paper", "ratio"
    ));
    let row = |name: &str, [photons, agents]: [f64; 2], paper: [f64; 2]| {
        let (ratio, paper_ratio) = (agents / photons, paper[1] / paper[0]);
        let paper = format!("{}, {}", paper[0], paper[1]);
        format!("{name:<34} {photons:>10.2} {agents:>10.2} {ratio:>8.2} {paper:>10} {paper_ratio:>8.2}")
    };
    line(row("casting and looking around, s", [photons.casting, agents.casting], paper::CASTING));
    let maps = ["direct", "indirect", "caustic", "shadow"];
    let four =
        photons.by_map().iter().filter(|(name, _)| maps.contains(name)).map(|(_, bytes)| *bytes as f64 / 1e6).sum();
    line(row("four maps, and agents, MB", [four, agents.megabytes()], [paper::MAPS.iter().sum(), paper::AGENTS]));
    let report = agents.agents.unwrap_or_default();
    let [cast, sensed] = [report.casting, report.sensing].map(|time| time.as_secs_f64());
    if agents.casting / photons.casting > paper::CASTING[1] / paper::CASTING[0] {
        line(format!(
            "The paper's gain is not had: of the agents' time {cast:.2} s is casting and {sensed:.2} s looking around, where {} \
             irradiance sensors follow 256 paths each, while a photon is traced once.",
            report.sensors[3]
        ));
    }
}

/// The costs of a method, relative to a baseline of photon mapping.
struct Ratios {
    casting: f64,
    maps: f64,
    /// Render time at equal numbers of samples.
    render: f64,
    /// Time to an equal error; `None`: not reached.
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

    fn row(&self, name: &str) -> String {
        let Self { casting, maps, render, equal } = self;
        let equal = equal.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}"));
        format!("  {name:<32} {casting:>8.2} {maps:>6.3} {render:>24.2} {equal:>22}")
    }

    fn as_json(&self) -> Value {
        let Self { casting, maps, render, equal } = self;
        json!({ "casting": casting, "maps": maps, "render": render, "render_at_equal_error": equal })
    }
}

fn as_json(report: &AlaReport) -> Value {
    let method_json = |result: &MethodResult| {
        let bytes: serde_json::Map<_, _> =
            result.by_map().into_iter().map(|(name, bytes)| (name.to_owned(), json!(bytes))).collect();
        json!({
            "name": result.way.name,
            "casting_seconds": result.casting,
            "map_bytes": bytes,
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
        "photons": method_json(&report.photons),
        "others": report.others.iter().map(method_json).collect::<Vec<_>>(),
        "budgets": report.budgets.iter().map(method_json).collect::<Vec<_>>(),
        "first_at_equal_error": report.baselines().map(|baseline| json!({
            "beside": baseline.way.name,
            "rel_mse": baseline.error(),
            "first": report.best(baseline).map(|best| best.way.name.as_str()),
            "over": report.best(baseline).map(|best| Ratios::new(baseline, best).as_json()),
        })).collect::<Vec<_>>(),
        "elsewhere": report.elsewhere.iter().map(|other| json!({
            "scene": other.scene,
            "photons": method_json(&other.photons),
            "agents": other.agents.iter().map(|result| {
                let over = Ratios::new(&other.photons, result).as_json();
                json!({ "agents": method_json(result), "over_photons": over })
            }).collect::<Vec<_>>(),
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
