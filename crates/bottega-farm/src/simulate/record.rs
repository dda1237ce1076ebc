//! The record of a real run: zones, what each cost, and where within it.

use std::time::Duration;

use bottega_image::Rect;

use bottega_engines::EngineDescription;

use crate::{BandWidth, Choice, Expert, Goal, Level, NeighborDifference, Partition, WorkSettings};

/// Side of the cells of a [`CostGrid`], in pixels: that of the built-in engine's work units, which begin at multiples of
/// it too.
pub const CELL_SIDE: u32 = 16;

/// A run, as far as it is needed to run it again in virtual time.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The scene file, for people.
    pub scene: String,
    /// Name of the engine.
    pub engine: String,
    /// The rules of the agents, which had them in turn.
    pub rules: RecordedRules,
    /// What the user asked for.
    pub work: WorkSettings,
    /// How far the partition went.
    pub level: Level,
    /// How many agents there were. They shared one machine.
    pub agents: usize,
    /// Processors of that machine.
    pub processors: usize,
    /// V_cp of that machine.
    pub relative_power: f64,
    /// The zones, in the order of a [`Partition`].
    pub zones: Vec<RecordedZone>,
    /// What painting cost where.
    pub costs: CostGrid,
    /// Wall time from beginning to end.
    pub total: Duration,
    /// Wall time of the survey.
    pub survey: Duration,
    /// Wall time in which the engine made what all zones need.
    pub preparation: Duration,
    /// How much of it machines share out among them.
    pub shared_preparation: Duration,
    /// In how many stages: each waits for the one before.
    pub shared_stages: u32,
    /// Time that composition took.
    pub composition: Duration,
}

/// The rules by which the agents of a run decided what zones were painted with.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedRules {
    /// FCL texts.
    pub texts: Vec<String>,
    /// How wide bands were.
    pub bands: BandWidth,
    /// Whether the engine obeyed [`Tunables::max_depth`](bottega_engines::Tunables::max_depth).
    pub has_max_depth: bool,
    /// Whether the engine obeyed [`Tunables::light_samples`](bottega_engines::Tunables::light_samples).
    pub has_light_samples: bool,
    /// Whether zones were profiled before they were painted.
    pub is_profiled: bool,
}

impl RecordedRules {
    /// - `experts`: the knowledge of the agents, which have it in turn.
    pub fn new(experts: &[Expert], bands: BandWidth, engine: &EngineDescription) -> Self {
        let &EngineDescription { has_max_depth, has_light_samples, is_profiled, .. } = engine;
        Self {
            texts: experts.iter().map(Expert::rules_text).collect(),
            bands,
            has_max_depth,
            has_light_samples,
            is_profiled,
        }
    }

    /// The knowledge of the agents.
    ///
    /// # Errors
    /// A text that cannot be read, or that says nothing of painting.
    pub fn experts(&self) -> Result<Vec<Expert>, RecordError> {
        let &Self { ref texts, bands, has_max_depth, has_light_samples, is_profiled } = self;
        let knows = |(index, text): (usize, &String)| {
            let wrong = |problem: String| RecordError::Value { field: format!("rules[{index}]"), problem };
            let expert = Expert::parse(text).map_err(|error| wrong(format!("cannot be used: {error}")))?;
            Ok(expert.for_knobs(has_max_depth, has_light_samples, is_profiled).with_bands(bands))
        };
        texts.iter().enumerate().map(knows).collect()
    }
}

/// A zone and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedZone {
    /// Its own pixels.
    pub rect: Rect,
    /// Predicted cost in average pixels.
    pub complexity: f64,
    /// Neighbor Difference.
    pub neighbor_difference: NeighborDifference,
    /// What it was painted with.
    pub choice: Choice,
    /// Processor time of the first samples, [`Choice::profile_samples`] of them.
    pub profiling: Duration,
    /// Processor time of the rest.
    pub painting: Duration,
}

impl RecordedZone {
    /// The pixels painted, band and all.
    pub fn painted(&self, frame: &Rect) -> Rect {
        self.rect.grown_by(self.choice.bands, frame)
    }

    /// Processor time of samples `start..end` of all its pixels, in seconds: what was measured, spread evenly over the
    /// samples of each part.
    pub fn seconds(&self, start: u32, end: u32) -> f64 {
        let profiled = self.choice.profile_samples(&Goal::Samples);
        let part = |from: u32, to: u32, time: Duration| {
            let within = end.min(to).saturating_sub(start.max(from));
            if to > from { time.as_secs_f64() * f64::from(within) / f64::from(to - from) } else { 0.0 }
        };
        // More samples than were painted, where rules choose otherwise than they did, cost as the last ones.
        let last = if self.choice.samples > profiled { self.painting } else { self.profiling };
        let last_count = self.choice.samples.saturating_sub(profiled).max(1);
        let beyond = end.saturating_sub(start.max(self.choice.samples));
        let beyond = last.as_secs_f64() * f64::from(beyond) / f64::from(last_count);
        part(0, profiled, self.profiling) + part(profiled, self.choice.samples, self.painting) + beyond
    }

    /// Processor time of all its samples.
    pub fn total(&self) -> Duration {
        self.profiling + self.painting
    }
}

/// Processor time by place: cells of [`CELL_SIDE`]², which begin at multiples of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CostGrid {
    /// First cell to the left and at the top, in cells.
    pub origin: (u32, u32),
    /// Cells in a row.
    pub columns: u32,
    /// Seconds for one sample of one pixel, `[rows × columns]`.
    pub density: Vec<f64>,
}

