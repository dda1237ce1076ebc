//! The promises of the allocator, one per test.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::{Gate, Job, custom, double, hush_injected_panics, quick, unit, within_reason};
use bottega_hra::{
    Activity, Completed, Failed, Hra, HraConfig, Lane, Link, Packet, Primitive, PrimitiveSet, ResourceDescriptor,
    SubmitError, TrySubmit, UnitError, VirtualCpu, Window, WindowedResource, WorkUnit,
};

use Primitive::{Intersect, Occluded, PixelBlock};

/// One lane that waits at a gate before each unit, and records its units.
fn gated(capacity: usize) -> (Hra<Job>, Gate, Arc<Mutex<Vec<u64>>>) {
    let (gate, log) = (Gate::default(), Arc::new(Mutex::new(Vec::new())));
    let (lane_gate, lane_log) = (gate.clone(), Arc::clone(&log));
    let lane = custom("gated", PrimitiveSet::ALL, move |job| {
        lane_gate.pass();
        lane_log.lock().unwrap().push(job.number);
        Ok(double(job))
    });
    (Hra::new(HraConfig { bin_capacity: capacity, ..quick() }, vec![lane]), gate, log)
}

/// Waits until the only lane has taken the only unit.
fn wait_until_under_way(hra: &Hra<Job>) {
    while hra.report().pending > 0 || hra.report().resources[0].activity != Activity::Working {
        thread::sleep(Duration::from_micros(100));
    }
}

#[test]
fn a_full_bin_makes_the_submitter_wait() {
    within_reason(|| {
        let (hra, gate, _) = gated(2);
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        client.submit_group(vec![unit(1, PixelBlock), unit(2, PixelBlock)]).unwrap();
        assert!(matches!(client.try_submit(unit(9, PixelBlock)), Err(TrySubmit::Full(back)) if back.ticket == 9));
        let submitter = client.clone();
        let submitting = thread::spawn(move || submitter.submit_group((3..40).map(|n| unit(n, PixelBlock)).collect()));
        thread::sleep(Duration::from_millis(20));
        assert!(!submitting.is_finished(), "a bin of 2 took 40 units");
        gate.open();
        submitting.join().unwrap().unwrap();
        let mut tickets: Vec<_> = std::iter::from_fn(|| client.take()).map(|answer| answer.ticket).collect();
        tickets.sort_unstable();
        assert_eq!(tickets, (0..40).collect::<Vec<_>>());
    });
}

#[test]
fn a_unit_that_no_resource_can_do_is_refused_at_once() {
    let lane = custom("partial", PrimitiveSet::from([Intersect]), |job| Ok(double(job)));
    let hra = Hra::new(quick(), vec![lane]);
    let client = hra.client();
    assert_eq!(client.submit(unit(0, PixelBlock)), Err(SubmitError::Unsupported(PixelBlock)));
    let group = vec![unit(0, Intersect), unit(1, Occluded)];
    assert_eq!(client.submit_group(group), Err(SubmitError::Unsupported(Occluded)));
    assert!(matches!(client.try_submit(unit(3, Occluded)), Err(TrySubmit::Refused { unit, .. }) if unit.ticket == 3));
    assert_eq!(client.outstanding(), 0);
    assert!(client.take().is_none());
    let empty = Hra::<Job>::new(quick(), Vec::new());
    assert_eq!(empty.client().submit(unit(0, Intersect)), Err(SubmitError::Unsupported(Intersect)));
}

#[test]
fn partial_resources_do_their_part_and_hold_up_nothing() {
    within_reason(|| {
        let lanes = vec![
            custom("rays only", PrimitiveSet::from([Intersect]), |job| {
                assert_eq!(job.primitive, Intersect);
                Ok(double(job))
            }),
            custom("all", PrimitiveSet::ALL, |job| Ok(double(job))),
        ];
        let hra = Hra::new(HraConfig { bin_capacity: 8, ..quick() }, lanes);
        let client = hra.client();
        let primitives = Primitive::ALL.into_iter().cycle();
        client.submit_group((0..500).zip(primitives).map(|(n, primitive)| unit(n, primitive)).collect()).unwrap();
        let done = std::iter::from_fn(|| client.take()).filter(|answer| answer.output == Ok(2 * answer.ticket)).count();
        assert_eq!(done, 500);
    });
}

