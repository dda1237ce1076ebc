//! Numbers learnt by kind of task: each kind adds something to what the wider kinds say.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Kinds that are kept; those that were used longest ago go first.
const KINDS_MAX: usize = 256;
/// What the jobs before count at each new one.
const REMEMBERED: f64 = 0.5;
/// Zones of a job that count at most: a thousand zones of one job are no thousand jobs.
const ZONES_MAX: f64 = 64.0;
/// So many zones that say nothing are added to those of each kind: few zones are believed a little.
const DOUBT: f64 = 2.0;
/// The same for the widest kind, of which nothing wider could tell.
const DOUBT_OF_ALL: f64 = 0.25;
/// What is beyond was not measured.
const LOG_MAX: f64 = 20.0;

/// What was learnt of one kind of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Lesson {
    /// A mean of what this kind adds to the wider ones, as a logarithm.
    log: f64,
    /// Zones that it rests on; older jobs count less.
    count: f64,
    /// The last job in which it was learnt.
    job: u64,
}

/// What was learnt, by kind of tasks.
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

    /// What it is believed to add.
    fn believed(&self, is_widest: bool) -> f64 {
        let doubt = if is_widest { DOUBT_OF_ALL } else { DOUBT };
        self.log * self.count / (self.count + doubt)
    }

    /// What it adds, as a factor.
    pub(super) fn factor(&self) -> f64 {
        self.log.exp()
    }

    /// Zones that it rests on.
    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// The last job in which it was learnt.
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
    /// - `observed`: of each zone its kinds, from the widest to the narrowest, and what was measured, as a logarithm.
    /// - `weight`: of the job, 0..=1.
    /// - `job`: its number.
    pub(super) fn learn(&mut self, observed: &[(Vec<String>, f64)], weight: f64, job: u64) {
        let mut rest: Vec<f64> = observed.iter().map(|(_, log)| log.clamp(-LOG_MAX, LOG_MAX)).collect();
        for level in 0..observed.iter().map(|(kinds, _)| kinds.len()).max().unwrap_or(0) {
            let mut alike: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
            for (place, (kinds, _)) in observed.iter().enumerate().filter(|(_, (kinds, _))| level < kinds.len()) {
                alike.entry(&kinds[level]).or_default().push(place);
            }
            for (kind, places) in alike {
                let zones = (places.len() as f64).min(ZONES_MAX) * weight;
                let log = median(places.iter().map(|&place| rest[place]).collect());
                let lesson = self.0.entry(kind.to_owned()).or_insert(Lesson { log: 0.0, count: 0.0, job });
                lesson.learn(log, zones, job);
                let believed = lesson.believed(level == 0);
                places.iter().for_each(|&place| rest[place] -= believed);
            }
        }
        self.forget_oldest();
    }

    /// What is to be expected of a task, as a logarithm. `None`: nothing is known of the widest kind.
    ///
    /// - `kinds`: its kinds, from the widest to the narrowest.
    pub(super) fn expected(&self, kinds: &[String]) -> Option<f64> {
        self.0.get(kinds.first()?)?;
        let believed = |(level, kind): (usize, &String)| self.0.get(kind).map(|lesson| lesson.believed(level == 0));
        Some(kinds.iter().enumerate().filter_map(believed).sum())
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Lesson)> {
        self.0.iter().map(|(kind, lesson)| (kind.as_str(), lesson))
    }

    /// A kind of which something is said that cannot have been learnt.
    pub(super) fn nonsense(&self) -> Option<&str> {
        self.iter().find(|(_, lesson)| !lesson.is_sound()).map(|(kind, _)| kind)
    }

    /// Forgets what was used longest ago, where there is too much.
    pub(super) fn forget_oldest(&mut self) {
        if self.0.len() <= KINDS_MAX {
            return;
        }
        let mut ages: Vec<u64> = self.0.values().map(|lesson| lesson.job).collect();
        ages.sort_unstable_by(|a, b| b.cmp(a));
        let oldest_kept = ages[KINDS_MAX];
        // Of those that are as old as the first that goes, all go.
        self.0.retain(|_, lesson| lesson.job > oldest_kept);
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
