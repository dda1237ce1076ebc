//! Contents of messages and rows of the blackboard as bytes: what goes between processes.

use std::sync::Arc;

use bottega_agents::{Revision, driver::nats::Codec};

use super::{
    Reader, WireError, get_work, get_zone, put_agent, put_duration, put_f64, put_option, put_painting, put_u32,
    put_u64, put_work, put_zone,
};
use crate::{
    AgentRow, Bid, FarmContent, FarmValue, Holding, LifeCycle, Offer, Order, RelativePower, Report, WorkId, ZoneId,
    contents::{LANGUAGE, ONTOLOGY, protocol},
};

/// Reasons longer than this are cut.
const REASON_BYTES_MAX: usize = 1 << 10;
const LIFE_CYCLES: [LifeCycle; 3] = [LifeCycle::Suspend, LifeCycle::Resume, LifeCycle::Terminate];

/// How the farm writes its messages and rows.
#[derive(Clone, Copy, Debug, Default)]
pub struct FarmCodec;

impl Codec for FarmCodec {
    type Content = FarmContent;
    type Value = FarmValue;

    fn words(&self) -> &'static [&'static str] {
        &[LANGUAGE, ONTOLOGY, protocol::CONTRACT_NET, protocol::REQUEST, protocol::SUBSCRIBE]
    }

    fn write_content(&self, content: &FarmContent, bytes: &mut Vec<u8>) {
        put_content(content, bytes);
    }

    fn read_content(&self, bytes: &[u8]) -> Option<FarmContent> {
        whole(bytes, get_content)
    }

    fn write_value(&self, value: &FarmValue, bytes: &mut Vec<u8>) {
        match value {
            FarmValue::Zone(row) => {
                bytes.push(0);
                put_zone(row, bytes);
            }
            FarmValue::Work(row) => {
                bytes.push(1);
                put_work(row, bytes);
            }
            FarmValue::Agent(row) => {
                let AgentRow { agent, power, lanes, credit, agreed, failures, left_out } = &**row;
                bytes.push(2);
                put_agent(agent, bytes);
                [power.get(), *lanes, *credit].into_iter().for_each(|value| put_f64(value, bytes));
                [*agreed, *failures].into_iter().for_each(|value| put_u32(value, bytes));
                put_option(left_out.as_deref(), bytes, put_reason);
            }
        }
    }

    fn read_value(&self, bytes: &[u8]) -> Option<FarmValue> {
        whole(bytes, |reader| {
            Ok(match reader.u8()? {
                0 => FarmValue::Zone(Arc::new(get_zone(reader)?)),
                1 => FarmValue::Work(Arc::new(get_work(reader)?)),
                2 => {
                    let agent = reader.agent()?;
                    let (power, lanes, credit) = (reader.power()?, reader.finite()?, reader.finite()?);
                    let (agreed, failures) = (reader.u32()?, reader.u32()?);
                    let left_out = reader.option(Reader::reason)?;
                    FarmValue::Agent(Arc::new(AgentRow { agent, power, lanes, credit, agreed, failures, left_out }))
                }
                _ => return Err(reader.error("a row")),
            })
        })
    }
}

