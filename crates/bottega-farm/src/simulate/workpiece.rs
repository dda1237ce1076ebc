//! The work of a simulation: zones and their costs.

use std::time::Duration;

use bottega_agents::driver::Random;
use bottega_engines::{EnginePreference, Tunables};
use bottega_image::Rect;

use super::record::{CELL_SIDE, Record, RecordError, RecordedZone};
use crate::{
    ErrorUse, Expert, Goal, InputRanges, NeighborDifference, Optimization, PaintOrder, WorkId, WorkRow, WorkSettings,
    ZoneForecast, ZoneId, ZoneRow,
};

/// Maximum number of zones of a simulation.
pub const ZONES_MAX: usize = 1 << 22;

const WORK: WorkId = WorkId(1);
/// Side of a synthetic zone, in pixels.
const SIDE: u32 = 64;

/// A work with the true cost of every possible order.
#[derive(Clone, Debug)]
pub struct Workpiece {
    pub(super) work: WorkRow,
    /// The zones, by id.
    zones: Vec<SurveyedZone>,
    costs: Costs,
    /// The rules of the agents that painted it, assigned in rotation.
    pub(super) experts: Vec<Expert>,
    /// Duration of the survey, before which there are no zones.
    pub(super) survey: Duration,
    /// Preparation of each machine before its first zone.
    pub(super) preparation: Duration,
    /// The part of the preparation that machines share, and its number of stages.
    pub(super) shared_preparation: Duration,
    pub(super) shared_stages: u32,
    /// Composition time per pixel, in seconds.
    pub(super) composition_per_pixel: f64,
    /// V_cp of the machine whose speed counts as 1.
    pub(super) relative_power: f64,
}

/// The Analyst's data of a zone.
#[derive(Clone, Copy, Debug)]
struct SurveyedZone {
    rect: Rect,
    complexity: f64,
    difference: NeighborDifference,
}

impl SurveyedZone {
    fn row(&self, index: usize) -> ZoneRow {
        ZoneRow::open(WORK, ZoneId::of_index(index), self.rect, self.complexity, self.difference)
    }
}

#[derive(Clone, Debug)]
enum Costs {
    Recorded(Box<Record>),
    /// Costs by zone, and the number of columns; zones are squares.
    Synthetic(Vec<SyntheticCost>, usize),
}

#[derive(Clone, Copy, Debug)]
struct SyntheticCost {
    /// Seconds for one sample of all pixels, among the first samples and among the rest.
    profiling: f32,
    painting: f32,
}

/// The spread of costs in a synthetic work. All are standard deviations of logarithms, except the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SyntheticSpread {
    /// Spread of the costs of zones around [`Self::mean_seconds`].
    pub zones: f64,
    /// Spread of the importance map's predictions, relative to the cost.
    pub prediction: f64,
    /// Spread of profiling's estimates, relative to the cost.
    pub profiling: f64,
    /// Mean processor time of a zone at speed 1, in seconds.
    pub mean_seconds: f64,
}

impl Default for SyntheticSpread {
    fn default() -> Self {
        Self { zones: 0.5, prediction: 0.3, profiling: 0.05, mean_seconds: 1.0 }
    }
}

/// The reason why a work for a simulation cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorkpieceError {
    /// The number of zones is zero or too large.
    #[error("{found} zones are not possible: use 1 to {ZONES_MAX}")]
    ZoneCount {
        /// The number of zones.
        found: usize,
    },
    /// The record's rules cannot be used.
    #[error("{0}")]
    Rules(RecordError),
}

impl Workpiece {
    /// Makes the work of a record.
    ///
    /// - `scale`: each zone is cut into this many, or as many as its pixels allow, of about equal size, with predicted
    ///   costs in proportion to their sizes.
    ///
    /// # Errors
    /// The work has no zones, or too many; or the recorded rules cannot be used.
    pub fn recorded(record: &Record, scale: u32) -> Result<Self, WorkpieceError> {
        let found = record.zones.len().saturating_mul(scale as usize);
        if found == 0 || found > ZONES_MAX {
            return Err(WorkpieceError::ZoneCount { found });
        }
        let mut zones = Vec::with_capacity(found);
        for zone in &record.zones {
            for rect in parts(zone.rect, scale) {
                let share = rect.area() as f64 / zone.rect.area() as f64;
                let complexity = zone.complexity * share;
                zones.push(SurveyedZone { rect, complexity, difference: zone.neighbor_difference });
            }
        }
        zones.sort_unstable_by_key(|zone| (zone.rect.y0, zone.rect.x0));
        let pixels = record.work.frame.area() as f64;
        Ok(Self {
            composition_per_pixel: record.composition.as_secs_f64() / pixels,
            survey: record.survey,
            preparation: record.preparation,
            shared_preparation: record.shared_preparation,
            shared_stages: record.shared_stages,
            relative_power: record.relative_power,
            experts: record.rules.experts().map_err(WorkpieceError::Rules)?,
            ..Self::new(record.work, zones, Costs::Recorded(Box::new(record.clone())))
        })
    }