#[test]
fn priority_decides_among_what_waits() {
    within_reason(|| {
        let (hra, gate, log) = gated(100);
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        let priorities = [0, 5, -3, 5, 9];
        let units = priorities.into_iter().zip(1..).map(|(priority, n)| WorkUnit { priority, ..unit(n, PixelBlock) });
        client.submit_group(units.collect()).unwrap();
        gate.open();
        while client.take().is_some() {}
        assert_eq!(*log.lock().unwrap(), [0, 5, 2, 4, 1, 3]);
    });
}

#[test]
fn a_unit_past_its_maximum_delay_goes_before_any_priority() {
    within_reason(|| {
        let (hra, gate, log) = gated(100);
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        client.submit(WorkUnit { max_delay: Duration::from_millis(5), ..unit(1, PixelBlock) }).unwrap();
        let urgent = (2..10).map(|n| WorkUnit { priority: 100, ..unit(n, PixelBlock) });
        client.submit_group(urgent.collect()).unwrap();
        thread::sleep(Duration::from_millis(10));
        gate.open();
        while client.take().is_some() {}
        assert_eq!(log.lock().unwrap()[..2], [0, 1]);
    });
}

#[test]
fn a_stream_of_urgent_units_starves_nobody() {
    within_reason(|| {
        let config = HraConfig { bin_capacity: 4, max_delay_bound: Duration::from_millis(20), ..quick() };
        let hra = Hra::new(config, VirtualCpu::lanes(1, double));
        let (patient, urgent) = (hra.client(), hra.client());
        let feeder = urgent.clone();
        let stop = Arc::new(AtomicU64::new(0));
        let stopped = Arc::clone(&stop);
        let feeding = thread::spawn(move || {
            while stopped.load(Ordering::Relaxed) == 0 {
                feeder.submit(WorkUnit { priority: i32::MAX, ..unit(1, PixelBlock) }).unwrap();
                while feeder.outstanding() > 3 {
                    feeder.take();
                }
            }
        });
        patient.submit(WorkUnit { priority: i32::MIN, ..unit(7, PixelBlock) }).unwrap();
        assert_eq!(patient.take().map(|answer| answer.output), Some(Ok(14)));
        stop.store(1, Ordering::Relaxed);
        feeding.join().unwrap();
    });
}

