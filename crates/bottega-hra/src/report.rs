//! The report of a resource: what it did with its time.

use std::time::Duration;

use crate::policy::bin_log::BinReport;
use crate::policy::core::Core;
use crate::policy::time::Time;
use crate::{
    Activity, CableUse, CostBook, CostModel, Expiries, Incident, Primitive, ResourceDescriptor, ResourceId, Span,
};

/// The allocator at one moment.
#[derive(Clone, Debug)]
pub struct HraReport {
    /// Time since the allocator was made.
    pub uptime: Duration,
    /// Units in the work bin.
    pub pending: usize,
    /// Units that the bin takes at present.
    pub bin_capacity: usize,
    /// How full it was.
    pub bin: BinReport,
    /// One entry a resource, in the order of their numbers.
    pub resources: Vec<ResourceReport>,
    /// What went wrong with resources, for the user to be told.
    pub incidents: Vec<Incident>,
    /// Units past their life time.
    pub expiries: Expiries,
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
    /// What passed on its cable, if it has one.
    pub cable: Option<CableUse>,
    /// Learnt costs of the primitives that it has done, by primitive.
    pub costs: Vec<(Primitive, CostModel)>,
    /// What it was at, in the order of time; empty unless [`HraConfig::spans_kept`](crate::HraConfig::spans_kept).
    pub spans: Vec<Span>,
}

impl ResourceReport {
    fn since(&self, before: &Self, start: Time) -> Self {
        let spans = self.spans.iter().filter(|span| span.to > start);
        let moved = |span: &Span| Span {
            activity: span.activity,
            from: Time::at(span.from.since(start)),
            to: Time::at(span.to.since(start)),
        };
        Self {
            units: self.units - before.units,
            failures: self.failures - before.failures,
            busy: self.busy.saturating_sub(before.busy),
            idle: self.idle.saturating_sub(before.idle),
            suspended: self.suspended.saturating_sub(before.suspended),
            cable: self.cable.map(|cable| cable.since(&before.cable.unwrap_or_default())),
            spans: spans.map(moved).collect(),
            ..self.clone()
        }
    }

    /// The share of its time in which it had work, from 0 to 1.
    pub fn occupation(&self) -> f64 {
        let all = (self.busy + self.idle + self.suspended).as_secs_f64();
        if all > 0.0 { self.busy.as_secs_f64() / all } else { 0.0 }
    }
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

    /// What has happened since an earlier report of the same allocator, as if it had been made then: all times count from
    /// there.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        let start = Time::at(before.uptime);
        let resources = self.resources.iter().zip(&before.resources);
        let incidents = self.incidents.iter().filter_map(|incident| {
            let same = |known: &&Incident| (known.resource, known.fault) == (incident.resource, incident.fault);
            let known = before.incidents.iter().find(same).map_or(0, |known| known.count);
            let count = incident.count.checked_sub(known).filter(|&count| count > 0)?;
            let [first, last] = [incident.first, incident.last].map(|at| Time::at(at.since(start)));
            Some(Incident { first, last, count, ..incident.clone() })
        });
        Self {
            uptime: self.uptime.saturating_sub(before.uptime),
            pending: self.pending,
            bin_capacity: self.bin_capacity,
            bin: self.bin.since(&before.bin, before.uptime, self.uptime),
            incidents: incidents.collect(),
            expiries: self.expiries.since(&before.expiries, start),
            resources: resources.map(|(now, before)| now.since(before, start)).collect(),
        }
    }

    /// What `core` looks like.
    pub(crate) fn of<T>(core: &mut Core<T>, now: Time, pending: usize) -> Self {
        let bin = core.bin_report(now);
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
                cable: lane.flow.as_ref().map(|_| lane.cable.report()),
                costs: costs.filter(|(_, cost)| cost.units() > 0).collect(),
                spans: lane.account.spans(now),
            }
        });
        Self {
            uptime: now.since(Time::ZERO),
            pending,
            bin_capacity: core.capacity(),
            bin,
            resources: resources.collect(),
            incidents: core.incidents().list(),
            expiries: core.expiries(),
        }
    }
}
