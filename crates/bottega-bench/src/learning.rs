//! The accuracy of zone time forecasts before anything is measured, in a first job and in a second, similar one; and how much
//! sooner the second job ends on unequal machines.

mod second_makespan;
mod timed_engine;

use std::{
    fmt::Write as _,
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega::{Request, Session, StopSwitch, text::shown};
use bottega_farm::{
    Experience, Forecast, Foreknowledge, JobLesson, JobReport, JobSettings, MachineSpeed, RelativePower, ZoneForecast,
    simulate::{Record, Recorder},
};
use bottega_platform::processor_time::own_seconds;
use clap::Args;
use serde_json::{Value, json};

use self::{
    second_makespan::{CASES, SPEEDS, ratios},
    timed_engine::TimedEngine,
};
use crate::{
    arguments::SceneFolder,
    error::Error,
    report::{Measurement, Report, say},
};

/// Scenes of the pairs, relative to the folder of scenes. Each is painted twice, on two machines.
const SCENES: [&str; 6] = [
    "magarro/magarro.pbrt",
    "volumetric-caustic/mitsuba/scene.xml",
    "coffee/pbrt/scene-v4.pbrt",
    "gltf/FlightHelmet/FlightHelmet.gltf",
    "staircase2/pbrt/scene-v4.pbrt",
    "cornell-box/pbrt/scene-v4.pbrt",
];

/// V_cp of the two machines by their benchmark. Zones take both the time of the reference machine: the benchmark is right about
/// the first and misjudges the second by a factor of two.
const POWERS: [f64; 2] = [1.0, 2.0];
/// The image sizes of a pair's first and second job.
const SIZES: [[u32; 2]; 2] = [[240, 180], [400, 300]];
/// The number of zones per image.
const ZONES: u32 = 48;
/// The ratio of errors, second job over first, that the text calls halved.
const HALF: f64 = 0.5;

/// The error of predicted zone times before profiling: in a first job, and in a second of its kind.
#[derive(Clone, Debug, Args)]
#[command(after_help = "What this machine has learnt before is neither used nor changed. For example:\n  \
    bottega-bench learning goblets.glb goblets.glb magarro.pbrt goblets.glb")]
pub(crate) struct LearningOptions {
    /// Pairs of scenes: the first teaches, then the second is painted. Default: some of the folder of scenes, each twice.
    pairs: Vec<PathBuf>,
    #[command(flatten)]
    folder: SceneFolder,
    /// Samples per pixel of the first pictures, of 240 × 180 pixels. Those of the second ones are half as many, of 400 × 300 pixels.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(4..=1 << 16))]
    spp: u32,
    /// The level of the partition. At level 3 all zones have the same expected time, so ranks say little.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    level: u8,
}

/// The results of a pair of jobs on one machine.
#[derive(Clone, Debug)]
struct LearningRow {
    first: String,
    second: String,
    /// V_cp of the machine by its benchmark.
    power: f64,
    /// The forecast of the first job, without experience.
    unlearnt_first: Forecast,
    /// The forecast of the second job, without experience.
    unlearnt_second: Forecast,
    /// The forecast of the second job, with experience from the first.
    learnt: Forecast,
    /// Number of the second job's zones that need no profile.
    trusted: usize,
    /// Makespan of the second job with experience over that without, for each of [`CASES`].
    makespans: [f64; CASES.len()],
}

/// The results of all pairs.
#[derive(Clone, Debug)]
struct LearningReport {
    rows: Vec<LearningRow>,
}

/// A finished job with its costs.
struct PaintedJob {
    report: JobReport,
    lesson: JobLesson,
    record: Record,
}

impl Measurement for LearningOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        if own_seconds().is_none() {
            return Err(Error::NoProcessorTime);
        }
        let mut rows = Vec::new();
        for (first, second) in &self.pairs()? {
            for (seed, power) in (1..).zip(POWERS) {
                say(log, format_args!("{}, then {}, V_cp {power}", shown(first), shown(second)));
                let requests =
                    [self.request(first, SIZES[0], self.spp, seed), self.request(second, SIZES[1], self.spp / 2, seed)];
                rows.push(LearningRow::paint(&requests, power)?);
            }
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
        let in_folder = |scene: &&str| -> Result<_, Error> {
            let scene = self.folder.scene(None, scene)?;
            Ok((scene.clone(), scene))
        };
        SCENES.iter().map(in_folder).collect()
    }

    fn request(&self, scene: &Path, size: [u32; 2], samples: u32, seed: u64) -> Request {
        let mut request = Request::new(scene);
        request.film.size = Some(size);
        request.goal.samples = Some(samples);
        request.devices.threads = Some(1);
        request.devices.names = vec!["cpu".to_owned()];
        request.scene.allow_outside = true;
        request.work.level = self.level;
        request.work.zones = Some(ZONES);
        request.seed = seed;
        request
    }
}

impl PaintedJob {
    /// Paints a picture without experience.
    fn paint(request: &Request, power: RelativePower) -> Result<Self, Error> {
        let session = Session::open(request)?;
        let setup = session.setup();
        let benchmark = MachineSpeed { power, load: 1.0 };
        let settings = JobSettings { experience: Arc::default(), benchmark, agents: 1, ..setup.settings };
        let recorder = Arc::new(Recorder::new(Arc::new(TimedEngine::new(setup.engine)), setup.observer));
        let report = bottega_farm::run(
            &settings,
            Arc::clone(&recorder) as _,
            Arc::clone(&recorder) as _,
            &StopSwitch::new(),
            None,
            None,
        );
        let report = report.map_err(bottega::Error::Job)?;
        let record = recorder.record(&shown(&request.scene.file), &settings, &report).map_err(Error::Record)?;
        // The machines of the replay are as fast as their benchmarks say
        let record = Record { relative_power: 1.0, ..record };
        let lesson = report.lessons.values().next().ok_or(Error::TooFewZones { count: report.rows.len() })?.clone();
        Ok(Self { report, lesson, record })
    }

