//! The policy as a whole, event by event.

use std::time::Duration;

use super::cable::CableBytes;
use super::core::{Core, FollowUps, Next, PacketLanding};
use super::faults::GiveUp;
use super::incident::Fault;
use super::time::Time;
use super::unit::{Chunk, Data, Meta, Unit};
use crate::simulate::{Load, Model, simulate};
use crate::{CostBook, DataId, HraConfig, Link, Primitive, PrimitiveSet, ResourceDescriptor, ResourceId, Window};

use Primitive::{Intersect, Occluded, PixelBlock};

const A: ResourceId = ResourceId(0);
const B: ResourceId = ResourceId(1);

fn ms(ms: u64) -> Time {
    Time::at(Duration::from_millis(ms))
}

fn near(name: &str, primitives: PrimitiveSet, memory_bytes: Option<u64>) -> (ResourceDescriptor, Option<Window>) {
    (ResourceDescriptor { name: name.to_owned(), primitives, memory_bytes, link: Link::LOCAL }, None)
}

fn core(resources: &[PrimitiveSet]) -> Core<u64> {
    let named = resources.iter().zip(["a", "b"]).map(|(&set, name)| near(name, set, None)).collect();
    Core::new(HraConfig::default(), named, &CostBook::new(""))
}

fn meta(primitive: Primitive, priority: i32, delay_ms: u64) -> Meta {
    Meta {
        primitive,
        size: 1,
        bytes: CableBytes::default(),
        data: None,
        priority,
        submitted: Time::ZERO,
        late: ms(delay_ms),
        expires: Time::NEVER,
        attempts: 0,
        failed_on: Vec::new(),
    }
}

fn submit(core: &mut Core<u64>, load: u64, meta: Meta) {
    core.submit(Time::ZERO, Chunk::new(Unit { meta, load }, false), &mut FollowUps::default());
}

/// Has `id` do one packet in no time; returns its units.
fn serve(core: &mut Core<u64>, id: ResourceId, now: Time) -> Vec<u64> {
    let mut out = FollowUps::default();
    let Next::Packet(packet) = core.next(now, id, &mut out) else { return Vec::new() };
    let loads: Vec<u64> = packet.units.iter().map(|unit| unit.load).collect();
    let busy = Some(Duration::from_millis(1));
    let landing = PacketLanding { done: loads.len(), done_items: loads.len() as u64, busy, ..PacketLanding::default() };
    core.landed(now, id, packet.sequence, landing, &mut out).expect("it was under way");
    loads
}

/// The units that `id` does, in order.
fn order(core: &mut Core<u64>, id: ResourceId, now: Time) -> Vec<u64> {
    let mut all = Vec::new();
    loop {
        let some = serve(core, id, now);
        if some.is_empty() {
            return all;
        }
        all.extend(some);
    }
}

#[test]
fn priority_goes_first_until_a_unit_is_late() {
    let filled = || {
        let mut core = core(&[PrimitiveSet::ALL]);
        for (load, priority, delay_ms) in [(0, 0, 50), (1, 0, 40), (2, 7, 5_000), (3, 7, 5_000)] {
            submit(&mut core, load, meta(Intersect, priority, delay_ms));
        }
        core
    };
    assert_eq!(order(&mut filled(), A, Time::ZERO), [2, 3, 0, 1]);
    // Once both have waited too long they go first, the one that is late for longest before the other.
    assert_eq!(order(&mut filled(), A, ms(60)), [1, 0, 2, 3]);
}

#[test]
fn who_can_do_everything_leaves_the_work_of_who_can_do_little() {
    let mut core = core(&[PrimitiveSet::ALL, PrimitiveSet::from([Intersect])]);
    for (load, primitive, priority) in [(0, Intersect, 0), (1, PixelBlock, 0), (2, Intersect, 1)] {
        submit(&mut core, load, meta(primitive, priority, 1_000));
    }
    assert_eq!(serve(&mut core, A, Time::ZERO), [2]);
    assert_eq!(serve(&mut core, A, Time::ZERO), [1]);
}

#[test]
fn a_partial_resource_takes_only_what_it_can_do() {
    let mut core = core(&[PrimitiveSet::from([Occluded]), PrimitiveSet::ALL]);
    submit(&mut core, 0, meta(PixelBlock, 9, 0));
    submit(&mut core, 1, meta(Occluded, 0, 1_000));
    assert_eq!(order(&mut core, A, ms(5_000)), [1]);
    assert_eq!(core.waiting(), 1);
}

