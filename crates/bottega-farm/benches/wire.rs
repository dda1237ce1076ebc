//! Bytes of the farm's messages and rows, and the time to write and to read one.
//!
//! `cargo bench -p bottega-farm --bench wire`
//!
//! Each kind has the values of a job with some hundred zones: times of milliseconds to minutes, revisions of five digits.
//! A message has a head as well, which is not counted.
#![allow(clippy::print_stdout)]
#![allow(clippy::disallowed_methods, reason = "a bench reads a clock")]

use std::{
    hint::black_box,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_agents::{AgentId, BlobId, Revision, codec::Codec};
use bottega_engines::Tunables;
use bottega_farm::{
    AgentRow, Bid, Choice, Credit, FarmCodec, FarmContent, FarmValue, Goal, Holding, InputRanges, Interval,
    NeighborDifference, Offer, Optimization, Order, Painting, RelativePower, Report, ResultRef, Vote, WorkId, WorkRow,
    WorkSettings, ZoneId, ZoneRow, ZoneState,
};
use bottega_image::{Rect, Sides};

const ROUNDS: u32 = 20;
const TIMES: u32 = 5_000;

fn work() -> WorkRow {
    let frame = Rect::of_size(1920, 1080);
    WorkRow {
        work: WorkId(17),
        settings: WorkSettings {
            picture: frame,
            frame,
            samples: 256,
            goal: Goal::Samples,
            tunables: Tunables { max_depth: 8, light_samples: 1 },
            optimization: Optimization::Normal,
        },
        zone_count: 380,
        features: bottega_farm::TaskFeatures::default(),
        ranges: InputRanges {
            complexity_density: Interval { min: 0.31, max: 4.7 },
            neighbor_difference: Interval { min: 0.02, max: 1.9 },
            size: Interval { min: 2304.0, max: 36864.0 },
        },
    }
}

fn painting() -> Painting {
    Painting {
        choice: Choice {
            tunables: Tunables { max_depth: 6, light_samples: 1 },
            samples: 192,
            bands: Sides { left: 3, top: 0, right: 4, bottom: 2 },
        },
        result: ResultRef { fence: Revision(48_231), samples: 192, digest: BlobId([0xa7; 32]) },
        time_measured: Duration::from_nanos(3_721_554_210),
        goal: 192,
        time_left: Duration::ZERO,
        busy: Duration::from_nanos(3_400_108_117),
        is_measured: true,
        was_ready: true,
        error: None,
    }
}

fn agent(number: u32) -> AgentId {
    AgentId::new(format!("agent-{number}@render-{number:02}.4711"))
}

fn open() -> ZoneRow {
    let sides = Sides { left: 0.2, top: 0.4, right: 1.3, bottom: 0.7 };
    let difference = NeighborDifference { mean: 0.65, sides };
    ZoneRow::open(WorkId(17), ZoneId(212), Rect::new(960, 384, 1080, 471), 12_345.678, difference)
}

fn profiled() -> ZoneRow {
    let painting = painting();
    ZoneRow {
        time_estimated: Some(Duration::from_nanos(3_512_008_117)),
        agent: Some(agent(3)),
        state: ZoneState::Profiled,
        choice: Some(painting.choice),
        result: Some(ResultRef { samples: 13, ..painting.result }),
        ..open()
    }
}

fn done() -> ZoneRow {
    let painting = painting();
    ZoneRow {
        time_measured: Some(painting.time_measured),
        agent: Some(agent(7)),
        state: ZoneState::Done,
        result: Some(painting.result),
        ..profiled()
    }
}

fn contents() -> Vec<(&'static str, FarmContent)> {
    let (zone, fence, power) = (ZoneId(212), Revision(48_231), RelativePower::new(0.73));
    let offer = |zone| Offer {
        zone: ZoneId(zone),
        complexity: 9_000.0 + 7.1 * f64::from(zone),
        time_estimated: Duration::from_nanos(1_512_008_117 + 10_007 * u64::from(zone)),
    };
    let bid = |zone| Bid { zone: ZoneId(zone), finish: Duration::from_nanos(7_512_008_117 + u64::from(zone)) };
    let order = |row: ZoneRow| Order { work: Arc::new(work()), row: Arc::new(row), fence, decides: false };
    let report =
        |outcome| FarmContent::Report(Arc::new(Report { zone, fence, outcome, reasons: Some("r: 1 0.5".into()) }));
    let profiling = ZoneRow { agent: Some(agent(7)), state: ZoneState::Profiling, ..open() };
    let awarded = ZoneRow { agent: Some(agent(7)), state: ZoneState::Awarded, ..profiled() };
    let orders = [211, 212].map(|zone| Holding { zone: ZoneId(zone), fence, progress: 1_200_000 });
    vec![
        ("subscribe", FarmContent::Subscription { power, lanes: 16.0 }),
        ("inform scene", FarmContent::Scene(Arc::new(work()))),
        ("request profile", FarmContent::Profile(order(profiling))),
        ("cfp, 1 zone", FarmContent::Offers((212..213).map(offer).collect())),
        ("cfp, 32 zones", FarmContent::Offers((200..232).map(offer).collect())),
        ("propose, 1 zone", FarmContent::Bids { room: 2, bids: (212..213).map(bid).collect() }),
        ("propose, 32 zones", FarmContent::Bids { room: 2, bids: (200..232).map(bid).collect() }),
        ("accept-proposal", FarmContent::Award(order(awarded))),
        ("inform done", report(Ok(painting()))),
        ("failure", report(Err("the engine ended with signal 9".to_owned()))),
        ("confirm", FarmContent::Received { zone, fence }),
        ("inform alive", FarmContent::Alive { power, orders: orders.to_vec() }),
        ("refuse", FarmContent::Nothing),
    ]
}

fn values() -> Vec<(&'static str, FarmValue)> {
    let votes = [1, 2].map(|number| Vote { agent: agent(number), painting: painting() }).to_vec();
    let agent_row = AgentRow {
        credit: Credit { sum: -3.25, promised: 9.5, taken: 9.75 },
        agreed: 41,
        ..AgentRow::new(agent(7), RelativePower::new(0.73), 16.0)
    };
    vec![
        ("row of a zone, open", FarmValue::Zone(Arc::new(open()))),
        ("row of a zone, profiled", FarmValue::Zone(Arc::new(profiled()))),
        ("row of a zone, done", FarmValue::Zone(Arc::new(done()))),
        ("row of a zone, two votes", FarmValue::Zone(Arc::new(ZoneRow { votes, ..done() }))),
        ("row of a work", FarmValue::Work(Arc::new(work()))),
        ("row of an agent", FarmValue::Agent(Arc::new(agent_row))),
    ]
}

/// Nanoseconds that one run takes, of the fastest round.
fn nanoseconds(mut run: impl FnMut()) -> f64 {
    let round = || {
        let begin = Instant::now();
        (0..TIMES).for_each(|_| run());
        begin.elapsed().as_secs_f64() * 1e9 / f64::from(TIMES)
    };
    std::iter::repeat_with(round).take(ROUNDS as usize).fold(f64::INFINITY, f64::min)
}

fn measure<T>(kind: &str, value: &T, write: impl Fn(&T, &mut Vec<u8>), is_read: impl Fn(&[u8]) -> bool) {
    let mut bytes = Vec::new();
    write(value, &mut bytes);
    assert!(is_read(&bytes), "{kind} cannot be read");
    let writing = nanoseconds(|| {
        let mut bytes = Vec::new();
        write(black_box(value), &mut bytes);
        black_box(&bytes);
    });
    let reading = nanoseconds(|| _ = black_box(is_read(black_box(&bytes))));
    println!("{kind:26} {:6} bytes {writing:8.0} ns to write {reading:8.0} ns to read", bytes.len());
}

fn main() {
    for (kind, content) in contents() {
        let write = |content: &_, bytes: &mut _| FarmCodec.write_content(content, bytes);
        measure(kind, &content, write, |bytes| FarmCodec.read_content(bytes).is_ok());
    }
    for (kind, value) in values() {
        let write = |value: &_, bytes: &mut _| FarmCodec.write_value(value, bytes);
        measure(kind, &value, write, |bytes| FarmCodec.read_value(bytes).is_ok());
    }
}