    /// Makes a work of `zone_count` zones whose costs have a log-normal distribution. The same `seed` gives the same
    /// costs.
    ///
    /// # Errors
    /// The work has no zones, or too many.
    pub fn synthetic(zone_count: usize, spread: &SyntheticSpread, seed: u64) -> Result<Self, WorkpieceError> {
        const SAMPLES: u32 = 64;
        if zone_count == 0 || zone_count > ZONES_MAX {
            return Err(WorkpieceError::ZoneCount { found: zone_count });
        }
        let columns = (zone_count as f64).sqrt().ceil() as usize;
        let frame_rows = zone_count.div_ceil(columns);
        let frame = Rect::of_size(columns as u32 * SIDE, frame_rows as u32 * SIDE);
        let mut random = Random::new(seed ^ 0x5717);
        let (mut zones, mut costs) = (Vec::with_capacity(zone_count), Vec::with_capacity(zone_count));
        for index in 0..zone_count {
            let (column, row) = ((index % columns) as u32, (index / columns) as u32);
            let mut rect = Rect::new(column * SIDE, row * SIDE, (column + 1) * SIDE, (row + 1) * SIDE);
            if index + 1 == zone_count {
                // The last column extends to the edge
                rect.x1 = frame.x1;
            }
            let mut log_normal = |spread: f64| (spread * normal(&mut random) - spread * spread / 2.0).exp();
            let seconds = spread.mean_seconds * log_normal(spread.zones) / f64::from(SAMPLES);
            let complexity = seconds * log_normal(spread.prediction);
            zones.push(SurveyedZone { rect, complexity, difference: NeighborDifference::default() });
            let profiling = (seconds * log_normal(spread.profiling)) as f32;
            costs.push(SyntheticCost { profiling, painting: seconds as f32 });
        }
        let tunables = Tunables { max_depth: 8, light_samples: 1 };
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: SAMPLES,
            goal: Goal::Samples,
            tunables,
            optimization: Optimization::Off,
        };
        Ok(Self::new(settings, zones, Costs::Synthetic(costs, columns)))
    }

    fn new(settings: WorkSettings, zones: Vec<SurveyedZone>, costs: Costs) -> Self {
        let ranges = InputRanges::of(zones.iter().enumerate().map(|(index, zone)| zone.row(index)));
        Self {
            work: WorkRow {
                work: WORK,
                settings,
                zone_count: zones.len() as u32,
                ranges,
                features: crate::TaskFeatures::default(),
            },
            zones,
            costs,
            experts: vec![Expert::path_tracing()],
            survey: Duration::ZERO,
            preparation: Duration::ZERO,
            shared_preparation: Duration::ZERO,
            shared_stages: 0,
            composition_per_pixel: 0.0,
            relative_power: 1.0,
        }
    }

    /// Returns the user's settings of the work.
    pub fn settings(&self) -> &WorkSettings {
        &self.work.settings
    }

    /// Returns the number of zones.
    pub fn zone_count(&self) -> usize {
        self.zones.len()
    }

    /// Returns the initial rows of all zones.
    ///
    /// - `forecasts`: the predicted times by id; zones without one have no T_est.
    pub(super) fn rows(&self, forecasts: &[ZoneForecast]) -> impl Iterator<Item = ZoneRow> {
        let row = |(index, zone): (usize, &SurveyedZone)| {
            let row = zone.row(index);
            match forecasts.get(index) {
                Some(forecast) => row.with_forecast(&self.work.settings, forecast),
                None => row,
            }
        };
        self.zones.iter().enumerate().map(row)
    }

    /// Returns the pixels of a zone without its band; `None`: not a zone of the Analyst.
    pub(super) fn rect(&self, zone: ZoneId) -> Option<Rect> {
        self.zones.get(zone.index()).map(|zone| zone.rect)
    }

    /// Returns the processor time of an order at speed 1, in seconds, and the number of processors it can use.
    pub(super) fn cost(&self, order: &PaintOrder) -> (f64, f64) {
        match &self.costs {
            Costs::Recorded(record) => {
                // With its band, a zone's center may lie in another zone
                let own = self.rect(order.zone);
                let own = own.filter(|own| order.rect.encloses(own)).unwrap_or(order.rect);
                recorded_cost(record, &own, order)
            }
            Costs::Synthetic(costs, columns) => {
                // Pieces of zones cost in proportion to their size
                let index = (order.rect.y0 / SIDE) as usize * columns + (order.rect.x0 / SIDE) as usize;
                let index = index.min(costs.len() - 1);
                let SyntheticCost { profiling, painting } = costs[index];
                let share = order.rect.area() as f64 / self.zones[index].rect.area() as f64;
                let early = self.profile_samples().min(order.samples.end).saturating_sub(order.samples.start);
                let all = order.samples.end.saturating_sub(order.samples.start);
                let seconds = f64::from(early) * f64::from(profiling) + f64::from(all - early) * f64::from(painting);
                (seconds * share, f64::INFINITY)
            }
        }
    }

    /// Returns the processor time at speed 1 of the painted part of a zone, in seconds.
    pub(super) fn painted_seconds(&self, row: &ZoneRow) -> f64 {
        let Some(choice) = row.choice else { return 0.0 };
        let order = PaintOrder {
            zone: row.zone,
            fence: bottega_agents::Revision::ABSENT,
            rect: row.painted(&choice, &self.work.settings.frame),
            samples: 0..row.samples_done(),
            tunables: choice.tunables,
            preference: EnginePreference::default(),
            from: None,
            error_use: ErrorUse::None,
            samples_max: choice.samples,
            time_estimated: None,
        };
        self.cost(&order).0
    }

    fn profile_samples(&self) -> u32 {
        crate::Choice::unchanged(&self.work.settings).profile_samples(&self.work.settings.goal)
    }

    /// Returns the processor time of each zone at speed 1, in seconds, in the order of the zones' ids, with the
    /// recorded settings.
    pub fn zone_seconds(&self) -> impl Iterator<Item = f64> {
        let samples = self.work.settings.samples;
        self.zones.iter().enumerate().map(move |(index, zone)| match &self.costs {
            Costs::Recorded(record) => share_of_recorded(record, &zone.rect, &zone.rect)
                .map_or(0.0, |(zone, share)| zone.total().as_secs_f64() * share),
            Costs::Synthetic(..) => {
                let order = PaintOrder {
                    zone: ZoneId::of_index(index),
                    fence: bottega_agents::Revision::ABSENT,
                    rect: zone.rect,
                    samples: 0..samples,
                    tunables: self.work.settings.tunables,
                    preference: EnginePreference::default(),
                    from: None,
                    error_use: ErrorUse::None,
                    samples_max: samples,
                    time_estimated: None,
                };
                self.cost(&order).0
            }
        })
    }
}

