//! Round trips: every written value is read back, and other bytes are refused.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    AgentId, BlobId, Revision,
    codec::{Codec, WIRE_VERSION},
};
use bottega_engines::Tunables;
use bottega_image::{Aov, AovSet, CHANNELS_MAX, Combine, LAYERS_MAX, Layer, Layout, Rect, Sides, Tile};
use proptest::prelude::*;
use serde::Serialize;

use super::{
    FarmCodec, WireError, digest, layout, message::ContentRecord, put_tile, put_work, put_zone, read_tile, read_work,
    take_zone, values::LIST_MAX,
};
use crate::{
    AgentRow, Bid, Choice, Credit, Cut, FarmContent, FarmValue, Goal, Holding, InputRanges, Interval, LifeCycle,
    NeighborDifference, Offer, Optimization, Order, Painting, PassedOrder, RelativePower, Report, ResultRef, Rival,
    Vote, WorkId, WorkRow, WorkSettings, ZoneId, ZoneRow, ZoneState,
};

fn rows() -> impl Strategy<Value = ZoneRow> {
    let times = (proptest::option::of(0u64..1 << 40), proptest::option::of(0u64..1 << 40));
    let choice = proptest::option::of((0u32..99, 0u32..9, 1u32..999, 0u32..64));
    let result = proptest::option::of((0u64..999, 1u32..999, any::<[u8; 32]>()));
    let place = (0u32..999, 0u32..99, 0u32..99, 1u32..99, 1u32..99);
    (place, -1e9f64..1e9, times, "[a-z@ä]{0,20}", 0usize..6, choice, result).prop_map(
        |((zone, x, y, width, height), complexity, times, name, state, choice, result)| {
            use ZoneState::{Awarded, Done, Failed, Open, Profiled, Profiling};
            let rect = Rect::new(x, y, x + width, y + height);
            let vote = |samples| Vote { agent: AgentId::new("v"), painting: painting(samples, y % 2 == 0) };
            ZoneRow {
                votes: (0..y % 3).map(vote).collect(),
                reasons: (y % 3 == 0).then(|| "r: 1 0.5".into()),
                word_of: (y % 4 == 0).then(|| AgentId::new("w")),
                time_estimated: times.0.map(Duration::from_nanos),
                time_measured: times.1.map(Duration::from_nanos),
                agent: (!name.is_empty()).then(|| AgentId::new(name)),
                state: [Open, Profiling, Profiled, Awarded, Done, Failed][state],
                choice: choice.map(|(max_depth, light_samples, samples, band)| Choice {
                    tunables: Tunables { max_depth, light_samples },
                    samples,
                    bands: Sides { left: band, top: 0, right: samples, bottom: 3 },
                }),
                result: result.map(|(fence, samples, digest)| ResultRef {
                    fence: Revision(fence),
                    samples,
                    digest: BlobId(digest),
                }),
                goal: (x % 2 == 0).then_some(y),
                error: (x % 3 == 0).then_some(f64::from(y)),
                piece: (zone % 3 == 0).then_some(rect),
                root: (zone % 3 == 0).then_some(ZoneId(x)),
                cut: (zone % 2 == 0).then_some(Cut { zone: ZoneId(y), piece: rect }),
                rival: (y % 2 == 0).then(|| Rival { agent: AgentId::new("b"), fence: Revision(u64::from(x)) }),
                ..ZoneRow::open(WorkId(7), ZoneId(zone), rect, complexity, NeighborDifference::all(0.5))
            }
        },
    )
}

fn painting(samples: u32, has_error: bool) -> Painting {
    let tunables = Tunables { max_depth: 3, light_samples: 1 };
    Painting {
        choice: Choice { tunables, samples, bands: Sides { left: 1, top: 2, right: 3, bottom: 4 } },
        result: ResultRef { fence: Revision(99), samples, digest: BlobId([3; 32]) },
        time_measured: Duration::from_millis(5),
        goal: samples,
        time_left: Duration::from_millis(2),
        busy: Duration::from_micros(1700),
        is_measured: samples.is_multiple_of(2),
        was_ready: samples.is_multiple_of(3),
        error: has_error.then_some(0.25),
    }
}

