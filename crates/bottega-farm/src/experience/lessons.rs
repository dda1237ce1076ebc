//! Learned logarithms by kind of task: that of each kind is added to those of the wider kinds.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Maximum number of kinds kept; the least recently updated are dropped first.
const KINDS_MAX: usize = 256;
/// Factor on the weight of earlier jobs at each new one.
const REMEMBERED: f64 = 0.5;
/// Maximum number of zones of one job that count, so that one large job does not outweigh many.
const ZONES_MAX: f64 = 64.0;
/// Number of zones with logarithm 0 added to each kind, so that few zones have little effect (shrinkage).
const DOUBT: f64 = 2.0;
/// Like [`DOUBT`], for the widest kind, for which no wider one exists.
const DOUBT_OF_ALL: f64 = 0.25;
/// Bound on logarithms; values beyond it are not plausible measurements.
const LOG_MAX: f64 = 20.0;

/// The learned value of one kind of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Lesson {
    /// Weighted mean of the logarithm that this kind adds to the wider ones.
    log: f64,
    /// Number of zones behind the value; older jobs count less.
    count: f64,
    /// The number of the last job that updated it.
    job: u64,
}

/// The learned values, by kind of tasks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Lessons(BTreeMap<String, Lesson>);

impl Lesson {
    fn learn(&mut self, log: f64, zones: f64, job: u64) {
        let before = REMEMBERED * self.count;
        self.log = (before * self.log + zones * log) / (before + zones);
        self.count = before + zones;
        self.job = job;
    }

    /// Returns the logarithm to add, reduced by the doubt about few zones.
    fn believed(&self, is_widest: bool) -> f64 {
        let doubt = if is_widest { DOUBT_OF_ALL } else { DOUBT };
        self.log * self.count / (self.count + doubt)
    }

    /// Returns the factor, without that reduction.
    pub(super) fn factor(&self) -> f64 {
        self.log.exp()
    }

    /// Returns the number of zones behind it; older jobs count less.
    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// Returns the number of the last job that updated it.
    pub(super) fn job(&self) -> u64 {
        self.job
    }

    fn is_sound(&self) -> bool {
        self.log.abs() <= LOG_MAX && self.count.is_finite() && self.count >= 0.0
    }
}

impl Lessons {
    /// Learns from a job.
    ///
    /// - `observed`: per zone its kinds, from the widest to the narrowest, and the measured logarithm.
    /// - `weight`: the weight of the job, 0..=1.
    /// - `job`: the number of the job.
    pub(super) fn learn(&mut self, observed: &[(Vec<String>, f64)], weight: f64, job: u64) {
        let mut rest: Vec<f64> = observed.iter().map(|(_, log)| log.clamp(-LOG_MAX, LOG_MAX)).collect();
        // From the widest kind to the narrowest
        for level in 0..observed.iter().map(|(kinds, _)| kinds.len()).max().unwrap_or(0) {
            // Group the zones by kind
            let mut alike: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
            for (place, (kinds, _)) in observed.iter().enumerate().filter(|(_, (kinds, _))| level < kinds.len()) {
                alike.entry(&kinds[level]).or_default().push(place);
            }
            for (kind, places) in alike {
                let zones = (places.len() as f64).min(ZONES_MAX) * weight;
                // Update each kind with the median of what the wider kinds leave unexplained
                let log = median(places.iter().map(|&place| rest[place]).collect());
                let lesson = self.0.entry(kind.to_owned()).or_insert(Lesson { log: 0.0, count: 0.0, job });
                lesson.learn(log, zones, job);
                let believed = lesson.believed(level == 0);
                // Subtract what this kind explains
                places.iter().for_each(|&place| rest[place] -= believed);
            }
        }
        self.forget_oldest();
    }

    /// Returns the expected logarithm of a task. `None`: the widest kind is unknown.
    ///
    /// - `kinds`: the kinds of the task, from the widest to the narrowest.
    pub(super) fn expected(&self, kinds: &[String]) -> Option<f64> {
        self.0.get(kinds.first()?)?;
        let believed = |(level, kind): (usize, &String)| self.0.get(kind).map(|lesson| lesson.believed(level == 0));
        Some(kinds.iter().enumerate().filter_map(believed).sum())
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Lesson)> {
        self.0.iter().map(|(kind, lesson)| (kind.as_str(), lesson))
    }

    /// Returns a kind with an implausible value, if any.
    pub(super) fn nonsense(&self) -> Option<&str> {
        self.iter().find(|(_, lesson)| !lesson.is_sound()).map(|(kind, _)| kind)
    }

    /// Drops the least recently updated kinds beyond [`KINDS_MAX`].
    pub(super) fn forget_oldest(&mut self) {
        if self.0.len() <= KINDS_MAX {
            return;
        }
        let mut ages: Vec<u64> = self.0.values().map(|lesson| lesson.job).collect();
        ages.sort_unstable_by(|a, b| b.cmp(a));
        let oldest_kept = ages[KINDS_MAX];
        // Drop all kinds as old as the first one beyond the maximum
        self.0.retain(|_, lesson| lesson.job > oldest_kept);
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