    fn forecast(&self) -> Result<Forecast, Error> {
        self.report.forecast.ok_or(Error::TooFewZones { count: self.report.rows.len() })
    }

    /// Returns the times of all zones that an experience predicts, by id.
    fn forecasts(&self, experience: Experience, benchmark: RelativePower) -> Arc<[ZoneForecast]> {
        let JobLesson { technique, subject, features, outlook, .. } = &self.lesson;
        let known = Foreknowledge {
            experience: Arc::new(experience),
            technique: Arc::clone(technique),
            subject: subject.clone(),
            benchmark,
            ..Foreknowledge::default()
        };
        let samples = self.record.work.samples;
        outlook.zones.iter().map(|zone| known.forecast(features, outlook, zone, samples)).collect()
    }
}

impl LearningRow {
    /// Renders both images, and predicts the second one with and without the experience of the first.
    fn paint([first, second]: &[Request; 2], power: f64) -> Result<Self, Error> {
        let benchmark = RelativePower::new(power);
        let (before, after) = (PaintedJob::paint(first, benchmark)?, PaintedJob::paint(second, benchmark)?);
        let mut experience = Experience::default();
        experience.learn(&before.lesson, None);
        let forecasts = after.forecasts(experience, benchmark);
        // Compare the predictions with the measured times
        let zones = &after.lesson.outlook.zones;
        let place = |rect| zones.iter().position(|zone| zone.rect == rect);
        let pairs: Vec<(f64, f64)> = after
            .lesson
            .zones
            .iter()
            .filter_map(|zone| {
                let expected = forecasts.get(place(zone.outlook.rect)?)?.time;
                Some((expected.as_secs_f64(), benchmark.to_reference(zone.time).as_secs_f64()))
            })
            .collect();
        // The replay's machines are known by their speed: T_est is in the time of the machine that painted
        let of_replay: Arc<[ZoneForecast]> =
            forecasts.iter().map(|it| ZoneForecast { time: benchmark.to_own(it.time), ..*it }).collect();
        Ok(Self {
            first: shown(&first.scene.file),
            second: shown(&second.scene.file),
            power,
            unlearnt_first: before.forecast()?,
            unlearnt_second: after.forecast()?,
            learnt: Forecast::of(&pairs).ok_or(Error::TooFewZones { count: pairs.len() })?,
            trusted: forecasts.iter().filter(|forecast| forecast.is_trusted()).count(),
            makespans: ratios(&before.record, &after.record, &of_replay)?,
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
            "T_est of zones before profiling, against what they took: median error, rank correlation; zones without a profile\n\
             first job        second, unlearnt second, learnt   error          trusted V_cp  pair\n",
        );
        let forecast_text = |forecast: &Forecast| {
            let ranks = forecast.rank_correlation.map_or_else(|| "    –".to_owned(), |ranks| format!("{ranks:>5.2}"));
            format!("{:>6.1} % {ranks}", 100.0 * forecast.median_error)
        };
        for row in &self.rows {
            let is_halved = if row.ratio() <= HALF { "halved" } else { "" };
            _ = writeln!(
                text,
                "{} {} {}  × {:.2} {is_halved:<6} {:>3} of {:<3} {:<4} {} → {}",
                forecast_text(&row.unlearnt_first),
                forecast_text(&row.unlearnt_second),
                forecast_text(&row.learnt),
                row.ratio(),
                row.trusted,
                row.learnt.zones,
                row.power,
                row.first,
                row.second
            );
        }
        let halved = self.rows.iter().filter(|row| row.ratio() <= HALF).count();
        let [mean, median] = mean_and_median(self.rows.iter().map(LearningRow::ratio).collect());
        _ = writeln!(text, "halved in {halved} of {}; mean × {mean:.2}, median × {median:.2}\n", self.rows.len());
        _ = writeln!(
            text,
            "makespan of the second job on machines of speed {SPEEDS:?}, learnt over unlearnt, replayed"
        );
        for (place, case) in CASES.iter().enumerate() {
            let all: Vec<f64> = self.rows.iter().map(|row| row.makespans[place]).collect();
            let each = all.iter().map(|ratio| format!("{ratio:.3}")).collect::<Vec<_>>().join(" ");
            let [mean, median] = mean_and_median(all);
            _ = writeln!(
                text,
                "messages {} ms, benchmark off by up to {:.0} %: mean {mean:.3}, median {median:.3} ({each})",
                case.latency_ms,
                100.0 * case.benchmark_error
            );
        }
        text
    }

    fn as_json(&self) -> Value {
        let forecast_json = |forecast: &Forecast| {
            json!({ "zones": forecast.zones, "rank_correlation": forecast.rank_correlation,
                "median_error": forecast.median_error, "total_ratio": forecast.total_ratio })
        };
        let row = |row: &LearningRow| {
            json!({ "first": row.first, "second": row.second, "power": row.power, "trusted": row.trusted,
                "makespan_ratios": row.makespans, "unlearnt_first": forecast_json(&row.unlearnt_first),
                "unlearnt_second": forecast_json(&row.unlearnt_second), "learnt": forecast_json(&row.learnt), "error_ratio": row.ratio() })
        };
        json!({ "pairs": self.rows.iter().map(row).collect::<Vec<_>>() })
    }
}

/// Returns the mean and the median; panics without values.
fn mean_and_median(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    let median = if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) };
    [values.iter().sum::<f64>() / values.len() as f64, median]
}