fn work(goal: Goal) -> WorkRow {
    let frame = Rect::of_size(64, 48);
    let interval = Interval { min: 0.5, max: 2.0 };
    let (tunables, optimization) = (Tunables { max_depth: 8, light_samples: 2 }, Optimization::Normal);
    WorkRow {
        work: WorkId(7),
        settings: WorkSettings { picture: frame, frame, samples: 16, goal, tunables, optimization },
        zone_count: 12,
        ranges: InputRanges { complexity_density: interval, neighbor_difference: interval, size: interval },
        features: crate::TaskFeatures { glass: 0.25, texture: 0.5, shadow: 0.125, bounces: 3.5, ..Default::default() },
    }
}

/// One of each kind, about this row.
fn contents(row: ZoneRow) -> Vec<FarmContent> {
    let (zone, fence) = (row.zone, Revision(99));
    let order =
        Order { work: Arc::new(work(Goal::Error(0.1))), row: Arc::new(row), fence, decides: fence.0.is_multiple_of(2) };
    let power = RelativePower::new(0.5);
    let offer = Offer { zone, complexity: 3.5, time_estimated: Duration::from_secs(2) };
    let report =
        |outcome| FarmContent::Report(Arc::new(Report { zone, fence, outcome, reasons: Some("r: 1 0.5".into()) }));
    let mut all = vec![
        FarmContent::Subscription { power, lanes: 2.0 },
        FarmContent::Subscribed,
        FarmContent::Unsubscription,
        FarmContent::Scene(Arc::new(work(Goal::Samples))),
        FarmContent::Scene(Arc::new(work(Goal::Time(Duration::from_secs(60))))),
        FarmContent::Analyzed(WorkId(7)),
        FarmContent::Profile(order.clone()),
        FarmContent::Offers(vec![offer; 3].into()),
        FarmContent::Bids { room: 2, bids: vec![Bid { zone, finish: Duration::from_secs(1) }] },
        FarmContent::Award(order),
        report(Ok(painting(9, true))),
        report(Err("no paint".to_owned())),
        FarmContent::Received { zone, fence },
        FarmContent::Refused { zone, fence, reason: "too late".to_owned() },
        FarmContent::Withdrawn { zone, fence },
        FarmContent::Alive { power, orders: vec![Holding { zone, fence, progress: 7 }] },
        FarmContent::LeftOut { reason: "it failed".to_owned() },
        FarmContent::Neighbors(vec![AgentId::new("agent-1"), AgentId::new("agent-2")]),
        FarmContent::Steal { own: 0.25, load: Duration::from_millis(40) },
        FarmContent::Yielded(3),
        FarmContent::HandedOver { to: AgentId::new("agent-1"), orders: vec![PassedOrder { zone, fence, kept: 0.4 }] },
        FarmContent::Nothing,
    ];
    all.extend([LifeCycle::Suspend, LifeCycle::Resume, LifeCycle::Terminate].map(FarmContent::LifeCycle));
    all
}

/// A row of each kind, with this one.
fn values(row: ZoneRow) -> Vec<FarmValue> {
    let levels = Optimization::ALL.map(|optimization| {
        let work = work(Goal::Samples);
        WorkRow { settings: WorkSettings { optimization, ..work.settings }, ..work }
    });
    let agent = AgentRow {
        credit: Credit { sum: -3.0, promised: 4.0, taken: 5.5 },
        agreed: 12,
        failures: 2,
        left_out: row.zone.0.is_multiple_of(2).then(|| "it failed".to_owned()),
        ..AgentRow::new(AgentId::new("a"), RelativePower::new(2.0), 1.0)
    };
    let mut all = vec![FarmValue::Zone(Arc::new(row)), FarmValue::Agent(Arc::new(agent))];
    all.extend(levels.map(|work| FarmValue::Work(Arc::new(work))));
    all
}