/// What all of the bytes say; what they say on top of it makes them something else.
fn whole<T>(bytes: &[u8], get: impl FnOnce(&mut Reader<'_>) -> Result<T, WireError>) -> Option<T> {
    let mut reader = Reader::new(bytes);
    let read = get(&mut reader).ok()?;
    reader.is_empty().then_some(read)
}

fn put_content(content: &FarmContent, bytes: &mut Vec<u8>) {
    match content {
        FarmContent::Subscription { power, lanes } => {
            bytes.push(0);
            put_f64(power.get(), bytes);
            put_f64(*lanes, bytes);
        }
        FarmContent::Subscribed => bytes.push(1),
        FarmContent::Unsubscription => bytes.push(2),
        FarmContent::Scene(work) => {
            bytes.push(3);
            put_work(work, bytes);
        }
        FarmContent::Analyzed(work) => {
            bytes.push(4);
            put_u64(work.0, bytes);
        }
        FarmContent::Profile(order) => put_order(5, order, bytes),
        FarmContent::Offers(offers) => {
            bytes.push(6);
            put_u32(offers.len() as u32, bytes);
            for Offer { zone, complexity, time_estimated } in offers.iter() {
                put_u32(zone.0, bytes);
                put_f64(*complexity, bytes);
                put_duration(*time_estimated, bytes);
            }
        }
        FarmContent::Bids { room, bids } => {
            bytes.push(7);
            put_u32(*room, bytes);
            put_u32(bids.len() as u32, bytes);
            for Bid { zone, finish } in bids {
                put_u32(zone.0, bytes);
                put_duration(*finish, bytes);
            }
        }
        FarmContent::Award(order) => put_order(8, order, bytes),
        FarmContent::Report(report) => put_report(report, bytes),
        FarmContent::Received { zone, fence } => put_hand(10, *zone, *fence, bytes),
        FarmContent::Refused { zone, fence, reason } => {
            put_hand(11, *zone, *fence, bytes);
            put_reason(reason, bytes);
        }
        FarmContent::Withdrawn { zone, fence } => put_hand(12, *zone, *fence, bytes),
        FarmContent::Alive { power, hands } => {
            bytes.push(13);
            put_f64(power.get(), bytes);
            put_u32(hands.len() as u32, bytes);
            for Holding { zone, fence, progress } in hands {
                put_u32(zone.0, bytes);
                put_u64(fence.0, bytes);
                put_u64(*progress, bytes);
            }
        }
        FarmContent::LifeCycle(change) => {
            bytes.push(14);
            bytes.push(LIFE_CYCLES.iter().position(|known| known == change).unwrap_or_default() as u8);
        }
        FarmContent::Nothing => bytes.push(15),
        FarmContent::LeftOut { reason } => {
            bytes.push(16);
            put_reason(reason, bytes);
        }
    }
}

fn get_content(reader: &mut Reader<'_>) -> Result<FarmContent, WireError> {
    Ok(match reader.u8()? {
        0 => FarmContent::Subscription { power: reader.power()?, lanes: reader.finite()? },
        1 => FarmContent::Subscribed,
        2 => FarmContent::Unsubscription,
        3 => FarmContent::Scene(Arc::new(get_work(reader)?)),
        4 => FarmContent::Analyzed(WorkId(reader.u64()?)),
        5 => FarmContent::Profile(get_order(reader)?),
        6 => {
            let offer = |reader: &mut Reader<'_>| {
                let (zone, complexity) = (ZoneId(reader.u32()?), reader.finite()?);
                Ok(Offer { zone, complexity, time_estimated: reader.duration()? })
            };
            FarmContent::Offers(reader.list(offer)?.into())
        }
        7 => {
            let room = reader.u32()?;
            let bids = reader.list(|reader| Ok(Bid { zone: ZoneId(reader.u32()?), finish: reader.duration()? }))?;
            FarmContent::Bids { room, bids }
        }
        8 => FarmContent::Award(get_order(reader)?),
        9 => FarmContent::Report(Arc::new(get_report(reader)?)),
        10 => FarmContent::Received { zone: ZoneId(reader.u32()?), fence: Revision(reader.u64()?) },
        11 => {
            let (zone, fence) = (ZoneId(reader.u32()?), Revision(reader.u64()?));
            FarmContent::Refused { zone, fence, reason: reader.reason()? }
        }
        12 => FarmContent::Withdrawn { zone: ZoneId(reader.u32()?), fence: Revision(reader.u64()?) },
        13 => {
            let power = reader.power()?;
            let hands = reader.list(|reader| {
                let (zone, fence) = (ZoneId(reader.u32()?), Revision(reader.u64()?));
                Ok(Holding { zone, fence, progress: reader.u64()? })
            })?;
            FarmContent::Alive { power, hands }
        }
        14 => {
            let index = usize::from(reader.u8()?);
            let change = LIFE_CYCLES.get(index).ok_or_else(|| reader.error("a change of life"))?;
            FarmContent::LifeCycle(*change)
        }
        15 => FarmContent::Nothing,
        16 => FarmContent::LeftOut { reason: reader.reason()? },
        _ => return Err(reader.error("a message")),
    })
}

fn put_hand(kind: u8, zone: ZoneId, fence: Revision, bytes: &mut Vec<u8>) {
    bytes.push(kind);
    put_u32(zone.0, bytes);
    put_u64(fence.0, bytes);
}

fn put_reason(reason: &str, bytes: &mut Vec<u8>) {
    let reason = &reason.as_bytes()[..reason.floor_char_boundary(REASON_BYTES_MAX)];
    put_u32(reason.len() as u32, bytes);
    bytes.extend(reason);
}

fn put_order(kind: u8, order: &Order, bytes: &mut Vec<u8>) {
    bytes.push(kind);
    put_work(&order.work, bytes);
    put_zone(&order.row, bytes);
    put_u64(order.fence.0, bytes);
}

fn get_order(reader: &mut Reader<'_>) -> Result<Order, WireError> {
    let (work, row) = (Arc::new(get_work(reader)?), Arc::new(get_zone(reader)?));
    Ok(Order { work, row, fence: Revision(reader.u64()?) })
}

fn put_report(report: &Report, bytes: &mut Vec<u8>) {
    put_hand(9, report.zone, report.fence, bytes);
    match &report.outcome {
        Ok(painting) => {
            bytes.push(1);
            put_painting(painting, bytes);
        }
        Err(reason) => {
            bytes.push(0);
            put_reason(reason, bytes);
        }
    }
}

