//! What each resource did with its time.

use std::time::{Duration, Instant};

use crate::{CostModel, Primitive, ResourceDescriptor, ResourceId};

/// What a resource is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Waits for work.
    Idle,
    /// Works.
    Working,
    /// Left alone after a failure, for a while.
    Suspended,
    /// Given up after too many failures in a row, or because it could not be started.
    Retired,
}

/// The allocator at one moment.
#[derive(Clone, Debug)]
pub struct HraReport {
    /// Time since the allocator was made.
    pub uptime: Duration,
    /// Units in the work bin.
    pub pending: usize,
    /// One entry a resource, in the order of their numbers.
    pub resources: Vec<ResourceReport>,
}

/// One resource since the allocator was made.
#[derive(Clone, Debug)]
pub struct ResourceReport {
    /// Its number.
    pub id: ResourceId,
    /// What it is.
    pub descriptor: ResourceDescriptor,
    /// What it is at now.
    pub activity: Activity,
    /// Units done.
    pub units: u64,
    /// Attempts that failed.
    pub failures: u64,
    /// Time with at least one unit under way.
    pub busy: Duration,
    /// Time without work, neither suspended nor retired.
    pub idle: Duration,
    /// Time left alone after failures.
    pub suspended: Duration,
    /// Learnt costs of the primitives that it has done, by primitive.
    pub costs: Vec<(Primitive, CostModel)>,
}

/// The account that a lane keeps of itself.
pub(crate) struct Account {
    activity: Activity,
    since: Instant,
    units: u64,
    failures: u64,
    spent: [Duration; 4],
    costs: [CostModel; Primitive::COUNT],
}

impl Account {
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            activity: Activity::Idle,
            since: now,
            units: 0,
            failures: 0,
            spent: [Duration::ZERO; 4],
            costs: [CostModel::default(); Primitive::COUNT],
        }
    }

    /// Turns to another activity.
    pub(crate) fn enter(&mut self, activity: Activity, now: Instant) {
        self.spent[self.activity as usize] += now.saturating_duration_since(self.since);
        self.activity = activity;
        self.since = now;
    }

    /// Books a unit that was done, with the time that it took of the resource.
    pub(crate) fn book(&mut self, primitive: Primitive, size: u64, busy: Duration) {
        self.units += 1;
        self.costs[primitive.index()].observe(size, busy);
    }

    /// Books an attempt that failed.
    pub(crate) fn book_failure(&mut self) {
        self.failures += 1;
    }

    pub(crate) fn report(&self, id: ResourceId, descriptor: &ResourceDescriptor, now: Instant) -> ResourceReport {
        let spent = |activity: Activity| {
            let current =
                if self.activity == activity { now.saturating_duration_since(self.since) } else { Duration::ZERO };
            self.spent[activity as usize] + current
        };
        let costs = Primitive::ALL.into_iter().map(|primitive| (primitive, self.costs[primitive.index()]));
        ResourceReport {
            id,
            descriptor: descriptor.clone(),
            activity: self.activity,
            units: self.units,
            failures: self.failures,
            busy: spent(Activity::Working),
            idle: spent(Activity::Idle),
            suspended: spent(Activity::Suspended),
            costs: costs.filter(|(_, cost)| cost.units() > 0).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Link, PrimitiveSet};

    #[test]
    fn all_time_is_accounted_for() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut account = Account::new(start);
        account.enter(Activity::Working, at(10));
        account.enter(Activity::Suspended, at(30));
        account.enter(Activity::Idle, at(70));
        account.enter(Activity::Working, at(80));
        let descriptor = ResourceDescriptor {
            name: "test".into(),
            primitives: PrimitiveSet::ALL,
            memory_bytes: None,
            link: Link::LOCAL,
        };
        let report = account.report(ResourceId(0), &descriptor, at(85));
        assert_eq!(report.busy, Duration::from_millis(25));
        assert_eq!(report.suspended, Duration::from_millis(40));
        assert_eq!(report.idle, Duration::from_millis(20));
        assert_eq!(report.activity, Activity::Working);
    }
}
