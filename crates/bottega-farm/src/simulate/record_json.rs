//! Records as JSON, version 2. Times are in seconds, rectangles `[x0, y0, x1, y1]`, x1 and y1 one past the last pixel.

use std::time::Duration;

use bottega_engines::Tunables;
use bottega_image::{Rect, Sides};
use serde::{Deserialize, Serialize};

use super::record::{CostGrid, Record, RecordError, RecordedRules, RecordedZone, VERSION};
use crate::{BandWidth, Choice, Goal, Level, NeighborDifference, Optimization, WorkSettings};

/// The name of the format, which distinguishes records from other JSON.
const FORMAT: &str = "bottega record";

/// The fields of every version.
#[derive(Deserialize)]
struct HeadJson {
    format: String,
    version: u64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RecordJson {
    format: String,
    version: u64,
    scene: String,
    engine: String,
    rules: Vec<String>,
    /// `rules`: as the rules choose; else a width in pixels.
    bands: BandsJson,
    has_max_depth: bool,
    has_light_samples: bool,
    is_profiled: bool,
    width: u32,
    height: u32,
    frame: [u32; 4],
    samples: u32,
    max_depth: u32,
    light_samples: u32,
    optimize: String,
    level: u8,
    agents: usize,
    processors: usize,
    relative_power: f64,
    total_seconds: f64,
    survey_seconds: f64,
    preparation_seconds: f64,
    #[serde(default)]
    shared_preparation_seconds: f64,
    #[serde(default)]
    shared_stages: u32,
    composition_seconds: f64,
    zones: Vec<ZoneJson>,
    /// Nanoseconds per sample and pixel, for each cell of 16 × 16 pixels, row by row.
    cost_nanoseconds: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum BandsJson {
    Pixels(u32),
    Word(BandsWord),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BandsWord {
    Off,
    Rules,
}

impl From<BandWidth> for BandsJson {
    fn from(bands: BandWidth) -> Self {
        match bands {
            BandWidth::Off => Self::Word(BandsWord::Off),
            BandWidth::Rules => Self::Word(BandsWord::Rules),
            BandWidth::Pixels(pixels) => Self::Pixels(pixels),
        }
    }
}

impl From<BandsJson> for BandWidth {
    fn from(bands: BandsJson) -> Self {
        match bands {
            BandsJson::Word(BandsWord::Off) => Self::Off,
            BandsJson::Word(BandsWord::Rules) => Self::Rules,
            BandsJson::Pixels(pixels) => Self::Pixels(pixels),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZoneJson {
    rect: [u32; 4],
    complexity: f64,
    neighbor_difference: f64,
    edge_differences: [f64; 4],
    samples: u32,
    max_depth: u32,
    light_samples: u32,
    bands: [u32; 4],
    profiling_seconds: f64,
    painting_seconds: f64,
}

impl Record {
    /// Returns the record as JSON, which [`Record::from_json`] reads.
    pub fn to_json(&self) -> String {
        let WorkSettings { picture, frame, samples, goal: _, tunables, optimization } = self.work;
        let json = RecordJson {
            format: FORMAT.to_owned(),
            version: VERSION,
            scene: self.scene.clone(),
            engine: self.engine.clone(),
            rules: self.rules.texts.clone(),
            bands: self.rules.bands.into(),
            has_max_depth: self.rules.has_max_depth,
            has_light_samples: self.rules.has_light_samples,
            is_profiled: self.rules.is_profiled,
            width: picture.width(),
            height: picture.height(),
            frame: corners(&frame),
            samples,
            max_depth: tunables.max_depth,
            light_samples: tunables.light_samples,
            optimize: optimization.to_string(),
            level: self.level as u8,
            agents: self.agents,
            processors: self.processors,
            relative_power: self.relative_power,
            total_seconds: self.total.as_secs_f64(),
            survey_seconds: self.survey.as_secs_f64(),
            preparation_seconds: self.preparation.as_secs_f64(),
            shared_preparation_seconds: self.shared_preparation.as_secs_f64(),
            shared_stages: self.shared_stages,
            composition_seconds: self.composition.as_secs_f64(),
            zones: self.zones.iter().map(zone_json).collect(),
            cost_nanoseconds: self.costs.density.iter().map(|seconds| (seconds * 1e9 * 1e3).round() / 1e3).collect(),
        };
        serde_json::to_string_pretty(&json).unwrap_or_default()
    }

    /// Reads and checks the JSON of [`Record::to_json`].
    ///
    /// # Errors
    /// The text is not JSON of this format, has another version, or holds an invalid value: see [`Record::check`].
    pub fn from_json(text: &str) -> Result<Self, RecordError> {
        let syntax = |error: serde_json::Error| RecordError::Syntax {
            line: error.line(),
            column: error.column(),
            problem: error.to_string(),
        };
        let head: HeadJson = serde_json::from_str(text).map_err(syntax)?;
        if head.format != FORMAT {
            let problem = format!("must be `{FORMAT}`, as --record writes it");
            return Err(RecordError::Value { field: "format".to_owned(), problem });
        }
        if head.version != VERSION {
            return Err(RecordError::Version { found: head.version });
        }
        let json: RecordJson = serde_json::from_str(text).map_err(syntax)?;
        let record = record(json)?;
        record.check()?;
        Ok(record)
    }
}

fn record(json: RecordJson) -> Result<Record, RecordError> {
    let value = |field: &str, problem: String| RecordError::Value { field: field.to_owned(), problem };
    let optimization: Optimization =
        json.optimize.parse().map_err(|error| value("optimize", format!("is unknown: {error}")))?;
    let level = Level::ALL.get(usize::from(json.level)).copied();
    let level = level.ok_or_else(|| value("level", "must be from 0 to 3".to_owned()))?;
    let frame = rect(json.frame).ok_or_else(|| value("frame", "must have x0 < x1 and y0 < y1".to_owned()))?;
    let zones = json.zones.iter().enumerate().map(|(index, zone)| recorded_zone(index, zone));
    let (columns, _) = CostGrid::size(&frame);
    Ok(Record {
        scene: json.scene,
        engine: json.engine,
        rules: RecordedRules {
            texts: json.rules,
            bands: json.bands.into(),
            has_max_depth: json.has_max_depth,
            has_light_samples: json.has_light_samples,
            is_profiled: json.is_profiled,
        },
        work: WorkSettings {
            picture: Rect::of_size(json.width, json.height),
            frame,
            samples: json.samples,
            goal: Goal::Samples,
            tunables: Tunables { max_depth: json.max_depth, light_samples: json.light_samples },
            optimization,
        },
        level,
        agents: json.agents,
        processors: json.processors,
        relative_power: json.relative_power,
        zones: zones.collect::<Result<_, _>>()?,
        costs: CostGrid {
            origin: (frame.x0 / super::record::CELL_SIDE, frame.y0 / super::record::CELL_SIDE),
            columns,
            density: json.cost_nanoseconds.iter().map(|nanoseconds| nanoseconds * 1e-9).collect(),
        },
        total: time("total_seconds", json.total_seconds)?,
        survey: time("survey_seconds", json.survey_seconds)?,
        preparation: time("preparation_seconds", json.preparation_seconds)?,
        shared_preparation: time("shared_preparation_seconds", json.shared_preparation_seconds)?,
        shared_stages: json.shared_stages,
        composition: time("composition_seconds", json.composition_seconds)?,
    })
}

fn zone_json(zone: &RecordedZone) -> ZoneJson {
    let Choice { tunables, samples, bands } = zone.choice;
    ZoneJson {
        rect: corners(&zone.rect),
        complexity: zone.complexity,
        neighbor_difference: zone.neighbor_difference.mean,
        edge_differences: zone.neighbor_difference.sides.into_array(),
        samples,
        max_depth: tunables.max_depth,
        light_samples: tunables.light_samples,
        bands: bands.into_array(),
        profiling_seconds: zone.profiling.as_secs_f64(),
        painting_seconds: zone.painting.as_secs_f64(),
    }
}

fn recorded_zone(index: usize, json: &ZoneJson) -> Result<RecordedZone, RecordError> {
    let field = |name: &str| format!("zones[{index}].{name}");
    let wrong = || RecordError::Value { field: field("rect"), problem: "must have x0 < x1 and y0 < y1".to_owned() };
    let tunables = Tunables { max_depth: json.max_depth, light_samples: json.light_samples };
    Ok(RecordedZone {
        rect: rect(json.rect).ok_or_else(wrong)?,
        complexity: json.complexity,
        neighbor_difference: NeighborDifference { mean: json.neighbor_difference, sides: sides(json.edge_differences) },
        choice: Choice { tunables, samples: json.samples, bands: sides(json.bands) },
        profiling: time(&field("profiling_seconds"), json.profiling_seconds)?,
        painting: time(&field("painting_seconds"), json.painting_seconds)?,
    })
}

fn sides<T>([left, top, right, bottom]: [T; 4]) -> Sides<T> {
    Sides { left, top, right, bottom }
}

fn corners(rect: &Rect) -> [u32; 4] {
    [rect.x0, rect.y0, rect.x1, rect.y1]
}

fn rect([x0, y0, x1, y1]: [u32; 4]) -> Option<Rect> {
    // Bound coordinates, so that sums do not overflow
    (x0 < x1 && y0 < y1 && x1.max(y1) <= 1 << 24).then(|| Rect::new(x0, y0, x1, y1))
}

fn time(field: &str, seconds: f64) -> Result<Duration, RecordError> {
    let wrong =
        || RecordError::Value { field: field.to_owned(), problem: "must be a time from 0 to 10⁹ seconds".to_owned() };
    Some(seconds).filter(|seconds| (0.0..=1e9).contains(seconds)).map(Duration::from_secs_f64).ok_or_else(wrong)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns two zones side by side; the right one is twice as expensive.
    pub(crate) fn example() -> Record {
        let frame = Rect::of_size(64, 32);
        let tunables = Tunables { max_depth: 8, light_samples: 1 };
        let work = WorkSettings {
            picture: frame,
            frame,
            samples: 40,
            goal: Goal::Samples,
            tunables,
            optimization: Optimization::Off,
        };
        let zone = |rect: Rect, seconds: f64| RecordedZone {
            rect,
            complexity: rect.area() as f64 * seconds,
            neighbor_difference: NeighborDifference::all(0.5),
            choice: Choice::unchanged(&work),
            profiling: Duration::from_secs_f64(seconds * 0.06),
            painting: Duration::from_secs_f64(seconds * 0.94),
        };
        let zones = vec![zone(Rect::new(0, 0, 32, 32), 1.0), zone(Rect::new(32, 0, 64, 32), 2.0)];
        let parts = zones.iter().map(|zone| (zone.rect, 40, zone.total().as_secs_f64()));
        let costs = CostGrid::of_parts(&frame, parts.collect::<Vec<_>>());
        Record {
            scene: "example.glb".to_owned(),
            engine: "builtin".to_owned(),
            rules: RecordedRules {
                texts: vec![crate::Expert::path_tracing().rules_text()],
                bands: BandWidth::default(),
                has_max_depth: true,
                has_light_samples: true,
                is_profiled: true,
            },
            work,
            level: Level::Balanced,
            agents: 1,
            processors: 2,
            relative_power: 0.8,
            zones,
            costs,
            total: Duration::from_secs_f64(1.75),
            survey: Duration::from_millis(200),
            preparation: Duration::from_millis(100),
            shared_preparation: Duration::from_millis(40),
            shared_stages: 1,
            composition: Duration::from_millis(2),
        }
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let record = example();
        let read = Record::from_json(&record.to_json()).unwrap();
        // Costs are rounded to a thousandth of a nanosecond.
        assert_eq!(read.to_json(), record.to_json());
        assert_eq!((read.zones, read.work, read.rules), (record.zones, record.work, record.rules));
    }

    #[test]
    fn what_no_run_can_have_written_is_refused_by_name() {
        let text = example().to_json();
        let check = |from: &str, to: &str, names: &str| {
            assert!(text.contains(from), "{from} is in the text");
            let error = Record::from_json(&text.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(names), "{from} to {to}: {error}");
        };
        check("\"version\": 2", "\"version\": 7", "version 7");
        check("FUNCTION_BLOCK", "FUNCTION", "rules[0]");
        check("\"bands\": \"rules\"", "\"bands\": \"some\"", "line");
        check("bottega record", "a record", "format");
        check("\"samples\": 40", "\"samples\": 0", "samples");
        check("\"optimize\": \"off\"", "\"optimize\": \"loud\"", "loud");
        check("\"level\": 3", "\"level\": 9", "level");
        check("\"complexity\"", "\"complication\"", "line");
        check("\"profiling_seconds\": 0.06", "\"profiling_seconds\": -1", "zones[0].profiling_seconds");
        check("      32,", "      33,", "cover the frame");
        check("\"agents\": 1", "\"agents\": 0", "agents");
        check("\"cost_nanoseconds\": [", "\"cost_nanoseconds\": [ 1.0,", "costs");
        assert!(matches!(Record::from_json("{"), Err(RecordError::Syntax { line: 1, .. })));
        assert!(Record::from_json("[]").is_err() && Record::from_json("").is_err());
    }

    #[test]
    fn costs_are_the_measured_ones_for_any_range() {
        let record = example();
        let [left, right] = [&record.zones[0], &record.zones[1]];
        assert!((left.seconds(0, 2) - 0.06).abs() < 1e-9, "profiling took 2 of 40 samples");
        assert!((right.seconds(2, 40) - 1.88).abs() < 1e-9);
        assert!((right.seconds(0, 40) - 2.0).abs() < 1e-9);
        let whole = record.costs.seconds(&Rect::of_size(64, 32)) * 40.0;
        assert!((whole - 3.0).abs() < 1e-6, "{whole}");
        let across = record.costs.seconds(&Rect::new(16, 8, 48, 24)) * 40.0;
        assert!((across - (0.25 + 0.5)).abs() < 1e-6, "{across}");
    }
}
