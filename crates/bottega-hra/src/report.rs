//! Reports: the activity of resources and of the work bin.

use std::time::Duration;

use crate::policy::bin_log::BinReport;
use crate::policy::core::Core;
use crate::policy::time::Time;
use crate::{
    Activity, CableUse, CostBook, CostModel, Expiries, Incident, PacketUse, Primitive, ResourceDescriptor, ResourceId,
    Span,
};

/// The report of an allocator: its state at one moment, and its work so far.
#[derive(Clone, Debug)]
pub struct HraReport {
    /// Time since the allocator was made, or since the report that was subtracted.
    pub uptime: Duration,
    /// Number of units in the work bin.
    pub pending: usize,
    /// Current capacity of the bin.
    pub bin_capacity: usize,
    /// The fill level of the bin over time.
    pub bin: BinReport,
    /// The resources, in the order of their ids.
    pub resources: Vec<ResourceReport>,
    /// The faults of resources, one entry per resource and kind; of more than 64 entries the oldest are dropped.
    pub incidents: Vec<Incident>,
    /// Numbers of units that expired before their answer was delivered, by cause.
    pub expiries: Expiries,
}

/// The report of one resource: its state at one moment, and its work so far.
#[derive(Clone, Debug)]
pub struct ResourceReport {
    /// The id of the resource.
    pub id: ResourceId,
    /// The description that the resource gave of itself.
    pub descriptor: ResourceDescriptor,
    /// The current activity of the resource.
    pub activity: Activity,
    /// Number of units done.
    pub units: u64,
    /// Number of failed attempts.
    pub failures: u64,
    /// Time with at least one unit in progress.
    pub busy: Duration,
    /// Time without work, neither suspended nor retired.
    pub idle: Duration,
    /// Time suspended after failures.
    pub suspended: Duration,
    /// Size of the data that the resource holds, in bytes.
    pub resident_bytes: u64,
    /// The packets that the resource got.
    pub packets: PacketUse,
    /// The traffic on the resource's cable, if it has one.
    pub cable: Option<CableUse>,
    /// Learned costs of the primitives that it has done.
    pub costs: Vec<(Primitive, CostModel)>,
    /// The activity of the resource over time; empty unless [`HraConfig::spans_kept`](crate::HraConfig::spans_kept)
    /// is set.
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
            packets: self.packets.since(&before.packets),
            cable: self.cable.map(|cable| cable.since(&before.cable.unwrap_or_default())),
            spans: spans.map(moved).collect(),
            ..self.clone()
        }
    }

    /// Returns the share of the time in which the resource had work, 0..=1; time after its retirement does not count.
    pub fn occupation(&self) -> f64 {
        let all = (self.busy + self.idle + self.suspended).as_secs_f64();
        if all > 0.0 { self.busy.as_secs_f64() / all } else { 0.0 }
    }
}

impl HraReport {
    /// Returns all learned costs, for the next run.
    ///
    /// - `version`: the conditions under which they were learned, see [`CostBook`].
    pub fn costs(&self, version: impl Into<String>) -> CostBook {
        let mut book = CostBook::new(version);
        for resource in &self.resources {
            for &(primitive, cost) in &resource.costs {
                book.set(&resource.descriptor.name, primitive, cost);
            }
        }
        book
    }

    /// Returns the work since an earlier report of the same allocator, with the current state; all times count from there.
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

    /// Makes the report of `core`.
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
                packets: lane.packets(),
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
