//! The learned times of one picture: where it costs how much.

use bottega_image::Rect;
use serde::{Deserialize, Serialize};

use super::subject::Subject;
use crate::{OUTLOOK_COLUMNS, OUTLOOK_ROWS, PictureOutlook, TaskOutlook};

/// Steps per unit of a stored logarithm.
const STEPS: f64 = 256.0;
/// Weight of the measured costs beside the survey of the present job, where both are known.
const MEASURED_WEIGHT: f64 = 0.6;
/// Factor on the weight of earlier jobs at each new one.
const REMEMBERED: f64 = 0.5;
/// Deviation of a picture of which no zone was seen, and the number of zones that this assumption counts as.
const UNKNOWN: f64 = 0.4;
const DOUBT: f64 = 2.0;
/// Deviation between two jobs of one picture that is assumed beside the one that was seen.
const DRIFT: f64 = 0.05;

/// A picture that was painted before. All values are logarithms of times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LearntPicture {
    pub(super) technique: String,
    pub(super) scene: String,
    pub(super) view: String,
    /// ln of measured over expected time, by the technique's model.
    pub(super) offset: f64,
    /// Standard deviation of the logarithm of measured over predicted time.
    pub(super) deviation: f64,
    /// Number of zones behind the picture; older jobs count less.
    pub(super) count: f64,
    /// The number of the last job that taught something.
    pub(super) job: u64,
    /// ln of nanoseconds per sample and pixel, in [`STEPS`], row-major over the outlook's grid; `None`: not painted.
    cells: Vec<Option<i16>>,
}

/// A zone of a finished job.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredZone<'a> {
    pub(super) outlook: &'a TaskOutlook,
    /// ln of measured time over the survey's prediction.
    pub(super) log: f64,
    /// ln(measured ∕ predicted time) as the technique's model expects it.
    pub(super) expected: f64,
}

impl LearntPicture {
    pub(super) fn new(technique: &str, subject: &Subject) -> Self {
        let (scene, view) = (subject.scene.to_string(), subject.view.to_string());
        let cells = vec![None; (OUTLOOK_COLUMNS * OUTLOOK_ROWS) as usize];
        Self {
            technique: technique.to_owned(),
            scene,
            view,
            offset: 0.0,
            deviation: UNKNOWN,
            count: 0.0,
            job: 0,
            cells,
        }
    }

    /// Returns true if the picture is of this scene, seen in this way and painted by this technique.
    pub(super) fn is(&self, technique: &str, subject: &Subject) -> bool {
        self.technique == technique && *self.scene == *subject.scene && *self.view == *subject.view
    }

    /// Returns the expected ln of measured time over the survey's prediction of a zone.
    ///
    /// - `expected`: the same by the technique's model alone.
    pub(super) fn expected(&self, outlook: &PictureOutlook, zone: &TaskOutlook, expected: f64) -> f64 {
        let by_model = expected + self.offset;
        self.measured(&outlook.frame, zone)
            .map_or(by_model, |log| MEASURED_WEIGHT * log + (1.0 - MEASURED_WEIGHT) * by_model)
    }

    /// Returns ln of the time measured at the place of a zone over the survey's present prediction. `None`: less than
    /// half of the zone was painted before.
    fn measured(&self, frame: &Rect, zone: &TaskOutlook) -> Option<f64> {
        let (mut seconds, mut known) = (0.0, 0.0);
        for_cells(frame, &zone.rect, |cell, share| {
            if let Some(log) = self.cells.get(cell).copied().flatten() {
                seconds += share * 1e-9 * (f64::from(log) / STEPS).exp();
                known += share;
            }
        });
        let log = (seconds / known * zone.rect.area() as f64 / zone.sample_time).ln();
        (known >= 0.5 && log.is_finite()).then_some(log)
    }

