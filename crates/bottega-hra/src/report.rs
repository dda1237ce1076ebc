//! What each resource did with its time.

use std::time::Duration;

use crate::policy::core::Core;
use crate::policy::time::Time;
use crate::{Activity, CostBook, CostModel, Incident, Primitive, ResourceDescriptor, ResourceId, Span};

/// The allocator at one moment.
#[derive(Clone, Debug)]
pub struct HraReport {
    /// Time since the allocator was made.
    pub uptime: Duration,
    /// Units in the work bin.
    pub pending: usize,
    /// Units that the bin takes at present.
    pub bin_capacity: usize,
    /// One entry a resource, in the order of their numbers.
    pub resources: Vec<ResourceReport>,
    /// What went wrong with resources, for the user to be told.
    pub incidents: Vec<Incident>,
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
    /// Bytes of data that it holds.
    pub resident_bytes: u64,
    /// Learnt costs of the primitives that it has done, by primitive.
    pub costs: Vec<(Primitive, CostModel)>,
    /// What it was at, in the order of time; empty unless [`HraConfig::spans_kept`](crate::HraConfig::spans_kept).
    pub spans: Vec<Span>,
}

impl HraReport {
    /// All costs learnt, for the next run.
    pub fn costs(&self, version: impl Into<String>) -> CostBook {
        let mut book = CostBook::new(version);
        for resource in &self.resources {
            for &(primitive, cost) in &resource.costs {
                book.set(&resource.descriptor.name, primitive, cost);
            }
        }
        book
    }

    /// What `core` looks like.
    pub(crate) fn of<T>(core: &Core<T>, now: Time, pending: usize) -> Self {
        let resources = core.lanes().iter().zip(0..).map(|(lane, index)| {
            let spent = |activity| lane.account.spent(activity, now);
            let costs = Primitive::ALL.into_iter().map(|primitive| (primitive, lane.costs()[primitive.index()]));
            ResourceReport {
                id: ResourceId(index),
                descriptor: lane.descriptor.clone(),
                activity: lane.account.activity(),
                units: lane.account.units,
                failures: lane.account.failures,
                busy: spent(Activity::Working),
                idle: spent(Activity::Idle),
                suspended: spent(Activity::Suspended),
                resident_bytes: lane.residency.used(),
                costs: costs.filter(|(_, cost)| cost.units() > 0).collect(),
                spans: lane.account.spans(now),
            }
        });
        Self {
            uptime: now.since(Time::ZERO),
            pending,
            bin_capacity: core.capacity(),
            resources: resources.collect(),
            incidents: core.incidents().list(),
        }
    }
}
