//! The timeline of resources and of the work bin, as data.

use serde::Serialize;

use crate::{Activity, CableUse, HraReport, PacketUse, ResourceReport, Time};

#[derive(Serialize)]
struct Timeline<'a> {
    /// Length, in seconds.
    seconds: f64,
    resources: Vec<ResourceLine<'a>>,
    bin: BinLine,
    incidents: Vec<IncidentLine<'a>>,
    expired: ExpiredLine,
}

/// Expired units.
#[derive(Serialize)]
struct ExpiredLine {
    waiting: u64,
    late: u64,
    first: f64,
    last: f64,
}

#[derive(Serialize)]
struct CableLine {
    sent_bytes: u64,
    received_bytes: u64,
    /// Bytes per second; absent unless the cable is known to be slow.
    bandwidth_there: Option<f64>,
    bandwidth_back: Option<f64>,
    packets: u64,
    /// Mean time between the sending of a packet and its answer, in seconds.
    packet_seconds: Option<f64>,
}

/// The packets of a resource, as tuned.
#[derive(Serialize)]
struct PacketLine {
    packets: u64,
    /// Mean and largest number of units of a packet.
    units: f64,
    largest: usize,
    /// Largest number of packets in flight at once.
    window: usize,
    /// Seconds; absent for a near resource.
    round_trip: Option<f64>,
}

#[derive(Serialize)]
struct ResourceLine<'a> {
    name: &'a str,
    /// Share of the resource's time with work, 0..=1.
    occupation: f64,
    busy: f64,
    idle: f64,
    suspended: f64,
    units: u64,
    failures: u64,
    resident_bytes: u64,
    memory_bytes: Option<u64>,
    packets: PacketLine,
    cable: Option<CableLine>,
    /// Start, end, activity.
    spans: Vec<(f64, f64, &'static str)>,
}

#[derive(Serialize)]
struct BinLine {
    mean_waiting: f64,
    full: f64,
    empty: f64,
    /// Start, end, mean number of waiting units, capacity.
    steps: Vec<(f64, f64, f64, usize)>,
    /// Capacity at the end.
    capacity: usize,
}

#[derive(Serialize)]
struct IncidentLine<'a> {
    resource: String,
    fault: &'static str,
    count: u64,
    first: f64,
    last: f64,
    reason: &'a str,
}

fn seconds(at: Time) -> f64 {
    at.since(Time::ZERO).as_secs_f64()
}

const fn word(activity: Activity) -> &'static str {
    match activity {
        Activity::Idle => "idle",
        Activity::Working => "working",
        Activity::Suspended => "suspended",
        Activity::Retired => "retired",
    }
}

/// Returns the content of [`timeline_svg`](crate::timeline_svg) as a JSON object: activity of each resource, fill
/// level of the bin, and incidents. All times are in seconds; moments count from the start of the report. The
/// activities over time need [`HraConfig::spans_kept`](crate::HraConfig::spans_kept).
pub fn timeline_json(report: &HraReport) -> String {
    let resource = |resource: &ResourceReport| resource.descriptor.name.clone();
    let timeline = Timeline {
        seconds: report.uptime.as_secs_f64(),
        resources: report.resources.iter().map(line_of).collect(),
        bin: BinLine {
            mean_waiting: report.bin.mean_waiting,
            full: report.bin.full.as_secs_f64(),
            empty: report.bin.empty.as_secs_f64(),
            steps: (report.bin.steps.iter())
                .map(|step| (seconds(step.from), seconds(step.to), step.waiting, step.capacity))
                .collect(),
            capacity: report.bin_capacity,
        },
        incidents: (report.incidents.iter())
            .map(|incident| IncidentLine {
                resource: (report.resources.iter().find(|it| it.id == incident.resource))
                    .map_or_else(|| incident.resource.to_string(), resource),
                fault: incident.fault.name(),
                count: incident.count,
                first: seconds(incident.first),
                last: seconds(incident.last),
                reason: &incident.reason,
            })
            .collect(),
        expired: ExpiredLine {
            waiting: report.expiries.waiting,
            late: report.expiries.late,
            first: seconds(report.expiries.first),
            last: seconds(report.expiries.last),
        },
    };
    serde_json::to_string(&timeline).unwrap_or_default()
}

fn line_of(resource: &ResourceReport) -> ResourceLine<'_> {
    let spans = resource.spans.iter();
    ResourceLine {
        name: &resource.descriptor.name,
        occupation: resource.occupation(),
        busy: resource.busy.as_secs_f64(),
        idle: resource.idle.as_secs_f64(),
        suspended: resource.suspended.as_secs_f64(),
        units: resource.units,
        failures: resource.failures,
        resident_bytes: resource.resident_bytes,
        memory_bytes: resource.descriptor.memory_bytes,
        packets: packets_of(&resource.packets),
        cable: resource.cable.as_ref().map(cable_of),
        spans: spans.map(|span| (seconds(span.from), seconds(span.to), word(span.activity))).collect(),
    }
}

fn packets_of(packets: &PacketUse) -> PacketLine {
    PacketLine {
        packets: packets.packets,
        units: packets.mean_units(),
        largest: packets.largest,
        window: packets.window,
        round_trip: packets.round_trip.map(|time| time.as_secs_f64()),
    }
}

fn cable_of(cable: &CableUse) -> CableLine {
    CableLine {
        sent_bytes: cable.sent_bytes,
        received_bytes: cable.received_bytes,
        bandwidth_there: cable.bandwidth_there,
        bandwidth_back: cable.bandwidth_back,
        packets: cable.packets,
        packet_seconds: cable.packet_time().map(|time| time.as_secs_f64()),
    }
}