#[test]
fn cancelling_gives_back_what_waits_and_answers_what_is_under_way() {
    within_reason(|| {
        let (hra, gate, log) = gated(100);
        let (client, other) = (hra.client(), hra.client());
        client.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        client.submit_group((1..6).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        other.submit(unit(50, PixelBlock)).unwrap();
        let cancelled: Vec<_> = client.cancel_pending().into_iter().map(|unit| unit.ticket).collect();
        assert_eq!(cancelled, [1, 2, 3, 4, 5]);
        assert_eq!(client.outstanding(), 1);
        gate.open();
        assert_eq!(client.take().map(|answer| answer.ticket), Some(0));
        assert!(client.take().is_none());
        assert_eq!(other.take().map(|answer| answer.ticket), Some(50));
        assert_eq!(*log.lock().unwrap(), [0, 50]);
    });
}

#[test]
fn what_fails_in_one_place_is_done_in_another() {
    hush_injected_panics();
    within_reason(|| {
        let lanes = vec![
            custom("refuses", PrimitiveSet::ALL, |work| Err(Failed { work, reason: "broken".into() })),
            custom("panics", PrimitiveSet::ALL, |_| panic!("injected")),
            custom("works", PrimitiveSet::ALL, |job| {
                thread::sleep(Duration::from_micros(100)); // So that the others have time to fail.
                Ok(double(job))
            }),
        ];
        let hra = Hra::new(quick(), lanes);
        let client = hra.client();
        client.submit_group((0..300).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        let mut done = 0;
        while let Some(Completed { ticket, output, resource, .. }) = client.take() {
            assert_eq!(output, Ok(2 * ticket));
            assert_eq!(resource.map(|resource| resource.0), Some(2));
            done += 1;
        }
        assert_eq!(done, 300);
        let report = hra.report();
        assert_eq!(report.resources.iter().map(|resource| resource.units).collect::<Vec<_>>(), [0, 0, 300]);
        assert!(report.resources[0].failures + report.resources[1].failures > 0);
    });
}

#[test]
fn a_unit_that_fails_everywhere_is_answered_as_failed() {
    within_reason(|| {
        let broken = |work: Job| Err(Failed { work, reason: "broken".into() });
        let hra = Hra::new(
            HraConfig { max_attempts: 5, ..quick() },
            vec![custom("a", PrimitiveSet::ALL, broken), custom("b", PrimitiveSet::ALL, broken)],
        );
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        let answer = client.take().unwrap();
        assert_eq!(answer.output, Err(UnitError::Failed { attempts: 5, reason: "broken".into() }));
        assert!(client.take().is_none());
    });
}

#[test]
fn a_unit_without_backup_is_answered_as_lost_when_its_resource_panics() {
    hush_injected_panics();
    within_reason(|| {
        let hra = Hra::new(quick(), vec![custom("panics", PrimitiveSet::ALL, |_| panic!("injected"))]);
        let client = hra.client();
        client.submit(WorkUnit::new(Job { number: 1, primitive: Occluded, has_backup: false }, 1)).unwrap();
        let output = client.take().unwrap().output;
        assert_eq!(output, Err(UnitError::Lost { reason: "panicked: injected".into() }));
    });
}

#[test]
fn a_resource_that_never_recovers_is_given_up_and_its_units_are_answered() {
    within_reason(|| {
        let config = HraConfig { max_failures: 4, max_attempts: 3, ..quick() };
        let lanes = vec![
            custom("dead", PrimitiveSet::from([Intersect]), |work| Err(Failed { work, reason: "dead".into() })),
            custom("alive", PrimitiveSet::from([PixelBlock]), |job| Ok(double(job))),
        ];
        let hra = Hra::new(config, lanes);
        let client = hra.client();
        client.submit_group((0..20).map(|n| unit(n, Intersect)).collect()).unwrap();
        client.submit(unit(20, PixelBlock)).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert_eq!(answers.len(), 21);
        let orphans = answers.iter().filter(|answer| answer.output == Err(UnitError::NoResource(Intersect))).count();
        assert_eq!(orphans, 19, "one was tried three times; the fourth failure was the last");
        assert_eq!(hra.report().resources[0].activity, Activity::Retired);
        assert_eq!(client.submit(unit(0, Intersect)), Err(SubmitError::Unsupported(Intersect)));
        client.submit(unit(0, PixelBlock)).unwrap();
        assert_eq!(client.take().unwrap().output, Ok(0));
    });
}

#[test]
fn a_resource_comes_back_after_its_pause() {
    within_reason(|| {
        let mut left_to_fail = 3;
        let lane = custom("flaky", PrimitiveSet::ALL, move |work| {
            if left_to_fail > 0 {
                left_to_fail -= 1;
                return Err(Failed { work, reason: "not yet".into() });
            }
            Ok(double(work))
        });
        let config = HraConfig { max_attempts: 10, pause_min: Duration::from_millis(4), ..quick() };
        let hra = Hra::new(HraConfig { pause_max: Duration::from_millis(8), ..config }, vec![lane]);
        let client = hra.client();
        let start = Instant::now();
        client.submit(unit(21, PixelBlock)).unwrap();
        assert_eq!(client.take().unwrap().output, Ok(42));
        assert!(start.elapsed() >= Duration::from_millis(4 + 8 + 8));
        assert!(hra.report().resources[0].suspended >= Duration::from_millis(20));
    });
}

#[test]
fn dropping_the_allocator_answers_everyone_and_frees_who_waits() {
    within_reason(|| {
        let (hra, gate, _) = gated(1);
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        client.submit(unit(1, PixelBlock)).unwrap();
        let submitter = client.clone();
        let submitting = thread::spawn(move || submitter.submit_group(vec![unit(2, PixelBlock), unit(3, PixelBlock)]));
        thread::sleep(Duration::from_millis(10));
        let dropping = thread::spawn(move || drop(hra));
        assert_eq!(submitting.join().unwrap(), Err(SubmitError::Closed(bottega_hra::Closed)));
        gate.open();
        dropping.join().unwrap();
        let mut answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        answers.sort_by_key(|answer| answer.ticket);
        assert_eq!(answers.len(), 2);
        assert_eq!(answers[0].output, Ok(0));
        assert_eq!(answers[1].output, Err(UnitError::Closed));
        assert!(matches!(client.submit(unit(4, PixelBlock)), Err(SubmitError::Closed(_))));
    });
}

#[test]
fn dropping_a_client_frees_its_place_in_the_bin() {
    within_reason(|| {
        let (hra, gate, log) = gated(3);
        let (gone, stays) = (hra.client(), hra.client());
        gone.submit(unit(0, PixelBlock)).unwrap();
        wait_until_under_way(&hra);
        gone.submit_group((1..4).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        drop(gone);
        assert_eq!(hra.report().pending, 0);
        stays.submit_group((10..13).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        gate.open();
        assert_eq!(std::iter::from_fn(|| stays.take()).count(), 3);
        assert_eq!(*log.lock().unwrap(), [0, 10, 11, 12]);
    });
}

#[test]
fn a_unit_may_drop_the_last_handle_of_its_own_allocator() {
    within_reason(|| {
        let slot: Arc<Mutex<Option<Hra<Job>>>> = Arc::default();
        let lane_slot = Arc::clone(&slot);
        let hra = Hra::new(
            quick(),
            vec![custom("suicidal", PrimitiveSet::ALL, move |job| {
                while lane_slot.lock().unwrap().take().is_none() {
                    thread::yield_now();
                }
                Ok(double(job))
            })],
        );
        let client = hra.client();
        client.submit(unit(4, PixelBlock)).unwrap();
        *slot.lock().unwrap() = Some(hra);
        assert_eq!(client.take().unwrap().output, Ok(8));
    });
}

#[test]
fn units_may_follow_from_answers() {
    within_reason(|| {
        let hra = Hra::new(HraConfig { bin_capacity: 4, ..quick() }, VirtualCpu::lanes(3, double));
        let client = hra.client();
        client.submit(unit(1, PixelBlock)).unwrap();
        let mut last = 0;
        while let Some(answer) = client.take() {
            last = answer.output.unwrap();
            if last < 1 << 40 {
                client.submit(unit(last, PixelBlock)).unwrap();
            }
        }
        assert_eq!(last, 1 << 40);
    });
}

#[test]
fn taking_with_a_timeout_returns_in_time() {
    within_reason(|| {
        let (hra, gate, _) = gated(10);
        let client = hra.client();
        assert!(client.take_timeout(Duration::MAX).is_none(), "nothing is outstanding");
        client.submit(unit(0, PixelBlock)).unwrap();
        let start = Instant::now();
        assert!(client.take_timeout(Duration::from_millis(10)).is_none());
        assert!(start.elapsed() >= Duration::from_millis(10));
        assert_eq!(client.outstanding(), 1);
        gate.open();
        assert!(client.take_timeout(Duration::MAX).is_some());
    });
}

#[test]
fn the_report_tells_what_was_done_and_what_it_cost() {
    within_reason(|| {
        let hra = Hra::new(
            quick(),
            vec![custom("slow", PrimitiveSet::ALL, |job| {
                thread::sleep(Duration::from_millis(2));
                Ok(double(job))
            })],
        );
        let client = hra.client();
        client.submit_group(vec![unit(0, Intersect), unit(1, Intersect), unit(2, PixelBlock)]).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert!(answers.iter().all(|answer| answer.busy >= Duration::from_millis(2)));
        assert!(answers[2].waited >= Duration::from_millis(4));
        let report = hra.report();
        let lane = &report.resources[0];
        assert_eq!((lane.units, lane.failures), (3, 0));
        assert!(lane.busy >= Duration::from_millis(6) && lane.busy + lane.idle <= report.uptime);
        let primitives: Vec<_> = lane.costs.iter().map(|(primitive, cost)| (*primitive, cost.units())).collect();
        assert_eq!(primitives, [(Intersect, 2), (PixelBlock, 1)]);
        // Both sizes slept equally long: a fixed cost, and none per item worth speaking of.
        let predicted = lane.costs[0].1.predict(1).unwrap();
        assert!(predicted >= Duration::from_micros(1_900), "{predicted:?}");
    });
}

/// A resource that answers each packet after a while, and counts the packets that wait for an answer.
struct Distant {
    waiting: Arc<AtomicU64>,
    most: Arc<AtomicU64>,
}

impl WindowedResource<Job> for Distant {
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: "distant".into(),
            primitives: PrimitiveSet::ALL,
            memory_bytes: None,
            link: Link { latency: Duration::from_millis(4), bandwidth: 1e9 },
        }
    }
    fn send(&mut self, packet: Packet<Job>) {
        let waiting = Arc::clone(&self.waiting);
        self.most.fetch_max(1 + waiting.fetch_add(1, Ordering::Relaxed), Ordering::Relaxed);
        thread::spawn(move || {
            thread::sleep(Duration::from_millis(4));
            waiting.fetch_sub(1, Ordering::Relaxed);
            packet.reply.send(packet.works.into_iter().map(|job| Ok(double(job))).collect());
        });
    }
}

#[test]
fn a_window_hides_the_latency_of_a_far_resource() {
    within_reason(|| {
        let most = Arc::new(AtomicU64::new(0));
        let distant = Distant { waiting: Arc::default(), most: Arc::clone(&most) };
        let window = Window { packets: 16, units_per_packet: 2, ..Window::default() };
        let hra = Hra::with_lanes(quick(), vec![Lane::Windowed(Box::new(distant), window)]);
        let client = hra.client();
        client.submit_group((0..30).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        assert_eq!(std::iter::from_fn(|| client.take()).filter(|answer| answer.output.is_ok()).count(), 30);
        // A lane without a window has one packet under way.
        let most = most.load(Ordering::Relaxed);
        assert!((4..=16).contains(&most), "at most {most} packets were under way");
    });
}

/// A resource that loses every other packet.
struct Leaky {
    swallowed: Vec<Packet<Job>>,
}

impl WindowedResource<Job> for Leaky {
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: "leaky".into(),
            primitives: PrimitiveSet::ALL,
            memory_bytes: None,
            link: Link::LOCAL,
        }
    }
    fn send(&mut self, packet: Packet<Job>) {
        if packet.sequence % 2 == 1 {
            self.swallowed.push(packet);
        } else {
            packet.reply.send(packet.works.into_iter().map(|job| Ok(double(job))).collect());
        }
    }
}

#[test]
fn packets_without_an_answer_are_done_again() {
    within_reason(|| {
        let window =
            Window { packets: 3, units_per_packet: 2, patience: Duration::from_millis(3), ..Window::default() };
        let lanes = vec![
            Lane::Windowed(Box::new(Leaky { swallowed: Vec::new() }), window),
            Lane::Direct(custom("good", PrimitiveSet::ALL, |job| {
                thread::sleep(Duration::from_micros(200));
                Ok(double(job))
            })),
        ];
        let hra = Hra::with_lanes(quick(), lanes);
        let client = hra.client();
        client.submit_group((0..60).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert_eq!(answers.len(), 60);
        assert!(answers.iter().all(|answer| answer.output == Ok(2 * answer.ticket)));
        assert!(hra.report().resources[0].failures > 0);
    });
}
