//! The records of message contents.

use std::{sync::Arc, time::Duration};

use bottega_agents::Revision;
use serde::{Deserialize, Serialize};

use super::{
    error::WireError,
    row::{PaintingRecord, WorkRecord, ZoneRecord},
    values::{agent, finite, list, name, nanoseconds, reason, short_reason},
};
use crate::{Bid, FarmContent, Holding, LifeCycle, Offer, Order, PassedOrder, RelativePower, Report, WorkId, ZoneId};

/// The content of a message. The variants mirror those of [`FarmContent`] in order, except for the last.
#[derive(Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
pub(super) enum ContentRecord<'a> {
    Subscription {
        power: f64,
        lanes: f64,
    },
    Subscribed,
    Unsubscription,
    Scene(WorkRecord),
    Analyzed(u64),
    Profile(#[serde(borrow)] OrderRecord<'a>),
    Offers(Vec<OfferRecord>),
    Bids {
        room: u32,
        /// Zone, and finishing time in nanoseconds from now.
        bids: Vec<(u32, u64)>,
    },
    Award(#[serde(borrow)] OrderRecord<'a>),
    Report(#[serde(borrow)] ReportRecord<'a>),
    Received {
        zone: u32,
        fence: u64,
    },
    Refused {
        zone: u32,
        fence: u64,
        reason: &'a str,
    },
    Withdrawn {
        zone: u32,
        fence: u64,
    },
    Alive {
        power: f64,
        /// Zone, fence and progress.
        orders: Vec<(u32, u64, u64)>,
    },
    LeftOut {
        reason: &'a str,
    },
    #[serde(borrow)]
    Neighbors(Vec<&'a str>),
    Steal {
        own: f64,
        load: u64,
    },
    Yielded(u32),
    HandedOver {
        to: &'a str,
        /// Zone, fence and the share kept.
        orders: Vec<(u32, u64, f64)>,
    },
    LifeCycle(#[serde(with = "LifeCycleRecord")] LifeCycle),
    Nothing,
}

#[derive(Serialize, Deserialize)]
pub(super) struct OrderRecord<'a> {
    work: WorkRecord,
    #[serde(borrow)]
    row: ZoneRecord<'a>,
    fence: u64,
    decides: bool,
}

#[derive(Serialize, Deserialize)]
pub(super) struct OfferRecord {
    zone: u32,
    complexity: f64,
    time_estimated: u64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct ReportRecord<'a> {
    zone: u32,
    fence: u64,
    #[serde(borrow)]
    outcome: Result<PaintingRecord, &'a str>,
    reasons: Option<&'a str>,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "LifeCycle")]
enum LifeCycleRecord {
    Suspend,
    Resume,
    Terminate,
}

impl<'a> From<&'a FarmContent> for ContentRecord<'a> {
    fn from(content: &'a FarmContent) -> Self {
        match content {
            FarmContent::Subscription { power, lanes } => Self::Subscription { power: power.get(), lanes: *lanes },
            FarmContent::Subscribed => Self::Subscribed,
            FarmContent::Unsubscription => Self::Unsubscription,
            FarmContent::Scene(work) => Self::Scene((&**work).into()),
            FarmContent::Analyzed(work) => Self::Analyzed(work.0),
            FarmContent::Profile(order) => Self::Profile(order.into()),
            FarmContent::Offers(offers) => Self::Offers(offers.iter().map(Into::into).collect()),
            FarmContent::Bids { room, bids } => {
                let bids = bids.iter().map(|bid| (bid.zone.0, nanoseconds(bid.finish))).collect();
                Self::Bids { room: *room, bids }
            }
            FarmContent::Award(order) => Self::Award(order.into()),
            FarmContent::Report(report) => Self::Report((&**report).into()),
            FarmContent::Received { zone, fence } => Self::Received { zone: zone.0, fence: fence.0 },
            FarmContent::Refused { zone, fence, reason } => {
                Self::Refused { zone: zone.0, fence: fence.0, reason: short_reason(reason) }
            }
            FarmContent::Withdrawn { zone, fence } => Self::Withdrawn { zone: zone.0, fence: fence.0 },
            FarmContent::Alive { power, orders } => {
                let orders = orders.iter().map(|order| (order.zone.0, order.fence.0, order.progress)).collect();
                Self::Alive { power: power.get(), orders }
            }
            FarmContent::LeftOut { reason } => Self::LeftOut { reason: short_reason(reason) },
            FarmContent::Neighbors(agents) => Self::Neighbors(agents.iter().map(name).collect()),
            FarmContent::Steal { own, load } => Self::Steal { own: *own, load: nanoseconds(*load) },
            FarmContent::Yielded(count) => Self::Yielded(*count),
            FarmContent::HandedOver { to, orders } => {
                let orders = orders.iter().map(|it| (it.zone.0, it.fence.0, it.kept)).collect();
                Self::HandedOver { to: name(to), orders }
            }
            FarmContent::LifeCycle(change) => Self::LifeCycle(*change),
            // Messages to the platform's services stay within a process
            FarmContent::Nothing | FarmContent::Management(_) => Self::Nothing,
        }
    }
}

impl TryFrom<ContentRecord<'_>> for FarmContent {
    type Error = WireError;

    fn try_from(record: ContentRecord<'_>) -> Result<Self, WireError> {
        let read_power = |value| finite("the power of an agent", value).map(RelativePower::new);
        let token = |zone, fence| (ZoneId(zone), Revision(fence));
        Ok(match record {
            ContentRecord::Subscription { power, lanes } => {
                let lanes = finite("the number of an agent's processors", lanes)?;
                Self::Subscription { power: read_power(power)?, lanes }
            }
            ContentRecord::Subscribed => Self::Subscribed,
            ContentRecord::Unsubscription => Self::Unsubscription,
            ContentRecord::Scene(work) => Self::Scene(Arc::new(work.try_into()?)),
            ContentRecord::Analyzed(work) => Self::Analyzed(WorkId(work)),
            ContentRecord::Profile(order) => Self::Profile(order.try_into()?),
            ContentRecord::Offers(offers) => Self::Offers(list("the list of offers", offers, Offer::try_from)?),
            ContentRecord::Bids { room, bids } => {
                let bid = |(zone, finish)| Ok(Bid { zone: ZoneId(zone), finish: Duration::from_nanos(finish) });
                Self::Bids { room, bids: list("the list of bids", bids, bid)? }
            }
            ContentRecord::Award(order) => Self::Award(order.try_into()?),
            ContentRecord::Report(report) => Self::Report(Arc::new(report.try_into()?)),
            ContentRecord::Received { zone, fence } => {
                let (zone, fence) = token(zone, fence);
                Self::Received { zone, fence }
            }
            ContentRecord::Refused { zone, fence, reason: why } => {
                let (zone, fence) = token(zone, fence);
                Self::Refused { zone, fence, reason: reason(why)? }
            }
            ContentRecord::Withdrawn { zone, fence } => {
                let (zone, fence) = token(zone, fence);
                Self::Withdrawn { zone, fence }
            }
            ContentRecord::Alive { power, orders } => {
                let order = |(zone, fence, progress)| {
                    let (zone, fence) = token(zone, fence);
                    Ok(Holding { zone, fence, progress })
                };
                Self::Alive { power: read_power(power)?, orders: list("the list of orders in hand", orders, order)? }
            }
            ContentRecord::LeftOut { reason: why } => Self::LeftOut { reason: reason(why)? },
            ContentRecord::Neighbors(agents) => Self::Neighbors(list("the list of neighbors", agents, agent)?),
            ContentRecord::Steal { own, load } => {
                let own = finite("the speed of an agent", own)?;
                Self::Steal { own, load: Duration::from_nanos(load) }
            }
            ContentRecord::Yielded(count) => Self::Yielded(count),
            ContentRecord::HandedOver { to, orders } => {
                let order = |(zone, fence, kept)| {
                    let (zone, fence) = token(zone, fence);
                    let kept = finite("the share of a zone", kept)?;
                    Ok(PassedOrder { zone, fence, kept })
                };
                Self::HandedOver { to: agent(to)?, orders: list("the list of orders", orders, order)? }
            }
            ContentRecord::LifeCycle(change) => Self::LifeCycle(change),
            ContentRecord::Nothing => Self::Nothing,
        })
    }
}

impl<'a> From<&'a Order> for OrderRecord<'a> {
    fn from(order: &'a Order) -> Self {
        Self { work: (&*order.work).into(), row: (&*order.row).into(), fence: order.fence.0, decides: order.decides }
    }
}

impl TryFrom<OrderRecord<'_>> for Order {
    type Error = WireError;

    fn try_from(record: OrderRecord<'_>) -> Result<Self, WireError> {
        let (work, row) = (Arc::new(record.work.try_into()?), Arc::new(record.row.try_into()?));
        Ok(Self { work, row, fence: Revision(record.fence), decides: record.decides })
    }
}

