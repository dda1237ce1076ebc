//! Comparison of predicted zone times with measured ones.

use std::ops::Range;

use bottega::analysis::{AnalyzedScene, LEVELS};
use bottega_engines::{Painted, RenderEngine, SurveyPixel, ZoneTask};
use bottega_farm::{Choice, Goal, ImportanceFunction, Level, Prediction};
use bottega_image::{Rect, Tile};
use bottega_platform::processor_time::own_seconds;
use serde_json::{Value, json};

use crate::{cli::AnalyzeArgs, error::CliError};

/// A zone, with its predicted and measured times.
pub(super) struct Zone {
    rect: Rect,
    /// The prediction of the map, in average pixels.
    pub(super) complexity: f64,
    /// The shortest time of the even runs, and of the odd ones.
    seconds: [Seconds; 2],
    /// The number of samples after profiling, relative to those of profiling.
    left_over_taken: f64,
}

/// The processor time of a zone, in seconds.
#[derive(Clone, Copy)]
struct Seconds {
    /// Time of the samples that profiling takes.
    profile: f64,
    /// Time of the remaining samples.
    rest: f64,
}

impl Seconds {
    const UNKNOWN: Self = Self { profile: f64::INFINITY, rest: f64::INFINITY };

    fn shorter(self, other: Self) -> Self {
        Self { profile: self.profile.min(other.profile), rest: self.rest.min(other.rest) }
    }
}

impl Zone {
    /// Returns the shortest time of all samples.
    pub(super) fn measured(&self) -> f64 {
        let Seconds { profile, rest } = self.seconds[0].shorter(self.seconds[1]);
        profile + rest
    }

    /// Returns the time of all samples that profiling in the even runs predicts.
    pub(super) fn profiled(&self) -> f64 {
        self.seconds[0].profile * (1.0 + self.left_over_taken)
    }
}

/// The painted zones of one level by one function.
pub(super) struct Verified {
    pub(super) function: ImportanceFunction,
    pub(super) level: u8,
    pub(super) zones: Vec<Zone>,
    /// The survey's results in each zone, per path.
    seen: Vec<SurveyPixel>,
}

impl Verified {
    fn all(&self, value: impl Fn(&Zone) -> f64) -> Vec<f64> {
        self.zones.iter().map(value).collect()
    }

    /// Compares the map's prediction with the time of all samples.
    fn by_map(&self) -> Option<Prediction> {
        Prediction::of(&self.all(|zone| zone.complexity), &self.all(Zone::measured))
    }

    /// Compares profiling in the even runs with the remaining samples in the odd runs, so that prediction and measurement share
    /// no data.
    fn by_profiling(&self) -> Option<Prediction> {
        Prediction::of(&self.all(|zone| zone.seconds[0].profile), &self.all(|zone| zone.seconds[1].rest))
    }

    /// Compares the remaining samples in the even runs with those in the odd runs: the upper bound for any prediction.
    fn repeated(&self) -> Option<Prediction> {
        Prediction::of(&self.all(|zone| zone.seconds[0].rest), &self.all(|zone| zone.seconds[1].rest))
    }

    /// Returns the coefficient of variation of the zones' measured times: standard deviation over mean.
    fn spread(&self) -> f64 {
        let times = self.all(Zone::measured);
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        (times.iter().map(|time| (time - mean).powi(2)).sum::<f64>() / times.len() as f64).sqrt() / mean
    }

    pub(super) fn report(&self) -> Value {
        let prediction_json = |prediction: Option<Prediction>| {
            prediction.map(|p| json!({"rank_correlation": p.rank_correlation, "r_squared": p.r_squared}))
        };
        let zone = |(zone, seen): (&Zone, &SurveyPixel)| {
            json!({
                "rect": [zone.rect.x0, zone.rect.y0, zone.rect.x1, zone.rect.y1],
                "complexity": zone.complexity,
                "profile_seconds": zone.seconds.map(|seconds| seconds.profile),
                "rest_seconds": zone.seconds.map(|seconds| seconds.rest),
                "left_over_taken": zone.left_over_taken,
                "per_path": {
                    "steps": seen.steps,
                    "vertices": seen.path_length,
                    "shadow_rays": seen.shadow_rays,
                    "layered": seen.layered,
                    "lookups": seen.lookups,
                    "recursion_levels": seen.recursion_levels,
                },
            })
        };
        json!({
            "importance": self.function.to_string(),
            "level": self.level,
            "by_map": prediction_json(self.by_map()),
            "after_profiling": prediction_json(self.by_profiling()),
            "measured_again": prediction_json(self.repeated()),
            "spread": self.spread(),
            "zones": self.zones.iter().zip(&self.seen).map(zone).collect::<Vec<_>>(),
        })
    }
}