/// Returns the cost of an order of a recorded work: its share of the measured zone that contains the center of `own`.
fn recorded_cost(record: &Record, own: &Rect, order: &PaintOrder) -> (f64, f64) {
    let width = order.rect.blocks(CELL_SIDE).count() as f64;
    let count = order.samples.end.saturating_sub(order.samples.start);
    let seconds = match share_of_recorded(record, own, &order.rect) {
        Some((zone, share)) => zone.seconds(order.samples.start, order.samples.end) * share,
        None => record.costs.seconds(&order.rect) * f64::from(count),
    };
    (seconds, width)
}

/// Returns the recorded zone that contains the center of `own`, and the share of its cost in `rect`. `None`: `rect`
/// exceeds the painted pixels.
fn share_of_recorded<'a>(record: &'a Record, own: &Rect, rect: &Rect) -> Option<(&'a RecordedZone, f64)> {
    let middle = (own.x0.midpoint(own.x1), own.y0.midpoint(own.y1));
    // Zones are ordered by row, so the zone begins at or above the center
    let end = record.zones.partition_point(|zone| zone.rect.y0 <= middle.1);
    let zone = record.zones[..end].iter().rev().find(|zone| zone.rect.contains(middle.0, middle.1))?;
    let painted = zone.painted(&record.work.frame);
    if *own == zone.rect && (*rect == painted || rect == own) {
        return Some((zone, 1.0));
    }
    let whole = record.costs.seconds(&painted);
    (painted.encloses(rect) && whole > 0.0).then(|| (zone, record.costs.seconds(rect) / whole))
}