fn tile() -> Tile {
    let layer = |name: &str, channels: &str, combine| Layer {
        name: name.to_owned(),
        channels: channels.chars().map(String::from).collect(),
        combine,
    };
    let layers = vec![layer("Farbe", "RGBA", Combine::Mean), layer("Kiste №7", "Y", Combine::Pick)];
    let layout = Layout::with_layers([Aov::Albedo, Aov::Cost].into_iter().collect(), layers).expect("sound");
    let mut tile = Tile::new(Rect::new(3, 4, 9, 7), layout);
    tile.sums_mut().iter_mut().enumerate().for_each(|(i, sum)| *sum = i as f32 * 0.3 - 2.0);
    tile
}

fn written(write: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes);
    bytes
}

/// Something that happens to bytes on their way, or that somebody does to them.
#[derive(Clone, Debug)]
enum Damage {
    Cut(prop::sample::Index),
    Flip(prop::sample::Index, u8),
    Set(prop::sample::Index, u8),
    Insert(prop::sample::Index, u8),
    Remove(prop::sample::Index),
    /// A number that is as great as they get.
    Greatest(prop::sample::Index),
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<prop::sample::Index>;
    prop_oneof![
        at().prop_map(Damage::Cut),
        (at(), 0u8..8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        (at(), any::<u8>()).prop_map(|(at, byte)| Damage::Set(at, byte)),
        (at(), any::<u8>()).prop_map(|(at, byte)| Damage::Insert(at, byte)),
        at().prop_map(Damage::Remove),
        at().prop_map(Damage::Greatest),
    ]
}

fn damaged(mut bytes: Vec<u8>, all: &[Damage]) -> Vec<u8> {
    for damage in all {
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        match damage {
            Damage::Cut(at) => bytes.truncate(at.index(length)),
            Damage::Flip(at, bit) => bytes[at.index(length)] ^= 1 << bit,
            Damage::Set(at, byte) => bytes[at.index(length)] = *byte,
            Damage::Insert(at, byte) => bytes.insert(at.index(length), *byte),
            Damage::Remove(at) => _ = bytes.remove(at.index(length)),
            Damage::Greatest(at) => {
                let greatest = [[0xff; 9].as_slice(), &[1]].concat();
                bytes.splice(at.index(length)..=at.index(length), greatest);
            }
        }
    }
    bytes
}

proptest! {
    #[test]
    fn messages_rows_and_zones_of_a_journal_are_read_as_they_were_written(row in rows(), cut in any::<prop::sample::Index>()) {
        for content in contents(row.clone()) {
            let mut bytes = written(|bytes| FarmCodec.write_content(&content, bytes));
            prop_assert_eq!(FarmCodec.read_content(&bytes), Ok(content));
            // Neither less nor more is the same.
            prop_assert!(FarmCodec.read_content(&bytes[..cut.index(bytes.len())]).is_err());
            bytes.push(0);
            let trailing = WireError::Trailing { what: "the content of a message", count: 1 };
            prop_assert_eq!(FarmCodec.read_content(&bytes), Err(trailing));
        }
        for value in values(row.clone()) {
            let bytes = written(|bytes| FarmCodec.write_value(&value, bytes));
            prop_assert_eq!(FarmCodec.read_value(&bytes), Ok(value));
            prop_assert!(FarmCodec.read_value(&bytes[..cut.index(bytes.len())]).is_err());
        }
        let mut bytes = written(|bytes| put_zone(&row, bytes));
        bytes.extend([1, 2, 3]);
        prop_assert_eq!(take_zone(&bytes), Ok((row, &[1, 2, 3][..])));
    }

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        _ = FarmCodec.read_content(&bytes);
        _ = FarmCodec.read_value(&bytes);
        _ = take_zone(&bytes);
        _ = read_work(&bytes);
        _ = read_tile(&bytes);
    }

