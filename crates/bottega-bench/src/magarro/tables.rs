//! The tables as text and as JSON.

use bottega_farm::Optimization;
use serde_json::{Value, json};

use super::{
    paper::{self, AGENTS},
    report::{MagarroReport, MagarroRow, PictureError},
    second_agent::REPLAY_OFF_MAX,
};
use crate::report::Report;

impl Report for MagarroReport {
    fn as_text(&self) -> String {
        as_text(self)
    }

    fn as_json(&self) -> Value {
        as_json(self)
    }
}

/// Formats minutes and seconds like the paper, with tenths; only seconds below a minute.
fn clock(seconds: f64) -> String {
    if seconds < 59.95 {
        format!("{seconds:.1} s")
    } else {
        format!("{}:{:04.1}", (seconds / 60.0) as u64, seconds % 60.0)
    }
}

/// Returns the times: of one agent measured; of two measured if available; of more replayed.
pub(super) fn times(row: &MagarroRow) -> [f64; 4] {
    let [_, replayed, four, eight] = row.replayed;
    [row.measured, row.pair.unwrap_or(replayed), four, eight]
}

fn as_text(report: &MagarroReport) -> String {
    let MagarroReport { width, height, samples, light_samples, max_depth, .. } = report;
    let mut text = format!(
        "{width}x{height}, {samples} samples per pixel, {light_samples} light samples a bounce, {max_depth} bounces\n\
         times are minutes:seconds; m: measured, an agent is a process with one thread; r: replayed from what the zones took\n\n"
    );
    text += &partition_table("Table 1: partition, optimization n             (the paper)", &report.levels);
    text += &partition_table("The same, all as in the paper                  (the paper)", &report.papers_levels);
    text +=
        "Table 2: optimization, level 3\nagents        off         vs          s          n          b         vb\n";
    let columns: Vec<&MagarroRow> = std::iter::once(&report.off).chain(&report.optimizations).collect();
    for (index, agents) in AGENTS.iter().enumerate() {
        text += &format!("{agents:<7}");
        for row in &columns {
            text += &format!("{:>9} {}", clock(times(row)[index]), kind(row, index));
        }
        text += "\npaper  ";
        text += &if index == 0 { format!("{:>9}  ", clock(paper::UNOPTIMIZED)) } else { format!("{:>11}", "–  ") };
        for row in paper::TABLE_2 {
            text += &format!("{:>9}  ", clock(row[index]));
        }
        text += "\n";
    }
    text += &format!(
        "\noff over optimized, 1 agent: {} (the paper: {})\n",
        ratios(report.optimizations.iter().map(|row| report.off.measured / row.measured)),
        ratios(paper::TABLE_2.iter().map(|row| paper::UNOPTIMIZED / row[0]))
    );
    text += &format!(
        "with the paper's set of rules: {}\n",
        ratios(report.papers_rules.iter().map(|row| report.off.measured / row.measured))
    );
    text += &format!(
        "partition costs {:+.1} % (level 3 over none, 1 agent, off)\n",
        100.0 * (report.off.measured / report.whole.measured - 1.0)
    );
    text += &validation(report);
    text += "\nagainst off    RMSE       difference   FLIP mean\n";
    text += &differences(report);
    let (difference, paper_noise) = paper::DIFFERENCE;
    text + &format!("the paper                {difference:>6} % of vb, of which noise about {paper_noise} %\n")
}

/// Formats the times of levels 1 to 3 beside those of the paper's table 1.
fn partition_table(heading: &str, levels: &[MagarroRow]) -> String {
    let mut text = format!("{heading}\nagents        level 1      level 2      level 3    level 1  level 2  level 3\n");
    for (index, agents) in AGENTS.iter().enumerate() {
        text += &format!("{agents:<7}");
        for row in levels {
            text += &format!("{:>11} {}", clock(times(row)[index]), kind(row, index));
        }
        for row in paper::TABLE_1 {
            text += &format!("{:>9}", clock(row[index]));
        }
        text += "\n";
    }
    let zones: Vec<String> = levels.iter().map(|row| row.zones.to_string()).collect();
    text += &format!("zones          {}\n", zones.join("  "));
    text + &format!(
        "8 agents over 1: {} (the paper: {})\n\n",
        ratios(levels.iter().map(speedup)),
        ratios(paper::TABLE_1.iter().map(|row| row[0] / row[3]))
    )
}