/// Verifies the requested function, and the paper's for comparison, on the requested levels.
pub(super) fn run(
    args: &AnalyzeArgs,
    subject: &AnalyzedScene,
    function: ImportanceFunction,
) -> Result<Vec<Verified>, CliError> {
    // Paint once first, so that the preparation of the scene is not attributed to a zone.
    let corner = subject.frame().blocks(16).next().unwrap_or_default();
    paint(subject, corner, 0..1, None)?;
    let mut verified = Vec::new();
    let beside = (function != ImportanceFunction::Paper).then_some(ImportanceFunction::Paper);
    for function in [function].into_iter().chain(beside) {
        for (level, number) in LEVELS.into_iter().zip(1..).filter(|(_, number)| args.verify.contains(number)) {
            if !args.scene.json {
                eprintln!("measuring {function}, level {number}");
            }
            verified.push(measure(args, subject, function, (level, number))?);
        }
    }
    Ok(verified)
}

fn measure(
    args: &AnalyzeArgs,
    subject: &AnalyzedScene,
    function: ImportanceFunction,
    (level, number): (Level, u8),
) -> Result<Verified, CliError> {
    let analysis = subject.analyze(function, level)?;
    let samples = subject.settings.samples;
    let profile = Choice::unchanged(&subject.settings).profile_samples(&Goal::Samples).min(samples - 1);
    let mut zones: Vec<Zone> = analysis
        .rows
        .iter()
        .map(|row| Zone {
            rect: row.rect,
            complexity: row.complexity,
            seconds: [Seconds::UNKNOWN; 2],
            left_over_taken: f64::from(samples - profile) / f64::from(profile),
        })
        .collect();
    for turn in 0..usize::from(args.repeat) {
        for zone in &mut zones {
            let (tile, profile_seconds) = paint(subject, zone.rect, 0..profile, None)?;
            let (_, rest) = paint(subject, zone.rect, profile..samples, Some(tile))?;
            let seconds = &mut zone.seconds[turn % 2];
            *seconds = seconds.shorter(Seconds { profile: profile_seconds, rest });
        }
    }
    let seen = zones.iter().map(|zone| seen_in(subject, zone.rect)).collect();
    Ok(Verified { function, level: number, zones, seen })
}

/// Paints some samples of a rectangle, with the engine to itself. Returns the processor time in seconds.
fn paint(
    subject: &AnalyzedScene,
    rect: Rect,
    samples: Range<u32>,
    tile: Option<Tile>,
) -> Result<(Tile, f64), CliError> {
    let task = ZoneTask { tile, ..ZoneTask::new(rect, samples, subject.settings.tunables) };
    let before = own_seconds();
    let Painted { tile, busy, .. } = subject.engine.paint(task)?;
    let spent = before.zip(own_seconds()).map(|(before, after)| after - before);
    Ok((tile, spent.unwrap_or(busy.as_secs_f64())))
}

/// Returns the means over the survey's cells whose centers lie in a zone.
fn seen_in(subject: &AnalyzedScene, rect: Rect) -> SurveyPixel {
    let survey = &subject.survey;
    let frame = subject.frame();
    let (mut sum, mut count) = (SurveyPixel::default(), 0.0_f32);
    for (i, pixel) in survey.pixels.iter().enumerate() {
        let (column, row) = (i as u64 % u64::from(survey.width), i as u64 / u64::from(survey.width));
        let center =
            |cell: u64, cells: u32, pixels: u32| ((2 * cell + 1) * u64::from(pixels) / (2 * u64::from(cells))) as u32;
        let (x, y) = (center(column, survey.width, frame.width()), center(row, survey.height, frame.height()));
        if rect.contains(x, y) {
            sum.steps += pixel.steps;
            sum.path_length += pixel.path_length;
            sum.shadow_rays += pixel.shadow_rays;
            sum.layered += pixel.layered;
            sum.lookups += pixel.lookups;
            sum.recursion_levels += pixel.recursion_levels;
            count += 1.0;
        }
    }
    let mean = |sum: f32| sum / count.max(1.0);
    SurveyPixel {
        steps: mean(sum.steps),
        path_length: mean(sum.path_length),
        shadow_rays: mean(sum.shadow_rays),
        layered: mean(sum.layered),
        lookups: mean(sum.lookups),
        recursion_levels: mean(sum.recursion_levels),
        ..sum
    }
}

/// Formats the results as a table.
pub(super) fn table(verified: &[Verified]) -> String {
    let mut text = "rank correlation (and share of variance explained) of predicted and measured time of zones\n\n\
                    importance  level  zones  spread  by the map       after profiling  measured again\n"
        .to_owned();
    let prediction_text = |prediction: Option<Prediction>| match prediction {
        Some(p) => format!("{:.3} ({:.3})", p.rank_correlation, p.r_squared),
        None => "–".to_owned(),
    };
    for row in verified {
        text += &format!(
            "{:<10}  {:>5}  {:>5}  {:>5.0}%  {:<15}  {:<15}  {}\n",
            row.function.to_string(),
            row.level,
            row.zones.len(),
            100.0 * row.spread(),
            prediction_text(row.by_map()),
            prediction_text(row.by_profiling()),
            prediction_text(row.repeated()),
        );
    }
    text + "\nspread: of the measured times, standard deviation over mean. Zones of nearly equal time have no ranks to predict."
}