    /// Bytes that were damaged are refused, or say something that can be said: it is read again as it is.
    #[test]
    fn damaged_bytes_are_refused_or_sound(row in rows(), all in prop::collection::vec(damage(), 1..4)) {
        for content in contents(row.clone()) {
            let bytes = damaged(written(|bytes| FarmCodec.write_content(&content, bytes)), &all);
            if let Ok(read) = FarmCodec.read_content(&bytes) {
                let again = written(|bytes| FarmCodec.write_content(&read, bytes));
                prop_assert_eq!(FarmCodec.read_content(&again), Ok(read));
            }
        }
        for value in values(row) {
            let bytes = damaged(written(|bytes| FarmCodec.write_value(&value, bytes)), &all);
            if let Ok(read) = FarmCodec.read_value(&bytes) {
                let again = written(|bytes| FarmCodec.write_value(&read, bytes));
                prop_assert_eq!(FarmCodec.read_value(&again), Ok(read));
            }
        }
        let bytes = damaged(written(|bytes| put_tile(&tile(), bytes)), &all);
        if let Ok(read) = read_tile(&bytes) {
            prop_assert_eq!(read.sums().len() as u64, read.rect().area() * read.layout().stride() as u64);
        }
    }
}

/// The content of a message with a list of records, of which there may be more than are there.
fn with_list(record: &impl Serialize, announced: u64) -> Vec<u8> {
    let mut bytes = written(|bytes| layout::put(record, bytes));
    assert_eq!(bytes.pop(), Some(0), "the empty list stands last");
    layout::put(&announced, &mut bytes);
    bytes
}

#[test]
fn a_list_that_announces_more_than_there_is_costs_nothing() {
    for announced in [1, 1 << 16, 1 << 40, u64::MAX] {
        let refused = |bytes: &[u8]| {
            let read = FarmCodec.read_content(bytes);
            assert!(matches!(read, Err(WireError::Layout { .. })), "{announced}: {read:?}");
        };
        refused(&with_list(&ContentRecord::Offers(Vec::new()), announced));
        refused(&with_list(&ContentRecord::Bids { room: 1, bids: Vec::new() }, announced));
        refused(&with_list(&ContentRecord::Alive { power: 1.0, orders: Vec::new() }, announced));
    }
}

#[test]
fn what_is_longer_than_anything_that_is_written_is_refused() {
    let read = |record: &ContentRecord<'_>| FarmCodec.read_content(&written(|bytes| layout::put(record, bytes)));
    let bids = |count| ContentRecord::Bids { room: 1, bids: vec![(7, 8); count] };
    assert!(read(&bids(LIST_MAX)).is_ok());
    let (what, length) = ("the list of bids", LIST_MAX + 1);
    assert_eq!(read(&bids(length)), Err(WireError::TooLong { what, length, max: LIST_MAX }));
    let text = "x".repeat(1025);
    assert!(read(&ContentRecord::LeftOut { reason: &text[..1024] }).is_ok());
    let too_long = |what| Err(WireError::TooLong { what, length: 1025, max: 1024 });
    assert_eq!(read(&ContentRecord::LeftOut { reason: &text }), too_long("a reason"));
    // A longer name or reason is cut, not refused.
    let row = AgentRow::new(AgentId::new(text.clone()), RelativePower::REFERENCE, 1.0);
    let row = AgentRow { left_out: Some("ä".repeat(600)), ..row };
    let bytes = written(|bytes| FarmCodec.write_value(&FarmValue::Agent(Arc::new(row)), bytes));
    let Ok(FarmValue::Agent(row)) = FarmCodec.read_value(&bytes) else { panic!("it is the row of an agent") };
    assert_eq!((row.agent.name.len(), row.left_out.as_ref().map(String::len)), (1024, Some(1024)));
}