    /// Learns a job's zones.
    ///
    /// - `weight`: how much the job counts, 0..=1.
    pub(super) fn learn(&mut self, outlook: &PictureOutlook, zones: &[MeasuredZone<'_>], weight: f64, job: u64) {
        let before = REMEMBERED * self.count;
        let share = zones.len() as f64 * weight / (before + zones.len() as f64 * weight);
        // Compare with what was expected
        let is_new = self.count <= 0.0;
        let residuals: Vec<f64> = zones.iter().map(|zone| zone.log - zone.expected).collect();
        let offset = median(residuals.clone());
        let errors: Vec<f64> = match is_new {
            true => residuals.iter().map(|residual| (residual - offset).abs()).collect(),
            false => zones.iter().map(|it| (it.log - self.expected(outlook, it.outlook, it.expected)).abs()).collect(),
        };
        // The median of |x| of a normal distribution is 0.674 of its standard deviation
        let deviation = (median(errors) / 0.674).hypot(DRIFT);
        let certain = zones.len() as f64 * weight / (before + zones.len() as f64 * weight + DOUBT);
        self.deviation += certain * (deviation - self.deviation);
        self.offset += share * (offset - self.offset);
        // Average the measured cost over each cell, with the survey's distribution within a zone
        let mut sums = vec![(0.0, 0.0); self.cells.len()];
        for zone in zones {
            let pixels = zone.outlook.rect.area() as f64;
            for_cells(&outlook.frame, &zone.outlook.rect, |cell, of_zone| {
                if let (Some((sum, area)), Some(predicted)) = (sums.get_mut(cell), outlook.grid.get(cell)) {
                    let log = (1e9 * predicted).ln() + zone.log;
                    let covered = if log.is_finite() { of_zone * pixels } else { 0.0 };
                    *sum += if covered > 0.0 { covered * log } else { 0.0 };
                    *area += covered;
                }
            });
        }
        // Take it over
        for (kept, (sum, area)) in self.cells.iter_mut().zip(sums).filter(|(_, (_, area))| *area > 0.0) {
            let log = STEPS * sum / area;
            let log = kept.map_or(log, |kept| f64::from(kept) + share * (log - f64::from(kept)));
            *kept = Some(log.round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16);
        }
        self.count = before + zones.len() as f64 * weight;
        self.job = job;
    }

    /// Returns the picture in words: technique, and the first digits of scene and view.
    pub(super) fn title(&self) -> String {
        let start = |text: &str| text.chars().take(8).collect::<String>();
        format!("{}, scene {}, view {}", self.technique, start(&self.scene), start(&self.view))
    }

    /// Returns true if all numbers are plausible.
    pub(super) fn is_sound(&self) -> bool {
        self.offset.abs() <= 20.0
            && (0.0..=20.0).contains(&self.deviation)
            && (0.0..=1e9).contains(&self.count)
            && self.cells.len() == (OUTLOOK_COLUMNS * OUTLOOK_ROWS) as usize
    }
}

/// Calls `take` with each cell of the grid over `frame` that a zone covers, and the share of the zone in it.
fn for_cells(frame: &Rect, zone: &Rect, mut take: impl FnMut(usize, f64)) {
    let Some(zone) = zone.intersection(frame).filter(|zone| !zone.is_empty()) else { return };
    // The interval of a side in cells
    let span = |low: u32, high: u32, start: u32, side: u32, count: u32| {
        let at = |place: u32| f64::from(place - start) / f64::from(side) * f64::from(count);
        (at(low), at(high))
    };
    let (x0, x1) = span(zone.x0, zone.x1, frame.x0, frame.width(), OUTLOOK_COLUMNS);
    let (y0, y1) = span(zone.y0, zone.y1, frame.y0, frame.height(), OUTLOOK_ROWS);
    let overlap = |low: f64, high: f64, cell: u32| (high.min(f64::from(cell + 1)) - low.max(f64::from(cell))).max(0.0);
    let all = (x1 - x0) * (y1 - y0);
    for row in y0 as u32..(y1.ceil() as u32).min(OUTLOOK_ROWS) {
        for column in x0 as u32..(x1.ceil() as u32).min(OUTLOOK_COLUMNS) {
            let share = overlap(x0, x1, column) * overlap(y0, y1, row) / all;
            take((row * OUTLOOK_COLUMNS + column) as usize, share);
        }
    }
}

/// Returns the median; 0 without values.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