#[test]
fn a_failed_unit_returns_to_the_resource_that_failed_only_when_all_others_failed_too() {
    let mut core = core(&[PrimitiveSet::ALL, PrimitiveSet::ALL]);
    let mut out = FollowUps::default();
    let unit = Unit { meta: meta(Intersect, 0, 1_000), load: 0 };
    assert!(core.give_back(Time::ZERO, A, unit, true, &mut out).is_none());
    assert!(serve(&mut core, A, Time::ZERO).is_empty());
    let Next::Packet(packet) = core.next(Time::ZERO, B, &mut out) else { panic!("the other resource may try") };
    let landing =
        PacketLanding { failed: 1, fault: Some((Fault::Refused, "no".to_owned())), ..PacketLanding::default() };
    core.landed(Time::ZERO, B, packet.sequence, landing, &mut out);
    let unit = packet.units.into_iter().next().expect("a unit");
    assert!(core.give_back(Time::ZERO, B, unit.clone(), true, &mut out).is_none());
    assert_eq!(serve(&mut core, A, Time::ZERO), [0]);
    // Three attempts are the most.
    let twice = Unit { meta: Meta { attempts: 2, ..unit.meta }, load: 0 };
    assert!(matches!(core.give_back(Time::ZERO, A, twice, true, &mut out), Some((_, GiveUp::Failed))));
}

#[test]
fn what_is_resident_goes_first_among_equals() {
    let mut core = Core::new(HraConfig::default(), vec![near("a", PrimitiveSet::ALL, Some(10))], &CostBook::new(""));
    for (load, data) in [(0, 1), (1, 2), (2, 1), (3, 2), (4, 1)] {
        let data = Some(Data { id: DataId(data), bytes: 6 });
        submit(&mut core, load, Meta { data, ..meta(Intersect, 0, 1_000) });
    }
    assert_eq!(order(&mut core, A, Time::ZERO), [0, 2, 4, 1, 3], "each set of data travels once");
}

#[test]
fn cancelling_leaves_the_rest_in_order() {
    let mut core = core(&[PrimitiveSet::ALL]);
    for load in 0..6 {
        submit(&mut core, load, meta(if load % 2 == 0 { Occluded } else { Intersect }, 0, 1_000));
    }
    let out = core.cancel(|unit| unit.meta.primitive == Occluded);
    assert_eq!(out.iter().map(|unit| unit.load).collect::<Vec<_>>(), [0, 2, 4]);
    // No cancelled unit may remain among the late ones.
    assert_eq!(order(&mut core, A, ms(9_000)), [1, 3, 5]);
}

#[test]
fn who_declines_a_unit_wakes_who_is_sooner() {
    let mut book = CostBook::new("");
    for (name, ns) in [("a", 1e6), ("b", 1e8)] {
        book.set(name, Intersect, crate::CostModel::known(100, 100, 0.0, ns, 0.0));
    }
    let resources = vec![near("a", PrimitiveSet::ALL, None), near("b", PrimitiveSet::ALL, None)];
    let mut core = Core::new(HraConfig::default(), resources, &book);
    let mut out = FollowUps::default();
    assert!(matches!(core.next(Time::ZERO, A, &mut out), Next::Wait(None)));
    assert!(matches!(core.next(Time::ZERO, B, &mut out), Next::Wait(None)));
    submit(&mut core, 0, meta(Intersect, 0, 60_000)); // Wakes the fast one, which has not requested work yet.
    assert!(matches!(core.next(Time::ZERO, B, &mut out), Next::Wait(Some(_))), "the fast one would be sooner");
    assert_eq!(serve(&mut core, A, Time::ZERO), [0]);
}

/// Two resources that wait to be woken, and know what a unit costs.
fn dozing(unit_ns: f64) -> Core<u64> {
    let mut book = CostBook::new("");
    for name in ["a", "b"] {
        book.set(name, Intersect, crate::CostModel::known(100, 100, 0.0, unit_ns, 0.0));
    }
    let resources = vec![near("a", PrimitiveSet::ALL, None), near("b", PrimitiveSet::ALL, None)];
    let mut core = Core::new(HraConfig::default(), resources, &book);
    for id in [A, B] {
        assert!(matches!(core.next(Time::ZERO, id, &mut FollowUps::default()), Next::Wait(None)));
    }
    core
}

/// Submits units in one chunk; returns the resources woken.
fn submit_many(core: &mut Core<u64>, count: u64) -> Vec<ResourceId> {
    let mut chunk = Chunk::new(Unit { meta: meta(Intersect, 0, 60_000), load: 0 }, false);
    (1..count).for_each(|load| chunk.push(Unit { meta: meta(Intersect, 0, 60_000), load }));
    let mut out = FollowUps::default();
    core.submit(Time::ZERO, chunk, &mut out);
    out.wake
}

#[test]
fn large_units_wake_a_resource_each() {
    assert_eq!(submit_many(&mut dozing(1e7), 2), [A, B]);
}