fn get_report(reader: &mut Reader<'_>) -> Result<Report, WireError> {
    let (zone, fence) = (ZoneId(reader.u32()?), Revision(reader.u64()?));
    let outcome = match reader.u8()? {
        1 => Ok(reader.painting()?),
        0 => Err(reader.reason()?),
        _ => return Err(reader.error("an outcome")),
    };
    Ok(Report { zone, fence, outcome })
}

impl Reader<'_> {
    fn power(&mut self) -> Result<RelativePower, WireError> {
        self.finite().map(RelativePower::new)
    }

    fn reason(&mut self) -> Result<String, WireError> {
        self.text("a reason", REASON_BYTES_MAX)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bottega_agents::{AgentId, bus::BlobId};
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};
    use proptest::prelude::*;

    use super::{super::tests::rows, *};
    use crate::{
        Choice, Goal, InputRanges, Interval, Optimization, Painting, ResultRef, WorkRow, WorkSettings, ZoneRow,
    };

    fn work() -> WorkRow {
        let frame = Rect::of_size(64, 48);
        let interval = Interval { min: 0.5, max: 2.0 };
        WorkRow {
            work: WorkId(7),
            settings: WorkSettings {
                picture: frame,
                frame,
                samples: 16,
                goal: Goal::Error(0.1),
                tunables: Tunables { max_depth: 8, light_samples: 2 },
                optimization: Optimization::Normal,
            },
            zone_count: 12,
            ranges: InputRanges { complexity_density: interval, neighbor_difference: interval, size: interval },
        }
    }

    /// One of each kind, about this row.
    fn contents(row: ZoneRow) -> Vec<FarmContent> {
        let (zone, fence) = (row.zone, Revision(99));
        let order = Order { work: Arc::new(work()), row: Arc::new(row), fence };
        let bands = Sides { left: 1, top: 2, right: 3, bottom: 4 };
        let painting = Painting {
            choice: Choice { tunables: Tunables { max_depth: 3, light_samples: 1 }, samples: 9, bands },
            result: ResultRef { fence, samples: 9, digest: BlobId([7; 32]) },
            time_measured: Duration::from_millis(5),
            goal: 12,
            time_left: Duration::from_millis(2),
            error: Some(0.25),
        };
        let power = RelativePower::new(0.5);
        let offer = Offer { zone, complexity: 3.5, time_estimated: Duration::from_secs(2) };
        let mut all = vec![
            FarmContent::Subscription { power, lanes: 2.0 },
            FarmContent::Subscribed,
            FarmContent::Unsubscription,
            FarmContent::Scene(Arc::new(work())),
            FarmContent::Analyzed(WorkId(7)),
            FarmContent::Profile(order.clone()),
            FarmContent::Offers(vec![offer; 3].into()),
            FarmContent::Bids { room: 2, bids: vec![Bid { zone, finish: Duration::from_secs(1) }] },
            FarmContent::Award(order),
            FarmContent::Report(Arc::new(Report { zone, fence, outcome: Ok(painting) })),
            FarmContent::Report(Arc::new(Report { zone, fence, outcome: Err("no paint".to_owned()) })),
            FarmContent::Received { zone, fence },
            FarmContent::Refused { zone, fence, reason: "too late".to_owned() },
            FarmContent::Withdrawn { zone, fence },
            FarmContent::Alive { power, hands: vec![Holding { zone, fence, progress: 7 }] },
            FarmContent::LeftOut { reason: "it failed".to_owned() },
            FarmContent::Nothing,
        ];
        all.extend(LIFE_CYCLES.map(FarmContent::LifeCycle));
        all
    }

    proptest! {
        #[test]
        fn contents_and_rows_are_read_as_they_were_written(row in rows(), cut in any::<prop::sample::Index>()) {
            for content in contents(row.clone()) {
                let mut bytes = Vec::new();
                FarmCodec.write_content(&content, &mut bytes);
                prop_assert_eq!(FarmCodec.read_content(&bytes), Some(content));
                // Neither less nor more is the same.
                prop_assert_eq!(FarmCodec.read_content(&bytes[..cut.index(bytes.len())]), None);
                bytes.push(0);
                prop_assert_eq!(FarmCodec.read_content(&bytes), None);
            }
            let agent = AgentRow {
                credit: -3.0,
                agreed: 12,
                failures: 2,
                left_out: (cut.index(2) == 0).then(|| "it failed".to_owned()),
                ..AgentRow::new(AgentId::new("a"), RelativePower::new(2.0), 1.0)
            };
            let values = [FarmValue::Zone(Arc::new(row)), FarmValue::Work(Arc::new(work())), FarmValue::Agent(Arc::new(agent))];
            for value in values {
                let mut bytes = Vec::new();
                FarmCodec.write_value(&value, &mut bytes);
                prop_assert_eq!(FarmCodec.read_value(&bytes), Some(value));
            }
        }

        #[test]
        fn no_bytes_make_the_codec_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            _ = FarmCodec.read_content(&bytes);
            _ = FarmCodec.read_value(&bytes);
        }
    }
}