impl From<&Offer> for OfferRecord {
    fn from(offer: &Offer) -> Self {
        let Offer { zone, complexity, time_estimated } = *offer;
        Self { zone: zone.0, complexity, time_estimated: nanoseconds(time_estimated) }
    }
}

impl TryFrom<OfferRecord> for Offer {
    type Error = WireError;

    fn try_from(record: OfferRecord) -> Result<Self, WireError> {
        let complexity = finite("the complexity of a zone on offer", record.complexity)?;
        let time_estimated = Duration::from_nanos(record.time_estimated);
        Ok(Self { zone: ZoneId(record.zone), complexity, time_estimated })
    }
}

impl<'a> From<&'a Report> for ReportRecord<'a> {
    fn from(report: &'a Report) -> Self {
        let outcome = report.outcome.as_ref().map(Into::into).map_err(|reason| short_reason(reason));
        Self {
            zone: report.zone.0,
            fence: report.fence.0,
            outcome,
            reasons: report.reasons.as_deref().map(short_reason),
        }
    }
}

impl TryFrom<ReportRecord<'_>> for Report {
    type Error = WireError;

    fn try_from(record: ReportRecord<'_>) -> Result<Self, WireError> {
        let outcome = match record.outcome {
            Ok(painting) => Ok(painting.try_into()?),
            Err(why) => Err(reason(why)?),
        };
        let reasons = record.reasons.map(reason).transpose()?.map(Into::into);
        Ok(Self { zone: ZoneId(record.zone), fence: Revision(record.fence), outcome, reasons })
    }
}
