//! The forecast of zones: how well their time is known before anybody has seen them, in a first job and in a second of its kind.

mod timed_engine;

use std::{fmt::Write as _, io::Write, path::PathBuf, sync::Arc, time::Duration};

use bottega::{Request, Session, StopSwitch, text::shown};
use bottega_farm::{Experience, Forecast, JobReport, JobSettings, RelativePower, benchmark};
use bottega_platform::processor_time::own_seconds;
use serde_json::{Value, json};

use self::timed_engine::TimedEngine;
use crate::{Error, Report, say};

/// What is painted.
#[derive(Clone, Debug)]
pub struct LearningOptions {
    /// Pairs of scenes: of the first is learnt, then the second is painted. None: those of [`PAIRS`] in `scenes`.
    pub pairs: Vec<(PathBuf, PathBuf)>,
    /// Size of the first picture of a pair, and samples a pixel.
    pub first: ([u32; 2], u32),
    /// Those of the second.
    pub second: ([u32; 2], u32),
    /// How far the partition goes: at the last level zones are made to take as long as each other, and ranks tell little.
    pub level: u8,
}

/// Pairs of scenes of one kind, below the folder of scenes.
pub const PAIRS: &[(&str, &str)] = &[
    ("magarro/magarro.pbrt", "magarro/magarro.pbrt"),
    ("magarro/magarro.xml", "volumetric-caustic/mitsuba/scene.xml"),
    ("coffee/pbrt/scene-v4.pbrt", "coffee/pbrt/scene-v4.pbrt"),
    ("gltf/FlightHelmet/FlightHelmet.gltf", "staircase2/pbrt/scene-v4.pbrt"),
    ("staircase2/pbrt/scene-v4.pbrt", "staircase2/pbrt/scene-v4.pbrt"),
    ("cornell-box/pbrt/scene-v4.pbrt", "cornell-box/pbrt/scene-v4.pbrt"),
];

/// Zones of a picture.
const ZONES: u32 = 48;
/// Error of the second job over that of the first which the text calls halved.
const HALF: f64 = 0.5;

/// What a pair of jobs showed.
#[derive(Clone, Debug)]
struct LearningRow {
    first: String,
    second: String,
    /// The first job, by one who has learnt nothing.
    unlearnt_first: Forecast,
    /// The second job, by one who has learnt nothing.
    unlearnt_second: Forecast,
    /// The second job, by one who has painted the first.
    learnt: Forecast,
}

/// What pairs of jobs showed.
#[derive(Clone, Debug)]
pub struct LearningReport {
    rows: Vec<LearningRow>,
}

/// Paints the pairs.
///
/// # Errors
/// A scene cannot be painted, or a picture has too few zones for a comparison.
pub fn measure(options: &LearningOptions, log: &mut dyn Write) -> Result<LearningReport, Error> {
    let clock = || own_seconds().map(Duration::from_secs_f64);
    if clock().is_none() {
        return Err(Error::NoProcessorTime);
    }
    let power = benchmark(|| clock().unwrap_or_default());
    let mut rows = Vec::new();
    for (first, second) in &options.pairs {
        let paint = |scene: &PathBuf, (size, samples): ([u32; 2], u32), experience: &Experience| {
            let mut request = Request::new(scene);
            request.film.size = Some(size);
            request.goal.samples = Some(samples);
            request.devices.threads = Some(1);
            request.devices.names = vec!["cpu".to_owned()];
            request.scene.allow_outside = true;
            request.work.level = options.level;
            request.work.zones = Some(ZONES);
            paint(&request, experience, power)
        };
        say(log, format_args!("{}, then {}", shown(first), shown(second)));
        let nothing = Experience::default();
        let before = paint(first, options.first, &nothing)?;
        let mut experience = nothing.clone();
        before.lessons.values().for_each(|lesson| experience.learn(lesson));
        let unlearnt = paint(second, options.second, &nothing)?;
        let after = paint(second, options.second, &experience)?;
        let forecast = |report: &JobReport| report.forecast.ok_or(Error::TooFewZones { count: report.rows.len() });
        rows.push(LearningRow {
            first: shown(first),
            second: shown(second),
            unlearnt_first: forecast(&before)?,
            unlearnt_second: forecast(&unlearnt)?,
            learnt: forecast(&after)?,
        });
    }
    Ok(LearningReport { rows })
}

fn paint(request: &Request, experience: &Experience, power: RelativePower) -> Result<JobReport, Error> {
    let session = Session::open(request)?;
    let tools = session.tools();
    let experience = Arc::new(experience.clone());
    let settings = JobSettings { experience, benchmark: power, agents: 1, ..tools.settings };
    let engine = Arc::new(TimedEngine::new(tools.engine));
    let report = bottega_farm::run(&settings, engine, tools.observer, &StopSwitch::new(), None, None);
    Ok(report.map_err(bottega::Error::Job)?)
}

impl LearningRow {
    /// Error of the second job over that of the first.
    fn ratio(&self) -> f64 {
        self.learnt.median_error / self.unlearnt_first.median_error
    }
}

impl Report for LearningReport {
    fn as_text(&self) -> String {
        let mut text = String::from(
            "T_est of zones before profiling, against what they took: median error, rank correlation\n\
             first job        second, unlearnt second, learnt   error   pair\n",
        );
        let told = |forecast: &Forecast| {
            let ranks = forecast.rank_correlation.map_or_else(|| "    –".to_owned(), |ranks| format!("{ranks:>5.2}"));
            format!("{:>6.1} % {ranks}", 100.0 * forecast.median_error)
        };
        for row in &self.rows {
            let is_halved = if row.ratio() <= HALF { "halved" } else { "" };
            _ = writeln!(
                text,
                "{} {} {}  × {:.2} {is_halved:<6} {} → {}",
                told(&row.unlearnt_first),
                told(&row.unlearnt_second),
                told(&row.learnt),
                row.ratio(),
                row.first,
                row.second
            );
        }
        text
    }

    fn as_json(&self) -> Value {
        let told = |forecast: &Forecast| {
            json!({ "zones": forecast.zones, "rank_correlation": forecast.rank_correlation,
                "median_error": forecast.median_error, "total_ratio": forecast.total_ratio })
        };
        let row = |row: &LearningRow| {
            json!({ "first": row.first, "second": row.second, "unlearnt_first": told(&row.unlearnt_first),
                "unlearnt_second": told(&row.unlearnt_second), "learnt": told(&row.learnt), "error_ratio": row.ratio() })
        };
        json!({ "pairs": self.rows.iter().map(row).collect::<Vec<_>>() })
    }
}