/// Cuts a rectangle into `count` parts of about equal size, or as many as its pixels allow.
fn parts(rect: Rect, count: u32) -> Vec<Rect> {
    let mut open = vec![(rect, count)];
    let mut done = Vec::new();
    while let Some((rect, count)) = open.pop() {
        let longer = rect.width().max(rect.height());
        if count <= 1 || longer < 2 {
            done.push(rect);
            continue;
        }
        let first = count / 2;
        let at = ((u64::from(longer) * u64::from(first) / u64::from(count)) as u32).clamp(1, longer - 1);
        let halves = if rect.width() >= rect.height() {
            [Rect { x1: rect.x0 + at, ..rect }, Rect { x0: rect.x0 + at, ..rect }]
        } else {
            [Rect { y1: rect.y0 + at, ..rect }, Rect { y0: rect.y0 + at, ..rect }]
        };
        open.push((halves[0], first));
        open.push((halves[1], count - first));
    }
    done
}

/// Returns an approximately normal number with mean 0 and standard deviation 1: a sum of twelve uniform ones, which
/// needs additions only.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::{
        super::{FarmSpec, Plan, record_json::tests::example, simulate},
        *,
    };
    use crate::Partition;

    #[test]
    fn what_machines_prepare_together_takes_each_of_them_its_share() {
        let makespan = |shared: u64, agents: &str| {
            let (preparation, shared_preparation) = (Duration::from_secs(10), Duration::from_secs(shared));
            let record = Record { preparation, shared_preparation, shared_stages: shared as u32 / 4, ..example() };
            let piece = Arc::new(Workpiece::recorded(&record, 8).unwrap());
            let farm: FarmSpec = agents.parse().unwrap();
            simulate(&piece, &Plan::calm(farm, 1)).unwrap().makespan.as_secs_f64()
        };
        let saved = |agents| makespan(0, agents) - makespan(8, agents);
        // Two stages of ten milliseconds, for agents that look at each other.
        assert!(saved("1").abs() < 0.025, "{}", saved("1"));
        assert!((saved("4") - 5.98).abs() < 0.025, "{}", saved("4"));
        // An agent that joins later takes no part.
        let late = saved("4 agent-3@join=60s");
        assert!((late - (8.0 * 2.0 / 3.0 - 0.02)).abs() < 0.025, "{late}");
    }

    #[test]
    fn a_zone_cut_into_parts_costs_as_much_as_before() {
        let record = example();
        for scale in [1, 2, 3, 7] {
            let piece = Workpiece::recorded(&record, scale).unwrap();
            assert_eq!(piece.zone_count(), 2 * scale as usize);
            let rects: Vec<Rect> = piece.rows(&[]).map(|row| row.rect).collect();
            assert!(Partition::covers(record.work.frame, &rects));
            let all: f64 = piece.zone_seconds().sum();
            assert!((all - 3.0).abs() < 1e-6, "{scale}: {all}");
        }
        assert!(Workpiece::recorded(&record, u32::MAX).is_err());
    }

    #[test]
    fn synthetic_zones_cover_their_frame_and_have_the_requested_mean() {
        for count in [1, 2, 7, 5000] {
            let piece = Workpiece::synthetic(count, &SyntheticSpread::default(), 3).unwrap();
            let rects: Vec<Rect> = piece.rows(&[]).map(|row| row.rect).collect();
            assert!(Partition::covers(piece.settings().frame, &rects), "{count}");
            if count == 5000 {
                let mean = piece.zone_seconds().sum::<f64>() / count as f64;
                // The standard error is 0.53 / √5000 = 0.0075.
                assert!((mean - 1.0).abs() < 0.04, "{mean}");
            }
        }
        assert!(Workpiece::synthetic(0, &SyntheticSpread::default(), 3).is_err());
    }
}