#[test]
fn small_units_wake_a_resource_a_packet_and_who_takes_one_has_the_rest_fetched() {
    let mut core = dozing(10.0);
    assert!(core.listens());
    assert_eq!(submit_many(&mut core, 100), [A]);
    assert!(!core.listens(), "one is on its way, and will see what comes meanwhile");
    assert_eq!(submit_many(&mut core, 100), []);
    let mut out = FollowUps::default();
    assert!(matches!(core.next(Time::ZERO, A, &mut out), Next::Packet(_)));
    assert_eq!(out.wake, [B], "the first packet was small, for nobody knew better");
}

#[test]
fn who_was_woken_and_takes_something_else_has_others_woken_for_what_it_leaves() {
    let mut core = dozing(1e7);
    assert_eq!(submit_many(&mut core, 1), [A]);
    let mut out = FollowUps::default();
    core.submit(Time::ZERO, Chunk::new(Unit { meta: meta(Intersect, 9, 60_000), load: 7 }, false), &mut out);
    assert_eq!(out.wake, [], "the one on its way may do it");
    let Next::Packet(packet) = core.next(Time::ZERO, A, &mut out) else { panic!("there is work") };
    assert_eq!((packet.units[0].load, out.wake.as_slice()), (7, [B].as_slice()));
    assert_eq!(serve(&mut core, B, Time::ZERO), [0]);
}

/// The maximum number of packets in flight, and of round trips, for a board with this latency and speed.
fn window(latency_ms: u64, ns_per_item: f64) -> (f64, f64) {
    let link = Link { latency: Duration::from_millis(latency_ms), bandwidth: f64::INFINITY };
    let model = Model::far("far", ns_per_item, link);
    let load = Load::batch(8_000, 10, &[Intersect]);
    let outcome = simulate(HraConfig::default(), &[model], &load, &CostBook::new(""), 3);
    let ideal = 8_000.0 * 10.0 * ns_per_item * 1e-9;
    // Little's law: the number in flight is the rate times the time in flight.
    let answers = outcome.answers.iter().flatten();
    let away = |answer: &crate::simulate::AnsweredUnit| {
        answer.at.since(answer.submitted.after(answer.waited.unwrap_or_default())).as_secs_f64()
    };
    let under_way = answers.map(away).sum::<f64>() / outcome.end.since(Time::ZERO).as_secs_f64();
    (outcome.end.since(Time::ZERO).as_secs_f64() / ideal, under_way * 10.0 * ns_per_item * 1e-9)
}

#[test]
fn the_window_is_little_more_than_a_round_trip_and_keeps_the_resource_busy() {
    for (latency_ms, ns_per_item) in [(1, 1e5), (10, 1e5), (50, 1e5), (5, 1e6), (50, 5e5)] {
        let (time, work_under_way) = window(latency_ms, ns_per_item);
        let round_trip = 2e-3 * latency_ms as f64 + 10.0 * ns_per_item * 1e-9;
        assert!(time < 1.06, "latency {latency_ms} ms: {time} of the time at full speed");
        assert!(
            work_under_way < 1.7 * round_trip + 20.0 * ns_per_item * 1e-9,
            "latency {latency_ms} ms: {work_under_way} s of work under way for a round trip of {round_trip} s"
        );
    }
}

/// The traffic on the cable of a board of this bandwidth that does 20,000 units of 3,200 bytes, and the number of units it did.
/// Computing takes a thirtieth of the time of sending at 100 MB/s; handing over a packet is expensive.
fn cable(bandwidth: f64, beside: Option<Model>, units: usize) -> (crate::CableUse, u64, f64) {
    let link = Link { latency: Duration::from_micros(100), bandwidth };
    let board = Model { time_per_packet: Duration::from_micros(300), ..Model::far("board", 10.0, link) };
    let mut load = Load::batch(units, 100, &[Intersect]);
    for arrival in &mut load.arrivals {
        (arrival.payload_bytes, arrival.answer_bytes) = (3_200, 2_000);
    }
    let models: Vec<Model> = [board].into_iter().chain(beside).collect();
    let outcome = simulate(HraConfig::default(), &models, &load, &CostBook::new(""), 5);
    assert_eq!(outcome.done(), units);
    let board = &outcome.report.resources[0];
    (board.cable.expect("a board has a cable"), board.units, outcome.end.since(Time::ZERO).as_secs_f64())
}