impl CostGrid {
    /// How many columns and rows cover a frame.
    pub(super) fn size(frame: &Rect) -> (u32, u32) {
        let cells = |from: u32, to: u32| to.div_ceil(CELL_SIDE) - from / CELL_SIDE;
        (cells(frame.x0, frame.x1), cells(frame.y0, frame.y1))
    }

    /// A grid over a frame from what parts of it took: rectangle, samples a pixel, processor time in seconds. Where
    /// nothing was told it has the mean.
    pub fn of_parts(frame: &Rect, parts: impl IntoIterator<Item = (Rect, u32, f64)>) -> Self {
        let (columns, rows) = Self::size(frame);
        let origin = (frame.x0 / CELL_SIDE, frame.y0 / CELL_SIDE);
        let cells = columns as usize * rows as usize;
        let mut grid = Self { origin, columns, density: vec![0.0; cells] };
        let mut pixel_samples = vec![0.0; cells];
        for (rect, samples, seconds) in parts {
            let Some(rect) = rect.intersection(frame) else { continue };
            for (cell, area) in grid.cells(&rect) {
                let share = area as f64 / rect.area() as f64;
                grid.density[cell] += seconds * share;
                pixel_samples[cell] += area as f64 * f64::from(samples);
            }
        }
        let mean = grid.density.iter().sum::<f64>() / pixel_samples.iter().sum::<f64>().max(1.0);
        for (density, &samples) in grid.density.iter_mut().zip(&pixel_samples) {
            *density = if samples > 0.0 { *density / samples } else { mean };
        }
        grid
    }

    /// Seconds for one sample of all pixels of a rectangle within the grid.
    pub fn seconds(&self, rect: &Rect) -> f64 {
        self.cells(rect).map(|(cell, area)| self.density[cell] * area as f64).sum()
    }

    /// The cells that a rectangle touches, with the pixels that it has in each.
    fn cells(&self, rect: &Rect) -> impl Iterator<Item = (usize, u64)> + use<> {
        let (origin, columns, rect) = (self.origin, self.columns, *rect);
        rect.blocks(CELL_SIDE).map(move |block| {
            let (x, y) = (block.x0 / CELL_SIDE - origin.0, block.y0 / CELL_SIDE - origin.1);
            (y as usize * columns as usize + x as usize, block.area())
        })
    }
}

/// The version of a record in JSON that is written and read.
pub(super) const VERSION: u64 = 2;

/// A fault of a record.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordError {
    /// It is no JSON of this form.
    #[error("line {line}, column {column}: {problem}")]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
        /// What is wrong.
        problem: String,
    },
    /// It was written by another version.
    #[error("it is a record of version {found}; this program reads version {}: record it again", VERSION)]
    Version {
        /// Its version.
        found: u64,
    },
    /// A value that cannot be.
    #[error("`{field}` {problem}")]
    Value {
        /// Which field.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl Record {
    /// Whether it can have come from a run: what was read from a file is not believed.
    ///
    /// # Errors
    /// The first value that cannot be.
    pub fn check(&self) -> Result<(), RecordError> {
        let wrong = |field: &str, problem: &str| {
            Err(RecordError::Value { field: field.to_owned(), problem: problem.to_owned() })
        };
        let WorkSettings { picture, frame, samples, .. } = self.work;
        if frame.is_empty() || !picture.encloses(&frame) {
            return wrong("frame", "must hold pixels of the picture");
        }
        if samples == 0 || samples > 1 << 24 {
            return wrong("samples", "must be from 1 to 2²⁴");
        }
        if self.rules.texts.is_empty() {
            return wrong("rules", "must be those of one agent at least");
        }
        self.rules.experts()?;
        if !(1..=1 << 14).contains(&self.agents) || !(1..=1 << 14).contains(&self.processors) {
            return wrong("agents", "and `processors` must be from 1 to 2¹⁴");
        }
        if !(1e-4..=1e4).contains(&self.relative_power) {
            return wrong("relative_power", "must be from 0.0001 to 10000");
        }
        if self.shared_preparation > self.preparation || self.shared_stages > 1 << 10 {
            return wrong(
                "shared_preparation_seconds",
                "must be a part of `preparation_seconds`, in 1024 stages at most",
            );
        }
        let is_sound = |value: f64| value.is_finite() && value >= 0.0;
        for (index, zone) in self.zones.iter().enumerate() {
            let Choice { samples: chosen, bands, .. } = zone.choice;
            let NeighborDifference { mean, sides } = zone.neighbor_difference;
            if ![zone.complexity, mean].into_iter().chain(sides.into_array()).all(is_sound) {
                return wrong(&format!("zones[{index}]"), "must have a complexity and a neighbor difference from 0 on");
            }
            if chosen == 0 || chosen > samples || bands.into_array().into_iter().any(|band| band > 1 << 16) {
                return wrong(
                    &format!("zones[{index}]"),
                    "must have samples within those of the work, and a band that can be",
                );
            }
        }
        let rects: Vec<Rect> = self.zones.iter().map(|zone| zone.rect).collect();
        if !rects.is_sorted_by_key(|rect| (rect.y0, rect.x0)) || !Partition::covers(frame, &rects) {
            return wrong("zones", "must cover the frame exactly once, ordered by row and column");
        }
        let (columns, rows) = CostGrid::size(&frame);
        let CostGrid { origin, columns: found, density } = &self.costs;
        let fits = *origin == (frame.x0 / CELL_SIDE, frame.y0 / CELL_SIDE) && *found == columns;
        if !fits || density.len() != columns as usize * rows as usize || !density.iter().all(|&value| is_sound(value)) {
            return wrong("costs", "must have a number from 0 on for each 16 × 16 pixels of the frame");
        }
        if self.zones.iter().all(|zone| zone.total().is_zero()) {
            return wrong("zones", "must have taken some time");
        }
        Ok(())
    }
}