#[test]
fn numbers_that_cannot_be_computed_with_and_absurd_rectangles_are_refused() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let content =
            FarmContent::Offers([Offer { zone: ZoneId(1), complexity: value, time_estimated: Duration::ZERO }].into());
        let read = FarmCodec.read_content(&written(|bytes| FarmCodec.write_content(&content, bytes)));
        assert!(
            matches!(read, Err(WireError::NotFinite { what: "the complexity of a zone on offer", .. })),
            "{read:?}"
        );
        let row = work(Goal::Error(value));
        let read = read_work(&written(|bytes| put_work(&row, bytes)));
        assert!(matches!(read, Err(WireError::NotFinite { what: "the error goal", .. })), "{read:?}");
    }
    let rect = Rect { x0: 5, y0: 0, x1: 4, y1: 9 };
    let row = ZoneRow::open(WorkId(1), ZoneId(1), rect, 1.0, NeighborDifference::default());
    assert_eq!(take_zone(&written(|bytes| put_zone(&row, bytes))), Err(WireError::Rectangle([5, 0, 4, 9])));
}

#[test]
fn variants_that_do_not_exist_are_refused() {
    let kinds = contents(ZoneRow::open(WorkId(1), ZoneId(1), Rect::of_size(1, 1), 1.0, NeighborDifference::default()));
    let last = kinds.iter().map(|content| written(|bytes| FarmCodec.write_content(content, bytes))[0]).max();
    // Numbers from 128 up take two bytes.
    for kind in last.expect("kinds") + 1..128 {
        let read = FarmCodec.read_content(&[kind, 0, 0, 0, 0]);
        assert!(matches!(read, Err(WireError::Layout { .. })), "{kind}: {read:?}");
    }
    assert!(matches!(FarmCodec.read_value(&[3]), Err(WireError::Layout { .. })));
}

#[test]
fn a_tile_is_read_as_it_was_written_and_its_digest_sees_one_bit() {
    let mut tile = tile();
    let mut bytes = written(|bytes| put_tile(&tile, bytes));
    assert_eq!(read_tile(&bytes), Ok(tile.clone()));
    let before = digest(&tile);
    tile.sums_mut()[17] = f32::from_bits(tile.sums()[17].to_bits() ^ 1);
    assert_ne!(digest(&tile), before);
    for end in 0..bytes.len() {
        assert!(read_tile(&bytes[..end]).is_err(), "{end} bytes");
    }
    bytes[0] += 1;
    assert_eq!(read_tile(&bytes), Err(WireError::Version { found: WIRE_VERSION + 1 }));
}

#[test]
fn a_tile_of_more_layers_or_pixels_than_there_are_is_refused() {
    let read = |rect: [u32; 4], layers: usize, channels: usize| {
        let mut bytes = vec![WIRE_VERSION];
        let names: Vec<String> = (0..channels).map(|channel| channel.to_string()).collect();
        let layers: Vec<(String, &[String], u8)> =
            (0..layers).map(|layer| (layer.to_string(), &names[..], 0)).collect();
        layout::put(&(rect, AovSet::NONE.bits(), layers), &mut bytes);
        bytes.extend([0; 4 * (6 + CHANNELS_MAX)]);
        read_tile(&bytes).map(|tile| tile.layout().stride())
    };
    let one = [0, 0, 1, 1];
    assert_eq!(read(one, LAYERS_MAX, 4), Ok(6 + CHANNELS_MAX));
    for (layers, channels) in [(LAYERS_MAX + 1, 1), (LAYERS_MAX, 5), (2, 400)] {
        let refused = read(one, layers, channels);
        assert!(
            matches!(refused, Err(WireError::TooLong { .. })),
            "{layers} layers of {channels} channels: {refused:?}"
        );
    }
    assert!(matches!(read(one, 1, 0), Err(WireError::Layers(_))));
    assert!(matches!(read([0, 0, u32::MAX, u32::MAX], LAYERS_MAX, 4), Err(WireError::Sums { .. })));
    assert!(matches!(read([1, 0, 0, 1], LAYERS_MAX, 4), Err(WireError::Rectangle(_))));
}
