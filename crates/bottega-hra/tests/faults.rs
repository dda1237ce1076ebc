//! Faults of resources: they cost time, and never an answer.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use crate::support::{Gate, custom, double, quick, unit, within_reason};
use bottega_hra::{
    Activity, DataId, Failed, Fault, Hra, HraConfig, HraReport, Lane, Link, Packet, Primitive, PrimitiveSet, Resource,
    ResourceDescriptor, SubmitError, UnitError, VirtualCpu, Window, WindowedResource, Work, WorkUnit,
};

use Primitive::{Intersect, PixelBlock};

fn fault_count(report: &HraReport, fault: Fault) -> u64 {
    report.incidents.iter().filter(|incident| incident.fault == fault).map(|incident| incident.count).sum()
}

#[test]
fn what_hangs_is_done_elsewhere_and_its_late_answer_is_dropped() {
    within_reason(|| {
        let (gate, hung) = (Gate::default(), Arc::new(AtomicBool::new(false)));
        let (lane_gate, lane_hung) = (gate.clone(), Arc::clone(&hung));
        let stuck = custom("stuck", PrimitiveSet::ALL, move |job| {
            if !lane_hung.swap(true, Ordering::SeqCst) {
                lane_gate.pass();
            }
            Ok(double(job))
        });
        let config = HraConfig { hang_min: Duration::from_millis(5), hang_max: Duration::from_millis(20), ..quick() };
        let hra = Hra::new(config, vec![stuck]);
        let client = hra.client();
        client.submit(unit(1, PixelBlock)).unwrap();
        while hra.report().resources[0].activity != Activity::Suspended {
            thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(fault_count(&hra.report(), Fault::Hung), 1);
        assert!(client.take_timeout(Duration::from_millis(5)).is_none(), "nobody else could do it");
        gate.open(); // It returns, is requested to recover, and does the unit a second time: that answer counts.
        assert_eq!(client.take().unwrap().output, Ok(2));
        assert!(client.take().is_none());
        assert_eq!(hra.report().resources[0].units, 1);
    });
}

#[test]
fn an_allocator_with_a_resource_that_hangs_can_be_dropped() {
    within_reason(|| {
        let gate = Gate::default();
        let lane_gate = gate.clone();
        let stuck = custom("stuck", PrimitiveSet::ALL, move |job| {
            lane_gate.pass();
            Ok(double(job))
        });
        let config = HraConfig { hang_min: Duration::from_millis(5), hang_max: Duration::from_millis(20), ..quick() };
        let hra = Hra::new(config, vec![stuck]);
        let client = hra.client();
        client.submit(unit(1, PixelBlock)).unwrap();
        drop(hra);
        assert_eq!(client.take().unwrap().output, Err(UnitError::Closed));
        gate.open();
    });
}

/// A far device that answers this many units, and then nothing: no packet, no call to recover, no end.
struct DeadResource {
    answers: usize,
    gate: Gate,
    kept: Vec<Packet<crate::support::Job>>,
    /// Packets that were given up when it was requested to recover.
    given_up: Arc<AtomicU64>,
}

impl WindowedResource<crate::support::Job> for DeadResource {
    fn descriptor(&self) -> ResourceDescriptor {
        let link = Link { latency: Duration::from_micros(10), bandwidth: 1e9 };
        ResourceDescriptor { name: "dead".into(), primitives: PrimitiveSet::ALL, memory_bytes: None, link }
    }
    fn send(&mut self, packet: Packet<crate::support::Job>) {
        assert!(packet.reply.is_awaited());
        let Some(left) = self.answers.checked_sub(packet.works.len()) else {
            self.answers = 0;
            return self.kept.push(packet);
        };
        self.answers = left;
        packet.reply.send(packet.works.into_iter().map(|job| Ok(double(job))).collect());
    }
    fn recover(&mut self) -> Result<(), String> {
        let given_up = self.kept.iter().filter(|packet| !packet.reply.is_awaited()).count();
        self.given_up.fetch_add(given_up as u64, Ordering::SeqCst);
        self.gate.pass();
        Ok(())
    }
}

impl Drop for DeadResource {
    fn drop(&mut self) {
        self.gate.pass();
    }
}

#[test]
fn nobody_waits_for_a_device_that_hangs_for_ever_neither_for_the_last_units_nor_at_the_end() {
    for answers in [0, 1, 200] {
        within_reason(move || {
            let gate = Gate::default();
            let patience = Duration::from_secs(3600);
            let window = Window { patience, ..Window::default() };
            let given_up = Arc::default();
            let dead = DeadResource { answers, gate: gate.clone(), kept: Vec::new(), given_up: Arc::clone(&given_up) };
            let near = custom("near", PrimitiveSet::ALL, |job| {
                thread::sleep(Duration::from_micros(50));
                Ok(double(job))
            });
            let config = HraConfig { hang_min: Duration::from_millis(20), hang_max: patience, ..quick() };
            let hra = Hra::with_lanes(config, vec![Lane::Direct(near), Lane::Windowed(Box::new(dead), window)]);
            let client = hra.client();
            client.submit_group((0..2000).map(|n| unit(n, PixelBlock)).collect()).unwrap();
            let done: Vec<_> = std::iter::from_fn(|| client.take()).collect();
            assert_eq!(done.iter().filter(|answer| answer.output == Ok(2 * answer.ticket)).count(), 2000);
            let report = hra.report();
            let missed = fault_count(&report, Fault::Hung) + fault_count(&report, Fault::Doubted);
            assert!(missed > 0, "{answers} answers");
            while given_up.load(Ordering::SeqCst) == 0 {
                thread::sleep(Duration::from_millis(1)); // Until it is requested to recover.
            }
            let begun = std::time::Instant::now();
            drop(hra);
            assert!(begun.elapsed() < Duration::from_secs(1), "waited for {:?}", begun.elapsed());
            gate.open(); // Lets the thread go.
        });
    }
}

/// A far device that needs preparation before its first packet.
struct UnreadyResource {
    is_ready: bool,
    gate: Gate,
    given_back: Arc<AtomicU64>,
}

impl WindowedResource<crate::support::Job> for UnreadyResource {
    fn descriptor(&self) -> ResourceDescriptor {
        let link = Link { latency: Duration::from_micros(10), bandwidth: 1e9 };
        ResourceDescriptor { name: "unready".into(), primitives: PrimitiveSet::ALL, memory_bytes: None, link }
    }
    fn send(&mut self, packet: Packet<crate::support::Job>) {
        if !self.is_ready {
            self.given_back.fetch_add(1, Ordering::SeqCst);
            return packet.reply.not_ready(packet.works);
        }
        packet.reply.send(packet.works.into_iter().map(|job| Ok(double(job))).collect());
    }
    fn recover(&mut self) -> Result<(), String> {
        self.gate.pass();
        self.is_ready = true;
        Ok(())
    }
}

#[test]
fn a_device_that_makes_itself_ready_is_not_to_blame_and_is_waited_for_as_long_as_it_takes() {
    within_reason(|| {
        let (gate, given_back) = (Gate::default(), Arc::new(AtomicU64::new(0)));
        let unready = UnreadyResource { is_ready: false, gate: gate.clone(), given_back: Arc::clone(&given_back) };
        // The time that a packet may take: long enough for a thread on a busy computer
        let patience = Duration::from_millis(200);
        let window = Window { patience, ..Window::default() };
        let config = HraConfig { hang_min: patience, hang_max: patience, ..quick() };
        let hra = Hra::with_lanes(config, vec![Lane::Windowed(Box::new(unready), window)]);
        let client = hra.client();
        client.submit_group((0..100).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        while given_back.load(Ordering::SeqCst) == 0 {
            thread::sleep(Duration::from_millis(1));
        }
        assert!(client.take_timeout(2 * patience).is_none(), "nobody else could do it");
        gate.open();
        let done: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert!(done.len() == 100 && done.iter().all(|answer| answer.output == Ok(2 * answer.ticket)));
        let report = hra.report();
        assert_eq!(
            fault_count(&report, Fault::Refused) + fault_count(&report, Fault::Died),
            0,
            "{:?}",
            report.incidents
        );
        assert_eq!(report.resources[0].failures, 0);
    });
}

#[test]
fn a_device_that_hangs_when_it_is_torn_down_is_waited_for_a_moment_only() {
    within_reason(|| {
        let gate = Gate::default();
        let dead = DeadResource { answers: usize::MAX, gate: gate.clone(), kept: Vec::new(), given_up: Arc::default() };
        let hra = Hra::with_lanes(quick(), vec![Lane::Windowed(Box::new(dead), Window::default())]);
        let client = hra.client();
        client.submit(unit(1, PixelBlock)).unwrap();
        assert_eq!(client.take().unwrap().output, Ok(2));
        let begun = std::time::Instant::now();
        drop(hra);
        assert!(begun.elapsed() < Duration::from_secs(10), "waited for {:?}", begun.elapsed());
        gate.open();
    });
}

/// Work that can be checked for garbage, and needs data.
#[derive(Clone)]
struct Checked {
    number: u64,
    data: u64,
}

impl Work for Checked {
    type Output = Vec<u64>;
    fn primitive(&self) -> Primitive {
        Intersect
    }
    fn size(&self) -> u64 {
        3
    }
    fn data(&self) -> Option<DataId> {
        Some(DataId(self.data))
    }
    fn data_bytes(&self) -> u64 {
        self.data
    }
    fn backup(&self) -> Option<Self> {
        Some(self.clone())
    }
    fn check(output: &Vec<u64>, size: u64) -> Result<(), String> {
        if output.len() as u64 == size { Ok(()) } else { Err(format!("{} of {size} numbers", output.len())) }
    }
}

#[test]
fn garbage_is_noticed_and_done_again() {
    within_reason(|| {
        let calls = Arc::new(AtomicU64::new(0));
        let lane = move |work: Checked| {
            let length = if calls.fetch_add(1, Ordering::SeqCst).is_multiple_of(3) { 2 } else { 3 };
            vec![work.number; length]
        };
        let hra = Hra::new(HraConfig { max_attempts: 10, ..quick() }, VirtualCpu::lanes(2, lane));
        let client = hra.client();
        let units = (0..60).map(|number| WorkUnit::new(Checked { number, data: 1 }, number));
        client.submit_group(units.collect()).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert_eq!(answers.len(), 60);
        assert!(answers.iter().all(|answer| answer.output == Ok(vec![answer.ticket; 3])));
        let report = hra.report();
        assert!(fault_count(&report, Fault::Garbage) > 0);
        assert!(report.incidents.iter().any(|incident| incident.reason == "2 of 3 numbers"), "{:?}", report.incidents);
    });
}

/// A board with little memory, which records the data that it was ordered to evict.
struct Board {
    memory_bytes: u64,
    held: Vec<u64>,
    log: Arc<Mutex<Vec<u64>>>,
}

impl Resource<Checked> for Board {
    fn descriptor(&self) -> ResourceDescriptor {
        let primitives = PrimitiveSet::from([Intersect]);
        let memory_bytes = Some(self.memory_bytes);
        ResourceDescriptor { name: "board".into(), primitives, memory_bytes, link: Link::LOCAL }
    }
    fn perform(&mut self, work: Checked) -> Result<Vec<u64>, Failed<Checked>> {
        if !self.held.contains(&work.data) {
            self.held.push(work.data);
        }
        assert!(self.held.iter().sum::<u64>() <= self.memory_bytes, "more than fits");
        Ok(vec![work.number; 3])
    }
    fn evict(&mut self, data: DataId) {
        self.held.retain(|&held| held != data.0);
        self.log.lock().unwrap().push(data.0);
    }
}

#[test]
fn data_goes_when_its_place_is_needed_and_what_never_fits_is_done_elsewhere() {
    within_reason(|| {
        let log = Arc::default();
        let board = Board { memory_bytes: 10, held: Vec::new(), log: Arc::clone(&log) };
        let hra = Hra::new(quick(), vec![Box::new(board) as Box<dyn Resource<Checked>>]);
        let client = hra.client();
        let too_large = client.submit(WorkUnit::new(Checked { number: 0, data: 11 }, 0));
        assert_eq!(too_large, Err(SubmitError::TooLarge { primitive: Intersect, bytes: 11 }));
        for (number, data) in [4, 5, 4, 6].into_iter().enumerate() {
            client.submit(WorkUnit::new(Checked { number: number as u64, data }, number as u64)).unwrap();
            assert!(client.take().unwrap().output.is_ok());
        }
        assert_eq!(*log.lock().unwrap(), [5], "the least recently used");
        assert_eq!(hra.report().resources[0].resident_bytes, 10);

        let board = Board { memory_bytes: 10, held: Vec::new(), log: Arc::default() };
        let roomy = VirtualCpu::lanes(1, |work: Checked| vec![work.number; 3]).remove(0);
        let hra = Hra::new(quick(), vec![Box::new(board) as Box<dyn Resource<Checked>>, roomy]);
        let client = hra.client();
        client.submit_group((0..20).map(|n| WorkUnit::new(Checked { number: n, data: 11 }, n)).collect()).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert!(answers.iter().all(|answer| answer.output.is_ok() && answer.resource.is_some_and(|id| id.0 == 1)));
        assert_eq!(answers.len(), 20);
    });
}

/// A device with memory for this many units at once.
struct CrampedResource {
    units_max: usize,
    largest: Arc<AtomicU64>,
}

impl WindowedResource<crate::support::Job> for CrampedResource {
    fn descriptor(&self) -> ResourceDescriptor {
        let link = Link { latency: Duration::from_millis(1), bandwidth: 1e9 };
        ResourceDescriptor { name: "cramped".into(), primitives: PrimitiveSet::ALL, memory_bytes: None, link }
    }
    fn send(&mut self, packet: Packet<crate::support::Job>) {
        if packet.works.len() > self.units_max {
            return packet.reply.out_of_memory(packet.works);
        }
        self.largest.fetch_max(packet.works.len() as u64, Ordering::SeqCst);
        thread::sleep(Duration::from_micros(300)); // What a packet costs, so that large ones are requested.
        packet.reply.send(packet.works.into_iter().map(|job| Ok(double(job))).collect());
    }
}

#[test]
fn a_resource_without_memory_for_so_much_gets_less_at_once() {
    within_reason(|| {
        let largest = Arc::default();
        let cramped = CrampedResource { units_max: 3, largest: Arc::clone(&largest) };
        let lane = Lane::Windowed(Box::new(cramped), Window::default());
        let hra = Hra::with_lanes(quick(), vec![lane]);
        let client = hra.client();
        client.submit_group((0..400).map(|n| unit(n, PixelBlock)).collect()).unwrap();
        let answers: Vec<_> = std::iter::from_fn(|| client.take()).collect();
        assert_eq!(answers.iter().filter(|answer| answer.output == Ok(2 * answer.ticket)).count(), 400);
        assert!(fault_count(&hra.report(), Fault::OutOfMemory) > 0);
        assert!((2..=3).contains(&largest.load(Ordering::SeqCst)));
    });
}

#[test]
fn a_unit_that_waits_too_long_is_answered_as_expired_at_its_time() {
    within_reason(|| {
        let gate = Gate::default();
        let lane_gate = gate.clone();
        let lane = custom("gated", PrimitiveSet::ALL, move |job| {
            lane_gate.pass();
            Ok(double(job))
        });
        let hra = Hra::new(quick(), vec![lane]);
        let client = hra.client();
        client.submit(unit(0, PixelBlock)).unwrap();
        while hra.report().resources[0].activity != Activity::Working {
            thread::sleep(Duration::from_micros(100));
        }
        client.submit(WorkUnit { validity: Duration::from_millis(5), ..unit(1, PixelBlock) }).unwrap();
        client.submit(unit(2, PixelBlock)).unwrap();
        // The only resource is busy, so the watch notices it.
        let answer = client.take().unwrap();
        assert_eq!((answer.ticket, answer.output), (1, Err(UnitError::Expired)));
        assert!(answer.waited >= Duration::from_millis(5));
        gate.open();
        assert_eq!(client.take().unwrap().output, Ok(0));
        assert_eq!(client.take().unwrap().output, Ok(4));
        // Begun in time and done too late.
        let slow = custom("slow", PrimitiveSet::ALL, |job| {
            thread::sleep(Duration::from_millis(10));
            Ok(double(job))
        });
        let hra = Hra::new(quick(), vec![slow]);
        let client = hra.client();
        client.submit(WorkUnit { validity: Duration::from_millis(5), ..unit(1, PixelBlock) }).unwrap();
        assert_eq!(client.take().unwrap().output, Err(UnitError::Expired));
    });
}
