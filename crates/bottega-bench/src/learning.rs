//! The accuracy of zone time forecasts before anything is measured, in a first job and in a second, similar one.

mod timed_engine;

use std::{
    fmt::Write as _,
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bottega::{Request, Session, StopSwitch, text::shown};
use bottega_farm::{BenchmarkClocks, Experience, Forecast, JobReport, JobSettings, MachineSpeed, RelativePower};
use bottega_platform::processor_time::own_seconds;
use clap::Args;
use serde_json::{Value, json};

use self::timed_engine::TimedEngine;
use crate::{
    arguments::SceneFolder,
    error::Error,
    report::{Measurement, Report, say},
};

/// Pairs of similar scenes, relative to the folder of scenes.
const PAIRS: [(&str, &str); 6] = [
    ("magarro/magarro.pbrt", "magarro/magarro.pbrt"),
    ("magarro/magarro.xml", "volumetric-caustic/mitsuba/scene.xml"),
    ("coffee/pbrt/scene-v4.pbrt", "coffee/pbrt/scene-v4.pbrt"),
    ("gltf/FlightHelmet/FlightHelmet.gltf", "staircase2/pbrt/scene-v4.pbrt"),
    ("staircase2/pbrt/scene-v4.pbrt", "staircase2/pbrt/scene-v4.pbrt"),
    ("cornell-box/pbrt/scene-v4.pbrt", "cornell-box/pbrt/scene-v4.pbrt"),
];

/// The image sizes of a pair's first and second job.
const SIZES: [[u32; 2]; 2] = [[240, 180], [400, 300]];
/// The number of zones per image.
const ZONES: u32 = 48;
/// The ratio of errors, second job over first, that the text calls halved.
const HALF: f64 = 0.5;

/// How well the time of a zone is known before anybody has seen it: in a first job, and in a second of its kind.
#[derive(Clone, Debug, Args)]
#[command(after_help = "What this machine has learnt before is neither used nor changed. For example:\n  \
    bottega-bench learning goblets.glb goblets.glb magarro.pbrt goblets.glb")]
pub(crate) struct LearningOptions {
    /// Pairs of scenes: of the first is learnt, then the second is painted. Default: some in the folder of scenes.
    pairs: Vec<PathBuf>,
    #[command(flatten)]
    folder: SceneFolder,
    /// Samples per pixel of the first pictures, of 240 × 180 pixels. Those of the second ones are half as many, of 400 × 300 pixels.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(4..=1 << 16))]
    spp: u32,
    /// How far the partition goes. At level 3 zones are made to take as long as each other, and ranks tell little.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    level: u8,
}

/// The results of a pair of jobs.
#[derive(Clone, Debug)]
struct LearningRow {
    first: String,
    second: String,
    /// The forecast of the first job, without experience.
    unlearnt_first: Forecast,
    /// The forecast of the second job, without experience.
    unlearnt_second: Forecast,
    /// The forecast of the second job, with experience from the first.
    learnt: Forecast,
}

/// The results of all pairs.
#[derive(Clone, Debug)]
struct LearningReport {
    rows: Vec<LearningRow>,
}

impl Measurement for LearningOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let clock = || own_seconds().map(Duration::from_secs_f64);
        if clock().is_none() {
            return Err(Error::NoProcessorTime);
        }
        let clocks = BenchmarkClocks { now: || clock().unwrap_or_default(), processor: clock };
        let power = clocks.benchmark().power;
        let mut rows = Vec::new();
        for (first, second) in &self.pairs()? {
            say(log, format_args!("{}, then {}", shown(first), shown(second)));
            let requests = [self.request(first, SIZES[0], self.spp), self.request(second, SIZES[1], self.spp / 2)];
            rows.push(LearningRow::paint(&requests, power)?);
        }
        Ok(Box::new(LearningReport { rows }))
    }
}

impl LearningOptions {
    /// Returns the requested pairs, or else the default ones in the folder of scenes.
    fn pairs(&self) -> Result<Vec<(PathBuf, PathBuf)>, Error> {
        let (named, rest) = self.pairs.as_chunks::<2>();
        if !rest.is_empty() {
            return Err(Error::NoPair);
        }
        if !named.is_empty() {
            return Ok(named.iter().cloned().map(|[first, second]| (first, second)).collect());
        }
        let in_folder = |(first, second): &(&str, &str)| -> Result<_, Error> {
            Ok((self.folder.scene(None, first)?, self.folder.scene(None, second)?))
        };
        PAIRS.iter().map(in_folder).collect()
    }

    fn request(&self, scene: &Path, size: [u32; 2], samples: u32) -> Request {
        let mut request = Request::new(scene);
        request.film.size = Some(size);
        request.goal.samples = Some(samples);
        request.devices.threads = Some(1);
        request.devices.names = vec!["cpu".to_owned()];
        request.scene.allow_outside = true;
        request.work.level = self.level;
        request.work.zones = Some(ZONES);
        request
    }
}

fn paint(request: &Request, experience: &Experience, power: RelativePower) -> Result<JobReport, Error> {
    let session = Session::open(request)?;
    let tools = session.tools();
    let experience = Arc::new(experience.clone());
    let settings =
        JobSettings { experience, benchmark: MachineSpeed { power, load: 1.0 }, agents: 1, ..tools.settings };
    let engine = Arc::new(TimedEngine::new(tools.engine));
    let report = bottega_farm::run(&settings, engine, tools.observer, &StopSwitch::new(), None, None);
    Ok(report.map_err(bottega::Error::Job)?)
}

impl LearningRow {
    /// Renders the first image, and the second with and without the experience of the first.
    fn paint([first, second]: &[Request; 2], power: RelativePower) -> Result<Self, Error> {
        let nothing = Experience::default();
        let before = paint(first, &nothing, power)?;
        let mut experience = nothing.clone();
        before.lessons.values().for_each(|lesson| experience.learn(lesson));
        let unlearnt = paint(second, &nothing, power)?;
        let after = paint(second, &experience, power)?;
        let forecast = |report: &JobReport| report.forecast.ok_or(Error::TooFewZones { count: report.rows.len() });
        Ok(Self {
            first: shown(&first.scene.file),
            second: shown(&second.scene.file),
            unlearnt_first: forecast(&before)?,
            unlearnt_second: forecast(&unlearnt)?,
            learnt: forecast(&after)?,
        })
    }

    /// Returns the error of the second job over that of the first.
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