/// Formats the difference of each image to the one without optimization.
fn differences(report: &MagarroReport) -> String {
    let ours = report.optimizations.iter().map(|row| (name(row.optimization).to_owned(), row.error));
    let papers = report.papers_rules.iter().map(|row| (format!("paper's {}", name(row.optimization)), row.error));
    let rows = std::iter::once(("two seeds".to_owned(), Some(report.noise))).chain(ours).chain(papers);
    let line = |(name, error): (String, Option<PictureError>)| {
        error.map(|PictureError { rmse, percent, flip }| {
            format!("{name:<13} {rmse:>8.5}   {percent:>7.2} %   {flip:>9.4}\n")
        })
    };
    rows.filter_map(line).collect()
}

/// Returns the mark of a time: `m` measured, `r` replayed.
fn kind(row: &MagarroRow, index: usize) -> &'static str {
    if index == 0 || index == 1 && row.pair.is_some() { "m" } else { "r" }
}

/// Formats the ratios of replayed to measured times of pairs.
fn validation(report: &MagarroReport) -> String {
    let rows = report.levels.iter().chain([&report.off]).chain(&report.papers_levels).chain(&report.optimizations);
    let off: Vec<f64> = rows.filter_map(|row| Some(row.replayed_pair? / row.pair?)).collect();
    if off.is_empty() {
        return "two agents were not measured: the replay is not checked\n".to_owned();
    }
    let within = off.iter().filter(|ratio| (*ratio - 1.0).abs() <= REPLAY_OFF_MAX).count();
    format!(
        "speed of a processor beside another one: {:.2}\n\
         two agents replayed at that speed over measured: {}; {within} of {} within {:.0} %\n",
        report.speed_beside,
        ratios(off.iter().copied()),
        off.len(),
        100.0 * REPLAY_OFF_MAX
    )
}

fn name(optimization: Optimization) -> &'static str {
    match optimization {
        Optimization::Off => "off",
        Optimization::VerySmall => "vs",
        Optimization::Small => "s",
        Optimization::Normal => "n",
        Optimization::Big => "b",
        Optimization::VeryBig => "vb",
    }
}

/// Returns the replayed time of one agent over that of eight; only the number differs.
pub(super) fn speedup(row: &MagarroRow) -> f64 {
    row.replayed[0] / row.replayed[3]
}

fn ratios(values: impl Iterator<Item = f64>) -> String {
    values.map(|value| format!("{value:.2}")).collect::<Vec<_>>().join("  ")
}

fn as_json(report: &MagarroReport) -> Value {
    let error = |error: Option<PictureError>| {
        error.map(
            |PictureError { rmse, percent, flip }| json!({"rmse": rmse, "difference_percent": percent, "flip": flip}),
        )
    };
    let row = |row: &MagarroRow| {
        json!({
            "level": row.level as u8, "optimize": name(row.optimization), "ways": row.ways.name(),
            "zones": row.zones, "agents": AGENTS, "measured_seconds_1_agent": row.measured,
            "survey_seconds": row.survey, "measured_seconds_2_agents": row.pair,
            "replayed_seconds_2_agents_at_that_speed": row.replayed_pair,
            "replayed_seconds": row.replayed, "speedup_8_agents": speedup(row),
            "error": error(row.error),
        })
    };
    json!({
        "width": report.width, "height": report.height, "samples": report.samples,
        "light_samples": report.light_samples, "max_depth": report.max_depth, "speed_beside_another": report.speed_beside,
        "whole": row(&report.whole),
        "off": row(&report.off),
        "noise": error(Some(report.noise)),
        "table_1": report.levels.iter().map(row).collect::<Vec<_>>(),
        "table_2": report.optimizations.iter().map(row).collect::<Vec<_>>(),
        "table_2_papers_rules": report.papers_rules.iter().map(row).collect::<Vec<_>>(),
        "table_1_as_in_paper": report.papers_levels.iter().map(row).collect::<Vec<_>>(),
        "paper": {
            "unoptimized_seconds": paper::UNOPTIMIZED, "table_1_seconds": paper::TABLE_1,
            "table_2_seconds": paper::TABLE_2, "difference_percent": paper::DIFFERENCE.0,
            "noise_percent": paper::DIFFERENCE.1,
        },
    })
}

