//! Records of real runs: zones with their costs, and the distribution of cost over the picture.

use std::time::Duration;

use bottega_image::Rect;

use bottega_engines::EngineDescription;

use crate::{BandWidth, Choice, Expert, Goal, Level, NeighborDifference, Partition, WorkSettings};

/// Side of the cells of a [`CostGrid`], in pixels: that of the built-in engine's work units, which also start at
/// multiples of it.
pub const CELL_SIDE: u32 = 16;

/// The record of a run: all that is needed to repeat it in virtual time.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The scene file, for display.
    pub scene: String,
    /// The name of the engine.
    pub engine: String,
    /// The rules of the agents, assigned in rotation.
    pub rules: RecordedRules,
    /// The user's settings.
    pub work: WorkSettings,
    /// The last level of the partition.
    pub level: Level,
    /// Number of agents, all on one machine.
    pub agents: usize,
    /// Number of processors of the machine.
    pub processors: usize,
    /// V_cp of the machine.
    pub relative_power: f64,
    /// The zones, in the order of a [`Partition`].
    pub zones: Vec<RecordedZone>,
    /// Processor time of painting, by place.
    pub costs: CostGrid,
    /// Wall time from start to end.
    pub total: Duration,
    /// Wall time of the survey.
    pub survey: Duration,
    /// Wall time of the engine's preparation for all zones.
    pub preparation: Duration,
    /// The part of the preparation that machines share.
    pub shared_preparation: Duration,
    /// Number of stages of the shared preparation, each of which waits for the one before.
    pub shared_stages: u32,
    /// Clock time of composing zones, summed over all zones.
    pub composition: Duration,
}

/// The rules by which the agents of a run chose the settings of zones.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedRules {
    /// The rule sets as FCL texts, assigned to the agents in rotation.
    pub texts: Vec<String>,
    /// The width of the bands.
    pub bands: BandWidth,
    /// True if the engine supports [`Tunables::max_depth`](bottega_engines::Tunables::max_depth).
    pub has_max_depth: bool,
    /// True if the engine supports [`Tunables::light_samples`](bottega_engines::Tunables::light_samples).
    pub has_light_samples: bool,
    /// True if zones were profiled.
    pub is_profiled: bool,
}

impl RecordedRules {
    /// Makes the record of the rules and the bands of a work.
    ///
    /// - `experts`: the rules of the agents, assigned in rotation.
    /// - `engine`: the engine that painted, for the settings that it supports.
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

    /// Returns the rules of the agents, to be assigned in rotation.
    ///
    /// # Errors
    /// A text cannot be parsed, has an unknown input, or has no known output.
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

/// The record of a zone: its pixels, settings and measured times.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedZone {
    /// The zone's own pixels, without the band.
    pub rect: Rect,
    /// Predicted cost of the zone's pixels, in average pixels of the frame.
    pub complexity: f64,
    /// Difference in cost per pixel from the neighbors, in average pixels per pixel.
    pub neighbor_difference: NeighborDifference,
    /// The settings with which the zone was painted.
    pub choice: Choice,
    /// Processor time of the first [`Choice::profile_samples`] samples.
    pub profiling: Duration,
    /// Processor time of the remaining samples.
    pub painting: Duration,
}

impl RecordedZone {
    /// Returns the painted pixels, including the band.
    ///
    /// - `frame`: the pixels of the work, to which the band is clipped.
    pub fn painted(&self, frame: &Rect) -> Rect {
        self.rect.grown_by(self.choice.bands, frame)
    }

    /// Returns the processor time of samples `start..end` of all pixels of the zone, in seconds: the measured times,
    /// spread evenly over the first samples and over the rest. Samples beyond the measured ones cost as much as the
    /// last of these.
    pub fn seconds(&self, start: u32, end: u32) -> f64 {
        let profiled = self.choice.profile_samples(&Goal::Samples);
        let part = |from: u32, to: u32, time: Duration| {
            let within = end.min(to).saturating_sub(start.max(from));
            if to > from { time.as_secs_f64() * f64::from(within) / f64::from(to - from) } else { 0.0 }
        };
        // Samples beyond those painted cost as much as the last ones
        let last = if self.choice.samples > profiled { self.painting } else { self.profiling };
        let last_count = self.choice.samples.saturating_sub(profiled).max(1);
        let beyond = end.saturating_sub(start.max(self.choice.samples));
        let beyond = last.as_secs_f64() * f64::from(beyond) / f64::from(last_count);
        part(0, profiled, self.profiling) + part(profiled, self.choice.samples, self.painting) + beyond
    }

    /// Returns the processor time of all samples of all pixels of the zone.
    pub fn total(&self) -> Duration {
        self.profiling + self.painting
    }
}

/// Processor time by place, in cells of [`CELL_SIDE`]² pixels that start at multiples of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CostGrid {
    /// Column and row of the first cell, counted from the origin of the picture.
    pub origin: (u32, u32),
    /// Cells per row.
    pub columns: u32,
    /// Seconds per sample and pixel, `[rows × columns]`.
    pub density: Vec<f64>,
}

impl CostGrid {
    /// Returns the number of columns and rows that cover a frame.
    pub(super) fn size(frame: &Rect) -> (u32, u32) {
        let cells = |from: u32, to: u32| to.div_ceil(CELL_SIDE) - from / CELL_SIDE;
        (cells(frame.x0, frame.x1), cells(frame.y0, frame.y1))
    }

    /// Makes the grid of a frame from measurements. Cells without a measurement get the mean.
    ///
    /// - `parts`: for each measured part its pixels, samples per pixel, and processor time in seconds.
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

    /// Returns the processor time, in seconds, for one sample of each pixel of a rectangle within the grid.
    pub fn seconds(&self, rect: &Rect) -> f64 {
        self.cells(rect).map(|(cell, area)| self.density[cell] * area as f64).sum()
    }

    /// Returns the cells that a rectangle overlaps, with the number of its pixels in each.
    fn cells(&self, rect: &Rect) -> impl Iterator<Item = (usize, u64)> + use<> {
        let (origin, columns, rect) = (self.origin, self.columns, *rect);
        rect.blocks(CELL_SIDE).map(move |block| {
            let (x, y) = (block.x0 / CELL_SIDE - origin.0, block.y0 / CELL_SIDE - origin.1);
            (y as usize * columns as usize + x as usize, block.area())
        })
    }
}

/// The version of the JSON format.
pub(super) const VERSION: u64 = 2;

/// An error in making, reading or checking a record.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordError {
    /// The text is not JSON of this format.
    #[error("line {line}, column {column}: {problem}")]
    Syntax {
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
        /// The problem, as text for the user.
        problem: String,
    },
    /// The record has another version of the format.
    #[error("it is a record of version {found}; this program reads version {}: record it again", VERSION)]
    Version {
        /// The version found.
        found: u64,
    },
    /// A value is invalid.
    #[error("`{field}` {problem}")]
    Value {
        /// The name of the field.
        field: String,
        /// The problem, as text for the user.
        problem: String,
    },
}

impl Record {
    /// Checks that the record may come from a run; records are read from files and not trusted.
    ///
    /// # Errors
    /// A value is invalid: the error names the first one.
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