#[test]
fn a_slower_cable_gets_smaller_packets_and_is_kept_busy() {
    let bytes_of_a_packet = [1e8, 1e7, 1e6].map(|bandwidth| {
        let (used, units, seconds) = cable(bandwidth, None, 20_000);
        let sent = 3_200.0 * units as f64;
        assert_eq!(used.sent_bytes as f64, sent);
        assert!((used.bandwidth_there.unwrap() / bandwidth - 1.0).abs() < 0.01, "{used:?}");
        assert!(seconds < 1.1 * sent / bandwidth, "{seconds} s for {} s of sending", sent / bandwidth);
        // Three are under way, and each occupies the cable for some 10 ms.
        let away = used.packet_time().expect("there were packets");
        assert!(away < Duration::from_millis(50), "{bandwidth}: a packet was away for {away:?}");
        sent / used.packets as f64
    });
    for (bytes, bandwidth) in bytes_of_a_packet.into_iter().zip([1e8, 1e7, 1e6]) {
        assert!((0.4..1.05).contains(&(bytes / (0.01 * bandwidth))), "{bytes_of_a_packet:?}");
    }
}

#[test]
fn who_is_behind_a_cable_that_takes_longer_than_the_processors_is_left_alone() {
    // The processor does all within 0.1 s; the bytes of one unit take 0.52 s there and back.
    let (used, units, _) = cable(1e4, Some(Model::near("cpu", 1_000.0)), 1_000);
    assert_eq!((units, used.sent_bytes), (0, 0));
    let (_, units, seconds) = cable(1e8, Some(Model::near("cpu", 1_000.0)), 1_000);
    assert!(units > 500 && seconds < 0.06, "{units} units by a fast one, {seconds} s");
}

#[test]
fn what_a_near_resource_had_no_time_for_is_not_carried_a_long_way() {
    let link = Link { latency: Duration::from_millis(1), bandwidth: 1e5 };
    let far = ResourceDescriptor { name: "b".to_owned(), primitives: PrimitiveSet::ALL, memory_bytes: None, link };
    let resources = vec![near("a", PrimitiveSet::ALL, None), (far, Some(Window::default()))];
    let mut core = Core::new(HraConfig::default(), resources, &CostBook::new(""));
    let mut out = FollowUps::default();
    let bytes = CableBytes { there: 100_000, back: 0 };
    let unit = Unit { meta: Meta { bytes, ..meta(Intersect, 0, 60_000) }, load: 7 };
    assert!(core.give_back(Time::ZERO, A, unit.clone(), false, &mut out).is_none());
    assert!(order(&mut core, B, Time::ZERO).is_empty());
    assert_eq!(order(&mut core, A, Time::ZERO), [7]);
    // A unit that failed on the near resource is sent to the far one.
    assert!(core.give_back(Time::ZERO, A, unit, true, &mut out).is_none());
    assert_eq!(order(&mut core, B, Time::ZERO), [7]);
}

#[test]
fn units_past_their_life_time_are_reported() {
    let mut core = core(&[PrimitiveSet::ALL]);
    let mut out = FollowUps::default();
    for (load, expires) in [(0, ms(10)), (1, ms(20)), (2, Time::NEVER), (3, Time::NEVER)] {
        submit(&mut core, load, Meta { expires, ..meta(Intersect, 0, 60_000) });
    }
    core.tick(ms(12), &mut out);
    core.expire(ms(15), |unit| unit.load == 3, &mut out);
    assert_eq!(out.expired.iter().map(|unit| unit.load).collect::<Vec<_>>(), [0, 3]);
    assert_eq!(order(&mut core, A, ms(25)), [2], "nobody does the others");
    let expiries = core.expiries();
    assert_eq!((expiries.waiting, expiries.late, expiries.first, expiries.last), (3, 0, ms(12), ms(25)));
}

#[test]
fn a_packet_that_takes_far_longer_than_expected_is_doubted_when_all_wait_for_it() {
    let mut book = CostBook::new("");
    for (name, ns) in [("a", 1e7), ("b", 1e6)] {
        book.set(name, Intersect, crate::CostModel::known(100, 100, 0.0, ns, 0.0));
    }
    let far = ResourceDescriptor {
        name: "b".to_owned(),
        primitives: PrimitiveSet::ALL,
        memory_bytes: None,
        link: Link { latency: Duration::from_millis(1), bandwidth: f64::INFINITY },
    };
    let resources = vec![near("a", PrimitiveSet::ALL, None), (far, Some(Window::default()))];
    let mut core = Core::new(HraConfig::default(), resources, &book);
    let mut out = FollowUps::default();
    submit(&mut core, 0, meta(Intersect, 0, 60_000));
    let Next::Packet(packet) = core.next(Time::ZERO, B, &mut out) else { panic!("it would be done with it first") };
    let look = core.next_event(Time::ZERO).expect("it is looked at");
    assert!((ms(100)..ms(300)).contains(&look), "{look:?}");
    core.tick(look, &mut out);
    assert_eq!(out.doubtful, [(B, packet.sequence)]);
}