#[cfg(test)]
mod tests {
    use bottega_farm::Level;
    use bottega_image::Picture;

    use super::{
        super::{Pictures, paper::OPTIMIZATIONS, report::Ways},
        *,
    };

    fn row(level: Level, optimization: Optimization, measured: f64) -> MagarroRow {
        let replayed = [measured, measured / 2.0, measured / 4.0, measured / 7.5];
        let error = Some(PictureError { rmse: 0.01, percent: 1.5, flip: 0.02 });
        MagarroRow {
            level,
            optimization,
            ways: Ways::Ours,
            measured,
            survey: 0.1,
            pair: Some(measured / 1.95),
            replayed_pair: Some(measured / 1.94),
            replayed,
            zones: 64,
            error,
        }
    }

    fn report() -> MagarroReport {
        let level_3 = |optimization| row(Level::Balanced, optimization, 50.0);
        let levels = [Level::Divided, Level::Joined, Level::Balanced];
        let picture = Picture::new(1, 1);
        MagarroReport {
            width: 320,
            height: 240,
            samples: 64,
            light_samples: 4,
            max_depth: 8,
            speed_beside: 0.97,
            whole: row(Level::Whole, Optimization::Off, 100.0),
            off: row(Level::Balanced, Optimization::Off, 102.0),
            noise: PictureError { rmse: 0.005, percent: 1.0, flip: 0.01 },
            levels: levels.map(|level| row(level, Optimization::Normal, 50.0)).to_vec(),
            optimizations: OPTIMIZATIONS.map(level_3).to_vec(),
            papers_rules: OPTIMIZATIONS.map(level_3).to_vec(),
            papers_levels: levels.map(|level| row(level, Optimization::Normal, 50.0)).to_vec(),
            pictures: Pictures { off: picture.clone(), very_big: picture },
        }
    }

    #[test]
    fn ours_stand_beside_the_papers() {
        let text = as_text(&report());
        // 105:02 over 16:52.
        assert!(text.contains("8 agents over 1: 7.50  7.50  7.50 (the paper: 3.51  3.51  6.23)"), "{text}");
        assert!(text.contains("off over optimized, 1 agent: 2.04"), "{text}");
        assert!(text.contains("with the paper's set of rules: 2.04") && text.contains("paper's vb"), "{text}");
        assert!(text.contains("partition costs +2.0 %"), "{text}");
        assert!(text.contains("50.0 s m") && text.contains("6.7 s r") && text.contains("1:42.0 m"), "{text}");
        assert!(text.contains("25.6 s m") && text.contains("12 of 12 within 5 %"), "{text}");
        let json = as_json(&report());
        assert_eq!(json["table_2"].as_array().map(Vec::len), Some(5));
        assert_eq!(json["table_1"][2]["measured_seconds_1_agent"], json!(50.0));
    }

    #[test]
    fn the_plot_has_a_curve_for_each_row() {
        let svg = super::super::plot::svg(&report());
        // Three levels and as many of the paper's, the ideal, and two of optimization.
        assert_eq!(svg.matches("<polyline").count(), 9);
    }
}
