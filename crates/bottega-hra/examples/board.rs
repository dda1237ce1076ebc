//! An example of a board that a stranger adds: it squares numbers in packets, behind a link, with little memory.
//!
//! `cargo run -p bottega-hra --example board > board.svg` has it work beside two lanes of the processor, tells on
//! standard error what each did, and draws the time lines. `docs/hra.md` explains the steps.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use std::collections::BTreeSet;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

use bottega_hra::{
    DataId, Hra, HraConfig, Lane, Link, Packet, Primitive, PrimitiveSet, ResourceDescriptor, VirtualCpu, Window,
    WindowedResource, Work, WorkUnit, timeline_svg,
};

/// 1. The work: a batch of numbers, on one of a few tables. It refers to data, and can be copied for a second try.
#[derive(Clone)]
struct Squares {
    numbers: Vec<u64>,
    table: u64,
}

impl Work for Squares {
    type Output = Vec<u64>;
    fn primitive(&self) -> Primitive {
        Primitive::Intersect
    }
    fn size(&self) -> u64 {
        self.numbers.len() as u64
    }
    fn payload_bytes(&self) -> u64 {
        8 * self.size()
    }
    fn data(&self) -> Option<DataId> {
        Some(DataId(self.table))
    }
    fn data_bytes(&self) -> u64 {
        1 << 20
    }
    fn backup(&self) -> Option<Self> {
        Some(self.clone())
    }
    fn check(output: &Vec<u64>, size: u64) -> Result<(), String> {
        if output.len() as u64 == size { Ok(()) } else { Err("numbers are missing".to_owned()) }
    }
}

fn square(work: Squares) -> Vec<u64> {
    work.numbers.into_iter().map(|n| n.wrapping_mul(n)).collect()
}

/// 2. The board: here a thread behind a channel. Of a real one this would be its driver.
struct Board {
    far_end: Sender<Packet<Squares>>,
    tables: BTreeSet<u64>,
}

impl Board {
    fn new() -> Self {
        let (far_end, packets) = channel();
        thread::spawn(move || serve(&packets));
        Self { far_end, tables: BTreeSet::new() }
    }
}

/// The far end: 100 µs for each packet, 2 ns for each number. It answers whenever it is done; a packet that it drops
/// counts as lost, and is done elsewhere.
fn serve(packets: &Receiver<Packet<Squares>>) {
    for Packet { works, reply, .. } in packets {
        let items: u64 = works.iter().map(Work::size).sum();
        let busy = Duration::from_micros(100) + Duration::from_nanos(2 * items);
        thread::sleep(busy);
        // Who knows how long it was at work says so; else it is concluded from the time between answers.
        reply.send_timed(works.into_iter().map(|work| Ok(square(work))).collect(), busy);
    }
}

/// 3. What the allocator asks of it.
impl WindowedResource<Squares> for Board {
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: "board".to_owned(),
            primitives: PrimitiveSet::from([Primitive::Intersect]), // It can do a part only.
            memory_bytes: Some(3 << 20),                            // Room for three of the tables.
            link: Link { latency: Duration::from_micros(50), bandwidth: 4e9 },
        }
    }

    fn send(&mut self, packet: Packet<Squares>) {
        self.tables.extend(packet.works.iter().map(|work| work.table)); // Here they would be copied over.
        assert!(self.tables.len() <= 3, "the allocator has kept to the memory");
        // If the far end is gone, the packet is dropped, and with it its reply: lost.
        let _ = self.far_end.send(packet);
    }

    fn evict(&mut self, data: DataId) {
        self.tables.remove(&data.0);
    }

    fn recover(&mut self) -> Result<(), String> {
        *self = Self::new();
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 4. A lane of its own, beside those of the processor. The window's bounds are wide: what is best is found.
    let mut lanes: Vec<Lane<Squares>> = VirtualCpu::lanes(2, square).into_iter().map(Lane::from).collect();
    lanes.push(Lane::Windowed(Box::new(Board::new()), Window::default()));
    let hra = Hra::with_lanes(HraConfig { spans_kept: 500, ..HraConfig::default() }, lanes);

    let client = hra.client();
    let work = |n: u64| Squares { numbers: (n..n + 20_000).collect(), table: n / 500 };
    client.submit_group((0..2_000).map(|n| WorkUnit::new(work(n), n)).collect())?;
    while let Some(answer) = client.take() {
        let numbers = answer.output?;
        assert_eq!(numbers[0], answer.ticket * answer.ticket);
    }

    let report = hra.report();
    for resource in &report.resources {
        let name = &resource.descriptor.name;
        eprintln!("{name}: {} units, {:?} of {:?} at work", resource.units, resource.busy, report.uptime);
    }
    for incident in &report.incidents {
        eprintln!("{} {} {} times: {}", incident.resource, incident.fault, incident.count, incident.reason);
    }
    // 5. What was learnt, for the next run.
    eprintln!("{}", report.costs("example 1").to_json());
    println!("{}", timeline_svg(&report, None));
    Ok(())
}
